//! Verdicts and stated deviations of drawn points, against the limit that each point reaches.
//!
//! The board's stepped sine measures the simulated plant: 200 points, or 3 000 with `DAMPRIG_FULL`, of which some 2 250 are called steady.
//! The limit is that of a run without noise that settles for 12 time constants of the structure more, measured over 128 cycles.

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicU64, Ordering};

use damprig_core::control::outcome::{Outcome, TickInputs};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine, SteppedSinePlan, SteppedSineRunner};
use damprig_core::io::{Actuators, DriveScale, SensorSet};
use damprig_core::measure::point::PointResult;
use damprig_core::measure::steadiness::{Steadiness, SteadyLimits};
use damprig_core::model::{Cavity, FrictionDamper, Particle, SetUp, Structure, Tmd, Tuning, Wall};
use damprig_simulator::plant::{Base, DataSheet, Plant, PlantConfig, SensorModel, Shaker};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro128PlusPlus;

use super::{closed_form, x_over_z};

/// Cycles over which the limit is measured.
const LIMIT_CYCLES: f64 = 128.0;

const MASS_KG: f64 = 1.6;

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

const DAMPERS: [&str; 5] = ["bare", "impact", "friction", "hybrid", "tuned mass"];

/// A set-up, its excitation, and the time constant of its structure.
#[derive(Clone, Copy)]
struct Point {
    damper: usize,
    plant: PlantConfig,
    natural_hz: f64,
    damping_ratio: f64,
    frequency_hz: f64,
    z_m: f64,
    ramp_s: f64,
    settle_s: f64,
    dwell_s: f64,
}

impl Point {
    /// Half of the points: the source document's structure with a damping ratio of 0.5 to 2 % at 1.5 to 3.5 Hz, settled for 10 s and
    /// measured for 30 s. The others are drawn from wider ranges, with other sensors and on a shaker.
    fn draw(seed: u64) -> Self {
        let mut draw = Draw(Xoshiro128PlusPlus::seed_from_u64(seed));
        let damper = seed as usize % DAMPERS.len();
        let is_wide = draw.chance(0.5);
        let natural_hz = if is_wide { draw.between(1.5, 5.0) } else { 2.5 };
        let damping_ratio = if is_wide { draw.log_between(0.003, 0.05) } else { draw.log_between(0.005, 0.02) };
        let near = is_wide && draw.chance(0.3);
        let ratio = if near { draw.between(0.95, 1.05) } else { draw.between(0.6, 1.4) };
        let frequency_hz = f64::from((natural_hz * ratio) as f32);
        let structure = Structure::from_modal(MASS_KG, natural_hz, damping_ratio);
        let z_m = draw.log_between(5e-4, 3e-3);
        let mut plant = PlantConfig::ideal(Self::set_up(structure, damper, z_m, &mut draw));
        plant.sensors.seed = seed;
        let (mut settle_s, mut dwell_s) = (10.0, 30.0);
        if is_wide {
            settle_s = if draw.chance(0.3) { 2.0 } else { draw.between(2.0, 40.0) };
            dwell_s = draw.between(12.0, 80.0) / frequency_hz;
            if draw.chance(0.4) {
                plant.base = Base::Shaker(Shaker { calibrated_at_hz: frequency_hz, ..Shaker::default() });
            }
            match draw.between(0.0, 3.0) as u32 {
                // 16 bit over ±80 mm, 30 µm per 1 kHz sample.
                0 => {
                    plant.sensors.resolution_m = 0.16 / 65_536.0;
                    plant.sensors.noise_rms_m = 30e-6 * 10f32.sqrt();
                }
                1 => plant.data_sheet = Some(DataSheet::default()),
                _ => {}
            }
        }
        let ramp_s = if draw.chance(0.5) { 2.0 } else { 0.0 };
        Self { damper, plant, natural_hz, damping_ratio, frequency_hz, z_m, ramp_s, settle_s, dwell_s }
    }

