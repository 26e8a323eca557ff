//! Timing tests on the board: age of the samples, delay of the drive, pulses of the motor, bytes of the UART.

use damprig_board::{Board, Config, Output, Time};
use damprig_core::control::fault::FaultCause;
use damprig_core::control::friction_spring::{SpringCommand, SpringStage};
use damprig_core::model::Structure;
use damprig_protocol::{FromDevice, Reply, Request};
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::{Base, InjectedFault, PlantConfig};

use crate::common::{Host, bare, driving, image, pass, run, run_into_tick, sine};

/// A base that follows the drive exactly, regardless of the structure, and a structure whose motion decays fast.
fn prescribed() -> PlantConfig {
    let mut plant = PlantConfig { base: Base::Prescribed, ..bare() };
    plant.set_up.structure = Structure::from_modal(1.6, 2.5, 0.3);
    plant
}

const AMPLITUDE_M: f32 = 4e-3;
const FREQUENCY_HZ: f32 = 5.0;

fn start(host: &mut Host) {
    host.ask(Request::Configure(sine(AMPLITUDE_M, FREQUENCY_HZ)));
    // The base displacement only.
    host.ask(Request::SetTelemetry { every_ticks: 1, signals: [1].into_iter().collect(), impacts: false });
    host.received.clear();
    host.ask(Request::Start);
}

/// z of each tick since the start, up to the first missing tick.
fn base_motion(host: &Host) -> Vec<f32> {
    let mut z_m = Vec::new();
    for message in host.messages() {
        if let FromDevice::Telemetry(batch) = message
            && batch.first_tick as usize == z_m.len()
        {
            z_m.extend(batch.values.iter().copied());
        }
    }
    z_m
}

/// The same drive gives the same base motion, so a late sample appears as a different value: a delay of 1.9 ms,
/// slightly less than two ticks, changes it by 0.24 mm.
#[test]
fn after_a_stall_samples_are_as_fresh_as_before_it() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(prescribed())).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    start(&mut host);
    host.pass(Time::from_ms(300));
    let before = base_motion(&host);
    assert!(before.len() > 250, "{}", before.len());
    // Half a block, a block and a half, and more than both halves of the buffer. The first loses no block, the last two do; the
    // second does if it holds two ends of a block, which depends on where in a tick it begins.
    for stall_us in [400, 1_600, 4_700, 17_300] {
        host.board.halt(Time::from_us(stall_us));
        host.pass(Time::from_ms(3_000));
        let Reply::Status { status, counters } = host.ask(Request::Status) else { panic!("no status") };
        let is_lost = status.fault.is_some();
        assert!(if is_lost { stall_us > 1_000 } else { stall_us < 2_000 }, "{stall_us} us: {:?}", status.fault);
        if is_lost {
            assert!(counters.timing.overruns > 0);
            host.ask(Request::ClearFault);
        } else {
            host.ask(Request::Stop);
            host.pass(Time::from_ms(3_000));
        }
        start(&mut host);
        host.pass(Time::from_ms(300));
        let after = base_motion(&host);
        assert!(after.len() > 250, "{}", after.len());
        let largest = before.iter().zip(&after).map(|(b, a)| (b - a).abs()).fold(0.0, f32::max);
        // 100 µs at the highest speed, the 50 µs of the grid on which the emulated rig takes the output, the converter's step.
        let allowed = AMPLITUDE_M * 2.0 * std::f32::consts::PI * FREQUENCY_HZ * 150e-6 + 3e-6;
        assert!(largest < allowed, "{largest} m after {stall_us} us");
    }
}

/// A block of samples is the mean over 1 ms, and the output holds its value for 1 ms: z lags its drive by at least 1
/// ms. The additional lag is the age of the newest sample at the start of the tick plus the time from there to the
/// output.
#[test]
fn the_delay_from_the_newest_sample_of_a_tick_to_its_output_is_at_most_150_us() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(prescribed())).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    start(&mut host);
    host.pass(Time::from_ms(500));
    let z_m = base_motion(&host);
    let turning = 2.0 * std::f64::consts::PI * f64::from(FREQUENCY_HZ);
    let (mut sine, mut cosine) = (0.0, 0.0);
    // One whole cycle.
    for (tick, z) in z_m.iter().enumerate().skip(200).take(200) {
        let phase = turning * tick as f64 * 1e-3;
        sine += f64::from(*z) * phase.sin();
        cosine += f64::from(*z) * phase.cos();
    }
    let late_s = -f64::atan2(cosine, sine) / turning - 1e-3;
    assert!(late_s > 0.0 && late_s < 150e-6, "{late_s} s");
}

