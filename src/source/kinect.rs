//! Films of an Azure Kinect: a Matroska file with tracks of colour (`COLOR`) and depth (`DEPTH`, 16 bits
//! of millimetres), and the calibration as an attachment. Both tracks are read through ffmpeg.

use super::depth_format::{KnownDepth, SaidOfDepth};
use super::depth_tally::DepthTally;
use super::error::SourceError;
use super::interface::{Source, SourceInfo};
use super::kinect_calibration::{self, LONGEST};
use super::probe::file_url;
use super::video::Video;
use super::video_pipe::VideoPipe;
use crate::config;
use crate::model::{DepthImage, Origin, PixelFormat, RawFrame, Size, nanoseconds};
use crate::recording::Pairing;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

/// Metres for each count.
const UNIT_M: f64 = 0.001;
/// So many pictures wait for a depth image: which is the nearest to it shows with the next one.
const WAITING: u64 = 2;
/// The attachment with the calibration.
const CALIBRATION: &str = "calibration.json";

/// What ffprobe says of a file.
#[derive(Deserialize)]
struct Probed {
    streams: Vec<Stream>,
}

#[derive(Deserialize)]
struct Stream {
    index: usize,
    #[serde(default)]
    codec_type: String,
    #[serde(default)]
    width: u32,
    #[serde(default)]
    height: u32,
    #[serde(default)]
    tags: BTreeMap<String, String>,
}

impl Stream {
    fn is_named(&self, title: &str) -> bool {
        self.tags.get("title").is_some_and(|own| own == title)
    }

    fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }
}

/// The tracks of such a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tracks {
    depth: usize,
    depth_size: Size,
    calibration: Option<usize>,
}

impl Tracks {
    /// `None` for any other file.
    pub fn of(path: &Path) -> Option<Self> {
        let is_matroska = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("mkv"));
        if !is_matroska {
            return None;
        }
        let output = Command::new("ffprobe")
            .args(["-v", "error", "-protocol_whitelist", "file", "-of", "json"])
            .args(["-show_entries", "stream=index,codec_type,width,height"])
            .args(["-show_entries", "stream_tags=title,filename", "-i"])
            .arg(file_url(path))
            .stdin(Stdio::null())
            .output();
        Self::in_answer(&output.ok()?.stdout)
    }

    fn in_answer(json: &[u8]) -> Option<Self> {
        let probed: Probed = serde_json::from_slice(json).ok()?;
        let mut videos = probed.streams.iter().filter(|s| s.codec_type == "video");
        // Of the colours it is the first, as in every film.
        videos.next()?;
        let depth = videos.find(|stream| stream.is_named("DEPTH"))?;
        let mut streams = probed.streams.iter();
        let calibration = streams.find(|stream| {
            stream.codec_type == "attachment"
                && stream.tags.get("filename").map(String::as_str) == Some(CALIBRATION)
        });
        Some(Self {
            depth: depth.index,
            depth_size: depth.size(),
            calibration: calibration.map(|stream| stream.index),
        })
    }
}

/// A film that is being read.
pub(super) struct Kinect {
    path: PathBuf,
    colour: Video,
    depth: VideoPipe,
    known: KnownDepth,
    pairing: Pairing<RawFrame>,
    /// Pictures that wait.
    waiting: u64,
    colour_ended: bool,
    depth_ended: bool,
    tally: DepthTally,
}

impl Kinect {
    pub(super) fn open(
        path: &Path,
        tracks: Tracks,
        settings: &config::Depth,
    ) -> Result<Self, SourceError> {
        let colour = Video::open(path)?;
        let picture = colour.describe().size;
        let said = said(path, &tracks, settings, picture)?;
        let known = said.known(path, settings, picture)?;
        known
            .check_size(tracks.depth_size)
            .map_err(|what| SourceError::bad_format(path, what))?;
        let stream = format!("0:{}", tracks.depth);
        Ok(Self {
            path: path.to_owned(),
            colour,
            depth: VideoPipe::start(path, "ffmpeg", &stream, PixelFormat::DEPTH[0])?,
            pairing: Pairing::in_turns(known.format.late_s),
            known,
            waiting: 0,
            colour_ended: false,
            depth_ended: false,
            tally: DepthTally::default(),
        })
    }

