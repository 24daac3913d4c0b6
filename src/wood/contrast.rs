//! Whether what is drawn on a photograph is on anything: how much a score of colours on a line differs
//! from that at either side of it, and within a crown from that around it, in standard errors.
//!
//! Every piece of the line, and every sector of the crown, gives one difference. Where nothing is, these
//! are as often above 0 as below, whatever texture or light the picture has there; the light of a sky
//! that changes evenly cancels as both sides must differ.

use super::Stroke;
use crate::model::{Outline, Size};
use nalgebra::{Point2, Vector2};

/// How far beside a line is looked, as shares of the picture's width (8, 24 and 72 px of 1500): of
/// these, what differs most counts, for a twig or a trunk.
const BESIDE: [f64; 3] = [8.0 / 1500.0, 24.0 / 1500.0, 72.0 / 1500.0];
/// Of so many places across a line, as far as the hand may be off, the one with the highest score counts, on
/// the line and at its sides.
const ACROSS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Length of a piece of a line, as a share of the picture's width (20 px of 1500: textures repeat
/// within less); a short line has so many pieces at least, and fewer in sight say nothing.
const PIECE: f64 = 20.0 / 1500.0;
const LEAST_PIECES: usize = 8;
const LEAST_IN_SIGHT: usize = 5;
/// A score is no surer than this, its own unit (here: odds as a logarithm).
const LEAST_DEVIATION: f64 = 0.1;
/// Sectors of a crown, and how many must have leaves within and something around.
const SECTORS: usize = 16;
const LEAST_SECTORS: usize = 5;
/// Around a crown is what is so far off it, as shares of the picture's width (10 to 100 px of 1500).
const AROUND: std::ops::Range<f64> = 10.0 / 1500.0..100.0 / 1500.0;
/// Every so many places of a crown are looked at, as a share of the width (3 px of 1500).
const STEP: f64 = 3.0 / 1500.0;

/// What a line is on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Along {
    /// By how many of its standard errors the score on the line is above that at the side where it is
    /// less so; `None` where too little is in sight.
    pub deviations: Option<f64>,
    /// Share of the line's pieces that neither are hidden, nor beside what hides.
    pub in_sight: f64,
}

/// What `line` (px) is on in a picture of this size, where `hides` says of every pixel whether it hides what
/// is drawn.
/// `score` is `None` outside of the picture.
pub fn along(
    line: &Stroke,
    size: Size,
    hides: &[bool],
    off_px: f64,
    score: impl Fn(Point2<f64>) -> Option<f64>,
) -> Along {
    let width_px = f64::from(size.width);
    let scene = Scene {
        size,
        hides,
        off_px,
        score,
    };
    let pieces = Pieces::of(line, PIECE * width_px);
    let mut best = Along {
        deviations: None,
        in_sight: 0.0,
    };
    for share in BESIDE {
        let mut off_left = Differences::default();
        let mut off_right = Differences::default();
        for piece in &pieces.all {
            if let Some(piece) = scene.differences(piece, share * width_px) {
                off_left.add(piece.left);
                off_right.add(piece.right);
            }
        }
        let in_sight = off_left.count as f64 / pieces.all.len().max(1) as f64;
        best.in_sight = best.in_sight.max(in_sight);
        if off_left.count >= LEAST_IN_SIGHT {
            let found = off_left.deviations().min(off_right.deviations());
            best.deviations = Some(best.deviations.map_or(found, |known| known.max(found)));
        }
    }
    best
}

/// A place on a line.
#[derive(Clone, Copy, Debug)]
struct Place {
    at_px: Point2<f64>,
    /// Of length 1.
    left: Vector2<f64>,
}

/// A line in pieces of the same length, each as places a pixel apart.
struct Pieces {
    all: Vec<Vec<Place>>,
}

impl Pieces {
    fn of(line: &Stroke, piece_px: f64) -> Self {
        let mut places = Vec::new();
        for ends in line.windows(2) {
            let way = ends[1] - ends[0];
            let Some(along) = way.try_normalize(f64::EPSILON) else {
                continue;
            };
            let count = way.norm().ceil().max(1.0) as usize;
            for k in 0..count {
                places.push(Place {
                    at_px: ends[0] + way * ((k as f64 + 0.5) / count as f64),
                    left: Vector2::new(along.y, -along.x),
                });
            }
        }
        let long = (piece_px as usize).min(places.len() / LEAST_PIECES).max(1);
        Self {
            all: places.chunks_exact(long).map(<[Place]>::to_vec).collect(),
        }
    }
}

