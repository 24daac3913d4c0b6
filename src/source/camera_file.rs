//! A file with the focal lengths and the middle of a camera, as depth needs them.

use super::depth_format::SaidOfDepth;
use crate::config::{self, DepthCamera};
use crate::depth;
use crate::model::{CameraModel, Pinhole, Size};
use nalgebra::{Point2, Vector2};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A longer file is something else, bytes.
const LONGEST: u64 = 1 << 16;

/// A camera, as a file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraFile {
    /// Size of the pictures that it is for; `None` where the file does not say.
    pub size: Option<Size>,
    pub pinhole: Pinhole,
    /// How its lens distorts: up to eight numbers, as in [`CameraModel`].
    pub distortion: Vec<f64>,
    /// Metres for each count of a depth image; `None` where the file does not say.
    pub unit_m: Option<f64>,
    /// The depth camera, where its images are not registered with the pictures.
    pub depth: Option<DepthCamera>,
}

/// Why a file is no camera.
#[derive(Debug, thiserror::Error)]
pub enum CameraFileError {
    #[error("{}: reading it fails: {source}", path.display())]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error(
        "{}: it is no camera ({what}); write {{\"fx\": …, \"fy\": …, \"cx\": …, \"cy\": …}} in pixels",
        path.display()
    )]
    NoCamera { path: PathBuf, what: String },
}

/// What may stand in the file: four numbers, or a matrix column by column as Open3D writes it.
#[derive(Deserialize)]
struct Written {
    width: Option<u32>,
    height: Option<u32>,
    fx: Option<f64>,
    fy: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    intrinsic_matrix: Option<[f64; 9]>,
    #[serde(default)]
    distortion: Vec<f64>,
    depth_unit_m: Option<f64>,
    depth: Option<DepthCamera>,
    /// Files of other programs hold more.
    #[serde(flatten)]
    others: BTreeMap<String, IgnoredAny>,
}

impl CameraFile {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or is no camera.
    pub fn read(path: &Path) -> Result<Self, CameraFileError> {
        let mut text = String::new();
        let read =
            std::fs::File::open(path).and_then(|file| file.take(LONGEST).read_to_string(&mut text));
        read.map_err(|source| CameraFileError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text).map_err(|what| CameraFileError::NoCamera {
            path: path.to_owned(),
            what,
        })
    }

