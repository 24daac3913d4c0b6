//! Where the names of crowded places are written: none over another, those that come first nearest
//! to their place.

use crate::bounds::Bounds;
use crate::signal::segments_cross;
use nalgebra::{Point2, Vector2};

/// Widest digit, from the top of a digit to the line that it stands on, and what hangs below, as
/// shares of the letters' size.
const DIGIT: f64 = 0.7;
const RISE: f64 = 0.75;
const DROP: f64 = 0.08;
/// Room about a name.
const ROOM: f64 = 1.5;
/// How far from its place a name is tried, and in how many directions.
const RINGS: [f64; 9] = [6.0, 9.0, 15.0, 23.0, 33.0, 45.0, 60.0, 80.0, 105.0];
const DIRECTIONS: usize = 24;
/// Farther from its place than this a name needs a line that leads to it.
const NEAR: f64 = 8.0;
/// What a line under a name costs, what another place does, what a line that leads across another
/// one does, and what it costs not to go on in the branch's own direction: in units of distance.
const OVER_LINE: f64 = 9.0;
const OVER_PLACE: f64 = 25.0;
const ACROSS: f64 = 12.0;
const ASIDE: f64 = 4.0;
/// Half the size of the dot that marks a place.
const DOT: f64 = 4.0;

pub type Segment = [Point2<f64>; 2];

/// A name that is to be written.
pub struct Wanted {
    /// Its place, and where the branch that ends there comes from.
    pub at: Point2<f64>,
    pub from: Point2<f64>,
    pub letters: usize,
    /// Sizes of the letters: on a large screen, and on a small one if it is shown there.
    pub size: f64,
    pub size_on_small: Option<f64>,
    /// How far from its place it may be; beyond it is rather left out.
    pub farthest: f64,
}

/// Where a name is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// The middle of the line that its letters stand on.
    pub at: Point2<f64>,
    /// From its place to the name, if that is not near.
    pub leader: Option<Segment>,
}

/// Left, top, right and bottom.
type Frame = [f64; 4];

/// Finds a place for every name in turn; `None` where there is no room. `lines` are drawn as well,
/// in a drawing of a `size`.
pub fn placed(wanted: &[Wanted], lines: &[Segment], size: Vector2<f64>) -> Vec<Option<Placed>> {
    let mut drawing = Drawing {
        wanted,
        lines,
        size,
        placed: Vec::with_capacity(wanted.len()),
    };
    for want in wanted {
        let best = drawing.best(want);
        drawing.placed.push(best);
    }
    drawing.placed
}

/// What is drawn already: lines, and the first names, in the order of `wanted`.
struct Drawing<'a> {
    wanted: &'a [Wanted],
    lines: &'a [Segment],
    size: Vector2<f64>,
    placed: Vec<Option<Placed>>,
}

impl Drawing<'_> {
    /// The cheapest free place round its own; the first of equally cheap ones.
    fn best(&self, want: &Wanted) -> Option<Placed> {
        let way = want.at - want.from;
        let own = way.y.atan2(way.x);
        let mut best: Option<(f64, Placed)> = None;
        for ring in RINGS.into_iter().filter(|r| *r <= want.farthest) {
            for k in 0..DIRECTIONS {
                let turn = k as f64 * std::f64::consts::TAU / DIRECTIONS as f64;
                let p = candidate(want, ring, own + turn);
                if !self.is_free(want, &p) {
                    continue;
                }
                let cost = self.cost(want, &p, ring, turn);
                if best.is_none_or(|(least, _)| cost.total_cmp(&least).is_lt()) {
                    best = Some((cost, p));
                }
            }
        }
        best.map(|(_, p)| p)
    }

    /// Whether a name would lie inside the drawing and on no other name.
    fn is_free(&self, want: &Wanted, p: &Placed) -> bool {
        let inside = frames(want, p)
            .flatten()
            .all(|[l, t, r, b]| l >= 0.0 && t >= 0.0 && r <= self.size.x && b <= self.size.y);
        let mut others = self.wanted.iter().zip(&self.placed);
        inside && others.all(|(w, q)| q.is_none_or(|q| apart(want, p, w, &q)))
    }

    /// What a place costs, by its distance, what the name would lie on, what its leader would
    /// cross, and its turn from the branch's own direction.
    fn cost(&self, want: &Wanted, p: &Placed, ring: f64, turn: f64) -> f64 {
        let frame = frame(want, p, want.size);
        let under = self.lines.iter().filter(|l| cuts(&frame, l)).count();
        let dots = self
            .wanted
            .iter()
            .filter(|w| touches(&frame, &around(w.at)))
            .count();
        let leaders = self.placed.iter().flatten().filter_map(|q| q.leader);
        let across = leaders
            .filter(|l| p.leader.is_some_and(|own| segments_cross(&own, l)))
            .count();
        ring + OVER_LINE * under as f64
            + OVER_PLACE * dots as f64
            + ACROSS * across as f64
            + ASIDE * (1.0 - turn.cos())
    }
}

