//! `capture.json`: what was filmed, when, with what, how well; written and read. No date of today,
//! so that a replay gives the same file.

use super::error::DocumentError;
use crate::config::{Config, STROKE_POINTS};
use crate::files::WriteError;
use crate::model::{
    CaptureFacts, FilmCut, Judgement, LocalTime, Origin, Outline, Skeleton, SwayFacts, Swaying,
    TagScale, Timing, TreeMode, UserNotes, Verdict,
};
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::Path;

const FILE: &str = "capture.json";

/// A picture wider or higher than this is not believed, px.
const LARGEST_SIDE: u32 = 16384;

/// The trunk's foot is not believed to be so many picture sizes away from the picture's corner.
const FARTHEST_FOOT: f64 = 4.0;

/// Grows when a reader of older files would misread a newer one.
pub const SCHEMA_VERSION: u32 = 1;

/// The whole of `capture.json`. Numbers that are not known are `null`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureNote {
    pub schema_version: u32,
    pub software: Software,
    /// When the first frame was filmed; `None` where the source does not know.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub captured_at: Option<LocalTime>,
    /// What the user noted.
    #[serde(default, skip_serializing_if = "UserNotes::is_empty")]
    pub notes: UserNotes,
    pub source: Source,
    pub timing: Timing,
    /// The whole effective configuration: defaults, file and command line together.
    pub config: Config,
    /// The region that was tracked, in the form of an outline file, so that it can be used again.
    pub outline: Option<OutlineNote>,
    /// `None` where nothing was tracked, or no frame could be decoded in colour.
    pub picture: Option<PictureNote>,
    /// What a printed tag beside the trunk says of the scale; `None` where none was seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tag: Option<TagScale>,
    /// What a depth camera has seen of the tree; `None` in a film without depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<DepthNote>,
    /// `None` where no trunk was seen: the bark's colour is a guess then.
    pub bark: Option<BarkNote>,
    /// `None` but for trees that were grown like one whose film shows its leaves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leaves: Option<LeavesNote>,
    /// `None` where no wood was seen.
    pub masks: Option<MasksNote>,
    /// `None` but for trees of point clouds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan: Option<ScanNote>,
    /// `None` but for trees that were found in a photograph without a stroke.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub found: Option<FoundNote>,
    /// `None` if the capture ended before the tree was built.
    pub build: Option<Build>,
    /// `None` if the tree is the one that was built first.
    pub refinement: Option<Refinement>,
    pub quality: Quality,
    /// What the capture is worth, why, and what to do; `None` in those of before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<Verdict>,
    /// What that rests on: with other answers on the sway it can be judged anew.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judged_by: Option<CaptureFacts>,
    pub model: Option<ModelNote>,
    pub animation: Option<AnimationNote>,
    /// What the user should know before trusting the result, one sentence each.
    pub warnings: Vec<String>,
}

/// How sure what was found in a photograph without a stroke is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundNote {
    /// That it is right, 0 to 1.
    pub chance: f64,
    /// By how many standard errors the trunk differs from what is beside it.
    pub trunk_deviations: f64,
    /// The share of the branches' length that runs level, as edges of buildings do.
    pub level_share: f64,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Software {
    pub name: String,
    pub version: String,
}

impl Default for Software {
    fn default() -> Self {
        Self {
            name: "arborcam".into(),
            version: env!("CARGO_PKG_VERSION").into(),
        }
    }
}

/// What a depth camera has seen of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DepthNote {
    /// Distance of the trunk's foot from the camera along its axis, m.
    pub foot_m: f64,
    /// Length of a pixel at that distance, m.
    pub metres_per_px: f64,
    /// Points whose depth at rest is known.
    pub points: u64,
    /// Measured nodes, and those of them whose place along the line of sight was seen; that of the
    /// others is a guess.
    pub nodes: u64,
    pub nodes_seen: u64,
}

/// What a point cloud showed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanNote {
    /// The tree's foot in the axes of the cloud, z up, m.
    pub foot_m: [f64; 3],
    pub points: u64,
    /// Of these the points of the ground, of noise, and of what does not hang together with the
    /// tree.
    pub ground_points: u64,
    pub noise_points: u64,
    pub apart_points: u64,
    /// Points of the file that were left out, as not all of their coordinates are numbers; not among `points`.
    #[serde(default)]
    pub not_finite_points: u64,
    /// Points of leaves, where they were taken off.
    #[serde(default)]
    pub leaf_points: u64,
    /// Side of the cells in which points were taken for one, m.
    pub cell_m: f64,
    /// Standard deviation of the points off thick wood, m; 0 where there is none.
    pub noise_m: f64,
    /// Radius of the last twigs, m.
    pub twig_radius_m: f64,
    /// Share of the tree's points that lie on the wood; `null` in those of before.
    #[serde(default)]
    pub on_wood: Option<f64>,
    /// How thick the foot is against the thickest wood; `null` where no round trunk was found there.
    #[serde(default)]
    pub foot_share: Option<f64>,
    /// Height of the lowest large branch above the foot, as a share of the tree's; `null` where there is
    /// none.
    #[serde(default)]
    pub clear_stem: Option<f64>,
    /// Of several trees how far below the feet its trunk comes together with that of another, as a share of the
    /// height; `null` where it does with none.
    #[serde(default)]
    pub fork_below: Option<f64>,
    /// The film that was laid on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub film: Option<ScanFilmNote>,
}

