//! Draws the measured motion at the peak of each frequency response: x over the last cycles with its impacts, the phase plane, and the
//! Poincaré section.

use std::collections::BTreeMap;

use damprig_core::io::TICK_HZ;

use super::campaign::{look_of, shortened, stepped_sines};
use crate::campaign::Campaign;
use crate::failure::Failure;
use crate::report::describe;
use crate::report::numbers::trimmed;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::palette::{GREY, INK, Look};
use crate::report::plot::svg::Font;
use crate::report::plot::traces::Traces;
use crate::report::plot::{LABEL, Picture};
use crate::run_folder::schema::journal_state::JournalState;
use crate::run_folder::{ResultRow, RunFolder};
use crate::table::values::{numbers, texts};

/// Most motions of a figure, the first ones: their picture is 12 000 points high.
const MAX_MOTIONS: usize = 40;

/// Cycles of the time history.
const CYCLES: f64 = 8.0;

/// Fewest samples of a cycle from which a velocity is computed: its error is (Ωh)⁴/30, 0.03 % of its amplitude.
const MIN_SAMPLES: f64 = 20.0;

/// Most samples of a dwell that are used, its last ones.
const MAX_SAMPLES: usize = 60_000;

/// Points of all phase planes of a figure together.
const IN_PHASE_PLANES: usize = 60_000;

/// Points of a cycle in a phase plane, at least, so that few samples do not look like corners.
const POINTS_OF_A_CYCLE: f64 = 80.0;

const WIDTH: f64 = 1040.0;
const LEFT: f64 = 82.0;
const TOP: f64 = 34.0;
const HIGH: f64 = 210.0;
const GAP: f64 = 96.0;
/// Left and right ends of the three panels.
const PANELS: [(f64, f64); 3] = [(LEFT, 480.0), (564.0, 770.0), (846.0, WIDTH - 16.0)];

/// The samples of a dwell.
#[derive(Debug, Default)]
struct Dwell {
    ticks: Vec<f64>,
    x_mm: Vec<f64>,
    z_mm: Vec<f64>,
}

/// A motion to draw.
struct DrawnMotion<'a> {
    title: String,
    look: Look,
    row: &'a ResultRow,
    dwell: &'a Dwell,
    /// Ticks (with their fraction) and sides of the impacts.
    impacts: Vec<(f64, i8)>,
    tick_hz: f64,
}

type PointKey = (String, String, u32);

/// Draws a line of panels for each experiment on each set-up; `None` if x was not recorded often enough at any peak.
///
/// # Errors
/// Unreadable samples.
pub fn draw(campaign: &Campaign, run: &RunFolder, taken: &JournalState) -> Result<Option<Picture>, Failure> {
    let peaks: Vec<(String, Look, &ResultRow)> = stepped_sines(campaign)
        .filter(|(_, experiment)| experiment.repeat == 0)
        .take(MAX_MOTIONS)
        .filter_map(|(set_up, experiment)| {
            let is_repeat =
                |name: &str| campaign.experiments.iter().any(|e| e.name == name && e.series == experiment.series);
            let own = taken.rows().iter().filter(|r| r.set_up == set_up.name && is_repeat(&r.experiment));
            let peak = own.filter(|r| r.x_over_z().is_finite()).max_by(|a, b| a.x_over_z().total_cmp(&b.x_over_z()))?;
            let at = trimmed(peak.frequency_hz, 4);
            let (what, ratio) = (describe::set_up(set_up), trimmed(peak.x_over_z(), 2));
            let title = format!("{} ({what}), {}: {at} Hz, X/Z = {ratio}", shortened(&set_up.label), peak.experiment);
            Some((title, look_of(campaign, set_up, experiment), peak))
        })
        .collect();
    let dwells = dwells(run, &peaks)?;
    let motions: Vec<DrawnMotion> = peaks
        .iter()
        .filter_map(|(title, look, row)| {
            let dwell = dwells.get(&key(row))?;
            let is_own = |id: &crate::run_folder::schema::segment_id::SegmentId| {
                (&id.set_up, &id.experiment, id.segment) == (&row.set_up, &row.experiment, row.segment)
            };
            let own = taken.impacts.iter().filter(|some| is_own(&some.id)).flat_map(|some| &some.impacts);
            let impacts = own.map(|i| (f64::from(i.tick) + f64::from(i.centre_ticks), i.side)).collect();
            let motion =
                DrawnMotion { title: title.clone(), look: *look, row, dwell, impacts, tick_hz: f64::from(TICK_HZ) };
            (motion.samples_in_a_cycle() >= MIN_SAMPLES).then_some(motion)
        })
        .collect();
    if motions.is_empty() {
        return Ok(None);
    }
    let mut picture = Picture::new(WIDTH, TOP + motions.len() as f64 * (HIGH + GAP) - GAP + 64.0);
    for (motion, n) in motions.iter().zip(0u32..) {
        let top = TOP + f64::from(n) * (HIGH + GAP);
        picture.text(&motion.title, (LEFT, top - 8.0), Font::new(LABEL + 0.8, INK).above());
        motion.draw(&mut picture, top, IN_PHASE_PLANES / motions.len());
    }
    Ok(Some(picture))
}

