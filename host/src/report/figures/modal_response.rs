//! A mode of a frequency response: |H|, phase, coherence and residuals over frequency, with the fitted mode.

use std::f64::consts::PI;

use super::transfer_function::{CURVE, GAP, LEFT, MEASURED, MODEL, RIGHT, TOP, WIDTH, curve};
use crate::failure::Failure;
use crate::identify::modal::Modal;
use crate::report::numbers::significant;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::{INK, colour};
use crate::report::plot::svg::{Font, Style};
use crate::report::plot::traces::{Traces, upright};
use crate::report::plot::{Picture, TITLE};

/// Heights of the panels: |H|, phase, residuals, coherence.
const HEIGHTS: [f64; 4] = [300.0, 150.0, 150.0, 110.0];

/// Points that are marked singly, at most.
const MAX_MARKED: usize = 400;

const IMAGINARY: Style = colour(1).stroke(1.5);

/// Draws the lines that were fitted, the mode over them, and what it leaves over the standard uncertainty of the lines.
///
/// # Errors
/// Fewer than two lines.
pub fn draw(found: &Modal) -> Result<Picture, Failure> {
    let lines = &found.lines;
    let (Some(first), Some(last)) = (lines.first(), lines.last().filter(|_| lines.len() > 1)) else {
        return Err(Failure::undrawn("there are no lines to draw"));
    };
    let (from, to) = (first.frequency_hz, last.frequency_hz);
    let at = |n: usize| lines[n].frequency_hz;
    let frequencies: Vec<f64> = (0..=CURVE).map(|n| from + (to - from) * n as f64 / CURVE as f64).collect();
    let fitted: Vec<_> = frequencies.iter().map(|hz| found.fitted(*hz)).collect();
    let phases = unwrapped(fitted.iter().map(|h| h.arg()));
    // The measured phase on the branch of the fitted one.
    let near = |n: usize| ((at(n) - from) / (to - from) * CURVE as f64).round() as usize;
    let turn = |n: usize| (lines[n].h / fitted[near(n)]).arg() + phases[near(n)];
    let degrees = |phase: f64| phase * 180.0 / PI;
    let measured_phases: Vec<f64> = (0..lines.len()).map(|n| degrees(turn(n))).collect();
    let of_size = |n: usize, part: f64| part / found.uncertainties[n];
    let real: Vec<f64> = (0..lines.len()).map(|n| of_size(n, found.residuals[n].re)).collect();
    let imaginary: Vec<f64> = (0..lines.len()).map(|n| of_size(n, found.residuals[n].im)).collect();
    let coherences: Option<Vec<f64>> = lines.iter().map(|line| line.coherence).collect();
    let panels = 3 + usize::from(coherences.is_some());
    let magnitudes = lines.iter().map(|line| line.h.norm()).chain(fitted.iter().map(|h| h.norm()));
    let label = format!("|H| {}", found.quantity.si_unit());
    let axes = [
        Axis::around(label.trim(), Scale::Log, magnitudes),
        Axis::around(
            "Phase (°)",
            Scale::Linear,
            measured_phases.iter().copied().chain(phases.iter().map(|p| degrees(*p))),
        ),
        Axis::around("Residual / u", Scale::Linear, real.iter().chain(&imaginary).copied()),
        Axis::between("Coherence γ²", 0.0, 1.05),
    ];
    let mut picture =
        Picture::new(WIDTH, TOP + HEIGHTS[..panels].iter().sum::<f64>() + (panels - 1) as f64 * GAP + 62.0);
    head(&mut picture, found);
    let mut top = TOP;
    for (place, y) in axes.into_iter().take(panels).enumerate() {
        let x = Axis::between(if place + 1 == panels { "Frequency (Hz)" } else { "" }, from, to);
        let frame = PlotFrame { x, y, bounds: (LEFT, top, RIGHT, top + HEIGHTS[place]) };
        top += HEIGHTS[place] + GAP;
        let mut traces = Traces::new(&frame);
        let points = |value: &dyn Fn(usize) -> f64| (0..lines.len()).map(|n| (at(n), value(n))).collect::<Vec<_>>();
        let mut measured = |values: Vec<(f64, f64)>, style: Style| {
            if lines.len() <= MAX_MARKED && place < 2 {
                values.iter().filter(|(x, y)| frame.draws(*x, *y)).for_each(|point| traces.dot(*point, 2.0, colour(0)));
            }
            curve(&mut traces, &frame, values.into_iter(), style);
        };
        match place {
            0 => measured(points(&|n| lines[n].h.norm()), MEASURED),
            1 => measured(points(&|n| measured_phases[n]), MEASURED),
            2 => {
                measured(points(&|n| real[n]), MEASURED);
                measured(points(&|n| imaginary[n]), IMAGINARY);
            }
            _ => measured(points(&|n| coherences.as_ref().map_or(f64::NAN, |all| all[n])), MEASURED),
        }
        let model = |n: usize| if place == 0 { fitted[n].norm() } else { degrees(phases[n]) };
        if place < 2 {
            curve(&mut traces, &frame, (0..=CURVE).map(|n| (frequencies[n], model(n))), MODEL);
        }
        let mut inside = upright(&frame, found.natural_frequency_hz.value, "");
        inside.add(&traces.svg());
        picture.panel(&frame, &inside);
    }
    Ok(picture)
}

/// Phases without jumps by whole turns.
fn unwrapped(phases: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last: Option<f64> = None;
    phases
        .map(|phase| {
            let turns = last.map_or(0.0, |last| ((last - phase) / (2.0 * PI)).round());
            let own = phase + 2.0 * PI * turns;
            last = Some(own);
            own
        })
        .collect()
}

fn head(picture: &mut Picture, found: &Modal) {
    let (frequency, damping) = (&found.natural_frequency_hz, &found.damping_ratio);
    let value = |value: f64, u: f64| format!("{} ± {}", significant(value, 6), significant(2.0 * u, 2));
    let misfit = if found.misfits.is_empty() { "" } else { "; lack of fit" };
    let title = format!(
        "{}: fn = {} Hz, ζ = {} (k = 2{misfit})",
        found.quantity.name(),
        value(frequency.value, frequency.standard_uncertainty),
        value(damping.value, damping.standard_uncertainty)
    );
    picture.text(&title, (LEFT, 22.0), Font::new(TITLE, INK));
    let entries = [
        LegendEntry::line("measured; residual: real part", MEASURED),
        LegendEntry::line("residual: imaginary part", IMAGINARY),
        LegendEntry::line("fitted mode with residual terms", MODEL),
    ];
    legend::rows(picture, (LEFT, 45.0), RIGHT, &entries.map(LegendEntry::of_sign));
}
