//! Finds the largest or smallest value over a band of frequencies, between the values of its grid too.

use super::axis::{AxisValue, Reduction, StudyAxis};
use super::evaluate::reduce_over;
pub use super::peaks::Smoothness;
use super::peaks::{EACH_SIDE, LinePoint, ROUNDS, SCAN, add_between, halve, highest, highest_of, sort};
use crate::failure::Failure;

/// How a band is searched between the values of its grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Not at all.
    Grid,
    /// Around the grid's three highest local maxima (lowest minima), up to their neighbours.
    Peaks,
    /// On a grid of 1600 intervals, then around its five highest local maxima.
    Scan,
}

impl Effort {
    const fn peaks(self) -> usize {
        match self {
            Self::Grid => 0,
            Self::Peaks => 3,
            Self::Scan => 5,
        }
    }

    /// Most simulations between the values of a grid for one start and one metric.
    #[must_use]
    pub const fn most_simulations(self) -> usize {
        let scan = if matches!(self, Self::Scan) { SCAN } else { 0 };
        scan + self.peaks() * ROUNDS * 2 * EACH_SIDE
    }
}

/// The reduced axes of a study or an optimisation.
#[derive(Clone, Debug)]
pub struct Band {
    axes: Vec<StudyAxis>,
    /// Place of the axis that is searched between its values.
    refined: Option<usize>,
    /// How what is reduced follows that axis.
    pub smoothness: Smoothness,
}

/// A band's value and the values of its axes there.
#[derive(Clone, Debug, PartialEq)]
pub struct Reduced {
    /// The value; not a number if one of them is not.
    pub value: f64,
    /// The values of the axes.
    pub at: Vec<AxisValue>,
    /// The places that may decide after a small change, best first, with their values: local extremes over a line of frequencies, or
    /// points of a grid.
    pub tops: Vec<(Vec<AxisValue>, f64)>,
}

/// Simulates points of the band, given by the values of its axes: a value for each.
pub type Simulate<'a> = &'a mut dyn FnMut(&[Vec<AxisValue>]) -> Result<Vec<f64>, Failure>;

impl Band {
    /// Of axes of which the last varies fastest, for a response that may jump.
    #[must_use]
    pub fn of(axes: Vec<StudyAxis>) -> Self {
        let refined = axes.iter().position(StudyAxis::is_refined);
        Self { axes, refined, smoothness: Smoothness::Jumps }
    }

    /// The same with a value more of the axis that is searched between its values.
    #[must_use]
    pub fn with_value(&self, value: f64) -> Self {
        let mut with = self.clone();
        if let Some(refined) = self.refined {
            with.axes[refined].insert(value);
        }
        with
    }

    /// The same axes with the largest or smallest value over each.
    #[must_use]
    pub fn of_extreme(axes: &[StudyAxis], reduction: Reduction) -> Self {
        Self::of(axes.iter().map(|axis| StudyAxis { reduce: Some(reduction), ..axis.clone() }).collect())
    }

    /// How the axis that is searched between its values is reduced; `None` without such an axis. With `Minimum` the search can only
    /// lower the band's value, otherwise only raise it.
    #[must_use]
    pub fn refined(&self) -> Option<Reduction> {
        self.axes[self.refined?].reduce
    }

    /// Most simulations between the values of the grid, from one start for one metric.
    #[must_use]
    pub fn most_between(&self, effort: Effort) -> u64 {
        let Some(refined) = self.refined else { return 0 };
        let others = self.axes.iter().enumerate().filter(|(place, _)| *place != refined);
        effort.most_simulations() as u64 * others.map(|(_, axis)| axis.count() as u64).product::<u64>()
    }

    /// How a study searches it.
    #[must_use]
    pub fn effort_of_study(&self) -> Effort {
        if self.refined() == Some(Reduction::ScanMaximum) { Effort::Scan } else { Effort::Peaks }
    }

