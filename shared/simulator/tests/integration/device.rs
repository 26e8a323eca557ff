//! The simulated board as a host sees it: bytes in, bytes out.

use damprig_core::control::fault::FaultCause;
use damprig_core::control::safety::{Limits, SafeStage, SafetyConfig};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{Cavity, Hertz, Particle, SetUp, Structure, Wall};
use damprig_core::rig::RigState;
use damprig_core::settings::Settings;
use damprig_core::twin::TwinConfig;
use damprig_device::board::DeviceInfo;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{Event, FromDevice, NumberedRequest, Rejected, Reply, Request, ToDevice};
use damprig_simulator::device::{Progress, SimulatedDevice};
use damprig_simulator::messages::{ToSimulator, set_plant};
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{InjectedFault, PlantConfig};

mod measured_points;

struct Host {
    board: SimulatedDevice<f64>,
    reader: Reader,
    bytes: Vec<u8>,
    seq: u16,
}

impl Host {
    fn new() -> Self {
        let name = DeviceInfo::new("test", "none");
        Self { board: SimulatedDevice::new(name), reader: Reader::default(), bytes: vec![], seq: 0 }
    }

    fn send(&mut self, message: &ToDevice) {
        let mut out = [0; LONGEST];
        let length = frame::encode(message, &mut out).unwrap();
        self.board.receive(&out[..length]);
    }

    fn send_for(&mut self, at_tick: Option<u32>, ask: Request) {
        self.seq += 1;
        self.send(&ToDevice::Request(NumberedRequest { seq: self.seq, at_tick, request: ask }));
    }

    /// Runs until the clock stops; returns every message sent.
    fn run(&mut self) -> Vec<FromDevice> {
        let mut received = vec![];
        while self.board.run(1000, |bytes| received.extend_from_slice(bytes)) == Progress::Running {}
        self.bytes.extend_from_slice(&received);
        received.into_iter().filter_map(|byte| self.reader.push(byte)).map(Result::unwrap).collect()
    }

    fn repeat(&mut self, ask: Request) -> Result<Reply, Rejected> {
        self.send(&ToDevice::Request(NumberedRequest { seq: self.seq, at_tick: None, request: ask }));
        let messages = self.run();
        let [FromDevice::Reply { seq, answer }] = messages.as_slice() else { panic!("one reply, not {messages:?}") };
        assert_eq!(*seq, self.seq);
        answer.clone()
    }

    fn ask(&mut self, ask: Request) -> Result<Reply, Rejected> {
        self.seq += 1;
        self.repeat(ask)
    }

    fn grant(&mut self, until_tick: u32) -> Vec<FromDevice> {
        self.send(&ToDevice::Grant { until_tick });
        self.run()
    }
}

fn plant() -> PlantConfig {
    PlantConfig::ideal(SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)))
}

/// Telemetry of the motion signals alone.
fn motion(every_ticks: u16) -> Request {
    Request::SetTelemetry { every_ticks, signals: Default::default(), impacts: false }
}

fn experiment() -> SteppedSine {
    SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: 1e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 1.0,
        dwell_s: 4.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.0, 3.0].into_iter().collect(),
    }
}

fn ready() -> Host {
    let mut host = Host::new();
    for ask in [set_plant(plant()), Request::Configure(experiment()), motion(5)] {
        assert_eq!(host.ask(ask), Ok(Reply::Done));
    }
    host
}

fn points(messages: &[FromDevice]) -> Vec<f32> {
    let point = |message: &FromDevice| match message {
        FromDevice::Event { event: Event::Point(result), .. } => Some(result.frequency_hz),
        _ => None,
    };
    messages.iter().filter_map(point).collect()
}

