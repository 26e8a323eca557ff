//! `[plant]`: a structure with several places moves on the virtual rig, and what is predicted and compared is its motion.

use std::f64::consts::TAU;

use crate::common::{damprig, folder_with, read_parquet, refused};
use damprig::table::values::{numbers, texts};
use damprig_fourier::Complex;
use tempfile::TempDir;

type C64 = Complex<f64>;

/// A run of a campaign.
struct Ran {
    folder: TempDir,
    printed: String,
}

impl Ran {
    fn of(campaign: &str) -> Self {
        let folder = folder_with(campaign);
        let said = damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
        let printed = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
        Self { folder, printed }
    }

    fn column(&self, file: &str, name: &str) -> Vec<f64> {
        numbers(&read_parquet(self.folder.path().join("out").join(file))[0], name).unwrap()
    }
}

/// Frequencies and damping ratios, and shapes at both floors, of two storeys of 1 kg, 400 N/m and this damping.
fn storeys(damping_n_s_per_m: f64) -> String {
    format!("[[plant.storey]]\nmass_kg = 1\nstiffness_n_per_m = 400\ndamping_n_s_per_m = {damping_n_s_per_m}\n")
        .repeat(2)
}

/// x of each floor per z of that frame, and its base's force per z, from its equations: (−Ω²M + jΩC + K) u = Ω²Mι z with x = u + z.
fn response(damping_n_s_per_m: f64, frequency_hz: f64) -> ([C64; 2], C64) {
    let omega = TAU * frequency_hz;
    let spring = C64::new(400.0, omega * damping_n_s_per_m);
    let (a, b, d) = (2.0 * spring - omega * omega, -spring, spring - omega * omega);
    let load = omega * omega;
    let determinant = a * d - b * b;
    let u = [(d - b) * load / determinant, (a - b) * load / determinant];
    // The force on the base by the lowest storey.
    (u.map(|u| u + 1.0), spring * u[0])
}

const SINE: &str = "[[experiment]]\nkind = \"stepped_sine\"\nfrequencies_hz = [2.0, 4.5, 5.5]\nstart = \"from_rest\"\nsettle_s = 30\n\
                    dwell_s = 4\n";

#[test]
fn x_is_that_of_the_observed_floor_in_all_its_modes() {
    for (place, floor) in [(0, "floor 1"), (1, "floor 2")] {
        let plant = format!("[plant]\nobserved_place = {floor:?}\n{}", storeys(1.6));
        let set_up = "[[set_up]]\nname = \"bare\"\nbase_amplitude_m = 0.001\n";
        let ran = Ran::of(&format!("name = \"t\"\n{plant}{set_up}{SINE}"));
        let measured = ran.column("results.parquet", "x_over_z_lock_in");
        let phases = ran.column("results.parquet", "phase_rad");
        for ((frequency_hz, ratio), phase) in [2.0, 4.5, 5.5].into_iter().zip(measured).zip(phases) {
            let expected = response(1.6, frequency_hz).0[place];
            // A cubic through a sine of 5.5 Hz at each tick is off by 4·10⁻⁹, the board measures in single precision, and after 30 s the
            // first mode has e^(−9) of its free vibration.
            assert!((ratio / expected.norm() - 1.0).abs() < 2e-3, "{floor}, {frequency_hz} Hz: {ratio} {expected}");
            let away = (phase - expected.arg()).sin().abs();
            assert!(away < 4e-3, "{floor}, {frequency_hz} Hz: {phase} {}", expected.arg());
        }
        // The second mode, at 5.15 Hz, is what one degree of freedom would miss.
        assert!(ran.printed.contains("frame of 2 storeys"), "{}", ran.printed);
    }
}

/// A shaker is loaded by the whole structure: of the force on its blocked table, what moves the table is left.
#[test]
fn a_shaker_feels_all_modes() {
    let plant = format!("[plant]\n{}[rig.shaker]\n", storeys(1.6));
    let set_up = "[[set_up]]\nname = \"bare\"\nbase_amplitude_m = 0.001\n";
    let ran = Ran::of(&format!("name = \"t\"\n{plant}{set_up}{SINE}"));
    let shaker = damprig_simulator::plant::Shaker::default();
    for (n, frequency_hz) in [2.0, 4.5, 5.5].into_iter().enumerate() {
        let (table, stiffness) = (shaker.dynamic_stiffness_n_per_m(TAU * frequency_hz), response(1.6, frequency_hz));
        let unloaded = C64::new(table.0, table.1);
        // The load pulls the table back with the force of its lowest storey.
        let loaded = unloaded - stiffness.1;
        let expected_m = 0.001 * shaker.force_per_drive_n_per_m() / loaded.norm();
        let z_m = ran.column("results.parquet", "z_amplitude_m")[n];
        // The table's parabolas are off by 2·10⁻⁴ at most, and 10⁻⁴ of the free vibration is left.
        assert!((z_m / expected_m - 1.0).abs() < 1e-3, "{frequency_hz} Hz: {z_m} {expected_m}");
        let without_m = 0.001 * shaker.force_per_drive_n_per_m() / unloaded.norm();
        assert!((without_m / expected_m - 1.0).abs() > 5e-3, "the load acts: {without_m} {expected_m}");
    }
}

