//! An invalid campaign is refused before anything moves, with line, key, value, what is allowed, and the likely fix.

use crate::common::{damprig, folder_with, short};

/// The short campaign with one text replaced by another.
fn edited(from: &str, to: &str) -> String {
    let text = short();
    assert!(text.contains(from), "the short campaign has no {from:?}");
    text.replacen(from, to, 1)
}

/// Line of the edited campaign that contains `text`.
fn line_of(campaign: &str, text: &str) -> usize {
    1 + campaign[..campaign.find(text).expect("the text is there")].matches('\n').count()
}

/// Runs the edited campaign; it must be refused with all of `words` and the line of `to`.
fn refused(from: &str, to: &str, words: &[&str]) {
    let campaign = edited(from, to);
    let folder = folder_with(&campaign);
    let output = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{answer}");
    let place = format!("--> test.toml:{}:", line_of(&campaign, to));
    for word in words.iter().copied().chain([place.as_str()]) {
        assert!(answer.contains(word), "no {word:?} in:\n{answer}");
    }
    assert!(!folder.path().join("runs").exists(), "a run was begun");
}

#[test]
fn a_misspelt_key_is_answered_with_the_right_one() {
    refused("damping_ratio", "dampin_ratio", &["unknown key `structure.dampin_ratio`", "did you mean `damping_ratio`"]);
}

#[test]
fn a_missing_unit_is_answered_with_the_key_that_carries_it() {
    let fix = "write `base_amplitude_m`: every number carries its unit in its name";
    refused("base_amplitude_m = 0.0004", "base_amplitude = 0.0004", &["unknown key `set_up[1].base_amplitude`", fix]);
}

#[test]
fn a_wrong_unit_is_answered_with_the_converted_value() {
    let fix = "write `base_amplitude_m = 0.0004`";
    refused(
        "base_amplitude_m = 0.0004",
        "base_amplitude_mm = 0.4",
        &["unknown key `set_up[1].base_amplitude_mm`", fix],
    );
}

#[test]
fn a_negative_mass_is_refused() {
    refused(
        "mass_kg = 1.6",
        "mass_kg = -1.6",
        &["`structure.mass_kg` = -1.6 is not allowed", "must be greater than 0"],
    );
}

#[test]
fn not_a_number_is_refused() {
    refused("mass_kg = 1.6", "mass_kg = nan", &["`structure.mass_kg` = nan is not allowed", "must be a finite number"]);
    refused("mass_kg = 1.6", "mass_kg = \"1.6\"", &["`structure.mass_kg` = \"1.6\" is not allowed"]);
}

#[test]
fn a_zero_step_is_refused() {
    let grid = "frequencies_hz = { from_hz = 2.0, to_hz = 3.0, step_hz = 0.0 }";
    let words = [
        "`experiment[1].frequencies_hz.step_hz` = 0.0 is not allowed",
        "must be a number other than 0",
        "for one frequency write",
    ];
    refused("frequencies_hz = [2.4, 2.5, 2.6]", grid, &words);
}

#[test]
fn a_step_in_the_wrong_direction_is_refused_with_the_right_one() {
    let grid = "frequencies_hz = { from_hz = 3.0, to_hz = 2.0, step_hz = 0.1 }";
    refused("frequencies_hz = [2.4, 2.5, 2.6]", grid, &["must lead from 3 to 2 Hz", "write step_hz = -0.1"]);
}

#[test]
fn a_frequency_too_high_for_the_tick_rate_is_refused() {
    let words = ["`experiment[1].frequencies_hz` = 51 is not allowed", "at most 50 Hz", "tick of 1000 Hz"];
    refused("[2.4, 2.5, 2.6]", "[2.4, 2.5, 51]", &words);
}

#[test]
fn a_dwell_without_enough_cycles_is_refused_with_one_that_has_them() {
    refused(
        "dwell_s = 4.0",
        "dwell_s = 1.0",
        &["must hold 6 periods of the lowest frequency, 2.4 Hz", "write dwell_s = 2.5"],
    );
}

