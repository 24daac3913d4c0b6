//! One marker: what it looks like, its window, and what becomes of it.

use super::area::PixelArea;
use super::error::{MarkerError, MarkerEvent};
use super::hue::{Blob, Hsv, HueModel};
use super::places::check_window;
use super::search::settled;
use super::way::Way;
use crate::config::{MarkerWindow, Markers};
use crate::model::Size;
use nalgebra::Point2;

/// How fast what is usual follows what is seen, a frame.
const USUAL_SHARE: f64 = 0.05;
/// A marker that is missed for so long is hidden, s: twigs pass before markers all the time.
const HIDDEN_S: f64 = 0.3;

/// What must last of a marker from frame to frame.
pub struct Marker {
    /// As it was given or found.
    pub given: MarkerWindow,
    pub hue: HueModel,
    /// The window in the first frame; its size is kept by mean shift.
    pub first: PixelArea,
    pub window: PixelArea,
    pub way: Way,
    pub usual: Blob,
    /// How compact it was in its first frame, 0 to 1.
    pub compact: f64,
    is_hidden: bool,
}

/// Where a window has come to stand, and what is in it.
#[derive(Clone, Copy)]
pub struct Sighting {
    pub window: PixelArea,
    pub blob: Blob,
}

impl Marker {
    /// The marker in the middle of its window in this frame; `elsewhere` is the share of each bin of
    /// hues in the rest of the picture.
    ///
    /// # Errors
    /// The window is off the picture or shows no colour, or OpenCV fails.
    pub fn begin(
        hsv: &Hsv,
        given: MarkerWindow,
        elsewhere: &[f32],
        time_s: f64,
        settings: &Markers,
    ) -> Result<Self, MarkerError> {
        let window = PixelArea::of_window(&given);
        check_window(&given, hsv.size)?;
        let Some(hue) = HueModel::of(hsv, &window, elsewhere, settings)? else {
            return Err(MarkerError::Grey { name: given.name });
        };
        let Some(likely) = hue.likelihood(hsv, &window.grown(1.0))? else {
            return Err(MarkerError::Grey { name: given.name });
        };
        let Some(Sighting { window: at, blob }) =
            settled(&likely, &window, &window, settings.method)?
        else {
            return Err(MarkerError::Grey { name: given.name });
        };
        Ok(Self {
            given,
            hue,
            first: window,
            window: at,
            way: Way::begin(blob.at_px, blob.radius_px(), time_s),
            compact: likely.compact(&blob, &at, blob.radius_px()),
            usual: blob,
            is_hidden: false,
        })
    }

    /// The user says where it is.
    pub fn set(&mut self, at_px: Point2<f64>, time_s: f64) {
        self.window = PixelArea::around(at_px, self.first.size_px());
        self.way.set(at_px, time_s);
    }

    /// It is seen; an event if it had been hidden.
    pub fn see(&mut self, sighting: &Sighting, time_s: f64) -> Option<MarkerEvent> {
        let hidden_s = time_s - self.way.seen_s();
        self.window = sighting.window;
        self.way.see(sighting.blob.at_px, time_s);
        self.usual.mass_px += USUAL_SHARE * (sighting.blob.mass_px - self.usual.mass_px);
        std::mem::take(&mut self.is_hidden).then(|| MarkerEvent::FoundAgain {
            name: self.given.name.clone(),
            time_s,
            hidden_s,
        })
    }

    /// It is not seen in a frame of this size; an event if that lasts.
    pub fn miss(&mut self, time_s: f64, picture: Size) -> Option<MarkerEvent> {
        self.way.miss();
        if self.is_hidden || time_s - self.way.seen_s() < HIDDEN_S {
            return None;
        }
        self.is_hidden = true;
        let name = self.given.name.clone();
        let time_s = self.way.seen_s();
        let around = PixelArea::around(self.way.at_px(), self.first.size_px());
        Some(match around.within(picture) == Some(around) {
            true => MarkerEvent::Hidden { name, time_s },
            false => MarkerEvent::LeftPicture { name, time_s },
        })
    }

    /// There are no more frames; an event if it was not found again.
    pub fn finish(&self) -> Option<MarkerEvent> {
        self.is_hidden.then(|| MarkerEvent::Lost {
            name: self.given.name.clone(),
            time_s: self.way.seen_s(),
        })
    }
}