fn key(row: &ResultRow) -> PointKey {
    (row.set_up.clone(), row.experiment.clone(), row.segment)
}

/// Reads the samples of the dwells of these points.
fn dwells(run: &RunFolder, peaks: &[(String, Look, &ResultRow)]) -> Result<BTreeMap<PointKey, Dwell>, Failure> {
    let wanted: BTreeMap<PointKey, &ResultRow> = peaks.iter().map(|(_, _, row)| (key(row), *row)).collect();
    let mut dwells: BTreeMap<PointKey, Dwell> = BTreeMap::new();
    for batch in run.samples() {
        let batch = batch.map_err(Failure::undrawn)?;
        let names = (texts(&batch, "set_up"), texts(&batch, "experiment"), numbers(&batch, "segment"));
        let (Ok(set_ups), Ok(experiments), Ok(segments)) = names else { continue };
        let (Ok(ticks), Ok(x_m)) = (numbers(&batch, "tick"), numbers(&batch, "x_m")) else { continue };
        let z_m = numbers(&batch, "z_m").unwrap_or_else(|_| vec![f64::NAN; ticks.len()]);
        let same = |a: usize, b: usize| {
            (&set_ups[a], &experiments[a], segments[a]) == (&set_ups[b], &experiments[b], segments[b])
        };
        let mut found = None;
        for n in 0..ticks.len() {
            if n == 0 || !same(n - 1, n) {
                let own = (set_ups[n].clone(), experiments[n].clone(), segments[n] as u32);
                found = wanted.get_key_value(&own);
            }
            let Some((own, row)) = found else { continue };
            if (row.start_tick as f64..row.end_tick as f64).contains(&ticks[n]) {
                let dwell = dwells.entry(own.clone()).or_default();
                dwell.ticks.push(ticks[n]);
                dwell.x_mm.push(x_m[n] * 1e3);
                dwell.z_mm.push(z_m[n] * 1e3);
            }
        }
    }
    for dwell in dwells.values_mut() {
        let early = dwell.ticks.len().saturating_sub(MAX_SAMPLES);
        [&mut dwell.ticks, &mut dwell.x_mm, &mut dwell.z_mm].into_iter().for_each(|list| drop(list.drain(..early)));
    }
    Ok(dwells)
}

impl Dwell {
    /// Ticks from sample to sample; `None` if they are not evenly spaced.
    fn spacing(&self) -> Option<f64> {
        let step = self.ticks.get(1)? - self.ticks[0];
        (step > 0.0 && self.ticks.windows(2).all(|pair| pair[1] - pair[0] == step)).then_some(step)
    }

    /// Velocities between the second sample and the last but one, from the two samples on either side, in mm a tick.
    fn velocities(&self, step: f64) -> Vec<f64> {
        let five = self.x_mm.windows(5);
        five.map(|x| (8.0 * (x[3] - x[1]) - (x[4] - x[0])) / (12.0 * step)).collect()
    }
}

/// The cubic through four values at −1, 0, 1 and 2, at `place` between 0 and 1.
fn between(values: [f64; 4], place: f64) -> f64 {
    let [a, b, c, d] = values;
    let (before, after, far) = (place + 1.0, place - 1.0, place - 2.0);
    -a * place * after * far / 6.0 + b * before * after * far / 2.0 - c * before * place * far / 2.0
        + d * before * place * after / 6.0
}

