//! Contacts with Hertz walls.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::{
    ContactEnd, Exact, Excitation, HertzContact as OneContact, Observer as OneObserver,
};
use damprig_core::integrator::modes::Grip;
use damprig_core::model::{
    Cavity, Dissipation, FrictionDamper, Hertz, Initial, Particle, SetUp as One, Structure, Wall,
};
use damprig_structures::{
    Drive, EnergyBook, FrictionJoint, HertzContact, ImpactDamper, Mode, Modes, Motion, MotionCase, NoDerivatives,
    Observer, Piece, Refused, SetUp, State, base_at_start,
};

use crate::one_mode::set_up;
use crate::random_set_ups::{Case, Draw, cubic};
use fastrand::Rng;

const LAWS: [Dissipation; 4] = [
    Dissipation::HuntCrossley { coefficient_s_per_m: 0.0 },
    Dissipation::HuntCrossley { coefficient_s_per_m: 0.3 },
    Dissipation::LankaraniNikravesh { coefficient: 0.9 },
    Dissipation::LankaraniNikravesh { coefficient: 0.5 },
];

/// The stated error of a contact.
const STATED: f64 = 1e-9;

/// The contacts of a motion, and the number of its pieces in one.
#[derive(Default)]
struct Contacts {
    contacts: Vec<HertzContact>,
    pieces: u32,
    /// Of these, with two contacts, and with a friction damper that sticks.
    at_once: u32,
    stuck_during: u32,
    friction_dampers: usize,
    /// Largest force of the first damper's wall in the pieces, N, and its largest jump between them.
    largest_n: f64,
    jump_n: f64,
    last_n: f64,
}

impl Observer for Contacts {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        let pressed = (0..piece.particle_count()).filter(|damper| piece.pressed_side(*damper).is_some()).count();
        self.pieces += u32::from(pressed > 0);
        if let Some(force) = (piece.particle_count() > 0).then(|| piece.wall_force_n(0)).flatten() {
            self.largest_n = force.largest_abs((0.0, piece.length_s), self.largest_n);
            self.jump_n = self.jump_n.max((force.at(0.0).0 - self.last_n).abs());
            self.last_n = force.at(piece.length_s).0;
        }
        self.at_once += u32::from(pressed > 1);
        let sticks = (0..self.friction_dampers).any(|damper| piece.grip(damper) == Grip::Stuck);
        self.stuck_during += u32::from(pressed > 0 && sticks);
    }

    fn contact(&mut self, contact: &HertzContact) {
        self.contacts.push(*contact);
    }
}

/// Those of one degree of freedom.
#[derive(Default)]
struct OneContacts(Vec<OneContact>);

impl OneObserver for OneContacts {
    fn contact_end(&mut self, end: &ContactEnd) {
        self.0.extend(end.hertz);
    }
}

fn particle(mass_kg: f64, clearance_m: f64, law: Hertz) -> Particle {
    let cavity = Cavity::default();
    Particle { mass_kg, clearance_m, friction_coefficient: 0.0, wall: Wall::Hertz(law), cavity }
}

