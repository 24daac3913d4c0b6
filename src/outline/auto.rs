//! The outline found by itself: what moves over the first seconds and was elsewhere in the first
//! picture, without the shadow, closed to one region. Pictures are compared with the camera's
//! motion taken off.

use super::steady::steadiness;
use super::{feet, region, still, trunk};
use crate::config;
use crate::model::{CameraMotion, Luma, Outline, Size};
use crate::signal::median;
use nalgebra::Point2;

/// Width to which pictures are reduced, px: sway of a pixel or two is then still seen, single-pixel
/// noise is not.
const REDUCED_WIDTH: u32 = 320;
/// While nothing is found it is tried again after so long, s: one try takes as long as a frame or
/// two.
const TRY_EVERY_S: f64 = 0.5;
/// Motion must stand out so many times above the standard deviation of the picture's quietest
/// quarter, which is no tree, and above this in grey levels: sensor noise and compression stay
/// below.
const ABOVE_QUIET: f32 = 4.0;
const ABOVE_GREY: f32 = 3.0;
/// What moves was tree in the first picture if it was so many grey levels off its median over time
/// there: the pixel that the tree only swept over later shows its background at first, as it does
/// most of the time.
const OFF_MEDIAN: u8 = 6;
/// Gaps up to this share of the picture's width are closed: between branches there is sky that does
/// not move.
const CLOSE_SHARE: f64 = 0.045;
/// Limbs whose fork hardly moves lie farther apart: up to this share is closed if one piece then
/// has nearly all.
const CLOSE_MOST: f64 = 0.08;
const CLOSE_STEP: f64 = 0.01;
const NEARLY_ALL: f64 = 0.9;
/// The region is drawn so much wider than what moves, as a share of the picture's width; the trunk
/// is not.
const MARGIN_SHARE: f64 = 0.006;
/// Pieces smaller than this share of all that moves are noise; gaps of two pixels do not make two
/// pieces.
const SPECK_SHARE: f64 = 0.002;
const SPECK_GAP_PX: u32 = 2;
/// Pictures kept, and the least time between two of them at first, s; when there are too many,
/// every other one goes.
const MOST_KEPT: usize = 60;
const KEEP_EVERY_S: f64 = 1.0 / 20.0;
/// Pictures in which structure is compared.
const COMPARED: usize = 20;
/// Least share of the picture that a tree covers.
const LEAST_COVERAGE: f64 = 0.005;
/// Where less than this share of it moves, closing does not make a tree of it.
const LEAST_MOVING: f64 = LEAST_COVERAGE / 10.0;

/// Gathers motion energy: the variance of every pixel's brightness over time (Welford's running
/// form), less half the mean square of its change from frame to frame. Of white noise that leaves
/// nothing; a sway, which takes many frames, keeps nearly all of its variance.
pub struct AutoOutline {
    settings: config::Outline,
    start_s: Option<f64>,
    tried_s: Option<f64>,
    reduced: Size,
    scale: u32,
    count: f32,
    mean: Vec<f32>,
    sum_sq: Vec<f32>,
    last: Vec<f32>,
    sum_change_sq: Vec<f32>,
    /// The first is the one that the outline is for.
    kept: Vec<Kept>,
    /// Pixels at the picture's border that the camera's motion has brought in, reduced, px.
    border_px: f64,
    keep_every_s: f64,
}

/// A picture that is kept, reduced and with the camera's motion taken off.
struct Kept {
    time_s: f64,
    picture: Luma,
    /// What was taken off.
    camera: CameraMotion,
}

/// What the gathering has come to.
#[derive(Debug)]
pub enum Found {
    /// Go on; progress from 0 to 1.
    NotYet(f64),
    /// Motion concentrates here.
    Tree(Outline),
    /// Nothing moved for the longest time allowed: the whole picture, for want of better.
    NoMotion(Outline),
}

