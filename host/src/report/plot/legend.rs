//! Legends: a sample and words for each entry, in a column beside the axes or in rows.

use super::palette::{GREY, INK};
use super::svg::{Bounds, Font, PicturePlace, Style, Svg};
use super::{Breadth, LABEL, Picture, SMALL};

/// Width of a sample, points. Marks are in its middle.
pub const SAMPLE: f64 = 28.0;
/// Between the beginning of a sample and that of its words.
const WORDS: f64 = 36.0;
/// Between entries of a row.
const GAP: f64 = 26.0;
/// Height of a line.
const LINE: f64 = 21.0;
/// Between the words of an entry and their detail.
const DETAIL: f64 = 19.0;
/// Between an entry with a detail and the next one.
const AFTER_DETAIL: f64 = 7.0;

/// Widest column beside the axes; a wider one is below them.
const WIDEST: f64 = 300.0;
/// Height of axes that have a legend beside or below them.
const AXES: f64 = 360.0;
/// Between axes and the legend below them.
const BELOW_AXES: f64 = 74.0;

/// An entry of a legend.
#[derive(Clone, Debug, Default)]
pub struct LegendEntry {
    /// What is drawn, from 0 to [`SAMPLE`] across, around 0.
    sample: Svg,
    words: String,
    /// A second line; none if empty.
    detail: String,
    /// The curve that a page's script hides with this entry.
    curve: Option<usize>,
    /// Explains a sign rather than a curve: small and grey.
    is_sign: bool,
}

impl LegendEntry {
    /// A line in this style.
    pub fn line(words: impl Into<String>, style: Style) -> Self {
        let mut sample = Svg::default();
        sample.line([(0.0, 0.0), (SAMPLE, 0.0)], style);
        Self { sample, words: words.into(), ..Self::default() }
    }

    /// A mark: elements around 0, 0.
    pub fn mark(words: impl Into<String>, mark: &Svg) -> Self {
        Self { words: words.into(), ..Self::default() }.marked(mark)
    }

    /// With a mark above the sample.
    #[must_use]
    pub fn marked(mut self, mark: &Svg) -> Self {
        self.sample.at((0.5 * SAMPLE, 0.0), mark);
        self
    }

    /// With a second line.
    #[must_use]
    pub fn with_detail(self, detail: impl Into<String>) -> Self {
        Self { detail: detail.into(), ..self }
    }

    /// Hides the curve of this place ([`super::traces::Traces::curve`]) on a page.
    #[must_use]
    pub fn of_curve(self, place: usize) -> Self {
        Self { curve: Some(place), ..self }
    }

    /// Small and grey: explains a sign.
    #[must_use]
    pub fn of_sign(self) -> Self {
        Self { is_sign: true, ..self }
    }

    fn font(&self) -> Font {
        if self.is_sign { Font::new(SMALL, GREY) } else { Font::new(LABEL, INK) }
    }

    fn width(&self) -> f64 {
        WORDS + self.font().width(&self.words).max(Font::new(SMALL, GREY).width(&self.detail))
    }

    fn height(&self) -> f64 {
        LINE + if self.detail.is_empty() { 0.0 } else { DETAIL + AFTER_DETAIL }
    }

    fn draw(&self, svg: &mut Svg, (left, y): PicturePlace) {
        let mut own = Svg::default();
        own.at((left, y), &self.sample);
        own.text(&self.words, (left + WORDS, y), self.font());
        if !self.detail.is_empty() {
            own.text(&self.detail, (left + WORDS, y + DETAIL), Font::new(SMALL, GREY));
        }
        match self.curve {
            Some(place) => svg.group(&[("data-legend", &place.to_string())], &own),
            None => svg.add(&own),
        }
    }
}

/// Draws the entries below each other, the first one around this place.
pub fn column(svg: &mut Svg, (left, mut y): PicturePlace, entries: &[LegendEntry]) {
    for entry in entries {
        entry.draw(svg, (left, y));
        y += entry.height();
    }
}

/// Width and height of a column.
#[must_use]
pub fn size(entries: &[LegendEntry]) -> (f64, f64) {
    (entries.iter().map(LegendEntry::width).fold(0.0, f64::max), entries.iter().map(LegendEntry::height).sum())
}

/// Draws the entries beside each other, in rows that end at `right`. Answers with where a further entry would be.
pub fn rows(svg: &mut Svg, (left, mut y): PicturePlace, right: f64, entries: &[LegendEntry]) -> PicturePlace {
    let mut x = left;
    for entry in entries {
        if x > left && x + entry.width() > right {
            (x, y) = (left, y + LINE);
        }
        entry.draw(svg, (x, y));
        x += entry.width() + GAP;
    }
    (x, y)
}

/// Where the parts of a figure with one pair of axes are.
#[derive(Clone, Copy, Debug)]
pub struct Arrangement {
    /// Width and height of the figure.
    pub size: (f64, f64),
    /// The frame of the axes.
    pub bounds: Bounds,
    /// The first entry of the legend.
    pub legend: PicturePlace,
}

impl Arrangement {
    /// Arranges axes from `left`, `top`, the legend beside or below them, and lines of this height under both.
    #[must_use]
    pub fn of(breadth: Breadth, (left, top): PicturePlace, legend: &[LegendEntry], under: f64) -> Self {
        let (wide, (column, height)) = (breadth.width(), size(legend));
        if breadth == Breadth::Broad && column <= WIDEST {
            let right = if legend.is_empty() { wide - 30.0 } else { wide - column - 36.0 };
            let bottom = (top + AXES).max(top + height);
            let bounds = (left, top, right, bottom);
            return Self { size: (wide, bottom + 62.0 + under), bounds, legend: (right + 22.0, top + 8.0) };
        }
        let bounds = (left, top, wide - 16.0, top + AXES);
        let legend = (14.0, bounds.3 + BELOW_AXES);
        Self { size: (wide, legend.1 + height + under), bounds, legend }
    }

    /// The empty picture.
    #[must_use]
    pub fn picture(&self) -> Picture {
        Picture::new(self.size.0, self.size.1)
    }
}
