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
//! The means of a tick's blocks go in, for z and x alike: the average delays both by the same time, so they match. The
//! base's cubic needs one sample of the future, so predictions are one tick late, and are compared with the x of then.
//! Pairing predictions with measurements is [`matching`]'s.
//!
//! A controller's tick has no time for everything at once. So the twin may lag: samples and measured impacts wait in
//! queues, [`Twin::work`] does what the tick leaves room for, and what comes out does not depend on when it is done.

pub mod matching;

use crate::integrator::base::{Segment, Track};
use crate::integrator::sampled::{BegunStep, Impact, Observer, Sampled, Units};
use crate::measure::impacts::ImpactRecord;
use crate::model::{Initial, Invalid, SetUp, Wall, positive, require};
use crate::rig::{SUBSAMPLES, TICK_HZ};
use heapless::{Deque, Vec};
use matching::{Matcher, MatcherConfig};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Predicted impacts of one tick that are kept; a chatter may have more, too weak to be measured.
const MOST_IMPACTS: usize = 8;

/// Ticks between two updates of the residual's RMS.
const ROOT_EVERY: u32 = 8;

/// Ticks that the twin may lag behind.
pub const MOST_LAG: usize = 16;

/// Measured impacts that wait for the twin to come to their tick.
const DETECTIONS_WAITING: usize = 4;

/// Steps of a tick's motion, at most: a faster structure's twin would never keep up.
const MOST_STEPS: u8 = 2;

/// Where the mean of a tick's block lies, in ticks from the tick's start.
const MEAN_AT: f32 = (SUBSAMPLES as f32 + 1.0) / (2.0 * SUBSAMPLES as f32);

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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TwinSignals {
    /// Predicted x one tick ago, m.
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

/// A tick's means.
#[derive(Clone, Copy, Debug)]
struct Sample {
    tick: u32,
    x_m: f32,
    z_m: f32,
}

/// A tick in progress.
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
#[derive(Clone, Debug)]
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
        let tick_s = 1.0 / f64::from(TICK_HZ);
        let set_up = &config.set_up;
        let steps = Sampled::<f32>::steps_per_sample(set_up, tick_s)?;
        require(
            steps <= MOST_STEPS,
            "structure.stiffness_n_per_m",
            set_up.structure.stiffness_n_per_m,
            "low enough for a twin (natural frequency at most 31 Hz)",
        )?;
        let step_s = tick_s / f64::from(steps);
        let motion = Sampled::new(set_up, Units::metres(step_s), &Initial::default())?;
        // x″ + 2ζω x′ + ω² x of the error, ζ = 0.7; the structure's own stiffness only adds to it.
        let omega = 2.0 * core::f64::consts::PI * f64::from(config.follow_hz);
        let gains = ((1.4 * omega * tick_s) as f32, (omega * omega * tick_s * step_s) as f32);
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
            residual_gain: 1.0 / (config.residual_s * TICK_HZ).max(1.0),
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
    waiting: Deque<Sample, MOST_LAG>,
    detections: Deque<ImpactRecord, DETECTIONS_WAITING>,
    present: Present,
    signals: TwinSignals,
    /// Its motion is the one under way.
    plan: TwinPlan,
    track: Track<f32>,
    matcher: Matcher,
    residual_square: f32,
    measured_before_m: f32,
    ticks: u32,
}

impl Twin {
    /// A twin at rest.
    ///
    /// # Errors
    /// As [`TwinPlan::new`].
    pub fn new(config: &TwinConfig) -> Result<Self, Invalid> {
        Ok(Self::of(TwinPlan::new(config)?))
    }

    /// A twin at rest.
    #[must_use]
    pub fn of(plan: TwinPlan) -> Self {
        Self {
            waiting: Deque::new(),
            detections: Deque::new(),
            present: Present::default(),
            signals: TwinSignals::default(),
            track: Track::default(),
            matcher: Matcher::new(&plan.matching),
            residual_square: 0.0,
            measured_before_m: 0.0,
            ticks: 0,
            plan,
        }
    }

    /// Back to rest, counts and alarm too.
    pub fn restart(&mut self) {
        self.put_back();
        self.matcher.restart();
        self.residual_square = 0.0;
        self.signals = TwinSignals::default();
    }

    /// Back to rest with a simulated plant that is put back to its start; what was counted stays counted.
    pub fn put_back(&mut self) {
        self.waiting.clear();
        self.detections.clear();
        self.present.is_over = true;
        self.present.begun = None;
        self.plan.motion.rest();
        self.track = Track::default();
        self.measured_before_m = 0.0;
        self.ticks = 0;
    }

    /// The motion itself.
    #[must_use]
    pub fn motion(&self) -> &Sampled<f32> {
        &self.plan.motion
    }

    /// A measured impact, whose pulse ended in a tick that has not been handed in yet. It waits for the twin to come there;
    /// one that finds no room is not counted as detected.
    pub fn detected(&mut self, record: &ImpactRecord) {
        let _ = self.detections.push_back(*record);
    }

