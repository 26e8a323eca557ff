//! The exit codes are those of docs/EXIT_CODES.md: its table is run command by command.

use std::path::Path;

use crate::common::{PATIENCE, damprig, folder_with, short};
use tempfile::TempDir;

/// Situation, command line and exit code of every row that has a command.
fn rows() -> Vec<(String, Vec<String>, i32)> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/EXIT_CODES.md");
    let text = std::fs::read_to_string(path).unwrap();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, what, command, code, _] = cells[..] else { return None };
        let command = command.strip_prefix("`damprig ")?.strip_suffix('`')?;
        Some((what.to_string(), command.split(' ').map(str::to_string).collect(), code.parse().ok()?))
    };
    text.lines().filter_map(row).collect()
}

/// A folder with everything that the rows name.
fn folder() -> TempDir {
    let folder = folder_with("");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("good.toml", &short());
    write("wrong.toml", "name = 3\nstructure = 4\n");
    write("refused.toml", &short().replace("friction_ratio = 0.4", "spring = { friction_ratio = 20 }"));
    write("faulty.toml", &short().replace("noise_seed = 7", "noise_seed = 7\nwall_force_limit_n = 30"));
    write(
        "case.toml",
        "structure = { mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }\n\
         base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\nrun = { duration_s = 4 }\n",
    );
    for taken in ["taken.csv", "taken.html", "taken.toml", "taken.svg"] {
        write(taken, "mine");
    }
    for run in ["done", "damaged"] {
        damprig(&folder).args(["run", "good.toml", "--out", run]).assert().success();
    }
    for file in ["damaged/results.parquet", "damaged/campaign.toml"] {
        write(file, "not what was recorded");
    }
    write(
        "study.toml",
        "case = \"case.toml\"\nmetrics = [\"x_over_z\"]\n[[axis]]\nkey = \"base.frequency_hz\"\nvalues = [2.4, 2.6]\n",
    );
    for out in ["studied", "damaged-study"] {
        damprig(&folder).args(["study", "run", "study.toml", "--out", out]).assert().success();
    }
    write("damaged-study/parts/00000000.parquet", "not what was computed");
    folder
}

#[test]
fn every_command_ends_with_the_exit_code_of_the_table() {
    let (folder, rows) = (folder(), rows());
    assert!(rows.len() > 50, "{} rows", rows.len());
    let commands =
        ["run", "devices", "runs", "settings", "calibrate", "simulate", "init", "schema", "keys", "man", "completions"];
    assert!(commands.iter().all(|command| rows.iter().any(|(_, line, _)| line[0] == *command)), "a command is missing");
    for (what, arguments, code) in rows {
        let mut command = damprig(&folder);
        command.env("DISPLAY", "").args(&arguments);
        if arguments[0] == "runs" && arguments.len() == 1 {
            // The default folder of runs.
            std::fs::create_dir_all(folder.path().join("runs")).unwrap();
        }
        let output = command.output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{what}: {arguments:?}: {told}");
        // A failure says why.
        assert!(code == 0 || told.lines().any(|line| line.starts_with("error: ")), "{what}: {arguments:?}: {told}");
        for taken in ["taken.csv", "taken.html", "taken.toml", "taken.svg"] {
            assert_eq!(std::fs::read_to_string(folder.path().join(taken)).unwrap(), "mine", "{arguments:?}");
        }
    }
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_run_and_a_simulation_with_130() {
    use std::process::{Command, Stdio};
    use std::time::Instant;

    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("long.toml"), short().replace("dwell_s = 4.0", "dwell_s = 1e5")).unwrap();
    std::fs::write(
        path("long-case.toml"),
        std::fs::read_to_string(path("case.toml")).unwrap().replace("duration_s = 4", "duration_s = 1e9"),
    )
    .unwrap();
    for arguments in [&["run", "long.toml", "--out", "long"][..], &["simulate", "long-case.toml", "--out", "long.csv"]]
    {
        for signal in ["-INT", "-TERM"] {
            let _ = std::fs::remove_dir_all(path("long"));
            for left in std::fs::read_dir(folder.path()).unwrap().flatten() {
                if left.file_name().to_string_lossy().starts_with("long.csv") {
                    std::fs::remove_file(left.path()).unwrap();
                }
            }
            let begun = Instant::now();
            let before = std::fs::read_dir(folder.path()).unwrap().count();
            let mut child = Command::new(assert_cmd::cargo::cargo_bin("damprig"))
                .args(arguments)
                .current_dir(folder.path())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            // The signals are watched before the first file is created.
            let files = || std::fs::read_dir(folder.path()).unwrap().count();
            while files() == before {
                assert!(child.try_wait().unwrap().is_none(), "{arguments:?} ended by itself");
                assert!(begun.elapsed() < PATIENCE, "{arguments:?} created no file");
                std::thread::yield_now();
            }
            assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
            assert_eq!(child.wait().unwrap().code(), Some(130), "{arguments:?} {signal}");
        }
    }
}

#[test]
fn shell_completions_and_manual_pages_know_every_command_and_flag() {
    let folder = folder_with("");
    let print = |arguments: &[&str]| {
        let output = damprig(&folder).args(arguments).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let text = print(&["completions", shell]);
        for word in ["dry-run", "simulate", "export", "completions"] {
            assert!(text.contains(word), "{shell}: no {word}");
        }
    }
    assert!(print(&["man"]).contains("damprig\\-simulate(1)"));
    let page = print(&["man", "runs", "export"]);
    assert!(page.starts_with(".ie") || page.starts_with(".TH"), "{page}");
    for word in ["damprig\\-runs\\-export", "\\-\\-format", "UFF"] {
        assert!(page.contains(word), "no {word} in:\n{page}");
    }
}
