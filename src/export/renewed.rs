//! `nodes.csv` with other answers on the sway; everything else stays as it is, byte for byte.

use super::ExportError;
use super::csv::NODES_HEADER;
use super::sway::cells;
use crate::model::{NodeName, Swaying, Unidentified};
use std::collections::BTreeMap;

/// The columns that say something of the sway begin with this one, in [`NODES_HEADER`].
const FIRST: &str = "frequency_hz";

/// The text of a `nodes.csv` with the sway of `known` nodes; all others were not measured. Columns
/// that a table of an older version lacks are added at the end of its rows.
///
/// # Errors
/// It is no such table: there is no column `node_id`, or it holds something else than a number.
pub fn renewed(text: &[u8], known: &BTreeMap<NodeName, Swaying>) -> Result<Vec<u8>, ExportError> {
    let names: Vec<&str> = NODES_HEADER
        .split(',')
        .skip_while(|name| *name != FIRST)
        .collect();
    let mut lines = rows(text).into_iter();
    let header = lines.next().unwrap_or_default();
    let plain = |cell: &[u8]| {
        String::from_utf8_lossy(cell)
            .trim_start_matches('\u{feff}')
            .trim()
            .replace('"', "")
    };
    let titles: Vec<String> = header.cells.iter().map(|c| plain(c)).collect();
    let place = |name: &str| titles.iter().position(|t| t == name);
    let id =
        place("node_id").ok_or_else(|| ExportError::unfit("nodes.csv has no column node_id"))?;
    // Places of the columns, those that are to be added behind all others.
    let mut width = titles.len();
    let mut at = |name: &&str| {
        place(name).unwrap_or_else(|| {
            width += 1;
            width - 1
        })
    };
    let places: Vec<usize> = names.iter().map(&mut at).collect();
    let mut out = Vec::with_capacity(text.len() + 64);
    let added = names
        .iter()
        .zip(&places)
        .filter(|(_, at)| **at >= titles.len());
    let header_cells = header
        .cells
        .iter()
        .map(|c| c.to_vec())
        .chain(added.map(|(name, _)| name.as_bytes().to_vec()));
    push(&mut out, &header_cells.collect::<Vec<_>>(), header.end);
    for row in lines {
        // The reader of tables passes over empty lines too.
        if row.cells.iter().all(|c| c.is_empty()) && row.cells.len() == 1 {
            push(&mut out, &[Vec::new()], row.end);
            continue;
        }
        let name = row
            .cells
            .get(id)
            .and_then(|c| plain(c).parse().ok())
            .map(NodeName);
        let name = name
            .ok_or_else(|| ExportError::unfit("nodes.csv has a row without a number in node_id"))?;
        let sway = known
            .get(&name)
            .copied()
            .unwrap_or(Err(Unidentified::NotMeasured));
        let mut line: Vec<Vec<u8>> = row.cells.iter().map(|c| c.to_vec()).collect();
        if line.len() < width {
            line.resize(width, Vec::new());
        }
        for (place, cell) in places.iter().zip(cells(&sway)) {
            line[*place] = cell.into_bytes();
        }
        push(&mut out, &line, row.end);
    }
    Ok(out)
}

/// The cells of a line as they are written, quotes and all, and how the line ends.
#[derive(Default)]
struct Row<'a> {
    cells: Vec<&'a [u8]>,
    end: &'a [u8],
}

fn rows(text: &[u8]) -> Vec<Row<'_>> {
    let mut out = Vec::new();
    let (mut cells, mut from, mut quoted, mut k) = (Vec::new(), 0, false, 0);
    // Where a quote opens a cell; anywhere else it is a letter, as an inch in a note.
    let mut begin = if text.starts_with("\u{feff}".as_bytes()) {
        3
    } else {
        0
    };
    while k < text.len() {
        match text[k] {
            b'"' if quoted && text.get(k + 1) == Some(&b'"') => k += 1,
            b'"' if quoted => quoted = false,
            b'"' if k == begin => quoted = true,
            b',' if !quoted => {
                cells.push(&text[from..k]);
                (from, begin) = (k + 1, k + 1);
            }
            b'\n' if !quoted => {
                let stop = if k > from && text[k - 1] == b'\r' {
                    k - 1
                } else {
                    k
                };
                cells.push(&text[from..stop]);
                out.push(Row {
                    cells: std::mem::take(&mut cells),
                    end: &text[stop..=k],
                });
                (from, begin) = (k + 1, k + 1);
            }
            _ => {}
        }
        k += 1;
    }
    if from < text.len() || !cells.is_empty() {
        cells.push(&text[from..]);
        out.push(Row { cells, end: &[] });
    }
    out
}

