//! What drives the structure: a motion of the base, a force.

use damprig_core::integrator::exact;
use damprig_core::integrator::exact::time::Time;

/// Base motion and force at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive {
    /// z, m.
    pub base_m: f64,
    /// z′, m/s.
    pub base_velocity_m_per_s: f64,
    /// Force on the structure, N.
    pub force_n: f64,
}

/// Drives the structure.
pub trait Excitation {
    /// Base motion and force at `t_s`, s.
    fn at(&self, t_s: f64) -> Drive;
}

impl Excitation for exact::Excitation {
    fn at(&self, t_s: f64) -> Drive {
        let wave = self.wave(Time::at(t_s));
        if self.moves_base() {
            let base_velocity_m_per_s = self.angular_frequency_rad_per_s() * wave.cosine;
            Drive { base_m: wave.offset + wave.sine, base_velocity_m_per_s, force_n: 0.0 }
        } else {
            Drive { force_n: wave.offset + wave.sine, ..Drive::default() }
        }
    }
}
