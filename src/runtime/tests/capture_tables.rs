//! The tables do not depend on when and in how many pieces they are written.

use super::*;
use crate::model::{Observation, Outline, Size};
use crate::recording::TrackFile;
use crate::solve::solve;
use nalgebra::{Point2, Vector2};
use std::f64::consts::TAU;
use std::time::Duration;

const RATE_HZ: f64 = 30.0;
/// The tree is built with this frame.
const BUILT: u64 = 200;
const FRAMES: u64 = 420;
const FOOT: Point2<f64> = Point2::new(160.0, 230.0);
const POINTS_PER_LIMB: u32 = 24;
/// Tips of the limbs as seen from the foot (px), and the frequencies at which they swing (Hz).
const LIMBS: [(Vector2<f64>, f64); 3] = [
    (Vector2::new(0.0, -180.0), 0.5),
    (Vector2::new(-100.0, -140.0), 1.1),
    (Vector2::new(110.0, -150.0), 1.6),
];
/// Does not pass its trial.
const REJECTED: TrackId = TrackId(5);

/// Limbs that swing about the foot.
fn tracks(frame: u64) -> TrackSet {
    let time_s = frame as f64 / RATE_HZ;
    let mut observations = Vec::new();
    for (k, (tip, hz)) in (0..).zip(LIMBS) {
        let (sin, cos) = (0.08 * (TAU * hz * time_s).sin()).sin_cos();
        for i in 0..POINTS_PER_LIMB {
            let share = f64::from(i + 1) / f64::from(POINTS_PER_LIMB);
            let id = TrackId(k * POINTS_PER_LIMB + i);
            observations.push(Observation {
                id,
                u_px: (FOOT.x + share * (cos * tip.x - sin * tip.y)) as f32,
                v_px: (FOOT.y + share * (sin * tip.x + cos * tip.y)) as f32,
                fb_error_px: 0.05,
                error_px: None,
                confirmed: frame > 20 && id != REJECTED,
                depth: None,
            });
        }
    }
    let mut rejected = Vec::new();
    if frame == 100 {
        rejected.push(REJECTED);
    }
    if frame >= 100 {
        observations.retain(|o| o.id != REJECTED);
    }
    TrackSet {
        frame,
        time_s,
        observations,
        rejected,
        ..TrackSet::default()
    }
}

fn model(config: &Config) -> Arc<Model> {
    let size = Size::new(320, 240);
    let outline = Arc::new(Outline {
        size,
        mask: vec![u8::MAX; size.area()],
        polygon_px: Vec::new(),
        matte: None,
        other_foot_px: None,
    });
    let mut log = TrackLog::new(config.accumulate.window_s);
    (0..=BUILT).for_each(|frame| drop(log.push(tracks(frame))));
    let model = solve(&log, &outline, None, config, &CancelToken::new());
    Arc::new(model.expect("a tree"))
}

/// The tables, after `write` has written what it wanted of them.
fn written(
    log: &TrackFileReader,
    model: &Arc<Model>,
    config: &Config,
    write: impl FnOnce(&mut CaptureTables),
) -> [Vec<u8>; 3] {
    let dir = tempfile::tempdir().expect("tempdir");
    let mut tables =
        CaptureTables::create(&dir.path().join("out"), model, config, None).expect("tables");
    write(&mut tables);
    let cancel = CancelToken::new();
    tables.catch_up(log, &cancel).expect("rows");
    let done = tables.finish(log, &cancel).expect("rows");
    ["tracks.csv", "left_out.csv", "motion.csv"]
        .map(|name| std::fs::read(done.folder.path(name)).expect(name))
}

#[test]
fn tables_that_were_cut_anywhere_are_those_written_at_once() {
    let config = Config::default();
    let model = model(&config);
    let mut file = TrackFile::nameless(&std::env::temp_dir()).expect("file");
    (0..FRAMES).for_each(|frame| file.push(&tracks(frame)).expect("room"));
    let log = file.reader().expect("file");

    let whole = written(&log, &model, &config, |_| ());
    let rows = |table: usize| whole[table].iter().filter(|b| **b == b'\n').count();
    let per_frame = LIMBS.len() * POINTS_PER_LIMB as usize - 1;
    let n_out = model.left_out.len();
    assert!(n_out > 0, "some points are left out");
    assert_eq!(rows(0), 1 + (per_frame - n_out) * FRAMES as usize);
    assert_eq!(rows(1), 1 + n_out * FRAMES as usize);

    let (mut early, mut late) = (0, 0);
    let cut = written(&log, &model, &config, |tables| {
        for k in 0..4000 {
            let cancel = CancelToken::new();
            cancel.cancel_at(std::time::Instant::now() + Duration::from_micros(20 + k % 50));
            tables.catch_up(&log, &cancel).expect("rows");
            match tables.early {
                EarlyRows::Cut(_) => early += 1,
                EarlyRows::Written => late += 1,
                EarlyRows::NotBegun => {}
            }
        }
    });
    assert!(early > 0 && late > 0, "cut {early} and {late} times");
    assert!(cut == whole, "the tables differ");
}
