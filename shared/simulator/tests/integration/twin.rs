//! The twin and a rig simulated in `f64`: the twin sees blocks of x and z with noise, and wall forces.

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::modes::Contact;
use damprig_core::integrator::sampled::{Sampled, SampledImpact, SampledObserver};
use damprig_core::integrator::units::Units;
use damprig_core::io::ForceScale;
use damprig_core::measure::impacts::{ImpactConfig, ImpactMeter};
use damprig_core::model::{Cavity, Initial, Particle, Restitution, SetUp, SpeedTable, Structure, Wall};
use damprig_core::twin::{Twin, TwinConfig, TwinSignals};
use damprig_simulator::plant::walls::{WallSensors, Walls};
use std::f64::consts::PI;

const MASS_KG: f64 = 1.6;

fn set_up(clearance_m: f64, restitution: f64, zeta: f64) -> SetUp {
    let particle = Particle {
        mass_kg: 0.1 * MASS_KG,
        clearance_m,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: restitution },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(MASS_KG, 2.5, zeta)) }
}

/// A rig at 10 kHz with its sensors, its impact meter and its twin.
struct Bench {
    truth: Sampled<f64>,
    walls: Walls,
    meter: ImpactMeter,
    twin: Twin,
    sample: u64,
    noise: u64,
    z_m: f64,
    /// Whether the force sensors at the walls at −d and at +d are connected.
    heard: [bool; 2],
}

struct Strikes<'a> {
    walls: &'a mut Walls,
    sub: f64,
}

impl SampledObserver<f64> for Strikes<'_> {
    fn impact(&mut self, impact: &SampledImpact<f64>) {
        let impulse = (MASS_KG * impact.kick * 1e4) as f32;
        self.walls.hit(((self.sub + impact.at) / 10.0) as f32, impact.side, impulse);
    }
}

impl Bench {
    fn new(truth: &SetUp, believed: &SetUp, z_m: f64, initial: &Initial) -> Self {
        Self {
            truth: Sampled::new(truth, Units::metres(1e-4), initial).unwrap(),
            walls: Walls::new(&WallSensors::default(), 3).unwrap(),
            meter: ImpactMeter::new(&ImpactConfig::default(), &ForceScale::default(), 10).unwrap(),
            twin: Twin::new(&TwinConfig::new(*believed)).unwrap(),
            sample: 0,
            noise: 1,
            z_m,
            heard: [true; 2],
        }
    }

    /// Uniformly distributed noise with 5 µm RMS.
    fn noise(&mut self) -> f64 {
        self.noise = self.noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.noise >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 5e-6 * 12f64.sqrt()
    }

    /// Advances rig, sensors and twin by one tick.
    fn tick(&mut self) -> TwinSignals {
        let omega = 2.0 * PI * 2.5e-4;
        let (mut x, mut z) = (0.0, 0.0);
        let tick = (self.sample / 10) as u32;
        for sub in 0..10 {
            let (t, u) = (self.sample as f64, (self.sample + 1) as f64);
            let at = |t: f64| self.z_m * libm::sin(omega * t);
            let slope = |t: f64| self.z_m * omega * libm::cos(omega * t);
            let segment = BaseSegment::hermite(at(t), at(u), slope(t), slope(u));
            self.truth.step(&segment, &mut Strikes { walls: &mut self.walls, sub: f64::from(sub) });
            let base = at(u);
            x += 0.1 * (self.truth.state().x + self.noise());
            z += 0.1 * (base + self.noise());
            self.sample += 1;
        }
        let Self { meter, twin, heard, .. } = self;
        meter.push(tick, &self.walls.read::<10>(None), |record| {
            if heard[usize::from(record.side > 0)] {
                twin.detected(record);
            }
        });
        self.twin.tick(tick, x as f32, z as f32)
    }

    fn run(&mut self, seconds: u32) -> TwinSignals {
        (1..seconds * 1000).for_each(|_| _ = self.tick());
        self.tick()
    }
}

/// The residual has a lower bound: noise of a mean of twenty samples of x (5/√20 = 1.1 µm). It may exceed it
/// slightly.
#[test]
fn a_twin_with_the_true_model_follows_the_motion_and_its_impacts() {
    let truth = set_up(15e-3, 0.5, 0.0038);
    let mut bench = Bench::new(&truth, &truth, 1.5e-3, &Initial::default());
    bench.run(30);
    let before = bench.twin_counts();
    let signals = bench.run(60);
    println!("{signals:?}");
    // An impulse is measured to a few thousandths, so the next impact is about 0.1 ms off, 4 µm of the structure.
    assert!(signals.residual_rms_m < 8e-6, "{signals:?}");
    assert!(signals.detected - before.1 > 250, "{signals:?}");
    assert_eq!(signals.missing, before.2, "{signals:?}");
    // At either end of the count an impact may be between its prediction and the end of its pulse.
    assert!((signals.predicted - before.0).abs_diff(signals.detected - before.1) <= 1, "{signals:?}");
    assert!(!signals.alarm);
}