    /// Reduces the values at the points of the grid to one.
    ///
    /// # Errors
    /// Those of `simulate`.
    pub fn reduce(&self, grid: &[f64], effort: Effort, simulate: Simulate) -> Result<Reduced, Failure> {
        let all: Vec<&StudyAxis> = self.axes.iter().collect();
        let Some(place) = self.refined.filter(|_| effort != Effort::Grid) else {
            let (value, point) = reduce_over(&all, grid);
            let is_minimum = all.first().is_some_and(|axis| axis.reduce == Some(Reduction::Minimum));
            let tops = grid.iter().enumerate().map(|(point, value)| (point, *value));
            let tops = highest_of(tops.collect(), is_minimum, |(_, value)| *value);
            let tops = tops.into_iter().map(|(point, value)| (values_at(&self.axes, point), value)).collect();
            return Ok(Reduced { value, at: values_at(&self.axes, point), tops });
        };
        let (outer, axis, inner) = (&all[..place], all[place], &all[place + 1..]);
        let (inner_axes, count) = (&self.axes[place + 1..], axis.count());
        let inner_points: usize = inner.iter().map(|axis| axis.count()).product();
        let is_minimum = axis.reduce == Some(Reduction::Minimum);
        let mut best: Vec<LinePoint> = Vec::new();
        let mut tops: Vec<(usize, LinePoint)> = Vec::new();
        for (number, of_line) in grid.chunks(count * inner_points).enumerate() {
            let first = values_at(&self.axes[..place], number);
            let sample = |(frequency, values): (f64, &[f64])| {
                let (value, inner) = reduce_over(inner, values);
                LinePoint { frequency, value, inner }
            };
            let mut line: Vec<LinePoint> =
                numbers(axis).into_iter().zip(of_line.chunks(inner_points)).map(sample).collect();
            let mut evaluate = |frequencies: &[f64]| -> Result<Vec<LinePoint>, Failure> {
                let at = |frequency: &f64, point: usize| {
                    let own = std::iter::once(AxisValue::Number(*frequency));
                    first.iter().cloned().chain(own).chain(values_at(inner_axes, point)).collect::<Vec<AxisValue>>()
                };
                let points: Vec<Vec<AxisValue>> =
                    frequencies.iter().flat_map(|f| (0..inner_points).map(move |point| at(f, point))).collect();
                let values = simulate(&points)?;
                Ok(frequencies.iter().copied().zip(values.chunks(inner_points)).map(sample).collect())
            };
            sort(&mut line);
            if effort == Effort::Scan {
                match self.smoothness {
                    Smoothness::Jumps => {
                        add_between(&mut line, SCAN.div_ceil(count - 1) - 1, &mut evaluate).map(drop)?
                    }
                    Smoothness::Kinks | Smoothness::Smooth => halve(&mut line, &mut evaluate)?,
                }
            }
            let found = highest(line, is_minimum, effort.peaks(), self.smoothness, &mut evaluate)?;
            best.push(found[0]);
            tops.extend(found.into_iter().map(|sample| (number, sample)));
        }
        let (value, number) = reduce_over(outer, &best.iter().map(|sample| sample.value).collect::<Vec<_>>());
        let at = |(number, sample): (usize, LinePoint)| {
            let mut at = values_at(&self.axes[..place], number);
            at.push(AxisValue::Number(sample.frequency));
            at.extend(values_at(inner_axes, sample.inner));
            at
        };
        let tops = highest_of(tops, is_minimum, |(_, sample)| sample.value);
        let tops = tops.into_iter().map(|(number, sample)| (at((number, sample)), sample.value)).collect();
        Ok(Reduced { value, at: at((number, best[number])), tops })
    }
}

fn numbers(axis: &StudyAxis) -> Vec<f64> {
    let number = |place| if let AxisValue::Number(number) = axis.value(place, 0.0) { number } else { f64::NAN };
    (0..axis.count()).map(number).collect()
}

