//! How Parquet files are written: with Snappy compression, which every reader has.

use arrow_schema::{DataType, Schema};
use parquet::basic::{Compression, Encoding};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

/// Encodings of every table, and the metadata of its schema as that of the file: readers without Arrow have no other. Measured values hardly ever repeat, so a dictionary of them only adds length. Ticks rise
/// evenly, so their differences are short.
#[must_use]
pub fn properties(schema: &Schema) -> WriterProperties {
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(crate::VERSION_LINE.to_string());
    if !schema.metadata().is_empty() {
        let about = schema.metadata().iter().map(|(key, text)| KeyValue::new(key.clone(), text.clone()));
        properties = properties.set_key_value_metadata(Some(about.collect()));
    }
    for field in schema.fields() {
        let encoding = match field.data_type() {
            DataType::Float32 => Encoding::PLAIN,
            DataType::UInt64 => Encoding::DELTA_BINARY_PACKED,
            _ => continue,
        };
        let column = field.name().as_str();
        properties = properties.set_column_dictionary_enabled(column.into(), false);
        properties = properties.set_column_encoding(column.into(), encoding);
    }
    properties.build()
}
