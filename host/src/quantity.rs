//! Every quantity that damprig measures or computes, declared once: its name with the unit, its label and its definition.
//! Columns of tables, keys of JSON, metrics of studies, rows of comparisons and labels of figures take theirs from here.

/// A quantity as it is declared.
#[derive(Debug)]
struct Declared {
    name: &'static str,
    unit: &'static str,
    label: &'static str,
    definition: &'static str,
}

macro_rules! quantities {
    ($($variant:ident: $name:literal, $unit:literal, $label:literal, $definition:literal;)*) => {
        /// A quantity, or a name or count that places a row in a table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Quantity {
            $(#[doc = $definition] $variant,)*
        }

        const DECLARED: &[Declared] = &[
            $(Declared { name: $name, unit: $unit, label: $label, definition: $definition },)*
        ];

        impl Quantity {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];
        }
    };
}

// Name, unit ("1" of a ratio or a count, "" of a name or a flag), label, definition.
quantities! {
    SetUp: "set_up", "", "set-up", "name of the set-up";
    Experiment: "experiment", "", "experiment", "name of the experiment";
    Kind: "kind", "", "kind", "playback, impulse or free_vibration";
    FrequencyHz: "frequency_hz", "Hz", "frequency", "drive frequency; of a free vibration: over the cycles of its decay";

    XOverZ: "x_over_z", "1", "X/Z (cycle maxima)", "X/Z (cycle maxima): mean over the cycles of their largest |x| over Z (P/k of a force, x0 of a free vibration)";
    XOverZLockIn: "x_over_z_lock_in", "1", "X/Z (lock-in)", "X/Z (lock-in): amplitude of x over that of z, both at the drive frequency";
    MaxXOverZ: "max_x_over_z", "1", "largest |x|/Z", "largest |x| over Z (P/k, x0)";
    RmsOverZ: "rms_over_z", "1", "RMS of x/Z", "RMS of x over Z (P/k, x0)";
    DOverZ: "d_over_z", "1", "d/Z", "clearance over the base amplitude as set; NaN without a particle";
    ActualDOverZ: "actual_d_over_z", "1", "d/Z as measured", "clearance over the base amplitude as measured; NaN without a particle";

    ZAmplitudeM: "z_amplitude_m", "m", "amplitude of the base", "base: amplitude at the drive frequency (lock-in)";
    ZDistortion: "z_distortion", "1", "distortion of the base", "base: 2nd to 5th harmonic over the first";
    MaxAbsZM: "max_abs_z_m", "m", "largest |z|", "base: largest |z|";
    RmsZM: "rms_z_m", "m", "RMS of z", "base: RMS of z";
    WantedRmsM: "wanted_rms_m", "m", "RMS of the demanded z", "RMS of the demanded z";
    BaseErrorRmsM: "base_error_rms_m", "m", "RMS of z less the demand", "RMS of z less the demand, at its best delay";
    BaseDelayS: "base_delay_s", "s", "delay of the base", "delay of z behind the demand, from demand to reading";
    DriveAmplitudeM: "drive_amplitude_m", "m", "amplitude of the drive", "drive: amplitude at the drive frequency (lock-in)";
    DriveSaturated: "drive_saturated", "", "drive at its limit", "whether the drive was at its limit";
    SensorsClipped: "sensors_clipped", "", "clipped sensors", "sensors with a sample at an end of their span, or none";

    XAmplitudeM: "x_amplitude_m", "m", "amplitude of x", "structure: amplitude at the drive frequency (lock-in)";
    PhaseRad: "phase_rad", "rad", "phase", "phase of x relative to z";
    MeanCycleMaxM: "mean_cycle_max_m", "m", "mean cycle maximum of |x|", "mean over the cycles of their largest |x|";
    LastCycleMaxM: "last_cycle_max_m", "m", "largest |x| of the last cycle", "largest |x| of the last whole cycle";
    MaxAbsXM: "max_abs_x_m", "m", "largest |x|", "largest |x|";
    MaxAbsXTimeS: "max_abs_x_time_s", "s", "time of the largest |x|", "when |x| was largest, after the start of the measurement";
    RmsXM: "rms_x_m", "m", "RMS of x", "RMS of x; of a release: from when |x| has fallen by a tenth of x0";
    MaxAbsXMinusZM: "max_abs_x_minus_z_m", "m", "largest |x − z|", "largest |x − z|; as measured: of the ticks' means";
    RmsXMinusZM: "rms_x_minus_z_m", "m", "RMS of x − z", "RMS of x − z";
    PredictedMaxAbsXM: "predicted_max_abs_x_m", "m", "predicted largest |x|", "largest |x| of the simulation";
    PredictedRmsXM: "predicted_rms_x_m", "m", "predicted RMS of x", "RMS of x of the simulation, over the same window";
    XNoiseRmsM: "x_noise_rms_m", "m", "RMS noise of x", "RMS noise of a tick's x";

    ChangePerCycle: "change_per_cycle", "1", "change per cycle", "trend of the cycle maximum, relative, in a cycle";
    Scatter: "scatter", "1", "scatter of the cycle maxima", "scatter of the cycle maxima around the trend, relative";
    CycleSpread: "cycle_spread", "1", "largest over mean cycle maximum − 1", "largest cycle maximum of |x| over their mean, minus 1: 0 if every cycle is the same";
    Deviation: "deviation", "1", "deviation from the limit", "x_over_z over its extrapolated limit, less 1";
    DeviationUncertainty: "deviation_uncertainty", "1", "uncertainty of the deviation", "uncertainty of the deviation (95 %)";
    Interval: "interval", "1", "interval of X/Z", "half-width of the 95 % interval of x_over_z as a mean over cycles, relative";
    Steady: "steady", "", "steady", "whether steadiness is steady";
    Steadiness: "steadiness", "", "steadiness", "steady, stationary (does not repeat, mean without drift) or not steady";
    PeriodCycles: "period_cycles", "drive periods", "period", "drive periods after which the motion repeats; missing if it does not within ten";
    LargestMultiplier: "largest_multiplier", "1", "largest multiplier", "magnitude of the largest Floquet multiplier of the periodic motion; below 1 it is stable";

    ImpactsPerCycle: "impacts_per_cycle", "1", "impacts per cycle", "impacts per cycle (first touches of soft walls)";
    Impacts: "impacts", "1", "impacts", "impacts on both walls; of an orbit: in its period";
    PredictedImpacts: "predicted_impacts", "1", "predicted impacts", "impacts of the simulation that are strong enough to be counted";
    PeakContactForceN: "peak_contact_force_n", "N", "largest wall force", "largest force on a wall: of a soft wall, or of a hard one whose contact is stated";
    HarvestedPowerW: "harvested_power_w", "W", "harvested power", "mean power in the loads of piezoelectric walls";
    MaxImpulseNS: "max_impulse_n_s", "N·s", "largest impulse", "largest impulse on a hard wall";
    Side: "side", "1", "wall", "+1 where y - x = +d, -1 where y - x = -d";
    PeakN: "peak_n", "N", "largest force", "largest force of the impact";
    ImpulseNS: "impulse_n_s", "N·s", "impulse", "integral of the force";
    ContactS: "contact_s", "s", "contact time", "contact time of the half-sine with this peak and impulse";
    Clipped: "clipped", "", "clipped", "whether a reading reached the clipping force: peak and impulse are lower bounds";
    Held: "held", "", "held", "whether the contact lasted longer than the longest contact time";
    ApproachSpeedMPerS: "approach_speed_m_per_s", "m/s", "approach speed", "|x' - y'| just before the impact";
    FastestImpactMPerS: "fastest_impact_m_per_s", "m/s", "largest approach speed", "largest approach speed of an impact";
    MaxAbsYMinusXM: "max_abs_y_minus_x_m", "m", "largest |y − x|", "largest |y - x|";
    LossFactor: "loss_factor", "1", "loss factor", "energy that the spheres lose in a cycle over 2π times the structure's largest kinetic energy in it";
    CollectiveMotion: "collective_motion", "1", "collective motion", "share of the spheres' momentum in the box that they have in common, 0 to 1";

    StartM: "start_m", "m", "initial x (x0)", "x0 of a free vibration; NaN of others";
    EndM: "end_m", "m", "|x| at the end of the decay", "largest |x| after `cycles`, on the side of x0";
    LogDecrement: "log_decrement", "1", "logarithmic decrement", "ln(start_m/end_m)/cycles";
    DampingRatio: "damping_ratio", "1", "damping ratio", "damping ratio of the linear structure that would decay so";
    DecayFrequencyHz: "decay_frequency_hz", "Hz", "decay frequency", "frequency over the cycles of the decay";

    Cycles: "cycles", "1", "cycles", "whole cycles that were measured";
    StartTick: "start_tick", "tick", "first tick", "first tick measured";
    EndTick: "end_tick", "tick", "tick after the last", "first tick after the measurement";
    Tick: "tick", "tick", "tick", "tick since the start, 1 ms each; of an impact: in which its pulse ended";
    GapBeforeTicks: "gap_before_ticks", "tick", "missing ticks", "ticks that are missing before the row";
    TimeS: "t_s", "s", "time", "time since the start; of an impact: of the centre of its pulse";
    PointIndex: "point_index", "1", "point", "place of the point in the experiment's frequencies, from 0";
    PointFrequencyHz: "point_frequency_hz", "Hz", "drive frequency", "drive frequency of the point";
    Segment: "segment", "1", "segment", "times that the experiment had been started before; ticks count from 0 in each";
}

