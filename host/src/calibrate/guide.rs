//! Leads a person through the points of a calibration at rest, and refuses a reading that is not one with what to do about it.
//! `moving` has the channels that move.

use damprig_core::control::friction_spring::SpringStage;
use damprig_core::measure::point::PointResult;
use damprig_core::settings::Settings;

use super::Channel;
use super::fit;
use super::moving::{blows, drive, dwell_s, matched, spring};
use super::readings::{CalibrationPoint, KeptFile};
use super::rig::{CalibratedRig, RestReading};
use crate::failure::Failure;

/// Share of the usable span that a target at rest may drift during a reading.
const MAX_DRIFT: f64 = 1e-4;

/// Share of the usable span by which the values of a target at rest may scatter (RMS).
const MAX_SCATTER: f64 = 1e-3;

/// Readings refused at one point before a calibration ends.
const MAX_REFUSED: u32 = 10;

/// What a person is asked to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ask<'a> {
    /// Bring the target or the weights of a channel to this reference, in its SI unit.
    Reference {
        /// The channel.
        channel: Channel,
        /// The reference.
        reference: f64,
        /// The point's number and how many there are.
        place: (usize, usize),
    },
    /// Hit a wall once: −1 or +1.
    Blow {
        /// The wall.
        side: i8,
        /// The blow's number and how many there are.
        place: (usize, usize),
    },
    /// Type the impulse of the blow that was measured.
    Impulse {
        /// What the rig measured, N·s.
        measured_n_s: f64,
    },
    /// Make something ready.
    Ready(&'a str),
}

/// What is asked, in words.
#[must_use]
pub fn question(ask: &Ask<'_>) -> String {
    match ask {
        Ask::Reference { channel: Channel::Spring, reference, place: (n, of) } => {
            format!("[{n}/{of}] Hang {reference:.3} N on the force sensor of the spring")
        }
        Ask::Reference { channel, reference, place: (n, of) } => {
            format!("[{n}/{of}] Put the target of {channel} at {}", channel.shown(*reference))
        }
        Ask::Blow { side, place: (n, of) } => {
            let wall = if *side > 0 { "+d" } else { "−d" };
            format!("[{n}/{of}] Hit the wall at {wall} once with the hammer")
        }
        Ask::Impulse { measured_n_s } => format!("measured {measured_n_s:.5} N·s. Impulse by the hammer, N·s"),
        Ask::Ready(what) => (*what).to_string(),
    }
}

/// What a person answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GuideReply {
    /// It is done.
    Done,
    /// It is done, at this value in the channel's SI unit.
    At(f64),
    /// The last point was wrong: measure it again.
    Repeat,
    /// Leave this point out.
    Skip,
    /// There are no more points.
    End,
}

/// A person, or a simulated one.
pub trait Operator {
    /// Asks for something and waits for it; the rig's link is kept alive meanwhile.
    ///
    /// # Errors
    /// Ctrl-C, no more answers, or a broken link.
    fn ask(&mut self, rig: &mut CalibratedRig<'_>, ask: &Ask<'_>) -> Result<GuideReply, Failure>;

    /// Tells something.
    fn tell(&mut self, line: &str);
}

/// What to measure.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationPlan {
    /// The channel.
    pub channel: Channel,
    /// The references of a channel at rest, or deflections of the spring, SI; empty for the defaults.
    pub references: Vec<f64>,
    /// Time of a reading, of a sine's dwell, or of half a step, s.
    pub measure_s: f64,
    /// Blows on each wall.
    pub blows: usize,
    /// Largest base amplitude of `match` and `drive`, m.
    pub amplitude_m: f64,
    /// Frequencies of `match` and `drive`, Hz; empty for the defaults.
    pub frequencies_hz: Vec<f64>,
}

/// Measures the points of a plan and keeps each of them.
///
/// # Errors
/// Ctrl-C, a rig that fails; the points so far are kept.
pub fn measure(
    plan: &CalibrationPlan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &KeptFile,
) -> Result<Vec<CalibrationPoint>, Failure> {
    match plan.channel {
        Channel::X | Channel::Z | Channel::Spring => at_rest(plan, rig, operator, kept),
        Channel::Match => matched(plan, rig, operator, kept),
        Channel::Walls => blows(plan, rig, operator, &mut |points| kept.write(points)),
        Channel::Drive => drive(plan, rig, operator, kept),
        Channel::FrictionSpring => spring(plan, rig, operator, kept),
    }
}

