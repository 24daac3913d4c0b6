//! From tracks to the 3D pose of every frame (Li 2011 sect. 4): root to tip, each branch turns
//! about its local root and carries all that hangs on it. Lengths never change, as only rotations
//! are applied.

mod between;
mod binding;
mod border;
mod deterministic;
mod flutter;
mod local;
mod probabilistic;
mod recover;
mod rotation;
mod search;
mod spread;

pub use between::between;
pub use binding::Binding;
pub use deterministic::{SightLine, direction as deterministic_direction};
pub use flutter::flutter;
pub use local::{Nearby, depth};
pub use probabilistic::Problem;
pub use spread::Spread;

use crate::config::{Motion, MotionMethod};
use crate::model::{JointPose, MovingBranch, NodeDepth, NodeId, Pose, Skeleton};
use nalgebra::{Point2, Unit, UnitQuaternion, UnitVector3, Vector3, distance};
use rotation::shortest_rotation;
use std::f64::consts::PI;
use std::sync::Arc;

/// Rate at which the largest step of the settings is meant for one frame.
const FRAMES_PER_S: f64 = 30.0;
/// Standard deviation of how far a branch leans to the viewer or away beyond its rest, as a share
/// of that of its angle to its parent. The angle may be wide of the rest's because tracks say so;
/// for depth nothing speaks but a shortening.
const LEAN: f64 = 0.2;

/// One branch at rest.
struct Branch {
    way: MovingBranch,
    direction: UnitVector3<f64>,
    length: f64,
    /// Of the parent's own branch.
    parent_direction: Option<UnitVector3<f64>>,
    sigma_shape: f64,
    copy: Option<CopyOf>,
}

/// Whose copy a branch is.
struct CopyOf {
    original: NodeId,
    /// The branch that carries the original.
    parent: Option<NodeId>,
    /// From the original's plane to the copy's.
    turn: UnitQuaternion<f64>,
}

impl Branch {
    /// `sigma_shape` in radians.
    fn at_rest(skeleton: &Skeleton, way: MovingBranch, sigma_shape: f64) -> Self {
        let node = &skeleton.nodes[way.node.index()];
        let vector = way.vector(skeleton);
        let above = skeleton.begin(way.parent).map(|begin| {
            skeleton.nodes[way.parent.index()].position - skeleton.nodes[begin.index()].position
        });
        Self {
            direction: Unit::try_new(vector, 1e-9).unwrap_or(Vector3::y_axis()),
            length: vector.norm(),
            parent_direction: above.and_then(|v| Unit::try_new(v, 1e-9)),
            sigma_shape,
            copy: node.copy_of.map(|original| CopyOf {
                original,
                parent: skeleton.moving_parent(original),
                turn: UnitQuaternion::from_axis_angle(&Vector3::y_axis(), node.plane_angle),
            }),
            way,
        }
    }

    /// Puts it into `joints`, turned by `own` in the axes of its parent branch.
    fn turn(&self, skeleton: &Skeleton, own: UnitQuaternion<f64>, joints: &mut [JointPose]) {
        let parent = joints[self.way.parent.index()].rotation;
        let rotation = UnitQuaternion::new_normalize((parent * own).into_inner());
        self.way.place(skeleton, rotation, joints);
    }
}

/// Where a node is seen in a frame.
#[derive(Clone, Copy, Debug)]
struct NodeSeen {
    target_px: Option<Point2<f64>>,
    /// Model axes; `None` where it is not known.
    depth: Option<NodeDepth>,
}

/// The copy turns in its plane as the original does in its own.
fn turn_of_copy(copy: &CopyOf, joints: &[JointPose]) -> UnitQuaternion<f64> {
    let parent_rotation = copy
        .parent
        .map_or(UnitQuaternion::identity(), |p| joints[p.index()].rotation);
    let own = parent_rotation.inverse() * joints[copy.original.index()].rotation;
    copy.turn * own * copy.turn.inverse()
}

/// Follows the pose of a skeleton from frame to frame.
pub struct PoseEstimator {
    skeleton: Arc<Skeleton>,
    settings: Motion,
    /// Each after the one that carries it, and after its original.
    branches: Vec<Branch>,
    /// Direction of each measured branch in the frame before, by node, in the axes of its parent
    /// branch at rest; `None` before the first frame, which may lie anywhere within the accumulated
    /// bound.
    previous: Option<Vec<UnitVector3<f64>>>,
    previous_s: f64,
}

impl PoseEstimator {
    pub fn new(skeleton: Arc<Skeleton>, settings: &Motion) -> Self {
        let ways = skeleton.moving_branches();
        let levels = ways.iter().map(|w| skeleton.nodes[w.node.index()].level);
        let deepest = f64::from(levels.max().unwrap_or(1).max(2));
        let mut branches = Vec::with_capacity(ways.len());
        for way in ways {
            // A wider tolerance towards the tips, which bend more easily (Li 2011 eq. 10).
            let level = f64::from(skeleton.nodes[way.node.index()].level);
            let depth = (level - 1.0) / (deepest - 1.0);
            let (root, tip) = (settings.sigma_shape_root_deg, settings.sigma_shape_tip_deg);
            let sigma_shape = (root + depth * (tip - root)).to_radians();
            branches.push(Branch::at_rest(&skeleton, way, sigma_shape));
        }
        Self {
            branches,
            skeleton,
            settings: settings.clone(),
            previous: None,
            previous_s: 0.0,
        }
    }

