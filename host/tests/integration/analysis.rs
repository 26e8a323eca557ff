//! `damprig simulate --analyse`: energy balance, periodic orbits, Floquet multipliers.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use damprig::input::Source;
use damprig::simulation::Case;
use damprig::simulation::analysis::{Analysis, Lyapunov, PeriodicOrbit, Stability};
use damprig_continuation::ReturnMap;
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::{Exact, ExactState, Excitation, Impact, Observer};
use damprig_core::model::{Cavity, FrictionDamper, Initial, Particle, SetUp, Structure, Wall};
use damprig_structures::{Drive, MotionCase, State, base_at_start};
use nalgebra::{Complex, Matrix4, Vector4};

pub fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("cases").join(name)
}

#[test]
fn every_shipped_case_keeps_its_energy_balance() {
    // Of a structure with several places the book sums the work in every mode.
    for (name, rounding) in [
        ("spid.toml", 1e-12),
        ("soft-wall.toml", 1e-12),
        ("friction-damper.toml", 1e-12),
        ("hybrid.toml", 1e-12),
        ("tmd.toml", 1e-12),
        ("frame.toml", 1e-10),
        ("boring-bar.toml", 1e-10),
    ] {
        let case = Case::read(&case(name)).expect("shipped cases are right");
        let energy = Analysis::of(&case).and_then(|analysis| analysis.energy).expect("in closed form");
        let through = energy.input_j.abs() + energy.stored_change_j.abs();
        assert!(energy.residual_j.abs() <= rounding * through, "{name}: {energy:?}");
        assert!(energy.structure_damping_j > 0.0, "{name}: {energy:?}");
    }
}

#[test]
fn a_record_has_no_analysis_in_closed_form() {
    let case = Case::read(&case("record.toml")).expect("shipped cases are right");
    assert!(Analysis::of(&case).is_none());
}

#[test]
fn the_result_has_the_analysis_only_if_requested() {
    let answer = |analyse: bool| -> serde_json::Value {
        let mut command = Command::cargo_bin("damprig").expect("the command has been built");
        command.arg("simulate").arg(case("spid.toml")).arg("--json");
        if analyse {
            command.arg("--analyse");
        }
        let output = command.assert().success().get_output().stdout.clone();
        serde_json::from_slice(&output).expect("one JSON object")
    };
    assert!(answer(false).get("analysis").is_none());
    let both = answer(true);
    let driven = &both["analysis"]["driven"];
    assert_eq!(driven["orbit"]["stable"], true);
    assert_eq!(driven["orbit"]["multipliers"].as_array().map(Vec::len), Some(4));
    let (amplitude, largest) = (driven["amplitude_m"].as_f64(), driven["mean_cycle_max_abs_x_m"].as_f64());
    assert!(amplitude > Some(0.0) && largest > Some(0.0));
    assert!(both["summary"]["rms_x_m"].as_f64() > Some(0.0));
}

/// A state of a settled run at drive phase 0, and the map of one period.
fn map_after(set_up: &SetUp, periods: u32) -> (ReturnMap, ExactState) {
    let drive = Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: NATURAL, phase_rad: 0.0 };
    let mut motion = Exact::new(set_up, &drive, &set_up.neutral()).expect("physical");
    motion.run(f64::from(periods) * TAU / NATURAL, &mut ());
    (ReturnMap::new(set_up, &drive, 1).expect("physical"), *motion.state())
}

#[test]
fn the_lyapunov_exponent_of_a_periodic_motion_is_that_of_its_multipliers() {
    let bare = SetUp::bare(Structure::from_modal(1.0, 2.5, 0.02));
    let (map, state) = map_after(&bare, 10);
    let found = Lyapunov::of(&map, &state).expect("resolved").expect("a disturbance is left");
    // Decay over a period at resonance; the direction of the disturbance turns, which adds less than 1 in all.
    assert!((found.per_period + 0.02 * TAU).abs() < 1.0 / f64::from(found.periods), "{found:?}");
    assert!(found.is_settling() && !found.is_chaotic());
    let damper = damper(10.0, 0.5);
    let (map, state) = map_after(&damper, 1_000);
    let found = Lyapunov::of(&map, &state).expect("resolved").expect("a disturbance is left");
    let orbit = PeriodicOrbit::near(&damper, 1.0, NATURAL, &state, 1).expect("it is on it");
    let expected = orbit.multipliers[0].value.norm().ln();
    assert!((found.per_period - expected).abs() < 2.0 / f64::from(found.periods), "{found:?}, {expected}");
}

