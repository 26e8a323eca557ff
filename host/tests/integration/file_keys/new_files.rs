//! The files that `damprig init` writes.

use std::process::Command;

use damprig::campaign::Campaign;
use damprig::file_keys::new_file::{self, CaseValues, Excitation, MountedDamper, RecordFile};
use damprig::input::Source;
use damprig::prediction::settling;
use damprig::simulation::Case;
use damprig_core::model::Material;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use tempfile::TempDir;

use crate::common::{damprig, folder_with};

/// Every choice of some items, but none.
fn choices<T: Copy>(items: &[T]) -> Vec<Vec<T>> {
    let pick =
        |bits: usize| items.iter().enumerate().filter(|(n, _)| bits >> n & 1 == 1).map(|(_, item)| *item).collect();
    (1..1 << items.len()).map(pick).collect()
}

#[test]
fn every_new_file_is_accepted_without_a_warning() {
    let values = CaseValues::default();
    let accepted = |dampers: &[MountedDamper], experiments: &[Excitation], values: &CaseValues| {
        let text = new_file::campaign("new", dampers, experiments, values);
        let campaign = Campaign::parse(Source::new("new.toml", text.clone()));
        let campaign = campaign.unwrap_or_else(|refusal| panic!("{refusal}\n{text}"));
        assert!(campaign.source.warnings().is_empty(), "{:?}\n{text}", campaign.source.warnings());
        assert_eq!((campaign.set_ups.len(), campaign.experiments.len()), (dampers.len(), experiments.len()));
    };
    for dampers in choices(&MountedDamper::ALL) {
        for experiments in choices(&Excitation::ALL) {
            // To make noise takes most of the time of this test.
            if dampers.len() == 1 || !experiments.contains(&Excitation::Noise) {
                accepted(&dampers, &experiments, &values);
            }
        }
    }
    for material in Material::ALL {
        let values = CaseValues { wall: Some(material), has_spring: true, ..CaseValues::default() };
        accepted(&MountedDamper::ALL, &Excitation::ALL, &values);
    }
    for damper in MountedDamper::ALL {
        for excitation in Excitation::ALL {
            let text = new_file::case("new", damper, excitation, &values);
            let source = Source::new("new.toml", text.clone());
            Case::parse(&source, "new").unwrap_or_else(|refusal| panic!("{refusal}\n{text}"));
            assert!(source.warnings().is_empty(), "{:?}\n{text}", source.warnings());
        }
    }
}

/// Success without a warning. A loaded machine may predict long experiments in part only.
fn is_quiet(output: &std::process::Output) -> bool {
    let said = String::from_utf8_lossy(&output.stderr);
    output.status.success() && said.lines().all(|line| line.contains("predicted in part only"))
}

#[test]
fn every_new_campaign_passes_its_dry_run_and_every_new_case_is_simulated() {
    let folder = TempDir::new().unwrap();
    for damper in ["bare", "spid", "fd", "hybrid", "tmd", "bare,spid,fd,hybrid,tmd"] {
        for experiment in ["stepped-sine", "free-vibration", "impulse", "noise"] {
            let chosen = ["--damper", damper, "--experiment", experiment, "--force"];
            damprig(&folder)
                .arg("init")
                .args(chosen)
                .assert()
                .success()
                .stdout(contains("damprig run campaign.toml --dry-run"));
            let dry = damprig(&folder).args(["run", "campaign.toml", "--dry-run"]).assert();
            let output = dry.get_output();
            assert!(is_quiet(output), "{damper}, {experiment}: {output:?}");
            if !damper.contains(',') {
                damprig(&folder).args(["init", "--case"]).args(chosen).assert().success();
                let simulated = damprig(&folder).args(["simulate", "case.toml"]).assert();
                let output = simulated.get_output();
                assert!(is_quiet(output), "{damper}, {experiment}: {output:?}");
            }
        }
    }
}

