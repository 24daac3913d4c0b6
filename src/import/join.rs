//! Strokes joined to a tree where they meet.

use super::error::ImportError;
use super::flat_tree::{FlatTree, flat_node};
use super::sketch::{Sketch, Stroke, refuse_more};
use crate::model::{Node, NodeId, Skeleton};
use crate::signal::corners;
use nalgebra::Point2;

/// A stroke begins on another one if it is no farther from its edge than this share of the height of
/// the drawing: nobody draws by hand to the pixel.
const REACH: f64 = 0.03;
/// Strokes that begin nearer to each other, or to an end of their carrier, than this share of the
/// height of the drawing begin at one place.
const SAME_PLACE: f64 = 0.005;
/// Points of a stroke that are nearer to each other than this are one, px.
const SAME_POINT_PX: f64 = 1.0;
/// How far straight pieces may be off a stroke, px at 640 px picture width.
const STRAIGHT_PX: f64 = 0.5;
/// Forks on one way from the foot: levels are counted in a byte.
const MOST_LEVELS: usize = 250;

/// The tree of a sketch. The trunk is the stroke that is marked, or else the one with the lowest
/// end; its foot is its lower end. All others begin on the stroke that their first point is nearest
/// to; one that begins on none may also end on one, and is turned round then. Where strokes meet
/// there is a fork, and between forks a stroke has as many bends as it takes to follow it.
///
/// # Errors
/// A stroke meets no other, or there are too many forks on one another.
pub fn joined(sketch: &Sketch) -> Result<FlatTree, ImportError> {
    let Some(trunk) = trunk_of(&sketch.strokes) else {
        return Err(ImportError::NoStrokes);
    };
    let placed = placed_strokes(sketch, trunk)?;
    let trunk_px = match sketch.strokes[trunk].is_trunk {
        true => placed[0].points_px.clone(),
        false => Vec::new(),
    };
    let has_radii = tell_widths(&sketch.strokes);
    let mut tree = TreeOfStrokes {
        same_px: SAME_PLACE * height_px(&sketch.strokes),
        ..TreeOfStrokes::on_foot(placed[0].points_px[0])
    };
    let straight_px = STRAIGHT_PX * f64::from(sketch.size.width) / 640.0;
    let mut begins = vec![NodeId(0); placed.len()];
    for (number, stroke) in placed.iter().enumerate() {
        let radius = match sketch.strokes[stroke.stroke].width_px {
            Some(width_px) if has_radii => 0.5 * width_px,
            _ => 0.0,
        };
        let first = tree.nodes.len();
        tree.add(stroke, begins[number], straight_px, &mut begins)?;
        for node in &mut tree.nodes[first..] {
            node.radius = radius;
        }
    }
    if let Some(above) = tree.nodes.get(1).map(|n| n.radius) {
        tree.nodes[0].radius = above;
    }
    Ok(FlatTree {
        skeleton: Skeleton {
            nodes: tree.nodes,
            foot_px: tree.foot_px,
            image_size: sketch.size,
        },
        has_radii,
        trunk_px,
        crown_px: sketch.crown_px.clone(),
    })
}

/// The marked stroke, or else the one with the lowest end, the first of equals.
fn trunk_of(strokes: &[Stroke]) -> Option<usize> {
    let marked = strokes.iter().position(|s| s.is_trunk);
    let lowest = (0..strokes.len()).min_by(|a, b| {
        let [a, b] = [a, b].map(|s| lowest_end_v(&strokes[*s].points_px));
        b.total_cmp(&a)
    });
    marked.or(lowest)
}

fn lowest_end_v(points_px: &[Point2<f64>]) -> f64 {
    let ends = points_px.first().into_iter().chain(points_px.last());
    ends.map(|p| p.y).fold(f64::NEG_INFINITY, f64::max)
}

/// Whether the widths of strokes say how thick branches are: all are known, and they differ. One pen
/// for all says nothing.
fn tell_widths(strokes: &[Stroke]) -> bool {
    let widths: Vec<f64> = strokes.iter().filter_map(|s| s.width_px).collect();
    let first = widths.first().copied().unwrap_or(0.0);
    widths.len() == strokes.len() && widths.iter().any(|w| (w - first).abs() > 1e-3 * first)
}

/// A stroke that has its place in the tree.
#[derive(Clone, Debug)]
struct Placed {
    stroke: usize,
    /// From where it begins on its carrier, or from the foot, to its tip.
    points_px: Vec<Point2<f64>>,
    /// Where others begin on it, each by its place among the placed.
    joints: Vec<Joint>,
}

