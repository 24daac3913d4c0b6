//! The camera's motion, from what stands still around the tree.
//!
//! Corners outside of the outline are found again in every picture by their first patches; the
//! similarity on which they agree is the camera's motion. Corners that move by themselves, leaves
//! of a hedge or somebody who walks by, lose their weight. Where there are none, or they do not
//! agree, a tag beside the tree serves, and without one the foot of the trunk.

use super::flow::OpticalFlow;
use super::landmarks::{CornerChoice, Landmarks, Pictures, clear_corners};
use super::tag_marks::TagMarks;
use super::trunk_foot::TrunkFoot;
use crate::model::{self, CameraMotion, Luma, Outline, Size};
use nalgebra::Point2;
use opencv::core::{CV_8UC1, Mat, Point, Rect, Scalar, Size as CvSize};
use opencv::imgproc::{FILLED, LINE_8, MORPH_RECT, dilate_def, get_structuring_element, rectangle};
use opencv::prelude::*;

/// Corners around an outline.
const AROUND: CornerChoice = CornerChoice {
    most: 300,
    apart: 0.012,
    clear: 0.01,
};
/// Corners of a picture of which nothing is known: so far apart that they lie all over it, and the
/// tree, which has the clearest ones, has no more than its share of the picture.
const EVERYWHERE: CornerChoice = CornerChoice {
    most: 300,
    apart: 0.03,
    clear: 0.001,
};
/// Corners keep so far from the outline, which the tree may leave when it sways, as a share of the
/// picture's width; and from the picture's edge, px: a patch that hangs over it changes.
const OFF_OUTLINE: f64 = 0.02;
const OFF_EDGE_PX: i32 = 8;
/// New corners are looked for where those that there are are worn, after so long, s.
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
    region: Region,
    landmarks: Landmarks,
    tag: TagMarks,
    /// Serves where the background does not; `None` where there is no trunk to be seen.
    foot: Option<TrunkFoot>,
    /// Corners were looked for at this time, s; `None` before the first frame.
    sought_s: Option<f64>,
    motion: CameraMotion,
    sight: Sight,
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

/// Where corners are looked for.
struct Region {
    choice: CornerChoice,
    /// Where the tree may be, row by row; 0 elsewhere. Empty where that is not known.
    tree: Vec<u8>,
    /// Where the motion is to be sure: the corners of the box around the tree, px.
    places_px: [Point2<f64>; 4],
}

impl Background {
    /// Before the first picture. Nothing within `outline` counts.
    pub fn around(outline: &Outline) -> Self {
        let [left, top, right, bottom] = outline.bounds_px().unwrap_or_default().map(f64::from);
        let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
        let region = Region {
            choice: AROUND,
            tree: outline.mask.clone(),
            places_px: corners.map(|(u, v)| Point2::new(u, v)),
        };
        Self {
            foot: TrunkFoot::of(outline),
            ..Self::of(region)
        }
    }

    /// Before the first picture, of `size`, in which nobody knows where the tree is: all of it
    /// counts, and the tree's corners are outvoted.
    pub fn everywhere(size: Size) -> Self {
        Self::of(Region {
            choice: EVERYWHERE,
            tree: Vec::new(),
            places_px: size.corners_px(),
        })
    }

    fn of(region: Region) -> Self {
        Self {
            region,
            landmarks: Landmarks::default(),
            tag: TagMarks::default(),
            foot: None,
            sought_s: None,
            motion: CameraMotion::default(),
            sight: Sight::default(),
        }
    }

    /// A tag that hangs beside the tree is seen with these corners, px, in the next picture.
    pub fn see_tag(&mut self, corners_px: [Point2<f64>; 4]) {
        self.tag.see(corners_px);
    }

    /// By how much the surroundings were off the tag, px, when they were found to move by themselves;
    /// once.
    pub fn take_dispute(&mut self) -> Option<f64> {
        self.tag.take_dispute()
    }

