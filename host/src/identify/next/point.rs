//! A point of a stepped sine on a set-up: its X/Z with exact derivatives, and why it may be no candidate.

use std::f64::consts::TAU;

use damprig_continuation::{Parameter, ReturnMap};
use damprig_core::integrator::exact::Exact;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::model::Initial;
use nalgebra::DVector;

use super::set_ups::{IdentifiedParameter, MeasurableSetUp, sine};
use crate::simulation::analysis::{OrbitSummary, PeriodicOrbit, Stability};

/// Time of a motion from rest before it is looked at, in time constants 1/(ζω) of the structure: e⁻¹² of the free vibration is left.
const SETTLED: f64 = 12.0;

/// The fewest and the most cycles of it.
const CYCLES: [f64; 2] = [100.0, 5000.0];

/// Why a point is no candidate.
const NOT_PERIODIC: &str = "the motion from rest does not end on a stable motion of the drive's period";
const NO_DERIVATIVE: &str =
    "the motion has no derivative there (grazing, a bifurcation, a particle that may be anywhere)";
const EVENTS_CHANGE: &str = "a change of a parameter by its standard uncertainty adds or removes an impact or a stick";
const BEYOND_LIMIT: &str = "|x| would leave the displacement limit";
const NOT_SETTLED: &str = "a neighbouring point of the run did not settle: the same dwell would not do";

/// X/Z of a settled point, with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct SettledPoint {
    /// Largest |x| of the periodic motion over Z.
    pub x_over_z: f64,
    /// Largest |x| from rest on, m.
    pub max_abs_x_m: f64,
    /// ∂ln(X/Z)/∂p of each parameter, per unit of its key.
    pub by_parameters: Vec<f64>,
    /// Relative change of each parameter within which, to first order, the motion has the same events.
    pub holds_within: Vec<f64>,
}

/// A point that may be measured.
#[derive(Clone, Debug, PartialEq)]
pub struct CandidatePoint {
    /// Place of its set-up.
    pub set_up: usize,
    /// Drive frequency, Hz.
    pub frequency_hz: f64,
    /// X/Z as the identified values predict it.
    pub x_over_z: f64,
    /// Relative standard uncertainty of its X/Z.
    pub relative_uncertainty: f64,
    /// Change of ln(X/Z) by one standard uncertainty of each parameter, then of the sensors' scale.
    pub changes: DVector<f64>,
}

impl MeasurableSetUp {
    /// A point, started from rest, with its derivatives by parameters.
    ///
    /// # Errors
    /// Why it cannot be used.
    pub fn point(&self, frequency_hz: f64, parameters: &[Parameter]) -> Result<SettledPoint, &'static str> {
        let (set_up, amplitude_m) = (&self.model, self.base_amplitude_m);
        let turning = TAU * frequency_hz;
        let rate = set_up.structure.damping_ratio() * set_up.structure.angular_frequency_rad_per_s();
        let cycles = (SETTLED / rate * frequency_hz).ceil().clamp(CYCLES[0], CYCLES[1]);
        let [low_m, high_m] = set_up.particle.map_or([0.0; 2], |particle| particle.ends_m());
        let initial = Initial { y_m: self.start_m.clamp(low_m, high_m), ..Initial::default() };
        let mut motion = Exact::new(set_up, &sine(amplitude_m, turning, 0.0), &initial).map_err(|_| NOT_PERIODIC)?;
        let mut seen = Response::new(Wanted::default());
        motion.run(cycles / frequency_hz, &mut seen);
        let orbit = PeriodicOrbit::near(set_up, amplitude_m, turning, motion.state(), 1).map_err(|_| NOT_PERIODIC)?;
        if !OrbitSummary::from(&orbit).is_run_on_it || orbit.stability() == Stability::Unstable {
            return Err(NOT_PERIODIC);
        }
        let map = ReturnMap::new(set_up, &sine(amplitude_m, turning, orbit.section_phase_rad), 1);
        let found = map.ok().and_then(|map| orbit.derivatives(&map, parameters).ok()).ok_or(NO_DERIVATIVE)?;
        let x = &found.largest_abs_x_m;
        if x.is_tie {
            return Err(NO_DERIVATIVE);
        }
        Ok(SettledPoint {
            x_over_z: x.of.value / amplitude_m,
            max_abs_x_m: seen.max_abs_x_m(),
            by_parameters: x.of.by_parameters.iter().map(|by| by / x.of.value).collect(),
            holds_within: found.holds_within,
        })
    }

    /// A point as a candidate. `scale`: relative standard uncertainty of X/Z by the sensors' scale; `limit_m`: largest |x|.
    ///
    /// # Errors
    /// Why it is none.
    pub fn candidate(
        &self,
        (set_up, frequency_hz): (usize, f64),
        all: &[IdentifiedParameter],
        scale: f64,
        limit_m: f64,
    ) -> Result<CandidatePoint, &'static str> {
        // Of a frequency that was measured several times the last point counts.
        let below = self.measured.iter().filter(|(hz, _)| *hz <= frequency_hz).max_by(|a, b| a.0.total_cmp(&b.0));
        let above = self.measured.iter().rev().filter(|(hz, _)| *hz >= frequency_hz).min_by(|a, b| a.0.total_cmp(&b.0));
        let uncertainties = [below, above].into_iter().flatten().map(|(_, uncertainty)| uncertainty.ok_or(NOT_SETTLED));
        let relative_uncertainty = uncertainties.collect::<Result<Vec<_>, _>>()?.into_iter().fold(0.0, f64::max);
        let parameters: Vec<Parameter> = self.own.iter().map(|n| all[*n].parameter).collect();
        let settled = self.point(frequency_hz, &parameters)?;
        if settled.max_abs_x_m > limit_m {
            return Err(BEYOND_LIMIT);
        }
        let mut changes = DVector::zeros(all.len() + 1);
        changes[all.len()] = scale;
        for (place, n) in self.own.iter().enumerate() {
            let IdentifiedParameter { value, standard_uncertainty, .. } = all[*n];
            if standard_uncertainty > settled.holds_within[place] * value.abs() {
                return Err(EVENTS_CHANGE);
            }
            changes[*n] = settled.by_parameters[place] * standard_uncertainty;
        }
        Ok(CandidatePoint { set_up, frequency_hz, x_over_z: settled.x_over_z, relative_uncertainty, changes })
    }
}