impl Placed {
    /// The joints in their order along the stroke: those that are nearer to an end of it, or to the
    /// one before, than `same_px` are moved there.
    fn snapped_joints(&self, same_px: f64) -> Vec<Joint> {
        let pieces = self.points_px.windows(2);
        let length_px: f64 = pieces.map(|pair| (pair[1] - pair[0]).norm()).sum();
        let mut joints = self.joints.clone();
        joints.sort_by(|a, b| a.along_px.total_cmp(&b.along_px));
        let mut before_px = 0.0;
        for joint in &mut joints {
            if joint.along_px > length_px - same_px {
                joint.along_px = length_px;
            } else if joint.along_px < before_px + same_px {
                joint.along_px = before_px;
            }
            before_px = joint.along_px;
        }
        joints
    }
}

/// A place of a stroke at which another one begins.
#[derive(Clone, Copy, Debug)]
struct Joint {
    along_px: f64,
    begins: usize,
}

/// How a stroke may begin on one that is placed.
#[derive(Clone, Copy, Debug)]
struct Beginning {
    carrier: usize,
    along_px: f64,
    at_px: Point2<f64>,
    /// From the carrier's edge.
    off_px: f64,
}

/// The nearest beginnings of a stroke that is not placed yet: with its first and with its last
/// point.
#[derive(Clone, Copy, Debug, Default)]
struct Nearest {
    by_first: Option<Beginning>,
    by_last: Option<Beginning>,
}

/// All strokes from the trunk on, each after the one that carries it.
fn placed_strokes(sketch: &Sketch, trunk: usize) -> Result<Vec<Placed>, ImportError> {
    let strokes = &sketch.strokes;
    let height_px = height_px(strokes);
    let (reach_px, same_px) = (REACH * height_px, SAME_PLACE * height_px);
    let mut trunk_px = strokes[trunk].points_px.clone();
    // v grows downwards.
    if let [first, .., last] = trunk_px[..]
        && first.y < last.y
    {
        trunk_px.reverse();
    }
    let mut placed = vec![Placed {
        stroke: trunk,
        points_px: trunk_px,
        joints: Vec::new(),
    }];
    let mut waiting: Vec<usize> = (0..strokes.len()).filter(|s| *s != trunk).collect();
    let mut nearest = vec![Nearest::default(); strokes.len()];
    while !waiting.is_empty() {
        let newest = placed.len() - 1;
        let half_px = strokes[placed[newest].stroke].width_px.unwrap_or(0.0) / 2.0;
        for stroke in &waiting {
            let points_px = &strokes[*stroke].points_px;
            nearest[*stroke].look_at(points_px, &placed[newest], newest, half_px);
        }
        let next = next_to_place(&waiting, &nearest, reach_px)
            .ok_or_else(|| apart(strokes, &waiting, &nearest, reach_px))?;
        waiting.retain(|s| *s != next.stroke);
        placed[next.begins.carrier].joints.push(Joint {
            along_px: next.begins.along_px,
            begins: newest + 1,
        });
        placed.push(Placed {
            stroke: next.stroke,
            points_px: next.line_from_carrier(&strokes[next.stroke].points_px, same_px),
            joints: Vec::new(),
        });
    }
    Ok(placed)
}

fn height_px(strokes: &[Stroke]) -> f64 {
    let (mut top, mut bottom) = (f64::INFINITY, f64::NEG_INFINITY);
    for point in strokes.iter().flat_map(|s| &s.points_px) {
        (top, bottom) = (top.min(point.y), bottom.max(point.y));
    }
    (bottom - top).max(0.0)
}

impl Nearest {
    /// Takes in a stroke that was placed as number `carrier`; it is drawn `half_px` wide to either
    /// side.
    fn look_at(
        &mut self,
        points_px: &[Point2<f64>],
        placed: &Placed,
        carrier: usize,
        half_px: f64,
    ) {
        let ends = [points_px.first(), points_px.last()];
        for (known, end) in [&mut self.by_first, &mut self.by_last]
            .into_iter()
            .zip(ends)
        {
            let begins = end.and_then(|end| Beginning::on(placed, carrier, half_px, *end));
            let is_nearer = |b: &Beginning| known.is_none_or(|known| b.off_px < known.off_px);
            *known = begins.filter(is_nearer).or(*known);
        }
    }
}

