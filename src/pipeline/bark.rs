//! The colour of the bark, and its grain as a tile.

use super::seen::Seen;
use crate::model::{Outline, Rgb, Skeleton};
use crate::signal::statistics::quantile;
use image::{ImageFormat, Rgb as Pixel, RgbImage};
use nalgebra::{Point2, Vector2};
use std::f64::consts::PI;
use std::io::Cursor;

/// Where no picture has been seen (sRGB).
pub const PLAIN: [u8; 3] = [104, 84, 66];

/// Share of the trunk, from the foot up, that is looked at: above it twigs and sky come before it.
const LOWER: f64 = 0.3;
/// Share of the outline's width there: drawn by hand it is often twice as wide as the trunk.
const MIDDLE: f64 = 0.2;

/// Places that are looked at along it.
const PLACES: u32 = 50;

/// Pixels across a trunk from which on it shows bark and not only a colour.
const LEAST_ACROSS_PX: f64 = 8.0;
/// Half of the visible angle about the trunk that is taken, radians: nearer to its edges bark is
/// seen too flat, and what is behind mixes in.
const SEEN_HALF: f64 = 1.0;
/// An outline that is wider than so many radii of the trunk is that of the crown or the ground.
const WIDEST_RADII: f64 = 6.0;
/// Side of the patch that is taken, texels; the tile is that and its mirror images.
const PATCH: u32 = 64;
/// Share of the texels that are taken for another thing than bark, at either end of brightness.
const STANDS_OUT: f64 = 0.05;

/// The bark of the filmed lower trunk as a tile, PNG. The trunk is taken for an upright cylinder
/// and unrolled; light that falls off around it and along it is taken off, and the patch is put
/// beside its mirror images, so that it has no seam. Its hue is `rgb`, the trunk's own. `None`
/// where the trunk is too thin in the picture, or not in it.
pub fn tile(seen: &Seen, skeleton: &Skeleton, rgb: [u8; 3]) -> Option<Vec<u8>> {
    let trunk = Trunk::of(seen, skeleton)?;
    let mut patch: Vec<f64> = Vec::with_capacity((PATCH * PATCH) as usize);
    for row in 0..PATCH {
        for column in 0..PATCH {
            patch.push(trunk.brightness(column, row)?);
        }
    }
    flatten(&mut patch);
    let tile = RgbImage::from_fn(2 * PATCH, 2 * PATCH, |x, y| {
        let (x, y) = (mirrored(x), mirrored(y));
        let times = patch[(y * PATCH + x) as usize];
        Pixel(rgb.map(|c| (f64::from(c) * times).round().min(255.0) as u8))
    });
    let mut bytes = Vec::new();
    let written = tile.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png);
    written.ok().map(|()| bytes)
}

/// The texel of the patch that a texel of the tile shows.
fn mirrored(x: u32) -> u32 {
    if x < PATCH { x } else { 2 * PATCH - 1 - x }
}

/// Divides every texel by the mean of those around it, so that what is left is bark and not light,
/// and every row by its mean, or what crosses the whole trunk would be rings on every limb; and
/// takes off what stands out: a rope, a leaf, the sky beside the trunk.
fn flatten(patch: &mut [f64]) {
    let around = local_means(patch);
    for (x, mean) in patch.iter_mut().zip(around) {
        *x /= mean.max(1.0);
    }
    for row in patch.chunks_exact_mut(PATCH as usize) {
        let mean = row.iter().sum::<f64>() / f64::from(PATCH);
        row.iter_mut().for_each(|x| *x /= mean.max(1e-3));
    }
    let ends = [STANDS_OUT, 1.0 - STANDS_OUT].map(|share| quantile(patch.to_vec(), share));
    if let [Some(darkest), Some(brightest)] = ends {
        patch
            .iter_mut()
            .for_each(|x| *x = x.clamp(darkest, brightest));
    }
}

/// Means over squares about every texel, which end at the patch's border.
fn local_means(patch: &[f64]) -> Vec<f64> {
    let side = PATCH as usize;
    let reach = side / 6;
    let mut means = Vec::with_capacity(patch.len());
    for row in 0..side {
        for column in 0..side {
            let rows = row.saturating_sub(reach)..(row + reach + 1).min(side);
            let columns = column.saturating_sub(reach)..(column + reach + 1).min(side);
            let texels = (rows.len() * columns.len()) as f64;
            let mut sum = 0.0;
            for row in rows {
                sum += patch[row * side..][columns.clone()].iter().sum::<f64>();
            }
            means.push(sum / texels);
        }
    }
    means
}

