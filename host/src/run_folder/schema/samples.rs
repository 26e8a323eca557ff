//! Names and columns of the samples' files.
//!
//! A Parquet file without its end cannot be read. So samples are recorded into an Arrow stream that may be cut off
//! anywhere (the open part), which becomes a Parquet file of `samples.parts/` when its point is over; a complete run's
//! parts are joined into one file. Values that all rows of an open part share are in the stream's metadata.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{Int32Type, UInt64Type};
use arrow_array::{ArrayRef, DictionaryArray, Float64Array, Int32Array, RecordBatch, StringArray, UInt32Array};
use arrow_schema::{DataType, Field, Metadata, Schema, SchemaRef};
use damprig_core::rig::{SIGNAL_DOCS, SIGNALS};
use serde::{Deserialize, Serialize};

use super::segment_id::SegmentId;
use crate::failure::Failure;
use crate::quantity::Quantity;
use crate::table::{Column, DESCRIPTION};

/// The joined samples of a complete run.
pub const JOINED: &str = "samples.parquet";

/// Folder of the closed parts of a run that is not complete. Parquet readers take it as one data set.
pub const PARTS: &str = "samples.parts";

/// Largest number of a part.
pub const LAST_PART: u32 = 999_999_999;

/// The file of a closed part, relative to the run folder.
#[must_use]
pub fn part_name(part: u32) -> String {
    format!("{PARTS}/{part:06}.parquet")
}

const OPEN: (&str, &str) = ("samples-", ".open.arrows");

/// The file of an open part, relative to the run folder.
#[must_use]
pub fn open_part_name(part: u32) -> String {
    format!("{}{part:06}{}", OPEN.0, OPEN.1)
}

/// The file of an open part that was damaged, relative to the run folder.
#[must_use]
pub fn damaged_part_name(part: u32) -> String {
    format!("{}{part:06}.damaged.arrows", OPEN.0)
}

/// The number of the open part of this file name.
#[must_use]
pub fn open_part_number(name: &str) -> Option<u32> {
    let number = name.strip_prefix(OPEN.0)?.strip_suffix(OPEN.1)?.parse().ok()?;
    (number <= LAST_PART && open_part_name(number) == name).then_some(number)
}

/// The number of the open part whose checksums have this file name.
#[must_use]
pub fn open_sums_number(name: &str) -> Option<u32> {
    open_part_number(&format!("{}.arrows", name.strip_suffix(".sums")?))
}

/// The number of the closed part of this file name in [`PARTS`].
#[must_use]
pub fn part_number(name: &str) -> Option<u32> {
    let number = name.strip_suffix(".parquet")?.parse().ok()?;
    (number <= LAST_PART && part_name(number) == format!("{PARTS}/{name}")).then_some(number)
}

/// A recorded signal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleColumn {
    /// Name of its column, with the unit: `x_m`.
    pub name: String,
    /// Its unit.
    pub unit: String,
}

/// The column of a signal: `x` in metres becomes `x_m`.
#[must_use]
pub fn column_name(name: &str, unit: &str) -> String {
    if unit.is_empty() {
        return name.to_string();
    }
    format!("{name}_{}", unit.to_lowercase().replace('/', "_per_"))
}

/// The point that samples belong to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointLabel {
    /// Its segment.
    pub id: SegmentId,
    /// Place of the point in the experiment's frequency list.
    pub point_index: u32,
    /// Its drive frequency, Hz.
    pub frequency_hz: f64,
}

/// What a row of the samples is.
const ROW: &str = "a row for each recorded tick: the telemetry";

/// The columns of samples with these signals, and what the run says of its files.
#[must_use]
pub fn schema(signals: &[SampleColumn], about: &Metadata) -> SchemaRef {
    let name = || DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    let mut fields = vec![
        field(Quantity::SetUp, name()),
        field(Quantity::Experiment, name()),
        field(Quantity::Segment, DataType::UInt32),
        field(Quantity::PointIndex, DataType::UInt32),
        field(Quantity::PointFrequencyHz, DataType::Float64),
        field(Quantity::Tick, DataType::UInt64),
        field(Quantity::GapBeforeTicks, DataType::UInt32),
        field(Quantity::TimeS, DataType::Float64),
    ];
    fields.extend(signals.iter().map(signal_field));
    Arc::new(Schema::new_with_metadata(fields, about.clone().with(DESCRIPTION, ROW)))
}