impl AutoOutline {
    pub fn new(settings: &config::Outline) -> Self {
        Self {
            settings: settings.clone(),
            start_s: None,
            tried_s: None,
            reduced: Size::new(0, 0),
            scale: 1,
            count: 0.0,
            mean: Vec::new(),
            sum_sq: Vec::new(),
            last: Vec::new(),
            sum_change_sq: Vec::new(),
            kept: Vec::new(),
            border_px: 0.0,
            keep_every_s: KEEP_EVERY_S,
        }
    }

    /// Tracking will begin at `time_s`, not at the first picture: the outline is to be that of
    /// then.
    pub fn begin_at(&mut self, time_s: f64) {
        let before = self.kept.partition_point(|kept| kept.time_s < time_s);
        self.kept
            .drain(..before.min(self.kept.len().saturating_sub(1)));
    }

    /// Takes the next picture, seen at `time_s` by a camera that has moved so since the first one.
    pub fn step(&mut self, luma: &Luma, time_s: f64, camera: &CameraMotion) -> Found {
        let start_s = *self.start_s.get_or_insert_with(|| {
            self.scale = luma.size.width.div_ceil(REDUCED_WIDTH).max(1);
            self.reduced = Size::new(
                luma.size.width / self.scale,
                (luma.size.height / self.scale).max(1),
            );
            let zero = vec![0.0; self.reduced.area()];
            (self.mean, self.sum_sq) = (zero.clone(), zero.clone());
            (self.last, self.sum_change_sq) = (zero.clone(), zero);
            time_s
        });
        match still::without_motion(luma, camera) {
            Ok(steady) => {
                let picture = self.add(&steady);
                self.keep(Kept {
                    time_s,
                    picture,
                    camera: *camera,
                });
                let moved_px = camera.farthest_px(&luma.size.corners_px());
                self.border_px = self.border_px.max(moved_px / f64::from(self.scale));
            }
            Err(e) => tracing::error!("a {} picture without the camera's motion: {e}", luma.size),
        }
        let gathered_s = time_s - start_s;
        if gathered_s < self.settings.gather_s {
            return Found::NotYet(gathered_s / self.settings.gather_s);
        }
        let over = gathered_s >= self.settings.give_up_s;
        if !over
            && self
                .tried_s
                .is_some_and(|tried_s| time_s - tried_s < TRY_EVERY_S)
        {
            return Found::NotYet(0.99);
        }
        self.tried_s = Some(time_s);
        match self.conclude(luma.size) {
            Some(outline) => Found::Tree(outline),
            None if over => Found::NoMotion(whole(luma.size)),
            None => Found::NotYet(0.99),
        }
    }

    /// The region as far as the pictures so far show it; `None` if nothing moves.
    pub fn conclude(&self, size: Size) -> Option<Outline> {
        let small = self.reduced_region().unwrap_or_else(|e| {
            tracing::error!("automatic outline: {e}");
            None
        })?;
        // The border is traced anew at full size, so that it encloses just the pixels of the mask.
        let camera = self.kept.first()?.camera;
        let mask = enlarged(&small, size, self.scale, &camera);
        let outline = region::close_to_one(size, &mask, 0).unwrap_or_else(|e| {
            tracing::error!("automatic outline: {e}");
            None
        })?;
        let at_first = |foot: Point2<i32>| {
            let steady_px = foot.cast::<f64>() * f64::from(self.scale);
            camera.filmed_px(steady_px).map(|px| px.round() as i32)
        };
        Some(Outline {
            other_foot_px: small.other_foot_px.map(at_first),
            ..outline
        })
    }

