//! A refined tree goes on from the old one, and is as good a tree as one that was pushed anew.

use crate::trees::Flat;
use crate::{support, trees};
use arborcam::config;
use arborcam::model::{Node, NodeId, Skeleton};
use arborcam::shape::{self, Prototype, PushFigures, Twin, twins};
use arborcam::skeleton::Node2d;
use nalgebra::{Point2, Point3, Vector2};

/// A tree that goes on from `old`, where it was held, and the same branches pushed anew.
struct GoesOn {
    tree: Skeleton,
    held: Vec<Option<Point3<f64>>>,
    anew: Skeleton,
    width: f64,
}

fn go_on(new: &Flat, old: &Skeleton, measured: &[Option<Twin>]) -> GoesOn {
    let settings = config::Shape::default();
    let anew = shape::build(&new.nodes, &new.tracks, &new.outline, &settings);
    let prototype = Prototype::of(&new.nodes, &new.tracks, &new.outline, &settings);
    let (tree, held) = shape::go_on(
        &anew,
        old,
        &twins(&anew, old, measured),
        &prototype,
        &settings,
    );
    GoesOn {
        tree,
        held,
        anew,
        width: prototype.envelope.width(),
    }
}

#[derive(Debug)]
struct Figures {
    filling: f64,
    plausibility: f64,
}

impl Figures {
    /// Hardly worse in either.
    fn match_those_of(&self, best: &Self) -> bool {
        self.filling >= 0.95 * best.filling && self.plausibility >= 0.95 * best.plausibility
    }
}

fn figures(tree: &Skeleton, flat: &Flat) -> Figures {
    let figures = PushFigures::of(
        tree,
        &flat.nodes,
        &flat.tracks,
        &flat.outline,
        &config::Shape::default(),
    );
    Figures {
        filling: figures.filling(),
        plausibility: figures.plausibility(),
    }
}

fn stood_up(flat: &Flat) -> Skeleton {
    shape::build(
        &flat.nodes,
        &flat.tracks,
        &flat.outline,
        &config::Shape::default(),
    )
}

/// `old` as it is found later: places some pixels off, twigs that part anew, and branches that turn
/// out to grow from their parent's parent. Nodes keep their order, so that node k's twin is node k.
fn found_later(old: &Flat, seed: u64) -> (Flat, Vec<Option<Twin>>) {
    let chance = |k: usize, what: u64| ((k as u64 * 13 + what + 97 * seed) as f64 * 78.233).sin();
    let mut nodes = old.nodes.clone();
    for k in 2..nodes.len() {
        let [u, v] = nodes[k].position_px.into();
        nodes[k].position_px = [u + 6.0 * chance(k, 1), v + 6.0 * chance(k, 2)].into();
        let grand = nodes[k]
            .parent
            .filter(|&p| p > 1)
            .and_then(|p| nodes[p].parent);
        if let Some(grand) = grand.filter(|_| chance(k, 3) > 0.7) {
            nodes[k].parent = Some(grand);
        }
        let parent = nodes[k].parent.expect("a parent");
        nodes[k].level = nodes[parent].level + 1;
    }
    let mut measured: Vec<Option<Twin>> = (0..nodes.len())
        .map(|k| {
            Some(Twin {
                old: NodeId(k as u32),
                moved_px: Vector2::zeros(),
            })
        })
        .collect();
    for k in (2..old.nodes.len()).filter(|&k| chance(k, 4) > 0.6) {
        let [u, v] = nodes[k].position_px.into();
        for side in [-1.0, 1.0] {
            let position_px = [u + side * 9.0, v - 14.0].into();
            nodes.push(Node2d {
                parent: Some(k),
                level: nodes[k].level + 1,
                position_px,
                ..nodes[k].clone()
            });
            measured.push(None);
        }
    }
    let tracks = trees::carried(&nodes);
    (
        Flat {
            name: "found later",
            nodes,
            tracks,
            outline: old.outline.clone(),
        },
        measured,
    )
}

