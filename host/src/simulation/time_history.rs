//! Writes the time history of a simulation to a CSV, Parquet or `.mat` file while it runs.
//!
//! The file of a run that is stopped is complete up to there. Impacts and accumulations have tables of their own beside it
//! (`motion.csv`, `motion.impacts.csv`, `motion.accumulations.csv`; contacts with Hertz walls in `motion.contacts.csv`).

use std::path::{Path, PathBuf};
use std::str::FromStr;

use damprig_core::integrator::exact::ExactState;

use super::case::Case;
use super::motion::{AccumulationRecord, ContactRecord, ImpactRecord, Phase, Piece, Viewer};
use super::multi_degree::MultiDegree;
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::table::file::{TableFile, TableFormat};
use crate::table::{Column, DESCRIPTION, TableBuilder, Word};

/// Path of a table; the extension selects the format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TablePath {
    path: PathBuf,
    format: TableFormat,
}

impl TablePath {
    /// The path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Approximate bytes per row of a time history, measured on a forced impact damper at 500 Hz.
    #[must_use]
    pub fn bytes_per_row(&self) -> f64 {
        match self.format {
            TableFormat::Csv => 140.0,
            TableFormat::Parquet => 23.0,
            TableFormat::Mat => 64.0,
        }
    }

    /// Path of the table of impacts.
    #[must_use]
    pub fn impacts(&self) -> Self {
        self.beside("impacts")
    }

    /// Path of the table of accumulations.
    #[must_use]
    pub fn accumulations(&self) -> Self {
        self.beside("accumulations")
    }

    /// Path of the table of contacts with Hertz walls.
    #[must_use]
    pub fn contacts(&self) -> Self {
        self.beside("contacts")
    }

    fn beside(&self, what: &str) -> Self {
        let extension = self.format.extension();
        Self { path: self.path.with_extension(format!("{what}.{extension}")), format: self.format }
    }
}

impl FromStr for TablePath {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let path = PathBuf::from(text);
        Ok(Self { format: TableFormat::of(&path)?, path })
    }
}

/// The motion at a time.
struct MotionRow {
    t_s: f64,
    state: ExactState,
    z_m: f64,
    phase: Phase,
    /// What a structure with several places has besides, in the order of [`MultiDegree::place_columns`].
    ///
    /// [`MultiDegree::place_columns`]: super::multi_degree::MultiDegree::place_columns
    places: Vec<f64>,
}

impl MotionRow {
    fn columns<'r>(rows: &'r [Self], of_places: &[Column]) -> TableBuilder<'r, Self> {
        let second = |what: &str| format!("{what} of the particle or tuned mass; that of the structure without one");
        let (displacement, velocity) = (second("displacement"), second("velocity"));
        let particle = "between the walls, held by friction, resting on a wall, in the wall";
        let table = TableBuilder::new(rows)
            .column(Column::new("t_s", "s", "time"), |row| row.t_s)
            .column(Column::new("x_m", "m", "displacement of the structure"), |row| row.state.x_m)
            .column(Column::new("v_m_per_s", "m/s", "velocity of the structure"), |row| row.state.v_m_per_s)
            .column(Column::new("y_m", "m", displacement), |row| row.state.y_m())
            .column(Column::new("u_m_per_s", "m/s", velocity), |row| row.state.u_m_per_s())
            .column(Column::new("z_m", "m", "displacement of the base"), |row| row.z_m)
            .column(Column::new("structure", "", "free, or slipping or stuck on the friction damper"), |row| {
                Word(row.phase.structure())
            })
            .column(Column::new("particle", "", particle), |row| Word(row.phase.particle()));
        let of_places = of_places.iter().cloned().enumerate();
        of_places.fold(table, |table, (n, column)| table.column(column, move |row| row.places[n]))
    }
}

/// The number of the impact damper, on a structure with several places.
fn with_damper<R>(table: TableBuilder<'_, R>, of: fn(&R) -> Option<u32>) -> TableBuilder<'_, R> {
    let number = move |row: &R| i32::try_from(of(row).unwrap_or(1)).unwrap_or(i32::MAX);
    table.column(Column::new("damper", "", "number of the impact damper, from 1"), number)
}

fn damper_impact_columns(impacts: &[ImpactRecord]) -> TableBuilder<'_, ImpactRecord> {
    with_damper(impact_columns(impacts), |impact| impact.damper)
}

fn damper_contact_columns(contacts: &[ContactRecord]) -> TableBuilder<'_, ContactRecord> {
    with_damper(contact_columns(contacts), |contact| contact.damper)
}

fn impact_columns(impacts: &[ImpactRecord]) -> TableBuilder<'_, ImpactRecord> {
    TableBuilder::new(impacts)
        .column(Column::new("t_s", "s", "time"), |impact| impact.t_s)
        .column(Quantity::Side, |impact| i32::from(impact.side))
        .column(Quantity::ApproachSpeedMPerS, |impact| impact.approach_speed_m_per_s)
}

