//! Recorded base motion: reading files, noise from a seed, and the motion between the samples.

mod keys;
mod noise;
mod read;
mod record;
mod units;

pub use keys::TABLES;
pub(crate) use keys::base_record::{FILE as RECORD_FILE, NOISE as RECORD_NOISE, SCALE as RECORD_SCALE};
pub(crate) use keys::{BASE_RECORD, ENVELOPE, GivenMotion, NOISE, OF_FILE, read_motion, read_peak};
pub use noise::Noise;
pub(crate) use read::{RecordRows, rows};
pub use read::{Spec, Which, read};
pub use record::{Play, Record, RecordOrigin, RecordQuantity};
