//! Points that are not seen are carried along by those around them that are.

use super::neighbours::NEIGHBOURS;
use super::point::Point;
use crate::model::TrackId;
use crate::signal::{Fit, Witness, local_affine};
use nalgebra::Point2;

/// How the surroundings of each point have moved, by the places that its neighbours have now; of
/// every point that is hidden or in its turn in frame number `frame`, see [`Point::in_turn`].
/// `points` are ordered by id.
pub fn neighbour_fits(points: &[Point], every: u32, frame: u64) -> Vec<Option<Fit>> {
    let seen = Seen::of(points);
    let mut fits = Vec::with_capacity(points.len());
    let mut witnesses: Vec<Witness> = Vec::with_capacity(NEIGHBOURS);
    for p in points {
        if p.coasting == 0 && !p.in_turn(every, frame) {
            fits.push(None);
            continue;
        }
        witnesses.clear();
        let of_neighbours = p.neighbours.iter();
        witnesses.extend(
            of_neighbours
                .filter_map(|(id, then_px)| seen.witness(*id, *then_px, p.born_px))
                .take(NEIGHBOURS),
        );
        fits.push(local_affine(&witnesses));
    }
    fits
}

/// Moves the points that are not seen with those around them that are.
pub fn carry_hidden(points: &mut [Point], fits: &[Option<Fit>]) {
    for (p, fit) in points.iter_mut().zip(fits) {
        if let (true, Some(fit)) = (p.coasting > 0, fit) {
            p.now_px = p.predicted_px(fit);
        }
    }
}

/// What is needed of the points that are seen, apart from the points themselves: those are large,
/// and each is looked up two dozen times.
struct Seen {
    ids: Vec<TrackId>,
    /// Place, px, and weight of each; `None` for one that is hidden.
    states: Vec<Option<(Point2<f32>, f64)>>,
}

impl Seen {
    fn of(points: &[Point]) -> Self {
        Self {
            ids: points.iter().map(|p| p.id).collect(),
            states: points
                .iter()
                .map(|p| (p.coasting == 0).then(|| (p.now_px, p.weight())))
                .collect(),
        }
    }

    /// What the neighbour `id` says, which was at `then_px` when the point was born at `born_px`;
    /// `None` if it is not seen.
    fn witness(&self, id: TrackId, then_px: Point2<f32>, born_px: Point2<f32>) -> Option<Witness> {
        let (now_px, weight) = self.states[self.ids.binary_search(&id).ok()?]?;
        Some(Witness {
            offset: (then_px - born_px).map(f64::from),
            displacement: (now_px - then_px).map(f64::from),
            weight,
        })
    }
}
