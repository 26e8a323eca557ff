//! The energy book of a motion balances, and is that of one degree of freedom where a structure has one mode.

use std::f64::consts::TAU;

use damprig_core::analysis::energy::{Balance, EnergyMeter};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::{
    Cavity, Dissipation, FrictionDamper, Hertz, Particle, Release, SetUp as One, Structure, Tmd, Wall,
};
use damprig_structures::{
    EnergyBook, FrictionJoint, ImpactDamper, Modes, Motion, SetUp, State, Storey, TunedMass, base_at_start,
};

use crate::one_mode::set_up;

fn particle(wall: Wall) -> Particle {
    let cavity = Cavity { positive_wall: None, offset_m: 0.001, inclination_deg: 10.0 };
    Particle { mass_kg: 0.16, clearance_m: 0.006, friction_coefficient: 0.04, wall, cavity }
}

fn terms(of: &Balance) -> [f64; 7] {
    [
        of.input_j,
        of.stored_change_j,
        of.structure_damping_j,
        of.impacts_j,
        of.internal_friction_j,
        of.friction_damper_j,
        of.link_damping_j,
    ]
}

/// Every term, of every damper, under a sine of the base and of a force, and a pulse whose end jumps.
#[test]
fn of_one_mode_every_term_is_that_of_one_degree_of_freedom() {
    let structure = Structure::from_modal(1.6, 2.5, 0.01);
    let bare = One::bare(structure);
    let hard = Wall::Restitution { coefficient: 0.5 };
    let soft = Wall::Voigt { stiffness_n_per_m: 4_000.0, damping_n_s_per_m: 4.0, release: Release::ZeroForce };
    let dissipation = Dissipation::HuntCrossley { coefficient_s_per_m: 0.3 };
    let hertz = Wall::Hertz(Hertz { stiffness_n_per_m15: 1e8, dissipation });
    let friction_damper = Some(FrictionDamper { force_n: 0.3 });
    let set_ups = [
        ("hard walls", One { particle: Some(particle(hard)), ..bare }),
        ("soft walls", One { particle: Some(particle(soft)), ..bare }),
        ("Hertz walls", One { particle: Some(particle(hertz)), friction_damper, ..bare }),
        ("hybrid", One { particle: Some(particle(hard)), friction_damper, ..bare }),
        (
            "tuned mass",
            One { tmd: Some(Tmd { mass_kg: 0.1, stiffness_n_per_m: 24.0, damping_n_s_per_m: 0.2 }), ..bare },
        ),
    ];
    let omega = TAU * 2.4;
    let excitations = [
        Excitation::Sine { amplitude_m: 0.002, angular_frequency_rad_per_s: omega, phase_rad: 0.4 },
        Excitation::ForceSine { amplitude_n: 0.8, angular_frequency_rad_per_s: omega, phase_rad: 0.4 },
        Excitation::HalfSine { amplitude_m: 0.01, duration_s: 0.3 },
    ];
    for (name, one) in set_ups {
        for excitation in excitations {
            let initial = one.neutral();
            let mut exact = Exact::new(&one, &excitation, &initial).unwrap();
            let mut meter = EnergyMeter::new(&one);
            exact.run(3.0, &mut meter);
            let start = State::of_one_degree(&one, &initial, &excitation);
            let mut motion = Motion::new(&set_up(&one, &excitation), &excitation, &start).unwrap();
            let mut book = EnergyBook::new(&motion).unwrap();
            motion.run(3.0, &mut book).unwrap();
            let (own, other) = (book.balance(&motion), meter.balance());
            let size = other.input_j.abs().max(other.dissipated_j());
            assert!(size > 1e-5, "{name}: something moves");
            assert!(own.residual_j.abs() < 1e-11 * size, "{name} {excitation:?}: {own:?}");
            for (term, (a, b)) in terms(&own).into_iter().zip(terms(&other)).enumerate() {
                assert!((a - b).abs() < 1e-7 * size, "{name} {excitation:?}, term {term}: {own:?} {other:?}");
            }
        }
    }
}

