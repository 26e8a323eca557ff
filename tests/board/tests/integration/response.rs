//! The loops that keep the response and that follow its resonance, on the controller's own image: every cause that ends a drive ends it
//! too, to the same safe state, and no demand rises after a fault.

use damprig_board::{Board, Config, Output, Time};
use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::fault::FaultCause;
use damprig_core::control::phase_lock::PhaseLock;
use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
use damprig_core::control::safety::{ExperimentLimits, SafeStage};
use damprig_core::control::stepped_sine::{DriveMode, Points, SteppedSine};
use damprig_core::io::Sensor;
use damprig_core::rig::RigState;
use damprig_protocol::Request;
use damprig_simulator::plant::{Base, End, InjectedFault, PlantConfig, SensorFault, Shaker, Supply};

use crate::common::{Host, bare, image, is_driving, opened, pass, sine};

/// Drive code for zero voltage.
const MIDDLE: u16 = 2_048;

fn kept(amplitude_m: f32) -> ResponseLoop {
    ResponseLoop::new(KeptQuantity::Displacement { amplitude_m }, Some(ClosedLoop::default()))
}

fn experiment(parameters: ResponseLoop) -> SteppedSine {
    SteppedSine { drive: DriveMode::Response(parameters), ..sine(1e-3, 2.6) }
}

fn followed(lock: PhaseLock, drive: DriveMode, amplitude: f32) -> SteppedSine {
    let points = Points::Resonance { lock, amplitudes: [amplitude].into_iter().collect() };
    SteppedSine { drive, points, ..sine(1e-3, 2.6) }
}

