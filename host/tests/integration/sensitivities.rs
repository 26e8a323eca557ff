//! The sensitivities of `damprig simulate --analyse`: of periodic motions and of runs.

use std::f64::consts::TAU;
use std::path::PathBuf;

use assert_cmd::Command;
use damprig::input::Source;
use damprig::simulation::analysis::{Analysis, Sensitivities, Sensitivity, WrittenCase};
use damprig::simulation::{Case, RunOptions, SetValues, simulate};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{SetUp, Wall};

use crate::analysis::case;

/// Changes the quantity of a key by a factor: another way into the model than that of the derivatives.
fn scale(case: &mut Case, key: &str, by: f64) {
    let SetUp { structure, particle, friction_damper, .. } = &mut case.set_up;
    match (key, &mut case.excitation, particle, friction_damper) {
        ("structure.natural_frequency_hz", ..) => {
            structure.stiffness_n_per_m *= by * by;
            structure.damping_n_s_per_m *= by;
        }
        ("structure.damping_ratio", ..) => structure.damping_n_s_per_m *= by,
        ("structure.mass_kg", ..) => {
            structure.mass_kg *= by;
            structure.stiffness_n_per_m *= by;
            structure.damping_n_s_per_m *= by;
        }
        ("base.frequency_hz", Excitation::Sine { angular_frequency_rad_per_s, .. }, ..) => {
            *angular_frequency_rad_per_s *= by;
        }
        ("base.amplitude_m", Excitation::Sine { amplitude_m, .. }, ..) => *amplitude_m *= by,
        ("particle.mass_kg", _, Some(particle), _) => particle.mass_kg *= by,
        ("particle.clearance_m", _, Some(particle), _) => particle.clearance_m *= by,
        ("particle.friction_coefficient", _, Some(particle), _) => particle.friction_coefficient *= by,
        ("particle.wall.coefficient", _, Some(particle), _) => {
            let Wall::Restitution { coefficient } = &mut particle.wall else { panic!("a hard wall") };
            *coefficient *= by;
        }
        ("friction_damper.force_n", _, _, Some(damper)) => damper.force_n *= by,
        _ => panic!("{key}"),
    }
}

#[test]
fn sensitivities_are_the_relative_changes_between_two_simulations() {
    for (name, count) in [("spid.toml", 9), ("friction-damper.toml", 6)] {
        let mut case = Case::read(&case(name)).expect("shipped cases are right");
        // Long enough to be on the orbit to rounding.
        case.run.duration_s = 300.0 * TAU / case.excitation.angular_frequency_rad_per_s();
        let found = Analysis::of(&case).and_then(|analysis| analysis.driven?.sensitivities).expect("a periodic motion");
        assert_eq!(found.of.len(), count, "{name}: {:?}", found.of);
        assert!(found.of.is_sorted_by(|a, b| a.max_abs_x.abs() >= b.max_abs_x.abs()));
        for of in &found.of {
            let step = 1e-4;
            let [above, below] = [1.0 + step, 1.0 - step].map(|by| {
                let mut other = case.clone();
                scale(&mut other, &of.key, by);
                other.run.duration_s = 300.0 * TAU / other.excitation.angular_frequency_rad_per_s();
                let driven = Analysis::of(&other).and_then(|analysis| analysis.driven).expect("a sine");
                driven.mean_cycle_max_abs_x_m.ln()
            });
            let difference = (above - below) / (2.0 * step);
            // The third derivative of a resonance over a step of 10⁻⁴.
            let error = 1e-4 * found.of[0].max_abs_x.abs();
            assert!((of.max_abs_x - difference).abs() < error, "{name} {}: {}, {difference}", of.key, of.max_abs_x);
        }
    }
}

