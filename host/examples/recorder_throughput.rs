//! Measures the recorder's throughput: 50 signals of incompressible noise at 10 kHz, through the queue to the joined
//! file. Prints the ratio of the achieved to the required rate, and the ratio of the file size to that of the values
//! alone.
//!
//! `taskset -c 0 cargo run --release -p damprig --example recorder_throughput [SECONDS]`: one core for both threads.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use damprig::run_folder::journal::Journal;
use damprig::run_folder::schema::journal_state::JournalState;
use damprig::run_folder::schema::samples::{JOINED, PointLabel, SampleColumn};
use damprig::run_folder::write::recorder::{PointRows, Recorder, Recording};
use damprig::run_folder::write::writer::{RecordLayout, RunWriter};

const SIGNALS: usize = 50;
const RATE_HZ: u32 = 10_000;

/// Rows per message, as a board at this rate would send them.
const ROWS: u32 = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seconds = std::env::args().nth(1).map_or(Ok(60), |s| s.parse::<u32>())?;
    let folder = std::env::temp_dir().join(format!("damprig-recorder-{}", std::process::id()));
    std::fs::create_dir(&folder)?;
    let measured = measure(&folder, seconds);
    std::fs::remove_dir_all(&folder)?;
    measured
}

fn measure(folder: &std::path::Path, seconds: u32) -> Result<(), Box<dyn std::error::Error>> {
    let signals = (0..SIGNALS).map(|n| SampleColumn { name: format!("s{n}_m"), unit: "m".into() }).collect();
    let layout = RecordLayout {
        signals,
        every_ticks: 1,
        tick_hz: f64::from(RATE_HZ),
        order: Vec::new(),
        about: Default::default(),
    };
    let writer = RunWriter::new(folder, Journal::open(folder)?, layout, JournalState::default())?;
    let mut random = fastrand::Rng::with_seed(1);
    let stop = AtomicBool::new(false);

    let begun = Instant::now();
    let mut recorder = Recorder::start(writer, true);
    for n in 0..seconds * RATE_HZ / ROWS {
        // A point lasts 32 s.
        let point_index = n * ROWS / RATE_HZ / 32;
        let label = PointLabel { point_index, frequency_hz: 2.5, ..PointLabel::default() };
        // Random values, because repeated values would be compressed.
        let values = (0..ROWS as usize * SIGNALS).map(|_| random.f32() - 0.5).collect();
        recorder.rows(PointRows { label: Arc::new(label), ticks: (n * ROWS..(n + 1) * ROWS).collect(), values }, &stop);
    }
    let dropped = recorder.dropped_rows();
    let (writer, stored) = recorder.finish();
    stored?;
    let mut writer = writer.ok_or("the recorder's thread has died")?;
    writer.close()?;
    let recorded_s = begun.elapsed().as_secs_f64();
    writer.join()?;
    let joined_s = begun.elapsed().as_secs_f64() - recorded_s;

    let rows = u64::from(seconds * RATE_HZ);
    let raw = rows * SIGNALS as u64 * 4;
    let bytes = std::fs::metadata(folder.join(JOINED))?.len();
    println!(
        "{SIGNALS} signals at {RATE_HZ} Hz for {seconds} s: {rows} rows, {} recorded, {dropped} dropped",
        writer.rows()
    );
    println!(
        "recorded in {recorded_s:.2} s, {:.1} times as fast as they come; joined in {joined_s:.2} s",
        f64::from(seconds) / recorded_s
    );
    println!("{bytes} bytes, {:.3} of the values alone ({raw} bytes)", bytes as f64 / raw as f64);
    Ok(())
}
