//! The cases of a point of an optimisation.

use super::file::Optimisation;
use crate::failure::Failure;
use crate::simulation::Case;
use crate::study::axis::AxisValue;
use crate::study::direct;

/// The cases of a point: one for each point of the band.
#[derive(Debug)]
pub struct BandCases<'a> {
    set: Vec<AxisValue>,
    cases: direct::DirectCases<'a>,
}

impl<'a> BandCases<'a> {
    /// With these values of the variables and of what is uncertain.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn at(optimisation: &'a Optimisation, values: &[f64]) -> Result<Self, Failure> {
        let set: Vec<AxisValue> = values.iter().copied().map(AxisValue::Number).collect();
        let first = [&set[..], &optimisation.band_values(0)].concat();
        Ok(Self { cases: optimisation.direct.at(optimisation.varied_case(), &first)?, set })
    }

    /// The case with values of the band's axes.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn case(&self, at: &[AxisValue]) -> Result<Case, Failure> {
        self.cases.with(&[&self.set[..], at].concat())
    }
}
