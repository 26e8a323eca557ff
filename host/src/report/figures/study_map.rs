//! Draws a quantity over two axes of a study as a map: a rectangle for each point, contour lines, the best point.

use contour::ContourBuilder;
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::prelude::{ColorMap, ViridisRGB};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontTransform, RGBColor, WHITE};

use super::axis::{Axis, Frame, Scale};
use super::curves::{self, Curve};
use super::{Canvas, FigureError, INK, Picture, note, text};
use crate::report::numbers::significant;

/// A map.
#[derive(Clone, Debug)]
pub struct Map {
    /// Name of the study, and what the other axes are.
    pub title: String,
    /// Horizontal axis.
    pub x: MapAxis,
    /// Vertical axis.
    pub y: MapAxis,
    /// The quantity with its unit.
    pub label: String,
    /// Values, row by row from the first value of y; not a number where there is none.
    pub values: Vec<f64>,
    /// Marked points, each kind with its meaning; values as in `values`. At most two kinds.
    pub marked: Vec<(String, Vec<bool>)>,
    /// Curves of special points over it.
    pub curves: Vec<Curve>,
    /// The best point and its text.
    pub best: Option<((f64, f64), String)>,
}

/// An axis of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapAxis {
    /// Quantity and unit.
    pub label: String,
    /// Values, rising.
    pub values: Vec<f64>,
    /// Logarithmic.
    pub is_log: bool,
}

impl MapAxis {
    /// Borders of the points' rectangles: half-way between them, one more than points.
    fn borders(&self) -> Vec<f64> {
        let at = |value: f64| if self.is_log { value.ln() } else { value };
        let back = |value: f64| if self.is_log { value.exp() } else { value };
        let values: Vec<f64> = self.values.iter().map(|value| at(*value)).collect();
        let (first, last) = (values[0], values[values.len() - 1]);
        let (start, end) = (values[1] - first, last - values[values.len() - 2]);
        let inner = values.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        let all = std::iter::once(first - 0.5 * start).chain(inner).chain([last + 0.5 * end]);
        all.map(back).collect()
    }

    fn axis(&self) -> Axis {
        let borders = self.borders();
        let scale = if self.is_log { Scale::Log } else { Scale::Linear };
        Axis { label: self.label.clone(), from: borders[0], to: borders[borders.len() - 1], scale }
    }

    /// The value at a place between points: 0 is the first point.
    fn between(&self, place: f64) -> f64 {
        let place = place.clamp(0.0, (self.values.len() - 1) as f64);
        let low = (place.floor() as usize).min(self.values.len() - 2);
        let share = place - low as f64;
        let (from, to) = (self.values[low], self.values[low + 1]);
        if self.is_log { from * (to / from).powf(share) } else { from + share * (to - from) }
    }
}

impl Map {
    /// The map with some values of its longest axes, evenly taken; the best point stays.
    fn thinned(&self) -> Self {
        let places = |count: usize| -> Vec<usize> {
            let kept = count.min(MOST_VALUES);
            (0..kept).map(|n| n * (count - 1) / (kept - 1)).collect()
        };
        let (columns, across, up) = (self.x.values.len(), places(self.x.values.len()), places(self.y.values.len()));
        let axis = |axis: &MapAxis, places: &[usize]| {
            let values = places.iter().map(|place| axis.values[*place]).collect();
            MapAxis { values, ..axis.clone() }
        };
        let kept = || up.iter().flat_map(|row| across.iter().map(move |column| row * columns + column));
        let marked =
            |(meaning, points): &(String, Vec<bool>)| (meaning.clone(), kept().map(|place| points[place]).collect());
        Self {
            x: axis(&self.x, &across),
            y: axis(&self.y, &up),
            values: kept().map(|place| self.values[place]).collect(),
            marked: self.marked.iter().map(marked).collect(),
            ..self.clone()
        }
    }
}

const WIDTH: i32 = 980;
const HEIGHT: i32 = 640;
const BOUNDS: (i32, i32, i32, i32) = (92, 44, 800, 540);
const BAR: (i32, i32) = (824, 846);

/// The legend below the axis.
const LEGEND_Y: i32 = HEIGHT - 24;

/// Between an entry's mark and its words.
const TEXT_AFTER: i32 = 26;

/// The best point.
const BEST: RGBColor = RGBColor(0xd5, 0x5e, 0x00);

/// Steps of the colour scale.
const COLOUR_STEPS: usize = 64;

/// Contour lines.
const CONTOURS: usize = 9;

/// Ratio of largest to smallest value from which the colour scale is logarithmic.
const LOG_FROM: f64 = 20.0;

