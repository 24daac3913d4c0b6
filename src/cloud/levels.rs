//! From ways along the wood to its middle lines: level sets of the distance from the foot.
//!
//! Points of one stretch of the way that hang together are one place of the tree (Verroust &
//! Lazarus 2000, "Extracting skeletal curves from 3D scattered data"; Xu et al. 2007, "Knowledge
//! and heuristic-based modeling of laser-scanned trees", sect. 4; PypeTree, Delagrange et al.
//! 2014).

use super::graph::{Edge, Graph, Ways, root};
use super::raw_tree::{RawNode, RawTree};
use nalgebra::{Point3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// Strands that part and meet again within so many radii of the wood on which they parted, and are
/// nowhere farther from each other than so many, are one: shadows of other branches lie on it.
const LOOP_RADII: f64 = 2.0;
const APART_RADII: f64 = 1.5;
/// As many stretches are allowed on any wood.
const LEAST_LOOP: u32 = 3;

/// A way through wood costs its length by this power of its thickness.
const COST_POWER: f64 = 1.0;

/// What of the points lies in one stretch and hangs together.
#[derive(Clone, Debug)]
struct Cluster {
    level: u32,
    /// Sum of its points.
    sum: Vector3<f64>,
    count: u32,
    /// Largest distance of a point from the mean.
    extent: f64,
    /// Clusters of lower levels that it touches, and at how many edges.
    below: BTreeMap<u32, u32>,
    /// Of them the one with most edges, as far as is known.
    parent: Option<u32>,
}

/// The tree of the stretches, `stretch` long, of the ways to the foot. What has no way there is of
/// no node.
pub(super) fn level_tree(
    points: &[Point3<f32>],
    graph: &Graph,
    ways: &Ways,
    stretch: f32,
) -> RawTree {
    let levels: Vec<u32> = ways
        .length
        .iter()
        .map(|way| level_of(*way, stretch))
        .collect();
    let cluster_of = graph.pieces_where(|a, b| levels[a as usize] == levels[b as usize]);
    let mut clusters = clusters(points, graph, &levels, &cluster_of);
    let joined = join_loops(&mut clusters, f64::from(stretch));
    assemble(&clusters, &joined, &cluster_of)
}

/// Number of the stretch; the largest for what has no way.
fn level_of(way: f32, stretch: f32) -> u32 {
    if way.is_finite() {
        (way / stretch) as u32
    } else {
        u32::MAX
    }
}

impl Cluster {
    fn middle(&self) -> Vector3<f64> {
        self.sum / f64::from(self.count)
    }
}

fn clusters(
    points: &[Point3<f32>],
    graph: &Graph,
    levels: &[u32],
    cluster_of: &[u32],
) -> Vec<Cluster> {
    let count = cluster_of.iter().max().map_or(0, |c| *c as usize + 1);
    let empty = Cluster {
        level: u32::MAX,
        sum: Vector3::zeros(),
        count: 0,
        extent: 0.0,
        below: BTreeMap::new(),
        parent: None,
    };
    let mut clusters = vec![empty; count];
    for (i, at) in (0..).zip(points) {
        let own = &mut clusters[cluster_of[i as usize] as usize];
        own.level = levels[i as usize];
        own.sum += at.coords.cast::<f64>();
        own.count += 1;
        if own.level == u32::MAX {
            continue;
        }
        for edge in graph.edges(i) {
            if levels[edge.to as usize] < own.level {
                *own.below.entry(cluster_of[edge.to as usize]).or_default() += 1;
            }
        }
    }
    for (at, own) in points.iter().zip(cluster_of) {
        let own = &mut clusters[*own as usize];
        let off = (at.coords.cast::<f64>() - own.middle()).norm();
        own.extent = own.extent.max(off);
    }
    clusters
}

/// For each cluster the first one that it is one with; each gets its parent.
fn join_loops(clusters: &mut [Cluster], stretch: f64) -> Vec<u32> {
    let mut joined: Vec<u32> = (0..clusters.len() as u32).collect();
    let mut order: Vec<u32> = joined.clone();
    order.retain(|c| clusters[*c as usize].level != u32::MAX);
    order.sort_by_key(|c| (clusters[*c as usize].level, *c));
    let Some(foot) = order.first().copied() else {
        return joined;
    };
    for own in order {
        if clusters[own as usize].level == 0 {
            join(&mut joined, own, foot);
            continue;
        }
        let below = edges_below(&clusters[own as usize], &joined);
        let strongest = below
            .iter()
            .max_by_key(|(c, edges)| (**edges, std::cmp::Reverse(**c)));
        let Some(parent) = strongest.map(|(c, _)| *c) else {
            continue;
        };
        clusters[own as usize].parent = Some(parent);
        for other in below.keys().filter(|c| **c != parent) {
            join_strands(clusters, &mut joined, [parent, *other], own, stretch);
        }
    }
    joined
}

/// The clusters below one, as they are joined, and at how many edges it touches each.
fn edges_below(own: &Cluster, joined: &[u32]) -> BTreeMap<u32, u32> {
    let mut below = BTreeMap::new();
    for (cluster, edges) in &own.below {
        *below.entry(root(joined, *cluster)).or_default() += edges;
    }
    below
}

fn join(joined: &mut [u32], a: u32, b: u32) {
    let [a, b] = [a, b].map(|c| root(joined, c));
    joined[a.max(b) as usize] = a.min(b);
}

/// Makes two strands one that meet in `top`, if they parted not far below.
fn join_strands(
    clusters: &[Cluster],
    joined: &mut [u32],
    strands: [u32; 2],
    top: u32,
    stretch: f64,
) {
    let [mut a, mut b] = strands.map(|c| root(joined, c));
    let (mut down_a, mut down_b) = (vec![a], vec![b]);
    while a != b {
        let (down, higher) = if level(clusters, a) >= level(clusters, b) {
            (&mut down_a, &mut a)
        } else {
            (&mut down_b, &mut b)
        };
        let Some(parent) = clusters[*higher as usize].parent else {
            return;
        };
        *higher = root(joined, parent);
        down.push(*higher);
    }
    let parted = &clusters[a as usize];
    let most = LOOP_RADII * parted.extent / stretch;
    if f64::from(level(clusters, top) - parted.level) > most.max(f64::from(LEAST_LOOP)) {
        return;
    }
    let mut of_level: BTreeMap<u32, u32> = BTreeMap::new();
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    for own in down_a.into_iter().chain(down_b) {
        pairs.extend(
            of_level
                .insert(level(clusters, own), own)
                .map(|other| [own, other]),
        );
    }
    let widest = APART_RADII * parted.extent;
    if pairs.iter().all(|pair| apart(clusters, pair) <= widest) {
        pairs.iter().for_each(|[a, b]| join(joined, *a, *b));
    }
}

fn level(clusters: &[Cluster], cluster: u32) -> u32 {
    clusters[cluster as usize].level
}

/// The distance between the middles of two clusters.
fn apart(clusters: &[Cluster], pair: &[u32; 2]) -> f64 {
    let [a, b] = pair.map(|c| clusters[c as usize].middle());
    (a - b).norm()
}

/// A joined cluster, and what it touches.
#[derive(Clone, Debug)]
struct Stretch {
    cluster: u32,
    sum: Vector3<f64>,
    count: u32,
    /// Places of others in the list.
    touches: BTreeSet<usize>,
}

impl Stretch {
    fn middle(&self) -> Vector3<f64> {
        self.sum / f64::from(self.count)
    }
}

/// The joined clusters; the foot first.
fn stretches(clusters: &[Cluster], joined: &[u32]) -> Vec<Stretch> {
    let mut place_of: BTreeMap<u32, usize> = BTreeMap::new();
    let mut all: Vec<Stretch> = Vec::new();
    let mut order: Vec<u32> = (0..clusters.len() as u32).collect();
    order.retain(|c| clusters[*c as usize].level != u32::MAX);
    order.sort_by_key(|c| (clusters[*c as usize].level, *c));
    for i in order {
        let (own, of) = (&clusters[i as usize], root(joined, i));
        let place = *place_of.entry(of).or_insert_with(|| {
            all.push(Stretch {
                cluster: of,
                sum: Vector3::zeros(),
                count: 0,
                touches: BTreeSet::new(),
            });
            all.len() - 1
        });
        all[place].sum += own.sum;
        all[place].count += own.count;
        for below in own.below.keys() {
            let other = place_of[&root(joined, *below)];
            if other != place {
                all[place].touches.insert(other);
                all[other].touches.insert(place);
            }
        }
    }
    all
}

/// The tree of the stretches by the cheapest ways from the foot, where a way costs the less the
/// thicker the wood is: where a thin tip touches another branch, the shortest way may lead
/// backwards through it.
fn assemble(clusters: &[Cluster], joined: &[u32], cluster_of: &[u32]) -> RawTree {
    let all = stretches(clusters, joined);
    let mut thickness: Vec<f64> = Vec::with_capacity(all.len());
    for own in &all {
        let around = own.touches.iter().map(|t| all[*t].count);
        thickness.push(around.fold(own.count, u32::max).into());
    }
    let mut edges = Vec::new();
    for (i, own) in all.iter().enumerate() {
        for other in &own.touches {
            let length = (all[*other].middle() - own.middle()).norm();
            let thick = 0.5 * (thickness[i] + thickness[*other]);
            edges.push((
                i as u32,
                Edge {
                    to: *other as u32,
                    way: (length / thick.powf(COST_POWER)) as f32,
                },
            ));
        }
    }
    let ways =
        Graph::of_edges(all.len(), &edges).shortest_ways(if all.is_empty() { &[] } else { &[0] });
    let mut order: Vec<usize> = (0..all.len())
        .filter(|i| ways.length[*i].is_finite())
        .collect();
    order.sort_by(|a, b| ways.length[*a].total_cmp(&ways.length[*b]).then(a.cmp(b)));
    let mut node_of: BTreeMap<u32, u32> = BTreeMap::new();
    let mut tree = RawTree::default();
    for i in order {
        let below = ways.before[i] as usize;
        let parent = (below != i)
            .then(|| node_of.get(&all[below].cluster))
            .flatten();
        let parent = parent.map(|node| *node as usize);
        node_of.insert(all[i].cluster, tree.nodes.len() as u32);
        tree.nodes.push(RawNode {
            parent,
            at: Point3::from(all[i].middle()),
        });
    }
    for cluster in cluster_of {
        let node = node_of.get(&root(joined, *cluster));
        tree.of_point.push(node.copied().unwrap_or(u32::MAX));
    }
    tree
}
