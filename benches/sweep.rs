//! The tree over the published ranges of its settings: `make sweep`, or `make sweep CLIP="film
//! outline branches"`.
//!
//! Levels 4 to 7 and 10, 100 to 2,000 points, every n-th frame (Zeng); both ways of putting points
//! together. Prints a table in Markdown. `branches` is written by `scripts/branches-of-clip.py`;
//! without arguments the shipped recording.

#[path = "../tests/support/branches.rs"]
mod branches;

use arborcam::cancel::CancelToken;
use arborcam::config::{Affinity, Config};
use arborcam::model::{TimedFrame, TrackLog};
use arborcam::outline::Given;
use arborcam::pipeline::Pipeline;
use arborcam::solve::solve;
use arborcam::source;
use branches::{Births, Truth, triplets};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What has been seen of the clip when its tree is built.
struct Gathered {
    log: TrackLog,
    born: Births,
    built_s: f64,
}

fn gathered(
    clip: &Path,
    outline: &Path,
    points: u32,
    every: usize,
) -> (Gathered, Arc<arborcam::model::Outline>) {
    let mut config = Config::default();
    config.detect.points = points;
    // More points find room only if they may stand closer.
    config.detect.min_distance_px *= (400.0 / f64::from(points)).sqrt().min(1.0);
    let mut source = source::open(clip, &config, None).expect("clip");
    let given = arborcam::outline::load(outline, source.describe().size).expect("outline");
    let Given::Region(outline) = given else {
        panic!("the sweep takes a polygon or a mask, no scribbles")
    };
    let mut pipeline = Pipeline::new(&config, Some(outline.clone())).expect("decoder");
    let mut gathered = Gathered {
        log: TrackLog::new(config.accumulate.window_s),
        born: Births::default(),
        built_s: 0.0,
    };
    let (mut index, mut start_s) = (0, None);
    while let Some(raw) = source.next_frame().expect("frame") {
        index += 1;
        if (index - 1) % every != 0 {
            continue;
        }
        let start_s = *start_s.get_or_insert(raw.sensor_time_s);
        let timed = TimedFrame::new(Arc::new(raw), (index - 1) as u64, start_s, Instant::now());
        for moved in pipeline.step(&timed).expect("picture") {
            gathered.born.take_note(&moved.tracks);
            if pipeline.back.model().is_none() || gathered.built_s == 0.0 {
                gathered.log.push(moved.tracks);
            }
        }
        if let (Some(tree), 0.0) = (pipeline.back.model(), gathered.built_s) {
            gathered.built_s = tree.time_s;
        }
    }
    (gathered, Arc::new(outline))
}

fn row(
    gathered: &Gathered,
    outline: &Arc<arborcam::model::Outline>,
    truth: &Truth,
    what: &str,
    config: &Config,
) {
    let mut times = Vec::new();
    let mut tree = None;
    for _ in 0..5 {
        let start = Instant::now();
        tree = solve(&gathered.log, outline, None, config, &CancelToken::new());
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    let Some(tree) = tree else {
        println!("| {what} | – | no tree | | |");
        return;
    };
    let (_, share) = triplets(truth, &tree.hierarchy, &gathered.born);
    let nodes = tree.skeleton.measured();
    let points = tree.hierarchy.clusters[0].members.len();
    println!(
        "| {what} | {points} | {share:.3} | {nodes} | {:.0} |",
        times[2]
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    let or = |k: usize, default: &str| {
        arguments
            .get(k)
            .cloned()
            .unwrap_or_else(|| default.to_owned())
    };
    let clip = or(0, "recordings/sparse_winter.mkv");
    let outline = or(1, "recordings/sparse_winter.outline.json");
    let truth = Truth::read(Path::new(&or(2, branches::BRANCHES)));
    println!(
        "| settings | points in the tree | triplets | nodes | build, ms |\n|---|---|---|---|---|"
    );
    let default = Config::default();
    for (points, every) in [
        (400, 1),
        (100, 1),
        (200, 1),
        (800, 1),
        (1200, 1),
        (2000, 1),
        (400, 2),
        (400, 3),
        (400, 5),
    ] {
        let (gathered, outline) = gathered(Path::new(&clip), Path::new(&outline), points, every);
        let mut config = default.clone();
        let base = format!(
            "{points} points, every frame in {every}, built at {:.1} s",
            gathered.built_s
        );
        row(&gathered, &outline, &truth, &base, &config);
        if (points, every) == (400, 1) {
            for levels in [4, 5, 6, 10] {
                config.hierarchy.levels = levels;
                row(
                    &gathered,
                    &outline,
                    &truth,
                    &format!("{levels} levels"),
                    &config,
                );
            }
            config.hierarchy.levels = 7;
            for max_children in [2, 8] {
                config.hierarchy.max_children = max_children;
                row(
                    &gathered,
                    &outline,
                    &truth,
                    &format!("at most {max_children} children"),
                    &config,
                );
            }
            config = default.clone();
            for min_certainty in [0.0, 0.3, 0.7] {
                config.hierarchy.min_certainty = min_certainty;
                row(
                    &gathered,
                    &outline,
                    &truth,
                    &format!("certainty at least {min_certainty}"),
                    &config,
                );
            }
        }
        config = default.clone();
        (
            config.hierarchy.affinity,
            config.hierarchy.max_children,
            config.hierarchy.min_certainty,
        ) = (Affinity::Zeng, 2, 0.0);
        row(
            &gathered,
            &outline,
            &truth,
            "– the same, as in the papers",
            &config,
        );
    }
}
