//! A tree in the wind: an oscillator for every branch and axis, driven by the moment that bends it.

use super::load::{Load, loads};
use super::oscillator::{Oscillation, Transition};
use super::tune::{Tuning, tune};
use super::wind::Wind;
use super::{Known, soft};
use crate::config;
use crate::model::{JointPose, MovingBranch, NodeId, Pose, Skeleton};
use crate::random::generator;
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use rand::RngExt;
use std::sync::Arc;

/// Forces go evenly from step to step; gusts need so many steps a second to be told.
const STEPS_HZ: f64 = 60.0;
/// A storm blows for so long before the animation begins, s: no tree begins at rest in it.
const BEFORE_S: f64 = 30.0;

/// One branch. What it needs in every step lies together.
#[derive(Clone)]
struct Branch {
    way: MovingBranch,
    /// From where it begins to each of its parts at rest, its end first, px.
    vectors: Vec<Vector3<f64>>,
    load: Load,
    /// The local axes u and w (Hu et al. fig. 13) that it bends about; v, along it, is left out: it
    /// neither stretches nor twists.
    axes: [Vector3<f64>; 2],
    tuning: Tuning,
    transition: Transition,
    state: [Oscillation; 2],
    /// Where its load would hold it now, rad about each axis.
    held_at: [f64; 2],
    /// Tells its eddies from those of others, s.
    own_s: f64,
}

impl Branch {
    fn at_rest(
        skeleton: &Skeleton,
        way: MovingBranch,
        tuning: Tuning,
        load: Load,
        seed: u32,
    ) -> Self {
        let name = skeleton.nodes[way.node.index()].name.0;
        let begin = skeleton.nodes[way.begin.index()].position;
        let parts = way.parts();
        let vectors = parts.map(|n| skeleton.nodes[n.index()].position - begin);
        let mut random = generator(seed.into(), 1000 + u64::from(name));
        Self {
            load,
            vectors: vectors.collect(),
            axes: across(&way.vector(skeleton)),
            way,
            tuning,
            transition: Transition::new(tuning.frequency_hz, tuning.damping_ratio, 0.0),
            state: [Oscillation::default(); 2],
            held_at: [0.0; 2],
            own_s: random.random_range(0.0..1000.0),
        }
    }
}

/// Force on all that a branch carries, and its first moment about the branch's base.
#[derive(Clone, Copy, Default)]
struct Borne {
    force: Vector3<f64>,
    moment: Matrix3<f64>,
}

/// A point force that pulls at a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    pub node: NodeId,
    /// Model axes; in units of the pressure of steady wind of force 6 on a px².
    pub force: Vector3<f64>,
}

/// What becomes of the oscillators when forces have been worked out.
#[derive(Clone, Copy, PartialEq)]
enum Answer {
    /// They go on by a step.
    Step,
    /// They stay; the forces were changed at a stroke.
    Stay,
    /// They are put where the forces hold them, at rest.
    Settle,
}

/// Moves a tree (Hu et al. eq. 7 for each branch).
#[derive(Clone)]
pub struct Animator {
    skeleton: Arc<Skeleton>,
    /// Each after the one that carries it.
    branches: Vec<Branch>,
    /// Of every node.
    tuning: Vec<Tuning>,
    wind: Wind,
    pull: Option<Pull>,
    most_rad: f64,
    /// What is shown of every branch's turn; the oscillators know nothing of it.
    times: f64,
    time_s: f64,
    joints: Vec<JointPose>,
    /// As a matrix, by joint.
    turned: Vec<Matrix3<f64>>,
    borne: Vec<Borne>,
    /// Where the branch that ends in each node begins at rest, px; the origin where there is none.
    bases: Vec<Point3<f64>>,
}

