//! Counts the instructions of a control tick in the emulator, prints them and exits.
//!
//! The load is everything at once: a hybrid damper under a stepped sine in closed loop, its spring homed, touched off and
//! held at a friction ratio, both walls listened to, the twin running along, telemetry of sixteen signals in every tick,
//! and a host that asks for something in every fourth tick, one thing after the other. What a tick takes besides (the
//! interrupt and the queues' locks) is not in it; the plant's and the line's own instructions are left out.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::friction_spring::{SpringCommand, SpringSetUp, Target};
use damprig_core::control::safety::ExperimentLimits;
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::point::SteadyLimits;
use damprig_core::model::{Particle, SetUp, Structure, Wall};
use damprig_core::plant::spring::SpringPlant;
use damprig_core::plant::walls::WallSensors;
use damprig_core::plant::{Base, PlantConfig, Shaker};
use damprig_core::io::{Calibration, SUBSAMPLES, SlowBlock};
use damprig_core::rig::State;
use damprig_core::settings::Settings;
use damprig_core::twin::{Twin, TwinConfig};
use damprig_device::simulated::Simulated;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{Answer, Ask, FromDevice, Request, SIGNALS_TOLD, Signal, Telemetry, ToDevice};

use crate::board::mps2_an386::{InstructionCounter, exit};

/// Ticks counted: two points of three seconds each, their ends, the drive's fading out and some idle ones.
const TICKS: u32 = 16_000;

/// What was counted.
#[derive(Default)]
struct Tally {
    sum: u64,
    ticks: u32,
    worst: u32,
    worst_at: u32,
    plant: u64,
}

/// Bytes below the stack's present end that are watched.
const STACK_WATCHED: usize = 16 * 1024;
const PAINT: u32 = 0x5a5a_a5a5;
/// What the measuring itself lies on.
const OWN: usize = 64;

/// What `work` returns, and how deep the stack was used below here, bytes.
#[inline(never)]
fn depth<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let top = cortex_m::register::msp::read() as usize - OWN;
    let bottom = (top - STACK_WATCHED) as *mut u32;
    for n in 0..STACK_WATCHED / 4 {
        // SAFETY: below the stack's end lie megabytes of memory that nothing uses.
        unsafe { bottom.add(n).write_volatile(PAINT) };
    }
    let result = work();
    // SAFETY: as above.
    let untouched = (0..STACK_WATCHED / 4).take_while(|&n| unsafe { bottom.add(n).read_volatile() } == PAINT).count();
    (result, STACK_WATCHED + OWN - 4 * untouched)
}

/// The deepest uses of the stack by the parts of a board, bytes.
#[derive(Default)]
struct Depths {
    /// A tick with its samples and outputs.
    tick: usize,
    /// Received bytes to an order.
    receive: usize,
    /// A message to a frame.
    send: usize,
}

