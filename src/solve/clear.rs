//! Copies that would go through filmed limbs stand beside them.

use super::bent_tree::{plane_angles, way_of};
use crate::model::{Node, NodeId, NodeName, Skeleton};
use nalgebra::{Point3, Rotation3, Unit, UnitVector3, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

/// Step of the turns that are tried, radians.
const STEP: f64 = PI / 60.0;
/// Within so many radii of the limb that it grows from, a copy is in that limb's wood.
const FORK_RADII: f64 = 2.0;
/// A branch that stood before moves by this share of the picture's width at most.
const REACH: f64 = 1.0 / 40.0;

/// How copied branches are turned out of the way, by the name of the branch.
pub type Turns = BTreeMap<NodeName, Turn>;

/// Turns copied branches about the place where they leave, with all that they bear, as little as
/// needed for them to pass beside the filmed limbs: about the vertical if that will do, else up,
/// down or aside, by half of the way to the next plane at most. Where no turn is enough, that one
/// which leaves the least of them in filmed wood. The larger branches go first, and each branch on
/// them is then turned by itself. A branch that stood `before` stays as it is while nothing is in
/// its way, and else moves by a few pixels each time, so that nobody sees it jump. Gives how all of
/// them are turned now.
///
/// What was filmed stays, and so do the radii, which must be known. `plane_angle` of what is turned
/// about the vertical goes along, so that it moves as its original does in its own direction.
pub(super) fn clear_of_filmed(skeleton: &mut Skeleton, before: &Turns) -> Turns {
    let measured = skeleton.measured();
    let copies = plane_angles(skeleton).len();
    let most = 0.5 * PI / (copies + 1) as f64;
    let reach_px = REACH * f64::from(skeleton.image_size.width);
    let filmed = Filmed::of(&skeleton.nodes[..measured]);
    let mut turns = Turns::new();
    let mut done = BTreeSet::new();
    for node in measured..skeleton.nodes.len() {
        let branch = skeleton.mover(NodeId(node as u32));
        let Some(on) = skeleton.nodes[node].parent.filter(|_| done.insert(branch)) else {
            continue;
        };
        let name = skeleton.nodes[branch.index()].name;
        let borne = Borne::by(skeleton, branch, on);
        let turn = match before.get(&name) {
            Some(stood) => borne.clearing_turn(&filmed, *stood, most, reach_px),
            None => borne.clearing_turn(&filmed, Turn::NONE, most, f64::INFINITY),
        };
        borne.turn(skeleton, turn);
        turns.insert(name, turn);
    }
    turns
}

/// A turn about an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    axis: UnitVector3<f64>,
    angle: f64,
}

impl Turn {
    const NONE: Self = Self {
        axis: Unit::new_unchecked(Vector3::new(0.0, 1.0, 0.0)),
        angle: 0.0,
    };

    /// All that are tried, those near `stood` first, and those about the vertical before others.
    fn options(stood: Self, most: f64) -> Vec<Self> {
        let mut axes = vec![Vector3::y_axis()];
        for k in 0..4 {
            let heading = Rotation3::from_axis_angle(&Vector3::y_axis(), 0.25 * PI * f64::from(k));
            axes.push(heading * Vector3::x_axis());
        }
        let steps = (most / STEP) as i32;
        let mut options = Vec::new();
        for axis in axes {
            for step in -steps..=steps {
                let angle = STEP * f64::from(step);
                options.push(Self { axis, angle });
            }
        }
        let from_there = |turn: &Self| turn.rotation().angle_to(&stood.rotation());
        options.sort_by(|a, b| from_there(a).total_cmp(&from_there(b)));
        options
    }

    fn rotation(&self) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&self.axis, self.angle)
    }
}

/// A straight piece of a limb.
#[derive(Clone, Copy, Debug)]
struct Piece {
    from: Point3<f64>,
    to: Point3<f64>,
    radius: f64,
}

impl Piece {
    fn of(nodes: &[Node], end: usize) -> Option<Self> {
        let node = &nodes[end];
        let from = nodes.get(node.parent?.index())?.position;
        Some(Self {
            from,
            to: node.position,
            radius: node.radius,
        })
    }

    fn length_px(&self) -> f64 {
        (self.to - self.from).norm()
    }

    /// Whether it goes through `other` more than `clear_px` away from `fork`.
    fn is_through(&self, other: &Self, fork: &Point3<f64>, clear_px: f64) -> bool {
        let reach = self.radius + other.radius;
        let middles =
            nalgebra::center(&self.from, &self.to) - nalgebra::center(&other.from, &other.to);
        if middles.norm() > 0.5 * (self.length_px() + other.length_px()) + reach {
            return false;
        }
        let (own, its) = nearest(self, other);
        (own - its).norm() < reach && (own - fork).norm() > clear_px
    }
}

