//! Profiles of lenses as Gyroflow has them (gyroflow/lens_profiles): JSON with a camera matrix, coefficients
//! of distortion and the time that a frame takes to be read.

use crate::model::{Distortion, Lens, Size};
use nalgebra::{Point2, Vector2};
use serde::Deserialize;

/// Largest plausible side of a picture, px.
const MAX_SIDE: u32 = 100_000;
/// Names of the model with four coefficients of the angle, and of the radial and tangential one.
const FISHEYE: &str = "opencv_fisheye";
const STANDARD: &str = "opencv_standard";

#[derive(Deserialize)]
struct Profile {
    calib_dimension: Dimension,
    #[serde(default)]
    frame_readout_time: Option<f64>,
    fisheye_params: Parameters,
    /// `None` is the fisheye model.
    #[serde(default)]
    distortion_model: Option<String>,
}

#[derive(Deserialize)]
struct Dimension {
    w: u32,
    h: u32,
}

#[derive(Deserialize)]
struct Parameters {
    camera_matrix: [[f64; 3]; 3],
    distortion_coeffs: Vec<f64>,
}

/// The lens that a profile of these bytes describes.
///
/// # Errors
/// It is no profile, of another model of distortion, or holds what is no number.
pub fn read_lens_profile(bytes: &[u8]) -> Result<Lens, String> {
    let profile: Profile = serde_json::from_slice(bytes)
        .map_err(|e| format!("{e}; give a lens profile of Gyroflow (JSON)"))?;
    let Dimension { w, h } = profile.calib_dimension;
    let [[fx, _, cx], [_, fy, cy], _] = profile.fisheye_params.camera_matrix;
    let sides = 1..=MAX_SIDE;
    let is_sound = [fx, fy, cx, cy].iter().all(|x| x.is_finite()) && fx > 0.0 && fy > 0.0;
    if !is_sound || !sides.contains(&w) || !sides.contains(&h) {
        return Err("its calib_dimension or camera_matrix is no camera's".into());
    }
    let coefficients = &profile.fisheye_params.distortion_coeffs;
    if coefficients.iter().any(|k| !k.is_finite()) {
        return Err("its distortion_coeffs hold what is no number".into());
    }
    let distortion = match profile.distortion_model.as_deref() {
        None | Some("" | FISHEYE) => Distortion::Fisheye(first(coefficients)?),
        Some(STANDARD) => Distortion::RadialTangential(first(coefficients)?),
        Some(other) => {
            return Err(format!(
                "its distortion_model is {other}; {FISHEYE} and {STANDARD} are read"
            ));
        }
    };
    let readout_ms = profile
        .frame_readout_time
        .filter(|ms| ms.is_finite() && *ms > 0.0);
    Ok(Lens {
        size: Size::new(w, h),
        focal_px: Vector2::new(fx, fy),
        middle_px: Point2::new(cx, cy),
        distortion,
        readout_s: readout_ms.unwrap_or(0.0) / 1000.0,
    })
}

/// The first N coefficients; those that are not given are 0.
fn first<const N: usize>(coefficients: &[f64]) -> Result<[f64; N], String> {
    if coefficients.is_empty() || coefficients.len() > N {
        return Err(format!(
            "it has {} distortion_coeffs; 1 to {N} are read",
            coefficients.len()
        ));
    }
    Ok(std::array::from_fn(|k| {
        coefficients.get(k).copied().unwrap_or(0.0)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(model: &str, coefficients: &str) -> String {
        format!(
            r#"{{"name": "x", "calib_dimension": {{"w": 1920, "h": 1080}}, "frame_readout_time": 16.5,
                "fisheye_params": {{"RMS_error": 0.4, "distortion_coeffs": {coefficients},
                "camera_matrix": [[1600.0, 0.0, 960.0], [0.0, 1601.0, 540.0], [0.0, 0.0, 1.0]]}},
                "distortion_model": {model}}}"#
        )
    }

    #[test]
    fn both_models_are_read() {
        let lens = read_lens_profile(profile("null", "[0.1, 0.2, 0.3, 0.4]").as_bytes());
        let lens = lens.expect("a lens");
        assert_eq!(lens.distortion, Distortion::Fisheye([0.1, 0.2, 0.3, 0.4]));
        assert_eq!(
            (lens.focal_px.y, lens.middle_px.x, lens.readout_s),
            (1601.0, 960.0, 0.0165)
        );
        let lens = read_lens_profile(profile(r#""opencv_standard""#, "[-0.2, 0.05]").as_bytes());
        let expected = Distortion::RadialTangential([-0.2, 0.05, 0.0, 0.0, 0.0]);
        assert_eq!(lens.expect("a lens").distortion, expected);
    }

    /// Every profile that is shipped has a place for every pixel of its pictures.
    #[test]
    fn the_profiles_in_config_are_read() {
        let mut read = 0;
        for entry in std::fs::read_dir("config/lenses")
            .expect("folder")
            .flatten()
        {
            let path = entry.path();
            if path.extension().is_some_and(|e| e == "json") {
                let bytes = std::fs::read(&path).expect("profile");
                let lens = read_lens_profile(&bytes).unwrap_or_else(|e| panic!("{path:?}: {e}"));
                for at in lens.size.corners_px() {
                    let off = lens.distorted(lens.undistorted(at)) - at;
                    assert!(off.norm() < 1e-6, "{path:?}, {at}: {off}");
                }
                read += 1;
            }
        }
        assert!(read >= 5, "{read}");
    }

    #[test]
    fn other_files_are_refused() {
        let cases = [
            (profile(r#""gopro""#, "[0.1]"), "distortion_model is gopro"),
            (profile("null", "[]"), "0 distortion_coeffs"),
            (profile("null", "[1, 2, 3, 4, 5]"), "5 distortion_coeffs"),
            (
                profile("null", "[0.1]").replace("1600.0", "-1.0"),
                "no camera's",
            ),
            (profile("null", "[0.1]").replace("1920", "0"), "no camera's"),
            ("{".into(), "give a lens profile"),
        ];
        for (text, expected) in cases {
            let why = read_lens_profile(text.as_bytes()).err().unwrap_or_default();
            assert!(why.contains(expected), "{text}: {why}");
        }
    }
}
