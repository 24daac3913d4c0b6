//! `tracks.csv`, `nodes.csv` and `motion.csv` over any writer, row by row.
//!
//! Times are seconds with up to 6 decimals, pixels up to 3, lengths in the model up to 4. Unknown
//! is an empty cell.

use super::sway::cells;
use super::{ExportError, number};
use crate::model::{NodeName, Pose, Skeleton, Swaying, TrackId, TrackSet, Unidentified};
use std::io::Write;
use std::sync::Arc;

pub const TRACKS_HEADER: &str = "track_id,frame,time_s,u_px,v_px,node_id";
pub const NODES_HEADER: &str = "node_id,parent_id,level,n_tracks,u_px,v_px,x,y,z,radius,frequency_hz,\
frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,damping_hi,identifiable,\
excitation,amplitude_deg,unidentified";
pub const MOTION_HEADER: &str = "frame,time_s,node_id,x,y,z,u_px,v_px";

/// One CSV file: a row is put together cell by cell.
pub(super) struct Table<W: Write> {
    what: &'static str,
    out: ::csv::Writer<W>,
    row: ::csv::StringRecord,
    cell: String,
    /// Size of the file so far, for the message that the disk is full.
    bytes: u64,
}

impl<W: Write> Table<W> {
    pub(super) fn new(what: &'static str, header: &str, out: W) -> Result<Self, ExportError> {
        let out = ::csv::Writer::from_writer(out);
        let mut table = Self {
            what,
            out,
            row: ::csv::StringRecord::new(),
            cell: String::new(),
            bytes: 0,
        };
        header
            .split(',')
            .for_each(|name| table.row.push_field(name));
        table.end_row()?;
        Ok(table)
    }

    pub(super) fn number(&mut self, x: f64, decimals: usize) {
        self.cell.clear();
        number::push(&mut self.cell, x, decimals);
        self.row.push_field(&self.cell);
    }

    pub(super) fn count(&mut self, n: impl Into<u64>) {
        use std::fmt::Write;
        self.cell.clear();
        let _ = write!(self.cell, "{}", n.into());
        self.row.push_field(&self.cell);
    }

    pub(super) fn id(&mut self, id: Option<NodeName>) {
        match id {
            Some(id) => self.count(id.0),
            None => self.row.push_field(""),
        }
    }

    pub(super) fn end_row(&mut self) -> Result<(), ExportError> {
        self.bytes += (self.row.as_slice().len() + self.row.len()) as u64;
        let written = self.out.write_record(&self.row);
        self.row.clear();
        written.map_err(|e| match e.into_kind() {
            ::csv::ErrorKind::Io(e) => ExportError::from_io(self.what, self.bytes, e),
            other => ExportError::Io {
                what: self.what.into(),
                source: std::io::Error::other(format!("{other:?}")),
            },
        })
    }

    pub(super) fn finish(mut self) -> Result<W, ExportError> {
        let (what, bytes) = (self.what, self.bytes);
        self.out
            .flush()
            .map_err(|e| ExportError::from_io(what, bytes, e))?;
        self.out
            .into_inner()
            .map_err(|e| ExportError::from_io(what, bytes, std::io::Error::other(e.to_string())))
    }
}

/// Writes `tracks.csv`.
pub struct TracksCsv<W: Write>(Table<W>);

impl<W: Write> TracksCsv<W> {
    /// # Errors
    /// The header cannot be written.
    pub fn new(out: W) -> Result<Self, ExportError> {
        Table::new("tracks.csv", TRACKS_HEADER, out).map(Self)
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
        position_px: [f64; 2],
        node: Option<NodeName>,
    ) -> Result<(), ExportError> {
        self.0.count(track.0);
        self.0.count(frame);
        self.0.number(time_s, 6);
        position_px.into_iter().for_each(|x| self.0.number(x, 3));
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
    ) -> Result<(), ExportError> {
        for o in &set.observations {
            self.row(
                o.id,
                set.frame,
                set.time_s,
                [o.u_px.into(), o.v_px.into()],
                node_of(o.id),
            )?;
        }
        Ok(())
    }

