//! Which points lie on the same wood, and how far along it they are from the foot.

use super::grid::Grid;
use nalgebra::Point3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Way over which a gap is led, against its length: wood that was seen is preferred.
const GAP_COST: f32 = 2.0;

/// Points are neighbours up to so many times the distance of points about there.
pub(super) const REACH: f32 = 1.8;

/// Points joined to those near them.
#[derive(Clone, Debug)]
pub(super) struct Graph {
    /// Where the edges of each point begin in `ends`, and the end.
    starts: Vec<u32>,
    ends: Vec<Edge>,
}

/// From a point to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Edge {
    pub to: u32,
    pub way: f32,
}

/// The way of every point to the foot.
#[derive(Clone, Debug)]
pub(super) struct Ways {
    /// Length; infinite where there is none.
    pub length: Vec<f32>,
    /// The next point on the way; itself at the foot, and where there is none.
    pub before: Vec<u32>,
}

impl Ways {
    /// All points, those with the shortest way first.
    fn nearest_first(&self) -> Vec<u32> {
        let mut order: Vec<u32> = (0..self.length.len() as u32).collect();
        order
            .sort_unstable_by(|a, b| self.length[*a as usize].total_cmp(&self.length[*b as usize]));
        order
    }

    /// The point of the foot that a point's way leads to.
    pub fn first(&self, mut point: u32) -> u32 {
        while self.before[point as usize] != point {
            point = self.before[point as usize];
        }
        point
    }

    /// Gives each point that has none (`u32::MAX`) the number of the next on its way.
    pub fn spread(&self, mut number: Vec<u32>) -> Vec<u32> {
        for point in self.nearest_first() {
            if number[point as usize] == u32::MAX {
                number[point as usize] = number[self.before[point as usize] as usize];
            }
        }
        number
    }

    /// How many points' ways lead over each point, its own one not counted.
    pub fn points_above(&self) -> Vec<u32> {
        let mut above = vec![0; self.length.len()];
        for point in self.nearest_first().into_iter().rev() {
            let before = self.before[point as usize];
            if before != point {
                above[before as usize] += above[point as usize] + 1;
            }
        }
        above
    }
}

impl Graph {
    /// Joins all points nearer to each other than `reach`.
    pub fn new(points: &[Point3<f32>], reach: f32) -> Self {
        Self::of_reaches(points, &vec![reach; points.len()])
    }

    /// Joins all points nearer to each other than the smaller of their two reaches.
    pub fn of_reaches(points: &[Point3<f32>], reaches: &[f32]) -> Self {
        let least = reaches.iter().copied().fold(f32::INFINITY, f32::min);
        let grid = Grid::new(points, least.min(f32::MAX));
        let mut graph = Self {
            starts: Vec::with_capacity(points.len() + 1),
            ends: Vec::new(),
        };
        for (i, at) in (0..).zip(points) {
            graph.starts.push(graph.ends.len() as u32);
            let reach = reaches[i as usize];
            grid.within(at, reach, |to, square| {
                if to != i && square < reaches[to as usize].powi(2) {
                    graph.ends.push(Edge {
                        to,
                        way: square.sqrt(),
                    });
                }
            });
        }
        graph.starts.push(graph.ends.len() as u32);
        graph
    }

    /// The same with gaps of up to `widest` between what hangs together bridged at their narrowest,
    /// the narrowest first (Boruvka's tree of pieces). Gaps are wider than `reach`.
    pub fn bridged(self, points: &[Point3<f32>], reach: f32, widest: f32) -> Self {
        let grid = Grid::new(points, reach);
        let bridges = bridges(points, &grid, &self.pieces(), widest);
        self.with(&bridges)
    }

    /// Of so many points and these edges, each from the point that it stands beside.
    pub fn of_edges(points: usize, edges: &[(u32, Edge)]) -> Self {
        let mut sorted = edges.to_vec();
        sorted.sort_by_key(|(from, edge)| (*from, edge.to));
        let mut graph = Self {
            starts: Vec::with_capacity(points + 1),
            ends: sorted.iter().map(|(_, edge)| *edge).collect(),
        };
        for point in 0..=points {
            graph
                .starts
                .push(sorted.partition_point(|(from, _)| (*from as usize) < point) as u32);
        }
        graph
    }

    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    pub fn edges(&self, point: u32) -> &[Edge] {
        &self.ends[self.starts[point as usize] as usize..self.starts[point as usize + 1] as usize]
    }

