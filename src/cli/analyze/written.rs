//! What `arborcam analyze` leaves in files.

use crate::export::sway::Columns;
use crate::export::{ExportError, renewed, replace, write_files};
use crate::model::{NodeName, Swaying};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Tables hold five decimals.
const ROUNDED: f64 = 1.1e-5;

/// The answers into the capture's own table.
///
/// # Errors
/// The table cannot be read or written, or is none; or it was stopped. It is then as it was.
pub fn put_into(
    dir: &Path,
    sway: &BTreeMap<NodeName, Swaying>,
    stop: &AtomicBool,
) -> Result<(), ExportError> {
    let file = dir.join("nodes.csv");
    let explain = |e| ExportError::from_io(file.display().to_string(), 0, e);
    let old = std::fs::read(&file).map_err(explain)?;
    let new = renewed(&old, sway)?;
    if new == old {
        Ok(())
    } else {
        replace(&file, &new, stop)
    }
}

/// The report as a new file.
///
/// # Errors
/// It cannot be written, or was stopped; there is then none.
pub fn put_beside(path: &Path, html: String, stop: &AtomicBool) -> Result<(), ExportError> {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    write_files(
        path.parent().unwrap_or(Path::new("")),
        &[(name, html.into_bytes())],
        stop,
    )
}

/// Whether a model that was made with `old` says what is not so of `new`.
pub fn differs(old: &Swaying, new: &Swaying) -> bool {
    let same = |a: f64, b: f64| (a - b).abs() <= ROUNDED || a.is_nan() && b.is_nan();
    let values = |s: &Swaying| Columns::of(s).values();
    match (old, new) {
        (Ok(a), Ok(b)) => {
            a.excitation != b.excitation
                || !values(old)
                    .into_iter()
                    .zip(values(new))
                    .all(|(a, b)| same(a, b))
        }
        (Err(a), Err(b)) => a != b,
        _ => true,
    }
}

/// Says that the model in a capture holds other answers than its table, and how to make a new one.
pub fn stale(dir: &Path) -> String {
    let dir = dir.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+".contains(c);
    let quoted = if dir.chars().all(plain) {
        dir.clone()
    } else {
        format!("'{}'", dir.replace('\'', "'\\''"))
    };
    format!(
        "arborcam: note: {dir}: tree.glb holds the former answers; a new one: arborcam export {quoted} --format glb --out new.glb"
    )
}
