//! The live page of a run: who cannot disturb it, how it is stopped, what it says of the time left, and its end.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::http::StatusCode;

use crate::common::{PATIENCE, damprig, folder_with, is_full, manifest, result_rows, short};
use crate::monitor::Viewer;

/// Files that a run may open at a time.
const OPEN_FILES: u32 = 256;

/// A run with a page, as a program of its own.
struct Served {
    run: Child,
    address: String,
    token: String,
    output: Arc<Mutex<String>>,
    readers: Vec<JoinHandle<()>>,
}

impl Served {
    /// Starts it and waits for the address of its page.
    fn start(folder: &TempDir, speed: &str) -> Self {
        let limited = format!("ulimit -n {OPEN_FILES}; exec \"$0\" \"$@\"");
        let mut command = Command::new("sh");
        command.args(["-c", &limited]).arg(assert_cmd::cargo::cargo_bin("damprig"));
        command.args(["run", "test.toml", "--out", "out", "--rig", "virtual:realtime", "--speed", speed]);
        command.args(["--monitor", "--control", "--listen", "127.0.0.1:0"]).current_dir(folder.path());
        let pipes = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut run = pipes.spawn().expect("a shell");
        let output = Arc::new(Mutex::new(String::new()));
        let read = |pipe: Box<dyn Read + Send>| {
            let output = Arc::clone(&output);
            std::thread::spawn(move || {
                for line in BufReader::new(pipe).lines().map_while(Result::ok) {
                    *output.lock().expect("no panic") += &format!("{line}\n");
                }
            })
        };
        let readers = vec![
            read(Box::new(run.stdout.take().expect("a pipe"))),
            read(Box::new(run.stderr.take().expect("a pipe"))),
        ];
        let mut served = Self { run, address: String::new(), token: String::new(), output, readers };
        let url = served.awaits("Monitor: http://");
        let (address, token) = url.split_once("/#token=").expect("a token");
        (served.address, served.token) = (address.into(), token.into());
        served
    }

