//! Pictures as SVG and, rendered from it, as PNG: panels with axes, curves and marks, legends. All lengths are in points, as floats.
//!
//! [`svg`] writes elements, [`axis`] has axes and frames, [`traces`] what is drawn within a frame, [`legend`] the legends, [`contour`]
//! lines of equal value, [`palette`] the colours. The font is built in, so a picture looks the same on every machine.

pub mod axis;
#[cfg(test)]
mod colours;
pub mod contour;
pub mod legend;
pub mod palette;
pub mod svg;
pub mod traces;

use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::sync::{Arc, LazyLock};

use maud::PreEscaped;
use resvg::{tiny_skia, usvg};
use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};

use self::axis::{Axis, PlotFrame, Scale};
use self::palette::{GREY, WHITE};
use self::svg::{Font, Svg};
use crate::failure::Failure;
use crate::host_time;
use crate::input::shown;
use crate::run_folder::own_files;
use crate::run_folder::sealed_parquet::short;

/// Name of the built-in font, then alternatives for an SVG viewer without it.
const FAMILY: &str = "DejaVu Sans, Verdana, Arial, sans-serif";
static FONT: &[u8] = include_bytes!("../../../fonts/DejaVuSans.ttf");

/// Size of titles and of the labels of axes, points.
pub const TITLE: f64 = 12.0;
/// Size of numbers at ticks and of legends, points.
pub const LABEL: f64 = 10.5;
/// Size of captions and details, points.
pub const SMALL: f64 = 9.7;

/// Pixels of the PNG per point of the SVG.
const PNG_SCALE: f32 = 2.0;

/// What a figure is drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Breadth {
    /// A screen or a printed page: [`BROAD`] points wide, the legend beside the axes.
    Broad,
    /// A phone: [`NARROW`] points wide, the legend below the axes.
    Narrow,
}

impl Breadth {
    /// Points.
    #[must_use]
    pub const fn width(self) -> f64 {
        match self {
            Self::Broad => BROAD,
            Self::Narrow => NARROW,
        }
    }
}

/// Width of a figure for a screen or a printed page, points.
pub const BROAD: f64 = 760.0;
/// Width of a figure for a phone, points.
pub const NARROW: f64 = 400.0;

/// Size of the text that states where a figure's data are from, and its distance from the edges, points.
const SOURCE_SIZE: f64 = 6.5;
const SOURCE_MARGIN: f64 = 3.0;

/// Width of words in the built-in font at a size, points.
fn width(words: &str, size: f64) -> f64 {
    static READ: LazyLock<Option<FontRef>> = LazyLock::new(|| FontRef::new(FONT).ok());
    let Some(font) = &*READ else { return 0.0 };
    let (glyphs, metrics) = (font.charmap(), font.glyph_metrics(Size::new(size as f32), LocationRef::default()));
    // The first glyph stands for characters that the font does not have.
    let of = |c: char| metrics.advance_width(glyphs.map(c).unwrap_or_default());
    words.chars().filter_map(of).map(f64::from).sum()
}

/// A figure's SVG as PNG, with `scale` pixels per point, and a text of its source in the file.
///
/// # Errors
/// When it is no SVG, or too large for memory.
pub fn png_of(svg: &str, scale: f32, source: Option<String>) -> Result<Vec<u8>, Failure> {
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_data(FONT.to_vec());
    let options = usvg::Options { fontdb: Arc::new(fonts), ..usvg::Options::default() };
    let tree = usvg::Tree::from_str(svg, &options).map_err(Failure::undrawn)?;
    let size = tree.size().to_int_size().scale_by(scale).ok_or_else(|| Failure::undrawn("the figure is empty"))?;
    let mut pixels =
        tiny_skia::Pixmap::new(size.width(), size.height()).ok_or_else(|| Failure::undrawn("the figure is empty"))?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(scale, scale), &mut pixels.as_mut());
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size.width(), size.height());
    encoder.set_color(png::ColorType::Rgba);
    // Lines on white compress better without a filter, and faster.
    encoder.set_filter(png::Filter::NoFilter);
    if let Some(source) = source {
        encoder.add_itxt_chunk("Source".into(), source).map_err(Failure::undrawn)?;
    }
    let mut writer = encoder.write_header().map_err(Failure::undrawn)?;
    writer.write_image_data(&pixels.take_demultiplied()).map_err(Failure::undrawn)?;
    writer.finish().map_err(Failure::undrawn)?;
    Ok(file)
}

/// What a figure shows, the beginning of the identity that its table has in its metadata, and the time now.
#[must_use]
pub fn source(what: &str, identity: &str) -> String {
    let now = host_time::now().strftime("%Y-%m-%d %H:%M %:z").to_string();
    format!("{what} {} · {now}", short(identity))
}

