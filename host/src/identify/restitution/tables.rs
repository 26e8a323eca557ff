//! Impacts of drop tests in tables: the times of the impacts, or heights.
//!
//! Between two impacts a dropped body flies for T = 2v/g: a flight gives the speeds at its ends, two flights the e between them. A drop height h
//! gives the first speed, √(2gh).

use nalgebra::DMatrix;

use super::law::{Impact, Impacts};
use super::{MAX, RestitutionOptions};
use crate::failure::Failure;
use crate::identify::table::{METRES, NumberTable, TIME, TableQuantity};

const DROP: TableQuantity = TableQuantity { stem: "drop", units: &[("", 1.0)], about: "number of the drop", most: 1e6 };
pub(super) const DROP_HEIGHT: TableQuantity =
    TableQuantity { stem: "drop_height", units: METRES, about: "height from which it is dropped", most: 20.0 };
const REBOUND_HEIGHT: TableQuantity = TableQuantity {
    stem: "rebound_height",
    units: METRES,
    about: "height that it reaches after the impact",
    most: 20.0,
};

const TIMES: &str = "drop test: times of the impacts";
const HEIGHTS: &str = "drop test: heights";

/// The impacts of a table of a drop test.
///
/// # Errors
/// Columns of no test, too few impacts, values that no impact has.
pub(super) fn impacts(table: &NumberTable, options: &RestitutionOptions) -> Result<Impacts, Failure> {
    if table.has(&TIME) {
        return of_times(table, options);
    }
    if table.has(&DROP_HEIGHT) {
        return of_heights(table, options.gravity_m_per_s2);
    }
    Err(table.refuse(
        "these are not the columns of a drop test, a film or a force record\n  impact times: drop,t_s and drop_height_m if known; heights: \
         drop_height_m,rebound_height_m; force: t_s,force_n; film: frame,x,y",
    ))
}

/// Rows of each drop; all rows are one drop without a column for it.
fn drops(table: &NumberTable) -> Result<Vec<Vec<usize>>, Failure> {
    if !table.has(&DROP) {
        return Ok(vec![(0..table.len()).collect()]);
    }
    let numbers = table.column(&DROP)?;
    let mut all: Vec<Vec<usize>> = Vec::new();
    for row in 0..numbers.len() {
        match all.last_mut() {
            Some(rows) if numbers[row - 1] == numbers[row] => rows.push(row),
            _ => all.push(vec![row]),
        }
    }
    Ok(all)
}

/// e and approach speed of an impact, from times t and the drop height h of a drop: e is the ratio of two flights, or of the first flight
/// and twice the fall.
#[derive(Clone, Copy)]
enum Flights {
    First { height_m: f64 },
    Between,
}

fn of_times(table: &NumberTable, options: &RestitutionOptions) -> Result<Impacts, Failure> {
    let g = options.gravity_m_per_s2;
    let times = table.column(&TIME)?;
    let heights = heights(table, options)?;
    let drops = drops(table)?;
    let (mut all, mut rows_of) = (Vec::new(), Vec::new());
    for (place, rows) in drops.iter().enumerate() {
        let t: Vec<f64> = rows.iter().map(|row| times[*row]).collect();
        if let Some(n) = t.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(table.refuse(format!(
                "line {}: the impact at {} s is not later than the one before\n  number the drops in a column `drop`",
                table.line(rows[n + 1]),
                t[n + 1]
            )));
        }
        let height_m = height_of(table, rows, heights.as_deref())?;
        let least = if height_m.is_some() { 2 } else { 3 };
        if t.len() < least {
            let help = if least == 3 { ", or 2 with a drop height (drop_height_m)" } else { "" };
            let text = format!(
                "line {}: a drop with {} impacts; a ratio of flights needs {least}{help}",
                table.line(rows[0]),
                t.len()
            );
            return Err(table.refuse(text));
        }
        let first = height_m.map(|height_m| (Flights::First { height_m }, 0));
        let between = (1..t.len() - 1).map(|n| (Flights::Between, n));
        for (flights, n) in first.into_iter().chain(between) {
            let after_s = t[n + 1] - t[n];
            let speed = match flights {
                Flights::First { height_m } => (2.0 * g * height_m).sqrt(),
                Flights::Between => 0.5 * g * (t[n] - t[n - 1]),
            };
            let e = 0.5 * g * after_s / speed;
            if !(0.0..=MAX).contains(&e) {
                return Err(table.refuse(format!(
                    "line {}: a coefficient of restitution of {e:.3} is not possible: it is 0 to 1\n  is an impact missing from the list, or a \
                     double one in it?",
                    table.line(rows[n])
                )));
            }
            rows_of.push((flights, rows[0] + n));
            all.push(impact(table, (place, n), Some(t[n]), speed, e));
        }
    }
    let shape = shape_of_times(&times, &all, &rows_of);
    let is_absolute = options.time_uncertainty_s.is_some();
    let covariance = shape * options.time_uncertainty_s.unwrap_or(1.0).powi(2);
    if is_absolute {
        for (n, impact) in all.iter_mut().enumerate() {
            impact.coefficient_standard_uncertainty = covariance[(n, n)].sqrt();
            let ln_speed = covariance[(n + rows_of.len(), n + rows_of.len())].sqrt();
            impact.speed_standard_uncertainty_m_per_s = ln_speed * impact.speed_m_per_s;
        }
    }
    Ok(Impacts { all, covariance, is_absolute, degrees_of_freedom: f64::INFINITY, method: TIMES })
}