#[test]
fn an_experiment_runs_to_its_end_and_every_row_arrives() {
    let mut host = ready();
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    let messages = host.grant(20_000);
    assert_eq!(points(&messages), [2.0, 3.0]);
    let ticks: Vec<u32> = messages
        .iter()
        .filter_map(|message| if let FromDevice::Telemetry(t) = message { Some(t) } else { None })
        .flat_map(|t| {
            (0..t.values.len() as u32 / u32::from(t.width)).map(|row| t.first_tick + row * u32::from(t.every_ticks))
        })
        .collect();
    assert!(ticks.windows(2).all(|pair| pair[1] == pair[0] + 5), "a gap");
    assert_eq!(ticks.first(), Some(&0));
    let finished =
        |m: &FromDevice| matches!(m, FromDevice::Event { event: Event::Finished { rows_dropped: 0, .. }, .. });
    assert!(messages.iter().any(finished));
    assert_eq!(messages.last(), Some(&FromDevice::Clock { tick: 20_000 }));
}

#[test]
fn a_fault_can_be_injected_while_the_rig_runs_but_its_plant_cannot_be_replaced() {
    let mut host = ready();
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    host.grant(3000);
    let Err(Rejected::WrongState { .. }) = host.ask(set_plant(plant())) else { panic!("the plant was replaced") };
    let stop = ToSimulator::Inject(InjectedFault::EmergencyStop { pressed: true });
    assert_eq!(host.ask(stop.request()), Ok(Reply::Done));
    let messages = host.grant(3010);
    let is_stop = |m: &FromDevice| matches!(m, FromDevice::Event { event: Event::Fault(fault), .. } if fault.cause == FaultCause::EmergencyStop);
    assert!(messages.iter().any(is_stop), "{messages:?}");
}

#[test]
fn a_board_with_its_own_clock_ticks_without_credit_and_lets_no_request_wait() {
    let mut host = Host { board: SimulatedDevice::real_time(DeviceInfo::new("test", "none")), ..Host::new() };
    let mut said = vec![];
    let mut pass = |host: &mut Host, ticks| {
        assert_eq!(host.board.run(ticks, |bytes| said.extend_from_slice(bytes)), Progress::Running);
        std::mem::take(&mut said).into_iter().filter_map(|byte| host.reader.push(byte)).map(Result::unwrap).collect()
    };
    let messages: Vec<FromDevice> = pass(&mut host, 500);
    assert!(messages.is_empty(), "an idle board is silent: {messages:?}");
    assert_eq!(host.board.controller().next_tick(), 500);
    host.send_for(Some(2000), Request::Stop);
    let messages: Vec<FromDevice> = pass(&mut host, 1);
    assert!(matches!(messages[..], [FromDevice::Reply { answer: Err(Rejected::NotHere { .. }), .. }]), "{messages:?}");
    // Its plant is there before a host sets one.
    host.send_for(None, Request::Configure(experiment()));
    host.send_for(None, Request::Start);
    let messages: Vec<FromDevice> = pass(&mut host, 20_000);
    assert_eq!(points(&messages), [2.0]);
    host.board.lose_ticks(7);
    host.send_for(None, Request::Status);
    let messages: Vec<FromDevice> = pass(&mut host, 1);
    let [FromDevice::Reply { answer: Ok(Reply::Status { status, counters }), .. }] = &messages[..] else { panic!() };
    let cause = status.fault.map(|fault| fault.cause);
    assert_eq!(cause, Some(FaultCause::HostSilent), "it ticks on while the host is silent");
    assert_eq!(counters.timing.overruns, 7);
}

#[test]
fn a_second_start_gives_the_same_bytes() {
    let mut runs = vec![];
    let mut host = ready();
    for _ in 0..2 {
        assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
        host.bytes.clear();
        // Event numbers continue; everything else restarts.
        runs.push(
            host.grant(15_000).into_iter().filter(|m| !matches!(m, FromDevice::Event { .. })).collect::<Vec<_>>(),
        );
        assert_eq!(host.ask(Request::Stop), Ok(Reply::Done));
        host.grant(16_000);
    }
    assert!(runs[0] == runs[1], "both runs give the same bytes");
}