fn at_rest(
    plan: &CalibrationPlan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &KeptFile,
) -> Result<Vec<CalibrationPoint>, Failure> {
    let settings = rig.session.settings;
    if plan.channel == Channel::Spring && rig.spring_stage()? != SpringStage::Unhomed {
        return Err(Failure::Input(
            "the friction damper's spring was homed: its reading has the force without contact subtracted\n  switch the board off \
             and on, then calibrate".into(),
        ));
    }
    let mut points: Vec<CalibrationPoint> = Vec::new();
    let mut places: Vec<usize> = Vec::new();
    let mut at = 0;
    while at < plan.references.len() {
        match one(plan, plan.references[at], (at + 1, plan.references.len()), rig, operator, &settings)? {
            TakenPoint::Point(point) => {
                points.push(point);
                places.push(at);
                kept.write(&points)?;
                at += 1;
            }
            TakenPoint::Repeat => match (points.pop(), places.pop()) {
                (Some(_), Some(before)) => {
                    kept.write(&points)?;
                    at = before;
                }
                _ => operator.tell("there is no earlier point to repeat"),
            },
            TakenPoint::Skipped => at += 1,
            TakenPoint::End => break,
        }
    }
    repeat_outliers(plan, &mut points, rig, operator, &settings)?;
    kept.write(&points)?;
    Ok(points)
}

/// What came of asking for a point.
enum TakenPoint {
    Point(CalibrationPoint),
    Repeat,
    Skipped,
    End,
}

/// Asks for a reference and measures it, again and again until the reading is one.
fn one(
    plan: &CalibrationPlan,
    wanted: f64,
    place: (usize, usize),
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    settings: &Settings,
) -> Result<TakenPoint, Failure> {
    let channel = plan.channel;
    let mut refused = 0;
    while refused < MAX_REFUSED {
        let ask = Ask::Reference { channel, reference: wanted, place };
        let reference = match operator.ask(rig, &ask)? {
            GuideReply::Done => wanted,
            GuideReply::At(value) => value,
            GuideReply::Repeat => return Ok(TakenPoint::Repeat),
            GuideReply::Skip => return Ok(TakenPoint::Skipped),
            GuideReply::End => return Ok(TakenPoint::End),
        };
        if let Err(why) = allowed(channel, reference, settings) {
            operator.tell(&why);
            continue;
        }
        let [reading] = rig.read([channel.signal().unwrap_or_default()], plan.measure_s)?;
        match problem(channel, &reading, settings) {
            None => {
                let RestReading { mean, scatter, drift } = reading;
                let (unit, factor) = channel.shown_reading();
                operator.tell(&format!(
                    "  reads {:+.4} {unit}, scatter {:.4} {unit}, drift {:+.4} {unit}",
                    mean * factor,
                    scatter * factor,
                    drift * factor
                ));
                return Ok(TakenPoint::Point(CalibrationPoint {
                    scatter,
                    drift,
                    ..CalibrationPoint::new(reference, mean)
                }));
            }
            Some(why) => operator.tell(&why),
        }
        refused += 1;
    }
    Err(Failure::Failed(format!("none of {MAX_REFUSED} readings in a row could be used; the points so far are kept")))
}

/// Checks a reference of a channel at rest against the usable span of its sensor.
///
/// # Errors
/// What is allowed, and the likely unit.
pub fn allowed(channel: Channel, reference: f64, settings: &Settings) -> Result<(), String> {
    let Some([low, high]) = channel.usable(settings) else { return Ok(()) };
    if (low..=high).contains(&reference) {
        return Ok(());
    }
    let (unit, factor) = channel.shown_reference();
    let in_unit = reference / factor;
    let help = if factor > 1.0 && (low..=high).contains(&in_unit) {
        format!("; without a unit it is in metres: write {reference}{unit}")
    } else {
        String::new()
    };
    Err(format!(
        "{} is not allowed: the usable span of {channel} is {} to {}{help}",
        channel.shown(reference),
        channel.shown(low),
        channel.shown(high)
    ))
}

/// Why a reading at rest is none, and what to do.
fn problem(channel: Channel, reading: &RestReading, settings: &Settings) -> Option<String> {
    let [low, high] = channel.usable(settings)?;
    let (unit, factor) = channel.shown_reading();
    let shown = |value: f64| format!("{:.4} {unit}", value * factor);
    let span = high - low;
    let RestReading { mean, scatter, drift } = *reading;
    if !mean.is_finite() || mean <= low || mean >= high {
        return Some(format!(
            "{channel} reads {}, the end of its span: is the target in the range of the sensor, the cable plugged in and the sensor \
             supplied? Put it right and press Enter",
            shown(mean)
        ));
    }
    // What drifts by no more than its noise explains does not move.
    let drift_limit = MAX_DRIFT * span;
    if drift.abs() > drift_limit || scatter > MAX_SCATTER * span {
        return Some(format!(
            "the target still moves: the reading drifted by {} and scatters by {} (allowed: {} and {}). Let it come to rest, clamp \
             it, then press Enter",
            shown(drift),
            shown(scatter),
            shown(drift_limit),
            shown(MAX_SCATTER * span)
        ));
    }
    None
}

