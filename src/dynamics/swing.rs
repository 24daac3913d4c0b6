//! How a mode swings a branch: what its points do about the branch's base, in the picture.

use super::film::Film;
use super::members::{Points, mean_px};
use super::signals::Factor;
use crate::signal::principal::{PrincipalComponents, symmetric};
use crate::signal::vectors::{add_scaled, dot};
use nalgebra::{Point2, Vector2};

/// Share of the mean lever that is more than a trace of a motion.
const MIN_LEVER: f64 = 0.3;

/// Places of a branch's points from its base, in the mean over time.
pub(super) struct Arms(Vec<Vector2<f64>>);

/// What one mode does to every point: factors of cosine and sine of u, then of v.
type Factors = [f64; 4];

impl Arms {
    pub fn new(film: &Film, points: &Points, base_px: Point2<f64>) -> Self {
        Self::at(
            points
                .tracks
                .iter()
                .map(|k| mean_px(&film.tracks[*k].at_px)),
            base_px,
        )
    }

    /// Of points at `at_px`.
    pub fn at(at_px: impl Iterator<Item = Point2<f64>>, base_px: Point2<f64>) -> Self {
        Self(at_px.map(|at| at - base_px).collect())
    }

    /// How much mode `m` of `factors` (of u and v of each point in turn) is one swing, 0 to 1: all
    /// points in one direction, as the length of the sum of their factors to the sum of the
    /// lengths; or a turn about the base, as its share of the squares; whichever is more. Points of
    /// several branches do neither.
    pub fn one_swing(&self, factors: &[Vec<Factor>], m: usize) -> f64 {
        let (mut sum, mut lengths, mut squares) = ([0.0; 4], 0.0, 0.0);
        for f in of(factors, m) {
            add_scaled(&mut sum, 1.0, &f);
            lengths += square(&f).sqrt();
            squares += square(&f);
        }
        if squares <= 0.0 {
            return 0.0;
        }
        let turn = self.turn(factors, m);
        let as_turn = if turn.squares > 0.0 {
            (turn.cosine * turn.cosine + turn.sine * turn.sine) / (turn.squares * squares)
        } else {
            0.0
        };
        as_turn.max(square(&sum).sqrt() / lengths)
    }

    /// The turn about the base that fits the mode's factors best, degrees.
    pub fn amplitude_deg(&self, factors: &[Vec<Factor>], m: usize) -> f64 {
        let turn = self.turn(factors, m);
        if turn.squares > 0.0 {
            (turn.cosine.hypot(turn.sine) / turn.squares).to_degrees()
        } else {
            f64::NAN
        }
    }

    fn turn(&self, factors: &[Vec<Factor>], m: usize) -> Turn {
        let mut turn = Turn::default();
        for (arm, f) in self.0.iter().zip(of(factors, m)) {
            turn.squares += arm.norm_squared();
            turn.cosine += f[0] * arm.y - f[2] * arm.x;
            turn.sine += f[1] * arm.y - f[3] * arm.x;
        }
        turn
    }
}

/// A turn about the base: its cosine and sine, times the squares of the arms.
#[derive(Default)]
struct Turn {
    cosine: f64,
    sine: f64,
    /// Sum of the squares of the arms, px².
    squares: f64,
}

/// How much signals are one motion, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct RankOne {
    /// Share of the squares that one motion in time makes, by a lever of each point's own.
    pub of_squares: f64,
    /// Share of the points that have more than a trace of it, all the same way.
    pub of_points: f64,
}

/// Of `signals` of u and v of each point in turn.
pub(super) fn rank_one_fraction(signals: &[Vec<f64>]) -> RankOne {
    let points: Vec<&[Vec<f64>]> = signals.chunks_exact(2).collect();
    let products = symmetric(points.len(), |a, b| {
        dot(&points[a][0], &points[b][0]) + dot(&points[a][1], &points[b][1])
    });
    let all = products.trace();
    if points.is_empty() || all <= 0.0 || !all.is_finite() {
        return RankOne::default();
    }
    let components = PrincipalComponents::of_products(products);
    let levers = &components.directions[0];
    let sign = levers.iter().sum::<f64>().signum();
    let least = MIN_LEVER / (points.len() as f64).sqrt();
    let have = levers.iter().filter(|l| **l * sign > least).count();
    RankOne {
        of_squares: components.variances[0] / all,
        of_points: have as f64 / points.len() as f64,
    }
}

