//! What a video file says of itself, by ffprobe.

use super::error::SourceError;
use crate::model::LocalTime;
use std::ffi::OsString;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};

/// Up to this length every packet is counted; a longer file would make the user wait for a mere
/// progress bar.
const COUNTED_BYTES: u64 = 128 << 20;

/// Where a file says when it was filmed: QuickTime's own tag has the time zone, the other is in
/// UTC.
const CREATION_TAGS: [&str; 2] = ["com.apple.quicktime.creationdate", "creation_time"];
/// A clock that was never set counts from 1904, 1970 or 1980; what says so says nothing.
const UNSET_CLOCK_YEAR: i16 = 1980;

/// The first video stream of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Probe {
    pub codec: String,
    pub rate_hz: Option<f64>,
    pub frames: Option<u64>,
    /// How long the stream is by the file's own head, s; a clip that was cut in the middle still
    /// says its full length.
    pub duration_s: Option<f64>,
    /// The file is shorter than its head says; only AVI is looked at, of the others ffmpeg itself
    /// says so.
    pub cut: bool,
    /// When it was filmed, where the file says so.
    pub created_at: Option<LocalTime>,
}

/// `file:` before the name: neither a leading dash nor a colon in it then means anything to ffmpeg.
pub(super) fn file_url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

/// What it means that a child process did not start.
pub(super) fn spawn_error(program: &str, path: &Path, e: &std::io::Error) -> SourceError {
    if e.kind() == std::io::ErrorKind::NotFound {
        return SourceError::MissingTool {
            tool: program.to_owned(),
        };
    }
    SourceError::BadFormat {
        input: path.display().to_string(),
        what: format!("{program} does not start: {e}"),
    }
}

/// Asks ffprobe, which is called `program`.
pub(super) fn probe(path: &Path, program: &str) -> Result<Probe, SourceError> {
    let (length, cut) = look_into(path).map_err(|e| SourceError::of_file(path, &e))?;
    if length == 0 {
        let what = "the file has no content; film again, or name another file";
        return Err(SourceError::bad_format(path, what));
    }
    let output = ffprobe(path, program, length <= COUNTED_BYTES)
        .output()
        .map_err(|e| spawn_error(program, path, &e))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let hint = if said.contains("moov atom not found") {
            " (an .mp4 that was cut short)"
        } else {
            ""
        };
        let what =
            format!("it is no video that ffmpeg can read{hint}; try to play it with `ffplay`");
        return Err(SourceError::bad_format(path, what));
    }
    let said = serde_json::from_slice(&output.stdout)
        .map_err(|e| SourceError::bad_format(path, format!("{program} gives no answer: {e}")))?;
    first_stream(&said, cut).map_err(|what| SourceError::bad_format(path, what))
}

fn ffprobe(path: &Path, program: &str, counts: bool) -> Command {
    let mut command = Command::new(program);
    // Only V: a picture of a sleeve in a sound file is a video stream, too, but not one that moves.
    command.args([
        "-v",
        "error",
        "-protocol_whitelist",
        "file",
        "-select_streams",
        "V:0",
        "-of",
        "json",
    ]);
    if counts {
        command.arg("-count_packets");
    }
    command
        .args([
            "-show_entries",
            "stream=codec_name,nb_frames,nb_read_packets,duration,avg_frame_rate:stream_tags",
        ])
        .args([
            "-show_entries",
            "format=format_name,nb_streams,duration,start_time:format_tags",
            "-i",
        ])
        .arg(file_url(path))
        .stdin(Stdio::null());
    command
}