    fn set_up(structure: Structure, damper: usize, z_m: f64, draw: &mut Draw) -> SetUp {
        let mut set_up = SetUp::bare(structure);
        if matches!(DAMPERS[damper], "impact" | "hybrid") {
            set_up.particle = Some(Particle {
                mass_kg: MASS_KG * draw.between(0.03, 0.2),
                clearance_m: z_m * draw.log_between(1.0, 20.0),
                friction_coefficient: if draw.chance(0.5) { 0.0 } else { draw.between(0.0, 0.03) },
                wall: Wall::Restitution { coefficient: draw.between(0.2, 0.8) },
                cavity: Cavity::default(),
            });
        }
        if matches!(DAMPERS[damper], "friction" | "hybrid") {
            let force_n = draw.between(0.1, 0.7) * structure.stiffness_n_per_m * z_m;
            set_up.friction_damper = Some(FrictionDamper { force_n });
        }
        if DAMPERS[damper] == "tuned mass" {
            let mass_ratio = draw.between(0.03, 0.2);
            let frequency_ratio = Tuning::DenHartog.frequency_ratio(mass_ratio) * draw.between(0.9, 1.1);
            let damping_ratio = Tuning::DenHartog.damping_ratio(mass_ratio) * draw.between(0.1, 1.0);
            set_up.tmd = Some(Tmd::from_ratios(&structure, MASS_KG * mass_ratio, frequency_ratio, damping_ratio));
        }
        set_up
    }

    /// The result of the point; none if the base does not follow or x is beyond its sensor.
    fn measure(&self, plant: &PlantConfig, settle_s: f64, dwell_s: f64) -> Option<PointResult> {
        let plan = SteppedSinePlan::new(SteppedSine {
            start: Start::CarryOver,
            amplitude_m: self.z_m as f32,
            drive: DriveMode::Constant,
            ramp_s: self.ramp_s as f32,
            settle_s: settle_s as f32,
            dwell_s: dwell_s as f32,
            steady: SteadyLimits::default(),
            first_index: 0,
            points: [self.frequency_hz as f32].into_iter().collect(),
        })
        .unwrap();
        let mut runner = SteppedSineRunner::new(&plan, &DriveScale::default().range());
        let mut rig = Plant::<f64>::new(plant).unwrap();
        let mut actuators = Actuators { drive_enabled: true, ..Actuators::default() };
        for tick in 0.. {
            let readings = rig.tick(&actuators).readings;
            let clipped = SensorSet::default();
            let (drive_m, outcome) =
                runner.tick(&TickInputs { tick, readings: &readings, impacts: rig.impacts(), clipped });
            actuators.drive_m = drive_m;
            match outcome {
                Outcome::Running => {}
                Outcome::Finished(result) => {
                    return (result.max_abs_x_m < 0.99 * plant.sensors.range_m[0]).then_some(result);
                }
                _ => return None,
            }
        }
        None
    }

    /// The result without noise after 12 more time constants.
    fn limit(&self) -> Option<PointResult> {
        let sensors = SensorModel { noise_rms_m: 0.0, resolution_m: 0.0, ..self.plant.sensors };
        let data_sheet = self.plant.data_sheet.map(|sheet| DataSheet { bits: 20, ..sheet });
        let time_constant_s = 1.0 / (self.damping_ratio * TAU * self.natural_hz);
        let settle_s = self.settle_s + self.dwell_s + 12.0 * time_constant_s;
        let limit = self.measure(
            &PlantConfig { sensors, data_sheet, ..self.plant },
            settle_s,
            (LIMIT_CYCLES + 0.5) / self.frequency_hz,
        )?;
        if DAMPERS[self.damper] == "bare" && data_sheet.is_none() {
            let exact = closed_form(self.damping_ratio, self.frequency_hz / self.natural_hz);
            // A tick's mean, and the tick nearest to a maximum: (π f/1000)²/6 each at 8 Hz.
            assert!((x_over_z(&limit) / exact - 1.0).abs() < 2e-4, "{limit:?}, {exact}");
        }
        Some(limit)
    }
}

/// A point's result, and its limit.
struct Judged {
    damper: usize,
    result: PointResult,
    /// The limit repeats from cycle to cycle.
    repeats: bool,
    /// True relative deviation from the limit, and how well the limit is known.
    deviation: f64,
    limit_interval: f64,
}

