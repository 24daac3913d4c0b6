//! The shipped recording filmed with the skeleton along the wood: the tree in the capture is the one
//! in the film, and every command reads it.

use crate::support;
use std::path::Path;
use std::process::Command;

fn arborcam(args: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .args(args)
        .output()
        .expect("arborcam");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {said}");
}

/// A row of `nodes.csv`.
struct Row {
    name: String,
    parent: String,
    kind: String,
    moves_with: String,
    at_px: [f64; 2],
}

fn rows(capture: &Path) -> Vec<Row> {
    let text = std::fs::read_to_string(capture.join("nodes.csv")).expect("nodes.csv");
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let column = |name: &str| head.iter().position(|h| *h == name).expect("a column");
    let mut rows = Vec::new();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let cell = |name: &str| cells[column(name)].to_owned();
        let px = |name: &str| cell(name).parse().expect("a number");
        rows.push(Row {
            name: cell("node_id"),
            parent: cell("parent_id"),
            kind: cell("kind"),
            moves_with: cell("moves_with"),
            at_px: [px("u_px"), px("v_px")],
        });
    }
    rows
}

#[test]
fn the_skeleton_runs_along_the_wood_and_the_capture_is_whole() {
    let dir = tempfile::tempdir().expect("tempdir");
    let tree = support::replayed();
    let capture = tree.to_str().expect("a path");
    let rows = rows(tree);
    let traced: Vec<&Row> = rows.iter().filter(|r| r.kind == "traced").collect();
    assert!(traced.len() >= 40, "{} traced nodes", traced.len());
    assert!(traced.iter().all(|r| !r.moves_with.is_empty()));
    assert!(
        rows.iter()
            .all(|r| r.kind == "traced" || r.kind == "copy" || r.moves_with.is_empty())
    );
    // No joint is far from the next: branches are followed, not spanned.
    let mut lengths: Vec<f64> = Vec::new();
    for row in &traced {
        let parent = rows
            .iter()
            .find(|r| r.name == row.parent)
            .expect("a parent");
        let [u, v] = [0, 1].map(|c| row.at_px[c] - parent.at_px[c]);
        lengths.push(u.hypot(v));
    }
    lengths.sort_by(f64::total_cmp);
    assert!(lengths[lengths.len() / 2] < 30.0, "{lengths:?}");

    let glb = dir.path().join("again.glb").display().to_string();
    arborcam(&["export", capture, "--format", "glb", "--out", &glb]);
    let bytes = |path: &Path| std::fs::read(path).expect("a file");
    assert!(bytes(Path::new(&glb)) == bytes(&tree.join("tree.glb")));
    arborcam(&["analyze", capture]);
    let picture = dir.path().join("tree.png").display().to_string();
    arborcam(&["render", capture, "--out", &picture]);
    let wind = dir.path().join("wind.glb").display().to_string();
    arborcam(&[
        "animate",
        capture,
        "--wind",
        "4",
        "--seconds",
        "2",
        "--out",
        &wind,
    ]);
}
