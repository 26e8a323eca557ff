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

use super::facts::{self, Fact};
use super::{ExportSelection, ExportSummary, Exporter, RunTable, write_export};
use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::run_folder::schema::manifest::SetUpRecord;
use crate::storage::out_file::{OutFile, to_failure};
use crate::table::mat_file::{MAX_NUMBERS, MatTable, cells, numbers, structure, text, write_checked};

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

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, Failure> {
        let failed = to_failure(&out.path);
        write_export(out, |file| {
            let path = file.path().to_str().ok_or_else(|| failed(&"the name is not UTF-8; give another with --out"))?;
            let mut exported = ExportSummary::default();
            let mut mat = MatFile::new();
            mat.insert("run", run_struct(run));
            let (mut units, mut descriptions, mut sums) = (IndexMap::new(), IndexMap::new(), Vec::new());
            for (table, columns) in part.gathered(run, MAX_NUMBERS, &mut exported).map_err(|e| failed(&e))? {
                let name = table.name().to_string();
                let of_table = MatTable::new(&name, columns);
                units.insert(name.clone(), of_table.units);
                descriptions.extend(of_table.descriptions.map(|all| (name.clone(), all)));
                sums.push(of_table.sums);
                mat.insert(&name, of_table.variable);
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
