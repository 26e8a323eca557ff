//! Verdicts on the steadiness of drawn set-ups, against the limit that the same set-up without noise reaches.
//!
//! 40 set-ups and 40 bare structures whose free vibration beats, or 600 of each with `DAMPRIG_FULL`. The limit is that of a run whose point settles for 20 time constants of the
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

    /// A well-damped bare structure off resonance that has settled for some time constants only: its free vibration still beats with
    /// the drive.
    fn draw_beating(seed: u64) -> Self {
        let mut draw = Draw(Xoshiro128PlusPlus::seed_from_u64(seed));
        let natural_hz = draw.between(1.5, 5.0);
        let damping_ratio = draw.log_between(0.005, 0.05);
        let ratio = if draw.chance(0.5) { draw.between(0.6, 0.95) } else { draw.between(1.05, 1.6) };
        let frequency_hz = f64::from((natural_hz * ratio) as f32);
        let mut plant = PlantConfig::ideal(SetUp::bare(Structure::from_modal(1.6, natural_hz, damping_ratio)));
        plant.sensors.seed = seed;
        if draw.chance(0.3) {
            plant.data_sheet = Some(DataSheet::default());
        }
        let time_constant_s = 1.0 / (damping_ratio * TAU * natural_hz);
        Self {
            plant,
            frequency_hz,
            z_m: draw.log_between(5e-4, 3e-3),
            settle_s: (draw.between(0.5, 3.0) * time_constant_s).max(2.0),
            dwell_s: draw.between(12.0, 80.0) / frequency_hz,
            time_constant_s,
        }
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
    limit_interval: f64,
    result: PointResult,
}

fn judge(seed: u64, point: &Point) -> Option<Judged> {
    let (result, limit) = (point.measured()?, point.limit()?);
    Some(Judged {
        seed,
        verdict: result.steadiness,
        repeats: limit.scatter < 2e-3,
        deviation: x_over_z(&result) / x_over_z(&limit) - 1.0,
        limit_interval: f64::from(limit.interval),
        result,
    })
}

fn judge_all(count: u64, draw: fn(u64) -> Point) -> Vec<Judged> {
    let next = AtomicU64::new(0);
    let work = || {
        let mut done = vec![];
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= count {
                return done;
            }
            done.extend(judge(2_000_000 + seed, &draw(2_000_000 + seed)));
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..2).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    })
}

#[test]
fn a_point_called_steady_is_within_1_percent_of_its_limit_and_most_points_within_are_called_steady() {
    let is_full = std::env::var_os("DAMPRIG_FULL").is_some();
    let judged = judge_all(if is_full { 600 } else { 40 }, Point::draw);
    let count = |test: &dyn Fn(&Judged) -> bool| judged.iter().filter(|judged| test(judged)).count();
    let is_within = |judged: &Judged| judged.deviation.abs() <= 0.01;
    let is = |verdict: Steadiness| move |judged: &Judged| judged.verdict == verdict;
    let called = count(&|j| j.repeats && is(Steadiness::Steady)(j));
    let right = count(&|j| j.repeats && is(Steadiness::Steady)(j) && is_within(j));
    let within = count(&|j| j.repeats && is_within(j));
    println!("repeating: {called} called steady, {right} of them within 1 % of the limit; {within} within 1 %");
    for judged in judged.iter().filter(|j| j.repeats && is(Steadiness::Steady)(j) && !is_within(j)) {
        println!("seed {}: {:.4} from its limit: {:?}", judged.seed, judged.deviation, judged.result);
    }
    let others = |verdict| count(&|j: &Judged| !j.repeats && is(verdict)(j));
    let (steady, stationary) = (others(Steadiness::Steady), others(Steadiness::Stationary));
    let covers = |j: &Judged| j.deviation.abs() <= f64::from(j.result.interval) + j.limit_interval;
    let covered = count(&|j| !j.repeats && is(Steadiness::Stationary)(j) && covers(j));
    println!("not repeating: {steady} steady, {stationary} stationary, {covered} of these within the intervals");
    // The aims are 99 % and 90 %. Of 350 points, one standard deviation is 0.5 % and 1.6 %; of 20, 2 % and 7 %.
    let [least_right, least_found] = if is_full { [0.985, 0.88] } else { [0.95, 0.8] };
    assert!(right as f64 >= least_right * called as f64 && called > 10, "{right} of {called}");
    assert!(right as f64 >= least_found * within as f64, "{right} of {within}");
    // Two intervals of 95 %.
    assert!(covered as f64 >= 0.85 * stationary as f64, "{covered} of {stationary}");
    // A scatter of 1 % may hide in a motion that does not repeat; its X/Z is within 1 % then.
    let wrong = count(&|j| !j.repeats && is(Steadiness::Steady)(j) && j.deviation.abs() > 0.01 + j.limit_interval);
    assert!(wrong as f64 <= 0.05 * steady.max(20) as f64, "{wrong} of {steady}");
}

