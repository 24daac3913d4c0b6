//! What is known of the depth beside a film: what the user says goes before what the film says.

use super::error::SourceError;
use crate::config;
use crate::depth::{self, Registration};
use crate::model::{CameraModel, DepthFormat, DepthImage, DepthRig, Size};
use std::path::Path;

/// By how much the proportions of depth image and picture may differ.
const SAME_VIEW: f64 = 0.01;

/// What a film says of its depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SaidOfDepth {
    /// The colour camera.
    pub camera: Option<CameraModel>,
    pub unit_m: Option<f64>,
    /// The unit is part of the format: the user cannot know better.
    pub is_in_metres: bool,
    /// Both cameras, where the depth is not registered with the pictures.
    pub rig: Option<DepthRig>,
}

/// How the depth images of a film are used.
#[derive(Clone, Debug)]
pub(super) struct KnownDepth {
    pub format: DepthFormat,
    picture: Size,
    registration: Option<Registration>,
}

impl SaidOfDepth {
    /// How the depth beside pictures of the size `picture` in the film `path` is used.
    ///
    /// # Errors
    /// Camera or unit is known to nobody.
    pub fn known(
        &self,
        path: &Path,
        settings: &config::Depth,
        picture: Size,
    ) -> Result<KnownDepth, SourceError> {
        let of_rig = self.rig.map(|rig| rig.colour.for_size(picture));
        let given = depth::colour_camera(settings, picture);
        let Some(camera) = given.or(self.camera).or(of_rig) else {
            return Err(SourceError::bad_format(
                path,
                "nothing says what camera its depth belongs to; give --depth-camera FILE, or --no-depth \
                 for the colours alone",
            ));
        };
        camera.pinhole.check(picture).map_err(|why| {
            let advice = match given {
                Some(_) => "correct --depth-camera, or what the settings say of it in [depth]",
                None => {
                    "correct what the film says of it, or give --depth-camera FILE, or --no-depth for the colours alone"
                }
            };
            SourceError::bad_format(path, format!("its camera cannot be one: {why}; {advice}"))
        })?;
        let given = Some(settings.unit_m).filter(|unit_m| *unit_m > 0.0 && !self.is_in_metres);
        let Some(unit_m) = given.or(self.unit_m) else {
            return Err(SourceError::bad_format(
                path,
                "nothing says how long a count of its depth is; give --depth-unit METRES (mostly \
                 0.001), or --no-depth for the colours alone",
            ));
        };
        let mut registration = None;
        if let Some(rig) = self.rig(settings, camera) {
            let usable = Registration::new(&rig, picture, unit_m).ok_or_else(|| {
                let what = "the cameras of its depth and of its pictures make no sense; give \
                            --depth-camera FILE, or --no-depth for the colours alone";
                SourceError::bad_format(path, what)
            });
            registration = Some(usable?);
        }
        Ok(KnownDepth {
            format: DepthFormat {
                pinhole: camera.pinhole,
                distortion: camera.distortion,
                unit_m,
                late_s: settings.late_s,
            },
            picture,
            registration,
        })
    }

    /// Both cameras, where the depth is not registered; the user's go before those of the film.
    fn rig(&self, settings: &config::Depth, camera: CameraModel) -> Option<DepthRig> {
        if let Some(rig) = depth::rig(settings, camera) {
            return Some(rig);
        }
        let rig = self.rig?;
        let colour = match depth::pinhole(settings) {
            Some(_) => camera,
            None => rig.colour,
        };
        Some(DepthRig { colour, ..rig })
    }
}

impl KnownDepth {
    /// Checks that depth images of this size show what the pictures show.
    ///
    /// # Errors
    /// They do not: why they cannot be used.
    pub fn check_size(&self, size: Size) -> Result<(), String> {
        match &self.registration {
            Some(registration) => registration.check_size(size),
            None => check_view(size, self.picture),
        }
    }

    /// A depth image of the film as it is used: registered with the pictures.
    ///
    /// # Errors
    /// It shows something else than the pictures: why it cannot be used.
    pub fn usable(&self, image: DepthImage) -> Result<DepthImage, String> {
        match &self.registration {
            Some(registration) => registration.registered(&image),
            None => check_view(image.size, self.picture).map(|()| image),
        }
    }
}

/// Checks that a depth image of this size shows what the picture shows.
///
/// # Errors
/// It has other proportions: why it cannot be used.
fn check_view(depth: Size, picture: Size) -> Result<(), String> {
    let across = f64::from(depth.width) / f64::from(picture.width);
    let down = f64::from(depth.height) / f64::from(picture.height);
    if (across / down - 1.0).abs() <= SAME_VIEW {
        return Ok(());
    }
    Err(format!(
        "the depth image is {depth}, the picture {picture}; it must be registered with the picture, or \
         --depth-camera must say where its camera is"
    ))
}
