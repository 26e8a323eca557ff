//! Properties of the exact driver that hold for every system, tested on random systems with fixed seeds.

use damprig_core::analysis::energy::EnergyMeter;
use damprig_core::integrator::exact::{Arc, Exact, ExactState, Excitation, Impact, Observer};
use damprig_core::model::{Initial, Particle, Release, SetUp, Tmd, Wall};

use crate::draw::Draw;

impl Draw {
    /// A particle between hard walls, with friction in half the cases.
    fn hard(&mut self) -> SetUp {
        self.set_up(|draw| Wall::Restitution { coefficient: draw.between(0.0, 1.0) })
    }

    /// Any kind of system.
    fn any(&mut self) -> SetUp {
        let mut set_up = self.hard();
        match self.one_of(4) {
            0 => {
                let mass_kg = set_up.structure.mass_kg * self.between(0.02, 0.3);
                set_up.particle = None;
                set_up.tmd = Some(Tmd {
                    mass_kg,
                    stiffness_n_per_m: mass_kg * self.between(30.0, 900.0),
                    damping_n_s_per_m: mass_kg * self.between(0.0, 6.0),
                });
            }
            1 => {
                let particle = set_up.particle.as_mut().expect("a particle was drawn");
                particle.wall = Wall::Voigt {
                    stiffness_n_per_m: self.between(500.0, 60_000.0),
                    damping_n_s_per_m: self.between(0.0, 20.0),
                    release: if self.coin() { Release::ZeroForce } else { Release::ZeroPenetration },
                };
            }
            _ => {}
        }
        set_up
    }
}

/// Observer that checks the laws of motion.
struct Laws {
    set_up: SetUp,
    impacts: usize,
    end: Option<(f64, ExactState)>,
}

impl Observer for Laws {
    fn arc(&mut self, arc: &Arc<'_>) {
        if let Some((end_s, end)) = self.end {
            assert!((arc.start_s - end_s).abs() <= 4.0 * f64::EPSILON * end_s.max(1.0), "a gap in time");
            assert!(arc.start.x_m == end.x_m && arc.start.offset_m == end.offset_m, "a jump in displacement");
        }
        let Some(particle) = self.set_up.particle else { return };
        let hard = matches!(particle.wall, Wall::Restitution { .. });
        let scale = arc.start.x_m.abs() + arc.end.x_m.abs() + particle.clearance_m;
        for n in 0..=200 {
            let state = arc.state(arc.length_s * f64::from(n) / 200.0);
            // About ten roundings of the sum.
            let allowed = particle.clearance_m + 16.0 * f64::EPSILON * scale;
            assert!(!hard || state.offset_m.abs() <= allowed, "{:e} past the wall", state.offset_m.abs() - allowed);
        }
        // The end states agree with the series.
        let last = arc.state(arc.length_s);
        let speed = arc.start.v_m_per_s.abs() + arc.start.slide_m_per_s.abs() + scale / arc.length_s.max(1e-3);
        assert!((last.x_m - arc.end.x_m).abs() <= 64.0 * f64::EPSILON * scale, "{:e}", last.x_m - arc.end.x_m);
        assert!((last.offset_m - arc.end.offset_m).abs() <= 64.0 * f64::EPSILON * scale);
        assert!((last.v_m_per_s - arc.end.v_m_per_s).abs() <= 64.0 * f64::EPSILON * speed);
        self.end = Some((arc.start_s + arc.length_s, arc.end));
    }

    fn impact(&mut self, impact: &Impact) {
        self.impacts += 1;
        self.end = None;
        let Some(Wall::Restitution { coefficient }) = self.set_up.particle.map(|p| p.wall) else { return };
        let (mass, light) = (self.set_up.structure.mass_kg, self.set_up.particle.map_or(0.0, |p| p.mass_kg));
        let momentum = |s: &ExactState| mass * s.v_m_per_s + light * s.u_m_per_s();
        let size = mass * impact.before.v_m_per_s.abs() + light * impact.before.u_m_per_s().abs();
        let kept = momentum(&impact.after) - momentum(&impact.before);
        assert!(kept.abs() <= 8.0 * f64::EPSILON * size, "momentum changed by {kept:e} of {size:e}");
        assert_eq!(impact.after.slide_m_per_s, -coefficient * impact.before.slide_m_per_s);
        assert!(impact.approach_speed_m_per_s >= 0.0);
    }
}

#[test]
fn impacts_conserve_momentum_and_no_particle_passes_a_wall() {
    let mut draw = Draw::new(1);
    let mut impacts = 0;
    for _ in 0..300 {
        let set_up = draw.hard();
        let (sine, initial) = (draw.sine(&set_up), draw.initial(&set_up));
        let mut motion = Exact::new(&set_up, &sine, &initial).expect("drawn within the ranges");
        let mut laws = Laws { set_up, impacts: 0, end: None };
        motion.run(6.0, &mut laws);
        assert_eq!(motion.unresolved(), 0);
        impacts += laws.impacts;
    }
    assert!(impacts > 5_000, "only {impacts} impacts were tested");
}

