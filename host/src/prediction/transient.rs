//! Predicts displacements of base and structure for a record, a pulse, or a release, before the rig moves.
//!
//! The base motion is the spline that the device plays through the record's counts, in `f64`, each cubic divided into steps
//! of at most a tick. The base follows exactly. The measured window is the device's: a release is measured from the instant
//! at which |x| has fallen below nine tenths of x0. Impacts are counted as the device counts them (`watch`).

use damprig_core::integrator::base::BaseSegment;
use damprig_core::io::{Invalid, TICK_HZ};
use damprig_core::measure::impacts::ImpactConfig;
use damprig_core::model::Initial;
use damprig_motion::watch::WatchedMotion;

use super::wall_force::larger;
use super::watch;
use super::{USABLE, tries};
use crate::campaign::{Campaign, CampaignSetUp, Experiment, ExperimentKind, FreeVibration, Playback};
use crate::failure::Failure;
use crate::input::Problem;

/// The prediction for one experiment on one set-up. Lengths in m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outlook {
    /// max |x|; NaN, as the other values of x, without a model of the damper.
    pub max_abs_x_m: f64,
    /// RMS of x over the measured window.
    pub rms_x_m: f64,
    /// max |z|.
    pub max_abs_z_m: f64,
    /// max |x − z|.
    pub max_abs_x_minus_z_m: f64,
    /// RMS of x − z.
    pub rms_x_minus_z_m: f64,
    /// Impacts that the board would count.
    pub impacts: u32,
    /// Impacts that it would not: below its threshold, or within the pulse of a stronger one.
    pub weak_impacts: u32,
    /// Largest force on the walls at −d and +d, N; 0 without an impact.
    pub wall_force_n: [f64; 2],
    /// Time that was simulated, s, if that is less than the experiment takes.
    pub predicted_s: Option<f64>,
}

impl Outlook {
    /// What does not depend on the damper: the base's motion.
    fn of_base(self) -> Self {
        let (max_abs_x_m, rms_x_m, max_abs_x_minus_z_m, rms_x_minus_z_m) = (f64::NAN, f64::NAN, f64::NAN, f64::NAN);
        Self {
            max_abs_x_m,
            rms_x_m,
            max_abs_x_minus_z_m,
            rms_x_minus_z_m,
            impacts: 0,
            weak_impacts: 0,
            wall_force_n: [0.0; 2],
            ..self
        }
    }
}

/// The prediction for a record, a pulse or a free vibration; `None` for a stepped sine. Of a set-up without a model only z is
/// predicted. `detection`: the board's settings.
///
/// # Errors
/// A parameter that cannot be simulated.
pub fn outlook(
    set_up: &CampaignSetUp,
    experiment: &Experiment,
    detection: &ImpactConfig,
) -> Result<Option<Outlook>, Invalid> {
    if let ExperimentKind::SteppedSine(_) = experiment.kind {
        return Ok(None);
    }
    let of_start = |start: &CampaignSetUp| match &experiment.kind {
        ExperimentKind::Playback(playback) => played(start, playback, detection),
        ExperimentKind::FreeVibration(free) => released(start, free, detection),
        ExperimentKind::SteppedSine(_) => Ok(Outlook::default()),
    };
    let all: Result<Vec<Outlook>, Invalid> = set_up.starts().iter().map(of_start).collect();
    let outlook = of_starts(all?);
    Ok(Some(if set_up.is_predicted { outlook } else { outlook.of_base() }))
}

/// Of several starts of the particle: the largest displacements and forces; the rest of the start with the median RMS.
fn of_starts(mut all: Vec<Outlook>) -> Outlook {
    all.sort_by(|a, b| a.rms_x_m.total_cmp(&b.rms_x_m));
    let largest = |value: fn(&Outlook) -> f64| all.iter().map(value).fold(0.0, f64::max);
    Outlook {
        max_abs_x_m: largest(|o| o.max_abs_x_m),
        max_abs_x_minus_z_m: largest(|o| o.max_abs_x_minus_z_m),
        wall_force_n: all.iter().map(|o| o.wall_force_n).fold([0.0; 2], larger),
        ..all[all.len() / 2]
    }
}

