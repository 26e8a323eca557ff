//! The loops of a stepped sine: that of the base, that of the response with its amplitudes, and that of the phase.

use damprig_core::control::base_loop::ClosedLoop;
use damprig_core::control::phase_lock::PhaseLock;
use damprig_core::control::response_loop::{KeptQuantity, ResponseLoop};
use damprig_core::control::stepped_sine::{DriveMode, MAX_POINTS};
use damprig_simulator::plant::Amplifier;

use super::KeptAmplitude;
use crate::campaign::RigSettings;
use crate::campaign::keys::{
    closed_loop, phase_lock, resonance_tracking, response_controlled, response_loop, stepped_sine as keys,
};
use crate::input::key::KeyedQuantity;
use crate::input::section::Given;
use crate::input::{Number, Section};

/// `drive`, and the `closed_loop` table of one of its two values.
pub(super) fn read_drive(section: &Section, rig: Option<&RigSettings>) -> Option<(DriveMode, Option<Number>)> {
    let is_closed = section.word(&keys::DRIVE) == Some(1);
    if !is_closed {
        // Reports a table that would do nothing.
        section.given(&keys::CLOSED_LOOP);
        return Some((DriveMode::Constant, None));
    }
    let table = section.part(&keys::CLOSED_LOOP)?;
    let (gain, tolerance) = (table.scalar(&closed_loop::GAIN), table.scalar(&closed_loop::TOLERANCE));
    let (wait, limit) = (table.scalar(&closed_loop::WAIT), table.placed(&closed_loop::DRIVE_LIMIT));
    table.finish();
    let Some(shaker) = &rig?.shaker else {
        let help = Some("add a `[rig.shaker]` table (it may be empty), or write drive = \"constant\"".into());
        section.reject("drive", "needs a shaker that feels its load", help);
        return None;
    };
    let default = ClosedLoop::default();
    let parameters = ClosedLoop {
        gain_per_s: gain? as f32,
        calibrated_at_hz: shaker.calibrated_at_hz as f32,
        tolerance: tolerance? as f32,
        wait_s: wait? as f32,
        drive_limit_m: limit.as_ref().map_or(default.drive_limit_m, |n| n.value as f32),
    };
    Some((DriveMode::ClosedLoop(parameters), limit))
}

/// The stated drive limit, and the loop of each amplitude with the amplitude as written.
type Loops = (Option<Number>, Vec<(DriveMode, KeptAmplitude)>);

/// The amplitudes of a response, and its `response_loop`.
pub(super) fn read_loops(section: &Section, rig: Option<&RigSettings>) -> Option<Loops> {
    let table = section.part(&response_controlled::RESPONSE_LOOP)?;
    let read = read_loop(section, &table, rig);
    let (key, list) = amplitudes(section, &response_controlled::AMPLITUDES)?;
    // As the controller gets them.
    let is_repeated = |n: usize| list[..n].iter().any(|before| before.value as f32 == list[n].value as f32);
    if let Some(repeated) = (1..list.len()).find(|n| is_repeated(*n)) {
        let help = Some("write repeats = 2 to measure it twice".into());
        section.refuse(key, &list[repeated].span, "holds the same amplitude twice", help);
        return None;
    }
    let (limit, of) = read?;
    let loop_of = |amplitude: Number| Some((of(quantity(key, amplitude.value)?), KeptAmplitude { key, amplitude }));
    Some((limit, list.into_iter().map(loop_of).collect::<Option<_>>()?))
}

/// The key and the values of a list of amplitudes.
pub(super) fn amplitudes(section: &Section, declared: &KeyedQuantity) -> Option<(&'static str, Vec<Number>)> {
    let (place, given) = section.given(declared)?;
    let (name, Given::Numbers(list)) = (declared.keys[place].name, given) else { return None };
    if list.is_empty() {
        section.reject(name, "must hold at least one amplitude", Some(format!("write {name} = [0.01]")));
        return None;
    }
    if list.len() > MAX_POINTS {
        let allowed = format!("holds {} amplitudes; the controller holds at most {MAX_POINTS}", list.len());
        section.reject(name, allowed, Some("divide them among several experiments".into()));
        return None;
    }
    Some((name, list))
}

