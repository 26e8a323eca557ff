//! A case whose keys a study or an optimisation sets, and where their file has what the case refuses.

use std::path::Path;
use std::sync::Arc;

use super::axis::{AxisValue, AxisValues, StudyAxis};
use crate::failure::Failure;
use crate::input::{Files, Problem, Source};
use crate::simulation::case::default_name;
use crate::simulation::{Case, SetValues};

/// The case and the axes that set its keys.
#[derive(Clone, Copy, Debug)]
pub struct VariedCase<'a> {
    /// Path of the case.
    pub path: &'a Path,
    /// Text of the case.
    pub text: &'a str,
    /// The files that the case names.
    pub files: &'a Arc<Files>,
    /// What sets its keys.
    pub axes: &'a [StudyAxis],
    /// Who sets them, in messages about a single point.
    pub origin: &'static str,
}

impl VariedCase<'_> {
    /// Values of the axes, to be set in the case.
    #[must_use]
    pub fn set_values(&self, values: &[AxisValue]) -> SetValues {
        SetValues { origin: self.origin.into(), lines: lines(self.axes, values) }
    }

    /// The case with values of the axes.
    ///
    /// # Errors
    /// Names the key, its value and what is allowed.
    pub fn with(&self, values: &[AxisValue]) -> Result<Case, Failure> {
        self.parse(&self.source(), values)
    }

    /// As [`Self::with`]; a problem of a key or value is shown where `file`, which has the axes, has it.
    ///
    /// # Errors
    /// As [`Self::with`].
    pub fn checked(&self, file: &Source, values: &[AxisValue]) -> Result<Case, Failure> {
        let case = self.source();
        let read = self.parse(&case, values);
        read.map_err(|refusal| refused(file, self.axes, values, (&case, self.origin), refusal))
    }

    fn source(&self) -> Source {
        Source::new(self.path.display().to_string(), self.text).with_files(self.files)
    }

    fn parse(&self, case: &Source, values: &[AxisValue]) -> Result<Case, Failure> {
        Case::parse_changed(case, &default_name(self.path), &self.set_values(values))
    }
}

/// Values of axes as lines of TOML.
fn lines(axes: &[StudyAxis], values: &[AxisValue]) -> String {
    let line = |(axis, value): (&StudyAxis, &AxisValue)| format!("{} = {}\n", axis.key, value.toml());
    axes.iter().zip(values).map(line).collect()
}

/// Says where the `file` of some axes has what a case refuses: a key, or a value of it. `case` is the case with these values, a line
/// for each axis, in the attached text `origin`, and `refusal` what it says of problems elsewhere.
fn refused(
    file: &Source,
    axes: &[StudyAxis],
    values: &[AxisValue],
    (case, origin): (&Source, &str),
    refusal: Failure,
) -> Failure {
    let lines = lines(axes, values);
    for problem in case.problems_in(origin) {
        let before = lines.get(..problem.span.start).unwrap_or(&lines);
        let place = before.matches('\n').count();
        let (Some(axis), Some(value)) = (axes.get(place), values.get(place)) else { continue };
        let is_key = before.len() - before.rfind('\n').map_or(0, |end| end + 1) < axis.key.len();
        if is_key {
            file.report(Problem { span: axis.span.clone(), ..problem });
            continue;
        }
        let (span, title, help) = match axis.span_of(value) {
            Some(span) => {
                let written = file.written(&span).unwrap_or_default();
                let title = format!("`{}` = {written} is not allowed", axis.key);
                (span, title, problem.help)
            }
            None if axis.is_scattered() => {
                let help = "its distribution ends there: give `from` and `to`, between which it is cut off".to_string();
                let help = matches!(axis.values, AxisValues::Drawn(_)).then_some(help).or(problem.help);
                (axis.span.clone(), problem.title, help)
            }
            // Both ends are allowed.
            None => {
                let help = "choose `from`, `to` and `count` so that every value is allowed, or give `values`";
                (axis.span.clone(), problem.title, Some(help.into()))
            }
        };
        file.report(Problem { title, span, allowed: problem.allowed, help });
    }
    file.verdict().err().unwrap_or_else(|| {
        let at = lines.trim_end().replace('\n', ", ");
        Failure::Input(format!("{refusal}\n  {} sets {at}", file.name()))
    })
}
