//! Requests that read, set and save the settings: when they are allowed, and that each gets exactly one reply.

use damprig_core::control::friction_spring::{SpringCommand, Target};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::io::{Actuators, Sensors};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::rig::{Rejected, Rig};
use damprig_core::settings::{Settings, Source};
use damprig_device::board::{DeviceInfo, Saving};
use damprig_device::controller::{BootInfo, Controller};
use damprig_device::queues::{LocalQueues, Waiting};
use damprig_device::upload_buffer::UploadBuffer;
use damprig_protocol::{FromDevice, NumberedRequest, Reply, Request};

/// A board whose flash takes as long as the test demands.
#[derive(Default)]
struct Board {
    is_slow: bool,
    saved: Vec<Settings>,
    outcome: Option<Result<(), Rejected>>,
}

impl damprig_device::board::Board for Board {
    fn samples(&mut self, _: &Rig) -> Option<Sensors> {
        None
    }

    fn set(&mut self, _: &Actuators, _: &Rig) {}

    fn save(&mut self, settings: &Settings) -> Result<Saving, Rejected> {
        self.saved.push(*settings);
        Ok(if self.is_slow { Saving::Begun } else { Saving::Done })
    }

    fn saved(&mut self) -> Option<Result<(), Rejected>> {
        self.outcome.take()
    }
}

struct Host {
    control: Controller,
    board: Board,
    queues: LocalQueues,
    seq: u16,
}

impl Host {
    fn new(is_slow: bool) -> Self {
        let control = Controller::new(DeviceInfo::new("test", "none"), BootInfo::default());
        Self { control, board: Board { is_slow, ..Board::default() }, queues: LocalQueues::default(), seq: 0 }
    }

    fn send(&mut self, seq: u16, ask: Request) {
        let request = NumberedRequest { seq, at_tick: None, request: ask };
        self.control.serve(&request, &mut self.board, &mut UploadBuffer::new(), &mut self.queues);
    }

    fn tick(&mut self) {
        self.control.end_saving(&mut self.board, &mut self.queues);
        self.control.tick(&Sensors::default(), &mut UploadBuffer::new(), &mut self.queues);
    }

    fn replies(&mut self) -> Vec<(u16, Result<Reply, Rejected>)> {
        let messages = std::iter::from_fn(|| self.queues.pop_message());
        messages
            .filter_map(|message| match message {
                FromDevice::Reply { seq, answer } => Some((seq, answer)),
                _ => None,
            })
            .collect()
    }

    fn ask(&mut self, ask: Request) -> Result<Reply, Rejected> {
        self.seq += 1;
        self.send(self.seq, ask);
        let replies = self.replies();
        let [(seq, answer)] = replies.as_slice() else { panic!("one reply, not {replies:?}") };
        assert_eq!(*seq, self.seq);
        answer.clone()
    }

    fn settings(&mut self) -> (Settings, Source) {
        match self.ask(Request::Settings) {
            Ok(Reply::Settings { settings, source }) => (settings, source),
            other => panic!("no settings: {other:?}"),
        }
    }

    fn source_described(&mut self) -> Source {
        match self.ask(Request::Describe) {
            Ok(Reply::Description(description)) => description.settings,
            other => panic!("no description: {other:?}"),
        }
    }
}

fn others() -> Settings {
    let mut settings = Settings::default();
    settings.calibration.walls.newtons_per_count = 0.25;
    settings.safety.limits.structure_m = 0.05;
    settings.impacts.threshold_n = 4.0;
    settings
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
        points: [2.0].into_iter().collect(),
    }
}

#[test]
fn settings_are_used_at_once_and_saved_on_request() {
    let mut host = Host::new(false);
    assert_eq!(host.settings(), (Settings::default(), Source::Default));
    assert_eq!(host.ask(Request::SetSettings(others())), Ok(Reply::Done));
    assert_eq!(host.settings(), (others(), Source::Host));
    assert!(host.board.saved.is_empty());
    assert_eq!(host.control.rig().snippet().1.newtons_per_count, 0.25);
    assert_eq!(host.ask(Request::SaveSettings), Ok(Reply::Done));
    assert_eq!(host.board.saved, [others()]);
    assert_eq!((host.settings().1, host.source_described()), (Source::Stored, Source::Stored));
}

#[test]
fn a_value_out_of_range_is_rejected_with_its_name_and_changes_nothing() {
    type Spoil = fn(&mut Settings);
    let spoilt: [(&str, Spoil); 14] = [
        ("calibration.x.metres_per_count", |s| s.calibration.x.metres_per_count = 0.0),
        ("calibration.spring.newtons_per_count", |s| s.calibration.spring.newtons_per_count = f32::NAN),
        ("calibration.spring.zero_counts", |s| s.calibration.spring.zero_counts = 0.0),
        ("calibration.drive.linear_low_counts", |s| s.calibration.drive.linear_low_counts = -1.0),
        // Beyond the range of the sensors: these limits would never trip.
        ("safety.limits.structure_m", |s| s.safety.limits.structure_m = 0.0785),
        ("safety.limits.base_m", |s| s.safety.limits.base_m = 0.0785),
        ("safety.wall_force_n", |s| s.safety.wall_force_n = 2000.0),
        ("spring.largest_force_n", |s| s.spring.largest_force_n = 49.5),
        ("impacts.offset_limit_n", |s| s.impacts.offset_limit_n = 100.0),
        ("safety.brake_n", |s| s.safety.brake_n = 13.6),
        ("calibration.walls.zero_counts", |s| s.calibration.walls.zero_counts = 5000.0),
        ("safety.wall_force_n", |s| s.safety.wall_force_n = -1.0),
        ("spring.step_m", |s| s.spring.step_m = 0.0),
        ("impacts.ringing", |s| s.impacts.ringing = 2.0),
    ];
    for (name, spoil) in spoilt {
        let mut host = Host::new(false);
        let mut settings = others();
        spoil(&mut settings);
        let refused = host.ask(Request::SetSettings(settings)).unwrap_err();
        let Rejected::Invalid { parameter, .. } = &refused else { panic!("{refused:?}") };
        assert_eq!(parameter.as_str(), name);
        assert_eq!(host.settings(), (Settings::default(), Source::Default));
    }
}