/// The response of a key of amplitudes, at one of them; `None` of amplitudes of the base.
pub(super) fn quantity(key: &str, amplitude: f64) -> Option<KeptQuantity> {
    match key {
        "x_amplitudes_m" => Some(KeptQuantity::Displacement { amplitude_m: amplitude as f32 }),
        "velocity_amplitudes_m_per_s" => Some(KeptQuantity::Velocity { amplitude_m_per_s: amplitude as f32 }),
        "relative_amplitudes_m" => Some(KeptQuantity::Relative { amplitude_m: amplitude as f32 }),
        _ => None,
    }
}

/// The stated drive limit, and the loop for a response.
type LoopOf = (Option<Number>, Box<dyn Fn(KeptQuantity) -> DriveMode>);

/// The loop that keeps a response, from its `response_loop`.
pub(super) fn read_loop(section: &Section, table: &Section, rig: Option<&RigSettings>) -> Option<LoopOf> {
    let (gain, tolerance) = (table.scalar(&response_loop::GAIN), table.scalar(&response_loop::TOLERANCE));
    let (wait, limit) = (table.scalar(&response_loop::WAIT), table.placed(&response_loop::DRIVE_LIMIT));
    table.finish();
    let limit_m = limit.as_ref().map(|limit| limit.value as f32);
    let base = match &rig?.shaker {
        Some(shaker) if shaker.amplifier == Amplifier::Current => {
            let help = Some("write amplifier = \"voltage\" in [rig.shaker], if it is one".into());
            section.reject("kind", "needs a shaker in voltage mode, a source of velocity", help);
            return None;
        }
        Some(shaker) => {
            let default = ClosedLoop::default();
            let drive_limit_m = limit_m.unwrap_or(default.drive_limit_m);
            Some(ClosedLoop { calibrated_at_hz: shaker.calibrated_at_hz as f32, drive_limit_m, ..default })
        }
        None => None,
    };
    let (gain_per_cycle, tolerance, wait_s) = (gain? as f32, tolerance? as f32, wait? as f32);
    let of = move |response: KeptQuantity| {
        let new = ResponseLoop::new(response, base);
        let drive_limit_m = limit_m.unwrap_or(new.drive_limit_m);
        DriveMode::Response(ResponseLoop { gain_per_cycle, tolerance, wait_s, drive_limit_m, ..new })
    };
    Some((limit, Box::new(of)))
}

/// The loop that follows a resonance, from its `phase_lock`, in a range of frequencies and from its start, Hz.
pub(super) fn read_lock(section: &Section, [from, to]: [Number; 2], start: Option<Number>) -> Option<PhaseLock> {
    let table = section.part(&resonance_tracking::PHASE_LOCK)?;
    let (phase, gain) = (table.scalar(&phase_lock::PHASE), table.scalar(&phase_lock::GAIN));
    let (tolerance, wait) = (table.scalar(&phase_lock::TOLERANCE), table.scalar(&phase_lock::WAIT));
    table.finish();
    if to.value <= from.value {
        section.refuse("to_hz", &to.span, format!("must be above from_hz = {}", from.value), None);
        return None;
    }
    if let Some(start) = start.as_ref().filter(|start| !(from.value..=to.value).contains(&start.value)) {
        section.refuse("start_hz", &start.span, format!("must be from {} to {} Hz", from.value, to.value), None);
        return None;
    }
    let new = PhaseLock::new(from.value as f32, to.value as f32);
    Some(PhaseLock {
        phase_rad: phase?.to_radians() as f32,
        start_hz: start.map_or(new.start_hz, |start| start.value as f32),
        gain_per_cycle: gain? as f32,
        tolerance_rad: tolerance?.to_radians() as f32,
        wait_s: wait? as f32,
        ..new
    })
}
