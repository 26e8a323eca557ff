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
