//! The scale of a channel from its points: new settings with their uncertainties, and what a person has to know.

use damprig_core::settings::Settings;

use super::fit::{self, CalibrationLine, Outlier};
use super::readings::CalibrationPoint;
use super::{Channel, walls};
use crate::failure::Failure;
use crate::identify::Estimate;
use crate::identify::statistics::{Value, line};

/// A gain that differs from the old one by more than this factor is an error of typing or of wiring.
const MAX_CHANGE: f64 = 2.0;

/// References that cover less than this share of the usable span: the ends are extrapolated.
const MIN_COVER: f64 = 0.4;

/// The new calibration of a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Solved {
    /// The new gain, the key first; then the zero and what else was found.
    pub estimates: Vec<Estimate>,
    /// The new gain over the old one.
    pub change: Value,
    /// Residual of each point, in the unit of the reading.
    pub residuals: Vec<f64>,
    /// RMS of the residuals per degree of freedom.
    pub residual_rms: f64,
    /// The points that do not belong to the others.
    pub outliers: Vec<Outlier>,
    /// What a person has to know.
    pub remarks: Vec<String>,
}

const BY_LINE: &str = "line through the readings";

/// Fits the points of a channel on a board with these settings. `allows_reversed`: a falling reading is meant.
///
/// # Errors
/// Too few points, a reversed sign, a gain that cannot be: what it is, and what to do.
pub fn solve(
    channel: Channel,
    points: &[CalibrationPoint],
    settings: &Settings,
    allows_reversed: bool,
) -> Result<Solved, Failure> {
    match channel {
        Channel::Walls => walls::solve(points, settings),
        Channel::Drive => drive(points, settings, allows_reversed),
        _ => by_line(channel, points, settings, allows_reversed),
    }
}

fn by_line(
    channel: Channel,
    points: &[CalibrationPoint],
    settings: &Settings,
    allows_reversed: bool,
) -> Result<Solved, Failure> {
    let line = checked_line(channel, points, allows_reversed)?;
    let change = gain_change(channel, line.slope, settings);
    plausible(channel, change.value)?;
    let mut solved = Solved {
        estimates: estimates(channel, &line, settings, change),
        change,
        residual_rms: line.residual_rms(),
        outliers: line.outliers.clone(),
        remarks: Vec::new(),
        residuals: line.residuals.clone(),
    };
    solved.remarks.extend(covers(channel, points, settings));
    solved.remarks.push(linearity(channel, points, &line));
    match channel {
        Channel::Spring | Channel::FrictionSpring => solved.remarks.extend(hysteresis(channel, points)),
        Channel::Match => solved.remarks.extend(time_difference(points, &mut solved.estimates)),
        _ => {}
    }
    Ok(solved)
}

/// The line through the points, if it rises.
fn checked_line(
    channel: Channel,
    points: &[CalibrationPoint],
    allows_reversed: bool,
) -> Result<CalibrationLine, Failure> {
    let line = fit::straight(points).ok_or_else(|| too_few(channel, points))?;
    let slope = line.slope;
    // A small reading over a large range of references has no slope at all.
    if slope.value.abs() <= 3.0 * slope.standard_uncertainty {
        return Err(Failure::Input(format!(
            "the readings do not follow the references: slope {:.3e} ± {:.1e}\n  is the sensor of {channel} the one that looks at \
             the target, and was the target moved?",
            slope.value, slope.standard_uncertainty
        )));
    }
    if slope.value < 0.0 && !allows_reversed {
        let help = if matches!(channel, Channel::X | Channel::Z | Channel::Drive) {
            "check the signs that were typed and the sensor's direction; if the sensor is meant to be mounted the other way \
             round, add --reversed"
        } else {
            "check the signs that were typed, and the direction of the force on the sensor"
        };
        return Err(Failure::Input(format!(
            "reversed sign: the reading of {channel} falls where the reference rises\n  {help}"
        )));
    }
    Ok(line)
}

