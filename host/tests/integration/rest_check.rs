//! The check after a prompt: a board with a real structure, and a person at a pseudo-terminal.

#![cfg(unix)]

use std::fs::File;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use predicates::prelude::*;
use predicates::str::contains;
use serde_json::json;
use serialport::{SerialPort, TTYPort};
use tempfile::TempDir;

use crate::common::real_board::{Changed, real_board};
use crate::common::{damprig, folder_with, result_rows, short};
use crate::monitor::Viewer;

/// One point on the bare structure; a sweep that carries its motion over starts without waiting for rest.
fn campaign(start: &str) -> String {
    short()
        .replace("frequencies_hz = [2.4, 2.5, 2.6]", "frequencies_hz = [2.5]\nset_ups = [\"bare\"]")
        .replace("start = \"from_rest\"", &format!("start = \"{start}\""))
}

/// A run, and the terminal at which its person types.
struct Operated {
    run: Child,
    terminal: TTYPort,
    prompts: ChildStderr,
    told: String,
    /// Everything before it was told before the last answer.
    seen: usize,
}

impl Operated {
    fn start(folder: &TempDir, arguments: &[&str]) -> Self {
        let (terminal, mut other) = TTYPort::pair().expect("a pseudo-terminal");
        other.set_exclusive(false).expect("others may open it");
        let keyboard = File::open(other.name().expect("a pseudo-terminal has a name")).expect("it opens");
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("damprig"));
        command.arg("run").args(arguments).current_dir(folder.path());
        let pipes = command.stdin(keyboard).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut run = pipes.spawn().expect("the command starts");
        let prompts = run.stderr.take().expect("a pipe");
        Self { run, terminal, prompts, told: String::new(), seen: 0 }
    }

    /// Waits until the run says this; a prompt has no end of line.
    fn hears(&mut self, words: &str) {
        let mut byte = [0];
        let mut bytes = Vec::new();
        while !self.told[self.seen..].contains(words) {
            let count = self.prompts.read(&mut byte).expect("a pipe");
            assert!(count > 0, "no {words:?} in:\n{}", self.told);
            bytes.push(byte[0]);
            if let Ok(text) = std::str::from_utf8(&bytes) {
                self.told += text;
                bytes.clear();
            }
        }
    }

    fn types(&mut self, line: &str) {
        self.seen = self.told.len();
        writeln!(self.terminal, "{line}").expect("the terminal is there");
    }

    /// The exit code, and everything that was told.
    fn ends(mut self) -> (Option<i32>, String) {
        self.prompts.read_to_string(&mut self.told).expect("text");
        (self.run.wait().expect("it ends").code(), self.told)
    }
}

fn journal(folder: &TempDir) -> String {
    std::fs::read_to_string(folder.path().join("out/journal.jsonl")).expect("a journal")
}

fn run(folder: &TempDir) -> PathBuf {
    folder.path().join("out")
}

/// No row of the check was taken for one of the run, or for one that does not belong.
fn is_verified(folder: &TempDir) {
    damprig(folder).args(["runs", "verify", "out"]).assert().success();
}

const ASKED: &str = "s stops (--resume continues the run): ";

