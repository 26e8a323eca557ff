//! The values that the source document prints, from `published.toml`. A value that is missing is a gap, which a user can fill with a
//! file of the same format.

use std::path::Path;

use super::catalogue::{Catalogue, Item, Part};
use super::keys::{published as root_keys, value as keys};
use super::published_curve::{self, PublishedCurve};
use damprig::failure::Failure;
use damprig::input::section::{FreeKey, Number};
use damprig::input::{Section, Source, Span, near};

/// Name of the file with the published values.
pub const PUBLISHED: &str = "published.toml";

/// Title of a problem with the file as a whole.
const NOT_TOML: &str = "this is not TOML";

/// How the source document got a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Computed.
    Computed,
    /// Measured.
    Measured,
}

impl Origin {
    pub(super) const ALL: [Self; 2] = [Self::Computed, Self::Measured];

    /// As files write it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Computed => "computed",
            Self::Measured => "measured",
        }
    }
}

/// A published value, or the gap where one could be.
#[derive(Clone, Debug, PartialEq)]
pub struct PublishedValue {
    /// Name of the item.
    pub item: String,
    /// Short label, unique within the item.
    pub label: String,
    /// How the document got it.
    pub origin: Origin,
    /// Where it is printed.
    pub source: String,
    /// The value, in the unit of the quantity; `None` for a gap.
    pub value: Option<f64>,
    /// Whether a user's file filled it.
    pub is_filled: bool,
    /// The column that it is compared with, if there is one.
    pub quantity: Option<String>,
    /// The row: columns and their values.
    pub at: Vec<FreeKey>,
    /// Name of the part that it is compared with; the first part without one.
    pub part: Option<String>,
    /// The row that it is a reduction from, in per cent; `None` if it is the quantity itself.
    pub below: Option<Below>,
    /// Number of the claim that judges it, if it is not compared by itself.
    pub claim: Option<u32>,
    /// What is to be known about it.
    pub note: Option<String>,
}

/// The row that a published reduction is measured from.
#[derive(Clone, Debug, PartialEq)]
pub struct Below {
    /// Name of its part; that of the value without one.
    pub part: Option<String>,
    /// The row: columns and their values.
    pub at: Vec<FreeKey>,
}

/// All published values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Published {
    /// The values, in the order of the file.
    pub values: Vec<PublishedValue>,
    /// The curves, in the order of the file.
    pub curves: Vec<PublishedCurve>,
}

impl Published {
    /// Reads `published.toml` in the catalogue's folder.
    ///
    /// # Errors
    /// Lists all problems of the file, an unknown item or part among them.
    pub fn read(catalogue: &Catalogue) -> Result<Self, Failure> {
        let source = Source::read(&catalogue.folder.join(PUBLISHED))?;
        let mut all = Self::default();
        source.read_toml(source.text(), NOT_TOML, |root| {
            for s in &root.tables_of(&root_keys::VALUE) {
                let Some(value) = shipped(s, catalogue) else { continue };
                if all.of(&value.item).any(|other| other.label == value.label) {
                    s.reject("label", "another value of this item has this label", None);
                }
                all.values.push(value);
            }
            for s in &root.tables_of(&root_keys::CURVE) {
                let Some(curve) = published_curve::shipped(s, catalogue) else { continue };
                if all.curves_of(&curve.item).any(|other| other.label == curve.label) {
                    s.reject("label", "another curve of this item has this label", None);
                }
                all.curves.push(curve);
            }
            Some(())
        });
        source.verdict()?;
        Ok(all)
    }

    /// Fills gaps with the values and curves of a user's file. Of each it needs item, label and value, or abscissae and values; the rest
    /// stays as it is in the gap.
    ///
    /// # Errors
    /// Lists all problems of the file: an unknown item or label, a value that the document prints otherwise.
    pub fn fill(&mut self, file: &Path) -> Result<(), Failure> {
        let source = Source::read(file)?;
        source.read_toml(source.text(), NOT_TOML, |root| {
            for s in &root.tables_of(&root_keys::VALUE) {
                if let Some((place, value)) = filling(s, &self.values) {
                    let gap = &mut self.values[place];
                    if gap.is_filled {
                        s.reject("label", "another value of this file has this label", None);
                    }
                    (gap.value, gap.is_filled) = (Some(value), true);
                }
            }
            for s in &root.tables_of(&root_keys::CURVE) {
                if let Some((place, points)) = published_curve::filling(s, &self.curves) {
                    let gap = &mut self.curves[place];
                    if gap.is_filled {
                        s.reject("label", "another curve of this file has this label", None);
                    }
                    (gap.points, gap.is_filled) = (points, true);
                }
            }
            Some(())
        });
        source.verdict()
    }

    /// The values of an item.
    pub fn of<'a>(&'a self, item: &'a str) -> impl Iterator<Item = &'a PublishedValue> {
        self.values.iter().filter(move |value| value.item == item)
    }

    /// The curves of an item.
    pub fn curves_of<'a>(&'a self, item: &'a str) -> impl Iterator<Item = &'a PublishedCurve> {
        self.curves.iter().filter(move |curve| curve.item == item)
    }

    /// The value with this label; `None` for a gap, or without such a label.
    #[must_use]
    pub fn value(&self, item: &str, label: &str) -> Option<f64> {
        self.of(item).find(|value| value.label == label)?.value
    }
}

