//! How near to the truth the tracks of the shipped recording end.

mod support;
#[path = "support/truth.rs"]
mod truth;

use std::sync::Mutex;
use truth::{Score, Truth, tracks};

/// OpenCV must not be told another number of threads while it works; now and then it then dies.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// `make bench` has the textbook's way beside it (the same corners, forward and backward
/// Lucas-Kanade).
#[test]
fn the_tracks_end_where_the_points_truly_are() {
    let _alone = ONE_AT_A_TIME.lock();
    let (tracks, expected_px) = tracks();
    let Score {
        tracks: scored,
        within_2px,
        median_end_px,
    } = Truth::read().score(&tracks);
    println!(
        "{scored} tracks, within 2 px: {within_2px:.3}, median error {median_end_px:.2} px, expected {expected_px:.2} px"
    );
    assert!(
        scored >= 100,
        "{scored} tracks can be held against the truth"
    );
    assert!(within_2px >= 0.75, "within 2 px: {within_2px:.3}");
    assert!(median_end_px <= 1.0, "median error: {median_end_px:.2} px");
    // What the tracker says of itself means something.
    let as_said = (0.5..2.0).contains(&(expected_px / median_end_px));
    assert!(
        as_said,
        "expected {expected_px:.2} px, true {median_end_px:.2} px"
    );
}

/// The same film gives the same tracks on every machine, to the last bit.
#[test]
fn tracks_do_not_depend_on_how_many_cores_there_are() {
    let _alone = ONE_AT_A_TIME.lock();
    let with = |threads: i32| {
        opencv::core::set_num_threads(threads).expect("threads");
        tracks().0
    };
    let (one, three) = (with(1), with(3));
    assert!(one == three, "tracks differ with the number of threads");
}
