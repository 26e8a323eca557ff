//! The text of a new campaign or case: its keys with their meaning as comments, as `damprig init` writes it.

use std::collections::BTreeSet;

use damprig_core::model::Material;

use super::{FileKind, kinds_at};
use crate::input::key::{KeyedQuantity, Table};

/// What is mounted in a set-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MountedDamper {
    /// Nothing.
    Bare,
    /// A single-particle impact damper.
    Spid,
    /// A friction damper.
    Fd,
    /// Both.
    Hybrid,
    /// A tuned mass damper.
    Tmd,
}

impl MountedDamper {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Bare, Self::Spid, Self::Fd, Self::Hybrid, Self::Tmd];

    /// Name and label of its set-up.
    pub(crate) const fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Bare => ("bare", "Bare structure"),
            Self::Spid => ("spid", "SPID"),
            Self::Fd => ("fd", "FD"),
            Self::Hybrid => ("hybrid", "Hybrid (SPID + FD)"),
            Self::Tmd => ("tmd", "TMD"),
        }
    }

    const fn has_particle(self) -> bool {
        matches!(self, Self::Spid | Self::Hybrid)
    }

    const fn has_friction(self) -> bool {
        matches!(self, Self::Fd | Self::Hybrid)
    }
}

/// What moves the structure: an experiment of a campaign, the excitation of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Excitation {
    /// One frequency after another; in a case one sine at resonance.
    SteppedSine,
    /// A release.
    FreeVibration,
    /// A pulse of the base.
    Impulse,
    /// Band-limited noise of the base.
    Noise,
    /// The recorded motion of [`CaseValues::record`].
    Record,
}

impl Excitation {
    /// All that need no file.
    pub const ALL: [Self; 4] = [Self::SteppedSine, Self::FreeVibration, Self::Impulse, Self::Noise];
}

/// The simulated sensors of a campaign.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sensors {
    /// Steps of 10 µm and white noise.
    #[default]
    Noisy,
    /// No errors.
    Ideal,
    /// White noise, and the errors of a data sheet.
    DataSheet,
}

/// A recorded motion of the base.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordFile {
    /// Path, relative to the new file.
    pub file: String,
    /// `acceleration` or `displacement`; none for an AT2 file, which says it.
    pub quantity: Option<String>,
    /// Unit of the values; none for an AT2 file.
    pub unit: Option<String>,
}

/// Values of the structure and its dampers.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseValues {
    /// M, kg.
    pub mass_kg: f64,
    /// fn, Hz.
    pub natural_frequency_hz: f64,
    /// ζ.
    pub damping_ratio: f64,
    /// Z, m.
    pub base_amplitude_m: f64,
    /// Z of set-ups that would move too far with that one.
    pub fitted: Vec<Fitted>,
    /// m/M of particle and tuned mass.
    pub mass_ratio: f64,
    /// d/Z.
    pub clearance_ratio: f64,
    /// d, m, in place of d/Z.
    pub clearance_m: Option<f64>,
    /// e.
    pub restitution: f64,
    /// Material of soft walls; none for hard ones.
    pub wall: Option<Material>,
    /// γF.
    pub friction_ratio: f64,
    /// Whether the rig adjusts the friction damper's spring.
    pub has_spring: bool,
    /// Errors of a campaign's simulated sensors.
    pub sensors: Sensors,
    /// The recorded motion of [`Excitation::Record`].
    pub record: RecordFile,
}

/// The base amplitude of a set-up that would move too far with [`CaseValues::base_amplitude_m`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fitted {
    /// Its damper.
    pub damper: MountedDamper,
    /// Its Z, m.
    pub base_amplitude_m: f64,
    /// Predicted largest |x| with the Z of the others, m.
    pub max_x_m: f64,
}

impl Default for CaseValues {
    /// The rig of the source document.
    fn default() -> Self {
        Self {
            mass_kg: 1.6,
            natural_frequency_hz: 2.5,
            damping_ratio: 0.0038,
            base_amplitude_m: 0.0015,
            fitted: Vec::new(),
            mass_ratio: 0.1,
            clearance_ratio: 5.0,
            clearance_m: None,
            restitution: 0.47,
            wall: None,
            friction_ratio: 0.6,
            has_spring: false,
            sensors: Sensors::Noisy,
            record: RecordFile::default(),
        }
    }
}

/// Displacement at a release, m.
const START_M: f64 = 0.035;

/// Periods that are measured at each frequency.
pub(super) const DWELL_PERIODS: f64 = 80.0;

/// Periods and length (s, at most) of noise, and its band in natural frequencies.
const NOISE_PERIODS: f64 = 145.0;
const LONGEST_NOISE_S: f64 = 58.0;
const NOISE_FROM: f64 = 0.2;
const NOISE_TO: f64 = 4.0;

