//! Restitution from drop tests: tracked films, impact times, heights, force records; as one coefficient and over the approach speed.

pub(crate) mod film;
mod force;
mod tables;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use damprig_identification::restitution::law::{self, Impact, Impacts, Law, Power};
pub use film::FilmAxis;

use super::force_record::FORCE;
use super::statistics::Value;
use super::table::{NumberTable, TIME};
use super::{Estimate, Identification};
use crate::failure::Failure;

/// Mass and approach velocity of the body on a force record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Mass of the body, kg.
    pub mass_kg: f64,
    /// Its velocity before the impact, m/s.
    pub velocity_m_per_s: f64,
}

/// What is known of the sources besides their files.
#[derive(Clone, Debug, PartialEq)]
pub struct RestitutionOptions {
    /// Acceleration of gravity, m/s².
    pub gravity_m_per_s2: f64,
    /// Of a film: frames per second of the recording.
    pub frame_rate_hz: Option<f64>,
    /// Of a film: metres per pixel at the floor.
    pub m_per_pixel: Option<f64>,
    /// Of a film: the axis along which the ball falls.
    pub vertical: Option<FilmAxis>,
    /// Of a film: the tracks of the ball; empty for the only one.
    pub tracks: Vec<u32>,
    /// Of impact times: height of every drop, m.
    pub drop_height_m: Option<f64>,
    /// Of impact times: standard uncertainty of a time, s.
    pub time_uncertainty_s: Option<f64>,
    /// Of a force record.
    pub approach: Option<Approach>,
}

impl Default for RestitutionOptions {
    fn default() -> Self {
        Self {
            gravity_m_per_s2: damprig_core::model::GRAVITY_M_PER_S2,
            frame_rate_hz: None,
            m_per_pixel: None,
            vertical: None,
            tracks: Vec::new(),
            drop_height_m: None,
            time_uncertainty_s: None,
            approach: None,
        }
    }
}

/// Kind of a file of drop tests, for the options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DropFileKind {
    Film,
    Times,
    Heights,
}

impl RestitutionOptions {
    /// The first option for files of which there is none.
    fn unused(&self, kinds: &[DropFileKind]) -> Option<String> {
        let of_film = [
            ("--frame-rate-hz", self.frame_rate_hz.is_some()),
            ("--m-per-pixel", self.m_per_pixel.is_some()),
            ("--vertical", self.vertical.is_some()),
            ("--track", !self.tracks.is_empty()),
        ];
        let of_times = [
            ("--drop-height-m", self.drop_height_m.is_some()),
            ("--time-uncertainty-s", self.time_uncertainty_s.is_some()),
        ];
        let of = |kind, what, all: &[(&str, bool)]| {
            let given = all.iter().find(|(_, is_given)| *is_given && !kinds.contains(&kind))?;
            Some(format!("{} is for {what}, and this is none\n  leave it out", given.0))
        };
        of(DropFileKind::Film, "a tracked film", &of_film)
            .or_else(|| of(DropFileKind::Times, "impact times", &of_times))
    }
}

/// Largest e of a single impact that errors of a measurement may give.
const MAX: f64 = 1.05;

/// Restitution over the approach speed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OverSpeed {
    /// Whether the impacts contradict a constant e.
    pub depends_on_speed: bool,
    /// Probability of an exponent as far from 0 as the fitted one, if e is constant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chance: Option<f64>,
    /// e at the reference speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coefficient: Option<f64>,
    /// Speed of `coefficient`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_speed_m_per_s: Option<f64>,
    /// e falls with this power of the speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exponent: Option<f64>,
    /// Upper limit of e.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub maximum: Option<f64>,
    /// Whether the impacts show the upper limit; if not, it is e of the fit at the slowest of them.
    pub is_maximum_found: bool,
    /// Slowest and fastest approach.
    pub speeds_m_per_s: [f64; 2],
    /// The impacts of drop tests; a run has them in its own table.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub impacts: Vec<Impact>,
}

/// The fit, and the answer for people.
#[derive(Clone, Debug)]
pub struct Restitution {
    /// What the impacts show; none of a force record.
    pub law: Option<Law>,
    /// The answer.
    pub identified: Identification,
}