/// A free vibration in an inclined cavity whose e falls with the speed, and a pulse of a force on a soft wall.
const FREE: &str = r#"
structure = { mass_kg = 2.0, natural_frequency_hz = 2.5, damping_ratio = 0.01 }
base = { kind = "fixed" }
initial = { x_m = 0.03 }
run = { duration_s = 3 }
[particle]
mass_ratio = 0.05
clearance_m = 0.01
offset_m = 0.002
inclination_deg = 12
friction_coefficient = 0.05
wall = { kind = "restitution", coefficient = 0.5, reference_speed_m_per_s = 0.1, exponent = 0.1, maximum = 0.8 }
"#;
const PULSE: &str = r#"
structure = { mass_kg = 2.0, natural_frequency_hz = 2.5, damping_ratio = 0.01 }
force = { kind = "half_sine", amplitude_n = 40, duration_s = 0.15 }
run = { duration_s = 2.5 }
friction_damper = { force_n = 0.4 }
[particle]
mass_kg = 0.1
clearance_m = 0.008
wall = { kind = "voigt", stiffness_n_per_m = 8000, damping_n_s_per_m = 4, release = "zero_force" }
"#;

/// Friction between two places that starts at rest: with another participation of a mode they move against each other from the start.
const MODES: &str = r#"
places = ["low", "high"]
base = { kind = "sine", amplitude_m = 0.001, frequency_hz = 3 }
friction_damper = { place = "high", other_place = "low", force_n = 0.2 }
run = { duration_s = 5 }
mode = [
    { frequency_hz = 3, damping_ratio = 0.01, participation_root_kg = 1.4, shape_per_root_kg = [0.6, 0.8] },
    { frequency_hz = 7, damping_ratio = 0.02, participation_root_kg = 0.2, shape_per_root_kg = [0.8, -0.6] },
]
"#;

#[test]
fn sensitivities_of_a_run_are_the_relative_changes_between_two_simulations() {
    let shipped = |name: &str| (case(name), std::fs::read_to_string(case(name)).expect("it is shipped"));
    let inline = |text: &str| (PathBuf::from("case.toml"), text.to_string());
    // The particle starts in the middle of its cavity, so that its offset changes nothing. Six seconds are ten periods of the frame's base: the
    // whole run counts.
    let cases = [
        (inline(FREE), &[][..], &["particle.wall.exponent", "particle.inclination_deg", "initial.x_m"][..]),
        (inline(PULSE), &[], &["force.duration_s", "particle.wall.stiffness_n_per_m", "friction_damper.force_n"]),
        (shipped("record.toml"), &[], &["structure.natural_frequency_hz", "particle.clearance_m"]),
        (inline(MODES), &[], &["mode.1.frequency_hz", "friction_damper.force_n"]),
        (shipped("frame.toml"), &["run.duration_s=6"], &["storey.2.stiffness_n_per_m", "friction_damper.1.force_n"]),
    ];
    for ((path, text), set, keys) in cases {
        let name = path.display().to_string();
        let set: Vec<String> = set.iter().map(ToString::to_string).collect();
        let values = SetValues::from_arguments(&set).expect("they are right");
        let read = |values: &SetValues| {
            Case::parse_changed(&Source::new(name.as_str(), text.as_str()), "case", values).expect("it is right")
        };
        let case = read(&values);
        let written = WrittenCase { name: &name, text: &text, values: &values };
        let found = Analysis::complete(&case, &written, &mut ());
        let found = found.sensitivities.unwrap_or_else(|| panic!("{name}: {:?}", found.no_sensitivities));
        let of: Vec<&str> = found.of.iter().map(|of| of.key.as_str()).collect();
        assert!(keys.iter().all(|key| of.contains(key)) && !of.contains(&"particle.offset_m"), "{name}: {of:?}");
        let grazing = found.run.as_ref().map(|run| run.grazing.as_slice()).unwrap_or_default();
        let expected: &[&str] =
            if text == MODES { &["mode.1.participation_root_kg", "mode.2.participation_root_kg"] } else { &[] };
        assert_eq!(grazing, expected, "{name}");
        for of in &found.of {
            let step = of.holds_within.map_or(1e-5, |within| (0.1 * within).min(1e-5));
            let at = |by: f64| {
                let other = read(&values.with(&of.key, of.value * by));
                let options = RunOptions { keep: false, longest_part_s: f64::INFINITY, go_on: &mut |_| true };
                let summary = simulate(&other, &mut (), options).expect("it is right").summary;
                [summary.max_abs_x_m.ln(), summary.rms_x_m.ln()]
            };
            let difference = |step: f64| {
                let (above, below) = (at(1.0 + step), at(1.0 - step));
                [0, 1].map(|n| (above[n] - below[n]) / (2.0 * step))
            };
            let (coarse, fine) = (difference(step), difference(0.5 * step));
            for (n, exact) in [of.max_abs_x, of.rms_x].into_iter().enumerate() {
                let difference = (4.0 * fine[n] - coarse[n]) / 3.0;
                // What the extrapolation leaves, and the rounding of the results.
                let error = (fine[n] - coarse[n]).abs() + 1e-12 / step;
                assert!((exact - difference).abs() < error, "{name} {} {n}: {exact}, {difference}", of.key);
            }
        }
    }
}

