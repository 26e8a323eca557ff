//! A simulated motion that moves: a frame sways, a beam bends, particles fly from wall to wall. It is an SVG whose elements have their places over time,
//! so a browser plays it without a script.

use damprig_structures::Support;

use crate::failure::Failure;
use crate::report::describe;
use crate::report::numbers::significant;
use crate::report::plot::palette::{GREY, INK, WHITE, colour};
use crate::report::plot::svg::{Colour, Font, PicturePlace, Svg};
use crate::report::plot::{LABEL, Picture, TITLE};
use crate::simulation::Case;
use crate::simulation::frames::{Frame, Frames};
use crate::structure::OnBeam;

/// Width of the picture, and the middle of what moves, points.
const WIDTH: f64 = 640.0;
const MIDDLE: f64 = 300.0;

/// Above the structure, and between two places, points.
const TOP: f64 = 64.0;
const APART: f64 = 84.0;

/// Most points between the first and the last place.
const MOST: f64 = 640.0;

/// The largest displacement on the picture, points.
const LARGEST: f64 = 90.0;

/// Half the width of a floor, its height, half the width of a cavity and the radius of a particle, points.
const HALF_FLOOR: f64 = 70.0;
const FLOOR: f64 = 12.0;
const HALF_CAVITY: f64 = 30.0;
const RADIUS: f64 = 7.0;

/// Ends of a beam, points from the left.
const BEAM: (f64, f64) = (70.0, 560.0);

/// Points of a drawn beam.
const BEAM_POINTS: usize = 25;

/// Seconds that a cycle takes to watch, at least.
const SECONDS_PER_CYCLE: f64 = 2.0;

/// More places than these have no columns between them.
const MAX_COLUMNS: usize = 24;

/// Draws the frames of a case.
///
/// # Errors
/// A run that ended before them.
pub fn draw(case: &Case, frames: &Frames) -> Result<Picture, Failure> {
    if frames.all().len() < 2 {
        return Err(Failure::undrawn("the run was stopped before the cycles that are animated"));
    }
    let stage = Scene::of(case, frames);
    let mut picture = Picture::new(WIDTH, stage.height() + 30.0);
    picture.text(&format!("{}: {}", case.name, describe::excitation(case)), (24.0, 22.0), Font::new(TITLE, INK));
    picture.text(&stage.caption(), (24.0, 42.0), Font::new(LABEL, GREY));
    picture.text(&stage.notes(), (24.0, 58.0), Font::new(LABEL, GREY));
    stage.draw(&mut picture);
    Ok(picture)
}

/// How the places of a structure are drawn.
enum StructureLayout<'a> {
    /// Floors of a frame, from below.
    Floors,
    /// Masses on rails, each displaced sideways.
    Rails,
    /// Along a beam.
    Beam(&'a OnBeam),
}

struct Scene<'a> {
    case: &'a Case,
    frames: &'a Frames,
    layout: StructureLayout<'a>,
    names: Vec<String>,
    /// Points for a metre of displacement.
    scale: f64,
    /// Seconds of watching.
    lasts_s: f64,
}

impl<'a> Scene<'a> {
    fn of(case: &'a Case, frames: &'a Frames) -> Self {
        let several = case.multi_degree.as_ref();
        let layout = match several {
            Some(of) if of.is_frame() => StructureLayout::Floors,
            Some(of) => of.on_beam.as_ref().map_or(StructureLayout::Rails, StructureLayout::Beam),
            None => StructureLayout::Rails,
        };
        let of_places = frames.all().iter().flat_map(|frame| frame.places_m.iter().chain([&frame.z_m]).copied());
        let mut largest_m = of_places.map(f64::abs).fold(0.0, f64::max);
        if let StructureLayout::Beam(of) = &layout {
            // Its end moves furthest, and need not be a place.
            let end =
                |frame: &Frame| Spline::through(&knots(of, frame), of.support == Support::Cantilever).at(of.length_m);
            largest_m = frames.all().iter().map(end).map(f64::abs).fold(largest_m, f64::max);
        }
        let length_s = frames.step_s() * frames.all().len() as f64;
        let slower = (SECONDS_PER_CYCLE / case.cycle_s()).max(1.0);
        Self {
            case,
            frames,
            layout,
            names: several.map_or_else(|| vec!["structure".into()], |of| of.places.clone()),
            scale: if largest_m > 0.0 { LARGEST / largest_m } else { 0.0 },
            lasts_s: slower * length_s,
        }
    }

