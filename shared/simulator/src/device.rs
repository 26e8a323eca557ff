//! A complete simulated device: control loop, simulated board, queues, and its link, under tick credit or with its own clock.
//!
//! The virtual rig is this device. The emulated board runs the same loop and the same simulated board in the
//! firmware's tasks and sends the same bytes.

use damprig_core::integrator::sampled::Joined;
use damprig_core::settings::{Settings, Source};
use damprig_device::REQUESTS_WAITING;
use damprig_device::board::{Board, DeviceInfo};
use damprig_device::control_loop::{Step, step};
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::message_reader::MessageReader;
use damprig_device::outbox::Outbox;
use damprig_device::queues::{LocalQueues, Losses, Outgoing, Requests, StreamItem};
use damprig_device::upload_buffer::UploadBuffer;
use damprig_protocol::frame::{self, LONGEST};
use damprig_protocol::{ClockSource, FromDevice, NumberedRequest, ToDevice};
use heapless::Deque;

use crate::board::{PlantScalar, SimulatedBoard};
use crate::line_pace::LinePace;
use crate::plant::{Load, Plant};

/// Whether a device's clock can advance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Credit is left.
    Running,
    /// The credit is used up; nothing happens until something is received.
    Standing,
}

/// The received requests.
#[derive(Debug, Default)]
struct RequestQueue {
    requests: Deque<NumberedRequest, REQUESTS_WAITING>,
    losses: Losses,
}

impl Requests for RequestQueue {
    fn front(&mut self) -> Option<&NumberedRequest> {
        self.requests.front()
    }

    fn drop_front(&mut self) {
        self.requests.pop_front();
    }

    fn losses(&self) -> Losses {
        self.losses
    }
}

/// The device; `L` is what stands on the base of its plant.
#[derive(Debug)]
pub struct SimulatedDevice<S, L = Joined<S>> {
    controller: Controller,
    upload: UploadBuffer,
    board: SimulatedBoard<S, L>,
    reader: MessageReader,
    requests: RequestQueue,
    queues: LocalQueues,
    outbox: Outbox,
    pace: LinePace,
}

impl<S: PlantScalar> SimulatedDevice<S> {
    /// Makes an idle device without a plant; its clock is stopped.
    #[must_use]
    pub fn new(info: DeviceInfo) -> Self {
        Self::granted(info)
    }

    /// Makes an idle device with its own clock, at the rig of the source document. A tick passes whenever
    /// [`SimulatedDevice::run`] asks for one: the caller keeps the pace.
    #[must_use]
    pub fn real_time(info: DeviceInfo) -> Self {
        Self::with_clock(info)
    }
}

impl<S: PlantScalar, L: Load<S>> SimulatedDevice<S, L> {
    /// As [`SimulatedDevice::new`], with any load.
    #[must_use]
    pub fn granted(info: DeviceInfo) -> Self {
        Self::on(SimulatedBoard::default(), info, BootInfo::default())
    }

    /// As [`SimulatedDevice::real_time`], with any load.
    #[must_use]
    pub fn with_clock(info: DeviceInfo) -> Self {
        let boot = BootInfo { clock_source: ClockSource::Crystal, ..BootInfo::default() };
        Self::on(SimulatedBoard::real_time(), info, boot)
    }

    fn on(board: SimulatedBoard<S, L>, info: DeviceInfo, boot: BootInfo) -> Self {
        Self {
            controller: Controller::new(info, boot),
            upload: UploadBuffer::new(),
            board,
            reader: MessageReader::default(),
            requests: RequestQueue::default(),
            queues: LocalQueues::default(),
            outbox: Outbox::default(),
            pace: LinePace::default(),
        }
    }

    /// Adopts settings, which the board has stored, before the first tick.
    pub fn start_with(&mut self, settings: &Settings) {
        // Cannot fail: settings have one length, and a test saves them.
        let _ = self.board.save(settings);
        self.controller.start_with(settings, Source::Stored);
    }

    /// Takes received bytes. While the clock is stopped, requests are served at once.
    pub fn receive(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            match self.reader.push(byte) {
                None => {}
                Some(ToDevice::Grant { until_tick }) => self.board.grant(until_tick),
                Some(ToDevice::Request(request)) => {
                    if self.requests.requests.push_back(request).is_err() {
                        self.requests.losses.requests_dropped = self.requests.losses.requests_dropped.saturating_add(1);
                    }
                    if self.board.stands(self.controller.next_tick()) {
                        self.step();
                    }
                }
            }
        }
    }

    /// Counts ticks that a device with its own clock has lost, because they came too late.
    pub fn lose_ticks(&mut self, ticks: u32) {
        self.board.lose_ticks(ticks);
    }

    /// The controller.
    #[must_use]
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// The simulated plant, to inject faults.
    pub fn plant_mut(&mut self) -> Option<&mut Plant<S, L>> {
        self.board.plant_mut()
    }

    fn step(&mut self) -> Step {
        self.requests.losses.bad_frames = self.reader.bad_frames();
        let Self { controller, upload, board, requests, queues, .. } = self;
        let step = step(controller, upload, board, requests, queues);
        self.pace.follow(step, self.controller.next_tick());
        step
    }

    /// Runs up to `most_ticks` ticks; passes the frames to `out`.
    pub fn run(&mut self, most_ticks: u32, mut out: impl FnMut(&[u8])) -> Progress {
        let mut frame = [0; LONGEST];
        let mut ticks = 0;
        while ticks < most_ticks {
            match self.step() {
                Step::Ticked => {
                    ticks += 1;
                    while self.pace.is_clear()
                        && let Some(message) = self.outbox.next(&mut self.queues)
                    {
                        self.pace.charge(write(&message, &mut frame, &mut out));
                    }
                }
                Step::Served => self.send_all(&mut frame, &mut out),
                Step::Idle => {
                    self.send_all(&mut frame, &mut out);
                    if self.board.tells_clock() {
                        // Cannot fail: the queue is empty.
                        let _ = self.queues.stream(StreamItem::ClockStands { tick: self.controller.next_tick() });
                        self.send_all(&mut frame, &mut out);
                    }
                    return Progress::Standing;
                }
            }
        }
        Progress::Running
    }

    /// Sends all queued messages. Used while the clock is stopped.
    fn send_all(&mut self, frame: &mut [u8; LONGEST], out: &mut impl FnMut(&[u8])) {
        while let Some(message) = self.outbox.next(&mut self.queues) {
            write(&message, frame, out);
        }
    }
}

/// Sends `message`; returns its length in bytes.
fn write(message: &FromDevice, frame: &mut [u8; LONGEST], out: &mut impl FnMut(&[u8])) -> usize {
    // Cannot fail: a test encodes the longest message.
    let length = frame::encode(message, frame).unwrap_or(0);
    out(&frame[..length]);
    length
}
