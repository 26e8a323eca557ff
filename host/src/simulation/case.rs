//! The case file: a set-up, what excites it, where it starts and how long it runs. TOML or JSON, the same keys.

use std::f64::consts::TAU;
use std::path::Path;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Initial, SetUp, Wall};

use super::excitation::{self, Loading};
use super::json_case;
use super::keys::case;
use crate::input::{Problem, Refusal, Section, Source};
use crate::motion_record::{Record, resolve};
use crate::setup::{self, BASE_AMPLITUDE, BaseAmplitude, SetUpSpec, Shared};

/// A case as read and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What plots call it.
    pub name: String,
    /// Structure and dampers.
    pub set_up: SetUp,
    /// What moves it; nothing when there is a record.
    pub excitation: Excitation,
    /// The recorded base motion that it is played on.
    pub record: Option<Record>,
    /// Where it starts.
    pub initial: Initial,
    /// How long, and what is wanted.
    pub run: RunSpec,
}

/// The `run` table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunSpec {
    /// Length of the run, s; greater than 0.
    pub duration_s: f64,
    /// Instants at which the state is wanted, s, in rising order within the run.
    pub sample_times_s: Vec<f64>,
    /// Length of a cycle, s.
    pub cycle_s: Option<f64>,
    /// First cycle that counts as steady.
    pub steady_from_cycle: Option<u64>,
}

impl Case {
    /// Reads a file.
    ///
    /// # Errors
    /// All problems of the file in one answer: file, line, key, value, what is allowed, the likely fix.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        let source = Source::read(path)?;
        let name = path.file_stem().map_or_else(|| "case".into(), |s| s.to_string_lossy().to_string());
        Self::parse(&source, &name)
    }

    /// Reads a text that is at hand; `name` is used when the text gives none.
    ///
    /// # Errors
    /// As [`Case::read`].
    pub fn parse(source: &Source, name: &str) -> Result<Self, Refusal> {
        let case = read(source, name);
        source.verdict()?;
        // Readers return nothing only after noting why.
        case.ok_or_else(|| Refusal(format!("{name}: the case could not be read")))
    }

    /// The structure's natural period, s.
    #[must_use]
    pub fn natural_period_s(&self) -> f64 {
        TAU / self.set_up.structure.angular_frequency_rad_per_s()
    }

    /// Whether the particle meets soft walls.
    #[must_use]
    pub fn has_soft_wall(&self) -> bool {
        self.set_up.particle.is_some_and(|p| matches!(p.wall, Wall::Voigt { .. }))
    }

    /// The length by which displacements are measured, and its sign for people: Z of a sine or a pulse, x0 of a free
    /// vibration; none for a record, a force or a rest.
    #[must_use]
    pub fn reference_m(&self) -> Option<(f64, &'static str)> {
        let reference = match self.excitation {
            Excitation::Sine { amplitude_m, .. }
            | Excitation::HalfSine { amplitude_m, .. }
            | Excitation::Versine { amplitude_m, .. } => (amplitude_m.abs(), "Z"),
            Excitation::Fixed if self.record.is_none() => (self.initial.x_m.abs(), "x0"),
            _ => return None,
        };
        (reference.0 > 0.0).then_some(reference)
    }

    /// The cycle by which the case is looked at: its own, the drive's, or the natural period, s.
    #[must_use]
    pub fn cycle_s(&self) -> f64 {
        self.run.cycle_s.unwrap_or_else(|| match self.excitation {
            Excitation::Sine { angular_frequency_rad_per_s, .. }
            | Excitation::ForceSine { angular_frequency_rad_per_s, .. } => TAU / angular_frequency_rad_per_s,
            _ => self.natural_period_s(),
        })
    }
}

fn read(source: &Source, name: &str) -> Option<Case> {
    if is_json(source) {
        // JSON that is sound may still say what TOML has no word for: a number of 20 digits, a key twice.
        return source.read_toml(&json_case::to_toml(source)?, "this cannot be taken", |root| read_root(root, name));
    }
    source.read_toml(source.text(), "this is not TOML", |root| read_root(root, name))
}

