//! What keys and clicks do.

use super::made_up::snapshot;
use crate::model::Control::{self, BuildNow, Export, Pause, Quit, Restart};
use crate::model::{NodeName, Phase, Size, Snapshot};
use crate::tui::input::handle;
use crate::tui::placed::Placed;
use crate::tui::state::State;
use nalgebra::Point2;
use ratatui::crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use ratatui::layout::Rect;
use std::sync::Arc;

fn key(code: KeyCode) -> Event {
    Event::Key(KeyEvent::new(code, KeyModifiers::NONE))
}

fn letter(c: char) -> Event {
    key(KeyCode::Char(c))
}

fn ctrl(c: char) -> Event {
    Event::Key(KeyEvent::new(KeyCode::Char(c), KeyModifiers::CONTROL))
}

fn click(column: u16, row: u16) -> Event {
    let kind = MouseEventKind::Down(MouseButton::Left);
    Event::Mouse(MouseEvent {
        kind,
        column,
        row,
        modifiers: KeyModifiers::NONE,
    })
}

/// A 640x360 picture at ten pixels a dot: 64 columns from column 3 on, 18 rows from row 4 on, bars
/// above and below.
fn wide() -> Placed {
    Placed::fit(Size::new(640, 360), Rect::new(3, 2, 64, 22), (1, 2)).unwrap()
}

/// The same at twenty pixels a dot with bars at the sides: 32 columns from column 13 on, 9 rows
/// from row 1 on.
fn narrow() -> Placed {
    Placed::fit(Size::new(640, 360), Rect::new(5, 1, 48, 9), (1, 2)).unwrap()
}

struct Run {
    state: State,
    sent: Vec<Control>,
}

/// Plays events one after the other on a live capture.
fn play(placed: Option<Placed>, events: &[Event]) -> Run {
    let mut state = State::default();
    state.take(Arc::new(snapshot(Phase::Live)));
    let sent = events
        .iter()
        .filter_map(|e| handle(e, &mut state, placed.as_ref()))
        .collect();
    Run { state, sent }
}

#[test]
fn keys_send_what_they_say() {
    for (letters, expected) in [
        ("q", vec![Quit]),
        ("qqbo", vec![Quit]),
        (" ", vec![Pause(true)]),
        ("  ", vec![Pause(true), Pause(false)]),
        ("bre", vec![BuildNow, Restart, Export]),
        ("?b", vec![BuildNow]),
        // While drawing, space sets a point, and a slip does nothing to the capture.
        ("o ebrq", vec![]),
        ("hlmwwjk", vec![]),
    ] {
        let events: Vec<Event> = letters.chars().map(letter).collect();
        assert_eq!(play(Some(wide()), &events).sent, expected, "{letters}");
    }
    let (escape, enter) = (key(KeyCode::Esc), key(KeyCode::Enter));
    for (events, expected) in [
        (vec![ctrl('c')], vec![Quit]),
        (vec![letter('q'), ctrl('c')], vec![Quit]),
        (vec![letter('o'), ctrl('c')], vec![Quit]),
        (vec![letter('o'), escape.clone(), letter('e')], vec![Export]),
        (
            vec![letter('x'), escape, enter, ctrl('q'), click(9, 9)],
            vec![],
        ),
    ] {
        assert_eq!(play(Some(wide()), &events).sent, expected, "{events:?}");
    }
}

#[test]
fn clicks_make_a_polygon_of_the_pixels_below_them() {
    for (placed, clicks, polygon) in [
        (
            wide(),
            [(3, 4), (66, 4), (35, 21)],
            [[4.5, 9.5], [634.5, 9.5], [324.5, 349.5]],
        ),
        (
            narrow(),
            [(13, 1), (44, 1), (29, 9)],
            [[9.5, 19.5], [629.5, 19.5], [329.5, 339.5]],
        ),
    ] {
        let mut events = vec![letter('o')];
        events.extend(clicks.map(|(column, row)| click(column, row)));
        events.push(key(KeyCode::Enter));
        let run = play(Some(placed), &events);
        assert_eq!(
            run.sent,
            [Control::SetOutline(polygon.map(Into::into).to_vec())]
        );
        assert_eq!(run.state.drawing, None);
    }
}

