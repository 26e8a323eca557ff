//! Hertz walls in cases: keys, results, and the refusals of what has impacts that take no time.

use damprig::campaign::Campaign;
use damprig::continuation::Continuation;
use damprig::input::Source;
use damprig::simulation::Case;
use damprig_core::model::{Dissipation, Hertz, Wall};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

use crate::common::damprig;
use crate::walls::{DRIVE, STRUCTURE, run};

const LANKARANI: &str = "kind = \"hertz\", stiffness_n_per_m15 = 1e9, lankarani_nikravesh_coefficient = 0.6";
const HUNT: &str = "kind = \"hertz\", stiffness_n_per_m15 = 1e9, hunt_crossley_s_per_m = 0.3";

fn particle(wall: &str) -> String {
    format!("particle = {{ mass_ratio = 0.1, clearance_m = 0.03, wall = {{ {wall} }} }}\n")
}

fn case(wall: &str) -> String {
    format!("{STRUCTURE}{DRIVE}{}", particle(wall))
}

fn law(wall: &str) -> Hertz {
    let case = Case::parse(&Source::new("case.toml", case(wall)), "case").unwrap_or_else(|why| panic!("{why}"));
    match case.set_up.particle.expect("it has one").wall {
        Wall::Hertz(law) => law,
        other => panic!("{other:?}"),
    }
}

fn told(told: &str, words: &[&str]) {
    for word in words {
        assert!(told.contains(word), "no {word:?} in:\n{told}");
    }
}

#[test]
fn a_wall_is_read_from_its_stiffness_or_from_material_data() {
    let dissipation = Dissipation::HuntCrossley { coefficient_s_per_m: 0.3 };
    assert_eq!(law(HUNT), Hertz { stiffness_n_per_m15: 1e9, dissipation });
    assert_eq!(law(LANKARANI).dissipation, Dissipation::LankaraniNikravesh { coefficient: 0.6 });
    let steel =
        "kind = \"hertz\", youngs_modulus_pa = 210e9, poisson_ratio = 0.3, radius_m = 0.01, hunt_crossley_s_per_m = 0";
    let alike = Hertz::stiffness_of_sphere_n_per_m15([210e9; 2], [0.3; 2], 0.01);
    assert_eq!(law(steel).stiffness_n_per_m15, alike);
    let other = format!("{steel}, particle_youngs_modulus_pa = 70e9, particle_poisson_ratio = 0.33");
    let expected = Hertz::stiffness_of_sphere_n_per_m15([210e9, 70e9], [0.3, 0.33], 0.01);
    assert_eq!(law(&other).stiffness_n_per_m15, expected);
}

#[test]
fn wrong_keys_of_a_hertz_wall_are_named() {
    for (wall, words) in [
        (
            LANKARANI.replace("0.6", "1.6"),
            &["lankarani_nikravesh_coefficient` = 1.6 is not allowed", "from 0 to 1"][..],
        ),
        (HUNT.replace("0.3", "-1"), &["hunt_crossley_s_per_m` = -1 is not allowed"][..]),
        (
            HUNT.replace(", hunt_crossley_s_per_m = 0.3", ""),
            &["hunt_crossley_s_per_m", "lankarani_nikravesh_coefficient"][..],
        ),
        (format!("{HUNT}, radius_m = 0.01"), &["radius_m"][..]),
        (HUNT.replace("stiffness_n_per_m15 = 1e9", "youngs_modulus_pa = 1e9, radius_m = 0.01"), &["poisson_ratio"][..]),
    ] {
        let (is_done, _, why) = run(&TempDir::new().unwrap(), &case(&wall), &[]);
        assert!(!is_done, "{wall} is accepted");
        told(&why, words);
    }
}

