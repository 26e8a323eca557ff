//! Simulates a set-up on a base motion given tick by tick, and reads it as the board's sensors would: the mean of a tick's
//! sub-samples, their peak, and the pulses on the walls.
//!
//! Between the ends of the ticks the base moves as in [`damprig_core::integrator::base`]: cubics with continuous velocity. The
//! integrator is the sampled one in `f64`; a structure with several places has its own.

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::modes::{Mode, Sign};
use damprig_core::integrator::polynomial::{Polynomial, value};
use damprig_core::integrator::sampled::{Flight, SampledImpact, SampledObserver};
use damprig_core::io::{Invalid, Reading, SUBSAMPLES, TICK_HZ};
use damprig_core::model::Initial;

use super::rig_model::RigModel;
use super::watch::{Detection, MotionWatch};

/// Length of a tick, s.
pub const TICK_S: f64 = 1.0 / TICK_HZ as f64;

/// What the sensors read in a tick, m: the part of [`Readings`](damprig_core::io::Readings) that a motion of hours is kept for, 16 bytes
/// in place of 56.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TickReading {
    /// Mean of x.
    pub x_m: f32,
    /// Largest |x| of the sub-samples.
    pub max_abs_x_m: f32,
    /// Mean of z.
    pub z_m: f32,
    /// Largest |z| of the sub-samples.
    pub max_abs_z_m: f32,
}

/// A pulse on a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallPulse {
    /// Tick in which it began, from 0.
    pub tick: usize,
    /// +1 where y − x = +d.
    pub side: i8,
    /// Its peak, N.
    pub peak_n: f64,
    /// Whether the board would count it.
    pub is_counted: bool,
}

/// A simulated motion, as the sensors read it.
#[derive(Clone, Debug, Default)]
pub struct SimulatedMotion {
    /// A reading for each tick.
    pub readings: Vec<TickReading>,
    /// All pulses, in order of time.
    pub pulses: Vec<WallPulse>,
}

impl SimulatedMotion {
    /// The same motion with readings of x that are off by `by_m`.
    pub fn read_beside(&self, by_m: f64) -> Self {
        let mut beside = self.clone();
        for reading in &mut beside.readings {
            reading.x_m += by_m as f32;
        }
        beside
    }
}

/// Simulates a set-up. `base_m` has z at the ends of the ticks, from two ticks before the first to one tick after the last; `shares` has
/// the share of the friction force in each tick; the last value holds on.
///
/// # Errors
/// A set-up that cannot be simulated.
pub fn simulate(
    model: &RigModel,
    initial: &Initial,
    base_m: &[f64],
    shares: &[f64],
    detection: &Detection,
) -> Result<SimulatedMotion, Invalid> {
    let (set_up, parts) = (&model.set_up, model.steps_per_sample(TICK_S)?);
    let step_s = TICK_S / f64::from(parts);
    let mut motion = model.motion(step_s, initial)?;
    let mut observer = Sampler {
        watch: MotionWatch::new(detection, set_up.structure.mass_kg, step_s).with_pulses(),
        x_m: [0.0; SUBSAMPLES],
        taken: 0,
        part: 0.0,
        parts: f64::from(parts),
    };
    let mut readings = Vec::with_capacity(base_m.len().saturating_sub(3));
    let friction_n = set_up.friction_damper.map(|damper| damper.force_n);
    let mut share = 1.0;
    for (n, around) in base_m.windows(4).enumerate() {
        let now = shares.get(n).or(shares.last()).copied().unwrap_or(1.0);
        if let Some(force_n) = friction_n.filter(|_| now != share) {
            share = now;
            motion.set_friction_n(share * force_n, set_up);
        }
        let [before, start, end, after] = [around[0], around[1], around[2], around[3]];
        let tick = BaseSegment::hermite(start, end, 0.5 * (end - before), 0.5 * (after - start));
        observer.taken = 0;
        for part in 0..parts {
            observer.part = f64::from(part);
            motion.step(&tick.part(part, parts), &mut observer);
            observer.watch.end_step(motion.x_m());
        }
        // Rounding of the instants can leave the last sample just after the end of the last flight.
        observer.x_m[observer.taken..].fill(motion.x_m());
        let z_m: [f32; SUBSAMPLES] = std::array::from_fn(|n| value(&tick.0, (n + 1) as f64 / SUBSAMPLES as f64) as f32);
        let (x, z) = (Reading::of(&observer.x_m.map(|x| x as f32)), Reading::of(&z_m));
        readings.push(TickReading { x_m: x.mean_m, max_abs_x_m: x.peak_m, z_m: z.mean_m, max_abs_z_m: z.peak_m });
    }
    if let Some(refused) = motion.refused() {
        return Err(refused);
    }
    let pulses = observer.watch.into_pulses().into_iter().map(|pulse| WallPulse {
        tick: (pulse.from / f64::from(parts)) as usize,
        side: pulse.side,
        peak_n: pulse.peak_n,
        is_counted: pulse.is_counted,
    });
    Ok(SimulatedMotion { readings, pulses: pulses.collect() })
}

/// Evaluates x at the sub-sample instants of a tick, and passes the motion on to the watch.
struct Sampler {
    watch: MotionWatch,
    x_m: [f64; SUBSAMPLES],
    taken: usize,
    /// The present step of the tick, and their number.
    part: f64,
    parts: f64,
}

impl SampledObserver<f64> for Sampler {
    fn mode(&mut self, mode: Mode) {
        self.watch.mode(mode);
    }

    fn flight(&mut self, start: f64, length: f64, flight: &Flight<f64>) {
        self.watch.flight(start, length, flight);
        while self.taken < SUBSAMPLES {
            let instant = (self.taken + 1) as f64 / SUBSAMPLES as f64 * self.parts - self.part;
            let since = instant - start;
            if since > length {
                return;
            }
            self.x_m[self.taken] = value(&flight.x, since);
            self.taken += 1;
        }
    }

    fn impact(&mut self, impact: &SampledImpact<f64>) {
        self.watch.impact(impact);
    }

    fn contact_start(&mut self, at: f64, side: Sign) {
        self.watch.contact_start(at, side);
    }

    fn wall_force(&mut self, start: f64, length: f64, side: Sign, force: &Polynomial<f64>) {
        self.watch.wall_force(start, length, side, force);
    }

    fn contact_end(&mut self, at: f64, side: Sign, separation: f64) {
        self.watch.contact_end(at, side, separation);
    }
}
