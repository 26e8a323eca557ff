//! Draws sensitivity indices: those of Sobol' as bars, elementary effects as points of µ* and σ, each with its 95 % interval.

use super::study::StudyFigure;
use super::study_labels::{metric_label, name};
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, Arrangement, LegendEntry};
use crate::report::plot::palette::{GREY, INK, PALE, colour};
use crate::report::plot::svg::{Colour, Font, Svg};
use crate::report::plot::traces::{Traces, circle};
use crate::report::plot::{BROAD, Breadth, LABEL, Picture, TITLE};
use crate::study::Study;
use crate::study::bootstrap::IntervalEstimate;
use crate::study::sensitivity::SensitivityIndices;

const TOP: f64 = 66.0;
const RIGHT: f64 = BROAD - 30.0;
/// Height of the bars of a key, and of its two bars.
const ROW: f64 = 40.0;
const BAR: f64 = 12.0;

/// A key and its indices.
type KeyIndices = (String, Vec<IntervalEstimate>);

/// First order and total.
const TINTS: [Colour; 2] = [colour(2), colour(3)];

/// Draws the indices of a metric. `None` if none can be drawn.
#[must_use]
pub fn draw(study: &Study, sensitivity: &SensitivityIndices) -> Option<StudyFigure> {
    let title = format!("{}: {}", study.name, metric_label(study, sensitivity.metric));
    let column = &sensitivity.column;
    let rows: Vec<KeyIndices> = sensitivity
        .by_key()
        .map(|(key, estimates)| (short(study, key), estimates))
        .filter(|(_, estimates)| estimates.iter().all(is_drawn))
        .collect();
    if rows.is_empty() {
        return None;
    }
    let (mut picture, caption) = if sensitivity.is_of_variance() {
        (bars(&rows), format!("{column}: shares of its variance (Sobol' indices), with 95 % intervals."))
    } else {
        let unit = if sensitivity.unit == "1" { String::new() } else { format!(" ({})", sensitivity.unit) };
        let caption =
            format!("{column}: elementary effects over the whole range of each key, with 95 % intervals of µ*.");
        (effects(&rows, &unit), caption)
    };
    picture.text(&title, (24.0, 20.0), Font::new(TITLE, INK));
    Some(StudyFigure { stem: format!("{column}_sensitivity"), caption, picture: Ok(picture), narrow: None })
}

fn is_drawn(estimate: &IntervalEstimate) -> bool {
    let draws = |value: &f64| Scale::Linear.draws(*value);
    draws(&estimate.value) && estimate.interval_95.iter().all(draws)
}

/// Symbol of a key, with the key where both differ.
fn short(study: &Study, key: &str) -> String {
    let symbol = study.axes.iter().find(|axis| axis.key == key).map_or_else(String::new, |axis| name(study, axis));
    if symbol.is_empty() || key.ends_with(&symbol) { key.into() } else { format!("{key}, {symbol}") }
}

/// For each key a bar of its first-order and one of its total index.
fn bars(rows: &[KeyIndices]) -> Picture {
    let font = Font::new(LABEL, INK);
    let left = 40.0 + rows.iter().map(|(key, _)| font.width(key)).fold(80.0, f64::max);
    let bottom = TOP + ROW * rows.len() as f64;
    let ends = rows.iter().flat_map(|(_, estimates)| estimates.iter().flat_map(|estimate| estimate.interval_95));
    let x = Axis::between("share of the variance", ends.clone().fold(0.0, f64::min), ends.fold(1.0, f64::max));
    let frame = PlotFrame { x, y: Axis::between("", 0.0, 1.0), bounds: (left, TOP, RIGHT.max(left + 200.0), bottom) };
    let mut picture = Picture::new(frame.bounds.2 + 30.0, bottom + 60.0);
    let across = |value: f64| frame.point(value, 0.0).0;
    for tick in frame.x.ticks().0 {
        let at = across(tick).round();
        picture.line([(at, TOP), (at, bottom)], PALE.stroke(1.0));
        picture.text(&frame.x.tick_label(tick), (at, bottom + 9.0), font.centred().below());
    }
    for ((key, estimates), row) in rows.iter().zip(0u32..) {
        let middle = TOP + ROW * (f64::from(row) + 0.5);
        picture.text(key, (left - 12.0, middle), font.ending());
        for ((estimate, tint), top) in estimates.iter().zip(TINTS).zip([middle - BAR, middle]) {
            let [from, to] = [0.0, estimate.value].map(across);
            picture.rectangle((from.min(to), top, from.max(to), top + BAR), tint.fill());
            let y = top + 0.5 * BAR;
            picture.line(estimate.interval_95.map(|end| (across(end), y)), INK.stroke(1.4));
        }
    }
    picture.add(&frame.edges());
    let entries = ["first order: alone", "total: with the others"].into_iter().zip(TINTS);
    let entries: Vec<LegendEntry> = entries.map(|(words, tint)| LegendEntry::mark(words, &square(tint))).collect();
    legend::rows(&mut picture, (24.0, 44.0), BROAD, &entries);
    picture
}

fn square(tint: Colour) -> Svg {
    let mut svg = Svg::default();
    svg.rectangle((-6.0, -6.0, 6.0, 6.0), tint.fill());
    svg
}

/// σ over µ*, with the line σ = µ*: near it and above an effect depends on where the step is taken.
fn effects(rows: &[KeyIndices], unit: &str) -> Picture {
    let [magnitude, deviation] = [1, 2].map(|place| move |(_, estimates): &KeyIndices| estimates[place]);
    let most = |of: &dyn Fn(&KeyIndices) -> f64| rows.iter().map(of).fold(0.0, f64::max);
    let largest = most(&|row| magnitude(row).interval_95[1]).max(most(&|row| deviation(row).value));
    let axis = |label: &str| Axis::around(format!("{label}{unit}"), Scale::Linear, [0.0, largest]);
    let entry =
        |(row, place): (&KeyIndices, usize)| LegendEntry::mark(row.0.as_str(), &circle(4.5, colour(place).fill()));
    let entries: Vec<LegendEntry> = rows.iter().zip(1..).map(entry).collect();
    let places = Arrangement::of(Breadth::Broad, (92.0, 44.0), &entries, 26.0);
    let (x, y) = (axis("µ*, mean magnitude of the effect"), axis("σ of the effect"));
    let frame = PlotFrame { x, y, bounds: places.bounds };
    let mut traces = Traces::new(&frame);
    traces.line([(0.0, 0.0), (largest, largest)], GREY.stroke(1.0).dashed("5 4"));
    for (row, place) in rows.iter().zip(1..) {
        let (x, y, tint) = (magnitude(row), deviation(row).value, colour(place));
        traces.line(x.interval_95.map(|end| (end, y)), tint.stroke(1.4));
        traces.dot((x.value, y), 4.5, tint);
    }
    let mut picture = places.picture();
    picture.panel(&frame, &traces.svg());
    legend::column(&mut picture, places.legend, &entries);
    picture
}
