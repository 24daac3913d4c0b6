//! Corners of what stands still, found again in every picture by their first patches, and the
//! similarity on which they agree.

use super::flow::{Flow, OpticalFlow, Pyramid};
use super::register::{Patch, Registration};
use crate::model::{Agreement, Luma, Size};
use crate::signal::statistics::rms;
use crate::signal::{CommonMotion, Pair};
use nalgebra::{Point2, Similarity2, distance};
use opencv::core::{Mat, Point2f, Vector};
use opencv::imgproc::good_features_to_track;

/// Side of the window over which the structure tensor is averaged, px.
const BLOCK_PX: i32 = 3;
/// A corner is found where it looks like its first patch to this correlation, and no farther than
/// this from where it is expected, px.
const LEAST_NCC: f32 = 0.8;
const NEAR_PX: f32 = 3.0;
/// If so small a share is found, the camera has jumped: optical flow says where to look.
const FEW: f64 = 0.5;
/// Corners are worn where fewer than this share of them is found.
const WORN: f64 = 0.6;
/// Corners agree on a motion that they miss by no more than this share of the picture's width:
/// 0.5 px of 640.
const AGREE: f64 = 0.5 / 640.0;
/// Fewer corners than this, or than these shares of those that were found and of those that were
/// looked for, say nothing of the camera: a lens cap or fog lets some through.
const LEAST_CORNERS: usize = 12;
const LEAST_AGREE: f64 = 0.5;
const LEAST_FOUND: f64 = 0.15;
/// A motion that is less sure than this at the places that matter is none, px: corners on one side
/// of the tree alone do not say what happens on the other.
const LARGEST_SD_PX: f64 = 0.3;

/// Corners that are followed.
#[derive(Default)]
pub struct Landmarks {
    registration: Registration,
    corners: Vec<Corner>,
    buffers: Buffers,
}

/// A corner, and what it looked like.
struct Corner {
    steady_px: Point2<f64>,
    patch: Patch,
}

#[derive(Default)]
struct Buffers {
    from: Vec<Point2<f32>>,
    flow: Vec<Flow>,
}

/// A frame, its pyramid and that of the frame before.
pub struct Pictures<'a> {
    pub luma: &'a Luma,
    pub time_s: f64,
    pub previous: &'a Pyramid,
    pub present: &'a Pyramid,
    pub levels: u32,
}

/// Which corners are taken.
#[derive(Clone, Copy, Debug)]
pub struct CornerChoice {
    /// At most so many.
    pub most: i32,
    /// How far apart they are at least, as a share of the picture's width.
    pub apart: f64,
    /// How clear each is at least, as a share of the clearest one.
    pub clear: f64,
}

/// A motion on which corners agree.
#[derive(Clone, Copy, Debug)]
pub struct Agreed {
    pub common: CommonMotion,
    pub agreement: Agreement,
    /// So few of the corners are still found that new ones should be taken.
    pub is_worn: bool,
}

impl Landmarks {
    /// Whether there are as many as it takes to know a motion.
    pub fn suffice(&self) -> bool {
        self.corners.len() >= LEAST_CORNERS
    }

    /// What is said of the picture in which they were taken.
    pub fn at_first(&self) -> Agreement {
        Agreement {
            inliers: self.corners.len() as u32,
            ..Agreement::default()
        }
    }

    /// Takes the corners `at_px` of a picture in which the camera's motion is this, in place of
    /// those before.
    pub fn take(
        &mut self,
        luma: &Luma,
        at_px: &[Point2<f32>],
        filmed_from_steady: &Similarity2<f64>,
    ) {
        self.corners.clear();
        for at_px in at_px {
            self.corners.push(Corner {
                steady_px: filmed_from_steady.inverse_transform_point(&at_px.cast()),
                patch: self.registration.patch(luma, *at_px),
            });
        }
    }

    /// The motion on which the corners agree in a frame; `before` is that in the frame before. The
    /// motion is to be sure at `places_px`, at their steady places. `None` where the corners do not
    /// say it.
    pub fn follow(
        &mut self,
        pictures: &Pictures,
        before: &Similarity2<f64>,
        places_px: &[Point2<f64>],
        flow: &mut OpticalFlow,
    ) -> Option<Agreed> {
        let luma = pictures.luma;
        let sought = self.corners.len();
        let mut pairs = self.find(luma, before);
        if (pairs.len() as f64) < FEW * sought as f64 {
            let jumped = self.jump(pictures, before, places_px, flow);
            if let Some(jumped) = jumped {
                pairs = self.find(luma, &jumped);
            }
        }
        agreed(&pairs, sought, agree_px(luma.size), places_px)
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
        pictures: &Pictures,
        before: &Similarity2<f64>,
        places_px: &[Point2<f64>],
        flow: &mut OpticalFlow,
    ) -> Option<Similarity2<f64>> {
        let Buffers { from, flow: to } = &mut self.buffers;
        from.clear();
        from.extend(
            self.corners
                .iter()
                .map(|c| (before * c.steady_px).cast::<f32>()),
        );
        let Pictures {
            luma,
            previous,
            present,
            levels,
            ..
        } = pictures;
        flow.track(previous, present, from, *levels, to);
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
        let agree_px = 2.0 * agree_px(luma.size);
        let agreed = agreed(&pairs, self.corners.len(), agree_px, places_px)?;
        Some(agreed.common.motion)
    }
}

/// Corners agree on a motion that they miss by no more than this in a picture of this size, px.
pub fn agree_px(size: Size) -> f64 {
    AGREE * f64::from(size.width)
}

/// The clearest corners (Shi and Tomasi 1994) of a picture where `allowed` is not 0, px.
pub fn clear_corners(
    luma: &Luma,
    allowed: &Mat,
    choice: CornerChoice,
) -> opencv::Result<Vec<Point2<f32>>> {
    let (rows, cols) = (luma.size.height as i32, luma.size.width as i32);
    let picture = Mat::new_rows_cols_with_data(rows, cols, &luma.pixels)?;
    let mut corners: Vector<Point2f> = Vector::new();
    good_features_to_track(
        &picture,
        &mut corners,
        choice.most,
        choice.clear,
        choice.apart * f64::from(cols),
        allowed,
        BLOCK_PX,
        false,
        0.04,
    )?;
    Ok(corners.iter().map(|c| Point2::new(c.x, c.y)).collect())
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
        common,
        agreement: Agreement {
            sd_px,
            inliers: n_agree as u32,
            rms_px: rms(agreeing),
        },
        is_worn: (pairs.len() as f64) < WORN * sought as f64,
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
            let off_px = PLACES.map(|at| (found.common.motion * at - truth * at).norm());
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
