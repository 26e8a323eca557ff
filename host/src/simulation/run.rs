//! A case put into motion: samples, impacts and figures, stopped in good order when asked to.

use damprig_core::integrator::exact::flow::ExactState;
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{self, Exact};
use damprig_core::io::Invalid;
use serde::Serialize;

use super::Case;
use super::figures::{Ending, Trend};
use super::motion::{AccumulationRecord, ImpactRecord, Samples, Shown, Viewer};
use super::playback;

/// Impacts, and accumulations, kept in an answer; the counts go on.
pub const MOST_IMPACTS: usize = 1_000_000;

/// Accumulations kept in an answer that keeps no impacts: enough for a line of text.
pub const FEW_ACCUMULATIONS: usize = 8;

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
    /// The first million impacts.
    pub impacts: Vec<ImpactRecord>,
    /// The first million accumulations: chatters that ended in a particle resting on a wall. The impacts of their tails
    /// are summed, neither listed nor counted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub accumulations: Vec<AccumulationRecord>,
    /// The figures.
    pub summary: Summary,
    /// Where it was stopped before its end, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped_at_s: Option<f64>,
    /// The last twenty cycles, if it came to its end and has so many.
    #[serde(skip)]
    pub ending: Option<Ending>,
}

/// The figures of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// How far the run came, s: its duration unless it was stopped.
    pub simulated_s: f64,
    /// √(1/T ∫x² dt), m.
    pub rms_x_m: f64,
    /// √(1/T ∫(x − z)² dt) on a record, whose base may drift, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_x_minus_z_m: Option<f64>,
    /// Largest |x|, m.
    pub max_abs_x_m: f64,
    /// Largest |x − z|, m.
    pub max_abs_x_minus_z_m: f64,
    /// Impacts; those of a chatter's tail that was summed are not counted.
    pub impact_count: u64,
    /// Chatters that ended in a particle resting on a wall, their tails summed.
    #[serde(skip_serializing_if = "is_zero")]
    pub accumulation_count: u64,
    /// Largest |x| from the first steady cycle on, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steady_max_abs_x_m: Option<f64>,
    /// Mean over the steady cycles of their largest |x|, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steady_mean_cycle_max_abs_x_m: Option<f64>,
    /// How often events were so many at one instant, or in one step of a record, that the search for them was given up.
    #[serde(skip_serializing_if = "is_zero")]
    pub unresolved: u32,
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

#[allow(clippy::trivially_copy_pass_by_ref)] // As serde calls it.
fn is_zero<N: Copy + Into<u64>>(count: &N) -> bool {
    (*count).into() == 0
}

/// Impacts and accumulations as they came: at most [`MOST_IMPACTS`] of each, and no impacts unless they are kept.
#[derive(Debug, Default)]
struct Impacts {
    kept: Option<Vec<ImpactRecord>>,
    accumulations: Vec<AccumulationRecord>,
}

impl Viewer for Impacts {
    fn wants_pieces(&self) -> bool {
        false
    }

    fn impact(&mut self, impact: &ImpactRecord) {
        if let Some(kept) = self.kept.as_mut().filter(|kept| kept.len() < MOST_IMPACTS) {
            kept.push(*impact);
        }
    }

    fn accumulation(&mut self, accumulation: &AccumulationRecord) {
        let most = if self.kept.is_some() { MOST_IMPACTS } else { FEW_ACCUMULATIONS };
        if self.accumulations.len() < most {
            self.accumulations.push(*accumulation);
        }
    }
}

/// What a run is asked for besides its figures.
pub struct Request<'a> {
    /// Keep the impacts and the states at the case's sample times: memory grows with them.
    pub keep: bool,
    /// Longest stretch between two calls of `go_on`, s.
    pub longest_part_s: f64,
    /// Called with the instant reached, s, after each part and each few thousand arcs inside one; `false`, which must
    /// stay so, ends the run there.
    pub go_on: &'a mut dyn FnMut(f64) -> bool,
}

/// What every run gathers.
pub(super) struct Gathered<'v, V> {
    pub samples: Samples,
    impacts: Impacts,
    pub trend: Option<Trend>,
    pub also: &'v mut V,
}

impl<'v, V: Viewer> Gathered<'v, V> {
    fn new(case: &Case, keep: bool, also: &'v mut V) -> Self {
        Self {
            samples: Samples::at(if keep { case.run.sample_times_s.clone() } else { Vec::new() }),
            impacts: Impacts { kept: keep.then(Vec::new), accumulations: Vec::new() },
            trend: Trend::new(case.cycle_s(), case.run.duration_s),
            also,
        }
    }