    /// The number of the piece that each point is in, from 0.
    pub fn pieces(&self) -> Vec<u32> {
        self.pieces_where(|_, _| true)
    }

    /// The same where only edges count that `holds` says hold.
    pub fn pieces_where(&self, holds: impl Fn(u32, u32) -> bool) -> Vec<u32> {
        let mut piece = vec![u32::MAX; self.len()];
        let mut next = 0;
        let mut stack = Vec::new();
        for start in 0..self.len() as u32 {
            if piece[start as usize] != u32::MAX {
                continue;
            }
            piece[start as usize] = next;
            stack.push(start);
            while let Some(point) = stack.pop() {
                for edge in self.edges(point) {
                    if piece[edge.to as usize] == u32::MAX && holds(point, edge.to) {
                        piece[edge.to as usize] = next;
                        stack.push(edge.to);
                    }
                }
            }
            next += 1;
        }
        piece
    }

    /// The shortest ways to the nearest of these points (Dijkstra 1959).
    pub fn shortest_ways(&self, foot: &[u32]) -> Ways {
        let mut ways = Ways {
            length: vec![f32::INFINITY; self.len()],
            before: (0..self.len() as u32).collect(),
        };
        let mut queue = BinaryHeap::new();
        for point in foot {
            ways.length[*point as usize] = 0.0;
            queue.push(Reached {
                way: 0.0,
                point: *point,
            });
        }
        while let Some(Reached { way, point }) = queue.pop() {
            if way > ways.length[point as usize] {
                continue;
            }
            for edge in self.edges(point) {
                let longer = way + edge.way;
                if longer < ways.length[edge.to as usize] {
                    ways.length[edge.to as usize] = longer;
                    ways.before[edge.to as usize] = point;
                    queue.push(Reached {
                        way: longer,
                        point: edge.to,
                    });
                }
            }
        }
        ways
    }

    /// The same with further edges, to both sides.
    fn with(self, more: &[Bridge]) -> Self {
        let mut of_point: Vec<Vec<Edge>> = vec![Vec::new(); self.len()];
        for bridge in more {
            let way = GAP_COST * bridge.width;
            of_point[bridge.from as usize].push(Edge { to: bridge.to, way });
            of_point[bridge.to as usize].push(Edge {
                to: bridge.from,
                way,
            });
        }
        let mut all = Self {
            starts: Vec::with_capacity(self.starts.len()),
            ends: Vec::with_capacity(self.ends.len() + 2 * more.len()),
        };
        for (point, further) in (0..).zip(&of_point) {
            all.starts.push(all.ends.len() as u32);
            all.ends.extend(self.edges(point));
            all.ends.extend(further);
        }
        all.starts.push(all.ends.len() as u32);
        all
    }
}

/// A gap between two pieces.
#[derive(Clone, Copy, Debug)]
struct Bridge {
    from: u32,
    to: u32,
    width: f32,
}

/// Pieces with so large a share of the points of the largest one wait as it does, until no smaller one
/// finds a bridge: a search about each of their points takes long.
const WAITING_SHARE: f64 = 0.1;