/// The longest step, s.
const STEP_S: f64 = 1.0 / TICK_HZ as f64;

/// Steps of an experiment on a set-up: about a tenth of a second of computing, 400 s of rig time.
const MAX_STEPS: u64 = 400_000;

/// Share of x0 below which |x| has to fall for the release to be detected (`control::transient::free_vibration`).
const RELEASED: f64 = 0.9;

/// A motion with sums over its steps.
struct Summed {
    watched: WatchedMotion,
    step_s: f64,
    outlook: Outlook,
    steps: u64,
    squares: f64,
    relative: f64,
}

impl Summed {
    fn new(watched: WatchedMotion, step_s: f64) -> Self {
        Self { watched, step_s, outlook: Outlook::default(), steps: 0, squares: 0.0, relative: 0.0 }
    }

    /// Makes a step, which ends at `z` of the base.
    fn step(&mut self, base: &BaseSegment<f64>, z: f64) {
        let max_abs_x_m = self.watched.step(base);
        let (x, out) = (self.watched.x_m(), &mut self.outlook);
        out.max_abs_x_m = out.max_abs_x_m.max(max_abs_x_m);
        out.max_abs_z_m = out.max_abs_z_m.max(z.abs());
        out.max_abs_x_minus_z_m = out.max_abs_x_minus_z_m.max((x - z).abs());
        self.squares += x * x;
        self.relative += (x - z) * (x - z);
        self.steps += 1;
    }

    /// Follows the motion for `time_s` over a base at rest.
    fn rest(&mut self, time_s: f64) {
        for _ in 0..(time_s / self.step_s).round() as u64 {
            if self.is_full() {
                break;
            }
            self.step(&BaseSegment::at_rest(0.0), 0.0);
        }
    }

    /// Whether the bound on the work is reached.
    fn is_full(&self) -> bool {
        self.steps >= MAX_STEPS
    }

    /// The sums over a motion of `wanted_s`.
    fn over(self, wanted_s: f64) -> Outlook {
        let rms = |sum: f64| (sum / self.steps.max(1) as f64).sqrt();
        let (predicted_s, watch) = (self.steps as f64 * self.step_s, &self.watched.watch);
        Outlook {
            rms_x_m: rms(self.squares),
            rms_x_minus_z_m: rms(self.relative),
            impacts: watch.measurable,
            weak_impacts: watch.weak,
            wall_force_n: watch.largest_force_n,
            predicted_s: (self.is_full() && predicted_s < wanted_s).then_some(predicted_s),
            ..self.outlook
        }
    }
}

/// Number of steps of an interval.
fn parts(set_up: &CampaignSetUp, interval_s: f64) -> Result<u32, Invalid> {
    let by_tick = (interval_s / STEP_S).ceil().max(1.0);
    let in_step = set_up.rig_model().steps_per_sample(interval_s / by_tick)?;
    Ok(by_tick as u32 * u32::from(in_step))
}

fn at_rest(set_up: &CampaignSetUp, x_m: f64) -> Initial {
    Initial { x_m, y_m: x_m + set_up.particle_start_m(), ..Initial::default() }
}

