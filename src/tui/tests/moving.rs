//! The screen of a tree that is made to move, and its keys.

use super::made_up;
use crate::model::{Phase, Pose, Skeleton};
use crate::tui::moving::{AnimationCommand, Moving, Stage};
use crate::tui::theme::{Depth, Theme};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::sync::Arc;

struct Puppet {
    skeleton: Arc<Skeleton>,
    commands: Vec<AnimationCommand>,
    lived_s: f64,
}

impl Moving for Puppet {
    fn skeleton(&self) -> Arc<Skeleton> {
        self.skeleton.clone()
    }

    fn pose(&mut self, elapsed_s: f64) -> Pose {
        self.lived_s += elapsed_s;
        made_up::pose(&self.skeleton)
    }

    fn change(&mut self, command: AnimationCommand) {
        self.commands.push(command);
    }

    fn description(&self) -> String {
        "wind 4 of 12 (moderate breeze)  to 0°  magnified 1.00".to_owned()
    }
}

fn puppet() -> Puppet {
    Puppet {
        skeleton: Arc::new(made_up::skeleton()),
        commands: Vec::new(),
        lived_s: 0.0,
    }
}

fn press(stage: &mut Stage, puppet: &mut Puppet, key: KeyCode, with: KeyModifiers) -> bool {
    stage.press(&Event::Key(KeyEvent::new(key, with)), puppet)
}

#[test]
fn the_tree_and_what_moves_it_are_seen() {
    let mut puppet = puppet();
    let mut stage = Stage::new(&puppet);
    stage.go_on(&mut puppet, 0.1);
    for (width, height) in [(80, 24), (120, 40), (1, 1), (20, 3)] {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal
            .draw(|frame| stage.render(frame, &puppet.description(), Theme::new(Depth::None)))
            .unwrap();
        if width >= 80 {
            insta::assert_snapshot!(format!("moving_{width}x{height}"), terminal.backend());
        }
    }
}

#[test]
fn main_branches_have_the_colours_that_they_have_in_a_capture() {
    let mut puppet = puppet();
    let mut stage = Stage::new(&puppet);
    stage.go_on(&mut puppet, 0.1);
    let mut capture = made_up::snapshot(Phase::Live);
    assert!(capture.node_colour.iter().flatten().max() == Some(&2));
    assert_eq!(stage.state.snapshot.node_colour, capture.node_colour);
    capture.show_tree(puppet.skeleton);
    assert_eq!(stage.state.snapshot.node_colour, capture.node_colour);
}

#[test]
fn keys_change_the_wind_and_pause_holds_the_tree() {
    let mut puppet = puppet();
    let mut stage = Stage::new(&puppet);
    let plain = KeyModifiers::NONE;
    for key in [
        KeyCode::Up,
        KeyCode::Left,
        KeyCode::Char('-'),
        KeyCode::Char('p'),
        KeyCode::Char('x'),
    ] {
        assert!(press(&mut stage, &mut puppet, key, plain));
    }
    assert_eq!(
        puppet.commands,
        [
            AnimationCommand::Stronger(1),
            AnimationCommand::Veer(-15),
            AnimationCommand::Larger(-1),
            AnimationCommand::Pull
        ]
    );
    stage.go_on(&mut puppet, 0.5);
    assert!(press(&mut stage, &mut puppet, KeyCode::Char(' '), plain));
    stage.go_on(&mut puppet, 0.5);
    assert_eq!((puppet.lived_s, stage.paused), (0.5, true));
    assert!(press(&mut stage, &mut puppet, KeyCode::Char('l'), plain));
    assert_eq!(stage.state.turned, 1);
    assert!(!press(&mut stage, &mut puppet, KeyCode::Char('q'), plain));
    assert!(!press(
        &mut stage,
        &mut puppet,
        KeyCode::Char('c'),
        KeyModifiers::CONTROL
    ));
}

#[test]
fn keys_that_draw_are_answered_where_there_is_no_picture() {
    for key in ['o', 's'] {
        let mut puppet = puppet();
        let mut stage = Stage::new(&puppet);
        stage.go_on(&mut puppet, 0.1);
        let shown = |stage: &Stage| {
            let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
            terminal
                .draw(|frame| stage.render(frame, "", Theme::new(Depth::None)))
                .unwrap();
            terminal.backend().to_string()
        };
        assert!(shown(&stage).contains("q quit"));
        press(
            &mut stage,
            &mut puppet,
            KeyCode::Char(key),
            KeyModifiers::NONE,
        );
        assert!(
            shown(&stage).contains("no picture here to draw on"),
            "{key}"
        );
        // The keys are back after some seconds.
        (0..1000).for_each(|_| stage.go_on(&mut puppet, 0.0));
        assert!(shown(&stage).contains("q quit"));
    }
}