/// The bridges that join all pieces which are no farther from another one than `widest`.
fn bridges(points: &[Point3<f32>], grid: &Grid, pieces: &[u32], widest: f32) -> Vec<Bridge> {
    let mut piece = pieces.to_vec();
    // What has nothing else so near never will: a search about each of its points takes long.
    let mut is_alone = vec![false; points.len()];
    let mut all = Vec::new();
    let mut share = WAITING_SHARE;
    loop {
        let count = piece.iter().max().map_or(0, |m| *m as usize + 1);
        let mut size = vec![0_usize; count];
        piece.iter().for_each(|p| size[*p as usize] += 1);
        // The largest waits for the others to come.
        let largest = (0..count).max_by_key(|p| (size[*p], std::cmp::Reverse(*p)));
        let most = largest.map_or(0, |l| size[l]) as f64;
        let mut waits: Vec<bool> = size.iter().map(|n| *n as f64 >= share * most).collect();
        if let Some(largest) = largest {
            waits[largest] = true;
        }
        let mut best: Vec<Option<Bridge>> = vec![None; count];
        for (i, at) in (0..).zip(points) {
            let own = piece[i as usize];
            if is_alone[i as usize] || waits[own as usize] {
                continue;
            }
            let most = best[own as usize].map_or(widest, |b: Bridge| b.width);
            if let Some(near) = grid.nearest(at, most, |j| piece[j as usize] != own)
                && near.distance < most
            {
                best[own as usize] = Some(Bridge {
                    from: i,
                    to: near.point,
                    width: near.distance,
                });
            }
        }
        for (alone, own) in is_alone.iter_mut().zip(&piece) {
            *alone |= best[*own as usize].is_none() && !waits[*own as usize];
        }
        let mut found: Vec<Bridge> = best.into_iter().flatten().collect();
        if found.is_empty() {
            if share > 1.0 {
                return all;
            }
            // Now only the largest waits.
            share = f64::INFINITY;
            continue;
        }
        found.sort_by(|a, b| a.width.total_cmp(&b.width).then(a.from.cmp(&b.from)));
        let mut joined: Vec<u32> = (0..count as u32).collect();
        for bridge in found {
            let [a, b] = [bridge.from, bridge.to].map(|end| root(&joined, piece[end as usize]));
            if a != b {
                joined[a.max(b) as usize] = a.min(b);
                all.push(bridge);
            }
        }
        let mut new_number = vec![u32::MAX; count];
        let mut next = 0;
        for own in &mut piece {
            let of = root(&joined, *own) as usize;
            if new_number[of] == u32::MAX {
                new_number[of] = next;
                next += 1;
            }
            *own = new_number[of];
        }
    }
}

/// The first of the joined pieces that one belongs to.
pub(super) fn root(joined: &[u32], mut piece: u32) -> u32 {
    while joined[piece as usize] != piece {
        piece = joined[piece as usize];
    }
    piece
}

/// The number of the group that each place is in, from 0: places nearer than `apart` are of one.
pub(super) fn groups_within(places: &[Point3<f32>], apart: f32) -> Vec<u32> {
    let mut joined: Vec<u32> = (0..places.len() as u32).collect();
    for a in 0..places.len() {
        for b in 0..a {
            if (places[a] - places[b]).norm() <= apart {
                let [low, high] = [root(&joined, a as u32), root(&joined, b as u32)];
                joined[low.max(high) as usize] = low.min(high);
            }
        }
    }
    let mut numbers = Vec::with_capacity(places.len());
    let mut count = 0;
    for place in 0..places.len() {
        let first = root(&joined, place as u32) as usize;
        if first == place {
            numbers.push(count);
            count += 1;
        } else {
            numbers.push(numbers[first]);
        }
    }
    numbers
}

/// A point on the way, the nearest first.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reached {
    way: f32,
    point: u32,
}

impl Eq for Reached {}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .way
            .total_cmp(&self.way)
            .then(other.point.cmp(&self.point))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows of points with a gap between, and one that is too far.
    #[test]
    fn ways_lead_over_gaps_at_their_narrowest() {
        let mut points: Vec<Point3<f32>> =
            (0..5).map(|i| Point3::new(i as f32, 0.0, 0.0)).collect();
        points.extend((0..3).map(|i| Point3::new(6.0 + i as f32, 0.0, 0.0)));
        points.push(Point3::new(30.0, 0.0, 0.0));
        let graph = Graph::new(&points, 1.5).bridged(&points, 1.5, 4.0);
        assert_eq!(graph.pieces(), [0, 0, 0, 0, 0, 0, 0, 0, 1]);
        let ways = graph.shortest_ways(&[0]);
        assert_eq!(ways.length[7], 4.0 + GAP_COST * 2.0 + 2.0);
        assert_eq!(ways.before[5], 4);
        assert_eq!(ways.length[8], f32::INFINITY);
    }
}
