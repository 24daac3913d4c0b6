//! Branches as limbs: where they run, how thick they are, which twigs they carry.

use crate::synthetic;
use arborcam::config::Wood;
use arborcam::geometry::cylinders_by_branch;
use arborcam::model::{NodeId, NodeKind, Skeleton};
use arborcam::shape::{CURL_BOUND, Limb, PIPE_EXPONENTS, TIP_RADIUS_PX, limbs, thicken};
use nalgebra::Point3;

fn anywhere(_: &Point3<f64>, _: &Point3<f64>) -> bool {
    true
}

fn base_and_end(limb: &Limb) -> (Point3<f64>, Point3<f64>) {
    (limb.samples[0].at, limb.samples[limb.samples.len() - 1].at)
}

#[test]
fn nodes_stay_where_they_were_filmed_and_curl_keeps_its_bound() {
    let skeleton = synthetic::tree(6, 2);
    for curl in [0.0, 0.3, 1.0] {
        let mut bent = 0.0f64;
        for limb in synthetic::limbs_of(
            &skeleton,
            &Wood {
                curl,
                ..synthetic::bare()
            },
        ) {
            let (base, end) = base_and_end(&limb);
            let node = &skeleton.nodes[limb.node.index()];
            assert_eq!(
                (base, end),
                (
                    skeleton.nodes[node.parent.unwrap().index()].position,
                    node.position
                )
            );
            let chord = end - base;
            for s in &limb.samples {
                let way = s.at - base;
                bent = bent.max(
                    (way - chord * (way.dot(&chord) / chord.norm_squared())).norm() / chord.norm(),
                );
            }
        }
        assert!(bent <= CURL_BOUND, "{bent} at curl {curl}");
        assert_eq!(bent < 1e-9, curl == 0.0, "curl {curl} bends by {bent}");
    }
}

