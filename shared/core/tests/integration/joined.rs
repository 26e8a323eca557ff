//! Soft walls and tuned masses with the sampled driver, compared with the exact driver.

use damprig_core::integrator::base::BaseSegment;
use damprig_core::integrator::exact::{ContactEnd, Exact, Excitation, Impact, Observer};
use damprig_core::integrator::modes::Sign;
use damprig_core::integrator::sampled::{self, Joined, Sampled};
use damprig_core::integrator::units::Units;
use damprig_core::model::{
    Cavity, DampingLaw, FrictionDamper, Initial, Material, Particle, Release, SetUp, Structure, Tmd, Tuning, Wall,
};

const STEP_S: f64 = 2.5e-4;
const DRIVE: Excitation = Excitation::Sine { amplitude_m: 0.003, angular_frequency_rad_per_s: 14.0, phase_rad: 0.0 };

/// Times of contacts and releases, s.
#[derive(Default)]
struct Contacts {
    step: f64,
    touches_s: Vec<f64>,
    releases_s: Vec<f64>,
}

impl Observer for Contacts {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        self.touches_s.push(impact.time_s);
    }

    fn contact_end(&mut self, end: &ContactEnd) {
        self.releases_s.push(end.time_s);
    }
}

impl sampled::SampledObserver<f64> for Contacts {
    fn impact(&mut self, impact: &sampled::SampledImpact<f64>) {
        self.touches_s.push((self.step + impact.at) * STEP_S);
    }

    fn contact_end(&mut self, at: f64, _: Sign, _: f64) {
        self.releases_s.push((self.step + at) * STEP_S);
    }
}

fn structure() -> Structure {
    Structure::from_modal(1.6, 2.5, 0.0038)
}

fn soft(material: Material, release: Release, friction_coefficient: f64, force_n: f64) -> SetUp {
    let wall = Wall::of_material(material, DampingLaw::Contact, &structure(), 0.16, release);
    SetUp {
        particle: Some(Particle {
            mass_kg: 0.16,
            clearance_m: 0.02,
            friction_coefficient,
            wall,
            cavity: Cavity::default(),
        }),
        friction_damper: (force_n > 0.0).then_some(FrictionDamper { force_n }),
        ..SetUp::bare(structure())
    }
}

fn tuned(force_n: f64) -> SetUp {
    SetUp {
        tmd: Some(Tmd::tuned(&structure(), 0.16, Tuning::Warburton)),
        friction_damper: (force_n > 0.0).then_some(FrictionDamper { force_n }),
        ..SetUp::bare(structure())
    }
}

/// Value of a sine after a number of steps, and its change in a step at that rate.
fn sine(amplitude: f64, angle_per_step: f64, step: u32) -> (f64, f64) {
    let angle = angle_per_step * f64::from(step);
    (amplitude * libm::sin(angle), amplitude * angle_per_step * libm::cos(angle))
}

/// Largest difference of x and y over `steps`, relative to the largest |x|, and the contacts of both drivers.
fn compare(set_up: &SetUp, excitation: Excitation, initial: Initial, steps: u32) -> (f64, Contacts, Contacts) {
    let mut exact = Exact::new(set_up, &excitation, &initial).unwrap();
    let driven = SetUp { is_force_driven: !excitation.moves_base(), ..*set_up };
    let mut sampled = Joined::<f64>::joined(&driven, Units::metres(STEP_S), &initial).unwrap();
    let (mut of_exact, mut of_sampled) = (Contacts::default(), Contacts::default());
    let at = |step: u32| match excitation {
        Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, .. } => {
            sine(amplitude_m, angular_frequency_rad_per_s * STEP_S, step)
        }
        Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, .. } => {
            sine(amplitude_n / set_up.structure.stiffness_n_per_m, angular_frequency_rad_per_s * STEP_S, step)
        }
        _ => (0.0, 0.0),
    };
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for step in 0..steps {
        let (start, end) = (at(step), at(step + 1));
        of_sampled.step = f64::from(step);
        sampled.step(&BaseSegment::hermite(start.0, end.0, start.1, end.1), &mut of_sampled);
        exact.run(STEP_S * f64::from(step + 1), &mut of_exact);
        let (a, b) = (exact.state(), sampled.state());
        worst = worst.max((a.x_m - b.x).abs()).max((a.offset_m - b.offset).abs());
        largest = largest.max(a.x_m.abs());
    }
    assert_eq!(sampled.unresolved(), 0);
    (worst / largest, of_exact, of_sampled)
}

/// Interpolation of the drive between samples has an error of (Ωh)⁴/384 = 4·10⁻¹³ of Z, a flight one of 2·10⁻¹¹; each
/// contact multiplies an error.
const ALLOWED: f64 = 1e-7;

