//! The points of a cloud that stand on its ground.

use super::ground::Ground;
use super::{CloudError, CloudFigures};
use nalgebra::{Point3, Vector3};
use std::sync::Arc;

/// Points that a tree takes at least.
const LEAST_POINTS: usize = 100;
/// Points that lie farther off than the size of the cloud without the outermost of them, on both
/// sides of each axis, are no part of the tree.
const OUTERMOST: f64 = 0.001;

/// The points that stand on the ground.
pub(super) struct Standing {
    pub points: Vec<Point3<f32>>,
    /// Of each the place in the cloud.
    pub of_cloud: Vec<u32>,
    pub ground: Option<Arc<Ground>>,
    pub height: f32,
}

impl Standing {
    pub fn of(all: &[Point3<f32>], figures: &mut CloudFigures) -> Result<Self, CloudError> {
        if all.len() < LEAST_POINTS {
            return Err(CloudError::TooFew {
                points: all.len(),
                least: LEAST_POINTS,
            });
        }
        let bounds = Bounds::of(all);
        let [wide, deep, height] = bounds.sizes();
        if height <= 0.0 || wide.max(deep) <= 0.0 {
            return Err(CloudError::Flat);
        }
        let mut points: Vec<Point3<f32>> = all.iter().copied().filter(|p| bounds.hold(p)).collect();
        figures.noise = all.len() - points.len();
        let ground = Ground::of(&points, height).map(Arc::new);
        let of_all = (0..).zip(all).filter(|(_, at)| bounds.hold(at));
        let mut of_cloud: Vec<u32> = of_all.map(|(place, _)| place).collect();
        if let Some(ground) = &ground {
            let before = points.len();
            let stands: Vec<bool> = points.iter().map(|p| !ground.holds(p)).collect();
            retain_flagged(&mut points, &stands);
            retain_flagged(&mut of_cloud, &stands);
            figures.ground = before - points.len();
        }
        Self {
            points,
            of_cloud,
            ground,
            height: 0.0,
        }
        .measured()
    }

    /// The same with its height.
    fn measured(mut self) -> Result<Self, CloudError> {
        if self.points.len() < LEAST_POINTS {
            return Err(CloudError::NoTree);
        }
        self.height = Extent::of(&self.points, 2).size;
        if self.height <= 0.0 {
            return Err(CloudError::Flat);
        }
        Ok(self)
    }

    /// The points of each of so many trees; `tree_of_point` goes by the points of the cloud.
    pub fn split(
        self,
        tree_of_point: &[Option<u32>],
        trees: usize,
    ) -> Vec<Result<Self, CloudError>> {
        let mut all: Vec<Self> = Vec::with_capacity(trees);
        for _ in 0..trees {
            all.push(Self {
                points: Vec::new(),
                of_cloud: Vec::new(),
                ground: self.ground.clone(),
                height: 0.0,
            });
        }
        for (at, place) in self.points.iter().zip(&self.of_cloud) {
            if let Some(tree) = tree_of_point[*place as usize] {
                all[tree as usize].points.push(*at);
                all[tree as usize].of_cloud.push(*place);
            }
        }
        all.into_iter().map(Self::measured).collect()
    }

    /// The points as high as they are above the ground.
    pub fn above_ground(&self, points: &[Point3<f32>]) -> Vec<Point3<f32>> {
        let mut above = points.to_vec();
        if let Some(ground) = &self.ground {
            above
                .iter_mut()
                .for_each(|p| p.z -= ground.height_at(p.x, p.y));
        }
        above
    }

    /// How high the ground is at a place, where any was scanned.
    pub fn ground_at(&self, at: &Point3<f64>) -> Option<f64> {
        let ground = self.ground.as_ref()?;
        Some(ground.height_at(at.x as f32, at.y as f32).into())
    }

    /// The foot below the lowest points of the trunk: in their middle, on the ground.
    pub fn foot_below(&self, points: &[Point3<f32>], lowest: &[u32]) -> Point3<f64> {
        let mut sum = Vector3::zeros();
        lowest
            .iter()
            .for_each(|p| sum += points[*p as usize].coords.cast::<f64>());
        let mut foot = Point3::from(sum / lowest.len().max(1) as f64);
        foot.z = lowest
            .iter()
            .map(|p| f64::from(points[*p as usize].z))
            .fold(foot.z, f64::min);
        foot.z = self.ground_at(&foot).map_or(foot.z, |z| foot.z.min(z));
        foot
    }
}

/// Keeps what is flagged.
fn retain_flagged<T>(all: &mut Vec<T>, flags: &[bool]) {
    let mut flags = flags.iter();
    all.retain(|_| flags.next() == Some(&true));
}

/// Where most points lie along an axis.
#[derive(Clone, Copy, Debug)]
struct Extent {
    low: f32,
    size: f32,
}

impl Extent {
    fn of(points: &[Point3<f32>], axis: usize) -> Self {
        let mut all: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        let off = (OUTERMOST * all.len() as f64) as usize;
        let last = all.len() - 1 - off;
        let low = *all.select_nth_unstable_by(off, f32::total_cmp).1;
        let high = *all.select_nth_unstable_by(last, f32::total_cmp).1;
        Self {
            low,
            size: high - low,
        }
    }

    fn holds(&self, x: f32) -> bool {
        (self.low - self.size..=self.low + 2.0 * self.size).contains(&x)
    }
}

/// Where most points lie along each axis.
#[derive(Clone, Copy, Debug)]
struct Bounds([Extent; 3]);

impl Bounds {
    fn of(points: &[Point3<f32>]) -> Self {
        Self([0, 1, 2].map(|axis| Extent::of(points, axis)))
    }

    fn sizes(&self) -> [f32; 3] {
        self.0.map(|extent| extent.size)
    }

    fn hold(&self, point: &Point3<f32>) -> bool {
        let mut along = self.0.iter().zip(point.iter());
        along.all(|(extent, x)| extent.holds(*x))
    }
}
