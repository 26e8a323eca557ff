//! A whole board without pins: control, plant and link under the host's tick credit.
//!
//! Device time passes only as far as the host has granted ([`ToDevice::Grant`]). Without credit the clock stands: then
//! requests are served at once and everything that waits for the line goes out. So nothing that a host can see
//! depends on how fast either side runs, and a run repeats bit for bit.

use crate::control::{Bench, Birth, Control, Name, Saving};
use crate::intake::Intake;
use crate::lanes::{Lanes, Row, Saying};
use crate::orders::Order;
use crate::outbox::{Batch, Pace};
use crate::store::Store;
use crate::{REPLIES_WAITING, REQUESTS_WAITING, ROWS_WAITING};
use damprig_core::io::{Actuators, Readings, Sensors};
use damprig_core::plant::{Plant, PlantConfig};
use damprig_core::rig::{Refusal, Signals, State};
use damprig_core::scalar::Scalar;
use damprig_core::settings::{Settings, Source};
use damprig_protocol::frame::{self, LONGEST};
use damprig_protocol::{Clock, FromDevice, PlantKind, ToDevice};
use heapless::Deque;

/// A scalar that a simulated plant may run in.
pub trait PlantScalar: Scalar {
    /// How it is announced.
    const KIND: PlantKind;
}

impl PlantScalar for f32 {
    const KIND: PlantKind = PlantKind::SimulatedF32;
}

impl PlantScalar for f64 {
    const KIND: PlantKind = PlantKind::SimulatedF64;
}

#[derive(Debug, Default)]
struct SimulatedBench<S> {
    plant: Option<Plant<S>>,
    /// A start wants the plant back at its start: see [`SimulatedBench::settle`].
    restarts: bool,
}

impl<S: PlantScalar> SimulatedBench<S> {
    /// Does what a start has asked for. Apart from serving it: no board has a plant to put back within its tick.
    fn settle(&mut self) {
        if core::mem::take(&mut self.restarts)
            && let Some(plant) = &mut self.plant
        {
            plant.restart(0);
        }
    }
}

impl<S: PlantScalar> Bench for SimulatedBench<S> {
    const PLANT: PlantKind = S::KIND;
    const CLOCK: Clock = Clock::Granted;

    fn set_plant(&mut self, config: &PlantConfig) -> Result<(), Refusal> {
        self.plant = Some(Plant::new(config)?);
        Ok(())
    }

    fn restart(&mut self) -> Result<(), Refusal> {
        if self.plant.is_none() {
            return Err(Refusal::NotHere("this board is simulated: set its plant before starting"));
        }
        self.restarts = true;
        Ok(())
    }

    /// As long as the board lives.
    fn save(&mut self, _: &Settings) -> Result<Saving, Refusal> {
        Ok(Saving::Done)
    }
}

/// Orders that wait, served where they lie: they are large.
#[derive(Debug, Default)]
struct Slots {
    slots: [Option<Order>; REQUESTS_WAITING],
    first: usize,
}

impl Slots {
    /// Whether there was room.
    fn put(&mut self, order: Order) -> bool {
        let free =
            (0..REQUESTS_WAITING).map(|n| (self.first + n) % REQUESTS_WAITING).find(|&n| self.slots[n].is_none());
        match free {
            Some(free) => self.slots[free] = Some(order),
            None => return false,
        }
        true
    }

    fn front(&mut self) -> &mut Option<Order> {
        &mut self.slots[self.first]
    }

    fn has_one_for_a_tick(&self) -> bool {
        self.slots.iter().flatten().any(|order| order.at_tick.is_some())
    }

    fn drop_front(&mut self) {
        self.slots[self.first] = None;
        self.first = (self.first + 1) % REQUESTS_WAITING;
    }
}

#[derive(Debug, Default)]
struct Waiting {
    urgent: Deque<Saying, REPLIES_WAITING>,
    rows: Deque<Row, ROWS_WAITING>,
}

impl Lanes for Waiting {
    fn urgent(&mut self, saying: Saying) -> Result<usize, ()> {
        self.urgent.push_back(saying).map_err(|_| ())?;
        Ok(self.urgent.len())
    }

    fn row(&mut self, row: Row<&Signals>) -> Result<usize, ()> {
        self.rows.push_back(row.copied()).map_err(|_| ())?;
        Ok(self.rows.len())
    }
}

/// What was served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Served {
    Nothing,
    Order,
    /// An experiment has begun.
    Start,
}

/// Whether a simulated board's clock can go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is credit left.
    Running,
    /// The credit is used up; nothing happens until something is received.
    Standing,
}

