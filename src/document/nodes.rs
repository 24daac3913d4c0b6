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
pub const NODES_HEADER: &str = "node_id,parent_id,level,n_tracks,u_px,v_px,x,y,z,radius,frequency_hz,\
frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,damping_hi,identifiable,\
excitation,amplitude_deg,unidentified,kind,copy_of,plane_deg,certainty";

/// Joints of a skin are numbered with two bytes.
const MOST_NODES: usize = 1 << 16;
/// Nodes that a later change adds get numbers above those there are.
const LARGEST_NAME: u32 = u32::MAX / 2;
/// What `kind` says of a node that repeats another one.
const COPY: &str = "copy";

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

/// Writes `nodes.csv`. `sway` is by node index and may be shorter than the tree; `metres_per_px` 0
/// leaves pixels. A node is identifiable if it has a frequency with its interval; where it is not,
/// `unidentified` says why.
///
/// # Errors
/// The file cannot be written.
pub fn nodes<W: Write>(
    out: W,
    skeleton: &Skeleton,
    sway: &[Swaying],
    metres_per_px: f64,
) -> Result<W, WriteError> {
    let mut table = TableWriter::new(FILE, NODES_HEADER, out)?;
    let (scale, more) = unit(metres_per_px);
    for (i, node) in skeleton.nodes.iter().enumerate() {
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
        table.text(original.map_or(node.kind.word(), |_| COPY));
        table.id(original);
        match original {
            Some(_) => table.number(node.plane_angle.to_degrees(), 4),
            None => table.text(""),
        }
        table.number(node.certainty.into(), 4);
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
/// level above it; a copy stands before a node that is none, or repeats what cannot be repeated.
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
}

impl<R: Read> NodeRows<R> {
    fn of(table: TableReader<R, READ>, note: &ModelNote) -> Self {
        Self {
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
            self.by_name
                .insert(node.name.0, NodeId(self.nodes.len() as u32));
            self.nodes.push(node);
            let cells = std::array::from_fn(|i| self.table.cell(COLUMNS.len() + i));
            let sway = sway::read(cells).map_err(|what| self.table.bad(what))?;
            self.sway.push(sway);
        }
        Ok(NodesRead {
            skeleton: Skeleton {
                nodes: self.nodes,
                foot_px: note.foot_px.into(),
                image_size,
            },
            sway: self.sway,
        })
    }

    /// The node of the present row.
    fn node(&self) -> Result<Node, DocumentError> {
        let table = &self.table;
        let name = self.name()?;
        let parent = self.parent()?;
        let level = self.level(parent)?;
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
        };
        match table.cell(8) {
            COPY => self.copy(&mut node)?,
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

    fn level(&self, parent: Option<NodeId>) -> Result<u8, DocumentError> {
        let level: u32 = self.table.whole(2, "level")?;
        let expected = parent.map_or(0, |p| u32::from(self.nodes[p.index()].level) + 1);
        if level != expected {
            return Err(self
                .table
                .bad(format!("level is {level}, and must be {expected} there")));
        }
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

    /// Takes in what `node` repeats: a node that is no copy, not the foot, of the same level.
    /// Another one could not be posed, or not be cut with it.
    fn copy(&self, node: &mut Node) -> Result<(), DocumentError> {
        let name: u32 = self.table.whole(9, "copy_of")?;
        let original = self.by_name.get(&name).copied();
        let Some(id) = original.filter(|id| id.0 > 0) else {
            return Err(self.table.bad(format!(
                "copy_of is {name}, which is no branch in a row before this one"
            )));
        };
        let of = &self.nodes[id.index()];
        if of.copy_of.is_some() || of.level != node.level {
            return Err(self.table.bad(format!(
                "copy_of is {name}, which is a copy itself or of another level"
            )));
        }
        node.copy_of = Some(id);
        node.kind = of.kind;
        node.plane_angle = self.table.number(10, "plane_deg")?.to_radians();
        Ok(())
    }
}
