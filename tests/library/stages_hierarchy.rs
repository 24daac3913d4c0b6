//! The hierarchy on made-up trees whose branches and motion are known.

use arborcam::config::{Accumulate, Affinity, Hierarchy};
use arborcam::hierarchy;
use arborcam::model::TrackTable;
use arborcam::model::{Cluster, MotionHierarchy, TrackId};
use nalgebra::{Point2, distance};
use std::collections::BTreeSet;
use std::f64::consts::TAU;

const FOOT: Point2<f64> = Point2::new(150.0, 300.0);
/// Parent, joint and tip of every branch, px; the trunk is its own parent.
const BRANCHES: [(usize, Point2<f64>, Point2<f64>); 5] = [
    (0, FOOT, Point2::new(150.0, 60.0)),
    (0, Point2::new(150.0, 220.0), Point2::new(60.0, 150.0)),
    (0, Point2::new(150.0, 170.0), Point2::new(215.0, 120.0)),
    (2, Point2::new(215.0, 120.0), Point2::new(215.0, 40.0)),
    (2, Point2::new(215.0, 120.0), Point2::new(280.0, 110.0)),
];

/// What the wind or a release does to a branch: an angle in radians at a time in seconds.
type Sway = fn(usize, f64) -> f64;

/// Pulled and released: every branch swings on at its own rate.
fn released(branch: usize, t: f64) -> f64 {
    let hz = [0.6, 0.8, 1.1, 0.95, 1.3][branch];
    0.06 * (-0.04 * TAU * hz * t).exp() * (TAU * hz * t).cos()
}

/// Gusts that all share, and turbulence of each branch's own.
fn blown(branch: usize, t: f64) -> f64 {
    let gust: f64 = (1..6)
        .map(|k| (TAU * 0.13 * f64::from(k) * t + f64::from(k * k)).sin())
        .sum();
    let own: f64 = (1..9)
        .map(|k| (TAU * 0.21 * f64::from(k) * t + f64::from(k * k) * (1.3 + branch as f64)).sin())
        .sum();
    0.012 * gust + 0.02 * own
}

fn still_on_the_trunk(branch: usize, t: f64) -> f64 {
    if branch == 0 { released(0, t) } else { 0.0 }
}

