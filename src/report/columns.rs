//! Tables of letters, as wide as there is room for.

/// A table that may be narrowed. A row may end early with words that are as long as they like.
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

/// A column; one with a larger `spare` is left out before one with a smaller, and with 0 it stays.
struct Column {
    head: String,
    spare: u8,
}

impl Table {
    /// With so many columns, each with its head and how soon it can be spared.
    pub fn new(columns: &[(&str, u8)]) -> Self {
        let column = |(head, spare): &(&str, u8)| Column { head: (*head).to_owned(), spare: *spare };
        Self { columns: columns.iter().map(column).collect(), rows: Vec::new() }
    }

    pub fn push(&mut self, row: Vec<String>) {
        self.rows.push(row);
    }

    /// As lines of at most `width` letters, if leaving columns out can make it so; and the heads of those that are left out.
    pub fn within(mut self, width: Option<usize>) -> (String, Vec<String>) {
        let mut without = Vec::new();
        loop {
            let text = self.text();
            let widest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
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
        let all = self.columns.len();
        for row in &mut self.rows {
            // The words at the end of a short row stand in no column.
            if at < row.len() && (row.len() == all || at + 1 < row.len()) {
                row.remove(at);
            }
        }
    }

    /// Columns that are as wide as what stands in them, to the right.
    fn text(&self) -> String {
        let all = self.columns.len();
        let heads: Vec<String> = self.columns.iter().map(|c| c.head.clone()).collect();
        let rows: Vec<&Vec<String>> = std::iter::once(&heads).chain(&self.rows).collect();
        let ends_early = |row: &Vec<String>, c: usize| row.len() < all && c + 1 == row.len();
        let width = |c: usize| {
            let cells = rows.iter().filter(|row| !ends_early(row, c)).filter_map(|row| row.get(c));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..all).map(width).collect();
        let line = |row: &&Vec<String>| {
            let cell = |(c, cell): (usize, &String)| {
                let gap = widths.get(c).copied().unwrap_or(0).saturating_sub(cell.chars().count());
                if ends_early(row, c) { cell.clone() } else { format!("{}{cell}", " ".repeat(gap)) }
            };
            let cells: Vec<String> = row.iter().enumerate().map(cell).collect();
            format!("  {}\n", cells.join("  ").trim_end())
        };
        rows.iter().map(line).collect()
    }
}

/// Lines of text, broken between words where they would be longer than `width`; what goes on is indented by four letters.
pub fn wrapped(text: &str, width: Option<usize>) -> String {
    let Some(width) = width else { return text.into() };
    let mut out = String::new();
    for line in text.split_inclusive('\n') {
        let mut used = 0;
        // With its blanks, so that a line that is short enough stays as it is.
        for word in line.split_inclusive(' ') {
            let long = word.trim_end().chars().count();
            if used > 4 && used + long > width {
                out.truncate(out.trim_end_matches(' ').len());
                out.push_str("\n    ");
                used = 4;
            }
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
        table.push(["1", "307", "0.501 (0.498 to 0.504)", "0.11"].map(String::from).to_vec());
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
        let narrow =
            "  branch               frequency\n       1  0.501 (0.498 to 0.504)\n      12    none: too short\n";
        assert_eq!(text, narrow);
    }

    #[test]
    fn words_are_not_broken() {
        assert_eq!(wrapped("one two  three\nfour\n", Some(9)), "one two\n    three\nfour\n");
        assert_eq!(wrapped("  a verylongword b", Some(6)), "  a\n    verylongword\n    b");
        assert_eq!(wrapped("any length", None), "any length");
    }
}
