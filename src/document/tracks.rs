//! `tracks.csv`: every point in every frame in which it was seen.

use super::error::DocumentError;
use super::table::{TableReader, TableWriter};
use crate::bounds::Bounds;
use crate::dynamics::Film;
use crate::files::{OutputFolder, WriteError};
use crate::model::{NodeId, NodeName, Observation, Skeleton, TrackId, TrackLog, TrackSet};
use csv::{ReaderBuilder, StringRecord, Writer};
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

pub(super) const FILE: &str = "tracks.csv";
pub const TRACKS_HEADER: &str = "track_id,frame,time_s,u_px,v_px,node_id";
const COLUMNS: [&str; 6] = ["track_id", "frame", "time_s", "u_px", "v_px", "node_id"];

/// Writes `tracks.csv`.
pub struct TracksCsv<W: Write>(TableWriter<W>);

impl<W: Write> TracksCsv<W> {
    /// # Errors
    /// The header cannot be written.
    pub fn new(out: W) -> Result<Self, WriteError> {
        TableWriter::new(FILE, TRACKS_HEADER, out).map(Self)
    }

    /// One point in one frame; `node` is the deepest one that it belongs to.
    ///
    /// # Errors
    /// The row cannot be written.
    pub fn row(
        &mut self,
        track: TrackId,
        frame: u64,
        time_s: f64,
        position_px: Point2<f64>,
        node: Option<NodeName>,
    ) -> Result<(), WriteError> {
        self.0.count(track.0);
        self.0.count(frame);
        self.0.number(time_s, 6);
        position_px.iter().for_each(|x| self.0.number(*x, 3));
        self.0.id(node);
        self.0.end_row()
    }

    /// All points of one frame.
    ///
    /// # Errors
    /// A row cannot be written.
    pub fn set(
        &mut self,
        set: &TrackSet,
        node_of: impl Fn(TrackId) -> Option<NodeName>,
    ) -> Result<(), WriteError> {
        for o in &set.observations {
            self.row(o.id, set.frame, set.time_s, o.at_px(), node_of(o.id))?;
        }
        Ok(())
    }

    /// Ends the file and gives the writer back; without this, errors of the last rows would be
    /// lost.
    ///
    /// # Errors
    /// The last rows cannot be written.
    pub fn finish(self) -> Result<W, WriteError> {
        self.0.finish()
    }
}

/// The points of the last `window_s` seconds of what lies between two times, s, in the document in
/// `dir`, on the nodes of
/// `skeleton`; a point is on the node that its last row says. The table goes by row by row, so that
/// a long capture takes no more room than what is kept of it; that needs its rows in order of time.
///
/// # Errors
/// The table is missing or damaged, or its times run backwards.
pub(super) fn read_film(
    dir: &Path,
    skeleton: &Skeleton,
    window_s: f64,
    within_s: Bounds,
) -> Result<Film, DocumentError> {
    let mut table = TableReader::open(dir, FILE, COLUMNS)?;
    let by_name: BTreeMap<NodeName, NodeId> = skeleton
        .nodes
        .iter()
        .enumerate()
        .map(|(i, n)| (n.name, NodeId(i as u32)))
        .collect();
    let mut node_of: BTreeMap<TrackId, NodeId> = BTreeMap::new();
    let mut log = TrackLog::new(window_s);
    let (mut frame_s, mut observations) = (f64::NEG_INFINITY, Vec::new());
    while table.next()? {
        let id = TrackId(table.whole(0, "track_id")?);
        let time_s = table.number(2, "time_s")?;
        // In any other order every row would be a frame of its own, with room for all points.
        if time_s < frame_s {
            let what =
                "rows of one frame stand together, in order of time; sort the table by frame";
            return Err(table.bad(format!(
                "time_s is {time_s}, after {frame_s} in the row before: {what}"
            )));
        }
        if time_s > frame_s {
            push(&mut log, frame_s, &mut observations);
            frame_s = time_s;
        }
        // A point that is nowhere has no place, as it was not seen.
        let [u_px, v_px] = [table.cell(3), table.cell(4)].map(|c| c.parse().unwrap_or(f32::NAN));
        if within_s.contains(time_s) {
            observations.push(Observation {
                id,
                u_px,
                v_px,
                fb_error_px: 0.0,
                error_px: None,
                confirmed: true,
            });
        }
        if !table.cell(5).is_empty() {
            let name = NodeName(table.whole(5, "node_id")?);
            let node = by_name
                .get(&name)
                .ok_or_else(|| table.bad(format!("there is no node {}", name.0)))?;
            node_of.insert(id, *node);
        }
    }
    push(&mut log, frame_s, &mut observations);
    Ok(Film::from_log(log.all(), skeleton, |id| {
        node_of.get(&id).copied()
    }))
}

