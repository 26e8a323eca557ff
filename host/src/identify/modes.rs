//! Modes and shapes from the frequency responses of a file, or of several: [`damprig_identification::modes`].

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Value;
use super::modal::Wish;
use super::modal::read::ModalSource;
use super::time_response::RESOLVED_LINES;
use crate::failure::Failure;

pub use damprig_identification::modes::*;

/// A place and the frequency response of its motion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlaceFile {
    /// Its name.
    pub name: String,
    /// The file, and which of its signals.
    pub file: PathBuf,
    /// Whether its motion counts against the direction that is wanted.
    pub is_reversed: bool,
}

/// What is asked for.
#[derive(Clone, Debug)]
pub struct ModesOptions<'a> {
    /// The places.
    pub places: &'a [PlaceFile],
    /// Name of the place where the force acts.
    pub driven: &'a str,
    /// About where the modes are, Hz; all peaks where it is empty.
    pub near_hz: &'a [f64],
    /// The band.
    pub band: Wish,
    /// Unit that the files do not state.
    pub unit: Option<&'a str>,
    /// Signal of the frequencies that the files do not state.
    pub frequencies_hz: Option<&'a str>,
}

/// A value with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IdentifiedValue {
    /// The value.
    pub value: f64,
    /// Its standard uncertainty.
    pub standard_uncertainty: f64,
    /// Ends of the 95 % interval.
    pub interval_95: [f64; 2],
}

impl From<&Value> for IdentifiedValue {
    fn from(of: &Value) -> Self {
        Self { value: of.value, standard_uncertainty: of.standard_uncertainty, interval_95: of.interval_95() }
    }
}

/// A mode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdentifiedMode {
    /// fn, Hz.
    pub natural_frequency_hz: IdentifiedValue,
    /// ζ.
    pub damping_ratio: IdentifiedValue,
    /// φ of each place for a modal mass of 1 kg, 1/√kg.
    pub shape_per_root_kg: Vec<IdentifiedValue>,
}

/// The answer.
#[derive(Clone, Debug, Serialize)]
pub struct IdentifiedModes {
    /// Name and version of the program.
    pub damprig: &'static str,
    /// When it was identified, local time with its zone.
    pub date: String,
    /// Names of the places.
    pub places: Vec<String>,
    /// What each was taken from.
    pub taken_from: Vec<String>,
    /// Name of the place where the force acts.
    pub driven: String,
    /// First and last line that were fitted, Hz.
    pub band_hz: [f64; 2],
    /// The modes, by rising frequency.
    pub modes: Vec<IdentifiedMode>,
    /// What a person has to know about them.
    pub remarks: Vec<String>,
    /// The fit, for figures.
    #[serde(skip)]
    pub fit: Modes,
}

/// What neighbouring lines may leave in common before it is said: the intervals are then twice as wide.
const NOTABLE_INFLATION: f64 = 4.0;

/// Share out of phase that is said.
const NOTABLE_PHASE: f64 = 0.1;

/// Reads the responses and identifies the modes.
///
/// # Errors
/// A file that cannot be read, a name of no place, what [`identify`] refuses.
pub fn of_files(options: &ModesOptions) -> Result<IdentifiedModes, Failure> {
    let names: Vec<&str> = options.places.iter().map(|place| place.name.as_str()).collect();
    let Some(driven) = names.iter().position(|name| *name == options.driven) else {
        return Err(Failure::Input(format!(
            "--driven {}: it is none of the places; they are {}",
            options.driven,
            names.join(", ")
        )));
    };
    let read = |place: &PlaceFile| {
        let file: &Path = &place.file;
        let ModesOptions { unit, frequencies_hz, band, .. } = *options;
        let mut response = ModalSource { file, unit, frequencies_hz, coherence: None, averages: None, band }.read()?;
        if place.is_reversed {
            response.lines.iter_mut().for_each(|line| line.h = -line.h);
        }
        Ok(response)
    };
    let responses = options.places.iter().map(read).collect::<Result<Vec<_>, Failure>>()?;
    let fit = identify(&responses, driven, options.near_hz, options.band)?;
    let mut remarks: Vec<String> = responses.iter().flat_map(|response| response.remarks.clone()).collect();
    if fit.inflation > NOTABLE_INFLATION {
        remarks.push(format!(
            "Lack of fit: neighbouring lines leave more in common than noise does, most about {:.4} Hz; the intervals are {:.1} times as wide for it. Another \
             mode may be there (--near-hz), or the shapes are complex.",
            fit.worst_hz,
            fit.inflation.sqrt()
        ));
    }
    for mode in fit.modes.iter().filter(|mode| mode.out_of_phase > NOTABLE_PHASE) {
        remarks.push(format!(
            "The mode of {:.4} Hz is complex at a place: {:.0} % of its A is out of phase and left out.",
            mode.natural_frequency_hz.value,
            100.0 * mode.out_of_phase
        ));
    }
    for mode in &fit.modes {
        let (hz, ratio) = (mode.natural_frequency_hz.value, mode.damping_ratio.value);
        let lines = responses[driven].lines.windows(2).find(|pair| pair[1].frequency_hz >= hz);
        let width =
            lines.map_or(f64::INFINITY, |pair| 2.0 * ratio * hz / (pair[1].frequency_hz - pair[0].frequency_hz));
        if width < RESOLVED_LINES {
            remarks.push(format!(
                "The peak at {hz:.4} Hz is {width:.1} lines wide, less than {RESOLVED_LINES:.1}: ζ may be that of the analyser's window, and no interval \
                 includes that; measure with finer lines."
            ));
        }
    }
    remarks
        .push("Errors of scale of force and motion are not in the intervals: they act on shapes in proportion.".into());
    let of_mode = |mode: &Mode| IdentifiedMode {
        natural_frequency_hz: (&mode.natural_frequency_hz).into(),
        damping_ratio: (&mode.damping_ratio).into(),
        shape_per_root_kg: mode.shape_per_root_kg.iter().map(IdentifiedValue::from).collect(),
    };
    Ok(IdentifiedModes {
        damprig: crate::VERSION_LINE,
        date: crate::host_time::now_text(),
        places: names.into_iter().map(String::from).collect(),
        taken_from: responses.iter().map(|response| response.taken_from.clone()).collect(),
        driven: options.driven.into(),
        band_hz: fit.band_hz,
        modes: fit.modes.iter().map(of_mode).collect(),
        remarks,
        fit,
    })
}