impl Beginning {
    /// The place of a stroke that is nearest to `end`.
    fn on(placed: &Placed, carrier: usize, half_px: f64, end: Point2<f64>) -> Option<Self> {
        let mut nearest: Option<Self> = None;
        let mut before_px = 0.0;
        for pair in placed.points_px.windows(2) {
            let way = pair[1] - pair[0];
            let length_sq = way.norm_squared().max(f64::MIN_POSITIVE);
            let share = ((end - pair[0]).dot(&way) / length_sq).clamp(0.0, 1.0);
            let at_px = pair[0] + way * share;
            let off_px = ((end - at_px).norm() - half_px).max(0.0);
            if nearest.is_none_or(|known| off_px < known.off_px) {
                nearest = Some(Self {
                    carrier,
                    along_px: before_px + share * way.norm(),
                    at_px,
                    off_px,
                });
            }
            before_px += way.norm();
        }
        nearest
    }
}

/// The stroke that is placed next.
#[derive(Clone, Copy, Debug)]
struct Next {
    stroke: usize,
    begins: Beginning,
    /// It was drawn from its tip to its base.
    is_turned: bool,
}

/// Of the strokes whose first point is near enough that with the nearest; where there are none, by
/// their last points.
fn next_to_place(waiting: &[usize], nearest: &[Nearest], reach_px: f64) -> Option<Next> {
    let mut best: Option<Next> = None;
    for is_turned in [false, true] {
        for stroke in waiting.iter().copied() {
            let begins = match is_turned {
                false => nearest[stroke].by_first,
                true => nearest[stroke].by_last,
            };
            let is_better = |b: &Beginning| {
                b.off_px <= reach_px && best.is_none_or(|best| b.off_px < best.begins.off_px)
            };
            if let Some(begins) = begins.filter(is_better) {
                best = Some(Next {
                    stroke,
                    begins,
                    is_turned,
                });
            }
        }
        if best.is_some() {
            break;
        }
    }
    best
}

impl Next {
    /// The points of the stroke from its place on its carrier to its tip.
    /// A first point that is nearer to that than `same_px` is left out.
    fn line_from_carrier(&self, points_px: &[Point2<f64>], same_px: f64) -> Vec<Point2<f64>> {
        let mut line = points_px.to_vec();
        if self.is_turned {
            line.reverse();
        }
        // The last point stays, or a short stroke were none.
        let near = |p: &&Point2<f64>| (**p - self.begins.at_px).norm() < same_px;
        let same = line[..line.len() - 1].iter().take_while(near).count();
        line.splice(..same, [self.begins.at_px]);
        line
    }
}

/// The error for strokes that begin nowhere: of the first of them.
fn apart(strokes: &[Stroke], waiting: &[usize], nearest: &[Nearest], reach_px: f64) -> ImportError {
    let first = waiting.first().copied().unwrap_or(0);
    let of_first = nearest[first];
    let ends = [of_first.by_first, of_first.by_last];
    let offs = ends.iter().flatten().map(|b| b.off_px);
    ImportError::Apart {
        stroke: strokes[first].name.clone(),
        off_px: offs.fold(f64::INFINITY, f64::min),
        reach_px,
    }
}

/// The tree while strokes are added.
struct TreeOfStrokes {
    nodes: Vec<Node>,
    foot_px: Point2<f64>,
    /// How near strokes begin at one place.
    same_px: f64,
}

/// A stroke with the places where others begin among its points.
struct Line {
    points_px: Vec<Point2<f64>>,
    /// Which of them are forks, and which joints are there.
    forks: Vec<Fork>,
}

struct Fork {
    point: usize,
    joints: Vec<usize>,
}

impl TreeOfStrokes {
    fn on_foot(foot_px: Point2<f64>) -> Self {
        Self {
            nodes: vec![flat_node(0, None, 0, foot_px, foot_px)],
            foot_px,
            same_px: 0.0,
        }
    }

    /// Adds the nodes of a stroke that begins at the node `from`; `begins` takes the nodes at which
    /// others begin on it.
    fn add(
        &mut self,
        stroke: &Placed,
        from: NodeId,
        straight_px: f64,
        begins: &mut [NodeId],
    ) -> Result<(), ImportError> {
        let line = Line::of(stroke, self.same_px);
        let fixed: Vec<usize> = line.forks.iter().map(|f| f.point).collect();
        let kept = corners(&line.points_px, &fixed, straight_px);
        let last = line.points_px.len() - 1;
        let mut below = from;
        let mut bends: Vec<usize> = Vec::new();
        for point in kept.into_iter().skip(1) {
            let fork = line.forks.iter().find(|f| f.point == point);
            if fork.is_none() && point != last {
                bends.push(point);
                continue;
            }
            below = self.add_piece(&line, below, &bends, point)?;
            bends.clear();
            if let Some(fork) = fork {
                self.nodes[below.index()].certainty = 1.0;
                for joint in &fork.joints {
                    begins[*joint] = below;
                }
            }
        }
        // What begins where the stroke does.
        for fork in line.forks.iter().filter(|f| f.point == 0) {
            for joint in &fork.joints {
                begins[*joint] = from;
            }
        }
        Ok(())
    }

