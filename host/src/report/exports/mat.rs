//! Exports to MATLAB's `.mat` (version 7, readable by MATLAB, Octave and `scipy.io.loadmat`).
//!
//! Variables: `run` (from the manifest), `samples`, `results` and, if the run has any, `transients`. Each is a struct with a
//! field per column: numbers as double column vectors, names as cell arrays of char. `samples.set_up` and
//! `samples.experiment` are indices, from 1, into the cell arrays `samples.set_up_names` and `samples.experiment_names`,
//! because a char array per row would dominate the file. `units.samples` and `units.results` have the unit of each field,
//! `descriptions.results` and `descriptions.transients` its meaning. `run.set_ups` has the parameters of the set-ups' models, in the order
//! of `run.set_up_names`.
//!
//! The library keeps the whole file in memory and ignores write errors. Hence the limit on its size, and the check that reads
//! the file back before it gets its name.

use std::collections::hash_map::DefaultHasher;
use std::f64::consts::TAU;
use std::fs::File;
use std::hash::{Hash, Hasher};
use std::io::{Read, Seek, SeekFrom};
use std::time::{SystemTime, UNIX_EPOCH};

use arrow_array::RecordBatch;
use arrow_schema::DataType;
use damprig_core::model::{SetUp, Wall};
use indexmap::IndexMap;
use matrw::{CellArray, MatFile, MatVariable, MatlabType, NumericArray, Structure, load_matfile, save_matfile_v7};

use super::atomic_file::{OutFile, to_failure, write_export};
use super::{ExportSelection, ExportSummary, Exporter, RunTable};
use crate::run_folder::read::columns::{Value, description, unit, values};
use crate::run_folder::schema::manifest::SetUpRecord;
use crate::run_folder::{ReadError, RunFolder};

/// Most numbers in one file: 320 MB as doubles (400 MB of memory were measured). MATLAB's own limit is 2 GiB per variable.
pub const MAX_NUMBERS: usize = 40_000_000;

/// Beginning of the year 10000, s since 1970.
const YEAR_10000_S: u64 = 253_402_300_800;

/// Longest field name in MATLAB.
const LONGEST_NAME: usize = 63;

/// The MATLAB exporter.
#[derive(Clone, Copy, Debug)]
pub struct Mat;

/// A column of the export.
#[derive(Debug)]
enum MatColumn {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
    /// Indices from 1 into a list of names.
    Places(Vec<f64>, Vec<String>),
}

/// Unit and meaning of a column.
#[derive(Debug)]
struct Meaning {
    unit: String,
    description: String,
}

type MatColumns = IndexMap<String, (MatColumn, Meaning)>;

impl Exporter for Mat {
    fn usual_tables(&self) -> &'static [RunTable] {
        &[RunTable::Results, RunTable::Samples, RunTable::Transients]
    }

    fn extension(&self) -> &'static str {
        "mat"
    }

    fn export(&self, run: &RunFolder, part: &ExportSelection, out: &OutFile) -> Result<ExportSummary, ReadError> {
        let failed = to_failure(&out.path);
        write_export(out, |file| {
            let path = file.path().to_str().ok_or_else(|| failed(&"the name is not UTF-8; give another with --out"))?;
            // The library writes the date into the file, and panics without one.
            let is_dated =
                SystemTime::now().duration_since(UNIX_EPOCH).is_ok_and(|since| since.as_secs() < YEAR_10000_S);
            if !is_dated {
                return Err(failed(
                    &"a .mat file states its date, and the clock of this machine is not set; set it, or use --format csv",
                ));
            }
            let mut exported = ExportSummary::default();
            let mut mat = MatFile::new();
            mat.insert("run", run_struct(run));
            let (mut units, mut descriptions, mut count) = (IndexMap::new(), IndexMap::new(), 0);
            let mut sums = Vec::new();
            for &table in &part.tables {
                let mut columns = MatColumns::new();
                part.each(run, table, &mut exported, |batch| {
                    count += batch.num_rows() * batch.num_columns();
                    if count > MAX_NUMBERS {
                        return Err(failed(&format!(
                            "more than {MAX_NUMBERS} numbers, the limit of a .mat export; select fewer with --set-up, --from-s \
                             and --to-s, or use --format csv, which has no limit"
                        )));
                    }
                    gather(&mut columns, &batch, table)
                })?;
                if table == RunTable::Transients && columns.is_empty() {
                    // Most runs have no transients.
                    continue;
                }
                let of_columns = |what: fn(&Meaning) -> &str| {
                    structure(columns.iter().map(|(name, (_, meaning))| (name.clone(), text(what(meaning)))))
                };
                units.insert(table.name().to_string(), of_columns(|meaning| &meaning.unit));
                if columns.values().any(|(_, meaning)| !meaning.description.is_empty()) {
                    descriptions.insert(table.name().to_string(), of_columns(|meaning| &meaning.description));
                }
                sums.push((table, columns.iter().map(|(n, (c, _))| (n.clone(), c.sum())).collect::<Vec<_>>()));
                mat.insert(table.name(), to_variable(columns));
            }
            mat.insert("units", structure(units));
            if !descriptions.is_empty() {
                mat.insert("descriptions", structure(descriptions));
            }
            save_matfile_v7(path, mat, false).map_err(|e| failed(&e))?;
            compare(path, &sums).map_err(|e| failed(&e))?;
            Ok(exported)
        })
    }
}

