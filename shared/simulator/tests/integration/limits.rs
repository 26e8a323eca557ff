//! Limits in force: the board's, tightened by an experiment while it lasts, and the board's again after it.

use damprig_core::control::fault::{Fault, FaultCause};
use damprig_core::control::friction_spring::{SpringCommand, SpringSetUp, SpringStage, Target};
use damprig_core::control::safety::{ExperimentLimits, Limits, SafeStage, SafetyConfig};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::io::{Actuators, Reading, Sensors};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{SetUp, Structure};
use damprig_core::rig::{Rig, RigState, Status};
use damprig_core::settings::Settings;
use damprig_device::board::{Board, DeviceInfo, Saving};
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::queues::{LocalQueues, Waiting};
use damprig_device::upload_buffer::UploadBuffer;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::{Event, FromDevice, NumberedRequest, Rejected, Reply, Request, ToDevice};
use damprig_simulator::device::{Progress, SimulatedDevice};
use damprig_simulator::messages::set_plant;
use damprig_simulator::plant::PlantConfig;
use damprig_simulator::plant::spring::SpringPlant;

/// A simulated board and the faults that it has reported.
struct Host {
    board: SimulatedDevice<f64>,
    reader: Reader,
    seq: u16,
    until_tick: u32,
    faults: Vec<Fault>,
}

impl Host {
    /// A board with the bare structure of the source document and a friction spring.
    fn new(settings: Settings) -> Self {
        let mut board = SimulatedDevice::new(DeviceInfo::new("test", "none"));
        board.start_with(&settings);
        let mut host = Self { board, reader: Reader::default(), seq: 0, until_tick: 0, faults: vec![] };
        host.mount(0.0);
        host
    }

    /// Replaces the plant by one whose structure is held at this displacement, m.
    fn mount(&mut self, structure_start_m: f64) {
        let spring = Some(SpringPlant::default());
        let plant = PlantConfig { structure_start_m, spring, ..PlantConfig::ideal(structure()) };
        self.done(set_plant(plant));
    }

    fn send(&mut self, message: &ToDevice) -> Vec<FromDevice> {
        let mut out = [0; LONGEST];
        let length = frame::encode(message, &mut out).unwrap();
        self.board.receive(&out[..length]);
        let mut received = vec![];
        while self.board.run(1000, |bytes| received.extend_from_slice(bytes)) == Progress::Running {}
        let messages: Vec<FromDevice> =
            received.into_iter().filter_map(|byte| self.reader.push(byte)).map(Result::unwrap).collect();
        self.faults.extend(messages.iter().filter_map(|message| match message {
            FromDevice::Event { event: Event::Fault(fault), .. } => Some(*fault),
            _ => None,
        }));
        messages
    }

    fn ask(&mut self, ask: Request) -> Result<Reply, Rejected> {
        self.seq += 1;
        if ask == Request::Start {
            self.until_tick = 0;
        }
        let messages = self.send(&ToDevice::Request(NumberedRequest { seq: self.seq, at_tick: None, request: ask }));
        messages
            .into_iter()
            .find_map(|message| match message {
                FromDevice::Reply { answer, .. } => Some(answer),
                _ => None,
            })
            .expect("a reply")
    }

    fn done(&mut self, ask: Request) {
        assert_eq!(self.ask(ask.clone()), Ok(Reply::Done), "{ask:?}");
    }

    fn pass(&mut self, ticks: u32) {
        self.until_tick += ticks;
        self.send(&ToDevice::Grant { until_tick: self.until_tick });
    }

    fn status(&mut self) -> Status {
        let Ok(Reply::Status { status, .. }) = self.ask(Request::Status) else { panic!("no status") };
        status
    }

    /// Runs ten seconds at resonance: |x| grows to 37 mm.
    fn drive(&mut self, limits: Option<ExperimentLimits>) {
        self.done(Request::Configure(resonance()));
        if let Some(limits) = limits {
            self.done(Request::SetLimits(limits));
        }
        self.done(Request::Start);
    }

    /// Waits until the structure is at rest and clears the fault.
    fn clear(&mut self) {
        self.pass(80_000);
        assert_eq!(self.status().safe, SafeStage::Safe);
        self.done(Request::ClearFault);
        self.faults.clear();
    }
}