/// A heavy mode whose springs and movement do nothing within a contact: free impacts have closed forms.
#[test]
fn free_impacts_have_duration_force_and_restitution_of_their_closed_forms() {
    let (mass_kg, heavy_kg) = (0.16, 1.6);
    let mut worst = [0.0_f64; 3];
    for dissipation in LAWS {
        for stiffness_n_per_m15 in [1e6, 1e9, 1e10] {
            for speed in [1e-3, 1e-2, 0.1, 1.0, 10.0] {
                let law = Hertz { stiffness_n_per_m15, dissipation };
                let mode = Mode {
                    angular_frequency_rad_per_s: 1e-6,
                    damping_ratio: 0.0,
                    shape: vec![1.0 / f64::sqrt(heavy_kg)],
                    participation: 0.0,
                };
                let structure = Modes { modes: vec![mode], influence: vec![1.0], coupling_per_s: Vec::new() };
                let damper = ImpactDamper::new(0, particle(mass_kg, 1e-3, law));
                let set_up = SetUp { impact_dampers: vec![damper], ..SetUp::bare(structure) };
                let mut start = set_up.at_rest((0.0, 0.0));
                start.particles[0].u_m_per_s = speed;
                let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
                let reduced = mass_kg * heavy_kg / (mass_kg + heavy_kg);
                let elastic_s = law.elastic_duration_s(reduced, speed);
                let mut seen = Contacts::default();
                let mut until_s = 1e-3 / speed;
                while seen.contacts.is_empty() {
                    until_s += elastic_s;
                    motion.run(until_s, &mut seen).unwrap();
                }
                let contact = seen.contacts[0];
                let e = law.restitution(speed);
                let (off_force, off_e) = (
                    contact.peak_force_n / law.peak_force_n(reduced, speed) - 1.0,
                    contact.separation_speed_m_per_s / speed - e,
                );
                let off_duration = if e == 1.0 { contact.duration_s / elastic_s - 1.0 } else { 0.0 };
                let (largest, jump) = (seen.largest_n / contact.peak_force_n, seen.jump_n / contact.peak_force_n);
                assert!((largest - 1.0).abs() < 1e-6 && jump < 1e-5, "{dissipation:?} {speed}: {largest} {jump:e}");
                for (worst, off) in worst.iter_mut().zip([off_force, off_e, off_duration]) {
                    *worst = worst.max(off.abs());
                }
            }
        }
    }
    println!("force {:.1e}, restitution {:.1e}, duration {:.1e}", worst[0], worst[1], worst[2]);
    assert!(worst.iter().all(|worst| *worst < STATED), "{worst:?}");
}

/// A structure of one mode against the engine for one degree of freedom, whose own error is 1e-11: motion and contacts.
fn agrees(name: &str, one: &One, excitation: &Excitation, duration_s: f64) {
    let neutral = one.neutral();
    let initial = Initial { x_m: 4e-3, v_m_per_s: 0.05, ..neutral };
    let mut exact = Exact::new(one, excitation, &initial).unwrap();
    let mut expected = OneContacts::default();
    let mut beside = Exact::new(one, excitation, &Initial { x_m: initial.x_m * (1.0 + 1e-6), ..initial }).unwrap();
    let start = State::of_one_degree(one, &initial, excitation);
    let mut motion = Motion::new(&set_up(one, excitation), excitation, &start).unwrap();
    let mut found = Contacts::default();
    let (mut growth, mut worst) = (1.0_f64, 0.0_f64);
    for part in 1..=40 {
        let until_s = duration_s * f64::from(part) / 40.0;
        exact.run(until_s, &mut expected);
        beside.run(until_s, &mut ());
        motion.run(until_s, &mut found).unwrap();
        let now = exact.state();
        let apart = |x_m: f64, y_m: f64| (now.x_m - x_m).abs().max((now.y_m() - y_m).abs()) / 4e-3;
        growth = growth.max(apart(beside.state().x_m, beside.state().y_m()) / 1e-6);
        let state = motion.state();
        let x_m = state.modal[0] / one.structure.mass_kg.sqrt() + motion.base().0;
        let off = apart(x_m, state.particles[0].y_m);
        worst = worst.max(off / growth);
        let contacts = 1.0 + found.contacts.len() as f64;
        assert!(off < STATED * contacts * growth, "{name}, {until_s} s: {off:e}, growth {growth:e}");
    }
    assert_eq!(motion.unresolved(), 0, "{name}");
    assert_eq!(found.contacts.len(), expected.0.len(), "{name}");
    assert!(!found.contacts.is_empty(), "{name}");
    for (own, other) in found.contacts.iter().zip(&expected.0) {
        let allowed = STATED * (found.contacts.len() as f64) * growth;
        let pairs = [
            (own.touch_s, other.touch_s),
            (own.approach_speed_m_per_s, other.approach_speed_m_per_s),
            (own.duration_s, other.duration_s),
            (own.peak_force_n, other.peak_force_n),
        ];
        for (a, b) in pairs {
            assert!((a - b).abs() <= 4.0 * allowed * b, "{name}: {own:?} {other:?}, growth {growth:e}");
        }
    }
    println!("{name}: {} contacts, {} pieces, growth {growth:.1}, {worst:.1e}", found.contacts.len(), found.pieces);
}

