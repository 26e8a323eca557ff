//! Finds the computed number that a published value is compared with.

use serde_json::Value;

use super::catalogue::{Catalogue, Item, Part, Work};
use super::published::PublishedValue;
use super::published_curve::PublishedCurve;
use super::results::{ResultError, Results};
use damprig::input::listed;
use damprig::input::section::{FreeKey, FreeValue};
use damprig::report::numbers::significant;
use damprig::study::Study;
use damprig::study::evaluate::main_column;
use damprig::study::table::StudyTable;

/// Relative difference up to which a number of a table is the one that is asked for: the rounding of a grid's values.
const SAME: f64 = 1e-9;

/// Key that selects a case of a part with cases.
const CASE: &str = "case";

/// Key that selects the special points of one kind of a continuation.
const SPECIAL_POINT: &str = "special_point";

/// The number of `quantity` in the row that `value` names, in a part.
///
/// # Errors
/// A part that has not been computed, a row or quantity that is not there or not the only one; says which there are.
pub fn find(
    catalogue: &Catalogue,
    results: &Results,
    item: &Item,
    part: &Part,
    value: &PublishedValue,
) -> Result<f64, ResultError> {
    let Some(quantity) = &value.quantity else {
        return Err(ResultError::Wrong("it is compared with nothing".into()));
    };
    let found = at_row(catalogue, results, item, part, quantity, &value.at)?;
    let Some(below) = &value.below else { return Ok(found) };
    let from = below.part.as_deref().map_or(Some(part), |name| item.part(name));
    let from = from.ok_or_else(|| ResultError::Wrong("there is no part that it is below of".into()))?;
    let from = at_row(catalogue, results, item, from, quantity, &below.at)?;
    Ok(100.0 * (1.0 - found / from))
}

/// The number of `quantity` in a printed row of a part.
fn at_row(
    catalogue: &Catalogue,
    results: &Results,
    item: &Item,
    part: &Part,
    quantity: &str,
    at: &[FreeKey],
) -> Result<f64, ResultError> {
    let (name, at) = (part.name.as_str(), &part.row_for(at)[..]);
    match &part.work {
        Work::Study(file) => {
            let table = results.study(&item.name, name)?;
            let study = Study::read_unchecked(&catalogue.folder.join(file))?;
            let row = best_row(&study, &table, &rows_at(&table, at)?)?;
            // The quantity may be a metric, whose column over several starts is their median.
            let column = study.metrics.iter().find(|metric| metric.name() == quantity);
            let column = column.map_or_else(|| quantity.to_owned(), |metric| main_column(&study, *metric));
            number_in(&table, &column, row)
        }
        Work::Bifurcation(_) => in_table(&results.bifurcation(&item.name, name)?, quantity, at),
        Work::Campaign(_) => largest(&results.points(&item.name, name)?, quantity, at),
        Work::Method(_) => in_table(&results.method(&item.name, name)?, quantity, at),
        Work::Cases(files) => {
            let names = files.iter().map(|file| damprig::simulation::case::default_name(file));
            in_case(results, item, name, quantity, at, names.collect())
        }
        Work::Continuation(_) => in_continuation(&results.continuation(&item.name, name)?, quantity, at),
    }
}

/// The computed curve at the abscissae of a published one, by straight lines between the points of the part's table.
///
/// # Errors
/// As [`find`]; a point outside the computed range has no value (not a number).
pub fn along(
    catalogue: &Catalogue,
    results: &Results,
    item: &Item,
    part: &Part,
    curve: &PublishedCurve,
) -> Result<Vec<f64>, ResultError> {
    let Work::Study(file) = &part.work else { return wrong("only studies have curves") };
    let table = results.study(&item.name, &part.name)?;
    let study = Study::read_unchecked(&catalogue.folder.join(file))?;
    let column = study.metrics.iter().find(|metric| metric.name() == curve.quantity);
    let column = column.map_or_else(|| curve.quantity.clone(), |metric| main_column(&study, *metric));
    let rows = rows_at(&table, &part.row_for(&curve.at))?;
    let columns = (table.column(&curve.over), table.column(&column));
    let (Some(abscissae), Some(values)) = columns else {
        let columns = table.columns();
        let there = listed(columns.iter().map(String::as_str));
        return wrong(format!("there is no column {} or {column}, but {there}", curve.over));
    };
    let mut computed: Vec<(f64, f64)> = rows.iter().map(|row| (abscissae[*row], values[*row])).collect();
    computed.sort_by(|a, b| a.0.total_cmp(&b.0));
    if computed.windows(2).any(|pair| pair[0].0 == pair[1].0) {
        return wrong(format!("several rows have the same {}: `at` must name the other axes", curve.over));
    }
    Ok(curve.points.iter().map(|(at, _)| between(&computed, *at)).collect())
}

/// A value on the straight line between two points of a rising list; not a number outside.
fn between(points: &[(f64, f64)], at: f64) -> f64 {
    if let Some((_, value)) = points.iter().find(|(x, _)| *x == at) {
        return *value;
    }
    let pair = points.windows(2).find(|pair| pair[0].0 < at && at < pair[1].0);
    pair.map_or(f64::NAN, |pair| {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        y0 + (y1 - y0) * (at - x0) / (x1 - x0)
    })
}

fn wrong<T>(text: impl Into<String>) -> Result<T, ResultError> {
    Err(ResultError::Wrong(text.into()))
}

fn in_table(table: &StudyTable, quantity: &str, at: &[FreeKey]) -> Result<f64, ResultError> {
    number_in(table, quantity, only_row(table, at)?)
}

