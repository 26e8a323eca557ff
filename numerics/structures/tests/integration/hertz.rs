//! Contacts with Hertz walls.

use damprig_core::integrator::exact::{
    ContactEnd, Exact, Excitation, HertzContact as OneContact, Observer as OneObserver,
};
use damprig_core::model::{
    Cavity, Dissipation, FrictionDamper, Hertz, Initial, Particle, SetUp as One, Structure, Wall,
};
use damprig_structures::{HertzContact, ImpactDamper, Mode, Modes, Motion, Observer, Piece, SetUp, State};

use crate::one_mode::set_up;

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
}

impl Observer for Contacts {
    const PIECES: bool = true;

    fn piece(&mut self, piece: &Piece) {
        self.pieces += u32::from((0..piece.particle_count()).any(|damper| piece.pressed_side(damper).is_some()));
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
