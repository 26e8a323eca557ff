//! Analyses a simulated case (`damprig simulate --analyse`): energy balance, lock-in, period, orbit and stability.

use std::f64::consts::TAU;

use damprig_core::analysis::energy::{Balance, EnergyMeter};
use damprig_core::analysis::lock_in::FourierIntegral;
use damprig_core::analysis::section::Section;
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, ExactState, Excitation, Impact, Observer};
use serde::Serialize;

use super::lyapunov::Lyapunov;
use super::periodic_orbit::{PeriodicOrbit, Stability};
use super::repetition::Repetition;
use super::return_map;
use super::run_sensitivities::{WrittenCase, motion_case};
use super::sensitivities::Sensitivities;
use crate::simulation::Case;
use crate::simulation::motion::ExactObserver;
use crate::simulation::multi_degree::driver;
use crate::simulation::statistics::{LastCyclesMeter, STEADY};

/// Most drive periods at the end of the run that are analysed.
const ANALYSED_PERIODS: u64 = 64;

/// Fewest of them, in a run that has as many: the last twenty cycles are what a steady |x| is judged by.
const MIN_PERIODS: u64 = 20;

/// Distance from a stable orbit, relative to the motion, up to which a run counts as settling onto it.
const SETTLING: f64 = 0.1;

/// Least distance of the section from an impact, as a fraction of the drive period: a small shift of an impact must not
/// move it across the section.
const CLEAR_OF_IMPACTS: f64 = 1e-3;

/// Analysis of a case.
#[derive(Clone, Debug, Serialize)]
pub struct Analysis {
    /// What acts in place of walls with Hertz contact; `None` without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub walls: Option<String>,
    /// Energy balance of the whole run; `None` on a recorded base or with several places, whose engines have none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<Balance>,
    /// Response to a sinusoidal excitation; `None` for others.
    pub driven: Option<ForcedResponse>,
    /// Growth of small disturbances along the motion of a structure with several places under a sine that is on no periodic motion at its end, and
    /// goes on for it beyond the run; only of [`Analysis::complete`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lyapunov: Option<Lyapunov>,
    /// How the results of the run follow the keys of the case, where the response has no sensitivities; only of [`Analysis::complete`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivities: Option<Sensitivities>,
    /// Why they are not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_sensitivities: Option<String>,
}

/// The last periods of a run under a sine.
#[derive(Clone, Debug, Serialize)]
pub struct ForcedResponse {
    /// Number of drive periods analysed.
    pub periods: u64,
    /// Amplitude of x at the drive frequency, m.
    pub amplitude_m: f64,
    /// Phase of x relative to the drive, rad, −π to π.
    pub phase_rad: f64,
    /// Mean over these periods of the largest |x|, m.
    pub mean_cycle_max_abs_x_m: f64,
    /// The verdict on the end of the run, which takes all that follows into account.
    pub motion: MotionKind,
    /// Largest relative difference that counts as none, in every statement.
    pub tolerance: f64,
    /// Largest relative deviation of the last twenty cycles' largest |x| from the mean of the last ten; `None` in a shorter run.
    pub cycle_maxima_spread: Option<f64>,
    /// Drive periods after which states and largest |x| of the last periods repeat within the tolerance; `None` if they do not.
    pub repeats_after: Option<usize>,
    /// The largest relative difference of those states and maxima; without a repetition, that of the nearest one.
    pub repeats_within: f64,
    /// Drive phase of the section, rad, 0 to 2π: that of the run's start, or one away from impacts if a periodic motion has
    /// impacts there.
    pub section_phase_rad: f64,
    /// The last states at the section, oldest first.
    pub section: Vec<SectionState>,
    /// Closed form of the orbit with two equispaced impacts per cycle, where it exists.
    pub two_impact_orbit: Option<TwoImpactOrbit>,
    /// Periodic orbit at the end of the run, by Newton's method.
    pub orbit: Option<OrbitSummary>,
    /// Why no orbit was found.
    pub no_orbit: Option<String>,
    /// Growth of small disturbances along a motion that is not periodic, which goes on for it beyond the run; not of [`Analysis::watched`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lyapunov: Option<Lyapunov>,
    /// The orbit that `orbit` tells of.
    #[serde(skip)]
    periodic_orbit: Option<PeriodicOrbit>,
    /// How the results of the orbit follow its quantities, if the run is on it; not of [`Analysis::watched`].
    pub sensitivities: Option<Sensitivities>,
    /// Why they are not known.
    pub no_sensitivities: Option<String>,
}

