//! Harris corners inside the outline, none on its border (Li 2011 app. A, Zeng 2015 sect. 5.3.2).

use crate::config::Detect;
use crate::model::{CameraMotion, Luma, Outline};
use nalgebra::Point2;
use opencv::core::{
    BORDER_CONSTANT, Mat, Point, Point2f, Rect, Scalar, Size as CvSize, ToInputArray, Vector,
    bitwise_and, bitwise_or, no_array, subtract,
};
use opencv::imgproc::{
    MORPH_CLOSE, MORPH_DILATE, MORPH_ELLIPSE, MORPH_ERODE, THRESH_BINARY, circle,
    get_structuring_element, good_features_to_track_with_gradient, morphology_ex, threshold,
};
use opencv::prelude::*;

/// Harris' constant k of det(A) - k trace(A)^2, with A the structure tensor (Zeng 2015
/// eq. 2.11).
const HARRIS_K: f64 = 0.04;
/// Side of the window over which the structure tensor is averaged, and of the Sobel derivative, px.
const BLOCK_PX: i32 = 3;

/// Above this a pixel of a matte is taken for tree.
const HALF: f64 = 127.0;

/// Finds corners in an outline.
pub struct Detector {
    settings: Detect,
    /// The outline less its border, cut to `roi`; 255 where a corner may lie.
    allowed: Mat,
    roi: Rect,
    min_distance_px: f64,
}

impl Detector {
    /// Prepares detection in `outline`; distances in `settings` are for a picture 640 px wide and
    /// grow with it.
    pub fn new(settings: &Detect, outline: &Outline) -> Self {
        let scale = f64::from(outline.size.width) / 640.0;
        let border_px = (settings.border_px * scale).round() as i32;
        let (allowed, roi) = allowed_region(outline, border_px).unwrap_or_else(|e| {
            tracing::error!("outline of {}: {e}", outline.size);
            (Mat::default(), Rect::default())
        });
        let min_distance_px = (settings.min_distance_px * scale).max(1.0);
        Self {
            settings: settings.clone(),
            allowed,
            roi,
            min_distance_px,
        }
    }

    /// Least distance between two points, px.
    pub fn min_distance_px(&self) -> f64 {
        self.min_distance_px
    }

    /// At most `wanted` corners (px), strongest first, at the minimum distance from `taken`; as
    /// they are candidates, of which the better half is kept, twice as many find place side by
    /// side. The outline goes along with the camera.
    pub fn detect(
        &self,
        luma: &Luma,
        taken: &[Point2<f32>],
        wanted: usize,
        camera: &CameraMotion,
    ) -> Vec<Point2<f32>> {
        if self.roi.area() == 0 || wanted == 0 {
            return Vec::new();
        }
        self.corners(luma, taken, wanted, camera)
            .unwrap_or_else(|e| {
                tracing::error!("corner detection in a {} picture: {e}", luma.size);
                Vec::new()
            })
    }

    /// Where a corner may lie, and its box, shifted by whole pixels as the camera has moved what
    /// stands in the middle of it, as far as that is in the picture.
    fn moved_with(&self, camera: &CameraMotion, luma: &Luma) -> opencv::Result<(Mat, Rect)> {
        let middle = Point2::new(
            f64::from(self.roi.x) + 0.5 * f64::from(self.roi.width),
            f64::from(self.roi.y) + 0.5 * f64::from(self.roi.height),
        );
        let shift = (camera.filmed_px(middle) - middle).map(|px| px.round() as i32);
        let moved = self.roi + Point::new(shift.x, shift.y);
        let picture = Rect::new(0, 0, luma.size.width as i32, luma.size.height as i32);
        let roi = moved & picture;
        if roi.area() == 0 {
            return Ok((Mat::default(), Rect::default()));
        }
        let seen = roi - Point::new(moved.x, moved.y);
        Ok((Mat::roi(&self.allowed, seen)?.try_clone()?, roi))
    }

    fn candidate_distance_px(&self) -> f64 {
        (self.min_distance_px * std::f64::consts::FRAC_1_SQRT_2).max(1.0)
    }

