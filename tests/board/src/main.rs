//! Command-line program that serves the emulated board: `damprig … --rig tcp:127.0.0.1:PORT` connects to it.

use std::net::TcpListener;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Parser;
use damprig_board::{Board, Config, Image, Time, link};
use damprig_core::model::{Cavity, Particle, SetUp, Structure, Wall};
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Base, PlantConfig, Shaker};

/// Runs the controller's image on an emulated NUCLEO-G474RE, its pins wired to a simulated rig: a structure with an impact
/// damper and a friction damper on a shaker.
#[derive(Parser)]
struct Arguments {
    /// The image: firmware/target/images/nucleo-g474re.elf.
    image: PathBuf,
    /// The TCP port that is the board's serial line.
    #[arg(long, default_value_t = 4000)]
    port: u16,
    /// Device seconds a second, at most.
    #[arg(long, default_value_t = 1.0)]
    pace: f64,
    /// Particle mass over structure mass; 0 for no particle.
    #[arg(long, default_value_t = 0.1)]
    mass_ratio: f64,
    /// Half of the particle's travel in its cavity, m.
    #[arg(long, default_value_t = 0.0225)]
    clearance_m: f64,
    /// Coefficient of restitution of the cavity's walls.
    #[arg(long, default_value_t = 0.47)]
    restitution: f64,
    /// No friction damper is mounted.
    #[arg(long)]
    no_friction_damper: bool,
    /// Stop after so many device seconds, and print what the image has cost: instructions, by exception and by function.
    #[arg(long, value_name = "SECONDS")]
    measure: Option<f64>,
    /// The crystal does not start.
    #[arg(long)]
    no_crystal: bool,
}

impl Arguments {
    fn plant(&self) -> PlantConfig {
        let structure = Structure::from_modal(1.6, 2.5, 0.0038);
        let particle = (self.mass_ratio > 0.0).then_some(Particle {
            mass_kg: self.mass_ratio * structure.mass_kg,
            clearance_m: self.clearance_m,
            friction_coefficient: 0.08,
            wall: Wall::Restitution { coefficient: self.restitution },
            cavity: Cavity::default(),
        });
        let set_up = SetUp { particle, ..SetUp::bare(structure) };
        PlantConfig {
            base: Base::Shaker(Shaker::default()),
            walls: particle.map(|_| WallSensors::default()),
            spring: (!self.no_friction_damper).then(SpringPlant::default),
            ..PlantConfig::ideal(set_up)
        }
    }

    fn run(&self) -> Result<(), Box<dyn std::error::Error>> {
        let config = Config { has_crystal: !self.no_crystal, ..Config::new(self.plant()) };
        let mut board = Board::new(Image::read(&self.image)?, &config)?;
        let listener = TcpListener::bind(("127.0.0.1", self.port))?;
        println!("the board is at tcp:{}", listener.local_addr()?);
        let stop = AtomicBool::new(false);
        let end = self.measure.map_or(Time::NEVER, Time::from_s);
        if self.measure.is_some() {
            board.start_profile();
        }
        let begun = Instant::now();
        link::serve(&mut board, &listener, self.pace, &stop, |board| {
            if board.now() >= end {
                stop.store(true, Ordering::Relaxed);
            }
        })?;
        report(&board, begun.elapsed());
        Ok(())
    }
}

/// Number of functions in the report.
const MAX_FUNCTIONS: usize = 40;

fn report(board: &Board, took: Duration) {
    let (device_s, instructions) = (board.now().s(), board.instructions());
    println!("{device_s:.3} s of device time in {:.3} s, {instructions} instructions", took.as_secs_f64());
    println!("exception    count    mean    most (instructions, without those that interrupt it)");
    for (exception, cost) in board.costs() {
        let name = match exception.checked_sub(16) {
            Some(interrupt) => format!("IRQ {interrupt}"),
            None => format!("{exception}"),
        };
        println!("{name:9} {:8} {:7.0} {:7}", cost.count, cost.mean(), cost.most);
    }
    println!("instructions   share  function");
    for (name, count) in board.profile().into_iter().take(MAX_FUNCTIONS) {
        println!("{count:12} {:6.2}%  {name}", 100.0 * count as f64 / instructions as f64);
    }
    for (time, deviation) in board.chip().deviations() {
        println!("{:.6} s: {deviation}", time.s());
    }
}

fn main() -> ExitCode {
    match Arguments::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
