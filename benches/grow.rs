//! How long new trees take: `cargo bench --bench grow -- CAPTURE`, where CAPTURE is the folder of a
//! capture; by default that of the shipped recording is made.
//!
//! Each figure is printed on a line of its own with what is asked for.

#[path = "../tests/support/mod.rs"]
mod support;

use arborcam::document::Document;
use arborcam::model::Skeleton;
use arborcam::pipeline::reshape;
use arborcam::runtime::in_parallel;
use arborcam::shape::{Angles, Envelope, envelope_distance};
use arborcam::views::{
    Likeness, Offspring, OffspringMotion, OffspringOptions, Parent, example_outline,
};
use nalgebra::Point3;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Triangles of the wood and of the leaves of the tree that is written.
const TRIANGLES: u32 = 10_000;

/// Trees that are compared with the example.
const COMPARED: u64 = 60;

static GO_ON: AtomicBool = AtomicBool::new(false);

fn main() {
    let given = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let capture = given.map_or_else(|| support::replayed().to_owned(), PathBuf::from);
    let moving = parent(&capture, OffspringMotion::Example);
    let still = parent(&capture, OffspringMotion::AtRest);
    compare_in_space(&capture, &still);
    let skeleton_ms = median_ms(60, |k| drop(offspring(&still, k)));
    let motion_ms = median_ms(60, |k| drop(offspring(&moving, k)));
    println!("new skeleton: {skeleton_ms:.1} ms; with motion: {motion_ms:.1} ms (asked: 5 ms)");
    let dir = tempfile::tempdir().expect("tempdir");
    let written_ms = median_ms(20, |k| {
        let tree = offspring(&still, k);
        let to = dir.path().join(k.to_string());
        still
            .write(&to, tree, &AtomicBool::new(false))
            .expect("written");
    });
    println!("tree with mesh, leaves and files, at rest: {written_ms:.0} ms (asked: 150 ms)");
    for threads in [1, 2] {
        let from = Instant::now();
        let grow_one = |k: u64| -> Result<(), ()> {
            drop(offspring(&still, k));
            Ok(())
        };
        in_parallel(1000, threads, &GO_ON, &grow_one, &|_| {}).expect("grown");
        let took_s = from.elapsed().as_secs_f64();
        println!("1,000 skeletons, {threads} threads: {took_s:.1} s (asked: 5 s on two)");
    }
}

/// How well new trees fill the example's envelope (D of eq. 5, its D as a share of theirs), and how
/// likely their angles are (eq. 4, each with the usual angle of its own tree): medians, as shares of
/// the example's, which is stood up in the same way.
fn compare_in_space(capture: &Path, parent: &Parent) {
    let document = Document::read(capture, 0.0).expect("a capture");
    let config = &document.note.config;
    let outline = example_outline(&document).expect("an outline");
    let example = reshape(&document.skeleton, outline, config);
    let places: Vec<Point3<f64>> = example.nodes.iter().map(|n| n.position).collect();
    let envelope = Envelope::of_filmed(config.shape.envelope, outline, example.foot_px, &places);
    let distance_px =
        |tree: &Skeleton| envelope_distance(tree, &envelope, config.shape.attractors as usize);
    let likelihood = |tree: &Skeleton| Angles::of(tree, &config.shape).likelihood(tree);
    let (mut fillings, mut plausibilities) = (Vec::new(), Vec::new());
    for k in 1..=COMPARED {
        let tree = offspring(parent, k).skeleton;
        fillings.push(distance_px(&example) / distance_px(&tree));
        plausibilities.push(likelihood(&tree) / likelihood(&example));
    }
    println!(
        "filling of the envelope: {:.2} of the example's (asked: 0.9); plausibility of the angles: {:.2} (asked: 1.0)",
        median(fillings),
        median(plausibilities)
    );
}

fn parent(capture: &Path, motion: OffspringMotion) -> Parent {
    let mut config = Document::note(capture).expect("a capture").config;
    config.wood.triangles = TRIANGLES;
    config.leaves.triangles = TRIANGLES;
    let document = Document::read(capture, config.export.animation_s).expect("a capture");
    let options = OffspringOptions {
        likeness: Likeness::Forks,
        motion,
        region: None,
        config,
    };
    Parent::new(document, options).expect("an example")
}

fn offspring(parent: &Parent, number: u64) -> Offspring {
    parent.offspring(1, number).expect("a tree")
}

/// The median time of a piece of work, ms, over so many numbers from 1 on.
fn median_ms(times: u64, mut work: impl FnMut(u64)) -> f64 {
    let mut all_ms = Vec::new();
    for k in 1..=times {
        let from = Instant::now();
        work(k);
        all_ms.push(1e3 * from.elapsed().as_secs_f64());
    }
    median(all_ms)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
