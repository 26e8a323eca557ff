//! Walls as they are, in cases and campaigns: restitution that falls with the speed of the impact, two different walls, a cavity off
//! its centre, inclined or upright.

use damprig::campaign::Campaign;
use damprig::input::Source;
use damprig::simulation::Case;
use damprig_core::model::{Cavity, Release, Restitution, SetUp, SpeedTable, Wall};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::damprig;

pub const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
pub const DRIVE: &str =
    "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\nrun = { duration_s = 8 }\n";
const FALLING: &str = "wall = { kind = \"restitution\", coefficient = 0.6, exponent = 0.25, reference_speed_m_per_s = 0.5, maximum = 0.9 }";

fn case(particle: &str) -> String {
    format!("{STRUCTURE}{DRIVE}particle = {{ mass_ratio = 0.1, clearance_m = 0.03, {particle} }}\n")
}

fn read(particle: &str) -> SetUp {
    Case::parse(&Source::new("case.toml", case(particle)), "case").expect("a case").set_up
}

/// Simulates a case: whether that succeeds, what is printed and what is told.
pub fn run(folder: &TempDir, text: &str, arguments: &[&str]) -> (bool, String, String) {
    std::fs::write(folder.path().join("case.toml"), text).unwrap();
    let output = damprig(folder).args(["simulate", "case.toml"]).args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.success(), text(&output.stdout), text(&output.stderr))
}

fn answer(particle: &str) -> Value {
    let folder = TempDir::new().unwrap();
    let (is_done, out, told) = run(&folder, &case(particle), &["--json"]);
    assert!(is_done, "{told}");
    serde_json::from_str(&out).unwrap()
}

fn refused(particle: &str, words: &[&str]) {
    let (is_done, _, told) = run(&TempDir::new().unwrap(), &case(particle), &[]);
    assert!(!is_done, "{particle} is accepted");
    for word in words {
        assert!(told.contains(word), "no {word:?} in:\n{told}");
    }
}

#[test]
fn a_case_and_a_campaign_read_the_same_falling_restitution() {
    let law = Restitution { coefficient: 0.6, reference_speed_m_per_s: 0.5, exponent: 0.25, maximum: 0.9 };
    let wall = read(FALLING).particle.expect("it has one").wall;
    assert_eq!(wall, Wall::SpeedRestitution(law));
    assert_eq!(in_campaign(FALLING).particle.expect("it has one").wall, wall);
}

const TABLE: &str =
    "wall = { kind = \"restitution\", speeds_m_per_s = [0.1, 0.5, 2], coefficients = [0.9, 0.75, 0.6] }";

#[test]
fn a_case_and_a_campaign_read_the_same_table_of_restitution() {
    let table = SpeedTable::new(&[[0.1, 0.9], [0.5, 0.75], [2.0, 0.6]]).expect("three points");
    let set_up = read(TABLE);
    assert_eq!(set_up.particle.expect("it has one").wall, Wall::TableRestitution(table));
    assert_eq!(in_campaign(TABLE).particle, set_up.particle);
    let text = serde_json::to_string(&set_up).unwrap();
    assert_eq!(serde_json::from_str::<SetUp>(&text).unwrap(), set_up, "{text}");
}

#[test]
fn a_level_table_gives_the_numbers_of_the_constant_coefficient() {
    let level = "wall = { kind = \"restitution\", speeds_m_per_s = [0.1, 2], coefficients = [0.6, 0.6] }";
    let constant = answer("wall = { kind = \"restitution\", coefficient = 0.6 }");
    assert_eq!(constant["summary"], answer(level)["summary"]);
    assert_ne!(constant["summary"], answer(TABLE)["summary"]);
}

#[test]
fn a_table_is_in_the_text_of_a_simulation_and_in_its_analysis() {
    let folder = TempDir::new().unwrap();
    let (is_done, out, told) = run(&folder, &case(TABLE), &["--set", "run.duration_s=40", "--analyse"]);
    assert!(is_done, "{told}");
    assert!(out.contains("e = 0.9 at 0.1 m/s, 0.75 at 0.5 m/s, 0.6 at 2 m/s"), "{out}");
}