/// The columns and metadata of an open part: tick, gap and signals of each row; the rest once.
pub(crate) fn stream_schema(label: &PointLabel, signals: &[SampleColumn], tick_hz: f64) -> SchemaRef {
    let mut fields = vec![field(Quantity::Tick, DataType::UInt64), field(Quantity::GapBeforeTicks, DataType::UInt32)];
    fields.extend(signals.iter().map(signal_field));
    let shared = [
        ("set_up", label.id.set_up.clone()),
        ("experiment", label.id.experiment.clone()),
        ("segment", label.id.segment.to_string()),
        ("point_index", label.point_index.to_string()),
        ("point_frequency_hz", label.frequency_hz.to_string()),
        ("tick_hz", tick_hz.to_string()),
    ];
    let metadata: HashMap<String, String> = shared.map(|(key, value)| (key.to_string(), value)).into();
    Arc::new(Schema::new_with_metadata(fields, metadata))
}

/// Label, tick rate in Hz and signals of an open part; the inverse of [`stream_schema`].
pub(crate) fn read_stream_schema(stream: &Schema) -> Option<(PointLabel, f64, Vec<SampleColumn>)> {
    let get = |key: &str| stream.metadata().get(key);
    let label = PointLabel {
        id: SegmentId {
            set_up: get("set_up")?.clone(),
            experiment: get("experiment")?.clone(),
            segment: get("segment")?.parse().ok()?,
        },
        point_index: get("point_index")?.parse().ok()?,
        frequency_hz: get("point_frequency_hz")?.parse().ok()?,
    };
    let signal = |f: &Arc<Field>| SampleColumn {
        name: f.name().clone(),
        unit: f.metadata().get("unit").cloned().unwrap_or_default(),
    };
    Some((label, get("tick_hz")?.parse().ok()?, stream.fields().iter().skip(2).map(signal).collect()))
}

fn field(quantity: Quantity, kind: DataType) -> Field {
    Column::from(quantity).field(kind)
}

fn signal_field(signal: &SampleColumn) -> Field {
    let known = SIGNALS.iter().zip(SIGNAL_DOCS).find(|((name, unit), _)| column_name(name, unit) == signal.name);
    let meaning = known.map_or("", |(_, doc)| doc.trim());
    Column::new(signal.name.as_str(), signal.unit.as_str(), meaning).field(DataType::Float32)
}

/// A batch of an open part with all columns of [`schema`].
///
/// # Errors
/// When the batch does not have the columns of [`stream_schema`].
pub(crate) fn complete(
    schema: &SchemaRef,
    label: &PointLabel,
    tick_hz: f64,
    batch: &RecordBatch,
) -> Result<RecordBatch, Failure> {
    let count = batch.num_rows();
    let name = |name: &str| -> Result<ArrayRef, Failure> {
        let names = Arc::new(StringArray::from(vec![name]));
        let keys = Int32Array::from(vec![0; count]);
        Ok(Arc::new(DictionaryArray::<Int32Type>::try_new(keys, names)?))
    };
    let ticks = batch.column(0).as_primitive::<UInt64Type>().values();
    let t_s: Float64Array = ticks.iter().map(|tick| Some(*tick as f64 / tick_hz)).collect();
    let mut columns: Vec<ArrayRef> = vec![
        name(&label.id.set_up)?,
        name(&label.id.experiment)?,
        Arc::new(UInt32Array::from(vec![label.id.segment; count])),
        Arc::new(UInt32Array::from(vec![label.point_index; count])),
        Arc::new(Float64Array::from(vec![label.frequency_hz; count])),
        batch.column(0).clone(),
        batch.column(1).clone(),
        Arc::new(t_s),
    ];
    columns.extend_from_slice(&batch.columns()[2..]);
    Ok(RecordBatch::try_new(schema.clone(), columns)?)
}
