//! The exact driver compared with published formulas, each evaluated for random parameters.

use core::f64::consts::{PI, TAU};

use damprig_core::analysis::section::{Section, period};
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Accumulation, ContactEnd, Exact, Excitation, Impact, Observer};
use damprig_core::model::{Cavity, FrictionDamper, Initial, Particle, Release, SetUp, Structure, Tmd, Wall};
use rand_core::{RngCore, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

fn draws(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    move |low, high| low + (high - low) * (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

fn impact_damper(zeta: f64, mass_ratio: f64, clearance_m: f64, coefficient: f64) -> SetUp {
    let particle = Particle {
        mass_kg: mass_ratio,
        clearance_m,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.0, 2.5, zeta)) }
}

#[derive(Default)]
struct Impacts {
    seen: [Option<Impact>; 8],
    count: usize,
}

impl Observer for Impacts {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        if let Some(slot) = self.seen.get_mut(self.count) {
            *slot = Some(*impact);
        }
        self.count += 1;
    }
}

/// Masri and Caughey (1966); Bapat and Sankar (1985).
#[test]
fn a_run_started_on_the_two_impact_orbit_stays_on_it() {
    let mut draw = draws(11);
    let natural = TAU * 2.5;
    let mut tested = 0;
    for _ in 0..400 {
        let (zeta, mass_ratio) = (draw(0.0, 0.05), draw(0.02, 0.3));
        let (e, d, turning) = (draw(0.1, 0.9), draw(2.0, 20.0), natural * draw(0.7, 1.4));
        let set_up = impact_damper(zeta, mass_ratio, d, e);
        for orbit in SymmetricOrbit::both(&set_up, 1.0, turning).into_iter().flatten().flatten() {
            let phase_rad = orbit.drive_phase_rad;
            let sine = Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad };
            let mut motion = Exact::new(&set_up, &sine, &orbit.initial()).expect("physical");
            let mut impacts = Impacts::default();
            let half = PI / turning;
            motion.run(half * 1.001, &mut impacts);
            let first = impacts.seen[0].expect("the particle crosses the cavity");
            if first.time_s < 0.99 * half || impacts.count != 1 {
                // A further impact occurs in between, which the formula excludes.
                continue;
            }
            // Rounding of the phase and of the largest displacement, propagated over half a period.
            let size = orbit.approach_speed_m_per_s;
            assert!((first.time_s - half).abs() < 1e-13 * (1.0 + d), "{:e}", first.time_s - half);
            assert_eq!(first.side, -1);
            assert!(
                (first.approach_speed_m_per_s - size).abs() < 1e-11 * size,
                "{:e}",
                first.approach_speed_m_per_s - size
            );
            assert!(
                (first.before.x_m + orbit.impact_displacement_m).abs()
                    < 1e-11 * (d + orbit.impact_displacement_m.abs())
            );
            tested += 1;
        }
    }
    assert!(tested > 100, "only {tested} orbits were tested");
}

#[test]
fn a_run_from_rest_ends_on_the_stable_orbit() {
    for (ratio, e, d) in [(1.0, 0.3, 10.0), (1.0, 0.5, 10.0), (1.1, 0.5, 5.0)] {
        let set_up = impact_damper(0.0038, 0.1, d, e);
        let turning = TAU * 2.5 * ratio;
        let orbit = SymmetricOrbit::new(&set_up, 1.0, turning).expect("it exists");
        let sine = Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
        let motion = Exact::new(&set_up, &sine, &Initial::default()).expect("physical");
        let mut section = Section::new(motion, TAU / turning);
        section.skip(1500);
        let mut impacts = Impacts::default();
        let mut states = [Default::default(); 4];
        states.fill_with(|| section.next(&mut impacts));
        assert_eq!(period(&states, 1e-9), Some(1));
        assert_eq!(impacts.count, 8);
        let speed = impacts.seen[7].expect("eight were counted").approach_speed_m_per_s;
        assert!((speed / orbit.approach_speed_m_per_s - 1.0).abs() < 1e-10, "{ratio} {e} {d}: {speed}");
    }
}

