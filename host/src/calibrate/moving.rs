//! The points of channels that move: both sensors on the moving base, the drive, blows on the walls, the friction spring.

use damprig_core::control::friction_spring::{SpringCommand, SpringEvent, Target};
use damprig_core::io::DriveScale;

use super::guide::{Ask, CalibrationPlan, GuideReply, Operator, ready};
use super::readings::{CalibrationPoint, KeptFile};
use super::rig::CalibratedRig;
use crate::failure::Failure;

/// Both displacement sensors on the moving base: three amplitudes at each frequency.
pub(super) fn matched(
    plan: &CalibrationPlan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &KeptFile,
) -> Result<Vec<CalibrationPoint>, Failure> {
    ready(
        rig,
        operator,
        "Point the sensors of x and z at one target on the base, beside each other. Nothing else may stand on the base.",
    )?;
    let frequencies = if plan.frequencies_hz.is_empty() { vec![1.0, 2.0, 4.0] } else { plan.frequencies_hz.clone() };
    let mut points = Vec::new();
    for part in [0.25, 0.5, 1.0] {
        for result in rig.sines(part * plan.amplitude_m, &frequencies, dwell_s(plan, &frequencies))? {
            points.push(CalibrationPoint {
                frequency_hz: f64::from(result.frequency_hz),
                lead_rad: -f64::from(result.phase_rad),
                ..CalibrationPoint::new(f64::from(result.x_amplitude_m), f64::from(result.z_amplitude_m))
            });
            kept.write(&points)?;
        }
    }
    Ok(points)
}

/// A dwell has at least six cycles.
pub(super) fn dwell_s(plan: &CalibrationPlan, frequencies: &[f64]) -> f64 {
    let lowest = frequencies.iter().copied().fold(f64::INFINITY, f64::min);
    plan.measure_s.max(8.0 / lowest)
}

/// Longest hold of a step, s: nine of them and the moves fill the board's record.
const LONGEST_HOLD_S: f64 = 19.0;

/// Sines of four amplitudes, then steps to either side.
pub(super) fn drive(
    plan: &CalibrationPlan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &KeptFile,
) -> Result<Vec<CalibrationPoint>, Failure> {
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
            let point = CalibrationPoint::new(put_amplitude_m(&scale, amplitude), f64::from(result.z_amplitude_m));
            points.push(CalibrationPoint { frequency_hz: f64::from(result.frequency_hz), ..point });
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
        points.push(CalibrationPoint {
            scatter: z.scatter,
            drift: z.drift,
            ..CalibrationPoint::new(put_m(&scale, demand), z.mean - rest)
        });
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
pub(super) fn blows(
    plan: &CalibrationPlan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    keep: &mut dyn FnMut(&[CalibrationPoint]) -> Result<(), Failure>,
) -> Result<Vec<CalibrationPoint>, Failure> {
    let mut points: Vec<CalibrationPoint> = Vec::new();
    'walls: for side in [-1i8, 1] {
        let first = points.len();
        while points.len() - first < plan.blows {
            let place = (points.len() - first + 1, plan.blows);
            rig.listen_for_blows()?;
            match operator.ask(rig, &Ask::Blow { side, place })? {
                GuideReply::Skip => continue 'walls,
                GuideReply::End => break 'walls,
                GuideReply::Repeat => {
                    if points.len() > first {
                        points.pop();
                        keep(&points)?;
                    }
                    continue;
                }
                GuideReply::Done | GuideReply::At(_) => {}
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
                GuideReply::At(impulse) if impulse > 0.0 => {
                    points.push(CalibrationPoint { side, ..CalibrationPoint::new(impulse, measured_n_s) });
                    keep(&points)?;
                }
                GuideReply::End => break 'walls,
                GuideReply::Skip => continue 'walls,
                GuideReply::Repeat => operator.tell("the blow is left out"),
                _ => operator.tell("the blow is left out: type its impulse, a number greater than 0"),
            }
        }
    }
    Ok(points)
}

/// Deflections of the spring on the structure, up and down.
pub(super) fn spring(
    plan: &CalibrationPlan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &KeptFile,
) -> Result<Vec<CalibrationPoint>, Failure> {
    ready(rig, operator, "Mount the structure and let it come to rest. The friction damper will touch it and press.")?;
    let measured = deflections(plan, rig, operator, kept);
    rig.release_spring();
    measured
}

fn deflections(
    plan: &CalibrationPlan,
    rig: &mut CalibratedRig<'_>,
    operator: &mut dyn Operator,
    kept: &KeptFile,
) -> Result<Vec<CalibrationPoint>, Failure> {
    let is_on_target = |event: &SpringEvent| matches!(event, SpringEvent::OnTarget { .. });
    rig.spring(SpringCommand::Home, |event| matches!(event, SpringEvent::Homed))?;
    rig.spring(SpringCommand::TouchOff, is_on_target)?;
    let (status, _) = rig.session.status()?;
    let Some(zero) = status.spring.zero else {
        return Err(Failure::Failed("the touch-off gave no zero reading".into()));
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
        points.push(CalibrationPoint {
            scatter: force.scatter,
            drift: force.drift,
            ..CalibrationPoint::new(deflection, force.mean)
        });
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
}