/// RMS residual, m, and impacts that a twin misses from 30 s to 90 s.
fn followed(truth: &SetUp, twin: &SetUp, amplitude_m: f64, initial: &Initial) -> (f32, u32) {
    let mut bench = Bench::new(truth, twin, amplitude_m, initial);
    bench.run(30);
    let before = bench.twin_counts();
    let signals = bench.run(60);
    println!("{signals:?}");
    assert!(signals.detected - before.1 > 100, "{signals:?}");
    (signals.residual_rms_m, signals.missing - before.2)
}

/// The twin takes the particle's rebound from the measured impulse by the law of the wall. A twin with the coefficient at another
/// speed does not follow as closely.
#[test]
fn a_twin_follows_a_wall_whose_restitution_varies_with_the_speed() {
    let law = Restitution { coefficient: 0.9, reference_speed_m_per_s: 0.05, exponent: 0.3, maximum: 0.95 };
    let table = SpeedTable::new(&[[0.02, 0.93], [0.1, 0.75], [0.4, 0.5]]).expect("three points");
    follow_a_wall(Wall::SpeedRestitution(law));
    follow_a_wall(Wall::TableRestitution(table));
}

fn follow_a_wall(wall: Wall) {
    let with = |wall| {
        let mut set_up = set_up(15e-3, 0.5, 0.0038);
        set_up.particle.as_mut().expect("it has one").wall = wall;
        set_up
    };
    let truth = with(wall);
    let follow = |twin: &SetUp| followed(&truth, twin, 1.5e-3, &Initial::default());
    let (residual_rms_m, missing) = follow(&truth);
    // As with a constant coefficient.
    assert!(residual_rms_m < 8e-6 && missing == 0, "{residual_rms_m} {missing}");
    let (other_m, _) = follow(&with(Wall::Restitution { coefficient: 0.9 }));
    assert!(other_m > 3.0 * residual_rms_m, "{other_m} {residual_rms_m}");
}

/// Its twin without the weight loses the particle.
#[test]
fn a_twin_follows_an_inclined_cavity_off_its_centre_with_two_walls() {
    let lopsided = |inclination_deg: f64| {
        let mut set_up = set_up(15e-3, 0.6, 0.02);
        let positive_wall = Some(Wall::Restitution { coefficient: 0.3 });
        let particle = set_up.particle.as_mut().expect("it has one");
        particle.cavity = Cavity { positive_wall, offset_m: 5e-3, inclination_deg };
        set_up
    };
    let truth = lopsided(8.0);
    let follow = |twin: &SetUp| followed(&truth, twin, 3e-3, &truth.neutral());
    let (residual_rms_m, missing) = follow(&truth);
    assert!(residual_rms_m < 8e-6 && missing == 0, "{residual_rms_m} {missing}");
    let (other_m, _) = follow(&lopsided(0.0));
    assert!(other_m > 10.0 * residual_rms_m, "{other_m} {residual_rms_m}");
}

impl Bench {
    fn twin_counts(&mut self) -> (u32, u32, u32) {
        let signals = self.tick();
        (signals.predicted, signals.detected, signals.missing)
    }
}

/// The twin starts at rest while the rig is already moving, with its particle at any position.
#[test]
fn a_twin_that_starts_late_converges_to_the_rig() {
    let truth = set_up(15e-3, 0.5, 0.0038);
    let initial = Initial { x_m: 5e-3, v_m_per_s: 0.1, y_m: -8e-3, u_m_per_s: 0.0 };
    let mut bench = Bench::new(&truth, &truth, 1.5e-3, &initial);
    let early = bench.run(1);
    bench.run(30);
    let late = bench.run(5);
    println!("{early:?}\n{late:?}");
    assert!(early.residual_rms_m > 3e-4 && late.residual_rms_m < 2e-5, "{early:?} {late:?}");
}

#[test]
fn a_chaotic_motion_is_followed_too() {
    let truth = set_up(30e-3, 0.5, 0.0038);
    let mut bench = Bench::new(&truth, &truth, 1.5e-3, &Initial::default());
    let mut alarms = 0;
    let mut last = TwinSignals::NOTHING;
    for _ in 0..120_000 {
        last = bench.tick();
        alarms += u32::from(last.alarm);
    }
    println!("{last:?} {alarms}");
    assert_eq!(alarms, 0, "{last:?}");
    assert!(last.missing * 20 < last.predicted, "{last:?}");
}

