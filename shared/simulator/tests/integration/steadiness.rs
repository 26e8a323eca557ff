//! Verdicts on the steadiness of drawn set-ups, against the limit that the same set-up without noise reaches.
//!
//! 40 set-ups, or 600 with `DAMPRIG_FULL`. The limit is that of a run whose point settles for 20 time constants of the
//! bare structure, without sensor noise, measured over 128 cycles.

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicU64, Ordering};

use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::point::PointResult;
use damprig_core::measure::steadiness::{Steadiness, SteadyLimits};
use damprig_core::model::{FrictionDamper, Particle, SetUp, Structure, Wall};
use damprig_protocol::Request;
use damprig_simulator::plant::{Base, DataSheet, PlantConfig, SensorModel, Shaker};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro128PlusPlus;

use crate::support::host::Host;

/// Cycles over which the limit is measured.
const LIMIT_CYCLES: f64 = 128.0;

struct Draw(Xoshiro128PlusPlus);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.0.next_u32()) / 4_294_967_296.0
    }

    fn log_between(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    fn chance(&mut self, of: f64) -> bool {
        self.between(0.0, 1.0) < of
    }
}

/// A set-up, its excitation, and the time constant of its structure.
struct Point {
    plant: PlantConfig,
    frequency_hz: f64,
    z_m: f64,
    settle_s: f64,
    dwell_s: f64,
    time_constant_s: f64,
}

impl Point {
    fn draw(seed: u64) -> Self {
        let mut draw = Draw(Xoshiro128PlusPlus::seed_from_u64(seed));
        let natural_hz = draw.between(1.5, 5.0);
        let damping_ratio = draw.log_between(0.002, 0.03);
        let structure = Structure::from_modal(1.6, natural_hz, damping_ratio);
        let z_m = draw.log_between(5e-4, 3e-3);
        let mut set_up = SetUp::bare(structure);
        if draw.chance(0.6) {
            set_up.particle = Some(Particle {
                mass_kg: 1.6 * draw.between(0.03, 0.2),
                clearance_m: z_m * draw.log_between(1.0, 20.0),
                friction_coefficient: if draw.chance(0.5) { 0.0 } else { draw.between(0.0, 0.03) },
                wall: Wall::Restitution { coefficient: draw.between(0.2, 0.8) },
            });
        }
        if draw.chance(0.5) {
            let force_n = draw.between(0.1, 0.7) * structure.stiffness_n_per_m * z_m;
            set_up.friction_damper = Some(FrictionDamper { force_n });
        }
        let near = draw.chance(0.5);
        let ratio = if near { draw.between(0.95, 1.05) } else { draw.between(0.8, 1.25) };
        let frequency_hz = f64::from((natural_hz * ratio) as f32);
        let mut plant = PlantConfig::ideal(set_up);
        if draw.chance(0.4) {
            plant.base = Base::Shaker(Shaker { calibrated_at_hz: frequency_hz, ..Shaker::default() });
        }
        plant.sensors.seed = seed;
        match (draw.between(0.0, 3.0)) as u32 {
            // 16 bit over ±80 mm, 30 µm per 1 kHz sample.
            0 => {
                plant.sensors.resolution_m = 0.16 / 65_536.0;
                plant.sensors.noise_rms_m = 30e-6 * 10f32.sqrt();
            }
            1 => plant.data_sheet = Some(DataSheet::default()),
            _ => {}
        }
        let settle_s = if draw.chance(0.3) { 2.0 } else { draw.between(2.0, 40.0) };
        let dwell_s = draw.between(12.0, 80.0) / frequency_hz;
        let time_constant_s = 1.0 / (damping_ratio * TAU * natural_hz);
        Self { plant, frequency_hz, z_m, settle_s, dwell_s, time_constant_s }
    }

    /// The result of the point; none if an interlock ended it.
    fn measure(&self, plant: PlantConfig, settle_s: f64, dwell_s: f64) -> Option<PointResult> {
        let mut host = Host::new(plant);
        host.done(Request::Configure(SteppedSine {
            start: Start::FromRest { level_m: 1e-3 },
            amplitude_m: self.z_m as f32,
            drive: DriveMode::Constant,
            ramp_s: 2.0,
            settle_s: settle_s as f32,
            dwell_s: dwell_s as f32,
            steady: SteadyLimits::default(),
            first_index: 0,
            frequencies_hz: [self.frequency_hz as f32].into_iter().collect(),
        }));
        host.done(Request::Start);
        host.pass(((settle_s + dwell_s + 6.0) * 1000.0) as u32);
        host.points().first().copied()
    }

