//! How far the attractors on the envelope are from the tree: the sum of eq. 5, fast.

use crate::model::Skeleton;
use nalgebra::{Point3, Vector3};

/// By how much two distances in single precision may differ though they are the same, px.
const ROUNDING_PX: f32 = 0.01;

/// The attractors, the nodes, and which node each attractor is nearest to, in single precision and
/// coordinate by coordinate, which the compiler turns into vector instructions: nearly all of the
/// push's time goes into this.
pub(super) struct Search {
    attractors: Places,
    nodes: Places,
    nearest: Nearest,
}

/// Points in space, px.
struct Places {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

/// For each attractor the node that is nearest to it, and the square of the distance, px².
#[derive(Clone)]
struct Nearest {
    squared: Vec<f32>,
    node: Vec<u32>,
}

/// The tree without the nodes that are to be moved, and where along their way these may come nearer to
/// an attractor than the rest of the tree.
pub(super) struct Swept {
    rest: Nearest,
    /// Of the attractors that no moved node comes nearer to, px.
    rest_distance: f64,
    /// The other attractors, and their squared distances to the rest.
    within_reach: Places,
    rest_squared: Vec<f32>,
    /// For each moved node where it stands, and the attractors that it may come nearer to: places in
    /// `within_reach`.
    moved: Vec<Reach>,
}

/// What one moved node may come near to.
struct Reach {
    stands: Vector3<f32>,
    attractors: Vec<u32>,
}

impl Places {
    fn of(points: impl ExactSizeIterator<Item = Point3<f64>>) -> Self {
        let n = points.len();
        let [x, y, z] = [(); 3].map(|()| Vec::with_capacity(n));
        let mut places = Self { x, y, z };
        for point in points {
            places.push(point.coords.cast());
        }
        places
    }

    fn len(&self) -> usize {
        self.x.len()
    }

    fn push(&mut self, place: Vector3<f32>) {
        self.x.push(place.x);
        self.y.push(place.y);
        self.z.push(place.z);
    }

    fn get(&self, k: usize) -> Vector3<f32> {
        Vector3::new(self.x[k], self.y[k], self.z[k])
    }

    fn set(&mut self, k: usize, place: Vector3<f32>) {
        (self.x[k], self.y[k], self.z[k]) = (place.x, place.y, place.z);
    }

    /// All of them, in turn.
    fn iter(&self) -> impl Iterator<Item = Vector3<f32>> {
        let places = self.x.iter().zip(&self.y).zip(&self.z);
        places.map(|((x, y), z)| Vector3::new(*x, *y, *z))
    }
}

impl Nearest {
    /// With one more node.
    fn add(&mut self, attractors: &Places, node: u32, place: Vector3<f32>) {
        let so_far = self.squared.iter_mut().zip(&mut self.node);
        for ((squared, nearest), attractor) in so_far.zip(attractors.iter()) {
            let new = (attractor - place).norm_squared();
            *nearest = if new < *squared { node } else { *nearest };
            *squared = squared.min(new);
        }
    }
}

impl Search {
    pub fn new(skeleton: &Skeleton, attractors: &[Point3<f64>]) -> Self {
        let attractors = Places::of(attractors.iter().copied());
        let nodes = Places::of(skeleton.nodes.iter().map(|n| n.position));
        let mut nearest = Nearest {
            squared: vec![f32::INFINITY; attractors.len()],
            node: vec![0; attractors.len()],
        };
        for (k, place) in nodes.iter().enumerate() {
            nearest.add(&attractors, k as u32, place);
        }
        Self {
            attractors,
            nodes,
            nearest,
        }
    }

    /// The nodes `subtree` taken out of the tree, to be moved by between `least` and `most` px along
    /// `normal`, of length 1.
    pub fn sweep(&self, subtree: &[usize], normal: &Vector3<f64>, least: f64, most: f64) -> Swept {
        let rest = self.without(subtree);
        let normal: Vector3<f32> = normal.cast();
        let [least, most] = [least, most].map(|px| px as f32);
        let mut place_of = vec![u32::MAX; self.attractors.len()];
        let mut swept = Swept {
            rest_distance: 0.0,
            within_reach: Places::of([].into_iter()),
            rest_squared: Vec::new(),
            moved: Vec::with_capacity(subtree.len()),
            rest,
        };
        let mut is_near = vec![false; self.attractors.len()];
        for &k in subtree {
            let stands = self.nodes.get(k);
            self.look_along(stands, normal, [least, most], &swept.rest, &mut is_near);
            let mut attractors = Vec::new();
            for a in (0..is_near.len()).filter(|a| is_near[*a]) {
                if place_of[a] == u32::MAX {
                    place_of[a] = swept.within_reach.len() as u32;
                    swept.within_reach.push(self.attractors.get(a));
                    swept.rest_squared.push(swept.rest.squared[a]);
                }
                attractors.push(place_of[a]);
            }
            swept.moved.push(Reach { stands, attractors });
        }
        for (squared, place) in swept.rest.squared.iter().zip(place_of) {
            if place == u32::MAX {
                swept.rest_distance += f64::from(squared.sqrt());
            }
        }
        swept
    }