/// The derivatives of the continuation are of its own equations and events, those of a run of the engine of structures.
#[test]
fn the_sensitivities_of_a_periodic_motion_are_the_same_from_both_engines() {
    for name in ["spid.toml", "friction-damper.toml"] {
        let (path, text) = (case(name), std::fs::read_to_string(case(name)).expect("it is shipped"));
        let values = SetValues::from_arguments(&["run.duration_s=300".to_string()]).expect("it is right");
        let settled = Case::read_changed(&path, &values).expect("shipped cases are right").0;
        let driven = Analysis::of(&settled).and_then(|analysis| analysis.driven).expect("a sine");
        let orbit = driven.sensitivities.unwrap_or_else(|| panic!("{name}: {:?}", driven.no_sensitivities));
        let written = WrittenCase { name: name.strip_suffix(".toml").unwrap_or(name), text: &text, values: &values };
        let of_run = Sensitivities::of_run(&settled, &written, &mut |_| true).expect("it has them");
        assert_eq!(of_run.run.and_then(|run| run.repeats_after), Some(1), "{name}");
        // Keys that change the same in both: ratios of a case do not follow a quantity, but a key.
        let same = ["structure.damping_ratio", "particle.wall.coefficient", "particle.friction_coefficient"];
        let mut compared = 0;
        for key in same {
            let own = |all: &[Sensitivity]| all.iter().find(|of| of.key == key).map(|of| [of.max_abs_x, of.rms_x]);
            let (Some(one), Some(other)) = (own(&orbit.of), own(&of_run.of)) else { continue };
            for (a, b) in one.into_iter().zip(other) {
                // The run is within 10⁻⁶ of its orbit.
                assert!((a - b).abs() < 1e-5 * orbit.of[0].max_abs_x.abs(), "{name} {key}: {a} {b}");
            }
            compared += 1;
        }
        assert!(compared >= 1, "{name}");
    }
}

#[test]
fn a_motion_without_sensitivities_says_why() {
    let anywhere = ["particle.clearance_m=0.5", "particle.friction_coefficient=0", "run.duration_s=800"];
    for (name, set, why) in [
        ("spid", &anywhere[..], "no derivatives: the orbit is not alone"),
        ("spid", &["run.duration_s=4"], "none: the run is not on a periodic orbit"),
        ("tmd", &[], "none: a periodic orbit is searched for under a moving base alone"),
    ] {
        let mut command = Command::cargo_bin("damprig").expect("the command has been built");
        command.args(["simulate", name, "--analyse"]).args(set.iter().flat_map(|set| ["--set", set]));
        let output = command.assert().success().get_output().stdout.clone();
        let text = String::from_utf8(output).expect("UTF-8");
        assert!(text.contains(&format!("sensitivities            {why}")), "{name}: {text}");
    }
}
