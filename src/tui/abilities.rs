//! What the terminal can do, without drawing on it.

use super::graphics::{Graphics, Kind};
use super::opened::{ASK, Options};
use super::theme::Depth;
use super::tty::Tty;
use ratatui::crossterm::terminal;
use std::io::{IsTerminal, stdout};

/// What was learned of the terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Columns and rows.
    pub cells: (u16, u16),
    pub depth: Depth,
    /// How pictures are sent, e.g. `kitty`.
    pub pictures: &'static str,
}

/// Columns of the terminal that standard output is; `None` where it is none, or does not say.
pub fn columns() -> Option<u16> {
    let (columns, _) = stdout().is_terminal().then(terminal::size)?.ok()?;
    (columns > 0).then_some(columns)
}

/// Asks the terminal; `None` where standard output is none, or it cannot be asked.
pub fn abilities() -> Option<Abilities> {
    let tty = stdout().is_terminal().then(Tty::open)?.ok()?;
    let cells = terminal::size().ok()?;
    let options = Options::from_env();
    // Raw, or the terminal's answer would be shown instead of read.
    terminal::enable_raw_mode().ok()?;
    let graphics = Graphics::ask(&tty, options.preview, options.depth, ASK);
    let _ = terminal::disable_raw_mode();
    let pictures = match graphics.ok()?.kind {
        Kind::Letters => "letters",
        Kind::HalfBlocks => "half blocks",
        Kind::Kitty => "kitty",
        Kind::Sixel => "Sixel",
        Kind::Iterm2 => "iTerm2",
    };
    Some(Abilities {
        cells,
        depth: options.depth,
        pictures,
    })
}
