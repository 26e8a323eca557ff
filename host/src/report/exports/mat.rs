//! Exports to MATLAB's `.mat` (version 7, readable by MATLAB, Octave and `scipy.io.loadmat`).
//!
//! Variables: `run` (from the manifest), `results`, `samples` and, if the run has any, `transients` and `impacts`. Each is a
//! struct with a field per column: numbers as double column vectors, names as cell arrays of char. In `samples` and `impacts`
//! the fields `set_up` and `experiment` are indices, from 1, into the cell arrays `set_up_names` and `experiment_names` beside
//! them. `units` has the unit of each field, `descriptions` its meaning. `run.set_ups` has the parameters of the set-ups'
//! models, in the order of `run.set_up_names`.
//!
//! The library keeps the whole file in memory. A variable has at most 2 GiB, which MATLAB sets.

use indexmap::IndexMap;
use matrw::{MatFile, MatVariable};

use super::atomic_file::{OutFile, to_failure, write_export};
use super::columns::{self, Column, Values};
use super::facts::{self, Fact};
use super::{ExportSelection, ExportSummary, Exporter, RunTable};
use crate::run_folder::schema::manifest::SetUpRecord;
use crate::run_folder::write::mat_file::{Sum, cells, numbers, structure, sum, text, write_checked};
use crate::run_folder::{ReadError, RunFolder};

/// Most numbers of a table: the 2 GiB of a variable, less room for the names and dimensions of its fields.
const MOST_NUMBERS: usize = ((1 << 31) - (1 << 20)) / size_of::<f64>();

/// The MATLAB exporter.
#[derive(Clone, Copy, Debug)]
pub struct Mat;

impl Exporter for Mat {
    fn usual_tables(&self) -> &'static [RunTable] {
        &RunTable::ALL
    }

    fn extension(&self) -> &'static str {
        "mat"
    }

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, ReadError> {
        let failed = to_failure(&out.path);
        write_export(out, |file| {
            let path = file.path().to_str().ok_or_else(|| failed(&"the name is not UTF-8; give another with --out"))?;
            let mut exported = ExportSummary::default();
            let mut mat = MatFile::new();
            mat.insert("run", run_struct(run));
            let (mut units, mut descriptions, mut sums) = (IndexMap::new(), IndexMap::new(), Vec::new());
            for (table, columns) in columns::tables(run, part, MOST_NUMBERS, &mut exported).map_err(|e| failed(&e))? {
                let of_columns = |what: fn(&Column) -> &str| {
                    structure(columns.iter().map(|column| (column.name.clone(), text(what(column)))))
                };
                units.insert(table.name().to_string(), of_columns(|column| &column.unit));
                if columns.iter().any(|column| !column.description.is_empty()) {
                    descriptions.insert(table.name().to_string(), of_columns(|column| &column.description));
                }
                sums.push((
                    table.name().to_string(),
                    columns.iter().map(|c| (c.name.clone(), sum_of(&c.values))).collect::<Vec<_>>(),
                ));
                mat.insert(table.name(), to_variable(columns));
            }
            mat.insert("units", structure(units));
            if !descriptions.is_empty() {
                mat.insert("descriptions", structure(descriptions));
            }
            write_checked(path, mat, &sums).map_err(|e| failed(&e))?;
            Ok(exported)
        })
    }
}

/// Length and digest of the numbers of a column; `None` for names.
fn sum_of(values: &Values) -> Option<Sum> {
    match values {
        Values::Numbers(all) => Some(sum(all)),
        Values::Places(all, _) => Some(sum(&from_one(all))),
        Values::Texts(_) => None,
    }
}

/// A table as a struct: a field per column, then the lists of names.
fn to_variable(columns: Vec<Column>) -> MatVariable {
    let mut fields = IndexMap::new();
    let mut lists = Vec::new();
    for Column { name, values, .. } in columns {
        let value = match values {
            Values::Numbers(all) => numbers(all),
            Values::Texts(all) => cells(&all),
            Values::Places(all, names) => {
                lists.push((format!("{name}_names"), cells(&names)));
                numbers(from_one(&all))
            }
        };
        fields.insert(name, value);
    }
    fields.extend(lists);
    structure(fields)
}

/// Places in a list as MATLAB counts them, from 1.
fn from_one(places: &[usize]) -> Vec<f64> {
    places.iter().map(|place| (place + 1) as f64).collect()
}

/// The struct `run`, from the manifest.
fn run_struct(run: &RunFolder) -> MatVariable {
    let records = &run.manifest().set_ups;
    let set_ups = |get: fn(&SetUpRecord) -> &String| cells(&records.iter().map(|s| get(s).clone()).collect::<Vec<_>>());
    let facts = facts::of_run(run).into_iter().map(|(name, fact)| match fact {
        Fact::Text(fact) => (name, text(&fact)),
        Fact::Number(fact) => (name, numbers(vec![fact])),
    });
    let parameters = facts::set_up_columns(records).into_iter().map(|(name, all)| (name.to_string(), numbers(all)));
    let of_set_ups = [
        ("set_up_names", set_ups(|s| &s.name)),
        ("set_up_labels", set_ups(|s| &s.label)),
        ("set_up_base_amplitudes_m", numbers(records.iter().map(|s| s.base_amplitude_m).collect())),
        ("set_ups", structure(parameters)),
    ];
    structure(facts.chain(of_set_ups).map(|(name, value)| (name.to_string(), value)))
}
