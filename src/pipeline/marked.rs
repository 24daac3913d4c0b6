//! Coloured markers beside the points: frame to tracks of markers.

use crate::config::{MarkerWindow, Markers};
use crate::depth::{DepthGate, DepthReader};
use crate::markers::{MarkerError, MarkerEvent, MarkerPlace, MarkerTracker, Scene};
use crate::model::{Background, DepthImage, Frame, Observation, Outline, Size, TrackId, TrackSet};
use nalgebra::Point2;
use std::collections::BTreeSet;

/// Side of the window around a marker that is picked, px at 640 px, and how far from a marker a click may be that means
/// it: the picture in a terminal is coarse.
const PICKED_SIDE_PX: f64 = 16.0;
const MEANT_PX: f64 = 48.0;

/// What is known of the depths of markers before a frame, and the depth in it.
pub(super) struct MarkerDepths<'a> {
    pub gate: &'a DepthGate,
    pub reader: Option<&'a DepthReader>,
    pub image: Option<&'a DepthImage>,
    pub picture: Size,
}

impl Scene for MarkerDepths<'_> {
    fn may_be_at(&self, marker: TrackId, place_px: Point2<f64>) -> bool {
        let (Some(reader), Some(image)) = (self.reader, self.image) else {
            return true;
        };
        let depth = reader.at(image, self.picture, place_px);
        depth.is_none_or(|depth| self.gate.may_be(marker, &depth))
    }
}

/// Follows markers, where there are any, from the first frame in colour on.
pub(super) struct MarkerStage {
    settings: Markers,
    tracker: Option<MarkerTracker>,
    /// Picked in the picture, px; they are taken in the next frame.
    picked_px: Vec<Point2<f64>>,
    /// Places of markers that hang on each other in this order, px.
    orders_px: Vec<Vec<Point2<f64>>>,
    /// What could not be done.
    refused: Vec<MarkerEvent>,
    /// Those that are in the tracks.
    joined: BTreeSet<TrackId>,
    error: Option<MarkerError>,
    /// There are others than before.
    are_new: bool,
}

impl MarkerStage {
    pub fn new(settings: &Markers) -> Self {
        Self {
            settings: settings.clone(),
            tracker: None,
            picked_px: Vec::new(),
            orders_px: Vec::new(),
            refused: Vec::new(),
            joined: BTreeSet::new(),
            error: None,
            are_new: false,
        }
    }

    /// Follows the markers into a frame, whose colours are not needed any more then. Markers that are
    /// looked for lie in `region`, if there is one; none is at a depth that `depths` does not allow.
    pub fn step(
        &mut self,
        frame: &mut Frame,
        region: Option<&Outline>,
        depths: &MarkerDepths,
    ) -> Vec<MarkerPlace> {
        let Some(picture) = frame.colour.take() else {
            return Vec::new();
        };
        if self.tracker.is_none() && self.error.is_none() {
            let tracker = MarkerTracker::begin(&picture, frame.time_s, region, &self.settings);
            match tracker {
                Ok(tracker) => self.tracker = Some(tracker),
                Err(e) => self.error = Some(e),
            }
            self.are_new = true;
        }
        let Some(tracker) = &mut self.tracker else {
            return Vec::new();
        };
        let scale = f64::from(picture.size.width) / 640.0;
        for at_px in self.picked_px.drain(..) {
            tracker.pick(&picture, frame.time_s, at_px, PICKED_SIDE_PX * scale);
            self.are_new = true;
        }
        for places_px in self.orders_px.drain(..) {
            self.are_new |= tracker.hang(&places_px, MEANT_PX * scale);
        }
        tracker.step(frame.index, frame.time_s, &picture, depths)
    }

    /// The tracks begin anew, and the markers are new in them.
    pub fn restart(&mut self) {
        self.joined.clear();
    }

    /// Adds the markers of a frame to its tracks, without the camera's motion.
    pub fn join(&mut self, markers: &[MarkerPlace], tracks: &mut TrackSet) {
        if tracks.camera.background == Background::Lost {
            return;
        }
        // They are never rejected, and count from when points do: those on trial would not count beside
        // them.
        let points = &tracks.observations;
        let confirmed = points.is_empty() || points.iter().any(|o| o.confirmed);
        for marker in markers {
            tracks.born += u32::from(self.joined.insert(marker.id));
            let steady_px = tracks.camera.steady_px(marker.at_px).cast::<f32>();
            tracks.observations.push(Observation {
                id: marker.id,
                u_px: steady_px.x,
                v_px: steady_px.y,
                fb_error_px: 0.0,
                error_px: None,
                confirmed,
                depth: None,
            });
        }
    }

    pub fn pick(&mut self, places_px: Vec<Point2<f64>>) {
        self.picked_px.extend(places_px);
    }

    /// Hangs markers on each other in the next frame; where none are followed, nothing can.
    pub fn hang(&mut self, places_px: Vec<Point2<f64>>) {
        let are_followed = self
            .tracker
            .as_ref()
            .is_some_and(MarkerTracker::has_markers);
        if are_followed || !self.picked_px.is_empty() {
            self.orders_px.push(places_px);
        } else {
            let why = "none are followed yet; pick them first (key c)".to_owned();
            self.refused.push(MarkerEvent::NotHung { why });
        }
    }

    pub fn finish(&mut self) {
        if let Some(tracker) = &mut self.tracker {
            tracker.finish();
        }
    }

    pub fn take_events(&mut self) -> Vec<MarkerEvent> {
        let mut events = std::mem::take(&mut self.refused);
        if let Some(tracker) = &mut self.tracker {
            events.extend(tracker.take_events());
        }
        events
    }

    pub fn take_error(&mut self) -> Option<MarkerError> {
        self.error.take()
    }

    pub fn take_new(&mut self) -> Option<Vec<MarkerWindow>> {
        let is_new = std::mem::take(&mut self.are_new);
        let tracker = self.tracker.as_ref().filter(|_| is_new)?;
        Some(tracker.windows())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    #[test]
    fn a_marker_is_born_once_in_tracks_that_begin_anew() {
        let mut stage = MarkerStage::new(&Config::default().markers);
        assert_eq!(
            (born_in_a_frame(&mut stage), born_in_a_frame(&mut stage)),
            (1, 0)
        );
        stage.restart();
        assert_eq!(born_in_a_frame(&mut stage), 1);
    }

    fn born_in_a_frame(stage: &mut MarkerStage) -> u32 {
        let marker = MarkerPlace {
            id: TrackId::of_marker(0),
            at_px: Point2::new(20.0, 30.0),
        };
        let mut tracks = TrackSet::default();
        stage.join(&[marker], &mut tracks);
        tracks.born
    }
}