    /// Reads one image more: pictures until some wait, then depth.
    fn read_on(&mut self) -> Result<(), SourceError> {
        if !self.colour_ended && self.waiting < WAITING {
            match self.colour.next_frame()? {
                Some(frame) => {
                    self.waiting += 1;
                    self.pairing.picture(frame);
                }
                None => self.colour_ended = true,
            }
            return Ok(());
        }
        let Some(frame) = self.depth.next_frame() else {
            self.depth_ended = true;
            return Ok(());
        };
        let image = DepthImage::from_bytes(frame.size, &frame.bytes)
            .ok_or_else(|| "it is cut".to_owned())
            .and_then(|image| self.known.usable(image));
        match image {
            Ok(image) => self
                .pairing
                .depth(nanoseconds(frame.time_s), Arc::new(image)),
            Err(why) => self.tally.unreadable(why),
        }
        Ok(())
    }

    /// The oldest picture, if nothing more has to be read for it.
    fn ready(&mut self) -> Option<RawFrame> {
        let is_known = self.colour_ended || self.waiting >= WAITING;
        match is_known {
            true if self.depth_ended => self.pairing.oldest(),
            true => self.pairing.ready(),
            false => None,
        }
    }
}

/// What the file says of its depth. What nobody needs, because the user says it, may be wrong.
fn said(
    path: &Path,
    tracks: &Tracks,
    settings: &config::Depth,
    picture: Size,
) -> Result<SaidOfDepth, SourceError> {
    let mut said = SaidOfDepth {
        unit_m: Some(UNIT_M),
        ..SaidOfDepth::default()
    };
    if crate::depth::pinhole(settings).is_some() {
        return Ok(said);
    }
    let rig = match tracks.calibration {
        None => Err("it has no calibration.json".to_owned()),
        Some(stream) => attachment(path, stream)
            .and_then(|text| kinect_calibration::kinect_rig(&text, tracks.depth_size, picture)),
    };
    said.rig = Some(rig.map_err(|why| {
        let what = format!(
            "its calibration cannot be used ({why}); give --depth-camera FILE, or --no-depth for the \
             colours alone"
        );
        SourceError::bad_format(path, what)
    })?);
    Ok(said)
}

/// The text of an attachment. ffmpeg writes it before it complains that there is nothing else to do.
fn attachment(path: &Path, stream: usize) -> Result<String, String> {
    let child = Command::new("ffmpeg")
        .args(["-nostdin", "-hide_banner", "-v", "quiet"])
        .args(["-protocol_whitelist", "file,pipe"])
        .args([&format!("-dump_attachment:{stream}"), "pipe:1", "-i"])
        .arg(file_url(path))
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .stdout(Stdio::piped())
        .spawn();
    let mut child = child.map_err(|e| format!("ffmpeg does not start: {e}"))?;
    let mut text = String::new();
    let read = child
        .stdout
        .take()
        .map(|output| output.take(LONGEST as u64).read_to_string(&mut text));
    let _ = child.kill();
    let _ = child.wait();
    match read {
        Some(Ok(length)) if length > 0 && length < LONGEST => Ok(text),
        _ => Err("it is no text of usual length".to_owned()),
    }
}

impl Source for Kinect {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        loop {
            if let Some(frame) = self.ready() {
                self.waiting -= 1;
                self.tally
                    .frame(frame.sensor_time_s, frame.depth.as_deref());
                return Ok(Some(frame));
            }
            if self.colour_ended && self.waiting == 0 {
                return Ok(None);
            }
            self.read_on()?;
        }
    }

    fn describe(&self) -> SourceInfo {
        SourceInfo {
            depth: Some(self.known.format),
            ..self.colour.describe()
        }
    }

    fn origin(&self) -> Origin {
        self.colour.origin()
    }

    fn warnings(&mut self) -> Vec<String> {
        let mut lines = self.colour.warnings();
        lines.extend(self.tally.take_warnings(&self.path.display().to_string()));
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tracks_are_known_by_their_names() {
        let json = |title: &str| {
            format!(
                r#"{{"programs": [], "streams": [
                {{"index": 0, "codec_type": "video", "width": 1280, "height": 720, "tags": {{"title": "COLOR"}}}},
                {{"index": 1, "codec_type": "video", "width": 640, "height": 576, "tags": {{"title": "{title}"}}}},
                {{"index": 2, "codec_type": "video", "width": 640, "height": 576, "tags": {{"title": "IR"}}}},
                {{"index": 4, "codec_type": "attachment", "tags": {{"filename": "calibration.json"}}}}]}}"#
            )
        };
        let tracks = Tracks::in_answer(json("DEPTH").as_bytes());
        let expected = Tracks {
            depth: 1,
            depth_size: Size::new(640, 576),
            calibration: Some(4),
        };
        assert_eq!(tracks, Some(expected));
        assert_eq!(Tracks::in_answer(json("OTHER").as_bytes()), None);
        assert_eq!(Tracks::in_answer(b"{}"), None);
    }
}
