//! The crate compared with the second method on random set-ups with all kinds of dampers, the same in every run.

use crate::second_method::{Counts, Reference};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, FrictionDamper, Particle, Release, Restitution, SpeedTable, Tmd, Wall};
use damprig_structures::{
    Body, FrictionJoint, HarmonicForce, ImpactDamper, Mode, Modes, Motion, SetUp, State, TunedMass,
};
use fastrand::Rng;
use std::f64::consts::TAU;

/// Cycles of the excitation that each motion lasts.
const CYCLES: u32 = 30;

/// Change of the start whose growth tells how chaotic a motion is, relative to the displacements.
const NUDGE: f64 = 1e-10;

/// Largest growth of a change in a motion that is compared to its end.
const MAX_GROWTH: f64 = 1e3;

/// Allowed difference, relative to the displacements and to the growth of a change of the start.
const ALLOWED: f64 = 1e-9;

/// A random set-up with its excitation and its start.
#[derive(Clone, Debug)]
pub struct Case {
    pub set_up: SetUp,
    pub excitation: Excitation,
    pub start: State,
    /// Period of the excitation, or of the first mode in a free vibration, s.
    pub cycle_s: f64,
    /// Size of the displacements at the start, m.
    pub scale_m: f64,
}

pub struct Draw(pub Rng);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    fn coin(&mut self) -> bool {
        self.0.bool()
    }

    fn one_of(&mut self, count: usize) -> usize {
        self.0.usize(0..count)
    }

    fn structure(&mut self) -> Modes {
        let places = 2 + self.one_of(3);
        let count = 2 + self.one_of(7);
        let root = self.between(1.0, 2.0);
        let mut hz: Vec<f64> = (0..count).map(|_| 20.0_f64.powf(self.0.f64())).collect();
        hz.sort_by(f64::total_cmp);
        let modes = hz.into_iter().map(|hz| Mode {
            angular_frequency_rad_per_s: TAU * hz,
            damping_ratio: self.between(0.005, 0.05),
            shape: (0..places).map(|_| self.between(-1.0, 1.0) / root).collect(),
            participation: self.between(-1.0, 1.0) * root,
        });
        let modes: Vec<Mode> = modes.collect();
        let influence = (0..places).map(|_| if self.coin() { 1.0 } else { self.between(0.2, 1.5) }).collect();
        let coupling_per_s = if self.one_of(4) == 0 { self.coupling(count) } else { Vec::new() };
        Modes { modes, influence, coupling_per_s }
    }

    /// The damping matrix a aᵀ of one dashpot.
    fn coupling(&mut self, count: usize) -> Vec<f64> {
        let dashpot: Vec<f64> = (0..count).map(|_| self.between(-0.5, 0.5)).collect();
        dashpot.iter().flat_map(|a| dashpot.iter().map(move |b| a * b)).collect()
    }

    fn hard_wall(&mut self) -> Wall {
        match self.one_of(4) {
            0 => Wall::SpeedRestitution(Restitution {
                coefficient: self.between(0.3, 0.6),
                reference_speed_m_per_s: 0.1,
                exponent: self.between(0.05, 0.25),
                maximum: 0.8,
            }),
            1 => {
                let slow = self.between(0.6, 0.8);
                Wall::TableRestitution(SpeedTable::new(&[[0.05, slow], [0.2, 0.55], [0.6, 0.5]]).expect("three points"))
            }
            _ => Wall::Restitution { coefficient: self.between(0.1, 0.7) },
        }
    }

    fn soft_wall(&mut self, mass_kg: f64) -> Wall {
        let rate = TAU * self.between(8.0, 50.0);
        Wall::Voigt {
            stiffness_n_per_m: mass_kg * rate * rate,
            damping_n_s_per_m: if self.coin() { 2.0 * mass_kg * rate * self.between(0.02, 0.5) } else { 0.0 },
            release: if self.coin() { Release::ZeroForce } else { Release::ZeroPenetration },
        }
    }

    fn particle(&mut self) -> Particle {
        let mass_kg = self.between(0.02, 0.2);
        let wall = if self.one_of(3) == 0 { self.soft_wall(mass_kg) } else { self.hard_wall() };
        let positive_wall = match self.one_of(6) {
            0 => Some(self.hard_wall()),
            1 => Some(self.soft_wall(mass_kg)),
            _ => None,
        };
        Particle {
            mass_kg,
            clearance_m: self.between(2e-3, 15e-3),
            friction_coefficient: if self.coin() { self.between(0.01, 0.15) } else { 0.0 },
            wall,
            cavity: Cavity {
                positive_wall,
                offset_m: if self.one_of(3) == 0 { self.between(-5e-3, 5e-3) } else { 0.0 },
                inclination_deg: if self.one_of(3) == 0 { self.between(-30.0, 30.0) } else { 0.0 },
            },
        }
    }

    fn tuned_mass(&mut self, place: usize) -> TunedMass {
        let mass_kg = self.between(0.02, 0.2);
        let rate = TAU * self.between(1.0, 15.0);
        let tmd = Tmd {
            mass_kg,
            stiffness_n_per_m: mass_kg * rate * rate,
            damping_n_s_per_m: 2.0 * mass_kg * rate * self.between(0.0, 0.2),
        };
        TunedMass { place, tmd }
    }

    /// A motion near a resonance of one of the lower modes, or a free vibration.
    pub fn case(&mut self, number: usize) -> Case {
        let mut structure = self.structure();
        let places = structure.influence.len();
        // Two places that move in opposite directions, each with a particle.
        let is_mirrored = number % 10 == 2;
        if is_mirrored {
            for mode in &mut structure.modes {
                mode.shape[1] = -mode.shape[0];
            }
        }
        let mode = structure.modes[self.one_of(structure.modes.len().min(3))].clone();
        let turning = mode.angular_frequency_rad_per_s * self.between(0.9, 1.1);
        let phase_rad = self.between(-3.0, 3.0);
        let mut driven_place = None;
        let excitation = match if is_mirrored { 1 + self.one_of(2) } else { self.one_of(3) } {
            0 => {
                let amplitude_m = self.between(0.5e-3, 3e-3);
                Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: turning, phase_rad }
            }
            1 => {
                driven_place = Some(self.one_of(places));
                let amplitude_n = self.between(1e-3, 5e-3) * turning * turning;
                Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s: turning, phase_rad }
            }
            _ => Excitation::Fixed,
        };
        let is_free = excitation == Excitation::Fixed;
        let cycle_s = TAU / if is_free { structure.modes[0].angular_frequency_rad_per_s } else { turning };
        let size_m = if is_free { 30e-3 } else { 3e-3 };
        let modal: Vec<f64> = structure.modes.iter().map(|_| self.between(-size_m, size_m)).collect();
        let sets_off = if self.coin() { 0.05 } else { 0.0 };
        let modal_rate = structure.modes.iter().map(|_| sets_off * self.between(-1.0, 1.0)).collect();

        let mut set_up = SetUp { driven_place, ..SetUp::bare(structure) };
        if number % 5 < 2 {
            // Two friction joints that hold together for a part of each cycle.
            let force_n = if is_free { 3e-3 } else { 5e-3 } * turning * turning;
            let other = places - 1;
            for (place, other) in [(0, None), (other, self.coin().then_some(0))] {
                let damper = FrictionDamper { force_n: force_n * self.between(0.2, 1.0) };
                set_up.friction_dampers.push(FrictionJoint { place, other, damper });
            }
        }
        let twins = number % 10 == 1 || is_mirrored;
        if twins {
            let mut particle = self.particle();
            let hard = self.hard_wall();
            particle.wall = hard;
            particle.cavity.positive_wall = None;
            set_up.impact_dampers.push(ImpactDamper::new(0, particle));
            if is_mirrored {
                particle.cavity.offset_m = -particle.cavity.offset_m;
                particle.cavity.inclination_deg = -particle.cavity.inclination_deg;
            }
            set_up.impact_dampers.push(ImpactDamper::new(usize::from(is_mirrored), particle));
        } else {
            for _ in 0..1 + self.one_of(3) {
                let place = self.one_of(places);
                match self.one_of(5) {
                    0 => {
                        let tuned = self.tuned_mass(place);
                        set_up.tuned_masses.push(tuned);
                    }
                    1 if set_up.friction_dampers.is_empty() => {
                        let damper = FrictionDamper { force_n: self.between(0.3e-3, 4e-3) * turning * turning };
                        set_up.friction_dampers.push(FrictionJoint { place, other: None, damper });
                    }
                    _ => {
                        let particle = self.particle();
                        set_up.impact_dampers.push(ImpactDamper::new(place, particle));
                    }
                }
            }
        }
        let base = match excitation {
            Excitation::Sine { amplitude_m, .. } => {
                [amplitude_m * phase_rad.sin(), amplitude_m * turning * phase_rad.cos()]
            }
            _ => [0.0; 2],
        };
        let mut start = State { modal, modal_rate, ..State::default() };
        let at = |state: &State, place: usize| {
            let modes = &set_up.structure.modes;
            let sum = |q: &[f64]| modes.iter().zip(q).map(|(mode, q)| mode.shape[place] * q).sum::<f64>();
            let influence = set_up.structure.influence[place];
            Body {
                y_m: sum(&state.modal) + influence * base[0],
                u_m_per_s: sum(&state.modal_rate) + influence * base[1],
            }
        };
        let sideways = self.between(-0.5, 0.5);
        for (number, damper) in set_up.impact_dampers.iter().enumerate() {
            let place = at(&start, damper.place);
            let side = if is_mirrored && number == 1 { -1.0 } else { 1.0 };
            let share = if twins { side * sideways } else { self.between(-0.9, 0.9) };
            let y_m = place.y_m + damper.particle.cavity.offset_m + share * damper.particle.clearance_m;
            // Some start at rest in their cavities, the others at rest in space.
            let u_m_per_s = if number % 2 == 0 || twins { place.u_m_per_s } else { 0.0 };
            start.particles.push(Body { y_m, u_m_per_s });
        }
        start.tuned_masses = set_up.tuned_masses.iter().map(|tuned| at(&start, tuned.place)).collect();
        let clearance_m = set_up.impact_dampers.iter().map(|damper| damper.particle.clearance_m).fold(1e-3, f64::max);
        let scale_m = (0..places).map(|place| at(&start, place).y_m.abs()).fold(clearance_m, f64::max);
        // Half of the bases that move have a force beside them, as large as the one that drives alone.
        if matches!(excitation, Excitation::Sine { .. }) && self.coin() {
            let amplitude_n = self.between(1e-3, 5e-3) * turning * turning;
            let (place, phase_rad) = (self.one_of(places), self.between(-3.0, 3.0));
            set_up.force_beside_base = Some(HarmonicForce { place, amplitude_n, phase_rad });
        }
        Case { set_up, excitation, start, cycle_s, scale_m }
    }
}

