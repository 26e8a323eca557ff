//! Predicts experiments that keep the response of the structure: the controller's own loop, on a base that moves as it demands.
//!
//! [`SteppedSineRunner`] runs tick by tick as on the board. Between two ticks the base follows the cubic of the virtual rig
//! ([`BaseTrack`]), without a shaker, sensors or noise: x is what is kept, so how the base is moved hardly changes it. What a
//! real drive is at, and the noise, the run shows.

use damprig_core::control::outcome::{Outcome, TickInputs};
use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
use damprig_core::control::stepped_sine::{DriveMode, SteppedSinePlan, SteppedSineRunner};
use damprig_core::integrator::base::{BaseSegment, BaseTrack};
use damprig_core::integrator::sampled::Sampled;
use damprig_core::io::{Invalid, Reading, Readings, SensorSet, TICK_HZ};
use damprig_core::measure::point::PointResult;
use damprig_core::model::Initial;
use damprig_motion::watch::{Detection, WatchedMotion};
use rayon::prelude::*;

use super::{MAX_STEPS, Response, Swing, USABLE, trim, wall_force, watch};
use crate::campaign::transient::two_digits_down;
use crate::campaign::{Campaign, CampaignSetUp, Experiment, kept_in_words};
use crate::failure::Failure;
use crate::input::Problem;

/// The prediction for an experiment that keeps the response on a set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldResponse {
    /// Position of the set-up in the campaign.
    pub set_up: usize,
    /// Position of the experiment in the campaign.
    pub experiment: usize,
    /// The largest displacement.
    pub swing: Swing,
    /// Largest |z|, m, and the drive frequency at which it occurs, Hz.
    pub base: (f64, f64),
    /// Drive frequencies at which the response is not held when the wait is over, Hz.
    pub missed_hz: Vec<f64>,
    /// Whether the drive is at its limit at one of them.
    pub is_drive_short: bool,
    /// The predicted results of its points, as far as they were simulated.
    pub points: Vec<PointResult>,
}