/// A piece of a filmed branch with a frequency, and the branches of the scan that were given it, by their names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LaidBranch {
    pub film: String,
    /// In the order of nodes; none where no branch was given it.
    pub scan: Vec<String>,
}

/// How a film lies on a point cloud.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanFilmNote {
    /// From the cloud's x axis to the right of the picture, about its z axis.
    pub turn_deg: f64,
    pub roll_deg: f64,
    pub px_per_metre: f64,
    /// Where the foot of the scan lies against that of the film, px, to the right and up.
    #[serde(default)]
    pub shift_px: [f64; 2],
    /// By how much places of the scan are off in the picture at most in 95 of 100 cases, root mean
    /// square over the tree, as a share of its height; `null` by pairs alone in older files.
    #[serde(default)]
    pub off_hi: Option<f64>,
    /// Of a film in wind: how far the tree leans to the right against the scan, and `off_hi` for the
    /// tree at rest. `roll_deg` is that of the leaning tree.
    #[serde(default)]
    pub lean_deg: Option<f64>,
    #[serde(default)]
    pub rest_off_hi: Option<f64>,
    /// What it misses lines or pairs of places by, as a share of the tree's height.
    pub miss: f64,
    /// The same from the best other side of the tree; `null` where it was found by pairs.
    pub other_side_miss: Option<f64>,
    /// Pieces of branches that carry a filmed frequency.
    pub branches: u64,
    /// Where each filmed branch with a frequency went.
    #[serde(default)]
    pub laid: Vec<LaidBranch>,
}

/// Where the frames came from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Source {
    pub name: String,
    /// E.g. `MJPG 1280x720 @ 30`.
    pub format_asked: String,
    pub format_given: String,
    /// Size of the picture, px.
    pub width: u32,
    pub height: u32,
}

impl Source {
    /// Its name without the folders that it lay in.
    pub fn short_name(&self) -> &str {
        let mut parts = self.name.rsplit(['/', '\\']);
        parts.find(|part| !part.is_empty()).unwrap_or_default()
    }
}

/// An outline file: `{"frame": 0, "width": W, "height": H, "polygon_px": [[u, v], ...]}`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutlineNote {
    /// First frame that was tracked with it.
    pub frame: u64,
    pub width: u32,
    pub height: u32,
    pub polygon_px: Vec<[i32; 2]>,
    /// The same where the tree rests: in the first picture it may have been pulled aside. Empty
    /// without a tree.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rest_polygon_px: Vec<[i32; 2]>,
}

impl OutlineNote {
    /// Of an outline that was tracked from `frame` on, and of the same where the tree rests.
    pub fn of(frame: u64, outline: &Outline, at_rest: Option<&Outline>) -> Self {
        Self {
            frame,
            width: outline.size.width,
            height: outline.size.height,
            polygon_px: corners_px(outline),
            rest_polygon_px: at_rest.map_or(Vec::new(), corners_px),
        }
    }
}

fn corners_px(outline: &Outline) -> Vec<[i32; 2]> {
    outline.polygon_px.iter().map(|p| (*p).into()).collect()
}

/// The picture in the folder: the first frame that was tracked, whole.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureNote {
    pub file: String,
    pub frame: u64,
    pub time_s: f64,
}

/// The colours of the leaves of the tree that this one was grown like.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeavesNote {
    /// As the film shows them (sRGB), the darkest first.
    pub rgb: Vec<[u8; 3]>,
}

/// The bark of the filmed trunk as a tile in the folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BarkNote {
    pub file: String,
}

/// The masks of wood and leaves in the folder, and the picture of the tree at rest on which they
/// lie.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MasksNote {
    pub wood: String,
    pub leaves: String,
    /// Empty in captures of before there was one.
    #[serde(default)]
    pub rest: String,
}

/// When and on what the tree was first built.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Build {
    pub frame: u64,
    pub time_s: f64,
    /// The accumulation measure at that time, 0 to 1.
    pub accumulation: f64,
    pub moving_points: u32,
    /// Built by order of the user or by the end of the source, not because enough had been seen.
    pub forced: bool,
}

