//! Simulates cases and gives their metrics: many at once in vector lanes where the case allows it, one by one otherwise.

use damprig_batch::{Point, Stop};
use damprig_core::integrator::exact::response::{Response, Wanted};
use damprig_core::integrator::exact::{Exact, Excitation};
use damprig_core::model::Wall;
use damprig_particles::Damper;

use super::metric::{self, Figures, Periodicity};
use crate::input::Refusal;
use crate::quantity::Quantity;
use crate::simulation::{Case, RunOptions, cost, many_particles, simulate};

/// Asked now and then, also inside a simulation, whether to go on.
pub type GoOn<'a> = &'a (dyn Fn() -> bool + Sync);

/// Why simulations gave nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Halt {
    /// A case is refused.
    Refused(Refusal),
    /// They were stopped.
    Stopped,
}

impl From<Refusal> for Halt {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

impl Halt {
    /// A result, or `None` if it was stopped.
    ///
    /// # Errors
    /// The refusal of a case.
    pub fn unless_stopped<T>(result: Result<T, Self>) -> Result<Option<T>, Refusal> {
        match result {
            Ok(value) => Ok(Some(value)),
            Err(Self::Stopped) => Ok(None),
            Err(Self::Refused(refusal)) => Err(refusal),
        }
    }
}

/// What is counted of each simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Counted cycles, or else
    pub cycles: Option<f64>,
    /// counted time, s.
    pub duration_s: Option<f64>,
    /// Cycles simulated before.
    pub settle_cycles: f64,
    /// Time simulated before, s; rounded up to whole cycles.
    pub settle_s: f64,
}

/// The counted part of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Counted {
    /// Length of a cycle, s.
    pub cycle_s: f64,
    /// First counted cycle.
    pub first_cycle: f64,
    /// End of the simulation, s.
    pub end_s: f64,
}

impl Counted {
    pub fn of(case: &Case, record: Option<Record>) -> Self {
        let cycle_s = case.cycle_s();
        let Some(record) = record else {
            let first_cycle = case.run.steady_from_cycle.unwrap_or(0) as f64;
            return Self { cycle_s, first_cycle, end_s: case.run.duration_s };
        };
        let first_cycle = record.settle_cycles.max((record.settle_s / cycle_s - 1e-9).ceil());
        let length_s = record.cycles.map_or(record.duration_s.unwrap_or(0.0), |cycles| cycles * cycle_s);
        // A whole number of cycles ends on a cycle.
        let end_s = match record.cycles {
            Some(cycles) => (first_cycle + cycles) * cycle_s,
            None => first_cycle * cycle_s + length_s,
        };
        Self { cycle_s, first_cycle, end_s }
    }

    /// The number of counted cycles, with their fraction.
    pub fn cycles(&self) -> f64 {
        self.end_s / self.cycle_s - self.first_cycle
    }

    /// Whether the simulation ends with a cycle.
    pub fn is_whole(&self) -> bool {
        let cycles = self.end_s / self.cycle_s;
        (cycles - cycles.round()).abs() < 1e-9
    }
}

/// The metrics of a case, and how often the event search was given up.
pub type Simulated = (Vec<f64>, f64);

/// Simulates cases: their metrics, in their order.
///
/// # Errors
/// A case that the integrator refuses, or that `go_on` said no.
pub fn metrics_of_all(
    cases: &[Case],
    record: Option<Record>,
    metrics: &[Quantity],
    go_on: GoOn,
) -> Result<Vec<Simulated>, Halt> {
    let lanes: Vec<Option<Point>> = cases.iter().map(|case| point(case, record, metrics)).collect();
    let points: Vec<Point> = lanes.iter().copied().flatten().collect();
    let outcomes = damprig_batch::simulate_while(&points, go_on)
        .map_err(|invalid| Refusal(invalid.invalid.to_string()))?
        .ok_or(Halt::Stopped)?;
    let mut outcomes = outcomes.into_iter();
    let simulated = |(case, lane): (&Case, &Option<Point>)| match lane.and_then(|_| outcomes.next()) {
        Some(outcome) => {
            let counted = Counted::of(case, record);
            let figures = Figures {
                mean_cycle_max_m: outcome.steady_mean_m.unwrap_or(f64::NAN),
                largest_cycle_max_m: outcome.steady_max_m.unwrap_or(f64::NAN),
                max_abs_x_m: outcome.steady_max_m.unwrap_or(f64::NAN),
                max_abs_x_minus_z_m: f64::NAN,
                rms_x_m: outcome.rms_x_m,
                impacts: outcome.impacts as f64,
                cycles: counted.cycles(),
                peak_contact_force_n: 0.0,
                loss_factor: f64::NAN,
                collective_motion: f64::NAN,
            };
            Ok((values(case, &figures, metrics, None), f64::from(outcome.unresolved)))
        }
        None => metrics_of(case, record, metrics, go_on),
    };
    cases.iter().zip(&lanes).map(simulated).collect()
}

