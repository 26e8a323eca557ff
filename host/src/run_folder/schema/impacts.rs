//! `impacts.parquet`: a row per impact that the device reported. It is made from the journal's lines.

use arrow_array::RecordBatch;
use arrow_schema::Metadata;
use damprig_core::measure::impacts::ImpactRecord;
use serde::{Deserialize, Serialize};

use super::segment_id::SegmentId;
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::table::TableBuilder;

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
pub fn table(all: &[Impacts], tick_hz: f64) -> Result<RecordBatch, Failure> {
    type ImpactRow<'a> = (&'a SegmentId, &'a ImpactRecord);
    let rows: Vec<ImpactRow> =
        all.iter().flat_map(|some| some.impacts.iter().map(move |impact| (&some.id, impact))).collect();
    TableBuilder::new(&rows)
        .column(Quantity::SetUp, |(id, _)| id.set_up.as_str())
        .column(Quantity::Experiment, |(id, _)| id.experiment.as_str())
        .column(Quantity::Segment, |(id, _)| id.segment)
        .column(Quantity::Tick, |(_, i)| u64::from(i.tick))
        .column(Quantity::TimeS, |(_, i)| (f64::from(i.tick) + f64::from(i.centre_ticks)) / tick_hz)
        .column(Quantity::Side, |(_, i)| i32::from(i.side))
        .column(Quantity::PeakN, |(_, i)| i.peak_n)
        .column(Quantity::ImpulseNS, |(_, i)| i.impulse_n_s)
        .column(Quantity::ContactS, |(_, i)| i.contact_s)
        .column(Quantity::Clipped, |(_, i)| i.clipped)
        .column(Quantity::Held, |(_, i)| i.held)
        .finish(Metadata::new())
}
