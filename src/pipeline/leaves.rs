//! The leaves of a tree as a picture shows them: whether there are any, their seeds, and where they stand.

use super::Seen;
use crate::config::{self, LeafShow};
use crate::model::{Luma, Outline, Rgb, Skeleton};
use crate::shape::{self, Foliage, LeafView, Limb, Template};
use crate::track::Detector;

/// Corners may lie nearer together than points that are followed, px at 640 px picture width, and be weaker: each is a leaf.
const SEED_DISTANCE_PX: f64 = 3.0;
const SEED_QUALITY: f64 = 1e-4;

/// What is to be known of the leaves before they grow: their seeds.
pub(super) struct InLeaf {
    seeds: Vec<[f32; 2]>,
}

impl InLeaf {
    /// `None` where the tree is to have no leaves: the settings say so, or the picture shows none.
    pub fn of(skeleton: &Skeleton, seen: &Seen, settings: &config::Leaves) -> Option<Self> {
        let wanted = match settings.show {
            LeafShow::Off => false,
            LeafShow::On => true,
            // Who draws a density wants leaves.
            LeafShow::Auto => seen.density.is_some() || in_leaf(skeleton, seen),
        };
        let seeds = match (seen.picture, seen.outline) {
            (Some(picture), Some(outline)) if wanted && picture.size == outline.size => {
                seeds(picture, outline, settings.seeds)
            }
            _ => Vec::new(),
        };
        wanted.then_some(Self { seeds })
    }

    /// The wood of a tree in leaf. In a drawn shape the film's leaves say nothing of where wood may stand.
    pub fn wood(&self, limbs: Vec<Limb>, skeleton: &Skeleton, seen: &Seen) -> Vec<Limb> {
        if seen.cut { limbs } else { shape::within_leaves(limbs, skeleton, &self.view(seen)) }
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
        shape::foliage(limbs, skeleton, &self.view(seen), template, settings, seed)
    }

    fn view<'a>(&'a self, seen: &Seen<'a>) -> LeafView<'a> {
        let &Seen { picture, outline, pose, density, .. } = seen;
        LeafView { picture, outline, pose, density, seeds: &self.seeds }
    }
}

fn in_leaf(skeleton: &Skeleton, seen: &Seen) -> bool {
    let season = seen.picture.zip(seen.outline).and_then(|(p, o)| shape::season(p, o, skeleton));
    season.is_some_and(|s| s.in_leaf >= 0.5)
}

/// Harris corners of a whole frame inside the outline, px, strongest first.
pub fn seeds(picture: &Rgb, outline: &Outline, count: u32) -> Vec<[f32; 2]> {
    if picture.pixels.len() != 3 * picture.size.area() || outline.mask.len() != outline.size.area() {
        return Vec::new();
    }
    let detect =
        config::Detect { points: count, min_distance_px: SEED_DISTANCE_PX, quality: SEED_QUALITY, border_px: 0.0 };
    let grey = |c: &[u8]| ((299 * u32::from(c[0]) + 587 * u32::from(c[1]) + 114 * u32::from(c[2]) + 500) / 1000) as u8;
    let luma = Luma { size: picture.size, pixels: picture.pixels.chunks_exact(3).map(grey).collect() };
    Detector::new(&detect, outline).detect(&luma, &[], count as usize)
}