fn played(set_up: &CampaignSetUp, playback: &Playback, detection: &ImpactConfig) -> Result<Outlook, Invalid> {
    let interval_s = 1.0 / playback.sample_rate_hz;
    let parts = parts(set_up, interval_s)?;
    let (share, step_s) = (1.0 / f64::from(parts), interval_s / f64::from(parts));
    let mut summed = Summed::new(
        WatchedMotion::new(&set_up.rig_model(), step_s, &at_rest(set_up, 0.0), &watch::detection(detection))?,
        step_s,
    );
    let scale = f64::from(playback.scale_m());
    let counts: Vec<f64> =
        playback.bytes().as_chunks::<2>().0.iter().map(|two| scale * f64::from(i16::from_le_bytes(*two))).collect();
    let count = counts.len() as i64;
    let length_s = (count + 3) as f64 * interval_s;
    // The device ramps the ends by a smooth step in time.
    let ramp = |t_s: f64| {
        let gain = |since_s: f64| if playback.ramp_s > 0.0 { (since_s / playback.ramp_s).clamp(0.0, 1.0) } else { 1.0 };
        let gain = gain(t_s).min(gain(length_s - t_s));
        gain * gain * (3.0 - 2.0 * gain)
    };
    let at = |n: i64| usize::try_from(n).ok().and_then(|n| counts.get(n)).copied().unwrap_or(0.0);
    for node in -2..=count {
        let rate = |n: i64| 0.5 * (at(n + 1) - at(n - 1));
        let whole = BaseSegment::hermite(at(node), at(node + 1), rate(node), rate(node + 1)).0;
        let value = |t: f64| whole[0] + t * (whole[1] + t * (whole[2] + t * whole[3]));
        let slope = |t: f64| share * (whole[1] + t * (2.0 * whole[2] + t * 3.0 * whole[3]));
        for part in 0..parts {
            if summed.is_full() {
                break;
            }
            let (from, to) = (f64::from(part) * share, f64::from(part + 1) * share);
            let (t0, t1) =
                ((node + 2) as f64 * interval_s + from * interval_s, (node + 2) as f64 * interval_s + to * interval_s);
            let (z0, z1) = (ramp(t0) * value(from), ramp(t1) * value(to));
            let segment = if playback.ramp_s > 0.0 {
                // The product of ramp and cubic, by its values and slopes at the ends.
                let change = |t: f64, z: f64| (ramp(t + 0.5 * step_s) - ramp(t - 0.5 * step_s)) * z;
                let (v0, v1) =
                    (ramp(t0) * slope(from) + change(t0, value(from)), ramp(t1) * slope(to) + change(t1, value(to)));
                BaseSegment::hermite(z0, z1, v0, v1)
            } else {
                BaseSegment::hermite(z0, z1, slope(from), slope(to))
            };
            summed.step(&segment, z1);
        }
    }
    summed.rest(playback.tail_s);
    summed.watched.motion.refused().map_or(Ok(()), Err)?;
    Ok(summed.over(length_s + playback.tail_s))
}

fn released(set_up: &CampaignSetUp, free: &FreeVibration, detection: &ImpactConfig) -> Result<Outlook, Invalid> {
    let parts = parts(set_up, STEP_S)?;
    let step_s = STEP_S / f64::from(parts);
    let mut watched =
        WatchedMotion::new(&set_up.rig_model(), step_s, &at_rest(set_up, free.start_m), &watch::detection(detection))?;
    // The release is detected, and the measurement begins, when |x| has fallen this far. A structure that sticks is never
    // released.
    let mut steps_before = 0;
    while watched.x_m().abs() >= RELEASED * free.start_m.abs() && steps_before < MAX_STEPS {
        watched.step(&BaseSegment::at_rest(0.0));
        steps_before += 1;
    }
    watched.watch.restart_count();
    let mut summed = Summed::new(watched, step_s);
    summed.rest(free.measure_s);
    summed.watched.motion.refused().map_or(Ok(()), Err)?;
    let mut outlook = summed.over(free.measure_s);
    outlook.max_abs_x_m = outlook.max_abs_x_m.max(free.start_m.abs());
    Ok(outlook)
}

/// The prediction for an experiment on a set-up, by their places in the campaign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// The set-up.
    pub set_up: usize,
    /// The experiment.
    pub experiment: usize,
    /// The prediction.
    pub outlook: Outlook,
}

