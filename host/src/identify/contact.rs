//! The contact with a hard wall: its duration, the shape of its pulse, and its stiffness, from the impacts of a run or from force records.
//!
//! *Run.* The board measures impulse J and peak F of every pulse; τ = πJ/(2F) is the duration of the half-sine with both
//! ([`damprig_core::measure::impacts`]). The mean weighs a pulse by F²: noise of the force moves τ by its share of F. It also raises
//! F, which is corrected with a bound of the error. Sampling adds an error that no mean removes: the kinks of a half-sine change the sum of n samples a contact by up to π²/(12 n²) of J, and the
//! parabola at its peak is high by up to (π/n)⁴/4 of F.
//!
//! *Force record.* A half-sine is fitted to each pulse; its duration τ does not depend on where the samples fall. With J, the sum of the
//! samples, and F, the top of the parabola through the highest ones, the pulse factor is F·τ/J: π/2 of a half-sine.
//!
//! *Stiffness.* m_r = mM/(M + m). A spring has k = m_r (π/τ)². Elastic spheres, F = k δ^(3/2), have k = F^(5/2)/(5 m_r v²/4)^(3/2) with the
//! approach speed v, that follows from J = m_r v (1 + e(v)).

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use damprig_core::io::{TICK_HZ, WALL_SUBSAMPLES};
use damprig_core::model::SetUp;

use super::from_run::ExperimentChoice;
use super::statistics::Value;
use super::table::NumberTable;
use super::{Estimate, Identification, force_record};
use crate::failure::Failure;
use crate::run_folder::RunFolder;
use crate::table::values::{numbers, texts};

/// Interval of a board's force samples, s.
const SAMPLE_S: f64 = 1.0 / (TICK_HZ as f64 * WALL_SUBSAMPLES as f64);

/// A pulse as the board measured it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredPulse {
    /// Whether it was at the positive side.
    pub is_positive: bool,
    /// F, N.
    pub peak_n: f64,
    /// J, N·s.
    pub impulse_n_s: f64,
}

const HALF_SINES: &str = "half-sines with the pulses' impulse and peak";
const TIME: &str = "particle.wall.contact_time_s";
const POSITIVE_TIME: &str = "particle.positive_wall.contact_time_s";

/// Identifies the contacts of a run's hard walls.
///
/// # Errors
/// No run, no impacts or those of several experiments, a set-up without a model or with a soft wall, fewer than two pulses on a wall.
pub fn of_run(path: &Path, choice: &ExperimentChoice) -> Result<Identification, Failure> {
    let run = RunFolder::open(path).map_err(Failure::input)?;
    let failed = |e: &dyn std::fmt::Display| Failure::Input(format!("{}: {e}", path.display()));
    let all = pulses(&run).map_err(|e| failed(&e))?;
    let mut pairs: Vec<ExperimentNames> = all.iter().map(|(pair, _)| pair.clone()).collect();
    pairs.sort();
    pairs.dedup();
    let pair = pairs[choice.only(&run, &pairs, "experiment with impacts")?].clone();
    let record = run.manifest().set_ups.iter().find(|record| record.name == pair.0);
    let model = record.filter(|record| !record.has_unmodelled_damper).and_then(|record| record.model());
    let Some(model) = model else {
        return Err(failed(&format!(
            "set-up {:?} has no model of its particle\n  describe the particle in the campaign",
            pair.0
        )));
    };
    let own: Vec<MeasuredPulse> = all.into_iter().filter(|(of, _)| *of == pair).map(|(_, pulse)| pulse).collect();
    let mut identified = of_pulses(&own, &model).map_err(|why| failed(&why))?;
    identified.taken_from = format!("{}, set-up {:?}, experiment {:?}", run.id(), pair.0, pair.1);
    Ok(identified)
}

/// Names of a set-up and an experiment.
type ExperimentNames = (String, String);

/// The whole pulses of a run, with set-up and experiment: neither clipped nor held.
fn pulses(run: &RunFolder) -> Result<Vec<(ExperimentNames, MeasuredPulse)>, Failure> {
    let mut all = Vec::new();
    for batch in run.impacts()? {
        let read = |column: &str| numbers(&batch, column);
        let (set_ups, experiments) = (texts(&batch, "set_up")?, texts(&batch, "experiment")?);
        let (sides, peaks, impulses) = (read("side")?, read("peak_n")?, read("impulse_n_s")?);
        let (clipped, held) = (read("clipped")?, read("held")?);
        for n in (0..sides.len()).filter(|n| clipped[*n] == 0.0 && held[*n] == 0.0) {
            let pulse = MeasuredPulse { is_positive: sides[n] > 0.0, peak_n: peaks[n], impulse_n_s: impulses[n] };
            all.push(((set_ups[n].clone(), experiments[n].clone()), pulse));
        }
    }
    Ok(all)
}

