//! Makes the cases of a search. Reading a case's text takes longer than simulating it for a few cycles, so numbers that stand alone
//! in the model are set there; the file's corners are compared with the cases that are read.

use std::f64::consts::TAU;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Wall;

use super::file::Optimisation;
use crate::input::Refusal;
use crate::simulation::Case;
use crate::study::axis::Value;
use crate::study::file::corners;

/// A number of the model that a key states alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
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

impl Number {
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
pub(super) struct Direct {
    /// For each axis its number of the model, if it has one; empty if all are read.
    numbers: Vec<Option<Number>>,
    /// The case, if nothing else than such numbers varies.
    template: Option<Case>,
}

impl Direct {
    /// For an optimisation whose corners are sound. All its axes are read if a corner differs otherwise.
    pub(super) fn of(optimisation: &Optimisation) -> Self {
        let numbers: Vec<Option<Number>> = optimisation.axes.iter().map(|axis| Number::of(&axis.key)).collect();
        if numbers[optimisation.set()..].iter().any(Option::is_none) {
            return Self::default();
        }
        let corners = corners(&optimisation.axes);
        let template =
            if numbers.iter().all(Option::is_some) { optimisation.case_with(&corners[0]).ok() } else { None };
        let direct = Self { numbers, template };
        let is_same = |corner: &Vec<Value>| {
            let read = optimisation.case_with(corner).ok();
            let made = direct.template_at(optimisation, corner).ok().flatten();
            read.is_some() && made.and_then(|template| direct.set(&template, corner)) == read
        };
        if corners.iter().all(is_same) { direct } else { Self::default() }
    }

    /// The case in which the numbers are set: one for all, or one for these values of the variables. `None` if all is read.
    fn template_at(&self, optimisation: &Optimisation, values: &[Value]) -> Result<Option<Case>, Refusal> {
        match &self.template {
            Some(template) => Ok(Some(template.clone())),
            None if self.numbers.is_empty() => Ok(None),
            None => optimisation.case_with(values).map(Some),
        }
    }

    fn set(&self, template: &Case, values: &[Value]) -> Option<Case> {
        let mut case = template.clone();
        for (number, value) in self.numbers.iter().zip(values) {
            if let (Some(number), Value::Number(value)) = (number, value) {
                number.set(&mut case, *value)?;
            }
        }
        Some(case)
    }
}

/// The cases of a point: one for each point of the band.
#[derive(Debug)]
pub struct Cases<'a> {
    optimisation: &'a Optimisation,
    set: Vec<Value>,
    template: Option<Case>,
}

