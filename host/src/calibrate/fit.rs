//! Fits of a calibration: reading against reference by a straight line, or one ratio of both; outliers, linearity, hysteresis.
//!
//! The line is fitted to the readings over the references. The operator aims at a reference, and what is missed shows in the
//! reading: so the reference is the exact abscissa, and the slope is not biased by the error of placing the target. Standard
//! uncertainties come from the scatter about the line, with n − 2 degrees of freedom.

use serde::Serialize;

use super::readings::CalibrationPoint;
use crate::identify::statistics::{Value, line, student_tail};

/// Probability of a false alarm of the test for outliers, over all points.
const FALSE_ALARM: f64 = 0.01;

/// Fewest points of a line with an uncertainty worth its name: two degrees of freedom.
pub const MIN_POINTS: usize = 4;

/// A straight line through the readings, over the references.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationLine {
    /// Reading per reference.
    pub slope: Value,
    /// Reading at reference 0.
    pub intercept: Value,
    /// Reading less line, in the order of the points.
    pub residuals: Vec<f64>,
    /// The outliers, the worst first.
    pub outliers: Vec<Outlier>,
}

/// A point that does not belong to the others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outlier {
    /// Its place among the points, from 0.
    pub point: usize,
    /// By how much it misses what the other points give, in the unit of the reading.
    pub off: f64,
}

/// The line through points; `None` for fewer than [`MIN_POINTS`], or references that are all the same.
#[must_use]
pub fn straight(points: &[CalibrationPoint]) -> Option<CalibrationLine> {
    if points.len() < MIN_POINTS {
        return None;
    }
    let (x, y): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p.reference, p.reading)).unzip();
    let fitted = line(&x, &y, |_| 1.0)?;
    let residuals = residuals(&x, &y, fitted.intercept.value, fitted.slope.value);
    Some(CalibrationLine { slope: fitted.slope, intercept: fitted.intercept, outliers: outliers(&x, &y), residuals })
}

fn residuals(x: &[f64], y: &[f64], intercept: f64, slope: f64) -> Vec<f64> {
    x.iter().zip(y).map(|(x, y)| y - intercept - slope * x).collect()
}

/// Removes the worst point while it does not belong to the line of the others, by Student's test of the deleted residual with
/// Bonferroni's correction; at most a quarter of the points.
fn outliers(x: &[f64], y: &[f64]) -> Vec<Outlier> {
    let mut left: Vec<usize> = (0..x.len()).collect();
    let mut found = Vec::new();
    while left.len() > MIN_POINTS && found.len() < x.len() / 4 {
        let worst = left.iter().filter_map(|&out| deleted(x, y, &left, out).map(|(tail, off)| (tail, out, off)));
        let Some((tail, point, off)) = worst.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if tail * left.len() as f64 > FALSE_ALARM {
            break;
        }
        found.push(Outlier { point, off });
        left.retain(|index| *index != point);
    }
    found
}

/// The probability of a deviation like that of the point `out` from the line of the others, and the deviation.
fn deleted(x: &[f64], y: &[f64], among: &[usize], out: usize) -> Option<(f64, f64)> {
    let others: Vec<usize> = among.iter().copied().filter(|index| *index != out).collect();
    let (xs, ys): (Vec<f64>, Vec<f64>) = others.iter().map(|&i| (x[i], y[i])).unzip();
    let fitted = line(&xs, &ys, |_| 1.0)?;
    let n = xs.len() as f64;
    let mean = xs.iter().sum::<f64>() / n;
    let spread: f64 = xs.iter().map(|x| (x - mean).powi(2)).sum();
    let rest = residuals(&xs, &ys, fitted.intercept.value, fitted.slope.value);
    let variance = rest.iter().map(|r| r * r).sum::<f64>() / (n - 2.0);
    let off = y[out] - fitted.intercept.value - fitted.slope.value * x[out];
    let own = variance * (1.0 + 1.0 / n + (x[out] - mean).powi(2) / spread);
    // Values without any scatter round to a few units of the last place.
    let rounding = 1e-12 * ys.iter().fold(0.0f64, |most, y| most.max(y.abs()));
    if off.abs() <= rounding {
        return None;
    }
    Some((student_tail(off / own.sqrt().max(rounding), xs.len() as u32 - 2), off))
}

impl CalibrationLine {
    /// RMS of the residuals, per degree of freedom.
    #[must_use]
    pub fn residual_rms(&self) -> f64 {
        let squares: f64 = self.residuals.iter().map(|r| r * r).sum();
        (squares / self.slope.degrees_of_freedom).sqrt()
    }

    /// The largest deviation from the line, in the unit of the reading.
    #[must_use]
    pub fn linearity(&self) -> f64 {
        self.residuals.iter().fold(0.0, |most, r| most.max(r.abs()))
    }
}

/// Mean difference of the readings at the same reference on the way down and on the way up, with the scatter of the
/// differences; `None` unless two references were met both ways. The way turns at the reference of largest magnitude.
#[must_use]
pub fn hysteresis(points: &[CalibrationPoint]) -> Option<Value> {
    let top = (0..points.len()).max_by(|&a, &b| points[a].reference.abs().total_cmp(&points[b].reference.abs()))?;
    let span = points.iter().map(|p| p.reference.abs()).fold(0.0, f64::max);
    let (up, down) = (&points[..top], &points[top + 1..]);
    let pair = |low: &CalibrationPoint| {
        let near = |p: &&CalibrationPoint| (p.reference - low.reference).abs() <= 1e-6 * span;
        down.iter().find(near).map(|high| high.reading - low.reading)
    };
    Value::mean(&up.iter().filter_map(pair).collect::<Vec<f64>>())
}

