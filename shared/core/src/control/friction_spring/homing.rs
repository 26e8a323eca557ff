//! Homing on the limit switch, and moving the block away from the structure.

use super::{FrictionSpring, SpringEvent, State, ZeroReading};
use crate::control::fault::SpringFaultCause;

impl FrictionSpring {
    /// Towards the limit switch.
    pub(super) fn seek_switch(&mut self, at_switch: bool) -> (i8, Option<SpringEvent>) {
        if at_switch {
            self.ramp.declare(0);
            self.state = State::LeaveSwitch;
            return (0, None);
        }
        // Half as far again as the travel: the start was anywhere, and the switch has some depth.
        let far = -self.scaled.travel - self.scaled.travel / 2;
        if self.ramp.is_at(far) {
            let limit_m = 1.5 * self.config.travel_m;
            return (0, Some(self.trip(SpringFaultCause::SwitchNotFound, limit_m, limit_m)));
        }
        (self.ramp.tick(&self.scaled.search, Some(far)), None)
    }

    /// Off the switch: its edge is the origin.
    pub(super) fn leave_switch(&mut self, at_switch: bool) -> (i8, Option<SpringEvent>) {
        if !at_switch {
            self.ramp.declare(0);
            self.state = State::BackOff;
            return (0, None);
        }
        if self.ramp.is_at(self.scaled.back_off) {
            let limit_m = self.config.back_off_m;
            return (0, Some(self.trip(SpringFaultCause::SwitchStuck, limit_m, limit_m)));
        }
        (self.ramp.tick(&self.scaled.search, Some(self.scaled.back_off)), None)
    }

    /// To the position where the block waits.
    pub(super) fn back_off(&mut self) -> (i8, Option<SpringEvent>) {
        let steps = self.ramp.tick(&self.scaled.search, Some(self.scaled.back_off));
        if !self.ramp.is_at(self.scaled.back_off) {
            return (steps, None);
        }
        self.state = State::Homed;
        (steps, Some(SpringEvent::Homed))
    }

    /// Away from the structure. The switch ends it too, so a wrong count cannot run the seat into its stop.
    pub(super) fn release(&mut self, zero: Option<ZeroReading>, at_switch: bool) -> i8 {
        if at_switch {
            self.ramp.halt();
            self.state = State::Unhomed;
            return 0;
        }
        let steps = self.ramp.tick(&self.scaled.fast, Some(self.scaled.back_off));
        if self.ramp.is_at(self.scaled.back_off) {
            self.state = zero.map_or(State::Homed, State::Ready);
        }
        steps
    }
}
