//! The camera's motion while nobody knows yet which part of the picture is tree: the dominant
//! motion, on which most of the picture agrees.

use super::background::Background;
use super::flow::{OpticalFlow, Pyramid};
use super::landmarks::Pictures;
use crate::config::Track;
use crate::model::{CameraMotion, Frame};

/// Follows corners all over the picture.
pub struct WholeView {
    settings: Track,
    /// `None` before the first frame.
    background: Option<Background>,
    flow: OpticalFlow,
    previous: Pyramid,
    present: Pyramid,
}

impl WholeView {
    /// Before the first frame.
    pub fn new(settings: &Track) -> Self {
        Self {
            settings: settings.clone(),
            background: None,
            flow: OpticalFlow::new(settings.window_px),
            previous: Pyramid::default(),
            present: Pyramid::default(),
        }
    }

    /// The camera's motion in the next frame, against the first one.
    pub fn step(&mut self, frame: &Frame) -> CameraMotion {
        let Track {
            steady,
            window_px,
            levels,
            ..
        } = self.settings;
        if !steady {
            return CameraMotion::default();
        }
        std::mem::swap(&mut self.previous, &mut self.present);
        self.present.rebuild(&frame.luma, window_px, levels);
        let background = self
            .background
            .get_or_insert_with(|| Background::everywhere(frame.luma.size));
        let pictures = Pictures {
            luma: &frame.luma,
            time_s: frame.time_s,
            previous: &self.previous,
            present: &self.present,
            levels,
        };
        background.step(&pictures, &mut self.flow)
    }
}
