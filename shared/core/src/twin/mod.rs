//! The rig's twin: the `f32` sampled integrator, driven by the measured base motion, in step with the rig.
//!
//! Every tick it predicts the structure's displacement and the particle's impacts from the measured z alone, and says how
//! far the rig is from that: the RMS of the residual, and impacts that were predicted and did not come. The latter is how
//! a stuck particle, a lost ball or a dead force sensor shows.
//!
//! An open loop would lose the rig: its starting state is unknown, and unstable motions part after some fifty cycles. So
//! the twin is an observer. The structure is drawn to the measured x with the poles of a well-damped oscillator at
//! [`TwinConfig::follow_hz`], slowly enough that an impact still shows in the residual. Every measured impact
//! puts the particle where that impact says it is: off the wall with e·w, where the approach speed w = J(1+β)/(m(1+e))
//! follows from the measured impulse J, and makes good the difference between J and what the twin gave the structure.
//!
//! The means of two ticks' blocks are a sample, for z and x alike: the average delays both by the same time, so they match.
//! The base's cubic needs one sample of the future, so predictions are one sample late, and are compared with the x of
//! then. Pairing predictions with measurements is [`matching`]'s.
//!
//! A controller's tick has no time for everything at once: one piece of work is what it has room for. A sample is one
//! such piece mostly, and every event in it three more, so the twin may lag: samples and measured impacts wait in queues,
//! and what comes out does not depend on when [`Twin::work`] is done.

pub mod matching;

use crate::integrator::base::{Segment, Track};
use crate::integrator::sampled::{BegunStep, Impact, Observer, Progress, Sampled, Units};
use crate::measure::impacts::ImpactRecord;
use crate::model::{Initial, Invalid, SetUp, Wall, positive, require};
use crate::rig::{SUBSAMPLES, TICK_HZ};
use crate::scalar::Scalar;
use heapless::{Deque, Vec};
use matching::{Matcher, MatcherConfig};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Ticks of a sample.
const SAMPLE_TICKS: usize = 2;

/// Predicted impacts of one sample that are kept; a chatter may have more, too weak to be measured.
const MOST_IMPACTS: usize = 8;

/// Samples between two updates of the residual's RMS.
const ROOT_EVERY: u32 = 4;

/// Ticks that the twin may lag behind.
pub const MOST_LAG: usize = 16;

/// Measured impacts that wait for the twin to come to their tick.
const DETECTIONS_WAITING: usize = 8;

/// How far the twin must be past a measured impact to learn from it, ticks: by then it has met the wall itself, unless it
/// is wrong by as much.
const LEARNT_AFTER: f32 = 2.0;

/// Steps of a sample's motion, at most: a faster structure's twin would never keep up.
const MOST_STEPS: u8 = 4;

/// Where a sample's mean lies, in samples from its start.
const MEAN_AT: f32 = ((SAMPLE_TICKS * SUBSAMPLES) as f32 + 1.0) / (2 * SAMPLE_TICKS * SUBSAMPLES) as f32;

/// What the twin is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct TwinConfig {
    /// The set-up that it believes in.
    pub set_up: SetUp,
    /// How fast the structure is drawn to the measured x, Hz; 0 to 20. 0 lets it run free.
    pub follow_hz: f32,
    /// Time constant of the residual's RMS, s.
    pub residual_s: f32,
    /// How predicted and measured impacts are paired.
    pub matching: MatcherConfig,
}

impl TwinConfig {
    /// For this set-up, following at 1 Hz.
    #[must_use]
    pub fn new(set_up: SetUp) -> Self {
        Self { set_up, follow_hz: 1.0, residual_s: 1.0, matching: MatcherConfig::default() }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first parameter out of range.
    #[inline(never)]
    pub fn validate(&self) -> Result<(), Invalid> {
        self.set_up.validate()?;
        let follow = f64::from(self.follow_hz);
        require((0.0..=20.0).contains(&self.follow_hz), "twin.follow_hz", follow, "from 0 to 20 Hz")?;
        positive("twin.residual_s", f64::from(self.residual_s))?;
        require(self.residual_s <= 1e3, "twin.residual_s", f64::from(self.residual_s), "at most 1000 s")?;
        self.matching.validate()
    }
}

/// The telemetry of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwinSignals {
    /// Predicted x, two to five ticks ago, m: the mean of two.
    pub x_m: f32,
    /// RMS of measured minus predicted x, m; renewed every 8 ticks.
    pub residual_rms_m: f32,
    /// Predicted impacts that are strong enough to be measured.
    pub predicted: u32,
    /// Measured impacts.
    pub detected: u32,
    /// Predicted impacts that were not measured.
    pub missing: u32,
    /// As many in a row were missing as raise the alarm.
    pub alarm: bool,
    /// Times that it lagged too far behind and began again.
    pub lost: u32,
}

