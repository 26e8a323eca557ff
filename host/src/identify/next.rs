//! What to measure next: the points of a stepped sine that narrow the identified parameters most.
//!
//! A settled point measures ln(X/Z) with a relative standard uncertainty u. Its derivatives g by the parameters are those of the periodic
//! motion, exact through every event, so that it adds g·gᵀ/u² to the information on them, the inverse of their covariance. Points are added
//! one after another, each the one that makes the covariance's determinant (D-optimal) or the variance of one parameter smallest. The error of
//! the sensors' scale, which all points have in common, is a further parameter that no point is chosen for.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use damprig_continuation::{Parameter, ReturnMap, System, Ties};
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::{Initial, SetUp};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::Sensors;
use super::response::MIN_UNCERTAINTY;
use crate::campaign::{Campaign, CampaignSetUp};
use crate::failure::Failure;
use crate::prediction::USABLE;
use crate::run_folder::read::campaign_copy;
use crate::run_folder::{ResultRow, RunFolder};
use crate::setup::{Identified, SetUpFile};
use crate::simulation::analysis::{MORE, OrbitSummary, PeriodicOrbit, Stability};
use crate::simulation::parameters::PARAMETERS;

/// Frequencies of a set-up, unless a step is stated: 200 steps over the band.
const STEPS: f64 = 200.0;

/// Most candidates.
const MOST: f64 = 20_000.0;

/// Time of a motion from rest before it is looked at, in time constants 1/(ζω) of the structure: e⁻¹² of the free vibration is left.
const SETTLED: f64 = 12.0;

/// The fewest and the most cycles of it.
const CYCLES: [f64; 2] = [100.0, 5000.0];

/// An identified value is that of a set-up of the campaign that read it if both agree to this share.
const SAME: f64 = 1e-6;

/// Why a point is no candidate.
const NOT_PERIODIC: &str = "the motion from rest does not end on a stable motion of the drive's period";
const NO_DERIVATIVE: &str =
    "the motion has no derivative there (grazing, a bifurcation, a particle that may be anywhere)";
const EVENTS_CHANGE: &str = "a change of a parameter by its standard uncertainty adds or removes an impact or a stick";
const BEYOND_LIMIT: &str = "|x| would leave the displacement limit";
const NOT_SETTLED: &str = "a neighbouring point of the run did not settle: the same dwell would not do";

/// What is asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wish {
    /// Number of points.
    pub points: usize,
    /// Key of the parameter to narrow; all together without one.
    pub key: Option<String>,
    /// Lowest and highest frequency, Hz; those of the run without them.
    pub from_hz: Option<f64>,
    /// The other end.
    pub to_hz: Option<f64>,
    /// Step of the frequencies, Hz.
    pub step_hz: Option<f64>,
}

/// An identified parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Uncertain {
    /// Its key.
    pub key: String,
    /// Its value, in the key's unit.
    pub value: f64,
    /// Its standard uncertainty before the points, in that unit.
    pub standard_uncertainty: f64,
    /// The set-ups that it is a value of.
    pub set_ups: Vec<String>,
    /// The parameter of the model.
    #[serde(skip)]
    pub parameter: Parameter,
}

/// A set-up that may be measured, at the identified values.
#[derive(Clone, Debug, PartialEq)]
pub struct Mounted {
    /// Name in the campaign.
    pub name: String,
    /// Name in figures.
    pub label: String,
    /// Its model.
    pub model: SetUp,
    /// Z, m.
    pub base_amplitude_m: f64,
    /// y − x at rest, m.
    pub start_m: f64,
    /// Places of its parameters among all.
    pub own: Vec<usize>,
    /// Frequencies of the run, Hz, each with the relative standard uncertainty of its X/Z; none of a point that did not settle.
    pub measured: Vec<(f64, Option<f64>)>,
}

/// X/Z of a settled point, with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    /// Largest |x| of the periodic motion over Z.
    pub x_over_z: f64,
    /// Largest |x| from rest on, m.
    pub max_abs_x_m: f64,
    /// ∂ln(X/Z)/∂p of each parameter, per unit of its key.
    pub by_parameters: Vec<f64>,
    /// Relative change of each parameter within which, to first order, the motion has the same events.
    pub holds_within: Vec<f64>,
}

