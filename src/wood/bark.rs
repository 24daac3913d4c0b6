//! The bark of the filmed trunk: the picture is projected on the trunk, which is unrolled, as far as
//! it is seen, to a tile that repeats without a seam.

use crate::model::{BranchGraph, Luma, Masks, Rgb, Size, WoodNode};
use crate::signal::statistics::quantile;
use nalgebra::{Point2, Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// Bark is looked for on the trunk, and on the limbs in which it goes on as far as they have this
/// share of its radius: the bark of thin twigs is another.
const LIMB_SHARE: f64 = 0.5;
/// Of the radii on the way from the foot to a tip, the trunk has this quantile: the widest ones are
/// those of its foot and of forks.
const TRUNK_QUANTILE: f64 = 0.8;
/// So many girths of the limb are looked at, from the foot up: the tile is half of one, and the best
/// seen is taken.
const GIRTHS: f64 = 1.5;
/// From section to section along the trunk, px.
const STEP_PX: f64 = 1.0;
/// The width that is seen is looked for in such steps, px.
const EDGE_STEP_PX: f64 = 0.25;
/// A section that is wider than so many traced radii to one side goes through a fork.
const WIDEST_RADII: f64 = 1.6;
/// Half of the visible angle about the limb that is taken, radians: nearer to its edges bark is
/// seen too flat, and what is behind mixes in.
const SEEN_HALF: f64 = 1.0;
/// Places across a section at which its colour is read.
const PLACES_ACROSS: u32 = 9;
/// Fewer sections than this show no wood.
const LEAST_SECTIONS: usize = 8;
/// Pixels across a trunk from which on it shows bark and not only a colour.
const LEAST_ACROSS_PX: f64 = 8.0;
/// Share of the patch that must be seen; what is not gets the mean colour.
const LEAST_SEEN: f64 = 0.6;
/// Side of the patch that is unrolled, texels; the tile is that and its mirror images.
const PATCH: u32 = 64;
/// Share of the texels that are taken for another thing than bark, at either end of brightness.
const STANDS_OUT: f64 = 0.05;

/// The bark that the picture of `rest` shows where `mask` is wood ([`Masks::wood`]), as a tile that
/// repeats without a seam: once round a limb, and as far along it as it is round. Its mean colour
/// (sRGB) is that of the filmed trunk. It is one texel where the trunk is too thin to show more than
/// a colour; `None` where no trunk is seen.
pub(super) fn tile(rest: &Rgb, mask: &Luma, branches: &BranchGraph) -> Option<Rgb> {
    let filmed = Filmed { rest, mask };
    let sections = lowest(filmed.sections(&trunk(branches)));
    let seen: Vec<Section> = sections.iter().copied().flatten().collect();
    if seen.len() < LEAST_SECTIONS {
        return None;
    }
    let mean = filmed.mean_colour(&seen)?;
    let across_px = quantile(seen.iter().map(|s| 2.0 * s.radius_px).collect(), 0.5)?;
    let patch = (across_px >= LEAST_ACROSS_PX).then(|| filmed.patch(&sections));
    Some(match patch.flatten() {
        Some(patch) => mirrored(&patch, mean),
        None => Rgb {
            size: Size::new(1, 1),
            pixels: mean.iter().map(|c| c.round() as u8).collect(),
        },
    })
}

/// The lowest sections, as many as the limb is round [`GIRTHS`] times where so many are seen: higher
/// up leaves and their shade come before the bark.
fn lowest(mut sections: Vec<Option<Section>>) -> Vec<Option<Section>> {
    let radii = sections.iter().flatten().map(|s| s.radius_px).collect();
    let wanted_px = GIRTHS * TAU * quantile(radii, 0.5).unwrap_or(0.0);
    let mut seen_px = 0.0;
    let end = sections.iter().position(|section| {
        seen_px += if section.is_some() { STEP_PX } else { 0.0 };
        seen_px > wanted_px
    });
    sections.truncate(end.unwrap_or(sections.len()));
    sections
}

/// The nodes from the foot to a tip, at every fork along the branch that carries most: nothing else
/// is as sure where stubs and knots are traced beside a trunk.
fn trunk(branches: &BranchGraph) -> Vec<&WoodNode> {
    let carried = areas_px(branches);
    let children = branches.children();
    let mut way: Vec<&WoodNode> = branches.nodes.first().into_iter().collect();
    let mut at = 0;
    loop {
        let next = children.get(at).into_iter().flatten().copied();
        let Some(next) = next.max_by(|a, b| carried[*a].total_cmp(&carried[*b])) else {
            return way;
        };
        way.push(&branches.nodes[next]);
        at = next;
    }
}

/// The area of the piece that ends in each node and of all that it carries, px².
fn areas_px(branches: &BranchGraph) -> Vec<f64> {
    let mut areas = vec![0.0; branches.nodes.len()];
    for (k, node) in branches.nodes.iter().enumerate().rev() {
        let Some(parent) = node.parent else { continue };
        let way = node.position_px - branches.nodes[parent].position_px;
        areas[k] += 2.0 * node.radius_px * way.norm();
        areas[parent] += areas[k];
    }
    areas
}

/// A limb cut across in the picture: it is seen from one edge to the other.
#[derive(Clone, Copy, Debug)]
struct Section {
    middle_px: Point2<f64>,
    /// Across the limb, of length 1.
    across: Vector2<f64>,
    /// Half of the width that is seen, px.
    radius_px: f64,
}

impl Section {
    /// The place that is seen at an angle about the limb, 0 towards the viewer, px.
    fn at(&self, angle: f64) -> Point2<f64> {
        self.middle_px + self.across * (self.radius_px * angle.sin())
    }

    /// Where column `column` of the patch lies, px.
    fn at_column(&self, column: u32) -> Point2<f64> {
        let share = (f64::from(column) + 0.5) / f64::from(PATCH);
        self.at(SEEN_HALF * (2.0 * share - 1.0))
    }
}

/// The tree at rest and which of its pixels are wood.
struct Filmed<'a> {
    rest: &'a Rgb,
    mask: &'a Luma,
}

