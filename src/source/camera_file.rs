//! A file with the focal lengths and the middle of a camera, as depth needs them.

use crate::model::{Pinhole, Size};
use nalgebra::{Point2, Vector2};
use serde::Deserialize;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A longer file is something else, bytes.
const LONGEST: u64 = 1 << 16;

/// A camera without distortion, as a file has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFile {
    /// Size of the pictures that it is for; `None` where the file does not say.
    pub size: Option<Size>,
    pub pinhole: Pinhole,
    /// Metres for each count of a depth image; `None` where the file does not say.
    pub unit_m: Option<f64>,
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
    depth_unit_m: Option<f64>,
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

    fn parse(text: &str) -> Result<Self, String> {
        let written: Written = serde_json::from_str(text).map_err(|e| e.to_string())?;
        let pinhole = written.pinhole().ok_or("fx, fy, cx or cy is missing")?;
        if !pinhole.is_valid() {
            return Err("fx and fy must be numbers above 0".to_owned());
        }
        let unit_m = written.depth_unit_m;
        if unit_m.is_some_and(|unit_m| !(unit_m > 0.0 && unit_m <= 1.0)) {
            return Err("depth_unit_m must be above 0, at most 1".to_owned());
        }
        let sides = written.width.zip(written.height);
        Ok(Self {
            size: sides.map(|(width, height)| Size::new(width, height)),
            pinhole,
            unit_m,
        })
    }
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
                "depth_unit_m": 0.0002}"#,
        )
        .expect("a camera");
        let matrix = CameraFile::parse(
            r#"{"width": 640, "height": 480,
                "intrinsic_matrix": [525, 0, 0, 0, 520.5, 0, 319.5, 239.5, 1]}"#,
        )
        .expect("a camera");
        assert_eq!(numbers.pinhole, matrix.pinhole);
        assert_eq!(numbers.size, Some(Size::new(640, 480)));
        assert_eq!((numbers.unit_m, matrix.unit_m), (Some(0.0002), None));
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
            r#"{"fx": 525, "fy": 525, "cx": 1, "cy": 1, "depth_unit_m": 5000}"#,
        ] {
            let said = CameraFile::parse(bad).expect_err(bad);
            assert!(!said.contains('\n'), "{said}");
        }
    }
}
