//! The page: one self-contained file for screen, phone and print.

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, PreEscaped, html};

use super::{GAP, relative, shown, shown_difference, shown_found, shown_published, shown_rms};
use crate::catalogue::{Item, ItemKind};
use crate::claims::{Judgement, Verdict};
use crate::compared::{ComparedItem, ComparedRow, Comparison};
use crate::published::Origin;
use crate::run::command;
use damprig::report::page::document_with_images;
use damprig::report::plot::png_of;

/// Bytes of an SVG above which the page has an image of pixels: a map of many points.
const MAX_SVG: usize = 100_000;

/// Pixels of that image per point: as wide as the page. The file itself, which the caption names, is finer.
const PIXELS_PER_POINT: f32 = 1.0;

/// Makes the page.
pub fn page(comparison: &Comparison, out: &Path) -> String {
    let mut chapters: Vec<String> = comparison.items.iter().map(|compared| compared.item.chapter()).collect();
    chapters.dedup();
    let of = |chapter: &str| {
        let chapter = chapter.to_string();
        comparison.items.iter().filter(move |compared| compared.item.chapter() == chapter)
    };
    let content = html! {
        header {
            h1 { "Figures and tables, computed anew" }
            p.under { (summary(comparison)) }
        }
        nav {
            p { a href="#claims" { "Claims" } }
            @for chapter in &chapters {
                p {
                    "Chapter " (chapter) ": "
                    @for (place, compared) in of(chapter).enumerate() {
                        @if place > 0 { " · " }
                        a href=(format!("#{}", compared.item.name)) title=(compared.item.title) { (compared.item.label()) }
                    }
                }
            }
        }
        @if !comparison.judgements.is_empty() { (claims(&comparison.judgements)) }
        @for chapter in &chapters {
            section {
                h2 { "Chapter " (chapter) }
                @for compared in of(chapter) {
                    (item(compared, comparison, out))
                }
            }
        }
        footer {
            "Made by " (damprig::VERSION_LINE) ". " code { "published.csv" } " and " code { "claims.csv" }
            " beside this page have all numbers, the folders named after the items all results."
        }
    };
    document_with_images("Figures and tables, computed anew", &content)
}

fn summary(comparison: &Comparison) -> String {
    let rows = || comparison.items.iter().flat_map(|compared| &compared.rows);
    let curves: usize = comparison.items.iter().map(|compared| compared.curves.len()).sum();
    let computed = rows().filter(|row| row.computed.is_ok()).count();
    format!(
        "{} items, {} published values, {computed} of them with a computed one beside, {curves} published curves; {} gaps",
        comparison.items.len(),
        rows().filter(|row| row.value.value.is_some()).count(),
        comparison.gaps(),
    )
}

fn class(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Holds => "state good",
        Verdict::DoesNotHold => "state bad",
        Verdict::HoldsOnlyIf(_) | Verdict::NotJudged(_) => "state",
    }
}

fn claims(judgements: &[Judgement]) -> Markup {
    html! {
        section id="claims" {
            h2 { "Claims" }
            div.wide {
                table {
                    thead { tr { th { "" } th.word { "Claim" } th.word { "Verdict" } } }
                    tbody {
                        @for judgement in judgements {
                            tr {
                                td { a href=(format!("#claim-{}", judgement.number)) { (judgement.number) } }
                                td.word { (judgement.claim) }
                                td.word {
                                    span class=(class(&judgement.verdict)) { (judgement.verdict.words()) }
                                    " " (judgement.verdict.detail()) (judgement.without())
                                }
                            }
                        }
                    }
                }
            }
            @for judgement in judgements {
                article id=(format!("claim-{}", judgement.number)) {
                    h3 { "Claim " (judgement.number) ": " (judgement.claim) }
                    p { b { (judgement.words()) } ". " (judgement.reason) }
                    @if !judgement.rule.is_empty() { p.under { "Rule: " (judgement.rule) } }
                    @if !judgement.not_computed.is_empty() {
                        p.under { "Not computed, so not considered: " (judgement.not_computed.join(", ")) }
                    }
                    @if !judgement.numbers.is_empty() {
                        details { summary { (judgement.numbers.len()) " numbers" } (numbers(judgement)) }
                    }
                }
            }
        }
    }
}

fn numbers(judgement: &Judgement) -> Markup {
    html! {
        div.wide {
            table {
                thead { tr { th.word { "Number" } th { "Computed" } th.word { "Unit" } th { "Published" } } }
                tbody {
                    @for number in &judgement.numbers {
                        tr {
                            td.word { (number.label) }
                            td { @if number.value.is_nan() { (GAP) } @else { (shown(number.value)) } }
                            td.word { (number.unit) }
                            td { (number.published.map_or_else(|| GAP.into(), shown)) }
                        }
                    }
                }
            }
        }
    }
}