#[test]
fn a_point_whose_free_vibration_still_beats_is_called_steady_only_within_1_percent_of_its_limit() {
    let is_full = std::env::var_os("DAMPRIG_FULL").is_some();
    let judged = judge_all(if is_full { 600 } else { 40 }, Point::draw_beating);
    let is_within = |judged: &&Judged| judged.deviation.abs() <= 0.01;
    let is_steady = |judged: &&Judged| judged.verdict == Steadiness::Steady;
    let called = judged.iter().filter(is_steady).count();
    let right = judged.iter().filter(is_steady).filter(is_within).count();
    let within = judged.iter().filter(is_within).count();
    println!("beating: {called} of {} called steady, {right} of them within 1 %; {within} within 1 %", judged.len());
    for judged in judged.iter().filter(is_steady).filter(|judged| !is_within(judged)) {
        println!("seed {}: {:.4} from its limit: {:?}", judged.seed, judged.deviation, judged.result);
    }
    // As above; of 500 points, one standard deviation is 0.45 % and 1.4 %.
    let [least_right, least_found] = if is_full { [0.985, 0.88] } else { [0.95, 0.8] };
    assert!(right as f64 >= least_right * called as f64 && called > 10, "{right} of {called}");
    assert!(right as f64 >= least_found * within as f64, "{right} of {within}");
}

/// ζ = 0.01 at r = 0.8, 1.6 time constants after the start: the deviation from |X/Z| = √(1 + (2ζr)²)/√((1 − r²)² + (2ζr)²).
#[test]
fn the_stated_deviation_has_what_a_beat_adds_to_the_cycle_maxima() {
    let (zeta, r) = (0.01_f64, 0.8_f64);
    let loss = 2.0 * zeta * r;
    let limit = (1.0 + loss * loss).sqrt() / (1.0 - r * r).hypot(loss);
    for ramp_s in [0.0, 0.5, 2.0] {
        let mut host = Host::new(PlantConfig::ideal(SetUp::bare(Structure::from_modal(1.6, 2.5, zeta))));
        host.done(Request::Configure(SteppedSine {
            start: Start::FromRest { level_m: 5e-4 },
            amplitude_m: 1e-3,
            drive: DriveMode::Constant,
            ramp_s,
            settle_s: 10.0,
            dwell_s: 30.0,
            steady: SteadyLimits::default(),
            first_index: 0,
            frequencies_hz: [2.0].into_iter().collect(),
        }));
        host.done(Request::Start);
        host.pass(50_000);
        let [result] = host.points()[..] else { panic!("{:?}", host.events) };
        let deviation = x_over_z(&result) / limit - 1.0;
        let (stated, uncertainty) = (f64::from(result.deviation), f64::from(result.deviation_uncertainty));
        println!("ramp {ramp_s} s: {deviation:.5}, stated {stated:.5} ± {uncertainty:.5}, {:?}", result.steadiness);
        assert!((deviation - stated).abs() <= uncertainty, "{deviation}: {result:?}");
        assert!(deviation.abs() <= 0.01 || result.steadiness != Steadiness::Steady, "{deviation}: {result:?}");
    }
}

/// The bare structure of the source document at resonance.
fn at_resonance(plant: PlantConfig, z_m: f32, settle_s: f32, longest_dwell_s: f32) -> PointResult {
    let mut host = Host::new(plant);
    host.done(Request::Configure(SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: z_m,
        drive: DriveMode::Constant,
        ramp_s: 2.0,
        settle_s,
        dwell_s: 20.0,
        steady: SteadyLimits { longest_dwell_s, ..SteadyLimits::default() },
        first_index: 0,
        frequencies_hz: [2.5].into_iter().collect(),
    }));
    host.done(Request::Start);
    host.pass(400_000);
    let [result] = host.points()[..] else { panic!("{:?}", host.events) };
    result
}

fn bare() -> PlantConfig {
    PlantConfig::ideal(SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)))
}

/// √(1 + (2ζ)²)/2ζ.
const AT_RESONANCE: f64 = 131.58;

#[test]
fn a_point_that_is_not_steady_is_measured_again_until_it_is_or_its_time_is_over() {
    let dwells = |result: &PointResult| (result.end_tick - 4_000) / 20_000;
    let once = at_resonance(bare(), 4e-4, 4.0, 0.0);
    assert_eq!((once.steadiness, dwells(&once)), (Steadiness::NotSteady, 1), "{once:?}");
    let twice = at_resonance(bare(), 4e-4, 4.0, 59.0);
    assert_eq!((twice.steadiness, dwells(&twice)), (Steadiness::NotSteady, 2), "{twice:?}");
    let steady = at_resonance(bare(), 4e-4, 4.0, 300.0);
    assert_eq!(steady.steadiness, Steadiness::Steady, "{steady:?}");
    assert!((x_over_z(&steady) / AT_RESONANCE - 1.0).abs() < 0.01, "{steady:?}");
    // After 64 s the mean of a dwell is 1.2 % below the limit (time constant 16.8 s), after 84 s 0.4 %.
    assert!((4..=5).contains(&dwells(&steady)), "{steady:?}");
}

#[test]
fn a_shaken_base_that_still_sags_is_not_steady_although_the_structure_is() {
    let plant = PlantConfig { base: Base::Shaker(Shaker::default()), ..bare() };
    let early = at_resonance(plant, 3e-4, 4.0, 0.0);
    let late = at_resonance(plant, 3e-4, 60.0, 0.0);
    let off = |result: &PointResult| x_over_z(result) / AT_RESONANCE - 1.0;
    assert!(off(&early) < -0.1 && early.change_per_cycle.abs() < 1e-3, "{early:?}");
    assert_eq!(early.steadiness, Steadiness::NotSteady, "{early:?}");
    assert!(off(&late).abs() < 0.01, "{late:?}");
    assert_eq!(late.steadiness, Steadiness::Steady, "{late:?}");
}
