//! Seed inputs of the fuzz targets: every message of the protocol, and complete experiments as a host runs them.
//!
//! [`device`] and [`host`] generate them from the message types, so they follow the protocol automatically.
//! `fuzz/seeds` contains these seeds and the minimised inputs that the fuzzer has added;
//! `cargo run -p damprig-fuzzing --example make_seeds` rewrites the generated ones.

use std::path::{Path, PathBuf};

use damprig_core::control::friction_spring::{SpringCommand, SpringSetUp, Target};
use damprig_core::control::safety::ExperimentLimits;
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::{Cavity, FrictionDamper, Particle, SetUp, Structure, Wall};
use damprig_core::twin::TwinConfig;
use damprig_protocol::frame::LONGEST_BODY;
use damprig_protocol::{FromDevice, NumberedRequest, Request, ToDevice};
use damprig_simulator::messages::set_plant;
use damprig_simulator::plant::spring::SpringPlant;
use damprig_simulator::plant::walls::WallSensors;
use damprig_simulator::plant::{Base, PlantConfig, Shaker};

use crate::messages::every_choice;
use crate::{Piece, join, said};

/// Name and bytes of an input.
pub type Seed = (String, Vec<u8>);

/// Inputs of [`crate::device`].
#[must_use]
pub fn device() -> Vec<Seed> {
    let bodies = every_choice::<ToDevice>();
    // Several messages in sequence: for a single one the board has no plant.
    let together = bodies.chunks(4).enumerate().map(|(n, some)| {
        let pieces: Vec<Piece> = some.iter().cloned().map(Piece::Body).collect();
        (format!("messages-{n:02}"), join(&pieces))
    });
    together.chain(experiments().into_iter().map(|(name, pieces)| (name.to_string(), join(&pieces)))).collect()
}

/// Inputs of [`crate::host`]: every message, and a frame of each length that a board sends in an experiment.
#[must_use]
pub fn host() -> Vec<Seed> {
    let bodies = every_choice::<FromDevice>().into_iter().enumerate();
    let mut seeds: Vec<Seed> = bodies.map(|(n, body)| (format!("message-{n:02}"), body)).collect();
    for (name, pieces) in experiments() {
        let mut lengths = std::collections::BTreeSet::new();
        let mut frames = Vec::new();
        for frame in said(&pieces).split_inclusive(|byte| *byte == 0) {
            if lengths.insert(frame.len()) {
                frames.extend_from_slice(frame);
            }
        }
        seeds.push((name.to_string(), frames));
    }
    seeds
}

/// Complete experiments as a host runs them.
#[must_use]
pub fn experiments() -> Vec<(&'static str, Vec<Piece>)> {
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let particle = Particle {
        mass_kg: 0.16,
        clearance_m: 0.002,
        friction_coefficient: 0.05,
        wall: Wall::Restitution { coefficient: 0.5 },
        cavity: Cavity::default(),
    };
    let bare = SetUp::bare(structure);
    let spid = SetUp { particle: Some(particle), ..bare };
    let hybrid = SetUp { friction_damper: Some(FrictionDamper { force_n: 0.1 }), ..spid };
    let walls = Some(WallSensors::default());
    let shaken = Base::Shaker(Shaker::default());
    vec![
        ("bare", experiment(PlantConfig::ideal(bare), None, &[])),
        ("particle", experiment(PlantConfig { walls, ..PlantConfig::ideal(spid) }, Some(spid), &[Request::ArmSnippet])),
        (
            "hybrid-on-a-shaker",
            experiment(PlantConfig { walls, base: shaken, ..PlantConfig::ideal(hybrid) }, None, &[]),
        ),
        (
            "tuned-spring",
            experiment(
                PlantConfig { spring: Some(SpringPlant::default()), ..PlantConfig::ideal(bare) },
                None,
                &[
                    Request::SetSpring(SpringSetUp {
                        stiffness_n_per_m: None,
                        friction_coefficient: Some(0.25),
                        structure_stiffness_n_per_m: 394.78,
                    }),
                    Request::Spring(SpringCommand::Home),
                    Request::Spring(SpringCommand::TouchOff),
                    Request::Spring(SpringCommand::Set(Target::FrictionRatio { ratio: 0.5 })),
                ],
            ),
        ),
    ]
}

