//! What hangs together as it is seen from above.
//!
//! Few points on a trunk leave gaps in each of its rings, but not at the same side in all of them.

use super::graph::{Graph, REACH};
use super::thin::Thinned;
use nalgebra::Point3;

/// The height of the lowest point; none is above all.
pub(super) fn bottom(points: &[Point3<f32>]) -> f32 {
    points.iter().map(|p| p.z).fold(f32::INFINITY, f32::min)
}

/// The points of each piece of those that `is_wanted` wants, all at one height; `cell` is their distance.
pub(super) fn pieces(
    points: &[Point3<f32>],
    cell: f32,
    is_wanted: impl Fn(&Point3<f32>) -> bool,
) -> Vec<Vec<u32>> {
    let mut wanted: Vec<u32> = (0..points.len() as u32).collect();
    wanted.retain(|p| is_wanted(&points[*p as usize]));
    let places = wanted.iter().map(|p| points[*p as usize]);
    let flat: Vec<Point3<f32>> = places.map(|at| Point3::new(at.x, at.y, 0.0)).collect();
    let thinned = Thinned::of(&flat, cell);
    let piece_of = Graph::new(&thinned.points, REACH * cell).pieces();
    let count = piece_of.iter().max().map_or(0, |piece| *piece as usize + 1);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (point, own) in wanted.iter().zip(&thinned.of_point) {
        members[piece_of[*own as usize] as usize].push(*point);
    }
    members
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torn_ring_is_one_piece_and_another_trunk_is_not() {
        let mut points = Vec::new();
        for k in 0..60_u8 {
            // Neighbours round the trunk lie far above each other.
            let angle = std::f32::consts::TAU * f32::from(k) / 60.0;
            let z = f32::from(k * 7 % 20) * 0.05;
            points.push(Point3::new(0.1 * angle.cos(), 0.1 * angle.sin(), z));
            points.push(Point3::new(0.5 + 0.1 * angle.cos(), 0.1 * angle.sin(), z));
        }
        points.push(Point3::new(0.25, 0.0, 3.0));
        let pieces = pieces(&points, 0.01, |at| at.z < 1.0);
        assert_eq!(pieces.len(), 2);
        assert!(pieces.iter().all(|piece| piece.len() == 60));
        assert!(pieces[0].iter().all(|p| p % 2 == pieces[0][0] % 2));
    }
}
