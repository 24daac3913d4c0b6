//! The wood that pictures show.

#[cfg(test)]
use super::Size;
use super::{BranchGraph, Luma, Outline, Rgb};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The wood of a tree, as the pictures of a film show it at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wood {
    pub branches: BranchGraph,
    /// No leaves are seen on it, and they would be: the pictures have colour.
    pub bare: bool,
    /// The trunk's bark as a tile that repeats without a seam (sRGB): once round a limb, and as far
    /// along it as it is round. One texel where only its colour is seen, `None` where no trunk is.
    pub bark: Option<Arc<Rgb>>,
    /// What it was found in; of wood that was found long ago it is not remembered.
    pub at_rest: Option<Arc<AtRest>>,
}

/// The picture of the tree at rest, made of its stillest frames, from which the camera's motion has
/// been taken off; and what its pixels show. All have the size of the film.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AtRest {
    /// What stands behind the tree is blurred.
    pub picture: Rgb,
    pub masks: Masks,
}

#[cfg(test)]
impl AtRest {
    /// Three grey pictures for tests.
    pub(crate) fn made_up(size: Size) -> Self {
        let mask = |level| Luma {
            size,
            pixels: vec![level; size.area()],
        };
        Self {
            picture: Rgb {
                size,
                pixels: vec![90; 3 * size.area()],
            },
            masks: Masks {
                wood: mask(200),
                leaves: mask(9),
            },
        }
    }
}

/// How sure it is that each pixel of the picture at rest is wood, and that it is a leaf: the
/// probability, 255 is 1. No pixel has more than 255 in both together. Beyond the outline, widened by how far
/// the tree sways, both are 0, but for the low trunk and lines that the user drew.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Masks {
    pub wood: Luma,
    pub leaves: Luma,
}

/// A tree is in leaf where leaves cover this share of its outline: of bare trees none do, of trees in
/// leaf a quarter and more.
const LEAST_LEAVES: f64 = 0.05;

/// Whether a mask shows leaves on a tree in this outline.
pub fn shows_leaves(mask: &Luma, outline: Option<&Outline>) -> bool {
    let leaves = mask.pixels.iter().filter(|p| **p > Masks::MOST_OUTSIDE);
    let tree = match outline {
        Some(outline) => outline.mask.iter().filter(|m| **m > 0).count(),
        None => mask.pixels.len(),
    };
    leaves.count() as f64 >= LEAST_LEAVES * tree as f64
}

impl Masks {
    /// The greatest value of a pixel that is not in the mask.
    pub const MOST_OUTSIDE: u8 = 127;
}

/// Whether the wood of a tree is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WoodSight {
    /// There is no tree yet, or nobody wants to know.
    #[default]
    NotSought,
    /// It is being looked for.
    Sought,
    Seen,
    NotSeen,
}

/// The wood that was found while a film went on, by the newest frame that was looked at.
pub type WoodSeen = BTreeMap<u64, Arc<Wood>>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    #[test]
    fn a_tree_on_which_no_leaves_were_seen_is_bare() {
        let size = Size::new(20, 10);
        let pixels = vec![34; 200];
        let mut mask = Luma { size, pixels };
        assert!(!shows_leaves(&mask, None));
        mask.pixels[..20].fill(250);
        assert!(shows_leaves(&mask, None));
    }
}