#[test]
fn an_unknown_set_up_is_answered_with_the_known_ones() {
    let to = "start = \"from_rest\"\nset_ups = [\"hybird\"]";
    let words = [
        "`experiment[1].set_ups` names an unknown set-up \"hybird\"",
        "the set-ups are bare, hybrid",
        "did you mean \"hybrid\"?",
    ];
    let campaign = edited("start = \"from_rest\"", to);
    let folder = folder_with(&campaign);
    let output = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    for word in words.into_iter().chain([format!("test.toml:{}:", line_of(&campaign, "hybird")).as_str()]) {
        assert!(answer.contains(word), "no {word:?} in:\n{answer}");
    }
}

#[test]
fn a_quantity_given_twice_is_refused() {
    let to = "natural_frequency_hz = 2.50\nstiffness_n_per_m = 395";
    let campaign = edited("natural_frequency_hz = 2.50", to);
    let folder = folder_with(&campaign);
    let output = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert!(answer.contains("`natural_frequency_hz` is given too, and says the same quantity"), "{answer}");
}

#[test]
fn a_restitution_above_1_and_a_start_outside_the_cavity_are_refused() {
    refused(
        "coefficient = 0.47",
        "coefficient = 1.47",
        &["`set_up[2].particle.wall.coefficient` = 1.47", "must be from 0 to 1"],
    );
    refused(
        "clearance_ratio = 5,",
        "clearance_ratio = 5, start_m = 0.009,",
        &["start_m` = 0.009", "within the clearance"],
    );
}

#[test]
fn an_unknown_signal_is_answered_with_the_devices_own() {
    refused(
        "signals = [\"x\", \"z\"]",
        "signals = [\"x\", \"drve\"]",
        &["the device has the signals x, z, drive, frequency", "did you mean \"drive\"?"],
    );
}

#[test]
fn a_telemetry_rate_between_whole_fractions_of_the_tick_is_refused_with_the_next_ones() {
    refused(
        "rate_hz = 100",
        "rate_hz = 300",
        &["`telemetry.rate_hz` = 300 is not allowed", "write rate_hz = 250 or 333.3"],
    );
}

#[test]
fn a_structure_too_fast_for_the_tick_is_refused() {
    refused(
        "natural_frequency_hz = 2.50",
        "natural_frequency_hz = 25000",
        &["`structure.natural_frequency_hz` = 25000 is not allowed"],
    );
}

#[test]
fn all_problems_are_in_one_answer() {
    let campaign = edited("mass_kg = 1.6", "mass_kg = 0").replace("dwell_s = 4.0", "dwel_s = 4.0");
    let folder = folder_with(&campaign);
    let output = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert_eq!(answer.matches("error: ").count(), 2, "{answer}");
    assert!(answer.contains("structure.mass_kg") && answer.contains("experiment[1].dwel_s"), "{answer}");
}

#[test]
fn problems_of_every_experiment_are_in_one_answer() {
    let second =
        "\n[[experiment]]\nkind = \"impulse\"\nshape = \"versine\"\nrise_s = 0.1\namplitude_m = 0\nduration_s = 0.2\n";
    let folder = folder_with(&(edited("dwell_s = 4.0", "dwell_s = -4.0") + second));
    let output = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    for word in [
        "`experiment[1].dwell_s` = -4.0",
        "`experiment[2].amplitude_m` = 0",
        "must be a number other than 0",
        "`experiment[2].rise_s` = 0.1",
        "goes only with shape = \"rectangle\"",
    ] {
        assert!(answer.contains(word), "no {word:?} in:\n{answer}");
    }
}