#[test]
fn a_new_case_with_several_places_names_its_own_file_and_is_simulated() {
    let folder = TempDir::new().unwrap();
    for structure in ["beam", "storeys", "modes"] {
        damprig(&folder).args(["init", "mine.toml", "--force", "--structure", structure]).assert().success();
        let text = std::fs::read_to_string(folder.path().join("mine.toml")).unwrap();
        assert!(text.contains("#   damprig simulate mine.toml --plot"), "{text}");
        let simulated = damprig(&folder).args(["simulate", "mine.toml"]).output().unwrap();
        assert!(is_quiet(&simulated), "{structure}: {simulated:?}");
    }
    let refused = damprig(&folder).args(["init", "other.toml", "--structure", "beam", "--damper", "tmd"]).assert();
    refused.code(2).stderr(contains("--structure").and(contains("--damper")));
}

/// The record is in another folder than the new file, and then in its own.
#[test]
fn a_new_campaign_with_a_record_soft_walls_and_a_spring_passes_its_dry_run() {
    let folder = TempDir::new().unwrap();
    std::fs::create_dir(folder.path().join("new")).unwrap();
    let rows: String = (0..500).map(|n| format!("{},{}\n", 0.01 * f64::from(n), (0.1 * f64::from(n)).sin())).collect();
    std::fs::write(folder.path().join("shake.csv"), format!("t_s,z\n{rows}")).unwrap();
    let record = ["--record", "shake.csv", "--record-quantity", "displacement", "--record-unit", "mm"];
    for (file, wall) in [
        ("new/one.toml", "rubber"),
        ("two.toml", "anti-vibration-pad"),
        ("three.toml", "acrylic-foam"),
        ("four.toml", "pu-foam"),
    ] {
        let chosen = ["--damper", "bare,spid,fd,hybrid", "--wall", wall, "--friction-spring"];
        damprig(&folder).args(["init", file]).args(record).args(chosen).assert().success();
        let dry = damprig(&folder).args(["run", file, "--dry-run"]).assert();
        assert!(is_quiet(dry.get_output()), "{file}: {:?}", dry.get_output());
    }
    let text = std::fs::read_to_string(folder.path().join("two.toml")).unwrap();
    for words in [
        "file = \"shake.csv\"",
        "unit = \"mm\"",
        "material = \"anti_vibration_pad\"",
        "[set_up.friction_damper.spring]",
    ] {
        assert!(text.contains(words), "{words}:\n{text}");
    }
    damprig(&folder).args(["init", "--case", "--damper", "spid", "--wall", "rubber"]).args(record).assert().success();
    damprig(&folder).args(["simulate", "case.toml"]).assert().success();
    let refused = damprig(&folder).args(["init", "other.toml", "--record", "absent.csv"]).assert().code(2);
    refused.stderr(contains("--record absent.csv"));
    assert!(!folder.path().join("other.toml").exists());
}

#[test]
fn a_new_campaign_has_the_given_values_and_explains_each_key_once() {
    let folder = TempDir::new().unwrap();
    let flags =
        ["--mass-kg", "2", "--natural-frequency-hz", "4", "--damping-ratio", "0.01", "--base-amplitude-m", "0.001"];
    damprig(&folder).args(["init", "my lab.toml", "--damper", "spid,tmd"]).args(flags).assert().success();
    let text = std::fs::read_to_string(folder.path().join("my lab.toml")).unwrap();
    let campaign = Campaign::parse(Source::new("my lab.toml", text.clone())).unwrap();
    let model = campaign.set_ups[0].model();
    assert_eq!((campaign.name.as_str(), model.structure.mass_kg), ("my-lab", 2.0));
    assert!((campaign.set_ups[1].natural_frequency_hz() / 4.0 - 1.0).abs() < 1e-12);
    assert_eq!(campaign.set_ups[0].base_amplitude_m, 0.001);
    for words in [
        "# M, the structure's mass",
        "# ζ = c/(2√(kM)); or damping_n_s_per_m",
        "# the time that is measured at each frequency",
    ] {
        assert_eq!(text.matches(words).count(), 1, "{words}:\n{text}");
    }
    // The mass ratio of the particle and that of the tuned mass are two keys.
    assert_eq!(text.matches("mass_ratio = 0.1").count(), 2, "{text}");
    assert_eq!(text.matches("# m/M, the").count(), 2, "{text}");
}

