//! The result of a calibration: new settings beside the old ones, the verdict, the file that `damprig settings import` reads.

use std::fmt::Write;

use damprig_core::settings::Settings;
use serde::Serialize;

use super::Channel;
use super::readings::{CalibrationPoint, to_csv};
use super::solve::Solved;
use crate::failure::Failure;
use crate::host_time::date_text;
use crate::identify::Estimate;
use crate::settings::{SettingEntry, check, decimal, entries, toml_of, with_values};

/// From this distance on the new gain and the old one differ, standard uncertainties.
const DIFFERS: f64 = 2.0;

/// A limit at the end of a sensor's usable span gets this share of it.
const INSIDE: f64 = 0.995;

/// A setting before and after.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Its path: `calibration.x.metres_per_count`.
    pub setting: String,
    /// Its value before.
    pub before: f32,
    /// Its value after.
    pub after: f32,
}

/// A calibration with everything that is told, written and kept of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationRecord {
    /// The channel.
    pub channel: &'static str,
    /// What the points were taken from: a rig, or a file.
    pub taken_from: String,
    /// Name and version of the program.
    pub damprig: &'static str,
    /// Date, as 2026-05-01.
    pub date: String,
    /// Days for which it is valid; 0 for ever.
    pub valid_days: f32,
    /// Date of the calibration before, or "never".
    pub before: String,
    /// The new gain, then the zero and what else was found.
    pub estimates: Vec<Estimate>,
    /// The new gain over the old one.
    pub gain_over_old: f64,
    /// Standard uncertainties by which the new gain is away from the old one; none without scatter.
    pub distance: Option<f64>,
    /// In words.
    pub verdict: String,
    /// RMS of the residuals, in the channel's SI unit.
    pub residual: f64,
    /// The points, in SI units.
    pub points: Vec<CalibrationPoint>,
    /// The residual of each point.
    pub residuals: Vec<f64>,
    /// Places of the points that do not belong to the others, from 0.
    pub outliers: Vec<usize>,
    /// What a person has to know.
    pub remarks: Vec<String>,
    /// The settings that differ.
    pub changes: Vec<Change>,
    /// Points that were measured again with the new settings.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub checked: Vec<CalibrationPoint>,
    #[serde(skip)]
    settings: Settings,
    #[serde(skip)]
    kind: Channel,
}

/// When, and for how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validity {
    /// Day of the calibration, since 1970-01-01.
    pub date_days: f32,
    /// Days for which it is valid; 0 for ever.
    pub valid_days: f32,
}

impl CalibrationRecord {
    /// The record of a solved calibration on a board with the settings `old`.
    ///
    /// # Errors
    /// The new settings are not allowed on a board.
    pub fn new(
        channel: Channel,
        taken_from: String,
        points: Vec<CalibrationPoint>,
        solved: Solved,
        old: &Settings,
        validity: Validity,
    ) -> Result<Self, Failure> {
        let mut remarks = solved.remarks;
        let values: Vec<(&str, f32)> =
            solved.estimates.iter().filter_map(|estimate| Some((estimate.key?, estimate.value as f32))).collect();
        let mut settings = with_values(old, &values);
        note(channel, &mut settings, validity, solved.residual_rms);
        remarks.extend(tighten(&mut settings));
        check(&settings).map_err(|invalid| {
            let what = format!("the board would refuse the new settings of {channel}: {invalid}");
            Failure::Input(format!("{what}\n  change that setting first (`damprig settings set`)"))
        })?;
        for outlier in &solved.outliers {
            let (unit, factor) = channel.shown_reading();
            remarks.push(format!(
                "outlier: point {} ({}) lies {:+.4} {unit} off what the others give: repeat it, or check what was typed",
                outlier.point + 1,
                channel.shown(points[outlier.point].reference),
                outlier.off * factor
            ));
        }
        let (distance, verdict) = verdict(&solved.change);
        Ok(Self {
            channel: channel.name(),
            taken_from,
            damprig: crate::VERSION_LINE,
            date: date_text(validity.date_days),
            valid_days: validity.valid_days,
            before: date_text(channel.period(old).date_days),
            gain_over_old: solved.change.value,
            distance,
            verdict,
            residual: solved.residual_rms,
            residuals: solved.residuals,
            outliers: solved.outliers.iter().map(|o| o.point).collect(),
            remarks,
            changes: changes(old, &settings),
            estimates: solved.estimates,
            points,
            checked: Vec::new(),
            settings,
            kind: channel,
        })
    }

