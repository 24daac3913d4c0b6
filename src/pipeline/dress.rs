//! From the skeleton to all that is drawn of a tree: wood now, leaves where the film shows them.

use super::bark;
use crate::config::Config;
use crate::model::{Outline, Pose, Rgb, Skeleton};
use crate::shape::{Envelope, Foliage, Limb, Mesh, limbs, wood_levels};
use nalgebra::Point3;

/// What the film shows of the tree apart from its motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen<'a> {
    /// A whole frame in colour, and the tree's pose in it (`None`: the rest pose).
    pub picture: Option<&'a Rgb>,
    pub pose: Option<&'a Pose>,
    pub outline: Option<&'a Outline>,
}

/// Everything that is drawn of a tree at rest.
#[derive(Clone, Debug, Default)]
pub struct Dressed {
    pub limbs: Vec<Limb>,
    /// The wood in falling levels of detail, at least one; all on the joints of the same skeleton.
    pub wood: Vec<Mesh>,
    pub foliage: Foliage,
    /// Colour of the bark as in a picture (sRGB).
    pub bark_rgb: [u8; 3],
}

/// Dresses a skeleton.
pub fn dress(skeleton: &Skeleton, seen: Seen, config: &Config) -> Dressed {
    let room = room(skeleton.foot_px, seen.outline);
    let limbs = limbs(skeleton, &room, &config.wood, config.wood.seed.into());
    let wood = wood_levels(&limbs, config.wood.triangles as usize);
    let bark = seen.picture.and_then(|picture| bark::colour(picture, seen.pose, skeleton));
    Dressed { limbs, wood, foliage: Foliage::default(), bark_rgb: bark.unwrap_or(bark::PLAIN) }
}

/// Where twigs may grow (from and to, model axes, px): within the outline turned about its axis, and not out of the outline
/// itself as seen from the front; everywhere where there is no outline.
pub(super) fn room(foot_px: [f64; 2], outline: Option<&Outline>) -> impl Fn(&Point3<f64>, &Point3<f64>) -> bool {
    let envelope = outline.map(|outline| Envelope::of_revolution(outline, foot_px));
    move |from: &Point3<f64>, to: &Point3<f64>| match (&envelope, outline) {
        (Some(envelope), Some(outline)) => {
            let middle = nalgebra::center(from, to);
            let seen = |p: &Point3<f64>| outline.contains(foot_px[0] + p.x, foot_px[1] - p.y);
            // A branch that is outside itself, as a copy may be, is no barer for it.
            envelope.contains(to) && envelope.contains(&middle) && (!seen(from) || (seen(to) && seen(&middle)))
        }
        _ => true,
    }
}
