//! Flat skeletons to stand up: those of the public clips, and a made-up one.
#![allow(dead_code)] // not every test file needs all of it

use arborcam::config::Config;
use arborcam::model::{Outline, Size, TimedFrame};
use arborcam::outline::{self, Given};
use arborcam::pipeline::Pipeline;
use arborcam::skeleton::Node2d;
use arborcam::solve::Model;
use arborcam::source;
use nalgebra::Point2;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// What a tree is stood up from.
pub struct Flat {
    pub name: &'static str,
    pub nodes: Vec<Node2d>,
    pub tracks: Vec<u32>,
    pub outline: Outline,
}

impl Flat {
    pub fn shipped() -> Self {
        Self::of_clip(
            "sparse_winter",
            Path::new(super::support::CLIP),
            Path::new(super::support::OUTLINE),
        )
    }

    /// The second public clip.
    pub fn oak() -> Option<Self> {
        let [clip, outline] = oak_clip()?;
        Some(Self::of_clip("oak_release", &clip, &outline))
    }

    fn of_clip(name: &'static str, clip: &Path, outline: &Path) -> Self {
        Self::of_tree(name, &grown(clip, outline))
    }

    /// What a tree was stood up from, with its foot where the tree's is.
    pub fn of_tree(name: &'static str, tree: &Model) -> Self {
        let (mut nodes, tracks) = tree.flat(&Config::default());
        nodes[0].position_px = tree.skeleton.foot_px;
        Self {
            name,
            nodes,
            tracks,
            outline: (*tree.outline_at_rest).clone(),
        }
    }

    /// A binary tree of `levels` levels that forks by some 45 degrees, more or less (`wild`,
    /// radians), in a round crown.
    pub fn generated(levels: u8) -> Self {
        Self::generated_by(levels, 0, 0.2)
    }

    pub fn generated_by(levels: u8, seed: u64, wild: f64) -> Self {
        let node = |parent, level, position_px| Node2d {
            parent,
            level,
            cluster: None,
            position_px,
            certainty: 0.8,
        };
        let mut nodes = vec![
            node(None, 0, Point2::new(320.0, 340.0)),
            node(Some(0), 1, Point2::new(316.0, 240.0)),
        ];
        let mut i = 1;
        while i < nodes.len() {
            let (level, at) = (nodes[i].level, nodes[i].position_px);
            let from = nodes[nodes[i].parent.expect("a parent")].position_px;
            let lean = (at[0] - from[0]).atan2(from[1] - at[1]);
            for side in [-1.0, 1.0].into_iter().filter(|_| level < levels) {
                let wobble =
                    |k: u64| ((i as u64 * 7 + k + 31 * seed) as f64 * 12.9898 + side).sin();
                let turn = lean + side * 0.75 + wild * wobble(1);
                let length = 85.0 * 0.72_f64.powi(i32::from(level) - 1) * (1.0 + 0.2 * wobble(2));
                nodes.push(node(
                    Some(i),
                    level + 1,
                    Point2::new(at.x + length * turn.sin(), at.y - length * turn.cos()),
                ));
            }
            i += 1;
        }
        let round = |k: usize| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / 48.0).sin_cos();
            Point2::new(316.0 + 165.0 * sin, 170.0 + 150.0 * cos)
        };
        let mut border = vec![
            Point2::new(308.0, 340.0),
            Point2::new(332.0, 340.0),
            Point2::new(332.0, 315.0),
        ];
        border.extend((2..47).map(round));
        border.push(Point2::new(308.0, 315.0));
        let outline = outline::from_polygon(&border, Size::new(640, 360)).expect("outline");
        Self {
            name: "generated",
            tracks: carried(&nodes),
            nodes,
            outline,
        }
    }

    /// The same in the outline that was drawn, in a picture in which the tree need not rest.
    pub fn in_drawn_outline(self) -> Self {
        let file = match self.name {
            "sparse_winter" => Some(super::support::OUTLINE.into()),
            "oak_release" => oak_clip().map(|[_, outline]| outline),
            _ => None,
        };
        let Some(file) = file else { return self };
        let given = outline::load(&file, self.outline.size).expect("outline");
        let Given::Region(outline) = given else {
            panic!("a polygon")
        };
        Self { outline, ..self }
    }

    pub fn all() -> Vec<Self> {
        let mut all = vec![Self::generated(6), Self::shipped()];
        all.extend(Self::oak());
        all
    }
}

/// The tree that the whole of a clip gives, refined as it is by default.
pub fn grown(clip: &Path, outline: &Path) -> Arc<Model> {
    let config = Config::default();
    let mut clip = source::open(clip, &config, None).expect("clip");
    let Given::Region(outline) = outline::load(outline, clip.describe().size).expect("outline")
    else {
        panic!("a polygon");
    };
    let mut pipeline = Pipeline::new(&config, Some(outline)).expect("decoder");
    let (mut first_s, mut index) = (None, 0);
    while let Some(raw) = clip.next_frame().expect("frame") {
        let first_s = *first_s.get_or_insert(raw.sensor_time_s);
        let timed = TimedFrame::new(Arc::new(raw), index, first_s, Instant::now());
        pipeline.step(&timed).expect("picture");
        index += 1;
    }
    pipeline.finish();
    pipeline.back.model().expect("a tree").clone()
}

/// Video and outline of the second public clip, `oak_release` below the folder that ARBORCAM_CLIPS
/// names.
pub fn oak_clip() -> Option<[PathBuf; 2]> {
    let Some(clips) = std::env::var_os("ARBORCAM_CLIPS").map(PathBuf::from) else {
        println!("skipped: ARBORCAM_CLIPS does not name a folder with oak_release/video.mkv");
        return None;
    };
    Some(["video.mkv", "outline.json"].map(|name| clips.join("oak_release").join(name)))
}

/// How many points each node carries, if three lie on each.
pub fn carried(nodes: &[Node2d]) -> Vec<u32> {
    let mut carried = vec![3; nodes.len()];
    for (k, node) in nodes.iter().enumerate().rev() {
        if let Some(parent) = node.parent {
            carried[parent] += carried[k];
        }
    }
    carried
}
