//! The two ends of the block's way: finding the limit switch, and moving away from the structure.

use super::{Cause, FrictionSpring, Happening, SpringFault, Task};

impl FrictionSpring {
    /// One tick of homing.
    pub(super) fn home(&mut self, at_switch: bool) -> (i8, Option<Happening>) {
        let fault = |cause, limit_m| Some(SpringFault { cause, value: limit_m, limit: limit_m });
        match self.task {
            Task::SeekSwitch if at_switch => {
                self.ramp.declare(0);
                self.task = Task::LeaveSwitch;
                (0, None)
            }
            Task::SeekSwitch => {
                // Half as far again as the travel: the position was anywhere, and the switch has some depth.
                let far = -self.paces.travel - self.paces.travel / 2;
                if self.ramp.is_at(far) {
                    let fault = fault(Cause::SwitchNotFound, 1.5 * self.config.travel_m);
                    return (0, fault.map(|fault| self.trip(fault)));
                }
                (self.ramp.tick(&self.paces.search, Some(far)), None)
            }
            Task::LeaveSwitch if !at_switch => {
                self.ramp.declare(0);
                self.homed = true;
                self.task = Task::BackOff;
                (0, None)
            }
            Task::LeaveSwitch => {
                if self.ramp.is_at(self.paces.back_off) {
                    let fault = fault(Cause::SwitchStuck, self.config.back_off_m);
                    return (0, fault.map(|fault| self.trip(fault)));
                }
                (self.ramp.tick(&self.paces.search, Some(self.paces.back_off)), None)
            }
            _ => {
                let steps = self.ramp.tick(&self.paces.search, Some(self.paces.back_off));
                if !self.ramp.is_at(self.paces.back_off) {
                    return (steps, None);
                }
                self.task = Task::Stand;
                (steps, Some(Happening::Homed))
            }
        }
    }

    /// Away from the structure; the switch ends it too, so a wrong count cannot run the seat into its stop.
    pub(super) fn release(&mut self, at_switch: bool) -> (i8, Option<Happening>) {
        if at_switch {
            self.ramp.halt();
            self.homed = false;
            self.task = Task::Stand;
            return (0, None);
        }
        let steps = self.ramp.tick(&self.paces.fast, Some(self.paces.back_off));
        if self.ramp.is_at(self.paces.back_off) {
            self.task = Task::Stand;
        }
        (steps, None)
    }
}