impl TwinSignals {
    /// Of a twin that has seen nothing.
    pub const NOTHING: Self =
        Self { x_m: 0.0, residual_rms_m: 0.0, predicted: 0, detected: 0, missing: 0, alarm: false, lost: 0 };
}

/// The means of [`SAMPLE_TICKS`].
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// The first.
    tick: u32,
    x_m: f32,
    z_m: f32,
}

/// A sample in progress.
#[derive(Clone, Debug)]
struct Present {
    sample: Sample,
    whole: Segment<f32>,
    /// The step that comes next.
    part: u8,
    begun: Option<BegunStep<f32>>,
    impacts: Impacts,
    is_over: bool,
}

impl Default for Present {
    fn default() -> Self {
        Self {
            sample: Sample { tick: 0, x_m: 0.0, z_m: 0.0 },
            whole: Segment([0.0; 4]),
            part: 0,
            begun: None,
            impacts: Impacts { step: 0.0, list: Vec::new() },
            is_over: true,
        }
    }
}

/// What a twin is made from: checked, and worked out where there is time for it.
#[derive(Clone, Copy, Debug)]
pub struct TwinPlan {
    motion: Sampled<f32>,
    steps: u8,
    /// Gains on x (1) and v (1/step).
    gains: (f32, f32),
    residual_gain: f32,
    restitution: f32,
    step_s: f32,
    /// Approach speed per measured impulse, m/s per N·s.
    approach_per_impulse: f32,
    /// Impulse per change of the structure's velocity in m per step, N·s.
    impulse_per_kick: f32,
    matching: MatcherConfig,
}

impl TwinPlan {
    /// For a twin that begins at rest.
    ///
    /// # Errors
    /// Names a value that is not physical, or a part that the sampled driver has no equations for.
    #[inline(never)]
    pub fn new(config: &TwinConfig) -> Result<Self, Invalid> {
        config.validate()?;
        let sample_s = SAMPLE_TICKS as f64 / f64::from(TICK_HZ);
        let set_up = &config.set_up;
        let steps = Sampled::<f32>::steps_per_sample(set_up, sample_s)?;
        require(
            steps <= MOST_STEPS,
            "structure.stiffness_n_per_m",
            set_up.structure.stiffness_n_per_m,
            "low enough for a twin (natural frequency at most 31 Hz)",
        )?;
        let step_s = sample_s / f64::from(steps);
        let motion = Sampled::new(set_up, Units::metres(step_s), &Initial::default())?;
        // x″ + 2ζω x′ + ω² x of the error, ζ = 0.7; the structure's own stiffness only adds to it.
        let omega = 2.0 * core::f64::consts::PI * f64::from(config.follow_hz);
        let gains = ((1.4 * omega * sample_s) as f32, (omega * omega * sample_s * step_s) as f32);
        let (mut restitution, mut approach_per_impulse) = (0.0, 0.0);
        if let Some(particle) = &set_up.particle
            && let Wall::Restitution { coefficient } = particle.wall
        {
            let ratio = particle.mass_kg / set_up.structure.mass_kg;
            restitution = coefficient as f32;
            approach_per_impulse = ((1.0 + ratio) / (particle.mass_kg * (1.0 + coefficient))) as f32;
        }
        Ok(Self {
            motion,
            steps,
            gains,
            residual_gain: 1.0 / (config.residual_s / sample_s as f32).max(1.0),
            restitution,
            step_s: step_s as f32,
            approach_per_impulse,
            impulse_per_kick: (set_up.structure.mass_kg / step_s) as f32,
            matching: config.matching,
        })
    }
}

/// The twin.
#[derive(Clone, Debug)]
pub struct Twin {
    /// The first part of a sample.
    half: Option<Sample>,
    waiting: Deque<Sample, { MOST_LAG / SAMPLE_TICKS }>,
    detections: Deque<ImpactRecord, DETECTIONS_WAITING>,
    present: Present,
    signals: TwinSignals,
    /// Its motion is the one under way.
    plan: TwinPlan,
    track: Track<f32>,
    matcher: Matcher,
    residual_square: f32,
    measured_before_m: f32,
    samples: u32,
}

impl Twin {
    /// A twin at rest.
    ///
    /// # Errors
    /// As [`TwinPlan::new`].
    pub fn new(config: &TwinConfig) -> Result<Self, Invalid> {
        Ok(Self::of(&TwinPlan::new(config)?))
    }

