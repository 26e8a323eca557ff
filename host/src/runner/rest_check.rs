//! Checks that the rig is at rest after a person has changed it, before the drive starts.
//!
//! The level is `rest_level_m` of the experiment. The controller waits until |x| is below it before it drives, for up to ten
//! minutes: in vain if the zero of x was moved. What was measured goes into the journal.

use std::f64::consts::TAU;
use std::fmt;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use damprig_core::control::friction_spring::SpringStage;
use damprig_core::io::{Sensor, SensorSet, TICK_HZ};
use damprig_core::rig::RigState;
use damprig_protocol::Request;

use super::context::Run;
use super::error::RunError;
use super::reconnect;
use super::watcher::RestAnswer;
use crate::campaign::{CampaignSetUp, Experiment};
use crate::client::session::DeviceReport;

/// Shortest and longest measurement, s. Within, it takes whole periods of the structure: ringing has no mean.
const MEASURED_S: (f64, f64) = (1.0, 10.0);

/// Rows at the start that are dropped: those of the selection before may still arrive.
const DROPPED_ROWS: usize = 200;

/// Time limit of a measurement, many times its length.
const PATIENCE: Duration = Duration::from_secs(60);

/// The measured signals. `x_peak` is what the controller compares with the level.
const SIGNALS: [&str; 3] = ["x", "z", "x_peak"];

/// The same in rows that are wider than those of a run with two or three signals: no row of the check may pass for one of the run.
const WIDE_SIGNALS: [&str; 5] = ["x", "z", "x_peak", "drive", "frequency"];

/// A displacement while the drive is off.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AtRest {
    mean_m: f64,
    /// RMS about the mean, m.
    rms_m: f64,
    /// Largest magnitude, m.
    largest_m: f64,
}

impl AtRest {
    /// Of the mean of each tick, and the largest magnitude.
    fn of(values: impl Iterator<Item = f64> + Clone, largest_m: f64) -> Self {
        let count = values.clone().count().max(1) as f64;
        let mean_m = values.clone().sum::<f64>() / count;
        let square = values.map(|value| (value - mean_m).powi(2)).sum::<f64>() / count;
        Self { mean_m, rms_m: square.sqrt(), largest_m }
    }

    /// Whether all of it is below the level; not of a number that is none.
    fn is_below(&self, level_m: f64) -> bool {
        [self.mean_m, self.rms_m, self.largest_m].iter().all(|value| value.abs() < level_m)
    }

    /// Whether it is off zero rather than in motion.
    fn is_shifted(&self) -> bool {
        self.mean_m.abs() > self.rms_m
    }
}

/// What was measured at rest after a person had changed the rig.
#[derive(Clone, Debug, PartialEq)]
pub struct RestFinding {
    set_up: String,
    experiment: String,
    measured_s: f64,
    x: AtRest,
    z: AtRest,
    lost: SensorSet,
    /// What x and z must stay below, m; none where a person may hold the structure deflected.
    level_m: Option<f64>,
    /// Deflection at which the friction damper holds the structure, F/k, m.
    held_m: Option<f64>,
    /// Stage of the friction damper's spring, if the set-up has one.
    spring: Option<SpringStage>,
}

