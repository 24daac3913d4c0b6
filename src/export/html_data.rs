//! What the HTML page knows of the tree apart from its model.

use crate::document::CaptureNote;
use crate::document::note::Software;
use crate::dynamics::angle_to_parent_deg;
use crate::model::{
    BotanicalBranches, LocalTime, MAIN_BRANCH_RGB, ModeSummary, NodeId, Participation, Pose,
    Skeleton, SwayColumns, Swaying, TreeMode, UserNotes, moves_with, reason,
};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

/// Facts for the page. Lengths in px and angles in degrees, whatever the unit of the model's file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Data {
    /// Name of what was filmed, without the folders that it lay in.
    pub source: String,
    /// Name and version of the program that filmed it.
    pub software: String,
    /// When it was filmed, where that is known, and what the user noted.
    pub captured_at: Option<LocalTime>,
    pub notes: UserNotes,
    /// Metres in a pixel of the model's file; 0 where it is in pixels.
    pub metres_per_px: f64,
    /// Width and height of the picture, px.
    pub image: [u32; 2],
    /// The trunk's foot in the picture, px.
    pub foot_px: [f64; 2],
    /// Corners of the region that was tracked, px; empty if unknown.
    pub outline_px: Vec<[i32; 2]>,
    /// When the picture that goes with the page was taken, s since the first frame.
    pub picture_time_s: Option<f64>,
    /// The animation's begin, s since the first frame, and the time of every pose since then, s.
    pub start_s: f64,
    pub times_s: Vec<f64>,
    /// Colours of main branches (sRGB), taken again from the start after the last one.
    pub main_branch_rgb: [[u8; 3]; MAIN_BRANCH_RGB.len()],
    /// Parents before children, the first without a parent: the foot.
    pub branches: Vec<Branch>,
    /// The modes of the whole tree, the slowest first.
    pub modes: Vec<ModeSummary>,
    /// Of a forest, which has no branches here; `None` for a tree.
    pub forest: Option<ForestFacts>,
}

/// What the page says of a forest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ForestFacts {
    pub trees: u64,
    pub templates: u64,
}

/// How a tree sways.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sways<'a> {
    /// By node index, as for `nodes.csv`; may be shorter than the skeleton.
    pub of_nodes: &'a [Swaying],
    /// The modes of the whole tree, the slowest first.
    pub modes: &'a [TreeMode],
}

/// A branch, named as its end is in `nodes.csv` and in the model's file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Branch {
    pub id: u32,
    /// What its piece of a botanical branch is called, as in the model's file.
    pub name: String,
    /// Botanical order: 0 for the trunk.
    pub order: u32,
    pub parent: Option<u32>,
    /// The measured branch that this one repeats.
    pub copy_of: Option<u32>,
    /// The branch that it is a rigid part of.
    pub moves_with: Option<u32>,
    pub level: u8,
    /// Number of the main branch that it belongs to; `None` for the trunk.
    pub main_branch: Option<u8>,
    pub n_tracks: u32,
    /// Its end at rest, model axes, px.
    pub end: [f64; 3],
    /// What was identified of its sway; numbers that are not known are `null`.
    pub sway: Option<SwayColumns>,
    /// Of a measured branch without a frequency of its own: why, in words, and the modes of the
    /// tree that it moves with, the largest share first.
    pub why: Option<String>,
    pub participation: Vec<Participation>,
    /// Angle to the parent branch at every one of [`Data::times_s`]: hundredths of a degree as
    /// 16-bit integers, little endian, in base64; the lowest integer stands for one that is not
    /// known. `None` for the foot and for copies.
    pub angle_deg: Option<String>,
}

impl Data {
    /// The page's facts. `poses` are those of the animation in the order of time; `metres_per_px` is
    /// that of the model's file.
    pub fn of(
        capture: &CaptureNote,
        skeleton: &Skeleton,
        poses: &[Pose],
        sway: &Sways,
        metres_per_px: f64,
    ) -> Self {
        let size = skeleton.image_size;
        let start_s = poses
            .iter()
            .map(|p| p.time_s)
            .find(|t| t.is_finite())
            .unwrap_or(0.0);
        Self {
            source: capture.source.short_name().to_owned(),
            software: format!("{} {}", capture.software.name, capture.software.version),
            captured_at: capture.captured_at,
            notes: capture.notes.clone(),
            metres_per_px,
            image: [size.width, size.height],
            foot_px: skeleton.foot_px.into(),
            outline_px: capture
                .outline
                .as_ref()
                .map_or_else(Vec::new, |o| o.polygon_px.clone()),
            picture_time_s: capture.picture.as_ref().map(|p| p.time_s),
            start_s: rounded(start_s, 1e6),
            times_s: poses
                .iter()
                .map(|p| rounded(p.time_s - start_s, 1e6))
                .collect(),
            main_branch_rgb: MAIN_BRANCH_RGB,
            branches: branches(skeleton, poses, sway),
            modes: ModeSummary::all(sway.modes, skeleton),
            forest: None,
        }
    }

