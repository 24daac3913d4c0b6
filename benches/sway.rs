//! What the sway costs, and with `-- DIR` the signals of made-up trees and our answers as tables,
//! for
//! `benches/sway_pyoma.py`, which has pyOMA2 answer the same.

#[path = "../tests/made_trees/mod.rs"]
mod made_trees;

use arborcam::cancel::CancelToken;
use arborcam::config::Dynamics;
use arborcam::dynamics::{Depth, analyse};
use made_trees::{Drive, Filming, MadeTree};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

fn main() {
    let dir = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    if let Some(Err(e)) = dir.as_ref().map(std::fs::create_dir_all) {
        println!("{}: {e}", dir.unwrap_or_default());
        return;
    }
    // Even times and no gaps: the other side needs them.
    let filming = Filming {
        seconds: 30.0,
        jitter: 0.0,
        lost: 0.0,
        gaps: 0.0,
        ..Filming::default()
    };
    for (name, drive) in [
        ("release", Drive::Release(0.5)),
        ("decay", Drive::Decay),
        ("wind", Drive::Wind),
    ] {
        let mut answers =
            String::from("tree,branch,modes,true_hz,true_damping,hz,lo_hz,hi_hz,damping\n");
        let (mut took_s, mut branches) = (0.0, 0);
        for seed in 0..20 {
            let tree = MadeTree::new(1000 + seed, drive, &filming);
            let start = Instant::now();
            let sway = analyse(
                &tree.skeleton,
                &tree.film,
                &Dynamics::default(),
                Depth::Full,
                &CancelToken::new(),
            )
            .sway;
            took_s += start.elapsed().as_secs_f64();
            branches += tree.branches.len();
            for (k, b) in tree.branches.iter().enumerate() {
                let modes = std::iter::successors(Some(k), |&i| tree.branches[i].parent).count();
                let _ = write!(
                    answers,
                    "{seed},{k},{modes},{},{}",
                    b.frequency_hz, b.damping
                );
                let _ = match &sway[k + 1] {
                    Ok(s) => {
                        let (f, d) = (
                            s.frequency_hz,
                            s.damping_ratio.map_or(f64::NAN, |d| d.value),
                        );
                        writeln!(answers, ",{},{},{},{d}", f.value, f.lo, f.hi)
                    }
                    Err(_) => writeln!(answers, ",,,,"),
                };
            }
            if let Some(dir) = &dir {
                let mut text = String::from("branch,frame,time_s,point,u_px,v_px\n");
                for (p, track) in tree.film.tracks.iter().enumerate() {
                    for (k, (t, at)) in tree.film.times_s.iter().zip(&track.at_px).enumerate() {
                        let _ =
                            writeln!(text, "{},{k},{t},{p},{},{}", track.node.0 - 1, at.x, at.y);
                    }
                }
                save(&Path::new(dir).join(format!("{name}_{seed:02}.csv")), &text);
            }
        }
        println!(
            "{name}: {:.0} ms a tree of 30 s, {:.1} ms a branch",
            took_s * 50.0,
            took_s * 1e3 / branches as f64
        );
        if let Some(dir) = &dir {
            save(&Path::new(dir).join(format!("{name}.csv")), &answers);
        }
    }
}

fn save(path: &Path, text: &str) {
    if let Err(e) = std::fs::write(path, text) {
        eprintln!("{}: {e}", path.display());
    }
}