/// With and without a base in motion, a friction damper, weight and internal friction.
#[test]
fn a_structure_of_one_mode_moves_as_with_one_degree_of_freedom() {
    let bare = One::bare(Structure::from_modal(1.6, 2.5, 0.01));
    let sine = Excitation::Sine { amplitude_m: 2e-3, angular_frequency_rad_per_s: 15.0, phase_rad: 0.4 };
    let force = Excitation::ForceSine { amplitude_n: 2.0, angular_frequency_rad_per_s: 15.0, phase_rad: 0.4 };
    for dissipation in LAWS {
        for stiffness_n_per_m15 in [1e6, 1e9] {
            let law = Hertz { stiffness_n_per_m15, dissipation };
            let level = particle(0.16, 5e-3, law);
            let cavity = Cavity { inclination_deg: 12.0, offset_m: 1e-3, positive_wall: None };
            let inclined = Particle { cavity, friction_coefficient: 0.05, ..level };
            let friction_damper = Some(FrictionDamper { force_n: 0.3 });
            let name = format!("{stiffness_n_per_m15:e} {dissipation:?}");
            agrees(&name, &One { particle: Some(level), ..bare }, &Excitation::Fixed, 1.0);
            agrees(&name, &One { particle: Some(level), ..bare }, &sine, 1.0);
            agrees(&name, &One { particle: Some(level), friction_damper, ..bare }, &force, 1.0);
            agrees(&name, &One { particle: Some(inclined), friction_damper, ..bare }, &sine, 0.6);
        }
    }
}

/// A particle lies at its wall while friction holds the structure, until a rising force moves it: the law's speed is that of this motion, not that of the
/// rest before.
#[test]
fn a_particle_at_its_wall_is_pressed_as_the_structure_breaks_away() {
    let law = Hertz { stiffness_n_per_m15: 3.5e4, dissipation: Dissipation::LankaraniNikravesh { coefficient: 0.5 } };
    let one = One {
        particle: Some(particle(3.0, 3e-4, law)),
        friction_damper: Some(FrictionDamper { force_n: 4.7 }),
        ..One::bare(Structure { mass_kg: 8.0, stiffness_n_per_m: 3800.0, damping_n_s_per_m: 0.0 })
    };
    let force = Excitation::ForceHalfSine { amplitude_n: 6.3588, duration_s: 0.2965 };
    let initial = Initial { y_m: -3e-4, ..one.neutral() };
    let mut expected = OneContacts::default();
    Exact::new(&one, &force, &initial).unwrap().run(1.0, &mut expected);
    let mut found = Contacts::default();
    let start = State::of_one_degree(&one, &initial, &force);
    Motion::new(&set_up(&one, &force), &force, &start).unwrap().run(1.0, &mut found).unwrap();
    let (found, expected) = (&found.contacts[0], &expected.0[0]);
    assert!((found.peak_force_n / expected.peak_force_n - 1.0).abs() < 1e-7, "{found:?} {expected:?}");
    assert!((found.duration_s / expected.duration_s - 1.0).abs() < 1e-7, "{found:?} {expected:?}");
}

