//! A fault in words: what became of the drive, the cause, and the value and the limit with their unit.

use damprig_core::control::fault::{FaultCause, SpringFaultCause as Spring};
use damprig_core::io::Sensor;

/// What a fault did to a drive that was on.
#[must_use]
pub fn drive_text(cause: FaultCause) -> &'static str {
    if cause.cuts_at_once() { "the drive was cut at once" } else { "the drive was faded out" }
}

/// The cause, with the value and the limit if it has them.
#[must_use]
pub fn cause_text(cause: FaultCause, value: f32, limit: f32) -> String {
    let Some((unit, factor)) = unit(cause).filter(|_| value.is_finite() && (value != 0.0 || limit != 0.0)) else {
        return cause.text().into();
    };
    let shown = |value: f32| three_digits(f64::from(value) * factor);
    format!("{} ({} {unit}, limit {} {unit})", cause.text(), shown(value), shown(limit))
}

/// A number with three significant digits.
fn three_digits(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let step = 10f64.powi(2 - value.abs().log10().floor() as i32);
    (value * step).round() / step
}

/// The unit in which value and limit of a cause are shown, and how many of it are one of the cause's own.
fn unit(cause: FaultCause) -> Option<(&'static str, f64)> {
    match cause {
        FaultCause::EmergencyStop | FaultCause::SensorInvalid(_) => None,
        FaultCause::SensorAtRail(Sensor::X | Sensor::Z)
        | FaultCause::BaseDisplacement
        | FaultCause::StructureDisplacement
        | FaultCause::StructureForeseen
        | FaultCause::RestTimeout
        | FaultCause::BaseRunaway
        | FaultCause::BaseStill
        | FaultCause::BaseOverdriven
        | FaultCause::ReleaseTimeout
        | FaultCause::BaseForeseen
        | FaultCause::Spring(Spring::SwitchNotFound | Spring::SwitchStuck | Spring::LimitReached | Spring::NoTouch) => {
            Some(("mm", 1e3))
        }
        FaultCause::SensorAtRail(_)
        | FaultCause::SensorDrifted(_)
        | FaultCause::WallForce
        | FaultCause::Spring(
            Spring::ForceDoesNotFollow
            | Spring::ForceAboveLargest
            | Spring::SensorLost
            | Spring::WrongDirection
            | Spring::WrongSign,
        ) => Some(("N", 1.0)),
        FaultCause::Spring(Spring::SpringImplausible) => Some(("N/m", 1.0)),
        FaultCause::SensorFrozen(_) | FaultCause::DriveSaturated | FaultCause::HostSilent => Some(("s", 1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_has_units_and_leads_with_the_drive() {
        let told = |cause, value, limit| format!("{}: {}", drive_text(cause), cause_text(cause, value, limit));
        assert_eq!(
            told(FaultCause::BaseDisplacement, 0.0123, 0.01),
            "the drive was cut at once: the base reached its displacement limit (12.3 mm, limit 10 mm)"
        );
        assert_eq!(
            told(FaultCause::WallForce, 512.3, 450.0),
            "the drive was faded out: the force on a wall reached its limit (512 N, limit 450 N)"
        );
        assert_eq!(
            told(FaultCause::HostSilent, 1.001, 1.0),
            "the drive was faded out: nothing was heard of the host for too long (1 s, limit 1 s)"
        );
        assert_eq!(
            told(FaultCause::EmergencyStop, 0.0, 0.0),
            "the drive was cut at once: the emergency stop is pressed"
        );
        let rail = FaultCause::SensorAtRail(Sensor::WallLow);
        assert!(told(rail, f32::NAN, 500.0).ends_with("check its cable, supply and distance"));
    }
}
