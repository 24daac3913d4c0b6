//! What the capture waits for, and what the user can do now, in one short line.

use super::drawing::Subject;
use super::format;
use super::state::State;
use crate::model::{Background, BranchSway, Phase, Snapshot, Unidentified};

/// The line, and whether it tells of something that keeps the capture from going on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Awaited {
    pub text: String,
    pub is_trouble: bool,
}

/// What is awaited in this state: what stops all else comes first.
pub fn awaited(state: &State) -> Awaited {
    let s = &*state.snapshot;
    let is_ending = s.ended || state.quitting;
    if is_ending && s.waits_for_room {
        return trouble("the disk is full: make room, and the capture is written");
    }
    if is_ending {
        return next("finishing: tree and files are being completed");
    }
    if let Some(reason) = &s.camera.away {
        return trouble(format!(
            "the camera is gone: plug it in, and the capture goes on ({reason})"
        ));
    }
    if let Some(drawing) = &state.drawing {
        return next(match drawing.subject() {
            Subject::Outline => "draw round the tree: click or space sets corners, Enter closes",
            Subject::Branch => "draw from a branch's base to its tip: click or space, then Enter",
            Subject::Markers => "click on the middle of each marker, then Enter",
            Subject::MarkerOrder => "click on markers in turn, away from the foot, then Enter",
        });
    }
    if state.paused {
        return next("paused: space goes on");
    }
    if s.background == Some(Background::Lost) {
        return trouble("the camera was turned or covered: point it back, or r starts again");
    }
    next(of_phase(s))
}

fn next(text: impl Into<String>) -> Awaited {
    Awaited {
        text: text.into(),
        is_trouble: false,
    }
}

fn trouble(text: impl Into<String>) -> Awaited {
    Awaited {
        text: text.into(),
        is_trouble: true,
    }
}

/// What a capture waits for that goes as it should. Of a film that is replayed nothing can be
/// changed but how it is looked at.
fn of_phase(s: &Snapshot) -> String {
    match s.phase {
        Phase::Outline if s.source.is_empty() => "waiting for the source to open".into(),
        Phase::Outline if s.image_size.is_none() => {
            format!("waiting for the first picture from {}", s.source)
        }
        Phase::Outline if s.is_live => {
            "looking for what moves: pull the tree or wait for wind, or draw it (o)".into()
        }
        Phase::Outline => "looking for what moves in the film; o draws the tree".into(),
        Phase::Detect => "looking for points to follow in the outline".into(),
        Phase::Accumulate => of_accumulation(s),
        Phase::Build => "building the tree".into(),
        Phase::Live => of_live(s),
    }
}

fn of_accumulation(s: &Snapshot) -> String {
    let needed = &s.still_needed;
    if s.tracks_alive == 0 && s.is_live {
        return "no points to follow: more light, sharper focus, or another outline (o)".into();
    }
    if s.tracks_alive == 0 {
        return "no points to follow: another outline (o) may have some".into();
    }
    if needed.motion && s.is_live {
        return "waiting for the tree to move: pull it, or wait for wind".into();
    }
    if needed.motion {
        return "waiting for the tree to move in the film".into();
    }
    // As the gauge shows it; what is no number is nothing seen.
    let percent = (100.0 * s.progress.clamp(0.0, 1.0)).round() as u32;
    if percent < 100 {
        let until = if s.is_live {
            "let it move"
        } else {
            "more comes"
        };
        return format!("{percent} % of the motion needed is seen: {until}, or b builds now");
    }
    if needed.before_tree_s > 0.0 {
        let left = seconds(needed.before_tree_s);
        return format!("enough motion is seen: the tree is built in {left}, or b builds now");
    }
    "one stem shows so far: waiting for branches that move, or b builds now".into()
}

/// The tree stands.
fn of_live(s: &Snapshot) -> String {
    let left_s = s.still_needed.for_sway_s;
    let left = (s.is_live && left_s > 0.0).then(|| seconds(left_s));
    if s.sway_at_end {
        let more = left.map_or(String::new(), |left| format!("film {left} more; "));
        return format!("the tree is there: {more}frequencies come at the end");
    }
    let branches = s.sway.iter().flat_map(|sway| sway.branches.values());
    let all = branches.clone().filter(|b| is_measured(b)).count();
    let known = branches.filter(|b| b.swaying.is_ok()).count();
    let have = format!("{known} of {all} branches have a frequency");
    match left {
        Some(left) if known > 0 => format!("{have}: film {left} more for better ones"),
        Some(left) => format!("the tree is there: film {left} more for the branches' frequencies"),
        None if known > 0 && s.is_live => format!("{have}: film on for more, or q ends"),
        None if known > 0 => have,
        None if all == 0 => "the tree is there: its frequencies are being looked for".into(),
        None if s.is_live => {
            "no frequency yet: pull the tree and release it, or film on in wind".into()
        }
        None => "the tree is there: no branch has a frequency yet".into(),
    }
}

