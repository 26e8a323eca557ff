//! Predicts experiments that keep the structure's response or follow its resonance: the controller's own loops, on a base that moves
//! as they demand.
//!
//! [`SteppedSineRunner`] runs tick by tick as on the board. Between two ticks the base follows the cubic of the virtual rig
//! ([`BaseTrack`]), without a shaker, sensors or noise: x is what is kept, so how the base is moved hardly changes it. What a
//! real drive is at, and the noise, the run shows.

use damprig_core::control::outcome::{ExperimentStage, Outcome, TickInputs};
use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
use damprig_core::control::stepped_sine::{DriveMode, SteppedSinePlan, SteppedSineRunner};
use damprig_core::integrator::base::{BaseSegment, BaseTrack};
use damprig_core::io::{Invalid, Reading, Readings, SensorSet, TICK_HZ};
use damprig_core::measure::point::PointResult;
use damprig_core::model::Initial;
use damprig_motion::watch::{Detection, WatchedMotion};
use rayon::prelude::*;

use super::{MAX_STEPS, Response, Swing, USABLE, trim, wall_force, watch};
use crate::campaign::transient::two_digits_down;
use crate::campaign::{Campaign, CampaignSetUp, Experiment, SteppedSine, TrackedResonance};
use crate::failure::Failure;
use crate::input::Problem;

/// The prediction for an experiment that the controller's loops lead, on a set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopPrediction {
    /// Position of the set-up in the campaign.
    pub set_up: usize,
    /// Position of the experiment in the campaign.
    pub experiment: usize,
    /// The largest displacement.
    pub swing: Swing,
    /// Largest |z|, m, and the drive frequency at which it occurs, Hz.
    pub base: (f64, f64),
    /// Points during which |x| and |z| are largest.
    pub largest_at: [usize; 2],
    /// Points at which the response is not held, or the resonance not found, when the wait is over.
    pub missed: Vec<usize>,
    /// Whether the drive is at its limit at one of them.
    pub is_drive_short: bool,
    /// The predicted results of its points, as far as they were simulated.
    pub points: Vec<PointResult>,
}

/// Predicts every such experiment on each of its set-ups, in the order of the set-ups.
///
/// # Errors
/// A parameter that cannot be simulated, with the set-up's name.
pub fn predict(campaign: &Campaign) -> Result<Vec<LoopPrediction>, Failure> {
    let led = || campaign.experiments.iter().enumerate().filter(|(_, e)| e.led_by_loops().is_some());
    // Repeats are the same without noise.
    let once: Vec<(usize, usize)> = (0..campaign.set_ups.len())
        .filter(|set_up| campaign.set_ups[*set_up].is_predicted)
        .flat_map(|set_up| {
            let own = led().filter(move |(_, e)| e.repeat == 0 && e.set_ups.contains(&set_up));
            own.map(move |(experiment, _)| (set_up, experiment))
        })
        .collect();
    let most_ticks = (MAX_TICKS / once.len().max(1) as u64).max(MIN_TICKS);
    let detection = watch::detection(&campaign.rig.board.impacts);
    let drive_m = campaign.rig.board.calibration.drive.range().amplitude_m();
    once.into_par_iter()
        .filter_map(|(set_up, experiment)| Some((set_up, experiment, campaign.experiments[experiment].led_by_loops()?)))
        .map(|(set_up, experiment, sine)| {
            let own = &campaign.set_ups[set_up];
            let failed = |e: Invalid| Failure::Input(format!("set-up {:?}: {e}", own.name));
            let mut run = Simulation::new(own, sine, drive_m, &detection).map_err(failed)?;
            run.go(most_ticks);
            run.watched.motion.refused().map_or(Ok(()), |invalid| Err(failed(invalid)))?;
            Ok(run.into_prediction(sine, (set_up, experiment)))
        })
        .collect()
}

/// Ticks of all experiments together: some seconds of computing.
const MAX_TICKS: u64 = 10 * MAX_STEPS;

/// Ticks that every experiment may have.
const MIN_TICKS: u64 = 50_000;

