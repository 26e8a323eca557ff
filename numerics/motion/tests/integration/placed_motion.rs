//! On a structure of one mode a motion with places is that of the sampled engine, in all that its observers are told.

use std::f64::consts::TAU;
use std::sync::Arc;

use damprig_core::integrator::base::BaseSegment;
use damprig_core::model::{Cavity, FrictionDamper, Initial, Particle, Release, SetUp, Structure, Tmd, Wall};
use damprig_motion::placed_motion::PlacedStructure;
use damprig_motion::rig_model::RigModel;
use damprig_motion::watch::{Detection, MotionWatch, WatchedPulse};
use damprig_structures::{Modes, Storey};

const STEP_S: f64 = 1e-3;

/// What the sampled engine leaves out of a motion in contact with a soft wall: of a flight of a twentieth of a radian nothing, of the instants at which
/// contacts begin and end what its search for roots leaves. It is this distance of another start that the motion is compared with.
const NEARBY: f64 = 1e-9;

fn structure() -> Structure {
    Structure::from_modal(1.6, 2.5, 0.0038)
}

fn particle(wall: Wall, cavity: Cavity) -> Option<Particle> {
    Some(Particle { mass_kg: 0.16, clearance_m: 0.006, friction_coefficient: 0.03, wall, cavity })
}

fn model(set_up: SetUp, is_placed: bool) -> RigModel {
    let placed = is_placed.then(|| {
        let structure: Modes = set_up.structure.into();
        Arc::new(PlacedStructure { structure, observed: 0, particle: 0, friction_damper: (0, None), tmd: 0 })
    });
    RigModel { set_up, placed }
}

/// x after every step, and the pulses on the walls, with x and particle started where `initial` says.
fn moved(model: &RigModel, initial: &Initial, z_m: f64) -> (Vec<f64>, Vec<WatchedPulse>) {
    let detection = Detection { threshold_n: 0.5, refractory_s: 2e-3, ringing: 0.1, contact_s: 2e-3 };
    let mut watch = MotionWatch::new(&detection, model.set_up.structure.mass_kg, STEP_S).with_pulses();
    let mut motion = model.motion(STEP_S, initial).expect("it starts");
    let turning = TAU * 2.5 * STEP_S;
    let at = |n: u32| {
        let (sine, cosine) = (turning * f64::from(n)).sin_cos();
        (z_m * sine, z_m * turning * cosine)
    };
    let mut x_m = Vec::new();
    for n in 0..4_000 {
        let ((start, rate), (end, end_rate)) = (at(n), at(n + 1));
        motion.step(&BaseSegment::hermite(start, end, rate, end_rate), &mut watch);
        x_m.push(motion.x_m());
        let _ = watch.end_step(motion.x_m());
    }
    assert_eq!(motion.refused(), None);
    (x_m, watch.into_pulses())
}

fn moves_as_one_degree(name: &str, set_up: SetUp, initial: Initial, z_m: f64) -> usize {
    let [(one, pulses), (placed, others)] =
        [false, true].map(|is_placed| moved(&model(set_up, is_placed), &initial, z_m));
    let largest = one.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let distance =
        |other: &[f64]| one.iter().zip(other).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs())) / largest;
    let beside = Initial { x_m: initial.x_m + NEARBY * largest, y_m: initial.y_m + NEARBY * largest, ..initial };
    let (off, nearby) = (distance(&placed), distance(&moved(&model(set_up, false), &beside, z_m).0));
    println!("{name}: {off:.1e} of the motion, {nearby:.1e} from {NEARBY:e} beside, {} pulses", pulses.len());
    assert!(off < nearby.max(NEARBY), "{name}: {off:e}");
    // The last bounces of a chatter are rounding.
    let strongest_n = pulses.iter().fold(0.0_f64, |most, pulse| most.max(pulse.peak_n));
    let told = |all: Vec<WatchedPulse>| -> Vec<WatchedPulse> {
        all.into_iter().filter(|pulse| pulse.peak_n > 1e-3 * strongest_n).collect()
    };
    let [pulses, others] = [pulses, others].map(told);
    assert_eq!(pulses.len(), others.len(), "{name}");
    for (own, other) in pulses.iter().zip(&others) {
        assert_eq!((own.side, own.is_counted), (other.side, other.is_counted), "{name}");
        // A hundredth of a step, far less than between pulses.
        assert!((own.from - other.from).abs() < 1e-2, "{name}: {own:?} {other:?}");
        // The peak of a soft wall's force is taken at the ends of flights, which differ.
        assert!((own.peak_n - other.peak_n).abs() < 1e-3 * own.peak_n + 1e-6, "{name}: {own:?} {other:?}");
    }
    pulses.len()
}

#[test]
fn hard_walls() {
    let wall = Wall::Restitution { coefficient: 0.5 };
    let set_up = SetUp { particle: particle(wall, Cavity::default()), ..SetUp::bare(structure()) };
    let count = moves_as_one_degree("hard walls", set_up, Initial::default(), 0.003);
    assert!(count >= 12, "{count} pulses");
    let cavity =
        Cavity { positive_wall: Some(Wall::Restitution { coefficient: 0.8 }), offset_m: 0.001, inclination_deg: 20.0 };
    let inclined = SetUp { particle: particle(wall, cavity), ..SetUp::bare(structure()) };
    moves_as_one_degree("two walls, off-centre, inclined", inclined, inclined.neutral(), 0.003);
}

