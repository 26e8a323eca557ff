//! A whole run between the host and a simulated board over a link that changes messages in both directions. Every changed
//! message has a correct checksum, and most are well formed: the host must end the run in an orderly way, whatever they say.

use std::io;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use damprig::campaign::Campaign;
use damprig::client::link::Link;
use damprig::client::session::Session;
use damprig::input::Source;
use damprig::run_folder::journal::{self, Begin, Journal, JournalEntry};
use damprig::run_folder::read::sample_files::{read_samples, sample_files};
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::write::recorder::Recorder;
use damprig::run_folder::write::writer::{RecordLayout, RunWriter};
use damprig::runner::{Run, Selection, device_record};
use damprig_device::board::DeviceInfo;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{FromDevice, ToDevice};
use damprig_simulator::device::{Progress, SimulatedDevice};
use postcard_schema::Schema;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::messages::{altered, any};

/// A stepped sine on two set-ups, a pulse and a free vibration.
const CAMPAIGN: &str = r#"
name = "crafted"

[structure]
mass_kg = 1.6
natural_frequency_hz = 2.50
damping_ratio = 0.0038

[[set_up]]
name = "particle"
base_amplitude_m = 0.0015
particle = { mass_ratio = 0.1, clearance_ratio = 2, wall = { kind = "restitution", coefficient = 0.47 } }

[[experiment]]
name = "sweep"
kind = "stepped_sine"
frequencies_hz = [9.0, 10.0]
start = "from_rest"
settle_s = 0.1
dwell_s = 0.7

[[experiment]]
name = "free"
kind = "free_vibration"
start_m = 0.01
measure_s = 2.0

[telemetry]
rate_hz = 200
signals = ["x", "z", "drive"]
"#;

/// Longest run, wall time; then the link breaks.
const LONGEST_RUN: Duration = Duration::from_secs(4);

/// Time without an answer after which the board counts as silent.
const PATIENCE: Duration = Duration::from_millis(100);

struct CraftedLink {
    board: Box<SimulatedDevice<f32>>,
    to_board: Reader,
    from_board: Reader,
    random: StdRng,
    /// A message in so many is changed, in either direction.
    every: u32,
    broken_at: Instant,
}

impl CraftedLink {
    /// The frames in place of `message`: mostly the message itself.
    fn frames<T: Schema + Serialize + DeserializeOwned>(random: &mut StdRng, every: u32, message: &T) -> Vec<u8> {
        let mut buffer = [0; LONGEST];
        let body = postcard::to_slice(message, &mut buffer).expect("it came in a frame").to_vec();
        let bodies = if random.random_range(0..every) > 0 {
            vec![body]
        } else {
            match random.random_range(0..12) {
                0 => vec![],
                1 => vec![body.clone(), body],
                2 => vec![body.clone(), altered::<T>(&body, random)],
                3 => vec![any::<T>(random), body],
                4 => vec![any::<T>(random)],
                _ => vec![altered::<T>(&body, random)],
            }
        };
        let mut frames = Vec::new();
        for body in bodies {
            let length = frame::wrap(&body, &mut buffer).unwrap_or(0);
            frames.extend_from_slice(&buffer[..length]);
        }
        frames
    }
}

impl Link for CraftedLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        for &byte in bytes {
            if let Some(Ok(message)) = self.to_board.push::<ToDevice>(byte) {
                let frames = Self::frames(&mut self.random, self.every, &message);
                self.board.receive(&frames);
            }
        }
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, _: Duration) -> io::Result<()> {
        if Instant::now() > self.broken_at {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let mut said = Vec::new();
        // A changed grant may last for weeks.
        for _ in 0..20 {
            if self.board.run(1000, |bytes| said.extend_from_slice(bytes)) == Progress::Standing || !said.is_empty() {
                break;
            }
        }
        for byte in said {
            if let Some(Ok(message)) = self.from_board.push::<FromDevice>(byte) {
                into.extend(Self::frames(&mut self.random, self.every, &message));
            }
        }
        Ok(())
    }
}

