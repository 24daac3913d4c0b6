//! Depth beside the colours.

use super::command_error::CommandError;
use super::common::parse_within;
use super::unused;
use crate::config;
use crate::files::{LARGEST_NOTE, read_bounded};
use crate::import::read_lens_profile;
use crate::model::{Distortion, LONGEST_LAG_S, Pinhole, Size};
use crate::source::{CameraFile, SourceInfo};
use anyhow::anyhow;
use clap::Args;
use std::path::Path;

/// Smallest and largest plausible count of a depth image, m.
const LEAST_UNIT_M: f64 = 1e-6;
const LARGEST_UNIT_M: f64 = 1.0;

/// Depth options of every command that films or reads a film.
#[derive(Clone, Debug, Default, Args)]
pub struct DepthArgs {
    /// Metres for each count of a depth image, e.g. 0.001, where the film does not say it, or says it
    /// wrongly.
    #[arg(long, value_name = "METRES", value_parser = unit)]
    depth_unit: Option<f64>,
    /// The colour camera of a film with depth, where the film does not say it: a JSON file with fx, fy,
    /// cx and cy (px), or with an intrinsic_matrix as Open3D writes it, or a profile by `calibrate`. See
    /// docs/depth.md.
    #[arg(long, value_name = "FILE", value_parser = camera)]
    depth_camera: Option<CameraFile>,
    /// How much later depth images are stamped than they were taken, s, where a warning says so: e.g. 0.05.
    #[arg(long, value_name = "SECONDS", value_parser = late, allow_negative_numbers = true)]
    depth_late: Option<f64>,
    /// Take the colours of a film with depth alone.
    #[arg(long, conflicts_with_all = ["depth_unit", "depth_camera", "depth_late"])]
    no_depth: bool,
}

/// Parses the unit of depth images, m.
fn unit(text: &str) -> Result<f64, String> {
    parse_within(
        text.trim().trim_end_matches('m'),
        LEAST_UNIT_M..=LARGEST_UNIT_M,
        "give the metres of one count, 0.000001 to 1, like 0.001",
    )
}

/// Parses how late depth images are stamped, s.
fn late(text: &str) -> Result<f64, String> {
    parse_within(
        text.trim().trim_end_matches('s'),
        -LONGEST_LAG_S..=LONGEST_LAG_S,
        "give seconds, -0.25 to 0.25, like 0.05",
    )
}

/// Parses `--depth-camera`: a camera, or a lens profile of one.
fn camera(text: &str) -> Result<CameraFile, String> {
    let path = Path::new(text);
    CameraFile::read(path).or_else(|e| of_profile(path).ok_or_else(|| e.to_string()))
}

/// The camera of a lens profile, as `calibrate` writes it; `None` where the file is none, or of a fisheye.
fn of_profile(path: &Path) -> Option<CameraFile> {
    let lens = read_lens_profile(&read_bounded(path, LARGEST_NOTE).ok()?).ok()?;
    let Distortion::RadialTangential(distortion) = lens.distortion else {
        return None;
    };
    Some(CameraFile {
        size: Some(lens.size),
        pinhole: Pinhole {
            focal_px: lens.focal_px,
            middle_px: lens.middle_px,
        },
        distortion: distortion.to_vec(),
        unit_m: None,
        depth: None,
    })
}

impl DepthArgs {
    /// Applies the options of the command line.
    pub fn set(&self, depth: &mut config::Depth) {
        depth.read &= !self.no_depth;
        if let Some(file) = &self.depth_camera {
            let pinhole = file.pinhole;
            (depth.fx_px, depth.fy_px) = (pinhole.focal_px.x, pinhole.focal_px.y);
            (depth.cx_px, depth.cy_px) = (pinhole.middle_px.x, pinhole.middle_px.y);
            depth.distortion = file.distortion.clone();
            depth.own_camera = file.depth.iter().cloned().collect();
            depth.unit_m = file.unit_m.unwrap_or(depth.unit_m);
        }
        depth.unit_m = self.depth_unit.unwrap_or(depth.unit_m);
        depth.late_s = self.depth_late.unwrap_or(depth.late_s);
    }

    /// Notes the options that change nothing, as the film of this source has no depth.
    pub fn note_unused(&self, film: &SourceInfo) {
        if film.live || film.depth.is_some() {
            return;
        }
        for (is_given, option) in [
            (self.depth_unit.is_some(), "--depth-unit"),
            (self.depth_camera.is_some(), "--depth-camera"),
            (self.depth_late.is_some(), "--depth-late"),
        ] {
            if is_given {
                unused::note(option, "the film has no depth");
            }
        }
    }

    /// Checks that the camera is for pictures of this size.
    ///
    /// # Errors
    /// It is for others.
    pub fn check_size(&self, size: Size) -> Result<(), CommandError> {
        match self.depth_camera.as_ref().and_then(|camera| camera.size) {
            Some(of_file) if of_file != size => Err(CommandError::BadUsage(anyhow!(
                "--depth-camera is for pictures of {of_file}, this film has {size}; give the camera \
                 of its colour pictures"
            ))),
            _ => Ok(()),
        }
    }
}
