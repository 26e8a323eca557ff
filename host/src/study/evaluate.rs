//! The table of a study: its columns, and its rows from simulations.

use std::ops::Range;
use std::time::{Duration, Instant};

use damprig_core::integrator::exact::Exact;
use damprig_core::integrator::exact::response::{Response, Wanted};

use super::axis::{AxisValue, Reduction, StudyAxis};
use super::band::{Band, Reduced, Smoothness};
use super::file::Study;
use super::linear;
use super::metric;
use super::over::{Over, quantile};
use super::simulate::{CaseMetrics, Counted, GoOn, SimulationRecord, metrics_of_all};
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::simulation::case::RunSpec;
use crate::simulation::{Case, cost, multi_degree};

/// A column of the table that is computed.
#[derive(Clone, Debug, PartialEq)]
pub struct ComputedColumn {
    /// Name.
    pub name: String,
    /// Symbol of its unit; empty for a plain number.
    pub unit: &'static str,
    /// Meaning.
    pub doc: String,
}

/// The computed columns of a study's table, in the order of the values of [`rows`].
#[must_use]
pub fn columns(study: &Study) -> Vec<ComputedColumn> {
    let mut columns = Vec::new();
    for metric in &study.metrics {
        let (name, unit, doc) = (metric.name(), metric.unit(), metric.definition());
        let mut push = |name: String, doc: String| columns.push(ComputedColumn { name, unit, doc });
        match &study.ensemble {
            None => push(name.into(), doc.into()),
            Some(ensemble) => {
                push(format!("{name}_min"), format!("{doc}; smallest over the starts"));
                for quantile in &ensemble.quantiles {
                    push(quantile_name(name, *quantile), format!("{doc}; quantile {quantile} over the starts"));
                }
                push(format!("{name}_max"), format!("{doc}; largest over the starts"));
                if ensemble.over == Over::Mean {
                    push(format!("{name}_mean"), format!("{doc}; mean over the starts"));
                }
            }
        }
        if study.ensemble.is_none() {
            for axis in extreme_axes(study) {
                let axis = &study.axes[axis];
                columns.push(ComputedColumn {
                    name: format!("{name}_at_{}", axis.short_key()),
                    unit: axis.unit(),
                    doc: format!("where {} is the {} of {name}", axis.key, axis.reduce.map_or("", Reduction::name)),
                });
            }
        }
    }
    columns.push(ComputedColumn {
        name: UNRESOLVED.into(),
        unit: "",
        doc: "how often too many events fell on one instant and the motion went on without resolving them".into(),
    });
    columns
}

/// Name of the column that counts instants with too many events.
pub const UNRESOLVED: &str = "unresolved";

/// Name of a quantile's column: `x_over_z_q05`.
fn quantile_name(metric: &str, quantile: f64) -> String {
    let percent = 100.0 * quantile;
    if (percent - percent.round()).abs() < 1e-9 {
        format!("{metric}_q{:02.0}", percent)
    } else {
        format!("{metric}_q{percent}").replace('.', "_")
    }
}

/// The column that stands for a metric in maps and for the best point: the metric itself, or what counts of its values over the starts.
#[must_use]
pub fn main_column(study: &Study, metric: Quantity) -> String {
    let name = metric.name();
    // Of another metric than the objective the largest value is the worst.
    let is_maximum = study.is_maximum && metric == study.objective;
    let Some(ensemble) = &study.ensemble else { return name.into() };
    match (ensemble.over, ensemble.over.quantile(is_maximum)) {
        (Over::Worst, _) => format!("{name}_{}", if is_maximum { "min" } else { "max" }),
        (_, Some(share)) => quantile_name(name, share),
        (_, None) => format!("{name}_mean"),
    }
}

/// Reduced axes with a largest or smallest value, and so a place of it. The last axis is reduced first: what comes after a mean has a
/// place for each value of the mean's axis, and so none.
fn extreme_axes(study: &Study) -> impl Iterator<Item = usize> {
    let is_extreme = |place: &usize| study.axes[*place].reduce != Some(Reduction::Mean);
    study.points.reduced().iter().copied().take_while(is_extreme)
}

