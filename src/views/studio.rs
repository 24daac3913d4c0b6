//! Pictures and videos of a prepared tree.

use super::{PrepareError, PreparedTree};
use crate::document::DocumentError;
use crate::draw::{BoundingCylinder, Camera, Look, Model, Posed, Rgba, Texture, View, picture};
use crate::export::{ExportError, Film};
use crate::files::WriteError;
use crate::geometry::Mesh;
use crate::model::{LeafSwing, Pose, Size};
use crate::signal::reflection::there_and_back;
use std::f64::consts::TAU;
use std::io::Cursor;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Length of a video if none is given, s.
pub const VIDEO_S: f64 = 10.0;
/// Size of a picture where neither the user nor the film says one.
pub(super) const PLAIN: Size = Size {
    width: 640,
    height: 480,
};
/// Samples in a picture, at about seven bytes each.
const MOST_SAMPLES: usize = 40_000_000;
/// A pose stands for a moment that is no farther from it than this, s.
const NEAR_S: f64 = 1.0;

/// Where the filmed frame is put.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmPlace {
    Behind,
    Beside,
}

/// What a picture or video is to show.
#[derive(Clone, Debug)]
pub struct Shot {
    pub view: View,
    /// Once round the tree in a video, with its shadow.
    pub turntable: bool,
    /// The view is that of the film: beside its frame the tree has the film's size.
    pub as_filmed: bool,
    /// `None`: that of the film where its frame is shown, else 640x480.
    pub size: Option<Size>,
    /// sRGB and opacity.
    pub background: [u8; 4],
    pub film: Option<FilmPlace>,
    /// Draws no leaves.
    pub bare: bool,
    /// Moment of a picture, begin of a video, s. `None`: a picture is of the tree at rest, or as it
    /// was in the filmed frame where that is shown, and a video of the end of the poses.
    pub at_s: Option<f64>,
    /// The tree at rest, in a video too.
    pub at_rest: bool,
    /// Length of a video, s; `None`: that of the poses, at most [`VIDEO_S`].
    pub length_s: Option<f64>,
    /// Pictures a second of a video.
    pub fps: f64,
}

/// The tree before its camera.
pub struct Studio<'a> {
    shot: &'a Shot,
    tree: &'a PreparedTree,
    model: Model<'a>,
    size: Size,
    look: Look,
    /// Holds the tree in all its poses.
    bounds: BoundingCylinder,
}

impl<'a> Studio<'a> {
    /// # Errors
    /// There is nothing to be drawn of the tree, or it was not filmed and a moment of the film is
    /// wanted.
    pub fn new(tree: &'a PreparedTree, shot: &'a Shot) -> Result<Self, PrepareError> {
        let wood = tree
            .dressed
            .wood
            .first()
            .ok_or(PrepareError::NothingToDraw)?;
        if shot.at_s.is_some() && tree.poses.is_empty() {
            return Err(PrepareError::Document(DocumentError::NoFilm {
                dir: tree.document.dir.clone(),
                file: "motion.csv",
            }));
        }
        let model = model(tree, wood, shot.bare);
        let filmed = tree.document.picture.as_ref().map(|p| p.rgb.size);
        let of_film = filmed.filter(|_| shot.film.is_some());
        let size = shot.size.or(of_film).unwrap_or(PLAIN);
        Ok(Self {
            shot,
            tree,
            size,
            look: Look {
                samples: samples(size),
                shadow: shot.turntable,
                ..Look::default()
            },
            bounds: bounds(tree, &model),
            model,
        })
    }

    /// The bytes of a picture (PNG).
    ///
    /// # Errors
    /// There is no pose at the wanted moment.
    pub fn picture(&self) -> Result<Vec<u8>, PrepareError> {
        let posed = match self.shot.at_s {
            Some(at_s) => self.posed(Some(self.pose_at(at_s)?)),
            None if self.shot.film.is_some() && !self.shot.at_rest => {
                self.model.posed(self.tree.pose_in_picture.as_ref(), &[])
            }
            None => self.posed(None),
        };
        Ok(png(&self.draw(&posed, 0.0))?)
    }