/// The path with this many points for each.
fn smooth(path: &[(f64, f64)], parts: u32) -> Vec<(f64, f64)> {
    let stretch = |four: &[(f64, f64)]| {
        let (x, v) = ([0, 1, 2, 3].map(|n| four[n].0), [0, 1, 2, 3].map(|n| four[n].1));
        (0..parts).map(move |n| f64::from(n) / f64::from(parts)).map(move |part| (between(x, part), between(v, part)))
    };
    path.windows(4).flat_map(stretch).collect()
}

impl DrawnMotion<'_> {
    fn samples_in_a_cycle(&self) -> f64 {
        self.dwell.spacing().map_or(0.0, |step| self.tick_hz / step / self.row.frequency_hz)
    }

    /// Positions (mm) and velocities (mm/s) of the samples that have a velocity.
    fn phase_plane(&self) -> Vec<(f64, f64)> {
        let Some(step) = self.dwell.spacing() else { return Vec::new() };
        let velocities = self.dwell.velocities(step);
        self.dwell.x_mm.iter().skip(2).zip(velocities).map(|(x, v)| (*x, v * self.tick_hz)).collect()
    }

    /// Position (mm) and velocity (mm/s) once in each period of the drive, counted from the first tick of the dwell, at which a period of
    /// the drive begins.
    fn section(&self, plane: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let (Some(step), Some(first)) = (self.dwell.spacing(), self.dwell.ticks.first()) else { return Vec::new() };
        let period = self.tick_hz / self.row.frequency_hz;
        let start = self.row.start_tick as f64;
        let from = ((first - start) / period).ceil().max(0.0);
        let at = |n: usize| {
            // Counted in samples of the plane, whose first is the third of the dwell.
            let place = (start + (from + n as f64) * period - first) / step - 2.0;
            let whole = place.floor();
            let four = plane.get((whole - 1.0).max(0.0) as usize..)?.get(..4)?;
            if whole < 1.0 {
                return Some((f64::NAN, f64::NAN));
            }
            let part = place - whole;
            Some((between(four.first_chunk()?.map(|p| p.0), part), between(four.first_chunk()?.map(|p| p.1), part)))
        };
        (0..).map_while(at).filter(|p| p.0.is_finite()).collect()
    }

    /// Draws the three panels.
    fn draw(&self, picture: &mut Picture, top: f64, most_points: usize) {
        let dwell = self.dwell;
        let end = self.row.end_tick as f64;
        let from = (end - CYCLES * self.tick_hz / self.row.frequency_hz).max(dwell.ticks[0]);
        let late = dwell.ticks.partition_point(|tick| *tick < from);
        let seconds = |tick: f64| (tick - from) / self.tick_hz;
        let over_time = |values: &[f64]| -> Vec<(f64, f64)> {
            dwell.ticks[late..].iter().map(|tick| seconds(*tick)).zip(values[late..].iter().copied()).collect()
        };
        let (x, z) = (over_time(&dwell.x_mm), over_time(&dwell.z_mm));
        let on_x = |tick: f64| {
            let after = dwell.ticks.partition_point(|known| *known < tick).clamp(1, dwell.ticks.len() - 1);
            let part = (tick - dwell.ticks[after - 1]) / (dwell.ticks[after] - dwell.ticks[after - 1]);
            dwell.x_mm[after - 1] + part.clamp(0.0, 1.0) * (dwell.x_mm[after] - dwell.x_mm[after - 1])
        };
        let shown = self.impacts.iter().filter(|(tick, _)| (from..end).contains(tick));
        let impacts = shown.map(|(tick, side)| (seconds(*tick), on_x(*tick), *side));
        let plane = self.phase_plane();
        let section = self.section(&plane);
        let parts = (POINTS_OF_A_CYCLE / self.samples_in_a_cycle()).ceil().max(1.0) as u32;
        let late_plane = smooth(&plane[plane.len().saturating_sub(most_points / parts as usize)..], parts);
        let speeds = Axis::around("x\u{2032} (mm/s)", Scale::Linear, plane.iter().map(|p| p.1));
        let positions = |label: &str| Axis::around(label, Scale::Linear, plane.iter().map(|p| p.0));
        let bounds = |n: usize| (PANELS[n].0, top, PANELS[n].1, top + HIGH);
        let time = Axis::between("Time (s)", 0.0, seconds(end));
        let both = x.iter().chain(&z).map(|p| p.1);
        let frames = [
            PlotFrame { x: time, y: Axis::around("x, z (mm)", Scale::Linear, both), bounds: bounds(0) },
            PlotFrame { x: positions("x (mm)"), y: speeds.clone(), bounds: bounds(1) },
            PlotFrame { x: positions("x once a period (mm)"), y: speeds, bounds: bounds(2) },
        ];
        let tint = self.look.colour();
        let [mut history, mut phase, mut poincare] = frames.each_ref().map(Traces::new);
        history.history(&z, GREY.stroke(1.0));
        history.history(&x, tint.stroke(1.3));
        history.impacts(impacts, INK);
        phase.line(late_plane, tint.stroke(0.6));
        section.into_iter().for_each(|at| poincare.dot(at, 2.0, tint));
        for (frame, traces) in frames.iter().zip([history, phase, poincare]) {
            picture.panel(frame, &traces.svg());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// A sine of 10 mm at 2.5 Hz with a lag, sampled every 20 ticks of 1 kHz: 20 samples a cycle.
    fn sine(lag: f64) -> (Dwell, ResultRow) {
        let mut dwell = Dwell::default();
        for n in 0..400 {
            let tick = 1_000.0 + 20.0 * f64::from(n);
            dwell.ticks.push(tick);
            dwell.x_mm.push(10.0 * (TAU * 2.5e-3 * (tick - 1_000.0) - lag).sin());
            dwell.z_mm.push(0.0);
        }
        let row = ResultRow { frequency_hz: 2.5, start_tick: 1_000, end_tick: 9_000, ..ResultRow::default() };
        (dwell, row)
    }

    fn motion<'a>(dwell: &'a Dwell, row: &'a ResultRow) -> DrawnMotion<'a> {
        DrawnMotion {
            title: String::new(),
            look: Look::default(),
            row,
            dwell,
            impacts: vec![(8_990.0, 1)],
            tick_hz: 1_000.0,
        }
    }

    #[test]
    fn the_phase_plane_of_a_sine_is_its_ellipse() {
        let (dwell, row) = sine(0.7);
        let speed = 10.0 * TAU * 2.5;
        for (x, v) in motion(&dwell, &row).phase_plane() {
            let radius = (x / 10.0).hypot(v / speed);
            // The velocity is off by (Ωh)⁴/30 = 3.2e-4 of its amplitude.
            assert!((radius - 1.0).abs() < 3.3e-4, "{radius}");
        }
    }

    #[test]
    fn the_section_of_a_periodic_motion_is_one_point_at_the_drives_phase() {
        let (dwell, row) = sine(0.7);
        let motion = motion(&dwell, &row);
        let points = motion.section(&motion.phase_plane());
        assert!(points.len() >= 17, "{}", points.len());
        for (x, v) in points {
            // The cubic is off by 3/128 (Ωh)⁴ = 2.3e-4 of the amplitude, the velocity by 3.2e-4 more.
            assert!((x + 10.0 * 0.7_f64.sin()).abs() < 2.4e-3, "{x}");
            assert!((v / (TAU * 25.0) - 0.7_f64.cos()).abs() < 5.6e-4, "{v}");
        }
    }

    #[test]
    fn a_motion_of_twice_the_drives_period_has_two_points() {
        let (dwell, row) = sine(0.7);
        let row = ResultRow { frequency_hz: 5.0, ..row };
        let motion = motion(&dwell, &row);
        let mut points = motion.section(&motion.phase_plane());
        points.dedup_by(|a, b| (a.0 - b.0).abs() < 0.01);
        assert!(points.len() > 30 && points.chunks(2).all(|two| (two[0].0 - points[0].0).abs() < 0.01));
    }

    #[test]
    fn samples_with_a_gap_are_not_drawn() {
        let (mut dwell, row) = sine(0.0);
        dwell.ticks[200] += 20.0;
        assert_eq!(motion(&dwell, &row).samples_in_a_cycle(), 0.0);
    }
}
