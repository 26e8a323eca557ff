//! Counts the instructions of the control loop in the emulator, prints them and exits.
//!
//! The load has all functions on: a hybrid damper under a stepped sine in closed loop, its spring homed, touched off
//! and held at a friction ratio, both wall forces measured, the twin running, telemetry of sixteen signals in every
//! tick, and a request in every fourth tick. Each step is the control loop's own ([`step`]). The simulated plant, the
//! link, the interrupt and the locks of the queues are not counted.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::friction_spring::{SpringCommand, SpringSetUp, Target};
use damprig_core::control::safety::ExperimentLimits;
use damprig_core::control::stepped_sine::{DriveMode, MAX_POINTS, Start, SteppedSine};
use damprig_core::io::{Actuators, SUBSAMPLES, Sensors, SlowBlock};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{Cavity, Particle, SetUp, Structure, Wall};
use damprig_core::rig::{Rejected, Rig, RigState};
use damprig_core::settings::Settings;
use damprig_core::twin::{Twin, TwinConfig};
use damprig_device::board::{Board, Saving};
use damprig_device::control_loop::step;
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::message_reader::MessageReader;
use damprig_device::outbox::Outbox;
use damprig_device::queues::{LocalQueues, Losses, Requests};
use damprig_device::upload_buffer::UploadBuffer;
use damprig_protocol::frame::{self, LONGEST};
use damprig_protocol::{FromDevice, NumberedRequest, Reply, Request, SIGNALS_TOLD, Signal, Telemetry, ToDevice};
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Base, Plant, PlantConfig, Shaker};
use static_cell::ConstStaticCell;

use crate::boards::mps2_an386::{InstructionCounter, NAME, exit};
use crate::tasks::control::info;

/// Number of ticks: two points of three seconds each, their ends, the fade-out of the drive and some idle ticks.
const TICKS: u32 = 16_000;

/// Result of the count.
#[derive(Default)]
struct Tally {
    sum: u64,
    ticks: u32,
    worst: u32,
    worst_at: u32,
    plant: u64,
}

/// Number of bytes below the present end of the stack that are observed.
const STACK_WATCHED: usize = 16 * 1024;
const PAINT: u32 = 0x5a5a_a5a5;
/// Bytes used by the measurement itself.
const OWN: usize = 64;

/// Returns the result of `work` and its stack depth, bytes.
#[inline(never)]
fn depth<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let top = cortex_m::register::msp::read() as usize - OWN;
    let bottom = (top - STACK_WATCHED) as *mut u32;
    for n in 0..STACK_WATCHED / 4 {
        // SAFETY: below the end of the stack there are megabytes of unused memory.
        unsafe { bottom.add(n).write_volatile(PAINT) };
    }
    let result = work();
    // SAFETY: as above.
    let untouched = (0..STACK_WATCHED / 4).take_while(|&n| unsafe { bottom.add(n).read_volatile() } == PAINT).count();
    (result, STACK_WATCHED + OWN - 4 * untouched)
}

/// Largest stack depths of the parts of a board, bytes.
#[derive(Default)]
struct Depths {
    /// A tick with its samples and outputs.
    tick: usize,
    /// From received bytes to a request.
    receive: usize,
    /// From a message to a frame.
    send: usize,
}

/// The controller with a simulated rig, whose plant advances between the counted steps.
struct Rehearsal<'a> {
    counter: &'a InstructionCounter,
    controller: Controller,
    upload: &'static mut UploadBuffer,
    board: CountedBoard,
    requests: OneRequest,
    queues: LocalQueues,
    reader: MessageReader,
    seq: u16,
    depths: Depths,
    /// Numbers of accepted and of rejected requests.
    replies: [u32; 2],
}

/// A board that stores its outputs, which the plant takes after the step.
struct CountedBoard {
    slow: SlowBlock,
    sensors: Sensors,
    actuators: Actuators,
    plant: Plant<f32>,
}