/// A point that may be measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Place of its set-up.
    pub set_up: usize,
    /// Drive frequency, Hz.
    pub frequency_hz: f64,
    /// X/Z as the identified values predict it.
    pub x_over_z: f64,
    /// Relative standard uncertainty of its X/Z.
    pub relative_uncertainty: f64,
    /// Change of ln(X/Z) by one standard uncertainty of each parameter, then of the sensors' scale.
    pub changes: DVector<f64>,
}

/// A point to measure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextPoint {
    /// Its set-up.
    pub set_up: String,
    /// Z, m.
    pub base_amplitude_m: f64,
    /// Drive frequency, Hz.
    pub frequency_hz: f64,
    /// X/Z as the identified values predict it.
    pub x_over_z: f64,
    /// Relative standard uncertainty of its X/Z: the larger one of the run's neighbouring points.
    pub relative_uncertainty: f64,
    /// Standard uncertainty of each parameter after this point and those before it, in its unit.
    pub standard_uncertainties: Vec<f64>,
}

/// Points that are no candidates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// Their set-up.
    pub set_up: String,
    /// Why.
    pub reason: &'static str,
    /// How many.
    pub points: usize,
}

impl std::fmt::Display for LeftOut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let points = if self.points == 1 { "point" } else { "points" };
        write!(f, "{}: {} {points} left out: {}", self.set_up, self.points, self.reason)
    }
}

/// What one point does.
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    /// Name of the set-up.
    pub set_up: String,
    /// Its name in figures.
    pub label: String,
    /// Frequency, Hz, and the uncertainty after this point alone over that before; none of a point that is no candidate.
    pub points: Vec<(f64, Option<f64>)>,
}

/// The answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Next {
    /// The run.
    pub run: String,
    /// The file with the identified values.
    pub values_from: String,
    /// The key that is narrowed; all parameters together without one.
    pub key: Option<String>,
    /// The parameters.
    pub parameters: Vec<Uncertain>,
    /// The points, in the order in which they narrow most.
    pub points: Vec<NextPoint>,
    /// Points that were looked at.
    pub looked_at: usize,
    /// Those that cannot be used.
    pub left_out: Vec<LeftOut>,
    /// What a person has to know.
    pub remarks: Vec<String>,
    /// What each point alone does, by set-ups.
    #[serde(skip)]
    pub gains: Vec<Gain>,
}

/// What is known of the parameters, each in units of its standard uncertainty before, and of the sensors' scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Knowledge {
    covariance: DMatrix<f64>,
    /// Place of the parameter to narrow.
    only: Option<usize>,
}

impl Knowledge {
    /// Before any point: the file has no correlations.
    #[must_use]
    pub fn before(parameters: usize, only: Option<usize>) -> Self {
        Self { covariance: DMatrix::identity(parameters + 1, parameters + 1), only }
    }

    /// After a point with these changes of ln(X/Z) and this relative uncertainty.
    #[must_use]
    pub fn after(&self, changes: &DVector<f64>, relative_uncertainty: f64) -> Self {
        let moved = &self.covariance * changes;
        let variance = relative_uncertainty * relative_uncertainty + changes.dot(&moved);
        Self { covariance: &self.covariance - &moved * moved.transpose() / variance, only: self.only }
    }

    /// Standard uncertainty of each parameter, of that before any point.
    #[must_use]
    pub fn shares(&self) -> Vec<f64> {
        (0..self.covariance.nrows() - 1).map(|n| self.covariance[(n, n)].max(0.0).sqrt()).collect()
    }

    /// What a point is chosen by: the uncertainty of the parameter to narrow, of that before any point, or of all together the root of the
    /// determinant for each parameter.
    #[must_use]
    pub fn uncertainty(&self) -> f64 {
        let count = self.covariance.nrows() - 1;
        match self.only {
            Some(n) => self.covariance[(n, n)].max(0.0).sqrt(),
            None => {
                let determinant = self.covariance.view((0, 0), (count, count)).clone_owned().determinant();
                determinant.max(0.0).powf(0.5 / count as f64)
            }
        }
    }

    /// The places of the candidates that narrow most, one after another, each at most once, and what is known after each.
    #[must_use]
    pub fn choose(&self, candidates: &[Candidate], points: usize) -> Vec<(usize, Self)> {
        let mut chosen: Vec<(usize, Self)> = Vec::new();
        while chosen.len() < points {
            let known = chosen.last().map_or(self, |(_, known)| known);
            let left = (0..candidates.len()).filter(|n| chosen.iter().all(|(place, _)| place != n));
            let after = left.map(|n| (n, known.after(&candidates[n].changes, candidates[n].relative_uncertainty)));
            let Some(best) = after.min_by(|a, b| a.1.uncertainty().total_cmp(&b.1.uncertainty())) else { break };
            chosen.push(best);
        }
        chosen
    }
}