#[test]
fn a_line_along_a_branch_is_sent_as_it_was_drawn() {
    let (enter, right) = (key(KeyCode::Enter), key(KeyCode::Right));
    for (points, line) in [
        (
            vec![click(3, 4), click(66, 4), click(35, 21)],
            vec![[4.5, 9.5], [634.5, 9.5], [324.5, 349.5]],
        ),
        // The cross begins in the middle.
        (
            vec![letter(' '), letter(' '), right, letter('K'), letter(' ')],
            vec![[324.5, 189.5], [334.5, 29.5]],
        ),
    ] {
        let mut events = vec![letter('s')];
        events.extend(points);
        events.push(enter.clone());
        let run = play(Some(wide()), &events);
        let line: Vec<Point2<f64>> = line.into_iter().map(Into::into).collect();
        assert_eq!(run.sent, [Control::AddStroke(line)]);
        assert_eq!(run.state.drawing, None);
        assert!(newest(&run.state).contains("wood along your"));
    }
}

#[test]
fn a_line_along_a_branch_is_drawn_until_it_is_good_or_left() {
    let (a, b) = (click(13, 1), click(44, 1));
    let (enter, esc, back) = (
        key(KeyCode::Enter),
        key(KeyCode::Esc),
        key(KeyCode::Backspace),
    );
    // Points left in the drawing, and what the user reads last.
    for (events, points, told) in [
        (vec![enter.clone()], Some(0), "at least 2 points"),
        (
            vec![a.clone(), a.clone(), enter.clone()],
            Some(1),
            "at least 2 points",
        ),
        (
            vec![a.clone(), b.clone(), back.clone(), enter],
            Some(1),
            "at least 2 points",
        ),
        (vec![back], Some(0), "No point is left"),
        (vec![click(12, 5)], Some(0), "outside the picture"),
        (vec![a.clone(), b.clone(), esc], None, "Left drawing"),
        (
            vec![a.clone(), letter('q')],
            Some(1),
            "q waits: a line along a branch is being drawn",
        ),
        // What is drawn is not thrown away for another drawing.
        (
            vec![a.clone(), letter('o')],
            Some(1),
            "o waits: a line along a branch is being drawn",
        ),
        (vec![a.clone(), letter('s'), b], Some(2), "Gathering"),
        (vec![a.clone(), letter('s')], Some(1), "wood that was found"),
    ] {
        let events: Vec<Event> = std::iter::once(letter('s')).chain(events).collect();
        let run = play(Some(narrow()), &events);
        let left = run.state.drawing.as_ref().map(|d| d.points_px().len());
        assert_eq!(left, points, "{events:?}");
        assert!(run.sent.is_empty(), "{events:?}");
        let last = newest(&run.state);
        assert!(last.contains(told), "{last:?} after {events:?}");
    }
    let run = play(Some(narrow()), &[letter('o'), a, letter('s')]);
    let last = newest(&run.state);
    assert!(last.contains("s waits: the outline"), "{last}");
}

/// Nothing is lost in silence: a line that is not finished when the film ends is reported.
#[test]
fn a_line_that_is_drawn_when_the_film_ends_is_left_and_told_of() {
    for (keys, clicks, ended, is_left, is_told) in [
        ("s", 2, true, true, true),
        ("s", 1, true, true, true),
        ("s", 0, true, true, false),
        ("s", 2, false, false, false),
        ("o", 2, true, false, false),
        ("", 0, true, true, false),
    ] {
        let mut events: Vec<Event> = keys.chars().map(letter).collect();
        events.extend((0..clicks).map(|k| click(13 + k, 1)));
        let mut state = play(Some(narrow()), &events).state;
        state.take(Arc::new(Snapshot {
            ended,
            ..snapshot(Phase::Live)
        }));
        let told = state.leave_drawing_at_end();
        assert_eq!(
            told.is_some(),
            is_told,
            "{keys:?}, {clicks} points: {told:?}"
        );
        assert_eq!(
            state.drawing.is_none(),
            is_left,
            "{keys:?}, {clicks} points"
        );
        assert_eq!(state.leave_drawing_at_end(), None, "it is reported once");
    }
}

