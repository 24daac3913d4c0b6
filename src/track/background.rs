//! The camera's motion, from what stands still around the tree.
//!
//! Corners outside of the outline are found again in every picture by their first patches; the
//! similarity on which they agree is the camera's motion. Corners that move by themselves, leaves
//! of a hedge or somebody who walks by, lose their weight.

use super::flow::{Flow, OpticalFlow, Pyramid};
use super::register::{Patch, Registration};
use crate::model::{self, Agreement, CameraMotion, Frame, Luma, Outline};
use crate::signal::statistics::rms;
use crate::signal::{CommonMotion, Pair};
use nalgebra::{Point2, Similarity2, distance};
use opencv::core::{CV_8UC1, Mat, Point, Point2f, Rect, Scalar, Size as CvSize, Vector};
use opencv::imgproc::{
    FILLED, LINE_8, MORPH_RECT, dilate_def, get_structuring_element, good_features_to_track,
    rectangle,
};
use opencv::prelude::*;

/// Corners that are followed, at most; how far apart they are, as a share of the picture's width;
/// and how clear each is, as a share of the clearest one.
const CORNERS: i32 = 300;
const APART: f64 = 0.012;
const CLEAR: f64 = 0.01;
/// Side of the window over which the structure tensor is averaged, px.
const BLOCK_PX: i32 = 3;
/// Corners keep so far from the outline, which the tree may leave when it sways, as a share of the
/// picture's width; and from the picture's edge, px: a patch that hangs over it changes.
const OFF_OUTLINE: f64 = 0.02;
const OFF_EDGE_PX: i32 = 8;
/// A corner is found where it looks like its first patch to this correlation, and no farther than
/// this from where it is expected, px.
const LEAST_NCC: f32 = 0.8;
const NEAR_PX: f32 = 3.0;
/// If so small a share is found, the camera has jumped: optical flow says where to look.
const FEW: f64 = 0.5;
/// Corners agree on a motion that they miss by no more than this share of the picture's width:
/// 0.5 px of 640.
const AGREE: f64 = 0.5 / 640.0;
/// Fewer corners than this, or than these shares of those that were found and of those that were
/// looked for, say nothing of the camera: a lens cap or fog lets some through.
const LEAST_CORNERS: usize = 12;
const LEAST_AGREE: f64 = 0.5;
const LEAST_FOUND: f64 = 0.15;
/// A motion that is less sure than this within the outline is none, px: corners on one side of the
/// tree alone do not say what happens on the other.
const LARGEST_SD_PX: f64 = 0.3;
/// New corners are looked for where fewer than this share are left of those that were found, after
/// so long, s.
const WORN: f64 = 0.6;
const ANEW_S: f64 = 2.0;
/// A camera that looks aside by more than this share of the picture's width, or does not see its
/// background any more, has lost it after so long, s: a bump or a passer-by does not take longer.
/// Farther aside a turn of the camera is no similarity any more: 6 degrees bend the picture by
/// some pixels.
const FAR: f64 = 0.06;
const LOST_S: f64 = 1.0;
/// That can be said of a background that was seen for so long, s, and in this share of the frames.
const KNOWN_S: f64 = 2.0;
const KNOWN: f64 = 0.8;

/// What stands still around the tree.
pub struct Background {
    outline: Wide,
    registration: Registration,
    corners: Vec<Corner>,
    /// Corners were looked for at this time, s; `None` before the first frame.
    sought_s: Option<f64>,
    motion: CameraMotion,
    sight: Sight,
    buffers: Buffers,
}

/// Whether the background can be relied on.
#[derive(Debug, Default)]
struct Sight {
    /// Frames before it was lost, those of them in which it was seen in its place, and when the
    /// first and the last of these were, s.
    frames: u32,
    seen: u32,
    first_s: Option<f64>,
    last_s: f64,
}

impl Sight {
    /// Takes whether it is seen in its place in a frame; gives whether it is lost.
    fn note(&mut self, is_seen: bool, time_s: f64) -> bool {
        if is_seen {
            self.first_s.get_or_insert(time_s);
            self.last_s = time_s;
            self.seen += 1;
        }
        let first_s = self.first_s.unwrap_or(time_s);
        let was_known = self.last_s - first_s >= KNOWN_S
            && f64::from(self.seen) >= KNOWN * f64::from(self.frames);
        let is_lost = was_known && time_s - self.last_s > LOST_S;
        self.frames += u32::from(!is_lost);
        is_lost
    }
}