    /// The new settings of the board.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The channel.
    #[must_use]
    pub fn kind(&self) -> Channel {
        self.kind
    }

    /// A settings file with the channel's settings, and the calibration as a comment.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut head =
            format!("Calibration of {} ({}) on {}, {}\n", self.channel, self.kind.about(), self.date, self.damprig);
        let _ = writeln!(head, "from {}; `damprig settings import` reads this file", self.taken_from);
        for estimate in &self.estimates {
            let _ = writeln!(
                head,
                "{} = {:.7e} {}, standard uncertainty {:.2e}, {}",
                estimate.quantity, estimate.value, estimate.unit, estimate.standard_uncertainty, estimate.method
            );
        }
        let _ = writeln!(head, "{}", self.verdict);
        for remark in &self.remarks {
            let _ = writeln!(head, "{remark}");
        }
        let _ = write!(head, "Points:\n{}", to_csv(self.kind, &self.points));
        let own = format!("calibrated.{}", self.channel.replace('-', "_"));
        let keys: Vec<&str> = self.estimates.iter().filter_map(|e| e.key).collect();
        let is_meant = |(place, _): &SettingEntry| {
            let path = place.join(".");
            path.starts_with(&format!("{own}."))
                || keys.contains(&path.as_str())
                || self.changes.iter().any(|c| c.setting == path)
        };
        let list: Vec<SettingEntry> = entries(&self.settings).into_iter().filter(is_meant).collect();
        toml_of(&list, head.trim_end())
    }
}

/// Writes date, validity and residual into the channel's record.
fn note(channel: Channel, settings: &mut Settings, Validity { date_days, valid_days }: Validity, residual: f64) {
    use damprig_core::settings::{ForceRecord, ImpulseRecord, LengthRecord};
    let residual = residual as f32;
    let length = LengthRecord { date_days, valid_days, residual_m: residual };
    let force = ForceRecord { date_days, valid_days, residual_n: residual };
    let calibrated = &mut settings.calibrated;
    match channel {
        Channel::X => calibrated.x = length,
        Channel::Z => calibrated.z = length,
        Channel::Match => calibrated.r#match = length,
        Channel::Drive => calibrated.drive = length,
        Channel::Spring => calibrated.spring = force,
        Channel::FrictionSpring => calibrated.friction_spring = force,
        Channel::Walls => calibrated.walls = ImpulseRecord { date_days, valid_days, residual_n_s: residual },
    }
}

/// Lowers limits that would lie outside the new usable span of their sensor; says which.
fn tighten(settings: &mut Settings) -> Vec<String> {
    use damprig_core::io::WALL_USABLE;
    let c = settings.calibration;
    let walls = WALL_USABLE.map(|counts| c.walls.to_force_n(f32::from(counts)));
    let mut told = Vec::new();
    for (name, limit, most) in [
        ("safety.limits.structure_m", &mut settings.safety.limits.structure_m, c.x.usable_m().amplitude()),
        ("safety.limits.base_m", &mut settings.safety.limits.base_m, c.z.usable_m().amplitude()),
        ("safety.wall_force_n", &mut settings.safety.wall_force_n, walls.high),
        ("impacts.clip_n", &mut settings.impacts.clip_n, walls.high),
        ("impacts.offset_limit_n", &mut settings.impacts.offset_limit_n, walls.amplitude()),
        ("spring.largest_force_n", &mut settings.spring.largest_force_n, c.usable_spring_n().high),
    ] {
        if *limit >= most && most > 0.0 {
            let lower = rounded_down(INSIDE * f64::from(most)) as f32;
            told.push(format!(
                "{name} is lowered from {} to {}: the usable span of the sensor ends at {}",
                decimal(*limit),
                decimal(lower),
                decimal(most)
            ));
            *limit = lower;
        }
    }
    told
}