#[test]
fn a_limb_begins_on_what_carries_it_and_is_no_thicker() {
    let skeleton = synthetic::tree(6, 3);
    let all = synthetic::limbs_of(&skeleton, &Wood::default());
    assert!(all.iter().filter(|l| l.twig).count() > 200, "twigs");
    for limb in &all {
        let Some(parent) = limb.parent.map(|p| &all[p]) else {
            continue;
        };
        let base = &limb.samples[0];
        let off = |pair: &[arborcam::shape::CenterlineSample]| {
            let way = pair[1].at - pair[0].at;
            let t = ((base.at - pair[0].at).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
            (pair[0].at + way * t - base.at).norm()
        };
        let off = parent
            .samples
            .windows(2)
            .map(off)
            .fold(f64::INFINITY, f64::min);
        assert!(off < 1e-6, "a limb begins {off} px beside its parent");
        let thickest = parent.samples.iter().map(|s| s.radius).fold(0.0, f64::max);
        assert!(limb.samples.iter().all(|s| s.radius <= thickest + 1e-9));
        for pair in limb.samples.windows(2) {
            assert!(
                pair[1].radius <= pair[0].radius + 1e-9,
                "a limb grows thicker on its way"
            );
        }
        if limb.twig {
            assert_eq!(
                limb.node, parent.node,
                "a twig is carried by the branch that it stands on"
            );
            assert!(
                limb.samples.iter().all(|s| s.skin == base.skin),
                "a twig that bends on its own"
            );
        }
    }
}

/// r^e adds up at every fork, with twigs as without, and the trunk is as thick as it was measured.
#[test]
fn pipes_add_up() {
    let mut skeleton = synthetic::tree(5, 1);
    thicken(&mut skeleton, 12.0, &anywhere, &synthetic::bare(), 1);
    let r: Vec<f64> = skeleton.nodes.iter().map(|n| n.radius).collect();
    assert_eq!((r[0], r[1]), (12.0, 12.0));
    let all = synthetic::limbs_of(
        &skeleton,
        &Wood {
            curl: 0.0,
            ..synthetic::bare()
        },
    );
    // At its end, as its base may still be as thick as the fork: only of limbs that go on, as
    // others run out.
    let own_px = |k: usize| all[k].samples[all[k].samples.len() - 1].radius;
    let inner: Vec<(usize, Vec<usize>)> = (0..all.len())
        .map(|p| {
            (
                p,
                (0..all.len())
                    .filter(|&c| all[c].parent == Some(p))
                    .collect::<Vec<_>>(),
            )
        })
        .filter(|(_, children)| !children.is_empty())
        .filter(|(_, children)| {
            children
                .iter()
                .all(|&c| all.iter().any(|l| l.parent == Some(c)))
        })
        .collect();
    assert!(inner.len() > 5);
    let thousandths = PIPE_EXPONENTS.map(|e| 1000.0 * e);
    let fits = (thousandths.lo as u32..=thousandths.hi as u32)
        .map(|e| f64::from(e) / 1000.0)
        .any(|e| {
            inner.iter().all(|(p, children)| {
                let sum: f64 = children.iter().map(|&c| own_px(c).powf(e)).sum();
                (sum / own_px(*p).powf(e) - 1.0).abs() < 0.01
            })
        });
    assert!(fits, "no exponent between {PIPE_EXPONENTS:?} adds up");
}

#[test]
fn twigs_make_the_last_branches_thin_and_leave_the_trunk_as_it_is() {
    let mut skeleton = synthetic::tree(5, 1);
    thicken(&mut skeleton, 12.0, &anywhere, &Wood::default(), 1);
    assert_eq!(skeleton.nodes[1].radius, 12.0);
    let all = synthetic::limbs_of(&skeleton, &Wood::default());
    let tip = TIP_RADIUS_PX * 2.0; // the picture is 1280 px wide
    for limb in all.iter().filter(|l| l.twig) {
        let base = limb.samples[0].radius;
        assert!(base >= tip - 1e-9, "a twig begins {base} px thick");
    }
    let tips = (0..all.len()).filter(|&k| all.iter().all(|l| l.parent != Some(k)));
    for k in tips {
        let end = all[k].samples[all[k].samples.len() - 1].radius;
        assert!(
            (0.3 * tip..0.5 * tip).contains(&end),
            "a tip ends {end} px thick"
        );
    }
}

/// Copies are branches of the tree that is drawn. Were they left out at the branch that carries
/// them, the limbs of three planes would each be as thick as if they were alone, and hardly thinner
/// than the trunk that has to carry them all.
#[test]
fn with_more_planes_the_trunk_stays_and_its_limbs_share_it() {
    let radii = |planes| {
        let mut skeleton = synthetic::tree(5, planes);
        thicken(&mut skeleton, 12.0, &anywhere, &Wood::default(), 1);
        let limbs = skeleton
            .nodes
            .iter()
            .filter(|n| n.level == 2)
            .map(|n| n.radius)
            .collect::<Vec<_>>();
        (skeleton.nodes[1].radius, limbs)
    };
    let ((alone, two), (three, six)) = (radii(1), radii(3));
    assert_eq!((alone, two.len(), three, six.len()), (12.0, 2, 12.0, 6));
    let thickest = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
    assert!(thickest(&two) > 1.2 * thickest(&six), "{two:?} {six:?}");
    assert!(
        thickest(&six) < 0.65 * 12.0,
        "as thick as the trunk: {six:?}"
    );
    assert!(six.iter().all(|r| *r > 0.2 * 12.0), "{six:?}");
}

/// A trunk that thins towards its fork carries limbs out of a point, and a step where one goes on
/// is seen as a ring.
#[test]
fn a_limb_is_thick_up_to_its_fork_and_what_goes_on_there_begins_as_thick() {
    let all = synthetic::limbs_of(&synthetic::tree(5, 3), &synthetic::bare());
    for (p, limb) in all.iter().enumerate() {
        let end = limb.samples[limb.samples.len() - 1].radius;
        let bases: Vec<f64> = all
            .iter()
            .filter(|l| l.parent == Some(p))
            .map(|l| l.samples[0].radius)
            .collect();
        let middle = limb.samples[limb.samples.len() / 2].radius;
        assert!(
            bases.is_empty() || end > 0.99 * middle,
            "{middle} px thick, {end} px at the fork"
        );
        assert!(
            bases.is_empty() || bases.iter().any(|b| (b - end).abs() < 1e-9),
            "{bases:?} after {end}"
        );
    }
}

/// Zigzag is what coarse skeletons are like: tangents that follow every turn make loops of it.
#[test]
fn sharp_turns_make_no_loops() {
    let mut skeleton = synthetic::tree(4, 1);
    for (i, node) in skeleton.nodes.iter_mut().enumerate().skip(2) {
        let level = f64::from(node.level);
        let aside = if node.level % 2 == 0 { 90.0 } else { -90.0 };
        node.position = Point3::new(
            aside + 7.0 * i as f64,
            160.0 + 25.0 * level,
            aside * synthetic::noise(i, 3),
        );
    }
    for limb in synthetic::limbs_of(&skeleton, &synthetic::bare()) {
        let (base, end) = base_and_end(&limb);
        let chord = end - base;
        let straight = chord.norm();
        let off = |at: Point3<f64>| {
            ((at - base) - chord * ((at - base).dot(&chord) / straight.powi(2))).norm()
        };
        let bent = limb.samples.iter().map(|s| off(s.at)).fold(0.0, f64::max) / straight;
        assert!(
            bent < 0.12 && limb.length() < 1.1 * straight,
            "off by {bent}, {} for {straight}",
            limb.length()
        );
        let ahead = |s: &[arborcam::shape::CenterlineSample]| (s[1].at - s[0].at).dot(&chord) > 0.0;
        assert!(limb.samples.windows(2).all(ahead), "turns back");
    }
}

#[test]
fn odd_radii_give_no_branch_thicker_than_what_carries_it_and_no_nan() {
    for trunk in [0.0, f64::NAN, f64::INFINITY, -1.0, 0.1, 1e9] {
        let mut skeleton = synthetic::tree(4, 2);
        thicken(&mut skeleton, trunk, &anywhere, &Wood::default(), 1);
        for n in &skeleton.nodes {
            assert!(n.radius.is_finite() && n.radius >= 0.0);
            assert!(
                n.parent
                    .is_none_or(|p| n.radius <= skeleton.nodes[p.index()].radius),
                "{trunk}"
            );
        }
    }
    let mut empty = Skeleton {
        nodes: Vec::new(),
        ..synthetic::tree(1, 1)
    };
    thicken(&mut empty, 3.0, &anywhere, &Wood::default(), 1);
}

#[test]
fn twigs_stay_in_their_room_are_no_shorter_than_asked_and_no_more() {
    let skeleton = synthetic::tree(6, 2);
    let below = |_: &Point3<f64>, to: &Point3<f64>| to.y < 300.0;
    let settings = Wood {
        twig_px: 7.0,
        max_twigs: 400,
        ..Wood::default()
    };
    let all = limbs(&skeleton, &below, &settings, 5);
    let twigs: Vec<&Limb> = all.iter().filter(|l| l.twig).collect();
    let bounded = limbs(&skeleton, &anywhere, &settings, 5)
        .iter()
        .filter(|l| l.twig)
        .count();
    assert_eq!(bounded, 400, "there is room for more");
    assert!(
        twigs.len() > 100 && twigs.len() <= 400,
        "{} twigs",
        twigs.len()
    );
    for twig in &twigs {
        let (base, end) = base_and_end(twig);
        assert!(end.y < 300.0);
        assert!(
            (end - base).norm() >= 14.0 - 1e-9,
            "7 px at 640 px are 14 at 1280: {}",
            (end - base).norm()
        );
    }
    assert!(
        synthetic::limbs_of(&skeleton, &synthetic::bare())
            .iter()
            .all(|l| !l.twig)
    );
    let walled_in = |_: &Point3<f64>, _: &Point3<f64>| false;
    assert!(
        limbs(&skeleton, &walled_in, &settings, 5)
            .iter()
            .all(|l| !l.twig)
    );
}

/// A bound leaves out the smallest twigs of the whole tree, not all of its last branches.
#[test]
fn every_main_branch_gets_twigs() {
    let skeleton = synthetic::tree(5, 3);
    let all = synthetic::limbs_of(
        &skeleton,
        &Wood {
            max_twigs: 300,
            ..Wood::default()
        },
    );
    let main_of = |mut node: NodeId| {
        while skeleton.nodes[node.index()].level > 2 {
            node = skeleton.nodes[node.index()].parent.unwrap();
        }
        node
    };
    for main in (0..skeleton.nodes.len() as u32)
        .map(NodeId)
        .filter(|n| skeleton.nodes[n.index()].level == 2)
    {
        let twigs = all
            .iter()
            .filter(|l| l.twig && main_of(l.node) == main)
            .count();
        assert!(twigs >= 20, "{twigs} twigs on {main:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_tree_and_another_seed_another_one_on_the_same_branches() {
    let skeleton = synthetic::tree(5, 2);
    let with = |seed| limbs(&skeleton, &anywhere, &Wood::default(), seed);
    assert!(with(3) == with(3));
    let (a, b) = (with(3), with(4));
    assert!(a != b);
    let ends = |all: &[Limb]| {
        all.iter()
            .filter(|l| !l.twig)
            .map(base_and_end)
            .collect::<Vec<_>>()
    };
    assert!(ends(&a) == ends(&b), "branches moved");
}

#[test]
fn cylinders_join_and_number_branches_from_the_trunk_up() {
    let skeleton = synthetic::tree(4, 1);
    let all = synthetic::limbs_of(&skeleton, &Wood::default());
    let table = cylinders_by_branch(&all, &skeleton);
    let length: f64 = table.iter().map(|c| (c.end - c.start).norm()).sum();
    let wood: f64 = all.iter().map(Limb::length).sum();
    assert!((length - wood).abs() < 1e-6 * wood);
    assert_eq!(
        table.iter().filter(|c| c.parent.is_none()).count(),
        1,
        "one stands on the ground"
    );
    for (k, c) in table.iter().enumerate() {
        let Some(parent) = c.parent else { continue };
        assert!(parent < k);
        let p = &table[parent];
        assert!(
            c.order == p.order && c.branch == p.branch
                || c.order == p.order + 1 && c.branch > p.branch
        );
        let along = p.end - p.start;
        let t = ((c.start - p.start).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        assert!(
            (p.start + along * t - c.start).norm() < 1e-6,
            "cylinder {k} begins beside its parent"
        );
    }
    assert!(cylinders_by_branch(&[], &skeleton).is_empty());
}

/// As a limb of segments bends in the wind: a hinge, or a crease where two branches meet, would be
/// seen at once.
#[test]
fn a_bent_branch_is_the_elastic_line_of_a_beam_and_meets_the_next_without_a_crease() {
    let mut skeleton = synthetic::tree(1, 1);
    let mut next = skeleton.nodes[1].clone();
    (next.parent, next.level, next.position) = (Some(NodeId(1)), 2, Point3::new(0.0, 300.0, 0.0));
    skeleton.nodes[1].position = Point3::new(0.0, 150.0, 0.0);
    skeleton.nodes.push(next);
    let limbs = synthetic::limbs_of(
        &skeleton,
        &Wood {
            curl: 0.0,
            ..synthetic::bare()
        },
    );
    // Each turns by three degrees against the one that carries it.
    let turn = |i: u16| {
        nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), -0.052 * f64::from(i))
    };
    let base = [
        Point3::origin(),
        Point3::origin(),
        turn(1) * skeleton.nodes[1].position,
    ];
    let rest = [0.0, 0.0, 150.0];
    let posed = |limb: &Limb| -> Vec<Point3<f64>> {
        let place = |joint: u16, at: &Point3<f64>| {
            let k = usize::from(joint);
            base[k] + turn(joint) * (at - Point3::new(0.0, rest[k], 0.0))
        };
        let point = |s: &arborcam::shape::CenterlineSample| {
            let parts = s.skin.joints.iter().zip(s.skin.weights);
            Point3::from(
                parts
                    .map(|(&j, w)| place(j, &s.at).coords * f64::from(w))
                    .sum::<nalgebra::Vector3<f64>>(),
            )
        };
        limb.samples.iter().map(point).collect()
    };
    let lean = |p: &[Point3<f64>]| ((p[1].x - p[0].x) / (p[1].y - p[0].y)).atan();
    let (lower, upper) = (posed(&limbs[0]), posed(&limbs[1]));
    for points in [&lower, &upper] {
        let angles: Vec<f64> = points.windows(2).map(lean).collect();
        let bends: Vec<f64> = angles.windows(2).map(|a| a[1] - a[0]).collect();
        // The moment falls evenly along a beam that is loaded at its ends: so do the angles between
        // its segments.
        let falls: Vec<f64> = bends.windows(2).map(|b| b[0] - b[1]).collect();
        let mean = falls.iter().sum::<f64>() / falls.len() as f64;
        assert!(
            mean > 0.0 && falls.iter().all(|f| (f - mean).abs() < 0.2 * mean),
            "{falls:?}"
        );
        assert!(
            bends[0] > 0.0 && bends.iter().all(|b| b.abs() < 0.03),
            "it has a hinge: {bends:?}"
        );
    }
    let crease = lean(&upper[..2]) - lean(&lower[lower.len() - 2..]);
    assert!(
        crease.abs() < 0.025,
        "a crease of {} degrees",
        crease.to_degrees()
    );
}

/// The radii that its nodes had before do not count.
#[test]
fn wood_that_was_traced_is_thickened_by_pipes_as_all_other() {
    let mut tree = synthetic::tree(3, 2);
    for node in tree.nodes.iter_mut().skip(1) {
        node.kind = NodeKind::Traced;
    }
    thicken(&mut tree, 12.0, &anywhere, &Wood::default(), 1);
    let children = tree.children();
    for (node, children) in tree.nodes.iter().zip(&children).skip(1) {
        let is_tip = children.is_empty();
        assert!(!is_tip || node.radius < 6.0, "{} px at a tip", node.radius);
    }
}
