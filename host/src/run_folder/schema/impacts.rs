//! `impacts.parquet`: a row per impact that the device reported. It is made from the journal's lines.

use arrow_array::RecordBatch;
use damprig_core::measure::impacts::ImpactRecord;
use serde::{Deserialize, Serialize};

use super::segment_id::SegmentId;
use super::table::TableBuilder;

/// The file's name in a run folder.
pub const IMPACTS: &str = "impacts.parquet";

/// What a row is.
pub const ROW: &str = "a row for each impact that the device reported";

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
        .text(("set_up", "", "name of the set-up"), |(id, _)| &id.set_up)
        .text(("experiment", "", "name of the experiment"), |(id, _)| &id.experiment)
        .u32(("segment", "1", "times that the experiment had been started before"), |(id, _)| id.segment)
        .u64(("tick", "tick", "tick in which the pulse ended"), |(_, i)| u64::from(i.tick))
        .f64(("t_s", "s", "time of the centre of the pulse since the start"), |(_, i)| {
            (f64::from(i.tick) + f64::from(i.centre_ticks)) / tick_hz
        })
        .i32(("side", "1", "+1 where y - x = +d, -1 where y - x = -d"), |(_, i)| i32::from(i.side))
        .f32(("peak_n", "N", "largest force"), |(_, i)| i.peak_n)
        .f32(("impulse_n_s", "N·s", "integral of the force"), |(_, i)| i.impulse_n_s)
        .f32(("contact_s", "s", "contact time of the half-sine with this peak and impulse"), |(_, i)| i.contact_s)
        .bool(
            ("clipped", "", "whether a reading reached the clipping force: peak and impulse are lower bounds"),
            |(_, i)| i.clipped,
        )
        .bool(("held", "", "whether the contact lasted longer than the longest contact time"), |(_, i)| i.held)
        .finish()
}
