//! The telemetry signals: what a host may choose from, by its place in this table.

/// Name and unit of every signal, in the order of [`super::Rig::signals`]; a number without a unit has an empty one.
pub const SIGNALS: [(&str, &str); 21] = [
    ("x", "m"),
    ("z", "m"),
    ("drive", "m"),
    ("frequency", "Hz"),
    ("x_peak", "m"),
    // Z over the last whole cycle.
    ("base_amplitude", "m"),
    ("spring_force", "N"),
    ("spring_position", "m"),
    ("spring_target", "N"),
    // Place in `friction_spring::SpringStage`.
    ("spring_stage", ""),
    // Highest force of the tick on the wall at −d, and at +d.
    ("wall_low", "N"),
    ("wall_high", "N"),
    // Since the start.
    ("impacts", ""),
    // In the last whole cycle.
    ("impacts_in_cycle", ""),
    // Predicted x of the tick before.
    ("twin_x", "m"),
    ("twin_residual", "m"),
    ("twin_predicted", ""),
    ("twin_detected", ""),
    ("twin_missing", ""),
    // 1 while predicted impacts do not come.
    ("twin_alarm", ""),
    // Place in `safety::SafeStage`.
    ("safety", ""),
];

/// Every signal of one tick.
pub type Signals = [f32; SIGNALS.len()];

/// How many of the table's first signals a rig sends if it is not told which: the motion.
pub const MOTION_SIGNALS: usize = 4;