    /// The most probable pose, given where the tracks put each measured node (px in the picture).
    pub fn step(&mut self, frame: u64, time_s: f64, targets_px: &[Option<Point2<f64>>]) -> Pose {
        self.step_in_space(frame, time_s, targets_px, &[])
    }

    /// The same where a depth camera has seen nodes, too; `depths` has what is known of each measured
    /// node, and may be empty.
    pub fn step_in_space(
        &mut self,
        frame: u64,
        time_s: f64,
        targets_px: &[Option<Point2<f64>>],
        depths: &[Option<NodeDepth>],
    ) -> Pose {
        // A clock that stands still must not forbid all motion.
        let elapsed_s = (time_s - self.previous_s).max(1e-3);
        self.previous_s = time_s;
        let mut joints = self.skeleton.joints_at_rest();
        let mut directions = vec![Vector3::y_axis(); joints.len()];
        for branch in &self.branches {
            let i = branch.way.node.index();
            let own = match &branch.copy {
                Some(copy) => {
                    directions[i] = branch.direction;
                    turn_of_copy(copy, &joints)
                }
                None => {
                    let base = JointPose {
                        position: joints[branch.way.begin.index()].position,
                        rotation: joints[branch.way.parent.index()].rotation,
                    };
                    let seen = NodeSeen {
                        target_px: targets_px.get(i).copied().flatten(),
                        depth: depths.get(i).copied().flatten(),
                    };
                    let previous = self.previous.as_ref().map(|p| p[i]);
                    let d = self.direction(branch, previous, &base, seen, elapsed_s);
                    directions[i] = d;
                    shortest_rotation(&branch.direction, &d)
                }
            };
            branch.turn(&self.skeleton, own, &mut joints);
        }
        self.previous = Some(directions);
        Pose {
            frame,
            time_s,
            joints,
        }
    }

    /// By how much the direction of a branch may change that was `turned` from its rest, so that
    /// the branch turns by no more than `max_step_deg` in a frame, or in 1/30 s where frames are
    /// rarer.
    ///
    /// The turn from rest to a direction is the shortest one. Between two directions up to an angle
    /// theta from the rest these turns differ by up to 1 / cos(theta / 2) times the angle between
    /// the directions.
    fn largest_step(&self, turned: f64, elapsed_s: f64) -> f64 {
        let frames = (elapsed_s * FRAMES_PER_S).max(1.0);
        let bound = (self.settings.max_step_deg.to_radians() * frames).min(PI);
        // Beyond 120 degrees, where only settings of one's own let it come, there would soon be
        // nothing left.
        bound
            * (0.5 * (turned + bound).min(self.settings.max_total_deg.to_radians()))
                .cos()
                .max(0.5)
    }

    /// Direction of a branch in the axes of its parent branch at rest, from the `previous` one. It
    /// begins at the place of `base`, whose rotation is the parent branch's.
    fn direction(
        &self,
        branch: &Branch,
        previous: Option<UnitVector3<f64>>,
        base: &JointPose,
        seen: NodeSeen,
        elapsed_s: f64,
    ) -> UnitVector3<f64> {
        let foot = self.skeleton.foot_px;
        let target = seen
            .target_px
            .map(|t| Point2::new(t.x - foot.x, foot.y - t.y));
        if branch.length < 1e-6 {
            return branch.direction;
        }
        // The base is off by this at least, and no turn of the branch is to make up for that.
        let out_of_reach_px = target.map_or(0.0, |t| {
            (distance(&t, &base.position.xy()) - branch.length).max(0.0)
        });
        let sigma_track_px = self.settings.sigma_track_px.hypot(out_of_reach_px);
        match self.settings.method {
            MotionMethod::Probabilistic => Problem {
                parent_rotation: base.rotation,
                length: branch.length,
                target: target.map(|t| t - base.position.xy()),
                depth: seen.depth.map(|depth| NodeDepth {
                    z_px: depth.z_px - base.position.z,
                    ..depth
                }),
                parent_direction: branch.parent_direction,
                rest_direction: branch.direction,
                previous_direction: previous.unwrap_or(branch.direction),
                sigma_track_px,
                sigma_shape: branch.sigma_shape,
                // The first frame has none before it.
                sigma_depth: previous
                    .map(|_| self.settings.depth_rate_deg_s.to_radians() * elapsed_s),
                sigma_lean: Some(LEAN * branch.sigma_shape),
                sigma_turn: Some(branch.sigma_shape),
                max_step: previous.map_or(PI, |p| {
                    self.largest_step(p.angle(&branch.direction), elapsed_s)
                }),
                max_total: self.settings.max_total_deg.to_radians(),
            }
            .solve(),
            MotionMethod::Deterministic => {
                let own = previous.unwrap_or(branch.direction);
                let Some(target) = target else { return own };
                let now = base.position + base.rotation * own.into_inner() * branch.length;
                let seen = SightLine {
                    target_px: target,
                    sd_px: sigma_track_px,
                    depth: seen.depth,
                };
                let d = deterministic_direction(&base.position, branch.length, &now, seen);
                Unit::new_normalize(base.rotation.inverse() * d.into_inner())
            }
        }
    }
}