/// What a comparison found.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    pub cycles: u32,
    growth: f64,
    /// Largest difference relative to the displacements and the growth.
    pub worst: f64,
    is_chaotic: bool,
    pub is_refused: bool,
    sticks_twice: bool,
    double_impacts: u32,
    /// Of the second method.
    pub counts: Counts,
}

impl Case {
    /// The case from a start that differs by this share of the displacements.
    fn nudged(&self, nudge: f64) -> Self {
        let mut start = self.start.clone();
        let size = nudge * self.scale_m;
        for q in &mut start.modal {
            *q += size;
        }
        Self { start, ..self.clone() }
    }

    fn reference(&self) -> Result<Reference, &'static str> {
        Reference::new(&self.set_up, &self.excitation, &self.start, self.cycle_s, self.scale_m)
    }

    /// Compares the crate's motion with that of the second method at the ends of the cycles, until a change of the start has grown
    /// too much.
    fn compare(&self, motion: &mut Motion) -> Result<Outcome, String> {
        self.compare_cycles(motion, CYCLES, NUDGE, ALLOWED)
    }

    /// The same over so many cycles, with another change of the start and another difference allowed.
    pub fn compare_cycles(
        &self,
        motion: &mut Motion,
        cycles: u32,
        nudge: f64,
        allowed: f64,
    ) -> Result<Outcome, String> {
        let mut reference = self.reference()?;
        let mut beside = self.nudged(nudge).reference()?;
        let mut outcome = Outcome { growth: 1.0, ..Outcome::default() };
        for cycle in 1..=cycles {
            reference.cycle().map_err(|error| format!("second method, cycle {cycle}: {error}"))?;
            beside.cycle().map_err(|error| format!("second method beside, cycle {cycle}: {error}"))?;
            let state = reference.state();
            let unit = reference.scale_m();
            outcome.growth = outcome.growth.max(reference.apart_m(&state, &beside.state()) / (nudge * self.scale_m));
            if outcome.growth > MAX_GROWTH {
                outcome.is_chaotic = true;
                break;
            }
            if let Err(error) = motion.run(f64::from(cycle) * self.cycle_s, &mut ()) {
                println!("refused in cycle {cycle}: {error}");
                outcome.is_refused = true;
                break;
            }
            let apart = reference.apart_m(&state, &motion.state()) / (unit * outcome.growth);
            if apart.is_nan() || apart > allowed {
                let growth = outcome.growth;
                return Err(format!(
                    "cycle {cycle}: {apart:.1e} apart at a growth of {growth:.1}, {:?}",
                    reference.counts
                ));
            }
            outcome.worst = outcome.worst.max(apart);
            outcome.cycles = cycle;
        }
        outcome.counts = reference.counts;
        outcome.sticks_twice = reference.counts.double_sticks > 0;
        outcome.double_impacts = reference.counts.double_impacts;
        Ok(outcome)
    }
}

