//! A part of a picture found again as a whole, shifted and turned.
//!
//! Inverse compositional Gauss-Newton (Baker and Matthews, "Lucas-Kanade 20 years on", 2004) on all
//! pixels of the part at once, where most of its points have no corner to be known by: each edge
//! says what it can. Brightness is brought to zero mean and unit variance; pixels that something
//! covers lose their weight (Cauchy's).

use super::register::bilinear;
use crate::model::{Agreement, Luma};
use crate::signal::statistics::rms;
use crate::signal::{CAUCHY, sd_of_misses};
use nalgebra::{Isometry2, Matrix3, Point2, Vector2, Vector3};

/// Fewer pixels than this are no part of a picture.
const LEAST_PIXELS: usize = 64;
/// The search ends when a step moves no pixel by more than this, px, and fails after so many.
const CLOSE_PX: f64 = 0.01;
const STEPS: usize = 20;
/// From step to step the scale of the weights falls to this share, from the root mean square of all
/// misses to their median deviation.
const NARROWER: f64 = 0.5;
/// It is found where it looks like what was cut out to this correlation.
const LEAST_NCC: f64 = 0.8;
/// Variance of brightness, in squared grey levels, below which there is nothing to be recognised.
const LEAST_VARIANCE: f64 = 4.0;

/// Pixels that are steeper count: those with less than this share of the mean square slope say
/// nothing of where the part is, and as they look alike everywhere they would hide that edges do not.
const LEAST_STEEP: f64 = 0.1;
/// The least deviation of brightness, in its standard deviations: a grey level is rounded by more.
const LEAST_SD: f64 = 1e-3;

/// A part of a picture, made ready to be compared with others.
#[derive(Default)]
pub struct Template {
    pixels: Vec<Pixel>,
    /// Distance of the farthest pixel from the origin, px.
    reach_px: f64,
}

/// A pixel of it.
struct Pixel {
    /// From the origin, px.
    at_px: Vector2<f64>,
    /// Brightness less the mean of the part, in its standard deviations.
    value: f64,
    /// What shift along u, shift along v and turn about the origin change the value by, 1/px, 1/px
    /// and 1/rad.
    slopes: Vector3<f64>,
}

/// Where a part was found.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Takes a place from the origin, px, to where it is in the picture, from the same origin.
    pub motion: Isometry2<f64>,
    /// How sure the shift is, and how many pixels look as they did.
    pub agreement: Agreement,
}

/// The pixels of a part under a motion, compared with it.
struct Compared {
    /// By how much each is brighter, in standard deviations; `None` beyond the picture's edge.
    brighter: Vec<Option<f64>>,
    /// Correlation, -1 to 1.
    ncc: f64,
}

impl Template {
    /// Cuts out the pixels `at_px` of a picture in which the part is moved by `motion` about
    /// `origin_px`. Of a part without structure nothing is kept.
    pub fn cut(
        luma: &Luma,
        at_px: impl Iterator<Item = Point2<f64>>,
        origin_px: Point2<f64>,
        motion: &Isometry2<f64>,
    ) -> Self {
        let mut seen = Vec::new();
        for at_px in at_px.filter(|at_px| luma.size.contains(*at_px)) {
            seen.push((at_px, slope(luma, at_px)));
        }
        let steepness = seen.iter().map(|(_, slope)| slope.norm());
        let least = LEAST_STEEP.sqrt() * rms(steepness);
        seen.retain(|(_, slope)| slope.norm() >= least);
        let (mean, sd) = mean_and_sd(seen.iter().map(|(at_px, _)| grey(luma, *at_px)));
        if seen.len() < LEAST_PIXELS || sd * sd < LEAST_VARIANCE {
            return Self::default();
        }
        let mut template = Self::default();
        for (filmed_px, slope) in seen {
            let slope = slope / sd;
            // In the steady place slopes are turned back.
            let at_px = motion.inverse_transform_point(&Point2::from(filmed_px - origin_px));
            let slope = motion.inverse_transform_vector(&slope);
            let turn = at_px.x * slope.y - at_px.y * slope.x;
            template.reach_px = template.reach_px.max(at_px.coords.norm());
            template.pixels.push(Pixel {
                at_px: at_px.coords,
                value: (grey(luma, filmed_px) - mean) / sd,
                slopes: Vector3::new(slope.x, slope.y, turn),
            });
        }
        template
    }