/// What the end of a run under a sine is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionKind {
    /// It repeats, and is on its periodic orbit where one can be computed.
    Periodic,
    /// It approaches a periodic orbit, or still drifts.
    Settling,
    /// It does not repeat: a long transient, a long period or chaos.
    NotPeriodic,
}

impl MotionKind {
    fn of(repeats: bool, orbit: Option<&OrbitSummary>) -> Self {
        match orbit {
            None if repeats => Self::Periodic,
            None => Self::NotPeriodic,
            Some(orbit) if repeats && orbit.is_run_on_it => Self::Periodic,
            Some(_) if repeats => Self::Settling,
            Some(orbit) if orbit.is_near() => Self::Settling,
            Some(_) => Self::NotPeriodic,
        }
    }
}

/// A state at the section.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SectionState {
    /// x, m.
    pub x_m: f64,
    /// x′, m/s.
    pub v_m_per_s: f64,
    /// y, m.
    pub y_m: f64,
    /// y′, m/s.
    pub u_m_per_s: f64,
}

impl SectionState {
    fn state(&self) -> ExactState {
        let (offset_m, slide_m_per_s) = (self.y_m - self.x_m, self.u_m_per_s - self.v_m_per_s);
        ExactState { x_m: self.x_m, v_m_per_s: self.v_m_per_s, offset_m, slide_m_per_s }
    }
}

impl From<&ExactState> for SectionState {
    fn from(s: &ExactState) -> Self {
        Self { x_m: s.x_m, v_m_per_s: s.v_m_per_s, y_m: s.y_m(), u_m_per_s: s.u_m_per_s() }
    }
}

/// The two-impact orbit in closed form (Masri and Caughey).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct TwoImpactOrbit {
    /// Speed of the particle, m/s.
    pub particle_speed_m_per_s: f64,
    /// |x′ − y′| before an impact, m/s.
    pub approach_speed_m_per_s: f64,
    /// Displacement at the impact on the + wall, m.
    pub impact_displacement_m: f64,
}

/// A periodic orbit found by Newton's method.
#[derive(Clone, Debug, Serialize)]
pub struct OrbitSummary {
    /// Drive periods after which it repeats.
    pub periods: u32,
    /// Drive phase of its section, rad, 0 to 2π: far from impacts.
    pub section_phase_rad: f64,
    /// Floquet multipliers, real and imaginary part, largest first.
    pub multipliers: Vec<[f64; 2]>,
    /// Which multipliers are 1 in magnitude within the error: disturbances in that direction neither grow nor decay.
    pub neutral: Vec<bool>,
    /// Error of the matrix whose eigenvalues they are, as a norm.
    pub derivative_error: f64,
    /// "stable": all small disturbances decay; "neutral": some persist, none grows; "unstable": one grows.
    pub stability: &'static str,
    /// Whether all multipliers lie inside the unit circle.
    pub stable: bool,
    /// Distance of the run's end from it, relative to the size of the motion.
    pub distance: f64,
    /// Whether that is within the tolerance: the run is on this orbit.
    pub is_run_on_it: bool,
}

impl OrbitSummary {
    /// Whether a run that ends at this distance may be settling onto it.
    #[must_use]
    pub fn is_near(&self) -> bool {
        self.distance <= SETTLING && self.stability != Stability::Unstable.name()
    }
}

impl From<&PeriodicOrbit> for OrbitSummary {
    fn from(orbit: &PeriodicOrbit) -> Self {
        let stability = orbit.stability();
        Self {
            periods: orbit.periods,
            section_phase_rad: orbit.section_phase_rad,
            multipliers: orbit.multipliers.iter().map(|m| [m.value.re, m.value.im]).collect(),
            neutral: orbit.multipliers.iter().map(|m| m.is_neutral).collect(),
            derivative_error: orbit.derivative_error,
            stability: stability.name(),
            stable: stability == Stability::Stable,
            distance: orbit.distance,
            is_run_on_it: orbit.distance <= STEADY,
        }
    }
}

