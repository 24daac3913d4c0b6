//! The table of `--pairs`: places that are the same in film and scan.

use crate::cloud::PlacePair;
use crate::files::{read_bounded, without_byte_order_mark};
use nalgebra::{Point2, Point3};
use std::path::Path;

/// The first line of the table, and the largest, bytes.
const PAIR_COLUMNS: &str = "u_px,v_px,x,y,z";
const LARGEST_PAIRS: u64 = 1_000_000;
const MOST_PAIRS: usize = 1000;

/// What may part cells; where it is no comma, numbers may have one.
const SEPARATORS: [char; 3] = [',', ';', '\t'];

/// The places of `--pairs`, in the unit of the scan.
#[derive(Clone, Debug)]
pub struct Pairs(pub Vec<PlacePair>);

/// The number in a cell.
fn number(cell: &str, separator: char) -> Option<f64> {
    match separator {
        ',' => cell.parse().ok(),
        _ => cell.replace(',', ".").parse().ok(),
    }
}

/// Parses `--pairs`.
pub fn read_pairs(path: &str) -> Result<Pairs, String> {
    let bytes =
        read_bounded(Path::new(path), LARGEST_PAIRS).map_err(|e| format!("{e}; give a table"))?;
    parse(&String::from_utf8_lossy(&bytes))
}

fn parse(text: &str) -> Result<Pairs, String> {
    let mut lines = (1..)
        .zip(without_byte_order_mark(text).lines().map(str::trim))
        .filter(|(_, line)| !line.is_empty());
    let head = lines.next().map_or("", |(_, line)| line).replace(' ', "");
    let separator = SEPARATORS
        .into_iter()
        .find(|separator| head.replace(*separator, ",") == PAIR_COLUMNS);
    let Some(separator) = separator else {
        return Err(format!(
            "its first line must be {PAIR_COLUMNS} (or with semicolons or tabs)"
        ));
    };
    let mut pairs = Vec::new();
    for (row, line) in lines {
        let cells: Option<Vec<f64>> = line
            .split(separator)
            .map(|cell| number(cell.trim(), separator))
            .collect();
        match cells.as_deref() {
            Some(&[u, v, x, y, z]) if [u, v, x, y, z].iter().all(|n| n.is_finite()) => {
                pairs.push(PlacePair {
                    film_px: Point2::new(u, v),
                    scan: Point3::new(x, y, z),
                })
            }
            _ => return Err(format!("line {row} does not hold five numbers")),
        }
    }
    match pairs.len() {
        MOST_PAIRS.. => Err(format!(
            "it holds more than {MOST_PAIRS} pairs; give some all over the tree"
        )),
        0..3 => Err(format!(
            "it holds {} pairs, and three are needed",
            pairs.len()
        )),
        _ => Ok(Pairs(pairs)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_may_be_parted_as_spreadsheets_do() {
        let rows = [
            "u_px,v_px,x,y,z",
            "1.5,2,3,4,5.25",
            "2,2,3,4,5",
            "3,2,3,4,5",
        ];
        let plain = rows.join("\n");
        let semicolons = plain.replace(',', ";").replace('.', ",");
        let tabs = plain.replace(',', "\t");
        for text in [plain, semicolons, tabs] {
            let pairs = parse(&text).expect("pairs").0;
            assert_eq!(pairs.len(), 3);
            assert_eq!(pairs[0].film_px, Point2::new(1.5, 2.0));
            assert_eq!(pairs[0].scan, Point3::new(3.0, 4.0, 5.25));
        }
        assert!(parse("u,v,x,y,z\n").is_err());
        let many = format!("{PAIR_COLUMNS}\n{}", "1,2,3,4,5\n".repeat(1001));
        assert!(parse(&many).is_err_and(|why| why.contains("more than 1000 pairs")));
    }
}
