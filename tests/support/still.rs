//! A made-up film still of a tree in leaf.
#![allow(dead_code)] // not every test file needs all of it

use super::synthetic;
use arborcam::config::Leaves;
use arborcam::geometry::{Foliage, LeafView, Template, foliage};
use arborcam::model::{Outline, Rgb, Size, Skeleton};
use arborcam::pipeline::leaf_seeds;
use nalgebra::{Point2, Vector2};

/// A made-up film still: a tree before sky and a wall, drawn by code, with what is leaf known for
/// every pixel.
pub struct Still {
    pub skeleton: Skeleton,
    pub picture: Rgb,
    pub outline: Outline,
    /// 1 where the picture shows a leaf, else 0.
    pub leaf: Vec<f32>,
}

pub const SIZE: Size = Size {
    width: 640,
    height: 480,
};

/// Clumps of leaves about the tips of the branches that the front view shows, or none, before sky
/// and a wall.
pub fn still(in_leaf: bool) -> Still {
    still_before(in_leaf, sky_and_wall)
}

fn sky_and_wall(u: usize, v: usize) -> [i32; 3] {
    if u < 300 && v > 200 {
        [142, 84, 66]
    } else {
        [178 + v as i32 / 16, 200, 226]
    }
}

/// The same before something else: its colour at every pixel.
pub fn still_before(in_leaf: bool, backdrop: fn(usize, usize) -> [i32; 3]) -> Still {
    let mut skeleton = synthetic::tree(6, 3);
    (skeleton.foot_px, skeleton.image_size) = ([320.0, 470.0].into(), SIZE);
    for node in &mut skeleton.nodes {
        (node.position, node.radius) = (node.position * 0.8, node.radius * 0.8);
    }
    let (w, h) = (SIZE.width as usize, SIZE.height as usize);
    let mut pixels = vec![[0u8; 3]; w * h];
    for (i, p) in pixels.iter_mut().enumerate() {
        let (u, v) = (i % w, i / w);
        let grain = (8.0 * synthetic::noise(i, 3)) as i32;
        *p = backdrop(u, v).map(|c| (c + grain).clamp(0, 255) as u8);
    }
    let disc = |at: Point2<f64>, r: f64| {
        let (l, t) = ((at.x - r).max(0.0) as usize, (at.y - r).max(0.0) as usize);
        let (right, bottom) = (
            ((at.x + r) as usize + 1).min(w),
            ((at.y + r) as usize + 1).min(h),
        );
        let cells = (t..bottom).flat_map(move |v| (l..right).map(move |u| (u, v)));
        cells
            .filter(move |(u, v)| (*u as f64 - at.x).hypot(*v as f64 - at.y) <= r)
            .map(move |(u, v)| v * w + u)
    };
    let measured = skeleton.measured();
    let mut outside = vec![true; w * h];
    for node in &skeleton.nodes[1..measured] {
        let (from, to) = (&skeleton.nodes[node.parent.unwrap().index()], node);
        for k in 0..=60 {
            let at = from.position + (to.position - from.position) * (k as f64 / 60.0);
            let at = skeleton.image_from_model(&at);
            disc(at, (0.7 * node.radius).max(0.7)).for_each(|i| pixels[i] = [96, 80, 68]);
            disc(at, 22.0).for_each(|i| outside[i] = false);
        }
    }
    let mut leaf = vec![0.0; w * h];
    for (k, node) in skeleton.nodes[..measured]
        .iter()
        .enumerate()
        .filter(|(_, n)| in_leaf && n.level >= 5)
    {
        for j in 0..30 {
            let off = Vector2::new(
                16.0 * synthetic::noise(k, j),
                16.0 * synthetic::noise(k, j + 50),
            );
            let at = skeleton.image_from_model(&node.position);
            let shade = 1.0 + 0.45 * synthetic::noise(k, j + 90);
            let colour = [70.0, 110.0, 40.0].map(|c: f64| (c * shade) as u8);
            disc(at + off, 5.0).for_each(|i| {
                (pixels[i], leaf[i]) = (colour, 1.0);
                outside[i] = false;
            });
        }
    }
    let mask = outside.iter().map(|&o| if o { 0 } else { 255 }).collect();
    let outline = Outline {
        size: SIZE,
        mask,
        polygon_px: Vec::new(),
        matte: None,
        other_foot_px: None,
    };
    Still {
        skeleton,
        picture: Rgb {
            size: SIZE,
            pixels: pixels.concat(),
        },
        outline,
        leaf,
    }
}

impl Still {
    pub fn view<'a>(&'a self, seeds: &'a [Point2<f32>]) -> LeafView<'a> {
        LeafView {
            picture: Some(&self.picture),
            outline: Some(&self.outline),
            seeds,
            ..LeafView::default()
        }
    }

    pub fn seeds(&self, settings: &Leaves) -> Vec<Point2<f32>> {
        leaf_seeds(&self.picture, &self.outline, settings.seeds)
    }

    pub fn leaves(&self, settings: &Leaves) -> Foliage {
        let seeds = self.seeds(settings);
        foliage(
            &synthetic::limbs_of(&self.skeleton, &synthetic::bare()),
            &self.skeleton,
            &self.view(&seeds),
            &Template::ours(),
            settings,
            0,
        )
    }
}
