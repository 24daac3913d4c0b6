//! The screen on which a user draws on a photograph: crown and branches of one tree or several, and what
//! is found along them, anew after every stroke.

use super::drawing::{Drawing, Subject};
use super::input::{Binding, DRAWING, bind, click, draw};
use super::opened::Opened;
use super::panels::messages;
use super::panels::preview::{self, Preview};
use super::placed::Placed;
use super::state::State;
use super::theme::Theme;
use super::tty::Input;
use super::{Options, TICK, TuiError};
use crate::model::{BranchGraph, Control, Masks, Rgb, Snapshot, TreeStrokes, Wood, WoodNode};
use nalgebra::Point2;
use ratatui::Frame;
use ratatui::crossterm::event::{
    self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEventKind,
};
use ratatui::layout::{Constraint, Layout};
use ratatui::text::Line;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What leaves and wood are tinted with where they are found, and how far the tint covers the picture.
const LEAVES_TINT: [u8; 3] = [0x20, 0xe0, 0x40];
const WOOD_TINT: [u8; 3] = [0xff, 0x90, 0x30];
const TINT: f64 = 0.45;
/// Strokes that can be undone, at most: each keeps what was found with it, some 10 MB.
const MOST_UNDONE: usize = 20;

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
}

/// What a key does while nothing is being drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    Accept,
    Draw(Subject),
    Undo,
    NextTree,
    Found,
    Save,
    Leave,
    Quit,
}

pub(super) const KEYS: [Binding<Action>; 9] = [
    bind(
        KeyCode::Char('c'),
        "c",
        "crown",
        "",
        Action::Draw(Subject::Outline),
    ),
    bind(
        KeyCode::Char('b'),
        "b",
        "branch",
        "",
        Action::Draw(Subject::Branch),
    ),
    bind(KeyCode::Char('u'), "u", "undo", "", Action::Undo),
    bind(KeyCode::Char('n'), "n", "next tree", "", Action::NextTree),
    bind(KeyCode::Char('w'), "w", "found", "", Action::Found),
    bind(KeyCode::Char('s'), "s", "save", "", Action::Save),
    bind(KeyCode::Enter, "Enter", "accept", "", Action::Accept),
    bind(KeyCode::Esc, "Esc", "", "", Action::Leave),
    bind(KeyCode::Char('q'), "q", "quit", "", Action::Quit),
];

