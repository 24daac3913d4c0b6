//! Where the camera of a film stood about a scanned tree.
//!
//! A film shows the tree as an orthographic camera does: the scan is turned about the vertical, and
//! a similarity of the plane (scale, roll, shift) lays it on the picture. Either pairs of places
//! that a user has found in both give them, or the lines of the wood: from starts all round the
//! tree, nearest lines are paired and the similarity fitted anew (iterative closest points, Besl &
//! McKay 1992; the nearest are looked for in place and direction). There is an answer only if lines
//! lie near each other, and clearly nearer than from any other side.

use super::lines::{LinePlace, WoodPiece, places_seen, thickest};
use crate::signal::{CommonMotion, Pair};
use nalgebra::{Point2, Point3, Similarity2, UnitComplex, Vector2, distance_squared};
use std::f64::consts::TAU;

/// Starts round the tree, and the steps about the best of them, radians.
const STARTS: usize = 48;
const REFINING_STEPS_RAD: [f64; 4] = [0.06, 0.03, 0.01, 0.003];
/// Rounds of pairing from each start, and from the best.
const ROUNDS: usize = 8;
/// Lines are sampled at so many places in the height of the tree, from the starts and about the
/// best of them.
const SAMPLES_IN_HEIGHT: [f64; 2] = [40.0, 150.0];
/// A line at a right angle counts as so far away, as a share of the height.
const ACROSS_SHARE: f64 = 0.04;
/// Of the scan the thickest wood counts, so long as this many times the wood of the film.
const SCAN_LENGTHS: f64 = 1.6;
/// Samples that are nearest to their lines count: those of the film, and those of the scan, which
/// has wood that the film does not show.
const FILM_SHARE: f64 = 0.85;
const SCAN_SHARE: f64 = 0.55;
/// The camera is rolled by no more than this, radians, and the height in the film is that of the
/// scan within this factor.
const LARGEST_ROLL: f64 = 0.2;
const LARGEST_FACTOR: f64 = 1.6;
/// An answer misses lines by no more than this share of the height, and another side of the tree,
/// farther off than this angle, by so many times as much at least.
const LARGEST_MISS: f64 = 0.016;
const OTHER_SIDE_RAD: f64 = 0.4;
const LEAST_CONTRAST: f64 = 1.15;
/// Pairs of places are missed by no more than this share of the height.
const LARGEST_PAIR_MISS: f64 = 0.03;
/// They agree if they are missed by no more than this share: places are clicked to 0.5 %.
const AGREEING: f64 = 0.01;

/// The same place in the film and in the scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacePair {
    /// px, v down.
    pub film_px: Point2<f64>,
    /// m, z up.
    pub scan: Point3<f64>,
}

/// How a scan lies in the picture of a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registration {
    /// By which the scan is turned about the vertical, so that the picture's right is along x,
    /// radians.
    pub turn: f64,
    /// From there to the picture, x to the right and z up to px with y up.
    pub to_picture: Similarity2<f64>,
    /// What it misses lines or pairs by, as a share of the height in the film.
    pub miss: f64,
    /// The same from the best other side of the tree, if lines were used.
    pub other_side_miss: Option<f64>,
}

impl Registration {
    /// A place of the scan in the picture, px, y up.
    pub fn project(&self, at: &Point3<f64>) -> Point2<f64> {
        self.to_picture * turned(at, self.turn)
    }

    /// How far a place of the scan is behind the foot as the camera sees it, px.
    pub fn depth_px(&self, at: &Point3<f64>) -> f64 {
        let (sin, cos) = self.turn.sin_cos();
        self.to_picture.scaling() * (at.y * cos - at.x * sin)
    }

    /// Whether places that are the same in film and scan come to lie together; `height_px` is that of the
    /// tree in the film. Places of the film have y up.
    pub fn agrees_with(&self, pairs: &[PlacePair], height_px: f64) -> bool {
        let squares = pairs
            .iter()
            .map(|p| distance_squared(&self.project(&p.scan), &p.film_px));
        let mean = squares.sum::<f64>() / pairs.len().max(1) as f64;
        mean.sqrt() <= LARGEST_PAIR_MISS * height_px
    }

    /// Whether it holds: it misses by little, and no other side of the tree fits nearly as well. By pairs the camera
    /// is not rolled by more than by lines.
    pub fn holds(&self) -> bool {
        match self.other_side_miss {
            Some(other) => self.miss <= LARGEST_MISS && other >= LEAST_CONTRAST * self.miss,
            None => self.miss <= LARGEST_PAIR_MISS && is_upright(&self.to_picture),
        }
    }

