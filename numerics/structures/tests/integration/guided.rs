//! A motion that is guided from outside: momentum, jumps of the base, forces that change, impulses, trials.

use damprig_core::model::{FrictionDamper, Particle, Tmd, Wall};
use damprig_structures::{FrictionJoint, Impact, ImpactDamper, Modes, Motion, Observer, SetUp, Storey, TunedMass};

const STEP_S: f64 = 0.01;

fn storeys() -> Modes {
    let storey = |mass_kg, stiffness_n_per_m| Storey { mass_kg, stiffness_n_per_m, damping_n_s_per_m: 0.4 };
    Modes::storeys(&[storey(1.3, 900.0), storey(1.0, 1_200.0), storey(0.7, 700.0)]).expect("a frame")
}

/// A frame with a damper of each kind.
fn frame() -> SetUp {
    let wall = Wall::Restitution { coefficient: 0.6 };
    let particle =
        Particle { mass_kg: 0.1, clearance_m: 0.004, friction_coefficient: 0.05, wall, cavity: Default::default() };
    let tmd = Tmd { mass_kg: 0.05, stiffness_n_per_m: 20.0, damping_n_s_per_m: 0.1 };
    SetUp {
        impact_dampers: vec![ImpactDamper::new(2, particle)],
        friction_dampers: vec![FrictionJoint { place: 0, other: None, damper: FrictionDamper { force_n: 0.3 } }],
        tuned_masses: vec![TunedMass { place: 1, tmd }],
        ..SetUp::bare(storeys())
    }
}

/// A parabola of the base after another, each with its velocity going on: n counts them.
fn base(n: u32) -> [f64; 4] {
    let t = |n: u32| f64::from(n) * STEP_S;
    let (z, rate) = (0.004 * (13.0 * t(n)).sin(), 0.004 * 13.0 * (13.0 * t(n)).cos());
    let (end, end_rate) = (0.004 * (13.0 * t(n + 1)).sin(), 0.004 * 13.0 * (13.0 * t(n + 1)).cos());
    let (h, rise) = (STEP_S, end - z);
    [z, rate, (3.0 * rise / h - 2.0 * rate - end_rate) / h, (rate + end_rate - 2.0 * rise / h) / (h * h)]
}

fn started(set_up: &SetUp) -> Motion {
    let [z, rate, ..] = base(0);
    Motion::on_base(set_up, base(0), &set_up.at_rest((z, rate))).expect("it starts")
}

fn go(motion: &mut Motion, steps: std::ops::Range<u32>, observer: &mut impl Observer) {
    for n in steps {
        motion.follow(base(n)).expect("it follows");
        motion.run(f64::from(n + 1) * STEP_S, observer).expect("it goes on");
    }
}

#[test]
fn momentum_is_that_of_floors_and_dampers() {
    let set_up = frame();
    let mut motion = started(&set_up);
    let whole_kg = 1.3 + 1.0 + 0.7 + 0.1 + 0.05;
    assert!((motion.moving_mass_kg() / whole_kg - 1.0).abs() < 1e-13, "{}", motion.moving_mass_kg());
    for n in 0..400 {
        go(&mut motion, n..n + 1, &mut ());
        let state = motion.state();
        let floors: f64 = [1.3, 1.0, 0.7]
            .iter()
            .enumerate()
            .map(|(place, mass_kg)| mass_kg * set_up.place(&state, place, motion.base()).u_m_per_s)
            .sum();
        let expected = floors + 0.1 * state.particles[0].u_m_per_s + 0.05 * state.tuned_masses[0].u_m_per_s;
        assert!((motion.momentum_kg_m_per_s() - expected).abs() < 1e-13, "{n}: {expected}");
    }
}

/// Impacts, with the velocity of the particle from piece to piece.
#[derive(Default)]
struct Impulses {
    before_m_per_s: f64,
    last: Option<Impact>,
    /// m Δu and the impulse that was told.
    both_n_s: Vec<(f64, f64)>,
}

impl Observer for Impulses {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &damprig_structures::Piece) {
        let course = piece.particle(0);
        if let Some(impact) = self.last.take() {
            let change = course.at(0.0).1 - self.before_m_per_s;
            self.both_n_s.push((-f64::from(impact.side) * 0.1 * change, impact.impulse_n_s));
        }
        self.before_m_per_s = course.at(piece.length_s).1;
    }

    fn impact(&mut self, impact: &Impact) {
        // The first of a chatter that ends in one instant: a piece follows each.
        self.last = self.last.or(Some(*impact));
    }
}