#[test]
fn a_set_up_that_would_move_too_far_is_driven_less_and_the_command_says_so() {
    let folder = TempDir::new().unwrap();
    let written = |damper: &str, ratio: &str| {
        let arguments = ["init", "--force", "--damper", damper, "--damping-ratio", ratio];
        let output = damprig(&folder).args(arguments).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        let text = std::fs::read_to_string(folder.path().join("campaign.toml")).unwrap();
        let z = Campaign::parse(Source::new("new.toml", text.clone())).unwrap().set_ups[0].base_amplitude_m;
        (z, String::from_utf8_lossy(&output.stdout).into_owned(), text)
    };
    let (z, said, text) = written("bare", "0.05");
    assert_eq!(z, 0.0015);
    assert!(!said.contains("in place of") && !text.contains("the prediction is"), "{said}\n{text}");
    // Z/(2ζ) is two thirds of the limit of 78 mm, in two digits.
    let (z, said, text) = written("bare", "0.004");
    assert!((0.048..0.0535).contains(&(z / 0.008)), "{z}");
    assert!(said.contains("Set-up \"bare\": base_amplitude_m = 0.00042 in place of 0.0015"), "{said}");
    assert!(text.contains("# With base_amplitude_m = 0.0015 the predicted largest |x| is 18"), "{text}");
    damprig(&folder).args(["run", "campaign.toml", "--dry-run"]).assert().success();
}

#[test]
fn a_record_is_played_as_it_was_given_and_compare_can_use_the_telemetry() {
    let record = RecordFile { file: "quake.AT2".into(), quantity: None, unit: None };
    let values = CaseValues { record, ..CaseValues::default() };
    let text = new_file::campaign("new", &[MountedDamper::Bare], &[Excitation::Record], &values);
    assert!(!text.contains("target_peak_m") && !text.contains("scale"), "{text}");
    assert!(text.contains("rate_hz = 1000") && text.contains("[\"x\", \"z\"]"), "{text}");
}

#[test]
fn the_points_of_a_new_sweep_settle_however_light_the_damping() {
    for damping_ratio in [0.0005, 0.002, 0.0038, 0.02] {
        let values = CaseValues { damping_ratio, ..CaseValues::default() };
        let text = new_file::campaign("new", &MountedDamper::ALL, &[Excitation::SteppedSine], &values);
        let campaign = Campaign::parse(Source::new("new.toml", text)).unwrap();
        assert_eq!(settling::advice(&campaign), [""; 0], "ζ = {damping_ratio}");
    }
}

