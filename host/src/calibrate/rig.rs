//! What a calibration asks of a rig: readings at rest, sines and steps of the drive, blows on a wall, moves of the spring.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use damprig_core::control::fault::Fault;
use damprig_core::control::friction_spring::{SpringCommand, SpringEvent, SpringStage};
use damprig_core::control::stepped_sine::{DriveMode, Start, SteppedSine};
use damprig_core::control::transient::Playback;
use damprig_core::control::transient::playback::RecordId;
use damprig_core::io::TICK_HZ;
use damprig_core::measure::impacts::ImpactRecord;
use damprig_core::measure::point::PointResult;
use damprig_core::measure::steadiness::SteadyLimits;
use damprig_core::rig::RigState;
use damprig_protocol::upload::checksum;
use damprig_protocol::{Event, Request};

use crate::client::session::{DeviceReport, Session};
use crate::failure::Failure;

/// Time limit of a move of the spring: longer than the whole travel there and back at the search rate.
const LONGEST_MOVE: Duration = Duration::from_secs(300);

/// Rows at the start of a reading that are dropped: filters settle.
const DROPPED_ROWS: usize = 200;

/// Other pulses within this time after a blow belong to it.
const SAME_BLOW: Duration = Duration::from_millis(500);

/// Rate of a record of steps, Hz.
const STEP_RATE_HZ: f32 = 100.0;

/// Displacement of a count of a record of steps, m.
const STEP_COUNT_M: f32 = 1e-6;

/// A reading at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestReading {
    /// Mean.
    pub mean: f64,
    /// RMS scatter of the values of a tick.
    pub scatter: f64,
    /// Change over the time of the reading, by a line through it.
    pub drift: f64,
}

impl RestReading {
    /// Of evenly spaced values.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let n = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / n;
        let middle = (n - 1.0) / 2.0;
        let (mut cross, mut spread) = (0.0, 0.0);
        for (place, value) in values.iter().enumerate() {
            let at = place as f64 - middle;
            cross += at * (value - mean);
            spread += at * at;
        }
        let slope = if spread > 0.0 { cross / spread } else { 0.0 };
        let rest = values.iter().enumerate().map(|(place, v)| v - mean - slope * (place as f64 - middle));
        let variance = rest.map(|r| r * r).sum::<f64>() / (n - 2.0).max(1.0);
        Self { mean, scatter: variance.sqrt(), drift: slope * (n - 1.0) }
    }
}

/// A rig with its link; Ctrl-C sets `stop`.
pub struct CalibratedRig<'a> {
    /// The session.
    pub session: &'a mut Session,
    stop: &'a AtomicBool,
    /// Sines and records so far: each has noise of its own on a virtual rig.
    taken: u16,
}

impl<'a> CalibratedRig<'a> {
    /// Brings the rig to idle.
    ///
    /// # Errors
    /// A rig that does not come to rest, or a broken link.
    pub fn new(session: &'a mut Session, stop: &'a AtomicBool) -> Result<Self, Failure> {
        session.bring_to_idle(|_| {}, stop)?;
        Ok(Self { session, stop, taken: 0 })
    }

    /// Fails if Ctrl-C was pressed.
    ///
    /// # Errors
    /// As said.
    pub fn go_on(&self) -> Result<(), Failure> {
        if self.stop.load(Ordering::Relaxed) { Err(Failure::stopped()) } else { Ok(()) }
    }

    /// Keeps the link alive for a moment.
    ///
    /// # Errors
    /// Ctrl-C, or a broken link.
    pub fn idle_turn(&mut self) -> Result<(), Failure> {
        self.go_on()?;
        Ok(self.session.idle_turn()?)
    }