    /// Writes a video (MP4) to `out`.
    ///
    /// # Errors
    /// There is no pose at the wanted moment, or no ffmpeg; the file exists or cannot be written;
    /// or it was stopped.
    pub fn video(&self, out: &Path, stop: &AtomicBool) -> Result<(), PrepareError> {
        let clip = self.clip()?;
        let frames = ((clip.length_s * self.shot.fps).round() as u64).max(1);
        write_video(out, self.shot.fps, frames, stop, |k| {
            let pose = clip.pose(&self.tree.poses, k as f64 / self.shot.fps);
            Ok(self.draw(&self.posed(pose), k as f64 / frames as f64))
        })
    }

    /// Which part of the poses a video shows.
    fn clip(&self) -> Result<Clip, PrepareError> {
        let poses = &self.tree.poses;
        let moving = poses.len() >= 2 && !self.shot.at_rest;
        let first_s = poses.first().map_or(0.0, |p| p.time_s);
        let last_s = poses.last().map_or(0.0, |p| p.time_s);
        let own_s = if moving {
            VIDEO_S.min(last_s - first_s)
        } else {
            VIDEO_S
        };
        let length_s = self.shot.length_s.unwrap_or(own_s);
        let from_s = match self.shot.at_s {
            Some(at_s) => poses[self.pose_at(at_s)?].time_s,
            None => (last_s - length_s).max(first_s),
        };
        Ok(Clip {
            moving,
            from_s,
            to_s: last_s,
            length_s,
        })
    }

    /// The tree before what is behind it, with the filmed frame where it was wanted; `share` of a
    /// video is over.
    fn draw(&self, posed: &Posed, share: f64) -> Rgba {
        let background = self.shot.background;
        let camera = self.camera(share);
        let mut below = Rgba::of_one(self.size, background);
        let frame = self.frame();
        if let (Some(FilmPlace::Behind), Some(frame)) = (self.shot.film, &frame) {
            below.put(frame);
        }
        below.put(&picture(posed, &camera, &self.look));
        match (self.shot.film, &frame) {
            (Some(FilmPlace::Beside), Some(frame)) => Rgba::beside(frame, &below, background),
            _ => below,
        }
    }

    fn camera(&self, share: f64) -> Camera {
        let mut view = self.shot.view;
        if self.shot.turntable {
            view.turn += TAU * share;
        } else if self.shot.as_filmed && self.shot.film.is_some() {
            return Camera::of_film(&self.tree.skeleton, self.size);
        }
        Camera::fitting(&self.bounds, view, self.shot.turntable, self.size)
    }

    /// The filmed frame, where it is shown.
    fn frame(&self) -> Option<Rgba> {
        self.shot.film?;
        let picture = self.tree.document.picture.as_ref()?;
        Rgba::of_frame(&picture.rgb, self.size, self.shot.background)
    }

    /// The tree in one of its poses, its leaves as they swing then; `None` for its rest.
    fn posed(&self, k: Option<usize>) -> Posed<'_> {
        let Some(k) = k else {
            return self.model.posed(None, &[]);
        };
        self.model
            .posed(self.tree.poses.get(k), &swing_at(self.tree, k))
    }

    /// Which pose is that of a moment of the film.
    fn pose_at(&self, at_s: f64) -> Result<usize, PrepareError> {
        let poses = &self.tree.poses;
        nearest(poses, at_s)
            .filter(|k| (poses[*k].time_s - at_s).abs() < NEAR_S)
            .ok_or_else(|| PrepareError::NoPose {
                at_s,
                last_s: poses.last().map_or(0.0, |p| p.time_s),
            })
    }
}

/// How the leaves of each group swing in a pose.
pub(super) fn swing_at(tree: &PreparedTree, pose: usize) -> Vec<LeafSwing> {
    let groups = tree.flutter.iter();
    let swing = groups.map(|all| all.get(pose).copied().unwrap_or_default());
    swing.collect()
}

