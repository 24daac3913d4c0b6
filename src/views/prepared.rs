//! A document's tree as it is wanted: of another shape, cut, in leaf, moved otherwise.

use super::loops::looped_flutter;
use super::offspring::outline_of;
use super::{PrepareError, SwayFound};
use crate::config::Config;
use crate::document::note::Software;
use crate::document::{Document, DocumentError, Reposer};
use crate::export::gltf::{KEY_TOLERANCE_PX, Model, glb, provenance};
use crate::export::sway::joint_extras;
use crate::export::{ExportError, html};
use crate::geometry::{Dressed, Template};
use crate::model::{
    LeafSwing, Luma, ModeSummary, Outline, Pose, Skeleton, Swaying, TreeMode, Unidentified,
};
use crate::pipeline::{MOST_RESHAPED, Seen, cut_to, dress, flutter, reshape};
use crate::shape::{Cut, Drawn, Topiary};
use serde_json::{Value, json};
use std::sync::Arc;

/// What may be changed of a document's tree.
#[derive(Clone, Debug, Default)]
pub struct TreeOptions {
    /// The document's own settings, or others.
    pub config: Config,
    /// The shape that the tree is cut to.
    pub cut_to: Option<Drawn>,
    /// A leaf in place of the built-in one.
    pub leaf: Option<Template>,
    /// How dense the leaves are, of the film's size.
    pub density: Option<Luma>,
}

/// A tree that is ready to be written or drawn.
pub struct PreparedTree {
    /// What it was made from, but for its poses, which are in [`poses`](Self::poses).
    pub document: Document,
    pub config: Config,
    pub skeleton: Arc<Skeleton>,
    /// In the order of time; none where the tree is at rest.
    pub poses: Vec<Pose>,
    /// The pose in the picture of the document.
    pub pose_in_picture: Option<Pose>,
    /// Everything that is drawn of it.
    pub dressed: Dressed,
    /// How far each group of leaves swings in every pose.
    pub flutter: Vec<Vec<LeafSwing>>,
    /// What is known of the sway of every node.
    pub sway: Vec<Swaying>,
    /// The modes of the whole tree; none of a tree that differs from the one in the tables.
    pub modes: Vec<TreeMode>,
    /// Whether it differs from the tree in the tables.
    pub reshaped: bool,
    /// What the drawn shape did to it.
    pub cut: Option<Cut>,
    node_extras: Vec<Value>,
    provenance: Value,
    /// Where the scale comes from, if there is one.
    scale: ScaleFrom,
    transforms: AppliedTransforms,
}

/// Where the size of a pixel comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ScaleFrom {
    /// A length that was measured.
    Measured,
    /// The height that was asked for.
    Height,
}

impl ScaleFrom {
    /// One word for files.
    fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Height => "height",
        }
    }
}

/// What was done to the document's tree, for all further poses of it.
#[derive(Default)]
struct AppliedTransforms {
    /// The tree of the new shape.
    reshaped: Option<Arc<Skeleton>>,
    /// The tree before it was cut, and the cut one.
    cut: Option<(Arc<Skeleton>, Topiary)>,
}

/// The skeleton in its new shape, before anything is drawn on it.
struct Posed {
    skeleton: Arc<Skeleton>,
    poses: Vec<Pose>,
    pose_in_picture: Option<Pose>,
    sway: Vec<Swaying>,
    /// The drawn shape in the picture.
    cut_to: Option<Outline>,
    cut: Option<Cut>,
    transforms: AppliedTransforms,
}

