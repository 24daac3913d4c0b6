//! What the points of a branch have in common in every frame: shift and turn.

use super::film::Film;
use super::members::{Points, is_seen, mean_px};

/// Share of the points that a frame must show.
const SEEN: f64 = 0.5;
/// Points that a turn is told from.
const LEAST_TO_TURN: usize = 4;

/// Common motion of some points; no number where too few were seen.
pub(super) struct Common {
    /// To the right and down, px.
    pub shift_px: [Vec<f64>; 2],
    /// Turn about their middle, counterclockwise for the viewer, times their mean distance from it, px; `None` for few
    /// points.
    pub turn_px: Option<Vec<f64>>,
    /// Where their middle is on the average, px.
    pub middle_px: [f64; 2],
}

impl Common {
    /// Of `points` in all frames of `film`; `None` if there are none.
    pub fn of(film: &Film, points: &Points) -> Option<Self> {
        let n = points.tracks.len();
        if n == 0 {
            return None;
        }
        let at: Vec<[f64; 2]> = points.tracks.iter().map(|&k| mean_px(&film.tracks[k].at_px)).collect();
        let middle_px = mean_px(&at);
        let arms: Vec<[f64; 2]> = at.iter().map(|p| [p[0] - middle_px[0], p[1] - middle_px[1]]).collect();
        let frames = film.times_s.len();
        let (mut shift_px, mut turn_px) = ([vec![f64::NAN; frames], vec![f64::NAN; frames]], vec![f64::NAN; frames]);
        for k in 0..frames {
            let seen: Vec<usize> = (0..n).filter(|&i| is_seen(&film.tracks[points.tracks[i]].at_px[k])).collect();
            if (seen.len() as f64) < SEEN * n as f64 {
                continue;
            }
            let moved = |i: usize, c: usize| film.tracks[points.tracks[i]].at_px[k][c] - at[i][c];
            let mean = |f: &dyn Fn(usize) -> f64| seen.iter().map(|&i| f(i)).sum::<f64>() / seen.len() as f64;
            for (c, shift) in shift_px.iter_mut().enumerate() {
                shift[k] = mean(&|i| moved(i, c));
            }
            let squares = mean(&|i| arms[i][0].powi(2) + arms[i][1].powi(2));
            turn_px[k] = mean(&|i| moved(i, 0) * arms[i][1] - moved(i, 1) * arms[i][0]) / squares.sqrt();
        }
        let turns = n >= LEAST_TO_TURN && turn_px.iter().any(|x| x.is_finite());
        Some(Self { shift_px, turn_px: turns.then_some(turn_px), middle_px })
    }

    /// All its signals.
    pub fn signals(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.shift_px.iter().chain(&self.turn_px)
    }
}
