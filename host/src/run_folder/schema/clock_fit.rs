//! Fits a straight line of host time over device time, for a board with its own clock: offset and drift in a segment.
//!
//! Messages arrive with a delay of zero or more. So of each second only the arrival with the least delay is kept, and the
//! line is fitted to those.

use serde::{Deserialize, Serialize};

use super::json_float;

/// Host time over which the arrival with the least delay is kept, s.
const BIN_S: f64 = 1.0;

/// A straight line from device time to host time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClockFit {
    /// Host time of tick 0, s since the program began.
    #[serde(with = "json_float")]
    pub tick_zero_host_s: f64,
    /// Rate of the device's clock over the host's, less one, in parts per million. 0 with fewer than three pairs.
    #[serde(with = "json_float")]
    pub drift_ppm: f64,
    /// RMS of the pairs about the line, s.
    #[serde(with = "json_float")]
    pub scatter_s: f64,
    /// Pairs that the line is fitted to.
    pub pairs: usize,
}

/// A tick and its arrival.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClockPair {
    /// The device's time, s since its start.
    #[serde(with = "json_float")]
    pub device_s: f64,
    /// The host's, s since the program began; rig seconds of a real-time virtual rig with another speed than 1.
    #[serde(with = "json_float")]
    pub host_s: f64,
}

/// Gathers the pairs of one experiment.
#[derive(Clone, Debug, Default)]
pub struct ClockPairs {
    pairs: Vec<ClockPair>,
    open: Option<ClockPair>,
    bin_end_s: f64,
}

impl ClockPairs {
    /// Adds an arrival. Gives the kept pair of a second that is over.
    pub fn add(&mut self, pair: ClockPair) -> Option<ClockPair> {
        let delay = |p: ClockPair| p.host_s - p.device_s;
        let closed = if pair.host_s >= self.bin_end_s { self.open.take() } else { None };
        self.pairs.extend(closed);
        match self.open {
            None => {
                self.open = Some(pair);
                self.bin_end_s = pair.host_s + BIN_S;
            }
            Some(best) if delay(pair) < delay(best) => self.open = Some(pair),
            Some(_) => {}
        }
        closed
    }

    /// The line through the pairs; none without any.
    #[must_use]
    pub fn fit(&self) -> Option<ClockFit> {
        let pairs: Vec<ClockPair> = self.pairs.iter().copied().chain(self.open).collect();
        let count = pairs.len() as f64;
        if pairs.is_empty() {
            return None;
        }
        let mean = |of: fn(&ClockPair) -> f64| pairs.iter().map(of).sum::<f64>() / count;
        let (device, host) = (mean(|p| p.device_s), mean(|p| p.host_s));
        let product = |a: &ClockPair| (a.device_s - device) * (a.host_s - host);
        let square = |a: &ClockPair| (a.device_s - device) * (a.device_s - device);
        let (covariance, variance) = (pairs.iter().map(product).sum::<f64>(), pairs.iter().map(square).sum::<f64>());
        // Two pairs always lie on a line, whatever their delays.
        let slope = if pairs.len() > 2 && variance > 0.0 { covariance / variance } else { 1.0 };
        let zero = host - slope * device;
        let residual = |p: &ClockPair| (p.host_s - zero - slope * p.device_s).powi(2);
        Some(ClockFit {
            tick_zero_host_s: zero,
            drift_ppm: (1.0 / slope - 1.0) * 1e6,
            scatter_s: (pairs.iter().map(residual).sum::<f64>() / count).sqrt(),
            pairs: pairs.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_and_offset_are_found_in_spite_of_a_busy_hosts_delays() {
        let mut pairs = ClockPairs::default();
        let mut random = fastrand::Rng::with_seed(5);
        for n in 0..60_000 {
            let device_s = f64::from(n) * 0.01;
            // 40 ppm fast, started 3 s after the program; a delay of up to 50 ms, seldom less than 1 ms.
            let host_s = 3.0 + device_s / (1.0 + 40e-6) + 0.05 * random.f64();
            pairs.add(ClockPair { device_s, host_s });
        }
        let fit = pairs.fit().unwrap();
        assert!((fit.drift_ppm - 40.0).abs() < 2.0, "{fit:?}");
        assert!((fit.tick_zero_host_s - 3.0).abs() < 2e-3, "{fit:?}");
        assert!((590..=610).contains(&fit.pairs), "{fit:?}");
    }

    #[test]
    fn two_pairs_give_no_drift() {
        let mut pairs = ClockPairs::default();
        assert_eq!(pairs.fit(), None);
        pairs.add(ClockPair { device_s: 0.0, host_s: 1.0 });
        pairs.add(ClockPair { device_s: 2.0, host_s: 3.5 });
        assert_eq!(pairs.fit().unwrap().drift_ppm, 0.0);
    }
}