#[derive(Default)]
struct Buffers {
    from: Vec<Point2<f32>>,
    flow: Vec<Flow>,
}

/// A corner, and what it looked like.
struct Corner {
    steady_px: Point2<f64>,
    patch: Patch,
}

/// The outline as far as it matters here.
struct Wide {
    /// Where the tree may be, row by row; 0 elsewhere.
    mask: Vec<u8>,
    /// Corners of the box around it, px.
    corners_px: [Point2<f64>; 4],
}

impl Background {
    /// Before the first picture. Nothing within `outline` counts.
    pub fn around(outline: &Outline) -> Self {
        let [left, top, right, bottom] = outline.bounds_px().unwrap_or_default().map(f64::from);
        let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
        Self {
            outline: Wide {
                mask: outline.mask.clone(),
                corners_px: corners.map(|(u, v)| Point2::new(u, v)),
            },
            registration: Registration::default(),
            corners: Vec::new(),
            sought_s: None,
            motion: CameraMotion::default(),
            sight: Sight::default(),
            buffers: Buffers::default(),
        }
    }

    /// The camera's motion in `frame`, whose pyramid is `present`; `previous` is that of the frame
    /// before.
    pub fn step(
        &mut self,
        frame: &Frame,
        previous: &Pyramid,
        present: &Pyramid,
        levels: u32,
        flow: &mut OpticalFlow,
    ) -> CameraMotion {
        if self.sought_s.is_none() {
            self.seek(&frame.luma, frame.time_s);
            if self.corners.len() >= LEAST_CORNERS {
                self.sight.note(true, frame.time_s);
                self.motion.background = model::Background::Seen(Agreement {
                    inliers: self.corners.len() as u32,
                    ..Agreement::default()
                });
            }
            return self.motion;
        }
        let mut pairs = self.find(&frame.luma, &self.motion.filmed_from_steady);
        if (pairs.len() as f64) < FEW * self.corners.len() as f64 {
            let jumped = self.jump(previous, present, levels, flow, frame);
            if let Some(jumped) = jumped {
                pairs = self.find(&frame.luma, &jumped);
            }
        }
        let agree_px = AGREE * f64::from(frame.luma.size.width);
        let sought = self.corners.len();
        let agreed = agreed(&pairs, sought, agree_px, &self.outline.corners_px);
        if let Some(agreed) = agreed {
            self.motion.filmed_from_steady = agreed.filmed_from_steady;
        }
        let far_px = FAR * f64::from(frame.luma.size.width);
        let is_far = self.motion.farthest_px(&self.outline.corners_px) > far_px;
        let is_seen = agreed.is_some() && !is_far;
        self.motion.background = match (self.sight.note(is_seen, frame.time_s), agreed) {
            (true, _) => model::Background::Lost,
            (false, Some(agreed)) => model::Background::Seen(agreed.agreement),
            (false, None) => model::Background::Unclear,
        };
        let is_worn = (pairs.len() as f64) < WORN * self.corners.len() as f64;
        let is_due = self.sought_s.is_none_or(|s| frame.time_s - s >= ANEW_S);
        if is_due && (is_worn || self.corners.len() < LEAST_CORNERS) && agreed.is_some() {
            self.seek(&frame.luma, frame.time_s);
        }
        self.motion
    }

    /// Looks for every corner near where it is by `expected`.
    fn find(&self, luma: &Luma, expected: &Similarity2<f64>) -> Vec<Pair> {
        let warp = (expected.isometry.rotation.to_rotation_matrix().matrix() * expected.scaling())
            .cast::<f32>();
        let mut pairs = Vec::with_capacity(self.corners.len());
        for corner in &self.corners {
            let start_px = (expected * corner.steady_px).cast::<f32>();
            if !luma.size.contains(start_px.cast()) {
                continue;
            }
            let found = self.registration.find(&corner.patch, luma, start_px, &warp);
            let is_near = distance(&found.at_px, &start_px) <= NEAR_PX;
            if found.converged && found.ncc >= LEAST_NCC && is_near {
                pairs.push(Pair {
                    from_px: corner.steady_px,
                    to_px: found.at_px.cast(),
                });
            }
        }
        pairs
    }

