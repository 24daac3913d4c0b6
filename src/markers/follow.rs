//! Markers followed through the frames of a film.

use super::area::PixelArea;
use super::blobs;
use super::claims;
use super::error::{MarkerError, MarkerEvent};
use super::hue::{Blob, Hsv, hues_elsewhere};
use super::marker::{Marker, Sighting};
use super::places::check_places;
use super::search::{candidates, settled};
use super::way::Way;
use crate::config::{MAX_MARKERS, MarkerWindow, Markers, check_marker_names};
use crate::model::{Outline, Rgb, TrackId};
use nalgebra::{Point2, Vector2};

/// A marker is seen where so great a share of it is seen as usual.
pub(super) const LEAST_SEEN: f64 = 0.5;

/// Says where a marker may be by what else is known of the scene, as its depth.
pub trait Scene {
    /// Whether this marker may be what is seen at a place of the picture, px.
    fn may_be_at(&self, marker: TrackId, place_px: Point2<f64>) -> bool;
}

/// Nothing else is known.
pub struct NoScene;

impl Scene for NoScene {
    fn may_be_at(&self, _: TrackId, _: Point2<f64>) -> bool {
        true
    }
}

/// Where a marker is seen in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerPlace {
    pub id: TrackId,
    /// Its middle where it is filmed, px.
    pub at_px: Point2<f64>,
}

/// Follows markers; holds what must last from frame to frame.
pub struct MarkerTracker {
    settings: Markers,
    markers: Vec<Marker>,
    /// Which of the corrections were of a frame that came.
    is_used: Vec<bool>,
    events: Vec<MarkerEvent>,
}

impl MarkerTracker {
    /// Takes the markers of the settings in the first frame, or finds them there, within `region` if
    /// that is known.
    ///
    /// # Errors
    /// There are none, or one of them cannot be followed.
    pub fn begin(
        picture: &Rgb,
        time_s: f64,
        region: Option<&Outline>,
        settings: &Markers,
    ) -> Result<Self, MarkerError> {
        let hsv = Hsv::of(picture)?;
        if settings.are_wanted() && hsv.is_grey() {
            return Err(MarkerError::NoColour);
        }
        let mut windows = settings.windows.clone();
        if windows.is_empty() && settings.find {
            windows = blobs::find(&hsv, region, settings)?;
            if windows.is_empty() {
                let hue_deg = settings.hue_deg;
                return Err(MarkerError::NoneFound { hue_deg });
            }
        }
        let mut tracker = Self {
            settings: settings.clone(),
            markers: Vec::new(),
            is_used: vec![false; settings.corrections.len()],
            events: Vec::new(),
        };
        let areas: Vec<PixelArea> = windows.iter().map(PixelArea::of_window).collect();
        let elsewhere = hues_elsewhere(&hsv, &areas, settings)?;
        for window in windows {
            tracker.add(&hsv, window, &elsewhere, time_s)?;
        }
        check_places(&[], &settings.corrections, hsv.size)?;
        Ok(tracker)
    }

    /// Takes one more marker, in the middle of its window in this frame.
    fn add(
        &mut self,
        hsv: &Hsv,
        given: MarkerWindow,
        elsewhere: &[f32],
        time_s: f64,
    ) -> Result<(), MarkerError> {
        let marker = Marker::begin(hsv, given, elsewhere, time_s, &self.settings)?;
        for other in &self.markers {
            let there = Blob {
                at_px: other.way.at_px(),
                ..other.usual
            };
            if there.overlaps(&marker.usual) {
                return Err(MarkerError::SameBlob {
                    first: other.given.name.clone(),
                    second: marker.given.name,
                });
            }
        }
        self.markers.push(marker);
        Ok(())
    }

    /// Takes one more marker that is picked in the picture at a place, px, with a window of this side,
    /// px; what speaks against it is an event.
    pub fn pick(&mut self, picture: &Rgb, time_s: f64, at_px: Point2<f64>, side_px: f64) {
        let name = format!("m{}", self.markers.len() + 1);
        let window = PixelArea::around(at_px, Vector2::repeat(side_px));
        let given = MarkerWindow {
            name,
            window_px: [window.u, window.v, window.width, window.height].map(f64::from),
            parent: None,
        };
        if self.markers.len() >= MAX_MARKERS {
            return;
        }
        let mut areas: Vec<PixelArea> = self.markers.iter().map(|m| m.window).collect();
        areas.push(window);
        if let Err(why) = self.take(picture, given, &areas, time_s) {
            self.events.push(MarkerEvent::NotTaken { why });
        }
    }