impl Judged {
    fn is(&self, verdict: Steadiness) -> bool {
        self.result.steadiness == verdict
    }

    fn is_steady(&self) -> bool {
        self.is(Steadiness::Steady)
    }

    fn is_near(&self) -> bool {
        self.deviation.abs() <= 0.01 + self.limit_interval
    }

    /// The true deviation is as stated, within the stated uncertainty.
    fn is_as_stated(&self) -> bool {
        let error = self.deviation - f64::from(self.result.deviation);
        error.abs() <= f64::from(self.result.deviation_uncertainty) + self.limit_interval
    }
}

fn judge(seed: u64) -> Option<Judged> {
    let point = Point::draw(seed);
    let (result, limit) = (point.measure(&point.plant, point.settle_s, point.dwell_s)?, point.limit()?);
    let repeats = limit.scatter < 2e-3;
    Some(Judged {
        damper: point.damper,
        result,
        repeats,
        deviation: x_over_z(&result) / x_over_z(&limit) - 1.0,
        limit_interval: if repeats { 0.0 } else { f64::from(limit.interval) },
    })
}

fn judge_all(count: u64) -> Vec<Judged> {
    let next = AtomicU64::new(0);
    let work = || std::iter::from_fn(|| Some(next.fetch_add(1, Ordering::Relaxed)).filter(|seed| *seed < count));
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..2).map(|_| scope.spawn(|| work().filter_map(judge).collect::<Vec<_>>())).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    })
}

#[test]
fn a_point_called_steady_is_within_1_percent_of_its_limit_and_within_its_own_interval() {
    let is_full = std::env::var_os("DAMPRIG_FULL").is_some();
    let judged = judge_all(if is_full { 3000 } else { 200 });
    let count = |test: &dyn Fn(&Judged) -> bool| judged.iter().filter(|judged| test(judged)).count() as f64;
    let steady = count(&Judged::is_steady);
    let wrong = count(&|j| j.is_steady() && !j.is_near());
    let as_stated = count(&|j| j.is_steady() && j.is_as_stated());
    let near = count(&|j| j.repeats && j.is_near());
    let found = count(&|j| j.repeats && j.is_near() && j.is_steady());
    let stationary = count(&|j| j.is(Steadiness::Stationary));
    let covers = |j: &Judged| j.deviation.abs() <= f64::from(j.result.interval.max(0.01)) + j.limit_interval;
    let covered = count(&|j| j.is(Steadiness::Stationary) && covers(j));
    println!("{} points: {steady} steady, {wrong} of them off by more than 1 %, {as_stated} as stated", judged.len());
    println!(
        "{near} repeat and are within 1 %, {found} of these steady; {stationary} stationary, {covered} within their interval"
    );
    for (damper, name) in DAMPERS.iter().enumerate() {
        let of = |test: &dyn Fn(&Judged) -> bool| count(&|j| j.damper == damper && test(j));
        println!(
            "{name}: {} steady, {} off, {} as stated; {} near, {} found",
            of(&Judged::is_steady),
            of(&|j| j.is_steady() && !j.is_near()),
            of(&|j| j.is_steady() && j.is_as_stated()),
            of(&|j| j.repeats && j.is_near()),
            of(&|j| j.repeats && j.is_near() && j.is_steady()),
        );
    }
    for judged in judged.iter().filter(|judged| judged.is_steady() && !judged.is_near()) {
        println!("{}, off by {:.4}: {:?}", DAMPERS[judged.damper], judged.deviation, judged.result);
    }
    // Of 200 points the shares scatter by 0.4 %, 1.5 % and 2.5 %.
    let [most_wrong, least_as_stated, least_found] = if is_full { [0.005, 0.93, 0.91] } else { [0.013, 0.9, 0.86] };
    assert!(wrong <= most_wrong * steady && steady > 100.0, "{wrong} of {steady}");
    assert!(as_stated >= least_as_stated * steady, "{as_stated} of {steady}");
    assert!(found >= least_found * near, "{found} of {near}");
    assert!(covered >= 0.85 * stationary, "{covered} of {stationary}");
}