    /// The motion by optical flow from the frame before, roughly; `None` where corners do not
    /// agree.
    fn jump(
        &mut self,
        previous: &Pyramid,
        present: &Pyramid,
        levels: u32,
        flow: &mut OpticalFlow,
        frame: &Frame,
    ) -> Option<Similarity2<f64>> {
        let Buffers { from, flow: to } = &mut self.buffers;
        from.clear();
        let before = &self.motion.filmed_from_steady;
        from.extend(
            self.corners
                .iter()
                .map(|c| (before * c.steady_px).cast::<f32>()),
        );
        flow.track(previous, present, from, levels, to);
        let mut pairs = Vec::with_capacity(to.len());
        for (corner, flow) in self.corners.iter().zip(to.iter()) {
            if flow.found {
                pairs.push(Pair {
                    from_px: corner.steady_px,
                    to_px: flow.to.cast(),
                });
            }
        }
        // Where to look is known well enough within twice the reach of a patch.
        let agree_px = 2.0 * AGREE * f64::from(frame.luma.size.width);
        let sought = self.corners.len();
        let agreed = agreed(&pairs, sought, agree_px, &self.outline.corners_px)?;
        Some(agreed.filmed_from_steady)
    }

    /// Takes the clearest corners of this picture for those that are followed.
    fn seek(&mut self, luma: &Luma, time_s: f64) {
        self.sought_s = Some(time_s);
        let filmed_from_steady = self.motion.filmed_from_steady;
        let corners_px = self
            .outline
            .corners_outside(luma, &self.motion)
            .unwrap_or_else(|e| {
                tracing::error!("corners of the background in a {} picture: {e}", luma.size);
                Vec::new()
            });
        self.corners.clear();
        for at_px in corners_px {
            self.corners.push(Corner {
                steady_px: filmed_from_steady.inverse_transform_point(&at_px.cast()),
                patch: self.registration.patch(luma, at_px),
            });
        }
    }
}

impl Wide {
    /// Clear corners where the tree cannot be, px.
    fn corners_outside(
        &self,
        luma: &Luma,
        motion: &CameraMotion,
    ) -> opencv::Result<Vec<Point2<f32>>> {
        let (rows, cols) = (luma.size.height as i32, luma.size.width as i32);
        let picture = Mat::new_rows_cols_with_data(rows, cols, &luma.pixels)?;
        let tree = Mat::new_rows_cols_with_data(rows, cols, &self.mask)?;
        // Where the outline is in this picture, within what the camera has moved.
        let moved_px = motion
            .farthest_px(&luma.size.corners_px())
            .min(f64::from(cols))
            .ceil() as i32;
        let radius = (OFF_OUTLINE * f64::from(cols)).ceil() as i32 + moved_px;
        let side = 2 * radius + 1;
        let square =
            get_structuring_element(MORPH_RECT, CvSize::new(side, side), Point::new(-1, -1))?;
        let mut wide = Mat::default();
        dilate_def(&tree, &mut wide, &square)?;
        let mut allowed = Mat::new_rows_cols_with_default(rows, cols, CV_8UC1, Scalar::all(0.0))?;
        let inner = Rect::new(
            OFF_EDGE_PX,
            OFF_EDGE_PX,
            (cols - 2 * OFF_EDGE_PX).max(0),
            (rows - 2 * OFF_EDGE_PX).max(0),
        );
        rectangle(&mut allowed, inner, Scalar::all(255.0), FILLED, LINE_8, 0)?;
        allowed.set_to(&Scalar::all(0.0), &wide)?;
        let mut corners: Vector<Point2f> = Vector::new();
        good_features_to_track(
            &picture,
            &mut corners,
            CORNERS,
            CLEAR,
            APART * f64::from(cols),
            &allowed,
            BLOCK_PX,
            false,
            0.04,
        )?;
        Ok(corners.iter().map(|c| Point2::new(c.x, c.y)).collect())
    }
}

/// A motion on which corners agree.
#[derive(Clone, Copy, Debug)]
struct Agreed {
    filmed_from_steady: Similarity2<f64>,
    agreement: Agreement,
}