/// As [`metrics_of_all`], each case by itself with the engine of `damprig simulate`: in a chaotic motion the lanes' other roundings grow
/// to another result.
///
/// # Errors
/// As [`metrics_of_all`].
pub fn metrics_of_each(
    cases: &[Case],
    record: Option<Record>,
    metrics: &[Quantity],
    go_on: GoOn,
) -> Result<Vec<Simulated>, Halt> {
    cases.iter().map(|case| metrics_of(case, record, metrics, go_on)).collect()
}

/// The case as a point for the lanes, if it is a particle that flies without friction between hard walls under a sine, and if the
/// lanes compute what the metrics need.
fn point(case: &Case, record: Option<Record>, metrics: &[Quantity]) -> Option<Point> {
    let set_up = &case.set_up;
    let particle = set_up.particle.filter(|particle| particle.friction_coefficient == 0.0)?;
    let is_regular = matches!(particle.wall, Wall::Restitution { .. })
        && set_up.friction_damper.is_none()
        && set_up.tmd.is_none()
        && case.record.is_none()
        && case.run.cycle_s.is_none()
        && matches!(case.excitation, Excitation::Sine { .. } | Excitation::ForceSine { .. });
    let counted = Counted::of(case, record);
    let has = |metric: &Quantity| match metric {
        Quantity::XOverZ | Quantity::MeanCycleMaxM | Quantity::CycleSpread => true,
        Quantity::MaxXOverZ | Quantity::MaxAbsXM => counted.is_whole(),
        // The lanes count them from the start.
        Quantity::RmsOverZ | Quantity::RmsXM | Quantity::ImpactsPerCycle => {
            counted.is_whole() && counted.first_cycle == 0.0
        }
        _ => false,
    };
    let cycles = (counted.end_s / counted.cycle_s + 1e-9).floor();
    (is_regular && metrics.iter().all(has) && cycles >= 1.0).then_some(Point {
        set_up: *set_up,
        excitation: case.excitation,
        initial: case.initial,
        cycles: cycles as u64,
        steady_from_cycle: counted.first_cycle as u64,
    })
}

/// Simulates a case by itself.
fn metrics_of(case: &Case, record: Option<Record>, metrics: &[Quantity], go_on: GoOn) -> Result<Simulated, Halt> {
    let (figures, given_up) = figures(case, record, metrics, go_on)?;
    let needs_analysis = metrics.iter().any(|metric| metric::needs_analysis(*metric));
    let periodicity = if needs_analysis { Some(periodicity(case, record, go_on)?) } else { None };
    Ok((values(case, &figures, metrics, periodicity.as_ref()), given_up))
}

fn values(case: &Case, figures: &Figures, metrics: &[Quantity], periodicity: Option<&Periodicity>) -> Vec<f64> {
    let reference_m = case.reference_m().map_or(f64::NAN, |(reference_m, _)| reference_m);
    metrics.iter().map(|metric| figures.value(*metric, reference_m, periodicity)).collect()
}

