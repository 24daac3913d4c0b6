//! Profiles of lenses as Gyroflow has them, which `--lens` reads.

use crate::calibrate::Calibration;
use crate::model::Distortion;
use serde_json::json;

/// The profile as JSON. Besides what Gyroflow reads it has the standard deviations of the parameters.
pub fn lens_profile(name: &str, calibration: &Calibration) -> Vec<u8> {
    let lens = &calibration.lens;
    let (coefficients, model) = match lens.distortion {
        Distortion::RadialTangential(k) => (k.to_vec(), "opencv_standard"),
        Distortion::Fisheye(k) => (k.to_vec(), "opencv_fisheye"),
    };
    let [fx, fy, cx, cy, k1, k2, p1, p2] = calibration.deviations;
    let profile = json!({
        "name": name,
        "note": format!("{} views of a chessboard", calibration.views),
        "calibrated_by": concat!("arborcam ", env!("CARGO_PKG_VERSION")),
        "calib_dimension": { "w": lens.size.width, "h": lens.size.height },
        "num_images": calibration.views,
        "distortion_model": model,
        "fisheye_params": {
            "RMS_error": calibration.rms_px,
            "camera_matrix": [
                [lens.focal_px.x, 0.0, lens.middle_px.x],
                [0.0, lens.focal_px.y, lens.middle_px.y],
                [0.0, 0.0, 1.0]
            ],
            "distortion_coeffs": coefficients
        },
        "standard_deviations": {
            "focal_px": [fx, fy],
            "middle_px": [cx, cy],
            "k1": k1, "k2": k2, "p1": p1, "p2": p2
        }
    });
    let mut bytes = format!("{profile:#}").into_bytes();
    bytes.push(b'\n');
    bytes
}