impl Mounted {
    /// The set-up with other values of parameters.
    ///
    /// # Errors
    /// Names a value that is not physical.
    pub fn at(&self, values: &[(Parameter, f64)]) -> Result<Self, Failure> {
        let model = system(&self.model, self.base_amplitude_m)?.at(values).0;
        model.validate()?;
        Ok(Self { model, ..self.clone() })
    }

    /// A point, started from rest, with its derivatives by parameters.
    ///
    /// # Errors
    /// Why it cannot be used.
    pub fn point(&self, frequency_hz: f64, parameters: &[Parameter]) -> Result<Settled, &'static str> {
        let (set_up, amplitude_m) = (&self.model, self.base_amplitude_m);
        let turning = TAU * frequency_hz;
        let rate = set_up.structure.damping_ratio() * set_up.structure.angular_frequency_rad_per_s();
        let cycles = (SETTLED / rate * frequency_hz).ceil().clamp(CYCLES[0], CYCLES[1]);
        let [low_m, high_m] = set_up.particle.map_or([0.0; 2], |particle| particle.ends_m());
        let initial = Initial { y_m: self.start_m.clamp(low_m, high_m), ..Initial::default() };
        let mut motion = Exact::new(set_up, &sine(amplitude_m, turning, 0.0), &initial).map_err(|_| NOT_PERIODIC)?;
        let mut seen = Response::new(Wanted::default());
        motion.run(cycles / frequency_hz, &mut seen);
        let orbit = PeriodicOrbit::near(set_up, amplitude_m, turning, motion.state(), 1).map_err(|_| NOT_PERIODIC)?;
        if !OrbitSummary::from(&orbit).is_run_on_it || orbit.stability() == Stability::Unstable {
            return Err(NOT_PERIODIC);
        }
        let map = ReturnMap::new(set_up, &sine(amplitude_m, turning, orbit.section_phase_rad), 1);
        let found = map.ok().and_then(|map| orbit.derivatives(&map, parameters).ok()).ok_or(NO_DERIVATIVE)?;
        let x = &found.largest_abs_x_m;
        if x.is_tie {
            return Err(NO_DERIVATIVE);
        }
        Ok(Settled {
            x_over_z: x.of.value / amplitude_m,
            max_abs_x_m: seen.max_abs_x_m(),
            by_parameters: x.of.by_parameters.iter().map(|by| by / x.of.value).collect(),
            holds_within: found.holds_within,
        })
    }

    /// A point as a candidate. `scale`: relative standard uncertainty of X/Z by the sensors' scale; `limit_m`: largest |x|.
    ///
    /// # Errors
    /// Why it is none.
    pub fn candidate(
        &self,
        (set_up, frequency_hz): (usize, f64),
        all: &[Uncertain],
        scale: f64,
        limit_m: f64,
    ) -> Result<Candidate, &'static str> {
        // Of a frequency that was measured several times the last point counts.
        let below = self.measured.iter().filter(|(hz, _)| *hz <= frequency_hz).max_by(|a, b| a.0.total_cmp(&b.0));
        let above = self.measured.iter().rev().filter(|(hz, _)| *hz >= frequency_hz).min_by(|a, b| a.0.total_cmp(&b.0));
        let uncertainties = [below, above].into_iter().flatten().map(|(_, uncertainty)| uncertainty.ok_or(NOT_SETTLED));
        let relative_uncertainty = uncertainties.collect::<Result<Vec<_>, _>>()?.into_iter().fold(0.0, f64::max);
        let parameters: Vec<Parameter> = self.own.iter().map(|n| all[*n].parameter).collect();
        let settled = self.point(frequency_hz, &parameters)?;
        if settled.max_abs_x_m > limit_m {
            return Err(BEYOND_LIMIT);
        }
        let mut changes = DVector::zeros(all.len() + 1);
        changes[all.len()] = scale;
        for (place, n) in self.own.iter().enumerate() {
            let Uncertain { value, standard_uncertainty, .. } = all[*n];
            if standard_uncertainty > settled.holds_within[place] * value.abs() {
                return Err(EVENTS_CHANGE);
            }
            changes[*n] = settled.by_parameters[place] * standard_uncertainty;
        }
        Ok(Candidate { set_up, frequency_hz, x_over_z: settled.x_over_z, relative_uncertainty, changes })
    }
}

