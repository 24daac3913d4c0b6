//! What a file of text says of itself: whether it is a table of wood, and what parts its cells.

use crate::files::without_byte_order_mark;

/// What stands between the cells of a table.
const SEPARATORS: [char; 3] = [',', ';', '\t'];

/// A table of the pieces of wood that make up a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WoodTable {
    /// A row for each cylinder.
    Cylinders,
    /// A line for each tree.
    Treefile,
}

impl WoodTable {
    /// Which one begins with this text; `None` if none does.
    pub fn of(begin: &str) -> Option<Self> {
        let header = header(begin);
        let is_of_cylinders = ["parentID", "parent_ID", "endX", "end_x"]
            .iter()
            .any(|name| has_cell(header, name));
        if is_of_cylinders {
            Some(Self::Cylinders)
        } else if has_cell(header, "parent_id") {
            Some(Self::Treefile)
        } else {
            None
        }
    }
}

/// The first line that is no comment and not empty.
fn header(text: &str) -> &str {
    let text = without_byte_order_mark(text);
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    lines.find(|line| !line.trim().is_empty()).unwrap_or("")
}

/// What parts the cells of a line: that of which there is most.
fn separator(line: &str) -> char {
    let mut most = (0, SEPARATORS[0]);
    for separator in SEPARATORS {
        let count = line.matches(separator).count();
        if count > most.0 {
            most = (count, separator);
        }
    }
    most.1
}

/// What parts the cells of a table that begins with this text.
pub(super) fn separator_of(begin: &str) -> char {
    separator(header(begin))
}

/// Whether a cell of this line holds this text, in quotes or not.
fn has_cell(line: &str, text: &str) -> bool {
    let mut cells = line.split(separator(line));
    cells.any(|cell| cell.trim().trim_matches('"') == text)
}

/// The number in a cell. Where cells are not parted by commas, a comma may be that of the decimals.
pub(super) fn number(cell: &str, separator: char) -> Option<f64> {
    let cell = cell.trim();
    if separator != ',' && cell.contains(',') {
        return cell.replacen(',', ".", 1).parse().ok();
    }
    cell.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_says_which_table_it_is() {
        for (text, expected) in [
            ("ID,parentID,startX\n", Some(WoodTable::Cylinders)),
            (
                "# made\n\n\"cyl_ID\";\"parent_ID\"\n",
                Some(WoodTable::Cylinders),
            ),
            ("\u{feff}ID\tparentID\n", Some(WoodTable::Cylinders)),
            (
                "height, x,y,z,radius,parent_id\n",
                Some(WoodTable::Treefile),
            ),
            (
                "height; x;y;z;radius;parent_id\n",
                Some(WoodTable::Treefile),
            ),
            // Its parents are missing, which is named when it is read.
            ("ID,startX,startY,startZ,endX\n", Some(WoodTable::Cylinders)),
            ("x,y,z\n1,2,3\n", None),
            ("", None),
        ] {
            assert_eq!(WoodTable::of(text), expected, "{text:?}");
        }
        assert_eq!(separator_of("a;b,c;d\n"), ';');
        assert_eq!(number(" 0,25", ';'), Some(0.25));
        assert_eq!(number("0,25", ','), None);
        assert_eq!(number("1,2,3", '\t'), None);
    }
}
