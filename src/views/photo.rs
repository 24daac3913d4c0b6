//! Documents of trees in one photograph (Tan et al. 2008).

use super::drawn::DrawnTree;
use super::{Draft, PrepareError, ReadyDocument};
use crate::config::{Config, LeafShow};
use crate::document::Document;
use crate::document::note::{BarkNote, FoundNote, MasksNote, ModelNote, PictureNote};
use crate::document::{BARK_FILE, LEAVES_MASK_FILE, PICTURE_FILE, REST_FILE, WOOD_MASK_FILE};
use crate::grow::{Growth, GrowthRegion, Library, ROUNDS, SubtreeKind, grow_subtrees, sample_sway};
use crate::import::FlatTree;
use crate::model::{Outline, Picture, Skeleton, Swaying, Wood};
use crate::pipeline::{PhotoError, TreeInPhoto};
use crate::random::generator;
use crate::shape::{self, Silhouette};
use std::sync::Arc;

/// Triangles of all leaves: a photograph shows single ones. With the 20,000 of a film the silhouette of
/// made photographs is met by 0.76 instead of 0.80.
const LEAF_TRIANGLES: u32 = 100_000;

/// How deep a crown is by the geometric mean of how wide (deviations of its wood) and how high the tree is. A
/// photograph does not show it: of 120 made trees this is the median (seeds 50001 to 50120).
const CROWN_DEPTH: f64 = 0.25;

/// The settings that trees of photographs have if no others are given.
pub fn photo_defaults() -> Config {
    let mut config = Config::default();
    // What is behind is grown, not copied.
    config.shape.planes = 1;
    config.leaves.triangles = LEAF_TRIANGLES;
    config
}

/// A photograph and the tree that it shows.
#[derive(Clone, Copy, Debug)]
pub struct PhotoParts<'a> {
    /// Where it is from.
    pub name: &'a str,
    pub picture: &'a Picture,
    pub tree: &'a TreeInPhoto,
}

/// A tree that one in a photograph is like: its subtrees, and its sway.
#[derive(Clone, Debug)]
pub struct PhotoExample {
    library: Library,
    skeleton: Arc<Skeleton>,
    sway: Vec<Swaying>,
}

impl PhotoExample {
    /// `None` where it has no branches that bear others.
    pub fn of(document: Document) -> Option<Self> {
        Some(Self {
            library: Library::like(&document.skeleton)?,
            skeleton: document.skeleton,
            sway: document.sway,
        })
    }
}

/// How a tree of a photograph goes on where it is not seen.
#[derive(Clone, Copy, Debug)]
pub struct PhotoGrowth<'a> {
    /// Which ready-made subtrees are used where too few branches are seen; `None`: nothing is grown, and the
    /// tree has what is seen alone.
    pub subtrees: Option<SubtreeKind>,
    /// A tree whose subtrees are used instead, and whose sway is that of the new tree by chance.
    pub like: Option<&'a PhotoExample>,
    /// How the visible branches come into space.
    pub depth: PhotoDepth,
    /// What draws new branches.
    pub attractors: Attracting,
}

/// What draws new branches of a photographed tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Attracting {
    /// The leaves in the picture and, in turns, the tree's own joints turned by 90 degrees.
    #[default]
    Space,
    /// The leaves in the picture alone: from the side the tree has gaps (Tan et al. 2008 fig. 6).
    Picture,
}

/// How branches that are seen in one picture come into space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PhotoDepth {
    /// They are pushed to fill the crown turned about its axis, with likely angles (Li 2011 sect. 3).
    #[default]
    Push,
    /// They lie as far apart as they can (Okabe et al. 2005).
    Apart,
}

