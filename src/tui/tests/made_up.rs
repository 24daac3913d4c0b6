//! States of a capture that never was.

use crate::model::{
    Agreement, AngleSpectrum, Angles, Background, BranchGraph, BranchRow, BranchSway, Excitation,
    FormatNote, Grade, Interval, JointPose, ModeSummary, Node, NodeId, NodeName, Participation,
    Phase, Pose, Rgb, Shake, Size, Skeleton, Snapshot, Sway, SwayNow, Unidentified, Verdict, Wood,
    WoodNode, WoodSight,
};
use nalgebra::{Point2, UnitQuaternion, Vector3};
use std::sync::Arc;

/// A camera picture: bright sky above, dark ground below.
pub fn picture(size: Size) -> Arc<Rgb> {
    let pixels = (0..size.height).flat_map(|v| {
        (0..size.width).flat_map(move |_| {
            if v < size.height * 2 / 3 {
                [170, 200, 240]
            } else {
                [60, 70, 20]
            }
        })
    });
    Arc::new(Rgb {
        size,
        pixels: pixels.collect(),
    })
}

/// A node at a place; its name, level and radius follow from where it stands.
fn node(parent: Option<u32>, place: [f64; 3], copy_of: Option<u32>) -> Node {
    Node {
        radius: 8.0,
        n_tracks: if copy_of.is_some() { 0 } else { 40 },
        certainty: 0.75,
        copy_of: copy_of.map(NodeId),
        plane_angle: if copy_of.is_some() { 1.57 } else { 0.0 },
        ..Node::made_up(0, parent, place)
    }
}

/// A trunk with three forks of two branches each, and a copy of the first fork turned by a right
/// angle.
pub fn skeleton() -> Skeleton {
    let mut nodes = vec![
        node(None, [0.0, 0.0, 0.0], None),
        node(Some(0), [5.0, 150.0, 0.0], None),
    ];
    for (i, x) in [-70.0, 10.0, 80.0].into_iter().enumerate() {
        let fork = nodes.len() as u32;
        let (up, towards) = (220.0 + 30.0 * i as f64, 20.0 * i as f64);
        nodes.push(node(Some(1), [x, up, towards], None));
        nodes.push(node(Some(fork), [x - 30.0, 300.0, 40.0], None));
        nodes.push(node(Some(fork), [x + 30.0, 310.0, -30.0], None));
    }
    let copy = nodes.len() as u32;
    nodes.push(node(Some(1), [0.0, 220.0, -70.0], Some(2)));
    nodes.push(node(Some(copy), [40.0, 300.0, -100.0], Some(3)));
    for i in 1..nodes.len() {
        let parent = nodes[i].parent.map_or(0, |p| p.index());
        nodes[i].level = nodes[parent].level + 1;
        nodes[i].radius = 8.0 / (1.0 + f64::from(nodes[i].level));
    }
    (0..)
        .zip(&mut nodes)
        .for_each(|(i, n)| n.name = NodeName(i));
    Skeleton {
        nodes,
        foot_px: [320.0, 350.0].into(),
        image_size: Size::new(640, 360),
    }
}

/// The skeleton bent a little to the right.
pub fn pose(skeleton: &Skeleton) -> Pose {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, -0.1));
    let joints = skeleton
        .nodes
        .iter()
        .map(|n| JointPose {
            position: rotation * n.position,
            rotation,
        })
        .collect();
    Pose {
        frame: 1234,
        time_s: 41.1,
        joints,
    }
}

/// Whether a phase has come when `now` is.
fn reached(now: Phase, phase: Phase) -> bool {
    let order = [now, phase].map(|p| Phase::ALL.iter().position(|q| *q == p));
    order[0] >= order[1]
}

/// Wood that forks: a trunk that leaves to two sides.
pub fn wood() -> Arc<Wood> {
    let nodes = vec![
        WoodNode::made_up(None, 320.0, 340.0),
        WoodNode::made_up(Some(0), 320.0, 220.0),
        WoodNode::made_up(Some(1), 250.0, 120.0),
        WoodNode::made_up(Some(1), 380.0, 60.0),
    ];
    Arc::new(Wood {
        branches: BranchGraph { nodes },
        ..Wood::default()
    })
}