/// The new gain over the old one: of a sensor the inverse of its slope; the slope of a spring is its stiffness.
fn gain_change(channel: Channel, slope: Value, settings: &Settings) -> Value {
    match channel {
        Channel::FrictionSpring => {
            let (before, _) = old(channel, settings);
            slope.mapped(slope.value / before, 1.0 / before)
        }
        _ => slope.mapped(1.0 / slope.value, 1.0 / slope.value.powi(2)),
    }
}

fn too_few(channel: Channel, points: &[CalibrationPoint]) -> Failure {
    let mut references: Vec<f64> = points.iter().map(|p| p.reference).collect();
    references.sort_by(f64::total_cmp);
    references.dedup();
    Failure::Input(format!(
        "too few points for {channel}: {} at {} different references\n  at least {} points at two references or more are needed, \
         better seven over the span",
        points.len(),
        references.len(),
        fit::MIN_POINTS
    ))
}

/// Refuses a gain that differs from the old one by more than an error of assumption.
/// Of a sensor that is mounted the other way round, the sign is meant.
pub(super) fn plausible(channel: Channel, change: f64) -> Result<(), Failure> {
    let change = change.abs();
    // The stiffness in the settings may be a guess.
    if channel == Channel::FrictionSpring || (1.0 / MAX_CHANGE..=MAX_CHANGE).contains(&change) {
        return Ok(());
    }
    let is_thousand = |factor: f64| (0.5..=2.0).contains(&(change / factor));
    let help = if is_thousand(1e3) || is_thousand(1e-3) {
        "a factor of about a thousand: a reference in mm where m is meant, or the reverse? write the unit behind it"
    } else {
        "check the references, their unit, and whether the old settings are of this sensor"
    };
    Err(Failure::Input(format!(
        "the new gain of {channel} would be {change:.4} times the old one, which no sensor of this rig explains\n  {help}"
    )))
}

/// The settings' keys of a channel's gain and zero.
fn keys(channel: Channel) -> (&'static str, Option<&'static str>) {
    match channel {
        Channel::X => ("calibration.x.metres_per_count", Some("calibration.x.zero_counts")),
        Channel::Z => ("calibration.z.metres_per_count", Some("calibration.z.zero_counts")),
        // x stays the reference.
        Channel::Match => ("calibration.z.metres_per_count", None),
        Channel::Spring => ("calibration.spring.newtons_per_count", Some("calibration.spring.zero_counts")),
        Channel::Walls => ("calibration.walls.newtons_per_count", None),
        Channel::Drive => ("calibration.drive.metres_per_count", Some("calibration.drive.zero_counts")),
        Channel::FrictionSpring => ("spring.stiffness_n_per_m", None),
    }
}

/// The old gain and zero of a channel.
fn old(channel: Channel, settings: &Settings) -> (f64, f64) {
    let c = &settings.calibration;
    let (gain, zero) = match channel {
        Channel::X => (c.x.metres_per_count, c.x.zero_counts),
        Channel::Z | Channel::Match => (c.z.metres_per_count, c.z.zero_counts),
        Channel::Spring => (c.spring.newtons_per_count, c.spring.zero_counts),
        Channel::Walls => (c.walls.newtons_per_count, c.walls.zero_counts),
        Channel::Drive => (c.drive.metres_per_count, c.drive.zero_counts),
        Channel::FrictionSpring => (settings.spring.stiffness_n_per_m, 0.0),
    };
    (f64::from(gain), f64::from(zero))
}

fn estimates(channel: Channel, line: &CalibrationLine, settings: &Settings, change: Value) -> Vec<Estimate> {
    let (gain, zero) = old(channel, settings);
    let (gain_key, zero_key) = keys(channel);
    let unit = match channel {
        Channel::Spring | Channel::Walls => "N/count",
        Channel::FrictionSpring => "N/m",
        _ => "m/count",
    };
    let quantity = if channel == Channel::FrictionSpring { "stiffness" } else { "gain" };
    let mut list =
        vec![Estimate::new(quantity, unit, BY_LINE, &change.mapped(change.value * gain, gain)).of_key(gain_key)];
    if let Some(key) = zero_key {
        let at_zero = line.intercept;
        let counts = at_zero.mapped(zero + at_zero.value / gain, 1.0 / gain);
        list.push(Estimate::new("zero", "counts", BY_LINE, &counts).of_key(key));
    }
    list
}

