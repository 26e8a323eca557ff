//! The simulations behind an uncertainty of prediction: identified parameters, the scale of z, the force of the friction spring
//! and the particle's start vary together over the members of an ensemble.
//!
//! Each member takes in each dimension the middle of one of [`MEMBERS`] equal parts, a part of its own (a Latin square), so that the
//! spread of a linear response is the propagated uncertainty without the scatter of random draws. A quantity of standard uncertainty u
//! varies evenly over ± √3 u, which has that standard deviation. With more than four identified
//! parameters, dimensions repeat.

use std::path::Path;

use damprig_core::model::{Initial, SetUp};
use damprig_motion::rig_model::RigModel;
use toml::{Table, Value};

use super::COVERAGE_FACTOR;
use super::metric::MetricValues;
use crate::campaign::{Campaign, CampaignSetUp};
use crate::failure::Failure;
use crate::identify::statistics::student_95;
use crate::input::{Copies, Source};
use crate::quantity::Quantity;
use crate::setup::{Identified, set_up_file};

/// Members of an ensemble.
pub(super) const MEMBERS: usize = 17;

/// Exponent p and factor s of each dimension: member n has the part s·nᵖ mod 17, a part of its own since p has no divisor in common
/// with 16. The places in two dimensions correlate by less than 0.17.
const PARTS: [(u32, usize); 7] = [(1, 14), (1, 10), (1, 6), (5, 2), (7, 9), (7, 16), (7, 2)];

/// How far the particle's start varies where it is known, as on a simulated rig, as a share of the clearance: some micrometres, as the
/// noise of the base. What that does to the motion shows how much it amplifies disturbances.
const KNOWN_START: f64 = 1e-3;

/// Place of a member in a dimension, from −1 to 1.
pub(super) fn place(member: usize, dimension: usize) -> f64 {
    let (exponent, factor) = PARTS[dimension % PARTS.len()];
    let part = (0..exponent).fold(factor, |part, _| part * member % MEMBERS);
    (2.0 * part as f64 + 1.0) / MEMBERS as f64 - 1.0
}

/// The same in standard uncertainties.
fn deviation(member: usize, dimension: usize) -> f64 {
    3.0_f64.sqrt() * place(member, dimension)
}

/// Dimensions: the start of the particle, the scale of z, the force of the friction damper's spring, then the identified parameters.
const START: usize = 0;
const SCALE: usize = 1;
const SPRING: usize = 2;
const PARAMETERS: usize = 3;

/// A simulation to run: a model, its start, and the factor of the base motion.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Member {
    pub(super) model: RigModel,
    pub(super) initial: Initial,
    pub(super) base_factor: f64,
}

/// The models of one set-up: as stated, and with its identified parameters varied.
#[derive(Clone, Debug)]
pub(super) struct Models {
    pub(super) set_up: CampaignSetUp,
    /// One for each member; empty if no identified parameter acts on the set-up.
    varied: Vec<CampaignSetUp>,
    /// Whether the particle's start is known, as on a simulated rig.
    is_start_known: bool,
    /// Relative standard uncertainty of z.
    scale: f64,
    /// k of the run's set-up, N/m, if a force drives it: z is the force over this stiffness.
    force_stiffness_n_per_m: Option<f64>,
}

impl Models {
    /// Of a set-up, its models with varied parameters (empty without any), and whether the particle's start is known.
    /// `own` is the run's set-up, which the sensors of a force are scaled to.
    pub(super) fn new(
        own: &CampaignSetUp,
        set_up: &CampaignSetUp,
        varied: &[Vec<CampaignSetUp>],
        is_start_known: bool,
        scale: f64,
    ) -> Self {
        let of_name = |all: &Vec<CampaignSetUp>| all.iter().find(|other| other.name == set_up.name).cloned();
        let varied: Vec<CampaignSetUp> = varied.iter().filter_map(of_name).collect();
        let acts = varied.iter().any(|other| other.rig_model() != set_up.rig_model());
        let varied = if acts { varied } else { Vec::new() };
        let own = own.model();
        let force_stiffness_n_per_m = own.is_force_driven.then_some(own.structure.stiffness_n_per_m);
        Self { set_up: set_up.clone(), varied, is_start_known, scale, force_stiffness_n_per_m }
    }