    fn reduced_region(&self) -> opencv::Result<Option<Outline>> {
        let size = self.reduced;
        let deviation = self.motion();
        let Some(mut mask) = self.moving_tree(&deviation) else {
            return Ok(None);
        };
        region::without_specks(size, &mut mask, SPECK_GAP_PX, SPECK_SHARE)?;
        let step = self.kept.len().div_ceil(COMPARED);
        let compared: Vec<&Luma> = self
            .kept
            .iter()
            .step_by(step)
            .map(|kept| &kept.picture)
            .collect();
        let trunk = trunk::stand(size, &mut mask, &steadiness(&compared));
        let Some(one) = closed(size, &mask)? else {
            return Ok(None);
        };
        let mut wide = region::grown(size, &one.mask, share_px(size, MARGIN_SHARE))?;
        if let Some(trunk) = trunk {
            let below = trunk.waist * size.width as usize;
            wide[below..].copy_from_slice(&one.mask[below..]);
        }
        let outline = region::close_to_one(size, &wide, 0)?;
        let first = self.kept.first().map(|kept| &kept.picture);
        let other_foot_px = first.and_then(|first| feet::second_foot(first, &one.mask, &deviation));
        Ok(outline
            .filter(|o| o.coverage() >= LEAST_COVERAGE)
            .map(|outline| Outline {
                other_foot_px,
                ..outline
            }))
    }

    /// The pixels that move and were tree in the first picture, 255 there and 0 elsewhere; `None`
    /// if hardly anything moves.
    fn moving_tree(&self, deviation: &[f32]) -> Option<Vec<u8>> {
        let first = self.kept.first().filter(|_| self.count >= 2.0)?;
        let moving = self.moving(deviation);
        let count = moving.iter().filter(|m| **m).count();
        if (count as f64) < LEAST_MOVING * self.reduced.area() as f64 {
            return None;
        }
        let mut mask = self.median_over_time();
        for ((pixel, first), moves) in mask.iter_mut().zip(&first.picture.pixels).zip(moving) {
            let was_tree = moves && first.abs_diff(*pixel) >= OFF_MEDIAN;
            *pixel = if was_tree { 255 } else { 0 };
        }
        Some(mask)
    }

    /// Which pixels change more than noise does.
    fn moving(&self, deviation: &[f32]) -> Vec<bool> {
        let mut sorted = deviation.to_vec();
        let quarter = sorted.len() / 4;
        let quiet = *sorted.select_nth_unstable_by(quarter, f32::total_cmp).1;
        let threshold = (ABOVE_QUIET * quiet).max(ABOVE_GREY);
        let size = self.reduced;
        let border = self.border_px.round() as u32;
        let columns = border..size.width.saturating_sub(border);
        let rows = border..size.height.saturating_sub(border);
        let mut moving = Vec::with_capacity(deviation.len());
        for (i, d) in (0..).zip(deviation.iter().copied()) {
            let inside = columns.contains(&(i % size.width)) && rows.contains(&(i / size.width));
            moving.push(inside && d > threshold);
        }
        moving
    }

    /// Motion energy: the standard deviation of every pixel over time, without noise.
    fn motion(&self) -> Vec<f32> {
        let mut deviation = Vec::with_capacity(self.sum_sq.len());
        for (sum_sq, sum_change_sq) in self.sum_sq.iter().zip(&self.sum_change_sq) {
            let variance = (sum_sq - 0.5 * sum_change_sq) / (self.count - 1.0);
            deviation.push(variance.max(0.0).sqrt());
        }
        deviation
    }

    /// Median of every pixel over time.
    fn median_over_time(&self) -> Vec<u8> {
        let mut medians = Vec::with_capacity(self.reduced.area());
        for i in 0..self.reduced.area() {
            let values = self.kept.iter().map(|kept| kept.picture.pixels[i]);
            medians.push(median(values.collect(), u8::cmp).unwrap_or(0));
        }
        medians
    }

    fn keep(&mut self, kept: Kept) {
        let is_soon = |last: &Kept| kept.time_s - last.time_s < self.keep_every_s;
        if self.kept.last().is_some_and(is_soon) {
            return;
        }
        self.kept.push(kept);
        if self.kept.len() > MOST_KEPT {
            let mut odd = false;
            self.kept.retain(|_| {
                odd = !odd;
                odd
            });
            self.keep_every_s *= 2.0;
        }
    }