#[test]
fn while_an_experiment_runs_settings_can_be_read_but_neither_set_nor_saved() {
    let mut host = Host::new(false);
    host.ask(Request::Configure(experiment())).unwrap();
    host.ask(Request::Start).unwrap();
    host.tick();
    for ask in [Request::SetSettings(others()), Request::SaveSettings] {
        let refused = host.ask(ask).unwrap_err();
        assert!(refused.to_string().contains("stop the experiment first"), "{refused}");
    }
    assert_eq!(host.settings(), (Settings::default(), Source::Default));
    assert!(host.board.saved.is_empty());
}

#[test]
fn a_save_is_answered_once_when_the_flash_has_finished_and_no_command_is_accepted_before() {
    let mut host = Host::new(true);
    host.ask(Request::Configure(experiment())).unwrap();
    host.send(100, Request::SaveSettings);
    // Copies, as from a host that takes its request for lost.
    host.send(100, Request::SaveSettings);
    host.tick();
    assert_eq!(host.replies(), []);
    assert!(host.ask(Request::Status).is_ok());
    for ask in [Request::Start, Request::SetSettings(others()), Request::SaveSettings] {
        let refused = host.ask(ask).unwrap_err();
        assert!(refused.to_string().contains("being saved"), "{refused}");
    }
    host.board.outcome = Some(Ok(()));
    host.tick();
    host.tick();
    assert_eq!(host.replies(), [(100, Ok(Reply::Done))]);
    assert_eq!(host.board.saved.len(), 1);
    assert_eq!(host.settings().1, Source::Stored);
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
}

#[test]
fn a_failed_save_is_reported_and_the_settings_stay_in_use() {
    let mut host = Host::new(true);
    host.ask(Request::SetSettings(others())).unwrap();
    host.send(100, Request::SaveSettings);
    host.board.outcome = Some(Err(Rejected::not_here("the flash did not take the settings")));
    host.tick();
    let why = Rejected::not_here("the flash did not take the settings");
    assert_eq!(host.replies(), [(100, Err(why.clone()))]);
    // The reply may have been lost.
    host.send(100, Request::SaveSettings);
    assert_eq!(host.replies(), [(100, Err(why))]);
    assert_eq!(host.settings(), (others(), Source::Host));
}

/// The saved settings do not act. Setting others does not change that; consent lasts for a session.
#[test]
fn nothing_drives_on_settings_other_than_the_saved_ones_without_consent_or_a_save() {
    for source in [Source::Damaged, Source::OtherLayout, Source::Older] {
        let mut host = Host::new(false);
        host.control.start_with(&others(), source);
        host.ask(Request::SetSettings(Settings::default())).unwrap();
        host.ask(Request::Configure(experiment())).unwrap();
        let target = Target::Force { force_n: 2.0 };
        let moves = [SpringCommand::Home, SpringCommand::TouchOff, SpringCommand::Set(target)];
        let all_refused = |host: &mut Host| {
            for ask in moves.map(Request::Spring).into_iter().chain([Request::Start]) {
                let refused = host.ask(ask).unwrap_err().to_string();
                assert!(refused.contains("the saved settings do not act"), "{source:?}: {refused}");
            }
        };
        all_refused(&mut host);
        assert_eq!(host.settings().1, source);
        host.ask(Request::AcceptSettings).unwrap();
        // A new session.
        host.ask(Request::Identify).unwrap();
        all_refused(&mut host);
        host.ask(Request::AcceptSettings).unwrap();
        assert_eq!(host.ask(Request::Spring(SpringCommand::Home)), Ok(Reply::Done));
        let mut host = Host::new(false);
        host.control.start_with(&others(), source);
        host.ask(Request::SaveSettings).unwrap();
        host.ask(Request::Configure(experiment())).unwrap();
        assert_eq!(host.ask(Request::Start), Ok(Reply::Done), "{source:?}");
    }
    for source in [Source::Default, Source::Stored, Source::Migrated] {
        let mut host = Host::new(false);
        host.control.start_with(&others(), source);
        host.ask(Request::Configure(experiment())).unwrap();
        assert_eq!(host.ask(Request::Start), Ok(Reply::Done), "{source:?}");
    }
}

#[test]
fn consent_lets_an_experiment_start() {
    let mut host = Host::new(false);
    host.control.start_with(&others(), Source::Damaged);
    host.ask(Request::Configure(experiment())).unwrap();
    host.ask(Request::AcceptSettings).unwrap();
    assert_eq!(host.ask(Request::Start), Ok(Reply::Done));
}

#[test]
fn stored_settings_are_in_use_from_the_first_tick() {
    let mut host = Host::new(false);
    host.control.start_with(&others(), Source::Stored);
    assert_eq!(host.settings(), (others(), Source::Stored));
    assert_eq!(host.control.rig().snippet().1.newtons_per_count, 0.25);
}