/// What ffprobe has said of the first video stream; the error says why there is none.
fn first_stream(said: &serde_json::Value, cut: bool) -> Result<Probe, &'static str> {
    let (stream, format) = (&said["streams"][0], &said["format"]);
    let container = format["format_name"].as_str().unwrap_or_default();
    if container == "image2" || container.ends_with("_pipe") {
        return Err("it is a single picture; give the folder of pictures, or a video");
    }
    let codec = stream["codec_name"].as_str().unwrap_or_default();
    // ffmpeg plays a text file as a typewriter, which nobody wants to see here.
    if codec.is_empty() || codec == "ansi" || container == "tty" {
        return Err("there is no video in it");
    }
    let mut frames = number(&stream["nb_read_packets"]);
    // Other containers only guess; for MJPEG in AVI it may be twice the number.
    if frames.is_none() && container.contains("mp4") {
        frames = number(&stream["nb_frames"]);
    }
    Ok(Probe {
        codec: codec.to_owned(),
        rate_hz: ratio(stream["avg_frame_rate"].as_str().unwrap_or_default()),
        frames: frames.map(|n| n as u64),
        cut,
        duration_s: duration_s(stream, format),
        created_at: created_at(&[&format["tags"], &stream["tags"]]),
    })
}

/// Length of the file, and whether its RIFF head promises more. A head that promises nothing is not
/// finished, either.
fn look_into(path: &Path) -> std::io::Result<(u64, bool)> {
    let file = std::fs::File::open(path)?;
    let (length, mut head) = (file.metadata()?.len(), Vec::new());
    file.take(8).read_to_end(&mut head)?;
    let promised = match head.as_slice() {
        [b'R', b'I', b'F', b'F', size @ ..] => size
            .iter()
            .rev()
            .fold(0, |n, &byte| n << 8 | u64::from(byte)),
        _ => return Ok((length, false)),
    };
    Ok((length, promised == 0 || promised + 8 > length))
}

/// When the film was made, by the first of its tags that says so.
fn created_at(tags: &[&serde_json::Value]) -> Option<LocalTime> {
    let named = CREATION_TAGS
        .iter()
        .flat_map(|name| tags.iter().map(|tags| &tags[*name]));
    named
        .filter_map(|tag| tag.as_str()?.parse().ok())
        .find(|at: &LocalTime| at.year() > UNSET_CLOCK_YEAR)
}

fn number(value: &serde_json::Value) -> Option<f64> {
    value
        .as_str()?
        .parse()
        .ok()
        .filter(|n: &f64| n.is_finite() && *n > 0.0)
}

/// `30000/1001` as a number; nothing for `0/0`.
pub(super) fn ratio(text: &str) -> Option<f64> {
    let (a, b) = text.trim().split_once('/')?;
    let value = a.parse::<f64>().ok()? / b.parse::<f64>().ok()?;
    (value.is_finite() && value > 0.0).then_some(value)
}

/// Length of the stream, s, by its own entry, by its tag, or by that of the file. The whole file
/// may be longer than its picture, unless there is nothing else in it.
fn duration_s(stream: &serde_json::Value, format: &serde_json::Value) -> Option<f64> {
    let alone = format["nb_streams"].as_u64() == Some(1);
    number(&stream["duration"])
        .or_else(|| tagged_s(stream))
        .or_else(|| number(&format["duration"]).filter(|_| alone))
}

/// `00:00:11.000` of Matroska, s.
fn tagged_s(stream: &serde_json::Value) -> Option<f64> {
    let mut parts = stream["tags"]["DURATION"].as_str()?.split(':');
    let hours: f64 = parts.next()?.parse().ok()?;
    let minutes: f64 = parts.next()?.parse().ok()?;
    let seconds: f64 = parts.next()?.parse().ok()?;
    Some(3600.0 * hours + 60.0 * minutes + seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_time_of_filming_is_what_the_file_says_and_no_unset_clock() {
        let (apple, plain) = ("com.apple.quicktime.creationdate", "creation_time");
        let filmed = "2023-05-03T12:07:12.000000Z";
        for (format, stream, expected) in [
            (json!({}), json!({}), None),
            (
                json!({plain: filmed, apple: "2023-05-03T14:07:12+0200"}),
                json!({}),
                Some("2023-05-03T14:07:12.000+02:00"),
            ),
            (
                json!(null),
                json!({plain: filmed}),
                Some("2023-05-03T12:07:12.000+00:00"),
            ),
            (
                json!({plain: "1970-01-01T00:00:00.000000Z"}),
                json!({}),
                None,
            ),
            (json!({plain: "some day"}), json!({}), None),
        ] {
            let at = created_at(&[&format, &stream]).map(|at| at.to_string());
            assert_eq!(at.as_deref(), expected, "{format} {stream}");
        }
    }
}