#[test]
fn energy_changes_only_by_the_known_mechanisms() {
    let mut draw = Draw::new(2);
    for n in 0..300 {
        let set_up = draw.any();
        let initial = draw.initial(&set_up);
        let base = if draw.coin() { draw.sine(&set_up) } else { Excitation::Fixed };
        let mut motion = Exact::new(&set_up, &base, &initial).expect("drawn within the ranges");
        let mut meter = EnergyMeter::new(&set_up);
        let mut through = 0.0;
        for second in 1..=5 {
            motion.run(f64::from(second), &mut meter);
            let balance = meter.balance();
            through = balance.dissipated_j() + balance.input_j.abs() + balance.stored_change_j.abs();
            // The sums have some thousand terms, each with an error of a few roundings of the energy in the motion.
            let allowed = 1e-12 * (through + 0.1);
            assert!(balance.residual_j.abs() <= allowed, "{n}: {:e} left: {balance:?}\n{set_up:?}", balance.residual_j);
            for taken in [
                balance.structure_damping_j,
                balance.impacts_j,
                balance.internal_friction_j,
                balance.friction_damper_j,
                balance.link_damping_j,
            ] {
                assert!(taken >= -allowed, "{n}: energy created: {balance:?}");
            }
        }
        assert!(through > 0.0);
    }
}

#[test]
fn a_conservative_system_run_backwards_returns_to_its_start() {
    let mut draw = Draw::new(3);
    let mut reversed = 0;
    for _ in 0..200 {
        let mut set_up = draw.hard();
        set_up.structure.damping_n_s_per_m = 0.0;
        set_up.friction_damper = None;
        let particle = set_up.particle.as_mut().expect("a particle was drawn");
        particle.friction_coefficient = 0.0;
        particle.wall = Wall::Restitution { coefficient: 1.0 };
        let initial = draw.initial(&set_up);
        let there = |initial: &Initial| {
            let mut motion = Exact::new(&set_up, &Excitation::Fixed, initial).expect("drawn within the ranges");
            motion.run(2.0, &mut ());
            *motion.state()
        };
        let back = |state: ExactState| Initial {
            x_m: state.x_m,
            v_m_per_s: -state.v_m_per_s,
            y_m: state.y_m(),
            u_m_per_s: -state.u_m_per_s(),
        };
        // The amplification of a small change gives the expected error from rounding.
        let nudged = Initial { v_m_per_s: initial.v_m_per_s + 1e-9, ..initial };
        let (plain, moved) = (there(&initial), there(&nudged));
        let growth = ((plain.v_m_per_s - moved.v_m_per_s).abs() + (plain.u_m_per_s() - moved.u_m_per_s()).abs()) / 1e-9;
        if growth > 1e4 {
            continue;
        }
        let again = back(there(&back(plain)));
        let allowed = 2e-13 * growth.max(1.0);
        assert!((again.x_m - initial.x_m).abs() <= allowed, "{:e}, growth {growth}", again.x_m - initial.x_m);
        assert!(
            (again.v_m_per_s + initial.v_m_per_s).abs() <= 10.0 * allowed
                || (again.v_m_per_s - initial.v_m_per_s).abs() <= 10.0 * allowed
        );
        reversed += 1;
    }
    assert!(reversed > 100, "only {reversed} were tested");
}