#[test]
fn keys_that_do_not_go_with_a_word_are_refused_as_such() {
    let closed = "closed_loop = { gain_per_s = 20 }\nsettle_s = 1.0";
    refused("settle_s = 1.0", closed, &["`experiment[1].closed_loop`", "goes only with drive = \"closed_loop\""]);
    let shaker = "shaker = { amplifier = \"current\", limit_v = 20 }\nnoise_seed = 7";
    refused("noise_seed = 7", shaker, &["`rig.shaker.limit_v` = 20", "goes only with amplifier = \"voltage\""]);
    let both = "structure_limit_m = 0.07\ndisplacement_limit_m = 0.07\nnoise_seed = 7";
    refused("noise_seed = 7", both, &["`rig.structure_limit_m`", "`displacement_limit_m` is given too: limit of both"]);
}

#[test]
fn a_predicted_displacement_beyond_the_range_is_refused_and_the_suggested_z_fits() {
    let campaign = edited("base_amplitude_m = 0.0004", "base_amplitude_m = 0.004");
    let folder = folder_with(&campaign);
    let output = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{answer}");
    assert!(
        answer.contains("set-up \"bare\" would leave the displacement limit: predicted largest |x| = "),
        "{answer}"
    );
    assert!(!folder.path().join("runs").exists());
    let offered = answer.split("write base_amplitude_m = ").nth(1).and_then(|t| t.split(' ').next()).expect("an offer");
    std::fs::write(
        folder.path().join("test.toml"),
        edited("base_amplitude_m = 0.0004", &format!("base_amplitude_m = {offered}")),
    )
    .unwrap();
    damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success();
}

/// The structure hardly responds and stays within every limit, but the drive cannot deliver the base amplitude.
#[test]
fn a_base_amplitude_that_the_drive_cannot_deliver_is_refused_on_every_virtual_rig_and_in_a_dry_run() {
    let damped = short().replace("damping_ratio = 0.0038", "damping_ratio = 0.5");
    let far = damped.replace("base_amplitude_m = 0.0004", "base_amplitude_m = 0.005");
    for rig in
        [&["--dry-run"][..], &["--rig", "virtual"], &["--rig", "virtual:f32"], &["--dry-run", "--rig", "virtual"]]
    {
        let folder = folder_with(&far);
        let output = damprig(&folder).args(["run", "test.toml"]).args(rig).output().unwrap();
        let answer = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{rig:?}: {answer}");
        let place = format!("--> test.toml:{}:", line_of(&far, "base_amplitude_m = 0.005"));
        for word in [
            "set-up \"bare\" has too large a base amplitude: it asks the drive for 5 mm, which delivers ±4.392 mm",
            "calibration.drive",
            "write base_amplitude_m = 0.0043",
            &place,
        ] {
            assert!(answer.contains(word), "no {word:?} in:\n{answer}");
        }
        assert!(!folder.path().join("runs").exists(), "a run was begun");
    }
    let folder = folder_with(&far.replace("base_amplitude_m = 0.005", "base_amplitude_m = 0.0043"));
    damprig(&folder).args(["run", "test.toml", "--dry-run"]).assert().success();
}