    /// Adds the piece of a stroke from the node `below` over `bends` to its point `end`.
    fn add_piece(
        &mut self,
        line: &Line,
        below: NodeId,
        bends: &[usize],
        end: usize,
    ) -> Result<NodeId, ImportError> {
        let level = usize::from(self.nodes[below.index()].level) + 1;
        refuse_more("forks on one way", level, MOST_LEVELS)?;
        let mover = NodeId((self.nodes.len() + bends.len()) as u32);
        let mut parent = below;
        for point in bends.iter().chain([&end]) {
            let name = self.nodes.len();
            let at_px = line.points_px[*point];
            let mut node = flat_node(name, Some(parent), level as u8, at_px, self.foot_px);
            parent = NodeId(name as u32);
            node.moves_with = (parent != mover).then_some(mover);
            self.nodes.push(node);
        }
        Ok(mover)
    }
}

impl Line {
    fn of(stroke: &Placed, same_px: f64) -> Self {
        let joints = stroke.snapped_joints(same_px);
        let mut line = Self {
            points_px: vec![stroke.points_px[0]],
            forks: Vec::new(),
        };
        let mut next = joints.into_iter().peekable();
        let mut before_px = 0.0;
        for pair in stroke.points_px.windows(2) {
            let way = pair[1] - pair[0];
            let after_px = before_px + way.norm();
            while let Some(joint) = next.next_if(|j| j.along_px <= after_px) {
                let share = (joint.along_px - before_px) / way.norm().max(f64::MIN_POSITIVE);
                line.fork(pair[0] + way * share.clamp(0.0, 1.0), joint.begins);
            }
            line.go_to(pair[1]);
            before_px = after_px;
        }
        // By rounding a joint may lie behind the end.
        for joint in next {
            let end_px = line.points_px[line.points_px.len() - 1];
            line.fork(end_px, joint.begins);
        }
        line
    }

    /// Goes on to the next point of the stroke. A fork just before its end is at its end.
    fn go_to(&mut self, point_px: Point2<f64>) {
        if (self.points_px[self.points_px.len() - 1] - point_px).norm() >= SAME_POINT_PX {
            self.points_px.push(point_px);
        }
    }

