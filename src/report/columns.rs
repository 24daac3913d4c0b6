//! Tables of letters, as wide as there is room for.

/// Words that end a row early go on in lines of their own rather than in less room than this.
const LEAST_WORDS: usize = 48;

/// A table that may be narrowed. A row may end early with words that are as long as they like: they
/// are broken where there is no room for them.
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Row>,
}

/// Cells, the last of which stands in no column where a row ends early.
struct Row {
    cells: Vec<String>,
    ends_early: bool,
}

/// A column; one with a larger `spare` is left out before one with a smaller, and with 0 it stays.
struct Column {
    head: String,
    spare: u8,
}

impl Table {
    /// With so many columns, each with its head and how soon it can be spared.
    pub fn new(columns: &[(&str, u8)]) -> Self {
        let column = |(head, spare): &(&str, u8)| Column {
            head: (*head).to_owned(),
            spare: *spare,
        };
        Self {
            columns: columns.iter().map(column).collect(),
            rows: Vec::new(),
        }
    }

    pub fn push(&mut self, cells: Vec<String>) {
        let ends_early = cells.len() < self.columns.len();
        self.rows.push(Row { cells, ends_early });
    }

    /// As lines of at most `width` letters, if leaving columns out can make it so; and the heads of
    /// those that are left out.
    pub fn within(mut self, width: Option<usize>) -> (String, Vec<String>) {
        let mut without = Vec::new();
        loop {
            let text = self.text(width);
            let widest = text
                .lines()
                .map(|line| line.chars().count())
                .max()
                .unwrap_or(0);
            let most = self.columns.iter().map(|c| c.spare).max().unwrap_or(0);
            if width.is_none_or(|w| widest <= w) || most == 0 {
                return (text, without);
            }
            while let Some(at) = self.columns.iter().position(|c| c.spare == most) {
                self.leave_out(at);
                without.push(self.columns.remove(at).head);
            }
        }
    }

    fn leave_out(&mut self, at: usize) {
        for row in &mut self.rows {
            if at < row.in_columns() {
                row.cells.remove(at);
            }
        }
    }

    /// Columns that are as wide as what stands in them, to the right.
    fn text(&self, room: Option<usize>) -> String {
        let heads = Row {
            cells: self.columns.iter().map(|c| c.head.clone()).collect(),
            ends_early: false,
        };
        let rows: Vec<&Row> = std::iter::once(&heads).chain(&self.rows).collect();
        let width = |c: usize| {
            let cells = rows
                .iter()
                .filter(|row| c < row.in_columns())
                .map(|row| row.cells[c].chars().count());
            cells.max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        rows.iter().map(|row| row.line(&widths, room)).collect()
    }
}

impl Row {
    fn in_columns(&self) -> usize {
        self.cells.len() - usize::from(self.ends_early && !self.cells.is_empty())
    }

    /// The cells in columns of these widths; words that end it early within `room`.
    fn line(&self, widths: &[usize], room: Option<usize>) -> String {
        let (in_columns, words) = self.cells.split_at(self.in_columns());
        let mut line = String::new();
        for (cell, width) in in_columns.iter().zip(widths) {
            let free = width.saturating_sub(cell.chars().count());
            line += &format!("  {}{cell}", " ".repeat(free));
        }
        for words in words {
            let indent = line.chars().count() + 2;
            let room = room.map(|room| room.saturating_sub(indent).max(LEAST_WORDS));
            let onward = format!("\n{}", " ".repeat(indent));
            line += &format!("  {}", wrapped(words, room).replace('\n', &onward));
        }
        format!("{}\n", line.trim_end())
    }
}

/// Lines of text, broken between words where they would be longer than `width`; what goes on is
/// indented by four letters.
pub fn wrapped(text: &str, width: Option<usize>) -> String {
    let Some(width) = width else {
        return text.into();
    };
    let mut out = String::new();
    for line in text.split_inclusive('\n') {
        let (mut used, mut begun) = (0, false);
        // With its blanks, so that a line that is short enough stays as it is.
        for word in line.split_inclusive(' ') {
            let long = word.trim_end().chars().count();
            if begun && used + long > width {
                out.truncate(out.trim_end_matches(' ').len());
                out.push_str("\n    ");
                used = 4;
            }
            begun |= long > 0;
            out.push_str(word);
            used += word.chars().count();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new(&[("branch", 0), ("points", 2), ("frequency", 0), ("eq. 6", 3)]);
        table.push(
            ["1", "307", "0.501 (0.498 to 0.504)", "0.11"]
                .map(String::from)
                .to_vec(),
        );
        table.push(["12", "5", "  none: too short"].map(String::from).to_vec());
        table
    }

    #[test]
    fn a_narrow_table_goes_without_what_is_needed_least() {
        let (text, without) = table().within(None);
        let whole = "  branch  points               frequency  eq. 6\n       1     307  0.501 (0.498 to 0.504)   0.11\n\
                     \x20     12       5    none: too short\n";
        assert_eq!((text.as_str(), without), (whole, vec![]));
        assert_eq!(table().within(Some(47)).0, whole);
        assert_eq!(table().within(Some(46)).1, ["eq. 6"]);
        let (text, without) = table().within(Some(20));
        assert_eq!(without, ["eq. 6", "points"]);
        let narrow = concat!(
            "  branch               frequency\n",
            "       1  0.501 (0.498 to 0.504)\n",
            "      12    none: too short\n",
        );
        assert_eq!(text, narrow);
    }

    #[test]
    fn words_that_end_a_row_go_on_below_where_they_began() {
        let mut table = Table::new(&[("branch", 0), ("frequency", 0), ("damping", 0)]);
        let words =
            "  none: no mode of its own: moves with trunk (0.70 Hz) by 60 %, a mode of 1.20 Hz";
        table.push(vec!["limb_1".into(), words.into()]);
        let (text, _) = table.within(Some(60));
        let onward = concat!(
            "  branch  frequency  damping\n",
            "  limb_1    none: no mode of its own: moves with trunk (0.70\n",
            "              Hz) by 60 %, a mode of 1.20 Hz\n",
        );
        assert_eq!(text, onward);
    }

    #[test]
    fn words_are_not_broken() {
        assert_eq!(
            wrapped("one two  three\nfour\n", Some(9)),
            "one two\n    three\nfour\n"
        );
        assert_eq!(
            wrapped("  a verylongword b", Some(6)),
            "  a\n    verylongword\n    b"
        );
        assert_eq!(wrapped("any length", None), "any length");
    }
}
