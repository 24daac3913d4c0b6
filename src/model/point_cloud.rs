//! Points on the surface of a tree and of what stands about it, from a laser scanner or a depth
//! camera.

use nalgebra::{Point3, Vector3};

/// Most points that a cloud holds; 12 bytes each.
pub const MOST_CLOUD_POINTS: usize = 100_000_000;

/// A point cloud, z up, m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Where the points count from, in the axes of the file: surveys have coordinates of millions.
    pub origin: Vector3<f64>,
    /// Against `origin`; all are finite.
    pub points: Vec<Point3<f32>>,
    /// Points of the file that were left out, as a coordinate of them is no number.
    pub not_finite: usize,
}

impl PointCloud {
    /// Adds a point in the axes of the file, m; the first one becomes the origin. Returns `false`
    /// where the cloud holds as many as it can.
    pub fn push(&mut self, at: Point3<f64>) -> bool {
        if self.points.len() >= MOST_CLOUD_POINTS {
            return false;
        }
        if self.points.is_empty() && at.iter().all(|x| x.is_finite()) {
            self.origin = at.coords;
        }
        let own = (at - self.origin).map(|x| x as f32);
        if own.iter().all(|x| x.is_finite()) {
            self.points.push(own);
        } else {
            self.not_finite += 1;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A survey's coordinates keep their millimetres.
    #[test]
    fn points_count_from_the_first_sound_one() {
        let mut cloud = PointCloud::default();
        let places = [
            [f64::NAN, 0.0, 0.0],
            [4e6, 5e6, 300.0],
            [4e6 + 0.001, 5e6, 301.0],
            [1e60, 0.0, 0.0],
        ];
        assert!(places.iter().all(|at| cloud.push(Point3::from(*at))));
        assert_eq!(cloud.origin, Vector3::new(4e6, 5e6, 300.0));
        assert_eq!(cloud.not_finite, 2);
        assert!((f64::from(cloud.points[1].x) - 0.001).abs() < 1e-6);
    }
}