/// Simulates a case; also how often the event search was given up.
fn figures(case: &Case, record: Option<Record>, metrics: &[Quantity], go_on: GoOn) -> Result<(Figures, f64), Halt> {
    if let Some(damper) = &case.many_particles {
        return figures_of_spheres(case, damper, record, go_on);
    }
    if case.record.is_some() {
        return figures_on_record(case, go_on);
    }
    let invalid = |invalid: damprig_core::io::Invalid| Refusal(invalid.to_string());
    let counted = Counted::of(case, record);
    let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial).map_err(invalid)?;
    let from_s = counted.first_cycle * counted.cycle_s;
    let mut stop = Stop::unless(go_on);
    motion.run(from_s, &mut stop);
    let first_cycle = counted.first_cycle as u64;
    let wanted = Wanted {
        cycle_s: Some(counted.cycle_s),
        steady_from_cycle: Some(first_cycle),
        whole_run: metrics.iter().any(|metric| metric::needs_whole_run(*metric)),
    };
    let mut response = Response::new(wanted);
    response.skip_to(first_cycle);
    motion.run(counted.end_s, &mut (&mut response, &mut stop));
    if stop.is_stopped() {
        return Err(Halt::Stopped);
    }
    response.finish(motion.time_s());
    let (largest_cycle_max_m, mean_cycle_max_m) = response.steady_m().unwrap_or((f64::NAN, f64::NAN));
    let figures = Figures {
        mean_cycle_max_m,
        largest_cycle_max_m,
        max_abs_x_m: response.max_abs_x_m(),
        max_abs_x_minus_z_m: response.max_abs_x_minus_z_m(),
        rms_x_m: response.rms_x_m(),
        impacts: response.impact_count() as f64,
        cycles: counted.cycles(),
        // A soft wall that was never touched has exerted no force.
        peak_contact_force_n: response.peak_contact_force_n().unwrap_or(0.0),
        loss_factor: f64::NAN,
        collective_motion: f64::NAN,
    };
    Ok((figures, f64::from(motion.unresolved())))
}

fn figures_of_spheres(
    case: &Case,
    damper: &Damper,
    record: Option<Record>,
    go_on: GoOn,
) -> Result<(Figures, f64), Halt> {
    let times = Counted::of(case, record);
    let counted = many_particles::counted(case, damper, times.first_cycle as u64, times.end_s, go_on)
        .map_err(|invalid| Refusal(invalid.to_string()))?
        .ok_or(Halt::Stopped)?;
    let (largest_cycle_max_m, mean_cycle_max_m) = counted.cycle_maxima_m.unwrap_or((f64::NAN, f64::NAN));
    let figures = Figures {
        mean_cycle_max_m,
        largest_cycle_max_m,
        max_abs_x_m: counted.max_abs_x_m,
        max_abs_x_minus_z_m: counted.max_abs_x_minus_z_m,
        rms_x_m: counted.rms_x_m,
        impacts: counted.impacts as f64,
        cycles: times.cycles(),
        peak_contact_force_n: 0.0,
        loss_factor: counted.spheres.loss_factor(),
        collective_motion: counted.spheres.collective_motion(),
    };
    Ok((figures, 0.0))
}

fn figures_on_record(case: &Case, go_on: GoOn) -> Result<(Figures, f64), Halt> {
    let invalid = |invalid: damprig_core::io::Invalid| Refusal(invalid.to_string());
    let mut goes_on = |_: f64| go_on();
    let longest_part_s = cost::longest_part_s(case, None).map_err(invalid)?;
    let options = RunOptions { keep: false, longest_part_s, go_on: &mut goes_on };
    let result = simulate(case, &mut (), options).map_err(invalid)?;
    if result.stopped_at_s.is_some() {
        return Err(Halt::Stopped);
    }
    let summary = result.summary;
    let figures = Figures {
        mean_cycle_max_m: f64::NAN,
        largest_cycle_max_m: f64::NAN,
        max_abs_x_m: summary.max_abs_x_m,
        max_abs_x_minus_z_m: summary.max_abs_x_minus_z_m,
        rms_x_m: summary.rms_x_m,
        impacts: summary.impact_count as f64,
        cycles: case.run.duration_s / case.cycle_s(),
        peak_contact_force_n: summary.peak_contact_force_n.unwrap_or(0.0),
        loss_factor: f64::NAN,
        collective_motion: f64::NAN,
    };
    Ok((figures, f64::from(summary.unresolved)))
}

