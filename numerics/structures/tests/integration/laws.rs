//! Laws that hold for every motion: energy, simultaneous impacts, joints that stick together.

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, Dissipation, FrictionDamper, Hertz, Particle, Release, Tmd, Wall};
use damprig_structures::{
    Body, FrictionJoint, Impact, ImpactDamper, Modes, Motion, Observer, Piece, PiezoelectricWall, SetUp, State, Storey,
    TunedMass, base_at_start,
};

fn frame(storeys: usize, damping_n_s_per_m: f64) -> Modes {
    Modes::storeys(&vec![Storey { mass_kg: 2.0, stiffness_n_per_m: 1500.0, damping_n_s_per_m }; storeys]).unwrap()
}

fn particle(mass_kg: f64, clearance_m: f64, wall: Wall) -> Particle {
    Particle { mass_kg, clearance_m, friction_coefficient: 0.0, wall, cavity: Cavity::default() }
}

/// Energy of everything on a base at rest, J; that of compressed soft walls is left out.
fn energy_j(set_up: &SetUp, state: &State) -> f64 {
    let modes = set_up.structure.modes.iter().zip(state.modal.iter().zip(&state.modal_rate));
    let structure: f64 = modes.map(|(mode, (q, v))| v * v + (mode.angular_frequency_rad_per_s * q).powi(2)).sum();
    let particles = set_up.impact_dampers.iter().zip(&state.particles);
    let particles: f64 = particles.map(|(damper, body)| damper.particle.mass_kg * body.u_m_per_s.powi(2)).sum();
    let tuned = set_up.tuned_masses.iter().zip(&state.tuned_masses).map(|(tuned, body)| {
        let stretch = body.y_m - set_up.displacement_m(state, tuned.place);
        tuned.tmd.mass_kg * body.u_m_per_s.powi(2) + tuned.tmd.stiffness_n_per_m * stretch * stretch
    });
    0.5 * (structure + particles + tuned.sum::<f64>())
}

#[derive(Default)]
struct Times(Vec<(f64, usize)>);

impl Observer for Times {
    fn impact(&mut self, impact: &Impact) {
        self.0.push((impact.time_s, impact.damper));
    }
}

/// The end of the last piece of motion: of every place, the particle, the tuned mass and the base.
#[derive(Default)]
struct Pieces {
    end_s: f64,
    ends: Vec<(f64, f64)>,
    count: u32,
}

impl Observer for Pieces {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        assert!((piece.start_s - self.end_s).abs() < 1e-12, "{} {}", piece.start_s, self.end_s);
        let courses =
            [piece.place(0), piece.place(1), piece.place(2), piece.particle(0), piece.tuned_mass(0), piece.base()];
        for (before, course) in self.ends.iter().zip(&courses) {
            let now = course.at(0.0);
            assert!((before.0 - now.0).abs() < 1e-14, "{before:?} {now:?}");
        }
        self.ends = courses.iter().map(|course| course.at(piece.length_s)).collect();
        self.end_s = piece.start_s + piece.length_s;
        self.count += 1;
    }

    fn goes_on(&mut self, time_s: f64) -> bool {
        time_s < 5.0
    }
}

