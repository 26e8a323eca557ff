//! What waits between the control loop and the link: what is sent first, what is dropped, and that it is counted.

use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::io::{Actuators, Reading, Readings, Sensors};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::rig::{Rejected, Rig, Signals};
use damprig_core::settings::Settings;
use damprig_device::board::{Board, DeviceInfo, Saving};
use damprig_device::control_loop::step;
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::outbox::Outbox;
use damprig_device::queues::{Chosen, LocalQueues, Losses, Outgoing, Requests, Row, StreamItem};
use damprig_device::upload_buffer::UploadBuffer;
use damprig_device::{REPLIES_WAITING, ROWS_WAITING};
use damprig_protocol::{Counters, FromDevice, NumberedRequest, Reply, Request, Timing};
use heapless::Deque;

/// A board with its own clock whose base stands at this displacement, m.
#[derive(Default)]
struct Standing {
    z_m: f32,
    timing: Timing,
}

impl Board for Standing {
    fn samples(&mut self, _: &Rig) -> Option<Sensors> {
        let rest = Sensors::default();
        Some(Sensors { readings: Readings { z: Reading::still(self.z_m), ..rest.readings }, ..rest })
    }

    fn set(&mut self, _: &Actuators, _: &Rig) {}

    fn save(&mut self, _: &Settings) -> Result<Saving, Rejected> {
        Ok(Saving::Done)
    }

    fn timing(&self) -> Timing {
        self.timing
    }
}

/// The received requests.
#[derive(Default)]
struct Received(Deque<NumberedRequest, 4>);

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

/// A control loop with its queues. Nothing is sent before the test asks for it.
struct Device {
    controller: Controller,
    board: Standing,
    upload: Box<UploadBuffer>,
    requests: Received,
    queues: LocalQueues,
    outbox: Outbox,
    seq: u16,
}

impl Device {
    fn new() -> Self {
        Self {
            controller: Controller::new(DeviceInfo::new("test", "none"), BootInfo::default()),
            board: Standing::default(),
            upload: Box::new(UploadBuffer::new()),
            requests: Received::default(),
            queues: LocalQueues::default(),
            outbox: Outbox::default(),
            seq: 0,
        }
    }

    fn receive(&mut self, request: Request) {
        self.seq += 1;
        self.requests.0.push_back(NumberedRequest { seq: self.seq, at_tick: None, request }).unwrap();
    }

    fn tick(&mut self, ticks: u32) {
        for _ in 0..ticks {
            step(&mut self.controller, &mut self.upload, &mut self.board, &mut self.requests, &mut self.queues);
        }
    }

    /// Sends everything that waits.
    fn send(&mut self) -> Vec<FromDevice> {
        std::iter::from_fn(|| self.outbox.next(&mut self.queues)).collect()
    }

    /// Carries out a request in a tick and returns its reply; nothing else may be answered meanwhile.
    fn ask(&mut self, request: Request) -> Reply {
        self.receive(request);
        self.tick(1);
        let mut replies = replies(&self.send());
        assert_eq!(replies.len(), 1, "{replies:?}");
        replies.pop().unwrap().1
    }

    fn counters(&mut self) -> Counters {
        match self.ask(Request::Status) {
            Reply::Status { counters, .. } => counters,
            other => panic!("{other:?}"),
        }
    }
}

fn replies(messages: &[FromDevice]) -> Vec<(u16, Reply)> {
    let reply = |message: &FromDevice| match message {
        FromDevice::Reply { seq, answer } => Some((*seq, answer.clone().unwrap())),
        _ => None,
    };
    messages.iter().filter_map(reply).collect()
}

/// z of every row, m.
fn rows(messages: &[FromDevice]) -> Vec<f32> {
    let telemetry = messages.iter().filter_map(|m| if let FromDevice::Telemetry(t) = m { Some(t) } else { None });
    telemetry.flat_map(|t| t.values.iter().copied()).collect()
}