/// How a run over a crafted link ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// The session was opened.
    pub opened: bool,
    /// Points measured.
    pub points: usize,
    /// Messages that did not fit the plan.
    pub misfits: u64,
    /// Why the run ended early.
    pub error: Option<String>,
}

/// Runs the campaign; `seed` decides what is changed.
///
/// # Panics
/// The host panicked, its run did not end, or it left a folder that cannot be read.
#[must_use]
pub fn crafted_run(seed: u64) -> Outcome {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut random = StdRng::seed_from_u64(seed);
    let every = [3, 10, 30, 100, 300][random.random_range(0..5)];
    let begun = Instant::now();
    let link = CraftedLink {
        board: Box::new(SimulatedDevice::new(DeviceInfo::new("fuzz", "fuzz"))),
        to_board: Reader::default(),
        from_board: Reader::default(),
        random,
        every,
        broken_at: begun + LONGEST_RUN,
    };
    let outcome = run(Box::new(link), folder.path());
    assert!(begun.elapsed() < LONGEST_RUN + Duration::from_secs(2), "it took {:?}", begun.elapsed());
    check(folder.path());
    outcome
}

fn run(link: Box<dyn Link>, folder: &Path) -> Outcome {
    let mut campaign = Campaign::parse(Source::new("crafted.toml", CAMPAIGN)).expect("a campaign");
    let early = |error: String| Outcome { error: Some(error), ..Outcome::default() };
    let mut session = match Session::over(link, "the link".into(), PATIENCE) {
        Ok(session) => session,
        Err(error) => return early(error.to_string()),
    };
    if let Err(refusal) = campaign.on_board(&session.settings, true) {
        return early(refusal.to_string());
    }
    let selection = match Selection::of(&campaign, &session) {
        Ok(selection) => selection,
        Err(error) => return early(error.to_string()),
    };
    let layout = RecordLayout {
        signals: selection.signals.clone(),
        every_ticks: campaign.telemetry.every_ticks(),
        tick_hz: f64::from(session.description.tick_hz),
        order: campaign.in_order(),
        about: Default::default(),
    };
    let begin = Begin {
        run: String::new(),
        at: String::new(),
        damprig: damprig::VERSION_LINE.into(),
        device: device_record(&session),
        signals: layout.signals.clone(),
        every_ticks: layout.every_ticks,
        campaign: CAMPAIGN.into(),
        sums: true,
        records: Vec::new(),
    };
    let journal = Journal::open(folder).expect("a journal");
    let mut writer = RunWriter::new(folder, journal, layout, JournalState::default()).expect("a writer");
    writer.note(&JournalEntry::Begin(Box::new(begin))).expect("a line");
    let (mut recorder, mut nobody) = (Recorder::start(writer, true), ());
    let stop = AtomicBool::new(false);
    let run = Run::new(&campaign, &mut session, &mut recorder, &mut nobody, &stop, selection, JournalState::default());
    let (tally, result) = run.carry_out();
    let (writer, stored) = recorder.finish();
    stored.expect("the recorder failed");
    let mut writer = writer.expect("the writer");
    writer.close().expect("the folder is closed");
    let error = result.err().map(|error| error.to_string());
    Outcome { opened: true, points: writer.state().points(), misfits: tally.counters.misfit_messages, error }
}

/// Every line of the journal and every sample can be read.
fn check(folder: &Path) {
    if !journal::is_in(folder) {
        return;
    }
    let lines = journal::read(folder).expect("a journal");
    assert_eq!((&lines.damaged, &lines.torn), (&vec![], &vec![]), "the journal cannot be read");
    let state = JournalState::of(&lines.entries);
    let mut rows = 0;
    for file in sample_files(folder) {
        rows +=
            read_samples(&file).expect("samples").map(|batch| batch.expect("a batch").num_rows() as u64).sum::<u64>();
    }
    assert_eq!(rows, state.sealed_rows(), "rows of samples");
}
