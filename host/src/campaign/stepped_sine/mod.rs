//! A stepped sine over a list of frequencies, or over amplitudes at a resonance that it follows.
//!
//! [`read`] reads the three kinds of experiment that are one, with its list of [`frequencies`] or the [`loops`] of the controller.

mod frequencies;
mod loops;
mod read;

use std::ops::Range;

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::phase_lock::PhaseLock;
use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
use damprig_core::control::stepped_sine as core_sine;
use damprig_core::control::stepped_sine::{DriveMode, Points};
use damprig_core::measure::steadiness::SteadyLimits;

pub(super) use self::frequencies::to_nine_places;
pub(super) use self::read::{read, read_response_controlled, read_tracking};
use crate::input::Number;
use crate::settings::number_of;

/// How a point starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointStart {
    /// With the structure at rest.
    FromRest,
    /// With the motion of the point before: a sweep.
    CarryOver,
}

/// A stepped sine.
#[derive(Clone, Debug, PartialEq)]
pub struct SteppedSine {
    /// The frequencies in the order they are run, Hz; none of a tracked resonance.
    pub frequencies_hz: Vec<f64>,
    /// The resonance that is tracked, at its amplitudes.
    pub tracked: Option<TrackedResonance>,
    /// The points around the measured peak in the order they are run, each as its place in the grid's direction; empty without any.
    pub peak_order: Vec<usize>,
    /// How each point starts.
    pub start: PointStart,
    /// What is kept at its amplitude. The drive limit of a loop applies only if `drive_limit` is given.
    pub drive: DriveMode,
    /// The stated drive limit of a loop, m, and its place; without one it is the range of the rig's drive.
    pub drive_limit: Option<Number>,
    /// The one amplitude of a response that is kept, as written.
    pub kept: Option<KeptAmplitude>,
    /// Time over which the drive rises from zero and fades again, s.
    pub ramp_s: f64,
    /// Settling time: from the start of a point to its dwell, s.
    pub settle_s: f64,
    /// Dwell: the measured time of a point, s.
    pub dwell_s: f64,
    /// |x| below which the structure counts as at rest before a `from_rest` point, m.
    pub rest_level_m: f64,
    /// When a point counts as steady.
    pub steady: SteadyLimits,
}

/// An amplitude of a response that is kept, as written.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptAmplitude {
    /// Its key.
    pub key: &'static str,
    /// The amplitude in the key's unit, and its place.
    pub amplitude: Number,
}

/// A resonance that is tracked.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedResonance {
    /// The loop that finds its frequency.
    pub lock: PhaseLock,
    /// The key of its amplitudes.
    pub key: &'static str,
    /// The amplitudes in the order they are run, in the key's unit, and their places.
    pub amplitudes: Vec<Number>,
}

impl TrackedResonance {
    /// Whether a phase of x relative to z, rad, is within the tolerance of the one that is kept.
    #[must_use]
    pub fn is_locked(&self, phase_rad: f64) -> bool {
        (phase_rad - f64::from(self.lock.phase_rad)).abs() <= f64::from(self.lock.tolerance_rad)
    }
}

impl SteppedSine {
    /// Number of its points that are known before it begins.
    #[must_use]
    pub fn known_points(&self) -> usize {
        self.tracked.as_ref().map_or(self.frequencies_hz.len(), |tracked| tracked.amplitudes.len())
    }

    /// A point in a few words: `2.45 Hz`, or of a tracked resonance `the resonance at x 5 mm`.
    #[must_use]
    pub fn point_in_words(&self, index: usize) -> String {
        match &self.tracked {
            Some(tracked) => tracked.amplitudes.get(index).map_or_else(String::new, |amplitude| {
                format!("the resonance at {}", self.amplitude_in_words(amplitude.value))
            }),
            None => self.frequencies_hz.get(index).map_or_else(String::new, |f| format!("{f} Hz")),
        }
    }

    /// An amplitude that it states itself in a few words: `x 5 mm`, `Z 1 mm`.
    #[must_use]
    pub fn amplitude_in_words(&self, value: f64) -> String {
        match self.response_loop() {
            Some(own) => kept_in_words(&own.response.with_amplitude(value as f32)),
            None => format!("Z {} mm", to_nine_places(value * 1e3)),
        }
    }

