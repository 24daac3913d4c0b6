//! The example with its branching angles drawn anew (Zeng 2015 sect. 5.4.2).

use super::von_mises::{NothingSoDense, VonMises};
use crate::model::{JointPose, MovingBranch, NodeKind, Skeleton};
use crate::random::Generator;
use nalgebra::{UnitQuaternion, Vector3};

/// What is drawn anew, and how freely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resampling {
    /// Only angles with a density above this are taken, 1/rad.
    pub threshold: f64,
    /// Branches from this level on are turned; the trunk has level 1.
    pub from_level: u8,
}

/// The branching angles of a tree: how far its branches turn off from those that carry them in the
/// picture, radians, by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideAngles {
    /// Of those that turn off to the left, seen along the carrier, and to the right. One through
    /// both sides would have no direction. `None` where no branch does.
    left: Option<VonMises>,
    right: Option<VonMises>,
}

impl Default for Resampling {
    /// What Zeng found to be right (sect. 6.2 and 6.3).
    fn default() -> Self {
        Self {
            threshold: 0.4,
            from_level: 3,
        }
    }
}

impl SideAngles {
    /// Those of the branches of `skeleton` that move on their own and are no copies. `trunk` says which
    /// nodes are trunk: where it goes up to the top, its pieces are no branches.
    pub fn of(skeleton: &Skeleton, trunk: &[bool]) -> Self {
        let (mut left, mut right) = (Vec::new(), Vec::new());
        for branch in measured_branches(skeleton).filter(|b| !trunk[b.node.index()]) {
            match deviation(skeleton, &branch) {
                Some(angle) if angle >= 0.0 => left.push(angle),
                Some(angle) => right.push(angle),
                None => {}
            }
        }
        Self {
            left: VonMises::fit(&left),
            right: VonMises::fit(&right),
        }
    }

    fn on_side_of(&self, angle: f64) -> Option<VonMises> {
        if angle >= 0.0 { self.left } else { self.right }
    }
}

/// The measured nodes of `skeleton` with other angles between its branches: each branch from
/// [`Resampling::from_level`] on is turned in the picture's plane about the place where it begins,
/// with all that it carries, to an angle drawn for its side. What is below stays as it is to the
/// last bit, as does the trunk, and all lengths stay. There are no copies; depths are 0 and to be found anew.
///
/// # Errors
/// No angle of a side on which a branch is to be turned has a density above the threshold.
pub fn resample(
    skeleton: &Skeleton,
    trunk: &[bool],
    angles: &SideAngles,
    how: &Resampling,
    random: &mut Generator,
) -> Result<Skeleton, NothingSoDense> {
    let mut turned = Skeleton {
        nodes: skeleton.nodes[..skeleton.measured()].to_vec(),
        ..skeleton.clone()
    };
    for node in &mut turned.nodes {
        node.position.z = 0.0;
        (node.kind, node.n_tracks) = (NodeKind::Grown, 0);
    }
    let flat = turned.clone();
    let mut joints = flat.joints_at_rest();
    let mut turns = vec![0.0; flat.nodes.len()];
    for branch in measured_branches(&flat) {
        let own = match deviation(&flat, &branch) {
            Some(angle)
                if flat.nodes[branch.node.index()].level >= how.from_level
                    && !trunk[branch.node.index()] =>
            {
                drawn_for(angles, angle, how, random)? - angle
            }
            _ => 0.0,
        };
        let turn = turns[branch.parent.index()] + own;
        turns[branch.node.index()] = turn;
        if turn != 0.0 {
            place(&mut joints, &flat, &branch, turn);
        }
    }
    for (node, joint) in turned.nodes.iter_mut().zip(joints) {
        node.position = joint.position;
    }
    Ok(turned)
}

/// A new angle for a branch that turns off by `angle`.
fn drawn_for(
    angles: &SideAngles,
    angle: f64,
    how: &Resampling,
    random: &mut Generator,
) -> Result<f64, NothingSoDense> {
    let Some(of_side) = angles.on_side_of(angle) else {
        return Ok(angle);
    };
    let half_width = of_side.half_width(how.threshold)?;
    Ok(of_side.sample_within(half_width, random))
}

/// Puts a branch where it begins in `turned`, turned by `turn` against `flat`, radians.
fn place(joints: &mut [JointPose], flat: &Skeleton, branch: &MovingBranch, turn: f64) {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
    branch.place(flat, rotation, joints);
    for part in branch.parts() {
        joints[part.index()].position.z = 0.0;
    }
}

/// The branches that move on their own and are no copies, each after the one that carries it.
fn measured_branches(skeleton: &Skeleton) -> impl Iterator<Item = MovingBranch> {
    let measured = skeleton.measured();
    let branches = skeleton.moving_branches().into_iter();
    branches.filter(move |branch| branch.node.index() < measured)
}

