//! True branches of a clip, and how well a hierarchy agrees with them.
#![allow(dead_code)] // not every user needs all of it

use arborcam::model::{MotionHierarchy, TrackId, TrackSet};
use nalgebra::{Point2, distance};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

pub const BRANCHES: &str = "recordings/sparse_winter.branches.json";
/// A track is on the branch of the nearest true point if born so near to it, px, and not later than
/// in this frame.
const SNAP_PX: f64 = 2.5;
const LATEST_BIRTH: u64 = 5;
/// Ways in common that differ by less than this share of the trunk's length count as equal.
const MARGIN: f64 = 0.05;

#[derive(Deserialize)]
pub struct Truth {
    branches: Vec<Branch>,
    points: Vec<(f64, f64, usize)>,
}

#[derive(Deserialize)]
struct Branch {
    parent: i64,
    attached_m: f64,
    length_m: f64,
    line_px: Vec<[f64; 2]>,
}

/// From the foot to a point: the branches gone along, and how far along each, m.
type Way = Vec<(usize, f64)>;

impl Truth {
    /// What `scripts/branches-of-clip.py` has written.
    pub fn read(path: &Path) -> Self {
        serde_json::from_slice(&std::fs::read(path).expect("truth")).expect("JSON")
    }

    fn way(&self, at: Point2<f64>, mut branch: usize) -> Way {
        let line = &self.branches[branch].line_px;
        let apart = |k: usize| distance(&Point2::from(line[k]), &at);
        let vertex = (0..line.len())
            .min_by(|a, b| apart(*a).total_cmp(&apart(*b)))
            .expect("a line");
        let arc = vertex as f64 / (line.len() - 1) as f64 * self.branches[branch].length_m;
        let mut way = vec![(branch, arc)];
        while let Ok(parent) = usize::try_from(self.branches[branch].parent) {
            way.push((parent, self.branches[branch].attached_m));
            branch = parent;
        }
        way.reverse();
        way
    }
}

/// Length of the way that two points share, m.
fn shared_m(a: &Way, b: &Way) -> f64 {
    let mut total = 0.0;
    for ((x, p), (y, q)) in a.iter().zip(b) {
        if x != y {
            break;
        }
        total += p.min(*q);
        if p != q {
            break;
        }
    }
    total
}

/// Where the tracks that were there from the beginning were born, px.
#[derive(Default)]
pub struct Births(BTreeMap<TrackId, Point2<f64>>);

impl Births {
    pub fn take_note(&mut self, set: &TrackSet) {
        for o in set
            .observations
            .iter()
            .filter(|_| set.frame <= LATEST_BIRTH)
        {
            self.0.entry(o.id).or_insert(o.at_px());
        }
    }
}

/// Share of point triplets whose closest pair, by the way from the foot that it shares, is the pair
/// that parts last in the hierarchy; where two or three pairs part at once, the point is shared
/// among them. Chance is 1/3.
pub fn triplets(truth: &Truth, hierarchy: &MotionHierarchy, born: &Births) -> (usize, f64) {
    let mut nodes: BTreeMap<TrackId, Vec<usize>> = BTreeMap::new();
    for (k, cluster) in hierarchy.clusters.iter().enumerate() {
        cluster
            .members
            .iter()
            .for_each(|id| nodes.entry(*id).or_default().push(k));
    }
    let scored: Vec<(Way, &Vec<usize>)> = nodes
        .iter()
        .filter_map(|(id, nodes)| {
            let at = *born.0.get(id)?;
            let apart = |p: &(f64, f64, usize)| distance(&Point2::new(p.0, p.1), &at);
            let point = truth
                .points
                .iter()
                .min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
            (apart(point) <= SNAP_PX).then(|| (truth.way(at, point.2), nodes))
        })
        .collect();
    let n = scored.len();
    let together = |a: usize, b: usize| {
        scored[a]
            .1
            .iter()
            .zip(scored[b].1)
            .take_while(|(x, y)| x == y)
            .count()
    };
    let (mut good, mut all) = (0.0, 0.0);
    for a in 0..n {
        for b in a + 1..n {
            for c in b + 1..n {
                let pairs = [(a, b), (a, c), (b, c)];
                let shared = pairs.map(|(i, j)| shared_m(&scored[i].0, &scored[j].0));
                let mut sorted = shared;
                sorted.sort_by(f64::total_cmp);
                if sorted[2] - sorted[1] < MARGIN * truth.branches[0].length_m {
                    continue;
                }
                let closest = (0..3)
                    .max_by(|&x, &y| shared[x].total_cmp(&shared[y]))
                    .expect("three pairs");
                let depth = pairs.map(|(i, j)| together(i, j));
                let last = depth.iter().max().expect("three pairs");
                all += 1.0;
                if depth[closest] == *last {
                    good += 1.0 / depth.iter().filter(|d| *d == last).count() as f64;
                }
            }
        }
    }
    (n, good / all)
}
