//! Outline, points, tree and poses as messages that viewers know how to draw.

use super::wire::Message;
use crate::model::{CameraMotion, NodeId, Outline, Pose, Skeleton, TrackSet};
use nalgebra::Point2;
use serde::Serialize;

/// Frames of reference: what viewers stand on (z up), and the tree's own axes (y up).
const WORLD: &str = "world";
const TREE: &str = "tree";
/// Red, green, blue, opacity.
const OUTLINE_COLOUR: [f64; 4] = [1.0, 0.8, 0.2, 1.0];
const POINT_COLOUR: [f64; 4] = [0.2, 0.9, 0.4, 1.0];
const BRANCH_COLOUR: [f64; 4] = [0.55, 0.4, 0.25, 1.0];
/// Values of the schemas' enumerations.
const POINTS: i64 = 1;
const LINE_LOOP: i64 = 2;
const LINE_LIST: i64 = 2;

pub(super) fn outline(outline: &Outline, time_ns: u64, into: &mut Vec<u8>) {
    let corners = outline.polygon_px.iter().map(|p| p.cast());
    annotation(LINE_LOOP, corners, OUTLINE_COLOUR, 2.0, time_ns, into);
}

pub(super) fn points(tracks: &TrackSet, time_ns: u64, into: &mut Vec<u8>) {
    let observations = tracks.observations.iter();
    let points = observations.map(|o| tracks.filmed_px(o));
    annotation(POINTS, points, POINT_COLOUR, 4.0, time_ns, into);
}

fn annotation(
    kind: i64,
    points: impl Iterator<Item = Point2<f64>>,
    colour: [f64; 4],
    thickness: f64,
    time_ns: u64,
    into: &mut Vec<u8>,
) {
    into.clear();
    let mut message = Message(into);
    message.timestamp(5, time_ns);
    message.sub(2, |a| {
        a.timestamp(1, time_ns);
        a.int(2, kind);
        points.for_each(|p| a.doubles(3, p.coords.as_slice()));
        a.doubles(4, &colour);
        a.double(7, thickness);
    });
}

/// The tree as it stands in this frame: a line for each measured branch.
pub(super) fn scene(skeleton: &Skeleton, pose: &Pose, time_ns: u64, into: &mut Vec<u8>) {
    into.clear();
    let measured = skeleton.measured().min(pose.joints.len());
    Message(into).sub(2, |entity| {
        entity.timestamp(1, time_ns);
        entity.text(2, TREE);
        entity.text(3, TREE);
        entity.sub(11, |lines| {
            lines.int(1, LINE_LIST);
            lines.double(3, 2.0);
            lines.int(4, 1); // as wide on the screen however far away
            pose.joints[..measured]
                .iter()
                .for_each(|j| lines.doubles(5, j.position.coords.as_slice()));
            lines.doubles(6, &BRANCH_COLOUR);
            let ends = skeleton.nodes[..measured].iter().enumerate();
            let pairs: Vec<u32> = ends
                .flat_map(|(i, n)| n.parent.map(|p| [p.0, i as u32]))
                .flatten()
                .collect();
            lines.packed_fixed32(8, &pairs);
        });
    });
}

/// Position and rotation of every measured node, exactly.
pub(super) fn transforms(skeleton: &Skeleton, pose: &Pose, time_ns: u64, into: &mut Vec<u8>) {
    into.clear();
    let mut message = Message(into);
    // A quarter turn about x: the tree's y is the world's z.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let upright = [half, 0.0, 0.0, half];
    transform(&mut message, WORLD, TREE, time_ns, [0.0; 3], upright);
    for (node, joint) in skeleton.nodes[..skeleton.measured()]
        .iter()
        .zip(&pose.joints)
    {
        let q = joint.rotation.coords;
        let name = format!("node_{}", node.name.0);
        transform(
            &mut message,
            TREE,
            &name,
            time_ns,
            joint.position.coords.into(),
            [q.x, q.y, q.z, q.w],
        );
    }
}

