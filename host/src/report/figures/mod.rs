//! Figures as SVG and, rendered from it, as PNG.
//!
//! This module has what all figures share: drawing surface, font, colours. Each kind of figure is a file of its own
//! ([`frequency_response`], [`time_histories`], [`peak_motion`], [`simulated_motion`]); [`campaign`] supplies the data of a run. The font is
//! built in, so a figure looks the same on every machine.

pub mod axis;
pub mod bifurcation;
pub mod branches;
pub mod campaign;
pub mod case_overlay;
#[cfg(test)]
mod colours;
pub mod comparison;
pub mod curves;
#[cfg(test)]
mod extremes;
pub mod frequency_response;
pub mod peak_motion;
pub mod set_ups;
pub mod simulated_motion;
pub mod study;
mod study_curves;
mod study_labels;
mod study_map;
pub mod symbols;
pub mod time_histories;
pub mod traces;
pub mod transfer_function;

use std::path::Path;
use std::sync::{Arc, Once};

use maud::PreEscaped;
use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::element::Text;
use plotters::prelude::{DrawingArea, IntoDrawingArea};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontFamily, FontStyle, IntoTextStyle, RGBColor, TextStyle, WHITE};
use resvg::{tiny_skia, usvg};

use self::axis::{Axis, Frame, Scale};
use crate::host_time;
use crate::input::shown;
use crate::run_folder::own_files;
use crate::run_folder::sealed_parquet::short;

/// A drawing surface, in points of the SVG.
pub type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Why a figure could not be drawn.
#[derive(Clone, Debug, thiserror::Error)]
#[error("cannot draw the figure: {0}")]
pub struct FigureError(pub String);

impl FigureError {
    /// From any error of the drawing library.
    pub fn of(error: impl std::fmt::Display) -> Self {
        Self(error.to_string())
    }
}

/// Name of the built-in font, then alternatives for an SVG viewer without it.
const FAMILY: &str = "DejaVu Sans, Verdana, Arial, sans-serif";
static FONT: &[u8] = include_bytes!("../../../fonts/DejaVuSans.ttf");

/// Steps of an overlay ([`Picture::overlay`]) per point.
pub const FINE: i32 = 10;

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

/// Width of a figure for a screen or a printed page, points.
pub const BROAD: i32 = 760;
/// Width of a figure for a phone, points.
pub const NARROW: i32 = 400;
/// Widest legend beside the axes, points; a wider one is below them.
const WIDEST_LEGEND: i32 = 310;

/// Size of the text that states where a figure's data are from, and its distance from the edges, points.
const SOURCE_SIZE: f64 = 8.0;
const SOURCE_MARGIN: i32 = 3;

/// Text, axes and frames.
pub const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
/// Grid lines.
pub const PALE: RGBColor = RGBColor(0xdd, 0xdd, 0xdd);
/// Captions and secondary text.
pub const GREY: RGBColor = RGBColor(0x66, 0x66, 0x66);

/// Number of distinct colours.
const COLOURS: usize = 12;

/// Colours that are distinct for colour-blind readers and in print: eight of Okabe & Ito, then four of Tol's muted scheme; repeated
/// after twelve.
#[must_use]
pub fn colour(index: usize) -> RGBColor {
    const ALL: [(u8, u8, u8); COLOURS] = [
        (0x00, 0x00, 0x00),
        (0xe6, 0x9f, 0x00),
        (0x56, 0xb4, 0xe9),
        (0x00, 0x72, 0xb2),
        (0xcc, 0x79, 0xa7),
        (0xd5, 0x5e, 0x00),
        (0x00, 0x9e, 0x73),
        (0x99, 0x99, 0x33),
        (0x88, 0x22, 0x55),
        (0x33, 0x22, 0x88),
        (0x44, 0xaa, 0x99),
        (0xaa, 0xaa, 0xaa),
    ];
    let (red, green, blue) = ALL[index % COLOURS];
    RGBColor(red, green, blue)
}

/// A text style of the built-in font, `size` in points.
pub fn text(size: f64, colour: RGBColor) -> TextStyle<'static> {
    register_font();
    let mut style = (FontFamily::Name(FAMILY), size).into_text_style(&(1u32, 1u32));
    style.color = colour.to_backend_color();
    style
}

/// Width of a text in the built-in font, in points.
#[must_use]
pub fn width(text_style: &TextStyle<'static>, text: &str) -> i32 {
    text_style.font.box_size(text).map_or(0, |(width, _)| i32::try_from(width).unwrap_or(0))
}

/// A text in lines of at most `most` points; a longer word has a line of its own.
#[must_use]
pub fn wrapped(text_style: &TextStyle<'static>, text: &str, most: i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if width(text_style, &format!("{line} {word}")) <= most => *line = format!("{line} {word}"),
            _ => lines.push(word.to_string()),
        }
    }
    lines
}