/// The lower trunk in the picture.
struct Trunk<'a> {
    picture: &'a Rgb,
    outline: Option<&'a Outline>,
    /// Pixels of the picture in one of the model.
    scale: f64,
    foot: Point2<f64>,
    /// Upwards along the trunk for the length of the patch, and across it for its radius, px.
    along: Vector2<f64>,
    across: Vector2<f64>,
}

impl<'a> Trunk<'a> {
    fn of(seen: &Seen<'a>, skeleton: &Skeleton) -> Option<Self> {
        let picture = seen
            .picture
            .filter(|p| p.pixels.len() == 3 * p.size.area())?;
        let scale = f64::from(picture.size.width) / f64::from(skeleton.image_size.width.max(1));
        let node = skeleton.nodes.get(1)?;
        let top = seen.pose.and_then(|p| p.joints.get(1));
        let top = skeleton.image_from_model(&top.map_or(node.position, |joint| joint.position));
        let (foot, radius) = (skeleton.foot_px, node.radius);
        let way = (top - foot).try_normalize(1e-9)?;
        let across_px = 2.0 * radius * scale;
        if !across_px.is_finite() || across_px < LEAST_ACROSS_PX {
            return None;
        }
        // The patch is half as long as the trunk is round, if the trunk is.
        let length = (PI * radius).min((top - foot).norm());
        let across = Vector2::new(-way.y, way.x) * radius;
        Some(Self {
            picture,
            outline: seen.outline,
            scale,
            foot,
            along: way * length,
            across,
        })
    }

    /// How bright the trunk is at a texel of the patch, the lowest row last; `None` off the
    /// picture.
    fn brightness(&self, column: u32, row: u32) -> Option<f64> {
        let [x, y] = [column, row].map(|k| (f64::from(k) + 0.5) / f64::from(PATCH));
        let angle = SEEN_HALF * (2.0 * x - 1.0);
        let at = self.middle(1.0 - y) + self.across * angle.sin();
        bilinear(self.picture, at * self.scale)
    }

    /// The trunk's middle at a share of the patch's length, px. The line from node to node may pass
    /// by the trunk; the middle of the outline does not, where the outline has one at the foot.
    fn middle(&self, share: f64) -> Point2<f64> {
        let at = self.foot + self.along * share;
        let Some(outline) = self.outline.filter(|o| o.contains(self.foot.x, at.y)) else {
            return at;
        };
        let left = border(outline, self.foot.x, at.y, -1.0);
        let right = border(outline, self.foot.x, at.y, 1.0);
        if right - left <= WIDEST_RADII * self.across.norm() {
            Point2::new(0.5 * (left + right), at.y)
        } else {
            at
        }
    }
}

/// Mean of the channels between pixels; `None` off the picture.
fn bilinear(picture: &Rgb, at: Point2<f64>) -> Option<f64> {
    let corner = at.map(f64::floor);
    let mut sum = 0.0;
    for [du, dv] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
        let pixel = corner + Vector2::new(du, dv);
        if !picture.size.contains(pixel) || pixel.x < 0.0 || pixel.y < 0.0 {
            return None;
        }
        let weight = (1.0 - (at.x - pixel.x).abs()) * (1.0 - (at.y - pixel.y).abs());
        let colour = picture.at(pixel.x as u32, pixel.y as u32);
        sum += weight * colour.map(f64::from).iter().sum::<f64>() / 3.0;
    }
    Some(sum)
}

/// Median colour of the picture along the lower trunk; `None` where no trunk is in it.
pub fn colour(seen: &Seen, skeleton: &Skeleton) -> Option<[u8; 3]> {
    let picture = seen
        .picture
        .filter(|p| p.pixels.len() == 3 * p.size.area())?;
    let top = skeleton.nodes.get(1)?.position;
    let top = seen
        .pose
        .and_then(|p| p.joints.get(1))
        .map_or(top, |joint| joint.position);
    let (foot, top) = (skeleton.foot_px, skeleton.image_from_model(&top));
    let mut places: Vec<Point2<f64>> = Vec::with_capacity(PLACES as usize);
    for k in 1..=PLACES {
        let share = f64::from(k) / f64::from(PLACES);
        places.push(foot + LOWER * share * (top - foot));
    }
    // The line from node to node may pass by the trunk; the middle of the outline does not.
    let drawn: Vec<Point2<f64>> = seen.outline.map_or(Vec::new(), |outline| {
        places
            .iter()
            .flat_map(|p| middle(outline, foot.x, p.y))
            .collect()
    });
    median(
        picture,
        skeleton,
        if drawn.is_empty() { &places } else { &drawn },
    )
}