#[test]
fn the_lyapunov_exponent_of_a_structure_is_that_of_one_degree_of_freedom() {
    let drive = Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: NATURAL, phase_rad: 0.0 };
    let of_structure = |set_up: &SetUp, periods: u32| {
        let run = MotionCase {
            set_up: set_up.into(),
            start: State::on_base(set_up, &set_up.neutral(), base_at_start(&drive)),
            drive: Drive::ClosedForm(drive),
            duration_s: f64::from(periods) * TAU / NATURAL,
        };
        Lyapunov::of_structure(&run, &mut || true).expect("it has derivatives").expect("a disturbance is left")
    };
    let (chaotic, settled) = (damper(18.0, 0.5), damper(10.0, 0.5));
    let (map, state) = map_after(&chaotic, 100);
    let (own, other) = (of_structure(&chaotic, 100), Lyapunov::of(&map, &state).expect("resolved").expect("left"));
    // Rounding makes other motions of the same kind of both.
    assert!(own.is_chaotic(), "{own:?}");
    assert!((own.per_period - other.per_period).abs() < 5.0 * own.error.hypot(other.error), "{own:?} {other:?}");
    let (_, state) = map_after(&settled, 1_000);
    let orbit = PeriodicOrbit::near(&settled, 1.0, NATURAL, &state, 1).expect("it is on it");
    let (own, expected) = (of_structure(&settled, 1_000), orbit.multipliers[0].value.norm().ln());
    assert!((own.per_period - expected).abs() < 2.0 / f64::from(own.periods), "{own:?}, {expected}");
}

#[test]
fn two_chaotic_motions_part_as_the_lyapunov_exponent_says() {
    let set_up = damper(18.0, 0.5);
    let (map, state) = map_after(&set_up, 100);
    let found = Lyapunov::of(&map, &state).expect("resolved").expect("a disturbance is left");
    assert!(found.is_chaotic() && found.error < 0.1 * found.per_period, "{found:?}");
    // Two motions a distance of 1e-9 apart, brought back to that distance after each period.
    let initial =
        |s: &ExactState| Initial { x_m: s.x_m, v_m_per_s: s.v_m_per_s, y_m: s.y_m(), u_m_per_s: s.u_m_per_s() };
    let units = Vector4::new(1.0, NATURAL, 1.0, NATURAL);
    let vector = |s: &ExactState| Vector4::new(s.x_m, s.v_m_per_s, s.offset_m, s.slide_m_per_s).component_div(&units);
    let (mut here, mut apart) = (state, Vector4::from_element(0.5e-9));
    let (mut blocks, mut sum) = (Vec::new(), 0.0);
    for n in 1..=3_000 {
        let there = vector(&here) + apart;
        let there = there.component_mul(&units);
        let there = ExactState { x_m: there[0], v_m_per_s: there[1], offset_m: there[2], slide_m_per_s: there[3] };
        let images = [here, there].map(|state| map.image(&initial(&state)));
        let growth = (vector(&images[1]) - vector(&images[0])).norm() / 1e-9;
        apart = (vector(&images[1]) - vector(&images[0])) / growth;
        here = images[0];
        sum += growth.ln();
        if n % 50 == 0 {
            blocks.push(sum / 50.0);
            sum = 0.0;
        }
    }
    let count = blocks.len() as f64;
    let mean = blocks.iter().sum::<f64>() / count;
    let error = (blocks.iter().map(|block| (block - mean).powi(2)).sum::<f64>() / (count - 1.0) / count).sqrt();
    // Five standard errors of both.
    let allowed = 5.0 * error.hypot(found.error);
    assert!((mean - found.per_period).abs() < allowed, "{mean} ± {error}, {found:?}");
}