/// Each piece starts where the one before ended, the last one ends in the state of the motion, and the observer ends the run.
#[test]
fn pieces_join_up_and_the_observer_ends_the_run() {
    let wall = Wall::Restitution { coefficient: 0.4 };
    let joint = FrictionJoint { place: 2, other: Some(1), damper: FrictionDamper { force_n: 0.6 } };
    let tmd = Tmd { mass_kg: 0.2, stiffness_n_per_m: 40.0, damping_n_s_per_m: 0.1 };
    let mut sticky = particle(0.4, 10e-3, wall);
    sticky.friction_coefficient = 0.1;
    let set_up = SetUp {
        impact_dampers: vec![ImpactDamper::new(2, sticky)],
        friction_dampers: vec![joint],
        tuned_masses: vec![TunedMass { place: 0, tmd }],
        ..SetUp::bare(frame(3, 0.5))
    };
    let excitation = Excitation::Sine { amplitude_m: 2e-3, angular_frequency_rad_per_s: 13.0, phase_rad: 0.7 };
    let mut motion = Motion::new(&set_up, &excitation, &set_up.at_rest(base_at_start(&excitation))).unwrap();
    let mut pieces = Pieces::default();
    motion.run(100.0, &mut pieces).unwrap();
    assert!(pieces.count > 100 && (5.0..5.2).contains(&motion.time_s()), "{} {}", pieces.count, motion.time_s());
    let (state, (z, rate)) = (motion.state(), motion.base());
    let bodies = [state.particles[0], state.tuned_masses[0]].map(|body| (body.y_m, body.u_m_per_s));
    let places = (0..3).map(|place| set_up.displacement_m(&state, place) + z);
    for ((x_m, _), end) in pieces.ends.iter().zip(places) {
        assert!((x_m - end).abs() < 1e-14);
    }
    for (end, body) in pieces.ends[3..].iter().zip(bodies.into_iter().chain([(z, rate)])) {
        assert!((end.0 - body.0).abs() < 1e-14 && (end.1 - body.1).abs() < 1e-13, "{end:?} {body:?}");
    }
}

/// Nothing moves while particles touch their walls, and no step is given up.
#[test]
fn what_is_at_rest_at_a_wall_stays_so() {
    let wall = Wall::Restitution { coefficient: 0.8 };
    let joint = FrictionJoint { place: 1, other: Some(0), damper: FrictionDamper { force_n: 0.5 } };
    for (side, friction) in [(1.0, 0.0), (-1.0, 0.0), (1.0, 0.2)] {
        let mut of = particle(0.5, 1e-3, wall);
        of.friction_coefficient = friction;
        let set_up = SetUp {
            impact_dampers: vec![ImpactDamper::new(1, of), ImpactDamper::new(0, of)],
            friction_dampers: vec![joint],
            ..SetUp::bare(frame(2, 0.5))
        };
        let mut start = set_up.at_rest(base_at_start(&Excitation::Fixed));
        start.particles[0].y_m = side * 1e-3;
        let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
        let mut times = Times::default();
        motion.run(10.0, &mut times).unwrap();
        assert_eq!((motion.unresolved(), times.0.len()), (0, 0));
        let end = motion.state();
        for (body, begun) in end.particles.iter().zip(&start.particles) {
            assert!((body.y_m - begun.y_m).abs() < 1e-17 && body.u_m_per_s.abs() < 1e-17, "{body:?}");
        }
        assert!(end.modal.iter().chain(&end.modal_rate).all(|q| q.abs() < 1e-18), "{end:?}");
    }
}

/// An impact of one particle changes the velocity of the structure, and with it the force of the dashpot that another presses: below zero the soft
/// wall lets go at once.
#[test]
fn an_impact_may_end_the_contact_of_another_particle_with_a_dashpot() {
    let soft = Wall::Voigt { stiffness_n_per_m: 1000.0, damping_n_s_per_m: 50.0, release: Release::ZeroForce };
    let dampers = [particle(0.5, 4e-3, Wall::Restitution { coefficient: 0.5 }), particle(0.5, 1e-3, soft)];
    let storey = Storey { mass_kg: 10.0, stiffness_n_per_m: 4000.0, damping_n_s_per_m: 4.0 };
    let set_up = SetUp {
        impact_dampers: dampers.map(|particle| ImpactDamper::new(0, particle)).to_vec(),
        ..SetUp::bare(Modes::storeys(&[storey]).unwrap())
    };
    let pulse = Excitation::HalfSine { amplitude_m: 0.01, duration_s: 0.5 };
    let mut motion = Motion::new(&set_up, &pulse, &set_up.at_rest(base_at_start(&pulse))).unwrap();
    let mut times = Times::default();
    motion.run(2.0, &mut times).unwrap();
    let of_each = [0, 1].map(|damper| times.0.iter().filter(|(_, of)| *of == damper).count());
    assert!(motion.unresolved() == 0 && of_each.iter().all(|count| *count > 5), "{of_each:?}");
}

