//! Writes the files of a bifurcation diagram: the table of its sampled cycles, the figure, and a Poincaré section.

use std::path::Path;

use arrow_array::RecordBatch;

use crate::failure::Failure;
use crate::report::figures::{bifurcation as figure, symbols};
use crate::report::numbers::significant;
use crate::report::plot::{self, Picture};
use crate::run_folder::schema::self_description::DESCRIPTION;
use crate::run_folder::{own_files, sealed_parquet};
use crate::simulation::Case;
use crate::study::bifurcation::{Sample, Sweep};
use crate::table::{Column, TableBuilder};

/// Name of the table.
pub const TABLE: &str = "bifurcation.parquet";

/// Writes table and figure of `case`, in place of earlier ones, and the Poincaré section at the value nearest to `section`. Answers with the title
/// of that section, if there is one.
///
/// # Errors
/// A file that cannot be written.
pub fn write(
    out: &Path,
    case: &Case,
    samples: &[Sample],
    sweep: &Sweep,
    section: Option<f64>,
) -> Result<Option<String>, Failure> {
    let batch = batch(samples, &sweep.key, case)?;
    let (batch, identity) = sealed_parquet::identified(&batch)?;
    let bytes = sealed_parquet::bytes(&batch)?;
    own_files::replace(&out.join(TABLE), &bytes)?;
    let reference = || symbols::reference(case);
    let source = plot::source("bifurcation", &identity);
    let save = |picture: Picture, stem: &str| picture.of_source(&source).write(out, stem);
    save(figure::diagram(samples, &symbols::label(&sweep.key, reference), &title(case, sweep)), "bifurcation")?;
    let Some(wanted) = section else { return Ok(None) };
    let distance = |sample: &Sample| (sample.value - wanted).abs();
    let Some(nearest) = samples.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|s| s.value) else {
        return Ok(None);
    };
    let there: Vec<Sample> = samples.iter().filter(|sample| sample.value == nearest).copied().collect();
    let title = symbols::at(&sweep.key, &significant(nearest, 6), reference);
    save(figure::section(&there, &title), "section")?;
    Ok(Some(title))
}

/// Says what a dot is.
fn title(case: &Case, Sweep { key, cycles, settle_cycles, .. }: &Sweep) -> String {
    let name = symbols::name(key, || symbols::reference(case));
    format!("{}: each dot is a cycle, {cycles} at each value of {name} after {settle_cycles} to settle", case.name)
}

/// The table: a row for each sampled cycle.
///
/// # Errors
/// A table that cannot be made.
pub fn batch(samples: &[Sample], key: &str, case: &Case) -> Result<RecordBatch, Failure> {
    let unit = crate::input::key::KeyUnit::of(key).map_or("1", |unit| unit.symbol);
    let unit = if unit.is_empty() { "1" } else { unit };
    let direction = Column::new("direction", "", "whether the values rise or fall from branch to branch");
    TableBuilder::new(samples)
        .column(direction, |sample| sample.direction.name())
        .column(Column::new(key, unit, "the varied key of the case"), |sample| sample.value)
        .column(Column::new("x_m", "m", "structure: x at the end of the cycle"), |sample| sample.x_m)
        .column(Column::new("v_m_per_s", "m/s", "structure: x′ at the end of the cycle"), |sample| sample.v_m_per_s)
        .column(Column::new("y_minus_x_m", "m", "second mass relative to the structure"), |sample| sample.offset_m)
        .column(Column::new("u_minus_v_m_per_s", "m/s", "its velocity relative to the structure"), |sample| {
            sample.slide_m_per_s
        })
        .column(Column::new("cycle_max_m", "m", "largest |x| in the cycle"), |sample| sample.cycle_max_m)
        .finish(case.description().with(DESCRIPTION, "a row for each sampled cycle: the state at its end"))
}
