//! Restitution over the approach speed: every impact with its 95 % interval, one constant, and the power of the speed.

use std::path::Path;

use crate::failure::Failure;
use crate::identify::restitution::{Impact, Law};
use crate::identify::statistics::student_95;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::colour;
use crate::report::plot::traces::{Traces, circle};
use crate::report::plot::{BROAD, Picture};

const LEFT: f64 = 92.0;
const RIGHT: f64 = BROAD - 24.0;
const TOP: f64 = 60.0;
const TALL: f64 = 340.0;

/// Draws e over the speed; each file has a colour.
///
/// # Errors
/// There are no impacts.
pub fn draw(law: &Law, impacts: &[Impact]) -> Result<Picture, Failure> {
    let mut sources: Vec<&str> = Vec::new();
    for impact in impacts {
        if !sources.contains(&impact.source.as_str()) {
            sources.push(&impact.source);
        }
    }
    if impacts.is_empty() {
        return Err(Failure::undrawn("there are no impacts to draw"));
    }
    let half = |impact: &Impact| student_95(f64::MAX) * impact.coefficient_standard_uncertainty;
    let ends = |impact: &Impact| [impact.coefficient - half(impact), impact.coefficient + half(impact)];
    let e = impacts.iter().flat_map(ends).chain([law.constant.value]);
    let frame = PlotFrame {
        x: Axis::around("Approach speed (m/s)", Scale::Linear, impacts.iter().map(|impact| impact.speed_m_per_s)),
        y: Axis::around("Coefficient of restitution e", Scale::Linear, e),
        bounds: (LEFT, TOP, RIGHT, TOP + TALL),
    };
    let mut traces = Traces::new(&frame);
    let (from, to) = (frame.x.from, frame.x.to);
    let place = sources.len();
    let constant = colour(place).stroke(1.8).dashed("3 4");
    traces.line([(from, law.constant.value), (to, law.constant.value)], constant);
    let mut entries: Vec<LegendEntry> = Vec::new();
    let fitted = colour(place + 1).stroke(1.8).dashed("7 4");
    if let Some(power) = &law.power {
        let [slowest, fastest] = law.speeds_m_per_s;
        let across = |n: i32| slowest + (fastest - slowest) * f64::from(n) / 200.0;
        let curve: Vec<(f64, f64)> = (0..=200).map(|n| (across(n), power.at(across(n)))).collect();
        traces.history(&curve, fitted);
    }
    for impact in impacts {
        let place = sources.iter().position(|source| *source == impact.source).unwrap_or(0);
        let [low, high] = ends(impact);
        if high > low {
            traces.line([(impact.speed_m_per_s, low), (impact.speed_m_per_s, high)], colour(place).stroke(1.5));
        }
        traces.dot((impact.speed_m_per_s, impact.coefficient), 3.2, colour(place));
    }
    for (place, source) in sources.iter().enumerate() {
        let name =
            Path::new(source).file_name().map_or_else(|| source.to_string(), |name| name.to_string_lossy().into());
        entries.push(LegendEntry::mark(format!("impacts of {name}"), &circle(3.2, colour(place).fill())));
    }
    entries.push(LegendEntry::line("one coefficient", constant));
    if law.power.is_some() {
        entries.push(LegendEntry::line("fit over the speed", fitted));
    }
    let mut picture = Picture::new(BROAD, TOP + TALL + 60.0);
    picture.panel(&frame, &traces.svg());
    legend::rows(&mut picture, (LEFT, 20.0), RIGHT, &entries);
    Ok(picture)
}
