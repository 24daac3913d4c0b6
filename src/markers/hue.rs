//! Hue, saturation and value of a picture, histograms of hues and how likely pixels are by them.

use super::area::PixelArea;
use crate::config::Markers;
use crate::model::{Rgb, Size};
use nalgebra::{Point2, Vector2, distance};
use opencv::core::{CV_8UC1, CV_32FC1, Mat, Scalar, Vector, in_range};
use opencv::imgproc::{COLOR_RGB2HSV, calc_back_project, calc_hist, cvt_color_def};
use opencv::prelude::*;

/// OpenCV's hues of 8 bits are half degrees below this.
pub const HUES: f32 = 180.0;
/// A window in whose middle fewer pixels have a hue than this share shows no coloured marker.
const LEAST_COLOURED: f64 = 0.15;
/// So much of the area in which a marker is looked for is the marker: it is half as wide as its
/// window, which is looked around by its size to each side.
const MARKER_SHARE: f32 = 0.02;
/// A hue that is nowhere else in the picture may be in this share of it in a later frame.
const LEAST_ELSEWHERE: f32 = 1e-4;

/// A picture as hue (half degrees), saturation and value, interleaved, row by row.
pub struct Hsv {
    pub size: Size,
    pixels: Vec<u8>,
}

impl Hsv {
    /// Of a picture in colour.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn of(picture: &Rgb) -> opencv::Result<Self> {
        let (rows, cols) = (picture.size.height as i32, 3 * picture.size.width as i32);
        let flat = Mat::new_rows_cols_with_data(rows, cols, &picture.pixels)?;
        let mut hsv = Mat::default();
        cvt_color_def(&flat.reshape(3, rows)?, &mut hsv, COLOR_RGB2HSV)?;
        Ok(Self {
            size: picture.size,
            pixels: hsv.data_bytes()?.to_vec(),
        })
    }

    /// Whether no pixel has any saturation, as in films without colour.
    pub fn is_grey(&self) -> bool {
        self.pixels.chunks_exact(3).all(|p| p[1] == 0)
    }

    /// Hue, saturation and value of all pixels, interleaved.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// A part of it; `area` must lie within.
    fn part(&self, area: &PixelArea) -> Vec<u8> {
        let width = self.size.width as usize;
        let mut part = Vec::with_capacity(3 * (area.width * area.height) as usize);
        for v in area.v..area.v + area.height {
            let from = 3 * (v as usize * width + area.u as usize);
            part.extend_from_slice(&self.pixels[from..from + 3 * area.width as usize]);
        }
        part
    }
}

/// Which hues a marker has and what is around it has not: the histogram of CamShift (Bradski 1998),
/// weighted by how probable it is that a pixel of a hue is the marker (Bayes): what is found on leaves or
/// bricks, too, counts for little. 255 at the hue that counts most.
#[derive(Clone, Debug)]
pub struct HueModel {
    bins: Vec<f32>,
    least_saturation: u32,
    least_value: u32,
}