impl RestFinding {
    /// Whether both sensors have a signal and x and z stay below the level.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        let is_lost = [Sensor::X, Sensor::Z].into_iter().any(|sensor| self.lost.contains(sensor));
        !is_lost && self.level_m.is_none_or(|level_m| self.x.is_below(level_m) && self.z.is_below(level_m))
    }

    /// What was measured, what is allowed, and the likely cause, on one line each after a heading.
    #[must_use]
    pub fn question(&self) -> Vec<String> {
        let Self { set_up, experiment, measured_s, .. } = self;
        let heading = format!(
            "Set-up {set_up:?} is not at rest before experiment {experiment:?}; with the drive off, {measured_s:.1} s:"
        );
        let cause = format!("likely cause: {}", self.causes().join("; "));
        std::iter::once(heading).chain(self.numbers()).chain([cause]).collect()
    }

    /// [`RestFinding::question`] on one line.
    #[must_use]
    pub fn question_in_line(&self) -> String {
        let lines = self.question();
        format!("{} {}.", lines[0], lines[1..].join("; "))
    }

    /// x, z, the level, and the stage of the friction spring.
    fn numbers(&self) -> Vec<String> {
        let one = |name: &str, sensor: Sensor, at: &AtRest| {
            let AtRest { mean_m, rms_m, largest_m } = at;
            if self.lost.contains(sensor) {
                return format!("{name} has no signal");
            }
            let [mean, rms, largest] = [mean_m, rms_m, largest_m].map(|m| m * 1e3);
            format!("{name} mean {mean:+.3} mm, RMS about it {rms:.3} mm, largest |{name}| {largest:.3} mm")
        };
        let allowed = match self.level_m {
            Some(level_m) => format!("allowed: below {} mm (rest_level_m)", (level_m * 1e9).round() / 1e6),
            None => "allowed: any, with a signal".into(),
        };
        let mut numbers = vec![one("x", Sensor::X, &self.x), one("z", Sensor::Z, &self.z), allowed];
        numbers.extend(self.spring.map(|stage| format!("the friction spring is {}", stage.text())));
        numbers
    }

    fn causes(&self) -> Vec<String> {
        let mut causes = Vec::new();
        for (name, sensor) in [("x", Sensor::X), ("z", Sensor::Z)] {
            if self.lost.contains(sensor) {
                causes.push(format!(
                    "the target of {name} is not in the beam of its sensor, or the sensor is not connected or not supplied"
                ));
            }
        }
        let is_off = |at: &AtRest, sensor| {
            !self.lost.contains(sensor) && self.level_m.is_some_and(|level_m| !at.is_below(level_m))
        };
        if is_off(&self.x, Sensor::X) {
            causes.push(self.cause_of_x());
        }
        if is_off(&self.z, Sensor::Z) {
            causes.push(if self.z.is_shifted() {
                "the zero of z has shifted: put its target or its sensor back, or calibrate it (`damprig calibrate z`)"
                    .into()
            } else {
                "the base moves although the drive is off".into()
            });
        }
        causes
    }

    fn cause_of_x(&self) -> String {
        if !self.x.is_shifted() {
            return "the structure has not settled: wait, and measure again".into();
        }
        let shifted = "the zero of x has shifted, as when the mass was moved: put the target or its sensor back, or calibrate it \
             (`damprig calibrate x`)";
        let presses = matches!(self.spring, Some(SpringStage::Setting | SpringStage::Holding));
        match self.held_m {
            _ if presses => format!("{shifted}; or the friction spring presses and holds the structure off its middle"),
            Some(held_m) if self.spring.is_none() => {
                let held_mm = held_m * 1e3;
                format!(
                    "{shifted}; or the friction damper holds the structure off its middle, by up to F/k = {held_mm:.2} mm"
                )
            }
            _ => shifted.into(),
        }
    }
}

/// As the journal has it.
impl fmt::Display for RestFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { set_up, experiment, .. } = self;
        let verdict = if self.is_at_rest() { "at rest" } else { "not at rest" };
        write!(f, "{verdict}: set-up {set_up:?} before experiment {experiment:?}: {}", self.numbers().join("; "))
    }
}

