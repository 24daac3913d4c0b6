//! Forks, where level sets hold the points of two limbs until their barks part.
//!
//! By turns every point is given to the wood whose bark is nearest, and every place is moved to the
//! middle of the circle through its points: Lloyd's iteration (1982, "Least squares quantization in
//! PCM") with tubes in place of means.

use super::grid::Grid;
use super::paths::{self, Path};
use super::radius::{self, Detail};
use nalgebra::{Point3, Vector3};

/// Rounds after which lines move by less than the noise of a scan.
const ROUNDS: usize = 3;
/// A circle is believed if its radius is the one that its neighbours give the place, times or
/// divided by this.
const RADIUS_FACTOR: f64 = 1.35;
/// Bark is looked for as far from a point as the wood about it is thick, times this, and so many
/// cells more.
const REACH_RADII: f64 = 1.3;
const REACH_CELLS: f64 = 4.0;
/// Of two places of one path a point is of the nearer one: share of the way along it that counts.
const ALONG_SHARE: f64 = 0.1;

/// Sets joints, lines and the points of every place right by what lies on which bark; `cell` is the
/// distance of points, `stretch` that of places, `twig` the radius of tips, m.
pub(super) fn refine(
    paths: &mut [Path],
    points: &[Point3<f32>],
    detail: &Detail,
    cell: f64,
    stretch: f64,
    twig: f64,
) {
    for round in 0..ROUNDS {
        if round == 0 {
            paths::set_joints_and_straighten(paths);
        } else {
            paths::set_joints(paths);
        }
        paths::lead_from_bark(paths, stretch);
        radius::assign(paths, twig);
        share_points(paths, points, cell);
        radius::measure(paths, detail);
        drop_odd_circles(paths);
        paths::bridge_gaps(paths);
        paths::smooth(paths);
    }
    paths::set_joints(paths);
    paths::lead_from_bark(paths, stretch);
}

/// A short tube about a place.
struct Tube {
    path: u32,
    place: u32,
    at: Point3<f64>,
    along: Vector3<f64>,
    half_length: f64,
    radius: f64,
    /// Radius of the wood that the path leaves; 0 of the trunk.
    carrier: f64,
}

impl Tube {
    fn of(paths: &[Path], path: usize, place: usize) -> Self {
        let own = &paths[path];
        let at = own.places[place].at;
        let before = place.checked_sub(1).map_or(0.0, |k| own.apart(k, place));
        let after = own.apart(place, place + 1);
        Self {
            path: path as u32,
            place: place as u32,
            at,
            along: own.direction(place),
            half_length: 0.5 * before.max(after),
            radius: own.places[place].radius,
            carrier: own
                .on
                .map_or(0.0, |on| paths[on.path].places[on.place].radius),
        }
    }

    /// How far a point is from its bark, m.
    fn off(&self, point: &Point3<f64>) -> f64 {
        let way = point - self.at;
        let along = way.dot(&self.along).abs();
        let across = (way.norm_squared() - along * along).max(0.0).sqrt();
        let beyond = (along - self.half_length).max(0.0) + ALONG_SHARE * along;
        (across - self.radius).hypot(beyond)
    }
}

/// Gives each point of a path to the place whose bark is nearest.
fn share_points(paths: &mut [Path], points: &[Point3<f32>], cell: f64) {
    let mut tubes: Vec<Tube> = Vec::new();
    for (i, path) in paths.iter().enumerate() {
        tubes.extend((0..path.places.len()).map(|k| Tube::of(paths, i, k)));
    }
    let middles: Vec<Point3<f32>> = tubes.iter().map(|t| t.at.cast()).collect();
    let grid = Grid::new(&middles, (8.0 * cell) as f32);
    let mut held: Vec<Vec<u32>> = Vec::with_capacity(tubes.len());
    for path in paths.iter_mut() {
        held.extend(
            path.places
                .iter_mut()
                .map(|p| std::mem::take(&mut p.points)),
        );
    }
    for (own, members) in tubes.iter().zip(held) {
        let reach = REACH_RADII * own.radius.max(own.carrier) + REACH_CELLS * cell;
        for point in members {
            let at = &points[point as usize];
            let place: Point3<f64> = at.cast();
            let (mut best, mut least) = (own, own.off(&place));
            grid.within(at, reach as f32, |t, _| {
                let off = tubes[t as usize].off(&place);
                if off < least {
                    (best, least) = (&tubes[t as usize], off);
                }
            });
            let into = &mut paths[best.path as usize].places[best.place as usize];
            into.points.push(point);
        }
    }
}

