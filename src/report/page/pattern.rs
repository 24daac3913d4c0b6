//! The dominant peaks of the levels in a table (Hu et al. sect. 5.4).

use super::cells;
use crate::report::pattern::pattern;
use crate::report::study::Study;
use crate::report::text::{PEAK_HEADS, peak_cells};
use crate::report::words;

/// The dominant peaks of every level in a row, and what levels 1 to 3 have in common.
pub fn pattern_part(study: &Study) -> String {
    let pattern = pattern(study);
    let mut rows = String::new();
    for level in &pattern.levels {
        rows += &format!("<tr>{}</tr>", cells("td", "n", &peak_cells(level)));
    }
    let table = if rows.is_empty() {
        rows
    } else {
        let head = cells("th", "n", &PEAK_HEADS.map(|(head, _)| head.to_owned()));
        format!(
            "<div class=\"wide\"><table><caption>Peaks of the angle's spectrum that half of the \
             branches of a level have, the clearest first</caption>\
             <tr>{head}</tr>{rows}</table></div>"
        )
    };
    let common = words::common_peaks(&pattern);
    format!(
        "<h3>Dominant peaks across levels</h3><p class=\"soft\">After Hu et al., sect. 5.4: {common}.</p>{table}"
    )
}
