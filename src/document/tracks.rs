//! `tracks.csv`: every point in every frame in which it was seen, where it was filmed;
//! `left_out.csv`: the same of those that were left out of the tree.

use super::camera::{self, CameraReader};
use super::error::DocumentError;
use super::number;
use super::table::{TIME_DECIMALS, TableReader, TableWriter};
use crate::bounds::Bounds;
use crate::dynamics::Film;
use crate::files::{OutputFolder, WriteError};
use crate::model::{
    CameraMotion, DepthSeen, LogWindow, NodeId, NodeName, Observation, Skeleton, TrackId, TrackLog,
    TrackSet,
};
use csv::{ReaderBuilder, StringRecord, Writer};
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// The name of the table.
pub const TRACKS_FILE: &str = "tracks.csv";
/// The points that were left out of the tree, in a table like that of the others.
pub const LEFT_OUT_FILE: &str = "left_out.csv";
pub const TRACKS_HEADER: &str = "track_id,frame,time_s,u_px,v_px,node_id";
/// The same with what a depth camera has seen of the points.
pub const TRACKS_WITH_DEPTH_HEADER: &str =
    "track_id,frame,time_s,u_px,v_px,node_id,depth_m,depth_sd_m";
const COLUMNS: [&str; 6] = ["track_id", "frame", "time_s", "u_px", "v_px", "node_id"];
const PX_DECIMALS: usize = 3;

/// Writes `tracks.csv` or `left_out.csv`.
pub struct TracksCsv<W: Write> {
    table: TableWriter<W>,
    has_depth: bool,
}

impl<W: Write> TracksCsv<W> {
    /// `has_depth`: with columns for it, in a film that has depth.
    ///
    /// # Errors
    /// The header cannot be written.
    pub fn new(out: W, has_depth: bool) -> Result<Self, WriteError> {
        Self::begin(TRACKS_FILE, out, has_depth)
    }

    /// The table of the points that were left out of the tree.
    ///
    /// # Errors
    /// The header cannot be written.
    pub fn of_left_out(out: W, has_depth: bool) -> Result<Self, WriteError> {
        Self::begin(LEFT_OUT_FILE, out, has_depth)
    }

    fn begin(file: &'static str, out: W, has_depth: bool) -> Result<Self, WriteError> {
        let header = if has_depth {
            TRACKS_WITH_DEPTH_HEADER
        } else {
            TRACKS_HEADER
        };
        let table = TableWriter::new(file, header, out)?;
        Ok(Self { table, has_depth })
    }

    /// A point of the frame `set`, where it was filmed; `node` is the deepest one that it belongs to.
    ///
    /// # Errors
    /// The row cannot be written.
    pub fn row(
        &mut self,
        set: &TrackSet,
        point: &Observation,
        node: Option<NodeName>,
    ) -> Result<(), WriteError> {
        let table = &mut self.table;
        table.count(point.id.0);
        table.count(set.frame);
        table.number(set.time_s, TIME_DECIMALS);
        set.filmed_px(point)
            .iter()
            .for_each(|x| table.number(*x, PX_DECIMALS));
        table.id(node);
        if self.has_depth {
            let (depth_m, sd_m) = point
                .depth
                .map_or((f32::NAN, f32::NAN), |d| (d.depth_m, d.sd_m));
            table.number(depth_m.into(), 4);
            table.number(sd_m.into(), 4);
        }
        table.end_row()
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
            self.row(set, o, node_of(o.id))?;
        }
        Ok(())
    }

    /// Ends the file and gives the writer back; without this, errors of the last rows would be
    /// lost.
    ///
    /// # Errors
    /// The last rows cannot be written.
    pub fn finish(self) -> Result<W, WriteError> {
        self.table.finish()
    }
}

/// The points of the last `window_s` seconds of what lies between two times, s, in the document in
/// `dir`, on the nodes of
/// `skeleton`, those that were left out of the tree among them; a point is on the node that its last
/// row says. The tables go by row by row, so that a long capture takes no more room than what is
/// kept of it; that needs their rows in order of time.
///
/// # Errors
/// A table is missing or damaged, or its times run backwards.
pub(super) fn read_film(
    dir: &Path,
    skeleton: &Skeleton,
    window_s: f64,
    within_s: Bounds,
) -> Result<Film, DocumentError> {
    let points = read_points(dir, skeleton, window_s, within_s)?;
    Ok(points.film(skeleton))
}