/// A rig with a friction damper, its seat 3 mm from the limit switch.
fn with_spring() -> PlantConfig {
    PlantConfig { spring: Some(SpringPlant { start_m: 3e-3, ..SpringPlant::default() }), ..bare() }
}

/// Pulses of the step output since `since`: time of the rising edge and width.
fn pulses(board: &Board, since: Time) -> Vec<(Time, Time)> {
    let edges = board.chip().trace().iter().filter_map(|(at, output)| match output {
        Output::Step(level) if *at >= since => Some((*at, *level)),
        _ => None,
    });
    let edges: Vec<_> = edges.collect();
    assert!(edges.chunks(2).all(|pair| pair[0].1 && pair.get(1).is_none_or(|fall| !fall.1)), "{:?}", &edges[..4]);
    edges.chunks_exact(2).map(|pair| (pair[0].0, pair[1].0 - pair[0].0)).collect()
}

fn homing(board: &mut Board) -> Time {
    let mut host = Host::new(board);
    host.ask(Request::Identify);
    let begun = host.board.now();
    host.ask(Request::Spring(SpringCommand::Home));
    begun
}

#[test]
fn the_step_output_is_low_until_the_first_step_and_every_pulse_is_complete_within_its_tick() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(with_spring())).unwrap();
    let steps_before = board.chip().plant().seat_steps().unwrap();
    let begun = homing(&mut board);
    run(&mut board, begun + Time::from_ms(8_000));
    let trace = board.chip().trace();
    let on = trace.iter().find(|(_, output)| *output == Output::MotorOff(false)).expect("the motor comes on").0;
    // After the reset the pin is NJTRST with its pull-up: it makes one falling edge, while the motor is off.
    let early: Vec<_> = trace.iter().filter(|(at, output)| *at < on && matches!(output, Output::Step(_))).collect();
    assert!(matches!(early[..], [(_, Output::Step(false))]), "{early:?}");

    let pulses = pulses(&board, on);
    assert!(pulses.len() > 100, "{}", pulses.len());
    // Stepper drivers require 1 µs to 2.5 µs.
    assert!(pulses.iter().all(|(_, width)| *width >= Time::from_us(4) && *width <= Time::from_us(6)));
    let mut direction_since = None;
    for (at, output) in trace {
        match output {
            Output::Direction(_) => direction_since = Some(*at),
            Output::Step(true) if *at >= on => {
                let settled = direction_since.is_none_or(|since| *at - since >= Time::from_us(20));
                assert!(settled, "a pulse {} s after power-on comes too soon after the change of direction", at.s());
            }
            _ => {}
        }
    }

    // Every pulse moved the seat, and the controller counts the steps that the seat made.
    let mut towards = false;
    let mut moved = 0;
    for (at, output) in trace {
        match output {
            Output::Direction(level) => towards = *level,
            Output::Step(true) if *at >= on => moved += if towards { 1 } else { -1 },
            _ => {}
        }
    }
    let steps = board.chip().plant().seat_steps().unwrap();
    assert_eq!(steps - steps_before, moved);
    let Reply::Status { status, .. } = Host::new(&mut board).ask(Request::Status) else { panic!("no status") };
    assert_eq!(status.spring.stage, SpringStage::Homed);
    let step_m = SpringPlant::default().step_m;
    // The controller counts from the switch's edge.
    assert!((status.spring.position_m - steps as f32 * step_m).abs() <= 1.5 * step_m, "{status:?} {steps}");
}

#[test]
fn the_emergency_stop_ends_the_steps_and_switches_the_motor_off() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(with_spring())).unwrap();
    let begun = homing(&mut board);
    run(&mut board, begun + Time::from_ms(500));
    assert!(pulses(&board, begun + Time::from_ms(450)).len() > 10, "the motor runs");
    let pressed = board.now();
    board.chip_mut().inject(&InjectedFault::EmergencyStop { pressed: true });
    run(&mut board, pressed + Time::from_ms(2_000));
    let off = board.chip().trace().iter().find(|(at, output)| *at >= pressed && *output == Output::MotorOff(true));
    let off = off.expect("the motor goes off").0;
    assert!(off - pressed < Time::from_ms(2), "{} us", (off - pressed).us());
    let after = board.chip().trace().iter().filter(|(at, output)| *at > off && *output == Output::Step(true));
    assert_eq!(after.count(), 0);
}

