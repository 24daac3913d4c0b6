//! A document: one tree with all that is known of it, as a folder of open files. This module reads
//! and writes it; everything that is made from it is a view (see `export`).
//!
//! `capture.json` says what was filmed and how, `nodes.csv` holds the whole model, `frame.jpg` one
//! picture of it, `bark.png` its bark, `rest.png` the tree at rest, `wood.png` and `leaves.png` which
//! of its pixels are wood and leaves. A tree that was filmed has `tracks.csv` and `left_out.csv`, the
//! points, `motion.csv`, the poses, `camera.csv`, how the camera itself moved, and `modes.csv`, the
//! modes of the whole tree. A forest is a folder with the documents of its templates (`forest`).

mod asked;
mod at_rest;
mod bark;
mod camera;
mod error;
mod forest;
mod marked;
mod marker_depths;
mod marker_parents;
mod modes;
mod motion;
mod nodes;
pub mod note;
mod number;
mod picture;
mod png;
mod sway;
mod table;
mod tracks;
mod wood;

pub use asked::{ASKED_FILE, asked_csv, read_asked};
pub use at_rest::{LEAVES_MASK_FILE, REST_FILE, WOOD_MASK_FILE, at_rest_files};
pub use bark::BARK_FILE;
pub use camera::{CAMERA_FILE, CAMERA_HEADER, CameraCsv};
pub use error::DocumentError;
pub use forest::{
    FOREST_FILE, FOREST_TREES_FILE, ForestDocument, ForestFileBytes, ForestNote, ForestOrigin,
    GROUND_FILE, GroundNote, MOST_GROUND_SAMPLES,
};
pub use marked::{MarkedTree, SeldomSeen, StillMarker};
pub use modes::{MODES_FILE, modes};
pub use motion::{FILE as MOTION_FILE, MOTION_HEADER, MotionCsv};
pub use nodes::{nodes, nodes_header};
pub use note::{CaptureNote, DepthNote, SCHEMA_VERSION};
pub use number::push as push_number;
pub use picture::{PICTURE_FILE, jpeg};
pub use png::{grey_png, png};
pub use table::{TableWriter, unit};
pub use tracks::{LEFT_OUT_FILE, TRACKS_FILE, TRACKS_HEADER, TracksCsv, film_as_read, tracks_of};
pub use wood::{WOOD_FILE, read_wood, wood_csv};

use crate::bounds::Bounds;
use crate::config::Config;
use crate::dynamics::Film;
use crate::model::{
    Luma, Outline, Picture, Pose, Rgb, Size, Skeleton, Swaying, TreeMode, Unidentified, Wood,
    WoodSeen,
};
use crate::motion::PoseEstimator;
use motion::PoseReader;
use nalgebra::Point2;
use nodes::NodesRead;
use note::{ModelNote, OutlineNote};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A document that has been read.
#[derive(Clone, Debug)]
pub struct Document {
    pub dir: PathBuf,
    /// `capture.json`.
    pub note: CaptureNote,
    pub skeleton: Arc<Skeleton>,
    /// How the nodes sway, by node index.
    pub sway: Vec<Swaying>,
    /// The modes of the whole tree, the slowest first; none where they were not read.
    pub modes: Vec<TreeMode>,
    /// Poses of the end of the film, by frame; at most as long as was asked for. None where the
    /// tree was not filmed.
    pub poses: Vec<Pose>,
    /// The picture in the folder and the pose in it.
    pub picture: Option<Picture>,
    pub pose_in_picture: Option<Pose>,
    pub outline: Option<Outline>,
    /// The outline where the tree rests, where that is known.
    pub outline_at_rest: Option<Outline>,
    /// The bark of the filmed trunk as a tile, see [`Wood::bark`].
    pub bark: Option<Arc<Rgb>>,
    /// Where the leaves are in the picture. On a tree that was photographed, not filmed, they stand as
    /// dense as this says.
    pub leaf_mask: Option<Arc<Luma>>,
    /// What the user should know: parts that are missing. One sentence each.
    pub warnings: Vec<String>,
}