/// All 200 with `DAMPRIG_FULL`, else the first 40.
#[test]
fn motions_of_random_set_ups_agree_with_the_second_method() {
    let count = if std::env::var_os("DAMPRIG_FULL").is_some() { 200 } else { 40 };
    let (mut compared, mut chaotic, mut refused, mut cycles) = (0, 0, 0, 0);
    let (mut sticking, mut struck, mut unresolved, mut worst) = (0, 0, 0, 0.0_f64);
    let mut wrong = Vec::new();
    for number in 0..count {
        let case = Draw(Rng::with_seed(number as u64)).case(number);
        let mut motion = match Motion::new(&case.set_up, &case.excitation, &case.start) {
            Ok(motion) => motion,
            Err(error) => {
                println!("{number} refused: {error}");
                refused += 1;
                continue;
            }
        };
        let found = case.compare(&mut motion);
        unresolved += usize::from(motion.unresolved() > 0);
        match found {
            Ok(outcome) => {
                compared += usize::from(outcome.cycles == CYCLES);
                refused += usize::from(outcome.is_refused);
                chaotic += usize::from(outcome.is_chaotic);
                sticking += usize::from(outcome.sticks_twice);
                struck += usize::from(outcome.double_impacts > 0);
                cycles += outcome.cycles;
                worst = worst.max(outcome.worst);
            }
            Err(error) => wrong.push(format!("{number}: {error}")),
        }
    }
    println!(
        "{compared} of {count} compared over {CYCLES} cycles, {chaotic} chaotic, {refused} refused; {cycles} cycles, largest \
         difference {worst:.1e} of the displacements times the growth; {sticking} with two joints stuck at once, {struck} \
         with impacts at one instant, {unresolved} with steps without guards"
    );
    assert!(wrong.is_empty(), "{} of {count} differ:\n{}", wrong.len(), wrong.join("\n"));
    assert!(50 * refused <= count, "{refused} of {count} refused");
    assert!(2 * compared >= count, "only {compared} of {count} compared");
    assert!(4 * sticking >= count && 10 * struck >= count, "{sticking} stick twice, {struck} are struck twice");
}