#[test]
fn values_of_a_table_that_are_missing_or_not_allowed_are_named() {
    let wall = |keys: &str| format!("wall = {{ kind = \"restitution\", {keys} }}");
    refused(&wall("coefficients = [0.9, 0.6]"), &["particle.wall", "speeds_m_per_s"]);
    refused(&wall("speeds_m_per_s = [0.1, 0.6]"), &["coefficient"]);
    refused(&wall("coefficient = 0.5, speeds_m_per_s = [0.1, 0.6]"), &["speeds_m_per_s", "coefficients"]);
    refused(&wall("coefficient = 0.5, coefficients = [0.9, 0.6], speeds_m_per_s = [0.1, 2]"), &["leave out"]);
    refused(
        &wall("coefficients = [0.9, 0.6], speeds_m_per_s = [0.1, 2], exponent = 0.2"),
        &["exponent", "coefficients"],
    );
    refused(
        &wall("coefficients = [0.9, 0.6, 0.5], speeds_m_per_s = [0.1, 2]"),
        &["must be 2 to 6 numbers, one for each of `speeds_m_per_s`; there are 3 for 2 speeds", "case.toml:4"],
    );
    refused(&wall("coefficients = [0.9], speeds_m_per_s = [0.1]"), &["must be 2 to 6 numbers"]);
    refused(
        &wall("coefficients = [0.9, 0.8, 0.5], speeds_m_per_s = [0.5, 1, 1.2]"),
        &["`particle.wall.coefficients` = 0.5 is not allowed", "never falls", "write at least 0.6858 at 1.2 m/s"],
    );
    refused(
        &wall("coefficients = [0.9, 0.8, 0.7], speeds_m_per_s = [0.5, 1.5, 1]"),
        &["`particle.wall.speeds_m_per_s` = 1 is not allowed", "1.001 times the speed before"],
    );
    refused(
        &wall("coefficients = [1, 0.8], speeds_m_per_s = [0.5, 1.5]"),
        &["`particle.wall.coefficients` = 1 is not allowed", "less than 1"],
    );
}

/// A particle of 0.16 kg that flies at 0.5 m/s from the middle of a structure of 1.6 kg at rest, against the wall at `side`.
fn one_impact(side: f64, walls: &str) -> Value {
    let text = format!(
        "{STRUCTURE}particle = {{ mass_kg = 0.16, clearance_m = 0.03, {walls} }}\n\
         initial = {{ u_m_per_s = {} }}\nrun = {{ duration_s = 0.1 }}\n",
        0.5 * side
    );
    let (is_done, out, told) = run(&TempDir::new().unwrap(), &text, &["--json"]);
    assert!(is_done, "{told}");
    let answer: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(answer["summary"]["impact_count"], 1);
    answer["summary"]["peak_contact_force_n"].clone()
}

#[test]
fn the_force_of_a_hard_wall_is_that_of_its_stated_contact() {
    let reduced_kg = 0.16 * 1.6 / 1.76;
    let close = |force: &Value, expected: f64| {
        let force = force.as_f64().unwrap_or_else(|| panic!("{force}"));
        assert!((force / expected - 1.0).abs() < 1e-12, "{force} N instead of {expected} N");
    };
    let of = |more: &str| one_impact(1.0, &format!("wall = {{ kind = \"restitution\", coefficient = 0.6{more} }}"));
    let impulse_n_s = reduced_kg * 0.5 * 1.6;
    close(&of(", contact_time_s = 0.002"), std::f64::consts::FRAC_PI_2 * impulse_n_s / 0.002);
    close(&of(", contact_time_s = 0.002, pulse_factor = 1.8"), 1.8 * impulse_n_s / 0.002);
    let k: f64 = 2e8;
    let hertz = k * (5.0 * reduced_kg * 0.25 / (4.0 * k)).powf(0.6);
    close(&of(", hertz_stiffness_n_per_m15 = 2e8"), hertz);
    assert!(of("").is_null());
    // The impulse has the e of the speed, here 0.75.
    let table = TABLE.replace(" }", ", contact_time_s = 0.002 }");
    close(&one_impact(1.0, &table), std::f64::consts::FRAC_PI_2 * reduced_kg * 0.5 * 1.75 / 0.002);
    // Each wall has its own.
    let two = "wall = { kind = \"restitution\", coefficient = 0.6, contact_time_s = 0.004 }, \
               positive_wall = { kind = \"restitution\", coefficient = 0.6, hertz_stiffness_n_per_m15 = 2e8 }";
    close(&one_impact(1.0, two), hertz);
    close(&one_impact(-1.0, two), std::f64::consts::FRAC_PI_2 * impulse_n_s / 0.004);
    // One wall without a contact: the largest force is not known.
    assert!(one_impact(1.0, &two.replace(", contact_time_s = 0.004", "")).is_null());
}