fn sine(amplitude_m: f64, angular_frequency_rad_per_s: f64, phase_rad: f64) -> Excitation {
    Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad }
}

/// A set-up as its parameters see it, at any frequency.
fn system(model: &SetUp, amplitude_m: f64) -> Result<System, Failure> {
    Ok(System::new(model, &sine(amplitude_m, model.structure.angular_frequency_rad_per_s(), 0.0), Ties::default())?)
}

/// The parameter of a key, if it is known.
fn parameter_of(key: &str) -> Option<Parameter> {
    let all = PARAMETERS.iter().map(|of| (of.key, of.parameter)).chain(MORE);
    all.into_iter().find(|(name, _)| *name == key).map(|(_, parameter)| parameter)
}

/// The value of a parameter in a set-up that has it.
fn stated(model: &SetUp, system: &System, key: &str, parameter: Parameter) -> Option<f64> {
    let has_table = match key.split('.').next() {
        Some("particle") => model.particle.is_some(),
        Some("tmd") => model.tmd.is_some(),
        _ => true,
    };
    (has_table && system.has(parameter)).then(|| system.value(parameter))
}

/// The set-ups of a run with the parameters of the identified values. Of a file that is given (`is_given`), a value is that of the set-ups whose own
/// is nearest to it; of the campaign's file that of the set-ups that have it.
fn mounted(
    set_ups: &[&CampaignSetUp],
    identified: &[Identified],
    is_given: bool,
) -> Result<(Vec<Mounted>, Vec<Uncertain>), Failure> {
    let mut mounted = Vec::new();
    for set_up in set_ups {
        let (model, base_amplitude_m) = (set_up.model(), set_up.base_amplitude_m);
        let (name, label, start_m) = (set_up.name.clone(), set_up.label.clone(), set_up.particle_start_m());
        let (own, measured) = (Vec::new(), Vec::new());
        mounted.push(Mounted { name, label, model, base_amplitude_m, start_m, own, measured });
    }
    let systems: Result<Vec<System>, Failure> = mounted.iter().map(|m| system(&m.model, m.base_amplitude_m)).collect();
    let systems = systems?;
    let mut all: Vec<Uncertain> = Vec::new();
    let mut settings: Vec<Vec<(Parameter, f64)>> = vec![Vec::new(); mounted.len()];
    for entry in identified.iter().filter(|entry| entry.standard_uncertainty > 0.0) {
        let Some(parameter) = parameter_of(&entry.key) else { continue };
        if all.iter().any(|other| other.key == entry.key) {
            return Err(Failure::Input(format!("`{}` is identified twice\n  leave one entry of it", entry.key)));
        }
        let away = |n: usize| {
            let own = stated(&mounted[n].model, &systems[n], &entry.key, parameter)?;
            Some((own - entry.value).abs() / entry.value.abs())
        };
        let away: Vec<Option<f64>> = (0..mounted.len()).map(away).collect();
        let nearest = away.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let most = if is_given { nearest + SAME } else { SAME };
        let places: Vec<usize> = (0..mounted.len()).filter(|n| away[*n].is_some_and(|away| away <= most)).collect();
        if places.is_empty() {
            continue;
        }
        for n in &places {
            mounted[*n].own.push(all.len());
            settings[*n].push((parameter, entry.value));
        }
        all.push(Uncertain {
            key: entry.key.clone(),
            value: entry.value,
            standard_uncertainty: entry.standard_uncertainty,
            set_ups: places.iter().map(|n| mounted[*n].name.clone()).collect(),
            parameter,
        });
    }
    let at = |(set_up, values): (&Mounted, &Vec<(Parameter, f64)>)| {
        set_up.at(values).map_err(|error| Failure::Input(format!("set-up {:?}: {error}", set_up.name)))
    };
    let mounted: Result<Vec<Mounted>, Failure> = mounted.iter().zip(&settings).map(at).collect();
    Ok((mounted?, all))
}

/// The relative standard uncertainty of a point's X/Z as the run states it; none of a point that did not settle.
fn uncertainty_of(row: &ResultRow) -> Option<f64> {
    let uncertainty = 0.5 * f64::from(row.deviation_uncertainty);
    let is_known = row.steadiness.is_settled() && uncertainty > 0.0 && uncertainty.is_finite();
    is_known.then(|| uncertainty.max(MIN_UNCERTAINTY))
}