    /// Whether a tree so high, m, is about as high in the picture as that of a film, px.
    pub fn fits_height(&self, height_m: f64, height_px: f64) -> bool {
        is_about_as_high(self.to_picture.scaling() * height_m / height_px)
    }
}

/// Whether the camera is rolled by no more than a film is looked for with.
fn is_upright(to_picture: &Similarity2<f64>) -> bool {
    to_picture.isometry.rotation.angle().abs() <= LARGEST_ROLL
}

/// Whether the height of the scan in the picture is so many times that of the film as may be.
fn is_about_as_high(factor: f64) -> bool {
    (1.0 / LARGEST_FACTOR..=LARGEST_FACTOR).contains(&factor)
}

/// Seen from a side.
fn turned(at: &Point3<f64>, turn: f64) -> Point2<f64> {
    let (sin, cos) = turn.sin_cos();
    Point2::new(at.x * cos + at.y * sin, at.z)
}

/// The registration by pairs of places, three at least; `height_px` is that of the tree in the
/// film. Places of the film have y up here. `None` where they do not say it.
pub fn by_pairs(pairs: &[PlacePair], height_px: f64) -> Option<Registration> {
    if pairs.len() < 3 {
        return None;
    }
    let mut best: Option<Registration> = None;
    let mut steps = vec![TAU / STARTS as f64];
    steps.extend(REFINING_STEPS_RAD);
    for (round, step) in steps.into_iter().enumerate() {
        let middle = best.map_or(0.0, |b| b.turn);
        let reach = if round == 0 { STARTS as i32 / 2 } else { 5 };
        for k in -reach..=reach {
            let turn = middle + f64::from(k) * step;
            let flat: Vec<Pair> = pairs
                .iter()
                .map(|p| Pair {
                    from_px: turned(&p.scan, turn),
                    to_px: p.film_px,
                })
                .collect();
            let Some(to_picture) = least_squares(&flat) else {
                continue;
            };
            let squares: f64 = flat
                .iter()
                .map(|p| p.miss_px(&to_picture).norm_squared())
                .sum();
            let miss = (squares / pairs.len() as f64).sqrt() / height_px;
            if best.is_none_or(|b| miss < b.miss) {
                best = Some(Registration {
                    turn,
                    to_picture,
                    miss,
                    other_side_miss: None,
                });
            }
        }
    }
    best
}

/// The one pair without which the others agree, of five or more that do not; `None` where there is none, or another one
/// as well. They agree where they are missed by [`AGREEING`] of the height at most.
pub fn odd_pair(pairs: &[PlacePair], height_px: f64) -> Option<usize> {
    let is_off = by_pairs(pairs, height_px).is_none_or(|all| all.miss > AGREEING);
    if pairs.len() < 5 || !is_off {
        return None;
    }
    let mut odd = None;
    for k in 0..pairs.len() {
        let mut others = pairs.to_vec();
        others.remove(k);
        if by_pairs(&others, height_px).is_some_and(|fit| fit.miss <= AGREEING) {
            if odd.is_some() {
                return None;
            }
            odd = Some(k);
        }
    }
    odd
}

/// The similarity of least squares; `None` where all lie in one place.
fn least_squares(pairs: &[Pair]) -> Option<Similarity2<f64>> {
    let count = pairs.len() as f64;
    let from = pairs.iter().map(|p| p.from_px.coords).sum::<Vector2<f64>>() / count;
    let to = pairs.iter().map(|p| p.to_px.coords).sum::<Vector2<f64>>() / count;
    let (mut along, mut across, mut square) = (0.0, 0.0, 0.0);
    for pair in pairs {
        let (a, b) = (pair.from_px.coords - from, pair.to_px.coords - to);
        along += a.dot(&b);
        across += a.perp(&b);
        square += a.norm_squared();
    }
    let scale = along.hypot(across) / square;
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let turn = UnitComplex::new(across.atan2(along));
    let shift = to - scale * (turn * from);
    Some(Similarity2::from_parts(shift.into(), turn, scale))
}