/// A name whose frame is `ring` away from its place.
fn candidate(want: &Wanted, ring: f64, direction: f64) -> Placed {
    let (sin, cos) = direction.sin_cos();
    let towards = Vector2::new(cos, sin);
    let half = Vector2::new(
        0.5 * width(want, want.size),
        0.5 * (RISE + DROP) * want.size,
    );
    // From the middle of a frame to its rim, that way.
    let rim = (half.x / cos.abs().max(1e-9)).min(half.y / sin.abs().max(1e-9));
    let middle = want.at + (ring + rim) * towards;
    let at = Point2::new(middle.x, middle.y + 0.5 * (RISE - DROP) * want.size);
    let leader = (ring > NEAR).then_some([want.at, want.at + (ring - ROOM) * towards]);
    Placed { at, leader }
}

fn width(want: &Wanted, size: f64) -> f64 {
    DIGIT * size * want.letters as f64
}

fn frame(want: &Wanted, p: &Placed, size: f64) -> Frame {
    let half = 0.5 * width(want, size) + ROOM;
    [
        p.at.x - half,
        p.at.y - RISE * size - ROOM,
        p.at.x + half,
        p.at.y + DROP * size + ROOM,
    ]
}

/// On a large screen and on a small one.
fn frames(want: &Wanted, p: &Placed) -> impl Iterator<Item = Option<Frame>> {
    [
        Some(frame(want, p, want.size)),
        want.size_on_small.map(|size| frame(want, p, size)),
    ]
    .into_iter()
}

/// Whether neither name lies on the other, nor on the line that leads to it, on any screen.
fn apart(a: &Wanted, p: &Placed, b: &Wanted, q: &Placed) -> bool {
    frames(a, p).zip(frames(b, q)).all(|(f, g)| {
        let Some((f, g)) = f.zip(g) else { return true };
        !touches(&f, &g)
            && q.leader.is_none_or(|l| !cuts(&f, &l))
            && p.leader.is_none_or(|l| !cuts(&g, &l))
    })
}

fn around(at: Point2<f64>) -> Frame {
    [at.x - DOT, at.y - DOT, at.x + DOT, at.y + DOT]
}

fn touches(a: &Frame, b: &Frame) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Whether a line passes through a frame (Liang and Barsky 1984).
fn cuts(frame: &Frame, [a, b]: &Segment) -> bool {
    let mut within = Bounds::new(0.0, 1.0);
    for c in 0..2 {
        let (lo, hi, d) = (frame[c] - a[c], frame[c + 2] - a[c], b[c] - a[c]);
        if d == 0.0 {
            if lo > 0.0 || hi < 0.0 {
                return false;
            }
            continue;
        }
        let (at_lo, at_hi) = (lo / d, hi / d);
        within = Bounds::new(
            within.lo.max(at_lo.min(at_hi)),
            within.hi.min(at_lo.max(at_hi)),
        );
    }
    !within.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(at: Point2<f64>, farthest: f64) -> Wanted {
        Wanted {
            at,
            from: Point2::new(at.x, at.y + 40.0),
            letters: 2,
            size: 15.0,
            size_on_small: Some(22.0),
            farthest,
        }
    }

    /// Thirty branches that end in a patch of 50 by 50, as in the crown of a tree in leaf.
    #[test]
    fn no_name_lies_on_another_however_crowded_it_is() {
        let all: Vec<Wanted> = (0..30)
            .map(|k| {
                let (x, y) = (f64::from(k * 37 % 50), f64::from(k * 23 % 50));
                wanted(Point2::new(300.0 + x, 150.0 + y), 110.0)
            })
            .collect();
        let lines: Vec<Segment> = all.iter().map(|w| [w.from, w.at]).collect();
        let found = placed(&all, &lines, Vector2::new(720.0, 405.0));
        assert!(found.iter().take(10).all(Option::is_some), "{found:?}");
        for (i, p) in found.iter().enumerate() {
            let Some(p) = p else { continue };
            assert!(
                frames(&all[i], p)
                    .flatten()
                    .all(|f| f[0] >= 0.0 && f[1] >= 0.0 && f[2] <= 720.0 && f[3] <= 405.0)
            );
            for (j, q) in found.iter().enumerate().skip(i + 1) {
                if let Some(q) = q {
                    assert!(
                        apart(&all[i], p, &all[j], q),
                        "{i} lies on {j}: {p:?} {q:?}"
                    );
                }
            }
            // The line leads from the place to the name, and ends before it.
            if let Some([a, b]) = p.leader {
                let frame = frame(&all[i], p, all[i].size + 1.0);
                assert!(a == all[i].at && touches(&frame, &around(b)), "{p:?}");
            }
        }
    }

    #[test]
    fn a_name_that_has_room_stands_at_its_place_and_one_that_has_none_is_left_out() {
        let large = Vector2::new(200.0, 200.0);
        let found = placed(&[wanted(Point2::new(100.0, 100.0), 30.0)], &[], large);
        assert!(
            found[0].is_some_and(|p| p.leader.is_none() && p.at.y < 100.0),
            "{found:?}"
        );
        let small = Vector2::new(12.0, 12.0);
        assert_eq!(
            placed(&[wanted(Point2::new(5.0, 5.0), 30.0)], &[], small),
            [None]
        );
        assert_eq!(
            placed(&[wanted(Point2::new(f64::NAN, 5.0), 30.0)], &[], large),
            [None]
        );
    }
}
