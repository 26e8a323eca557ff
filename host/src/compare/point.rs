//! Compares the points of a stepped sine.

use std::ops::Range;

use damprig_core::control::stepped_sine::DriveMode;
use damprig_core::io::TICK_HZ;
use damprig_motion::read_run::{SimulatedMotion, TICK_S};

use super::base::{self, BaseMotion, FrequencyStep, SineDrive};
use super::ensemble::Models;
use super::metric::{self, PointWindow};
use super::prediction::{PredictedValues, Question, Window, WindowPredictions, metrics};
use super::recorded::RecordedSamples;
use super::spring::SpringForce;
use super::{ComparedPoint, ComparedRun, PointHistory, Residual, uncertainty};
use crate::campaign::{CampaignSetUp, Experiment, PointStart, SteppedSine};
use crate::run_folder::ResultRow;
use crate::run_folder::schema::segment_id::SegmentId;

/// Samples of z in a cycle from which the start of a drive is found.
const SAMPLES_PER_CYCLE: f64 = 8.0;

/// Share of Z below which the base counts as at rest.
const AT_REST: f64 = 0.1;

/// Readings beside those of a point that its base motion may use.
const BEYOND: usize = 24;

/// Cycles that a figure shows.
const SHOWN_CYCLES: f64 = 4.0;

/// Most ticks of one simulation: almost three hours.
const MAX_TICKS: u64 = 10_000_000;

/// Deviation of the measured base amplitude from the commanded one that is worth a remark.
const NOTABLE_BASE: f64 = 2e-3;

/// Points that are simulated in one go: one from rest, or all of a sweep that carries its motion over.
struct SimulatedDrive<'a> {
    rows: Vec<&'a ResultRow>,
    sine: SineDrive,
    /// Tick after the last point.
    end_tick: u64,
}

