//! Reads what was computed, part by part: the folder `OUT/ITEM/PART` has the files of the public command that computes such a part.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

use damprig::failure::Failure;
use damprig::report::bifurcation_files;
use damprig::run_folder::RunFolder;
use damprig::simulation::result::Summary;
use damprig::study::table::StudyTable;

/// Table of a study.
pub const STUDY_TABLE: &str = damprig::study::data_set::TABLE;
/// Table of a bifurcation diagram: a row for each sampled cycle.
pub const BIFURCATION_TABLE: &str = bifurcation_files::TABLE;
/// Table of a continuation: a row for each orbit.
pub const BRANCHES_TABLE: &str = "branches.parquet";
/// The complete result of a continuation.
pub const BRANCHES: &str = "branches.json";
/// Folder of a campaign's run.
pub const RUN: &str = "run";
/// Table of a method of its own.
pub const METHOD_TABLE: &str = "method.parquet";

/// Why a result cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ResultError {
    /// The part has not been computed.
    #[error("{item}, part {part}, has not been computed: `damprig-thesis {item}` does it")]
    Missing {
        /// Name of the item.
        item: String,
        /// Name of the part.
        part: String,
    },
    /// A file is damaged, or lacks what is wanted.
    #[error("{0}")]
    Wrong(String),
}

impl From<Failure> for ResultError {
    fn from(error: Failure) -> Self {
        Self::Wrong(error.to_string())
    }
}

/// A simulated case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CaseResult {
    /// Name of the case.
    pub name: String,
    /// Cycle of the drive, or of the structure without one, s.
    pub cycle_s: f64,
    /// Length of the run, s.
    pub duration_s: f64,
    /// The length that X is divided by, if there is one, m: Z of a sine, P/k of a force, x0 of a free vibration.
    pub reference_m: Option<f64>,
    /// Statistics of the whole run.
    pub summary: Summary,
    /// Largest |x| of each whole cycle, m.
    pub cycle_max_m: Vec<f64>,
}

/// The parts of a case's file that [`CaseResult`] has.
#[derive(Deserialize)]
struct CaseFile {
    case: CaseFacts,
    summary: Summary,
    cycle_max_m: Vec<f64>,
}

#[derive(Deserialize)]
struct CaseFacts {
    name: String,
    cycle_s: f64,
    duration_s: f64,
    reference: Option<(f64, String)>,
}

impl From<CaseFile> for CaseResult {
    fn from(CaseFile { case, summary, cycle_max_m }: CaseFile) -> Self {
        Self {
            name: case.name,
            cycle_s: case.cycle_s,
            duration_s: case.duration_s,
            reference_m: case.reference.map(|(length_m, _)| length_m),
            summary,
            cycle_max_m,
        }
    }
}

impl CaseResult {
    /// Mean of the cycle maxima of the whole run over the reference length; `None` without one, or without a whole cycle.
    #[must_use]
    pub fn x_over_z(&self) -> Option<f64> {
        let reference_m = self.reference_m.filter(|_| !self.cycle_max_m.is_empty())?;
        Some(self.cycle_max_m.iter().sum::<f64>() / self.cycle_max_m.len() as f64 / reference_m)
    }
}

/// What was computed: the folder of the whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Results {
    folder: PathBuf,
}

impl Results {
    /// The results in a folder.
    #[must_use]
    pub fn at(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// The folder of the whole.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder of a part.
    #[must_use]
    pub fn part(&self, item: &str, part: &str) -> PathBuf {
        self.folder.join(item).join(part)
    }

    /// The table of a study.
    ///
    /// # Errors
    /// A part that has not been computed; a file that is damaged.
    pub fn study(&self, item: &str, part: &str) -> Result<StudyTable, ResultError> {
        self.table_in(item, part, Path::new(STUDY_TABLE))
    }

    /// The sampled cycles of a bifurcation diagram: columns `direction`, the key, `x_m`, `v_m_per_s`, `y_minus_x_m`,
    /// `u_minus_v_m_per_s`, `cycle_max_m`.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn bifurcation(&self, item: &str, part: &str) -> Result<StudyTable, ResultError> {
        self.table_in(item, part, Path::new(BIFURCATION_TABLE))
    }

    /// The orbits of a continuation, as docs/CONTINUE.md describes the table.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn branches(&self, item: &str, part: &str) -> Result<StudyTable, ResultError> {
        self.table_in(item, part, Path::new(BRANCHES_TABLE))
    }

    /// The complete result of a continuation, as `damprig continue --json` prints it.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn continuation(&self, item: &str, part: &str) -> Result<serde_json::Value, ResultError> {
        self.json_in(item, part, BRANCHES)
    }

    /// A simulated case; `case` is the name of its file without extension.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn case(&self, item: &str, part: &str, case: &str) -> Result<CaseResult, ResultError> {
        Ok(self.json_in::<CaseFile>(item, part, &format!("{case}.json"))?.into())
    }

    /// The complete result of a simulated case, as `damprig simulate --json` prints it, with `cycle_max_m`.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn case_json(&self, item: &str, part: &str, case: &str) -> Result<serde_json::Value, ResultError> {
        self.json_in(item, part, &format!("{case}.json"))
    }

    /// The time history of a simulated case.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn time_history(&self, item: &str, part: &str, case: &str) -> Result<StudyTable, ResultError> {
        self.table_in(item, part, Path::new(&format!("{case}.parquet")))
    }

    /// The run of a campaign on the virtual rig.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn run(&self, item: &str, part: &str) -> Result<RunFolder, ResultError> {
        let folder = self.part(item, part).join(RUN);
        if !folder.is_dir() {
            return Err(missing(item, part));
        }
        Ok(RunFolder::open(&folder)?)
    }

    /// The measured points of a campaign: the run's `results.parquet`.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn points(&self, item: &str, part: &str) -> Result<StudyTable, ResultError> {
        self.table_in(item, part, &Path::new(RUN).join("results.parquet"))
    }

    /// The table of a method of its own.
    ///
    /// # Errors
    /// As [`Results::study`].
    pub fn method(&self, item: &str, part: &str) -> Result<StudyTable, ResultError> {
        self.table_in(item, part, Path::new(METHOD_TABLE))
    }

    fn bytes(&self, item: &str, part: &str, file: &Path) -> Result<(String, Vec<u8>), ResultError> {
        let path = self.part(item, part).join(file);
        let shown = path.display().to_string();
        match std::fs::read(&path) {
            Ok(bytes) => Ok((shown, bytes)),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(missing(item, part)),
            Err(error) => Err(ResultError::Wrong(format!("cannot read {shown}: {error}"))),
        }
    }

    fn table_in(&self, item: &str, part: &str, file: &Path) -> Result<StudyTable, ResultError> {
        let (shown, bytes) = self.bytes(item, part, file)?;
        Ok(StudyTable::read(&shown, bytes.into())?)
    }

    fn json_in<T: DeserializeOwned>(&self, item: &str, part: &str, file: &str) -> Result<T, ResultError> {
        let (shown, bytes) = self.bytes(item, part, Path::new(file))?;
        serde_json::from_slice(&bytes).map_err(|error| ResultError::Wrong(format!("{shown}: {error}")))
    }
}

fn missing(item: &str, part: &str) -> ResultError {
    ResultError::Missing { item: item.into(), part: part.into() }
}
