//! What the structure does without its dampers, and with a tuned mass damper of equal mass, over the same band and record.

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::{Tmd, Tuning};
use serde::Serialize;

use super::cases::BandCases;
use super::evaluate::{Evaluated, GoOnAfter, over_band};
use super::file::Optimisation;
use crate::failure::Failure;
use crate::simulation::Case;
use crate::study::axis::AxisValue;
use crate::study::metric::refusal;

/// The objective of other dampers; `None` where it does not exist for them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct References {
    /// Of the structure without any damper.
    pub bare: Option<f64>,
    /// Of the structure with a tuned mass damper in place of the dampers.
    pub tmd: Option<TunedMass>,
}

/// A tuned mass damper of the mass of the case's particle (or of its own tuned mass); on a structure with several places, of all of them, at the place of the
/// first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TunedMass {
    /// Its mass, kg.
    pub mass_kg: f64,
    /// The rule that tunes it.
    pub tuning: &'static str,
    /// γ, its natural frequency over that of the structure.
    pub frequency_ratio: f64,
    /// ζ₁, its damping ratio.
    pub damping_ratio: f64,
    /// The objective.
    pub objective: f64,
}

impl References {
    /// At the optimum's structure, base motion and mass.
    ///
    /// # Errors
    /// The refusal of a case that the values make, or that `go_on` said no.
    pub fn at(optimisation: &Optimisation, best: &Evaluated, go_on: GoOnAfter) -> Result<Self, Failure> {
        let middle = optimisation.band_values(optimisation.band_points() / 2);
        let middle = BandCases::at(optimisation, &best.values)?.case(&middle)?;
        let bare = objective(optimisation, best, &|case| case.with_dampers(None), go_on)?;
        let Some((mass_kg, structure)) = middle.damper_mass() else { return Ok(Self { bare, tmd: None }) };
        let is_force = matches!(middle.excitation, Excitation::ForceSine { .. } | Excitation::ForceHalfSine { .. });
        let tuning = if is_force { Tuning::DenHartog } else { Tuning::Warburton };
        let tmd = Tmd::tuned(&structure, mass_kg, tuning);
        let mass_ratio = mass_kg / structure.mass_kg;
        let with_tmd = objective(optimisation, best, &|case| case.with_dampers(Some(tmd)), go_on)?;
        let tmd = with_tmd.map(|objective| TunedMass {
            mass_kg,
            tuning: tuning.name(),
            frequency_ratio: tuning.frequency_ratio(mass_ratio),
            damping_ratio: tuning.damping_ratio(mass_ratio),
            objective,
        });
        Ok(Self { bare, tmd })
    }
}

/// The objective with other dampers, if it exists.
fn objective(
    optimisation: &Optimisation,
    best: &Evaluated,
    change: &dyn Fn(Case) -> Case,
    go_on: GoOnAfter,
) -> Result<Option<f64>, Failure> {
    let cases = BandCases::at(optimisation, &best.values)?;
    let changed = |at: &[AxisValue]| Ok(change(cases.case(at)?));
    let first = changed(&optimisation.band_values(0))?;
    if refusal(optimisation.objective, &first).is_some() || first.set_up.validate().is_err() {
        return Ok(None);
    }
    let value = over_band(optimisation, &changed, go_on)?;
    Ok(Some(value).filter(|value| !value.is_nan()))
}
