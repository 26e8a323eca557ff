//! Draws a bifurcation diagram: the sampled cycles over the swept key, up and down; and a Poincaré section.

use plotters::element::{Circle, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::axis::{Axis, Frame, Scale};
use super::{Canvas, FigureError, GREY, INK, Picture, note, text};
use crate::study::bifurcation::{Direction, Sample};

const WIDTH: i32 = 980;
const UP: RGBColor = RGBColor(0x00, 0x72, 0xb2);
const DOWN: RGBColor = RGBColor(0xd5, 0x5e, 0x00);

/// The two panels: cycle maxima, and x at drive phase 0.
const PANELS: [(i32, i32); 2] = [(44, 330), (400, 686)];
const HEIGHT: i32 = 770;

/// A value of a sample, as drawn.
type Ordinate = fn(&Sample) -> f64;

fn tint(direction: Direction) -> RGBColor {
    if direction == Direction::Up { UP } else { DOWN }
}

fn legend(canvas: &Canvas, samples: &[Sample], title: &str, y: i32) -> Result<(), FigureError> {
    let left = |size: f64, colour: RGBColor| text(size, colour).pos(Pos::new(HPos::Left, VPos::Center));
    canvas.draw(&Text::new(title.to_string(), (92, y), left(15.0, INK))).map_err(FigureError::of)?;
    for (place, direction) in [Direction::Up, Direction::Down].into_iter().enumerate() {
        if samples.iter().any(|sample| sample.direction == direction) {
            let x = 800 + 80 * place as i32;
            canvas.draw(&Circle::new((x, y), 4, tint(direction).filled())).map_err(FigureError::of)?;
            let word = Text::new(direction.name().to_string(), (x + 10, y), left(13.0, GREY));
            canvas.draw(&word).map_err(FigureError::of)?;
        }
    }
    Ok(())
}

/// Draws cycle maxima and stroboscopic displacements over the key. `label`: quantity and unit of the key.
///
/// # Errors
/// The drawing library's error.
pub fn diagram(samples: &[Sample], label: &str, title: &str) -> Result<Picture, FigureError> {
    let of: [(&str, Ordinate); 2] = [
        ("cycle maximum of |x| (mm)", |sample| sample.cycle_max_m * 1e3),
        ("x at drive phase 0 (mm)", |sample| sample.x_m * 1e3),
    ];
    let frames: Vec<Frame> = PANELS
        .into_iter()
        .zip(of)
        .map(|((top, bottom), (ordinate, value))| Frame {
            x: Axis::around(label, Scale::Linear, samples.iter().map(|sample| sample.value)),
            y: Axis::around(ordinate, Scale::Linear, samples.iter().map(value)),
            bounds: (92, top, WIDTH - 30, bottom),
        })
        .collect();
    let picture = Picture::draw(WIDTH as u32, HEIGHT as u32, |canvas| {
        legend(canvas, samples, title, 20)?;
        let values = of.iter().flat_map(|(_, value)| samples.iter().map(value));
        note(canvas, (92, HEIGHT), Scale::Linear.undrawn(values).as_deref())?;
        frames.iter().try_for_each(|frame| frame.draw(canvas))
    })?;
    picture.overlay(|canvas| {
        for (frame, (_, value)) in frames.iter().zip(of) {
            dots(canvas, frame, samples.iter().map(|s| ((s.value, value(s)), s.direction)), 5)?;
        }
        Ok(())
    })
}

/// Draws x and x′ at drive phase 0 of the samples at one value.
///
/// # Errors
/// The drawing library's error.
pub fn section(samples: &[Sample], title: &str) -> Result<Picture, FigureError> {
    let frame = Frame {
        x: Axis::around("x at drive phase 0 (mm)", Scale::Linear, samples.iter().map(|s| s.x_m * 1e3)),
        y: Axis::around("x′ at drive phase 0 (mm/s)", Scale::Linear, samples.iter().map(|s| s.v_m_per_s * 1e3)),
        bounds: (92, 44, WIDTH - 30, 540),
    };
    let picture = Picture::draw(WIDTH as u32, 620, |canvas| {
        legend(canvas, samples, title, 20)?;
        let values = samples.iter().flat_map(|s| [s.x_m * 1e3, s.v_m_per_s * 1e3]);
        note(canvas, (92, 620), Scale::Linear.undrawn(values).as_deref())?;
        frame.draw(canvas)
    })?;
    picture.overlay(|canvas| {
        let point = |s: &Sample| ((s.x_m * 1e3, s.v_m_per_s * 1e3), s.direction);
        dots(canvas, &frame, samples.iter().map(point), 14)
    })
}

/// Draws squares, each place and colour once: a repeating motion has all its samples at few places.
fn dots(
    canvas: &Canvas,
    frame: &Frame,
    samples: impl Iterator<Item = ((f64, f64), Direction)>,
    half: i32,
) -> Result<(), FigureError> {
    let mut seen = std::collections::HashSet::new();
    for ((x, y), direction) in samples.filter(|((x, y), _)| frame.draws(*x, *y)) {
        let (x, y) = frame.fine_point(x, y);
        // Places nearer than a quarter of a dot look the same.
        if seen.insert((x / 3, y / 3, direction.name())) {
            let corners = [(x - half, y - half), (x + half, y + half)];
            canvas.draw(&Rectangle::new(corners, tint(direction).mix(0.8).filled())).map_err(FigureError::of)?;
        }
    }
    Ok(())
}