/// Most values of an axis that are drawn: more are closer than the pixels of a screen, and too many shapes for an SVG.
const MOST_VALUES: usize = 400;

/// Draws a map.
///
/// # Errors
/// The drawing library's error; fewer than two values on an axis.
pub fn draw(map: &Map) -> Result<Picture, FigureError> {
    if map.x.values.len() < 2 || map.y.values.len() < 2 {
        return Err(FigureError("a map needs at least two values on both axes".into()));
    }
    if map.x.values.len() > MOST_VALUES || map.y.values.len() > MOST_VALUES {
        return draw(&map.thinned());
    }
    for axis in [&map.x, &map.y] {
        let scale = axis.axis().scale;
        if let Some(value) = axis.values.iter().find(|value| !scale.draws(**value)) {
            return Err(FigureError(format!("{value:e} is too large or too small for the axis {}", axis.label)));
        }
    }
    let undrawn = Scale::Linear.undrawn(map.values.iter().copied());
    let drawn = |value: &f64| if Scale::Linear.draws(*value) { *value } else { f64::NAN };
    let map = &Map { values: map.values.iter().map(drawn).collect(), ..map.clone() };
    let colours = colour_scale(&map.label, &map.values);
    let frame = Frame { x: map.x.axis(), y: map.y.axis(), bounds: BOUNDS };
    let columns = map.x.values.len();
    let (across, up) = (map.x.borders(), map.y.borders());
    let picture = Picture::draw(WIDTH as u32, HEIGHT as u32, |canvas| {
        let step =
            |value: f64| (colours.place(value) * COLOUR_STEPS as f64).floor().clamp(0.0, COLOUR_STEPS as f64 - 1.0);
        for (row, values) in map.values.chunks(columns).enumerate() {
            for (from, to) in runs(values, |a, b| a.is_nan() == b.is_nan() && (a.is_nan() || step(a) == step(b))) {
                if values[from].is_nan() {
                    continue;
                }
                let corners = [frame.point(across[from], up[row]), frame.point(across[to], up[row + 1])];
                let style = tint(step(values[from]) / (COLOUR_STEPS - 1) as f64).filled();
                canvas.draw(&Rectangle::new(corners, style)).map_err(FigureError::of)?;
            }
        }
        Ok(())
    })?;
    let picture = picture.with_elements(&hatching(map, &frame, &across, &up));
    let lines = contours(map, &colours)?;
    let with_lines = picture.overlay(|canvas| {
        for line in &lines {
            let points: Vec<(i32, i32)> =
                line.iter().map(|(x, y)| frame.fine_point(map.x.between(*x), map.y.between(*y))).collect();
            canvas.draw(&PathElement::new(points, WHITE.mix(0.55).stroke_width(8))).map_err(FigureError::of)?;
        }
        Ok(())
    })?;
    with_lines.with_elements(&curves::elements(&map.curves, &frame)).above(|canvas| {
        labels(canvas, map, &frame, &colours)?;
        note(canvas, (BOUNDS.0, HEIGHT), undrawn.as_deref())
    })
}

/// The range of the values, logarithmic if they are all positive and far apart.
fn colour_scale(label: &str, values: &[f64]) -> Axis {
    let known = || values.iter().copied().filter(|value| !value.is_nan());
    let (low, high) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if Scale::Log.draws(low) && high / low > LOG_FROM {
        Axis { label: label.into(), from: low, to: high, scale: Scale::Log }
    } else {
        Axis::tight(label, known())
    }
}

/// Runs of neighbours that are alike: first place and the place after the last.
fn runs(values: &[f64], alike: impl Fn(f64, f64) -> bool) -> Vec<(usize, usize)> {
    let mut runs = Vec::new();
    let mut from = 0;
    for to in 1..=values.len() {
        if to == values.len() || !alike(values[from], values[to]) {
            runs.push((from, to));
            from = to;
        }
    }
    runs
}

fn tint(share: f64) -> RGBColor {
    ViridisRGB.get_color(share)
}

