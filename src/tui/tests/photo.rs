//! The screen on which a user draws on a photograph.

use crate::model::{AtRest, BranchGraph, Rgb, Size, TreeStrokes, Wood, WoodNode};
use crate::tui::graphics::Graphics;
use crate::tui::input::DRAWING;
use crate::tui::panels::preview::Preview;
use crate::tui::photo::{FoundTree, KEYS, Next, PhotoSession, Sheet};
use crate::tui::theme::{Depth, Theme};
use nalgebra::Point2;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use std::sync::Arc;

const SIZE: Size = Size {
    width: 160,
    height: 90,
};

/// Finds a trunk with two limbs wherever a branch is drawn.
#[derive(Default)]
struct Puppet {
    looked: Vec<TreeStrokes>,
    kept: Vec<TreeStrokes>,
    /// It takes its time.
    is_slow: bool,
    certainty: Option<f64>,
}

impl PhotoSession for Puppet {
    fn name(&self) -> &str {
        "oak.jpg"
    }

    fn picture(&self) -> Arc<Rgb> {
        Arc::new(Rgb {
            size: SIZE,
            pixels: vec![120; 3 * SIZE.area()],
        })
    }

    fn look(&mut self, strokes: &TreeStrokes) {
        self.looked.push(strokes.clone());
    }

    fn keep(&mut self, trees: &[TreeStrokes]) -> Result<String, String> {
        self.kept = trees.to_vec();
        Ok("oak-strokes-1.json".into())
    }

    fn found(&mut self) -> Option<Result<FoundTree, String>> {
        if self.is_slow {
            return None;
        }
        let strokes = self.looked.last()?;
        if strokes.branches_px.is_empty() {
            return Some(Err("no tree with a trunk is found".into()));
        }
        let nodes = vec![
            WoodNode::made_up(None, 80.0, 85.0),
            WoodNode::made_up(Some(0), 80.0, 50.0),
            WoodNode::made_up(Some(1), 50.0, 15.0),
            WoodNode::made_up(Some(1), 110.0, 15.0),
        ];
        Some(Ok(FoundTree {
            wood: Wood {
                bare: true,
                branches: BranchGraph { nodes },
                bark: None,
                at_rest: Some(Arc::new(AtRest::made_up(SIZE))),
            },
            in_leaf: false,
            certainty: self.certainty,
            is_likely: self.certainty.is_none_or(|chance| chance >= 0.5),
        }))
    }
}

struct Screen {
    sheet: Sheet,
    puppet: Puppet,
    preview: Preview,
    terminal: Terminal<TestBackend>,
}

impl Screen {
    fn new(width: u16, height: u16) -> Self {
        Self::begun(width, height, Vec::new())
    }

    /// With strokes of files.
    fn begun(width: u16, height: u16, strokes: Vec<TreeStrokes>) -> Self {
        let puppet = Puppet::default();
        let mut screen = Self {
            sheet: Sheet::new(&puppet, strokes),
            puppet,
            preview: Preview::new(Graphics::characters(Depth::None)),
            terminal: Terminal::new(TestBackend::new(width, height)).expect("terminal"),
        };
        screen.look();
        screen.draw();
        screen
    }

    /// Begins to look, and takes what was found.
    fn look(&mut self) {
        self.sheet.look(&mut self.puppet);
        self.sheet.look(&mut self.puppet);
    }

    fn draw(&mut self) {
        let (sheet, preview) = (&self.sheet, &mut self.preview);
        let theme = Theme::new(Depth::None);
        self.terminal
            .draw(|frame| sheet.render(frame, theme, preview))
            .expect("drawn");
    }

    fn event(&mut self, event: &Event) -> Next {
        let next = self.sheet.handle(event, self.preview.placed.as_ref());
        match next {
            Next::Look => self.look(),
            Next::Save => self.sheet.save(&mut self.puppet),
            Next::Stay | Next::Accept | Next::Quit => {}
        }
        self.draw();
        next
    }

    fn press(&mut self, key: KeyCode) -> Next {
        self.event(&Event::Key(KeyEvent::new(key, KeyModifiers::NONE)))
    }

    fn click(&mut self, at: [f64; 2]) {
        let placed = self.preview.placed.expect("a picture");
        let cell = placed.cell_from_pixel(Point2::from(at));
        let (column, row) = cell.expect("in the picture");
        self.event(&Event::Mouse(MouseEvent {
            kind: MouseEventKind::Down(MouseButton::Left),
            column,
            row,
            modifiers: KeyModifiers::NONE,
        }));
    }

    /// Draws a line by the mouse; what its end asks for.
    fn stroke(&mut self, key: char, points: &[[f64; 2]]) -> Next {
        self.press(KeyCode::Char(key));
        points.iter().for_each(|at| self.click(*at));
        self.press(KeyCode::Enter)
    }

    fn shown(&self) -> String {
        self.terminal.backend().to_string()
    }
}

