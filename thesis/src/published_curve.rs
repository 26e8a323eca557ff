//! The curves of the source document's figures, from `published.toml`: gaps, until a user's file has points that were read off.

use super::catalogue::{Catalogue, Part, Work};
use super::keys::curve as keys;
use super::published::{Origin, item_named, place_of, refuse_name};
use damprig::input::key::KeyedQuantity;
use damprig::input::section::{FreeKey, Given};
use damprig::input::{Number, Section};

/// A published curve, or the gap where its points could be.
#[derive(Clone, Debug, PartialEq)]
pub struct PublishedCurve {
    /// Name of the item.
    pub item: String,
    /// Short label, unique within the item.
    pub label: String,
    /// How the document got it.
    pub origin: Origin,
    /// Where it is printed.
    pub source: String,
    /// Name of the part, a study, that it is compared with.
    pub part: String,
    /// The metric that it shows.
    pub quantity: String,
    /// Key of the axis that is its abscissa.
    pub over: String,
    /// The other axes and their values.
    pub at: Vec<FreeKey>,
    /// Abscissa and value of its points, rising; empty for a gap.
    pub points: Vec<(f64, f64)>,
    /// Whether a user's file filled it.
    pub is_filled: bool,
}

/// A curve of the shipped file.
pub(super) fn shipped(s: &Section, catalogue: &Catalogue) -> Option<PublishedCurve> {
    let (item, label) = (s.text_of(&keys::ITEM), s.text_of(&keys::LABEL));
    let (origin, from) = (s.word(&keys::ORIGIN), s.text_of(&keys::SOURCE));
    let (part, quantity) = (s.text_of(&keys::PART), s.text_of(&keys::QUANTITY));
    let (over, at) = (s.text_of(&keys::OVER), s.table_of(&keys::AT, None).map(|at| at.free_keys()));
    let points = points(s);
    s.finish();
    let (name, label) = (item?, label?);
    let item = item_named(s, catalogue, (&name.value, &name.span))?;
    let (Some(origin), Some(from), Some(part), Some(quantity), Some(over)) = (origin, from, part, quantity, over)
    else {
        let what =
            "`origin`, `source`, `part`, `quantity` and `over` say what the curve is and what it is compared with";
        s.reject("item", what, None);
        return None;
    };
    let is_study = |part: &&Part| matches!(part.work, Work::Study(_));
    if item.part(&part.value).filter(is_study).is_none() {
        let names = item.parts.iter().filter(is_study).map(|part| part.name.as_str());
        refuse_name(s, "part", (&part.value, &part.span), names, "must be the name of a study of the item");
        return None;
    }
    Some(PublishedCurve {
        item: name.value,
        label: label.value,
        origin: Origin::ALL[origin],
        source: from.value,
        part: part.value,
        quantity: quantity.value,
        over: over.value,
        at: at.unwrap_or_default(),
        points: points?,
        is_filled: false,
    })
}

/// A curve of a user's file: the gap that it fills, and the points.
pub(super) fn filling(s: &Section, curves: &[PublishedCurve]) -> Option<(usize, Vec<(f64, f64)>)> {
    let (item, label) = (s.text_of(&keys::ITEM), s.text_of(&keys::LABEL));
    let points = points(s);
    // A copy of the shipped file may state these.
    let _ = (s.word(&keys::ORIGIN), s.text_of(&keys::SOURCE), s.text_of(&keys::PART), s.text_of(&keys::QUANTITY));
    let _ = (s.text_of(&keys::OVER), s.table_of(&keys::AT, None));
    s.finish();
    let (item, label) = (item?, label?);
    let names: Vec<(&str, &str)> = curves.iter().map(|curve| (curve.item.as_str(), curve.label.as_str())).collect();
    let place = place_of(s, (&item.value, &item.span), (&label.value, &label.span), &names, "curve")?;
    // A gap that stays one, or a copy of what is printed.
    let points = points.filter(|points| !points.is_empty() && *points != curves[place].points)?;
    if !curves[place].points.is_empty() && !curves[place].is_filled {
        let help = Some("leave it out: only curves that are missing can be filled in".into());
        s.reject("abscissae", "the document has other points of this curve", help);
        return None;
    }
    Some((place, points))
}

/// The points, sorted; none if both lists are left out.
fn points(s: &Section) -> Option<Vec<(f64, f64)>> {
    let list = |quantity: &KeyedQuantity| match s.given(quantity) {
        Some((_, Given::Numbers(numbers))) => numbers,
        _ => Vec::new(),
    };
    let (abscissae, values): (Vec<Number>, Vec<Number>) = (list(&keys::ABSCISSAE), list(&keys::VALUES));
    if abscissae.len() != values.len() {
        let what = format!("must be as long as `abscissae`: {}, and not {}", abscissae.len(), values.len());
        s.reject(if values.is_empty() { "abscissae" } else { "values" }, what, None);
        return None;
    }
    let mut points: Vec<(f64, f64)> = abscissae.iter().zip(&values).map(|(x, y)| (x.value, y.value)).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    Some(points)
}
