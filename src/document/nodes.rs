//! `nodes.csv`: the tree. Every node with its parent, place, thickness and sway, and what it is.

use super::error::DocumentError;
use super::note::ModelNote;
use super::sway;
use super::table::{TableReader, TableWriter, px_in_unit, unit};
use crate::files::WriteError;
use crate::model::{Node, NodeId, NodeKind, NodeName, Size, Skeleton, Swaying, Unidentified};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::path::Path;

pub(super) const FILE: &str = "nodes.csv";

/// Joints of a skin are numbered with two bytes.
const MOST_NODES: usize = 1 << 16;
/// Nodes that a later change adds get numbers above those there are.
const LARGEST_NAME: u32 = u32::MAX / 2;
/// The column that a file may lack: then every node moves on its own.
const MOVES_WITH: &str = "moves_with";

/// The columns that are read, but for those of the sway.
const COLUMNS: [&str; 12] = [
    "node_id",
    "parent_id",
    "level",
    "n_tracks",
    "x",
    "y",
    "z",
    "radius",
    "kind",
    "copy_of",
    "plane_deg",
    "certainty",
];
/// All of them: [`COLUMNS`], then [`sway::COLUMNS`].
const READ: usize = COLUMNS.len() + sway::COLUMNS.len();

/// The first line of `nodes.csv`.
pub fn nodes_header() -> String {
    format!(
        "node_id,parent_id,level,n_tracks,u_px,v_px,x,y,z,radius,{},kind,copy_of,plane_deg,\
         certainty,moves_with,branch,order",
        sway::COLUMNS.join(",")
    )
}

/// Writes `nodes.csv`. `sway` is by node index and may be shorter than the tree; `metres_per_px` 0
/// leaves pixels. A node is identifiable if it has a frequency with its interval; where it is not,
/// `unidentified` says why. The names and orders of branches follow from the tree and are not read
/// back.
///
/// # Errors
/// The file cannot be written.
pub fn nodes<W: Write>(
    out: W,
    skeleton: &Skeleton,
    sway: &[Swaying],
    metres_per_px: f64,
) -> Result<W, WriteError> {
    let mut table = TableWriter::new(FILE, &nodes_header(), out)?;
    let (scale, more) = unit(metres_per_px);
    let branches = skeleton.botanical_branches();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let id = NodeId(i as u32);
        let original = node.copy_of.and_then(|of| skeleton.name_of(of));
        table.count(node.name.0);
        table.id(node.parent.and_then(|p| skeleton.name_of(p)));
        table.count(node.level);
        table.count(node.n_tracks);
        for px in skeleton.image_from_model(&node.position).iter() {
            table.number(*px, 3);
        }
        for length in node.position.iter().chain([&node.radius]) {
            table.number(length * scale, 4 + more);
        }
        let swaying = sway.get(i).copied();
        for cell in sway::cells(&swaying.unwrap_or(Err(Unidentified::NotMeasured))) {
            table.text(&cell);
        }
        table.text(node.kind_word());
        table.id(original);
        match original {
            Some(_) => table.number(node.plane_angle.to_degrees(), 4),
            None => table.text(""),
        }
        table.number(node.certainty.into(), 4);
        table.id(node.moves_with.and_then(|m| skeleton.name_of(m)));
        table.text(&branches.name(id));
        table.count(branches.order(id));
        table.end_row()?;
    }
    table.finish()
}

/// A tree as its table tells it.
pub(super) struct NodesRead {
    pub skeleton: Skeleton,
    /// By node index.
    pub sway: Vec<Swaying>,
}

/// Reads the table of the document in `dir`.
///
/// # Errors
/// As of [`read_from`]; or the table is missing.
pub(super) fn read(
    dir: &Path,
    note: &ModelNote,
    image_size: Size,
) -> Result<NodesRead, DocumentError> {
    let table = TableReader::open(dir, FILE, columns())?;
    NodeRows::of(table, note).skeleton(note, image_size)
}

/// The same from the bytes of a table.
///
/// # Errors
/// The table is damaged: two nodes have one number, or one stands before its parent, or not one
/// level above what carries it; a copy stands before a node that is none, or repeats what cannot be
/// repeated; a node moves with one that it cannot be a rigid part of.
pub(super) fn read_from(
    bytes: &[u8],
    note: &ModelNote,
    image_size: Size,
) -> Result<NodesRead, DocumentError> {
    let table = TableReader::new(FILE.into(), bytes, columns())?;
    NodeRows::of(table, note).skeleton(note, image_size)
}

fn columns() -> [&'static str; READ] {
    let mut all = [""; READ];
    let (own, of_sway) = all.split_at_mut(COLUMNS.len());
    own.copy_from_slice(&COLUMNS);
    of_sway.copy_from_slice(&sway::COLUMNS);
    all
}

