//! A folder of colour and depth images with their times, as the RGB-D benchmark of TU Munich has it
//! (Sturm et al. 2012): `rgb.txt` and `depth.txt` list a time and a file a line. The two cameras have
//! clocks of their own; images belong together by their times.

use super::camera_file::CameraFile;
use super::depth_format::{KnownDepth, SaidOfDepth};
use super::depth_tally::DepthTally;
use super::error::SourceError;
use super::images::picture;
use super::interface::{Source, SourceInfo};
use crate::config;
use crate::model::{DEPTH_APART_S, DepthImage, FormatNote, RawFrame, Size, nanoseconds, seconds};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const COLOURS: &str = "rgb.txt";
const DEPTHS: &str = "depth.txt";
/// The colour camera, which the benchmark's own folders do not have.
const CAMERA: &str = "camera.json";
/// Metres for each count in folders of the benchmark.
const UNIT_M: f64 = 1.0 / 5000.0;
/// A longer list is something else, bytes: a day of film has 150 MB.
const LONGEST_LIST: u64 = 1 << 28;
/// Longest side of a depth image that is taken, px.
const MAX_SIDE_PX: u32 = 1 << 14;

/// Whether a folder is one.
pub(super) fn is_one(folder: &Path) -> bool {
    folder.join(COLOURS).is_file()
}

/// A folder that is being read.
pub(super) struct RgbdFolder {
    folder: PathBuf,
    frames: Vec<Listed>,
    /// The depth image that belongs to each of the frames.
    depths: Vec<Option<Listed>>,
    known: Option<KnownDepth>,
    next: usize,
    size: Size,
    tally: DepthTally,
    /// What is to be told at once.
    news: Vec<String>,
}

/// What may be done about a depth image that cannot be used.
const INSTEAD: &str = "put a sound one there, take its line out of depth.txt, or give --no-depth for the colours \
                       alone";

/// A line of a list.
#[derive(Clone, Debug, PartialEq)]
struct Listed {
    time_s: f64,
    file: PathBuf,
}

impl RgbdFolder {
    pub(super) fn open(folder: &Path, settings: &config::Depth) -> Result<Self, SourceError> {
        let input = folder.display().to_string();
        let frames = read_list(folder, COLOURS)?;
        let first = match frames.as_slice() {
            [] => {
                let what = "rgb.txt lists no picture";
                return Err(SourceError::Empty { input, what });
            }
            [_] => return Err(SourceError::SingleFrame { input }),
            [first, ..] => first,
        };
        let (size, ..) = read_picture(&first.file)?;
        let mut it = Self {
            folder: folder.to_owned(),
            depths: vec![None; frames.len()],
            frames,
            known: None,
            next: 0,
            size,
            tally: DepthTally::default(),
            news: Vec::new(),
        };
        if settings.read && folder.join(DEPTHS).is_file() {
            it.take_depth(settings)?;
        } else if settings.read {
            it.news.push(format!(
                "{}: there is no depth.txt beside rgb.txt, and so no depth: the colours are used alone",
                folder.display()
            ));
        }
        Ok(it)
    }

    fn take_depth(&mut self, settings: &config::Depth) -> Result<(), SourceError> {
        let mut listed = read_list(&self.folder, DEPTHS)?;
        for depth in &mut listed {
            depth.time_s -= settings.late_s;
        }
        if listed.is_empty() {
            return Err(SourceError::bad_format(
                &self.folder,
                "depth.txt lists no depth image; give --no-depth for the colours alone",
            ));
        }
        self.depths = paired(&self.frames, &listed);
        let Some(first) = self.depths.iter().flatten().next() else {
            let nearest_s = least_apart_s(&self.frames, &listed);
            return Err(SourceError::bad_format(
                &self.folder,
                format!(
                    "the clocks of colour and depth do not meet: the nearest two images are {nearest_s:.3} s \
                     apart, and {DEPTH_APART_S} s is the most; correct the times in depth.txt, or give \
                     --no-depth"
                ),
            ));
        };
        let first = first.file.clone();
        let image = read_depth(&first)
            .map_err(|why| SourceError::bad_format(&first, format!("{why}; {INSTEAD}")))?;
        let known = self
            .said(settings)?
            .known(&self.folder, settings, self.size)?;
        known
            .usable(image)
            .map_err(|what| SourceError::bad_format(&first, what))?;
        self.known = Some(known);
        Ok(())
    }

