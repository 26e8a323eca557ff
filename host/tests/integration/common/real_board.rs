//! A board with a real structure and its own clock, behind a TCP port of this machine.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use damprig_core::io::{Actuators, Reading, SUBSAMPLES, Sensors};
use damprig_core::rig::{Rejected, Rig};
use damprig_core::settings::Settings;
use damprig_device::board::{Board, DeviceInfo, Saving};
use damprig_device::control_loop::step;
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::message_reader::MessageReader;
use damprig_device::outbox::Outbox;
use damprig_device::queues::{LocalQueues, Losses, Requests};
use damprig_device::settings_store::{Records, SettingsStore};
use damprig_device::upload_buffer::UploadBuffer;
use damprig_protocol::frame::{self, LONGEST};
use damprig_protocol::{FromDevice, NumberedRequest, Reply, StoredPart, ToDevice};
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// Device seconds per host second.
pub const FAST: f64 = 5.0;

/// What a person has done to the rig, changed by the test while it runs.
#[derive(Debug, Default)]
pub struct Changed {
    /// The sensor of x reads this much more, µm.
    pub x_um: AtomicI32,
    /// The structure rings with this amplitude, µm, at 2.5 Hz.
    pub ringing_um: AtomicI32,
    /// The target of x is out of the beam unless 0: its sensor is at a rail.
    pub x_is_lost: AtomicI32,
}

/// A settings memory: two pages of flash, as on the controller board.
pub struct Memory(Box<[u8; Memory::BYTES]>);

impl Memory {
    /// Size of a page, bytes.
    pub const PAGE: usize = 2048;
    const BYTES: usize = 2 * Self::PAGE;

    /// Erased pages.
    pub fn blank() -> Self {
        Self(Box::new([0xff; Self::BYTES]))
    }

    /// Pages with arbitrary bytes.
    pub fn garbage() -> Self {
        let mut memory = Self::blank();
        memory.0.iter_mut().enumerate().for_each(|(n, byte)| *byte = (n * n / 7) as u8);
        memory
    }

    /// A record at the start of the first page.
    pub fn with(record: &[u8]) -> Self {
        let mut memory = Self::blank();
        memory.0[..record.len()].copy_from_slice(record);
        memory
    }
}

impl ErrorType for Memory {
    type Error = std::convert::Infallible;
}

impl ReadNorFlash for Memory {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::BYTES
    }
}

impl NorFlash for Memory {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = Self::PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.0[from as usize..to as usize].fill(0xff);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.0[offset as usize..][..bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}

/// The structure follows the base at twice its amplitude.
struct Real {
    sensors: Sensors,
    changed: Arc<Changed>,
    ticks: u32,
    store: Option<SettingsStore<Memory>>,
}

impl Board for Real {
    fn samples(&mut self, _: &Rig) -> Option<Sensors> {
        Some(self.sensors)
    }

    fn set(&mut self, actuators: &Actuators, _: &Rig) {
        let metres = |um: &AtomicI32| um.load(Ordering::Relaxed) as f32 * 1e-6;
        self.ticks += 1;
        let phase = 2.0 * std::f32::consts::PI * (self.ticks % 400) as f32 / 400.0;
        let off_m = metres(&self.changed.x_um) + metres(&self.changed.ringing_um) * libm::sinf(phase);
        self.sensors.readings.x = if self.changed.x_is_lost.load(Ordering::Relaxed) == 0 {
            Reading::still(2.0 * actuators.drive_m + off_m)
        } else {
            let scale = Settings::default().calibration.x;
            Reading::within(&[-1.0; SUBSAMPLES], &scale.usable_m())
        };
        self.sensors.readings.z = Reading::still(actuators.drive_m);
    }

    fn save(&mut self, settings: &Settings) -> Result<Saving, Rejected> {
        let store = self.store.as_mut().ok_or(Rejected::not_here("this board has no flash to save to"))?;
        store.save(settings).map(|()| Saving::Done).map_err(|_| Rejected::not_here("not saved"))
    }

    fn stored_settings(&mut self, page: u8, from: u16) -> StoredPart {
        let Some(store) = &mut self.store else { return StoredPart::NONE };
        let mut records = Records::UNREAD;
        store.copy(&mut records);
        records.part(page, from)
    }
}

#[derive(Default)]
struct Received(VecDeque<NumberedRequest>);

impl Requests for Received {
    fn front(&mut self) -> Option<&NumberedRequest> {
        self.0.front()
    }

    fn drop_front(&mut self) {
        self.0.pop_front();
    }

