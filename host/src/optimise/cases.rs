//! The cases of a point of an optimisation.

use super::file::Optimisation;
use crate::failure::Failure;
use crate::simulation::Case;
use crate::study::axis::Value;
use crate::study::direct;

/// The cases of a point: one for each point of the band.
#[derive(Debug)]
pub struct Cases<'a> {
    set: Vec<Value>,
    cases: direct::Cases<'a>,
}

impl<'a> Cases<'a> {
    /// With these values of the variables and of what is uncertain.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn at(optimisation: &'a Optimisation, values: &[f64]) -> Result<Self, Failure> {
        let set: Vec<Value> = values.iter().copied().map(Value::Number).collect();
        let first = [&set[..], &optimisation.band_values(0)].concat();
        Ok(Self { cases: optimisation.direct.at(optimisation.varied_case(), &first)?, set })
    }

    /// The case with values of the band's axes.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn case(&self, at: &[Value]) -> Result<Case, Failure> {
        self.cases.with(&[&self.set[..], at].concat())
    }
}
