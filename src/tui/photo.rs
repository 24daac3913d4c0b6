//! The screen on which a user draws on a photograph: crown and branches of one tree or several, and what
//! is found along them, anew after every stroke.

mod sheet;
mod shown;

#[cfg(test)]
pub(super) use sheet::KEYS;
pub(super) use sheet::{Next, Sheet};

use super::opened::Opened;
use super::panels::preview::Preview;
use super::theme::Theme;
use super::tty::Input;
use super::{Options, TICK, TuiError};
use crate::model::{Rgb, TreeStrokes, Wood};
use ratatui::crossterm::event;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A photograph on which a user draws.
pub trait PhotoSession {
    /// What the photograph is called.
    fn name(&self) -> &str;
    /// The picture that is drawn on; places are in its pixels.
    fn picture(&self) -> Arc<Rgb>;
    /// Begins to look for a tree along these strokes, and gives up what was begun before.
    fn look(&mut self, strokes: &TreeStrokes);
    /// What was found, once it is there, or why nothing was, in one line.
    fn found(&mut self) -> Option<Result<FoundTree, String>>;
    /// Keeps the strokes of all trees as files, and gives their names.
    ///
    /// # Errors
    /// Nothing is drawn, or a file cannot be written, in one line.
    fn keep(&mut self, trees: &[TreeStrokes]) -> Result<String, String>;
}

/// What is found of one tree.
#[derive(Clone, Debug)]
pub struct FoundTree {
    /// Its branches and the masks of wood and leaves.
    pub wood: Wood,
    pub in_leaf: bool,
    /// The chance that it is right where it is found without strokes, 0 to 1.
    pub certainty: Option<f64>,
    /// All of it was drawn, or it is more likely right than wrong.
    pub is_likely: bool,
}

/// Shows the photograph with the strokes of the trees that are `begun`, and lets the user draw until he
/// accepts what is found: the strokes of all trees then. `None` where he leaves without, `stop` is set or
/// the terminal has gone. The terminal is then as it was.
///
/// # Errors
/// There is no terminal, or it cannot be prepared.
pub fn draw_on_photo(
    session: &mut dyn PhotoSession,
    begun: Vec<TreeStrokes>,
    options: Options,
    stop: &AtomicBool,
) -> Result<Option<Vec<TreeStrokes>>, TuiError> {
    let Opened {
        mut terminal,
        mut guard,
        tty,
        graphics,
        deaf_until,
    } = Opened::new(options)?;
    let theme = Theme::new(options.depth);
    let mut picture = Preview::new(graphics);
    let mut sheet = Sheet::new(session, begun);
    while !stop.load(Ordering::SeqCst) {
        let began = Instant::now();
        sheet.state.tick();
        {
            let Some(_lock) = guard.writing() else { break };
            let drawn = terminal.draw(|frame| sheet.render(frame, theme, &mut picture));
            if drawn.is_err() {
                break;
            }
        }
        picture.drawn(began, Instant::now());
        sheet.look(session);
        match tty.wait(TICK.saturating_sub(began.elapsed())) {
            Input::Gone => break,
            Input::Quiet => continue,
            Input::Ready => {}
        }
        let mut heard = 0;
        while event::poll(Duration::ZERO).unwrap_or(false) {
            let Ok(event) = event::read() else {
                return Ok(None);
            };
            heard += 1;
            if Instant::now() < deaf_until {
                continue;
            }
            match sheet.handle(&event, picture.placed.as_ref()) {
                Next::Stay => {}
                Next::Look => sheet.look(session),
                Next::Save => sheet.save(session),
                Next::Accept => return Ok(Some(sheet.accepted())),
                Next::Quit => return Ok(None),
            }
        }
        // As in `run`: without a pause this would be a busy loop.
        if heard == 0 {
            std::thread::sleep(TICK / 5);
        }
        if guard.set_mouse(sheet.state.drawing.is_some()).is_err() {
            break;
        }
    }
    Ok(None)
}