    fn losses(&self) -> Losses {
        Losses::default()
    }
}

/// Serves such a board, one connection after the other until the end of the test; returns the address for `--rig`.
pub fn real_board(changed: &Arc<Changed>) -> String {
    serve(changed, None, false)
}

/// As [`real_board`], with a settings memory; `is_other` gives its firmware another protocol, of which only the messages that
/// never change are answered.
pub fn board_with_memory(memory: Memory, is_other: bool) -> String {
    serve(&Arc::default(), Some(memory), is_other)
}

/// What starts in place of the running firmware: its description, and the settings memory as flashing left it.
pub type Flashed = Arc<Mutex<Option<(DeviceInfo, Memory)>>>;

/// A board with a settings memory that has been running for five minutes, until `flashed` has another firmware: that starts at once.
pub fn board_to_flash(memory: Memory, flashed: &Flashed) -> String {
    let served =
        Served { memory: Some(memory), flashed: Arc::clone(flashed), pace: 1.0, is_old: true, ..Served::default() };
    served.start(&Arc::default())
}

fn serve(changed: &Arc<Changed>, memory: Option<Memory>, is_other: bool) -> String {
    Served { memory, is_other, ..Served::default() }.start(changed)
}

/// A board to be served.
struct Served {
    memory: Option<Memory>,
    is_other: bool,
    flashed: Flashed,
    /// Device seconds per host second.
    pace: f64,
    /// It has been running for five minutes.
    is_old: bool,
}

impl Default for Served {
    fn default() -> Self {
        Self { memory: None, is_other: false, flashed: Flashed::default(), pace: FAST, is_old: false }
    }
}

/// A controller that has just started with the settings of its memory.
fn started(info: DeviceInfo, memory: Option<Memory>) -> (Controller, Option<SettingsStore<Memory>>) {
    let mut controller = Controller::new(info, BootInfo::default());
    let mut store = memory.and_then(|memory| SettingsStore::new(memory, 0..Memory::BYTES as u32));
    if let Some((settings, source)) = store.as_mut().map(SettingsStore::load) {
        controller.start_with(&settings, source);
    }
    (controller, store)
}

impl Served {
    fn start(self, changed: &Arc<Changed>) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let rig = format!("tcp:{}", listener.local_addr().expect("an address"));
        let changed = Arc::clone(changed);
        std::thread::spawn(move || self.serve(&listener, changed));
        rig
    }

    fn serve(self, listener: &TcpListener, changed: Arc<Changed>) {
        let Self { memory, is_other, flashed, pace, is_old } = self;
        let (mut controller, store) = started(DeviceInfo::new("0.0.0", "real"), memory);
        let mut board = Real { sensors: Sensors::default(), changed, ticks: 0, store };
        let mut upload = UploadBuffer::new();
        if is_old {
            let (mut requests, mut queues) = (Received::default(), LocalQueues::default());
            for _ in 0..300_000 {
                step(&mut controller, &mut upload, &mut board, &mut requests, &mut queues);
            }
        }
        'connections: for stream in listener.incoming() {
            if let Some((info, memory)) = flashed.lock().expect("no panic").take() {
                (controller, board.store) = started(info, Some(memory));
            }
            let mut stream = stream.expect("a connection");
            stream.set_read_timeout(Some(Duration::from_millis(1))).expect("a timeout");
            let (mut reader, mut bytes) = (MessageReader::default(), [0; 4096]);
            let (mut requests, mut queues, mut outbox) =
                (Received::default(), LocalQueues::default(), Outbox::default());
            let (begun, mut ticks) = (Instant::now(), 0.0);
            loop {
                match stream.read(&mut bytes) {
                    Ok(0) => continue 'connections,
                    Ok(count) => {
                        for &byte in &bytes[..count] {
                            if let Some(ToDevice::Request(request)) = reader.push(byte) {
                                requests.0.push_back(request);
                            }
                        }
                    }
                    Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                    Err(_) => continue 'connections,
                }
                while ticks < begun.elapsed().as_secs_f64() * 1000.0 * pace {
                    step(&mut controller, &mut upload, &mut board, &mut requests, &mut queues);
                    ticks += 1.0;
                    while let Some(mut message) = outbox.next(&mut queues) {
                        if is_other && !as_of_another_protocol(&mut message) {
                            continue;
                        }
                        let mut out = [0; LONGEST];
                        let length = frame::encode(&message, &mut out).expect("it fits");
                        if stream.write_all(&out[..length]).is_err() {
                            continue 'connections;
                        }
                    }
                }
            }
        }
    }
}

/// Gives the identity another schema; false for a message that another protocol does not have in common with this one.
fn as_of_another_protocol(message: &mut FromDevice) -> bool {
    match message {
        FromDevice::Reply { answer: Ok(Reply::Identity(identity)), .. } => {
            identity.schema = [0xab; 8];
            true
        }
        FromDevice::Reply { answer: Ok(Reply::Stored(_)), .. } => true,
        _ => false,
    }
}
