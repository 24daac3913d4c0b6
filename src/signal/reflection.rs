//! To and fro between two ends.

/// Place (0 to `length`) after `way` of going to and fro over a stretch of that length, both in one
/// unit; 0 on a stretch without length.
pub fn there_and_back(way: f64, length: f64) -> f64 {
    if length <= 0.0 {
        return 0.0;
    }
    let along = way.rem_euclid(2.0 * length);
    if along > length {
        2.0 * length - along
    } else {
        along
    }
}