/// The frequencies to look at, Hz.
fn frequencies(wish: &Wish, rows: &[ResultRow], set_ups: usize) -> Result<Vec<f64>, Failure> {
    let all = || rows.iter().map(|row| row.frequency_hz);
    let (lowest_hz, highest_hz) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let (from_hz, to_hz) = (wish.from_hz.unwrap_or(lowest_hz), wish.to_hz.unwrap_or(highest_hz));
    if from_hz >= to_hz {
        return Err(Failure::Input(format!(
            "the band from {from_hz} Hz to {to_hz} Hz is empty\n  --from-hz must be less than --to-hz; their defaults are the run's lowest and \
             highest frequency"
        )));
    }
    if from_hz < 0.1 * lowest_hz || to_hz > 10.0 * highest_hz {
        return Err(Failure::Input(format!(
            "the band from {from_hz} Hz to {to_hz} Hz is far from that of the run, {lowest_hz} Hz to {highest_hz} Hz\n  --from-hz may be down to a \
             tenth of it, --to-hz up to ten times"
        )));
    }
    let step_hz = wish.step_hz.unwrap_or((to_hz - from_hz) / STEPS);
    let steps = ((to_hz - from_hz) / step_hz * (1.0 + 1e-9)).floor();
    if (steps + 1.0) * set_ups as f64 > MOST {
        return Err(Failure::Input(format!(
            "--step-hz {step_hz} gives more than {MOST} points from {from_hz} Hz to {to_hz} Hz on {set_ups} set-ups\n  choose a larger step or a \
             narrower band"
        )));
    }
    Ok((0..=steps as u32).map(|n| from_hz + f64::from(n) * step_hz).collect())
}

