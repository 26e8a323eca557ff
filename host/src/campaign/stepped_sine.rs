//! A stepped sine over a list of frequencies.

use damprig_core::control::base_loop::{ClosedLoop, MOST_GAIN_PER_S};
use damprig_core::control::stepped_sine::{DriveMode, FEWEST_CYCLES, FEWEST_TICKS_PER_CYCLE, MOST_POINTS};
use damprig_core::io::TICK_HZ;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_simulator::plant::Shaker;

use super::usual;
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

/// Longest time of all dwells of a point, s: the controller counts 10⁹ ticks.
const LONGEST_DWELL_S: f64 = 1e6;

/// A tenth of a millimetre.
pub(super) const REST_LEVEL_M: f64 = 1e-4;

/// The highest drive frequency, Hz.
fn highest_hz() -> f64 {
    f64::from(TICK_HZ / FEWEST_TICKS_PER_CYCLE)
}

/// Reads a stepped sine; `shaker` is the campaign's, if it has one.
pub(super) fn read(section: &Section, shaker: Option<&Shaker>) -> Option<SteppedSine> {
    let start = section.required("start", "write start = \"from_rest\" or \"carry_over\"", |s, key| {
        s.choice(key, &["from_rest", "carry_over"])
    });
    let settle = section.not_negative("settle_s");
    let dwell = section.required("dwell_s", "the time that is measured at each frequency", Section::positive);
    let rest = section.positive("rest_level_m");
    let frequencies = section.required("frequencies_hz", "a list, or { from_hz, to_hz, step_hz }", frequencies);
    let steady = read_steady(section, dwell.as_ref());
    if let (Some(dwell), Some(list)) = (&dwell, &frequencies) {
        let lowest = list.iter().copied().fold(f64::INFINITY, f64::min);
        if dwell.value * lowest < f64::from(FEWEST_CYCLES) {
            let allowed = format!("must hold {FEWEST_CYCLES} periods of the lowest frequency, {lowest} Hz");
            let help = Some(format!("write dwell_s = {} or more", f64::from(FEWEST_CYCLES) / lowest));
            section.refuse("dwell_s", &dwell.span, allowed, help);
        }
    }
    let settle_s = settle.as_ref().map_or(0.0, |n| n.value);
    let allowed = format!("from 0 to settle_s = {settle_s}: nothing is measured on the ramp");
    let ramp = section.number_if("ramp_s", |v| (0.0..=settle_s).contains(&v), &allowed);
    let (drive, drive_limit) = read_drive(section, shaker)?;
    Some(SteppedSine {
        frequencies_hz: frequencies?,
        start: if start? == 0 { Start::FromRest } else { Start::CarryOver },
        drive,
        drive_limit,
        ramp_s: ramp.map_or(0.0, |n| n.value),
        settle_s,
        dwell_s: dwell?.value,
        rest_level_m: rest.map_or(REST_LEVEL_M, |n| n.value),
        steady,
    })
}

/// A list of numbers, or a grid.
fn frequencies(section: &Section, key: &'static str) -> Option<Vec<f64>> {
    if !section.is_table(key) {
        let list = section.numbers(key)?;
        if list.is_empty() {
            section.reject(key, "must hold at least one frequency", Some("write frequencies_hz = [2.5]".into()));
            return None;
        }
        if list.len() > MOST_POINTS {
            // The value itself would fill pages.
            section.source().report(Problem {
                title: format!("`{}` holds {} frequencies", section.full(key), list.len()),
                span: section.span_of(key),
                allowed: format!("the controller holds at most {MOST_POINTS}"),
                help: Some("divide them among several experiments".into()),
            });
            return None;
        }
        let refused = list.iter().filter(|n| !sound(section, key, n)).count();
        return (refused == 0).then(|| list.iter().map(|n| n.value).collect());
    }
    let grid = section.table(key, None)?;
    let from = grid.required("from_hz", "the first frequency", Section::number);
    let to = grid.required("to_hz", "the last frequency", Section::number);
    let step = grid.required("step_hz", "the step", Section::number);
    let list = match (from, to, step) {
        (Some(from), Some(to), Some(step)) => spread(&grid, &from, &to, &step),
        _ => None,
    };
    grid.warn_of_unusual(usual::GRID);
    grid.finish();
    list
}