/// Dampers of every kind, of constant force and on a spring that the rig adjusts.
const DAMPERS: &str = "[[set_up]]\nname = \"spid\"\nbase_amplitude_m = 0.001\nparticle = { mass_ratio = 0.08, clearance_ratio = 6, \
                       friction_coefficient = 0.02, wall = { kind = \"restitution\", coefficient = 0.6 } }\n\
                       [[set_up]]\nname = \"soft\"\nbase_amplitude_m = 0.001\nparticle = { mass_ratio = 0.08, clearance_ratio = 6, \
                       friction_coefficient = 0.02, wall = { kind = \"voigt\", stiffness_n_per_m = 4000, damping_n_s_per_m = 3, \
                       release = \"zero_force\" } }\n\
                       [[set_up]]\nname = \"spring\"\nbase_amplitude_m = 0.001\nfriction_damper = { spring = { friction_ratio = 0.6 } }\n\
                       [[set_up]]\nname = \"tmd\"\nbase_amplitude_m = 0.001\ntmd = { mass_ratio = 0.05, tuning = \"den_hartog\" }\n";

const SHORT: &str = "[[experiment]]\nkind = \"stepped_sine\"\nfrequencies_hz = [2.4]\nstart = \"from_rest\"\nsettle_s = 2\ndwell_s = 3\n\
                     [[experiment]]\nkind = \"impulse\"\nshape = \"half_sine\"\namplitude_m = 0.004\nduration_s = 0.2\ntail_s = 4\n\
                     [[experiment]]\nkind = \"free_vibration\"\nstart_m = 0.02\nmeasure_s = 4\n";

/// One storey is the structure of one degree of freedom, whatever damps it and however it is moved.
#[test]
fn a_plant_of_one_storey_is_measured_as_one_degree_of_freedom() {
    let omega = TAU * 2.5;
    let (k, c) = (1.6 * omega * omega, 2.0 * 0.004 * 1.6 * omega);
    let structure = format!("[structure]\nmass_kg = 1.6\nstiffness_n_per_m = {k}\ndamping_n_s_per_m = {c}\n");
    let plant = format!("[[plant.storey]]\nmass_kg = 1.6\nstiffness_n_per_m = {k}\ndamping_n_s_per_m = {c}\n");
    let [one, placed] = [structure, plant].map(|text| Ran::of(&format!("name = \"t\"\n{text}{DAMPERS}{SHORT}")));
    let compared = [
        ("results.parquet", &["x_amplitude_m", "max_abs_x_m", "rms_x_m", "z_amplitude_m"][..]),
        ("transients.parquet", &["max_abs_x_m", "rms_x_m", "impacts", "predicted_rms_x_m", "damping_ratio"][..]),
    ];
    for (file, columns) in compared {
        for name in columns {
            for (a, b) in one.column(file, name).into_iter().zip(placed.column(file, name)) {
                // Single precision of results; the motions part by less.
                assert!(a.is_nan() && b.is_nan() || (a / b - 1.0).abs() < 1e-5 || a == b, "{file} {name}: {a} {b}");
            }
        }
    }
}