/// The table while it is read.
struct NodeRows<R: Read> {
    table: TableReader<R, READ>,
    /// Pixels in the unit of the file.
    px: f64,
    nodes: Vec<Node>,
    sway: Vec<Swaying>,
    by_name: BTreeMap<u32, NodeId>,
    /// Where the column [`MOVES_WITH`] is.
    moves_with: Option<usize>,
    rides: Vec<Ride>,
    /// Of each node.
    lines: Vec<u64>,
}

/// A node that moves with another one, which may come in a later row.
struct Ride {
    node: NodeId,
    /// What the row calls the other one.
    mover: String,
}

impl<R: Read> NodeRows<R> {
    fn of(table: TableReader<R, READ>, note: &ModelNote) -> Self {
        Self {
            moves_with: table.optional(MOVES_WITH),
            rides: Vec::new(),
            lines: Vec::new(),
            table,
            px: px_in_unit(note.metres_per_px),
            nodes: Vec::new(),
            sway: Vec::new(),
            by_name: BTreeMap::new(),
        }
    }

    fn skeleton(mut self, note: &ModelNote, image_size: Size) -> Result<NodesRead, DocumentError> {
        while self.table.next()? {
            let node = self.node()?;
            let id = NodeId(self.nodes.len() as u32);
            self.by_name.insert(node.name.0, id);
            self.nodes.push(node);
            self.lines.push(self.table.line());
            let mover = self.table.optional_cell(self.moves_with).to_owned();
            if !mover.is_empty() {
                self.rides.push(Ride { node: id, mover });
            }
            let cells = std::array::from_fn(|i| self.table.cell(COLUMNS.len() + i));
            let sway = sway::read(cells).map_err(|what| self.table.bad(what))?;
            self.sway.push(sway);
        }
        for ride in std::mem::take(&mut self.rides) {
            let mover = self.mover(&ride);
            let mover = mover.map_err(|what| self.bad_node(ride.node, what))?;
            self.nodes[ride.node.index()].moves_with = Some(mover);
        }
        let skeleton = Skeleton {
            nodes: std::mem::take(&mut self.nodes),
            foot_px: note.foot_px.into(),
            image_size,
        };
        for node in (0..skeleton.nodes.len() as u32).map(NodeId) {
            check_place(&skeleton, node).map_err(|what| self.bad_node(node, what))?;
        }
        Ok(NodesRead {
            skeleton,
            sway: self.sway,
        })
    }

    fn bad_node(&self, node: NodeId, what: String) -> DocumentError {
        self.table.bad_at(self.lines[node.index()], what)
    }

    /// The node that another one moves with.
    fn mover(&self, ride: &Ride) -> Result<NodeId, String> {
        let known = ride.mover.parse().ok().and_then(|n| self.by_name.get(&n));
        known
            .copied()
            .ok_or_else(|| format!("moves_with is {:?}, which is no node", ride.mover))
    }

    /// The node of the present row.
    fn node(&self) -> Result<Node, DocumentError> {
        let table = &self.table;
        let name = self.name()?;
        let parent = self.parent()?;
        let level = self.level()?;
        let radius = table.length_px(7, "radius", self.px)?;
        if radius < 0.0 {
            return Err(table.bad(format!("radius is {radius}, and must not be below 0")));
        }
        let certainty = table.number(11, "certainty")?;
        if !(0.0..=1.0).contains(&certainty) {
            return Err(table.bad(format!("certainty is {certainty}, and must be 0 to 1")));
        }
        let mut node = Node {
            name: NodeName(name),
            parent,
            level,
            position: table.place_px([4, 5, 6], self.px)?,
            radius,
            n_tracks: table.whole(3, "n_tracks")?,
            kind: NodeKind::Measured,
            certainty: certainty as f32,
            copy_of: None,
            plane_angle: 0.0,
            moves_with: None,
        };
        match table.cell(8) {
            NodeKind::COPY => self.copy(&mut node)?,
            word => node.kind = self.kind(word)?,
        }
        Ok(node)
    }

    fn name(&self) -> Result<u32, DocumentError> {
        let name: u32 = self.table.whole(0, "node_id")?;
        if self.nodes.len() >= MOST_NODES {
            return Err(self
                .table
                .bad(format!("there are more than {MOST_NODES} nodes")));
        }
        if name > LARGEST_NAME {
            return Err(self.table.bad(format!(
                "node_id is {name}, and at most {LARGEST_NAME} can be"
            )));
        }
        if self.by_name.contains_key(&name) {
            return Err(self.table.bad(format!("there are two nodes {name}")));
        }
        Ok(name)
    }

