use super::*;
use crate::model::{Size, WoodNode};

const FOOT: Point2<f64> = Point2::new(300.0, 300.0);

fn node(name: u32, parent: Option<u32>, at: [f64; 3], copy_of: Option<u32>) -> Node {
    Node {
        copy_of: copy_of.map(NodeId),
        plane_angle: copy_of.map_or(0.0, |_| 1.0),
        ..Node::made_up(name, parent, at)
    }
}

/// A trunk of 100 px, a limb to each side of its top, and a copy of either.
fn straight() -> Skeleton {
    let nodes = vec![
        node(0, None, [0.0, 0.0, 0.0], None),
        node(1, Some(0), [0.0, 100.0, 0.0], None),
        node(2, Some(1), [100.0, 150.0, 40.0], None),
        node(3, Some(1), [-80.0, 160.0, -20.0], None),
        node(4, Some(1), [50.0, 150.0, 80.0], Some(2)),
        node(5, Some(1), [-40.0, 160.0, -70.0], Some(3)),
    ];
    Skeleton {
        nodes,
        foot_px: FOOT,
        image_size: Size::new(640, 360),
    }
}

fn piece(parent: Option<usize>, x: f64, y: f64) -> WoodNode {
    WoodNode::made_up(parent, FOOT.x + x, FOOT.y - y)
}

/// The right limb leaves the trunk below its top and has a bend and a twig; the left one leaves
/// the top.
fn wood() -> BranchGraph {
    let nodes = vec![
        piece(None, 0.0, 0.0),
        piece(Some(0), 0.0, 60.0),
        piece(Some(1), 0.0, 100.0),
        piece(Some(1), 60.0, 90.0),
        piece(Some(3), 105.0, 150.0),
        piece(Some(3), 90.0, 80.0),
        piece(Some(2), -85.0, 165.0),
    ];
    BranchGraph { nodes }
}

fn points() -> Vec<PointOn> {
    let mut points = Vec::new();
    let mut on = |branch: u32, from: (f64, f64), to: (f64, f64)| {
        for k in 1..=8 {
            let t = f64::from(k) / 9.0;
            let (x, y) = (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1));
            points.push(PointOn {
                node: NodeId(branch),
                rest_px: Point2::new(FOOT.x + x, FOOT.y - y),
            });
        }
    };
    on(1, (0.0, 0.0), (0.0, 100.0));
    on(2, (15.0, 68.0), (60.0, 90.0));
    on(2, (60.0, 90.0), (105.0, 150.0));
    on(3, (0.0, 100.0), (-85.0, 165.0));
    points
}

/// The tree of [`straight`] along some wood.
fn straight_along(wood: &BranchGraph, points: &[PointOn], names: &mut Names) -> Joined {
    let straight = straight();
    along_wood(&straight, &straight, wood, points, names)
}

fn names(prior: Option<&Skeleton>) -> Names<'_> {
    Names { next: 6, prior }
}

#[test]
fn branches_run_along_their_wood_and_fork_where_it_does() {
    let joined = straight_along(&wood(), &points(), &mut names(None));
    let tree = &joined.skeleton;
    let places: Vec<NodeId> = tree.measured_branches().collect();
    let ends: Vec<Point3<f64>> = places
        .iter()
        .map(|p| tree.nodes[p.index()].position)
        .collect();
    assert_eq!(places.len(), 3);
    assert!(
        (ends[0] - Point3::new(0.0, 100.0, 0.0)).norm() < 1e-9,
        "{ends:?}"
    );
    assert!((ends[1].xy() - Point3::new(105.0, 150.0, 0.0).xy()).norm() < 1e-9);
    assert!((ends[2].xy() - Point3::new(-85.0, 165.0, 0.0).xy()).norm() < 1e-9);
    // The right limb begins at a bend of the trunk.
    let begin = tree.begin(places[1]).expect("a beginning");
    assert_eq!(tree.mover(begin), places[0]);
    assert_eq!(tree.nodes[begin.index()].position.y, 60.0);
    assert_eq!(tree.moving_parent(places[2]), Some(places[0]));
    // Its twig, on which no point is, is a rigid part of it.
    let twig = tree
        .nodes
        .iter()
        .position(|n| n.position.y == 80.0)
        .expect("a twig");
    assert_eq!(tree.nodes[twig].moves_with, Some(places[1]));
    assert!(
        tree.nodes
            .iter()
            .enumerate()
            .all(|(i, n)| n.parent.is_none_or(|p| p.index() < i))
    );
    assert_eq!(joined.seen_px.iter().flatten().count(), 6 + 4);
}

