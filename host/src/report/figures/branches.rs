//! Draws branches of periodic orbits: the largest |x| over the parameter, stable orbits solid, unstable ones dashed, special
//! points marked.

use crate::continuation::{Found, FoundBranch, FoundOrbit};
use crate::report::branch_table;
use crate::report::plot::axis::{Axis, Frame, Scale};
use crate::report::plot::legend::{self, Entry};
use crate::report::plot::palette::{GREY, INK, WHITE, colour};
use crate::report::plot::svg::{Bounds, Colour, Font, Place, Svg};
use crate::report::plot::traces::Traces;
use crate::report::plot::{FigureError, Picture, SMALL, source};

const SIZE: (f64, f64) = (980.0, 620.0);
const BOUNDS: Bounds = (82.0, 34.0, 950.0, 480.0);

/// Dashes of unstable orbits.
const UNSTABLE: &str = "7 5";

/// Room of a label beside a mark, points.
const ROOM: (f64, f64) = (20.0, 14.0);

/// Mark of a kind of special point.
struct Mark {
    /// Name of the kind.
    name: &'static str,
    /// Its abbreviation.
    short: &'static str,
    /// Corners, in points.
    corners: &'static [(i8, i8)],
}

const fn mark_of(name: &'static str, short: &'static str, corners: &'static [(i8, i8)]) -> Mark {
    Mark { name, short, corners }
}

/// Marks of the special points.
const MARKS: [Mark; 6] = [
    mark_of("fold", "F", &[(0, -6), (6, 5), (-6, 5)]),
    mark_of("period doubling", "PD", &[(-5, -5), (5, -5), (5, 5), (-5, 5)]),
    mark_of("Neimark-Sacker", "NS", &[(0, -6), (6, 0), (0, 6), (-6, 0)]),
    mark_of("symmetry breaking", "SB", &[(0, 6), (6, -5), (-6, -5)]),
    mark_of("branch point", "BP", &[(-6, 0), (-3, -5), (3, -5), (6, 0), (3, 5), (-3, 5)]),
    mark_of("grazing", "G", &[(4, 0), (3, 3), (0, 4), (-3, 3), (-4, 0), (-3, -3), (0, -4), (3, -3)]),
];

impl Mark {
    /// The mark around 0, 0: filled, or hollow for a grazing.
    fn sign(&self, tint: Colour) -> Svg {
        let corners = self.corners.iter().map(|(x, y)| (f64::from(*x), f64::from(*y)));
        let inside = if self.name == "grazing" { WHITE } else { tint };
        let mut svg = Svg::default();
        svg.area(corners, inside.fill().edged(tint, 1.0));
        svg
    }
}

/// Draws the branches.
///
/// # Errors
/// A table without an identity.
pub fn draw(found: &Found) -> Result<Picture, FigureError> {
    let orbits = || found.branches.iter().flat_map(|branch| &branch.orbits);
    let frame = Frame {
        x: Axis::around(found.key.label, Scale::Linear, orbits().map(|orbit| orbit.parameter)),
        y: Axis::around("max |x| (mm)", Scale::Linear, orbits().map(|orbit| orbit.max_abs_x_m * 1e3)),
        bounds: BOUNDS,
    };
    let mut inside = Traces::new(&frame);
    found.branches.iter().for_each(|branch| curve(&mut inside, &frame, branch));
    let mut inside = inside.svg();
    // Marks lie over the curves.
    let mut labelled = Vec::new();
    found.branches.iter().for_each(|branch| marks(&mut inside, &frame, branch, &mut labelled));
    let mut picture = Picture::new(SIZE.0, SIZE.1);
    picture.panel(&frame, &inside);
    picture.note(BOUNDS.0, Scale::Linear.undrawn(orbits().map(|orbit| orbit.max_abs_x_m * 1e3)).as_deref());
    let lines = [Entry::line("stable", INK.stroke(2.0)), Entry::line("unstable", INK.stroke(2.0).dashed(UNSTABLE))];
    legend::rows(&mut picture, (BOUNDS.0, BOUNDS.3 + 76.0), BOUNDS.2, &lines);
    let is_there =
        |mark: &Mark| found.branches.iter().flat_map(|b| &b.special_points).any(|special| special.kind == mark.name);
    let entry = |mark: Mark| Entry::mark(format!("{}: {}", mark.short, mark.name), &mark.sign(GREY));
    let marks: Vec<Entry> = MARKS.into_iter().filter(is_there).map(entry).collect();
    legend::rows(&mut picture, (BOUNDS.0, BOUNDS.3 + 102.0), SIZE.0, &marks);
    let table = branch_table::orbits(found).map_err(FigureError::of)?;
    Ok(picture.of_source(&source("continuation", &branch_table::identity(&table))))
}

fn tint(branch: &FoundBranch) -> Colour {
    colour(branch.number - 1)
}

/// Draws the curve in runs of the same stability.
fn curve(traces: &mut Traces, frame: &Frame, branch: &FoundBranch) {
    let at = |orbit: &FoundOrbit| (orbit.parameter, orbit.max_abs_x_m * 1e3);
    let is_drawn = |orbit: &FoundOrbit| frame.draws(at(orbit).0, at(orbit).1);
    for mut rest in branch.orbits.split(|orbit| !is_drawn(orbit)) {
        while let Some(first) = rest.first() {
            let count = rest.iter().take_while(|orbit| orbit.is_stable == first.is_stable).count();
            // A run reaches to the first orbit of the next one.
            let run = rest[..rest.len().min(count + 1)].iter().map(at);
            traces.line(run, tint(branch).stroke(2.0).dashed(if first.is_stable { "" } else { UNSTABLE }));
            rest = &rest[count..];
        }
    }
}

/// Marks the special points; `labelled` has the places of the labels so far, so that none lies on another.
fn marks(svg: &mut Svg, frame: &Frame, branch: &FoundBranch, labelled: &mut Vec<Place>) {
    for special in &branch.special_points {
        if !frame.draws(special.parameter, special.max_abs_x_m * 1e3) {
            continue;
        }
        let Some(mark) = MARKS.iter().find(|mark| mark.name == special.kind) else { continue };
        let (x, y) = frame.point(special.parameter, special.max_abs_x_m * 1e3);
        svg.at((x, y), &mark.sign(tint(branch)));
        if !labelled.iter().any(|(a, b)| (a - x).abs() < ROOM.0 && (b - y).abs() < ROOM.1) {
            labelled.push((x, y));
            svg.text(mark.short, (x + 6.0, y - 5.0), Font::new(SMALL, INK).above());
        }
    }
}