impl HueModel {
    /// Of the pixels in the ellipse of half the size of `window`, in its middle: what is at the rim of a
    /// window is not the marker. `elsewhere` is the share of each bin of hues in the rest of the
    /// picture. `None` where nearly no pixel has a hue.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn of(
        hsv: &Hsv,
        window: &PixelArea,
        elsewhere: &[f32],
        settings: &Markers,
    ) -> opencv::Result<Option<Self>> {
        let middle = PixelArea::around(window.middle_px(), 0.5 * window.size_px());
        let Some(area) = middle.within(hsv.size) else {
            return Ok(None);
        };
        let part = hsv.part(&area);
        let flat = Mat::new_rows_cols_with_data(area.height, 3 * area.width, &part)?;
        let pixels = flat.reshape(3, area.height)?;
        let (saturation, value) = (settings.least_saturation, settings.least_value);
        let mut coloured = colour_mask(&pixels, saturation, value)?;
        let ellipse = ellipse(&middle, &area);
        for (kept, inside) in coloured.data_bytes_mut()?.iter_mut().zip(&ellipse) {
            *kept &= inside;
        }
        let n_coloured = coloured.data_bytes()?.iter().filter(|m| **m > 0).count();
        let n_inside = ellipse.iter().filter(|m| **m > 0).count();
        if (n_coloured as f64) < LEAST_COLOURED * n_inside as f64 || n_coloured == 0 {
            return Ok(None);
        }
        let own = hue_shares(&pixels, &coloured, settings, n_inside)?;
        let mut bins: Vec<f32> = own.iter().zip(elsewhere).map(by_hue).collect();
        let most = bins.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        bins.iter_mut().for_each(|bin| *bin *= 255.0 / most);
        Ok(Some(Self {
            bins,
            least_saturation: saturation,
            least_value: value,
        }))
    }

    /// How likely the pixels of an area are by their hue: the back-projection of the histogram. `None`
    /// where the area lies off the picture.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn likelihood(&self, hsv: &Hsv, area: &PixelArea) -> opencv::Result<Option<Likelihood>> {
        let Some(area) = area.within(hsv.size) else {
            return Ok(None);
        };
        let part = hsv.part(&area);
        let flat = Mat::new_rows_cols_with_data(area.height, 3 * area.width, &part)?;
        let pixels = flat.reshape(3, area.height)?;
        let coloured = colour_mask(&pixels, self.least_saturation, self.least_value)?;
        let histogram = Mat::from_slice(&self.bins)?;
        let histogram = histogram.reshape(1, self.bins.len() as i32)?;
        let mut likely =
            Mat::new_rows_cols_with_default(area.height, area.width, CV_8UC1, Scalar::all(0.0))?;
        calc_back_project(
            &Vector::<Mat>::from_iter([pixels.try_clone()?]),
            &Vector::from_slice(&[0]),
            &histogram,
            &mut likely,
            &Vector::from_slice(&[0.0, HUES]),
            1.0,
        )?;
        let mut pixels = likely.data_bytes()?.to_vec();
        for (likely, coloured) in pixels.iter_mut().zip(coloured.data_bytes()?) {
            *likely &= coloured;
        }
        debug_assert_eq!(histogram.typ(), CV_32FC1);
        Ok(Some(Likelihood { area, pixels }))
    }
}

/// What a hue counts, which the marker has in the first share of its pixels and the rest of the picture
/// in the second: by its frequency (Bradski 1998), times how probable it is that a pixel of it is the
/// marker (Bayes). What the marker has little of counts for little, however rare it is elsewhere.
fn by_hue((own, elsewhere): (&f32, &f32)) -> f32 {
    let marker = MARKER_SHARE * own;
    let rest = (1.0 - MARKER_SHARE) * elsewhere.max(LEAST_ELSEWHERE);
    own * marker / (marker + rest)
}

/// Of the pixels outside of these areas, where the markers are, the share of each bin of hues; the rest
/// has no hue.
///
/// # Errors
/// OpenCV fails.
pub fn hues_elsewhere(
    hsv: &Hsv,
    areas: &[PixelArea],
    settings: &Markers,
) -> opencv::Result<Vec<f32>> {
    let (rows, cols) = (hsv.size.height as i32, 3 * hsv.size.width as i32);
    let flat = Mat::new_rows_cols_with_data(rows, cols, hsv.pixels())?;
    let pixels = flat.reshape(3, rows)?;
    let mut coloured = colour_mask(&pixels, settings.least_saturation, settings.least_value)?;
    let mut n_pixels = hsv.size.area();
    for area in areas.iter().filter_map(|area| area.within(hsv.size)) {
        for v in area.v..area.v + area.height {
            for u in area.u..area.u + area.width {
                *coloured.at_2d_mut::<u8>(v, u)? = 0;
            }
        }
        n_pixels = n_pixels.saturating_sub((area.width * area.height) as usize);
    }
    hue_shares(&pixels, &coloured, settings, n_pixels)
}

/// How many of the pixels under a mask are in each bin of hues, as a share of so many.
fn hue_shares(
    pixels: &impl MatTraitConst,
    mask: &Mat,
    settings: &Markers,
    of: usize,
) -> opencv::Result<Vec<f32>> {
    let mut histogram = Mat::default();
    calc_hist(
        &Vector::<Mat>::from_iter([pixels.try_clone()?]),
        &Vector::from_slice(&[0]),
        mask,
        &mut histogram,
        &Vector::from_slice(&[settings.hue_bins as i32]),
        &Vector::from_slice(&[0.0, HUES]),
        false,
    )?;
    let counts = histogram.data_typed::<f32>()?;
    Ok(counts.iter().map(|n| n / of.max(1) as f32).collect())
}

/// 255 where a pixel has a hue, else 0.
fn colour_mask(
    hsv: &impl opencv::core::ToInputArray,
    least_saturation: u32,
    least_value: u32,
) -> opencv::Result<Mat> {
    let lowest = Scalar::new(
        0.0,
        f64::from(least_saturation),
        f64::from(least_value),
        0.0,
    );
    let mut mask = Mat::default();
    in_range(hsv, &lowest, &Scalar::all(255.0), &mut mask)?;
    Ok(mask)
}