    /// Adds a picture to the sums, and gives it back reduced.
    fn add(&mut self, luma: &Luma) -> Luma {
        let mut picture = Luma {
            size: self.reduced,
            pixels: Vec::with_capacity(self.reduced.area()),
        };
        self.count += 1.0;
        let (scale, width) = (self.scale as usize, luma.size.width as usize);
        let per_cell = (scale * scale) as f32;
        for v in 0..self.reduced.height as usize {
            for u in 0..self.reduced.width as usize {
                let rows = luma.pixels[v * scale * width..].chunks(width).take(scale);
                let sum: u32 = rows
                    .flat_map(|row| &row[u * scale..(u + 1) * scale])
                    .map(|&p| u32::from(p))
                    .sum();
                let x = sum as f32 / per_cell;
                let i = v * self.reduced.width as usize + u;
                let before = x - self.mean[i];
                self.mean[i] += before / self.count;
                self.sum_sq[i] += before * (x - self.mean[i]);
                if self.count > 1.0 {
                    self.sum_change_sq[i] += (x - self.last[i]).powi(2);
                }
                self.last[i] = x;
                picture.pixels.push((x + 0.5) as u8);
            }
        }
        picture
    }
}

/// The whole picture as an outline.
pub fn whole(size: Size) -> Outline {
    let (w, h) = (size.width as i32 - 1, size.height as i32 - 1);
    Outline {
        size,
        mask: vec![255; size.area()],
        polygon_px: [[0, 0], [w, 0], [w, h], [0, h]].map(Point2::from).to_vec(),
        matte: None,
        other_foot_px: None,
    }
}

/// One region of what is in a mask; `None` where it is empty. Wider gaps are closed only if one
/// piece then has nearly all.
fn closed(size: Size, mask: &[u8]) -> opencv::Result<Option<Outline>> {
    let Some(mut one) = region::close_to_one(size, mask, share_px(size, CLOSE_SHARE))? else {
        return Ok(None);
    };
    let mut share = CLOSE_SHARE + CLOSE_STEP;
    while share <= CLOSE_MOST && held(mask, &one) < NEARLY_ALL {
        let joined = region::close_to_one(size, mask, share_px(size, share))?;
        if let Some(joined) = joined.filter(|o| held(mask, o) >= NEARLY_ALL) {
            one = joined;
        }
        share += CLOSE_STEP;
    }
    Ok(Some(one))
}

/// A share of the picture's width, px.
fn share_px(size: Size, share: f64) -> u32 {
    (share * f64::from(size.width)).round() as u32
}

/// Share of a mask that an outline holds.
fn held(mask: &[u8], outline: &Outline) -> f64 {
    let of = mask.iter().filter(|m| **m != 0).count();
    let inside = mask
        .iter()
        .zip(&outline.mask)
        .filter(|(m, o)| **m != 0 && **o != 0)
        .count();
    inside as f64 / of.max(1) as f64
}

/// The mask at full size, where it is in a picture of this camera.
fn enlarged(small: &Outline, size: Size, scale: u32, camera: &CameraMotion) -> Vec<u8> {
    let mut mask = vec![0; size.area()];
    for (v, row) in mask.chunks_exact_mut(size.width as usize).enumerate() {
        for (u, m) in row.iter_mut().enumerate() {
            let steady_px = camera.steady_px(Point2::new(u as f64, v as f64));
            // The nearest pixel, and the cell that it was reduced into.
            let [su, sv] = [steady_px.x, steady_px.y].map(|px| px.round() as i64);
            let (su, sv) = (su.div_euclid(scale.into()), sv.div_euclid(scale.into()));
            let inside = Point2::new(su as f64, sv as f64);
            if small.size.contains(inside) {
                *m = small.mask[(sv * i64::from(small.size.width) + su) as usize];
            }
        }
    }
    mask
}
