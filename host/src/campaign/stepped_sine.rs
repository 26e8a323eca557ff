//! A stepped sine over a list of frequencies.

use std::f64::consts::TAU;

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::stepped_sine::{DriveMode, MAX_POINTS, MIN_CYCLES};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::Structure;

use super::RigSettings;
use super::keys::{closed_loop, grid, steady, stepped_sine as keys};
use crate::input::section::Given;
use crate::input::{Number, Problem, Section};

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
    /// The frequencies in the order they are run, Hz.
    pub frequencies_hz: Vec<f64>,
    /// The points around the measured peak in the order they are run, each as its place in the grid's direction; empty without any.
    pub peak_order: Vec<usize>,
    /// How each point starts.
    pub start: Start,
    /// Open or closed loop. The drive limit of a closed loop applies only if `drive_limit` is given.
    pub drive: DriveMode,
    /// The stated drive limit of a closed loop, m, and its place; without one it is the range of the rig's drive.
    pub drive_limit: Option<Number>,
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

impl SteppedSine {
    /// Longest time of all dwells of a point, s: `dwell_s`, or more if a point is measured again until it is steady.
    #[must_use]
    pub fn longest_dwell_s(&self) -> f64 {
        self.dwell_s.max(f64::from(self.steady.longest_dwell_s))
    }
}

/// Reads a stepped sine; `rig` is `None` when it could not be read, `structures` are those of its set-ups.
pub(super) fn read(section: &Section, rig: Option<&RigSettings>, structures: &[Structure]) -> Option<SteppedSine> {
    let start = section.word(&keys::START);
    let settle_s = section.scalar(&keys::SETTLE);
    let dwell = section.placed(&keys::DWELL);
    let rest_level_m = section.scalar(&keys::REST_LEVEL);
    refuse_misplaced(section);
    let frequencies = frequencies(section, structures);
    let steady = read_steady(section, dwell.as_ref());
    if let (Some(dwell), Some((list, _))) = (&dwell, &frequencies) {
        let lowest = list.iter().copied().fold(f64::INFINITY, f64::min);
        if dwell.value * lowest < f64::from(MIN_CYCLES) {
            let allowed = format!("must hold {MIN_CYCLES} periods of the lowest frequency, {lowest} Hz");
            let help = Some(format!("write dwell_s = {} or more", f64::from(MIN_CYCLES) / lowest));
            section.refuse("dwell_s", &dwell.span, allowed, help);
        }
    }
    let ramp = section.placed(&keys::RAMP);
    if let (Some(ramp), Some(settle_s)) = (&ramp, settle_s)
        && ramp.value > settle_s
    {
        let allowed = format!("must be from 0 to settle_s = {settle_s}: nothing is measured on the ramp");
        section.refuse("ramp_s", &ramp.span, allowed, None);
    }
    let (drive, drive_limit) = read_drive(section, rig)?;
    let (frequencies_hz, peak_points) = frequencies?;
    Some(SteppedSine {
        frequencies_hz,
        peak_order: (0..peak_points).collect(),
        start: if start? == 0 { Start::FromRest } else { Start::CarryOver },
        drive,
        drive_limit,
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
    Some((0..=steps as usize).map(|i| to_nanohertz(from + i as f64 * step.value)).collect())
}

/// So that 2 + 7 × 0.05 is written 2.35.
pub(super) fn to_nanohertz(frequency_hz: f64) -> f64 {
    (frequency_hz * 1e9).round() / 1e9
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
        all.extend((0..points).map(at).map(to_nanohertz).filter(within));
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
