//! The leaves of a tree as a picture shows them: whether there are any, their seeds, and where they
//! stand.

#[cfg(feature = "opencv")]
use super::seeds::seeds;
use super::seen::Seen;
use crate::config::{self, LeafShow};
use crate::geometry::{self, Foliage, LeafColours, LeafView, Template};
use crate::model::{Luma, Outline, Rgb, Skeleton, shows_leaves};
use crate::shape::Limb;
use nalgebra::Point2;

/// What is to be known of the leaves before they grow.
pub(super) struct InLeaf {
    seeds: Vec<Point2<f32>>,
    /// The picture shows them.
    filmed: bool,
    /// A drawn density or a mask of leaves, where there is one: nothing grows outside of the outline,
    /// or of the shape that the tree was cut to.
    density: Option<Luma>,
    /// It is a mask of leaves.
    is_mask: bool,
}

impl InLeaf {
    /// `None` where the tree is to have no leaves: the settings say so, or the picture shows none.
    pub fn of(skeleton: &Skeleton, seen: &Seen, settings: &config::Leaves) -> Option<Self> {
        // To look at the picture's colours takes longer than all else that is done for a bare tree.
        if settings.show == LeafShow::Off {
            return None;
        }
        // What was seen to be leaves over the film says more than the colours of one picture.
        let filmed = match seen.filmed_leaf_mask {
            Some(mask) => shows_leaves(mask, seen.outline),
            None => in_leaf(skeleton, seen.picture, seen.outline),
        };
        // Who draws a density wants leaves.
        let given = seen.density.or(seen.leaf_mask);
        if settings.show == LeafShow::Auto && !filmed && given.is_none() {
            return None;
        }
        let mut seeds = match (seen.picture, seen.outline) {
            (Some(picture), Some(outline)) if picture.size == outline.size => {
                seeds(picture, outline, settings.seeds)
            }
            _ => Vec::new(),
        };
        if let Some(shape) = seen.cut_to {
            seeds.retain(|p| shape.contains(f64::from(p.x), f64::from(p.y)));
        }
        let density = given
            .cloned()
            .or_else(|| seen.cut_to.map(whole))
            .map(|drawn| {
                let within = seen
                    .cut_to
                    .or(seen.outline)
                    .filter(|o| o.size == drawn.size);
                if let Some(outline) = within {
                    inside(drawn, outline)
                } else {
                    drawn
                }
            });
        Some(Self {
            seeds,
            filmed,
            density,
            is_mask: seen.density.is_none() && seen.leaf_mask.is_some(),
        })
    }

    /// The wood of a tree in leaf. A picture of a bare tree says nothing of where leaves, and with
    /// them wood, may be.
    pub fn wood(&self, limbs: Vec<Limb>, skeleton: &Skeleton, seen: &Seen) -> Vec<Limb> {
        if self.filmed {
            geometry::within_leaves(limbs, skeleton, &self.view(seen))
        } else {
            limbs
        }
    }

    pub fn foliage(
        &self,
        limbs: &[Limb],
        skeleton: &Skeleton,
        seen: &Seen,
        settings: &config::Leaves,
        seed: u64,
    ) -> Foliage {
        let ours;
        let template = match seen.leaf {
            Some(given) => given,
            None => {
                ours = Template::ours();
                &ours
            }
        };
        geometry::foliage(limbs, skeleton, &self.view(seen), template, settings, seed)
    }

    fn colours(&self, seen: &Seen) -> LeafColours {
        if !self.filmed {
            LeafColours::Plain
        } else if seen.cut_to.is_some() {
            LeafColours::Anywhere
        } else {
            LeafColours::InPlace
        }
    }

    fn view<'a>(&'a self, seen: &Seen<'a>) -> LeafView<'a> {
        let &Seen {
            picture, outline, ..
        } = seen;
        // A tree that was cut fills its shape at rest.
        let pose = seen.pose.filter(|_| seen.cut_to.is_none());
        LeafView {
            picture,
            outline,
            pose,
            density: self.density.as_ref(),
            is_mask: self.is_mask,
            colours: self.colours(seen),
            palette: seen.leaf_rgb,
            seeds: &self.seeds,
        }
    }
}

/// Leaves all over a shape.
fn whole(shape: &Outline) -> Luma {
    Luma {
        size: shape.size,
        pixels: vec![u8::MAX; shape.mask.len()],
    }
}

/// Black outside of the outline.
fn inside(mut drawn: Luma, outline: &Outline) -> Luma {
    for (pixel, mask) in drawn.pixels.iter_mut().zip(&outline.mask) {
        if *mask == 0 {
            *pixel = 0;
        }
    }
    drawn
}

/// Whether the picture shows a tree in leaf; without picture or outline nobody knows, and it is
/// taken for bare.
fn in_leaf(skeleton: &Skeleton, picture: Option<&Rgb>, outline: Option<&Outline>) -> bool {
    let season = picture
        .zip(outline)
        .and_then(|(p, o)| geometry::season(p, o, skeleton));
    season.is_some_and(|s| s.in_leaf >= 0.5)
}

/// Corners are found by OpenCV. Without it there are none, and leaves stand where the picture has
/// their colour.
#[cfg(not(feature = "opencv"))]
fn seeds(_picture: &Rgb, _outline: &Outline, _count: u32) -> Vec<Point2<f32>> {
    Vec::new()
}
