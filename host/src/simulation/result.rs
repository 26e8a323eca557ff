//! The result of a simulated case: states, impacts and summary, as `damprig simulate --json` prints them.

use damprig_core::integrator::exact::response::Response;
use serde::{Deserialize, Serialize};

use super::Case;
use super::many_particles::SpheresResult;
use super::motion::{AccumulationRecord, ContactRecord, ImpactRecord};
use super::multi_degree::measure::PlacesResult;
use super::statistics::LastCycles;
use super::wall_force;
use crate::motion_record::Record;

/// The result of a case.
#[derive(Clone, Debug, Serialize)]
pub struct SimulationResult {
    /// x at the sample times, m.
    pub x_m: Vec<f64>,
    /// x′ at the sample times, m/s.
    pub v_m_per_s: Vec<f64>,
    /// y of the particle or tuned mass at the sample times, m; equal to x without a second mass.
    pub y_m: Vec<f64>,
    /// y′ at the sample times, m/s.
    pub u_m_per_s: Vec<f64>,
    /// The first million impacts.
    pub impacts: Vec<ImpactRecord>,
    /// The first million contacts with Hertz walls that have ended.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<ContactRecord>,
    /// The first million accumulations. The impacts of their tails are summed, neither listed nor counted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub accumulations: Vec<AccumulationRecord>,
    /// Statistics of the whole run.
    pub summary: Summary,
    /// What only a many-particle damper has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub many_particles: Option<SpheresResult>,
    /// What a structure with several places has besides.
    #[serde(flatten)]
    pub multi_degree: Option<PlacesResult>,
    /// Where the run was stopped before its end, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped_at_s: Option<f64>,
    /// The last twenty cycles of a run that reached its end and has as many.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_cycles: Option<LastCycles>,
}

/// Statistics of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Summary {
    /// Simulated time, s: the duration of the case unless the run was stopped.
    pub simulated_s: f64,
    /// √(1/T ∫x² dt), m.
    pub rms_x_m: f64,
    /// √(1/T ∫(x − z)² dt) under a recorded base motion, whose base may drift, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_x_minus_z_m: Option<f64>,
    /// Largest |x|, m.
    pub max_abs_x_m: f64,
    /// Largest |x − z|, m.
    pub max_abs_x_minus_z_m: f64,
    /// Impacts, without those of the tails that accumulations sum.
    pub impact_count: u64,
    /// Accumulations: chatters that ended with the particle at rest on a wall.
    #[serde(skip_serializing_if = "is_zero")]
    pub accumulation_count: u64,
    /// Largest |x| from the first steady cycle on, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steady_max_abs_x_m: Option<f64>,
    /// Mean over the steady cycles of their largest |x|, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steady_mean_cycle_max_abs_x_m: Option<f64>,
    /// How often the event search was given up because too many events fell on one instant or one step of a record.
    #[serde(skip_serializing_if = "is_zero")]
    pub unresolved: u32,
    /// How far the particle is beyond a soft wall that it has passed, at the end, m ([`Exact::passed_wall_by_m`](damprig_core::integrator::exact::Exact::passed_wall_by_m)).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passed_wall_by_m: Option<f64>,
    /// Velocity with which a displacement record starts, m/s: the jump from rest is smoothed over its first interval, which
    /// changes the first moments of the motion. Absent if it starts at rest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub record_start_jump_m_per_s: Option<f64>,
    /// Largest force of a wall, N: of a soft wall, or of a hard one by its stated contact. Absent if a hard wall's contact is not stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_contact_force_n: Option<f64>,
    /// Mean power in the loads of piezoelectric walls, W: over the last 20 cycles of a sine, otherwise over the run; of a study over what it counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub harvested_power_w: Option<f64>,
    /// Duration of the first contact with a soft wall, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_contact_duration_s: Option<f64>,
    /// Separation speed over approach speed of that contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_contact_restitution: Option<f64>,
    /// Of the contacts with Hertz walls.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contacts: Option<ContactFigures>,
}

/// Figures of all contacts with Hertz walls that have ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactFigures {
    /// Their number.
    pub count: u64,
    /// Shortest duration, s.
    pub shortest_s: f64,
    /// Longest duration, s.
    pub longest_s: f64,
    /// Sum of the durations, s.
    pub total_s: f64,
    /// Mean approach speed, m/s.
    pub mean_approach_speed_m_per_s: f64,
}

impl ContactFigures {
    /// Takes another contact.
    pub fn add(&mut self, contact: &ContactRecord) {
        let first = self.count == 0;
        self.count += 1;
        self.shortest_s = if first { contact.duration_s } else { self.shortest_s.min(contact.duration_s) };
        self.longest_s = self.longest_s.max(contact.duration_s);
        self.total_s += contact.duration_s;
        let off = contact.approach_speed_m_per_s - self.mean_approach_speed_m_per_s;
        self.mean_approach_speed_m_per_s += off / self.count as f64;
    }
}

impl Summary {
    /// The summary of a run of the case over `simulated_s`, whose event search was given up `unresolved` times.
    #[must_use]
    pub fn of(case: &Case, response: &Response, simulated_s: f64, unresolved: u32) -> Self {
        let steady = response.steady_m();
        let contact = response.first_contact();
        Self {
            simulated_s,
            rms_x_m: response.rms_x_m(),
            rms_x_minus_z_m: case.record.as_ref().map(|_| response.rms_x_minus_z_m()),
            max_abs_x_m: response.max_abs_x_m(),
            max_abs_x_minus_z_m: response.max_abs_x_minus_z_m(),
            impact_count: response.impact_count(),
            accumulation_count: response.accumulation_count(),
            steady_max_abs_x_m: steady.map(|s| s.0),
            steady_mean_cycle_max_abs_x_m: steady.map(|s| s.1),
            unresolved,
            passed_wall_by_m: None,
            record_start_jump_m_per_s: case.record.as_ref().and_then(Record::start_jump_m_per_s),
            peak_contact_force_n: wall_force::largest_n(case, response),
            harvested_power_w: None,
            first_contact_duration_s: contact.map(|c| c.0),
            first_contact_restitution: contact.map(|c| c.1),
            contacts: None,
        }
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde passes a reference.
fn is_zero<N: Copy + Into<u64>>(count: &N) -> bool {
    (*count).into() == 0
}