impl ComparedRun<'_> {
    /// The points of a stepped sine on a set-up, in the order of the campaign.
    pub(super) fn stepped_sine(
        &self,
        own: &CampaignSetUp,
        experiment: &Experiment,
        models: &Models,
    ) -> Vec<ComparedPoint> {
        let Some(sine) = experiment.stepped_sine() else { return Vec::new() };
        let is_own = |row: &&ResultRow| row.set_up == own.name && row.experiment == experiment.name;
        let mut rows: Vec<&ResultRow> = self.state.rows().iter().filter(is_own).collect();
        rows.sort_by_key(|row| row.point_index);
        let together: Vec<Vec<&ResultRow>> = match sine.start {
            PointStart::FromRest => rows.into_iter().map(|row| vec![row]).collect(),
            PointStart::CarryOver => rows.chunk_by(|a, b| a.segment == b.segment).map(<[_]>::to_vec).collect(),
        };
        // One after the other, each on all processors: memory does not grow with their number.
        let of = |rows: Vec<&ResultRow>| {
            if self.is_stopped() {
                return Vec::new();
            }
            let points = self.points(own, sine, models, &rows);
            rows.iter().for_each(|_| self.done());
            points
        };
        let mut points: Vec<ComparedPoint> = together.into_iter().flat_map(of).collect();
        if self.state.peak(&own.name, &experiment.name).is_some() {
            // Those around the peak are among those of the grid, as in the results.
            let order = self.state.rows_in_order(&[(own.name.clone(), experiment.name.clone())]);
            points.sort_by_key(|point| order.iter().position(|row| Some(row.frequency_hz) == point.frequency_hz));
        }
        points
    }

    fn points(
        &self,
        own: &CampaignSetUp,
        sine: &SteppedSine,
        models: &Models,
        rows: &[&ResultRow],
    ) -> Vec<ComparedPoint> {
        if sine.tracked.is_some() {
            let why = "the loop sets the frequency; the run's page has its prediction beside it";
            return rows.iter().map(|row| self.without_simulation(row, models, why)).collect();
        }
        if sine.response_loop().is_some() {
            let why = "the loop moves the base as the response needs; `damprig continue` has the periodic motions";
            return rows.iter().map(|row| self.without_simulation(row, models, why)).collect();
        }
        let id = id_of(rows[0]);
        let mut samples = self.recorded.samples(&id, &self.ticks_around(&id, sine, rows));
        let mut found = drive(own, sine, rows, samples.as_ref());
        if found.is_err() {
            samples = self.recorded.samples(&id, &(0..u64::MAX));
            found = drive(own, sine, rows, samples.as_ref());
        }
        let recorded = samples.as_ref();
        let drive = match found {
            Ok(drive) => drive,
            Err(why) => return rows.iter().map(|row| self.without_simulation(row, models, &why)).collect(),
        };
        let ticks = drive.sine.from_tick..drive.end_tick;
        let z_m: Vec<f64> = rows.iter().map(|row| f64::from(row.z_amplitude_m)).collect();
        let spring = self.spring_force(own, models, recorded, &ticks, (&z_m, rows[0].frequency_hz));
        let z_noise_m = z_noise_m(rows);
        let measured_base = self.measured_base(recorded, &ticks, models, z_noise_m);
        let ideal_base = BaseMotion::following(&drive.sine.demand_m, self.sensors.delay_s);
        let (ideal, measured) = rayon::join(
            || self.answer(&drive, models, (&ideal_base, 0.0), &spring),
            || measured_base.as_ref().ok().and_then(|base| self.answer(&drive, models, (base, z_noise_m), &spring)),
        );
        let why_not = match (&measured_base, &measured) {
            (Err(why), _) => Some(why.clone()),
            (Ok(_), None) => Some("the set-up cannot be simulated".into()),
            (Ok(_), Some(_)) => None,
        };
        let window = |place: usize| window(drive.rows[place], drive.sine.from_tick);
        rows.iter()
            .enumerate()
            .map(|(place, row)| {
                let own_of =
                    |answer: &Option<WindowPredictions>| answer.as_ref().and_then(|own| own.predictions[place].clone());
                let (on_measured, on_ideal) = (own_of(&measured), own_of(&ideal));
                let mut point = self.point(row, models, on_measured.as_ref(), on_ideal.as_ref());
                point.remarks.extend(base_remark(row, own.base_amplitude_m));
                point.remarks.extend(spring.remark());
                point.without_measured_base.clone_from(&why_not);
                let shown = measured.as_ref().or(ideal.as_ref());
                if let Some(shown) = shown {
                    self.add_history(&mut point, row, recorded, &shown.motion, &window(place), measured.is_some());
                }
                point
            })
            .collect()
    }

    /// The ticks whose samples the comparison of some points needs: those of their motion from rest, which begins after the dwell of
    /// the point before, and what the base's and the spring's motion are read with.
    fn ticks_around(&self, id: &SegmentId, sine: &SteppedSine, rows: &[&ResultRow]) -> Range<u64> {
        let beyond = BEYOND as u64 + f64::from(self.campaign.rig.board.spring.average_s * TICK_HZ) as u64;
        let until = rows.iter().map(|row| row.end_tick).max().unwrap_or(0).saturating_add(beyond);
        let first = rows.iter().map(|row| row.start_tick).min().unwrap_or(0);
        let before = self.state.rows().iter().filter(|row| id_of(row) == *id && row.start_tick < first);
        match sine.start {
            PointStart::FromRest => before.map(|row| row.start_tick).max().unwrap_or(0)..until,
            PointStart::CarryOver => 0..until,
        }
    }

    /// The values of a point and its predictions.
    fn point(
        &self,
        row: &ResultRow,
        models: &Models,
        on_measured: Option<&PredictedValues>,
        on_ideal: Option<&PredictedValues>,
    ) -> ComparedPoint {
        let kind = Self::walls_of(models);
        let walls = self.measured_walls(&id_of(row), &(row.start_tick..row.end_tick));
        let measured = metric::of_result(row, walls, kind);
        let of_measured = uncertainty::of_result(&self.sensors, row, &measured, kind);
        let is_sensitive = on_measured.or(on_ideal).is_some_and(|prediction| prediction.is_sensitive);
        let mut remarks = Vec::new();
        if row.drive_saturated {
            remarks.push("the drive was at its limit".to_string());
        }
        if !matches!(row.sensors_clipped.as_str(), "" | "none") {
            remarks.push(format!("clipped sensors: {}", row.sensors_clipped));
        }
        ComparedPoint {
            frequency_hz: Some(row.frequency_hz),
            is_sensitive,
            without_measured_base: None,
            remarks,
            metrics: metrics(&measured, &of_measured, on_measured, on_ideal),
            residual: None,
            history: None,
        }
    }

    fn without_simulation(&self, row: &ResultRow, models: &Models, why: &str) -> ComparedPoint {
        let mut point = self.point(row, models, None, None);
        point.without_measured_base = Some(why.to_string());
        point.remarks.push(format!("not simulated: {why}"));
        point
    }

    fn answer(
        &self,
        drive: &SimulatedDrive,
        models: &Models,
        (base, z_noise_m): (&BaseMotion, f64),
        spring: &SpringForce,
    ) -> Option<WindowPredictions> {
        let kind = Self::walls_of(models);
        let of_row = |row: &&ResultRow| Window {
            ticks: window(row, drive.sine.from_tick),
            cycles: f64::from(row.cycles.max(1)),
            z_noise_m,
            z_m: f64::from(row.z_amplitude_m),
        };
        let windows = drive.rows.iter().map(of_row).collect();
        let measure = |motion: &SimulatedMotion, place: usize| {
            let row = drive.rows[place];
            let window = PointWindow {
                ticks: window(row, drive.sine.from_tick),
                phases: &drive.sine.phases,
                frequency_hz: row.frequency_hz,
                cycles: row.cycles,
            };
            metric::of_simulated_point(motion, &window, kind)
        };
        let question = Question { models, start_m: 0.0, base, spring, detection: &self.detection, windows, measure };
        question.answer()
    }

    /// The force of a friction damper's spring in these ticks; that of the model if its friction does not come from a spring.
    pub(super) fn spring_force(
        &self,
        own: &CampaignSetUp,
        models: &Models,
        recorded: Option<&RecordedSamples>,
        ticks: &Range<u64>,
        kept_by: (&[f64], f64),
    ) -> SpringForce {
        if models.set_up.spring().is_none() {
            return SpringForce::exact();
        }
        let config = &self.campaign.rig.board.spring;
        SpringForce::of(own, config, self.is_simulated, recorded, ticks, kept_by)
    }

    /// The base motion as measured in these ticks, or why there is none.
    pub(super) fn measured_base(
        &self,
        recorded: Option<&RecordedSamples>,
        ticks: &Range<u64>,
        models: &Models,
        z_noise_m: f64,
    ) -> Result<BaseMotion, String> {
        if !self.is_every_tick || recorded.is_none() {
            return Err("z was not recorded at every tick (in [telemetry] rate_hz = 1000, signals with \"z\")".into());
        }
        let z_m = recorded.and_then(|recorded| recorded.z_m(ticks, BEYOND));
        let z_m = z_m.ok_or("samples of z are missing")?;
        let slips = models.set_up.model().friction_damper.is_some();
        Ok(BaseMotion::measured(&z_m, BEYOND, slips, z_noise_m))
    }

    /// Adds the residual of the whole window, and the histories of its last cycles.
    fn add_history(
        &self,
        point: &mut ComparedPoint,
        row: &ResultRow,
        recorded: Option<&RecordedSamples>,
        motion: &SimulatedMotion,
        window: &Range<usize>,
        on_measured_base: bool,
    ) {
        let ticks = row.start_tick..row.end_tick;
        let measured_m = self.recorded_x_m(recorded, &ticks).unwrap_or_default();
        point.residual = Residual::of(measured_m, motion, window, f64::from(row.x_noise_rms_m));
        let Some(simulated) = motion.readings.get(window.clone()) else { return };
        let shown = (SHOWN_CYCLES * f64::from(TICK_HZ) / row.frequency_hz) as usize;
        let skipped = simulated.len().saturating_sub(shown);
        let from_s = skipped as f64 * TICK_S;
        let mut measured_impacts = self.measured_impacts(&id_of(row), &ticks);
        measured_impacts.retain(|(t_s, _)| *t_s >= from_s);
        let own = motion.pulses.iter().filter(|pulse| pulse.is_counted && window.contains(&pulse.tick));
        let simulated_impacts = own.map(|pulse| ((pulse.tick - window.start) as f64 * TICK_S, pulse.side));
        point.history = Some(PointHistory {
            from_s,
            rate_hz: f64::from(TICK_HZ),
            measured_m: measured_m.get(skipped..).unwrap_or_default().to_vec(),
            simulated_m: simulated[skipped..].iter().map(|reading| reading.x_m).collect(),
            measured_impacts,
            simulated_impacts: simulated_impacts.filter(|(t_s, _)| *t_s >= from_s).collect(),
            on_measured_base,
        });
    }
}