    /// What the file says of the depth beside pictures of this size, whose unit is `unit_m` unless
    /// the file says another, m.
    pub(super) fn said(&self, picture: Size, unit_m: f64) -> SaidOfDepth {
        let own = config::Depth {
            own_camera: self.depth.iter().cloned().collect(),
            ..config::Depth::default()
        };
        let camera = CameraModel {
            size: picture,
            pinhole: self.pinhole,
            distortion: CameraModel::coefficients(&self.distortion),
        };
        SaidOfDepth {
            camera: Some(camera),
            unit_m: Some(self.unit_m.unwrap_or(unit_m)),
            is_in_metres: false,
            rig: depth::rig(&own, camera),
        }
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// It is no camera: why, in one line.
    pub fn parse(text: &str) -> Result<Self, String> {
        let written: Written = serde_json::from_str(text).map_err(|e| one_line(&e.to_string()))?;
        if let Some(key) = written.others.keys().find(|key| key.starts_with("depth")) {
            return Err(format!("{key} is no key of it; depth_unit_m and depth are"));
        }
        let pinhole = written.pinhole().ok_or("fx, fy, cx or cy is missing")?;
        if !pinhole.is_valid() {
            return Err("fx and fy must be numbers above 0".to_owned());
        }
        config::check_distortion(&written.distortion)?;
        let unit_m = written.depth_unit_m;
        if unit_m.is_some_and(|unit_m| !(unit_m > 0.0 && unit_m <= 1.0)) {
            return Err("depth_unit_m must be above 0, at most 1".to_owned());
        }
        if let Some(depth) = &written.depth {
            depth.check().map_err(|what| format!("depth: {what}"))?;
        }
        let sides = written.width.zip(written.height);
        Ok(Self {
            size: sides.map(|(width, height)| Size::new(width, height)),
            pinhole,
            distortion: written.distortion,
            unit_m,
            depth: written.depth,
        })
    }
}

/// A message that may quote what stands in the file.
pub(super) fn one_line(message: &str) -> String {
    message.replace(['\n', '\r'], " ")
}

impl Written {
    fn pinhole(&self) -> Option<Pinhole> {
        if let Some([fx, _, _, _, fy, _, cx, cy, _]) = self.intrinsic_matrix {
            return Some(Pinhole {
                focal_px: Vector2::new(fx, fy),
                middle_px: Point2::new(cx, cy),
            });
        }
        Some(Pinhole {
            focal_px: Vector2::new(self.fx?, self.fy?),
            middle_px: Point2::new(self.cx?, self.cy?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_the_matrix_of_open3d_are_the_same_camera() {
        let numbers = CameraFile::parse(
            r#"{"width": 640, "height": 480, "fx": 525, "fy": 520.5, "cx": 319.5, "cy": 239.5,
                "distortion": [-0.2, 0.05], "depth_unit_m": 0.0002}"#,
        )
        .expect("a camera");
        let matrix = CameraFile::parse(
            r#"{"width": 640, "height": 480,
                "intrinsic_matrix": [525, 0, 0, 0, 520.5, 0, 319.5, 239.5, 1]}"#,
        )
        .expect("a camera");
        assert_eq!(numbers.pinhole, matrix.pinhole);
        assert_eq!(numbers.distortion, [-0.2, 0.05]);
        assert_eq!(numbers.size, Some(Size::new(640, 480)));
        assert_eq!((numbers.unit_m, matrix.unit_m), (Some(0.0002), None));
    }

    #[test]
    fn a_depth_camera_of_its_own_is_read_with_its_place() {
        let text = r#"{"fx": 900, "fy": 900, "cx": 640, "cy": 360, "depth_unit_m": 0.001,
            "depth": {"width": 848, "height": 480, "fx": 420, "fy": 420, "cx": 424, "cy": 240,
                "rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "translation_m": [0.015, 0, 0]}}"#;
        let depth = CameraFile::parse(text).expect("a camera").depth;
        let depth = depth.expect("a depth camera");
        assert_eq!((depth.width, depth.fx_px), (848, 420.0));
        assert_eq!(depth.translation_m, [0.015, 0.0, 0.0]);
        let mirrored = text.replace("[1, 0, 0, 0, 1", "[-1, 0, 0, 0, 1");
        let said = CameraFile::parse(&mirrored).expect_err("a mirror");
        assert!(said.contains("depth: rotation"), "{said}");
    }

    #[test]
    fn what_is_no_camera_is_refused_in_one_line() {
        for bad in [
            "",
            "{}",
            "[]",
            r#"{"fx": 525, "fy": 525, "cx": 1}"#,
            r#"{"fx": 0, "fy": 525, "cx": 1, "cy": 1}"#,
            r#"{"fx": -1e400, "fy": 525, "cx": 1, "cy": 1}"#,
            r#"{"intrinsic_matrix": [1, 2]}"#,
            r#"{"fx": 525, "fy": 525, "cx": 1, "cy": 1, "depth_unit": 0.001}"#,
            r#"{"fx": 525, "fy": 525, "cx": 1, "cy": 1, "depth_unit_m": 5000}"#,
            r#"{"fx": 525, "fy": 525, "cx": 1, "cy": 1, "distortion": [1, 2, 3, 4, 5, 6, 7, 8, 9]}"#,
        ] {
            let said = CameraFile::parse(bad).expect_err(bad);
            assert!(!said.contains('\n'), "{said}");
        }
    }
}