impl<'a> Cases<'a> {
    /// With these values of the variables and of what is uncertain.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn at(optimisation: &'a Optimisation, values: &[f64]) -> Result<Self, Refusal> {
        let set: Vec<Value> = values.iter().copied().map(Value::Number).collect();
        let first: Vec<Value> = set.iter().cloned().chain(optimisation.band_values(0)).collect();
        let template = optimisation.direct.template_at(optimisation, &first)?;
        Ok(Self { optimisation, set, template })
    }

    /// The case with values of the band's axes.
    ///
    /// # Errors
    /// The refusal of a case that the values make.
    pub fn case(&self, at: &[Value]) -> Result<Case, Refusal> {
        let mut all = self.set.clone();
        all.extend(at.iter().cloned());
        let made = self.template.as_ref().and_then(|template| self.optimisation.direct.set(template, &all));
        made.map_or_else(|| self.optimisation.case_with(&all), Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CASES: [(&str, &str); 4] = [
        ("base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }", "base.frequency_hz"),
        ("base = { kind = \"sine\", amplitude_m = 0.003, frequency_ratio = 1 }", "base.frequency_ratio"),
        (
            "base = { kind = \"sine\", amplitude_m = 0.003, angular_frequency_rad_per_s = 16 }",
            "base.angular_frequency_rad_per_s",
        ),
        ("force = { kind = \"sine\", amplitude_n = 1.2, frequency_ratio = 1 }", "force.frequency_ratio"),
    ];

    fn read(excitation: &str, start: &str, keys: &[&str]) -> (tempfile::TempDir, Optimisation) {
        let case = format!(
            "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n\
             friction_damper = {{ friction_ratio = 0.4 }}\nrun = {{ duration_s = 8 }}\n{excitation}\n\
             particle = {{ mass_ratio = 0.1, clearance_ratio = 9, start = \"{start}\", \
             wall = {{ kind = \"restitution\", coefficient = 0.5 }} }}\n"
        );
        let mut text = "case = \"case.toml\"\nobjective = \"rms_x_m\"\n".to_string();
        for (place, key) in keys.iter().enumerate() {
            let table = if place + 1 == keys.len() { "axis" } else { "variable" };
            let rest = if table == "axis" { "count = 5\nreduce = \"maximum\"\n" } else { "" };
            text.push_str(&format!("[[{table}]]\nkey = \"{key}\"\nfrom = 0.3\nto = 0.9\n{rest}"));
        }
        let folder = tempfile::TempDir::new().expect("a folder");
        std::fs::write(folder.path().join("case.toml"), case).expect("it is written");
        std::fs::write(folder.path().join("optimise.toml"), text).expect("it is written");
        let optimisation = Optimisation::read(&folder.path().join("optimise.toml")).expect("it is sound");
        (folder, optimisation)
    }

    fn is_equal_to_read(optimisation: &Optimisation) -> bool {
        (0..40).all(|n| {
            let share = |axis: usize| (0.618_033_988_749_895 * f64::from(n + 1) * (axis + 1) as f64).fract();
            let values: Vec<f64> = (0..optimisation.variables.len()).map(|axis| 0.3 + 0.6 * share(axis)).collect();
            let cases = Cases::at(optimisation, &values).expect("it is sound");
            (0..optimisation.band_points()).all(|point| {
                let mut all: Vec<Value> = values.iter().copied().map(Value::Number).collect();
                all.extend(optimisation.band_values(point));
                cases.case(&optimisation.band_values(point)).expect("sound")
                    == optimisation.case_with(&all).expect("sound")
            })
        })
    }

    #[test]
    fn a_case_whose_numbers_are_set_equals_the_case_that_is_read_to_the_last_bit() {
        for (excitation, frequency) in CASES {
            let keys = ["particle.clearance_ratio", "friction_damper.friction_ratio", "particle.wall.coefficient"];
            let (_folder, optimisation) = read(excitation, "centre", &[&keys[..], &[frequency]].concat());
            assert!(optimisation.direct.template.is_some(), "{frequency}: nothing is read again");
            assert!(is_equal_to_read(&optimisation), "{frequency}");
            let keys = ["particle.clearance_m", "friction_damper.force_n", "particle.friction_coefficient"];
            let (_folder, optimisation) = read(excitation, "centre", &[&keys[..], &[frequency]].concat());
            assert!(optimisation.direct.template.is_some() && is_equal_to_read(&optimisation), "{frequency}");
        }
    }

    #[test]
    fn a_variable_that_others_depend_on_is_read_and_a_start_at_a_wall_is_not_set() {
        let (excitation, frequency) = CASES[0];
        let keys = ["base.amplitude_m", "particle.clearance_ratio", frequency];
        let (_folder, optimisation) = read(excitation, "centre", &keys);
        assert!(optimisation.direct.template.is_none() && !optimisation.direct.numbers.is_empty());
        assert!(is_equal_to_read(&optimisation));
        let (_folder, optimisation) = read(excitation, "at_positive_wall", &["particle.clearance_ratio", frequency]);
        assert!(optimisation.direct.numbers.is_empty(), "the start moves with the clearance");
        assert!(is_equal_to_read(&optimisation));
    }
}