    fn places(&self) -> usize {
        self.names.len()
    }

    /// Points between two floors or rails.
    fn apart(&self) -> f64 {
        (MOST / self.places() as f64).min(APART)
    }

    fn height(&self) -> f64 {
        match self.layout {
            StructureLayout::Beam(_) => TOP + 3.0 * LARGEST + 2.0 * HALF_CAVITY,
            _ => TOP + (self.places() as f64 + 0.5) * self.apart() + 40.0,
        }
    }

    /// What is said below the title: which time, how slow, how large.
    fn caption(&self) -> String {
        let length_s = self.frames.step_s() * self.frames.all().len() as f64;
        let slower = self.lasts_s / length_s;
        let speed = if slower > 1.01 { format!("{} times slower", significant(slower, 3)) } else { "real time".into() };
        let from_s = self.frames.from_s();
        let (from, to) = (significant(from_s, 5), significant(from_s + length_s, 5));
        let millimetres = if self.scale > 0.0 { LARGEST / self.scale * 1e3 } else { 0.0 };
        let largest = significant(millimetres, 4);
        format!("{from} s to {to} s, {speed}; largest displacement {largest} mm")
    }

    /// What has another scale, and what acts and is not drawn.
    fn notes(&self) -> String {
        let several = self.case.multi_degree.as_ref();
        let has_friction = match several {
            Some(of) => !of.set_up.friction_dampers.is_empty(),
            None => self.case.set_up.friction_damper.is_some(),
        };
        let cavities = (!self.particles().is_empty()).then_some("cavities have a scale of their own");
        let friction = has_friction.then_some("friction dampers are not drawn");
        let spheres = self.case.many_particles.is_some().then_some("the spheres are not drawn");
        cavities.into_iter().chain(friction).chain(spheres).collect::<Vec<_>>().join("; ")
    }

    /// Place and cavity of each particle: the ends of y − x, m.
    fn particles(&self) -> Vec<(usize, [f64; 2])> {
        match &self.case.multi_degree {
            Some(of) => of.set_up.impact_dampers.iter().map(|of| (of.place, of.particle.ends_m())).collect(),
            None => self.case.set_up.particle.map(|particle| (0, particle.ends_m())).into_iter().collect(),
        }
    }

    fn tuned_masses(&self) -> Vec<usize> {
        match &self.case.multi_degree {
            Some(of) => of.set_up.tuned_masses.iter().map(|of| of.place).collect(),
            None => self.case.set_up.tmd.map(|_| 0).into_iter().collect(),
        }
    }

    /// Where a place is drawn at rest.
    fn rest(&self, place: usize) -> PicturePlace {
        match self.layout {
            StructureLayout::Floors => {
                (MIDDLE, TOP + (self.places() - place) as f64 * self.apart() - 0.5 * self.apart())
            }
            StructureLayout::Rails => (MIDDLE, TOP + (place as f64 + 0.5) * self.apart() + 14.0),
            StructureLayout::Beam(of) => {
                (BEAM.0 + (BEAM.1 - BEAM.0) * of.positions_m[place] / of.length_m, self.beam_y())
            }
        }
    }

    fn beam_y(&self) -> f64 {
        TOP + 1.5 * LARGEST + HALF_CAVITY
    }

    fn ground_y(&self) -> f64 {
        self.height() - 24.0
    }

    /// A displacement in points: to the right, of a beam upwards.
    fn moved(&self, by_m: f64) -> PicturePlace {
        self.along(by_m * self.scale)
    }

    fn along(&self, by: f64) -> PicturePlace {
        if matches!(self.layout, StructureLayout::Beam(_)) { (0.0, -by) } else { (by, 0.0) }
    }

