//! Keys of a case: equivalent keys give equal motions, forces and records match closed forms, invalid values are refused with
//! key, value, allowed range and likely fix.

use std::f64::consts::TAU;
use std::fmt::Write;

use crate::common::damprig;
use serde_json::Value;
use tempfile::TempDir;

const UNDAMPED: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0 }\n";
const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
const SINE: &str = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.3 }\n";
const RUN: &str = "run = { duration_s = 8, sample_times_s = [0.4, 1.7, 3.1, 5.03, 8], cycle_s = 0.4 }\n";

/// A folder for cases and records.
struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn with(self, name: &str, text: &str) -> Self {
        std::fs::write(self.0.path().join(name), text).unwrap();
        self
    }

    fn output(&self, case: &str) -> std::process::Output {
        std::fs::write(self.0.path().join("case.toml"), case).unwrap();
        damprig(&self.0).args(["simulate", "case.toml", "--json"]).output().unwrap()
    }

    fn answer(&self, case: &str) -> Value {
        let output = self.output(case);
        assert!(output.status.success(), "{case}\n{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// The case must be refused with all of `words`.
    fn refused(&self, case: &str, words: &[&str]) {
        let output = self.output(case);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{case}\n{told}");
        for word in words {
            assert!(told.contains(word), "no {word:?} in:\n{told}");
        }
    }
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}

/// The largest difference of x and y, relative to the largest |x|.
fn apart(a: &Value, b: &Value) -> f64 {
    let scale = a["summary"]["max_abs_x_m"].as_f64().unwrap();
    let differ = |key: &str| {
        let pairs = numbers(&a[key]).into_iter().zip(numbers(&b[key]));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    differ("x_m").max(differ("y_m")) / scale
}

fn voigt(wall: &str) -> String {
    format!(
        "{STRUCTURE}{SINE}{RUN}[particle]\nmass_ratio = 0.1\nclearance_m = 0.01\nwall = {{ kind = \"voigt\", {wall} }}\n"
    )
}

#[test]
fn a_wall_may_be_given_by_its_material_its_modulus_or_its_spring() {
    let bench = Bench::new();
    let omega = TAU * 2.5;
    let c1 = 43_436.0 * 0.164 / omega;
    let spring = bench
        .answer(&voigt(&format!("stiffness_n_per_m = 43436, damping_n_s_per_m = {c1:?}, release = \"zero_force\"")));
    assert!(spring["summary"]["impact_count"].as_u64() > Some(5));
    for wall in [
        "material = \"rubber\", release = \"zero_force\"",
        "storage_modulus_pa = 868720, shape_factor_m = 0.05, loss_factor = 0.164, release = \"zero_force\"",
        "stiffness_n_per_m = 43436, loss_factor = 0.164, law = \"natural\", release = \"zero_force\"",
    ] {
        let off = apart(&spring, &bench.answer(&voigt(wall)));
        assert!(off < 1e-9, "{wall}: {off:e}");
    }
    let other =
        apart(&spring, &bench.answer(&voigt("material = \"rubber\", law = \"contact\", release = \"zero_force\"")));
    assert!(other > 1e-3, "another law is another wall: {other:e}");
}

#[test]
fn contradictory_keys_of_a_wall_are_refused() {
    let bench = Bench::new();
    let near = ["`particle.wall.material` = \"ruber\" is not allowed", "did you mean \"rubber\"?"];
    bench.refused(&voigt("material = \"ruber\", release = \"zero_force\""), &near);
    let twice = ["`particle.wall.stiffness_n_per_m` = 5", "`material` is given too, and says the same quantity"];
    bench.refused(&voigt("material = \"rubber\", stiffness_n_per_m = 5, release = \"zero_force\""), &twice);
    let half = ["`particle.wall.shape_factor_m` is missing", "needs both"];
    bench.refused(&voigt("storage_modulus_pa = 1e5, loss_factor = 0.1, release = \"zero_force\""), &half);
    let lossless = ["`particle.wall.damping_n_s_per_m` is missing", "loss_factor"];
    bench.refused(&voigt("stiffness_n_per_m = 1e3, release = \"zero_force\""), &lossless);
    let law = ["`particle.wall.law`", "\"natural\" or \"contact\" or \"natural_hz\""];
    bench.refused(&voigt("material = \"rubber\", law = \"hertz\", release = \"zero_force\""), &law);
    let idle = ["`particle.wall.law`", "`damping_n_s_per_m`"];
    let wall = "stiffness_n_per_m = 1e3, damping_n_s_per_m = 1, law = \"contact\", release = \"zero_force\"";
    bench.refused(&voigt(wall), &idle);
    let negative = ["`particle.wall.stiffness_n_per_m` = -1e3 is not allowed", "must be greater than 0"];
    bench.refused(&voigt("stiffness_n_per_m = -1e3, damping_n_s_per_m = 1, release = \"zero_force\""), &negative);
}

#[test]
fn a_tuned_mass_may_be_given_by_its_rule_its_ratios_or_its_spring() {
    let bench = Bench::new();
    let case = |tmd: &str| format!("{STRUCTURE}{SINE}{RUN}tmd = {{ {tmd} }}\n");
    let rule = bench.answer(&case("mass_ratio = 0.1, tuning = \"den_hartog\""));
    let spring = case("mass_kg = 0.16, stiffness_n_per_m = 32.62679140855987, damping_n_s_per_m = 0.843716342792915");
    let zeta: f64 = (0.3_f64 / 8.8).sqrt();
    let ratios = case(&format!("mass_ratio = 0.1, frequency_ratio = {:?}, damping_ratio = {zeta:?}", 1.0 / 1.1));
    for other in [spring, ratios] {
        let off = apart(&rule, &bench.answer(&other));
        assert!(off < 1e-12, "{other}: {off:e}");
    }
    let near = ["`tmd.tuning` = \"denhartog\"", "did you mean \"den_hartog\"?"];
    bench.refused(&case("mass_ratio = 0.1, tuning = \"denhartog\""), &near);
    let both = ["`tmd.damping_ratio` = 0.1", "`tuning` is given too"];
    bench.refused(&case("mass_ratio = 0.1, tuning = \"warburton\", damping_ratio = 0.1"), &both);
    let range = ["tmd", "less than 2"];
    bench.refused(&case("mass_ratio = 2, tuning = \"warburton\""), &range);
}

#[test]
fn a_force_moves_an_undamped_structure_like_a_base_with_the_same_spring_force() {
    let bench = Bench::new();
    let stiffness = 1.6 * (TAU * 2.5).powi(2);
    for (force, base) in [
        (
            "kind = \"half_sine\", amplitude_n = F, duration_s = 0.3",
            "kind = \"half_sine\", amplitude_m = 0.05, duration_s = 0.3",
        ),
        ("kind = \"sine\", amplitude_n = F, frequency_hz = 2", "kind = \"sine\", amplitude_m = 0.05, frequency_hz = 2"),
    ] {
        let force = force.replace('F', &format!("{:?}", 0.05 * stiffness));
        let pushed = bench.answer(&format!("{UNDAMPED}{RUN}force = {{ {force} }}\n"));
        let shaken = bench.answer(&format!("{UNDAMPED}{RUN}base = {{ {base} }}\n"));
        let off = apart(&pushed, &shaken);
        assert!(off < 1e-12, "{force}: {off:e}");
        let largest = |key: &str| pushed["summary"][key].as_f64().unwrap();
        let moved = largest("max_abs_x_minus_z_m") / largest("max_abs_x_m") - 1.0;
        assert!(moved.abs() < 1e-14, "the base of a pushed structure is fixed: {moved:e}");
    }
}

#[test]
fn a_sine_of_the_base_and_a_force_move_an_undamped_structure_like_the_base_that_exerts_both() {
    let bench = Bench::new();
    let stiffness = 1.6 * (TAU * 2.5).powi(2);
    // 3 mm sin Ωt + 2 mm sin(Ωt + 0.7).
    let (along, across) = (3e-3 + 2e-3 * 0.7_f64.cos(), 2e-3 * 0.7_f64.sin());
    let (amplitude_m, phase_rad) = (along.hypot(across), across.atan2(along));
    let base = format!(
        "base = {{ kind = \"sine\", amplitude_m = {amplitude_m:?}, frequency_hz = 2.3, phase_rad = {phase_rad:?} }}\n"
    );
    let force = format!("force = {{ kind = \"sine\", amplitude_n = {:?}, phase_rad = 0.7 }}\n", 2e-3 * stiffness);
    for damper in [
        "",
        "tmd = { mass_ratio = 0.1, tuning = \"warburton\" }\n",
        "particle = { mass_ratio = 0.1, clearance_m = 0.02, wall = { kind = \"restitution\", coefficient = 0.5 } }\n",
    ] {
        let one = bench.answer(&format!("{UNDAMPED}{damper}{RUN}{base}"));
        let both = bench.answer(&format!("{UNDAMPED}{damper}{RUN}{SINE}{force}"));
        // Rounding at impacts may grow in 8 s; without them it does not.
        let off = apart(&one, &both);
        assert!(off < if damper.starts_with("particle") { 1e-9 } else { 1e-12 }, "{damper}: {off:e}");
        assert_eq!(one["summary"]["impact_count"], both["summary"]["impact_count"]);
    }
}

#[test]
fn a_force_beside_a_moving_base_is_a_sine_of_its_frequency() {
    let force = "force = { kind = \"half_sine\", amplitude_n = 1, duration_s = 0.1 }\n";
    Bench::new().refused(&format!("{STRUCTURE}{SINE}{RUN}{force}"), &["`force.kind`", "the force is a sine"]);
    let sine = "force = { kind = \"sine\", amplitude_n = 1, frequency_hz = 2 }\n";
    let frequency = ["`force.frequency_hz` = 2", "the force has the base's frequency", "leave it out"];
    Bench::new().refused(&format!("{STRUCTURE}{SINE}{RUN}{sine}"), &frequency);
    let missing = ["frequency_hz", "is missing"];
    Bench::new().refused(&format!("{STRUCTURE}{RUN}{}", sine.replace(", frequency_hz = 2", "")), &missing);
    let words = ["`force` and a moving `base` are both given", "if both are sines"];
    let pulse = SINE.replace("sine", "versine").replace("frequency_hz = 2.3", "duration_s = 0.1");
    Bench::new().refused(&format!("{STRUCTURE}{pulse}{RUN}{sine}"), &words);
    let spheres = "many_particles = { count = 4, diameter_m = 0.01, mass_ratio = 0.1, restitution = 0.5, stiffness_n_per_m = 10000, \
                   clearance_m = 0.01, width_m = 0.03, height_m = 0.03 }\n";
    let beside = sine.replace(", frequency_hz = 2", "");
    let words = ["`force` beside a moving `base`", "spheres in a box"];
    Bench::new().refused(&format!("{STRUCTURE}{spheres}{SINE}{RUN}{beside}"), &words);
    let kind = ["`force.kind` = \"half-sine\"", "did you mean \"half_sine\"?"];
    Bench::new().refused(&format!("{STRUCTURE}{RUN}{}", force.replace("half_sine", "half-sine")), &kind);
}

/// The base of [`SINE`], sampled every `step_s`, as a CSV of time and displacement in mm.
fn sampled_sine(step_s: f64) -> String {
    let mut text = String::from("# a sine\ntime_s,base_mm\n");
    for n in 0..=(8.0 / step_s) as u32 {
        let t = step_s * f64::from(n);
        writeln!(text, "{t:.6},{:.17}", 3.0 * (TAU * 2.3 * t).sin()).unwrap();
    }
    text
}

#[test]
fn a_sampled_sine_moves_every_set_up_like_the_sine() {
    let bench = Bench::new().with("sine.csv", &sampled_sine(1e-3));
    let record = "base = { kind = \"record\", file = \"sine.csv\", quantity = \"displacement\", unit = \"mm\" }\n";
    let walls = |wall: &str| format!("particle = {{ mass_ratio = 0.1, clearance_m = 0.02, wall = {{ {wall} }} }}\n");
    let set_ups = [
        String::new(),
        "friction_damper = { force_n = 0.4 }\n".into(),
        walls("kind = \"restitution\", coefficient = 0.5"),
        walls("kind = \"voigt\", material = \"pu_foam\", release = \"zero_force\""),
        walls("kind = \"voigt\", material = \"rubber\", release = \"zero_penetration\""),
        "tmd = { mass_ratio = 0.1, tuning = \"warburton\" }\n".into(),
    ];
    for set_up in set_ups {
        let closed = bench.answer(&format!("{STRUCTURE}{SINE}{RUN}{set_up}"));
        let played = bench.answer(&format!("{STRUCTURE}{record}{RUN}{set_up}"));
        let off = apart(&closed, &played);
        println!("{}: {off:.1e}", set_up.trim());
        // Between samples the base is off by (Ωh)³/50 = 6e-8 of Z, at the start, where its velocity jumps, by Ωh/7 of a step.
        assert!(off < 2e-4, "{set_up}: {off:e}");
        for key in ["rms_x_m", "max_abs_x_minus_z_m", "peak_contact_force_n", "first_contact_restitution"] {
            let (a, b) = (&closed["summary"][key], &played["summary"][key]);
            assert_eq!(a.is_null(), b.is_null(), "{set_up}: {key}");
            if let (Some(a), Some(b)) = (a.as_f64(), b.as_f64()) {
                assert!((b / a - 1.0).abs() < 2e-3, "{set_up}: {key} {a} {b}");
            }
        }
        assert_eq!(closed["summary"]["impact_count"], played["summary"]["impact_count"], "{set_up}");
    }
}

#[test]
fn a_constant_acceleration_gives_the_closed_form() {
    // x − z of an undamped structure: −a/ω² (1 − cos ωt), and z = ½at².
    let bench = Bench::new().with("step.csv", "10\n10\n10\n10\n");
    let record = "base = { kind = \"record\", file = \"step.csv\", quantity = \"acceleration\", unit = \"cm/s2\", time_step_s = 1 }\n";
    let times = [0.1, 0.77, 1.5, 3.0];
    let answer = bench.answer(&format!("{UNDAMPED}{record}run = {{ sample_times_s = {times:?} }}\n"));
    assert_eq!(answer["summary"]["simulated_s"].as_f64(), Some(3.0), "the record says how long");
    let omega = TAU * 2.5;
    for (x, t) in numbers(&answer["x_m"]).into_iter().zip(times) {
        let closed = 0.5 * 0.1 * t * t - 0.1 / (omega * omega) * (1.0 - (omega * t).cos());
        assert!((x - closed).abs() < 1e-9, "x({t}) = {x}, not {closed}");
    }
    let largest = answer["summary"]["max_abs_x_minus_z_m"].as_f64().unwrap();
    assert!((largest / (0.2 / (omega * omega)) - 1.0).abs() < 1e-9, "{largest}");
}

const AT2: &str = "PEER NGA STRONG MOTION DATABASE RECORD\nNowhere, 1/1/2000, Bench, 0\n\
                   ACCELERATION TIME SERIES IN UNITS OF G\nNPTS=   7, DT=   .0500 SEC,\n\
                   .1000000E-01  -.2000000E-01   .3000000E+00   .1500000E+00  -.4000000E+00\n   .5000000E-01   .0000000E+00\n";

#[test]
fn an_at2_file_is_the_same_record_as_its_values_in_g() {
    let values = "0.01\n-0.02\n0.3\n0.15\n-0.4\n0.05\n0\n";
    let bench = Bench::new().with("shake.AT2", AT2).with("shake.txt", values);
    let run = "run = { duration_s = 2, sample_times_s = [0.2, 1, 2] }\n";
    let at2 = bench.answer(&format!("{STRUCTURE}{run}base = {{ kind = \"record\", file = \"shake.AT2\" }}\n"));
    let text = "kind = \"record\", file = \"shake.txt\", quantity = \"acceleration\", unit = \"g\", time_step_s = 0.05";
    let csv = bench.answer(&format!("{STRUCTURE}{run}base = {{ {text} }}\n"));
    for part in ["x_m", "v_m_per_s", "summary"] {
        assert_eq!(at2[part], csv[part], "{part}");
    }
    let other = text.replace("unit = \"g\"", "unit = \"m/s2\", scale = 9.80665");
    assert!(apart(&at2, &bench.answer(&format!("{STRUCTURE}{run}base = {{ {other} }}\n"))) < 1e-14);
}

#[test]
fn columns_are_found_by_number_and_by_name() {
    let table = "n;time;a;b\n1;0.0;9;0.1\n2;0.1;9;0.2\n3;0.2;9;-0.1\n";
    let bench = Bench::new().with("t.csv", table).with("b.csv", "0.1\n0.2\n-0.1\n");
    let base = |keys: &str| {
        format!(
            "{STRUCTURE}run = {{ duration_s = 1, sample_times_s = [1] }}\n\
             base = {{ kind = \"record\", quantity = \"acceleration\", unit = \"m/s2\", {keys} }}\n"
        )
    };
    let plain = bench.answer(&base("file = \"b.csv\", time_step_s = 0.1"));
    let named = bench.answer(&base("file = \"t.csv\", time_column = \"time\", column = \"b\""));
    let placed = bench.answer(&base("file = \"t.csv\", time_column = 2, column = 4"));
    assert!(apart(&plain, &named) < 1e-12 && apart(&plain, &placed) < 1e-12);
    bench.refused(&base("file = \"t.csv\", time_column = \"time\""), &["4 columns (n, time, a, b)", "`column`"]);
    let near = ["`column` = \"B\" is not allowed: the columns are n, time, a, b", "did you mean \"b\"?"];
    bench.refused(&base("file = \"t.csv\", time_column = \"time\", column = \"B\""), &near);
    bench.refused(&base("file = \"t.csv\", time_column = 2, column = 5"), &["`column` = 5", "1 to 4"]);
    bench.refused(&base("file = \"b.csv\""), &["one column and no time in it", "`time_step_s`"]);
}

#[test]
fn an_invalid_record_is_refused_with_file_line_and_value() {
    let base = |file: &str| {
        format!(
            "{STRUCTURE}{RUN}base = {{ kind = \"record\", file = \"{file}\", quantity = \"acceleration\", unit = \"g\" }}\n"
        )
    };
    let cut = AT2.replace("   .5000000E-01   .0000000E+00\n", "");
    let bench = Bench::new()
        .with("cut.at2", &cut)
        .with("nan.at2", &AT2.replace(".3000000E+00", "NaN"))
        .with("nohead.at2", "1 2 3\n4 5 6\n")
        .with("nan.csv", "time,a\n0,1\n0.1,nan\n")
        .with("back.csv", "0,1\n0.1,2\n0.1,3\n")
        .with("gap.csv", "0,1\n0.1,2\n0.2,3\n0.4,3\n0.5,3\n")
        .with("ragged.csv", "time,a\n0,1\n0.1\n")
        .with("word.csv", "time,a\n0,1\n0.1,two\n")
        .with("short.csv", "0,1\n")
        .with("empty.csv", "");
    bench.refused(&base("cut.at2"), &["cut.at2", "5 values, but line 4 says NPTS = 7", "cut short"]);
    bench.refused(&base("nan.at2"), &["nan.at2", "line 5", "\"NaN\" is not allowed"]);
    bench.refused(&base("nohead.at2"), &["nohead.at2", "NPTS"]);
    bench.refused(&base("nan.csv"), &["nan.csv", "line 3, column 2", "\"nan\" is not allowed"]);
    bench.refused(&base("back.csv"), &["back.csv", "line 3", "time 0.1 is not allowed", "later than the one before"]);
    bench.refused(&base("gap.csv"), &["gap.csv", "evenly spaced", "resample"]);
    bench.refused(&base("ragged.csv"), &["ragged.csv", "line 3", "1 columns where the first row has 2"]);
    bench.refused(&base("word.csv"), &["word.csv", "line 3, column 2", "\"two\" is not allowed"]);
    bench.refused(&base("short.csv"), &["short.csv", "2"]);
    bench.refused(&base("empty.csv"), &["empty.csv"]);
    bench.refused(&base("wrod.csv"), &["cannot read", "wrod.csv", "did you mean", "word.csv"]);
    bench.refused(&base("nan.csv").replace("unit = \"g\"", "unit = \"mm\""), &["`base.unit` = \"mm\"", "\"m/s2\""]);
    bench.refused(&base("nan.csv").replace(", unit = \"g\"", ""), &["unit of the values is not known", "\"cm/s2\""]);
    let no_file = format!("{STRUCTURE}{RUN}base = {{ kind = \"record\" }}\n");
    bench.refused(&no_file, &["`base.file` is missing", "CSV, AT2"]);
}

#[test]
fn a_structure_too_fast_for_its_record_is_refused() {
    let bench = Bench::new().with("slow.csv", "0\n1\n0\n");
    let fast = STRUCTURE.replace("2.5", "2500");
    let base = "base = { kind = \"record\", file = \"slow.csv\", quantity = \"displacement\", unit = \"mm\", time_step_s = 1 }\n";
    bench.refused(&format!("{fast}{RUN}{base}"), &["`structure.natural_frequency_hz` = 2500", "sampling rate"]);
}

#[test]
fn wrong_keys_and_values_are_refused_with_what_is_allowed() {
    let bench = Bench::new();
    let spid = |particle: &str| {
        format!(
            "{STRUCTURE}{SINE}{RUN}particle = {{ mass_ratio = 0.1, {particle}, wall = {{ kind = \"restitution\", coefficient = 0.5 }} }}\n"
        )
    };
    let unit = ["unknown key `particle.clearance_mm`", "write `clearance_m = 0.03`"];
    bench.refused(&spid("clearance_mm = 30"), &unit);
    let outside = format!("{}initial = {{ y_m = 0.05 }}\n", spid("clearance_m = 0.03"));
    bench.refused(&outside, &["`initial.y_m` = 0.05 is not allowed", "within particle.clearance_m"]);
    let bouncy = spid("clearance_m = 0.03").replace("coefficient = 0.5", "coefficient = 1.01");
    bench.refused(&bouncy, &["`particle.wall.coefficient` = 1.01", "from 0 to 1"]);
    let both = format!("{}tmd = {{ mass_ratio = 0.1, tuning = \"den_hartog\" }}\n", spid("clearance_m = 0.03"));
    bench.refused(&both, &["`tmd` and `particle` are both given"]);
    let kind = format!("{STRUCTURE}{RUN}base = {{ kind = \"recrod\", file = \"a.csv\" }}\n");
    bench.refused(&kind, &["`base.kind` = \"recrod\"", "did you mean \"record\"?"]);
    bench.refused(
        &format!("{STRUCTURE}{SINE}run = {{ duration_s = -1 }}\n"),
        &["`run.duration_s` = -1", "greater than 0"],
    );
    bench.refused(&format!("{STRUCTURE}{SINE}"), &["`run` is missing"]);
}

/// A particle over a wall that accelerates evenly is a bouncing ball: its chatter ends at √(2h/a) (1+e)/(1−e).
fn check_bouncing_ball(bench: &Bench, case: &str, end_s: f64, tolerance: f64) {
    let answer = bench.answer(case);
    let ends = answer["accumulations"].as_array().expect("a chatter ends");
    assert_eq!((ends.len(), answer["summary"]["accumulation_count"].as_u64()), (1, Some(1)), "{answer}");
    assert_eq!(ends[0]["side"].as_i64(), Some(-1));
    let found_s = ends[0]["t_s"].as_f64().unwrap();
    assert!((found_s / end_s - 1.0).abs() < tolerance, "{found_s} {end_s}");
    let text = damprig(&bench.0).args(["simulate", "case.toml", "--out", "motion.csv"]).output().unwrap();
    let text = String::from_utf8_lossy(&text.stdout).to_string();
    let line = text.lines().find(|line| line.contains("accumulations")).expect("a line says so");
    assert!(line.contains(" 1; the particle came to rest on a wall at "), "{line}");
    let table = std::fs::read_to_string(bench.0.path().join("motion.accumulations.csv")).unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!((rows.len(), rows[0]), (2, "t_s,side"), "{table}");
    assert!(rows[1].starts_with(&format!("{found_s:.9}")[..9]) && rows[1].ends_with(",-1"), "{table}");
}

#[test]
fn a_chatter_that_ends_in_rest_is_reported_in_text_json_and_a_table() {
    let (e, d, pull): (f64, f64, f64) = (0.6, 0.05, 2.0);
    let end_s = (2.0 * d / pull).sqrt() * (1.0 + e) / (1.0 - e);
    let particle =
        format!("[particle]\nclearance_m = {d}\nwall = {{ kind = \"restitution\", coefficient = {e} }}\nmass_kg = ");
    // The structure is so heavy, soft and slow that its acceleration is constant.
    let heavy =
        "structure = { mass_kg = 1e9, stiffness_n_per_m = 1e-6, damping_n_s_per_m = 0 }\nrun = { duration_s = 1.5 }\n";
    let force = format!(
        "force = {{ kind = \"sine\", amplitude_n = {:?}, angular_frequency_rad_per_s = 1e-9, phase_rad = {:?} }}\n",
        1e9 * pull,
        TAU / 4.0
    );
    check_bouncing_ball(&Bench::new(), &format!("{heavy}{force}{particle}1e-9\n"), end_s, 1e-9);
    // On a record, with a friction damper that never slips.
    let mut rows = String::from("time_s,acceleration_m_per_s2\n");
    for n in 0..=400 {
        let _ = writeln!(rows, "{},{pull}", f64::from(n) * 0.005);
    }
    let carried = "structure = { mass_kg = 1e6, natural_frequency_hz = 1, damping_ratio = 0 }\n\
         friction_damper = { force_n = 1e12 }\nrun = { duration_s = 1.5 }\n\
         base = { kind = \"record\", file = \"even.csv\", quantity = \"acceleration\", unit = \"m/s2\" }\n";
    // The last bounce that the driver distinguishes from rest: 1e-7 s before the end.
    let bench = Bench::new().with("even.csv", &rows);
    check_bouncing_ball(&bench, &format!("{carried}{particle}1e-9\n"), end_s, 1e-6);
}

#[test]
fn an_impact_at_the_start_gives_the_structure_its_share_of_the_momentum() {
    let particle =
        "particle = { mass_ratio = 0.1, clearance_m = 0.03, wall = { kind = \"restitution\", coefficient = 0.5 } }\n";
    let run = "initial = { v_m_per_s = -0.01, y_m = 0.03, u_m_per_s = 1 }\nrun = { duration_s = 1, sample_times_s = [1e-9] }\n";
    let answer = Bench::new().answer(&format!("{STRUCTURE}{particle}{run}"));
    // −0.01 + 0.1/1.1 · 1.5 · 1.01
    assert!((numbers(&answer["v_m_per_s"])[0] - 0.127_727_272_727_272_7).abs() < 1e-8, "{answer}");
    assert!((numbers(&answer["u_m_per_s"])[0] + 0.377_272_727_272_727_3).abs() < 1e-8, "{answer}");
}

#[test]
fn a_particle_at_rest_on_a_soft_wall_has_no_impacts() {
    for (sign, base) in [
        ("", "base = { kind = \"versine\", amplitude_m = 0.02, duration_s = 0.3 }\n"),
        ("-", "base = { kind = \"versine\", amplitude_m = 0.02, duration_s = 0.3 }\n"),
        ("-", "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.3 }\n"),
        ("", "base = { kind = \"half_sine\", amplitude_m = 0.02, duration_s = 0.3 }\n"),
    ] {
        let wall =
            "wall = { kind = \"voigt\", stiffness_n_per_m = 2000, damping_n_s_per_m = 2, release = \"zero_force\" }";
        let particle = format!("particle = {{ mass_ratio = 0.1, clearance_m = 0.01, {wall} }}\n");
        let run = format!("initial = {{ y_m = {sign}0.01 }}\nrun = {{ duration_s = 5 }}\n");
        let answer = Bench::new().answer(&format!("{STRUCTURE}{particle}{base}{run}"));
        assert!(answer["summary"].get("unresolved").is_none(), "{answer}");
        for impact in answer["impacts"].as_array().unwrap() {
            assert!(impact["approach_speed_m_per_s"].as_f64() > Some(1e-6), "{sign} {base}: {impact}");
        }
        assert!(answer["summary"]["impact_count"].as_u64() > Some(2), "{answer}");
    }
}
