//! Full disks, read-only disks and removed folders: the error is reported, the rig is stopped, and earlier points can be
//! read.

#[cfg(target_os = "linux")]
mod linux {
    use std::path::{Path, PathBuf};
    use std::process::Command;

    use damprig::run_folder::journal::{self, Journal, JournalEntry};
    use damprig_protocol::{Request, ToDevice};
    use predicates::prelude::*;
    use predicates::str::contains;
    use tempfile::TempDir;

    use crate::common::{Fate, Served, damprig, folder_with, is_point, manifest, result_rows, sample_rows, short};

    /// A small file system in memory; unmounted on drop.
    struct Small(PathBuf);

    impl Small {
        /// Mounts the file system; returns `None` and prints a message where mounting is not permitted.
        fn mount(at: &Path, size: &str) -> Option<Self> {
            std::fs::create_dir(at).unwrap();
            let options = format!("size={size}");
            let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &options, "none"]).arg(at).output();
            if mounted.is_ok_and(|m| m.status.success()) {
                return Some(Self(at.to_path_buf()));
            }
            eprintln!("not tested: this user may not mount a tmpfs");
            None
        }

        fn remount(&self, options: &str) {
            let options = format!("remount,{options}");
            assert!(Command::new("mount").args(["-o", &options]).arg(&self.0).status().unwrap().success());
        }
    }

    impl Drop for Small {
        fn drop(&mut self) {
            let _ = Command::new("umount").arg("-l").arg(&self.0).status();
        }
    }

    /// A campaign with much telemetry and few results.
    fn voluminous() -> String {
        let many = "frequencies_hz = { from_hz = 2.2, to_hz = 2.8, step_hz = 0.025 }";
        short().replace("frequencies_hz = [2.4, 2.5, 2.6]", many).replace("rate_hz = 100", "rate_hz = 1000")
    }

    #[test]
    fn a_full_disk_stops_the_rig_and_the_run_is_resumed_when_there_is_room() {
        let folder = folder_with(&voluminous());
        let Some(disk) = Small::mount(&folder.path().join("disk"), "600k") else { return };
        let board = Served::start(|_| Fate::Pass);
        let arguments = ["run", "test.toml", "--rig", &board.rig, "--out", "disk/run"];
        let answer = damprig(&folder).args(arguments).assert().code(1);
        let answer = answer.stderr(contains("No space left on device").and(contains("points are kept in disk/run")));
        let said = String::from_utf8(answer.get_output().stdout.clone()).unwrap();
        assert!(board.was_left_standing(), "the rig was left driving");
        let run = folder.path().join("disk/run");
        let (points, samples) = (result_rows(&run), sample_rows(&run));
        assert!(points >= 1 && samples > 5000, "{points} points, {samples} rows");
        assert!(said.contains(&format!(" {samples} sample rows, ")), "{samples} rows can be read: {said}");
        assert!(!said.contains(" 0 lost") && !said.contains("inf") && !said.contains("-0.00 s"), "{said}");
        disk.remount("size=30m");
        let rig = Served::again_and_again(|_| Fate::Pass);
        damprig(&folder).args(["run", "--resume", "disk/run", "--rig", &rig]).assert().success();
        assert_eq!((result_rows(&run), manifest(&run)["status"].as_str()), (50, Some("complete")));
    }

    /// Runs the command in a shell after the shell command `first`.
    fn in_a_shell(folder: &TempDir, first: &str, arguments: &[&str]) -> assert_cmd::Command {
        let mut shell = assert_cmd::Command::new("sh");
        shell.current_dir(folder.path()).arg("-c").arg(format!("{first}; exec \"$0\" \"$@\""));
        shell.arg(assert_cmd::cargo::cargo_bin("damprig")).args(arguments);
        shell
    }

    #[test]
    fn a_file_size_limit_stops_the_rig_like_a_full_disk() {
        let folder = folder_with(&voluminous());
        let board = Served::start(|_| Fate::Pass);
        let arguments = ["run", "test.toml", "--rig", &board.rig, "--out", "out"];
        // In blocks of 512 bytes.
        let answer = in_a_shell(&folder, "ulimit -f 200", &arguments).assert().code(1);
        answer.stderr(contains("File too large").and(contains("points are kept in out")));
        assert!(board.was_left_standing(), "the rig was left driving");
        let run = folder.path().join("out");
        // A point's samples do not fit, so none has a result.
        assert!(sample_rows(&run) > 1000);
        damprig(&folder).args(["runs", "verify", "out"]).assert().code(1).stdout(contains("are missing").not());
        let rig = Served::again_and_again(|_| Fate::Pass);
        damprig(&folder).args(["run", "--resume", "out", "--rig", &rig]).assert().success();
        assert_eq!((result_rows(&run), manifest(&run)["status"].as_str()), (50, Some("complete")));
    }

    #[test]
    fn a_line_that_a_full_disk_cut_short_does_not_damage_the_next() {
        let folder = TempDir::new().unwrap();
        let Some(disk) = Small::mount(&folder.path().join("disk"), "64k") else { return };
        let entry = |length: usize| JournalEntry::Link { what: "x".repeat(length), at: String::new() };
        let mut journal = Journal::open(&disk.0).unwrap();
        journal.append(&entry(10)).unwrap();
        // Fills all blocks except the journal's last one.
        let rest = std::fs::write(disk.0.join("rest"), vec![0; 64 << 10]);
        assert!(rest.is_err(), "the disk is not full");
        let error = journal.append(&entry(9000)).unwrap_err().to_string();
        assert!(error.contains("No space left on device"), "{error}");
        let length = std::fs::metadata(disk.0.join("journal.jsonl")).unwrap().len();
        assert!(length > 100, "no part of the line was written, so the test checks nothing");
        std::fs::remove_file(disk.0.join("rest")).unwrap();
        journal.append(&entry(20)).unwrap();
        let lines = journal::read(&disk.0).unwrap();
        assert_eq!(lines.entries, [entry(10), entry(20)]);
        assert!(lines.damaged.is_empty() && lines.torn.is_empty());
    }

    #[test]
    fn a_simulation_on_a_full_disk_leaves_no_file() {
        let folder = folder_with(&short());
        let Some(disk) = Small::mount(&folder.path().join("disk"), "64k") else { return };
        let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases/spid.toml");
        for name in ["disk/motion.csv", "disk/motion.parquet"] {
            let arguments = ["simulate", case.to_str().unwrap(), "--out", name, "--rate", "5000"];
            let answer = damprig(&folder).args(arguments).assert().code(1);
            answer.stderr(contains("No space left on device").and(contains(name)));
            let left: Vec<_> = std::fs::read_dir(&disk.0).unwrap().map(|e| e.unwrap().file_name()).collect();
            assert!(left.is_empty(), "{left:?}");
        }
    }

    /// Forty points in forty parts of some kilobytes.
    fn study() -> TempDir {
        let study = crate::study_work::short_study();
        crate::study::folder(
            &study.replace("points_per_part = 2", "points_per_part = 1").replace("count = 12", "count = 40"),
        )
    }

    #[test]
    fn a_study_on_a_full_disk_keeps_its_parts_and_goes_on_when_there_is_room() {
        let folder = study();
        let Some(disk) = Small::mount(&folder.path().join("disk"), "160k") else { return };
        let run = ["study", "run", "study.toml", "--out", "disk/out"];
        let parts = || std::fs::read_dir(folder.path().join("disk/out/parts")).unwrap().count();
        let answer = damprig(&folder).args(run).assert().code(1);
        let kept = parts();
        assert!((1..40).contains(&kept), "{kept} parts fit");
        let words = format!("{kept} of 40 parts are kept in disk/out");
        answer
            .stderr(contains("No space left on device").and(contains(words)).and(contains("the same command goes on")));
        let first =
            std::fs::metadata(folder.path().join("disk/out/parts/00000000.parquet")).unwrap().modified().unwrap();
        let claim = ["study", "work", "study.toml", "--out", "disk/out", "--shard", "1/1"];
        let answer = damprig(&folder).args(claim).assert().code(1);
        answer.stderr(contains("No space left on device").and(contains(format!("{kept} of 40 parts are kept"))));
        disk.remount("size=30m");
        damprig(&folder).args(run).assert().success();
        damprig(&folder).args(["study", "verify", "study.toml", "--out", "disk/out"]).assert().success();
        let now = std::fs::metadata(folder.path().join("disk/out/parts/00000000.parquet")).unwrap().modified().unwrap();
        assert_eq!((parts(), now), (40, first), "the parts of before are not computed again");
    }

    #[test]
    fn a_full_disk_while_a_study_is_joined_or_drawn_keeps_what_is_complete() {
        let folder = study();
        let Some(disk) = Small::mount(&folder.path().join("disk"), "30m") else { return };
        damprig(&folder)
            .args(["study", "work", "study.toml", "--out", "disk/out", "--shard", "1/1"])
            .assert()
            .success();
        let fill = |left: usize| {
            let free = || {
                let said = Command::new("df").args(["--output=avail", "-B1"]).arg(&disk.0).output().unwrap().stdout;
                String::from_utf8(said).unwrap().lines().last().unwrap().trim().parse::<usize>().unwrap()
            };
            let _ = std::fs::remove_file(disk.0.join("rest"));
            std::fs::write(disk.0.join("rest"), vec![0; free() - left]).unwrap();
        };
        let merge = ["study", "merge", "study.toml", "--out", "disk/out"];
        fill(0);
        let answer = damprig(&folder).args(merge).assert().code(1);
        answer.stderr(contains("No space left on device").and(contains("40 of 40 parts are kept")));
        assert!(!disk.0.join("out/table.parquet").exists(), "no half of a table");
        // Room for the table and its digest, and not for the figures.
        fill(32 << 10);
        let answer = damprig(&folder).args(merge).assert().code(1);
        answer.stderr(contains("No space left on device").and(contains("disk/out/table.parquet is complete")));
        std::fs::remove_file(disk.0.join("rest")).unwrap();
        damprig(&folder).args(merge).assert().success();
        damprig(&folder).args(["study", "verify", "study.toml", "--out", "disk/out"]).assert().success();
    }

    #[test]
    fn bifurcations_optimisations_and_continuations_on_a_full_disk_name_the_file_and_leave_none_cut_short() {
        let folder = study();
        let Some(disk) = Small::mount(&folder.path().join("disk"), "16k") else { return };
        let shipped = |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join(name).display().to_string();
        std::fs::write(
            folder.path().join("optimise.toml"),
            "case = \"case.toml\"\nobjective = \"x_over_z\"\nevaluations = 100\n[[variable]]\nkey = \"particle.clearance_ratio\"\nfrom = 8\nto = 12\n",
        )
        .unwrap();
        let bifurcation =
            ["study", "bifurcation", "case.toml", "--axis", "particle.clearance_ratio=9:10:9", "--out", "disk/b"];
        for arguments in [
            bifurcation.map(str::to_string).to_vec(),
            ["continue", &shipped("continuations/clearance.toml"), "--out", "disk/c"].map(str::to_string).to_vec(),
            ["optimise", "optimise.toml", "--out", "disk/o"].map(str::to_string).to_vec(),
        ] {
            let answer = damprig(&folder).args(&arguments).assert().code(1);
            answer.stderr(contains("No space left on device").and(contains("cannot write disk/")));
            for entry in std::fs::read_dir(disk.0.join(&arguments.last().unwrap()[5..])).unwrap() {
                let name = entry.unwrap().file_name().into_string().unwrap();
                assert!(!name.contains(".tmp"), "{arguments:?} left {name}");
            }
            std::fs::remove_dir_all(disk.0.join(&arguments.last().unwrap()[5..])).unwrap();
        }
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_reported_before_anything_moves() {
        let folder = folder_with(&short());
        let board = Served::start(|_| Fate::Pass);
        let arguments = ["run", "test.toml", "--rig", &board.rig, "--out", "/proc/damprig"];
        let answer = damprig(&folder).args(arguments).assert().code(1);
        answer.stderr(contains("cannot create the folder /proc/damprig"));
        let moved = |m: &ToDevice| matches!(m, ToDevice::Request(r) if r.request == Request::Start);
        assert!(!board.received().iter().any(moved));
    }

    #[test]
    fn on_a_read_only_disk_resuming_is_refused_and_the_run_can_be_read() {
        let folder = folder_with(&short());
        let Some(disk) = Small::mount(&folder.path().join("disk"), "30m") else { return };
        let mut points = 0;
        let rig = Served::again_and_again(move |message| {
            points += usize::from(is_point(message));
            if is_point(message) && points == 4 { Fate::Close } else { Fate::Pass }
        });
        let arguments = ["run", "test.toml", "--rig", &rig, "--out", "disk/run", "--reconnect-s", "0"];
        damprig(&folder).args(arguments).assert().code(1);
        disk.remount("ro");
        let answer = damprig(&folder).args(["run", "--resume", "disk/run"]).assert().code(1);
        answer.stderr(contains("cannot open disk/run/journal.jsonl").and(contains("Read-only file system")));
        let run = folder.path().join("disk/run");
        assert_eq!(result_rows(&run), 3);
        assert!(sample_rows(&run) > 1500);
    }

    #[test]
    fn a_folder_removed_during_the_run_is_detected_and_the_rig_stopped() {
        let folder = folder_with(&voluminous());
        let run = folder.path().join("out");
        let (mut points, gone) = (0, run.clone());
        let board = Served::start(move |message| {
            points += usize::from(is_point(message));
            if is_point(message) && points == 2 {
                // The run may create a file while its folder is being emptied.
                while gone.exists() {
                    let _ = std::fs::remove_dir_all(&gone);
                }
            }
            Fate::Pass
        });
        let arguments = ["run", "test.toml", "--rig", &board.rig, "--out", "out"];
        let answer = damprig(&folder).args(arguments).assert().code(1);
        answer.stderr(contains("cannot").and(contains("out")).and(contains("No such file or directory")));
        assert!(board.was_left_standing(), "the rig was left driving");
        assert!(!run.join("results.parquet").exists(), "a removed folder is not created again");
    }
}
