//! What is drawn on a photograph and found along it, and what keys and mouse change of it.

use super::{FoundTree, PhotoSession};
use crate::model::{Control, Rgb, TreeStrokes};
use crate::tui::drawing::Subject;
use crate::tui::input::{Binding, DRAWING, begin_drawing, bind, click, draw};
use crate::tui::placed::Placed;
use crate::tui::state::State;
use nalgebra::Point2;
use ratatui::crossterm::event::{
    Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEventKind,
};
use std::sync::Arc;
use std::time::Instant;

/// Strokes that can be undone, at most: each keeps what was found with it, some 10 MB.
const MOST_UNDONE: usize = 20;

/// What a key does while nothing is being drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::tui) enum Action {
    Help,
    Accept,
    Draw(Subject),
    Undo,
    NextTree,
    Found,
    Save,
    Leave,
    Quit,
}

pub(in crate::tui) const KEYS: [Binding<Action>; 10] = [
    bind(
        KeyCode::Char('c'),
        "c",
        "crown",
        "draws a closed line round the crown",
        Action::Draw(Subject::Outline),
    ),
    bind(
        KeyCode::Char('b'),
        "b",
        "branch",
        "draws a branch from base to tip, the trunk first",
        Action::Draw(Subject::Branch),
    ),
    bind(
        KeyCode::Char('u'),
        "u",
        "undo",
        "takes the last change back",
        Action::Undo,
    ),
    bind(
        KeyCode::Char('n'),
        "n",
        "next tree",
        "goes on to another tree in the same picture",
        Action::NextTree,
    ),
    bind(
        KeyCode::Char('w'),
        "w",
        "found",
        "shows or hides what was found",
        Action::Found,
    ),
    bind(
        KeyCode::Char('s'),
        "s",
        "save",
        "saves the strokes as files",
        Action::Save,
    ),
    bind(
        KeyCode::Enter,
        "Enter",
        "accept",
        "saves the strokes and makes the tree",
        Action::Accept,
    ),
    bind(KeyCode::Esc, "Esc", "", "", Action::Leave),
    bind(
        KeyCode::Char('q'),
        "q",
        "quit",
        "leaves; nothing is written (Ctrl-C too)",
        Action::Quit,
    ),
    bind(
        KeyCode::Char('?'),
        "?",
        "help",
        "shows and hides this help",
        Action::Help,
    ),
];

/// What the screen goes on with after an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::tui) enum Next {
    Stay,
    /// What is drawn has changed: look anew.
    Look,
    /// Keep the strokes as files.
    Save,
    Accept,
    Quit,
}

/// A tree with its strokes, and what was found along them.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub strokes: TreeStrokes,
    pub found: Option<Arc<Result<FoundTree, String>>>,
}

impl Tree {
    fn of(strokes: TreeStrokes) -> Self {
        Self {
            strokes,
            found: None,
        }
    }
}

/// The picture with all that is drawn on it.
pub(in crate::tui) struct Sheet {
    pub state: State,
    pub(super) name: String,
    pub(super) picture: Arc<Rgb>,
    /// The last is the one that is drawn on; one at least.
    pub(super) trees: Vec<Tree>,
    /// The trees as they were before each change, the last change last.
    before: Vec<Vec<Tree>>,
    pub(super) looking: Option<Looking>,
    /// The user was warned that what is found is more likely wrong, and accepts it with the next key.
    is_warned: bool,
}

/// The tree that is looked at, and since when.
#[derive(Clone, Copy, Debug)]
pub(super) struct Looking {
    pub tree: usize,
    pub began: Instant,
}

impl Sheet {
    /// `begun` are the strokes of trees that are there already.
    pub fn new(session: &dyn PhotoSession, begun: Vec<TreeStrokes>) -> Self {
        let mut trees: Vec<Tree> = begun.into_iter().map(Tree::of).collect();
        if trees.is_empty() {
            trees.push(Tree::of(TreeStrokes::default()));
        }
        let mut sheet = Self {
            state: State::default(),
            name: session.name().to_owned(),
            picture: session.picture(),
            before: steps_to(&trees),
            trees,
            looking: None,
            is_warned: false,
        };
        sheet.state.wood = true;
        sheet.show();
        sheet
    }

