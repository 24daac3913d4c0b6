//! Point clouds in the files of scanners: LAS, LAZ, E57, PLY, PCD, and text.

mod e57_file;
mod epsg;
mod las_file;
mod las_units;
mod laz_chunks;
mod lzf;
mod pcd;
mod ply_points;
mod text;

use super::error::ImportError;
use crate::model::{MOST_CLOUD_POINTS, PointCloud};
use nalgebra::Point3;
use std::io::{BufRead, Seek};
use std::path::Path;

/// How the points of a file are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloudFormat {
    /// LAS, or LAZ, of any version.
    Las,
    E57,
    Ply,
    Pcd,
    /// A point on each line: x, y, z, and what may follow.
    Text,
}

impl CloudFormat {
    /// The format that the ending of a file's name says.
    ///
    /// # Errors
    /// It says none that is known.
    pub fn of_name(path: &Path) -> Result<Self, ImportError> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        match ending.to_str().unwrap_or_default() {
            "las" | "laz" => Ok(Self::Las),
            "e57" => Ok(Self::E57),
            "ply" => Ok(Self::Ply),
            "pcd" => Ok(Self::Pcd),
            "xyz" | "txt" | "asc" | "csv" | "pts" => Ok(Self::Text),
            _ => Err(ImportError::unsupported(
                "its name does not say what it is",
                "give a file .las, .laz, .e57, .ply, .pcd, .xyz, .txt, .asc, .csv or .pts",
            )),
        }
    }
}

/// What a file of points holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CloudRead {
    pub cloud: PointCloud,
    /// The units that the file's own coordinate system names; looked for where none was given.
    pub units_in_file: Option<Units>,
    /// The EPSG number of the file's coordinate system, where nothing says the unit of that.
    pub unknown_system: Option<u64>,
    /// Where a header says fewer points than the file has room for; those behind are not read.
    pub too_few_said: Option<TooFewSaid>,
}

/// A header that says fewer points than its file has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooFewSaid {
    pub said: u64,
    /// For so many there is room, at least.
    pub room: u64,
}

/// The units of coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Of x and y, m.
    pub along_m: f64,
    /// Of z, m.
    pub up_m: f64,
}

impl Units {
    pub const METRES: Self = Self::all(1.0);

    /// The same for all coordinates, m.
    pub const fn all(unit_m: f64) -> Self {
        Self {
            along_m: unit_m,
            up_m: unit_m,
        }
    }
}

/// Reads the points of a file, z up. `unit_m` is the length of its unit, m; where it is not given
/// it is the one that the file's coordinate system names, or else the metre. Memory: 12 bytes a
/// point.
///
/// # Errors
/// It is of another format, damaged, cut off, or has too many points or none.
pub fn read_cloud<R>(
    input: R,
    format: CloudFormat,
    unit_m: Option<f64>,
) -> Result<CloudRead, ImportError>
where
    R: BufRead + Seek + Send + Sync + 'static,
{
    let mut points = Points {
        units: Units::all(unit_m.unwrap_or(1.0)),
        read: CloudRead::default(),
        unit_is_given: unit_m.is_some(),
    };
    match format {
        CloudFormat::Las => las_file::read(input, &mut points)?,
        CloudFormat::E57 => e57_file::read(input, &mut points)?,
        CloudFormat::Ply => ply_points::read(input, &mut points)?,
        CloudFormat::Pcd => pcd::read(input, &mut points)?,
        CloudFormat::Text => text::read(input, &mut points)?,
    }
    if points.read.cloud.points.is_empty() {
        return Err(match points.read.cloud.not_finite {
            0 => ImportError::bad_format("it holds no points"),
            _ => ImportError::bad_format("no coordinate in it is a number"),
        });
    }
    Ok(points.read)
}

/// The points while they are read.
struct Points {
    units: Units,
    unit_is_given: bool,
    read: CloudRead,
}

impl Points {
    /// Takes the units that the file names.
    fn take_units(&mut self, units: Units) {
        self.read.units_in_file = Some(units);
        self.read.unknown_system = None;
        self.units = units;
    }

    /// Notes how many points a header says, and for how many the file has room.
    fn said_too_few(&mut self, said: u64, room: u64) {
        self.read.too_few_said = (said < room).then_some(TooFewSaid { said, room });
    }

    /// Takes a point in the unit of the file.
    fn push(&mut self, x: f64, y: f64, z: f64) -> Result<(), ImportError> {
        let Units { along_m, up_m } = self.units;
        let at = Point3::new(along_m * x, along_m * y, up_m * z);
        if self.read.cloud.push(at) {
            Ok(())
        } else {
            Err(too_many(MOST_CLOUD_POINTS + 1))
        }
    }
}

/// The error of a file with so many points.
fn too_many(found: usize) -> ImportError {
    ImportError::TooMany {
        found,
        what: "points",
        most: MOST_CLOUD_POINTS,
    }
}

/// Refuses a number of points that a header says and no cloud may have.
fn refuse_many(count: u64) -> Result<(), ImportError> {
    if count > MOST_CLOUD_POINTS as u64 {
        return Err(too_many(usize::try_from(count).unwrap_or(usize::MAX)));
    }
    Ok(())
}

#[cfg(test)]
mod tests;