/// Identifies restitution from files of drop tests together: tracked films and tables. A force record stands alone; it gives the contact time too.
///
/// # Errors
/// A file that is none of these, too few impacts, values that no impact has.
pub fn identify(sources: &[PathBuf], options: &RestitutionOptions) -> Result<Restitution, Failure> {
    let (mut groups, mut remarks, mut kinds) = (Vec::new(), Vec::new(), Vec::new());
    for (n, source) in sources.iter().enumerate() {
        if sources[..n].contains(source) {
            return Err(Failure::Input(format!("{} is given twice", source.display())));
        }
        match of_file(source, options, sources.len())? {
            FileContents::Force(identified) => return Ok(Restitution { law: None, identified: *identified }),
            FileContents::Impacts(kind, impacts, own) => {
                kinds.push(kind);
                groups.push(impacts);
                let name = if sources.len() > 1 { format!("{}: ", source.display()) } else { String::new() };
                remarks.extend(own.into_iter().map(|remark| format!("{name}{remark}")));
            }
        }
    }
    let shown: Vec<String> = sources.iter().map(|source| source.display().to_string()).collect();
    let taken_from = shown.join(", ");
    if let Some(why) = options.unused(&kinds) {
        return Err(Failure::Input(format!("{taken_from}: {why}")));
    }
    let law = law::law(&groups).ok_or_else(|| {
        Failure::Input(format!(
            "{taken_from}: one value has no uncertainty: give at least two drops or three flights, or --time-uncertainty-s for impact times"
        ))
    })?;
    let mut identified = of_law(&law, &groups, taken_from);
    identified.remarks.extend(remarks);
    Ok(Restitution { law: Some(law), identified })
}

/// What a file holds.
enum FileContents {
    Force(Box<Identification>),
    Impacts(DropFileKind, Impacts, Vec<String>),
}

fn of_file(source: &Path, options: &RestitutionOptions, files: usize) -> Result<FileContents, Failure> {
    if film::is_film(source) {
        return film::impacts(source, options)
            .map(|(impacts, remarks)| FileContents::Impacts(DropFileKind::Film, impacts, remarks));
    }
    let table = NumberTable::read(source)?;
    if !table.has(&FORCE) {
        let kind = if table.has(&TIME) { DropFileKind::Times } else { DropFileKind::Heights };
        return tables::impacts(&table, options).map(|impacts| FileContents::Impacts(kind, impacts, Vec::new()));
    }
    if let Some(why) = options.unused(&[]) {
        return Err(table.refuse(why));
    }
    if files > 1 {
        return Err(table.refuse("a force record cannot be fitted together with other files\n  identify it by itself"));
    }
    let mut identified = Identification::new(table.file(), force::of_force(&table, options.approach)?);
    identified.remarks = vec!["restitution depends on the approach velocity: test at that of the experiment".into()];
    Ok(FileContents::Force(Box::new(identified)))
}

/// One coefficient for all speeds.
fn constant(method: &'static str, value: &Value) -> Estimate {
    Estimate::new("coefficient of restitution", "", method, value).of_key(COEFFICIENT)
}

/// The answer.
fn of_law(law: &Law, groups: &[Impacts], taken_from: String) -> Identification {
    let method = match groups {
        [only] => only.method,
        _ => "drop tests together",
    };
    let mut identified = Identification::new(taken_from, vec![constant(method, &law.constant)]);
    judge(&mut identified, law, groups.iter().flat_map(|group| group.all.iter().cloned()).collect());
    identified.remarks = remarks(law);
    identified
}

/// Adds whether one coefficient is enough, and e over the speed; where it is not enough, that comes first.
pub(crate) fn judge(identified: &mut Identification, law: &Law, impacts: Vec<Impact>) {
    let depends_on_speed = law.depends_on_speed();
    if let Some(power) = &law.power {
        if depends_on_speed {
            // The coefficient of the law takes the key of the constant.
            if power.is_a_wall() {
                identified
                    .estimates
                    .iter_mut()
                    .filter(|one| one.key == Some(COEFFICIENT))
                    .for_each(|one| one.key = None);
                identified.words.push(("particle.wall.kind", "restitution"));
            }
            identified.estimates.splice(0..0, of_power(power));
        } else {
            identified.estimates.push(Estimate::new("exponent of e over the speed", "", POWER, &power.exponent));
        }
    }
    identified.answer = Some(answer(law));
    let is_written = law.power.as_ref().is_some_and(Power::is_a_wall);
    identified.contradiction = (depends_on_speed && !is_written).then(|| {
        "one coefficient contradicts the impacts: e depends on the approach speed, and not as a wall's e(v) does, which falls from a maximum below 1"
            .into()
    });
    identified.over_speed = Some(OverSpeed {
        depends_on_speed,
        chance: law.chance,
        coefficient: law.power.map(|power| power.coefficient.value),
        reference_speed_m_per_s: law.power.map(|power| power.reference_speed_m_per_s),
        exponent: law.power.map(|power| power.exponent.value),
        maximum: law.power.map(|power| power.maximum.value),
        is_maximum_found: law.power.is_some_and(|power| power.is_maximum_found),
        speeds_m_per_s: law.speeds_m_per_s,
        impacts,
    });
}

