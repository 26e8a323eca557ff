//! What a value is drawn from: a range that is even in the value or its logarithm, or a normal or lognormal distribution between two ends.

use std::f64::consts::SQRT_2;

use crate::input::key::KeyedQuantity;
use crate::input::section::Number;
use crate::input::{Section, Span};

/// Standard deviations from the mean at which a normal distribution ends unless the file states its ends: less than 1e-4 of it is
/// beyond them.
const FARTHEST: f64 = 4.0;

/// Least share of a distribution between its ends.
const MIN_KEPT: f64 = 0.01;

/// Halvings of an interval of standard normal quantiles: beyond the digits of a number.
const HALVINGS: usize = 60;

/// Words of files, in the order in which they are read.
pub const DISTRIBUTION_WORDS: &[&str] = &["uniform", "normal", "lognormal"];

/// A distribution between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distribution {
    /// Lower end, in the key's unit.
    pub from: f64,
    /// Upper end.
    pub to: f64,
    family: Family,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Family {
    /// The value is as likely everywhere.
    Even,
    /// Its logarithm is.
    EvenLog,
    /// Normal before its ends are cut off.
    Normal { mean: f64, standard_deviation: f64 },
    /// The same of the logarithm.
    LogNormal { mean: f64, standard_deviation: f64 },
}

impl Distribution {
    /// As likely everywhere between two ends: the value, or its logarithm, for which both are greater than 0.
    #[must_use]
    pub fn uniform(from: f64, to: f64, is_log: bool) -> Self {
        Self { from, to, family: if is_log { Family::EvenLog } else { Family::Even } }
    }

    /// A normal distribution, cut off at `ends` if they are given.
    fn normal(mean: f64, standard_deviation: f64, ends: [Option<f64>; 2]) -> Self {
        let end = |side: f64| mean + side * FARTHEST * standard_deviation;
        let [from, to] = ends;
        let family = Family::Normal { mean, standard_deviation };
        Self { from: from.unwrap_or_else(|| end(-1.0)), to: to.unwrap_or_else(|| end(1.0)), family }
    }

    /// A lognormal distribution with the mean and the standard deviation of the value itself, cut off at `ends` if they are given.
    fn lognormal(mean: f64, standard_deviation: f64, ends: [Option<f64>; 2]) -> Self {
        let variance = libm::log1p((standard_deviation / mean) * (standard_deviation / mean));
        let (mean, standard_deviation) = (libm::log(mean) - 0.5 * variance, variance.sqrt());
        let end = |side: f64| libm::exp(mean + side * FARTHEST * standard_deviation);
        let [from, to] = ends;
        let family = Family::LogNormal { mean, standard_deviation };
        Self { from: from.unwrap_or_else(|| end(-1.0)), to: to.unwrap_or_else(|| end(1.0)), family }
    }

    /// Whether it is one of the logarithm.
    #[must_use]
    pub const fn is_log(&self) -> bool {
        matches!(self.family, Family::EvenLog | Family::LogNormal { .. })
    }

    /// The value below which a share of it lies, 0 to 1: exactly the ends at 0 and 1.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        let of_normal = |mean: f64, standard_deviation: f64, [from, to]: [f64; 2]| {
            let ends = [from, to].map(|end| (end - mean) / standard_deviation);
            mean + standard_deviation * cut_normal_quantile(ends, share)
        };
        match self.family {
            _ if share <= 0.0 => self.from,
            _ if share >= 1.0 => self.to,
            Family::Even | Family::EvenLog => self.between(share),
            Family::Normal { mean, standard_deviation } => of_normal(mean, standard_deviation, [self.from, self.to]),
            Family::LogNormal { mean, standard_deviation } => {
                libm::exp(of_normal(mean, standard_deviation, [self.from, self.to].map(libm::log)))
            }
        }
    }

    /// The value at a share of the way from end to end, 0 to 1, of the logarithm where it is one of it; however likely it is.
    #[must_use]
    pub fn between(&self, share: f64) -> f64 {
        between(self.from, self.to, self.is_log(), share)
    }

    /// Share of a normal distribution between the ends, before what is beyond them is cut off.
    fn kept(&self) -> f64 {
        let of_normal = |mean: f64, standard_deviation: f64, ends: [f64; 2]| {
            let [low, high] = ends.map(|end| (end - mean) / standard_deviation);
            if low > 0.0 { below(-low) - below(-high) } else { below(high) - below(low) }
        };
        match self.family {
            Family::Even | Family::EvenLog => 1.0,
            Family::Normal { mean, standard_deviation } => of_normal(mean, standard_deviation, [self.from, self.to]),
            Family::LogNormal { mean, standard_deviation } => {
                of_normal(mean, standard_deviation, [self.from, self.to].map(libm::log))
            }
        }
    }
}