impl Document {
    /// Reads `capture.json` alone: the settings of a document are needed before they can be
    /// changed.
    ///
    /// # Errors
    /// The folder is no document, or was written by a newer version.
    pub fn note(dir: &Path) -> Result<CaptureNote, DocumentError> {
        note::read(dir)
    }

    /// Reads the document in `dir`, with the poses of the last `animation_s` seconds of its film.
    ///
    /// # Errors
    /// The folder is no document or holds no tree, or one of its tables is missing or damaged.
    pub fn read(dir: &Path, animation_s: f64) -> Result<Self, DocumentError> {
        let mut document = Self::tree(dir)?;
        document.modes = document.modes_in_folder();
        if !document.has_motion() {
            let filmed = document.note.animation.is_some_and(|a| a.frames > 0);
            document.warnings.extend(
                filmed.then(|| format!("{} is not there: the tree is at rest", motion::FILE)),
            );
            return Ok(document);
        }
        let end = motion::read_end(
            PoseReader::open(dir, &document.skeleton, document.metres_per_px())?,
            &document.estimator(),
            animation_s,
            document.pictured(),
        )?;
        (document.poses, document.pose_in_picture) = (end.poses, end.pose_in_picture);
        Ok(document)
    }

    /// The same without poses and modes: an analysis finds them anew.
    ///
    /// # Errors
    /// The folder is no document or holds no tree, or `nodes.csv` is missing or damaged.
    pub fn tree(dir: &Path) -> Result<Self, DocumentError> {
        let note = Self::note(dir)?;
        let model = model(dir, &note)?;
        let nodes = nodes::read(dir, model, size(&note))?;
        let picture = note.picture.as_ref().map(|p| picture::bytes(dir, p));
        let mut document = Self::of_parts(dir, note, nodes, picture)?;
        document.bark = document.bark_in_folder();
        document.leaf_mask = document.leaf_mask_in_folder();
        Ok(document)
    }

    /// The document that would be read from a folder to which these were written; without poses
    /// and bark. `picture_jpg` is the file that the note speaks of.
    ///
    /// # Errors
    /// The tree cannot be read back, as it is empty or reaches too far.
    pub fn as_read(
        note: &CaptureNote,
        skeleton: &Skeleton,
        sway: &[Swaying],
        picture_jpg: Option<&[u8]>,
    ) -> Result<Self, DocumentError> {
        let dir = Path::new("");
        let note = note::parse(Path::new("capture.json"), &note::json(note)?)?;
        let model = model(dir, &note)?;
        let table = nodes::nodes(Vec::new(), skeleton, sway, model.metres_per_px)?;
        let nodes = nodes::read_from(&table, model, size(&note))?;
        let picture = picture_jpg.map(|bytes| Ok(bytes.to_vec()));
        Self::of_parts(dir, note, nodes, picture)
    }

    fn of_parts(
        dir: &Path,
        note: CaptureNote,
        nodes: NodesRead,
        picture_jpg: Option<Result<Vec<u8>, String>>,
    ) -> Result<Self, DocumentError> {
        if nodes.skeleton.nodes.is_empty() {
            return Err(DocumentError::NoTree {
                dir: dir.to_owned(),
            });
        }
        let mut document = Self {
            dir: dir.to_owned(),
            note,
            skeleton: Arc::new(nodes.skeleton),
            sway: nodes.sway,
            modes: Vec::new(),
            poses: Vec::new(),
            picture: None,
            pose_in_picture: None,
            outline: None,
            outline_at_rest: None,
            bark: None,
            leaf_mask: None,
            warnings: Vec::new(),
        };
        document.picture = document.picture_of(picture_jpg);
        document.outline = document.outline_of();
        document.outline_at_rest = document.at_rest_of();
        Ok(document)
    }