const CROWN: [[f64; 2]; 4] = [[30.0, 5.0], [130.0, 5.0], [130.0, 50.0], [30.0, 50.0]];
const TRUNK: [[f64; 2]; 2] = [[80.0, 85.0], [80.0, 40.0]];

#[test]
fn strokes_by_the_mouse_are_looked_at_one_by_one_and_accepted() {
    let mut screen = Screen::new(80, 24);
    assert!(
        screen.shown().contains("no tree with a trunk"),
        "{}",
        screen.shown()
    );
    assert_eq!(screen.press(KeyCode::Enter), Next::Stay);
    assert!(screen.shown().contains("Not yet"), "{}", screen.shown());
    assert_eq!(screen.stroke('c', &CROWN), Next::Look);
    assert_eq!(screen.stroke('b', &TRUNK), Next::Look);
    assert_eq!(screen.puppet.looked.len(), 3);
    let last = &screen.puppet.looked[2];
    assert_eq!((last.crown_px.len(), last.branches_px.len()), (4, 1));
    for (set, asked) in last.branches_px[0].iter().zip(TRUNK) {
        assert!((set - Point2::from(asked)).norm() < 4.0, "{set}");
    }
    let shown = screen.shown();
    assert!(shown.contains("bare, wood with 2 tips"), "{shown}");
    assert!(
        shown.contains('w') && shown.contains('#') && shown.contains('*'),
        "{shown}"
    );
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
    assert_eq!(screen.sheet.accepted(), screen.puppet.looked[2..]);
}

#[test]
fn undo_takes_strokes_back_and_needs_no_new_look() {
    let mut screen = Screen::new(80, 24);
    screen.stroke('b', &TRUNK);
    screen.stroke('b', &[[80.0, 50.0], [110.0, 15.0]]);
    let looks = screen.puppet.looked.len();
    assert_eq!(screen.press(KeyCode::Char('u')), Next::Stay);
    assert!(screen.shown().contains("Undone"), "{}", screen.shown());
    assert_eq!(screen.puppet.looked.len(), looks);
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
    assert_eq!(screen.sheet.accepted()[0].branches_px.len(), 1);
    let mut screen = Screen::new(80, 24);
    screen.press(KeyCode::Char('u'));
    assert!(
        screen.shown().contains("nothing to undo"),
        "{}",
        screen.shown()
    );
}

#[test]
fn strokes_of_files_can_be_taken_back_too() {
    let given = TreeStrokes {
        crown_px: CROWN.map(Point2::from).to_vec(),
        branches_px: vec![TRUNK.map(Point2::from).to_vec()],
    };
    let mut screen = Screen::begun(80, 24, vec![given]);
    assert_eq!(screen.press(KeyCode::Char('u')), Next::Look);
    screen.press(KeyCode::Char('u'));
    screen.press(KeyCode::Char('u'));
    let shown = screen.shown();
    assert!(shown.contains("nothing to undo"), "{shown}");
    let last = screen.puppet.looked.last().expect("a look");
    assert!(last.crown_px.is_empty() && last.branches_px.is_empty());
}

#[test]
fn a_second_tree_begins_where_the_first_is_whole() {
    let mut screen = Screen::new(80, 24);
    screen.press(KeyCode::Char('n'));
    assert!(
        screen.shown().contains("before the next"),
        "{}",
        screen.shown()
    );
    screen.stroke('c', &CROWN);
    screen.stroke('b', &TRUNK);
    screen.press(KeyCode::Char('n'));
    assert!(screen.shown().contains("tree 2"), "{}", screen.shown());
    screen.stroke('c', &CROWN);
    assert_eq!(screen.press(KeyCode::Enter), Next::Stay);
    screen.stroke('b', &TRUNK);
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
    assert_eq!(screen.sheet.accepted().len(), 2);
}

#[test]
fn keys_work_while_it_looks_and_what_was_asked_last_counts() {
    let mut screen = Screen::new(80, 24);
    screen.puppet.is_slow = true;
    screen.stroke('c', &CROWN);
    assert!(screen.shown().contains("Looking… 0."), "{}", screen.shown());
    assert_eq!(screen.press(KeyCode::Enter), Next::Stay);
    assert!(
        screen.shown().contains("still looked at"),
        "{}",
        screen.shown()
    );
    screen.stroke('b', &TRUNK);
    screen.puppet.is_slow = false;
    screen.look();
    let last = screen.puppet.looked.last().expect("looked");
    assert_eq!((last.crown_px.len(), last.branches_px.len()), (4, 1));
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
}

#[test]
fn strokes_are_saved_by_a_key() {
    let mut screen = Screen::new(80, 24);
    screen.stroke('c', &CROWN);
    assert_eq!(screen.press(KeyCode::Char('s')), Next::Save);
    assert_eq!(screen.puppet.kept.len(), 1);
    assert_eq!(screen.puppet.kept[0].crown_px.len(), 4);
    assert!(
        screen.shown().contains("oak-strokes-1.json"),
        "{}",
        screen.shown()
    );
}

