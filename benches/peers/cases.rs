//! Benchmark cases: an impact damper with a mass ratio of 0.1 on a structure with 0.38 % damping, from rest.

use std::f64::consts::{PI, TAU};

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, Excitation, Impact, Observer, Work};
use damprig_core::integrator::sampled::Sampled;
use damprig_core::integrator::units::Units;
use damprig_core::model::{Cavity, FrictionDamper, Initial, Particle, SetUp, Structure, Wall};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

const DAMPING_RATIO: f64 = 0.0038;
const MASS_RATIO: f64 = 0.1;
pub const NATURAL_FREQUENCY_HZ: f64 = 2.5;
pub const RECORD_STEP_S: f64 = 1.0 / 200.0;

/// A damper on a base with a sine of amplitude 1.
#[derive(Clone, Copy)]
pub struct Setting {
    pub restitution: f64,
    pub clearance_m: f64,
    pub ratio: f64,
    pub cycles: f64,
}

impl Setting {
    pub fn angular_frequency_rad_per_s(&self) -> f64 {
        self.ratio * TAU * NATURAL_FREQUENCY_HZ
    }

    pub fn end_s(&self) -> f64 {
        self.cycles * TAU / self.angular_frequency_rad_per_s()
    }

    pub fn set_up(&self) -> SetUp {
        let structure = Structure::from_modal(1.0, NATURAL_FREQUENCY_HZ, DAMPING_RATIO);
        let particle = Particle {
            mass_kg: MASS_RATIO,
            clearance_m: self.clearance_m,
            friction_coefficient: 0.0,
            wall: Wall::Restitution { coefficient: self.restitution },
            cavity: Cavity::default(),
        };
        SetUp { particle: Some(particle), ..SetUp::bare(structure) }
    }

    fn motion(&self, x_m: f64) -> Exact {
        let sine = Excitation::Sine {
            amplitude_m: 1.0,
            angular_frequency_rad_per_s: self.angular_frequency_rad_per_s(),
            phase_rad: 0.0,
        };
        Exact::new(&self.set_up(), &sine, &Initial { x_m, ..Initial::default() }).expect("a physical set-up")
    }
}

/// Approach speed of the last impact, m/s, and number of impacts.
#[derive(Default)]
struct Last {
    speed_m_per_s: f64,
    impacts: u64,
}

impl Observer for Last {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.speed_m_per_s = impact.approach_speed_m_per_s;
        self.impacts += 1;
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Case {
    A,
    B,
    C,
    D,
}

impl Case {
    pub const ALL: [Self; 4] = [Self::A, Self::B, Self::C, Self::D];

    pub fn title(self) -> String {
        match self {
            Self::A => "A regular, r 1, e 0.5, d/Z 10",
            Self::B => "B chaotic, r 1, e 0.5, d/Z 15",
            Self::C => "C chatter, r 1, e 0.3, d/Z 20",
            Self::D => "D sweep, r 0.8–1.2, d/Z 10",
        }
        .to_owned()
    }

    pub fn settings(self) -> Vec<Setting> {
        let one = |restitution, clearance_m, cycles| Setting { restitution, clearance_m, ratio: 1.0, cycles };
        match self {
            Self::A => vec![one(0.5, 10.0, 400.0)],
            Self::B => vec![one(0.5, 15.0, 400.0)],
            Self::C => vec![one(0.3, 20.0, 100.0)],
            Self::D => (0..21)
                .map(|n| Setting { ratio: 0.8 + 0.02 * f64::from(n), cycles: 80.0, ..one(0.5, 10.0, 80.0) })
                .collect(),
        }
    }

    pub fn cycles(self) -> f64 {
        self.settings().iter().map(|s| s.cycles).sum()
    }

    /// Whether the peers complete the case: accumulating impacts stall a general solver without resting contact.
    pub fn peers_finish(self) -> bool {
        matches!(self, Self::A | Self::D)
    }

    pub fn sum(self, run: impl Fn(&Setting) -> f64) -> f64 {
        self.settings().iter().map(run).sum()
    }