/// An experiment on a set-up, tick by tick.
struct Simulation {
    runner: SteppedSineRunner,
    watched: WatchedMotion,
    track: BaseTrack<f64>,
    parts: u8,
    initial: Initial,
    tick: u64,
    is_finished: bool,
    swing: Swing,
    base: (f64, f64),
    largest_at: [usize; 2],
    /// Of a tracked resonance.
    amplitudes: Vec<f64>,
    points: Vec<PointResult>,
}

impl Simulation {
    fn new(set_up: &CampaignSetUp, sine: &SteppedSine, drive_m: f32, detection: &Detection) -> Result<Self, Invalid> {
        let mut order = sine.order(set_up.base_amplitude_m, 0..sine.known_points(), drive_m);
        // The base of a prediction follows the drive.
        let limit_m = match &mut order.drive {
            DriveMode::Response(own) => {
                own.base = None;
                own.drive_limit_m
            }
            drive => {
                *drive = DriveMode::Constant;
                drive_m
            }
        };
        let range = damprig_core::io::DriveRange { low_m: -limit_m, high_m: limit_m };
        let runner = SteppedSineRunner::new(&SteppedSinePlan::new(order)?, &range);
        let (model, z_m) = (set_up.rig_model(), set_up.base_amplitude_m);
        let tick_s = 1.0 / f64::from(TICK_HZ);
        let parts = model.steps_per_sample(tick_s)?;
        let initial = Initial { y_m: set_up.spec.particle_start_m(z_m), ..Initial::default() };
        let watched = WatchedMotion::new(&model, tick_s / f64::from(parts), &initial, detection)?;
        Ok(Self {
            runner,
            watched,
            track: BaseTrack::default(),
            parts,
            initial,
            tick: 0,
            is_finished: false,
            swing: Swing::NOTHING,
            base: (0.0, 0.0),
            largest_at: [0; 2],
            amplitudes: sine.tracked.iter().flat_map(|own| &own.amplitudes).map(|own| own.value).collect(),
            points: Vec::new(),
        })
    }

    /// Runs until its end, at most so many ticks.
    fn go(&mut self, most_ticks: u64) {
        let mut readings = Readings::default();
        while !self.is_finished && self.tick < most_ticks {
            let inputs =
                TickInputs { tick: self.tick as u32, readings: &readings, impacts: 0, clipped: SensorSet::default() };
            let (drive_m, outcome) = self.runner.tick(&inputs);
            match outcome {
                Outcome::Point(result) => self.points.push(result),
                Outcome::Finished(result) => {
                    self.points.push(result);
                    self.is_finished = true;
                }
                Outcome::Running => {}
                // A rest that does not come, or a base that is not followed: the run tells it.
                Outcome::Failed(_) | Outcome::Transient(_) => self.is_finished = true,
            }
            if self.runner.begins_from_rest().is_some() {
                self.watched.motion.restart(&self.initial);
                self.track = BaseTrack::default();
            }
            readings = self.move_base(f64::from(drive_m));
            self.tick += 1;
        }
        if !self.is_finished {
            self.swing.predicted_s = Some(self.tick as f64 / f64::from(TICK_HZ));
        }
    }

    /// Moves for a tick; gives what ideal sensors read.
    fn move_base(&mut self, drive_m: f64) -> Readings {
        let segment: BaseSegment<f64> = self.track.push(drive_m);
        let (x_before_m, z_before_m) = (self.watched.x_m(), segment.0[0]);
        let mut peak_m = 0.0_f64;
        for part in 0..self.parts {
            peak_m = peak_m.max(self.watched.step(&segment.part(part, self.parts)));
        }
        let (x_m, z_m) = (self.watched.x_m(), segment.end());
        let frequency_hz = f64::from(self.runner.frequency_hz());
        if peak_m > self.swing.max_x_m {
            (self.swing.max_x_m, self.swing.frequency_hz) = (peak_m, frequency_hz);
            self.largest_at[0] = self.moves_by();
        }
        if z_m.abs() > self.base.0 {
            self.base = (z_m.abs(), frequency_hz);
            self.largest_at[1] = self.moves_by();
        }
        let force_n = self.watched.watch.largest_force_n;
        self.swing.wall_force_n = wall_force::larger(self.swing.wall_force_n, force_n);
        let mean = |before: f64, after: f64| Reading::still((0.5 * (before + after)) as f32);
        let peak_m = peak_m as f32;
        let x = Reading { peak_m, inside_peak_m: peak_m, ..mean(x_before_m, x_m) };
        Readings { x, z: mean(z_before_m, z_m), ..Readings::default() }
    }

