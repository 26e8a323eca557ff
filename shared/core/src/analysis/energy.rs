//! Where the energy comes from and where it goes, mechanism by mechanism.
//!
//! The base (or the force) does work on the system; dashpot, impacts, internal friction, friction damper and the link
//! of a soft wall or tuned mass take it. Nothing else may: [`Balance::residual_j`] is the check.
//!
//! The books follow the state from the start on. An impact is booked with what the law of impact takes from the state
//! before it, and each arc, impact and accumulation must begin with the state that the one before it left. What departs
//! from that is a jump that no mechanism explains, and the residual shows it, also where the jump itself changes no energy.

use crate::integrator::exact::response::integral;
use crate::integrator::exact::{Accumulation, Arc, ExactState, Impact, Observer, series};
use crate::integrator::modes::{Contact, Grip};
use crate::model::{SetUp, Wall};

/// Energy by mechanism since the start of the observation, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// Work of the base, and of the force, on the system.
    pub input_j: f64,
    /// Taken by the structure's dashpot.
    pub structure_damping_j: f64,
    /// Taken by impacts on hard walls, also those of an accumulation that were summed.
    pub impacts_j: f64,
    /// Taken by friction between particle and structure.
    pub internal_friction_j: f64,
    /// Taken by the friction damper.
    pub friction_damper_j: f64,
    /// Taken by the dashpot of a soft wall or of the tuned mass.
    pub link_damping_j: f64,
    /// Kinetic and elastic energy now less that at the start.
    pub stored_j: f64,
    /// What jumps of the state that no mechanism explains would move, sign aside: rounding, if the motion is right.
    pub jumps_j: f64,
}

impl Balance {
    /// All that was taken.
    #[must_use]
    pub fn dissipated_j(&self) -> f64 {
        self.structure_damping_j
            + self.impacts_j
            + self.internal_friction_j
            + self.friction_damper_j
            + self.link_damping_j
    }

    /// What the balance leaves open, and every unexplained jump on top of it: rounding, if the motion is right.
    #[must_use]
    pub fn residual_j(&self) -> f64 {
        let open = self.input_j - self.dissipated_j() - self.stored_j;
        open + libm::copysign(self.jumps_j, open)
    }
}

/// Keeps the balance of a run.
#[derive(Clone, Debug)]
pub struct EnergyMeter {
    set_up: SetUp,
    second_mass_kg: f64,
    link_stiffness: f64,
    link_damping: f64,
    friction_n: f64,
    restitution: Option<f64>,
    balance: Balance,
    /// The first state seen, until the first arc says where the base was.
    first: Option<ExactState>,
    stored_at_start_j: Option<f64>,
    /// The state that everything seen so far leads to.
    last: Option<ExactState>,
    base_m: f64,
    pressed_m: f64,
}

impl EnergyMeter {
    /// Of a motion of `set_up`.
    #[must_use]
    pub fn new(set_up: &SetUp) -> Self {
        let (mut second_mass_kg, mut link_stiffness, mut link_damping, mut friction_n) = (0.0, 0.0, 0.0, 0.0);
        let mut restitution = None;
        if let Some(particle) = set_up.particle {
            second_mass_kg = particle.mass_kg;
            friction_n = particle.friction_coefficient * particle.mass_kg * set_up.gravity_m_per_s2;
            match particle.wall {
                Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, .. } => {
                    (link_stiffness, link_damping) = (stiffness_n_per_m, damping_n_s_per_m);
                }
                Wall::Restitution { coefficient } => restitution = Some(coefficient),
            }
        } else if let Some(tmd) = set_up.tmd {
            second_mass_kg = tmd.mass_kg;
            (link_stiffness, link_damping) = (tmd.stiffness_n_per_m, tmd.damping_n_s_per_m);
        }
        Self {
            set_up: *set_up,
            second_mass_kg,
            link_stiffness,
            link_damping,
            friction_n,
            restitution,
            balance: Balance::default(),
            first: None,
            stored_at_start_j: None,
            last: None,
            base_m: 0.0,
            pressed_m: 0.0,
        }
    }

    /// The balance so far.
    #[must_use]
    pub fn balance(&self) -> Balance {
        self.balance
    }

    fn stored_j(&self, state: &ExactState, base_m: f64, pressed: f64) -> f64 {
        let structure = &self.set_up.structure;
        let (u, stretch) = (state.u_m_per_s(), state.x_m - base_m);
        0.5 * (structure.mass_kg * state.v_m_per_s * state.v_m_per_s
            + self.second_mass_kg * u * u
            + structure.stiffness_n_per_m * stretch * stretch
            + self.link_stiffness * pressed * pressed)
    }

    /// What a jump from `from` to `to` would move: as kinetic energy, and as work against the structure's spring.
    fn moved_j(&self, from: &ExactState, to: &ExactState) -> f64 {
        let structure = &self.set_up.structure;
        let speeds = |mass: f64, from: f64, to: f64| 0.5 * mass * (from.abs() + to.abs()) * (to - from).abs();
        let stretch = |state: &ExactState| (state.x_m - self.base_m).abs();
        let displaced = (to.x_m - from.x_m).abs() + (to.offset_m - from.offset_m).abs();
        speeds(structure.mass_kg, from.v_m_per_s, to.v_m_per_s)
            + speeds(self.second_mass_kg, from.u_m_per_s(), to.u_m_per_s())
            + 0.5 * structure.stiffness_n_per_m * (stretch(from) + stretch(to) + displaced) * displaced
    }

    /// Takes the state with which an arc or an event begins: where what came before it has led, or there was a jump.
    fn continue_from(&mut self, state: &ExactState) {
        if let Some(last) = &self.last {
            self.balance.jumps_j += self.moved_j(last, state);
        }
        self.first.get_or_insert(*state);
        self.last = Some(*state);
    }

    /// An impact with restitution e at the state reached, by its law: momentum is kept and the relative velocity times −e.
    /// What it leaves must be `after`.
    fn impact_of(&mut self, restitution: f64, after: &ExactState) {
        let Some(before) = self.last else { return };
        let (mass, second) = (self.set_up.structure.mass_kg, self.second_mass_kg);
        let share = second / (mass + second);
        let slide = before.slide_m_per_s;
        self.balance.impacts_j += 0.5 * mass * share * (1.0 - restitution * restitution) * slide * slide;
        self.last = Some(ExactState {
            v_m_per_s: before.v_m_per_s + share * (1.0 + restitution) * slide,
            slide_m_per_s: -restitution * slide,
            ..before
        });
        self.continue_from(after);
    }
}