/// A particle that touches a soft wall at rest follows it from the first derivative that is not zero.
#[test]
fn a_start_at_a_soft_wall_has_no_steps_without_guards() {
    let storey = Storey { mass_kg: 10.0, stiffness_n_per_m: 4000.0, damping_n_s_per_m: 0.0 };
    let force = Excitation::ForceHalfSine { amplitude_n: -50.0, duration_s: 0.5 };
    for (stiffness_n_per_m, damping_n_s_per_m) in [(1e6, 0.0), (1e4, 0.0), (1e6, 30.0), (2e3, 50.0)] {
        let wall = Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release: Release::ZeroForce };
        for side in [-1.0, 1.0] {
            let set_up = SetUp {
                impact_dampers: vec![ImpactDamper::new(0, particle(1.0, 1e-3, wall))],
                driven_place: Some(0),
                ..SetUp::bare(Modes::storeys(&[storey]).unwrap())
            };
            let mut start = set_up.at_rest(base_at_start(&force));
            start.particles[0].y_m = side * 1e-3;
            let mut motion = Motion::new(&set_up, &force, &start).unwrap();
            let mut times = Times::default();
            motion.run(2.0, &mut times).unwrap();
            assert!(
                motion.unresolved() == 0 && !times.0.is_empty(),
                "{stiffness_n_per_m} {side}: {}",
                motion.unresolved()
            );
            assert!(times.0.iter().all(|(time_s, _)| *time_s > 0.01), "an impact at the start: {:?}", times.0[0]);
        }
    }
}

/// Free vibration between soft walls of every kind, ended at instants of which many lie in contacts: begun again from each of its states, it goes on as
/// the motion that was not ended. The contact with a Hertz wall is begun anew with its stated error.
#[test]
fn a_motion_goes_on_from_its_state_in_a_soft_wall() {
    let piezoelectric =
        PiezoelectricWall { stiffness_n_per_m: 2e4, coupling_n_per_v: 2e-2, capacitance_f: 2e-8, load_ohm: 2e5 };
    let voigt = |release| Wall::Voigt { stiffness_n_per_m: 2e4, damping_n_s_per_m: 20.0, release };
    let hertz = Wall::Hertz(Hertz {
        stiffness_n_per_m15: 1e6,
        dissipation: Dissipation::HuntCrossley { coefficient_s_per_m: 0.3 },
    });
    for (wall, in_place, tolerance) in [
        (voigt(Release::ZeroPenetration), None, 1e-12),
        (voigt(Release::ZeroForce), None, 1e-12),
        (voigt(Release::ZeroPenetration), Some(piezoelectric), 1e-12),
        (hertz, None, 1e-8),
    ] {
        let damper = ImpactDamper { piezoelectric: [in_place; 2], ..ImpactDamper::new(2, particle(0.3, 0.004, wall)) };
        let set_up = SetUp { impact_dampers: vec![damper], ..SetUp::bare(frame(3, 2.0)) };
        let mut start = set_up.at_rest((0.0, 0.0));
        start.modal[0] = 0.03;
        start.particles[0].y_m = set_up.displacement_m(&start, 2);
        let begin = |from: &State| Motion::new(&set_up, &Excitation::Fixed, from).unwrap();
        let end = |mut motion: Motion, until_s: f64| {
            motion.run(until_s, &mut ()).unwrap();
            motion.state()
        };
        let (whole_s, mut inside) = (1.0, 0);
        let whole = end(begin(&start), whole_s);
        for n in 1..200 {
            let at_s = 0.005 * f64::from(n);
            let here = end(begin(&start), at_s);
            let offset_m = here.particles[0].y_m - set_up.displacement_m(&here, 2);
            inside += u32::from(offset_m.abs() > 0.004 + 1e-9);
            let later = end(begin(&here), whole_s - at_s);
            let off = later.particles[0].y_m - whole.particles[0].y_m;
            assert!(off.abs() < tolerance * 0.03, "{wall:?} {in_place:?} at {at_s}: {off}");
        }
        assert!(inside > 5, "{wall:?}: {inside}");
    }
}