/// Contact 1 is in the supply of the motor: a shorted cable of contact 2 hides the stop from the controller only.
#[test]
fn contact_1_alone_stops_the_motor_when_the_line_of_contact_2_is_shorted() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(with_spring())).unwrap();
    board.chip_mut().short_stop_line();
    let begun = homing(&mut board);
    run(&mut board, begun + Time::from_ms(500));
    let seat = board.chip().plant().seat_steps();
    let pressed = board.now();
    board.chip_mut().inject(&InjectedFault::EmergencyStop { pressed: true });
    run(&mut board, pressed + Time::from_ms(500));
    assert!(pulses(&board, pressed).len() > 10, "the controller does not know");
    assert_eq!(board.chip().plant().seat_steps(), seat);
}

#[test]
fn contact_1_alone_opens_the_relay_when_the_line_of_contact_2_is_shorted() {
    // Without the drive this base stands, whatever the structure does.
    let Some(mut board) = driving(&Config::new(prescribed())) else { return };
    board.chip_mut().short_stop_line();
    // The largest |z| of a period of the drive, 0.4 s.
    let largest_m = |board: &mut Board| {
        (0..400).fold(0.0, |most: f64, _| {
            run(board, board.now() + Time::from_ms(1));
            most.max(board.chip().plant().truth(board.now()).z_m.abs())
        })
    };
    pass(&mut board, 2_000);
    let driven_m = largest_m(&mut board);
    assert!(driven_m > 0.9e-3, "{driven_m} m");
    board.chip_mut().inject(&InjectedFault::EmergencyStop { pressed: true });
    pass(&mut board, 1_000);
    let left_m = largest_m(&mut board);
    assert_eq!(left_m, 0.0);
    let status = Host::new(&mut board).status();
    assert_eq!(status.fault.map(|fault| fault.cause), Some(FaultCause::BaseStill));
}

/// The pulses of a tick that starts late reach into the next. Every second or third tick of the search makes a step.
#[test]
fn the_emergency_stop_ends_the_pulses_of_a_late_tick() {
    for ticks in 0..4 {
        let Some(image) = image() else { return };
        let mut board = Board::new(image, &Config::new(with_spring())).unwrap();
        let begun = homing(&mut board);
        run(&mut board, begun + Time::from_ms(500 + ticks));
        run_into_tick(&mut board);
        let started = board.now();
        run(&mut board, started + Time::from_us(500));
        // The next tick comes 0.8 ms late and is over when the stop is pressed.
        board.halt(Time::from_us(1_300));
        run(&mut board, started + Time::from_us(1_950));
        board.chip_mut().inject(&InjectedFault::EmergencyStop { pressed: true });
        run(&mut board, started + Time::from_ms(10));
        let trace = board.chip().trace();
        let off = trace.iter().find(|(at, output)| *at >= started && *output == Output::MotorOff(true));
        let off = off.expect("the motor goes off").0;
        assert!(off - started < Time::from_us(2_200), "{} us", (off - started).us());
        let after = trace.iter().filter(|(at, output)| *at > off && *output == Output::Step(true));
        assert_eq!(after.count(), 0, "{ticks}");
    }
}

/// The UART's FIFO holds 87 µs of bytes; DMA empties it, even while a tick delays the line's task.
#[test]
fn no_byte_is_lost_while_the_core_is_busy_for_1_ms() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(bare())).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    let settings = match host.ask(Request::Settings) {
        Reply::Settings { settings, .. } => settings,
        other => panic!("{other:?}"),
    };
    for _ in 0..20 {
        // The longest request: about 300 bytes, 3 ms on the line.
        let sent = host.send(Request::SetSettings(settings));
        for _ in 0..3 {
            host.pass(Time::from_us(100));
            host.board.halt(Time::from_us(900));
        }
        assert_eq!(host.reply_to(sent), Reply::Done);
    }
    let Reply::Status { counters, .. } = host.ask(Request::Status) else { panic!("no status") };
    assert_eq!((counters.bad_frames, host.board.chip().bytes_lost()), (0, 0));
}