impl Observer for EnergyMeter {
    fn start(&mut self, _time_s: f64, state: &ExactState) {
        self.continue_from(state);
    }

    fn arc(&mut self, arc: &Arc<'_>) {
        let (span, end) = (arc.span(), arc.end_fraction());
        self.base_m = span.base[0];
        self.continue_from(&arc.start);
        let (h, per_step) = (span.step_s, 1.0 / span.step_s);
        let rate = |p: &series::Series| series::derivative(p).map(|c| c * per_step);
        let (x_rate, z_rate, slide) = (rate(&span.x), rate(&span.base), rate(&span.offset));
        let (x_second, slide_rate) = (rate(&x_rate), rate(&slide));
        let structure = &self.set_up.structure;
        let (mass, second) = (structure.mass_kg, self.second_mass_kg);
        let over = |f: &mut dyn FnMut(f64) -> f64| h * integral(end, f);

        self.balance.structure_damping_j += over(&mut |at| {
            let slip = series::value(&x_rate, at) - series::value(&z_rate, at);
            structure.damping_n_s_per_m * slip * slip
        });
        // The base pushes with whatever the momentum of everything on it gains beyond what the force gives.
        self.balance.input_j += over(&mut |at| {
            let gained = (mass + second) * series::value(&x_second, at) + second * series::value(&slide_rate, at);
            let force = arc.applied_force_n(at);
            series::value(&z_rate, at) * (gained - force) + series::value(&x_rate, at) * force
        });
        if let (Grip::Slip(_), Some(damper)) = (arc.mode.grip, self.set_up.friction_damper) {
            let slipped = series::value(&span.x, end) - span.x[0] - (series::value(&span.base, end) - span.base[0]);
            self.balance.friction_damper_j += damper.force_n * slipped.abs();
        }
        if let (Contact::Free(_), true) = (arc.mode.contact, self.friction_n > 0.0) {
            self.balance.internal_friction_j += self.friction_n * (arc.end.offset_m - arc.start.offset_m).abs();
        }
        let link = arc.link_rest_m().filter(|_| self.link_stiffness + self.link_damping > 0.0);
        if link.is_none() {
            // What the spring of a wall keeps when it lets go early goes into its own dashpot.
            self.balance.link_damping_j += 0.5 * self.link_stiffness * self.pressed_m * self.pressed_m;
        }
        if link.is_some() {
            self.balance.link_damping_j += over(&mut |at| {
                let slide = series::value(&slide, at);
                self.link_damping * slide * slide
            });
        }
        let pressed = |offset: f64| link.map_or(0.0, |rest| offset - rest);
        let end_base_m = series::value(&span.base, end);
        let after = self.stored_j(&arc.end, end_base_m, pressed(arc.end.offset_m));
        let start = self.stored_at_start_j.unwrap_or_else(|| {
            let first = self.first.unwrap_or(arc.start);
            self.stored_j(&first, span.base[0], pressed(first.offset_m))
        });
        self.stored_at_start_j = Some(start);
        self.balance.stored_j = after - start;
        self.pressed_m = pressed(arc.end.offset_m);
        (self.base_m, self.last) = (end_base_m, Some(arc.end));
    }

    fn impact(&mut self, impact: &Impact) {
        self.continue_from(&impact.before);
        match self.restitution {
            Some(restitution) => self.impact_of(restitution, &impact.after),
            None => self.continue_from(&impact.after),
        }
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        self.continue_from(&accumulation.before);
        // All impacts to come together leave what one without restitution does, and what the spring does meanwhile.
        let mut after = accumulation.after;
        after.v_m_per_s -= accumulation.spring_m_per_s;
        self.impact_of(0.0, &after);
        self.last = Some(accumulation.after);
    }
}