/// Contour lines in places between points.
fn contours(map: &Map, colours: &Axis) -> Result<Vec<Vec<(f64, f64)>>, FigureError> {
    let (columns, rows) = (map.x.values.len(), map.y.values.len());
    let thresholds: Vec<f64> = (1..=CONTOURS)
        .map(|n| n as f64 / (CONTOURS + 1) as f64)
        .map(|share| match colours.scale {
            Scale::Linear => colours.from + share * (colours.to - colours.from),
            Scale::Log => colours.from * (colours.to / colours.from).powf(share),
        })
        .collect();
    // A missing value is above every line: its border is drawn.
    let values: Vec<f64> = map.values.iter().map(|v| if v.is_finite() { *v } else { f64::MAX }).collect();
    let found = ContourBuilder::new(columns, rows, true).lines(&values, &thresholds).map_err(FigureError::of)?;
    let (last_column, last_row) = ((columns - 1) as f64, (rows - 1) as f64);
    // Lines that close along the border, and those between marked points, say nothing.
    let is_drawn = |&(x, y): &(f64, f64)| {
        let is_inside = x > 0.0 && y > 0.0 && x < last_column && y < last_row;
        let cell = |x: f64, y: f64| y as usize * columns + x as usize;
        let near = [cell(x.floor(), y.floor()), cell(x.ceil(), y.ceil())];
        is_inside && !map.marked.iter().any(|(_, marks)| near.iter().any(|cell| marks[*cell]))
    };
    // The builder counts from the corner of the first point's rectangle.
    let places = |line: &contour::Line| -> Vec<Vec<(f64, f64)>> {
        let lines = line.geometry().0.iter();
        lines.map(|line| line.0.iter().map(|at| (at.x - 0.5, at.y - 0.5)).collect()).collect()
    };
    let whole = found.iter().flat_map(places);
    let parts = whole.flat_map(|line| {
        let parts = line.split(|at| !is_drawn(at)).filter(|part| part.len() > 1);
        parts.map(<[(f64, f64)]>::to_vec).collect::<Vec<_>>()
    });
    Ok(parts.collect())
}

/// Patterns over the marked points, as SVG: the drawing library has none.
fn hatching(map: &Map, frame: &Frame, across: &[f64], up: &[f64]) -> String {
    let columns = map.x.values.len();
    let mut elements = String::from("<defs>");
    for (kind, path) in HATCHES.iter().enumerate() {
        elements.push_str(&format!(
            "<pattern id=\"hatch-{kind}\" width=\"10\" height=\"10\" patternUnits=\"userSpaceOnUse\">\
             <path d=\"{path}\" stroke=\"#ffffff\" stroke-width=\"1.8\" stroke-opacity=\"0.6\"/><path d=\"{path}\" stroke=\"#222222\" stroke-width=\"0.8\"/></pattern>"
        ));
    }
    elements.push_str("</defs>\n");
    for (kind, (_, marked)) in map.marked.iter().enumerate().take(HATCHES.len()) {
        for (row, marks) in marked.chunks(columns).enumerate() {
            let marks: Vec<f64> = marks.iter().map(|mark| f64::from(u8::from(*mark))).collect();
            for (from, to) in runs(&marks, |a, b| a == b) {
                if marks[from] == 1.0 {
                    let [(left, bottom), (right, top)] =
                        [frame.point(across[from], up[row]), frame.point(across[to], up[row + 1])];
                    elements.push_str(&rectangle((left, top, right, bottom), kind));
                }
            }
        }
    }
    for (x, kind, _) in legend(map) {
        if let Some(kind) = kind {
            elements.push_str(&rectangle((x, LEGEND_Y - 8, x + 18, LEGEND_Y + 8), kind));
        }
    }
    elements
}