/// Names of columns and keys that older versions wrote.
const FORMER: &[(&str, Quantity)] = &[
    ("x_mean_cycle_max_m", Quantity::MeanCycleMaxM),
    ("mean_cycle_peak_x_m", Quantity::MeanCycleMaxM),
    ("x_last_cycle_max_m", Quantity::LastCycleMaxM),
    ("x_max_m", Quantity::MaxAbsXM),
    ("x_peak_m", Quantity::MaxAbsXM),
    ("peak_x_m", Quantity::MaxAbsXM),
    ("x_rms_m", Quantity::RmsXM),
    ("z_peak_m", Quantity::MaxAbsZM),
    ("z_rms_m", Quantity::RmsZM),
    ("relative_peak_m", Quantity::MaxAbsXMinusZM),
    ("relative_rms_m", Quantity::RmsXMinusZM),
    ("predicted_x_peak_m", Quantity::PredictedMaxAbsXM),
    ("predicted_x_rms_m", Quantity::PredictedRmsXM),
    ("peak_offset_m", Quantity::MaxAbsYMinusXM),
];

impl Quantity {
    const fn declared(self) -> &'static Declared {
        &DECLARED[self as usize]
    }

    /// Its name as a column, a JSON key, a metric and in Python; the end is the unit.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.declared().name
    }

    /// The quantity that older versions wrote under this name.
    #[must_use]
    pub fn formerly(name: &str) -> Option<Self> {
        FORMER.iter().find(|(former, _)| *former == name).map(|(_, own)| *own)
    }

    /// SI unit: "1" of a ratio or a count, "" of a name or a flag.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        self.declared().unit
    }

    /// Its unit after a number: nothing after a ratio or a count.
    #[must_use]
    pub fn suffix(self) -> &'static str {
        if self.unit() == "1" { "" } else { self.unit() }
    }

    /// What people read, on an axis and in a table, without the unit.
    #[must_use]
    pub const fn label(self) -> &'static str {
        self.declared().label
    }

    /// What it is.
    #[must_use]
    pub const fn definition(self) -> &'static str {
        self.declared().definition
    }

    /// Whether it is a length over the case's reference length.
    #[must_use]
    pub const fn is_ratio(self) -> bool {
        matches!(self, Self::XOverZ | Self::MaxXOverZ | Self::RmsOverZ)
    }

    /// Label of an axis or a colour scale, with the unit. `reference` is the symbol of the reference length: `Z`, `(P/k)` or `x0`.
    #[must_use]
    pub fn axis_label(self, reference: &str) -> String {
        match self.unit() {
            "" | "1" => self.label().replace("/Z", &format!("/{reference}")),
            unit => format!("{} ({unit})", self.label()),
        }
    }

    /// Head of a column of numbers: its label, then the unit that people read, empty for a ratio or a count.
    #[must_use]
    pub fn head(self) -> (&'static str, &'static str) {
        (self.label(), self.shown_unit().0)
    }

    /// Its definition for a case whose reference length has this symbol.
    #[must_use]
    pub fn meaning(self, reference: &str) -> String {
        match self.definition().split_once(" over Z (") {
            Some((length, _)) => format!("{length} over {reference}"),
            None => self.definition().into(),
        }
    }

    /// The unit that people read, and its number in an SI unit.
    #[must_use]
    pub fn shown_unit(self) -> (&'static str, f64) {
        match self.unit() {
            "rad" => ("°", 180.0 / std::f64::consts::PI),
            "m" => ("mm", 1e3),
            _ => (self.suffix(), 1.0),
        }
    }

    /// The difference of two values; angles differ by half a turn at most.
    #[must_use]
    pub fn difference(self, a: f64, b: f64) -> f64 {
        if self == Self::PhaseRad {
            (a - b + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
        } else {
            a - b
        }
    }
}

impl serde::Serialize for Quantity {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_name_is_declared_once_and_ends_with_its_unit() {
        let names: BTreeSet<&str> = Quantity::ALL.iter().map(|own| own.name()).collect();
        assert_eq!(names.len(), Quantity::ALL.len());
        let ends = |unit| match unit {
            "m/s" => "_m_per_s".to_string(),
            "N·s" => "_n_s".to_string(),
            unit => format!("_{}", unit.to_lowercase()),
        };
        for own in Quantity::ALL {
            let has_no_end = matches!(own.unit(), "" | "1" | "tick" | "drive periods");
            assert!(has_no_end || own.name().ends_with(&ends(own.unit())), "{own:?}");
            assert!(!own.definition().is_empty() && !own.label().is_empty(), "{own:?}");
        }
        assert!(FORMER.iter().all(|(former, _)| !names.contains(former)), "a former name is in use again");
    }

    #[test]
    fn phases_differ_by_half_a_turn_at_most() {
        assert!((Quantity::PhaseRad.difference(3.1, -3.1) - (6.2 - std::f64::consts::TAU)).abs() < 1e-12);
        assert_eq!(Quantity::XOverZ.difference(5.0, 1.0), 4.0);
    }
}