    fn draw(&self, svg: &mut Svg) {
        let mut base = Svg::default();
        match &self.layout {
            StructureLayout::Floors => {
                let y = self.ground_y();
                base.segments([[(MIDDLE - 150.0, y), (MIDDLE + 150.0, y)]], INK.stroke(3.0));
                base.text("base", (MIDDLE + 160.0, y), Font::new(LABEL, GREY));
                if self.places() <= MAX_COLUMNS {
                    self.columns(svg);
                }
            }
            StructureLayout::Rails => {
                let rails = (0..self.places()).map(|place| {
                    let (x, y) = self.rest(place);
                    [(x - 220.0, y + 13.0), (x + 220.0, y + 13.0)]
                });
                svg.segments(rails, GREY.stroke(1.0));
                let y = self.ground_y();
                base.segments([[(60.0, TOP), (60.0, y)]], INK.stroke(3.0));
                base.text("base", (60.0, y + 12.0), Font::new(LABEL, GREY).centred());
            }
            StructureLayout::Beam(of) => self.beam(svg, &mut base, of),
        }
        self.moving(svg, &base, |frame| self.moved(frame.z_m));
        for place in 0..self.places() {
            let mut drawn = Svg::default();
            let (x, y) = self.rest(place);
            match self.layout {
                StructureLayout::Beam(_) => {
                    drawn.circle((x, y), 3.5, colour(0).fill());
                    // Names in two rows, as places may be near each other.
                    let below = (x, self.height() - 14.0 * (place % 2) as f64);
                    svg.text(&self.names[place], below, Font::new(LABEL, GREY).centred());
                }
                StructureLayout::Floors => {
                    drawn.rectangle((x - HALF_FLOOR, y - 0.5 * FLOOR, x + HALF_FLOOR, y + 0.5 * FLOOR), INK.fill());
                }
                StructureLayout::Rails => {
                    drawn.rectangle((x - 45.0, y - 12.0, x + 45.0, y + 12.0), WHITE.fill().edged(INK, 2.0));
                }
            }
            if !matches!(self.layout, StructureLayout::Beam(_)) {
                svg.text(&self.names[place], (WIDTH - 24.0, y), Font::new(LABEL, GREY).ending());
            }
            self.moving(svg, &drawn, |frame| self.moved(frame.places_m[place]));
        }
        self.dampers(svg);
    }

    /// Where the middle of a cavity or a tuned mass is beside its place, of several there: in rows of three, of a beam in columns.
    fn beside(&self, nth: usize, count: usize) -> PicturePlace {
        let (column, row) = ((nth % 3) as f64, (nth / 3) as f64);
        let right = (column - 0.5 * (count.min(3) as f64 - 1.0)) * (2.0 * HALF_CAVITY + 10.0);
        match self.layout {
            StructureLayout::Beam(_) => (16.0 * (nth + 1) as f64, 0.0),
            StructureLayout::Floors => (right, -0.5 * FLOOR - RADIUS - 5.0 - 20.0 * row),
            StructureLayout::Rails => (right, -24.0 - 20.0 * row),
        }
    }

    /// Particles in their cavities, and tuned masses.
    fn dampers(&self, svg: &mut Svg) {
        let (mut at_place, mut counts) = (vec![0; self.places()], vec![0; self.places()]);
        for place in self.particles().iter().map(|(place, _)| *place).chain(self.tuned_masses()) {
            counts[place] += 1;
        }
        let mut next = |place: usize| {
            at_place[place] += 1;
            let ((x, y), (dx, dy)) = (self.rest(place), self.beside(at_place[place] - 1, counts[place]));
            (x + dx, y + dy)
        };
        for (number, (place, [low_m, high_m])) in self.particles().into_iter().enumerate() {
            let at = next(place);
            let mut cavity = Svg::default();
            let across = RADIUS + 3.0;
            for wall in [-HALF_CAVITY, HALF_CAVITY] {
                let (dx, dy) = self.along(wall);
                let (x, y) = (at.0 + dx, at.1 + dy);
                let is_beam = dy != 0.0;
                let (wide, high) = if is_beam { (across, 0.0) } else { (0.0, across) };
                cavity.segments([[(x - wide, y - high), (x + wide, y + high)]], INK.stroke(2.0));
            }
            self.moving(svg, &cavity, |frame| self.moved(frame.places_m[place]));
            let mut particle = Svg::default();
            particle.circle(at, RADIUS, tint(number).fill());
            let points = |offset_m: f64| {
                let share = (offset_m - 0.5 * (low_m + high_m)) / (0.5 * (high_m - low_m)).max(f64::MIN_POSITIVE);
                (HALF_CAVITY - RADIUS) * share
            };
            self.moving(svg, &particle, |frame| {
                let (x_m, y_m) = (frame.places_m[place], frame.particles_m[number]);
                sum(self.moved(x_m), self.along(points(y_m - x_m)))
            });
        }
        for (number, place) in self.tuned_masses().into_iter().enumerate() {
            let at = next(place);
            let mut mass = Svg::default();
            let (x, y) = at;
            mass.rectangle((x - 9.0, y - 7.0, x + 9.0, y + 7.0), tint(number + 3).fill());
            self.moving(svg, &mass, |frame| self.moved(frame.tuned_masses_m[number]));
        }
    }