/// Times at which the velocity jumps, s.
#[derive(Default)]
struct VelocityJumps(Vec<f64>);

impl Observer for VelocityJumps {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        if impact.before != impact.after {
            self.0.push(impact.time_s);
        }
    }
}

/// Delay that moves the sections of a motion away from its velocity jumps, s; `None` if none is near. The sections are
/// `period_s` apart, the first at `start_s`.
fn delay_s(motion: &Exact, start_s: f64, length_s: f64, period_s: f64) -> Option<f64> {
    let mut jumps = VelocityJumps::default();
    motion.clone().run(start_s + length_s, &mut jumps);
    let mut at: Vec<f64> = jumps.0.iter().map(|time_s| (time_s - start_s).rem_euclid(period_s)).collect();
    at.sort_by(f64::total_cmp);
    let (first, last) = (*at.first()?, *at.last()?);
    let clear_s = CLEAR_OF_IMPACTS * period_s;
    if first > clear_s && last < period_s - clear_s {
        return None;
    }
    let pairs = at.windows(2).map(|pair| (pair[0], pair[1])).chain([(last, first + period_s)]);
    let (from, to) = pairs.max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))?;
    Some((0.5 * (from + to)).rem_euclid(period_s))
}

/// The last periods of a run under a sine, of which its steady state is told.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnalysedPeriods {
    turning: f64,
    /// Whole periods of the run.
    whole: u64,
    periods: u64,
    /// When they begin, s.
    pub start_s: f64,
}

impl AnalysedPeriods {
    /// Of a case under a sine of this angular frequency, rad/s; `None` if the run is shorter than a period.
    pub(crate) fn of(case: &Case, turning: f64) -> Option<Self> {
        let period_s = TAU / turning;
        let whole = (case.run.duration_s / period_s * (1.0 + 1e-12)).floor() as u64;
        let periods = ANALYSED_PERIODS.min(whole.div_ceil(2)).max(MIN_PERIODS).min(whole);
        let start_s = (whole - periods) as f64 * period_s;
        (whole > 0).then_some(Self { turning, whole, periods, start_s })
    }
}

impl Analysis {
    /// Analyses a case with an excitation in closed form; `None` for a recorded base motion.
    #[must_use]
    pub fn of(case: &Case) -> Option<Self> {
        Self::with_sensitivities(case, &mut ())
    }

    /// Analyses any case but spheres, which is `written`; where a periodic motion has no sensitivities, or is not there, those of the run. `watch` sees
    /// the transient of a motion in closed form, and how far the sensitivities are; a run that it ends has no driven motion.
    pub fn complete(case: &Case, written: &WrittenCase, watch: &mut impl Observer) -> Self {
        let found = if case.multi_degree.is_some() { None } else { Self::with_sensitivities(case, watch) };
        // Derivatives are those of impacts that take no time; the energy is that of the same walls.
        let hard = case.without_hertz();
        let mut analysis = found.unwrap_or(Self {
            walls: hard.hertz_as_hard(),
            energy: None,
            driven: None,
            lyapunov: None,
            sensitivities: None,
            no_sensitivities: None,
        });
        let driven = analysis.driven.as_ref();
        let is_chaotic = driven.and_then(|driven| driven.lyapunov.as_ref()).is_some_and(Lyapunov::is_chaotic);
        let goes_on: &mut dyn FnMut(f64) -> bool = &mut |t_s| watch.goes_on(t_s);
        if let Some(several) = &hard.multi_degree {
            analysis.energy = driver::energy(&hard, several, goes_on);
        }
        if is_chaotic {
            analysis.no_sensitivities = Some("none: the motion is chaotic".into());
        } else if driven.is_none_or(|driven| driven.sensitivities.is_none()) {
            match Sensitivities::of_run(case, written, goes_on) {
                Ok(found) => analysis.sensitivities = Some(found),
                Err(why) => analysis.no_sensitivities = Some(why),
            }
        }
        let run = analysis.sensitivities.as_ref().and_then(|found| found.run.as_ref());
        let is_on_orbit = run.is_some_and(|run| run.repeats_after.is_some());
        if case.multi_degree.is_some() && case.is_under_a_sine() && !is_on_orbit {
            let run = motion_case(case, None);
            let found = Lyapunov::of_structure(&run, &mut || goes_on(case.run.duration_s));
            analysis.lyapunov = found.ok().flatten();
        }
        analysis
    }