    /// The frequencies at which it drives, or the ends of the range in which it follows a resonance, Hz.
    #[must_use]
    pub fn drive_range_hz(&self) -> Vec<f64> {
        let ends = |own: &TrackedResonance| vec![f64::from(own.lock.low_hz), f64::from(own.lock.high_hz)];
        self.tracked.as_ref().map_or_else(|| self.frequencies_hz.clone(), ends)
    }

    /// The amplitudes that it states itself, each with its key; none where the set-up states it.
    fn amplitudes(&self) -> impl Iterator<Item = (&'static str, &Number)> {
        let tracked = self.tracked.iter().flat_map(|own| own.amplitudes.iter().map(|amplitude| (own.key, amplitude)));
        tracked.chain(self.kept.iter().map(|own| (own.key, &own.amplitude)))
    }

    /// The largest amplitude that it states itself, with its key.
    #[must_use]
    pub fn largest_amplitude(&self) -> Option<(&'static str, &Number)> {
        self.amplitudes().max_by(|a, b| a.1.value.total_cmp(&b.1.value))
    }

    /// The smallest amplitude that it states itself, with its key.
    #[must_use]
    pub fn smallest_amplitude(&self) -> Option<(&'static str, &Number)> {
        self.amplitudes().min_by(|a, b| a.1.value.total_cmp(&b.1.value))
    }

    /// Longest time of all dwells of a point, s: `dwell_s`, or more if a point is measured again until it is steady.
    #[must_use]
    pub fn longest_dwell_s(&self) -> f64 {
        self.dwell_s.max(f64::from(self.steady.longest_dwell_s))
    }

    /// The loop of the response, if that is kept at its amplitude.
    #[must_use]
    pub fn response_loop(&self) -> Option<&ResponseLoop> {
        if let DriveMode::Response(parameters) = &self.drive { Some(parameters) } else { None }
    }

    /// The controller's experiment of these points at a base amplitude (m), on a rig whose drive delivers ± `drive_m`.
    #[must_use]
    pub fn order(&self, base_amplitude_m: f64, points: Range<usize>, drive_m: f32) -> core_sine::SteppedSine {
        let drive = match self.drive {
            DriveMode::ClosedLoop(parameters) if self.drive_limit.is_none() => {
                DriveMode::ClosedLoop(ClosedLoop { drive_limit_m: drive_m, ..parameters })
            }
            DriveMode::Response(parameters) if self.drive_limit.is_none() => {
                let base = parameters.base.map(|base| ClosedLoop { drive_limit_m: drive_m, ..base });
                DriveMode::Response(ResponseLoop { base, drive_limit_m: drive_m, ..parameters })
            }
            drive => drive,
        };
        core_sine::SteppedSine {
            start: match self.start {
                PointStart::FromRest => core_sine::Start::FromRest { level_m: self.rest_level_m as f32 },
                PointStart::CarryOver => core_sine::Start::CarryOver,
            },
            amplitude_m: base_amplitude_m as f32,
            drive,
            ramp_s: self.ramp_s as f32,
            settle_s: self.settle_s as f32,
            dwell_s: self.dwell_s as f32,
            steady: self.steady,
            first_index: points.start as u16,
            // Cannot overflow: the campaign's parser limits their number.
            points: match &self.tracked {
                Some(TrackedResonance { lock, amplitudes, .. }) => Points::Resonance {
                    lock: *lock,
                    amplitudes: amplitudes[points].iter().map(|amplitude| amplitude.value as f32).collect(),
                },
                None => self.frequencies_hz[points].iter().map(|f| *f as f32).collect(),
            },
        }
    }
}

/// What is kept, in a few words: `x 5 mm`, `velocity 0.1 m/s`, `relative 5 mm`.
#[must_use]
pub fn kept_in_words(quantity: &KeptQuantity) -> String {
    let of = |what: &str, amplitude: f32, per: f64, unit: &str| {
        format!("{what} {} {unit}", to_nine_places(number_of(amplitude) * per))
    };
    match *quantity {
        KeptQuantity::Displacement { amplitude_m } => of("x", amplitude_m, 1e3, "mm"),
        KeptQuantity::Velocity { amplitude_m_per_s } => of("velocity", amplitude_m_per_s, 1.0, "m/s"),
        KeptQuantity::Relative { amplitude_m } => of("relative", amplitude_m, 1e3, "mm"),
    }
}
