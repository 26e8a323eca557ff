//! Identifies parameters of the rig from run folders and tables: each with its uncertainty and what it was taken from.
//!
//! Each method has a file with its equations. [`table`] reads CSV files, [`set_up_file`] writes the results as a set-up file
//! that campaigns and cases read. docs/IDENTIFY.md describes the methods and their measured errors.

pub mod backbone;
pub mod contact;
pub mod decay;
pub mod decay_file;
pub mod decay_motion;
mod decay_record;
pub mod flights;
mod flights_of_run;
pub mod force_record;
pub mod friction;
mod from_run;
pub mod lack_of_fit;
pub mod modal;
mod motion_of_run;
pub mod next;
pub mod response;
pub mod restitution;
pub mod sensors;
pub mod set_up_file;
pub mod sound;
pub mod statistics;
pub mod table;
pub mod time_response;
pub mod wall;

use serde::Serialize;

pub use flights_of_run::{ParticleRun, particle_run};
pub use from_run::{Choice, FreeVibration, free_vibration, stepped_sine};
pub use motion_of_run::{OfRun, response_of_run};
pub use sensors::Sensors;
pub use statistics::Value;

/// An identified quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Its name for people.
    pub quantity: &'static str,
    /// Its value, in `unit`.
    pub value: f64,
    /// Standard uncertainty, in `unit`.
    pub standard_uncertainty: f64,
    /// Ends of the 95 % interval, in `unit`.
    pub interval_95: [f64; 2],
    /// SI unit; "" for a ratio.
    pub unit: &'static str,
    /// How it was found.
    pub method: &'static str,
    /// The key of a set-up that it is the value of, if there is one.
    pub key: Option<&'static str>,
}

impl Estimate {
    /// Of a value without a key.
    #[must_use]
    pub fn new(quantity: &'static str, unit: &'static str, method: &'static str, value: &Value) -> Self {
        Self {
            quantity,
            value: value.value,
            standard_uncertainty: value.standard_uncertainty,
            interval_95: value.interval_95(),
            unit,
            method,
            key: None,
        }
    }

    /// The same as the value of a set-up's key.
    #[must_use]
    pub fn of_key(mut self, key: &'static str) -> Self {
        self.key = Some(key);
        self
    }

    /// Of a quantity that is never negative: the value of a set-up's key where it is found.
    #[must_use]
    pub fn not_negative(
        quantity: &'static str,
        unit: &'static str,
        method: &'static str,
        value: &Value,
        key: Option<&'static str>,
    ) -> Self {
        let (at_least_0, interval_95) = value.not_negative();
        let key = key.filter(|_| value.is_found());
        Self { value: at_least_0, interval_95, key, ..Self::new(quantity, unit, method, value) }
    }
}

/// The answer of an identification.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identification {
    /// The answer to the question whether the model is enough, in a sentence, where that was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer: Option<String>,
    /// Where the model does not hold, a sentence each; left out where that was not tested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lack_of_fit: Option<Vec<String>>,
    /// What the values were taken from: a file, or a run with its set-up and experiment.
    pub taken_from: String,
    /// Name and version of the program.
    pub damprig: &'static str,
    /// When it was identified, local time with its zone.
    pub date: String,
    /// The quantities; the one to use first.
    pub estimates: Vec<Estimate>,
    /// Damping ratio and frequency over the amplitude, where they were measured.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub over_amplitude: Vec<backbone::Row>,
    /// Restitution over the approach speed, where it was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub over_speed: Option<restitution::OverSpeed>,
    /// What a person has to know about them.
    pub remarks: Vec<String>,
    /// Why the estimates are not to be written to a set-up file: what contradicts them.
    #[serde(skip)]
    pub contradiction: Option<String>,
    /// Keys of a set-up with words that go with the values (`particle.wall.kind`).
    #[serde(skip)]
    pub words: Vec<(&'static str, &'static str)>,
}

impl Identification {
    /// Without remarks.
    #[must_use]
    pub fn new(taken_from: impl Into<String>, estimates: Vec<Estimate>) -> Self {
        Self {
            answer: None,
            lack_of_fit: None,
            over_speed: None,
            taken_from: taken_from.into(),
            damprig: crate::VERSION_LINE,
            date: crate::host_time::now_text(),
            estimates,
            over_amplitude: Vec::new(),
            remarks: Vec::new(),
            contradiction: None,
            words: Vec::new(),
        }
    }
}
