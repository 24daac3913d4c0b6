//! A modelled tree made flat.
//!
//! A captured tree is stood up by copies of its flat branches on planes turned about the trunk (Li
//! 2011 sect. 3). This is the way back: of as many planes the one is taken that most branches are
//! nearest to, without what is nearer to the others. Each limb that is left is turned about the
//! vertical through the place where it leaves the trunk until it stands in the picture's plane, on
//! the side on which it is seen. Heights and distances from the trunk stay.

use super::error::ImportError;
use super::flat_tree::{FlatTree, flat_node};
use super::model_tree::ModelTree;
use super::sketch::refuse_more;
use crate::model::{Node, NodeId, Pose, Size, Skeleton, Sway, Swaying, Unidentified};
use nalgebra::{Point2, Point3, Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::PI;

/// Height of the flat tree, px, and the room around it.
const HEIGHT_PX: f64 = 720.0;
const ROOM_PX: f64 = 40.0;
/// A tree is not so many times as wide as it is high.
const WIDEST: f64 = 8.0;
/// Forks on one way from the foot: levels are counted in a byte.
const MOST_LEVELS: usize = 250;

/// A modelled tree made flat, and how.
#[derive(Clone, Debug)]
pub struct FlatModel {
    pub flat: FlatTree,
    /// Metres in a pixel; 0 where they are not known.
    pub metres_per_px: f64,
    /// For every node of the flat tree the one of the model.
    of_model: Vec<usize>,
    /// By which its branch was turned into the plane.
    turns: Vec<UnitQuaternion<f64>>,
}

impl FlatModel {
    /// Makes a tree flat that is to be copied to so many planes: the foot, the forks and the tips,
    /// joined by straight branches. With one plane all limbs are turned into it.
    ///
    /// # Errors
    /// It has no height, is too wide, or has too many forks on one another.
    pub fn of(model: &ModelTree, planes: u32) -> Result<Self, ImportError> {
        let foot = model.nodes[0].position;
        let highest = model.nodes.iter().map(|n| n.position.y - foot.y);
        let height = highest.fold(0.0, f64::max);
        let far = model.nodes.iter().map(|n| (n.position - foot).norm());
        if height <= 0.0 || far.fold(0.0, f64::max) > WIDEST * height {
            return Err(ImportError::NoHeight);
        }
        let scale = HEIGHT_PX / height;
        let forks = Forks::of(model)?;
        let limbs = Limbs::of(&forks.skeleton(model, scale));
        let forks = forks.without(&limbs.beside_fullest_plane(planes));
        let upright = forks.skeleton(model, scale);
        let turns = Limbs::of(&upright).turns();
        let mut places: Vec<Point3<f64>> = Vec::with_capacity(upright.nodes.len());
        for (node, turn) in upright.nodes.iter().zip(&turns) {
            let place = match node.parent.map(|p| p.index()) {
                Some(p) => places[p] + turn * (node.position - upright.nodes[p].position),
                None => Point3::origin(),
            };
            places.push(place);
        }
        Ok(Self {
            flat: FlatTree {
                skeleton: flat_skeleton(upright, &places),
                has_radii: model.nodes.iter().all(|n| n.wood.radius > 0.0),
                trunk_px: Vec::new(),
                crown_px: Vec::new(),
            },
            metres_per_px: model.metres_per_unit / scale,
            of_model: forks.of_model,
            turns,
        })
    }

    /// The pose of `skeleton`, which is this tree stood up in space, when the nodes of the model are
    /// at `places`, in its own order: each branch turns as the line between its ends does, at rest at
    /// those of `model`.
    pub fn pose(
        &self,
        skeleton: &Skeleton,
        model: &ModelTree,
        places: &[Point3<f64>],
        frame: u64,
        time_s: f64,
    ) -> Pose {
        let mut joints = skeleton.joints_at_rest();
        for branch in skeleton.moving_branches() {
            let original = skeleton.nodes[branch.node.index()].copy_of;
            let node = original.unwrap_or(branch.node).index();
            let parent = skeleton.nodes[node].parent.map_or(0, |p| p.index());
            let rotation = self.rotation(model, places, node, parent);
            branch.place(skeleton, rotation, &mut joints);
        }
        Pose {
            frame,
            time_s,
            joints,
        }
    }

    /// How the branch that ends in each node of the flat tree sways, as far as `model` says: as the last
    /// of its pieces of which that is known.
    pub fn sway(&self, model: &ModelTree) -> Vec<Swaying> {
        let children = model.children();
        let mut known: Vec<Option<Sway>> = Vec::with_capacity(model.nodes.len());
        for node in &model.nodes {
            let below = node.parent.filter(|p| children[*p].len() == 1);
            known.push(node.wood.sway.or(below.and_then(|p| known[p])));
        }
        let of_model = self.of_model.iter();
        of_model
            .map(|i| known[*i].ok_or(Unidentified::NotMeasured))
            .collect()
    }

    /// How the branch between two nodes of the flat tree has turned.
    fn rotation(
        &self,
        model: &ModelTree,
        places: &[Point3<f64>],
        node: usize,
        parent: usize,
    ) -> UnitQuaternion<f64> {
        let ends = [node, parent].map(|n| self.of_model.get(n).copied());
        let ([Some(end), Some(begin)], Some(turn)) = (ends, self.turns.get(node)) else {
            return UnitQuaternion::identity();
        };
        let rest = turn * (model.nodes[end].position - model.nodes[begin].position);
        let (Some(to), Some(from)) = (places.get(end), places.get(begin)) else {
            return UnitQuaternion::identity();
        };
        // What has turned back altogether has no axis.
        UnitQuaternion::rotation_between(&rest, &(turn * (to - from))).unwrap_or_default()
    }
}

/// The foot, the forks and the tips of a model.
struct Forks {
    /// Which nodes of the model they are; parents before children.
    of_model: Vec<usize>,
    parents: Vec<Option<usize>>,
}

impl Forks {
    fn of(model: &ModelTree) -> Result<Self, ImportError> {
        let children = model.children();
        let mut forks = Self {
            of_model: Vec::new(),
            parents: Vec::new(),
        };
        let mut below: Vec<Option<usize>> = vec![None; model.nodes.len()];
        let mut levels = Vec::new();
        for (i, node) in model.nodes.iter().enumerate() {
            let parent = node.parent.and_then(|p| below[p]);
            below[i] = parent;
            if node.parent.is_none() || children[i].len() != 1 {
                below[i] = Some(forks.of_model.len());
                levels.push(parent.map_or(0, |p| levels[p] + 1));
                refuse_more("forks on one way", levels[levels.len() - 1], MOST_LEVELS)?;
                forks.of_model.push(i);
                forks.parents.push(parent);
            }
        }
        Ok(forks)
    }

    /// The same without the nodes that are `left_out`, which carry no others.
    fn without(self, left_out: &[bool]) -> Self {
        let mut new_place: Vec<Option<usize>> = Vec::with_capacity(left_out.len());
        let mut kept = Self {
            of_model: Vec::new(),
            parents: Vec::new(),
        };
        for (i, is_left_out) in left_out.iter().enumerate() {
            new_place.push((!is_left_out).then_some(kept.of_model.len()));
            if !is_left_out {
                kept.of_model.push(self.of_model[i]);
                kept.parents
                    .push(self.parents[i].and_then(|p| new_place[p]));
            }
        }
        kept
    }

    /// They as a tree in space, the foot at the origin.
    fn skeleton(&self, model: &ModelTree, scale: f64) -> Skeleton {
        let foot = model.nodes[0].position;
        let mut nodes: Vec<Node> = Vec::with_capacity(self.of_model.len());
        let mut carries = vec![false; self.of_model.len()];
        for parent in self.parents.iter().flatten() {
            carries[*parent] = true;
        }
        for (i, (of_model, parent)) in self.of_model.iter().zip(&self.parents).enumerate() {
            let level = parent.map_or(0, |p| nodes[p].level.saturating_add(1));
            let parent = parent.map(|p| NodeId(p as u32));
            let mut node = flat_node(i, parent, level, Point2::origin(), Point2::origin());
            node.position = Point3::from((model.nodes[*of_model].position - foot) * scale);
            node.radius = model.nodes[*of_model].wood.radius * scale;
            node.certainty = if carries[i] && i > 0 { 1.0 } else { 0.0 };
            nodes.push(node);
        }
        Skeleton {
            nodes,
            foot_px: Point2::origin(),
            image_size: Size::new(1, 1),
        }
    }
}

/// The limbs of a tree in space: what leaves the trunk, with all that it carries.
struct Limbs {
    /// Of each node the one in which the lowest piece of its limb ends; `None` on the trunk.
    limb_of: Vec<Option<usize>>,
    /// For each such node the sum of the ways from where its limb begins to its nodes.
    ways: Vec<Vector3<f64>>,
}

impl Limbs {
    fn of(upright: &Skeleton) -> Self {
        let branches = upright.botanical_branches();
        let nodes = &upright.nodes;
        let mut limb_of: Vec<Option<usize>> = vec![None; nodes.len()];
        let mut ways: Vec<Vector3<f64>> = vec![Vector3::zeros(); nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            let Some(parent) = node.parent.map(|p| p.index()) else {
                continue;
            };
            let on_trunk = branches.order(NodeId(i as u32)) == 0;
            limb_of[i] = limb_of[parent].or((!on_trunk).then_some(i));
            if let Some(limb) = limb_of[i] {
                let base = nodes[limb].parent.map_or(0, |p| p.index());
                ways[limb] += node.position - nodes[base].position;
            }
        }
        Self { limb_of, ways }
    }

    /// Which nodes are on limbs that are nearer to another of so many vertical planes, evenly about
    /// the trunk, than to the one with most nodes; the first is that of the picture.
    fn beside_fullest_plane(&self, planes: u32) -> Vec<bool> {
        let planes = planes.max(1);
        let mut plane_of: Vec<Option<u32>> = Vec::with_capacity(self.limb_of.len());
        for limb in &self.limb_of {
            plane_of.push(limb.map(|limb| {
                let way = self.ways[limb];
                let share = way.z.atan2(way.x) / PI;
                (share * f64::from(planes))
                    .round()
                    .rem_euclid(planes.into()) as u32
            }));
        }
        let mut nodes_on = vec![0_usize; planes as usize];
        for plane in plane_of.iter().flatten() {
            nodes_on[*plane as usize] += 1;
        }
        // The first of equals.
        let fullest = (0..planes)
            .rev()
            .max_by_key(|plane| nodes_on[*plane as usize]);
        let mut is_beside = Vec::with_capacity(plane_of.len());
        for plane in plane_of {
            is_beside.push(plane.is_some() && plane != fullest);
        }
        is_beside
    }

    /// By which each node's branch is turned into the plane of the picture: each limb as its middle.
    fn turns(&self) -> Vec<UnitQuaternion<f64>> {
        let mut turns = Vec::with_capacity(self.limb_of.len());
        for limb in &self.limb_of {
            let middle = limb.map_or_else(Vector3::zeros, |limb| self.ways[limb]);
            turns.push(into_plane(&middle));
        }
        turns
    }
}

/// The turn about the vertical that brings a direction into the plane z = 0 by the shorter way.
fn into_plane(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let side = if direction.x < 0.0 { -1.0 } else { 1.0 };
    let angle = (side * direction.z).atan2(side * direction.x);
    Rotation3::from_axis_angle(&Vector3::y_axis(), angle).into()
}

/// The flat tree in a picture of its own.
fn flat_skeleton(upright: Skeleton, places: &[Point3<f64>]) -> Skeleton {
    let (mut left, mut right, mut bottom) = (0.0_f64, 0.0_f64, 0.0_f64);
    for place in places {
        left = left.min(place.x);
        right = right.max(place.x);
        bottom = bottom.min(place.y);
    }
    let foot_px = Point2::new(ROOM_PX - left, ROOM_PX + HEIGHT_PX);
    let size = [right - left, HEIGHT_PX - bottom].map(|side| (side + 2.0 * ROOM_PX).ceil() as u32);
    let mut nodes = upright.nodes;
    for (node, place) in nodes.iter_mut().zip(places) {
        node.position = Point3::new(place.x, place.y, 0.0);
    }
    Skeleton {
        nodes,
        foot_px,
        image_size: Size::new(size[0], size[1]),
    }
}
