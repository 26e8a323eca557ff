//! Draws a bifurcation diagram: the sampled cycles over the swept key, up and down; and a Poincaré section.

use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{INK, colour};
use crate::report::plot::svg::{Bounds, Colour, Font};
use crate::report::plot::traces::{Traces, circle};
use crate::report::plot::{Picture, TITLE};
use crate::study::bifurcation::{Direction, Sample};

const LEFT: f64 = 92.0;
const RIGHT: f64 = 950.0;
const WIDTH: f64 = 980.0;

/// The two panels: cycle maxima, and x at drive phase 0.
const PANELS: [(f64, f64); 2] = [(44.0, 330.0), (400.0, 686.0)];
const HEIGHT: f64 = 770.0;

/// The frame of a section and the height of its figure.
const SECTION: (Bounds, f64) = ((LEFT, 44.0, RIGHT, 540.0), 620.0);

/// Sizes of dots, points: of the many of a diagram, and of the few of a section.
const DOTS: (f64, f64) = (1.0, 2.8);

const DIRECTIONS: [Direction; 2] = [Direction::Up, Direction::Down];

/// A value of a sample, as drawn.
type SampleValue = fn(&Sample) -> f64;

fn tint(direction: Direction) -> Colour {
    if direction == Direction::Up { colour(3) } else { colour(5) }
}

fn head(picture: &mut Picture, samples: &[Sample], title: &str) {
    picture.text(title, (LEFT, 20.0), Font::new(TITLE, INK));
    let has = |direction: &Direction| samples.iter().any(|sample| sample.direction == *direction);
    let entry =
        |direction: Direction| LegendEntry::mark(direction.name(), &circle(4.0, tint(direction).fill())).of_sign();
    let entries: Vec<LegendEntry> = DIRECTIONS.into_iter().filter(has).map(entry).collect();
    legend::rows(picture, (790.0, 20.0), WIDTH, &entries);
}

/// Draws cycle maxima and stroboscopic displacements over the key. `label`: quantity and unit of the key.
#[must_use]
pub fn diagram(samples: &[Sample], label: &str, title: &str) -> Picture {
    let of: [(&str, SampleValue); 2] = [
        ("cycle maximum of |x| (mm)", |sample| sample.cycle_max_m * 1e3),
        ("x at drive phase 0 (mm)", |sample| sample.x_m * 1e3),
    ];
    let mut picture = Picture::new(WIDTH, HEIGHT);
    head(&mut picture, samples, title);
    let values = of.iter().flat_map(|(_, value)| samples.iter().map(value));
    picture.note(LEFT, Scale::Linear.undrawn(values).as_deref());
    for ((top, bottom), (ordinate, value)) in PANELS.into_iter().zip(of) {
        let frame = PlotFrame {
            x: Axis::around(label, Scale::Linear, samples.iter().map(|sample| sample.value)),
            y: Axis::around(ordinate, Scale::Linear, samples.iter().map(value)),
            bounds: (LEFT, top, RIGHT, bottom),
        };
        dots(&mut picture, &frame, samples, |sample| (sample.value, value(sample)), DOTS.0);
    }
    picture
}

/// Draws x and x′ at drive phase 0 of the samples at one value.
#[must_use]
pub fn section(samples: &[Sample], title: &str) -> Picture {
    let (bounds, height) = SECTION;
    let at = |s: &Sample| (s.x_m * 1e3, s.v_m_per_s * 1e3);
    let frame = PlotFrame {
        x: Axis::around("x at drive phase 0 (mm)", Scale::Linear, samples.iter().map(|s| at(s).0)),
        y: Axis::around("x′ at drive phase 0 (mm/s)", Scale::Linear, samples.iter().map(|s| at(s).1)),
        bounds,
    };
    let mut picture = Picture::new(WIDTH, height);
    head(&mut picture, samples, title);
    picture.note(LEFT, Scale::Linear.undrawn(samples.iter().flat_map(|s| [at(s).0, at(s).1])).as_deref());
    dots(&mut picture, &frame, samples, at, DOTS.1);
    picture
}

/// Draws the samples: a repeating motion has all of them at few places.
fn dots(picture: &mut Picture, frame: &PlotFrame, samples: &[Sample], at: impl Fn(&Sample) -> (f64, f64), size: f64) {
    let mut traces = Traces::new(frame);
    for direction in DIRECTIONS {
        let own = samples.iter().filter(|sample| sample.direction == direction);
        traces.squares(own.map(&at), size, tint(direction));
    }
    picture.panel(frame, &traces.svg());
}
