//! How the results of a run follow the keys of its case: exact derivatives through every event ([`damprig_structures::Derivatives`]).

use std::sync::Arc;

use damprig_core::integrator::exact::Excitation;
use damprig_motion::placed_motion::powers;
use damprig_structures::{Derived, Drive, GRAZING, MotionCase, NoDerivatives, SetUp, State, Varied};

use super::sensitivities::{RunKeys, Sensitivities, Sensitivity};
use crate::failure::Failure;
use crate::input::{Files, Source};
use crate::simulation::Case;
use crate::simulation::set_values::{SetValues, numbers_of};

/// Most drive periods after which a motion repeats.
const MAX_PERIODS: u32 = 6;

/// Relative changes up to this are rounding.
const ROUNDING: f64 = 1e-9;

/// Tables and keys that say nothing about a motion, how it is sampled, or how many lines a noise has.
const NO_QUANTITIES: [&str; 6] =
    ["run.", "base.rate", "base.noise.seed", "base.noise.from_hz", "base.noise.to_hz", "base.noise.duration_s"];

/// A case as it is written, to be read with other values.
#[derive(Clone, Copy, Debug)]
pub struct WrittenCase<'a> {
    /// The name of its text, which is its path where it is a file.
    pub name: &'a str,
    /// Its text, TOML or JSON.
    pub text: &'a str,
    /// Values in place of some of the text's.
    pub values: &'a SetValues,
}

impl WrittenCase<'_> {
    /// The case with a number in place of the one at its key; `None` if it is then refused. `files`: what it names, once read.
    pub(crate) fn case(&self, key: &str, value: f64, files: &Arc<Files>) -> Option<Case> {
        self.read(key, value, files).ok()
    }

    /// [`WrittenCase::case`], or why it is refused.
    pub(crate) fn read(&self, key: &str, value: f64, files: &Arc<Files>) -> Result<Case, Failure> {
        let source = Source::new(self.name, self.text).with_files(files);
        Case::parse_changed(&source, self.name, &self.values.with(key, value))
    }

    /// The motion of [`WrittenCase::case`].
    pub(crate) fn motion(&self, key: &str, value: f64, files: &Arc<Files>) -> Option<MotionCase> {
        Some(motion_case(&self.case(key, value, files)?, None))
    }
}

impl Sensitivities {
    /// Of a run of `case`, which is `written`, by every number in it, while `goes_on` is true, which sees the time that is reached, s.
    ///
    /// # Errors
    /// Why there are none.
    pub fn of_run(case: &Case, written: &WrittenCase, goes_on: &mut dyn FnMut(f64) -> bool) -> Result<Self, String> {
        let motion = motion_case(case, None);
        let places = motion.set_up.structure.influence.len();
        let files = Arc::default();
        let (mut varied, mut keys, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
        for (key, value) in numbers_of(written.text, written.values) {
            if value == 0.0 || NO_QUANTITIES.iter().any(|none| key.starts_with(none)) {
                continue;
            }
            if !goes_on(0.0) {
                return Err(NoDerivatives::Stopped.to_string());
            }
            let [a, b, c, d, e, f] = Varied::AT.map(|factor| {
                let case = written.case(&key, value * factor, &files)?;
                // A damper whose place falls on another one has no place of its own.
                Some(motion_case(&case, Some(&motion))).filter(|case| case.set_up.structure.influence.len() == places)
            });
            match (|| Some([a?, b?, c?, d?, e?, f?]))() {
                Some(cases) => {
                    varied.push(Varied { value, cases });
                    keys.push(key);
                }
                None => left_out.push(key),
            }
        }
        let orbit = if case.is_under_a_sine() {
            motion.orbit_derivatives(MAX_PERIODS, &varied, goes_on)
        } else {
            Err(NoDerivatives::NotPeriodic)
        };
        let (found, repeats_after, multipliers) = match orbit {
            Ok(orbit) => (orbit.derivatives, Some(orbit.periods), orbit.multipliers),
            Err(NoDerivatives::Stopped) => return Err(NoDerivatives::Stopped.to_string()),
            // A run has derivatives too where a body that takes no part may be anywhere.
            Err(_) => (motion.derivatives(&varied, goes_on).map_err(|why| told(&why, case))?, None, Vec::new()),
        };
        let place = case.multi_degree.as_ref().map_or(0, |of| of.observed);
        let (x, rms, fastest) =
            (&found.largest_abs_m[place], &found.rms_m[place], found.fastest_impact_m_per_s.as_ref());
        if x.of.value == 0.0 {
            return Err("none: x is 0 all the time".into());
        }
        let (mut of, mut grazing) = (Vec::new(), Vec::new());
        for (p, key) in keys.into_iter().enumerate() {
            if found.holds_within[p] < GRAZING {
                grazing.push(key);
                continue;
            }
            let value = varied[p].value;
            let relative = |of: &Derived| of.by[p] * value / of.value;
            let (max_abs_x, rms_x) = (relative(&x.of), relative(rms));
            let impact_speed = fastest.map(|fastest| relative(&fastest.of));
            let is_more_than_rounding = |of: f64| of.abs() > ROUNDING;
            if [Some(max_abs_x), Some(rms_x), impact_speed].into_iter().flatten().any(is_more_than_rounding) {
                let holds_within = Some(found.holds_within[p]).filter(|within| within.is_finite());
                of.push(Sensitivity { key, value, max_abs_x, rms_x, impact_speed, holds_within });
            }
        }
        if of.is_empty() {
            return Err("none: no number of the case changes x".into());
        }
        let part = Some(RunKeys { repeats_after, multipliers, left_out, grazing });
        Ok(Self::sorted(of, part, [x.is_tie, fastest.is_some_and(|fastest| fastest.is_tie)]))
    }
}

/// Why there are none, and what may help.
fn told(why: &NoDerivatives, case: &Case) -> String {
    match why {
        NoDerivatives::Growth { .. } if case.is_under_a_sine() => {
            format!("{why}; a longer run may end on a periodic motion, which has them")
        }
        _ => why.to_string(),
    }
}

/// The motion of a case; with as many sample intervals as `like`.
pub(super) fn motion_case(case: &Case, like: Option<&MotionCase>) -> MotionCase {
    let case = case.without_hertz();
    let duration_s = case.run.duration_s;
    let (drive, base) = match &case.record {
        None => (Drive::ClosedForm(case.excitation), damprig_structures::base_at_start(&case.excitation)),
        Some(record) => {
            let mut play = record.play();
            let count = match like.map(|like| &like.drive) {
                Some(Drive::Samples { powers, .. }) => powers.len(),
                _ => (duration_s / record.step_s).ceil().max(1.0) as usize + 1,
            };
            let powers: Vec<[f64; 4]> = (0..count).map(|_| powers(&play.next_segment(), record.step_s)).collect();
            let base = (powers[0][0], powers[0][1]);
            (Drive::Samples { step_s: record.step_s, powers: powers.into() }, base)
        }
    };
    let (set_up, start) = match &case.multi_degree {
        Some(of) => (of.set_up.clone(), of.start.clone()),
        None => {
            let is_force = case.excitation != Excitation::Fixed && !case.excitation.moves_base();
            let set_up = SetUp { driven_place: is_force.then_some(0), ..SetUp::from(&case.set_up) };
            (set_up, State::on_base(&case.set_up, &case.initial, base))
        }
    };
    MotionCase { set_up, drive, start, duration_s }
}
