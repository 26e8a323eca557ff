//! Names, labels and files that are not what they should be: shown harmlessly, refused in bounded time, in plain words.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::time::{Duration, Instant};

use crate::common::{damprig, folder_with, short};
use damprig_device::board::DeviceInfo;
use damprig_simulator::device::SimulatedDevice;
use predicates::prelude::*;
use predicates::str::contains;
use tempfile::TempDir;

const EVIL: &str = r"a\u001b[2J\u009b\u202eb\u0007\u0000\ufeff<&";

/// No control character but line ends and tabs, no direction mark.
fn is_harmless(text: &str) -> bool {
    text.chars().all(|c| {
        (!c.is_control() || c == '\n' || c == '\t')
            && !matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}')
    })
}

fn stdout_and_stderr(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, String) {
    let output = damprig(folder).args(arguments).output().unwrap();
    let text = String::from_utf8([output.stdout, output.stderr].concat()).expect("UTF-8");
    (output.status.code(), text)
}

#[test]
fn control_characters_in_names_and_labels_reach_no_terminal_figure_or_page() {
    let names = format!("name = \"{EVIL}\"\nlabel = \"{EVIL}\"");
    let campaign = short().replace("name = \"bare\"\nlabel = \"Bare structure\"", &names);
    let campaign = campaign.replace("name = \"sweep\"", &format!("name = \"{EVIL}\""));
    let transient = format!(
        "{campaign}\n[[experiment]]\nname = \"r{EVIL}\"\nkind = \"free_vibration\"\nstart_m = 0.02\nmeasure_s = 2\n"
    );
    let folder = folder_with(&transient);
    let commands: [&[&str]; 6] = [
        &["run", "test.toml", "--dry-run"],
        &["run", "test.toml", "--out", "out"],
        &["runs", "show", "out"],
        &["runs", "verify", "out"],
        &["runs", "report", "out", "--out", "page.html"],
        &["runs", "export", "out", "--format", "uff", "--out", "o.uff"],
    ];
    for command in commands {
        let (code, text) = stdout_and_stderr(&folder, command);
        assert_eq!(code, Some(0), "{command:?}: {text}");
        assert!(is_harmless(&text), "{command:?}: {text:?}");
    }
    for file in ["out/figure.svg", "out/transients.svg", "out/report.html", "page.html"] {
        let text = std::fs::read_to_string(folder.path().join(file)).unwrap();
        assert!(is_harmless(&text) && text.contains(r"\u{1b}[2J"), "{file}");
    }
    for file in ["out/figure.png", "out/transients.png"] {
        assert!(std::fs::metadata(folder.path().join(file)).unwrap().len() > 10_000, "{file}");
    }
    // An error names the set-up.
    let far = transient.replace("base_amplitude_m = 0.0004", "base_amplitude_m = 0.004");
    std::fs::write(folder.path().join("test.toml"), far).unwrap();
    let (code, text) = stdout_and_stderr(&folder, &["run", "test.toml", "--dry-run"]);
    assert!(code == Some(2) && is_harmless(&text), "{text:?}");
}

#[test]
fn control_characters_in_a_case_reach_no_terminal_and_no_figure() {
    let case = format!(
        "name = \"{EVIL}\"\nstructure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n\
         base = {{ kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }}\nrun = {{ duration_s = 4 }}\n"
    );
    let folder = folder_with(&case);
    let (code, text) = stdout_and_stderr(&folder, &["simulate", "test.toml", "--plot", "motion.svg"]);
    assert!(code == Some(0) && is_harmless(&text), "{text:?}");
    assert!(is_harmless(&std::fs::read_to_string(folder.path().join("motion.svg")).unwrap()));
    std::fs::write(folder.path().join("test.toml"), case.replace("mass_kg", "\"mass\\u001b[2J_kg\"")).unwrap();
    let (code, text) = stdout_and_stderr(&folder, &["simulate", "test.toml"]);
    assert!(code == Some(2) && is_harmless(&text) && text.contains("unknown key"), "{text:?}");
}