/// Offers to repeat each point that does not belong to the others, once.
fn repeat_outliers(
    plan: &CalibrationPlan,
    points: &mut [CalibrationPoint],
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    settings: &Settings,
) -> Result<(), Failure> {
    let Some(line) = fit::straight(points) else { return Ok(()) };
    let (unit, factor) = plan.channel.shown_reading();
    for outlier in line.outliers {
        let reference = points[outlier.point].reference;
        operator.tell(&format!(
            "point {} ({}) lies {:+.4} {unit} off what the others give: measure it again (s leaves it as it is)",
            outlier.point + 1,
            plan.channel.shown(reference),
            outlier.off * factor
        ));
        let place = (outlier.point + 1, points.len());
        if let TakenPoint::Point(point) = one(plan, reference, place, rig, operator, settings)? {
            points[outlier.point] = point;
        }
    }
    Ok(())
}

/// Measures again after the new settings are in use: a point at rest, a blow on each wall, a sine. Empty if the operator leaves
/// it out, and for the stiffness of the spring.
///
/// # Errors
/// As [`measure`].
pub fn check(
    plan: &CalibrationPlan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
) -> Result<Vec<CalibrationPoint>, Failure> {
    let settings = rig.session.settings;
    match plan.channel {
        Channel::X | Channel::Z | Channel::Spring => {
            // Not in the middle, where a wrong gain does not show.
            let reference = plan.references.iter().copied().max_by(f64::total_cmp).unwrap_or_default();
            match one(plan, reference, (1, 1), rig, operator, &settings)? {
                TakenPoint::Point(point) => Ok(vec![point]),
                _ => Ok(Vec::new()),
            }
        }
        Channel::Walls => blows(&CalibrationPlan { blows: 1, ..plan.clone() }, rig, operator, &mut |_| Ok(())),
        Channel::Match | Channel::Drive => {
            let frequency = plan.frequencies_hz.first().copied().unwrap_or(2.0);
            let point = |result: &PointResult| {
                let reference =
                    if plan.channel == Channel::Match { result.x_amplitude_m } else { result.drive_amplitude_m };
                let point = CalibrationPoint::new(f64::from(reference), f64::from(result.z_amplitude_m));
                CalibrationPoint { frequency_hz: f64::from(result.frequency_hz), ..point }
            };
            let results = rig.sines(plan.amplitude_m, &[frequency], dwell_s(plan, &[frequency]))?;
            Ok(results.iter().map(point).collect())
        }
        Channel::FrictionSpring => Ok(Vec::new()),
    }
}

/// Asks for something to be made ready.
pub(super) fn ready(rig: &mut CalibratedRig<'_>, operator: &mut dyn Operator, what: &str) -> Result<(), Failure> {
    match operator.ask(rig, &Ask::Ready(what))? {
        GuideReply::Skip | GuideReply::End => Err(Failure::stopped()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_in_millimetres_without_a_unit_is_refused_with_what_to_write() {
        let told = allowed(Channel::X, 20.0, &Settings::default()).unwrap_err();
        assert!(told.contains("write 20mm") && told.contains("-78.4"), "{told}");
        assert_eq!(allowed(Channel::X, 0.02, &Settings::default()), Ok(()));
        let told = allowed(Channel::Spring, 60.0, &Settings::default()).unwrap_err();
        assert!(told.contains("60.0000 N is not allowed"), "{told}");
    }

    #[test]
    fn a_moving_target_and_a_rail_are_no_readings() {
        let told =
            |mean, scatter, drift| problem(Channel::X, &RestReading { mean, scatter, drift }, &Settings::default());
        assert_eq!(told(0.01, 5e-6, 1e-6), None);
        assert!(told(0.01, 5e-6, 1e-3).unwrap().contains("still moves"));
        assert!(told(0.01, 1e-3, 0.0).unwrap().contains("still moves"));
        assert!(told(-0.079, 1e-6, 0.0).unwrap().contains("the end of its span"));
        assert!(told(f64::NAN, 1e-6, 0.0).unwrap().contains("cable"));
    }
}
