//! `nodes.csv` back to a skeleton.

use super::CaptureError;
use super::table::Table;
use crate::export::capture::ModelNote;
use crate::model::{
    Excitation, Interval, Node, NodeId, NodeName, Size, Skeleton, Sway, Swaying, Unidentified,
};
use std::collections::BTreeMap;
use std::path::Path;

/// Joints of a skin are numbered with two bytes.
const MOST_NODES: usize = 1 << 16;
/// Nodes that a later change adds get numbers above those there are.
const LARGEST_NAME: u32 = u32::MAX / 2;
const COLUMNS: [&str; 8] = [
    "node_id",
    "parent_id",
    "level",
    "n_tracks",
    "x",
    "y",
    "z",
    "radius",
];
const SWAY_COLUMNS: [&str; 9] = [
    "frequency_hz",
    "frequency_lo_hz",
    "frequency_hi_hz",
    "damping_ratio",
    "damping_lo",
    "damping_hi",
    "excitation",
    "amplitude_deg",
    "unidentified",
];

/// The nodes in their order, none of them a copy yet, and how each sways.
///
/// # Errors
/// The table is missing or damaged; two nodes have one number, or one stands before its parent, or
/// not one level above it.
pub(super) fn read(
    dir: &Path,
    note: &ModelNote,
    image_size: Size,
) -> Result<(Skeleton, Vec<Swaying>), CaptureError> {
    let mut table = Table::open(dir, "nodes.csv", COLUMNS)?;
    let sway_columns = SWAY_COLUMNS.map(|name| table.place(name));
    let px = if note.metres_per_px > 0.0 {
        1.0 / note.metres_per_px
    } else {
        1.0
    };
    let (mut nodes, mut sway): (Vec<Node>, Vec<Swaying>) = (Vec::new(), Vec::new());
    let mut by_name: BTreeMap<u32, NodeId> = BTreeMap::new();
    while table.next()? {
        let name: u32 = table.whole(0, "node_id")?;
        let parent: Option<NodeId> = match table.cell(1) {
            "" => None,
            _ => {
                let parent: u32 = table.whole(1, "parent_id")?;
                let known = by_name.get(&parent).copied();
                let why =
                    || format!("its parent is node {parent}, which is in no row before this one");
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
            return Err(table.bad(format!(
                "node_id is {name}, and at most {LARGEST_NAME} can be"
            )));
        }
        let level: u32 = table.whole(2, "level")?;
        let expected = parent.map_or(0, |p| u32::from(nodes[p.index()].level) + 1);
        if level != expected {
            return Err(table.bad(format!("level is {level}, and must be {expected} there")));
        }
        let level =
            u8::try_from(level).map_err(|_| table.bad("it has more levels than any tree"))?;
        if by_name.insert(name, NodeId(nodes.len() as u32)).is_some() {
            return Err(table.bad(format!("there are two nodes {name}")));
        }
        let position = table.place_px([4, 5, 6], px)?;
        let radius = table.length_px(7, "radius", px)?;
        if radius < 0.0 {
            return Err(table.bad(format!("radius is {radius}, and must not be below 0")));
        }
        nodes.push(Node {
            name: NodeName(name),
            parent,
            level,
            position,
            radius,
            n_tracks: table.whole(3, "n_tracks")?,
            certainty: 0.0,
            copy_of: None,
            plane_angle: 0.0,
        });
        sway.push(sway_of(&table, sway_columns));
    }
    Ok((
        Skeleton {
            nodes,
            foot_px: note.foot_px,
            image_size,
        },
        sway,
    ))
}

/// How the node of the present row sways. A frequency counts with its interval only; where a table
/// does not say what made it sway, as in captures of older versions, it was wind, which claims
/// less.
fn sway_of<const N: usize>(table: &Table<N>, columns: [Option<usize>; 9]) -> Swaying {
    let cell = |c: Option<usize>| c.map_or("", |c| table.at(c));
    let value = |c| cell(c).parse().ok().filter(|x: &f64| x.is_finite());
    let interval = |i: usize| {
        let [value, lo, hi] = [
            value(columns[i])?,
            value(columns[i + 1])?,
            value(columns[i + 2])?,
        ];
        (0.0 <= lo && lo <= value && value <= hi).then_some(Interval { value, lo, hi })
    };
    let why = || Unidentified::of_word(cell(columns[8])).unwrap_or(Unidentified::NotMeasured);
    let frequency_hz = interval(0).filter(|f| f.value > 0.0).ok_or_else(why)?;
    Ok(Sway {
        frequency_hz,
        damping_ratio: interval(3),
        excitation: Excitation::of_word(cell(columns[6])).unwrap_or(Excitation::Wind),
        amplitude_deg: value(columns[7]).unwrap_or(f64::NAN),
    })
}