/// The points of `window` on the nodes of `skeleton`, as the tables of a document that holds them give
/// them back: places and times have few decimals there, and an analysis asks questions that the last
/// one may decide.
pub fn film_as_read(
    window: LogWindow,
    skeleton: &Skeleton,
    node_of: impl Fn(TrackId) -> Option<NodeId>,
) -> Film {
    let mut log = TrackLog::new(f64::INFINITY);
    for set in window.sets() {
        let camera = camera::as_read(&set.camera, skeleton.image_size);
        let points = set.observations.iter();
        let observations = points.map(|o| steady(&point_as_read(set, o), &camera));
        let time_s = number::as_read(set.time_s, TIME_DECIMALS);
        push(&mut log, time_s, observations.collect());
    }
    Film::from_log(log.all(), skeleton, node_of)
}

/// A point of a frame where it was filmed.
fn point_as_read(set: &TrackSet, point: &Observation) -> Observation {
    let filmed_px = set.filmed_px(point);
    let [u_px, v_px] = [filmed_px.x, filmed_px.y].map(|x| number::as_read(x, PX_DECIMALS));
    at_px(point.id, u_px, v_px)
}

/// A point that was filmed, without the camera's motion.
fn steady(filmed: &Observation, camera: &CameraMotion) -> Observation {
    let steady_px = camera.steady_px(filmed.at_px()).cast::<f32>();
    Observation {
        u_px: steady_px.x,
        v_px: steady_px.y,
        ..*filmed
    }
}

/// A point of which no more is known than where it was filmed, px.
fn at_px(id: TrackId, u_px: f32, v_px: f32) -> Observation {
    Observation {
        id,
        u_px,
        v_px,
        fb_error_px: 0.0,
        error_px: None,
        confirmed: true,
        depth: None,
    }
}

/// How far away a point was at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DepthAt {
    pub time_s: f64,
    /// Along the camera's axis, m.
    pub depth_m: f64,
}

/// Points of a film, without the camera's motion, and on which node each of them is.
pub(super) struct PointsRead {
    log: TrackLog,
    node_of: BTreeMap<TrackId, NodeId>,
    /// The film has depth, whether any was seen or not.
    pub has_depth: bool,
}

impl PointsRead {
    /// The points that are on nodes of `skeleton`.
    fn film(&self, skeleton: &Skeleton) -> Film {
        Film::from_log(self.log.all(), skeleton, |id| {
            self.node_of.get(&id).copied()
        })
    }

    /// The points that `node_of` puts on nodes of another skeleton.
    pub fn film_on(
        &self,
        skeleton: &Skeleton,
        node_of: impl Fn(TrackId) -> Option<NodeId>,
    ) -> Film {
        Film::from_log(self.log.all(), skeleton, node_of)
    }

    /// The node that a point is on; `None` where on none.
    pub fn node(&self, id: TrackId) -> Option<NodeId> {
        self.node_of.get(&id).copied()
    }

    /// Where a point was seen, px.
    pub fn places_px(&self, id: TrackId) -> Vec<Point2<f64>> {
        let sets = self.log.all();
        let seen = sets.sets().flat_map(|set| &set.observations);
        seen.filter(|o| o.id == id)
            .map(Observation::at_px)
            .collect()
    }

    /// How far away a depth camera has seen a point, in order of time.
    pub fn depths(&self, id: TrackId) -> Vec<DepthAt> {
        let mut depths = Vec::new();
        for set in self.log.all().sets() {
            let seen = set.observations.iter().find(|o| o.id == id);
            if let Some(depth) = seen.and_then(|o| o.depth) {
                depths.push(DepthAt {
                    time_s: set.time_s,
                    depth_m: depth.depth_m.into(),
                });
            }
        }
        depths
    }
}