impl PreparedTree {
    /// Prepares the tree of `document`.
    ///
    /// # Errors
    /// The document lacks what a new shape is made from, the tree is too large for one, or the
    /// drawn shape lies off the tree.
    pub fn new(mut document: Document, options: TreeOptions) -> Result<Self, PrepareError> {
        let TreeOptions {
            mut config,
            cut_to,
            leaf,
            density,
        } = options;
        let mut posed = Posed::as_captured(&mut document);
        let reshaped = config.shape != document.note.config.shape;
        config.shape.planes = config.shape.planes_of(document.note.is_of_bare());
        let changed = reshaped || cut_to.is_some();
        if changed {
            posed.refuse_large(reshaped.then_some(config.shape.planes))?;
        }
        if reshaped {
            posed.reshape(&document, &config)?;
        }
        if let Some(drawn) = &cut_to {
            posed.cut(&document, drawn, &config)?;
        }
        let is_film = document.note.timing.is_of_film();
        let leaf_mask = document.leaf_mask.as_deref();
        let seen = Seen {
            picture: document.picture.as_ref().map(|p| &*p.rgb),
            pose: posed.pose_in_picture.as_ref(),
            outline: document.outline.as_ref(),
            outline_at_rest: document.outline_at_rest.as_ref(),
            cut_to: posed.cut_to.as_ref(),
            bark: document.bark.as_ref(),
            leaf_rgb: document.note.leaf_rgb(),
            leaf: leaf.as_ref(),
            density: density.as_ref(),
            leaf_mask: leaf_mask.filter(|_| !is_film),
            filmed_leaf_mask: leaf_mask.filter(|_| is_film),
        };
        let dressed = dress(&posed.skeleton, seen, &config);
        let flutter = flutter(&dressed, &posed.poses, &posed.skeleton, &config);
        let provenance = provenance(&document.note, &Software::default(), &posed.poses);
        let modes = match changed {
            true => Vec::new(),
            false => document.modes.clone(),
        };
        let mut tree = Self {
            scale: ScaleFrom::Measured,
            node_extras: joint_extras(&posed.skeleton, &posed.sway, &modes),
            modes,
            reshaped: changed,
            document,
            config,
            skeleton: posed.skeleton,
            poses: posed.poses,
            pose_in_picture: posed.pose_in_picture,
            dressed,
            flutter,
            sway: posed.sway,
            cut: posed.cut,
            provenance,
            transforms: posed.transforms,
        };
        tree.note_scale();
        tree.note_modes();
        Ok(tree)
    }

    /// Gives the tree a height from its foot to its top, m, unless its scale is known or nothing of
    /// it is drawn. Returns whether it did.
    pub fn set_height(&mut self, height_m: f64) -> bool {
        let height_px = self.dressed.height_px();
        if self.config.export.metres_per_px > 0.0 || height_px <= 0.0 {
            return false;
        }
        self.config.export.metres_per_px = height_m / height_px;
        self.scale = ScaleFrom::Height;
        self.note_scale();
        true
    }

    /// Puts the unit of lengths, and where it comes from, into the file's own notes.
    fn note_scale(&mut self) {
        let Some(notes) = self.provenance.as_object_mut() else {
            return;
        };
        let in_metres = self.config.export.metres_per_px > 0.0;
        notes.insert("unit".into(), if in_metres { "m" } else { "px" }.into());
        if in_metres {
            notes.insert("scale".into(), self.scale.word().into());
        }
    }

    /// Puts the modes of the whole tree into the file's own notes.
    fn note_modes(&mut self) {
        let Some(notes) = self.provenance.as_object_mut() else {
            return;
        };
        if self.modes.is_empty() {
            notes.remove("modes");
        } else {
            let modes = ModeSummary::all(&self.modes, &self.skeleton);
            notes.insert("modes".into(), json!(modes));
        }
    }

    /// Takes other answers on the sway than those of the document, as reading them back would give
    /// them. Only for a tree of the document's own shape: they are by node index.
    ///
    /// # Errors
    /// The modes cannot be read back.
    pub fn take_sway(&mut self, found: SwayFound) -> Result<(), PrepareError> {
        self.document.take_sway(found.sway);
        self.document.take_modes(found.modes)?;
        self.sway.clone_from(&self.document.sway);
        self.modes.clone_from(&self.document.modes);
        self.node_extras = joint_extras(&self.skeleton, &self.sway, &self.modes);
        self.note_modes();
        Ok(())
    }

    /// Takes other poses than those of the film, at even times; `looped`: the last is the first
    /// again. `what` says for the file's own notes where they come from.
    pub fn animate(&mut self, poses: Vec<Pose>, looped: bool, what: Value) {
        self.flutter = if looped {
            looped_flutter(&self.dressed, &poses, &self.skeleton, &self.config)
        } else {
            flutter(&self.dressed, &poses, &self.skeleton, &self.config)
        };
        self.provenance = provenance(&self.document.note, &Software::default(), &poses);
        if let Some(notes) = self.provenance.as_object_mut() {
            notes.insert("animated".into(), what);
        }
        self.note_scale();
        self.note_modes();
        self.poses = poses;
    }

    /// All poses of the film, of the tree as it is; read anew, one at a time.
    ///
    /// # Errors
    /// `motion.csv` is missing or damaged.
    pub fn film(&self) -> Result<impl Iterator<Item = Result<Pose, DocumentError>>, DocumentError> {
        let mut reposer = self.reposer();
        let film = self.document.film()?;
        Ok(film.map(move |pose| Ok(self.posed_as_wanted(pose?, reposer.as_mut()))))
    }

    fn reposer(&self) -> Option<Reposer> {
        let skeleton = self.transforms.reshaped.as_ref()?;
        Some(self.document.reposer(skeleton, &self.config))
    }

