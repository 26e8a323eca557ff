//! The script in host/studies/cluster: a SLURM job array on this machine. Left out where SLURM is not installed.

use std::path::Path;
use std::process::{Command, Output};

use crate::study::folder;
use crate::study_work::{short_study, table, undisturbed};
use tempfile::TempDir;

/// Code with which tests/cluster/with-slurm says that there is no SLURM.
const LEFT_OUT: i32 = 77;

fn run(folder: &TempDir, program: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(program);
    command.current_dir(folder.path()).env("DAMPRIG", assert_cmd::cargo::cargo_bin!("damprig"));
    command.args(arguments).output().unwrap()
}

fn top() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn script(name: &str) -> String {
    top().join("host/studies/cluster").join(name).to_str().unwrap().into()
}

#[test]
fn a_slurm_job_array_makes_the_table_of_one_run() {
    let folder = folder(&short_study());
    let expected = undisturbed(&folder);
    // The job that joins the parts is the last one.
    let wait = "\"$0\" study.toml out 3 && while [ -n \"$(squeue -h)\" ]; do sleep 0.2; done";
    let output = run(
        &folder,
        &top().join("tests/cluster/with-slurm"),
        &["timeout", "120", "bash", "-c", wait, &script("slurm.sh")],
    );
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    if output.status.code() == Some(LEFT_OUT) {
        println!("left out: no SLURM here (Debian's slurm-wlm and munge, as root)");
        return;
    }
    assert!(output.status.success(), "{said}");
    assert!(said.contains("of 3 shares"), "{said}");
    assert_eq!(table(&folder, "out"), expected, "{said}");
}

/// Writes down its arguments, a line for each call, and answers with the number of a job.
const SBATCH: &str = "#!/bin/sh\necho \"$@\" >> submitted\necho 17\n";

#[test]
fn the_job_that_joins_has_account_partition_and_quality_of_service_of_the_shares_and_nothing_else() {
    for (options, joining) in [
        ("--account=lab --partition=long --cpus-per-task=16 --qos=low", "--account=lab --partition=long --qos=low"),
        ("-A lab -p long --time=4:00:00", "-A lab -p long"),
        ("--mem 4G --account lab -plong", "--account lab -plong"),
        ("--cpus-per-task=16", ""),
    ] {
        let folder = folder(&short_study());
        let programs = folder.path().join("programs");
        std::fs::create_dir(&programs).unwrap();
        std::fs::write(programs.join("sbatch"), SBATCH).unwrap();
        let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
        let call = format!("chmod +x programs/sbatch && PATH=\"{path}\" \"$0\" study.toml out 3 {options}");
        let output = run(&folder, Path::new("bash"), &["-c", &call, &script("slurm.sh")]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let submitted = std::fs::read_to_string(folder.path().join("submitted")).unwrap();
        let [array, merge] = submitted.lines().collect::<Vec<_>>()[..] else { panic!("two jobs: {submitted}") };
        assert!(array.contains("--array=1-3") && array.contains(options), "{array}");
        let (_, after) = merge.split_once("DAMPRIG_STEP=merge").expect("the step");
        let (given, _) = after.split_once("/").expect("the script");
        assert_eq!(given.trim(), joining, "{merge}");
        assert!(merge.contains("--dependency=afterok:17"), "{merge}");
    }
}
