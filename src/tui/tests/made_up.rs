//! States of a capture that never was.

use crate::model::{
    AngleSpectrum, Angles, BranchRow, BranchSway, Excitation, FormatNote, Interval, JointPose,
    Node, NodeId, NodeName, Phase, Pose, Rgb, Size, Skeleton, Snapshot, Sway, SwayNow,
    Unidentified,
};
use nalgebra::{Point3, UnitQuaternion, Vector3};
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

/// A trunk with three forks of two branches each, and a copy of the first fork turned by a right
/// angle.
pub fn skeleton() -> Skeleton {
    let node = |parent: u32, level, x: f64, y: f64, z: f64, copy_of: Option<u32>| Node {
        name: NodeName(0),
        parent: (level > 0).then_some(NodeId(parent)),
        level,
        position: Point3::new(x, y, z),
        radius: 8.0 / (1.0 + level as f64),
        n_tracks: if copy_of.is_some() { 0 } else { 40 },
        certainty: 0.75,
        copy_of: copy_of.map(NodeId),
        plane_angle: if copy_of.is_some() { 1.57 } else { 0.0 },
        kind: Default::default(),
    };
    let mut nodes = vec![
        node(0, 0, 0.0, 0.0, 0.0, None),
        node(0, 1, 5.0, 150.0, 0.0, None),
    ];
    for (i, x) in [-70.0, 10.0, 80.0].into_iter().enumerate() {
        let fork = nodes.len() as u32;
        nodes.push(node(
            1,
            2,
            x,
            220.0 + 30.0 * i as f64,
            20.0 * i as f64,
            None,
        ));
        nodes.push(node(fork, 3, x - 30.0, 300.0, 40.0, None));
        nodes.push(node(fork, 3, x + 30.0, 310.0, -30.0, None));
    }
    let copy = nodes.len() as u32;
    nodes.push(node(1, 2, 0.0, 220.0, -70.0, Some(2)));
    nodes.push(node(copy, 3, 40.0, 300.0, -100.0, Some(3)));
    (0..)
        .zip(&mut nodes)
        .for_each(|(i, n)| n.name = NodeName(i));
    Skeleton {
        nodes,
        foot_px: [320.0, 350.0],
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

/// A state in this phase; what a phase has not reached yet is empty.
pub fn snapshot(phase: Phase) -> Snapshot {
    let reached = |p: Phase| {
        Phase::ALL.iter().position(|q| *q == phase) >= Phase::ALL.iter().position(|q| *q == p)
    };
    let skeleton = skeleton();
    let node_colour = [
        None,
        None,
        Some(0),
        Some(0),
        Some(0),
        Some(1),
        Some(1),
        Some(1),
        Some(2),
        Some(2),
        Some(2),
    ];
    let mut s = Snapshot {
        source: "/dev/video0".to_owned(),
        format: FormatNote {
            asked: "MJPG 1280x720 @ 30".to_owned(),
            given: "YUYV 640x360 @ 30".to_owned(),
        },
        phase,
        progress: 0.62,
        frame: 1234,
        time_s: 41.1,
        sensor_rate_hz: 29.97,
        work_rate_hz: 29.93,
        lost_in_camera: 3,
        not_shown: 45,
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
    if reached(Phase::Detect) {
        s.outline_px = vec![[220, 340], [200, 60], [330, 20], [450, 80], [420, 340]];
    }
    if reached(Phase::Accumulate) {
        s.tracks_alive = 312;
        s.lost_per_s = 0.4;
        s.fb_error_px = 0.12;
        s.error_px = Some(0.94);
        s.candidates_px = (0..12)
            .map(|i| [230.0 + 17.0 * i as f32, 70.0 + (i * 53 % 230) as f32])
            .collect();
        s.fb_history_px = (0..120)
            .map(|i| 0.15 + 0.1 * (i as f64 * 0.3).sin())
            .collect();
        let branch = |i: u32| reached(Phase::Live).then_some((i % 3) as u8);
        s.points = (0..60)
            .map(|i| {
                (
                    [240.0 + 3.0 * i as f32, 60.0 + (i * 37 % 250) as f32],
                    branch(i),
                )
            })
            .collect();
    }
    if reached(Phase::Live) {
        s.branches = (1..11)
            .map(|node| BranchRow {
                node: NodeName(node),
                colour: node_colour[node as usize],
                level: skeleton.nodes[node as usize].level,
                n_tracks: 312 / node,
                amplitude_px: 0.4 * node as f64,
            })
            .collect();
        s.sway = Some(Arc::new(sway()));
        s.angles = angles();
        s.pose = Some(Arc::new(pose(&skeleton)));
        s.skeleton = Some(Arc::new(skeleton));
        s.node_colour = Arc::new(node_colour.to_vec());
        s.progress = 1.0;
    }
    s
}

/// Ten branches, of which some have no frequency, for every reason that there is.
pub fn sway() -> SwayNow {
    let about = |value: f64, share: f64| Interval {
        value,
        lo: value * (1.0 - share),
        hi: value * (1.0 + share),
    };
    let known = |node: u32| Sway {
        frequency_hz: about(
            0.31 + 0.11 * f64::from(node),
            0.001 * f64::from(node * node),
        ),
        damping_ratio: (node != 2).then(|| about(0.02 + 0.003 * f64::from(node), 0.2)),
        excitation: Excitation::Release,
        amplitude_deg: 0.7 * f64::from(node),
    };
    let branch = |node: u32| {
        let swaying = match node {
            1..=3 => Ok(known(node)),
            _ => Err(Unidentified::ALL[node as usize - 4]),
        };
        let at = |hz: f64| {
            swaying.map_or(0.1, |s| {
                0.1 + 1.0 / (1.0 + (40.0 * (hz - s.frequency_hz.value)).powi(2))
            })
        };
        let amplitude_deg = (0..160)
            .map(|k| at(f64::from(k) / 32.0) as f32 + if k < 3 { 2.0 } else { 0.0 })
            .collect();
        (
            NodeName(node),
            BranchSway {
                swaying,
                spectrum: Some(AngleSpectrum {
                    bin_hz: 1.0 / 32.0,
                    amplitude_deg,
                }),
            },
        )
    };
    SwayNow {
        frame: 1200,
        time_s: 40.0,
        span_s: 40.0,
        excitation: Some(Excitation::Release),
        branches: (1..11).map(branch).collect(),
    }
}

/// Ten branches that sway a little faster each.
fn angles() -> Angles {
    let row = |k: u32| {
        let t = 21.1 + f64::from(k) / 30.0;
        let at = |node: u32| {
            10.0 * f64::from(node) + 4.0 * (f64::from(node) * 0.4 * std::f64::consts::TAU * t).sin()
        };
        (t, (1..11).map(|node| at(node) as f32).collect())
    };
    Angles {
        nodes: (1..11).map(NodeName).collect(),
        rows: (0..601).map(row).collect(),
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
    s.candidates_px = vec![[f32::NAN, f32::INFINITY], [-1e30, 1e30]];
    s.fb_history_px = vec![f64::NAN, 1e300, -1.0, f64::INFINITY, 3.0];
    s.progress = f64::NAN;
    s.points = vec![
        ([f32::NAN, 1.0], Some(255)),
        ([1e30, -1e30], Some(7)),
        ([f32::INFINITY, 0.0], None),
    ];
    s.outline_px = vec![[i32::MIN, i32::MAX], [i32::MAX, i32::MAX], [0, i32::MIN]];
    s.messages = vec!["word ".repeat(200), "x".repeat(500)];
    s.branches = (0..5000)
        .map(|node| BranchRow {
            node: NodeName(u32::MAX - node),
            colour: None,
            level: 255,
            n_tracks: u32::MAX,
            amplitude_px: 1e300,
        })
        .collect();
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
    sway.branches = [(
        NodeName(u32::MAX),
        BranchSway {
            swaying: Ok(all),
            spectrum: Some(spectrum),
        },
    )]
    .into();
    s.sway = Some(Arc::new(sway));
    let rows = [f32::NAN, f32::INFINITY, 1e30, -1e30]
        .into_iter()
        .zip(0..)
        .map(|(x, t)| (f64::from(t), [x].into()));
    s.angles = Angles {
        nodes: [NodeName(u32::MAX)].into(),
        rows: rows.collect(),
    };
    let mut skeleton = skeleton();
    skeleton.nodes[3].position.x = f64::NAN;
    skeleton.nodes[4].position.y = 1e300;
    skeleton.nodes[5].parent = Some(NodeId(u32::MAX));
    s.pose = Some(Arc::new(Pose {
        frame: 0,
        time_s: 0.0,
        joints: Vec::new(),
    }));
    s.skeleton = Some(Arc::new(skeleton));
    s
}
