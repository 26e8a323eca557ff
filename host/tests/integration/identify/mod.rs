//! `damprig identify` against the truth of the virtual rig: errors over many seeds, and refusals of bad records.
//!
//! The default run uses few seeds. With DAMPRIG_FULL each claim holds over at least 100 seeds; docs/IDENTIFY.md states the
//! figures that these tests print.

mod decay;
mod flights;
mod refusals;
mod response;
mod set_up_file;
mod sound;
mod tables;
mod time_response;

/// Seeds of a claim.
fn seeds() -> u64 {
    if is_full() { 200 } else { 6 }
}

/// Seeds of a claim whose records take a second each.
fn few_seeds() -> u64 {
    if is_full() { 200 } else { 3 }
}

fn is_full() -> bool {
    std::env::var_os("DAMPRIG_FULL").is_some()
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

    /// Checks that the intervals cover the truth in 90 % to 99 % of 200 seeds. With 6 or 3 seeds at least half must cover it:
    /// fewer have a probability of 1e-4 or 1e-3 at a true coverage of 95 %.
    fn assert_covers(&self, what: &str) {
        let share = self.coverage();
        if self.errors.len() >= 100 {
            assert!((0.90..=0.99).contains(&share), "{what}: the intervals cover {:.1} %", 100.0 * share);
        } else {
            assert!(2 * self.covered >= self.errors.len(), "{what}: {} of {}", self.covered, self.errors.len());
        }
    }
}