    /// Ends the file and gives the writer back; without this, errors of the last rows would be
    /// lost.
    ///
    /// # Errors
    /// The last rows cannot be written.
    pub fn finish(self) -> Result<W, ExportError> {
        self.0.finish()
    }
}

/// Writes `nodes.csv`. `sway` is by node index and may be shorter than the tree; `metres_per_px` 0
/// leaves pixels. A node is identifiable if it has a frequency with its interval; where it is not,
/// the last column says why.
///
/// # Errors
/// The file cannot be written.
pub fn nodes<W: Write>(
    out: W,
    skeleton: &Skeleton,
    sway: &[Swaying],
    metres_per_px: f64,
) -> Result<W, ExportError> {
    let mut table = Table::new("nodes.csv", NODES_HEADER, out)?;
    let (scale, more) = unit(metres_per_px);
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let sway = sway
            .get(i)
            .copied()
            .unwrap_or(Err(Unidentified::NotMeasured));
        table.count(node.name.0);
        table.id(node.parent.and_then(|p| skeleton.name_of(p)));
        table.count(node.level);
        table.count(node.n_tracks);
        skeleton
            .image_from_model(&node.position)
            .into_iter()
            .for_each(|x| table.number(x, 3));
        node.position
            .iter()
            .chain([&node.radius])
            .for_each(|x| table.number(x * scale, 4 + more));
        cells(&sway)
            .iter()
            .for_each(|cell| table.row.push_field(cell));
        table.end_row()?;
    }
    table.finish()
}

/// Writes `motion.csv`.
pub struct MotionCsv<W: Write> {
    table: Table<W>,
    skeleton: Arc<Skeleton>,
    scale: f64,
    decimals: usize,
}

impl<W: Write> MotionCsv<W> {
    /// `metres_per_px` 0 leaves pixels.
    ///
    /// # Errors
    /// The header cannot be written.
    pub fn new(out: W, skeleton: &Arc<Skeleton>, metres_per_px: f64) -> Result<Self, ExportError> {
        let (scale, more) = unit(metres_per_px);
        // One decimal more than other lengths: rounding must not stretch a branch of a few pixels
        // by a thousandth.
        let decimals = 5 + more;
        Ok(Self {
            table: Table::new("motion.csv", MOTION_HEADER, out)?,
            skeleton: skeleton.clone(),
            scale,
            decimals,
        })
    }

    /// Every node in one frame.
    ///
    /// # Errors
    /// A row cannot be written.
    pub fn pose(&mut self, pose: &Pose) -> Result<(), ExportError> {
        for (joint, node) in pose.joints.iter().zip(&self.skeleton.nodes) {
            self.table.count(pose.frame);
            self.table.number(pose.time_s, 6);
            self.table.count(node.name.0);
            joint
                .position
                .iter()
                .for_each(|x| self.table.number(x * self.scale, self.decimals));
            self.skeleton
                .image_from_model(&joint.position)
                .into_iter()
                .for_each(|x| self.table.number(x, 3));
            self.table.end_row()?;
        }
        Ok(())
    }

    /// Ends the file and gives the writer back; without this, errors of the last rows would be
    /// lost.
    ///
    /// # Errors
    /// The last rows cannot be written.
    pub fn finish(self) -> Result<W, ExportError> {
        self.table.finish()
    }
}

/// Length of a pixel in the file's unit, and how many decimals more it takes to say as much in that
/// unit.
pub(super) fn unit(metres_per_px: f64) -> (f64, usize) {
    if metres_per_px > 0.0 {
        (
            metres_per_px,
            (-metres_per_px.log10()).ceil().clamp(0.0, 12.0) as usize,
        )
    } else {
        (1.0, 0)
    }
}