/// The tree as it is drawn, with `wood`.
pub(super) fn model<'a>(tree: &'a PreparedTree, wood: &'a Mesh, bare: bool) -> Model<'a> {
    let mut model = Model::bare(&tree.skeleton, wood, tree.dressed.bark.rgb);
    model.bark = tree.dressed.bark.tile.as_deref().and_then(Texture::of);
    if !bare {
        model.foliage = &tree.dressed.foliage;
        let texture = model.foliage.texture.as_ref();
        model.leaf = texture.and_then(|(_, bytes)| Texture::read(bytes));
    }
    model
}

/// The part of the poses that a video shows.
struct Clip {
    /// Not at rest.
    moving: bool,
    /// Begin of the video and end of the poses, s.
    from_s: f64,
    to_s: f64,
    /// Of the video, s.
    length_s: f64,
}

impl Clip {
    /// The pose `since_s` after the begin; `None` for the rest. Where the film is over it goes
    /// back: no jump.
    fn pose(&self, poses: &[Pose], since_s: f64) -> Option<usize> {
        if !self.moving {
            return None;
        }
        nearest(
            poses,
            self.from_s + there_and_back(since_s, self.to_s - self.from_s),
        )
    }
}

/// Samples a pixel on a side: as many as fit into memory, at most 3.
pub(super) fn samples(size: Size) -> u32 {
    let mut samples = 3;
    while samples > 1 && size.area() * samples * samples > MOST_SAMPLES {
        samples -= 1;
    }
    samples as u32
}

/// The wood at rest, and as far around it as its joints go.
fn bounds(tree: &PreparedTree, model: &Model) -> BoundingCylinder {
    let empty = BoundingCylinder {
        low: nalgebra::Point3::origin(),
        high: nalgebra::Point3::origin(),
        radius: 0.0,
    };
    let rest = model.posed(None, &[]).bounds().unwrap_or(empty);
    let joints = tree.poses.iter().flat_map(|p| &p.joints);
    BoundingCylinder::of(joints.map(|j| j.position)).map_or(rest, |all| all.with(&rest))
}

/// Writes a video (MP4) of so many pictures to `out`; `draw` gives each by its number.
///
/// # Errors
/// A picture cannot be drawn, the video cannot be written, or `stop` ends it before.
pub(super) fn write_video(
    out: &Path,
    fps: f64,
    frames: u64,
    stop: &AtomicBool,
    draw: impl Fn(u64) -> Result<Rgba, PrepareError>,
) -> Result<(), PrepareError> {
    let mut film: Option<Film> = None;
    for k in 0..frames {
        if stop.load(Ordering::SeqCst) {
            return Err(WriteError::Stopped.into());
        }
        let drawn = draw(k)?;
        let film = match &mut film {
            Some(film) => film,
            None => film.insert(Film::begin(out, drawn.size, fps)?),
        };
        film.frame(&rgb(&drawn))?;
    }
    match film {
        Some(film) => Ok(film.finish()?),
        None => Ok(()),
    }
}

fn rgb(drawn: &Rgba) -> Vec<u8> {
    let pixels = drawn.pixels.chunks_exact(4);
    pixels.flat_map(|p| [p[0], p[1], p[2]]).collect()
}

pub(super) fn png(drawn: &Rgba) -> Result<Vec<u8>, ExportError> {
    let mut png = Cursor::new(Vec::new());
    image::write_buffer_with_format(
        &mut png,
        &drawn.pixels,
        drawn.size.width,
        drawn.size.height,
        image::ColorType::Rgba8,
        image::ImageFormat::Png,
    )
    .map_err(|e| ExportError::unfit(format!("the picture cannot be a PNG: {e}")))?;
    Ok(png.into_inner())
}

pub(super) fn nearest(poses: &[Pose], time_s: f64) -> Option<usize> {
    let after = poses.partition_point(|p| p.time_s < time_s);
    let around = after.saturating_sub(1)..poses.len().min(after + 1);
    around.min_by(|a, b| {
        let [a, b] = [a, b].map(|k| (poses[*k].time_s - time_s).abs());
        a.total_cmp(&b)
    })
}