    /// The point whose amplitude moves the structure: after a step down the motion is still that of the point before.
    fn moves_by(&self) -> usize {
        let now = self.points.len();
        let is_settling = self.runner.stage() == ExperimentStage::Settle;
        match (now.checked_sub(1).and_then(|before| self.amplitudes.get(before)), self.amplitudes.get(now)) {
            (Some(before), Some(own)) if is_settling && own < before => now - 1,
            _ => now,
        }
    }

    fn into_prediction(self, sine: &SteppedSine, (set_up, experiment): (usize, usize)) -> LoopPrediction {
        let Self { swing, base, largest_at, points, .. } = self;
        let own = |point: &PointResult| [point.x_amplitude_m, point.z_amplitude_m, point.phase_rad];
        let is_missed = |(_, point): &(usize, &PointResult)| {
            !is_as_asked(sine, usize::from(point.index), point.frequency_hz, own(point))
        };
        let missed: Vec<(usize, &PointResult)> = points.iter().enumerate().filter(is_missed).collect();
        let is_drive_short = missed.iter().any(|(_, point)| point.drive_saturated);
        let missed = missed.into_iter().map(|(place, _)| place).collect();
        LoopPrediction { set_up, experiment, swing, base, largest_at, missed, is_drive_short, points }
    }
}

/// Whether the result of a point has the amplitude and the phase that its experiment keeps; `measured` as for [`is_within`].
#[must_use]
pub fn is_as_asked(sine: &SteppedSine, index: usize, frequency_hz: f32, measured: [f32; 3]) -> bool {
    let own = sine.tracked.as_ref().and_then(|tracked| tracked.amplitudes.get(index));
    let is_held = match &sine.drive {
        DriveMode::Constant => true,
        DriveMode::ClosedLoop(base) => {
            own.is_none_or(|own| (f64::from(measured[1]) / own.value - 1.0).abs() <= f64::from(base.tolerance))
        }
        DriveMode::Response(held) => {
            let response = own.map_or(held.response, |own| held.response.with_amplitude(own.value as f32));
            is_within(&ResponseLoop { response, ..*held }, frequency_hz, measured)
        }
    };
    is_held && sine.tracked.as_ref().is_none_or(|tracked| tracked.is_locked(measured[2].into()))
}

/// Whether a result has the amplitude that the loop keeps, within its tolerance. `amplitudes`: of x and z (m), and the phase of x
/// relative to z (rad), all at the drive frequency.
#[must_use]
pub fn is_within(held: &ResponseLoop, frequency_hz: f32, [x_m, z_m, phase_rad]: [f32; 3]) -> bool {
    let reached_m = match held.response {
        KeptQuantity::Displacement { .. } | KeptQuantity::Velocity { .. } => x_m,
        KeptQuantity::Relative { .. } => {
            (x_m * x_m + z_m * z_m - 2.0 * x_m * z_m * libm::cosf(phase_rad)).max(0.0).sqrt()
        }
    };
    (reached_m / held.response.amplitude_m(frequency_hz) - 1.0).abs() <= held.tolerance
}

impl LoopPrediction {
    /// X/Z (cycle maxima) over frequency as of other stepped sines, of the experiment and each of its repeats.
    pub fn responses<'a>(&'a self, campaign: &'a Campaign) -> impl Iterator<Item = Response> + 'a {
        let own = &campaign.experiments[self.experiment];
        let is_repeat = |e: &Experiment| e.series == own.series && e.set_ups.contains(&self.set_up);
        let repeats = campaign.experiments.iter().enumerate().filter(move |(_, e)| is_repeat(e));
        repeats.map(|(experiment, _)| Response { experiment, ..self.response() })
    }