/// Highest frequency of noise, Hz.
const NOISE_UP_TO_HZ: f64 = 50.0;

/// Periods that are measured after a release or a pulse.
const FREE_PERIODS: f64 = 20.0;

impl CaseValues {
    /// Length of noise, s.
    fn noise_s(&self) -> f64 {
        self.periods_s(NOISE_PERIODS).min(LONGEST_NOISE_S)
    }

    /// A number of natural periods, s, in three digits.
    pub(super) fn periods_s(&self, periods: f64) -> f64 {
        three_digits(periods / self.natural_frequency_hz)
    }
}

impl RecordFile {
    /// Its keys.
    fn keys(&self) -> Vec<(&'static str, String)> {
        let mut keys = vec![("file", text(&self.file))];
        keys.extend(self.quantity.iter().map(|quantity| ("quantity", text(quantity))));
        keys.extend(self.unit.iter().map(|unit| ("unit", text(unit))));
        keys
    }
}

pub(super) fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// The text of a campaign with a set-up for each damper.
#[must_use]
pub fn campaign(name: &str, dampers: &[MountedDamper], experiments: &[Excitation], values: &CaseValues) -> String {
    let mut file = TableWriter::new(FileKind::Campaign);
    file.line("# A campaign, written by `damprig init`. `damprig keys` has all keys. Next:");
    file.line("#   damprig run FILE --dry-run    check it and predict displacements");
    file.line("#   damprig run FILE              run it on the virtual rig; --rig auto: on the connected board");
    file.line("");
    file.keys("", None, &[("name", text(name))]);
    file.structure(values);
    file.sensors(values.sensors);
    for damper in dampers {
        let (name, label) = damper.names();
        file.table("[set_up]", None);
        let fitted = values.fitted.iter().find(|fitted| fitted.damper == *damper);
        if let Some(Fitted { max_x_m, .. }) = fitted {
            let whole = number(values.base_amplitude_m);
            file.line(&format!(
                "# With base_amplitude_m = {whole} the predicted largest |x| is {:.0} mm.",
                max_x_m * 1e3
            ));
        }
        let z = number(fitted.map_or(values.base_amplitude_m, |fitted| fitted.base_amplitude_m));
        file.keys("set_up", None, &[("name", text(name)), ("label", text(label)), ("base_amplitude_m", z)]);
        file.damper("set_up.", *damper, values);
    }
    for experiment in experiments {
        file.experiment(*experiment, values);
    }
    file.table("telemetry", None);
    file.line("# Every tick of x and z: `damprig compare` simulates each point on the base motion as measured.");
    file.keys("telemetry", None, &[("rate_hz", "1000".into()), ("signals", "[\"x\", \"z\"]".into())]);
    file.text
}

/// The text of a case.
#[must_use]
pub fn case(name: &str, damper: MountedDamper, excitation: Excitation, values: &CaseValues) -> String {
    let mut file = TableWriter::new(FileKind::Case);
    file.line("# A case, written by `damprig init`. `damprig keys` has all keys. Next:");
    file.line("#   damprig simulate FILE --plot FIGURE.svg");
    let mut top = vec![("name", text(name))];
    let has_amplitude = matches!(excitation, Excitation::SteppedSine | Excitation::Impulse);
    if !has_amplitude && (damper.has_particle() || damper.has_friction()) {
        // Ratios refer to it.
        top.push(("base_amplitude_m", number(values.base_amplitude_m)));
    }
    file.line("");
    file.keys("", None, &top);
    file.structure(values);
    file.damper("", damper, values);
    let (z, frequency) = (number(values.base_amplitude_m), number(values.natural_frequency_hz));
    let periods = match excitation {
        Excitation::SteppedSine => {
            file.table("base", Some("sine"));
            file.keys("base", Some("sine"), &[("kind", text("sine")), ("amplitude_m", z), ("frequency_hz", frequency)]);
            100.0
        }
        Excitation::Impulse => {
            let duration = number(values.periods_s(0.5));
            file.table("base", Some("versine"));
            file.keys(
                "base",
                Some("versine"),
                &[("kind", text("versine")), ("amplitude_m", z), ("duration_s", duration)],
            );
            FREE_PERIODS
        }
        Excitation::Noise => {
            file.table("base", Some("record"));
            file.keys("base", Some("record"), &[("kind", text("record")), ("target_peak_m", z)]);
            file.noise("base.noise", values);
            (values.noise_s() * values.natural_frequency_hz) + FREE_PERIODS
        }
        Excitation::Record => {
            file.table("base", Some("record"));
            let mut keys = vec![("kind", text("record"))];
            keys.extend(values.record.keys());
            file.keys("base", Some("record"), &keys);
            FREE_PERIODS
        }
        Excitation::FreeVibration => {
            file.table("initial", None);
            file.keys("initial", None, &[("x_m", number(START_M))]);
            FREE_PERIODS
        }
    };
    file.table("run", None);
    file.keys("run", None, &[("duration_s", number(values.periods_s(periods)))]);
    file.text
}

