//! Markers followed through the frames of a film.

use super::area::PixelArea;
use super::blobs;
use super::error::{MarkerError, MarkerEvent};
use super::hue::{Blob, Hsv, HueModel};
use super::search::{candidates, settled};
use super::way::Way;
use crate::config::{MAX_MARKERS, MarkerWindow, Markers};
use crate::model::{Outline, Rgb, TrackId};
use nalgebra::{Point2, Vector2, distance, distance_squared};

/// A marker is seen where so great a share of it is seen as usual.
pub(super) const LEAST_SEEN: f64 = 0.5;
/// How fast what is usual follows what is seen, a frame.
const USUAL_SHARE: f64 = 0.05;
/// Of two markers that are missing one is found where the other is expected so many times as far away.
const CLEARLY_NEARER: f64 = 2.0;
/// A marker that is missed for so long is hidden, s: twigs pass before markers all the time.
const HIDDEN_S: f64 = 0.3;
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
    events: Vec<MarkerEvent>,
}

pub(super) struct Marker {
    given: MarkerWindow,
    pub hue: HueModel,
    /// The window in the first frame; its size is kept by mean shift.
    pub first: PixelArea,
    window: PixelArea,
    /// Where it was seen last, px, and when, s.
    at_px: Point2<f64>,
    seen_s: f64,
    pub way: Way,
    pub usual: Blob,
    /// How compact it was in its first frame, 0 to 1.
    pub compact: f64,
    frames_missed: u32,
    is_hidden: bool,
}

