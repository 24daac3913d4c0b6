//! The screen of a tree that is made to move: the tree from two sides, what moves it, and the keys
//! that change that.

use super::input::{Binding, bind, draws};
use super::opened::Opened;
use super::panels::{messages, skeleton};
use super::state::State;
use super::theme::Theme;
use super::tty::Input;
use super::{Options, TICK, TuiError};
use crate::model::{Pose, Skeleton, Snapshot};
use ratatui::Frame;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::text::Line;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// However long a redraw took: the tree goes on where it was.
const LONGEST_S: f64 = 0.2;

/// The answer to keys that draw on a picture.
const NO_PICTURE: &str = "There is no picture here to draw on: draw in capture or replay.";

/// What moves a tree while it is watched.
pub trait Moving {
    fn skeleton(&self) -> Arc<Skeleton>;
    /// The pose after so many more seconds.
    fn pose(&mut self, elapsed_s: f64) -> Pose;
    fn change(&mut self, command: AnimationCommand);
    /// What moves it now, in one line.
    fn description(&self) -> String;
}

/// What the user wants of the tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AnimationCommand {
    /// Wind stronger by so much on the Beaufort scale.
    Stronger(i8),
    /// Wind from another side, by so many degrees.
    Veer(i16),
    /// Motion larger by so many steps.
    Larger(i8),
    /// Pulls at the rope, or releases it.
    Pull,
}

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Action {
    Quit,
    Pause,
    Change(AnimationCommand),
    /// Walks round the tree.
    Turn(i8),
    Mesh,
}

pub(super) const KEYS: [Binding<Action>; 12] = [
    bind(KeyCode::Char('q'), "q", "quit", "", Action::Quit),
    bind(
        KeyCode::Up,
        "↑↓",
        "wind",
        "",
        Action::Change(AnimationCommand::Stronger(1)),
    ),
    bind(
        KeyCode::Right,
        "←→",
        "direction",
        "",
        Action::Change(AnimationCommand::Veer(15)),
    ),
    bind(
        KeyCode::Char('+'),
        "+-",
        "magnify",
        "",
        Action::Change(AnimationCommand::Larger(1)),
    ),
    bind(
        KeyCode::Char('p'),
        "p",
        "pull/release",
        "",
        Action::Change(AnimationCommand::Pull),
    ),
    bind(KeyCode::Char(' '), "space", "pause", "", Action::Pause),
    bind(KeyCode::Char('h'), "h l", "turn", "", Action::Turn(-1)),
    bind(KeyCode::Char('m'), "m", "mesh", "", Action::Mesh),
    bind(
        KeyCode::Down,
        "",
        "",
        "",
        Action::Change(AnimationCommand::Stronger(-1)),
    ),
    bind(
        KeyCode::Left,
        "",
        "",
        "",
        Action::Change(AnimationCommand::Veer(-15)),
    ),
    bind(
        KeyCode::Char('-'),
        "",
        "",
        "",
        Action::Change(AnimationCommand::Larger(-1)),
    ),
    bind(KeyCode::Char('l'), "", "", "", Action::Turn(1)),
];

/// The tree on the screen.
pub(super) struct Stage {
    pub state: State,
    pub paused: bool,
    still: Snapshot,
}

impl Stage {
    pub fn new(moving: &dyn Moving) -> Self {
        let mut still = Snapshot::default();
        still.show_tree(moving.skeleton());
        Self {
            state: State::default(),
            paused: false,
            still,
        }
    }

    /// Lets time pass for the tree, unless it is paused.
    pub fn go_on(&mut self, moving: &mut dyn Moving, elapsed_s: f64) {
        self.state.tick();
        let pose = moving.pose(if self.paused { 0.0 } else { elapsed_s });
        self.state.take(Arc::new(Snapshot {
            pose: Some(Arc::new(pose)),
            ..self.still.clone()
        }));
    }

    /// Does what a key asks for; `false` to leave.
    pub fn press(&mut self, event: &Event, moving: &mut dyn Moving) -> bool {
        let Event::Key(key) = event else { return true };
        if key.kind == KeyEventKind::Release || key.modifiers.contains(KeyModifiers::ALT) {
            return true;
        }
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return key.code != KeyCode::Char('c');
        }
        match KEYS.iter().find(|b| b.key == key.code).map(|b| b.action) {
            Some(Action::Quit) => return false,
            Some(Action::Pause) => self.paused = !self.paused,
            Some(Action::Change(command)) => moving.change(command),
            Some(Action::Turn(steps)) => self.state.turn(steps.into()),
            Some(Action::Mesh) => self.state.switch_mesh(),
            None if draws(key.code) => self.state.say(NO_PICTURE),
            None => {}
        }
        true
    }

    pub fn render(&self, frame: &mut Frame, description: &str, theme: Theme) {
        let [line, tree, keys] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Fill(1),
            Constraint::Length(1),
        ])
        .areas(frame.area());
        let paused = if self.paused { "  paused" } else { "" };
        frame.render_widget(
            Line::styled(format!(" arborcam  {description}{paused}"), theme.strong()),
            line,
        );
        skeleton::render(frame, &self.state, tree, theme);
        if self.state.messages().next().is_some() {
            messages::render(frame, &self.state, keys, theme);
            return;
        }
        messages::key_line(frame, KEYS.iter().map(|b| (b.shown, b.short)), keys, theme);
    }
}

/// Shows the tree and does what keys ask for until the user leaves, `stop` is set or the terminal
/// has gone. The terminal is then as it was.
///
/// # Errors
/// There is no terminal, or it cannot be prepared.
pub fn watch(moving: &mut dyn Moving, options: Options, stop: &AtomicBool) -> Result<(), TuiError> {
    let Opened {
        mut terminal,
        guard,
        tty,
        deaf_until,
        ..
    } = Opened::new(options)?;
    let theme = Theme::new(options.depth);
    let mut stage = Stage::new(moving);
    let mut before = Instant::now();
    while !stop.load(Ordering::SeqCst) {
        let began = Instant::now();
        stage.go_on(moving, (began - before).as_secs_f64().min(LONGEST_S));
        before = began;
        {
            let Some(_lock) = guard.writing() else { break };
            if terminal
                .draw(|frame| stage.render(frame, &moving.description(), theme))
                .is_err()
            {
                break;
            }
        }
        let mut heard = 0;
        match tty.wait(TICK.saturating_sub(began.elapsed())) {
            Input::Gone => break,
            Input::Quiet => continue,
            Input::Ready => {}
        }
        while event::poll(Duration::ZERO).unwrap_or(false) {
            let Ok(event) = event::read() else {
                return Ok(());
            };
            heard += 1;
            if Instant::now() >= deaf_until && !stage.press(&event, moving) {
                return Ok(());
            }
        }
        // As in `run`: without a pause this would be a busy loop.
        if heard == 0 {
            std::thread::sleep(TICK / 5);
        }
    }
    Ok(())
}