    fn response(&self) -> Response {
        let ratio =
            |p: &PointResult| (f64::from(p.frequency_hz), f64::from(p.mean_cycle_max_m) / f64::from(p.z_amplitude_m));
        let largest = self.points.iter().map(|p| f64::from(p.max_abs_x_m)).fold(0.0, f64::max);
        Response {
            set_up: self.set_up,
            experiment: self.experiment,
            points: self.points.iter().map(ratio).collect(),
            around_peak: None,
            dwell_max_x_m: self.swing.predicted_s.is_none().then_some(largest),
        }
    }
}

/// Refuses what would leave a displacement limit; gives warnings on points that will not be held.
///
/// # Errors
/// One message for all of them, each with the line of the amplitude.
pub fn check(campaign: &Campaign, predicted: &[LoopPrediction]) -> Result<Vec<String>, Failure> {
    let mut warnings = Vec::new();
    for own in predicted {
        let (set_up, experiment) = (&campaign.set_ups[own.set_up], &campaign.experiments[own.experiment]);
        let Some(sine) = experiment.led_by_loops() else { continue };
        let stated = |point: usize| {
            let tracked = sine.tracked.as_ref().and_then(|tracked| tracked.amplitudes.get(point));
            tracked.or_else(|| sine.largest_amplitude().map(|(_, own)| own))
        };
        let moves = [
            ("structure", "|x|", own.swing.max_x_m, own.swing.frequency_hz, campaign.rig.structure_limit_m()),
            ("base", "|z|", own.base.0, own.base.1, campaign.rig.base_limit_m()),
        ];
        for ((what, name, largest_m, at_hz, limit_m), at) in moves.into_iter().zip(own.largest_at) {
            let Some(amplitude) = stated(at).filter(|_| largest_m > USABLE * limit_m) else { continue };
            let words = sine.amplitude_in_words(amplitude.value);
            campaign.source.report(Problem {
                title: format!(
                    "set-up {:?} would leave the displacement limit of the {what}: predicted largest {name} = {:.1} mm at {} Hz, limit ±{} mm",
                    set_up.name,
                    largest_m * 1e3,
                    trim(at_hz),
                    trim(limit_m * 1e3),
                ),
                span: amplitude.span.clone(),
                allowed: format!("{words} is too much for this set-up at these frequencies"),
                help: Some(format!(
                    "write {} or less, or leave out what needs more",
                    two_digits_down(amplitude.value * USABLE * limit_m / largest_m)
                )),
            });
        }
        if !own.missed.is_empty() {
            let at: Vec<String> = own.missed.iter().map(|point| sine.point_in_words(*point)).collect();
            let amplitudes: Vec<String> = sine
                .tracked
                .iter()
                .flat_map(|tracked| own.missed.iter().filter_map(|point| tracked.amplitudes.get(*point)))
                .map(|amplitude| sine.amplitude_in_words(amplitude.value))
                .collect();
            let why = if own.is_drive_short { "; the drive is at its limit there" } else { "" };
            let (name, at) = (&experiment.name, at.join(", "));
            let what = match (&sine.kept, &sine.tracked) {
                (Some(kept), None) => {
                    format!("{} is not predicted to be held at {at}", sine.amplitude_in_words(kept.amplitude.value))
                }
                (_, Some(TrackedResonance { lock, .. })) => format!(
                    "no resonance is predicted to be found from {} to {} Hz at {}",
                    lock.low_hz,
                    lock.high_hz,
                    amplitudes.join(", ")
                ),
                _ => format!("{at} is not predicted to be held"),
            };
            warnings.push(format!(
                "set-up {:?}, experiment {name:?}: {what}{why}. These points are measured when the wait is over",
                set_up.name
            ));
        }
    }
    campaign.source.verdict()?;
    Ok(warnings)
}
