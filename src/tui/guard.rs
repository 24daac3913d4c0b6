//! The terminal is as it was after any end: this guard's, or a panic's on any thread.

use crate::caught;
use ratatui::crossterm::cursor::Show;
use ratatui::crossterm::execute;
use ratatui::crossterm::style::ResetColor;
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use std::io::{self, Write, stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, Once, TryLockError};
use std::time::Duration;

/// Clicks and nothing else, in decimal numbers: reports of every movement would flood a slow line.
const MOUSE_ON: &str = "\x1b[?1000h\x1b[?1006h";
const MOUSE_OFF: &str = "\x1b[?1006l\x1b[?1000l";

static ACTIVE: AtomicBool = AtomicBool::new(false);
static WRITING: Mutex<()> = Mutex::new(());
static HOOK: Once = Once::new();

/// Owns the terminal's state while it lives.
#[derive(Debug)]
pub struct Guard {
    mouse: bool,
    farewell: String,
}

impl Guard {
    /// Raw mode and the alternate screen; from here on a panic gives both back before it prints
    /// itself.
    ///
    /// # Errors
    /// Standard output is no terminal, or cannot be written to.
    pub fn enter() -> io::Result<Self> {
        HOOK.call_once(hook_panics);
        enable_raw_mode()?;
        ACTIVE.store(true, Ordering::SeqCst);
        let guard = Self {
            mouse: false,
            farewell: String::new(),
        };
        execute!(stdout(), EnterAlternateScreen)?;
        Ok(guard)
    }

    /// What else is sent to the terminal at the end.
    pub fn set_farewell(&mut self, text: String) {
        self.farewell = text;
    }

    /// Permission to write to the screen, `None` once a panic has given it back.
    pub fn writing(&self) -> Option<MutexGuard<'static, ()>> {
        let lock = WRITING
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner());
        ACTIVE.load(Ordering::SeqCst).then_some(lock)
    }

    /// Switches mouse reports; off, the user can mark text as in any other program.
    ///
    /// # Errors
    /// The terminal cannot be written to.
    pub fn set_mouse(&mut self, on: bool) -> io::Result<()> {
        if on == self.mouse {
            return Ok(());
        }
        let Some(_lock) = self.writing() else {
            return Ok(());
        };
        self.mouse = on;
        let mut out = stdout();
        out.write_all(if on { MOUSE_ON } else { MOUSE_OFF }.as_bytes())?;
        out.flush()
    }
}

/// Gives the terminal back, if a screen has it, before the program ends at once.
pub fn give_terminal_back() {
    restore("");
}

fn hook_panics() {
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        // A caught panic ends nothing, and the screen goes on.
        if !caught::catching() {
            restore("");
        }
        print(panic);
    }));
}

impl Drop for Guard {
    fn drop(&mut self) {
        restore(&self.farewell);
    }
}

/// Gives the terminal back, once. There is nobody to tell of a failure: the terminal itself is what
/// failed.
fn restore(farewell: &str) {
    if !ACTIVE.swap(false, Ordering::SeqCst) {
        return;
    }
    // A redraw on another thread may be half way; one on this thread never ends, hence the limit.
    let _lock = (0..20).find_map(|_| match WRITING.try_lock() {
        Ok(lock) => Some(lock),
        Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
        Err(TryLockError::WouldBlock) => {
            std::thread::sleep(Duration::from_millis(5));
            None
        }
    });
    let mut out = stdout();
    let _ = out.write_all(farewell.as_bytes());
    let _ = out.write_all(MOUSE_OFF.as_bytes());
    let _ = execute!(out, ResetColor, LeaveAlternateScreen, Show);
    let _ = disable_raw_mode();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_screen_outlives_a_panic_that_is_caught() {
        HOOK.call_once(hook_panics);
        ACTIVE.store(true, Ordering::SeqCst);
        let caught = caught::caught(|| panic!("a driver"));
        // What `Guard::enter` did not do must not be undone.
        let active = ACTIVE.swap(false, Ordering::SeqCst);
        assert_eq!(
            (caught, active, caught::catching()),
            (None::<()>, true, false)
        );
    }
}