#[test]
fn the_boards_own_name_is_shown_harmlessly() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let rig = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let info = DeviceInfo::new("1\u{1b}[31m", "board\u{1b}]0;x\u{7}\u{202e}");
            let mut board = Box::new(SimulatedDevice::<f64>::new(info));
            let mut reader = BufReader::new(stream.try_clone().unwrap());
            while let Ok(bytes) = reader.fill_buf().map(<[u8]>::to_vec) {
                if bytes.is_empty() {
                    break;
                }
                reader.consume(bytes.len());
                board.receive(&bytes);
                while board.run(1000, |frame| _ = stream.write_all(frame))
                    == damprig_simulator::device::Progress::Running
                {}
            }
        }
    });
    let folder = folder_with(&short());
    for command in [
        &["settings", "show", "--rig", &rig][..],
        &["run", "test.toml", "--dry-run", "--rig", &rig],
        &["run", "test.toml", "--out", "out", "--rig", &rig],
        &["runs", "show", "out"],
    ] {
        let (code, text) = stdout_and_stderr(&folder, command);
        assert!(code == Some(0) && is_harmless(&text) && text.contains(r"board\u{1b}]0;x"), "{command:?}: {text:?}");
    }
    assert!(is_harmless(&std::fs::read_to_string(folder.path().join("out/report.html")).unwrap()));
}

#[test]
fn thousands_of_problems_are_reported_as_the_first_twenty_in_linear_time() {
    let keys = |count: usize| (0..count).map(|n| format!("key_{n} = {n}\n")).collect::<String>();
    // The fastest of three: the machine may be loaded.
    let time = |text: &str, check: &dyn Fn(&str)| {
        let folder = folder_with(text);
        let once = || {
            let begun = Instant::now();
            let (code, answer) = stdout_and_stderr(&folder, &["run", "test.toml", "--dry-run"]);
            assert_eq!(code, Some(2));
            check(&answer);
            begun.elapsed()
        };
        once().min(once()).min(once())
    };
    let took = time(&keys(40_000), &|answer| {
        assert!(answer.lines().count() < 200, "{} lines", answer.lines().count());
        // Two of the twenty say what is missing.
        assert_eq!(answer.matches("unknown key `key_").count(), 18, "{answer}");
        assert!(answer.contains("these are the first 20"), "{answer}");
    });
    // A quadratic search would take minutes.
    assert!(took < Duration::from_secs(20), "{took:?}");
    // Names long enough to be slow to compare.
    let long: String = (0..70).map(|n| format!("{}{n} = 1\n", "k".repeat(2_000))).collect();
    let took = time(&long, &|answer| assert!(answer.len() < 400_000, "{} bytes", answer.len()));
    assert!(took < Duration::from_secs(20), "{took:?}");
}

#[test]
fn an_empty_or_overlong_list_of_frequencies_is_shown_as_such_and_not_as_its_table() {
    let list = "frequencies_hz = [2.4, 2.5, 2.6]";
    let empty = folder_with(&short().replace(list, "frequencies_hz = []"));
    damprig(&empty)
        .args(["run", "test.toml"])
        .assert()
        .code(2)
        .stderr(contains("`experiment[1].frequencies_hz` = [] is not allowed").and(contains("[[experiment]]").not()));
    let many = format!("frequencies_hz = [{}]", "2.5, ".repeat(401));
    damprig(&folder_with(&short().replace(list, &many)))
        .args(["run", "test.toml"])
        .assert()
        .code(2)
        .stderr(contains("`experiment[1].frequencies_hz` holds 401 frequencies").and(contains("at most 400")));
}

#[test]
fn nothing_is_suggested_that_was_written() {
    let folder = folder_with(&short());
    #[cfg(unix)]
    std::os::unix::fs::symlink("gone.toml", folder.path().join("link.toml")).unwrap();
    damprig(&folder).args(["run", "link.toml"]).assert().code(2).stderr(contains("did you mean ./link.toml").not());
}

