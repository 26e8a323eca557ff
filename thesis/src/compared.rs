//! Sets the published values beside the computed ones, item by item.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::catalogue::{Catalogue, Item, ItemKind, Part, Work};
use super::claims::Judgement;
use super::files::FOLDER;
use super::found::{along, find, words};
use super::marked::WITH_PUBLISHED;
use super::published::{Published, PublishedValue, compared_part};
use super::published_curve::PublishedCurve;
use super::results::{ResultError, Results};
use super::run::{OVERLAYS, command};
use damprig::input::key::KeyUnit;
use damprig::study::Study;

/// A published value beside what was computed.
#[derive(Clone, Debug)]
pub struct ComparedRow<'a> {
    /// The published value, or its gap.
    pub value: &'a PublishedValue,
    /// The part that it is compared with; `None` for an item that is not computed, or a value without quantity.
    pub part: Option<&'a Part>,
    /// The computed number, or why there is none.
    pub computed: Result<f64, ResultError>,
    /// The number in the other readings of that part.
    pub others: Vec<(&'a Part, Result<f64, ResultError>)>,
}

impl ComparedRow<'_> {
    /// Symbol of the unit; empty for a plain number.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        if self.value.below.is_some() {
            return "%";
        }
        self.value.quantity.as_deref().and_then(KeyUnit::of).map_or("", |unit| unit.symbol)
    }

    /// Computed less published over published; `None` without both, or for a published 0.
    #[must_use]
    pub fn difference(&self) -> Option<f64> {
        let (published, computed) = (self.value.value?, self.computed.as_ref().ok()?);
        (published != 0.0).then(|| computed / published - 1.0)
    }
}

/// A published curve beside what was computed.
#[derive(Clone, Debug)]
pub struct CurveRow<'a> {
    /// The published curve, or its gap.
    pub curve: &'a PublishedCurve,
    /// The computed values at its abscissae, not a number outside the computed range; or why there are none.
    pub computed: Result<Vec<f64>, ResultError>,
}

impl CurveRow<'_> {
    /// RMS of the relative differences of its points; `None` without one.
    #[must_use]
    pub fn difference(&self) -> Option<f64> {
        let computed = self.computed.as_ref().ok()?;
        let pairs =
            self.curve.points.iter().zip(computed).filter(|((_, value), computed)| *value != 0.0 && !computed.is_nan());
        let squares: Vec<f64> = pairs.map(|((_, value), computed)| (computed / value - 1.0).powi(2)).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}

/// An item with its published values and figures.
#[derive(Clone, Debug)]
pub struct ComparedItem<'a> {
    /// The item.
    pub item: &'a Item,
    /// Its published values.
    pub rows: Vec<ComparedRow<'a>>,
    /// Its published curves.
    pub curves: Vec<CurveRow<'a>>,
    /// Its parts, with the files of their figures (SVG), none of a part that has not been computed.
    pub parts: Vec<(&'a Part, Vec<PathBuf>)>,
}

impl<'a> ComparedItem<'a> {
    /// The other readings that any of its rows has, in the order of the parts.
    #[must_use]
    pub fn readings(&self) -> Vec<&'a Part> {
        let has =
            |part: &&Part| self.rows.iter().any(|row| row.others.iter().any(|(other, _)| other.name == part.name));
        self.item.parts.iter().filter(has).collect()
    }
}

/// Everything that the page shows.
#[derive(Clone, Debug)]
pub struct Comparison<'a> {
    /// The items, in order.
    pub items: Vec<ComparedItem<'a>>,
    /// The claims.
    pub judgements: Vec<Judgement>,
    /// Folder of the files, as commands name it.
    pub files: &'a Path,
}

impl<'a> Comparison<'a> {
    /// Reads the results of some items.
    #[must_use]
    pub fn of(
        catalogue: &'a Catalogue,
        published: &'a Published,
        results: &Results,
        items: &[&'a Item],
        judgements: Vec<Judgement>,
        files: &'a Path,
    ) -> Self {
        let compared = |item: &&'a Item| {
            let item: &'a Item = item;
            let rows = published.values.iter().filter(|value| value.item == item.name);
            ComparedItem {
                item,
                rows: rows.map(|value| row(catalogue, results, item, value)).collect(),
                curves: published
                    .curves_of(&item.name)
                    .map(|curve| curve_row(catalogue, results, item, curve))
                    .collect(),
                parts: item.parts.iter().map(|part| (part, figures(catalogue, results, item, part))).collect(),
            }
        };
        Self { items: items.iter().map(compared).collect(), judgements, files }
    }

    /// The command that computes an item anew, in the folder of the results.
    #[must_use]
    pub fn item_command(&self, item: &Item) -> String {
        let files = match self.files == Path::new(FOLDER) {
            true => String::new(),
            false => format!(" --files {}", self.files.display()),
        };
        format!("damprig-thesis {} --out .{files}", item.name)
    }