impl Filmed<'_> {
    /// Sections of a limb in steps of [`STEP_PX`] as far as it is wide; `None` where one edge is
    /// not seen, or another limb is joined.
    fn sections(&self, way: &[&WoodNode]) -> Vec<Option<Section>> {
        let radii = way.iter().map(|node| node.radius_px).collect();
        let trunk_px = quantile(radii, TRUNK_QUANTILE).unwrap_or(0.0);
        let mut sections = Vec::new();
        for pair in way.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            // Nor where the foot was put or a line enters: there its radius is not seen.
            if to.radius_px < LIMB_SHARE * trunk_px {
                continue;
            }
            let step = to.position_px - from.position_px;
            let Some(along) = step.try_normalize(1e-9) else {
                continue;
            };
            let count = (step.norm() / STEP_PX).ceil().max(1.0) as u32;
            for k in 0..count {
                let share = f64::from(k) / f64::from(count);
                sections.push(self.section(Section {
                    middle_px: from.position_px + step * share,
                    across: Vector2::new(-along.y, along.x),
                    radius_px: to.radius_px,
                }));
            }
        }
        sections
    }

    /// A traced section from edge to edge of the wood.
    fn section(&self, traced: Section) -> Option<Section> {
        let most_px = WIDEST_RADII * traced.radius_px;
        let right_px = self.edge_px(&traced, 1.0, most_px)?;
        let left_px = self.edge_px(&traced, -1.0, most_px)?;
        Some(Section {
            middle_px: traced.middle_px + traced.across * (0.5 * (right_px - left_px)),
            radius_px: 0.5 * (right_px + left_px),
            ..traced
        })
    }

    /// How far the wood goes to one side of a section, px; `None` where that is farther than
    /// `most_px`, or nothing.
    fn edge_px(&self, traced: &Section, side: f64, most_px: f64) -> Option<f64> {
        let mut px = 0.0;
        while self.is_wood(traced.middle_px + traced.across * (side * px)) {
            px += EDGE_STEP_PX;
            if px > most_px {
                return None;
            }
        }
        (px > 0.0).then_some(px)
    }

    fn is_wood(&self, at_px: Point2<f64>) -> bool {
        let at = at_px.map(f64::round);
        let size = self.mask.size;
        if at.x < 0.0 || at.y < 0.0 || !size.contains(at) {
            return false;
        }
        let i = at.y as usize * size.width as usize + at.x as usize;
        self.mask
            .pixels
            .get(i)
            .is_some_and(|m| *m > Masks::MOST_OUTSIDE)
    }

    /// Colour between pixels; `None` off the wood.
    fn colour(&self, at_px: Point2<f64>) -> Option<Vector3<f64>> {
        let corner = at_px.map(f64::floor);
        let mut pixels = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].into_iter();
        let is_on_wood = pixels.all(|[du, dv]| self.is_wood(corner + Vector2::new(du, dv)));
        self.rest.interpolated(at_px).filter(|_| is_on_wood)
    }

    /// Mean colour of the sections (sRGB, 0 to 255); `None` where they show nothing.
    fn mean_colour(&self, sections: &[Section]) -> Option<Vector3<f64>> {
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for section in sections {
            for k in 0..PLACES_ACROSS {
                let share = (f64::from(k) + 0.5) / f64::from(PLACES_ACROSS);
                let at = section.at(SEEN_HALF * (2.0 * share - 1.0));
                let Some(colour) = self.colour(at) else {
                    continue;
                };
                count += 1.0;
                sum += colour;
            }
        }
        (count > 0.0).then(|| sum / count)
    }

    /// The best stretch of the limb unrolled, half as long as the limb is round if there is as much
    /// of it: for each channel by how much every texel is brighter than those around it. `None`
    /// where too little of it is seen.
    fn patch(&self, sections: &[Option<Section>]) -> Option<[Vec<f64>; 3]> {
        let mut channels: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::new());
        let mut n_seen = 0.0;
        for section in best_rows(sections)? {
            for column in 0..PATCH {
                let texel = section.and_then(|s| self.colour(s.at_column(column)));
                n_seen += f64::from(u8::from(texel.is_some()));
                for (k, channel) in channels.iter_mut().enumerate() {
                    channel.push(texel.map_or(f64::NAN, |rgb| rgb[k]));
                }
            }
        }
        if n_seen < LEAST_SEEN * f64::from(PATCH * PATCH) {
            return None;
        }
        channels.iter_mut().for_each(|channel| flatten(channel));
        Some(channels)
    }
}