/// A drawing on a white background: elements of SVG and what surrounds them.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width and height, points.
    size: (f64, f64),
    elements: Svg,
    /// Where its data are from.
    source: Option<String>,
}

impl Deref for Picture {
    type Target = Svg;

    fn deref(&self) -> &Svg {
        &self.elements
    }
}

impl DerefMut for Picture {
    fn deref_mut(&mut self) -> &mut Svg {
        &mut self.elements
    }
}

impl Picture {
    /// An empty picture; width and height in points are rounded up.
    #[must_use]
    pub fn new(width: f64, height: f64) -> Self {
        let size = (width.ceil(), height.ceil());
        let mut elements = Svg::default();
        elements.rectangle((0.0, 0.0, size.0, size.1), WHITE.fill());
        Self { size, elements, source: None }
    }

    /// Draws a frame and what is within it ([`traces`]).
    pub fn panel(&mut self, frame: &PlotFrame, inside: &Svg) {
        [&frame.grid(), &frame.ticks(), &frame.edges(), inside].into_iter().for_each(|part| self.elements.add(part));
    }

    /// As [`Picture::panel`], with curves that the script of a page shows and zooms ([`traces::Traces::curve`]).
    pub fn live_panel(&mut self, frame: &PlotFrame, inside: &Svg) {
        let (left, top, right, bottom) = frame.bounds;
        let axis = |axis: &Axis| {
            let Axis { label, from, to, scale } = axis;
            serde_json::json!({ "label": shown(label), "from": from, "to": to, "isLog": *scale == Scale::Log })
        };
        let axes =
            serde_json::json!({ "bounds": [left, top, right, bottom], "x": axis(&frame.x), "y": axis(&frame.y) });
        let (mut ticks, mut panel) = (frame.grid(), Svg::default());
        ticks.add(&frame.ticks());
        panel.group(&[("data-ticks", "")], &ticks);
        panel.add(&frame.edges());
        panel.group(&[("data-inside", "")], inside);
        self.elements.group(&[("data-axes", &axes.to_string())], &panel);
    }

    /// A small note at the lower left, if there is one.
    pub fn note(&mut self, left: f64, words: Option<&str>) {
        if let Some(words) = words {
            self.elements.text(words, (left, self.size.1 - 2.0), Font::new(SMALL, GREY).above());
        }
    }

    /// States where the data are from: in small letters in the lower right corner, and in the metadata of SVG and PNG.
    #[must_use]
    pub fn of_source(mut self, source: &str) -> Self {
        let corner = (self.size.0 - SOURCE_MARGIN, self.size.1 - SOURCE_MARGIN);
        self.elements.text(source, corner, Font::new(SOURCE_SIZE, GREY).ending().above());
        self.source = Some(source.to_string());
        self
    }

    /// The figure as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let Self { size: (width, height), elements, source } = self;
        let metadata = source.as_ref().map(|source| {
            maud::html! { metadata { (shown(source)) " · " (crate::VERSION_LINE) } }
        });
        maud::html! {
            svg width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } font-family=(FAMILY) xmlns="http://www.w3.org/2000/svg" {
                @if let Some(metadata) = metadata { (metadata) }
                "\n" (PreEscaped(elements.to_string()))
            }
        }
        .into_string()
    }

    /// The figure as PNG, two pixels per point.
    ///
    /// # Errors
    /// When the figure is too large for memory.
    pub fn png(&self) -> Result<Vec<u8>, Failure> {
        let source = self.source.as_ref().map(|source| format!("{source} · {}", crate::VERSION_LINE));
        png_of(&self.svg(), PNG_SCALE, source)
    }

    /// Writes `stem.svg` and `stem.png` into `folder`.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write(&self, folder: &Path, stem: &str) -> Result<(), Failure> {
        self.save(&folder.join(format!("{stem}.svg")))?;
        self.save(&folder.join(format!("{stem}.png")))
    }

    /// Writes one file: PNG for the extension `.png`, else SVG.
    ///
    /// # Errors
    /// Names the file when it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), Failure> {
        let png = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
        let bytes = if png { self.png()? } else { self.svg().into_bytes() };
        own_files::replace(path, &bytes).map_err(Failure::undrawn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_as_wide_as_the_font_says() {
        // Units of the font, of which 2048 are its size.
        for (words, units) in [("M", 1767.0), ("ii", 2.0 * 569.0), ("", 0.0)] {
            assert!((width(words, 10.0) - 10.0 * units / 2048.0).abs() < 1e-3, "{words}: {}", width(words, 10.0));
        }
        assert!(width("\u{10ffff}", 10.0) > 0.0, "the sign of a missing character has a width");
    }
}
