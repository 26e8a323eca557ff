//! Amplitudes and phase of the recorded x and z, as the controller computed them during the run: its numbers are not recorded.

use std::f64::consts::TAU;

use damprig_core::measure::running::{DriveReference, RunningLockIn};

use crate::monitor::numbers::SignalName;
use crate::monitor::running_ratio::OTHER_POINT;

/// Computes them, row by row. The cycles begin at any phase of the drive, which the phase of x relative to z does not depend on.
#[derive(Debug)]
pub(super) struct Recomputed {
    /// Columns of x and z.
    at: Option<(usize, usize)>,
    lock_in: RunningLockIn,
    frequency_hz: f64,
    /// Cycles of the drive since the last row that was used, below 1.
    phase: f64,
    last_s: f64,
}

impl Recomputed {
    /// What its values are of, as in the device's table.
    pub(super) fn signals() -> [SignalName; 5] {
        ["frequency", "x_amplitude", "x_phase", "z_amplitude", "x_over_z_lock_in"].map(SignalName::of)
    }

    pub(super) fn new(signals: &[SignalName]) -> Self {
        let at = |name: &str| signals.iter().position(|signal| signal.name == name);
        Self { at: at("x").zip(at("z")), lock_in: RunningLockIn::default(), frequency_hz: 0.0, phase: 0.0, last_s: 0.0 }
    }

    /// Adds a row.
    pub(super) fn push(&mut self, t_s: f64, frequency_hz: f64, row: &[f32]) {
        let Some((x, z)) = self.at else { return };
        let step = frequency_hz * (t_s - self.last_s);
        self.last_s = t_s;
        // Another point, or a gap, begins a new cycle. The frequency of a resonance that is followed moves by less.
        let is_same = (frequency_hz / self.frequency_hz - 1.0).abs() <= OTHER_POINT;
        if !is_same || !(0.0..0.5).contains(&step) {
            self.lock_in.push(0.0, 0.0, None);
            (self.frequency_hz, self.phase) = (frequency_hz, 0.0);
            return;
        }
        self.frequency_hz = frequency_hz;
        self.phase += step;
        let cycle_ended = self.phase >= 1.0;
        self.phase = self.phase.fract();
        let (sine, cosine) = (TAU * self.phase).sin_cos();
        let reference = DriveReference { wave: (sine as f32, cosine as f32), cycle_ended };
        self.lock_in.push(row[x], row[z], Some(reference));
    }

    /// The values over the last whole cycle; NaN where they are not known.
    pub(super) fn values(&self) -> [f32; 5] {
        let motion = self.lock_in.motion();
        let values = [motion.x_amplitude_m, motion.x_phase_rad, motion.z_amplitude_m, motion.x_over_z];
        let frequency_hz = if self.frequency_hz > 0.0 { self.frequency_hz as f32 } else { f32::NAN };
        // Unknown before the first whole cycle.
        let [a, b, c, d] = if motion.z_amplitude_m > 0.0 { values } else { [f32::NAN; 4] };
        [frequency_hz, a, b, c, d]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resonance_that_is_followed_has_amplitudes_and_another_point_begins_anew() {
        let mut recomputed = Recomputed::new(&["x", "z"].map(SignalName::of));
        let (mut cycles, mut frequency_hz) = (0.0, 2.5);
        for row in 0..400 {
            let angle = TAU * cycles;
            let own = [(-3e-3 * angle.cos()) as f32, (1e-3 * angle.sin()) as f32];
            recomputed.push(0.01 * f64::from(row), frequency_hz, &own);
            frequency_hz += 1e-5;
            cycles += 0.01 * frequency_hz;
        }
        let [hz, x_m, phase_rad, z_m, ratio] = recomputed.values();
        // 40 rows in a cycle, the last of which is a row longer or shorter: within 1/40.
        assert!((hz - 2.504).abs() < 1e-3 && (x_m / 3e-3 - 1.0).abs() < 0.025 && (z_m / 1e-3 - 1.0).abs() < 0.025);
        assert!((ratio - 3.0).abs() < 0.15 && (f64::from(phase_rad) + TAU / 4.0).abs() < 0.05, "{ratio} {phase_rad}");
        recomputed.push(4.0, 2.6, &[0.0, 0.0]);
        assert!(recomputed.values()[1..].iter().all(|value| value.is_nan()));
    }
}