/// Random set-ups of [`random_set_ups`](crate::random_set_ups) with Hertz walls in place of soft ones and of some hard ones. The law of Lankarani and
/// Nikravesh is drawn on a level: the approach speed of a particle that its weight lays on a wall is not that of the touch.
fn with_hertz_walls(number: usize) -> Case {
    let mut rng = Rng::with_seed(1000 + number as u64);
    let mut case = Draw(Rng::with_seed(number as u64)).case(number);
    for damper in &mut case.set_up.impact_dampers {
        let particle = &mut damper.particle;
        let mut draw = |wall: Wall| {
            let stiffness_n_per_m15 = 10.0_f64.powf(4.0 + 4.0 * rng.f64());
            let dissipation = if particle.cavity.inclination_deg == 0.0 && rng.bool() {
                Dissipation::LankaraniNikravesh { coefficient: 0.5 + 0.5 * rng.f64() }
            } else {
                Dissipation::HuntCrossley { coefficient_s_per_m: rng.f64() }
            };
            let takes_time = matches!(wall, Wall::Voigt { .. }) || rng.bool();
            if takes_time { Wall::Hertz(Hertz { stiffness_n_per_m15, dissipation }) } else { wall }
        };
        let walls = [Some(particle.wall), particle.cavity.positive_wall].map(|wall| wall.map(&mut draw));
        (particle.wall, particle.cavity.positive_wall) = (walls[0].expect("a wall"), walls[1]);
    }
    case
}

/// Cycles that motions of random set-ups are compared over.
const CYCLES: u32 = 3;

/// Change of the start that tells how chaotic they are: above the errors of both methods.
const NUDGE: f64 = 1e-7;

/// Random set-ups.
const RANDOM: usize = 30;

/// Allowed difference, relative to the displacements and the growth: some 1e-9 of each contact from either method, which a series of bounces carries on more
/// than a change of the start. With steps and tolerances that are ten and a hundred times finer, 1.3e-10 was measured.
const ALLOWED: f64 = 5e-8;