    /// Waits for a line with these words, and returns what follows them in it.
    fn awaits(&mut self, words: &str) -> String {
        let begun = Instant::now();
        loop {
            let output = self.output.lock().expect("no panic").clone();
            let line = output.split_once(words).and_then(|(_, rest)| rest.split_once('\n'));
            if let Some((rest, _)) = line {
                return rest.into();
            }
            assert!(begun.elapsed() < PATIENCE && self.run.try_wait().expect("a child").is_none(), "{output}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn operator(&self) -> Viewer {
        Viewer::with_token(&self.address, &self.token).expect("a place for the operator")
    }

    fn does(&self, what: &str) -> Value {
        json!({"id": 7, "do": what, "token": self.token})
    }

    /// The exit code, and all that was told.
    fn ends(mut self) -> (Option<i32>, String) {
        let code = self.run.wait().expect("it ends").code();
        self.readers.drain(..).for_each(|reader| reader.join().expect("no panic"));
        let output = self.output.lock().expect("no panic").clone();
        (code, output)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // A test that failed.
        if !self.readers.is_empty() {
            let _ = self.run.kill();
            let _ = self.run.wait();
        }
    }
}

/// The page as a browser gets it.
fn page(address: &str) -> String {
    let mut stream = TcpStream::connect(address).expect("the page is served");
    stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
    write!(stream, "GET / HTTP/1.1\r\nHost: {address}\r\n\r\n").expect("a connection");
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("an answer");
    text
}

fn activity(message: &Value) -> Option<&str> {
    message["state"]["activity"].as_str()
}

fn is_verified(folder: &TempDir) {
    damprig(folder).args(["runs", "verify", "out"]).assert().success();
}

#[test]
fn idle_connections_and_silent_viewers_change_nothing_for_a_run_and_its_operator() {
    let (count, speed) = if is_full() { (5000, "1") } else { (600, "5") };
    let folder = folder_with(&short());
    let served = Served::start(&folder, speed);
    let begun = Instant::now();
    let connect = |_| TcpStream::connect(&served.address).expect("a connection");
    let idle: Vec<TcpStream> = (0..count).map(connect).collect();
    println!("{count} connections after {:?}", begun.elapsed());
    // They never read.
    let silent: Vec<Viewer> = (0..64).map(|_| Viewer::connect(&served.address, None).expect("a place")).collect();
    assert_eq!(Viewer::connect(&served.address, None).err(), Some(StatusCode::SERVICE_UNAVAILABLE));
    let more: Vec<TcpStream> = (0..64).map(connect).collect();
    let begun = Instant::now();
    assert!(page(&served.address).starts_with("HTTP/1.1 200 OK"));
    let mut operator = served.operator();
    operator.next().expect("a snapshot");
    // Only a run between two experiments refuses it.
    let answer = operator.ask(served.does("hold"));
    let took = begun.elapsed();
    assert!(answer["ok"] == true || answer["text"].as_str().is_some_and(|why| why.contains("can be held")), "{answer}");
    operator.ask(served.does("release"));
    println!("{count} idle connections, 64 silent viewers: page, snapshot and answer after {took:?}");
    // A machine that is busy with other tests has its time; nobody waits for a connection that is silent.
    assert!(took < Duration::from_secs(5), "{took:?}");
    let all = operator.until(|message| activity(message) == Some("over"));
    assert_eq!(all[all.len() - 1]["state"]["points_taken"], 6);
    drop((idle, silent, more, operator));
    let (code, told) = served.ends();
    assert_eq!(code, Some(0), "{told}");
    assert_eq!(result_rows(&folder.path().join("out")), 6);
    let counters = &manifest(&folder.path().join("out"))["counters"];
    assert_eq!((&counters["lost_rows"], &counters["dropped_rows_host"]), (&json!(0), &json!(0)));
    is_verified(&folder);
}

#[test]
fn a_paused_run_that_is_flooded_with_actions_stops_at_once() {
    let folder = folder_with(&short());
    let served = Served::start(&folder, "1");
    let mut operator = served.operator();
    operator.until(|message| activity(message) == Some("running"));
    assert_eq!(operator.ask(served.does("pause"))["ok"], true);
    let all = operator
        .until(|message| activity(message) == Some("paused") && message["state"]["numbers"]["tick"].is_number());
    let numbers = &all[all.len() - 1]["state"]["numbers"];
    assert!(numbers["x_over_z_lock_in"].is_null() && numbers["x_amplitude_m"].is_null(), "{numbers}");
    let mut others: Vec<Viewer> = (0..4).map(|_| served.operator()).collect();
    for other in &mut others {
        (0..50).for_each(|_| other.send(&served.does("hold")));
    }
    (0..50).for_each(|_| operator.send(&served.does("hold")));
    operator.send(&json!({"id": 1000, "do": "stop", "token": served.token}));
    let answer = operator.until(|message| message["kind"] == "answer" && message["id"] == 1000).pop().expect("it");
    assert_eq!(answer["ok"], true, "{answer}");
    let all = operator.until(|message| activity(message) == Some("over"));
    let headline = all[all.len() - 1]["state"]["headline"].as_str().expect("words");
    assert_eq!(headline, "The run was stopped. `damprig run --resume out` continues the run.");
    drop((operator, others));
    let (code, told) = served.ends();
    assert_eq!(code, Some(130), "{told}");
    let journal = std::fs::read_to_string(folder.path().join("out/journal.jsonl")).expect("a journal");
    assert_eq!(journal.matches("stopped on the live page").count(), 1, "{journal}");
}

#[test]
fn the_time_left_covers_the_end_stands_in_a_pause_and_is_the_same_in_the_terminal() {
    let folder = folder_with(&short());
    let served = Served::start(&folder, "2");
    let mut operator = served.operator();
    let mut told: Vec<(Instant, f64, f64, String)> = Vec::new();
    let mut paused = Duration::ZERO;
    let left = |message: &Value| {
        let left = &message["state"]["left"];
        Some((left["low_s"].as_f64()?, left["high_s"].as_f64()?, left["text"].as_str()?.to_string()))
    };
    loop {
        let message = operator.next().expect("the run goes on");
        if activity(&message) == Some("over") {
            assert_eq!(left(&message), None);
            break;
        }
        if let Some((low_s, high_s, text)) = left(&message)
            && told.last().is_none_or(|(.., last)| *last != text)
        {
            told.push((Instant::now(), low_s, high_s, text));
        }
        if paused.is_zero() && message["state"]["points_taken"] == 2 {
            let begun = Instant::now();
            assert_eq!(operator.ask(served.does("pause"))["ok"], true);
            let first = operator.until(|message| activity(message) == Some("paused")).pop().expect("it");
            // Many frames later nothing has changed.
            let mut last = first.clone();
            while begun.elapsed() < Duration::from_secs(2) {
                last = operator.next().expect("the run stands");
            }
            assert_eq!(left(&first), left(&last));
            assert_eq!(operator.ask(served.does("resume"))["ok"], true);
            paused = begun.elapsed();
            told.clear();
        }
    }
    let end = Instant::now();
    assert!(told.len() > 3, "{told:?}");
    for (at, low_s, high_s, text) in &told {
        let actual_s = (end - *at).as_secs_f64();
        // An estimate is up to half a second old, and so is what this test sees of the end.
        assert!(
            (low_s - 1.0..=high_s + 1.0).contains(&actual_s),
            "{text} ({low_s} to {high_s}), {actual_s} s before the end"
        );
    }
    drop(operator);
    let (code, output) = served.ends();
    assert_eq!(code, Some(0), "{output}");
    let line =
        output.lines().find(|line| line.contains(" points, ") && line.ends_with(" left")).expect("a line of progress");
    let text = line.rsplit_once(" points, ").expect("it has").1;
    let earlier_or_later = told.iter().any(|(.., seen)| seen == text);
    assert!(earlier_or_later, "{line:?} is not among {told:?}");
}

#[test]
fn the_page_of_a_run_that_has_ended_is_served_until_its_viewers_leave_and_shows_the_decay() {
    let folder = folder_with(&short());
    let served = Served::start(&folder, "1");
    let mut operator = served.operator();
    operator.until(|message| message["state"]["numbers"]["x_over_z_lock_in"].as_f64().is_some_and(|ratio| ratio > 1.0));
    let press =
        json!({"id": 1, "do": "inject", "token": served.token, "fault": {"kind": "emergency_stop", "on": true}});
    assert_eq!(operator.ask(press)["ok"], true);
    let over = operator.until(|message| activity(message) == Some("over")).pop().expect("it");
    let fault = &over["state"]["fault"];
    let what = fault["what"].as_str().expect("words");
    let expected = "The drive was cut at once: the emergency stop is pressed; set-up \"bare\", t = ";
    assert!(what.starts_with(expected) && what.ends_with(" s."), "{what}");
    assert_eq!(fault["advice"], "`damprig run --resume out` continues the run.");
    // The structure still rings, and its decay is seen.
    let times = |message: &Value| message["rows"]["t_s"].as_array().and_then(|t_s| t_s.last()?.as_f64());
    let mut seen_s: Vec<f64> = Vec::new();
    while seen_s.len() < 20 {
        seen_s.extend(times(&operator.next().expect("the page is served")));
    }
    assert!(seen_s.is_sorted() && seen_s[19] > seen_s[0] + 0.5, "{seen_s:?}");
    // The folder is complete meanwhile, and the page can still be opened.
    let begun = Instant::now();
    while manifest(&folder.path().join("out"))["status"] != "incomplete" {
        assert!(begun.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(page(&served.address).contains("damprig monitor"));
    let snapshot = served.operator().next().expect("a snapshot");
    assert_eq!(snapshot["state"]["fault"]["what"], what);
    assert_eq!(operator.ask(served.does("pause"))["text"], "The run is over.");
    drop(operator);
    let (code, told) = served.ends();
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("The page stays until its last viewer has left"), "{told}");
}

#[test]
fn a_run_without_viewers_ends_at_once() {
    let folder = folder_with(&short());
    let served = Served::start(&folder, "20");
    let (code, told) = served.ends();
    assert!(code == Some(0) && !told.contains("The page stays"), "{told}");
    assert!(Path::new(&folder.path().join("out/report.html")).exists());
}