/// What the screen goes on with after an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
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
struct Tree {
    strokes: TreeStrokes,
    found: Option<Arc<Result<FoundTree, String>>>,
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
pub(super) struct Sheet {
    pub state: State,
    name: String,
    picture: Arc<Rgb>,
    /// The last is the one that is drawn on; one at least.
    trees: Vec<Tree>,
    /// The trees as they were before each change, the last change last.
    before: Vec<Vec<Tree>>,
    looking: Option<Looking>,
}

/// The tree that is looked at, and since when.
#[derive(Clone, Copy, Debug)]
struct Looking {
    tree: usize,
    began: Instant,
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
            trees,
            before: Vec::new(),
            looking: None,
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
                if self.state.drawing.is_some() {
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
        if let Some(drawing) = self.state.drawing.take() {
            let Some(bound) = DRAWING.iter().find(|b| b.key == key.code) else {
                self.state.drawing = Some(drawing);
                if let Some(other) = KEYS.iter().find(|b| b.key == key.code) {
                    let shown = other.shown;
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
        match KEYS.iter().find(|b| b.key == key.code).map(|b| b.action) {
            Some(Action::Draw(subject)) => {
                self.state.unsay();
                self.state.drawing = Some(Drawing::of(subject));
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
            Some(Action::Accept) => self.accept(),
            Some(Action::Quit) => Next::Quit,
            None => Next::Stay,
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

    fn accept(&mut self) -> Next {
        for (number, tree) in (1..).zip(&self.trees) {
            if self.trees.len() > 1 && tree.strokes.is_empty() {
                continue;
            }
            let why = match tree.found.as_deref() {
                Some(Ok(_)) => continue,
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
    fn told(&self) -> String {
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
                format!("{look}, wood with {tips} tips{sure}. Enter accepts.")
            }
            Err(why) => why.clone(),
        }
    }

    /// Puts what is drawn and found into what the picture is made of.
    fn show(&mut self) {
        let mut snapshot = Snapshot {
            image_size: Some(self.picture.size),
            ..Snapshot::default()
        };
        let mut shown = None;
        let mut branches = BranchGraph::default();
        for tree in &self.trees {
            for line in &tree.strokes.branches_px {
                let points = line.iter().map(|at| [at.x, at.y]);
                snapshot.strokes_px.push(points.collect());
            }
            let Some(Ok(found)) = tree.found.as_deref() else {
                continue;
            };
            append(&mut branches, &found.wood.branches);
            if let (true, Some(at_rest)) = (self.state.wood, &found.wood.at_rest) {
                let own = shown.get_or_insert_with(|| Rgb::clone(&self.picture));
                tint(own, &at_rest.masks);
            }
        }
        if let Some(tree) = self.trees.last() {
            let corners = tree.strokes.crown_px.iter();
            snapshot.outline_px = corners.map(|at| at.map(|x| x.round() as i32)).collect();
        }
        snapshot.preview = Some(shown.map_or_else(|| self.picture.clone(), Arc::new));
        snapshot.wood = Some(Arc::new(Wood {
            branches,
            ..Wood::default()
        }));
        self.state.take(Arc::new(snapshot));
    }

    pub fn render(&self, frame: &mut Frame, theme: Theme, picture: &mut Preview) {
        let [line, sheet, message, keys] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Fill(1),
            Constraint::Length(1),
            Constraint::Length(1),
        ])
        .areas(frame.area());
        let number = self.trees.len();
        let strokes = self.trees.last().map(|tree| &tree.strokes);
        let crown = strokes.is_some_and(|s| !s.crown_px.is_empty());
        let branches = strokes.map_or(0, |s| s.branches_px.len());
        let crown = if crown { "a crown" } else { "no crown" };
        let plural = if branches == 1 { "" } else { "es" };
        let title = format!(
            " arborcam photo  {}  tree {number}: {crown}, {branches} branch{plural} drawn",
            self.name
        );
        frame.render_widget(Line::styled(title, theme.strong()), line);
        preview::render(frame, &self.state, sheet, theme, picture);
        match (self.looking, self.state.messages().next()) {
            (_, Some(_)) => messages::render(frame, &self.state, message, theme),
            (Some(looking), None) => {
                let since_s = looking.began.elapsed().as_secs_f64();
                let told = format!(" · Looking… {since_s:.1} s (keys work meanwhile)");
                frame.render_widget(Line::styled(told, theme.strong()), message);
            }
            (None, None) => {
                let told = Line::styled(format!(" · {}", self.told()), theme.faint());
                frame.render_widget(told, message);
            }
        }
        match self.state.drawing {
            Some(_) => messages::keys(frame, &self.state, keys, theme),
            None => {
                let named = KEYS.iter().filter(|b| !b.short.is_empty());
                messages::key_line(frame, named.map(|b| (b.shown, b.short)), keys, theme);
            }
        }
    }
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

/// Adds the branches of another tree.
fn append(all: &mut BranchGraph, tree: &BranchGraph) {
    let first = all.nodes.len();
    let nodes = tree.nodes.iter().map(|node| WoodNode {
        parent: node.parent.map(|parent| first + parent),
        ..node.clone()
    });
    all.nodes.extend(nodes);
}

/// Tints leaves and wood in a picture of the size of their masks.
fn tint(picture: &mut Rgb, masks: &Masks) {
    if masks.leaves.size != picture.size || masks.wood.size != picture.size {
        return;
    }
    let found = masks.leaves.pixels.iter().zip(&masks.wood.pixels);
    for (pixel, (leaf, wood)) in picture.pixels.chunks_exact_mut(3).zip(found) {
        let colour = match (*leaf > Masks::MOST_OUTSIDE, *wood > Masks::MOST_OUTSIDE) {
            (true, _) => LEAVES_TINT,
            (_, true) => WOOD_TINT,
            _ => continue,
        };
        for (own, tint) in pixel.iter_mut().zip(colour) {
            *own = (TINT * f64::from(tint) + (1.0 - TINT) * f64::from(*own)) as u8;
        }
    }
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
