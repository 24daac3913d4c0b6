//! The fewest keys of a path, each free to lie beside it.
//!
//! What is off the path counts in a plane, in units of what is allowed, so that the allowed is a
//! disc of radius 1 about every frame's place. A key may lie in one of seven places of that disc;
//! the fewest keys from the first frame to the last are a shortest way over frames and places. Keys
//! on the path alone are a quarter more, and leaving keys out one by one (`sparse_keys.rs`) does
//! not come as low from there as from here.

use super::thin_keys::LONGEST;
use std::f32::consts::TAU;

/// Radius of the ring of six places about the middle. A second ring of six at 0.92 would save one
/// key in a hundred more and take four times as long.
const RING: f32 = 0.55;
/// Places, and one that nothing reaches: all are worked out side by side.
const PLACES: usize = 8;
/// Spans in a row that do not do, after which longer ones are not tried.
const TRIED: usize = 2;
/// After so many frames each it is looked whether one of the places does still.
const LOOKED_AT: usize = 6;

/// A frame between two keys.
#[derive(Clone, Copy, Debug)]
pub(super) struct Between {
    /// Share of the time from the one key to the other.
    pub share: f32,
    /// By how much the way between two keys on the path misses this frame's place.
    pub off: [f32; 2],
    /// How far from its place it may be, at most 1.
    pub limit: f32,
}

/// The fewest keys that lead up to a place, and of all ways with as few the one that is nearest to
/// the path: what is off is left to the joints above to make good.
#[derive(Clone, Copy)]
struct Reached {
    keys: u32,
    off_squares: f32,
    /// The key before: its frame and its place.
    before: (usize, usize),
}

const UNREACHED: Reached = Reached {
    keys: u32::MAX,
    off_squares: 0.0,
    before: (0, 0),
};

/// Frames and places, off the path, of the fewest keys for the frames 0 to `limits.len() - 1`, the
/// first and the last among them. `limits`: how far off each frame may be; `between(a, b, k)`:
/// frame k between keys a and b.
pub(super) fn plan(
    limits: &[f32],
    between: impl Fn(usize, usize, usize) -> Between,
) -> Vec<(usize, [f32; 2])> {
    let Some(end) = limits.len().checked_sub(1) else {
        return Vec::new();
    };
    let places = places();
    let square = |i: usize| places[0][i] * places[0][i] + places[1][i] * places[1][i];
    // The path itself always is.
    let allowed = |frame: usize, i: usize| i == 0 || square(i) <= limits[frame] * limits[frame];
    let mut reached = vec![[UNREACHED; PLACES]; limits.len()];
    let mut fewest = vec![1; limits.len()];
    for i in (0..PLACES).filter(|&i| allowed(0, i)) {
        reached[0][i] = Reached {
            keys: 1,
            off_squares: square(i),
            before: (0, 0),
        };
    }
    let mut frames = Vec::new();
    for b in 1..=end {
        let mut best = u32::MAX;
        for a in farthest(b, &between)..b {
            let keys = fewest[a] + 1;
            if keys > best {
                continue;
            }
            frames.clear();
            frames.extend((a + 1..b).map(|k| between(a, b, k)));
            // The middle first: it is off the farthest, as a rule.
            let middle = frames.len() / 2;
            frames.rotate_left(middle);
            let starts = reached[a];
            for i in (0..PLACES).filter(|&i| starts[i].keys < keys) {
                let Some(off_squares) = off_squares(&frames, [places[0][i], places[1][i]], &places)
                else {
                    continue;
                };
                for j in (0..PLACES).filter(|&j| off_squares[j].is_finite() && allowed(b, j)) {
                    let off_squares = starts[i].off_squares + off_squares[j] + square(j);
                    let known = &mut reached[b][j];
                    if keys < known.keys || keys == known.keys && off_squares < known.off_squares {
                        *known = Reached {
                            keys,
                            off_squares,
                            before: (a, i),
                        };
                        best = best.min(keys);
                    }
                }
            }
        }
        // From the frame before every place can be reached.
        fewest[b] = best;
    }
    let better = |i: &usize, j: &usize| {
        let (a, b) = (&reached[end][*i], &reached[end][*j]);
        a.keys
            .cmp(&b.keys)
            .then(a.off_squares.total_cmp(&b.off_squares))
    };
    let last = (0..PLACES).min_by(better).map(|place| (end, place));
    let before =
        |&(frame, place): &(usize, usize)| (frame > 0).then(|| reached[frame][place].before);
    let mut keys: Vec<(usize, [f32; 2])> = std::iter::successors(last, before)
        .map(|(frame, place)| (frame, [places[0][place], places[1][place]]))
        .collect();
    keys.reverse();
    keys
}

/// The frame farthest back from which frame `b` may be reached: not even keys off the path in the
/// best way do from farther, or it is [`LONGEST`] back.
fn farthest(b: usize, between: &impl Fn(usize, usize, usize) -> Between) -> usize {
    let (mut far, mut failed) = (b, 0);
    while far > b.saturating_sub(LONGEST) && failed < TRIED {
        far -= 1;
        let hopeless = |k: usize| {
            let f = between(far, b, k);
            f.off[0] * f.off[0] + f.off[1] * f.off[1] > (f.limit + RING).powi(2)
        };
        failed = if (far + 1..b).any(hopeless) {
            failed + 1
        } else {
            0
        };
    }
    far
}

