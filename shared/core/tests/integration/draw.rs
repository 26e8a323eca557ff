//! Random set-ups, excitations and initial states, the same in every run.

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, FrictionDamper, Initial, Particle, SetUp, Structure, Wall};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

pub struct Draw(Xoshiro256PlusPlus);

impl Draw {
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn coin(&mut self) -> bool {
        self.0.next_u32() & 1 == 1
    }

    /// A number from 0, less than `count`.
    pub fn one_of(&mut self, count: u32) -> u32 {
        self.0.next_u32() % count
    }

    /// A particle between walls that `wall` draws, with friction in half the cases, under a friction damper in half of them.
    pub fn set_up(&mut self, wall: impl FnOnce(&mut Self) -> Wall) -> SetUp {
        let structure = Structure::from_modal(self.between(0.5, 4.0), self.between(1.0, 6.0), self.between(0.0, 0.08));
        let particle = Particle {
            mass_kg: structure.mass_kg * self.between(0.02, 0.4),
            clearance_m: self.between(2e-3, 40e-3),
            friction_coefficient: if self.coin() { self.between(0.0, 0.2) } else { 0.0 },
            wall: wall(self),
            cavity: Cavity::default(),
        };
        let friction_damper = self.coin().then(|| FrictionDamper { force_n: self.between(0.05, 2.0) });
        SetUp { particle: Some(particle), friction_damper, ..SetUp::bare(structure) }
    }

    /// A sine about the natural frequency.
    pub fn sine(&mut self, set_up: &SetUp) -> Excitation {
        Excitation::Sine {
            amplitude_m: self.between(0.5e-3, 4e-3),
            angular_frequency_rad_per_s: set_up.structure.angular_frequency_rad_per_s() * self.between(0.5, 1.6),
            phase_rad: self.between(-3.0, 3.0),
        }
    }

    /// A state with the particle within its cavity, or a tuned mass within 5 mm.
    pub fn initial(&mut self, set_up: &SetUp) -> Initial {
        let x_m = self.between(-20e-3, 20e-3);
        let [low, high] = set_up.particle.map_or([-5e-3, 5e-3], |particle| particle.ends_m());
        Initial {
            x_m,
            v_m_per_s: self.between(-0.3, 0.3),
            y_m: x_m + low + (high - low) * self.between(0.01, 0.99),
            u_m_per_s: self.between(-0.3, 0.3),
        }
    }
}