    /// The same while `watch` sees the transient. A run that it ends has no driven motion.
    fn with_sensitivities(case: &Case, watch: &mut impl Observer) -> Option<Self> {
        let mut analysis = Self::watched(case, watch)?;
        if let Some(driven) = &mut analysis.driven {
            let case = case.without_hertz();
            driven.find_sensitivities(&case);
            driven.find_lyapunov(&case);
        }
        Some(analysis)
    }

    /// The same without sensitivities.
    #[must_use]
    pub fn watched(case: &Case, watch: &mut impl Observer) -> Option<Self> {
        if case.record.is_some() {
            return None;
        }
        // The derivative of the map is that of impacts that take no time; motion and energy are those of the same walls.
        let case = &case.without_hertz();
        let motion = Exact::new(&case.set_up, &case.excitation, &case.initial).ok()?;
        let mut meter = EnergyMeter::new(&case.set_up);
        let driven = match case.excitation {
            Excitation::Sine { angular_frequency_rad_per_s, .. }
            | Excitation::ForceSine { angular_frequency_rad_per_s, .. } => {
                ForcedResponse::of(case, motion, angular_frequency_rad_per_s, &mut meter, watch)
            }
            _ => {
                let mut motion = motion;
                motion.run(case.run.duration_s, &mut (&mut meter, watch));
                None
            }
        };
        Some(Self {
            walls: case.hertz_as_hard(),
            energy: Some(meter.balance()),
            driven,
            lyapunov: None,
            sensitivities: None,
            no_sensitivities: None,
        })
    }
}

impl ForcedResponse {
    /// Those of the orbit that the run is on.
    fn find_sensitivities(&mut self, case: &Case) {
        let is_on_it = self.orbit.as_ref().is_some_and(|orbit| orbit.is_run_on_it);
        let found = match &self.periodic_orbit {
            Some(orbit) if is_on_it => Sensitivities::of(case, orbit),
            Some(_) => Err("none: the run is not on a periodic orbit; a longer run may settle".into()),
            None if self.no_orbit.is_some() => Err("none: no periodic orbit was found".into()),
            None => Err("none: a periodic orbit is searched for under a moving base alone".into()),
        };
        match found {
            Ok(found) => self.sensitivities = Some(found),
            Err(why) => self.no_sensitivities = Some(why),
        }
    }

    /// How disturbances grow along a motion that is not periodic.
    fn find_lyapunov(&mut self, case: &Case) {
        let Some(start) = self.section.last().filter(|_| self.motion == MotionKind::NotPeriodic) else { return };
        let map = return_map(case, self.section_phase_rad, 1).ok();
        let found = map.map(|map| Lyapunov::of(&map, &start.state()));
        self.lyapunov = found.and_then(|found| found.ok().flatten());
    }

    fn of(
        case: &Case,
        motion: Exact,
        turning: f64,
        meter: &mut EnergyMeter,
        watch: &mut impl Observer,
    ) -> Option<Self> {
        let mut motion = motion;
        let Some(analysed) = AnalysedPeriods::of(case, turning) else {
            motion.run(case.run.duration_s, meter);
            return None;
        };
        motion.run(analysed.start_s, &mut (&mut *meter, &mut *watch));
        watch.goes_on(analysed.start_s).then(|| Self::at_end(case, motion, analysed, meter))
    }