    /// Two columns below each floor.
    fn columns(&self, svg: &mut Svg) {
        for floor in 0..self.places() {
            let (_, top) = self.rest(floor);
            let bottom = if floor == 0 { self.ground_y() } else { self.rest(floor - 1).1 };
            for side in [-1.0, 1.0] {
                let x = MIDDLE + side * (HALF_FLOOR - 6.0);
                let path = |frame: &Frame| {
                    let below = if floor == 0 { frame.z_m } else { frame.places_m[floor - 1] };
                    let (from, to) = (x + below * self.scale, x + frame.places_m[floor] * self.scale);
                    let middle = 0.5 * (top + bottom);
                    format!("M{from:.1} {bottom:.1}C{from:.1} {middle:.1} {to:.1} {middle:.1} {to:.1} {top:.1}")
                };
                self.bending(svg, GREY.stroke(3.0), path);
            }
        }
    }

    /// A beam through its places, and its supports as part of the base.
    fn beam(&self, svg: &mut Svg, base: &mut Svg, of: &OnBeam) {
        let y = self.beam_y();
        let is_clamped = of.support == Support::Cantilever;
        let path = |frame: &Frame| {
            let knots = knots(of, frame);
            let spline = Spline::through(&knots, is_clamped);
            let point = |n: usize| {
                let at_m = of.length_m * n as f64 / (BEAM_POINTS - 1) as f64;
                let x = BEAM.0 + (BEAM.1 - BEAM.0) * at_m / of.length_m;
                format!("{x:.1} {:.1}", y - self.scale * spline.at(at_m))
            };
            let points: Vec<String> = (0..BEAM_POINTS).map(point).collect();
            format!("M{}", points.join("L"))
        };
        self.bending(svg, GREY.stroke(6.0), path);
        let ends = if is_clamped { vec![BEAM.0] } else { vec![BEAM.0, BEAM.1] };
        for x in ends {
            match is_clamped {
                true => base.rectangle((x - 14.0, y - 30.0, x, y + 30.0), INK.fill()),
                false => base.area([(x, y + 4.0), (x - 10.0, y + 22.0), (x + 10.0, y + 22.0)], INK.fill()),
            }
        }
    }

    /// Elements that move.
    fn moving(&self, svg: &mut Svg, elements: &Svg, by: impl Fn(&Frame) -> PicturePlace) {
        let places: Vec<String> = self.frames.all().iter().map(by).map(|(x, y)| format!("{x:.1} {y:.1}")).collect();
        let (first, values) = (&places[0], places.join(";"));
        svg.raw(&format!(
            "<g transform=\"translate({first})\">{elements}<animateTransform attributeName=\"transform\" type=\"translate\" \
             dur=\"{:.2}s\" repeatCount=\"indefinite\" values=\"{values}\"/></g>\n",
            self.lasts_s
        ));
    }

    /// A line that changes its shape.
    fn bending(&self, svg: &mut Svg, style: crate::report::plot::svg::Style, path: impl Fn(&Frame) -> String) {
        let paths: Vec<String> = self.frames.all().iter().map(path).collect();
        svg.raw(&format!(
            "<path d=\"{}\" {style}><animate attributeName=\"d\" dur=\"{:.2}s\" repeatCount=\"indefinite\" values=\"{}\"/></path>\n",
            paths[0],
            self.lasts_s,
            paths.join(";")
        ));
    }
}