/// Down to three significant digits.
fn rounded_down(value: f64) -> f64 {
    let step = 10f64.powf(value.log10().floor() - 2.0);
    // The nearest decimal of three digits.
    format!("{:.2e}", (value / step).floor() * step).parse().unwrap_or(value)
}

/// The settings that differ, without the dates.
fn changes(old: &Settings, new: &Settings) -> Vec<Change> {
    let pairs = entries(old).into_iter().zip(entries(new));
    let differ =
        pairs.filter(|((place, before), (_, after))| place[0] != "calibrated" && before.to_bits() != after.to_bits());
    differ.map(|((place, before), (_, after))| Change { setting: place.join("."), before, after }).collect()
}

/// How far the new gain is from the old one, in standard uncertainties and in words.
fn verdict(change: &crate::identify::statistics::Value) -> (Option<f64>, String) {
    let percent = 100.0 * (change.value - 1.0);
    if change.standard_uncertainty <= 0.0 {
        return (
            None,
            format!("the new gain is {percent:+.4} % from the old one; the values have no scatter, so no uncertainty"),
        );
    }
    let distance = (change.value - 1.0).abs() / change.standard_uncertainty;
    let words = if distance > DIFFERS { "they differ, use the new one" } else { "they agree, the old one still holds" };
    (
        Some(distance),
        format!("the new gain is {percent:+.4} % from the old one, {distance:.1} standard uncertainties: {words}"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::solve::solve;
    use crate::input::Source;
    use crate::settings::from_toml;

    /// Seven points of an x sensor with this slope, with a scatter of a few µm.
    fn points(slope: f64, zero: f64) -> Vec<CalibrationPoint> {
        let scatter = [3e-6, -2e-6, 1e-6, -4e-6, 2e-6, 1e-6, -1e-6];
        let at = |n: i32| f64::from(n) * 0.02;
        (-3..=3).zip(scatter).map(|(n, e)| CalibrationPoint::new(at(n), zero + slope * at(n) + e)).collect()
    }

    fn record(slope: f64, zero: f64) -> CalibrationRecord {
        let (old, points) = (Settings::default(), points(slope, zero));
        let solved = solve(Channel::X, &points, &old, false).unwrap();
        let validity = Validity { date_days: 20_574.0, valid_days: 365.0 };
        CalibrationRecord::new(Channel::X, "test".into(), points, solved, &old, validity).unwrap()
    }

    #[test]
    fn the_file_imports_as_the_new_settings() {
        let record = record(1.01, 0.0);
        let read = from_toml(&Source::new("x.toml", record.to_toml()), &Settings::default()).unwrap();
        assert_eq!(&read, record.settings());
        assert_eq!(read.calibrated.x.date_days, 20_574.0);
        assert!(record.to_toml().contains("date_days = 20574.0   # 2026-05-01"), "{}", record.to_toml());
    }

    #[test]
    fn a_limit_outside_the_new_span_is_lowered_and_told() {
        let record = record(1.0, 0.002);
        let limit = record.settings().safety.limits.structure_m;
        // 78.4 mm less 2 mm less half a percent.
        assert!(limit < 0.0764 && limit > 0.0755, "{limit}");
        assert!(record.remarks.iter().any(|r| r.contains("safety.limits.structure_m is lowered from 0.078")));
        assert_eq!(record.changes.len(), 3, "{:?}", record.changes);
    }

    #[test]
    fn the_verdict_counts_standard_uncertainties() {
        let changed = record(1.01, 0.0);
        assert!(changed.distance.unwrap() > 100.0 && changed.verdict.contains("they differ"), "{}", changed.verdict);
        let same = record(1.000_01, 0.0);
        assert!(same.distance.unwrap() < 2.0 && same.verdict.contains("they agree"), "{}", same.verdict);
    }
}
