//! Recorded base motion: reading CSV and AT2 files, and the motion between the samples.

mod at2;
mod keys;
mod read;
mod record;
mod units;

pub use keys::TABLES;
pub(crate) use keys::base_record::{FILE as RECORD_FILE, SCALE as RECORD_SCALE};
pub(crate) use keys::{BASE_RECORD, read_record};
pub use read::resolve;
pub(crate) use read::{Rows, rows};
pub use record::{Play, Quantity, Record};