/// Steps and sine count as the same gain up to this difference.
const SAME_GAIN: f64 = 0.02;

/// The drive: the zero from steps, as the demand for which the base stands where it rests without the drive. The gain from steps
/// too, unless the base does not follow them as it follows a sine; then that of the sine, at which the drive is used. A sine
/// that z reads is smaller by the response of its sensor, so that steps are the better measure.
fn drive(points: &[CalibrationPoint], settings: &Settings, allows_reversed: bool) -> Result<Solved, Failure> {
    let (moving, still): (Vec<usize>, Vec<usize>) = (0..points.len()).partition(|i| points[*i].frequency_hz > 0.0);
    let line_of = |places: &[usize]| -> Result<Option<CalibrationLine>, Failure> {
        let own: Vec<CalibrationPoint> = places.iter().map(|i| points[*i]).collect();
        if own.is_empty() { Ok(None) } else { checked_line(Channel::Drive, &own, allows_reversed).map(Some) }
    };
    let (steps, sines) = (line_of(&still)?, line_of(&moving)?);
    let mut remarks = Vec::new();
    let main = match (&steps, &sines) {
        (Some(steps), Some(sines)) => {
            let ratio = sines.slope.value / steps.slope.value.abs();
            let (main, which) =
                if (ratio - 1.0).abs() <= SAME_GAIN { (steps, "the steps") } else { (sines, "the sine") };
            remarks.push(format!(
                "driven by a sine the base moves {ratio:.4} times as far as by steps: the gain is that of {which}"
            ));
            main
        }
        (Some(main), None) | (None, Some(main)) => main,
        (None, None) => return Err(too_few(Channel::Drive, points)),
    };
    // Amplitudes have no sign.
    let direction = steps.as_ref().map_or(1.0, |steps| steps.slope.value.signum());
    let change = main.slope.mapped(main.slope.value.abs() * direction, 1.0);
    plausible(Channel::Drive, change.value)?;
    remarks.insert(0, linearity(Channel::Drive, points, main));
    let mut solved = Solved {
        estimates: estimates(Channel::Drive, main, settings, change),
        change,
        residual_rms: main.residual_rms(),
        remarks,
        residuals: vec![0.0; points.len()],
        outliers: Vec::new(),
    };
    // The line of amplitudes says nothing of the zero.
    solved.estimates.truncate(1);
    for (places, line) in [(&moving, &sines), (&still, &steps)] {
        let Some(line) = line else { continue };
        places.iter().zip(&line.residuals).for_each(|(place, residual)| solved.residuals[*place] = *residual);
        solved.outliers.extend(line.outliers.iter().map(|o| Outlier { point: places[o.point], ..*o }));
    }
    match &steps {
        Some(line) => solved.estimates.push(drive_zero(line, settings)),
        None => solved.remarks.push("zero: not measured without steps; the old one stays".into()),
    }
    Ok(solved)
}

fn drive_zero(steps: &CalibrationLine, settings: &Settings) -> Estimate {
    let (gain, zero) = old(Channel::Drive, settings);
    let (base, slope) = (steps.intercept, steps.slope.value);
    let counts = base.mapped(zero - base.value / (slope * gain), 1.0 / (slope * gain));
    let key = keys(Channel::Drive).1.unwrap_or_default();
    Estimate::new("zero", "counts", "demand at which the base rests", &counts).of_key(key)
}

/// A remark if the references cover only a part of the span.
fn covers(channel: Channel, points: &[CalibrationPoint], settings: &Settings) -> Option<String> {
    let [low, high] = channel.usable(settings)?;
    let (least, most) = points
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.reference), high.max(p.reference)));
    let share = (most - least) / (high - low);
    (share < MIN_COVER).then(|| {
        format!(
            "the references cover {:.0} % of the usable span: the gain is extrapolated to the rest; spread them further",
            100.0 * share
        )
    })
}

