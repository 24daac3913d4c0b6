//! A folder of consecutive pictures, in the order of their names.

use super::error::SourceError;
use super::interface::{Source, SourceInfo};
use crate::model::{FormatNote, PixelFormat, RawFrame, Size, nanoseconds, seconds};
use std::cmp::Ordering;
use std::path::{Path, PathBuf};

/// What a capture has in its folder, beside pictures that are no film.
const OF_A_CAPTURE: [&str; 2] = ["capture.json", "nodes.csv"];

/// Beside a video fewer pictures than this are no film.
const FEW_PICTURES: usize = 10;
const PICTURES: [&str; 4] = ["png", "jpg", "jpeg", "bmp"];
const VIDEOS: [&str; 6] = ["mkv", "mp4", "mov", "avi", "mcap", "bag"];

/// Pictures that follow each other at a fixed rate.
pub(super) struct Images {
    folder: PathBuf,
    files: Vec<PathBuf>,
    next: usize,
    size: Size,
    rate_hz: f64,
}

impl Images {
    pub(super) fn open(folder: &Path, rate_hz: f64) -> Result<Self, SourceError> {
        let input = folder.display().to_string();
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            let what = format!(
                "{rate_hz} pictures a second is no rate; give one greater than 0 with --fps"
            );
            return Err(SourceError::BadFormat { input, what });
        }
        if OF_A_CAPTURE.iter().all(|name| folder.join(name).is_file()) {
            return Err(SourceError::bad_format(
                folder,
                "it is a capture and not a film; `arborcam analyze` shows its sway, `arborcam animate` its motion",
            ));
        }
        let entries = std::fs::read_dir(folder).map_err(|e| SourceError::of_file(folder, &e))?;
        let (mut files, mut videos) = (Vec::new(), Vec::new());
        for entry in entries {
            let path = entry.map_err(|e| SourceError::of_file(folder, &e))?.path();
            if is_picture(&path) {
                files.push(path);
            } else if is_video(&path) {
                videos.push(path);
            }
        }
        if let Some(video) = videos.iter().min().filter(|_| files.len() < FEW_PICTURES) {
            let name = video.file_name().unwrap_or_default().to_string_lossy();
            let what = format!(
                "{name} is in it, and few pictures: give that file, or take it out of the folder for a film of the \
                 pictures"
            );
            return Err(SourceError::bad_format(folder, what));
        }
        files.sort_by(|a, b| by_name(&a.to_string_lossy(), &b.to_string_lossy()));
        let Some(first) = files.first() else {
            return Err(SourceError::Empty {
                input,
                what: "there is no .png, .jpg, .jpeg or .bmp picture in the folder",
            });
        };
        let size = read(first, 0, 0.0)?.size;
        if files.len() == 1 {
            return Err(SourceError::SingleFrame { input });
        }
        Ok(Self {
            folder: folder.to_owned(),
            files,
            next: 0,
            size,
            rate_hz,
        })
    }
}

impl Source for Images {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        let Some(path) = self.files.get(self.next) else {
            return Ok(None);
        };
        let frame = read(
            path,
            self.next as u64,
            seconds(nanoseconds(self.next as f64 / self.rate_hz)),
        )?;
        if frame.size != self.size {
            let (is, was) = (frame.size, self.size);
            let what =
                format!("the picture is {is}, those before it are {was}; make all of one size");
            return Err(SourceError::BadFormat {
                input: path.display().to_string(),
                what,
            });
        }
        self.next += 1;
        Ok(Some(frame))
    }

    fn describe(&self) -> SourceInfo {
        let kind = self
            .files
            .first()
            .and_then(|f| f.extension())
            .map(|e| e.to_string_lossy().to_lowercase());
        SourceInfo {
            name: self.folder.display().to_string(),
            format: FormatNote {
                asked: format!("pictures @ {}", self.rate_hz),
                given: format!(
                    "{} {} @ {}",
                    kind.unwrap_or_default(),
                    self.size,
                    self.rate_hz
                ),
            },
            size: self.size,
            nominal_rate_hz: Some(self.rate_hz),
            frames_total: Some(self.files.len() as u64),
            live: false,
            depth: None,
        }
    }
}

fn is_picture(path: &Path) -> bool {
    is_file_of(path, &PICTURES)
}

fn is_video(path: &Path) -> bool {
    is_file_of(path, &VIDEOS)
}

