//! The modes of the whole tree in a table.

use super::{cells, stacked};
use crate::report::study::Study;
use crate::report::text::{MODE_HEADS, mode_cells};

/// Every mode in a row; nothing where none was found.
pub fn modes_part(study: &Study) -> String {
    if study.modes.is_empty() {
        return String::new();
    }
    let mut rows = String::new();
    for mode in &study.modes {
        let row = mode_cells(mode).map(|cell| stacked(&cell));
        rows += &format!("<tr>{}</tr>", cells("td", "n", &row));
    }
    let head = cells("th", "n", &MODE_HEADS.map(|(head, _)| head.to_owned()));
    format!(
        "<h3>Modes of the whole tree</h3><p class=\"soft\">Slowest first. Node and branch are \
         those whose own mode it is; a dash where the tree lacks that branch. Energy: the largest \
         shares of trunk and limbs.</p><div class=\"wide\"><table>\
         <tr>{head}</tr>{rows}</table></div>"
    )
}
