//! Bends and side wood: they move with their branch, and change nothing of how it moves.

use crate::bent::{Bent, assert_rigid, assert_same_places, hand_made};
use crate::made_trees::{Drive, Filming, MadeTree};
use crate::synthetic;
use arborcam::animate::{Animator, Known, Magnify, Wind, magnify, place_to_pull};
use arborcam::cancel::CancelToken;
use arborcam::config::{self, Dynamics, Motion, MotionMethod};
use arborcam::dynamics::{Depth, analyse, angle_in_space_deg, angle_to_parent_deg, shoots};
use arborcam::model::{NodeId, Pose, Skeleton, Unidentified};
use arborcam::motion::{PoseEstimator, between};
use nalgebra::{Point2, Point3, Vector2};
use std::sync::Arc;

/// Where the tracks of frame `k` put each node, px: wild, and with gaps.
fn targets(skeleton: &Skeleton, k: usize) -> Vec<Option<Point2<f64>>> {
    let mut out = Vec::new();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let off = Vector2::new(synthetic::noise(i, 2 * k), synthetic::noise(i, 2 * k + 1));
        let seen = synthetic::noise(i, 7 * k + 3) < 0.7;
        out.push(seen.then(|| skeleton.image_from_model(&node.position) + 25.0 * off));
    }
    out
}

fn poses(skeleton: &Arc<Skeleton>, motion: &Motion, all: &[Vec<Option<Point2<f64>>>]) -> Vec<Pose> {
    let mut estimator = PoseEstimator::new(skeleton.clone(), motion);
    let mut out = Vec::new();
    for (k, targets) in all.iter().enumerate() {
        out.push(estimator.step(k as u64, k as f64 / 30.0, targets));
    }
    out
}

fn methods() -> [Motion; 2] {
    [MotionMethod::Probabilistic, MotionMethod::Deterministic].map(|method| Motion {
        method,
        ..Motion::default()
    })
}

#[test]
fn no_edge_changes_its_length_in_any_pose() {
    let trees = [hand_made(), Bent::of(&synthetic::tree(5, 3), true).skeleton];
    for skeleton in trees.map(Arc::new) {
        for motion in methods() {
            let all: Vec<_> = (0..40).map(|k| targets(&skeleton, k)).collect();
            let poses = poses(&skeleton, &motion, &all);
            poses.iter().for_each(|p| assert_rigid(&skeleton, p));
            let moved = (poses[30].joints[4].position - skeleton.nodes[4].position).norm();
            assert!(moved > 1.0, "it moves: {moved} px");
            for share in [0.2, 0.5, 1.0] {
                assert_rigid(&skeleton, &between(&skeleton, &poses[3], &poses[9], share));
            }
            let recovered = PoseEstimator::new(skeleton.clone(), &motion);
            for pose in &poses {
                let places: Vec<Point3<f64>> = pose.joints.iter().map(|j| j.position).collect();
                let again = recovered.recover(pose.frame, pose.time_s, &places);
                assert_rigid(&skeleton, &again);
                for (i, (a, b)) in again.joints.iter().zip(&pose.joints).enumerate() {
                    let off = (a.position - b.position).norm();
                    assert!(off < 1e-3, "{i}: {off} px");
                }
            }
        }
    }
}

#[test]
fn a_tree_moves_as_it_does_without_its_bends() {
    let straight = Arc::new(synthetic::tree(5, 3));
    let bent = Bent::of(&straight, false);
    let with_bends = Arc::new(bent.skeleton.clone());
    let all: Vec<_> = (0..40).map(|k| targets(&straight, k)).collect();
    let spread: Vec<_> = all.iter().map(|t| bent.spread(t, None)).collect();
    for motion in methods() {
        let (a, b) = (
            poses(&straight, &motion, &all),
            poses(&with_bends, &motion, &spread),
        );
        for (a, b) in a.iter().zip(&b) {
            assert_same_places(a, &bent, b);
        }
        for i in [1, 2, 5, straight.nodes.len() - 1] {
            let [old, new] = [i, bent.of[i]].map(|i| NodeId(i as u32));
            for (f, g) in [
                (
                    angle_to_parent_deg(&straight, &a, old),
                    angle_to_parent_deg(&with_bends, &b, new),
                ),
                (
                    angle_in_space_deg(&straight, &a, old),
                    angle_in_space_deg(&with_bends, &b, new),
                ),
            ] {
                assert!(f.iter().zip(&g).all(|(f, g)| (f - g).abs() < 1e-6), "{i}");
            }
        }
        let wanted = Magnify {
            by: 2.5,
            speed: 1.0,
            band_hz: None,
            most_rad: 0.6,
            looped: false,
        };
        let a = magnify(&straight, &a, &wanted, 30.0, 30).expect("magnified");
        let b = magnify(&with_bends, &b, &wanted, 30.0, 30).expect("magnified");
        for (a, b) in a.iter().zip(&b) {
            assert_rigid(&with_bends, b);
            for (i, joint) in a.joints.iter().enumerate() {
                let off = (joint.position - b.joints[bent.of[i]].position).norm();
                assert!(off < 1e-6, "{i}: {off} px");
            }
        }
    }
    let numbers = straight.main_branches();
    let with_bends_numbers = bent.skeleton.main_branches();
    for (i, number) in numbers.iter().enumerate() {
        assert_eq!(with_bends_numbers[bent.of[i]], *number, "node {i}");
    }
    for (i, number) in with_bends_numbers.iter().enumerate() {
        let mover = bent.skeleton.mover(NodeId(i as u32)).index();
        assert_eq!(*number, with_bends_numbers[mover], "part {i}");
    }
}