/// Why a photograph gave no tree in space.
#[derive(Debug, thiserror::Error)]
pub enum PhotoTreeError {
    #[error(transparent)]
    Photo(#[from] PhotoError),
    #[error(transparent)]
    Prepare(#[from] PrepareError),
}

/// The tree of a photograph in space.
pub struct PhotoTree {
    pub tree: DrawnTree,
    /// What was grown; nothing of a bare tree, whose branches are all seen.
    pub growth: Growth,
    sway: Vec<Swaying>,
    picture: Picture,
    wood: Wood,
}

impl PhotoTree {
    /// Stands the visible branches up in space and, of a tree in leaf, grows those that leaves hide. A
    /// bare tree gets neither leaves nor twigs but those that are seen.
    ///
    /// # Errors
    /// It has no branches or too many, or there is nothing of it.
    pub fn new(
        parts: PhotoParts,
        growth: PhotoGrowth,
        mut config: Config,
    ) -> Result<Self, PhotoTreeError> {
        let TreeInPhoto { seen, strokes, .. } = parts.tree;
        let (in_leaf, wood) = (seen.in_leaf, &seen.wood);
        let flat = parts.tree.flat_tree()?;
        let region = parts.tree.region(&flat)?;
        config.leaves.show = match (config.leaves.show, in_leaf) {
            (LeafShow::Auto, true) => LeafShow::On,
            (LeafShow::Auto, false) => LeafShow::Off,
            (wished, _) => wished,
        };
        if !in_leaf {
            config.wood.twig_px = 0.0;
        }
        let lines = strokes
            .iter()
            .map(|s| s.iter().map(|p| [p.x, p.y]).collect());
        config.skeleton.strokes_px = lines.collect();
        let mut tree = DrawnTree::new(parts.name.to_owned(), &flat, &region, config)?;
        match growth.depth {
            // Leaves hide how limbs go, and grown branches fill the crown better from limbs to all sides.
            PhotoDepth::Push if in_leaf => {}
            PhotoDepth::Push => shape::make_depths_even(&mut tree.skeleton),
            PhotoDepth::Apart => {
                let trunk = on_trunk(&tree.skeleton, &flat);
                shape::set_depths_apart(&mut tree.skeleton, &trunk);
            }
        }
        let seed = tree.note.config.wood.seed.into();
        let mut grown = Growth::default();
        if let (true, Some(subtrees)) = (in_leaf, growth.subtrees) {
            let library = match growth.like {
                Some(like) => like.library.clone(),
                None => Library::of(&tree.skeleton, subtrees),
            };
            grown = grow(&mut tree, &region, &library, growth.attractors, seed);
        }
        shape::set_depth_share(&mut tree.skeleton, CROWN_DEPTH);
        let sway = growth.like.map_or(Vec::new(), |like| {
            let random = &mut generator(seed, 1);
            sample_sway(&like.skeleton, &like.sway, &tree.skeleton, random)
        });
        let note = &mut tree.note;
        let metres_per_px = note.config.export.metres_per_px;
        note.model = Some(ModelNote::of(&tree.skeleton, metres_per_px));
        note.picture = Some(PictureNote {
            file: PICTURE_FILE.into(),
            frame: parts.picture.frame,
            time_s: parts.picture.time_s,
        });
        note.found = parts.tree.found.map(|found| FoundNote {
            chance: found.chance(),
            trunk_deviations: found.trunk_deviations,
            level_share: found.level_share,
        });
        note.bark = wood.bark.as_ref().map(|_| BarkNote {
            file: BARK_FILE.into(),
        });
        note.masks = wood.at_rest.as_ref().map(|_| MasksNote {
            wood: WOOD_MASK_FILE.into(),
            leaves: LEAVES_MASK_FILE.into(),
            rest: REST_FILE.into(),
        });
        Ok(Self {
            tree,
            growth: grown,
            sway,
            picture: parts.picture.clone(),
            wood: wood.clone(),
        })
    }

    /// From its foot to its top, px.
    pub fn height_px(&self) -> f64 {
        let nodes = self.tree.skeleton.nodes.iter();
        nodes.map(|node| node.position.y).fold(0.0, f64::max)
    }

    /// Makes all files of its document.
    ///
    /// # Errors
    /// The tree is none for a model's file, or cannot be read back.
    pub fn ready(self) -> Result<ReadyDocument, PrepareError> {
        let draft = Draft {
            note: self.tree.note,
            skeleton: &self.tree.skeleton,
            picture: Some(&self.picture),
            bark: self.wood.bark.as_ref(),
            at_rest: self.wood.at_rest.as_ref(),
            poses: Vec::new(),
            pose_in_picture: None,
        };
        ReadyDocument::of(draft, &self.sway)
    }
}

/// Grows the branches that are not seen.
fn grow(
    tree: &mut DrawnTree,
    region: &Outline,
    library: &Library,
    attractors: Attracting,
    seed: u64,
) -> Growth {
    let silhouette = Silhouette::Filmed(tree.note.config.shape.envelope);
    let room = shape::room(&tree.skeleton, Some(region), silhouette);
    let width_px = f64::from(tree.skeleton.image_size.width);
    let region = GrowthRegion {
        tree: region,
        room: &room,
        in_space: attractors == Attracting::Space,
        tip_px: shape::TIP_RADIUS_PX * width_px / 640.0,
    };
    let random = &mut generator(seed, 0);
    grow_subtrees(&mut tree.skeleton, library, &region, ROUNDS, random)
}

/// Whether each node lies on the trunk's line.
fn on_trunk(skeleton: &Skeleton, flat: &FlatTree) -> Vec<bool> {
    let places = skeleton.nodes.iter().map(|n| &n.position);
    let places_px = places.map(|at| skeleton.image_from_model(at));
    places_px.map(|at_px| flat.is_on_trunk(at_px)).collect()
}