    /// Factor of the recorded z: with a force drive, whose force stays, the stiffness of the run's set-up over that of the model.
    pub(super) fn force_factor(&self, model: &SetUp) -> f64 {
        self.force_stiffness_n_per_m.map_or(1.0, |own| own / model.structure.stiffness_n_per_m)
    }

    /// Whether identified parameters with an uncertainty act on the set-up.
    pub(super) fn has_parameters(&self) -> bool {
        !self.varied.is_empty()
    }

    fn initial(set_up: &CampaignSetUp, x_m: f64, moved: f64) -> Initial {
        let offset_m = set_up.model().particle.map_or(0.0, |particle| {
            let [low, high] = particle.ends_m();
            (set_up.particle_start_m() + moved * particle.clearance_m).clamp(low, high)
        });
        Initial { x_m, y_m: x_m + offset_m, ..Initial::default() }
    }

    /// The set-up as stated, released from `x_m`.
    pub(super) fn stated(&self, x_m: f64) -> Member {
        let model = self.set_up.rig_model();
        let base_factor = self.force_factor(&model.set_up);
        Member { model, initial: Self::initial(&self.set_up, x_m, 0.0), base_factor }
    }

    /// A start beside the stated one, by a thousandth of the clearance; `None` without a particle.
    pub(super) fn neighbour(&self, x_m: f64) -> Option<Member> {
        self.set_up.model().particle?;
        let moved = if place_of(&self.set_up) > 0.0 { -KNOWN_START } else { KNOWN_START };
        Some(Member { initial: Self::initial(&self.set_up, x_m, moved), ..self.stated(x_m) })
    }

    /// The members that show the uncertainty of the prediction; none if nothing varies. `spring`: relative standard uncertainty of the
    /// friction force.
    pub(super) fn members(&self, x_m: f64, spring: f64) -> Vec<Member> {
        let start_varies = self.set_up.model().particle.is_some();
        if !start_varies && !self.has_parameters() && self.scale == 0.0 && spring == 0.0 {
            return Vec::new();
        }
        let member = |n: usize| {
            let set_up = self.varied.get(n).unwrap_or(&self.set_up);
            let moved = match (start_varies, self.is_start_known) {
                (false, _) => 0.0,
                (true, true) => KNOWN_START * place(n, START),
                // The whole travel; the stated start is one of many.
                (true, false) => place(n, START) - place_of(set_up),
            };
            let mut model = set_up.rig_model();
            if let Some(damper) = &mut model.set_up.friction_damper {
                damper.force_n *= (1.0 + spring * deviation(n, SPRING)).max(0.0);
            }
            Member {
                model,
                initial: Self::initial(set_up, x_m, moved),
                base_factor: self.force_factor(&set_up.model()) * (1.0 + self.scale * deviation(n, SCALE)),
            }
        };
        (0..MEMBERS).map(member).collect()
    }
}

/// The stated start of a particle as a share of its clearance.
fn place_of(set_up: &CampaignSetUp) -> f64 {
    set_up.model().particle.map_or(0.0, |particle| {
        (set_up.particle_start_m() - particle.cavity.offset_m) / particle.clearance_m.max(f64::MIN_POSITIVE)
    })
}

/// Mean and standard uncertainty of the members' values: of a further draw beside their mean, for k = 2 with Student's factor. The
/// expanded uncertainty reaches the set-up as stated, which may lie beyond where a motion has few outcomes, as counts have. Without
/// members those of the set-up as stated.
pub(super) fn summary(stated: &MetricValues, members: &[MetricValues]) -> (MetricValues, MetricValues) {
    let (mut means, mut uncertainties) = (MetricValues::new(), MetricValues::new());
    for (metric, about) in stated {
        let away = |values: &MetricValues| values.get(metric).map(|value| metric.difference(*value, *about));
        let away: Vec<f64> = members.iter().filter_map(away).collect();
        let (mut value, mut u) = (*about, 0.0);
        if away.len() > 1 {
            let n = away.len() as f64;
            let mean = away.iter().sum::<f64>() / n;
            let variance = away.iter().map(|a| (a - mean) * (a - mean)).sum::<f64>() / (n - 1.0);
            value = wrapped(*metric, about + mean);
            u = 0.5 * student_95(n - 1.0) * (1.0 + 1.0 / n).sqrt() * variance.sqrt();
            u = u.max(mean.abs() * (1.0 + 1.0 / n) / COVERAGE_FACTOR);
        }
        means.insert(*metric, value);
        uncertainties.insert(*metric, u);
    }
    (means, uncertainties)
}

