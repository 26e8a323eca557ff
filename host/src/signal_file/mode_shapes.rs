//! Natural modes of a modal test or a calculation: universal files (datasets 55 and 164), or a table with a row for each mode.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use nalgebra::Complex;

use super::number::{finite, fortran};
use super::uff::{self, TextDataset};
use crate::failure::Failure;
use crate::input::regular;

type C64 = Complex<f64>;

/// Phases of a complex shape further than this from a common line are told: a real mode takes the parts along it, and loses this share of the
/// shape's square.
const COMPLEX_SHARE: f64 = 0.01;

/// Columns of a table besides those of the places.
const FREQUENCY: &str = "frequency_hz";
const DAMPING: &str = "damping_ratio";
const PARTICIPATION: &str = "participation_root_kg";

/// A natural mode.
#[derive(Clone, Debug, PartialEq)]
pub struct TestedMode {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Displacement of each degree of freedom for a modal mass of 1 kg, 1/√kg, by name.
    pub shape_per_root_kg: BTreeMap<String, f64>,
    /// Participation in a motion of the base, √kg, where the file has it.
    pub participation_root_kg: Option<f64>,
}

/// The modes of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ModalTest {
    /// In the order of their frequencies.
    pub modes: Vec<TestedMode>,
    /// Names of the degrees of freedom that every mode has and one moves: a node and a direction, `12:z`, or the columns of a table.
    pub freedoms: Vec<String>,
    /// What was assumed or left out, for people.
    pub remarks: Vec<String>,
}

impl ModalTest {
    /// Reads a file.
    ///
    /// # Errors
    /// Names the file, the place, what was found there, and what is needed.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let file = path.display();
        let bytes =
            regular::read_input(path).map_err(|error| Failure::Input(format!("cannot read {file}: {error}")))?;
        let read = if uff::is_one(&bytes) { of_uff(&bytes) } else { of_table(&bytes) };
        let mut test = read.map_err(|why| Failure::Input(format!("{file}: {why}")))?;
        test.modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        Ok(test)
    }

    /// From modes, which need not have the same degrees of freedom.
    fn of(modes: Vec<TestedMode>, mut remarks: Vec<String>) -> Self {
        let has = |name: &&String| modes.iter().all(|mode| mode.shape_per_root_kg.contains_key(*name));
        let all: Vec<&String> = modes.first().map_or(Vec::new(), |first| first.shape_per_root_kg.keys().collect());
        let moves = |name: &&String| modes.iter().any(|mode| mode.shape_per_root_kg[*name] != 0.0);
        let freedoms: Vec<String> = all.iter().copied().filter(has).filter(moves).cloned().collect();
        if freedoms.len() < all.len() {
            let count = all.len() - freedoms.len();
            remarks.push(format!("{count} degrees of freedom are not in every mode, or at rest in all, and left out."));
        }
        Self { modes, freedoms, remarks }
    }
}

/// The modes of a table: `frequency_hz`, `damping_ratio`, maybe `participation_root_kg`, and a column for each place.
fn of_table(bytes: &[u8]) -> Result<ModalTest, String> {
    let needed = "a modal test is a universal file with datasets 55, or a table (CSV) with the columns frequency_hz, damping_ratio and \
                  one for each place, in 1/√kg for a modal mass of 1 kg";
    if bytes.contains(&0) {
        return Err(format!("this is no text\n  {needed}"));
    }
    let text = String::from_utf8_lossy(bytes);
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let header: Vec<String> = match reader.headers() {
        Ok(header) => header.iter().map(str::to_string).collect(),
        Err(error) => return Err(format!("it cannot be read as a table: {error}\n  {needed}")),
    };
    if header.iter().all(String::is_empty) {
        return Err(format!("it has no columns\n  {needed}"));
    }
    if let Some((_, twice)) = header.iter().enumerate().find(|(n, name)| header[..*n].contains(name)) {
        return Err(format!("two columns have the name {twice:?}; give each place one of its own"));
    }
    for column in [FREQUENCY, DAMPING] {
        if !header.iter().any(|name| name == column) {
            return Err(format!("it has no column {column}; it has {}\n  {needed}", header.join(", ")));
        }
    }
    let mut modes = Vec::new();
    for (line, record) in (2..).zip(reader.records()) {
        let record = record.map_err(|error| format!("line {line}: {error}"))?;
        let mut mode = TestedMode {
            frequency_hz: f64::NAN,
            damping_ratio: f64::NAN,
            shape_per_root_kg: BTreeMap::new(),
            participation_root_kg: None,
        };
        for (name, field) in header.iter().zip(&record) {
            let value = finite(field).ok_or_else(|| format!("line {line}, {name}: {field:?} is no finite number"))?;
            match name.as_str() {
                FREQUENCY => mode.frequency_hz = value,
                DAMPING => mode.damping_ratio = value,
                PARTICIPATION => mode.participation_root_kg = Some(value),
                _ => {
                    mode.shape_per_root_kg.insert(name.clone(), value);
                }
            }
        }
        is_mode(&mode).map_err(|why| format!("line {line}: {why}"))?;
        modes.push(mode);
    }
    if modes.is_empty() || modes[0].shape_per_root_kg.is_empty() {
        return Err(format!("it has no mode, or no place\n  {needed}"));
    }
    Ok(ModalTest::of(modes, Vec::new()))
}

