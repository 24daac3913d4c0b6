//! `cylinders.csv`: the wood as the tools for quantitative structure models exchange it.

use crate::document::{TableWriter, unit};
use crate::files::WriteError;
use crate::geometry::Cylinder;
use std::io::Write;

pub const CYLINDERS_HEADER: &str = "ID,parentID,start_x,start_y,start_z,end_x,end_y,end_z,axis_x,axis_y,axis_z,radius,\
length,branch,branch_order,made_up";

/// Writes the table. Numbers count from 1, and the parent of what stands on the ground is 0, as
/// those tools have it. Model axes; `metres_per_px` 0 leaves pixels.
///
/// # Errors
/// The file cannot be written.
pub fn cylinders<W: Write>(out: W, rows: &[Cylinder], metres_per_px: f64) -> Result<W, WriteError> {
    let mut table = TableWriter::new("cylinders.csv", CYLINDERS_HEADER, out)?;
    let (scale, more) = unit(metres_per_px);
    for (id, row) in (1_u64..).zip(rows) {
        table.count(id);
        table.count(row.parent.map_or(0, |p| p as u64 + 1));
        for x in row.start.iter().chain(row.end.iter()) {
            table.number(x * scale, 4 + more);
        }
        let way = row.end - row.start;
        for x in way.try_normalize(1e-12).unwrap_or_default().iter() {
            table.number(*x, 6);
        }
        for length in [row.radius, way.norm()] {
            table.number(length * scale, 4 + more);
        }
        table.count(row.branch as u64 + 1);
        table.count(row.order);
        table.count(u8::from(row.made_up));
        table.end_row()?;
    }
    table.finish()
}
