//! Settings: plain structs whose defaults are the documented ones. A file overrides a default, the
//! command line overrides the file.
//!
//! Each setting is declared once, in `settings.rs`; the check, the shipped file, the tables of the
//! documentation and help texts are derived from that.

mod declare;
mod depth_camera;
mod load;
mod markers;
mod reference;
mod reload;
mod setting;
mod settings;

pub use depth_camera::{DepthCamera, check_distortion};
pub use load::{ConfigError, STROKE_POINTS, check_strokes};
pub use markers::{MAX_MARKERS, MarkerCorrection, MarkerWindow, check_marker_names};
pub use reference::{default_file, help, range, tables};
pub use reload::{Change, effect};
pub use setting::{Choice, Effect, Range, Section, Setting};
pub use settings::{
    Accumulate, Affinity, Backend, Camera, CameraFormat, Cloud, Config, Depth, Detect, Dynamics,
    EnvelopeKind, Excited, Export, Hierarchy, Leader, LeafShow, Leaves, MarkerMethod, Markers,
    Motion, MotionMethod, Outline, SECTIONS, Shape, Skeleton, Tag, TraceBy, Track, Wind, Wood,
};

use std::time::Duration;

impl Shape {
    /// Planes of a tree that is seen to be bare, or not: all of the branches of a bare one are seen, and
    /// copies of them would be branches that it does not have.
    pub fn planes_of(&self, is_bare: bool) -> u32 {
        match is_bare && !self.copy_bare {
            true => 1,
            false => self.planes,
        }
    }
}

impl Camera {
    /// [`timeout_s`](Self::timeout_s) as a duration.
    pub fn time_limit(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s.clamp(0.001, 1e6))
    }
}

impl Markers {
    /// Whether any markers are to be followed.
    pub fn are_wanted(&self) -> bool {
        self.find || !self.windows.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::Shape;

    #[test]
    fn a_bare_tree_has_no_copies_unless_they_are_asked_for() {
        let mut shape = Shape::default();
        assert_eq!((shape.planes_of(false), shape.planes_of(true)), (3, 1));
        shape.copy_bare = true;
        assert_eq!(shape.planes_of(true), 3);
    }
}
