//! Draws a run beside its simulations: X/Z over frequency with uncertainties and normalised errors, x over time with its residual and
//! impacts, and the phase plane.

use plotters::element::{PathElement, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor, ShapeStyle};

use super::axis::{Axis, Frame, Scale};
use super::time_histories::thinned;
use super::traces::{PointerValue, Traces, bar_low};
use super::{BROAD, Breadth, Canvas, FINE, FigureError, GREY, INK, NARROW, Picture, colour, text, width};
use crate::compare::{ComparedExperiment, ComparedPoint, History, Predicted, Uncertain};
use crate::quantity::Quantity;

const LEFT: i32 = 82;
const RIGHT: i32 = BROAD - 24;
const TOP: i32 = 52;
const TALL: i32 = 340;
const LOW: i32 = 150;
const GAP: i32 = 74;

/// Most cycles of the phase plane that are drawn, as readings.
const PHASE_READINGS: usize = 2000;

fn measured_colour() -> RGBColor {
    colour(0)
}

fn predicted_colour() -> RGBColor {
    colour(3)
}

fn ideal_colour() -> RGBColor {
    colour(1)
}

fn impact_colour() -> RGBColor {
    colour(5)
}

fn draw_path(canvas: &Canvas, path: Vec<(i32, i32)>, style: impl Into<ShapeStyle>) -> Result<(), FigureError> {
    canvas.draw(&PathElement::new(path, style)).map_err(FigureError::of)
}

/// Words with a line of their colour each, in a row above the first panel.
fn legend(canvas: &Canvas, entries: &[(&str, RGBColor)]) -> Result<(), FigureError> {
    let mut left = LEFT;
    for (words, tint) in entries {
        legend_entry(canvas, (left, 22), words, *tint)?;
        left += 34 + width(&text(13.0, INK), words) + 28;
    }
    Ok(())
}

