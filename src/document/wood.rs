//! `wood.csv`: the wood that the pictures of a running film have shown.

use super::error::DocumentError;
use super::table::{TableReader, TableWriter};
use crate::files::WriteError;
use crate::model::{BranchGraph, FARTHEST_PX, WoodNode};
use nalgebra::Point2;
use std::path::Path;

/// The name of the file.
pub const WOOD_FILE: &str = "wood.csv";
const HEADER: &str = "parent,u_px,v_px,radius_px";
const COLUMNS: [&str; 4] = ["parent", "u_px", "v_px", "radius_px"];
/// So that nothing of a graph is lost.
const DECIMALS: usize = 9;

/// The table as bytes: a row for each node, which names its parent by the number of that one's row.
///
/// # Errors
/// Memory cannot be had.
pub fn wood_csv(wood: &BranchGraph) -> Result<Vec<u8>, WriteError> {
    let mut table = TableWriter::new(WOOD_FILE, HEADER, Vec::new())?;
    for node in &wood.nodes {
        match node.parent {
            Some(parent) => table.count(parent as u64),
            None => table.text(""),
        }
        table.number(node.position_px.x, DECIMALS);
        table.number(node.position_px.y, DECIMALS);
        table.number(node.radius_px, DECIMALS);
        table.end_row()?;
    }
    table.finish()
}

/// Reads the table in `dir`.
///
/// # Errors
/// It is missing or damaged, or a row's parent does not stand before it.
pub fn read_wood(dir: &Path) -> Result<BranchGraph, DocumentError> {
    let mut table = TableReader::open(dir, WOOD_FILE, COLUMNS)?;
    let mut wood = BranchGraph::default();
    while table.next()? {
        let parent = match table.cell(0) {
            "" => None,
            _ => Some(table.whole::<usize>(0, "parent")?),
        };
        let is_root = wood.nodes.is_empty();
        if parent.is_none() != is_root || parent.is_some_and(|p| p >= wood.nodes.len()) {
            return Err(table.bad("parent must be the number of a row before it"));
        }
        let node = WoodNode {
            parent,
            position_px: Point2::new(table.number(1, "u_px")?, table.number(2, "v_px")?),
            radius_px: table.number(3, "radius_px")?,
        };
        let is_far = node.position_px.iter().any(|x| x.abs() > FARTHEST_PX);
        if is_far || !(0.0..=FARTHEST_PX).contains(&node.radius_px) {
            return Err(table.bad("no tree is so large"));
        }
        wood.nodes.push(node);
    }
    Ok(wood)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(parent: Option<usize>, u: f64, v: f64) -> WoodNode {
        WoodNode {
            parent,
            position_px: Point2::new(u, v),
            radius_px: 4.25,
        }
    }

    fn read(text: &[u8]) -> Result<BranchGraph, DocumentError> {
        let dir = tempfile::tempdir().expect("a folder");
        std::fs::write(dir.path().join(WOOD_FILE), text).expect("a file");
        read_wood(dir.path())
    }

    #[test]
    fn what_was_written_is_read() {
        let wood = BranchGraph {
            nodes: vec![
                node(None, 100.0, 200.5),
                node(Some(0), 101.123_456_789, 150.0),
                node(Some(0), 90.0, 120.0),
            ],
        };
        let text = wood_csv(&wood).expect("a table");
        assert_eq!(read(&text).expect("wood"), wood);
    }

    #[test]
    fn damaged_tables_are_refused() {
        let head = "parent,u_px,v_px,radius_px\n";
        let root = ",1,2,3\n";
        for rows in [
            "0,1,2,3\n".to_owned(),
            format!("{root},1,2,3\n"),
            format!("{root}1,1,2,3\n"),
            format!("{root}0,1,nan,3\n"),
            format!("{root}0,1,1e11,3\n"),
            format!("{root}0,1,2,-1\n"),
            format!("{root}0,1\n"),
        ] {
            assert!(read(format!("{head}{rows}").as_bytes()).is_err(), "{rows}");
        }
        assert!(read(b"parent\n").is_err());
    }
}