impl Board for CountedBoard {
    /// Converts counts of a converter as on a real board, but gives the simulated readings to the rig.
    fn samples(&mut self, rig: &Rig) -> Option<Sensors> {
        black_box(rig.settings().calibration.readings(black_box(&self.slow)));
        Some(self.sensors)
    }

    fn set(&mut self, actuators: &Actuators, rig: &Rig) {
        black_box(rig.settings().calibration.drive.to_counts(black_box(actuators.drive_m)));
        self.actuators = *actuators;
    }

    fn save(&mut self, _: &Settings) -> Result<Saving, Rejected> {
        Ok(Saving::Done)
    }

    fn started(&mut self) {
        self.plant.restart(0);
    }
}

#[derive(Default)]
struct OneRequest(Option<NumberedRequest>);

impl Requests for OneRequest {
    fn front(&mut self) -> Option<&NumberedRequest> {
        self.0.as_ref()
    }

    fn drop_front(&mut self) {
        self.0 = None;
    }

    fn losses(&self) -> Losses {
        Losses::default()
    }
}

impl Rehearsal<'_> {
    /// Delivers the request as bytes; it is served in the next step.
    fn send(&mut self, ask: Request) {
        self.seq += 1;
        let mut out = [0; LONGEST];
        let message = ToDevice::Request(NumberedRequest { seq: self.seq, at_tick: None, request: ask });
        let length = frame::encode(&message, &mut out).expect("every message fits a frame");
        let reader = &mut self.reader;
        let (request, depth) = depth(|| out[..length].iter().find_map(|&byte| reader.push(byte)));
        let Some(ToDevice::Request(request)) = request else { panic!("the request was not read") };
        self.requests.0 = Some(request);
        self.depths.receive = self.depths.receive.max(depth);
    }

    /// Runs and counts one step, then advances plant and link.
    fn step(&mut self, tally: &mut Tally) {
        let Self { counter, controller, upload, board, requests, queues, depths, replies, .. } = self;
        let tick = controller.next_tick();
        let ((_, within), deep) = depth(|| counter.count(|| step(controller, upload, board, requests, queues)));
        depths.tick = depths.tick.max(deep);
        let ((), plant) = counter.count(|| {
            if let Some(point) = controller.rig().begins_from_rest() {
                board.plant.restart(point);
            }
            board.sensors = board.plant.tick(&board.actuators);
        });
        tally.add(within, plant, tick);
        let mut outbox = Outbox::default();
        while let Some(message) = outbox.next(queues) {
            if let FromDevice::Reply { answer, .. } = message {
                replies[usize::from(answer.is_err())] += 1;
            }
        }
    }

    fn ask(&mut self, ask: Request, tally: &mut Tally) {
        self.send(ask);
        self.step(tally);
    }
}

impl Tally {
    fn add(&mut self, instructions: u32, plant: u32, tick: u32) {
        self.sum += u64::from(instructions);
        self.plant += u64::from(plant);
        self.ticks += 1;
        if instructions > self.worst {
            (self.worst, self.worst_at) = (instructions, tick);
        }
    }
}