/// -1 to 1, the same every time.
fn noise(seed: usize) -> f64 {
    let mut x = (seed as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0xdead_beef;
    for _ in 0..3 {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
    }
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// Share of its branch below a point.
fn along(i: usize) -> f64 {
    0.15 + 0.85 * ((i / 5) as f64 * 0.618_034).fract()
}

/// Where point `i`, which is on `branch`, is at a time, px.
fn place_px(i: usize, mut branch: usize, sway: Sway, time_s: f64) -> Point2<f64> {
    let along = along(i);
    let (_, joint, tip) = BRANCHES[branch];
    let mut at = joint + along * (tip - joint);
    at.x += 3.0 * noise(i);
    loop {
        let (parent, joint, _) = BRANCHES[branch];
        let (sin, cos) = sway(branch, time_s).sin_cos();
        let d = at - joint;
        if branch == 0 {
            // A trunk bends: what is higher moves farther, and all to the same side.
            at.x -= sin * d.y;
            return at;
        }
        at = Point2::new(
            joint.x + cos * d.x - sin * d.y,
            joint.y + sin * d.x + cos * d.y,
        );
        branch = parent;
    }
}

/// A trunk (0) with three branches, leaving at three heights, to the left, right and left; the
/// right one (2) has two of its own (3, 4). The points lie along the branches; every point of a
/// branch turns about its joint, on top of what its parent does. `of` holds each row's branch.
fn tree(points: usize, sway: Sway, noise_px: f64) -> (TrackTable, Vec<usize>) {
    let times_s: Vec<f64> = (0..150).map(|k| f64::from(k) / 15.0).collect();
    let of: Vec<usize> = (0..points).map(|i| i % 5).collect();
    let mut positions = Vec::with_capacity(points);
    for (i, &branch) in of.iter().enumerate() {
        let mut path = Vec::with_capacity(times_s.len());
        for (k, &time_s) in times_s.iter().enumerate() {
            let at = place_px(i, branch, sway, time_s);
            let shaken = [0, 1].map(|c| at[c] + noise_px * noise(2 * (i * 1000 + k) + c));
            // Now and then a point is not seen.
            let seen = !(i * 31 + k).is_multiple_of(37);
            path.push(seen.then_some(Point2::from(shaken).cast()));
        }
        positions.push(path);
    }
    let table = TrackTable {
        ids: (0..points as u32).map(TrackId).collect(),
        positions,
        fb_errors_px: vec![noise_px.max(0.01) as f32; points],
        times_s: times_s.clone(),
    };
    (table, of)
}

fn built(table: &TrackTable, settings: &Hierarchy) -> MotionHierarchy {
    let moving = hierarchy::evidence(table, &Accumulate::default()).moving;
    hierarchy::build(table, &moving, FOOT, settings)
}

/// What everything after the hierarchy takes for granted.
fn assert_sound(tree: &MotionHierarchy, settings: &Hierarchy) {
    for (k, c) in tree.clusters.iter().enumerate() {
        assert!(
            c.members.windows(2).all(|m| m[0] < m[1]),
            "members of {k} are ordered"
        );
        assert!(
            (0.0..=1.0).contains(&c.certainty),
            "certainty of {k}: {}",
            c.certainty
        );
        assert!(u32::from(c.level) < settings.levels, "level of {k}");
        let children: Vec<&Cluster> = tree
            .clusters
            .iter()
            .filter(|c| c.parent.is_some_and(|p| p.0 as usize == k))
            .collect();
        let most = if settings.affinity == Affinity::Zeng {
            64
        } else {
            settings.max_children as usize
        };
        assert!(
            children.is_empty() || (2..=most).contains(&children.len()),
            "{} children of {k}",
            children.len()
        );
        let mut seen = BTreeSet::new();
        for child in children {
            assert!(child.level == c.level + 1);
            assert!(child.members.len() >= 2, "a branch has more than one point");
            assert!(
                child
                    .members
                    .iter()
                    .all(|id| c.members.contains(id) && seen.insert(*id)),
                "children share no point"
            );
        }
        match c.parent {
            Some(p) => assert!((p.0 as usize) < k),
            None => assert!(k == 0 && c.level == 0),
        }
    }
}

/// The way of point `i` from the foot: the branches that it leads along, and how far, px.
fn way(i: usize, of: &[usize]) -> Vec<(usize, f64)> {
    let (mut branch, mut end) = (of[i], None);
    let mut way = Vec::new();
    loop {
        let (parent, joint, tip) = BRANCHES[branch];
        way.insert(
            0,
            (
                branch,
                end.map_or(along(i) * distance(&joint, &tip), |end| {
                    distance(&joint, &end)
                }),
            ),
        );
        if branch == 0 {
            return way;
        }
        (branch, end) = (parent, Some(joint));
    }
}

/// How far the ways of two points from the foot run together, px.
fn shared_px(a: usize, b: usize, of: &[usize]) -> f64 {
    let mut px = 0.0;
    for ((x, p), (y, q)) in way(a, of).into_iter().zip(way(b, of)) {
        px += if x == y { p.min(q) } else { 0.0 };
        if x != y || p != q {
            break;
        }
    }
    px
}

/// How many clusters two points are in together, of those that each is in.
fn shared_depth(a: &[usize], b: &[usize]) -> usize {
    a.iter().zip(b).take_while(|(x, y)| x == y).count()
}

/// Share of triplets whose closest pair, by the way from the foot that it shares, parts last in the
/// hierarchy; what part at once share the point. Chance is 1/3.
fn triplets_in_order(tree: &MotionHierarchy, of: &[usize]) -> f64 {
    let mut clusters: Vec<Vec<usize>> = vec![Vec::new(); of.len()];
    for (k, c) in tree.clusters.iter().enumerate() {
        c.members
            .iter()
            .for_each(|id| clusters[id.0 as usize].push(k));
    }
    let placed: Vec<usize> = tree.clusters[0]
        .members
        .iter()
        .map(|id| id.0 as usize)
        .collect();
    let n = placed.len();
    let (mut good, mut all) = (0.0, 0.0);
    for k in 0..20_000 {
        let [a, b, c] = [k * 7 + k / n, k * 13 + 1, k * 29 + 2].map(|x| placed[x % n]);
        let pairs = [(a, b), (a, c), (b, c)];
        let ways = pairs.map(|(i, j)| shared_px(i, j, of));
        let mut sorted = ways;
        sorted.sort_by(f64::total_cmp);
        if a == b || a == c || b == c || sorted[2] - sorted[1] < 12.0 {
            continue;
        }
        let depths = pairs.map(|(i, j)| shared_depth(&clusters[i], &clusters[j]));
        let last = depths.iter().max().expect("three pairs");
        let closest = (0..3)
            .find(|&k| ways[k] == sorted[2])
            .expect("one of three");
        all += 1.0;
        good += if depths[closest] == *last {
            1.0 / depths.iter().filter(|d| *d == last).count() as f64
        } else {
            0.0
        };
    }
    good / all
}

#[test]
fn points_of_a_branch_come_together_after_a_release_and_in_wind() {
    for (name, sway) in [("released", released as Sway), ("blown", blown)] {
        let (table, of) = tree(200, sway, 0.1);
        let settings = Hierarchy::default();
        let tree = built(&table, &settings);
        assert_sound(&tree, &settings);
        let share = triplets_in_order(&tree, &of);
        println!(
            "{name}: {share:.3} of the triplets, {} clusters",
            tree.clusters.len()
        );
        assert!(
            share > 0.8,
            "{name}: {share:.3} of the triplets, {} clusters",
            tree.clusters.len()
        );
        // The twigs of the right branch part from each other later than from the left one.
        let mut counts = vec![[0usize; 5]; tree.clusters.len()];
        for (count, cluster) in counts.iter_mut().zip(&tree.clusters) {
            for id in &cluster.members {
                count[of[id.0 as usize]] += 1;
            }
        }
        let right = counts[1..]
            .iter()
            .any(|n| n[3] > 20 && n[4] > 20 && n[1] == 0);
        assert!(right, "{name}: {counts:?}");
    }
}

/// A tree that sways as one piece has no branches to be told apart; whatever comes out is made of
/// noise.
#[test]
fn a_tree_that_sways_as_one_piece_is_not_taken_apart() {
    let all_made = Hierarchy {
        min_certainty: 0.0,
        ..Hierarchy::default()
    };
    for noise_px in [0.05, 0.3] {
        let (table, _) = tree(200, still_on_the_trunk, noise_px);
        let (careful, careless) = (
            built(&table, &Hierarchy::default()),
            built(&table, &all_made),
        );
        let sure = careful
            .clusters
            .iter()
            .filter(|c| c.certainty >= 0.5)
            .count();
        println!(
            "{noise_px} px: {} clusters, {} if all are made",
            careful.clusters.len(),
            careless.clusters.len()
        );
        assert!(
            3 * careful.clusters.len() < careless.clusters.len(),
            "{noise_px} px: {sure} sure splits"
        );
    }
    let (table, _) = tree(200, released, 0.1);
    let swaying = built(&table, &Hierarchy::default());
    let sure = swaying
        .clusters
        .iter()
        .filter(|c| c.certainty >= 0.5)
        .count();
    assert!(sure >= 3, "a tree with three forks has {sure} sure splits");
    assert!(swaying.median_certainty().expect("splits") > 0.5);
}

/// The published parameters: levels 4 to 7, 100 to 2,000 points, and both ways of putting points
/// together.
#[test]
fn every_published_setting_gives_a_sound_tree() {
    for points in [100, 400, 2000] {
        let (table, of) = tree(points, released, 0.1);
        for affinity in [Affinity::Path, Affinity::Zeng] {
            for levels in if points > 400 { 7..=7 } else { 4..=7 } {
                let max_children = if affinity == Affinity::Zeng { 2 } else { 4 };
                let settings = Hierarchy {
                    levels,
                    affinity,
                    max_children,
                    ..Hierarchy::default()
                };
                let tree = built(&table, &settings);
                assert_sound(&tree, &settings);
                let share = triplets_in_order(&tree, &of);
                // Twigs are not apart from their branch beside the joint, and few levels leave
                // several in one cluster.
                let least = if affinity == Affinity::Path {
                    0.75
                } else {
                    0.5
                };
                println!("{points} points, {levels} levels, {affinity:?}: {share:.3}");
                assert!(
                    share > least,
                    "{points} points, {levels} levels, {affinity:?}: {share:.3}"
                );
            }
        }
    }
}

#[test]
fn the_same_tracks_give_the_same_tree() {
    let (table, _) = tree(150, blown, 0.2);
    let settings = Hierarchy::default();
    assert_eq!(built(&table, &settings), built(&table, &settings));
}

/// Where point `i` is in frame `k`, of five kinds of nonsense.
fn useless_px(kind: usize, i: usize, k: usize) -> Option<Point2<f32>> {
    match kind {
        0 => None,
        1 => Some(Point2::new(5.0, 5.0)),
        2 => (k == i).then_some(Point2::new(1.0, 2.0)),
        3 => Some(Point2::new(1e7 + i as f32, k as f32 * 1e6)),
        _ => Some(Point2::new(f32::NAN, f32::INFINITY)),
    }
}

/// Whatever a tracker may hand over: nothing, one point, points never seen, all in one place, far
/// outside the picture.
#[test]
fn useless_tracks_give_a_small_tree_or_none_and_no_failure() {
    let times_s: Vec<f64> = (0..30).map(|k| f64::from(k) / 15.0).collect();
    for affinity in [Affinity::Path, Affinity::Zeng] {
        let settings = Hierarchy {
            affinity,
            agreement: -1.0,
            min_certainty: 0.0,
            ..Hierarchy::default()
        };
        for kind in 0..5 {
            for n in [0usize, 1, 2, 3, 20] {
                for times in [0, 1, 2, 30] {
                    let table = TrackTable {
                        ids: (0..n as u32).map(TrackId).collect(),
                        times_s: times_s[..times].to_vec(),
                        positions: (0..n)
                            .map(|i| (0..times).map(|k| useless_px(kind, i, k)).collect())
                            .collect(),
                        fb_errors_px: vec![0.0; n],
                    };
                    let rows: Vec<usize> = (0..n).collect();
                    assert_sound(&hierarchy::build(&table, &rows, FOOT, &settings), &settings);
                }
            }
        }
    }
}