/// Random frames with particles of equal and different kinds, friction joints and a tuned mass, released from a random state.
#[test]
fn no_free_motion_gains_energy() {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut together = 0;
    for case in 0..40 {
        let storeys = rng.usize(1..5);
        let mut set_up = SetUp::bare(frame(storeys, 0.0));
        for _ in 0..rng.usize(1..4) {
            let wall = Wall::Restitution { coefficient: 0.95 * rng.f64() };
            let damper = ImpactDamper::new(rng.usize(0..storeys), particle(0.3, 8e-3, wall));
            set_up.impact_dampers.push(damper);
            if rng.bool() {
                // A second one of the same mass, whose impacts fall on the same instants until e tells them apart.
                let wall = Wall::Restitution { coefficient: 0.95 * rng.f64() };
                set_up.impact_dampers.push(ImpactDamper { particle: particle(0.3, 8e-3, wall), ..damper });
            }
        }
        if rng.bool() {
            let other = (storeys > 1).then_some(0);
            let joint = FrictionJoint { place: storeys - 1, other, damper: FrictionDamper { force_n: 0.5 } };
            set_up.friction_dampers.push(joint);
        }
        if rng.bool() {
            let tmd = Tmd { mass_kg: 0.2, stiffness_n_per_m: 40.0, damping_n_s_per_m: 0.1 };
            set_up.tuned_masses.push(TunedMass { place: 0, tmd });
        }
        let mut start = set_up.at_rest(base_at_start(&Excitation::Fixed));
        start.modal_rate.iter_mut().for_each(|v| *v = rng.f64() - 0.5);
        let begun = energy_j(&set_up, &start);
        let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
        let mut times = Times::default();
        let mut before = begun;
        for n in 1..=200 {
            motion.run(f64::from(n) * 0.02, &mut times).unwrap();
            let now = energy_j(&set_up, &motion.state());
            assert!(now <= before + 1e-12 * begun, "case {case}, {n}: {before} J, then {now} J");
            before = now;
        }
        assert_eq!(motion.unresolved(), 0, "case {case}");
        together += times.0.windows(2).filter(|two| two[0].0 == two[1].0 && two[0].1 != two[1].1).count();
    }
    println!("{together} impacts at the instant of another");
    assert!(together > 20);
}

/// Elastic impacts, no damping: the energy stays.
#[test]
fn elastic_impacts_keep_the_energy() {
    let wall = Wall::Restitution { coefficient: 1.0 };
    let dampers = [(2, 0.4), (0, 0.3)].map(|(place, mass)| ImpactDamper::new(place, particle(mass, 8e-3, wall)));
    let set_up = SetUp { impact_dampers: dampers.to_vec(), ..SetUp::bare(frame(3, 0.0)) };
    let mut start = set_up.at_rest(base_at_start(&Excitation::Fixed));
    start.modal_rate = vec![0.4, -0.2, 0.1];
    let begun = energy_j(&set_up, &start);
    let mut motion = Motion::new(&set_up, &Excitation::Fixed, &start).unwrap();
    let mut times = Times::default();
    motion.run(50.0, &mut times).unwrap();
    let off = energy_j(&set_up, &motion.state()) / begun - 1.0;
    println!("{} impacts, energy off by {off:.1e}", times.0.len());
    assert!(times.0.len() > 500);
    // Each impact rounds each velocity a few times.
    assert!(off.abs() < 4.0 * f64::EPSILON * times.0.len() as f64);
}

