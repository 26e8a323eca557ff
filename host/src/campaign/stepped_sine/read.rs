//! Reads the keys that stepped sines share, and those of each kind.

use damprig_core::control::stepped_sine::{DriveMode, MIN_CYCLES};
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::model::Structure;

use super::{PointStart, SteppedSine, TrackedResonance, frequencies, loops};
use crate::campaign::RigSettings;
use crate::campaign::keys::{resonance_tracking, steady, stepped_sine as keys};
use crate::input::{Number, Section};

/// Reads a stepped sine that drives the base; `rig` is `None` when it could not be read, `structures` are those of its set-ups.
pub(in crate::campaign) fn read(
    section: &Section,
    rig: Option<&RigSettings>,
    structures: &[Structure],
) -> Option<SteppedSine> {
    let sine = read_points(section, structures);
    let (drive, drive_limit) = loops::read_drive(section, rig)?;
    Some(SteppedSine { drive, drive_limit, ..sine? })
}

/// Reads stepped sines that keep the response, one for each amplitude; arguments as for [`read`].
pub(in crate::campaign) fn read_response_controlled(
    section: &Section,
    rig: Option<&RigSettings>,
    structures: &[Structure],
) -> Option<Vec<SteppedSine>> {
    let sine = read_points(section, structures);
    let loops = loops::read_loops(section, rig)?;
    let sine = sine?;
    if !sine.peak_order.is_empty() {
        let allowed = "belongs to stepped sines that drive the base: at a constant response there is no peak of X/Z";
        section.reject("peak_points", allowed, Some("leave it out".into()));
        return None;
    }
    let (drive_limit, all) = loops;
    let of = |(drive, kept)| SteppedSine { drive, drive_limit: drive_limit.clone(), kept: Some(kept), ..sine.clone() };
    Some(all.into_iter().map(of).collect())
}

/// Reads a stepped sine that follows a resonance; arguments as for [`read`].
pub(in crate::campaign) fn read_tracking(section: &Section, rig: Option<&RigSettings>) -> Option<SteppedSine> {
    let (from, to) = (section.placed(&resonance_tracking::FROM), section.placed(&resonance_tracking::TO));
    let start = section.placed(&resonance_tracking::START_FREQUENCY);
    let lowest_hz = from.as_ref().map(|from| from.value);
    let times = read_times(section, || lowest_hz);
    let (key, amplitudes) = loops::amplitudes(section, &resonance_tracking::AMPLITUDES)?;
    let (drive, drive_limit) = match loops::quantity(key, 1.0) {
        None => {
            refuse_other(section, resonance_tracking::RESPONSE_LOOP.name(), "belongs to amplitudes of the response");
            let read = loops::read_drive(section, rig)?;
            if read.0 == DriveMode::Constant && rig.is_some_and(|rig| rig.shaker.is_some()) {
                let allowed = "must keep the base on a shaker: a base that yields to the structure turns its phase";
                section.reject("drive", allowed, Some("write drive = \"closed_loop\"".into()));
                return None;
            }
            read
        }
        Some(_) => {
            for name in [keys::DRIVE.name(), keys::CLOSED_LOOP.name()] {
                refuse_other(section, name, "belongs to base_amplitudes_m: a loop keeps the response's amplitude");
            }
            let table = section.part(&resonance_tracking::RESPONSE_LOOP)?;
            let (limit, of) = loops::read_loop(section, &table, rig)?;
            (of(loops::quantity(key, amplitudes.first()?.value)?), limit)
        }
    };
    let lock = loops::read_lock(section, [from?, to?], start)?;
    Some(SteppedSine { tracked: Some(TrackedResonance { lock, key, amplitudes }), drive, drive_limit, ..times? })
}

/// Reports a key that the other keys leave without a meaning.
fn refuse_other(section: &Section, name: &'static str, allowed: &'static str) {
    if section.has_own(name) {
        section.reject(name, allowed, Some("leave it out".into()));
    }
}

/// Frequencies and times of a stepped sine at constant drive.
fn read_points(section: &Section, structures: &[Structure]) -> Option<SteppedSine> {
    let mut found = None;
    let times = read_times(section, || {
        frequencies::refuse_misplaced(section);
        found = frequencies::read(section, structures);
        Some(found.as_ref()?.0.iter().copied().fold(f64::INFINITY, f64::min))
    });
    let (frequencies_hz, peak_points) = found?;
    Some(SteppedSine { frequencies_hz, peak_order: (0..peak_points).collect(), ..times? })
}

/// The times of a stepped sine at constant drive; `lowest_hz` reads its lowest frequency.
fn read_times(section: &Section, lowest_hz: impl FnOnce() -> Option<f64>) -> Option<SteppedSine> {
    let start = section.word(&keys::START);
    let settle_s = section.scalar(&keys::SETTLE);
    let dwell = section.placed(&keys::DWELL);
    let rest_level_m = section.scalar(&keys::REST_LEVEL);
    let lowest_hz = lowest_hz();
    let steady = read_steady(section, dwell.as_ref());
    if let (Some(dwell), Some(lowest)) = (&dwell, lowest_hz)
        && dwell.value * lowest < f64::from(MIN_CYCLES)
    {
        let allowed = format!("must hold {MIN_CYCLES} periods of the lowest frequency, {lowest} Hz");
        let help = Some(format!("write dwell_s = {} or more", (1e3 * f64::from(MIN_CYCLES) / lowest).ceil() / 1e3));
        section.refuse("dwell_s", &dwell.span, allowed, help);
    }
    let ramp = section.placed(&keys::RAMP);
    if let (Some(ramp), Some(settle_s)) = (&ramp, settle_s)
        && ramp.value > settle_s
    {
        let allowed = format!("must be from 0 to settle_s = {settle_s}: nothing is measured on the ramp");
        section.refuse("ramp_s", &ramp.span, allowed, None);
    }
    Some(SteppedSine {
        frequencies_hz: Vec::new(),
        tracked: None,
        peak_order: Vec::new(),
        start: if start? == 0 { PointStart::FromRest } else { PointStart::CarryOver },
        drive: DriveMode::Constant,
        drive_limit: None,
        kept: None,
        ramp_s: ramp?.value,
        settle_s: settle_s?,
        dwell_s: dwell?.value,
        rest_level_m: rest_level_m?,
        steady: steady?,
    })
}

fn read_steady(section: &Section, dwell: Option<&Number>) -> Option<SteadyLimits> {
    let table = section.part(&keys::STEADY)?;
    let (tolerance, scatter) = (table.scalar(&steady::TOLERANCE), table.scalar(&steady::SCATTER));
    let longest = table.placed(&steady::LONGEST_DWELL);
    if let (Some(longest), Some(dwell)) = (&longest, dwell)
        && longest.value < dwell.value
    {
        let allowed = format!("must be at least dwell_s = {}: the time of all dwells of a point", dwell.value);
        table.refuse("longest_dwell_s", &longest.span, allowed, None);
    }
    table.finish();
    Some(SteadyLimits {
        tolerance: tolerance? as f32,
        scatter: scatter? as f32,
        longest_dwell_s: longest.map_or(SteadyLimits::default().longest_dwell_s, |n| n.value as f32),
    })
}
