//! The camera's motion from the foot of the trunk, where nothing around the tree shows it.
//!
//! The foot is rooted in the ground: what moves it is the camera. The lowest part of the trunk is
//! found again as a whole, shifted, and turned about the foot, as it sways there. Its shift is the
//! camera's. Its turn cannot be told from the camera's turn, and a zoom is not seen on so small a
//! part of the picture: they are taken to be as they were when the background last showed them.

use super::flow::{Flow, OpticalFlow};
use super::landmarks::Pictures;
use super::template::{Found, Template};
use crate::model::{Agreement, Background, CameraMotion, Foot, FootBasis, Luma, Outline, TrunkRow};
use crate::signal::statistics::median_vector;
use nalgebra::{Isometry2, Point2, Translation2, Vector2};

/// Lowest part of the tree's height of which the trunk is looked for. A trunk that bends as a
/// cantilever does is straight there to a hundredth of what its tip moves.
const LOW_SHARE: f64 = 0.2;
/// A shift that is less sure is none, px.
const LARGEST_SD_PX: f64 = 0.3;
/// Pixels are compared as if the picture were no wider than this, px: more say the same at a higher
/// price.
const COMPARED_WIDTH: u32 = 640;

/// The lowest part of a trunk.
pub struct TrunkFoot {
    /// At its steady place, px.
    foot_px: Point2<f64>,
    rows: Vec<TrunkRow>,
    template: Template,
    /// How it is moved about the foot, the trunk's own sway included, in the newest frame in which
    /// it was found.
    motion: Isometry2<f64>,
    flow: Vec<Flow>,
}

impl TrunkFoot {
    /// That of a tree whose outline ends at its foot; `None` of another.
    pub fn of(outline: &Outline) -> Option<Self> {
        let foot = Foot::of(outline, None);
        (foot.basis == FootBasis::Outline).then(|| Self {
            foot_px: foot.position_px,
            rows: foot.trunk_rows(outline, LOW_SHARE),
            template: Template::default(),
            motion: Isometry2::identity(),
            flow: Vec::new(),
        })
    }

    /// Takes what the trunk looks like in the first picture; whether that can be found again.
    pub fn begin(&mut self, luma: &Luma) -> bool {
        let step = luma.size.width.div_ceil(COMPARED_WIDTH).max(1) as usize;
        let mut pixels = Vec::new();
        for row in self.rows.iter().step_by(step) {
            let columns = (row.first..=row.last).step_by(step);
            pixels.extend(columns.map(|u| Point2::new(f64::from(u), f64::from(row.v))));
        }
        let pixels = pixels.into_iter();
        self.template = Template::cut(luma, pixels, self.foot_px, &self.motion);
        self.template.is_something()
    }

    /// What is said of the first picture.
    pub fn at_first(&self) -> Agreement {
        self.template.at_first()
    }

    /// The camera's motion in the newest of the `pictures`, in the frame before which it `was`;
    /// `None` where the trunk does not show it.
    pub fn follow(
        &mut self,
        pictures: &Pictures,
        was: &CameraMotion,
        flow: &mut OpticalFlow,
    ) -> Option<CameraMotion> {
        let luma = pictures.luma;
        if !matches!(was.background, Background::Foot(_)) {
            // Where the background had it, as far as that was known.
            let shift_px = was.filmed_px(self.foot_px) - self.foot_px;
            self.motion.translation = shift_px.into();
        }
        let found = self.find(luma, self.motion).or_else(|| {
            let jumped_px = self.jump_px(pictures, flow)?;
            let start = Isometry2::new(jumped_px, 0.0) * self.motion;
            self.find(luma, start)
        })?;
        self.motion = found.motion;
        let filmed_px = self.foot_px + found.motion.translation.vector;
        let shift_px = filmed_px - was.filmed_px(self.foot_px);
        Some(CameraMotion {
            filmed_from_steady: Translation2::from(shift_px) * was.filmed_from_steady,
            background: Background::Foot(found.agreement),
        })
    }

    fn find(&self, luma: &Luma, start: Isometry2<f64>) -> Option<Found> {
        let found = self.template.find(luma, self.foot_px, &start)?;
        (found.agreement.sd_px <= LARGEST_SD_PX).then_some(found)
    }

    /// By how much the trunk has moved since the frame before, by optical flow along its middle,
    /// roughly, px.
    fn jump_px(&mut self, pictures: &Pictures, flow: &mut OpticalFlow) -> Option<Vector2<f64>> {
        let mut middle_px = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let middle = 0.5 * f64::from(row.first + row.last);
            let from_foot_px = Point2::new(middle, f64::from(row.v)) - self.foot_px;
            let filmed_px = self.foot_px + (self.motion * Point2::from(from_foot_px)).coords;
            middle_px.push(filmed_px.cast::<f32>());
        }
        let Pictures {
            previous,
            present,
            levels,
            ..
        } = pictures;
        flow.track(previous, present, &middle_px, *levels, &mut self.flow);
        let mut steps_px: Vec<Vector2<f64>> = Vec::new();
        for (from, flow) in middle_px.iter().zip(&self.flow) {
            if flow.found {
                steps_px.push((flow.to - from).cast());
            }
        }
        (!steps_px.is_empty()).then(|| median_vector(steps_px.into_iter()))
    }
}
