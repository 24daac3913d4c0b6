//! Whether a motion dies down over a whole film as a free decay does: a hint that the film begins
//! after a release. It is no proof: wind that happens to fade does the same.

use super::super::film::Film;
use super::energy::energy;

/// Time over which speeds are taken, s.
const OVER_S: f64 = 0.12;
/// The film in pieces whose energy falls from each to the next: by so much at the most it may grow,
/// to this share of itself it falls in all, and its logarithm lies so near to a straight line
/// (share of the variance). Of 216 parts of windy films of 5 to 10 s 8 did so, of 57 parts that
/// begin after a release 27.
const PIECES: usize = 4;
const MAX_GROWTH: f64 = 1.15;
const MAX_SHARE_LEFT: f64 = 0.3;
const MIN_STRAIGHTNESS: f64 = 0.85;

/// Whether the motion grows less from begin to end, as evenly as a free decay does.
pub fn fades_as_a_free_decay(film: &Film) -> bool {
    let Some(energy) = energy(film, OVER_S) else {
        return false;
    };
    let mut means = [0.0; PIECES];
    for (k, mean) in means.iter_mut().enumerate() {
        let piece = &energy[k * energy.len() / PIECES..(k + 1) * energy.len() / PIECES];
        *mean = piece.iter().map(|e| e.square).sum::<f64>() / piece.len().max(1) as f64;
    }
    if means.iter().any(|m| *m <= 0.0) || means.windows(2).any(|w| w[1] > MAX_GROWTH * w[0]) {
        return false;
    }
    let logs = means.map(f64::ln);
    let (middle, average) = (
        0.5 * (PIECES - 1) as f64,
        logs.iter().sum::<f64>() / PIECES as f64,
    );
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (k, log) in logs.iter().enumerate() {
        let (x, y) = (k as f64 - middle, log - average);
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    let fall = xy / xx * (PIECES - 1) as f64;
    fall <= MAX_SHARE_LEFT.ln() && xy * xy >= MIN_STRAIGHTNESS * xx * yy
}