/// The similarity on which most pairs, of `sought` that there may be, agree to `agree_px` (least
/// squares, reweighted), and its standard deviation at the worst of `places_px`; `None` where most
/// do not agree, or it is too unsure.
fn agreed(
    pairs: &[Pair],
    sought: usize,
    agree_px: f64,
    places_px: &[Point2<f64>],
) -> Option<Agreed> {
    let least = (LEAST_FOUND * sought as f64).max(LEAST_CORNERS as f64);
    if (pairs.len() as f64) < least {
        return None;
    }
    let common = CommonMotion::of(pairs)?;
    let misses_px = pairs.iter().map(|pair| pair.miss_px(&common.motion).norm());
    let agreeing: Vec<f64> = misses_px.filter(|px| *px <= agree_px).collect();
    let n_agree = agreeing.len();
    if (n_agree as f64) < least.max(LEAST_AGREE * pairs.len() as f64) {
        return None;
    }
    let sd_px = common.worst_sd_px(places_px);
    (sd_px <= LARGEST_SD_PX).then_some(Agreed {
        filmed_from_steady: common.motion,
        agreement: Agreement {
            sd_px,
            inliers: n_agree as u32,
            rms_px: rms(agreeing),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Generator, generator};
    use nalgebra::Vector2;
    use rand::RngExt;

    /// Corners all over a picture, found to 0.05 px.
    fn pairs(n: usize, motion: &Similarity2<f64>, random: &mut Generator) -> Vec<Pair> {
        let mut pairs = Vec::with_capacity(n);
        for _ in 0..n {
            let steady_px = Point2::new(
                640.0 * random.random::<f64>(),
                360.0 * random.random::<f64>(),
            );
            let noise =
                0.17 * Vector2::new(random.random::<f64>() - 0.5, random.random::<f64>() - 0.5);
            pairs.push(Pair {
                from_px: steady_px,
                to_px: motion * steady_px + noise,
            });
        }
        pairs
    }

    const PLACES: [Point2<f64>; 2] = [Point2::new(200.0, 20.0), Point2::new(440.0, 330.0)];

    /// A third of the corners are leaves of a hedge; the interval holds the truth, as a rule.
    #[test]
    fn the_motion_is_that_on_which_most_corners_agree() {
        let mut random = generator(5, 0);
        let mut within = 0;
        for round in 0..200 {
            let shift = Vector2::new(0.1 * f64::from(round) - 9.0, 3.0);
            let truth = Similarity2::new(shift, 0.002, 1.003);
            let mut pairs = pairs(150, &truth, &mut random);
            for pair in pairs.iter_mut().step_by(3) {
                let own = Vector2::new(random.random::<f64>() - 0.5, random.random::<f64>() - 0.5);
                pair.to_px += 12.0 * own;
            }
            let found = agreed(&pairs, 150, 0.5, &PLACES).expect("most agree");
            let off_px = PLACES.map(|at| (found.filmed_from_steady * at - truth * at).norm());
            let off_px = off_px[0].max(off_px[1]);
            assert!(off_px < 0.06, "{round}: {off_px}");
            within += u32::from(off_px < 2.5 * found.agreement.sd_px);
        }
        assert!(within >= 185, "{within}");
    }

    #[test]
    fn few_corners_or_corners_at_odds_say_nothing() {
        let mut random = generator(6, 0);
        let truth = Similarity2::new(Vector2::new(1.0, 0.0), 0.0, 1.0);
        assert!(agreed(&pairs(8, &truth, &mut random), 8, 0.5, &PLACES).is_none());
        // A hand on the lens lets some through.
        let some = pairs(30, &truth, &mut random);
        assert!(agreed(&some, 300, 0.5, &PLACES).is_none());
        assert!(agreed(&some, 100, 0.5, &PLACES).is_some());
        let mut at_odds = pairs(100, &truth, &mut random);
        for pair in &mut at_odds {
            let own = Vector2::new(random.random::<f64>() - 0.5, random.random::<f64>() - 0.5);
            pair.to_px += 12.0 * own;
        }
        assert!(agreed(&at_odds, 100, 0.5, &PLACES).is_none());
        // All in one corner of the picture: what is far from it is not known.
        let mut aside = pairs(14, &truth, &mut random);
        for pair in &mut aside {
            pair.from_px = Point2::origin() + 0.02 * pair.from_px.coords;
            pair.to_px = truth * pair.from_px + Vector2::new(random.random::<f64>() - 0.5, 0.0);
        }
        assert!(agreed(&aside, 14, 0.5, &PLACES).is_none());
    }
}
