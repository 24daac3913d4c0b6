//! What a capture is judged by: the facts of one that is at its end, or goes on.

use super::finish::{CaptureJob, Quality};
use super::shaking::CameraShownBy;
use crate::config::Dynamics;
use crate::dynamics::Take;
use crate::model::{
    CaptureFacts, FilmCut, Foot, Judgement, Picture, PointFacts, SwayFacts, TrackLog,
};
use crate::signal::statistics::quantile;
use crate::solve::Model;

/// Share of the points that move less than a capture is said to move: trunk and limbs near it hold
/// most of the points and hardly move, the quarter farthest out tells the sway.
const QUIETER: f64 = 0.75;

/// A film that is judged.
pub struct JudgedFilm<'a> {
    pub is_filming: bool,
    pub length: FilmLength,
    pub quality: &'a Quality,
    /// Its last seconds.
    pub log: &'a TrackLog,
    pub settings: &'a Dynamics,
    /// Mean grey of the picture, 0 to 255.
    pub brightness: Option<f64>,
    /// `None` without a tree.
    pub foot: Option<Foot>,
    pub sway: Option<SwayFacts>,
    /// `None` where the film is in one piece, or that is not known yet.
    pub cut: Option<FilmCut>,
}

/// How long the film is in which points were followed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmLength {
    /// Without the time in which the camera was away, s.
    pub seconds: f64,
    /// Frames a second by their own times.
    pub rate_hz: Option<f64>,
}

impl JudgedFilm<'_> {
    /// What it is judged by.
    pub fn facts(&self) -> CaptureFacts {
        let shaking = self.quality.shaking().so_far();
        let amplitudes_px = self.log.last(self.settings.window_s).amplitudes_px();
        CaptureFacts {
            is_filming: self.is_filming,
            amplitude_px: quantile(amplitudes_px, QUIETER),
            filmed_s: self.length.seconds * (1.0 - shaking.lost_share),
            rate_hz: self.length.rate_hz,
            highest_hz: self.settings.highest_hz,
            points: PointFacts {
                followed: self.quality.tracks_total(),
                alive: self.quality.tracks_alive(),
                lost_per_s: self.quality.lost_per_s(),
            },
            brightness: self.brightness,
            foot: self.foot.map(|foot| foot.basis),
            has_other_trunk: self.foot.is_some_and(|foot| foot.other_px.is_some()),
            sway: self.sway,
            shake: shaking.shake,
            is_camera_unknown: shaking.shown_by() == CameraShownBy::Nothing,
            is_camera_by_foot: shaking.shown_by() == CameraShownBy::Foot,
            camera_moved_at_s: shaking.lost_since_s,
            cut_at_s: None,
        }
        .with_cut(self.cut)
    }
}

/// What a capture is worth whose tree is `tree`, with its sway where that was analysed, which is
/// that of `take`.
pub fn judge(job: &CaptureJob, tree: Option<&Model>, take: &Take) -> Judgement {
    let film = JudgedFilm {
        is_filming: false,
        length: job.quality.length(&job.shared.camera_state()),
        quality: &job.quality,
        log: &job.log,
        settings: &job.config.dynamics,
        brightness: job.picture.as_ref().and_then(mean_grey),
        foot: tree.map(|tree| tree.foot),
        sway: tree.and_then(sway_facts),
        cut: take.cut(),
    };
    Judgement::of(film.facts())
}

fn sway_facts(tree: &Model) -> Option<SwayFacts> {
    let modes = tree.tree_modes.iter().map(Into::into);
    SwayFacts::of(&tree.skeleton, &tree.modes, modes)
}

/// Mean grey of a picture, 0 to 255; `None` without a pixel.
pub fn mean_grey(picture: &Picture) -> Option<f64> {
    let pixels = &picture.rgb.pixels;
    let sum: u64 = pixels.iter().map(|value| u64::from(*value)).sum();
    (!pixels.is_empty()).then(|| sum as f64 / pixels.len() as f64)
}
