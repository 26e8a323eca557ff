//! Sound pressure levels of a recording: calibration, frequency weighting, levels over time, background.
//!
//! Levels are in dB relative to 20 µPa. The weightings A, C and Z are those of IEC 61672-1, by the closed form of their analogue
//! definition ([`weighting`]). The equivalent level Leq is that of the mean square; F and S are exponential averages of the square
//! with 125 ms and 1 s.

pub mod calibration;
pub mod recording;
pub mod weighting;

use super::Estimate;
use super::statistics::Value;
use crate::failure::Failure;
use recording::SoundRecording;
use weighting::Weighting;

/// Reference pressure, Pa: 0 dB.
pub const REFERENCE_PA: f64 = 20e-6;

/// Time constants of the time weightings F and S, s.
const FAST_S: f64 = 0.125;
const SLOW_S: f64 = 1.0;

/// Level of a mean square, dB.
#[must_use]
pub fn level_db(mean_square_pa2: f64) -> f64 {
    10.0 * (mean_square_pa2 / (REFERENCE_PA * REFERENCE_PA)).log10()
}

/// Change of a level per relative change of the mean square, dB.
const DB_PER_SHARE: f64 = 10.0 / std::f64::consts::LN_10;

/// Least difference from the background, dB: below it the source's own level is only bounded.
pub const MIN_DIFFERENCE_DB: f64 = 3.0;

/// How a recording is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// Pressure of one unit of the recording, Pa.
    pub pascal_per_unit: f64,
    /// Standard uncertainty of the calibration, dB.
    pub calibration_uncertainty_db: f64,
    /// Frequency weighting.
    pub weighting: Weighting,
    /// Length of a window of the level over time, s.
    pub window_s: f64,
}

/// Levels of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Levels {
    /// Equivalent level over the recording with its scatter from window to window, without the calibration's uncertainty, dB.
    pub equivalent_db: Value,
    /// Equivalent level of each whole window, dB.
    pub windows_db: Vec<f64>,
    /// Largest level with the time weighting F, dB.
    pub fast_max_db: f64,
    /// Largest level with the time weighting S, dB; none for a recording shorter than a second.
    pub slow_max_db: Option<f64>,
    /// Largest magnitude of the weighted pressure as a level, dB.
    pub peak_db: f64,
}

/// Windows from which the scatter of the level is known.
const MIN_WINDOWS: usize = 3;

/// Evaluates a recording.
///
/// # Errors
/// A silent recording, one shorter than a window.
pub fn levels(recording: &SoundRecording, evaluation: &Evaluation) -> Result<Levels, Failure> {
    if recording.is_silent() {
        return Err(
            recording.refuse("it is silent: all samples are the same\n  was the microphone connected and switched on?")
        );
    }
    let pressure = evaluation.weighting.applied(&recording.samples, recording.sample_rate_hz);
    let scale = evaluation.pascal_per_unit * evaluation.pascal_per_unit;
    let squares: Vec<f64> = pressure.iter().map(|p| p * p * scale).collect();
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let per_window = (evaluation.window_s * recording.sample_rate_hz).round() as usize;
    if per_window < 2 || per_window > squares.len() {
        return Err(recording.refuse(format!(
            "a window of {} s does not fit: the recording has {:.3} s at {} Hz\n  give a --window-s within it",
            evaluation.window_s,
            recording.duration_s(),
            recording.sample_rate_hz
        )));
    }
    let of_window = |window: &[f64]| window.iter().sum::<f64>() / window.len() as f64;
    let powers: Vec<f64> = squares.chunks_exact(per_window).map(of_window).collect();
    let largest = |time_constant_s: f64| largest_average(&squares, recording.sample_rate_hz, time_constant_s);
    let peak = squares.iter().fold(0.0f64, |most, p| most.max(*p));
    Ok(Levels {
        equivalent_db: equivalent(mean, &powers),
        windows_db: powers.iter().map(|power| level_db(*power)).collect(),
        fast_max_db: level_db(largest(FAST_S)),
        slow_max_db: (recording.duration_s() >= SLOW_S).then(|| level_db(largest(SLOW_S))),
        peak_db: level_db(peak),
    })
}

/// Leq with the uncertainty that the scatter of the windows' mean squares shows; none from fewer than three windows.
fn equivalent(mean: f64, powers: &[f64]) -> Value {
    let value = level_db(mean);
    match Value::mean(powers).filter(|_| powers.len() >= MIN_WINDOWS) {
        Some(windows) => Value { value, ..windows.mapped(value, DB_PER_SHARE / mean) },
        None => Value { value, standard_uncertainty: 0.0, degrees_of_freedom: f64::MAX },
    }
}