/// Cases that are read between two questions whether to go on.
const POINTS_PER_QUESTION: u64 = 256;

/// Computes rows of the table: for each the values of the columns that [`columns`] names.
///
/// # Errors
/// The refusal of a case that the axes make, or that `go_on` said no.
pub fn rows(study: &Study, rows: Range<u64>, go_on: GoOn) -> Result<Vec<Vec<f64>>, Failure> {
    let points = study.points.points_per_row(&study.axes).unwrap_or(0);
    let mut cases = Vec::new();
    for row in rows.clone() {
        let of_row = study.cases(row)?;
        for point in 0..points {
            if point % POINTS_PER_QUESTION == POINTS_PER_QUESTION - 1 && !go_on() {
                return Err(Failure::stopped());
            }
            let case = of_row.with(&study.points.values(&study.axes, row, point))?;
            match &study.ensemble {
                None => cases.push(case),
                Some(ensemble) => cases.extend(ensemble.shares.iter().map(|share| case.started_at(*share))),
            }
        }
    }
    let simulated = metrics_of_all(&cases, study.record, &study.metrics, go_on)?;
    let each = study.simulations_per_row() as usize;
    let axes = study.points.reduced().iter().map(|axis| study.axes[*axis].clone()).collect();
    let mut band = Band::of(axes);
    band.smoothness = cases.first().map_or(Smoothness::Jumps, |case| Smoothness::of(case, study.record));
    let row_of = |(row, simulated)| row_of(study, &band, row, simulated, go_on);
    rows.zip(simulated.chunks(each)).map(row_of).collect()
}

/// A row from its simulations, by point, then by start, and from more of them around the peaks of a band.
fn row_of(study: &Study, band: &Band, row: u64, simulated: &[CaseMetrics], go_on: GoOn) -> Result<Vec<f64>, Failure> {
    let starts = study.ensemble.as_ref().map_or(1, |ensemble| ensemble.shares.len());
    let mut row_values = Vec::new();
    let cases_of_row = study.cases(row)?;
    let mut unresolved: f64 = simulated.iter().map(|(_, given_up)| given_up).sum();
    for (place, metric) in study.metrics.iter().enumerate() {
        let mut reduced: Vec<Reduced> = Vec::new();
        for start in 0..starts {
            let share = study.ensemble.as_ref().map(|ensemble| ensemble.shares[start]);
            let mut simulate = |points: &[Vec<AxisValue>]| {
                let case = |at: &Vec<AxisValue>| {
                    let mut values = study.points.values(&study.axes, row, 0);
                    for (axis, value) in study.points.reduced().iter().zip(at) {
                        values[*axis] = value.clone();
                    }
                    let case = cases_of_row.with(&values)?;
                    Ok(share.map_or_else(|| case.clone(), |share| case.started_at(share)))
                };
                let cases = points.iter().map(case).collect::<Result<Vec<Case>, Failure>>()?;
                let found = metrics_of_all(&cases, study.record, &[*metric], go_on)?;
                unresolved += found.iter().map(|(_, given_up)| given_up).sum::<f64>();
                Ok(found.iter().map(|(values, _)| values[0]).collect())
            };
            let grid: Vec<f64> = simulated[start..].iter().step_by(starts).map(|(values, _)| values[place]).collect();
            reduced.push(band.reduce(&grid, band.effort_of_study(), &mut simulate)?);
        }
        match &study.ensemble {
            None => {
                row_values.push(reduced[0].value);
                let number = |value: &AxisValue| if let AxisValue::Number(number) = value { *number } else { f64::NAN };
                let extremes = extreme_axes(study).count();
                row_values.extend(reduced[0].at.iter().take(extremes).map(number));
            }
            Some(ensemble) => {
                let mut sorted: Vec<f64> = reduced.iter().map(|reduced| reduced.value).collect();
                sorted.sort_by(f64::total_cmp);
                row_values.push(quantile(&sorted, 0.0));
                row_values.extend(ensemble.quantiles.iter().map(|share| quantile(&sorted, *share)));
                row_values.push(quantile(&sorted, 1.0));
                if ensemble.over == Over::Mean {
                    row_values.push(Over::Mean.of(&sorted, study.is_maximum));
                }
            }
        }
    }
    row_values.push(unresolved);
    Ok(row_values)
}