fn id_of(row: &ResultRow) -> SegmentId {
    SegmentId { set_up: row.set_up.clone(), experiment: row.experiment.clone(), segment: row.segment }
}

/// The window of a point in a motion that begins at a tick.
fn window(row: &ResultRow, from_tick: u64) -> Range<usize> {
    (row.start_tick - from_tick) as usize..(row.end_tick - from_tick) as usize
}

/// The noise of z, m, which is taken to be that of x at the first of these points.
fn z_noise_m(rows: &[&ResultRow]) -> f64 {
    let noise_m = f64::from(rows[0].x_noise_rms_m);
    if noise_m.is_finite() && noise_m > 0.0 { noise_m } else { 0.0 }
}

/// A remark on a base that moved by another amplitude than commanded.
fn base_remark(row: &ResultRow, commanded_m: f64) -> Option<String> {
    let z_m = f64::from(row.z_amplitude_m);
    ((z_m / commanded_m - 1.0).abs() > NOTABLE_BASE)
        .then(|| format!("the base moved by Z = {:.4} mm, commanded {:.4} mm", z_m * 1e3, commanded_m * 1e3))
}

/// The drive of some points, or why it is not known.
fn drive<'a>(
    own: &CampaignSetUp,
    sine: &SteppedSine,
    rows: &[&'a ResultRow],
    recorded: Option<&RecordedSamples>,
) -> Result<SimulatedDrive<'a>, String> {
    let ends = |row: &ResultRow| row.end_tick > row.start_tick && row.end_tick < u64::from(u32::MAX);
    if !rows.iter().all(|row| ends(row) && row.frequency_hz > 0.0) {
        return Err("its ticks or its frequency are damaged".into());
    }
    let is_in_order = rows
        .windows(2)
        .all(|pair| pair[1].point_index == pair[0].point_index + 1 && pair[1].start_tick >= pair[0].end_tick);
    if !is_in_order {
        return Err("points of the sweep before it are missing".into());
    }
    let first = rows[0];
    let from_tick = drive_start(own, sine, first, recorded).ok_or("the start of its drive is not known: record z")?;
    let mut steps = vec![FrequencyStep { from_tick, frequency_hz: first.frequency_hz }];
    steps.extend(
        rows.windows(2).map(|pair| FrequencyStep { from_tick: pair[0].end_tick, frequency_hz: pair[1].frequency_hz }),
    );
    let end_tick = rows[rows.len() - 1].end_tick;
    if end_tick - from_tick > MAX_TICKS {
        return Err(format!("it lasts more than {} s", MAX_TICKS as f64 * TICK_S));
    }
    let sine = SineDrive::new(&steps, end_tick, own.base_amplitude_m, sine.ramp_s);
    Ok(SimulatedDrive { rows: rows.to_vec(), sine, end_tick })
}