/// Identifies the contacts from pulses on the hard walls of a set-up. With a second wall each has its own contact; otherwise that of all
/// pulses comes first.
///
/// # Errors
/// No particle, a soft wall, fewer than two pulses.
pub fn of_pulses(pulses: &[MeasuredPulse], set_up: &SetUp) -> Result<Identification, Failure> {
    let Some(particle) = set_up.particle.filter(|particle| particle.walls().iter().all(|wall| !wall.is_soft())) else {
        let text = "only a particle between hard walls has contacts that take no time in the model\n  the contact of a soft wall follows \
                    from its stiffness and damping";
        return Err(Failure::Input(text.into()));
    };
    let on = |is_positive: bool| pulses.iter().filter(move |pulse| pulse.is_positive == is_positive).copied().collect();
    let (negative, positive): (Vec<MeasuredPulse>, Vec<MeasuredPulse>) = (on(false), on(true));
    let is_one_wall = particle.cavity.positive_wall.is_none();
    let times = [contact_time(&negative), contact_time(&positive)];
    let names = ["contact time at the negative side", "contact time at the positive side"];
    let mut estimates = Vec::new();
    if is_one_wall {
        let all = contact_time(pulses);
        estimates.extend(all.map(|time| Estimate::new("contact time", "s", HALF_SINES, &time).of_key(TIME)));
    }
    for ((name, key), time) in names.into_iter().zip([TIME, POSITIVE_TIME]).zip(&times) {
        let Some(time) = time else { continue };
        let estimate = Estimate::new(name, "s", HALF_SINES, time);
        estimates.push(if is_one_wall { estimate } else { estimate.of_key(key) });
    }
    if estimates.is_empty() {
        let text = format!(
            "there are {} whole pulses on the negative side and {} on the positive one; at least 2 are needed for an uncertainty\n  measure \
             more impacts",
            negative.len(),
            positive.len()
        );
        return Err(Failure::Input(text));
    }
    let reduced_kg = particle.mass_kg * set_up.structure.mass_kg / (particle.mass_kg + set_up.structure.mass_kg);
    let sides = [
        ("negative", &negative, "stiffness of a spring contact, negative side", "Hertz stiffness, negative side"),
        ("positive", &positive, "stiffness of a spring contact, positive side", "Hertz stiffness, positive side"),
    ];
    let mut remarks = Vec::new();
    for (((side, own, spring, hertz), time), wall) in sides.into_iter().zip(&times).zip(particle.walls()) {
        let (Some(time), Some(law)) = (time, wall.impact_law::<f64>(1.0)) else { continue };
        let stiffness = spring_stiffness(time, reduced_kg);
        estimates.push(Estimate::new(spring, "N/m", "m_r (π/τ)², m_r = mM/(M + m)", &stiffness));
        let speed = |pulse: &MeasuredPulse| law.approach(pulse.impulse_n_s / reduced_kg);
        let found = mean_of(own, |pulse| hertz_stiffness(pulse.peak_n, reduced_kg, speed(pulse)));
        let method = "peaks, and approach speeds from the impulses with the set-up's e";
        estimates.extend(found.map(|value| Estimate::new(hertz, "N/m^1.5", method, &value)));
        let ends = |of: &dyn Fn(&MeasuredPulse) -> f64| {
            own.iter().map(of).fold([f64::MAX, 0.0f64], |[low, high], value| [low.min(value), high.max(value)])
        };
        let (impulses, peaks, speeds) = (ends(&|p| p.impulse_n_s), ends(&|p| p.peak_n), ends(&speed));
        remarks.push(format!(
            "{side} side: {} pulses, impulses {:.4} N·s to {:.4} N·s, peaks {:.1} N to {:.1} N, approach speeds {:.3} m/s to {:.3} m/s",
            own.len(),
            impulses[0],
            impulses[1],
            peaks[0],
            peaks[1],
            speeds[0],
            speeds[1]
        ));
    }
    if let ([Some(a), Some(b)], true) = (&times, is_one_wall)
        && (a.value - b.value).abs() > 3.0 * a.standard_uncertainty.hypot(b.standard_uncertainty)
    {
        remarks.push(
            "the contact times of the two sides differ by more than their uncertainty: describe the walls apart".into(),
        );
    }
    remarks.push(
        "a run has impulse and peak of a pulse, not its shape: the pulse factor is that of a half-sine, π/2".into(),
    );
    let mut identified = Identification::new("", estimates);
    identified.remarks = remarks;
    identified.words = vec![("particle.wall.kind", "restitution")];
    if !is_one_wall {
        identified.words.push(("particle.positive_wall.kind", "restitution"));
    }
    Ok(identified)
}

/// The mean τ of pulses, s, with the errors that no mean removes: of the sampling, and of the peak.
///
/// The peak is that of the highest of many samples, which noise raises: τ = πJ/(2F) is too short. For half-sines of n = 10 to 500 samples with
/// white noise of 0.25 to 2 % of their peak it is so by up to [`raised`] times the scatter of a single pulse; half of that is added,
/// and the other half is the bound of the error.
fn contact_time(pulses: &[MeasuredPulse]) -> Option<Value> {
    let time = mean_of(pulses, |pulse| FRAC_PI_2 * pulse.impulse_n_s / pulse.peak_n)?;
    let samples = time.value / SAMPLE_S;
    let scatter_s = time.standard_uncertainty * (pulses.len() as f64).sqrt();
    let bound_s = 0.5 * raised(samples) * scatter_s;
    let middle = Value { value: time.value + bound_s, ..time };
    Some(middle.widened(time.value * sampling_error(samples)).widened(bound_s / 3f64.sqrt()))
}