/// Reduces the values at all points of some axes, of which the last varies fastest, to one, with the number of its point.
#[must_use]
pub fn reduce_over(axes: &[&StudyAxis], values: &[f64]) -> (f64, usize) {
    let mut level: Vec<(f64, usize)> = values.iter().copied().zip(0..).collect();
    for axis in axes.iter().rev() {
        let Some(reduction) = axis.reduce else { continue };
        level = level
            .chunks(axis.count())
            .map(|chunk| {
                let (value, place) = reduction.of(&chunk.iter().map(|(value, _)| *value).collect::<Vec<_>>());
                (value, chunk[place].1)
            })
            .collect();
    }
    level[0]
}

/// Longest computing time of [`trial_s`], about.
const TRIAL: Duration = Duration::from_millis(50);

/// Estimated computing time of a row, s, from the beginning of one of its simulations.
///
/// # Errors
/// The refusal of a case that the axes make.
pub fn trial_s(study: &Study, row: u64) -> Result<f64, Failure> {
    let start = Instant::now();
    let cases = study.cases(row)?;
    let row_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let case = cases.with(&study.points.values(&study.axes, row, 0))?;
    let reading_s = start.elapsed().as_secs_f64();
    let simulating_s = simulating_s(case, study.record, &study.metrics)?;
    Ok(row_s + (reading_s + simulating_s) * most_simulations(study))
}

/// Estimated computing time of a simulation, s, from its beginning.
///
/// # Errors
/// The refusal of a case.
pub fn simulating_s(case: Case, record: Option<SimulationRecord>, metrics: &[Quantity]) -> Result<f64, Failure> {
    let start = Instant::now();
    let counted = Counted::of(&case, record);
    let end_s = counted.end_s;
    let times = times_of_metrics(metrics);
    if case.many_particles.is_some() {
        let run = RunSpec { duration_s: end_s, ..RunSpec::default() };
        return Ok(times * cost::estimate(&Case { run, ..case })?.seconds);
    }
    if case.record.is_some() || linear::settled(&case, &counted).is_some() {
        // Nothing stops it, so it has a result.
        let _ = Failure::unless_interrupted(metrics_of_all(&[case], record, metrics, &|| true))?;
        return Ok(times * start.elapsed().as_secs_f64());
    }
    if let Some(several) = &case.multi_degree {
        let wanted = Wanted { cycle_s: Some(case.cycle_s()), ..Wanted::default() };
        let mut until_s = (8.0 * case.cycle_s()).min(end_s);
        loop {
            // Twice as far each time, from the start.
            let start = Instant::now();
            multi_degree::driver::counted(&case, several, (0, 0.0), until_s, wanted, &|| true)?;
            if until_s >= end_s || start.elapsed() > TRIAL {
                return Ok(times * start.elapsed().as_secs_f64() * end_s / until_s);
            }
            until_s = (2.0 * until_s).min(end_s);
        }
    }
    let mut motion = Exact::new(&case.set_up, &case.excitation, &case.initial)?;
    let mut response = Response::new(Wanted { cycle_s: Some(case.cycle_s()), ..Wanted::default() });
    let mut until_s = (8.0 * case.cycle_s()).min(end_s);
    loop {
        motion.run(until_s, &mut response);
        if until_s >= end_s || start.elapsed() > TRIAL {
            break;
        }
        until_s = (2.0 * until_s).min(end_s);
    }
    Ok(times * start.elapsed().as_secs_f64() * end_s / until_s)
}

