//! Markers in drawn pictures: followed, hidden, found again, refused.

use super::*;
use crate::config::{MarkerCorrection, MarkerMethod};
use crate::model::Size;
use nalgebra::distance;

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

#[test]
fn the_user_says_which_markers_hang_on_which() {
    let places = [[60.0, 105.0], [80.0, 65.0], [110.0, 25.0]];
    let mut tracker = begun(&places, &settings(&places)).expect("markers");
    let near = |k: usize| Point2::from(places[k]) + Vector2::new(9.0, -7.0);
    tracker.hang(&[near(0), near(1), near(1), near(2)], 24.0);
    let parents = |tracker: &MarkerTracker| -> Vec<Option<String>> {
        tracker.windows().into_iter().map(|w| w.parent).collect()
    };
    let names: Vec<String> = tracker.windows().into_iter().map(|w| w.name).collect();
    let chain = vec![None, Some(names[0].clone()), Some(names[1].clone())];
    assert_eq!(parents(&tracker), chain);
    let events = tracker.take_events();
    assert_eq!(
        events,
        [MarkerEvent::Hung {
            names: names.clone()
        }]
    );
    assert!(!events[0].is_warning());
    // A ring, and a click where no marker is, change nothing.
    tracker.hang(&[near(2), near(0)], 24.0);
    tracker.hang(&[near(0), Point2::new(10.0, 10.0)], 24.0);
    assert_eq!(parents(&tracker), chain);
    let said: Vec<String> = tracker
        .take_events()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(said[0].contains("form a ring"), "{said:?}");
    assert!(said[1].contains("no marker is near 10, 10 px"), "{said:?}");
}

#[test]
fn a_correction_in_a_frame_that_never_comes_is_said() {
    let mut settings = settings(&[[100.0, 90.0]]);
    let name = settings.windows[0].name.clone();
    for frame in [1, 99] {
        settings.corrections.push(MarkerCorrection {
            marker: name.clone(),
            frame,
            at_px: [100.0, 90.0],
        });
    }
    let still = picture(&[[100.0, 90.0]], RED);
    let mut tracker = begun(&[[100.0, 90.0]], &settings).expect("markers");
    for k in 0..4 {
        tracker.step(k, 0.1 * k as f64, &still, &NoScene);
    }
    tracker.finish();
    let unused = MarkerEvent::CorrectionUnused { name, frame: 99 };
    assert_eq!(tracker.take_events(), [unused]);
}
