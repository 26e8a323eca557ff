//! The host's clock as a local time, and dates as whole days.

use std::time::SystemTime;

use jiff::civil::{Date, date};
use jiff::fmt::temporal::Pieces;
use jiff::tz::TimeZone;
use jiff::{Span, Timestamp, Zoned};

/// The local time now. A clock beyond the years that can be written (it was never set, or wrongly) gives the nearest of them.
#[must_use]
pub fn now() -> Zoned {
    let now = SystemTime::now();
    let nearest = if now < SystemTime::UNIX_EPOCH { Timestamp::MIN } else { Timestamp::MAX };
    Timestamp::try_from(now).unwrap_or(nearest).to_zoned(TimeZone::system())
}

/// The local time now in the form of RFC 3339, as every file has it: `2026-11-24T09:04:26.123456+01:00`.
#[must_use]
pub fn now_text() -> String {
    text(&now())
}

/// A time in the form of RFC 3339, with microseconds: more digits, or the name of the zone in brackets, are refused by many readers.
#[must_use]
pub fn text(time: &Zoned) -> String {
    time.strftime("%Y-%m-%dT%H:%M:%S%.6f%:z").to_string()
}

/// A time of a file in the form of RFC 3339. Earlier versions added the zone: `2026-11-24T09:04:26+01:00[Europe/Berlin]`.
#[must_use]
pub fn plain(text: &str) -> &str {
    text.split('[').next().unwrap_or(text)
}

/// A time of a file, of this or an earlier version, at its own offset; `None` for another text.
#[must_use]
pub fn parse(text: &str) -> Option<Zoned> {
    let offset = Pieces::parse(plain(text)).ok()?.to_numeric_offset()?;
    let time: Timestamp = plain(text).parse().ok()?;
    Some(time.to_zoned(TimeZone::fixed(offset)))
}

/// Day 0 of dates in settings.
const EPOCH: Date = date(1970, 1, 1);

/// A date as whole days since 1970-01-01.
#[must_use]
pub fn days(date: Date) -> f32 {
    // Exact: an `f32` has 24 bits, the year 9999 is day 2 932 896.
    date.since(EPOCH).map_or(0, |span| span.get_days()) as f32
}

/// Today as whole days since 1970-01-01.
#[must_use]
pub fn today_days() -> f32 {
    days(now().date())
}

/// A date of so many days since 1970-01-01, as 2026-05-01; "never" for 0.
#[must_use]
pub fn date_text(days: f32) -> String {
    if days <= 0.0 {
        return "never".into();
    }
    let date = Span::new().try_days(days as i64).and_then(|span| EPOCH.checked_add(span));
    date.map_or_else(|_| format!("day {days}"), |date| date.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_read_back_with_its_offset_in_the_form_of_every_version() {
        let written = "2026-07-03T09:04:26.123456+02:00";
        let time = parse(written).unwrap();
        assert_eq!(text(&time), written);
        assert_eq!(time.strftime("%H:%M %:z").to_string(), "09:04 +02:00");
        assert_eq!(parse("2026-07-03T09:04:26.123456789+02:00[Europe/Berlin]").map(|t| text(&t)).unwrap(), written);
        assert_eq!(parse("yesterday"), None);
    }

    #[test]
    fn days_and_dates_are_each_others_inverse() {
        for (date, expected) in
            [(date(1970, 1, 2), 1.0), (date(2026, 5, 1), 20_574.0), (date(9999, 12, 31), 2_932_896.0)]
        {
            assert_eq!(days(date), expected);
            assert_eq!(date_text(expected), date.to_string());
        }
        assert_eq!(date_text(0.0), "never");
    }
}
