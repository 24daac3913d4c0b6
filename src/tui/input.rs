//! Keys and mouse: what is bound to what, as tables, and what it does.

use super::drawing::{Drawing, Subject};
use super::placed::Placed;
use super::state::State;
use super::wood;
use crate::model::Control;
use nalgebra::Point2;
use ratatui::crossterm::event::{
    Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEventKind,
};

/// What a key does while the capture is watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    Help,
    Pause,
    Draw(Subject),
    Build,
    Restart,
    Export,
    Quit,
    /// To the left or to the right.
    Turn(i8),
    Mesh,
    /// The wood that was found, in the picture.
    Wood,
    /// The branch so many rows farther down.
    Choose(i8),
    /// Looks away from the chosen branch.
    Camera,
}

/// What a key does while the user draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrawingAction {
    Finish,
    TakeBack,
    Leave,
    Set,
    /// One cell, or eight, to the right and down.
    Move(i8, i8),
}

/// One key: how it is pressed, written, called for short and explained.
#[derive(Clone, Copy, Debug)]
pub struct Binding<A> {
    pub key: KeyCode,
    pub shown: &'static str,
    pub short: &'static str,
    pub help: &'static str,
    pub action: A,
}

pub const fn bind<A>(
    key: KeyCode,
    shown: &'static str,
    short: &'static str,
    help: &'static str,
    action: A,
) -> Binding<A> {
    Binding {
        key,
        shown,
        short,
        help,
        action,
    }
}

/// Keys while watching; those without a short name repeat what another one does.
pub const WATCHING: [Binding<Action>; 21] = [
    bind(
        KeyCode::Char('?'),
        "?",
        "help",
        "shows and hides this help",
        Action::Help,
    ),
    bind(
        KeyCode::Char('q'),
        "q",
        "quit",
        "ends the capture and writes it (Ctrl-C too)",
        Action::Quit,
    ),
    bind(
        KeyCode::Char(' '),
        "space",
        "pause",
        "stops taking frames, or goes on",
        Action::Pause,
    ),
    bind(
        KeyCode::Char('o'),
        "o",
        "outline",
        "draws the tree's outline by mouse or keyboard",
        Action::Draw(Subject::Outline),
    ),
    bind(
        KeyCode::Char('b'),
        "b",
        "build",
        "builds the tree now, from the motion seen so far",
        Action::Build,
    ),
    bind(
        KeyCode::Char('r'),
        "r",
        "restart",
        "forgets points and tree, starts again",
        Action::Restart,
    ),
    bind(
        KeyCode::Char('e'),
        "e",
        "export",
        "writes the capture as it is now, goes on",
        Action::Export,
    ),
    bind(
        KeyCode::Char('j'),
        "j k",
        "branch",
        "choose a branch (arrows too); Esc leaves it",
        Action::Choose(1),
    ),
    bind(
        KeyCode::Char('h'),
        "h l",
        "turn",
        "turn the tree (arrows too); m shows its wood, or lines again",
        Action::Turn(-1),
    ),
    bind(KeyCode::Char('m'), "m", "mesh", "", Action::Mesh),
    bind(
        KeyCode::Char('s'),
        "s",
        "stroke",
        "draws a line along a branch; w shows the wood that was found",
        Action::Draw(Subject::Branch),
    ),
    bind(KeyCode::Char('w'), "w", "wood", "", Action::Wood),
    bind(
        KeyCode::Char('c'),
        "c",
        "colour",
        "picks coloured markers to follow; p says which hang on which",
        Action::Draw(Subject::Markers),
    ),
    bind(
        KeyCode::Char('p'),
        "p",
        "parents",
        "",
        Action::Draw(Subject::MarkerOrder),
    ),
    bind(KeyCode::Char('l'), "", "", "", Action::Turn(1)),
    bind(KeyCode::Char('k'), "", "", "", Action::Choose(-1)),
    bind(KeyCode::Left, "", "", "", Action::Turn(-1)),
    bind(KeyCode::Right, "", "", "", Action::Turn(1)),
    bind(KeyCode::Down, "", "", "", Action::Choose(1)),
    bind(KeyCode::Up, "", "", "", Action::Choose(-1)),
    bind(KeyCode::Esc, "", "", "", Action::Camera),
];

