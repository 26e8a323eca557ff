//! Text of `damprig study`.

use super::{Block, Document, sensitivity};
use crate::report::numbers::significant;

use crate::study::Study;
use crate::study::axis::AxisValue;
use crate::study::evaluate::main_column;
use crate::study::sensitivity::SensitivityIndices;

/// Size of a study: `Clearance and restitution: 10000 points, 1e4 simulations, 1e7 cycles`.
#[must_use]
pub fn scope(study: &Study, cycles: f64) -> String {
    let rows = study.rows();
    let each = match study.simulations_per_row() {
        1 => String::new(),
        each => format!(" of {each} simulations"),
    };
    format!("{}: {rows} points{each}, {} cycles", study.name, significant(cycles, 3))
}

/// The best point: its value and where it is.
fn best(study: &Study, row: u64, value: f64) -> Vec<Block> {
    let values = study.points.values(&study.axes, row, 0);
    let place = |axis: &usize| {
        let axis_values = &values[*axis];
        let text = match axis_values {
            AxisValue::Number(number) => significant(*number, 6),
            AxisValue::Word(word) => word.clone(),
        };
        let axis = &study.axes[*axis];
        (axis.key.clone(), format!("{text} {}", axis.unit()).trim_end().to_string())
    };
    let places = study.points.kept().iter().map(place).collect();
    let what = if study.is_maximum { "largest" } else { "smallest" };
    let unit = study.objective.suffix();
    let text = format!("{what} {}: {} {unit}", main_column(study, study.objective), significant(value, 6));
    vec![Block::Text(format!("{} at", text.trim_end())), Block::Facts(places)]
}

/// The best point, if there is one, and the sensitivity indices.
#[must_use]
pub fn found(study: &Study, best_row: Option<(u64, f64)>, indices: &[SensitivityIndices]) -> Document {
    let mut document = Document::default();
    document.add(best_row.map_or_else(Vec::new, |(row, value)| best(study, row, value)));
    indices.iter().for_each(|of| document.add(sensitivity::blocks(of)));
    document
}