/// The board.
#[derive(Debug)]
pub struct Simulated<S> {
    control: Control,
    bench: SimulatedBench<S>,
    store: Store,
    intake: Intake,
    orders: Slots,
    /// An order that waits for its tick.
    scheduled: Option<Order>,
    requests_dropped: u32,
    waiting: Waiting,
    batch: Batch,
    pace: Pace,
    until_tick: u32,
    clock_told: bool,
    sensors: Sensors,
}

impl<S: PlantScalar> Simulated<S> {
    /// An idle board without a plant, its clock standing.
    #[must_use]
    pub fn new(name: Name) -> Self {
        Self {
            control: Control::new(name, Birth::default()),
            bench: SimulatedBench { plant: None, restarts: false },
            store: Store::new(),
            intake: Intake::default(),
            orders: Slots::default(),
            scheduled: None,
            requests_dropped: 0,
            waiting: Waiting::default(),
            batch: Batch::default(),
            pace: Pace::default(),
            until_tick: 0,
            clock_told: true,
            sensors: Sensors::default(),
        }
    }

    /// Takes over settings as a board does that has kept them; before the first tick.
    pub fn start_with(&mut self, settings: &Settings, source: Source) {
        self.control.start_with(settings, source);
    }

    /// Takes received bytes.
    pub fn receive(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            match self.intake.push(byte) {
                None => {}
                Some(ToDevice::Grant { until_tick }) => {
                    self.until_tick = until_tick;
                    self.clock_told = false;
                }
                Some(ToDevice::Request(request)) => {
                    if !self.orders.put(Order::prepare(request)) {
                        self.requests_dropped = self.requests_dropped.saturating_add(1);
                    }
                    if self.stands() {
                        self.serve_next();
                    }
                }
            }
        }
    }

    /// Control, to look at.
    #[must_use]
    pub fn control(&self) -> &Control {
        &self.control
    }

    /// The simulated plant, to break it.
    pub fn plant_mut(&mut self) -> Option<&mut Plant<S>> {
        self.bench.plant.as_mut()
    }

    /// Lets up to `most_ticks` pass; `out` takes the frames.
    pub fn run(&mut self, most_ticks: u32, out: impl FnMut(&[u8])) -> Progress {
        self.run_watched(most_ticks, out, |tick| tick())
    }

    /// As [`Simulated::run`]; `watch` gets what a board does in a tick besides its plant and its line, to call once: the tick,
    /// then at most one order.
    pub fn run_watched(
        &mut self,
        most_ticks: u32,
        mut out: impl FnMut(&[u8]),
        mut watch: impl FnMut(&mut dyn FnMut()),
    ) -> Progress {
        let mut frame = [0; LONGEST];
        for _ in 0..most_ticks {
            self.serve_due();
            if self.stands() {
                self.stand(&mut frame, &mut out);
                return Progress::Standing;
            }
            // Each granted tick is the host's word.
            self.control.hear();
            let mut actuators = Actuators::default();
            watch(&mut || actuators = self.control.tick(&self.sensors, &mut self.store, &mut self.waiting));
            if let Some(plant) = &mut self.bench.plant {
                self.sensors = plant.tick(&actuators);
            }
            let mut served = Served::Nothing;
            watch(&mut || served = self.serve_front());
            self.settle(served);
            self.pace.tick();
            while self.pace.is_clear()
                && let Some(message) = self.next_message()
            {
                self.pace.charge(write(&message, &mut frame, &mut out));
            }
        }
        Progress::Running
    }

    fn stands(&self) -> bool {
        self.control.next_tick() >= self.until_tick
    }

    /// The clock stands: serve what waits, empty the line, and say so once, after everything else.
    fn stand(&mut self, frame: &mut [u8; LONGEST], out: &mut impl FnMut(&[u8])) {
        loop {
            while let Some(message) = self.next_message() {
                write(&message, frame, out);
            }
            if !self.serve_next() {
                break;
            }
        }
        self.batch.close();
        while let Some(batch) = self.batch.pop() {
            write(&FromDevice::Telemetry(batch), frame, out);
        }
        if !self.clock_told {
            self.clock_told = true;
            write(&FromDevice::Clock { tick: self.control.next_tick() }, frame, out);
        }
    }

    /// Serves what comes next while the clock stands; whether there was something.
    fn serve_next(&mut self) -> bool {
        let was_due = self.serve_due();
        let served = self.serve_front();
        self.settle(served);
        was_due || served != Served::Nothing
    }

    /// Does what was served asks of the plant, and puts everything to its start if that began an experiment.
    fn settle(&mut self, served: Served) {
        self.bench.settle();
        if served == Served::Start {
            self.put_to_start();
        }
    }

    /// Serves what waited for this tick, lays aside what waits for a later one, and lets neither wait behind what has no
    /// tick; whether there was something.
    fn serve_due(&mut self) -> bool {
        let tick = self.control.next_tick();
        let mut was_due = false;
        if let Some(mut order) = self.scheduled.take_if(|order| order.at_tick.is_none_or(|at| at <= tick)) {
            let served = serve(&mut order, &mut self.control, &mut self.bench, &mut self.store, &mut self.waiting);
            self.settle(served);
            was_due = true;
        }
        while self.orders.has_one_for_a_tick() {
            was_due = true;
            let tick = self.control.next_tick();
            let place = self.orders.front();
            let Some(order) = place.as_ref().filter(|order| order.at_tick.is_some_and(|at| at > tick)) else {
                let served = self.serve_front();
                self.settle(served);
                continue;
            };
            self.control.hear();
            match &self.scheduled {
                None => self.scheduled = place.take(),
                Some(waiting) if waiting.seq == order.seq => {}
                Some(_) => {
                    let why = Refusal::NotHere("another request already waits for its tick");
                    self.control.refuse(order.seq, why, &mut self.waiting);
                }
            }
            self.orders.drop_front();
        }
        was_due
    }

    /// Serves the request at the head of the queue.
    fn serve_front(&mut self) -> Served {
        let Some(order) = self.orders.front() else { return Served::Nothing };
        self.control.note(self.intake.bad_frames(), self.requests_dropped);
        let served = serve(order, &mut self.control, &mut self.bench, &mut self.store, &mut self.waiting);
        self.orders.drop_front();
        served
    }

    /// A new count of ticks: credit of the old one means nothing, nor does an order for a tick of it.
    fn put_to_start(&mut self) {
        self.scheduled = None;
        self.until_tick = 0;
        self.clock_told = true;
        // The plant is at its start; the friction damper's seat stays where it is.
        let Sensors { readings: Readings { spring_n, spring_rail, .. }, at_limit, emergency_stop, .. } = self.sensors;
        self.sensors = Sensors { at_limit, emergency_stop, ..Sensors::default() };
        (self.sensors.readings.spring_n, self.sensors.readings.spring_rail) = (spring_n, spring_rail);
        self.pace = Pace::default();
        self.batch = Batch::default();
        self.waiting.rows.clear();
    }

    fn next_message(&mut self) -> Option<FromDevice> {
        if let Some(saying) = self.waiting.urgent.pop_front() {
            return Some(saying.into());
        }
        loop {
            if let Some(batch) = self.batch.pop() {
                return Some(FromDevice::Telemetry(batch));
            }
            self.batch.push(&self.waiting.rows.pop_front()?);
        }
    }
}

