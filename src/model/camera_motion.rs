//! How the camera itself moved.

use nalgebra::{Point2, Similarity2};

/// Where the camera looks in one frame, against the frame in which points were first followed.
///
/// What stands still has one place in all frames once this is taken off: its *steady* place. It is
/// the place in that first picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMotion {
    /// Takes a steady place to the place where it was filmed in this frame, px.
    pub filmed_from_steady: Similarity2<f64>,
    pub background: Background,
}

/// How well the places of what stands still agree on the camera's motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Standard deviation of the motion where it is least sure within the outline, px.
    pub sd_px: f64,
    /// Number of places that agree, and the root mean square of what the motion misses them by, px.
    pub inliers: u32,
    pub rms_px: f64,
}

/// What the surroundings of the tree say of the camera in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Where the camera looks.
    Seen(Agreement),
    /// Nothing, but the foot of the trunk shows how far the picture has shifted. The deviation is
    /// that at the foot: a turn or a zoom of the camera is not seen, and remains.
    Foot(Agreement),
    /// Nothing: the motion is that of the last frame in which it was known.
    Unclear,
    /// It was seen well, and has been gone or far off its place for a while: the camera was turned,
    /// zoomed, refocused or covered. Nothing that is filmed meanwhile counts.
    Lost,
}

impl Default for CameraMotion {
    /// A camera of which nothing is known, and that is taken to stand still.
    fn default() -> Self {
        Self {
            filmed_from_steady: Similarity2::identity(),
            background: Background::Unclear,
        }
    }
}

impl CameraMotion {
    /// Where a steady place was filmed, px.
    pub fn filmed_px(&self, steady_px: Point2<f64>) -> Point2<f64> {
        self.filmed_from_steady * steady_px
    }

    /// The steady place of what was filmed at `filmed_px`.
    pub fn steady_px(&self, filmed_px: Point2<f64>) -> Point2<f64> {
        self.filmed_from_steady.inverse_transform_point(&filmed_px)
    }

    /// The two rows of the matrix that takes `(u, v, 1)` of a steady place to where it was filmed,
    /// px.
    pub fn affine_rows(&self) -> [f64; 6] {
        let matrix = self.filmed_from_steady.to_homogeneous();
        std::array::from_fn(|k| matrix[(k / 3, k % 3)])
    }

    /// Standard deviation within the outline, px; `None` where the background does not show the
    /// motion.
    pub fn sd_px(&self) -> Option<f64> {
        match self.background {
            Background::Seen(agreement) => Some(agreement.sd_px),
            Background::Foot(_) | Background::Unclear | Background::Lost => None,
        }
    }

    /// How far some places are moved at most, px.
    pub fn farthest_px(&self, steady_px: &[Point2<f64>]) -> f64 {
        let moved_px = steady_px.iter().map(|at| (self.filmed_px(*at) - at).norm());
        moved_px.fold(0.0, f64::max)
    }
}
