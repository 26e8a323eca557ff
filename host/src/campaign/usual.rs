//! Usual values of a campaign's experiments and simulated rig: others are allowed, with a warning. Those of set-ups are
//! declared with their keys in [`crate::setup`].

use crate::input::key::Range::{Any, NotNegative, Positive};
use crate::input::key::{Key, number};

/// Of `[[experiment]]`, of all kinds.
pub(super) const EXPERIMENT: &[Key] = &[
    number("frequencies_hz", Positive, "drive frequencies").usual(0.1, 25.0),
    number("settle_s", NotNegative, "time before the dwell of a point").usual(0.0, 600.0),
    number("dwell_s", Positive, "time measured at each frequency").usual(1.0, 600.0),
    number("ramp_s", NotNegative, "rise and fall of the drive").usual(0.0, 60.0),
    number("rest_level_m", Positive, "|x| of a structure at rest").usual(1e-6, 2e-3),
    number("target_peak_m", Positive, "peak of the played record").usual(1e-5, 0.05),
    number("amplitude_m", Any, "height of the pulse").usual(-0.05, 0.05),
    number("duration_s", Positive, "length of the pulse").usual(0.01, 60.0),
    number("tail_s", NotNegative, "time measured after the end").usual(0.0, 600.0),
    number("start_m", Any, "x0, where the structure is released").usual(-0.1, 0.1),
    number("measure_s", Positive, "time measured after the release").usual(0.5, 600.0),
];

/// Of `frequencies_hz = { … }`.
pub(super) const GRID: &[Key] = &[
    number("from_hz", Positive, "the first frequency").usual(0.1, 25.0),
    number("to_hz", Positive, "the last frequency").usual(0.1, 25.0),
    number("step_hz", Any, "the step").usual(-2.0, 2.0),
];

/// Of `[rig]`.
pub(super) const RIG: &[Key] = &[
    number("sensor_resolution_m", NotNegative, "smallest displacement step of the sensors").usual(0.0, 1e-4),
    number("sensor_noise_rms_m", NotNegative, "noise of a displacement sample").usual(0.0, 1e-4),
];

/// Of `[rig.shaker]`.
pub(super) const SHAKER: &[Key] = &[
    number("moving_mass_kg", Positive, "table and armature").usual(0.1, 500.0),
    number("suspension_stiffness_n_per_m", NotNegative, "stiffness of the suspension").usual(0.0, 1e6),
    number("suspension_damping_n_s_per_m", NotNegative, "damping of the suspension").usual(0.0, 1e4),
    number("force_factor_n_per_a", Positive, "force per current").usual(1.0, 1000.0),
    number("coil_resistance_ohm", Positive, "resistance of the coil").usual(0.05, 50.0),
    number("half_stroke_m", Positive, "stroke to either side").usual(1e-3, 0.5),
];
