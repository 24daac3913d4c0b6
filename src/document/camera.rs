//! `camera.csv`: how the camera itself moved, frame by frame.

use super::error::DocumentError;
use super::number;
use super::table::{TIME_DECIMALS, TableReader, TableWriter};
use crate::files::WriteError;
use crate::model::{Agreement, Background, CameraMotion, Size, TrackSet};
use nalgebra::{Point2, Similarity2, UnitComplex, Vector2};
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// The name of the table.
pub const CAMERA_FILE: &str = "camera.csv";
pub const CAMERA_HEADER: &str =
    "frame,time_s,dx_px,dy_px,roll_deg,scale,inliers,rms_px,sd_px,background";

const COLUMNS: [&str; 5] = ["time_s", "dx_px", "dy_px", "roll_deg", "scale"];
/// Of all columns but the time.
const DECIMALS: [usize; 4] = [4, 4, 7, 9];
/// Scales beyond these are no camera's motion.
const LEAST_SCALE: f64 = 0.01;
const LARGEST_SCALE: f64 = 100.0;

/// Writes `camera.csv`. What stands still was filmed turned by `roll_deg` (from u to v) and scaled
/// about the middle of the picture, and shifted by `dx_px` and `dy_px`, against the first frame.
pub struct CameraCsv<W: Write> {
    table: TableWriter<W>,
    middle_px: Point2<f64>,
}

impl<W: Write> CameraCsv<W> {
    /// For pictures of this size.
    ///
    /// # Errors
    /// The header cannot be written.
    pub fn new(out: W, size: Size) -> Result<Self, WriteError> {
        Ok(Self {
            table: TableWriter::new(CAMERA_FILE, CAMERA_HEADER, out)?,
            middle_px: middle_px(size),
        })
    }