/// The middle of the outline's row at `v_px`, where it is above the foot at `u_px`.
fn middle(outline: &Outline, u_px: f64, v_px: f64) -> Vec<Point2<f64>> {
    if !outline.contains(u_px, v_px) {
        return Vec::new();
    }
    let left = border(outline, u_px, v_px, -1.0);
    let right = border(outline, u_px, v_px, 1.0);
    let mut places = Vec::with_capacity(5);
    for k in 0..5 {
        let share = 0.5 + MIDDLE * (f64::from(k) / 4.0 - 0.5);
        places.push(Point2::new(left + (right - left) * share, v_px));
    }
    places
}

/// The first place in steps of `step_px` from a place in the outline that is outside of it, px.
fn border(outline: &Outline, u_px: f64, v_px: f64, step_px: f64) -> f64 {
    let mut u = u_px + step_px;
    let mut steps = 1;
    while outline.contains(u, v_px) {
        steps += 1;
        u = u_px + step_px * f64::from(steps);
    }
    u
}

fn median(picture: &Rgb, skeleton: &Skeleton, places: &[Point2<f64>]) -> Option<[u8; 3]> {
    let scale = f64::from(picture.size.width) / f64::from(skeleton.image_size.width.max(1));
    let mut channels: [Vec<u8>; 3] = Default::default();
    for at in places.iter().map(|p| (p * scale).map(f64::round)) {
        if picture.size.contains(at) {
            let colour = picture.at(at.x.max(0.0) as u32, at.y.max(0.0) as u32);
            for (channel, value) in channels.iter_mut().zip(colour) {
                channel.push(value);
            }
        }
    }
    let mut medians = [0; 3];
    for (median, channel) in medians.iter_mut().zip(&mut channels) {
        channel.sort_unstable();
        *median = *channel.get(channel.len() / 2)?;
    }
    Some(medians)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, Size};

    /// A trunk of radius 12 px, striped along, in light that falls off, before a bright sky.
    fn filmed() -> Rgb {
        let size = Size::new(120, 100);
        let mut pixels = Vec::new();
        for v in 0..size.height {
            for u in 0..size.width {
                let off = f64::from(u) - 60.0;
                let stripe = if u % 4 < 2 { 20.0 } else { 0.0 };
                let light = 90.0 + stripe + 2.0 * off + 0.3 * f64::from(v);
                let [r, g, b] = if off.abs() < 12.5 {
                    [light, 0.8 * light, 0.6 * light]
                } else {
                    [200.0, 210.0, 250.0]
                };
                pixels.extend([r as u8, g as u8, b as u8]);
            }
        }
        Rgb { size, pixels }
    }

    fn trunk(radius: f64) -> Skeleton {
        let mut nodes = Vec::new();
        for (i, y) in (0..).zip([0.0, 60.0]) {
            nodes.push(Node {
                radius,
                ..Node::made_up(i, i.checked_sub(1), [0.0, y, 0.0])
            });
        }
        Skeleton {
            nodes,
            foot_px: Point2::new(60.0, 90.0),
            image_size: Size::new(120, 100),
        }
    }

    #[test]
    fn a_tile_has_the_trunk_s_colour_and_grain_and_no_seam() {
        let picture = filmed();
        let seen = Seen {
            picture: Some(&picture),
            ..Seen::default()
        };
        let colour = [100, 80, 60];
        let png = tile(&seen, &trunk(12.0), colour).expect("a tile");
        let tile = image::load_from_memory(&png)
            .expect("a picture")
            .into_rgb8();
        let side = tile.width();
        assert_eq!((side, tile.height()), (2 * PATCH, 2 * PATCH));
        let mut sums = [0.0; 3];
        for (x, y, pixel) in tile.enumerate_pixels() {
            let other = tile.get_pixel(side - 1 - x, side - 1 - y);
            assert_eq!(pixel, other, "mirrored");
            for (sum, c) in sums.iter_mut().zip(pixel.0) {
                *sum += f64::from(c) / f64::from(side * side);
            }
        }
        for (mean, c) in sums.iter().zip(colour) {
            assert!((mean - f64::from(c)).abs() < 4.0, "{sums:?}");
        }
        let row: Vec<u8> = (0..PATCH).map(|x| tile.get_pixel(x, 9).0[0]).collect();
        let [least, most] = [row.iter().min(), row.iter().max()].map(|x| *x.expect("texels"));
        assert!((8..60).contains(&(most - least)), "stripes: {row:?}");
    }

    #[test]
    fn a_trunk_that_shows_no_bark_has_no_tile() {
        let picture = filmed();
        let seen = Seen {
            picture: Some(&picture),
            ..Seen::default()
        };
        assert!(tile(&seen, &trunk(2.0), [9; 3]).is_none(), "too thin");
        assert!(
            tile(&seen, &trunk(90.0), [9; 3]).is_none(),
            "off the picture"
        );
        assert!(tile(&Seen::default(), &trunk(12.0), [9; 3]).is_none());
    }
}
