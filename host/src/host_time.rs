//! The host's clock as a local time.

use std::time::SystemTime;

use jiff::tz::TimeZone;
use jiff::{Timestamp, Zoned};

/// The local time now. A clock beyond the years that can be written (it was never set, or wrongly) gives the nearest of them.
#[must_use]
pub fn now() -> Zoned {
    let now = SystemTime::now();
    let nearest = if now < SystemTime::UNIX_EPOCH { Timestamp::MIN } else { Timestamp::MAX };
    Timestamp::try_from(now).unwrap_or(nearest).to_zoned(TimeZone::system())
}
