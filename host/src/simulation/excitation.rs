//! Reads the excitation of a case: the tables `base` and `force`.

use std::f64::consts::TAU;
use std::path::PathBuf;

use damprig_core::integrator::exact::Excitation;

use super::keys::{base_fixed, base_half_sine, base_samples, base_sine, base_versine, force_half_sine, force_sine};
use crate::input::Section;
use crate::input::key::KeyedQuantity;
use crate::input::section::Given;
use crate::motion_record::{BASE_RECORD, GivenMotion, Record, RecordOrigin, RecordQuantity, read_motion, read_peak};
use crate::setup::BASE_AMPLITUDE;

/// Excitation of a case.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum CaseExcitation {
    /// In closed form.
    ClosedForm(Excitation),
    /// A sine whose angular frequency is stated as Ω/ωn.
    FrequencyRatio(Excitation),
    /// A recorded base motion, or noise.
    Recorded(Record),
}

impl CaseExcitation {
    fn closed_form(&self) -> Option<&Excitation> {
        match self {
            Self::ClosedForm(excitation) | Self::FrequencyRatio(excitation) => Some(excitation),
            Self::Recorded(_) => None,
        }
    }

    /// Z, the amplitude of a sine or a pulse of the base, m, 0 or greater.
    pub(super) fn amplitude_m(&self) -> Option<f64> {
        match self.closed_form()? {
            Excitation::Sine { amplitude_m, .. }
            | Excitation::HalfSine { amplitude_m, .. }
            | Excitation::Versine { amplitude_m, .. } => Some(amplitude_m.abs()),
            _ => None,
        }
    }

    /// P, the amplitude of a harmonic force, N, 0 or greater.
    pub(super) fn amplitude_n(&self) -> Option<f64> {
        match self.closed_form()? {
            Excitation::ForceSine { amplitude_n, .. } => Some(amplitude_n.abs()),
            _ => None,
        }
    }

    /// Whether the base moves as a sine.
    pub(super) fn is_sine_of_base(&self) -> bool {
        matches!(self.closed_form(), Some(Excitation::Sine { .. }))
    }

    /// Whether nothing moves the base and no force acts.
    pub(super) fn is_none(&self) -> bool {
        self.closed_form() == Some(&Excitation::Fixed)
    }

    /// The same on a structure of angular frequency ωn, which a frequency ratio refers to.
    pub(super) fn on(self, natural_rad_per_s: f64) -> Self {
        match self {
            Self::FrequencyRatio(mut excitation) => {
                if let Excitation::Sine { angular_frequency_rad_per_s, .. }
                | Excitation::ForceSine { angular_frequency_rad_per_s, .. } = &mut excitation
                {
                    *angular_frequency_rad_per_s *= natural_rad_per_s;
                }
                Self::ClosedForm(excitation)
            }
            other => other,
        }
    }
}

/// A sine as its frequency is written: in rad/s, Hz, or over ωn.
fn sine(is_ratio: bool, excitation: Excitation) -> CaseExcitation {
    if is_ratio { CaseExcitation::FrequencyRatio(excitation) } else { CaseExcitation::ClosedForm(excitation) }
}

