//! Energy balance of a motion: input work, dissipation by mechanism, and stored energy.
//!
//! The base (or the force) does work on the system. The structure's dashpot, impacts, internal friction, the friction
//! damper and the link of a soft wall or tuned mass dissipate it. [`Balance::residual_j`] checks that there is no other
//! change of energy.
//!
//! The balance follows the state from the start. The energy loss of an impact is computed from the state before it by
//! the law of impact. Each arc, impact and accumulation must begin with the final state of the one before it. Any
//! difference is a jump that no mechanism explains; the residual includes it even if the jump itself changes no energy.

use crate::integrator::exact::response::integral;
use crate::integrator::exact::{Accumulation, Arc, ExactState, Impact, Observer, series};
use crate::integrator::modes::{Contact, Grip, signed};
use crate::model::{ImpactLaw, SetUp};
use serde::Serialize;

/// Energy by mechanism since the start of the observation, J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Balance {
    /// Work of the base, and of the force, on the system.
    pub input_j: f64,
    /// Change of the stored energy (kinetic, elastic, and of the particle's weight): now minus at the start. Negative if the system
    /// gives off energy.
    pub stored_change_j: f64,
    /// Dissipated by the structure's dashpot.
    pub structure_damping_j: f64,
    /// Dissipated by impacts on hard walls, including the summed impacts of an accumulation.
    pub impacts_j: f64,
    /// Dissipated by friction between particle and structure.
    pub internal_friction_j: f64,
    /// Dissipated by the friction damper.
    pub friction_damper_j: f64,
    /// Dissipated by the dashpot of a soft wall or of the tuned mass.
    pub link_damping_j: f64,
    /// Imbalance plus all unexplained jumps of the state: rounding only in a correct motion.
    pub residual_j: f64,
}

impl Balance {
    /// Total dissipation.
    #[must_use]
    pub fn dissipated_j(&self) -> f64 {
        self.structure_damping_j
            + self.impacts_j
            + self.internal_friction_j
            + self.friction_damper_j
            + self.link_damping_j
    }
}

/// Observer that computes the energy balance of a run.
#[derive(Clone, Debug)]
pub struct EnergyMeter {
    set_up: SetUp,
    second_mass_kg: f64,
    /// k1, N/m, and c1, N·s/m, of a tuned mass, or of the soft walls at the negative and the positive side.
    links: [(f64, f64); 2],
    friction_n: f64,
    /// The particle's weight along the motion, N: positive along −y.
    weight_n: f64,
    /// The laws of impact of the hard walls at the negative and the positive side.
    restitution: [Option<ImpactLaw<f64>>; 2],
    /// All but its residual.
    balance: Balance,
    /// Magnitude of the energy that unexplained jumps of the state would transfer: rounding only in a correct motion.
    jumps_j: f64,
    /// The first state seen; used until the first arc gives the base displacement.
    first: Option<ExactState>,
    stored_at_start_j: Option<f64>,
    /// The state that follows from everything seen so far.
    last: Option<ExactState>,
    base_m: f64,
    /// Energy in the spring of the link at the end of the last arc, J.
    linked_j: f64,
}

impl EnergyMeter {
    /// An empty balance for a motion of `set_up`.
    #[must_use]
    pub fn new(set_up: &SetUp) -> Self {
        let (mut second_mass_kg, mut friction_n) = (0.0, 0.0);
        let (mut links, mut restitution) = ([(0.0, 0.0); 2], [None; 2]);
        if let Some(particle) = set_up.particle {
            second_mass_kg = particle.mass_kg;
            let horizontal_n = particle.friction_coefficient * particle.mass_kg * set_up.gravity_m_per_s2;
            friction_n = horizontal_n * particle.cavity.level();
            restitution = particle.walls().map(|wall| wall.impact_law(1.0));
            links = particle.walls().map(|wall| wall.spring_and_dashpot().unwrap_or_default());
        } else if let Some(tmd) = set_up.tmd {
            second_mass_kg = tmd.mass_kg;
            links[0] = (tmd.stiffness_n_per_m, tmd.damping_n_s_per_m);
        }
        Self {
            set_up: *set_up,
            second_mass_kg,
            links,
            friction_n,
            weight_n: second_mass_kg * set_up.weight_m_per_s2(),
            restitution,
            balance: Balance::default(),
            jumps_j: 0.0,
            first: None,
            stored_at_start_j: None,
            last: None,
            base_m: 0.0,
            linked_j: 0.0,
        }
    }

    /// The balance so far.
    #[must_use]
    pub fn balance(&self) -> Balance {
        let open = self.balance.input_j - self.balance.dissipated_j() - self.balance.stored_change_j;
        Balance { residual_j: open + libm::copysign(self.jumps_j, open), ..self.balance }
    }

    /// Energy in motion, in the springs and in the particle's weight; a link of that
    /// stiffness is pressed that far.
    fn stored_j(&self, state: &ExactState, base_m: f64, (stiffness, pressed): (f64, f64)) -> f64 {
        let structure = &self.set_up.structure;
        let (u, stretch) = (state.u_m_per_s(), state.x_m - base_m);
        0.5 * (structure.mass_kg * state.v_m_per_s * state.v_m_per_s
            + self.second_mass_kg * u * u
            + structure.stiffness_n_per_m * stretch * stretch
            + stiffness * pressed * pressed)
            + self.weight_n * state.y_m()
    }

