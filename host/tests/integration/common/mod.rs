//! Shared by the tests: the `damprig` binary, campaigns on disk, and boards behind a TCP port with injected faults.

#![allow(dead_code)] // Each test file uses its part.

pub mod real_board;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::Duration;

use arrow_array::RecordBatch;
use assert_cmd::Command;
use damprig_device::board::DeviceInfo;
use damprig_protocol::frame::{self, Reader};
use damprig_protocol::{Event, FromDevice, Request, ToDevice};
use damprig_simulator::device::{Progress, SimulatedDevice};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use tempfile::TempDir;

/// Whether the long form of a test is wanted.
pub fn is_full() -> bool {
    std::env::var_os("DAMPRIG_FULL").is_some()
}

/// The command, started in its own folder.
pub fn damprig(folder: &TempDir) -> Command {
    let mut command = Command::cargo_bin("damprig").expect("the binary of this package");
    command.current_dir(folder.path());
    command
}

/// Checks that a page fetches nothing and runs no script but its own: its policy names that by its digest, and its only address is the SVG
/// namespace.
pub fn assert_self_contained(page: &str) {
    assert!(page.contains("default-src &#39;none&#39;") || page.contains("default-src 'none'"), "no policy");
    assert!(page.contains("sha256-"), "the policy names no script");
    let (before, rest) = page.split_once("<script type=\"module\">").expect("a script");
    let (script, after) = rest.split_once("</script>").expect("its end");
    for word in ["import", "fetch(", "XMLHttpRequest", "WebSocket", "innerHTML", "https:"] {
        assert!(!script.contains(word), "{word}");
    }
    let foreign = format!("{before}{after}").replace("http://www.w3.org/2000/svg", "").replace("href=\"#", "");
    for word in ["http:", "https:", "src=", "href=", "<script", "@import", "url("] {
        assert!(!foreign.contains(word), "{word}");
    }
}

/// The shipped short campaign.
pub fn short() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("campaigns/short.toml");
    std::fs::read_to_string(path).expect("the shipped campaign")
}

/// A new folder with a campaign `test.toml`.
pub fn folder_with(campaign: &str) -> TempDir {
    let folder = TempDir::new().expect("a temporary folder");
    std::fs::write(folder.path().join("test.toml"), campaign).expect("a file");
    folder
}

/// Real data that are not part of the project: in `shared/field` beside it, or in the folder that `DAMPRIG_FIELD` names. `None`, with a message,
/// where they are absent.
pub fn field(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/field");
    let file = std::env::var_os("DAMPRIG_FIELD").map_or_else(beside, PathBuf::from).join(name);
    if !file.exists() {
        println!("skipped: {} is absent", file.display());
        return None;
    }
    Some(file)
}

/// Copies a folder with all that is in it.
pub fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir(to).expect("a new folder");
    for entry in std::fs::read_dir(from).expect("a folder").map(|entry| entry.expect("an entry")) {
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy_folder(&from, &to);
        } else {
            std::fs::copy(from, to).expect("a copy");
        }
    }
}

/// Writes two records of one file name into two folders; gives the experiments that play them: `a`, twice, and `b`.
pub fn two_records(folder: &Path, set_ups: &[&str]) -> String {
    let record = |name: &str, frequency_hz: f64, samples: u32| {
        std::fs::create_dir(folder.join(name)).expect("a folder");
        let sample = |n: u32| {
            let t_s = f64::from(n) * 0.01;
            let rise = (std::f64::consts::PI * f64::from(n) / f64::from(samples)).sin().powi(2);
            format!("{t_s:.2},{:.9}\n", 1e-3 * rise * (std::f64::consts::TAU * frequency_hz * t_s).sin())
        };
        let text: String = (0..=samples).map(sample).collect();
        std::fs::write(folder.join(name).join("quake.csv"), format!("t_s,z_m\n{text}")).expect("a file");
    };
    record("a", 1.5, 300);
    record("b", 2.2, 400);
    let experiment = |name: &str, repeats: u32, peak_m: f64| {
        format!(
            "\n[[experiment]]\nname = \"{name}\"\nkind = \"playback\"\nrepeats = {repeats}\nset_ups = {set_ups:?}\nfile = \
             \"{name}/quake.csv\"\nquantity = \"displacement\"\nunit = \"m\"\ntarget_peak_m = {peak_m}\ntail_s = 1\n"
        )
    };
    experiment("a", 2, 0.002) + &experiment("b", 1, 0.001)
}

/// A copy of a run folder that an earlier version wrote.
pub fn older_run(folder: &TempDir, name: &str) -> PathBuf {
    let run = folder.path().join(name);
    copy_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/older_runs").join(name), &run);
    run
}