#[test]
fn both_release_rules_agree_with_the_exact_driver_for_every_material() {
    let start = Initial { x_m: 0.035, y_m: 0.035, ..Initial::default() };
    for material in Material::ALL {
        for release in [Release::ZeroPenetration, Release::ZeroForce] {
            for (excitation, initial) in [(Excitation::Fixed, start), (DRIVE, Initial::default())] {
                let (error, exact, sampled) = compare(&soft(material, release, 0.0, 0.0), excitation, initial, 16_000);
                println!("{material:?}, {release:?}: {error:.1e}, {} contacts", exact.touches_s.len());
                assert!(exact.touches_s.len() >= 3, "{material:?} touches {} times", exact.touches_s.len());
                assert_eq!(exact.touches_s.len(), sampled.touches_s.len(), "{material:?} {release:?}");
                assert_eq!(exact.releases_s.len(), sampled.releases_s.len(), "{material:?} {release:?}");
                let pairs = exact.releases_s.iter().zip(&sampled.releases_s);
                for (a, b) in exact.touches_s.iter().zip(&sampled.touches_s).chain(pairs) {
                    assert!((a - b).abs() < 1e-6, "{material:?} {release:?}: {a} {b}");
                }
                assert!(error < ALLOWED, "{material:?} {release:?}: {error:e}");
            }
        }
    }
}

#[test]
fn friction_inside_a_soft_wall_and_a_friction_damper_agree_with_the_exact_driver() {
    let start = Initial { x_m: 0.035, y_m: 0.03, ..Initial::default() };
    for (friction, force_n) in [(0.05, 0.0), (0.0, 0.3), (0.05, 0.3), (0.3, 0.8)] {
        for (excitation, initial) in [(Excitation::Fixed, start), (DRIVE, start)] {
            let set_up = soft(Material::PuFoam, Release::ZeroForce, friction, force_n);
            let (error, exact, sampled) = compare(&set_up, excitation, initial, 16_000);
            println!("μi = {friction}, F = {force_n} N: {error:.1e}, {} contacts", exact.touches_s.len());
            let contacts = exact.touches_s.len() + usize::from(friction > 0.1);
            assert!(contacts > 0, "only the friction of 0.3 may keep the particle from the walls");
            assert_eq!(exact.touches_s.len(), sampled.touches_s.len(), "μi = {friction}, F = {force_n}");
            assert!(error < ALLOWED, "μi = {friction}, F = {force_n}: {error:e}");
        }
    }
}

#[test]
fn a_tuned_mass_agrees_with_the_exact_driver_even_on_a_sticking_structure() {
    let start = Initial { x_m: 0.035, y_m: 0.01, u_m_per_s: 0.2, ..Initial::default() };
    for force_n in [0.0, 0.5, 2.0] {
        for (excitation, initial) in [(Excitation::Fixed, start), (DRIVE, start)] {
            let (error, ..) = compare(&tuned(force_n), excitation, initial, 16_000);
            println!("F = {force_n} N: {error:.1e}");
            assert!(error < ALLOWED, "F = {force_n}: {error:e}");
        }
    }
}

#[test]
fn a_joint_too_stiff_for_the_step_is_refused_by_name() {
    let mut set_up = soft(Material::PuFoam, Release::ZeroForce, 0.0, 0.0);
    let mut refused = |stiffness_n_per_m, damping_n_s_per_m| {
        let wall = Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release: Release::ZeroForce };
        set_up.particle.as_mut().unwrap().wall = wall;
        Joined::<f32>::joined(&set_up, Units::metres(1e-3), &Initial::default()).err().map(|error| error.parameter)
    };
    assert_eq!(refused(1e9, 0.0), None);
    assert_eq!(refused(1e12, 0.0), Some("particle.wall.stiffness_n_per_m"));
    assert_eq!(refused(1e3, 1e6), Some("particle.wall.damping_n_s_per_m"));
}

#[test]
fn a_set_up_without_a_joint_moves_as_without_the_code_of_joints() {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 4e-3,
        friction_coefficient: 0.08,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity::default(),
    };
    let set_up = SetUp {
        particle: Some(particle),
        friction_damper: Some(FrictionDamper { force_n: 0.3 }),
        ..SetUp::bare(structure())
    };
    let start = Initial { x_m: 0.035, y_m: 0.035, ..Initial::default() };
    let mut joined = Joined::<f32>::joined(&set_up, Units::metres(1e-3), &start).unwrap();
    let mut rigid = Sampled::<f32>::new(&set_up, Units::metres(1e-3), &start).unwrap();
    for _ in 0..5_000 {
        joined.step(&BaseSegment::at_rest(0.0), &mut ());
        rigid.step(&BaseSegment::at_rest(0.0), &mut ());
        assert_eq!(joined.state(), rigid.state());
    }
}