/// The value with the uncertainty of the calibration too, dB. It is common to all levels, so it comes last.
fn with_calibration(value: &Value, calibration_db: f64) -> Value {
    let own = value.standard_uncertainty;
    let all = own.hypot(calibration_db);
    let freedom = if own > 0.0 { value.degrees_of_freedom * (all / own).powi(4) } else { f64::MAX };
    Value { standard_uncertainty: all, degrees_of_freedom: freedom, ..*value }
}

/// The largest exponential average: p² through a first-order low-pass from rest, exact for values that are held over a sample.
fn largest_average(squares: &[f64], sample_rate_hz: f64, time_constant_s: f64) -> f64 {
    let share = 1.0 - (-1.0 / (sample_rate_hz * time_constant_s)).exp();
    let (mut average, mut largest) = (0.0, 0.0f64);
    for square in squares {
        average += share * (square - average);
        largest = largest.max(average);
    }
    largest
}

/// A level less the background, energetically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Corrected {
    /// The level of the source alone, dB.
    Level(Value),
    /// It is at most this, dB: the background is too near.
    AtMost(f64),
}

/// Subtracts the background's mean square.
#[must_use]
pub fn corrected(level: &Value, background: &Value) -> Corrected {
    let difference = level.value - background.value;
    if difference < MIN_DIFFERENCE_DB {
        // ISO 3744 and others: at a difference of 3 dB the correction is 3 dB.
        return Corrected::AtMost(level.value - correction_db(MIN_DIFFERENCE_DB));
    }
    let share = 10f64.powf(-difference / 10.0);
    // L = 10 lg(E − B): ∂L/∂L_E = 1/(1 − B/E), ∂L/∂L_B = −(B/E)/(1 − B/E).
    let [own, other] = [level.standard_uncertainty, share * background.standard_uncertainty].map(|u| u / (1.0 - share));
    let freedom = level.degrees_of_freedom.min(background.degrees_of_freedom);
    Corrected::Level(Value {
        value: level.value - correction_db(difference),
        standard_uncertainty: own.hypot(other),
        degrees_of_freedom: freedom,
    })
}

/// 10 lg of the share of the source in the sum, for a difference between sum and background, dB.
fn correction_db(difference_db: f64) -> f64 {
    -10.0 * (1.0 - 10f64.powf(-difference_db / 10.0)).log10()
}

const MEAN_SQUARE: &str = "mean square of the weighted pressure";
const EXPONENTIAL: &str = "exponential average of the square";

/// The estimates of a recording and, with a background, of the source alone.
#[must_use]
pub fn estimates(levels: &Levels, background: Option<&Levels>, evaluation: &Evaluation) -> Vec<Estimate> {
    let names = evaluation.weighting.names();
    let unit = evaluation.weighting.unit();
    let calibrated = |value: &Value| with_calibration(value, evaluation.calibration_uncertainty_db);
    let mut all = Vec::new();
    if let Some(background) = background {
        if let Corrected::Level(value) = corrected(&levels.equivalent_db, &background.equivalent_db) {
            all.push(Estimate::new(names.source, unit, "energetic difference", &calibrated(&value)));
        }
        all.push(Estimate::new(names.background, unit, MEAN_SQUARE, &calibrated(&background.equivalent_db)));
    }
    all.push(Estimate::new(names.equivalent, unit, MEAN_SQUARE, &calibrated(&levels.equivalent_db)));
    let of_maximum = |value| calibrated(&Value { value, standard_uncertainty: 0.0, degrees_of_freedom: f64::MAX });
    all.push(Estimate::new(names.fast, unit, EXPONENTIAL, &of_maximum(levels.fast_max_db)));
    all.extend(levels.slow_max_db.map(|slow| Estimate::new(names.slow, unit, EXPONENTIAL, &of_maximum(slow))));
    all.push(Estimate::new(names.peak, unit, "largest magnitude", &of_maximum(levels.peak_db)));
    all
}