const ZETA: f64 = 0.0038;
const MASS_RATIO: f64 = 0.1;
const NATURAL: f64 = TAU * 2.5;

fn damper(clearance_m: f64, coefficient: f64) -> SetUp {
    let particle = Particle {
        mass_kg: MASS_RATIO,
        clearance_m,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.0, 2.5, ZETA)) }
}

/// Closed form of the Floquet multipliers of the orbit with two impacts per cycle, Z = 1 m: half a cycle is a free motion and
/// an impact, whose derivative includes the shift of its time (saltation matrix).
fn closed_form(orbit: &SymmetricOrbit, e: f64, turning: f64) -> Vec<Complex<f64>> {
    let (k, c) = (NATURAL * NATURAL, 2.0 * ZETA * NATURAL);
    let (decay, ringing, half_s) = (ZETA * NATURAL, NATURAL * (1.0 - ZETA * ZETA).sqrt(), PI / turning);
    let (fade, (sin, cos)) = ((-decay * half_s).exp(), (ringing * half_s).sin_cos());
    let mut flight = Matrix4::identity();
    flight[(0, 0)] = fade * (cos + decay / ringing * sin);
    flight[(0, 1)] = fade * sin / ringing;
    flight[(1, 0)] = -fade * k / ringing * sin;
    flight[(1, 1)] = fade * (cos - decay / ringing * sin);
    flight[(2, 3)] = half_s;
    let (own, others) = (1.0 / (1.0 + MASS_RATIO), MASS_RATIO / (1.0 + MASS_RATIO));
    let mut law = Matrix4::identity();
    (law[(1, 1)], law[(1, 3)]) = (1.0 - others * (1.0 + e), others * (1.0 + e));
    (law[(3, 1)], law[(3, 3)]) = (own * (1.0 + e), 1.0 - own * (1.0 + e));
    let (sine, cosine) = orbit.drive_phase_rad.sin_cos();
    let rates = |v: f64, u: f64| {
        let pull = c * (v - turning * cosine) + k * (orbit.impact_displacement_m - sine);
        Vector4::new(v, -pull, u, 0.0)
    };
    let speed = orbit.particle_speed_m_per_s;
    let before = rates(speed - orbit.approach_speed_m_per_s, speed);
    let after = rates(orbit.velocity_after_m_per_s, -speed);
    let gap = Vector4::new(1.0, 0.0, -1.0, 0.0);
    let impact = law + (after - law * before) * gap.transpose() / gap.dot(&before);
    let half = impact * flight;
    (half * half).complex_eigenvalues().iter().copied().collect()
}

#[derive(Default)]
struct Count(usize);

impl Observer for Count {
    const ARCS: bool = false;

    fn impact(&mut self, _: &Impact) {
        self.0 += 1;
    }
}

fn sine(turning: f64, phase_rad: f64) -> Excitation {
    Excitation::Sine { amplitude_m: 1.0, angular_frequency_rad_per_s: turning, phase_rad }
}

