//! Scans of two real trees: `make test-real` fetches them (test data of ITSMe, MIT).

use arborcam::document::Document;
use arborcam::model::NodeId;
use std::path::Path;
use std::process::Command;

/// A scan, the height of its points and the diameter of a circle through those from 1.27 to 1.33 m
/// above the lowest, m.
struct Scan {
    file: &'static str,
    height_m: f64,
    breast_diameter_m: f64,
}

const SCANS: [Scan; 2] = [
    Scan {
        file: "target/real/tree_1_pc.txt",
        height_m: 22.78,
        breast_diameter_m: 0.151,
    },
    Scan {
        file: "target/real/tree_2_pc.txt",
        height_m: 18.35,
        breast_diameter_m: 0.319,
    },
];
const BREAST_HEIGHT_M: f64 = 1.3;

#[test]
#[ignore = "make test-real fetches the scans"]
fn scans_of_real_trees_have_their_height_and_girth() {
    for scan in SCANS {
        assert!(Path::new(scan.file).exists(), "scripts/fetch-real-cloud.sh");
        let dir = tempfile::tempdir().expect("tempdir");
        let out = dir.path().join("tree");
        let mut command = Command::new(env!("CARGO_BIN_EXE_arborcam"));
        let command = command.args(["cloud", scan.file]).arg("--out").arg(&out);
        let output = command.output().expect("arborcam");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        println!("{said}");
        // One tree, not a plot.
        let tree = Document::read(&out, 60.0).expect("a document");
        let metres = tree.note.config.export.metres_per_px;
        let nodes = &tree.skeleton.nodes;
        let height_m = metres * nodes.iter().map(|n| n.position.y).fold(0.0, f64::max);
        assert!(
            (height_m / scan.height_m - 1.0).abs() < 0.02,
            "{height_m} m"
        );
        let breast = (1..nodes.len() as u32).map(NodeId).find(|n| {
            let end = &nodes[n.index()];
            let begin = end.parent.map_or(0.0, |p| nodes[p.index()].position.y);
            let [begin, end] = [begin, end.position.y].map(|y| metres * y);
            begin <= BREAST_HEIGHT_M && BREAST_HEIGHT_M < end
        });
        let diameter_m = 2.0 * metres * nodes[breast.expect("a trunk").index()].radius;
        println!(
            "{}: {height_m:.2} m high, {diameter_m:.3} m thick",
            scan.file
        );
        let off = diameter_m / scan.breast_diameter_m - 1.0;
        assert!(off.abs() < 0.1, "{diameter_m} m");
    }
}