#[test]
fn soft_walls() {
    for release in [Release::ZeroForce, Release::ZeroPenetration] {
        let wall = Wall::Voigt { stiffness_n_per_m: 4_000.0, damping_n_s_per_m: 4.0, release };
        let set_up = SetUp { particle: particle(wall, Cavity::default()), ..SetUp::bare(structure()) };
        let count = moves_as_one_degree("soft walls", set_up, Initial::default(), 0.003);
        assert!(count >= 12, "{count} pulses");
    }
}

#[test]
fn friction_tuned_mass_and_a_release() {
    let friction = SetUp { friction_damper: Some(FrictionDamper { force_n: 0.2 }), ..SetUp::bare(structure()) };
    moves_as_one_degree("friction", friction, Initial::default(), 0.003);
    let tmd = Some(Tmd { mass_kg: 0.1, stiffness_n_per_m: 22.0, damping_n_s_per_m: 0.15 });
    moves_as_one_degree("tuned mass", SetUp { tmd, ..SetUp::bare(structure()) }, Initial::default(), 0.003);
    let released = Initial { x_m: 0.02, y_m: 0.02, ..Initial::default() };
    moves_as_one_degree("release", friction, released, 0.0);
}

/// Pulled at a floor, a frame takes its static deflection: modes have the shares φ²/ω² of it, and keep them without damping.
#[test]
fn a_release_begins_at_the_static_deflection() {
    let storey = Storey { mass_kg: 1.0, stiffness_n_per_m: 400.0, damping_n_s_per_m: 0.0 };
    let modes = Modes::storeys(&[storey; 2]).expect("a frame");
    for observed in [0, 1] {
        let shares: Vec<(f64, f64)> = modes
            .modes
            .iter()
            .map(|mode| {
                (
                    mode.shape[observed].powi(2) / mode.angular_frequency_rad_per_s.powi(2),
                    mode.angular_frequency_rad_per_s,
                )
            })
            .collect();
        // Pulled by the lower floor, whose spring is 400 N/m, both floors move alike.
        let whole: f64 = shares.iter().map(|(share, _)| share).sum();
        assert!((whole * 400.0 - (observed + 1) as f64).abs() < 1e-12, "{whole}");
        let placed =
            PlacedStructure { structure: modes.clone(), observed, particle: 0, friction_damper: (0, None), tmd: 0 };
        let model = RigModel { set_up: SetUp::bare(structure()), placed: Some(Arc::new(placed)) };
        let mut motion = model.motion(STEP_S, &Initial { x_m: 0.02, ..Initial::default() }).expect("it starts");
        assert_eq!(motion.x_m(), 0.02);
        for n in 1..=2_000 {
            motion.step(&BaseSegment::at_rest(0.0), &mut ());
            let t_s = f64::from(n) * STEP_S;
            let expected: f64 = shares.iter().map(|(share, omega)| 0.02 * share / whole * (omega * t_s).cos()).sum();
            assert!((motion.x_m() - expected).abs() < 1e-12, "{n}: {} {expected}", motion.x_m());
        }
    }
}

/// A mode of 600 Hz moves 3.8 rad in a step: flights are parts of it, and x at their ends is that of the whole step.
#[test]
fn flights_follow_fast_modes() {
    let mut modes = Modes::from(structure());
    let mut fast = modes.modes[0].clone();
    fast.angular_frequency_rad_per_s = TAU * 600.0;
    modes.modes.push(fast);
    let placed =
        Arc::new(PlacedStructure { structure: modes, observed: 0, particle: 0, friction_damper: (0, None), tmd: 0 });
    let wall = Wall::Restitution { coefficient: 0.5 };
    let set_up = SetUp { particle: particle(wall, Cavity::default()), ..SetUp::bare(structure()) };
    let model = RigModel { set_up, placed: Some(placed) };
    let mut motion = model.motion(STEP_S, &Initial { x_m: 0.01, y_m: 0.01, ..Initial::default() }).expect("it starts");
    let mut ends = Ends::default();
    for _ in 0..500 {
        motion.step(&BaseSegment::at_rest(0.0), &mut ends);
        assert!((ends.x_m - motion.x_m()).abs() < 1e-9 * 0.01, "{} {}", ends.x_m, motion.x_m());
    }
    assert!(ends.largest_gap_m < 1e-9 * 0.01, "flights join: {}", ends.largest_gap_m);
    assert!(ends.flights > 3_000 && ends.impacts > 0, "{} flights, {} impacts", ends.flights, ends.impacts);
}

/// The ends of flights.
#[derive(Default)]
struct Ends {
    x_m: f64,
    largest_gap_m: f64,
    flights: u32,
    impacts: u32,
}

impl damprig_core::integrator::sampled::SampledObserver<f64> for Ends {
    fn flight(&mut self, _: f64, length: f64, flight: &damprig_core::integrator::sampled::Flight<f64>) {
        if self.flights > 0 {
            self.largest_gap_m = self.largest_gap_m.max((flight.x[0] - self.x_m).abs());
        }
        self.x_m = damprig_core::integrator::polynomial::value(&flight.x, length);
        self.flights += 1;
    }

    fn impact(&mut self, _: &damprig_core::integrator::sampled::SampledImpact<f64>) {
        self.impacts += 1;
    }
}
