//! Shared set-up of the tests: boards, hosts connected to them, and the `damprig` command.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use damprig_board::peripherals::flash::Bank2;
use damprig_board::{Board, Config, Image, Output, Time, link};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{SetUp, Structure};
use damprig_core::rig::Status;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{Counters, Description, Event, FromDevice, NumberedRequest, Rejected, Reply, Request, ToDevice};
use damprig_simulator::plant::{Base, PlantConfig, Shaker};
use escargot::CargoBuild;
use serde_json::Value;

/// Maximum device seconds per second: far from the time-outs of either side.
const PACE: f64 = 5.0;

/// The interrupt that runs the control tick (UART5).
pub const TICK: u16 = 16 + 53;

/// Root directory of the project.
pub fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The controller's image; prints a message if it has not been built. `DAMPRIG_IMAGE` names another file: `tests/faults/run`
/// gives one with a deliberate fault.
pub fn image() -> Option<Image> {
    let built = || project().join("firmware/target/images/nucleo-g474re.elf");
    let path = std::env::var_os("DAMPRIG_IMAGE").map_or_else(built, PathBuf::from);
    if path.is_file() {
        return Some(Image::read(&path).unwrap());
    }
    let absent = format!("no image {}: `tests/board/run` builds it", path.display());
    assert!(std::env::var_os("DAMPRIG_IMAGES").is_none_or(|value| value != "required"), "{absent}");
    eprintln!("not tested: {absent}");
    None
}

/// The source document's structure without a damper, on a shaker that feels its reaction force.
pub fn bare() -> PlantConfig {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let set_up = SetUp::bare(structure);
    PlantConfig { base: Base::Shaker(Shaker::default()), ..PlantConfig::ideal(set_up) }
}

/// A board for tests that do not depend on the rig.
pub fn board(image: Image) -> Board {
    Board::new(image, &Config::new(bare())).unwrap()
}

/// Runs a board until `until`; panics if the run fails.
pub fn run(board: &mut Board, until: Time) {
    if let Err(failure) = board.run_until(until) {
        panic!("{failure}");
    }
}

/// A host that speaks the protocol over the board's UART, in device time only.
pub struct Host<'a> {
    pub board: &'a mut Board,
    reader: Reader,
    seq: u16,
    /// All bytes sent by the board.
    pub received: Vec<u8>,
}

impl<'a> Host<'a> {
    pub fn new(board: &'a mut Board) -> Self {
        Self { board, reader: Reader::default(), seq: 0, received: Vec::new() }
    }

    /// Lets device time pass; appends the bytes that the board sends to `received`.
    pub fn pass(&mut self, time: Time) {
        let end = self.board.now() + time;
        run(self.board, end);
        let sent = self.board.chip_mut().take_sent();
        // The frame of a later reply may begin here.
        sent.iter().for_each(|&byte| drop(self.reader.push::<FromDevice>(byte)));
        self.received.extend(sent);
    }

    /// All messages received so far.
    pub fn messages(&self) -> Vec<FromDevice> {
        let mut reader = Reader::default();
        self.received.iter().filter_map(|&byte| reader.push::<FromDevice>(byte)?.ok()).collect()
    }

    /// Lets device time pass until an event comes that `is_it` recognises, and returns how long that took; at most `longest`.
    pub fn wait_for(&mut self, longest: Time, is_it: impl Fn(&Event) -> bool) -> Time {
        self.received.clear();
        let begun = self.board.now();
        while self.board.now() - begun < longest {
            self.pass(Time::from_ms(1));
            let found = self.messages().iter().any(|m| matches!(m, FromDevice::Event { event, .. } if is_it(event)));
            if found {
                return self.board.now() - begun;
            }
        }
        panic!("nothing of the kind in {} ms: {:?}", longest.us() / 1e3, self.messages());
    }

    /// The rig's status.
    pub fn status(&mut self) -> Status {
        self.status_and_counters().0
    }

    /// The board's counters.
    pub fn counters(&mut self) -> Counters {
        self.status_and_counters().1
    }

    fn status_and_counters(&mut self) -> (Status, Counters) {
        match self.ask(Request::Status) {
            Reply::Status { status, counters } => (status, counters),
            other => panic!("{other:?}"),
        }
    }

    /// Sends a request and waits for its reply, at most one second of device time.
    pub fn ask(&mut self, ask: Request) -> Reply {
        self.try_ask(ask).unwrap_or_else(|why| panic!("refused: {why:?}"))
    }

    /// As [`Host::ask`]; the request may be refused.
    pub fn try_ask(&mut self, ask: Request) -> Result<Reply, Rejected> {
        let seq = self.send(ask);
        self.answer_to(seq)
    }

    /// Sends a request and returns its number.
    pub fn send(&mut self, ask: Request) -> u16 {
        self.seq += 1;
        let request = ToDevice::Request(NumberedRequest { seq: self.seq, at_tick: None, request: ask });
        let mut out = [0; LONGEST];
        let length = frame::encode(&request, &mut out).unwrap();
        self.board.chip_mut().host_sends(&out[..length]);
        self.seq
    }

    /// Waits for the reply to a request, at most one second of device time.
    pub fn reply_to(&mut self, wanted: u16) -> Reply {
        self.answer_to(wanted).unwrap_or_else(|why| panic!("refused: {why:?}"))
    }

