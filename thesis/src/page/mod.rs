//! Writes what was found: the page `thesis.html`, `thesis.md`, and the tables `published.csv`,
//! `published_curves.csv` and `claims.csv`.

mod html;
mod markdown;
mod tables;

use std::path::Path;

use super::compared::{ComparedRow, Comparison, CurveRow};
use super::published::PublishedValue;
use super::results::ResultError;
use damprig::failure::Failure;
use damprig::report::numbers::significant;
use damprig::run_folder::own_files;

/// Name of the page.
pub const PAGE: &str = "thesis.html";

/// What stands for a number that is not there.
const GAP: &str = "—";

/// Significant digits of a number that is shown.
const DIGITS: usize = 5;

/// Writes all files into the folder of the results, in place of earlier ones.
///
/// # Errors
/// A file that cannot be written.
pub fn write(comparison: &Comparison, out: &Path) -> Result<(), Failure> {
    let csv = |name: &str, text: Result<Vec<u8>, csv::Error>| {
        let path = out.join(name);
        own_files::replace(&path, &text.map_err(|error| Failure::cannot("write", &path, error))?)
    };
    csv("published.csv", tables::published(comparison))?;
    csv("published_curves.csv", tables::curves(comparison))?;
    csv("claims.csv", tables::claims(comparison))?;
    own_files::replace(&out.join("thesis.md"), markdown::text(comparison, out).as_bytes())?;
    own_files::replace(&out.join(PAGE), html::page(comparison, out).as_bytes())
}

/// A path under the folder of the results, as the page names it.
fn relative<'p>(path: &'p Path, out: &Path) -> std::borrow::Cow<'p, str> {
    path.strip_prefix(out).unwrap_or(path).to_string_lossy()
}

fn shown(number: f64) -> String {
    significant(number, DIGITS).replace('-', "−")
}

fn shown_published(value: &PublishedValue) -> String {
    value.value.map_or_else(|| GAP.into(), shown)
}

fn shown_found(found: &Result<f64, ResultError>) -> String {
    found.as_ref().map_or_else(|_| GAP.into(), |number| shown(*number))
}

/// The relative difference in percent: `+3.2 %`.
fn shown_difference(row: &ComparedRow) -> String {
    let Some(difference) = row.difference() else { return GAP.into() };
    let sign = if difference < 0.0 { "−" } else { "+" };
    format!("{sign}{} %", significant((100.0 * difference).abs(), 2))
}

/// The RMS of a curve's relative differences in percent.
fn shown_rms(row: &CurveRow) -> String {
    row.difference().map_or_else(|| GAP.into(), |rms| format!("{} %", significant(100.0 * rms, 2)))
}