fn wrapped(metric: Quantity, value: f64) -> f64 {
    if metric == Quantity::PhaseRad { metric.difference(value, 0.0) } else { value }
}

/// The set-ups of a campaign with the identified values of its set-up file varied by their standard uncertainty.
#[derive(Clone, Debug, Default)]
pub(super) struct Varied {
    /// For each member; empty if nothing varies.
    pub(super) set_ups: Vec<Vec<CampaignSetUp>>,
    /// Keys of the values that vary.
    keys: Vec<String>,
    /// Keys of identified values that no set-up uses: the campaign states its own.
    unused: Vec<String>,
}

/// Varies the identified values of a campaign.
///
/// # Errors
/// Why the values cannot be varied, in words.
pub(super) fn varied_set_ups(campaign: &Campaign, is_simulated: bool) -> Result<Varied, String> {
    let Some(file) = &campaign.set_up_file else { return Ok(Varied::default()) };
    let uncertain: Vec<&Identified> = file.identified.iter().filter(|value| value.standard_uncertainty > 0.0).collect();
    let folder = tempfile::tempdir().map_err(|error| format!("no temporary folder: {error}"))?;
    let copies = Path::new(crate::campaign::transient::RECORDS);
    let copy = set_up_file::kept(&folder.path().join(copies), &file.file);
    std::fs::create_dir_all(folder.path().join(copies)).map_err(|error| format!("no temporary folder: {error}"))?;
    let text = set_ups_alone(campaign.source.text())?;
    let set_ups_with = |changes: &[(&Identified, f64)]| -> Result<Vec<CampaignSetUp>, String> {
        let mut values: Table = file.text.parse().map_err(|error| format!("the set-up file is not TOML: {error}"))?;
        for (value, by) in changes {
            vary(&mut values, &value.key, by * value.standard_uncertainty)?;
        }
        let varied = toml::to_string(&values).map_err(|error| error.to_string())?;
        std::fs::write(&copy, varied).map_err(|error| format!("{}: {error}", copy.display()))?;
        let source = Source::new(folder.path().join("campaign.toml").display().to_string(), text.clone()).recorded();
        let source = source.with_copies(Copies { set_up_file: Some(copy.clone()), ..Copies::default() });
        let mut read = Campaign::parse(source).map_err(|error| error.to_string())?;
        // Limits were checked before the run.
        let _ = read.on_board(&campaign.rig.board, is_simulated);
        Ok(read.set_ups)
    };
    let models = |set_ups: &[CampaignSetUp]| set_ups.iter().map(CampaignSetUp::model).collect::<Vec<_>>();
    let (mut used, mut varied) = (Vec::new(), Varied::default());
    for value in uncertain {
        if models(&set_ups_with(&[(value, 1.0)])?) == models(&campaign.set_ups) {
            varied.unused.push(value.key.clone());
        } else {
            varied.keys.push(value.key.clone());
            used.push(value);
        }
    }
    if !used.is_empty() {
        let changes =
            |member| used.iter().enumerate().map(move |(n, value)| (*value, deviation(member, PARAMETERS + n)));
        let of_members = (0..MEMBERS).map(|member| set_ups_with(&changes(member).collect::<Vec<_>>()));
        varied.set_ups = of_members.collect::<Result<_, _>>()?;
    }
    Ok(varied)
}

/// The campaign with one short experiment instead of its own, whose records are elsewhere.
fn set_ups_alone(text: &str) -> Result<String, String> {
    let mut campaign: Table = text.parse().map_err(|error| format!("the campaign is not TOML: {error}"))?;
    let experiment: Table = "kind = \"stepped_sine\"\nfrequencies_hz = [1]\nstart = \"from_rest\"\ndwell_s = 10\n"
        .parse()
        .map_err(|error: toml::de::Error| error.to_string())?;
    campaign.insert("experiment".into(), Value::Array(vec![Value::Table(experiment)]));
    toml::to_string(&campaign).map_err(|error| error.to_string())
}

