//! When a sway is asked for and told: with analysers whose slowness is known.

use super::super::pulse::{Sign, Vigil};
use super::*;
use crate::cancel::CancelToken;
use crate::config::Dynamics;
use crate::model::{Angles, Skeleton, TrackLog, TrackSet};
use nalgebra::Point2;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// What hangs has not come back after so long.
const HANGS: Duration = Duration::from_secs(20);

fn job(time_s: f64) -> SwayJob {
    SwayJob {
        frame: (30.0 * time_s).round() as u64,
        time_s,
        skeleton: Arc::new(Skeleton {
            nodes: Vec::new(),
            foot_px: Point2::origin(),
            image_size: crate::model::Size::new(64, 64),
        }),
        log: TrackLog::new(10.0),
        nodes: BTreeMap::new(),
        angles: Angles::default(),
        settings: Dynamics::default(),
    }
}

fn answer(job: &SwayJob) -> SwayNow {
    SwayNow {
        frame: job.frame,
        time_s: job.time_s,
        ..SwayNow::default()
    }
}

fn at_once(job: &SwayJob, _: &CancelToken) -> SwayNow {
    answer(job)
}

fn slow(job: &SwayJob, cancel: &CancelToken) -> SwayNow {
    takes(Duration::from_millis(300), cancel);
    answer(job)
}

/// Slower than the machine that looks at it, however busy that is.
fn very_slow(job: &SwayJob, cancel: &CancelToken) -> SwayNow {
    takes(Duration::from_secs(3), cancel);
    answer(job)
}

fn endless(job: &SwayJob, cancel: &CancelToken) -> SwayNow {
    takes(Duration::MAX, cancel);
    answer(job)
}

/// So long, or until it is given up.
fn takes(time: Duration, cancel: &CancelToken) {
    let began = Instant::now();
    while began.elapsed() < time && !cancel.is_cancelled() {
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn of(analyser: Analyser, waits: bool) -> (Swaying, Arc<Shared>) {
    let shared = Arc::new(Shared::default());
    let background = Background::start("test", false, shared.clone()).expect("a thread");
    let swaying = Swaying::new(1.0, waits, analyser, background, shared.clone());
    (swaying, shared)
}

/// Steps through a film of 30 frames a second; the answers, with the frame at which each took
/// effect.
fn film(swaying: &mut Swaying, frames: std::ops::Range<u64>) -> Vec<(u64, u64)> {
    let mut told = Vec::new();
    for frame in frames {
        let time_s = frame as f64 / 30.0;
        told.extend(
            swaying
                .step(time_s, || Some(job(time_s)))
                .map(|found| (frame, found.frame)),
        );
    }
    told
}

/// What was begun has been given up, so that the thread has time for other work; fails if it goes
/// on.
fn over(mut swaying: Swaying) {
    swaying.end();
    let (done, is_done) = crossbeam_channel::bounded(1);
    let next = move |_: &CancelToken| {
        let _ = done.send(());
    };
    let _next = swaying
        .background
        .begin(CancelToken::new(), next)
        .expect("room");
    assert_eq!(is_done.recv_timeout(HANGS), Ok(()), "the work goes on");
}

/// The same recording gives the same answers in the same frames, however slow the machine is.
#[test]
fn a_replay_waits_for_every_answer_where_it_is_due() {
    for analyser in [at_once as Analyser, slow] {
        let (mut swaying, _) = of(analyser, true);
        assert_eq!(
            film(&mut swaying, 0..130),
            [(30, 0), (60, 30), (90, 60), (120, 90)]
        );
        assert_eq!(swaying.passed_over(), 0);
    }
}

/// Of 30 s of film the next analysis is due 3 s later, of 60 s 6 s later; the answer comes as soon as
/// before.
#[test]
fn a_longer_film_is_analysed_less_often() {
    let (mut swaying, _) = of(at_once, true);
    let mut told = Vec::new();
    for second in [30, 31, 32, 33, 34, 60, 61, 65, 66, 67] {
        let time_s = f64::from(second);
        let mut long = job(time_s);
        long.log = TrackLog::new(100.0);
        for (frame, time_s) in [(0, 0.0), (long.frame, time_s)] {
            long.log.push(TrackSet {
                frame,
                time_s,
                ..TrackSet::default()
            });
        }
        let found = swaying.step(time_s, || Some(long));
        told.extend(found.map(|found| (second, found.time_s)));
    }
    assert_eq!(told, [(31, 30.0), (34, 33.0), (61, 60.0), (67, 66.0)]);
}

#[test]
fn a_camera_waits_for_no_answer_and_what_is_passed_over_is_counted() {
    let (mut swaying, _) = of(very_slow, false);
    let began = Instant::now();
    assert_eq!(film(&mut swaying, 0..151), [], "nothing is ready so soon");
    assert!(
        began.elapsed() < Duration::from_secs(1),
        "151 frames took {:?}",
        began.elapsed()
    );
    assert_eq!(
        swaying.passed_over(),
        5,
        "one at each second after the first"
    );
    let began = Instant::now();
    let mut frame = 151;
    let told = loop {
        assert!(began.elapsed() < HANGS, "never told");
        std::thread::sleep(Duration::from_millis(20));
        let told = film(&mut swaying, frame..frame + 30);
        frame += 30;
        if !told.is_empty() {
            break told;
        }
    };
    // It is reported at a moment at which one is due, and is from the frame in which it was
    // asked for.
    assert_eq!((told.len(), told[0].0 % 30, told[0].1), (1, 0, 0));
    over(swaying);
}

/// Who asks for the end must not wait for an analysis, and nothing of it goes on afterwards.
#[test]
fn a_wish_to_stop_breaks_a_wait_off() {
    let (mut swaying, shared) = of(endless, true);
    let wish = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(50));
        shared.stop_at_once();
    });
    let began = Instant::now();
    assert_eq!(film(&mut swaying, 0..200), []);
    assert!(began.elapsed() < HANGS);
    wish.join().expect("the wish");
    over(swaying);
}

/// An answer about the points from before a restart would be told of other branches.
#[test]
fn a_restart_forgets_what_is_under_way() {
    let (mut swaying, _) = of(slow, true);
    assert_eq!(film(&mut swaying, 0..10), []);
    swaying.restart();
    assert_eq!(film(&mut swaying, 300..340), [(330, 300)]);
    over(swaying);
}

#[test]
fn without_an_interval_nobody_is_asked() {
    let shared = Arc::new(Shared::default());
    let background = Background::start("test", false, shared.clone()).expect("a thread");
    let mut swaying = Swaying::new(0.0, true, |_, _| panic!("asked"), background, shared);
    assert_eq!(film(&mut swaying, 0..200), []);
    over(swaying);
}

/// The capture goes on, other work is done, and the end says that something is wrong.
#[test]
fn a_panic_is_not_waited_for() {
    let (mut swaying, shared) = of(|_, _| std::panic::resume_unwind(Box::new("broken")), true);
    assert_eq!(film(&mut swaying, 0..100), []);
    over(swaying);
    assert!(shared.panicked.load(Ordering::Relaxed));
    // A supervisor of the capture must not take it for one that hangs, and end it.
    let mut vigil = Vigil::default();
    let looks = [1, 2].map(|frames| vigil.look(shared.pulse.marks(frames, false)));
    assert_eq!(looks[1], Sign::Flows);
}
