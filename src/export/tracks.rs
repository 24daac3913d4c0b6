//! `tracks.csv` of a tree that has been cut.

use super::{ExportError, OutputFolder};
use crate::model::NodeName;
use csv::{ReaderBuilder, StringRecord, Writer};
use std::collections::BTreeSet;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

const NAME: &str = "tracks.csv";

/// Copies `tracks.csv` of the capture `from`; a point whose node is not among `nodes` any more is
/// written without one, as points that move nothing are.
///
/// # Errors
/// The table cannot be read, or not be written to its end; `stop` was set meanwhile.
pub fn tracks_of(
    folder: &OutputFolder,
    from: &Path,
    nodes: &BTreeSet<NodeName>,
    stop: &AtomicBool,
) -> Result<(), ExportError> {
    let failed = |e: csv::Error| match e.into_kind() {
        csv::ErrorKind::Io(e) => folder.explain(NAME, 0, e),
        other => folder.explain(
            NAME,
            0,
            io::Error::other(format!("tracks.csv of the capture is damaged ({other:?})")),
        ),
    };
    let mut table = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_path(from.join(NAME))
        .map_err(failed)?;
    let mut out = Writer::from_writer(folder.file(NAME)?);
    let (mut row, mut column) = (StringRecord::new(), None);
    while table.read_record(&mut row).map_err(failed)? {
        if stop.load(Ordering::SeqCst) {
            return Err(ExportError::Stopped);
        }
        let at = *column.get_or_insert_with(|| {
            row.iter()
                .position(|name| name == "node_id")
                .unwrap_or(usize::MAX)
        });
        let gone = |cell: &str| {
            cell.parse()
                .is_ok_and(|name| !nodes.contains(&NodeName(name)))
        };
        let cells = row
            .iter()
            .enumerate()
            .map(|(i, cell)| if i == at && gone(cell) { "" } else { cell });
        out.write_record(cells).map_err(failed)?;
    }
    out.flush().map_err(|e| folder.explain(NAME, 0, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn points_of_branches_that_are_gone_have_none() {
        let dir = tempfile::tempdir().unwrap();
        let text = "track_id,frame,time_s,u_px,v_px,node_id\n1,0,0,3.5,4,7\n2,0,0,3,4,8\n3,0,0,3,4,\n1,1,0.1,3,4,7\n";
        fs::write(dir.path().join(NAME), text).unwrap();
        let folder = OutputFolder::create(&dir.path().join("out")).unwrap();
        let nodes = BTreeSet::from([NodeName(0), NodeName(8)]);
        tracks_of(&folder, dir.path(), &nodes, &AtomicBool::new(false)).unwrap();
        let written = fs::read_to_string(folder.path(NAME)).unwrap();
        assert_eq!(written, text.replace("4,7\n", "4,\n"));
        fs::write(dir.path().join(NAME), [b'a', 0xff, b'\n']).unwrap();
        let damaged = tracks_of(&folder, dir.path(), &nodes, &AtomicBool::new(false))
            .unwrap_err()
            .to_string();
        assert!(
            damaged.contains("damaged") && !damaged.contains('\n'),
            "{damaged}"
        );
    }
}