/// Keys while drawing; those without a short name are in the help only.
pub const DRAWING: [Binding<DrawingAction>; 12] = [
    bind(
        KeyCode::Enter,
        "Enter",
        "done",
        "closes the outline and starts with it, or takes the line",
        DrawingAction::Finish,
    ),
    bind(
        KeyCode::Backspace,
        "Bksp",
        "back",
        "takes the last point back, or the last line along a branch",
        DrawingAction::TakeBack,
    ),
    bind(
        KeyCode::Esc,
        "Esc",
        "leave",
        "leaves everything as it was",
        DrawingAction::Leave,
    ),
    bind(
        KeyCode::Char(' '),
        "space",
        "set",
        "sets a point at the cross",
        DrawingAction::Set,
    ),
    bind(
        KeyCode::Left,
        "arrows",
        "move",
        "move the cross by a cell; H J K L by eight",
        DrawingAction::Move(-1, 0),
    ),
    bind(KeyCode::Right, "", "", "", DrawingAction::Move(1, 0)),
    bind(KeyCode::Up, "", "", "", DrawingAction::Move(0, -1)),
    bind(KeyCode::Down, "", "", "", DrawingAction::Move(0, 1)),
    bind(KeyCode::Char('H'), "", "", "", DrawingAction::Move(-8, 0)),
    bind(KeyCode::Char('L'), "", "", "", DrawingAction::Move(8, 0)),
    bind(KeyCode::Char('K'), "", "", "", DrawingAction::Move(0, -8)),
    bind(KeyCode::Char('J'), "", "", "", DrawingAction::Move(0, 8)),
];

/// Whether a key begins a drawing while the capture is watched.
pub fn draws(key: KeyCode) -> bool {
    WATCHING
        .iter()
        .any(|b| b.key == key && matches!(b.action, Action::Draw(_)))
}

/// Takes one event; `placed` is where the preview lies on the screen. Returns what the capture is
/// to do.
pub fn handle(event: &Event, state: &mut State, placed: Option<&Placed>) -> Option<Control> {
    match event {
        Event::Key(key) if key.kind != KeyEventKind::Release => press(key, state, placed),
        Event::Mouse(mouse) if mouse.kind == MouseEventKind::Down(MouseButton::Left) => {
            if state.drawing.is_some() && !state.help {
                click(mouse.column, mouse.row, state, placed);
            }
            None
        }
        _ => None,
    }
}

fn press(key: &KeyEvent, state: &mut State, placed: Option<&Placed>) -> Option<Control> {
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return if key.code == KeyCode::Char('c') {
            act(Action::Quit, state, placed)
        } else {
            None
        };
    }
    if key.modifiers.contains(KeyModifiers::ALT) {
        return None;
    }
    if state.help && matches!(key.code, KeyCode::Esc | KeyCode::Enter) {
        state.help = false;
        return None;
    }
    if let Some(drawing) = state.drawing.take() {
        if let Some(bound) = DRAWING.iter().find(|b| b.key == key.code) {
            return draw(bound.action, drawing, state, placed);
        }
        state.drawing = Some(drawing);
    }
    let bound = WATCHING.iter().find(|b| b.key == key.code)?;
    if let Some(subject) = state.drawing.as_ref().map(Drawing::subject)
        && waits(bound.action, subject)
    {
        let (key, name) = (bound.shown, subject.name());
        state.say(format!(
            "{key} waits: {name} is being drawn; Enter takes it, Esc leaves it (Ctrl-C ends)."
        ));
        return None;
    }
    act(bound.action, state, placed)
}

/// Whether an action waits until `subject` is drawn: a slip must not end or restart the capture of
/// someone who is setting points, nor lose the points.
fn waits(action: Action, subject: Subject) -> bool {
    match action {
        Action::Quit | Action::Build | Action::Restart | Action::Export => true,
        Action::Draw(other) => other != subject,
        _ => false,
    }
}

fn act(action: Action, state: &mut State, placed: Option<&Placed>) -> Option<Control> {
    let looks = matches!(
        action,
        Action::Help
            | Action::Turn(_)
            | Action::Mesh
            | Action::Wood
            | Action::Choose(_)
            | Action::Camera
    );
    if state.quitting && !looks {
        state.say("Still writing the capture…");
        return None;
    }
    let (notice, control) = match action {
        Action::Help => {
            state.help = !state.help;
            return None;
        }
        Action::Draw(subject) if state.snapshot.preview.is_none() => {
            let name = subject.name();
            state.say(format!(
                "There is no picture yet on which {name} could be drawn."
            ));
            return None;
        }
        Action::Draw(subject) => {
            match subject {
                Subject::Outline | Subject::Markers | Subject::MarkerOrder => state.unsay(),
                Subject::Branch => state.say(wood::told(&state.snapshot)),
            }
            begin_drawing(subject, state, placed);
            return None;
        }
        Action::Turn(steps) => {
            state.turn(steps.into());
            return None;
        }
        Action::Mesh => {
            state.switch_mesh();
            return None;
        }
        Action::Wood => {
            state.wood = !state.wood;
            match state.wood {
                true => state.say(wood::told(&state.snapshot)),
                false => state.unsay(),
            }
            return None;
        }
        Action::Choose(rows) => {
            state.choose(rows.into());
            return None;
        }
        Action::Camera => {
            state.close_up = false;
            return None;
        }
        Action::Pause => {
            state.paused = !state.paused;
            return Some(Control::Pause(state.paused));
        }
        Action::Quit => {
            state.quitting = true;
            state.drawing = None;
            ("Ending; writing the capture…", Control::Quit)
        }
        Action::Build => ("Asked to build the tree now.", Control::BuildNow),
        Action::Restart => ("Asked to start again.", Control::Restart),
        Action::Export => ("Asked for an export.", Control::Export),
    };
    state.say(notice);
    Some(control)
}

