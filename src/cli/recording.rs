//! Options, checks and the closing line of the commands that record.

use super::command_error::CommandError;
use crate::model::{Origin, UserNotes};
use crate::recording::{Head, Limits, RecordingError};
use crate::runtime::{QUEUE_BYTES, RecordTo, Recorded};
use crate::source::Source;
use clap::Args;
use std::path::{Path, PathBuf};

/// `--record` and its limits.
#[derive(Debug, Args)]
pub struct RecordOption {
    /// Record the frames, and what is found in them, to a new file (.mcap).
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Limits of each file of a recording.
#[derive(Clone, Debug, Args)]
pub struct LimitArgs {
    /// Start a new file (NAME-1.mcap, …) when the current one has this size, e.g. 2GB, 500MB or
    /// 1GiB.
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    max_size: Option<u64>,
    /// Start a new file after this duration, e.g. 10min, 90s or 2h.
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
    /// Checks the options before anything is filmed.
    ///
    /// # Errors
    /// The file exists or has another suffix, or there are limits without a file.
    pub fn check(&self) -> Result<(), CommandError> {
        match &self.record {
            Some(path) => check_new_file(path),
            None if self.limits.limits() == Limits::default() => Ok(()),
            None => Err(CommandError::BadUsage(anyhow::anyhow!(
                "--max-size and --max-time go with --record FILE; add it"
            ))),
        }
    }

    /// Where to record frames of `source` with these notes to; `None` without `--record`.
    pub fn target(&self, source: &dyn Source, notes: &UserNotes) -> Option<RecordTo> {
        self.record
            .as_ref()
            .map(|path| target(path, self.limits.limits(), source, notes))
    }
}

/// Where to record frames of `source` to, with the metadata of the recording.
pub fn target(path: &Path, limits: Limits, source: &dyn Source, notes: &UserNotes) -> RecordTo {
    let info = source.describe();
    let head = Head {
        source: info.name,
        format: info.format,
        size: Some(info.size),
        nominal_rate_hz: info.nominal_rate_hz,
        clock: source.health().clock.name().into(),
        origin: Origin {
            notes: notes.clone(),
            ..source.origin()
        },
        depth: info.depth,
    };
    RecordTo {
        path: path.to_owned(),
        limits,
        head,
        queue_bytes: QUEUE_BYTES,
    }
}

/// Checks the path of a new recording: no file is overwritten, and recordings are recognised by
/// their suffix.
///
/// # Errors
/// The file exists, or its name does not end in .mcap.
pub fn check_new_file(path: &Path) -> Result<(), CommandError> {
    if !path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("mcap"))
    {
        let shown = path.display();
        return Err(CommandError::BadUsage(anyhow::anyhow!(
            "{shown} does not end in .mcap, which a recording must"
        )));
    }
    // A broken symbolic link counts as an existing file, too.
    if path.symlink_metadata().is_ok() {
        return Err(CommandError::from(RecordingError::Exists {
            path: path.to_owned(),
        }));
    }
    Ok(())
}

/// The last line of a run that recorded: files, frames and size; `missing` frames were lost.
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

/// Splits e.g. `10min` into a positive number and its unit in lower case.
fn split(text: &str) -> Option<(f64, String)> {
    let text = text.trim();
    let at = text
        .find(|c: char| !(c.is_ascii_digit() || c == '.'))
        .unwrap_or(text.len());
    let number: f64 = text[..at].parse().ok()?;
    (number > 0.0 && number.is_finite()).then(|| (number, text[at..].trim().to_lowercase()))
}

/// Bytes in a unit.
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

/// Parses the size of a file, bytes.
fn parse_size(text: &str) -> Result<u64, String> {
    let bytes = split(text).and_then(|(number, unit)| Some(number * bytes_in(&unit)?));
    match bytes {
        Some(bytes) if bytes >= 1e6 => Ok(bytes as u64),
        Some(_) => Err("a file must be allowed at least 1MB".into()),
        None => Err("give a number with kB, MB, GB or GiB, e.g. 2GB".into()),
    }
}

/// Seconds in a unit.
fn seconds_in(unit: &str) -> Option<f64> {
    Some(match unit {
        "s" | "sec" => 1.0,
        "min" | "m" => 60.0,
        "h" => 3600.0,
        "d" => 86_400.0,
        _ => return None,
    })
}

/// Parses a duration, ns.
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