/// A simulated board in single or double precision. Its functions are compiled with this crate, so that a host built for
/// debugging still runs it fast.
#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // The caller boxes it.
pub enum VirtualBoard {
    /// The controller's precision.
    Single(Simulated<f32>),
    /// Double precision.
    Double(Simulated<f64>),
}

impl VirtualBoard {
    /// As [`Simulated::start_with`].
    pub fn start_with(&mut self, settings: &Settings, source: Source) {
        match self {
            Self::Single(board) => board.start_with(settings, source),
            Self::Double(board) => board.start_with(settings, source),
        }
    }

    /// As [`Simulated::receive`].
    pub fn receive(&mut self, bytes: &[u8]) {
        match self {
            Self::Single(board) => board.receive(bytes),
            Self::Double(board) => board.receive(bytes),
        }
    }

    /// As [`Simulated::run`].
    pub fn run(&mut self, most_ticks: u32, out: &mut dyn FnMut(&[u8])) -> Progress {
        match self {
            Self::Single(board) => board.run(most_ticks, out),
            Self::Double(board) => board.run(most_ticks, out),
        }
    }
}

fn serve<S: PlantScalar>(
    order: &mut Order,
    control: &mut Control,
    bench: &mut SimulatedBench<S>,
    store: &mut Store,
    waiting: &mut Waiting,
) -> Served {
    let starts = order.is_start() && control.rig().state() == State::Idle;
    control.serve(order, bench, store, waiting);
    if starts && control.rig().state() != State::Idle { Served::Start } else { Served::Order }
}

/// Sends `message`; the bytes it took.
fn write(message: &FromDevice, frame: &mut [u8; LONGEST], out: &mut impl FnMut(&[u8])) -> usize {
    // Every message fits a frame: the longest is a test's claim.
    let length = frame::encode(message, frame).unwrap_or(0);
    out(&frame[..length]);
    length
}