/// The registration by lines: `film` in the picture, px, y up, the foot at the origin; `scan` in
/// space, m, z up, the foot at the origin. `None` where there is nothing to compare; else it is to
/// be asked whether it [`holds`](Registration::holds).
pub fn by_lines(
    film: &[WoodPiece<Point2<f64>>],
    scan: &[WoodPiece<Point3<f64>>],
) -> Option<Registration> {
    let height_px = film
        .iter()
        .map(|p| p.to.y.max(p.from.y))
        .fold(0.0, f64::max);
    let height = scan
        .iter()
        .map(|p| p.to.z.max(p.from.z))
        .fold(0.0, f64::max);
    if height_px <= 0.0 || height <= 0.0 {
        return None;
    }
    let length_px: f64 = film.iter().map(WoodPiece::length).sum();
    let start = height_px / height;
    let scan = thickest(scan, SCAN_LENGTHS * length_px / start);
    let [lines, fine] = SAMPLES_IN_HEIGHT.map(|samples| Lines {
        film: film
            .iter()
            .flat_map(|p| p.cut(height_px / samples))
            .map(|part| part.place())
            .collect(),
        scan: scan.iter().flat_map(|p| p.cut(height / samples)).collect(),
        height_px,
        start,
    });
    if lines.film.len() < 10 || lines.scan.len() < 10 {
        return None;
    }
    let mut all: Vec<Registration> = Vec::new();
    for k in 0..STARTS {
        let turn = TAU * k as f64 / STARTS as f64;
        all.extend(lines.fit(turn, Similarity2::new(Vector2::zeros(), 0.0, start)));
    }
    let first = all
        .iter()
        .copied()
        .min_by(|a, b| a.miss.total_cmp(&b.miss))?;
    let others = all
        .iter()
        .filter(|r| apart(r.turn, first.turn) > OTHER_SIDE_RAD);
    let other = others.copied().min_by(|a, b| a.miss.total_cmp(&b.miss));
    let other = other.and_then(|o| fine.fit(o.turn, o.to_picture));
    let mut best = fine.fit(first.turn, first.to_picture)?;
    for step in REFINING_STEPS_RAD {
        for k in [-2.0, -1.0, 1.0, 2.0] {
            let near = fine.fit(best.turn + k * step, best.to_picture);
            best = near.filter(|n| n.miss < best.miss).unwrap_or(best);
        }
    }
    best.other_side_miss = Some(other.map_or(f64::INFINITY, |o| o.miss));
    Some(best)
}

/// The angle between two directions, radians.
fn apart(a: f64, b: f64) -> f64 {
    let off = (a - b).rem_euclid(TAU);
    off.min(TAU - off)
}

/// The lines of both.
struct Lines {
    film: Vec<LinePlace>,
    /// Short pieces.
    scan: Vec<WoodPiece<Point3<f64>>>,
    height_px: f64,
    /// px in a metre if both are as high as each other.
    start: f64,
}

/// A sample and its nearest, and how far that is in place and direction.
#[derive(Clone, Copy, Debug)]
struct Match {
    pair: Pair,
    off: f64,
}

impl Lines {
    /// Pairs and fits from one start.
    fn fit(&self, turn: f64, start: Similarity2<f64>) -> Option<Registration> {
        let mut to_picture = start;
        for _ in 0..ROUNDS {
            let matches = self.matches(turn, &to_picture);
            let pairs: Vec<Pair> = matches.iter().map(|m| m.pair).collect();
            // Counted from the present place, as the fit begins without a turn and at scale 1.
            let change = CommonMotion::of(&pairs)?.motion;
            to_picture = change * to_picture;
            let factor = to_picture.scaling() / self.start;
            if !is_upright(&to_picture) || !is_about_as_high(factor) {
                return None;
            }
        }
        let matches = self.matches(turn, &to_picture);
        let off = matches.iter().map(|m| m.off).sum::<f64>() / matches.len() as f64;
        Some(Registration {
            turn,
            to_picture,
            miss: off / self.height_px,
            other_side_miss: None,
        })
    }

    /// The film's places with the nearest of the scan, and the other way round, without those
    /// farthest off.
    fn matches(&self, turn: f64, to_picture: &Similarity2<f64>) -> Vec<Match> {
        let scan = places_seen(&self.scan, |at| to_picture * turned(at, turn));
        let mut matches = self.nearest(&self.film, &scan, FILM_SHARE);
        let of_scan = self.nearest(&scan, &self.film, SCAN_SHARE);
        matches.extend(of_scan.into_iter().map(Match::turned_round));
        matches
    }

    /// For each of some places the nearest of others; only this share of them, the nearest.
    fn nearest(&self, places: &[LinePlace], others: &[LinePlace], share: f64) -> Vec<Match> {
        let across = ACROSS_SHARE * self.height_px;
        let mut matches = Vec::with_capacity(places.len());
        for own in places {
            if let Some(nearest) = own.nearest_of(others, across) {
                let pair = Pair {
                    from_px: others[nearest.place].at,
                    to_px: own.at,
                };
                let off = nearest.off;
                matches.push(Match { pair, off });
            }
        }
        matches.sort_by(|a, b| a.off.total_cmp(&b.off));
        matches.truncate((share * places.len() as f64).ceil() as usize);
        matches
    }
}