pub(super) fn number(value: f64) -> String {
    format!("{value:?}")
}

fn text(value: &str) -> String {
    format!("{value:?}")
}

/// Longest entry beside which its meaning stands, in characters; that of a longer one has a line of its own above it.
const LONG_ENTRY: usize = 48;

/// Writes tables whose keys have their meaning as a comment where they come first.
struct TableWriter {
    tables: Vec<Table>,
    text: String,
    explained: BTreeSet<(String, &'static str)>,
}

impl TableWriter {
    fn new(file: FileKind) -> Self {
        Self { tables: file.tables(), text: String::new(), explained: BTreeSet::new() }
    }

    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// The header of a table, under its meaning where it comes first. A path in brackets is an item of a list.
    fn table(&mut self, path: &str, kind: Option<&str>) {
        let declared = path.trim_matches(['[', ']']);
        let declared = declared.strip_prefix("set_up.").unwrap_or(declared).to_string();
        let doc = self.declared(&declared, kind).first().map(|table| table.doc);
        self.text.push('\n');
        if let Some(doc) = doc.filter(|_| self.explained.insert((declared.clone(), kind_key(&self.tables, kind)))) {
            self.line(&format!("# {doc}"));
        }
        self.line(&format!("[{path}]"));
    }

    /// The tables at a path of a kind, that of the kind first.
    fn declared(&self, path: &str, kind: Option<&str>) -> Vec<Table> {
        let kinds = kinds_at(&self.tables, path).into_iter().find(|(of, _)| *of == kind);
        let mut tables = kinds.map(|(_, tables)| tables).unwrap_or_default();
        tables.sort_by_key(|table| table.kind != kind);
        tables
    }

