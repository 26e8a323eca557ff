//! Leads a person through the points of a calibration, and refuses a reading that is not one with what to do about it.

use damprig_core::control::friction_spring::{SpringCommand, SpringEvent, SpringStage, Target};
use damprig_core::io::DriveScale;
use damprig_core::measure::point::PointResult;
use damprig_core::settings::Settings;

use super::fit;
use super::readings::{Kept, Point};
use super::rig::{CalibratedRig, Reading};
use super::{CannotCalibrate, Channel};

/// Share of the usable span that a target at rest may drift during a reading.
const MOST_DRIFT: f64 = 1e-4;

/// Share of the usable span by which the values of a target at rest may scatter (RMS).
const MOST_SCATTER: f64 = 1e-3;

/// Readings refused at one point before a calibration ends.
const MOST_REFUSED: u32 = 10;

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
pub enum Answer {
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
    fn ask(&mut self, rig: &mut CalibratedRig<'_>, ask: &Ask<'_>) -> Result<Answer, CannotCalibrate>;

    /// Tells something.
    fn tell(&mut self, line: &str);
}

/// What to measure.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
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
    plan: &Plan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &Kept,
) -> Result<Vec<Point>, CannotCalibrate> {
    match plan.channel {
        Channel::X | Channel::Z | Channel::Spring => at_rest(plan, rig, operator, kept),
        Channel::Match => matched(plan, rig, operator, kept),
        Channel::Walls => blows(plan, rig, operator, &mut |points| kept.write(points)),
        Channel::Drive => drive(plan, rig, operator, kept),
        Channel::FrictionSpring => spring(plan, rig, operator, kept),
    }
}

fn at_rest(
    plan: &Plan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &Kept,
) -> Result<Vec<Point>, CannotCalibrate> {
    let settings = rig.session.settings;
    if plan.channel == Channel::Spring && rig.spring_stage()? != SpringStage::Unhomed {
        return Err(CannotCalibrate::values(
            "the friction damper's spring was homed: its reading has the force without contact subtracted\n  switch the board off \
             and on, then calibrate",
        ));
    }
    let mut points: Vec<Point> = Vec::new();
    let mut places: Vec<usize> = Vec::new();
    let mut at = 0;
    while at < plan.references.len() {
        match one(plan, plan.references[at], (at + 1, plan.references.len()), rig, operator, &settings)? {
            Taken::Point(point) => {
                points.push(point);
                places.push(at);
                kept.write(&points)?;
                at += 1;
            }
            Taken::Repeat => match (points.pop(), places.pop()) {
                (Some(_), Some(before)) => {
                    kept.write(&points)?;
                    at = before;
                }
                _ => operator.tell("there is no earlier point to repeat"),
            },
            Taken::Skipped => at += 1,
            Taken::End => break,
        }
    }
    repeat_outliers(plan, &mut points, rig, operator, &settings)?;
    kept.write(&points)?;
    Ok(points)
}

/// What came of asking for a point.
enum Taken {
    Point(Point),
    Repeat,
    Skipped,
    End,
}

