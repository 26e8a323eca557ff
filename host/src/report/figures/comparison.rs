//! Draws a run beside its simulations: X/Z over frequency with uncertainties and normalised errors, x over time with its residual and
//! impacts, and the phase plane.

use crate::compare::{ComparedExperiment, ComparedPoint, PointHistory, PredictedQuantity, UncertainValue};
use crate::quantity::Quantity;
use crate::report::plot::axis::{Axis, PlotFrame, Scale, length_unit};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{GREY, MARKED, colour};
use crate::report::plot::svg::{Colour, Svg};
use crate::report::plot::traces::{PointerValue, Traces, bar_low};
use crate::report::plot::{BROAD, Breadth, Picture};

const LEFT: f64 = 82.0;
const RIGHT: f64 = 24.0;
const TOP: f64 = 52.0;
const TALL: f64 = 340.0;
const LOW: f64 = 150.0;
const GAP: f64 = 74.0;

/// A figure shows one set-up; colours tell what was measured, predicted, and predicted on the ideal base.
const MEASURED: Colour = colour(0);
const PREDICTED: Colour = colour(3);
const IDEAL: Colour = colour(1);

/// Width of the lines in the legend, points.
const SAMPLE: f64 = 3.0;

/// Most cycles of the phase plane that are drawn, as readings.
const PHASE_READINGS: usize = 2000;

fn panels(x: &Axis, upper: Axis, lower: Axis, wide: f64) -> (PlotFrame, PlotFrame, Picture) {
    let (right, middle, below) = (wide - RIGHT, TOP + TALL, TOP + TALL + GAP);
    let upper = PlotFrame { x: x.clone(), y: upper, bounds: (LEFT, TOP, right, middle) };
    let lower = PlotFrame { x: x.clone(), y: lower, bounds: (LEFT, below, right, below + LOW) };
    (upper, lower, Picture::new(wide, below + LOW + 64.0))
}

/// A measured value with its predictions, at a frequency.
struct Plotted<'a> {
    frequency_hz: f64,
    measured: UncertainValue,
    predicted: Option<&'a PredictedQuantity>,
    ideal: Option<&'a PredictedQuantity>,
}

fn plotted(experiment: &ComparedExperiment, metric: Quantity) -> Vec<Plotted<'_>> {
    let of = |point: &'_ ComparedPoint| point.frequency_hz;
    let mut all: Vec<Plotted> = experiment
        .points
        .iter()
        .filter_map(|point| {
            let own = point.metric(metric)?;
            // Where the measured base is missing, the ideal one decides.
            let ideal = own.on_ideal_base.as_ref().filter(|_| own.on_measured_base.is_some());
            Some(Plotted { frequency_hz: of(point)?, measured: own.measured, predicted: own.predicted(), ideal })
        })
        .collect();
    all.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    all
}

/// X/Z (cycle maxima) over frequency, measured and predicted with their expanded uncertainties, and the normalised error below.
#[must_use]
pub fn response(experiment: &ComparedExperiment, breadth: Breadth) -> Picture {
    let points = plotted(experiment, Quantity::XOverZ);
    let predicted = || points.iter().filter_map(|p| Some((p.frequency_hz, p.predicted?.value)));
    let ideal: Vec<(f64, UncertainValue)> =
        points.iter().filter_map(|p| Some((p.frequency_hz, p.ideal?.value))).collect();
    let errors: Vec<(f64, f64)> =
        points.iter().filter_map(|p| Some((p.frequency_hz, p.predicted?.normalised_error))).collect();
    let x = Axis::around("Frequency (Hz)", Scale::Linear, points.iter().map(|p| p.frequency_hz));
    let ends = |value: &UncertainValue| [low(value), value.value, value.value + value.expanded];
    let values = points.iter().flat_map(|p| ends(&p.measured)).chain(predicted().flat_map(|(_, value)| ends(&value)));
    let y = Axis::around("X/Z (cycle maxima)", Scale::Log, values.chain(ideal.iter().map(|(_, value)| value.value)));
    let error_axis = Axis::around("Normalised error E_n", Scale::Linear, errors.iter().map(|e| e.1).chain([-1.5, 1.5]));
    let (upper, lower, mut picture) = panels(&x, y, error_axis, breadth.width());
    let measured: Vec<(f64, UncertainValue)> = points.iter().map(|p| (p.frequency_hz, p.measured)).collect();
    let predicted: Vec<(f64, UncertainValue)> = predicted().collect();
    // Where both predictions are equal, the ideal one is seen beside the other.
    let curves = [(2, "on the ideal base", &ideal), (1, "predicted", &predicted), (0, "measured", &measured)];
    let mut inside = Svg::default();
    curves.into_iter().for_each(|(place, label, values)| inside.add(&values_of(&upper, place, label, values)));
    picture.live_panel(&upper, &inside);
    picture.live_panel(&lower, &errors_of(&lower, &errors));
    let entries = [("measured, ± U", MEASURED), ("predicted, band ± U", PREDICTED)];
    let entries = entries.into_iter().chain((!ideal.is_empty()).then_some(("on the ideal base", IDEAL)));
    let entry =
        |(place, (words, tint)): (usize, (&str, Colour))| LegendEntry::line(words, tint.stroke(SAMPLE)).of_curve(place);
    let at = if breadth == Breadth::Broad { (LEFT, 22.0) } else { (14.0, 12.0) };
    legend::rows(&mut picture, at, breadth.width(), &entries.enumerate().map(entry).collect::<Vec<_>>());
    picture
}

