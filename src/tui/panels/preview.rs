//! The picture with outline and points.

use super::{titled, waiting};
use crate::model::{Size, Snapshot};
use crate::tui::awaited::awaited;
use crate::tui::compose;
use crate::tui::drawing::Drawing;
use crate::tui::graphics::{Graphics, Kind};
use crate::tui::placed::Placed;
use crate::tui::raster::Raster;
use crate::tui::state::State;
use crate::tui::theme::Theme;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Color;
use ratatui::text::Line;
use ratatui_image::Image;
use ratatui_image::protocol::Protocol;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Share of the time that may go into pictures, as a divisor: the keys must stay quick on a slow
/// line.
const SHARE: u32 = 4;
const SHORTEST: Duration = Duration::from_millis(90);

/// What the preview keeps from one redraw to the next.
#[derive(Debug)]
pub struct Preview {
    pub graphics: Graphics,
    /// Where the picture was drawn last: what a click on it means.
    pub placed: Option<Placed>,
    sent: Option<Sent>,
    next_at: Option<Instant>,
    /// A new picture went out with this redraw.
    fresh: bool,
}

/// A picture as the terminal has it, and what it was made from.
struct Sent {
    protocol: Protocol,
    placed: Placed,
    snapshot: Arc<Snapshot>,
    drawing: Option<Drawing>,
    /// Whether the wood that was found is shown in it.
    wood: bool,
}

impl std::fmt::Debug for Sent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sent")
            .field("placed", &self.placed)
            .finish_non_exhaustive()
    }
}

impl Preview {
    /// Nothing drawn yet.
    pub fn new(graphics: Graphics) -> Self {
        Self {
            graphics,
            placed: None,
            sent: None,
            next_at: None,
            fresh: false,
        }
    }

    /// Says when a redraw began and when it was on the terminal, so that pictures keep to their
    /// share of the time.
    pub fn drawn(&mut self, began: Instant, ended: Instant) {
        if std::mem::take(&mut self.fresh) {
            self.next_at = Some(ended + (SHARE * (ended - began)).max(SHORTEST));
        }
    }

    /// Size of the whole picture, if there is one to be drawn.
    pub fn image(state: &State) -> Option<Size> {
        state
            .snapshot
            .preview
            .as_ref()
            .and_then(|_| compose::image_size(&state.snapshot))
    }
}

/// Draws the picture as large as it fits, or says what it waits for.
pub fn render(frame: &mut Frame, state: &State, area: Rect, theme: Theme, preview: &mut Preview) {
    let title = match &state.drawing {
        Some(drawing) => format!(
            "Picture: draw {}, {} set",
            drawing.subject().name(),
            drawing.points_px().len()
        ),
        None => "Picture".to_owned(),
    };
    let inner = titled(frame, area, &title, theme);
    // Text cannot be laid over a picture that the terminal draws, so that under the help it is made
    // of characters.
    let kind = match preview.graphics.kind {
        Kind::Letters => Kind::Letters,
        _ if state.help => Kind::HalfBlocks,
        kind => kind,
    };
    let cell_dots = if matches!(kind, Kind::Letters | Kind::HalfBlocks) {
        (1, 2)
    } else {
        preview.graphics.cell_dots
    };
    preview.placed = Preview::image(state).and_then(|image| Placed::fit(image, inner, cell_dots));
    let Some(placed) = preview.placed else {
        preview.sent = None;
        waiting(frame, inner, &reason(state), theme);
        return;
    };
    let drawn = match kind {
        Kind::Letters => {
            compose::letters(state, &placed).map(|rows| letters(frame, &rows, placed.area, theme))
        }
        Kind::HalfBlocks => {
            preview.sent = None;
            compose::picture(state, &placed, theme)
                .map(|raster| half_blocks(frame, &raster, placed.area, theme))
        }
        Kind::Kitty | Kind::Sixel | Kind::Iterm2 => sent(frame, state, &placed, theme, preview),
    };
    if drawn.is_none() {
        preview.placed = None;
        waiting(frame, inner, "this picture cannot be shown", theme);
    }
}

fn sent(
    frame: &mut Frame,
    state: &State,
    placed: &Placed,
    theme: Theme,
    preview: &mut Preview,
) -> Option<()> {
    let stale = preview.sent.as_ref().is_none_or(|old| {
        let other = !Arc::ptr_eq(&old.snapshot, &state.snapshot)
            || old.drawing != state.drawing
            || old.wood != state.wood;
        let due = preview.next_at.is_none_or(|at| Instant::now() >= at);
        old.placed != *placed || (other && due)
    });
    if stale {
        let raster = compose::picture(state, placed, theme)?;
        let protocol = preview.graphics.encode(raster, placed.area.as_size())?;
        let (snapshot, drawing) = (state.snapshot.clone(), state.drawing.clone());
        preview.sent = Some(Sent {
            protocol,
            placed: *placed,
            snapshot,
            drawing,
            wood: state.wood,
        });
        preview.fresh = true;
    }
    let sent = preview.sent.as_ref()?;
    frame.render_widget(Image::new(&sent.protocol), placed.area);
    Some(())
}

/// Two dots in each cell, the upper in the letter's colour, the lower in the ground's.
fn half_blocks(frame: &mut Frame, raster: &Raster, area: Rect, theme: Theme) {
    for (row, y) in (area.top()..area.bottom()).zip(0u32..) {
        for (column, x) in (area.left()..area.right()).zip(0u32..) {
            let Some(cell) = frame.buffer_mut().cell_mut((column, row)) else {
                continue;
            };
            let below = 2 * y + 1 < raster.size.height;
            let lower = if below {
                theme.colour(raster.at(x, 2 * y + 1))
            } else {
                Color::Reset
            };
            cell.set_char('▀')
                .set_fg(theme.colour(raster.at(x, 2 * y)))
                .set_bg(lower);
        }
    }
}

fn letters(frame: &mut Frame, rows: &[Vec<char>], area: Rect, theme: Theme) {
    for (letters, row) in rows.iter().zip(area.rows()) {
        frame.render_widget(
            Line::styled(letters.iter().collect::<String>(), theme.faint()),
            row,
        );
    }
}

fn reason(state: &State) -> String {
    match &state.snapshot.preview {
        Some(_) => "this picture cannot be shown".to_owned(),
        None => awaited(state).text,
    }
}
