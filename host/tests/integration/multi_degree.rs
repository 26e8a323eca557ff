//! Structures of several degrees of freedom: closed forms, places and dampers of a list, studies, optimisations, contacts, refusals.

use std::f64::consts::TAU;

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use serde_json::Value;

use crate::common::{damprig, folder, read_parquet, refused, simulated as answer};

const FRAME: &str = "\
base = { kind = \"sine\", amplitude_m = 0.002, frequency_hz = 4.03 }
run = { duration_s = 20, steady_from_cycle = 40, sample_times_s = [5, 20] }
[[storey]]
mass_kg = 100
stiffness_n_per_m = 5e4
damping_n_s_per_m = 100
[[storey]]
mass_kg = 80
stiffness_n_per_m = 4e4
damping_n_s_per_m = 80
";

const PARTICLE: &str = "\
[[particle]]
place = \"floor 2\"
mass_kg = 6
clearance_m = 0.01
wall = { kind = \"restitution\", coefficient = 0.5 }
";

const BEAM: &str = "\
beam = { kind = \"cantilever\", length_m = 0.3, bending_stiffness_n_m2 = 4000, mass_per_length_kg_per_m = 4, damping_ratio = 0.01 }
run = { duration_s = 0.5 }
";

pub fn number(answer: &Value, path: &str) -> f64 {
    answer.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} of {answer}"))
}

fn mean_cycle_max_m(answer: &Value) -> f64 {
    number(answer, "/summary/steady_mean_cycle_max_abs_x_m")
}

/// The amplitude of the upper and of the lower floor, m: (K − ω²M + iωC) x = (k₁ + iωc₁) Z e₁ by Cramer's rule.
fn amplitudes_m(frequency_hz: f64) -> [f64; 2] {
    let omega = TAU * frequency_hz;
    let multiply = |a: (f64, f64), b: (f64, f64)| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
    let size = |a: (f64, f64)| a.0.hypot(a.1);
    let first = (5e4, 100.0 * omega);
    let second = (4e4, 80.0 * omega);
    let one = (first.0 + second.0 - 100.0 * omega * omega, first.1 + second.1);
    let two = (second.0 - 80.0 * omega * omega, second.1);
    let (diagonal, off) = (multiply(one, two), multiply(second, second));
    let determinant = size((diagonal.0 - off.0, diagonal.1 - off.1));
    let load = (first.0 * 0.002, first.1 * 0.002);
    [size(multiply(second, load)) / determinant, size(multiply(two, load)) / determinant]
}

#[test]
fn a_bare_frame_under_a_sine_has_the_amplitudes_of_its_equations() {
    for frequency_hz in [2.2, 4.03, 5.0] {
        let set = format!("base.frequency_hz={frequency_hz}");
        // After 60 s the free vibration (ζ = 0.008 at 2.2 Hz) is below 1e-3 of itself; it is driven far from resonance.
        let answer =
            answer(FRAME, &["--set", &set, "--set", "run.duration_s=200", "--set", "run.steady_from_cycle=350"]);
        let [upper_m, lower_m] = amplitudes_m(frequency_hz);
        let steady = number(&answer, "/summary/steady_max_abs_x_m");
        assert!((steady / upper_m - 1.0).abs() < 1e-6, "{frequency_hz} Hz: {steady} {upper_m}");
        let observed = [
            "--set",
            &set,
            "--set",
            "run.duration_s=200",
            "--set",
            "run.steady_from_cycle=350",
            "--set",
            "observed_place=floor 1",
        ];
        let lower = number(&self::answer(FRAME, &observed), "/summary/steady_max_abs_x_m");
        assert!((lower / lower_m - 1.0).abs() < 1e-6, "{frequency_hz} Hz: {lower} {lower_m}");
    }
}

/// M, K and C of [`FRAME`].
const MATRICES: [(&str, &str); 3] =
    [("m.csv", "100, 0\n0, 80\n"), ("k.csv", "9e4,-4e4\n-4e4,4e4\n"), ("c.csv", "180,-80\n-80,80\n")];