    /// For each attractor whether a node that moves from `stands` along `normal` between the bounds of
    /// `range` may come nearer to it than the rest of the tree is.
    fn look_along(
        &self,
        stands: Vector3<f32>,
        normal: Vector3<f32>,
        range: [f32; 2],
        rest: &Nearest,
        is_near: &mut [bool],
    ) {
        let [least, most] = range;
        let found = is_near.iter_mut().zip(&rest.squared);
        for ((is_near, rest), attractor) in found.zip(self.attractors.iter()) {
            let to = attractor - stands;
            let along = to.dot(&normal).max(least).min(most);
            let squared = (to - normal * along).norm_squared();
            let bound = rest.sqrt() + ROUNDING_PX;
            *is_near = squared < bound * bound;
        }
    }

    /// The tree without the nodes of `subtree`: attractors that one of them is nearest to look for
    /// another.
    fn without(&self, subtree: &[usize]) -> Nearest {
        let mut is_inside = vec![false; self.nodes.len()];
        for &k in subtree {
            is_inside[k] = true;
        }
        let mut rest = self.nearest.clone();
        for a in 0..rest.node.len() {
            if !is_inside[rest.node[a] as usize] {
                continue;
            }
            let attractor = self.attractors.get(a);
            (rest.squared[a], rest.node[a]) = (f32::INFINITY, 0);
            for (k, place) in self.nodes.iter().enumerate() {
                let squared = (attractor - place).norm_squared();
                if squared < rest.squared[a] && !is_inside[k] {
                    (rest.squared[a], rest.node[a]) = (squared, k as u32);
                }
            }
        }
        rest
    }

    /// Takes the nodes of `subtree` in again, where they are now.
    pub fn put_back(&mut self, swept: Swept, skeleton: &Skeleton, subtree: &[usize]) {
        self.nearest = swept.rest;
        for &k in subtree {
            let place = skeleton.nodes[k].position.coords.cast();
            self.nodes.set(k, place);
            self.nearest.add(&self.attractors, k as u32, place);
        }
    }
}

impl Swept {
    /// D of eq. 5 with the nodes moved by `offset`, px.
    pub fn total_distance(&self, offset: Vector3<f64>) -> f64 {
        let offset: Vector3<f32> = offset.cast();
        let mut squared = self.rest_squared.clone();
        for Reach { stands, attractors } in &self.moved {
            let place = stands + offset;
            for &a in attractors {
                let a = a as usize;
                let new = (self.within_reach.get(a) - place).norm_squared();
                squared[a] = squared[a].min(new);
            }
        }
        let reached: f64 = squared.iter().map(|d| f64::from(d.sqrt())).sum();
        self.rest_distance + reached
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Node;
    use crate::random::{Generator, generator};
    use rand::RngExt;

    fn place(random: &mut Generator) -> [f64; 3] {
        std::array::from_fn(|_| random.random_range(-100.0..100.0))
    }

    /// D of eq. 5 as it is written.
    fn distance(skeleton: &Skeleton, attractors: &[Point3<f64>]) -> f64 {
        let nodes = &skeleton.nodes;
        let nearest = |a: &Point3<f64>| {
            let ways = nodes.iter().map(|n| (n.position - a).norm());
            ways.fold(f64::INFINITY, f64::min)
        };
        attractors.iter().map(nearest).sum()
    }

    #[test]
    fn what_moves_is_as_far_from_the_attractors_as_eq_5_says() {
        let mut random = generator(7, 0);
        let attractors: Vec<Point3<f64>> = (0..200).map(|_| place(&mut random).into()).collect();
        let mut skeleton = Skeleton::forked();
        for k in 4..60 {
            let node = Node::made_up(10 + k, Some(0), place(&mut random));
            skeleton.nodes.push(node);
        }
        let mut search = Search::new(&skeleton, &attractors);
        for _ in 0..40 {
            let first = random.random_range(0..50);
            let subtree: Vec<usize> = (first..first + random.random_range(1..10)).collect();
            let normal = Vector3::from(place(&mut random)).normalize();
            let (least, most) = (-30.0, random.random_range(0.0..60.0));
            let swept = search.sweep(&subtree, &normal, least, most);
            let mut moved_px = 0.0;
            for share in [0.0, 0.3, 0.7, 1.0] {
                let to_px = least + share * (most - least);
                for &k in &subtree {
                    skeleton.nodes[k].position += normal * (to_px - moved_px);
                }
                moved_px = to_px;
                let found = swept.total_distance(normal * to_px);
                let known = distance(&skeleton, &attractors);
                assert!((found - known).abs() < 1e-6 * known, "{found}, {known}");
            }
            search.put_back(swept, &skeleton, &subtree);
        }
    }
}
