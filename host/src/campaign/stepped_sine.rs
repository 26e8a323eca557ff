//! A stepped sine over a list of frequencies.

use std::f64::consts::TAU;
use std::ops::Range;

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::phase_lock::PhaseLock;
use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
use damprig_core::control::stepped_sine as core_sine;
use damprig_core::control::stepped_sine::{DriveMode, MAX_POINTS, MIN_CYCLES, Points};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::Structure;
use damprig_simulator::plant::Amplifier;

use super::RigSettings;
use super::keys::{
    closed_loop, grid, phase_lock, resonance_tracking, response_controlled, response_loop, steady, stepped_sine as keys,
};
use crate::input::key::Quantity;
use crate::input::section::Given;
use crate::input::{Number, Problem, Section};
use crate::settings::number_of;

/// How a point starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
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
    pub start: Start,
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

impl TrackedResonance {
    /// Whether a phase of x relative to z, rad, is within the tolerance of the one that is kept.
    #[must_use]
    pub fn is_locked(&self, phase_rad: f64) -> bool {
        (phase_rad - f64::from(self.lock.phase_rad)).abs() <= f64::from(self.lock.tolerance_rad)
    }
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
                Start::FromRest => core_sine::Start::FromRest { level_m: self.rest_level_m as f32 },
                Start::CarryOver => core_sine::Start::CarryOver,
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

/// Reads a stepped sine that drives the base; `rig` is `None` when it could not be read, `structures` are those of its set-ups.
pub(super) fn read(section: &Section, rig: Option<&RigSettings>, structures: &[Structure]) -> Option<SteppedSine> {
    let sine = read_points(section, structures);
    let (drive, drive_limit) = read_drive(section, rig)?;
    Some(SteppedSine { drive, drive_limit, ..sine? })
}

/// Reads stepped sines that keep the response, one for each amplitude; arguments as for [`read`].
pub(super) fn read_response_controlled(
    section: &Section,
    rig: Option<&RigSettings>,
    structures: &[Structure],
) -> Option<Vec<SteppedSine>> {
    let sine = read_points(section, structures);
    let loops = read_loops(section, rig)?;
    let sine = sine?;
    if !sine.peak_order.is_empty() {
        let allowed = "belongs to stepped sines that drive the base: at a constant response there is no peak of X/Z";
        section.reject("peak_points", allowed, Some("leave it out".into()));
        return None;
    }
    let (drive_limit, all) = loops;
    let of = |(drive, kept)| SteppedSine { drive, drive_limit: drive_limit.clone(), kept: Some(kept), ..sine.clone() };
    Some(all.into_iter().map(of).collect())
}

/// Reads a stepped sine that follows a resonance; arguments as for [`read`].
pub(super) fn read_tracking(section: &Section, rig: Option<&RigSettings>) -> Option<SteppedSine> {
    let (from, to) = (section.placed(&resonance_tracking::FROM), section.placed(&resonance_tracking::TO));
    let start = section.placed(&resonance_tracking::START_FREQUENCY);
    let lowest_hz = from.as_ref().map(|from| from.value);
    let times = read_times(section, || lowest_hz);
    let table = section.part(&resonance_tracking::PHASE_LOCK)?;
    let (phase, gain) = (table.scalar(&phase_lock::PHASE), table.scalar(&phase_lock::GAIN));
    let (tolerance, wait) = (table.scalar(&phase_lock::TOLERANCE), table.scalar(&phase_lock::WAIT));
    table.finish();
    let (key, amplitudes) = amplitudes(section, &resonance_tracking::AMPLITUDES)?;
    let (drive, drive_limit) = match quantity(key, 1.0) {
        None => {
            refuse_other(section, resonance_tracking::RESPONSE_LOOP.name(), "belongs to amplitudes of the response");
            let read = read_drive(section, rig)?;
            if read.0 == DriveMode::Constant && rig.is_some_and(|rig| rig.shaker.is_some()) {
                let allowed = "must keep the base on a shaker: a base that yields to the structure turns its phase";
                section.reject("drive", allowed, Some("write drive = \"closed_loop\"".into()));
                return None;
            }
            read
        }
        Some(_) => {
            for name in [keys::DRIVE.name(), keys::CLOSED_LOOP.name()] {
                refuse_other(section, name, "belongs to base_amplitudes_m: a loop keeps the response's amplitude");
            }
            let table = section.part(&resonance_tracking::RESPONSE_LOOP)?;
            let (limit, of) = read_loop(section, &table, rig)?;
            (of(quantity(key, amplitudes.first()?.value)?), limit)
        }
    };
    let (from, to) = (from?, to?);
    if to.value <= from.value {
        section.refuse("to_hz", &to.span, format!("must be above from_hz = {}", from.value), None);
        return None;
    }
    if let Some(start) = start.as_ref().filter(|start| !(from.value..=to.value).contains(&start.value)) {
        section.refuse("start_hz", &start.span, format!("must be from {} to {} Hz", from.value, to.value), None);
        return None;
    }
    let new = PhaseLock::new(from.value as f32, to.value as f32);
    let lock = PhaseLock {
        phase_rad: phase?.to_radians() as f32,
        start_hz: start.map_or(new.start_hz, |start| start.value as f32),
        gain_per_cycle: gain? as f32,
        tolerance_rad: tolerance?.to_radians() as f32,
        wait_s: wait? as f32,
        ..new
    };
    Some(SteppedSine { tracked: Some(TrackedResonance { lock, key, amplitudes }), drive, drive_limit, ..times? })
}

/// Reports a key that the other keys leave without a meaning.
fn refuse_other(section: &Section, name: &'static str, allowed: &'static str) {
    if section.has_own(name) {
        section.reject(name, allowed, Some("leave it out".into()));
    }
}

/// Frequencies and times of a stepped sine at constant drive.
fn read_points(section: &Section, structures: &[Structure]) -> Option<SteppedSine> {
    let mut found = None;
    let times = read_times(section, || {
        refuse_misplaced(section);
        found = frequencies(section, structures);
        Some(found.as_ref()?.0.iter().copied().fold(f64::INFINITY, f64::min))
    });
    let (frequencies_hz, peak_points) = found?;
    Some(SteppedSine { frequencies_hz, peak_order: (0..peak_points).collect(), ..times? })
}

/// The times of a stepped sine at constant drive; `lowest_hz` reads its lowest frequency.
fn read_times(section: &Section, lowest_hz: impl FnOnce() -> Option<f64>) -> Option<SteppedSine> {
    let start = section.word(&keys::START);
    let settle_s = section.scalar(&keys::SETTLE);
    let dwell = section.placed(&keys::DWELL);
    let rest_level_m = section.scalar(&keys::REST_LEVEL);
    let lowest_hz = lowest_hz();
    let steady = read_steady(section, dwell.as_ref());
    if let (Some(dwell), Some(lowest)) = (&dwell, lowest_hz)
        && dwell.value * lowest < f64::from(MIN_CYCLES)
    {
        let allowed = format!("must hold {MIN_CYCLES} periods of the lowest frequency, {lowest} Hz");
        let help = Some(format!("write dwell_s = {} or more", (1e3 * f64::from(MIN_CYCLES) / lowest).ceil() / 1e3));
        section.refuse("dwell_s", &dwell.span, allowed, help);
    }
    let ramp = section.placed(&keys::RAMP);
    if let (Some(ramp), Some(settle_s)) = (&ramp, settle_s)
        && ramp.value > settle_s
    {
        let allowed = format!("must be from 0 to settle_s = {settle_s}: nothing is measured on the ramp");
        section.refuse("ramp_s", &ramp.span, allowed, None);
    }
    Some(SteppedSine {
        frequencies_hz: Vec::new(),
        tracked: None,
        peak_order: Vec::new(),
        start: if start? == 0 { Start::FromRest } else { Start::CarryOver },
        drive: DriveMode::Constant,
        drive_limit: None,
        kept: None,
        ramp_s: ramp?.value,
        settle_s: settle_s?,
        dwell_s: dwell?.value,
        rest_level_m: rest_level_m?,
        steady: steady?,
    })
}

/// Reports `peak_points` beside `frequencies_hz` instead of in it.
fn refuse_misplaced(section: &Section) {
    let key = grid::PEAK_POINTS.name();
    if section.has_own(key) {
        let allowed = "belongs in the grid of frequencies_hz: a list has no points around its peak";
        let help = "write frequencies_hz = { from_hz = 2.0, to_hz = 3.0, step_hz = 0.05, peak_points = 8 }";
        section.reject(key, allowed, Some(help.into()));
    }
}

/// A list of numbers, or a grid; and the number of points around its peak.
fn frequencies(section: &Section, structures: &[Structure]) -> Option<(Vec<f64>, usize)> {
    match section.given(&keys::FREQUENCIES)? {
        (_, Given::Numbers(list)) => Some((listed(section, &list)?, 0)),
        (_, Given::Table(table)) => {
            let (from, to, step) = (table.scalar(&grid::FROM), table.scalar(&grid::TO), table.placed(&grid::STEP));
            let resonance_points = table.scalar(&grid::RESONANCE_POINTS).map(|points| points as usize);
            let peak_points = table.scalar(&grid::PEAK_POINTS).map_or(0, |points| points as usize);
            table.finish();
            let even = spread(&table, from?, to?, &step?)?;
            let list = refine(&table, even, resonance_points, structures)?;
            if peak_points > 0 && list.len() < 2 {
                let allowed = "needs a grid of at least two frequencies: the points lie between neighbours";
                table.reject(grid::PEAK_POINTS.name(), allowed, Some("leave it out, or widen the grid".into()));
                return None;
            }
            Some((list, peak_points))
        }
        _ => None,
    }
}

fn listed(section: &Section, list: &[Number]) -> Option<Vec<f64>> {
    let key = keys::FREQUENCIES.name();
    if list.is_empty() {
        section.reject(key, "must hold at least one frequency", Some("write frequencies_hz = [2.5]".into()));
        return None;
    }
    if list.len() > MAX_POINTS {
        // The value itself would fill pages.
        section.source().report(Problem {
            title: format!("`{}` holds {} frequencies", section.full(key), list.len()),
            span: section.span_of(key),
            allowed: format!("the controller holds at most {MAX_POINTS}"),
            help: Some("divide them among several experiments".into()),
        });
        return None;
    }
    Some(list.iter().map(|n| n.value).collect())
}

fn spread(grid: &Section, from: f64, to: f64, step: &Number) -> Option<Vec<f64>> {
    if (to - from) * step.value < 0.0 {
        let help = Some(format!("write step_hz = {}", -step.value));
        grid.refuse("step_hz", &step.span, format!("must lead from {from} to {to} Hz"), help);
        return None;
    }
    // Tolerates the rounding of decimal fractions at the grid's end.
    let steps = ((to - from) / step.value + 1e-6).floor();
    if steps + 1.0 > MAX_POINTS as f64 {
        grid.refuse(
            "step_hz",
            &step.span,
            format!("would give {} points; the controller holds {MAX_POINTS}", steps + 1.0),
            None,
        );
        return None;
    }
    Some((0..=steps as usize).map(|i| to_nine_places(from + i as f64 * step.value)).collect())
}

/// So that 2 + 7 × 0.05 is written 2.35.
pub(super) fn to_nine_places(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// Adds `points` frequencies over the half-power bandwidth of each structure that lies within the grid, in the grid's direction.
fn refine(table: &Section, even: Vec<f64>, points: Option<usize>, structures: &[Structure]) -> Option<Vec<f64>> {
    let Some(points) = points else { return Some(even) };
    let (Some(&first), Some(&last)) = (even.first(), even.last()) else { return Some(even) };
    let even_count = even.len();
    let mut all = even;
    if structures.is_empty() {
        // They could not be read.
        return Some(all);
    }
    for structure in structures.iter().filter(|structure| structure.damping_n_s_per_m > 0.0) {
        let natural_hz = structure.angular_frequency_rad_per_s() / TAU;
        let at =
            |n: usize| natural_hz * (1.0 + structure.damping_ratio() * (2.0 * n as f64 / (points - 1) as f64 - 1.0));
        let within = |f: &f64| (first.min(last)..=first.max(last)).contains(f);
        all.extend((0..points).map(at).map(to_nine_places).filter(within));
    }
    let before = all.len();
    all.sort_by(f64::total_cmp);
    all.dedup();
    if before == even_count {
        let allowed =
            "adds no frequency: no structure has its half-power bandwidth, fn(1 − ζ) to fn(1 + ζ), within the grid";
        table.reject(grid::RESONANCE_POINTS.name(), allowed, Some("leave it out, or widen the grid".into()));
        return None;
    }
    if first > last {
        all.reverse();
    }
    if all.len() > MAX_POINTS {
        let allowed = format!("would give {} points; the controller holds {MAX_POINTS}", all.len());
        table.reject(grid::RESONANCE_POINTS.name(), allowed, None);
        return None;
    }
    Some(all)
}

/// `drive`, and the `closed_loop` table of one of its two values.
fn read_drive(section: &Section, rig: Option<&RigSettings>) -> Option<(DriveMode, Option<Number>)> {
    let is_closed = section.word(&keys::DRIVE) == Some(1);
    if !is_closed {
        // Reports a table that would do nothing.
        section.given(&keys::CLOSED_LOOP);
        return Some((DriveMode::Constant, None));
    }
    let table = section.part(&keys::CLOSED_LOOP)?;
    let (gain, tolerance) = (table.scalar(&closed_loop::GAIN), table.scalar(&closed_loop::TOLERANCE));
    let (wait, limit) = (table.scalar(&closed_loop::WAIT), table.placed(&closed_loop::DRIVE_LIMIT));
    table.finish();
    let Some(shaker) = &rig?.shaker else {
        let help = Some("add a `[rig.shaker]` table (it may be empty), or write drive = \"constant\"".into());
        section.reject("drive", "needs a shaker that feels its load", help);
        return None;
    };
    let default = ClosedLoop::default();
    let parameters = ClosedLoop {
        gain_per_s: gain? as f32,
        calibrated_at_hz: shaker.calibrated_at_hz as f32,
        tolerance: tolerance? as f32,
        wait_s: wait? as f32,
        drive_limit_m: limit.as_ref().map_or(default.drive_limit_m, |n| n.value as f32),
    };
    Some((DriveMode::ClosedLoop(parameters), limit))
}

/// The stated drive limit, and the loop of each amplitude with the amplitude as written.
type Loops = (Option<Number>, Vec<(DriveMode, KeptAmplitude)>);

/// The amplitudes of a response, and its `response_loop`.
fn read_loops(section: &Section, rig: Option<&RigSettings>) -> Option<Loops> {
    let table = section.part(&response_controlled::RESPONSE_LOOP)?;
    let read = read_loop(section, &table, rig);
    let (key, list) = amplitudes(section, &response_controlled::AMPLITUDES)?;
    // As the controller gets them.
    let is_repeated = |n: usize| list[..n].iter().any(|before| before.value as f32 == list[n].value as f32);
    if let Some(repeated) = (1..list.len()).find(|n| is_repeated(*n)) {
        let help = Some("write repeats = 2 to measure it twice".into());
        section.refuse(key, &list[repeated].span, "holds the same amplitude twice", help);
        return None;
    }
    let (limit, of) = read?;
    let loop_of = |amplitude: Number| Some((of(quantity(key, amplitude.value)?), KeptAmplitude { key, amplitude }));
    Some((limit, list.into_iter().map(loop_of).collect::<Option<_>>()?))
}

/// The key and the values of a list of amplitudes.
fn amplitudes(section: &Section, declared: &Quantity) -> Option<(&'static str, Vec<Number>)> {
    let (place, given) = section.given(declared)?;
    let (name, Given::Numbers(list)) = (declared.keys[place].name, given) else { return None };
    if list.is_empty() {
        section.reject(name, "must hold at least one amplitude", Some(format!("write {name} = [0.01]")));
        return None;
    }
    if list.len() > MAX_POINTS {
        let allowed = format!("holds {} amplitudes; the controller holds at most {MAX_POINTS}", list.len());
        section.reject(name, allowed, Some("divide them among several experiments".into()));
        return None;
    }
    Some((name, list))
}

/// The response of a key of amplitudes, at one of them; `None` of amplitudes of the base.
fn quantity(key: &str, amplitude: f64) -> Option<KeptQuantity> {
    match key {
        "x_amplitudes_m" => Some(KeptQuantity::Displacement { amplitude_m: amplitude as f32 }),
        "velocity_amplitudes_m_per_s" => Some(KeptQuantity::Velocity { amplitude_m_per_s: amplitude as f32 }),
        "relative_amplitudes_m" => Some(KeptQuantity::Relative { amplitude_m: amplitude as f32 }),
        _ => None,
    }
}

/// The stated drive limit, and the loop for a response.
type LoopOf = (Option<Number>, Box<dyn Fn(KeptQuantity) -> DriveMode>);

/// The loop that keeps a response, from its `response_loop`.
fn read_loop(section: &Section, table: &Section, rig: Option<&RigSettings>) -> Option<LoopOf> {
    let (gain, tolerance) = (table.scalar(&response_loop::GAIN), table.scalar(&response_loop::TOLERANCE));
    let (wait, limit) = (table.scalar(&response_loop::WAIT), table.placed(&response_loop::DRIVE_LIMIT));
    table.finish();
    let limit_m = limit.as_ref().map(|limit| limit.value as f32);
    let base = match &rig?.shaker {
        Some(shaker) if shaker.amplifier == Amplifier::Current => {
            let help = Some("write amplifier = \"voltage\" in [rig.shaker], if it is one".into());
            section.reject("kind", "needs a shaker in voltage mode, a source of velocity", help);
            return None;
        }
        Some(shaker) => {
            let default = ClosedLoop::default();
            let drive_limit_m = limit_m.unwrap_or(default.drive_limit_m);
            Some(ClosedLoop { calibrated_at_hz: shaker.calibrated_at_hz as f32, drive_limit_m, ..default })
        }
        None => None,
    };
    let (gain_per_cycle, tolerance, wait_s) = (gain? as f32, tolerance? as f32, wait? as f32);
    let of = move |response: KeptQuantity| {
        let new = ResponseLoop::new(response, base);
        let drive_limit_m = limit_m.unwrap_or(new.drive_limit_m);
        DriveMode::Response(ResponseLoop { gain_per_cycle, tolerance, wait_s, drive_limit_m, ..new })
    };
    Some((limit, Box::new(of)))
}

fn read_steady(section: &Section, dwell: Option<&Number>) -> Option<SteadyLimits> {
    let table = section.part(&keys::STEADY)?;
    let (tolerance, scatter) = (table.scalar(&steady::TOLERANCE), table.scalar(&steady::SCATTER));
    let longest = table.placed(&steady::LONGEST_DWELL);
    if let (Some(longest), Some(dwell)) = (&longest, dwell)
        && longest.value < dwell.value
    {
        let allowed = format!("must be at least dwell_s = {}: the time of all dwells of a point", dwell.value);
        table.refuse("longest_dwell_s", &longest.span, allowed, None);
    }
    table.finish();
    Some(SteadyLimits {
        tolerance: tolerance? as f32,
        scatter: scatter? as f32,
        longest_dwell_s: longest.map_or(SteadyLimits::default().longest_dwell_s, |n| n.value as f32),
    })
}