    /// Begins to look at a tree of which nothing is known yet, or shows what was found meanwhile.
    pub fn look(&mut self, session: &mut dyn PhotoSession) {
        if let Some(Looking { tree, began }) = self.looking {
            let Some(found) = session.found() else {
                return;
            };
            self.looking = None;
            if let Some(tree) = self.trees.get_mut(tree) {
                tree.found = Some(Arc::new(found));
            }
            if !self.is_stale() {
                let told = self.told();
                let took_s = began.elapsed().as_secs_f64();
                self.state.say(format!("{told} ({took_s:.2} s)"));
            }
            self.show();
        }
        if let Some(tree) = self.trees.iter().position(|tree| tree.found.is_none()) {
            session.look(&self.trees[tree].strokes);
            self.state.unsay();
            self.looking = Some(Looking {
                tree,
                began: Instant::now(),
            });
        }
    }

    /// Whether a tree is still to be looked at.
    fn is_stale(&self) -> bool {
        self.trees.iter().any(|tree| tree.found.is_none())
    }

    /// Keeps the strokes of all trees as files.
    pub fn save(&mut self, session: &mut dyn PhotoSession) {
        let trees = self.trees.iter().map(|tree| tree.strokes.clone());
        let trees: Vec<TreeStrokes> = trees.collect();
        self.state.say(match session.keep(&trees) {
            Ok(files) => format!("Strokes saved: {files}"),
            Err(why) => format!("No strokes saved: {why}"),
        });
    }

    /// The strokes of all trees.
    pub fn accepted(self) -> Vec<TreeStrokes> {
        let trees = self.trees.into_iter().map(|tree| tree.strokes);
        let mut trees: Vec<TreeStrokes> = trees.collect();
        // A further tree that was begun, and of which nothing was drawn.
        if trees.len() > 1 {
            trees.retain(|strokes| !strokes.is_empty());
        }
        trees
    }

    /// Does what an event asks for; `placed` is where the picture lies on the screen.
    pub fn handle(&mut self, event: &Event, placed: Option<&Placed>) -> Next {
        match event {
            Event::Key(key) if key.kind != KeyEventKind::Release => self.press(key, placed),
            Event::Mouse(mouse) if mouse.kind == MouseEventKind::Down(MouseButton::Left) => {
                if self.state.drawing.is_some() && !self.state.help {
                    click(mouse.column, mouse.row, &mut self.state, placed);
                }
                Next::Stay
            }
            _ => Next::Stay,
        }
    }