/// Hands a frame's points over; a frame without any was not filmed.
fn push(log: &mut TrackLog, time_s: f64, observations: &mut Vec<Observation>) {
    if !observations.is_empty() {
        log.push(TrackSet {
            time_s,
            observations: std::mem::take(observations),
            ..TrackSet::default()
        });
    }
}

/// Copies `tracks.csv` of the document in `from`; a point whose node is not among `nodes` any more
/// is written without one, as points that move nothing are.
///
/// # Errors
/// The table cannot be read, or not be written to its end; `stop` was set meanwhile.
pub fn tracks_of(
    folder: &OutputFolder,
    from: &Path,
    nodes: &BTreeSet<NodeName>,
    stop: &AtomicBool,
) -> Result<(), WriteError> {
    let mut table = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_path(from.join(FILE))
        .map_err(|e| explain(folder, e))?;
    let mut out = Writer::from_writer(folder.file(FILE)?);
    let (mut row, mut column) = (StringRecord::new(), None);
    while table
        .read_record(&mut row)
        .map_err(|e| explain(folder, e))?
    {
        if stop.load(Ordering::SeqCst) {
            return Err(WriteError::Stopped);
        }
        let at = *column.get_or_insert_with(|| {
            row.iter()
                .position(|name| name == "node_id")
                .unwrap_or(usize::MAX)
        });
        let gone = row.get(at).is_some_and(|cell| is_gone(cell, nodes));
        let cells = row.iter().enumerate();
        let cells = cells.map(|(i, cell)| if gone && i == at { "" } else { cell });
        out.write_record(cells).map_err(|e| explain(folder, e))?;
    }
    out.flush().map_err(|e| folder.explain(FILE, 0, e))
}

/// Whether a cell names a node that is not among `nodes`.
fn is_gone(cell: &str, nodes: &BTreeSet<NodeName>) -> bool {
    let name = cell.parse().map(NodeName);
    name.is_ok_and(|name| !nodes.contains(&name))
}

fn explain(folder: &OutputFolder, e: csv::Error) -> WriteError {
    match e.into_kind() {
        csv::ErrorKind::Io(e) => folder.explain(FILE, 0, e),
        other => {
            let what = format!("tracks.csv of the capture is damaged ({other:?})");
            folder.explain(FILE, 0, io::Error::other(what))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn points_of_branches_that_are_gone_have_none() {
        let dir = tempfile::tempdir().unwrap();
        let text = "track_id,frame,time_s,u_px,v_px,node_id\n1,0,0,3.5,4,7\n2,0,0,3,4,8\n3,0,0,3,4,\n1,1,0.1,3,4,7\n";
        fs::write(dir.path().join(FILE), text).unwrap();
        let folder = OutputFolder::create(&dir.path().join("out")).unwrap();
        let nodes = BTreeSet::from([NodeName(0), NodeName(8)]);
        tracks_of(&folder, dir.path(), &nodes, &AtomicBool::new(false)).unwrap();
        let written = fs::read_to_string(folder.path(FILE)).unwrap();
        assert_eq!(written, text.replace("4,7\n", "4,\n"));
        fs::write(dir.path().join(FILE), [b'a', 0xff, b'\n']).unwrap();
        let damaged = tracks_of(&folder, dir.path(), &nodes, &AtomicBool::new(false))
            .unwrap_err()
            .to_string();
        assert!(
            damaged.contains("damaged") && !damaged.contains('\n'),
            "{damaged}"
        );
    }
}
