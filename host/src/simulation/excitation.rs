//! The tables of a case that say what moves it, from where, and for how long: base, force, initial state, run.

use std::f64::consts::TAU;
use std::path::PathBuf;

use damprig_core::integrator::exact::Excitation;
use damprig_core::model::Initial;

use super::case::RunSpec;
use super::keys::{base_fixed, base_half_sine, base_sine, base_versine, force_half_sine, force_sine, initial, run};
use crate::input::Section;
use crate::input::key::Quantity as Declared;
use crate::input::section::Given;
use crate::motion_record::{BASE_RECORD, Record, read_record};
use crate::setup::BASE_AMPLITUDE;

/// What moves the case.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Loading {
    /// Known in closed form.
    Closed(Excitation),
    /// A record of the base's motion.
    Recorded(Record),
}

impl Loading {
    /// Z, m, 0 or greater: the amplitude that the base moves by, if it moves by one.
    pub(super) fn amplitude_m(&self) -> Option<f64> {
        match self {
            Self::Closed(
                Excitation::Sine { amplitude_m, .. }
                | Excitation::HalfSine { amplitude_m, .. }
                | Excitation::Versine { amplitude_m, .. },
            ) => Some(amplitude_m.abs()),
            _ => None,
        }
    }
}

/// `base`; `stated_m` is the Z that the set-up states, the record's file is found by `find`.
pub(super) fn base(s: &Section, stated_m: Option<f64>, find: &dyn Fn(&str) -> PathBuf) -> Option<Loading> {
    let tables = [base_fixed::TABLE, base_sine::TABLE, base_half_sine::TABLE, base_versine::TABLE, BASE_RECORD];
    let base = match s.variant(&tables)? {
        0 => Some(Loading::Closed(Excitation::Fixed)),
        1 => {
            let amplitude = amplitude(s, &base_sine::AMPLITUDE, stated_m);
            let frequency = angular_frequency(s, &base_sine::FREQUENCY);
            let phase = s.scalar(&base_sine::PHASE);
            amplitude.zip(frequency).zip(phase).map(|((amplitude_m, angular_frequency_rad_per_s), phase_rad)| {
                Loading::Closed(Excitation::Sine { amplitude_m, angular_frequency_rad_per_s, phase_rad })
            })
        }
        pulse @ (2 | 3) => {
            // Both pulses have the same keys.
            let amplitude = amplitude(s, &base_half_sine::AMPLITUDE, stated_m);
            amplitude.zip(s.scalar(&base_half_sine::DURATION)).map(|(amplitude_m, duration_s)| {
                Loading::Closed(match pulse {
                    2 => Excitation::HalfSine { amplitude_m, duration_s },
                    _ => Excitation::Versine { amplitude_m, duration_s },
                })
            })
        }
        _ => read_record(s, find).map(Loading::Recorded),
    };
    s.finish();
    base
}

/// Z, m: of the base's own table or of the set-up, not of both.
fn amplitude(s: &Section, quantity: &Declared, stated_m: Option<f64>) -> Option<f64> {
    if stated_m.is_none() {
        return s.scalar(quantity);
    }
    if s.is_given(quantity) {
        let (own, other) = (quantity.name(), BASE_AMPLITUDE.name());
        let help = Some(format!("leave out `{own}` or `{other}`"));
        s.reject(own, format!("`{other}` is given too, and says the same quantity"), help);
    }
    stated_m
}

/// `force`: on the structure, over a fixed base.
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

/// `initial`: a structure that is not spoken of starts at 0, on a record where the base starts; a second mass starts
/// with the structure, a particle where its set-up places it: `particle_start_m` from there, if it says so.
pub(super) fn initial(s: Option<&Section>, base_start_m: f64, particle_start_m: Option<f64>) -> Initial {
    let or = |quantity, absent: f64| s.and_then(|s| s.scalar(quantity)).unwrap_or(absent);
    let (x_m, v_m_per_s) = (or(&initial::X, base_start_m), or(&initial::V, 0.0));
    let y_m = or(&initial::Y, x_m + particle_start_m.unwrap_or(0.0));
    let read = Initial { x_m, v_m_per_s, y_m, u_m_per_s: or(&initial::U, v_m_per_s) };
    if let Some(s) = s {
        if particle_start_m.is_some() && s.is_given(&initial::Y) {
            let help = Some("leave out `y_m`, or `start` and `start_m` of the particle".into());
            s.reject(initial::Y.name(), "the particle's own table says where it starts", help);
        }
        s.finish();
    }
    read
}

/// `run`; a record gives its length when none is asked for.
pub(super) fn run(s: &Section, record_s: Option<f64>) -> Option<RunSpec> {
    let duration = match record_s {
        Some(length_s) if !s.is_given(&run::DURATION) => Some(length_s),
        _ => s.scalar(&run::DURATION),
    };
    let times = match s.given(&run::SAMPLE_TIMES) {
        Some((_, Given::Numbers(times))) => times,
        _ => Vec::new(),
    };
    let cycle_s = s.scalar(&run::CYCLE);
    let steady_from = s.scalar(&run::STEADY_FROM);
    s.finish();
    let duration_s = duration?;
    for (i, time) in times.iter().enumerate() {
        let early = i > 0 && time.value < times[i - 1].value;
        if early || !(0.0..=duration_s * (1.0 + 1e-12)).contains(&time.value) {
            let allowed = format!("must be in rising order, from 0 to duration_s = {duration_s}");
            s.refuse(run::SAMPLE_TIMES.name(), &time.span, allowed, None);
            return None;
        }
    }
    if let Some(first) = steady_from {
        let key = run::STEADY_FROM.name();
        let Some(cycle_s) = cycle_s else {
            let help = Some("give `cycle_s`, or leave out `steady_from_cycle`".into());
            s.reject(key, "without `cycle_s` there are no cycles to count", help);
            return None;
        };
        if (first + 1.0) * cycle_s > duration_s * (1.0 + 1e-12) {
            let cycles = (duration_s / cycle_s * (1.0 + 1e-12)).floor();
            let allowed = format!("no whole cycle is left: the run has {cycles}, the first of which is 0");
            let help = Some("make `duration_s` longer, or `steady_from_cycle` smaller".into());
            s.reject(key, allowed, help);
            return None;
        }
    }
    Some(RunSpec {
        duration_s,
        sample_times_s: times.iter().map(|time| time.value).collect(),
        cycle_s,
        steady_from_cycle: steady_from.map(|first| first as u64),
    })
}
