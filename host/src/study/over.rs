//! The value that counts of everything that is not certain.

use serde::Serialize;

/// Words of files, in the order of [`Over::ALL`].
pub const OVER_WORDS: &[&str] = &["worst", "q95", "median", "mean"];

/// Which value counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// The worst: the largest where the smallest is wanted.
    Worst,
    /// The value that 95 % are as good as.
    #[serde(rename = "q95")]
    Quantile95,
    /// The middle one.
    Median,
    /// The mean.
    Mean,
}

impl Over {
    /// All, in the order of the words of files.
    pub const ALL: [Self; 4] = [Self::Worst, Self::Quantile95, Self::Median, Self::Mean];

    /// Before the name of a metric: `worst`, `95 % value of`.
    #[must_use]
    pub const fn before_metric(self) -> &'static str {
        match self {
            Self::Quantile95 => "95 % value of",
            _ => self.name(),
        }
    }

    /// As files and answers name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Worst => "worst",
            Self::Quantile95 => "q95",
            Self::Median => "median",
            Self::Mean => "mean",
        }
    }

    /// Of sorted values, of which the largest or the smallest is wanted; not a number if one of them is not.
    #[must_use]
    pub fn of(self, sorted: &[f64], is_maximum: bool) -> f64 {
        match self.quantile(is_maximum) {
            Some(share) => quantile(sorted, share),
            None => sorted.iter().sum::<f64>() / sorted.len() as f64,
        }
    }

    /// The quantile that it is; none for the mean.
    #[must_use]
    pub const fn quantile(self, is_maximum: bool) -> Option<f64> {
        match (self, is_maximum) {
            (Self::Worst, false) => Some(1.0),
            (Self::Worst, true) => Some(0.0),
            (Self::Quantile95, false) => Some(0.95),
            (Self::Quantile95, true) => Some(0.05),
            (Self::Median, _) => Some(0.5),
            (Self::Mean, _) => None,
        }
    }
}

/// A quantile of sorted values, linear between them (type 7 of Hyndman and Fan); not a number if one of them is not.
#[must_use]
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    // `total_cmp` sorts them to the ends.
    if sorted.first().is_none_or(|first| first.is_nan()) || sorted.last().is_some_and(|last| last.is_nan()) {
        return f64::NAN;
    }
    let at = share * (sorted.len() - 1) as f64;
    let (low, high) = (at.floor() as usize, at.ceil() as usize);
    sorted[low] + (at - low as f64) * (sorted[high] - sorted[low])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_files_are_in_order_and_the_worst_depends_on_what_is_wanted() {
        assert_eq!(Over::ALL.map(Over::name), OVER_WORDS);
        let sorted = [1.0, 2.0, 3.0, 10.0];
        for (is_maximum, expected) in [(false, [10.0, 8.95, 2.5, 4.0]), (true, [1.0, 1.15, 2.5, 4.0])] {
            for (over, expected) in Over::ALL.into_iter().zip(expected) {
                let found = over.of(&sorted, is_maximum);
                assert!((found / expected - 1.0).abs() < 1e-14, "{over:?}: {found}, not {expected}");
            }
        }
        assert!(Over::ALL.iter().all(|over| over.of(&[1.0, f64::NAN], false).is_nan()));
    }
}