#[test]
fn backspace_takes_the_last_line_back_when_no_point_is_left() {
    let back = key(KeyCode::Backspace);
    for (begins, points, sent) in [
        ('s', 0, vec![Control::TakeBackStroke]),
        ('s', 1, vec![]),
        ('o', 0, vec![]),
    ] {
        let mut state = State::default();
        state.take(Arc::new(Snapshot {
            strokes_px: vec![vec![[1.0, 2.0], [3.0, 4.0]]],
            ..snapshot(Phase::Live)
        }));
        let mut events = vec![letter(begins)];
        events.extend((0..points).map(|_| click(13, 1)));
        events.push(back.clone());
        let placed = narrow();
        let found: Vec<Control> = events
            .iter()
            .filter_map(|e| handle(e, &mut state, Some(&placed)))
            .collect();
        assert_eq!(found, sent, "{begins} and {points} points");
        assert!(state.drawing.is_some(), "he goes on drawing");
    }
}

#[test]
fn drawing_stays_until_it_is_good_or_left() {
    let (a, b, c) = (click(13, 1), click(44, 1), click(29, 9));
    let (enter, esc, back) = (
        key(KeyCode::Enter),
        key(KeyCode::Esc),
        key(KeyCode::Backspace),
    );
    // Points left in the drawing (none: not drawing any more), outlines sent, and what the user
    // reads last.
    for (events, points, sent, told) in [
        (vec![enter.clone()], Some(0), 0, "at least 3 points"),
        (
            vec![a.clone(), b.clone(), enter.clone()],
            Some(2),
            0,
            "at least 3 points",
        ),
        (
            vec![a.clone(), a.clone(), a.clone(), enter.clone()],
            Some(1),
            0,
            "at least 3 points",
        ),
        (
            vec![a.clone(), b.clone(), c.clone(), back.clone(), enter.clone()],
            Some(2),
            0,
            "at least 3 points",
        ),
        (vec![back.clone()], Some(0), 0, "No point is left"),
        (
            vec![click(12, 5), click(45, 5), click(20, 0), click(20, 10)],
            Some(0),
            0,
            "outside the picture",
        ),
        (
            vec![a.clone(), b.clone(), c.clone(), esc.clone()],
            None,
            0,
            "Left drawing",
        ),
        (
            vec![a.clone(), c.clone(), b.clone(), click(20, 9), enter.clone()],
            Some(4),
            0,
            "crosses itself",
        ),
        (
            vec![a.clone(), b.clone(), c.clone(), a.clone(), enter.clone()],
            None,
            1,
            "outline of 3 points",
        ),
        (
            vec![a.clone(), letter('q')],
            Some(1),
            0,
            "the outline is being drawn; Enter takes it, Esc leaves it",
        ),
        (vec![a.clone(), ctrl('c')], None, 1, "writing"),
    ] {
        let events: Vec<Event> = std::iter::once(letter('o')).chain(events).collect();
        let run = play(Some(narrow()), &events);
        assert_eq!(
            run.state.drawing.as_ref().map(|d| d.points_px().len()),
            points,
            "{events:?}"
        );
        assert_eq!(run.sent.len(), sent, "{events:?}");
        let last = run.state.messages().next_back().unwrap_or_default();
        assert!(last.contains(told), "{last:?} after {events:?}");
    }
}

#[test]
fn the_keyboard_reaches_what_the_mouse_reaches() {
    let mut events = vec![letter('o')];
    // As far as it goes.
    for (across, down) in [('H', 'K'), ('L', 'K'), ('L', 'J')] {
        events.extend(std::iter::repeat_n(letter(across), 9));
        events.extend(std::iter::repeat_n(letter(down), 9));
        events.push(letter(' '));
    }
    events.extend([
        key(KeyCode::Left),
        key(KeyCode::Up),
        letter(' '),
        key(KeyCode::Backspace),
    ]);
    events.push(key(KeyCode::Enter));
    let run = play(Some(narrow()), &events);
    assert_eq!(
        run.sent,
        [Control::SetOutline(vec![
            [9.5, 19.5].into(),
            [629.5, 19.5].into(),
            [629.5, 339.5].into()
        ])]
    );
}

#[test]
fn there_is_no_drawing_without_a_picture() {
    for begins in ['o', 's'] {
        let mut state = State::default();
        assert_eq!(handle(&letter(begins), &mut state, None), None);
        assert_eq!(state.drawing, None);
        assert!(state.messages().any(|m| m.contains("no picture yet")));
    }
    // A picture that is there but not on the screen, as in too small a window.
    let run = play(
        None,
        &[letter('o'), click(5, 5), letter(' '), key(KeyCode::Left)],
    );
    assert!(run.sent.is_empty() && run.state.drawing.is_some_and(|d| d.points_px().is_empty()));
}

/// The state after these letters.
fn after(keys: &str) -> State {
    play(None, &keys.chars().map(letter).collect::<Vec<_>>()).state
}

