//! What the whole screen looks like, and that nothing brings it down.

use super::made_up::{huge, snapshot};
use crate::model::{
    CameraState, Phase, Rgb, Size, Skeleton, Snapshot, TagScale, TagState, Unidentified, WoodSight,
    reason,
};
use crate::tui::compose;
use crate::tui::drawing::{Drawing, Subject};
use crate::tui::graphics::Graphics;
use crate::tui::input::handle;
use crate::tui::panels::preview::Preview;
use crate::tui::screen;
use crate::tui::state::State;
use crate::tui::theme::{Depth, Theme};
use nalgebra::Point2;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{Event, KeyCode};
use ratatui::style::Color;
use std::sync::Arc;

fn drawn(state: &State, depth: Depth, width: u16, height: u16) -> TestBackend {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    let mut preview = Preview::new(Graphics::characters(depth));
    terminal
        .draw(|frame| screen::render(frame, state, Theme::new(depth), &mut preview))
        .unwrap();
    terminal.backend().clone()
}

fn state(snapshot: Snapshot) -> State {
    let mut state = State::default();
    state.take(Arc::new(snapshot));
    state
}

fn cases() -> Vec<(&'static str, State)> {
    let mut cases: Vec<_> = Phase::ALL
        .into_iter()
        .map(|phase| (phase.name(), state(snapshot(phase))))
        .collect();
    cases.push(("empty", state(Snapshot::default())));
    cases.push(("huge", state(huge())));
    let replay = Snapshot {
        frames_total: Some(5000),
        source: "oak.mcap".to_owned(),
        ..snapshot(Phase::Live)
    };
    cases.push(("replay", state(replay)));
    let mut help = state(snapshot(Phase::Live));
    help.help = true;
    cases.push(("help", help));
    let mut turned = state(snapshot(Phase::Live));
    turned.turn(-2);
    turned.choose(9);
    turned.close_up = false;
    cases.push(("turned", turned));
    for (name, row, sway_passed_over) in [("branch", 2, 0), ("branch_unknown", 6, 12)] {
        let mut close = state(Snapshot {
            sway_passed_over,
            ..snapshot(Phase::Live)
        });
        close.choose(row);
        cases.push((name, close));
    }
    let mut mesh = state(snapshot(Phase::Live));
    mesh.switch_mesh();
    cases.push(("mesh", mesh));
    let mut mesh = state(huge());
    mesh.switch_mesh();
    mesh.turn(5);
    mesh.choose(0);
    cases.push(("huge_mesh", mesh));
    let mut drawing = state(snapshot(Phase::Accumulate));
    let polygon = drawing.drawing.get_or_insert_default();
    [[100.0, 50.0], [500.0, 60.0], [300.0, 300.0]]
        .into_iter()
        .for_each(|p| polygon.add(p.into()));
    polygon.set_cursor(Point2::new(320.0, 180.0));
    drawing.say("That is outside the picture.");
    cases.push(("drawing", drawing));
    cases.extend(stroke_cases());
    cases.extend(wood_cases());
    cases.extend(camera_cases());
    let mut quitting = state(Snapshot {
        paused: true,
        ..snapshot(Phase::Live)
    });
    quitting.quitting = true;
    quitting.say("Ending; writing the capture…");
    cases.push(("quitting", quitting));
    cases
}