/// Whether it is a file with one of these endings, and not hidden.
fn is_file_of(path: &Path, endings: &[&str]) -> bool {
    let hidden = path
        .file_name()
        .is_none_or(|n| n.to_string_lossy().starts_with('.'));
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    !hidden && ending.is_some_and(|e| endings.contains(&e.as_str())) && path.is_file()
}

/// Reads one picture; a JPEG stays one and is decoded where those of a camera are.
fn read(path: &Path, sequence: u64, sensor_time_s: f64) -> Result<RawFrame, SourceError> {
    let bytes = std::fs::read(path).map_err(|e| SourceError::of_file(path, &e))?;
    let (size, format, bytes) = picture(bytes).map_err(|e| SourceError::BadFormat {
        input: path.display().to_string(),
        what: format!("it is no readable picture ({e}); replace it, or take it out of the folder"),
    })?;
    Ok(RawFrame {
        sequence: Some(sequence),
        sensor_time_s,
        size,
        format,
        bytes,
        depth: None,
    })
}

/// The picture in the bytes of a picture file, or why it is none.
pub(super) fn picture(bytes: Vec<u8>) -> Result<(Size, PixelFormat, Vec<u8>), String> {
    // By its content: the ending is only a promise.
    let kind = image::guess_format(&bytes).map_err(|e| e.to_string())?;
    if kind == image::ImageFormat::Jpeg {
        let header = turbojpeg::read_header(&bytes).map_err(|e| e.to_string())?;
        let size = Size::new(header.width as u32, header.height as u32);
        return Ok((size, PixelFormat::Mjpeg, bytes));
    }
    let picture = image::load_from_memory_with_format(&bytes, kind).map_err(|e| e.to_string())?;
    let size = Size::new(picture.width(), picture.height());
    let (format, bytes) = if picture.color().has_color() {
        (PixelFormat::Rgb24, picture.into_rgb8().into_raw())
    } else {
        (PixelFormat::Grey, picture.into_luma8().into_raw())
    };
    Ok((size, format, bytes))
}

/// Order of names in which `frame9` stands before `frame10`.
fn by_name(a: &str, b: &str) -> Ordering {
    let (mut x, mut y) = (a, b);
    while let (Some(p), Some(q)) = (x.chars().next(), y.chars().next()) {
        let order = if p.is_ascii_digit() && q.is_ascii_digit() {
            let (m, n) = (take_number(&mut x), take_number(&mut y));
            // Without leading zeros the longer number is the greater one, however many digits it
            // has.
            m.len().cmp(&n.len()).then_with(|| m.cmp(n))
        } else {
            x = &x[p.len_utf8()..];
            y = &y[q.len_utf8()..];
            p.cmp(&q)
        };
        if order.is_ne() {
            return order;
        }
    }
    x.len().cmp(&y.len()).then_with(|| a.cmp(b))
}

/// Cuts the digits off the front and gives them without leading zeros.
fn take_number<'a>(text: &mut &'a str) -> &'a str {
    let end = text
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    *text = rest;
    digits.trim_start_matches('0')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_video_beside_few_pictures_is_named() {
        let dir = tempfile::tempdir().expect("tempdir");
        for name in ["wood.png", "leaves.png", "video.mkv"] {
            std::fs::write(dir.path().join(name), "").expect("write");
        }
        let refused = Images::open(dir.path(), 30.0).err().expect("no film");
        let said = refused.to_string();
        assert!(said.contains("video.mkv is in it"), "{said}");
    }

    #[test]
    fn a_capture_is_no_film() {
        let dir = tempfile::tempdir().expect("tempdir");
        for name in ["capture.json", "nodes.csv", "bark.png", "leaves.png"] {
            std::fs::write(dir.path().join(name), "").expect("write");
        }
        let refused = Images::open(dir.path(), 30.0).err().expect("no film");
        assert!(refused.to_string().contains("is a capture"), "{refused}");
    }

    #[test]
    fn names_are_ordered_by_their_numbers() {
        let mut names = [
            "f10.png",
            "f9.png",
            "f009b.png",
            "f1.png",
            "f2-2.png",
            "f2-10.png",
            "F1.png",
            "f.png",
            "f01.png",
        ];
        names.sort_by(|a, b| by_name(a, b));
        let wanted = [
            "F1.png",
            "f.png",
            "f01.png",
            "f1.png",
            "f2-2.png",
            "f2-10.png",
            "f9.png",
            "f009b.png",
            "f10.png",
        ];
        assert_eq!(names, wanted);
    }
}