    /// Hands in a tick: the means of its x and z, m. Call [`Twin::detected`] for the tick's impacts first. Too far behind,
    /// the twin begins again at rest.
    pub fn take(&mut self, tick: u32, x_m: f32, z_m: f32) {
        // A reading that is no number would never leave the state again.
        let (x_m, z_m) = if x_m.is_finite() && z_m.is_finite() { (x_m, z_m) } else { (self.measured_before_m, 0.0) };
        if self.waiting.push_back(Sample { tick, x_m, z_m }).is_err() {
            self.put_back();
            self.signals.lost = self.signals.lost.saturating_add(1);
        }
    }

    /// The telemetry of the last tick that is done.
    #[must_use]
    pub fn signals(&self) -> &TwinSignals {
        &self.signals
    }

    /// The particle may meet a wall in the next step: that may be twice the work.
    #[must_use]
    pub fn is_near(&self) -> bool {
        self.plan.motion.is_near()
    }

    /// Goes on to the next event or to the end of a step; what that was.
    pub fn work(&mut self) -> Work {
        if self.present.is_over {
            let Some(sample) = self.waiting.pop_front() else { return Work::Nothing };
            self.begin(sample);
        }
        let Self { present, plan, .. } = self;
        let begun = match &mut present.begun {
            Some(begun) => begun,
            none => {
                present.impacts.step = f32::from(present.part);
                none.insert(plan.motion.begin_step(&present.whole.part(present.part, plan.steps)))
            }
        };
        if !plan.motion.go_on(begun, &mut present.impacts) {
            return Work::Event;
        }
        present.begun = None;
        present.part += 1;
        if present.part == self.plan.steps {
            self.end();
        }
        Work::Quiet
    }

    /// One tick at once: hands it in and works until nothing is left to do.
    pub fn tick(&mut self, tick: u32, x_m: f32, z_m: f32) -> TwinSignals {
        self.take(tick, x_m, z_m);
        while self.work() != Work::Nothing {}
        self.signals
    }

    fn begin(&mut self, sample: Sample) {
        while let Some(record) = self.detections.front().copied()
            && sample.tick.wrapping_sub(record.tick).cast_signed() >= 0
        {
            self.detections.pop_front();
            self.learn(&record);
        }
        self.present.whole = self.track.push(sample.z_m);
        self.present.sample = sample;
        self.present.part = 0;
        self.present.is_over = false;
        self.present.impacts.list.clear();
    }

    /// A measured impact of the present tick: pairs it, and learns from it where the particle is.
    fn learn(&mut self, record: &ImpactRecord) {
        let began = record.centre_ticks - 0.5 * record.contact_s * TICK_HZ;
        // The measurement's guards are part of a pulse too.
        let length = record.contact_s * TICK_HZ + 1.0;
        let expected = self.matcher.detect(record.tick, began, record.side, length);
        // The sum of a shared pulse, a clipped or an unfinished one is not an impact's impulse.
        let sure = expected.count < 2 && !record.clipped && !record.held;
        if !sure || self.plan.approach_per_impulse == 0.0 {
            return;
        }
        let side = f32::from(record.side);
        // In the twin's time, which ends one tick ago at the mean of its block; in ticks, then in steps.
        let since = (MEAN_AT - 1.0 - began) * f32::from(self.plan.steps);
        let leaving = self.plan.restitution * self.plan.approach_per_impulse * record.impulse_n_s * self.plan.step_s;
        let clearance = self.plan.motion.coefficients().clearance;
        self.plan.motion.place_particle(side * (clearance - leaving * since), -side * leaving);
        let kick = side * (record.impulse_n_s - expected.impulse_n_s) / self.plan.impulse_per_kick;
        self.plan.motion.nudge(kick * since, kick);
    }

    fn end(&mut self) {
        self.present.is_over = true;
        let Sample { tick, x_m, .. } = self.present.sample;
        let steps = f32::from(self.plan.steps);
        for impact in &self.present.impacts.list {
            let at = MEAN_AT - 2.0 + impact.at / steps;
            let kick = if impact.kick < 0.0 { -impact.kick } else { impact.kick };
            self.matcher.predict(tick, at, impact.side, kick * self.plan.impulse_per_kick);
        }
        self.matcher.expire(tick);
        let predicted_m = self.plan.motion.state().x;
        let residual = self.measured_before_m - predicted_m;
        self.measured_before_m = x_m;
        self.ticks = self.ticks.saturating_add(1);
        // The first block has no x before it.
        if self.ticks > 1 {
            self.residual_square += (residual * residual - self.residual_square) * self.plan.residual_gain;
            self.plan.motion.nudge(self.plan.gains.0 * residual, self.plan.gains.1 * residual);
        }
        let counts = self.matcher.counts();
        // It changes slowly, and a root is dear.
        let residual_rms_m = if tick.is_multiple_of(ROOT_EVERY) {
            libm::sqrtf(self.residual_square)
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

/// What a piece of work was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// There was nothing to do.
    Nothing,
    /// A step's end was reached without an event.
    Quiet,
    /// An event was found and handled: twice the work.
    Event,
}

/// The impacts of one tick, counted from its first step.
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