impl Run<'_> {
    /// Measures the rig after a person has changed it, until it is at rest or the person goes on.
    ///
    /// # Errors
    /// The device or the link; the person stops the run.
    pub(super) fn check_rest(&mut self, set_up: &CampaignSetUp, experiment: &Experiment) -> Result<(), RunError> {
        let mut is_first_loss = true;
        loop {
            let finding = match self.measure_rest(set_up, experiment) {
                Err(RunError::Session(error)) if is_first_loss && reconnect::is_recoverable(&error) => {
                    is_first_loss = false;
                    self.reconnect(error)?;
                    continue;
                }
                finding => finding?,
            };
            self.note_action(&finding.to_string());
            if finding.is_at_rest() {
                break;
            }
            let answer = self.with_person(|watcher| watcher.not_at_rest(&finding))?;
            // Ctrl-C while the question stood.
            if self.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            match answer {
                RestAnswer::Again => {}
                RestAnswer::GoOn => {
                    self.note_action("went on although the rig was not at rest");
                    break;
                }
                RestAnswer::Stop => {
                    self.note_action("stopped because the rig was not at rest");
                    let (set_up, experiment) = (set_up.name.clone(), experiment.name.clone());
                    return Err(RunError::NotAtRest { set_up, experiment });
                }
            }
        }
        // A fault from the mounting, as of a blow on a wall, is cleared.
        match self.make_ready() {
            // The link may have been lost while the person thought.
            Err(error) if reconnect::is_recoverable(&error) => self.reconnect(error),
            ready => Ok(ready?),
        }
    }

    fn measure_rest(&mut self, set_up: &CampaignSetUp, experiment: &Experiment) -> Result<RestFinding, RunError> {
        let (status, _) = self.session.status()?;
        if matches!(status.state, RigState::Running(_) | RigState::Stopping) {
            self.make_ready()?;
        }
        let model = set_up.model();
        let period_s = TAU / model.structure.angular_frequency_rad_per_s();
        let measured_s = ((MEASURED_S.0 / period_s).ceil() * period_s).min(MEASURED_S.1);
        let rows = self.rows_at_rest((measured_s * f64::from(TICK_HZ)).round() as usize)?;
        let column = |at: usize| rows.iter().map(move |row| row[at]);
        // A value that is no number is no rest.
        let larger = |most: f64, value: f64| if most.is_nan() || value.abs() <= most { most } else { value.abs() };
        let largest = |at: usize| column(at).fold(0.0, larger);
        let (status, _) = self.session.status()?;
        Ok(RestFinding {
            set_up: set_up.name.clone(),
            experiment: experiment.name.clone(),
            measured_s,
            x: AtRest::of(column(0), largest(2)),
            z: AtRest::of(column(1), largest(1)),
            lost: status.sensors.lost,
            level_m: experiment.rest_level_m(),
            held_m: model.friction_damper.map(|damper| damper.force_n / model.structure.stiffness_n_per_m),
            spring: set_up.spring().map(|_| status.spring.stage),
        })
    }

    /// The signals of this many ticks.
    fn rows_at_rest(&mut self, count: usize) -> Result<Vec<[f64; 3]>, RunError> {
        let table = &self.session.signals;
        let place = |name| table.iter().position(|signal| signal.name == name).map(|place| place as u8);
        // The run may add its frequency.
        let names: &[&str] = if (2..=3).contains(&self.selection.positions.len()) { &WIDE_SIGNALS } else { &SIGNALS };
        let Some(signals) = names.iter().copied().map(place).collect() else {
            return Err(self.session.unusable(format!("its signals lack one of {}", names.join(", "))).into());
        };
        self.has_rows_at_rest = true;
        let ask = Request::SetTelemetry { every_ticks: 1, signals, impacts: false };
        self.session.execute("send telemetry", ask)?;
        let (mut rows, begun) = (Vec::new(), Instant::now());
        while rows.len() < DROPPED_ROWS + count {
            if self.stop.load(Ordering::Relaxed) {
                return Err(RunError::Interrupted);
            }
            if begun.elapsed() > PATIENCE {
                let what = format!("{} rows of telemetry in {} s", rows.len(), PATIENCE.as_secs());
                return Err(self.session.unusable(what).into());
            }
            if let Some(DeviceReport::Telemetry(message)) = self.session.next_report()?
                && usize::from(message.width) == names.len()
            {
                let each = message.values.chunks_exact(names.len());
                rows.extend(each.map(|row| [row[0], row[1], row[2]].map(f64::from)));
            }
        }
        self.end_telemetry()?;
        Ok(rows.drain(DROPPED_ROWS..).take(count).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(mean_m: f64, rms_m: f64) -> AtRest {
        AtRest { mean_m, rms_m, largest_m: mean_m.abs() + 2.0 * rms_m }
    }

    fn finding(x: AtRest, z: AtRest) -> RestFinding {
        RestFinding {
            set_up: "bare".into(),
            experiment: "sweep".into(),
            measured_s: 1.2,
            x,
            z,
            lost: SensorSet::default(),
            level_m: Some(1e-4),
            held_m: None,
            spring: None,
        }
    }

    const STILL: AtRest = AtRest { mean_m: 2e-5, rms_m: 5e-6, largest_m: 4e-5 };

    #[test]
    fn mean_and_rms_of_whole_periods_are_those_of_the_sine_and_its_offset() {
        let sine = (0..1200).map(|n| 2e-3 + 1e-3 * (TAU * f64::from(n) / 400.0).sin());
        let AtRest { mean_m, rms_m, .. } = AtRest::of(sine, 3e-3);
        assert!((mean_m - 2e-3).abs() < 1e-15 && (rms_m - 1e-3 / 2f64.sqrt()).abs() < 1e-15, "{mean_m} {rms_m}");
    }

    #[test]
    fn each_cause_is_told_apart() {
        assert!(finding(STILL, STILL).is_at_rest());
        let lost = |sensor| {
            let mut lost = SensorSet::default();
            lost.insert(sensor);
            lost
        };
        let bare = || finding(STILL, STILL);
        for (finding, words) in [
            (finding(at(2e-3, 1e-6), STILL), "the zero of x has shifted"),
            (finding(at(1e-5, 2e-3), STILL), "the structure has not settled"),
            (finding(STILL, at(-2e-3, 1e-6)), "the zero of z has shifted"),
            (finding(STILL, at(1e-5, 2e-3)), "the base moves although the drive is off"),
            (finding(at(f64::NAN, f64::NAN), STILL), "the structure has not settled"),
            (RestFinding { lost: lost(Sensor::X), ..bare() }, "the target of x is not in the beam"),
            (RestFinding { lost: lost(Sensor::Z), level_m: None, ..bare() }, "the target of z is not in the beam"),
            (RestFinding { held_m: Some(6e-4), ..finding(at(3e-4, 1e-6), STILL) }, "by up to F/k = 0.60 mm"),
            (
                RestFinding {
                    spring: Some(SpringStage::Holding),
                    held_m: Some(6e-4),
                    ..finding(at(3e-4, 1e-6), STILL)
                },
                "the friction spring presses",
            ),
        ] {
            let question = finding.question_in_line();
            assert!(!finding.is_at_rest() && finding.causes().len() == 1, "{question}");
            assert!(question.contains(words), "no {words:?} in: {question}");
        }
    }

    #[test]
    fn a_structure_that_a_person_holds_needs_a_signal_alone() {
        let held = RestFinding { level_m: None, ..finding(at(0.03, 1e-4), STILL) };
        assert!(held.is_at_rest(), "{held}");
        assert!(
            held.to_string().starts_with("at rest: set-up \"bare\" before experiment \"sweep\": x mean +30.000 mm")
        );
    }
}