/// Answers are equal to the last bit: an analysis never sees the bends.
#[test]
fn a_film_says_the_same_of_a_tree_with_bends() {
    for (drive, seconds) in [(Drive::Release(0.5), 12.0), (Drive::Wind, 40.0)] {
        let filming = Filming {
            seconds,
            ..Filming::default()
        };
        let tree = MadeTree::new(4, drive, &filming);
        let bent = Bent::of(&tree.skeleton, false);
        let mut film = tree.film.clone();
        for track in &mut film.tracks {
            track.node = NodeId(bent.of[track.node.index()] as u32);
        }
        let (config, cancel) = (Dynamics::default(), CancelToken::new());
        let straight = analyse(&tree.skeleton, &tree.film, &config, Depth::Full, &cancel);
        let found = analyse(&bent.skeleton, &film, &config, Depth::Full, &cancel);
        assert!(straight.sway.iter().filter(|s| s.is_ok()).count() > 2);
        let expected = bent.spread(&straight.sway, Err(Unidentified::NotMeasured));
        assert_eq!(
            format!("{:?}", found.sway),
            format!("{expected:?}"),
            "{drive:?}"
        );
        let on_straight = shoots(&tree.skeleton, &tree.film, &config, &cancel);
        let on_bent = shoots(&bent.skeleton, &film, &config, &cancel);
        assert_eq!(on_straight.len(), on_bent.len());
        for (a, b) in on_straight.iter().zip(&on_bent) {
            assert_eq!(
                (bent.of[a.on.index()], &a.tracks),
                (b.on.index(), &b.tracks)
            );
        }
        // Too short to be looked at.
        let short = film.part(0..20);
        let sway = analyse(&bent.skeleton, &short, &config, Depth::Full, &cancel).sway;
        assert_eq!(sway.len(), bent.skeleton.measured());
    }
}

#[test]
fn wind_and_a_pull_leave_the_tree_whole() {
    let wind = config::Wind {
        force: 8.0,
        ..config::Wind::default()
    };
    for skeleton in [hand_made(), Bent::of(&synthetic::tree(4, 2), true).skeleton].map(Arc::new) {
        let known = vec![
            Known {
                frequency_hz: Some(0.9),
                damping_ratio: Some(0.05),
            };
            skeleton.nodes.len()
        ];
        let air = Wind::new(&wind, 64.0, 0.03);
        let mut animator = Animator::new(skeleton.clone(), &known, &wind, air);
        let tuning: Vec<_> = animator.tuning().copied().collect();
        for (i, tuned) in tuning.iter().enumerate() {
            let mover = skeleton.mover(NodeId(i as u32));
            assert_eq!(*tuned, tuning[mover.index()], "node {i}");
        }
        animator.warm_up();
        let mut farthest = 0.0_f64;
        for k in 0..120 {
            let pose = animator.pose(k);
            assert_rigid(&skeleton, &pose);
            let top = (pose.joints[4].position - skeleton.nodes[4].position).norm();
            farthest = farthest.max(top);
            animator.advance(1.0 / 30.0);
        }
        assert!(farthest > 1.0, "{farthest} px");
        let tied = place_to_pull(&skeleton);
        assert_eq!(skeleton.mover(tied), tied);
        let parts = (1..skeleton.nodes.len() as u32).map(NodeId);
        let bend = parts.clone().find(|n| skeleton.mover(*n) != *n);
        for node in [tied, bend.expect("a bend")] {
            let lean = animator.pull_aside(node, 0.0, 2.0);
            assert!((lean - 2.0).abs() < 0.1, "{lean} degrees");
            assert_rigid(&skeleton, &animator.pose(0));
        }
    }
}
