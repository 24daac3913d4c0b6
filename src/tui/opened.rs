//! A terminal that has been made ready to draw on.

use super::graphics::{Graphics, Preview};
use super::guard::Guard;
use super::theme::Depth;
use super::tty::Tty;
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use std::io::{IsTerminal, Stdout, stdout};
use std::mem::ManuallyDrop;
use std::time::{Duration, Instant};

/// Time that the terminal has to say what it can show; even a slow network answers within it.
pub const ASK: Duration = Duration::from_millis(400);
/// Time for which a terminal that did not answer is not listened to.
const DEAF: Duration = Duration::from_millis(1500);

/// What the user may choose about the screen.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    pub preview: Preview,
    pub depth: Depth,
}

impl Options {
    /// `ARBORCAM_PREVIEW` is `halfblocks`, `kitty`, `sixel`, `iterm2` or anything else for
    /// automatic; colours follow
    /// `NO_COLOR`, `COLORTERM` and `TERM`.
    pub fn from_env() -> Self {
        let preview = match std::env::var("ARBORCAM_PREVIEW")
            .unwrap_or_default()
            .to_lowercase()
            .as_str()
        {
            "halfblocks" => Preview::HalfBlocks,
            "kitty" => Preview::Kitty,
            "sixel" => Preview::Sixel,
            "iterm2" => Preview::Iterm2,
            _ => Preview::Auto,
        };
        Self {
            preview,
            depth: Depth::from_env(),
        }
    }
}

/// Why there is no screen.
#[derive(Debug, thiserror::Error)]
pub enum TuiError {
    #[error("there is no terminal to draw on; use --headless")]
    NoTerminal(#[source] Option<std::io::Error>),
    #[error("cannot prepare the terminal: {0}; use --headless")]
    Unusable(#[source] std::io::Error),
}

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
