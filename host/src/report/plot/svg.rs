//! Writes elements of SVG: lines, areas, circles, text. Lengths are in points, written with two decimals.

use std::fmt::{self, Display, Write};

use maud::Escaper;

use crate::input::shown;

/// A place in a picture, from its left and its top, in points.
pub type PicturePlace = (f64, f64);

/// Left, top, right and bottom of a rectangle, in points.
pub type Bounds = (f64, f64, f64, f64);

/// A colour: red, green, blue. It is written as the style sheet of the pages has it: `#E69F00`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

impl Display for Colour {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self(red, green, blue) = self;
        write!(f, "#{red:02X}{green:02X}{blue:02X}")
    }
}

impl Colour {
    /// A line of this width, points.
    #[must_use]
    pub const fn stroke(self, width: f64) -> Style {
        Style { fill: None, stroke: Some((self, width)), opacity: 1.0, dash: "" }
    }

    /// An area.
    #[must_use]
    pub const fn fill(self) -> Style {
        Style { fill: Some(self), stroke: None, opacity: 1.0, dash: "" }
    }
}

/// How an element is painted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    fill: Option<Colour>,
    stroke: Option<(Colour, f64)>,
    opacity: f64,
    dash: &'static str,
}

impl Style {
    /// With a line of this colour and width around it.
    #[must_use]
    pub const fn edged(self, colour: Colour, width: f64) -> Self {
        Self { stroke: Some((colour, width)), ..self }
    }

    /// Lets what is below shine through; 1 is opaque.
    #[must_use]
    pub const fn opacity(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    /// Lengths of dashes and gaps, points; empty for a solid line.
    #[must_use]
    pub const fn dashed(self, dash: &'static str) -> Self {
        Self { dash, ..self }
    }
}

/// The attributes of a style.
impl Display for Style {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.fill {
            Some(fill) => write!(f, "fill=\"{fill}\"")?,
            None => write!(f, "fill=\"none\"")?,
        }
        if let Some((stroke, width)) = self.stroke {
            write!(f, " stroke=\"{stroke}\" stroke-width=\"{width}\"")?;
        }
        if !self.dash.is_empty() {
            write!(f, " stroke-dasharray=\"{}\"", self.dash)?;
        }
        if self.opacity < 1.0 { write!(f, " opacity=\"{}\"", self.opacity) } else { Ok(()) }
    }
}

/// How words are written: from the left, and in the middle of the line's height, unless stated otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Font {
    size: f64,
    colour: Colour,
    anchor: &'static str,
    /// From the place to the line on which letters stand, over the size.
    down: f64,
    is_upright: bool,
}

impl Font {
    /// A size in points, and a colour.
    #[must_use]
    pub const fn new(size: f64, colour: Colour) -> Self {
        Self { size, colour, anchor: "start", down: 0.27, is_upright: false }
    }

    /// The place is in the middle of the words.
    #[must_use]
    pub const fn centred(self) -> Self {
        Self { anchor: "middle", ..self }
    }

    /// The place is at the end of the words.
    #[must_use]
    pub const fn ending(self) -> Self {
        Self { anchor: "end", ..self }
    }

    /// The place is above the words.
    #[must_use]
    pub const fn below(self) -> Self {
        Self { down: 0.76, ..self }
    }

    /// The place is below the words.
    #[must_use]
    pub const fn above(self) -> Self {
        Self { down: -0.27, ..self }
    }

    /// Written upwards.
    #[must_use]
    pub const fn upright(self) -> Self {
        Self { is_upright: true, ..self }
    }

    /// Width of words in points.
    #[must_use]
    pub fn width(self, words: &str) -> f64 {
        super::width(words, self.size)
    }

    /// Words in lines of at most this width, points; a longer word has a line of its own.
    #[must_use]
    pub fn wrapped(self, words: &str, most: f64) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in words.split(' ') {
            match lines.last_mut() {
                Some(line) if self.width(&format!("{line} {word}")) <= most => *line = format!("{line} {word}"),
                _ => lines.push(word.to_string()),
            }
        }
        lines
    }
}

/// A length in points with two decimals at most.
struct Length(f64);

impl Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        // No −0.
        write!(f, "{}", (self.0 * 100.0).round() / 100.0 + 0.0)
    }
}

/// Elements of SVG, each above those before it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Svg(String);

impl Display for Svg {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Svg {
    /// Writes to a string, which cannot fail.
    fn write(&mut self, text: fmt::Arguments) {
        let _ = self.0.write_fmt(text);
    }

    /// A line through points.
    pub fn line(&mut self, points: impl IntoIterator<Item = PicturePlace>, style: Style) {
        self.write(format_args!("<polyline {style} stroke-linejoin=\"round\" points=\""));
        self.points(points);
    }

    /// An area.
    pub fn area(&mut self, corners: impl IntoIterator<Item = PicturePlace>, style: Style) {
        self.write(format_args!("<polygon {style} points=\""));
        self.points(corners);
    }

    fn points(&mut self, points: impl IntoIterator<Item = PicturePlace>) {
        let mut after = "";
        for (x, y) in points {
            self.write(format_args!("{after}{},{}", Length(x), Length(y)));
            after = " ";
        }
        self.0.push_str("\"/>\n");
    }