fn experiment(plant: PlantConfig, twin: Option<SetUp>, more: &[Request]) -> Vec<Piece> {
    let sine = SteppedSine {
        start: Start::FromRest { level_m: 5e-4 },
        amplitude_m: 1.5e-3,
        drive: DriveMode::Constant,
        ramp_s: 0.0,
        settle_s: 0.05,
        dwell_s: 0.7,
        steady: SteadyLimits::default(),
        first_index: 0,
        points: [9.0, 10.0].into_iter().collect(),
    };
    let telemetry = Request::SetTelemetry { every_ticks: 3, signals: Default::default(), impacts: true };
    let mut asks = vec![Request::Identify, Request::Describe, Request::Signals { from: 0 }, set_plant(plant)];
    let limits = ExperimentLimits { wall_force_n: Some(300.0), ..ExperimentLimits::default() };
    asks.extend([Request::SetTwin(twin.map(TwinConfig::new)), Request::Configure(sine), Request::SetLimits(limits)]);
    asks.extend_from_slice(more);
    asks.extend([Request::Start, telemetry]);
    let grants = (1..10).map(|n| ToDevice::Grant { until_tick: 400 * n });
    let after = [
        Request::Status,
        Request::Result { index: 0 },
        Request::Snippet { from: 0 },
        Request::Stop,
        Request::ClearFault,
    ];
    let mut seq = 0;
    let mut request = |ask| {
        seq += 1;
        ToDevice::Request(NumberedRequest { seq, at_tick: None, request: ask })
    };
    let before: Vec<ToDevice> = asks.into_iter().map(&mut request).collect();
    let after: Vec<ToDevice> = after.into_iter().map(request).collect();
    before.into_iter().chain(grants).chain(after).map(|message| Piece::Body(body(&message))).collect()
}

fn body(message: &ToDevice) -> Vec<u8> {
    postcard::to_slice(message, &mut [0; LONGEST_BODY]).expect("it fits a frame").to_vec()
}

/// The seeds in the repository for a target, `device` or `host`.
///
/// # Errors
/// They cannot be read.
pub fn kept(target: &str) -> std::io::Result<Vec<Seed>> {
    let mut seeds = Vec::new();
    for entry in std::fs::read_dir(folder().join(target))? {
        let entry = entry?;
        seeds.push((entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path())?));
    }
    seeds.sort();
    Ok(seeds)
}

/// Directory of the seeds; it has a subdirectory for each target.
#[must_use]
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds")
}

#[cfg(test)]
mod tests {
    use super::*;
    use damprig_protocol::frame::Reader;
    use damprig_protocol::{Event, FromDevice};

    #[test]
    fn each_seed_experiment_is_carried_out_completely() {
        for (name, pieces) in experiments() {
            let mut reader = Reader::default();
            let stream = said(&pieces);
            let messages: Vec<FromDevice> = stream.iter().filter_map(|&b| reader.push(b)).map(Result::unwrap).collect();
            let has = |is: fn(&FromDevice) -> bool| messages.iter().any(is);
            assert!(has(|m| matches!(m, FromDevice::Telemetry(_))), "{name}: {messages:?}");
            let is_tuned = name == "tuned-spring";
            let ended = if is_tuned {
                has(|m| matches!(m, FromDevice::Event { event: Event::Spring(_), .. }))
            } else {
                has(|m| matches!(m, FromDevice::Event { event: Event::Point(_), .. }))
            };
            assert!(ended, "{name}: {messages:?}");
        }
    }
}