fn of(factors: &[Vec<Factor>], m: usize) -> impl Iterator<Item = Factors> {
    factors.chunks_exact(2).map(move |uv| {
        [
            uv[0][m].cosine,
            uv[0][m].sine,
            uv[1][m].cosine,
            uv[1][m].sine,
        ]
    })
}

fn square(f: &Factors) -> f64 {
    f.iter().map(|x| x * x).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points at `arms` that are moved by so much to the right and down.
    fn one_swing(arms: &[Vector2<f64>], moved: &[Vector2<f64>]) -> f64 {
        let cosines = moved.iter().flatten();
        let factors: Vec<Vec<Factor>> = cosines.map(|x| vec![Factor::of(&[*x])]).collect();
        Arms(arms.to_vec()).one_swing(&factors, 0)
    }

    /// A crown on its trunk turns about the foot: to the right above it, down on its right, up on
    /// its left.
    #[test]
    fn a_turn_is_one_swing_however_the_points_lie_about_the_base() {
        let arms = [
            [0.0, -90.0],
            [60.0, -50.0],
            [-70.0, -40.0],
            [10.0, -120.0],
            [5.0, -10.0],
        ]
        .map(Vector2::from);
        let turned = arms.map(|arm| Vector2::new(-0.05 * arm.y, 0.05 * arm.x));
        assert!(one_swing(&arms, &turned) > 0.999);
    }

    /// A branch that swings towards the camera shows little but its arc, which is no turn in the
    /// picture.
    #[test]
    fn one_direction_is_one_swing_wherever_the_base_is() {
        let arms = [[40.0, 0.0], [60.0, 2.0], [80.0, -1.0], [100.0, 0.0]].map(Vector2::from);
        let moved = [[-1.0, 0.1], [-1.6, 0.0], [-2.0, -0.1], [-2.4, 0.2]].map(Vector2::from);
        assert!(one_swing(&arms, &moved) > 0.95);
    }

    #[test]
    fn points_of_two_branches_that_swing_apart_are_not_one() {
        let arms =
            [[40.0, -40.0], [60.0, -60.0], [-40.0, -40.0], [-60.0, -60.0]].map(Vector2::from);
        let apart = [[1.0, 1.0], [1.5, 1.5], [-1.0, 1.0], [-1.6, 1.5]].map(Vector2::from);
        assert!(one_swing(&arms, &apart) < 0.8);
        assert_eq!(one_swing(&arms, &[Vector2::zeros(); 4]), 0.0);
    }

    /// Four points with levers of 1 to 4, and half of that to the side.
    fn branch(rates: [f64; 2]) -> Vec<Vec<f64>> {
        let mut out = Vec::new();
        for lever in 1..=4 {
            for (rate, share) in rates.into_iter().zip([1.0_f64, 0.5]) {
                let size = share * f64::from(lever);
                let times = (0..600).map(|k| 0.1 * f64::from(k));
                out.push(times.map(|t| size * (rate * t).sin()).collect());
            }
        }
        out
    }

    /// In wind a branch swings both ways at once: its points go along with it, each as far as it is
    /// from the base.
    #[test]
    fn points_that_move_alike_in_time_are_one_swing_and_those_of_two_branches_are_not() {
        let one = rank_one_fraction(&branch([1.0, 1.37]));
        assert!(one.of_squares > 0.999 && one.of_points >= 0.75, "{one:?}");
        let two = rank_one_fraction(&[branch([1.0, 1.37]), branch([1.71, 0.83])].concat());
        assert!(two.of_squares < 0.7 && two.of_points < 0.75, "{two:?}");
        assert_eq!(rank_one_fraction(&[]), RankOne::default());
    }
}