/// Sets the rig up, counts, prints `name = number` lines with the names of `budgets.toml`, and ends the emulator.
pub fn run(counter: &InstructionCounter) -> ! {
    static UPLOAD_BUFFER: ConstStaticCell<UploadBuffer> = ConstStaticCell::new(UploadBuffer::new());
    counter.check();
    let board = CountedBoard {
        slow: [[32_760; 3]; SUBSAMPLES],
        sensors: Sensors::default(),
        actuators: Actuators::default(),
        plant: Plant::new(&plant()).expect("the plant is physical"),
    };
    let mut rig = Rehearsal {
        counter,
        controller: Controller::new(info(NAME), BootInfo::default()),
        upload: UPLOAD_BUFFER.take(),
        board,
        requests: OneRequest::default(),
        queues: LocalQueues::default(),
        reader: MessageReader::default(),
        seq: 0,
        depths: Depths::default(),
        replies: [0; 2],
    };
    let (mut idle, mut spring_moves) = (Tally::default(), Tally::default());
    let longest = (0..MAX_POINTS).map(|n| 2.0 + 1e-3 * n as f32).collect();
    for (name, ask) in [
        ("settings", Request::SetSettings(Settings::default())),
        ("spring", Request::SetSpring(spring())),
        ("twin", Request::SetTwin(Some(TwinConfig::new(set_up())))),
        ("most frequencies", Request::Configure(SteppedSine { points: longest, ..experiment() })),
        ("two frequencies", Request::Configure(experiment())),
        (
            "limits",
            Request::SetLimits(ExperimentLimits { half_cycles_ahead: Some(20.0), ..ExperimentLimits::default() }),
        ),
        ("telemetry", Request::SetTelemetry { every_ticks: 1, signals: (0..16).collect(), impacts: true }),
    ] {
        let mut tally = Tally::default();
        rig.ask(ask, &mut tally);
        hprintln!("set_up_request {} = {}", name, tally.worst);
        idle.add(tally.worst, 0, 0);
    }
    for command in [SpringCommand::Home, SpringCommand::TouchOff, SpringCommand::Set(Target::Force { force_n: 2.0 })] {
        rig.ask(Request::Spring(command), &mut spring_moves);
        (0..16_000).for_each(|_| rig.step(&mut spring_moves));
    }
    rig.ask(Request::Spring(SpringCommand::Set(Target::FrictionRatio { ratio: 0.5 })), &mut spring_moves);
    rig.ask(Request::ArmSnippet, &mut spring_moves);
    rig.ask(Request::Start, &mut idle);
    let (mut alone, mut served) = (Tally::default(), Tally::default());
    for tick in 0..TICKS {
        if tick % 4 == 0 {
            let is_running = matches!(rig.controller.rig().state(), RigState::Running(_));
            rig.ask(asked(tick / 4, is_running), &mut served);
        } else {
            rig.step(&mut alone);
        }
    }
    let [done, rejected] = rig.replies;
    assert!(rejected < done && done + rejected == u32::from(rig.seq), "{} done, {} rejected", done, rejected);
    let points = rig.controller.rig().status().points;
    let impacts = rig.controller.rig().signals().impacts;
    assert!(points == 2 && impacts > 20.0, "the load did not run: {} points, {} impacts", points, impacts);
    let ticks = u64::from(alone.ticks + served.ticks);
    hprintln!("instructions_per_tick_mean = {}", (alone.sum + served.sum) / ticks);
    hprintln!("instructions_per_tick_worst = {}", alone.worst.max(served.worst).max(spring_moves.worst));
    hprintln!("instructions_per_idle_request_worst = {}", idle.worst);
    hprintln!("worst_served = {}", served.worst);
    hprintln!("worst_served_at = {}", served.worst_at);
    hprintln!("worst_in_an_experiment = {}", alone.worst);
    hprintln!("worst_in_an_experiment_at_tick = {}", alone.worst_at);
    hprintln!("worst_while_the_spring_moves = {}", spring_moves.worst);
    hprintln!("worst_of_the_twin_in_a_chatter = {}", worst_of_a_chatter(counter));
    hprintln!("instructions_per_simulated_tick_mean = {}", (alone.plant + served.plant) / ticks);
    let Depths { tick, receive, send } = Depths { send: depth_of_sending(), ..rig.depths };
    hprintln!("stack_of_a_tick = {}", tick);
    hprintln!("stack_of_receiving = {}", receive);
    hprintln!("stack_of_sending = {}", send);
    // The line's tasks run one at a time; the tick interrupts either.
    hprintln!("stack_bytes_worst = {}", tick + receive.max(send));
    exit(true)
}

