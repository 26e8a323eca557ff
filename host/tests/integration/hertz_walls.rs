//! Hertz walls: keys and results of cases, and the hard walls that act in their place where impacts take no time.

use damprig::campaign::Campaign;
use damprig::continuation::Continuation;
use damprig::input::Source;
use damprig::simulation::Case;
use damprig::table::values::numbers;
use damprig_core::model::{Dissipation, Hertz, Wall};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

use crate::common::{damprig, folder_with, read_parquet};
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
    told(&format!("{out}{why}"), &["smallest peak_contact_force_n", "stiffness_n_per_m15  100000000 N"]);
    let (is_done, out, why) = run(&folder, &case(HUNT), &["--json", "--set", "particle.wall.hunt_crossley_s_per_m=0"]);
    assert!(is_done, "{why}");
    let answer: Value = serde_json::from_str(&out).unwrap();
    let first = answer["contacts"][0]["restitution"].as_f64().unwrap();
    assert!((first - 1.0).abs() < 0.05, "{first}");
}

/// A campaign of one point on sensors without noise, with the walls of a case that is driven alike.
fn campaign(particle: &str) -> String {
    format!(
        "name = \"walls\"\n{STRUCTURE}rig = {{ sensor_noise_rms_m = 0.0, sensor_resolution_m = 0.0 }}\n\
         [[set_up]]\nname = \"steel\"\nbase_amplitude_m = 0.0015\n{particle}\
         [[experiment]]\nname = \"sine\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.5]\nstart = \"carry_over\"\n\
         settle_s = 80\ndwell_s = 8\n"
    )
}

#[test]
fn a_campaign_follows_the_restitution_of_a_hertz_wall_over_the_speed() {
    let wall = |keys: &str| {
        let source = Source::new("campaign.toml", campaign(&particle(keys)));
        let campaign = Campaign::parse(source).unwrap_or_else(|why| panic!("{why}"));
        (
            campaign.set_ups[0].model().particle.expect("it has one").wall,
            campaign.set_ups[0].hertz_as_hard().expect("a note"),
        )
    };
    let (constant, note) = wall(LANKARANI);
    assert_eq!(constant, Wall::Restitution { coefficient: law(LANKARANI).restitution(1.0) });
    told(&note, &["e = 0.7561 of its free impacts", "its contacts take no time"]);
    let (varying, note) = wall(HUNT);
    told(&note, &["a table within 0.005 up to 6.667 m/s"]);
    let followed = varying.impact_law::<f64>(1.0).expect("a hard wall");
    for n in 1..=1000 {
        let speed = 6.66 * f64::from(n) / 1000.0;
        assert!((followed.at(speed) - law(HUNT).restitution(speed)).abs() <= 0.005 + 1e-12, "{speed}");
    }
}

/// Largest |x|, the mean of the last 20 of 220 cycles, m; all of the answer.
fn at_the_end(z_m: f64, particle: &str) -> (f64, Value) {
    let text = format!(
        "{STRUCTURE}base = {{ kind = \"sine\", amplitude_m = {z_m:?}, frequency_hz = 2.5 }}\n\
         run = {{ duration_s = 88, steady_from_cycle = 200 }}\n{particle}"
    );
    let (is_done, out, why) = run(&TempDir::new().unwrap(), &text, &["--json"]);
    assert!(is_done, "{why}");
    let answer: Value = serde_json::from_str(&out).unwrap();
    (answer["summary"]["steady_mean_cycle_max_abs_x_m"].as_f64().unwrap(), answer)
}