fn transform(
    message: &mut Message,
    parent: &str,
    child: &str,
    time_ns: u64,
    translation: [f64; 3],
    rotation: [f64; 4],
) {
    message.sub(1, |t| {
        t.timestamp(1, time_ns);
        t.text(2, parent);
        t.text(3, child);
        t.doubles(4, &translation);
        t.doubles(5, &rotation);
    });
}

#[derive(Serialize)]
struct TracksJson {
    frame: u64,
    time_s: f64,
    lost: u32,
    born: u32,
    id: Vec<u32>,
    u_px: Vec<f32>,
    v_px: Vec<f32>,
    camera: CameraJson,
    fb_error_px: Vec<f32>,
    error_px: Vec<Option<f32>>,
    confirmed: Vec<bool>,
    rejected: Vec<u32>,
}

/// The points with their names: annotations have none.
pub(super) fn tracks_json(tracks: &TrackSet, into: &mut Vec<u8>) -> Result<(), serde_json::Error> {
    let o = &tracks.observations;
    let filmed_px: Vec<Point2<f32>> = o.iter().map(|o| tracks.filmed_px(o).cast()).collect();
    into.clear();
    serde_json::to_writer(
        into,
        &TracksJson {
            frame: tracks.frame,
            time_s: tracks.time_s,
            lost: tracks.lost,
            born: tracks.born,
            id: o.iter().map(|o| o.id.0).collect(),
            u_px: filmed_px.iter().map(|at| at.x).collect(),
            v_px: filmed_px.iter().map(|at| at.y).collect(),
            camera: CameraJson::of(&tracks.camera),
            fb_error_px: o.iter().map(|o| o.fb_error_px).collect(),
            error_px: o.iter().map(|o| o.error_px).collect(),
            confirmed: o.iter().map(|o| o.confirmed).collect(),
            rejected: tracks.rejected.iter().map(|id| id.0).collect(),
        },
    )
}

/// The camera's motion: what stands still at a place in the first frame was filmed at `scale` times
/// that, turned about the picture's corner, and shifted.
#[derive(Serialize)]
struct CameraJson {
    shift_u_px: f64,
    shift_v_px: f64,
    roll_deg: f64,
    scale: f64,
    sd_px: Option<f64>,
}

impl CameraJson {
    fn of(camera: &CameraMotion) -> Self {
        let motion = &camera.filmed_from_steady;
        let shift_px = motion.isometry.translation.vector;
        Self {
            shift_u_px: shift_px.x,
            shift_v_px: shift_px.y,
            roll_deg: motion.isometry.rotation.angle().to_degrees(),
            scale: motion.scaling(),
            sd_px: camera.sd_px(),
        }
    }
}

#[derive(Serialize)]
struct SkeletonJson {
    frame: u64,
    time_s: f64,
    foot_px: [f64; 2],
    width: u32,
    height: u32,
    nodes: Vec<NodeJson>,
}

#[derive(Serialize)]
struct NodeJson {
    id: u32,
    parent: Option<u32>,
    level: u8,
    x: f64,
    y: f64,
    z: f64,
    radius: f64,
    n_tracks: u32,
    certainty: f32,
    copy_of: Option<u32>,
}

/// The tree at rest with all that is known of its nodes.
pub(super) fn skeleton_json(
    skeleton: &Skeleton,
    frame: u64,
    time_s: f64,
    into: &mut Vec<u8>,
) -> Result<(), serde_json::Error> {
    let nodes = skeleton.nodes.iter().map(|n| NodeJson {
        id: n.name.0,
        parent: id_of(skeleton, n.parent),
        level: n.level,
        x: n.position.x,
        y: n.position.y,
        z: n.position.z,
        radius: n.radius,
        n_tracks: n.n_tracks,
        certainty: n.certainty,
        copy_of: id_of(skeleton, n.copy_of),
    });
    let all = SkeletonJson {
        frame,
        time_s,
        foot_px: skeleton.foot_px.into(),
        width: skeleton.image_size.width,
        height: skeleton.image_size.height,
        nodes: nodes.collect(),
    };
    into.clear();
    serde_json::to_writer(into, &all)
}

/// The name of a node, by which files call it.
fn id_of(skeleton: &Skeleton, node: Option<NodeId>) -> Option<u32> {
    Some(skeleton.name_of(node?)?.0)
}