/// A frame with dampers of every kind, two particles that meet walls together among them, on a sine and on cubics.
#[test]
fn the_book_of_a_frame_balances() {
    let storey = |mass_kg, stiffness_n_per_m| Storey { mass_kg, stiffness_n_per_m, damping_n_s_per_m: 0.4 };
    let frame = Modes::storeys(&[storey(1.3, 900.0), storey(1.0, 1_200.0), storey(0.7, 700.0)]).unwrap();
    assert!(!frame.coupling_per_s.is_empty(), "its damping is not modal");
    let hard = |place| ImpactDamper::new(place, particle(Wall::Restitution { coefficient: 0.6 }));
    let soft = Wall::Voigt { stiffness_n_per_m: 3_000.0, damping_n_s_per_m: 2.0, release: Release::ZeroPenetration };
    let joint = |place, other| FrictionJoint { place, other, damper: FrictionDamper { force_n: 0.2 } };
    let set_up = SetUp {
        impact_dampers: vec![hard(2), hard(2), ImpactDamper::new(0, particle(soft))],
        friction_dampers: vec![joint(0, None), joint(2, Some(1))],
        tuned_masses: vec![TunedMass {
            place: 1,
            tmd: Tmd { mass_kg: 0.05, stiffness_n_per_m: 20.0, damping_n_s_per_m: 0.1 },
        }],
        ..SetUp::bare(frame)
    };
    let excitation = Excitation::Sine { amplitude_m: 0.004, angular_frequency_rad_per_s: 13.0, phase_rad: 0.0 };
    let base = base_at_start(&excitation);
    let mut motion = Motion::new(&set_up, &excitation, &set_up.at_rest(base)).unwrap();
    let mut book = EnergyBook::new(&motion).unwrap();
    motion.run(10.0, &mut book).unwrap();
    let on_sine = book.balance(&motion);
    assert!(on_sine.residual_j.abs() < 1e-11 * on_sine.dissipated_j(), "{on_sine:?}");
    assert!(terms(&on_sine).iter().skip(2).all(|lost| *lost > 1e-4), "every mechanism takes part: {on_sine:?}");
    // The same base as cubics, each of which goes on where the one before ends.
    let step_s = 0.01;
    let cubic = |n: u32| {
        let at = |t: f64| (0.004 * (13.0 * t).sin(), 0.004 * 13.0 * (13.0 * t).cos());
        let ((z, rate), (end, end_rate)) = (at(f64::from(n) * step_s), at(f64::from(n + 1) * step_s));
        let rise = (end - z) / step_s;
        [z, rate, (3.0 * rise - 2.0 * rate - end_rate) / step_s, (rate + end_rate - 2.0 * rise) / (step_s * step_s)]
    };
    let mut motion = Motion::on_base(&set_up, cubic(0), &set_up.at_rest(base)).unwrap();
    let mut book = EnergyBook::new(&motion).unwrap();
    for n in 0..100 {
        motion.follow(cubic(n)).unwrap();
        motion.run(f64::from(n + 1) * step_s, &mut book).unwrap();
    }
    let on_cubics = book.balance(&motion);
    assert!(on_cubics.residual_j.abs() < 1e-11 * on_cubics.dissipated_j(), "{on_cubics:?}");
}

/// A place that the base moves otherwise than itself has no book while a joint holds it to the base.
#[test]
fn a_joint_to_a_base_that_moves_its_place_otherwise_has_no_book() {
    let mut structure = Modes::from(Structure::from_modal(1.6, 2.5, 0.01));
    structure.influence[0] = 0.5;
    let joint = FrictionJoint { place: 0, other: None, damper: FrictionDamper { force_n: 0.2 } };
    let set_up = SetUp { friction_dampers: vec![joint], ..SetUp::bare(structure) };
    let motion = Motion::on_base(&set_up, [0.0; 4], &set_up.at_rest((0.0, 0.0))).unwrap();
    assert!(EnergyBook::new(&motion).is_none());
}
