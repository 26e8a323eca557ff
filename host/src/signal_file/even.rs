//! Signals at an even time step: as they are, or resampled where their times jitter.

use super::{Signal, SignalAxis};

/// How uneven times are: the longest gap, or the jitter.
pub(super) fn uneven(times_s: &[f64]) -> String {
    let steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(usual) = sorted.get(sorted.len() / 2) else { return "too few values for a time step".into() };
    let gaps: Vec<usize> = (0..steps.len()).filter(|n| steps[*n] > 1.5 * usual).collect();
    match gaps.first() {
        Some(first) => format!(
            "{} gaps, the first of {:.6} s at {:.6} s, where samples are {usual:.6} s apart",
            gaps.len(),
            steps[*first],
            times_s[*first]
        ),
        None => format!("the steps jitter from {:.6} to {:.6} s", sorted[0], sorted[sorted.len() - 1]),
    }
}

/// A signal at an even time step.
#[derive(Clone, Debug, PartialEq)]
pub struct EvenSignal {
    /// First time, s.
    pub start_s: f64,
    /// Time step, s.
    pub step_s: f64,
    /// In the unit of the file.
    pub values: Vec<f64>,
    /// Estimated RMS error of the resampling, in the unit of the file; 0 where nothing was resampled.
    pub rms_error: f64,
}

impl Signal {
    /// The signal at an even time step: itself, or resampled by cubics where its times jitter. The estimate of the error compares each
    /// second sample with the cubic through its neighbours, whose error is 16 times as large (fourth order in the step).
    ///
    /// # Errors
    /// It is not over time; a missing value or a gap, with its place; fewer than 5 samples.
    pub fn evenly(&self) -> Result<EvenSignal, String> {
        if let Some(n) = self.values.iter().position(|value| !value.is_finite()) {
            return Err(format!("{}: value {} is {}, no number", self.name, n + 1, self.values[n]));
        }
        let times_s = match &self.axis {
            SignalAxis::Time { start_s, step_s } => {
                let (start_s, step_s) = (*start_s, *step_s);
                return Ok(EvenSignal { start_s, step_s, values: self.values.clone(), rms_error: 0.0 });
            }
            SignalAxis::Times(times_s) => times_s,
            SignalAxis::Unknown(why) => return Err(format!("{}: {why}", self.name)),
            _ => return Err(format!("{}: its values are over frequency, not over time", self.name)),
        };
        if times_s.len() < 5 {
            return Err(format!("{}: {} samples are too few", self.name, times_s.len()));
        }
        let (first, last) = (times_s[0], times_s[times_s.len() - 1]);
        let step_s = (last - first) / (times_s.len() - 1) as f64;
        let longest = times_s.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        if longest > 1.5 * steps[steps.len() / 2] {
            return Err(format!(
                "{}: {}\n  give the part before or after the gap as a file of its own",
                self.name,
                uneven(times_s)
            ));
        }
        let mut out = Vec::with_capacity(times_s.len());
        let mut at = 1;
        for n in 0..times_s.len() {
            let t = first + n as f64 * step_s;
            while at + 2 < times_s.len() - 1 && times_s[at + 1] < t {
                at += 1;
            }
            out.push(cubic(&times_s[at - 1..at + 3], &self.values[at - 1..at + 3], t));
        }
        if out.iter().any(|value| !value.is_finite()) {
            return Err(format!("{}: its values are too large to be resampled", self.name));
        }
        let mut sum = 0.0;
        let inner = 3..times_s.len() - 3;
        let count = inner.len().max(1);
        for n in inner {
            let near = [n - 3, n - 1, n + 1, n + 3];
            let (t, v) = (near.map(|k| times_s[k]), near.map(|k| self.values[k]));
            sum += (cubic(&t, &v, times_s[n]) - self.values[n]).powi(2);
        }
        let rms_error = (sum / count as f64).sqrt() / 16.0;
        Ok(EvenSignal { start_s: first, step_s, values: out, rms_error })
    }
}

/// The cubic through four points (Lagrange).
fn cubic(t: &[f64], v: &[f64], at: f64) -> f64 {
    let weight = |n: usize| (0..4).filter(|k| *k != n).map(|k| (at - t[k]) / (t[n] - t[k])).product::<f64>();
    (0..4).map(|n| weight(n) * v[n]).sum()
}