/// What a value says of itself.
struct Written {
    item: String,
    item_span: Span,
    label: String,
    label_span: Span,
    value: Option<Number>,
}

fn written(s: &Section) -> Option<Written> {
    let (item, label) = (s.text_of(&keys::ITEM), s.text_of(&keys::LABEL));
    let value = s.placed(&keys::VALUE);
    let (item, label) = (item?, label?);
    Some(Written { item: item.value, item_span: item.span, label: label.value, label_span: label.span, value })
}

/// A value of the shipped file.
fn shipped(s: &Section, catalogue: &Catalogue) -> Option<PublishedValue> {
    let written = written(s);
    let (origin, from) = (s.word(&keys::ORIGIN), s.text_of(&keys::SOURCE));
    let quantity = s.text_of(&keys::QUANTITY);
    let at = s.table_of(&keys::AT, None).map(|at| at.free_keys());
    let (part, note) = (s.text_of(&keys::PART), s.text_of(&keys::NOTE));
    let (below, below_part) = (s.table_of(&keys::BELOW, None).map(|at| at.free_keys()), s.text_of(&keys::BELOW_PART));
    let claim = s.scalar(&keys::CLAIM).map(|number| number as u32);
    s.finish();
    let written = written?;
    let item = item_named(s, catalogue, (&written.item, &written.item_span))?;
    for (key, part) in [("part", &part), ("below_part", &below_part)] {
        if let Some(part) = part
            && item.part(&part.value).is_none()
        {
            let names = item.parts.iter().map(|part| part.name.as_str());
            refuse_name(s, key, (&part.value, &part.span), names, "must be the name of a part of the item");
            return None;
        }
    }
    let (Some(origin), Some(from)) = (origin, from) else {
        s.reject("item", "`origin` and `source` say how the document got its value and where", None);
        return None;
    };
    Some(PublishedValue {
        item: written.item,
        label: written.label,
        origin: Origin::ALL[origin],
        source: from.value,
        value: written.value.map(|number| number.value),
        is_filled: false,
        quantity: quantity.map(|text| text.value),
        at: at.unwrap_or_default(),
        part: part.map(|text| text.value),
        below: below.map(|at| Below { part: below_part.map(|part| part.value), at }),
        claim,
        note: note.map(|text| text.value),
    })
}

/// A value of a user's file: the gap that it fills.
fn filling(s: &Section, values: &[PublishedValue]) -> Option<(usize, f64)> {
    let written = written(s);
    // A copy of the shipped file may state these.
    let (_, _, _, _) =
        (s.word(&keys::ORIGIN), s.text_of(&keys::SOURCE), s.text_of(&keys::QUANTITY), s.text_of(&keys::PART));
    let _ =
        (s.text_of(&keys::NOTE), s.scalar(&keys::CLAIM), s.text_of(&keys::BELOW_PART), s.table_of(&keys::BELOW, None));
    let _ = s.table_of(&keys::AT, None);
    s.finish();
    let written = written?;
    let names: Vec<(&str, &str)> = values.iter().map(|value| (value.item.as_str(), value.label.as_str())).collect();
    let item = (written.item.as_str(), &written.item_span);
    let place = place_of(s, item, (&written.label, &written.label_span), &names, "value")?;
    // A gap that stays one.
    let number = written.value?;
    match values[place].value {
        Some(there) if !values[place].is_filled && there != number.value => {
            let help = Some("leave it out: only values that are missing can be filled in".into());
            s.refuse("value", &number.span, format!("the document prints {there}"), help);
            None
        }
        Some(there) if there == number.value => None,
        _ => Some((place, number.value)),
    }
}

/// The item of a name; refuses one that is not there.
pub(super) fn item_named<'c>(s: &Section, catalogue: &'c Catalogue, name: (&str, &Span)) -> Option<&'c Item> {
    let item = catalogue.items.iter().find(|item| item.name == name.0);
    if item.is_none() {
        let names = catalogue.items.iter().map(|item| item.name.as_str());
        refuse_name(s, "item", name, names, "must be the name of an item");
    }
    item
}

/// The place of an item's label among all; refuses names that are not there. `what` is published of them.
pub(super) fn place_of(
    s: &Section,
    item: (&str, &Span),
    label: (&str, &Span),
    all: &[(&str, &str)],
    what: &str,
) -> Option<usize> {
    let of_item = || all.iter().filter(|(name, _)| *name == item.0);
    if of_item().next().is_none() {
        refuse_name(s, "item", item, all.iter().map(|(name, _)| *name), &format!("has no published {what}"));
        return None;
    }
    let place = all.iter().position(|names| *names == (item.0, label.0));
    if place.is_none() {
        let labels = of_item().map(|(_, label)| *label);
        refuse_name(s, "label", label, labels, &format!("is not the label of a published {what} of this item"));
    }
    place
}

/// Refuses a name and suggests the nearest.
pub(super) fn refuse_name<'n>(
    s: &Section,
    key: &'static str,
    (name, span): (&str, &Span),
    names: impl IntoIterator<Item = &'n str>,
    allowed: &str,
) {
    let help = near(name, names).first().map(|near| format!("did you mean {near:?}?"));
    s.refuse(key, span, allowed, help);
}

/// The part that a value is compared with; `None` for an item without parts.
#[must_use]
pub fn compared_part<'a>(item: &'a Item, value: &PublishedValue) -> Option<&'a Part> {
    match &value.part {
        Some(name) => item.part(name),
        None => item.parts.first(),
    }
}
