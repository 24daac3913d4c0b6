//! A terminal that has been made ready to draw on.

use super::graphics::Graphics;
use super::guard::Guard;
use super::tty::Tty;
use super::{ASK, DEAF, Options, TuiError};
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use std::io::{IsTerminal, Stdout, stdout};
use std::mem::ManuallyDrop;
use std::time::{Duration, Instant};

/// The terminal and what it can show; the guard gives it back as it was.
pub struct Opened {
    pub terminal: ManuallyDrop<Terminal<CrosstermBackend<Stdout>>>,
    pub guard: Guard,
    pub tty: Tty,
    pub graphics: Graphics,
    /// Until then what comes may be the terminal's late answers, and no keys.
    pub deaf_until: Instant,
}

impl Opened {
    /// # Errors
    /// There is no terminal, or it cannot be prepared.
    pub fn new(options: Options) -> Result<Self, TuiError> {
        if !stdout().is_terminal() {
            return Err(TuiError::NoTerminal(None));
        }
        let tty = Tty::open().map_err(|e| TuiError::NoTerminal(Some(e)))?;
        let mut guard = Guard::enter().map_err(TuiError::Unusable)?;
        let graphics =
            Graphics::ask(&tty, options.preview, options.depth, ASK).map_err(TuiError::Unusable)?;
        guard.set_farewell(graphics.farewell());
        // ratatui's own drop complains on standard error, which panics when the terminal has gone;
        // the guard does its work.
        let terminal = Terminal::new(CrosstermBackend::new(stdout()))
            .map(ManuallyDrop::new)
            .map_err(TuiError::Unusable)?;
        let deaf_until = Instant::now() + if graphics.late { DEAF } else { Duration::ZERO };
        Ok(Self {
            terminal,
            guard,
            tty,
            graphics,
            deaf_until,
        })
    }
}
