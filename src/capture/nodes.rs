//! `nodes.csv` back to a skeleton.

use super::CaptureError;
use super::table::Table;
use crate::export::capture::ModelNote;
use crate::export::csv::Sway;
use crate::model::{Node, NodeId, NodeName, Size, Skeleton};
use std::collections::BTreeMap;
use std::path::Path;

/// Joints of a skin are numbered with two bytes.
const MOST_NODES: usize = 1 << 16;
/// Nodes that a later change adds get numbers above those there are.
const LARGEST_NAME: u32 = u32::MAX / 2;
const COLUMNS: [&str; 8] = ["node_id", "parent_id", "level", "n_tracks", "x", "y", "z", "radius"];

/// The nodes in their order, none of them a copy yet, and how each sways, where that is known.
///
/// # Errors
/// The table is missing or damaged; two nodes have one number, or one stands before its parent, or not one level above it.
pub(super) fn read(
    dir: &Path,
    note: &ModelNote,
    image_size: Size,
) -> Result<(Skeleton, Vec<Option<Sway>>), CaptureError> {
    let mut table = Table::open(dir, "nodes.csv", COLUMNS)?;
    let sway_columns =
        ["frequency_hz", "frequency_lo_hz", "frequency_hi_hz", "damping_ratio", "damping_lo", "damping_hi"]
            .map(|name| table.place(name));
    let px = if note.metres_per_px > 0.0 { 1.0 / note.metres_per_px } else { 1.0 };
    let (mut nodes, mut sway): (Vec<Node>, Vec<Option<Sway>>) = (Vec::new(), Vec::new());
    let mut by_name: BTreeMap<u32, NodeId> = BTreeMap::new();
    while table.next()? {
        let name: u32 = table.whole(0, "node_id")?;
        let parent: Option<NodeId> = match table.cell(1) {
            "" => None,
            _ => {
                let parent: u32 = table.whole(1, "parent_id")?;
                let known = by_name.get(&parent).copied();
                let why = || format!("its parent is node {parent}, which is in no row before this one");
                Some(known.ok_or_else(|| table.bad(why()))?)
            }
        };
        if parent.is_some() == nodes.is_empty() {
            return Err(table.bad("the first node, and no other, must be without a parent"));
        }
        if nodes.len() >= MOST_NODES {
            return Err(table.bad(format!("there are more than {MOST_NODES} nodes")));
        }
        if name > LARGEST_NAME {
            return Err(table.bad(format!("node_id is {name}, and at most {LARGEST_NAME} can be")));
        }
        let level: u32 = table.whole(2, "level")?;
        let expected = parent.map_or(0, |p| u32::from(nodes[p.index()].level) + 1);
        if level != expected {
            return Err(table.bad(format!("level is {level}, and must be {expected} there")));
        }
        let level = u8::try_from(level).map_err(|_| table.bad("it has more levels than any tree"))?;
        if by_name.insert(name, NodeId(nodes.len() as u32)).is_some() {
            return Err(table.bad(format!("there are two nodes {name}")));
        }
        let position = table.place_px([4, 5, 6], px)?;
        let radius = table.length_px(7, "radius", px)?;
        nodes.push(Node {
            name: NodeName(name),
            parent,
            level,
            position,
            radius: radius.max(0.0),
            n_tracks: table.whole(3, "n_tracks")?,
            certainty: 0.0,
            copy_of: None,
            plane_angle: 0.0,
        });
        sway.push(sway_of(&table, sway_columns));
    }
    Ok((Skeleton { nodes, foot_px: note.foot_px, image_size }, sway))
}

/// `None` where neither frequency nor damping is known; what else is missing is no number.
fn sway_of<const N: usize>(table: &Table<N>, columns: [Option<usize>; 6]) -> Option<Sway> {
    let value = |c: Option<usize>| c.and_then(|c| table.at(c).parse().ok()).filter(|x: &f64| x.is_finite());
    let [frequency_hz, frequency_lo_hz, frequency_hi_hz, damping_ratio, damping_lo, damping_hi] =
        columns.map(|c| value(c).unwrap_or(f64::NAN));
    (frequency_hz.is_finite() || damping_ratio.is_finite()).then_some(Sway {
        frequency_hz,
        frequency_lo_hz,
        frequency_hi_hz,
        damping_ratio,
        damping_lo,
        damping_hi,
    })
}