#[test]
fn escape_leaves_a_line_and_nothing_else() {
    let mut screen = Screen::new(80, 24);
    screen.stroke('b', &TRUNK);
    screen.press(KeyCode::Char('b'));
    screen.click(TRUNK[0]);
    screen.press(KeyCode::Char('n'));
    assert!(
        screen.shown().contains("Esc leaves it"),
        "{}",
        screen.shown()
    );
    assert_eq!(screen.press(KeyCode::Esc), Next::Stay);
    assert!(screen.sheet.state.drawing.is_none());
    assert_eq!(screen.press(KeyCode::Esc), Next::Stay);
    assert!(screen.shown().contains("q quits"), "{}", screen.shown());
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
    assert_eq!(screen.sheet.accepted()[0].branches_px.len(), 1);
}

#[test]
fn a_tree_that_is_only_begun_is_none() {
    let mut screen = Screen::new(80, 24);
    screen.stroke('c', &CROWN);
    screen.stroke('b', &TRUNK);
    screen.press(KeyCode::Char('n'));
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
    assert_eq!(screen.sheet.accepted().len(), 1);
}

#[test]
fn the_screen_leaves_by_its_keys_and_draws_in_any_window() {
    for (width, height) in [(80, 24), (120, 40), (1, 1), (20, 3)] {
        let mut screen = Screen::new(width, height);
        if width >= 80 {
            screen.stroke('c', &CROWN);
            screen.stroke('b', &TRUNK);
            screen.sheet.state.unsay();
            screen.draw();
            insta::assert_snapshot!(format!("photo_{width}x{height}"), screen.terminal.backend());
        }
        assert_eq!(screen.press(KeyCode::Char('q')), Next::Quit);
        let with_control = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(screen.event(&Event::Key(with_control)), Next::Quit);
    }
}

/// What is shown, without its lines and frames.
fn words(screen: &Screen) -> String {
    let shown = screen.shown().replace(['│', '"'], " ");
    let words: Vec<&str> = shown.split_whitespace().collect();
    words.join(" ")
}

#[test]
fn in_narrow_windows_what_is_said_and_the_keys_are_whole() {
    for (width, height) in [(60, 20), (80, 24)] {
        let mut screen = Screen::new(width, height);
        screen.puppet.certainty = Some(0.42);
        screen.stroke('c', &CROWN);
        screen.stroke('b', &TRUNK);
        let expect = |screen: &Screen, expected: &str| {
            let shown = words(screen);
            assert!(shown.contains(expected), "{expected}: {}", screen.shown());
        };
        expect(&screen, "tree 1: a crown, 1 branch drawn oak.jpg");
        for key in ["Enter accept", "q quit", "? help"] {
            expect(&screen, key);
        }
        let told = "bare, wood with 2 tips; found without strokes, right with a chance of 42 %";
        expect(&screen, told);
        screen.sheet.state.unsay();
        screen.draw();
        expect(&screen, told);
        screen.press(KeyCode::Enter);
        expect(&screen, "Enter once more makes the tree all the same");
        screen.press(KeyCode::Char('?'));
        for help in KEYS.iter().map(|b| b.help) {
            expect(&screen, help);
        }
        screen.press(KeyCode::Char('?'));
        screen.press(KeyCode::Char('b'));
        for key in ["click set", "Enter done", "arrows move"] {
            expect(&screen, key);
        }
        screen.press(KeyCode::Char('?'));
        for help in DRAWING.iter().map(|b| b.help) {
            expect(&screen, help);
        }
    }
}

#[test]
fn what_is_more_likely_wrong_is_accepted_by_the_second_key_only() {
    let mut screen = Screen::new(80, 24);
    screen.puppet.certainty = Some(0.21);
    screen.stroke('b', &TRUNK);
    assert_eq!(screen.press(KeyCode::Enter), Next::Stay);
    assert!(screen.shown().contains("once more"), "{}", screen.shown());
    assert_eq!(screen.press(KeyCode::Char('w')), Next::Stay);
    assert_eq!(
        screen.press(KeyCode::Enter),
        Next::Stay,
        "another key between"
    );
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
    let mut screen = Screen::new(80, 24);
    screen.puppet.certainty = Some(0.8);
    screen.stroke('b', &TRUNK);
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
}

#[test]
fn the_cross_is_there_from_the_beginning_and_the_help_names_the_keys() {
    let mut screen = Screen::new(80, 24);
    screen.press(KeyCode::Char('b'));
    assert!(screen.shown().contains('X'), "{}", screen.shown());
    screen.press(KeyCode::Char(' '));
    screen.press(KeyCode::Char('K'));
    screen.press(KeyCode::Char(' '));
    assert_eq!(screen.press(KeyCode::Enter), Next::Look);
    screen.press(KeyCode::Char('?'));
    assert!(
        screen.shown().contains("round the crown"),
        "{}",
        screen.shown()
    );
    assert_eq!(screen.press(KeyCode::Esc), Next::Stay);
    assert!(
        !screen.shown().contains("round the crown"),
        "{}",
        screen.shown()
    );
    assert_eq!(screen.press(KeyCode::Enter), Next::Accept);
}