/// A small note at the lower left of a figure, if there is one; `left` and the figure's height.
fn note(canvas: &Canvas, (left, height): (i32, i32), words: Option<&str>) -> Result<(), FigureError> {
    let style = text(12.0, GREY).pos(Pos::new(HPos::Left, VPos::Bottom));
    let Some(words) = words else { return Ok(()) };
    canvas.draw(&Text::new(words.to_string(), (left, height - 2), style)).map_err(FigureError::of)
}

/// Registers the font with the drawing library, once.
fn register_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for style in [FontStyle::Normal, FontStyle::Bold, FontStyle::Italic, FontStyle::Oblique] {
            // Fails only for invalid font data.
            let _ = plotters::style::register_font(FAMILY, style, FONT);
        }
    });
}

/// A figure's SVG as PNG, with `scale` pixels per point.
///
/// # Errors
/// When it is no SVG, or too large for memory.
pub fn png_of(svg: &str, scale: f32) -> Result<Vec<u8>, FigureError> {
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_data(FONT.to_vec());
    let options = usvg::Options { fontdb: Arc::new(fonts), ..usvg::Options::default() };
    let tree = usvg::Tree::from_str(svg, &options).map_err(FigureError::of)?;
    let size = tree.size().to_int_size().scale_by(scale).ok_or_else(|| FigureError("the figure is empty".into()))?;
    let mut pixels =
        tiny_skia::Pixmap::new(size.width(), size.height()).ok_or_else(|| FigureError("the figure is empty".into()))?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(scale, scale), &mut pixels.as_mut());
    pixels.encode_png().map_err(FigureError::of)
}

/// Length of a PNG's signature and first chunk.
const PNG_HEAD: usize = 33;

/// A PNG with a text chunk of UTF-8 (`iTXt`) after its first one, which is its size.
fn with_text(mut png: Vec<u8>, keyword: &str, text: &str) -> Vec<u8> {
    let content = [b"iTXt", keyword.as_bytes(), &[0; 5], text.as_bytes()].concat();
    let length = u32::try_from(content.len() - 4).unwrap_or(0).to_be_bytes();
    let sum = crc32fast::hash(&content).to_be_bytes();
    png.splice(PNG_HEAD..PNG_HEAD, [&length[..], &content, &sum].concat());
    png
}

/// What a figure shows, the beginning of the identity that its table has in its metadata, and the time now.
#[must_use]
pub fn source(what: &str, identity: &str) -> String {
    let now = host_time::now().strftime("%Y-%m-%d %H:%M %:z").to_string();
    format!("{what} {} · {now}", short(identity))
}

/// What `draw` draws, as elements of SVG.
fn elements(draw: impl FnOnce(&Canvas) -> Result<(), FigureError>) -> Result<String, FigureError> {
    let mut svg = String::new();
    {
        // They are cut out of an SVG of its own, which only has to be large enough.
        let canvas = SVGBackend::with_string(&mut svg, (100_000, 100_000)).into_drawing_area();
        draw(&canvas)?;
        canvas.present().map_err(FigureError::of)?;
    }
    let inside = || {
        let start = svg.find("<svg")?;
        svg.get(start + svg[start..].find('>')? + 1..svg.rfind("</svg>")?)
    };
    let inside = inside().ok_or_else(|| FigureError("the layer is not SVG".into()))?;
    Ok(shown(inside).into_owned())
}

/// A finished drawing.
#[derive(Clone, Debug)]
pub struct Picture {
    svg: String,
    size: (u32, u32),
    /// Where its data are from.
    source: Option<String>,
}

impl Picture {
    /// Draws on a white background of `width` × `height` points.
    ///
    /// # Errors
    /// The drawing library's error.
    pub fn draw(
        width: u32,
        height: u32,
        draw: impl FnOnce(&Canvas) -> Result<(), FigureError>,
    ) -> Result<Self, FigureError> {
        register_font();
        let mut svg = String::new();
        {
            let canvas = SVGBackend::with_string(&mut svg, (width, height)).into_drawing_area();
            canvas.fill(&WHITE.to_rgba()).map_err(FigureError::of)?;
            draw(&canvas)?;
            canvas.present().map_err(FigureError::of)?;
        }
        // XML forbids most control characters, and labels may have any.
        Ok(Self { svg: shown(&svg).into_owned(), size: (width, height), source: None })
    }

    /// Draws an overlay in tenths of a point, because curves need finer steps than whole points.
    ///
    /// # Errors
    /// The drawing library's error.
    pub fn overlay(self, draw: impl FnOnce(&Canvas) -> Result<(), FigureError>) -> Result<Self, FigureError> {
        let layer = elements(draw)?;
        Ok(self.with_elements(&format!("<g transform=\"scale({})\">{layer}</g>\n", 1.0 / f64::from(FINE))))
    }

