//! A free vibration's damping ratio and frequency over the amplitude, and what its fit leaves over time and over the amplitude.

use crate::failure::Failure;
use crate::identify::backbone::Row;
use crate::identify::decay::Decay;
use crate::report::plot::axis::{Axis, PlotFrame, Scale};
use crate::report::plot::legend::{self, LegendEntry};
use crate::report::plot::palette::colour;
use crate::report::plot::svg::{Colour, Style};
use crate::report::plot::traces::{Traces, circle};
use crate::report::plot::{BROAD, Picture};

const LEFT: f64 = 92.0;
const RIGHT: f64 = BROAD - 24.0;
const TOP: f64 = 40.0;
const TALL: f64 = 210.0;
const GAP: f64 = 70.0;

const MEASURED: Colour = colour(0);
const FITTED: Colour = colour(1);

/// Two panels, one above the other.
fn frames([upper, lower]: [(Axis, Axis); 2]) -> [PlotFrame; 2] {
    let place = |(x, y): (Axis, Axis), top: f64| PlotFrame { x, y, bounds: (LEFT, top, RIGHT, top + TALL) };
    [place(upper, TOP), place(lower, TOP + TALL + GAP)]
}

fn picture(panels: [(&PlotFrame, Traces); 2], entries: &[LegendEntry]) -> Picture {
    let mut picture = Picture::new(BROAD, TOP + 2.0 * TALL + GAP + 60.0);
    for (frame, inside) in panels {
        picture.panel(frame, &inside.svg());
    }
    legend::rows(&mut picture, (LEFT, 20.0), RIGHT, entries);
    picture
}

/// Draws damping ratio and frequency over the amplitude, each with its 95 % interval, beside those of the fit.
///
/// # Errors
/// A record of too few cycles for windows.
pub fn draw(decay: &Decay) -> Result<Picture, Failure> {
    let rows = rows(decay)?;
    let amplitude = || Axis::around("Amplitude (mm)", Scale::Linear, rows.iter().map(|row| row.amplitude_m * 1e3));
    let ends = |of: fn(&Row) -> [f64; 2]| rows.iter().flat_map(of).collect::<Vec<_>>();
    let fitted = [decay.fitted.damping_ratio.value, decay.fitted.natural_frequency_hz.value];
    let damping = ends(|row| row.damping_ratio_interval_95).into_iter().chain([fitted[0]]);
    let frequency = ends(|row| row.natural_frequency_interval_95_hz).into_iter().chain([fitted[1]]);
    let [upper, lower] = frames([
        (amplitude(), Axis::around("Damping ratio ζ", Scale::Linear, damping)),
        (amplitude(), Axis::around("Natural frequency (Hz)", Scale::Linear, frequency)),
    ]);
    let coulomb_m = decay.motion.coulomb_m;
    // Friction acts as the damping ratio (2/π)·(F/k)/a.
    let of_fit = |mm: f64| fitted[0] + std::f64::consts::FRAC_2_PI * coulomb_m / (mm * 1e-3);
    let (from, to) = (upper.x.from, upper.x.to);
    let across: Vec<f64> =
        (0..=200).map(|n| from + (to - from) * f64::from(n) / 200.0).filter(|mm| *mm > 0.0).collect();
    let curve = |of: &dyn Fn(f64) -> f64| across.iter().map(|mm| (*mm, of(*mm))).collect::<Vec<_>>();
    let (mut above, mut below) = (Traces::new(&upper), Traces::new(&lower));
    let dashed = FITTED.stroke(1.8).dashed("7 4");
    above.history(&curve(&of_fit), dashed);
    below.history(&curve(&|_| fitted[1]), dashed);
    for row in &rows {
        let mm = row.amplitude_m * 1e3;
        point(&mut above, (mm, row.damping_ratio), row.damping_ratio_interval_95);
        point(&mut below, (mm, row.natural_frequency_hz), row.natural_frequency_interval_95_hz);
    }
    let cycles = decay.backbone.as_ref().map_or(0, |backbone| backbone.cycles);
    let of_fit = if coulomb_m > 0.0 { "fit of the whole record, with friction" } else { "fit of the whole record" };
    let entries = [
        LegendEntry::mark(format!("windows of {cycles} cycles, 95 % intervals"), &circle(3.2, MEASURED.fill())),
        LegendEntry::line(of_fit, dashed),
    ];
    Ok(picture([(&upper, above), (&lower, below)], &entries))
}