/// A contact of duration τ, at whose approach the speed is v, is an impact at the centre of its impulse, t = eτ/(1 + e) after its begin:
/// as if each wall stood v·t further away. The table's e is off by at most 0.005. Both motions are stable, with two impacts a cycle.
#[test]
fn a_virtual_rig_agrees_with_the_contacts_of_stiff_steel_walls() {
    let walls = |wall: &str, clearance_m: f64| {
        format!("particle = {{ mass_ratio = 0.1, clearance_m = {clearance_m:?}, wall = {{ {wall} }} }}\n")
    };
    let d_m = 0.015;
    for (wall, error_of_e) in [(LANKARANI, 0.0), (HUNT, 0.005)] {
        let wall = wall.replace("1e9", "1e10").replace("0.3", "1");
        for rig in ["virtual:f64", "virtual:f32"] {
            let folder = folder_with(&campaign(&walls(&wall, d_m)));
            let said = damprig(&folder).args(["run", "test.toml", "--rig", rig, "--out", "out"]).assert().success();
            told(
                &String::from_utf8_lossy(&said.get_output().stdout),
                &["Set-up \"steel\": in prediction, twin and simulated plant a Hertz wall acts as a hard wall"],
            );
            let results = &read_parquet(folder.path().join("out/results.parquet"))[0];
            let measured = |name: &str| numbers(results, name).unwrap()[0];
            let (z_m, x_m) = (measured("z_amplitude_m"), measured("mean_cycle_max_m"));
            let (exact_m, answer) = at_the_end(z_m, &walls(&wall, d_m));
            let contacts = answer["contacts"].as_array().unwrap();
            let last = |key: &str| contacts.last().unwrap()[key].as_f64().unwrap();
            let (contact_s, speed) = (last("duration_s"), last("approach_speed_m_per_s"));
            let e = law(&wall).restitution(speed);
            let hard = |e: f64, further_m: f64| {
                let wall = format!("kind = \"restitution\", coefficient = {e:?}");
                at_the_end(z_m, &walls(&wall, d_m + further_m)).0
            };
            let by_contact = hard(e, speed * contact_s * e / (1.0 + e)) - hard(e, 0.0);
            let by_table = 0.5 * (hard(e + error_of_e, 0.0) - hard(e - error_of_e, 0.0));
            // A fifth more, for what is of higher order in τ; the largest of samples 1 ms apart is up to 3e-5 too small, and the amplitude
            // of the base is known to about as much.
            let allowed_m = 1.2 * by_contact.abs() + by_table.abs() + 1e-4 * exact_m;
            println!("{rig} {wall}: {x_m:e} {exact_m:e} m, off by {:e}, allowed {allowed_m:e} m", x_m - exact_m);
            assert!((x_m - exact_m).abs() < allowed_m, "{rig} {wall}: {x_m} {exact_m} {allowed_m}");
            assert!(allowed_m < 0.01 * exact_m, "{rig} {wall}: the bound says nothing");
            let compared = damprig(&folder).args(["compare", "out"]).assert().success();
            told(&String::from_utf8_lossy(&compared.get_output().stdout), &["a Hertz wall acts as a hard wall"]);
        }
    }
}

#[test]
fn analysis_continuation_and_records_say_what_acts_in_place_of_a_hertz_wall() {
    let folder = TempDir::new().unwrap();
    let e = law(LANKARANI).restitution(1.0);
    let hard = format!("kind = \"restitution\", coefficient = {e:?}");
    let more = ["--json", "--analyse", "--set", "run.duration_s=80"];
    let answers = [LANKARANI, &hard].map(|wall| {
        let (is_done, out, why) = run(&folder, &case(wall), &more);
        assert!(is_done, "{why}");
        serde_json::from_str::<Value>(&out).unwrap()
    });
    assert_eq!(answers[0]["analysis"]["driven"], answers[1]["analysis"]["driven"]);
    assert!(answers[0]["analysis"]["driven"].is_object() && answers[1]["analysis"]["walls"].is_null());
    let (_, out, _) = run(&folder, &case(LANKARANI), &more[1..]);
    told(&out, &["a Hertz wall acts as a hard wall with e = 0.7561"]);

    let follow = |wall: &str, parameter: &str, from: f64| {
        let to = from + 0.2;
        let text = format!("case = \"case.toml\"\nparameter = \"{parameter}\"\nfrom = {from}\nto = {to}\n");
        let case = Source::new("case.toml", case(wall).replace("clearance_m = 0.03", "clearance_ratio = 5.5"));
        Continuation::parse(&Source::new("continue.toml", text), Path::new("continue.toml"), Some(&case))
    };
    let found = |wall: &str| {
        serde_json::to_value(follow(wall, "particle.clearance_ratio", 5.4).unwrap().follow(&|_| true).unwrap()).unwrap()
    };
    let (of_hertz, of_hard) = (found(LANKARANI), found(&hard));
    assert_eq!(of_hertz["branches"], of_hard["branches"]);
    told(of_hertz["walls"].as_str().unwrap(), &["e = 0.7561"]);
    let refused =
        follow(LANKARANI, "particle.wall.coefficient", 0.6).map(|_| ()).expect_err("no key of the case").to_string();
    told(&refused, &["the case case.toml has no such parameter", "particle.clearance_m"]);

    std::fs::write(
        folder.path().join("record.csv"),
        "t,z\n0,0\n0.1,0.02\n0.2,-0.02\n0.3,0.02\n0.4,0\n0.5,0\n0.6,0\n0.7,0\n",
    )
    .unwrap();
    let record = "base = { kind = \"record\", file = \"record.csv\", quantity = \"displacement\", unit = \"m\", column = 2, time_column = \"t\" }\nrun = {}\n";
    let played = [LANKARANI, &hard].map(|wall| {
        let near = particle(wall).replace("0.03", "0.003");
        let (is_done, out, why) = run(&folder, &format!("{STRUCTURE}{record}{near}"), &["--json"]);
        assert!(is_done, "{why}");
        serde_json::from_str::<Value>(&out).unwrap()["summary"].clone()
    });
    assert_eq!(played[0]["max_abs_x_m"], played[1]["max_abs_x_m"]);
    assert!(played[0]["impact_count"].as_u64() > Some(0));
    // The force is that of the contact, which a hard wall does not state.
    assert!(played[0]["peak_contact_force_n"].as_f64() > Some(0.0) && played[1]["peak_contact_force_n"].is_null());
}
