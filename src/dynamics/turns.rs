//! Which points a mode turns about one place: a branch.

use nalgebra::{Point2, Vector2};

/// A point has a turn if what it leaves of the point's motion is at most this share of its squares.
const MAX_LEFT: f64 = 0.3;
/// A motion smaller than this share of the largest says nothing.
const MIN_MOTION: f64 = 0.15;
/// Points closer than this share of how far all are apart do not tell a turn.
const MIN_APART: f64 = 0.05;

/// Points that turn about one place.
#[derive(Clone, Debug)]
pub(super) struct TurnedPoints {
    /// Indices, in order.
    pub points: Vec<usize>,
    /// Share of the squares of all points' motion that is in their turn.
    pub share: f64,
    /// The place, px.
    pub pivot_px: Point2<f64>,
    /// How far they turn, rad; of what `moved` is the root mean square of.
    pub angle: f64,
}

/// A field of small turns about one place: `shift + rate * (p turned by a right angle)`.
#[derive(Clone, Copy)]
struct Turn {
    rate: f64,
    shift: Vector2<f64>,
}

impl Turn {
    fn of_two(at: [Point2<f64>; 2], moved: [Vector2<f64>; 2]) -> Self {
        let arm = at[1] - at[0];
        let rate = across(&arm).dot(&(moved[1] - moved[0])) / arm.norm_squared();
        let shift =
            (moved[0] + moved[1]) / 2.0 - rate * across(&((at[0].coords + at[1].coords) / 2.0));
        Self { rate, shift }
    }

    fn fitted(at: &[Point2<f64>], moved: &[Vector2<f64>], points: &[usize]) -> Self {
        let n = points.len() as f64;
        let (mut middle, mut mean) = (Vector2::zeros(), Vector2::zeros());
        for &k in points {
            middle += at[k].coords / n;
            mean += moved[k] / n;
        }
        let (mut products, mut squares) = (0.0, 0.0);
        for &k in points {
            let arm = at[k].coords - middle;
            products += across(&arm).dot(&(moved[k] - mean));
            squares += arm.norm_squared();
        }
        let rate = products / squares.max(f64::MIN_POSITIVE);
        Self {
            rate,
            shift: mean - rate * across(&middle),
        }
    }

    /// Where nothing moves.
    fn pivot_px(&self) -> Point2<f64> {
        Point2::from(across(&self.shift) / self.rate)
    }

    fn at(&self, place: &Point2<f64>) -> Vector2<f64> {
        self.shift + self.rate * across(&place.coords)
    }
}

/// Turned by a right angle.
fn across(arm: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-arm.y, arm.x)
}

/// The points `at` whose displacements `moved` are one turn, so that it is as much of the motion as
/// can be; `None` where no two are.
pub(super) fn turned_points(at: &[Point2<f64>], moved: &[Vector2<f64>]) -> Option<TurnedPoints> {
    let largest = moved.iter().map(|m| m.norm_squared()).fold(0.0, f64::max);
    let least = MIN_MOTION * MIN_MOTION * largest;
    let clear: Vec<usize> = (0..at.len())
        .filter(|k| moved[*k].norm_squared() > least)
        .collect();
    let extent = extent(at);
    let mut best: (f64, Option<Turn>) = (0.0, None);
    for (i, &a) in clear.iter().enumerate() {
        for &b in &clear[..i] {
            if (at[a] - at[b]).norm() < MIN_APART * extent {
                continue;
            }
            let turn = Turn::of_two([at[a], at[b]], [moved[a], moved[b]]);
            let explained = explained(&turn, at, moved, &clear);
            if explained > best.0 {
                best = (explained, Some(turn));
            }
        }
    }
    let mut turn = best.1?;
    let mut points = having(&turn, at, moved, &clear);
    for _ in 0..3 {
        turn = Turn::fitted(at, moved, &points);
        points = having(&turn, at, moved, &clear);
        if points.len() < 2 {
            return None;
        }
    }
    let all: f64 = moved.iter().map(|m| m.norm_squared()).sum();
    let share = explained(&turn, at, moved, &points) / all.max(f64::MIN_POSITIVE);
    Some(TurnedPoints {
        points,
        share,
        pivot_px: turn.pivot_px(),
        angle: turn.rate.abs(),
    })
}

fn extent(at: &[Point2<f64>]) -> f64 {
    let Some(first) = at.first() else { return 0.0 };
    let (mut lo, mut hi) = (*first, *first);
    for p in at {
        lo = lo.inf(p);
        hi = hi.sup(p);
    }
    (hi - lo).norm()
}

fn having(turn: &Turn, at: &[Point2<f64>], moved: &[Vector2<f64>], among: &[usize]) -> Vec<usize> {
    let has = |k: &usize| {
        let left = (moved[*k] - turn.at(&at[*k])).norm_squared();
        left < MAX_LEFT * moved[*k].norm_squared()
    };
    among.iter().copied().filter(has).collect()
}

fn explained(turn: &Turn, at: &[Point2<f64>], moved: &[Vector2<f64>], among: &[usize]) -> f64 {
    let mut sum = 0.0;
    for &k in among {
        let all = moved[k].norm_squared();
        let left = (moved[k] - turn.at(&at[k])).norm_squared();
        if left < MAX_LEFT * all {
            sum += all - left;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten points of a branch that turns by 0.05 rad, and six of one that moves another way.
    #[test]
    fn the_points_of_one_branch_are_found_among_others() {
        let pivot_px = Point2::new(100.0, 200.0);
        let (mut at, mut moved) = (Vec::new(), Vec::new());
        for k in 0..10 {
            let k = f64::from(k);
            let arm = Vector2::new(8.0 + 6.0 * k, -20.0 - 3.0 * k + 5.0 * (1.3 * k).sin());
            at.push(pivot_px + arm);
            let noise = Vector2::new((3.1 * k).sin(), (1.7 * k).cos());
            moved.push(0.05 * across(&arm) + 0.1 * noise);
        }
        for k in 0..6 {
            let k = f64::from(k);
            at.push(Point2::new(60.0 - 5.0 * k, 150.0 - 9.0 * k));
            moved.push(Vector2::new(-1.0 - 0.1 * k, 1.5));
        }
        let found = turned_points(&at, &moved).expect("a turn");
        assert_eq!(found.points, (0..10).collect::<Vec<_>>());
        assert!((found.angle - 0.05).abs() < 0.005, "{found:?}");
        assert!((found.pivot_px - pivot_px).norm() < 5.0, "{found:?}");
        assert!(found.share > 0.6 && found.share < 0.9, "{found:?}");
    }

    #[test]
    fn what_does_not_move_has_no_turn() {
        let at = [Point2::new(0.0, 0.0), Point2::new(9.0, 4.0)];
        assert!(turned_points(&at, &[Vector2::zeros(); 2]).is_none());
        assert!(turned_points(&[], &[]).is_none());
        // Two points at one place.
        let twice = [Point2::new(1.0, 1.0); 2];
        assert!(turned_points(&twice, &[Vector2::new(1.0, 0.0); 2]).is_none());
    }
}
