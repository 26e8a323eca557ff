//! Homing of the spring's seat on the limit switch, and release of the block from the structure.

use super::{FrictionSpring, SpringEvent, SpringState, ZeroReading};
use crate::control::fault::SpringFaultCause;

impl FrictionSpring {
    /// One tick of the search for the limit switch.
    pub(super) fn seek_switch(&mut self, at_switch: bool) -> (i8, Option<SpringEvent>) {
        if at_switch {
            self.ramp.declare(0);
            self.state = SpringState::LeaveSwitch;
            return (0, None);
        }
        // One and a half times the travel: the start position is unknown, and the switch has some depth.
        let far = -self.scaled.travel - self.scaled.travel / 2;
        if self.ramp.is_at(far) {
            let limit_m = 1.5 * self.config.travel_m;
            return (0, Some(self.trip(SpringFaultCause::SwitchNotFound, limit_m, limit_m)));
        }
        (self.ramp.tick(&self.scaled.search, Some(far)), None)
    }

    /// One tick of leaving the switch; its edge is the origin.
    pub(super) fn leave_switch(&mut self, at_switch: bool) -> (i8, Option<SpringEvent>) {
        if !at_switch {
            self.ramp.declare(0);
            self.state = SpringState::BackOff;
            return (0, None);
        }
        if self.ramp.is_at(self.scaled.back_off) {
            let limit_m = self.config.back_off_m;
            return (0, Some(self.trip(SpringFaultCause::SwitchStuck, limit_m, limit_m)));
        }
        (self.ramp.tick(&self.scaled.search, Some(self.scaled.back_off)), None)
    }

    /// One tick of the move to the position where the block waits.
    pub(super) fn back_off(&mut self) -> (i8, Option<SpringEvent>) {
        let steps = self.ramp.tick(&self.scaled.search, Some(self.scaled.back_off));
        if !self.ramp.is_at(self.scaled.back_off) {
            return (steps, None);
        }
        self.state = SpringState::Homed;
        (steps, Some(SpringEvent::Homed))
    }

    /// One tick of the move away from the structure. The switch ends it too, so a wrong count cannot drive the seat
    /// into its stop.
    pub(super) fn release(&mut self, zero: Option<ZeroReading>, at_switch: bool) -> i8 {
        if at_switch {
            self.ramp.halt();
            self.state = SpringState::Unhomed;
            return 0;
        }
        let steps = self.ramp.tick(&self.scaled.fast, Some(self.scaled.back_off));
        if self.ramp.is_at(self.scaled.back_off) {
            self.state = zero.map_or(SpringState::Homed, SpringState::Ready);
        }
        steps
    }
}