    /// A twin at rest.
    #[must_use]
    pub fn of(plan: &TwinPlan) -> Self {
        Self {
            half: None,
            waiting: Deque::new(),
            detections: Deque::new(),
            present: Present::default(),
            signals: TwinSignals::NOTHING,
            track: Track::default(),
            matcher: Matcher::new(&plan.matching),
            residual_square: 0.0,
            measured_before_m: 0.0,
            samples: 0,
            plan: *plan,
        }
    }

    /// Back to rest, counts and alarm too.
    pub fn restart(&mut self) {
        self.put_back();
        self.matcher.restart();
        self.residual_square = 0.0;
        self.signals = TwinSignals::NOTHING;
    }

    /// Back to rest with a simulated plant that is put back to its start; what was counted stays counted.
    pub fn put_back(&mut self) {
        self.half = None;
        self.waiting.clear();
        self.detections.clear();
        self.present.is_over = true;
        self.present.begun = None;
        self.plan.motion.rest();
        self.track = Track::default();
        self.measured_before_m = 0.0;
        self.samples = 0;
    }

    /// The motion itself.
    #[must_use]
    pub fn motion(&self) -> &Sampled<f32> {
        &self.plan.motion
    }

    /// A measured impact. It waits for the twin to come there; one that finds no room is not counted as detected.
    pub fn detected(&mut self, record: &ImpactRecord) {
        let _ = self.detections.push_back(*record);
    }

    /// Hands in a tick: the means of its x and z, m. Call [`Twin::detected`] for the tick's impacts first. Too far behind,
    /// the twin begins again at rest.
    pub fn take(&mut self, tick: u32, x_m: f32, z_m: f32) {
        // A reading that is no number would never leave the state again.
        let (x_m, z_m) = if x_m.is_finite() && z_m.is_finite() { (x_m, z_m) } else { (self.measured_before_m, 0.0) };
        let Some(first) = self.half.take() else {
            self.half = Some(Sample { tick, x_m, z_m });
            return;
        };
        let sample = Sample { tick: first.tick, x_m: 0.5 * (first.x_m + x_m), z_m: 0.5 * (first.z_m + z_m) };
        if self.waiting.push_back(sample).is_err() {
            self.put_back();
            self.signals.lost = self.signals.lost.saturating_add(1);
        }
    }

    /// The telemetry of the last tick that is done.
    #[must_use]
    pub fn signals(&self) -> &TwinSignals {
        &self.signals
    }

    /// More than half of what may wait does.
    #[must_use]
    pub fn lags(&self) -> bool {
        self.waiting.len() > self.waiting.capacity() / 2
    }

    /// One sample more, and it begins again.
    #[must_use]
    pub fn is_late(&self) -> bool {
        self.waiting.len() + 1 >= self.waiting.capacity()
    }

    /// One piece of work: learning from impacts, or [`Sampled::go_on`]. Whether there was something to do.
    pub fn work(&mut self) -> bool {
        if self.present.is_over {
            let Some(sample) = self.waiting.pop_front() else { return false };
            if self.begin(sample) {
                return true;
            }
        }
        let Self { present, plan, .. } = self;
        let begun = match &mut present.begun {
            Some(begun) => begun,
            none => {
                present.impacts.step = f32::from(present.part);
                none.insert(plan.motion.begin_step(&present.whole.part(present.part, plan.steps)))
            }
        };
        if plan.motion.go_on(begun, &mut present.impacts) == Progress::Under {
            return true;
        }
        present.begun = None;
        present.part += 1;
        if present.part == self.plan.steps {
            self.end();
        }
        true
    }

    /// One tick at once: hands it in and works until nothing is left to do.
    pub fn tick(&mut self, tick: u32, x_m: f32, z_m: f32) -> TwinSignals {
        self.take(tick, x_m, z_m);
        while self.work() {}
        self.signals
    }

    /// Begins a sample; whether an impact was learnt from before.
    fn begin(&mut self, sample: Sample) -> bool {
        // The motion has come to the mean of the last sample but one.
        let now = SAMPLE_TICKS as f32 * (MEAN_AT - 2.0);
        let mut learnt = false;
        while let Some(record) = self.detections.front().copied() {
            let began = record.centre_ticks - 0.5 * record.contact_s * TICK_HZ;
            let since = sample.tick.wrapping_sub(record.tick).cast_signed() as f32 + now - began;
            // It is told a tick late: a twin that does not lag must not come there first. What is no number waits no longer.
            let is_told = sample.tick.wrapping_sub(record.tick).cast_signed() > 0;
            if !is_told || since < LEARNT_AFTER {
                break;
            }
            self.detections.pop_front();
            self.learn(&record, began, since);
            learnt = true;
        }
        self.present.whole = self.track.push(sample.z_m);
        self.present.sample = sample;
        self.present.part = 0;
        self.present.is_over = false;
        self.present.impacts.list.clear();
        learnt
    }