/// Lines along branches, and another one being drawn.
fn stroke_cases() -> [(&'static str, State); 2] {
    let strokes_px = vec![
        vec![[320.0, 330.0], [310.0, 200.0], [240.0, 90.0]],
        vec![[310.0, 200.0], [400.0, 120.0]],
    ];
    let drawn = Snapshot {
        strokes_px,
        ..snapshot(Phase::Live)
    };
    let mut drawing = state(drawn.clone());
    let line = drawing.drawing.insert(Drawing::of(Subject::Branch));
    line.add(Point2::new(330.0, 250.0));
    line.add(Point2::new(500.0, 200.0));
    line.set_cursor(Point2::new(560.0, 150.0));
    [("strokes", state(drawn)), ("drawing_stroke", drawing)]
}

/// The wood that was found: with the points, while a line is drawn, and where there is none.
fn wood_cases() -> [(&'static str, State); 4] {
    let after = |keys: &str, snapshot: Snapshot| {
        let mut state = state(snapshot);
        for key in keys.chars() {
            let event = Event::Key(KeyCode::Char(key).into());
            assert_eq!(handle(&event, &mut state, None), None);
        }
        state
    };
    let none = Snapshot {
        wood: None,
        wood_sight: WoodSight::NotSeen,
        ..snapshot(Phase::Live)
    };
    [
        ("wood", after("w", snapshot(Phase::Live))),
        ("wood_hidden", after("ww", snapshot(Phase::Live))),
        ("wood_drawing", after("s", snapshot(Phase::Live))),
        ("wood_none", after("s", none)),
    ]
}

/// A camera that has gone, and one that is too slow.
fn camera_cases() -> [(&'static str, State); 2] {
    let away = CameraState {
        away: Some("no frame for 3 s".to_owned()),
        lost_by_sequence: Some(3),
        lost_by_time: 2,
        damaged: 4,
        ..CameraState::default()
    };
    let away = Snapshot {
        camera: away,
        ..snapshot(Phase::Live)
    };
    let slow = CameraState {
        rate_off: true,
        ..CameraState::default()
    };
    let slow = Snapshot {
        camera: slow,
        sensor_rate_hz: 15.0,
        ..snapshot(Phase::Live)
    };
    [("away", state(away)), ("slow", state(slow))]
}

/// While a line is drawn, q does not end; what is said in too small a window is true then, too.
#[test]
fn a_window_that_is_too_small_tells_a_key_that_ends() {
    for (_, state) in stroke_cases() {
        let screen = drawn(&state, Depth::None, 40, 10).to_string();
        let text = screen.replace(['"', '\n'], " ");
        let words: Vec<&str> = text.split_whitespace().collect();
        assert!(words.join(" ").contains("Ctrl-C ends"), "{screen}");
    }
}

/// The panel says the scale by a tag, and when the tag is not seen any more.
#[test]
fn a_tag_has_a_row_with_its_scale() {
    let scale = TagScale {
        id: 7,
        size_m: 0.16,
        frames: 12,
        metres_per_px: 0.004,
        metres_per_px_lo: 0.00396,
        metres_per_px_hi: 0.00404,
        roll_deg: 0.5,
        roll_sd_deg: 0.1,
        foreshortened: 0.98,
        moves_px: 0.1,
    };
    for is_seen in [true, false] {
        let mut shown = snapshot(Phase::Live);
        shown.camera.tag = Some(TagState { scale, is_seen });
        let screen = drawn(&state(shown), Depth::None, 200, 60).to_string();
        assert!(screen.contains("0.00400 m/px ±1.0 %"), "{screen}");
        assert_eq!(screen.contains("not seen  0.00400"), !is_seen, "{screen}");
    }
    let without = drawn(&state(snapshot(Phase::Live)), Depth::None, 200, 60);
    assert!(!without.to_string().contains("m/px"));
}

#[test]
fn looks_as_reviewed() {
    for (name, state) in cases() {
        for (width, height) in [(80, 24), (200, 60)] {
            // Letters instead of half blocks, which without their colours would say nothing.
            let screen = drawn(&state, Depth::None, width, height);
            insta::assert_snapshot!(format!("{name}_{width}x{height}"), screen);
        }
    }
    for (width, height) in [(60, 20), (100, 30), (160, 50)] {
        let screen = drawn(&state(snapshot(Phase::Live)), Depth::None, width, height);
        insta::assert_snapshot!(format!("live_{width}x{height}"), screen);
    }
}

/// Pictures and trees that are empty, torn or without extent.
fn broken() -> [Snapshot; 7] {
    let torn = Rgb {
        size: Size::new(640, 360),
        pixels: vec![1, 2, 3],
    };
    let none = Rgb {
        size: Size::new(0, 0),
        pixels: Vec::new(),
    };
    let bare = Skeleton {
        nodes: Vec::new(),
        foot_px: [0.0; 2].into(),
        image_size: Size::new(0, 0),
    };
    let mut flat = super::made_up::skeleton();
    flat.nodes
        .iter_mut()
        .for_each(|n| n.position = nalgebra::Point3::origin());
    [
        Snapshot {
            preview: Some(Arc::new(torn)),
            ..snapshot(Phase::Live)
        },
        Snapshot {
            preview: Some(Arc::new(none)),
            image_size: Some(Size::new(0, 7)),
            ..snapshot(Phase::Live)
        },
        Snapshot {
            image_size: None,
            ..snapshot(Phase::Live)
        },
        Snapshot {
            skeleton: Some(Arc::new(bare)),
            ..snapshot(Phase::Live)
        },
        Snapshot {
            skeleton: Some(Arc::new(flat)),
            pose: None,
            ..snapshot(Phase::Live)
        },
        Snapshot {
            image_size: Some(Size::new(u32::MAX, 1)),
            ..huge()
        },
        Snapshot {
            progress: f64::NEG_INFINITY,
            ..huge()
        },
    ]
}

#[test]
fn no_state_and_no_size_brings_it_down() {
    let mut all: Vec<State> = cases().into_iter().map(|(_, state)| state).collect();
    for change in broken() {
        let mut mesh = state(change.clone());
        mesh.switch_mesh();
        all.extend([state(change), mesh]);
    }
    let sizes = [
        (0, 0),
        (1, 1),
        (60, 16),
        (61, 17),
        (80, 24),
        (20, 200),
        (500, 3),
        (120, 40),
        (300, 100),
    ];
    for (i, state) in all.iter().enumerate() {
        for (width, height) in sizes {
            for depth in [Depth::None, Depth::Indexed, Depth::True] {
                println!("case {i} at {width}x{height}");
                drawn(state, depth, width, height);
            }
        }
    }
}

/// A number without a head over it could be anything.
#[test]
fn every_column_of_the_table_of_branches_has_its_head() {
    for (width, height) in [(100, 30), (120, 40), (160, 50), (240, 60)] {
        let text = drawn(&state(snapshot(Phase::Live)), Depth::None, width, height).to_string();
        let tables = text.matches("f/Hz").count();
        assert!(tables > 0, "{width}x{height}: {text}");
        for head in ["pts", "ampl/px", "damping"] {
            let found = text
                .lines()
                .filter(|l| l.contains("f/Hz"))
                .map(|l| l.matches(head).count())
                .sum::<usize>();
            assert_eq!(found, tables, "{head} at {width}x{height}: {text}");
        }
    }
}

/// Every reason why a branch has no frequency is given in words, and no number stands in its place.
#[test]
fn an_unknown_sway_is_told_by_its_reason() {
    // While it films nothing has come to its end.
    let while_filming = Unidentified::ALL
        .into_iter()
        .filter(|why| *why != Unidentified::NotInTime);
    for (row, why) in while_filming.enumerate() {
        let mut state = state(snapshot(Phase::Live));
        state.choose(row as i16 + 3);
        for (width, height) in [(80, 24), (120, 40)] {
            let screen = drawn(&state, Depth::None, width, height).to_string();
            let right: Vec<String> = screen
                .lines()
                .map(|l| l.chars().skip(width as usize * 58 / 100).collect())
                .collect();
            let text = right
                .join(" ")
                .split_whitespace()
                .collect::<Vec<_>>()
                .join(" ")
                .replace("\" ", "");
            let moves_with = match why {
                Unidentified::AncestorsSway => super::made_up::moves_with(),
                _ => Vec::new(),
            };
            let told = format!("no frequency: {}", reason(why, &moves_with));
            let words = told.split(' ').collect::<Vec<_>>();
            let at = text
                .find("no frequency:")
                .unwrap_or_else(|| panic!("{why}: {screen}"));
            assert!(
                words.iter().all(|w| text[at..].contains(w)),
                "{told}: {screen}"
            );
            assert!(!text.contains('±'), "{screen}");
        }
    }
}

/// The screen where spectra end at `last_hz` and so many rows of angles are left.
fn screen_with_scales(last_hz: f64, rows: usize) -> String {
    let mut s = snapshot(Phase::Live);
    let mut sway = super::made_up::sway();
    for branch in sway.branches.values_mut() {
        if let Some(spectrum) = &mut branch.spectrum {
            spectrum.bin_hz = last_hz / spectrum.amplitude_deg.len() as f64;
        }
    }
    s.sway = Some(Arc::new(sway));
    let gone = s.angles.rows.len() - rows;
    s.angles.rows = s.angles.rows.iter().skip(gone).cloned().collect();
    let mut state = state(s);
    // One without an answer, which may stand in the way of the axis' end.
    state.choose(6);
    drawn(&state, Depth::None, 200, 60).to_string()
}

/// Scales say what is drawn: of few frames a second the axis ends below 1 Hz, and a young branch
/// has few seconds.
#[test]
fn the_plots_of_a_branch_have_true_scales() {
    for (last_hz, rows, end, seconds) in [
        (0.4, 151, "0.4 Hz", ", last 5 s "),
        (0.96, 601, " 1 Hz", ", last 20 s "),
        (0.75, 31, " 0.8 Hz", ", last 1 s "),
    ] {
        let text = screen_with_scales(last_hz, rows);
        assert!(
            text.contains(end) && text.contains(seconds),
            "{end}{seconds}: {text}"
        );
    }
}

#[test]
fn branches_are_coloured_alike_in_picture_table_and_tree() {
    // So wide that the points are not mixed with the picture.
    let screen = drawn(&state(snapshot(Phase::Live)), Depth::True, 300, 100);
    let theme = Theme::new(Depth::True);
    for branch in 0..3 {
        let colour = theme.branch(Some(branch));
        let cells = screen.buffer().content.iter();
        let symbols: Vec<&str> = cells
            .filter(|c| c.fg == colour || c.bg == colour)
            .map(|c| c.symbol())
            .collect();
        assert!(symbols.contains(&"▀"), "picture, branch {branch}");
        assert!(symbols.contains(&"●"), "table, branch {branch}");
        let braille = "\u{2801}"..="\u{28ff}";
        assert!(
            symbols.iter().any(|s| braille.contains(s)),
            "tree, branch {branch}"
        );
    }
}

/// A user who draws must see which line is his, on terminals with few colours, too.
#[test]
fn lines_along_branches_have_a_colour_of_their_own() {
    for depth in [Depth::True, Depth::Indexed] {
        assert_own_colour(compose::STROKE, depth);
        assert!(!shows(
            &state(snapshot(Phase::Live)),
            compose::STROKE,
            depth
        ));
        for (name, state) in stroke_cases() {
            assert!(shows(&state, compose::STROKE, depth), "{name}, {depth:?}");
        }
    }
}

/// A user who draws must see where wood was found, others only if they ask for it.
#[test]
fn the_wood_that_was_found_is_shown_while_a_line_is_drawn_and_by_its_key() {
    let mut outline = state(snapshot(Phase::Live));
    (outline.wood, outline.drawing) = (true, Some(Drawing::of(Subject::Outline)));
    for depth in [Depth::True, Depth::Indexed] {
        assert_own_colour(compose::WOOD, depth);
        let shown = wood_cases().map(|(_, state)| shows(&state, compose::WOOD, depth));
        assert_eq!(shown, [true, false, true, false], "{depth:?}");
        assert!(
            !shows(&outline, compose::WOOD, depth),
            "it would hide the tree"
        );
    }
}

/// No branch and nothing else that is drawn has this colour.
fn assert_own_colour(rgb: [u8; 3], depth: Depth) {
    let theme = Theme::new(depth);
    let branches = (0..8).map(|b| theme.branch(Some(b)));
    let drawn = [
        compose::OUTLINE,
        compose::DRAWN,
        compose::CURSOR,
        compose::STROKE,
        compose::WOOD,
    ];
    let others = drawn.into_iter().filter(|other| *other != rgb);
    let mut others = branches.chain(others.map(|other| theme.colour(other)));
    assert!(others.all(|c| c != theme.colour(rgb)), "{depth:?}");
}

/// Whether something on the screen has this colour.
fn shows(state: &State, rgb: [u8; 3], depth: Depth) -> bool {
    let own = Theme::new(depth).colour(rgb);
    let screen = drawn(state, depth, 120, 40);
    let mut cells = screen.buffer().content.iter();
    cells.any(|c| c.fg == own || c.bg == own)
}

#[test]
fn without_colour_no_cell_is_coloured() {
    for (name, state) in cases() {
        let screen = drawn(&state, Depth::None, 80, 24);
        let plain = screen
            .buffer()
            .content
            .iter()
            .all(|c| c.fg == Color::Reset && c.bg == Color::Reset);
        assert!(plain, "{name}");
    }
}
