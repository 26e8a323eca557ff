//! The page as Markdown, for a thesis of one's own or a version control system: the figures are files beside it.

use std::path::Path;

use super::{GAP, relative, shown, shown_difference, shown_found, shown_published, shown_rms};
use crate::catalogue::ItemKind;
use crate::claims::Judgement;
use crate::compared::{ComparedItem, Comparison};
use crate::run::command;

/// The text.
pub fn text(comparison: &Comparison, out: &Path) -> String {
    let mut text = format!("# Figures and tables, computed anew\n{}\n", damprig::VERSION_LINE);
    if !comparison.judgements.is_empty() {
        text.push_str("\n## Claims\n| | claim | verdict |\n|---|---|---|\n");
        for judgement in &comparison.judgements {
            let Judgement { number, claim, .. } = judgement;
            text.push_str(&format!("| {number} | {} | {} |\n", cell(claim), cell(&judgement.words())));
        }
        comparison.judgements.iter().for_each(|judgement| add_claim(judgement, &mut text));
    }
    let mut chapter = String::new();
    for compared in &comparison.items {
        if compared.item.chapter() != chapter {
            chapter = compared.item.chapter();
            text.push_str(&format!("\n## Chapter {chapter}\n"));
        }
        add_item(compared, comparison, out, &mut text);
    }
    text
}

fn add_claim(judgement: &Judgement, text: &mut String) {
    let Judgement { number, claim, rule, numbers, reason, not_computed, .. } = judgement;
    text.push_str(&format!("\n### Claim {number}: {claim}\n{}. {reason}\n", judgement.words()));
    if !rule.is_empty() {
        text.push_str(&format!("\nRule: {rule}\n"));
    }
    if !not_computed.is_empty() {
        text.push_str(&format!("\nNot computed, so not considered: {}.\n", not_computed.join(", ")));
    }
    if !numbers.is_empty() {
        text.push_str("\n| number | computed | unit | published |\n|---|---:|---|---:|\n");
        for number in numbers {
            let value = if number.value.is_nan() { GAP.into() } else { shown(number.value) };
            let published = number.published.map_or_else(|| GAP.into(), shown);
            text.push_str(&format!("| {} | {value} | {} | {published} |\n", cell(&number.label), number.unit));
        }
    }
}

fn add_item(compared: &ComparedItem, comparison: &Comparison, out: &Path, text: &mut String) {
    let item = compared.item;
    text.push_str(&format!("\n### {}: {}\n", item.label(), item.title));
    text.push_str(&format!("{}.", item.kind.words()));
    if let Some(reason) = &item.reason {
        text.push_str(&format!(" {reason}."));
    }
    text.push('\n');
    if let Some(reading) = &item.reading {
        text.push_str(&format!("\nReading: {reading}\n"));
    }
    for (part, figures) in compared.parts.iter().filter(|(part, _)| !part.is_other_reading) {
        for figure in figures {
            text.push_str(&format!("\n![{}]({})\n", part.title, relative(figure, out)));
        }
    }
    if !compared.rows.is_empty() {
        add_values(compared, text);
    }
    if !compared.curves.is_empty() {
        add_curves(compared, text);
    }
    if item.kind != ItemKind::MeasuredOnly {
        text.push_str(&format!("\nIn the folder of this file:\n```sh\n{}\n", comparison.item_command(item)));
        for part in &item.parts {
            let command = command(part, comparison.files);
            if !command.is_empty() {
                text.push_str(&format!("{command}    # {}\n", part.title));
            }
        }
        text.push_str("```\n");
    }
}

fn add_values(compared: &ComparedItem, text: &mut String) {
    let readings = compared.readings();
    text.push_str("\n| value | source | origin | published | computed | difference |");
    readings.iter().for_each(|part| text.push_str(&format!(" {} |", cell(&part.title))));
    text.push_str("\n|---|---|---|---:|---:|---:|");
    readings.iter().for_each(|_| text.push_str("---:|"));
    text.push('\n');
    for row in &compared.rows {
        let value = row.value;
        text.push_str(&format!(
            "| {} | {} | {} | {} | {} | {} |",
            cell(&value.label),
            cell(&value.source),
            value.origin.name(),
            shown_published(value),
            match (&row.computed, value.claim) {
                (Err(_), Some(claim)) => format!("claim {claim}"),
                (found, _) => shown_found(found),
            },
            shown_difference(row)
        ));
        for part in &readings {
            let found = row.others.iter().find(|(other, _)| other.name == part.name);
            text.push_str(&format!(" {} |", found.map_or_else(|| GAP.into(), |(_, found)| shown_found(found))));
        }
        text.push('\n');
    }
}

fn add_curves(compared: &ComparedItem, text: &mut String) {
    text.push_str("\n| published curve | source | origin | points | RMS difference |\n|---|---|---|---:|---:|\n");
    for row in &compared.curves {
        let curve = row.curve;
        let points = if curve.points.is_empty() { GAP.into() } else { curve.points.len().to_string() };
        let (label, source) = (cell(&curve.label), cell(&curve.source));
        text.push_str(&format!("| {label} | {source} | {} | {points} | {} |\n", curve.origin.name(), shown_rms(row)));
    }
}

/// A text within a table's cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}