/// Intervals of a cycle in which the base follows cubics. Within one, their velocity deviates by √3/216 (2π/2000)³ = 2.5e-10 of the sine's, and so
/// does that of each event.
const CUBICS: u32 = 2000;

/// The cubic with the values and slopes of a sine at both ends of an interval of length h, as powers of the time in it.
pub fn cubic(excitation: &Excitation, from_s: f64, h: f64) -> [f64; 4] {
    let Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: turning, phase_rad } = *excitation else {
        panic!("a sine");
    };
    let at = |t: f64| {
        let (sine, cosine) = (turning * t + phase_rad).sin_cos();
        (amplitude_m * sine, amplitude_m * turning * cosine)
    };
    let ((z0, v0), (z1, v1)) = (at(from_s), at(from_s + h));
    let rise = (z1 - z0) / h;
    [z0, v0, (3.0 * rise - 2.0 * v0 - v1) / h, (v0 + v1 - 2.0 * rise) / (h * h)]
}

/// The base as a sine and as cubics, on structures whose places the base moves differently.
#[test]
fn a_base_of_cubics_moves_random_set_ups_as_the_sine_through_their_ends() {
    let count = if std::env::var_os("DAMPRIG_FULL").is_some() { 200 } else { 60 };
    // Of a few events of a cycle, which later ones carry on.
    let allowed = 4.0 * ALLOWED;
    let (mut compared, mut worst) = (0, 0.0_f64);
    for number in 0..count {
        let mut case = Draw(Rng::with_seed(number as u64)).case(number);
        if !matches!(case.excitation, Excitation::Sine { .. }) {
            continue;
        }
        case.set_up.force_beside_base = None;
        let mut motion = Motion::new(&case.set_up, &case.excitation, &case.start).expect("it starts");
        let mut beside = Motion::new(&case.set_up, &case.excitation, &case.nudged(NUDGE).start).expect("it starts");
        let h = case.cycle_s / f64::from(CUBICS);
        let part = |n: u32| cubic(&case.excitation, f64::from(n) * h, h);
        let mut on_cubics = Motion::on_base(&case.set_up, part(0), &case.start).expect("it starts");
        let (mut growth, mut unit) = (1.0_f64, case.scale_m);
        for n in 0..5 * CUBICS {
            if n > 0 {
                on_cubics.follow(part(n)).expect("it goes on");
            }
            on_cubics.run(f64::from(n + 1) * h, &mut ()).expect("it goes on");
            if (n + 1) % CUBICS > 0 {
                continue;
            }
            let until_s = f64::from(n + 1) * h;
            motion.run(until_s, &mut ()).expect("it goes on");
            beside.run(until_s, &mut ()).expect("it goes on");
            let state = motion.state();
            unit = state.modal.iter().fold(unit, |most, q| most.max(q.abs()));
            growth = growth.max(apart_m(&state, &beside.state()) / (NUDGE * case.scale_m));
            if growth > MAX_GROWTH {
                break;
            }
            let apart = apart_m(&state, &on_cubics.state()) / (unit * growth);
            assert!(apart < allowed, "{number}, cycle {}: {apart:.1e} apart at a growth of {growth:.1}", n / CUBICS);
            worst = worst.max(apart);
            compared += 1;
        }
        assert_eq!(on_cubics.unresolved(), motion.unresolved(), "{number}");
    }
    println!("{compared} cycles compared, {worst:.1e} apart");
    assert!(2 * compared > count, "only {compared} cycles");
}

/// The largest difference of two states.
fn apart_m(a: &State, b: &State) -> f64 {
    let bodies = |state: &State| -> Vec<f64> {
        let others = state.particles.iter().chain(&state.tuned_masses).map(|body| body.y_m);
        state.modal.iter().copied().chain(others).collect()
    };
    bodies(a).iter().zip(bodies(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
