//! Lines along branches that come while it films: the wood is looked for again with them, and
//! nothing starts anew.

#[path = "support/strokes.rs"]
mod strokes;
mod support;

use arborcam::cancel::CancelToken;
use arborcam::config::Config;
use arborcam::model::{BranchGraph, Node, RawFrame};
use arborcam::pipeline::{BackEnd, Followed, Pipeline};
use arborcam::solve::Model;
use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};
use strokes::{ACROSS, ALONG_SKY, covered};

/// A run on the recording in which the tree is built after 4 s, along its wood 2 s later, and never
/// refined by itself.
fn pipeline() -> Pipeline {
    let mut config = Config::default();
    (config.accumulate.min_s, config.accumulate.threshold) = (4.0, 0.2);
    config.accumulate.refine_s = 0.0;
    Pipeline::new(&config, Some(support::outline())).expect("decoder")
}

/// More could not be read back with the capture.
#[test]
fn no_more_lines_are_taken_than_a_capture_holds() {
    let mut back = pipeline().back;
    for _ in 0..200 {
        back.add_stroke(ACROSS.to_vec()).expect("taken");
    }
    let refused = back.add_stroke(ALONG_SKY.to_vec()).expect_err("too many");
    assert!(refused.to_string().contains("at most 200 lines"));
    assert_eq!(back.strokes_px(), vec![ACROSS.to_vec(); 200]);
}

fn film(pipeline: &mut Pipeline, frames: std::ops::Range<usize>) {
    for k in frames {
        pipeline.step(&support::timed(k)).expect("picture");
    }
}

fn model(pipeline: &Pipeline) -> &Model {
    pipeline.back.model().expect("a tree")
}

#[test]
fn a_stroke_that_comes_when_no_refinement_is_left_is_used_and_can_be_taken_back() {
    let mut pipeline = pipeline();
    film(&mut pipeline, 0..200);
    let before = model(&pipeline).clone();
    assert!(before.wood.is_some() && pipeline.back.job().is_none());
    assert_eq!(covered(&before, ACROSS), 0);

    for stroke in [ACROSS, ALONG_SKY] {
        pipeline.back.add_stroke(stroke.to_vec()).expect("a line");
    }
    film(&mut pipeline, 200..290);
    let with = model(&pipeline).clone();
    assert!(covered(&with, ACROSS) >= 7, "{}", covered(&with, ACROSS));
    assert_eq!((before.refinements, with.refinements), (0, 1));
    assert_eq!((with.first, with.frame), (before.first, 200));
    let oldest = pipeline.back.log().all().first().expect("tracks");
    assert_eq!(oldest.frame, 0, "points are followed on");

    // One that comes too late for the film is used at its end.
    assert!(pipeline.back.take_back_stroke() && pipeline.back.take_back_stroke());
    assert!(!pipeline.back.take_back_stroke() && pipeline.back.has_unused_strokes());
    film(&mut pipeline, 290..300);
    pipeline.finish();
    assert_eq!(covered(model(&pipeline), ACROSS), 0);
    assert_eq!(model(&pipeline).refinements, 2);
    assert!(!pipeline.back.has_unused_strokes());
}

#[test]
fn a_stroke_that_comes_while_the_first_wood_is_looked_for_is_used_at_once() {
    let mut pipeline = pipeline();
    film(&mut pipeline, 0..150);
    let dropped = pipeline.back.job().expect("the wood is looked for").clone();
    pipeline.back.add_stroke(ACROSS.to_vec()).expect("a line");
    film(&mut pipeline, 150..151);
    let job = pipeline.back.job().expect("it is looked for again");
    assert!(!Arc::ptr_eq(job, &dropped));
    film(&mut pipeline, 151..240);
    assert!(covered(model(&pipeline), ACROSS) >= 7);
    assert_eq!(
        model(&pipeline).refinements,
        0,
        "it is still the first tree"
    );
}

