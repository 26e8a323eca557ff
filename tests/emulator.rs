//! The emulated board gives the same bits as the virtual rig in `f32`, and the same bits when run again.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use damprig_core::control::friction_spring::{SpringCommand, SpringSetUp, Target};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::control::transient::playback::RecordId;
use damprig_core::control::transient::{FreeVibration, Playback};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{Cavity, FrictionDamper, Particle, SetUp, Structure, Wall};
use damprig_core::twin::TwinConfig;
use damprig_device::board::DeviceInfo;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::upload::{CHUNK_BYTES, checksum};
use damprig_protocol::{Event, FromDevice, NumberedRequest, Reply, Request, ToDevice};
use damprig_simulator::device::{Progress, SimulatedDevice};
use damprig_simulator::messages::set_plant;
use damprig_simulator::plant::PlantConfig;
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_tests::support::emulator::Emulator;
use damprig_tests::support::images::find;

/// Ticks of one experiment: from rest, two points of three seconds.
const TICKS: u32 = 12_000;

/// Ticks per grant: few, so that the credit runs out in every phase of the experiment.
const GRANT: u32 = 997;

/// A board under test: returns all its answers to a message.
trait Board {
    fn answer(&mut self, message: &ToDevice) -> Vec<u8>;
}

impl Board for SimulatedDevice<f32> {
    fn answer(&mut self, message: &ToDevice) -> Vec<u8> {
        let mut received = vec![];
        self.receive(&bytes(message));
        while self.run(1000, |bytes| received.extend_from_slice(bytes)) == Progress::Running {}
        received
    }
}

impl Board for TcpStream {
    fn answer(&mut self, message: &ToDevice) -> Vec<u8> {
        self.write_all(&bytes(message)).unwrap();
        let (mut received, mut reader, mut some) = (vec![], Reader::default(), [0; 4096]);
        loop {
            let length = self.read(&mut some).expect("the emulator answers within the time-out");
            assert!(length > 0, "the emulator closed the line");
            received.extend_from_slice(&some[..length]);
            let last = some[..length].iter().filter_map(|&byte| reader.push::<FromDevice>(byte)).last();
            match (message, last) {
                (ToDevice::Request(_), Some(Ok(FromDevice::Reply { .. }))) => return received,
                (ToDevice::Grant { .. }, Some(Ok(FromDevice::Clock { .. }))) => return received,
                _ => {}
            }
        }
    }
}

fn bytes(message: &ToDevice) -> Vec<u8> {
    let mut out = [0; LONGEST];
    let length = frame::encode(message, &mut out).unwrap();
    out[..length].to_vec()
}

fn messages(received: &[u8]) -> Vec<FromDevice> {
    let mut reader = Reader::default();
    received.iter().filter_map(|&byte| reader.push(byte)).map(|message| message.expect("a whole frame")).collect()
}

/// Particle, wall and friction damper together: they exercise every branch of the integrator.
fn hybrid() -> PlantConfig {
    let mut set_up = SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038));
    set_up.particle = Some(Particle {
        mass_kg: 0.16,
        clearance_m: 0.0075,
        friction_coefficient: 0.08,
        wall: Wall::Restitution { coefficient: 0.47 },
        cavity: Cavity::default(),
    });
    set_up.friction_damper = Some(FrictionDamper { force_n: 0.2 });
    PlantConfig {
        structure_start_m: 0.0,
        particle_start_m: 0.001,
        walls: Some(WallSensors::default()),
        // Close to the switch and the structure, so that little time passes before the experiment.
        spring: Some(SpringPlant { start_m: 1e-4, touch_m: 1.5e-3, ..SpringPlant::default() }),
        ..PlantConfig::ideal(set_up)
    }
}

/// All signals that the board can report at once: the motion, the dampers and the twin.
fn telemetry() -> Request {
    Request::SetTelemetry {
        every_ticks: 5,
        signals: [0, 1, 2, 6, 7, 10, 11, 12, 14, 15, 16, 17, 20].into_iter().collect(),
        impacts: true,
    }
}

fn experiment() -> SteppedSine {
    SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: 1.5e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 1.0,
        dwell_s: 3.0,
        steady: SteadyLimits::default(),
        points: [2.4, 2.5].into_iter().collect(),
        first_index: 0,
    }
}

/// One experiment as a host would run it; returns all bytes received after the start.
fn run(board: &mut impl Board, first_seq: u16) -> Vec<u8> {
    let config = hybrid();
    let spring = |command| vec![Request::Spring(command)];
    let mut received = vec![];
    let mut seq = first_seq;
    let mut until_tick = 0;
    for asks in [
        vec![
            set_plant(config),
            Request::SetSpring(SpringSetUp {
                stiffness_n_per_m: None,
                friction_coefficient: None,
                structure_stiffness_n_per_m: config.set_up.structure.stiffness_n_per_m as f32,
            }),
            Request::SetTwin(Some(TwinConfig::new(config.set_up))),
            Request::Configure(experiment()),
            telemetry(),
            Request::Spring(SpringCommand::Home),
        ],
        spring(SpringCommand::TouchOff),
        spring(SpringCommand::Set(Target::Force { force_n: 0.7 })),
        vec![
            Request::Spring(SpringCommand::Set(Target::FrictionRatio { ratio: 0.4 })),
            Request::ArmSnippet,
            Request::Start,
        ],
    ] {
        // Long enough for the spring to complete its previous request.
        if until_tick > 0 {
            received.extend(board.answer(&ToDevice::Grant { until_tick }));
        }
        until_tick += 6_000;
        for ask in asks {
            let reply =
                messages(&board.answer(&ToDevice::Request(NumberedRequest { seq, at_tick: None, request: ask })));
            assert_eq!(reply, [FromDevice::Reply { seq, answer: Ok(Reply::Done) }]);
            seq += 1;
        }
    }
    for until_tick in (GRANT..TICKS + GRANT).step_by(GRANT as usize) {
        received.extend(board.answer(&ToDevice::Grant { until_tick }));
    }
    received
}