/// What [`read_film`] reads, before it is put on nodes.
///
/// # Errors
/// As for [`read_film`].
pub(super) fn read_points(
    dir: &Path,
    skeleton: &Skeleton,
    window_s: f64,
    within_s: Bounds,
) -> Result<PointsRead, DocumentError> {
    let nodes = skeleton.nodes.iter().zip(0..);
    let by_name: BTreeMap<NodeName, NodeId> = nodes.map(|(n, i)| (n.name, NodeId(i))).collect();
    let mut tables = vec![TracksReader::open(dir, TRACKS_FILE, &by_name)?];
    // Older captures have left nothing out.
    if dir.join(LEFT_OUT_FILE).exists() {
        tables.push(TracksReader::open(dir, LEFT_OUT_FILE, &by_name)?);
    }
    let has_depth = tables.iter().any(|table| table.depth.depth_m.is_some());
    let mut camera = CameraReader::open(dir, skeleton.image_size)?;
    let mut node_of: BTreeMap<TrackId, NodeId> = BTreeMap::new();
    let mut log = TrackLog::new(window_s);
    loop {
        let times_s = tables.iter().filter_map(|t| Some(t.next.as_ref()?.time_s));
        let Some(time_s) = times_s.min_by(f64::total_cmp) else {
            break;
        };
        let camera = match &mut camera {
            Some(camera) => camera.at(time_s)?,
            None => CameraMotion::default(),
        };
        let mut observations = Vec::new();
        for table in &mut tables {
            while let Some(row) = table.take_at(time_s)? {
                if within_s.contains(time_s) {
                    observations.push(steady(&row.observation, &camera));
                }
                if let Some(node) = row.node {
                    node_of.insert(row.observation.id, node);
                }
            }
        }
        push(&mut log, time_s, observations);
    }
    Ok(PointsRead {
        log,
        node_of,
        has_depth,
    })
}

/// Reads a table of points row by row.
struct TracksReader<'a> {
    table: TableReader<File, 6>,
    depth: DepthColumns,
    by_name: &'a BTreeMap<NodeName, NodeId>,
    next: Option<TrackRow>,
}

/// The columns of what a depth camera has seen, which a film without one lacks.
struct DepthColumns {
    depth_m: Option<usize>,
    sd_m: Option<usize>,
}

impl DepthColumns {
    fn of(table: &TableReader<File, 6>) -> Self {
        Self {
            depth_m: table.optional("depth_m"),
            sd_m: table.optional("depth_sd_m"),
        }
    }

    /// What the present row says; `None` where the depth camera saw nothing.
    ///
    /// # Errors
    /// A cell holds words.
    fn seen(&self, table: &TableReader<File, 6>) -> Result<Option<DepthSeen>, DocumentError> {
        let depth_m = table.known_optional(self.depth_m, "depth_m")?;
        let sd_m = table.known_optional(self.sd_m, "depth_sd_m")?;
        Ok(match (depth_m, sd_m) {
            (Some(depth_m), Some(sd_m)) if depth_m > 0.0 => Some(DepthSeen {
                depth_m: depth_m as f32,
                sd_m: sd_m as f32,
            }),
            _ => None,
        })
    }
}

/// One point in one frame.
struct TrackRow {
    time_s: f64,
    /// Where it was filmed.
    observation: Observation,
    node: Option<NodeId>,
}

impl<'a> TracksReader<'a> {
    fn open(
        dir: &Path,
        file: &'static str,
        by_name: &'a BTreeMap<NodeName, NodeId>,
    ) -> Result<Self, DocumentError> {
        let table = TableReader::open(dir, file, COLUMNS)?;
        let mut reader = Self {
            depth: DepthColumns::of(&table),
            table,
            by_name,
            next: None,
        };
        reader.next = reader.read()?;
        Ok(reader)
    }

    /// The next row, if it is of this time, s.
    fn take_at(&mut self, time_s: f64) -> Result<Option<TrackRow>, DocumentError> {
        if self.next.as_ref().is_none_or(|row| row.time_s != time_s) {
            return Ok(None);
        }
        let following = self.read()?;
        // In any other order every row would be a frame of its own, with room for all points.
        if let Some(row) = following.as_ref().filter(|row| row.time_s < time_s) {
            let what =
                "rows of one frame stand together, in order of time; sort the table by frame";
            return Err(self.table.bad(format!(
                "time_s is {}, after {time_s} in the row before: {what}",
                row.time_s
            )));
        }
        Ok(std::mem::replace(&mut self.next, following))
    }

    fn read(&mut self) -> Result<Option<TrackRow>, DocumentError> {
        let table = &mut self.table;
        if !table.next()? {
            return Ok(None);
        }
        // A point that is nowhere has no place, as it was not seen.
        let u_px = table.known_px(3, "u_px")?.unwrap_or(f64::NAN) as f32;
        let v_px = table.known_px(4, "v_px")?.unwrap_or(f64::NAN) as f32;
        let mut row = TrackRow {
            time_s: table.number(2, "time_s")?,
            observation: at_px(TrackId(table.whole(0, "track_id")?), u_px, v_px),
            node: None,
        };
        row.observation.depth = self.depth.seen(table)?;
        if !table.cell(5).is_empty() {
            let name = NodeName(table.whole(5, "node_id")?);
            let node = self.by_name.get(&name).copied();
            let node = node.ok_or_else(|| table.bad(format!("there is no node {}", name.0)))?;
            row.node = Some(node);
        }
        Ok(Some(row))
    }
}

