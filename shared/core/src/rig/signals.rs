//! Telemetry signals: one line declares a signal's field, name, unit and index in the table.

macro_rules! signals {
    ($($(#[doc = $doc:literal])+ $name:ident: $unit:literal,)+) => {
        /// Every telemetry signal of one tick.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct Signals {
            $($(#[doc = $doc])+ pub $name: f32,)+
        }

        /// Name and unit of every signal in the order of [`Signals::values`]. The unit of a dimensionless signal is
        /// empty.
        pub const SIGNALS: [(&str, &str); [$($unit),+].len()] = [$((stringify!($name), $unit)),+];

        /// Meaning of every signal, in the same order.
        pub const SIGNAL_DOCS: [&str; SIGNALS.len()] = [$(concat!($($doc),+)),+];

        impl Signals {
            /// The values in the order of [`SIGNALS`].
            #[must_use]
            pub fn values(&self) -> [f32; SIGNALS.len()] {
                [$(self.$name),+]
            }
        }
    };
}

signals! {
    /// Mean of x over the tick.
    x: "m",
    /// Mean of z over the tick.
    z: "m",
    /// Demanded base displacement.
    drive: "m",
    /// Drive frequency; 0 if there is none.
    frequency: "Hz",
    /// max |x| over the tick.
    x_peak: "m",
    /// Z over the last whole cycle: √2 times its RMS.
    base_amplitude: "m",
    /// Force of the friction damper's spring above its reading without contact.
    spring_force: "N",
    /// Position of the spring's seat from the limit switch.
    spring_position: "m",
    /// Demanded force of the spring; 0 without a target.
    spring_target: "N",
    /// Stage of the spring: the index in `friction_spring::SpringStage`.
    spring_stage: "",
    /// Highest force of the tick on the wall at −d.
    wall_low: "N",
    /// Highest force of the tick on the wall at +d.
    wall_high: "N",
    /// Impacts since the start.
    impacts: "",
    /// Impacts in the last whole cycle of the drive.
    impacts_in_cycle: "",
    /// x of the tick before as predicted by the twin.
    twin_x: "m",
    /// RMS of measured minus predicted x.
    twin_residual: "m",
    /// Predicted impacts that are strong enough to be measured.
    twin_predicted: "",
    /// Measured impacts.
    twin_detected: "",
    /// Predicted impacts that were not measured.
    twin_missing: "",
    /// 1 while the twin's alarm for missing impacts is raised.
    twin_alarm: "",
    /// Stage of the interlocks: the index in `safety::SafeStage`.
    safety: "",
    /// Amplitude of x at the drive frequency over the last whole cycle; 0 without a drive frequency.
    x_amplitude: "m",
    /// Phase of x relative to z in that cycle, −π to π, within 6 mrad.
    x_phase: "rad",
    /// Amplitude of z at the drive frequency in that cycle.
    z_amplitude: "m",
    /// Phase of z relative to the drive in that cycle, −π to π, within 6 mrad.
    z_phase: "rad",
    /// X/Z of the lock-in amplitudes in that cycle. A result's `x_over_z` is of the cycle maxima.
    x_over_z_lock_in: "",
    /// Measured velocity of the structure: its mean over the last 8 ms.
    x_velocity: "m/s",
    /// Displacement of the particle relative to the structure, y − x, in the tick before as estimated by the twin; 0
    /// without a twin.
    particle_offset: "m",
    /// Velocity of the particle relative to the structure, y′ − x′, in the tick before as estimated by the twin; 0
    /// without a twin.
    particle_velocity: "m/s",
    /// Stage of the experiment's present point: 1 coming to rest, 2 settling, 3 measuring (dwell), 4 waiting for a person;
    /// 0 without an experiment.
    stage: "",
    /// Time that this stage still takes at least; 0 while it waits for something or is held.
    stage_left: "s",
    /// Dwells of the present point that have begun: more than 1 if the first was not steady, or the loops lost their
    /// targets.
    dwells: "",
}

/// Number of signals, from the start of the table, that a rig sends by default: the motion.
pub const MOTION_SIGNALS: usize = 4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_at_the_index_of_its_name() {
        let signals = Signals { x: 1.0, twin_x: 2.0, particle_velocity: 3.0, ..Signals::default() };
        for (name, value) in [("x", 1.0), ("twin_x", 2.0), ("particle_velocity", 3.0), ("z", 0.0)] {
            let place = SIGNALS.iter().position(|(known, _)| *known == name).unwrap();
            assert_eq!(signals.values()[place], value, "{name}");
        }
    }
}