#[test]
fn an_impulse_is_the_change_of_the_particles_momentum() {
    let set_up = frame();
    let mut motion = started(&set_up);
    let mut seen = Impulses::default();
    go(&mut motion, 0..600, &mut seen);
    assert!(seen.both_n_s.len() > 30, "{} impacts", seen.both_n_s.len());
    for (change, told) in &seen.both_n_s {
        // Rounding of m u, with u up to 1 m/s.
        assert!(*told > 0.0 && (change - told).abs() < 1e-12 * told + 1e-16, "{change} {told}");
    }
}

#[test]
fn a_trial_ends_where_the_motion_ends_and_leaves_it_where_it_is() {
    let set_up = frame();
    let mut motion = started(&set_up);
    go(&mut motion, 0..150, &mut ());
    for n in 150..300 {
        let before = (motion.state(), motion.time_s());
        let tried = motion.tried(|motion| {
            go(motion, n..n + 1, &mut ());
            motion.momentum_kg_m_per_s()
        });
        assert_eq!((motion.state(), motion.time_s()), before);
        go(&mut motion, n..n + 1, &mut ());
        assert_eq!(motion.momentum_kg_m_per_s(), tried);
    }
}

#[test]
fn a_force_that_is_set_acts_as_one_of_the_set_up() {
    let weaker = frame();
    let mut stronger = frame();
    stronger.friction_dampers[0].damper.force_n = 0.9;
    let (mut changed, mut own) = (started(&weaker), started(&stronger));
    changed.set_friction_n(0, 0.9).expect("it goes on");
    for motion in [&mut changed, &mut own] {
        go(motion, 0..100, &mut ());
    }
    let top = |motion: &Motion| weaker.displacement_m(&motion.state(), 2);
    assert!((top(&changed) - top(&own)).abs() < 1e-13, "{} {}", top(&changed), top(&own));
    // Without a force nothing is lost in the joint: as without the damper.
    let mut without = frame();
    without.friction_dampers.clear();
    let (mut freed, mut bare) = (started(&weaker), started(&without));
    freed.set_friction_n(0, 0.0).expect("it goes on");
    for motion in [&mut freed, &mut bare] {
        go(motion, 0..100, &mut ());
    }
    assert!((top(&freed) - top(&bare)).abs() < 1e-13, "{} {}", top(&freed), top(&bare));
    // A joint that sticks lets go when its force goes.
    let mut stuck = started(&SetUp {
        friction_dampers: vec![FrictionJoint { place: 0, other: None, damper: FrictionDamper { force_n: 1e3 } }],
        ..SetUp::bare(storeys())
    });
    go(&mut stuck, 0..100, &mut ());
    let held = stuck.state();
    stuck.set_friction_n(0, 0.0).expect("it goes on");
    for (now, before) in stuck.state().modal_rate.iter().zip(&held.modal_rate) {
        assert!((now - before).abs() < 1e-15, "nothing jumps: {now} {before}");
    }
    go(&mut stuck, 100..110, &mut ());
    let first = SetUp::bare(storeys()).displacement_m(&stuck.state(), 0);
    assert!(first.abs() > 1e-5, "the floor moves: {first}");
}

#[test]
fn where_the_base_jumps_the_masses_keep_their_velocities() {
    let set_up = frame();
    let mut motion = started(&set_up);
    go(&mut motion, 0..170, &mut ());
    let velocities = |motion: &Motion| {
        let state = motion.state();
        let floors = (0..3).map(|place| set_up.place(&state, place, motion.base()).u_m_per_s);
        floors.chain([state.particles[0].u_m_per_s, state.tuned_masses[0].u_m_per_s]).collect::<Vec<f64>>()
    };
    let before = velocities(&motion);
    let [z, rate, ..] = base(170);
    motion.follow_jump([z, rate + 0.05, 0.0, 0.0]).expect("it goes on");
    assert!((motion.base().1 - rate - 0.05).abs() < 1e-15);
    for (before, after) in before.iter().zip(velocities(&motion)) {
        assert!((before - after).abs() < 1e-14, "{before} {after}");
    }
}