/// A changed journal with the checksums of its lines made again: what is tested is the change, not its discovery.
pub fn with_sums(journal: &str) -> String {
    let line = |line: &str| match serde_json::from_str::<serde_json::Value>(line) {
        Ok(serde_json::Value::Object(mut map)) => {
            map.remove("sum");
            damprig::run_folder::journal::with_sum(&serde_json::Value::Object(map).to_string())
        }
        _ => line.to_string(),
    };
    journal.lines().map(|text| line(text) + "\n").collect()
}

/// The blocks of a language in a Markdown text.
pub fn blocks<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let fence = format!("```{language}\n");
    text.split(fence.as_str()).skip(1).filter_map(|rest| rest.split("```").next()).collect()
}

/// The Python that `tests/run` makes, with the packages of tests/python; `None` if tests that need it may be left out.
pub fn python() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/python/bin/python");
    match std::env::var("DAMPRIG_PYTHON") {
        Ok(word) if word == "required" => {
            assert!(own.exists(), "{} is missing: tests/run makes it", own.display());
            Some(own)
        }
        Ok(path) => Some(path.into()),
        Err(_) => own.exists().then_some(own),
    }
}

/// All rows of a Parquet file, in batches.
pub fn read_parquet(path: PathBuf) -> Vec<RecordBatch> {
    let file = std::fs::File::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).expect("Parquet").build().expect("Parquet");
    reader.map(|batch| batch.expect("a whole batch")).collect()
}

/// Number of rows of a Parquet file.
pub fn rows(path: PathBuf) -> usize {
    read_parquet(path).iter().map(RecordBatch::num_rows).sum()
}

/// Number of sample rows in a run folder, complete or not.
pub fn sample_rows(run: &Path) -> usize {
    let run = damprig::run_folder::RunFolder::open(run).expect("a run");
    run.samples().map(|batch| batch.expect("readable samples").num_rows()).sum()
}

/// Number of result rows in a run folder, complete or not.
pub fn result_rows(run: &Path) -> usize {
    let run = damprig::run_folder::RunFolder::open(run).expect("a run");
    run.results().expect("readable results").iter().map(RecordBatch::num_rows).sum()
}

/// The manifest of a run.
pub fn manifest(run: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(run.join("manifest.json")).expect("a manifest");
    serde_json::from_str(&text).expect("JSON")
}

/// Treatment of a message on its way to the host.
pub enum Fate {
    /// Send it.
    Pass,
    /// Flip one of its bits.
    Corrupt,
    /// Send this message instead.
    Replace(Box<FromDevice>),
    /// Send it, and these after it.
    Also(Vec<FromDevice>),
    /// Send this instead, again and again, until the host disconnects.
    Flood(Box<FromDevice>),
    /// Close the connection instead.
    Close,
    /// Send nothing from now on, but stay connected.
    Mute,
    /// The board is reset by a short loss of power; the connection stays.
    Reset,
}

/// A simulated board behind a TCP port of this machine; `fate` decides about every message.
pub struct Served {
    /// Address of the board, for `--rig`.
    pub rig: String,
    thread: JoinHandle<Heard>,
}

/// The requests that a board received, and the number of experiments that it finished.
#[derive(Default)]
struct Heard {
    received: Vec<ToDevice>,
    finished: usize,
}

impl Served {
    /// Serves one connection.
    pub fn start(fate: impl FnMut(&FromDevice) -> Fate + Send + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let rig = format!("tcp:{}", listener.local_addr().expect("an address"));
        let thread = std::thread::spawn(move || {
            let (stream, _) = listener.accept().expect("a connection");
            serve(stream, &mut board(), &mut { fate })
        });
        Self { rig, thread }
    }

    /// Serves one connection after the other until the end of the test; the board keeps its state between them.
    /// Returns its address for `--rig`.
    pub fn again_and_again(mut fate: impl FnMut(&FromDevice) -> Fate + Send + 'static) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let rig = format!("tcp:{}", listener.local_addr().expect("an address"));
        std::thread::spawn(move || {
            let mut board = board();
            for stream in listener.incoming() {
                serve(stream.expect("a connection"), &mut board, &mut fate);
            }
        });
        rig
    }

    /// The requests of the host. Call after it has disconnected.
    pub fn received(self) -> Vec<ToDevice> {
        self.thread.join().expect("the board's thread").received
    }

