//! The scale of the walls from blows: the mean of the ratios of impulses, and whether both walls agree.

use damprig_core::settings::Settings;

use super::Channel;
use super::fit::{self, Outlier};
use super::readings::CalibrationPoint;
use super::solve::{Solved, plausible};
use crate::failure::Failure;
use crate::identify::Estimate;
use crate::identify::statistics::Value;

const METHOD: &str = "mean of the ratios";

/// The key of the gain.
const KEY: &str = "calibration.walls.newtons_per_count";

/// Both walls share a scale: the mean of their ratios.
pub(super) fn solve(points: &[CalibrationPoint], settings: &Settings) -> Result<Solved, Failure> {
    let unusable = points.iter().position(|p| p.reference <= 0.0 || p.reading <= 0.0);
    if let Some(at) = unusable {
        return Err(Failure::Input(format!(
            "blow {}: an impulse of {} N·s with a reading of {} N·s: both must be greater than 0",
            at + 1,
            points[at].reference,
            points[at].reading
        )));
    }
    let of = |side: i8| -> Vec<CalibrationPoint> { points.iter().filter(|p| p.side == side).copied().collect() };
    let sides: Vec<(&str, Vec<CalibrationPoint>)> = [("at −d", of(-1)), ("at +d", of(1)), ("without a side", of(0))]
        .into_iter()
        .filter(|(_, p)| !p.is_empty())
        .collect();
    if points.len() < fit::MIN_POINTS || sides.iter().any(|(_, points)| points.len() < 3) {
        return Err(Failure::Input(format!(
            "too few blows: {} in all\n  at least three on each wall that was hit are needed, better ten",
            points.len()
        )));
    }
    let means: Vec<(&str, Value)> = sides.iter().filter_map(|(name, p)| Some((*name, fit::ratio(p)?))).collect();
    let (change, remarks) = joint(&means);
    plausible(Channel::Walls, change.value)?;
    let gain = f64::from(settings.calibration.walls.newtons_per_count);
    let gains = |value: &Value| value.mapped(value.value * gain, gain);
    let mut estimates = vec![Estimate::new("gain", "N/count", METHOD, &gains(&change)).of_key(KEY)];
    for (name, value) in means.iter().filter(|_| means.len() > 1) {
        let quantity = if *name == "at −d" { "gain of the wall at −d" } else { "gain of the wall at +d" };
        estimates.push(Estimate::new(quantity, "N/count", METHOD, &gains(value)));
    }
    let residuals: Vec<f64> = points.iter().map(|p| p.reading - p.reference / change.value).collect();
    let squares: f64 = residuals.iter().map(|r| r * r).sum();
    let mut outliers = Vec::new();
    for side in [-1, 1, 0] {
        let places: Vec<usize> = (0..points.len()).filter(|i| points[*i].side == side).collect();
        let found = fit::outlying_ratios(&of(side));
        outliers.extend(
            found.iter().map(|o| Outlier { point: places[o.point], off: o.off * points[places[o.point]].reading }),
        );
    }
    let residual_rms = (squares / (points.len() as f64 - 1.0)).sqrt();
    Ok(Solved { estimates, change, residuals, residual_rms, outliers, remarks })
}

/// The joint ratio of the walls. If they differ, half of the difference is the error of either, and counts as uncertainty.
fn joint(means: &[(&str, Value)]) -> (Value, Vec<String>) {
    let [(_, low), (_, high)] = means else {
        let only =
            means.first().map_or(Value { value: 1.0, standard_uncertainty: 0.0, degrees_of_freedom: 1.0 }, |m| m.1);
        return (only, vec!["one wall alone was hit: the other is taken to have the same scale".into()]);
    };
    let value = 0.5 * (low.value + high.value);
    let own = 0.5 * low.standard_uncertainty.hypot(high.standard_uncertainty);
    let (difference, expected) = (high.value - low.value, 2.0 * own);
    let degrees_of_freedom = low.degrees_of_freedom + high.degrees_of_freedom;
    if difference.abs() <= 2.0 * expected {
        let remark = format!(
            "both walls agree: they differ by {:.2} %, within {:.2} %",
            100.0 * difference / value,
            200.0 * expected / value
        );
        return (Value { value, standard_uncertainty: own, degrees_of_freedom }, vec![remark]);
    }
    let remark = format!(
        "the walls differ: the one at +d needs {:+.2} ± {:.2} % more gain than the one at −d, and both share one scale. The mean \
         is off by {:.2} % on either; if that is too much, match the sensors or their amplifiers",
        100.0 * difference / value,
        100.0 * expected / value,
        50.0 * (difference / value).abs()
    );
    let standard_uncertainty = own.hypot(0.5 * difference);
    (Value { value, standard_uncertainty, degrees_of_freedom }, vec![remark])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_that_differ_are_told_apart_from_walls_that_scatter() {
        let blows = |high: f64| -> Vec<CalibrationPoint> {
            let scatter = [1.01, 0.99, 1.005, 0.995, 1.0, 1.008, 0.992, 1.003, 0.997, 1.0];
            let one = |side: i8, factor: f64| {
                scatter.map(|e| CalibrationPoint { side, ..CalibrationPoint::new(0.1 * e * factor, 0.1) }).to_vec()
            };
            [one(-1, 1.02), one(1, high)].concat()
        };
        let settings = Settings::default();
        let same = solve(&blows(1.021), &settings).unwrap();
        assert!(same.remarks[0].contains("both walls agree"), "{:?}", same.remarks);
        let differ = solve(&blows(1.08), &settings).unwrap();
        assert!(differ.remarks[0].contains("the walls differ"), "{:?}", differ.remarks);
        assert!((differ.change.value - 1.05).abs() < 1e-6 && differ.change.standard_uncertainty > 0.029);
        assert!(solve(&blows(1.0)[..2], &settings).unwrap_err().to_string().contains("too few blows"));
    }
}