    /// The camera's motion in one frame.
    ///
    /// # Errors
    /// The row cannot be written.
    pub fn set(&mut self, set: &TrackSet) -> Result<(), WriteError> {
        let table = &mut self.table;
        table.count(set.frame);
        table.number(set.time_s, TIME_DECIMALS);
        let cells = cells(&set.camera, self.middle_px);
        for (value, decimals) in cells.into_iter().zip(DECIMALS) {
            table.number(value, decimals);
        }
        match set.camera.background {
            Background::Seen(agreement) => agreed(table, agreement, "seen"),
            Background::Foot(agreement) => agreed(table, agreement, "foot"),
            Background::Unclear => nothing_seen(table, "unclear"),
            Background::Lost => nothing_seen(table, "lost"),
        }
        table.end_row()
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

fn agreed<W: Write>(table: &mut TableWriter<W>, agreement: Agreement, background: &str) {
    table.count(agreement.inliers);
    table.number(agreement.rms_px, 4);
    table.number(agreement.sd_px, 4);
    table.text(background);
}

fn nothing_seen<W: Write>(table: &mut TableWriter<W>, background: &str) {
    table.count(0_u64);
    table.text("");
    table.text("");
    table.text(background);
}

/// What the table says of a motion: `dx_px`, `dy_px`, `roll_deg` and `scale`.
fn cells(motion: &CameraMotion, middle_px: Point2<f64>) -> [f64; 4] {
    let motion = &motion.filmed_from_steady;
    let shift_px = motion * middle_px - middle_px;
    let roll_deg = motion.isometry.rotation.angle().to_degrees();
    [shift_px.x, shift_px.y, roll_deg, motion.scaling()]
}

/// The motion of which the table says this.
fn motion([dx_px, dy_px, roll_deg, scale]: [f64; 4], middle_px: Point2<f64>) -> CameraMotion {
    let roll = UnitComplex::new(roll_deg.to_radians());
    let shift = middle_px.coords + Vector2::new(dx_px, dy_px) - scale * (roll * middle_px.coords);
    CameraMotion {
        filmed_from_steady: Similarity2::from_parts(shift.into(), roll, scale),
        // What is made of the points does not ask for it.
        background: Background::Unclear,
    }
}

/// A motion in pictures of this size as the table gives it back.
pub(super) fn as_read(of: &CameraMotion, size: Size) -> CameraMotion {
    let middle_px = middle_px(size);
    let mut cells = cells(of, middle_px);
    for (value, decimals) in cells.iter_mut().zip(DECIMALS) {
        *value = number::as_read(*value, decimals);
    }
    motion(cells, middle_px)
}

/// The middle of a picture, px.
fn middle_px(size: Size) -> Point2<f64> {
    let (width, height) = (f64::from(size.width), f64::from(size.height));
    Point2::new(0.5 * (width - 1.0), 0.5 * (height - 1.0))
}

/// Reads the table row by row, along with others.
pub(super) struct CameraReader {
    table: TableReader<File, 5>,
    middle_px: Point2<f64>,
    next: Option<CameraRow>,
}

struct CameraRow {
    time_s: f64,
    motion: CameraMotion,
}

impl CameraReader {
    /// Opens the table in `dir`, of pictures of this size; `None` where there is none, as in older
    /// captures.
    ///
    /// # Errors
    /// It cannot be read, or lacks a column.
    pub fn open(dir: &Path, size: Size) -> Result<Option<Self>, DocumentError> {
        if !dir.join(CAMERA_FILE).exists() {
            return Ok(None);
        }
        let mut reader = Self {
            table: TableReader::open(dir, CAMERA_FILE, COLUMNS)?,
            middle_px: middle_px(size),
            next: None,
        };
        reader.next = reader.read()?;
        Ok(Some(reader))
    }

    /// The camera's motion at a time, s, later than those that were asked for before; a camera that
    /// stands still where the table has no such row.
    ///
    /// # Errors
    /// A row is damaged.
    pub fn at(&mut self, time_s: f64) -> Result<CameraMotion, DocumentError> {
        while self.next.as_ref().is_some_and(|row| row.time_s < time_s) {
            self.next = self.read()?;
        }
        let row = self.next.as_ref().filter(|row| row.time_s == time_s);
        Ok(row.map_or(CameraMotion::default(), |row| row.motion))
    }

    fn read(&mut self) -> Result<Option<CameraRow>, DocumentError> {
        let table = &mut self.table;
        if !table.next()? {
            return Ok(None);
        }
        let dx_px = table.length_px(1, "dx_px", 1.0)?;
        let dy_px = table.length_px(2, "dy_px", 1.0)?;
        let roll_deg = table.number(3, "roll_deg")?;
        let scale = table.number(4, "scale")?;
        if !(LEAST_SCALE..=LARGEST_SCALE).contains(&scale) {
            return Err(table.bad(format!(
                "scale is {scale}, and must be {LEAST_SCALE} to {LARGEST_SCALE}"
            )));
        }
        Ok(Some(CameraRow {
            time_s: table.number(0, "time_s")?,
            motion: motion([dx_px, dy_px, roll_deg, scale], self.middle_px),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Agreement;
    use std::fs;

    const SIZE: Size = Size {
        width: 1920,
        height: 1080,
    };

    fn set(frame: u64) -> TrackSet {
        let shift_px = Vector2::new(0.5 * frame as f64, -12.25);
        TrackSet {
            frame,
            time_s: frame as f64 / 30.0,
            camera: CameraMotion {
                filmed_from_steady: Similarity2::new(shift_px, 0.01, 1.0 + 1e-4 * frame as f64),
                background: Background::Seen(Agreement::default()),
            },
            ..TrackSet::default()
        }
    }

    /// Times as `tracks.csv` has them.
    fn written_s(set: &TrackSet) -> f64 {
        format!("{:.6}", set.time_s).parse().unwrap()
    }

    #[test]
    fn the_motion_is_read_back_to_a_hundredth_of_a_pixel() {
        let dir = tempfile::tempdir().unwrap();
        let file = File::create(dir.path().join(CAMERA_FILE)).unwrap();
        let mut table = CameraCsv::new(file, SIZE).unwrap();
        for frame in [0, 1, 3] {
            table.set(&set(frame)).unwrap();
        }
        table.finish().unwrap();
        let mut reader = CameraReader::open(dir.path(), SIZE).unwrap().unwrap();
        let corner = Point2::new(1920.0, 1080.0);
        for frame in 0..4 {
            let set = set(frame);
            let read = reader.at(written_s(&set)).unwrap().filmed_px(corner);
            let expected = if frame == 2 {
                corner
            } else {
                set.camera.filmed_px(corner)
            };
            assert!((read - expected).norm() < 0.01, "{frame}: {read}");
        }
    }

    #[test]
    fn a_camera_that_takes_the_picture_away_is_no_camera() {
        let dir = tempfile::tempdir().unwrap();
        assert!(CameraReader::open(dir.path(), SIZE).unwrap().is_none());
        let text = format!("{CAMERA_HEADER}\n0,0,1,2,0,0,9,0.1,0.1,seen\n");
        fs::write(dir.path().join(CAMERA_FILE), text).unwrap();
        let refused = CameraReader::open(dir.path(), SIZE)
            .err()
            .unwrap()
            .to_string();
        assert!(refused.contains("scale is 0"), "{refused}");
    }
}