/// The tick in which the drive of a point began, with phase 0. A dwell begins a whole number of cycles after it.
fn drive_start(
    own: &CampaignSetUp,
    sine: &SteppedSine,
    row: &ResultRow,
    recorded: Option<&RecordedSamples>,
) -> Option<u64> {
    let period_ticks = f64::from(TICK_HZ) / row.frequency_hz;
    let after = |cycles: u64| row.start_tick.checked_sub(base::ticks_of(cycles, row.frequency_hz));
    if sine.start == PointStart::CarryOver {
        // The sweep begins with the segment, at its first tick.
        return after((row.start_tick as f64 / period_ticks) as u64);
    }
    let least = base::least_cycles(row.frequency_hz, sine.settle_s);
    let is_dense = |recorded: &&RecordedSamples| recorded.density() * period_ticks >= SAMPLES_PER_CYCLE;
    if let Some(recorded) = recorded.filter(is_dense) {
        let level_m = AT_REST * own.base_amplitude_m;
        let rest_until = recorded.last_at_rest(row.start_tick, level_m, period_ticks as u64)?;
        // A smooth ramp reaches a tenth of its height after a fifth of its time.
        let ramp_ticks = 0.2 * sine.ramp_s * f64::from(TICK_HZ);
        let cycles = (((row.start_tick - rest_until) as f64 + ramp_ticks) / period_ticks).round() as u64;
        return after(cycles.max(least));
    }
    let is_certain = sine.drive == DriveMode::Constant && sine.longest_dwell_s() <= sine.dwell_s;
    if is_certain { after(least) } else { None }
}
