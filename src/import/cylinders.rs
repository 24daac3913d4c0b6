//! The skeleton in a table of cylinders, as `export --format csv` and the tools for quantitative
//! structure models write it: `ID, parentID, start_x, ..., end_z` with y up is our own;
//! SimpleForest has `startX`, aRchi `cyl_ID`, both with z up.

use super::error::ImportError;
use super::model_tree::{Edges, from_z_up};
use super::segments::{self, Segment};
use super::wood_table::{number, separator_of};
use crate::files::{TableFault, without_byte_order_mark};
use crate::model::{NodeKind, SwayColumns};
use csv::StringRecord;
use nalgebra::Point3;

/// The columns of one of the tools.
struct Table {
    columns: [&'static str; 8],
    radius: &'static str,
    is_z_up: bool,
}

const OURS: Table = Table {
    columns: [
        "ID", "parentID", "start_x", "start_y", "start_z", "end_x", "end_y", "end_z",
    ],
    radius: "radius",
    is_z_up: false,
};
const SIMPLE_FOREST: Table = Table {
    columns: [
        "ID", "parentID", "startX", "startY", "startZ", "endX", "endY", "endZ",
    ],
    radius: "radius",
    is_z_up: true,
};
const ARCHI: Table = Table {
    columns: [
        "cyl_ID",
        "parent_ID",
        "startX",
        "startY",
        "startZ",
        "endX",
        "endY",
        "endZ",
    ],
    radius: "radius_cyl",
    is_z_up: true,
};

const TABLES: [Table; 3] = [OURS, SIMPLE_FOREST, ARCHI];

/// Where the columns are, and whether z is up.
struct Columns {
    places: [usize; OURS.columns.len()],
    /// `None` where there is no such column.
    radius: Option<usize>,
    sway: [Option<usize>; SwayColumns::NAMES.len()],
    made_up: Option<usize>,
    is_z_up: bool,
    separator: char,
}

/// The middle lines of the cylinders with what is said of them.
///
/// # Errors
/// A column is missing, a row cannot be read, or what it grows from is not in the table.
pub(super) fn edges(bytes: &[u8]) -> Result<Edges, ImportError> {
    // Names in a comment may be in any encoding.
    let text = String::from_utf8_lossy(bytes);
    let text = without_byte_order_mark(&text).trim_start();
    let separator = separator_of(text);
    let mut table = csv::ReaderBuilder::new()
        .delimiter(separator as u8)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let columns = Columns::of(table.headers().map_err(unreadable)?, separator)?;
    let mut rows: Vec<Segment> = Vec::new();
    for row in table.records() {
        let row = row.map_err(unreadable)?;
        rows.push(columns.segment(&row).ok_or_else(|| {
            let line = row.position().map_or(0, csv::Position::line);
            ImportError::bad_format(format!("line {line} holds what is no number"))
        })?);
    }
    // Where numbers count from 1, the parent of what stands on the ground is 0.
    let counts_from_0 = rows.iter().any(|row| row.id == 0);
    for row in &mut rows {
        let first = if counts_from_0 { 0 } else { 1 };
        row.parent = row.parent.filter(|parent| *parent >= first);
    }
    segments::edges(rows)
}

/// What is wrong with a row.
fn unreadable(e: csv::Error) -> ImportError {
    let TableFault { line, what } = TableFault::from(&e);
    ImportError::bad_format(format!("line {line}: {what}"))
}

impl Columns {
    /// Where those of one of the tools are.
    fn of(header: &StringRecord, separator: char) -> Result<Self, ImportError> {
        let place = |name: &str| header.iter().position(|h| h.trim() == name);
        for table in TABLES {
            let found = table.columns.map(place);
            if found.iter().all(Option::is_some) {
                return Ok(Self {
                    places: found.map(Option::unwrap_or_default),
                    radius: place(table.radius),
                    sway: SwayColumns::NAMES.map(place),
                    made_up: place(NodeKind::MADE_UP_COLUMN),
                    is_z_up: table.is_z_up,
                    separator,
                });
            }
        }
        // Of the tool whose table it is most like.
        let missing = TABLES.map(|table| {
            let mut names = table.columns.to_vec();
            names.retain(|name| place(name).is_none());
            names
        });
        let fewest = missing.into_iter().min_by_key(Vec::len).unwrap_or_default();
        Err(ImportError::bad_format(format!(
            "it has no column {}, and is no table of cylinders",
            fewest.join(", ")
        )))
    }