/// A state in this phase; what a phase has not reached yet is empty.
pub fn snapshot(phase: Phase) -> Snapshot {
    let mut s = Snapshot {
        source: "/dev/video0".to_owned(),
        format: FormatNote {
            asked: "MJPG 1280x720 @ 30".to_owned(),
            given: "YUYV 640x360 @ 30".to_owned(),
        },
        phase,
        progress: 0.62,
        is_live: true,
        frame: 1234,
        time_s: 41.1,
        sensor_rate_hz: 29.97,
        work_rate_hz: 29.93,
        lost_in_camera: 3,
        not_shown: 45,
        background: Some(Background::Seen(Agreement::default())),
        shake: Some(Shake {
            rms_px: 0.63,
            frequency_hz: Some(2.2),
        }),
        latency_p50_ms: 21.4,
        latency_p99_ms: 48.0,
        image_size: Some(Size::new(640, 360)),
        preview: Some(picture(Size::new(320, 180))),
        messages: vec![
            "Camera opened.".to_owned(),
            "Gathering motion: 0.62 of 0.80.".to_owned(),
        ],
        ..Snapshot::default()
    };
    if reached(phase, Phase::Detect) {
        s.outline_px = [[220, 340], [200, 60], [330, 20], [450, 80], [420, 340]]
            .map(Point2::from)
            .to_vec();
    }
    if reached(phase, Phase::Accumulate) {
        add_points(&mut s);
    }
    if reached(phase, Phase::Live) {
        add_tree(&mut s);
    }
    s
}

/// What is not as it should be in a short film of little motion.
fn verdict() -> Verdict {
    Verdict {
        grade: Grade::Poor,
        reasons: vec![
            "moves by 0.2 px only".to_owned(),
            "12 of 30 s filmed".to_owned(),
            "foot cut off".to_owned(),
        ],
        advice: vec![
            "come nearer, or film in more wind".to_owned(),
            "film 18 s more".to_owned(),
            "film the whole tree with its foot".to_owned(),
        ],
    }
}

/// Points that are followed and how well.
fn add_points(s: &mut Snapshot) {
    s.tracks_alive = 312;
    s.verdict = Some(Arc::new(verdict()));
    s.lost_per_s = 0.4;
    s.fb_error_px = 0.12;
    s.error_px = Some(0.94);
    s.candidates_px = (0..12)
        .map(|i| [230.0 + 17.0 * i as f32, 70.0 + (i * 53 % 230) as f32].into())
        .collect();
    s.fb_history_px = (0..120)
        .map(|i| 0.15 + 0.1 * (i as f64 * 0.3).sin())
        .collect();
    for i in 0..60 {
        let place = [240.0 + 3.0 * i as f32, 60.0 + (i * 37 % 250) as f32];
        s.points.push((place.into(), None));
    }
}

/// The tree, its pose and its sway.
fn add_tree(s: &mut Snapshot) {
    let skeleton = skeleton();
    for ((_, branch), i) in s.points.iter_mut().zip(0..) {
        *branch = Some(i % 3);
    }
    (s.wood, s.wood_sight) = (Some(wood()), WoodSight::Seen);
    s.sway = Some(Arc::new(sway()));
    s.angles = angles();
    s.pose = Some(Arc::new(pose(&skeleton)));
    s.show_tree(Arc::new(skeleton.clone()));
    for (i, node) in skeleton.nodes.iter().enumerate().take(11).skip(1) {
        s.branches.push(BranchRow {
            node: node.name,
            name: s.piece_names[i].clone(),
            colour: s.node_colour[i],
            level: node.level,
            n_tracks: 312 / i as u32,
            amplitude_px: 0.4 * i as f64,
        });
    }
    s.progress = 1.0;
}

/// Ten branches, of which some have no frequency, for every reason that there is.
pub fn sway() -> SwayNow {
    SwayNow {
        frame: 1200,
        time_s: 40.0,
        span_s: 40.0,
        excitation: Some(Excitation::Release),
        branches: (1..11)
            .map(|node| (NodeName(node), branch_sway(node)))
            .collect(),
        modes: (1..4).map(mode).collect(),
    }
}