fn connect(emulator: &Emulator) -> TcpStream {
    let line = TcpStream::connect(emulator.socket()).unwrap();
    line.set_nodelay(true).unwrap();
    line.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    line
}

#[test]
fn an_experiment_on_the_emulated_board_gives_the_virtual_rigs_bytes() {
    let Some(image) = find("mps2-an386") else { return };
    let emulator = Emulator::start(&image);
    let emulated = run(&mut connect(&emulator), 1);
    let here = run(&mut SimulatedDevice::<f32>::new(DeviceInfo::new("test", "test")), 1);

    let points: Vec<_> = messages(&here)
        .into_iter()
        .filter(|message| matches!(message, FromDevice::Event { event: Event::Point(_), .. }))
        .collect();
    assert_eq!(points.len(), 2, "the experiment did not measure both points: {points:?}");
    let told = |wanted: fn(&Event) -> bool| {
        let event = |message: &FromDevice| matches!(message, FromDevice::Event { event, .. } if wanted(event));
        messages(&here).iter().filter(|message| event(message)).count()
    };
    assert!(told(|event| matches!(event, Event::Impact(_))) > 5, "no impacts");
    assert!(told(|event| matches!(event, Event::Spring(_))) >= 4, "the spring did not carry out its commands");
    println!("compared {} bytes of {} messages", here.len(), messages(&here).len());
    for (ours, theirs) in messages(&here).iter().zip(&messages(&emulated)) {
        assert_eq!(ours, theirs);
    }
    assert!(here == emulated, "the streams differ in length");
}

#[test]
fn a_repeated_run_on_the_emulated_board_gives_the_same_bytes() {
    let Some(image) = find("mps2-an386") else { return };
    let run = || run(&mut connect(&Emulator::start(&image)), 1);
    assert!(run() == run());
}

/// Uploads and plays a record, then releases a structure; returns all bytes received.
fn run_transients(board: &mut impl Board) -> Vec<u8> {
    let at = |n: u32| (8e3 * (f64::from(n) * 0.11).sin() * (f64::from(n) * std::f64::consts::PI / 300.0).sin()) as i16;
    let record: Vec<u8> = (0..=300).flat_map(|n| at(n).to_le_bytes()).collect();
    let crc32 = checksum(0, &record);
    let chunk = |(n, data): (usize, &[u8])| Request::UploadChunk {
        offset: (n * CHUNK_BYTES) as u32,
        data: data.iter().copied().collect(),
    };
    let playback = Playback {
        record: RecordId { samples: 301, crc32 },
        sample_rate_hz: 128.0,
        scale_m: 5e-7,
        ramp_s: 0.25,
        tail_s: 1.0,
        rest_level_m: 5e-4,
        index: 0,
    };
    let free = FreeVibration { level_m: 0.02, hold_s: 0.2, timeout_s: 9.0, measure_s: 3.0, cycles: 5, index: 0 };
    let plant = |structure_start_m| set_plant(PlantConfig { structure_start_m, spring: None, ..hybrid() });
    let begin = Request::BeginUpload { bytes: record.len() as u32, crc32 };
    let chunks: Vec<Request> = record.chunks(CHUNK_BYTES).enumerate().map(chunk).collect();
    let upload = [vec![plant(0.0), begin], chunks].concat();
    let play = vec![Request::ConfigurePlayback(playback), telemetry(), Request::Start];
    let release = vec![plant(0.03), Request::ConfigureFreeVibration(free), Request::Start];
    let (mut received, mut seq) = (vec![], 0);
    for (asks, ticks) in [(upload, 100), (play, 5_000), (release, 5_000)] {
        for ask in asks {
            seq += 1;
            let reply = board.answer(&ToDevice::Request(NumberedRequest { seq, at_tick: None, request: ask }));
            let is_fine = |m: &FromDevice| matches!(m, FromDevice::Reply { answer: Ok(_), .. });
            assert!(messages(&reply).iter().any(is_fine), "{:?}", messages(&reply));
            received.extend(reply);
        }
        for until_tick in (GRANT.min(ticks)..ticks + GRANT).step_by(GRANT as usize) {
            received.extend(board.answer(&ToDevice::Grant { until_tick }));
        }
    }
    received
}

#[test]
fn an_upload_a_playback_and_a_release_on_the_emulated_board_give_the_virtual_rigs_bytes() {
    let Some(image) = find("mps2-an386") else { return };
    let emulator = Emulator::start(&image);
    let emulated = run_transients(&mut connect(&emulator));
    let here = run_transients(&mut SimulatedDevice::<f32>::new(DeviceInfo::new("test", "test")));
    let result = |message: &FromDevice| match message {
        FromDevice::Event { event: Event::Transient(result), .. } => Some(*result),
        _ => None,
    };
    let results: Vec<_> = messages(&here).iter().filter_map(result).collect();
    assert!(matches!(results[..], [played, freed] if played.impacts > 2 && freed.decay.cycles == 5), "{results:?}");
    println!("compared {} bytes", here.len());
    for (ours, theirs) in messages(&here).iter().zip(&messages(&emulated)) {
        assert_eq!(ours, theirs);
    }
    assert!(here == emulated, "the streams differ in length");
}