    /// All of it as one viewer.
    pub fn viewer(&mut self) -> impl Viewer {
        ((&mut self.samples, &mut self.impacts), (&mut self.trend, &mut *self.also))
    }
}

/// Runs a case; `also` sees the motion too.
///
/// # Errors
/// Names a value that is not physical.
pub fn simulate<V: Viewer>(case: &Case, also: &mut V, request: Request) -> Result<Answer, Invalid> {
    let mut gathered = Gathered::new(case, request.keep, also);
    let wanted = Wanted { cycle_s: case.run.cycle_s, steady_from_cycle: case.run.steady_from_cycle, whole_run: true };
    let (summary, end) = match &case.record {
        Some(record) => playback::run(case, record, wanted, &mut gathered, request)?,
        None => closed_form(case, wanted, &mut gathered, request)?,
    };
    let is_whole = summary.simulated_s >= case.run.duration_s;
    if is_whole {
        gathered.samples.fill(end);
    }
    let states = &gathered.samples.states;
    let column = |value: fn(&ExactState) -> f64| states.iter().map(value).collect();
    Ok(Answer {
        x_m: column(|s| s.x_m),
        v_m_per_s: column(|s| s.v_m_per_s),
        y_m: column(ExactState::y_m),
        u_m_per_s: column(ExactState::u_m_per_s),
        impacts: gathered.impacts.kept.take().unwrap_or_default(),
        accumulations: std::mem::take(&mut gathered.impacts.accumulations),
        stopped_at_s: (!is_whole).then_some(summary.simulated_s),
        ending: gathered.trend.as_ref().filter(|_| is_whole).and_then(Trend::ending),
        summary,
    })
}

/// Arcs between two looks up from the work.
const ARCS_A_LOOK: u32 = 4_096;

/// Ends a part from inside, however many events are crowded into it.
struct Watch<'a> {
    arcs: u32,
    is_over: bool,
    go_on: &'a mut dyn FnMut(f64) -> bool,
}

impl exact::Observer for Watch<'_> {
    const ARCS: bool = false;

    fn goes_on(&mut self, time_s: f64) -> bool {
        self.arcs += 1;
        if self.arcs >= ARCS_A_LOOK && !self.is_over {
            self.arcs = 0;
            self.is_over = !(self.go_on)(time_s);
        }
        !self.is_over
    }
}

/// By the exact driver.
fn closed_form<V: Viewer>(
    case: &Case,
    wanted: Wanted,
    gathered: &mut Gathered<'_, V>,
    request: Request,
) -> Result<(Summary, ExactState), Invalid> {
    let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial)?;
    let mut response = Response::new(wanted);
    parts(case.run.duration_s, request, gathered, |until_s, gathered, go_on| {
        let watch = Watch { arcs: 0, is_over: false, go_on };
        motion.run(until_s, &mut ((&mut response, Shown(gathered.viewer())), watch));
        motion.time_s()
    });
    response.finish(motion.time_s());
    let steady = response.steady_m();
    let contact = if response.peak_contact_force_n().is_some() { response.first_contact() } else { None };
    let summary = Summary {
        simulated_s: motion.time_s(),
        rms_x_m: response.rms_x_m(),
        rms_x_minus_z_m: None,
        max_abs_x_m: response.max_abs_x_m(),
        max_abs_x_minus_z_m: response.max_abs_x_minus_z_m(),
        impact_count: response.impact_count(),
        accumulation_count: response.accumulation_count(),
        steady_max_abs_x_m: steady.map(|s| s.0),
        steady_mean_cycle_max_abs_x_m: steady.map(|s| s.1),
        unresolved: motion.unresolved(),
        peak_contact_force_n: response.peak_contact_force_n(),
        first_contact_duration_s: contact.map(|c| c.0),
        first_contact_restitution: contact.map(|c| c.1),
    };
    Ok((summary, *motion.state()))
}

/// Advances part by part to the end, or until somebody has had enough.
pub(super) fn parts<V: Viewer>(
    duration_s: f64,
    request: Request,
    gathered: &mut Gathered<'_, V>,
    mut advance: impl FnMut(f64, &mut Gathered<'_, V>, &mut dyn FnMut(f64) -> bool) -> f64,
) {
    let count = (duration_s / request.longest_part_s).ceil().max(1.0);
    let mut part = 0.0;
    while part < count {
        part += 1.0;
        let until_s = if part >= count { duration_s } else { duration_s * (part / count) };
        let reached_s = advance(until_s, gathered, request.go_on);
        if gathered.also.is_done() || (part < count && !(request.go_on)(reached_s)) {
            return;
        }
    }
}