/// Covariance of e and ln v for times with unit uncertainty.
fn shape_of_times(times: &[f64], all: &[Impact], rows_of: &[(Flights, usize)]) -> DMatrix<f64> {
    let n = all.len();
    let mut by_time: DMatrix<f64> = DMatrix::zeros(2 * n, times.len());
    for (i, (flights, row)) in rows_of.iter().enumerate() {
        let e = all[i].coefficient;
        let after_s = times[row + 1] - times[*row];
        by_time[(i, row + 1)] += e / after_s;
        by_time[(i, *row)] -= e / after_s;
        if let Flights::Between = flights {
            let before_s = times[*row] - times[row - 1];
            for (place, sign) in [(*row, 1.0), (row - 1, -1.0)] {
                by_time[(i, place)] -= sign * e / before_s;
                by_time[(n + i, place)] += sign / before_s;
            }
        }
    }
    &by_time * by_time.transpose()
}

fn impact(table: &NumberTable, (drop, number): (usize, usize), time_s: Option<f64>, speed: f64, e: f64) -> Impact {
    Impact {
        source: table.file().into(),
        drop: drop as u32 + 1,
        number: number as u32 + 1,
        time_s,
        speed_m_per_s: speed,
        speed_standard_uncertainty_m_per_s: 0.0,
        coefficient: e,
        coefficient_standard_uncertainty: 0.0,
        coefficient_by_times: None,
        coefficient_by_heights: None,
        sideways_m_per_s: None,
    }
}

/// The drop height of each row, by the column or the option.
fn heights(table: &NumberTable, options: &RestitutionOptions) -> Result<Option<Vec<f64>>, Failure> {
    match (table.has(&DROP_HEIGHT), options.drop_height_m) {
        (true, Some(_)) => Err(table.refuse("--drop-height-m and the column drop_height_m state the same\n  keep one")),
        (true, None) => table.column(&DROP_HEIGHT).map(Some),
        (false, height_m) => Ok(height_m.map(|height_m| vec![height_m; table.len()])),
    }
}

/// The drop height of the rows of a drop.
fn height_of(table: &NumberTable, rows: &[usize], heights: Option<&[f64]>) -> Result<Option<f64>, Failure> {
    let Some(heights) = heights else { return Ok(None) };
    let height_m = heights[rows[0]];
    if let Some(row) = rows.iter().find(|row| heights[**row] != height_m) {
        return Err(table.refuse(format!(
            "line {}: the drop height {} m is another one than {height_m} m, with which the drop begins\n  number the drops in a column \
             `drop`",
            table.line(*row),
            heights[*row]
        )));
    }
    if height_m <= 0.0 {
        return Err(table.refuse(format!("line {}: the drop height must be greater than 0", table.line(rows[0]))));
    }
    Ok(Some(height_m))
}

fn of_heights(table: &NumberTable, g: f64) -> Result<Impacts, Failure> {
    let (before, after) = (table.column(&DROP_HEIGHT)?, table.column(&REBOUND_HEIGHT)?);
    let mut all = Vec::new();
    for (row, (before, after)) in before.iter().zip(&after).enumerate() {
        if *before <= 0.0 || *after < 0.0 {
            return Err(table.refuse(format!("line {}: heights must be greater than 0", table.line(row))));
        }
        let e = (after / before).sqrt();
        if e > MAX {
            return Err(table.refuse(format!(
                "line {}: a coefficient of restitution of {e:.3} is not possible: it is 0 to 1\n  are the columns swapped?",
                table.line(row)
            )));
        }
        all.push(impact(table, (row, 0), None, (2.0 * g * before).sqrt(), e));
    }
    if all.len() < 2 {
        return Err(table.refuse("one value has no uncertainty: give at least two drops"));
    }
    let covariance = DMatrix::zeros(2 * all.len(), 2 * all.len());
    // The heights have no uncertainty of their own: the scatter shows it.
    Ok(Impacts { all, covariance, is_absolute: true, degrees_of_freedom: f64::INFINITY, method: HEIGHTS })
}
