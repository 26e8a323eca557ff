//! Demands beyond the drive's range: refused when configured and when started, clipped and reported in closed loop.

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::experiment::Experiment;
use damprig_core::control::fault::FaultCause;
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine, SteppedSinePlan};
use damprig_core::control::transient::Playback;
use damprig_core::control::transient::playback::RecordId;
use damprig_core::io::{Calibration, DriveScale};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{SetUp, Structure};
use damprig_core::rig::{Command, Rig};
use damprig_core::settings::Settings;
use damprig_device::board::DeviceInfo;
use damprig_protocol::frame::{self, LONGEST, Reader};
use damprig_protocol::upload::{CHUNK_BYTES, checksum};
use damprig_protocol::{Event, FromDevice, NumberedRequest, Rejected, Reply, Request, ToDevice};
use damprig_simulator::board::PlantScalar;
use damprig_simulator::device::{Progress, SimulatedDevice};
use damprig_simulator::plant::{Base, PlantConfig, Shaker};

use crate::support::host::Host;

fn bare() -> PlantConfig {
    PlantConfig::ideal(SetUp::bare(Structure::from_modal(1.6, 2.5, 0.0038)))
}

fn on_a_shaker(shaker: Shaker) -> PlantConfig {
    PlantConfig { base: Base::Shaker(shaker), ..bare() }
}

fn sine(amplitude_m: f32, drive: DriveMode) -> SteppedSine {
    SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m,
        drive,
        ramp_s: 1.0,
        settle_s: 2.0,
        dwell_s: 4.0,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [2.0].into_iter().collect(),
    }
}

fn closed(drive_limit_m: f32) -> DriveMode {
    DriveMode::ClosedLoop(ClosedLoop { drive_limit_m, wait_s: 0.0, ..ClosedLoop::default() })
}

/// A versine pulse of one second and this height, m, in counts of 0.2 µm at 500 Hz.
fn pulse(peak_m: f64) -> Vec<u8> {
    let at = |n: u32| 0.5 * peak_m / 2e-7 * (1.0 - (std::f64::consts::TAU * f64::from(n) / 500.0).cos());
    (0..=500).flat_map(|n| (at(n).round() as i16).to_le_bytes()).collect()
}

fn playback(bytes: &[u8]) -> Request {
    Request::ConfigurePlayback(Playback {
        record: RecordId { samples: (bytes.len() / 2) as u16, crc32: checksum(0, bytes) },
        sample_rate_hz: 500.0,
        scale_m: 2e-7,
        ramp_s: 0.0,
        tail_s: 1.0,
        rest_level_m: 1e-3,
        index: 0,
    })
}

fn upload(host: &mut Host, bytes: &[u8]) {
    assert!(host.ask(Request::BeginUpload { bytes: bytes.len() as u32, crc32: checksum(0, bytes) }).is_ok());
    for (n, chunk) in bytes.chunks(CHUNK_BYTES).enumerate() {
        let data = chunk.iter().copied().collect();
        assert!(host.ask(Request::UploadChunk { offset: (n * CHUNK_BYTES) as u32, data }).is_ok());
    }
    host.pass(1_000);
}

/// Limit of the drive as delivered, m: 0.2 V to 3.1 V of ±5 mm over 3.3 V.
fn as_delivered_m() -> f32 {
    Calibration::default().drive.range().amplitude_m()
}

fn assert_refused(answer: Result<Reply, Rejected>, parameter: &str, value: f32) {
    let refused = answer.unwrap_err();
    let words = refused.to_string();
    let Rejected::AboveLimit { parameter: named, value: told, limit, .. } = refused else { panic!("{words}") };
    assert_eq!((named.as_str(), limit), (parameter, as_delivered_m()), "{words}");
    assert!((told - value).abs() < 1e-6, "{words}");
    assert!(words.contains("ask for less") && words.contains("calibration.drive"), "{words}");
}