    /// Takes one more marker in a picture in which the markers are in these areas.
    fn take(
        &mut self,
        picture: &Rgb,
        given: MarkerWindow,
        areas: &[PixelArea],
        time_s: f64,
    ) -> Result<(), MarkerError> {
        let hsv = Hsv::of(picture)?;
        let elsewhere = hues_elsewhere(&hsv, areas, &self.settings)?;
        self.add(&hsv, given, &elsewhere, time_s)
    }

    /// Hangs the markers that are nearest to these places, px, on each other, the first nearest to the foot. A place
    /// that is farther than `reach_px` from all markers means none; what speaks against it is an event.
    /// Whether any parent has changed.
    pub fn hang(&mut self, places_px: &[Point2<f64>], reach_px: f64) -> bool {
        let before = self.windows();
        let event = match self.hung(places_px, reach_px) {
            Ok(names) => MarkerEvent::Hung { names },
            Err(why) => MarkerEvent::NotHung { why },
        };
        self.events.push(event);
        self.windows() != before
    }

    /// Whether any marker is followed.
    pub fn has_markers(&self) -> bool {
        !self.markers.is_empty()
    }

    fn hung(&mut self, places_px: &[Point2<f64>], reach_px: f64) -> Result<Vec<String>, String> {
        let mut order = Vec::new();
        for at_px in places_px {
            let nearest = self
                .nearest(*at_px, reach_px)
                .ok_or_else(|| format!("no marker is near {:.0}, {:.0} px", at_px.x, at_px.y))?;
            if order.last() != Some(&nearest) {
                order.push(nearest);
            }
        }
        if order.len() < 2 {
            return Err("click on two markers at least".to_owned());
        }
        let mut windows = self.windows();
        let ordered: Vec<String> = order.iter().map(|k| windows[*k].name.clone()).collect();
        // An order that is given anew takes the place of the one before.
        for k in &order {
            windows[*k].parent = windows[*k]
                .parent
                .take()
                .filter(|name| !ordered.contains(name));
        }
        for pair in order.windows(2) {
            windows[pair[1]].parent = Some(windows[pair[0]].name.clone());
        }
        check_marker_names(&windows).map_err(|e| e.to_string())?;
        for (marker, window) in self.markers.iter_mut().zip(windows) {
            marker.given = window;
        }
        Ok(ordered)
    }

    /// The marker that is nearest to a place, px, if one is near.
    fn nearest(&self, at_px: Point2<f64>, reach_px: f64) -> Option<usize> {
        let offs_px = self.markers.iter().map(|m| (m.way.at_px() - at_px).norm());
        let (nearest, off_px) = offs_px.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
        (off_px <= reach_px).then_some(nearest)
    }

    /// The markers as they were given or found, in the order of their ids.
    pub fn windows(&self) -> Vec<MarkerWindow> {
        self.markers.iter().map(|m| m.given.clone()).collect()
    }

    /// What has become of markers since the last call.
    pub fn take_events(&mut self) -> Vec<MarkerEvent> {
        std::mem::take(&mut self.events)
    }

    /// Follows all markers into the next frame; those that are seen there, in the order of their ids.
    pub fn step(
        &mut self,
        frame: u64,
        time_s: f64,
        picture: &Rgb,
        scene: &impl Scene,
    ) -> Vec<MarkerPlace> {
        let sightings = match self.sightings(frame, time_s, picture, scene) {
            Ok(sightings) => sightings,
            Err(e) => {
                tracing::warn!("markers are not followed into frame {frame}: {e}");
                vec![None; self.markers.len()]
            }
        };
        let mut places = Vec::with_capacity(sightings.len());
        for (k, sighting) in sightings.iter().enumerate() {
            let marker = &mut self.markers[k];
            match sighting {
                Some(sighting) => {
                    places.push(MarkerPlace {
                        id: TrackId::of_marker(k),
                        at_px: sighting.blob.at_px,
                    });
                    self.events.extend(marker.see(sighting, time_s));
                }
                None => self.events.extend(marker.miss(time_s, picture.size)),
            }
        }
        places
    }

