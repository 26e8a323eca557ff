//! How the results of a periodic motion follow its quantities: exact derivatives through every event
//! ([`damprig_continuation::Derivatives`]).

use damprig_continuation::{Derived, Parameter};
use serde::Serialize;

use super::periodic_orbit::PeriodicOrbit;
use super::return_map;
use crate::simulation::Case;
use crate::simulation::parameters::PARAMETERS;

/// Keys besides those that `damprig continue` follows.
pub(crate) const MORE: [(&str, Parameter); 2] =
    [("structure.natural_frequency_hz", Parameter::NaturalFrequency), ("structure.mass_kg", Parameter::StructureMass)];

/// Ratios and the dashpot's constant say again what the other keys say.
const LEFT_OUT: [Parameter; 6] = [
    Parameter::StructureDamping,
    Parameter::MassRatio,
    Parameter::ClearanceRatio,
    Parameter::DamperForceRatio,
    Parameter::LinkFrequencyRatio,
    Parameter::LinkDampingRatio,
];

/// Relative changes of the results of a motion per relative change of a quantity, d ln(result)/d ln(quantity).
#[derive(Clone, Debug, Serialize)]
pub struct Sensitivity {
    /// Key of the quantity in a case, with its table.
    pub key: String,
    /// Its value, in the unit of the key.
    pub value: f64,
    /// Of the largest |x|.
    pub max_abs_x: f64,
    /// Of the RMS of x.
    pub rms_x: f64,
    /// Of the approach speed of the fastest impact; `None` without impacts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub impact_speed: Option<f64>,
    /// Relative change of the quantity within which, to first order, the motion has the same events; `None`: any.
    pub holds_within: Option<f64>,
}

/// Sensitivities to the keys of a case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunKeys {
    /// Drive periods after which the end of the run repeats to 10⁻⁶ of its size: they are those of the periodic motion. `None`: of the whole run,
    /// from its given start.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repeats_after: Option<u32>,
    /// Floquet multipliers of the periodic motion, real and imaginary part, the largest first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub multipliers: Vec<[f64; 2]>,
    /// Keys of numbers with which the case is another one or refused where they are 0.3 % larger or smaller: counts, places that fall together.
    pub left_out: Vec<String>,
    /// Keys of numbers of which any change, however small, changes the sequence of events: a motion that grazes, or friction that holds by nothing.
    pub grazing: Vec<String>,
}

/// The sensitivities of the results of a periodic motion, whose quantities keep their values in SI units but for stiffness and dashpot of the
/// structure, which follow from M, fn and ζ; or of a run, whose case keeps its other keys.
#[derive(Clone, Debug, Serialize)]
pub struct Sensitivities {
    /// Present where they are those to the keys of the case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<RunKeys>,
    /// Of each quantity by which there are derivatives and that is not 0, the most important for the largest |x| first.
    pub of: Vec<Sensitivity>,
    /// Whether |x| is largest at two places with other derivatives: that of the largest |x| is of one of them.
    pub is_tie: bool,
    /// The same of two fastest impacts.
    pub is_speed_tie: bool,
}

impl Sensitivities {
    /// Of an orbit of a case under a sine; without them the reason.
    pub fn of(case: &Case, orbit: &PeriodicOrbit) -> Result<Self, String> {
        let set_up = &case.set_up;
        let map = return_map(case, orbit.section_phase_rad, orbit.periods).map_err(|why| why.to_string())?;
        let second_mass = if set_up.tmd.is_some() { "tmd." } else { "particle." };
        let followed = PARAMETERS.iter().map(|of| (of.key, of.parameter)).chain(MORE);
        let quantities: Vec<(&'static str, Parameter, f64)> = followed
            .filter(|(key, parameter)| {
                map.system().has(*parameter) && !LEFT_OUT.contains(parameter) && !key.starts_with("force.")
            })
            .filter(|(key, parameter)| {
                let is_shared = [Parameter::Mass, Parameter::LinkStiffness, Parameter::LinkDamping].contains(parameter);
                !is_shared || key.starts_with(second_mass)
            })
            .map(|(key, parameter)| (key, parameter, map.system().value(parameter)))
            .filter(|(_, _, value)| *value != 0.0)
            .collect();
        let parameters: Vec<Parameter> = quantities.iter().map(|(_, parameter, _)| *parameter).collect();
        let found = orbit.derivatives(&map, &parameters).map_err(|why| why.to_string())?;
        let (x, fastest) = (&found.largest_abs_x_m, found.fastest_impact_m_per_s.as_ref());
        let of: Vec<Sensitivity> = quantities
            .iter()
            .enumerate()
            .map(|(p, (key, _, value))| {
                let relative = |of: &Derived| of.by_parameters[p] * value / of.value;
                Sensitivity {
                    key: (*key).to_string(),
                    value: *value,
                    max_abs_x: relative(&x.of),
                    rms_x: relative(&found.rms_x_m),
                    impact_speed: fastest.map(|fastest| relative(&fastest.of)),
                    holds_within: Some(found.holds_within[p]).filter(|within| within.is_finite()),
                }
            })
            .collect();
        let ties = [x.is_tie, fastest.is_some_and(|fastest| fastest.is_tie)];
        Ok(Self::sorted(of, None, ties))
    }

    /// The most important for the largest |x| first; `ties`: of the largest |x| and of the fastest impact.
    pub(super) fn sorted(mut of: Vec<Sensitivity>, run: Option<RunKeys>, ties: [bool; 2]) -> Self {
        of.sort_by(|a, b| b.max_abs_x.abs().total_cmp(&a.max_abs_x.abs()));
        let [is_tie, is_speed_tie] = ties;
        Self { run, of, is_tie, is_speed_tie }
    }
}