    /// The camera's motion in the newest of the `pictures`.
    pub fn step(&mut self, pictures: &Pictures, flow: &mut OpticalFlow) -> CameraMotion {
        let Pictures { luma, time_s, .. } = *pictures;
        if self.sought_s.is_none() {
            self.begin(luma, time_s);
            return self.motion;
        }
        let was = self.motion;
        let before = was.filmed_from_steady;
        let places_px = &self.region.places_px;
        let around = self.landmarks.follow(pictures, &before, places_px, flow);
        let by_tag = self.tag.follow(pictures, &before, places_px, flow);
        let is_worn = around.is_some_and(|around| around.is_worn);
        let agreed = self.tag.judge(around, by_tag, luma.size, places_px);
        if let Some(agreed) = agreed {
            self.motion.filmed_from_steady = agreed.common.motion;
        }
        let far_px = FAR * f64::from(luma.size.width);
        let is_far = self.motion.farthest_px(places_px) > far_px;
        let is_seen = agreed.is_some() && !is_far;
        self.motion.background = match (self.sight.note(is_seen, time_s), agreed) {
            (true, _) => model::Background::Lost,
            (false, Some(agreed)) => model::Background::Seen(agreed.agreement),
            (false, None) => model::Background::Unclear,
        };
        let is_due = self.sought_s.is_none_or(|s| time_s - s >= ANEW_S);
        if is_due && is_worn {
            self.seek(luma, time_s);
        }
        if self.motion.background == model::Background::Unclear
            && let Some(foot) = &mut self.foot
            && let Some(by_foot) = foot.follow(pictures, &was, flow)
        {
            self.motion = by_foot;
        }
        self.tag.take(luma, &self.motion.filmed_from_steady);
        self.motion
    }

    /// Takes the corners of the first picture.
    fn begin(&mut self, luma: &Luma, time_s: f64) {
        self.seek(luma, time_s);
        let has_foot = self.foot.as_mut().is_some_and(|foot| foot.begin(luma));
        self.tag.take(luma, &self.motion.filmed_from_steady);
        let shown_by = [&self.landmarks, self.tag.landmarks()];
        if let Some(shows) = shown_by.into_iter().find(|by| by.suffice()) {
            self.sight.note(true, time_s);
            self.motion.background = model::Background::Seen(shows.at_first());
        } else if let Some(foot) = self.foot.as_ref().filter(|_| has_foot) {
            self.motion.background = model::Background::Foot(foot.at_first());
        }
    }

    /// Takes the clearest corners of this picture for those that are followed.
    fn seek(&mut self, luma: &Luma, time_s: f64) {
        self.sought_s = Some(time_s);
        let corners_px = self.region.corners(luma, &self.motion).unwrap_or_else(|e| {
            tracing::error!("corners of the background in a {} picture: {e}", luma.size);
            Vec::new()
        });
        self.landmarks
            .take(luma, &corners_px, &self.motion.filmed_from_steady);
    }
}

impl Region {
    /// Clear corners where the tree cannot be, px.
    fn corners(&self, luma: &Luma, motion: &CameraMotion) -> opencv::Result<Vec<Point2<f32>>> {
        let (rows, cols) = (luma.size.height as i32, luma.size.width as i32);
        let mut allowed = Mat::new_rows_cols_with_default(rows, cols, CV_8UC1, Scalar::all(0.0))?;
        let inner = Rect::new(
            OFF_EDGE_PX,
            OFF_EDGE_PX,
            (cols - 2 * OFF_EDGE_PX).max(0),
            (rows - 2 * OFF_EDGE_PX).max(0),
        );
        rectangle(&mut allowed, inner, Scalar::all(255.0), FILLED, LINE_8, 0)?;
        if !self.tree.is_empty() {
            allowed.set_to(&Scalar::all(0.0), &self.wide_tree(luma.size, motion)?)?;
        }
        clear_corners(luma, &allowed, self.choice)
    }