/// Where a beam is at its supports and places, in order.
fn knots(of: &OnBeam, frame: &Frame) -> Vec<(f64, f64)> {
    let is_clamped = of.support == Support::Cantilever;
    let mut knots = vec![(0.0, frame.z_m)];
    let places = of.positions_m.iter().copied().zip(frame.places_m.iter().copied());
    knots.extend(places.filter(|(at_m, _)| *at_m > 0.0 && (is_clamped || *at_m < of.length_m)));
    if !is_clamped {
        knots.push((of.length_m, frame.z_m));
    }
    knots.sort_by(|a, b| a.0.total_cmp(&b.0));
    knots
}

fn tint(number: usize) -> Colour {
    colour(number + 1)
}

fn sum(a: PicturePlace, b: PicturePlace) -> PicturePlace {
    (a.0 + b.0, a.1 + b.1)
}

/// A cubic spline: its slope is 0 at a clamped first knot, and its bend at the other ends.
struct Spline<'k> {
    knots: &'k [(f64, f64)],
    /// Second derivative at each knot.
    bends: Vec<f64>,
}

impl<'k> Spline<'k> {
    fn through(knots: &'k [(f64, f64)], is_clamped: bool) -> Self {
        let count = knots.len();
        let (mut diagonal, mut right) = (vec![1.0; count], vec![0.0; count]);
        let (mut below, mut above) = (vec![0.0; count], vec![0.0; count]);
        let slope = |n: usize| (knots[n + 1].1 - knots[n].1) / (knots[n + 1].0 - knots[n].0);
        let length = |n: usize| knots[n + 1].0 - knots[n].0;
        if is_clamped && count > 1 {
            (diagonal[0], above[0], right[0]) = (2.0 * length(0), length(0), 6.0 * slope(0));
        }
        for n in 1..count.saturating_sub(1) {
            (below[n], above[n]) = (length(n - 1), length(n));
            (diagonal[n], right[n]) = (2.0 * (length(n - 1) + length(n)), 6.0 * (slope(n) - slope(n - 1)));
        }
        // Elimination downwards, then upwards.
        for n in 1..count {
            let factor = below[n] / diagonal[n - 1];
            diagonal[n] -= factor * above[n - 1];
            right[n] -= factor * right[n - 1];
        }
        for n in (0..count).rev() {
            let next = if n + 1 < count { above[n] * right[n + 1] } else { 0.0 };
            right[n] = (right[n] - next) / diagonal[n];
        }
        Self { knots, bends: right }
    }

    fn at(&self, at: f64) -> f64 {
        // A free end goes on straight.
        if let [.., (from, low), (to, high)] = *self.knots
            && at > to
        {
            let slope = (high - low) / (to - from) + (to - from) * self.bends[self.bends.len() - 2] / 6.0;
            return high + slope * (at - to);
        }
        let after = self.knots.partition_point(|(knot, _)| *knot <= at).clamp(1, self.knots.len().max(2) - 1);
        let (Some(&(from, low)), Some(&(to, high))) = (self.knots.get(after - 1), self.knots.get(after)) else {
            return self.knots.first().map_or(0.0, |(_, value)| *value);
        };
        let (h, a, b) = (to - from, to - at, at - from);
        let bend = |n: usize, of: f64| self.bends[n] * (of * of * of / h - h * of) / 6.0;
        (low * a + high * b) / h + bend(after - 1, a) + bend(after, b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic with these ends is its own spline.
    #[test]
    fn a_spline_is_a_cubic_that_keeps_its_ends() {
        // x²(3 − x) has no slope at 0 and no bend at 1.
        let cubic = |x: f64| x * x * (3.0 - x);
        let knots = [0.0, 0.3, 0.7, 1.0].map(|x| (x, cubic(x)));
        let spline = Spline::through(&knots, true);
        for n in 0..=20 {
            let x = f64::from(n) / 20.0;
            assert!((spline.at(x) - cubic(x)).abs() < 1e-12, "{x}");
        }
        let line = Spline::through(&[(0.0, 1.0), (2.0, 3.0)], false);
        assert!((line.at(0.5) - 1.5).abs() < 1e-12);
    }
}