/// Asks for a reference and measures it, again and again until the reading is one.
fn one(
    plan: &Plan,
    wanted: f64,
    place: (usize, usize),
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    settings: &Settings,
) -> Result<Taken, CannotCalibrate> {
    let channel = plan.channel;
    let mut refused = 0;
    while refused < MOST_REFUSED {
        let ask = Ask::Reference { channel, reference: wanted, place };
        let reference = match operator.ask(rig, &ask)? {
            Answer::Done => wanted,
            Answer::At(value) => value,
            Answer::Repeat => return Ok(Taken::Repeat),
            Answer::Skip => return Ok(Taken::Skipped),
            Answer::End => return Ok(Taken::End),
        };
        if let Err(why) = allowed(channel, reference, settings) {
            operator.tell(&why);
            continue;
        }
        let [reading] = rig.read([channel.signal().unwrap_or_default()], plan.measure_s)?;
        match problem(channel, &reading, settings) {
            None => {
                let Reading { mean, scatter, drift } = reading;
                let (unit, factor) = channel.shown_reading();
                operator.tell(&format!(
                    "  reads {:+.4} {unit}, scatter {:.4} {unit}, drift {:+.4} {unit}",
                    mean * factor,
                    scatter * factor,
                    drift * factor
                ));
                return Ok(Taken::Point(Point { scatter, drift, ..Point::new(reference, mean) }));
            }
            Some(why) => operator.tell(&why),
        }
        refused += 1;
    }
    Err(CannotCalibrate::Failed(format!("{MOST_REFUSED} readings in a row were none; the points so far are kept")))
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
fn problem(channel: Channel, reading: &Reading, settings: &Settings) -> Option<String> {
    let [low, high] = channel.usable(settings)?;
    let (unit, factor) = channel.shown_reading();
    let shown = |value: f64| format!("{:.4} {unit}", value * factor);
    let span = high - low;
    let Reading { mean, scatter, drift } = *reading;
    if !mean.is_finite() || mean <= low || mean >= high {
        return Some(format!(
            "{channel} reads {}, the end of its span: is the target in the range of the sensor, the cable plugged in and the sensor \
             supplied? Put it right and press Enter",
            shown(mean)
        ));
    }
    // What drifts by no more than its noise explains does not move.
    let drift_limit = MOST_DRIFT * span;
    if drift.abs() > drift_limit || scatter > MOST_SCATTER * span {
        return Some(format!(
            "the target still moves: the reading drifted by {} and scatters by {} (allowed: {} and {}). Let it come to rest, clamp \
             it, then press Enter",
            shown(drift),
            shown(scatter),
            shown(drift_limit),
            shown(MOST_SCATTER * span)
        ));
    }
    None
}

/// Offers to repeat each point that does not belong to the others, once.
fn repeat_outliers(
    plan: &Plan,
    points: &mut [Point],
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    settings: &Settings,
) -> Result<(), CannotCalibrate> {
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
        if let Taken::Point(point) = one(plan, reference, place, rig, operator, settings)? {
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
    plan: &Plan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
) -> Result<Vec<Point>, CannotCalibrate> {
    let settings = rig.session.settings;
    match plan.channel {
        Channel::X | Channel::Z | Channel::Spring => {
            // Not in the middle, where a wrong gain does not show.
            let reference = plan.references.iter().copied().max_by(f64::total_cmp).unwrap_or_default();
            match one(plan, reference, (1, 1), rig, operator, &settings)? {
                Taken::Point(point) => Ok(vec![point]),
                _ => Ok(Vec::new()),
            }
        }
        Channel::Walls => blows(&Plan { blows: 1, ..plan.clone() }, rig, operator, &mut |_| Ok(())),
        Channel::Match | Channel::Drive => {
            let frequency = plan.frequencies_hz.first().copied().unwrap_or(2.0);
            let point = |result: &PointResult| {
                let reference =
                    if plan.channel == Channel::Match { result.x_amplitude_m } else { result.drive_amplitude_m };
                let point = Point::new(f64::from(reference), f64::from(result.z_amplitude_m));
                Point { frequency_hz: f64::from(result.frequency_hz), ..point }
            };
            let results = rig.sines(plan.amplitude_m, &[frequency], dwell_s(plan, &[frequency]))?;
            Ok(results.iter().map(point).collect())
        }
        Channel::FrictionSpring => Ok(Vec::new()),
    }
}

/// Asks for something to be made ready.
fn ready(rig: &mut CalibratedRig<'_>, operator: &mut dyn Operator, what: &str) -> Result<(), CannotCalibrate> {
    match operator.ask(rig, &Ask::Ready(what))? {
        Answer::Skip | Answer::End => Err(CannotCalibrate::Interrupted),
        _ => Ok(()),
    }
}

/// Both displacement sensors on the moving base: three amplitudes at each frequency.
fn matched(
    plan: &Plan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &Kept,
) -> Result<Vec<Point>, CannotCalibrate> {
    ready(
        rig,
        operator,
        "Point the sensors of x and z at one target on the base, beside each other. Nothing else may stand on the base.",
    )?;
    let frequencies = if plan.frequencies_hz.is_empty() { vec![1.0, 2.0, 4.0] } else { plan.frequencies_hz.clone() };
    let mut points = Vec::new();
    for part in [0.25, 0.5, 1.0] {
        for result in rig.sines(part * plan.amplitude_m, &frequencies, dwell_s(plan, &frequencies))? {
            points.push(Point {
                frequency_hz: f64::from(result.frequency_hz),
                lead_rad: -f64::from(result.phase_rad),
                ..Point::new(f64::from(result.x_amplitude_m), f64::from(result.z_amplitude_m))
            });
            kept.write(&points)?;
        }
    }
    Ok(points)
}

/// A dwell has at least six cycles.
fn dwell_s(plan: &Plan, frequencies: &[f64]) -> f64 {
    let lowest = frequencies.iter().copied().fold(f64::INFINITY, f64::min);
    plan.measure_s.max(8.0 / lowest)
}

/// Longest hold of a step, s: nine of them and the moves fill the board's record.
const LONGEST_HOLD_S: f64 = 19.0;

/// Sines of four amplitudes, then steps to either side.
fn drive(
    plan: &Plan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &Kept,
) -> Result<Vec<Point>, CannotCalibrate> {
    ready(rig, operator, "Take the structure off the base. z must be calibrated. The base will move.")?;
    let scale = rig.session.settings.calibration.drive;
    let steps = [0.25, 0.5, 0.75, 1.0, -0.25, -0.5, -0.75, -1.0, 0.0].map(|part| part * plan.amplitude_m);
    // A rest of its own for each step: the scatter of the differences then has the noise of both.
    let mut rests = Vec::new();
    for _ in &steps {
        let [rest] = rig.read(["z"], 0.5 * plan.measure_s)?;
        rests.push(rest.mean);
    }
    let frequencies = if plan.frequencies_hz.is_empty() { vec![2.5] } else { plan.frequencies_hz.clone() };
    let mut points = Vec::new();
    for part in [0.25, 0.5, 0.75, 1.0] {
        let amplitude = part * plan.amplitude_m;
        for result in rig.sines(amplitude, &frequencies, dwell_s(plan, &frequencies))? {
            let point = Point::new(put_amplitude_m(&scale, amplitude), f64::from(result.z_amplitude_m));
            points.push(Point { frequency_hz: f64::from(result.frequency_hz), ..point });
            kept.write(&points)?;
        }
    }
    let held = rig.steps(&steps, (2.0 * plan.measure_s).min(LONGEST_HOLD_S))?;
    for ((demand, z), rest) in held.into_iter().zip(rests) {
        // A base that still creeps shows in its drift.
        let creeps = z.drift.abs() > 0.05 * plan.amplitude_m;
        if creeps {
            operator.tell(&format!(
                "the base still creeps by {:.4} mm at a demand of {:+.4} mm: the zero is uncertain; use a longer --measure-s",
                z.drift * 1e3,
                demand * 1e3
            ));
        }
        points.push(Point { scatter: z.scatter, drift: z.drift, ..Point::new(put_m(&scale, demand), z.mean - rest) });
    }
    kept.write(&points)?;
    Ok(points)
}

/// What the output's whole counts make of a demand, m.
fn put_m(scale: &DriveScale, demand_m: f64) -> f64 {
    let counts = f64::from(scale.to_counts(demand_m as f32));
    (counts - f64::from(scale.zero_counts)) * f64::from(scale.metres_per_count)
}

/// Amplitude at its own frequency of the sine that the output's whole counts make of a sine of this amplitude, m.
fn put_amplitude_m(scale: &DriveScale, amplitude_m: f64) -> f64 {
    const PHASES: usize = 1 << 14;
    let part = |n: usize| {
        let sine = (std::f64::consts::TAU * (n as f64 + 0.5) / PHASES as f64).sin();
        2.0 * put_m(scale, amplitude_m * sine) * sine
    };
    (0..PHASES).map(part).sum::<f64>() / PHASES as f64
}

/// Blows on both walls; `keep` gets the points after each.
fn blows(
    plan: &Plan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    keep: &mut dyn FnMut(&[Point]) -> Result<(), CannotCalibrate>,
) -> Result<Vec<Point>, CannotCalibrate> {
    let mut points: Vec<Point> = Vec::new();
    'walls: for side in [-1i8, 1] {
        let first = points.len();
        while points.len() - first < plan.blows {
            let place = (points.len() - first + 1, plan.blows);
            rig.listen_for_blows()?;
            match operator.ask(rig, &Ask::Blow { side, place })? {
                Answer::Skip => continue 'walls,
                Answer::End => break 'walls,
                Answer::Repeat => {
                    if points.len() > first {
                        points.pop();
                        keep(&points)?;
                    }
                    continue;
                }
                Answer::Done | Answer::At(_) => {}
            }
            let blow = rig.blow()?;
            rig.end_blows()?;
            if blow.side != side {
                operator.tell("the blow came on the other wall: hit the wall that is asked for");
                continue;
            }
            if blow.clipped || blow.held {
                let why = if blow.clipped {
                    "its force reached the end of the sensor's span: hit more softly"
                } else {
                    "the hammer stayed on the wall: let it rebound"
                };
                operator.tell(&format!("the blow does not count: {why}"));
                continue;
            }
            let measured_n_s = f64::from(blow.impulse_n_s);
            match operator.ask(rig, &Ask::Impulse { measured_n_s })? {
                Answer::At(impulse) if impulse > 0.0 => {
                    points.push(Point { side, ..Point::new(impulse, measured_n_s) });
                    keep(&points)?;
                }
                Answer::End => break 'walls,
                Answer::Skip => continue 'walls,
                Answer::Repeat => operator.tell("the blow is left out"),
                _ => operator.tell("the blow is left out: type its impulse, a number greater than 0"),
            }
        }
    }
    Ok(points)
}

/// Deflections of the spring on the structure, up and down.
fn spring(
    plan: &Plan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &Kept,
) -> Result<Vec<Point>, CannotCalibrate> {
    ready(rig, operator, "Mount the structure and let it come to rest. The friction damper will touch it and press.")?;
    let measured = deflections(plan, rig, operator, kept);
    rig.release_spring();
    measured
}

fn deflections(
    plan: &Plan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &Kept,
) -> Result<Vec<Point>, CannotCalibrate> {
    let is_on_target = |event: &SpringEvent| matches!(event, SpringEvent::OnTarget { .. });
    rig.spring(SpringCommand::Home, |event| matches!(event, SpringEvent::Homed))?;
    rig.spring(SpringCommand::TouchOff, is_on_target)?;
    let (status, _) = rig.session.status()?;
    let Some(zero) = status.spring.zero else {
        return Err(CannotCalibrate::Failed("the touch-off gave no zero reading".into()));
    };
    operator.tell(&format!(
        "touched at {:.3} mm ± {:.3} mm, stiffness of the touch-off {:.1} N/m",
        f64::from(zero.zero_m) * 1e3,
        f64::from(zero.zero_error_m) * 1e3,
        zero.stiffness_n_per_m
    ));
    let references = if plan.references.is_empty() {
        let longest = 0.8 * f64::from(rig.session.settings.spring.working_force_n() / zero.stiffness_n_per_m);
        [0.2, 0.4, 0.6, 0.8, 1.0, 0.8, 0.6, 0.4, 0.2].iter().map(|part| part * longest).collect()
    } else {
        plan.references.clone()
    };
    let mut points = Vec::new();
    for deflection in references {
        let target = Target::Deflection { deflection_m: deflection as f32 };
        rig.spring(SpringCommand::Set(target), is_on_target)?;
        let [position, force] = rig.read(["spring_position", "spring_force"], plan.measure_s)?;
        let deflection = position.mean - f64::from(zero.zero_m);
        operator.tell(&format!("  {:.4} mm: {:.4} N", deflection * 1e3, force.mean));
        points.push(Point { scatter: force.scatter, drift: force.drift, ..Point::new(deflection, force.mean) });
        kept.write(&points)?;
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_of_whole_counts_has_the_amplitude_demanded_to_a_part_of_a_count() {
        let scale = DriveScale::default();
        let count_m = f64::from(scale.metres_per_count);
        for amplitude in [5e-5, 1.25e-4, 5e-4, 2e-3] {
            let put = put_amplitude_m(&scale, amplitude);
            // The error of rounding is half a count; its share at the sine's frequency is a small part of it.
            assert!((put - amplitude).abs() < 0.1 * count_m, "{amplitude}: {put}");
        }
        assert!((put_m(&scale, 1e-3) - 1e-3).abs() <= 0.5 * count_m);
    }

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
        let told = |mean, scatter, drift| problem(Channel::X, &Reading { mean, scatter, drift }, &Settings::default());
        assert_eq!(told(0.01, 5e-6, 1e-6), None);
        assert!(told(0.01, 5e-6, 1e-3).unwrap().contains("still moves"));
        assert!(told(0.01, 1e-3, 0.0).unwrap().contains("still moves"));
        assert!(told(-0.079, 1e-6, 0.0).unwrap().contains("the end of its span"));
        assert!(told(f64::NAN, 1e-6, 0.0).unwrap().contains("cable"));
    }
}