fn structure() -> SetUp {
    SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038))
}

fn resonance() -> SteppedSine {
    SteppedSine {
        start: Start::CarryOver,
        amplitude_m: 5e-4,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 5.0,
        dwell_s: 5.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.5].into_iter().collect(),
    }
}

/// Settings without the predictive check, so that each limit acts by itself.
fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.safety.half_cycles_ahead = 0.0;
    settings
}

fn structure_within(structure_m: f32) -> Option<ExperimentLimits> {
    Some(ExperimentLimits { structure_m: Some(structure_m), ..ExperimentLimits::default() })
}

#[test]
fn a_tightened_limit_trips_at_its_value_and_the_boards_own_is_in_force_once_the_fault_is_cleared() {
    let mut host = Host::new(settings());
    host.drive(structure_within(0.02));
    host.pass(11_000);
    let [fault] = host.faults[..] else { panic!("{:?}", host.faults) };
    assert_eq!((fault.cause, fault.limit), (FaultCause::StructureDisplacement, 0.02));
    host.clear();
    host.drive(None);
    host.pass(11_000);
    assert_eq!(host.faults, []);
    assert_eq!(host.status().state, RigState::Idle);
}

#[test]
fn the_boards_limits_are_in_force_again_when_an_experiment_ends_or_is_stopped() {
    for stops in [false, true] {
        let mut host = Host::new(settings());
        host.drive(structure_within(0.04));
        host.pass(2_000);
        if stops {
            host.done(Request::Stop);
        }
        host.pass(10_000);
        assert_eq!((host.status().state, &host.faults[..]), (RigState::Idle, &[][..]));
        // An idle rig is monitored too: a structure held at 50 mm is within the board's limit.
        host.mount(0.05);
        host.pass(2_000);
        assert_eq!((host.status().state, &host.faults[..]), (RigState::Idle, &[][..]), "stopped: {stops}");
    }
}

#[test]
fn limits_apply_to_every_start_of_their_experiment_and_to_no_other_experiment() {
    let mut host = Host::new(settings());
    host.drive(structure_within(0.02));
    for _ in 0..2 {
        host.pass(11_000);
        assert_eq!(host.faults.len(), 1);
        host.clear();
        host.done(Request::Start);
    }
    host.done(Request::Stop);
    host.pass(60_000);
    host.drive(None);
    host.pass(11_000);
    assert_eq!(host.faults, []);
}

#[test]
fn a_limit_that_would_loosen_the_boards_is_refused_with_both_values() {
    let mut settings = settings();
    settings.safety.wall_force_n = 300.0;
    let mut host = Host::new(settings);
    host.done(Request::Configure(resonance()));
    let none = ExperimentLimits::default();
    for (limits, words) in [
        (
            ExperimentLimits { wall_force_n: Some(450.0), ..none },
            "safety.wall_force_n = 450 would loosen the board's 300",
        ),
        (ExperimentLimits { host_silent_s: Some(0.0), ..none }, "safety.host_silent_s = 0 would loosen the board's 10"),
        (ExperimentLimits { base_m: Some(-1.0), ..none }, "safety.limits.base_m = -1 is not allowed"),
    ] {
        let refused = host.ask(Request::SetLimits(limits)).unwrap_err().to_string();
        assert!(refused.contains(words), "{refused}");
    }
}

#[test]
fn limits_are_accepted_only_between_the_configuration_of_an_experiment_and_its_start() {
    let mut host = Host::new(settings());
    let limits = Request::SetLimits(structure_within(0.02).unwrap());
    let refused = host.ask(limits.clone()).unwrap_err().to_string();
    assert!(refused.contains("configure an experiment first"), "{refused}");
    host.drive(None);
    let refused = host.ask(limits).unwrap_err().to_string();
    assert!(refused.contains("stop the experiment first"), "{refused}");
}