/// Hands a frame's points over; a frame without any was not filmed.
fn push(log: &mut TrackLog, time_s: f64, observations: Vec<Observation>) {
    if !observations.is_empty() {
        log.push(TrackSet {
            time_s,
            observations,
            ..TrackSet::default()
        });
    }
}

/// Copies the table of points `file` of the document in `from`; a point whose node is not among
/// `nodes` any more is written without one, as points on no branch are.
///
/// # Errors
/// The table cannot be read, or not be written to its end; `stop` was set meanwhile.
pub fn tracks_of(
    folder: &OutputFolder,
    file: &'static str,
    from: &Path,
    nodes: &BTreeSet<NodeName>,
    stop: &AtomicBool,
) -> Result<(), WriteError> {
    let mut table = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_path(from.join(file))
        .map_err(|e| explain(folder, file, e))?;
    let mut out = Writer::from_writer(folder.file(file)?);
    let (mut row, mut column) = (StringRecord::new(), None);
    while table
        .read_record(&mut row)
        .map_err(|e| explain(folder, file, e))?
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
        out.write_record(cells)
            .map_err(|e| explain(folder, file, e))?;
    }
    out.flush().map_err(|e| folder.explain(file, 0, e))
}

/// Whether a cell names a node that is not among `nodes`.
fn is_gone(cell: &str, nodes: &BTreeSet<NodeName>) -> bool {
    let name = cell.parse().map(NodeName);
    name.is_ok_and(|name| !nodes.contains(&name))
}