    /// What the folder says of its depth.
    fn said(&mut self, settings: &config::Depth) -> Result<SaidOfDepth, SourceError> {
        let file = self.folder.join(CAMERA);
        if !file.exists() {
            if crate::depth::pinhole(settings).is_none() {
                return Err(SourceError::bad_format(
                    &self.folder,
                    "nothing says what camera its depth belongs to; put a camera.json with fx, fy, cx and \
                     cy (px) into it, or give --depth-camera FILE, or --no-depth",
                ));
            }
            self.say_usual_unit(settings);
            return Ok(SaidOfDepth {
                unit_m: Some(UNIT_M),
                ..SaidOfDepth::default()
            });
        }
        let camera = CameraFile::read(&file)
            .map_err(|e| SourceError::bad_format(&self.folder, e.to_string()))?;
        if let Some(size) = camera.size.filter(|size| *size != self.size) {
            let what = format!("it is for pictures of {size}, these are {}", self.size);
            return Err(SourceError::bad_format(&file, what));
        }
        if camera.unit_m.is_none() {
            self.say_usual_unit(settings);
        }
        Ok(camera.said(self.size, UNIT_M))
    }

    /// Says that nothing says how long a count of its depth is, unless the user does.
    fn say_usual_unit(&mut self, settings: &config::Depth) {
        if settings.unit_m == 0.0 {
            self.news.push(format!(
                "{}: nothing says how long a count of its depth is: taken as {UNIT_M} m, as usual in such folders; \
                 give depth_unit_m in camera.json, or --depth-unit, if lengths are wrong",
                self.folder.display()
            ));
        }
    }

    /// The depth image of frame `k`, if there is one that can be used.
    fn depth(&mut self, k: usize) -> Option<Arc<DepthImage>> {
        let (Listed { time_s, file }, known) = (self.depths[k].clone()?, self.known.as_ref()?);
        let later_s = time_s - self.frames[k].time_s;
        let read = read_depth(&file).and_then(|image| known.usable(image));
        match read {
            Ok(image) => Some(Arc::new(DepthImage { later_s, ..image })),
            Err(why) => {
                self.tally.unreadable(format!("{}: {why}", file.display()));
                None
            }
        }
    }
}

impl Source for RgbdFolder {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        let k = self.next;
        let Some(Listed { time_s, file }) = self.frames.get(k).cloned() else {
            return Ok(None);
        };
        let (size, format, bytes) = read_picture(&file)?;
        if size != self.size {
            let was = self.size;
            let what =
                format!("the picture is {size}, those before it are {was}; make all of one size");
            return Err(SourceError::bad_format(&file, what));
        }
        let depth = self.depth(k);
        if self.known.is_some() {
            self.tally.frame(time_s, depth.as_deref());
        }
        self.next += 1;
        Ok(Some(RawFrame {
            sequence: Some(k as u64),
            sensor_time_s: seconds(nanoseconds(time_s)),
            size,
            format,
            bytes,
            depth,
        }))
    }

    fn describe(&self) -> SourceInfo {
        let beside = match self.known {
            Some(_) => " and depth",
            None => "",
        };
        let format = format!("pictures{beside} {}", self.size);
        SourceInfo {
            name: self.folder.display().to_string(),
            format: FormatNote {
                asked: format.clone(),
                given: format,
            },
            size: self.size,
            nominal_rate_hz: None,
            frames_total: Some(self.frames.len() as u64),
            live: false,
            depth: self.known.as_ref().map(|known| known.format),
        }
    }

    fn warnings(&mut self) -> Vec<String> {
        let mut lines = std::mem::take(&mut self.news);
        lines.extend(self.tally.take_warnings(&self.folder.display().to_string()));
        lines
    }
}

