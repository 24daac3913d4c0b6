//! The pieces of wood in a table, each with the one that it grows from: rows of cylinders, and the
//! segments of a treefile. Their order does not matter.

use super::error::ImportError;
use super::model_tree::{Edges, MOST_PLACES, Wood};
use super::sketch::refuse_more;
use crate::model::{Excitation, Sway, SwayColumns};
use nalgebra::Point3;
use std::collections::BTreeMap;

/// Numbers up to here name pieces: greater ones are no whole numbers in a table of floats.
const LARGEST_ID: f64 = 9_007_199_254_740_992.0;

/// A piece of wood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub id: i64,
    /// The piece that it grows from; `None` on the ground.
    pub parent: Option<i64>,
    /// Where it begins if it stands on the ground; `None`: there is only the place where it ends.
    pub start: Option<Point3<f64>>,
    pub end: Point3<f64>,
    pub wood: Wood,
}

/// Places are no farther from the origin of the table than this, in its unit: coordinates of maps have up to 1e7
/// m, or 1e10 mm. No wood has so great a radius.
const FARTHEST: f64 = 1e11;
const THICKEST: f64 = 1e6;

/// As a share of the height of all, beyond the length and the thickness of a carrier.
const APART: f64 = 0.05;
/// No branch sways faster.
const FASTEST_HZ: f64 = 100.0;

/// Whether it swings at all: beyond 1 it creeps back.
fn is_damped(sway: &Sway) -> bool {
    sway.damping_ratio.is_none_or(|damping| damping.value < 1.0)
}

/// Whether its place and its radius may be those of a piece of a tree.
fn is_plausible(own: &Segment) -> bool {
    let places = own.start.iter().chain([&own.end]);
    let mut numbers = places.flat_map(|at| at.iter());
    numbers.all(|x| x.abs() < FARTHEST) && own.wood.radius < THICKEST
}

/// The number of a piece; `None` where it is none.
pub(super) fn id(cell: f64) -> Option<i64> {
    (cell.fract() == 0.0 && cell.abs() < LARGEST_ID).then_some(cell as i64)
}

/// What a table says of a piece: its radius, its sway by the columns of [`SwayColumns`], and whether nobody has seen
/// it (1). Tables do not say what made it sway, and it counts as wind. What is not known is no number, or nothing
/// above 0.
pub(super) fn wood(radius: f64, sway: [f64; 6], made_up: f64) -> Wood {
    let columns = SwayColumns::of_values(sway);
    let sway = columns.sway(Excitation::Wind, f64::NAN);
    let sway = sway.filter(|sway| sway.frequency_hz.value <= FASTEST_HZ && is_damped(sway));
    Wood {
        radius: if radius.is_finite() {
            radius.max(0.0)
        } else {
            0.0
        },
        sway,
        lacks_interval: sway.is_none() && columns.frequency_hz.is_finite(),
        begins_apart: false,
        is_made_up: made_up > 0.0,
    }
}

/// The middle lines of the pieces, each from the end of the one that it grows from: a branch begins
/// on its carrier's surface or along its way. What stands on the ground is the trunk; of several the
/// first.
///
/// # Errors
/// Two pieces have the same number, one grows from none of them, or they grow from one another in a
/// circle.
pub(super) fn edges(mut segments: Vec<Segment>) -> Result<Edges, ImportError> {
    refuse_more("pieces", segments.len(), MOST_PLACES / 2)?;
    if segments.is_empty() {
        return Err(ImportError::bad_format(
            "it has no row with a piece of wood",
        ));
    }
    if let Some(own) = segments.iter().find(|own| !is_plausible(own)) {
        return Err(ImportError::bad_format(format!(
            "piece {} has a place or a radius that no tree has",
            own.id
        )));
    }
    segments.sort_by_key(|s| s.id);
    let twice = segments.windows(2).find(|pair| pair[0].id == pair[1].id);
    if let Some([one, _]) = twice {
        return Err(ImportError::bad_format(format!(
            "two pieces in it have the number {}",
            one.id
        )));
    }
    let number_of: BTreeMap<i64, usize> = (0..).zip(&segments).map(|(i, s)| (s.id, i)).collect();
    let mut parents: Vec<Option<usize>> = Vec::with_capacity(segments.len());
    for own in &segments {
        let parent = own.parent.map(|parent| {
            let known = number_of.get(&parent).copied();
            known.ok_or_else(|| {
                let id = own.id;
                ImportError::bad_format(format!(
                    "piece {id} grows from {parent}, which is not in it"
                ))
            })
        });
        parents.push(parent.transpose()?);
    }
    if let Some(number) = in_circle(&parents) {
        let id = segments[number].id;
        return Err(ImportError::bad_format(format!(
            "piece {id} grows from itself by way of its parents"
        )));
    }
    let height = height(&segments);
    for number in 0..segments.len() {
        let parent = parents[number].map(|parent| segments[parent]);
        segments[number].wood.begins_apart =
            parent.is_some_and(|parent| is_apart(&segments[number], &parent, height));
    }
    Ok(joined(&segments, &parents))
}

/// Of all ends, y up.
fn height(segments: &[Segment]) -> f64 {
    let ends = segments.iter().map(|own| own.end.y);
    let highest = ends.clone().fold(f64::NEG_INFINITY, f64::max);
    highest - ends.fold(f64::INFINITY, f64::min)
}

