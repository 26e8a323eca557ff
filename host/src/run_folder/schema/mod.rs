//! Records and columns of a run folder's files. Plain data: no file is opened here.

pub mod acting_settings;
pub mod clock_fit;
pub mod device;
pub mod impacts;
pub mod journal_entry;
pub mod journal_state;
mod json_float;
pub mod manifest;
pub mod peak_points;
pub mod results;
pub mod samples;
pub mod segment_id;
pub mod self_description;
pub mod set_up_parameters;
pub mod stream_sums;
mod table_rows;
pub mod transients;
