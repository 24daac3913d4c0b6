//! The picture that `arborcam photo` works on: a file, or one frame of a film or a camera.

use crate::cli::command_error::CommandError;
use crate::config::{self, Config};
use crate::files::{is_named_film, read_bounded};
use crate::model::{Picture, Size};
use crate::runtime::{self, FrameError, one_frame};
use crate::source::{Photograph, image_format};
use anyhow::anyhow;
use clap::Args;
use std::fs::File;
use std::io::Read;
use std::path::PathBuf;
use std::sync::Arc;

/// Largest photograph that is read, bytes.
const LARGEST: u64 = 256_000_000;
/// Bytes by which the format of a picture is known, at most.
const LONGEST_BEGIN: u64 = 32;
/// The frame of a camera that is taken where none is named: by then its exposure has settled.
const SETTLED_FRAME: u64 = 15;

#[derive(Debug, Args)]
pub struct PictureArgs {
    /// The photograph (.png, .jpg, .bmp). Or a film, of which one frame is taken: a camera, a
    /// recording, a video file or a folder of pictures, as `replay` and `record` take them.
    picture: PathBuf,
    /// Take this frame of a film or a camera, counted from 0. By default the first one of a film, and
    /// the 15th of a camera, when its exposure has settled.
    #[arg(long, value_name = "N")]
    frame: Option<u64>,
}

/// A picture as it is worked on.
#[derive(Clone, Debug)]
pub struct ShownPicture {
    /// Of the file, for messages and notes.
    pub name: String,
    pub picture: Picture,
    /// As it is seen, before it was reduced.
    pub full_size: Size,
    /// What of the file is damaged, of which the rest is used.
    damage: Option<String>,
}

impl ShownPicture {
    /// What is doubtful of the picture itself.
    pub fn warning(&self) -> Option<String> {
        let what = self.damage.as_ref()?;
        Some(format!(
            "the JPEG is damaged ({what}), and a part of the picture is wrong: look whether the tree is in it, or copy \
             or export it anew"
        ))
    }

    /// By what places in the whole picture are to be multiplied.
    pub fn scale(&self) -> f64 {
        f64::from(self.picture.rgb.size.width) / f64::from(self.full_size.width)
    }
}

impl PictureArgs {
    /// Reads the picture. What is no file, has the name of a film, and all of which a frame is named is a
    /// film.
    ///
    /// # Errors
    /// There is none, or it is damaged, too large or too small, or the film has no such frame.
    pub fn read(&self, camera: &config::Camera) -> Result<ShownPicture, CommandError> {
        let is_there = self.picture.exists();
        let is_film = is_there && (!self.picture.is_file() || is_named_film(&self.picture));
        match is_film || self.frame.is_some() {
            true if self.is_single_picture() => Err(CommandError::BadUsage(anyhow!(
                "--frame is for a film, and {} is a single picture; leave --frame out",
                self.picture.display()
            ))),
            true => self.read_frame(camera),
            false => self.read_file(),
        }
    }

    /// Whether it is a file that begins as a picture does.
    fn is_single_picture(&self) -> bool {
        let mut begin = Vec::new();
        let file = File::open(&self.picture);
        let read = file.and_then(|file| file.take(LONGEST_BEGIN).read_to_end(&mut begin));
        self.picture.is_file() && read.is_ok() && image_format(&begin).is_some()
    }

    fn shown(&self, photo: Photograph, frame: u64, time_s: f64) -> ShownPicture {
        let name = self.picture.file_name().unwrap_or_default();
        ShownPicture {
            name: name.to_string_lossy().into_owned(),
            picture: Picture {
                rgb: Arc::new(photo.picture),
                frame,
                time_s,
            },
            full_size: photo.full_size,
            damage: photo.damage,
        }
    }

    fn read_file(&self) -> Result<ShownPicture, CommandError> {
        let shown = self.picture.display();
        let bytes = read_bounded(&self.picture, LARGEST).map_err(|e| {
            CommandError::NoInput(anyhow!("cannot read {shown}: {e}; give another"))
        })?;
        let photo = Photograph::read(&bytes);
        let photo = photo.map_err(|e| CommandError::Failed(anyhow!("{shown}: {e}")))?;
        Ok(self.shown(photo, 0, 0.0))
    }

    fn read_frame(&self, camera: &config::Camera) -> Result<ShownPicture, CommandError> {
        let shown = self.picture.display();
        let config = Config {
            camera: camera.clone(),
            ..Config::default()
        };
        let source = runtime::open(&self.picture, &config, None).map_err(CommandError::no_input)?;
        let usual = match source.describe().live {
            true => SETTLED_FRAME,
            false => 0,
        };
        let number = self.frame.unwrap_or(usual);
        let frame = one_frame(source, number, camera).map_err(|e| match e {
            FrameError::Source(e) => CommandError::no_input(e),
            FrameError::TooShort { .. } => CommandError::BadUsage(anyhow!("{shown}: {e}")),
            e => CommandError::Failed(anyhow!("{shown}: {e}")),
        })?;
        let photo = Photograph::of_frame(Arc::unwrap_or_clone(frame.rgb));
        let photo = photo.map_err(|e| CommandError::Failed(anyhow!("{shown}: {e}")))?;
        Ok(self.shown(photo, frame.frame, frame.time_s))
    }
}