fn linearity(channel: Channel, points: &[CalibrationPoint], line: &CalibrationLine) -> String {
    let readings = points.iter().map(|p| p.reading);
    let span = readings.clone().fold(f64::NEG_INFINITY, f64::max) - readings.fold(f64::INFINITY, f64::min);
    let (unit, factor) = channel.shown_reading();
    format!(
        "linearity: at most {} {unit} off the line, {} % of the span of the readings",
        short(line.linearity() * factor),
        short(100.0 * line.linearity() / span)
    )
}

/// A number with three significant digits.
fn short(value: f64) -> String {
    let decimals = if value == 0.0 { 0.0 } else { 2.0 - value.abs().log10().floor() };
    format!("{value:.0$}", decimals.clamp(0.0, 9.0) as usize)
}

fn hysteresis(channel: Channel, points: &[CalibrationPoint]) -> Option<String> {
    let found = fit::hysteresis(points)?;
    let (unit, factor) = channel.shown_reading();
    let [low, high] = found.interval_95();
    let is_seen = low > 0.0 || high < 0.0;
    Some(format!(
        "hysteresis: {} ± {} {unit} on the way down against the way up{}",
        short(found.value * factor),
        short(found.standard_uncertainty * factor),
        if is_seen { "" } else { ", not distinguishable from none" }
    ))
}

/// The time by which z is ahead of x, from the phases at several frequencies; it is recorded, not corrected.
fn time_difference(points: &[CalibrationPoint], estimates: &mut Vec<Estimate>) -> Vec<String> {
    use std::f64::consts::TAU;
    let moving: Vec<&CalibrationPoint> = points.iter().filter(|p| p.frequency_hz > 0.0).collect();
    if moving.is_empty() {
        return vec!["time difference: not measured, the target did not move".into()];
    }
    let omega: Vec<f64> = moving.iter().map(|p| TAU * p.frequency_hz).collect();
    let leads: Vec<f64> = moving.iter().map(|p| p.lead_rad).collect();
    let Some(found) = delay(&omega, &leads) else {
        return vec!["time difference: not known from fewer than three points that move".into()];
    };
    estimates.push(Estimate::new("lead of z", "s", "phase over angular frequency", &found));
    let mut remarks = vec!["the lead of z is recorded; no setting corrects it".to_string()];
    // A phase that does not rise with the frequency is none of a delay.
    if let Some(fitted) = line(&omega, &leads, |_| 1.0)
        && fitted.intercept.value.abs() > 3.0 * fitted.intercept.standard_uncertainty
        && fitted.intercept.value.abs() > 1e-3
    {
        remarks.push(format!(
            "the phase at rest would be {:+.4} rad: the sensors differ by more than a delay (filters?)",
            fitted.intercept.value
        ));
    }
    remarks
}

