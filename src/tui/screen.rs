//! The whole screen: each panel in its place.

use super::layout::{Areas, BranchView};
use super::panels::preview::Preview;
use super::panels::{
    branch, branches, camera, guide, header, help, messages, phase, preview, skeleton, tracks,
    verdict,
};
use super::state::State;
use super::theme::Theme;
use ratatui::Frame;

/// Draws everything.
pub fn render(frame: &mut Frame, state: &State, theme: Theme, picture: &mut Preview) {
    let window = frame.area();
    let Some(areas) = Areas::new(
        window,
        Preview::image(state),
        picture.graphics.cell_dots,
        BranchView::of(state),
    ) else {
        picture.placed = None;
        help::too_small(frame, window);
        return;
    };
    header::render(frame, state, areas.header, theme);
    phase::render(frame, state, areas.phase, theme);
    guide::render(frame, state, areas.guide, theme);
    preview::render(frame, state, areas.preview, theme, picture);
    branches::render(frame, state, areas.branches, theme);
    if let Some([camera, tracks]) = areas.camera_and_tracks {
        camera::render(frame, state, camera, theme);
        tracks::render(frame, state, tracks, theme);
    }
    if let Some(area) = areas.branch {
        branch::render(frame, state, area, theme);
    }
    skeleton::render(frame, state, areas.skeleton, theme);
    verdict::render(frame, state, areas.verdict, theme);
    messages::render(frame, state, areas.messages, theme);
    messages::keys(frame, state, areas.keys, theme);
    if state.help {
        help::render(frame, state, window, theme);
    }
}
