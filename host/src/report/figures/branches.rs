//! Draws branches of periodic orbits: the largest |x| over the parameter, stable orbits solid, unstable ones dashed, special
//! points marked.

use plotters::element::{PathElement, Polygon, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor, WHITE};

use super::axis::{Axis, Frame, Scale};
use super::{Canvas, FINE, FigureError, GREY, INK, Picture, colour, note, source, text};
use crate::continuation::{Found, FoundBranch, FoundOrbit};
use crate::report::branch_table;

const WIDTH: i32 = 980;
const HEIGHT: i32 = 620;
const BOUNDS: (i32, i32, i32, i32) = (82, 34, 950, 480);

/// Length of a dash and of a gap, in points.
const DASH: (f64, f64) = (7.0, 5.0);

/// Mark of a kind of special point.
struct Mark {
    /// Name of the kind.
    name: &'static str,
    /// Its abbreviation.
    short: &'static str,
    /// Corners, in points.
    corners: &'static [(i32, i32)],
}

const fn mark_of(name: &'static str, short: &'static str, corners: &'static [(i32, i32)]) -> Mark {
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

/// Draws the branches.
///
/// # Errors
/// The drawing library's error.
pub fn draw(found: &Found) -> Result<Picture, FigureError> {
    let orbits = || found.branches.iter().flat_map(|branch| &branch.orbits);
    let frame = Frame {
        x: Axis::around(found.key.label, Scale::Linear, orbits().map(|orbit| orbit.parameter)),
        y: Axis::around("max |x| (mm)", Scale::Linear, orbits().map(|orbit| orbit.max_abs_x_m * 1e3)),
        bounds: BOUNDS,
    };
    let picture = Picture::draw(WIDTH as u32, HEIGHT as u32, |canvas| {
        frame.draw(canvas)?;
        note(
            canvas,
            (BOUNDS.0, HEIGHT),
            Scale::Linear.undrawn(orbits().map(|orbit| orbit.max_abs_x_m * 1e3)).as_deref(),
        )?;
        legend(canvas, found)
    })?;
    let picture =
        picture.overlay(|canvas| found.branches.iter().try_for_each(|branch| curve(canvas, &frame, branch)))?;
    // Marks lie over the curves.
    let picture = picture.overlay(|canvas| {
        let mut labelled = Vec::new();
        found.branches.iter().try_for_each(|branch| marks(canvas, &frame, branch, &mut labelled))
    })?;
    let table = branch_table::orbits(found).map_err(FigureError::of)?;
    picture.of_source(&source("continuation", &branch_table::identity(&table)))
}

fn tint(branch: &FoundBranch) -> RGBColor {
    colour(branch.number - 1)
}

fn at(frame: &Frame, orbit: &FoundOrbit) -> (f64, f64) {
    let (x, y) = frame.fine_point(orbit.parameter, orbit.max_abs_x_m * 1e3);
    (f64::from(x), f64::from(y))
}

/// Draws the curve in runs of the same stability.
fn curve(canvas: &Canvas, frame: &Frame, branch: &FoundBranch) -> Result<(), FigureError> {
    let is_drawn = |orbit: &FoundOrbit| frame.draws(orbit.parameter, orbit.max_abs_x_m * 1e3);
    branch.orbits.split(|orbit| !is_drawn(orbit)).try_for_each(|orbits| piece(canvas, frame, branch, orbits))
}

fn piece(canvas: &Canvas, frame: &Frame, branch: &FoundBranch, mut rest: &[FoundOrbit]) -> Result<(), FigureError> {
    while let Some(first) = rest.first() {
        let count = rest.iter().take_while(|orbit| orbit.is_stable == first.is_stable).count();
        // A run reaches to the first orbit of the next one.
        let run: Vec<(f64, f64)> = rest[..rest.len().min(count + 1)].iter().map(|orbit| at(frame, orbit)).collect();
        if first.is_stable {
            line(canvas, &run, branch)?;
        } else {
            dashes(&run).iter().try_for_each(|dash| line(canvas, dash, branch))?;
        }
        rest = &rest[count..];
    }
    Ok(())
}

fn line(canvas: &Canvas, points: &[(f64, f64)], branch: &FoundBranch) -> Result<(), FigureError> {
    let points: Vec<(i32, i32)> = points.iter().map(|(x, y)| (x.round() as i32, y.round() as i32)).collect();
    canvas.draw(&PathElement::new(points, tint(branch).stroke_width(2 * FINE as u32))).map_err(FigureError::of)
}

/// Room of a label, in steps of the overlay.
const LABEL: (i32, i32) = (20 * FINE, 14 * FINE);

/// Cuts a path into dashes.
fn dashes(path: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    let fine = f64::from(FINE);
    let (mut is_drawn, mut left) = (true, DASH.0 * fine);
    let mut found = Vec::new();
    let mut dash = path.first().map(|point| vec![*point]).unwrap_or_default();
    for pair in path.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        loop {
            let length = (to.0 - from.0).hypot(to.1 - from.1);
            if length <= left {
                left -= length;
                dash.push(to);
                break;
            }
            let share = left / length;
            from = (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1));
            dash.push(from);
            if is_drawn {
                found.push(std::mem::take(&mut dash));
            }
            dash = vec![from];
            is_drawn = !is_drawn;
            left = fine * if is_drawn { DASH.0 } else { DASH.1 };
        }
    }
    if is_drawn && dash.len() > 1 {
        found.push(dash);
    }
    found
}

