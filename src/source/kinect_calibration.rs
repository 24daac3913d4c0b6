//! The calibration that an Azure Kinect keeps: intrinsics of whole sensors as shares of their size, of
//! which a mode reads a part, and where each camera stands.

use super::camera_file::one_line;
use crate::model::{CameraModel, DepthRig, Pinhole, Size};
use nalgebra::{Isometry3, Matrix3, Point2, Rotation3, Translation3, UnitQuaternion, Vector2};
use serde::Deserialize;

/// A longer text is something else, bytes.
pub(super) const LONGEST: usize = 1 << 20;
/// Older calibrations of the colour camera are for the part of 9 by 16 in the middle of the sensor, of
/// which a quarter was cut off.
const WIDE_SHARE: f64 = 0.75;

#[derive(Deserialize)]
struct Written {
    #[serde(rename = "CalibrationInformation")]
    information: Information,
}

#[derive(Deserialize)]
struct Information {
    #[serde(rename = "Cameras")]
    cameras: Vec<Camera>,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Camera {
    intrinsics: Intrinsics,
    purpose: String,
    rt: Place,
    sensor_width: u32,
    sensor_height: u32,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Intrinsics {
    model_parameters: Vec<f64>,
    model_type: String,
}

/// From the axes that the cameras share to those of one of them.
#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Place {
    rotation: [f64; 9],
    translation: [f64; 3],
}

/// The part of a sensor that a mode reads, pixels being combined or not.
struct Cut {
    /// The whole sensor in pixels of the mode.
    whole: Size,
    /// Where the image begins in it, px.
    left: f64,
    top: f64,
}

/// Both cameras of a calibration, for images of these sizes.
///
/// # Errors
/// It is no calibration, or for a size that no mode has: what is wrong.
pub fn kinect_rig(text: &str, depth: Size, colour: Size) -> Result<DepthRig, String> {
    let text = text.trim_start_matches('\u{feff}').trim_end_matches('\0');
    let written: Written = serde_json::from_str(text).map_err(|e| one_line(&e.to_string()))?;
    let of_depth = written.information.camera("CameraPurposeDepth")?;
    let of_colour = written.information.camera("CameraPurposePhotoVideo")?;
    Ok(DepthRig {
        depth: of_depth.model(depth, &depth_cut(depth)?)?,
        colour: of_colour.model(colour, &colour_cut(colour)?)?,
        colour_from_depth: of_colour.rt.place()? * of_depth.rt.place()?.inverse(),
    })
}

impl Information {
    fn camera(&self, purpose: &str) -> Result<&Camera, String> {
        let mut cameras = self.cameras.iter();
        let found = cameras.find(|camera| camera.purpose.ends_with(purpose));
        found.ok_or_else(|| format!("it has no {purpose}"))
    }
}

/// The modes of the depth camera: its sensor has 1024 by 1024 pixels, and the narrow modes read a part.
fn depth_cut(size: Size) -> Result<Cut, String> {
    let (side, left, top) = match (size.width, size.height) {
        (320, 288) => (512, 96.0, 90.0),
        (640, 576) => (1024, 192.0, 180.0),
        (512, 512) => (512, 0.0, 0.0),
        (1024, 1024) => (1024, 0.0, 0.0),
        _ => return Err(format!("no mode of the depth camera has {size}")),
    };
    Ok(Cut {
        whole: Size::new(side, side),
        left,
        top,
    })
}

/// The modes of the colour camera: the sensor is 4 by 3, and the modes of 16 by 9 read its middle.
fn colour_cut(size: Size) -> Result<Cut, String> {
    let height = size.width / 4 * 3;
    if size.height > height || size.height * 2 < height {
        return Err(format!("no mode of the colour camera has {size}"));
    }
    Ok(Cut {
        whole: Size::new(size.width, height),
        left: 0.0,
        top: f64::from(height - size.height) / 2.0,
    })
}

impl Camera {
    /// Its model for images of this size, which are the part `cut` of the sensor.
    fn model(&self, size: Size, cut: &Cut) -> Result<CameraModel, String> {
        let kind = self.intrinsics.model_type.as_str();
        let is_rational = kind.ends_with("Rational6KT");
        if !is_rational && !kind.ends_with("BrownConrady") {
            return Err(format!("its model {kind:?} is not known"));
        }
        // Here follow the centre of distortion, which is 0, and the two tangential ones.
        let [
            cx,
            cy,
            mut fx,
            mut fy,
            k1,
            k2,
            k3,
            k4,
            k5,
            k6,
            _,
            _,
            p2,
            p1,
            ..,
        ] = self.intrinsics.model_parameters[..]
        else {
            return Err("it has fewer than 14 parameters".to_owned());
        };
        let mut cy = cy;
        if u64::from(self.sensor_width) * 9 == u64::from(self.sensor_height) * 16 {
            cy = cy * WIDE_SHARE + (1.0 - WIDE_SHARE) / 2.0;
            fy *= WIDE_SHARE;
        }
        let (width, height) = (f64::from(cut.whole.width), f64::from(cut.whole.height));
        (fx, fy) = (fx * width, fy * height);
        // Shares are counted from the corner of the first pixel.
        let middle_px = Point2::new(cx * width - cut.left - 0.5, cy * height - cut.top - 0.5);
        // The two models differ by this factor.
        let half = if is_rational { 0.5 } else { 1.0 };
        let model = CameraModel {
            size,
            pinhole: Pinhole {
                focal_px: Vector2::new(fx, fy),
                middle_px,
            },
            distortion: [k1, k2, half * p1, half * p2, k3, k4, k5, k6],
        };
        match model.is_valid() {
            true => Ok(model),
            false => Err("its numbers make no camera".to_owned()),
        }
    }
}

impl Place {
    fn place(&self) -> Result<Isometry3<f64>, String> {
        let mut numbers = self.rotation.iter().chain(&self.translation);
        if !numbers.all(|x| x.is_finite()) {
            return Err("a camera stands nowhere".to_owned());
        }
        let turn = Rotation3::from_matrix(&Matrix3::from_row_slice(&self.rotation));
        Ok(Isometry3::from_parts(
            Translation3::from(self.translation),
            UnitQuaternion::from_rotation_matrix(&turn),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::kinect_rig as rig;
    use super::*;
    use nalgebra::Point3;

    /// Numbers as a device has them, rounded.
    const CALIBRATION: &str = r#"{"CalibrationInformation": {"Cameras": [
        {"Intrinsics": {"ModelParameterCount": 14, "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
            "ModelParameters": [0.51, 0.5, 0.49, 0.49, 0.4, 0.07, 0.004, 0.77, 0.15, 0.02, 0, 0, 6e-5, -9e-5]},
         "Purpose": "CALIBRATION_CameraPurposeDepth", "SensorWidth": 1024, "SensorHeight": 1024,
         "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [0, 0, 0]}},
        {"Intrinsics": {"ModelParameterCount": 14, "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
            "ModelParameters": [0.5, 0.5, 0.47, 0.63, 0.67, -2.7, 1.5, 0.55, -2.6, 1.5, 0, 0, -9e-5, 8e-4]},
         "Purpose": "CALIBRATION_CameraPurposePhotoVideo", "SensorWidth": 4096, "SensorHeight": 3072,
         "Rt": {"Rotation": [1, 0, 0, 0, 0.9945, 0.105, 0, -0.105, 0.9945], "Translation": [-0.032, -0.002, 0.004]}}
        ]}}"#;

    #[test]
    fn modes_of_both_cameras_read_their_parts_of_the_sensors() {
        let rig =
            rig(CALIBRATION, Size::new(640, 576), Size::new(1280, 720)).expect("a calibration");
        let (depth, colour) = (rig.depth.pinhole, rig.colour.pinhole);
        assert!((depth.focal_px - Vector2::repeat(501.76)).norm() < 1e-9);
        assert!((depth.middle_px - Point2::new(329.74, 331.5)).norm() < 1e-9);
        assert!((colour.focal_px - Vector2::new(601.6, 604.8)).norm() < 1e-9);
        assert!((colour.middle_px - Point2::new(639.5, 359.5)).norm() < 1e-9);
        // The colour camera is 3.2 cm beside it and looks down.
        let place = rig.colour_from_depth * Point3::new(0.0, 0.0, 2.0);
        assert!((place - Point3::new(-0.032, 0.208, 1.993)).norm() < 1e-3);
        assert_eq!(rig.depth.distortion[2..4], [-9e-5, 6e-5]);
    }

    #[test]
    fn what_is_no_calibration_is_refused_in_one_line() {
        let (depth, colour) = (Size::new(640, 576), Size::new(1280, 720));
        let refused = |text: &str, depth, colour| {
            let said = rig(text, depth, colour).expect_err(text);
            assert!(!said.contains('\n'), "{said}");
        };
        refused("", depth, colour);
        refused("{}", depth, colour);
        refused(CALIBRATION, Size::new(640, 480), colour);
        refused(CALIBRATION, depth, Size::new(1280, 1280));
        for (good, bad) in [
            ("BrownConrady", "Fisheye"),
            ("6e-5, -9e-5", "6e-5"),
            ("PurposeDepth", "Purpose"),
            ("0.51, 0.5", "1e999, 0.5"),
            ("0.49, 0.49", "0, 0.49"),
        ] {
            refused(&CALIBRATION.replace(good, bad), depth, colour);
        }
        // Cut anywhere it is none, and no panic.
        for cut in 0..CALIBRATION.len() {
            refused(&CALIBRATION[..cut], depth, colour);
        }
    }
}