#[test]
fn the_size_of_the_grants_does_not_change_what_is_measured() {
    let mut outcomes = vec![];
    for grant in [7u32, 1000, 20_000] {
        let mut host = ready();
        assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
        let mut events = vec![];
        let mut until = 0;
        while until < 14_000 {
            until += grant;
            events.extend(host.grant(until).into_iter().filter(|m| matches!(m, FromDevice::Event { .. })));
        }
        outcomes.push(events);
    }
    assert!(!outcomes[0].is_empty());
    assert_eq!(outcomes[0], outcomes[1]);
    assert_eq!(outcomes[1], outcomes[2]);
}

#[test]
fn a_repeated_request_is_answered_again_but_not_carried_out_again() {
    let mut host = ready();
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    host.grant(100);
    // If it were carried out again it would be refused, because the rig is running.
    assert_eq!(host.repeat(Request::Start), Ok(Reply::Done));
    assert!(matches!(host.ask(Request::Start), Err(Rejected::WrongState { state: RigState::Running(_), .. })));
}

#[test]
fn a_late_copy_of_an_earlier_request_is_not_carried_out() {
    let mut host = ready();
    assert_eq!(host.ask(Request::Stop), Ok(Reply::Done));
    let stop = host.seq;
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    assert_eq!(
        host.ask(Request::SetTelemetry { every_ticks: 10, signals: Default::default(), impacts: false }),
        Ok(Reply::Done)
    );
    host.grant(100);
    let last = std::mem::replace(&mut host.seq, stop);
    assert_eq!(host.repeat(Request::Stop), Ok(Reply::Done));
    host.seq = last;
    let Ok(Reply::Status { status, .. }) = host.ask(Request::Status) else { panic!() };
    assert!(matches!(status.state, RigState::Running(_)), "a late copy of a stop was carried out");
}

#[test]
fn a_new_session_may_reuse_the_sequence_numbers_of_the_one_before() {
    let mut host = ready();
    host.seq = 0;
    assert!(matches!(host.ask(Request::Identify), Ok(Reply::Identity(_))));
    // This sequence number belonged to another request in the session before.
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    let Ok(Reply::Status { status, .. }) = host.ask(Request::Status) else { panic!() };
    assert!(matches!(status.state, RigState::Running(_)), "the request was taken for a repetition");
}

#[test]
fn a_command_with_a_tick_waits_for_it() {
    let mut host = ready();
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    host.send_for(Some(3000), Request::Stop);
    let messages = host.grant(2999);
    assert!(!messages.iter().any(|m| matches!(m, FromDevice::Reply { .. })), "the request was served before its tick");
    let messages = host.grant(6000);
    assert!(messages.iter().any(|m| matches!(m, FromDevice::Reply { .. })));
    let Ok(Reply::Status { status, .. }) = host.ask(Request::Status) else { panic!() };
    assert_eq!(status.state, RigState::Idle);
}

#[test]
fn a_command_for_the_tick_at_which_credit_ends_is_answered_before_the_clock_message() {
    let mut host = ready();
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    host.send_for(Some(3000), Request::Stop);
    let messages = host.grant(3000);
    let place = |wanted: fn(&FromDevice) -> bool| messages.iter().position(wanted).expect("the message is sent");
    let (reply, clock) =
        (place(|m| matches!(m, FromDevice::Reply { .. })), place(|m| matches!(m, FromDevice::Clock { tick: 3000 })));
    assert!(reply < clock);
}

#[test]
fn a_command_with_a_tick_does_not_wait_behind_one_without() {
    let mut host = ready();
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    host.grant(3000);
    host.send(&ToDevice::Grant { until_tick: 6000 });
    for (at_tick, ask) in [(None, Request::Status), (Some(3000), Request::Stop)] {
        host.send_for(at_tick, ask);
    }
    host.board.run(1, |_| {});
    assert_eq!(host.board.controller().rig().state(), RigState::Stopping);
}