/// 255 in the ellipse that fills `whole`, for the pixels of `area`, which is a part of it.
fn ellipse(whole: &PixelArea, area: &PixelArea) -> Vec<u8> {
    let (middle, half) = (whole.middle_px(), 0.5 * whole.size_px());
    let mut mask = Vec::with_capacity((area.width * area.height) as usize);
    for v in area.v..area.v + area.height {
        for u in area.u..area.u + area.width {
            let x = (f64::from(u) - middle.x) / half.x;
            let y = (f64::from(v) - middle.y) / half.y;
            mask.push(if x * x + y * y <= 1.0 { 255 } else { 0 });
        }
    }
    mask
}

/// How likely the pixels of a part of a picture show a marker, 0 to 255.
#[derive(Clone, Debug)]
pub struct Likelihood {
    /// Which part; it lies within the picture.
    pub area: PixelArea,
    /// Row by row.
    pub pixels: Vec<u8>,
}

impl Likelihood {
    /// Takes out the pixels that `is_other` says belong to something else.
    pub fn without(&mut self, is_other: impl Fn(Point2<f64>) -> bool) {
        let width = self.area.width;
        for (k, likely) in self.pixels.iter_mut().enumerate() {
            let (u, v) = (
                k as i32 % width + self.area.u,
                k as i32 / width + self.area.v,
            );
            if *likely > 0 && is_other(Point2::new(f64::from(u), f64::from(v))) {
                *likely = 0;
            }
        }
    }

    /// How much of what is likely in a window is in the square that holds a marker of this radius, px,
    /// 0 to 1: little where what is likely is strewn over the window.
    pub fn compact(&self, blob: &Blob, window: &PixelArea, radius_px: f64) -> f64 {
        let side = 2.0 * (HALF_SQUARE_RADII * radius_px + HALF_SQUARE_MARGIN_PX);
        let around = PixelArea::around(blob.at_px, Vector2::repeat(side));
        let inside = self.blob(&around.common(window));
        inside.map_or(0.0, |b| b.mass_px / blob.mass_px)
    }

    /// The sum of what is likely in a window, in whole pixels, and its weighted middle, px; `None`
    /// where nothing is likely there.
    pub fn blob(&self, window: &PixelArea) -> Option<Blob> {
        let (mut mass, mut u_sum, mut v_sum) = (0.0, 0.0, 0.0);
        let right = (window.u + window.width).min(self.area.u + self.area.width);
        let bottom = (window.v + window.height).min(self.area.v + self.area.height);
        for v in window.v.max(self.area.v)..bottom {
            for u in window.u.max(self.area.u)..right {
                let k = (v - self.area.v) * self.area.width + u - self.area.u;
                let weight = f64::from(self.pixels[k as usize]) / 255.0;
                mass += weight;
                u_sum += weight * f64::from(u);
                v_sum += weight * f64::from(v);
            }
        }
        (mass > 0.0).then(|| Blob {
            mass_px: mass,
            at_px: Point2::new(u_sum / mass, v_sum / mass),
        })
    }
}

/// Half the side of the square that holds a marker, in its radii, and px beyond that: the picture blurs.
const HALF_SQUARE_RADII: f64 = 1.2;
const HALF_SQUARE_MARGIN_PX: f64 = 1.0;

/// What is likely in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blob {
    /// Its size in pixels that are as likely as can be.
    pub mass_px: f64,
    /// Its middle, px.
    pub at_px: Point2<f64>,
}

impl Blob {
    /// Whether its middle is that of another one: they are nearer than the radius of the larger.
    pub fn overlaps(&self, other: &Self) -> bool {
        distance(&self.at_px, &other.at_px) < self.radius_px().max(other.radius_px())
    }

    /// The radius of a disc of this size, px.
    pub fn radius_px(&self) -> f64 {
        (self.mass_px / std::f64::consts::PI).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hue_counts_by_its_frequency_and_by_what_else_has_it() {
        let alone = by_hue((&0.9, &0.0));
        // A rim of another hue, which is rare in the picture.
        assert!(by_hue((&0.1, &0.0)) < 0.2 * alone);
        // A wall of the marker's hue.
        assert!(by_hue((&0.9, &0.2)) < 0.1 * alone);
    }
}
