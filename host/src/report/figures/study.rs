//! The figures of a study: for each metric a map over two axes, curves over one, or the drawn points.

use super::curves::SpecialCurve;
use super::study_curves::{self, Curve, CurveLabels, Mark};
use super::study_labels::{label, metric_label, metric_meaning, name};
use super::study_map::{self, MapAxis, StudyMap};
use crate::continuation::FoundBranches;
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::report::numbers::significant;
use crate::report::plot::{Breadth, Picture};
use crate::study::Study;
use crate::study::axis::{AxisValue, StudyAxis};
use crate::study::evaluate::main_column;
use crate::study::table::{MIN_OF_MAP, StudyTable, numbers};

/// Most curves of a figure.
const MAX_CURVES: usize = 12;

/// A figure of a study.
#[derive(Debug)]
pub struct StudyFigure {
    /// Name of its file, without extension.
    pub stem: String,
    /// Caption.
    pub caption: String,
    /// The figure, or why it could not be drawn.
    pub picture: Result<Picture, Failure>,
    /// The narrow figure, of curves.
    pub narrow: Option<Picture>,
}

/// A drawn figure, and a narrow one if it is of curves.
type DrawnFigure = (Result<Picture, Failure>, Option<Picture>);

/// Published points to be drawn over the curves of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct PublishedPoints {
    /// Axes and their values; an axis that is not among them may have any.
    pub at: Vec<(String, AxisValue)>,
    /// Key of the axis that is the abscissa of `points`.
    pub over: String,
    /// Abscissa and value.
    pub points: Vec<(f64, f64)>,
    /// Measured, and not computed.
    pub is_measured: bool,
}

/// Draws the figure of the objective with points over its curves. `None` where that figure is no curve over the points' axis.
#[must_use]
pub fn draw_with(
    study: &Study,
    table: &StudyTable,
    best: Option<u64>,
    published: &[PublishedPoints],
) -> Option<StudyFigure> {
    let [x, ..] = grids(study)[..] else { return None };
    let is_shown = |points: &&PublishedPoints| points.over == study.axes[x].key;
    let published: Vec<PublishedPoints> = published.iter().filter(is_shown).cloned().collect();
    if published.is_empty() || is_map(study) || has_drawn_axis(study) {
        return None;
    }
    draw_metric(study, table, best, &[], &published, study.objective)
}

/// Draws the figures of all metrics; none of a metric without values. `best`: row of the best point. `overlays`: what the study's
/// overlays found.
#[must_use]
pub fn draw(study: &Study, table: &StudyTable, best: Option<u64>, overlays: &[FoundBranches]) -> Vec<StudyFigure> {
    study.metrics.iter().filter_map(|metric| draw_metric(study, table, best, overlays, &[], *metric)).collect()
}

/// Whether a study is drawn over two of its axes.
fn is_map(study: &Study) -> bool {
    matches!(&grids(study)[..], [_, b, ..] if study.axes[*b].count() >= MIN_OF_MAP)
}

fn has_drawn_axis(study: &Study) -> bool {
    study.points.kept().iter().any(|place| study.axes[*place].is_scattered())
}

/// Kept axes that are grids of at least two numbers, the longest first.
fn grids(study: &Study) -> Vec<usize> {
    let count = |place: &usize| study.axes[*place].count();
    let mut places: Vec<usize> =
        study.points.kept().iter().copied().filter(|p| numbers(study, *p).is_some() && count(p) > 1).collect();
    // Equally long ones stay in the order of the file.
    places.sort_by_key(|place| std::cmp::Reverse(count(place)));
    places
}

fn draw_metric(
    study: &Study,
    table: &StudyTable,
    best: Option<u64>,
    overlays: &[FoundBranches],
    published: &[PublishedPoints],
    metric: Quantity,
) -> Option<StudyFigure> {
    let column = main_column(study, metric);
    let values = table.column(&column).filter(|values| values.iter().any(|value| !value.is_nan()))?;
    let sheet = Sheet { study, table, metric, values, column, best, overlays, published };
    let ((picture, narrow), caption) = match &grids(study)[..] {
        _ if has_drawn_axis(study) => sheet.drawn_points(),
        [a, b, ..] if is_map(study) => sheet.map(*a.min(b), *a.max(b)),
        [a, rest @ ..] => sheet.curves(*a, rest.first().copied()),
        [] => return None,
    };
    Some(StudyFigure { stem: metric.name().into(), caption, picture, narrow })
}

fn drawn(curves: &[Curve], labels: &CurveLabels) -> DrawnFigure {
    let [broad, narrow] = [Breadth::Broad, Breadth::Narrow].map(|breadth| study_curves::draw(curves, labels, breadth));
    (Ok(broad), Some(narrow))
}

struct Sheet<'a> {
    study: &'a Study,
    table: &'a StudyTable,
    metric: Quantity,
    values: Vec<f64>,
    column: String,
    best: Option<u64>,
    overlays: &'a [FoundBranches],
    published: &'a [PublishedPoints],
}