#[test]
fn the_drive_limit_of_a_closed_loop_is_the_rigs_unless_it_is_tighter() {
    let with = |limit: &str| {
        let experiment = format!("dwell_s = 4.0\ndrive = \"closed_loop\"\nclosed_loop = {{ {limit} }}\n");
        folder_with(&(short().replace("dwell_s = 4.0", &experiment) + "\n[rig.shaker]\n"))
    };
    let far = with("drive_limit_m = 0.05");
    let output = damprig(&far).args(["run", "test.toml", "--dry-run"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{answer}");
    for word in
        ["the closed loop's drive limit is too large", "asks the drive for 50 mm", "write drive_limit_m = 0.0043"]
    {
        assert!(answer.contains(word), "no {word:?} in:\n{answer}");
    }
    for limit in ["", "drive_limit_m = 0.004"] {
        damprig(&with(limit)).args(["run", "test.toml", "--dry-run"]).assert().success();
    }
}

#[test]
fn a_missing_file_is_answered_with_a_similar_name_and_invalid_toml_with_its_position() {
    let folder = folder_with("name = [\n");
    let missing = damprig(&folder).args(["run", "tst.toml"]).output().unwrap();
    assert!(String::from_utf8_lossy(&missing.stderr).contains("did you mean ./test.toml?"), "{missing:?}");
    let broken = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    assert!(String::from_utf8_lossy(&broken.stderr).contains("this is not TOML"), "{broken:?}");
    assert_eq!(broken.status.code(), Some(2));
}

#[test]
fn a_closed_loop_without_a_shaker_is_answered_with_the_table_to_add() {
    let words = ["`experiment[1].drive` = \"closed_loop\"", "add a `[rig.shaker]` table"];
    refused("settle_s = 1.0", "drive = \"closed_loop\"\nsettle_s = 1.0", &words);
}

#[test]
fn a_ramp_longer_than_the_settling_is_answered_with_the_settling() {
    refused("settle_s = 1.0", "ramp_s = 2.0\nsettle_s = 1.0", &["`experiment[1].ramp_s` = 2.0", "settle_s = 1"]);
}

#[test]
fn two_experiments_of_one_name_are_refused() {
    let again = "\n[[experiment]]\nname = \"sweep\"\nkind = \"stepped_sine\"\nfrequencies_hz = [2.4]\nstart = \"from_rest\"\ndwell_s = 4.0\n";
    let folder = folder_with(&(short() + again));
    let output = damprig(&folder).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert!(
        answer.contains("`experiment[2].name` = \"sweep\"") && answer.contains("of an earlier experiment"),
        "{answer}"
    );
}

#[test]
fn a_misspelt_kind_of_sensor_or_amplifier_is_answered_with_the_right_one() {
    let sensors = "sensors = { kind = \"datasheet\" }\nnoise_seed = 7";
    refused("noise_seed = 7", sensors, &["`rig.sensors.kind` = \"datasheet\"", "did you mean \"data_sheet\"?"]);
    let shaker = "shaker = { amplifier = \"voltages\" }\nnoise_seed = 7";
    refused("noise_seed = 7", shaker, &["`rig.shaker.amplifier`", "did you mean \"voltage\"?"]);
}

#[test]
fn a_shaker_too_fast_for_the_tick_is_refused() {
    let shaker = "shaker = { moving_mass_kg = 0.001 }\nnoise_seed = 7";
    refused("noise_seed = 7", shaker, &["`rig.shaker.moving_mass_kg` = 0.001", "high enough for the sampling rate"]);
}

#[test]
fn a_spring_with_two_targets_or_none_is_refused() {
    let before = "friction_damper = { friction_ratio = 0.4 }";
    refused(
        before,
        "friction_damper = { spring = { friction_ratio = 0.6, deflection_m = 0.001 } }",
        &["friction_damper.spring.deflection_m` = 0.001", "`friction_ratio` is given too", "leave out"],
    );
    refused(before, "friction_damper = { spring = {} }", &["friction_ratio", "`normal_force_n` or `deflection_m`"]);
    refused(
        before,
        "friction_damper = { friction_ratio = 0.6, spring = { normal_force_n = 2.0 } }",
        &["friction_damper.friction_ratio` = 0.6", "`spring` is given too"],
    );
}

#[test]
fn a_case_that_is_run_as_a_campaign_is_answered_with_the_command_that_simulates_it() {
    let case = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n\
                base = { kind = \"sine\", amplitude_m = 0.001, frequency_hz = 2.5 }\nrun = { duration_s = 40 }\n";
    let output = damprig(&folder_with(case)).args(["run", "test.toml"]).output().unwrap();
    let answer = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && answer.contains("damprig simulate test.toml"), "{answer}");
}