/// Friction joints that stick during contacts, contacts at once, tuned masses, hard walls beside Hertz walls, damping that is not modal.
#[test]
fn motions_of_random_set_ups_agree_with_the_second_method() {
    let (mut compared, mut contacts, mut at_once, mut sticks, mut worst, mut unresolved) = (0, 0, 0, 0, 0.0_f64, 0);
    let mut wrong = Vec::new();
    for number in 0..RANDOM {
        let case = with_hertz_walls(number);
        let mut motion = Motion::new(&case.set_up, &case.excitation, &case.start).expect("it starts");
        let mut beside = motion.clone();
        match case.compare_cycles(&mut motion, CYCLES, NUDGE, ALLOWED) {
            Ok(outcome) => {
                assert!(!outcome.is_refused, "{number}");
                worst = worst.max(outcome.worst);
                compared += u32::from(outcome.cycles == CYCLES);
                let friction_dampers = case.set_up.friction_dampers.len();
                let mut seen = Contacts { friction_dampers, ..Contacts::default() };
                beside.run(f64::from(outcome.cycles) * case.cycle_s, &mut seen).expect("it goes on");
                contacts += seen.contacts.len();
                at_once += seen.at_once;
                sticks += seen.stuck_during;
                unresolved += motion.unresolved();
            }
            Err(error) => wrong.push(format!("{number}: {error}")),
        }
    }
    println!(
        "{compared} compared, {contacts} contacts, {at_once} pieces with two, {sticks} with a joint that sticks, {worst:.1e}, {unresolved} unresolved"
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(
        compared >= 20 && contacts > 100 && at_once > 100 && sticks > 100,
        "{compared} {contacts} {at_once} {sticks}"
    );
}

/// A frame with a Hertz wall and dampers of every kind: on a sine, the balance closes to rounding.
#[test]
fn the_energy_book_balances_on_random_set_ups() {
    let (mut worst, mut books) = (0.0_f64, 0);
    for number in 0..RANDOM {
        let case = with_hertz_walls(number);
        let mut motion = Motion::new(&case.set_up, &case.excitation, &case.start).expect("it starts");
        // A joint to a base that moves its place otherwise has no book.
        let Some(mut book) = EnergyBook::new(&motion) else { continue };
        motion.run(f64::from(CYCLES) * case.cycle_s, &mut book).expect("it goes on");
        let balance = book.balance(&motion);
        let size = balance.input_j.abs() + balance.dissipated_j() + balance.stored_change_j.abs();
        assert!(balance.link_damping_j > -1e-9 * size, "{number}: {balance:?}");
        worst = worst.max(balance.residual_j.abs() / size);
        books += 1;
    }
    println!("{books} books, {worst:.1e}");
    assert!(worst < 1e-10 && books > 15, "{worst:e}, {books} books");
}

/// On a structure that is at rest after a second.
#[test]
fn a_particle_at_rest_on_its_wall_carries_its_weight_in_few_hundred_pieces_a_second() {
    for stiffness_n_per_m15 in [1e5, 1e9] {
        let law = Hertz { stiffness_n_per_m15, dissipation: Dissipation::LankaraniNikravesh { coefficient: 0.5 } };
        let cavity = Cavity { inclination_deg: 90.0, ..Cavity::default() };
        let mass_kg = 0.16;
        let damper = ImpactDamper::new(0, Particle { cavity, ..particle(mass_kg, 5e-3, law) });
        let structure = Structure::from_modal(1.6, 2.5, 0.9);
        let set_up = SetUp { impact_dampers: vec![damper], ..SetUp::bare(structure) };
        let mut start = set_up.at_rest((0.0, 0.0));
        start.particles[0].y_m = -5e-3;
        let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
        let mut seen = Contacts::default();
        motion.run(3.0, &mut seen).unwrap();
        let (rings, mut rests) = (seen.pieces, Contacts::default());
        motion.run(13.0, &mut rests).unwrap();
        let weight_n = mass_kg * set_up.gravity_m_per_s2;
        let x_m = -weight_n / structure.stiffness_n_per_m;
        let depth_m = x_m - 5e-3 - motion.state().particles[0].y_m;
        let expected_m = (weight_n / stiffness_n_per_m15).powf(2.0 / 3.0);
        let contact = motion.hertz_contacts().next().expect("it stays");
        println!(
            "{stiffness_n_per_m15:e}: {rings} pieces, then {}, depth {:.1e}",
            rests.pieces,
            depth_m / expected_m - 1.0
        );
        // x and y are rounded.
        assert!((depth_m - expected_m).abs() < 1e-9 * expected_m + 1e-17, "{depth_m} {expected_m}");
        assert!(seen.contacts.is_empty() && rests.contacts.is_empty());
        assert!(contact.touch_s == 0.0 && contact.approach_speed_m_per_s == 0.0 && contact.duration_s > 12.9);
        assert!(rests.pieces < 4_000 && rings < 2_000, "{rings} {}", rests.pieces);
    }
}

/// Two modes, a cavity off its centre and inclined, internal friction, two different walls.
#[test]
fn a_mirrored_set_up_has_the_mirrored_motion() {
    let mode = |omega: f64, shape: f64| Mode {
        angular_frequency_rad_per_s: omega,
        damping_ratio: 0.01,
        shape: vec![shape],
        participation: 0.0,
    };
    let structure =
        Modes { modes: vec![mode(16.0, 0.8), mode(90.0, 0.5)], influence: vec![1.0], coupling_per_s: vec![] };
    let walls = LAWS.map(|dissipation| Wall::Hertz(Hertz { stiffness_n_per_m15: 1e7, dissipation }));
    let run = |sign: f64| {
        let [negative, positive] = if sign > 0.0 { [walls[1], walls[3]] } else { [walls[3], walls[1]] };
        let cavity = Cavity { positive_wall: Some(positive), offset_m: sign * 1e-3, inclination_deg: sign * 8.0 };
        let particle =
            Particle { mass_kg: 0.16, clearance_m: 4e-3, friction_coefficient: 0.04, wall: negative, cavity };
        let set_up = SetUp { impact_dampers: vec![ImpactDamper::new(0, particle)], ..SetUp::bare(structure.clone()) };
        let mut start = set_up.at_rest((0.0, 0.0));
        start.modal = vec![sign * 8e-3, sign * 1e-3];
        start.particles[0].y_m = set_up.displacement_m(&start, 0) + sign * 1e-3;
        let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
        let mut seen = Contacts::default();
        motion.run(2.0, &mut seen).unwrap();
        (motion.state(), seen.contacts)
    };
    let ((state, contacts), (mirrored, mirrored_contacts)) = (run(1.0), run(-1.0));
    assert!(contacts.len() > 5, "{}", contacts.len());
    let sides: Vec<_> =
        mirrored_contacts.iter().map(|contact| HertzContact { side: -contact.side, ..*contact }).collect();
    assert_eq!(contacts, sides);
    assert_eq!(state.particles[0].y_m, -mirrored.particles[0].y_m);
    assert_eq!(state.modal, mirrored.modal.iter().map(|q| -q).collect::<Vec<_>>());
}

/// Their equations are linear.
#[test]
fn derivatives_of_a_motion_with_a_hertz_wall_are_refused() {
    let law = Hertz::elastic(1e9);
    let damper = ImpactDamper::new(0, particle(0.16, 5e-3, law));
    let set_up = SetUp { impact_dampers: vec![damper], ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.01)) };
    let case = MotionCase {
        start: set_up.at_rest((0.0, 0.0)),
        set_up,
        drive: Drive::ClosedForm(Excitation::Fixed),
        duration_s: 1.0,
    };
    let refused = NoDerivatives::Refused(Refused::Hertz);
    assert_eq!(case.derivatives(&[], &mut |_| true).unwrap_err(), refused);
    assert_eq!(case.orbit_derivatives(1, &[], &mut |_| true).unwrap_err(), refused);
    assert_eq!(case.settled(1).unwrap_err(), refused);
    assert_eq!(case.returned(&[]).unwrap_err(), refused);
}