fn of_matrices(damping: &str) -> String {
    let (rest, _) = FRAME.split_once("[[storey]]").unwrap();
    format!(
        "places = [\"floor 1\", \"floor 2\"]\n{rest}[matrices]\nmass_file = \"m.csv\"\nstiffness_file = \"k.csv\"\n{damping}\n"
    )
}

#[test]
fn matrices_of_a_frame_move_like_its_storeys() {
    let answer_of = |text: &str| {
        let folder = folder(&MATRICES);
        std::fs::write(folder.path().join("case.toml"), text).unwrap();
        let output = damprig(&folder).args(["simulate", "case.toml", "--json"]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let rms = |answer: &Value| number(answer, "/summary/rms_x_m");
    let storeys = answer(FRAME, &[]);
    let by_file = answer_of(&of_matrices("damping_file = \"c.csv\""));
    assert!((rms(&by_file) / rms(&storeys) - 1.0).abs() < 1e-12, "{} {}", rms(&by_file), rms(&storeys));
    // The storeys' damping is 0.002 s times their stiffness.
    let rayleigh = answer_of(&of_matrices("mass_damping_per_s = 0\nstiffness_damping_s = 0.002"));
    assert!((rms(&rayleigh) / rms(&storeys) - 1.0).abs() < 1e-12);
    let still = answer_of(&of_matrices("damping_ratio = 0.01\ninfluence = [0, 0]"));
    assert_eq!(number(&still, "/summary/max_abs_x_m"), 0.0);
}

#[test]
fn a_matrix_that_is_none_is_refused_with_its_line() {
    let case = of_matrices("damping_file = \"c.csv\"");
    let refused = |name: &str, text: &str, words: &[&str]| {
        let of = |(other, usual): (&'static str, &'static str)| (other, if other == name { text } else { usual });
        let files: Vec<(&str, &str)> = MATRICES.into_iter().map(of).chain([("case.toml", &*case)]).collect();
        refused(&files, &["simulate", "case.toml"], words);
    };
    refused("m.csv", "100,0\n0\n", &["matrices.mass_file", "line 2", "2 numbers", "has 1"]);
    refused("m.csv", "100,0\n0,x\n", &["line 2, column 2", "\"x\""]);
    refused("m.csv", "100,0\n", &["2 lines", "has 1"]);
    refused("m.csv", "100,0\n0,0\n", &["`matrices.mass_file` = \"m.csv\"", "positive definite", "no mass", "condense"]);
    refused(
        "k.csv",
        "9e4,-4e4\n-3e4,4e4\n",
        &["`matrices.stiffness_file` = \"k.csv\"", "row 2, column 1", "symmetric"],
    );
    refused("k.csv", "4e4,-4e4\n-4e4,4e4\n", &["`matrices.stiffness_file`", "not held by any spring"]);
    refused("c.csv", "-180,80\n80,-80\n", &["`matrices.damping_file`", "damping has a negative part"]);
}

#[test]
fn a_sine_far_from_all_modes_is_warned_of_and_a_particle_has_its_mass_ratio() {
    let folder = folder(&MATRICES);
    let case = of_matrices("damping_file = \"c.csv\"") + PARTICLE;
    let said = |k: &str| {
        std::fs::write(folder.path().join("k.csv"), k).unwrap();
        std::fs::write(folder.path().join("case.toml"), &case).unwrap();
        let output = damprig(&folder).args(["simulate", "case.toml"]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        [output.stderr, output.stdout].map(|bytes| String::from_utf8(bytes).unwrap())
    };
    let [warned, text] = said("9e4,-4e4\n-4e4,4e4\n");
    assert!(!warned.contains("far from all modes"), "{warned}");
    assert!(text.contains("(mass ratio "), "{text}");
    // Newtons per millimetre in place of per metre.
    let [warned, _] = said("90,-40\n-40,40\n");
    assert!(warned.contains("far from all modes") && warned.contains("check the units"), "{warned}");
}

#[test]
fn a_beam_swings_at_its_first_frequency_in_its_first_shape() {
    // β₁² √(EI/ρA)/l² with cos β cosh β = −1.
    let omega: f64 = 1.875_104_068_711_961_2_f64.powi(2) * (4000.0_f64 / 4.0).sqrt() / 0.09;
    let period_s = TAU / omega;
    let case = format!("{BEAM}initial = {{ x_m = 1e-3 }}\nobserved_position_m = 0.3\n");
    let half = format!("run.sample_times_s=[{:?}, {:?}]", 0.5 * period_s, period_s);
    let answer = answer(&case, &["--set", &half, "--set", "beam.damping_ratio=0"]);
    assert!((number(&answer, "/case/multi_degree/modes/0/frequency_hz") * period_s - 1.0).abs() < 1e-12);
    assert!((number(&answer, "/x_m/0") + 1e-3).abs() < 1e-12 && (number(&answer, "/x_m/1") - 1e-3).abs() < 1e-12);
    assert!((number(&answer, "/summary/max_abs_x_m") - 1e-3).abs() < 1e-15);
}

#[test]
fn dampers_of_a_list_are_told_apart_and_set_by_their_numbers() {
    let second = PARTICLE.replace("floor 2", "floor 1");
    let case = format!("{FRAME}{PARTICLE}{second}")
        .replace("4.03", "2.3")
        .replace("clearance_m = 0.01", "clearance_m = 0.003");
    let answer_of = |more: &[&str]| answer(&case, more);
    let both = answer_of(&[]);
    let counts = [0, 1].map(|n| number(&both, &format!("/impact_dampers/{n}/impact_count")));
    assert!(counts[0] > 0.0 && number(&both, "/summary/impact_count") == counts[0] + counts[1], "{counts:?}");
    let listed = both["impacts"].as_array().unwrap();
    let of_second = listed.iter().filter(|impact| impact["damper"] == 2).count();
    assert_eq!(of_second as f64, counts[1]);
    let far = answer_of(&["--set", "particle.2.clearance_m=1"]);
    assert_eq!(number(&far, "/impact_dampers/1/impact_count"), 0.0);
    assert!(number(&far, "/impact_dampers/0/impact_count") > 0.0);
}

/// A column of a time history.
pub fn column(table: &[RecordBatch], name: &str) -> Vec<f64> {
    let of = |batch: &RecordBatch| {
        let column = batch.column_by_name(name).unwrap_or_else(|| panic!("{name}: {:?}", batch.schema()));
        column.as_primitive::<Float64Type>().values().to_vec()
    };
    table.iter().flat_map(of).collect()
}

pub fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most: f64, value| most.max(value.abs()))
}

#[test]
fn a_time_history_has_every_place_and_damper_and_agrees_with_their_largest_values() {
    const H_S: f64 = 1e-3;
    let lower = PARTICLE.replace("floor 2", "floor 1");
    for dampers in [String::new(), format!("{PARTICLE}{lower}")] {
        let case =
            format!("{FRAME}{dampers}").replace("4.03", "2.3").replace("clearance_m = 0.01", "clearance_m = 0.003");
        let folder = folder(&[("case.toml", &case)]);
        let mut command = damprig(&folder);
        command.args(["simulate", "case.toml", "--json", "--out", "motion.parquet", "--rate", "1000"]);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        let table = read_parquet(folder.path().join("motion.parquet"));
        let [z, seen, one, two, a_one, a_two] =
            ["z_m", "x_m", "x_1_m", "x_2_m", "acceleration_1_m_per_s2", "acceleration_2_m_per_s2"]
                .map(|name| column(&table, name));
        assert_eq!(seen, two);
        let drift = |upper: &[f64], lower: &[f64]| largest(upper.iter().zip(lower).map(|(a, b)| a - b));
        for (n, (x, below, a)) in [(&one, &z, &a_one), (&two, &one, &a_two)].into_iter().enumerate() {
            let of = |what: &str| number(&answer, &format!("/places/{n}/{what}"));
            let acceleration = of("max_abs_acceleration_m_per_s2");
            // Between two rows a displacement is larger than at them by at most x″ h²/8; of a difference both count.
            let between = H_S * H_S / 8.0 * (acceleration + number(&answer, "/places/0/max_abs_acceleration_m_per_s2"));
            let (most, drift) = (largest(x.iter().copied()), drift(x, below));
            let (max_abs_x_m, max_abs_drift_m) = (of("max_abs_x_m"), of("max_abs_drift_m"));
            assert!(most <= max_abs_x_m && max_abs_x_m <= most + between, "{most} {max_abs_x_m}");
            assert!(drift <= max_abs_drift_m && max_abs_drift_m <= drift + 2.0 * between, "{drift} {max_abs_drift_m}");
            assert!(largest(a.iter().copied()) <= acceleration);
            if dampers.is_empty() {
                // Its own change of slope bounds what the second difference of x is off, and what is between two rows.
                let bend =
                    |values: &[f64], row: usize| (values[row - 1] - 2.0 * values[row] + values[row + 1]) / (H_S * H_S);
                let rows = 1..a.len() - 1;
                let fourth = largest(rows.clone().map(|row| bend(a, row)));
                let off = largest(rows.map(|row| bend(x, row) - a[row]));
                assert!(off <= 1.1 * fourth * H_S * H_S / 12.0 + 1e-9, "{off} {fourth}");
                assert!(acceleration <= largest(a.iter().copied()) + 1.1 * fourth * H_S * H_S / 8.0);
            } else {
                let y = column(&table, &format!("y_{}_m", 2 - n));
                let apart = largest(y.iter().zip(x).map(|(y, x)| y - x));
                let count = number(&answer, &format!("/impact_dampers/{}/impact_count", 1 - n));
                // Between two rows a particle may touch a wall and leave it.
                assert!(apart <= 0.003 * (1.0 + 1e-9) && (count < 100.0 || apart > 0.002), "{apart}, {count} impacts");
            }
        }
    }
}

#[test]
fn a_study_and_an_optimisation_have_the_numbers_of_single_simulations() {
    let study = "case = \"case.toml\"\nmetrics = [\"mean_cycle_max_m\", \"max_abs_x_m\", \"impacts_per_cycle\"]\n\
                 [[axis]]\nkey = \"particle.1.clearance_m\"\nvalues = [0.005, 0.02]\n";
    let search = "case = \"case.toml\"\nobjective = \"mean_cycle_max_m\"\nevaluations = 100\n\
                  [[variable]]\nkey = \"particle.1.clearance_m\"\nfrom = 0.005\nto = 0.02\n";
    let case = format!("{FRAME}{PARTICLE}");
    let folder = folder(&[("case.toml", &case), ("study.toml", study), ("search.toml", search)]);
    let output = damprig(&folder).args(["study", "run", "study.toml", "--out", "made"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = read_parquet(folder.path().join("made/table.parquet"));
    let column =
        |name: &str, row: usize| table[0].column_by_name(name).unwrap().as_primitive::<Float64Type>().value(row);
    for (row, clearance) in ["0.005", "0.02"].into_iter().enumerate() {
        let single = answer(&case, &["--set", &format!("particle.1.clearance_m={clearance}")]);
        let (found, wanted) = (column("mean_cycle_max_m", row), mean_cycle_max_m(&single));
        assert!((found / wanted - 1.0).abs() < 1e-12, "{found} {wanted}");
        assert!(column("max_abs_x_m", row) <= number(&single, "/summary/max_abs_x_m"));
    }
    let output = damprig(&folder).args(["optimise", "search.toml", "--out", "best", "--json"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let best: Value = serde_json::from_slice(&output.stdout).unwrap();
    let at_best = format!("particle.1.clearance_m={:?}", number(&best, "/variables/0/value"));
    let single = mean_cycle_max_m(&answer(&case, &["--set", &at_best]));
    assert!((number(&best, "/objective") / single - 1.0).abs() < 1e-12, "{best}");
    assert!((number(&best, "/references/bare") / mean_cycle_max_m(&answer(FRAME, &[])) - 1.0).abs() < 1e-12);
    let tmd = "[tmd]\nplace = \"floor 2\"\nmass_kg = 6\ntuning = \"warburton\"\n";
    let with_tmd = mean_cycle_max_m(&answer(&format!("{FRAME}{tmd}"), &[]));
    assert!((number(&best, "/references/tmd/objective") / with_tmd - 1.0).abs() < 1e-12);
}

/// A particle at rest at a soft wall that sticking floors hardly move: contacts that are not told apart.
const NOT_TOLD_APART: &str = "\
force = { kind = \"sine\", amplitude_n = 1, frequency_hz = 8 }
run = { duration_s = 2 }
[[storey]]
mass_kg = 10
stiffness_n_per_m = 10000
damping_n_s_per_m = 4
[[storey]]
mass_kg = 20
stiffness_n_per_m = 4000
damping_n_s_per_m = 4
[[storey]]
mass_kg = 20
stiffness_n_per_m = 10000
damping_n_s_per_m = 4
[[particle]]
place = \"floor 1\"
mass_kg = 1
clearance_m = 0.004
wall = { kind = \"voigt\", stiffness_n_per_m = 1000, damping_n_s_per_m = 0, release = \"zero_force\" }
start = \"at_negative_wall\"
[[friction_damper]]
place = \"floor 3\"
force_n = 0.5
";

#[test]
fn contacts_that_are_not_told_apart_are_passed_in_few_steps_and_a_study_says_so() {
    let single = answer(NOT_TOLD_APART, &[]);
    let unresolved = number(&single, "/summary/unresolved");
    assert!(unresolved > 0.0 && unresolved < 500.0 && number(&single, "/summary/simulated_s") == 2.0, "{unresolved}");
    let study = "case = \"case.toml\"\nmetrics = [\"x_over_z\"]\n[[axis]]\nkey = \"friction_damper.force_n\"\nvalues = [0.5, 100]\n";
    let folder = folder(&[("case.toml", NOT_TOLD_APART), ("study.toml", study)]);
    let output = damprig(&folder).args(["study", "run", "study.toml", "--out", "made"]).output().unwrap();
    let [said, warned] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(output.status.success() && warned.contains("instants with too many events"), "{warned}");
    let best = said.lines().find(|line| line.starts_with("smallest x_over_z: ")).unwrap_or_else(|| panic!("{said}"));
    // A ratio has no unit.
    assert!(best.ends_with(" at") && best.split(' ').count() == 4, "{best}");
}

/// Two dampers with Hertz walls under noise: contacts that last, in text, results and table, with the damper that each is of. What needs derivatives
/// has hard walls in their place and says so.
#[test]
fn contacts_with_hertz_walls_last_on_frames_under_noise_too() {
    let wall = "wall = { kind = \"hertz\", stiffness_n_per_m15 = 1e8, lankarani_nikravesh_coefficient = 0.7 }";
    let dampers: String = ["floor 1", "floor 2"]
        .map(|place| format!("[[particle]]\nplace = \"{place}\"\nmass_kg = 3\nclearance_m = 0.002\n{wall}\n"))
        .concat();
    let sine = format!("{FRAME}{dampers}");
    let noise = "base = { kind = \"record\", noise = { seed = 7, from_hz = 0.5, to_hz = 10, duration_s = 4 }, target_peak_m = 0.004 }\n\
                 run = { duration_s = 4 }\n";
    let storeys = FRAME.find("[[storey]]").unwrap();
    let folder = folder(&[("noise.toml", &format!("{noise}{}{dampers}", &FRAME[storeys..])), ("sine.toml", &sine)]);
    let said = |arguments: &[&str]| {
        let output = damprig(&folder).args(arguments).assert().success();
        String::from_utf8_lossy(&output.get_output().stdout).into_owned()
    };
    let printed = said(&["simulate", "noise.toml", "--out", "motion.csv"]);
    assert!(printed.contains("contact time") && !printed.contains("acts as a hard wall"), "{printed}");
    let table = std::fs::read_to_string(folder.path().join("motion.contacts.csv")).unwrap().replace('\r', "");
    let (head, rows) = table.split_once('\n').unwrap();
    assert!(head.ends_with("restitution,damper"), "{head}");
    for damper in ["1", "2"] {
        assert!(rows.lines().filter(|row| row.rsplit_once(',').unwrap().1 == damper).count() > 3, "{rows}");
    }
    let answer: Value = serde_json::from_str(&said(&["simulate", "noise.toml", "--json"])).unwrap();
    assert_eq!(answer["contacts"].as_array().unwrap().len(), rows.lines().count());
    let printed = said(&["simulate", "sine.toml", "--analyse"]);
    assert!(printed.contains("acts as a hard wall"), "{printed}");
}

#[test]
fn what_a_structure_with_several_places_does_not_have_is_refused_with_a_reason() {
    let frame = |more: &str| format!("{FRAME}{more}");
    let top = |line: &str| format!("{line}\n{FRAME}{PARTICLE}");
    let simulate = ["simulate", "case.toml"];
    for (case, words) in [
        (frame(&PARTICLE.replace("floor 2", "flor 2")), &["particle[1].place", "\"floor 1\", \"floor 2\"", "did you mean"][..]),
        (frame(&PARTICLE.replace("place = \"floor 2\"\n", "")), &["`particle[1].place` is missing", "where the damper is mounted"]),
        (frame(&PARTICLE.replace("place = \"floor 2\"", "position_m = 0.2")), &["particle[1].position_m", "is for a beam"]),
        (top("structure = { mass_kg = 1, stiffness_n_per_m = 1, damping_ratio = 0 }"), &["`storey` and `structure` are both given", "one structure"]),
        (top("observed_place = \"roof\""), &["observed_place", "\"floor 1\", \"floor 2\""]),
        (top("initial = { y_m = 1 }"), &["initial.y_m", "`start_m` of the particle"]),
        (top("initial = { x_m = 1e-3, mode = 3 }"), &["initial.mode", "at most 2"]),
        (top("modal_damping_ratio = 0.01"), &["storey[1].damping_n_s_per_m", "`modal_damping_ratio` is given too"]),
        (top("places = [\"a\"]"), &["places", "goes with `mode`"]),
        (frame("[friction_damper]\nplace = \"floor 1\"\nother_place = \"floor 1\"\nforce_n = 2\n"), &["friction_damper.other_place", "another place than that of the damper"]),
        (frame("[particle]\nplace = \"floor 1\"\nmass_kg = 1\nclearance_m = 0.01\nstart_m = 0.02\nwall = { kind = \"restitution\", coefficient = 0.5 }\n"), &["particle.start_m", "within the clearance"]),
        ("[[storey]]\nmass_kg = 1\nstiffness_n_per_m = 1e3\n".repeat(201) + "[run]\nduration_s = 1\n", &["storey", "there are 201", "at most 200"]),
        (format!("{BEAM}[particle]\nposition_m = 0.4\nmass_kg = 1\nclearance_m = 0.01\nwall = {{ kind = \"restitution\", coefficient = 0.5 }}\n"), &["particle.position_m", "at most 0.3 m"]),
        (format!("{BEAM}[tmd]\nposition_m = 0\nmass_kg = 1\ntuning = \"den_hartog\"\n"), &["no mode moves the place"]),
        (format!("{BEAM}[tmd]\nplace = \"tip\"\nmass_kg = 1\ntuning = \"den_hartog\"\n"), &["tmd.place", "`position_m = …`"]),
        ("run = { duration_s = 1 }\nplaces = [\"a\", \"b\"]\n[[mode]]\nfrequency_hz = 3\ndamping_ratio = 0.01\nshape_per_root_kg = [1]\n".into(), &["mode[1].shape_per_root_kg", "each of the 2 `places`"]),
        ("run = { duration_s = 1 }\nplaces = [\"a\"]\nbase = { kind = \"sine\", amplitude_m = 1e-3, frequency_hz = 1 }\n[[mode]]\nfrequency_hz = 3\ndamping_ratio = 0.01\nshape_per_root_kg = [1]\n".into(), &["`mode[1].participation_root_kg` is missing", "`force`"]),
    ] {
        refused(&[("case.toml", &case)], &simulate, words);
    }
    let one = "structure = { mass_kg = 1, stiffness_n_per_m = 100, damping_ratio = 0 }\nrun = { duration_s = 1 }\n";
    refused(
        &[("case.toml", &format!("{one}{PARTICLE}"))],
        &simulate,
        &["`particle`", "must be one table here", "several of a kind are mounted"],
    );
    let placed = PARTICLE.replace("[[particle]]", "[particle]");
    refused(
        &[("case.toml", &format!("{one}{placed}"))],
        &simulate,
        &["particle.place", "several places", "leave it out"],
    );
}
