//! The skeleton in a treefile of RayCloudTools (`rayextract trees`): lines of comment, a header such as
//! `height, x,y,z,radius,parent_id`, and one line for each tree with its segments one after the other. A
//! segment ends at its place, and its parent is counted from 0. z is up.

use super::error::ImportError;
use super::model_tree::{Edges, MOST_PLACES, from_z_up};
use super::segments::{self, Segment};
use super::sketch::refuse_more;
use super::wood_table;
use crate::files::without_byte_order_mark;
use crate::model::{NodeKind, SwayColumns};

/// What a header says on a line: how many numbers there are of the tree and of each segment, and
/// where in a segment its place, its parent and what else is known of it are.
struct Columns {
    of_tree: usize,
    of_segment: usize,
    place: [usize; 3],
    parent: usize,
    /// `None` where there is no such column.
    radius: Option<usize>,
    sway: [Option<usize>; SwayColumns::NAMES.len()],
    made_up: Option<usize>,
    separator: char,
}

/// The ways from each segment's parent to it, turned so that y is up.
///
/// # Errors
/// The header names no `x`, `y`, `z` and `parent_id`, a line cannot be read, there are several trees,
/// or a parent is not in it.
pub(super) fn edges(text: &str) -> Result<Edges, ImportError> {
    let text = without_byte_order_mark(text);
    let lines = (1..).zip(text.lines());
    let mut lines = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let header = lines.next().map_or("", |(_, line)| line);
    let columns = Columns::of(header, wood_table::separator_of(text)).ok_or_else(|| {
        ImportError::bad_format("its header has no x, y, z and parent_id, and it is no treefile")
    })?;
    let (number, line) = lines.next().ok_or(ImportError::NoSkeleton)?;
    let others = lines.count();
    if others > 0 {
        let what = format!("it holds {} trees", others + 1);
        return Err(ImportError::unsupported(
            what,
            "leave the line of one in it",
        ));
    }
    refuse_more(
        "segments",
        line.matches(columns.separator).count() / columns.of_segment,
        MOST_PLACES,
    )?;
    let segments = columns.segments(line).ok_or_else(|| {
        ImportError::bad_format(format!("line {number} does not hold what its header says"))
    })?;
    segments::edges(segments)
}

/// The number of a segment in a column; no number where there is no such column.
fn known(row: &[f64], column: Option<usize>) -> f64 {
    column.map_or(f64::NAN, |column| row[column])
}

/// The cells of a line; one behind the last separator may be empty.
fn cells(line: &str, separator: char) -> impl Iterator<Item = &str> {
    let line = line.trim().trim_end_matches(separator);
    line.split(separator).map(str::trim)
}

impl Columns {
    fn of(header: &str, separator: char) -> Option<Self> {
        let names = cells(header, separator).map(|name| name.trim_matches('"'));
        let names: Vec<&str> = names.collect();
        let of_tree = names.iter().position(|name| *name == "x")?;
        let segment = &names[of_tree..];
        let column = |name: &str| segment.iter().position(|n| *n == name);
        Some(Self {
            of_tree,
            of_segment: segment.len(),
            place: [column("x")?, column("y")?, column("z")?],
            parent: column("parent_id")?,
            radius: column("radius"),
            sway: SwayColumns::NAMES.map(column),
            made_up: column(NodeKind::MADE_UP_COLUMN),
            separator,
        })
    }

    /// Of the line of one tree; `None` where it cannot be read.
    fn segments(&self, line: &str) -> Option<Vec<Segment>> {
        let mut numbers: Vec<f64> = Vec::new();
        for cell in cells(line, self.separator) {
            numbers.push(wood_table::number(cell, self.separator)?);
        }
        let rows = numbers.get(self.of_tree..)?.chunks_exact(self.of_segment);
        if rows.len() == 0 || !rows.remainder().is_empty() {
            return None;
        }
        let mut segments = Vec::with_capacity(rows.len());
        for (number, row) in (0..).zip(rows) {
            segments.push(Segment {
                id: number,
                parent: Some(segments::id(row[self.parent])?).filter(|parent| *parent >= 0),
                start: None,
                end: from_z_up(self.place.map(|column| row[column])),
                wood: segments::wood(
                    known(row, self.radius),
                    self.sway.map(|column| known(row, column)),
                    known(row, self.made_up),
                ),
            });
        }
        Some(segments)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    const FORK: &str = "# Tree file.\nheight, x,y,z,radius,parent_id\n\
                        3, 1,2,0,0.1,-1, 1,2,1,0.1,0, 1,3,2,0.1,1, 0,2,2.5,0.1,1, \n";

    #[test]
    fn segments_end_at_their_places() {
        let file = edges(FORK).expect("sound");
        assert_eq!(file.foot, Some(0));
        assert_eq!(file.edges, [[0, 1], [1, 2], [1, 3]]);
        assert_eq!(file.places[2], Point3::new(1.0, 2.0, -3.0));
        assert!(
            file.wood
                .iter()
                .all(|w| w.radius == 0.1 && w.sway.is_none())
        );
    }

    #[test]
    fn semicolons_and_tabs_part_cells_too() {
        let file = edges(FORK).expect("sound");
        for separator in [";", "\t"] {
            assert_eq!(edges(&FORK.replace(',', separator)), Ok(file.clone()));
        }
        let quoted = FORK.replace(
            "x,y,z,radius,parent_id",
            r#""x","y","z","radius","parent_id""#,
        );
        assert_eq!(edges(&quoted), Ok(file));
    }

    /// Parents may stand behind what grows from them.
    #[test]
    fn the_order_of_segments_does_not_matter_and_sway_is_read() {
        let names = SwayColumns::NAMES.join(",");
        let text = format!(
            "x,y,z,radius,parent_id,{names}\n\
             1,3,2,0.1,1,2,1.9,2.1,nan,nan,nan, 1,2,1,0.2,2,nan,nan,nan,nan,nan,nan, \
             1,2,0,0.3,-1,nan,nan,nan,nan,nan,nan\n"
        );
        let file = edges(&text).expect("sound");
        assert_eq!(file.foot, Some(2));
        assert_eq!(file.edges, [[1, 0], [2, 1]]);
        let hz = |i: usize| file.wood[i].sway.map(|sway| sway.frequency_hz.value);
        assert_eq!([hz(0), hz(1), hz(2)], [Some(2.0), None, None]);
        let circle = text.replace("0.3,-1", "0.3,0");
        let said = edges(&circle).expect_err("a circle").to_string();
        assert!(said.contains("grows from itself"), "{said}");
    }

    #[test]
    fn what_is_no_treefile_is_refused() {
        let tree = FORK.lines().last().expect("a line");
        for bad in [
            "",
            "# only a comment\n",
            "x,y,z,radius\n0,0,0,1\n",
            "x,y,z,parent_id\n",
            &FORK.replace("0.1,-1", "0.1,-1,4"),
            &FORK.replace("0.1,1, 0", "0.1,1.5, 0"),
            &FORK.replace("0.1,0,", "0.1,1e300,"),
            &FORK.replace("0.1,0,", "0.1,4,"),
            &FORK.replace("0,2,2.5", "0,up,2.5"),
            &format!("{FORK}{tree}\n"),
        ] {
            assert!(edges(bad).is_err(), "{bad}");
        }
    }
}
