//! Piezoelectric walls: limits, closed forms, a second method, and where the energy goes.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::modes::Contact;
use damprig_core::model::{Cavity, Dissipation, FrictionDamper, Hertz, Particle, Release, Wall};
use damprig_structures::{
    Body, Drive, EnergyBook, FrictionJoint, Harvest, ImpactDamper, Mode, Modes, Motion, MotionCase, NoDerivatives,
    Observer, Piece, PiezoelectricWall, SetUp, State, base_at_start,
};
use fastrand::Rng;

use crate::piezoelectric_second_method::{CHARGE, ENERGY, Point, Reference, Sine, Y};
use crate::random_set_ups::cubic;

/// θ²/(kC) is 1, RC 4 ms; half a period of the particle at k takes 14 ms.
pub const WALL: PiezoelectricWall =
    PiezoelectricWall { stiffness_n_per_m: 8_000.0, capacitance_f: 2e-8, coupling_n_per_v: 12.65e-3, load_ohm: 2e5 };

pub const SINE: Sine = Sine { amplitude_m: 0.003, turning: TAU * 2.2, phase_rad: 0.4 };

pub fn excitation(of: Sine) -> Excitation {
    let Sine { amplitude_m, turning, phase_rad } = of;
    Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: turning, phase_rad }
}

/// Two modes at two places.
fn structure() -> Modes {
    let mode = |hz: f64, shape: [f64; 2], participation: f64| Mode {
        angular_frequency_rad_per_s: TAU * hz,
        damping_ratio: 0.03,
        shape: shape.to_vec(),
        participation,
    };
    Modes {
        modes: vec![mode(2.5, [0.8, 0.5], 1.2), mode(9.0, [0.4, -0.7], 0.5)],
        influence: vec![1.0; 2],
        coupling_per_s: Vec::new(),
    }
}

fn particle(wall: Wall) -> Particle {
    Particle { mass_kg: 0.16, clearance_m: 0.006, friction_coefficient: 0.0, wall, cavity: Cavity::default() }
}

pub fn soft(stiffness_n_per_m: f64) -> Wall {
    Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m: 0.0, release: Release::ZeroForce }
}

/// A particle at the first place between walls that are replaced where given.
pub fn set_up(wall: Wall, piezoelectric: [Option<PiezoelectricWall>; 2]) -> SetUp {
    let damper = ImpactDamper { piezoelectric, ..ImpactDamper::new(0, particle(wall)) };
    SetUp { impact_dampers: vec![damper], ..SetUp::bare(structure()) }
}

/// A motion that begins at rest, with the particles in the middle of their cavities.
pub fn motion(set_up: &SetUp, excitation: &Excitation) -> Motion {
    let base = base_at_start(excitation);
    let mut start = set_up.at_rest(base);
    for n in 0..start.particles.len() {
        start.particles[n].y_m = set_up.place(&start, set_up.impact_dampers[n].place, base).y_m;
    }
    Motion::new(set_up, excitation, &start).unwrap()
}