    /// Pairs a measured impact that began so many ticks from the start of its tick and so many ticks ago, and learns from it
    /// where the particle is.
    #[inline(never)]
    fn learn(&mut self, record: &ImpactRecord, began: f32, since: f32) {
        // The measurement's guards are part of a pulse too.
        let length = record.contact_s * TICK_HZ + 1.0;
        let expected = self.matcher.detect(record.tick, began, record.side, length);
        // The sum of a shared pulse, a clipped or an unfinished one is not an impact's impulse.
        let sure = expected.count < 2 && !record.clipped && !record.held;
        if !sure || self.plan.approach_per_impulse == 0.0 {
            return;
        }
        let side = f32::from(record.side);
        let per_tick = f32::from(self.plan.steps) * (1.0 / SAMPLE_TICKS as f32);
        let since = since * per_tick;
        let leaves = self.plan.restitution * self.plan.approach_per_impulse * self.plan.step_s;
        let leaving = leaves * record.impulse_n_s;
        let (c, state) = (self.plan.motion.coefficients(), self.plan.motion.state());
        let per_impulse = side / self.plan.impulse_per_kick;
        // What the twin took for it, and since when: nothing if it has not met the wall.
        let (expected_leaving, expected_since) = (leaves * expected.impulse_n_s, since - expected.late * per_tick);
        let (offset, slide) = if expected.count == 1 {
            let moved = leaving * since - expected_leaving * expected_since;
            (state.offset - side * moved, state.slide - side * (leaving - expected_leaving))
        } else {
            // From the wall, the structure's acceleration being its spring's.
            let pull = -c.stiffness / c.mass * (state.x - self.present.whole.end());
            let moved = leaving * since + 0.5 * side * pull * since * since;
            (side * (c.clearance - moved), -side * leaving - pull * since)
        };
        self.plan.motion.place_particle(offset, slide);
        let moved = per_impulse * (record.impulse_n_s * since - expected.impulse_n_s * expected_since);
        self.plan.motion.nudge(moved, per_impulse * (record.impulse_n_s - expected.impulse_n_s));
    }

    fn end(&mut self) {
        self.present.is_over = true;
        let Sample { tick, x_m, .. } = self.present.sample;
        let steps = f32::from(self.plan.steps);
        for impact in &self.present.impacts.list {
            let at = SAMPLE_TICKS as f32 * (MEAN_AT - 2.0 + impact.at / steps);
            let kick = if impact.kick < 0.0 { -impact.kick } else { impact.kick };
            self.matcher.predict(tick, at, impact.side, kick * self.plan.impulse_per_kick);
        }
        self.matcher.expire(tick);
        let predicted_m = self.plan.motion.state().x;
        let residual = self.measured_before_m - predicted_m;
        self.measured_before_m = x_m;
        self.samples = self.samples.saturating_add(1);
        // The first sample has no x before it.
        if self.samples > 1 {
            self.residual_square += (residual * residual - self.residual_square) * self.plan.residual_gain;
            self.plan.motion.nudge(self.plan.gains.0 * residual, self.plan.gains.1 * residual);
        }
        let counts = self.matcher.counts();
        // It changes slowly, and a root is dear.
        let residual_rms_m = if self.samples.is_multiple_of(ROOT_EVERY) {
            Scalar::sqrt(self.residual_square)
        } else {
            self.signals.residual_rms_m
        };
        self.signals = TwinSignals {
            x_m: predicted_m,
            residual_rms_m,
            predicted: counts.predicted,
            detected: counts.detected,
            missing: counts.missing,
            alarm: self.matcher.alarm(),
            lost: self.signals.lost,
        };
    }
}

/// The impacts of one sample, counted from its first step.
#[derive(Clone, Debug)]
struct Impacts {
    step: f32,
    list: Vec<Impact<f32>, MOST_IMPACTS>,
}

impl Observer<f32> for Impacts {
    fn impact(&mut self, impact: &Impact<f32>) {
        // Full: the later bounces of a chatter are the weaker ones.
        let _ = self.list.push(Impact { at: self.step + impact.at, ..*impact });
    }
}