#[test]
fn force_duration_and_restitution_of_each_contact_are_results() {
    let folder = TempDir::new().unwrap();
    let (is_done, out, why) = run(&folder, &case(LANKARANI), &["--json"]);
    assert!(is_done, "{why}");
    let answer: Value = serde_json::from_str(&out).unwrap();
    let contacts = answer["contacts"].as_array().expect("contacts");
    assert!(contacts.len() > 5 && contacts.len() as u64 <= answer["summary"]["impact_count"].as_u64().unwrap());
    let law = law(LANKARANI);
    let reduced_kg = 0.16 * 1.6 / 1.76;
    let number = |value: &Value, key: &str| value[key].as_f64().unwrap_or_else(|| panic!("{key}: {value}"));
    let most_m_per_s2 = (std::f64::consts::TAU * 2.5).powi(2) * number(&answer["summary"], "max_abs_x_minus_z_m");
    let (mut peak_n, mut close) = (0.0_f64, 0);
    for contact in contacts {
        let speed = number(contact, "approach_speed_m_per_s");
        // The structure's acceleration, at most ω² times its largest stretch, acts during the contact.
        let duration_s = number(contact, "duration_s");
        let meanwhile = most_m_per_s2 * duration_s / speed;
        let near = |value: f64, free: f64| (value / free - 1.0).abs() < meanwhile;
        close += u32::from(meanwhile < 0.01);
        assert!(near(number(contact, "restitution"), law.restitution(speed)), "{contact}");
        assert!(near(number(contact, "peak_force_n"), law.peak_force_n(reduced_kg, speed)), "{contact}");
        let least_s = law.elastic_duration_s(reduced_kg, speed);
        assert!(duration_s > 0.99 * least_s && duration_s < 1.5 * least_s, "{contact} {least_s}");
        peak_n = peak_n.max(number(contact, "peak_force_n"));
    }
    assert!(close > 5, "{close}");
    assert_eq!(number(&answer["summary"], "peak_contact_force_n"), peak_n);
    let figures = &answer["summary"]["contacts"];
    assert_eq!(figures["count"].as_u64(), Some(contacts.len() as u64));
    let durations = || contacts.iter().map(|contact| number(contact, "duration_s"));
    assert_eq!(number(figures, "shortest_s"), durations().fold(f64::INFINITY, f64::min));
    assert_eq!(number(figures, "longest_s"), durations().fold(0.0, f64::max));
    let (_, out, _) = run(&folder, &case(LANKARANI), &["--out", "motion.csv"]);
    told(&out, &["wall force", "contact time", "ms; e = 0.7561 of a free impact"]);
    let table = std::fs::read_to_string(folder.path().join("motion.contacts.csv")).unwrap();
    assert_eq!(table.lines().filter(|line| !line.starts_with('#')).count(), contacts.len() + 1, "{table}");
    told(&table, &["duration_s", "peak_force_n", "restitution"]);
}

#[test]
fn the_law_can_be_varied_and_a_study_has_the_peak_force() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("case.toml"), case(HUNT)).unwrap();
    let study = "case = \"case.toml\"\nmetrics = [\"peak_contact_force_n\"]\n[[axis]]\n\
                 key = \"particle.wall.stiffness_n_per_m15\"\nvalues = [1e8, 1e9, 1e10]\n";
    std::fs::write(folder.path().join("study.toml"), study).unwrap();
    let output = damprig(&folder).args(["study", "run", "study.toml", "--out", "out"]).output().unwrap();
    let (out, why) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{why}");
    // The softest wall has the smallest force.
    told(&format!("{out}{why}"), &["smallest peak_contact_force_n", "particle.wall.stiffness_n_per_m15 100000000"]);
    let (is_done, out, why) = run(&folder, &case(HUNT), &["--json", "--set", "particle.wall.hunt_crossley_s_per_m=0"]);
    assert!(is_done, "{why}");
    let answer: Value = serde_json::from_str(&out).unwrap();
    let first = answer["contacts"][0]["restitution"].as_f64().unwrap();
    assert!((first - 1.0).abs() < 0.05, "{first}");
}

#[test]
fn what_has_impacts_without_duration_refuses_a_hertz_wall_and_says_what_to_write() {
    let campaign = |wall: &str| {
        let text = format!(
            "name = \"walls\"\n{STRUCTURE}[[set_up]]\nname = \"a\"\nbase_amplitude_m = 0.001\n{}\
             [[experiment]]\nname = \"sweep\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.5]\nstart = \"carry_over\"\ndwell_s = 20\n",
            particle(wall)
        );
        Campaign::parse(Source::new("campaign.toml", text)).map(|_| ()).expect_err("refused").to_string()
    };
    told(
        &campaign(LANKARANI),
        &["campaign.toml:6", "kind \"hertz\"", "wall = { kind = \"restitution\", coefficient = 0.7561 }"],
    );
    told(&campaign(HUNT), &["kind = \"restitution\"", "0.9709 at 0.1 m/s", "0.7680 at 1 m/s"]);

    let folder = TempDir::new().unwrap();
    let (is_done, _, why) = run(&folder, &case(LANKARANI), &["--analyse"]);
    assert!(!is_done);
    told(
        &why,
        &["--analyse is not available with `particle.wall` of kind \"hertz\"", "case.toml:4", "coefficient = 0.7561"],
    );

    let text = "case = \"case.toml\"\nparameter = \"particle.clearance_ratio\"\nfrom = 3.0\nto = 30.0\n";
    let source = Source::new("continue.toml", text);
    let refused = Continuation::parse(&source, Path::new("continue.toml"), Some(&Source::new("case.toml", case(HUNT))));
    if let Err(why) = refused.map(|_| ()) {
        told(&why.to_string(), &["a continuation is not available with `particle.wall` of kind \"hertz\""]);
    } else {
        panic!("accepted");
    }

    std::fs::write(folder.path().join("record.csv"), "t,z\n0,0\n0.1,0.001\n0.2,0\n0.3,0\n").unwrap();
    let record = "base = { kind = \"record\", file = \"record.csv\", quantity = \"displacement\", unit = \"m\", column = 2, time_column = \"t\" }\nrun = {}\n";
    let (is_done, _, why) = run(&folder, &format!("{STRUCTURE}{record}{}", particle(LANKARANI)), &[]);
    assert!(!is_done);
    told(&why, &["a recorded motion is not available with `particle.wall` of kind \"hertz\"", "coefficient = 0.7561"]);
}
