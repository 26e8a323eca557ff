//! Analyses a simulated case (`damprig simulate --analyse`): energy balance, lock-in, period, orbit and stability.

use std::f64::consts::TAU;

use damprig_core::analysis::energy::{Balance, EnergyMeter};
use damprig_core::analysis::lock_in::LockIn;
use damprig_core::analysis::section::{Section, period};
use damprig_core::analysis::symmetric_orbit::SymmetricOrbit;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, ExactState, Excitation, Impact, Observer};
use serde::Serialize;

use super::periodic_orbit::{PeriodicOrbit, Stability};
use crate::simulation::Case;

/// Most drive periods at the end of the run that are analysed.
const ANALYSED_PERIODS: u64 = 64;

/// Relative difference below which two states of a section count as equal.
const SAME: f64 = 1e-6;

/// Least distance of the section from an impact, as a fraction of the drive period: a small shift of an impact must not
/// move it across the section.
const CLEAR_OF_IMPACTS: f64 = 1e-3;

/// Analysis of a case.
#[derive(Clone, Debug, Serialize)]
pub struct Analysis {
    /// Energy balance of the whole run.
    pub energy: Energy,
    /// Response to a sinusoidal excitation; `None` for others.
    pub driven: Option<ForcedResponse>,
}

/// Energy by mechanism over the whole run, J.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Energy {
    /// Work of the base or the force.
    pub input_j: f64,
    /// Kinetic and elastic energy at the end minus that at the start.
    pub stored_j: f64,
    /// Dissipated by the structure's dashpot.
    pub structure_damping_j: f64,
    /// Dissipated by impacts on hard walls.
    pub impacts_j: f64,
    /// Dissipated by friction between particle and structure.
    pub internal_friction_j: f64,
    /// Dissipated by the friction damper.
    pub friction_damper_j: f64,
    /// Dissipated by the dashpot of a soft wall or tuned mass.
    pub link_damping_j: f64,
    /// Residual of the balance: rounding.
    pub residual_j: f64,
}

impl From<Balance> for Energy {
    fn from(b: Balance) -> Self {
        Self {
            input_j: b.input_j,
            stored_j: b.stored_j,
            structure_damping_j: b.structure_damping_j,
            impacts_j: b.impacts_j,
            internal_friction_j: b.internal_friction_j,
            friction_damper_j: b.friction_damper_j,
            link_damping_j: b.link_damping_j,
            residual_j: b.residual_j(),
        }
    }
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
    /// Drive periods after which the section repeats within 1e-6; `None` if it does not.
    pub repeats_after: Option<usize>,
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

impl Analysis {
    /// Analyses a case with an excitation in closed form; `None` for a recorded base motion.
    #[must_use]
    pub fn of(case: &Case) -> Option<Self> {
        if case.record.is_some() {
            return None;
        }
        let motion = Exact::new(&case.set_up, &case.excitation, &case.initial).ok()?;
        let mut meter = EnergyMeter::new(&case.set_up);
        let driven = match case.excitation {
            Excitation::Sine { angular_frequency_rad_per_s, .. }
            | Excitation::ForceSine { angular_frequency_rad_per_s, .. } => {
                ForcedResponse::of(case, motion, angular_frequency_rad_per_s, &mut meter)
            }
            _ => {
                let mut motion = motion;
                motion.run(case.run.duration_s, &mut meter);
                None
            }
        };
        Some(Self { energy: meter.balance().into(), driven })
    }
}

impl ForcedResponse {
    fn of(case: &Case, motion: Exact, turning: f64, meter: &mut EnergyMeter) -> Option<Self> {
        let period_s = TAU / turning;
        let whole = (case.run.duration_s / period_s * (1.0 + 1e-12)).floor() as u64;
        let mut motion = motion;
        if whole == 0 {
            motion.run(case.run.duration_s, meter);
            return None;
        }
        let periods = ANALYSED_PERIODS.min(whole.div_ceil(2));
        let start_s = (whole - periods) as f64 * period_s;
        motion.run(start_s, meter);
        let mut lock_in = LockIn::new(turning);
        let mut response = Response::new(Wanted {
            cycle_s: Some(period_s),
            steady_from_cycle: Some(whole - periods),
            ..Wanted::default()
        });
        response.skip_to(whole - periods);
        let mut section = Section::new(motion.clone(), period_s);
        let mut states: Vec<ExactState> =
            (0..periods).map(|_| section.next(&mut (&mut *meter, (&mut lock_in, &mut response)))).collect();
        response.finish(whole as f64 * period_s);
        let mut repeats_after = period(&states, SAME);
        let mut delayed_s = 0.0;
        // Rounding decides on which side of the section an impact falls, so a periodic motion is cut away from impacts.
        if let Some(delay_s) = delay_s(&motion, start_s, periods as f64 * period_s, period_s) {
            motion.run(start_s + delay_s, &mut ());
            let mut later = Section::new(motion, period_s);
            let later: Vec<ExactState> = (1..periods).map(|_| later.next(&mut ())).collect();
            if let Some(repeats) = period(&later, SAME) {
                (states, repeats_after, delayed_s) = (later, Some(repeats), delay_s);
            }
        }
        let mut motion = section.into_motion();
        motion.run(case.run.duration_s, meter);
        let (phase_of_drive, base_amplitude_m) = match case.excitation {
            Excitation::Sine { phase_rad, amplitude_m, .. } => (phase_rad, Some(amplitude_m)),
            Excitation::ForceSine { phase_rad, .. } => (phase_rad, None),
            _ => (0.0, None),
        };
        let phase = lock_in.phase_rad() - phase_of_drive;
        let found = base_amplitude_m.map(|amplitude_m| {
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
            Some(Ok(orbit)) => (Some(OrbitSummary::from(&orbit)), None),
            Some(Err(why)) => (None, Some(why.to_string())),
            None => (None, None),
        };
        Some(Self {
            periods,
            amplitude_m: lock_in.amplitude_m(),
            phase_rad: phase - TAU * (phase / TAU).round(),
            mean_cycle_max_abs_x_m: response.steady_m().map_or(0.0, |(_, mean)| mean),
            repeats_after,
            section_phase_rad: (phase_of_drive + turning * delayed_s).rem_euclid(TAU),
            section: states.iter().map(SectionState::from).collect(),
            two_impact_orbit: base_amplitude_m.and_then(|z| SymmetricOrbit::new(&case.set_up, z, turning)).map(|o| {
                TwoImpactOrbit {
                    particle_speed_m_per_s: o.particle_speed_m_per_s,
                    approach_speed_m_per_s: o.approach_speed_m_per_s,
                    impact_displacement_m: o.impact_displacement_m,
                }
            }),
            orbit,
            no_orbit,
        })
    }
}
