//! Draws published points over the computed curves of studies.

use std::path::Path;

use super::catalogue::{Catalogue, Item, Part, Work};
use super::published::{Origin, Published, PublishedValue, compared_part};
use super::results::Results;
use damprig::failure::Failure;
use damprig::input::section::{FreeKey, FreeValue};
use damprig::report::figures::study::{PublishedPoints, draw_with};
use damprig::run_folder::own_files;
use damprig::study::Study;
use damprig::study::axis::AxisValue;

/// Name of the figure with published points, beside those of the study.
pub const WITH_PUBLISHED: &str = "published.svg";

/// Draws the figures of all parts that have published points; removes those of parts that have none any more.
///
/// # Errors
/// A file that cannot be written or removed.
pub fn draw(catalogue: &Catalogue, published: &Published, results: &Results) -> Result<(), Failure> {
    for item in &catalogue.items {
        for part in &item.parts {
            let file = results.part(&item.name, &part.name).join(WITH_PUBLISHED);
            match figure(catalogue, published, results, item, part) {
                Some(svg) => own_files::replace(&file, svg.as_bytes())?,
                None => remove(&file)?,
            }
        }
    }
    Ok(())
}

fn remove(file: &Path) -> Result<(), Failure> {
    match std::fs::remove_file(file) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(Failure::cannot("remove", file, error)),
        _ => Ok(()),
    }
}

/// The figure of a part with its published points; `None` without points, or for a part that is no curve or not computed.
fn figure(catalogue: &Catalogue, published: &Published, results: &Results, item: &Item, part: &Part) -> Option<String> {
    let Work::Study(file) = &part.work else { return None };
    let points = points_of(published, item, part);
    if points.is_empty() {
        return None;
    }
    let study = Study::read_unchecked(&catalogue.folder.join(file)).ok()?;
    let table = results.study(&item.name, &part.name).ok()?;
    let is_shown = |quantity: &str| quantity == study.objective.name();
    let points: Vec<PublishedPoints> =
        points.into_iter().filter(|(quantity, _)| is_shown(quantity)).map(|(_, points)| points).collect();
    draw_with(&study, &table, None, &points)?.picture.ok().map(|picture| picture.svg())
}

/// Quantity and points of the values and curves that are compared with a part.
fn points_of(published: &Published, item: &Item, part: &Part) -> Vec<(String, PublishedPoints)> {
    let curves = published.curves_of(&item.name).filter(|curve| curve.part == part.name && !curve.points.is_empty());
    let of_curves = curves.map(|curve| {
        let points = PublishedPoints {
            at: pairs(&part.row_for(&curve.at)),
            over: curve.over.clone(),
            points: curve.points.clone(),
            is_measured: curve.origin == Origin::Measured,
        };
        (curve.quantity.clone(), points)
    });
    let is_here = |of: &Part| of.name == part.name || item.other_readings(of).any(|other| other.name == part.name);
    let values = published
        .of(&item.name)
        .filter(|value| value.below.is_none() && compared_part(item, value).is_some_and(is_here));
    let of_values = values.flat_map(|value| over_each_key(value, part));
    of_curves.chain(of_values).collect()
}

/// A value as a point over each axis of its row: which of them the figure is drawn over is not known here.
fn over_each_key(value: &PublishedValue, part: &Part) -> Vec<(String, PublishedPoints)> {
    let (Some(number), Some(quantity)) = (value.value, &value.quantity) else { return Vec::new() };
    let at = pairs(&part.row_for(&value.at));
    let point = |(key, place): &(String, AxisValue)| {
        let AxisValue::Number(place) = place else { return None };
        let points = PublishedPoints {
            at: at.iter().filter(|(other, _)| other != key).cloned().collect(),
            over: key.clone(),
            points: vec![(*place, number)],
            is_measured: value.origin == Origin::Measured,
        };
        Some((quantity.clone(), points))
    };
    at.iter().filter_map(point).collect()
}

fn pairs(at: &[FreeKey]) -> Vec<(String, AxisValue)> {
    let value = |value: &FreeValue| match value {
        FreeValue::Number(number) => AxisValue::Number(*number),
        FreeValue::Word(word) => AxisValue::Word(word.clone()),
    };
    at.iter().map(|key| (key.key.clone(), value(&key.value))).collect()
}