/// An artist takes the refined tree away: it must not have beams and hooks that a tree built at
/// once would not have.
#[test]
fn a_tree_that_goes_on_is_as_full_and_as_plausible_as_one_that_was_pushed_anew() {
    let (mut all, mut sides) = (0, 0);
    let (mut way, mut anew_way) = (0.0, 0.0);
    for (levels, seed, wild) in [
        (5, 0, 0.2),
        (5, 1, 0.4),
        (6, 2, 0.3),
        (4, 3, 0.5),
        (5, 4, 0.1),
        (6, 5, 0.2),
    ] {
        let before = Flat::generated_by(levels, seed, wild);
        let old = stood_up(&before);
        let (flat, measured) = found_later(&before, seed);
        let GoesOn {
            tree,
            held,
            anew,
            width,
        } = go_on(&flat, &old, &measured);
        let (ours, best) = (figures(&tree, &flat), figures(&anew, &flat));
        let off = |s: &Skeleton| -> Vec<f64> {
            let way = |(n, stood): (&Node, &Option<Point3<f64>>)| {
                Some((n.position.z - (*stood)?.z).abs())
            };
            let mut ways: Vec<f64> = s
                .nodes
                .iter()
                .zip(&held)
                .filter(|(n, _)| n.copy_of.is_none())
                .filter_map(way)
                .collect();
            ways.sort_by(f64::total_cmp);
            ways
        };
        let changed = |s: &Skeleton| {
            let other = |n: &Node, stood: &Point3<f64>| {
                n.position.z * stood.z < 0.0 && (n.position.z - stood.z).abs() > 0.02 * width
            };
            s.nodes
                .iter()
                .zip(&held)
                .filter(|(n, h)| n.copy_of.is_none() && h.is_some_and(|h| other(n, &h)))
                .count()
        };
        let (ways, anews) = (off(&tree), off(&anew));
        let n = ways.len();
        println!(
            "{levels} levels, seed {seed}: filling {:.3} ({:.3}), plausibility {:.3} ({:.3}); of {n} held {} changed sides \
             ({}), in depth {:.1} px in the median ({:.1}), at most {:.1} ({:.1}), width {width:.0}",
            ours.filling,
            best.filling,
            ours.plausibility,
            best.plausibility,
            changed(&tree),
            changed(&anew),
            ways[n / 2],
            anews[n / 2],
            ways[n - 1],
            anews[n - 1]
        );
        assert!(ours.match_those_of(&best), "{ours:?} against {best:?}");
        (all, sides) = (all + n, sides + changed(&tree));
        (way, anew_way) = (
            way + ways.iter().sum::<f64>(),
            anew_way + anews.iter().sum::<f64>(),
        );
    }
    assert!(
        way <= 0.25 * anew_way,
        "{way:.0} px in all, pushed anew {anew_way:.0} px"
    );
    assert!(20 * sides <= all, "{sides} of {all} branches changed sides");
}

/// Refined again and again by the same, a tree must not creep.
#[test]
fn a_tree_that_is_found_again_as_it_was_stays_to_the_last_bit() {
    let flat = Flat::generated_by(5, 1, 0.4);
    let old = stood_up(&flat);
    let measured: Vec<Option<Twin>> = (0..flat.nodes.len())
        .map(|k| {
            Some(Twin {
                old: NodeId(k as u32),
                moved_px: Vector2::zeros(),
            })
        })
        .collect();
    assert_eq!(go_on(&flat, &old, &measured).tree, old);
}

/// A fork that was found elsewhere: held by its old place, a branch would run back along what it
/// leaves.
#[test]
fn no_branch_is_held_where_it_would_turn_back() {
    let node = |parent, level, position_px| Node2d {
        parent,
        level,
        cluster: None,
        position_px,
        certainty: 0.5,
    };
    let with = |nodes: Vec<Node2d>| Flat {
        name: "fork",
        tracks: trees::carried(&nodes),
        nodes,
        outline: Flat::generated(3).outline,
    };
    let foot = [
        node(None, 0, [320.0, 340.0].into()),
        node(Some(0), 1, [318.0, 260.0].into()),
    ];
    // The limb's fork was taken to be high up, where it is low, with two branches that begin there.
    let of = |limb: Point2<f64>| {
        let crown = [
            node(Some(1), 2, limb),
            node(Some(2), 3, [280.0, 140.0].into()),
            node(Some(2), 3, [360.0, 150.0].into()),
        ];
        with(foot.iter().cloned().chain(crown).collect())
    };
    let (high, low) = (Point2::new(318.0, 60.0), Point2::new(318.0, 200.0));
    let (before, after) = (of(high), of(low));
    let old = stood_up(&before);
    let measured: Vec<Option<Twin>> = (0..5)
        .map(|k| {
            Some(Twin {
                old: NodeId(k as u32),
                moved_px: Vector2::zeros(),
            })
        })
        .collect();
    let GoesOn { tree, .. } = go_on(&after, &old, &measured);
    let fork = tree.image_from_model(&tree.nodes[2].position);
    assert_eq!(fork, low);
    // A little sooner or later it ends where it ended.
    let near = of(Point2::new(318.0, 66.0));
    let fork = go_on(&near, &old, &measured).tree.nodes[2].position;
    assert_eq!(tree.image_from_model(&fork), high);
}

/// The tree that a clip's capture is written with has been refined or not; who takes it away shall
/// not see which. Shoots are not pushed, and stand where the picture shows them.
#[test]
fn the_trees_of_the_clips_are_as_good_as_pushed_anew() {
    let shipped = [support::CLIP, support::OUTLINE].map(std::path::PathBuf::from);
    for [clip, outline] in [Some(shipped), trees::oak_clip()].into_iter().flatten() {
        let tree = trees::grown(&clip, &outline);
        let flat = Flat::of_tree("clip", &tree);
        let (ours, best) = (
            figures(&tree.plain, &flat),
            figures(&stood_up(&flat), &flat),
        );
        println!(
            "{}: refined {} times, {ours:.3?}, pushed anew {best:.3?}",
            clip.display(),
            tree.refinements
        );
        assert!(ours.match_those_of(&best), "{ours:?} against {best:?}");
    }
}