/// Set-ups whose stable orbit has two impacts per cycle, one at drive phase `phase_rad` and one half a cycle later.
fn with_impact_at(phase_rad: f64) -> Vec<(SetUp, f64, f64, SymmetricOrbit)> {
    let mut found = vec![];
    for e in [0.3, 0.5, 0.7] {
        for n in 0..14 {
            let turning = NATURAL * (0.8 + 0.05 * f64::from(n));
            let orbit = |d: f64| SymmetricOrbit::new(&damper(d, e), 1.0, turning);
            for m in 0..60 {
                let (mut low, mut high) = (1.0 + 0.25 * f64::from(m), 1.25 + 0.25 * f64::from(m));
                let late =
                    |orbit: &SymmetricOrbit| (orbit.drive_phase_rad - phase_rad + FRAC_PI_2).rem_euclid(PI) - FRAC_PI_2;
                let off = |d: f64| orbit(d).as_ref().map(late);
                let (Some(a), Some(b)) = (off(low), off(high)) else { continue };
                if a * b > 0.0 || (a - b).abs() > 1.0 {
                    continue;
                }
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    let Some(there) = off(middle) else { break };
                    if there * a > 0.0 { low = middle } else { high = middle }
                }
                let Some(at) = orbit(low) else { continue };
                let set_up = damper(low, e);
                let mut motion =
                    Exact::new(&set_up, &sine(turning, at.drive_phase_rad), &at.initial()).expect("physical");
                let mut count = Count::default();
                motion.run(1.25 * TAU / turning, &mut count);
                let is_stable = closed_form(&at, e, turning).iter().all(|m| m.norm() < 0.98);
                if count.0 == 2 && is_stable && late(&at).abs() < 1e-9 {
                    found.push((set_up, e, turning, at));
                }
            }
        }
    }
    found
}

/// The largest distance between a multiplier and the nearest expected one.
fn apart(found: &[Complex<f64>], expected: &[Complex<f64>]) -> f64 {
    let mut left = expected.to_vec();
    found.iter().fold(0.0, |most, multiplier| {
        let nearest =
            (0..left.len()).min_by(|&a, &b| (left[a] - multiplier).norm().total_cmp(&(left[b] - multiplier).norm()));
        nearest.map_or(f64::INFINITY, |n| (left.swap_remove(n) - multiplier).norm().max(most))
    })
}

#[test]
fn multipliers_do_not_depend_on_the_distance_between_impact_and_section() {
    let mut tested = 0;
    for phase_rad in [0.0, 1e-7, -1e-7, 5e-6, -5e-6, 2e-5, -2e-5, 1e-3, -1.0] {
        for (set_up, e, turning, formula) in with_impact_at(phase_rad) {
            let initial = formula.initial();
            let mut motion = Exact::new(&set_up, &sine(turning, formula.drive_phase_rad), &initial).expect("physical");
            motion.run((TAU - formula.drive_phase_rad) / turning, &mut ());
            let orbit = PeriodicOrbit::near(&set_up, 1.0, turning, motion.state(), 1).expect("an orbit near the state");
            let found: Vec<_> = orbit.multipliers.iter().map(|m| m.value).collect();
            let error = apart(&found, &closed_form(&formula, e, turning));
            // The error of an eigenvalue is a multiple of the error of the matrix.
            let allowed = 100.0 * orbit.derivative_error;
            assert!(
                allowed < 1e-4 && error <= allowed,
                "{phase_rad} {e} {turning}: off by {error:e}, {allowed:e} allowed"
            );
            assert_eq!(orbit.stability(), Stability::Stable, "{:?}", orbit.multipliers);
            tested += 1;
        }
    }
    assert!(tested > 30, "only {tested} orbits were tested");
}