#[test]
fn limits_that_have_become_looser_than_the_boards_prevent_the_start() {
    let mut host = Host::new(settings());
    host.done(Request::Configure(resonance()));
    host.done(Request::SetLimits(structure_within(0.04).unwrap()));
    let mut tighter = settings();
    tighter.safety.limits.structure_m = 0.03;
    host.done(Request::SetSettings(tighter));
    let refused = host.ask(Request::Start).unwrap_err().to_string();
    assert!(refused.contains("safety.limits.structure_m = 0.04 would loosen the board's 0.03"), "{refused}");
    assert_eq!(host.status().state, RigState::Idle);
}

#[test]
fn a_limit_tighter_than_the_sensors_noise_does_not_prevent_clearing_its_fault() {
    let mut host = Host::new(settings());
    host.drive(Some(ExperimentLimits { base_m: Some(1e-6), ..ExperimentLimits::default() }));
    host.pass(1_000);
    assert_eq!(host.faults[0].cause, FaultCause::BaseDisplacement);
    host.clear();
    host.drive(None);
    host.pass(11_000);
    assert_eq!(host.faults, []);
}

#[test]
fn a_limit_of_the_board_that_trips_at_rest_can_be_corrected() {
    let mut wrong = settings();
    wrong.safety.limits.base_m = 1e-6;
    let mut host = Host::new(wrong);
    host.pass(10_000);
    assert_eq!((host.faults[0].cause, host.status().state), (FaultCause::BaseDisplacement, RigState::Faulted));
    assert!(host.ask(Request::ClearFault).is_err());
    host.done(Request::SetSettings(settings()));
    host.pass(1_000);
    host.done(Request::ClearFault);
    assert_eq!(host.status().state, RigState::Idle);
}

fn spring(friction_coefficient: Option<f32>) -> SpringSetUp {
    SpringSetUp {
        stiffness_n_per_m: Some(530.0),
        friction_coefficient,
        structure_stiffness_n_per_m: structure().structure.stiffness_n_per_m as f32,
    }
}

#[test]
fn a_set_up_may_describe_its_spring_but_the_boards_force_limit_stays_in_force() {
    let mut settings = settings();
    (settings.spring.largest_force_n, settings.spring.touch_span_n) = (3.0, 0.5);
    let mut host = Host::new(settings);
    host.done(Request::SetSpring(spring(Some(0.25))));
    for command in [SpringCommand::Home, SpringCommand::TouchOff] {
        host.done(Request::Spring(command));
        host.pass(16_000);
    }
    let force = |force_n| Request::Spring(SpringCommand::Set(Target::Force { force_n }));
    let refused = host.ask(force(2.875)).unwrap_err().to_string();
    assert!(refused.contains("force_n = 2.875") && refused.contains("largest_force_n"), "{refused}");
    host.done(force(2.0));
    let refused = host.ask(Request::SetSpring(SpringSetUp { stiffness_n_per_m: Some(-1.0), ..spring(None) }));
    assert!(refused.unwrap_err().to_string().contains("spring.stiffness_n_per_m = -1"));
}

#[test]
fn a_spring_keeps_its_position_after_an_experiment_and_must_be_homed_on_another_plant() {
    let mut host = Host::new(settings());
    host.done(Request::SetSpring(spring(None)));
    for command in [SpringCommand::Home, SpringCommand::TouchOff, SpringCommand::Set(Target::Force { force_n: 1.0 })] {
        host.done(Request::Spring(command));
        host.pass(16_000);
    }
    host.drive(None);
    host.pass(12_000);
    let status = host.status();
    assert_eq!((status.state, status.spring.stage), (RigState::Idle, SpringStage::Holding));
    host.mount(0.0);
    assert_eq!(host.status().spring.stage, SpringStage::Unhomed);
}

#[test]
fn a_set_ups_friction_coefficient_acts_in_its_experiment_and_the_boards_after_it() {
    let mut host = Host::new(settings());
    host.done(Request::SetSpring(spring(Some(0.25))));
    for command in
        [SpringCommand::Home, SpringCommand::TouchOff, SpringCommand::Set(Target::FrictionRatio { ratio: 0.6 })]
    {
        host.done(Request::Spring(command));
        host.pass(16_000);
    }
    // F_N = γF k Z/μe, at the measured Z of 0.5 mm: within the 10 µm steps of its sensor.
    let k_z_n = spring(None).structure_stiffness_n_per_m * 5e-4;
    for friction_coefficient in [0.25, settings().spring.friction_coefficient] {
        host.drive(None);
        host.pass(8_000);
        let (force_n, expected) = (host.status().spring.target_force_n, 0.6 * k_z_n / friction_coefficient);
        assert!((force_n / expected - 1.0).abs() < 0.02, "{force_n} N for {expected} N");
        host.pass(40_000);
        assert_eq!(host.status().state, RigState::Idle);
    }
}

