//! Coefficient of restitution and contact time from drop tests and force records.
//!
//! Between two impacts a dropped body flies for T = 2v/g, so flights shorten by e and heights by e². A force record gives
//! the impulse J = m·v·(1 + e) of an impact with the approach velocity v.

use super::statistics::Value;
use super::table::{METRES, Quantity, TIME, Table};
use super::{CannotIdentify, Estimate};

const DROP: Quantity = Quantity { stem: "drop", units: &[("", 1.0)], about: "number of the drop", most: 1e6 };
const DROP_HEIGHT: Quantity =
    Quantity { stem: "drop_height", units: METRES, about: "height from which it is dropped", most: 20.0 };
const REBOUND_HEIGHT: Quantity =
    Quantity { stem: "rebound_height", units: METRES, about: "height that it reaches after the impact", most: 20.0 };
const FORCE: Quantity =
    Quantity { stem: "force", units: &[("n", 1.0), ("kn", 1e3)], about: "force on the wall", most: 1e6 };

/// Mass and approach velocity of the body on a force record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Mass of the body, kg.
    pub mass_kg: f64,
    /// Its velocity before the impact, m/s.
    pub velocity_m_per_s: f64,
}

const TIMES: &str = "drop test: times of the impacts";
const HEIGHTS: &str = "drop test: heights";
const IMPULSE: &str = "force record: impulse and approach velocity";

/// Identifies restitution, and contact time where there is a force, by the columns of the table.
///
/// # Errors
/// Columns of no test, too few impacts, values that no impact has.
pub fn identify(table: &Table, approach: Option<Approach>) -> Result<Vec<Estimate>, CannotIdentify> {
    let (values, method) = if table.has(&FORCE) {
        return of_force(table, approach);
    } else if table.has(&DROP_HEIGHT) {
        (of_heights(table)?, HEIGHTS)
    } else if table.has(&TIME) {
        (of_times(table)?, TIMES)
    } else {
        return Err(table.refuse(
            "these are not the columns of a drop test or a force record\n  impact times: drop,t_s; heights: \
             drop_height_m,rebound_height_m; force: t_s,force_n",
        ));
    };
    Ok(vec![restitution(table, &values, method)?])
}

fn restitution(table: &Table, values: &[f64], method: &'static str) -> Result<Estimate, CannotIdentify> {
    if let Some(wrong) = values.iter().find(|e| !(0.0..=1.05).contains(*e)) {
        return Err(table.refuse(format!(
            "a coefficient of restitution of {wrong:.3} is not possible: it is 0 to 1\n  is an impact missing from the list, or a \
             double one in it?"
        )));
    }
    let mean = Value::mean(values)
        .ok_or_else(|| table.refuse("one value has no uncertainty: give at least two drops or three flights"))?;
    Ok(Estimate::new("coefficient of restitution", "", method, &mean).of_key("particle.wall.coefficient"))
}

/// Rows of each drop; all rows are one drop without a column for it.
fn drops(table: &Table) -> Result<Vec<Vec<usize>>, CannotIdentify> {
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

fn of_times(table: &Table) -> Result<Vec<f64>, CannotIdentify> {
    let times = table.column(&TIME)?;
    let drops = drops(table)?;
    let mut values = Vec::new();
    for rows in &drops {
        let t: Vec<f64> = rows.iter().map(|row| times[*row]).collect();
        if let Some(n) = t.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(table.refuse(format!(
                "line {}: the impact at {} s is not later than the one before\n  number the drops in a column `drop`",
                table.line(rows[n + 1]),
                t[n + 1]
            )));
        }
        let last = t.len().wrapping_sub(1);
        if t.len() < 3 {
            let text =
                format!("line {}: a drop with {} impacts; a ratio of flights needs 3", table.line(rows[0]), t.len());
            return Err(table.refuse(text));
        }
        if drops.len() == 1 {
            values.extend(t.windows(3).map(|w| (w[2] - w[1]) / (w[1] - w[0])));
        } else {
            // All flights but the first over all but the last: e of a geometric series.
            values.push((t[last] - t[1]) / (t[last - 1] - t[0]));
        }
    }
    Ok(values)
}

fn of_heights(table: &Table) -> Result<Vec<f64>, CannotIdentify> {
    let (before, after) = (table.column(&DROP_HEIGHT)?, table.column(&REBOUND_HEIGHT)?);
    before
        .iter()
        .zip(&after)
        .enumerate()
        .map(|(row, (before, after))| {
            if *before <= 0.0 || *after < 0.0 {
                let text = format!("line {}: heights must be greater than 0", table.line(row));
                return Err(table.refuse(text));
            }
            Ok((after / before).sqrt())
        })
        .collect()
}

/// Share of the peak above which a force counts as contact.
const CONTACT: f64 = 0.05;

fn of_force(table: &Table, approach: Option<Approach>) -> Result<Vec<Estimate>, CannotIdentify> {
    let (t, force) = (table.times()?, table.column(&FORCE)?);
    let mut sorted = force.clone();
    sorted.sort_by(f64::total_cmp);
    let rest = sorted[sorted.len() / 2];
    let peak = sorted.last().copied().unwrap_or(rest) - rest;
    let clipped = force.windows(3).find(|w| w[0] - rest > 0.9 * peak && w[0] == w[1] && w[1] == w[2]);
    if let Some(clipped) = clipped {
        return Err(table.refuse(format!(
            "the force sensor is saturated: it stays at {} N at the peak\n  drop from less high, or use a sensor of larger \
             range",
            clipped[0]
        )));
    }
    let level = rest + CONTACT * peak;
    let (mut durations, mut impulses, mut start) = (Vec::new(), Vec::new(), None);
    for n in 1..t.len() {
        let cross = || t[n - 1] + (t[n] - t[n - 1]) * (level - force[n - 1]) / (force[n] - force[n - 1]);
        if force[n - 1] <= level && force[n] > level {
            start = Some((cross(), n));
        } else if force[n - 1] > level
            && force[n] <= level
            && let Some((since, from)) = start.take()
            && force[from..n].iter().any(|f| f - rest > 0.5 * peak)
        {
            durations.push(cross() - since);
            let ends = from.saturating_sub(3)..(n + 3).min(t.len());
            impulses.push(
                ends.clone()
                    .skip(1)
                    .map(|m| 0.5 * (force[m] + force[m - 1] - 2.0 * rest) * (t[m] - t[m - 1]))
                    .sum::<f64>(),
            );
        }
    }
    let Some(contact) = Value::mean(&durations) else {
        return Err(table.refuse(format!(
            "{} impacts were found in the force; at least 2 are needed for an uncertainty",
            durations.len()
        )));
    };
    let mut all =
        vec![Estimate::new("contact time", "s", "force record: time above 5 % of the largest peak", &contact)];
    if let Some(Approach { mass_kg, velocity_m_per_s }) = approach {
        let values: Vec<f64> = impulses.iter().map(|impulse| impulse / (mass_kg * velocity_m_per_s) - 1.0).collect();
        all.insert(0, restitution(table, &values, IMPULSE)?);
    }
    Ok(all)
}