/// A curve of the upper panel, by its place in the legend: what was measured, predicted, or predicted on the ideal base.
fn values_of(frame: &PlotFrame, place: usize, label: &str, values: &[(f64, UncertainValue)]) -> Svg {
    let ends = |value: &UncertainValue| [low(value), value.value, value.value + value.expanded];
    let is_drawn = |(f, value): &&(f64, UncertainValue)| ends(value).into_iter().all(|end| frame.draws(*f, end));
    let values: Vec<(f64, UncertainValue)> = values.iter().filter(is_drawn).copied().collect();
    let ranges = || values.iter().map(|(f, value)| (*f, low(value), value.value + value.expanded));
    let mut traces = Traces::new(frame);
    let line = || values.iter().map(|(f, value)| (*f, value.value));
    match place {
        0 => {
            for (f, value) in &values {
                traces.bar((*f, value.value), value.expanded, MEASURED);
                traces.dot((*f, value.value), 4.0, MEASURED);
            }
        }
        1 => {
            traces.band(&ranges().collect::<Vec<_>>(), PREDICTED);
            traces.line(line(), PREDICTED.stroke(1.4));
        }
        _ => traces.line(line(), IDEAL.stroke(3.2)),
    }
    let shown = ranges().zip(&values).map(|((x, low, high), (_, value))| PointerValue {
        x,
        value: value.value,
        range: Some((low, high)),
    });
    traces.curve(place, label, &shown.collect::<Vec<_>>())
}

/// The normalised errors, and lines at −1, 0 and 1.
fn errors_of(frame: &PlotFrame, errors: &[(f64, f64)]) -> Svg {
    let mut traces = Traces::new(frame);
    for limit in [-1.0, 0.0, 1.0] {
        traces.line([frame.x.from, frame.x.to].map(|f| (f, limit)), GREY.stroke(if limit == 0.0 { 0.6 } else { 1.2 }));
    }
    let errors: Vec<&(f64, f64)> = errors.iter().filter(|(f, error)| frame.draws(*f, *error)).collect();
    for (f, error) in &errors {
        let tint = if error.abs() <= 1.0 { PREDICTED } else { MARKED };
        traces.line([(*f, 0.0), (*f, *error)], tint.stroke(2.0));
        traces.dot((*f, *error), 4.0, tint);
    }
    let shown = errors.iter().map(|(x, value)| PointerValue { x: *x, value: *value, range: None });
    // It is in no legend.
    traces.curve(errors.len() + 3, "E_n", &shown.collect::<Vec<_>>())
}

/// The lower end of a value's interval; above 0, for a logarithmic axis.
fn low(value: &UncertainValue) -> f64 {
    bar_low(Scale::Log, value.value, value.expanded)
}

fn largest(points: &[(f64, f64)]) -> f64 {
    points.iter().map(|p| p.1.abs()).fold(0.0, f64::max)
}

