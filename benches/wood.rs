//! The wood that a clip shows: `cargo bench --bench wood -- CLIP OUT`, with `video.mkv` and
//! `outline.json` in the folder CLIP. Prints the time that it takes, and writes `wood.png`,
//! `leaves.png`, `rest.png` and `branches.csv` to OUT.

use arborcam::cancel::CancelToken;
use arborcam::config::Config;
use arborcam::document::at_rest_files;
use arborcam::model::{Outline, TimedFrame};
use arborcam::outline::{self, Given};
use arborcam::pipeline::{FilmLog, Pipeline, find_wood};
use arborcam::source;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

fn main() {
    let folders: Vec<PathBuf> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .map(PathBuf::from)
        .collect();
    let [clip, out] = &folders[..] else {
        println!("wood: no clip given; see the head of benches/wood.rs");
        return;
    };
    std::fs::create_dir_all(out).expect("a folder");
    look(clip, out);
}

fn look(clip: &Path, out: &Path) {
    let config = Config::default();
    let mut film =
        source::open(&clip.join("video.mkv"), &Config::default(), None).expect("video.mkv");
    let mut outline: Option<Outline> = None;
    let mut pipeline: Option<Pipeline> = None;
    let mut log = FilmLog::new(config.accumulate.window_s);
    let mut first_s = None;
    let mut index = 0;
    while let Some(raw) = film.next_frame().expect("a frame") {
        let raw = Arc::new(raw);
        let drawn = outline.get_or_insert_with(|| drawn(clip, &raw));
        let pipeline = pipeline
            .get_or_insert_with(|| Pipeline::new(&config, Some(drawn.clone())).expect("decoder"));
        let first_s = *first_s.get_or_insert(raw.sensor_time_s);
        let timed = TimedFrame::new(raw.clone(), index, first_s, Instant::now());
        for moved in pipeline.step(&timed).expect("a picture") {
            log.push(raw.clone(), &moved.tracks);
        }
        index += 1;
    }
    let (Some(mut pipeline), Some(outline)) = (pipeline, outline) else {
        println!("wood: an empty film");
        return;
    };
    pipeline.finish();
    let Some(model) = pipeline.back.model().cloned() else {
        println!("wood: no tree");
        return;
    };
    let window = pipeline.back.log().last(config.accumulate.window_s);
    let began = Instant::now();
    let never = CancelToken::new();
    let settings = &config.skeleton;
    let found = find_wood(&log, window, &outline, &model.plain, settings, &never);
    let took_s = began.elapsed().as_secs_f64();
    let Some(found) = found else {
        println!("wood: none seen, {took_s:.2} s");
        return;
    };
    let at_rest = found.at_rest.as_ref().expect("pictures at rest");
    for file in at_rest_files(at_rest).expect("files") {
        std::fs::write(out.join(file.name), file.bytes).expect(file.name);
    }
    let mut table = String::from("node,parent,u_px,v_px,radius_px\n");
    for (k, node) in found.branches.nodes.iter().enumerate() {
        let parent = node.parent.map_or(String::new(), |p| p.to_string());
        let (at, radius) = (node.position_px, node.radius_px);
        let _ = writeln!(table, "{k},{parent},{},{},{radius}", at.x, at.y);
    }
    std::fs::write(out.join("branches.csv"), table).expect("branches.csv");
    println!(
        "wood: {} nodes, {:.0} px of branches, {took_s:.2} s",
        found.branches.nodes.len(),
        found.branches.length_px()
    );
}

fn drawn(clip: &Path, raw: &arborcam::model::RawFrame) -> Outline {
    match outline::load(&clip.join("outline.json"), raw.size).expect("outline.json") {
        Given::Region(outline) => outline,
        Given::Scribbles(_) => panic!("a polygon"),
    }
}
