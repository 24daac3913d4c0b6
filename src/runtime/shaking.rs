//! How the camera moved in the film, gathered frame by frame.

use crate::dynamics::shake;
use crate::model::{Background, Shake, TrackSet};
use nalgebra::{Point2, Vector2};

/// The film is looked at in pieces of so long, s: what moves slower is no shake.
const PIECE_S: f64 = 5.0;
/// A camera whose motion is known in a smaller share of the frames is not known.
const KNOWN: f64 = 0.5;

/// Gathers the camera's motion. Memory is bounded.
#[derive(Clone, Debug, Default)]
pub struct ShakeMeter {
    times_s: Vec<f64>,
    shifts_px: Vec<Vector2<f64>>,
    newest: Option<Shake>,
    strongest: Option<Shake>,
    pieces: u32,
    sum_square_px2: f64,
    frames: u64,
    seen: u64,
    by_foot: u64,
    lost: u64,
    lost_since_s: Option<f64>,
}

/// How the camera moved in all of the film.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shaking {
    /// Its trembling where the tree is, at the frequency at which it trembled most; `None` for less
    /// than five seconds in which it was known.
    pub shake: Option<Shake>,
    /// Shares of the frames in which the background showed it, in which the foot of the trunk did
    /// in its place, and in which the background was lost, 0 to 1.
    pub seen_share: f64,
    pub by_foot_share: f64,
    pub lost_share: f64,
    /// Since when it is lost, s; `None` where it is not at the end.
    pub lost_since_s: Option<f64>,
}

/// What shows how the camera moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CameraShownBy {
    /// What stands still around the tree.
    #[default]
    Background,
    /// The foot of the trunk alone: how far it shifts, and not how it turns.
    Foot,
    /// Nothing: its motion cannot be told from the tree's.
    Nothing,
}

impl Shaking {
    /// What shows how the camera moves.
    pub fn shown_by(&self) -> CameraShownBy {
        if self.seen_share >= KNOWN {
            CameraShownBy::Background
        } else if self.seen_share + self.by_foot_share >= KNOWN {
            CameraShownBy::Foot
        } else {
            CameraShownBy::Nothing
        }
    }
}

impl ShakeMeter {
    /// Takes the next frame.
    pub fn note(&mut self, tracks: &TrackSet) {
        self.frames += 1;
        if tracks.camera.background == Background::Lost {
            self.lost += 1;
            self.lost_since_s.get_or_insert(tracks.time_s);
        } else {
            self.lost_since_s = None;
        }
        match tracks.camera.background {
            Background::Seen(_) => self.seen += 1,
            Background::Foot(_) => self.by_foot += 1,
            Background::Unclear | Background::Lost => return,
        }
        let middle = middle(tracks);
        self.times_s.push(tracks.time_s);
        self.shifts_px
            .push(tracks.camera.filmed_px(middle) - middle);
        let begun_s = self.times_s.first().copied().unwrap_or(tracks.time_s);
        if tracks.time_s - begun_s >= PIECE_S {
            self.end_piece();
        }
    }

    fn end_piece(&mut self) {
        let piece = shake(&self.times_s, &self.shifts_px);
        self.times_s.clear();
        self.shifts_px.clear();
        self.pieces += 1;
        self.sum_square_px2 += piece.rms_px.powi(2);
        if self.strongest.is_none_or(|s| piece.rms_px > s.rms_px) {
            self.strongest = Some(piece);
        }
        self.newest = Some(piece);
    }

    /// In the last whole five seconds.
    pub fn newest(&self) -> Option<Shake> {
        self.newest
    }

    /// In the film so far.
    pub fn so_far(&self) -> Shaking {
        let frames = self.frames.max(1) as f64;
        let mean_square = self.sum_square_px2 / f64::from(self.pieces.max(1));
        Shaking {
            shake: self.strongest.map(|strongest| Shake {
                rms_px: mean_square.sqrt(),
                frequency_hz: strongest.frequency_hz,
            }),
            seen_share: self.seen as f64 / frames,
            by_foot_share: self.by_foot as f64 / frames,
            lost_share: self.lost as f64 / frames,
            lost_since_s: self.lost_since_s,
        }
    }
}

/// The middle of the points, at their steady places, px.
fn middle(tracks: &TrackSet) -> Point2<f64> {
    let mut sum = Vector2::zeros();
    for observation in &tracks.observations {
        sum += observation.at_px().coords;
    }
    Point2::from(sum / tracks.observations.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Agreement;

    #[test]
    fn the_foot_shows_how_the_camera_moves_where_the_background_does_not() {
        use CameraShownBy::{Background as Surroundings, Foot, Nothing};
        let [seen, foot] = [Background::Seen, Background::Foot].map(|of| of(Agreement::default()));
        for (backgrounds, expected) in [
            ([seen, seen, foot, Background::Unclear], Surroundings),
            ([seen, foot, foot, Background::Unclear], Foot),
            ([seen, foot, Background::Lost, Background::Unclear], Foot),
            (
                [
                    foot,
                    Background::Unclear,
                    Background::Lost,
                    Background::Unclear,
                ],
                Nothing,
            ),
        ] {
            let mut meter = ShakeMeter::default();
            for (k, background) in (0..4_u32).zip(backgrounds) {
                let mut set = TrackSet {
                    time_s: f64::from(k),
                    ..TrackSet::default()
                };
                set.camera.background = background;
                meter.note(&set);
            }
            assert_eq!(meter.so_far().shown_by(), expected, "{backgrounds:?}");
        }
    }
}
