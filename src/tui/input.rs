//! Keys and mouse: what is bound to what, as tables, and what it does.

use super::drawing::Drawing;
use super::placed::Placed;
use super::state::State;
use crate::model::Control;
use ratatui::crossterm::event::{
    Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEventKind,
};

/// What a key does while the capture is watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    Help,
    Pause,
    Outline,
    Build,
    Restart,
    Export,
    Quit,
    /// To the left or to the right.
    Turn(i8),
    Mesh,
    /// The branch so many rows farther down.
    Choose(i8),
    /// Looks away from the chosen branch.
    Camera,
}

/// What a key does while an outline is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stroke {
    Close,
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
pub const WATCHING: [Binding<Action>; 17] = [
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
        Action::Outline,
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
    bind(KeyCode::Char('l'), "", "", "", Action::Turn(1)),
    bind(KeyCode::Char('k'), "", "", "", Action::Choose(-1)),
    bind(KeyCode::Left, "", "", "", Action::Turn(-1)),
    bind(KeyCode::Right, "", "", "", Action::Turn(1)),
    bind(KeyCode::Down, "", "", "", Action::Choose(1)),
    bind(KeyCode::Up, "", "", "", Action::Choose(-1)),
    bind(KeyCode::Esc, "", "", "", Action::Camera),
];

/// Keys while drawing; those without a short name are in the help only.
pub const DRAWING: [Binding<Stroke>; 12] = [
    bind(
        KeyCode::Enter,
        "Enter",
        "close",
        "closes the outline and starts with it",
        Stroke::Close,
    ),
    bind(
        KeyCode::Backspace,
        "Bksp",
        "back",
        "takes the last point back",
        Stroke::TakeBack,
    ),
    bind(
        KeyCode::Esc,
        "Esc",
        "leave",
        "leaves everything as it was",
        Stroke::Leave,
    ),
    bind(
        KeyCode::Char(' '),
        "space",
        "set",
        "sets a point at the cross",
        Stroke::Set,
    ),
    bind(
        KeyCode::Left,
        "arrows",
        "move",
        "move the cross by a cell; H J K L by eight",
        Stroke::Move(-1, 0),
    ),
    bind(KeyCode::Right, "", "", "", Stroke::Move(1, 0)),
    bind(KeyCode::Up, "", "", "", Stroke::Move(0, -1)),
    bind(KeyCode::Down, "", "", "", Stroke::Move(0, 1)),
    bind(KeyCode::Char('H'), "", "", "", Stroke::Move(-8, 0)),
    bind(KeyCode::Char('L'), "", "", "", Stroke::Move(8, 0)),
    bind(KeyCode::Char('K'), "", "", "", Stroke::Move(0, -8)),
    bind(KeyCode::Char('J'), "", "", "", Stroke::Move(0, 8)),
];

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
            act(Action::Quit, state)
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
    // A slip must not end or restart the capture of someone who is setting points.
    let ends_it = matches!(
        bound.action,
        Action::Quit | Action::Build | Action::Restart | Action::Export
    );
    if state.drawing.is_some() && ends_it {
        let key = bound.shown;
        state.say(format!(
            "{key} waits: the outline is being drawn; Enter closes it, Esc leaves it (Ctrl-C ends)."
        ));
        return None;
    }
    act(bound.action, state)
}

fn act(action: Action, state: &mut State) -> Option<Control> {
    let looks = matches!(
        action,
        Action::Help | Action::Turn(_) | Action::Mesh | Action::Choose(_) | Action::Camera
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
        Action::Outline => {
            begin_drawing(state);
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

fn begin_drawing(state: &mut State) {
    if state.snapshot.preview.is_none() {
        state.say("There is no picture yet to draw on.");
        return;
    }
    state.help = false;
    state.drawing.get_or_insert_with(Drawing::default);
}

fn click(column: u16, row: u16, state: &mut State, placed: Option<&Placed>) {
    let pixel = placed.and_then(|p| p.pixel_at(column, row));
    match (&mut state.drawing, pixel) {
        (Some(drawing), Some(pixel)) => drawing.add(pixel),
        _ => state.say("That is outside the picture."),
    }
}

fn draw(
    stroke: Stroke,
    mut drawing: Drawing,
    state: &mut State,
    placed: Option<&Placed>,
) -> Option<Control> {
    match stroke {
        Stroke::Leave => {
            state.say("Left drawing; the outline is as it was.");
            return None;
        }
        Stroke::Close => match drawing.close() {
            Ok(polygon) => {
                state.say(format!(
                    "Starting with your outline of {} points.",
                    polygon.len()
                ));
                return Some(Control::SetOutline(polygon));
            }
            Err(why) => state.say(why),
        },
        Stroke::TakeBack => {
            if !drawing.take_back() {
                state.say("No point is left to take back; Esc leaves.");
            }
        }
        Stroke::Set => match drawing.cursor_px() {
            Some(pixel) => drawing.add(pixel),
            None => move_cursor(&mut drawing, placed, 0, 0),
        },
        Stroke::Move(right, down) => move_cursor(&mut drawing, placed, right, down),
    }
    state.drawing = Some(drawing);
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