    fn corners(
        &self,
        luma: &Luma,
        taken: &[Point2<f32>],
        wanted: usize,
        camera: &CameraMotion,
    ) -> opencv::Result<Vec<Point2<f32>>> {
        let (mut mask, roi) = self.moved_with(camera, luma)?;
        if roi.area() == 0 {
            return Ok(Vec::new());
        }
        for p in taken {
            let centre = Point::new(p.x.round() as i32 - roi.x, p.y.round() as i32 - roi.y);
            let radius = self.min_distance_px.round() as i32;
            circle(
                &mut mask,
                centre,
                radius,
                Scalar::all(0.0),
                -1,
                opencv::imgproc::LINE_8,
                0,
            )?;
        }
        let picture = Mat::new_rows_cols_with_data(
            luma.size.height as i32,
            luma.size.width as i32,
            &luma.pixels,
        )?;
        let crop = Mat::roi(&picture, roi)?;
        let mut corners: Vector<Point2f> = Vector::new();
        good_features_to_track_with_gradient(
            &crop,
            &mut corners,
            wanted as i32,
            self.settings.quality,
            self.candidate_distance_px(),
            &mask,
            BLOCK_PX,
            BLOCK_PX,
            true,
            HARRIS_K,
        )?;
        let (left, top) = (roi.x as f32, roi.y as f32);
        Ok(corners
            .iter()
            .map(|c| Point2::new(c.x + left, c.y + top))
            .collect())
    }
}

fn allowed_region(outline: &Outline, border_px: i32) -> opencv::Result<(Mat, Rect)> {
    let Some([left, top, right, bottom]) = outline.bounds_px() else {
        return Ok((Mat::default(), Rect::default()));
    };
    let roi = Rect::new(
        left as i32,
        top as i32,
        (right - left + 1) as i32,
        (bottom - top + 1) as i32,
    );
    let (rows, cols) = (outline.size.height as i32, outline.size.width as i32);
    let mask = Mat::new_rows_cols_with_data(rows, cols, &outline.mask)?;
    let mut eroded = mask.try_clone()?;
    if let Some(matte) = &outline.matte {
        let matte = Mat::new_rows_cols_with_data(rows, cols, matte)?;
        let free = within_matte(&matte, border_px)?;
        // The matte knows more pieces than the one that is the region; what borders on that is
        // still its own.
        bitwise_and(
            &free,
            &morphed(&mask, MORPH_DILATE, 1)?,
            &mut eroded,
            &no_array(),
        )?;
    } else if border_px > 0 {
        // Outside the picture counts as not tree, so that no window hangs over the picture's edge.
        eroded = morphed(&mask, MORPH_ERODE, border_px)?;
    }
    Ok((Mat::roi(&eroded, roi)?.try_clone()?, roi))
}

/// Where the tree is wide, its pixels farther than `border_px` from the matte's border, as Zeng
/// keeps points off it. A twig is all border: where the tree is narrower than two borders all of it
/// is allowed, and the pixel beside it, on which the corner response of an edge may peak.
fn within_matte(matte: &impl ToInputArray, border_px: i32) -> opencv::Result<Mat> {
    let mut tree = Mat::default();
    threshold(matte, &mut tree, HALF, 255.0, THRESH_BINARY)?;
    // Holes of a pixel or two are doubts of the matte.
    let tree = morphed(&tree, MORPH_CLOSE, 1)?;
    let inside = morphed(&tree, MORPH_ERODE, border_px)?;
    // Half a border more: what is left of the wide part's own corners is no twig.
    let wide = morphed(&inside, MORPH_DILATE, border_px + border_px / 2)?;
    let mut twigs = Mat::default();
    subtract(&tree, &wide, &mut twigs, &no_array(), -1)?;
    let twigs = morphed(&twigs, MORPH_DILATE, 1)?;
    let mut allowed = Mat::default();
    bitwise_or(&inside, &twigs, &mut allowed, &no_array())?;
    Ok(allowed)
}

/// With a disc of `radius` px; outside the picture counts as not tree.
fn morphed(from: &impl ToInputArray, how: i32, radius: i32) -> opencv::Result<Mat> {
    let (side, anchor) = (2 * radius + 1, Point::new(-1, -1));
    let disc = get_structuring_element(MORPH_ELLIPSE, CvSize::new(side, side), anchor)?;
    let mut to = Mat::default();
    morphology_ex(
        from,
        &mut to,
        how,
        &disc,
        anchor,
        1,
        BORDER_CONSTANT,
        Scalar::all(0.0),
    )?;
    Ok(to)
}