fn legend_entry(canvas: &Canvas, (left, y): (i32, i32), words: &str, tint: RGBColor) -> Result<(), FigureError> {
    draw_path(canvas, vec![(left, y), (left + 26, y)], tint.stroke_width(3))?;
    let style = text(13.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
    canvas.draw(&Text::new(words.to_string(), (left + 34, y), style)).map_err(FigureError::of)
}

fn panels(x: &Axis, upper: Axis, lower: Axis, right: i32) -> (Frame, Frame, i32) {
    let (middle, below) = (TOP + TALL, TOP + TALL + GAP);
    let upper = Frame { x: x.clone(), y: upper, bounds: (LEFT, TOP, right, middle) };
    let lower = Frame { x: x.clone(), y: lower, bounds: (LEFT, below, right, below + LOW) };
    (upper, lower, below + LOW + 64)
}

/// A measured value with its predictions, at a frequency.
struct Plotted<'a> {
    frequency_hz: f64,
    measured: Uncertain,
    predicted: Option<&'a Predicted>,
    ideal: Option<&'a Predicted>,
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
///
/// # Errors
/// The drawing library's error.
pub fn response(experiment: &ComparedExperiment, breadth: Breadth) -> Result<Picture, FigureError> {
    let points = plotted(experiment, Quantity::XOverZ);
    let predicted = || points.iter().filter_map(|p| Some((p.frequency_hz, p.predicted?.value)));
    let ideal: Vec<(f64, Uncertain)> = points.iter().filter_map(|p| Some((p.frequency_hz, p.ideal?.value))).collect();
    let errors: Vec<(f64, f64)> =
        points.iter().filter_map(|p| Some((p.frequency_hz, p.predicted?.normalised_error))).collect();
    let x = Axis::around("Frequency (Hz)", Scale::Linear, points.iter().map(|p| p.frequency_hz));
    let ends = |value: &Uncertain| [low(value), value.value, value.value + value.expanded];
    let values = points.iter().flat_map(|p| ends(&p.measured)).chain(predicted().flat_map(|(_, value)| ends(&value)));
    let y = Axis::around("X/Z (cycle maxima)", Scale::Log, values.chain(ideal.iter().map(|(_, value)| value.value)));
    let error_axis = Axis::around("Normalised error E_n", Scale::Linear, errors.iter().map(|e| e.1).chain([-1.5, 1.5]));
    let wide = if breadth == Breadth::Broad { BROAD } else { NARROW };
    let (upper, lower, height) = panels(&x, y, error_axis, wide - (BROAD - RIGHT));
    let entries = [("measured, ± U", measured_colour()), ("predicted, band ± U", predicted_colour())];
    let entries = entries.into_iter().chain((!ideal.is_empty()).then_some(("on the ideal base", ideal_colour())));
    let measured: Vec<(f64, Uncertain)> = points.iter().map(|p| (p.frequency_hz, p.measured)).collect();
    let predicted: Vec<(f64, Uncertain)> = predicted().collect();
    // Where both predictions are equal, the ideal one is seen beside the other.
    let curves = [(2, "on the ideal base", &ideal), (1, "predicted", &predicted), (0, "measured", &measured)];
    let curves: String = curves.map(|(place, label, values)| values_of(&upper, place, label, values)).concat();
    let mut page = Picture::draw(wide as u32, height as u32, |_| Ok(()))?
        .framed(&upper, &curves)?
        .framed(&lower, &errors_of(&lower, &errors))?;
    let start = if breadth == Breadth::Broad { LEFT } else { 14 };
    let (mut left, mut y) = (start, if breadth == Breadth::Broad { 22 } else { 12 });
    for (place, (words, tint)) in entries.enumerate() {
        let after = left + 34 + width(&text(13.0, INK), words) + 28;
        if after > wide && left > start {
            (left, y) = (start, y + 20);
        }
        page = page.legend_entry(place, "", |canvas| legend_entry(canvas, (left, y), words, tint))?;
        left += 34 + width(&text(13.0, INK), words) + 28;
    }
    Ok(page)
}

/// A curve of the upper panel, by its place in the legend: what was measured, predicted, or predicted on the ideal base.
fn values_of(frame: &Frame, place: usize, label: &str, values: &[(f64, Uncertain)]) -> String {
    let ends = |value: &Uncertain| [low(value), value.value, value.value + value.expanded];
    let is_drawn = |(f, value): &&(f64, Uncertain)| ends(value).into_iter().all(|end| frame.draws(*f, end));
    let values: Vec<(f64, Uncertain)> = values.iter().filter(is_drawn).copied().collect();
    let ranges = || values.iter().map(|(f, value)| (*f, low(value), value.value + value.expanded));
    let mut traces = Traces::new(frame);
    let line = || values.iter().map(|(f, value)| (*f, value.value));
    match place {
        0 => {
            for (f, value) in &values {
                traces.bar((*f, value.value), value.expanded, measured_colour());
                traces.dot((*f, value.value), 4.0, measured_colour());
            }
        }
        1 => {
            traces.band(&ranges().collect::<Vec<_>>(), predicted_colour());
            traces.line(line(), predicted_colour(), 1.4);
        }
        _ => traces.line(line(), ideal_colour(), 3.2),
    }
    let shown = ranges().zip(&values).map(|((x, low, high), (_, value))| PointerValue {
        x,
        value: value.value,
        range: Some((low, high)),
    });
    traces.curve(place, label, &shown.collect::<Vec<_>>())
}

/// The normalised errors, and lines at −1, 0 and 1.
fn errors_of(frame: &Frame, errors: &[(f64, f64)]) -> String {
    let mut traces = Traces::new(frame);
    for limit in [-1.0, 0.0, 1.0] {
        traces.line([frame.x.from, frame.x.to].map(|f| (f, limit)), GREY, if limit == 0.0 { 0.6 } else { 1.2 });
    }
    let errors: Vec<&(f64, f64)> = errors.iter().filter(|(f, error)| frame.draws(*f, *error)).collect();
    for (f, error) in &errors {
        let tint = if error.abs() <= 1.0 { predicted_colour() } else { impact_colour() };
        traces.line([(*f, 0.0), (*f, *error)], tint, 2.0);
        traces.dot((*f, *error), 4.0, tint);
    }
    let shown = errors.iter().map(|(x, value)| PointerValue { x: *x, value: *value, range: None });
    // It is in no legend.
    traces.curve(errors.len() + 3, "E_n", &shown.collect::<Vec<_>>())
}

/// The lower end of a value's interval; above 0, for a logarithmic axis.
fn low(value: &Uncertain) -> f64 {
    bar_low(Scale::Log, value.value, value.expanded)
}

/// Unit of a displacement axis, and its number in a metre.
fn unit(largest_m: f64) -> (&'static str, f64) {
    if largest_m >= 1e-4 { ("mm", 1e3) } else { ("µm", 1e6) }
}

fn largest(points: &[(f64, f64)]) -> f64 {
    points.iter().map(|p| p.1.abs()).fold(0.0, f64::max)
}

/// x over time, measured and simulated, with the impacts of both, and the residual below.
///
/// # Errors
/// The drawing library's error.
pub fn time_history(history: &History) -> Result<Picture, FigureError> {
    let at = |n: usize| history.from_s + n as f64 / history.rate_hz;
    let timed =
        |x_m: &[f32]| -> Vec<(f64, f64)> { x_m.iter().enumerate().map(|(n, x)| (at(n), f64::from(*x))).collect() };
    let (measured, simulated) = (timed(&history.measured_m), timed(&history.simulated_m));
    let residual: Vec<(f64, f64)> = measured.iter().zip(&simulated).map(|(m, s)| (m.0, m.1 - s.1)).collect();
    let until = at(measured.len().max(simulated.len()).max(2) - 1);
    let x = Axis {
        label: "Time after the start of the measurement (s)".into(),
        from: history.from_s,
        to: until,
        scale: Scale::Linear,
    };
    let (name, scale) = unit(largest(&measured).max(largest(&simulated)));
    let y = Axis::around(
        format!("x ({name})"),
        Scale::Linear,
        measured.iter().chain(&simulated).map(|p| 1.08 * p.1 * scale),
    );
    let (rest_name, rest_scale) = unit(largest(&residual));
    let rest = Axis::around(
        format!("Residual ({rest_name})"),
        Scale::Linear,
        residual.iter().map(|p| p.1 * rest_scale).chain([0.0]),
    );
    let (upper, lower, height) = panels(&x, y, rest, RIGHT);
    let has_impacts = !history.measured_impacts.is_empty() || !history.simulated_impacts.is_empty();
    let page = Picture::draw(BROAD as u32, height as u32, |canvas| {
        let base =
            if history.on_measured_base { "simulated on the measured base" } else { "simulated on the ideal base" };
        let mut entries = Vec::new();
        if !measured.is_empty() {
            entries.push(("measured", measured_colour()));
        }
        entries.push((base, predicted_colour()));
        if has_impacts {
            entries.push(("impacts: measured at the top, simulated at the bottom", impact_colour()));
        }
        legend(canvas, &entries)?;
        upper.draw(canvas)?;
        if residual.is_empty() { Ok(()) } else { lower.draw(canvas) }
    })?;
    page.overlay(|canvas| {
        let draw = |frame: &Frame, points: &[(f64, f64)], scale: f64, style: ShapeStyle| {
            draw_path(canvas, thinned(points).iter().map(|(t, v)| frame.fine_point(*t, v * scale)).collect(), style)
        };
        draw(&upper, &measured, scale, measured_colour().stroke_width(22))?;
        draw(&upper, &simulated, scale, predicted_colour().stroke_width(11))?;
        draw(&lower, &residual, rest_scale, measured_colour().stroke_width(11))?;
        let (top, bottom) = (upper.bounds.1 * FINE, upper.bounds.3 * FINE);
        let tick = |t_s: f64, edge: i32, inwards: i32| {
            let (across, _) = upper.fine_point(t_s, upper.y.from);
            draw_path(
                canvas,
                vec![(across, edge), (across, edge + inwards * 14 * FINE)],
                impact_colour().stroke_width(16),
            )
        };
        history.measured_impacts.iter().try_for_each(|(t_s, _)| tick(*t_s, top, 1))?;
        history.simulated_impacts.iter().try_for_each(|(t_s, _)| tick(*t_s, bottom, -1))
    })
}

/// Velocity over displacement, measured and simulated, of the last readings.
///
/// # Errors
/// The drawing library's error.
pub fn phase_plane(history: &History) -> Result<Picture, FigureError> {
    const SIDE: i32 = 460;
    let orbit = |x_m: &[f32]| -> Vec<(f64, f64)> {
        let last = &x_m[x_m.len().saturating_sub(PHASE_READINGS)..];
        let rate = 0.5 * history.rate_hz;
        last.windows(3).map(|three| (f64::from(three[1]), rate * f64::from(three[2] - three[0]))).collect()
    };
    let (measured, simulated) = (orbit(&history.measured_m), orbit(&history.simulated_m));
    let both = || measured.iter().chain(&simulated);
    let (name, scale) = unit(both().map(|p| p.0.abs()).fold(0.0, f64::max));
    let frame = Frame {
        x: Axis::around(format!("x ({name})"), Scale::Linear, both().map(|p| p.0 * scale)),
        y: Axis::around("x′ (mm/s)", Scale::Linear, both().map(|p| p.1 * 1e3)),
        bounds: (LEFT, TOP, LEFT + SIDE + 40, TOP + SIDE),
    };
    let page = Picture::draw((LEFT + SIDE + 64) as u32, (TOP + SIDE + 64) as u32, |canvas| {
        let measured = (!measured.is_empty()).then_some(("measured", measured_colour()));
        let entries: Vec<(&str, RGBColor)> = measured.into_iter().chain([("simulated", predicted_colour())]).collect();
        legend(canvas, &entries)?;
        frame.draw(canvas)
    })?;
    page.overlay(|canvas| {
        for (points, tint, thick) in [(&measured, measured_colour(), 22), (&simulated, predicted_colour(), 11)] {
            draw_path(
                canvas,
                points.iter().map(|(x, v)| frame.fine_point(x * scale, v * 1e3)).collect(),
                tint.stroke_width(thick),
            )?;
        }
        Ok(())
    })
}