#[test]
fn a_zero_that_has_shifted_is_told_before_the_drive_starts_and_measured_again() {
    let (folder, changed) = (folder_with(&campaign("from_rest")), Arc::new(Changed::default()));
    changed.x_um.store(2000, Ordering::Relaxed);
    let rig = real_board(&changed);
    let mut person = Operated::start(&folder, &["test.toml", "--rig", &rig, "--out", "out"]);
    person.hears("Press Enter when ready. ");
    person.types("");
    person.hears(ASKED);
    for words in
        ["\"bare\" is not at rest before experiment \"sweep\"", "x mean +2.000 mm", "below 0.1 mm (rest_level_m)"]
    {
        assert!(person.told.contains(words), "no {words:?} in:\n{}", person.told);
    }
    assert!(person.told.contains("the zero of x has shifted"), "{}", person.told);
    assert!(!journal(&folder).contains("\"segment\""), "nothing was started: {}", journal(&folder));
    // Asked again as long as nothing has changed, and after what is no answer.
    person.types("what?");
    person.hears(ASKED);
    person.types("");
    person.hears(ASKED);
    changed.x_um.store(20, Ordering::Relaxed);
    person.types("");
    let (code, told) = person.ends();
    assert_eq!(code, Some(0), "{told}");
    is_verified(&folder);
    assert_eq!(result_rows(&run(&folder)), 1);
    let journal = journal(&folder);
    assert_eq!(journal.matches("not at rest: set-up").count(), 2, "{journal}");
    assert!(journal.contains("\"at rest: set-up") && journal.contains("x mean +0.020 mm, RMS about it 0.000 mm"));
}

/// Stops the run on its page while it waits at a question.
fn stop_on_the_page(person: &mut Operated) {
    let url = person.told.lines().find_map(|line| line.strip_prefix("Monitor: http://")).expect("a page").to_string();
    let (address, token) = url.split_once("/#token=").expect("a token");
    let mut viewer = Viewer::with_token(address, token).expect("a place");
    let answer = viewer.ask(json!({"id": 1, "do": "stop", "token": token}));
    assert_eq!(answer["ok"], true, "{answer}");
    viewer.until(|message| message["state"]["activity"] == "over");
}

#[test]
fn a_stop_on_the_page_ends_a_run_that_waits_for_an_answer_in_the_terminal() {
    let served = ["--monitor", "--control", "--listen", "127.0.0.1:0"];
    let (folder, changed) = (folder_with(&campaign("from_rest")), Arc::new(Changed::default()));
    changed.x_um.store(2000, Ordering::Relaxed);
    let rig = real_board(&changed);
    let start = [["test.toml", "--rig", &rig, "--out", "out"].as_slice(), &served].concat();
    let mut person = Operated::start(&folder, &start);
    person.hears("Press Enter when ready. ");
    stop_on_the_page(&mut person);
    let (code, told) = person.ends();
    assert_eq!(code, Some(130), "{told}");
    assert!(journal(&folder).contains("\"stopped on the live page\""));
    // And at the question of the check at rest.
    let again = [["--resume", "out", "--rig", &rig].as_slice(), &served].concat();
    let mut person = Operated::start(&folder, &again);
    person.hears("Press Enter when ready. ");
    person.types("");
    person.hears(ASKED);
    stop_on_the_page(&mut person);
    let (code, told) = person.ends();
    assert_eq!(code, Some(130), "{told}");
    assert!(!journal(&folder).contains("\"segment\""), "nothing was started: {}", journal(&folder));
}

#[test]
fn what_was_typed_before_the_question_does_not_start_the_drive() {
    let (folder, changed) = (folder_with(&campaign("carry_over")), Arc::new(Changed::default()));
    changed.x_um.store(300, Ordering::Relaxed);
    let rig = real_board(&changed);
    let mut person = Operated::start(&folder, &["test.toml", "--rig", &rig, "--out", "out"]);
    person.hears("Press Enter when ready. ");
    person.types("\ng");
    person.hears(ASKED);
    person.types("s");
    let (code, told) = person.ends();
    assert_eq!(code, Some(1), "{told}");
    let journal = journal(&folder);
    assert!(!journal.contains("went on") && !journal.contains("\"segment\""), "{journal}");
}

