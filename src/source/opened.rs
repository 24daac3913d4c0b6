//! What is reported of a camera that has been opened, whichever way it is read.

use super::choice::{Granted, Wish, is_same_rate};
use super::error::SourceError;
use super::identity::Known;
use super::interface::SourceInfo;
use crate::model::FormatNote;
use std::path::Path;

/// `name`: what the driver calls it, and whatever else is to be said of it.
pub(super) fn describe(
    path: &Path,
    name: &str,
    known: &Known,
    asked: &Wish,
    granted: &Granted,
) -> SourceInfo {
    let identity = known
        .identity()
        .map_or(String::new(), |i| format!(", {}", i.id));
    let given = granted.to_string();
    let asked = if asked.is_met_by(granted) {
        given.clone()
    } else {
        asked.to_string()
    };
    SourceInfo {
        name: format!("{} ({name}{identity})", path.display()),
        format: FormatNote { asked, given },
        size: granted.size,
        nominal_rate_hz: granted.rate_hz,
        frames_total: None,
        live: true,
        depth: None,
    }
}

/// Whether a camera that has come back grants what it granted before: its pictures must stay as
/// they were.
pub(super) fn same_again(path: &Path, before: &Granted, now: &Granted) -> Result<(), SourceError> {
    let same_rate = before
        .rate_hz
        .zip(now.rate_hz)
        .is_none_or(|(a, b)| is_same_rate(a, b));
    if (now.format, now.size) == (before.format, before.size) && same_rate {
        return Ok(());
    }
    let what = format!("it came back with {now} instead of {before}; set it back, or start anew");
    Err(SourceError::BadFormat {
        input: path.display().to_string(),
        what,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{PixelFormat, Size};

    #[test]
    fn another_size_or_rate_is_not_the_same_and_an_untold_rate_is() {
        let before = Granted {
            format: PixelFormat::Yuyv,
            size: Size::new(640, 480),
            rate_hz: Some(30.0),
        };
        let path = Path::new("/dev/video0");
        for rate_hz in [None, Some(30.0), Some(30000.0 / 1001.0)] {
            assert!(same_again(path, &before, &Granted { rate_hz, ..before }).is_ok());
        }
        let others = [
            Granted {
                rate_hz: Some(25.0),
                ..before
            },
            Granted {
                size: Size::new(640, 360),
                ..before
            },
            Granted {
                format: PixelFormat::Mjpeg,
                ..before
            },
        ];
        for now in others {
            let error = same_again(path, &before, &now)
                .expect_err("another")
                .to_string();
            assert!(
                error.contains(&format!("came back with {now} instead of {before}")),
                "{error}"
            );
        }
    }
}