    /// The facts of a forest whose templates were grown from `example`.
    pub fn of_forest(example: &str, software: &Software, facts: ForestFacts) -> Self {
        Self {
            source: example.to_owned(),
            software: format!("{} {}", software.name, software.version),
            captured_at: None,
            notes: UserNotes::default(),
            metres_per_px: 1.0,
            image: [0, 0],
            foot_px: [0.0; 2],
            outline_px: Vec::new(),
            picture_time_s: None,
            start_s: 0.0,
            times_s: Vec::new(),
            main_branch_rgb: MAIN_BRANCH_RGB,
            branches: Vec::new(),
            modes: Vec::new(),
            forest: Some(facts),
        }
    }
}

fn branches(skeleton: &Skeleton, poses: &[Pose], sway: &Sways) -> Vec<Branch> {
    let facts = Facts {
        skeleton,
        botanical: &skeleton.botanical_branches(),
        main_branches: &skeleton.main_branches(),
        poses,
        sway,
    };
    let ids = (0..skeleton.nodes.len() as u32).map(NodeId);
    ids.map(|id| facts.branch(id)).collect()
}

/// What is known of all branches.
struct Facts<'a> {
    skeleton: &'a Skeleton,
    botanical: &'a BotanicalBranches,
    /// By node.
    main_branches: &'a [Option<u8>],
    poses: &'a [Pose],
    sway: &'a Sways<'a>,
}

impl Facts<'_> {
    fn branch(&self, id: NodeId) -> Branch {
        let i = id.index();
        let node = &self.skeleton.nodes[i];
        let moves = node.parent.is_some() && node.moves_with.is_none();
        let measured = moves && node.copy_of.is_none();
        let sway = self.sway.of_nodes.get(i);
        let answer = sway.filter(|_| measured);
        let participation = answer.map_or(Vec::new(), |sway| {
            moves_with(sway, self.sway.modes, self.botanical, id)
        });
        Branch {
            id: node.name.0,
            name: self.botanical.piece_name(id),
            order: self.botanical.order(id),
            parent: self.name_of(node.parent),
            copy_of: self.name_of(node.copy_of),
            moves_with: self.name_of(node.moves_with),
            level: node.level,
            main_branch: self.main_branches[i],
            n_tracks: node.n_tracks,
            end: [node.position.x, node.position.y, node.position.z].map(|x| rounded(x, 1e4)),
            sway: sway
                .and_then(|s| s.as_ref().ok())
                .map(|s| SwayColumns::of(Some(s))),
            why: answer
                .and_then(|s| s.err())
                .map(|why| reason(why, &participation)),
            participation,
            angle_deg: measured
                .then(|| packed(&angle_to_parent_deg(self.skeleton, self.poses, id))),
        }
    }

    fn name_of(&self, id: Option<NodeId>) -> Option<u32> {
        let name = self.skeleton.name_of(id?)?;
        Some(name.0)
    }
}

/// No more decimals than mean something; 0 for what is no number, which JSON cannot hold.
fn rounded(x: f64, scale: f64) -> f64 {
    let rounded = (x * scale).round() / scale;
    if rounded.is_finite() { rounded } else { 0.0 }
}

fn packed(angles_deg: &[f64]) -> String {
    let mut bytes = Vec::with_capacity(2 * angles_deg.len());
    for angle_deg in angles_deg {
        bytes.extend(hundredths(*angle_deg).to_le_bytes());
    }
    STANDARD.encode(bytes)
}

fn hundredths(angle_deg: f64) -> i16 {
    let hundredths = (100.0 * angle_deg).round();
    if !hundredths.is_finite() {
        return i16::MIN;
    }
    hundredths.clamp(f64::from(-i16::MAX), f64::from(i16::MAX)) as i16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, Size, Snapshot};
    use std::sync::Arc;

    /// The colour on the page is that on the screens of `capture` and `animate`, which show what
    /// [`Snapshot::show_tree`] makes.
    #[test]
    fn a_branch_has_one_colour_on_the_page_and_on_the_screens() {
        // Two main branches on a trunk of three nodes, and a copy of the second.
        let parents = [None, Some(0), Some(1), Some(2), Some(2), Some(3), Some(2)];
        let mut nodes = Vec::new();
        for (i, parent) in (0..).zip(parents) {
            nodes.push(Node {
                copy_of: (i == 6).then_some(NodeId(4)),
                ..Node::made_up(10 + i, parent, [f64::from(i), 10.0, 0.0])
            });
        }
        let skeleton = Skeleton {
            nodes,
            foot_px: [0.0; 2].into(),
            image_size: Size::new(64, 48),
        };
        let page = branches(&skeleton, &[], &Sways::default());
        let page: Vec<Option<u8>> = page.iter().map(|b| b.main_branch).collect();
        let mut screen = Snapshot::default();
        screen.show_tree(Arc::new(skeleton));
        assert_eq!(page, *screen.node_colour);
        let [a, b] = [Some(0), Some(1)];
        assert_eq!(page, [None, None, None, a, b, a, b]);
    }

    #[test]
    fn angles_are_packed_as_the_page_unpacks_them() {
        let bytes = STANDARD
            .decode(packed(&[0.0, 1.234, -179.996, 400.0, f64::NAN]))
            .unwrap();
        let back: Vec<i16> = bytes
            .chunks(2)
            .map(|b| i16::from_le_bytes([b[0], b[1]]))
            .collect();
        assert_eq!(back, [0, 123, -18000, i16::MAX, i16::MIN]);
    }
}
