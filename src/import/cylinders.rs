//! The skeleton in a table of cylinders, as `export --format csv` and the tools for quantitative
//! structure models write it: `ID, parentID, start_x, ..., end_z`. y is up, as in our own.

use super::error::ImportError;
use super::model_tree::{Edges, MOST_PLACES};
use super::sketch::refuse_more;
use csv::StringRecord;
use nalgebra::Point3;
use std::collections::BTreeMap;

const COLUMNS: [&str; 8] = [
    "ID", "parentID", "start_x", "start_y", "start_z", "end_x", "end_y", "end_z",
];

/// The middle lines of the cylinders, each from the end of the one that it grows from: a branch
/// begins on its carrier's surface or along its way.
///
/// # Errors
/// A column is missing, or a row cannot be read.
pub(super) fn edges(bytes: &[u8]) -> Result<Edges, ImportError> {
    let mut table = csv::Reader::from_reader(bytes);
    let columns = columns(table.headers().map_err(ImportError::bad_format)?)?;
    let mut file = Edges::default();
    let mut end_of: BTreeMap<u64, usize> = BTreeMap::new();
    for row in table.records() {
        let row = row.map_err(ImportError::bad_format)?;
        let cylinder = Cylinder::of(&row, &columns).ok_or_else(|| {
            let line = row.position().map_or(0, csv::Position::line);
            ImportError::bad_format(format!("line {line} holds what is no number"))
        })?;
        let begin = match end_of.get(&cylinder.parent) {
            Some(end) => *end,
            None => {
                file.places.push(cylinder.start);
                file.places.len() - 1
            }
        };
        // What stands on the ground is the trunk, and comes first.
        file.foot = file.foot.or(Some(begin));
        let end = file.places.len();
        file.places.push(cylinder.end);
        file.edges.push([begin, end]);
        end_of.insert(cylinder.id, end);
        refuse_more("places", file.places.len(), MOST_PLACES)?;
    }
    Ok(file)
}

/// Where the [`COLUMNS`] are.
fn columns(header: &StringRecord) -> Result<[usize; COLUMNS.len()], ImportError> {
    let mut columns = [0; COLUMNS.len()];
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        let found = header.iter().position(|h| h.trim() == name);
        *column = found.ok_or_else(|| {
            ImportError::bad_format(format!(
                "it has no column {name}, and is no table of cylinders"
            ))
        })?;
    }
    Ok(columns)
}

/// A row of the table.
struct Cylinder {
    id: u64,
    parent: u64,
    start: Point3<f64>,
    end: Point3<f64>,
}

impl Cylinder {
    /// `None` where a cell holds no number.
    fn of(row: &StringRecord, columns: &[usize; COLUMNS.len()]) -> Option<Self> {
        let mut cells = [0.0; COLUMNS.len()];
        for (cell, column) in cells.iter_mut().zip(columns) {
            *cell = row.get(*column)?.trim().parse().ok()?;
        }
        let [id, parent, x, y, z, to_x, to_y, to_z] = cells;
        Some(Self {
            id: id as u64,
            parent: parent as u64,
            start: Point3::new(x, y, z),
            end: Point3::new(to_x, to_y, to_z),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cylinders_hang_on_the_ends_of_those_below() {
        let table = "ID,parentID,start_x,start_y,start_z,end_x,end_y,end_z,radius\n\
                     1,0,0,0,0,0,1,0,0.1\n2,1,0.1,1,0,1,2,0,0.05\n";
        let file = edges(table.as_bytes()).expect("sound");
        assert_eq!(file.edges, [[0, 1], [1, 2]]);
        assert_eq!(file.foot, Some(0));
        for bad in ["", "ID,parentID\n1,0\n", &table.replace("0.1,1", "x,1")] {
            assert!(edges(bad.as_bytes()).is_err(), "{bad}");
        }
    }
}