    /// Where the tree may be in a picture, within what the camera has moved.
    fn wide_tree(&self, size: Size, motion: &CameraMotion) -> opencv::Result<Mat> {
        let (rows, cols) = (size.height as i32, size.width as i32);
        let tree = Mat::new_rows_cols_with_data(rows, cols, &self.tree)?;
        let moved_px = motion
            .farthest_px(&size.corners_px())
            .min(f64::from(cols))
            .ceil() as i32;
        let radius = (OFF_OUTLINE * f64::from(cols)).ceil() as i32 + moved_px;
        let side = 2 * radius + 1;
        let square =
            get_structuring_element(MORPH_RECT, CvSize::new(side, side), Point::new(-1, -1))?;
        let mut wide = Mat::default();
        dilate_def(&tree, &mut wide, &square)?;
        Ok(wide)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Track;
    use crate::model::Background::Foot;
    use crate::track::flow::Pyramid;

    const SIZE: Size = Size {
        width: 320,
        height: 240,
    };
    /// Where the trunk stands, and where its crown begins.
    const FOOT: Point2<f64> = Point2::new(160.0, 219.0);
    const CROWN_ROW: f64 = 90.0;

    /// The tree's outline: a crown, and a trunk down to the foot.
    fn outline() -> Outline {
        let mut mask = vec![0; SIZE.area()];
        for (i, inside) in mask.iter_mut().enumerate() {
            let (u, v) = (i as u32 % SIZE.width, i as u32 / SIZE.width);
            let crown = (100..220).contains(&u) && (30..=90).contains(&v);
            let trunk = (150..171).contains(&u) && (90..=219).contains(&v);
            *inside = if crown || trunk { 255 } else { 0 };
        }
        Outline {
            size: SIZE,
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        }
    }

    /// What is around the tree: a wall with or without structure, which goes to the right, and a tag.
    #[derive(Clone, Copy, Default)]
    struct Around {
        has_structure: bool,
        wall_px_s: f64,
        has_tag: bool,
    }

    const CELL_PX: f64 = 6.0;
    const TAG_PX: [Point2<f64>; 4] = [
        Point2::new(24.0, 130.0),
        Point2::new(72.0, 130.0),
        Point2::new(72.0, 178.0),
        Point2::new(24.0, 178.0),
    ];

    /// Ink or paper at a place of the tag, `None` beside it: cells as of a code, a black rim and paper.
    fn tag_at(u: f64, v: f64) -> Option<f64> {
        let column = ((u - TAG_PX[0].x) / CELL_PX).floor() as i32;
        let row = ((v - TAG_PX[0].y) / CELL_PX).floor() as i32;
        if !(-1..9).contains(&column) || !(-1..9).contains(&row) {
            return None;
        }
        let is_inside = (0..8).contains(&column) && (0..8).contains(&row);
        let is_code = (1..7).contains(&column) && (1..7).contains(&row);
        let is_white = !is_inside || is_code && (5 * column * row + column + 3 * row) % 7 > 2;
        Some(if is_white { 215.0 } else { 30.0 })
    }

    /// The tag as a pixel shows it.
    fn tag_pixel(u: f64, v: f64) -> Option<f64> {
        let mut sum = 0.0;
        for k in 0..16 {
            let off = [k % 4, k / 4].map(|i| (f64::from(i) + 0.5) / 4.0 - 0.5);
            sum += tag_at(u + off[0], v + off[1])?;
        }
        Some(sum / 16.0)
    }

    /// The picture of a camera that has moved by `shift`, of a tree that is turned about its foot by
    /// `sway`, before a wall that has gone to the right by `wall_px`.
    fn picture(shift: [f64; 2], sway: f64, around: Around, wall_px: f64) -> Luma {
        let mut pixels = Vec::with_capacity(SIZE.area());
        for i in 0..SIZE.area() {
            let u = (i % SIZE.width as usize) as f64 - shift[0];
            let v = (i / SIZE.width as usize) as f64 - shift[1];
            let aside = u - FOOT.x - sway * (FOOT.y - v);
            let trunk = ((9.0 - aside.abs()) / 3.0).clamp(0.0, 1.0);
            let above = ((FOOT.y - v) / 3.0).clamp(0.0, 1.0);
            let bark = 60.0 + 12.0 * ((0.8 * aside).sin() + (0.5 * v).sin());
            let crown = if (36.0..CROWN_ROW).contains(&v) {
                0.5 * (60.0 - aside.abs())
            } else {
                0.0
            };
            let w = u - wall_px;
            let wall = 30.0 * ((0.31 * w).sin() * (0.27 * v).cos() + (0.13 * w * v / 40.0).sin());
            let wall = 180.0 + f64::from(u8::from(around.has_structure)) * wall;
            let tag = around.has_tag.then(|| tag_pixel(u, v)).flatten();
            let wall = tag.unwrap_or(wall);
            let tree = (trunk * above).max(crown.clamp(0.0, 1.0));
            pixels.push((wall + tree * (bark - wall)).round().clamp(0.0, 255.0) as u8);
        }
        Luma { size: SIZE, pixels }
    }

    /// What was said of the camera's motions in 60 frames, held against the truth.
    struct Followed {
        /// Frames in which the background showed it, and in which the foot did.
        seen: usize,
        by_foot: usize,
        /// By how much it was off at most, and in the last frame, px.
        off_px: f64,
        off_at_end_px: f64,
        is_disputed: bool,
    }

    fn followed(around: Around, outline: &Outline) -> Followed {
        let settings = Track::default();
        let mut background = Background::around(outline);
        let mut flow = OpticalFlow::new(settings.window_px);
        let (mut previous, mut present) = (Pyramid::default(), Pyramid::default());
        let (mut seen, mut by_foot, mut off_px) = (0, 0, 0.0_f64);
        let mut off_at_end_px = f64::INFINITY;
        for k in 0..60_u32 {
            let t = f64::from(k) / 30.0;
            let shift = [2.0 * (14.0 * t).sin(), 1.2 * (9.0 * t).sin()];
            let sway = 0.03 * (5.0 * t).sin();
            let luma = picture(shift, sway, around, around.wall_px_s * t);
            std::mem::swap(&mut previous, &mut present);
            present.rebuild(&luma, settings.window_px, settings.levels);
            let pictures = Pictures {
                luma: &luma,
                time_s: t,
                previous: &previous,
                present: &present,
                levels: settings.levels,
            };
            if around.has_tag && k == 0 {
                background.see_tag(TAG_PX);
            }
            let motion = background.step(&pictures, &mut flow);
            match motion.background {
                model::Background::Seen(_) => seen += 1,
                Foot(_) => by_foot += 1,
                model::Background::Unclear | model::Background::Lost => continue,
            }
            let moved = motion.filmed_px(FOOT) - FOOT;
            off_at_end_px = (moved.x - shift[0]).hypot(moved.y - shift[1]);
            off_px = off_px.max(off_at_end_px);
        }
        Followed {
            seen,
            by_foot,
            off_px,
            off_at_end_px,
            is_disputed: background.take_dispute().is_some(),
        }
    }

    #[test]
    fn the_foot_of_a_swaying_trunk_serves_where_the_background_is_plain() {
        let plain = followed(Around::default(), &outline());
        assert_eq!((plain.seen, plain.by_foot), (0, 60));
        assert!(plain.off_px < 0.6, "{}", plain.off_px);
        let structured = Around {
            has_structure: true,
            ..Around::default()
        };
        let wall = followed(structured, &outline());
        assert_eq!((wall.seen, wall.by_foot), (60, 0));
        assert!(wall.off_px < 0.1, "{}", wall.off_px);
    }

    #[test]
    fn a_tag_serves_where_the_background_is_plain_or_moves() {
        let tagged = Around {
            has_tag: true,
            ..Around::default()
        };
        let plain = followed(tagged, &outline());
        assert_eq!((plain.seen, plain.is_disputed), (60, false));
        assert!(plain.off_px < 0.3, "{}", plain.off_px);
        let still = Around {
            has_structure: true,
            ..tagged
        };
        let still = followed(still, &outline());
        assert_eq!((still.seen, still.is_disputed), (60, false));
        assert!(still.off_px < 0.1, "{}", still.off_px);
        let drifting = Around {
            has_structure: true,
            wall_px_s: 4.0,
            ..tagged
        };
        let drifting = followed(drifting, &outline());
        assert!(drifting.is_disputed && drifting.off_at_end_px < 0.3);
    }

    /// An outline that does not end at the foot holds nothing that stands still.
    #[test]
    fn a_crown_alone_says_nothing_of_the_camera() {
        let mut crown = outline();
        crown.mask[91 * SIZE.width as usize..].fill(0);
        assert_eq!(followed(Around::default(), &crown).by_foot, 0);
    }
}