fn read_picture(file: &Path) -> Result<(Size, crate::model::PixelFormat, Vec<u8>), SourceError> {
    let bytes = std::fs::read(file).map_err(|e| SourceError::of_file(file, &e))?;
    picture(bytes).map_err(|e| {
        SourceError::bad_format(
            file,
            format!("it is no readable picture ({e}); replace it, or take its line out of rgb.txt"),
        )
    })
}

/// A depth image from its file, or why it is none.
fn read_depth(file: &Path) -> Result<DepthImage, String> {
    let bytes = std::fs::read(file).map_err(|e| match e.kind() {
        ErrorKind::NotFound => "there is no such file".to_owned(),
        ErrorKind::IsADirectory => "it is a folder".to_owned(),
        ErrorKind::PermissionDenied => "reading it is not allowed".to_owned(),
        _ => format!("reading it fails ({e})"),
    })?;
    depth_of_png(&bytes)
}

/// A depth image from a PNG of 16 bits of grey, or why it is none.
pub(super) fn depth_of_png(bytes: &[u8]) -> Result<DepthImage, String> {
    let mut reader =
        image::ImageReader::with_format(std::io::Cursor::new(bytes), image::ImageFormat::Png);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE_PX);
    limits.max_image_height = Some(MAX_SIDE_PX);
    reader.limits(limits);
    let image = reader
        .decode()
        .map_err(|_| "it is no readable PNG".to_owned())?;
    match image {
        image::DynamicImage::ImageLuma16(image) => Ok(DepthImage::new(
            Size::new(image.width(), image.height()),
            image.into_raw(),
        )),
        image::DynamicImage::ImageLuma8(_) => {
            Err("it has 8 bits of grey, and depth is a PNG with 16 bits of grey".to_owned())
        }
        _ => Err("it is in colour, and depth is a PNG with 16 bits of grey".to_owned()),
    }
}

/// Reads a list of the folder; its times grow from line to line.
fn read_list(folder: &Path, name: &str) -> Result<Vec<Listed>, SourceError> {
    let path = folder.join(name);
    let meta = std::fs::metadata(&path).map_err(|e| SourceError::of_file(&path, &e))?;
    if meta.len() > LONGEST_LIST {
        return Err(SourceError::bad_format(
            &path,
            "it is too long for a list of images",
        ));
    }
    let text = std::fs::read_to_string(&path).map_err(|e| SourceError::of_file(&path, &e))?;
    parse_list(folder, &text).map_err(|what| SourceError::bad_format(&path, what))
}

fn parse_list(folder: &Path, text: &str) -> Result<Vec<Listed>, String> {
    let mut listed: Vec<Listed> = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let number = k + 1;
        let parts = line.split_once(char::is_whitespace);
        let read = parts.and_then(|(time, file)| Some((time.parse::<f64>().ok()?, file.trim())));
        let Some((time_s, file)) = read.filter(|(time_s, _)| time_s.is_finite()) else {
            return Err(format!("line {number} is not a time in seconds and a file"));
        };
        if listed.last().is_some_and(|before| time_s <= before.time_s) {
            return Err(format!(
                "line {number} is not later than the one before; sort the list by time"
            ));
        }
        listed.push(Listed {
            time_s,
            file: folder.join(file),
        });
    }
    Ok(listed)
}

