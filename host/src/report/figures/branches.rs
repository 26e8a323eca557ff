//! Draws branches of periodic orbits: the largest |x| over the parameter, stable orbits solid, unstable ones dashed, special
//! points marked.

use crate::continuation::{FoundBranch, FoundBranches, FoundOrbit};
use crate::failure::Failure;
use crate::report::branch_table;
use crate::report::figures::symbols;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{GREY, INK, WHITE, colour};
use crate::report::plot::svg::{Bounds, Colour, Font, PicturePlace, Svg};
use crate::report::plot::traces::{Traces, shape};
use crate::report::plot::{Picture, SMALL, source};

const SIZE: (f64, f64) = (980.0, 620.0);
const BOUNDS: Bounds = (82.0, 34.0, 950.0, 480.0);

/// Dashes of unstable orbits.
const UNSTABLE: &str = "7 5";

/// Room of a label beside a mark, points.
const ROOM: (f64, f64) = (20.0, 14.0);

/// Kinds of special points, their abbreviations, and the shapes of their marks.
const MARKS: [(&str, &str, usize); 6] = [
    ("fold", "F", 2),
    ("period doubling", "PD", 1),
    ("Neimark-Sacker", "NS", 3),
    ("symmetry breaking", "SB", 4),
    ("branch point", "BP", 5),
    (GRAZING, "G", 0),
];

/// The kind whose mark is hollow.
const GRAZING: &str = "grazing";

/// The mark of a kind around 0, 0.
fn sign(kind: &str, number: usize, tint: Colour) -> Svg {
    shape(number, if kind == GRAZING { WHITE } else { tint }.fill().edged(tint, 1.0))
}

/// Draws the branches.
///
/// # Errors
/// A table without an identity.
pub fn draw(found: &FoundBranches) -> Result<Picture, Failure> {
    let orbits = || found.branches.iter().flat_map(|branch| &branch.orbits);
    let frame = PlotFrame {
        x: Axis::around(
            symbols::label(&found.parameter, || found.reference),
            Scale::Linear,
            orbits().map(|orbit| orbit.parameter),
        ),
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
    let lines =
        [LegendEntry::line("stable", INK.stroke(2.0)), LegendEntry::line("unstable", INK.stroke(2.0).dashed(UNSTABLE))];
    legend::rows(&mut picture, (BOUNDS.0, BOUNDS.3 + 76.0), BOUNDS.2, &lines);
    let is_there = |kind: &str| found.branches.iter().flat_map(|b| &b.special_points).any(|s| s.kind == kind);
    let marks = MARKS.into_iter().filter(|(kind, ..)| is_there(kind));
    let entry = |(kind, short, number)| LegendEntry::mark(format!("{short}: {kind}"), &sign(kind, number, GREY));
    legend::rows(&mut picture, (BOUNDS.0, BOUNDS.3 + 102.0), SIZE.0, &marks.map(entry).collect::<Vec<_>>());
    let table = branch_table::orbits(found).map_err(Failure::undrawn)?;
    Ok(picture.of_source(&source("continuation", &branch_table::identity(&table))))
}

fn tint(branch: &FoundBranch) -> Colour {
    colour(branch.number - 1)
}

/// Draws the curve in runs of the same stability.
fn curve(traces: &mut Traces, frame: &PlotFrame, branch: &FoundBranch) {
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
fn marks(svg: &mut Svg, frame: &PlotFrame, branch: &FoundBranch, labelled: &mut Vec<PicturePlace>) {
    for special in &branch.special_points {
        if !frame.draws(special.parameter, special.max_abs_x_m * 1e3) {
            continue;
        }
        let Some((kind, short, number)) = MARKS.iter().find(|(kind, ..)| *kind == special.kind) else { continue };
        let (x, y) = frame.point(special.parameter, special.max_abs_x_m * 1e3);
        svg.at((x, y), &sign(kind, *number, tint(branch)));
        if !labelled.iter().any(|(a, b)| (a - x).abs() < ROOM.0 && (b - y).abs() < ROOM.1) {
            labelled.push((x, y));
            svg.text(short, (x + 6.0, y - 5.0), Font::new(SMALL, INK).above());
        }
    }
}