/// Goes on with what is being drawn, or begins to draw `subject`, with the cross in the middle of the picture.
pub(super) fn begin_drawing(subject: Subject, state: &mut State, placed: Option<&Placed>) {
    state.help = false;
    if state.drawing.is_none() {
        let mut drawing = Drawing::of(subject);
        move_cursor(&mut drawing, placed, 0, 0);
        state.drawing = Some(drawing);
    }
}

pub(super) fn click(column: u16, row: u16, state: &mut State, placed: Option<&Placed>) {
    let pixel = placed.and_then(|p| p.pixel_at(column, row));
    match (&mut state.drawing, pixel) {
        (Some(drawing), Some(pixel)) => {
            drawing.add(pixel);
            state.unsay();
        }
        _ => state.say("That is outside the picture."),
    }
}

/// Does what a key asks for while something is drawn; what is made of it once it is finished.
pub(super) fn draw(
    action: DrawingAction,
    mut drawing: Drawing,
    state: &mut State,
    placed: Option<&Placed>,
) -> Option<Control> {
    match action {
        DrawingAction::Leave => {
            state.say("Left drawing; everything is as it was.");
            return None;
        }
        DrawingAction::Finish => match drawing.finish() {
            Ok(points_px) => return Some(use_drawn(drawing.subject(), points_px, state)),
            Err(why) => state.say(why),
        },
        DrawingAction::TakeBack => {
            let subject = drawing.subject();
            let had_point = drawing.take_back();
            state.drawing = Some(drawing);
            return if had_point {
                None
            } else {
                take_back_line(subject, state)
            };
        }
        DrawingAction::Set => match drawing.cursor_px() {
            Some(pixel) => {
                drawing.add(pixel);
                state.unsay();
            }
            None => move_cursor(&mut drawing, placed, 0, 0),
        },
        DrawingAction::Move(right, down) => move_cursor(&mut drawing, placed, right, down),
    }
    state.drawing = Some(drawing);
    None
}

/// What is made of a finished drawing.
fn use_drawn(subject: Subject, points_px: Vec<Point2<f64>>, state: &mut State) -> Control {
    let n = points_px.len();
    match subject {
        Subject::Outline => {
            state.say(format!("Starting with your outline of {n} points."));
            Control::SetOutline(points_px)
        }
        Subject::Branch => {
            state.say(format!("Asked to look for wood along your {n} points."));
            Control::AddStroke(points_px)
        }
        Subject::Markers => {
            state.say(format!("Asked to follow {n} more markers."));
            Control::PickMarkers(points_px)
        }
        Subject::MarkerOrder => {
            state.say(format!("Asked to hang {n} markers on each other."));
            Control::HangMarkers(points_px)
        }
    }
}

/// Where no point is left in a line along a branch, the line before it goes.
fn take_back_line(subject: Subject, state: &mut State) -> Option<Control> {
    if subject == Subject::Branch && !state.snapshot.strokes_px.is_empty() {
        state.say("Asked to take the last line back.");
        return Some(Control::TakeBackStroke);
    }
    state.say("No point is left to take back; Esc leaves.");
    None
}

/// The cross goes from cell to cell, so that it reaches exactly the pixels that a click reaches.
fn move_cursor(drawing: &mut Drawing, placed: Option<&Placed>, right: i8, down: i8) {
    let Some(placed) = placed else { return };
    let area = placed.area;
    let (column, row) = drawing
        .cursor_px()
        .and_then(|pixel| placed.cell_from_pixel(pixel))
        .map(|(c, r)| {
            (
                c.saturating_add_signed(right.into()),
                r.saturating_add_signed(down.into()),
            )
        })
        .unwrap_or((area.x + area.width / 2, area.y + area.height / 2));
    let column = column.clamp(area.left(), area.right().saturating_sub(1));
    let row = row.clamp(area.top(), area.bottom().saturating_sub(1));
    if let Some(pixel) = placed.pixel_at(column, row) {
        drawing.set_cursor(pixel);
    }
}