impl Sheet<'_> {
    fn axis(&self, place: usize) -> &StudyAxis {
        &self.study.axes[place]
    }

    /// The values of all axes in a row.
    fn at(&self, row: u64) -> Vec<AxisValue> {
        self.study.points.values(&self.study.axes, row, 0)
    }

    fn number(values: &[AxisValue], place: usize) -> f64 {
        if let AxisValue::Number(number) = values[place] { number } else { f64::NAN }
    }

    /// The row that a slice goes through: the best one, or the first.
    fn through(&self) -> u64 {
        self.best.unwrap_or(0)
    }

    /// Kept axes other than these, with their values in the row that the slice goes through.
    fn others(&self, shown: &[usize]) -> Vec<(usize, AxisValue)> {
        let there = self.at(self.through());
        let kept = self.study.points.kept().iter().filter(|place| !shown.contains(place));
        kept.map(|place| (*place, there[*place].clone())).collect()
    }

    fn words(&self, others: &[(usize, AxisValue)]) -> String {
        let word = |(place, value): &(usize, AxisValue)| {
            let axis = self.axis(*place);
            let value = match value {
                AxisValue::Number(number) => significant(*number, 5),
                AxisValue::Word(word) => word.clone(),
            };
            format!("{} = {value} {}", name(self.study, axis), axis.unit()).trim_end().to_string()
        };
        others.iter().map(word).collect::<Vec<_>>().join(", ")
    }

    fn title(&self, others: &[(usize, AxisValue)]) -> String {
        let words = self.words(others);
        if words.is_empty() { self.study.name.clone() } else { format!("{}: {words}", self.study.name) }
    }

    /// The best point's text, if this is the figure of the objective.
    fn best_words(&self) -> Option<(u64, String)> {
        let row = self.best.filter(|_| self.metric == self.study.objective)?;
        let what = if self.study.is_maximum { "largest" } else { "smallest" };
        Some((row, format!("{what}: {}", significant(self.values[row as usize], 5))))
    }

    fn value_label(&self) -> String {
        let label = metric_label(self.study, self.metric);
        match &self.study.ensemble {
            None => label,
            Some(ensemble) => format!("{label} – {} over the starts", ensemble.over.name()),
        }
    }

    /// Rows of the slice over these axes: where each value of the axes is.
    fn slice(&self, shown: &[usize]) -> Vec<u64> {
        let others = self.others(shown);
        let is_in = |row: &u64| {
            let values = self.at(*row);
            others.iter().all(|(place, value)| values[*place] == *value)
        };
        (0..self.values.len() as u64).filter(is_in).collect()
    }

    fn map(&self, x: usize, y: usize) -> (DrawnFigure, String) {
        let others = self.others(&[x, y]);
        let rising = |place: usize| {
            let mut values = numbers(self.study, place).unwrap_or_default().to_vec();
            values.sort_by(f64::total_cmp);
            values.dedup();
            values
        };
        let map_axis = |place: usize| MapAxis {
            label: label(self.study, self.axis(place)),
            values: rising(place),
            is_log: self.axis(place).is_log,
        };
        let (across, up) = (map_axis(x), map_axis(y));
        let (columns, cells) = (across.values.len(), across.values.len() * up.values.len());
        let find = |axis: &MapAxis, value: f64| axis.values.iter().position(|v| *v == value).unwrap_or(0);
        let mut values = vec![f64::NAN; cells];
        let marks: Vec<(&str, Vec<bool>)> = [
            ("differs from cycle to cycle by more than 1 %", self.table.varies(self.study)),
            ("depends on the start by more than 1 %", self.table.depends_on_start(self.study, self.metric)),
        ]
        .into_iter()
        .filter_map(|(words, marks)| Some((words, marks?)))
        .collect();
        let mut marked: Vec<(String, Vec<bool>)> =
            marks.iter().map(|(words, _)| ((*words).to_string(), vec![false; cells])).collect();
        for row in self.slice(&[x, y]) {
            let there = self.at(row);
            let cell = find(&up, Self::number(&there, y)) * columns + find(&across, Self::number(&there, x));
            values[cell] = self.values[row as usize];
            for ((_, cells), (_, rows)) in marked.iter_mut().zip(&marks) {
                cells[cell] = rows[row as usize];
            }
        }
        let best = self.best_words().map(|(row, words)| {
            let there = self.at(row);
            ((Self::number(&there, x), Self::number(&there, y)), words)
        });
        let title = self.title(&others);
        let curves = self.curves_over(x);
        let mut caption = format!(
            "{}: {}, as computed at each point; lines of equal value.",
            self.column,
            metric_meaning(self.study, self.metric)
        );
        if !curves.is_empty() {
            caption.push_str(" Black: where a periodic motion changes; docs/CONTINUE.md has the names.");
        }
        let map = StudyMap { title, x: across, y: up, label: self.value_label(), values, marked, curves, best };
        ((study_map::draw(&map), None), caption)
    }

    /// The curves of the overlays, with this axis as abscissa.
    fn curves_over(&self, x: usize) -> Vec<SpecialCurve> {
        let is_swapped = |found: &FoundBranches| found.parameter != self.axis(x).key;
        self.overlays.iter().flat_map(|found| SpecialCurve::all(found, is_swapped(found))).collect()
    }

    /// Curves over `x`, one for each combination of the other axes. If these are too many: through the best point, one for each value
    /// of `next`.
    fn curves(&self, x: usize, next: Option<usize>) -> (DrawnFigure, String) {
        let is_all = self.values.len() / self.axis(x).count() <= MAX_CURVES;
        let varied = self.study.points.kept().iter().copied().filter(|place| self.axis(*place).count() > 1);
        let shown: Vec<usize> = if is_all { varied.collect() } else { [x].into_iter().chain(next).collect() };
        let fixed = self.others(&shown);
        // Neighbouring seeds have nothing to do with each other.
        let is_scattered = self.axis(x).key.ends_with(".seed");
        let mut curves: Vec<(Vec<(usize, AxisValue)>, Curve)> = Vec::new();
        let quantiles = self.study.ensemble.as_ref().map(|_| {
            ["min", "max"].map(|end| self.table.column(&format!("{}_{end}", self.metric.name())).unwrap_or_default())
        });
        for row in self.slice(&shown) {
            let there = self.at(row);
            let others = shown.iter().filter(|place| **place != x);
            let others: Vec<(usize, AxisValue)> = others.map(|place| (*place, there[*place].clone())).collect();
            let known = curves.iter().position(|(of, _)| *of == others);
            let known = known.unwrap_or_else(|| {
                let label = self.words(&others);
                curves.push((others, Curve { label, is_scattered, ..Curve::default() }));
                curves.len() - 1
            });
            let at = Self::number(&there, x);
            curves[known].1.points.push((at, self.values[row as usize]));
            if let Some([low, high]) = &quantiles {
                curves[known].1.band.push((at, low[row as usize], high[row as usize]));
            }
        }
        let mut marks = Vec::new();
        for published in self.published {
            let place = curves
                .iter()
                .position(|(others, _)| others.iter().chain(&fixed).all(|other| self.is_at(published, other)));
            let Some(place) = place else { continue };
            marks.extend(published.points.iter().map(|at| Mark {
                at: *at,
                curve: place,
                is_measured: published.is_measured,
            }));
        }
        let mut curves: Vec<Curve> = curves.into_iter().map(|(_, curve)| curve).collect();
        for curve in &mut curves {
            curve.points.sort_by(|a, b| a.0.total_cmp(&b.0));
            curve.band.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let best =
            self.best_words().map(|(row, words)| ((Self::number(&self.at(row), x), self.values[row as usize]), words));
        let others = if curves.len() == 1 { self.others(&[x]) } else { fixed };
        let labels = CurveLabels {
            title: self.title(&others),
            x: label(self.study, self.axis(x)),
            is_log: self.axis(x).is_log,
            y: self.value_label(),
            best,
            marks,
        };
        let band =
            if quantiles.is_some() { "; the band is from the smallest to the largest over the starts" } else { "" };
        (drawn(&curves, &labels), format!("{}: {}{band}.", self.column, metric_meaning(self.study, self.metric)))
    }

    /// Whether points belong to a value of an axis.
    fn is_at(&self, published: &PublishedPoints, (place, value): &(usize, AxisValue)) -> bool {
        let there = published.at.iter().find(|(key, _)| *key == self.axis(*place).key);
        there.is_none_or(|(_, wanted)| match (wanted, value) {
            // As printed: the value of a grid is rounded.
            (AxisValue::Number(a), AxisValue::Number(b)) => (a - b).abs() <= 1e-9 * a.abs().max(b.abs()),
            _ => wanted == value,
        })
    }

    /// The value over the first drawn axis.
    fn drawn_points(&self) -> (DrawnFigure, String) {
        let is_drawn = |place: &&usize| self.axis(**place).is_scattered();
        let x = self.study.points.kept().iter().find(is_drawn).copied().unwrap_or(0);
        let point = |row: u64| (Self::number(&self.at(row), x), self.values[row as usize]);
        let points = (0..self.values.len() as u64).map(point).collect();
        let curve = Curve { points, is_scattered: true, ..Curve::default() };
        let best = self.best_words().map(|(row, words)| (point(row), words));
        let labels = CurveLabels {
            title: self.study.name.clone(),
            x: label(self.study, self.axis(x)),
            is_log: self.axis(x).is_log,
            y: self.value_label(),
            best,
            marks: Vec::new(),
        };
        let caption = format!("{}: {}, of all points.", self.column, metric_meaning(self.study, self.metric));
        (drawn(&[curve], &labels), caption)
    }
}