/// Counts the twin's worst tick alone: under constant acceleration its particle comes to rest at a wall of e = 0.9,
/// with more events per tick than the twin allows.
fn worst_of_a_chatter(counter: &InstructionCounter) -> u32 {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 1e-3,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.9 },
        cavity: Cavity::default(),
    };
    let set_up = SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 15.0, 0.3)) };
    let mut twin = Twin::new(&TwinConfig::new(set_up)).expect("the set-up is physical");
    let mut worst = 0;
    for tick in 0..1000u16 {
        let time_s = f32::from(tick) * 1e-3;
        let z_m = 2.5 * time_s * time_s;
        let (_, instructions) = counter.count(|| black_box(twin.tick(tick.into(), black_box(z_m), z_m)));
        worst = worst.max(instructions);
    }
    assert!(twin.motion().unresolved() > 0, "the chatter ended by itself");
    worst
}

/// Stack depth of encoding the message with the most numbers and the one with the most texts, bytes.
fn depth_of_sending() -> usize {
    let values = (0..64u8).map(f32::from).collect();
    let telemetry = Telemetry { seq: 1, first_tick: 2, every_ticks: 1, width: 16, values };
    let signal = || Signal { name: "signal".try_into().unwrap_or_default(), unit: "m".try_into().unwrap_or_default() };
    let signals = Reply::Signals((0..SIGNALS_TOLD).map(|_| signal()).collect());
    let mut out = [0; LONGEST];
    [FromDevice::Telemetry(telemetry), FromDevice::Reply { seq: 3, answer: Ok(signals) }]
        .iter()
        .map(|message| depth(|| encode(black_box(message), &mut out)).1)
        .fold(0, usize::max)
}

/// Not inlined: its stack would then be in the caller's frame, above the range that [`depth`] observes.
#[inline(never)]
fn encode(message: &FromDevice, out: &mut [u8; LONGEST]) -> Option<usize> {
    frame::encode(message, out)
}

fn set_up() -> SetUp {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 7.5e-3,
        friction_coefficient: 0.08,
        wall: Wall::Restitution { coefficient: 0.47 },
        cavity: Cavity::default(),
    };
    SetUp { particle: Some(particle), ..SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)) }
}

fn spring() -> SpringSetUp {
    SpringSetUp {
        stiffness_n_per_m: None,
        friction_coefficient: Some(0.3),
        structure_stiffness_n_per_m: set_up().structure.stiffness_n_per_m as f32,
    }
}

fn plant() -> PlantConfig {
    PlantConfig {
        base: Base::Shaker(Shaker::default()),
        walls: Some(WallSensors::default()),
        spring: Some(SpringPlant::default()),
        ..PlantConfig::ideal(set_up())
    }
}

/// The requests of a host during an experiment, in turn. A new target is rare, so that the spring reaches it.
fn asked(turn: u32, is_running: bool) -> Request {
    if turn.is_multiple_of(256) {
        return Request::Spring(SpringCommand::Set(Target::FrictionRatio { ratio: 0.5 }));
    }
    match turn % 16 {
        0 => Request::Signals { from: 0 },
        1 => Request::Describe,
        2 => Request::ArmSnippet,
        3 => Request::Settings,
        4 => Request::SetTelemetry { every_ticks: 1, signals: (0..16).collect(), impacts: true },
        5 => Request::Identify,
        6 => Request::Snippet { from: 0 },
        7 => Request::Result { index: 0 },
        // Rejected while an experiment runs.
        8..=12 if !is_running => Request::Status,
        8 => Request::Start,
        9 => Request::BeginUpload { bytes: 2, crc32: 0 },
        10 => Request::SetSpring(spring()),
        11 => Request::SetTwin(None),
        12 => Request::Spring(SpringCommand::TouchOff),
        13 => Request::StoredSettings { page: 0, from: 0 },
        _ => Request::Status,
    }
}

/// A closed-loop experiment that measures from the first cycle within tolerance.
fn experiment() -> SteppedSine {
    SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 2e-3,
        drive: DriveMode::ClosedLoop(ClosedLoop { tolerance: 0.5, wait_s: 0.0, ..ClosedLoop::default() }),
        ramp_s: 0.0,
        settle_s: 2.0,
        dwell_s: 4.0,
        steady: SteadyLimits::default(),
        points: [2.4, 2.5].into_iter().collect(),
        first_index: 0,
    }
}