    /// Published values and curves that are missing.
    #[must_use]
    pub fn gaps(&self) -> usize {
        let of = |compared: &ComparedItem| {
            compared.rows.iter().filter(|row| row.value.value.is_none()).count()
                + compared.curves.iter().filter(|row| row.curve.points.is_empty()).count()
        };
        self.items.iter().map(of).sum()
    }

    /// As JSON: what was computed, with its readings, and the verdicts.
    #[must_use]
    pub fn json(&self) -> Value {
        let number = |found: &Result<f64, ResultError>| match found {
            Ok(number) => json!({ "value": number }),
            Err(error) => json!({ "value": null, "missing": error.to_string() }),
        };
        let row = |row: &ComparedRow| {
            let others = row.others.iter().map(|(part, found)| (part.name.clone(), number(found)));
            json!({
                "label": row.value.label,
                "origin": row.value.origin.name(),
                "source": row.value.source,
                "quantity": row.value.quantity,
                "unit": row.unit(),
                "at": words(&row.value.at),
                "published": row.value.value,
                "is_filled": row.value.is_filled,
                "claim": row.value.claim,
                "part": row.part.map(|part| &part.name),
                "computed": number(&row.computed),
                "other_readings": others.collect::<serde_json::Map<_, _>>(),
            })
        };
        let curve = |row: &CurveRow| {
            json!({
                "label": row.curve.label,
                "origin": row.curve.origin.name(),
                "source": row.curve.source,
                "part": row.curve.part,
                "quantity": row.curve.quantity,
                "over": row.curve.over,
                "at": words(&row.curve.at),
                "is_filled": row.curve.is_filled,
                "published": row.curve.points,
                "computed": row.computed.as_ref().ok(),
            })
        };
        let item = |compared: &ComparedItem| {
            let item = compared.item;
            let parts = item.parts.iter().map(|part| {
                json!({
                    "name": part.name,
                    "title": part.title,
                    "other_reading": part.is_other_reading,
                    "command": command(part, self.files),
                })
            });
            json!({
                "name": item.name,
                "title": item.title,
                "kind": item.kind.name(),
                "reason": item.reason,
                "reading": item.reading,
                "parts": parts.collect::<Vec<_>>(),
                "values": compared.rows.iter().map(row).collect::<Vec<_>>(),
                "curves": compared.curves.iter().map(curve).collect::<Vec<_>>(),
            })
        };
        json!({
            "version": damprig::VERSION_LINE,
            "items": self.items.iter().map(item).collect::<Vec<_>>(),
            "claims": self.judgements,
        })
    }
}

fn row<'a>(catalogue: &Catalogue, results: &Results, item: &'a Item, value: &'a PublishedValue) -> ComparedRow<'a> {
    let part = compared_part(item, value).filter(|_| value.quantity.is_some());
    let Some(part) = part else {
        let why = match value.claim {
            _ if item.kind == ItemKind::MeasuredOnly => "measured only: the item is not computed".into(),
            Some(claim) => format!("claim {claim} judges it"),
            None => "it is compared with nothing".into(),
        };
        return ComparedRow { value, part: None, computed: Err(ResultError::Wrong(why)), others: Vec::new() };
    };
    let look = |part: &Part| find(catalogue, results, item, part, value);
    let others = item.other_readings(part).filter(|other| other.name != part.name);
    ComparedRow {
        value,
        part: Some(part),
        computed: look(part),
        others: others.map(|other| (other, look(other))).collect(),
    }
}

fn curve_row<'a>(catalogue: &Catalogue, results: &Results, item: &Item, curve: &'a PublishedCurve) -> CurveRow<'a> {
    let missing = || ResultError::Wrong(format!("there is no part {}", curve.part));
    let part = item.part(&curve.part).ok_or_else(missing);
    CurveRow { curve, computed: part.and_then(|part| along(catalogue, results, item, part, curve)) }
}

/// The figures of a part, by name; of a study that of its objective, with the published points if it has them.
fn figures(catalogue: &Catalogue, results: &Results, item: &Item, part: &Part) -> Vec<PathBuf> {
    let folder = results.part(&item.name, &part.name);
    if let Work::Study(file) = &part.work
        && let Ok(study) = Study::read_unchecked(&catalogue.folder.join(file))
    {
        let with_points = folder.join(WITH_PUBLISHED);
        if with_points.is_file() {
            return vec![with_points];
        }
        let file = folder.join(format!("{}.svg", study.objective.name()));
        return if file.is_file() { vec![file] } else { Vec::new() };
    }
    if matches!(part.work, Work::Cases(_)) {
        let overlays = OVERLAYS.iter().map(|stem| folder.join(format!("{stem}.svg")));
        return overlays.filter(|file| file.is_file()).collect();
    }
    let folder = if matches!(part.work, Work::Campaign(_)) { folder.join(super::results::RUN) } else { folder };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    // The motion at every peak of a campaign has more than a page can show.
    let is_shown = |path: &PathBuf| path.extension().is_some_and(|e| e == "svg") && !path.ends_with("motions.svg");
    let mut files: Vec<PathBuf> = entries.filter(is_shown).collect();
    files.sort();
    files
}