fn read_root(root: &Section, name: &str) -> Option<Case> {
    let name = root.text_of(&case::NAME).map_or_else(|| name.to_string(), |text| text.value);
    let stated_m = root.scalar(&BASE_AMPLITUDE);
    let loading = read_loading(root, stated_m);
    let record = match &loading {
        Some(Loading::Recorded(record)) => Some(record),
        _ => None,
    };
    let base = loading.as_ref().map_or(BaseAmplitude::Unread, |loading| base_amplitude(loading, stated_m));
    let spec = setup::read(root, &Shared::default(), base, record.map(|record| record.step_s));
    let z_m = if let BaseAmplitude::Is(z_m) = base { z_m } else { 0.0 };
    let start_m = spec.filter(SetUpSpec::places_particle).map(|spec| spec.particle_start_m(z_m));
    let initial_section = root.table_of(&case::INITIAL, None);
    let initial = excitation::initial(initial_section.as_ref(), record.map_or(0.0, Record::start_m), start_m);
    let run_section = root.table_of(&case::RUN, None);
    let run = run_section.as_ref().and_then(|s| excitation::run(s, record.map(Record::duration_s)));
    let (spec, loading, run) = (spec?, loading?, run?);
    if stated_m.is_some() && !spec.is_relative() && loading.amplitude_m().is_none() {
        let help = "write base = { kind = \"sine\", frequency_hz = … } for a base that moves by it, or leave it out";
        root.reject(BASE_AMPLITUDE.name(), "nothing refers to it: no ratio, no moving base", Some(help.into()));
    }
    let (excitation, record) = match loading {
        Loading::Closed(excitation) => (excitation, None),
        Loading::Recorded(record) => (Excitation::Fixed, Some(record)),
    };
    let set_up = spec.at(z_m);
    for invalid in [set_up.validate(), excitation.validate(), set_up.validate_initial(&initial)] {
        let Err(invalid) = invalid else { continue };
        // What only the model can tell: a particle outside its cavity.
        let place = initial_section.as_ref().filter(|_| invalid.parameter == "initial.y_m");
        root.source().report(Problem {
            title: format!("`{}` = {} is not allowed", invalid.parameter, invalid.value),
            span: place.map_or(root.span(), |section| section.span_of("y_m")),
            allowed: format!("must be {}", invalid.allowed),
            help: None,
        });
    }
    let case = Case { name, set_up, excitation, record, initial, run };
    if let Some(section) = &run_section {
        check_cycle(section, &case);
    }
    Some(case)
}

/// What moves it: a base or a force.
fn read_loading(root: &Section, stated_m: Option<f64>) -> Option<Loading> {
    let beside = |file: &str| resolve(Path::new(root.source().name()), file);
    let base = root.table_of(&case::BASE, None).map(|s| excitation::base(&s, stated_m, &beside));
    let force = root.table_of(&case::FORCE, None).map(|s| (s.span(), excitation::force(&s)));
    let fixed = Loading::Closed(Excitation::Fixed);
    let Some((span, force)) = force else { return base.unwrap_or(Some(fixed)) };
    if base.is_some_and(|base| base.is_some_and(|base| base != fixed)) {
        root.source().report(Problem {
            title: "`force` and a moving `base` are both given".into(),
            span,
            allowed: "one or the other: a force acts on the structure over a fixed base".into(),
            help: Some("write base = {kind = \"fixed\"}, or leave out `force`".into()),
        });
    }
    force.map(Loading::Closed)
}

/// Z: what the base moves by, or else what the set-up states.
fn base_amplitude(loading: &Loading, stated_m: Option<f64>) -> BaseAmplitude {
    match (loading.amplitude_m(), stated_m) {
        (Some(0.0), _) => BaseAmplitude::Absent("the base's amplitude is 0"),
        (Some(z_m), _) | (None, Some(z_m)) => BaseAmplitude::Is(z_m),
        (None, None) if matches!(loading, Loading::Recorded(_)) => BaseAmplitude::Absent("a record has no amplitude"),
        (None, None) => BaseAmplitude::Absent("the base of this case is fixed"),
    }
}

/// The shortest cycle that makes sense, as a share of the period of structure or drive.
const LEAST_CYCLE: f64 = 1e-6;

/// Refuses a cycle so short that closing empty cycles would be all the work.
fn check_cycle(run: &Section, case: &Case) {
    let drive_s = TAU / case.excitation.angular_frequency_rad_per_s();
    let least_s = LEAST_CYCLE * case.natural_period_s().min(drive_s);
    if case.run.cycle_s.is_some_and(|cycle_s| cycle_s < least_s) {
        let allowed = format!("must be {least_s:.3e} s or more: a millionth of the period of structure or drive");
        run.reject("cycle_s", allowed, None);
    }
}

/// Whether it is JSON, by how it begins; `[{` and `[]` head no table of TOML.
fn is_json(source: &Source) -> bool {
    let text = source.text().trim_start();
    text.starts_with('{') || text.strip_prefix('[').is_some_and(|rest| rest.trim_start().starts_with(['{', ']']))
}
