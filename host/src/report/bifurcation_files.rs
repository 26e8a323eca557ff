//! Writes the files of a bifurcation diagram: the table of its sampled cycles, the figure, and a Poincaré section.

use std::path::Path;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray};
use arrow_schema::{DataType, Schema};

use crate::report::figures::{self, FigureError, Picture, bifurcation as figure, symbols};
use crate::report::numbers::significant;
use crate::run_folder::schema::self_description::DESCRIPTION;
use crate::run_folder::schema::table::{described, field};
use crate::run_folder::{own_files, sealed_parquet};
use crate::simulation::Case;
use crate::study::bifurcation::{Sample, Sweep};

/// Name of the table.
pub const TABLE: &str = "bifurcation.parquet";

/// Why the files could not be written.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{0}")]
pub struct Unwritten(pub String);

impl Unwritten {
    fn of(error: impl std::fmt::Display) -> Self {
        Self(error.to_string())
    }
}

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
) -> Result<Option<String>, Unwritten> {
    let batch = batch(samples, &sweep.key, case).map_err(Unwritten::of)?;
    let (batch, identity) = sealed_parquet::identified(&batch).map_err(Unwritten::of)?;
    let bytes = sealed_parquet::bytes(&batch).map_err(Unwritten::of)?;
    own_files::replace(&out.join(TABLE), &bytes).map_err(Unwritten::of)?;
    let reference = || symbols::reference(case);
    let source = figures::source("bifurcation", &identity);
    let save = |picture: Result<Picture, FigureError>, stem: &str| {
        picture.and_then(|drawn| drawn.of_source(&source)?.write(out, stem)).map_err(Unwritten::of)
    };
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

fn batch(samples: &[Sample], key: &str, case: &Case) -> Result<RecordBatch, arrow_schema::ArrowError> {
    let unit = crate::input::key::Unit::of(key).map_or("1", |unit| unit.symbol);
    let numbers = |of: fn(&Sample) -> f64| Arc::new(samples.iter().map(of).collect::<Float64Array>()) as ArrayRef;
    let directions = samples.iter().map(|sample| sample.direction.name());
    let columns: [(&str, &str, &str, ArrayRef); 6] = [
        (key, if unit.is_empty() { "1" } else { unit }, "the varied key of the case", numbers(|s| s.value)),
        ("x_m", "m", "structure: x at the end of the cycle", numbers(|s| s.x_m)),
        ("v_m_per_s", "m/s", "structure: x′ at the end of the cycle", numbers(|s| s.v_m_per_s)),
        ("y_minus_x_m", "m", "second mass relative to the structure", numbers(|s| s.offset_m)),
        ("u_minus_v_m_per_s", "m/s", "its velocity relative to the structure", numbers(|s| s.slide_m_per_s)),
        ("cycle_max_m", "m", "largest |x| in the cycle", numbers(|s| s.cycle_max_m)),
    ];
    let direction = "whether the values rise or fall from branch to branch";
    let mut fields = vec![described(field("direction", DataType::Utf8, ""), direction)];
    let mut arrays: Vec<ArrayRef> = vec![Arc::new(StringArray::from_iter_values(directions))];
    for (name, unit, about, array) in columns {
        fields.push(described(field(name, DataType::Float64, unit), about));
        arrays.push(array);
    }
    let about = case.description().with(DESCRIPTION, "a row for each sampled cycle: the state at its end");
    RecordBatch::try_new(Arc::new(Schema::new_with_metadata(fields, about)), arrays)
}