    /// Whether the host left the rig at rest: told to stop, or with every experiment finished that it started.
    pub fn was_left_standing(self) -> bool {
        let heard = self.thread.join().expect("the board's thread");
        let asked = |ask: &Request| {
            heard.received.iter().filter(|m| matches!(m, ToDevice::Request(r) if r.request == *ask)).count()
        };
        asked(&Request::Stop) > 0 || asked(&Request::Start) == heard.finished
    }
}

fn board() -> Box<SimulatedDevice<f32>> {
    Box::new(SimulatedDevice::new(DeviceInfo::new("0.0.0", "test")))
}

fn serve(
    mut stream: TcpStream,
    board: &mut Box<SimulatedDevice<f32>>,
    fate: &mut impl FnMut(&FromDevice) -> Fate,
) -> Heard {
    let (mut from_host, mut from_board) = (Reader::default(), Reader::default());
    let mut heard = Heard::default();
    let mut muted = false;
    let mut bytes = [0; 4096];
    loop {
        match stream.read(&mut bytes) {
            Ok(0) | Err(_) => return heard,
            Ok(count) => {
                let messages = bytes[..count].iter().filter_map(|&b| from_host.push::<ToDevice>(b));
                heard.received.extend(messages.flatten());
                board.receive(&bytes[..count]);
            }
        }
        let mut said = Vec::new();
        while board.run(1000, |frame| said.extend_from_slice(frame)) == Progress::Running {}
        let mut out = Vec::new();
        for &byte in &said {
            let Some(Ok(message)) = from_board.push::<FromDevice>(byte) else { continue };
            let mut frame = [0; frame::LONGEST];
            let mut more = Vec::new();
            let mut length = frame::encode(&message, &mut frame).expect("it came as a frame");
            heard.finished += usize::from(matches!(message, FromDevice::Event { event: Event::Finished { .. }, .. }));
            match fate(&message) {
                Fate::Pass => {}
                Fate::Corrupt => frame[length / 2] ^= 0x10,
                Fate::Replace(other) => length = frame::encode(&*other, &mut frame).expect("it fits"),
                Fate::Also(others) => more = others.iter().flat_map(encoded).collect(),
                Fate::Flood(other) => {
                    let many = encoded(&other).repeat(1000);
                    while stream.write_all(&many).is_ok() {}
                    return heard;
                }
                Fate::Close => {
                    let _ = stream.write_all(&out);
                    return heard;
                }
                Fate::Mute => muted = true,
                Fate::Reset => {
                    *board = self::board();
                    break;
                }
            }
            if !muted {
                out.extend_from_slice(&frame[..length]);
                out.extend(more);
            }
        }
        if stream.write_all(&out).is_err() {
            return heard;
        }
    }
}

fn encoded(message: &FromDevice) -> Vec<u8> {
    let mut frame = [0; frame::LONGEST];
    let length = frame::encode(message, &mut frame).expect("it fits");
    frame[..length].to_vec()
}

/// Whether a message is the result of a point.
pub fn is_point(message: &FromDevice) -> bool {
    matches!(message, FromDevice::Event { event: Event::Point(_), .. })
}

/// A time limit that is long enough for a loaded machine.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A run of the short campaign that was interrupted at its fourth point.
pub fn cut_off(campaign: &str) -> (tempfile::TempDir, String) {
    cut_off_at(campaign, 4)
}

/// A run of a campaign that was interrupted at a point, counted from 1.
pub fn cut_off_at(campaign: &str, point: usize) -> (tempfile::TempDir, String) {
    let folder = folder_with(campaign);
    let mut points = 0;
    let rig = Served::again_and_again(move |message| {
        points += usize::from(is_point(message));
        if is_point(message) && points == point { Fate::Close } else { Fate::Pass }
    });
    let arguments = ["run", "test.toml", "--rig", &rig, "--out", "out", "--reconnect-s", "0"];
    damprig(&folder)
        .args(arguments)
        .assert()
        .code(1)
        .stderr(predicates::str::contains("continue with `damprig run --resume out`"));
    (folder, rig)
}

/// A folder with these files.
pub fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// What `damprig simulate --json` says of a case.
pub fn simulated(case: &str, more: &[&str]) -> serde_json::Value {
    let folder = folder(&[("case.toml", case)]);
    let output = damprig(&folder).args(["simulate", "case.toml", "--json"]).args(more).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A command beside these files must end with exit code 2 and say all of `words`.
pub fn refused(files: &[(&str, &str)], arguments: &[&str], words: &[&str]) {
    let folder = folder(files);
    let output = damprig(&folder).args(arguments).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}\n{told}");
    for word in words {
        assert!(told.contains(word), "no {word:?} in:\n{told}");
    }
}