#[test]
fn an_amplitude_that_the_drive_cannot_deliver_is_refused_when_it_is_configured() {
    let mut host = Host::new(bare());
    assert!((as_delivered_m() - 4.392e-3).abs() < 1e-6);
    assert_refused(host.ask(Request::Configure(sine(4.4e-3, DriveMode::Constant))), "amplitude_m", 4.4e-3);
    assert_refused(host.ask(Request::Configure(sine(1e-3, closed(0.05)))), "drive.drive_limit_m", 0.05);
    host.done(Request::Configure(sine(4.39e-3, DriveMode::Constant)));
    host.done(Request::Configure(sine(1e-3, closed(as_delivered_m()))));
}

/// The rig checks by itself: not every program that uses the core has a controller before it.
#[test]
fn the_rig_refuses_a_drive_that_it_cannot_deliver() {
    let plan = SteppedSinePlan::new(sine(4.4e-3, DriveMode::Constant)).unwrap();
    let refused = Rig::new().handle(Command::Configure(Experiment::SteppedSine(plan)));
    assert_refused(refused.map(|()| Reply::Done), "amplitude_m", 4.4e-3);
}

/// Regression test: a 10 mm pulse became 5 mm on a board and stayed 10 mm on a virtual rig.
#[test]
fn a_record_that_the_drive_cannot_deliver_is_refused_as_soon_as_it_is_uploaded() {
    let (mut host, high, low) = (Host::new(bare()), pulse(6e-3), pulse(4e-3));
    upload(&mut host, &high);
    assert_refused(host.ask(playback(&high)), "record peak (m)", 6e-3);
    // The opposite order: configure first, then upload.
    upload(&mut host, &low);
    host.done(playback(&high));
    upload(&mut host, &high);
    assert_refused(host.ask(Request::Start), "record peak (m)", 6e-3);
    upload(&mut host, &low);
    host.done(playback(&low));
    host.done(Request::Start);
}

#[test]
fn a_calibration_set_after_the_experiment_was_configured_limits_its_drive() {
    let mut host = Host::new(bare());
    let strong = Calibration { drive: DriveScale::assumed(0.02), ..Calibration::default() };
    host.done(Request::SetSettings(Settings { calibration: strong, ..Settings::default() }));
    host.done(Request::Configure(sine(0.015, DriveMode::Constant)));
    host.done(Request::SetSettings(Settings::default()));
    assert_refused(host.ask(Request::Start), "amplitude_m", 0.015);
}

/// Reply of a virtual rig in this precision.
fn ask_of<S: PlantScalar>(ask: Request) -> Result<Reply, Rejected> {
    let mut board = SimulatedDevice::<S>::new(DeviceInfo::new("test", "none"));
    let mut out = [0; LONGEST];
    let request = ToDevice::Request(NumberedRequest { seq: 1, at_tick: None, request: ask });
    let length = frame::encode(&request, &mut out).unwrap();
    board.receive(&out[..length]);
    let (mut received, mut reader) = (vec![], Reader::default());
    while board.run(1, |bytes| received.extend_from_slice(bytes)) == Progress::Running {}
    let reply = received.into_iter().find_map(|byte| reader.push::<FromDevice>(byte));
    let Some(Ok(FromDevice::Reply { answer, .. })) = reply else { panic!("{reply:?}") };
    answer
}

#[test]
fn virtual_rigs_in_single_and_double_precision_refuse_the_same_drives() {
    let ask = || Request::Configure(sine(5e-3, DriveMode::Constant));
    assert_refused(ask_of::<f64>(ask()), "amplitude_m", 5e-3);
    assert_refused(ask_of::<f32>(ask()), "amplitude_m", 5e-3);
}

