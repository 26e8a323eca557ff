//! Digital twin of the rig: the `f32` sampled integrator, driven by the measured base motion in step with the rig.
//!
//! In every tick the twin predicts the structure's displacement and the particle's impacts from the measured z alone.
//! It reports the difference from the rig: the RMS of the residual, and the predicted impacts that were not measured.
//! Missing impacts indicate a stuck particle, a lost ball or a dead force sensor.
//!
//! An open loop would lose the rig: its starting state is unknown, and unstable motions diverge after some fifty
//! cycles. The twin is therefore an observer. The structure is corrected towards the measured x with the poles of a
//! well-damped oscillator at [`TwinConfig::follow_hz`], slowly enough that an impact still shows in the residual. Every
//! measured impact corrects the particle: it leaves the wall with e·w, where the approach speed w = J(1+β)/(m(1+e))
//! follows from the measured impulse J. The structure is corrected by the difference between J and the impulse that the
//! twin applied to it.
//!
//! Each tick's means of z and x are one sample, and [`Twin::tick`] takes one step of a tick's length for it (two for a
//! structure above 16 Hz). The base's cubic needs one sample of the future, so the twin is one tick behind the rig: a
//! prediction is compared with the x of the tick before. [`matching`] pairs predictions with measurements.
//!
//! The work of a tick is bounded: at most [`MAX_EVENTS_PER_TICK`] events of the motion, and at most
//! [`DETECTIONS_WAITING`] measured impacts.

pub mod matching;

use crate::integrator::base::BaseTrack;
use crate::integrator::modes::{Sign, of};
use crate::integrator::sampled::{Sampled, SampledImpact, SampledObserver};
use crate::integrator::units::Units;
use crate::io::{Invalid, SUBSAMPLES, TICK_HZ, positive, require};
use crate::measure::impacts::ImpactRecord;
use crate::model::{ImpactLaw, SetUp, Structure};
use crate::scalar::Scalar;
use heapless::{Deque, Vec};
use matching::{Matcher, MatcherConfig};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most events (impacts, sticking, slipping) of the twin's motion in one tick. A particle that chatters to rest may
/// have more; it is then at rest from the last one on ([`Sampled::step_bounded`]). The omitted bounces begin and end
/// within the tick, so their approach speed is below a T/2: 5 mm/s and 1 mN s at 10 m/s² and 0.16 kg, a twentieth of
/// the smallest impulse that must be measured ([`MatcherConfig`]).
pub const MAX_EVENTS_PER_TICK: u8 = 8;

/// Most measured impacts that wait until the twin has passed their time. Further impacts do not correct the twin.
pub const DETECTIONS_WAITING: usize = 8;

/// Time by which the twin must have passed a measured impact before it is corrected by it, ticks. By then the twin has
/// met the wall itself, unless its error is as large as that.
const LEARNT_AFTER: f32 = 2.0;

/// Most integrator steps per tick; a structure above 31 Hz needs more.
const MAX_STEPS: u8 = 2;

/// Time of a tick's mean, in ticks from its start.
const MEAN_AT: f32 = (SUBSAMPLES as f32 + 1.0) / (2 * SUBSAMPLES) as f32;

/// Time of the twin's state at the start of a tick's work, in ticks from the start of that tick: the mean of the tick
/// before the last.
const BEFORE: f32 = MEAN_AT - 2.0;

/// Settings of the twin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct TwinConfig {
    /// The set-up that the twin simulates.
    pub set_up: SetUp,
    /// Rate at which the structure is corrected towards the measured x, Hz; 0 to 20. With 0 there is no correction.
    pub follow_hz: f32,
    /// Time constant of the residual's RMS, s.
    pub residual_s: f32,
    /// How predicted and measured impacts are paired.
    pub matching: MatcherConfig,
}

impl TwinConfig {
    /// The default settings for a set-up, with a correction rate of 1 Hz.
    #[must_use]
    pub fn new(set_up: SetUp) -> Self {
        Self { set_up, follow_hz: 1.0, residual_s: 1.0, matching: MatcherConfig::default() }
    }