/// A valid MATLAB field name: a letter, then letters, digits and underscores, at most 63 characters.
fn field_name(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let mut plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if !plain.starts_with(|c: char| c.is_ascii_alphabetic()) {
        plain.insert_str(0, "x_");
    }
    plain.truncate(LONGEST_NAME);
    let shorter = &plain[..plain.len().min(LONGEST_NAME - 5)];
    let numbered = (2..).map(|n| format!("{shorter}_{n}"));
    std::iter::once(plain.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
}

fn gather(columns: &mut MatColumns, batch: &RecordBatch, table: RunTable) -> Result<(), ReadError> {
    let schema = batch.schema();
    let is_first = columns.is_empty();
    for (index, (field, array)) in schema.fields().iter().zip(batch.columns()).enumerate() {
        let kind = array.data_type();
        let read = values(array.as_ref())
            .ok_or_else(|| ReadError(format!("column `{}` has the unknown type {kind}", field.name())))?;
        if is_first {
            let is_text = matches!(kind, DataType::Utf8 | DataType::Dictionary(..));
            let column = match (is_text, table) {
                (false, _) => MatColumn::Numbers(Vec::new()),
                (true, RunTable::Results | RunTable::Transients) => MatColumn::Texts(Vec::new()),
                (true, RunTable::Samples) => MatColumn::Places(Vec::new(), Vec::new()),
            };
            let name = field_name(field.name(), |n| columns.contains_key(n));
            let meaning = Meaning { unit: unit(field).to_string(), description: description(field).to_string() };
            columns.insert(name, (column, meaning));
        }
        let Some((_, (column, _))) = columns.get_index_mut(index) else {
            return Err(ReadError(format!("column `{}` is missing in some files of the run", field.name())));
        };
        column.extend(read);
    }
    Ok(())
}

impl MatColumn {
    fn extend(&mut self, read: Vec<Value>) {
        match self {
            Self::Numbers(all) => all.extend(read.iter().map(|v| v.number().unwrap_or(f64::NAN))),
            Self::Texts(all) => all.extend(read.iter().map(Value::to_string)),
            Self::Places(all, names) => all.extend(read.into_iter().map(|value| {
                let Value::Text(name) = value else { return f64::NAN };
                let place = names.iter().rposition(|n| *n == name).unwrap_or_else(|| {
                    names.push(name);
                    names.len() - 1
                });
                (place + 1) as f64
            })),
        }
    }

    /// Length and digest of the numbers; `None` for names.
    fn sum(&self) -> Option<(usize, u64)> {
        match self {
            Self::Numbers(all) | Self::Places(all, _) => Some(sum(all)),
            Self::Texts(_) => None,
        }
    }
}

fn sum(numbers: &[f64]) -> (usize, u64) {
    let mut hasher = DefaultHasher::new();
    numbers.iter().for_each(|n| n.to_bits().hash(&mut hasher));
    (numbers.len(), hasher.finish())
}

fn structure(fields: impl IntoIterator<Item = (String, MatVariable)>) -> MatVariable {
    MatVariable::Structure(Structure::new(fields.into_iter().collect()))
}

/// An array of dimension `dim`. The constructor fails only if the number of values differs from it.
fn array(dim: [usize; 2], values: MatlabType) -> MatVariable {
    NumericArray::new(dim.to_vec(), values, None).map_or(MatVariable::Unsupported, MatVariable::NumericArray)
}

fn numbers(values: Vec<f64>) -> MatVariable {
    array([values.len(), 1], MatlabType::F64(values))
}

fn number(value: f64) -> MatVariable {
    numbers(vec![value])
}

/// A char array. The library counts characters instead of bytes, so non-ASCII characters are written as `\u{…}`.
fn text(value: &str) -> MatVariable {
    let plain: Vec<char> = value
        .chars()
        .flat_map(|c| if c.is_ascii() { c.to_string() } else { c.escape_unicode().to_string() }.into_bytes())
        .map(char::from)
        .collect();
    array([usize::from(!plain.is_empty()), plain.len()], MatlabType::UTF8(plain))
}

fn cells(values: &[String]) -> MatVariable {
    let texts = values.iter().map(|v| text(v)).collect();
    CellArray::new(vec![values.len(), 1], texts).map_or(MatVariable::Unsupported, MatVariable::CellArray)
}

fn to_variable(columns: MatColumns) -> MatVariable {
    let mut fields = IndexMap::new();
    let mut lists = Vec::new();
    for (name, (column, _)) in columns {
        let value = match column {
            MatColumn::Numbers(all) => numbers(all),
            MatColumn::Texts(all) => cells(&all),
            MatColumn::Places(all, names) => {
                lists.push((format!("{name}_names"), cells(&names)));
                numbers(all)
            }
        };
        fields.insert(name, value);
    }
    fields.extend(lists);
    structure(fields)
}

/// The struct `run`, from the manifest.
fn run_struct(run: &RunFolder) -> MatVariable {
    let m = run.manifest();
    let set_ups =
        |get: fn(&SetUpRecord) -> &String| cells(&m.set_ups.iter().map(|s| get(s).clone()).collect::<Vec<_>>());
    let mut facts = vec![
        ("id", text(&run.id())),
        ("campaign", text(&m.campaign)),
        ("started", text(&m.started)),
        ("status", text(&m.ending_text())),
        ("program", text(&m.damprig)),
        ("points_planned", number(m.points_planned as f64)),
        ("points_taken", number(m.points_taken as f64)),
        ("telemetry_rate_hz", number(m.telemetry_rate_hz)),
        ("lost_rows", number(m.counters.lost_rows as f64)),
        ("interruptions", number(m.counters.interruptions as f64)),
        ("set_up_names", set_ups(|s| &s.name)),
        ("set_up_labels", set_ups(|s| &s.label)),
        ("set_up_base_amplitudes_m", numbers(m.set_ups.iter().map(|s| s.base_amplitude_m).collect())),
        ("set_ups", set_up_struct(&m.set_ups)),
    ];
    if let Some(device) = &m.device {
        facts.extend([
            ("rig", text(&device.link)),
            ("board", text(&device.board)),
            ("firmware", text(&device.firmware)),
            ("protocol_schema", text(&device.protocol_schema)),
            ("tick_hz", number(device.tick_hz)),
        ]);
    }
    structure(facts.into_iter().map(|(name, value)| (name.to_string(), value)))
}

/// A parameter of a set-up: its name with the unit, and its value; `None` where the set-up does not have it.
type Parameter = (&'static str, fn(&SetUp) -> Option<f64>);

/// The parameters of a set-up's model.
const PARAMETERS: &[Parameter] = &[
    ("mass_kg", |s| Some(s.structure.mass_kg)),
    ("stiffness_n_per_m", |s| Some(s.structure.stiffness_n_per_m)),
    ("damping_n_s_per_m", |s| Some(s.structure.damping_n_s_per_m)),
    ("natural_frequency_hz", |s| Some(s.structure.angular_frequency_rad_per_s() / TAU)),
    ("damping_ratio", |s| Some(s.structure.damping_ratio())),
    ("gravity_m_per_s2", |s| Some(s.gravity_m_per_s2)),
    ("particle_mass_kg", |s| s.particle.map(|p| p.mass_kg)),
    ("clearance_m", |s| s.particle.map(|p| p.clearance_m)),
    ("internal_friction", |s| s.particle.map(|p| p.friction_coefficient)),
    ("restitution", |s| match s.particle?.wall {
        Wall::Restitution { coefficient } => Some(coefficient),
        Wall::Voigt { .. } => None,
    }),
    ("wall_stiffness_n_per_m", |s| match s.particle?.wall {
        Wall::Voigt { stiffness_n_per_m, .. } => Some(stiffness_n_per_m),
        Wall::Restitution { .. } => None,
    }),
    ("wall_damping_n_s_per_m", |s| match s.particle?.wall {
        Wall::Voigt { damping_n_s_per_m, .. } => Some(damping_n_s_per_m),
        Wall::Restitution { .. } => None,
    }),
    ("friction_force_n", |s| s.friction_damper.map(|d| d.force_n)),
    ("tuned_mass_kg", |s| s.tmd.map(|t| t.mass_kg)),
    ("tuned_stiffness_n_per_m", |s| s.tmd.map(|t| t.stiffness_n_per_m)),
    ("tuned_damping_n_s_per_m", |s| s.tmd.map(|t| t.damping_n_s_per_m)),
];

/// The struct `run.set_ups`: a column for each parameter in the order of `run.set_up_names`, NaN where a set-up does not have it.
fn set_up_struct(set_ups: &[SetUpRecord]) -> MatVariable {
    let columns = PARAMETERS.iter().map(|(name, value)| {
        let column = set_ups.iter().map(|s| s.model().as_ref().and_then(value).unwrap_or(f64::NAN)).collect();
        ((*name).to_string(), numbers(column))
    });
    let unmodelled = set_ups.iter().map(|s| f64::from(u8::from(s.has_unmodelled_damper))).collect();
    structure(columns.chain([("has_unmodelled_damper".to_string(), numbers(unmodelled))]))
}

type Sums = [(RunTable, Vec<(String, Option<(usize, u64)>)>)];

/// Whether the file is complete: the lengths of the variables, in tags of 8 bytes, add up from the header of 128 bytes to
/// the end of the file.
fn is_complete(path: &str) -> std::io::Result<bool> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut place = 128;
    while place + 8 <= length {
        let mut tag = [0; 8];
        file.seek(SeekFrom::Start(place))?;
        file.read_exact(&mut tag)?;
        place += 8 + u64::from(u32::from_le_bytes([tag[4], tag[5], tag[6], tag[7]]));
    }
    Ok(place == length)
}

/// Checks that the file holds the expected numbers.
fn compare(path: &str, expected: &Sums) -> Result<(), String> {
    // The reader panics on a truncated file.
    if !is_complete(path).map_err(|e| format!("it could not be read back: {e}"))? {
        return Err("the file is truncated; is the disk full?".into());
    }
    let mut mat = load_matfile(path).map_err(|e| format!("it could not be read back: {e}"))?;
    for (table, columns) in expected {
        let table = table.name();
        let Some(MatVariable::Structure(mut fields)) = mat.take(table) else {
            return Err(format!("the written file lacks `{table}`; is the disk full?"));
        };
        for (name, expected) in columns {
            let read = fields.take(name);
            let is_same = match (read, expected) {
                // An empty array has no values to compare.
                (Some(_), None | Some((0, _))) => true,
                (Some(MatVariable::NumericArray(array)), Some(expected)) => {
                    array.real_to_vec::<f64>().is_some_and(|numbers| sum(&numbers) == *expected)
                }
                _ => false,
            };
            if !is_same {
                return Err(format!("`{table}.{name}` differs in the written file; is the disk full?"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_names_are_valid_in_matlab() {
        assert_eq!(field_name("x_m", |_| false), "x_m");
        assert_eq!(field_name("2nd force (N)", |_| false), "x_2nd_force__N_");
        assert_eq!(field_name("", |_| false), "x_");
        assert_eq!(field_name("x_m", |n| n == "x_m"), "x_m_2");
        let long = field_name(&"ä".repeat(80), |n| !n.ends_with('3'));
        assert!(long.len() <= LONGEST_NAME && long.ends_with("_3"), "{long}");
    }

    #[test]
    fn a_truncated_or_changed_file_is_detected() {
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        let place = path.to_str().unwrap();
        let columns = vec![("x".to_string(), Some(sum(&[1.0, f64::NAN, -0.0])))];
        let expected = [(RunTable::Samples, columns)];
        let mut mat = MatFile::new();
        mat.insert("samples", structure([("x".to_string(), numbers(vec![1.0, f64::NAN, -0.0]))]));
        save_matfile_v7(place, mat, false).unwrap();
        assert_eq!(compare(place, &expected), Ok(()));
        let bytes = std::fs::read(place).unwrap();
        std::fs::write(place, &bytes[..bytes.len() - 9]).unwrap();
        assert!(compare(place, &expected).is_err());
        let mut changed = bytes.clone();
        let last = changed.len() - 20;
        changed[last] ^= 1;
        std::fs::write(place, &changed).unwrap();
        assert!(compare(place, &expected).is_err());
    }
}