#[test]
fn the_tree_turns_all_the_way_round_and_shows_its_wood() {
    let whole_turn = "l".repeat(24);
    for (keys, turned) in [
        ("l", 1),
        ("h", 23),
        ("lh", 0),
        ("hhh", 21),
        (&whole_turn, 0),
    ] {
        assert_eq!(after(keys).turned, turned, "{keys}");
    }
    let run = play(
        None,
        &[key(KeyCode::Right), key(KeyCode::Right), key(KeyCode::Left)],
    );
    assert_eq!(run.state.turned, 1);
    for (keys, shown) in [("m", true), ("mm", false), ("mqm", false)] {
        assert_eq!(after(keys).solid.is_some(), shown, "{keys}");
    }
}

#[test]
fn the_chosen_branch_goes_up_and_down_and_outlives_a_refinement() {
    let far_down = "j".repeat(50);
    for (keys, chosen) in [("", 0), ("jj", 2), ("k", 0), ("jjjk", 2), (&far_down, 9)] {
        assert_eq!(after(keys).chosen(), chosen, "{keys}");
    }
    // The tree is refined: the branch is in another row.
    let mut state = after("jjj");
    let mut moved = snapshot(Phase::Live);
    moved.branches.remove(1);
    state.take(Arc::new(moved));
    assert_eq!(state.snapshot.branches[state.chosen()].node, NodeName(4));
    // It is gone, and so are most: another one takes its row.
    let fewer = snapshot(Phase::Live).branches[..2].to_vec();
    state.take(Arc::new(Snapshot {
        branches: fewer,
        ..snapshot(Phase::Live)
    }));
    assert_eq!(state.chosen(), 1);
}

#[test]
fn choosing_a_branch_looks_at_it_and_esc_looks_away() {
    for (events, close_up) in [
        (vec![], false),
        (vec![letter('j')], true),
        (vec![key(KeyCode::Up)], true),
        (vec![letter('j'), key(KeyCode::Esc)], false),
        // The help goes first.
        (vec![letter('j'), letter('?'), key(KeyCode::Esc)], true),
        (vec![letter('j'), letter('q'), key(KeyCode::Esc)], false),
    ] {
        assert_eq!(play(None, &events).state.close_up, close_up, "{events:?}");
    }
    let mut empty = State::default();
    assert!(handle(&letter('j'), &mut empty, None).is_none() && !empty.close_up);
}

#[test]
fn a_late_snapshot_does_not_undo_a_pause() {
    let mut run = play(None, &[letter(' ')]);
    run.state.take(Arc::new(snapshot(Phase::Live)));
    assert!(run.state.paused);
    run.state.take(Arc::new(Snapshot {
        paused: true,
        ..snapshot(Phase::Live)
    }));
    run.state.take(Arc::new(snapshot(Phase::Live)));
    assert!(!run.state.paused);
}

fn newest(state: &State) -> String {
    state.messages().next_back().unwrap_or_default().to_owned()
}

#[test]
fn a_notice_goes_when_the_capture_speaks_or_with_time() {
    let mut run = play(None, &[letter('e')]);
    assert!(newest(&run.state).contains("export"));
    (0..1000).for_each(|_| run.state.tick());
    assert!(newest(&run.state).contains("Gathering"));
    run.state.say("something");
    run.state.take(Arc::new(Snapshot {
        messages: vec!["Exported.".to_owned()],
        ..snapshot(Phase::Live)
    }));
    assert_eq!(newest(&run.state), "Exported.");
}

#[test]
fn markers_are_picked_and_hung_on_each_other_by_clicks() {
    let enter = || key(KeyCode::Enter);
    let (low, high) = (click(3, 21), click(66, 4));
    let places: Vec<Point2<f64>> = vec![[4.5, 349.5].into(), [634.5, 9.5].into()];
    let picked = play(
        Some(wide()),
        &[letter('c'), low.clone(), high.clone(), enter()],
    );
    assert_eq!(picked.sent, [Control::PickMarkers(places.clone())]);
    let hung = play(Some(wide()), &[letter('p'), low.clone(), high, enter()]);
    assert_eq!(hung.sent, [Control::HangMarkers(places)]);
    // One alone hangs on nothing.
    let one = play(Some(wide()), &[letter('p'), low, enter()]);
    assert_eq!(one.sent, []);
    assert!(one.state.drawing.is_some());
}