/// Of a piece: its score less that at either side.
struct OfPiece {
    left: f64,
    right: f64,
}

struct Scene<'a, S> {
    size: Size,
    hides: &'a [bool],
    off_px: f64,
    score: S,
}

impl<S: Fn(Point2<f64>) -> Option<f64>> Scene<'_, S> {
    /// `None` where half of the piece or more is hidden or beside what is, or has no side in the picture.
    fn differences(&self, piece: &[Place], beside_px: f64) -> Option<OfPiece> {
        let (mut left, mut right) = (Differences::default(), Differences::default());
        for place in piece {
            let scores = [0.0, beside_px, -beside_px].map(|off_px| self.seen(place, off_px));
            let [Some(on), Some(at_left), Some(at_right)] = scores else {
                continue;
            };
            left.add(on - at_left);
            right.add(on - at_right);
        }
        (2 * left.count > piece.len()).then(|| OfPiece {
            left: left.mean(),
            right: right.mean(),
        })
    }

    /// The score so far to the left of a place; `None` where that is hidden or outside.
    fn seen(&self, place: &Place, off_px: f64) -> Option<f64> {
        let middle = place.at_px + off_px * place.left;
        let pixel = self.size.pixel_at(middle)?;
        if self.hides.get(pixel).is_none_or(|hides| *hides) {
            return None;
        }
        let across = ACROSS.iter().map(|share| share * self.off_px * place.left);
        let scores = across.filter_map(|across| (self.score)(middle + across));
        scores.max_by(f64::total_cmp)
    }
}

/// Numbers of which the mean is wanted.
#[derive(Clone, Copy, Debug, Default)]
struct Differences {
    count: usize,
    sum: f64,
    squares: f64,
}

impl Differences {
    fn add(&mut self, difference: f64) {
        self.count += 1;
        self.sum += difference;
        self.squares += difference * difference;
    }

    fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }

    /// The mean in its standard errors; for two numbers at least.
    fn deviations(&self) -> f64 {
        let count = self.count as f64;
        let variance = (self.squares - self.sum * self.mean()) / (count - 1.0);
        self.mean() / ((variance.max(0.0) + LEAST_DEVIATION.powi(2)) / count).sqrt()
    }
}

/// A crown with its leaves and what is around it.
pub struct Around<'a> {
    pub crown: &'a Outline,
    /// Other than 0 where a leaf is.
    pub leaves: &'a [u8],
    /// How far off the crown each pixel is, px; 0 within it.
    pub off_px: &'a [f32],
}

impl Around<'_> {
    /// Whether a pixel is around the crown.
    pub fn is_beside(&self, pixel: usize) -> bool {
        let width_px = f64::from(self.crown.size.width);
        AROUND.contains(&(f64::from(self.off_px[pixel]) / width_px))
    }

    /// By how many of its standard errors the score within the crown is above that around it, in the sectors
    /// that have leaves; `None` where too few have or too little of the picture is around it.
    pub fn deviations(&self, score: impl Fn(usize) -> f64) -> Option<f64> {
        let size = self.crown.size;
        let middle = self.middle()?;
        let mut sectors = [[Differences::default(); 2]; SECTORS];
        let mut has_leaves = [false; SECTORS];
        let step = (STEP * f64::from(size.width)).round().max(1.0) as usize;
        let width = size.width as usize;
        for v in (0..size.height as usize).step_by(step) {
            for u in (0..width).step_by(step) {
                let pixel = v * width + u;
                let is_within = self.crown.mask[pixel] != 0;
                if is_within || self.is_beside(pixel) {
                    let sector = sector_of(Point2::new(u as f64, v as f64) - middle);
                    sectors[sector][usize::from(is_within)].add(score(pixel));
                    has_leaves[sector] |= is_within && self.leaves[pixel] != 0;
                }
            }
        }
        let mut all = Differences::default();
        for ([around, within], has_leaves) in sectors.iter().zip(has_leaves) {
            if around.count > 0 && has_leaves {
                all.add(within.mean() - around.mean());
            }
        }
        (all.count >= LEAST_SECTORS).then(|| all.deviations())
    }

    /// `None` of nothing.
    fn middle(&self) -> Option<Point2<f64>> {
        let width = self.crown.size.width as usize;
        let (mut sum, mut count) = (Vector2::zeros(), 0.0);
        for (i, _) in self.crown.mask.iter().enumerate().filter(|(_, m)| **m != 0) {
            sum += Vector2::new((i % width) as f64, (i / width) as f64);
            count += 1.0;
        }
        (count > 0.0).then(|| Point2::from(sum / count))
    }
}