#[test]
fn a_closed_loop_that_needs_more_than_the_drive_delivers_is_clipped_and_reported() {
    // A source of velocity calibrated at half the frequency moves half as far.
    let mut host = Host::new(on_a_shaker(Shaker { calibrated_at_hz: 1.0, ..Shaker::default() }));
    host.done(Request::Configure(sine(3e-3, closed(as_delivered_m()))));
    host.done(Request::SetTelemetry { every_ticks: 1, signals: [2].into_iter().collect(), impacts: false });
    host.done(Request::Start);
    host.pass(10_000);
    let [point] = host.points()[..] else { panic!("{:?}", host.events) };
    let most = host.rows.iter().fold(0.0f32, |most, row| most.max(row[0].abs()));
    assert!(point.drive_saturated && point.z_amplitude_m < 3e-3, "{point:?}");
    assert_eq!(most, as_delivered_m());
}

/// A loop that asks for more than its own limit keeps a sine within it: the amplitude is limited, not the peaks cut off.
#[test]
fn a_closed_loop_at_its_drive_limit_keeps_to_it_and_stays_a_sine() {
    let mut host = Host::new(on_a_shaker(Shaker { calibrated_at_hz: 1.0, ..Shaker::default() }));
    let limit_m = 1e-3;
    let parameters = ClosedLoop { gain_per_s: 2.0, wait_s: 0.0, drive_limit_m: limit_m, ..ClosedLoop::default() };
    host.done(Request::Configure(sine(0.9e-3, DriveMode::ClosedLoop(parameters))));
    host.done(Request::SetTelemetry { every_ticks: 1, signals: [2].into_iter().collect(), impacts: false });
    host.done(Request::Start);
    host.pass(3_000);
    host.rows.clear();
    // Whole cycles of 2 Hz.
    host.pass(2_000);
    let drive_m: Vec<f32> = host.rows.iter().map(|row| row[0]).collect();
    let largest = drive_m.iter().fold(0.0f32, |largest, drive| largest.max(drive.abs()));
    let rms = (drive_m.iter().map(|drive| drive * drive).sum::<f32>() / drive_m.len() as f32).sqrt();
    println!("largest {largest}, rms {rms}");
    assert!(largest <= limit_m, "{largest} m");
    assert!(rms < 0.8 * limit_m, "{rms} m");
}

/// Samples within the drive's range with a curve between them that is not: the spline of 0, 1, 1, 0 reaches 9/8.
#[test]
fn a_record_that_is_cut_between_its_samples_says_so() {
    for (peak, cuts) in [(19_000i16, false), (21_000, true)] {
        let record: Vec<u8> = [0, 0, peak, peak, 0, 0].iter().flat_map(|sample: &i16| sample.to_le_bytes()).collect();
        let mut host = Host::new(bare());
        upload(&mut host, &record);
        let Request::ConfigurePlayback(configured) = playback(&record) else { panic!() };
        host.done(Request::ConfigurePlayback(Playback { sample_rate_hz: 10.0, ..configured }));
        host.done(Request::Start);
        host.pass(5_000);
        let result = host.events.iter().find_map(|event| if let Event::Transient(r) = event { Some(*r) } else { None });
        let result = result.unwrap_or_else(|| panic!("{:?}", host.events));
        assert_eq!(result.drive_saturated, cuts, "{peak} counts");
    }
}

#[test]
fn a_base_that_does_not_move_while_it_is_driven_ends_the_drive() {
    // The amplifier delivers no current.
    let mut host = Host::new(on_a_shaker(Shaker { current_limit_a: 1e-6, ..Shaker::default() }));
    host.done(Request::Configure(sine(1e-3, DriveMode::Constant)));
    host.done(Request::Start);
    host.pass(4_000);
    assert_eq!(host.fault(), Some(FaultCause::BaseStill));
}

#[test]
fn a_base_that_moves_ten_times_too_far_ends_the_drive() {
    // The calibration frequency is where the table is a mass.
    let mut host = Host::new(on_a_shaker(Shaker { calibrated_at_hz: 40.0, ..Shaker::default() }));
    host.done(Request::Configure(sine(2e-5, DriveMode::Constant)));
    host.done(Request::Start);
    host.pass(4_000);
    assert_eq!(host.fault(), Some(FaultCause::BaseOverdriven));
}