/// What is predicted is the plant's motion, and `compare` finds it again.
#[test]
fn a_run_on_a_plant_is_as_predicted_and_agrees_with_its_simulation() {
    let plant = format!("[plant]\n{}", storeys(1.6));
    let set_ups = "[[set_up]]\nname = \"spid\"\nbase_amplitude_m = 0.002\nparticle = { place = \"floor 1\", mass_kg = 0.1, clearance_m = 0.01, \
                   wall = { kind = \"restitution\", coefficient = 0.6 } }\n\
                   [[set_up]]\nname = \"between\"\nbase_amplitude_m = 0.002\nfriction_damper = { place = \"floor 2\", other_place = \"floor 1\", \
                   force_n = 0.5 }\n";
    let recorded = "[telemetry]\nrate_hz = 1000\nsignals = [\"x\", \"z\", \"drive\", \"frequency\"]\n";
    let ran = Ran::of(&format!("name = \"t\"\n{plant}{recorded}{set_ups}{SHORT}"));
    let of = |name: &str| ran.column("transients.parquet", name);
    for (rms, predicted) in of("rms_x_m").iter().zip(of("predicted_rms_x_m")) {
        assert!((rms / predicted - 1.0).abs() < 3e-3, "{rms} {predicted}");
    }
    assert_eq!(of("impacts"), of("predicted_impacts"));
    assert!(of("impacts").iter().any(|count| *count > 5.0), "{:?}", of("impacts"));
    let said = damprig(&ran.folder).args(["compare", "out"]).assert().success();
    let printed = String::from_utf8_lossy(&said.get_output().stdout).into_owned();
    let (agree, all) = printed
        .lines()
        .find_map(|line| {
            line.split_once(" quantities agree")?.0.split_once(" of ").map(|(a, b)| (a.to_string(), b.to_string()))
        })
        .expect("a verdict");
    assert_eq!(agree, all, "{printed}");
    assert!(printed.contains("frame of 2 storeys (x at floor 2, particle at floor 1, modes at "), "{printed}");
    let page = std::fs::read_to_string(ran.folder.path().join("out/report.html")).unwrap();
    assert!(
        page.contains("friction damper at floor 2, its other end at floor 1, modes at "),
        "the page names the plant"
    );
    let names = texts(&read_parquet(ran.folder.path().join("out/transients.parquet"))[0], "set_up").unwrap();
    assert_eq!(names.len(), 4);
}

#[test]
fn what_a_plant_cannot_be_is_refused_with_its_line() {
    let bare = "[[set_up]]\nname = \"bare\"\nbase_amplitude_m = 0.001\n";
    let campaign = |plant: &str, set_up: &str| format!("name = \"t\"\n{plant}\n{set_up}{SINE}");
    let frame = format!("[plant]\n{}", storeys(1.6));
    let mode =
        "[plant]\nplaces = [\"a\"]\n[[plant.mode]]\nfrequency_hz = 3\ndamping_ratio = 0.01\nshape_per_root_kg = [1]";
    let cases: &[(String, &[&str])] = &[
        (
            campaign("[plant]\nobserved_place = \"a\"", bare),
            &["`plant` describes no structure", "`storey`, `beam`, `mode`", ":2:"],
        ),
        (
            campaign("[plant]\nmatrices = { mass_file = \"m.csv\" }", bare),
            &["a run folder keeps no matrix files", "[[plant.mode]]"],
        ),
        (campaign(mode, bare), &["participation_root_kg", "is missing"]),
        (
            campaign(&frame, &bare.replace("base_amplitude_m = 0.001", "force_amplitude_n = 1")),
            &["driven by a force", "[plant]"],
        ),
        (
            campaign(
                &frame,
                &format!("{bare}tmd = {{ place = \"floor 3\", mass_ratio = 0.1, tuning = \"den_hartog\" }}\n"),
            ),
            &["set_up[1].tmd.place", "\"floor 1\", \"floor 2\""],
        ),
        (
            campaign(
                &frame,
                &format!("{bare}friction_damper = {{ other_place = \"floor 2\", place = \"floor 2\", force_n = 1 }}\n"),
            ),
            &["another place than that of the damper"],
        ),
        (
            campaign(
                "[structure]\nmass_kg = 1\nnatural_frequency_hz = 2\ndamping_ratio = 0.01",
                &format!("{bare}tmd = {{ place = \"floor 2\", mass_ratio = 0.1, tuning = \"den_hartog\" }}\n"),
            ),
            &["`plant` in a campaign"],
        ),
    ];
    for (text, words) in cases {
        refused(&[("test.toml", text)], &["run", "test.toml", "--dry-run"], words);
    }
    let single = ["run", "test.toml", "--rig", "virtual:f32", "--dry-run"];
    refused(&[("test.toml", &campaign(&frame, bare))], &single, &["one degree of freedom", "--rig virtual", ":2:"]);
}

/// Signals of the twin are those of one degree of freedom, which is said before they are recorded.
#[test]
fn the_twin_is_said_to_follow_one_degree_of_freedom() {
    let plant = format!("[plant]\n{}[telemetry]\nrate_hz = 100\nsignals = [\"x\", \"twin_x\"]\n", storeys(1.6));
    let set_up = "[[set_up]]\nname = \"bare\"\nbase_amplitude_m = 0.001\n";
    let folder = folder_with(&format!("name = \"t\"\n{plant}{set_up}{SINE}"));
    let said = damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success();
    let output = said.get_output();
    let all = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(all.contains("the twin follows one degree of freedom"), "{all}");
}
