//! Where each panel lies.

use super::state::State;
use crate::model::Size;
use ratatui::layout::{Constraint, Layout, Rect};

/// Smallest window in which the screen makes sense.
pub const SMALLEST: (u16, u16) = (60, 16);

/// The panels' places; none overlaps another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Areas {
    pub header: Rect,
    pub phase: Rect,
    pub guide: Rect,
    pub preview: Rect,
    pub branches: Rect,
    /// Not where the branch takes their place.
    pub camera_and_tracks: Option<[Rect; 2]>,
    /// The chosen branch.
    pub branch: Option<Rect>,
    pub skeleton: Rect,
    pub verdict: Rect,
    pub messages: Rect,
    pub keys: Rect,
}

/// What is to be seen of the chosen branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BranchView {
    /// There is none.
    Nothing,
    /// It is shown where there is room for all.
    IfRoom,
    /// It is shown, if need be in the place of camera and points.
    CloseUp,
}

impl BranchView {
    pub fn of(state: &State) -> Self {
        match (state.snapshot.branches.is_empty(), state.close_up) {
            (true, _) => Self::Nothing,
            (_, false) => Self::IfRoom,
            (_, true) => Self::CloseUp,
        }
    }
}

/// Rows of the chosen branch beside all else, and rows that the tree must keep then.
const BRANCH_ROWS: u16 = 12;
const TREE_ROWS: u16 = 8;

impl Areas {
    /// Divides the window, giving the picture the height that it needs; `None` for a window that is
    /// too small.
    /// `cell_dots` are the dots of a cell in which the picture will be drawn, across and down.
    pub fn new(
        window: Rect,
        image: Option<Size>,
        cell_dots: (u16, u16),
        view: BranchView,
    ) -> Option<Self> {
        if window.width < SMALLEST.0 || window.height < SMALLEST.1 {
            return None;
        }
        let roomy = window.height >= 32;
        let message_rows = match window.height {
            0..20 => 1,
            20..32 => 2,
            32.. => 4,
        };
        let [header, phase, guide, body, verdict, messages, keys] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(1),
            Constraint::Length(1),
            Constraint::Min(1),
            Constraint::Length(1),
            Constraint::Length(message_rows),
            Constraint::Length(1),
        ])
        .areas(window);
        let left_width = (body.width as u32 * 58 / 100) as u16;
        let [left, _, right] = Layout::horizontal([
            Constraint::Length(left_width),
            Constraint::Length(1),
            Constraint::Min(1),
        ])
        .areas(body);

        let [preview, branches] = left_column(left, roomy, image, cell_dots);
        let right = RightColumn::new(right, roomy, view);
        Some(Self {
            header,
            phase,
            guide,
            preview,
            branches,
            camera_and_tracks: right.camera_and_tracks,
            branch: right.branch,
            skeleton: right.skeleton,
            verdict,
            messages,
            keys,
        })
    }
}

/// The picture and below it the table of branches.
fn left_column(left: Rect, roomy: bool, image: Option<Size>, cell_dots: (u16, u16)) -> [Rect; 2] {
    // One line of title; at least the table's head and some rows must stay below the picture.
    let table_least = if roomy { 8 } else { (left.height / 4).max(3) };
    let wanted = image
        .map_or(left.height, |image| {
            rows_needed(image, left.width, cell_dots)
        })
        .saturating_add(1);
    let preview_height = wanted.min(left.height.saturating_sub(table_least));
    Layout::vertical([Constraint::Length(preview_height), Constraint::Min(1)]).areas(left)
}

/// Camera and points, the chosen branch, and the tree.
struct RightColumn {
    camera_and_tracks: Option<[Rect; 2]>,
    branch: Option<Rect>,
    skeleton: Rect,
}

impl RightColumn {
    fn new(right: Rect, roomy: bool, view: BranchView) -> Self {
        let camera = match right.height {
            0..16 => 6,
            16..20 => 7,
            20.. => 8,
        };
        let short = 3;
        let beside = right
            .height
            .saturating_sub(camera + BRANCH_ROWS + TREE_ROWS);
        let fits = view != BranchView::Nothing && beside >= short;
        let tracks = if roomy && !(fits && beside < 6) {
            6
        } else {
            short
        };
        let replaced = view == BranchView::CloseUp && !fits;
        let [camera, tracks, branch] = match (replaced, fits) {
            (true, _) => [0, 0, camera + tracks],
            (_, true) => [camera, tracks, BRANCH_ROWS],
            _ => [camera, tracks, 0],
        };
        let [camera, tracks, branch, skeleton] = Layout::vertical([
            Constraint::Length(camera),
            Constraint::Length(tracks),
            Constraint::Length(branch),
            Constraint::Min(1),
        ])
        .areas(right);
        Self {
            camera_and_tracks: (!replaced).then_some([camera, tracks]),
            branch: (replaced || fits).then_some(branch),
            skeleton,
        }
    }
}

/// Rows of cells that a picture takes when it is as wide as the column.
fn rows_needed(image: Size, columns: u16, cell_dots: (u16, u16)) -> u16 {
    let dots_wide = columns as f64 * cell_dots.0 as f64;
    let rows =
        dots_wide * image.height as f64 / image.width.max(1) as f64 / cell_dots.1.max(1) as f64;
    rows.ceil().min(10_000.0) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_fill_the_window_without_overlap() {
        for (width, height) in [
            (60, 16),
            (80, 24),
            (81, 31),
            (120, 40),
            (200, 60),
            (400, 20),
            (65, 200),
        ] {
            let images = [
                None,
                Some(Size::new(640, 360)),
                Some(Size::new(1, 10_000)),
                Some(Size::new(10_000, 1)),
            ];
            let views = [BranchView::Nothing, BranchView::IfRoom, BranchView::CloseUp];
            for (image, view) in images.into_iter().flat_map(|i| views.map(|v| (i, v))) {
                let window = Rect::new(0, 0, width, height);
                let a = Areas::new(window, image, (1, 2), view).unwrap();
                assert!(
                    a.branch.is_some() || view != BranchView::CloseUp,
                    "{width}x{height}"
                );
                let mut all = vec![
                    a.header, a.phase, a.guide, a.preview, a.branches, a.skeleton, a.verdict,
                    a.messages, a.keys,
                ];
                all.extend(a.camera_and_tracks.into_iter().flatten().chain(a.branch));
                for (i, one) in all.iter().enumerate() {
                    assert!(
                        !one.is_empty() && window.union(*one) == window,
                        "{i} at {width}x{height}: {one:?}"
                    );
                    for other in &all[i + 1..] {
                        assert!(
                            !one.intersects(*other),
                            "{one:?} and {other:?} at {width}x{height}"
                        );
                    }
                }
            }
        }
        for (width, height) in [(0, 0), (1, 1), (59, 60), (200, 15)] {
            assert_eq!(
                Areas::new(
                    Rect::new(0, 0, width, height),
                    None,
                    (1, 2),
                    BranchView::IfRoom
                ),
                None
            );
        }
    }
}