/// Limit of a light damper: K = 2(1−e)/(π(1+e)), (A/d)min = K/√(1+K²).
#[test]
fn a_light_particle_impacts_above_the_minimum_amplitude_of_the_closed_form() {
    let mut draw = draws(12);
    for _ in 0..50 {
        let (e, turning) = (draw(0.1, 0.95), TAU * 2.5 * draw(0.3, 0.8));
        let ratio = turning / (TAU * 2.5);
        let amplitude = 1.0 / (1.0 - ratio * ratio);
        let k = 2.0 * (1.0 - e) / (PI * (1.0 + e));
        let threshold = k / (1.0 + k * k).sqrt();
        let exists = |share: f64| {
            let set_up = impact_damper(0.0, 1e-9, amplitude / share, e);
            SymmetricOrbit::new(&set_up, 1.0, turning).is_some()
        };
        // The mass ratio changes the threshold by its own size.
        assert!(exists(threshold * (1.0 + 1e-6)) && !exists(threshold * (1.0 - 1e-6)), "e {e}");
    }
}

/// Den Hartog (1931): forced vibration with Coulomb friction, without stops.
#[test]
fn coulomb_friction_without_stops_has_den_hartogs_amplitude() {
    let mut draw = draws(13);
    let mut tested = 0;
    for _ in 0..200 {
        let (b, share) = (draw(0.6, 1.8), draw(0.1, 0.6));
        let v = 1.0 / (1.0 - b * b);
        let u = (PI / b).sin() / (b * (1.0 + (PI / b).cos()));
        let s = (1..2000)
            .map(|n| {
                let wt = PI * f64::from(n) / 2000.0;
                ((wt / b).sin() + u * b * ((wt / b).cos() - wt.cos())) / (b * wt.sin())
            })
            .fold(f64::NEG_INFINITY, f64::max);
        if share >= 0.95 * (v * v / (u * u + s * s)).sqrt() || (b - 1.0).abs() < 0.05 {
            continue;
        }
        let x0 = (v * v - share * share * u * u).sqrt();
        // k = 1, so that P₀/k is 1 m and the friction `share` N.
        let (mass, stiffness) = (1.0 / (TAU * 2.5).powi(2), 1.0);
        let structure = Structure { mass_kg: mass, stiffness_n_per_m: stiffness, damping_n_s_per_m: 0.0 };
        let set_up = SetUp { friction_damper: Some(FrictionDamper { force_n: share }), ..SetUp::bare(structure) };
        let turning = b * TAU * 2.5;
        let force = Excitation::ForceSine { amplitude_n: 1.0, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
        let mut motion = Exact::new(&set_up, &force, &Initial::default()).expect("physical");
        let cycle_s = TAU / turning;
        let mut amplitude = |cycles: f64| {
            let from = (motion.time_s() / cycle_s).round();
            let wanted = Wanted { cycle_s: None, steady_from_cycle: None, whole_run: false };
            motion.run((from + cycles) * cycle_s, &mut ());
            let mut response = Response::new(wanted);
            motion.run((from + cycles + 1.0) * cycle_s, &mut response);
            response.max_abs_x_m()
        };
        // Run until a hundred cycles change nothing: friction ends the transient in finite time where it can.
        let (mut last, mut now) = (0.0, amplitude(100.0));
        for _ in 0..60 {
            if f64::abs(now - last) < 1e-12 {
                break;
            }
            (last, now) = (now, amplitude(100.0));
        }
        if f64::abs(now - last) >= 1e-12 {
            continue;
        }
        assert!((now / x0 - 1.0).abs() < 1e-9, "b {b}, share {share}: {now} {x0}");
        tested += 1;
    }
    assert!(tested > 20, "only {tested} were tested");
}

/// The amplitude falls by 2 F/k per half cycle. The structure stops where the spring force is below the friction.
#[test]
fn free_coulomb_decay_is_a_straight_line() {
    let mut draw = draws(14);
    for _ in 0..50 {
        let (force_n, start) = (draw(0.1, 1.0), draw(3.0, 12.0));
        let structure = Structure { mass_kg: 1.0, stiffness_n_per_m: 1.0, damping_n_s_per_m: 0.0 };
        let set_up = SetUp { friction_damper: Some(FrictionDamper { force_n }), ..SetUp::bare(structure) };
        let initial = Initial { x_m: start, ..Initial::default() };
        let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
        let mut expected = start;
        for half in 1..200 {
            if expected.abs() > force_n {
                expected = -(expected.abs() - 2.0 * force_n) * expected.signum();
            }
            motion.run(PI * f64::from(half), &mut ());
            assert!((motion.state().x_m - expected).abs() < 1e-13 * start * f64::from(half), "half cycle {half}");
        }
    }
}

/// A particle above a floor with constant acceleration is a bouncing ball: t∞ = √(2h/a) (1+e)/(1−e).
#[test]
fn accumulating_impacts_end_at_the_time_of_the_bouncing_ball() {
    struct Rest(Option<Accumulation>, f64);
    impl Observer for Rest {
        const ARCS: bool = false;
        fn impact(&mut self, impact: &Impact) {
            self.1 = impact.approach_speed_m_per_s;
        }
        fn accumulation(&mut self, accumulation: &Accumulation) {
            self.0 = Some(*accumulation);
        }
    }
    let mut draw = draws(15);
    for _ in 0..50 {
        let (e, height, pull) = (draw(0.05, 0.9), draw(0.1, 2.0), draw(2.0, 20.0));
        // The structure is so heavy, soft and slow that its acceleration is constant and the particle has no effect.
        let (mass, light) = (1e9, 1e-9);
        let structure = Structure { mass_kg: mass, stiffness_n_per_m: 1e-6, damping_n_s_per_m: 0.0 };
        let particle = Particle {
            mass_kg: light,
            clearance_m: height,
            friction_coefficient: 0.0,
            wall: Wall::Restitution { coefficient: e },
            cavity: Cavity::default(),
        };
        let set_up = SetUp { particle: Some(particle), ..SetUp::bare(structure) };
        let force =
            Excitation::ForceSine { amplitude_n: mass * pull, angular_frequency_rad_per_s: 1e-9, phase_rad: 0.5 * PI };
        let mut motion = Exact::new(&set_up, &force, &Initial::default()).expect("physical");
        let end = (2.0 * height / pull).sqrt() * (1.0 + e) / (1.0 - e);
        let mut rest = Rest(None, 0.0);
        motion.run(1.5 * end, &mut rest);
        let Accumulation { time_s: at, ended_s, .. } = rest.0.expect("the particle comes to rest");
        // The particle counts as at rest when the remaining flights are negligible. They last this long.
        let remaining = 2.0 * e * rest.1 / (pull * (1.0 - e));
        assert!(at <= end * (1.0 + 1e-9) && end - at <= remaining * 1.001 + 1e-9 * end, "{at} {end} {remaining:e}");
        // The acceleration is constant to 10⁻⁹, so the remaining flights form a geometric series.
        assert!((ended_s / end - 1.0).abs() < 1e-9, "{ended_s} {end}");
    }
}

/// Tuned mass (Den Hartog): both fixed points have the height √(1 + 2/μ) for every damping.
#[test]
fn a_tuned_mass_has_its_fixed_points() {
    let mut draw = draws(16);
    for _ in 0..20 {
        let (mass_ratio, loss) = (draw(0.02, 0.25), draw(0.08, 0.4));
        let (natural, tuning) = (TAU * 2.5, 1.0 / (1.0 + mass_ratio));
        let stiffness = natural * natural;
        let structure = Structure { mass_kg: 1.0, stiffness_n_per_m: stiffness, damping_n_s_per_m: 0.0 };
        let own = tuning * natural;
        let tmd = Tmd {
            mass_kg: mass_ratio,
            stiffness_n_per_m: mass_ratio * own * own,
            damping_n_s_per_m: 2.0 * loss * mass_ratio * own,
        };
        let set_up = SetUp { tmd: Some(tmd), ..SetUp::bare(structure) };
        // g⁴ − 2g² (1 + f² + μf²)/(2 + μ) + 2f²/(2 + μ) = 0
        let f2 = tuning * tuning;
        let middle = (1.0 + f2 + mass_ratio * f2) / (2.0 + mass_ratio);
        let apart = (middle * middle - 2.0 * f2 / (2.0 + mass_ratio)).sqrt();
        for g2 in [middle - apart, middle + apart] {
            let turning = natural * g2.sqrt();
            let force =
                Excitation::ForceSine { amplitude_n: stiffness, angular_frequency_rad_per_s: turning, phase_rad: 0.0 };
            let mut motion = Exact::new(&set_up, &force, &Initial::default()).expect("physical");
            let cycle_s = TAU / turning;
            motion.run(1500.0 * cycle_s, &mut ());
            let mut response = Response::new(Wanted::default());
            motion.run(1501.0 * cycle_s, &mut response);
            let height = (1.0 + 2.0 / mass_ratio).sqrt();
            assert!((response.max_abs_x_m() / height - 1.0).abs() < 1e-10, "{} {height}", response.max_abs_x_m());
        }
    }
}

/// A mass on a soft wall, z₁ = c₁/(2√(k₁ m)) with the reduced mass: separation speed for both release rules.
#[test]
fn the_separation_speed_from_a_soft_wall_agrees_with_its_closed_form() {
    struct Contact(f64, Option<f64>);
    impl Observer for Contact {
        const ARCS: bool = false;
        fn impact(&mut self, impact: &Impact) {
            self.0 = impact.approach_speed_m_per_s;
        }
        fn contact_end(&mut self, end: &ContactEnd) {
            self.1.get_or_insert(end.separation_speed_m_per_s / self.0);
        }
    }
    let mut draw = draws(17);
    for _ in 0..50 {
        let (z, mass_ratio) = (draw(0.01, 0.6), draw(0.01, 0.5));
        // The structure's spring is negligible, so both bodies are free.
        let structure = Structure { mass_kg: 1.0, stiffness_n_per_m: 1e-9, damping_n_s_per_m: 0.0 };
        let (stiffness_n_per_m, reduced) = (draw(1e3, 1e5), mass_ratio / (1.0 + mass_ratio));
        let damping_n_s_per_m = 2.0 * z * (stiffness_n_per_m * reduced).sqrt();
        let root = (1.0 - z * z).sqrt();
        for (release, angle) in
            [(Release::ZeroPenetration, PI), (Release::ZeroForce, PI - (2.0 * z * root).atan2(1.0 - 2.0 * z * z))]
        {
            let wall = Wall::Voigt { stiffness_n_per_m, damping_n_s_per_m, release };
            let particle = Particle {
                mass_kg: mass_ratio,
                clearance_m: 0.01,
                friction_coefficient: 0.0,
                wall,
                cavity: Cavity::default(),
            };
            let set_up = SetUp { particle: Some(particle), ..SetUp::bare(structure) };
            let initial = Initial { u_m_per_s: 0.5, ..Initial::default() };
            let mut motion = Exact::new(&set_up, &Excitation::Fixed, &initial).expect("physical");
            let mut contact = Contact(0.0, None);
            motion.run(1.0, &mut contact);
            let returned = contact.1.expect("a contact ended");
            let expected = (-z / root * angle).exp();
            assert!((returned / expected - 1.0).abs() < 1e-11, "{release:?} {z}: {returned} {expected}");
        }
    }
}