/// Simulations behind each row, with most of those around the peaks of a band.
fn most_simulations(study: &Study) -> f64 {
    let refined = study.axes.iter().find(|axis| axis.is_refined());
    let around = refined.map_or(0.0, |axis| {
        let effort = Band::of(vec![axis.clone()]).effort_of_study();
        let share = effort.most_simulations() as f64 / axis.count() as f64;
        share * study.metrics.len() as f64
    });
    study.simulations_per_row() as f64 * (1.0 + around)
}

/// Simulated cycles of a row at its first point.
#[must_use]
pub fn cycles_per_row(study: &Study) -> f64 {
    let values = study.points.values(&study.axes, 0, 0);
    let cycles = study.case_with(&values).map_or(1.0, |case| {
        let counted = Counted::of(&case, study.record);
        counted.end_s / counted.cycle_s
    });
    cycles * most_simulations(study)
}

/// Time beside the simulations of a row, s: reading its case and writing its results.
const ROW_S: f64 = 5e-5;

/// Computing time of a row on one usual core, s, the same on every machine: the mean of [`cost::usual_s`] over some rows.
#[must_use]
pub fn usual_s(study: &Study) -> f64 {
    let of_row = |row: u64| {
        let case = study.case_with(&study.points.values(&study.axes, row, 0)).ok()?;
        let counted = Counted::of(&case, study.record);
        Some(if linear::settled(&case, &counted).is_some() { 0.0 } else { cost::usual_s(&case, counted.end_s) })
    };
    let found: Vec<f64> = spread_rows(study.rows()).filter_map(of_row).collect();
    let mean_s = found.iter().sum::<f64>() / found.len().max(1) as f64;
    ROW_S + mean_s * times_of_metrics(&study.metrics) * most_simulations(study)
}

/// Rows in the middles of up to eight equal parts of a table: not along an edge of it.
pub fn spread_rows(rows: u64) -> impl Iterator<Item = u64> {
    let tried = rows.min(8);
    (0..tried).map(move |n| (((n as f64 + 0.5) / tried as f64 * rows as f64) as u64).min(rows - 1))
}

/// How many times as long as a simulation its metrics take: the analysis runs the motion again, and some of its periods many times.
fn times_of_metrics(metrics: &[Quantity]) -> f64 {
    if metrics.iter().any(|metric| metric::needs_analysis(*metric)) { 4.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_axes_become_one_value_from_the_last_to_the_first() {
        let axis = |count: u32, reduce: Reduction| StudyAxis {
            key: "a".into(),
            values: crate::study::axis::AxisValues::Numbers((0..count).map(f64::from).collect()),
            is_log: false,
            reduce: Some(reduce),
            span: 0..0,
            value_spans: Vec::new(),
        };
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 9.0];
        let of = |first: Reduction, second: Reduction| reduce_over(&[&axis(2, first), &axis(3, second)], &values);
        assert_eq!(of(Reduction::Maximum, Reduction::Maximum), (9.0, 5));
        assert_eq!(of(Reduction::Minimum, Reduction::Maximum), (3.0, 2));
        // The largest mean is that of the second value of the first axis.
        assert_eq!(of(Reduction::Maximum, Reduction::Mean), (6.0, 3));
        assert_eq!(of(Reduction::Mean, Reduction::Maximum).0, 6.0);
    }

    #[test]
    fn a_quantile_lies_between_the_sorted_values() {
        let sorted = [1.0, 2.0, 4.0];
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0].map(|share| quantile(&sorted, share)), [1.0, 1.5, 2.0, 3.0, 4.0]);
        assert!(quantile(&[1.0, f64::NAN], 0.0).is_nan());
        assert_eq!(quantile_name("x_over_z", 0.05), "x_over_z_q05");
        assert_eq!(quantile_name("x_over_z", 0.975), "x_over_z_q97_5");
    }
}
