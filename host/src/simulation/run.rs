//! A case put into motion: samples, impacts and figures, stopped in good order by Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};

use damprig_core::integrator::exact::flow::State;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Arc, Exact, Impact, Observer};
use damprig_core::model::Invalid;
use serde::Serialize;

use super::Case;

/// Impacts kept in an answer; the count goes on.
const MOST_IMPACTS: usize = 1_000_000;

/// Parts of a run between two looks at the stop flag.
const PARTS: u64 = 2_000;

/// The answer to a case, as `--json` prints it.
#[derive(Clone, Debug, Serialize)]
pub struct Answer {
    /// x at the sample times, m.
    pub x_m: Vec<f64>,
    /// x′, m/s.
    pub v_m_per_s: Vec<f64>,
    /// y of particle or tuned mass, m; without one the structure's own.
    pub y_m: Vec<f64>,
    /// y′, m/s.
    pub u_m_per_s: Vec<f64>,
    /// Impacts, at most a million.
    pub impacts: Vec<ImpactRecord>,
    /// The figures.
    pub summary: Summary,
}

/// One impact, or the first touch of a soft wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImpactRecord {
    /// When, s.
    pub t_s: f64,
    /// +1 where y − x = +d.
    pub side: i8,
    /// |x′ − y′| just before, m/s.
    pub approach_speed_m_per_s: f64,
}

/// The figures of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// How far the run came, s: its duration unless it was interrupted.
    pub simulated_s: f64,
    /// √(1/T ∫x² dt), m.
    pub rms_x_m: f64,
    /// Largest |x|, m.
    pub max_abs_x_m: f64,
    /// Largest |x − z|, m.
    pub max_abs_x_minus_z_m: f64,
    /// Impacts; those of a chatter that was summed are not counted.
    pub impact_count: u64,
    /// Largest |x| from the first steady cycle on, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steady_max_abs_x_m: Option<f64>,
    /// Mean over the steady cycles of their largest |x|, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steady_mean_cycle_max_abs_x_m: Option<f64>,
    /// Largest force of a soft wall, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_contact_force_n: Option<f64>,
    /// Length of the first contact with a soft wall, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_contact_duration_s: Option<f64>,
    /// Separation speed over approach speed of that contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_contact_restitution: Option<f64>,
}

/// The states at given instants, taken from the arcs: asking for them changes nothing in the motion.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    times_s: Vec<f64>,
    /// The states so far, in the order of the times.
    pub states: Vec<State>,
}

impl Samples {
    /// Wants the states at `times_s`, in rising order.
    #[must_use]
    pub fn at(times_s: Vec<f64>) -> Self {
        Self { states: Vec::with_capacity(times_s.len()), times_s }
    }

    fn fill(&mut self, state: State) {
        self.states.resize(self.times_s.len(), state);
    }
}

impl Observer for Samples {
    fn arc(&mut self, arc: &Arc<'_>) {
        while let Some(time_s) = self.times_s.get(self.states.len()) {
            let after_s = time_s - arc.start_s;
            if after_s > arc.length_s {
                break;
            }
            self.states.push(arc.state(after_s.max(0.0)));
        }
    }
}

#[derive(Default)]
struct Impacts(Vec<ImpactRecord>);

impl Observer for Impacts {
    const ARCS: bool = false;

    fn impact(&mut self, impact: &Impact) {
        if self.0.len() < MOST_IMPACTS {
            self.0.push(ImpactRecord {
                t_s: impact.time_s,
                side: impact.side,
                approach_speed_m_per_s: impact.approach_speed_m_per_s,
            });
        }
    }
}

/// Runs a case; `also` sees the motion too. A raised `stop` ends it early with what was done so far.
///
/// # Errors
/// Names a value that is not physical.
pub fn simulate<O: Observer>(case: &Case, also: &mut O, stop: &AtomicBool) -> Result<Answer, Invalid> {
    let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial)?;
    let wanted = Wanted { cycle_s: case.run.cycle_s, steady_from_cycle: case.run.steady_from_cycle, whole_run: true };
    let mut seen = (Response::new(wanted), (Samples::at(case.run.sample_times_s.clone()), (Impacts::default(), also)));
    let duration_s = case.run.duration_s;
    for part in 1..=PARTS {
        let until_s = if part == PARTS { duration_s } else { duration_s * part as f64 / PARTS as f64 };
        motion.run(until_s, &mut seen);
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    let (mut response, (mut samples, (impacts, _))) = seen;
    response.finish(motion.time_s());
    if motion.time_s() >= duration_s {
        // A sample asked for a rounding after the end is the end.
        samples.fill(*motion.state());
    }
    let steady = response.steady_m();
    let contact = if response.peak_contact_force_n().is_some() { response.first_contact() } else { None };
    let column = |value: fn(&State) -> f64| samples.states.iter().map(value).collect();
    Ok(Answer {
        x_m: column(|s| s.x_m),
        v_m_per_s: column(|s| s.v_m_per_s),
        y_m: column(State::y_m),
        u_m_per_s: column(State::u_m_per_s),
        impacts: impacts.0,
        summary: Summary {
            simulated_s: motion.time_s(),
            rms_x_m: response.rms_x_m(),
            max_abs_x_m: response.max_abs_x_m(),
            max_abs_x_minus_z_m: response.max_abs_x_minus_z_m(),
            impact_count: response.impact_count(),
            steady_max_abs_x_m: steady.map(|s| s.0),
            steady_mean_cycle_max_abs_x_m: steady.map(|s| s.1),
            peak_contact_force_n: response.peak_contact_force_n(),
            first_contact_duration_s: contact.map(|c| c.0),
            first_contact_restitution: contact.map(|c| c.1),
        },
    })
}
