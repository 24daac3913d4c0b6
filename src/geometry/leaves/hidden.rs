//! Leaves that the picture does not show, so that the crown is as full from the side as from the
//! front.

use super::attachment::AttachmentPoint;
use nalgebra::Point3;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// The places that `may` bear leaves, `count` of them (some more than once), each time one where
/// the crown is emptiest: in the cube of side `side` px that holds the fewest of `leaves` and of
/// those before it.
pub(super) fn emptiest(
    attachments: &[AttachmentPoint],
    may: impl Fn(&AttachmentPoint) -> bool,
    leaves: &[Point3<f64>],
    side: f64,
    count: usize,
) -> Vec<usize> {
    let mut cubes: BTreeMap<[i64; 3], (usize, Vec<usize>)> = BTreeMap::new();
    for (i, attachment) in attachments.iter().enumerate().filter(|(_, p)| may(p)) {
        cubes
            .entry(cube(&attachment.at, side))
            .or_default()
            .1
            .push(i);
    }
    for leaf in leaves {
        if let Some((held, _)) = cubes.get_mut(&cube(leaf, side)) {
            *held += 1;
        }
    }
    let mut heap: BinaryHeap<_> = cubes
        .values()
        .enumerate()
        .map(|(k, (held, at))| Reverse((*held, fibonacci_hash(k), 0usize, at)))
        .collect();
    let mut out = Vec::with_capacity(count);
    while let Some(Reverse((held, order, used, at))) = heap.pop().filter(|_| out.len() < count) {
        // About every third place of a cube, so that neighbours on a twig do not follow each other.
        let step = (at.len() / 3).max(1) | 1;
        out.push(at[used * step % at.len()]);
        heap.push(Reverse((held + 1, order, used + 1, at)));
    }
    out
}

/// The cube of side `side` that holds a place.
fn cube(place: &Point3<f64>, side: f64) -> [i64; 3] {
    [place.x, place.y, place.z].map(|x| (x / side.max(1e-9)).floor() as i64)
}

/// Breaks ties between equally empty cubes in an order that goes all over the tree, not along an
/// axis: multiplication by 2^64 over the golden ratio (Knuth, vol. 3, sect. 6.4).
fn fibonacci_hash(k: usize) -> u64 {
    (k as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
}