fn item(compared: &ComparedItem, comparison: &Comparison, out: &Path) -> Markup {
    let item = compared.item;
    let is_computed = compared.parts.iter().any(|(_, figures)| !figures.is_empty())
        || compared.rows.iter().any(|row| row.computed.is_ok());
    html! {
        article id=(item.name) {
            h3 { (item.label()) ": " (item.title) }
            p.under { (item.kind.words()) @if let Some(reason) = &item.reason { ": " (reason) } }
            @if let Some(reading) = &item.reading { p { "Reading: " (reading) } }
            @if !is_computed && item.kind != ItemKind::MeasuredOnly {
                p.note { "Not computed yet: " code { "damprig-thesis " (item.name) } }
            }
            @for (part, figures) in compared.parts.iter().filter(|(part, _)| !part.is_other_reading) {
                @for (place, file) in figures.iter().enumerate() {
                    (figure(file, if place == 0 { part.title.as_str() } else { "" }, out))
                }
            }
            @if !compared.rows.is_empty() { (values(compared)) }
            @if !compared.curves.is_empty() { (curves(compared)) }
            @if compared.parts.iter().any(|(part, figures)| part.is_other_reading && !figures.is_empty()) {
                details {
                    summary { "Figures of the other readings" }
                    ul {
                        @for (part, figures) in compared.parts.iter().filter(|(part, _)| part.is_other_reading) {
                            @for file in figures {
                                li { (part.title) ": " a href=(relative(file, out)) { code { (relative(file, out)) } } }
                            }
                        }
                    }
                }
            }
            @if item.kind != ItemKind::MeasuredOnly { (commands(item, comparison)) }
        }
    }
}

fn figure(file: &Path, caption: &str, out: &Path) -> Markup {
    let name = relative(file, out);
    let svg = std::fs::read_to_string(file);
    let caption = html! { figcaption { @if !caption.is_empty() { (caption) ". " } a href=(name) { code { (name) } } } };
    let svg = match svg {
        Ok(svg) => svg,
        Err(error) => return html! { p.note.bad { (name) ": " (error) } },
    };
    if svg.len() <= MAX_SVG {
        // The drawing escapes its own text.
        return html! { figure { (PreEscaped(svg)) (caption) } };
    }
    match png_of(&svg, PIXELS_PER_POINT, None) {
        Ok(png) => html! {
            figure.picture {
                img alt=(name) src=(format!("data:image/png;base64,{}", STANDARD.encode(png)));
                (caption)
            }
        },
        Err(error) => html! { p.note.bad { (name) ": " (error) } },
    }
}

fn values(compared: &ComparedItem) -> Markup {
    let readings = compared.readings();
    html! {
        div.wide {
            table {
                thead {
                    tr {
                        th.word { "Value" } th { "Published" } th { "Computed" } th { "Difference" }
                        @for part in &readings { th { small { "other reading" } (part.title) } }
                        th.word { "Source" } th.word { "Origin" }
                    }
                }
                tbody {
                    @for row in &compared.rows {
                        tr {
                            td.word { (row.value.label) @if let Some(note) = &row.value.note { br; small { (note) } } }
                            td { (shown_published(row.value)) }
                            (computed(row))
                            td { (shown_difference(row)) }
                            @for part in &readings {
                                @match row.others.iter().find(|(other, _)| other.name == part.name) {
                                    Some((_, found)) => td { (shown_found(found)) },
                                    None => td { (GAP) },
                                }
                            }
                            td.word { (row.value.source) }
                            td.word { (origin(row.value.origin, row.value.is_filled)) }
                        }
                    }
                }
            }
        }
    }
}

/// The computed value, the claim that judges the published one instead, or why there is none.
fn computed(row: &ComparedRow) -> Markup {
    match (&row.computed, row.value.claim) {
        (Err(_), Some(claim)) => html! { td { a href=(format!("#claim-{claim}")) { "claim " (claim) } } },
        (found, _) => html! { td title=[found.as_ref().err().map(ToString::to_string)] { (shown_found(found)) } },
    }
}

fn curves(compared: &ComparedItem) -> Markup {
    let gaps = compared.curves.iter().filter(|row| row.curve.points.is_empty()).count();
    html! {
        details open[gaps < compared.curves.len()] {
            summary { (compared.curves.len()) " published curves" @if gaps > 0 { ", " (gaps) " of them gaps" } }
            div.wide {
                table {
                    thead {
                        tr {
                            th.word { "Curve" } th { "Points" } th { "RMS difference" } th.word { "Source" } th.word { "Origin" }
                        }
                    }
                    tbody {
                        @for row in &compared.curves {
                            tr {
                                td.word { (row.curve.label) }
                                td { @if row.curve.points.is_empty() { (GAP) } @else { (row.curve.points.len()) } }
                                td title=[row.computed.as_ref().err().map(ToString::to_string)] { (shown_rms(row)) }
                                td.word { (row.curve.source) }
                                td.word { (origin(row.curve.origin, row.curve.is_filled)) }
                            }
                        }
                    }
                }
            }
            @if gaps > 0 { p.under { "A gap takes points that someone reads off: " code { "--published FILE" } "." } }
        }
    }
}

fn origin(origin: Origin, is_filled: bool) -> String {
    let filled = if is_filled { ", filled in" } else { "" };
    format!("{}{filled}", origin.name())
}

fn commands(item: &Item, comparison: &Comparison) -> Markup {
    html! {
        details {
            summary { "Commands and parts" }
            p { "In the folder of this page: " code { (comparison.item_command(item)) } ", or part by part:" }
            div.wide {
                table {
                    tbody {
                        @for part in &item.parts {
                            tr {
                                td.word { (part.title) @if part.is_other_reading { " (other reading)" } }
                                td.word { code { (command(part, comparison.files)) } }
                                td.word { a href=(format!("{}/{}/", item.name, part.name)) { "results" } }
                            }
                        }
                    }
                }
            }
        }
    }
}