#[test]
fn an_existing_file_or_a_value_out_of_range_is_refused_and_nothing_is_written() {
    let folder = folder_with("mine");
    let refused = |arguments: &[&str], words: &[&str]| {
        let output = damprig(&folder).arg("init").args(arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        words.iter().for_each(|word| assert!(said.contains(word), "{arguments:?}: no {word:?} in {said}"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    };
    refused(&["test.toml"], &["cannot write test.toml: it exists", "--force"]);
    refused(&["--restitution", "1.2"], &["particle.wall.coefficient` = 1.2", "from 0 to 1", "nothing was written"]);
    refused(&["--natural-frequency-hz", "60"], &["at most 50 Hz"]);
    refused(&["--damper", "spid,spid"], &["--damper: spid is named twice"]);
    refused(&["--case", "--damper", "spid,fd"], &["--damper: a case has one, not spid and fd"]);
    refused(&["--damper", "spring"], &["hybrid"]);
    assert_eq!(std::fs::read_to_string(folder.path().join("test.toml")).unwrap(), "mine");
    damprig(&folder).args(["init", "test.toml", "--force"]).assert().success();
    assert!(std::fs::read_to_string(folder.path().join("test.toml")).unwrap().starts_with("# A campaign"));
}

/// Runs `damprig init` on a terminal, whose keyboard types these lines.
#[cfg(target_os = "linux")]
fn answered(folder: &TempDir, lines: &str) -> Option<String> {
    use std::io::Write;
    use std::process::Stdio;

    let binary = assert_cmd::cargo::cargo_bin("damprig");
    let child = Command::new("script")
        .args(["-qec", &format!("{} init", binary.display()), "/dev/null"])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut child) = child else {
        println!("left out: no `script`, which makes a terminal");
        return None;
    };
    child.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}");
    Some(said)
}

#[cfg(target_os = "linux")]
#[test]
fn on_a_terminal_it_asks_and_takes_the_defaults_in_brackets() {
    let folder = TempDir::new().unwrap();
    let Some(said) = answered(&folder, "\nbare,fd\nimpulse\n2.0\n\nmuch\n0.01\n\n") else { return };
    for words in [
        "Dampers, of bare, spid, fd, hybrid, tmd [bare,spid]",
        "must be a number 0 or greater",
        "Written to campaign.toml",
    ] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    let campaign = Campaign::read(&folder.path().join("campaign.toml")).unwrap();
    let names: Vec<&str> = campaign.set_ups.iter().map(|set_up| set_up.name.as_str()).collect();
    assert_eq!((names, campaign.experiments.len()), (vec!["bare", "fd"], 1));
    assert_eq!(campaign.set_ups[0].model().structure.mass_kg, 2.0);
    assert!((campaign.set_ups[0].model().structure.damping_ratio() - 0.01).abs() < 1e-12);
    let Some(said) = answered(&folder, "case\nhybrid\nfree-vibration\n\n\n\n\n") else { return };
    assert!(said.contains("Next: damprig simulate case.toml"), "{said}");
    assert!(Case::read(&folder.path().join("case.toml")).unwrap().set_up.friction_damper.is_some());
}

#[test]
fn a_new_study_of_every_new_and_shipped_case_is_accepted() {
    let folder = TempDir::new().unwrap();
    for damper in MountedDamper::ALL {
        for excitation in Excitation::ALL {
            let text = new_file::case("new", damper, excitation, &CaseValues::default());
            std::fs::write(folder.path().join("case.toml"), text).unwrap();
            let arguments = ["init", "--force", "--study", "case.toml"];
            damprig(&folder).args(arguments).assert().success().stdout(contains("damprig study run study.toml"));
        }
    }
    let cases = concat!(env!("CARGO_MANIFEST_DIR"), "/cases");
    for case in std::fs::read_dir(cases).unwrap().map(|entry| entry.unwrap().path()) {
        if case.extension().is_some_and(|extension| extension == "toml") {
            damprig(&folder).args(["init", "--force", "--study"]).arg(&case).assert().success();
            // A dry run simulates a point to say how long all take: of spheres for seconds, as that of the shipped study does.
            if !case.ends_with("many-particles.toml") {
                damprig(&folder).args(["study", "run", "study.toml", "--dry-run"]).assert().success();
            }
        }
    }
}

#[test]
fn a_new_optimisation_of_every_new_and_shipped_case_is_accepted() {
    let folder = TempDir::new().unwrap();
    let init =
        |case: &str, more: &[&str]| damprig(&folder).args(["init", "--force", "--optimise", case]).args(more).assert();
    for damper in MountedDamper::ALL {
        for excitation in Excitation::ALL {
            let text = new_file::case("new", damper, excitation, &CaseValues::default());
            std::fs::write(folder.path().join("case.toml"), text).unwrap();
            match damper {
                MountedDamper::Bare => {
                    let said = init("case.toml", &[]).code(2);
                    said.stderr(contains("no particle and no friction damper").and(contains("--variable KEY=FROM:TO")));
                    init("case.toml", &["--variable", "structure.damping_ratio=0.01:0.1"]).success();
                }
                MountedDamper::Tmd => drop(init("case.toml", &["--variable", "tmd.mass_ratio=0.05:0.2"]).success()),
                _ => drop(init("case.toml", &[]).success().stdout(contains("damprig optimise optimisation.toml"))),
            }
        }
    }
    damprig(&folder).args(["init", "--case", "--force"]).assert().success();
    init("case.toml", &[]).success();
    let dry = damprig(&folder).args(["optimise", "optimisation.toml", "--dry-run"]).assert().success();
    dry.stdout(contains("2 variables"));
    init("case.toml", &["--variable", "particle.clearance_ratio=4"]).code(2).stderr(contains("KEY=FROM:TO"));
    init("case.toml", &["--variable", "particle.clearence_ratio=4:8"]).code(2).stderr(contains("nothing was written"));
}

#[test]
fn a_campaign_of_steel_walls_and_data_sheet_sensors_says_so_in_its_keys() {
    let folder = TempDir::new().unwrap();
    for (sensors, said, not) in [
        ("data-sheet", "kind = \"data_sheet\"", "sensor_resolution_m"),
        ("ideal", "kind = \"ideal\"", "sensor_noise_rms_m"),
    ] {
        let flags = ["--damper", "spid", "--wall", "steel", "--clearance-m", "0.0075", "--sensors", sensors];
        damprig(&folder).args(["init", "steel.toml", "--force"]).args(flags).assert().success();
        let text = std::fs::read_to_string(folder.path().join("steel.toml")).unwrap();
        for words in ["coefficient = 0.82", "clearance_m = 0.0075", said] {
            assert!(text.contains(words), "no {words} in\n{text}");
        }
        assert!(!text.contains("clearance_ratio = ") && !text.contains(not), "{text}");
        let dry = damprig(&folder).args(["run", "steel.toml", "--dry-run"]).assert().success();
        assert!(is_quiet(dry.get_output()), "{:?}", dry.get_output());
    }
    let both = ["init", "other.toml", "--wall", "steel", "--restitution", "0.5"];
    damprig(&folder).args(both).assert().code(2).stderr(contains("cannot be used with"));
}

#[test]
fn a_study_that_could_not_run_is_not_written() {
    let folder =
        folder_with(&new_file::case("new", MountedDamper::Spid, Excitation::SteppedSine, &CaseValues::default()));
    let init = |more: &[&str]| damprig(&folder).args(["init", "--study", "test.toml"]).args(more).assert().code(2);
    init(&["--axis", "particle.clearence_ratio=4:24:5"])
        .stderr(contains("clearance_ratio").and(contains("nothing was written")));
    init(&["--axis", "particle.clearance_ratio=4"]).stderr(contains("KEY=FROM:TO:COUNT"));
    init(&["--damper", "spid"]).stderr(contains("cannot be used with"));
    assert!(!folder.path().join("study.toml").exists());
    let axis = ["init", "--study", "test.toml", "--axis", "particle.wall.coefficient=0.2:0.8:4"];
    damprig(&folder).args(axis).assert().success();
    let text = std::fs::read_to_string(folder.path().join("study.toml")).unwrap();
    assert!(
        text.contains("key = \"particle.wall.coefficient\"") && !text.contains("key = \"particle.clearance_ratio\""),
        "{text}"
    );
    damprig(&folder).args(["init", "--study", "test.toml"]).assert().code(2).stderr(contains("study.toml"));
}

#[test]
fn a_meaning_stands_beside_a_short_entry_and_above_a_long_one() {
    let text = new_file::campaign("new", &[MountedDamper::Bare], &[Excitation::SteppedSine], &CaseValues::default());
    let column = |line: &str| line.find(" # ").map_or(0, |at| line[..at].chars().count());
    let far: Vec<&str> = text.lines().filter(|line| column(line) > 60).collect();
    assert!(far.is_empty(), "{far:?}");
    let lines: Vec<&str> = text.lines().collect();
    let long = lines.iter().position(|line| line.starts_with("frequencies_hz")).unwrap();
    assert!(lines[long - 1].starts_with("# a list, or {"), "{text}");
}