/// The mean ratio of reference over reading: of points whose error is a share of their size, like the blows of a hammer.
#[must_use]
pub fn ratio(points: &[CalibrationPoint]) -> Option<Value> {
    Value::mean(&points.iter().map(|p| p.reference / p.reading).collect::<Vec<f64>>())
}

/// The points whose ratio of reference over reading does not belong to the others, the worst first; `off` is relative.
#[must_use]
pub fn outlying_ratios(points: &[CalibrationPoint]) -> Vec<Outlier> {
    let ratios: Vec<f64> = points.iter().map(|p| p.reference / p.reading).collect();
    let mut left: Vec<usize> = (0..ratios.len()).collect();
    let mut found = Vec::new();
    while left.len() > MIN_POINTS && found.len() < ratios.len() / 4 {
        let test = |&out: &usize| {
            let others: Vec<f64> = left.iter().filter(|i| **i != out).map(|i| ratios[*i]).collect();
            let mean = Value::mean(&others)?;
            let n = others.len() as f64;
            // The scatter of one ratio about the mean of the others.
            let own = mean.standard_uncertainty * (n + 1.0).sqrt();
            let off = ratios[out] - mean.value;
            let rounding = 1e-12 * mean.value.abs();
            (off.abs() > rounding)
                .then(|| (student_tail(off / own.max(rounding), others.len() as u32 - 1), out, off / mean.value))
        };
        let Some((tail, point, off)) = left.iter().filter_map(test).min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if tail * left.len() as f64 > FALSE_ALARM {
            break;
        }
        found.push(Outlier { point, off });
        left.retain(|index| *index != point);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[(f64, f64)]) -> Vec<CalibrationPoint> {
        list.iter().map(|(reference, reading)| CalibrationPoint::new(*reference, *reading)).collect()
    }

    #[test]
    fn a_line_and_its_largest_deviation_are_found() {
        // 1 + 2x with residuals +1, −1, −1, +1, which are orthogonal to 1 and x.
        let line = straight(&points(&[(0.0, 2.0), (1.0, 2.0), (2.0, 4.0), (3.0, 8.0)])).unwrap();
        assert!((line.slope.value - 2.0).abs() < 1e-12 && (line.intercept.value - 1.0).abs() < 1e-12);
        assert!((line.linearity() - 1.0).abs() < 1e-12 && (line.residual_rms() - 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(straight(&points(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])), None, "too few");
        assert_eq!(straight(&points(&[(1.0, 0.0); 5])), None, "one reference");
    }

    #[test]
    fn a_point_off_the_line_is_named_and_scatter_is_not() {
        let mut noise = fastrand::Rng::with_seed(4);
        let mut list: Vec<(f64, f64)> =
            (-3..=3).map(|n| (f64::from(n), 0.1 + 1.02 * f64::from(n) + 0.001 * (noise.f64() - 0.5))).collect();
        assert_eq!(straight(&points(&list)).unwrap().outliers, []);
        list[4].1 += 0.05;
        let found = straight(&points(&list)).unwrap().outliers;
        assert_eq!(found.len(), 1);
        assert!(found[0].point == 4 && (found[0].off - 0.05).abs() < 0.002, "{found:?}");
        // Typed values without any scatter.
        let exact: Vec<(f64, f64)> = (0..6).map(|n| (f64::from(n), if n == 3 { 3.5 } else { f64::from(n) })).collect();
        assert_eq!(straight(&points(&exact)).unwrap().outliers[0].point, 3);
    }

    /// The stated rate of false alarms is 1 %; of 1000 calibrations of seven points 10 ± 3.
    #[test]
    fn one_calibration_in_a_hundred_has_a_false_alarm() {
        let mut rng = fastrand::Rng::with_seed(8);
        let mut normal = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
        let alarms = (0..1000).filter(|_| {
            let list: Vec<(f64, f64)> = (-3..=3).map(|n| (f64::from(n), f64::from(n) + 0.01 * normal())).collect();
            !straight(&points(&list)).unwrap().outliers.is_empty()
        });
        let alarms = alarms.count();
        assert!((1..=20).contains(&alarms), "{alarms}");
    }

    #[test]
    fn hysteresis_is_the_difference_between_down_and_up() {
        let up_and_down =
            [(0.0, 0.0), (10.0, 10.0), (20.0, 20.0), (40.0, 40.0), (20.0, 20.3), (10.0, 10.2), (0.0, 0.1)];
        let found = hysteresis(&points(&up_and_down)).unwrap();
        assert!((found.value - 0.2).abs() < 1e-12, "{found:?}");
        assert_eq!(hysteresis(&points(&up_and_down[..4])), None);
    }

    #[test]
    fn blows_give_a_mean_ratio_and_a_mistyped_one_is_named() {
        let mut list = points(&[(0.102, 0.1), (0.204, 0.2), (0.101, 0.1), (0.103, 0.1), (0.255, 0.25), (0.152, 0.15)]);
        let found = ratio(&list).unwrap();
        assert!((found.value - 1.0189).abs() < 1e-4, "{found:?}");
        assert_eq!(outlying_ratios(&list), []);
        list[2].reference = 0.01;
        assert_eq!(outlying_ratios(&list)[0].point, 2);
    }
}