/// Why a mode has no vibration.
fn is_mode(mode: &TestedMode) -> Result<(), String> {
    if mode.frequency_hz <= 0.0 {
        return Err(format!("a frequency of {} Hz is no vibration; leave out rigid motions", mode.frequency_hz));
    }
    if !(0.0..1.0).contains(&mode.damping_ratio) {
        return Err(format!("a damping ratio of {} must be 0 or greater and below 1", mode.damping_ratio));
    }
    Ok(())
}

/// The modes of the datasets 55 of a universal file.
fn of_uff(bytes: &[u8]) -> Result<ModalTest, String> {
    let datasets = uff::text_datasets(bytes);
    let per_mass = datasets.iter().find(|set| set.kind == 164).map(|set| units(&set.lines)).transpose()?;
    let mut remarks = Vec::new();
    if per_mass.is_none() {
        remarks.push("Without a dataset 164 the units are taken to be SI: modal masses in kg.".to_string());
    }
    let mut modes = Vec::new();
    for TextDataset { place, lines, is_whole, .. } in datasets.iter().filter(|set| set.kind == 55) {
        let within = |why: String| format!("dataset {place} (55): {why}");
        if !is_whole {
            return Err(within("the file ends within it\n  export it again".into()));
        }
        if let Some(mode) = mode_of(lines, per_mass.unwrap_or(1.0), &mut remarks).map_err(within)? {
            modes.push(mode);
        } else {
            remarks.push(format!("Dataset {place} (55) holds no mode and is left out."));
        }
    }
    if modes.is_empty() {
        return Err(
            "it has no mode: datasets 55 of a normal or complex mode\n  export the mode shapes of the test as UFF 55"
                .into(),
        );
    }
    Ok(ModalTest::of(modes, remarks))
}

/// Kilograms per unit of mass from a dataset 164, whose factors divide a value to give SI.
fn units(lines: &[&str]) -> Result<f64, String> {
    let mut factors = Vec::new();
    for line in &lines[1.min(lines.len())..] {
        fortran(line, 0, &mut factors).map_err(|why| format!("dataset 164: {why}"))?;
    }
    match factors[..] {
        [length, force, ..] if length > 0.0 && force > 0.0 => Ok(length / force),
        _ => Err("dataset 164: it has no factors of length and force".into()),
    }
}