#[test]
fn a_stop_takes_effect_in_the_next_tick() {
    let mut host = ready();
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    host.grant(3000);
    host.send(&ToDevice::Grant { until_tick: 6000 });
    host.send_for(None, Request::Stop);
    host.board.run(1, |_| {});
    assert_eq!(host.board.controller().rig().state(), RigState::Stopping);
}

fn resonance() -> SteppedSine {
    SteppedSine { amplitude_m: 1.5e-3, points: [2.5].into_iter().collect(), ..experiment() }
}

/// A plant whose particle hits its walls at resonance, with wall-force sensors.
fn impacting() -> PlantConfig {
    let mut config = PlantConfig { walls: Some(WallSensors::default()), ..plant() };
    config.set_up.particle = Some(Particle {
        mass_kg: 0.16,
        clearance_m: 7.5e-3,
        friction_coefficient: 0.0,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity::default(),
    });
    config
}

#[test]
fn one_request_is_answered_after_every_tick_whatever_happens_in_the_tick() {
    let mut host = ready();
    for ask in [
        set_plant(impacting()),
        Request::SetTwin(Some(TwinConfig::new(impacting().set_up))),
        Request::Configure(resonance()),
        motion(0),
        Request::Start,
    ] {
        assert_eq!(host.ask(ask), Ok(Reply::Done));
    }
    for tick in (0..6000).step_by(2) {
        host.send(&ToDevice::Grant { until_tick: tick + 2 });
        for _ in 0..2 {
            host.send_for(None, Request::Result { index: 7 });
        }
        for seq in [host.seq - 1, host.seq] {
            let mut received = vec![];
            host.board.run(1, |bytes| received.extend_from_slice(bytes));
            let messages = received.into_iter().filter_map(|byte| host.reader.push(byte)).map(Result::unwrap);
            let replies: Vec<u16> =
                messages.filter_map(|m| if let FromDevice::Reply { seq, .. } = m { Some(seq) } else { None }).collect();
            assert_eq!(replies, [seq], "tick {tick}");
        }
    }
    let rig = host.board.controller().rig();
    assert!(rig.status().points == 1 && rig.signals().impacts > 10.0, "{:?}", rig.signals());
}

/// A message can carry such a wall; neither the plant nor the twin of a board has its equations.
#[test]
fn a_board_refuses_a_hertz_wall_by_its_name() {
    let mut host = ready();
    let mut config = impacting();
    config.set_up.particle.as_mut().unwrap().wall = Wall::Hertz(Hertz::elastic(1e8));
    for ask in [set_plant(config), Request::SetTwin(Some(TwinConfig::new(config.set_up)))] {
        let refusal = host.ask(ask).expect_err("it has no Hertz walls");
        assert!(format!("{refusal:?}").contains("particle.wall.stiffness_n_per_m15"), "{refusal:?}");
    }
    assert_eq!(host.ask(set_plant(impacting())), Ok(Reply::Done), "the board goes on");
}

#[test]
fn events_are_sent_in_the_tick_in_which_they_occur() {
    let mut host = ready();
    let telemetry = Request::SetTelemetry { every_ticks: 0, signals: Default::default(), impacts: true };
    for ask in [set_plant(impacting()), Request::Configure(resonance()), telemetry, Request::Start] {
        assert_eq!(host.ask(ask), Ok(Reply::Done));
    }
    let (mut impacts, mut points) = (0, 0);
    for message in host.grant(20_000) {
        match message {
            FromDevice::Event { tick, event: Event::Impact(record), .. } => {
                assert_eq!(tick, record.tick);
                impacts += 1;
            }
            FromDevice::Event { tick, event: Event::Point(result), .. } => {
                assert_eq!(tick + 1, result.end_tick);
                points += 1;
            }
            _ => {}
        }
    }
    assert!(impacts > 10 && points == 1, "{impacts} impacts, {points} points");
}

#[test]
fn a_start_with_a_tick_restarts_the_tick_count_which_then_waits_for_credit() {
    let mut host = ready();
    host.grant(100);
    host.send_for(Some(200), Request::Start);
    host.grant(1000);
    let rig = host.board.controller().rig();
    assert!(matches!(rig.state(), RigState::Running(_)));
    assert_eq!(rig.next_tick(), 0);
}