/// The largest difference of the displacements and velocities of two motions of one structure.
pub fn apart(a: &State, b: &State) -> f64 {
    let all = |of: &State| -> Vec<f64> {
        let bodies = of.particles.iter().flat_map(|body| [body.y_m, body.u_m_per_s]);
        of.modal.iter().chain(&of.modal_rate).copied().chain(bodies).collect()
    };
    all(a).iter().zip(all(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The end of eight cycles, which some ten contacts make.
fn after_cycles(count: f64, set_up: &SetUp) -> State {
    let mut motion = motion(set_up, &excitation(SINE));
    motion.run(count * TAU / SINE.turning, &mut ()).unwrap();
    assert_eq!(motion.unresolved(), 0);
    motion.state()
}

#[test]
fn a_wall_without_coupling_is_a_spring() {
    let wall = PiezoelectricWall { coupling_n_per_v: 0.0, ..WALL };
    let own = after_cycles(3.0, &set_up(soft(1.0), [Some(wall); 2]));
    let spring = after_cycles(3.0, &set_up(soft(WALL.stiffness_n_per_m), [None; 2]));
    // Rounding of 1e-16, which ten contacts carry on.
    assert!(apart(&own, &spring) < 1e-12, "{}", apart(&own, &spring));
    assert_eq!(own.charges_c, [0.0; 2]);
}

/// A small load leaves the stiffness at short circuit, a large one that at open circuit: the motion differs by the order of R and of 1/R.
#[test]
fn loads_of_either_extreme_are_short_and_open_circuits() {
    let open = WALL.stiffness_n_per_m + WALL.coupling_n_per_v.powi(2) / WALL.capacitance_f;
    for (stiffness, load_ohm, by) in [(WALL.stiffness_n_per_m, 20.0, 0.1), (open, 4e10, 10.0)] {
        let limit = after_cycles(3.0, &set_up(soft(stiffness), [None; 2]));
        let [first, second] = [load_ohm, by * load_ohm].map(|load_ohm| {
            let wall = PiezoelectricWall { load_ohm, ..WALL };
            apart(&after_cycles(3.0, &set_up(soft(1.0), [Some(wall); 2])), &limit)
        });
        assert!(first < 1e-3 && first > 1e-7, "{load_ohm}: {first}");
        // A tenth, but for the square of the difference.
        assert!((first / second - 10.0).abs() < 0.05, "{load_ohm}: {first} {second}");
    }
    // A circuit that is slower than all else by any factor does not change how steps are chosen.
    let endless = PiezoelectricWall { load_ohm: 1e20, ..WALL };
    let without = after_cycles(3.0, &set_up(soft(open), [None; 2]));
    let off = apart(&after_cycles(3.0, &set_up(soft(1.0), [Some(endless); 2])), &without);
    assert!(off < 1e-11, "{off}");
}

/// Steps of the second method in a cycle, and half of those in its more accurate run.
pub const STEPS: u32 = 12_000;

#[test]
fn motion_and_voltage_are_those_of_a_runge_kutta_method() {
    let one = |load_ohm: f64| PiezoelectricWall { load_ohm, ..WALL };
    let slow = PiezoelectricWall { coupling_n_per_v: 1.1e-2, load_ohm: 9e6, ..WALL };
    for (walls, least_contacts) in [([one(4e5), one(4e5)], 20), ([one(2e4), one(3e6)], 20), ([slow, one(4e5)], 20)] {
        let set_up = set_up(soft(1.0), walls.map(Some));
        let excitation = excitation(SINE);
        let mut motion = motion(&set_up, &excitation);
        let mut harvest = Harvest::new(&motion);
        let start = motion.state();
        let (modal, rate, body) = (start.modal, start.modal_rate, start.particles[0]);
        let none = [0.0; 4];
        let begin = [[0.0].as_slice(), &modal, &rate, &[body.y_m, body.u_m_per_s], &none].concat();
        let begin: Point = begin.try_into().unwrap();
        let mut reference = Reference::new(&set_up, SINE, begin);
        let mut coarse = Reference::new(&set_up, SINE, begin);
        for cycle in 1..=7 {
            let until_s = f64::from(cycle) * TAU / SINE.turning;
            motion.run(until_s, &mut harvest).unwrap();
            reference.run(until_s, 2 * STEPS);
            coarse.run(until_s, STEPS);
            let state = motion.state();
            let of = |of: &Point| State {
                modal: of[1..3].to_vec(),
                modal_rate: of[3..5].to_vec(),
                particles: vec![Body { y_m: of[Y], u_m_per_s: of[Y + 1] }],
                ..State::default()
            };
            // Order 4: the finer steps have a fifteenth of the difference.
            let error = 0.1 * apart(&of(&coarse.point), &of(&reference.point)) + 1e-12;
            let found = apart(&state, &of(&reference.point));
            assert!(found < error && error < 1e-7, "cycle {cycle}: {found} {error}");
            for (n, of) in walls.iter().enumerate() {
                let most_c = of.coupling_n_per_v * 0.001;
                let error_c = (coarse.point[CHARGE + n] - reference.point[CHARGE + n]).abs() + 1e-11 * most_c;
                assert!((state.charges_c[n] - reference.point[CHARGE + n]).abs() < error_c, "cycle {cycle}");
                let wall = harvest.walls()[n];
                let (energy, error) =
                    (reference.point[ENERGY + n], (coarse.point[ENERGY + n] - reference.point[ENERGY + n]).abs());
                assert!(
                    (wall.energy_j - energy).abs() < error + 1e-11 * energy,
                    "cycle {cycle}: {} {energy}",
                    wall.energy_j
                );
                // The steps miss V″h²/8 of a peak; V swings no faster than at open circuit.
                let missed = (TAU / 0.02 * TAU / SINE.turning / f64::from(2 * STEPS)).powi(2);
                let over = wall.largest_abs_v / reference.largest_v[n] - 1.0;
                assert!(wall.largest_abs_v == 0.0 || (over > -1e-9 && over < missed), "cycle {cycle}: {over} {missed}");
            }
        }
        assert!(reference.contacts >= least_contacts && motion.unresolved() == 0, "{}", reference.contacts);
    }
}

/// A charge that nothing presses is gone with R (C + θ²/k), and its energy is in the load.
#[test]
fn a_free_wall_discharges_into_its_load() {
    let set_up = set_up(soft(1.0), [None, Some(WALL)]);
    let capacitance = WALL.capacitance_f + WALL.coupling_n_per_v.powi(2) / WALL.stiffness_n_per_m;
    let charge_c = -3e-6;
    let start = State { charges_c: vec![charge_c], ..set_up.at_rest((0.0, 0.0)) };
    let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
    let (mut harvest, mut book) = (Harvest::new(&motion), EnergyBook::new(&motion).unwrap());
    let time_s = WALL.load_ohm * capacitance;
    let mut beside = motion.clone();
    motion.run(time_s, &mut harvest).unwrap();
    beside.run(time_s, &mut book).unwrap();
    let left = motion.state().charges_c[0] / charge_c;
    assert!((left - (-1.0_f64).exp()).abs() < 1e-14, "{left}");
    let wall = harvest.walls()[0];
    let energy_j = 0.5 * charge_c * charge_c / capacitance * (1.0 - (-2.0_f64).exp());
    assert!((wall.energy_j / energy_j - 1.0).abs() < 1e-13, "{wall:?}");
    assert!((wall.largest_abs_v * capacitance / charge_c.abs() - 1.0).abs() < 1e-13, "{wall:?}");
    assert_eq!((wall.damper, wall.side), (0, 1));
    assert!((wall.voltage_v * capacitance / (charge_c * left) + 1.0).abs() < 1e-13, "{wall:?}");
    let balance = book.balance(&beside);
    assert!((balance.link_damping_j / energy_j - 1.0).abs() < 1e-13, "{balance:?}");
    assert!((balance.stored_change_j / energy_j + 1.0).abs() < 1e-13, "{balance:?}");
}

/// It comes to rest at the depth that carries its weight at short circuit. The load takes half of what its weight gives on the way.
#[test]
fn a_particle_that_is_laid_on_its_wall_gives_the_load_half_of_its_fall() {
    let mut set_up = set_up(soft(1.0), [Some(WALL), None]);
    set_up.impact_dampers[0].particle.cavity.inclination_deg = 90.0;
    set_up.structure.modes.iter_mut().for_each(|mode| mode.shape = vec![0.0; 2]);
    let mut start = set_up.at_rest((0.0, 0.0));
    start.particles[0].y_m = -0.006;
    let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
    let mut harvest = Harvest::new(&motion);
    motion.run(5.0, &mut harvest).unwrap();
    let depth_m = 0.16 * set_up.gravity_m_per_s2 / WALL.stiffness_n_per_m;
    let end = motion.state();
    assert!((end.particles[0].y_m + 0.006 + depth_m).abs() < 1e-15, "{end:?}");
    assert!((end.charges_c[0] / (WALL.coupling_n_per_v * depth_m) - 1.0).abs() < 1e-11, "{end:?}");
    let (energy_j, half_j) = (harvest.walls()[0].energy_j, 0.5 * WALL.stiffness_n_per_m * depth_m * depth_m);
    assert!((energy_j / half_j - 1.0).abs() < 1e-11, "{energy_j} {half_j}");
    assert_eq!(motion.unresolved(), 0);
}

/// What the particle does while it presses, as the observer sees it.
#[derive(Default)]
struct Pressing {
    began_s: Option<f64>,
    slides_s: Option<f64>,
    /// Time and force at the ends of the pieces.
    forces: Vec<(f64, f64)>,
}

impl Observer for Pressing {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        if let Some(force) = piece.wall_force_n(0) {
            self.began_s = self.began_s.or(Some(piece.start_s));
            self.forces.push((piece.start_s + piece.length_s, force.at(piece.length_s).0));
        }
        if piece.contact(0) != Contact::Held(0) {
            self.slides_s = self.slides_s.or(Some(piece.start_s));
        }
    }
}

/// A particle that friction holds before the displaced surface of a charged wall: the surface comes back, presses it with kδ (1 − e^(−t/RC)), and moves it when that
/// is more than the friction.
#[test]
fn a_surface_that_comes_back_pushes_a_particle_that_friction_holds() {
    let mut set_up = set_up(soft(1.0), [Some(WALL), None]);
    set_up.impact_dampers[0].particle.friction_coefficient = 0.2;
    // Nothing else moves.
    set_up.structure.modes.iter_mut().for_each(|mode| mode.shape = vec![0.0; 2]);
    let (k, c, theta) = (WALL.stiffness_n_per_m, WALL.capacitance_f, WALL.coupling_n_per_v);
    let charge_c = 1e-5;
    let stands_m = theta * charge_c / (k * c + theta * theta);
    let depth_m = 0.4 * stands_m;
    let mut start = set_up.at_rest((0.0, 0.0));
    start.charges_c[0] = charge_c;
    start.particles[0].y_m = -0.006 - depth_m;
    let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
    let (mut seen, friction_n) = (Pressing::default(), 0.2 * 0.16 * set_up.gravity_m_per_s2);
    motion.run(0.1, &mut seen).unwrap();
    let began_s = WALL.load_ohm * (c + theta * theta / k) * (1.0_f64 / 0.4).ln();
    let rc = WALL.load_ohm * c;
    let pushed_n = k * depth_m;
    assert!(pushed_n > 1.5 * friction_n, "{pushed_n} {friction_n}");
    let slides_s = began_s - rc * (1.0 - friction_n / pushed_n).ln();
    let near = |found: Option<f64>, expected: f64| (found.unwrap() / expected - 1.0).abs() < 1e-12;
    assert!(near(seen.began_s, began_s), "{:?} {began_s}", seen.began_s);
    assert!(near(seen.slides_s, slides_s), "{:?} {slides_s}", seen.slides_s);
    for (time_s, force_n) in seen.forces.iter().filter(|(time_s, _)| *time_s <= slides_s) {
        let expected = pushed_n * (1.0 - (-(time_s - began_s) / rc).exp());
        assert!((force_n - expected).abs() < 1e-12 * pushed_n, "{time_s}: {force_n} {expected}");
    }
    assert_eq!(motion.unresolved(), 0);
}

/// One wall is piezoelectric, the other hard: on a sine, and on the cubics of a record.
#[test]
fn the_load_is_in_the_energy_balance_of_sine_and_record() {
    let mut set_up = set_up(Wall::Restitution { coefficient: 0.6 }, [None, Some(WALL)]);
    set_up.impact_dampers[0].particle.cavity.inclination_deg = -12.0;
    set_up.impact_dampers[0].particle.friction_coefficient = 0.03;
    let excitation = excitation(SINE);
    let check = |motion: &Motion, book: &EnergyBook, harvest: &Harvest| {
        let (balance, wall) = (book.balance(motion), harvest.walls()[0]);
        let size = balance.dissipated_j();
        assert!(balance.residual_j.abs() < 1e-10 * size, "{balance:?}");
        assert!((balance.link_damping_j - wall.energy_j).abs() < 1e-12 * size, "{balance:?} {wall:?}");
        assert!(wall.energy_j > 0.01 * size && balance.impacts_j > 0.01 * size, "{balance:?}");
    };
    let mut on_sine = motion(&set_up, &excitation);
    let (mut book, mut harvest) = (EnergyBook::new(&on_sine).unwrap(), Harvest::new(&on_sine));
    let mut beside = on_sine.clone();
    on_sine.run(20.0, &mut book).unwrap();
    beside.run(20.0, &mut harvest).unwrap();
    check(&on_sine, &book, &harvest);
    let step_s = 0.005;
    let part = |n: u32| cubic(&excitation, f64::from(n) * step_s, step_s);
    let start = set_up.at_rest(base_at_start(&excitation));
    let mut on_record = Motion::on_base(&set_up, part(0), &start).unwrap();
    let (mut book, mut harvest) = (EnergyBook::new(&on_record).unwrap(), Harvest::new(&on_record));
    let mut beside = on_record.clone();
    for n in 0..4000 {
        on_record.follow(part(n)).unwrap();
        beside.follow(part(n)).unwrap();
        on_record.run(f64::from(n + 1) * step_s, &mut book).unwrap();
        beside.run(f64::from(n + 1) * step_s, &mut harvest).unwrap();
    }
    check(&on_record, &book, &harvest);
}

/// Modes, walls and loads drawn over orders of magnitude.
fn drawn(rng: &mut Rng) -> (SetUp, Excitation) {
    let between = |rng: &mut Rng, low: f64, high: f64| low * (high / low).powf(rng.f64());
    let count = rng.usize(1..=4);
    let mut modes: Vec<Mode> = (0..count)
        .map(|_| Mode {
            angular_frequency_rad_per_s: TAU * between(rng, 1.0, 30.0),
            damping_ratio: between(rng, 0.002, 0.05),
            shape: (0..2).map(|_| 2.0 * rng.f64() - 1.0).collect(),
            participation: 2.0 * rng.f64() - 1.0,
        })
        .collect();
    modes.sort_by(|a, b| a.angular_frequency_rad_per_s.total_cmp(&b.angular_frequency_rad_per_s));
    let turning = modes[rng.usize(0..count)].angular_frequency_rad_per_s * (0.9 + 0.2 * rng.f64());
    let structure = Modes { modes, influence: vec![1.0; 2], coupling_per_s: Vec::new() };
    let mut set_up = SetUp::bare(structure);
    for place in 0..rng.usize(1..=2) {
        let mass_kg = between(rng, 0.01, 0.3);
        let wall = |rng: &mut Rng| {
            let stiffness_n_per_m = mass_kg * (turning * between(rng, 2.0, 100.0)).powi(2);
            let capacitance_f = between(rng, 1e-9, 1e-5);
            let coupled = between(rng, 1e-3, 3.0);
            PiezoelectricWall {
                stiffness_n_per_m,
                capacitance_f,
                coupling_n_per_v: (coupled * stiffness_n_per_m * capacitance_f).sqrt(),
                load_ohm: between(rng, 1e-4, 1e4) / (turning * capacitance_f),
            }
        };
        let piezoelectric = match rng.usize(0..3) {
            0 => [Some(wall(rng)), None],
            1 => [None, Some(wall(rng))],
            _ => [Some(wall(rng)), Some(wall(rng))],
        };
        let own = if rng.bool() { soft(1e3) } else { Wall::Restitution { coefficient: 0.9 * rng.f64() } };
        let mut particle = particle(own);
        particle.mass_kg = mass_kg;
        particle.clearance_m = between(rng, 1e-4, 3e-3);
        particle.friction_coefficient = if rng.bool() { between(rng, 1e-3, 0.1) } else { 0.0 };
        particle.cavity.inclination_deg = if rng.usize(0..3) == 0 { 60.0 * rng.f64() - 30.0 } else { 0.0 };
        set_up.impact_dampers.push(ImpactDamper { piezoelectric, ..ImpactDamper::new(place, particle) });
    }
    if rng.usize(0..3) == 0 {
        let damper = FrictionDamper { force_n: turning * turning * between(rng, 1e-5, 1e-3) };
        set_up.friction_dampers.push(FrictionJoint { place: 1, other: None, damper });
    }
    let sine = Sine { amplitude_m: between(rng, 2e-4, 3e-3), turning, phase_rad: 6.0 * rng.f64() };
    (set_up, excitation(sine))
}

#[test]
fn random_set_ups_run_and_balance() {
    let (mut unresolved, mut worst, mut harvesting) = (0, 0.0_f64, 0);
    for seed in 0..60 {
        let (set_up, excitation) = drawn(&mut Rng::with_seed(seed));
        let until_s = 30.0 * TAU / excitation.angular_frequency_rad_per_s();
        let mut motion = motion(&set_up, &excitation);
        let (mut book, mut harvest) = (EnergyBook::new(&motion).unwrap(), Harvest::new(&motion));
        let mut beside = motion.clone();
        motion.run(until_s, &mut book).unwrap_or_else(|error| panic!("{seed}: {error}"));
        beside.run(until_s, &mut harvest).unwrap_or_else(|error| panic!("{seed}: {error}"));
        assert_eq!(motion.state(), beside.state());
        let balance = book.balance(&motion);
        let size = balance.input_j.abs() + balance.dissipated_j();
        let off = balance.residual_j.abs() / size;
        worst = worst.max(off);
        unresolved += motion.unresolved();
        harvesting += usize::from(harvest.walls().iter().any(|wall| wall.energy_j > 1e-6 * size));
    }
    println!("{harvesting} of 60 harvest, balance to {worst:e}, {unresolved} steps unresolved");
    assert!(worst < 1e-11 && harvesting > 40, "{worst} {harvesting}");
    assert_eq!(unresolved, 0);
}

/// A friction damper at a place that the base moves otherwise: while it sticks, the base moves the modes and with them the charges. The velocity of cubics deviates
/// from the sine's by √3/216 of the cube of what it turns in one, and so do the motions.
#[test]
fn a_base_of_cubics_moves_charges_as_the_sine_through_their_ends() {
    for seed in 0..20 {
        let (mut set_up, excitation) = drawn(&mut Rng::with_seed(seed));
        let Excitation::Sine { angular_frequency_rad_per_s: turning, amplitude_m, .. } = excitation else { continue };
        set_up.structure.influence[1] = 0.4;
        let damper = FrictionDamper { force_n: 2.0 * turning * turning * amplitude_m };
        set_up.friction_dampers = vec![FrictionJoint { place: 1, other: None, damper }];
        let mut on_sine = motion(&set_up, &excitation);
        let start = on_sine.state();
        on_sine.run(2.0 * TAU / turning, &mut ()).unwrap();
        let own = on_sine.state();
        let size = own.modal_rate.iter().fold(turning * amplitude_m, |most, v| most.max(v.abs()));
        let off = |cubics: u32| {
            let h = TAU / turning / f64::from(cubics);
            let part = |n: u32| cubic(&excitation, f64::from(n) * h, h);
            let mut on_cubics = Motion::on_base(&set_up, part(0), &start).unwrap();
            for n in 0..2 * cubics {
                on_cubics.follow(part(n)).unwrap();
                on_cubics.run(f64::from(n + 1) * h, &mut ()).unwrap();
            }
            let other = on_cubics.state();
            let walls = set_up.impact_dampers.iter().flat_map(|damper| damper.piezoelectric.iter().flatten());
            let charges = own.charges_c.iter().zip(&other.charges_c).zip(walls);
            let charges = charges.map(|((a, b), wall)| ((a - b) / (wall.coupling_n_per_v * amplitude_m)).abs());
            (apart(&own, &other) / size).max(charges.fold(0.0, f64::max))
        };
        let (coarse, fine) = (off(250), off(2_000));
        // By 512 for intervals of an eighth; how the deviation of one falls on the contacts changes it by some.
        assert!(coarse < 1e-4 && fine < coarse / 30.0 + 1e-12, "{seed}: {coarse:e} {fine:e}");
    }
}

#[test]
fn walls_and_charges_out_of_range_and_derivatives_are_refused() {
    let whole = set_up(soft(1.0), [None, Some(WALL)]);
    for (wall, key) in [
        (PiezoelectricWall { stiffness_n_per_m: 0.0, ..WALL }, "stiffness_n_per_m = 0"),
        (PiezoelectricWall { capacitance_f: f64::NAN, ..WALL }, "capacitance_f = NaN"),
        (PiezoelectricWall { coupling_n_per_v: -1.0, ..WALL }, "coupling_n_per_v = -1"),
        (PiezoelectricWall { load_ohm: f64::INFINITY, ..WALL }, "load_ohm = inf"),
    ] {
        let refused = set_up(soft(1.0), [Some(wall), None]).validate().unwrap_err().to_string();
        assert!(refused.starts_with(&format!("impact_dampers.piezoelectric.{key}")), "{refused}");
    }
    // A wall that is replaced may be of any kind.
    let hertz = Wall::Hertz(Hertz {
        stiffness_n_per_m15: 1e9,
        dissipation: Dissipation::HuntCrossley { coefficient_s_per_m: 0.1 },
    });
    let start = |of: &SetUp| Motion::new(of, &Excitation::Fixed, &of.at_rest((0.0, 0.0)));
    assert!(start(&set_up(hertz, [Some(WALL); 2])).is_ok());
    assert!(start(&set_up(hertz, [None, Some(WALL)])).is_ok());
    let start = State { charges_c: Vec::new(), ..whole.at_rest((0.0, 0.0)) };
    let refused = Motion::new(&whole, &Excitation::Fixed, &start).unwrap_err().to_string();
    assert_eq!(refused, "initial.charges_c: 0 found, 1 expected");
    let case = MotionCase {
        start: whole.at_rest((0.0, 0.0)),
        set_up: whole,
        drive: Drive::ClosedForm(excitation(SINE)),
        duration_s: 20.0,
    };
    assert_eq!(case.derivatives(&[], &mut |_| true).unwrap_err(), NoDerivatives::Charge);
    assert_eq!(case.orbit_derivatives(4, &[], &mut |_| true).unwrap_err(), NoDerivatives::Charge);
    assert_eq!(case.settled(4).unwrap_err(), NoDerivatives::Charge);
    assert_eq!(case.returned(&[]).unwrap_err(), NoDerivatives::Charge);
}