/// Each sample ends a piece, within contacts too: pieces end there by themselves, as those that are cut short would be off by more. A cubic's velocity
/// deviates by 2.5e-10 of the sine's, and so does that of each contact.
#[test]
fn a_base_of_cubics_moves_a_particle_between_hertz_walls_as_the_sine_through_their_ends() {
    let law = Hertz { stiffness_n_per_m15: 1e5, dissipation: Dissipation::HuntCrossley { coefficient_s_per_m: 0.3 } };
    let damper = ImpactDamper::new(0, particle(0.16, 3e-3, law));
    let joint = FrictionJoint { place: 0, other: None, damper: FrictionDamper { force_n: 0.2 } };
    let structure = Structure::from_modal(1.6, 2.5, 0.02);
    let set_up = SetUp { impact_dampers: vec![damper], friction_dampers: vec![joint], ..SetUp::bare(structure) };
    let turning = 15.0;
    let sine = Excitation::Sine { amplitude_m: 3e-3, angular_frequency_rad_per_s: turning, phase_rad: 0.3 };
    let mut start = set_up.at_rest(base_at_start(&sine));
    start.particles[0].y_m = 1e-3;
    let h = TAU / turning / 2_000.0;
    let part = |n: u32| cubic(&sine, f64::from(n) * h, h);
    let mut on_cubics = Motion::on_base(&set_up, part(0), &start).unwrap();
    let mut on_sine = Motion::new(&set_up, &sine, &start).unwrap();
    let (mut samples_within, mut seen) = (0, Contacts::default());
    for n in 0..3_000 {
        if n > 0 {
            samples_within += on_cubics.hertz_contacts().count();
            on_cubics.follow(part(n)).unwrap();
        }
        on_cubics.run(f64::from(n + 1) * h, &mut seen).unwrap();
    }
    on_sine.run(3_000.0 * h, &mut ()).unwrap();
    let (a, b) = (on_sine.state(), on_cubics.state());
    let apart_m = (a.particles[0].y_m - b.particles[0].y_m).abs().max((a.modal[0] - b.modal[0]).abs());
    println!("{} contacts, {samples_within} samples within, {apart_m:.1e} m", seen.contacts.len());
    assert!(seen.contacts.len() >= 3 && samples_within >= 20, "{} {samples_within}", seen.contacts.len());
    assert!(apart_m < STATED * 3e-3 * seen.contacts.len() as f64, "{apart_m:e}");
}

/// Pieces in which a wall that is pressed does not push, and the least force.
#[derive(Default)]
struct Lagging {
    pieces: u32,
    least_n: f64,
}

