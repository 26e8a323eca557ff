//! A faulted rig is brought to idle when its structure is at rest, however long that takes; and a board with its own clock
//! gets keep-alive messages.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use damprig::client::link::Link;
use damprig::client::session::{Session, SessionError};
use damprig_core::io::{Actuators, Reading, Sensors};
use damprig_core::rig::{Rejected, Rig, RigState};
use damprig_core::settings::Settings;
use damprig_device::board::{DeviceInfo, Saving};
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::message_reader::MessageReader;
use damprig_device::queues::{LocalQueues, Outgoing, Waiting};
use damprig_device::upload_buffer::UploadBuffer;
use damprig_protocol::frame::{self, LONGEST};
use damprig_protocol::{FromDevice, ToDevice};

/// Much longer than a reply takes within the process.
const TIMEOUT: Duration = Duration::from_millis(100);

/// A board with its own clock, which advances by some ticks whenever the host listens. Its structure vibrates by 90
/// mm, beyond the limit, until it is held.
struct Board {
    control: Controller,
    reader: MessageReader,
    upload: UploadBuffer,
    queues: LocalQueues,
    is_held: Arc<AtomicBool>,
    requests: Arc<AtomicU32>,
    tick: u32,
}

/// A board with a real structure and no flash.
struct Real;

impl damprig_device::board::Board for Real {
    fn samples(&mut self, _: &Rig) -> Option<Sensors> {
        None
    }

    fn set(&mut self, _: &Actuators, _: &Rig) {}

    fn save(&mut self, _: &Settings) -> Result<Saving, Rejected> {
        Err(Rejected::not_here("this board has no flash to save to"))
    }
}

impl Link for Board {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        for &byte in bytes {
            if let Some(ToDevice::Request(request)) = self.reader.push(byte) {
                self.requests.fetch_add(1, Ordering::Relaxed);
                self.control.serve(&request, &mut Real, &mut self.upload, &mut self.queues);
            }
        }
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, _: Duration) -> io::Result<()> {
        for _ in 0..50 {
            let swings = !self.is_held.load(Ordering::Relaxed);
            let x_m = if swings { 0.08 * (0.0157 * f64::from(self.tick)).sin() } else { 0.0 };
            let mut sensors = Sensors::default();
            sensors.readings.x = Reading::still(x_m as f32);
            self.control.tick(&sensors, &mut self.upload, &mut self.queues);
            self.tick += 1;
        }
        // The board sends continuously, so the host has no need to query it.
        self.queues.message(FromDevice::Clock { tick: self.tick }).expect("room");
        while let Some(message) = self.queues.pop_message() {
            let mut out = [0; LONGEST];
            let length = frame::encode(&message, &mut out).expect("it fits");
            into.extend_from_slice(&out[..length]);
        }
        Ok(())
    }
}

fn board(is_held: &Arc<AtomicBool>) -> (Session, Arc<AtomicU32>) {
    let requests = Arc::default();
    let board = Board {
        control: Controller::new(DeviceInfo::new("0.0.0", "real"), BootInfo::default()),
        reader: MessageReader::default(),
        upload: UploadBuffer::default(),
        queues: LocalQueues::default(),
        is_held: Arc::clone(is_held),
        requests: Arc::clone(&requests),
        tick: 0,
    };
    (Session::over(Box::new(board), "test".into(), TIMEOUT).expect("it answers"), requests)
}

fn tripped() -> (Session, Arc<AtomicBool>) {
    let is_held = Arc::default();
    let (mut session, _) = board(&is_held);
    while session.status().expect("it answers").0.state != RigState::Faulted {
        session.next_report().expect("the link is intact");
    }
    (session, is_held)
}

#[test]
fn a_ringing_rig_is_waited_for_beyond_the_links_timeout_and_the_user_is_informed() {
    let (mut session, is_held) = tripped();
    let mut told = Vec::new();
    session
        .bring_to_idle(
            |what| {
                told.push(what.to_string());
                // The structure is stopped by hand.
                is_held.store(true, Ordering::Relaxed);
            },
            &AtomicBool::new(false),
        )
        .expect("the rig becomes idle");
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("wait for rest"), "{told:?}");
    assert_eq!(session.status().unwrap().0.state, RigState::Idle);
}

#[test]
fn the_wait_for_a_ringing_rig_ends_with_control_c() {
    let (mut session, _) = tripped();
    let stop = AtomicBool::new(false);
    // The rig would ring for minutes.
    let waited = session.bring_to_idle(|_| stop.store(true, Ordering::Relaxed), &stop);
    assert!(matches!(waited, Err(SessionError::Interrupted)), "{waited:?}");
}

#[test]
fn after_a_run_stop_drive_returns_when_the_drive_is_silent_and_keeps_the_fault() -> Result<(), SessionError> {
    let (mut session, _) = tripped();
    session.stop_drive()?;
    assert_eq!(session.status()?.0.state, RigState::Faulted);
    Ok(())
}

#[test]
fn a_board_that_sends_continuously_still_receives_keep_alive_requests() -> Result<(), SessionError> {
    let (mut session, requests) = board(&Arc::new(AtomicBool::new(true)));
    let before = requests.load(Ordering::Relaxed);
    let begun = Instant::now();
    while requests.load(Ordering::Relaxed) == before {
        session.next_report()?;
        assert!(
            begun.elapsed() < Duration::from_secs(5),
            "no request within the shortest host_silent_s that a campaign may set"
        );
    }
    Ok(())
}