    fn picture_of(&mut self, bytes: Option<Result<Vec<u8>, String>>) -> Option<Picture> {
        let (Some(note), Some(bytes)) = (&self.note.picture, bytes) else {
            let filmed = self.note.timing.is_of_film();
            self.warnings.extend(filmed.then(|| {
                "the capture holds no picture: no frame could be decoded in colour".into()
            }));
            return None;
        };
        let size = size(&self.note);
        match bytes.and_then(|bytes| picture::decoded(&bytes, note, size)) {
            Ok(picture) => Some(picture),
            Err(why) => {
                self.warnings
                    .push(format!("the picture of the capture is left out: {why}"));
                None
            }
        }
    }

    fn modes_in_folder(&mut self) -> Vec<TreeMode> {
        match modes::read(&self.dir, &self.skeleton) {
            Ok(modes) => modes,
            Err(why) => {
                let warning = format!("the modes of the whole tree are left out: {why}");
                self.warnings.push(warning);
                Vec::new()
            }
        }
    }

    fn bark_in_folder(&mut self) -> Option<Arc<Rgb>> {
        self.note.bark.as_ref()?;
        match bark::read(&self.dir) {
            Ok(bark) => Some(Arc::new(bark)),
            Err(why) => {
                self.warnings
                    .push(format!("the bark of the capture is left out: {why}"));
                None
            }
        }
    }

    fn leaf_mask_in_folder(&mut self) -> Option<Arc<Luma>> {
        self.note.masks.as_ref()?;
        match at_rest::leaves(&self.dir, size(&self.note)) {
            Ok(mask) => Some(Arc::new(mask)),
            // Of a film the colours of its picture serve as well.
            Err(_) if self.note.timing.is_of_film() => None,
            Err(why) => {
                self.warnings
                    .push(format!("the mask of the leaves is left out: {why}"));
                None
            }
        }
    }

    /// A polygon that crosses itself, as a carried one may, is none.
    fn at_rest_of(&self) -> Option<Outline> {
        let noted = self.note.outline.as_ref()?;
        outline(noted, &noted.rest_polygon_px).ok()
    }

    fn outline_of(&mut self) -> Option<Outline> {
        let noted = self.note.outline.as_ref()?;
        match outline(noted, &noted.polygon_px) {
            Ok(outline) => Some(outline),
            Err(why) => {
                self.warnings
                    .push(format!("the outline of the capture is left out: {why}"));
                None
            }
        }
    }

    /// Metres in a pixel; 0 where the document knows none.
    pub fn metres_per_px(&self) -> f64 {
        self.note.model.as_ref().map_or(0.0, |m| m.metres_per_px)
    }

    /// Whether the motion of the tree is in the folder.
    pub fn has_motion(&self) -> bool {
        self.dir.join(motion::FILE).exists()
    }

    /// Whether the points that were followed are in the folder.
    pub fn has_tracks(&self) -> bool {
        self.dir.join(TRACKS_FILE).exists()
    }

    /// Whether how its branches sway was measured on this tree: in its own film, or in one that was laid on its
    /// scan. A grown tree has the sway of its example.
    pub fn has_measured_sway(&self) -> bool {
        let film_on_scan = self
            .note
            .scan
            .as_ref()
            .is_some_and(|scan| scan.film.is_some());
        (film_on_scan || self.has_tracks()) && self.sway.iter().any(Result::is_ok)
    }

    /// The frame of the picture.
    fn pictured(&self) -> Option<u64> {
        self.note.picture.as_ref().map(|p| p.frame)
    }

    fn estimator(&self) -> PoseEstimator {
        PoseEstimator::new(self.skeleton.clone(), &self.note.config.motion)
    }

    /// Takes the end of a film as reading it back would give it: of `poses`, in the order of time,
    /// those of the last `animation_s` seconds. There should be a second more, as times are
    /// rounded. A pose at no place that a table can hold is left out.
    pub fn take_poses(
        &mut self,
        poses: Vec<Pose>,
        pose_in_picture: Option<&Pose>,
        animation_s: f64,
    ) {
        let estimator = self.estimator();
        self.poses = Vec::with_capacity(poses.len());
        // One by one: those of a minute take tens of megabytes.
        for pose in poses {
            let read = motion::as_read(&pose, &self.skeleton, self.metres_per_px(), &estimator);
            self.poses.extend(read);
        }
        let oldest_s = self.poses.last().map_or(0.0, |p| p.time_s) - animation_s;
        self.poses.retain(|p| p.time_s >= oldest_s);
        self.pose_in_picture = pose_in_picture.and_then(|pose| {
            motion::as_read(pose, &self.skeleton, self.metres_per_px(), &estimator)
        });
    }