/// A particle at rest at its wall while friction locks the structure: no derivative of its gap tells whether it leaves. The steps that do
/// without its guards still see the friction, and the motion is that of a particle that starts 10⁻¹¹ m off the wall.
#[test]
fn friction_is_watched_while_a_resting_particle_is_not_told_apart() {
    let walls = [
        Wall::Restitution { coefficient: 0.5 },
        Wall::Voigt { stiffness_n_per_m: 1000.0, damping_n_s_per_m: 0.0, release: Release::ZeroForce },
    ];
    let excitation = Excitation::ForceSine { amplitude_n: 1.0, angular_frequency_rad_per_s: 50.0, phase_rad: 0.0 };
    let mut unresolved = 0;
    for (wall, side) in walls.into_iter().flat_map(|wall| [(wall, -1.0), (wall, 1.0)]) {
        let set_up = SetUp {
            impact_dampers: vec![ImpactDamper::new(0, particle(0.5, 4e-3, wall))],
            friction_dampers: vec![FrictionJoint { place: 2, other: None, damper: FrictionDamper { force_n: 0.5 } }],
            driven_place: Some(2),
            ..SetUp::bare(frame(3, 4.0))
        };
        let mut motions = [0.0, 1e-11].map(|off_m| {
            let mut start = set_up.at_rest(base_at_start(&excitation));
            start.particles[0].y_m = side * (4e-3 - off_m);
            Motion::new(&set_up, &excitation, &start).unwrap()
        });
        for n in 1..=100 {
            let [at, off] = motions.each_mut().map(|motion| {
                motion.run(f64::from(n) * 0.02, &mut ()).unwrap();
                motion.state()
            });
            for (at, off) in at.modal.iter().zip(&off.modal) {
                assert!((at - off).abs() < 1e-8, "{wall:?}, {side}, {n}: {at} √kg·m, {off} next to the wall");
            }
        }
        unresolved += motions[0].unresolved();
    }
    assert!(unresolved > 0, "every contact is told apart: the case tests nothing");
}

/// Two equal halves of a particle, at the same place and from the same start, move as the whole one.
#[test]
fn two_halves_of_a_particle_move_as_one() {
    for wall in [
        Wall::Restitution { coefficient: 0.4 },
        Wall::Voigt { stiffness_n_per_m: 2e3, damping_n_s_per_m: 2.0, release: Release::ZeroForce },
    ] {
        let half = match wall {
            Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release } => Wall::Voigt {
                stiffness_n_per_m: 0.5 * stiffness_n_per_m,
                damping_n_s_per_m: 0.5 * damping_n_s_per_m,
                release,
            },
            other => other,
        };
        let whole = vec![ImpactDamper::new(1, particle(0.4, 10e-3, wall))];
        let halves = vec![ImpactDamper::new(1, particle(0.2, 10e-3, half)); 2];
        let base = SetUp::bare(frame(2, 0.5));
        let one = SetUp { impact_dampers: whole, ..base.clone() };
        let two = SetUp { impact_dampers: halves, ..base };
        let excitation = Excitation::Sine { amplitude_m: 2e-3, angular_frequency_rad_per_s: 17.0, phase_rad: 0.0 };
        let mut whole = Motion::new(&one, &excitation, &one.at_rest(base_at_start(&excitation))).unwrap();
        let mut halves = Motion::new(&two, &excitation, &two.at_rest(base_at_start(&excitation))).unwrap();
        whole.run(3.0, &mut ()).unwrap();
        halves.run(3.0, &mut ()).unwrap();
        let (whole, halves) = (whole.state(), halves.state());
        for (a, b) in whole.modal.iter().zip(&halves.modal) {
            assert!((a - b).abs() < 1e-11, "{wall:?}: {a} {b}");
        }
    }
}