/// How far a branch turns off from the direction of the one that carries it, in the picture,
/// counter-clockwise, radians from -pi to pi. `None` for what grows from the foot, and where one of
/// them has no length in the picture.
fn deviation(skeleton: &Skeleton, branch: &MovingBranch) -> Option<f64> {
    let begin = skeleton.begin(branch.parent)?;
    let [foot_of_carrier, carrier] =
        [begin, branch.parent].map(|n| skeleton.nodes[n.index()].position.xy());
    let (along, own) = (carrier - foot_of_carrier, branch.vector(skeleton).xy());
    let has_direction = along.norm() > 0.0 && own.norm() > 0.0;
    has_direction.then(|| along.perp(&own).atan2(along.dot(&own)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, NodeId, Size};
    use crate::random::generator;
    use nalgebra::Point2;

    /// A trunk with a branch to either side at every hundred px, each with two twigs, one of them
    /// with a bend.
    fn tree() -> Skeleton {
        let mut nodes = vec![Node::made_up(0, None, [0.0, 0.0, 0.0])];
        let mut trunk = 0;
        for k in 1..=6 {
            let height = 100.0 * f64::from(k);
            let lean = 0.1 * f64::from(k % 3);
            trunk = grow(&mut nodes, trunk, [0.0, height]);
            for side in [-1.0, 1.0] {
                let way = [side * (60.0 + 10.0 * lean), height + 40.0 * (1.0 + lean)];
                let limb = grow(&mut nodes, trunk, way);
                let bend = grow(&mut nodes, limb, [way[0] + side * 20.0, way[1]]);
                let twig = grow(&mut nodes, bend, [way[0] + side * 40.0, way[1] + 15.0]);
                nodes[bend as usize].moves_with = Some(NodeId(twig));
                nodes[bend as usize].level = nodes[twig as usize].level;
                grow(&mut nodes, limb, [way[0], way[1] + 40.0]);
            }
        }
        Skeleton {
            nodes,
            foot_px: Point2::new(300.0, 700.0),
            image_size: Size::new(640, 720),
        }
    }

    fn grow(nodes: &mut Vec<Node>, on: u32, [x, y]: [f64; 2]) -> u32 {
        let number = nodes.len() as u32;
        let level = nodes[on as usize].level + 1;
        nodes.push(Node {
            level,
            ..Node::made_up(number, Some(on), [x, y, 0.0])
        });
        number
    }

    const HOW: Resampling = Resampling {
        threshold: 0.4,
        from_level: 3,
    };

    fn no_trunk(tree: &Skeleton) -> Vec<bool> {
        vec![false; tree.nodes.len()]
    }

    fn resampled(seed: u64) -> Skeleton {
        let tree = tree();
        let angles = SideAngles::of(&tree, &no_trunk(&tree));
        resample(
            &tree,
            &no_trunk(&tree),
            &angles,
            &HOW,
            &mut generator(seed, 0),
        )
        .expect("dense enough")
    }

    #[test]
    fn what_is_below_stays_to_the_last_bit_and_lengths_stay() {
        let (tree, new) = (tree(), resampled(1));
        let mut turned = 0;
        for (old, new_node) in tree.nodes.iter().zip(&new.nodes) {
            assert_eq!(old.parent, new_node.parent);
            if old.level < HOW.from_level {
                assert_eq!(old.position, new_node.position);
            }
            turned += usize::from(old.position != new_node.position);
            let Some(parent) = old.parent.map(|p| p.index()) else {
                continue;
            };
            let length = (old.position - tree.nodes[parent].position).norm();
            let new_length = (new_node.position - new.nodes[parent].position).norm();
            assert!((length - new_length).abs() < 1e-9);
        }
        assert!(turned > tree.nodes.len() / 2, "{turned} nodes were turned");
    }

    /// As of a conifer.
    #[test]
    fn a_trunk_up_to_the_top_stays() {
        let tree = tree();
        let trunk: Vec<bool> = tree.nodes.iter().map(|n| n.position.x == 0.0).collect();
        let angles = SideAngles::of(&tree, &trunk);
        let new = resample(&tree, &trunk, &angles, &HOW, &mut generator(1, 0)).expect("dense");
        let mut turned = 0;
        for ((old, new), is_trunk) in tree.nodes.iter().zip(&new.nodes).zip(&trunk) {
            assert!(!is_trunk || old.position == new.position);
            turned += usize::from(old.position != new.position);
        }
        assert!(turned > 20, "{turned} nodes were turned");
    }

    #[test]
    fn branches_keep_their_side_and_their_angles_are_dense_enough() {
        let tree = tree();
        let angles = SideAngles::of(&tree, &no_trunk(&tree));
        let new = resampled(2);
        for branch in measured_branches(&new) {
            let before = deviation(&tree, &branch).unwrap_or(0.0);
            let Some(after) = deviation(&new, &branch) else {
                continue;
            };
            if new.nodes[branch.node.index()].level >= HOW.from_level {
                let of_side = angles.on_side_of(before).expect("fitted");
                assert!(of_side.density(after) >= HOW.threshold - 1e-6);
            } else {
                assert_eq!(before, after);
            }
        }
    }

    #[test]
    fn a_seed_gives_one_tree_and_another_seed_another() {
        assert_eq!(resampled(3), resampled(3));
        assert_ne!(resampled(3), resampled(4));
    }

    #[test]
    fn a_threshold_that_no_density_reaches_is_an_error() {
        let tree = tree();
        let angles = SideAngles::of(&tree, &no_trunk(&tree));
        let how = Resampling {
            threshold: 1e9,
            ..HOW
        };
        assert!(resample(&tree, &no_trunk(&tree), &angles, &how, &mut generator(1, 0)).is_err());
        // Where nothing is turned nothing is drawn.
        let none = Resampling {
            from_level: 99,
            ..how
        };
        assert!(
            resample(
                &tree,
                &no_trunk(&tree),
                &angles,
                &none,
                &mut generator(1, 0)
            )
            .is_ok()
        );
    }

    #[test]
    fn trees_without_branches_stay_as_they_are() {
        let nobody = Skeleton {
            nodes: Vec::new(),
            ..tree()
        };
        let angles = SideAngles::of(&nobody, &no_trunk(&nobody));
        let same = resample(
            &nobody,
            &no_trunk(&nobody),
            &angles,
            &HOW,
            &mut generator(1, 0),
        );
        assert_eq!(same, Ok(nobody));
    }
}