fn push(out: &mut Vec<u8>, cells: &[Vec<u8>], end: &[u8]) {
    for (k, cell) in cells.iter().enumerate() {
        if k > 0 {
            out.push(b',');
        }
        out.extend_from_slice(cell);
    }
    out.extend_from_slice(end);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Excitation, Interval, Sway};

    fn sway() -> Swaying {
        let around = |value: f64| Interval {
            value,
            lo: 0.9 * value,
            hi: 1.1 * value,
        };
        let (frequency_hz, damping_ratio) = (around(0.7), Some(around(0.04)));
        Ok(Sway {
            frequency_hz,
            damping_ratio,
            excitation: Excitation::Wind,
            amplitude_deg: 1.5,
        })
    }

    /// A table that somebody has added notes to in a spreadsheet keeps them, its order of columns
    /// and its ends of lines.
    #[test]
    fn what_is_not_of_the_sway_stays_byte_for_byte() {
        let text = "note,node_id,frequency_hz,frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,damping_hi,\
                    identifiable,x\r\n\"a, \"\"b\"\"\",7,1,2,3,4,5,6,true,0.50\r\n,9,,,,,,,false,1e3\r\n";
        let known = BTreeMap::from([(NodeName(9), sway())]);
        let out = String::from_utf8(renewed(text.as_bytes(), &known).unwrap()).unwrap();
        let lines: Vec<&str> = out.split("\r\n").collect();
        assert!(
            lines[0].ends_with(",identifiable,x,excitation,amplitude_deg,unidentified"),
            "{out}"
        );
        assert_eq!(
            lines[1],
            "\"a, \"\"b\"\"\",7,,,,,,,false,0.50,,,not_measured"
        );
        assert_eq!(
            lines[2],
            ",9,0.7,0.63,0.77,0.04,0.036,0.044,true,1e3,wind,1.5,"
        );
        // Once more: nothing changes.
        assert_eq!(renewed(out.as_bytes(), &known).unwrap(), out.as_bytes());
    }

    /// A quote within a cell is a letter, as it is for the reader of tables: else the row would
    /// swallow those after it.
    #[test]
    fn a_quote_opens_a_cell_only_where_it_begins() {
        let text =
            "\u{feff}\"node_id\",note,frequency_hz\n1,3\" thick,7\n2,\"a\"\", b\",8\n3,\"\",9\n";
        let out = String::from_utf8(
            renewed(text.as_bytes(), &BTreeMap::from([(NodeName(2), sway())])).unwrap(),
        )
        .unwrap();
        let lines: Vec<&str> = out.lines().collect();
        assert_eq!(lines.len(), 4, "{out}");
        assert!(
            lines[0].starts_with("\u{feff}\"node_id\",note,frequency_hz,"),
            "{out}"
        );
        assert!(
            lines[1].starts_with("1,3\" thick,,") && lines[1].ends_with(",not_measured"),
            "{out}"
        );
        assert!(
            lines[2].starts_with("2,\"a\"\", b\",0.7,") && lines[3].starts_with("3,\"\",,"),
            "{out}"
        );
    }

    #[test]
    fn what_is_no_table_of_nodes_is_refused() {
        for text in ["", "a,b\n1,2\n", "node_id,x\nseven,2\n"] {
            assert!(
                renewed(text.as_bytes(), &BTreeMap::new()).is_err(),
                "{text:?}"
            );
        }
    }
}