/// A run that starts with an impact: rounding would decide on which side of a section at that phase the impact falls.
#[test]
fn a_run_that_starts_on_an_impact_of_its_orbit_repeats_every_period_and_is_stable() {
    let mut tested = 0;
    for (set_up, e, turning, formula) in with_impact_at(-1.0) {
        let particle = set_up.particle.expect("a particle is mounted");
        let start = formula.initial();
        let text = format!(
            "structure = {{ mass_kg = 1.0, natural_frequency_hz = 2.5, damping_ratio = {ZETA} }}
             base = {{ kind = \"sine\", amplitude_m = 1.0, angular_frequency_rad_per_s = {turning:?}, phase_rad = {:?} }}
             initial = {{ x_m = {:?}, v_m_per_s = {:?}, y_m = {:?}, u_m_per_s = {:?} }}
             run = {{ duration_s = {:?} }}
             [particle]
             mass_kg = {MASS_RATIO}
             clearance_m = {:?}
             friction_coefficient = 0.0
             wall = {{ kind = \"restitution\", coefficient = {e} }}",
            formula.drive_phase_rad,
            start.x_m,
            start.v_m_per_s,
            start.y_m,
            start.u_m_per_s,
            200.5 * TAU / turning,
            particle.clearance_m,
        );
        let case = Case::parse(&Source::new("case.toml", text), "case").expect("a case");
        let driven = Analysis::of(&case).expect("in closed form").driven.expect("a driven motion");
        assert_eq!(driven.repeats_after, Some(1));
        let distance = (driven.section_phase_rad - formula.drive_phase_rad).rem_euclid(PI);
        assert!(distance > 0.1 && distance < PI - 0.1, "the section is {distance} rad from an impact");
        let orbit = driven.orbit.expect("the motion is periodic");
        assert_eq!(
            (orbit.stability, orbit.stable),
            ("stable", true),
            "{orbit:?} {:?}",
            closed_form(&formula, e, turning)
        );
        let found: Vec<_> = orbit.multipliers.iter().map(|[re, im]| Complex::new(*re, *im)).collect();
        let error = apart(&found, &closed_form(&formula, e, turning));
        assert!(error <= 100.0 * orbit.derivative_error, "off by {error:e}");
        tested += 1;
    }
    assert!(tested > 3, "only {tested} orbits were tested");
}

/// At drive phase 0, where the analysis takes its section, the particle presses into a soft wall.
#[test]
fn an_orbit_that_presses_into_a_soft_wall_at_the_section_is_found() {
    for release in ["zero_force", "zero_penetration"] {
        let text = format!(
            "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.01 }}
             base = {{ kind = \"sine\", amplitude_m = 0.002, frequency_hz = 2.2 }}
             run = {{ duration_s = 200 }}
             particle = {{ mass_kg = 0.16, clearance_m = 0.01, wall = {{ kind = \"voigt\", stiffness_n_per_m = 400, damping_n_s_per_m = 2, release = \"{release}\" }} }}"
        );
        let case = Case::parse(&Source::new("case.toml", text), "case").expect("a case");
        let driven = Analysis::of(&case).expect("in closed form").driven.expect("a driven motion");
        let last = driven.section.last().expect("it has a section");
        assert!((last.y_m - last.x_m).abs() > 0.011, "it does not press: {last:?}");
        let orbit = driven.orbit.as_ref().expect("the motion is periodic");
        assert!(orbit.stable && orbit.is_run_on_it, "{release}: {orbit:?}");
    }
}

/// Motions without restoring forces or damping: a particle that touches no wall, one held by friction, a stuck structure, an
/// undamped structure.
#[test]
fn persistent_disturbances_are_neutral() {
    let far = damper(1e3, 0.5);
    let mut held = far;
    held.particle.as_mut().expect("a particle is mounted").friction_coefficient = 100.0;
    let stuck = SetUp { friction_damper: Some(FrictionDamper { force_n: 1e4 }), ..SetUp::bare(far.structure) };
    let undamped = SetUp::bare(Structure::from_modal(1.0, 2.5, 0.0));
    for ratio in [0.5, 0.8, 1.3] {
        let turning = NATURAL * ratio;
        for (name, set_up, neutral) in
            [("far", far, 2), ("held", held, 1), ("stuck", stuck, 1), ("undamped", undamped, 2)]
        {
            let drive = sine(turning, 0.0);
            let mut motion = Exact::new(&set_up, &drive, &Default::default()).expect("physical");
            // Long enough for the transient to decay where there is damping.
            motion.run(2000.0 * TAU / turning, &mut ());
            let guess = if name == "undamped" { ExactState::default() } else { *motion.state() };
            let orbit = PeriodicOrbit::near(&set_up, 1.0, turning, &guess, 1).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(orbit.stability(), Stability::Neutral, "{name} {ratio}: {:?}", orbit.multipliers);
            let count = orbit.multipliers.iter().filter(|m| m.is_neutral).count();
            assert_eq!(count, neutral, "{name} {ratio}: {:?}", orbit.multipliers);
            assert!(orbit.derivative_error < 1e-5, "{name}: {:e}", orbit.derivative_error);
        }
    }
}
