//! Instructions per tick and depth of the stack of the controller's own image, against firmware/budgets.toml.

use damprig_board::{Board, Config, Time};
use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::friction_spring::{SpringCommand, SpringSetUp, SpringStage, Target};
use damprig_core::control::phase_lock::PhaseLock;
use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
use damprig_core::control::stepped_sine::{DriveMode, Points, SteppedSine};
use damprig_core::model::{Cavity, Particle, SetUp, Structure, Wall};
use damprig_core::twin::TwinConfig;
use damprig_protocol::Request;
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Base, PlantConfig, Shaker};

use crate::common::{Host, TICK, driving, image, is_driving, pass, project, sine};

/// The function names of the profile that are printed.
const MAX_FUNCTIONS: usize = 20;

fn budget(what: &str) -> u64 {
    let text = std::fs::read_to_string(project().join("firmware/budgets.toml")).unwrap();
    let budgets: toml::Table = text.parse().unwrap();
    let value = budgets["nucleo-g474re"][what].as_integer();
    value.and_then(|value| u64::try_from(value).ok()).unwrap_or_else(|| panic!("no budget {what}"))
}

fn check(what: &str, measured: u64) {
    let most = budget(what);
    println!("nucleo-g474re: {what} {measured} of {most}");
    assert!(measured > 0 && measured <= most, "{what} is {measured}, the budget is {most} (firmware/budgets.toml)");
}

/// Processor time of this thread, s; other programs do not add to it.
fn processor_s() -> Option<f64> {
    let times = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(times.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
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

/// An impact damper and a friction damper on a shaker, with every sensor; the friction damper's ways are short.
fn with_everything() -> PlantConfig {
    let spring = SpringPlant { start_m: 5e-4, touch_m: 3e-3, ..SpringPlant::default() };
    PlantConfig {
        base: Base::Shaker(Shaker::default()),
        walls: Some(WallSensors::default()),
        spring: Some(spring),
        ..PlantConfig::ideal(set_up())
    }
}

/// Requests of a host while an experiment runs; some are refused.
fn asked(turn: u32) -> Request {
    match turn % 11 {
        0 => Request::Signals { from: 0 },
        1 => Request::Describe,
        2 => Request::ArmSnippet,
        3 => Request::Settings,
        4 => Request::SetTelemetry { every_ticks: 1, signals: (0..16).collect(), impacts: true },
        5 => Request::Snippet { from: 0 },
        6 => Request::Result { index: 0 },
        7 => Request::SetTwin(None),
        8 => Request::Spring(SpringCommand::TouchOff),
        9 => Request::StoredSettings { page: 1, from: 128 },
        _ => Request::Status,
    }
}

#[test]
fn a_tick_and_the_memory_keep_their_budgets_with_everything_switched_on() {
    let Some(image) = image() else { return };
    let mut board = Board::new(image, &Config::new(with_everything())).unwrap();
    let mut host = Host::new(&mut board);
    host.ask(Request::Identify);
    host.board.forget_costs();
    host.pass(Time::from_ms(500));
    let idle = host.board.costs()[&TICK];

    host.ask(Request::SetSpring(SpringSetUp {
        stiffness_n_per_m: None,
        friction_coefficient: Some(0.3),
        structure_stiffness_n_per_m: set_up().structure.stiffness_n_per_m as f32,
    }));
    host.ask(Request::SetTwin(Some(TwinConfig::new(set_up()))));
    host.ask(Request::SetTelemetry { every_ticks: 1, signals: (0..16).collect(), impacts: true });
    // All loops at once: that of the phase, that of the response, and that of the base below it.
    let lock = PhaseLock { wait_s: 0.0, ..PhaseLock::new(2.4, 2.6) };
    let points = Points::Resonance { lock, amplitudes: [0.02].into_iter().collect() };
    let base = ClosedLoop { tolerance: 0.5, wait_s: 0.0, ..ClosedLoop::default() };
    let response = ResponseLoop::new(KeptQuantity::Displacement { amplitude_m: 0.02 }, Some(base));
    let drive = DriveMode::Response(ResponseLoop { tolerance: 0.5, wait_s: 0.0, ..response });
    host.ask(Request::Configure(SteppedSine { drive, points, settle_s: 1.0, dwell_s: 3.0, ..sine(2e-3, 2.5) }));
    host.board.forget_costs();
    for command in [SpringCommand::Home, SpringCommand::TouchOff, SpringCommand::Set(Target::Force { force_n: 0.5 })] {
        host.ask(Request::Spring(command));
        let begun = host.board.now();
        while !matches!(host.status().spring.stage, SpringStage::Homed | SpringStage::Ready | SpringStage::Holding) {
            host.pass(Time::from_ms(100));
            assert!(host.board.now() - begun < Time::from_ms(20_000), "{command:?}: {:?}", host.status().spring);
        }
    }
    assert_eq!(host.status().spring.stage, SpringStage::Holding);
    let spring_moves = host.board.costs()[&TICK];
    host.ask(Request::Spring(SpringCommand::Set(Target::FrictionRatio { ratio: 0.2 })));
    host.ask(Request::ArmSnippet);
    host.ask(Request::Start);
    host.board.forget_costs();
    host.board.start_profile();
    let before = host.board.instructions();
    for turn in 0..1_100 {
        host.send(asked(turn));
        host.pass(Time::from_ms(4));
        assert!(turn != 300 || is_driving(host.board), "{:?}", host.status());
    }
    assert!(host.board.chip().plant().impacts() > 4, "{} impacts", host.board.chip().plant().impacts());
    let instructions = host.board.instructions() - before;
    let running = host.board.costs()[&TICK];
    println!("an idle tick: {:.0} instructions, at most {}", idle.mean(), idle.most);
    println!("a tick of an experiment: {:.0} instructions, at most {}", running.mean(), running.most);
    println!("while the spring moves: {:.0} instructions, at most {}", spring_moves.mean(), spring_moves.most);
    for (name, count) in host.board.profile().into_iter().take(MAX_FUNCTIONS) {
        println!("{:5.1} %  {name}", 100.0 * count as f64 / instructions as f64);
    }
    check("instructions_per_tick_worst", running.most.max(spring_moves.most));
    check("instructions_per_idle_tick_worst", idle.most);
    let (still, stack) = (u64::from(host.board.static_memory()), u64::from(host.board.stack_used()));
    println!("static RAM {still}, deepest stack with interrupts {stack}");
    check("ram_bytes", still + stack);
}

/// Not a test of time: it only prints how fast the emulation is.
#[test]
fn the_speed_of_the_emulation_with_its_plant_is_printed() {
    let Some(mut board) = driving(&Config::new(with_everything())) else { return };
    let (device_s, begun) = (board.now().s(), processor_s());
    pass(&mut board, 5_000);
    let device_s = board.now().s() - device_s;
    assert!(is_driving(&board));
    if let (Some(begun), Some(ended)) = (begun, processor_s()) {
        println!("{device_s:.1} s of device time with the plant in {:.1} s of processor time", ended - begun);
    }
}
