//! Identifies parameters of the rig from run folders and tables: each with its uncertainty and what it was taken from.
//!
//! Each method has a file with its equations. Estimators of motions, responses and flights are the crate `damprig-identification`;
//! this module reads what they take from files and runs, and has those of one kind of file: films and drop tests, force records, slides,
//! walls, sound. [`table`] reads CSV files, [`set_up_file`] writes the results as a set-up file that campaigns and cases read.
//! docs/IDENTIFY.md describes the methods and their measured errors.

pub mod contact;
pub mod decay_file;
mod flights_of_run;
pub mod force_record;
pub mod friction;
mod from_run;
pub mod modal;
pub mod modes;
mod motion_of_run;
pub mod next;
pub mod response_file;
pub mod restitution;
pub mod sensors;
pub mod set_up_file;
pub mod sound;
pub mod table;
pub mod wall;

use serde::Serialize;

pub use damprig_identification::sensors::Sensors;
pub use damprig_identification::{
    Estimate, backbone, decay, decay_motion, flights, lack_of_fit, response, statistics, time_response,
};
pub use flights_of_run::{ParticleRun, particle_run};
pub use from_run::{ExperimentChoice, RecordedFreeVibration, free_vibration, stepped_sine};
pub use motion_of_run::{OfRun, response_of_run};
pub use statistics::Value;

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
