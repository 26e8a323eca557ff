//! The questions of `damprig init` on a terminal.

use std::io::{BufRead, stdin};

use clap::ValueEnum;

use super::NewFileRequest;
use super::values::{DamperArg, ExperimentArg};
use crate::cli::arguments::{not_negative, positive};
use crate::cli::output;
use crate::failure::Failure;
use crate::file_keys::new_file::CaseValues;

/// Asks what to write.
pub(super) fn ask() -> Result<NewFileRequest, Failure> {
    say!("Enter takes the default in brackets.");
    let is_case = answer("Campaign for the rig, or case to simulate", "campaign", |text| match text {
        "campaign" => Ok(false),
        "case" => Ok(true),
        _ => Err("write campaign or case".into()),
    })?;
    let dampers = if is_case {
        answer("Damper: bare, spid, fd, hybrid or tmd", "spid", one::<DamperArg>)?
    } else {
        answer("Dampers, of bare, spid, fd, hybrid, tmd", "bare,spid", several::<DamperArg>)?
    };
    let experiments = if is_case {
        answer("Excitation: stepped-sine, free-vibration, impulse or noise", "stepped-sine", one::<ExperimentArg>)?
    } else {
        answer(
            "Experiments, of stepped-sine, free-vibration, impulse, noise",
            "stepped-sine",
            several::<ExperimentArg>,
        )?
    };
    let default = CaseValues::default();
    let number = |question: &str, default: f64, parse: fn(&str) -> Result<f64, String>| {
        answer(question, &default.to_string(), parse)
    };
    let values = CaseValues {
        mass_kg: number("Mass of the structure, kg", default.mass_kg, positive)?,
        natural_frequency_hz: number("Natural frequency, Hz", default.natural_frequency_hz, positive)?,
        damping_ratio: number("Damping ratio", default.damping_ratio, not_negative)?,
        base_amplitude_m: number("Base amplitude Z, m", default.base_amplitude_m, positive)?,
        ..default
    };
    Ok(NewFileRequest { is_case, dampers, experiments, has_record: false, values })
}

/// Asks until the answer can be read.
fn answer<T>(question: &str, default: &str, read: impl Fn(&str) -> Result<T, String>) -> Result<T, Failure> {
    loop {
        output::prompt(&format!("{question} [{default}]: "));
        let mut line = String::new();
        let length = stdin().lock().read_line(&mut line).map_err(Failure::failed)?;
        if length == 0 {
            return Err(Failure::Input("the answers ended; nothing was written".into()));
        }
        let text = if line.trim().is_empty() { default } else { line.trim() };
        match read(text) {
            Ok(value) => return Ok(value),
            Err(why) => say!("{text:?}: {why}"),
        }
    }
}

fn one<T: ValueEnum>(text: &str) -> Result<Vec<T>, String> {
    T::from_str(text, true).map(|value| vec![value]).map_err(|_| "is none of these".into())
}

fn several<T: ValueEnum + PartialEq>(text: &str) -> Result<Vec<T>, String> {
    let values: Vec<T> =
        text.split(',').map(|word| one(word.trim())).collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
    let is_twice = values.iter().enumerate().any(|(n, value)| values[..n].contains(value));
    if is_twice { Err("names one twice".into()) } else { Ok(values) }
}
