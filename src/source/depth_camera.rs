//! A depth camera beside a camera: its images are made ones of the pictures before anybody sees them.

use super::choice::Wish;
use super::depth_format::{KnownDepth, SaidOfDepth};
use super::error::SourceError;
use super::interface::{Health, Source, SourceInfo, Successor};
use super::v4l2;
use crate::config::Config;
use crate::model::{DepthFormat, DepthImage, PixelFormat, RawFrame, Size};
use std::path::Path;
use std::sync::Arc;

/// A V4L2 device with depth. Its frames have a depth image and no picture.
pub(super) struct DepthCamera {
    camera: Box<dyn Source>,
    known: Arc<KnownDepth>,
    /// Images that show something else than the pictures.
    unusable: u64,
}

impl DepthCamera {
    /// Opens the device for depth beside pictures of the size `picture`.
    ///
    /// # Errors
    /// It cannot be opened, gives no depth, or nothing says its unit and the colour camera.
    pub(super) fn open(path: &Path, config: &Config, picture: Size) -> Result<Self, SourceError> {
        let settings = &config.depth;
        let known = SaidOfDepth::default().known(path, settings, picture)?;
        let own = settings.own_camera.first();
        let size = own.map_or(picture, |own| Size::new(own.width, own.height));
        let wish = Wish {
            format: Some(PixelFormat::DEPTH[0]),
            size,
            rate_hz: f64::from(config.camera.rate_hz),
        };
        let camera = v4l2::Camera::open_as(path, &config.camera, &wish)?;
        let given = camera.describe().size;
        known
            .check_size(given)
            .map_err(|what| SourceError::bad_format(path, what))?;
        Ok(Self::of(Box::new(camera), Arc::new(known)))
    }

    fn of(camera: Box<dyn Source>, known: Arc<KnownDepth>) -> Self {
        Self {
            camera,
            known,
            unusable: 0,
        }
    }
}

impl Source for DepthCamera {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        while let Some(mut frame) = self.camera.next_frame()? {
            let bytes = std::mem::take(&mut frame.bytes);
            let image = DepthImage::from_bytes(frame.size, &bytes);
            match image.and_then(|image| self.known.usable(image).ok()) {
                Some(image) => {
                    frame.depth = Some(Arc::new(image));
                    return Ok(Some(frame));
                }
                None => self.unusable += 1,
            }
        }
        Ok(None)
    }

    fn describe(&self) -> SourceInfo {
        SourceInfo {
            depth: Some(self.known.format),
            ..self.camera.describe()
        }
    }

    fn wrapped(&self) -> Option<&dyn Source> {
        Some(&*self.camera)
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        Some(&mut *self.camera)
    }

    fn successor(&self) -> Option<Successor> {
        let (camera, known) = (self.camera.successor()?, self.known.clone());
        Some(Box::new(move || {
            Box::new(Self::of(camera(), known.clone()))
        }))
    }

    fn health(&self) -> Health {
        let health = self.camera.health();
        Health {
            damaged: health.damaged + self.unusable,
            ..health
        }
    }
}

/// A camera with a depth camera beside it, until somebody reads that one on a thread of its own. Its
/// frames are those of the camera alone.
pub(super) struct Beside {
    camera: Box<dyn Source>,
    depth: Option<Box<dyn Source>>,
    format: Option<DepthFormat>,
}

impl Beside {
    pub(super) fn new(camera: Box<dyn Source>, depth: Box<dyn Source>) -> Self {
        Self {
            camera,
            format: depth.describe().depth,
            depth: Some(depth),
        }
    }
}

impl Source for Beside {
    fn next_frame(&mut self) -> Result<Option<RawFrame>, SourceError> {
        self.camera.next_frame()
    }

    fn describe(&self) -> SourceInfo {
        SourceInfo {
            depth: self.format,
            ..self.camera.describe()
        }
    }

    fn wrapped(&self) -> Option<&dyn Source> {
        Some(&*self.camera)
    }

    fn wrapped_mut(&mut self) -> Option<&mut dyn Source> {
        Some(&mut *self.camera)
    }

    fn successor(&self) -> Option<Successor> {
        let (camera, format) = (self.camera.successor()?, self.format);
        Some(Box::new(move || {
            Box::new(Self {
                camera: camera(),
                depth: None,
                format,
            })
        }))
    }

    fn take_depth_camera(&mut self) -> Option<Box<dyn Source>> {
        self.depth.take()
    }
}
