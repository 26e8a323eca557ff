//! `damprig identify` against the truth of the virtual rig: errors over many seeds, and refusals of bad records.
//!
//! The default run uses few seeds. With DAMPRIG_FULL each claim holds over at least 100 seeds; docs/IDENTIFY.md states the
//! figures that these tests print.

mod backbone;
mod bounce;
mod contact;
mod decay;
mod decay_files;
mod flights;
mod misfit;
mod modal;
mod modal_files;
mod modes;
mod next;
mod nonlinear;
mod refusals;
mod response;
mod set_up_file;
mod sound;
mod tables;
mod time_response;

use damprig::identify::Sensors;
use damprig_simulator::plant::DataSheet;

use crate::common::is_full;

/// Seeds of a claim.
fn seeds() -> u64 {
    if is_full() { 200 } else { 6 }
}

/// Seeds of a claim about intervals.
fn many_seeds() -> u64 {
    if is_full() { 2000 } else { 200 }
}

/// The data sheet of a sensor whose scale has a normal error of this standard uncertainty.
fn drawn_sheet(seed: u64) -> DataSheet {
    let mut random = fastrand::Rng::with_seed(seed);
    let normal = (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
    // The scale of a sensor of linearity L is off by 2.6 L.
    let linearity = normal.abs() * Sensors::ASSUMED.scale / (1.5 * 3f64.sqrt());
    DataSheet { linearity: linearity as f32, ..DataSheet::default() }
}

/// Seeds of a claim whose records take a second each.
fn few_seeds() -> u64 {
    if is_full() { 200 } else { 3 }
}

/// Seeds of a claim about intervals whose records take a second each.
fn some_seeds() -> u64 {
    if is_full() { 2000 } else { 40 }
}

/// Estimates of one quantity over the seeds.
#[derive(Default)]
struct Claim {
    errors: Vec<f64>,
    covered: usize,
}

impl Claim {
    fn note(&mut self, value: &damprig::identify::Value, truth: f64) {
        let [low, high] = value.interval_95();
        self.covered += usize::from((low..=high).contains(&truth));
        self.errors.push(value.value - truth);
    }

    fn rms(&self) -> f64 {
        (self.errors.iter().map(|error| error * error).sum::<f64>() / self.errors.len() as f64).sqrt()
    }

    fn coverage(&self) -> f64 {
        self.covered as f64 / self.errors.len() as f64
    }

    /// Checks that the intervals cover the truth in 93 % to 97 % of 2000 seeds, in 90 % to 99.5 % of 200, and in 33 or more of 40: at a
    /// true coverage of 95 % other shares have a probability below 1e-3. With 6 or 3 seeds at least half must cover it: fewer have a probability of
    /// 1e-4 or 1e-3.
    fn assert_covers(&self, what: &str) {
        let share = self.coverage();
        if self.errors.len() >= 40 {
            let allowed = match self.errors.len() {
                2000.. => 0.93..=0.97,
                100.. => 0.90..=0.995,
                _ => 33.0 / 40.0..=1.0,
            };
            assert!(allowed.contains(&share), "{what}: the intervals cover {:.1} %", 100.0 * share);
        } else {
            assert!(2 * self.covered >= self.errors.len(), "{what}: {} of {}", self.covered, self.errors.len());
        }
    }
}