    /// Draws above everything so far, in points.
    ///
    /// # Errors
    /// The drawing library's error.
    pub fn above(self, draw: impl FnOnce(&Canvas) -> Result<(), FigureError>) -> Result<Self, FigureError> {
        let layer = elements(draw)?;
        Ok(self.with_elements(&format!("<g>{layer}</g>\n")))
    }

    /// Draws an entry of a legend, with which the script of a page hides the curve of this place ([`traces`]), and `above` it elements of SVG.
    ///
    /// # Errors
    /// The drawing library's error.
    pub fn legend_entry(
        self,
        place: usize,
        above: &str,
        draw: impl FnOnce(&Canvas) -> Result<(), FigureError>,
    ) -> Result<Self, FigureError> {
        let entry = elements(draw)?;
        Ok(self.with_elements(&format!("<g data-legend=\"{place}\">{entry}{above}</g>\n")))
    }

    /// Draws a frame and what is within it: elements of SVG, whose curves the script of a page shows and zooms ([`traces`]).
    ///
    /// # Errors
    /// The drawing library's error.
    pub fn framed(self, frame: &Frame, inside: &str) -> Result<Self, FigureError> {
        let (left, top, right, bottom) = frame.bounds;
        let axis = |axis: &Axis| {
            let Axis { label, from, to, scale } = axis;
            serde_json::json!({ "label": label, "from": from, "to": to, "isLog": *scale == Scale::Log })
        };
        let axes =
            serde_json::json!({ "bounds": [left, top, right, bottom], "x": axis(&frame.x), "y": axis(&frame.y) });
        let (ticks, edges) =
            (elements(|canvas| frame.draw_ticks(canvas))?, elements(|canvas| frame.draw_edges(canvas))?);
        let group = maud::html! {
            g data-axes=(axes) {
                g data-ticks="" { (PreEscaped(ticks)) }
                (PreEscaped(edges))
                g data-inside="" { (PreEscaped(inside)) }
            }
        };
        // XML forbids most control characters, and names may have any.
        Ok(self.with_elements(&shown(&group.into_string())))
    }

    /// States where the data are from: in small letters in the lower right corner, and in the metadata of SVG and PNG.
    ///
    /// # Errors
    /// The drawing library's error.
    pub fn of_source(self, source: &str) -> Result<Self, FigureError> {
        let (right, bottom) = (self.size.0 as i32 - SOURCE_MARGIN, self.size.1 as i32 - SOURCE_MARGIN);
        let style = text(SOURCE_SIZE, GREY).pos(Pos::new(HPos::Right, VPos::Bottom));
        let mut picture = self.above(|canvas| {
            canvas.draw(&Text::new(source.to_string(), (right, bottom), style)).map_err(FigureError::of)
        })?;
        let metadata = maud::html! { metadata { (shown(source)) " · " (crate::VERSION_LINE) } }.into_string();
        if let Some(inside) = picture.svg.find("<svg").and_then(|at| Some(at + picture.svg[at..].find('>')? + 1)) {
            picture.svg.insert_str(inside, &metadata);
        }
        picture.source = Some(source.to_string());
        Ok(picture)
    }

    /// Adds elements of SVG that the drawing library does not have, above everything so far. `elements` must be well-formed.
    #[must_use]
    pub fn with_elements(mut self, elements: &str) -> Self {
        if let Some(end) = self.svg.rfind("</svg>") {
            self.svg.insert_str(end, elements);
        }
        self
    }

    /// The figure as SVG.
    #[must_use]
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// The figure as PNG, two pixels per point.
    ///
    /// # Errors
    /// When the figure is too large for memory.
    pub fn png(&self) -> Result<Vec<u8>, FigureError> {
        let png = png_of(&self.svg, PNG_SCALE)?;
        Ok(match &self.source {
            Some(source) => with_text(png, "Source", &format!("{source} · {}", crate::VERSION_LINE)),
            None => png,
        })
    }

    /// Writes `stem.svg` and `stem.png` into `folder`.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write(&self, folder: &Path, stem: &str) -> Result<(), FigureError> {
        self.save(&folder.join(format!("{stem}.svg")))?;
        self.save(&folder.join(format!("{stem}.png")))
    }

    /// Writes one file: PNG for the extension `.png`, else SVG.
    ///
    /// # Errors
    /// Names the file when it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FigureError> {
        let png = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
        let bytes = if png { &self.png()? } else { self.svg.as_bytes() };
        own_files::replace(path, bytes).map_err(FigureError::of)
    }
}
