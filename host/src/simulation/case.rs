//! The case file: a set-up, what excites it, where it starts and how long it runs. TOML or JSON, the same keys.

use std::f64::consts::TAU;
use std::path::Path;

use damprig_core::integrator::exact::Excitation;
use damprig_core::integrator::sampled::Sampled;
use damprig_core::model::{GRAVITY_M_PER_S2, Initial, Invalid, SetUp, Wall};
use toml::de::DeTable;

use super::loading::{self, Loading};
use super::record::Record;
use super::record::read::resolve;
use super::{from_json, reading};
use crate::input::{Problem, Refusal, Section, Source};

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
    let text = if is_json(source) { from_json::to_toml(source)? } else { source.text().to_string() };
    let document = match DeTable::parse(&text) {
        Ok(document) => document,
        Err(error) => {
            source.report(Problem {
                // JSON that is sound may still say what TOML has no word for: a number of 20 digits, a key twice.
                title: if is_json(source) { "this cannot be taken" } else { "this is not TOML" }.into(),
                span: error.span().unwrap_or(0..0),
                allowed: error.message().to_string(),
                help: None,
            });
            return None;
        }
    };
    let root = Section::root(source, &document);
    let name = root.text("name").map_or_else(|| name.to_string(), |t| t.value);
    let table = |key: &'static str, what: &str| root.required(key, what, |s, k| s.table(k, None));
    let structure =
        table("structure", "the table of the structure: mass, stiffness, damping").and_then(|s| reading::structure(&s));
    let gravity_m_per_s2 = root.not_negative("gravity_m_per_s2").map_or(GRAVITY_M_PER_S2, |n| n.value);
    let particle_section = root.table("particle", None);
    let particle = particle_section.as_ref().map(|s| reading::particle(s, structure));
    let friction_damper = root.table("friction_damper", None).map(|s| reading::friction_damper(&s));
    let tmd_section = root.table("tmd", None);
    let tmd = tmd_section.as_ref().map(|s| reading::tmd(s, structure));
    if let (Some(section), Some(_)) = (&tmd_section, &particle_section) {
        source.report(Problem {
            title: "`tmd` and `particle` are both given".into(),
            span: section.span(),
            allowed: "one or the other: no set-up carries both".into(),
            help: Some("leave out `tmd` or `particle`".into()),
        });
    }
    let force = root.table("force", None).map(|s| loading::force(&s));
    let beside = |file: &str| resolve(Path::new(source.name()), file);
    let base = root.table("base", None).map(|s| loading::base(&s, &beside));
    let loading = match (base, force) {
        (None, None) => Some(Loading::Closed(Excitation::Fixed)),
        (Some(base), None) => base,
        (None, Some(force)) => force.map(Loading::Closed),
        (Some(base), Some(force)) => {
            if base.is_some_and(|b| b != Loading::Closed(Excitation::Fixed)) {
                source.report(Problem {
                    title: "`force` and a moving `base` are both given".into(),
                    span: root.table("force", None).map_or(0..0, |s| s.span()),
                    allowed: "one or the other: a force acts on the structure over a fixed base".into(),
                    help: Some("write base = {kind = \"fixed\"}, or leave out `force`".into()),
                });
            }
            force.map(Loading::Closed)
        }
    };
    let record = match &loading {
        Some(Loading::Recorded(record)) => Some(record),
        _ => None,
    };
    let initial_section = root.table("initial", None);
    let initial = loading::initial(initial_section.as_ref(), record.map_or(0.0, Record::start_m));
    let length_s = record.map(Record::duration_s);
    let run = match root.table("run", None) {
        Some(s) => loading::run(&s, length_s),
        None => {
            root.lack("run", "the table of the run: duration_s at least");
            None
        }
    };
    root.finish();
    let set_up = SetUp {
        structure: structure?,
        particle: flatten(particle)?,
        friction_damper: flatten(friction_damper)?,
        tmd: flatten(tmd)?,
        gravity_m_per_s2,
    };
    let (excitation, record) = match loading? {
        Loading::Closed(excitation) => (excitation, None),
        Loading::Recorded(record) => (Excitation::Fixed, Some(record)),
    };
    let run = run?;
    let sampling = record.as_ref().map_or(Ok(1), |r| Sampled::<f64>::steps_per_sample(&set_up, r.step_s)).map(|_| ());
    let checks = [set_up.validate(), excitation.validate(), set_up.validate_initial(&initial), sampling];
    for invalid in checks.into_iter().filter_map(Result::err) {
        report_invalid(source, &root, initial_section.as_ref(), &invalid);
    }
    let case = Case { name, set_up, excitation, record, initial, run };
    check_cycle(&root, &case);
    Some(case)
}

/// The shortest cycle that makes sense, as a share of the period of structure or drive.
const LEAST_CYCLE: f64 = 1e-6;

/// Refuses a cycle so short that closing empty cycles would be all the work.
fn check_cycle(root: &Section, case: &Case) {
    let drive_s = TAU / case.excitation.angular_frequency_rad_per_s();
    let least_s = LEAST_CYCLE * case.natural_period_s().min(drive_s);
    if case.run.cycle_s.is_some_and(|cycle_s| cycle_s < least_s)
        && let Some(run) = root.table("run", None)
        && let Some(cycle) = run.number("cycle_s")
    {
        let allowed = format!("must be {least_s:.3e} s or more: a millionth of the period of structure or drive");
        run.refuse("cycle_s", &cycle.span, allowed, None);
    }
}

/// Whether it is JSON, by how it begins; `[{` and `[]` head no table of TOML.
fn is_json(source: &Source) -> bool {
    let text = source.text().trim_start();
    text.starts_with('{') || text.strip_prefix('[').is_some_and(|rest| rest.trim_start().starts_with(['{', ']']))
}

/// An absent table is fine, one with a problem is not.
fn flatten<T>(read: Option<Option<T>>) -> Option<Option<T>> {
    match read {
        None => Some(None),
        Some(Some(value)) => Some(Some(value)),
        Some(None) => None,
    }
}

/// What only the model can tell (a particle outside its cavity), at the place of the value if it can be found.
fn report_invalid(source: &Source, root: &Section, initial: Option<&Section>, invalid: &Invalid) {
    let key = invalid.parameter.rsplit('.').next().unwrap_or_default();
    let number = match (invalid.parameter.starts_with("initial."), initial) {
        (true, Some(section)) => {
            ["x_m", "v_m_per_s", "y_m", "u_m_per_s"].into_iter().find(|k| *k == key).and_then(|k| section.number(k))
        }
        _ => None,
    };
    source.report(Problem {
        title: format!("`{}` = {} is not allowed", invalid.parameter, invalid.value),
        span: number.map_or_else(|| root.span(), |n| n.span),
        allowed: format!("must be {}", invalid.allowed),
        help: None,
    });
}
