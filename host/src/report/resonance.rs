//! Resonances that a run has tracked: frequency and equivalent damping ratio over the amplitude (the backbone), measured, and predicted
//! from the set-up's model by the controller's own loops.

use damprig_core::io::TICK_HZ;
use damprig_core::measure::point::PointResult;

use crate::campaign::{Campaign, SteppedSine, TrackedResonance};
use crate::identify::response::equivalent;
use crate::identify::sensors::{self, Sensors};
use crate::prediction::loops::{self, LoopPrediction, is_as_asked};
use crate::report::documents::Rows;
use crate::report::numbers::significant;
use crate::run_folder::ResultRow;

/// A resonance over the amplitude, of an experiment on a set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedCurve {
    /// Position of the set-up in the campaign.
    pub set_up: usize,
    /// Name of the experiment.
    pub experiment: String,
    /// Its measured points, in their order.
    pub measured: Vec<TrackedPoint>,
    /// Those that the set-up's model gives, in their order; none where it is not predicted.
    pub predicted: Vec<TrackedPoint>,
}

/// A point of it.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedPoint {
    /// The amplitude that was asked for, in words.
    pub asked: String,
    /// Amplitude of x at the drive frequency, m.
    pub x_m: f64,
    /// Amplitude of the base, m.
    pub z_m: f64,
    /// Mean frequency of the drive, Hz.
    pub frequency_hz: f64,
    /// Phase of x relative to z, rad.
    pub phase_rad: f64,
    /// Natural frequency of the linear structure that would respond so, Hz.
    pub natural_frequency_hz: f64,
    /// Damping ratio of that structure.
    pub damping_ratio: f64,
    /// Half-width of the 95 % interval of both frequencies, Hz: noise and steps of z, which turn its phase, and twice what the phase is from
    /// the kept one. Not a number where it is not known.
    pub frequency_95_hz: f64,
    /// Half-width of the damping ratio's 95 % interval: noise and steps of z, scatter, and what X/Z is still from its limit; without the
    /// sensors' scales. Not a number where it is not known.
    pub damping_ratio_95: f64,
    /// Whether the resonance was found.
    pub found: AtResonance,
}

/// Whether a point is at its resonance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtResonance {
    /// Phase and amplitude are as asked for, and the motion is steady or stationary.
    Yes,
    /// As asked for, but the motion is not steady.
    Unsteady,
    /// The phase is not, at an end of the range of frequencies.
    AtEnd,
    /// The phase is not.
    NotLocked,
    /// The amplitude is not.
    NotHeld,
}

impl AtResonance {
    /// In words.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Yes => "locked",
            Self::Unsteady => "locked, not steady",
            Self::AtEnd => "not locked: at an end of the range",
            Self::NotLocked => "not locked",
            Self::NotHeld => "amplitude not held",
        }
    }
}

/// A mean frequency counts as that of the end of the range within this, relative.
const AT_END: f64 = 1e-3;

/// What a result says of a point.
struct Told {
    index: usize,
    frequency_hz: f64,
    x_m: f32,
    z_m: f32,
    phase_rad: f32,
    /// 95 % uncertainty of the base's amplitude, and all of X/Z, relative.
    of_base: f64,
    of_ratio: f64,
    is_settled: bool,
}

impl Told {
    fn of_row(row: &ResultRow, sensors: &Sensors) -> Self {
        let known = |value: f32| if value < f32::MAX { f64::from(value) } else { f64::NAN };
        let z_m = f64::from(row.z_amplitude_m);
        // The sensor of z is taken to have the noise of that of x.
        let ticks = f64::from(row.cycles) * f64::from(TICK_HZ) / row.frequency_hz;
        let of_base = sensors.amplitude_error_95_m(z_m, row.x_noise_rms_m.into(), ticks) / z_m;
        let of_scatter = known(row.interval).hypot(known(row.deviation_uncertainty));
        Self {
            index: row.point_index as usize,
            frequency_hz: row.frequency_hz,
            x_m: row.x_amplitude_m,
            z_m: row.z_amplitude_m,
            phase_rad: row.phase_rad,
            of_base,
            of_ratio: known(row.deviation).abs() + of_scatter.hypot(of_base),
            is_settled: row.steadiness.is_settled(),
        }
    }

    fn of_result(result: &PointResult) -> Self {
        Self {
            index: usize::from(result.index),
            frequency_hz: result.frequency_hz.into(),
            x_m: result.x_amplitude_m,
            z_m: result.z_amplitude_m,
            phase_rad: result.phase_rad,
            of_base: f64::NAN,
            of_ratio: f64::NAN,
            is_settled: true,
        }
    }