impl Observer for Lagging {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        if let Some(force) = piece.wall_force_n(0) {
            let ends_n = [0.0, piece.length_s].map(|after_s| force.at(after_s).0);
            self.least_n = self.least_n.min(ends_n[0]).min(ends_n[1]);
            self.pieces += u32::from(ends_n == [0.0; 2]);
        }
    }
}

/// The impact of another particle on a hard wall takes the structure, and so the Hertz wall, away from the one that presses, faster than 1/β = 0.13 m/s.
/// At the kink where the force begins again the cubic is off by 1e-4 of the largest force, over a piece as short.
#[test]
fn a_wall_that_is_taken_away_lags_behind_and_does_not_pull() {
    let law = Hertz { stiffness_n_per_m15: 1e4, dissipation: Dissipation::HuntCrossley { coefficient_s_per_m: 5.0 } };
    let mode = Mode { angular_frequency_rad_per_s: 20.0, damping_ratio: 0.01, shape: vec![3.0], participation: 0.0 };
    let structure = Modes { modes: vec![mode], influence: vec![1.0], coupling_per_s: Vec::new() };
    let hard = Particle { wall: Wall::Restitution { coefficient: 0.8 }, ..particle(0.16, 10e-3, law) };
    let dampers = [particle(0.16, 2e-3, law), hard].map(|particle| ImpactDamper::new(0, particle));
    let set_up = SetUp { impact_dampers: dampers.to_vec(), ..SetUp::bare(structure) };
    let mut start = set_up.at_rest((0.0, 0.0));
    (start.particles[0].y_m, start.particles[0].u_m_per_s) = (1.9e-3, 0.05);
    (start.particles[1].y_m, start.particles[1].u_m_per_s) = (2.5e-3, 0.5);
    let case = Case { set_up, excitation: Excitation::Fixed, start, cycle_s: 0.04, scale_m: 10e-3 };
    let mut motion = Motion::new(&case.set_up, &case.excitation, &case.start).unwrap();
    let mut seen = Lagging::default();
    motion.clone().run(case.cycle_s, &mut seen).unwrap();
    assert!(seen.pieces > 0 && seen.least_n > -1e-4, "{} {:e}", seen.pieces, seen.least_n);
    let outcome = case.compare_cycles(&mut motion, 1, 1e-6, 1e-7).unwrap();
    println!("{} pieces, least {:.1e} N, {:.1e} apart", seen.pieces, seen.least_n, outcome.worst);
    assert_eq!(outcome.cycles, 1);
}

/// A particle that lies at its wall is carried by a structure that begins to move as t⁴: no contact but this one, and its force at the end of the run.
#[test]
fn a_particle_at_its_wall_is_carried_from_rest_in_one_contact() {
    let law = Hertz { stiffness_n_per_m15: 1e9, dissipation: Dissipation::HuntCrossley { coefficient_s_per_m: 0.3 } };
    let one = One {
        particle: Some(particle(0.1, 1e-3, law)),
        ..One::bare(Structure { mass_kg: 1.2, stiffness_n_per_m: 360.0, damping_n_s_per_m: 0.0 })
    };
    let base = Excitation::Versine { amplitude_m: 3e-4, duration_s: 0.37 };
    let initial = Initial { y_m: -1e-3, ..one.neutral() };
    let mut exact = Exact::new(&one, &base, &initial).unwrap();
    exact.run(0.05, &mut ());
    let start = State::of_one_degree(&one, &initial, &base);
    let mut motion = Motion::new(&set_up(&one, &base), &base, &start).unwrap();
    let mut found = Contacts::default();
    motion.run(0.05, &mut found).unwrap();
    assert!(found.contacts.is_empty() && motion.unresolved() == 0, "{:?}", found.contacts);
    let now = motion.hertz_contacts().next().unwrap();
    let depth_m = -1e-3 - exact.state().offset_m;
    let force_n = law.stiffness_n_per_m15 * depth_m.powf(1.5) * (1.0 - 0.45 * exact.state().slide_m_per_s);
    // A penetration of 12 nm has 1e-8 of rounding beside a clearance of 1 mm.
    assert!((now.peak_force_n / force_n - 1.0).abs() < 3e-8, "{now:?} {force_n}");
}