#[test]
fn single_precision_follows_a_soft_contact() {
    let set_up = soft(Material::PuFoam, Release::ZeroForce, 0.0, 0.0);
    let start = Initial { x_m: 0.035, y_m: 0.035, ..Initial::default() };
    let units = Units::metres(1e-3);
    let mut double = Joined::<f64>::joined(&set_up, units, &start).unwrap();
    let mut single = Joined::<f32>::joined(&set_up, units, &start).unwrap();
    let mut worst = 0.0_f64;
    for _ in 0..2_000 {
        double.step(&BaseSegment::at_rest(0.0), &mut ());
        single.step(&BaseSegment::at_rest(0.0), &mut ());
        worst = worst.max((double.state().x - f64::from(single.state().x)).abs());
    }
    println!("single precision is off by {:.1e} of x0 over 2 s", worst / 0.035);
    assert!(worst / 0.035 < 1e-3);
}

#[test]
fn a_force_drive_agrees_with_the_exact_driver_for_every_damper() {
    // P/k = 3 mm, as the base's amplitude above.
    let force = Excitation::ForceSine {
        amplitude_n: 0.003 * structure().stiffness_n_per_m,
        angular_frequency_rad_per_s: 14.0,
        phase_rad: 0.0,
    };
    let hard = |friction_coefficient: f64, force_n: f64| SetUp {
        particle: Some(Particle {
            mass_kg: 0.16,
            clearance_m: 0.02,
            friction_coefficient,
            wall: Wall::Restitution { coefficient: 0.5 },
            cavity: Cavity::default(),
        }),
        friction_damper: (force_n > 0.0).then_some(FrictionDamper { force_n }),
        ..SetUp::bare(structure())
    };
    let friction_alone = |force_n| SetUp { particle: None, ..hard(0.0, force_n) };
    let damped = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.1));
    // Friction of 0.3 N slips, 1.3 N also sticks for a part of each cycle, 1.5 N never lets go.
    let set_ups = [
        ("bare", SetUp::bare(structure())),
        ("strong damping", damped),
        ("impact damper", hard(0.0, 0.0)),
        ("impact damper with friction", hard(0.05, 0.0)),
        ("friction damper", friction_alone(0.3)),
        ("friction damper that sticks", friction_alone(1.15)),
        ("friction damper that holds", friction_alone(1.5)),
        ("hybrid", hard(0.05, 0.3)),
        ("soft walls", soft(Material::PuFoam, Release::ZeroForce, 0.05, 0.0)),
        ("tuned mass", tuned(0.0)),
        ("tuned mass and friction", tuned(0.3)),
    ];
    for (name, set_up) in set_ups {
        let (error, exact, sampled) = compare(&set_up, force, Initial::default(), 16_000);
        println!("{name}: {error:.1e}, {} contacts", exact.touches_s.len());
        assert_eq!(exact.touches_s.len(), sampled.touches_s.len(), "{name}");
        assert!(error < ALLOWED || error.is_nan(), "{name}: {error:e}");
        assert_eq!(error.is_nan(), name == "friction damper that holds", "{name}: 0/0 only where nothing moves");
    }
}

#[test]
fn a_force_drive_on_a_strongly_damped_structure_differs_from_a_base_by_the_dashpot() {
    // Closed forms at f = fn: |X| = (P/k)/(2ζ) for the force, Z·√(1 + 4ζ²)/(2ζ) for the base.
    let zeta = 0.1;
    let structure = Structure::from_modal(1.6, 2.5, zeta);
    let omega = structure.angular_frequency_rad_per_s();
    let largest = |is_force_driven: bool| {
        let set_up = SetUp { is_force_driven, ..SetUp::bare(structure) };
        let mut motion = Joined::<f64>::joined(&set_up, Units::metres(STEP_S), &Initial::default()).unwrap();
        let mut largest = 0.0_f64;
        for step in 0..60_000 {
            let (a, b) = (sine(1e-3, omega * STEP_S, step), sine(1e-3, omega * STEP_S, step + 1));
            motion.step(&BaseSegment::hermite(a.0, b.0, a.1, b.1), &mut Contacts::default());
            // The start has decayed by e^(−ζωt) = e^(−17) after 11 s.
            if step > 44_000 {
                largest = largest.max(motion.state().x.abs());
            }
        }
        largest
    };
    // The largest sample lies within 1 − cos(Ωh/2) = 2e-6 of the peak.
    let (force, base) = (1e-3 / (2.0 * zeta), 1e-3 * (1.0 + 4.0 * zeta * zeta).sqrt() / (2.0 * zeta));
    assert!((largest(true) / force - 1.0).abs() < 3e-6, "{}", largest(true) / force);
    assert!((largest(false) / base - 1.0).abs() < 3e-6, "{}", largest(false) / base);
}