/// How the tree was built anew as more was seen: what the tree in the files was built on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Refinement {
    /// How often, and when last.
    pub count: u32,
    pub frame: u64,
    pub time_s: f64,
    /// The accumulation measure at that time, 0 to 1.
    pub accumulation: f64,
    pub moving_points: u32,
    /// First frame in which the screen and the stream showed this tree; the tables have it in all
    /// frames.
    pub shown_from: u64,
    /// Measured nodes that were in the tree before, and kept their numbers.
    pub nodes_kept: u32,
}

/// How well the points were followed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    pub tracks_total: u64,
    /// Candidates that turned out not to be points that can be followed; they are not in the
    /// tables.
    pub tracks_rejected: u64,
    /// Points that the film shows to be off their places; they are in a table of their own.
    #[serde(default)]
    pub tracks_left_out: u64,
    pub tracks_alive_end: u64,
    /// Distance by which tracking forward and back misses the start, px.
    pub median_fb_error_px: Option<f64>,
    /// How far a point is expected to be from the one that it was when it was found, by its
    /// likeness to that and by what its neighbours say, px: the median over the frames of the
    /// median over the points.
    pub median_error_px: Option<f64>,
    pub lost_per_s: Option<f64>,
    /// How much the camera trembled where the tree is, px (root mean square), and at what
    /// frequency most, Hz. It is taken off the tree's motion.
    #[serde(default)]
    pub camera_shake_px: Option<f64>,
    #[serde(default)]
    pub camera_shake_hz: Option<f64>,
    /// Shares of the frames in which what stands still around the tree showed the camera's motion,
    /// of those in which the foot of the trunk did in its place, and of those in which the
    /// background was lost, as the camera was turned, zoomed or covered, 0 to 1.
    #[serde(default)]
    pub camera_seen_share: Option<f64>,
    #[serde(default)]
    pub camera_by_foot_share: Option<f64>,
    #[serde(default)]
    pub camera_lost_share: Option<f64>,
    /// How sure the forks of the tree are, 0 to 1: the median over the forks.
    pub median_certainty: Option<f64>,
    /// Median distance between where the points put a node in the picture and where the 3D pose
    /// does, px.
    pub median_reprojection_px: Option<f64>,
}

/// The tree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelNote {
    pub nodes: u32,
    /// Those of them that repeat a measured node on another plane.
    pub copies: u32,
    pub axes: String,
    /// `px` or `m`.
    pub unit: String,
    /// 0 where the model is in pixels.
    pub metres_per_px: f64,
    /// The trunk's foot in the picture, px: the origin of the model.
    pub foot_px: [f64; 2],
    /// The film shows its wood, and no leaves on it.
    #[serde(default)]
    pub bare: bool,
    /// What the push out of the picture's plane has achieved, where the tree was pushed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub push: Option<crate::shape::PushFigures>,
}

impl ModelNote {
    /// The note for a skeleton that is written with this scale (0: pixels).
    pub fn of(skeleton: &crate::model::Skeleton, metres_per_px: f64) -> Self {
        let nodes = skeleton.nodes.len();
        Self {
            nodes: nodes as u32,
            copies: (nodes - skeleton.measured()) as u32,
            axes: "x right, y up, z towards the viewer, right-handed; origin at the trunk's foot"
                .into(),
            unit: if metres_per_px > 0.0 { "m" } else { "px" }.into(),
            metres_per_px,
            foot_px: skeleton.foot_px.into(),
            bare: false,
            push: None,
        }
    }
}

/// The animation in `tree.glb`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnimationNote {
    /// Frame that stands at time 0 of the animation.
    pub first_frame: u64,
    pub frames: u64,
    /// Rotation keys that were left after thinning, and how many there were before: a key a joint
    /// that moves and frame.
    pub keys: u64,
    pub raw_keys: u64,
}

/// The text of `capture.json`.
///
/// # Errors
/// None in practice: every field has a JSON form.
pub fn json(note: &CaptureNote) -> Result<Vec<u8>, WriteError> {
    let mut text = serde_json::to_vec_pretty(note).map_err(|e| WriteError::no_form(FILE, e))?;
    text.push(b'\n');
    Ok(text)
}

/// Reads `capture.json` in `dir`.
///
/// # Errors
/// The folder is no document, was written by a newer version, or the file is damaged.
pub(super) fn read(dir: &Path) -> Result<CaptureNote, DocumentError> {
    let file = dir.join(FILE);
    match std::fs::read(&file) {
        Ok(text) => parse(&file, &text),
        Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            Err(DocumentError::no_document(dir, FILE))
        }
        Err(source) => Err(DocumentError::Unreadable { file, source }),
    }
}