    /// Keys of a table with their values.
    fn keys(&mut self, path: &str, kind: Option<&str>, keys: &[(&'static str, String)]) {
        let path = path.strip_prefix("set_up.").unwrap_or(path);
        let quantities: Vec<&KeyedQuantity> =
            self.declared(path, kind).iter().flat_map(|table| table.quantities).collect();
        let lengths = keys.iter().map(|(key, value)| key.len() + value.chars().count() + 3);
        let width = lengths.filter(|length| *length <= LONG_ENTRY).max().unwrap_or(0);
        for (key, value) in keys {
            let entry = format!("{key} = {value}");
            let quantity = quantities.iter().find(|quantity| quantity.key(key).is_some());
            let meaning = quantity.and_then(|quantity| meaning(quantity, key));
            match meaning.filter(|_| self.explained.insert((path.to_string(), key))) {
                Some(meaning) if entry.chars().count() > LONG_ENTRY => self.line(&format!("# {meaning}\n{entry}")),
                Some(meaning) => self.line(&format!("{entry:width$}    # {meaning}")),
                None => self.line(&entry),
            }
        }
    }

    fn structure(&mut self, values: &CaseValues) {
        self.table("structure", None);
        let structure = [
            ("mass_kg", number(values.mass_kg)),
            ("natural_frequency_hz", number(values.natural_frequency_hz)),
            ("damping_ratio", number(values.damping_ratio)),
        ];
        self.keys("structure", None, &structure);
    }

    fn sensors(&mut self, sensors: Sensors) {
        let noise = [("sensor_noise_rms_m", number(5e-6)), ("noise_seed", "1".into())];
        let (keys, kind) = match sensors {
            Sensors::Noisy => ([&[("sensor_resolution_m", number(1e-5))][..], &noise].concat(), None),
            Sensors::Ideal => (vec![], Some("ideal")),
            Sensors::DataSheet => (noise.to_vec(), Some("data_sheet")),
        };
        if !keys.is_empty() {
            self.table("rig", None);
            self.keys("rig", None, &keys);
        }
        if let Some(kind) = kind {
            self.table("rig.sensors", Some(kind));
            self.keys("rig.sensors", Some(kind), &[("kind", text(kind))]);
        }
    }

    /// The tables of a damper, below `prefix`.
    fn damper(&mut self, prefix: &str, damper: MountedDamper, values: &CaseValues) {
        let mass = ("mass_ratio", number(values.mass_ratio));
        if damper.has_particle() {
            self.table(&format!("{prefix}particle"), None);
            let clearance = match values.clearance_m {
                Some(clearance_m) => ("clearance_m", number(clearance_m)),
                None => ("clearance_ratio", number(values.clearance_ratio)),
            };
            self.keys("particle", None, &[mass.clone(), clearance, ("friction_coefficient", number(0.0))]);
            let (kind, keys) = match values.wall {
                None => ("restitution", vec![("coefficient", number(values.restitution))]),
                Some(material) => {
                    let material = ("material", text(material.name()));
                    ("voigt", vec![material, ("law", text("contact")), ("release", text("zero_force"))])
                }
            };
            let path = "particle.wall";
            self.table(&format!("{prefix}{path}"), Some(kind));
            self.keys(path, Some(kind), &[vec![("kind", text(kind))], keys].concat());
        }
        if damper.has_friction() {
            let path = if values.has_spring { "friction_damper.spring" } else { "friction_damper" };
            self.table(&format!("{prefix}{path}"), None);
            self.keys(path, None, &[("friction_ratio", number(values.friction_ratio))]);
        }
        if damper == MountedDamper::Tmd {
            self.table(&format!("{prefix}tmd"), None);
            self.keys("tmd", None, &[mass, ("tuning", text("warburton"))]);
        }
    }

    /// The table of noise.
    fn noise(&mut self, path: &str, values: &CaseValues) {
        let band = |part: f64| number(three_digits(part * values.natural_frequency_hz).min(NOISE_UP_TO_HZ));
        self.table(path, None);
        let keys = [
            ("seed", "1".into()),
            ("from_hz", band(NOISE_FROM)),
            ("to_hz", band(NOISE_TO)),
            ("duration_s", number(values.noise_s())),
        ];
        self.keys(path, None, &keys);
    }

    fn experiment(&mut self, experiment: Excitation, values: &CaseValues) {
        let (kind, name) = match experiment {
            Excitation::SteppedSine => ("stepped_sine", "sweep"),
            Excitation::FreeVibration => ("free_vibration", "release"),
            Excitation::Impulse => ("impulse", "pulse"),
            Excitation::Noise => ("playback", "noise"),
            Excitation::Record => ("playback", "record"),
        };
        let mut keys = vec![("name", text(name)), ("kind", text(kind))];
        let after = number(values.periods_s(FREE_PERIODS));
        match experiment {
            Excitation::SteppedSine => {
                let grid = values.grid();
                keys.extend([
                    ("frequencies_hz", grid),
                    ("start", text("from_rest")),
                    ("settle_s", number(0.0)),
                    ("dwell_s", number(values.periods_s(DWELL_PERIODS))),
                ]);
            }
            Excitation::FreeVibration => {
                keys.extend([("start_m", number(START_M)), ("measure_s", after), ("cycles", "10".into())]);
            }
            Excitation::Impulse => keys.extend([
                ("shape", text("versine")),
                ("amplitude_m", number(values.base_amplitude_m)),
                ("duration_s", number(values.periods_s(0.5))),
                ("tail_s", after),
            ]),
            Excitation::Noise => {
                keys.extend([("target_peak_m", number(values.base_amplitude_m)), ("tail_s", after)]);
            }
            Excitation::Record => {
                // As recorded: without a target nothing is scaled.
                keys.extend(values.record.keys());
                keys.push(("tail_s", after));
                // An acceleration has its baseline removed, so that the base begins and ends at rest.
                let is_displacement = values.record.quantity.as_deref() == Some("displacement");
                keys.extend(is_displacement.then(|| ("ramp_s", number(values.periods_s(0.5)))));
            }
        }
        self.table("[experiment]", Some(kind));
        self.keys("experiment", Some(kind), &keys);
        if experiment == Excitation::Noise {
            self.noise("experiment.noise", values);
        }
        if experiment == Excitation::SteppedSine {
            self.table("experiment.steady", None);
            self.keys("experiment.steady", None, &[("longest_dwell_s", number(values.longest_dwell_s()))]);
        }
    }
}

/// The kind as the tables declare it.
fn kind_key(tables: &[Table], kind: Option<&str>) -> &'static str {
    tables.iter().find_map(|table| table.kind.filter(|of| Some(*of) == kind)).unwrap_or("")
}

/// The meaning of a key, and the keys of the same quantity.
fn meaning(quantity: &KeyedQuantity, key: &str) -> Option<String> {
    let mut text = quantity.key(key)?.doc.to_string();
    let others: Vec<&str> = quantity.keys.iter().map(|other| other.name).filter(|other| *other != key).collect();
    if !others.is_empty() {
        text.push_str(&format!("; or {}", others.join(", ")));
    }
    Some(text)
}