/// Marks the special points; `labelled` has the places of the labels so far, so that none lies on another.
fn marks(
    canvas: &Canvas,
    frame: &Frame,
    branch: &FoundBranch,
    labelled: &mut Vec<(i32, i32)>,
) -> Result<(), FigureError> {
    for special in &branch.special_points {
        if !frame.draws(special.parameter, special.max_abs_x_m * 1e3) {
            continue;
        }
        let Some(Mark { short, corners, .. }) = MARKS.iter().find(|mark| mark.name == special.kind) else { continue };
        let (x, y) = frame.fine_point(special.parameter, special.max_abs_x_m * 1e3);
        let inside = if special.is_grazing() { WHITE } else { tint(branch) };
        mark(canvas, (x, y), corners, (inside, tint(branch)), FINE)?;
        let style = text(12.0 * f64::from(FINE), INK).pos(Pos::new(HPos::Left, VPos::Bottom));
        if !labelled.iter().any(|(a, b)| (a - x).abs() < LABEL.0 && (b - y).abs() < LABEL.1) {
            labelled.push((x, y));
            canvas
                .draw(&Text::new((*short).to_string(), (x + 6 * FINE, y - 5 * FINE), style))
                .map_err(FigureError::of)?;
        }
    }
    Ok(())
}

fn mark(
    canvas: &Canvas,
    (x, y): (i32, i32),
    corners: &[(i32, i32)],
    (inside, edge): (RGBColor, RGBColor),
    unit: i32,
) -> Result<(), FigureError> {
    let mut outline: Vec<(i32, i32)> = corners.iter().map(|(dx, dy)| (x + dx * unit, y + dy * unit)).collect();
    canvas.draw(&Polygon::new(outline.clone(), inside.filled())).map_err(FigureError::of)?;
    outline.push(outline[0]);
    canvas.draw(&PathElement::new(outline, edge.stroke_width(unit as u32))).map_err(FigureError::of)
}

/// Explains lines and marks below the axes.
fn legend(canvas: &Canvas, found: &Found) -> Result<(), FigureError> {
    let style = text(13.0, INK).pos(Pos::new(HPos::Left, VPos::Center));
    let (left, _, _, bottom) = BOUNDS;
    let mut x = left;
    let y = bottom + 76;
    for (word, is_stable) in [("stable", true), ("unstable", false)] {
        let path = [(f64::from(x), f64::from(y)), (f64::from(x + 36), f64::from(y))];
        let pieces = if is_stable {
            vec![vec![x, x + 36]]
        } else {
            vec![vec![x, x + 8], vec![x + 14, x + 22], vec![x + 28, x + 36]]
        };
        for piece in pieces {
            let points = piece.iter().map(|x| (*x, path[0].1 as i32)).collect::<Vec<_>>();
            canvas.draw(&PathElement::new(points, INK.stroke_width(2))).map_err(FigureError::of)?;
        }
        canvas.draw(&Text::new(word.to_string(), (x + 44, y), style.clone())).map_err(FigureError::of)?;
        x += 130;
    }
    let mut x = left;
    let y = y + 26;
    for Mark { name, short, corners } in MARKS {
        let is_there = found.branches.iter().flat_map(|b| &b.special_points).any(|special| special.kind == name);
        if !is_there {
            continue;
        }
        let inside = if name == "grazing" { WHITE } else { GREY };
        mark(canvas, (x + 6, y), corners, (inside, GREY), 1)?;
        let label = format!("{short}: {name}");
        canvas.draw(&Text::new(label.clone(), (x + 18, y), style.clone())).map_err(FigureError::of)?;
        x += 40 + super::width(&style, &label);
    }
    Ok(())
}
