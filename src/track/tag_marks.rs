//! The camera's motion from a printed tag that hangs still beside the tree.
//!
//! The corners of the tag and of its cells are found again in every picture as those of the
//! surroundings are. What both say of the camera is weighted by how sure each is. Where they are at
//! odds for most of a while the surroundings move by themselves, as clouds do, or are so far behind
//! the tree that a camera that shifts shows them otherwise: the tag counts alone from then on.

use super::flow::OpticalFlow;
use super::landmarks::{Agreed, CornerChoice, Landmarks, Pictures, agree_px, clear_corners};
use crate::model::{Agreement, Luma, Size};
use crate::signal::CommonMotion;
use nalgebra::{Point2, Similarity2, Vector2};
use opencv::core::{CV_8UC1, Mat, Rect, Scalar};
use opencv::imgproc::{FILLED, LINE_8, rectangle};

/// So many corners of a tag are followed: it has 36 cells, and each costs some microseconds.
const MOST: i32 = 60;
/// So far apart, px: the patch of one is half that of the next.
const APART_PX: f64 = 5.0;
/// As clear as this share of the clearest one: ink on paper.
const CLEAR: f64 = 0.1;
/// Tag and surroundings are at odds where they differ by more than so many standard deviations, beyond
/// what corners that agree may miss.
const AT_ODDS_SD: f64 = 3.0;
/// Frames in which they are at odds, less those in which they are not: half a second, as no passer-by
/// before a tag looks like a tag.
const FRAMES_AT_ODDS: u32 = 15;

/// A tag that is followed.
#[derive(Default)]
pub struct TagMarks {
    landmarks: Landmarks,
    /// The corners of the tag in the picture that is next, px.
    seen_px: Option<[Point2<f64>; 4]>,
    /// The steady place of its middle, px.
    middle_px: Point2<f64>,
    is_worn: bool,
    at_odds: u32,
    /// The surroundings count no more.
    is_alone: bool,
    dispute_px: Option<f64>,
}

impl TagMarks {
    /// It is seen with these corners in the next picture.
    pub fn see(&mut self, corners_px: [Point2<f64>; 4]) {
        self.seen_px = Some(corners_px);
    }

    /// What is followed of it.
    pub fn landmarks(&self) -> &Landmarks {
        &self.landmarks
    }

    /// By how much the surroundings were off it, px, when they were found to move; once.
    pub fn take_dispute(&mut self) -> Option<f64> {
        self.dispute_px.take()
    }

    /// Takes what it looks like in this picture, in which the camera's motion is this, if it is seen
    /// there and its corners are not followed yet or are worn.
    pub fn take(&mut self, luma: &Luma, filmed_from_steady: &Similarity2<f64>) {
        let Some(corners_px) = self.seen_px.take() else {
            return;
        };
        if self.landmarks.suffice() && !self.is_worn {
            return;
        }
        let marks_px = marks(luma, &corners_px).unwrap_or_else(|e| {
            tracing::error!("corners of a tag in a {} picture: {e}", luma.size);
            Vec::new()
        });
        let sum: Vector2<f64> = corners_px.iter().map(|corner| corner.coords).sum();
        self.middle_px = filmed_from_steady.inverse_transform_point(&(sum / 4.0).into());
        self.landmarks.take(luma, &marks_px, filmed_from_steady);
    }

    /// The motion on which its corners agree in a frame, as of all [`Landmarks`].
    pub fn follow(
        &mut self,
        pictures: &Pictures,
        before: &Similarity2<f64>,
        places_px: &[Point2<f64>],
        flow: &mut OpticalFlow,
    ) -> Option<Agreed> {
        let found = self.landmarks.follow(pictures, before, places_px, flow);
        self.is_worn = found.is_none_or(|found| found.is_worn);
        found
    }

    /// What the surroundings and the tag say together of a picture of this size.
    pub fn judge(
        &mut self,
        around: Option<Agreed>,
        by_tag: Option<Agreed>,
        size: Size,
        places_px: &[Point2<f64>],
    ) -> Option<Agreed> {
        let around = around.filter(|_| !self.is_alone);
        let (Some(one), Some(other)) = (around, by_tag) else {
            return around.or(by_tag);
        };
        let middle_px = self.middle_px;
        let off_px = (one.common.motion * middle_px - other.common.motion * middle_px).norm();
        let sd_px = one
            .common
            .worst_sd_px(&[middle_px])
            .hypot(other.common.worst_sd_px(&[middle_px]));
        if off_px <= agree_px(size) + AT_ODDS_SD * sd_px {
            self.at_odds = self.at_odds.saturating_sub(1);
            return together(&one, &other, places_px).or(around);
        }
        self.at_odds += 1;
        if self.at_odds < FRAMES_AT_ODDS {
            return around;
        }
        (self.is_alone, self.dispute_px) = (true, Some(off_px));
        by_tag
    }
}

/// Clear corners on a tag, px.
fn marks(luma: &Luma, corners_px: &[Point2<f64>; 4]) -> opencv::Result<Vec<Point2<f32>>> {
    let (rows, cols) = (luma.size.height as i32, luma.size.width as i32);
    let mut low = corners_px[0];
    let mut high = corners_px[0];
    for corner in corners_px {
        (low, high) = (low.inf(corner), high.sup(corner));
    }
    let mut allowed = Mat::new_rows_cols_with_default(rows, cols, CV_8UC1, Scalar::all(0.0))?;
    let (low, high) = (
        low.map(|x| x.floor() as i32 - 1),
        high.map(|x| x.ceil() as i32 + 1),
    );
    let area = Rect::new(low.x, low.y, high.x - low.x + 1, high.y - low.y + 1);
    rectangle(&mut allowed, area, Scalar::all(255.0), FILLED, LINE_8, 0)?;
    let choice = CornerChoice {
        most: MOST,
        apart: APART_PX / f64::from(luma.size.width),
        clear: CLEAR,
    };
    clear_corners(luma, &allowed, choice)
}

/// Two motions that agree, as one.
fn together(one: &Agreed, other: &Agreed, places_px: &[Point2<f64>]) -> Option<Agreed> {
    let common: CommonMotion = one.common.with(&other.common)?;
    let (first, second) = (one.agreement, other.agreement);
    let inliers = first.inliers + second.inliers;
    let squares = |of: Agreement| f64::from(of.inliers) * of.rms_px.powi(2);
    Some(Agreed {
        common,
        agreement: Agreement {
            sd_px: common.worst_sd_px(places_px),
            inliers,
            rms_px: ((squares(first) + squares(second)) / f64::from(inliers.max(1))).sqrt(),
        },
        is_worn: one.is_worn,
    })
}