    fn parent(&self) -> Result<Option<NodeId>, DocumentError> {
        if self.table.cell(1).is_empty() != self.nodes.is_empty() {
            return Err(self
                .table
                .bad("the first node, and no other, must be without a parent"));
        }
        if self.nodes.is_empty() {
            return Ok(None);
        }
        let name: u32 = self.table.whole(1, "parent_id")?;
        match self.by_name.get(&name) {
            Some(parent) => Ok(Some(*parent)),
            None => Err(self.table.bad(format!(
                "its parent is node {name}, which is in no row before this one"
            ))),
        }
    }

    fn level(&self) -> Result<u8, DocumentError> {
        let level: u32 = self.table.whole(2, "level")?;
        u8::try_from(level).map_err(|_| self.table.bad("it has more levels than any tree"))
    }

    /// What a node is that is no copy. All of these come before all copies.
    fn kind(&self, word: &str) -> Result<NodeKind, DocumentError> {
        let Some(kind) = NodeKind::of_word(word) else {
            return Err(self.table.bad(format!(
                "kind is {word:?}, and must be measured, copy, shoot, grown or traced"
            )));
        };
        if self.nodes.last().is_some_and(|n| n.copy_of.is_some()) {
            return Err(self
                .table
                .bad("it stands after a copy; copies come after all other nodes"));
        }
        Ok(kind)
    }

    /// Takes in what `node` repeats: a node that is no copy, not the foot. Another one could not be
    /// posed. That it is of the same level, or it could not be cut with it, is told when all levels
    /// are known to be right.
    fn copy(&self, node: &mut Node) -> Result<(), DocumentError> {
        let name: u32 = self.table.whole(9, "copy_of")?;
        let original = self.by_name.get(&name).copied();
        let Some(id) = original.filter(|id| id.0 > 0) else {
            return Err(self.table.bad(format!(
                "copy_of is {name}, which is no branch in a row before this one"
            )));
        };
        let of = &self.nodes[id.index()];
        if of.copy_of.is_some() {
            return Err(self.table.bad(no_original(name)));
        }
        node.copy_of = Some(id);
        node.kind = of.kind;
        node.plane_angle = self.table.number(10, "plane_deg")?.to_radians();
        Ok(())
    }
}

/// Whether `node` has the level of its place in the tree, and may move with what it does.
///
/// # Errors
/// What is wrong with it.
fn check_place(skeleton: &Skeleton, node: NodeId) -> Result<(), String> {
    let own = &skeleton.nodes[node.index()];
    if let Some(mover) = own.moves_with {
        check_ride(skeleton, node, mover)?;
    }
    let level_of = |n: NodeId| u32::from(skeleton.nodes[n.index()].level);
    let expected = match own.moves_with {
        Some(mover) if skeleton.is_bend(node) => level_of(mover),
        Some(mover) => level_of(mover) + 1,
        None => skeleton.moving_parent(node).map_or(0, |p| level_of(p) + 1),
    };
    let level = own.level;
    if u32::from(level) != expected {
        return Err(format!("level is {level}, and must be {expected} there"));
    }
    match own.copy_of.map(|o| &skeleton.nodes[o.index()]) {
        Some(original) if original.level != level => Err(no_original(original.name.0)),
        _ => Ok(()),
    }
}

/// Why the node of that name cannot be repeated there.
fn no_original(name: u32) -> String {
    format!("copy_of is {name}, which is a copy itself or of another level")
}