fn number_in(table: &StudyTable, column: &str, row: usize) -> Result<f64, ResultError> {
    let Some(numbers) = table.column(column) else {
        let columns = table.columns();
        return wrong(format!("there is no column {column}, but {}", listed(columns.iter().map(String::as_str))));
    };
    match numbers[row] {
        number if number.is_nan() => wrong(format!("{column} has no value there")),
        number => Ok(number),
    }
}

/// The largest value of some rows: the peak of a frequency response.
fn largest(table: &StudyTable, column: &str, at: &[FreeKey]) -> Result<f64, ResultError> {
    let rows = rows_at(table, at)?;
    let numbers = rows.iter().map(|row| number_in(table, column, *row)).collect::<Result<Vec<f64>, _>>()?;
    Ok(numbers.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

/// Of some rows, the one with the best value of the study's objective.
fn best_row(study: &Study, table: &StudyTable, rows: &[usize]) -> Result<usize, ResultError> {
    if let [only] = rows {
        return Ok(*only);
    }
    let column = main_column(study, study.objective);
    let values = table.column(&column).unwrap_or_default();
    let sound = rows.iter().copied().filter(|row| values.get(*row).is_some_and(|value| !value.is_nan()));
    let best = sound.reduce(|best, next| if study.is_better(values[next], values[best]) { next } else { best });
    best.map_or_else(|| wrong(format!("no row has a value of {column}")), Ok)
}

/// The only row where all columns have these values.
fn only_row(table: &StudyTable, at: &[FreeKey]) -> Result<usize, ResultError> {
    match rows_at(table, at)?[..] {
        [row] => Ok(row),
        ref rows => wrong(format!("{} rows have {}", rows.len(), words(at))),
    }
}

/// The rows where all columns have these values, at least one.
fn rows_at(table: &StudyTable, at: &[FreeKey]) -> Result<Vec<usize>, ResultError> {
    let mut rows: Vec<usize> = (0..table.rows()).collect();
    for FreeKey { key, value, .. } in at {
        let is_there: Option<Vec<bool>> = match value {
            FreeValue::Number(wanted) => {
                let near = |number: &f64| (number - wanted).abs() <= SAME * number.abs().max(wanted.abs());
                table.column(key).map(|numbers| numbers.iter().map(near).collect())
            }
            FreeValue::Word(wanted) => table.words(key).map(|words| words.iter().map(|word| word == wanted).collect()),
        };
        let Some(is_there) = is_there else {
            let columns = table.columns();
            return wrong(format!("there is no such column {key}, but {}", listed(columns.iter().map(String::as_str))));
        };
        rows.retain(|row| is_there[*row]);
    }
    if rows.is_empty() { wrong(format!("no row has {}", words(at))) } else { Ok(rows) }
}

/// A row in words: `particle.clearance_ratio = 5`.
#[must_use]
pub fn words(at: &[FreeKey]) -> String {
    let one = |key: &FreeKey| match &key.value {
        FreeValue::Number(number) => format!("{} = {}", key.key, significant(*number, 9)),
        FreeValue::Word(word) => format!("{} = {word}", key.key),
    };
    at.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// A number of a case's JSON by its path: `summary.rms_x_m`, `case.set_up.tmd.stiffness_n_per_m`, `x_over_z`.
fn in_case(
    results: &Results,
    item: &Item,
    part: &str,
    quantity: &str,
    at: &[FreeKey],
    cases: Vec<String>,
) -> Result<f64, ResultError> {
    let case = match (at, &cases[..]) {
        ([FreeKey { key, value: FreeValue::Word(case), .. }], _) if key == CASE => case,
        ([], [only]) => only,
        _ => return wrong(format!("`at` must name a case: {}", cases.join(", "))),
    };
    if !cases.contains(case) {
        return wrong(format!("there is no case {case:?}, but {}", cases.join(", ")));
    }
    if quantity == "x_over_z" {
        let case = results.case(&item.name, part, case)?;
        return case.x_over_z().map_or_else(|| wrong("the case has no Z, or no whole cycle"), Ok);
    }
    let json = results.case_json(&item.name, part, case)?;
    let found = quantity.split('.').try_fold(&json, |value, key| value.get(key)).and_then(Value::as_f64);
    found.map_or_else(|| wrong(format!("the case has no number {quantity}")), Ok)
}

/// The parameter of the first special point of a kind, or another number of it.
fn in_continuation(json: &Value, quantity: &str, at: &[FreeKey]) -> Result<f64, ResultError> {
    let [FreeKey { key, value: FreeValue::Word(kind), .. }] = at else {
        return wrong("`at` must name a special point: special_point = \"…\"");
    };
    if key != SPECIAL_POINT {
        return wrong(format!("`at` must name a special point, not {key}"));
    }
    let branches = json.get("branches").and_then(Value::as_array).into_iter().flatten();
    let points = branches.filter_map(|branch| branch.get("special_points")?.as_array()).flatten();
    let mut of_kind = points.filter(|point| point.get("kind").and_then(Value::as_str) == Some(kind.as_str()));
    let Some(point) = of_kind.next() else { return wrong(format!("the branches have no special point {kind:?}")) };
    let is_parameter = json.get("parameter").and_then(Value::as_str) == Some(quantity);
    let found = point.get(if is_parameter { "parameter" } else { quantity }).and_then(Value::as_f64);
    found.map_or_else(|| wrong(format!("the special point has no number {quantity}")), Ok)
}
