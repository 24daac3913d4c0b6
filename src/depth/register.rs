//! Depth images as the colour camera would have taken them: each pixel is put where the colour camera
//! sees it, and of several in one place the nearest counts.

use crate::model::{CameraModel, DepthImage, DepthRig, Size};
use nalgebra::{Point2, Vector2, Vector3};

/// What is seen so much farther outside than the corners of the picture has no place in it, as a share.
/// Beyond that a model of distortion may fold back into the picture.
const BEYOND_CORNERS: f64 = 1.1;

/// Registers the images of one depth camera.
#[derive(Clone, Debug)]
pub struct Registration {
    /// Size of the depth camera's images, px.
    from: Size,
    /// Where a pixel of the depth camera lies at 1 m along its axis, in the axes of the colour camera
    /// and without the shift between both; no numbers where it sees nothing.
    rays: Vec<Vector3<f32>>,
    shift_m: Vector3<f64>,
    /// The colour camera, for the registered image.
    colour: CameraModel,
    /// The farthest that the picture shows from the axis, at a distance of 1.
    widest: f64,
    unit_m: f64,
}

impl Registration {
    /// For counts of `unit_m` metres and pictures of the size `picture`; `None` where the cameras are
    /// none. The registered image has pixels as large as the depth camera's, or those of the picture
    /// where they are larger: so that few stay empty, and none is there twice.
    pub fn new(rig: &DepthRig, picture: Size, unit_m: f64) -> Option<Self> {
        if !rig.depth.is_valid() || !rig.colour.is_valid() || picture.area() == 0 {
            return None;
        }
        let colour = rig.colour.for_size(picture);
        let coarser = rig.depth.pinhole.focal_px.mean() / colour.pinhole.focal_px.mean();
        let colour = colour.for_size(picture.scaled(coarser.min(1.0)));
        let mut widest: f64 = 0.0;
        for corner_px in colour.size.corners_px() {
            widest = widest.max(colour.ray(corner_px)?.norm());
        }
        let rotation = rig.colour_from_depth.rotation;
        let from = rig.depth.size;
        let mut rays = Vec::with_capacity(from.area());
        for v in 0..from.height {
            for u in 0..from.width {
                let ray = rig.depth.ray(Point2::new(f64::from(u), f64::from(v)));
                let ray = ray.unwrap_or(Vector2::repeat(f64::NAN));
                rays.push((rotation * ray.push(1.0)).cast());
            }
        }
        Some(Self {
            from,
            rays,
            shift_m: rig.colour_from_depth.translation.vector,
            colour,
            widest: widest * BEYOND_CORNERS,
            unit_m,
        })
    }

    /// Size of registered images, px.
    pub fn size(&self) -> Size {
        self.colour.size
    }

    /// Checks that the depth camera's images have this size.
    ///
    /// # Errors
    /// They have another one.
    pub fn check_size(&self, size: Size) -> Result<(), String> {
        if size == self.from {
            return Ok(());
        }
        let from = self.from;
        Err(format!(
            "the depth image is {size}, its camera is given for {from}"
        ))
    }

    /// The image as the colour camera would have taken it.
    ///
    /// # Errors
    /// It has another size than the depth camera's images.
    pub fn registered(&self, image: &DepthImage) -> Result<DepthImage, String> {
        self.check_size(image.size)?;
        let size = self.size();
        let mut counts = vec![0; size.area()];
        for (count, ray) in image.counts.iter().zip(&self.rays) {
            if DepthImage::is_hole(*count) {
                continue;
            }
            let Some(seen) = self.seen(f64::from(*count) * self.unit_m, ray) else {
                continue;
            };
            let at = &mut counts[seen.pixel];
            if *at == 0 || seen.count < *at {
                *at = seen.count;
            }
        }
        Ok(DepthImage {
            size,
            counts,
            later_s: image.later_s,
        })
    }

    /// Where a ray of the depth camera ends in the registered image; `None` outside of it.
    fn seen(&self, depth_m: f64, ray: &Vector3<f32>) -> Option<Seen> {
        let place_m = ray.cast::<f64>() * depth_m + self.shift_m;
        let count = (place_m.z / self.unit_m).round();
        // Not true for what is no number, either.
        if !(1.0..f64::from(u16::MAX)).contains(&count) {
            return None;
        }
        let ray = place_m.xy() / place_m.z;
        if ray.norm() > self.widest {
            return None;
        }
        let at_px = self.colour.seen_px(ray);
        let size = self.colour.size;
        if !size.contains(at_px) {
            return None;
        }
        let (u, v) = (at_px.x.round() as usize, at_px.y.round() as usize);
        Some(Seen {
            pixel: v * size.width as usize + u,
            count: count as u16,
        })
    }
}

/// A pixel of a registered image, and its depth.
struct Seen {
    pixel: usize,
    count: u16,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Pinhole;
    use nalgebra::{Isometry3, Translation3};

    fn camera(width: u32, height: u32, focal_px: f64) -> CameraModel {
        let pinhole = Pinhole {
            focal_px: Vector2::repeat(focal_px),
            middle_px: Point2::new(f64::from(width) / 2.0 - 0.5, f64::from(height) / 2.0 - 0.5),
        };
        CameraModel::new(Size::new(width, height), pinhole)
    }

    /// The depth camera is 5 cm to the left of the colour camera.
    fn rig() -> DepthRig {
        DepthRig {
            depth: camera(80, 60, 70.0),
            colour: camera(320, 240, 280.0),
            colour_from_depth: Isometry3::from_parts(
                Translation3::new(-0.05, 0.0, 0.0),
                nalgebra::UnitQuaternion::identity(),
            ),
        }
    }

    #[test]
    fn a_branch_before_a_wall_is_put_where_the_colour_camera_sees_it() {
        let rig = rig();
        let registration = Registration::new(&rig, rig.colour.size, 0.001).expect("a rig");
        assert_eq!(registration.size(), Size::new(80, 60));
        // Columns 38 to 41 at 1 m, a wall at 3.5 m, and a column of holes.
        let mut counts = vec![3500; 80 * 60];
        for row in counts.chunks_mut(80) {
            row[38..42].fill(1000);
            row[60] = 0;
        }
        let size = rig.depth.size;
        let image = registration
            .registered(&DepthImage::new(size, counts))
            .expect("registered");
        let row = &image.counts[30 * 80..31 * 80];
        // 5 cm are 3.5 px at 1 m and 1 px at 3.5 m.
        let branch: Vec<usize> = (0..80).filter(|u| row[*u] == 1000).collect();
        assert_eq!(branch.len(), 4, "{row:?}");
        assert!((34..=35).contains(&branch[0]), "{branch:?}");
        assert_eq!(row[59], 0, "{row:?}");
        // What the colour camera sees behind the branch was hidden, or is outside.
        assert!(row.iter().filter(|count| **count == 3500).count() > 65);
        assert_eq!(row[79], 0);
    }

    #[test]
    fn an_image_of_another_size_is_refused_and_so_is_a_camera_that_is_none() {
        let rig = rig();
        let registration = Registration::new(&rig, rig.colour.size, 0.001).expect("a rig");
        let size = Size::new(8, 6);
        let counts = vec![1000; 48];
        let said = registration.registered(&DepthImage::new(size, counts));
        assert!(said.expect_err("refused").contains("8x6"));
        let mut none = rig;
        none.depth.pinhole.focal_px.x = f64::NAN;
        assert!(Registration::new(&none, rig.colour.size, 0.001).is_none());
    }
}