/// The note that a text holds; messages call it `file`.
///
/// # Errors
/// It was written by a newer version, or is damaged.
pub(super) fn parse(file: &Path, text: &[u8]) -> Result<CaptureNote, DocumentError> {
    let value: serde_json::Value =
        serde_json::from_slice(text).map_err(|e| DocumentError::note(file, e.to_string()))?;
    // Looked at first: a newer file would be refused for the wrong reason.
    let version = value
        .get("schema_version")
        .and_then(serde_json::Value::as_u64);
    if let Some(version) = version.filter(|v| *v > SCHEMA_VERSION.into()) {
        return Err(DocumentError::Newer {
            file: file.to_owned(),
            what: format!("schema_version {version}"),
        });
    }
    let mut note: CaptureNote = serde_json::from_value(value).map_err(|e| unread(file, e))?;
    // They led to nothing, and former versions let them pass.
    let strokes_px = &mut note.config.skeleton.strokes_px;
    strokes_px.retain(|stroke| STROKE_POINTS.contains(&stroke.len()));
    note.check()
        .map_err(|what| DocumentError::note(file, what))?;
    Ok(note)
}

/// A setting that we do not know is one of a newer version.
fn unread(file: &Path, e: serde_json::Error) -> DocumentError {
    let what = e.to_string();
    if what.starts_with("unknown field") {
        return DocumentError::Newer {
            file: file.to_owned(),
            what,
        };
    }
    DocumentError::note(file, what)
}

impl CaptureNote {
    /// Whether the tree was filmed, and is seen to have no leaves.
    pub fn is_of_bare(&self) -> bool {
        self.model.as_ref().is_some_and(|model| model.bare)
    }

    /// Of a tree that was not filmed.
    pub fn not_filmed(
        source: Source,
        outline: Option<OutlineNote>,
        model: ModelNote,
        config: Config,
    ) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            software: Software::default(),
            captured_at: None,
            notes: UserNotes::default(),
            source,
            timing: Timing::default(),
            config,
            outline,
            picture: None,
            bark: None,
            tag: None,
            depth: None,
            leaves: None,
            masks: None,
            scan: None,
            found: None,
            build: None,
            refinement: None,
            quality: Quality::default(),
            verdict: None,
            judged_by: None,
            model: Some(model),
            animation: None,
            warnings: Vec::new(),
        }
    }

    /// Colours for leaves that no picture shows (sRGB); may be none.
    pub fn leaf_rgb(&self) -> &[[u8; 3]] {
        self.leaves.as_ref().map_or(&[], |leaves| &leaves.rgb)
    }

    /// What the capture is worth by other answers on its sway, by node index, and other modes, in a film
    /// that was found to be `cut`; `None` where it is not known what it was judged by.
    pub fn judgement_with(
        &self,
        skeleton: &Skeleton,
        sway: &[Swaying],
        modes: &[TreeMode],
        cut: Option<FilmCut>,
    ) -> Option<Judgement> {
        let facts = self.judged_by.clone()?;
        let facts = CaptureFacts {
            sway: SwayFacts::of(skeleton, sway, modes.iter().map(Into::into)),
            ..facts
        };
        Some(Judgement::of(facts.with_cut(cut)))
    }

    /// Takes what the capture was found to be worth.
    pub fn take_judgement(&mut self, judgement: Judgement) {
        self.verdict = Some(judgement.verdict);
        self.judged_by = Some(judgement.facts);
    }

    /// When the film was made, and what the user noted on it.
    pub fn origin(&self) -> Origin {
        Origin {
            captured_at: self.captured_at,
            notes: self.notes.clone(),
        }
    }

    /// What is wrong with its numbers.
    fn check(&self) -> Result<(), String> {
        self.config.check().map_err(|e| e.to_string())?;
        let outline = self.outline.iter().flat_map(|o| [o.width, o.height]);
        for side in outline.chain([self.source.width, self.source.height]) {
            if side == 0 || side > LARGEST_SIDE {
                return Err("a picture of this size cannot be".into());
            }
        }
        match &self.model {
            Some(model) => model.check(&self.source),
            None => Ok(()),
        }
    }
}

impl ModelNote {
    fn check(&self, source: &Source) -> Result<(), String> {
        let scale = self.metres_per_px;
        if !(scale.is_finite() && scale >= 0.0 && self.foot_px.iter().all(|x| x.is_finite())) {
            return Err("metres_per_px or foot_px is no number".into());
        }
        let [u_px, v_px] = self.foot_px.map(f64::abs);
        if u_px > FARTHEST_FOOT * f64::from(source.width)
            || v_px > FARTHEST_FOOT * f64::from(source.height)
        {
            return Err("foot_px is far from the picture".into());
        }
        Ok(())
    }
}
