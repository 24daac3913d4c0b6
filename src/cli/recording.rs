//! What the commands that record have in common: options, refusals, the closing line.

use super::ended::{Ended, unbegun};
use crate::recording::{Head, Limits, RecordingError};
use crate::runtime::{QUEUE_BYTES, RecordTo, Recorded};
use crate::source::Source;
use clap::Args;
use std::path::{Path, PathBuf};

/// `--record` with its limits.
#[derive(Debug, Args)]
pub struct RecordOption {
    /// Record the frames as they come, and what is found in them, into a new file (.mcap).
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
}

/// When a recording goes on in a next file.
#[derive(Clone, Debug, Args)]
pub struct LimitArgs {
    /// Go on in a next file (NAME-1.mcap, …) when one has grown to this size, e.g. 2GB, 500MB or
    /// 1GiB.
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    max_size: Option<u64>,
    /// Go on in a next file after this time, e.g. 10min, 90s or 2h.
    #[arg(long, value_name = "TIME", value_parser = parse_time_ns)]
    max_time: Option<u64>,
}

impl LimitArgs {
    pub fn limits(&self) -> Limits {
        Limits {
            max_bytes: self.max_size,
            max_time_ns: self.max_time,
        }
    }
}

impl RecordOption {
    /// Told before anything is filmed, not after.
    pub fn refuse_unfit(&self) -> Result<(), Ended> {
        match &self.record {
            Some(path) => refuse_unfit(path),
            None if self.limits.limits() == Limits::default() => Ok(()),
            None => Err(Ended::BadUsage(anyhow::anyhow!(
                "--max-size and --max-time go with --record FILE; add it"
            ))),
        }
    }

    pub fn target(&self, source: &dyn Source) -> Option<RecordTo> {
        self.record
            .as_ref()
            .map(|path| target(path, self.limits.limits(), source))
    }
}

/// The head of the recording of this source.
pub fn target(path: &Path, limits: Limits, source: &dyn Source) -> RecordTo {
    let info = source.describe();
    let head = Head {
        source: info.name,
        format: info.format,
        size: Some(info.size),
        nominal_rate_hz: info.nominal_rate_hz,
        clock: source.health().clock.name().into(),
    };
    RecordTo {
        path: path.to_owned(),
        limits,
        head,
        queue_bytes: QUEUE_BYTES,
    }
}

/// Nothing is ever overwritten, and another ending would not be known again.
pub fn refuse_unfit(path: &Path) -> Result<(), Ended> {
    if !path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("mcap"))
    {
        let shown = path.display();
        return Err(Ended::BadUsage(anyhow::anyhow!(
            "{shown} does not end in .mcap, which a recording must"
        )));
    }
    // A link that leads nowhere is something that is there, too.
    if path.symlink_metadata().is_ok() {
        return Err(unbegun(RecordingError::Exists {
            path: path.to_owned(),
        }));
    }
    Ok(())
}

/// What was recorded, for the end.
pub fn closing_line(recorded: &Recorded, missing: u64) -> String {
    let Recorded {
        frames,
        files,
        bytes,
        last,
        ..
    } = recorded;
    let size = if *bytes < 1_000_000 {
        format!("{} kB", bytes / 1000)
    } else {
        format!("{:.1} MB", *bytes as f64 / 1e6)
    };
    let where_to = match files {
        1 => last.display().to_string(),
        n => format!("{n} files, the last of them {}", last.display()),
    };
    let but = if missing > 0 {
        format!(", {missing} frames are missing in it")
    } else {
        String::new()
    };
    format!("recording: {where_to}: {frames} frames, {size}{but}")
}

/// Number and unit of `10min`.
fn split(text: &str) -> Option<(f64, String)> {
    let text = text.trim();
    let at = text
        .find(|c: char| !(c.is_ascii_digit() || c == '.'))
        .unwrap_or(text.len());
    let number: f64 = text[..at].parse().ok()?;
    (number > 0.0 && number.is_finite()).then(|| (number, text[at..].trim().to_lowercase()))
}

fn bytes_in(unit: &str) -> Option<f64> {
    Some(match unit {
        "b" => 1.0,
        "kb" | "k" => 1e3,
        "mb" | "m" => 1e6,
        "gb" | "g" => 1e9,
        "tb" | "t" => 1e12,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        _ => return None,
    })
}

fn parse_size(text: &str) -> Result<u64, String> {
    let bytes = split(text).and_then(|(number, unit)| Some(number * bytes_in(&unit)?));
    match bytes {
        Some(bytes) if bytes >= 1e6 => Ok(bytes as u64),
        Some(_) => Err("a file must be allowed at least 1MB".into()),
        None => Err("give a number with kB, MB, GB or GiB, e.g. 2GB".into()),
    }
}

fn seconds_in(unit: &str) -> Option<f64> {
    Some(match unit {
        "s" | "sec" => 1.0,
        "min" | "m" => 60.0,
        "h" => 3600.0,
        "d" => 86_400.0,
        _ => return None,
    })
}

pub fn parse_time_ns(text: &str) -> Result<u64, String> {
    let seconds = split(text).and_then(|(number, unit)| Some(number * seconds_in(&unit)?));
    match seconds {
        Some(seconds) if (1.0..1e10).contains(&seconds) => Ok((seconds * 1e9) as u64),
        Some(_) => Err("give at least 1s".into()),
        None => Err("give a number with s, min or h, e.g. 10min".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_times_are_read_as_people_write_them() {
        assert_eq!(parse_size("2GB"), Ok(2_000_000_000));
        assert_eq!(parse_size("1.5 gib"), Ok(1_610_612_736));
        assert_eq!(parse_time_ns("10min"), Ok(600_000_000_000));
        assert_eq!(parse_time_ns("1.5h"), Ok(5_400_000_000_000));
        for bad in [
            "",
            "2",
            "GB",
            "2 parsecs",
            "-1GB",
            "0GB",
            "nanGB",
            "1kB",
            "1e999GB",
        ] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
        for bad in ["", "10", "min", "0s", "0.5s", "1e5000h"] {
            assert!(parse_time_ns(bad).is_err(), "{bad}");
        }
    }
}