fn is_measured(branch: &BranchSway) -> bool {
    branch.swaying != Err(Unidentified::NotMeasured)
}

/// Whole seconds, one at least; minutes where there are many.
fn seconds(left_s: f64) -> String {
    if left_s < 100.0 {
        format!("{:.0} s", left_s.ceil().max(1.0))
    } else {
        format!("{} min", format::clock(left_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{CameraState, Size, StillNeeded};
    use crate::tui::drawing::Drawing;
    use crate::tui::tests::made_up::{self, snapshot};
    use std::sync::Arc;

    /// Columns that a line may take at 80x24.
    const ROOM: usize = 78;

    fn check(name: &str, state: &State, expected: &str) {
        let awaited = awaited(state);
        assert_eq!(awaited.text, expected, "{name}");
        assert!(format::width(expected) <= ROOM, "{name}: {expected}");
    }

    /// Of a camera.
    fn of(snapshot: Snapshot) -> State {
        let mut state = State::default();
        state.take(Arc::new(Snapshot {
            is_live: true,
            ..snapshot
        }));
        state
    }

    fn accumulating(progress: f64, still_needed: StillNeeded) -> Snapshot {
        Snapshot {
            progress,
            still_needed,
            ..snapshot(Phase::Accumulate)
        }
    }

    fn live(for_sway_s: f64) -> Snapshot {
        let still_needed = StillNeeded {
            for_sway_s,
            ..StillNeeded::default()
        };
        Snapshot {
            still_needed,
            ..snapshot(Phase::Live)
        }
    }

    /// A phase of a film, with what is said of a camera's and of a replay's.
    struct Case {
        name: &'static str,
        snapshot: Snapshot,
        live: &'static str,
        replayed: &'static str,
    }

    fn cases() -> Vec<Case> {
        let mut no_sway = live(0.0);
        no_sway.sway = None;
        let mut unknown = made_up::sway();
        unknown.branches.retain(|_, branch| branch.swaying.is_err());
        let unknown = Snapshot {
            sway: Some(Arc::new(unknown)),
            ..live(0.0)
        };
        let mut known = made_up::sway();
        known.branches.retain(|_, branch| branch.swaying.is_ok());
        let known = Snapshot {
            sway: Some(Arc::new(known)),
            ..live(0.0)
        };
        let [at_end, short_at_end] = [0.0, 3.9].map(|left_s| Snapshot {
            sway_at_end: true,
            ..live(left_s)
        });
        let short = Snapshot {
            sway: None,
            ..live(17.2)
        };
        let moving = StillNeeded::default();
        let still = StillNeeded {
            motion: true,
            ..moving
        };
        let soon = StillNeeded {
            before_tree_s: 2.3,
            ..moving
        };
        let no_points = Snapshot {
            tracks_alive: 0,
            ..accumulating(0.0, still)
        };
        let unopened = "waiting for the source to open";
        let no_picture = Snapshot {
            image_size: None,
            ..snapshot(Phase::Outline)
        };
        let first = "waiting for the first picture from /dev/video0";
        let detect = "looking for points to follow in the outline";
        let stem = "one stem shows so far: waiting for branches that move, or b builds now";
        let built_soon = "enough motion is seen: the tree is built in 3 s, or b builds now";
        let told_at_end = "the tree is there: frequencies come at the end";
        let sought = "the tree is there: its frequencies are being looked for";
        let case = |name, snapshot, live, replayed| Case {
            name,
            snapshot,
            live,
            replayed,
        };
        vec![
            case("unopened", Snapshot::default(), unopened, unopened),
            case("no picture", no_picture, first, first),
            case(
                "outline",
                snapshot(Phase::Outline),
                "looking for what moves: pull the tree or wait for wind, or draw it (o)",
                "looking for what moves in the film; o draws the tree",
            ),
            case("detect", snapshot(Phase::Detect), detect, detect),
            case(
                "no points",
                no_points,
                "no points to follow: more light, sharper focus, or another outline (o)",
                "no points to follow: another outline (o) may have some",
            ),
            case(
                "still",
                accumulating(0.0, still),
                "waiting for the tree to move: pull it, or wait for wind",
                "waiting for the tree to move in the film",
            ),
            case(
                "moving",
                accumulating(0.624, moving),
                "62 % of the motion needed is seen: let it move, or b builds now",
                "62 % of the motion needed is seen: more comes, or b builds now",
            ),
            case(
                "no number",
                accumulating(f64::NAN, moving),
                "0 % of the motion needed is seen: let it move, or b builds now",
                "0 % of the motion needed is seen: more comes, or b builds now",
            ),
            case("soon", accumulating(1.0, soon), built_soon, built_soon),
            case("stem", accumulating(1.0, moving), stem, stem),
            case(
                "build",
                snapshot(Phase::Build),
                "building the tree",
                "building the tree",
            ),
            case(
                "short",
                live(17.2),
                "3 of 9 branches have a frequency: film 18 s more for better ones",
                "3 of 9 branches have a frequency",
            ),
            case(
                "short without an answer",
                short,
                "the tree is there: film 18 s more for the branches' frequencies",
                sought,
            ),
            case(
                "short, at end",
                short_at_end,
                "the tree is there: film 4 s more; frequencies come at the end",
                told_at_end,
            ),
            case("at end", at_end, told_at_end, told_at_end),
            case("no answer", no_sway, sought, sought),
            case(
                "no frequency",
                unknown,
                "no frequency yet: pull the tree and release it, or film on in wind",
                "the tree is there: no branch has a frequency yet",
            ),
            case(
                "some frequencies",
                live(0.0),
                "3 of 9 branches have a frequency: film on for more, or q ends",
                "3 of 9 branches have a frequency",
            ),
            case(
                "all frequencies",
                known,
                "3 of 3 branches have a frequency: film on for more, or q ends",
                "3 of 3 branches have a frequency",
            ),
        ]
    }

    #[test]
    fn every_phase_says_what_it_waits_for() {
        for Case {
            name,
            snapshot,
            live,
            replayed,
        } in cases()
        {
            let mut state = of(snapshot.clone());
            check(name, &state, live);
            state.take(Arc::new(Snapshot {
                is_live: false,
                ..snapshot
            }));
            check(name, &state, replayed);
        }
        for phase in Phase::ALL {
            let is_there = cases().iter().any(|case| case.snapshot.phase == phase);
            assert!(is_there, "{phase:?}");
        }
    }

    #[test]
    fn what_stops_a_capture_comes_before_its_phase() {
        for phase in Phase::ALL {
            let mut state = of(snapshot(phase));
            let changed = |change: &dyn Fn(&mut Snapshot)| {
                let mut snapshot = snapshot(phase);
                change(&mut snapshot);
                Arc::new(snapshot)
            };
            state.take(changed(&|s| s.background = Some(Background::Lost)));
            check(
                "turned away",
                &state,
                "the camera was turned or covered: point it back, or r starts again",
            );
            state.paused = true;
            check("paused", &state, "paused: space goes on");
            state.drawing = Some(Drawing::of(Subject::Branch));
            check(
                "stroke",
                &state,
                "draw from a branch's base to its tip: click or space, then Enter",
            );
            state.drawing = Some(Drawing::of(Subject::Outline));
            check(
                "drawing",
                &state,
                "draw round the tree: click or space sets corners, Enter closes",
            );
            state.take(changed(&|s| {
                s.camera = CameraState {
                    away: Some("no frame for 3 s".into()),
                    ..CameraState::default()
                }
            }));
            check(
                "unplugged",
                &state,
                "the camera is gone: plug it in, and the capture goes on (no frame for 3 s)",
            );
            state.take(changed(&|s| s.ended = true));
            check(
                "over",
                &state,
                "finishing: tree and files are being completed",
            );
            state.take(changed(&|s| (s.ended, s.waits_for_room) = (true, true)));
            check(
                "full disk",
                &state,
                "the disk is full: make room, and the capture is written",
            );
            assert!(awaited(&state).is_trouble);
        }
        let mut quitting = of(snapshot(Phase::Live));
        quitting.quitting = true;
        check(
            "quitting",
            &quitting,
            "finishing: tree and files are being completed",
        );
    }

    /// Long times do not become long numbers.
    #[test]
    fn no_state_makes_a_line_without_an_end() {
        for left_s in [0.2, 99.9, 100.0, 1e300, f64::INFINITY] {
            let text = awaited(&of(live(left_s))).text;
            assert!(format::width(&text) <= ROOM, "{text}");
        }
        let mut huge = of(made_up::huge());
        huge.take(Arc::new(Snapshot {
            image_size: Some(Size::new(u32::MAX, 1)),
            ..made_up::huge()
        }));
        assert!(format::width(&awaited(&huge).text) <= ROOM);
    }
}