    /// Whether a twin can follow a set-up: not one with soft walls or a tuned mass, whose equations the board does not have.
    #[must_use]
    pub fn follows(set_up: &SetUp) -> bool {
        set_up.tmd.is_none() && !set_up.has_soft_walls()
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first parameter out of range.
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
    /// Predicted x of the tick before, m.
    pub x_m: f32,
    /// RMS of measured minus predicted x, m.
    pub residual_rms_m: f32,
    /// Estimated y − x of the tick before, m.
    pub particle_offset_m: f32,
    /// Estimated y′ − x′ of the tick before, m/s.
    pub particle_velocity_m_per_s: f32,
    /// Predicted impacts that are strong enough to be measured.
    pub predicted: u32,
    /// Measured impacts.
    pub detected: u32,
    /// Predicted impacts that were not measured.
    pub missing: u32,
    /// The alarm is raised: [`MatcherConfig::alarm_after`] impacts are missing since the last paired one on their wall.
    pub alarm: bool,
}

impl TwinSignals {
    /// The signals before the first tick, and without a twin.
    pub const NOTHING: Self = Self {
        x_m: 0.0,
        residual_rms_m: 0.0,
        particle_offset_m: 0.0,
        particle_velocity_m_per_s: 0.0,
        predicted: 0,
        detected: 0,
        missing: 0,
        alarm: false,
    };
}

/// Checked settings with everything derived from them. A plan is made outside the control tick.
#[derive(Clone, Copy, Debug)]
pub struct TwinPlan {
    motion: Sampled<f32>,
    /// Integrator steps per tick.
    steps: u8,
    /// Gains on x (1) and v (1/step).
    gains: (f32, f32),
    residual_gain: f32,
    rebounds: [Rebound; 2],
    step_s: f32,
    /// Impulse per change of the structure's velocity in m per step, N·s.
    impulse_per_kick: f32,
    matching: MatcherConfig,
}

impl TwinPlan {
    /// The plan of a twin that begins at rest.
    ///
    /// # Errors
    /// Names a value that is not physical, or a part of the set-up that the sampled integrator does not support.
    pub fn new(config: &TwinConfig) -> Result<Self, Invalid> {
        config.validate()?;
        let tick_s = 1.0 / f64::from(TICK_HZ);
        let set_up = &config.set_up;
        let steps = Sampled::<f32>::steps_per_sample(set_up, tick_s)?;
        let structure = &set_up.structure;
        let undamped = Structure { damping_n_s_per_m: 0.0, ..*structure };
        require(
            Sampled::<f32>::steps_per_sample(&SetUp::bare(undamped), tick_s)? <= MAX_STEPS,
            "structure.stiffness_n_per_m",
            structure.stiffness_n_per_m,
            "low enough for a twin (natural frequency at most 31 Hz)",
        )?;
        require(
            steps <= MAX_STEPS,
            "structure.damping_n_s_per_m",
            structure.damping_n_s_per_m,
            "low enough for a twin (damping over mass at most 200 /s)",
        )?;
        let step_s = tick_s / f64::from(steps);
        let motion = Sampled::new(set_up, Units::metres(step_s), &set_up.neutral())?;
        // Error dynamics x″ + 2ζω x′ + ω² x with ζ = 0.7. The structure's own stiffness only adds to them.
        let omega = 2.0 * core::f64::consts::PI * f64::from(config.follow_hz);
        let gains = ((1.4 * omega * tick_s) as f32, (omega * omega * tick_s * step_s) as f32);
        Ok(Self {
            motion,
            steps,
            gains,
            residual_gain: 1.0 / (config.residual_s / tick_s as f32).max(1.0),
            rebounds: [-1, 1].map(|side| Rebound::new(set_up, side)),
            step_s: step_s as f32,
            impulse_per_kick: (set_up.structure.mass_kg / step_s) as f32,
            matching: config.matching,
        })
    }
}

/// How the particle leaves the wall of a side.
#[derive(Clone, Copy, Debug)]
struct Rebound {
    /// e over the approach speed in m/s.
    law: ImpactLaw<f32>,
    /// Approach speed per measured impulse at the coefficient of restitution, m/s per N·s; 0 without a particle.
    approach_per_impulse: f32,
    /// Sum of approach and leaving speed per measured impulse, m/s per N·s.
    closing_per_impulse: f32,
}

impl Rebound {
    // Once for both walls: it is long.
    #[inline(never)]
    fn new(set_up: &SetUp, side: Sign) -> Self {
        let mass_kg = set_up.particle.map_or(0.0, |particle| particle.mass_kg);
        let wall = set_up.particle.map(|particle| particle.walls()[of(side)]);
        let law = wall.and_then(|wall| wall.impact_law(1.0));
        let coefficient = wall.and_then(|wall| wall.restitution()).map_or(0.0, |law| law.coefficient);
        let per_impulse = law.map_or(0.0, |_| {
            let ratio = mass_kg / set_up.structure.mass_kg;
            (1.0 + ratio) / (mass_kg * (1.0 + coefficient))
        });
        let approach_per_impulse = per_impulse as f32;
        Self {
            law: law.unwrap_or_default(),
            approach_per_impulse,
            closing_per_impulse: approach_per_impulse * (1.0 + coefficient as f32),
        }
    }

