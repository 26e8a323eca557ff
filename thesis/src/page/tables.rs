//! The tables for other programs: a row for each published value and reading, for each point of a published
//! curve, and for each number behind a claim.

use crate::compared::Comparison;
use crate::found::words;

fn number(number: Option<f64>) -> String {
    number.filter(|number| !number.is_nan()).map_or_else(String::new, |number| number.to_string())
}

/// A row for each published value and each reading that it is compared with.
pub fn published(comparison: &Comparison) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(Vec::new());
    writer.write_record([
        "item",
        "label",
        "origin",
        "source",
        "quantity",
        "unit",
        "row",
        "published",
        "is_filled",
        "part",
        "reading",
        "computed",
        "relative_difference",
        "missing",
    ])?;
    for compared in &comparison.items {
        for row in &compared.rows {
            let main = row.part.map_or("", |part| part.name.as_str());
            let readings = std::iter::once((main, "main", &row.computed))
                .chain(row.others.iter().map(|(part, found)| (part.name.as_str(), "other", found)));
            for (part, reading, found) in readings {
                let value = row.value;
                let computed = found.as_ref().ok().copied();
                let difference = value.value.filter(|value| *value != 0.0).zip(computed).map(|(p, c)| c / p - 1.0);
                let missing = found.as_ref().err().map_or_else(String::new, ToString::to_string);
                writer.write_record([
                    value.item.as_str(),
                    &value.label,
                    value.origin.name(),
                    &value.source,
                    value.quantity.as_deref().unwrap_or(""),
                    row.unit(),
                    &words(&value.at),
                    &number(value.value),
                    if value.is_filled { "true" } else { "false" },
                    part,
                    reading,
                    &number(computed),
                    &number(difference),
                    &missing,
                ])?;
            }
        }
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// A row for each point of the published curves.
pub fn curves(comparison: &Comparison) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(Vec::new());
    let columns =
        ["item", "label", "origin", "source", "part", "quantity", "over", "row", "abscissa", "published", "computed"];
    writer.write_record(columns)?;
    for row in comparison.items.iter().flat_map(|compared| &compared.curves) {
        let curve = row.curve;
        for (place, (abscissa, value)) in curve.points.iter().enumerate() {
            let computed = row.computed.as_ref().ok().and_then(|computed| computed.get(place).copied());
            writer.write_record([
                curve.item.as_str(),
                &curve.label,
                curve.origin.name(),
                &curve.source,
                &curve.part,
                &curve.quantity,
                &curve.over,
                &words(&curve.at),
                &abscissa.to_string(),
                &value.to_string(),
                &number(computed),
            ])?;
        }
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// A row for each number behind a claim; one row for a claim without numbers.
pub fn claims(comparison: &Comparison) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(Vec::new());
    writer.write_record([
        "number",
        "claim",
        "verdict",
        "detail",
        "rule",
        "reason",
        "label",
        "value",
        "unit",
        "published",
    ])?;
    for judgement in &comparison.judgements {
        let mut row = |label: &str, value: Option<f64>, unit: &str, published: Option<f64>| {
            writer.write_record([
                judgement.number.to_string().as_str(),
                &judgement.claim,
                judgement.verdict.words(),
                judgement.verdict.detail(),
                &judgement.rule,
                &judgement.reason,
                label,
                &number(value),
                unit,
                &number(published),
            ])
        };
        if judgement.numbers.is_empty() {
            row("", None, "", None)?;
        }
        for number in &judgement.numbers {
            row(&number.label, Some(number.value), number.unit, number.published)?;
        }
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}