fn periodicity(case: &Case, record: Option<Record>, go_on: GoOn) -> Result<Periodicity, Halt> {
    let mut case = case.clone();
    case.run.duration_s = Counted::of(&case, record).end_s;
    let mut stop = Stop::unless(go_on);
    let periodicity = Periodicity::of(&case, &mut stop);
    if stop.is_stopped() { Err(Halt::Stopped) } else { Ok(periodicity) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Source;

    /// Excitation and start: both with and without a phase, at rest and moving.
    const MOTIONS: [&str; 5] = [
        "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }",
        "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.4, phase_rad = 1.1 }",
        "force = { kind = \"sine\", amplitude_n = 1.1, frequency_ratio = 1, phase_rad = 0.4 }",
        "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\ninitial = { x_m = 0.004, v_m_per_s = -0.1 }",
        "base = { kind = \"sine\", amplitude_m = 0.003, frequency_hz = 2.5 }\n\
         initial = { y_m = -0.012, u_m_per_s = 0.2 }",
    ];

    /// The `run` of a case: a whole and a broken number of cycles.
    const RUNS: [&str; 2] = ["duration_s = 8", "duration_s = 7.93"];

    fn windows() -> [Option<Record>; 4] {
        let all = Record { cycles: Some(15.0), duration_s: None, settle_cycles: 0.0, settle_s: 0.0 };
        let broken = Record { cycles: None, duration_s: Some(5.03), settle_cycles: 0.0, settle_s: 1.3 };
        [None, Some(all), Some(Record { settle_cycles: 10.0, ..all }), Some(broken)]
    }

    #[test]
    fn lanes_count_the_same_window_as_the_exact_engine() {
        let mut compared = 0;
        for motion in MOTIONS {
            for run in RUNS {
                let text = format!(
                    "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n{motion}\n\
                     particle = {{ mass_ratio = 0.1, clearance_m = 0.03, wall = {{ kind = \"restitution\", coefficient = 0.5 }} }}\n\
                     run = {{ {run} }}\n"
                );
                let case =
                    Case::parse(&Source::new("case.toml", text.as_str()), "case").unwrap_or_else(|why| panic!("{why}"));
                for record in windows() {
                    for metric in metric::METRICS {
                        if point(&case, record, &[metric]).is_none() {
                            continue;
                        }
                        let lanes = metrics_of_all(std::slice::from_ref(&case), record, &[metric], &|| true).unwrap();
                        let (exact, _) = metrics_of(&case, record, &[metric], &|| true).unwrap();
                        let (lane, exact) = (lanes[0].0[0], exact[0]);
                        // Forty cycles of roundings, some of which grow until the motion has settled. A spread is a ratio less 1.
                        let scale = if metric == Quantity::CycleSpread { 1.0 + exact } else { exact.abs().max(1e-3) };
                        let is_same = (lane - exact).abs() <= 1e-9 * scale;
                        assert!(is_same, "{} {record:?}: {lane} {exact}\n{text}", metric.name());
                        compared += 1;
                    }
                }
            }
        }
        // Three metrics of every window, and more of the whole ones.
        assert!(compared > 3 * 5 * 8, "{compared}");
    }

    #[test]
    fn a_simulation_of_a_billion_cycles_is_stopped_within_it() {
        let start = std::time::Instant::now();
        for friction in ["0", "0.01"] {
            let text = format!(
                "structure = {{ mass_kg = 1.6, natural_frequency_hz = 2.5, damping_ratio = 0.0038 }}\n{}\n\
                 particle = {{ mass_ratio = 0.1, clearance_m = 0.03, friction_coefficient = {friction}, \
                 wall = {{ kind = \"restitution\", coefficient = 0.5 }} }}\nrun = {{ duration_s = 8 }}\n",
                MOTIONS[0]
            );
            let case =
                Case::parse(&Source::new("case.toml", text.as_str()), "case").unwrap_or_else(|why| panic!("{why}"));
            let record = Some(Record { cycles: Some(1e9), duration_s: None, settle_cycles: 1e9, settle_s: 0.0 });
            let metrics = [Quantity::XOverZ, Quantity::CycleSpread];
            assert_eq!(point(&case, record, &metrics).is_some(), friction == "0");
            let asked = std::sync::atomic::AtomicU32::new(0);
            let go_on = || asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) < 3;
            assert_eq!(metrics_of_all(&[case], record, &metrics, &go_on), Err(Halt::Stopped));
        }
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    }
}