    /// The speed after an impact of this impulse, m per step.
    fn leaving(&self, impulse_n_s: f32, step_s: f32) -> f32 {
        if self.law.is_constant() {
            return self.law.maximum() * self.approach_per_impulse * step_s * impulse_n_s;
        }
        let closing = self.closing_per_impulse * Scalar::max(impulse_n_s, 0.0);
        (closing - self.law.approach(closing)) * step_s
    }
}

/// The twin in operation.
#[derive(Clone, Debug)]
pub struct Twin {
    /// Its `motion` is the present motion of the twin.
    plan: TwinPlan,
    track: BaseTrack<f32>,
    /// The base's displacement at the twin's time, m.
    base_m: f32,
    /// The means of x and z in the tick before, m.
    before: (f32, f32),
    /// Whether there was a tick before.
    has_begun: bool,
    detections: Deque<ImpactRecord, DETECTIONS_WAITING>,
    matcher: Matcher,
    residual_square: f32,
    signals: TwinSignals,
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
            plan: *plan,
            track: BaseTrack::default(),
            base_m: 0.0,
            before: (0.0, 0.0),
            has_begun: false,
            detections: Deque::new(),
            matcher: Matcher::new(&plan.matching),
            residual_square: 0.0,
            signals: TwinSignals::NOTHING,
        }
    }

    /// Resets the twin to rest, with its counts and alarm.
    pub fn restart(&mut self) {
        self.put_back();
        self.matcher.restart();
        self.residual_square = 0.0;
        self.signals = TwinSignals::NOTHING;
    }

    /// Resets the motion to rest when a simulated plant is reset to its start. The counts stay.
    pub fn put_back(&mut self) {
        self.plan.motion.rest();
        self.track = BaseTrack::default();
        self.base_m = 0.0;
        self.before = (0.0, 0.0);
        self.has_begun = false;
        self.detections.clear();
    }

    /// The integrator with the present motion.
    #[must_use]
    pub fn motion(&self) -> &Sampled<f32> {
        &self.plan.motion
    }

    /// Takes a measured impact, before the [`Twin::tick`] in which it was found. The impact waits until the twin has
    /// passed its time. An impact that finds no room, or whose time is not finite, is not counted as detected.
    pub fn detected(&mut self, record: &ImpactRecord) {
        if record.centre_ticks.is_finite() && record.contact_s.is_finite() {
            let _ = self.detections.push_back(*record);
        }
    }

    /// The telemetry of the last tick.
    #[must_use]
    pub fn signals(&self) -> &TwinSignals {
        &self.signals
    }

    /// Runs one tick with its means of x and z, m. A mean that is not finite is replaced by that of the tick before,
    /// because it would stay in the state forever.
    pub fn tick(&mut self, tick: u32, x_m: f32, z_m: f32) -> TwinSignals {
        let (x_m, z_m) = if x_m.is_finite() && z_m.is_finite() { (x_m, z_m) } else { self.before };
        self.learn_from_impacts(tick);
        self.advance(tick, z_m);
        self.correct();
        self.before = (x_m, z_m);
        self.has_begun = true;
        let counts = self.matcher.counts();
        let state = self.plan.motion.state();
        self.signals = TwinSignals {
            x_m: state.x,
            residual_rms_m: Scalar::sqrt(self.residual_square),
            particle_offset_m: state.offset,
            particle_velocity_m_per_s: state.slide / self.plan.step_s,
            predicted: counts.predicted,
            detected: counts.detected,
            missing: counts.missing,
            alarm: self.matcher.alarm(),
        };
        self.signals
    }

    /// Corrects the twin by the measured impacts whose time it has passed.
    fn learn_from_impacts(&mut self, tick: u32) {
        while let Some(record) = self.detections.front().copied() {
            let began = record.centre_ticks - 0.5 * record.contact_s * TICK_HZ;
            let since = tick.wrapping_sub(record.tick).cast_signed() as f32 + BEFORE - began;
            if since < LEARNT_AFTER {
                break;
            }
            self.detections.pop_front();
            self.learn(&record, began, since);
        }
    }

    /// Integrates to the mean of the tick before, and passes the impacts on the way to the matcher.
    fn advance(&mut self, tick: u32, z_m: f32) {
        let steps = self.plan.steps;
        let base = self.track.push(z_m);
        let mut impacts = Impacts { step: 0.0, list: Vec::new() };
        for part in 0..steps {
            impacts.step = f32::from(part);
            self.plan.motion.step_bounded(&base.part(part, steps), MAX_EVENTS_PER_TICK / steps, &mut impacts);
        }
        self.base_m = base.end();
        for impact in &impacts.list {
            let at = BEFORE + impact.at / f32::from(steps);
            self.matcher.predict(tick, at, impact.side, impact.kick.abs() * self.plan.impulse_per_kick);
        }
        self.matcher.expire(tick);
    }

    /// Corrects the structure towards the x that was measured at the twin's time.
    fn correct(&mut self) {
        if !self.has_begun {
            return;
        }
        let residual = self.before.0 - self.plan.motion.state().x;
        self.residual_square += (residual * residual - self.residual_square) * self.plan.residual_gain;
        self.plan.motion.nudge(self.plan.gains.0 * residual, self.plan.gains.1 * residual);
    }

    /// Matches a measured impact and corrects the particle by it. The impact began `began` ticks from the start of its
    /// tick and `since` ticks ago.
    fn learn(&mut self, record: &ImpactRecord, began: f32, since: f32) {
        // The measurement's guard samples belong to the pulse too.
        let length = record.contact_s * TICK_HZ + 1.0;
        let expected = self.matcher.detect(record.tick, began, record.side, length);
        // The sum of a shared, clipped or unfinished pulse is not the impulse of one impact.
        let sure = expected.count < 2 && !record.clipped && !record.held;
        let rebound = &self.plan.rebounds[of(record.side)];
        if !sure || rebound.approach_per_impulse == 0.0 {
            return;
        }
        let side = f32::from(record.side);
        let per_tick = f32::from(self.plan.steps);
        let since = since * per_tick;
        let leaving = rebound.leaving(record.impulse_n_s, self.plan.step_s);
        let (c, state) = (self.plan.motion.coefficients(), self.plan.motion.state());
        let per_impulse = side / self.plan.impulse_per_kick;
        // The twin's leaving speed and time since the impact. The speed is zero if the twin has not met the wall.
        let (expected_leaving, expected_since) =
            (rebound.leaving(expected.impulse_n_s, self.plan.step_s), since - expected.late * per_tick);
        let (offset, slide) = if expected.count == 1 {
            let moved = leaving * since - expected_leaving * expected_since;
            (state.offset - side * moved, state.slide - side * (leaving - expected_leaving))
        } else {
            // Motion from the wall. The structure's acceleration is that of its spring.
            let pull = -c.stiffness / c.mass * (state.x - self.base_m) + c.weight;
            let moved = leaving * since + 0.5 * side * pull * since * since;
            (side * (c.end(record.side) - moved), -side * leaving - pull * since)
        };
        self.plan.motion.place_particle(offset, slide);
        let moved = per_impulse * (record.impulse_n_s * since - expected.impulse_n_s * expected_since);
        self.plan.motion.nudge(moved, per_impulse * (record.impulse_n_s - expected.impulse_n_s));
    }
}

/// The impacts of one tick, with times from its first step.
struct Impacts {
    /// Index of the present step in the tick.
    step: f32,
    list: Vec<SampledImpact<f32>, { MAX_EVENTS_PER_TICK as usize }>,
}

impl SampledObserver<f32> for Impacts {
    fn impact(&mut self, impact: &SampledImpact<f32>) {
        // Cannot fail: a tick has at most this many events.
        let _ = self.list.push(SampledImpact { at: self.step + impact.at, ..*impact });
    }
}