    /// Readings of signals at rest over this time, s.
    ///
    /// # Errors
    /// The rig is not idle, has no such signal, or the link breaks.
    pub fn read<const N: usize>(&mut self, names: [&str; N], measure_s: f64) -> Result<[RestReading; N], Failure> {
        let (status, _) = self.session.status()?;
        if status.state != RigState::Idle {
            return Err(Failure::Failed(format!("the rig is {}, not idle", status.state.text())));
        }
        let wanted = (measure_s * f64::from(TICK_HZ)).ceil() as usize + DROPPED_ROWS;
        self.telemetry(&names, false)?;
        let mut columns: [Vec<f64>; N] = std::array::from_fn(|_| Vec::with_capacity(wanted));
        while columns[0].len() < wanted {
            self.go_on()?;
            match self.session.next_report()? {
                Some(DeviceReport::Telemetry(message)) if usize::from(message.width) == N => {
                    for row in message.values.chunks_exact(N) {
                        row.iter().zip(&mut columns).for_each(|(value, column)| column.push(f64::from(*value)));
                    }
                }
                Some(DeviceReport::Event { event: Event::Fault(fault), .. }) => return Err(failed(fault)),
                _ => {}
            }
        }
        self.quiet()?;
        Ok(columns.map(|values| RestReading::of(&values[DROPPED_ROWS..wanted])))
    }

    /// Selects every tick of these signals, or none, and impacts.
    fn telemetry(&mut self, names: &[&str], impacts: bool) -> Result<(), Failure> {
        let table = &self.session.signals;
        let place = |name: &&str| {
            let found = table.iter().position(|signal| signal.name == **name);
            found.map(|place| place as u8).ok_or_else(|| Failure::Failed(format!("the rig has no signal {name}")))
        };
        let places = names.iter().map(place).collect::<Result<Vec<u8>, _>>()?;
        let every_ticks = u16::from(!names.is_empty());
        // Fewer names than a row can have.
        let signals = places.into_iter().collect();
        Ok(self.session.execute("select the telemetry", Request::SetTelemetry { every_ticks, signals, impacts })?)
    }

    /// Ends the telemetry and drops what is under way.
    fn quiet(&mut self) -> Result<(), Failure> {
        self.telemetry(&[], false)?;
        self.session.use_up_credit()?;
        while self.session.report_at_hand().is_some() {}
        Ok(())
    }

    /// Drives the base by sines of this amplitude, each measured for `dwell_s`; the limits of the board are in force.
    ///
    /// # Errors
    /// The board refuses the sine or an interlock ends it; the drive is off then.
    pub fn sines(
        &mut self,
        amplitude_m: f64,
        frequencies_hz: &[f64],
        dwell_s: f64,
    ) -> Result<Vec<PointResult>, Failure> {
        let sine = SteppedSine {
            // The sensor of x may look anywhere: nothing is waited for.
            start: Start::FromRest { level_m: f32::MAX },
            amplitude_m: amplitude_m as f32,
            drive: DriveMode::Constant,
            ramp_s: 1.0,
            settle_s: 3.0,
            dwell_s: dwell_s as f32,
            steady: SteadyLimits { tolerance: 0.01, scatter: 0.01, longest_dwell_s: 0.0 },
            first_index: self.next_index(frequencies_hz.len()),
            points: frequencies_hz.iter().map(|f| *f as f32).collect(),
        };
        self.session.execute("take the sine", Request::Configure(sine))?;
        let mut results = Vec::new();
        self.experiment(&mut |event| {
            if let Event::Point(result) = event {
                results.push(*result);
            }
        })?;
        if results.len() == frequencies_hz.len() {
            return Ok(results);
        }
        Err(Failure::Failed(format!("{} of {} sines were measured", results.len(), frequencies_hz.len())))
    }

    fn next_index(&mut self, count: usize) -> u16 {
        let index = self.taken;
        self.taken = index.wrapping_add(count as u16);
        index
    }

    /// Starts the configured experiment and follows it to its end; stops the drive on every error.
    fn experiment(&mut self, on_event: &mut dyn FnMut(&Event)) -> Result<(), Failure> {
        let followed = self.follow(on_event);
        if followed.is_err() && self.session.stop_drive().is_err() {
            self.session.stop_without_reply();
        }
        followed
    }

    fn follow(&mut self, on_event: &mut dyn FnMut(&Event)) -> Result<(), Failure> {
        self.session.start()?;
        loop {
            self.go_on()?;
            match self.session.next_report()? {
                Some(DeviceReport::Event { event: Event::Fault(fault), .. }) => return Err(failed(fault)),
                Some(DeviceReport::Event { event: Event::Finished { .. }, .. }) => return Ok(()),
                Some(DeviceReport::Event { event, .. }) => on_event(&event),
                Some(DeviceReport::Telemetry(_)) => {}
                None => {
                    // The event of the end may have been lost.
                    let (status, _) = self.session.status()?;
                    if let Some(fault) = status.fault {
                        return Err(failed(fault));
                    }
                    if status.state == RigState::Idle && self.session.has_used_up_credit() {
                        return Ok(());
                    }
                }
            }
        }
    }

