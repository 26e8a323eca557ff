//! A free vibration's damping ratio and frequency over the amplitude, and what its fit leaves over time and over the amplitude.

use super::axis::{Axis, Frame, Scale};
use super::{FigureError, Picture, marks};
use crate::identify::backbone::Row;
use crate::identify::decay::Decay;

const WIDTH: i32 = 760;
const LEFT: i32 = 92;
const RIGHT: i32 = WIDTH - 24;
const TOP: i32 = 40;
const TALL: i32 = 210;
const GAP: i32 = 70;
const HEIGHT: i32 = TOP + 2 * TALL + GAP + 60;

const MEASURED: &str = "#0072b2";
const FITTED: &str = "#d55e00";
const UPPER: &str = "upper";
const LOWER: &str = "lower";

/// Two panels, one above the other.
fn frames([upper, lower]: [(Axis, Axis); 2]) -> [Frame; 2] {
    let place = |(x, y): (Axis, Axis), top: i32| Frame { x, y, bounds: (LEFT, top, RIGHT, top + TALL) };
    [place(upper, TOP), place(lower, TOP + TALL + GAP)]
}

fn picture(frames: &[Frame; 2], inside: &str) -> Result<Picture, FigureError> {
    let clips = marks::clip(&frames[0], UPPER) + &marks::clip(&frames[1], LOWER);
    let picture =
        Picture::draw(WIDTH as u32, HEIGHT as u32, |canvas| frames.iter().try_for_each(|frame| frame.draw(canvas)))?;
    Ok(picture.with_elements(&(clips + inside)))
}

/// Draws damping ratio and frequency over the amplitude, each with its 95 % interval, beside those of the fit.
///
/// # Errors
/// A record of too few cycles for windows; the drawing library's error.
pub fn draw(decay: &Decay) -> Result<Picture, FigureError> {
    let rows = rows(decay)?;
    let amplitude = || Axis::around("Amplitude (mm)", Scale::Linear, rows.iter().map(|row| row.amplitude_m * 1e3));
    let ends = |of: fn(&Row) -> [f64; 2]| rows.iter().flat_map(of).collect::<Vec<_>>();
    let fitted = [decay.fitted.damping_ratio.value, decay.fitted.natural_frequency_hz.value];
    let damping = ends(|row| row.damping_ratio_interval_95).into_iter().chain([fitted[0]]);
    let frequency = ends(|row| row.natural_frequency_interval_95_hz).into_iter().chain([fitted[1]]);
    let frames = frames([
        (amplitude(), Axis::around("Damping ratio ζ", Scale::Linear, damping)),
        (amplitude(), Axis::around("Natural frequency (Hz)", Scale::Linear, frequency)),
    ]);
    let coulomb_m = decay.motion.coulomb_m;
    let across = |frame: &Frame| {
        let (from, to) = (frame.x.from, frame.x.to);
        (0..=200).map(move |n| from + (to - from) * f64::from(n) / 200.0).filter(|mm| *mm > 0.0).collect::<Vec<_>>()
    };
    // Friction acts as the damping ratio (2/π)·(F/k)/a.
    let of_fit = |mm: f64| fitted[0] + std::f64::consts::FRAC_2_PI * coulomb_m / (mm * 1e-3);
    let mut inside =
        marks::curve(&frames[0], UPPER, across(&frames[0]).into_iter().map(|mm| (mm, of_fit(mm))), FITTED, "7 4");
    inside += &marks::curve(&frames[1], LOWER, across(&frames[1]).into_iter().map(|mm| (mm, fitted[1])), FITTED, "7 4");
    for row in &rows {
        let mm = row.amplitude_m * 1e3;
        inside += &marks::point(&frames[0], UPPER, (mm, row.damping_ratio), row.damping_ratio_interval_95, MEASURED);
        let hertz = (mm, row.natural_frequency_hz);
        inside += &marks::point(&frames[1], LOWER, hertz, row.natural_frequency_interval_95_hz, MEASURED);
    }
    let cycles = decay.backbone.as_ref().map_or(0, |backbone| backbone.cycles);
    inside += &marks::entry((LEFT, 26), MEASURED, "none", &format!("windows of {cycles} cycles, 95 % intervals"));
    let of_fit = if coulomb_m > 0.0 { "fit of the whole record, with friction" } else { "fit of the whole record" };
    inside += &marks::entry((LEFT + 330, 26), FITTED, "7 4", of_fit);
    picture(&frames, &inside)
}

fn rows(decay: &Decay) -> Result<Vec<Row>, FigureError> {
    let backbone = decay.backbone.as_ref();
    let backbone =
        backbone.ok_or_else(|| FigureError("the record has too few cycles for windows: record longer".into()))?;
    Ok(backbone.rows())
}

/// Draws what the fit of the whole record leaves and what the fits of single windows leave, over time and over the amplitude.
///
/// # Errors
/// A record of too few cycles for windows; the drawing library's error.
pub fn residuals(decay: &Decay) -> Result<Picture, FigureError> {
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
        points.iter().map(|(t_s, r)| (1e3 * amplitude_at(&rows, *t_s), *r)).collect()
    };
    let (fit_over, windows_over) = (over_amplitude(&of_fit), over_amplitude(&of_windows));
    let left = || Axis::around("Left by the fit (µm)", Scale::Linear, of_fit.iter().map(|point| point.1));
    let time = Axis::around("Time (s)", Scale::Linear, of_fit.iter().map(|point| point.0));
    let amplitude = Axis::around("Amplitude (mm)", Scale::Linear, fit_over.iter().map(|point| point.0));
    let frames = frames([(time, left()), (amplitude, left())]);
    let mut inside = String::new();
    for (points, over, fill) in [(&of_fit, &fit_over, FITTED), (&of_windows, &windows_over, MEASURED)] {
        inside += &marks::band(&frames[0], UPPER, points.iter().copied(), fill);
        inside += &marks::band(&frames[1], LOWER, over.iter().copied(), fill);
    }
    let cycles = decay.backbone.as_ref().map_or(0, |backbone| backbone.cycles);
    inside += &marks::entry((LEFT, 26), FITTED, "none", "fit of the whole record");
    inside += &marks::entry((LEFT + 250, 26), MEASURED, "none", &format!("fits of {cycles} cycles each"));
    picture(&frames, &inside)
}

/// Amplitude at a time, m: the logarithm is a line between the middles of the windows and beyond them.
fn amplitude_at(rows: &[Row], t_s: f64) -> f64 {
    let middle = |row: &Row| 0.5 * (row.from_s + row.to_s);
    let after = rows.partition_point(|row| middle(row) < t_s).clamp(1, rows.len() - 1);
    let (a, b) = (&rows[after - 1], &rows[after]);
    let share = (t_s - middle(a)) / (middle(b) - middle(a));
    a.amplitude_m * (b.amplitude_m / a.amplitude_m).powf(share)
}