/// The places of two pieces that are nearest to each other.
fn nearest(a: &Piece, b: &Piece) -> (Point3<f64>, Point3<f64>) {
    let (along_a, along_b, between) = (a.to - a.from, b.to - b.from, a.from - b.from);
    let (aa, bb, ab) = (
        along_a.norm_squared(),
        along_b.norm_squared(),
        along_a.dot(&along_b),
    );
    let (a_between, b_between) = (along_a.dot(&between), along_b.dot(&between));
    let on_a = share(ab * b_between - bb * a_between, aa * bb - ab * ab);
    let on_b = share(ab * on_a + b_between, bb);
    let on_a = share(ab * on_b - a_between, aa);
    (a.from + on_a * along_a, b.from + on_b * along_b)
}

/// A place on a piece, as a share of its length; its begin where the quotient is none.
fn share(numerator: f64, denominator: f64) -> f64 {
    if denominator > 0.0 {
        (numerator / denominator).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// The limbs that were filmed.
struct Filmed(Vec<Piece>);

impl Filmed {
    fn of(nodes: &[Node]) -> Self {
        Self(
            (1..nodes.len())
                .filter_map(|end| Piece::of(nodes, end))
                .collect(),
        )
    }
}

/// A copied branch with all that it bears.
struct Borne {
    fork: Point3<f64>,
    /// Px from the fork within which it is in the wood that it grows from.
    clear_px: f64,
    /// Direction of the piece that it grows from.
    below: Vector3<f64>,
    nodes: Vec<usize>,
    pieces: Vec<Piece>,
}

impl Borne {
    /// `branch` leaves the node `on`.
    fn by(skeleton: &Skeleton, branch: NodeId, on: NodeId) -> Self {
        let all = &skeleton.nodes;
        let mut nodes: Vec<usize> = Vec::new();
        for (i, node) in all.iter().enumerate().skip(on.index() + 1) {
            let is_borne = |p: NodeId| nodes.binary_search(&p.index()).is_ok();
            if skeleton.mover(NodeId(i as u32)) == branch || node.parent.is_some_and(is_borne) {
                nodes.push(i);
            }
        }
        let on = on.index();
        Self {
            fork: all[on].position,
            clear_px: FORK_RADII * all[on].radius,
            below: way_of(skeleton, on),
            pieces: nodes.iter().filter_map(|&i| Piece::of(all, i)).collect(),
            nodes,
        }
    }

    /// The turn nearest to `stood` that frees it of filmed wood, or else leaves least of it there;
    /// no farther from there than `reach_px` anywhere.
    fn clearing_turn(&self, filmed: &Filmed, stood: Turn, most: f64, reach_px: f64) -> Turn {
        let (mut least_px, mut best) = (self.in_wood_px(filmed, &stood), stood);
        if least_px == 0.0 {
            return best;
        }
        for turn in Turn::options(stood, most) {
            if self.folds_back(&turn) || self.farthest_px(&turn, &stood) > reach_px {
                continue;
            }
            let px = self.in_wood_px(filmed, &turn);
            if px < least_px {
                (least_px, best) = (px, turn);
            }
            if least_px == 0.0 {
                break;
            }
        }
        best
    }

    /// How far one turn brings its ends from where another does, px.
    fn farthest_px(&self, turn: &Turn, other: &Turn) -> f64 {
        let (turn, other) = (turn.rotation(), other.rotation());
        let moved_px = |piece: &Piece| {
            let way = piece.to - self.fork;
            (turn * way - other * way).norm()
        };
        self.pieces.iter().map(moved_px).fold(0.0, f64::max)
    }

    /// Whether the turn makes it lean back against what it grows from by more than a right angle.
    fn folds_back(&self, turn: &Turn) -> bool {
        let Some(first) = self.pieces.first() else {
            return false;
        };
        let way = first.to - first.from;
        let along = (turn.rotation() * way).dot(&self.below);
        along < 0.0 && along < way.dot(&self.below)
    }

    /// Length of its pieces that go through filmed limbs after the turn, px.
    fn in_wood_px(&self, filmed: &Filmed, turn: &Turn) -> f64 {
        let rotation = turn.rotation();
        let mut px = 0.0;
        for piece in &self.pieces {
            let piece = Piece {
                from: self.fork + rotation * (piece.from - self.fork),
                to: self.fork + rotation * (piece.to - self.fork),
                ..*piece
            };
            let is_in_wood = |other: &Piece| piece.is_through(other, &self.fork, self.clear_px);
            if filmed.0.iter().any(is_in_wood) {
                px += piece.length_px();
            }
        }
        px
    }

    fn turn(&self, skeleton: &mut Skeleton, turn: Turn) {
        if turn.angle == 0.0 {
            return;
        }
        let is_about_vertical = turn.axis == Vector3::y_axis();
        for &i in &self.nodes {
            let node = &mut skeleton.nodes[i];
            node.position = self.fork + turn.rotation() * (node.position - self.fork);
            if is_about_vertical {
                node.plane_angle += turn.angle;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;
    use nalgebra::Point2;

    /// A trunk with a limb to the right, and a copy of that limb on the plane at 60 degrees.
    fn tree(in_the_way: [f64; 3]) -> Skeleton {
        let mut nodes = vec![
            Node::made_up(0, None, [0.0, 0.0, 0.0]),
            Node::made_up(1, Some(0), [0.0, 100.0, 0.0]),
            Node::made_up(2, Some(1), [80.0, 140.0, 0.0]),
            Node::made_up(3, Some(1), in_the_way),
        ];
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), PI / 3.0);
        for (name, parent, moves_with, along) in [(4, 1, Some(NodeId(5)), 0.5), (5, 4, None, 1.0)] {
            let way = turn * Vector3::new(80.0, 40.0, 0.0);
            let at = Point3::new(0.0, 100.0, 0.0) + along * way;
            nodes.push(Node {
                copy_of: Some(NodeId(2)),
                moves_with,
                plane_angle: PI / 3.0,
                ..Node::made_up(name, Some(parent), at.into())
            });
        }
        for node in &mut nodes {
            node.radius = 3.0;
        }
        Skeleton {
            nodes,
            foot_px: Point2::origin(),
            image_size: Size {
                width: 640,
                height: 360,
            },
        }
    }

    fn copies_in_wood_px(skeleton: &Skeleton) -> f64 {
        let measured = skeleton.measured();
        let filmed = Filmed::of(&skeleton.nodes[..measured]);
        Borne::by(skeleton, NodeId(5), NodeId(1)).in_wood_px(&filmed, &Turn::NONE)
    }

    #[test]
    fn a_copy_passes_beside_a_filmed_limb() {
        let mut skeleton = tree([50.0, 150.0, -80.0]);
        assert!(copies_in_wood_px(&skeleton) > 0.0);
        let before = skeleton.clone();
        clear_of_filmed(&mut skeleton, &Turns::new());
        assert_eq!(copies_in_wood_px(&skeleton), 0.0);
        assert_eq!(skeleton.nodes[..4], before.nodes[..4]);
        let turn = skeleton.nodes[4].plane_angle - before.nodes[4].plane_angle;
        assert!(turn.abs() < 0.25 * PI, "{turn}");
        let fork = before.nodes[1].position;
        for (is, was) in skeleton.nodes.iter().zip(&before.nodes) {
            let (is, was) = (is.position - fork, was.position - fork);
            assert!((is.norm() - was.norm()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_copy_that_stood_stays_or_makes_way_step_by_step() {
        let turned = clear_of_filmed(&mut tree([50.0, 150.0, -80.0]), &Turns::new());
        assert_eq!(turned.len(), 1, "{turned:?}");
        let mut free = tree([-50.0, 150.0, 0.0]);
        let mut turns = clear_of_filmed(&mut free, &turned);
        assert_eq!(turns, turned);
        // Another limb where the copy stands now.
        let [x, y, z] = free.nodes[5].position.into();
        let mut stood = free.nodes[5].position;
        for _ in 0..4 {
            let mut again = tree([x, y, z]);
            turns = clear_of_filmed(&mut again, &turns);
            let moved_px = (again.nodes[5].position - stood).norm();
            assert!(moved_px <= 16.0, "{moved_px}");
            stood = again.nodes[5].position;
            if copies_in_wood_px(&again) == 0.0 {
                return;
            }
        }
        panic!("it is still in the way: {turns:?}");
    }

    #[test]
    fn a_copy_that_goes_through_nothing_stays() {
        let mut skeleton = tree([-50.0, 150.0, 0.0]);
        let before = skeleton.clone();
        clear_of_filmed(&mut skeleton, &Turns::new());
        assert_eq!(skeleton, before);
    }

    #[test]
    fn pieces_without_length_and_numbers_that_are_none_are_borne() {
        let mut skeleton = tree([0.0, 100.0, 0.0]);
        skeleton.nodes[5].position = skeleton.nodes[4].position;
        skeleton.nodes[3].position.x = f64::NAN;
        clear_of_filmed(&mut skeleton, &Turns::new());
        assert!(skeleton.nodes[4].plane_angle.is_finite());
    }
}
