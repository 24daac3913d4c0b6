//! `tracks.csv` back to the points of a film.

use super::CaptureError;
use super::table::Table;
use crate::dynamics::{Film, FilmLog};
use crate::model::{NodeId, NodeName, Skeleton, TrackId};
use std::collections::BTreeMap;
use std::path::Path;

const COLUMNS: [&str; 6] = ["track_id", "frame", "time_s", "u_px", "v_px", "node_id"];

/// The points of the last `window_s` seconds of what lies between two times, s, in the capture in `dir`, on the nodes of
/// `skeleton`; a point is on the node that its last row says. The table goes by row by row, so that a long capture takes no more room than what is kept of it.
///
/// # Errors
/// The table is missing or damaged.
pub(super) fn read(
    dir: &Path,
    skeleton: &Skeleton,
    window_s: f64,
    [from_s, to_s]: [f64; 2],
) -> Result<Film, CaptureError> {
    let mut table = Table::open(dir, "tracks.csv", COLUMNS)?;
    let by_name: BTreeMap<NodeName, NodeId> =
        skeleton.nodes.iter().enumerate().map(|(i, n)| (n.name, NodeId(i as u32))).collect();
    let mut node_of: BTreeMap<TrackId, NodeId> = BTreeMap::new();
    let mut log = FilmLog::new(window_s);
    while table.next()? {
        let id = TrackId(table.whole(0, "track_id")?);
        let time_s = table.number(2, "time_s")?;
        // A point that is nowhere has no place, as it was not seen.
        let at = [table.cell(3), table.cell(4)].map(|c| c.parse().unwrap_or(f32::NAN));
        if from_s <= time_s && time_s <= to_s {
            log.push_points(time_s, std::iter::once((id, at)));
        }
        if !table.cell(5).is_empty() {
            let name = NodeName(table.whole(5, "node_id")?);
            let node = by_name.get(&name).ok_or_else(|| table.bad(format!("there is no node {}", name.0)))?;
            node_of.insert(id, *node);
        }
    }
    Ok(log.film(skeleton, |id| node_of.get(&id).copied()))
}