    /// Takes the answers of an analysis, by node index, as reading them back would give them. Nodes
    /// beyond them were not measured.
    pub fn take_sway(&mut self, sway: &[Swaying]) {
        for (i, own) in self.sway.iter_mut().enumerate() {
            let new = sway.get(i).unwrap_or(&Err(Unidentified::NotMeasured));
            let cells = sway::cells(new);
            let read = sway::read(std::array::from_fn(|c| cells[c].as_str()));
            *own = read.unwrap_or(Err(Unidentified::NotMeasured));
        }
    }

    /// Takes the modes of an analysis, as reading them back would give them.
    ///
    /// # Errors
    /// They cannot be read back.
    pub fn take_modes(&mut self, found: &[TreeMode]) -> Result<(), DocumentError> {
        let table = modes(Vec::new(), &self.skeleton, found)?;
        self.modes = modes::read_from(&table, &self.skeleton)?;
        Ok(())
    }

    /// The text of `modes.csv`; the same bytes as were read, where nothing was changed.
    ///
    /// # Errors
    /// None in practice: it is written to memory.
    pub fn modes_csv(&self) -> Result<Vec<u8>, DocumentError> {
        Ok(modes(Vec::new(), &self.skeleton, &self.modes)?)
    }

    /// The text of `nodes.csv`; the same bytes as were read, where nothing was changed.
    ///
    /// # Errors
    /// None in practice: it is written to memory.
    pub fn nodes_csv(&self) -> Result<Vec<u8>, DocumentError> {
        let metres_per_px = self.metres_per_px();
        Ok(nodes(
            Vec::new(),
            &self.skeleton,
            &self.sway,
            metres_per_px,
        )?)
    }

    /// The points of the film between two times, s; of them the last `window_s` seconds.
    ///
    /// # Errors
    /// `tracks.csv` is missing or damaged.
    pub fn tracked_within(&self, window_s: f64, within_s: Bounds) -> Result<Film, DocumentError> {
        if !self.has_tracks() {
            return Err(self.no_film(TRACKS_FILE));
        }
        tracks::read_film(&self.dir, &self.skeleton, window_s, within_s)
    }

    /// All poses of the film in their order, read anew, one at a time: those of hours would fill
    /// the memory.
    ///
    /// # Errors
    /// `motion.csv` is missing or damaged; after an error the film is over.
    pub fn film(
        &self,
    ) -> Result<impl Iterator<Item = Result<Pose, DocumentError>> + use<>, DocumentError> {
        if !self.has_motion() {
            return Err(self.no_film(motion::FILE));
        }
        let mut reader = PoseReader::open(&self.dir, &self.skeleton, self.metres_per_px())?;
        let estimator = self.estimator();
        let mut over = false;
        Ok(std::iter::from_fn(move || {
            let next = if over { Ok(None) } else { reader.next() };
            over |= next.is_err();
            next.map(|posture| posture.map(|p| p.pose(&estimator)))
                .transpose()
        }))
    }

    fn no_film(&self, file: &'static str) -> DocumentError {
        DocumentError::NoFilm {
            dir: self.dir.clone(),
            file,
        }
    }

    /// What poses this tree in the order of time as another one whose measured nodes are the same,
    /// e.g. one of another shape.
    pub fn reposer(&self, skeleton: &Arc<Skeleton>, config: &Config) -> Reposer {
        Reposer {
            from: self.skeleton.clone(),
            estimator: PoseEstimator::new(skeleton.clone(), &config.motion),
            measured: self.skeleton.measured().min(skeleton.measured()),
        }
    }

