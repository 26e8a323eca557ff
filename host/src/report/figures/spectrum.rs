//! Response spectra: absolute acceleration, velocity and displacement over the period, a curve for each damping ratio.

use crate::failure::Failure;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{GREY, colour};
use crate::report::plot::traces::Traces;
use crate::report::plot::{BROAD, Picture};
use crate::spectrum::SpectrumPoint;

const LEFT: f64 = 92.0;
const RIGHT: f64 = BROAD - 24.0;
const TOP: f64 = 62.0;
const TALL: f64 = 200.0;
const GAP: f64 = 66.0;

/// Dashes of pseudo values.
const PSEUDO: &str = "2 3";

/// What a panel shows: label, true value and pseudo value.
type Panel = (&'static str, fn(&SpectrumPoint) -> f64, Option<fn(&SpectrumPoint) -> f64>);

const PANELS: [Panel; 3] = [
    ("Acceleration (m/s²)", |p| p.sa_m_per_s2, Some(|p| p.psa_m_per_s2)),
    ("Velocity (m/s)", |p| p.sv_m_per_s, Some(|p| p.psv_m_per_s)),
    ("Displacement (m)", |p| p.sd_m, None),
];

/// Draws the spectra: true values as lines, pseudo values dashed.
///
/// # Errors
/// No points.
pub fn draw(points: &[SpectrumPoint]) -> Result<Picture, Failure> {
    let Some(first) = points.first() else { return Err(Failure::undrawn("there is no period")) };
    let mut damping: Vec<f64> = vec![first.damping_ratio];
    for point in points {
        if damping.last() != Some(&point.damping_ratio) {
            damping.push(point.damping_ratio);
        }
    }
    let mut picture = Picture::new(BROAD, TOP + 3.0 * (TALL + GAP) - GAP + 60.0);
    for (place, (label, of, pseudo)) in PANELS.iter().enumerate() {
        let values = points.iter().flat_map(|p| [of(p), pseudo.map_or(of(p), |pseudo| pseudo(p))]);
        let top = TOP + place as f64 * (TALL + GAP);
        let frame = PlotFrame {
            x: Axis::around("Period (s)", Scale::Log, points.iter().map(|p| p.period_s)),
            y: Axis::around(*label, Scale::Linear, values.chain([0.0])),
            bounds: (LEFT, top, RIGHT, top + TALL),
        };
        let mut traces = Traces::new(&frame);
        for (n, zeta) in damping.iter().enumerate() {
            let own = |of: fn(&SpectrumPoint) -> f64| -> Vec<(f64, f64)> {
                points.iter().filter(|p| p.damping_ratio == *zeta).map(|p| (p.period_s, of(p))).collect()
            };
            if let Some(pseudo) = pseudo {
                traces.history(&own(*pseudo), colour(n).stroke(1.8).dashed(PSEUDO));
            }
            traces.history(&own(*of), colour(n).stroke(1.8));
        }
        picture.panel(&frame, &traces.svg());
    }
    let ratios = damping.iter().enumerate();
    let entries = ratios.map(|(n, zeta)| LegendEntry::line(format!("ζ = {zeta}"), colour(n).stroke(2.0))).chain([
        LegendEntry::line("true values: Sa absolute, Sv and Sd relative", GREY.stroke(2.0)),
        LegendEntry::line("pseudo values ω²·Sd, ω·Sd", GREY.stroke(2.0).dashed(PSEUDO)),
    ]);
    legend::rows(&mut picture, (LEFT, 18.0), RIGHT, &entries.collect::<Vec<_>>());
    Ok(picture)
}
