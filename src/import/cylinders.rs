//! The skeleton in a table of cylinders, as `export --format csv` and the tools for quantitative
//! structure models write it: `ID, parentID, start_x, ..., end_z` with y up is our own;
//! SimpleForest has `startX`, aRchi `cyl_ID`, both with z up.

use super::error::ImportError;
use super::model_tree::{Edges, MOST_PLACES, from_z_up};
use super::sketch::refuse_more;
use csv::StringRecord;
use nalgebra::Point3;
use std::collections::BTreeMap;

const COLUMNS: [&str; 8] = [
    "ID", "parentID", "start_x", "start_y", "start_z", "end_x", "end_y", "end_z",
];
const SIMPLE_FOREST: [&str; 8] = [
    "ID", "parentID", "startX", "startY", "startZ", "endX", "endY", "endZ",
];
const ARCHI: [&str; 8] = [
    "cyl_ID",
    "parent_ID",
    "startX",
    "startY",
    "startZ",
    "endX",
    "endY",
    "endZ",
];

/// Where the columns are, and whether z is up.
struct Columns {
    places: [usize; COLUMNS.len()],
    is_z_up: bool,
}

/// The middle lines of the cylinders, each from the end of the one that it grows from: a branch
/// begins on its carrier's surface or along its way.
///
/// # Errors
/// A column is missing, or a row cannot be read.
pub(super) fn edges(bytes: &[u8]) -> Result<Edges, ImportError> {
    let mut table = csv::Reader::from_reader(bytes);
    let columns = columns(table.headers().map_err(ImportError::bad_format)?)?;
    let mut file = Edges::default();
    let mut end_of: BTreeMap<i64, usize> = BTreeMap::new();
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

/// Where the columns of one of the tools are.
fn columns(header: &StringRecord) -> Result<Columns, ImportError> {
    let place = |name: &str| header.iter().position(|h| h.trim() == name);
    for (names, is_z_up) in [(COLUMNS, false), (SIMPLE_FOREST, true), (ARCHI, true)] {
        let found = names.map(place);
        if found.iter().all(Option::is_some) {
            let places = found.map(Option::unwrap_or_default);
            return Ok(Columns { places, is_z_up });
        }
    }
    let missing = COLUMNS.iter().find(|name| place(name).is_none());
    let name = missing.copied().unwrap_or_default();
    Err(ImportError::bad_format(format!(
        "it has no column {name}, and is no table of cylinders"
    )))
}

/// A row of the table.
struct Cylinder {
    id: i64,
    parent: i64,
    start: Point3<f64>,
    end: Point3<f64>,
}

impl Columns {
    /// A place of the file, turned so that y is up.
    fn place(&self, [x, y, z]: [f64; 3]) -> Point3<f64> {
        match self.is_z_up {
            true => from_z_up([x, y, z]),
            false => Point3::new(x, y, z),
        }
    }
}

impl Cylinder {
    /// `None` where a cell holds no number.
    fn of(row: &StringRecord, columns: &Columns) -> Option<Self> {
        let mut cells = [0.0; COLUMNS.len()];
        for (cell, column) in cells.iter_mut().zip(columns.places) {
            *cell = row.get(column)?.trim().parse().ok()?;
        }
        let [id, parent, x, y, z, to_x, to_y, to_z] = cells;
        Some(Self {
            id: id as i64,
            parent: parent as i64,
            start: columns.place([x, y, z]),
            end: columns.place([to_x, to_y, to_z]),
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
        let names = "cyl_ID,parent_ID,startX,startY,startZ,endX,endY,endZ";
        let z_up = format!("{names}\n1,0,0,0,0,0,-2,1\n2,1,0,-2,1,1,-2,2\n");
        let archi = edges(z_up.as_bytes()).expect("sound");
        assert_eq!(archi.edges, file.edges);
        assert_eq!(archi.places[1], Point3::new(0.0, 1.0, 2.0));
        let with_minus = z_up
            .replace("cyl_ID", "ID")
            .replace("parent_ID", "parentID");
        let with_minus = with_minus
            .replace("\n2,1", "\n1,0")
            .replace("\n1,0,0,0,0,0", "\n0,-1,0,0,0,0");
        assert_eq!(edges(with_minus.as_bytes()), Ok(archi));
        for bad in ["", "ID,parentID\n1,0\n", &table.replace("0.1,1", "x,1")] {
            assert!(edges(bad.as_bytes()).is_err(), "{bad}");
        }
    }
}