impl Animator {
    /// The tree at rest at time 0, in `wind`. `known` is what was measured, by node index.
    pub fn new(
        skeleton: Arc<Skeleton>,
        known: &[Known],
        settings: &config::Wind,
        wind: Wind,
    ) -> Self {
        let tuning = tune(&skeleton, known, settings);
        let loads = loads(&skeleton, &tuning, settings.bend_deg);
        let n = skeleton.nodes.len();
        let bases = loads.iter().map(|l| l.base).collect();
        let mut branches = Vec::with_capacity(n);
        for way in skeleton.moving_branches() {
            let (tuning, load) = (tuning[way.node.index()], loads[way.node.index()]);
            branches.push(Branch::at_rest(&skeleton, way, tuning, load, settings.seed));
        }
        Self {
            branches,
            tuning,
            joints: skeleton.joints_at_rest(),
            turned: vec![Matrix3::identity(); n],
            borne: vec![Borne::default(); n],
            bases,
            skeleton,
            wind,
            pull: None,
            most_rad: settings.max_bend_deg.to_radians(),
            times: 1.0,
            time_s: 0.0,
        }
    }

    /// Frequency and damping of every branch, by node index; what moves with another node has that
    /// one's.
    pub fn tuning(&self) -> impl ExactSizeIterator<Item = &Tuning> {
        self.tuning.iter()
    }

    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The wind about the tree, to be changed as it blows.
    pub fn wind(&mut self) -> &mut Wind {
        &mut self.wind
    }

    /// Shows every branch turned so many times as far as it is, within the same bounds.
    pub fn magnify(&mut self, times: f64) {
        self.times = times;
    }

    /// What it is pulled by.
    pub fn pulled(&self) -> Option<Pull> {
        self.pull
    }

    /// Pulls at a node from now on; releases it for `None`.
    pub fn pull(&mut self, pull: Option<Pull>) {
        self.pull = pull;
        self.answer(Answer::Stay);
    }

    /// Puts every branch where the forces hold it, at rest.
    pub fn settle(&mut self) {
        self.answer(Answer::Settle);
    }

    /// Lets the wind blow for a while, so that the animation, which begins at time 0, begins in the
    /// midst of it.
    pub fn warm_up(&mut self) {
        self.time_s = -BEFORE_S;
        self.settle();
        self.advance(BEFORE_S);
        self.time_s = 0.0;
    }

    /// Lets `for_s` seconds pass, in as many even steps as it says.
    pub fn advance(&mut self, for_s: f64) -> u64 {
        let steps = (for_s * STEPS_HZ - 1e-9).ceil().max(1.0);
        let step_s = for_s / steps;
        for _ in 0..steps as u64 {
            self.step(step_s);
        }
        steps as u64
    }

    /// Chooses the start at time 0 from which the tree comes back to itself after `period_s`, which
    /// must be the wind's.
    ///
    /// A branch is driven by the wind and by how those that carry it have turned, and by nothing
    /// else. So once those come round its own start follows from how far it misses it: from the
    /// trunk up, one lap a level.
    pub fn close(&mut self, period_s: f64, steps_each_s: f64) {
        let frames = (period_s * steps_each_s).round().max(1.0) as u64;
        let laps = 1 + self.depth();
        self.time_s = 0.0;
        self.settle();
        for _ in 0..laps {
            let start: Vec<[Oscillation; 2]> = self.branches.iter().map(|b| b.state).collect();
            let mut steps = 0;
            for _ in 0..frames {
                steps += self.advance(period_s / frames as f64);
            }
            for (branch, start) in self.branches.iter_mut().zip(start) {
                for (now, from) in branch.state.iter_mut().zip(start) {
                    let by = Oscillation {
                        x: now.x - from.x,
                        v: now.v - from.v,
                    };
                    let more = branch.transition.closing(steps, by);
                    *now = Oscillation {
                        x: from.x + more.x,
                        v: from.v + more.v,
                    };
                }
            }
            self.time_s = 0.0;
            self.answer(Answer::Stay);
        }
    }

    fn depth(&self) -> usize {
        let mut depth = vec![0; self.joints.len()];
        for way in self.branches.iter().map(|b| &b.way) {
            depth[way.node.index()] = depth[way.parent.index()] + 1;
        }
        depth.into_iter().max().unwrap_or(0)
    }

    fn step(&mut self, step_s: f64) {
        for branch in self
            .branches
            .iter_mut()
            .filter(|b| b.transition.step_s() != step_s)
        {
            branch.transition = Transition::new(
                branch.tuning.frequency_hz,
                branch.tuning.damping_ratio,
                step_s,
            );
        }
        self.time_s += step_s;
        self.wind.follow(step_s);
        self.answer(Answer::Step);
    }