    /// A pose of the document as one of this tree.
    fn posed_as_wanted(&self, pose: Pose, reposer: Option<&mut Reposer>) -> Pose {
        let pose = match reposer {
            Some(reposer) => reposer.pose(&pose),
            None => pose,
        };
        match &self.transforms.cut {
            Some((whole, topiary)) => topiary.pose(whole, &pose),
            None => pose,
        }
    }

    /// What goes into a model's file.
    pub fn model(&self) -> Model<'_> {
        Model {
            skeleton: &self.skeleton,
            dressed: &self.dressed,
            poses: &self.poses,
            flutter: if self.config.export.leaf_swing {
                &self.flutter
            } else {
                &[]
            },
            level: 0,
            metres_per_px: self.config.export.metres_per_px,
            tolerance_px: KEY_TOLERANCE_PX,
            node_extras: &self.node_extras,
            provenance: &self.provenance,
        }
    }

    /// A page that shows `model`, which is [`model`](Self::model) or one with other keys.
    ///
    /// # Errors
    /// As of [`glb`] and [`html::page`].
    pub fn page(&self, model: &Model, title: &str) -> Result<Vec<u8>, ExportError> {
        let (bytes, _) = glb(model)?;
        let data = html::Data::of(
            &self.document.note,
            &self.skeleton,
            &self.poses,
            &html::Sways {
                of_nodes: &self.sway,
                modes: &self.modes,
            },
            self.config.export.metres_per_px,
        );
        let picture = self.document.picture.as_ref().map(|p| &*p.rgb);
        let page = html::page(&html::Page {
            title,
            glb: &bytes,
            data: &data,
            picture,
        })?;
        Ok(page.into_bytes())
    }
}

impl Posed {
    /// Takes the poses out of `document`: those of a minute take tens of megabytes.
    fn as_captured(document: &mut Document) -> Self {
        Self {
            skeleton: document.skeleton.clone(),
            poses: std::mem::take(&mut document.poses),
            pose_in_picture: document.pose_in_picture.clone(),
            sway: document.sway.clone(),
            cut_to: None,
            cut: None,
            transforms: AppliedTransforms::default(),
        }
    }

    /// Refuses a tree that would take hours to be given another shape, with so many planes if these
    /// are new.
    fn refuse_large(&self, planes: Option<u32>) -> Result<(), PrepareError> {
        let planes = planes.unwrap_or(0) as usize;
        let of_planes = planes.saturating_mul(self.skeleton.measured());
        let nodes = self.skeleton.nodes.len().max(of_planes);
        if nodes > MOST_RESHAPED {
            return Err(PrepareError::TooManyNodes { nodes });
        }
        Ok(())
    }

    /// Gives the measured nodes another depth and other copies, as `config` says.
    fn reshape(&mut self, document: &Document, config: &Config) -> Result<(), PrepareError> {
        let outline = outline_of(document)?;
        self.skeleton = Arc::new(reshape(&document.skeleton, outline, config));
        self.poses = document.reposed(&self.skeleton, config, &self.poses);
        let in_picture = document.pose_in_picture.as_slice();
        self.pose_in_picture = document.reposed(&self.skeleton, config, in_picture).pop();
        // Copies come last; nothing was measured on them.
        self.sway.truncate(document.skeleton.measured());
        self.sway
            .resize(self.skeleton.nodes.len(), Err(Unidentified::NotMeasured));
        self.transforms.reshaped = Some(self.skeleton.clone());
        Ok(())
    }

    /// Cuts the tree to a drawn shape.
    fn cut(
        &mut self,
        document: &Document,
        drawn: &Drawn,
        config: &Config,
    ) -> Result<(), PrepareError> {
        let topiary = cut_to(&self.skeleton, outline_of(document)?, drawn, config)?;
        self.cut = Some(topiary.cut);
        if topiary.cut.larger {
            return Ok(());
        }
        let whole = self.skeleton.clone();
        for pose in self.poses.iter_mut().chain(&mut self.pose_in_picture) {
            *pose = topiary.pose(&whole, pose);
        }
        self.sway = sway_of_cut(&self.sway, &topiary);
        self.skeleton = Arc::new(topiary.skeleton.clone());
        self.cut_to = Some(topiary.shape.clone());
        self.transforms.cut = Some((whole, topiary));
        Ok(())
    }
}

/// How the nodes of a tree sway that was cut; nothing was measured on those that it added.
fn sway_of_cut(sway: &[Swaying], topiary: &Topiary) -> Vec<Swaying> {
    let mut all = Vec::with_capacity(topiary.skeleton.nodes.len());
    for (node, of) in topiary.skeleton.nodes.iter().zip(&topiary.moves_as) {
        all.push(match sway.get(of.index()) {
            Some(sway) if node.copy_of.is_none() => *sway,
            _ => Err(Unidentified::NotMeasured),
        });
    }
    all
}
