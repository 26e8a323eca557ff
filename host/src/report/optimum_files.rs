//! Writes what an optimisation found beside its tables: the curve over the band and the page.

use std::path::Path;

use crate::optimise::{Answer, Optimisation};
use crate::report::figures::study_curves::{self, Curve, CurveLabels};
use crate::report::figures::symbols;
use crate::report::page;
use crate::report::plot::{self, Breadth, Picture};
use crate::report::study_files::Undrawn;
use crate::run_folder::{checksum, own_files};
use crate::study::axis::Value;

/// Name of the page.
pub const PAGE: &str = "optimum.html";

/// Stem of the figure.
pub const FIGURE: &str = "over_band";

/// Writes figure and page, in place of earlier ones. `summary`: the text of the command.
///
/// # Errors
/// A file that cannot be written.
pub fn write(optimisation: &Optimisation, answer: &Answer, summary: &str, folder: &Path) -> Result<(), Undrawn> {
    let identity =
        checksum::of_bytes([optimisation.text.as_bytes(), optimisation.case_text.as_bytes()].concat().as_slice());
    let source = plot::source("optimisation", &identity);
    let figure = |breadth| over_band(optimisation, answer, breadth).map(|picture| picture.of_source(&source));
    let figures = figure(Breadth::Broad).zip(figure(Breadth::Narrow)).map(|(broad, narrow)| [broad, narrow]);
    if let Some([broad, _]) = &figures {
        own_files::replace(&folder.join(format!("{FIGURE}.svg")), broad.svg().as_bytes())?;
        own_files::replace(&folder.join(format!("{FIGURE}.png")), &broad.png()?)?;
    }
    let page = page::optimum::page(optimisation, answer, summary, figures, &source);
    own_files::replace(&folder.join(PAGE), page.as_bytes())?;
    Ok(())
}

/// The objective's metric over the band of the optimum, its alternatives and the bare structure; `None` without such a curve.
fn over_band(optimisation: &Optimisation, answer: &Answer, breadth: Breadth) -> Option<Picture> {
    let axis = optimisation.band().first()?;
    let first: Vec<Value> = optimisation.axes.iter().map(|axis| axis.checked_values().swap_remove(0)).collect();
    let case = optimisation.case_with(&first).ok()?;
    let reference = || symbols::reference(&case);
    let metric = optimisation.objective;
    let (unit, scale) = metric.shown_unit();
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
        y: if scale == 1.0 { metric.axis_label(reference()) } else { format!("{} ({unit})", metric.label()) },
        ..CurveLabels::default()
    };
    (!curves.is_empty()).then(|| study_curves::draw(&curves, &labels, breadth))
}