/// The values of some axes at one of their points, of which the last axis varies fastest.
#[must_use]
pub fn values_at(axes: &[StudyAxis], point: usize) -> Vec<AxisValue> {
    let mut rest = point;
    let mut values: Vec<AxisValue> = Vec::new();
    for axis in axes.iter().rev() {
        values.push(axis.value(rest % axis.count(), 0.0));
        rest /= axis.count();
    }
    values.reverse();
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::axis::AxisValues;
    use crate::study::peaks::PREDICTED;

    fn axis(key: &str, numbers: Vec<f64>, reduce: Reduction) -> StudyAxis {
        let values = AxisValues::Numbers(numbers);
        StudyAxis { key: key.into(), values, is_log: false, reduce: Some(reduce), span: 0..0, value_spans: Vec::new() }
    }

    fn frequencies(reduce: Reduction) -> StudyAxis {
        axis("base.frequency_hz", (0..11).map(|n| 2.0 + 0.1 * f64::from(n)).collect(), reduce)
    }

    /// The band's value for a response over frequency and the other axis' value.
    fn reduced(axes: Vec<StudyAxis>, effort: Effort, response: impl Fn(f64, f64) -> f64) -> Reduced {
        let of = |at: &Vec<AxisValue>| {
            let number = |key: &str| {
                let place = axes.iter().position(|axis| axis.key == key);
                place.map_or(0.0, |place| if let AxisValue::Number(number) = at[place] { number } else { f64::NAN })
            };
            response(number("base.frequency_hz"), number("a"))
        };
        let points = axes.iter().map(StudyAxis::count).product();
        let grid: Vec<f64> = (0..points).map(|point| of(&values_at(&axes, point))).collect();
        Band::of(axes.clone()).reduce(&grid, effort, &mut |asked| Ok(asked.iter().map(of).collect())).unwrap()
    }

    fn resonance(frequency: f64, natural: f64) -> f64 {
        let (ratio, zeta) = (frequency / natural, 0.02);
        1.0 / ((1.0 - ratio * ratio).powi(2) + (2.0 * zeta * ratio).powi(2)).sqrt()
    }

    #[test]
    fn a_peak_between_the_frequencies_is_found_with_its_place() {
        for natural in [2.003, 2.044, 2.45, 2.71, 2.999] {
            let found = reduced(vec![frequencies(Reduction::Maximum)], Effort::Peaks, |f, _| resonance(f, natural));
            // The last values are a fiftieth of 0.1 Hz apart, a peak at most 0.002 Hz from one: (0.002/2.003/0.02)²/2 = 0.13 %.
            assert!((found.value * 0.04 - 1.0).abs() < 2.0e-3, "{found:?} for {natural}");
            let AxisValue::Number(at) = found.at[0] else { panic!("{found:?}") };
            assert!((at - natural).abs() < 0.0045, "{at} for {natural}");
            assert_eq!(resonance(at, natural), found.value);
            let least = reduced(vec![frequencies(Reduction::Minimum)], Effort::Peaks, |f, _| -resonance(f, natural));
            assert_eq!(least.value, -found.value);
        }
    }

    /// The band's value over a line of frequencies without jumps, and how many simulations it takes.
    fn asked(effort: Effort, response: impl Fn(f64) -> f64) -> (f64, usize) {
        let (axis, mut count) = (frequencies(Reduction::Maximum), 0);
        let grid: Vec<f64> = numbers(&axis).into_iter().map(&response).collect();
        let band = Band { smoothness: Smoothness::Smooth, ..Band::of(vec![axis]) };
        let mut simulate = |points: &[Vec<AxisValue>]| {
            count += points.len();
            Ok(points
                .iter()
                .map(|at| if let AxisValue::Number(at) = at[0] { response(at) } else { f64::NAN })
                .collect())
        };
        (band.reduce(&grid, effort, &mut simulate).unwrap().value, count)
    }

    #[test]
    fn a_smooth_peak_costs_three_simulations_and_an_irregular_one_no_more_than_sixteen() {
        for natural in [2.003, 2.044, 2.25, 2.45, 2.71, 2.999] {
            let (value, count) = asked(Effort::Peaks, |f| resonance(f, natural));
            // 1/(2ζ√(1 − ζ²)), and what is between 7 digits.
            assert!((value * 0.04 * (1.0_f64 - 4e-4).sqrt() - 1.0).abs() < 1e-9, "{value} for {natural}");
            assert!(count <= 3, "{count} for {natural}");
        }
        let irregular = |f: f64| resonance(f, 2.45) * (1.0 + 0.1 * f64::sin(1e4 * f));
        assert!((4..=Effort::Peaks.most_simulations()).contains(&asked(Effort::Peaks, irregular).1));
    }

    #[test]
    fn a_scan_without_jumps_ends_where_the_values_follow_and_goes_on_where_they_do_not() {
        let two = |f: f64| resonance(f, 2.2) + 0.8 * resonance(f, 2.71);
        let ((value, count), (scanned, most)) = (
            asked(Effort::Scan, two),
            (reduced(vec![frequencies(Reduction::Maximum)], Effort::Scan, |f, _| two(f)).value, SCAN),
        );
        assert!((value / scanned - 1.0).abs() < PREDICTED && 4 * count < most, "{value}, {scanned}, {count} of {most}");
        // A phase over f² has no step of the grid after which it repeats.
        let irregular = |f: f64| two(f) * (1.0 + 0.1 * f64::sin(1e4 * f * f));
        assert!(asked(Effort::Scan, irregular).1 > SCAN / 2);
    }

    #[test]
    fn the_grid_alone_counts_where_it_is_asked_for() {
        for reduce in [Reduction::GridMaximum, Reduction::Mean] {
            let grid = reduced(vec![frequencies(reduce)], Effort::Grid, |f, _| resonance(f, 2.45));
            assert_eq!(reduced(vec![frequencies(reduce)], Effort::Scan, |f, _| resonance(f, 2.45)), grid);
        }
    }

    #[test]
    fn other_axes_are_reduced_before_and_after_the_frequency() {
        let other = |reduce| axis("a", vec![2.25, 2.45, 2.65], reduce);
        let response = |f: f64, a: f64| a * resonance(f, a);
        for (reduce, natural) in [(Reduction::Maximum, 2.65), (Reduction::Minimum, 2.25)] {
            let found = reduced(vec![other(reduce), frequencies(Reduction::Maximum)], Effort::Scan, response);
            assert!((found.value / (natural * 25.0) - 1.0).abs() < 1e-3, "{found:?}");
            assert_eq!(found.at[0], AxisValue::Number(natural));
        }
        let found = reduced(vec![frequencies(Reduction::Maximum), other(Reduction::Maximum)], Effort::Scan, response);
        assert!((found.value / (2.65 * 25.0) - 1.0).abs() < 1e-3, "{found:?}");
        assert_eq!(found.at[1], AxisValue::Number(2.65));
    }

    #[test]
    fn a_value_that_is_missing_between_the_frequencies_is_missing() {
        let gap = |f: f64, _| if (2.41..2.48).contains(&f) { f64::NAN } else { resonance(f, 2.45) };
        assert!(reduced(vec![frequencies(Reduction::Maximum)], Effort::Grid, gap).value > 0.0);
        assert!(reduced(vec![frequencies(Reduction::Maximum)], Effort::Peaks, gap).value.is_nan());
    }

    #[test]
    fn a_narrow_peak_away_from_the_others_is_found_by_the_scan_alone() {
        let spike = |f: f64, _| resonance(f, 2.45) + 100.0 * f64::exp(-((f - 2.8531) / 0.002).powi(2));
        assert!(reduced(vec![frequencies(Reduction::Maximum)], Effort::Peaks, spike).value < 30.0);
        assert!(reduced(vec![frequencies(Reduction::Maximum)], Effort::Scan, spike).value > 101.0);
    }
}