/// A bend that kept its original's place would be filmed twice.
#[test]
fn copies_have_the_bends_of_their_originals() {
    let tree = straight_along(&wood(), &points(), &mut names(None)).skeleton;
    let copies: Vec<&Node> = tree.nodes.iter().filter(|n| n.copy_of.is_some()).collect();
    assert_eq!(copies.len(), 4, "{copies:?}");
    for copy in copies {
        let original = &tree.nodes[copy.copy_of.expect("a copy").index()];
        assert_eq!((copy.kind, copy.level), (original.kind, original.level));
        assert_eq!(copy.moves_with.is_some(), original.moves_with.is_some());
        assert!((copy.position - original.position).norm() > 10.0);
    }
    let mut names: Vec<u32> = tree.nodes.iter().map(|n| n.name.0).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), tree.nodes.len());
}

#[test]
fn bends_that_stay_in_place_keep_their_names() {
    let before = straight_along(&wood(), &points(), &mut names(None)).skeleton;
    let mut later = names(Some(&before));
    later.next = 100;
    let after = straight_along(&wood(), &points(), &mut later).skeleton;
    for (before, after) in before.nodes.iter().zip(&after.nodes) {
        assert!(
            before.copy_of.is_some() || before.name == after.name,
            "{after:?}"
        );
    }
}

/// Leaves before the wood, or a limb behind another one.
#[test]
fn a_branch_without_wood_leaves_what_carries_it_without_folding_back() {
    let mut wood = wood();
    wood.nodes.pop();
    let tree = straight_along(&wood, &points(), &mut names(None)).skeleton;
    let left = tree
        .nodes
        .iter()
        .find(|n| n.name == NodeName(3))
        .expect("the left limb");
    assert_eq!(left.position, straight().nodes[3].position);
    let parent = &tree.nodes[left.parent.expect("a parent").index()];
    assert!(
        parent.position.x == 0.0 && parent.position.y >= 60.0,
        "{parent:?}"
    );
}

/// Leaves hide all but the lowest wood.
#[test]
fn a_trunk_that_is_seen_in_part_goes_on_to_its_fork() {
    let mut wood = wood();
    wood.nodes.truncate(2);
    let tree = straight_along(&wood, &points(), &mut names(None)).skeleton;
    let places = tree.foot_and_branches();
    let trunk = &tree.nodes[places[1].index()];
    // Its own points hold it.
    let off = (trunk.position - straight().nodes[1].position).norm();
    assert!(off < 1.0, "{trunk:?}");
    // The right limb's points begin above the bend, the left one's beside the fork. The limb
    // draws the joint a little to its side.
    let joint = &tree.nodes[trunk.parent.expect("a joint").index()];
    assert_eq!(joint.kind, NodeKind::Measured);
    assert_eq!(joint.moves_with, Some(places[1]));
    assert!((65.0..71.0).contains(&joint.position.y), "{joint:?}");
    assert!((0.0..5.0).contains(&joint.position.x), "{joint:?}");
    let bend = &tree.nodes[joint.parent.expect("a bend").index()];
    assert_eq!((bend.kind, bend.position.y), (NodeKind::Traced, 60.0));
    let parent = |branch: usize| tree.nodes[places[branch].index()].parent;
    assert_eq!((parent(2), parent(3)), (trunk.parent, Some(places[1])));
}