/// Where a window has come to stand, and what is in it.
#[derive(Clone, Copy)]
pub(super) struct Sighting {
    pub window: PixelArea,
    pub blob: Blob,
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
            events: Vec::new(),
        };
        let areas: Vec<PixelArea> = windows.iter().map(area).collect();
        for window in windows {
            tracker.add(&hsv, window, &areas, time_s)?;
        }
        for correction in &settings.corrections {
            if !hsv.size.contains(correction.at_px.into()) {
                return Err(MarkerError::CorrectionOffPicture {
                    name: correction.marker.clone(),
                    frame: correction.frame,
                    size: hsv.size,
                });
            }
        }
        Ok(tracker)
    }

    /// Takes one more marker, in the middle of its window in this frame; `areas` are the windows of all.
    fn add(
        &mut self,
        hsv: &Hsv,
        given: MarkerWindow,
        areas: &[PixelArea],
        time_s: f64,
    ) -> Result<(), MarkerError> {
        let name = given.name.clone();
        let window = area(&given);
        if !hsv.size.contains(window.middle_px()) {
            return Err(MarkerError::OffPicture {
                name,
                size: hsv.size,
            });
        }
        let Some(hue) = HueModel::of(hsv, &window, areas, &self.settings)? else {
            return Err(MarkerError::Grey { name });
        };
        let around = grown(&window, 1.0);
        let likely = hue.likelihood(hsv, &around)?;
        let Some(likely) = likely else {
            return Err(MarkerError::Grey { name });
        };
        let sighting = settled(&likely, &window, &window, self.settings.method)?;
        let Some(Sighting { window: at, blob }) = sighting else {
            return Err(MarkerError::Grey { name });
        };
        for other in &self.markers {
            if distance(&other.at_px, &blob.at_px) < other.usual.radius_px().max(blob.radius_px()) {
                let first = other.given.name.clone();
                return Err(MarkerError::SameBlob {
                    first,
                    second: name,
                });
            }
        }
        self.markers.push(Marker {
            given,
            hue,
            first: window,
            window: at,
            at_px: blob.at_px,
            seen_s: time_s,
            way: Way::begin(blob.at_px, blob.radius_px(), time_s),
            compact: likely.compact(&blob, &at, blob.radius_px()),
            usual: blob,
            frames_missed: 0,
            is_hidden: false,
        });
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
        let hsv = Hsv::of(picture).map_err(MarkerError::from);
        if let Err(why) = hsv.and_then(|hsv| self.add(&hsv, given, &areas, time_s)) {
            self.events.push(MarkerEvent::NotTaken { why });
        }
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
                None => self.events.extend(marker.miss(time_s, picture)),
            }
        }
        places
    }

    /// There are no more frames: says which markers were not found again.
    pub fn finish(&mut self) {
        for marker in &self.markers {
            if marker.is_hidden {
                let (name, time_s) = (marker.given.name.clone(), marker.seen_s);
                self.events.push(MarkerEvent::Lost { name, time_s });
            }
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
        self.part(&mut sightings);
        let seen: Vec<Blob> = sightings.iter().flatten().map(|s| s.blob).collect();
        let missing: Vec<usize> = (0..self.markers.len())
            .filter(|k| sightings[*k].is_none())
            .collect();
        for k in &missing {
            let marker = &self.markers[*k];
            let mut found = candidates(&hsv, marker, &seen, time_s, self.settings.method)?;
            found.retain(|s| {
                scene.may_be_at(TrackId::of_marker(*k), s.blob.at_px)
                    && !self.may_be_another(*k, s.blob.at_px, &missing, time_s)
            });
            sightings[*k] = nearest(&found, &marker.way, time_s);
        }
        self.part(&mut sightings);
        Ok(sightings)
    }

    /// Sets windows where the user says that the markers are in this frame.
    fn correct(&mut self, frame: u64, time_s: f64) {
        for correction in self
            .settings
            .corrections
            .iter()
            .filter(|c| c.frame == frame)
        {
            let named = |m: &&mut Marker| m.given.name == correction.marker;
            if let Some(marker) = self.markers.iter_mut().find(named) {
                marker.at_px = correction.at_px.into();
                marker.window = PixelArea::around(marker.at_px, marker.first.size_px());
                marker.way.set(marker.at_px, time_s);
                marker.frames_missed = 0;
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
                at_px: marker.at_px,
                ..marker.usual
            },
        })
    }

    /// Moves a marker's window from where it was last seen. What lies nearer to another marker belongs
    /// to that.
    fn follow(&self, hsv: &Hsv, k: usize) -> opencv::Result<Option<Sighting>> {
        let marker = &self.markers[k];
        let Some(mut likely) = marker.hue.likelihood(hsv, &grown(&marker.window, 1.0))? else {
            return Ok(None);
        };
        likely.without(|p| self.is_of_other(k, p));
        let sighting = settled(&likely, &marker.window, &marker.first, self.settings.method)?;
        Ok(sighting.filter(|s| s.blob.mass_px >= LEAST_SEEN * marker.usual.mass_px))
    }

    /// Whether a place is nearer to another marker that was just seen.
    fn is_of_other(&self, k: usize, place_px: Point2<f64>) -> bool {
        let own = distance_squared(&self.markers[k].at_px, &place_px);
        let others = self.markers.iter().enumerate();
        others
            .filter(|(other, marker)| *other != k && marker.frames_missed == 0)
            .any(|(_, marker)| distance_squared(&marker.at_px, &place_px) < own)
    }

    /// Whether what is seen at a place may as well be another marker that is missing: it is not clearly
    /// nearer to where this one is expected. Both are missing on then, until one is at its own place.
    fn may_be_another(
        &self,
        k: usize,
        place_px: Point2<f64>,
        missing: &[usize],
        time_s: f64,
    ) -> bool {
        let own_px = self.markers[k].way.off_px(place_px, time_s);
        missing.iter().any(|other| {
            *other != k
                && self.markers[*other].way.may_be_at(place_px, time_s)
                && self.markers[*other].way.off_px(place_px, time_s) < CLEARLY_NEARER * own_px
        })
    }

    /// Of two markers on one blob the one that has come from farther away gives way.
    fn part(&self, sightings: &mut [Option<Sighting>]) {
        for j in 1..sightings.len() {
            for i in 0..j {
                let (Some(first), Some(second)) = (sightings[i], sightings[j]) else {
                    continue;
                };
                let apart_px = distance(&first.blob.at_px, &second.blob.at_px);
                if apart_px >= first.blob.radius_px().max(second.blob.radius_px()) {
                    continue;
                }
                let came_px =
                    |k: usize, s: &Sighting| distance(&self.markers[k].at_px, &s.blob.at_px);
                let giving_way = if came_px(i, &first) > came_px(j, &second) {
                    i
                } else {
                    j
                };
                sightings[giving_way] = None;
            }
        }
    }
}

impl Marker {
    /// It is seen; an event if it had been hidden.
    fn see(&mut self, sighting: &Sighting, time_s: f64) -> Option<MarkerEvent> {
        let hidden_s = time_s - self.seen_s;
        self.window = sighting.window;
        self.at_px = sighting.blob.at_px;
        self.way.see(self.at_px, time_s, self.frames_missed);
        self.seen_s = time_s;
        self.frames_missed = 0;
        self.usual.mass_px += USUAL_SHARE * (sighting.blob.mass_px - self.usual.mass_px);
        std::mem::take(&mut self.is_hidden).then(|| MarkerEvent::FoundAgain {
            name: self.given.name.clone(),
            time_s,
            hidden_s,
        })
    }