/// Sets the rig up, counts, prints `name = number` lines under the names of `budgets.toml`, ends the emulator.
pub fn run(counter: &InstructionCounter, device: &mut Simulated<f32>) -> ! {
    counter.check();
    let mut host = Host { counter, device, seq: 0, now: 0, depths: Depths::default(), replies: [0; 2] };
    let mut orders = Tally::default();
    // The plant is no part of a board: it is set while the clock stands.
    host.send(Ask::SetPlant(plant()));
    host.device.run(1, |_| {});
    for ask in [
        Ask::SetSettings(Settings::default()),
        Ask::SetSpring(spring()),
        Ask::SetTwin(Some(TwinConfig::new(set_up()))),
        Ask::Configure(experiment()),
        Ask::SetLimits(ExperimentLimits { half_cycles_ahead: Some(20.0), ..ExperimentLimits::default() }),
        Ask::SetTelemetry { every_ticks: 1, signals: (0..16).collect(), impacts: true },
    ] {
        host.ask(ask, &mut orders);
    }
    for command in [SpringCommand::Home, SpringCommand::TouchOff, SpringCommand::Set(Target::Force { force_n: 2.0 })] {
        host.ask(Ask::Spring(command), &mut orders);
        host.let_pass(16_000, &mut orders);
    }
    host.ask(Ask::Spring(SpringCommand::Set(Target::FrictionRatio { ratio: 0.5 })), &mut orders);
    host.ask(Ask::ArmSnippet, &mut orders);
    host.ask(Ask::Start, &mut orders);
    host.now = 0;
    let (mut tally, mut served) = (Tally::default(), Tally::default());
    for tick in (0..TICKS).step_by(2) {
        let asks = tick % 4 == 0;
        // First the grant: what comes while the clock stands is served outside a tick.
        host.grant(2);
        if asks {
            host.send(asked(tick / 4, matches!(host.device.control().rig().state(), State::Running(_))));
        }
        host.pass(if asks { &mut served } else { &mut tally });
    }
    let [done, refused] = host.replies;
    assert!(refused < done && done + refused + 5 > u32::from(host.seq), "{} done, {} refused", done, refused);
    let points = host.device.control().rig().status().points;
    let impacts = host.device.control().rig().signals().impacts;
    assert!(points == 2 && impacts > 20.0, "the load did not run: {} points, {} impacts", points, impacts);
    hprintln!("instructions_per_tick_mean = {}", tally.sum / u64::from(tally.ticks));
    hprintln!("instructions_per_tick_worst = {}", tally.worst.max(orders.worst).max(served.worst));
    hprintln!("worst_served = {}", served.worst);
    hprintln!("worst_served_at = {}", served.worst_at);
    hprintln!("worst_in_an_experiment = {}", tally.worst);
    hprintln!("worst_in_an_experiment_at_tick = {}", tally.worst_at);
    hprintln!("worst_while_set_up = {}", orders.worst);
    hprintln!("worst_while_set_up_at = {}", orders.worst_at);
    hprintln!("worst_of_the_twin_in_a_chatter = {}", worst_of_a_chatter(counter));
    hprintln!("instructions_per_simulated_tick_mean = {}", tally.plant / u64::from(tally.ticks));
    let Depths { tick, receive, send } = Depths { send: depth_of_sending(), ..host.depths };
    hprintln!("stack_of_a_tick = {}", tick);
    hprintln!("stack_of_receiving = {}", receive);
    hprintln!("stack_of_sending = {}", send);
    // The line's tasks take turns; the tick interrupts either.
    hprintln!("stack_bytes_worst = {}", tick + receive.max(send));
    exit(true)
}

/// The twin's worst tick alone: under steady acceleration its particle comes to rest at a wall of e = 0.9, with more events in
/// a tick than the twin allows.
fn worst_of_a_chatter(counter: &InstructionCounter) -> u32 {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 1e-3,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.9 },
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

/// Of the message with the most numbers, and of the one with the most texts.
fn depth_of_sending() -> usize {
    let values = (0..64u8).map(f32::from).collect();
    let telemetry = Telemetry { seq: 1, first_tick: 2, every_ticks: 1, width: 16, values };
    let signal = || Signal { name: "signal".try_into().unwrap_or_default(), unit: "m".try_into().unwrap_or_default() };
    let signals = Answer::Signals((0..SIGNALS_TOLD).map(|_| signal()).collect());
    let mut out = [0; LONGEST];
    [FromDevice::Telemetry(telemetry), FromDevice::Reply { seq: 3, answer: Ok(signals) }]
        .iter()
        .map(|message| depth(|| frame::encode(black_box(message), &mut out)).1)
        .fold(0, usize::max)
}

struct Host<'a> {
    counter: &'a InstructionCounter,
    device: &'a mut Simulated<f32>,
    seq: u16,
    /// The tick granted.
    now: u32,
    depths: Depths,
    /// Carried out and refused.
    replies: [u32; 2],
}