#[test]
fn new_settings_keep_the_springs_position_unless_they_change_the_spring() {
    let mut host = Host::new(settings());
    host.done(Request::Spring(SpringCommand::Home));
    host.pass(16_000);
    let mut other = settings();
    other.safety.wall_force_n = 300.0;
    host.done(Request::SetSettings(other));
    assert_eq!(host.status().spring.stage, SpringStage::Homed);
    other.spring.step_m = 4e-6;
    host.done(Request::SetSettings(other));
    assert_eq!(host.status().spring.stage, SpringStage::Unhomed);
}

/// A board with a real structure and no flash.
struct Real;

impl Board for Real {
    fn samples(&mut self, _: &Rig) -> Option<Sensors> {
        None
    }

    fn set(&mut self, _: &Actuators, _: &Rig) {}

    fn save(&mut self, _: &Settings) -> Result<Saving, Rejected> {
        Err(Rejected::not_here("this board has no flash to save to"))
    }
}

/// A board with its own clock, whose sensors see base and structure vibrate by 2 mm.
struct RealBoard {
    control: Controller,
    queues: LocalQueues,
}

impl RealBoard {
    fn done(&mut self, seq: u16, ask: Request) {
        let request = NumberedRequest { seq, at_tick: None, request: ask };
        self.control.serve(&request, &mut Real, &mut UploadBuffer::new(), &mut self.queues);
        assert_eq!(self.queues.pop_message(), Some(FromDevice::Reply { seq, answer: Ok(Reply::Done) }));
    }

    /// Runs up to `most_ticks` ticks without a message; returns the tick at which the drive ends because the host is
    /// silent.
    fn ends_silent_drive(&mut self, most_ticks: u32) -> Option<u32> {
        let mut upload = UploadBuffer::new();
        for tick in 0..most_ticks {
            let mut sensors = Sensors::default();
            let swing = Reading::still((2e-3 * (f64::from(tick) * 0.0157).sin()) as f32);
            (sensors.readings.x, sensors.readings.z) = (swing, swing);
            self.control.tick(&sensors, &mut upload, &mut self.queues);
            while let Some(message) = self.queues.pop_message() {
                if let FromDevice::Event { event: Event::Fault(fault), .. } = message {
                    assert_eq!(fault.cause, FaultCause::HostSilent);
                    return Some(tick);
                }
            }
        }
        None
    }
}

#[test]
fn a_drive_ends_after_ten_seconds_of_host_silence_by_default_or_after_a_shorter_limit() {
    for (host_silent_s, expected) in [(None, 10_000), (Some(5.0), 5_000)] {
        let control = Controller::new(DeviceInfo::new("test", "none"), BootInfo::default());
        let mut board = RealBoard { control, queues: LocalQueues::default() };
        board.done(1, Request::Configure(SteppedSine { settle_s: 60.0, ..resonance() }));
        board.done(2, Request::SetLimits(ExperimentLimits { host_silent_s, ..ExperimentLimits::default() }));
        board.done(3, Request::Start);
        // The start request was the last message.
        assert_eq!(board.ends_silent_drive(20_000), Some(expected + 1));
    }
}

#[test]
fn ticks_granted_by_a_host_do_not_count_as_its_silence() {
    let mut host = Host::new(Settings {
        safety: SafetyConfig { limits: Limits { structure_m: 0.078, base_m: 0.078 }, ..settings().safety },
        ..settings()
    });
    host.done(Request::Configure(SteppedSine { amplitude_m: 2e-4, settle_s: 30.0, ..resonance() }));
    host.done(Request::Start);
    host.pass(30_000);
    assert_eq!(
        (host.faults.len(), host.status().state),
        (0, RigState::Running(damprig_core::control::outcome::ExperimentStage::Settle))
    );
}