    /// Case C: mean over the second half of the cycle maxima of |x|, m. Other cases: approach speed of the last
    /// impact, m/s (case D: the sum over its settings).
    pub fn exact(self) -> f64 {
        if self == Self::C {
            return self.mean_cycle_maximum(0.0);
        }
        self.sum(|setting| {
            let (mut motion, mut last) = (setting.motion(0.0), Last::default());
            motion.run(setting.end_s(), &mut last);
            last.speed_m_per_s
        })
    }

    /// Mean over the second half of the cycle maxima of |x|, m, from a start `x_m` away from rest.
    pub fn mean_cycle_maximum(self, x_m: f64) -> f64 {
        self.sum(|setting| {
            let mut motion = setting.motion(x_m);
            let half = (setting.cycles / 2.0).floor();
            let cycle_s = setting.end_s() / setting.cycles;
            motion.run(half * cycle_s, &mut ());
            let wanted = Wanted { cycle_s: Some(cycle_s), steady_from_cycle: Some(half as u64), ..Wanted::default() };
            let mut response = Response::new(wanted);
            motion.run(setting.end_s(), &mut response);
            response.finish(setting.end_s());
            response.steady_m().map_or(0.0, |(_, mean)| mean)
        })
    }

    /// Returns the engine's work counters, the number of impacts, and the number of cycles.
    pub fn work(self) -> (Work, u64, f64) {
        let (mut sum, mut impacts) = (Work::default(), 0);
        for setting in self.settings() {
            let (mut motion, mut last) = (setting.motion(0.0), Last::default());
            motion.run(setting.end_s(), &mut last);
            let work = motion.work();
            sum.arcs_proved += work.arcs_proved;
            sum.arcs_walked += work.arcs_walked;
            sum.newton_steps += work.newton_steps;
            sum.sines += work.sines;
            impacts += last.impacts;
        }
        (sum, impacts, self.cycles())
    }
}

/// Approach speed on the orbit of case A, with two equispaced impacts per cycle, m/s.
pub fn orbit_approach_speed() -> f64 {
    let setting = Case::A.settings()[0];
    let orbit = damprig_core::analysis::symmetric_orbit::SymmetricOrbit::new(
        &setting.set_up(),
        1.0,
        setting.angular_frequency_rad_per_s(),
    )
    .expect("case A has its orbit");
    orbit.approach_speed_m_per_s
}

/// A hybrid damper, and ten seconds of a base motion like an earthquake's: seeded filtered noise, in m.
pub fn record() -> (SetUp, Vec<f64>) {
    let mut set_up = Setting { restitution: 0.5, clearance_m: 0.03, ratio: 1.0, cycles: 1.0 }.set_up();
    set_up.friction_damper = Some(FrictionDamper { force_n: 0.3 });
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
    let (mut x, mut v) = (0.0, 0.0);
    let (rate, h) = (2.0 * PI * 1.5, RECORD_STEP_S);
    let samples = (0..2000)
        .map(|n| {
            let white = rng.next_u32() as f64 / f64::from(u32::MAX) - 0.5;
            let envelope = (PI * f64::from(n) / 2000.0).sin();
            v += h * (40.0 * envelope * white - 1.2 * rate * v - rate * rate * x);
            x += h * v;
            x
        })
        .collect();
    (set_up, samples)
}

/// Largest |x| of the sampled integrator for the record, m.
pub fn sampled(set_up: &SetUp, samples: &[f64]) -> f64 {
    let units = Units::metres(RECORD_STEP_S);
    let mut motion = Sampled::<f64>::new(set_up, units, &Initial::default()).expect("a physical set-up");
    let slope = |n: usize| 0.5 * (samples[(n + 1).min(samples.len() - 1)] - samples[n.saturating_sub(1)]);
    let mut most = 0.0_f64;
    for n in 0..samples.len() - 1 {
        motion.step(&BaseSegment::hermite(samples[n], samples[n + 1], slope(n), slope(n + 1)), &mut ());
        most = most.max(motion.state().x.abs());
    }
    most
}
