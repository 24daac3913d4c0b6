//! The vertices of a PLY file.

use super::{Points, refuse_many};
use crate::import::error::ImportError;
use crate::import::ply_rows::{Body, bad, read_header};
use std::io::BufRead;

/// Reads x, y and z of all vertices.
///
/// # Errors
/// It is no PLY, its vertices have no x, y and z, or it has fewer rows than its header says, or
/// more.
pub(super) fn read(mut input: impl BufRead, points: &mut Points) -> Result<(), ImportError> {
    let header = read_header(&mut input)?;
    let mut body = Body {
        encoding: header.encoding,
        input,
    };
    let mut row: Vec<f64> = Vec::new();
    for element in &header.elements {
        let mut columns = [None; 3];
        if element.name == "vertex" {
            refuse_many(element.count as u64)?;
            for (column, name) in columns.iter_mut().zip(["x", "y", "z"]) {
                let found = element.properties.iter().position(|p| p.name == name);
                *column = Some(found.ok_or_else(|| bad(&format!("its vertex has no {name}")))?);
            }
        }
        // A row without properties takes no bytes, and there may be any number of them.
        let rows = if element.properties.is_empty() {
            0
        } else {
            element.count
        };
        for number in 0..rows {
            row.clear();
            for property in &element.properties {
                row.push(body.property(property).ok_or_else(|| {
                    let (name, said) = (&element.name, element.count);
                    bad(&format!(
                        "its header says {said} rows of {name}, and row {} cannot be read",
                        number + 1
                    ))
                })?);
            }
            if let [Some(x), Some(y), Some(z)] = columns {
                points.push(row[x], row[y], row[z])?;
            }
        }
    }
    if body.has_more() {
        return Err(bad("it holds more than its header says"));
    }
    Ok(())
}
