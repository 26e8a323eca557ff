//! Targets of the friction damper's spring: checks one, approaches it along the line of the touch-off, and holds it by the
//! measured force.

use super::config::nearest;
use super::messages::{SpringEvent, SpringInputs, Target, ZeroReading};
use super::{FrictionSpring, Mean, SpringState};
use crate::control::fault::SpringFaultCause;
use crate::io::{Invalid, not_negative, require};

/// A target that is being approached or held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Press {
    pub(super) zero: ZeroReading,
    pub(super) target: Target,
    pub(super) phase: PressPhase,
    pub(super) target_force_n: f32,
    /// The target has been reached once.
    pub(super) on_target: bool,
    pub(super) braking: bool,
    pub(super) saturated: bool,
    /// A friction ratio is waiting for a measured Z.
    pub(super) without_z: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PressPhase {
    /// Moving to a position, steps.
    Move(i32),
    /// Ticks left until the force has settled.
    Settle(u32),
    Average(Mean),
}

impl FrictionSpring {
    /// Whether the controller would press with this target after a touch-off with this result.
    ///
    /// # Errors
    /// The target is out of range.
    pub fn allows(&self, zero: &ZeroReading, target: Target) -> Result<(), Invalid> {
        self.check(zero, target).map(|_| ())
    }

    /// Rejects a target out of range. Returns the position to start from, steps.
    pub(super) fn check(&self, zero: &ZeroReading, target: Target) -> Result<i32, Invalid> {
        let (name, value, deflection_m) = match target {
            Target::Deflection { deflection_m } => ("deflection_m", deflection_m, deflection_m),
            Target::Force { force_n } => ("force_n", force_n, force_n / zero.stiffness_n_per_m),
            // Its force is limited once Z is known.
            Target::FrictionRatio { ratio } => ("friction_ratio", ratio, 0.0),
        };
        let value = f64::from(value);
        not_negative(name, value)?;
        let force_n = deflection_m * zero.stiffness_n_per_m;
        let allowed = "small enough for 0.9 of spring.largest_force_n";
        require(force_n <= self.config.working_force_n(), name, value, allowed)?;
        let end_m = zero.zero_m + deflection_m;
        require(end_m <= self.config.travel_m, name, value, "small enough to stay within spring.travel_m")?;
        match target {
            // The first averaged force determines the distance.
            Target::FrictionRatio { .. } => Ok(self.ramp.steps().max(self.config.steps(zero.zero_m))),
            _ => Ok(self.config.steps(end_m)),
        }
    }

    pub(super) fn begin(&mut self, zero: ZeroReading, target: Target, position: i32, braking: bool) {
        let target_force_n = match target {
            Target::Force { force_n } => force_n,
            Target::Deflection { deflection_m } => deflection_m * zero.stiffness_n_per_m,
            Target::FrictionRatio { .. } => 0.0,
        };
        self.state = SpringState::Press(Press {
            zero,
            target,
            phase: PressPhase::Move(position),
            target_force_n,
            on_target: false,
            braking,
            saturated: false,
            without_z: false,
        });
    }

    pub(super) fn hold(&mut self, mut press: Press, inputs: &SpringInputs, force_n: f32) -> (i8, Option<SpringEvent>) {
        let mut steps = 0;
        match &mut press.phase {
            PressPhase::Move(position) => {
                steps = self.go(*position, self.scaled.fast);
                if self.ramp.is_at(*position) {
                    press.phase = PressPhase::Settle(self.scaled.settle);
                }
            }
            PressPhase::Settle(left) if *left > 1 => *left -= 1,
            PressPhase::Settle(_) => press.phase = PressPhase::Average(Mean::default()),
            PressPhase::Average(mean) => {
                if let Some(force_n) = mean.push(force_n, self.scaled.average) {
                    return (0, self.judge(press, force_n, inputs.base_amplitude_m));
                }
            }
        }
        self.state = SpringState::Press(press);
        (steps, None)
    }

    /// Compares a settled force with the spring's line and with the target, and corrects the position.
    fn judge(&mut self, mut press: Press, force_n: f32, base_amplitude_m: Option<f32>) -> Option<SpringEvent> {
        self.force_n = force_n;
        press.phase = PressPhase::Average(Mean::default());
        press.without_z = false;
        let zero = press.zero;
        let deflection_m = self.position_now_m() - zero.zero_m;
        let expected_n = (zero.stiffness_n_per_m * deflection_m).max(0.0);
        let tolerance_n = self.config.follow_tolerance_n;
        if libm::fabsf(force_n - expected_n) > tolerance_n {
            return Some(self.trip(SpringFaultCause::ForceDoesNotFollow, force_n - expected_n, tolerance_n));
        }
        let demanded_n = match press.target {
            Target::Deflection { .. } => None,
            Target::Force { force_n } => Some(force_n),
            Target::FrictionRatio { ratio } => {
                // Without a measured Z the force stays unchanged.
                let Some(z_m) = base_amplitude_m.filter(|z| z.is_finite() && *z >= 0.0) else {
                    press.without_z = true;
                    self.state = SpringState::Press(press);
                    return None;
                };
                Some(self.config.force_of_ratio_n(ratio, z_m))
            }
        };
        if let Some(demanded_n) = demanded_n {
            let end_n = zero.stiffness_n_per_m * (self.config.travel_m - zero.zero_m);
            let most_n = self.config.working_force_n().min(end_n);
            press.saturated = demanded_n > most_n;
            press.target_force_n = demanded_n.min(most_n);
            let error_n = press.target_force_n - force_n;
            // Without contact, moving further away does not lower the force.
            let out_of_contact = deflection_m <= 0.0 && error_n <= 0.0;
            if libm::fabsf(error_n) > self.config.dead_band_n && !out_of_contact {
                let position = self.ramp.steps() + nearest(error_n / zero.stiffness_n_per_m / self.config.step_m);
                if position > self.scaled.travel {
                    let end_m = self.position_m(position);
                    return Some(self.trip(SpringFaultCause::LimitReached, end_m, self.config.travel_m));
                }
                press.phase = PressPhase::Move(position.max(self.scaled.back_off));
                self.state = SpringState::Press(press);
                return None;
            }
        }
        let met_before = core::mem::replace(&mut press.on_target, true);
        self.state = SpringState::Press(press);
        (!met_before).then_some(SpringEvent::OnTarget { force_n })
    }
}
