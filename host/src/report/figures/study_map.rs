//! Draws a quantity over two axes of a study as a map: a rectangle for each point, contour lines, the best point.

use super::curves::{self, SpecialCurve};
use crate::failure::Failure;
use crate::report::numbers::significant;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{INK, MARKED, WHITE, viridis};
use crate::report::plot::svg::{Bounds, Colour, Font, Svg};
use crate::report::plot::traces::circle;
use crate::report::plot::{LABEL, Picture, TITLE, contour};

/// A map.
#[derive(Clone, Debug)]
pub struct StudyMap {
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
    pub curves: Vec<SpecialCurve>,
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
    pub(super) fn borders(&self) -> Vec<f64> {
        let at = |value: f64| if self.is_log { value.ln() } else { value };
        let back = |value: f64| if self.is_log { value.exp() } else { value };
        let values: Vec<f64> = self.values.iter().map(|value| at(*value)).collect();
        let (first, last) = (values[0], values[values.len() - 1]);
        let (start, end) = (values[1] - first, last - values[values.len() - 2]);
        let inner = values.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        let all = std::iter::once(first - 0.5 * start).chain(inner).chain([last + 0.5 * end]);
        all.map(back).collect()
    }

    pub(super) fn axis(&self) -> Axis {
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

impl StudyMap {
    /// The map with some values of its longest axes, evenly taken; the best point stays.
    fn thinned(&self) -> Self {
        let (columns, across, up) = (self.x.values.len(), drawn(self.x.values.len()), drawn(self.y.values.len()));
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

const SIZE: (f64, f64) = (980.0, 640.0);
const BOUNDS: Bounds = (92.0, 44.0, 800.0, 540.0);
/// Left and right end of the colour scale.
const BAR: (f64, f64) = (824.0, 846.0);

/// Steps of the colour scale.
const COLOUR_STEPS: usize = 64;

/// Contour lines.
const CONTOURS: usize = 9;

/// Most segments of a contour line: a line with more of them runs through noise and shows nothing.
const MAX_SEGMENTS: usize = 20_000;

/// Ratio of largest to smallest value from which the colour scale is logarithmic.
const LOG_FROM: f64 = 20.0;

/// Most values of an axis that are drawn: more are closer than the pixels of a screen, and too many shapes for an SVG.
const MAX_VALUES: usize = 400;

/// Places of the values of an axis that are drawn: all, or some evenly taken of many.
pub(super) fn drawn(count: usize) -> Vec<usize> {
    let kept = count.min(MAX_VALUES);
    (0..kept).map(|n| n * (count - 1) / (kept - 1).max(1)).collect()
}

/// Draws a map.
///
/// # Errors
/// Fewer than two values on an axis, or one that cannot be drawn.
pub fn draw(map: &StudyMap) -> Result<Picture, Failure> {
    if map.x.values.len() < 2 || map.y.values.len() < 2 {
        return Err(Failure::undrawn("a map needs at least two values on both axes"));
    }
    if map.x.values.len() > MAX_VALUES || map.y.values.len() > MAX_VALUES {
        return draw(&map.thinned());
    }
    for axis in [&map.x, &map.y] {
        let scale = axis.axis().scale;
        if let Some(value) = axis.values.iter().find(|value| !scale.draws(**value)) {
            return Err(Failure::undrawn(format!("{value:e} is too large or too small for the axis {}", axis.label)));
        }
    }
    let undrawn = Scale::Linear.undrawn(map.values.iter().copied());
    let drawn = |value: &f64| if Scale::Linear.draws(*value) { *value } else { f64::NAN };
    let map = &StudyMap { values: map.values.iter().map(drawn).collect(), ..map.clone() };
    let colours = colour_scale(&map.label, &map.values);
    let frame = PlotFrame { x: map.x.axis(), y: map.y.axis(), bounds: BOUNDS };
    let mut picture = Picture::new(SIZE.0, SIZE.1);
    cells(&mut picture, map, &frame, &colours);
    hatching(&mut picture, map, &frame);
    let place = |(x, y): (f64, f64)| frame.point(map.x.between(x), map.y.between(y));
    for line in contours(map, &colours) {
        picture.segments(line.into_iter().map(|ends| ends.map(place)), WHITE.stroke(0.8).opacity(0.55));
    }
    curves::draw_over(&mut picture, &map.curves, &frame);
    picture.add(&frame.ticks());
    picture.add(&frame.edges());
    picture.text(&map.title, (BOUNDS.0, BOUNDS.1 - 20.0), Font::new(TITLE, INK));
    scale(&mut picture, &colours);
    legend::rows(&mut picture, (BOUNDS.0, SIZE.1 - 24.0), SIZE.0, &entries(map));
    if let Some((at, _)) = &map.best {
        picture.at(frame.point(at.0, at.1), &best(Some(WHITE)));
    }
    picture.note(BOUNDS.0, undrawn.as_deref());
    Ok(picture)
}

/// Draws a rectangle for each run of neighbours of the same colour.
fn cells(svg: &mut Svg, map: &StudyMap, frame: &PlotFrame, colours: &Axis) {
    let (across, up) = (map.x.borders(), map.y.borders());
    let step = |value: f64| (colours.place(value) * COLOUR_STEPS as f64).floor().clamp(0.0, COLOUR_STEPS as f64 - 1.0);
    for (row, values) in map.values.chunks(map.x.values.len()).enumerate() {
        for (from, to) in runs(values, |a, b| a.is_nan() == b.is_nan() && (a.is_nan() || step(a) == step(b))) {
            if !values[from].is_nan() {
                let cell = frame.cell((across[from], up[row]), (across[to], up[row + 1]));
                svg.rectangle(cell, tint(step(values[from])).fill());
            }
        }
    }
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
pub(super) fn runs(values: &[f64], alike: impl Fn(f64, f64) -> bool) -> Vec<(usize, usize)> {
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

/// The colour of a step.
fn tint(step: f64) -> Colour {
    viridis(step / (COLOUR_STEPS - 1) as f64)
}

/// Contour lines in places between points, each as segments. Those between marked points say nothing.
fn contours(map: &StudyMap, colours: &Axis) -> impl Iterator<Item = Vec<[(f64, f64); 2]>> {
    let is_marked = |n: usize| map.marked.iter().any(|(_, marks)| marks[n]);
    let known = |(n, value): (usize, &f64)| if is_marked(n) { f64::NAN } else { *value };
    let values: Vec<f64> = map.values.iter().enumerate().map(known).collect();
    let (columns, from, to, scale) = (map.x.values.len(), colours.from, colours.to, colours.scale);
    let shares = (1..=CONTOURS).map(|n| n as f64 / (CONTOURS + 1) as f64);
    let levels = shares.map(move |share| match scale {
        Scale::Linear => from + share * (to - from),
        Scale::Log => from * (to / from).powf(share),
    });
    levels.map(move |level| contour::segments(&values, columns, level)).filter(|line| line.len() <= MAX_SEGMENTS)
}

/// Diagonals of a square of 10 points, rising and falling.
const HATCHES: [&str; 2] = ["M-2,2 l4,-4 M0,10 l10,-10 M8,12 l4,-4", "M-2,8 l4,4 M0,0 l10,10 M8,-2 l4,4"];

/// Draws patterns over the marked points.
fn hatching(svg: &mut Svg, map: &StudyMap, frame: &PlotFrame) {
    for (kind, path) in HATCHES.iter().enumerate() {
        let mut lines = Svg::default();
        lines.path(path, WHITE.stroke(1.8).opacity(0.6));
        lines.path(path, INK.stroke(0.8));
        svg.raw(&format!(
            "<pattern id=\"hatch-{kind}\" width=\"10\" height=\"10\" patternUnits=\"userSpaceOnUse\">{lines}</pattern>\n"
        ));
    }
    let (across, up) = (map.x.borders(), map.y.borders());
    for (kind, (_, marked)) in map.marked.iter().enumerate().take(HATCHES.len()) {
        for (row, marks) in marked.chunks(map.x.values.len()).enumerate() {
            let marks: Vec<f64> = marks.iter().map(|mark| f64::from(u8::from(*mark))).collect();
            for (from, to) in runs(&marks, |a, b| a == b) {
                if marks[from] == 1.0 {
                    svg.rectangle_with(frame.cell((across[from], up[row]), (across[to], up[row + 1])), &hatch(kind));
                }
            }
        }
    }
}

/// The attribute that fills with a pattern.
fn hatch(kind: usize) -> String {
    format!("fill=\"url(#hatch-{kind})\"")
}

/// Draws the colour scale.
fn scale(svg: &mut Svg, colours: &Axis) {
    let place = |share: f64| (BOUNDS.3 - share * (BOUNDS.3 - BOUNDS.1)).round();
    for step in (0..COLOUR_STEPS).map(|step| step as f64) {
        let [from, to] = [step, step + 1.0].map(|step| place(step / COLOUR_STEPS as f64));
        svg.rectangle((BAR.0, to, BAR.1, from), tint(step).fill());
    }
    for value in colours.ticks().0 {
        let y = place(colours.place(value));
        svg.line([(BAR.1, y), (BAR.1 + 5.0, y)], INK.stroke(1.0));
        svg.text(&significant(value, 4).replace('-', "−"), (BAR.1 + 9.0, y), Font::new(LABEL, INK));
    }
    let middle = (BAR.1 + 72.0, 0.5 * (BOUNDS.1 + BOUNDS.3));
    svg.text(&colours.label, middle, Font::new(TITLE, INK).centred().upright());
}

/// The mark of the best point, with a ring around it that lets it be seen on every colour.
fn best(around: Option<Colour>) -> Svg {
    let mut svg = Svg::default();
    around.into_iter().for_each(|colour| svg.circle((0.0, 0.0), 8.0, colour.stroke(3.0)));
    svg.add(&circle(6.0, MARKED.stroke(3.0)));
    svg
}

/// The best point and the kinds of marks that the map has.
fn entries(map: &StudyMap) -> Vec<LegendEntry> {
    let sample = |kind: usize| {
        let mut svg = Svg::default();
        svg.rectangle_with((-9.0, -8.0, 9.0, 8.0), &hatch(kind));
        svg
    };
    let best = map.best.iter().map(|(_, words)| LegendEntry::mark(words, &best(None)));
    let marked = map.marked.iter().enumerate().filter(|(_, (_, marks))| marks.contains(&true));
    best.chain(marked.map(|(kind, (words, _))| LegendEntry::mark(words, &sample(kind)))).collect()
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
        let map = StudyMap {
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
        assert_eq!((thinned.x.values.len(), thinned.y.values.len()), (MAX_VALUES, MAX_VALUES));
        assert_eq!((thinned.x.values[MAX_VALUES - 1], thinned.y.values[MAX_VALUES - 1]), (999.0, 1999.0));
        for (place, value) in thinned.values.iter().enumerate() {
            let (x, y) = (thinned.x.values[place % MAX_VALUES], thinned.y.values[place / MAX_VALUES]);
            assert_eq!(*value, ((y as usize * columns + x as usize) % 97) as f64);
        }
        assert!(draw(&map).expect("a picture").png().is_ok());
        // Values that jump from point to point have no contour lines, smooth ones have.
        let has_lines = |map: &StudyMap| draw(map).expect("a picture").svg().contains("stroke-linecap");
        let noise = StudyMap { marked: Vec::new(), ..map };
        assert!(!has_lines(&noise));
        let smooth = (0..columns * rows).map(|place| (place % columns) as f64).collect();
        assert!(has_lines(&StudyMap { values: smooth, ..noise }));
    }
}