    fn answer_to(&mut self, wanted: u16) -> Result<Reply, Rejected> {
        let end = self.board.now() + Time::from_ms(1_000);
        while self.board.now() < end {
            run(self.board, self.board.now() + Time::from_ms(1));
            let sent = self.board.chip_mut().take_sent();
            self.received.extend_from_slice(&sent);
            let mut found = None;
            for byte in sent {
                match self.reader.push::<FromDevice>(byte) {
                    Some(Ok(FromDevice::Reply { seq, answer })) if seq == wanted => {
                        found = Some(answer);
                    }
                    Some(Err(bad)) => panic!("a bad frame from the board: {bad:?}"),
                    _ => {}
                }
            }
            if let Some(answer) = found {
                return answer;
            }
        }
        panic!("no reply within a second");
    }
}

/// A sine of this amplitude and frequency that is driven for more than 20 s.
pub fn sine(amplitude_m: f32, frequency_hz: f32) -> SteppedSine {
    SteppedSine {
        start: Start::CarryOver,
        amplitude_m,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 20.0,
        dwell_s: 20.0,
        steady: SteadyLimits::default(),
        points: [frequency_hz].into_iter().collect(),
        first_index: 0,
    }
}

pub fn description(board: &mut Board) -> Description {
    match Host::new(board).ask(Request::Describe) {
        Reply::Description(description) => description,
        other => panic!("{other:?}"),
    }
}

/// A board that drives its shaker at 2.5 Hz and 1 mm.
pub fn driving(config: &Config) -> Option<Board> {
    let mut board = Board::new(image()?, config).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    host.ask(Request::Configure(sine(1e-3, 2.5)));
    host.ask(Request::Start);
    pass(&mut board, 500);
    assert!(is_driving(&board), "{:?}", board.chip().trace().last());
    Some(board)
}

pub fn pass(board: &mut Board, ms: u64) {
    run(board, board.now() + Time::from_ms(ms));
}

/// Runs until the control tick is being handled, to within 2 µs of its start.
pub fn run_into_tick(board: &mut Board) {
    while board.handles() != TICK {
        run(board, board.now() + Time::from_us(2));
    }
}

/// Whether the relay is closed.
pub fn is_driving(board: &Board) -> bool {
    let relay = board.chip().trace().iter().rev().find_map(|(_, output)| match output {
        Output::Relay(closed) => Some(*closed),
        _ => None,
    });
    relay == Some(true)
}

/// Time from `since` until the relay opened.
pub fn opened(board: &Board, since: Time) -> Time {
    let opened = board.chip().trace().iter().find(|(at, output)| *at >= since && *output == Output::Relay(false));
    opened.unwrap_or_else(|| panic!("the relay stays closed")).0 - since
}

/// Results of a served board.
pub struct Outcome {
    /// All changes of the outputs.
    pub trace: Vec<(Time, Output)>,
    /// Number of bytes that the UART lost.
    pub bytes_lost: u64,
    /// Contents of the second bank of the flash.
    pub bank2: Bank2,
    /// Position of the friction damper's seat at the end, steps from the limit switch.
    pub seat_steps: Option<i32>,
    /// The controller's status at the end.
    pub status: Status,
    /// Device time divided by host time.
    pub speed: f64,
}

/// A board behind a TCP port, in its own thread.
pub struct Served {
    /// Its address for `--rig`.
    pub rig: String,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<Outcome, String>>,
}

impl Served {
    /// Powers a board on; `each_step` is called with it every millisecond.
    pub fn new(image: Image, config: Config, mut each_step: impl FnMut(&mut Board) + Send + 'static) -> Self {
        // Builds the command now, so that no board runs during the build.
        damprig();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let rig = format!("tcp:{}", listener.local_addr().unwrap());
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            let mut board = Board::new(image, &config)?;
            let begun = std::time::Instant::now();
            link::serve(&mut board, &listener, PACE, &flag, &mut each_step).map_err(|ended| ended.to_string())?;
            let speed = board.now().s() / begun.elapsed().as_secs_f64();
            let mut host = Host::new(&mut board);
            // The link may have ended within a frame.
            host.pass(Time::from_ms(50));
            let status = host.status();
            Ok(Outcome {
                trace: board.chip().trace().to_vec(),
                bytes_lost: board.chip().bytes_lost(),
                bank2: board.chip().bank2().clone(),
                seat_steps: board.chip().plant().seat_steps(),
                status,
                speed,
            })
        });
        Self { rig, stop, thread }
    }

    /// Powers the board off.
    pub fn off(self) -> Outcome {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap().unwrap_or_else(|failure| panic!("{failure}"))
    }
}

/// The `damprig` command: the file that `DAMPRIG_COMMAND` names; otherwise built now.
pub fn damprig() -> Command {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    let path = BUILT.get_or_init(|| {
        if let Some(path) = std::env::var_os("DAMPRIG_COMMAND") {
            return path.into();
        }
        let manifest = project().join("Cargo.toml");
        let build = CargoBuild::new().manifest_path(manifest).package("damprig").bin("damprig");
        build.run().expect("the command builds").path().to_path_buf()
    });
    Command::new(path)
}

/// Exit status and output of a finished command.
pub fn said(output: &std::process::Output) -> String {
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    format!("{}\n{out}\n{err}", output.status)
}

/// Runs a campaign with its results in `folder`.
pub fn run_campaign(text: &str, rig: &str, folder: &Path) -> std::process::Output {
    let file = folder.with_extension("toml");
    std::fs::write(&file, text).unwrap();
    damprig().arg("run").arg(&file).args(["--yes", "--rig", rig, "--out"]).arg(folder).output().unwrap()
}

/// The entries of one kind in a run's journal.
pub fn journal(folder: &Path, kind: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("journal.jsonl")).unwrap();
    let entries = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    entries.filter(|entry| entry["entry"] == kind).collect()
}

/// A number of a journal's entry.
pub fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} of {value}"))
}