/// Friction joints that hold a frame at rest until the base shakes hard enough for one of them.
#[test]
fn joints_stick_together_until_one_of_them_gives_way() {
    let joint = |place, other, force_n| FrictionJoint { place, other, damper: FrictionDamper { force_n } };
    let joints = vec![joint(0, None, 5.0), joint(1, Some(0), 2.0)];
    let set_up = SetUp { friction_dampers: joints, ..SetUp::bare(frame(2, 0.5)) };
    let omega = 17.0_f64;
    // The upper floor's 2 kg need m Ω² Z of the upper joint, both floors twice that of the lower one.
    for (amplitude_m, moves) in [(3.4e-3, false), (3.5e-3, true)] {
        let limit_m = 2.0 / (2.0 * omega * omega);
        assert_eq!(amplitude_m > limit_m, moves);
        let excitation = Excitation::Sine { amplitude_m, angular_frequency_rad_per_s: omega, phase_rad: 0.0 };
        // At rest relative to the moving base.
        let start = State { modal: vec![0.0; 2], modal_rate: vec![0.0; 2], ..State::default() };
        let mut motion = Motion::new(&set_up, &excitation, &start).unwrap();
        motion.run(1.0, &mut ()).unwrap();
        let state = motion.state();
        let drift = set_up.displacement_m(&state, 1) - set_up.displacement_m(&state, 0);
        assert!(set_up.displacement_m(&state, 0).abs() < 1e-15);
        assert_eq!(drift.abs() > 1e-7, moves, "{drift}");
    }
}

/// A particle at rest on the lower wall of an upright cavity at the top of a frame moves with the floor.
#[test]
fn a_particle_that_rests_on_its_wall_adds_its_mass() {
    let cavity = Cavity { inclination_deg: 90.0, ..Cavity::default() };
    let resting = Particle { cavity, ..particle(0.5, 0.1, Wall::Restitution { coefficient: 0.3 }) };
    let set_up = SetUp { impact_dampers: vec![ImpactDamper::new(1, resting)], ..SetUp::bare(frame(2, 0.5)) };
    let heavier = [
        Storey { mass_kg: 2.0, stiffness_n_per_m: 1500.0, damping_n_s_per_m: 0.5 },
        Storey { mass_kg: 2.5, stiffness_n_per_m: 1500.0, damping_n_s_per_m: 0.5 },
    ];
    let heavier = SetUp::bare(Modes::storeys(&heavier).unwrap());
    // Accelerations below g, measured from where the particle's weight has bent the frame.
    let static_m = [0.5 * 9.81 / 1500.0, 2.0 * 0.5 * 9.81 / 1500.0];
    let modal = |set_up: &SetUp, mass: [f64; 2]| -> Vec<f64> {
        let modes = set_up.structure.modes.iter();
        modes.map(|mode| -(mode.shape[0] * mass[0] * static_m[0] + mode.shape[1] * mass[1] * static_m[1])).collect()
    };
    let excitation = Excitation::Sine { amplitude_m: 1e-3, angular_frequency_rad_per_s: 12.0, phase_rad: 0.0 };
    let mut start = set_up.at_rest(base_at_start(&Excitation::Fixed));
    start.modal = modal(&set_up, [2.0, 2.0]);
    start.particles = vec![Body { y_m: set_up.displacement_m(&start, 1) - 0.1, u_m_per_s: 1e-3 * 12.0 }];
    let mut one = Motion::new(&set_up, &excitation, &start).unwrap();
    let mut other = Motion::new(&heavier, &excitation, &heavier.at_rest(base_at_start(&Excitation::Fixed))).unwrap();
    one.run(7.0, &mut ()).unwrap();
    other.run(7.0, &mut ()).unwrap();
    let (one, other) = (one.state(), other.state());
    for (place, rest_m) in static_m.into_iter().enumerate() {
        let (x, expected) = (set_up.displacement_m(&one, place), heavier.displacement_m(&other, place) - rest_m);
        assert!((x - expected).abs() < 1e-13, "{x} {expected}");
    }
}