    /// Moves the base to each of these demands, m, and holds it there for `hold_s`; returns the mean demand and z of the second
    /// half of each hold, and by how much z still moved.
    ///
    /// # Errors
    /// As [`CalibratedRig::sines`].
    pub fn steps(&mut self, demands_m: &[f64], hold_s: f64) -> Result<Vec<(f64, RestReading)>, Failure> {
        let samples = |seconds: f64| (seconds * f64::from(STEP_RATE_HZ)).round() as usize;
        let (move_s, mut record, mut holds) = (1.0, Vec::new(), Vec::new());
        let mut before = 0.0;
        for &demand in demands_m.iter().chain([&0.0]) {
            let moving = samples(move_s);
            // A half-cosine has no jump of the velocity.
            let part = |n: usize| 0.5 - 0.5 * (std::f64::consts::PI * n as f64 / moving as f64).cos();
            record.extend((0..moving).map(|n| before + (demand - before) * part(n)));
            holds.push(record.len());
            record.extend(std::iter::repeat_n(demand, samples(hold_s)));
            before = demand;
        }
        let counts: Vec<i16> = record.iter().map(|m| (m / f64::from(STEP_COUNT_M)).round() as i16).collect();
        let bytes: Vec<u8> = counts.iter().flat_map(|count| count.to_le_bytes()).collect();
        let stop = self.stop;
        self.session.upload(&bytes, &mut || !stop.load(Ordering::Relaxed))?;
        let playback = Playback {
            record: RecordId { samples: counts.len() as u16, crc32: checksum(0, &bytes) },
            sample_rate_hz: STEP_RATE_HZ,
            scale_m: STEP_COUNT_M,
            ramp_s: 0.0,
            tail_s: 0.0,
            rest_level_m: f32::MAX,
            index: self.next_index(1),
        };
        self.session.execute("take the steps", Request::ConfigurePlayback(playback))?;
        self.telemetry(&["drive", "z"], false)?;
        let rows = self.rows_of_experiment();
        self.quiet()?;
        let rows = rows?;
        // The record begins some samples before the demand first leaves zero.
        let Some(begun) = rows.iter().position(|(drive, _)| *drive != 0.0) else {
            return Err(Failure::Failed("the drive was not demanded to move".into()));
        };
        let per_sample = (TICK_HZ / STEP_RATE_HZ) as usize;
        let half = samples(hold_s) * per_sample / 2;
        let hold = |start: &usize| {
            let from = begun + start * per_sample + half;
            let part = rows.get(from..from + half * 4 / 5)?;
            let demand = part.iter().map(|(drive, _)| drive).sum::<f64>() / part.len().max(1) as f64;
            Some((demand, RestReading::of(&part.iter().map(|(_, z)| *z).collect::<Vec<f64>>())))
        };
        let held: Option<Vec<(f64, RestReading)>> = holds[..demands_m.len()].iter().map(hold).collect();
        held.ok_or_else(|| Failure::Failed("rows of the steps were lost".into()))
    }

    /// Drive and z of every tick of the configured experiment.
    fn rows_of_experiment(&mut self) -> Result<Vec<(f64, f64)>, Failure> {
        let followed = self.follow_rows();
        if followed.is_err() && self.session.stop_drive().is_err() {
            self.session.stop_without_reply();
        }
        followed
    }

    fn follow_rows(&mut self) -> Result<Vec<(f64, f64)>, Failure> {
        let mut rows = Vec::new();
        self.session.start()?;
        loop {
            self.go_on()?;
            match self.session.next_report()? {
                Some(DeviceReport::Telemetry(message)) if message.width == 2 => {
                    if message.first_tick as usize != rows.len() {
                        return Err(Failure::Failed("rows of the steps were lost on the link".into()));
                    }
                    rows.extend(message.values.chunks_exact(2).map(|row| (f64::from(row[0]), f64::from(row[1]))));
                }
                Some(DeviceReport::Event { event: Event::Fault(fault), .. }) => return Err(failed(fault)),
                Some(DeviceReport::Event { event: Event::Finished { .. }, .. }) => return Ok(rows),
                _ => {}
            }
        }
    }