fn contact_columns(contacts: &[ContactRecord]) -> TableBuilder<'_, ContactRecord> {
    TableBuilder::new(contacts)
        .column(Column::new("t_s", "s", "time of the first touch"), |contact| contact.t_s)
        .column(Quantity::Side, |contact| i32::from(contact.side))
        .column(Quantity::ApproachSpeedMPerS, |contact| contact.approach_speed_m_per_s)
        .column(Column::new("duration_s", "s", "from the first touch until the penetration is zero"), |contact| {
            contact.duration_s
        })
        .column(Column::new("peak_force_n", "N", "largest force"), |contact| contact.peak_force_n)
        .column(Column::new("restitution", "", "separation speed over approach speed"), |contact| contact.restitution)
}

fn accumulation_columns(accumulations: &[AccumulationRecord]) -> TableBuilder<'_, AccumulationRecord> {
    let time = Column::new("t_s", "s", "when the chatter ended and the particle rested on the wall");
    TableBuilder::new(accumulations)
        .column(time, |accumulation| accumulation.t_s)
        .column(Quantity::Side, |accumulation| i32::from(accumulation.side))
}

/// Writes the motion at a constant rate, and every impact and accumulation.
pub struct TimeHistory {
    rate_hz: f64,
    next: u64,
    motion: TableFile<MotionRow>,
    impacts: Option<TableFile<ImpactRecord>>,
    contacts: Option<TableFile<ContactRecord>>,
    accumulations: Option<TableFile<AccumulationRecord>>,
    failure: Option<Failure>,
}

impl TimeHistory {
    /// Creates the files: `rate_hz` rows per second from t = 0, tables of impacts and accumulations if the case has impacts, and one of
    /// contacts if it has Hertz walls.
    ///
    /// # Errors
    /// When a file cannot be created.
    pub fn create(to: &TablePath, rate_hz: f64, case: &Case) -> Result<Self, Failure> {
        let has_walls = case.has_impacts();
        let about = |rows: &str| case.description().with(DESCRIPTION, rows);
        let format = to.format;
        let motion = about("the motion at a constant rate");
        let of_places = case.multi_degree.as_ref().map(MultiDegree::place_columns).unwrap_or_default();
        let motion =
            TableFile::create(&to.path, format, "motion", move |rows| MotionRow::columns(rows, &of_places), motion)?;
        let has_several = case.multi_degree.is_some();
        let impacts = || {
            let about = about("a row for each impact");
            let columns = if has_several { damper_impact_columns } else { impact_columns };
            TableFile::create(&to.impacts().path, format, "impacts", columns, about)
        };
        let contacts = || {
            let about = about("a row for each contact with a Hertz wall that has ended");
            let columns = if has_several { damper_contact_columns } else { contact_columns };
            TableFile::create(&to.contacts().path, format, "contacts", columns, about)
        };
        let accumulations = || {
            let about = about("a row for each accumulation");
            TableFile::create(&to.accumulations().path, format, "accumulations", accumulation_columns, about)
        };
        let impacts = has_walls.then(impacts).transpose()?;
        let contacts = case.has_hertz_walls().then(contacts).transpose()?;
        let accumulations = has_walls.then(accumulations).transpose()?;
        Ok(Self { rate_hz, next: 0, motion, impacts, contacts, accumulations, failure: None })
    }

    /// Rows so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.next
    }

    /// Completes and names the files.
    ///
    /// # Errors
    /// When a write has failed since [`TimeHistory::create`]; no file is left.
    pub fn finish(self) -> Result<(), Failure> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        self.motion.finish()?;
        self.impacts.map_or(Ok(()), TableFile::finish)?;
        self.contacts.map_or(Ok(()), TableFile::finish)?;
        self.accumulations.map_or(Ok(()), TableFile::finish)
    }

    fn keep_failure(&mut self, written: Result<(), Failure>) {
        if let Err(failure) = written {
            self.failure.get_or_insert(failure);
        }
    }
}

impl Viewer for TimeHistory {
    fn piece(&mut self, piece: &dyn Piece) {
        let (start_s, length_s) = (piece.start_s(), piece.length_s());
        let mut phase: Option<Phase> = None;
        while self.failure.is_none() {
            let t_s = self.next as f64 / self.rate_hz;
            let after_s = t_s - start_s;
            // Rounding must not lose a row at the end of the run.
            if after_s > length_s + 4.0 * f64::EPSILON * t_s {
                return;
            }
            let phase = *phase.get_or_insert_with(|| piece.phase());
            let at = piece.at(after_s.clamp(0.0, length_s));
            let mut places = Vec::new();
            piece.places_at(after_s.clamp(0.0, length_s), &mut places);
            let written = self.motion.push(MotionRow { t_s, state: at.state, z_m: at.z_m, phase, places });
            self.keep_failure(written);
            self.next += 1;
        }
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        let Some(impacts) = self.impacts.as_mut().filter(|_| self.failure.is_none()) else { return };
        let written = impacts.push(*impact);
        self.keep_failure(written);
    }

    fn contact(&mut self, contact: &ContactRecord) {
        let Some(contacts) = self.contacts.as_mut().filter(|_| self.failure.is_none()) else { return };
        let written = contacts.push(*contact);
        self.keep_failure(written);
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        let Some(accumulations) = self.accumulations.as_mut().filter(|_| self.failure.is_none()) else { return };
        let written = accumulations.push(*accumulation);
        self.keep_failure(written);
    }

    fn is_done(&self) -> bool {
        self.failure.is_some()
    }
}