    /// It is not seen; an event if that lasts.
    fn miss(&mut self, time_s: f64, picture: &Rgb) -> Option<MarkerEvent> {
        self.frames_missed = self.frames_missed.saturating_add(1);
        if self.is_hidden || time_s - self.seen_s < HIDDEN_S {
            return None;
        }
        self.is_hidden = true;
        let name = self.given.name.clone();
        let time_s = self.seen_s;
        let around = PixelArea::around(self.at_px, self.first.size_px());
        Some(match around.within(picture.size) == Some(around) {
            true => MarkerEvent::Hidden { name, time_s },
            false => MarkerEvent::LeftPicture { name, time_s },
        })
    }
}

/// The window that a user gave, in whole pixels.
fn area(given: &MarkerWindow) -> PixelArea {
    let [u, v, width, height] = given.window_px.map(|side| side.round() as i32);
    PixelArea {
        u,
        v,
        width,
        height,
    }
}

/// The sighting that is nearest to where a marker is expected.
fn nearest(found: &[Sighting], way: &Way, time_s: f64) -> Option<Sighting> {
    found.iter().copied().min_by(|a, b| {
        let [a, b] = [a, b].map(|s| way.off_px(s.blob.at_px, time_s));
        a.total_cmp(&b)
    })
}

/// An area that is larger by so many of its own sizes on each side.
fn grown(area: &PixelArea, by: f64) -> PixelArea {
    PixelArea::around(area.middle_px(), (1.0 + 2.0 * by) * area.size_px())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::MarkerCorrection;
    use crate::config::MarkerMethod;
    use crate::model::Size;

    const SIZE: Size = Size {
        width: 160,
        height: 120,
    };
    const RED: [f64; 3] = [200.0, 30.0, 40.0];

    /// A grey picture with discs of 4 px, drawn by the share of each pixel that they cover.
    fn picture(discs_px: &[[f64; 2]], colour: [f64; 3]) -> Rgb {
        let mut pixels = Vec::with_capacity(3 * SIZE.area());
        for v in 0..SIZE.height {
            for u in 0..SIZE.width {
                let here = Point2::new(f64::from(u), f64::from(v));
                let nearest = discs_px
                    .iter()
                    .map(|disc| distance(&here, &Point2::from(*disc)))
                    .fold(f64::INFINITY, f64::min);
                let share = (4.5 - nearest).clamp(0.0, 1.0);
                pixels.extend(colour.map(|c| (share * c + (1.0 - share) * 120.0) as u8));
            }
        }
        Rgb { size: SIZE, pixels }
    }

    fn settings(middles_px: &[[f64; 2]]) -> Markers {
        let mut markers = Markers::default();
        for (k, [u, v]) in middles_px.iter().enumerate() {
            markers.windows.push(MarkerWindow {
                name: format!("M{k}"),
                window_px: [u - 8.0, v - 8.0, 16.0, 16.0],
                parent: None,
            });
        }
        markers
    }

    fn begun(discs_px: &[[f64; 2]], settings: &Markers) -> Result<MarkerTracker, MarkerError> {
        MarkerTracker::begin(&picture(discs_px, RED), 0.0, None, settings)
    }

    fn error(discs_px: &[[f64; 2]], settings: &Markers) -> String {
        begun(discs_px, settings)
            .err()
            .map_or(String::new(), |e| e.to_string())
    }

    fn off_px(place: &MarkerPlace, truth_px: [f64; 2]) -> f64 {
        distance(&place.at_px, &truth_px.into())
    }

    #[test]
    fn swaying_markers_are_followed_to_parts_of_a_pixel() {
        let methods = [
            (MarkerMethod::MeanShift, 0.3),
            (MarkerMethod::CamShift, 0.5),
        ];
        for (method, within_px) in methods {
            let at = |k: u64| {
                let sway = 12.0 * (k as f64 / 5.0).sin();
                [[40.0 + sway, 50.0], [100.3 + 0.5 * sway, 60.6 - 0.3 * sway]]
            };
            let markers = Markers {
                method,
                ..settings(&at(0))
            };
            let mut tracker = begun(&at(0), &markers).expect("markers");
            for k in 1..60 {
                let places = tracker.step(k, k as f64 / 30.0, &picture(&at(k), RED), &NoScene);
                assert_eq!(places.len(), 2, "{method:?}, frame {k}");
                for (place, truth) in places.iter().zip(at(k)) {
                    assert!(
                        off_px(place, truth) < within_px,
                        "{method:?}, frame {k}: {place:?}, {truth:?}"
                    );
                }
            }
            assert!(tracker.take_events().is_empty());
        }
    }

    #[test]
    fn a_hidden_marker_is_found_again_where_it_has_gone_meanwhile() {
        let mut tracker = begun(
            &[[40.0, 50.0], [120.0, 90.0]],
            &settings(&[[40.0, 50.0], [120.0, 90.0]]),
        )
        .expect("markers");
        for k in 1..31 {
            let places = tracker.step(
                k,
                k as f64 / 30.0,
                &picture(&[[120.0, 90.0]], RED),
                &NoScene,
            );
            assert_eq!(places.len(), 1, "frame {k}");
        }
        // 31 px away, on the side of the other one.
        let places = tracker.step(
            31,
            31.0 / 30.0,
            &picture(&[[62.0, 72.0], [120.0, 90.0]], RED),
            &NoScene,
        );
        assert!(
            places.len() == 2 && off_px(&places[0], [62.0, 72.0]) < 0.3,
            "{places:?}"
        );
        let events = tracker.take_events();
        assert!(
            matches!(
                &events[..],
                [MarkerEvent::Hidden { .. }, MarkerEvent::FoundAgain { .. }]
            ),
            "{events:?}"
        );
    }

    /// Two markers that sway by 10 px, 30 px apart.
    fn swaying(k: u64) -> [[f64; 2]; 2] {
        let sway = 10.0 * (k as f64 / 5.0).sin();
        [[50.0 + sway, 60.0], [80.0 + sway, 62.0]]
    }

    fn followed_for(frames: u64) -> MarkerTracker {
        let mut tracker = begun(&swaying(0), &settings(&swaying(0))).expect("markers");
        for k in 1..frames {
            let places = tracker.step(k, k as f64 / 30.0, &picture(&swaying(k), RED), &NoScene);
            assert_eq!(places.len(), 2, "frame {k}");
        }
        tracker
    }

    #[test]
    fn a_hidden_marker_is_not_taken_for_what_it_cannot_be() {
        let mut tracker = followed_for(90);
        // The left one is hidden; something of its hue is beyond where it sways.
        for k in 90..150 {
            let shown = [[15.0, 60.0], swaying(k)[1]];
            let places = tracker.step(k, k as f64 / 30.0, &picture(&shown, RED), &NoScene);
            assert_eq!(places.len(), 1, "frame {k}: {places:?}");
        }
        let shown = [[15.0, 60.0], swaying(150)[0], swaying(150)[1]];
        let places = tracker.step(150, 5.0, &picture(&shown, RED), &NoScene);
        assert!(
            places.len() == 2 && off_px(&places[0], swaying(150)[0]) < 0.5,
            "{places:?}"
        );
    }

    #[test]
    fn markers_that_were_hidden_together_come_back_as_themselves() {
        let mut tracker = followed_for(90);
        for k in 90..120 {
            tracker.step(k, k as f64 / 30.0, &picture(&[], RED), &NoScene);
        }
        // One is seen before the other.
        for k in 120..240 {
            let both = swaying(k);
            let shown = if k < 160 { &both[..1] } else { &both[..] };
            let places = tracker.step(k, k as f64 / 30.0, &picture(shown, RED), &NoScene);
            for place in &places {
                let own = usize::from(place.id == TrackId::of_marker(1));
                assert!(off_px(place, both[own]) < 0.5, "frame {k}: {place:?}");
            }
            assert!(k < 200 || places.len() == 2, "frame {k}: {places:?}");
        }
    }

    /// Nothing right of this is as far away as the markers.
    struct WallFrom(f64);

    impl Scene for WallFrom {
        fn may_be_at(&self, _: TrackId, place_px: Point2<f64>) -> bool {
            place_px.x < self.0
        }
    }

    #[test]
    fn a_marker_is_not_at_a_depth_where_it_cannot_be() {
        let disc = [[60.0, 60.0]];
        let mut tracker = begun(&disc, &settings(&disc)).expect("marker");
        let moved = picture(&[[63.0, 60.0]], RED);
        assert!(tracker.step(1, 0.1, &moved, &WallFrom(61.0)).is_empty());
        assert_eq!(tracker.step(2, 0.2, &moved, &WallFrom(70.0)).len(), 1);
    }

    #[test]
    fn two_markers_never_share_a_blob() {
        let discs = [[60.0, 60.0], [75.0, 60.0]];
        let mut tracker = begun(&discs, &settings(&discs)).expect("markers");
        // The left one is gone: it must not take the right one, which is in its window.
        let places = tracker.step(1, 0.1, &picture(&[[74.0, 60.0]], RED), &NoScene);
        assert_eq!(places.len(), 1, "{places:?}");
        assert_eq!(places[0].id, TrackId::of_marker(1));
    }

    #[test]
    fn the_user_sets_a_marker_back() {
        let mut markers = settings(&[[30.0, 30.0]]);
        markers.corrections.push(MarkerCorrection {
            marker: "M0".into(),
            frame: 2,
            at_px: [140.0, 100.0],
        });
        let mut tracker = begun(&[[30.0, 30.0]], &markers).expect("markers");
        let far = picture(&[[141.0, 101.5]], RED);
        assert!(
            tracker.step(1, 0.1, &far, &NoScene).is_empty(),
            "too far in one frame"
        );
        let places = tracker.step(2, 0.2, &far, &NoScene);
        assert!(
            places.len() == 1 && off_px(&places[0], [141.0, 101.5]) < 0.3,
            "{places:?}"
        );
        // Where nothing is seen the user's word stands.
        markers.corrections[0].frame = 1;
        let mut tracker = begun(&[[30.0, 30.0]], &markers).expect("markers");
        let places = tracker.step(1, 0.1, &picture(&[], RED), &NoScene);
        assert!(
            places.len() == 1 && off_px(&places[0], [140.0, 100.0]) < 1e-9,
            "{places:?}"
        );
    }

    #[test]
    fn a_marker_that_leaves_the_picture_is_said_to() {
        let mut tracker = begun(&[[12.0, 50.0]], &settings(&[[12.0, 50.0]])).expect("markers");
        for k in 1..30 {
            tracker.step(
                k,
                k as f64 / 30.0,
                &picture(&[[12.0 - 2.0 * k as f64, 50.0]], RED),
                &NoScene,
            );
        }
        tracker.finish();
        let events = tracker.take_events();
        assert!(
            matches!(
                &events[..],
                [MarkerEvent::LeftPicture { .. }, MarkerEvent::Lost { .. }]
            ),
            "{events:?}"
        );
        assert!(events.iter().all(MarkerEvent::is_warning));
    }

    #[test]
    fn markers_that_cannot_be_followed_are_refused() {
        let disc = [[40.0, 50.0]];
        let mut off = settings(&disc);
        off.windows[0].window_px[0] = 400.0;
        assert!(error(&disc, &off).contains("lies off the picture, which is 160x120"));
        let nothing_there = settings(&[[90.0, 50.0]]);
        assert!(error(&disc, &nothing_there).contains("marker M0 has no colour"));
        let twice = settings(&[[40.0, 50.0], [43.0, 51.0]]);
        assert!(error(&disc, &twice).contains("M0 and M1 show the same blob"));
        let mut far = settings(&disc);
        far.corrections.push(MarkerCorrection {
            marker: "M0".into(),
            frame: 7,
            at_px: [200.0, 1.0],
        });
        assert!(error(&disc, &far).contains("frame 7 lies off the picture"));
        let grey = MarkerTracker::begin(&picture(&disc, [60.0; 3]), 0.0, None, &settings(&disc));
        assert_eq!(grey.err(), Some(MarkerError::NoColour));
        let find = Markers {
            find: true,
            hue_deg: 240.0,
            ..Markers::default()
        };
        assert!(error(&disc, &find).contains("no blob of hue 240"));
    }

    #[test]
    fn blobs_of_the_hue_are_found_from_the_bottom_up() {
        let find = Markers {
            find: true,
            ..Markers::default()
        };
        let tracker = begun(&[[40.0, 50.0], [100.0, 90.0]], &find).expect("markers");
        let windows = tracker.windows();
        let names: Vec<&str> = windows.iter().map(|w| w.name.as_str()).collect();
        assert_eq!(names, ["m1", "m2"]);
        let [u, v, width, height] = windows[0].window_px;
        assert!((u + width / 2.0 - 100.5).abs() <= 1.0 && (v + height / 2.0 - 90.5).abs() <= 1.0);
    }

    #[test]
    fn a_marker_is_picked_in_a_later_frame() {
        let mut tracker = begun(&[], &Markers::default()).expect("none");
        tracker.pick(
            &picture(&[[50.0, 40.0]], RED),
            0.5,
            Point2::new(51.0, 41.0),
            16.0,
        );
        let places = tracker.step(1, 0.6, &picture(&[[52.0, 40.0]], RED), &NoScene);
        assert!(
            places.len() == 1 && off_px(&places[0], [52.0, 40.0]) < 0.3,
            "{places:?}"
        );
        tracker.pick(&picture(&[], RED), 0.7, Point2::new(100.0, 90.0), 16.0);
        assert!(matches!(
            &tracker.take_events()[..],
            [MarkerEvent::NotTaken { .. }]
        ));
    }
}