    fn measured(&self) -> Option<PointResult> {
        self.measure(self.plant, self.settle_s, self.dwell_s)
    }

    /// The result without noise after 20 more time constants.
    fn limit(&self) -> Option<PointResult> {
        let sensors = SensorModel { noise_rms_m: 0.0, resolution_m: 0.0, ..self.plant.sensors };
        let settle_s = self.settle_s + self.dwell_s + 20.0 * self.time_constant_s;
        let plant = PlantConfig { sensors, data_sheet: None, ..self.plant };
        self.measure(plant, settle_s, (LIMIT_CYCLES + 0.5) / self.frequency_hz)
    }
}

fn x_over_z(result: &PointResult) -> f64 {
    f64::from(result.x_mean_cycle_max_m) / f64::from(result.z_amplitude_m)
}

/// What became of a point: its verdict, whether its limit repeats, and its true relative deviation from the limit.
struct Judged {
    seed: u64,
    verdict: Steadiness,
    repeats: bool,
    deviation: f64,
    interval: f64,
    limit_interval: f64,
    result: PointResult,
}

fn judge(seed: u64) -> Option<Judged> {
    let point = Point::draw(seed);
    let (result, limit) = (point.measured()?, point.limit()?);
    Some(Judged {
        seed,
        verdict: result.steadiness,
        repeats: limit.scatter < 2e-3,
        deviation: x_over_z(&result) / x_over_z(&limit) - 1.0,
        interval: f64::from(result.interval),
        limit_interval: f64::from(limit.interval),
        result,
    })
}

fn judge_all(count: u64) -> Vec<Judged> {
    let next = AtomicU64::new(0);
    let work = || {
        let mut done = vec![];
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= count {
                return done;
            }
            done.extend(judge(1_000_000 + seed));
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..2).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    })
}

#[test]
fn a_point_called_steady_is_within_1_percent_of_its_limit_and_most_points_within_are_called_steady() {
    let count = std::env::var("DAMPRIG_DRAWS").map_or(40, |n| n.parse().unwrap());
    let judged = judge_all(count);
    let of = |test: &dyn Fn(&Judged) -> bool| judged.iter().filter(|judged| test(judged)).count();
    let is_within = |judged: &Judged| judged.deviation.abs() <= 0.01;
    let is_called = |judged: &Judged| judged.verdict == Steadiness::Steady;
    let called = of(&|j| j.repeats && is_called(j));
    let right = of(&|j| j.repeats && is_called(j) && is_within(j));
    let within = of(&|j| j.repeats && is_within(j));
    println!("{} points, {} repeat: {called} called steady, {right} of them within 1 %; {within} within 1 %", judged.len(), of(&|j| j.repeats));
    println!("not repeating: {} steady, {} stationary, {} not steady", of(&|j| !j.repeats && is_called(j)), of(&|j| !j.repeats && j.verdict == Steadiness::Stationary), of(&|j| !j.repeats && j.verdict == Steadiness::NotSteady));
    println!("stationary: {} repeat, covered {}; not repeating covered {}", of(&|j| j.repeats && j.verdict == Steadiness::Stationary),
        of(&|j| j.repeats && j.verdict == Steadiness::Stationary && j.deviation.abs() < j.interval + j.limit_interval),
        of(&|j| !j.repeats && j.verdict == Steadiness::Stationary && j.deviation.abs() < j.interval + j.limit_interval));
    for j in &judged {
        if j.repeats && is_called(j) != is_within(j) {
            println!("{} {:?} true {:.4} est {:.4} u {:.4} scatter {:.4} interval {:.4} noise {:.4} X/Z {:.2}", j.seed, j.verdict, j.deviation, j.result.deviation, j.result.deviation_uncertainty, j.result.scatter, j.result.interval, j.result.x_noise_rms_m/j.result.x_mean_cycle_max_m, x_over_z(&j.result));
        }
    }
}