fn spread(grid: &Section, from: &Number, to: &Number, step: &Number) -> Option<Vec<f64>> {
    let ends = [sound(grid, "from_hz", from), sound(grid, "to_hz", to)];
    if step.value == 0.0 {
        grid.refuse(
            "step_hz",
            &step.span,
            "must not be 0",
            Some("for one frequency write frequencies_hz = [2.5]".into()),
        );
        return None;
    }
    if (to.value - from.value) * step.value < 0.0 {
        let help = Some(format!("write step_hz = {}", -step.value));
        grid.refuse("step_hz", &step.span, format!("must lead from {} to {} Hz", from.value, to.value), help);
        return None;
    }
    // Tolerates the rounding of decimal fractions at the grid's end.
    let steps = ((to.value - from.value) / step.value + 1e-6).floor();
    if steps + 1.0 > MOST_POINTS as f64 {
        grid.refuse(
            "step_hz",
            &step.span,
            format!("would give {} points; the controller holds {MOST_POINTS}", steps + 1.0),
            None,
        );
        return None;
    }
    // To the nanohertz, so that 2 + 7 × 0.05 is written 2.35.
    let at = |i: usize| ((from.value + i as f64 * step.value) * 1e9).round() / 1e9;
    (ends == [true, true]).then(|| (0..=steps as usize).map(at).collect())
}

/// Whether a drive frequency is allowed at the tick rate.
fn sound(section: &Section, key: &str, frequency: &Number) -> bool {
    let highest = highest_hz();
    let ok = frequency.value > 0.0 && frequency.value <= highest;
    if !ok {
        let allowed = format!(
            "must be above 0 and at most {highest} Hz: the controller's tick of {} Hz gives a period {FEWEST_TICKS_PER_CYCLE} samples there",
            TICK_HZ
        );
        section.refuse(key, &frequency.span, allowed, None);
    }
    ok
}

/// `drive`, and the `closed_loop` table of one of its two values.
fn read_drive(section: &Section, shaker: Option<&Shaker>) -> Option<(DriveMode, Option<Number>)> {
    let is_closed = section.choice("drive", &["constant", "closed_loop"]) == Some(1);
    if !is_closed {
        return Some((DriveMode::Constant, None));
    }
    let Some(shaker) = shaker else {
        let help = Some("add a `[rig.shaker]` table (it may be empty), or write drive = \"constant\"".into());
        let span = section.text("drive").map_or(section.span(), |text| text.span);
        section.refuse("drive", &span, "needs a shaker that feels its load", help);
        return None;
    };
    let default = ClosedLoop { calibrated_at_hz: shaker.calibrated_at_hz as f32, ..ClosedLoop::default() };
    let Some(table) = section.table("closed_loop", None) else { return Some((DriveMode::ClosedLoop(default), None)) };
    let most = f64::from(MOST_GAIN_PER_S);
    let gain = table.number_if(
        "gain_per_s",
        |v| v > 0.0 && v <= most,
        &format!("greater than 0 and at most {most} per second"),
    );
    let tolerance = table.number_if("tolerance", |v| (0.001..=0.5).contains(&v), "from 0.001 to 0.5");
    let wait = table.number_if("wait_s", |v| (0.0..=3600.0).contains(&v), "from 0 to 3600");
    let limit = table.positive("drive_limit_m");
    let parameters = ClosedLoop {
        gain_per_s: gain.map_or(default.gain_per_s, |n| n.value as f32),
        tolerance: tolerance.map_or(default.tolerance, |n| n.value as f32),
        wait_s: wait.map_or(default.wait_s, |n| n.value as f32),
        drive_limit_m: limit.as_ref().map_or(default.drive_limit_m, |n| n.value as f32),
        ..default
    };
    table.finish();
    Some((DriveMode::ClosedLoop(parameters), limit))
}

fn read_steady(section: &Section, dwell: Option<&Number>) -> SteadyLimits {
    let default = SteadyLimits::default();
    let Some(table) = section.table("steady", None) else { return default };
    let tolerance = table.number_if("tolerance", |v| v > 0.0 && v < 1.0, "greater than 0 and less than 1");
    let scatter = table.positive("scatter");
    let dwell_s = dwell.map_or(0.0, |dwell| dwell.value);
    let allowed = format!("from dwell_s = {dwell_s} to {LONGEST_DWELL_S}: the time of all dwells of a point");
    let longest = table.number_if("longest_dwell_s", |v| (dwell_s..=LONGEST_DWELL_S).contains(&v), &allowed);
    table.finish();
    SteadyLimits {
        tolerance: tolerance.map_or(default.tolerance, |n| n.value as f32),
        scatter: scatter.map_or(default.scatter, |n| n.value as f32),
        longest_dwell_s: longest.map_or(default.longest_dwell_s, |n| n.value as f32),
    }
}