/// By how many scatters of a pulse noise shortens the contact of a half-sine with this many samples at most: 1.13·ln n − 2.6 in simulations
/// of 10 to 500 samples with white noise of 0.25 to 2 % of the peak, and a fifth more for the scatter of few pulses.
fn raised(samples: f64) -> f64 {
    1.2 * (1.13 * samples.ln() - 2.6).max(0.3)
}

/// Standard uncertainty of J/F of a half-sine with this many samples, relative: of a rectangular distribution within the largest errors.
fn sampling_error(samples: f64) -> f64 {
    (PI * PI / (12.0 * samples * samples) + (PI / samples).powi(4) / 4.0) / 3f64.sqrt()
}

/// Of a force of which noise moves a quantity by its share of the peak.
trait Peaked {
    fn peak_n(&self) -> f64;
}

impl Peaked for MeasuredPulse {
    fn peak_n(&self) -> f64 {
        self.peak_n
    }
}

impl Peaked for force_record::ForcePulse {
    fn peak_n(&self) -> f64 {
        self.peak_n
    }
}

/// The mean of a quantity of pulses, each weighed by its peak squared; `None` for fewer than two.
fn mean_of<P: Peaked>(pulses: &[P], of: impl Fn(&P) -> f64) -> Option<Value> {
    if pulses.len() < 2 {
        return None;
    }
    let weight = |pulse: &P| pulse.peak_n() * pulse.peak_n();
    let total: f64 = pulses.iter().map(weight).sum();
    let value = pulses.iter().map(|pulse| weight(pulse) * of(pulse)).sum::<f64>() / total;
    let degrees_of_freedom = pulses.len() as f64 - 1.0;
    let scatter = pulses.iter().map(|pulse| weight(pulse) * (of(pulse) - value).powi(2)).sum::<f64>();
    let standard_uncertainty = (scatter / (total * degrees_of_freedom)).sqrt();
    Some(Value { value, standard_uncertainty, degrees_of_freedom })
}

/// k = m_r (π/τ)², N/m.
fn spring_stiffness(time_s: &Value, reduced_kg: f64) -> Value {
    let k = reduced_kg * (PI / time_s.value).powi(2);
    time_s.mapped(k, -2.0 * k / time_s.value)
}

/// k of elastic spheres that reach this peak at this approach speed, N/m^1.5.
fn hertz_stiffness(peak_n: f64, reduced_kg: f64, speed_m_per_s: f64) -> f64 {
    peak_n.powf(2.5) / (1.25 * reduced_kg * speed_m_per_s * speed_m_per_s).powf(1.5)
}

const FITTED: &str = "half-sine fitted to each pulse of the force record";
const SHAPE: &str = "peak times contact time over impulse";

/// Identifies the contact from force records (columns t_s and force_n), each with one pulse or several. `reduced_mass_kg` gives the
/// stiffness.
///
/// # Errors
/// Missing columns, a force without a pulse, a sensor at its limit.
pub fn of_records(tables: &[NumberTable], reduced_mass_kg: Option<f64>) -> Result<Identification, Failure> {
    let mut all = Vec::new();
    for table in tables {
        all.extend(force_record::pulses(table)?);
    }
    let Some(strongest) = all.iter().max_by(|a, b| a.peak_n.total_cmp(&b.peak_n)) else {
        return Err(Failure::Input(
            "there is no force record
  name a CSV file"
                .into(),
        ));
    };
    // One pulse has the uncertainty of its fit.
    let share = strongest.uncertainty_s / strongest.time_s;
    let alone =
        |value: f64| Value { value, standard_uncertainty: value * share, degrees_of_freedom: strongest.samples };
    let time = mean_of(&all, |one| one.time_s).unwrap_or_else(|| alone(strongest.time_s));
    let factor = mean_of(&all, force_record::ForcePulse::factor).unwrap_or_else(|| alone(strongest.factor()));
    let factor = factor.widened(factor.value * sampling_error(strongest.samples));
    let mut estimates = vec![
        Estimate::new("contact time", "s", FITTED, &time).of_key(TIME),
        Estimate::new("pulse factor", "", SHAPE, &factor).of_key("particle.wall.pulse_factor"),
    ];
    estimates.extend(reduced_mass_kg.map(|mass_kg| {
        Estimate::new("stiffness of a spring contact", "N/m", "m_r (π/τ)²", &spring_stiffness(&time, mass_kg))
    }));
    let files: Vec<&str> = tables.iter().map(NumberTable::file).collect();
    let mut identified = Identification::new(files.join(", "), estimates);
    identified.remarks = vec![format!(
        "{} pulses, the strongest with an impulse of {:.5} N·s and a peak of {:.2} N; a half-sine has the factor {FRAC_PI_2:.4}",
        all.len(),
        strongest.impulse_n_s,
        strongest.peak_n
    )];
    identified.words = vec![("particle.wall.kind", "restitution")];
    Ok(identified)
}