/// Reads `base`. `stated_m` is the Z stated in the set-up; `find` resolves the path of a record.
pub(super) fn base(s: &Section, stated_m: Option<f64>, find: &dyn Fn(&str) -> PathBuf) -> Option<CaseExcitation> {
    let tables = [
        base_fixed::TABLE,
        base_sine::TABLE,
        base_half_sine::TABLE,
        base_versine::TABLE,
        BASE_RECORD,
        base_samples::TABLE,
    ];
    let base = match s.variant(&tables)? {
        0 => Some(CaseExcitation::ClosedForm(Excitation::Fixed)),
        1 => {
            let amplitude = amplitude(s, &base_sine::AMPLITUDE, stated_m);
            let frequency = angular_frequency(s, &base_sine::FREQUENCY);
            let phase = s.scalar(&base_sine::PHASE);
            amplitude.zip(frequency).zip(phase).map(|((amplitude_m, (is_ratio, frequency)), phase_rad)| {
                let angular_frequency_rad_per_s = frequency;
                sine(is_ratio, Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad })
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
        5 => samples(s).map(CaseExcitation::Recorded),
        _ => {
            let (motion, peak_m) = (read_motion(s, find), read_peak(s));
            match motion {
                Some(GivenMotion::Recorded(record)) => Some(record),
                Some(GivenMotion::Noise(noise)) => peak_m.map(|peak_m| noise.record(noise.rate_hz(), peak_m)),
                None => None,
            }
            .map(CaseExcitation::Recorded)
        }
    };
    s.finish();
    base
}

/// A base motion whose samples are in the case.
fn samples(s: &Section) -> Option<Record> {
    let (values, step_s) = (s.given(&base_samples::VALUES), s.scalar(&base_samples::TIME_STEP));
    let ((place, Given::Numbers(values)), step_s) = (values?, step_s?) else { return None };
    if values.len() < 2 {
        let name = base_samples::VALUES.keys[place].name;
        s.reject(name, format!("has {} samples: a motion has at least 2", values.len()), None);
        return None;
    }
    let quantity = [RecordQuantity::Displacement, RecordQuantity::Acceleration][place];
    let samples = values.into_iter().map(|number| number.value).collect();
    Some(Record { origin: RecordOrigin::Samples, quantity, step_s, samples, resampling: None })
}

/// Z, m, from the table `base` or from the set-up, not from both.
fn amplitude(s: &Section, quantity: &KeyedQuantity, stated_m: Option<f64>) -> Option<f64> {
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

/// P, N, and φ, rad, of a force beside a sine of the base, whose frequency it has. Its place is another's to read.
pub(super) fn force_beside_base(s: &Section) -> Option<(f64, f64)> {
    s.leave(&force_sine::PLACE);
    let force = match s.variant(&[force_sine::TABLE, force_half_sine::TABLE])? {
        0 => {
            if let Some(frequency) = s.written(&force_sine::FREQUENCY) {
                s.one_of(&force_sine::FREQUENCY);
                let help = Some("leave it out".into());
                s.reject(frequency.name, "beside a moving base the force has the base's frequency", help);
            }
            s.scalar(&force_sine::AMPLITUDE).zip(s.scalar(&force_sine::PHASE))
        }
        _ => {
            force(s);
            s.reject("kind", "beside a moving base the force is a sine", Some("write kind = \"sine\"".into()));
            return None;
        }
    };
    s.finish();
    force
}

/// Reads `force`, which acts on the structure over a fixed base. Its place is another's to read.
pub(super) fn force(s: &Section) -> Option<CaseExcitation> {
    s.leave(&force_sine::PLACE);
    let force = match s.variant(&[force_sine::TABLE, force_half_sine::TABLE])? {
        0 => {
            let amplitude = s.scalar(&force_sine::AMPLITUDE);
            let frequency = angular_frequency(s, &force_sine::FREQUENCY);
            let phase = s.scalar(&force_sine::PHASE);
            amplitude.zip(frequency).zip(phase).map(|((amplitude_n, (is_ratio, frequency)), phase_rad)| {
                let angular_frequency_rad_per_s = frequency;
                sine(is_ratio, Excitation::ForceSine { amplitude_n, angular_frequency_rad_per_s, phase_rad })
            })
        }
        _ => {
            let amplitude = s.scalar(&force_half_sine::AMPLITUDE);
            let duration = s.scalar(&force_half_sine::DURATION);
            amplitude.zip(duration).map(|(amplitude_n, duration_s)| {
                CaseExcitation::ClosedForm(Excitation::ForceHalfSine { amplitude_n, duration_s })
            })
        }
    };
    s.finish();
    force
}

/// Ω in rad/s, or over ωn, and whether it is that ratio.
fn angular_frequency(s: &Section, quantity: &KeyedQuantity) -> Option<(bool, f64)> {
    match s.one_of(quantity)? {
        (0, omega) => Some((false, omega)),
        (1, frequency) => Some((false, TAU * frequency)),
        (_, ratio) => Some((true, ratio)),
    }
}