/// x over time, measured and simulated, with the impacts of both, and the residual below.
#[must_use]
pub fn time_history(history: &PointHistory) -> Picture {
    let at = |n: usize| history.from_s + n as f64 / history.rate_hz;
    let timed =
        |x_m: &[f32]| -> Vec<(f64, f64)> { x_m.iter().enumerate().map(|(n, x)| (at(n), f64::from(*x))).collect() };
    let (measured, simulated) = (timed(&history.measured_m), timed(&history.simulated_m));
    let residual: Vec<(f64, f64)> = measured.iter().zip(&simulated).map(|(m, s)| (m.0, m.1 - s.1)).collect();
    let until = at(measured.len().max(simulated.len()).max(2) - 1);
    let x = Axis::between("Time after the start of the measurement (s)", history.from_s, until);
    let (name, scale) = length_unit(largest(&measured).max(largest(&simulated)));
    let (rest_name, rest_scale) = length_unit(largest(&residual));
    let scaled = |points: &[(f64, f64)], scale: f64| points.iter().map(|(t, v)| (*t, v * scale)).collect::<Vec<_>>();
    let (measured, simulated, residual) =
        (scaled(&measured, scale), scaled(&simulated, scale), scaled(&residual, rest_scale));
    let both = measured.iter().chain(&simulated).map(|p| 1.08 * p.1);
    let y = Axis::around(format!("x ({name})"), Scale::Linear, both);
    let rest = residual.iter().map(|p| p.1).chain([0.0]);
    let rest = Axis::around(format!("Residual ({rest_name})"), Scale::Linear, rest);
    let (upper, lower, mut picture) = panels(&x, y, rest, BROAD);
    let base = if history.on_measured_base { "simulated on the measured base" } else { "simulated on the ideal base" };
    let has_impacts = !history.measured_impacts.is_empty() || !history.simulated_impacts.is_empty();
    let impacts = has_impacts.then_some(("impacts: measured at the top, simulated at the bottom", MARKED));
    head(&mut picture, !measured.is_empty(), base, impacts);
    let mut traces = Traces::new(&upper);
    traces.history(&measured, MEASURED.stroke(2.2));
    traces.history(&simulated, PREDICTED.stroke(1.1));
    for (impacts, edge, inwards) in
        [(&history.measured_impacts, upper.y.to, 14.0), (&history.simulated_impacts, upper.y.from, -14.0)]
    {
        let mut tick = Svg::default();
        tick.line([(0.0, 0.0), (0.0, inwards)], MARKED.stroke(1.6));
        impacts.iter().for_each(|(t_s, _)| traces.mark((*t_s, edge), &tick));
    }
    picture.panel(&upper, &traces.svg());
    if !residual.is_empty() {
        let mut traces = Traces::new(&lower);
        traces.history(&residual, MEASURED.stroke(1.1));
        picture.panel(&lower, &traces.svg());
    }
    picture
}

/// The legend above a history or a phase plane.
fn head(picture: &mut Picture, is_measured: bool, simulated: &str, also: Option<(&str, Colour)>) {
    let measured = is_measured.then_some(("measured", MEASURED));
    let all = measured.into_iter().chain([(simulated, PREDICTED)]).chain(also);
    let entries: Vec<LegendEntry> = all.map(|(words, tint)| LegendEntry::line(words, tint.stroke(SAMPLE))).collect();
    legend::rows(picture, (LEFT, 22.0), f64::INFINITY, &entries);
}

/// Velocity over displacement, measured and simulated, of the last readings.
#[must_use]
pub fn phase_plane(history: &PointHistory) -> Picture {
    const SIDE: f64 = 460.0;
    let orbit = |x_m: &[f32]| -> Vec<(f64, f64)> {
        let last = &x_m[x_m.len().saturating_sub(PHASE_READINGS)..];
        let rate = 0.5 * history.rate_hz;
        last.windows(3).map(|three| (f64::from(three[1]), rate * f64::from(three[2] - three[0]))).collect()
    };
    let (measured, simulated) = (orbit(&history.measured_m), orbit(&history.simulated_m));
    let both = || measured.iter().chain(&simulated);
    let (name, scale) = length_unit(both().map(|p| p.0.abs()).fold(0.0, f64::max));
    let frame = PlotFrame {
        x: Axis::around(format!("x ({name})"), Scale::Linear, both().map(|p| p.0 * scale)),
        y: Axis::around("x′ (mm/s)", Scale::Linear, both().map(|p| p.1 * 1e3)),
        bounds: (LEFT, TOP, LEFT + SIDE + 40.0, TOP + SIDE),
    };
    let mut traces = Traces::new(&frame);
    for (points, style) in [(&measured, MEASURED.stroke(2.2)), (&simulated, PREDICTED.stroke(1.1))] {
        traces.line(points.iter().map(|(x, v)| (x * scale, v * 1e3)), style);
    }
    let mut picture = Picture::new(LEFT + SIDE + 64.0, TOP + SIDE + 64.0);
    head(&mut picture, !measured.is_empty(), "simulated", None);
    picture.panel(&frame, &traces.svg());
    picture
}
