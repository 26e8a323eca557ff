//! Compares records, pulses and free vibrations.

use std::ops::Range;

use damprig_core::io::TICK_HZ;
use damprig_core::measure::noise::NoiseMeter;
use damprig_motion::read_run::{SimulatedMotion, TICK_S, simulate};

use super::base::{self, BaseMotion};
use super::ensemble::Models;
use super::metric;
use super::prediction::{Question, Window, WindowPredictions, metrics};
use super::recorded::RecordedSamples;
use super::spring::SpringForce;
use super::{ComparedPoint, ComparedRun, PointHistory, Residual, uncertainty};
use crate::campaign::{CampaignSetUp, Experiment, FreeVibration, Playback};
use crate::run_folder::schema::segment_id::SegmentId;
use crate::run_folder::schema::transients::TransientRow;

/// Most ticks of a transient that is compared: almost three hours.
const MAX_TICKS: u64 = 10_000_000;

/// Ticks in which a released structure must have fallen by a tenth, at most: that of 0.01 Hz.
const LONGEST_FALL: f64 = 1e5;

/// Why a free vibration is simulated on the ideal base alone.
const NOT_DRIVEN: &str = "the base is at rest in a free vibration, and the noise of its sensor is no motion";

/// The simulations of a transient, and where its measured ticks are in them.
struct TransientSimulations {
    ideal: Option<WindowPredictions>,
    measured: Option<WindowPredictions>,
    /// Why the latter is missing.
    why_not: Option<String>,
    window: Range<usize>,
}