fn explain(folder: &OutputFolder, file: &'static str, e: csv::Error) -> WriteError {
    match e.into_kind() {
        csv::ErrorKind::Io(e) => folder.explain(file, 0, e),
        other => {
            let what = format!("{file} of the capture is damaged ({other:?})");
            folder.explain(file, 0, io::Error::other(what))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::CameraCsv;
    use crate::model::{Node, Size};
    use nalgebra::{Similarity2, Vector2};
    use std::fs;

    /// The foot and node 7.
    fn one_branch() -> Skeleton {
        Skeleton {
            nodes: vec![
                Node::made_up(0, None, [0.0; 3]),
                Node::made_up(7, Some(0), [0.0, 9.0, 0.0]),
            ],
            foot_px: Point2::origin(),
            image_size: Size::new(640, 480),
        }
    }

    /// The sway is that of all points.
    #[test]
    fn points_that_were_left_out_are_read_with_the_others() {
        let dir = tempfile::tempdir().unwrap();
        let write = |file, rows: &str| {
            fs::write(dir.path().join(file), format!("{TRACKS_HEADER}\n{rows}")).unwrap();
        };
        let skeleton = one_branch();
        let read = || read_film(dir.path(), &skeleton, 60.0, Bounds::new(0.0, 60.0));
        write(TRACKS_FILE, "1,0,0,3.5,4,7\n1,1,0.1,3,4,7\n1,3,0.3,3,5,7\n");
        let older = read().unwrap();
        assert_eq!((older.times_s.len(), older.tracks.len()), (3, 1));
        write(LEFT_OUT_FILE, "2,0,0,8,9,7\n2,2,0.2,8,8,7\n");
        let film = read().unwrap();
        assert_eq!(film.times_s, [0.0, 0.1, 0.2, 0.3]);
        let seen = |k: usize| film.tracks[k].at_px.iter().map(|p| p.x.is_finite());
        assert!(seen(0).eq([true, true, false, true]));
        assert!(seen(1).eq([true, false, true, false]));
        write(LEFT_OUT_FILE, "2,2,0.2,8,8,7\n2,0,0,8,9,7\n");
        let reordered = read().unwrap_err().to_string();
        assert!(reordered.contains(LEFT_OUT_FILE), "{reordered}");
        // Cut off in the middle of a line.
        write(LEFT_OUT_FILE, "2,0,0,8,9,7\n2,1,0.1,8\n");
        let cut = read().unwrap_err().to_string();
        assert!(
            cut.contains("line 3") && cut.contains("it has 4 cells, and the first line 6"),
            "{cut}"
        );
    }

    #[test]
    fn depths_that_were_seen_are_read_and_no_others() {
        let dir = tempfile::tempdir().unwrap();
        let rows = "1,0,0,3.5,4,7,2.0312,0.004\n1,1,0.1,3,4,7,,\n1,2,0.2,3,5,7,1.98,0.004\n2,2,0.2,3,5,7,0,0.1\n";
        let text = format!("{TRACKS_WITH_DEPTH_HEADER}\n{rows}");
        fs::write(dir.path().join(TRACKS_FILE), text).unwrap();
        let points = read_points(dir.path(), &one_branch(), 60.0, Bounds::new(0.0, 60.0)).unwrap();
        let depths = points.depths(TrackId(1));
        let times_s: Vec<f64> = depths.iter().map(|at| at.time_s).collect();
        assert_eq!(times_s, [0.0, 0.2]);
        assert!(
            (depths[0].depth_m - 2.0312).abs() < 1e-6 && (depths[1].depth_m - 1.98).abs() < 1e-6
        );
        assert_eq!(points.depths(TrackId(2)), []);
    }

    /// To the last bit, of a camera that moves: what an analysis finds may hang on it.
    #[test]
    fn a_film_is_known_as_its_tables_give_it_back() {
        let dir = tempfile::tempdir().unwrap();
        let skeleton = one_branch();
        let mut log = TrackLog::new(60.0);
        for frame in 0..90_u32 {
            let turn = 0.1 * f64::from(frame);
            let shift = Vector2::new(1.7 * turn.sin(), -0.3 * turn.cos());
            let at = |id: u32| at_px(TrackId(id), 300.0 + 7.0 * turn.cos() as f32 / 3.0, 211.1);
            let ids = if frame == 40 { 0..0 } else { 1..4_u32 };
            log.push(TrackSet {
                frame: frame.into(),
                time_s: f64::from(frame) / 30.0,
                camera: CameraMotion {
                    filmed_from_steady: Similarity2::new(
                        shift,
                        1e-3 * turn.sin(),
                        1.0 + 1e-5 * turn,
                    ),
                    ..CameraMotion::default()
                },
                observations: ids.map(at).collect(),
                ..TrackSet::default()
            });
        }
        let file = |name: &str| File::create(dir.path().join(name)).unwrap();
        let mut tracks = TracksCsv::new(file(TRACKS_FILE), false).unwrap();
        let mut camera = CameraCsv::new(file(camera::CAMERA_FILE), skeleton.image_size).unwrap();
        for set in log.all().sets() {
            tracks
                .set(set, |id| (id.0 < 3).then_some(NodeName(7)))
                .unwrap();
            camera.set(set).unwrap();
        }
        tracks.finish().unwrap();
        camera.finish().unwrap();
        let read = read_film(dir.path(), &skeleton, 60.0, Bounds::new(0.0, 60.0)).unwrap();
        let known = film_as_read(log.all(), &skeleton, |id| (id.0 < 3).then_some(NodeId(1)));
        assert_eq!((read.times_s.len(), read.tracks.len()), (89, 2));
        assert_eq!(read, known);
        let as_it_was = Film::from_log(log.all(), &skeleton, |_| Some(NodeId(1)));
        assert_ne!(read.tracks[0], as_it_was.tracks[0]);
    }

    #[test]
    fn points_of_branches_that_are_gone_have_none() {
        let dir = tempfile::tempdir().unwrap();
        let text = "track_id,frame,time_s,u_px,v_px,node_id\n1,0,0,3.5,4,7\n2,0,0,3,4,8\n3,0,0,3,4,\n1,1,0.1,3,4,7\n";
        fs::write(dir.path().join(TRACKS_FILE), text).unwrap();
        let folder = OutputFolder::create(&dir.path().join("out")).unwrap();
        let nodes = BTreeSet::from([NodeName(0), NodeName(8)]);
        tracks_of(
            &folder,
            TRACKS_FILE,
            dir.path(),
            &nodes,
            &AtomicBool::new(false),
        )
        .unwrap();
        let written = fs::read_to_string(folder.path(TRACKS_FILE)).unwrap();
        assert_eq!(written, text.replace("4,7\n", "4,\n"));
        fs::write(dir.path().join(TRACKS_FILE), [b'a', 0xff, b'\n']).unwrap();
        let damaged = tracks_of(
            &folder,
            TRACKS_FILE,
            dir.path(),
            &nodes,
            &AtomicBool::new(false),
        )
        .unwrap_err()
        .to_string();
        assert!(
            damaged.contains("damaged") && !damaged.contains('\n'),
            "{damaged}"
        );
    }
}