#[test]
fn a_missing_particle_raises_the_alarm_within_two_cycles() {
    let truth = set_up(15e-3, 0.5, 0.0038);
    let mut bench = Bench::new(&truth, &truth, 1.5e-3, &Initial::default());
    assert!(!bench.run(30).alarm);
    let state = *bench.truth.state();
    let stays = Initial { x_m: state.x, v_m_per_s: state.v * 1e4, ..Initial::default() };
    bench.truth = Sampled::new(&SetUp { particle: None, ..truth }, Units::metres(1e-4), &stays).unwrap();
    let raised = (1..=2000).find(|_| bench.tick().alarm);
    println!("{raised:?} ms");
    // Three impacts take 1.5 cycles, 600 ms; the twin waits 100 ms for the last.
    assert!(raised.is_some_and(|ms| ms < 800), "{raised:?}");
}

#[test]
fn force_sensors_that_fall_silent_raise_the_alarm() {
    let truth = set_up(15e-3, 0.5, 0.0038);
    let mut bench = Bench::new(&truth, &truth, 1.5e-3, &Initial::default());
    bench.run(30);
    bench.heard = [false; 2];
    assert!(bench.run(1).alarm);
    bench.heard = [true; 2];
    assert!(!bench.run(1).alarm, "a matched impact clears the alarm");
}

#[test]
fn a_force_sensor_that_sticks_at_one_wall_raises_the_alarm_although_the_other_measures() {
    let truth = set_up(15e-3, 0.5, 0.0038);
    for dead in 0..2 {
        let mut bench = Bench::new(&truth, &truth, 1.5e-3, &Initial::default());
        bench.run(30);
        bench.heard[dead] = false;
        let raised = (1..=3000).find(|_| bench.tick().alarm);
        // Three impacts on one wall take three cycles, 1.2 s; the twin waits 100 ms for the last.
        assert!(raised.is_some_and(|ms| (1000..1700).contains(&ms)), "{raised:?}");
        bench.heard[dead] = true;
        assert!(!bench.run(1).alarm, "a matched impact on that wall clears the alarm");
    }
}

#[test]
fn a_wrong_model_shows_in_the_residual() {
    let truth = set_up(15e-3, 0.5, 0.0038);
    let mut wrong = truth;
    wrong.structure.stiffness_n_per_m *= 1.05;
    let mut bench = Bench::new(&truth, &wrong, 1.5e-3, &Initial::default());
    let signals = bench.run(30);
    println!("{signals:?}");
    assert!(signals.residual_rms_m > 1e-4, "{signals:?}");
}

#[test]
fn a_nan_sensor_value_does_not_stay_in_the_twin() {
    let truth = set_up(15e-3, 0.5, 0.0038);
    let mut bench = Bench::new(&truth, &truth, 1.5e-3, &Initial::default());
    bench.run(5);
    bench.twin.tick(5000, f32::NAN, 0.0);
    bench.twin.tick(5001, 0.0, f32::INFINITY);
    let signals = bench.run(30);
    assert!(signals.residual_rms_m < 2e-5, "{signals:?}");
}

/// Under constant acceleration the particle comes to rest at the wall behind it, with more bounces per tick than the
/// twin allows.
#[test]
fn a_chatter_beyond_the_events_of_a_tick_is_cut_short_at_the_wall() {
    let structure = Structure::from_modal(MASS_KG, 15.0, 0.3);
    let mut twin = Twin::new(&TwinConfig::new(SetUp { structure, ..set_up(1e-3, 0.9, 0.3) })).unwrap();
    let mut last = TwinSignals::NOTHING;
    for tick in 0..1000u16 {
        let time_s = f32::from(tick) * 1e-3;
        let z_m = 2.5 * time_s * time_s;
        last = twin.tick(tick.into(), z_m, z_m);
    }
    assert!(twin.motion().unresolved() > 0, "the chatter exceeds the events of a tick");
    assert_eq!(twin.motion().mode().map(|mode| mode.contact), Some(Contact::Held(-1)));
    assert_eq!(twin.motion().state().offset, -1e-3);
    // The structure lags by z″/ω² = 0.6 mm, less the effect of the observer's 1 Hz.
    assert!((last.x_m - 2.5 * 0.998 * 0.998).abs() < 1e-3, "{last:?}");
}