    /// Works out the forces at the present time, from the tips down, and what the branches do, from
    /// the trunk up.
    fn answer(&mut self, answer: Answer) {
        self.gather();
        for branch in &mut self.branches {
            let (i, parent) = (branch.way.node.index(), branch.way.parent.index());
            let (carried, turned) = (self.joints[parent].rotation, &self.turned[parent]);
            // What a branch carries is taken as it stands at rest in the axes of the one that
            // carries it: the force is turned into these axes, and its part along the branch bends
            // nothing.
            let m = self.borne[i].moment * turned;
            let bending =
                Vector3::new(m.m23 - m.m32, m.m31 - m.m13, m.m12 - m.m21) * branch.load.yields;
            let held_at = branch.axes.map(|axis| axis.dot(&bending));
            for (now, (from, to)) in branch
                .state
                .iter_mut()
                .zip(branch.held_at.into_iter().zip(held_at))
            {
                *now = match answer {
                    Answer::Step => branch.transition.step(*now, from, to),
                    Answer::Stay => *now,
                    Answer::Settle => Oscillation { x: to, v: 0.0 },
                };
            }
            branch.held_at = held_at;
            let [u, w] = branch.state.map(|s| s.x * self.times);
            let keep = soft((u * u + w * w).sqrt(), 0.5 * self.most_rad, self.most_rad);
            let own =
                UnitQuaternion::from_scaled_axis((branch.axes[0] * u + branch.axes[1] * w) * keep);
            let rotation = UnitQuaternion::new_normalize((carried * own).into_inner());
            let matrix = rotation.to_rotation_matrix().into_inner();
            self.turned[i] = matrix;
            let base = self.joints[branch.way.begin.index()].position;
            for (part, vector) in branch.way.parts().zip(&branch.vectors) {
                self.joints[part.index()] = JointPose {
                    position: base + matrix * vector,
                    rotation,
                };
            }
        }
    }

    /// Force and moment on all that every branch carries.
    fn gather(&mut self) {
        self.borne.fill(Borne::default());
        if let Some(air) = self.wind.at(self.time_s) {
            for branch in &self.branches {
                let Load {
                    base, lever, sail, ..
                } = branch.load;
                let force = self.wind.pressure(&air, &(base + lever), branch.own_s) * sail;
                self.borne[branch.way.node.index()] = Borne {
                    force,
                    moment: lever * force.transpose(),
                };
            }
        }
        if let Some(pull) = self.pull {
            self.bear(&pull);
        }
        for branch in self.branches.iter().rev() {
            let (i, parent) = (branch.way.node.index(), branch.way.parent.index());
            let Borne { force, moment } = self.borne[i];
            let farther = self.bases[i] - self.bases[parent];
            let below = &mut self.borne[parent];
            below.force += force;
            below.moment += moment + farther * force.transpose();
        }
    }

    /// What pulls at a node pulls at the branch that it is a part of.
    fn bear(&mut self, pull: &Pull) {
        let Some(at) = self.skeleton.nodes.get(pull.node.index()) else {
            return;
        };
        let mover = self.skeleton.mover(pull.node).index();
        let arm = match self.skeleton.begin(pull.node) {
            Some(begin) => at.position - self.skeleton.nodes[begin.index()].position,
            None => Vector3::zeros(),
        };
        self.borne[mover].force += pull.force;
        self.borne[mover].moment += arm * pull.force.transpose();
    }

    /// The pose of now.
    pub fn pose(&self, frame: u64) -> Pose {
        Pose {
            frame,
            time_s: self.time_s,
            joints: self.joints.clone(),
        }
    }

    /// How the line from the foot to a node leans now against its rest, degrees.
    pub fn lean_deg(&self, node: NodeId) -> f64 {
        let (Some(now), Some(rest)) = (
            self.joints.get(node.index()),
            self.skeleton.nodes.get(node.index()),
        ) else {
            return 0.0;
        };
        let foot = self.skeleton.nodes[0].position;
        (now.position - foot)
            .angle(&(rest.position - foot))
            .to_degrees()
    }
}

/// Two unit vectors at right angles to a branch and to each other.
fn across(way: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let v = way.try_normalize(1e-9).unwrap_or_else(Vector3::y);
    let other = if v.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let u = v.cross(&other).normalize();
    [u, u.cross(&v)]
}
