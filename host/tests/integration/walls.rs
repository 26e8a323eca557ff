//! Walls as they are, in cases and campaigns: restitution that falls with the speed of the impact.

use damprig::campaign::Campaign;
use damprig::input::Source;
use damprig::simulation::Case;
use damprig_core::model::{Restitution, SetUp, Wall};
use serde_json::Value;
use tempfile::TempDir;

use crate::common::damprig;

const STRUCTURE: &str = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n";
const DRIVE: &str = "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\nrun = { duration_s = 8 }\n";
const FALLING: &str = "wall = { kind = \"restitution\", coefficient = 0.6, exponent = 0.25, reference_speed_m_per_s = 0.5, maximum = 0.9 }";

fn case(particle: &str) -> String {
    format!("{STRUCTURE}{DRIVE}particle = {{ mass_ratio = 0.1, clearance_m = 0.03, {particle} }}\n")
}

fn read(particle: &str) -> SetUp {
    Case::parse(&Source::new("case.toml", case(particle)), "case").expect("a case").set_up
}

fn run(folder: &TempDir, text: &str, arguments: &[&str]) -> (bool, String, String) {
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
    let campaign = format!(
        "name = \"walls\"\n{STRUCTURE}[[set_up]]\nname = \"a\"\nbase_amplitude_m = 0.001\n\
         particle = {{ mass_ratio = 0.1, clearance_m = 0.03, {FALLING} }}\n\
         [[experiment]]\nname = \"sweep\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.5]\nstart = \"carry_over\"\ndwell_s = 20\n"
    );
    let source = Source::new("campaign.toml", campaign);
    let campaign = Campaign::parse(source).unwrap_or_else(|why| panic!("{why}"));
    assert_eq!(campaign.set_ups[0].model().particle.expect("it has one").wall, wall);
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
