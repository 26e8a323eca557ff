//! What the tests of the command share: the binary, campaigns on the disk, and boards behind a TCP port that
//! can be made to misbehave.

#![allow(dead_code)] // Each test file uses its part.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::Duration;

use arrow_array::RecordBatch;
use assert_cmd::Command;
use damprig_device::control::Name;
use damprig_device::simulated::{Progress, Simulated};
use damprig_protocol::frame::{self, Reader};
use damprig_protocol::{FromDevice, Happening, ToDevice};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use tempfile::TempDir;

/// The command, started in a folder of its own.
pub fn damprig(folder: &TempDir) -> Command {
    let mut command = Command::cargo_bin("damprig").expect("the binary of this package");
    command.current_dir(folder.path());
    command
}

/// The short campaign that is shipped.
pub fn short() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("campaigns/short.toml");
    std::fs::read_to_string(path).expect("the shipped campaign")
}

/// A fresh folder with a campaign `test.toml` in it.
pub fn folder_with(campaign: &str) -> TempDir {
    let folder = TempDir::new().expect("a temporary folder");
    std::fs::write(folder.path().join("test.toml"), campaign).expect("a file");
    folder
}

/// All rows of a Parquet file, as one batch each read.
pub fn read_parquet(path: PathBuf) -> Vec<RecordBatch> {
    let file = std::fs::File::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).expect("Parquet").build().expect("Parquet");
    reader.map(|batch| batch.expect("a whole batch")).collect()
}

/// Number of rows.
pub fn rows(path: PathBuf) -> usize {
    read_parquet(path).iter().map(RecordBatch::num_rows).sum()
}

/// The manifest.
pub fn manifest(run: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(run.join("manifest.json")).expect("a manifest");
    serde_json::from_str(&text).expect("JSON")
}

/// What to do with a message on its way to the host.
pub enum Fate {
    /// Send it.
    Pass,
    /// Flip a bit of it.
    Corrupt,
    /// Close the connection instead.
    Close,
    /// Send nothing any more, but stay connected.
    Mute,
}

/// A simulated board behind a TCP port of this machine; `fate` is asked for every message.
pub struct Served {
    /// For `--rig`.
    pub rig: String,
    thread: JoinHandle<Vec<ToDevice>>,
}

impl Served {
    /// Serves one connection.
    pub fn start(fate: impl FnMut(&FromDevice) -> Fate + Send + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let rig = format!("tcp:{}", listener.local_addr().expect("an address"));
        let thread = std::thread::spawn(move || {
            let (stream, _) = listener.accept().expect("a connection");
            serve(stream, fate)
        });
        Self { rig, thread }
    }

    /// What the host sent, once it has gone.
    pub fn received(self) -> Vec<ToDevice> {
        self.thread.join().expect("the board's thread")
    }
}

fn serve(mut stream: TcpStream, mut fate: impl FnMut(&FromDevice) -> Fate) -> Vec<ToDevice> {
    let mut board = Box::new(Simulated::<f32>::new(Name::new("0.0.0", "test")));
    let (mut from_host, mut from_board) = (Reader::default(), Reader::default());
    let mut received = Vec::new();
    let mut muted = false;
    let mut bytes = [0; 4096];
    loop {
        match stream.read(&mut bytes) {
            Ok(0) | Err(_) => return received,
            Ok(count) => {
                let messages = bytes[..count].iter().filter_map(|&b| from_host.push::<ToDevice>(b));
                received.extend(messages.flatten());
                board.receive(&bytes[..count]);
            }
        }
        let mut said = Vec::new();
        while board.run(1000, |frame| said.extend_from_slice(frame)) == Progress::Running {}
        let mut out = Vec::new();
        for &byte in &said {
            let Some(Ok(message)) = from_board.push::<FromDevice>(byte) else { continue };
            let mut frame = [0; frame::LONGEST];
            let length = frame::encode(&message, &mut frame).expect("it came as a frame");
            match fate(&message) {
                Fate::Pass => {}
                Fate::Corrupt => frame[length / 2] ^= 0x10,
                Fate::Close => {
                    let _ = stream.write_all(&out);
                    return received;
                }
                Fate::Mute => muted = true,
            }
            if !muted {
                out.extend_from_slice(&frame[..length]);
            }
        }
        if stream.write_all(&out).is_err() {
            return received;
        }
    }
}

/// Whether a message is the result of a point.
pub fn is_point(message: &FromDevice) -> bool {
    matches!(message, FromDevice::Event { event: Happening::Point(_), .. })
}

/// Long enough for a loaded machine, short enough to fail.
pub const PATIENCE: Duration = Duration::from_secs(120);
