//! What the film shows of a tree apart from its motion.

use crate::geometry::Template;
use crate::model::{Luma, Outline, Pose, Rgb};
use std::sync::Arc;

/// What the film shows of the tree apart from its motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen<'a> {
    /// A whole frame in colour, and the tree's pose in it (`None`: the rest pose).
    pub picture: Option<&'a Rgb>,
    pub pose: Option<&'a Pose>,
    pub outline: Option<&'a Outline>,
    /// The outline where the tree rests; `None` where it is not known, as without motion.
    pub outline_at_rest: Option<&'a Outline>,
    /// The drawn shape, in the picture, that the tree was cut to. It stands in the tree's place at
    /// rest.
    pub cut_to: Option<&'a Outline>,
    /// The bark of the filmed trunk as a tile, see [`Wood::bark`](crate::model::Wood).
    pub bark: Option<&'a Arc<Rgb>>,
    /// Colours of leaves (sRGB) where the picture shows none; may be empty.
    pub leaf_rgb: &'a [[u8; 3]],
    /// A leaf of the user's own, and a drawn density of the leaves, which goes before the
    /// picture's.
    pub leaf: Option<&'a Template>,
    pub density: Option<&'a Luma>,
    /// Where a photograph shows leaves, pixel by pixel; a drawn density goes before it.
    pub leaf_mask: Option<&'a Luma>,
    /// The same of a film, which says whether there are any.
    pub filmed_leaf_mask: Option<&'a Luma>,
}