/// A mode from the lines of a dataset 55; `None` of other results at nodes. `per_mass`: kg per unit of mass.
fn mode_of(lines: &[&str], per_mass: f64, remarks: &mut Vec<String>) -> Result<Option<TestedMode>, String> {
    let numbers = |at: usize| -> Result<Vec<f64>, String> {
        let line = lines.get(at).ok_or_else(|| format!("it ends before its line {}", at + 1))?;
        let mut numbers = Vec::new();
        fortran(line, 0, &mut numbers).map_err(|why| format!("line {}: {why}", at + 1))?;
        Ok(numbers)
    };
    let kind = numbers(5)?;
    let [_, analysis, _, quantity, data, per_node, ..] = kind[..] else {
        return Err("line 6: it must have six numbers that say what the data are".into());
    };
    let is_complex = data == 5.0;
    let quantity_of = [(8.0, 0), (11.0, 1), (12.0, 2)];
    let order = quantity_of.iter().find(|(code, _)| *code == quantity).map(|(_, order)| *order);
    let Some(order) = order.filter(|_| [2.0, 3.0, 7.0].contains(&analysis)) else { return Ok(None) };
    let values = numbers(7)?;
    // The eigenvalue, and what scales a shape to a modal mass of 1: φ = ψ √scale.
    let (eigenvalue, scale) = match values[..] {
        [frequency_hz, mass, viscous, hysteretic, ..] if analysis == 2.0 => {
            if mass <= 0.0 {
                return Err(format!(
                    "line 8: a modal mass of {mass} leaves the shape without a scale\n  export it scaled to a modal mass of 1"
                ));
            }
            // At resonance a loss factor acts as twice this ratio.
            let ratio = if viscous == 0.0 { 0.5 * hysteretic } else { viscous };
            let omega = TAU * frequency_hz;
            let eigenvalue = C64::new(-ratio * omega, omega * (1.0 - ratio * ratio).max(0.0).sqrt());
            (eigenvalue, C64::from(1.0 / (mass * per_mass)))
        }
        [re, im, a_re, a_im, ..] if analysis != 2.0 => {
            let (eigenvalue, modal_a) = (C64::new(re, im), C64::new(a_re, a_im));
            if modal_a.norm() == 0.0 {
                return Err(
                    "line 8: a modal A of 0 leaves the shape without a scale\n  export it with its scale".into()
                );
            }
            // ψψᵀ/a is the residue, of a mode with real shape φφᵀ/(2jω_d).
            (eigenvalue, C64::new(0.0, 2.0 * im) / (modal_a * per_mass))
        }
        _ => return Err("line 8: it must have the frequency, the modal mass and the damping of the mode".into()),
    };
    let mut shape: BTreeMap<String, C64> = BTreeMap::new();
    let (per_node, parts) = (per_node as usize, if is_complex { 2 } else { 1 });
    let mut at = 8;
    while at < lines.len() && !lines[at].trim().is_empty() {
        let node = numbers(at)?;
        let [node] = node[..] else { return Err(format!("line {}: it must be the number of a node", at + 1)) };
        let mut own = Vec::new();
        at += 1;
        while own.len() < per_node * parts {
            own.extend(numbers(at)?);
            at += 1;
        }
        for (direction, value) in ["x", "y", "z"].into_iter().zip(own.chunks(parts)) {
            let value = C64::new(value[0], value.get(1).copied().unwrap_or(0.0));
            // Of velocities and accelerations, displacements.
            shape.insert(format!("{node}:{direction}"), value * scale.sqrt() / eigenvalue.powi(order));
        }
    }
    let (angle, across) = common_line(shape.values());
    if across > COMPLEX_SHARE {
        remarks.push(format!(
            "The mode of {:.4} Hz is complex: {:.0} % of its shape is out of phase and left out.",
            eigenvalue.norm() / TAU,
            100.0 * across.sqrt()
        ));
    }
    let along = C64::from_polar(1.0, -angle);
    let mode = TestedMode {
        frequency_hz: eigenvalue.norm() / TAU,
        damping_ratio: -eigenvalue.re / eigenvalue.norm(),
        shape_per_root_kg: shape.into_iter().map(|(name, value)| (name, (value * along).re)).collect(),
        participation_root_kg: None,
    };
    is_mode(&mode)?;
    Ok(Some(mode))
}

/// The phase of the line through 0 that is nearest to all values, and which share of their square is across it.
fn common_line<'a>(values: impl Iterator<Item = &'a C64>) -> (f64, f64) {
    let (mut square, mut whole) = (C64::from(0.0), 0.0);
    for value in values {
        square += value * value;
        whole += value.norm_sqr();
    }
    // Real shapes keep their signs.
    let angle = if square.norm() == 0.0 || square.arg().abs() < 1e-9 { 0.0 } else { 0.5 * square.arg() };
    let across = if whole == 0.0 { 0.0 } else { 0.5 * (1.0 - square.norm() / whole) };
    (angle, across)
}
