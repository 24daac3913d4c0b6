//! A capture folder read back: what `export` and all later commands begin with.

mod copies;
mod error;
mod film;
mod motion;
mod nodes;
mod table;

pub use error::CaptureError;

use crate::config::Config;
use crate::dynamics::Film;
use crate::export::capture::{Capture, ModelNote, PictureNote, SCHEMA_VERSION};
use crate::export::glb_notes;
use crate::model::{JointPose, Outline, Picture, Pose, Rgb, Size, Skeleton, Swaying};
use crate::motion::PoseEstimator;
use crate::outline;
use motion::Postures;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A picture wider or higher than this is not believed, px.
const LARGEST_SIDE: u32 = 16384;

/// The trunk's foot is not believed to be so many picture sizes away from the picture's corner.
const FARTHEST_FOOT: f64 = 4.0;

/// A capture that has been read.
#[derive(Clone, Debug)]
pub struct Captured {
    pub dir: PathBuf,
    /// `capture.json`.
    pub note: Capture,
    pub skeleton: Arc<Skeleton>,
    /// How the nodes sway, by node index.
    pub sway: Vec<Swaying>,
    /// Poses of the end of the film, by frame; at most as long as was asked for.
    pub poses: Vec<Pose>,
    /// The picture in the capture and the pose in it; `None` in captures of older versions.
    pub picture: Option<Picture>,
    pub pose_in_picture: Option<Pose>,
    pub outline: Option<Outline>,
    /// What the user should know: parts that are missing, and what stands in for them. One sentence
    /// each.
    pub warnings: Vec<String>,
}

