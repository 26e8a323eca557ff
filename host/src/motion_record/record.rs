//! Recorded base motion: evenly spaced samples of displacement or acceleration, and the motion between them.
//!
//! An **acceleration** record is linear between its samples. Its base displacement is a cubic over each interval, known
//! exactly; the driver plays that cubic. No quadrature or filter is needed. Playing starts at z = 0 at rest. No baseline is
//! corrected: a constant error of the record makes z drift, but x − z, y − x, every force and every impact follow from
//! z″ alone, and a correction would change z″. So the relative quantities are those of the record as it is;
//! [`Record::drift_m`] gives the drift of the absolute ones. After its end the acceleration is zero.
//!
//! A **displacement** record is joined by cubics with continuous velocity through every sample (Catmull–Rom, as in
//! [`damprig_core::integrator::base`]). After its end the base stays where it is. Before its first sample the base rests there:
//! a record that starts with a velocity, as a sine does, starts with half of it, and the jump is smoothed over the first
//! interval ([`Record::start_jump_m_per_s`]).

use std::path::{Path, PathBuf};

use damprig_core::integrator::base::BaseSegment;

use crate::signal_file::unit::UnitKind;

/// Quantity of a record's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordQuantity {
    /// z, m.
    Displacement,
    /// z″, m/s².
    Acceleration,
}

impl RecordQuantity {
    /// As files spell it.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Acceleration => "acceleration",
            Self::Displacement => "displacement",
        }
    }

    /// The kind of a signal that is a record of it.
    pub(super) fn kind(self) -> UnitKind {
        match self {
            Self::Acceleration => UnitKind::Acceleration,
            Self::Displacement => UnitKind::Displacement,
        }
    }
}

/// Where a record is from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RecordOrigin {
    /// A file.
    File(PathBuf),
    /// A seed.
    Noise,
    /// The samples that a case has itself.
    Samples,
}

impl RecordOrigin {
    /// Its file, if it has one.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        if let Self::File(file) = self { Some(file) } else { None }
    }
}

/// Evenly spaced samples of the base's motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Where it is from.
    pub origin: RecordOrigin,
    /// Quantity of the samples.
    pub quantity: RecordQuantity,
    /// Time step, s; greater than 0.
    pub step_s: f64,
    /// In SI units; at least two.
    pub samples: Vec<f64>,
    /// Estimated change by resampling, RMS over that of the samples; none if the times of the file were even.
    pub resampling: Option<f64>,
}

impl Record {
    /// What was done to the samples of the file, for people.
    #[must_use]
    pub fn resampled_text(&self) -> Option<String> {
        self.resampling.map(|share| {
            format!(
                "its times jitter: resampled by cubics at {:.5} Hz, which changes it by {:.2e} of its RMS (estimated)",
                1.0 / self.step_s,
                share
            )
        })
    }

    /// Time from the first sample to the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.step_s * (self.samples.len() - 1) as f64
    }

    /// z at its start, m.
    #[must_use]
    pub fn start_m(&self) -> f64 {
        match self.quantity {
            RecordQuantity::Displacement => self.samples[0],
            RecordQuantity::Acceleration => 0.0,
        }
    }

    /// Largest magnitude of a sample, in its SI unit.
    #[must_use]
    pub fn peak(&self) -> f64 {
        self.samples.iter().fold(0.0, |most, s| most.max(s.abs()))
    }

    /// z at its end, m; of an acceleration, the drift of its uncorrected baseline.
    #[must_use]
    pub fn drift_m(&self) -> f64 {
        let mut play = self.play();
        let mut end = self.start_m();
        for _ in 1..self.samples.len() {
            end = play.next_segment().0.iter().sum();
        }
        end
    }

    /// Velocity of a displacement record in its first interval, m/s, if it is more than a hundredth of the largest: a jump from
    /// rest, which the cubic smooths over that interval. `None` for a record that starts at rest.
    #[must_use]
    pub fn start_jump_m_per_s(&self) -> Option<f64> {
        let rise = |pair: &[f64]| (pair[1] - pair[0]) / self.step_s;
        let largest = self.samples.windows(2).map(|pair| rise(pair).abs()).fold(0.0, f64::max);
        let first = self.samples.get(..2).map(rise)?;
        (self.quantity == RecordQuantity::Displacement && first.abs() > 0.01 * largest).then_some(first)
    }

    /// The motion, interval by interval from the start.
    #[must_use]
    pub fn play(&self) -> Play<'_> {
        Play { record: self, next: 0, z_m: self.start_m(), rise_m: 0.0 }
    }
}

/// Plays a record.
#[derive(Clone, Debug)]
pub struct Play<'a> {
    record: &'a Record,
    next: usize,
    z_m: f64,
    /// Velocity, m per interval.
    rise_m: f64,
}

impl Play<'_> {
    /// The motion over the next interval, time from 0 to 1, m.
    pub fn next_segment(&mut self) -> BaseSegment<f64> {
        let samples = &self.record.samples;
        let n = self.next;
        self.next += 1;
        match self.record.quantity {
            RecordQuantity::Displacement => {
                let last = samples.len() - 1;
                let at = |n: usize| samples[n.min(last)];
                let (before, start, end, after) = (at(n.saturating_sub(1)), at(n), at(n + 1), at(n + 2));
                BaseSegment::hermite(start, end, 0.5 * (end - before), 0.5 * (after - start))
            }
            RecordQuantity::Acceleration => {
                // Zero after the last sample.
                let (a, b) = if n + 1 < samples.len() { (samples[n], samples[n + 1]) } else { (0.0, 0.0) };
                let square = self.record.step_s * self.record.step_s;
                let segment = BaseSegment([self.z_m, self.rise_m, 0.5 * square * a, square / 6.0 * (b - a)]);
                self.z_m += segment.0[1] + (segment.0[2] + segment.0[3]);
                self.rise_m += 0.5 * square * (a + b);
                segment
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(quantity: RecordQuantity, samples: &[f64]) -> Record {
        Record { origin: RecordOrigin::Noise, quantity, step_s: 0.1, samples: samples.to_vec(), resampling: None }
    }

    #[test]
    fn a_constant_acceleration_is_integrated_to_its_parabola_and_then_coasts() {
        let ramp = record(RecordQuantity::Acceleration, &[2.0; 11]);
        let mut play = ramp.play();
        let ends: Vec<f64> = (0..12).map(|_| play.next_segment().0.iter().sum()).collect();
        assert!((ends[9] - 1.0).abs() < 1e-14, "z(1 s) = ½·2·1² = {}", ends[9]);
        assert!((ends[11] - (1.0 + 2.0 * 0.2)).abs() < 1e-14, "then 2 m/s: {}", ends[11]);
        assert!((ramp.drift_m() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_linear_acceleration_is_integrated_to_its_cubic() {
        let samples: Vec<f64> = (0..=10).map(|n| 6.0 * 0.1 * f64::from(n)).collect();
        assert!((record(RecordQuantity::Acceleration, &samples).drift_m() - 1.0).abs() < 1e-14, "z = t³");
    }

    #[test]
    fn a_displacement_passes_through_its_samples_and_stays_at_its_last() {
        let samples = [0.0, 0.3, -0.2, 0.9];
        let record = record(RecordQuantity::Displacement, &samples);
        let mut play = record.play();
        for n in 0..5_usize {
            let segment = play.next_segment();
            assert_eq!(segment.0[0], samples[n.min(3)]);
            assert!((segment.0.iter().sum::<f64>() - samples[(n + 1).min(3)]).abs() < 1e-15);
        }
    }
}