/// A row of z in every tick.
fn base_of_every_tick() -> Request {
    Request::SetTelemetry { every_ticks: 1, signals: [1].into_iter().collect(), impacts: false }
}

#[test]
fn rows_and_replies_that_find_no_room_are_dropped_and_counted() {
    let mut device = Device::new();
    device.ask(base_of_every_tick());
    let (before, too_many) = (device.counters(), 9);
    device.tick((ROWS_WAITING + too_many) as u32);
    device.send();
    let after = device.counters();
    assert_eq!(after.rows_dropped - before.rows_dropped, too_many as u32);
    assert_eq!(usize::from(after.most_rows_waiting), ROWS_WAITING);
    assert_eq!(after.replies_dropped, 0);
    for _ in 0..REPLIES_WAITING + 3 {
        device.receive(Request::Status);
        device.tick(1);
    }
    device.send();
    let after = device.counters();
    assert_eq!((after.replies_dropped, usize::from(after.most_replies_waiting)), (3, REPLIES_WAITING));
}

#[test]
fn a_start_drops_the_rows_of_the_experiment_before() {
    let mut device = Device::new();
    device.ask(base_of_every_tick());
    device.ask(Request::Configure(SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: 1e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 1.0,
        dwell_s: 4.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.0].into_iter().collect(),
    }));
    device.board.z_m = 1e-3;
    device.tick(ROWS_WAITING as u32 - 1);
    device.receive(Request::Start);
    device.tick(1);
    device.board.z_m = 2e-3;
    let mut sent = device.send();
    for _ in 0..300 {
        device.tick(1);
        sent.extend(device.send());
    }
    let rows = rows(&sent);
    assert!(rows.len() > 200, "{}", rows.len());
    assert!(rows.iter().all(|z_m| *z_m == 2e-3), "{rows:?}");
}

#[test]
fn one_request_is_served_in_a_tick() {
    let mut device = Device::new();
    (0..3).for_each(|_| device.receive(Request::Status));
    for seq in 1..=3 {
        device.tick(1);
        let served: Vec<u16> = replies(&device.send()).iter().map(|(seq, _)| *seq).collect();
        assert_eq!(served, [seq]);
    }
}

#[test]
fn the_timing_of_the_board_is_reported_as_it_is() {
    let mut device = Device::new();
    device.board.timing = Timing { overruns: 1, longest_tick_us: 2, largest_jitter_us: 3, longest_masked_tenths_us: 4 };
    device.tick(1);
    assert_eq!(device.counters().timing, device.board.timing);
}

fn row(tick: u32, last: bool) -> StreamItem {
    let chosen = Chosen::new(&[0].into_iter().collect());
    StreamItem::Row(Row { tick, every_ticks: 1, chosen, values: Signals::default(), last })
}

#[test]
fn the_last_row_of_an_experiment_is_sent_at_once() {
    let (mut queues, mut outbox) = (LocalQueues::default(), Outbox::default());
    queues.stream(row(5, false)).unwrap();
    assert_eq!(outbox.next(&mut queues), None, "a row waits for others");
    queues.stream(row(6, true)).unwrap();
    assert_eq!(rows(&[outbox.next(&mut queues).unwrap()]).len(), 2);
}

#[test]
fn a_reply_is_sent_before_telemetry_that_is_ready() {
    let (mut queues, mut outbox) = (LocalQueues::default(), Outbox::default());
    queues.stream(row(5, false)).unwrap();
    // It continues nothing: both messages are ready.
    queues.stream(row(20, true)).unwrap();
    assert!(matches!(outbox.next(&mut queues), Some(FromDevice::Telemetry(_))));
    let reply = FromDevice::Reply { seq: 7, answer: Ok(Reply::Done) };
    queues.message(reply.clone()).unwrap();
    assert_eq!(outbox.next(&mut queues), Some(reply));
    assert!(matches!(outbox.next(&mut queues), Some(FromDevice::Telemetry(_))));
    assert_eq!(outbox.next(&mut queues), None);
}