#[test]
fn a_setting_too_small_for_the_board_is_quoted_as_written() {
    for value in ["1e-300", "1e300"] {
        damprig(&folder_with(""))
            .args(["settings", "set", &format!("spring.step_m={value}")])
            .assert()
            .code(2)
            .stderr(contains(value).and(contains("single precision")).and(contains("0.0").not()));
    }
    damprig(&folder_with(""))
        .args(["settings", "set", "spring.step_m=-7e3"])
        .assert()
        .code(2)
        .stderr(contains("`spring.step_m` = -7e3 is not allowed"));
}

#[test]
fn a_run_that_soon_becomes_fast_is_not_estimated_at_months() {
    let case = "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n\
        particle = { mass_ratio = 0.1, clearance_m = 1e-7, wall = { kind = \"restitution\", coefficient = 0.9999 } }\n\
        initial = { x_m = 0.01, y_m = 0.01, v_m_per_s = 0, u_m_per_s = 1 }\nrun = { duration_s = 1 }\n";
    let (code, text) = stdout_and_stderr(&folder_with(case), &["simulate", "test.toml"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(!text.contains("days") && !text.contains("years"), "{text}");
}

#[test]
fn rounding_noise_is_not_scaled_to_a_motion() {
    let with = |record: &str, keys: &str| {
        let experiment = format!(
            "[[experiment]]\nkind = \"playback\"\nfile = \"r.csv\"\ntime_step_s = 0.01\ntarget_peak_m = 0.003\n{keys}\n"
        );
        let (head, _) = short().split_once("[[experiment]]").map(|(a, b)| (a.to_string(), b.to_string())).unwrap();
        let folder = folder_with(&format!("{head}{experiment}"));
        std::fs::write(folder.path().join("r.csv"), record).unwrap();
        stdout_and_stderr(&folder, &["run", "test.toml", "--dry-run"])
    };
    let tiny: String = (0..50).map(|n| format!("{}e-17\n", (n * 7) % 11 - 5)).collect();
    let (code, text) = with(&tiny, "quantity = \"displacement\"\nunit = \"m\"\nramp_s = 0.05");
    assert!(code == Some(2) && text.contains("rounding, not a motion"), "{text}");
    let constant: String = (0..500).map(|_| "0.1\n").collect();
    let (code, text) = with(&constant, "quantity = \"acceleration\"\nunit = \"m/s2\"\nramp_s = 0.05");
    assert!(code == Some(2) && text.contains("rounding, not a motion"), "{text}");
}

#[test]
fn a_mistyped_first_row_is_an_error_and_no_header() {
    let with = |record: &str, keys: &str| {
        let case = format!(
            "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\nrun = {{ duration_s = 1 }}\n\
             base = {{ kind = \"record\", file = \"r.csv\", quantity = \"acceleration\", unit = \"g\"{keys} }}\n"
        );
        let folder = folder_with(&case);
        std::fs::write(folder.path().join("r.csv"), record).unwrap();
        stdout_and_stderr(&folder, &["simulate", "test.toml"])
    };
    let rest = "0.1,0.2\n0.2,-0.1\n0.3,0.1\n";
    for first in ["O.O,O.1", "0..0,0.1x", "-,-", "0.0s,0.1g", "x0.0,x0.1"] {
        let (code, text) = with(&format!("{first}\n{rest}"), "");
        assert!(code == Some(2) && (text.contains("line 1") || text.contains("line 2")), "{first}: {text}");
    }
    for header in ["t,a", "Zeit (s),Beschleunigung (g)", "l1,I2", "_t,ζ", "t_s,a_g"] {
        let (code, text) = with(&format!("{header}\n0.0,0.0\n{rest}"), "");
        assert_eq!(code, Some(0), "{header}: {text}");
    }
    let (code, text) = with("x0.1\n0.2\n0.3\n", ", time_step_s = 0.1");
    assert!(code == Some(2) && text.contains("line 1, column 1: \"x0.1\" is not allowed"), "{text}");
}
