//! Writes what an optimisation found beside its tables: the curve over the band and the page.

use std::path::Path;

use crate::failure::Failure;
use crate::optimise::front::FrontPoint;
use crate::optimise::{Optimisation, Optimum};
use crate::quantity::Quantity;
use crate::report::figures::study_curves::{self, Curve, CurveLabels};
use crate::report::figures::symbols;
use crate::report::page;
use crate::report::page::optimum::OptimumFigures;
use crate::report::plot::{self, Breadth, Picture};
use crate::run_folder::{checksum, own_files};
use crate::simulation::Case;

/// Name of the page.
pub const PAGE: &str = "optimum.html";

/// Stem of the figure over the band.
pub const OVER_BAND: &str = "over_band";

/// Stem of the figure of two objectives.
pub const FRONT: &str = "front";

/// Writes figure and page, in place of earlier ones. `summary`: the text of the command.
///
/// # Errors
/// A file that cannot be written.
pub fn write(optimisation: &Optimisation, answer: &Optimum, summary: &str, folder: &Path) -> Result<(), Failure> {
    let identity =
        checksum::of_bytes([optimisation.text.as_bytes(), optimisation.case_text.as_bytes()].concat().as_slice());
    let source = plot::source("optimisation", &identity);
    let in_both = |draw: fn(&Optimisation, &Optimum, Breadth) -> Option<Picture>| {
        let figure = |breadth| draw(optimisation, answer, breadth).map(|picture| picture.of_source(&source));
        Some([figure(Breadth::Broad)?, figure(Breadth::Narrow)?])
    };
    let figures = OptimumFigures { over_band: in_both(over_band), front: in_both(front) };
    for (stem, figure) in [(OVER_BAND, &figures.over_band), (FRONT, &figures.front)] {
        let [svg, png] = ["svg", "png"].map(|extension| folder.join(format!("{stem}.{extension}")));
        if let Some([broad, _]) = figure {
            own_files::replace(&svg, broad.svg().as_bytes())?;
            own_files::replace(&png, &broad.png()?)?;
        } else {
            // Those of an earlier answer, which this one replaces.
            own_files::remove(&svg)?;
            own_files::remove(&png)?;
        }
    }
    let page = page::optimum::page(optimisation, answer, summary, figures, &source);
    own_files::replace(&folder.join(PAGE), page.as_bytes())?;
    Ok(())
}

/// The objective's metric over the band of the optimum, its alternatives and the bare structure; `None` without such a curve.
fn over_band(optimisation: &Optimisation, answer: &Optimum, breadth: Breadth) -> Option<Picture> {
    let axis = optimisation.band().first()?;
    let case = optimisation.first_case().ok()?;
    let reference = || symbols::reference(&case);
    let metric = optimisation.objective;
    let (_, scale) = metric.shown_unit();
    let mut curves: Vec<Curve> = Vec::new();
    for of in std::iter::once(answer).chain(&answer.alternatives).filter(|of| !of.over_band.is_empty()) {
        let is_wide = of.over_band.iter().any(|point| point.low < point.high);
        curves.push(Curve {
            label: of.name.clone(),
            points: of.over_band.iter().map(|point| (point.at, scale * point.value)).collect(),
            band: if is_wide {
                of.over_band.iter().map(|p| (p.at, scale * p.low, scale * p.high)).collect()
            } else {
                Vec::new()
            },
            is_scattered: false,
        });
    }
    let bare: Vec<(f64, f64)> =
        answer.over_band.iter().filter_map(|point| Some((point.at, scale * point.bare?))).collect();
    if !bare.is_empty() {
        curves.push(Curve { label: "bare structure".into(), points: bare, ..Curve::default() });
    }
    let labels = CurveLabels {
        title: optimisation.name.clone(),
        x: symbols::label(&axis.key, reference),
        is_log: axis.is_log,
        y: axis_label(metric, &case),
        ..CurveLabels::default()
    };
    (!curves.is_empty()).then(|| study_curves::draw(&curves, &labels, breadth))
}

/// The objective over the second one.
fn front(optimisation: &Optimisation, answer: &Optimum, breadth: Breadth) -> Option<Picture> {
    let (front, second) = (answer.front.as_ref()?, optimisation.second.as_ref()?);
    let case = optimisation.first_case().ok()?;
    let [(_, first_scale), (_, second_scale)] = [optimisation.objective, second.metric].map(Quantity::shown_unit);
    let at = |point: &FrontPoint| (second_scale * point.second, first_scale * point.objective);
    let curve = Curve { points: front.points.iter().map(at).collect(), is_scattered: true, ..Curve::default() };
    let knee = front.points.iter().find(|point| point.is_knee);
    let labels = CurveLabels {
        title: optimisation.name.clone(),
        x: axis_label(second.metric, &case),
        y: axis_label(optimisation.objective, &case),
        best: knee.map(|point| (at(point), "knee".into())),
        ..CurveLabels::default()
    };
    (front.points.len() > 1).then(|| study_curves::draw(&[curve], &labels, breadth))
}

/// A metric with the unit that people read.
fn axis_label(metric: Quantity, case: &Case) -> String {
    let (unit, scale) = metric.shown_unit();
    if scale == 1.0 { metric.axis_label(symbols::reference(case)) } else { format!("{} ({unit})", metric.label()) }
}