    /// `poses` by a [`reposer`](Self::reposer) of their own.
    pub fn reposed(&self, skeleton: &Arc<Skeleton>, config: &Config, poses: &[Pose]) -> Vec<Pose> {
        let mut reposer = self.reposer(skeleton, config);
        poses.iter().map(|pose| reposer.pose(pose)).collect()
    }
}

/// Poses of one tree as those of another one: its nodes follow the same places in the picture.
pub struct Reposer {
    from: Arc<Skeleton>,
    estimator: PoseEstimator,
    measured: usize,
}

impl Reposer {
    /// The pose of the other tree; poses must come in the order of time.
    pub fn pose(&mut self, pose: &Pose) -> Pose {
        let joints = &pose.joints[..self.measured];
        let targets_px: Vec<Option<Point2<f64>>> = joints
            .iter()
            .map(|joint| Some(self.from.image_from_model(&joint.position)))
            .collect();
        self.estimator.step(pose.frame, pose.time_s, &targets_px)
    }
}

/// What the folder of a document holds before there is a tree.
pub struct Begun {
    pub note: CaptureNote,
    pub picture: Option<Picture>,
    pub outline: Option<Outline>,
    pub wood: WoodSeen,
    /// After which frames the wood was to be looked for again.
    pub asked: BTreeSet<u64>,
}

impl Begun {
    /// Reads it from `dir`. What cannot be read beside `capture.json` is left out.
    ///
    /// # Errors
    /// There is no `capture.json`, it is damaged, or was written by a newer version.
    pub fn read(dir: &Path) -> Result<Self, DocumentError> {
        let note = Document::note(dir)?;
        let picture = note.picture.as_ref().and_then(|picture| {
            let bytes = picture::bytes(dir, picture).ok()?;
            picture::decoded(&bytes, picture, size(&note)).ok()
        });
        let noted = note.outline.as_ref();
        let mut wood = read_wood(dir).unwrap_or_default();
        if let Ok(bark) = bark::read(dir) {
            show_bark(&mut wood, &Arc::new(bark));
        }
        // They were kept of the newest wood alone.
        if let Some(mut newest) = wood.last_entry()
            && let Ok(at_rest) = at_rest::read(dir, size(&note))
        {
            let wood = Wood {
                at_rest: Some(Arc::new(at_rest)),
                ..Wood::clone(newest.get())
            };
            newest.insert(Arc::new(wood));
        }
        Ok(Self {
            picture,
            outline: noted.and_then(|noted| outline(noted, &noted.polygon_px).ok()),
            wood,
            asked: read_asked(dir).unwrap_or_default(),
            note,
        })
    }
}

/// The wood with its bark, which the table does not hold.
fn show_bark(seen: &mut WoodSeen, bark: &Arc<Rgb>) {
    for wood in seen.values_mut() {
        *wood = Arc::new(Wood {
            bark: Some(bark.clone()),
            ..Wood::clone(wood)
        });
    }
}

/// Size of the film's picture.
fn size(note: &CaptureNote) -> Size {
    Size::new(note.source.width, note.source.height)
}

/// What the note says of the tree.
fn model<'a>(dir: &Path, note: &'a CaptureNote) -> Result<&'a ModelNote, DocumentError> {
    note.model.as_ref().ok_or_else(|| DocumentError::NoTree {
        dir: dir.to_owned(),
    })
}

#[cfg(feature = "opencv")]
fn outline(note: &OutlineNote, polygon_px: &[[i32; 2]]) -> Result<Outline, String> {
    let corners = polygon_px.iter().map(|p| p.map(f64::from).into());
    let corners_px: Vec<Point2<f64>> = corners.collect();
    let size = Size::new(note.width, note.height);
    crate::outline::from_polygon(&corners_px, size).map_err(|e| e.to_string())
}

/// The mask of a polygon is filled by OpenCV.
#[cfg(not(feature = "opencv"))]
fn outline(_note: &OutlineNote, _polygon_px: &[[i32; 2]]) -> Result<Outline, String> {
    Err("this build has no OpenCV".into())
}