/// Adds to the value of a dotted key.
fn vary(values: &mut Table, key: &str, by: f64) -> Result<(), String> {
    let absent = || format!("the set-up file has no number `{key}`");
    let (path, name) = key.rsplit_once('.').unwrap_or(("", key));
    let table = path
        .split('.')
        .filter(|part| !part.is_empty())
        .try_fold(values, |table, part| table.get_mut(part).and_then(Value::as_table_mut));
    let value = table.and_then(|table| table.get_mut(name)).ok_or_else(absent)?;
    let number = value.as_float().or(value.as_integer().map(|whole| whole as f64)).ok_or_else(absent)?;
    *value = Value::Float(number + by);
    Ok(())
}

/// The set-up to simulate for one of the run.
pub(super) fn model_of(own: &CampaignSetUp, model: &Campaign) -> Result<CampaignSetUp, Failure> {
    let found = model.set_ups.iter().find(|other| other.name == own.name);
    if let Some(other) = found.filter(|other| other.model().is_force_driven != own.model().is_force_driven) {
        let (forced, moved) = ("is driven by a force", "stands on a base that moves");
        let [run, given] = if own.model().is_force_driven { [forced, moved] } else { [moved, forced] };
        return Err(Failure::Input(format!(
            "{}: its set-up {:?} {given}, that of the run {run}\n  give it `{}` as the run's",
            model.source.name(),
            other.name,
            own.amplitude_key()
        )));
    }
    found.cloned().ok_or_else(|| {
        let names: Vec<&str> = model.set_ups.iter().map(|other| other.name.as_str()).collect();
        Failure::Input(format!(
            "{}: it has no set-up {:?} of the run; it has {}\n  give its set-ups the names of the run's",
            model.source.name(),
            own.name,
            names.join(", ")
        ))
    })
}

/// What is said about the uncertainty of the parameters.
pub(super) fn about_parameters(model: &Campaign, varied: &Result<Varied, String>) -> String {
    let file = model.set_up_file.as_ref().map_or("", |file| file.file.as_str());
    match varied {
        Err(why) => format!("Parameters: their uncertainty is not included: {why}."),
        Ok(Varied { keys, unused, .. }) => {
            let identified = if keys.is_empty() {
                "their uncertainty is not included: no identified value is used (`damprig identify`, `set_up_file`)"
                    .into()
            } else {
                format!("identified with uncertainty: {} ({file}); all others count as exact", keys.join(", "))
            };
            let unused = match unused[..] {
                [] => String::new(),
                _ => format!("; the set-ups do not use {} of {file}: the campaign states its own", unused.join(", ")),
            };
            format!("Parameters: {identified}{unused}.")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_cover_every_dimension_evenly_and_independently() {
        for dimension in 0..PARTS.len() {
            let mut places: Vec<f64> = (0..MEMBERS).map(|n| place(n, dimension)).collect();
            places.sort_by(f64::total_cmp);
            places.windows(2).for_each(|pair| assert!((pair[1] - pair[0] - 2.0 / 17.0).abs() < 1e-12));
            for other in dimension + 1..PARTS.len() {
                let product: f64 = (0..MEMBERS).map(|n| place(n, dimension) * place(n, other)).sum();
                let square: f64 = places.iter().map(|p| p * p).sum();
                assert!((product / square).abs() < 0.17, "{dimension} {other}: {}", product / square);
            }
        }
    }

    #[test]
    fn the_spread_of_a_linear_response_is_the_propagated_uncertainty() {
        let (of_a, of_b) = (0.3, 0.4);
        let value =
            |n: usize| MetricValues::from([(Quantity::RmsXM, 1.0 + of_a * deviation(n, 2) + of_b * deviation(n, 3))]);
        let members: Vec<MetricValues> = (0..MEMBERS).map(value).collect();
        let (mean, u) = summary(&MetricValues::from([(Quantity::RmsXM, 1.0)]), &members);
        assert!((mean[&Quantity::RmsXM] - 1.0).abs() < 1e-12);
        // √(0.3² + 0.4²), widened by Student's factor (1.06), by a further draw (1.03), and by what correlation the lattice has.
        assert!((u[&Quantity::RmsXM] / 0.5 / 1.09 - 1.0).abs() < 0.15, "{}", u[&Quantity::RmsXM]);
    }
}