/// The middle of the disc, the ring about it, and what fills up: x and y.
fn places() -> [[f32; PLACES]; 2] {
    let mut places = [[f32::INFINITY; PLACES]; 2];
    (places[0][0], places[1][0]) = (0.0, 0.0);
    for i in 0..6 {
        let (sine, cosine) = (TAU * i as f32 / 6.0).sin_cos();
        (places[0][1 + i], places[1][1 + i]) = (RING * cosine, RING * sine);
    }
    places
}

/// Sum of the squares by which the frames are off between a key at `from` and one at each of the
/// places, infinite where one is off too far; `None` where one is for all.
fn off_squares(
    frames: &[Between],
    from: [f32; 2],
    to: &[[f32; PLACES]; 2],
) -> Option<[f32; PLACES]> {
    let mut sum = [0.0; PLACES];
    for (k, f) in frames.iter().enumerate() {
        let (x, y) = (
            f.off[0] + from[0] * (1.0 - f.share),
            f.off[1] + from[1] * (1.0 - f.share),
        );
        let limit = f.limit * f.limit;
        for j in 0..PLACES {
            let (x, y) = (x + f.share * to[0][j], y + f.share * to[1][j]);
            let square = x * x + y * y;
            sum[j] += if square <= limit {
                square
            } else {
                f32::INFINITY
            };
        }
        // Looked at after the first one, which fails most, and then seldom.
        if k % LOOKED_AT == 0 && sum.iter().all(|s| *s == f32::INFINITY) {
            return None;
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Frames of a path in the plane, `radius` allowed.
    fn planned(
        n: usize,
        radius: f64,
        path: impl Fn(usize) -> [f64; 2],
    ) -> (Vec<(usize, [f32; 2])>, f64) {
        let on = |a: usize, b: usize, k: usize, c: usize| {
            let share = (k - a) as f64 / (b - a) as f64;
            path(a)[c] + share * (path(b)[c] - path(a)[c])
        };
        let between = |a: usize, b: usize, k: usize| Between {
            share: (k - a) as f32 / (b - a) as f32,
            off: [0, 1].map(|c| ((on(a, b, k, c) - path(k)[c]) / radius) as f32),
            limit: 1.0,
        };
        let keys = plan(&vec![1.0; n], between);
        let at = |key: &(usize, [f32; 2]), c: usize| path(key.0)[c] + radius * f64::from(key.1[c]);
        let mut worst = 0.0_f64;
        for pair in keys.windows(2) {
            for k in pair[0].0..=pair[1].0 {
                let share = (k - pair[0].0) as f64 / (pair[1].0 - pair[0].0) as f64;
                let off = |c: usize| {
                    at(&pair[0], c) + share * (at(&pair[1], c) - at(&pair[0], c)) - path(k)[c]
                };
                worst = worst.max(off(0).hypot(off(1)) / radius);
            }
        }
        (keys, worst)
    }

    #[test]
    fn a_straight_path_has_as_few_keys_on_it_as_there_can_be() {
        let (keys, _) = planned(3 * LONGEST + 1, 0.2, |k| [0.5 * k as f64, 3.0]);
        let nothing = |_, _, _| unreachable!("no frames between");
        assert_eq!(keys, [0, 1, 2, 3].map(|n| (n * LONGEST, [0.0; 2])));
        assert_eq!(plan(&[1.0], nothing).len(), 1);
        assert!(plan(&[], nothing).is_empty());
    }

    #[test]
    fn keys_beside_a_sway_are_fewer_than_on_it_and_within_what_is_allowed() {
        // 1.5 Hz at 30 frames a second. A chord on the path is off by its sagitta, one beside it by
        // half of that: by the middle of the sway spans may be 1.41 times as long.
        let sway = |k: usize| {
            [
                8.0 * (TAU * k as f64 / 20.0).sin(),
                2.0 * (TAU * k as f64 / 20.0).cos(),
            ]
        };
        let (keys, worst) = planned(300, 0.3, sway);
        let fits = |a: usize, b: usize| {
            (a + 1..b).all(|k| {
                let share = (k - a) as f64 / (b - a) as f64;
                let off = |c: usize| sway(a)[c] + share * (sway(b)[c] - sway(a)[c]) - sway(k)[c];
                off(0).hypot(off(1)) <= 0.3
            })
        };
        let on_it = super::super::thin_keys::thin(300, false, fits);
        assert!(worst <= 1.0 + 1e-5, "{worst}");
        assert!(
            10 * keys.len() <= 8 * on_it.len(),
            "{} keys beside, {} on the path",
            keys.len(),
            on_it.len()
        );
    }

    #[test]
    fn where_nothing_may_be_off_every_bend_is_a_key() {
        let bend = |k: usize| [if k < 7 { k as f64 } else { 14.0 - k as f64 }, 0.0];
        let (keys, worst) = planned(15, 1e-6, bend);
        assert_eq!(keys.iter().map(|k| k.0).collect::<Vec<_>>(), [0, 7, 14]);
        assert!(worst <= 1.0, "{worst}");
    }
}
