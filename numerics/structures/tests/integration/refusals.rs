//! What is no structure, no set-up or no start is refused by name.

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Cavity, FrictionDamper, Particle, Structure, Wall};
use damprig_structures::{
    Beam, Damping, FrictionJoint, HarmonicForce, ImpactDamper, Modes, Motion, Refused, SetUp, Storey, Support,
    base_at_start,
};

const SINE: Excitation = Excitation::Sine { amplitude_m: 1e-3, angular_frequency_rad_per_s: 10.0, phase_rad: 0.0 };
const FORCE: Excitation = Excitation::ForceSine { amplitude_n: 1.0, angular_frequency_rad_per_s: 10.0, phase_rad: 0.0 };

#[test]
fn matrices_of_no_structure_are_refused() {
    let ratio = Damping::Ratio(0.01);
    let refused =
        |mass: &[f64], stiffness: &[f64]| Modes::from_matrices(mass, stiffness, &ratio, &[1.0, 1.0]).unwrap_err();
    assert!(matches!(refused(&[1.0, 0.0, 0.0], &[1.0, 0.0, 0.0, 1.0]), Refused::Count { found: 3, expected: 4, .. }));
    assert!(matches!(refused(&[1.0, 0.2, 0.0, 1.0], &[1.0, 0.0, 0.0, 1.0]), Refused::NotSymmetric { row: 2, .. }));
    assert!(matches!(refused(&[1.0, 0.0, 0.0, 0.0], &[1.0, 0.0, 0.0, 1.0]), Refused::NotDefinite(_)));
    assert!(matches!(refused(&[1.0, 0.0, 0.0, 1.0], &[1.0, -1.0, -1.0, 1.0]), Refused::Unsupported));
    let negative = Damping::Matrix(vec![1.0, 0.0, 0.0, -1.0]);
    let refused =
        Modes::from_matrices(&[1.0, 0.0, 0.0, 1.0], &[1.0, 0.0, 0.0, 2.0], &negative, &[1.0, 1.0]).unwrap_err();
    assert_eq!(refused, Refused::NegativeDamping);
}

#[test]
fn storeys_and_beams_out_of_range_are_refused() {
    assert!(matches!(Modes::storeys(&[]), Err(Refused::Count { expected: 1, .. })));
    let storey = Storey { mass_kg: 0.0, stiffness_n_per_m: 1.0, damping_n_s_per_m: 0.0 };
    assert!(Modes::storeys(&[storey]).unwrap_err().to_string().starts_with("structure.storeys.mass_kg = 0"));
    let beam = Beam {
        support: Support::SimplySupported,
        bending_stiffness_n_m2: 1.0,
        mass_per_length_kg_per_m: 1.0,
        length_m: 1.0,
        tip_mass_kg: 0.0,
        modes: 3,
        damping_ratio: 0.01,
        places_m: vec![0.5],
    };
    assert!(Modes::beam(&beam).is_ok());
    for (wrong, key) in [
        (Beam { modes: 10_000, ..beam.clone() }, "structure.beam.modes"),
        (Beam { tip_mass_kg: 1.0, ..beam.clone() }, "structure.beam.tip_mass_kg"),
        (Beam { places_m: vec![1.5], ..beam.clone() }, "structure.beam.places_m"),
    ] {
        assert!(Modes::beam(&wrong).unwrap_err().to_string().starts_with(key), "{key}");
    }
}

fn set_up() -> SetUp {
    SetUp::bare(Structure::from_modal(1.6, 2.5, 0.01))
}

fn with_wall(wall: Wall) -> SetUp {
    let cavity = Cavity::default();
    let particle = Particle { mass_kg: 0.1, clearance_m: 0.01, friction_coefficient: 0.0, wall, cavity };
    SetUp { impact_dampers: vec![ImpactDamper::new(0, particle)], ..set_up() }
}

fn refused(set_up: &SetUp, excitation: &Excitation) -> Refused {
    Motion::new(set_up, excitation, &set_up.at_rest(base_at_start(excitation))).unwrap_err()
}

#[test]
fn dampers_and_forces_at_no_place_are_refused() {
    let joint = |place, other| {
        let joint = FrictionJoint { place, other, damper: FrictionDamper { force_n: 1.0 } };
        refused(&SetUp { friction_dampers: vec![joint], ..set_up() }, &SINE)
    };
    assert!(matches!(joint(3, None), Refused::Place { place: 3, places: 1, .. }));
    assert_eq!(joint(0, Some(0)), Refused::SamePlace(0));
    assert_eq!(refused(&set_up(), &FORCE), Refused::NoDrivenPlace);
    assert_eq!(refused(&SetUp { driven_place: Some(0), ..set_up() }, &SINE), Refused::BaseMoves);
    assert!(matches!(refused(&SetUp { driven_place: Some(7), ..set_up() }, &FORCE), Refused::Place { place: 7, .. }));
    let force = HarmonicForce { place: 0, amplitude_n: 1.0, phase_rad: 0.0 };
    let beside = |force| SetUp { force_beside_base: Some(force), ..set_up() };
    for excitation in [&FORCE, &Excitation::Fixed] {
        let driven_place = (*excitation == FORCE).then_some(0);
        assert_eq!(refused(&SetUp { driven_place, ..beside(force) }, excitation), Refused::NoSineBeside);
    }
    assert!(matches!(refused(&beside(HarmonicForce { place: 7, ..force }), &SINE), Refused::Place { place: 7, .. }));
}

#[test]
fn a_start_outside_the_cavity_or_of_a_wrong_size_is_refused() {
    let set_up = with_wall(Wall::Restitution { coefficient: 0.5 });
    let mut start = set_up.at_rest(base_at_start(&SINE));
    start.particles[0].y_m = 0.02;
    let outside = Motion::new(&set_up, &SINE, &start).unwrap_err();
    assert_eq!(outside, Refused::Outside { damper: 0, offset_m: 0.02, from_m: -0.01, to_m: 0.01 });
    start.particles[0].y_m = f64::NAN;
    assert!(Motion::new(&set_up, &SINE, &start).unwrap_err().to_string().starts_with("initial.y_m"));
    start.particles.clear();
    assert!(matches!(Motion::new(&set_up, &SINE, &start), Err(Refused::Count { found: 0, expected: 1, .. })));
}

#[test]
fn motions_without_a_closed_form_are_refused() {
    let undamped = SetUp::bare(Structure { mass_kg: 1.0, stiffness_n_per_m: 100.0, damping_n_s_per_m: 0.0 });
    assert_eq!(refused(&undamped, &SINE), Refused::Resonance);
    let critical = SetUp::bare(Structure { mass_kg: 1.0, stiffness_n_per_m: 100.0, damping_n_s_per_m: 20.0 });
    assert_eq!(refused(&critical, &SINE), Refused::Critical);
    let mut coupled = SetUp::bare(
        Modes::storeys(&[Storey { mass_kg: 1.0, stiffness_n_per_m: 100.0, damping_n_s_per_m: 0.1 }; 2]).unwrap(),
    );
    coupled.structure.coupling_per_s = vec![0.0, 0.5, 0.4, 0.0];
    assert!(matches!(refused(&coupled, &SINE), Refused::NotSymmetric { .. }));
    coupled.structure.coupling_per_s = vec![0.0, 5.0, 5.0, 0.0];
    assert_eq!(refused(&coupled, &SINE), Refused::NegativeDamping);
}
