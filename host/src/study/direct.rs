//! Makes the cases of a study or a search. Reading a case's text takes longer than simulating it for a few cycles, so numbers that stand
//! alone in the model are set there; some of their cases are compared with those that are read.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Wall;

use super::axis::AxisValue;
use super::samples;
use super::varied_case::VariedCase;
use crate::failure::Failure;
use crate::simulation::Case;

/// A number of the model that a key states alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ModelNumber {
    Clearance,
    ClearanceRatio,
    Restitution,
    InternalFriction,
    Friction,
    FrictionRatio,
    Hertz,
    Angular,
    FrequencyRatio,
}

impl ModelNumber {
    fn of(key: &str) -> Option<Self> {
        Some(match key {
            "particle.clearance_m" => Self::Clearance,
            "particle.clearance_ratio" => Self::ClearanceRatio,
            "particle.wall.coefficient" => Self::Restitution,
            "particle.friction_coefficient" => Self::InternalFriction,
            "friction_damper.force_n" => Self::Friction,
            "friction_damper.friction_ratio" => Self::FrictionRatio,
            "base.frequency_hz" | "force.frequency_hz" => Self::Hertz,
            "base.angular_frequency_rad_per_s" | "force.angular_frequency_rad_per_s" => Self::Angular,
            "base.frequency_ratio" | "force.frequency_ratio" => Self::FrequencyRatio,
            _ => return None,
        })
    }

    /// Sets it, if the case has it; with the operations of [`crate::setup`], so that no bit differs.
    fn set(self, case: &mut Case, value: f64) -> Option<()> {
        match self {
            Self::Clearance => case.set_up.particle.as_mut()?.clearance_m = value,
            Self::ClearanceRatio => {
                let (reference_m, _) = case.reference_m()?;
                case.set_up.particle.as_mut()?.clearance_m = value * reference_m;
            }
            Self::Restitution => match &mut case.set_up.particle.as_mut()?.wall {
                Wall::Restitution { coefficient } => *coefficient = value,
                Wall::SpeedRestitution(law) => law.coefficient = value,
                Wall::TableRestitution(_) | Wall::Voigt { .. } | Wall::Hertz(_) => return None,
            },
            Self::InternalFriction => case.set_up.particle.as_mut()?.friction_coefficient = value,
            Self::Friction => case.set_up.friction_damper.as_mut()?.force_n = value,
            Self::FrictionRatio => {
                let (reference_m, _) = case.reference_m()?;
                let force_n = value * case.set_up.structure.stiffness_n_per_m * reference_m;
                case.set_up.friction_damper.as_mut()?.force_n = force_n;
            }
            Self::Hertz => *angular_frequency(case)? = TAU * value,
            Self::Angular => *angular_frequency(case)? = value,
            Self::FrequencyRatio => {
                let natural = case.set_up.structure.angular_frequency_rad_per_s();
                *angular_frequency(case)? = value * natural;
            }
        }
        Some(())
    }
}

fn angular_frequency(case: &mut Case) -> Option<&mut f64> {
    match &mut case.excitation {
        Excitation::Sine { angular_frequency_rad_per_s, .. }
        | Excitation::ForceSine { angular_frequency_rad_per_s, .. } => Some(angular_frequency_rad_per_s),
        _ => None,
    }
}

/// Which axes are set in the model.
#[derive(Clone, Debug, Default)]
pub struct Direct {
    /// For each axis its number of the model, if it has one; empty if all are read.
    numbers: Vec<Option<ModelNumber>>,
    /// The case, if nothing else than such numbers varies.
    template: Option<Case>,
}

impl Direct {
    /// For axes of which some vary at each point while the others keep their values. The cases that are `compared` are sound. All are read
    /// if a case differs otherwise, of these or with one axis alone at its ends or in its middle, or if an axis that varies has no number.
    #[must_use]
    pub fn of(varied: VariedCase, mut compared: Vec<Vec<AxisValue>>, varies: impl Fn(usize) -> bool) -> Self {
        let numbers: Vec<Option<ModelNumber>> = varied.axes.iter().map(|axis| ModelNumber::of(&axis.key)).collect();
        let is_all = numbers.iter().all(Option::is_some);
        let mut varying = (0..numbers.len()).filter(|axis| varies(*axis)).peekable();
        let can_be_kept = varying.peek().is_some() && varying.all(|axis| numbers[axis].is_some());
        if !(is_all || can_be_kept) || !varied.axes.iter().all(samples::are_all_checked) {
            return Self::default();
        }
        let first = compared[0].clone();
        compared.extend(samples::ends_and_middles(varied.axes, &first));
        let template = if is_all { varied.with(&first).ok() } else { None };
        let direct = Self { numbers, template };
        // Where all is read, a value alone may be refused; no case has it then.
        let is_same = |values: &Vec<AxisValue>| match varied.with(values) {
            Err(_) => true,
            Ok(read) => {
                let template = direct.template_of_others(varied, &first, values, &varies);
                template.and_then(|template| direct.set(&template, values)) == Some(read)
            }
        };
        if compared.iter().all(is_same) { direct } else { Self::default() }
    }

