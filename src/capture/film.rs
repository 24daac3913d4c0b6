//! `tracks.csv` back to the points of a film.

use super::CaptureError;
use super::table::Table;
use crate::dynamics::{Film, FilmLog};
use crate::model::{NodeId, NodeName, Skeleton, TrackId};
use std::collections::BTreeMap;
use std::path::Path;

const COLUMNS: [&str; 6] = ["track_id", "frame", "time_s", "u_px", "v_px", "node_id"];

/// The points of the last `window_s` seconds of what lies between two times, s, in the capture in
/// `dir`, on the nodes of
/// `skeleton`; a point is on the node that its last row says. The table goes by row by row, so that
/// a long capture takes no more room than what is kept of it; that needs its rows in order of time.
///
/// # Errors
/// The table is missing or damaged, or its times run backwards.
pub(super) fn read(
    dir: &Path,
    skeleton: &Skeleton,
    window_s: f64,
    [from_s, to_s]: [f64; 2],
) -> Result<Film, CaptureError> {
    let mut table = Table::open(dir, "tracks.csv", COLUMNS)?;
    let by_name: BTreeMap<NodeName, NodeId> = skeleton
        .nodes
        .iter()
        .enumerate()
        .map(|(i, n)| (n.name, NodeId(i as u32)))
        .collect();
    let mut node_of: BTreeMap<TrackId, NodeId> = BTreeMap::new();
    let mut log = FilmLog::new(window_s);
    let (mut frame_s, mut points) = (f64::NEG_INFINITY, Vec::new());
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
            push(&mut log, frame_s, &mut points);
            frame_s = time_s;
        }
        // A point that is nowhere has no place, as it was not seen.
        let at = [table.cell(3), table.cell(4)].map(|c| c.parse().unwrap_or(f32::NAN));
        if from_s <= time_s && time_s <= to_s {
            points.push((id, at));
        }
        if !table.cell(5).is_empty() {
            let name = NodeName(table.whole(5, "node_id")?);
            let node = by_name
                .get(&name)
                .ok_or_else(|| table.bad(format!("there is no node {}", name.0)))?;
            node_of.insert(id, *node);
        }
    }
    push(&mut log, frame_s, &mut points);
    Ok(log.film(skeleton, |id| node_of.get(&id).copied()))
}

/// Hands a frame's points over; a frame without any was not filmed.
fn push(log: &mut FilmLog, time_s: f64, points: &mut Vec<(TrackId, [f32; 2])>) {
    if !points.is_empty() {
        log.push_points(time_s, points.drain(..));
    }
}