impl Captured {
    /// Reads `capture.json` alone: the settings of a capture are needed before they can be changed.
    ///
    /// # Errors
    /// The folder is no capture, or was written by a newer version.
    pub fn note(dir: &Path) -> Result<Capture, CaptureError> {
        let file = dir.join("capture.json");
        let text = std::fs::read(&file).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => CaptureError::NotACapture {
                dir: dir.to_owned(),
            },
            _ => CaptureError::Unreadable {
                file: file.clone(),
                source,
            },
        })?;
        let bad = |what: String| CaptureError::BadNote {
            file: file.clone(),
            what,
        };
        let value: serde_json::Value =
            serde_json::from_slice(&text).map_err(|e| bad(e.to_string()))?;
        // Looked at first: a newer file would be refused for the wrong reason.
        let version = value
            .get("schema_version")
            .and_then(serde_json::Value::as_u64);
        if version.is_some_and(|v| v > SCHEMA_VERSION.into()) {
            let what = format!("schema_version {}", version.unwrap_or_default());
            return Err(CaptureError::Newer { file, what });
        }
        let note: Capture = serde_json::from_value(value).map_err(|e| {
            let what = e.to_string();
            if what.starts_with("unknown field") {
                return CaptureError::Newer {
                    file: file.clone(),
                    what,
                };
            }
            bad(what)
        })?;
        note.config.check().map_err(|e| bad(e.to_string()))?;
        let sizes = [note.source.width, note.source.height]
            .into_iter()
            .chain(note.outline.iter().flat_map(|o| [o.width, o.height]));
        if sizes
            .into_iter()
            .any(|side| side == 0 || side > LARGEST_SIDE)
        {
            return Err(bad("a picture of this size cannot be".into()));
        }
        if let Some(model) = &note.model
            && !(model.metres_per_px.is_finite()
                && model.metres_per_px >= 0.0
                && model.foot_px.iter().all(|x| x.is_finite()))
        {
            return Err(bad("metres_per_px or foot_px is no number".into()));
        }
        let sides = [note.source.width, note.source.height].map(f64::from);
        let far = |m: &ModelNote| {
            m.foot_px
                .iter()
                .zip(sides)
                .any(|(x, side)| x.abs() > FARTHEST_FOOT * side)
        };
        if note.model.as_ref().is_some_and(far) {
            return Err(bad("foot_px is far from the picture".into()));
        }
        Ok(note)
    }

    /// Reads the capture in `dir`, with the poses of the last `animation_s` seconds of it.
    ///
    /// # Errors
    /// The folder is no capture or holds no tree, or one of its tables is missing or damaged.
    pub fn read(dir: &Path, animation_s: f64) -> Result<Self, CaptureError> {
        let mut captured = Self::tree(dir)?;
        let estimator = PoseEstimator::new(captured.skeleton.clone(), &captured.note.config.motion);
        let pictured = captured.note.picture.as_ref().map(|p| p.frame);
        let postures = Postures::open(dir, &captured.skeleton, captured.metres_per_px())?;
        (captured.poses, captured.pose_in_picture) =
            motion::read(postures, &estimator, animation_s, pictured)?;
        Ok(captured)
    }

    /// The same without any pose: `motion.csv` need not be there.
    ///
    /// # Errors
    /// The folder is no capture or holds no tree, or `nodes.csv` is missing or damaged.
    pub fn tree(dir: &Path) -> Result<Self, CaptureError> {
        let note = Self::note(dir)?;
        let size = Size::new(note.source.width, note.source.height);
        let model = note.model.clone().ok_or_else(|| CaptureError::NoTree {
            dir: dir.to_owned(),
        })?;
        let (mut skeleton, sway) = nodes::read(dir, &model, size)?;
        if skeleton.nodes.is_empty() {
            return Err(CaptureError::NoTree {
                dir: dir.to_owned(),
            });
        }
        let mut warnings = Vec::new();
        // It repeats what the tables say but for these notes; without it they are left out.
        let joints = std::fs::read(dir.join("tree.glb"))
            .ok()
            .and_then(|bytes| glb_notes::joints(&bytes));
        warnings.extend(copies::mark(
            &mut skeleton,
            &model.copied,
            joints.as_deref(),
        ));
        let skeleton = Arc::new(skeleton);
        let picture = match note.picture.as_ref().map(|p| picture(dir, p, size)) {
            Some(Ok(picture)) => Some(picture),
            Some(Err(why)) => {
                warnings.push(format!("the picture of the capture is left out: {why}"));
                None
            }
            None => {
                warnings.push(
                    "the capture holds no picture: it is older, or the frame could not be decoded"
                        .into(),
                );
                None
            }
        };
        let outline = note.outline.as_ref().map(|o| {
            let corners: Vec<[f64; 2]> = o.polygon_px.iter().map(|p| p.map(f64::from)).collect();
            outline::from_polygon(&corners, Size::new(o.width, o.height))
        });
        let outline = outline.transpose().unwrap_or_else(|why| {
            warnings.push(format!("the outline of the capture is left out: {why}"));
            None
        });
        let (dir, poses, pose_in_picture) = (dir.to_owned(), Vec::new(), None);
        Ok(Self {
            dir,
            note,
            skeleton,
            sway,
            poses,
            picture,
            pose_in_picture,
            outline,
            warnings,
        })
    }

    /// Metres in a pixel; 0 where the capture knows none.
    pub fn metres_per_px(&self) -> f64 {
        self.note.model.as_ref().map_or(0.0, |m| m.metres_per_px)
    }

    /// The points of the last `window_s` seconds, which its sway is told from.
    ///
    /// # Errors
    /// `tracks.csv` is missing or damaged.
    pub fn tracked(&self, window_s: f64) -> Result<Film, CaptureError> {
        self.tracked_within(window_s, [f64::NEG_INFINITY, f64::INFINITY])
    }

    /// The same of the film between two times, s.
    ///
    /// # Errors
    /// `tracks.csv` is missing or damaged.
    pub fn tracked_within(&self, window_s: f64, within_s: [f64; 2]) -> Result<Film, CaptureError> {
        film::read(&self.dir, &self.skeleton, window_s, within_s)
    }

    /// All poses of the film in their order, read anew, one at a time: those of hours would fill
    /// the memory.
    ///
    /// # Errors
    /// `motion.csv` is missing or damaged; after an error the film is over.
    pub fn film(&self) -> Result<impl Iterator<Item = Result<Pose, CaptureError>>, CaptureError> {
        let mut postures = Postures::open(&self.dir, &self.skeleton, self.metres_per_px())?;
        let estimator = PoseEstimator::new(self.skeleton.clone(), &self.note.config.motion);
        let mut over = false;
        Ok(std::iter::from_fn(move || {
            let next = if over { Ok(None) } else { postures.next() };
            over |= next.is_err();
            next.map(|posture| posture.map(|p| p.pose(&estimator)))
                .transpose()
        }))
    }

    /// Poses of this tree, in the order in which the result is given them, as those of another tree
    /// whose measured nodes are the same, e.g. one of another shape: its nodes follow the same
    /// places in the picture.
    pub fn reposer<'a>(
        &'a self,
        skeleton: &Arc<Skeleton>,
        config: &Config,
    ) -> impl FnMut(&Pose) -> Pose + use<'a> {
        let mut estimator = PoseEstimator::new(skeleton.clone(), &config.motion);
        let measured = self.skeleton.measured().min(skeleton.measured());
        move |pose| {
            let place = |j: &JointPose| Some(self.skeleton.image_from_model(&j.position));
            let targets: Vec<Option<[f64; 2]>> =
                pose.joints[..measured].iter().map(place).collect();
            estimator.step(pose.frame, pose.time_s, &targets)
        }
    }

    /// `poses` by a [`reposer`](Self::reposer) of their own.
    pub fn reposed(&self, skeleton: &Arc<Skeleton>, config: &Config, poses: &[Pose]) -> Vec<Pose> {
        poses.iter().map(self.reposer(skeleton, config)).collect()
    }
}

/// The picture that the note speaks of.
fn picture(dir: &Path, note: &PictureNote, size: Size) -> Result<Picture, String> {
    // A name and no way: the file lies in the folder.
    let name = Path::new(&note.file).file_name().ok_or("it has no name")?;
    let rgb = image::open(dir.join(name))
        .map_err(|e| e.to_string())?
        .into_rgb8();
    let found = Size::new(rgb.width(), rgb.height());
    if found != size {
        return Err(format!("it is {found}, and the film is {size}"));
    }
    Ok(Picture {
        rgb: Arc::new(Rgb {
            size,
            pixels: rgb.into_raw(),
        }),
        frame: note.frame,
        time_s: note.time_s,
    })
}
