//! Stiffness and loss factor of a soft wall from a table of dynamic mechanical analysis (DMA).
//!
//! k1 = ν·E' with the storage modulus E' and the pad's shape factor ν, and η = E''/E'. Both follow a power of the frequency over
//! a table's range, so a line through their logarithms gives them at the frequency of the contact.

use super::Estimate;
use super::statistics::{Value, line};
use super::table::{NumberTable, TableQuantity};
use crate::failure::Failure;

const MODULUS: &[(&str, f64)] = &[("pa", 1.0), ("kpa", 1e3), ("mpa", 1e6)];
const FREQUENCY: TableQuantity =
    TableQuantity { stem: "frequency", units: &[("hz", 1.0)], about: "frequency of the test", most: 1e6 };
const STORAGE: TableQuantity =
    TableQuantity { stem: "storage_modulus", units: MODULUS, about: "storage modulus", most: 1e12 };
const LOSS: TableQuantity = TableQuantity { stem: "loss_modulus", units: MODULUS, about: "loss modulus", most: 1e12 };
const FACTOR: TableQuantity =
    TableQuantity { stem: "loss_factor", units: &[("", 1.0)], about: "loss factor, tan δ", most: 10.0 };
const STIFFNESS: TableQuantity = TableQuantity {
    stem: "stiffness",
    units: &[("n_per_m", 1.0), ("kn_per_m", 1e3), ("n_per_mm", 1e3)],
    about: "dynamic stiffness",
    most: 1e12,
};

/// What a table does not state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pad {
    /// ν of the pad: k1 = ν·E', m.
    pub shape_factor_m: Option<f64>,
    /// Frequency at which the wall is wanted, Hz; else the middle of the table's frequencies.
    pub frequency_hz: Option<f64>,
}

/// Identifies k1 and η.
///
/// # Errors
/// Missing columns, values that are not positive, too few rows, a frequency outside the table.
pub fn identify(table: &NumberTable, pad: Pad) -> Result<Vec<Estimate>, Failure> {
    let is_stiffness = table.has(&STIFFNESS);
    let moduli = positive(table, if is_stiffness { &STIFFNESS } else { &STORAGE })?;
    let losses = if table.has(&FACTOR) {
        positive(table, &FACTOR)?
    } else if !is_stiffness && table.has(&LOSS) {
        positive(table, &LOSS)?.iter().zip(&moduli).map(|(loss, storage)| loss / storage).collect()
    } else {
        return Err(table.refuse("there is no loss: give a column loss_factor, or loss_modulus_pa"));
    };
    let frequencies = if table.has(&FREQUENCY) { Some(positive(table, &FREQUENCY)?) } else { None };
    if let (Some(wanted), Some(all)) = (pad.frequency_hz, &frequencies) {
        let (low, high) = all.iter().fold((f64::MAX, 0.0f64), |(low, high), f| (low.min(*f), high.max(*f)));
        if !(0.5 * low..=2.0 * high).contains(&wanted) {
            return Err(table.refuse(format!(
                "the table covers {low} Hz to {high} Hz; {wanted} Hz is more than an octave outside\n  measure nearer to it, or \
                 use the time-temperature shift of the material's table"
            )));
        }
    }
    let at = |values: &[f64]| at_frequency(values, frequencies.as_deref(), pad.frequency_hz);
    let few = || table.refuse("one row has no uncertainty: give at least three frequencies or two repeats");
    let (modulus, loss) = (at(&moduli).ok_or_else(few)?, at(&losses).ok_or_else(few)?);
    const METHOD: &str = "DMA table, power law of the frequency";
    let mut all = Vec::new();
    let factor = if is_stiffness { Some(1.0) } else { pad.shape_factor_m };
    if !is_stiffness {
        all.push(Estimate::new("storage modulus", "Pa", METHOD, &modulus));
    }
    let loss = Estimate::new("loss factor of the wall", "", METHOD, &loss);
    match factor {
        Some(factor) => {
            let stiffness = modulus.mapped(modulus.value * factor, factor);
            let stiffness = Estimate::new("stiffness of the wall, k1", "N/m", METHOD, &stiffness);
            all.insert(0, stiffness.of_key("particle.wall.stiffness_n_per_m"));
            all.insert(1, loss.of_key("particle.wall.loss_factor"));
        }
        // Without a stiffness a set-up cannot use the loss factor.
        None => all.push(loss),
    }
    Ok(all)
}

fn positive(table: &NumberTable, quantity: &TableQuantity) -> Result<Vec<f64>, Failure> {
    let values = table.column(quantity)?;
    match values.iter().position(|value| *value <= 0.0) {
        Some(row) => {
            Err(table.refuse(format!("line {}: the {} must be greater than 0", table.line(row), quantity.about)))
        }
        None => Ok(values),
    }
}

/// A quantity at a frequency, by a line through the logarithms; the mean where there is one frequency only.
fn at_frequency(values: &[f64], frequencies: Option<&[f64]>, wanted: Option<f64>) -> Option<Value> {
    let logs: Vec<f64> = values.iter().map(|value| value.ln()).collect();
    let of = |log: Value| log.mapped(log.value.exp(), log.value.exp());
    let Some(frequencies) = frequencies else { return Value::mean(&logs).map(of) };
    let all: Vec<f64> = frequencies.iter().map(|f| f.ln()).collect();
    let middle = all.iter().sum::<f64>() / all.len() as f64;
    let origin = wanted.map_or(middle, f64::ln);
    let from: Vec<f64> = all.iter().map(|f| f - origin).collect();
    if from.iter().all(|f| (f - from[0]).abs() < 1e-9) {
        return Value::mean(&logs).map(of);
    }
    line(&from, &logs, |_| 1.0).map(|line| of(line.intercept))
}
