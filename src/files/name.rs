//! What the name of a file says.

use std::path::Path;

/// Whether it says that the file is a film.
pub fn is_named_film(path: &Path) -> bool {
    const ENDINGS: [&str; 6] = ["mcap", "mkv", "avi", "mp4", "mov", "webm"];
    let ending = path.extension().unwrap_or_default();
    ENDINGS.iter().any(|e| ending.eq_ignore_ascii_case(e))
}