#[test]
fn a_damaged_frame_is_counted_and_changes_nothing() {
    let mut host = ready();
    let mut out = [0; LONGEST];
    let request = ToDevice::Request(NumberedRequest { seq: 99, at_tick: None, request: Request::Start });
    let length = frame::encode(&request, &mut out).unwrap();
    out[3] ^= 0x10;
    host.board.receive(&out[..length]);
    assert!(host.run().is_empty());
    let Ok(Reply::Status { status, counters }) = host.ask(Request::Status) else { panic!() };
    assert_eq!((status.state, counters.bad_frames), (RigState::Idle, 1));
}

#[test]
fn a_displacement_limit_stops_the_drive_and_stays_latched() {
    let mut host = ready();
    let limits = Limits { structure_m: 3e-3, ..Limits::default() };
    let safety = SafetyConfig { limits, half_cycles_ahead: 0.0, ..SafetyConfig::default() };
    assert_eq!(host.ask(Request::SetSettings(Settings { safety, ..Settings::default() })), Ok(Reply::Done));
    let resonance = SteppedSine { points: [2.5].into_iter().collect(), ..experiment() };
    assert_eq!(host.ask(Request::Configure(resonance)), Ok(Reply::Done));
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
    let messages = host.grant(8000);
    let fault = messages.iter().find_map(|m| match m {
        FromDevice::Event { event: Event::Fault(fault), .. } => Some(*fault),
        _ => None,
    });
    let fault = fault.expect("a fault");
    assert_eq!(fault.cause, FaultCause::StructureDisplacement);
    assert!(fault.value >= 3e-3 && fault.value < 3.1e-3, "{fault:?}");
    // One second later the base stands still.
    let last = messages.iter().rev().find_map(|m| if let FromDevice::Telemetry(t) = m { Some(t) } else { None });
    let row = last.unwrap().values.chunks(4).next_back().unwrap();
    assert_eq!(row[2], 0.0, "drive");
    assert!(matches!(host.ask(Request::Start), Err(Rejected::WrongState { state: RigState::Faulted, .. })));
    let Err(refused) = host.ask(Request::ClearFault) else { panic!("the structure still rings") };
    assert!(refused.to_string().contains("wait for rest"), "{refused}");
    // 3 mm decay at ζω = 0.06 /s; 1 mm is reached after 18 s.
    host.grant(30_000);
    let Ok(Reply::Status { status, .. }) = host.ask(Request::Status) else { panic!() };
    assert_eq!((status.safe, status.state), (SafeStage::Safe, RigState::Faulted));
    assert_eq!(host.ask(Request::ClearFault), Ok(Reply::Done));
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
}

#[test]
fn invalid_values_are_refused_with_the_parameter_and_what_is_allowed() {
    let mut host = Host::new();
    assert!(matches!(host.ask(Request::Start), Err(Rejected::WrongState { .. })), "no experiment");
    assert_eq!(host.ask(Request::Configure(experiment())), Ok(Reply::Done));
    assert!(matches!(host.ask(Request::Start), Err(Rejected::NotHere { .. })), "no plant");
    let mut config = plant();
    config.set_up.structure.mass_kg = -1.0;
    let Err(refused) = host.ask(set_plant(config)) else { panic!() };
    assert_eq!(refused.to_string(), "structure.mass_kg = -1 is not allowed: must be a finite number greater than 0");
    assert_eq!(host.ask(set_plant(plant())), Ok(Reply::Done));
    let too_fast = SteppedSine { points: [51.0].into_iter().collect(), ..experiment() };
    assert!(matches!(host.ask(Request::Configure(too_fast)), Err(Rejected::Invalid { .. })));
    let nan = SteppedSine { amplitude_m: f32::NAN, ..experiment() };
    assert!(matches!(host.ask(Request::Configure(nan)), Err(Rejected::Invalid { .. })));
}
