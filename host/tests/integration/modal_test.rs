//! Modes of a modal test become a case: universal files (datasets 55 and 164, written by pyuff 2.5) and tables.

use std::path::Path;

use crate::common::{damprig, folder, refused, simulated};
use damprig::input::Source;
use damprig::simulation::Case;
use damprig_structures::{Damping, Modes};

/// M and K of the structure whose modes the files have, at the nodes 3, 7 and 12, and C = 0.2 M + 2·10⁻⁴ K.
fn modes() -> Modes {
    let mass = [1.2, 0.0, 0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 0.7];
    let stiffness = [3000.0, -1200.0, 0.0, -1200.0, 2000.0, -800.0, 0.0, -800.0, 800.0];
    let damping = Damping::Rayleigh { mass_per_s: 0.2, stiffness_s: 2e-4 };
    Modes::from_matrices(&mass, &stiffness, &damping, &[1.0; 3]).unwrap()
}

fn text(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/modal_tests").join(name)).unwrap()
}

/// The case that `damprig init --modal-test` writes from a file.
fn case(name: &str, text: &str, more: &[&str]) -> Case {
    let folder = folder(&[(name, text)]);
    damprig(&folder).args(["init", "part.toml", "--modal-test", name]).args(more).assert().success();
    let path = folder.path().join("part.toml");
    Case::parse(&Source::read(&path).unwrap(), "part").unwrap()
}

/// Its modes are those of the matrices at nodes 12, 3 (reversed) and 7, to within the six digits of the file.
fn has_the_modes(case: &Case) {
    let own = &case.multi_degree.as_ref().unwrap().set_up.structure.modes;
    assert_eq!(own.len(), 3);
    for (own, exact) in own.iter().zip(modes().modes) {
        assert!((own.angular_frequency_rad_per_s / exact.angular_frequency_rad_per_s - 1.0).abs() < 1e-5);
        assert!((own.damping_ratio / exact.damping_ratio - 1.0).abs() < 1e-5, "{}", own.damping_ratio);
        let expected = [exact.shape[2], -exact.shape[0], exact.shape[1]];
        // A mode has either sign.
        let sign = (own.shape[0] * expected[0]).signum();
        for (phi, expected) in own.shape.iter().zip(expected) {
            assert!((sign * phi / expected - 1.0).abs() < 2e-5, "{phi} {expected}");
        }
    }
}

const PLACES: [&str; 6] = ["--place", "tip=12:z", "--place", "a=-3:z", "--place", "b=7:z"];

#[test]
fn normal_modes_of_any_scale_and_unit_are_normalised_to_a_kilogram() {
    has_the_modes(&case("test.uff", &text("real-mm-n.uff"), &PLACES));
}

#[test]
fn complex_modes_of_a_proportionally_damped_structure_are_its_real_ones() {
    has_the_modes(&case("test.uff", &text("complex.uff"), &PLACES));
}

#[test]
fn a_table_has_a_row_for_each_mode_and_its_columns_are_places() {
    let exact = modes();
    let mut table = "frequency_hz,damping_ratio,tip,a,participation_root_kg\n".to_string();
    for mode in &exact.modes {
        let hz = mode.angular_frequency_rad_per_s / std::f64::consts::TAU;
        table += &format!("{hz},{},{},{},{}\n", mode.damping_ratio, mode.shape[2], mode.shape[0], mode.participation);
    }
    let case = case("modes.csv", &table, &[]);
    let several = case.multi_degree.as_ref().unwrap();
    assert_eq!(several.places, ["a", "tip"]);
    for (own, exact) in several.set_up.structure.modes.iter().zip(&exact.modes) {
        assert!(
            (own.shape[1] - exact.shape[2]).abs() < 1e-7
                && (own.participation / exact.participation - 1.0).abs() < 1e-6
        );
    }
}

/// Without `--place` the degrees of freedom that move are places, and the case runs as it is written.
#[test]
fn the_written_case_runs() {
    let folder = folder(&[("test.uff", &text("real-mm-n.uff"))]);
    let said = damprig(&folder).args(["init", "part.toml", "--modal-test", "test.uff"]).assert().success();
    let printed = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    assert!(printed.contains("modes: 3, places: 3") && printed.contains("6 degrees of freedom"), "{printed}");
    let written = std::fs::read_to_string(folder.path().join("part.toml")).unwrap();
    let answer = simulated(&written, &[]);
    assert_eq!(answer["places"].as_array().unwrap().len(), 3);
    assert_eq!(answer["places"][0]["place"], "12:z");
}

#[test]
fn what_is_no_modal_test_is_refused_with_what_is_needed() {
    let run = ["init", "part.toml", "--modal-test", "test"];
    let real = text("real-mm-n.uff");
    let header = "frequency_hz,damping_ratio,tip\n";
    let cases: &[(String, &[&str], &[&str])] = &[
        (String::new(), &[], &["no columns", "frequency_hz"]),
        ("f,zeta,tip\n3,0.01,1\n".into(), &[], &["no column frequency_hz", "f, zeta, tip"]),
        (header.into(), &[], &["no mode"]),
        ("frequency_hz,damping_ratio,tip,tip\n3,0.01,1,2\n".into(), &[], &["two columns", "\"tip\""]),
        (format!("{header}3,0.01,one\n"), &[], &["line 2, tip", "\"one\""]),
        (format!("{header}0,0.01,1\n"), &[], &["line 2", "rigid motions"]),
        (format!("{header}3,1.5,1\n"), &[], &["damping ratio of 1.5"]),
        (real.replace("    55 ", "    58 "), &[], &["it has no mode"]),
        (real.lines().take(20).collect::<Vec<_>>().join("\n"), &[], &["dataset 2 (55)", "the file ends within it"]),
        (real.clone(), &["--place", "tip=13:z"], &["no such degree of freedom", "12:z"]),
        (real.clone(), &["--place", "tip"], &["NAME=FREEDOM"]),
        (real.replacen("1.36900e-02", "0.00000e+00", 1), &[], &["modal mass of 0"]),
    ];
    for (text, more, words) in cases {
        refused(&[("test", text)], &[&run[..], more].concat(), words);
    }
}