/// A rectangle filled with a hatch: left, top, right, bottom.
fn rectangle((left, top, right, bottom): (i32, i32, i32, i32), kind: usize) -> String {
    let (width, height) = (right - left, bottom - top);
    format!("<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"url(#hatch-{kind})\"/>\n")
}

/// Diagonals of a square of 10 points, rising and falling.
const HATCHES: [&str; 2] = ["M-2,2 l4,-4 M0,10 l10,-10 M8,12 l4,-4", "M-2,8 l4,4 M0,0 l10,10 M8,-2 l4,4"];

fn labels(canvas: &Canvas, map: &Map, frame: &Frame, colours: &Axis) -> Result<(), FigureError> {
    let put = |text: Text<'static, (i32, i32), String>| canvas.draw(&text).map_err(FigureError::of);
    let left = |size: f64, colour: RGBColor| text(size, colour).pos(Pos::new(HPos::Left, VPos::Center));
    frame.draw_border(canvas)?;
    put(Text::new(map.title.clone(), (BOUNDS.0, BOUNDS.1 - 20), left(15.0, INK)))?;
    // The colour scale.
    let place = |share: f64| BOUNDS.3 - (share * f64::from(BOUNDS.3 - BOUNDS.1)).round() as i32;
    for step in 0..COLOUR_STEPS {
        let [from, to] = [step, step + 1].map(|step| place(step as f64 / COLOUR_STEPS as f64));
        let style = tint(step as f64 / (COLOUR_STEPS - 1) as f64).filled();
        canvas.draw(&Rectangle::new([(BAR.0, from), (BAR.1, to)], style)).map_err(FigureError::of)?;
    }
    for value in colours.ticks().0 {
        let y = place(colours.place(value));
        let tick = PathElement::new(vec![(BAR.1, y), (BAR.1 + 5, y)], INK.stroke_width(1));
        canvas.draw(&tick).map_err(FigureError::of)?;
        put(Text::new(significant(value, 4).replace('-', "−"), (BAR.1 + 9, y), left(13.0, INK)))?;
    }
    let upright = text(15.0, INK).pos(Pos::new(HPos::Center, VPos::Center)).transform(FontTransform::Rotate270);
    put(Text::new(map.label.clone(), (BAR.1 + 72, (BOUNDS.1 + BOUNDS.3) / 2), upright))?;
    for (x, kind, words) in legend(map) {
        put(Text::new(words, (x + TEXT_AFTER, LEGEND_Y), left(13.0, INK)))?;
        if kind.is_none() {
            let mark = Circle::new((x + 9, LEGEND_Y), 6, BEST.stroke_width(3));
            canvas.draw(&mark).map_err(FigureError::of)?;
        }
    }
    if let Some((at, _)) = &map.best {
        let point = frame.point(at.0, at.1);
        for (radius, colour) in [(8, WHITE), (6, BEST)] {
            canvas.draw(&Circle::new(point, radius, colour.stroke_width(3))).map_err(FigureError::of)?;
        }
    }
    Ok(())
}

/// Entries of the legend below the axis: where, which hatch (none for the best point), and its words.
fn legend(map: &Map) -> Vec<(i32, Option<usize>, String)> {
    let style = text(13.0, INK);
    let best = map.best.iter().map(|(_, words)| (None, words.clone()));
    let marked = map.marked.iter().enumerate().filter(|(_, (_, marks))| marks.contains(&true));
    let all = best.chain(marked.map(|(kind, (words, _))| (Some(kind), words.clone())));
    let mut x = BOUNDS.0;
    all.map(|(kind, words)| {
        let entry = (x, kind, words);
        x += TEXT_AFTER + super::width(&style, &entry.2) + 26;
        entry
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_lie_half_way_between_points_also_on_a_logarithmic_axis() {
        let axis = |values: &[f64], is_log| MapAxis { label: String::new(), values: values.to_vec(), is_log };
        assert_eq!(axis(&[1.0, 2.0, 4.0], false).borders(), [0.5, 1.5, 3.0, 5.0]);
        let borders = axis(&[1.0, 100.0], true).borders();
        assert!(borders.iter().zip([0.1, 10.0, 1000.0]).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{borders:?}");
        assert_eq!(axis(&[1.0, 2.0, 4.0], false).between(1.5), 3.0);
    }

    #[test]
    fn neighbours_of_one_colour_are_one_rectangle() {
        assert_eq!(runs(&[1.0, 1.0, 2.0], |a, b| a == b), [(0, 2), (2, 3)]);
    }

    /// An SVG with a shape for each of its points could not be turned into a PNG.
    #[test]
    fn a_map_of_millions_of_points_is_drawn_from_some_of_them() {
        let axis =
            |count: usize| MapAxis { label: "a".into(), values: (0..count).map(|n| n as f64).collect(), is_log: false };
        let (columns, rows) = (1_000, 2_000);
        let values: Vec<f64> = (0..columns * rows).map(|place| (place % 97) as f64).collect();
        let marked = vec![("odd".into(), values.iter().map(|value| value % 2.0 == 1.0).collect())];
        let (x, y) = (axis(columns), axis(rows));
        let map = Map {
            title: "m".into(),
            x,
            y,
            label: "b".into(),
            values,
            marked,
            best: Some(((3.0, 4.0), "here".into())),
            curves: Vec::new(),
        };
        let thinned = map.thinned();
        assert_eq!((thinned.x.values.len(), thinned.y.values.len()), (MOST_VALUES, MOST_VALUES));
        assert_eq!((thinned.x.values[MOST_VALUES - 1], thinned.y.values[MOST_VALUES - 1]), (999.0, 1999.0));
        for (place, value) in thinned.values.iter().enumerate() {
            let (x, y) = (thinned.x.values[place % MOST_VALUES], thinned.y.values[place / MOST_VALUES]);
            assert_eq!(*value, ((y as usize * columns + x as usize) % 97) as f64);
        }
        assert!(draw(&map).expect("a picture").png().is_ok());
    }
}