impl Host<'_> {
    fn send(&mut self, ask: Ask) {
        self.seq += 1;
        let mut out = [0; LONGEST];
        let message = ToDevice::Request(Request { seq: self.seq, at_tick: None, ask });
        let length = frame::encode(&message, &mut out).expect("every message fits a frame");
        let ((), depth) = depth(|| self.device.receive(&out[..length]));
        if self.now > 0 {
            // Before, the clock stands and what is received is served at once, which no board does.
            self.depths.receive = self.depths.receive.max(depth);
        }
    }

    /// Asks while the clock runs, so that the order is served within a counted tick.
    fn ask(&mut self, ask: Ask, tally: &mut Tally) {
        self.grant(2);
        self.send(ask);
        self.pass(tally);
    }

    fn grant(&mut self, ticks: u32) {
        self.now = self.device.control().next_tick() + ticks;
        let mut out = [0; LONGEST];
        let grant = ToDevice::Grant { until_tick: self.now };
        let length = frame::encode(&grant, &mut out).expect("every message fits a frame");
        self.device.receive(&out[..length]);
    }

    fn let_pass(&mut self, ticks: u32, tally: &mut Tally) {
        self.grant(ticks);
        self.pass(tally);
    }

    /// Lets the granted ticks pass and counts them.
    fn pass(&mut self, tally: &mut Tally) {
        let calibration = Calibration::default();
        let slow: SlowBlock = [[32_760; 3]; SUBSAMPLES];
        let mut reader = Reader::default();
        let replies = &mut self.replies;
        while self.device.control().next_tick() < self.now {
            let before = self.device.control().next_tick();
            let (mut within, mut watched, mut deep) = (0, 0, 0);
            let mut ticks = true;
            let counter = self.counter;
            let (_, whole) = counter.count(|| {
                self.device.run_watched(
                    1,
                    |bytes| {
                        for &byte in bytes {
                            if let Some(Ok(FromDevice::Reply { answer, .. })) = reader.push(byte) {
                                replies[usize::from(answer.is_err())] += 1;
                            }
                        }
                    },
                    |part| {
                        // The tick with its samples before it and its output after it, then an order.
                        let work = || {
                            if ticks {
                                black_box(calibration.readings(black_box(&slow)));
                            }
                            part();
                            if ticks {
                                black_box(calibration.drive.to_counts(black_box(0.001)));
                            }
                        };
                        let ((((), counted), depth), around) = counter.count(|| depth(|| counter.count(work)));
                        (within, watched, deep) = (within + counted, watched + around, deep.max(depth));
                        ticks = false;
                    },
                )
            });
            tally.sum += u64::from(within);
            tally.plant += u64::from(whole - watched);
            self.depths.tick = self.depths.tick.max(deep);
            tally.ticks += 1;
            if within > tally.worst {
                (tally.worst, tally.worst_at) = (within, before);
            }
            if self.device.control().next_tick() <= before {
                // A start: its count of ticks begins, and its credit is another.
                break;
            }
        }
    }
}

fn set_up() -> SetUp {
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 7.5e-3,
        friction_coefficient: 0.08,
        wall: Wall::Restitution { coefficient: 0.47 },
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

/// What a host may ask for while an experiment runs, one after the other; a new target seldom, so that the spring gets to it.
fn asked(turn: u32, is_running: bool) -> Ask {
    if turn.is_multiple_of(256) {
        return Ask::Spring(SpringCommand::Set(Target::FrictionRatio { ratio: 0.5 }));
    }
    match turn % 16 {
        0 => Ask::Signals { from: 0 },
        1 => Ask::Describe,
        2 => Ask::ArmSnippet,
        3 => Ask::Settings,
        4 => Ask::SetTelemetry { every_ticks: 1, signals: (0..16).collect(), impacts: true },
        5 => Ask::Identify,
        6 => Ask::Snippet { from: 0 },
        7 => Ask::Result { index: 0 },
        // In vain.
        8..=12 if !is_running => Ask::Status,
        8 => Ask::Start,
        9 => Ask::BeginUpload { bytes: 2, crc32: 0 },
        10 => Ask::SetSpring(spring()),
        11 => Ask::SetTwin(None),
        12 => Ask::Spring(SpringCommand::TouchOff),
        _ => Ask::Status,
    }
}

/// In closed loop, measuring from the first tolerable cycle on.
fn experiment() -> SteppedSine {
    SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 2e-3,
        drive: DriveMode::ClosedLoop(ClosedLoop { tolerance: 0.5, wait_s: 0.0, ..ClosedLoop::default() }),
        ramp_s: 0.0,
        settle_s: 2.0,
        dwell_s: 4.0,
        steady: SteadyLimits::default(),
        frequencies_hz: [2.4, 2.5].into_iter().collect(),
        first_index: 0,
    }
}