/// Predicts every such experiment on each of its set-ups, in the order of the set-ups.
///
/// # Errors
/// A parameter that cannot be simulated, with the set-up's name.
pub fn predict(campaign: &Campaign) -> Result<Vec<HeldResponse>, Failure> {
    let sheets = || campaign.experiments.iter().enumerate().filter(|(_, e)| e.response_controlled().is_some());
    // Repeats are the same without noise.
    let once: Vec<(usize, usize)> = (0..campaign.set_ups.len())
        .filter(|set_up| campaign.set_ups[*set_up].is_predicted)
        .flat_map(|set_up| {
            let own = sheets().filter(move |(_, e)| e.repeat == 0 && e.set_ups.contains(&set_up));
            own.map(move |(experiment, _)| (set_up, experiment))
        })
        .collect();
    let most_ticks = (MAX_TICKS / once.len().max(1) as u64).max(MIN_TICKS);
    let detection = watch::detection(&campaign.rig.board.impacts);
    let drive_m = campaign.rig.board.calibration.drive.range().amplitude_m();
    once.into_par_iter()
        .filter_map(|(set_up, experiment)| {
            Some((set_up, experiment, campaign.experiments[experiment].response_controlled()?))
        })
        .map(|(set_up, experiment, sine)| {
            let own = &campaign.set_ups[set_up];
            let order = sine.order(own.base_amplitude_m, 0..sine.frequencies_hz.len(), drive_m);
            let failed = |e: Invalid| Failure::Input(format!("set-up {:?}: {e}", own.name));
            let mut run = Simulation::new(own, order, &detection).map_err(failed)?;
            run.go(most_ticks);
            Ok(run.into_prediction(set_up, experiment))
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
    held: Option<ResponseLoop>,
    watched: WatchedMotion,
    track: BaseTrack<f64>,
    parts: u8,
    initial: Initial,
    tick: u64,
    is_finished: bool,
    swing: Swing,
    base: (f64, f64),
    points: Vec<PointResult>,
}

impl Simulation {
    fn new(
        set_up: &CampaignSetUp,
        mut order: damprig_core::control::stepped_sine::SteppedSine,
        detection: &Detection,
    ) -> Result<Self, Invalid> {
        // The base of a prediction follows the drive.
        if let DriveMode::Response(own) = &mut order.drive {
            own.base = None;
        }
        let held = if let DriveMode::Response(own) = &order.drive { Some(*own) } else { None };
        let limit_m = held.map_or(0.0, |own| own.drive_limit_m);
        let range = damprig_core::io::DriveRange { low_m: -limit_m, high_m: limit_m };
        let runner = SteppedSineRunner::new(&SteppedSinePlan::new(order)?, &range);
        let (model, z_m) = (set_up.model(), set_up.base_amplitude_m);
        let tick_s = 1.0 / f64::from(TICK_HZ);
        let parts = Sampled::<f64>::steps_per_sample(&model, tick_s)?;
        let initial = Initial { y_m: set_up.spec.particle_start_m(z_m), ..Initial::default() };
        let watched = WatchedMotion::new(&model, tick_s / f64::from(parts), &initial, detection)?;
        Ok(Self {
            runner,
            held,
            watched,
            track: BaseTrack::default(),
            parts,
            initial,
            tick: 0,
            is_finished: false,
            swing: Swing::NOTHING,
            base: (0.0, 0.0),
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
                self.watched.motion.reset(&self.initial);
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
        }
        if z_m.abs() > self.base.0 {
            self.base = (z_m.abs(), frequency_hz);
        }
        let force_n = self.watched.watch.largest_force_n;
        self.swing.wall_force_n = wall_force::larger(self.swing.wall_force_n, force_n);
        let mean = |before: f64, after: f64| Reading::still((0.5 * (before + after)) as f32);
        let peak_m = peak_m as f32;
        let x = Reading { peak_m, inside_peak_m: peak_m, ..mean(x_before_m, x_m) };
        Readings { x, z: mean(z_before_m, z_m), ..Readings::default() }
    }

    fn into_prediction(self, set_up: usize, experiment: usize) -> HeldResponse {
        let is_missed = |point: &&PointResult| {
            let amplitudes = [point.x_amplitude_m, point.z_amplitude_m, point.phase_rad];
            self.held.as_ref().is_some_and(|held| !is_within(held, point.frequency_hz, amplitudes))
        };
        let missed_hz = self.points.iter().filter(is_missed).map(|point| f64::from(point.frequency_hz)).collect();
        let is_drive_short = self.points.iter().filter(is_missed).any(|point| point.drive_saturated);
        let Self { swing, base, points, .. } = self;
        HeldResponse { set_up, experiment, swing, base, missed_hz, is_drive_short, points }
    }
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

impl HeldResponse {
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
pub fn check(campaign: &Campaign, predicted: &[HeldResponse]) -> Result<Vec<String>, Failure> {
    let mut warnings = Vec::new();
    for own in predicted {
        let (set_up, experiment) = (&campaign.set_ups[own.set_up], &campaign.experiments[own.experiment]);
        let Some((sine, kept)) = experiment.response_controlled().and_then(|sine| Some((sine, sine.kept.as_ref()?)))
        else {
            continue;
        };
        let words = sine.response_loop().map(|held| kept_in_words(&held.response)).unwrap_or_default();
        let moves = [
            ("structure", "|x|", own.swing.max_x_m, own.swing.frequency_hz, campaign.rig.structure_limit_m()),
            ("base", "|z|", own.base.0, own.base.1, campaign.rig.base_limit_m()),
        ];
        for (what, name, largest_m, at_hz, limit_m) in moves {
            if largest_m <= USABLE * limit_m {
                continue;
            }
            campaign.source.report(Problem {
                title: format!(
                    "set-up {:?} would leave the displacement limit of the {what}: predicted largest {name} = {:.1} mm at {} Hz, limit ±{} mm",
                    set_up.name,
                    largest_m * 1e3,
                    trim(at_hz),
                    trim(limit_m * 1e3),
                ),
                span: kept.amplitude.span.clone(),
                allowed: format!("{words} is too much for this set-up at these frequencies"),
                help: Some(format!(
                    "write {} or less, or leave out the frequencies that need more",
                    two_digits_down(kept.amplitude.value * USABLE * limit_m / largest_m)
                )),
            });
        }
        if !own.missed_hz.is_empty() {
            let at: Vec<String> = own.missed_hz.iter().map(|f| trim(*f)).collect();
            let why = if own.is_drive_short { "; the drive is at its limit there" } else { "" };
            warnings.push(format!(
                "set-up {:?}, experiment {:?}: {words} is not predicted to be held at {} Hz{why}. These points are measured when the wait is over",
                set_up.name,
                experiment.name,
                at.join(", ")
            ));
        }
    }
    campaign.source.verdict()?;
    Ok(warnings)
}