/// A value with its interval.
fn point(traces: &mut Traces, (x, y): (f64, f64), [low, high]: [f64; 2]) {
    traces.line([(x, low), (x, high)], MEASURED.stroke(1.5));
    traces.dot((x, y), 3.2, MEASURED);
}

fn rows(decay: &Decay) -> Result<Vec<Row>, Failure> {
    let backbone = decay.backbone.as_ref();
    let backbone =
        backbone.ok_or_else(|| Failure::undrawn("the record has too few cycles for windows: record longer"))?;
    Ok(backbone.rows())
}

/// Draws what the fit of the whole record leaves and what the fits of single windows leave, over time and over the amplitude.
///
/// # Errors
/// A record of too few cycles for windows.
pub fn residuals(decay: &Decay) -> Result<Picture, Failure> {
    let rows = rows(decay)?;
    let micro = |m: f64| m * 1e6;
    let of_fit: Vec<(f64, f64)> =
        decay.times_s.iter().zip(&decay.residuals_m).map(|(t_s, r_m)| (*t_s, micro(*r_m))).collect();
    let of_windows: Vec<(f64, f64)> = decay
        .backbone
        .iter()
        .flat_map(|backbone| {
            let first = decay.times_s.iter().skip(backbone.first);
            first.zip(&backbone.residuals_m).map(|(t_s, r_m)| (*t_s, micro(*r_m)))
        })
        .collect();
    let over_amplitude = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        let mut over: Vec<(f64, f64)> = points.iter().map(|(t_s, r)| (1e3 * amplitude_at(&rows, *t_s), *r)).collect();
        over.sort_by(|a, b| a.0.total_cmp(&b.0));
        over
    };
    let (fit_over, windows_over) = (over_amplitude(&of_fit), over_amplitude(&of_windows));
    let left = || Axis::around("Left by the fit (µm)", Scale::Linear, of_fit.iter().map(|point| point.1));
    let time = Axis::around("Time (s)", Scale::Linear, of_fit.iter().map(|point| point.0));
    let amplitude = Axis::around("Amplitude (mm)", Scale::Linear, fit_over.iter().map(|point| point.0));
    let [upper, lower] = frames([(time, left()), (amplitude, left())]);
    let (mut above, mut below) = (Traces::new(&upper), Traces::new(&lower));
    let line = |tint: Colour| -> Style { tint.stroke(0.8) };
    for (points, over, tint) in [(&of_fit, &fit_over, FITTED), (&of_windows, &windows_over, MEASURED)] {
        above.history(points, line(tint));
        below.history(over, line(tint));
    }
    let cycles = decay.backbone.as_ref().map_or(0, |backbone| backbone.cycles);
    let entries = [
        LegendEntry::line("fit of the whole record", FITTED.stroke(2.0)),
        LegendEntry::line(format!("fits of {cycles} cycles each"), MEASURED.stroke(2.0)),
    ];
    Ok(picture([(&upper, above), (&lower, below)], &entries))
}

/// Amplitude at a time, m: the logarithm is a line between the middles of the windows and beyond them.
fn amplitude_at(rows: &[Row], t_s: f64) -> f64 {
    let middle = |row: &Row| 0.5 * (row.from_s + row.to_s);
    let after = rows.partition_point(|row| middle(row) < t_s).clamp(1, rows.len() - 1);
    let (a, b) = (&rows[after - 1], &rows[after]);
    let share = (t_s - middle(a)) / (middle(b) - middle(a));
    a.amplitude_m * (b.amplitude_m / a.amplitude_m).powf(share)
}
