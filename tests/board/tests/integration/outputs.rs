//! The board's outputs and inputs at their pins: drive and relay, and the walls' samples.

use damprig_board::{Board, Config, Output, Time};
use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::fault::FaultCause;
use damprig_core::control::stepped_sine::{DriveMode, SteppedSine};
use damprig_core::io::Sensor;
use damprig_protocol::Request;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{End, InjectedFault, PlantConfig, SensorFault};

use crate::common::{Host, bare, driving, image, pass, run, sine};

/// Drive code for zero voltage.
const MIDDLE: u16 = 2_048;

/// The changes of drive and relay since `since`.
fn drive_and_relay(board: &Board, since: Time) -> Vec<(Time, Output)> {
    let is_one = |output: &Output| matches!(output, Output::Drive(_) | Output::Relay(_));
    board.chip().trace().iter().filter(|(at, output)| *at >= since && is_one(output)).copied().collect()
}

fn output(board: &Board) -> Option<u16> {
    board
        .chip()
        .trace()
        .iter()
        .rev()
        .find_map(|(_, output)| if let Output::Drive(code) = output { *code } else { None })
}

#[test]
fn the_relay_opens_before_the_output_returns_to_zero_drive() {
    let Some(mut board) = driving(&Config::new(bare())) else { return };
    // The drive swings: wait until it is far from zero.
    while output(&board).unwrap().abs_diff(MIDDLE) < 300 {
        pass(&mut board, 1);
    }
    let pressed = board.now();
    board.chip_mut().inject(&InjectedFault::EmergencyStop { pressed: true });
    pass(&mut board, 100);
    let changes = drive_and_relay(&board, pressed);
    let opened = changes.iter().position(|(_, output)| *output == Output::Relay(false)).expect("the relay opens");
    let [(at, _), (zeroed, last)] = changes[opened..] else { panic!("{:?}", &changes[opened..]) };
    assert_eq!(last, Output::Drive(Some(MIDDLE)));
    assert!(zeroed - at < Time::from_us(100), "{} us", (zeroed - at).us());
}

/// A closed loop that starts with a wrong reading of z demands a drive in its first tick.
#[test]
fn the_relay_closes_onto_zero_drive_whatever_is_demanded() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(bare())).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    let closed = DriveMode::ClosedLoop(ClosedLoop::default());
    host.ask(Request::Configure(SteppedSine { drive: closed, ..sine(1e-3, 2.5) }));
    let noisy = InjectedFault::Sensor { sensor: Sensor::Z, fault: Some(SensorFault::Noisy(2e-3)) };
    host.board.chip_mut().inject(&noisy);
    let begun = host.board.now();
    host.send(Request::Start);
    host.pass(Time::from_ms(50));
    let changes = drive_and_relay(&board, begun);
    let closed = changes.iter().position(|(_, output)| *output == Output::Relay(true)).expect("the relay closes");
    assert_eq!(closed, 0, "the output stays at zero drive until the relay closes: {changes:?}");
    let (after, demanded) = changes[1];
    assert!(after - changes[0].0 >= Time::from_us(900), "{} us", (after - changes[0].0).us());
    let Output::Drive(Some(code)) = demanded else { panic!("{demanded:?}") };
    assert!(code.abs_diff(MIDDLE) > 20, "the loop demands a drive: {code}");
}

/// Samples of the walls that a tick uses are those of the millisecond before it.
#[test]
fn a_force_on_either_wall_acts_in_the_next_tick() {
    for (sensor, part_us) in
        [(Sensor::WallLow, 200), (Sensor::WallLow, 700), (Sensor::WallHigh, 200), (Sensor::WallHigh, 700)]
    {
        let plant = PlantConfig { walls: Some(WallSensors::default()), ..bare() };
        let Some(mut board) = driving(&Config::new(plant)) else { return };
        // The relay closes in tick 0.
        let closed = board.chip().trace().iter().find(|(_, output)| *output == Output::Relay(true)).unwrap().0;
        let ticks = ((board.now() - closed).us() / 1_000.0).floor() as u64 + 2;
        run(&mut board, closed + Time::from_us(1_000 * ticks + part_us));
        // A tenth of a tick.
        let force = |fault| InjectedFault::Sensor { sensor, fault };
        board.chip_mut().inject(&force(Some(SensorFault::AtRail(End::High))));
        let next = board.now() + Time::from_us(100);
        run(&mut board, next);
        board.chip_mut().inject(&force(None));
        pass(&mut board, 5);
        let latched = Host::new(&mut board).status().fault.expect("a force beyond the limit");
        let what = format!("{sensor:?}, {part_us} us after tick {ticks}");
        assert_eq!((latched.cause, u64::from(latched.tick)), (FaultCause::WallForce, ticks + 1), "{what}");
    }
}