/// Predicts all records, pulses and free vibrations of a campaign, in the order in which they are run.
///
/// # Errors
/// A parameter that the simulation cannot take, with the set-up's name.
pub fn predict(campaign: &Campaign) -> Result<Vec<Expected>, Failure> {
    let mut all = Vec::new();
    for (set_up, it) in campaign.set_ups.iter().enumerate() {
        for (experiment, what) in campaign.experiments.iter().enumerate().filter(|(_, e)| e.set_ups.contains(&set_up)) {
            let outlook = outlook(it, what, &campaign.rig.board.impacts)
                .map_err(|e| Failure::Input(format!("set-up {:?}, {:?}: {e}", it.name, what.name)))?;
            all.extend(outlook.map(|outlook| Expected { set_up, experiment, outlook }));
        }
    }
    Ok(all)
}

/// Refuses experiments that would exceed the displacement limit or the shaker's stroke, and gives the peak that would fit.
///
/// # Errors
/// One message for all of them, each with the line of the key that sets the peak.
pub fn check(campaign: &Campaign, expected: &[Expected]) -> Result<(), Failure> {
    let (limit, base_limit) = (campaign.rig.structure_limit_m(), campaign.rig.base_limit_m());
    let stroke = campaign.rig.shaker.map_or(f64::INFINITY, |shaker| shaker.half_stroke_m);
    for Expected { set_up, experiment, outlook } in expected {
        let (set_up, experiment) = (&campaign.set_ups[*set_up], &campaign.experiments[*experiment]);
        let mm = |metres: f64| format!("{:.3} mm", metres * 1e3);
        let too_far = [
            ("the shaker's stroke", "|z|", outlook.max_abs_z_m, stroke),
            ("the displacement limit", "|z|", outlook.max_abs_z_m, USABLE * base_limit),
            ("the displacement limit", "|x|", outlook.max_abs_x_m, USABLE * limit),
        ];
        let Some((what, which, value, most)) = too_far.into_iter().find(|(.., value, most)| value > most) else {
            continue;
        };
        let (key, span) = match &experiment.kind {
            ExperimentKind::Playback(playback) => (playback.key, playback.span.clone()),
            ExperimentKind::FreeVibration(free) => ("start_m", free.span.clone()),
            ExperimentKind::SteppedSine(_) => continue,
        };
        let fits = experiment
            .playback()
            .and_then(|playback| fitting(campaign, set_up, playback, [stroke.min(USABLE * base_limit), limit]));
        campaign.source.report(Problem {
            title: format!(
                "experiment {:?} on set-up {:?} would leave {what}: predicted largest {which} = {}, at most {} may be used",
                experiment.name,
                set_up.name,
                mm(value),
                mm(most)
            ),
            span,
            allowed: format!("`{key}` is too large for this set-up"),
            help: fits.map(|peak| {
                let key = if key == "amplitude_m" { key } else { "target_peak_m" };
                format!("write {key} = {peak}")
            }),
        });
    }
    campaign.source.verdict()
}

/// The largest peak of two digits at which a record fits. |x| may not be monotonic in it, so candidates are simulated.
fn fitting(
    campaign: &Campaign,
    set_up: &CampaignSetUp,
    playback: &Playback,
    [most_z_m, limit_m]: [f64; 2],
) -> Option<f64> {
    let (before, most) = (playback.peak_m(), USABLE * limit_m);
    let mut candidate = before.min(most_z_m);
    for _ in 0..tries(MAX_STEPS) {
        candidate = crate::campaign::transient::two_digits_down(candidate);
        let factor = candidate / before;
        let samples_m = playback.samples_m.iter().map(|z| z * factor).collect();
        let louder = Playback { samples_m, ..playback.clone() };
        let outlook = played(set_up, &louder, &campaign.rig.board.impacts).ok()?;
        if outlook.max_abs_x_m <= most {
            return Some(candidate);
        }
        candidate *= (most / outlook.max_abs_x_m).min(0.97);
    }
    None
}