/// The sections of the rows of the patch, the lowest on the limb last: of all stretches that are half
/// as long as the limb is round the one that is seen best, or all where there is less.
fn best_rows(sections: &[Option<Section>]) -> Option<Vec<Option<Section>>> {
    let radii = sections.iter().flatten().map(|s| s.radius_px).collect();
    let wanted_px = PI * quantile(radii, 0.5)?;
    let length = ((wanted_px / STEP_PX).round() as usize).clamp(1, sections.len());
    let (mut best, mut most) = (0, 0);
    for (from, stretch) in sections.windows(length).enumerate() {
        let seen = stretch.iter().flatten().count();
        if seen > most {
            (best, most) = (from, seen);
        }
    }
    let rows = (0..PATCH as usize).rev();
    let rows = rows.map(|k| sections[best + k * length / PATCH as usize]);
    Some(rows.collect())
}

/// Divides every texel by the mean of those around it, so that what is left is bark and not light,
/// and every row by its mean, or what crosses the whole trunk would be rings on every limb; and
/// takes off what stands out: a rope, a leaf. The mean is 1, and so is what was not seen.
fn flatten(patch: &mut [f64]) {
    let around = local_means(patch);
    for (x, mean) in patch.iter_mut().zip(around) {
        *x = if x.is_nan() { 1.0 } else { *x / mean.max(1.0) };
    }
    for row in patch.chunks_exact_mut(PATCH as usize) {
        divide_by_mean(row);
    }
    let ends = [STANDS_OUT, 1.0 - STANDS_OUT].map(|share| quantile(patch.to_vec(), share));
    if let [Some(darkest), Some(brightest)] = ends {
        patch
            .iter_mut()
            .for_each(|x| *x = x.clamp(darkest, brightest));
    }
    divide_by_mean(patch);
}