impl Match {
    fn turned_round(self) -> Self {
        let pair = Pair {
            from_px: self.pair.to_px,
            to_px: self.pair.from_px,
        };
        Self { pair, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An uneven tree: a stem with limbs to all sides.
    fn scan() -> Vec<WoodPiece<Point3<f64>>> {
        let mut pieces = vec![WoodPiece {
            from: Point3::origin(),
            to: Point3::new(0.3, 0.1, 5.0),
            radius: 0.1,
        }];
        for (k, (height, azimuth, length)) in [
            (1.5, 0.3, 2.0),
            (2.2, 2.9, 1.4),
            (2.9, 4.4, 1.8),
            (3.5, 1.6, 1.1),
            (4.0, 5.6, 0.9),
        ]
        .into_iter()
        .enumerate()
        {
            let from = Point3::new(0.06 * height, 0.02 * height, height);
            let (sin, cos) = f64::sin_cos(azimuth);
            let to = from + nalgebra::Vector3::new(cos, sin, 0.4 + 0.2 * k as f64) * length;
            pieces.push(WoodPiece {
                from,
                to,
                radius: 0.05,
            });
        }
        pieces
    }

    fn filmed(turn: f64, to_picture: Similarity2<f64>) -> Vec<WoodPiece<Point2<f64>>> {
        let flat = |at: &Point3<f64>| to_picture * turned(at, turn);
        scan()
            .iter()
            .map(|p| WoodPiece {
                from: flat(&p.from),
                to: flat(&p.to),
                radius: 0.0,
            })
            .collect()
    }

    #[test]
    fn the_side_from_which_a_tree_was_filmed_is_found() {
        let truth = Similarity2::new(Vector2::new(3.0, -4.0), 0.03, 60.0);
        let film = filmed(2.2, truth);
        let found = by_lines(&film[..5], &scan()).expect("found");
        assert!(found.holds(), "{found:?}");
        assert!(apart(found.turn, 2.2) < 0.05, "{found:?}");
        let top = Point3::new(0.3, 0.1, 5.0);
        let off = (found.project(&top) - truth * turned(&top, 2.2)).norm();
        assert!(off < 0.03 * 300.0, "{off}");
        // Another tree, whose limbs hang to one side: nothing holds.
        let mut other = film.clone();
        for (k, piece) in (1..).zip(&mut other[1..]) {
            piece.to = piece.from + Vector2::new(70.0, -12.0 * f64::from(k));
        }
        assert!(by_lines(&other, &scan()).is_none_or(|r| !r.holds()));
        assert!(by_lines(&[], &scan()).is_none());
    }

    /// Places on a tree that is filmed from 1.1 radians, as they are in the film.
    fn exact_pairs() -> Vec<PlacePair> {
        let truth = Similarity2::new(Vector2::new(30.0, -40.0), -0.05, 80.0);
        let places = [
            [0.0, 0.0, 0.0],
            [1.0, 0.5, 3.0],
            [-0.7, 1.0, 4.0],
            [0.4, -1.5, 3.5],
            [-1.2, -0.4, 2.2],
            [0.2, 0.3, 4.8],
        ];
        let mut pairs = Vec::new();
        for at in places.map(Point3::from) {
            pairs.push(PlacePair {
                film_px: truth * turned(&at, 1.1),
                scan: at,
            });
        }
        pairs
    }

    #[test]
    fn the_pair_that_does_not_fit_the_others_is_named() {
        let mut pairs = exact_pairs();
        assert_eq!(odd_pair(&pairs, 400.0), None);
        pairs[3].film_px.x += 60.0;
        assert_eq!(odd_pair(&pairs, 400.0), Some(3));
        // Two that are off are not told from the others.
        pairs[1].film_px.y -= 80.0;
        assert_eq!(odd_pair(&pairs, 400.0), None);
    }

    #[test]
    fn three_pairs_give_it_and_pairs_that_disagree_do_not() {
        let mut pairs = exact_pairs();
        pairs.truncate(4);
        let found = by_pairs(&pairs[..3], 320.0).expect("found");
        assert!(found.holds());
        let four = by_pairs(&pairs, 320.0).expect("found");
        assert!(apart(four.turn, 1.1) < 0.01 && four.miss < 1e-3, "{four:?}");
        pairs[2].film_px.x += 90.0;
        pairs[1].film_px.y -= 90.0;
        assert!(!by_pairs(&pairs, 320.0).expect("an answer").holds());
        assert!(by_pairs(&pairs[..2], 320.0).is_none());
    }
}
