//! Coloured markers as the user gives them: windows, parents, and corrections of their places.

use super::load::ConfigError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// So many markers are followed at most.
pub const MAX_MARKERS: usize = 64;
/// Least and largest side of a marker's window, px.
const LEAST_SIDE_PX: f64 = 3.0;
const MAX_SIDE_PX: f64 = 1000.0;
/// So many corrections are taken at most.
const MAX_CORRECTIONS: usize = 10_000;

/// A marker and the window around it in the first frame that is tracked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarkerWindow {
    /// What it is called in tables and messages.
    pub name: String,
    /// Left edge, upper edge, width and height, px; the marker is in the middle.
    pub window_px: [f64; 4],
    /// The name of the marker that is next on the way to the foot of the tree; `None` where that is
    /// the foot itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
}

/// Where a marker is in one frame, as the user says (Hu et al. sect. 5.1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarkerCorrection {
    /// The name of the marker.
    pub marker: String,
    /// Number of the frame, from 0.
    pub frame: u64,
    /// Its middle, px from the left and from the top.
    pub at_px: [f64; 2],
}

/// Refuses markers that cannot be followed, and corrections of markers that there are not.
///
/// # Errors
/// A name is empty, there twice, or no line of text, a window is too small or too large, a parent or the marker of a
/// correction is not among them, parents form a ring, a number is not finite, or there are too many.
pub(super) fn check(
    windows: &[MarkerWindow],
    corrections: &[MarkerCorrection],
) -> Result<(), ConfigError> {
    if windows.len() > MAX_MARKERS {
        return Err(refused(format!(
            "{} markers are given; give at most {MAX_MARKERS}",
            windows.len()
        )));
    }
    windows.iter().try_for_each(check_window)?;
    check_marker_names(windows)?;
    if corrections.len() > MAX_CORRECTIONS {
        return Err(refused(format!(
            "more than {MAX_CORRECTIONS} corrections are given"
        )));
    }
    let mut places = BTreeSet::new();
    for correction in corrections {
        let name = &correction.marker;
        if !windows.iter().any(|window| window.name == *name) {
            return Err(refused(format!(
                "a correction is for marker {name}, which there is not"
            )));
        }
        if !correction.at_px.iter().all(|x| x.is_finite()) {
            return Err(refused(format!(
                "a correction of marker {name} is no place"
            )));
        }
        let frame = correction.frame;
        if !places.insert((name, frame)) {
            return Err(refused(format!(
                "marker {name} has two corrections in frame {frame}"
            )));
        }
    }
    Ok(())
}

fn check_window(window: &MarkerWindow) -> Result<(), ConfigError> {
    let [u, v, width, height] = window.window_px;
    let sides = LEAST_SIDE_PX..=MAX_SIDE_PX;
    if u.is_finite() && v.is_finite() && sides.contains(&width) && sides.contains(&height) {
        return Ok(());
    }
    Err(refused(format!(
        "the window of marker {} must have sides of {LEAST_SIDE_PX} to {MAX_SIDE_PX} px: \
         window_px is [left, top, width, height]",
        window.name
    )))
}

/// Checks that markers have names of their own, and that their parents are markers and lead to the foot.
///
/// # Errors
/// A name is empty, there twice, or no line of text, a parent is no marker, or they form a ring.
pub fn check_marker_names(windows: &[MarkerWindow]) -> Result<(), ConfigError> {
    let names: BTreeSet<&str> = windows.iter().map(|w| w.name.as_str()).collect();
    if names.len() < windows.len() || names.contains("") {
        return Err(refused(
            "markers must have names, each a name of its own".into(),
        ));
    }
    if names.iter().any(|name| name.contains(char::is_control)) {
        return Err(refused(
            "names of markers must be text without line breaks and tabs".into(),
        ));
    }
    for window in windows {
        check_parents(window, windows)?;
    }
    Ok(())
}

/// Follows the parents of a marker to the foot.
fn check_parents(window: &MarkerWindow, windows: &[MarkerWindow]) -> Result<(), ConfigError> {
    let mut next = window.parent.as_deref();
    for _ in 0..windows.len() {
        let Some(name) = next else {
            return Ok(());
        };
        let Some(parent) = windows.iter().find(|w| w.name == name) else {
            return Err(refused(format!("the parent {name} is no marker")));
        };
        next = parent.parent.as_deref();
    }
    match next {
        None => Ok(()),
        Some(_) => Err(refused(format!(
            "the parents of marker {} form a ring; the first one has no parent",
            window.name
        ))),
    }
}

fn refused(what: String) -> ConfigError {
    ConfigError::Markers { what }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(name: &str, parent: Option<&str>) -> MarkerWindow {
        MarkerWindow {
            name: name.into(),
            window_px: [10.0, 20.0, 16.0, 16.0],
            parent: parent.map(str::to_owned),
        }
    }

    fn why(windows: &[MarkerWindow], corrections: &[MarkerCorrection]) -> String {
        match check(windows, corrections) {
            Ok(()) => String::new(),
            Err(e) => e.to_string(),
        }
    }

    #[test]
    fn markers_that_cannot_be_followed_are_refused() {
        let tree = [window("A", None), window("B", Some("A"))];
        assert_eq!(why(&tree, &[]), "");
        let small = MarkerWindow {
            window_px: [0.0, 0.0, 2.0, 9.0],
            ..window("A", None)
        };
        let at = |marker: &str, u: f64| MarkerCorrection {
            marker: marker.into(),
            frame: 3,
            at_px: [u, 1.0],
        };
        let cases = [
            (
                why(&[window("A", None), window("A", None)], &[]),
                "a name of its own",
            ),
            (why(&[window("", None)], &[]), "must have names"),
            (why(&[small], &[]), "sides of 3 to 1000 px"),
            (
                why(&[window("A", Some("C"))], &[]),
                "the parent C is no marker",
            ),
            (
                why(&[window("A", Some("B")), window("B", Some("A"))], &[]),
                "form a ring",
            ),
            (why(&tree, &[at("C", 1.0)]), "marker C, which there is not"),
            (why(&tree, &[at("A", f64::NAN)]), "is no place"),
        ];
        for (why, expected) in cases {
            assert!(why.contains(expected), "{why:?} lacks {expected:?}");
        }
        assert_eq!(why(&tree, &[at("B", 4.0)]), "");
        let twice = [window("A", None), window("A", None)];
        assert!(check_marker_names(&twice).is_err());
        let both = why(&tree, &[at("B", 4.0), at("B", 5.0)]);
        assert!(both.contains("two corrections in frame 3"), "{both}");
        let lines = why(&[window("A\nB", None)], &[]);
        assert!(lines.contains("without line breaks"), "{lines}");
    }
}