/// The sector that a way from the middle leads into.
fn sector_of(way: Vector2<f64>) -> usize {
    let share = way.y.atan2(way.x) / std::f64::consts::TAU + 0.5;
    (share * SECTORS as f64) as usize % SECTORS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::seed_of_part;

    const SIZE: Size = Size {
        width: 300,
        height: 200,
    };

    /// Noise on light that grows to the right, and a limb 9 px wide at v = 100 that is darker.
    fn light(at: Point2<f64>) -> Option<f64> {
        let [u, v] = [at.x, at.y].map(f64::round);
        if !SIZE.contains(Point2::new(u, v)) {
            return None;
        }
        let noise = (seed_of_part(6, (u + 300.0 * v) as u64) % 100) as f64 / 50.0 - 1.0;
        let limb = if (v - 100.0).abs() < 5.0 { 2.0 } else { 0.0 };
        Some(0.02 * u + noise + limb)
    }

    fn line(from: [f64; 2], to: [f64; 2]) -> Stroke {
        [from, to].map(Point2::from).to_vec()
    }

    #[test]
    fn a_line_is_on_something_only_where_both_sides_differ() {
        let shown = vec![false; SIZE.area()];
        for (name, line, is_on) in [
            ("limb", line([20.0, 100.0], [280.0, 101.0]), true),
            ("beside it", line([20.0, 112.0], [280.0, 113.0]), false),
            ("across it", line([150.0, 20.0], [150.0, 180.0]), false),
            ("nothing", line([20.0, 40.0], [280.0, 60.0]), false),
        ] {
            let found = along(&line, SIZE, &shown, 1.0, light);
            let deviations = found.deviations.expect("in sight");
            assert_eq!(deviations > 5.0, is_on, "{name}: {found:?}");
            assert!(is_on || deviations < 4.0, "{name}: {found:?}");
            assert!(found.in_sight > 0.9, "{name}: {found:?}");
        }
    }

    #[test]
    fn what_is_hidden_says_nothing() {
        let hidden = vec![true; SIZE.area()];
        let found = along(
            &line([20.0, 100.0], [280.0, 100.0]),
            SIZE,
            &hidden,
            1.0,
            light,
        );
        assert_eq!((found.deviations, found.in_sight), (None, 0.0));
    }

    #[test]
    fn a_crown_differs_from_what_is_around_it_or_does_not() {
        let mut mask = Vec::with_capacity(SIZE.area());
        let mut off_px = Vec::with_capacity(SIZE.area());
        for i in 0..SIZE.area() {
            let from_middle = ((i % 300) as f64 - 150.0).hypot((i / 300) as f64 - 100.0);
            mask.push(if from_middle <= 60.0 { 255 } else { 0 });
            off_px.push((from_middle - 60.0).max(0.0) as f32);
        }
        let crown = Outline {
            size: SIZE,
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        };
        let around = Around {
            crown: &crown,
            leaves: &crown.mask,
            off_px: &off_px,
        };
        let slope = |i: usize| (i % 300) as f64 / 300.0 + (seed_of_part(7, i as u64) % 9) as f64;
        let like = around.deviations(slope).expect("around");
        assert!(like.abs() < 3.1, "{like}");
        let unlike = around.deviations(|i| slope(i) + f64::from(crown.mask[i]) / 255.0);
        assert!(unlike.is_some_and(|found| found > 5.0), "{unlike:?}");
    }
}