/// With no points of its own, a fork goes where its limbs take least wood.
#[test]
fn an_unseen_fork_without_points_stands_lower_where_its_limbs_part_wide() {
    let mut wood = wood();
    wood.nodes.truncate(2);
    let mut points = points();
    points.retain(|p| p.node != NodeId(1));
    let tree = straight_along(&wood, &points, &mut names(None)).skeleton;
    let places = tree.foot_and_branches();
    let trunk = &tree.nodes[places[1].index()];
    assert!((61.0..97.0).contains(&trunk.position.y), "{trunk:?}");
    let tips = [2, 3].map(|branch: usize| tree.nodes[places[branch].index()].position);
    assert_eq!(
        tips,
        [2, 3].map(|branch: usize| straight().nodes[branch].position)
    );
}

/// It hangs on the same branch as its neighbours then, and not on what carries them all.
#[test]
fn a_branch_that_would_turn_back_leaves_a_straight_one_before_its_end() {
    let mut straight = straight();
    straight.nodes.truncate(4);
    // Beyond the middle of the left limb, downwards.
    straight
        .nodes
        .push(node(4, Some(3), [-75.0, 120.0, 0.0], None));
    let mut points = points();
    for k in 0..5 {
        let down = 4.0 * f64::from(k);
        points.push(PointOn {
            node: NodeId(4),
            rest_px: Point2::new(FOOT.x - 75.0, FOOT.y - 140.0 + down),
        });
    }
    let mut wood = wood();
    wood.nodes.pop();
    let tree = along_wood(&straight, &straight, &wood, &points, &mut names(None)).skeleton;
    let places = tree.foot_and_branches();
    let [left, hanging] = [3, 4].map(|branch: usize| &tree.nodes[places[branch].index()]);
    assert_eq!(hanging.parent, left.parent);
    assert_eq!(tree.moving_parent(places[4]), Some(places[3]));
    let joint = tree.nodes[hanging.parent.expect("a joint").index()].position;
    let (arrives, leaves) = (
        joint - Point3::new(0.0, 100.0, 0.0),
        hanging.position - joint,
    );
    assert!(arrives.xy().dot(&leaves.xy()) >= 0.0, "{joint}");
}

#[test]
fn a_trunk_alone_and_wood_without_points_are_no_fault() {
    let mut alone = straight();
    alone.nodes.truncate(2);
    let tree = along_wood(&alone, &alone, &wood(), &[], &mut names(None)).skeleton;
    assert_eq!(tree.measured_branches().count(), 1);
    let none = BranchGraph::default();
    let tree = straight_along(&none, &points(), &mut names(None)).skeleton;
    assert_eq!(tree.measured_branches().count(), 3);
}

/// The left limb as motion shows it to fork halfway: it ends there from now on, and one branch goes on to
/// where it ended.
fn forked() -> Skeleton {
    let mut tree = straight();
    let tip = tree.nodes[3].position;
    tree.nodes[3].position = Point3::new(-40.0, 130.0, -10.0);
    let goes_on = Node {
        kind: NodeKind::Shoot,
        ..node(7, Some(3), tip.into(), None)
    };
    tree.nodes.insert(4, goes_on);
    tree
}

/// A copy that was as long as its limb before beside a limb that ends at its fork reached beyond the
/// tree.
#[test]
fn copies_of_a_limb_that_forks_reach_as_high_as_it_does() {
    let plain = straight();
    let joined = along_wood(&plain, &forked(), &wood(), &points(), &mut names(None));
    let nodes = &joined.skeleton.nodes;
    let measured = joined.skeleton.measured();
    let mut copies = 0;
    for copy in &nodes[measured..] {
        let original = copy.copy_of.expect("a copy").index();
        assert!((copy.position.y - nodes[original].position.y).abs() < 1e-9);
        copies += usize::from(nodes[original].kind == NodeKind::Shoot);
    }
    assert!(copies > 0, "{nodes:?}");
}
