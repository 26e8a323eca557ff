//! The set-ups of a run with the parameters whose identified values they have.

use damprig_continuation::{Parameter, System, Ties};
use damprig_core::integrator::exact::Excitation;
use damprig_core::model::SetUp;
use serde::Serialize;

use crate::campaign::CampaignSetUp;
use crate::failure::Failure;
use crate::setup::Identified;
use crate::simulation::analysis::MORE;
use crate::simulation::parameters::PARAMETERS;

/// An identified value is that of a set-up of the campaign that read it if both agree to this share.
const SAME: f64 = 1e-6;

/// An identified parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdentifiedParameter {
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
pub struct MeasurableSetUp {
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

impl MeasurableSetUp {
    /// The set-up with other values of parameters.
    ///
    /// # Errors
    /// Names a value that is not physical.
    pub fn at(&self, values: &[(Parameter, f64)]) -> Result<Self, Failure> {
        let model = system(&self.model, self.base_amplitude_m)?.at(values).0;
        model.validate()?;
        Ok(Self { model, ..self.clone() })
    }
}

pub(super) fn sine(amplitude_m: f64, angular_frequency_rad_per_s: f64, phase_rad: f64) -> Excitation {
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
pub(super) fn measurable(
    set_ups: &[&CampaignSetUp],
    identified: &[Identified],
    is_given: bool,
) -> Result<(Vec<MeasurableSetUp>, Vec<IdentifiedParameter>), Failure> {
    let mut measurable = Vec::new();
    for set_up in set_ups {
        let (model, base_amplitude_m) = (set_up.model(), set_up.base_amplitude_m);
        let (name, label, start_m) = (set_up.name.clone(), set_up.label.clone(), set_up.particle_start_m());
        let (own, measured) = (Vec::new(), Vec::new());
        measurable.push(MeasurableSetUp { name, label, model, base_amplitude_m, start_m, own, measured });
    }
    let systems: Result<Vec<System>, Failure> =
        measurable.iter().map(|m| system(&m.model, m.base_amplitude_m)).collect();
    let systems = systems?;
    let mut all: Vec<IdentifiedParameter> = Vec::new();
    let mut settings: Vec<Vec<(Parameter, f64)>> = vec![Vec::new(); measurable.len()];
    for entry in identified.iter().filter(|entry| entry.standard_uncertainty > 0.0) {
        let Some(parameter) = parameter_of(&entry.key) else { continue };
        if all.iter().any(|other| other.key == entry.key) {
            return Err(Failure::Input(format!("`{}` is identified twice\n  leave one entry of it", entry.key)));
        }
        let away = |n: usize| {
            let own = stated(&measurable[n].model, &systems[n], &entry.key, parameter)?;
            Some((own - entry.value).abs() / entry.value.abs())
        };
        let away: Vec<Option<f64>> = (0..measurable.len()).map(away).collect();
        let nearest = away.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let most = if is_given { nearest + SAME } else { SAME };
        let places: Vec<usize> = (0..measurable.len()).filter(|n| away[*n].is_some_and(|away| away <= most)).collect();
        if places.is_empty() {
            continue;
        }
        for n in &places {
            measurable[*n].own.push(all.len());
            settings[*n].push((parameter, entry.value));
        }
        all.push(IdentifiedParameter {
            key: entry.key.clone(),
            value: entry.value,
            standard_uncertainty: entry.standard_uncertainty,
            set_ups: places.iter().map(|n| measurable[*n].name.clone()).collect(),
            parameter,
        });
    }
    let at = |(set_up, values): (&MeasurableSetUp, &Vec<(Parameter, f64)>)| {
        set_up.at(values).map_err(|error| Failure::Input(format!("set-up {:?}: {error}", set_up.name)))
    };
    let measurable: Result<Vec<MeasurableSetUp>, Failure> = measurable.iter().zip(&settings).map(at).collect();
    Ok((measurable?, all))
}