#[test]
fn a_stated_contact_does_not_change_the_motion_and_its_force_is_that_of_the_fastest_impact() {
    let plain = answer(TABLE);
    let mut stated = answer(&TABLE.replace(" }", ", contact_time_s = 0.003 }"));
    let force = stated["summary"]["peak_contact_force_n"].take().as_f64().expect("a force");
    stated["summary"].as_object_mut().unwrap().remove("peak_contact_force_n");
    assert_eq!(plain, stated);
    let table = SpeedTable::new(&[[0.1, 0.9], [0.5, 0.75], [2.0, 0.6]]).expect("three points");
    let forces = plain["impacts"].as_array().expect("impacts").iter().map(|impact| {
        let v = impact["approach_speed_m_per_s"].as_f64().expect("a speed");
        std::f64::consts::FRAC_PI_2 * (1.6 * 0.16 / 1.76) * v * (1.0 + table.at(v)) / 0.003
    });
    let largest = forces.fold(0.0, f64::max);
    assert!(largest > 10.0 && (force / largest - 1.0).abs() < 1e-12, "{force} N instead of {largest} N");
}

#[test]
fn keys_of_a_contact_that_are_not_allowed_are_named() {
    let wall = |keys: &str| format!("wall = {{ kind = \"restitution\", coefficient = 0.6, {keys} }}");
    refused(&wall("contact_time_s = 0"), &["`particle.wall.contact_time_s` = 0 is not allowed", "greater than 0"]);
    refused(&wall("pulse_factor = 2"), &["pulse_factor", "contact_time_s"]);
    refused(
        &wall("contact_time_s = 0.002, pulse_factor = 0.9"),
        &["`particle.wall.pulse_factor` = 0.9", "from 1 to 10"],
    );
    refused(&wall("contact_time_s = 0.002, hertz_stiffness_n_per_m15 = 1e8"), &["leave out"]);
    refused(
        "wall = { kind = \"voigt\", material = \"rubber\", release = \"zero_force\", contact_time_s = 0.002 }",
        &["contact_time_s"],
    );
}

/// The same particle as a campaign reads it.
fn in_campaign(particle: &str) -> SetUp {
    let campaign = format!(
        "name = \"walls\"\n{STRUCTURE}[[set_up]]\nname = \"a\"\nbase_amplitude_m = 0.001\n\
         particle = {{ mass_ratio = 0.1, clearance_m = 0.03, {particle} }}\n\
         [[experiment]]\nname = \"sweep\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.5]\nstart = \"carry_over\"\ndwell_s = 20\n"
    );
    let campaign = Campaign::parse(Source::new("campaign.toml", campaign)).unwrap_or_else(|why| panic!("{why}"));
    campaign.set_ups[0].model()
}

const LOPSIDED: &str = "wall = { kind = \"restitution\", coefficient = 0.6 }, offset_m = 0.01, inclination_deg = 30, \
    positive_wall = { kind = \"voigt\", stiffness_n_per_m = 3000, damping_n_s_per_m = 4, release = \"zero_force\" }";

#[test]
fn a_case_and_a_campaign_read_the_same_cavity_and_start_in_its_middle() {
    let soft = Wall::Voigt { stiffness_n_per_m: 3000.0, damping_n_s_per_m: 4.0, release: Release::ZeroForce };
    let set_up = read(LOPSIDED);
    let particle = set_up.particle.expect("it has one");
    assert_eq!(particle.cavity, Cavity { positive_wall: Some(soft), offset_m: 0.01, inclination_deg: 30.0 });
    assert_eq!(particle.walls(), [Wall::Restitution { coefficient: 0.6 }, soft]);
    assert!((set_up.weight_m_per_s2() - 0.5 * 9.81).abs() < 1e-12);
    assert_eq!(in_campaign(LOPSIDED).particle, set_up.particle);
    let start = |more: &str| {
        let text = case(&format!("{LOPSIDED}{more}"));
        Case::parse(&Source::new("case.toml", text), "case").expect("a case").initial.y_m
    };
    assert_eq!(start(""), 0.01);
    assert_eq!(start(", start = \"at_negative_wall\""), 0.01 - 0.03);
    assert_eq!(start(", start_m = 0.035"), 0.035);
}

