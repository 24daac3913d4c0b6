//! A depth camera beside the colour camera, as the user gives it.

use super::load::ConfigError;
use serde::{Deserialize, Serialize};

/// Longest side of its images, px.
const LONGEST_SIDE_PX: u32 = 1 << 14;
/// Two cameras on one stand are no farther from each other, m.
const FARTHEST_M: f64 = 10.0;
/// Numbers of a rotation are rounded: by so much the products of its rows may be off.
const ROUNDED: f64 = 1e-3;

/// Its images, and where it stands. Places are counted from the middle of the first pixel; the axes of
/// a camera go to the right, down and away from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthCamera {
    /// Size of its images, px.
    pub width: u32,
    pub height: u32,
    /// Focal lengths across and down, px.
    #[serde(alias = "fx")]
    pub fx_px: f64,
    #[serde(alias = "fy")]
    pub fy_px: f64,
    /// Where its axis meets the image, px from the left and from the top.
    #[serde(alias = "cx")]
    pub cx_px: f64,
    #[serde(alias = "cy")]
    pub cy_px: f64,
    /// Up to eight numbers in the order of OpenCV: k1, k2, p1, p2, k3, k4, k5, k6.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub distortion: Vec<f64>,
    /// From its axes to those of the colour camera: a matrix row by row, and a shift, m.
    pub rotation: [f64; 9],
    pub translation_m: [f64; 3],
}

/// Refuses numbers that describe no distortion of a lens.
///
/// # Errors
/// There are too many, or one is not finite: what is wrong, in one line.
pub fn check_distortion(distortion: &[f64]) -> Result<(), String> {
    if distortion.len() > 8 {
        return Err("distortion has up to eight numbers".to_owned());
    }
    match distortion.iter().all(|k| k.is_finite()) {
        true => Ok(()),
        false => Err("each number of distortion must be finite".to_owned()),
    }
}

/// Refuses a depth camera that cannot be one.
///
/// # Errors
/// There are two, a number is not finite or out of range, or the rotation is none.
pub(super) fn check(cameras: &[DepthCamera]) -> Result<(), ConfigError> {
    match cameras {
        [] => Ok(()),
        [camera] => camera
            .check()
            .map_err(|what| ConfigError::DepthCamera { what }),
        _ => Err(ConfigError::DepthCamera {
            what: "there are two; give one".to_owned(),
        }),
    }
}

impl DepthCamera {
    /// Whether it can be one.
    ///
    /// # Errors
    /// What is wrong with it, in one line.
    pub fn check(&self) -> Result<(), String> {
        let sides = 1..=LONGEST_SIDE_PX;
        if !sides.contains(&self.width) || !sides.contains(&self.height) {
            return Err(format!(
                "width and height must be 1 to {LONGEST_SIDE_PX} px"
            ));
        }
        if !(self.fx_px > 0.0 && self.fy_px > 0.0) {
            return Err("fx and fy must be numbers above 0".to_owned());
        }
        check_distortion(&self.distortion)?;
        let mut numbers = [self.fx_px, self.fy_px, self.cx_px, self.cy_px].into_iter();
        if !numbers.all(|x| x.is_finite()) {
            return Err("each of its numbers must be finite".to_owned());
        }
        if !self.translation_m.iter().all(|x| x.abs() <= FARTHEST_M) {
            return Err(format!(
                "translation_m is in metres, {FARTHEST_M} at most each"
            ));
        }
        match is_rotation(&self.rotation) {
            true => Ok(()),
            false => Err("rotation must be nine numbers of a rotation, row by row".to_owned()),
        }
    }
}

/// Whether the rows stand on each other, have a length of 1, and turn without mirroring.
fn is_rotation(rows: &[f64; 9]) -> bool {
    for i in 0..3 {
        for k in 0..3 {
            let product: f64 = (0..3).map(|j| rows[3 * i + j] * rows[3 * k + j]).sum();
            let expected = f64::from(u8::from(i == k));
            // Not true for what is no number, either.
            let is_right = (product - expected).abs() <= ROUNDED;
            if !is_right {
                return false;
            }
        }
    }
    let [a, b, c, d, e, f, g, h, i] = *rows;
    a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_a_depth_camera_is_refused() {
        let good = DepthCamera {
            width: 640,
            height: 480,
            fx_px: 600.0,
            fy_px: 600.0,
            cx_px: 320.0,
            cy_px: 240.0,
            distortion: vec![0.1, 0.2],
            rotation: [1.0, 0.0, 0.0, 0.0, 0.8, -0.6, 0.0, 0.6, 0.8],
            translation_m: [0.015, 0.0, 0.0],
        };
        assert_eq!(good.check(), Ok(()));
        assert!(check(&[good.clone(), good.clone()]).is_err());
        let mut bad = vec![good.clone(); 7];
        bad[0].width = 0;
        bad[1].fx_px = f64::NAN;
        bad[2].distortion = vec![0.0; 9];
        bad[3].translation_m = [15.0, 0.0, 0.0];
        bad[4].rotation[0] = f64::NAN;
        // A mirror, and a matrix that lengthens.
        bad[5].rotation[0] = -1.0;
        bad[6].rotation[0] = 1.1;
        for camera in bad {
            let said = camera.check().expect_err("refused");
            assert!(!said.contains('\n'), "{said}");
        }
    }
}