/// Whether a piece begins elsewhere than on the one that it grows from, or near to that.
fn is_apart(own: &Segment, parent: &Segment, height: f64) -> bool {
    let Some(start) = own.start else {
        return false;
    };
    let length = parent.start.map_or(0.0, |from| (parent.end - from).norm());
    (start - parent.end).norm() > length + 2.0 * parent.wood.radius + APART * height
}

/// The edges of pieces that grow from those with these numbers.
fn joined(segments: &[Segment], parents: &[Option<usize>]) -> Edges {
    let mut file = Edges::default();
    let mut begins: Vec<Option<usize>> = Vec::with_capacity(segments.len());
    let mut ends: Vec<usize> = Vec::with_capacity(segments.len());
    for own in segments {
        begins.push(own.start.filter(|_| own.parent.is_none()).map(|start| {
            file.places.push(start);
            file.wood.push(Wood {
                radius: own.wood.radius,
                ..Wood::default()
            });
            file.places.len() - 1
        }));
        ends.push(file.places.len());
        file.places.push(own.end);
        file.wood.push(own.wood);
    }
    for (number, parent) in parents.iter().enumerate() {
        let end = ends[number];
        let begin = parent.map(|p| ends[p]).or(begins[number]);
        file.edges.extend(begin.map(|begin| [begin, end]));
        if parent.is_none() {
            file.foot = file.foot.or(begin).or(Some(end));
        }
    }
    file
}

/// A piece from which its parents lead back to it; `None` where there is none.
fn in_circle(parents: &[Option<usize>]) -> Option<usize> {
    // From which piece on each was come by first.
    let mut seen_from: Vec<Option<usize>> = vec![None; parents.len()];
    for first in 0..parents.len() {
        let mut at = Some(first);
        while let Some(own) = at {
            match seen_from[own] {
                Some(from) if from == first => return Some(own),
                Some(_) => break,
                None => seen_from[own] = Some(first),
            }
            at = parents[own];
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(id: i64, parent: Option<i64>, end: [f64; 3]) -> Segment {
        Segment {
            id,
            parent,
            start: Some(Point3::origin()),
            end: end.into(),
            wood: wood(0.1 * id as f64, [f64::NAN; 6], f64::NAN),
        }
    }

    fn fork() -> Vec<Segment> {
        vec![
            segment(1, None, [0.0, 1.0, 0.0]),
            segment(2, Some(1), [0.0, 2.0, 0.0]),
            segment(5, Some(2), [1.0, 3.0, 0.0]),
            segment(7, Some(2), [-1.0, 3.0, 0.0]),
        ]
    }

    #[test]
    fn the_order_of_rows_does_not_matter() {
        let in_order = edges(fork()).expect("sound");
        assert_eq!(in_order.edges, [[0, 1], [1, 2], [2, 3], [2, 4]]);
        assert_eq!(in_order.foot, Some(0));
        assert_eq!(in_order.wood[3].radius, 0.5);
        for order in [[3, 2, 1, 0], [2, 0, 3, 1], [1, 3, 0, 2]] {
            let segments = order.map(|i| fork()[i]).to_vec();
            assert_eq!(edges(segments).as_ref(), Ok(&in_order), "{order:?}");
        }
    }

    #[test]
    fn a_piece_that_begins_far_from_its_carrier_is_marked() {
        let mut segments = fork();
        for (own, start) in segments.iter_mut().zip([0.0, 1.0, 2.0, 1.2]) {
            own.start = Some(Point3::new(0.0, start, 0.0));
        }
        let sound = edges(segments.clone()).expect("sound");
        assert!(sound.wood.iter().all(|wood| !wood.begins_apart));
        segments[3].start = Some(Point3::new(-3.0, 3.0, 0.0));
        let marked = edges(segments).expect("sound");
        assert!(marked.wood[4].begins_apart && !marked.wood[3].begins_apart);
    }

    #[test]
    fn a_sway_that_no_branch_has_does_not_count() {
        let sound = wood(0.1, [1.5, 1.4, 1.6, 0.03, 0.02, 0.04], 0.0);
        assert!(sound.sway.is_some() && !sound.lacks_interval);
        for sway in [
            [1e9, 9e8, 2e9, 0.03, 0.02, 0.04],
            [1.5, 1.4, 1.6, 5.0, 4.0, 6.0],
        ] {
            let bad = wood(0.1, sway, 0.0);
            assert!(bad.sway.is_none() && bad.lacks_interval, "{sway:?}");
        }
    }

    #[test]
    fn parents_that_are_none_are_refused() {
        let mut circle = fork();
        circle[1].parent = Some(5);
        let mut unknown = fork();
        unknown[3].parent = Some(4);
        let mut twice = fork();
        twice[2].id = 2;
        let mut own = fork();
        own[0].parent = Some(1);
        for (bad, expected) in [
            (circle, "piece 2 grows from itself"),
            (unknown, "piece 7 grows from 4, which is not in it"),
            (twice, "two pieces in it have the number 2"),
            (own, "piece 1 grows from itself"),
        ] {
            let said = edges(bad).expect_err("no tree").to_string();
            assert!(said.contains(expected), "{said}");
        }
    }
}
