//! Lock-in: amplitude and phase of the response at one frequency, from the exact motion.

use crate::integrator::exact::response::integral;
use crate::integrator::exact::{Arc, Observer, series};

/// Fourier integral of x at the drive frequency over the observed time. Observe whole cycles only, so that no other
/// harmonic and no mean leaks in.
#[derive(Clone, Copy, Debug)]
pub struct FourierIntegral {
    angular_frequency_rad_per_s: f64,
    sine: f64,
    cosine: f64,
    length_s: f64,
}

impl FourierIntegral {
    /// Makes a lock-in at this angular frequency, rad/s; greater than 0.
    #[must_use]
    pub fn new(angular_frequency_rad_per_s: f64) -> Self {
        Self { angular_frequency_rad_per_s, sine: 0.0, cosine: 0.0, length_s: 0.0 }
    }

    /// Amplitude, m; 0 before the first arc.
    #[must_use]
    pub fn amplitude_m(&self) -> f64 {
        if self.length_s > 0.0 { 2.0 / self.length_s * libm::hypot(self.sine, self.cosine) } else { 0.0 }
    }

    /// Phase of x = amplitude · sin(Ωt + phase), rad, −π to π.
    #[must_use]
    pub fn phase_rad(&self) -> f64 {
        libm::atan2(self.cosine, self.sine)
    }
}

impl Observer for FourierIntegral {
    fn arc(&mut self, arc: &Arc<'_>) {
        let (span, end) = (arc.span(), arc.end_fraction());
        let phase = |at: f64| self.angular_frequency_rad_per_s * (arc.start_s + at * span.step_s);
        let sine = integral(end, |at| series::value(&span.x, at) * libm::sin(phase(at)));
        let cosine = integral(end, |at| series::value(&span.x, at) * libm::cos(phase(at)));
        self.sine += sine * span.step_s;
        self.cosine += cosine * span.step_s;
        self.length_s += arc.length_s;
    }
}
