//! What draws the growth of a tree (Tan et al. 2008 sect. 3.2): places in the picture that no branch
//! is near to, and in space the tree itself turned by a quarter about its middle.

use crate::model::Outline;
use nalgebra::{Point2, Point3};

/// Attractors in the picture, about.
const IN_PICTURE: f64 = 300.0;

/// Attractors, and how far each is from the tree. Distances are kept from one growth to the next, as
/// branches are only added (Tan et al. 2008 sect. 3.2, "Speedup").
#[derive(Clone, Debug)]
pub(super) struct Attractors {
    /// Model axes, px; those in the picture have z 0.
    places: Vec<Point3<f32>>,
    nearest_px: Vec<f32>,
    is_flat: bool,
    /// From one to the next in the picture, px.
    pub step_px: f64,
}

impl Attractors {
    /// Evenly over the pixels where the tree is (E2D); the foot is at `foot_px`.
    pub fn in_picture(tree: &Outline, foot_px: Point2<f64>) -> Self {
        let area = tree.mask.iter().filter(|m| **m != 0).count() as f64;
        let step = (area / IN_PICTURE).sqrt().ceil().max(1.0) as u32;
        let mut places = Vec::new();
        for v in (step / 2..tree.size.height).step_by(step as usize) {
            for u in (step / 2..tree.size.width).step_by(step as usize) {
                if tree.has(u, v) {
                    let (x, y) = (f64::from(u) - foot_px.x, foot_px.y - f64::from(v));
                    places.push(Point3::new(x as f32, y as f32, 0.0));
                }
            }
        }
        Self {
            nearest_px: vec![f32::INFINITY; places.len()],
            places,
            is_flat: true,
            step_px: f64::from(step),
        }
    }

    /// Those in space (E3D), none yet.
    pub fn in_space() -> Self {
        Self {
            places: Vec::new(),
            nearest_px: Vec::new(),
            is_flat: false,
            step_px: 0.0,
        }
    }

    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Adds one; `samples` is all of the tree.
    pub fn add(&mut self, place: Point3<f64>, samples: &[Point3<f64>]) {
        let place: Point3<f32> = place.cast();
        let nearest = samples
            .iter()
            .map(|s| (self.seen(s) - place).norm())
            .fold(f32::INFINITY, f32::min);
        self.places.push(place);
        self.nearest_px.push(nearest);
    }

    /// Takes in samples of branches that were added to the tree.
    pub fn take(&mut self, samples: &[Point3<f64>]) {
        for sample in samples {
            let sample = self.seen(sample);
            for (place, nearest) in self.places.iter().zip(&mut self.nearest_px) {
                *nearest = nearest.min((place - sample).norm());
            }
        }
    }

    /// By how much samples would lower the sum of the distances, px.
    pub fn gain(&self, samples: &[Point3<f64>]) -> f64 {
        let mut lower_sq: Vec<f32> = self.nearest_px.iter().map(|d| d * d).collect();
        for sample in samples {
            let sample = self.seen(sample);
            for (place, lower) in self.places.iter().zip(&mut lower_sq) {
                *lower = lower.min((place - sample).norm_squared());
            }
        }
        let pairs = self.nearest_px.iter().zip(&lower_sq);
        pairs.map(|(d, lower)| f64::from(d - lower.sqrt())).sum()
    }

    /// The attractors that are farther from the tree than `least_px`, by their numbers, the farthest first.
    pub fn beyond(&self, least_px: f64) -> Vec<usize> {
        let all = 0..self.places.len();
        let mut far: Vec<usize> = all.filter(|i| self.distance_px(*i) > least_px).collect();
        far.sort_by(|a, b| self.nearest_px[*b].total_cmp(&self.nearest_px[*a]));
        far
    }

    /// How far an attractor is from the tree, px.
    pub fn distance_px(&self, attractor: usize) -> f64 {
        self.nearest_px[attractor].into()
    }

    /// Where an attractor is in the picture, model axes, px.
    pub fn place(&self, attractor: usize) -> Point2<f64> {
        self.places[attractor].cast().xy()
    }

    /// How far the attractors are from the tree, px in their mean.
    pub fn mean_px(&self) -> f64 {
        let sum: f64 = self.nearest_px.iter().map(|d| f64::from(*d)).sum();
        sum / self.nearest_px.len().max(1) as f64
    }

    /// A sample as it is held against the attractors: in the picture it has no depth.
    fn seen(&self, sample: &Point3<f64>) -> Point3<f32> {
        let sample: Point3<f32> = sample.cast();
        match self.is_flat {
            true => Point3::new(sample.x, sample.y, 0.0),
            false => sample,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    #[test]
    fn a_gain_is_what_the_sum_falls_by() {
        let size = Size::new(60, 40);
        let tree = Outline {
            size,
            mask: vec![255; size.area()],
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        };
        let mut flat = Attractors::in_picture(&tree, Point2::new(30.0, 39.0));
        let count = flat.places.len() as f64;
        assert!((200.0..400.0).contains(&count), "{count}");
        flat.take(&[Point3::new(0.0, 5.0, 900.0)]);
        let before = flat.mean_px();
        // Depth is not seen in the picture.
        assert!(before < 40.0);
        let samples = [Point3::new(10.0, 20.0, 3.0), Point3::new(-20.0, 30.0, 0.0)];
        let gain = flat.gain(&samples);
        flat.take(&samples);
        assert!((before - flat.mean_px() - gain / count).abs() < 1e-3);
        let mut deep = Attractors::in_space();
        deep.add(Point3::new(0.0, 0.0, 50.0), &[Point3::origin()]);
        assert!((deep.gain(&[Point3::new(0.0, 0.0, 40.0)]) - 40.0).abs() < 1e-3);
    }
}
