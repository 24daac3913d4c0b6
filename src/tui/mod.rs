//! The screen of a running capture: what is filmed, how well it goes, the tree as it moves, and
//! keys to steer it.
//!
//! The screen reads immutable [`Snapshot`]s and sends [`Control`]s through a [`Session`]; it knows
//! nothing of the pipeline and starts no thread. [`run`] blocks the calling thread until the
//! capture has ended.

mod abilities;
mod awaited;
mod compose;
mod count_bar;
mod drawing;
mod format;
mod graphics;
mod guard;
mod input;
mod layout;
mod moving;
mod opened;
mod panels;
mod photo;
mod placed;
mod plot;
mod progress;
mod raster;
mod screen;
mod solid;
mod state;
#[cfg(test)]
mod tests;
mod theme;
mod tty;
mod wood;

pub use abilities::{Abilities, abilities, columns};
pub use count_bar::CountBar;
pub use graphics::Preview;
pub use guard::give_terminal_back;
pub use moving::{AnimationCommand, Moving, watch};
pub use opened::{Options, TuiError};
pub use photo::{FoundTree, PhotoSession, draw_on_photo};
pub use progress::Progress;
pub use theme::Depth;

use crate::model::{Control, Snapshot};
use guard::Guard;
use opened::Opened;
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event;
use state::State;
use std::io::Stdout;
use std::mem::ManuallyDrop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use theme::Theme;
use tty::{Input, Tty};

/// Time between two redraws.
const TICK: Duration = Duration::from_millis(50);

/// The screen's side of a running capture.
pub trait Session {
    /// Newest state, `None` if none is newer than the last one taken.
    fn latest(&mut self) -> Option<Arc<Snapshot>>;
    /// Passes on what the user wants.
    fn send(&mut self, command: Control);
    /// Passes on what the capture does not know of, so that it outlives the screen.
    fn warn(&mut self, warning: &str);
    /// The capture has ended (source over and files written, or failed): the screen is left.
    fn finished(&self) -> bool;
}

/// Shows the capture until it has ended, `stop` is set, the terminal has gone or some thread has
/// panicked; in all but the first case [`Control::Quit`] is sent before. The terminal is then as it
/// was.
///
/// # Errors
/// There is no terminal, or it cannot be prepared. Nothing has been sent then.
pub fn run(session: &mut dyn Session, options: Options, stop: &AtomicBool) -> Result<(), TuiError> {
    let Opened {
        terminal,
        guard,
        tty,
        graphics,
        deaf_until,
    } = Opened::new(options)?;
    let theme = Theme::new(options.depth);
    let mut screen = Screen {
        terminal,
        guard,
        tty,
        theme,
        deaf_until,
        preview: panels::preview::Preview::new(graphics),
    };
    let mut state = State::default();
    while !session.finished() {
        if let Some(snapshot) = session.latest() {
            state.take(snapshot);
            if let Some(lost) = state.leave_drawing_at_end() {
                session.warn(lost);
            }
        }
        let gone = stop.load(Ordering::SeqCst) || screen.step(&mut state, session).is_none();
        if gone {
            session.send(Control::Quit);
            break;
        }
    }
    Ok(())
}

struct Screen {
    terminal: ManuallyDrop<Terminal<CrosstermBackend<Stdout>>>,
    guard: Guard,
    tty: Tty,
    theme: Theme,
    deaf_until: Instant,
    preview: panels::preview::Preview,
}

impl Screen {
    /// Draws once and passes on what the user does until the next redraw is due; `None` when the
    /// terminal has gone.
    fn step(&mut self, state: &mut State, session: &mut dyn Session) -> Option<()> {
        let began = Instant::now();
        {
            let _lock = self.guard.writing()?;
            self.terminal
                .draw(|frame| screen::render(frame, state, self.theme, &mut self.preview))
                .ok()?;
        }
        self.preview.drawn(began, Instant::now());
        state.tick();
        match self.tty.wait(TICK.saturating_sub(began.elapsed())) {
            Input::Gone => return None,
            Input::Quiet => {}
            // crossterm may leave bytes unread until more come; without a pause that would be a
            // busy loop.
            Input::Ready if self.listen(state, session)? == 0 => std::thread::sleep(TICK / 5),
            Input::Ready => {}
        }
        self.guard.set_mouse(state.drawing.is_some()).ok()
    }

    /// Handles every event that has come; how many there were.
    fn listen(&mut self, state: &mut State, session: &mut dyn Session) -> Option<usize> {
        let mut heard = 0;
        while event::poll(Duration::ZERO).ok()? {
            let event = event::read().ok()?;
            heard += 1;
            if Instant::now() < self.deaf_until {
                continue;
            }
            if let Some(command) = input::handle(&event, state, self.preview.placed.as_ref()) {
                session.send(command);
            }
        }
        Some(heard)
    }
}
