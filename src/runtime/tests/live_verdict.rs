//! Verdicts on made-up films that go on.

use super::*;
use crate::config::Config;
use crate::model::{
    Agreement, Background, Gap, GapCause, Observation, Size, Timing, TrackId, TrackSet,
};
use crate::pipeline::Followed;
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 30.0;

/// A film of points that sway.
struct Film {
    points: u32,
    amplitude_px: f64,
    background: Background,
    next: u64,
    back: BackEnd,
    config: Config,
    quality: Quality,
    verdict: LiveVerdict,
}

impl Film {
    /// One in which no tree is built, with a window of `window_s`.
    fn new(points: u32, window_s: f64) -> Self {
        let mut config = Config::default();
        config.accumulate.threshold = 1.0;
        config.dynamics.window_s = window_s;
        Self {
            points,
            amplitude_px: 4.0,
            background: Background::Seen(Agreement::default()),
            next: 0,
            back: BackEnd::new(&config),
            config,
            quality: Quality::default(),
            verdict: LiveVerdict::default(),
        }
    }

    /// Films some seconds more; how long the verdicts took.
    fn film(&mut self, seconds: f64) -> Duration {
        let mut took = Duration::ZERO;
        for _ in 0..(seconds * RATE_HZ) as u64 {
            let tracks = self.tracks();
            self.quality.note(&tracks, 0.05, None);
            self.back.step(Followed {
                tracks,
                outline: Arc::new(crate::outline::whole(Size::new(640, 360))),
                preview: None,
                raw: None,
                received: Instant::now(),
            });
            let began = Instant::now();
            let dynamics = &self.config.dynamics;
            let camera = CameraState::default();
            self.verdict
                .step(&self.quality, &self.back, dynamics, &camera);
            took += began.elapsed();
        }
        took
    }

    fn tracks(&mut self) -> TrackSet {
        let time_s = self.next as f64 / RATE_HZ;
        let aside_px = self.amplitude_px * (std::f64::consts::PI * time_s).sin();
        let observations = (0..self.points).map(|id| Observation {
            id: TrackId(id),
            u_px: 100.0 + (id % 20) as f32 + aside_px as f32,
            v_px: 100.0 + (id / 20) as f32,
            fb_error_px: 0.05,
            error_px: None,
            confirmed: true,
            depth: None,
        });
        let mut tracks = TrackSet {
            frame: self.next,
            time_s,
            observations: observations.collect(),
            born: if self.next == 0 { self.points } else { 0 },
            ..TrackSet::default()
        };
        tracks.camera.background = self.background;
        if self.background == Background::Lost {
            tracks.observations.clear();
        }
        self.next += 1;
        tracks
    }

    fn line(&self) -> String {
        let verdict = self.verdict.newest();
        verdict.map_or(String::new(), |verdict| verdict.line())
    }
}

#[test]
fn the_verdict_follows_what_is_filmed() {
    let mut film = Film::new(60, 10.0);
    film.film(0.9);
    assert_eq!(film.line(), "", "less than a second says nothing");
    film.film(11.6);
    assert_eq!(
        film.line(),
        "poor, because: no tree yet; 12 of 30 s filmed. To do: film 18 s more"
    );
    assert_eq!(film.verdict.missing_s(), 18.0);
    film.film(20.0);
    let none = "poor, because: no tree yet. To do: film longer, or pull the tree and release it";
    assert_eq!(film.line(), none);

    // It stands still.
    film.amplitude_px = 0.0;
    film.film(15.0);
    let still = "poor, because: moves by 0.0 px only; no tree yet. To do: come nearer, or film in \
                 more wind";
    assert_eq!(film.line(), still);
    film.amplitude_px = 4.0;
    film.film(15.0);
    assert_eq!(film.line(), none);

    // The camera is turned away, and back.
    film.background = Background::Lost;
    film.film(3.0);
    let line = film.line();
    assert!(line.contains("camera moved at 62.5 s"), "{line}");
    film.background = Background::Seen(Agreement::default());
    film.film(3.0);
    assert_eq!(film.line(), none);

    film.verdict.restart();
    assert_eq!(film.line(), "");
}

/// The stream says a verdict once, and another one as soon as there is one.
#[test]
fn a_verdict_is_said_once() {
    let mut film = Film::new(60, 10.0);
    film.film(45.0);
    assert!(film.verdict.take_unsaid().is_some());
    assert!(film.verdict.take_unsaid().is_none());
    film.film(5.0);
    assert!(film.verdict.take_unsaid().is_none(), "it is the same");
    film.amplitude_px = 0.0;
    film.film(20.0);
    assert!(film.verdict.take_unsaid().is_some());
}

/// Of 2,000 points in a minute of film, and after ten minutes as after one: a fortieth of the time
/// that the frames take to come.
#[test]
fn a_verdict_costs_little_however_long_the_film_is() {
    let mut film = Film::new(2000, 60.0);
    film.film(70.0);
    let took = film.film(10.0);
    println!("{:.2} ms a verdict", took.as_secs_f64() * 100.0);
    assert!(took < Duration::from_millis(2500), "{took:?} in 10 s");
}

/// What the camera was away before points were followed is not taken off their film.
#[test]
fn absences_count_from_where_points_are_followed() {
    let mut film = Film::new(4, 10.0);
    film.quality = Quality::from_now(&away(2, 30.0));
    film.film(11.0);
    for (state, seconds) in [(away(2, 30.0), 11.0), (away(3, 34.0), 7.0)] {
        let length = film.quality.length(&state);
        assert!((length.seconds - seconds).abs() < 0.05, "{length:?}");
        assert!(length.rate_hz.is_some());
    }
    assert_eq!(film.quality.length(&away(9, 90.0)).rate_hz, None);
}

/// A film that is finished later knows its absences by the holes that are listed.
#[test]
fn absences_before_the_first_points_are_found_among_the_gaps() {
    let gaps = vec![
        gap(1.0, 0.5, GapCause::Dropped),
        gap(2.0, 20.0, GapCause::Disconnected),
        gap(24.0, 10.0, GapCause::Silent),
        gap(41.0, 4.0, GapCause::Disconnected),
    ];
    let timing = Timing {
        gaps,
        ..Timing::default()
    };
    let mut film = Film::new(4, 10.0);
    film.quality = Quality::since(40.0, &timing);
    film.film(11.0);
    let length = film.quality.length(&away(3, 34.0));
    assert!((length.seconds - 7.0).abs() < 0.05, "{length:?}");
}

/// A hole of `length_s` in a film from `time_s` on.
fn gap(time_s: f64, length_s: f64, cause: GapCause) -> Gap {
    Gap {
        time_s,
        length_s,
        cause,
        ..Gap::default()
    }
}

/// A camera that was away so often, and so long in all.
fn away(reconnects: u64, away_s: f64) -> CameraState {
    CameraState {
        reconnects,
        away_s,
        ..CameraState::default()
    }
}
