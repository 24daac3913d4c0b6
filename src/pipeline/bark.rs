//! The colour of the bark.

use crate::model::{Pose, Rgb, Skeleton};

/// Where no picture has been seen (sRGB).
pub const PLAIN: [u8; 3] = [104, 84, 66];

/// Median colour of the picture along the lower trunk, which stands as in `pose`; `None` where no trunk is in it.
pub fn colour(picture: &Rgb, pose: Option<&Pose>, skeleton: &Skeleton) -> Option<[u8; 3]> {
    let top = skeleton.nodes.get(1)?.position;
    let top = pose.and_then(|p| p.joints.get(1)).map_or(top, |joint| joint.position);
    let scale = f64::from(picture.size.width) / f64::from(skeleton.image_size.width.max(1));
    let (foot, top) = (skeleton.foot_px, skeleton.image_from_model(&top));
    let mut channels: [Vec<u8>; 3] = Default::default();
    // The lower half of the trunk: above it twigs and sky come before it.
    for k in 1..=50 {
        let s = f64::from(k) / 100.0;
        let at = [foot[0] + s * (top[0] - foot[0]), foot[1] + s * (top[1] - foot[1])].map(|x| (x * scale).round());
        if picture.size.contains(at[0], at[1]) {
            let colour = picture.at(at[0].max(0.0) as u32, at[1].max(0.0) as u32);
            channels.iter_mut().zip(colour).for_each(|(c, x)| c.push(x));
        }
    }
    channels.iter_mut().for_each(|c| c.sort_unstable());
    let median = |c: &Vec<u8>| c.get(c.len() / 2).copied();
    Some([median(&channels[0])?, median(&channels[1])?, median(&channels[2])?])
}
