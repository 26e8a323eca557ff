//! The case file: a set-up, what excites it, where it starts and how long it runs. TOML or JSON, the same keys.

use std::f64::consts::TAU;
use std::path::Path;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{
    FrictionDamper, GRAVITY_M_PER_S2, Initial, Invalid, Particle, Release, SetUp, Structure, Tmd, Wall,
};
use toml::de::DeTable;

use super::from_json;
use crate::input::{Problem, Refusal, Section, Source};

/// A case as read and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What plots call it.
    pub name: String,
    /// Structure and dampers.
    pub set_up: SetUp,
    /// What moves it.
    pub excitation: Excitation,
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
    let text = if source.text().trim_start().starts_with('{') {
        from_json::to_toml(source)?
    } else {
        source.text().to_string()
    };
    let document = match DeTable::parse(&text) {
        Ok(document) => document,
        Err(error) => {
            source.report(Problem {
                title: "this is not TOML".into(),
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
        table("structure", "the table of the structure: mass, stiffness, damping").and_then(|s| structure(&s));
    let gravity_m_per_s2 = root.not_negative("gravity_m_per_s2").map_or(GRAVITY_M_PER_S2, |n| n.value);
    let mass_kg = structure.map_or(1.0, |s| s.mass_kg);
    let particle_section = root.table("particle", None);
    let particle = particle_section.as_ref().map(|s| particle(s, mass_kg));
    let friction_damper = root.table("friction_damper", None).map(|s| friction_damper(&s));
    let tmd_section = root.table("tmd", None);
    let tmd = tmd_section.as_ref().map(|s| tmd(s, structure));
    if let (Some(section), Some(_)) = (&tmd_section, &particle_section) {
        source.report(Problem {
            title: "`tmd` and `particle` are both given".into(),
            span: section.span(),
            allowed: "one or the other: no set-up carries both".into(),
            help: Some("leave out `tmd` or `particle`".into()),
        });
    }
    let force = root.table("force", None).map(|s| force(&s));
    let base = root.table("base", None).map(|s| base(&s));
    let excitation = match (base, force) {
        (None, None) => Some(Excitation::Fixed),
        (Some(base), None) => base,
        (None, Some(force)) => force,
        (Some(base), Some(force)) => {
            if base.is_some_and(|b| b != Excitation::Fixed) {
                source.report(Problem {
                    title: "`force` and a moving `base` are both given".into(),
                    span: root.table("force", None).map_or(0..0, |s| s.span()),
                    allowed: "one or the other: a force acts on the structure over a fixed base".into(),
                    help: Some("write base = {kind = \"fixed\"}, or leave out `force`".into()),
                });
            }
            force
        }
    };
    let initial_section = root.table("initial", None);
    let initial = initial_section.as_ref().map_or(Some(Initial::default()), initial);
    let run = table("run", "the table of the run: duration_s at least").and_then(|s| run(&s));
    root.finish();
    let set_up = SetUp {
        structure: structure?,
        particle: flatten(particle)?,
        friction_damper: flatten(friction_damper)?,
        tmd: flatten(tmd)?,
        gravity_m_per_s2,
    };
    let (excitation, initial, run) = (excitation?, initial?, run?);
    let checks = [set_up.validate(), excitation.validate(), set_up.validate_initial(&initial)];
    for invalid in checks.into_iter().filter_map(Result::err) {
        report_invalid(source, &root, initial_section.as_ref(), &invalid);
    }
    Some(Case { name, set_up, excitation, initial, run })
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

fn structure(s: &Section) -> Option<Structure> {
    let mass = s.required("mass_kg", "M, kg", Section::positive);
    let stiffness = s.either(["stiffness_n_per_m", "natural_frequency_hz"], Section::positive);
    let damping = s.either(["damping_n_s_per_m", "damping_ratio"], Section::not_negative);
    s.finish();
    let mass_kg = mass?.value;
    let stiffness_n_per_m = match stiffness? {
        (0, stiffness) => stiffness.value,
        (_, frequency) => mass_kg * (TAU * frequency.value).powi(2),
    };
    let damping_n_s_per_m = match damping? {
        (0, damping) => damping.value,
        (_, ratio) => 2.0 * ratio.value * (stiffness_n_per_m * mass_kg).sqrt(),
    };
    Some(Structure { mass_kg, stiffness_n_per_m, damping_n_s_per_m })
}

fn particle(s: &Section, structure_mass_kg: f64) -> Option<Particle> {
    let mass = s.either(["mass_kg", "mass_ratio"], Section::positive);
    let clearance = s.required("clearance_m", "d, half the free travel, m", Section::positive);
    let friction = s.not_negative("friction_coefficient").map_or(0.0, |n| n.value);
    let wall =
        s.required("wall", "what the particle meets, e.g. {kind = \"restitution\", coefficient = 0.5}", |s, k| {
            s.table(k, None).map(|w| wall(&w))
        });
    s.finish();
    let mass_kg = match mass? {
        (0, mass) => mass.value,
        (_, ratio) => ratio.value * structure_mass_kg,
    };
    Some(Particle { mass_kg, clearance_m: clearance?.value, friction_coefficient: friction, wall: wall?? })
}

fn wall(s: &Section) -> Option<Wall> {
    let kind = s.required("kind", "\"restitution\" or \"voigt\"", |s, k| s.choice(k, &["restitution", "voigt"]));
    let wall = match kind? {
        0 => {
            let from_0_to_1 = |s: &Section, k| s.number_if(k, |e| (0.0..=1.0).contains(&e), "from 0 to 1");
            let coefficient = s.required("coefficient", "e, from 0 to 1", from_0_to_1);
            coefficient.map(|e| Wall::Restitution { coefficient: e.value })
        }
        _ => {
            let stiffness = s.required("stiffness_n_per_m", "k1, N/m", Section::positive);
            let damping = s.required("damping_n_s_per_m", "c1, N·s/m", Section::not_negative);
            let release = s.required("release", "\"zero_penetration\" or \"zero_force\"", |s, k| {
                s.choice(k, &["zero_penetration", "zero_force"])
            });
            match (stiffness, damping, release) {
                (Some(stiffness), Some(damping), Some(release)) => Some(Wall::Voigt {
                    stiffness_n_per_m: stiffness.value,
                    damping_n_s_per_m: damping.value,
                    release: if release == 0 { Release::ZeroPenetration } else { Release::ZeroForce },
                }),
                _ => None,
            }
        }
    };
    s.finish();
    wall
}

fn friction_damper(s: &Section) -> Option<FrictionDamper> {
    let force = s.required("force_n", "F, N", Section::not_negative);
    s.finish();
    Some(FrictionDamper { force_n: force?.value })
}

fn tmd(s: &Section, _structure: Option<Structure>) -> Option<Tmd> {
    let mass = s.required("mass_kg", "m, kg", Section::positive);
    let stiffness = s.required("stiffness_n_per_m", "k1, N/m", Section::positive);
    let damping = s.required("damping_n_s_per_m", "c1, N·s/m", Section::not_negative);
    s.finish();
    Some(Tmd { mass_kg: mass?.value, stiffness_n_per_m: stiffness?.value, damping_n_s_per_m: damping?.value })
}

fn base(s: &Section) -> Option<Excitation> {
    let kinds = ["fixed", "sine", "half_sine", "versine"];
    let what = "\"fixed\", \"sine\", \"half_sine\" or \"versine\"";
    let kind = s.required("kind", what, |s, k| s.choice(k, &kinds))?;
    let base = match kind {
        0 => Some(Excitation::Fixed),
        1 => {
            let amplitude = s.required("amplitude_m", "Z, m", Section::not_negative);
            let omega = angular_frequency(s);
            let phase_rad = s.number("phase_rad").map_or(0.0, |n| n.value);
            match (amplitude, omega) {
                (Some(amplitude), Some(angular_frequency_rad_per_s)) => {
                    Some(Excitation::Sine { amplitude_m: amplitude.value, angular_frequency_rad_per_s, phase_rad })
                }
                _ => None,
            }
        }
        pulse => {
            let amplitude = s.required("amplitude_m", "Z, m", Section::number);
            let duration = s.required("duration_s", "T, s", Section::positive);
            match (amplitude.map(|n| n.value), duration.map(|n| n.value)) {
                (Some(amplitude_m), Some(duration_s)) if pulse == 2 => {
                    Some(Excitation::HalfSine { amplitude_m, duration_s })
                }
                (Some(amplitude_m), Some(duration_s)) => Some(Excitation::Versine { amplitude_m, duration_s }),
                _ => None,
            }
        }
    };
    s.finish();
    base
}

fn force(s: &Section) -> Option<Excitation> {
    s.required("kind", "\"sine\"", |s, k| s.choice(k, &["sine"]))?;
    let amplitude = s.required("amplitude_n", "P, N", Section::not_negative);
    let omega = angular_frequency(s);
    let phase_rad = s.number("phase_rad").map_or(0.0, |n| n.value);
    s.finish();
    Some(Excitation::ForceSine { amplitude_n: amplitude?.value, angular_frequency_rad_per_s: omega?, phase_rad })
}

fn angular_frequency(s: &Section) -> Option<f64> {
    match s.either(["angular_frequency_rad_per_s", "frequency_hz"], Section::positive)? {
        (0, omega) => Some(omega.value),
        (_, frequency) => Some(TAU * frequency.value),
    }
}

fn initial(s: &Section) -> Option<Initial> {
    let or = |key: &'static str, absent: f64| s.number(key).map_or(absent, |n| n.value);
    let (x_m, v_m_per_s) = (or("x_m", 0.0), or("v_m_per_s", 0.0));
    // A second mass that is not spoken of starts with the structure, in the middle of its cavity.
    let initial = Initial { x_m, v_m_per_s, y_m: or("y_m", x_m), u_m_per_s: or("u_m_per_s", v_m_per_s) };
    s.finish();
    Some(initial)
}

fn run(s: &Section) -> Option<RunSpec> {
    let duration = s.required("duration_s", "length of the run, s", Section::positive);
    let times = s.numbers("sample_times_s").unwrap_or_default();
    let cycle = s.positive("cycle_s");
    let whole =
        |s: &Section, k| s.number_if(k, |v| v >= 0.0 && v.fract() == 0.0 && v < 9e15, "a whole number, 0 or greater");
    let steady = whole(s, "steady_from_cycle");
    s.finish();
    let duration_s = duration?.value;
    for (i, time) in times.iter().enumerate() {
        let early = i > 0 && time.value < times[i - 1].value;
        if early || !(0.0..=duration_s * (1.0 + 1e-12)).contains(&time.value) {
            let allowed = format!("must be in rising order, from 0 to duration_s = {duration_s}");
            s.refuse("sample_times_s", &time.span, allowed, None);
            return None;
        }
    }
    Some(RunSpec {
        duration_s,
        sample_times_s: times.iter().map(|n| n.value).collect(),
        cycle_s: cycle.map(|n| n.value),
        steady_from_cycle: steady.map(|n| n.value as u64),
    })
}