/// Those of the trunk and of a limb, and one of a branch that the tree lacks.
fn mode(number: u32) -> ModeSummary {
    let branch = ["trunk", "limb_1"].get(number as usize - 1);
    ModeSummary {
        mode: number as usize,
        sway: known_sway(number),
        collinearity: Some(0.97),
        points: 40,
        node: branch.map(|_| NodeName(number)),
        is_trunks: number == 1,
        branch: branch.map(|branch| (*branch).to_owned()),
        energy: Vec::new(),
    }
}

/// That of a branch which moves with the trunk, and with a limb.
pub fn moves_with() -> Vec<Participation> {
    vec![part_in(2, 0.75), part_in(1, 0.25)]
}

fn part_in(number: u32, share: f64) -> Participation {
    let mode = mode(number);
    Participation {
        mode: mode.mode,
        frequency_hz: mode.sway.frequency_hz.value,
        branch: mode.branch,
        share,
    }
}

fn branch_sway(node: u32) -> BranchSway {
    let swaying = match node {
        1..=3 => Ok(known_sway(node)),
        _ => Err(Unidentified::ALL[node as usize - 4]),
    };
    let mut amplitude_deg = Vec::new();
    for k in 0..160 {
        let hz = f64::from(k) / 32.0;
        let peak = swaying.map_or(0.0, |s| {
            1.0 / (1.0 + (40.0 * (hz - s.frequency_hz.value)).powi(2))
        });
        amplitude_deg.push((0.1 + peak) as f32 + if k < 3 { 2.0 } else { 0.0 });
    }
    let spectrum = AngleSpectrum {
        bin_hz: 1.0 / 32.0,
        amplitude_deg,
    };
    BranchSway {
        swaying,
        moves_with: match swaying {
            Err(Unidentified::AncestorsSway) => moves_with(),
            _ => Vec::new(),
        },
        spectrum: Some(spectrum),
    }
}

fn known_sway(node: u32) -> Sway {
    let n = f64::from(node);
    Sway {
        frequency_hz: about(0.31 + 0.11 * n, 0.001 * f64::from(node * node)),
        damping_ratio: (node != 2).then(|| about(0.02 + 0.003 * n, 0.2)),
        excitation: Excitation::Release,
        amplitude_deg: 0.7 * n,
    }
}

/// A value with an interval of this share of it either way.
fn about(value: f64, share: f64) -> Interval {
    Interval {
        value,
        lo: value * (1.0 - share),
        hi: value * (1.0 + share),
    }
}

/// Ten branches that sway a little faster each.
fn angles() -> Angles {
    let mut rows = Vec::new();
    for k in 0..601 {
        let t = 21.1 + f64::from(k) / 30.0;
        let mut angles_deg = Vec::new();
        for node in 1..11 {
            let hz = f64::from(node) * 0.4;
            let sway_deg = 4.0 * (hz * std::f64::consts::TAU * t).sin();
            angles_deg.push((10.0 * f64::from(node) + sway_deg) as f32);
        }
        rows.push((t, angles_deg.into()));
    }
    Angles {
        nodes: (1..11).map(NodeName).collect(),
        rows,
    }
}