#[test]
fn twice_the_base_and_twice_the_clearance_give_twice_the_motion_to_the_last_bit() {
    let mut draw = Draw::new(4);
    for _ in 0..100 {
        let mut set_up = draw.hard();
        set_up.friction_damper = None;
        set_up.particle.as_mut().expect("a particle was drawn").friction_coefficient = 0.0;
        let (sine, initial) = (draw.sine(&set_up), draw.initial(&set_up));
        let run = |scale: f64| {
            let mut set_up = set_up;
            set_up.particle.as_mut().expect("a particle was drawn").clearance_m *= scale;
            let Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad } = sine else { unreachable!() };
            let sine = Excitation::Sine { amplitude_m: scale * amplitude_m, angular_frequency_rad_per_s, phase_rad };
            let initial = Initial {
                x_m: scale * initial.x_m,
                v_m_per_s: scale * initial.v_m_per_s,
                y_m: scale * initial.y_m,
                u_m_per_s: scale * initial.u_m_per_s,
            };
            let mut motion = Exact::new(&set_up, &sine, &initial).expect("drawn within the ranges");
            motion.run(10.0, &mut ());
            *motion.state()
        };
        let (one, two) = (run(1.0), run(2.0));
        assert_eq!(2.0 * one.x_m, two.x_m);
        assert_eq!(2.0 * one.slide_m_per_s, two.slide_m_per_s);
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_intermediate_stops() {
    let mut draw = Draw::new(5);
    let mut compared = 0;
    for _ in 0..100 {
        let set_up = draw.any();
        let (sine, initial) = (draw.sine(&set_up), draw.initial(&set_up));
        let run = |initial: &Initial, stops: u32| {
            let mut motion = Exact::new(&set_up, &sine, initial).expect("drawn within the ranges");
            for stop in 1..=stops {
                motion.run(2.0 * f64::from(stop) / f64::from(stops), &mut ());
            }
            *motion.state()
        };
        let (once, often) = (run(&initial, 1), run(&initial, 997));
        let nudged = run(&Initial { x_m: initial.x_m + 1e-10, ..initial }, 1);
        let growth = ((once.x_m - nudged.x_m).abs() + (once.offset_m - nudged.offset_m).abs()) / 1e-10;
        if growth > 1e4 {
            continue;
        }
        let apart = (once.x_m - often.x_m).abs() + (once.offset_m - often.offset_m).abs();
        assert!(apart <= 1e-14 * (1.0 + 100.0 * growth), "{apart:e}, growth {growth}");
        compared += 1;
    }
    assert!(compared > 60, "only {compared} were compared");
}

#[test]
fn soft_walls_converge_to_hard_walls_with_increasing_stiffness() {
    let mut draw = Draw::new(6);
    for _ in 0..20 {
        let mut set_up = draw.hard();
        set_up.friction_damper = None;
        let mut particle = set_up.particle.expect("a particle was drawn");
        particle.friction_coefficient = 0.0;
        let damped = draw.between(0.05, 0.5);
        let reduced = particle.mass_kg * set_up.structure.mass_kg / (particle.mass_kg + set_up.structure.mass_kg);
        let first_impact = Initial { u_m_per_s: 0.3, ..Initial::default() };
        // Contact that ends at zero penetration: e = exp(−π z₁/√(1 − z₁²)).
        let coefficient = (-std::f64::consts::PI * damped / (1.0 - damped * damped).sqrt()).exp();
        let run = |wall: Wall| {
            let set_up = SetUp { particle: Some(Particle { wall, ..particle }), ..set_up };
            let mut motion = Exact::new(&set_up, &Excitation::Fixed, &first_impact).expect("drawn within the ranges");
            motion.run(particle.clearance_m / 0.3 * 1.5, &mut ());
            *motion.state()
        };
        let hard = run(Wall::Restitution { coefficient });
        let soft = |stiffness_n_per_m: f64| {
            run(Wall::Voigt {
                stiffness_n_per_m,
                damping_n_s_per_m: 2.0 * damped * (stiffness_n_per_m * reduced).sqrt(),
                release: Release::ZeroPenetration,
            })
        };
        let apart = |k: f64| (soft(k).x_m - hard.x_m).abs() + (soft(k).offset_m - hard.offset_m).abs();
        let (near, nearer) = (apart(1e8), apart(1e10));
        // The difference is the duration of the contact, which is proportional to 1/√k.
        assert!(nearer <= 0.2 * near + 1e-12, "{near:e} {nearer:e}");
    }
}

/// A grazing contact: the clearance is set slightly below or above the largest offset of the particle.
#[test]
fn a_grazing_contact_is_detected_and_a_near_miss_is_not() {
    struct Reach(f64);
    impl Observer for Reach {
        fn arc(&mut self, arc: &Arc<'_>) {
            for n in 0..=64 {
                self.0 = self.0.max(arc.state(arc.length_s * f64::from(n) / 64.0).offset_m.abs());
            }
        }
    }
    struct Count(usize);
    impl Observer for Count {
        const ARCS: bool = false;
        fn impact(&mut self, _: &Impact) {
            self.0 += 1;
        }
    }
    let mut draw = Draw::new(7);
    for _ in 0..40 {
        let mut set_up = draw.hard();
        set_up.friction_damper = None;
        let particle = set_up.particle.as_mut().expect("a particle was drawn");
        particle.friction_coefficient = 0.0;
        particle.clearance_m = 10.0;
        // The particle stays nearly in place and the structure vibrates, so the offset has a smooth maximum.
        let initial =
            Initial { x_m: draw.between(5e-3, 30e-3), v_m_per_s: draw.between(-0.2, 0.2), ..Initial::default() };
        let natural = (set_up.structure.stiffness_n_per_m / set_up.structure.mass_kg).sqrt();
        let end_s = 5.0 / natural;
        let reach = |set_up: &SetUp| {
            let mut motion = Exact::new(set_up, &Excitation::Fixed, &initial).expect("drawn within the ranges");
            let mut reach = Reach(0.0);
            // Small steps: a sampled peak is below the true one by at most the curvature times the squared step.
            for n in 1..=4000 {
                motion.run(end_s * f64::from(n) / 4000.0, &mut reach);
            }
            reach.0
        };
        let largest = reach(&set_up);
        if largest <= initial.x_m.abs() * 1.02 {
            continue;
        }
        let impacts = |share: f64| {
            let mut set_up = set_up;
            set_up.particle.as_mut().expect("a particle was drawn").clearance_m = largest * (1.0 - share);
            let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("drawn within the ranges");
            let mut count = Count(0);
            motion.run(end_s, &mut count);
            count.0
        };
        // 64 samples in each of 4 000 steps miss the maximum by less than (5/256000)²/8 = 5e-11 of the amplitude.
        for share in [1e-3, 1e-5, 1e-7, 1e-9, 2e-10] {
            assert!(impacts(share) > 0, "a contact {share:e} deep was missed");
            assert_eq!(impacts(-share), 0, "a miss by {share:e} counted as a contact");
        }
    }
}
