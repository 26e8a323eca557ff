//! Writes the files of basins of attraction: the table of the starts, that of the attractors, and the figure.

use std::path::Path;

use arrow_array::RecordBatch;

use crate::failure::Failure;
use crate::report::figures::{basins as figure, symbols};
use crate::report::plot;
use crate::run_folder::schema::self_description::DESCRIPTION;
use crate::run_folder::{own_files, sealed_parquet};
use crate::simulation::Case;
use crate::study::basins::{Attractor, Basins, Grid};
use crate::table::{Column, TableBuilder};

/// Name of the table of the starts.
pub const STARTS: &str = "basins.parquet";

/// Name of the table of the attractors.
pub const ATTRACTORS: &str = "attractors.parquet";

/// Writes tables and figure of `case`, in place of earlier ones.
///
/// # Errors
/// A file that cannot be written.
pub fn write(out: &Path, case: &Case, basins: &Basins, grid: &Grid) -> Result<(), Failure> {
    let (starts, identity) = sealed_parquet::identified(&starts(basins, grid, case)?)?;
    for (name, table) in [(STARTS, &starts), (ATTRACTORS, &attractors(basins, case)?)] {
        let bytes = sealed_parquet::bytes(table)?;
        own_files::replace(&out.join(name), &bytes)?;
    }
    let labels = grid.axes.each_ref().map(|axis| symbols::label(&axis.key, || symbols::reference(case)));
    let title = format!("{}: basins of attraction, {} starts", case.name, basins.ends.len());
    let picture = figure::draw(basins, grid, labels, &title).of_source(&plot::source("basins", &identity));
    picture.write(out, "basins")
}

/// The table of the starts: a row for each.
///
/// # Errors
/// A table that cannot be made.
pub fn starts(basins: &Basins, grid: &Grid, case: &Case) -> Result<RecordBatch, Failure> {
    let rows: Vec<usize> = (0..basins.ends.len()).collect();
    let mut table = TableBuilder::new(&rows);
    for (n, axis) in grid.axes.iter().enumerate() {
        let unit = crate::input::key::KeyUnit::of(&axis.key).map_or("1", |unit| unit.symbol);
        table = table.column(Column::new(&axis.key, unit, "the start"), move |row| grid.at(*row)[n]);
    }
    let number = Column::new("attractor", "1", "number of the attractor, from 1; 0 if there is none");
    let table = table.column(number, |row| basins.ends[*row].map_or(0, |place| place as u32 + 1));
    let passed =
        Column::new("passed_wall", "", "whether the particle has passed a soft wall: there is no attractor then");
    let table = table.column(passed, |row| basins.passed[*row]);
    state_of(table, "at the end, at drive phase 0", |row| &basins.states[*row])
        .finish(case.description().with(DESCRIPTION, "a row for each start"))
}

/// The table of the attractors: a row for each.
///
/// # Errors
/// A table that cannot be made.
pub fn attractors(basins: &Basins, case: &Case) -> Result<RecordBatch, Failure> {
    let rows: Vec<(u32, &Attractor)> = (1..).zip(&basins.attractors).collect();
    let all = basins.ends.len() as f64;
    let table = TableBuilder::new(&rows)
        .column(Column::new("attractor", "1", "its number, from 1"), |row| row.0)
        .column(Column::new("starts", "1", "starts that end on it"), |row| row.1.starts as u64)
        .column(Column::new("share", "1", "their share of all starts"), |row| row.1.starts as f64 / all)
        .column(Column::new("period_cycles", "1", "drive periods after which it repeats"), |row| row.1.periods as u32)
        .column(Column::new("impacts", "1", "impacts in those periods"), |row| row.1.impacts)
        .column(Column::new("max_abs_x_m", "m", "largest |x|"), |row| row.1.max_abs_x_m);
    state_of(table, "at drive phase 0, of its states there that with the smallest x", |row| &row.1.state)
        .finish(case.description().with(DESCRIPTION, "a row for each attractor"))
}

/// Adds the columns of a state.
fn state_of<'r, R>(
    table: TableBuilder<'r, R>,
    when: &str,
    state: impl Fn(&'r R) -> &'r damprig_core::integrator::exact::ExactState + Copy,
) -> TableBuilder<'r, R> {
    table
        .column(Column::new("x_m", "m", format!("structure: x {when}")), move |row| state(row).x_m)
        .column(Column::new("v_m_per_s", "m/s", format!("structure: x′ {when}")), move |row| state(row).v_m_per_s)
        .column(Column::new("y_minus_x_m", "m", "second mass relative to the structure then"), move |row| {
            state(row).offset_m
        })
        .column(Column::new("u_minus_v_m_per_s", "m/s", "its velocity relative to the structure then"), move |row| {
            state(row).slide_m_per_s
        })
}
