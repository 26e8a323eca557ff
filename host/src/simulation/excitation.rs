//! Reads the excitation of a case: the tables `base` and `force`, and the keys of a recorded base motion.

use std::f64::consts::TAU;
use std::path::PathBuf;

use damprig_core::integrator::exact::Excitation;

use super::keys::{base_fixed, base_half_sine, base_record, base_sine, base_versine, force_half_sine, force_sine};
use super::record::read::{RecordError, UNITS, Which, read, unit_list};
use super::record::{Quantity, Record, Spec};
use crate::input::key::Quantity as Declared;
use crate::input::section::Given;
use crate::input::{Problem, Section};
use crate::setup::BASE_AMPLITUDE;

/// Excitation of a case.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum CaseExcitation {
    /// In closed form.
    ClosedForm(Excitation),
    /// A recorded base motion.
    Recorded(Record),
}

impl CaseExcitation {
    /// Z, the amplitude of a sine or a pulse of the base, m, 0 or greater.
    pub(super) fn amplitude_m(&self) -> Option<f64> {
        match self {
            Self::ClosedForm(
                Excitation::Sine { amplitude_m, .. }
                | Excitation::HalfSine { amplitude_m, .. }
                | Excitation::Versine { amplitude_m, .. },
            ) => Some(amplitude_m.abs()),
            _ => None,
        }
    }
}

/// Reads `base`. `stated_m` is the Z stated in the set-up; `find` resolves the path of a record.
pub(super) fn base(s: &Section, stated_m: Option<f64>, find: &dyn Fn(&str) -> PathBuf) -> Option<CaseExcitation> {
    let tables = [base_fixed::TABLE, base_sine::TABLE, base_half_sine::TABLE, base_versine::TABLE, base_record::TABLE];
    let base = match s.variant(&tables)? {
        0 => Some(CaseExcitation::ClosedForm(Excitation::Fixed)),
        1 => {
            let amplitude = amplitude(s, &base_sine::AMPLITUDE, stated_m);
            let frequency = angular_frequency(s, &base_sine::FREQUENCY);
            let phase = s.scalar(&base_sine::PHASE);
            amplitude.zip(frequency).zip(phase).map(|((amplitude_m, angular_frequency_rad_per_s), phase_rad)| {
                CaseExcitation::ClosedForm(Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad })
            })
        }
        pulse @ (2 | 3) => {
            // Both pulses have the same keys.
            let amplitude = amplitude(s, &base_half_sine::AMPLITUDE, stated_m);
            amplitude.zip(s.scalar(&base_half_sine::DURATION)).map(|(amplitude_m, duration_s)| {
                CaseExcitation::ClosedForm(match pulse {
                    2 => Excitation::HalfSine { amplitude_m, duration_s },
                    _ => Excitation::Versine { amplitude_m, duration_s },
                })
            })
        }
        _ => record(s, find).map(CaseExcitation::Recorded),
    };
    s.finish();
    base
}

/// Z, m, from the table `base` or from the set-up, not from both.
fn amplitude(s: &Section, quantity: &Declared, stated_m: Option<f64>) -> Option<f64> {
    if stated_m.is_none() {
        return s.scalar(quantity);
    }
    if s.is_given(quantity) {
        let (own, other) = (quantity.name(), BASE_AMPLITUDE.name());
        let help = Some(format!("leave out `{own}` or `{other}`"));
        s.reject(own, format!("`{other}` gives the same quantity"), help);
    }
    stated_m
}

/// Reads the keys of a record, in a case or a campaign. `find` resolves its path. Does not finish the table.
pub(crate) fn record(s: &Section, find: &dyn Fn(&str) -> PathBuf) -> Option<Record> {
    let file = s.text_of(&base_record::FILE);
    let quantity = s.word(&base_record::QUANTITY).map(|word| [Quantity::Acceleration, Quantity::Displacement][word]);
    let unit = s.word(&base_record::UNIT).map(|word| UNITS[word]);
    if let (Some(quantity), Some((_, of, _))) = (quantity, unit)
        && quantity != of
    {
        s.reject(base_record::UNIT.name(), format!("must be {}", unit_list(quantity)), None);
    }
    let spec = Spec {
        quantity,
        unit_si: unit.map(|(.., si)| si),
        scale: s.scalar(&base_record::SCALE),
        time_step_s: s.scalar(&base_record::TIME_STEP),
        column: which(s, &base_record::COLUMN),
        time_column: which(s, &base_record::TIME_COLUMN),
    };
    let file = file?;
    // Problems in this table come first: its keys say how to read the file.
    if !s.source().is_clean() {
        return None;
    }
    match read(&find(&file.value), &spec) {
        Ok(record) => Some(record),
        Err(RecordError(message)) => {
            let mut lines = message.lines();
            let first = lines.next().unwrap_or_default();
            s.source().report(Problem {
                title: format!("`{}` = {:?} cannot be used", s.full("file"), file.value),
                span: file.span,
                allowed: first.into(),
                help: lines.next().map(|line| line.trim().into()),
            });
            None
        }
    }
}

/// Reads a column by number or name.
fn which(s: &Section, quantity: &Declared) -> Option<Which> {
    match s.given(quantity)? {
        (_, Given::Text(name)) => Some(Which::Name(name.value)),
        (_, Given::Number(place)) => Some(Which::Place(place as usize)),
        _ => None,
    }
}

/// Reads `force`, which acts on the structure over a fixed base.
pub(super) fn force(s: &Section) -> Option<Excitation> {
    let force = match s.variant(&[force_sine::TABLE, force_half_sine::TABLE])? {
        0 => {
            let amplitude = s.scalar(&force_sine::AMPLITUDE);
            let frequency = angular_frequency(s, &force_sine::FREQUENCY);
            let phase = s.scalar(&force_sine::PHASE);
            amplitude.zip(frequency).zip(phase).map(|((amplitude_n, angular_frequency_rad_per_s), phase_rad)| {
                Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, phase_rad }
            })
        }
        _ => {
            let amplitude = s.scalar(&force_half_sine::AMPLITUDE);
            let duration = s.scalar(&force_half_sine::DURATION);
            amplitude
                .zip(duration)
                .map(|(amplitude_n, duration_s)| Excitation::ForceHalfSine { amplitude_n, duration_s })
        }
    };
    s.finish();
    force
}

fn angular_frequency(s: &Section, quantity: &Declared) -> Option<f64> {
    match s.one_of(quantity)? {
        (0, omega) => Some(omega),
        (_, frequency) => Some(TAU * frequency),
    }
}