/// Share of a standard normal distribution below a value.
fn below(z: f64) -> f64 {
    0.5 * libm::erfc(-z / SQRT_2)
}

/// The value below which a share of a standard normal distribution lies that is cut off at two ends.
fn cut_normal_quantile([low, high]: [f64; 2], share: f64) -> f64 {
    // In the lower tail, where shares keep their digits.
    if low + high > 0.0 {
        return -cut_normal_quantile([-high, -low], 1.0 - share);
    }
    let wanted = below(low) + share * (below(high) - below(low));
    let (mut least, mut most) = (low, high);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (least + most);
        if below(middle) < wanted { least = middle } else { most = middle }
    }
    0.5 * (least + most)
}

/// A value between two ends: exactly the ends at 0 and 1, and a whole number where only rounding keeps it from being one.
pub(super) fn between(from: f64, to: f64, is_log: bool, share: f64) -> f64 {
    let value = match share {
        0.0 => return from,
        1.0 => return to,
        _ if is_log => from * libm::exp(share * libm::log(to / from)),
        _ => from + share * (to - from),
    };
    let whole = value.round();
    if (value - whole).abs() <= 4.0 * f64::EPSILON * value.abs().max(from.abs()).max(to.abs()) { whole } else { value }
}

/// The keys of a distribution that is no range.
#[derive(Clone, Copy, Debug)]
pub struct DistributionKeys {
    /// Its word.
    pub distribution: &'static KeyedQuantity,
    /// Its mean.
    pub mean: &'static KeyedQuantity,
    /// Its standard deviation.
    pub standard_deviation: &'static KeyedQuantity,
    /// Its ends.
    pub ends: [&'static KeyedQuantity; 2],
    /// Spacing of a range.
    pub scale: &'static KeyedQuantity,
}

/// Reads a normal or lognormal distribution between `ends` as read, with their places if both are given. `Some(None)` for a uniform one,
/// which is a range; `None` after a problem has been reported.
pub(crate) fn read(
    s: &Section,
    keys: &DistributionKeys,
    ends: &[Option<Number>; 2],
) -> Option<Option<(Distribution, Vec<Span>)>> {
    let (word, mean) = (s.word(keys.distribution), s.placed(keys.mean));
    let standard_deviation = s.scalar(keys.standard_deviation);
    let is_lognormal = match word? {
        0 => return Some(None),
        place => place == 2,
    };
    if s.is_given(keys.scale) {
        let help = "leave it out; of a value whose logarithm is normal the distribution is \"lognormal\"";
        s.reject(keys.scale.name(), "goes only with distribution = \"uniform\"", Some(help.into()));
        return None;
    }
    let (mean, standard_deviation) = (mean?, standard_deviation?);
    if keys.ends.iter().zip(ends).any(|(key, end)| s.is_given(key) && end.is_none()) {
        return None;
    }
    for (key, number) in [(keys.mean, Some(&mean)), (keys.ends[0], ends[0].as_ref()), (keys.ends[1], ends[1].as_ref())]
    {
        if let Some(number) = number.filter(|number| is_lognormal && number.value <= 0.0) {
            let allowed = "must be greater than 0 with distribution = \"lognormal\"";
            s.refuse(key.name(), &number.span, allowed, None);
            return None;
        }
    }
    let of = if is_lognormal { Distribution::lognormal } else { Distribution::normal };
    let distribution = of(mean.value, standard_deviation, ends.each_ref().map(|end| end.as_ref().map(|end| end.value)));
    let Distribution { from, to, .. } = distribution;
    if !(from < to && from.is_finite() && to.is_finite() && distribution.kept() >= MIN_KEPT) {
        let percent = 100.0 * MIN_KEPT;
        let allowed = format!("leaves less than {percent} % of the distribution between its ends, {from} and {to}");
        let help = "choose `from` and `to` around the mean, or leave them out: the ends are then 4 standard deviations from it";
        s.refuse(keys.mean.name(), &mean.span, allowed, Some(help.into()));
        return None;
    }
    let spans: Vec<Span> = ends.iter().flatten().map(|end| end.span.clone()).collect();
    Some(Some((distribution, if spans.len() == 2 { spans } else { Vec::new() })))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_both_its_ends_exactly_and_a_log_range_even_ratios() {
        assert_eq!([between(0.1, 0.7, false, 0.0), between(0.1, 0.7, false, 1.0)], [0.1, 0.7]);
        assert_eq!([between(0.1, 0.7, true, 0.0), between(0.1, 0.7, true, 1.0)], [0.1, 0.7]);
        let whole: Vec<f64> = (0..100).map(|n| between(1.0, 100.0, false, f64::from(n) / 99.0)).collect();
        assert!(whole.iter().all(|value| value.fract() == 0.0), "seeds are whole numbers: {whole:?}");
        let middle = between(1.0, 100.0, true, 0.5);
        assert!((middle - 10.0).abs() < 1e-14, "{middle}");
    }

    /// Published quantiles of the standard normal distribution.
    const QUANTILES: [(f64, f64); 3] = [(0.5, 0.0), (0.975, 1.959_963_984_540_054), (1e-6, -4.753_424_308_822_899)];

    #[test]
    fn quantiles_of_a_normal_distribution_are_the_published_ones() {
        let wide = Distribution::normal(10.0, 2.0, [Some(10.0 - 60.0), Some(10.0 + 60.0)]);
        for (share, z) in QUANTILES {
            let found = (wide.quantile(share) - 10.0) / 2.0;
            // Rounding of the value, 16 digits of 10, is divided by the standard deviation; that of the share by the density.
            assert!((found - z).abs() < 1e-14, "{share}: {found}, not {z}");
        }
    }

    #[test]
    fn a_distribution_that_is_cut_off_has_the_shares_that_are_left() {
        for (mean, low, high) in [(0.0, -1.0, 2.0), (-5.0, -1.0, 1.0), (5.0, -1.0, 1.0), (0.0, 3.0, 9.0)] {
            let cut = Distribution::normal(mean, 1.0, [Some(low), Some(high)]);
            assert_eq!([cut.quantile(0.0), cut.quantile(1.0)], [low, high]);
            for share in [1e-3, 0.2, 0.5, 0.9, 0.999] {
                let z = cut.quantile(share) - mean;
                let (from, to) = (low - mean, high - mean);
                let upper = |z: f64| below(-z);
                // By the tail in which no digit is lost.
                let found = if from > 0.0 {
                    (upper(from) - upper(z)) / (upper(from) - upper(to))
                } else {
                    (below(z) - below(from)) / (below(to) - below(from))
                };
                assert!((found - share).abs() < 1e-12, "mean {mean}, {low} to {high}: {found}, not {share}");
            }
        }
    }

    #[test]
    fn a_lognormal_distribution_has_the_mean_and_the_standard_deviation_of_the_value() {
        let lognormal = Distribution::lognormal(3.0, 0.6, [Some(1e-3), Some(1e3)]);
        // Midpoint rule over the shares. What it misses is at the ends of the quantile function: about 1/n of the tails' values.
        let count = 100_000;
        let values: Vec<f64> =
            (0..count).map(|n| lognormal.quantile((f64::from(n) + 0.5) / f64::from(count))).collect();
        let mean = values.iter().sum::<f64>() / f64::from(count);
        let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / f64::from(count);
        assert!((mean - 3.0).abs() < 1e-4 && (variance.sqrt() - 0.6).abs() < 1e-3, "{mean} ± {}", variance.sqrt());
        let usual = Distribution::lognormal(3.0, 0.6, [None, None]);
        assert!(usual.kept() > 0.9999 && usual.from > 0.0);
        assert!((usual.between(0.5) - usual.quantile(0.5)).abs() < 1e-12, "the middle is the median");
    }
}
