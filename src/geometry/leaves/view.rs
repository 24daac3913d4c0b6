//! What is known of the leaves, and how places are found for them.

use crate::model::{Luma, Outline, Pose, Rgb, Skeleton};
use nalgebra::Point2;

/// Colour of leaves where no picture shows any (sRGB).
pub(super) const PLAIN: [u8; 3] = [86, 110, 50];

/// What is known of the leaves.
#[derive(Clone, Copy, Debug, Default)]
pub struct LeafView<'a> {
    pub picture: Option<&'a Rgb>,
    pub outline: Option<&'a Outline>,
    /// The tree's pose in the picture; `None`: at rest.
    pub pose: Option<&'a Pose>,
    /// A drawn density that goes before the picture's: white is covered with leaves. Of any size,
    /// for the whole picture.
    pub density: Option<&'a Luma>,
    /// The density is a mask of single leaves, and none is put where most of it would be seen beside
    /// them (Tan et al. 2008 sect. 3.3).
    pub is_mask: bool,
    pub colours: LeafColours,
    /// Colours of leaves (sRGB) where the picture shows none, by chance; may be empty.
    pub palette: &'a [[u8; 3]],
    /// Corners in the picture, px, strongest first.
    pub seeds: &'a [Point2<f32>],
}

/// Which colours leaves have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LeafColours {
    /// Those that the picture shows in their places.
    #[default]
    InPlace,
    /// Of any leaves in the picture, by chance: the tree was given another shape than it has there,
    /// and its leaves are not those that are seen in their places.
    Anywhere,
    /// Those of the palette, else one colour: the picture shows no leaves.
    Plain,
}

/// How places are found for leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// Where the picture, or the drawing, has them.
    Seeds,
    /// About the branches by chance, as in the paper's fig. 5 c and d: normal, `spread` in tree
    /// heights.
    Random { spread: f64 },
}

/// Height of the tree above its foot, px.
pub(super) fn tree_height(skeleton: &Skeleton) -> f64 {
    let (mut low, mut high) = (f64::MAX, f64::MIN);
    for node in &skeleton.nodes {
        let y = node.position.y;
        if y.is_finite() {
            (low, high) = (low.min(y), high.max(y));
        }
    }
    high - low
}
