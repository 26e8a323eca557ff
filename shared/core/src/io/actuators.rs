//! Actuator values of a tick: the base drive and the friction damper's motor.

/// One tick's actuator values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Actuators {
    /// Demanded base displacement, m; the board's calibration turns it into a drive voltage.
    pub drive_m: f32,
    /// The drive's relay may close.
    pub drive_enabled: bool,
    /// Demand on the friction damper's motor.
    pub motor: Motor,
}

/// One tick's motor demand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Motor {
    /// Steps to make in this tick, evenly spaced; positive towards the structure.
    pub steps: i8,
    /// The motor is energised and holds torque.
    pub enabled: bool,
}
