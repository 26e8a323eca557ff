//! Runs a campaign on a device and passes what it reports to the recorder.
//!
//! Set-up by set-up and experiment by experiment, all points that are not taken yet: so a run goes on after a lost link,
//! and is resumed after a kill, in the same way as it starts. The points around a measured peak follow its grid. Whatever ends a run early, the rig is stopped and the points
//! taken are kept. One start of the device is a segment; a [`Watcher`] shows
//! the progress to people.

mod campaign_run;
mod context;
mod error;
pub mod fault_text;
mod held_impacts;
mod held_results;
mod peak_points;
mod plan_check;
mod progress;
mod reconnect;
pub mod rehearsal;
mod reorder_buffer;
mod rest_check;
pub mod resume;
mod segment;
mod served_watcher;
mod spring_setup;
mod time_left;
mod transients;
mod watcher;
mod wire_mapping;

pub use context::{Reconnect, Run, Tally, device_record};
pub use error::RunError;
pub use rest_check::RestFinding;
pub use time_left::TimeLeft;
pub use watcher::{RestAnswer, RunAction, WatchedStart, Watcher};
pub use wire_mapping::Selection;