/// Chooses the points to measure next on the set-ups of a run. `file`: the identified values; those of the run's campaign without one.
///
/// # Errors
/// A run without a campaign, settled points or identified values; a key that has none; an empty band; no point that could be used.
pub fn identify(path: &Path, file: Option<&Path>, wish: &Wish) -> Result<Next, Failure> {
    let run = RunFolder::open(path).map_err(Failure::input)?;
    let failed = |text: String| Failure::Input(format!("{}: {text}", path.display()));
    let rows = run.result_rows().map_err(|error| failed(error.to_string()))?;
    let mut campaign: Campaign = campaign_copy::campaign(path).map_err(Failure::input)?;
    let device = run.manifest().device.as_ref();
    if let Some(settings) = device.and_then(|device| device.settings.as_ref()) {
        // Limits were checked before the run.
        let _ = campaign.on_board(&settings.settings, device.is_some_and(|device| device.simulated));
    }
    let known = file.map(SetUpFile::read).transpose()?.or(campaign.set_up_file.take());
    let Some(known) = known else {
        return Err(failed(
            "its campaign names no set-up file with identified values\n  give one: `damprig identify … --out identified.toml`, then \
             --set-up-file identified.toml"
                .into(),
        ));
    };
    let can_be_used = |set_up: &&CampaignSetUp| !(set_up.has_unmodelled_damper || set_up.model().is_force_driven);
    let set_ups: Vec<&CampaignSetUp> = campaign.set_ups.iter().filter(can_be_used).collect();
    let (mut set_ups, parameters) = mounted(&set_ups, &known.identified, file.is_some())
        .map_err(|error| Failure::Input(format!("{}: {error}", known.file)))?;
    if parameters.is_empty() {
        return Err(Failure::Input(format!(
            "{}: none of its identified values with an uncertainty is that of a set-up of {} on a moving base\n  `damprig identify … --out` writes \
             them; a campaign's own value overrides that of its set-up file, --set-up-file that of the campaign",
            known.file,
            path.display()
        )));
    }
    let place_of = |key: &String| parameters.iter().position(|parameter| parameter.key == *key);
    let only = match &wish.key {
        Some(key) => Some(place_of(key).ok_or_else(|| {
            let keys: Vec<&str> = parameters.iter().map(|parameter| parameter.key.as_str()).collect();
            Failure::Input(format!(
                "--for {key}: it has no identified value with an uncertainty\n  one of {}",
                keys.join(", ")
            ))
        })?),
        None => None,
    };
    let least_known = rows.iter().filter_map(uncertainty_of).reduce(f64::max).ok_or_else(|| {
        failed(
            "it has no settled point of a stepped sine, whose uncertainty the next ones will have\n  settle longer (`steady`, `longest_dwell_s`)"
                .into(),
        )
    })?;
    for set_up in &mut set_ups {
        let own = rows.iter().filter(|row| row.set_up == set_up.name);
        set_up.measured = own.map(|row| (row.frequency_hz, uncertainty_of(row))).collect();
        if set_up.measured.is_empty() {
            set_up.measured.push((0.0, Some(least_known)));
        }
    }
    let frequencies = frequencies(wish, &rows, set_ups.len())?;
    // X/Z has the errors of both scales.
    let scale = 2.0_f64.sqrt() * Sensors::of_run(&run).scale;
    let limit_m = USABLE * campaign.rig.structure_limit_m();
    let places: Vec<(usize, f64)> =
        (0..set_ups.len()).flat_map(|set_up| frequencies.iter().map(move |hz| (set_up, *hz))).collect();
    let looked: Vec<Result<Candidate, &'static str>> =
        places.par_iter().map(|at| set_ups[at.0].candidate(*at, &parameters, scale, limit_m)).collect();
    let mut reasons: BTreeMap<(usize, &'static str), usize> = BTreeMap::new();
    for (at, looked) in places.iter().zip(&looked) {
        if let Err(reason) = looked {
            *reasons.entry((at.0, *reason)).or_default() += 1;
        }
    }
    let left_out = reasons.into_iter().map(|((set_up, reason), points)| {
        let set_up = set_ups[set_up].name.clone();
        LeftOut { set_up, reason, points }
    });
    let left_out: Vec<LeftOut> = left_out.collect();
    let before = Knowledge::before(parameters.len(), only);
    let gain = |candidate: &Candidate| before.after(&candidate.changes, candidate.relative_uncertainty).uncertainty();
    let gains = set_ups.iter().zip(looked.chunks(frequencies.len())).map(|(set_up, own)| {
        let points = frequencies.iter().zip(own).map(|(hz, looked)| (*hz, looked.as_ref().ok().map(gain)));
        Gain { set_up: set_up.name.clone(), label: set_up.label.clone(), points: points.collect() }
    });
    let gains = gains.collect();
    let candidates: Vec<Candidate> = looked.into_iter().filter_map(Result::ok).collect();
    if candidates.is_empty() {
        let why: Vec<String> = left_out.iter().map(|left| format!("\n  {left}")).collect();
        return Err(failed(format!("none of {} points can be used{}", places.len(), why.concat())));
    }
    let points = before.choose(&candidates, wish.points).into_iter().map(|(n, known)| {
        let Candidate { set_up, frequency_hz, x_over_z, relative_uncertainty, .. } = candidates[n];
        let Mounted { name, base_amplitude_m, .. } = &set_ups[set_up];
        let after = known.shares().into_iter().zip(&parameters);
        let standard_uncertainties = after.map(|(share, of)| share * of.standard_uncertainty).collect();
        let (set_up, base_amplitude_m) = (name.clone(), *base_amplitude_m);
        NextPoint { set_up, base_amplitude_m, frequency_hz, x_over_z, relative_uncertainty, standard_uncertainties }
    });
    Ok(Next {
        run: run.id(),
        key: wish.key.clone(),
        points: points.collect(),
        looked_at: places.len(),
        left_out,
        remarks: remarks(&campaign, &known, &set_ups, &parameters, scale),
        gains,
        parameters,
        values_from: known.file,
    })
}

/// What a person has to know.
fn remarks(campaign: &Campaign, known: &SetUpFile, set_ups: &[Mounted], all: &[Uncertain], scale: f64) -> Vec<String> {
    let mut remarks = vec![format!(
        "the uncertainty of a point is the larger one of the run's neighbouring points on its set-up, so it needs the same dwell; the error of the \
         sensors' scale, {:.3} %, is common to all points",
        100.0 * scale
    )];
    let is_used = |entry: &&Identified| all.iter().any(|parameter| parameter.key == entry.key);
    let unused: Vec<&str> =
        known.identified.iter().filter(|entry| !is_used(entry)).map(|entry| entry.key.as_str()).collect();
    if !unused.is_empty() {
        remarks.push(format!("not used: {} of {}; they count as exact", unused.join(", "), known.file));
    }
    let is_left_out = |set_up: &&CampaignSetUp| set_ups.iter().all(|other| other.name != set_up.name);
    let left_out: Vec<&str> = campaign.set_ups.iter().filter(is_left_out).map(|set_up| set_up.name.as_str()).collect();
    if !left_out.is_empty() {
        let text = "set-ups that are left out, since they have a damper without a model or are driven by a force";
        remarks.push(format!("{text}: {}", left_out.join(", ")));
    }
    remarks
}