/// For every frame the depth image that is nearest in time, if the frame is the nearest to that as well
/// and the two are no further apart than [`DEPTH_APART_S`].
fn paired(frames: &[Listed], depths: &[Listed]) -> Vec<Option<Listed>> {
    let mut out = Vec::with_capacity(frames.len());
    for (k, frame) in frames.iter().enumerate() {
        let depth = nearest(depths, frame.time_s);
        let is_pair = nearest(frames, depths[depth].time_s) == k
            && (depths[depth].time_s - frame.time_s).abs() <= DEPTH_APART_S;
        out.push(is_pair.then(|| depths[depth].clone()));
    }
    out
}

/// The place in a list that is not empty of what is nearest in time.
fn nearest(listed: &[Listed], time_s: f64) -> usize {
    let after = listed.partition_point(|l| l.time_s < time_s);
    let before = after.saturating_sub(1);
    match listed.get(after) {
        Some(next) if next.time_s - time_s < time_s - listed[before].time_s => after,
        Some(_) if after == 0 => 0,
        _ => before,
    }
}

/// Time between the two images of two lists that are nearest to each other, s.
fn least_apart_s(frames: &[Listed], depths: &[Listed]) -> f64 {
    let apart = frames
        .iter()
        .map(|frame| (depths[nearest(depths, frame.time_s)].time_s - frame.time_s).abs());
    apart.fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(times_s: &[f64]) -> Vec<Listed> {
        let mut out = Vec::new();
        for time_s in times_s {
            out.push(Listed {
                time_s: *time_s,
                file: PathBuf::from(format!("{time_s}")),
            });
        }
        out
    }

    #[test]
    fn images_belong_together_by_their_times_and_none_twice() {
        let frames = list(&[1.000, 1.033, 1.067, 1.100, 1.133]);
        let depths = list(&[0.995, 1.040, 1.048, 1.121, 1.300]);
        let pairs = paired(&frames, &depths);
        let names: Vec<Option<&str>> = pairs.iter().map(|p| p.as_ref()?.file.to_str()).collect();
        assert_eq!(
            names,
            [Some("0.995"), Some("1.04"), None, None, Some("1.121")]
        );
        assert!((least_apart_s(&frames, &depths) - 0.005).abs() < 1e-9);
        assert_eq!(paired(&frames, &list(&[9.0])), vec![None; 5]);
    }

    #[test]
    fn lists_have_notes_and_their_faults_are_named_by_line() {
        let folder = Path::new("film");
        let text = "# color images\n# timestamp filename\n1305031102.175304 rgb/1305031102.175304.png\n\
                    1305031102.211214  rgb/b c.png\r\n\n";
        let listed = parse_list(folder, text).expect("a list");
        assert_eq!(listed[1].file, folder.join("rgb/b c.png"));
        assert!((listed[1].time_s - 1305031102.211214).abs() < 1e-9);
        for (bad, line) in [("x\n", 1), ("1 a\n1 b\n", 2), ("\nnan a\n", 2), ("1\n", 1)] {
            let said = parse_list(folder, bad).expect_err(bad);
            assert!(said.contains(&format!("line {line} ")), "{said}");
        }
    }

    #[test]
    fn depth_is_sixteen_bits_of_grey() {
        let mut eight = Vec::new();
        image::GrayImage::new(4, 3)
            .write_to(
                &mut std::io::Cursor::new(&mut eight),
                image::ImageFormat::Png,
            )
            .expect("written");
        assert!(
            depth_of_png(&eight)
                .expect_err("8 bits")
                .contains("16 bits")
        );
        assert!(depth_of_png(b"no png").is_err());
        let mut sixteen = Vec::new();
        let counts = vec![0u16, 1, 5000, 65535];
        let image: image::ImageBuffer<image::Luma<u16>, _> =
            image::ImageBuffer::from_raw(2, 2, counts.clone()).expect("an image");
        image::DynamicImage::ImageLuma16(image)
            .write_to(
                &mut std::io::Cursor::new(&mut sixteen),
                image::ImageFormat::Png,
            )
            .expect("written");
        let read = depth_of_png(&sixteen).expect("depth");
        assert_eq!((read.size, read.counts), (Size::new(2, 2), counts));
    }
}