    /// The cases of the points that have the values of axes that do not vary from these.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn at<'a>(&'a self, varied: VariedCase<'a>, values: &[AxisValue]) -> Result<DirectCases<'a>, Failure> {
        Ok(DirectCases { varied, direct: self, template: self.template_at(varied, values)? })
    }

    /// The case in which the numbers are set: one for all, or one for these values. `None` if all is read.
    fn template_at(&self, varied: VariedCase, values: &[AxisValue]) -> Result<Option<Case>, Failure> {
        match &self.template {
            Some(template) => Ok(Some(template.clone())),
            None if self.numbers.is_empty() => Ok(None),
            None => varied.with(values).map(Some),
        }
    }

    /// The case in which the numbers of a point are set whose axes that vary are not yet at `values`, but at `first`.
    fn template_of_others(
        &self,
        varied: VariedCase,
        first: &[AxisValue],
        values: &[AxisValue],
        varies: impl Fn(usize) -> bool,
    ) -> Option<Case> {
        let value = |place: usize| if varies(place) { first[place].clone() } else { values[place].clone() };
        let others: Vec<AxisValue> = (0..values.len()).map(value).collect();
        self.template_at(varied, &others).ok().flatten()
    }

    fn set(&self, template: &Case, values: &[AxisValue]) -> Option<Case> {
        let mut case = template.clone();
        for (number, value) in self.numbers.iter().zip(values) {
            if let (Some(number), AxisValue::Number(value)) = (number, value) {
                number.set(&mut case, *value)?;
            }
        }
        Some(case)
    }
}

/// Cases that differ only in the axes that vary.
#[derive(Clone, Debug)]
pub struct DirectCases<'a> {
    varied: VariedCase<'a>,
    direct: &'a Direct,
    template: Option<Case>,
}

impl DirectCases<'_> {
    /// The case with these values of all axes.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn with(&self, values: &[AxisValue]) -> Result<Case, Failure> {
        let made = self.template.as_ref().and_then(|template| self.direct.set(template, values));
        made.map_or_else(|| self.varied.with(values), Ok)
    }
}

#[cfg(test)]
mod tests {
    use crate::study::Study;

    const CASES: [(&str, &str); 4] = [
        ("base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }", "base.frequency_hz"),
        ("base = { kind = \"sine\", amplitude_m = 0.003, frequency_ratio = 1 }", "base.frequency_ratio"),
        (
            "base = { kind = \"sine\", amplitude_m = 0.003, angular_frequency_rad_per_s = 16 }",
            "base.angular_frequency_rad_per_s",
        ),
        ("force = { kind = \"sine\", amplitude_n = 1.2, frequency_ratio = 1 }", "force.frequency_ratio"),
    ];

    /// A study whose last axis is a band.
    fn read(excitation: &str, start: &str, keys: &[&str]) -> (tempfile::TempDir, Study) {
        let case = format!(
            "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n\
             friction_damper = {{ friction_ratio = 0.4 }}\nrun = {{ duration_s = 8 }}\n{excitation}\n\
             particle = {{ mass_ratio = 0.1, clearance_ratio = 9, start = \"{start}\", \
             wall = {{ kind = \"restitution\", coefficient = 0.5 }} }}\n"
        );
        let mut text = "case = \"case.toml\"\nmetrics = [\"rms_x_m\"]\nsampling = { method = \"sobol\", count = 40 }\n"
            .to_string();
        for (place, key) in keys.iter().enumerate() {
            let rest = if place + 1 == keys.len() { "count = 5\nreduce = \"maximum\"\n" } else { "" };
            text.push_str(&format!("[[axis]]\nkey = \"{key}\"\nfrom = 0.3\nto = 0.9\n{rest}"));
        }
        let folder = tempfile::TempDir::new().expect("a folder");
        std::fs::write(folder.path().join("case.toml"), case).expect("it is written");
        std::fs::write(folder.path().join("study.toml"), text).expect("it is written");
        let study = Study::read(&folder.path().join("study.toml")).expect("it is valid");
        (folder, study)
    }

    fn is_equal_to_read(study: &Study) -> bool {
        (0..study.rows()).all(|row| {
            let cases = study.cases(row).expect("it is valid");
            (0..5)
                .map(|point| study.points.values(&study.axes, row, point))
                .all(|values| cases.with(&values).expect("sound") == study.case_with(&values).expect("sound"))
        })
    }

    #[test]
    fn a_case_whose_numbers_are_set_equals_the_case_that_is_read_to_the_last_bit() {
        for (excitation, frequency) in CASES {
            let keys = ["particle.clearance_ratio", "friction_damper.friction_ratio", "particle.wall.coefficient"];
            let (_folder, study) = read(excitation, "centre", &[&keys[..], &[frequency]].concat());
            assert!(study.direct.template.is_some(), "{frequency}: nothing is read again");
            assert!(is_equal_to_read(&study), "{frequency}");
            let keys = ["particle.clearance_m", "friction_damper.force_n", "particle.friction_coefficient"];
            let (_folder, study) = read(excitation, "centre", &[&keys[..], &[frequency]].concat());
            assert!(study.direct.template.is_some() && is_equal_to_read(&study), "{frequency}");
        }
    }

    #[test]
    fn an_axis_that_others_depend_on_is_read_and_a_start_at_a_wall_is_not_set() {
        let (excitation, frequency) = CASES[0];
        let (_folder, study) = read(excitation, "centre", &["base.amplitude_m", "particle.clearance_ratio", frequency]);
        assert!(study.direct.template.is_none() && !study.direct.numbers.is_empty());
        assert!(is_equal_to_read(&study));
        let (_folder, study) = read(excitation, "at_positive_wall", &["particle.clearance_ratio", frequency]);
        assert!(study.direct.numbers.is_empty(), "the start moves with the clearance");
        assert!(is_equal_to_read(&study));
        // The corners of seven axes are not all compared; each axis alone is.
        let many = [
            "particle.wall.coefficient",
            "particle.friction_coefficient",
            "friction_damper.force_n",
            "structure.damping_ratio",
            "particle.mass_ratio",
            frequency,
            "particle.clearance_ratio",
        ];
        let (_folder, study) = read(excitation, "at_positive_wall", &many);
        assert!(is_equal_to_read(&study));
    }
}
