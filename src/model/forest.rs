//! Many trees on a plot of ground, of a few templates.

use super::Size;
use nalgebra::{Point2, Point3};

/// Highest value of [`Ground::heights`].
const HIGHEST: f64 = u16::MAX as f64;

/// A plot of ground, with the middle at the origin: x right, y up, z towards the viewer.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Along x, m; above 0.
    pub width_m: f64,
    /// Along z, m; above 0.
    pub depth_m: f64,
    /// From the lowest value that a height can have to the highest, m.
    pub relief_m: f64,
    /// Samples along x and along z, each 1 or more; the outermost ones lie on the border.
    pub samples: Size,
    /// Row by row, the farthest row (lowest z) first; 0 is height 0, 65535 is `relief_m`.
    pub heights: Vec<u16>,
}

impl Ground {
    /// Level ground at height 0.
    pub fn flat(width_m: f64, depth_m: f64) -> Self {
        Self {
            width_m,
            depth_m,
            relief_m: 0.0,
            samples: Size::new(1, 1),
            heights: vec![0],
        }
    }

    /// Whether all of it has one height.
    pub fn is_flat(&self) -> bool {
        self.relief_m == 0.0 || self.heights.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// The height at a place (x, z), m, bilinear between the samples; beyond the border that of the
    /// border.
    pub fn height_m(&self, at: Point2<f64>) -> f64 {
        let across = Between::of(at.x / self.width_m + 0.5, self.samples.width);
        let along = Between::of(at.y / self.depth_m + 0.5, self.samples.height);
        let [far, near] = [along.first, along.second].map(|row| {
            let [left, right] =
                [across.first, across.second].map(|column| self.sample(column, row));
            left + (right - left) * across.share
        });
        (far + (near - far) * along.share) / HIGHEST * self.relief_m
    }

    /// The sample in a column and a row; 0 where there is none.
    fn sample(&self, column: usize, row: usize) -> f64 {
        let at = row * self.samples.width as usize + column;
        self.heights.get(at).copied().map_or(0.0, f64::from)
    }
}

/// Two neighbouring samples, and how much of the way from the first to the second is gone.
struct Between {
    first: usize,
    second: usize,
    share: f64,
}

impl Between {
    /// At `share` (0 to 1) of the way from the first of `samples` to the last.
    fn of(share: f64, samples: u32) -> Self {
        let last = samples.saturating_sub(1) as usize;
        let at = share.clamp(0.0, 1.0) * last as f64;
        let first = (at as usize).min(last);
        Self {
            first,
            second: (first + 1).min(last),
            share: at - first as f64,
        }
    }
}

/// One tree of a forest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForestTree {
    /// Which of the templates it is, from 0.
    pub template: usize,
    /// Its foot, m.
    pub foot: Point3<f64>,
    /// About its axis, counter-clockwise seen from above, rad.
    pub turn_rad: f64,
    /// How many times as large as its template it is.
    pub scale: f64,
    /// How many quarters of its loop its motion is ahead of that of its template, 0 to 3.
    pub ahead: u8,
}

/// Trees of a few templates on a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Forest {
    pub trees: Vec<ForestTree>,
    pub ground: Ground,
    /// Metres in a pixel of the templates; above 0.
    pub metres_per_px: f64,
}

impl Forest {
    /// How far ahead a tree's motion may be of its template's, in steps of an equal part of the
    /// loop: neighbours of one template do not sway in step.
    pub const STEPS_AHEAD: u8 = 4;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_those_of_the_samples_and_lie_evenly_between_them() {
        let ground = Ground {
            width_m: 20.0,
            depth_m: 10.0,
            relief_m: 6.5535,
            samples: Size::new(3, 2),
            heights: vec![0, 10_000, 20_000, 30_000, 40_000, 50_000],
        };
        for (x, z, height_m) in [
            (-10.0, -5.0, 0.0),
            (10.0, -5.0, 2.0),
            (-10.0, 5.0, 3.0),
            (0.0, 5.0, 4.0),
            (5.0, 0.0, 3.0),
            (99.0, 99.0, 5.0),
        ] {
            let found = ground.height_m(Point2::new(x, z));
            assert!((found - height_m).abs() < 1e-9, "{x} {z}: {found}");
        }
        assert!(!ground.is_flat());
        let flat = Ground::flat(3.0, 4.0);
        assert!(flat.is_flat());
        assert_eq!(flat.height_m(Point2::new(1.0, 1.0)), 0.0);
    }
}