/// The experiments of the loops: |x| is kept at 4 mm; its resonance is followed at that |x|; and at a base of 0.2 mm.
fn experiments() -> [(&'static str, SteppedSine); 3] {
    let lock = PhaseLock { start_hz: 2.6, ..PhaseLock::new(2.4, 2.7) };
    [
        ("x", experiment(kept(4e-3))),
        ("resonance at x", followed(lock, DriveMode::Response(kept(1.0)), 4e-3)),
        ("resonance at Z", followed(lock, DriveMode::ClosedLoop(ClosedLoop::default()), 2e-4)),
    ]
}

/// A board that has run it on a shaker for a second.
fn keeping(experiment: &SteppedSine, limits: ExperimentLimits) -> Option<Board> {
    let plant = PlantConfig { base: Base::Shaker(Shaker::default()), ..bare() };
    let mut board = Board::new(image()?, &Config::new(plant)).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    host.ask(Request::Configure(experiment.clone()));
    host.ask(Request::SetLimits(limits));
    host.ask(Request::Start);
    pass(&mut board, 1_000);
    assert!(is_driving(&board), "{:?}", board.chip().trace().last());
    Some(board)
}

/// Distances of the drive's codes from zero drive in the trace, in this time.
fn codes(board: &Board, from: Time, to: Time) -> Vec<u16> {
    let own = board.chip().trace().iter().filter(|(at, _)| (from..to).contains(at));
    own.filter_map(
        |(_, output)| if let Output::Drive(Some(code)) = output { Some(code.abs_diff(MIDDLE)) } else { None },
    )
    .collect()
}

/// The relay opens within `longest` after `since`, and the drive has not been larger than in the cycle before.
fn assert_safe(board: &mut Board, since: Time, longest: Time, why: &str) {
    pass(board, 400);
    assert!(!is_driving(board), "{why}: it drives");
    let opened = opened(board, since);
    assert!(opened <= longest, "{why}: the relay opens after {} ms", opened.us() / 1e3);
    let before = codes(board, since - Time::from_ms(400), since).into_iter().max().unwrap_or(0);
    let after = codes(board, since + Time::from_ms(20), board.now()).into_iter().max().unwrap_or(0);
    assert!(before > 20 && after <= before + 1, "{why}: a drive of {after} follows one of {before}");
}

#[test]
fn a_sensor_that_is_lost_in_the_middle_ends_the_drive_without_a_rise() {
    for (name, experiment) in experiments() {
        for (sensor, fault) in [
            (Sensor::X, SensorFault::Unplugged),
            (Sensor::X, SensorFault::AtRail(End::High)),
            (Sensor::Z, SensorFault::Unplugged),
            (Sensor::Z, SensorFault::AtRail(End::High)),
        ] {
            let Some(mut board) = keeping(&experiment, ExperimentLimits::default()) else { return };
            let broken = board.now();
            board.chip_mut().inject(&InjectedFault::Sensor { sensor, fault: Some(fault) });
            assert_safe(&mut board, broken, Time::from_ms(225), &format!("{name}: {sensor:?}, {fault:?}"));
            let status = Host::new(&mut board).status();
            let cause = status.fault.map(|fault| fault.cause);
            assert_eq!(cause, Some(FaultCause::SensorAtRail(sensor)), "{name}: {fault:?}");
        }
    }
}

#[test]
fn the_emergency_stop_and_a_falling_supply_open_the_relay_at_once() {
    for (name, experiment) in experiments() {
        let Some(mut board) = keeping(&experiment, ExperimentLimits::default()) else { return };
        let pressed = board.now();
        board.chip_mut().inject(&InjectedFault::EmergencyStop { pressed: true });
        assert_safe(&mut board, pressed, Time::from_ms(2), &format!("{name}: emergency stop"));
        let Some(mut board) = keeping(&experiment, ExperimentLimits::default()) else { return };
        let begun = board.now();
        board.chip_mut().set_supply(2.8);
        pass(&mut board, 400);
        assert!(!is_driving(&board) && opened(&board, begun) < Time::from_ms(2), "{name}");
    }
}

#[test]
fn a_host_that_is_gone_and_a_drive_at_its_limit_end_the_drive_after_their_time() {
    let limits = ExperimentLimits { host_silent_s: Some(5.0), ..ExperimentLimits::default() };
    for (name, experiment) in experiments() {
        let Some(mut board) = keeping(&experiment, limits) else { return };
        let mut host = Host::new(&mut board);
        for _ in 0..8 {
            host.pass(Time::from_ms(500));
            host.status();
        }
        // Until then the drive may rise with the response.
        pass(&mut board, 4_990);
        let nearly = board.now();
        assert_safe(&mut board, nearly, Time::from_ms(260), &format!("{name}: no host"));
    }
    let limits = ExperimentLimits { saturated_s: Some(2.0), ..ExperimentLimits::default() };
    // At 2.6 Hz an |x| of 60 mm needs Z = 5 mm.
    let base = ClosedLoop { drive_limit_m: 1e-3, ..ClosedLoop::default() };
    let short = ResponseLoop { drive_limit_m: 1e-3, base: Some(base), ..kept(0.06) };
    let Some(mut board) = keeping(&experiment(short), limits) else { return };
    let begun = board.now();
    pass(&mut board, 5_000);
    let mut host = Host::new(&mut board);
    let status = host.status();
    assert_eq!(status.fault.map(|fault| fault.cause), Some(FaultCause::DriveSaturated));
    assert!(!is_driving(&board) && opened(&board, begun) < Time::from_ms(4_000));
}

#[test]
fn an_amplifier_that_fails_ends_the_drive_as_a_base_that_stands_still() {
    let Some(mut board) = keeping(&experiment(kept(4e-3)), ExperimentLimits::default()) else { return };
    board.chip_mut().inject(&InjectedFault::Supply { supply: Supply::Amplifier, on: false });
    let off = board.now();
    let mut host = Host::new(&mut board);
    let mut fault = None;
    while fault.is_none() && host.board.now() - off < Time::from_ms(60_000) {
        host.pass(Time::from_ms(500));
        fault = host.status().fault;
    }
    pass(&mut board, 400);
    // x rings down and the demand grows meanwhile: until then the base stands still for a smaller demand.
    println!("amplifier off: the relay opens after {} ms", opened(&board, off).us() / 1e3);
    assert_eq!(fault.map(|fault| fault.cause), Some(FaultCause::BaseStill));
    assert!(!is_driving(&board));
}

#[test]
fn what_a_host_may_not_ask_of_the_loop_is_refused_by_name() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(bare())).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    let base = ClosedLoop { gain_per_s: f32::INFINITY, ..ClosedLoop::default() };
    let strong = ClosedLoop { drive_limit_m: 1.0, ..ClosedLoop::default() };
    let lock = PhaseLock::new(2.4, 2.7);
    let of = |lock, amplitude| followed(lock, DriveMode::Constant, amplitude);
    for (lie, name) in [
        (of(PhaseLock { gain_per_cycle: f32::NAN, ..lock }, 1e-3), "lock.gain_per_cycle"),
        (of(PhaseLock { phase_rad: 1e9, ..lock }, 1e-3), "lock.phase_rad"),
        (of(PhaseLock { high_hz: 1e9, ..lock }, 1e-3), "lock.high_hz"),
        (of(PhaseLock { start_hz: f32::INFINITY, ..lock }, 1e-3), "lock.start_hz"),
        (of(lock, f32::NAN), "amplitudes"),
        (of(lock, 1.0), "amplitude_m"),
    ] {
        let why = host.try_ask(Request::Configure(lie)).expect_err("refused");
        assert!(format!("{why:?}").contains(name), "{why:?}");
    }
    for (lie, name) in [
        (kept(f32::NAN), "drive.amplitude_m"),
        (ResponseLoop { gain_per_cycle: 1e9, ..kept(4e-3) }, "drive.gain_per_cycle"),
        (ResponseLoop { drive_limit_m: 1.0, ..kept(4e-3) }, "drive.drive_limit_m"),
        (ResponseLoop { base: Some(base), ..kept(4e-3) }, "drive.gain_per_s"),
        (ResponseLoop { base: Some(strong), ..kept(4e-3) }, "drive.base.drive_limit_m"),
    ] {
        let why = host.try_ask(Request::Configure(experiment(lie))).expect_err("refused");
        assert!(format!("{why:?}").contains(name), "{why:?}");
    }
    let status = host.status();
    assert_eq!((status.state, status.safe), (RigState::Idle, SafeStage::Clear));
}