/// A run in which a line is drawn after some frames of the recording, and the tree is refined by
/// itself, too. `raw_of` is what is kept of a frame.
fn run(drawn_after: &[u64], raw_of: impl Fn(&Followed) -> Option<Arc<RawFrame>>) -> BackEnd {
    let mut config = Config::default();
    (config.accumulate.min_s, config.accumulate.threshold) = (4.0, 0.2);
    let mut back = BackEnd::new(&config);
    for followed in followed() {
        back.step(Followed {
            raw: raw_of(followed),
            ..followed.clone()
        });
        if drawn_after.contains(&followed.tracks.frame) {
            back.add_stroke(ACROSS.to_vec()).expect("a line");
        }
    }
    back.finish(&CancelToken::new());
    back
}

/// What `arborcam finish` makes of that run's log, told that lines were drawn after these frames.
fn finished(run: &BackEnd, asked: BTreeSet<u64>) -> BackEnd {
    let mut config = Config::default();
    (config.accumulate.min_s, config.accumulate.threshold) = (4.0, 0.2);
    config.skeleton.strokes_px = run.strokes_px().to_vec();
    let mut back = BackEnd::new(&config);
    back.put_wood(run.wood().clone());
    back.put_asked(asked);
    for followed in followed() {
        back.step(Followed {
            raw: None,
            ..followed.clone()
        });
    }
    back.finish(&CancelToken::new());
    back
}

/// Every frame of the recording as it comes to the back end.
fn followed() -> &'static [Followed] {
    static FOLLOWED: OnceLock<Vec<Followed>> = OnceLock::new();
    FOLLOWED.get_or_init(|| {
        let mut pipeline = pipeline();
        let mut all = Vec::new();
        for k in 0..support::recording().len() {
            let frame = pipeline.decode.step(&support::timed(k), None);
            all.extend(pipeline.front.step(frame.expect("picture")));
        }
        all.extend(pipeline.front.flush());
        all
    })
}

/// A frame that cannot be decoded: no wood is found in it.
fn unreadable(followed: &Followed) -> Option<Arc<RawFrame>> {
    let raw = RawFrame {
        bytes: vec![0; 9],
        ..RawFrame::clone(followed.raw.as_ref()?)
    };
    Some(Arc::new(raw))
}

/// What of a model the files of its capture depend on.
#[derive(Debug, PartialEq)]
struct Told {
    frame: u64,
    shown_from: u64,
    followed_from: u64,
    refinements: u32,
    wood: Option<BranchGraph>,
    nodes: Vec<Node>,
}

fn told(back: &BackEnd) -> Told {
    let model = back.model().expect("a tree");
    Told {
        frame: model.frame,
        shown_from: model.shown_from,
        followed_from: model.followed_from,
        refinements: model.refinements,
        wood: model.wood.as_ref().map(|wood| wood.branches.clone()),
        nodes: model.skeleton.nodes.clone(),
    }
}

/// When lines were drawn does not follow from the wood that was found, where none was, or only
/// that of the first tree.
#[test]
fn a_log_is_finished_as_its_run_whenever_lines_were_drawn() {
    let readable = |followed: &Followed| followed.raw.clone();
    // Whether it can be known by other means.
    for (name, run, is_known) in [
        ("the first wood is sought", run(&[175], readable), false),
        ("nothing is found", run(&[200], unreadable), false),
        ("at the end", run(&[329], readable), true),
        ("twice", run(&[170, 215], readable), true),
    ] {
        assert!(!run.asked().is_empty(), "{name}");
        let finished_as_told = finished(&run, run.asked().clone());
        assert_eq!(told(&finished_as_told), told(&run), "{name}");
        if !is_known {
            let untold = finished(&run, BTreeSet::new());
            assert!(
                told(&untold) != told(&run),
                "{name}: it makes no difference"
            );
        }
    }
}

#[test]
fn strokes_outlive_a_restart_and_no_line_is_none() {
    let mut pipeline = pipeline();
    pipeline.back.add_stroke(ACROSS.to_vec()).expect("a line");
    for bad in [vec![], vec![[4.0, 4.0]], vec![[4.0, f64::NAN], [9.0, 9.0]]] {
        assert!(pipeline.back.add_stroke(bad).is_err());
    }
    pipeline.back.restart();
    assert_eq!(pipeline.back.strokes_px(), [ACROSS.to_vec()]);
}
