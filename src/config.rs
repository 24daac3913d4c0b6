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
pub use markers::{MAX_MARKERS, MarkerCorrection, MarkerWindow};
pub use reference::{default_file, help, tables};
pub use reload::{Change, effect};
pub use setting::{Choice, Effect, Range, Section, Setting};
pub use settings::{
    Accumulate, Affinity, Backend, Camera, CameraFormat, Config, Depth, Detect, Dynamics,
    EnvelopeKind, Excited, Export, Hierarchy, Leader, LeafShow, Leaves, MarkerMethod, Markers,
    Motion, MotionMethod, Outline, SECTIONS, Shape, Skeleton, Tag, TraceBy, Track, Wind, Wood,
};

use std::time::Duration;

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
