//! How long new trees take: `cargo bench --bench grow -- CAPTURE`, where CAPTURE is the folder of a
//! capture; by default that of the shipped recording is made.
//!
//! Each figure is printed on a line of its own with what is asked for.

#[path = "../tests/support/mod.rs"]
mod support;

use arborcam::document::Document;
use arborcam::runtime::in_parallel;
use arborcam::views::{Likeness, Offspring, OffspringMotion, OffspringOptions, Parent};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Triangles of the wood and of the leaves of the tree that is written.
const TRIANGLES: u32 = 10_000;

static GO_ON: AtomicBool = AtomicBool::new(false);

fn main() {
    let given = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let capture = given.map_or_else(|| support::replayed().to_owned(), PathBuf::from);
    let moving = parent(&capture, OffspringMotion::Example);
    let still = parent(&capture, OffspringMotion::AtRest);
    let skeleton_ms = median_ms(60, |k| drop(offspring(&still, k)));
    let motion_ms = median_ms(60, |k| drop(offspring(&moving, k)));
    println!("new skeleton: {skeleton_ms:.1} ms; with motion: {motion_ms:.1} ms (asked: 5 ms)");
    let dir = tempfile::tempdir().expect("tempdir");
    let written_ms = median_ms(20, |k| {
        let tree = offspring(&still, k);
        let to = dir.path().join(k.to_string());
        drop(still.write(&to, tree).expect("written"));
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
    all_ms.sort_by(f64::total_cmp);
    all_ms[all_ms.len() / 2]
}