const POWER: &str = "e(v) = min(coefficient·(v/reference speed)^(−exponent), maximum)";

const COEFFICIENT: &str = "particle.wall.coefficient";
const EXPONENT: &str = "particle.wall.exponent";

/// The estimates of e over the speed, with their keys where a wall can have this law.
fn of_power(power: &Power) -> Vec<Estimate> {
    let exact = Value { value: power.reference_speed_m_per_s, standard_uncertainty: 0.0, degrees_of_freedom: 1.0 };
    let maximum = Estimate::new("e(v): maximum", "", POWER, &power.maximum);
    let estimates = [
        Estimate::new("e(v): coefficient at the reference speed", "", POWER, &power.coefficient).of_key(COEFFICIENT),
        Estimate::new("e(v): reference speed", "m/s", POWER, &exact).of_key("particle.wall.reference_speed_m_per_s"),
        Estimate::new("e(v): exponent", "", POWER, &power.exponent).of_key(EXPONENT),
        Estimate { interval_95: law::interval_of_maximum(power), ..maximum }.of_key("particle.wall.maximum"),
    ];
    let is_written = power.is_a_wall();
    estimates.map(|one| Estimate { key: one.key.filter(|_| is_written), ..one }).into()
}

/// Whether one constant is enough, in a sentence.
fn answer(law: &Law) -> String {
    let [slowest, fastest] = law.speeds_m_per_s;
    let speeds = format!("{slowest:.3} to {fastest:.3} m/s");
    let (Some(power), Some(chance)) = (&law.power, law.chance) else {
        return if law.impacts == 1 {
            format!("one impact, at {slowest:.3} m/s: whether e depends on the speed cannot be told")
        } else {
            format!(
                "the {} impacts have speeds of {speeds}, too much alike to tell whether e depends on them",
                law.impacts
            )
        };
    };
    let [low, high] = power.exponent.interval_95();
    let exponent = format!("exponent {:.3}, 95 % interval {low:.3} to {high:.3}", power.exponent.value);
    if !law.depends_on_speed() {
        return format!("a constant e is not contradicted by {} impacts at {speeds} ({exponent})", law.impacts);
    }
    let way = if power.exponent.value > 0.0 { "falls" } else { "rises" };
    format!(
        "a constant e is not enough: it {way} with the speed, from {:.3} at {slowest:.3} m/s to {:.3} at {fastest:.3} m/s ({exponent}, probability \
         of a constant {chance:.1e}, {} impacts)",
        power.at(slowest),
        power.at(fastest),
        law.impacts
    )
}

fn remarks(law: &Law) -> Vec<String> {
    let mut remarks = Vec::new();
    let scatter = law.scatter[usize::from(law.depends_on_speed())];
    if scatter > 1e-6 {
        remarks.push(format!("e differs by {scatter:.4} (standard deviation) from impact to impact beyond what the measurement explains; the intervals include it"));
    }
    match &law.power {
        Some(power) if !power.is_maximum_found && law.depends_on_speed() => remarks.push(format!(
            "the impacts show no upper limit of e: the maximum is that of the {} one, {:.3} m/s; slower than {:.3} m/s e is not known",
            if power.exponent.value < 0.0 { "fastest" } else { "slowest" },
            law.speeds_m_per_s[usize::from(power.exponent.value < 0.0)],
            law.speeds_m_per_s[0]
        )),
        _ => remarks.push(format!(
            "restitution depends on the approach velocity: test at that of the experiment; these impacts have {:.3} to {:.3} m/s",
            law.speeds_m_per_s[0], law.speeds_m_per_s[1]
        )),
    }
    if law.power.is_some() && law.impacts == 2 {
        remarks.push("two impacts do not show how much e differs from impact to impact: the intervals are those of the measurement alone".into());
    }
    remarks
}