/// Takes back circles that do not go with the wood below and above.
fn drop_odd_circles(paths: &mut [Path]) {
    for place in paths.iter_mut().flat_map(|p| &mut p.places) {
        let fits = 1.0 / RADIUS_FACTOR..=RADIUS_FACTOR;
        place.measured = place
            .measured
            .filter(|m| !m.is_circle || fits.contains(&(m.radius / place.radius)));
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CloudNode, CloudOptions, tree_of_cloud};
    use super::*;
    use crate::model::PointCloud;

    /// A limb that does not taper: its ends and its radius, m.
    struct Limb {
        from: Point3<f64>,
        to: Point3<f64>,
        radius: f64,
    }

    impl Limb {
        fn off(&self, at: &Point3<f64>) -> f64 {
            let way = self.to - self.from;
            let share = ((at - self.from).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
            (self.from + way * share - at).norm() - self.radius
        }

        /// Points on its bark, 1 cm apart.
        fn bark(&self) -> Vec<Point3<f64>> {
            let along = (self.to - self.from).normalize();
            let first = along.cross(&Vector3::y()).normalize();
            let second = along.cross(&first);
            let mut bark = Vec::new();
            let around = (std::f64::consts::TAU * self.radius / 0.01) as usize;
            for ring in 0..((self.to - self.from).norm() / 0.01) as usize {
                for k in 0..around {
                    let angle = std::f64::consts::TAU * k as f64 / around as f64;
                    let out = first * angle.cos() + second * angle.sin();
                    bark.push(self.from + along * (0.01 * ring as f64) + out * self.radius);
                }
            }
            bark
        }
    }

    fn off_tree(nodes: &[CloudNode], at: &Point3<f64>) -> f64 {
        let pieces = nodes.iter().filter_map(|n| {
            let limb = Limb {
                from: nodes[n.parent?].position,
                to: n.position,
                radius: n.radius,
            };
            Some(limb.off(at).abs())
        });
        pieces.fold(f64::INFINITY, f64::min)
    }

    /// Two limbs at 22 degrees, whose barks part half a metre above the fork: both keep their bark.
    #[test]
    fn limbs_of_a_steep_fork_lie_on_their_own_bark() {
        let limbs = [
            Limb {
                from: Point3::origin(),
                to: Point3::new(0.0, 0.0, 4.0),
                radius: 0.12,
            },
            Limb {
                from: Point3::new(0.0, 0.0, 1.0),
                to: Point3::new(1.0, 0.0, 3.5),
                radius: 0.1,
            },
        ];
        let mut cloud = PointCloud::default();
        for (own, other) in [(0, 1), (1, 0)] {
            let mut bark = limbs[own].bark();
            bark.retain(|at| limbs[other].off(at) > 0.0);
            bark.into_iter().for_each(|at| assert!(cloud.push(at)));
        }
        let tree = tree_of_cloud(&cloud, CloudOptions::default()).expect("a tree");
        let points = cloud.points.iter().map(|p| p.cast::<f64>());
        let near_fork: Vec<Point3<f64>> = points.filter(|p| (0.8..1.8).contains(&p.z)).collect();
        let on_bark = near_fork.iter().filter(|p| off_tree(&tree.nodes, p) < 0.01);
        let share = on_bark.count() as f64 / near_fork.len() as f64;
        assert!(share > 0.9, "{share}");
    }
}