    /// Of a case without Hertz walls, from its motion at the start of the analysed periods on; `meter` sees the rest of it.
    pub(crate) fn at_end(case: &Case, mut motion: Exact, analysed: AnalysedPeriods, meter: &mut impl Observer) -> Self {
        let AnalysedPeriods { turning, whole, periods, start_s } = analysed;
        let period_s = TAU / turning;
        let mut lock_in = FourierIntegral::new(turning);
        let mut last_cycles = LastCyclesMeter::new(period_s, case.run.duration_s);
        let mut shown = ExactObserver::new(&mut last_cycles);
        let mut section = Section::new(motion.clone(), period_s);
        let (mut states, mut maxima_m) = (Vec::new(), Vec::new());
        for _ in 0..periods {
            let mut response = Response::new(Wanted::default());
            states.push(section.next(&mut ((&mut *meter, &mut lock_in), (&mut response, &mut shown))));
            maxima_m.push(response.max_abs_x_m());
        }
        let mut repetition = Repetition::of(&states, &maxima_m, turning);
        let mut delayed_s = 0.0;
        // Rounding decides on which side of the section an impact falls, so a periodic motion is cut away from impacts.
        if let Some(delay_s) = delay_s(&motion, start_s, periods as f64 * period_s, period_s) {
            motion.run(start_s + delay_s, &mut ());
            let mut later = Section::new(motion, period_s);
            let later: Vec<ExactState> = (1..periods).map(|_| later.next(&mut ())).collect();
            let repeats = Repetition::of(&later, &maxima_m[1..], turning);
            if repeats.after.is_some_and(|after| repetition.after.is_none_or(|first| after <= first)) {
                (states, repetition, delayed_s) = (later, repeats, delay_s);
            }
        }
        let mut motion = section.into_motion();
        motion.run(case.run.duration_s, &mut (&mut *meter, &mut shown));
        let last_cycles = last_cycles.as_ref().and_then(LastCyclesMeter::last_cycles);
        // The summary's word on |x| is part of the verdict.
        let is_varying = last_cycles.is_some_and(|last| !last.is_steady());
        let repeats_after = repetition.after.filter(|after| *after > 1 || !is_varying);
        let (phase_of_drive, base_amplitude_m) = match case.excitation {
            Excitation::Sine { phase_rad, amplitude_m, .. } => (phase_rad, Some(amplitude_m)),
            Excitation::ForceSine { phase_rad, .. } => (phase_rad, None),
            _ => (0.0, None),
        };
        let phase = lock_in.phase_rad() - phase_of_drive;
        // A base at rest drives nothing: there is no orbit of the drive.
        let found = base_amplitude_m.filter(|amplitude_m| *amplitude_m > 0.0).map(|amplitude_m| {
            // The search for the orbit starts at drive phase 0.
            let mut there = Exact::clone(&motion);
            let mut late_s = (whole as f64 * period_s) + (TAU - phase_of_drive.rem_euclid(TAU)) / turning;
            if late_s < there.time_s() {
                late_s += period_s;
            }
            there.run(late_s, &mut ());
            let periods = u32::try_from(repeats_after.unwrap_or(1)).unwrap_or(1);
            PeriodicOrbit::near(&case.set_up, amplitude_m, turning, there.state(), periods)
        });
        let (orbit, no_orbit) = match found {
            Some(Ok(orbit)) => (Some(orbit), None),
            Some(Err(why)) => (None, Some(why.to_string())),
            None => (None, None),
        };
        let summary = orbit.as_ref().map(OrbitSummary::from);
        Self {
            periods,
            amplitude_m: lock_in.amplitude_m(),
            phase_rad: phase - TAU * (phase / TAU).round(),
            mean_cycle_max_abs_x_m: maxima_m.iter().sum::<f64>() / maxima_m.len() as f64,
            motion: MotionKind::of(repeats_after.is_some(), summary.as_ref()),
            tolerance: STEADY,
            cycle_maxima_spread: last_cycles.map(|last| last.spread),
            repeats_after,
            repeats_within: repetition.within,
            section_phase_rad: (phase_of_drive + turning * delayed_s).rem_euclid(TAU),
            section: states.iter().map(SectionState::from).collect(),
            two_impact_orbit: base_amplitude_m.and_then(|z| SymmetricOrbit::new(&case.set_up, z, turning)).map(|o| {
                TwoImpactOrbit {
                    particle_speed_m_per_s: o.particle_speed_m_per_s,
                    approach_speed_m_per_s: o.approach_speed_m_per_s,
                    impact_displacement_m: o.impact_displacement_m,
                }
            }),
            orbit: summary,
            no_orbit,
            lyapunov: None,
            periodic_orbit: orbit,
            sensitivities: None,
            no_sensitivities: None,
        }
    }
}