    /// Straight lines that need not touch: from, to. Where they do, they look like one line.
    pub fn segments(&mut self, segments: impl IntoIterator<Item = [PicturePlace; 2]>, style: Style) {
        self.write(format_args!("<path {style} stroke-linecap=\"round\" d=\""));
        for [(x1, y1), (x2, y2)] in segments {
            self.write(format_args!("M{} {}L{} {}", Length(x1), Length(y1), Length(x2), Length(y2)));
        }
        self.0.push_str("\"/>\n");
    }

    /// Squares of this size around places.
    pub fn squares(&mut self, places: impl IntoIterator<Item = PicturePlace>, size: f64, colour: Colour) {
        self.write(format_args!("<path {} opacity=\"0.8\" stroke-linecap=\"square\" d=\"", colour.stroke(size)));
        // A line without length has the square of its ends.
        places.into_iter().for_each(|(x, y)| self.write(format_args!("M{} {}h0", Length(x), Length(y))));
        self.0.push_str("\"/>\n");
    }

    /// A rectangle.
    pub fn rectangle(&mut self, (left, top, right, bottom): Bounds, style: Style) {
        self.rectangle_with((left, top, right, bottom), &style.to_string());
    }

    /// A rectangle with other attributes than those of a style.
    pub fn rectangle_with(&mut self, (left, top, right, bottom): Bounds, attributes: &str) {
        let (width, height) = (Length(right - left), Length(bottom - top));
        let (left, top) = (Length(left), Length(top));
        self.write(format_args!(
            "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" {attributes}/>\n"
        ));
    }

    /// A circle.
    pub fn circle(&mut self, (x, y): PicturePlace, radius: f64, style: Style) {
        let place = |name: &str, value: f64| {
            if value == 0.0 { String::new() } else { format!("{name}=\"{}\" ", Length(value)) }
        };
        self.write(format_args!("<circle {}{}r=\"{radius}\" {style}/>\n", place("cx", x), place("cy", y)));
    }

    /// A path, in the language of SVG.
    pub fn path(&mut self, path: &str, style: Style) {
        self.write(format_args!("<path d=\"{path}\" {style}/>\n"));
    }

    /// Words in the built-in font.
    pub fn text(&mut self, words: &str, place: PicturePlace, font: Font) {
        self.text_with(words, place, font, "");
    }

    /// Words with further attributes.
    pub fn text_with(&mut self, words: &str, (x, y): PicturePlace, font: Font, attributes: &str) {
        let Font { size, colour, anchor, down, is_upright } = font;
        self.write(format_args!(
            "<text x=\"{}\" y=\"{}\" font-size=\"{size}\" fill=\"{colour}\"",
            Length(x),
            Length(y + down * size)
        ));
        if anchor != "start" {
            self.write(format_args!(" text-anchor=\"{anchor}\""));
        }
        if is_upright {
            self.write(format_args!(" transform=\"rotate(-90 {} {})\"", Length(x), Length(y)));
        }
        self.write(format_args!("{attributes}>{}</text>\n", escaped(words)));
    }

    /// Elements whose 0, 0 is at a place.
    pub fn at(&mut self, (x, y): PicturePlace, elements: &Self) {
        self.write(format_args!("<g transform=\"translate({} {})\">{elements}</g>\n", Length(x), Length(y)));
    }

    /// Elements in a group with attributes: names and values, the values unescaped.
    pub fn group(&mut self, attributes: &[(&str, &str)], elements: &Self) {
        self.0.push_str("<g");
        for (name, value) in attributes {
            self.write(format_args!(" {name}=\"{}\"", escaped(value)));
        }
        self.write(format_args!(">{elements}</g>\n"));
    }

    /// Further elements.
    pub fn add(&mut self, elements: &Self) {
        self.0.push_str(&elements.0);
    }

    /// Elements of SVG as text, which must be well-formed.
    pub fn raw(&mut self, elements: &str) {
        self.0.push_str(elements);
    }
}

/// A text within SVG: escaped, and without the control characters that XML forbids and labels may have.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    // Writing to a string cannot fail.
    let _ = Escaper::new(&mut out).write_str(&shown(text));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_two_decimals_and_words_are_escaped() {
        let mut svg = Svg::default();
        svg.line([(0.123_4, -0.001), (10.0, 1.0 / 3.0)], Colour(0xe6, 0x9f, 0).stroke(1.5).dashed("6 4"));
        svg.text("<a & \"b\">\u{1b}", (1.0, 2.0), Font::new(10.0, Colour(0, 0, 0)).centred());
        assert_eq!(
            svg.to_string(),
            "<polyline fill=\"none\" stroke=\"#E69F00\" stroke-width=\"1.5\" stroke-dasharray=\"6 4\" stroke-linejoin=\"round\" \
             points=\"0.12,0 10,0.33\"/>\n<text x=\"1\" y=\"4.7\" font-size=\"10\" fill=\"#000000\" text-anchor=\"middle\">\
             &lt;a &amp; &quot;b&quot;&gt;\\u{1b}</text>\n"
        );
    }
}