    /// There are no more frames: says which markers were not found again.
    pub fn finish(&mut self) {
        self.events
            .extend(self.markers.iter().filter_map(Marker::finish));
        let corrections = self.settings.corrections.iter().zip(&self.is_used);
        for (correction, _) in corrections.filter(|(_, is_used)| !**is_used) {
            self.events.push(MarkerEvent::CorrectionUnused {
                name: correction.marker.clone(),
                frame: correction.frame,
            });
        }
    }

    /// Where each marker is seen in the next frame.
    fn sightings(
        &mut self,
        frame: u64,
        time_s: f64,
        picture: &Rgb,
        scene: &impl Scene,
    ) -> opencv::Result<Vec<Option<Sighting>>> {
        let hsv = Hsv::of(picture)?;
        self.correct(frame, time_s);
        let mut sightings = Vec::with_capacity(self.markers.len());
        for (k, marker) in self.markers.iter().enumerate() {
            let followed = self.follow(&hsv, k)?.filter(|s| {
                let place_px = s.blob.at_px;
                marker.way.may_be_at(place_px, time_s)
                    && scene.may_be_at(TrackId::of_marker(k), place_px)
            });
            sightings.push(followed.or(self.corrected(frame, k)));
        }
        claims::part(&self.markers, &mut sightings);
        let seen: Vec<Blob> = sightings.iter().flatten().map(|s| s.blob).collect();
        let missing: Vec<usize> = (0..self.markers.len())
            .filter(|k| sightings[*k].is_none())
            .collect();
        for k in &missing {
            let marker = &self.markers[*k];
            let mut found = candidates(&hsv, marker, &seen, time_s, self.settings.method)?;
            found.retain(|s| {
                scene.may_be_at(TrackId::of_marker(*k), s.blob.at_px)
                    && !claims::may_be_another(&self.markers, *k, s.blob.at_px, &missing, time_s)
            });
            sightings[*k] = nearest(&found, &marker.way, time_s);
        }
        claims::part(&self.markers, &mut sightings);
        Ok(sightings)
    }

    /// Sets windows where the user says that the markers are in this frame.
    fn correct(&mut self, frame: u64, time_s: f64) {
        let corrections = self.settings.corrections.iter().zip(&mut self.is_used);
        for (correction, is_used) in corrections.filter(|(c, _)| c.frame == frame) {
            *is_used = true;
            let named = |m: &&mut Marker| m.given.name == correction.marker;
            if let Some(marker) = self.markers.iter_mut().find(named) {
                marker.set(correction.at_px.into(), time_s);
            }
        }
    }

    /// The place that the user gives a marker in this frame, as it is.
    fn corrected(&self, frame: u64, k: usize) -> Option<Sighting> {
        let marker = &self.markers[k];
        let corrections = &self.settings.corrections;
        let is_given = corrections
            .iter()
            .any(|c| c.frame == frame && c.marker == marker.given.name);
        is_given.then_some(Sighting {
            window: marker.window,
            blob: Blob {
                at_px: marker.way.at_px(),
                ..marker.usual
            },
        })
    }

    /// Moves a marker's window from where it was last seen. What lies nearer to another marker belongs
    /// to that.
    fn follow(&self, hsv: &Hsv, k: usize) -> opencv::Result<Option<Sighting>> {
        let marker = &self.markers[k];
        let Some(mut likely) = marker.hue.likelihood(hsv, &marker.window.grown(1.0))? else {
            return Ok(None);
        };
        likely.without(|p| claims::is_of_other(&self.markers, k, p));
        let sighting = settled(&likely, &marker.window, &marker.first, self.settings.method)?;
        Ok(sighting.filter(|s| s.blob.mass_px >= LEAST_SEEN * marker.usual.mass_px))
    }
}

/// The sighting that is nearest to where a marker is expected.
fn nearest(found: &[Sighting], way: &Way, time_s: f64) -> Option<Sighting> {
    found.iter().copied().min_by(|a, b| {
        let [a, b] = [a, b].map(|s| way.off_px(s.blob.at_px, time_s));
        a.total_cmp(&b)
    })
}

#[cfg(test)]
mod tests;