impl ComparedRun<'_> {
    /// The transient experiment on a set-up, if it was measured.
    pub(super) fn transient(
        &self,
        own: &CampaignSetUp,
        experiment: &Experiment,
        models: &Models,
    ) -> Vec<ComparedPoint> {
        let is_own = |row: &&TransientRow| row.set_up == own.name && row.experiment == experiment.name;
        let Some(row) = self.state.transients().iter().find(is_own) else { return Vec::new() };
        let ticks = row.start_tick..row.end_tick;
        let is_valid = row.end_tick > row.start_tick && row.end_tick < u64::from(u32::MAX);
        let id = SegmentId { set_up: row.set_up.clone(), experiment: row.experiment.clone(), segment: row.segment };
        let samples = self.recorded.samples(&id, &(0..u64::MAX));
        let recorded = samples.as_ref();
        let noise_m = self.noise_m(self.recorded_x_m(recorded, &ticks));
        // The spring keeps its force during a transient.
        let spring = self.spring_force(own, models, recorded, &ticks, (&[], 0.0)).mean();
        let simulated = match (experiment.playback(), experiment.free_vibration()) {
            _ if !is_valid || row.end_tick - row.start_tick > MAX_TICKS => None,
            (Some(playback), _) => Some(self.playback(playback, (models, &spring), recorded, (&ticks, noise_m))),
            (None, Some(free)) => self.release(free, (models, &spring), (row, noise_m)),
            (None, None) => None,
        };
        let mut point = self.transient_point((row, noise_m), &id, recorded, models, simulated);
        point.remarks.extend(spring.remark());
        self.done();
        vec![point]
    }

    fn playback(
        &self,
        playback: &Playback,
        (models, spring): (&Models, &SpringForce),
        recorded: Option<&RecordedSamples>,
        (ticks, z_noise_m): (&Range<u64>, f64),
    ) -> TransientSimulations {
        let window = 0..(ticks.end - ticks.start) as usize;
        let demand = base::played(playback, &self.campaign.rig.board.calibration.drive.range(), window.end);
        let kind = Self::walls_of(models);
        let measure = |motion: &SimulatedMotion, _: usize| metric::of_simulated_playback(motion, &window, kind);
        let answer = |base: &BaseMotion, z_noise_m: f64| {
            let watched = Window { ticks: window.clone(), cycles: 1.0, z_noise_m, ..Window::default() };
            self.of_transient((models, spring), 0.0, base, watched, &measure)
        };
        let ideal = answer(&BaseMotion::following(&demand, self.sensors.delay_s), 0.0);
        let base = self.measured_base(recorded, ticks, models, z_noise_m);
        let measured = base.as_ref().ok().and_then(|base| answer(base, z_noise_m));
        TransientSimulations { ideal, measured, why_not: base.err(), window }
    }

    /// `None` if a simulated release is not detected: the structure sticks.
    fn release(
        &self,
        free: &FreeVibration,
        (models, spring): (&Models, &SpringForce),
        (row, noise_m): (&TransientRow, f64),
    ) -> Option<TransientSimulations> {
        // A person releases a real structure about there.
        let is_measured = !self.is_simulated && row.start_m.is_finite();
        let start_m = if is_measured { row.start_m.copysign(free.start_m) } else { free.start_m };
        let period_ticks = f64::from(TICK_HZ) / models.set_up.natural_frequency_hz();
        let measured_ticks = (row.end_tick - row.start_tick) as usize;
        let stated = models.stated(start_m);
        let at_rest = BaseMotion::at_rest(measured_ticks + period_ticks.min(LONGEST_FALL) as usize);
        let motion =
            simulate(&stated.model, &stated.initial, &at_rest.ends_m, spring.shares(), &self.detection).ok()?;
        // A simulated plant is put back in every tick, and read at its end.
        let held_m = if self.is_simulated { motion.readings.first()?.x_m } else { start_m as f32 };
        let (_, detected) = metric::release(&motion, free, held_m)?;
        let window = detected..detected + measured_ticks;
        let kind = Self::walls_of(models);
        let measure = |motion: &SimulatedMotion, _: usize| {
            let release = metric::release(motion, free, held_m)?;
            Some(metric::of_simulated_release(motion, &release, kind))
        };
        let watched = Window { ticks: window.clone(), cycles: 1.0, ..Window::default() };
        let mut ideal = self.of_transient((models, spring), start_m, &at_rest, watched, &measure);
        if let Some(answer) = &mut ideal {
            let half_width_m = 4.0 * noise_m + 0.5 * self.sensors.step_m;
            let read = [-half_width_m, half_width_m].map(|by_m| measure(&answer.motion.read_beside(by_m), 0));
            for prediction in answer.predictions.iter_mut().flatten() {
                prediction.add_reading(&read);
            }
        }
        Some(TransientSimulations { ideal, measured: None, why_not: Some(NOT_DRIVEN.into()), window })
    }

    fn of_transient(
        &self,
        (models, spring): (&Models, &SpringForce),
        start_m: f64,
        base: &BaseMotion,
        window: Window,
        measure: &(impl Fn(&SimulatedMotion, usize) -> Option<metric::MetricValues> + Sync),
    ) -> Option<WindowPredictions> {
        let windows = vec![window];
        Question { models, start_m, base, spring, detection: &self.detection, windows, measure }.answer()
    }

    fn transient_point(
        &self,
        (row, noise_m): (&TransientRow, f64),
        id: &SegmentId,
        recorded: Option<&RecordedSamples>,
        models: &Models,
        simulated: Option<TransientSimulations>,
    ) -> ComparedPoint {
        let ticks = row.start_tick..row.end_tick;
        let kind = Self::walls_of(models);
        let x_m = self.recorded_x_m(recorded, &ticks);
        let measured = metric::of_transient(row, x_m, self.measured_walls(id, &ticks), kind);
        let of_measured = uncertainty::of_transient(&self.sensors, row, &measured, noise_m, kind);
        let prediction =
            |answer: &Option<WindowPredictions>| answer.as_ref().and_then(|answer| answer.predictions[0].clone());
        let (on_measured, on_ideal) =
            simulated.as_ref().map_or((None, None), |s| (prediction(&s.measured), prediction(&s.ideal)));
        let mut remarks = Vec::new();
        if simulated.is_none() {
            remarks
                .push("not simulated: its ticks are damaged, or the simulated structure is never released".to_string());
        }
        if row.drive_saturated {
            remarks.push("the demand was cut at the drive's range".to_string());
        }
        if !matches!(row.sensors_clipped.as_str(), "" | "none") {
            remarks.push(format!("clipped sensors: {}", row.sensors_clipped));
        }
        let shown = simulated.as_ref().and_then(|s| Some((s.measured.as_ref().or(s.ideal.as_ref())?, s)));
        let (residual, history) = shown.map_or((None, None), |(answer, own)| {
            let measured_m = x_m.unwrap_or_default();
            let residual = Residual::of(measured_m, &answer.motion, &own.window, noise_m);
            (residual, Some(self.history(id, &ticks, measured_m, answer, own)))
        });
        ComparedPoint {
            frequency_hz: None,
            is_sensitive: on_measured.as_ref().or(on_ideal.as_ref()).is_some_and(|prediction| prediction.is_sensitive),
            without_measured_base: simulated.and_then(|simulated| simulated.why_not),
            remarks,
            metrics: metrics(&measured, &of_measured, on_measured.as_ref(), on_ideal.as_ref()),
            residual,
            history,
        }
    }

    fn history(
        &self,
        id: &SegmentId,
        ticks: &Range<u64>,
        measured_m: &[f32],
        answer: &WindowPredictions,
        own: &TransientSimulations,
    ) -> PointHistory {
        let pulses = answer.motion.pulses.iter();
        let counted = pulses.filter(|pulse| pulse.is_counted && own.window.contains(&pulse.tick));
        PointHistory {
            from_s: 0.0,
            rate_hz: f64::from(TICK_HZ),
            measured_m: measured_m.to_vec(),
            simulated_m: answer
                .motion
                .readings
                .get(own.window.clone())
                .unwrap_or_default()
                .iter()
                .map(|r| r.x_m)
                .collect(),
            measured_impacts: self.measured_impacts(id, ticks),
            simulated_impacts: counted
                .map(|pulse| ((pulse.tick - own.window.start) as f64 * TICK_S, pulse.side))
                .collect(),
            on_measured_base: own.measured.is_some(),
        }
    }

    /// x of all these ticks, if it was recorded at every tick.
    pub(super) fn recorded_x_m<'r>(
        &self,
        recorded: Option<&'r RecordedSamples>,
        ticks: &Range<u64>,
    ) -> Option<&'r [f32]> {
        recorded.filter(|_| self.is_every_tick)?.x_m(ticks)
    }

    /// RMS noise of a reading of x, m: measured if the readings were recorded, else that of the simulated sensors, or a step of the
    /// converter.
    fn noise_m(&self, x_m: Option<&[f32]>) -> f64 {
        if let Some(x_m) = x_m.filter(|x_m| x_m.len() > 200) {
            let mut meter = NoiseMeter::default();
            x_m.iter().for_each(|x| meter.push(*x));
            return f64::from(meter.rms());
        }
        let of_sensors = self.campaign.rig.sensor_noise_rms_m / 10.0_f64.sqrt();
        if self.is_simulated { of_sensors } else { self.sensors.step_m / 12.0_f64.sqrt() }
    }
}