    /// Lets another stroke begin at a place behind all points so far.
    fn fork(&mut self, at_px: Point2<f64>, begins: usize) {
        self.go_to(at_px);
        let point = self.points_px.len() - 1;
        match self.forks.iter_mut().find(|f| f.point == point) {
            Some(fork) => fork.joints.push(begins),
            None => self.forks.push(Fork {
                point,
                joints: vec![begins],
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    fn stroke(name: &str, points: &[[f64; 2]]) -> Stroke {
        Stroke {
            name: name.into(),
            points_px: points.iter().copied().map(Point2::from).collect(),
            is_trunk: false,
            width_px: None,
        }
    }

    /// A trunk that is drawn from its top, a limb on either side, a twig on the right one, drawn
    /// from its tip, and one on the end of the trunk.
    fn drawn() -> Sketch {
        Sketch {
            size: Size::new(640, 480),
            strokes: vec![
                stroke("twig", &[[470.0, 160.0], [440.0, 201.0]]),
                stroke("left", &[[319.0, 301.0], [200.0, 240.0]]),
                stroke("right", &[[321.0, 300.0], [400.0, 200.0], [480.0, 200.0]]),
                stroke("trunk", &[[320.0, 200.0], [320.0, 450.0]]),
                stroke("top", &[[320.0, 201.0], [330.0, 100.0]]),
            ],
            crown_px: Vec::new(),
        }
    }

    fn ends(tree: &FlatTree) -> Vec<[f64; 2]> {
        let places = tree.skeleton.nodes.iter().map(|n| n.position);
        places.map(|p| [p.x, p.y].map(f64::round)).collect()
    }

    #[test]
    fn strokes_are_joined_where_they_meet() {
        let tree = joined(&drawn()).expect("a tree");
        assert_eq!(tree.skeleton.foot_px, Point2::new(320.0, 450.0));
        let ends = ends(&tree);
        // Each place, the one that it hangs on, and its level. The limbs leave the trunk at one.
        for (end, below, level) in [
            ([0.0, 150.0], [0.0, 0.0], 1),
            ([0.0, 250.0], [0.0, 150.0], 2),
            ([-120.0, 210.0], [0.0, 150.0], 2),
            ([80.0, 250.0], [0.0, 150.0], 2),
            ([120.0, 250.0], [80.0, 250.0], 2),
            ([160.0, 250.0], [120.0, 250.0], 3),
            ([10.0, 350.0], [0.0, 250.0], 3),
            ([150.0, 290.0], [120.0, 250.0], 3),
        ] {
            let node = ends.iter().position(|e| {
                let [dx, dy] = [e[0] - end[0], e[1] - end[1]];
                dx.hypot(dy) < 1.5
            });
            let node = &tree.skeleton.nodes[node.unwrap_or_else(|| panic!("{end:?}: {ends:?}"))];
            let parent = ends[node.parent.expect("not the foot").index()];
            let [dx, dy] = [parent[0] - below[0], parent[1] - below[1]];
            assert!(dx.hypot(dy) < 1.5, "{end:?} hangs on {parent:?}");
            assert_eq!(node.level, level, "{end:?}");
        }
        assert_eq!(ends.len(), 9, "{ends:?}");
        assert!(tree.trunk_px.is_empty() && !tree.has_radii);
    }

    /// The corner of the right limb is a bend of it where nothing begins there.
    #[test]
    fn corners_are_bends_and_points_along_a_line_are_none() {
        let mut sketch = drawn();
        sketch.strokes.remove(0);
        sketch.strokes[0]
            .points_px
            .insert(1, Point2::new(260.0, 270.2));
        let tree = joined(&sketch).expect("a tree");
        let bends = (0..tree.skeleton.nodes.len() as u32).map(NodeId);
        let bends: Vec<NodeId> = bends.filter(|n| tree.skeleton.is_bend(*n)).collect();
        assert_eq!(bends.len(), 1);
        assert_eq!(ends(&tree)[bends[0].index()], [80.0, 250.0]);
        let mover = tree.skeleton.mover(bends[0]);
        assert_eq!(ends(&tree)[mover.index()], [160.0, 250.0]);
    }

    /// A wide trunk is met at its edge. One pen for all strokes says nothing of thickness.
    #[test]
    fn widths_count_where_they_differ() {
        let mut sketch = drawn();
        for stroke in &mut sketch.strokes {
            stroke.width_px = Some(4.0);
        }
        assert!(!joined(&sketch).expect("a tree").has_radii);
        sketch.strokes[3].width_px = Some(60.0);
        sketch.strokes[1].points_px[0].x = 285.0;
        let tree = joined(&sketch).expect("a tree");
        assert!(tree.has_radii);
        let nodes = &tree.skeleton.nodes;
        assert_eq!((nodes[0].radius, nodes[1].radius), (30.0, 30.0));
        let left = nodes
            .iter()
            .position(|n| n.position.x == -120.0)
            .expect("left");
        assert_eq!(nodes[left].radius, 2.0);
    }

    #[test]
    fn a_marked_trunk_is_one_also_if_another_stroke_ends_lower() {
        let mut sketch = drawn();
        sketch.strokes[3].is_trunk = true;
        sketch
            .strokes
            .push(stroke("root", &[[320.0, 440.0], [340.0, 470.0]]));
        let tree = joined(&sketch).expect("a tree");
        assert_eq!(tree.trunk_px.first(), Some(&Point2::new(320.0, 450.0)));
    }

    #[test]
    fn strokes_that_do_not_meet_are_named() {
        let mut sketch = drawn();
        let off = [[100.0, 100.0], [60.0, 60.0]];
        sketch.strokes.push(stroke("far away", &off));
        let Err(ImportError::Apart { stroke, off_px, .. }) = joined(&sketch) else {
            panic!("joined");
        };
        assert_eq!(stroke, "far away");
        assert!((100.0..200.0).contains(&off_px), "{off_px}");
    }

    /// Strokes that lie on each other, go round, or have no length to speak of.
    #[test]
    fn odd_strokes_neither_hang_nor_panic() {
        let mut sketch = drawn();
        let twin = sketch.strokes[2].clone();
        sketch.strokes.push(twin);
        sketch
            .strokes
            .push(stroke("dot", &[[320.0, 250.0], [320.2, 250.0]]));
        let round = [
            [320.0, 260.0],
            [350.0, 250.0],
            [320.0, 240.0],
            [320.0, 260.0],
        ];
        sketch.strokes.push(stroke("round", &round));
        sketch
            .strokes
            .push(stroke("foot", &[[320.0, 450.0], [300.0, 470.0]]));
        let tree = joined(&sketch).expect("a tree");
        for (i, node) in tree.skeleton.nodes.iter().enumerate() {
            assert!(node.parent.is_none_or(|p| p.index() < i));
            assert!(node.position.iter().all(|x| x.is_finite()));
        }
    }
}
