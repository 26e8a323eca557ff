//! `impacts.parquet`: a row per impact that the device reported. It is made from the journal's lines.

use arrow_array::RecordBatch;
use damprig_core::measure::impacts::ImpactRecord;
use serde::{Deserialize, Serialize};

use super::segment_id::SegmentId;
use super::table::TableBuilder;

/// The file's name in a run folder.
pub const IMPACTS: &str = "impacts.parquet";

/// Some impacts of one segment, in the order in which they were reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Impacts {
    /// The segment.
    #[serde(flatten)]
    pub id: SegmentId,
    /// The impacts.
    pub impacts: Vec<ImpactRecord>,
}

/// All impacts as a table.
///
/// # Errors
/// When the columns differ in length: a defect of this function.
pub fn table(all: &[Impacts], tick_hz: f64) -> Result<RecordBatch, String> {
    type Row<'a> = (&'a SegmentId, &'a ImpactRecord);
    let rows: Vec<Row> =
        all.iter().flat_map(|some| some.impacts.iter().map(move |impact| (&some.id, impact))).collect();
    TableBuilder::new(&rows)
        .text(("set_up", "", ""), |(id, _)| &id.set_up)
        .text(("experiment", "", ""), |(id, _)| &id.experiment)
        .u32(("segment", "1", ""), |(id, _)| id.segment)
        .u64(("tick", "tick", ""), |(_, i)| u64::from(i.tick))
        .f64(("t_s", "s", ""), |(_, i)| (f64::from(i.tick) + f64::from(i.centre_ticks)) / tick_hz)
        .i32(("side", "1", ""), |(_, i)| i32::from(i.side))
        .f32(("peak_n", "N", ""), |(_, i)| i.peak_n)
        .f32(("impulse_n_s", "N·s", ""), |(_, i)| i.impulse_n_s)
        .f32(("contact_s", "s", ""), |(_, i)| i.contact_s)
        .bool(("clipped", "", ""), |(_, i)| i.clipped)
        .bool(("held", "", ""), |(_, i)| i.held)
        .finish()
}