/// Slope of a line through the origin.
fn delay(omega: &[f64], leads: &[f64]) -> Option<Value> {
    let squares: f64 = omega.iter().map(|w| w * w).sum();
    let nu = omega.len().checked_sub(1).filter(|nu| *nu >= 2)? as f64;
    let slope = omega.iter().zip(leads).map(|(w, lead)| w * lead).sum::<f64>() / squares;
    let variance = omega.iter().zip(leads).map(|(w, lead)| (lead - slope * w).powi(2)).sum::<f64>() / nu;
    Some(Value { value: slope, standard_uncertainty: (variance / squares).sqrt(), degrees_of_freedom: nu })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[(f64, f64)]) -> Vec<CalibrationPoint> {
        list.iter().map(|(reference, reading)| CalibrationPoint::new(*reference, *reading)).collect()
    }

    /// Readings of a sensor with this slope and zero at seven references, which scatter a little.
    fn seven(slope: f64, zero: f64) -> Vec<CalibrationPoint> {
        let scatter = [3e-6, -2e-6, 1e-6, -4e-6, 2e-6, 1e-6, -1e-6];
        let point = |(n, e): (i32, f64)| (f64::from(n) * 0.02, zero + slope * f64::from(n) * 0.02 + e);
        points(&(-3..=3).zip(scatter).map(point).collect::<Vec<_>>())
    }

    fn told(channel: Channel, points: &[CalibrationPoint]) -> String {
        solve(channel, points, &Settings::default(), false).unwrap_err().to_string()
    }

    #[test]
    fn gain_and_zero_make_the_readings_right() {
        let settings = Settings::default();
        let solved = solve(Channel::X, &seven(0.98, 0.001), &settings, false).unwrap();
        let [gain, zero] = [0, 1].map(|n| solved.estimates[n].value);
        let old = settings.calibration.x;
        // Position +20 mm in counts under the old settings, then read with the new ones.
        let counts = (0.001 + 0.98 * 0.02) / f64::from(old.metres_per_count) + f64::from(old.zero_counts);
        assert!(((counts - zero) * gain - 0.02).abs() < 5e-6, "{gain} {zero}");
        assert_eq!(solved.estimates[0].key, Some("calibration.x.metres_per_count"));
    }

    #[test]
    fn what_cannot_be_is_said_in_the_words_of_the_experiment() {
        let mm: Vec<CalibrationPoint> =
            seven(1.0, 0.0).iter().map(|p| CalibrationPoint { reference: p.reference * 1e3, ..*p }).collect();
        assert!(told(Channel::X, &mm).contains("in mm where m is meant"));
        assert!(told(Channel::X, &seven(-1.0, 0.0)).contains("reversed sign"));
        assert!(told(Channel::X, &seven(1.0, 0.0)[..3]).contains("too few points for x: 3"));
        assert!(told(Channel::X, &seven(0.0, 0.0)).contains("do not follow"));
        assert!(told(Channel::X, &seven(0.2, 0.0)).contains("times the old one, which no sensor"));
        let reversed = solve(Channel::X, &seven(-1.0, 0.0), &Settings::default(), true).unwrap();
        assert!(reversed.estimates[0].value < 0.0);
    }

    #[test]
    fn the_drives_zero_is_the_demand_at_which_the_base_rests() {
        let settings = Settings::default();
        let gain = f64::from(settings.calibration.drive.metres_per_count);
        // The base stands at 1.1 (d − 0.2 mm).
        let still: Vec<(f64, f64)> =
            (-2..=2).map(|n| (f64::from(n) * 1e-3, 1.1 * (f64::from(n) * 1e-3 - 2e-4))).collect();
        let solved = solve(Channel::Drive, &points(&still), &settings, false).unwrap();
        let zero = f64::from(settings.calibration.drive.zero_counts) + 2e-4 / gain;
        assert!((solved.estimates[1].value - zero).abs() < 1e-6 && (solved.change.value - 1.1).abs() < 1e-9);
        // A sine at which the base moves half as far.
        let mut all = points(&still);
        all.extend((1..=4).map(|n| CalibrationPoint {
            frequency_hz: 2.5,
            ..CalibrationPoint::new(f64::from(n) * 1e-3, f64::from(n) * 0.5e-3)
        }));
        let solved = solve(Channel::Drive, &all, &settings, false).unwrap();
        assert!((solved.change.value - 0.5).abs() < 1e-9 && (solved.estimates[1].value - zero).abs() < 1e-6);
        assert!(solved.remarks.iter().any(|r| r.contains("0.4545 times as far")), "{:?}", solved.remarks);
    }

    #[test]
    fn a_lead_is_the_slope_of_phase_over_frequency() {
        use std::f64::consts::TAU;
        let list: Vec<CalibrationPoint> = [1.0, 2.0, 4.0, 1.0, 2.0, 4.0]
            .iter()
            .zip([1e-3, 1e-3, 1e-3, 2e-3, 2e-3, 2e-3])
            .map(|(f, x)| CalibrationPoint {
                frequency_hz: *f,
                lead_rad: TAU * f * 4e-5,
                ..CalibrationPoint::new(x, 0.97 * x)
            })
            .collect();
        let solved = solve(Channel::Match, &list, &Settings::default(), false).unwrap();
        assert!((solved.change.value - 1.0 / 0.97).abs() < 1e-9);
        assert!((solved.estimates.last().unwrap().value - 4e-5).abs() < 1e-12, "{:?}", solved.estimates);
    }
}