    fn point(&self, sine: &SteppedSine, tracked: &TrackedResonance) -> TrackedPoint {
        let lock = &tracked.lock;
        let is_near = |end_hz: f32| (self.frequency_hz / f64::from(end_hz) - 1.0).abs() < AT_END;
        let measured = [self.x_m, self.z_m, self.phase_rad];
        let found = if !tracked.is_locked(self.phase_rad.into()) {
            if is_near(lock.low_hz) || is_near(lock.high_hz) { AtResonance::AtEnd } else { AtResonance::NotLocked }
        } else if is_as_asked(sine, self.index, self.frequency_hz as f32, measured) {
            if self.is_settled { AtResonance::Yes } else { AtResonance::Unsteady }
        } else {
            AtResonance::NotHeld
        };
        let (x_m, z_m, phase_rad) = (f64::from(self.x_m), f64::from(self.z_m), f64::from(self.phase_rad));
        let (natural_frequency_hz, damping_ratio) = equivalent(self.frequency_hz, x_m / z_m, phase_rad);
        let amplitude = tracked.amplitudes.get(self.index);
        // Beside its resonance a point's phase and amplitude act otherwise on both.
        let is_locked = matches!(found, AtResonance::Yes | AtResonance::Unsteady | AtResonance::NotHeld);
        let of_phase = 2.0 * (phase_rad - f64::from(lock.phase_rad)).abs();
        let half = |value: f64, share: f64| if is_locked { value * share } else { f64::NAN };
        TrackedPoint {
            asked: amplitude.map_or_else(String::new, |own| sine.amplitude_in_words(own.value)),
            x_m,
            z_m,
            frequency_hz: self.frequency_hz,
            phase_rad,
            natural_frequency_hz,
            damping_ratio,
            frequency_95_hz: half(self.frequency_hz * damping_ratio, self.of_base + of_phase),
            damping_ratio_95: half(damping_ratio, self.of_ratio),
            found,
        }
    }
}

impl TrackedCurve {
    /// The tracked resonances of a run, set-up by set-up, each that has points. Predicts them from the set-ups' models. `is_simulated`: the
    /// run's rig was.
    #[must_use]
    pub fn of(campaign: &Campaign, rows: &[ResultRow], is_simulated: bool) -> Vec<Self> {
        let has_any = campaign.experiments.iter().any(|experiment| experiment.tracking().is_some());
        // What cannot be simulated has no prediction.
        let predicted = if has_any { loops::predict(campaign).unwrap_or_default() } else { Vec::new() };
        let sensors = sensors::of(&campaign.rig, is_simulated);
        let mut all = Vec::new();
        for (place, set_up) in campaign.set_ups.iter().enumerate() {
            for experiment in campaign.experiments.iter().filter(|e| e.set_ups.contains(&place)) {
                let Some((sine, tracked)) = experiment.tracking() else { continue };
                let is_own = |row: &&ResultRow| row.set_up == set_up.name && row.experiment == experiment.name;
                let own = rows.iter().filter(is_own).map(|row| Told::of_row(row, &sensors));
                let measured: Vec<TrackedPoint> = own.map(|told| told.point(sine, tracked)).collect();
                if measured.is_empty() {
                    continue;
                }
                let is_series = |own: &&LoopPrediction| {
                    own.set_up == place && campaign.experiments[own.experiment].series == experiment.series
                };
                let of_model = predicted.iter().find(is_series).map_or(&[][..], |own| &own.points);
                let mut predicted: Vec<TrackedPoint> =
                    of_model.iter().map(|result| Told::of_result(result).point(sine, tracked)).collect();
                if !experiment.carries_over() {
                    // The order of points from rest says nothing.
                    predicted.sort_by(|a, b| a.x_m.total_cmp(&b.x_m));
                }
                all.push(Self { set_up: place, experiment: experiment.name.clone(), measured, predicted });
            }
        }
        all
    }
}

/// Columns of a table of the points: name and unit.
const HEADS: [(&str, &str); 12] = [
    ("set-up", ""),
    ("experiment", ""),
    ("at", ""),
    ("drive", "Hz"),
    ("phase", "°"),
    ("X", "mm"),
    ("Z", "mm"),
    ("equivalent fn", "Hz"),
    ("± 95 %", "Hz"),
    ("equivalent ζ", "%"),
    ("± 95 %", "%"),
    ("resonance", ""),
];

/// The measured points, a row each.
#[must_use]
pub fn table(campaign: &Campaign, curves: &[TrackedCurve]) -> Rows {
    let mut rows = Rows::with_units(&HEADS);
    let row = |curve: &TrackedCurve, point: &TrackedPoint| {
        let zeta = 100.0 * point.damping_ratio;
        let half = |value: f64| if value.is_nan() { "–".into() } else { significant(value, 2) };
        [
            campaign.set_ups[curve.set_up].name.clone(),
            curve.experiment.clone(),
            point.asked.clone(),
            format!("{:.4}", point.frequency_hz),
            format!("{:.1}", point.phase_rad.to_degrees()),
            significant(point.x_m * 1e3, 4),
            significant(point.z_m * 1e3, 4),
            format!("{:.4}", point.natural_frequency_hz),
            half(point.frequency_95_hz),
            significant(zeta, 4),
            half(100.0 * point.damping_ratio_95),
            point.found.text().to_string(),
        ]
    };
    for curve in curves {
        curve.measured.iter().for_each(|point| rows.add(row(curve, point)));
    }
    rows
}
