//! `wood.csv`: the wood that the pictures of a running film have shown.

use super::error::DocumentError;
use super::table::{TableReader, TableWriter};
use crate::files::WriteError;
use crate::model::{FARTHEST_PX, Wood, WoodNode, WoodSeen};
use nalgebra::Point2;
use std::path::Path;
use std::sync::Arc;

/// The name of the file.
pub const WOOD_FILE: &str = "wood.csv";
const HEADER: &str = "frame,parent,u_px,v_px,radius_px,bare";
const COLUMNS: [&str; 5] = ["frame", "parent", "u_px", "v_px", "radius_px"];

/// The table as bytes: a row for each node of the wood that was found in a frame, which names its
/// parent by the number of that one's row. Numbers have all their digits.
///
/// # Errors
/// Memory cannot be had.
pub fn wood_csv(seen: &WoodSeen) -> Result<Vec<u8>, WriteError> {
    let mut table = TableWriter::new(WOOD_FILE, HEADER, Vec::new())?;
    for (frame, wood) in seen {
        for node in &wood.branches.nodes {
            table.count(*frame);
            match node.parent {
                Some(parent) => table.count(parent as u64),
                None => table.text(""),
            }
            for number in [node.position_px.x, node.position_px.y, node.radius_px] {
                table.text(&number.to_string());
            }
            table.text(&wood.bare.to_string());
            table.end_row()?;
        }
    }
    table.finish()
}

/// Reads the table in `dir`: the branches, and whether they are bare.
///
/// # Errors
/// It is missing or damaged, or a row's parent does not stand before it.
pub fn read_wood(dir: &Path) -> Result<WoodSeen, DocumentError> {
    let mut table = TableReader::open(dir, WOOD_FILE, COLUMNS)?;
    let bare = table.optional("bare");
    let mut seen = std::collections::BTreeMap::<u64, Wood>::new();
    while table.next()? {
        let wood = seen.entry(table.whole(0, "frame")?).or_default();
        wood.bare = match table.optional_cell(bare) {
            "" | "false" => false,
            "true" => true,
            other => return Err(table.bad(format!("bare is {other:?}, and must be true or false"))),
        };
        let branches = &mut wood.branches;
        let parent = match table.cell(1) {
            "" => None,
            _ => Some(table.whole::<usize>(1, "parent")?),
        };
        let is_root = branches.nodes.is_empty();
        if parent.is_none() != is_root || parent.is_some_and(|p| p >= branches.nodes.len()) {
            return Err(table.bad("parent must be the number of a row before it"));
        }
        let node = WoodNode {
            parent,
            position_px: Point2::new(table.number(2, "u_px")?, table.number(3, "v_px")?),
            radius_px: table.number(4, "radius_px")?,
        };
        let is_far = node.position_px.iter().any(|x| x.abs() > FARTHEST_PX);
        if is_far || !(0.0..=FARTHEST_PX).contains(&node.radius_px) {
            return Err(table.bad("no tree is so large"));
        }
        branches.nodes.push(node);
    }
    let shared = seen
        .into_iter()
        .map(|(frame, wood)| (frame, Arc::new(wood)));
    Ok(shared.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::BranchGraph;

    fn read(text: &[u8]) -> Result<WoodSeen, DocumentError> {
        let dir = tempfile::tempdir().expect("a folder");
        std::fs::write(dir.path().join(WOOD_FILE), text).expect("a file");
        read_wood(dir.path())
    }

    fn wood_of(bare: bool, nodes: Vec<WoodNode>) -> Arc<Wood> {
        Arc::new(Wood {
            branches: BranchGraph { nodes },
            bare,
            ..Wood::default()
        })
    }

    #[test]
    fn what_was_written_is_read() {
        let nodes = vec![
            WoodNode::made_up(None, 100.0, 200.5),
            WoodNode::made_up(Some(0), 101.123_456_789, 150.0),
            WoodNode::made_up(Some(0), 90.0, 120.0),
        ];
        let later = vec![WoodNode::made_up(None, 0.1 + 0.2, 1.0 / 3.0)];
        let (wood, later) = (wood_of(false, nodes), wood_of(true, later));
        let seen = WoodSeen::from([(90, wood), (170, later)]);
        let text = wood_csv(&seen).expect("a table");
        assert_eq!(read(&text).expect("wood"), seen);
    }

    #[test]
    fn a_table_that_does_not_say_so_is_not_of_bare_wood() {
        let seen = read(b"frame,parent,u_px,v_px,radius_px\n7,,1,2,3\n").expect("wood");
        assert!(!seen[&7].bare);
    }

    #[test]
    fn damaged_tables_are_refused() {
        let head = "frame,parent,u_px,v_px,radius_px\n";
        let root = "7,,1,2,3\n";
        for rows in [
            "7,0,1,2,3\n".to_owned(),
            format!("{root}7,,1,2,3\n"),
            format!("{root}7,1,1,2,3\n"),
            format!("{root}7,0,1,nan,3\n"),
            format!("{root}7,0,1,1e11,3\n"),
            format!("{root}7,0,1,2,-1\n"),
            format!("{root}7,0,1\n"),
        ] {
            assert!(read(format!("{head}{rows}").as_bytes()).is_err(), "{rows}");
        }
        assert!(read(b"frame,parent\n").is_err());
        let odd = b"frame,parent,u_px,v_px,radius_px,bare\n7,,1,2,3,perhaps\n";
        assert!(read(odd).is_err());
    }
}