    fn press(&mut self, key: &KeyEvent, placed: Option<&Placed>) -> Next {
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return match key.code == KeyCode::Char('c') {
                true => Next::Quit,
                false => Next::Stay,
            };
        }
        if key.modifiers.contains(KeyModifiers::ALT) {
            return Next::Stay;
        }
        if self.state.help && matches!(key.code, KeyCode::Esc | KeyCode::Enter) {
            self.state.help = false;
            return Next::Stay;
        }
        let bound = KEYS.iter().find(|b| b.key == key.code);
        if bound.is_some_and(|b| b.action == Action::Help) {
            self.state.help = !self.state.help;
            return Next::Stay;
        }
        let was_warned = std::mem::take(&mut self.is_warned);
        if let Some(drawing) = self.state.drawing.take() {
            let Some(bound) = DRAWING.iter().find(|b| b.key == key.code) else {
                self.state.drawing = Some(drawing);
                if let Some(Binding { shown, .. }) = bound {
                    self.state.say(format!(
                        "Enter ends the line that is drawn, Esc leaves it; then {shown} works again."
                    ));
                }
                return Next::Stay;
            };
            return match draw(bound.action, drawing, &mut self.state, placed) {
                Some(Control::SetOutline(corners_px)) => self.change(Change::Crown(corners_px)),
                Some(Control::AddStroke(line_px)) => self.change(Change::Branch(line_px)),
                Some(Control::TakeBackStroke) => self.undo(),
                _ => Next::Stay,
            };
        }
        match bound.map(|b| b.action) {
            Some(Action::Draw(subject)) => {
                self.state.unsay();
                begin_drawing(subject, &mut self.state, placed);
                Next::Stay
            }
            Some(Action::Undo) => self.undo(),
            Some(Action::NextTree) => self.next_tree(),
            Some(Action::Found) => {
                self.state.wood = !self.state.wood;
                self.show();
                Next::Stay
            }
            Some(Action::Save) => Next::Save,
            Some(Action::Leave) => {
                self.state
                    .say("No line is drawn that Esc could leave; q quits.");
                Next::Stay
            }
            Some(Action::Accept) => self.accept(was_warned),
            Some(Action::Quit) => Next::Quit,
            Some(Action::Help) | None => Next::Stay,
        }
    }

    fn change(&mut self, change: Change) -> Next {
        self.keep();
        if let Some(tree) = self.trees.last_mut() {
            match change {
                Change::Crown(corners_px) => tree.strokes.crown_px = corners_px,
                Change::Branch(line_px) => tree.strokes.branches_px.push(line_px),
            }
            tree.found = None;
        }
        self.looking = None;
        self.show();
        Next::Look
    }

    /// Remembers the trees as they are before a change.
    fn keep(&mut self) {
        self.before.push(self.trees.clone());
        if self.before.len() > MOST_UNDONE {
            self.before.remove(0);
        }
    }

    fn undo(&mut self) -> Next {
        let Some(before) = self.before.pop() else {
            self.state.say("There is nothing to undo.");
            return Next::Stay;
        };
        self.trees = before;
        self.looking = None;
        self.show();
        if self.is_stale() {
            return Next::Look;
        }
        let told = self.told();
        self.state.say(format!("Undone. {told}"));
        Next::Stay
    }

    fn next_tree(&mut self) -> Next {
        if self.trees.iter().any(|tree| !is_whole(&tree.strokes)) {
            self.state
                .say("Draw crown (c) and trunk (b) of this tree before the next.");
            return Next::Stay;
        }
        self.keep();
        let mut next = Tree::of(TreeStrokes::default());
        next.found = Some(Arc::new(Err("draw its crown (c) and its trunk (b)".into())));
        self.trees.push(next);
        self.show();
        let number = self.trees.len();
        self.state.say(format!(
            "Tree {number}: draw its crown (c) and its trunk (b)."
        ));
        Next::Stay
    }

    fn accept(&mut self, was_warned: bool) -> Next {
        for (number, tree) in (1..).zip(&self.trees) {
            if self.trees.len() > 1 && tree.strokes.is_empty() {
                continue;
            }
            let why = match tree.found.as_deref() {
                Some(Ok(found)) if found.is_likely || was_warned => continue,
                Some(Ok(_)) => {
                    self.is_warned = true;
                    "what is found is more likely wrong than right; Enter once more makes the tree all the same"
                }
                Some(Err(why)) => why.as_str(),
                None => "it is still looked at",
            };
            let of_tree = if self.trees.len() > 1 {
                format!("tree {number}: ")
            } else {
                String::new()
            };
            self.state.say(format!("Not yet: {of_tree}{why}"));
            return Next::Stay;
        }
        Next::Accept
    }

    /// What is found of the tree that is drawn on, in one line.
    pub(super) fn told(&self) -> String {
        let Some(found) = self.trees.last().and_then(|tree| tree.found.as_deref()) else {
            return "Looking…".to_owned();
        };
        match found {
            Ok(found) => {
                let look = if found.in_leaf { "in leaf" } else { "bare" };
                let tips = found.wood.branches.tips();
                let sure = found.certainty.map_or(String::new(), |certainty| {
                    let percent = 100.0 * certainty;
                    format!("; found without strokes, right with a chance of {percent:.0} %")
                });
                let times = if found.is_likely { "" } else { " twice" };
                format!("Enter{times} accepts: {look}, wood with {tips} tips{sure}.")
            }
            Err(why) => why.clone(),
        }
    }
}

/// How trees that are there already were drawn, stroke by stroke of the last one, so that these can be taken
/// back as well.
fn steps_to(trees: &[Tree]) -> Vec<Vec<Tree>> {
    let mut steps = Vec::new();
    let Some((last, others)) = trees.split_last() else {
        return steps;
    };
    let mut strokes = last.strokes.clone();
    while strokes.branches_px.pop().is_some() || !std::mem::take(&mut strokes.crown_px).is_empty() {
        let mut step = others.to_vec();
        step.push(Tree::of(strokes.clone()));
        steps.push(step);
    }
    steps.reverse();
    steps
}

/// What a finished drawing changes.
enum Change {
    Crown(Vec<Point2<f64>>),
    Branch(Vec<Point2<f64>>),
}

/// Whether crown and trunk are drawn: among several trees none is found without.
fn is_whole(strokes: &TreeStrokes) -> bool {
    !strokes.crown_px.is_empty() && !strokes.branches_px.is_empty()
}
