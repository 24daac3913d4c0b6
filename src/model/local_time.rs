//! A date and a time of day, with the time zone's offset.

use jiff::fmt::temporal::{DateTimePrinter, Pieces};
use jiff::tz::Offset;
use jiff::{SignedDuration, Timestamp, Unit, ZonedDateTime};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Digits of the seconds behind the point: a frame is not timed better by the calendar.
const DIGITS: u8 = 3;

/// A moment on the calendar and its offset from UTC, to the millisecond:
/// `2026-05-03T14:07:12.250+02:00`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct LocalTime {
    at: Timestamp,
    offset: Offset,
}

/// A text that is no moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it is no date and time with an offset, as in 2026-05-03T14:07:12.250+02:00")]
pub struct NoLocalTime;

impl LocalTime {
    fn rounded(at: Timestamp, offset: Offset) -> Self {
        // Only in the last millisecond of the calendar it cannot be rounded.
        let at = at.round(Unit::Millisecond).unwrap_or(at);
        Self { at, offset }
    }

    /// A moment by the nanoseconds since 1970, in UTC; `None` beyond the calendar.
    pub fn from_unix_ns(ns: i64) -> Option<Self> {
        let at = Timestamp::from_nanosecond(ns.into()).ok()?;
        Some(Self::rounded(at, Offset::UTC))
    }

    /// The moment so much later, ns; itself beyond the calendar.
    pub fn later_by_ns(self, ns: i64) -> Self {
        let later = self.at.checked_add(SignedDuration::from_nanos(ns));
        Self::rounded(later.unwrap_or(self.at), self.offset)
    }

    /// The year there.
    pub fn year(self) -> i16 {
        self.offset.to_datetime(self.at).year()
    }
}

impl From<ZonedDateTime> for LocalTime {
    fn from(zoned: ZonedDateTime) -> Self {
        Self::rounded(zoned.timestamp(), zoned.offset())
    }
}

impl FromStr for LocalTime {
    type Err = NoLocalTime;

    /// Reads ISO 8601. A time without an offset is no moment.
    fn from_str(text: &str) -> Result<Self, NoLocalTime> {
        let pieces = Pieces::parse(text).map_err(|_| NoLocalTime)?;
        let time = pieces.time().ok_or(NoLocalTime)?;
        let offset = pieces.to_numeric_offset().ok_or(NoLocalTime)?;
        let at = offset
            .to_timestamp(pieces.date().to_datetime(time))
            .map_err(|_| NoLocalTime)?;
        Ok(Self::rounded(at, offset))
    }
}

impl fmt::Display for LocalTime {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut text = String::new();
        DateTimePrinter::new()
            .precision(Some(DIGITS))
            .print_timestamp_with_offset(&self.at, self.offset, &mut text)
            .map_err(|_| fmt::Error)?;
        f.pad(&text)
    }
}

impl From<LocalTime> for String {
    fn from(time: LocalTime) -> Self {
        time.to_string()
    }
}

impl TryFrom<String> for LocalTime {
    type Error = NoLocalTime;

    fn try_from(text: String) -> Result<Self, NoLocalTime> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_is_read_as_files_write_it_and_written_in_one_way() {
        for (text, expected) in [
            (
                "2026-05-03T14:07:12.250+02:00",
                "2026-05-03T14:07:12.250+02:00",
            ),
            // QuickTime.
            ("2023-05-03T14:07:12+0200", "2023-05-03T14:07:12.000+02:00"),
            // ffprobe.
            (
                "2023-05-03T12:07:12.000000Z",
                "2023-05-03T12:07:12.000+00:00",
            ),
            (
                "2023-12-31T23:59:59.9996-03:30",
                "2024-01-01T00:00:00.000-03:30",
            ),
        ] {
            let time: LocalTime = text.parse().expect(text);
            assert_eq!(time.to_string(), expected);
            assert_eq!(expected.parse(), Ok(time));
        }
        for bad in [
            "",
            "yesterday",
            "2023-05-03",
            "2023-05-03T14:07:12",
            "2023-13-03T14:07:12Z",
        ] {
            assert_eq!(bad.parse::<LocalTime>(), Err(NoLocalTime), "{bad}");
        }
    }

    #[test]
    fn a_later_moment_keeps_the_offset() {
        let time: LocalTime = "2026-05-03T23:59:59.900+02:00".parse().expect("a time");
        assert_eq!(
            time.later_by_ns(150_000_000).to_string(),
            "2026-05-04T00:00:00.050+02:00"
        );
        assert_eq!(time.year(), 2026);
        assert_eq!(
            LocalTime::from_unix_ns(0).map(|t| t.to_string()),
            Some("1970-01-01T00:00:00.000+00:00".into())
        );
    }
}