fn divide_by_mean(values: &mut [f64]) {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter_mut().for_each(|x| *x /= mean.max(1e-3));
}

/// Means over squares about every texel, which end at the patch's border, of what is seen there.
fn local_means(patch: &[f64]) -> Vec<f64> {
    let side = PATCH as usize;
    let reach = side / 6;
    let mut means = Vec::with_capacity(patch.len());
    for row in 0..side {
        for column in 0..side {
            let rows = row.saturating_sub(reach)..(row + reach + 1).min(side);
            let columns = column.saturating_sub(reach)..(column + reach + 1).min(side);
            let (mut sum, mut count) = (0.0, 0.0_f64);
            for row in rows {
                let texels = &patch[row * side..][columns.clone()];
                for texel in texels.iter().filter(|x| !x.is_nan()) {
                    sum += texel;
                    count += 1.0;
                }
            }
            means.push(sum / count.max(1.0));
        }
    }
    means
}

/// The patch in a colour, beside its mirror images: the tile ends as it begins in both directions.
fn mirrored(patch: &[Vec<f64>; 3], mean: Vector3<f64>) -> Rgb {
    let side = 2 * PATCH;
    let mut pixels = Vec::with_capacity(3 * (side * side) as usize);
    for y in 0..side {
        for x in 0..side {
            let [row, column] = [y, x].map(|k| if k < PATCH { k } else { side - 1 - k });
            let at = (row * PATCH + column) as usize;
            for (channel, mean) in patch.iter().zip(&mean) {
                pixels.push((mean * channel[at]).round().clamp(0.0, 255.0) as u8);
            }
        }
    }
    Rgb {
        size: Size::new(side, side),
        pixels,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 160,
        height: 160,
    };

    /// Half of the trunk's width at a row, and whether a pixel is of it: it leans by a fifth.
    fn off_px(u: u32, v: u32) -> f64 {
        f64::from(u) - middle_px(f64::from(v))
    }

    fn middle_px(v: f64) -> f64 {
        80.0 + 0.2 * (150.0 - v)
    }

    /// A brown trunk that leans and is striped along, in light that falls off around it, before a
    /// bright sky. Leaves of another colour hang before it where `leaf` says, and are no wood.
    fn filmed(radius_px: f64, has_leaves: bool) -> (Rgb, Luma) {
        let (mut pixels, mut mask) = (Vec::new(), Vec::new());
        for v in 0..SIZE.height {
            for u in 0..SIZE.width {
                let off = off_px(u, v);
                let is_leaf = has_leaves && v % 40 < 6;
                let is_wood = off.abs() <= radius_px && v <= 150 && !is_leaf;
                let stripe = if (off / 3.0).floor() % 2.0 == 0.0 {
                    16.0
                } else {
                    0.0
                };
                let light = 110.0 + stripe + off;
                pixels.extend(match (is_leaf, is_wood) {
                    (true, _) => [20, 200, 20],
                    (_, true) => [light, 0.8 * light, 0.6 * light].map(|c| c as u8),
                    _ => [200, 215, 250],
                });
                mask.push(if is_wood { 255 } else { 0 });
            }
        }
        let rest = Rgb { size: SIZE, pixels };
        (
            rest,
            Luma {
                size: SIZE,
                pixels: mask,
            },
        )
    }

    fn traced(radius_px: f64) -> BranchGraph {
        let mut nodes = Vec::new();
        for k in 0..8_u32 {
            let v = 150.0 - 18.0 * f64::from(k);
            nodes.push(WoodNode {
                parent: (k as usize).checked_sub(1),
                // Not quite on the middle, as a traced line may be.
                position_px: Point2::new(middle_px(v) + 1.0, v),
                radius_px,
            });
        }
        // A twig in other light, which is no trunk.
        nodes.push(WoodNode {
            parent: Some(3),
            position_px: Point2::new(20.0, 40.0),
            radius_px: 1.0,
        });
        BranchGraph { nodes }
    }

    /// Mean colour of the pixels of wood (sRGB).
    fn mean_of_wood(rest: &Rgb, mask: &Luma) -> [f64; 3] {
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for (rgb, _) in rest
            .pixels
            .chunks_exact(3)
            .zip(&mask.pixels)
            .filter(|(_, m)| **m != 0)
        {
            count += 1.0;
            (0..3).for_each(|k| sum[k] += f64::from(rgb[k]));
        }
        sum.map(|s| s / count)
    }

    fn mean_of(tile: &Rgb) -> [f64; 3] {
        let whole = Luma {
            size: tile.size,
            pixels: vec![255; tile.size.area()],
        };
        mean_of_wood(tile, &whole)
    }

    /// Whatever hangs before it, and however it leans.
    #[test]
    fn a_tile_has_the_colour_of_the_filmed_wood() {
        for [radius_px, has_leaves] in [[14.0, 0.0], [14.0, 1.0], [6.0, 1.0], [2.5, 0.0]] {
            let (rest, mask) = filmed(radius_px, has_leaves > 0.0);
            let tile = tile(&rest, &mask, &traced(radius_px)).expect("bark");
            let (found, wanted) = (mean_of(&tile), mean_of_wood(&rest, &mask));
            for (found, wanted) in found.iter().zip(wanted) {
                assert!(
                    (found - wanted).abs() < 3.0,
                    "{radius_px} px: {found} of {wanted}"
                );
            }
            let is_grained = tile.size.width > 1;
            assert_eq!(
                is_grained,
                2.0 * radius_px >= LEAST_ACROSS_PX,
                "{radius_px} px"
            );
        }
    }

    #[test]
    fn a_tile_has_the_grain_of_the_bark_and_no_light_and_no_seam() {
        let (rest, mask) = filmed(14.0, false);
        let tile = tile(&rest, &mask, &traced(14.0)).expect("bark");
        let side = tile.size.width;
        assert_eq!(tile.size, Size::new(2 * PATCH, 2 * PATCH));
        for k in 0..side {
            assert_eq!(tile.at(0, k), tile.at(side - 1, k), "round the limb");
            assert_eq!(tile.at(k, 0), tile.at(k, side - 1), "along it");
        }
        // Light falls off by 28 levels across the trunk, and a stripe has 16.
        let row: Vec<f64> = (0..PATCH).map(|x| f64::from(tile.at(x, 9)[0])).collect();
        let [left, right] =
            [&row[..20], &row[44..]].map(|r| r.iter().sum::<f64>() / r.len() as f64);
        assert!((left - right).abs() < 6.0, "{left} {right}");
        let least = row.iter().copied().fold(f64::INFINITY, f64::min);
        let most = row.iter().copied().fold(0.0, f64::max);
        assert!((8.0..40.0).contains(&(most - least)), "{row:?}");
    }

    #[test]
    fn where_no_trunk_is_seen_there_is_no_bark() {
        let (rest, mask) = filmed(14.0, false);
        let none = Luma {
            size: SIZE,
            pixels: vec![0; SIZE.area()],
        };
        assert_eq!(tile(&rest, &none, &traced(14.0)), None);
        assert_eq!(tile(&rest, &mask, &BranchGraph::default()), None);
        let all = Luma {
            size: SIZE,
            pixels: vec![255; SIZE.area()],
        };
        assert_eq!(tile(&rest, &all, &traced(14.0)), None, "no edge is seen");
        let mut astray = traced(14.0);
        astray.nodes[1].position_px.x = f64::NAN;
        let _ = tile(&rest, &mask, &astray);
    }
}