/// Whether `node` can be a rigid part of the branch of `mover`.
fn check_ride(skeleton: &Skeleton, node: NodeId, mover: NodeId) -> Result<(), String> {
    let [own, other] = [node, mover].map(|n| &skeleton.nodes[n.index()]);
    let name = other.name.0;
    if own.parent.is_none() || other.parent.is_none() {
        return Err(format!("moves_with is {name}, but the foot stands still"));
    }
    if other.moves_with.is_some() {
        return Err(format!(
            "moves_with is {name}, which moves with another node itself"
        ));
    }
    let original = own.copy_of.map(|o| &skeleton.nodes[o.index()]);
    let fits = match original {
        Some(original) => [Some(mover), other.copy_of].contains(&original.moves_with),
        None => other.copy_of.is_none(),
    };
    if !fits {
        return Err(format!(
            "moves_with is {name}, which is of another plane of copies"
        ));
    }
    let hangs_on = own.parent.is_some_and(|parent| {
        skeleton.mover(parent) == mover || skeleton.begin(mover) == Some(parent)
    });
    if hangs_on {
        Ok(())
    } else {
        Err(format!(
            "moves_with is {name}, but it does not hang on the branch of that"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `node_id,parent_id,level,kind,copy_of,plane_deg,moves_with`: a trunk, a limb (4) with a bend
    /// (2), a branch (3) that leaves it there, side wood (5), and a copy of the limb.
    const ROWS: [&str; 8] = [
        "0,,0,measured,,,",
        "1,0,1,measured,,,",
        "2,1,2,traced,,,4",
        "3,2,3,measured,,,",
        "4,2,2,measured,,,",
        "5,2,3,traced,,,4",
        "6,1,2,copy,2,90,7",
        "7,6,2,copy,4,90,",
    ];

    fn table(rows: &[&str], with_column: bool) -> String {
        let mut text = "node_id,parent_id,level,n_tracks,x,y,z,radius,frequency_hz,frequency_lo_hz,\
                        frequency_hi_hz,damping_ratio,damping_lo,damping_hi,identifiable,excitation,\
                        amplitude_deg,unidentified,certainty,kind,copy_of,plane_deg"
            .to_owned();
        text.push_str(if with_column { ",moves_with\n" } else { "\n" });
        for row in rows {
            let cells: Vec<&str> = row.split(',').collect();
            let at = format!("0,{},5,0,1", cells[0]);
            let end = if with_column { 7 } else { 6 };
            text.push_str(&format!(
                "{},{at},,,,,,,false,,,,0.5,{}\n",
                cells[..3].join(","),
                cells[3..end].join(",")
            ));
        }
        text
    }

    fn read_rows(rows: &[&str], with_column: bool) -> Result<NodesRead, DocumentError> {
        let nobody = Skeleton {
            nodes: Vec::new(),
            foot_px: [32.0, 60.0].into(),
            image_size: Size::new(64, 64),
        };
        let note = ModelNote::of(&nobody, 0.0);
        read_from(
            table(rows, with_column).as_bytes(),
            &note,
            nobody.image_size,
        )
    }

    fn movers(skeleton: &Skeleton) -> Vec<Option<u32>> {
        let movers = skeleton.nodes.iter().map(|n| n.moves_with);
        movers.map(|m| m.map(|m| m.0)).collect()
    }

    #[test]
    fn what_a_node_moves_with_is_written_and_read() {
        let read = read_rows(&ROWS, true).expect("a sound table");
        let (with, none) = (Some(4), None);
        let expected = [none, none, with, none, none, with, Some(7), none];
        assert_eq!(movers(&read.skeleton), expected);
        let written = nodes(Vec::new(), &read.skeleton, &read.sway, 0.0).expect("written");
        let note = ModelNote::of(&read.skeleton, 0.0);
        let again = read_from(&written, &note, read.skeleton.image_size).expect("a sound table");
        assert_eq!(again.skeleton.nodes, read.skeleton.nodes);
    }

    #[test]
    fn without_the_column_every_node_moves_on_its_own() {
        let rows = [
            "0,,0,measured,,,",
            "1,0,1,traced,,,",
            "2,1,2,traced,,,",
            "3,2,3,copy,2,90,",
        ];
        // A copy has the level of its original.
        assert!(read_rows(&rows, false).is_err());
        let read = read_rows(&rows[..3], false).expect("a sound table");
        assert_eq!(movers(&read.skeleton), [None; 3]);
    }

    #[test]
    fn what_cannot_move_so_is_refused_with_its_line() {
        let cases = [
            (0, "0,,0,measured,,,4", 2, "the foot stands still"),
            (2, "2,1,2,traced,,,0", 4, "the foot stands still"),
            (2, "2,1,2,traced,,,44", 4, "\"44\", which is no node"),
            (2, "2,1,2,traced,,,x", 4, "\"x\", which is no node"),
            (2, "2,1,2,traced,,,5", 4, "moves with another node itself"),
            (2, "2,1,2,traced,,,2", 4, "moves with another node itself"),
            (2, "2,1,3,traced,,,4", 4, "level is 3, and must be 2"),
            (3, "3,2,2,measured,,,", 5, "level is 2, and must be 3"),
            (5, "5,2,2,traced,,,4", 7, "level is 2, and must be 3"),
            (5, "5,3,4,traced,,,4", 7, "does not hang on the branch"),
            (5, "5,2,3,traced,,,7", 7, "of another plane of copies"),
            (6, "6,1,2,copy,2,90,3", 8, "of another plane of copies"),
        ];
        for (row, instead, line, what) in cases {
            let mut rows = ROWS;
            rows[row] = instead;
            let Err(error) = read_rows(&rows, true) else {
                panic!("{instead} was read");
            };
            let text = error.to_string();
            let is_told = text.contains(what) && text.contains(&format!("line {line}:"));
            assert!(is_told, "{instead}: {text}");
        }
    }
}