    /// Whether there is something to be found.
    pub fn is_something(&self) -> bool {
        !self.pixels.is_empty()
    }

    /// What is said of the picture from which it was cut.
    pub fn at_first(&self) -> Agreement {
        Agreement {
            inliers: self.pixels.len() as u32,
            ..Agreement::default()
        }
    }

    /// Looks for the part in a picture, moved about `origin_px`, from `start` on.
    pub fn find(
        &self,
        luma: &Luma,
        origin_px: Point2<f64>,
        start: &Isometry2<f64>,
    ) -> Option<Found> {
        let mut motion = *start;
        let mut start_scale = f64::INFINITY;
        for _ in 0..STEPS {
            let compared = self.compare(luma, origin_px, &motion)?;
            let misses = compared.brighter.iter().flatten().map(|b| b.abs());
            let rms = rms(misses.clone());
            let sd = sd_of_misses(misses)?.max(LEAST_SD);
            // At first the edges miss by more than noise, and are not to lose their weight for it:
            // graduated non-convexity (Blake and Zisserman 1987).
            start_scale = NARROWER * start_scale.min(rms / NARROWER);
            let scale = sd.max(start_scale);
            let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
            for (pixel, brighter) in self.pixels.iter().zip(&compared.brighter) {
                let Some(brighter) = *brighter else {
                    continue;
                };
                let weight = 1.0 / (1.0 + (brighter / (CAUCHY * scale)).powi(2));
                normal += weight * pixel.slopes * pixel.slopes.transpose();
                right += weight * brighter * pixel.slopes;
            }
            let inverse = normal.cholesky()?.inverse();
            let step = inverse * right;
            motion *= Isometry2::new(step.xy(), step.z).inverse();
            let step_px = step.xy().norm() + step.z.abs() * self.reach_px;
            if step_px < CLOSE_PX && scale <= sd {
                let is_found = compared.ncc >= LEAST_NCC;
                return is_found.then(|| Found {
                    motion,
                    agreement: self.agreement(&compared, sd, &inverse),
                });
            }
        }
        None
    }

    /// `None` where less than half of it is in the picture, or there is no structure.
    fn compare(
        &self,
        luma: &Luma,
        origin_px: Point2<f64>,
        motion: &Isometry2<f64>,
    ) -> Option<Compared> {
        let mut greys = Vec::with_capacity(self.pixels.len());
        for pixel in &self.pixels {
            let at_px = origin_px + (motion * Point2::from(pixel.at_px)).coords;
            greys.push(luma.size.contains(at_px).then(|| grey(luma, at_px)));
        }
        let (mean, sd) = mean_and_sd(greys.iter().flatten().copied());
        let inside = greys.iter().flatten().count();
        if 2 * inside < self.pixels.len() || sd * sd < LEAST_VARIANCE {
            return None;
        }
        let mut product = 0.0;
        let mut brighter = Vec::with_capacity(greys.len());
        for (pixel, grey) in self.pixels.iter().zip(greys) {
            let value = grey.map(|grey| (grey - mean) / sd);
            product += pixel.value * value.unwrap_or_default();
            brighter.push(value.map(|value| value - pixel.value));
        }
        Some(Compared {
            brighter,
            ncc: product / inside as f64,
        })
    }