#[test]
fn a_structure_that_still_rings_is_not_taken_for_a_shifted_zero_and_the_person_may_go_on() {
    let (folder, changed) = (folder_with(&campaign("carry_over")), Arc::new(Changed::default()));
    changed.ringing_um.store(400, Ordering::Relaxed);
    let rig = real_board(&changed);
    let mut person = Operated::start(&folder, &["test.toml", "--rig", &rig, "--out", "out"]);
    person.hears("Press Enter when ready. ");
    person.types("");
    person.hears(ASKED);
    // 0.4 mm/√2 over whole periods.
    assert!(
        person.told.contains("RMS about it 0.283 mm") && person.told.contains("has not settled"),
        "{}",
        person.told
    );
    person.types("g");
    let (code, told) = person.ends();
    assert_eq!(code, Some(0), "{told}");
    is_verified(&folder);
    assert_eq!(result_rows(&run(&folder)), 1);
    assert!(journal(&folder).contains("went on although the rig was not at rest"), "{}", journal(&folder));
}

#[test]
fn a_run_that_was_stopped_because_a_target_is_out_of_the_beam_is_resumed_when_it_is_back() {
    let (folder, changed) = (folder_with(&campaign("from_rest")), Arc::new(Changed::default()));
    changed.x_is_lost.store(1, Ordering::Relaxed);
    let rig = real_board(&changed);
    let mut person = Operated::start(&folder, &["test.toml", "--rig", &rig, "--out", "out"]);
    person.hears("Press Enter when ready. ");
    person.types("");
    person.hears(ASKED);
    assert!(person.told.contains("x has no signal") && person.told.contains("not in the beam"), "{}", person.told);
    person.types("s");
    let (code, told) = person.ends();
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("was not at rest before experiment") && told.contains("--resume out"), "{told}");
    assert!(!journal(&folder).contains("\"segment\""), "nothing was started");
    changed.x_is_lost.store(0, Ordering::Relaxed);
    let mut person = Operated::start(&folder, &["--resume", "out"]);
    person.hears("Press Enter when ready. ");
    person.types("");
    let (code, told) = person.ends();
    assert_eq!(code, Some(0), "{told}");
    is_verified(&folder);
    assert!(!told.contains("not at rest") && result_rows(&run(&folder)) == 1, "{told}");
}

#[test]
fn what_a_person_did_for_an_experiment_is_checked_as_well() {
    let text =
        campaign("carry_over").replace("name = \"sweep\"", "name = \"sweep\"\nrepeats = 2\ninstruction = \"Oil\"");
    let (folder, changed) = (folder_with(&text), Arc::new(Changed::default()));
    let rig = real_board(&changed);
    let mut person = Operated::start(&folder, &["test.toml", "--rig", &rig, "--out", "out"]);
    for asked in ["Mount set-up", "\"sweep 1 of 2\": Oil."] {
        person.hears(asked);
        person.hears("Press Enter when ready. ");
        person.types("");
    }
    person.hears("\"sweep 2 of 2\": Oil.");
    changed.x_um.store(-300, Ordering::Relaxed);
    person.types("");
    person.hears(ASKED);
    assert!(person.told.contains("x mean -0.300 mm"), "{}", person.told);
    changed.x_um.store(0, Ordering::Relaxed);
    person.types("");
    let (code, told) = person.ends();
    assert_eq!(code, Some(0), "{told}");
    is_verified(&folder);
    assert_eq!(journal(&folder).matches("\"at rest: set-up").count(), 2, "{}", journal(&folder));
}

#[test]
fn without_questions_a_rig_that_is_not_at_rest_is_told_and_noted() {
    let (folder, changed) = (folder_with(&campaign("carry_over")), Arc::new(Changed::default()));
    changed.x_um.store(300, Ordering::Relaxed);
    let rig = real_board(&changed);
    let answer = damprig(&folder).args(["run", "test.toml", "--rig", &rig, "--out", "out", "--yes"]).assert().success();
    answer.stderr(contains("x mean +0.300 mm").and(contains("--yes: the run goes on")));
    assert!(journal(&folder).contains("went on although the rig was not at rest"), "{}", journal(&folder));
}

#[test]
fn a_simulated_rig_is_not_checked() {
    let folder = folder_with(&campaign("from_rest"));
    damprig(&folder).args(["run", "test.toml", "--out", "out"]).assert().success();
    assert!(!journal(&folder).contains("at rest"));
}