    /// A place of the file, turned so that y is up.
    fn place(&self, [x, y, z]: [f64; 3]) -> Point3<f64> {
        match self.is_z_up {
            true => from_z_up([x, y, z]),
            false => Point3::new(x, y, z),
        }
    }

    /// The cylinder of a row; `None` where a cell holds no number.
    fn segment(&self, row: &StringRecord) -> Option<Segment> {
        let mut cells = [0.0; OURS.columns.len()];
        for (cell, column) in cells.iter_mut().zip(self.places) {
            *cell = number(row.get(column)?, self.separator)?;
        }
        let [id, parent, x, y, z, to_x, to_y, to_z] = cells;
        let mut sway = [f64::NAN; SwayColumns::NAMES.len()];
        for (cell, column) in sway.iter_mut().zip(self.sway) {
            *cell = self.known(row, column)?;
        }
        Some(Segment {
            id: segments::id(id)?,
            parent: Some(segments::id(parent)?),
            start: Some(self.place([x, y, z])),
            end: self.place([to_x, to_y, to_z]),
            wood: segments::wood(
                self.known(row, self.radius)?,
                sway,
                self.known(row, self.made_up)?,
            ),
        })
    }

    /// The number in a cell, which is no number where the cell is empty or there is no such column;
    /// `None` where it holds something else.
    fn known(&self, row: &StringRecord, column: Option<usize>) -> Option<f64> {
        match column.and_then(|column| row.get(column)).map(str::trim) {
            None | Some("" | "NA") => Some(f64::NAN),
            Some(cell) => number(cell, self.separator),
        }
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
        assert_eq!(edges(format!("  \n\n{table}").as_bytes()), Ok(file.clone()));
        for separator in [";", "\t"] {
            let other = table.replace(',', separator);
            assert_eq!(edges(other.as_bytes()), Ok(file.clone()), "{other}");
        }
        let decimal_commas = table.replace(',', ";").replace('.', ",");
        assert_eq!(edges(decimal_commas.as_bytes()), Ok(file.clone()));
        let short = edges(format!("{table}3,1,0\n").as_bytes()).expect_err("cells are missing");
        assert!(
            short
                .to_string()
                .contains("line 4: it has 3 cells, and the first line 9"),
            "{short}"
        );
        for bad in [
            "",
            "ID,parentID\n1,0\n",
            &table.replace("0.1,1", "x,1"),
            &table.replace("\n2,1", "\n2.5,1"),
            &table.replace("0.05", "thin"),
            &table.replace("\n2,1", "\n2,3"),
        ] {
            assert!(edges(bad.as_bytes()).is_err(), "{bad}");
        }
    }

    #[test]
    fn radius_and_sway_are_read_and_rows_may_stand_in_any_order() {
        let names = "cyl_ID,parent_ID,startX,startY,startZ,endX,endY,endZ,radius_cyl,frequency_hz,\
                     frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,damping_hi";
        let rows = [
            "1,0,0,0,0,0,0,1,0.2,,,,,,",
            "2,1,0,0,1,0,0,2,0.1,1.5,1.4,1.6,0.03,0.02,0.05",
            "3,1,0,0,1,1,0,2,NA,2,nan,2.1,,,",
        ];
        let in_order = edges(format!("{names}\n{}\n", rows.join("\n")).as_bytes()).expect("sound");
        let radii: Vec<f64> = in_order.wood.iter().map(|w| w.radius).collect();
        assert_eq!(radii, [0.2, 0.2, 0.1, 0.0]);
        let sway = in_order.wood[2].sway.expect("a sway");
        let damping = sway.damping_ratio.expect("damping");
        assert_eq!(
            [
                sway.frequency_hz.lo,
                sway.frequency_hz.value,
                damping.value,
                damping.hi
            ],
            [1.4, 1.5, 0.03, 0.05]
        );
        // A frequency counts with its interval only.
        assert!(in_order.wood[0].sway.or(in_order.wood[3].sway).is_none());
        let [first, second, third] = rows;
        let backwards = format!("{names}\n{third}\n{second}\n{first}\n");
        let backwards = edges(backwards.as_bytes()).expect("sound");
        assert_eq!(backwards.places, in_order.places);
        assert_eq!(
            [backwards.edges, in_order.edges],
            [[[0, 1], [1, 2], [1, 3]]; 2]
        );
    }
}
