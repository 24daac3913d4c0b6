//! What in the outline is tree, and what of that is leaf, by colour.
//!
//! An outline as a person draws it holds sky, walls and lawn between the branches. Those colours
//! are also found just outside, at the same height; the tree's are not. With h_in and h_out the
//! shares of a colour among the pixels inside and near outside, and k the share of the inside that
//! is background, k h_out of h_in is background.

use super::canvas::Canvas;

/// Steps of each channel in a histogram of colours.
const STEPS: usize = 16;
/// Heights at which the background is learned anew: sky above, a lawn below.
const BANDS: usize = 7;
/// The background is learned from so near to the outline, as a share of the tree's height: what is
/// farther is another thing.
const REACH: f64 = 0.25;
/// Nearer than this to the outline, in cells, a leaf may still stand out of it.
const BORDER: f32 = 2.0;
/// Background colours inside are not spread just as outside; so many times their share counts as
/// background still.
const MARGIN: f64 = 1.5;
/// The least part of the inside that is taken for background: outlines are drawn around trees, not
/// on them.
const LEAST_BACKGROUND: f64 = 0.05;
/// Bark is learned below this share of the tree's height, and looked for above it.
const BARK_SHARE: f64 = 0.25;
/// Where more than this share of the crown has the bark's colours, bark and leaf cannot be told
/// apart by them.
const MOST_BARK: f64 = 0.5;

/// For every cell how much of it is tree, and how much leaf, 0 to 1.
pub(super) struct Shares {
    pub tree: Vec<f32>,
    pub leaf: Vec<f32>,
    /// Outside of the outline and near to it: what is seen there is no leaf.
    pub beside: Vec<bool>,
}

/// Tells tree and leaf apart from all else in the picture.
pub(super) fn shares(canvas: &Canvas) -> Shares {
    let bins: Vec<u16> = canvas.colours.iter().map(|c| bin(*c)).collect();
    let beside = beside(canvas);
    let tree = match &canvas.matte {
        Some(matte) => matte.clone(),
        None => tree(canvas, &bins, &beside),
    };
    let leaf = leaf(canvas, &bins, &tree);
    Shares { tree, leaf, beside }
}

fn beside(canvas: &Canvas) -> Vec<bool> {
    let (top, bottom) = canvas.rows();
    let reach = REACH * (bottom + 1 - top) as f64;
    distance_outside(&canvas.inside, canvas.grid.size.width as usize)
        .iter()
        .map(|&away| away > BORDER && f64::from(away) < reach)
        .collect()
}

fn bin(colour: [u8; 3]) -> u16 {
    let [r, g, b] = colour.map(|c| usize::from(c) * STEPS / 256);
    ((r * STEPS + g) * STEPS + b) as u16
}

fn tree(canvas: &Canvas, bins: &[u16], beside: &[bool]) -> Vec<f32> {
    let width = canvas.grid.size.width as usize;
    let (top, bottom) = canvas.rows();
    let height = (bottom + 1 - top) as f64;
    let step = height / (BANDS - 1) as f64;
    let mut share = vec![0.0f32; bins.len()];
    for k in 0..BANDS {
        let band = Band {
            middle: top as f64 + step * k as f64,
            step,
        };
        let (mut inside, mut outside) = (Histogram::default(), Histogram::default());
        for (i, &bin) in bins.iter().enumerate() {
            let weight = band.weight(i / width, 1.5);
            if weight > 0.0 && canvas.inside[i] {
                inside.add(bin, weight);
            } else if weight > 0.0 && beside[i] {
                outside.add(bin, weight);
            }
        }
        let background = inside.share_made_of(&outside, LEAST_BACKGROUND);
        for (i, &bin) in bins.iter().enumerate().filter(|(i, _)| canvas.inside[*i]) {
            // Bands pass into each other; above the first and below the last there is nothing
            // inside.
            let weight = band.weight(i / width, 1.0);
            if weight > 0.0 {
                share[i] += (weight * (1.0 - background.at(bin))) as f32;
            }
        }
    }
    // What is half one and half the other is mostly a colour that both have.
    share.iter().map(|&p| smooth_step(0.2, 0.8, p)).collect()
}

/// Heights of which the background is learned together, rows.
struct Band {
    middle: f64,
    /// To the next band.
    step: f64,
}

impl Band {
    /// How much row `v` belongs to it, 0 to 1: nothing farther than `reach` steps from its middle.
    fn weight(&self, v: usize, reach: f64) -> f64 {
        (1.0 - (v as f64 - self.middle).abs() / (reach * self.step)).max(0.0)
    }
}