    /// Energy that a jump from `from` to `to` would transfer: kinetic, and as work against the structure's spring.
    fn moved_j(&self, from: &ExactState, to: &ExactState) -> f64 {
        let structure = &self.set_up.structure;
        let speeds = |mass: f64, from: f64, to: f64| 0.5 * mass * (from.abs() + to.abs()) * (to - from).abs();
        let stretch = |state: &ExactState| (state.x_m - self.base_m).abs();
        let displaced = (to.x_m - from.x_m).abs() + (to.offset_m - from.offset_m).abs();
        speeds(structure.mass_kg, from.v_m_per_s, to.v_m_per_s)
            + speeds(self.second_mass_kg, from.u_m_per_s(), to.u_m_per_s())
            + 0.5 * structure.stiffness_n_per_m * (stretch(from) + stretch(to) + displaced) * displaced
            + self.weight_n.abs() * displaced
    }

    /// Takes the initial state of an arc or event. A difference from the last state is counted as a jump.
    fn continue_from(&mut self, state: &ExactState) {
        if let Some(last) = &self.last {
            self.jumps_j += self.moved_j(last, state);
        }
        self.first.get_or_insert(*state);
        self.last = Some(*state);
    }

    /// Applies the law of impact with restitution e to the last state: momentum is conserved and the relative velocity
    /// is multiplied by −e. The result must equal `after`.
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
        // The force on the base is the rate of change of the total momentum minus the applied force and the weight.
        self.balance.input_j += over(&mut |at| {
            let gained = (mass + second) * series::value(&x_second, at) + second * series::value(&slide_rate, at);
            let force = arc.applied_force_n(at);
            series::value(&z_rate, at) * (gained + self.weight_n - force) + series::value(&x_rate, at) * force
        });
        if let (Grip::Slip(_), Some(damper)) = (arc.mode.grip, self.set_up.friction_damper) {
            let slipped = series::value(&span.x, end) - span.x[0] - (series::value(&span.base, end) - span.base[0]);
            self.balance.friction_damper_j += damper.force_n * slipped.abs();
        }
        if let (Contact::Free(_), true) = (arc.mode.contact, self.friction_n > 0.0) {
            self.balance.internal_friction_j += self.friction_n * (arc.end.offset_m - arc.start.offset_m).abs();
        }
        let (stiffness, damping) = self.links[usize::from(arc.pressed_side() > 0)];
        let mut hertz_j = 0.0;
        let link = arc.link_rest_m().filter(|_| stiffness + damping > 0.0);
        if link.is_none() {
            // When a wall releases the particle early, its own dashpot dissipates the energy left in its spring.
            self.balance.link_damping_j += self.linked_j;
        }
        if link.is_some() {
            self.balance.link_damping_j += over(&mut |at| {
                let slide = series::value(&slide, at);
                damping * slide * slide
            });
        }
        if let Some((law, lag_s_per_m)) = arc.hertz_contact() {
            let (side, k) = (arc.pressed_side(), law.stiffness_n_per_m15);
            let depth = |offset: f64| signed(side, offset - arc.link_rest_m().unwrap_or_default()).max(0.0);
            self.balance.link_damping_j += over(&mut |at| {
                let (depth, slide) = (depth(series::value(&span.offset, at)), series::value(&slide, at));
                k * depth * libm::sqrt(depth) * lag_s_per_m * slide * slide
            });
            let elastic_j = |offset: f64| 0.4 * k * depth(offset) * depth(offset) * libm::sqrt(depth(offset));
            // What a wall that lagged behind the particle did not give back until it pushes again.
            self.balance.link_damping_j -= elastic_j(arc.start.offset_m);
            hertz_j = elastic_j(arc.end.offset_m);
        }
        let pressed = |offset: f64| link.map_or(0.0, |rest| offset - rest);
        let end_base_m = series::value(&span.base, end);
        let after = self.stored_j(&arc.end, end_base_m, (stiffness, pressed(arc.end.offset_m))) + hertz_j;
        let start = self.stored_at_start_j.unwrap_or_else(|| {
            let first = self.first.unwrap_or(arc.start);
            self.stored_j(&first, span.base[0], (stiffness, pressed(first.offset_m)))
        });
        self.stored_at_start_j = Some(start);
        self.balance.stored_change_j = after - start;
        let pressed = pressed(arc.end.offset_m);
        self.linked_j = 0.5 * stiffness * pressed * pressed + hertz_j;
        (self.base_m, self.last) = (end_base_m, Some(arc.end));
    }

    fn impact(&mut self, impact: &Impact) {
        self.continue_from(&impact.before);
        match &self.restitution[usize::from(impact.side > 0)] {
            Some(law) => self.impact_of(law.at(impact.approach_speed_m_per_s), &impact.after),
            None => self.continue_from(&impact.after),
        }
    }

    fn accumulation(&mut self, accumulation: &Accumulation) {
        self.continue_from(&accumulation.before);
        // The summed impacts together change the velocities like one impact without restitution, plus the effect of the
        // spring meanwhile.
        let mut after = accumulation.after;
        after.v_m_per_s -= accumulation.spring_m_per_s;
        self.impact_of(0.0, &after);
        self.last = Some(accumulation.after);
    }
}