    fn agreement(&self, compared: &Compared, sd: f64, inverse: &Matrix3<f64>) -> Agreement {
        let (mut inliers, mut miss, mut slope) = (0, 0.0, 0.0);
        for (pixel, brighter) in self.pixels.iter().zip(&compared.brighter) {
            let Some(brighter) = brighter.filter(|b| b.abs() <= CAUCHY * sd) else {
                continue;
            };
            inliers += 1;
            miss += brighter * brighter;
            slope += pixel.slopes.xy().norm_squared();
        }
        let shift = inverse.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues();
        Agreement {
            sd_px: sd * shift.max().max(0.0).sqrt(),
            inliers,
            // What a shift by a pixel changes brightness by turns one into the other.
            rms_px: (2.0 * miss / slope.max(f64::MIN_POSITIVE)).sqrt(),
        }
    }
}

fn grey(luma: &Luma, at_px: Point2<f64>) -> f64 {
    f64::from(bilinear(luma, at_px.x as f32, at_px.y as f32))
}

/// Change of brightness along u and v, grey levels a pixel.
fn slope(luma: &Luma, at_px: Point2<f64>) -> Vector2<f64> {
    let across = [Vector2::x(), Vector2::y()];
    let [u, v] = across.map(|step| 0.5 * (grey(luma, at_px + step) - grey(luma, at_px - step)));
    Vector2::new(u, v)
}

fn mean_and_sd(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let (mut n, mut sum, mut squares) = (0.0_f64, 0.0, 0.0);
    for value in values {
        n += 1.0;
        sum += value;
        squares += value * value;
    }
    let mean = sum / n.max(1.0);
    (mean, (squares / n.max(1.0) - mean * mean).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;
    use crate::random::generator;
    use rand::RngExt;

    const SIZE: Size = Size {
        width: 160,
        height: 120,
    };
    const FOOT: Point2<f64> = Point2::new(80.0, 100.0);

    /// A leaning trunk with some grain before the sky, whose foot is shifted and that is turned
    /// about it, with the noise of a camera. `cover` hides the lowest rows.
    fn picture(motion: &Isometry2<f64>, cover: u32, seed: u64) -> Luma {
        let mut random = generator(seed, 0);
        let mut pixels = Vec::with_capacity(SIZE.area());
        for v in 0..SIZE.height {
            for u in 0..SIZE.width {
                let filmed = Point2::new(f64::from(u), f64::from(v));
                let at = motion.inverse_transform_point(&Point2::from(filmed - FOOT));
                let aside = at.x - 0.2 * at.y;
                let side = ((8.0 - aside.abs()) / 3.0).clamp(0.0, 1.0);
                let above = ((3.0 - at.y) / 3.0).clamp(0.0, 1.0);
                let bark = 60.0 + 12.0 * ((0.8 * at.x).sin() + (0.5 * at.y).sin());
                let mut grey = 190.0 + side * above * (bark - 190.0);
                if v + cover >= 100 {
                    grey = 130.0;
                }
                let noise = 6.0 * (random.random::<f64>() - 0.5);
                pixels.push((grey + noise).round().clamp(0.0, 255.0) as u8);
            }
        }
        Luma { size: SIZE, pixels }
    }

    fn trunk() -> impl Iterator<Item = Point2<f64>> {
        let rows = (50..104).map(f64::from);
        rows.flat_map(|v| (60..96).map(move |u| Point2::new(f64::from(u), v)))
    }

    #[test]
    fn a_part_is_found_though_some_of_it_is_covered_and_not_where_all_is() {
        let still = Isometry2::identity();
        let template = Template::cut(&picture(&still, 0, 1), trunk(), FOOT, &still);
        let truth = Isometry2::new(Vector2::new(0.6, -0.4), 0.01);
        let found = template.find(&picture(&truth, 12, 2), FOOT, &still);
        assert!(found.is_some());
        assert!(
            template
                .find(&picture(&truth, 100, 3), FOOT, &still)
                .is_none()
        );
        let plain = Template::cut(&picture(&still, 100, 4), trunk(), FOOT, &still);
        assert!(!plain.is_something());
    }
}