/// Tree that has not the trunk's colours.
fn leaf(canvas: &Canvas, bins: &[u16], tree: &[f32]) -> Vec<f32> {
    let width = canvas.grid.size.width as usize;
    let (top, bottom) = canvas.rows();
    let limit = bottom as f64 - BARK_SHARE * (bottom + 1 - top) as f64;
    let (mut crown, mut trunk) = (Histogram::default(), Histogram::default());
    for (i, &bin) in bins.iter().enumerate().filter(|(i, _)| tree[*i] > 0.5) {
        let part = if (i / width) as f64 > limit {
            &mut trunk
        } else {
            &mut crown
        };
        part.add(bin, f64::from(tree[i]));
    }
    let bark = crown.share_made_of(&trunk, 0.0);
    if bark.amount > MOST_BARK {
        return tree.to_vec();
    }
    bins.iter()
        .zip(tree)
        .map(|(&bin, &tree)| tree * (1.0 - bark.at(bin) as f32))
        .collect()
}

pub(super) fn smooth_step(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// How often each colour is there.
struct Histogram {
    counts: Vec<f64>,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            counts: vec![0.0; STEPS * STEPS * STEPS],
        }
    }
}

/// How much of each colour of one region is owed to another.
struct Made {
    /// Of all the region.
    amount: f64,
    of_colour: Vec<f64>,
}

impl Made {
    fn at(&self, bin: u16) -> f64 {
        self.of_colour[usize::from(bin)]
    }
}

impl Histogram {
    fn add(&mut self, bin: u16, weight: f64) {
        self.counts[usize::from(bin)] += weight;
    }

    /// Shares of the colours, smoothed by a step to either side: a few thousand pixels cannot fill
    /// 4096 bins.
    fn smoothed(&self) -> Vec<f64> {
        const KERNEL: [f64; 5] = [0.0545, 0.2442, 0.4026, 0.2442, 0.0545];
        let mut values = self.counts.clone();
        for stride in [1, STEPS, STEPS * STEPS] {
            let before = values.clone();
            for (i, value) in values.iter_mut().enumerate() {
                let at = (i / stride) % STEPS;
                *value = 0.0;
                for (k, weight) in KERNEL.iter().enumerate() {
                    let to = (at + k).saturating_sub(2).min(STEPS - 1);
                    *value += before[i - at * stride + to * stride] * weight;
                }
            }
        }
        let sum: f64 = values.iter().sum();
        values
            .iter_mut()
            .for_each(|v| *v /= sum.max(f64::MIN_POSITIVE));
        values
    }

    /// How much of this region could be more of `other`: in a colour that only `other` has here,
    /// all of it. The amount is the median, over the pixels of `other`, of how much rarer their
    /// colour is here.
    fn share_made_of(&self, other: &Histogram, least: f64) -> Made {
        if other.counts.iter().all(|&c| c <= 0.0) || self.counts.iter().all(|&c| c <= 0.0) {
            return Made {
                amount: 0.0,
                of_colour: vec![0.0; self.counts.len()],
            };
        }
        let (own, other) = (self.smoothed(), other.smoothed());
        let mut ratios: Vec<(f64, f64)> = own
            .iter()
            .zip(&other)
            .filter(|(_, o)| **o > 0.0)
            .map(|(h, o)| ((h / o).min(1.0), *o))
            .collect();
        ratios.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut before = 0.0;
        let middle = ratios.iter().find(|(_, weight)| {
            before += weight;
            before >= 0.5
        });
        let amount = middle.map_or(0.0, |(ratio, _)| *ratio);
        let take = MARGIN * amount.max(least);
        let of_colour = own
            .iter()
            .zip(&other)
            .map(|(h, o)| (take * o / h.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0))
            .collect();
        Made { amount, of_colour }
    }
}

/// Way of every cell to the inside, in cells (chamfer 3-4, Borgefors 1986).
fn distance_outside(inside: &[bool], width: usize) -> Vec<f32> {
    let mut way: Vec<f32> = inside.iter().map(|&m| if m { 0.0 } else { 1e9 }).collect();
    for i in 0..way.len() {
        way[i] = shortest_behind(&way, width, i);
    }
    // From the last cell to the first the same is at work with all directions turned round.
    way.reverse();
    for i in 0..way.len() {
        way[i] = shortest_behind(&way, width, i);
    }
    way.reverse();
    way
}

/// The way from cell `i`, its own or by one of the four neighbours that come before it.
fn shortest_behind(way: &[f32], width: usize, i: usize) -> f32 {
    const DIAGONAL: f32 = 4.0 / 3.0;
    let (u, has_row_before) = (i % width, i >= width);
    let mut shortest = way[i];
    if u > 0 {
        shortest = shortest.min(way[i - 1] + 1.0);
    }
    if has_row_before {
        shortest = shortest.min(way[i - width] + 1.0);
    }
    if has_row_before && u > 0 {
        shortest = shortest.min(way[i - width - 1] + DIAGONAL);
    }
    if has_row_before && u + 1 < width {
        shortest = shortest.min(way[i - width + 1] + DIAGONAL);
    }
    shortest
}