#[test]
fn keys_of_a_cavity_that_are_wrong_are_named() {
    let wall = "wall = { kind = \"restitution\", coefficient = 0.6 }";
    refused(&format!("{wall}, inclination_deg = 91"), &["`particle.inclination_deg` = 91 is not allowed", "-90 to 90"]);
    refused(
        &format!("{wall}, positive_wall = {{ kind = \"restitution\", coefficient = 1.6 }}"),
        &["`particle.positive_wall.coefficient` = 1.6 is not allowed", "from 0 to 1"],
    );
    refused(&format!("{wall}, positive_wall = {{ coefficient = 0.6 }}"), &["`particle.positive_wall.kind` is missing"]);
    refused(
        &format!("{wall}, offset_m = 0.01, start_m = -0.025"),
        &["`particle.start_m` = -0.025 is not allowed", "between the walls"],
    );
}

#[test]
fn two_equal_walls_are_one_and_a_shifted_cavity_moves_the_structure_alike() {
    let wall = "{ kind = \"restitution\", coefficient = 0.6 }";
    let one = answer(&format!("wall = {wall}"));
    assert_eq!(one["summary"], answer(&format!("wall = {wall}, positive_wall = {wall}"))["summary"]);
    let shifted = answer(&format!("wall = {wall}, offset_m = 0.01"));
    let largest = |answer: &Value| answer["summary"]["max_abs_x_m"].as_f64().expect("a number");
    assert!((largest(&shifted) / largest(&one) - 1.0).abs() < 1e-9, "{shifted}");
    assert_ne!(one["summary"], answer(&format!("wall = {wall}, inclination_deg = 20"))["summary"]);
}

#[test]
fn a_lopsided_cavity_is_simulated_analysed_and_described() {
    let folder = TempDir::new().unwrap();
    let set =
        ["--set", "run.duration_s=60", "--set", "particle.wall.coefficient=0.3", "--analyse", "--plot", "motion.svg"];
    let (is_done, out, told) = run(&folder, &case(LOPSIDED), &set);
    assert!(is_done, "{told}");
    assert!(out.contains("e = 0.3, at + k1 = 3000 N/m, c1 = 4 N·s/m, offset 10 mm, 30° up"), "{out}");
    assert!(folder.path().join("motion.svg").exists());
}

#[test]
fn keys_of_the_law_that_are_missing_or_out_of_range_are_named() {
    let wall = |keys: &str| format!("wall = {{ kind = \"restitution\", coefficient = 0.6{keys} }}");
    refused(&wall(", exponent = 0.25, maximum = 0.9"), &["particle.wall", "reference_speed_m_per_s"]);
    refused(&wall(", exponent = 0.25, reference_speed_m_per_s = 0.5"), &["maximum"]);
    refused(&wall(", maximum = 0.9"), &["maximum", "exponent"]);
    refused(
        &wall(", exponent = 0.25, reference_speed_m_per_s = 0.5, maximum = 1"),
        &["`particle.wall.maximum` = 1 is not allowed", "less than 1"],
    );
    refused(
        &wall(", exponent = -0.25, reference_speed_m_per_s = 0.5, maximum = 0.9"),
        &["`particle.wall.exponent` = -0.25 is not allowed", "from 0 to 1"],
    );
}

#[test]
fn an_exponent_of_zero_gives_the_numbers_of_the_constant_coefficient() {
    let constant = answer("wall = { kind = \"restitution\", coefficient = 0.6 }");
    let stated = "wall = { kind = \"restitution\", coefficient = 0.6, exponent = 0, reference_speed_m_per_s = 2, maximum = 0.9 }";
    assert_eq!(constant["summary"], answer(stated)["summary"]);
    assert_ne!(constant["summary"], answer(FALLING)["summary"]);
}

#[test]
fn the_law_is_in_the_text_of_a_simulation_and_in_its_analysis() {
    let folder = TempDir::new().unwrap();
    let (is_done, out, told) = run(&folder, &case(FALLING), &["--set", "run.duration_s=40", "--analyse"]);
    assert!(is_done, "{told}");
    assert!(out.contains("e = 0.6 (v/0.5 m/s)^−0.25, at most 0.9"), "{out}");
}

/// Files and run folders of before have no `cavity`.
#[test]
fn a_plain_cavity_leaves_no_trace_in_a_text_and_a_text_without_one_opens() {
    let plain = read("wall = { kind = \"restitution\", coefficient = 0.6 }");
    let text = serde_json::to_string(&plain).unwrap();
    assert!(!text.contains("cavity") && serde_json::from_str::<SetUp>(&text).unwrap() == plain, "{text}");
    let lopsided = read(LOPSIDED);
    let text = serde_json::to_string(&lopsided).unwrap();
    assert!(text.contains("cavity") && serde_json::from_str::<SetUp>(&text).unwrap() == lopsided, "{text}");
}