/// A capture that has gone on for ages and whose every number is out of hand.
pub fn huge() -> Snapshot {
    let mut s = snapshot(Phase::Live);
    s.source =
        "/media/field/recordings/2024-07-13/a very long name of a recording of an old oak.mcap"
            .to_owned();
    s.format.given = "YUYV 16384x16384 @ 1000 and then some more words".to_owned();
    s.frame = u64::MAX;
    s.frames_total = Some(u64::MAX);
    s.time_s = 1e300;
    (s.sensor_rate_hz, s.work_rate_hz) = (f64::INFINITY, 1e12);
    (
        s.lost_in_camera,
        s.dropped_before_tracker,
        s.undecodable,
        s.not_shown,
    ) = (u64::MAX, 123_456, 99_999, 12_345_678);
    (
        s.camera.damaged,
        s.camera.lost_by_sequence,
        s.camera.lost_by_time,
    ) = (u64::MAX, Some(u64::MAX), u64::MAX);
    (s.latency_p50_ms, s.latency_p99_ms) = (123_456.0, 1e99);
    (s.tracks_alive, s.lost_per_s, s.fb_error_px) = (u32::MAX, 1e7, f64::NAN);
    s.error_px = Some(f64::INFINITY);
    s.candidates_px = vec![[f32::NAN, f32::INFINITY].into(), [-1e30, 1e30].into()];
    s.fb_history_px = vec![f64::NAN, 1e300, -1.0, f64::INFINITY, 3.0];
    s.progress = f64::NAN;
    s.points = vec![
        ([f32::NAN, 1.0].into(), Some(255)),
        ([1e30, -1e30].into(), Some(7)),
        ([f32::INFINITY, 0.0].into(), None),
    ];
    let (low, high) = (i32::MIN, i32::MAX);
    s.outline_px = vec![[low, high].into(), [high; 2].into(), [0, low].into()];
    s.strokes_px = vec![
        vec![],
        vec![[f64::NAN; 2], [1e300, -1e300]],
        vec![[0.0; 2]; 9],
    ];
    s.wood = Some(Arc::new(huge_wood()));
    s.messages = vec!["word ".repeat(200), "x".repeat(500)];
    s.verdict = Some(Arc::new(Verdict {
        grade: Grade::Fair,
        reasons: vec!["木".repeat(60); 9],
        advice: vec!["木".repeat(20)],
    }));
    s.branches = (0..5000)
        .map(|node| BranchRow {
            node: NodeName(u32::MAX - node),
            name: format!("limb_{}-{node}", "4294967295.".repeat(40)),
            colour: None,
            level: 255,
            n_tracks: u32::MAX,
            amplitude_px: 1e300,
        })
        .collect();
    s.sway = Some(Arc::new(huge_sway()));
    let rows = [f32::NAN, f32::INFINITY, 1e30, -1e30]
        .into_iter()
        .zip(0..)
        .map(|(x, t)| (f64::from(t), [x].into()));
    s.angles = Angles {
        nodes: [NodeName(u32::MAX)].into(),
        rows: rows.collect(),
    };
    s.pose = Some(Arc::new(Pose {
        frame: 0,
        time_s: 0.0,
        joints: Vec::new(),
    }));
    s.show_tree(Arc::new(broken_skeleton()));
    s
}

fn huge_wood() -> Wood {
    let nodes = vec![
        WoodNode::made_up(None, f64::NAN, 1e300),
        WoodNode::made_up(Some(0), -1e300, 0.0),
        WoodNode::made_up(Some(usize::MAX), 9.0, 9.0),
        WoodNode::made_up(Some(1), 320.0, f64::INFINITY),
    ];
    Wood {
        branches: BranchGraph { nodes },
        ..Wood::default()
    }
}

fn broken_skeleton() -> Skeleton {
    let mut skeleton = skeleton();
    skeleton.nodes[3].position.x = f64::NAN;
    skeleton.nodes[4].position.y = 1e300;
    skeleton.nodes[5].parent = Some(NodeId(u32::MAX));
    skeleton
}

fn huge_sway() -> SwayNow {
    let mut sway = sway();
    let mad = Interval {
        value: 1e300,
        lo: f64::NEG_INFINITY,
        hi: f64::NAN,
    };
    let all = Sway {
        frequency_hz: mad,
        damping_ratio: Some(mad),
        excitation: Excitation::Wind,
        amplitude_deg: f64::NAN,
    };
    let spectrum = AngleSpectrum {
        bin_hz: 0.0,
        amplitude_deg: vec![f32::NAN, f32::INFINITY, -1.0],
    };
    sway.modes = vec![
        ModeSummary {
            sway: all,
            branch: Some("limb_1.".repeat(99)),
            ..mode(1)
        };
        5000
    ];
    sway.branches = [(
        NodeName(u32::MAX),
        BranchSway {
            swaying: Ok(all),
            moves_with: Vec::new(),
            spectrum: Some(spectrum),
        },
    )]
    .into();
    sway
}