/// What a person has to know about them.
#[must_use]
pub fn remarks(levels: &Levels, background: Option<&Levels>, evaluation: &Evaluation) -> Vec<String> {
    let ends = levels.windows_db.iter().fold([f64::MAX, f64::MIN], |[low, high], l| [low.min(*l), high.max(*l)]);
    let unit = evaluation.weighting.unit();
    let mut remarks = vec![format!(
        "{} windows of {} s: {:.1} {unit} to {:.1} {unit}",
        levels.windows_db.len(),
        evaluation.window_s,
        ends[0],
        ends[1]
    )];
    if levels.windows_db.len() < MIN_WINDOWS {
        remarks.push(
            "fewer than three windows: the uncertainty is that of the calibration alone; record longer, or give a shorter --window-s".into(),
        );
    }
    if let Some(background) = background {
        let difference = levels.equivalent_db.value - background.equivalent_db.value;
        if let Corrected::AtMost(bound) = corrected(&levels.equivalent_db, &background.equivalent_db) {
            remarks.push(format!(
                "the recording is only {difference:.1} dB above the background: the source alone has at most {bound:.1} {unit}. For a level \
                 the difference must be at least {MIN_DIFFERENCE_DB} dB: lower the background or move the microphone nearer"
            ));
        }
    }
    remarks
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn sine(frequency_hz: f64, rms: f64, seconds: f64, rate_hz: f64) -> SoundRecording {
        let count = (seconds * rate_hz).round() as usize;
        let at = |n: usize| 2f64.sqrt() * rms * (TAU * frequency_hz * n as f64 / rate_hz).sin();
        SoundRecording {
            file: "tone.wav".into(),
            is_pascal: false,
            sample_rate_hz: rate_hz,
            samples: (0..count).map(at).collect(),
        }
    }

    fn evaluation(weighting: Weighting) -> Evaluation {
        Evaluation { pascal_per_unit: 1.0, calibration_uncertainty_db: 0.1, weighting, window_s: 0.5 }
    }

    /// 20·lg(1/20e-6) = 93.979 dB; at 1 kHz every weighting is 0 dB by definition, as rounded in the standard.
    #[test]
    fn a_sine_of_one_pascal_at_1_khz_has_94_db_with_every_weighting() {
        for weighting in Weighting::ALL {
            let found = levels(&sine(1000.0, 1.0, 10.0, 48_000.0), &evaluation(weighting)).unwrap();
            // The ends of the tone, which begins and ends at once, carry 1e-4 of its energy.
            assert!((found.equivalent_db.value - 93.979).abs() < 2e-3, "{weighting:?}: {found:?}");
            assert_eq!(found.windows_db.len(), 20);
            assert!((found.slow_max_db.unwrap() - 93.979).abs() < 2e-3, "{weighting:?}: {found:?}");
        }
    }

    /// IEC 61672-1, response to tone bursts of 4 kHz: 10·lg(1 − e^(−T/τ)) below the level of the steady tone.
    #[test]
    fn the_largest_fast_level_of_a_burst_is_that_of_the_standard() {
        for (burst_s, fast_db, slow_db) in
            [(1.0, 0.0, -2.0), (0.2, -1.0, -7.4), (0.05, -4.8, -13.1), (0.01, -11.1, -20.0)]
        {
            let mut recording = sine(4000.0, 1.0, 3.0, 48_000.0);
            let length = (burst_s * 48_000.0) as usize;
            for (n, sample) in recording.samples.iter_mut().enumerate() {
                *sample *= f64::from(u8::from((24_000..24_000 + length).contains(&n)));
            }
            let found = levels(&recording, &evaluation(Weighting::A)).unwrap();
            let steady = levels(&sine(4000.0, 1.0, 3.0, 48_000.0), &evaluation(Weighting::A)).unwrap();
            let (fast, slow) = (found.fast_max_db, found.slow_max_db.unwrap());
            // The standard's values are rounded to 0.1 dB.
            assert!((fast - steady.equivalent_db.value - fast_db).abs() < 0.06, "{burst_s} s: {fast}");
            assert!((slow - steady.equivalent_db.value - slow_db).abs() < 0.06, "{burst_s} s: {slow}");
        }
    }

    /// Two equal sources are 3.01 dB above one; at 10 dB the correction is 0.458 dB.
    #[test]
    fn a_background_is_subtracted_by_its_energy() {
        let value = |value: f64| Value { value, standard_uncertainty: 0.1, degrees_of_freedom: f64::MAX };
        let Corrected::Level(level) = corrected(&value(70.0), &value(60.0)) else { panic!("10 dB suffice") };
        assert!((level.value - 69.542).abs() < 1e-3, "{level:?}");
        let share: f64 = 0.1;
        assert!((level.standard_uncertainty - 0.1 / 0.9 * (1.0 + share * share).sqrt()).abs() < 1e-9, "{level:?}");
        let Corrected::Level(level) = corrected(&value(63.0103), &value(60.0)) else { panic!("3.01 dB suffice") };
        assert!((level.value - 60.0).abs() < 1e-3, "{level:?}");
        let Corrected::AtMost(bound) = corrected(&value(62.0), &value(60.0)) else { panic!("2 dB do not") };
        assert!((bound - (62.0 - 3.0206)).abs() < 1e-3, "{bound}");
    }
}