    /// Listens for impacts from now on.
    ///
    /// # Errors
    /// The link.
    pub fn listen_for_blows(&mut self) -> Result<(), Failure> {
        self.telemetry(&[], true)
    }

    /// Waits for the next blow on a wall: the strongest of the pulses that follow each other closely.
    ///
    /// # Errors
    /// Ctrl-C, a fault, or a broken link.
    pub fn blow(&mut self) -> Result<ImpactRecord, Failure> {
        let mut strongest: Option<(ImpactRecord, Instant)> = None;
        loop {
            self.go_on()?;
            match self.session.next_report()? {
                Some(DeviceReport::Event { event: Event::Impact(impact), .. }) => {
                    if strongest.is_none_or(|(known, _)| impact.impulse_n_s > known.impulse_n_s) {
                        strongest = Some((impact, strongest.map_or_else(Instant::now, |(_, since)| since)));
                    }
                }
                Some(DeviceReport::Event { event: Event::Fault(fault), .. }) => return Err(failed(fault)),
                Some(_) => {}
                // Under a granted clock nothing comes later than what has come.
                None => {
                    if let Some((impact, since)) = strongest
                        && (self.session.is_granted() || since.elapsed() > SAME_BLOW)
                    {
                        return Ok(impact);
                    }
                }
            }
        }
    }

    /// Ends listening for impacts.
    ///
    /// # Errors
    /// The link.
    pub fn end_blows(&mut self) -> Result<(), Failure> {
        self.quiet()
    }

    /// Sends a command to the friction damper's spring and waits for its end.
    ///
    /// # Errors
    /// A fault of the spring, a command that does not end, Ctrl-C (the spring halts then).
    pub fn spring(
        &mut self,
        command: SpringCommand,
        is_done: impl Fn(&SpringEvent) -> bool,
    ) -> Result<SpringEvent, Failure> {
        self.session.execute("move the friction damper's spring", Request::Spring(command))?;
        let begun = Instant::now();
        loop {
            self.go_on()?;
            match self.session.next_report()? {
                Some(DeviceReport::Event {
                    event: Event::Spring(SpringEvent::Fault(fault)) | Event::Fault(fault),
                    ..
                }) => {
                    return Err(failed(fault));
                }
                Some(DeviceReport::Event { event: Event::Spring(event), .. }) if is_done(&event) => {
                    self.session.use_up_credit()?;
                    while self.session.report_at_hand().is_some() {}
                    return Ok(event);
                }
                Some(_) => {}
                None if begun.elapsed() > LONGEST_MOVE => {
                    let (status, _) = self.session.status()?;
                    let stage = status.spring.stage.text();
                    return Err(Failure::Failed(format!("the spring did not finish its move; it is {stage}")));
                }
                None => {}
            }
        }
    }

    /// Stage of the friction damper's spring.
    ///
    /// # Errors
    /// The link.
    pub fn spring_stage(&mut self) -> Result<SpringStage, Failure> {
        Ok(self.session.status()?.0.spring.stage)
    }

    /// Halts the spring and moves its block away; for every way in which a calibration may end.
    pub fn release_spring(&mut self) {
        // Whatever fails here has failed before and is told.
        let _ = self.session.execute("halt the spring", Request::Spring(SpringCommand::Halt));
        let _ = self.session.execute("release the spring", Request::Spring(SpringCommand::Release));
    }
}

fn failed(fault: Fault) -> Failure {
    let Fault { cause, value, limit, .. } = fault;
    Failure::Failed(format!("{} (value {value}, limit {limit}); nothing was saved", cause.text()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_and_scatter_are_told_apart() {
        let drifting: Vec<f64> = (0..1001).map(|n| 1.0 + f64::from(n) * 1e-3).collect();
        let reading = RestReading::of(&drifting);
        assert!((reading.mean - 1.5).abs() < 1e-12 && (reading.drift - 1.0).abs() < 1e-9 && reading.scatter < 1e-9);
        let alternating: Vec<f64> = (0..1000).map(|n| if n % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let reading = RestReading::of(&alternating);
        assert!((reading.scatter - 1.0).abs() < 2e-3 && reading.drift.abs() < 0.01, "{reading:?}");
    }
}
