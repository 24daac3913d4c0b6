//! `arborcam cloud`: a tree from a point cloud, its tables, and what bad clouds get.

use crate::chance::Chance;
use crate::support::{names_in, replayed};
use crate::to_folder::{BAD_USAGE, FAILED, NO_INPUT, arborcam, done, records};
use arborcam::document::{Document, ForestDocument};
use arborcam::import::{CloudFormat, read_cloud, read_model};
use arborcam::model::{NodeId, NodeKind};
use nalgebra::{Point2, Point3, Rotation3, Vector2, Vector3};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::BufReader;
use std::path::Path;

/// A tapered tube: its ends, and its radii there, m.
type Tube = ([f64; 3], [f64; 3], f64, f64);

/// A trunk of 5 m with three limbs, one of which bears a fourth.
const TUBES: [Tube; 5] = [
    ([0.0, 0.0, 0.0], [0.2, 0.0, 5.0], 0.15, 0.05),
    ([0.06, 0.0, 1.5], [1.6, 0.3, 3.5], 0.07, 0.02),
    ([0.1, 0.0, 2.5], [-1.4, 0.8, 4.4], 0.06, 0.02),
    ([0.14, 0.0, 3.4], [0.4, -1.5, 4.8], 0.05, 0.02),
    ([0.83, 0.15, 2.5], [1.2, 1.2, 3.4], 0.03, 0.015),
];

/// Points on tubes at `step` from each other, m, off them by `noise`.
fn points_on(tubes: &[Tube], step: f64, noise: f64, chance: &mut Chance) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    for (from, to, wide, thin) in tubes {
        let (from, to) = (Point3::from(*from), Point3::from(*to));
        let length = (to - from).norm();
        let along = (to - from) / length;
        let first = along.cross(&Vector3::new(0.3, 0.9, 0.1)).normalize();
        let second = along.cross(&first);
        let rings = (length / step) as usize;
        for ring in 0..rings {
            let share = ring as f64 / rings as f64;
            let radius = wide + (thin - wide) * share;
            for _ in 0..(std::f64::consts::TAU * radius / step) as usize {
                let angle = chance.between(0.0, std::f64::consts::TAU);
                let out = first * angle.cos() + second * angle.sin();
                points
                    .push(from + along * length * share + out * (radius + noise * chance.normal()));
            }
        }
    }
    points
}

/// The tree on a slope, a thousand kilometres from the origin.
fn tree_on_ground(chance: &mut Chance) -> Vec<Point3<f64>> {
    let mut points = points_on(&TUBES, 0.008, 0.003, chance);
    for _ in 0..40_000 {
        let [x, y] = [chance.between(-2.5, 2.5), chance.between(-2.5, 2.5)];
        points.push(Point3::new(x, y, 0.1 * x + 0.01 * chance.even()));
    }
    points.iter().map(|p| p + FAR).collect()
}

const FAR: Vector3<f64> = Vector3::new(512_000.0, 5_403_000.0, 300.0);

fn write_xyz(path: &Path, points: &[Point3<f64>], unit: f64) {
    let mut text = String::new();
    for p in points {
        let _ = writeln!(
            text,
            "{:.4} {:.4} {:.4}",
            p.x / unit,
            p.y / unit,
            p.z / unit
        );
    }
    fs::write(path, text).expect("cloud");
}

fn tree_cloud(path: &Path) {
    write_xyz(path, &tree_on_ground(&mut Chance::new(7)), 1.0);
}

#[test]
fn a_cloud_becomes_a_document_with_the_trees_own_wood() {
    let dir = tempfile::tempdir().expect("tempdir");
    let [cloud, out] = ["tree.xyz", "tree"].map(|name| dir.path().join(name));
    tree_cloud(&cloud);
    let name = cloud.to_str().expect("name");
    let said = done(&["cloud", name], &out);
    assert!(said.contains("% are ground"), "{said}");
    assert_eq!(names_in(&out), ["capture.json", "nodes.csv", "tree.glb"]);
    let tree = Document::read(&out, 60.0).expect("a document");
    assert_eq!(tree.warnings, [""; 0]);
    let nodes = &tree.skeleton.nodes;
    assert!(
        nodes
            .iter()
            .all(|n| n.kind == NodeKind::Traced && n.copy_of.is_none())
    );
    let scan = tree.note.scan.expect("a scan");
    assert!(
        (Vector3::from(scan.foot_m) - FAR).norm() < 0.05,
        "{:?}",
        scan.foot_m
    );
    assert!((0.002..0.005).contains(&scan.noise_m), "{}", scan.noise_m);
    let metres = tree.note.config.export.metres_per_px;
    // Where the limbs end, and how thick the trunk is at the height of a breast.
    let tips = (1..nodes.len() as u32)
        .map(NodeId)
        .filter(|n| tree.skeleton.children()[n.index()].is_empty());
    let tips: Vec<Point3<f64>> = tips.map(|n| nodes[n.index()].position * metres).collect();
    // A stub stays at a fork of thick limbs in two of twelve such clouds.
    let counts = TUBES.len()..=TUBES.len() + 1;
    assert!(counts.contains(&tips.len()), "{tips:?}");
    for (_, end, _, _) in TUBES {
        let end = Point3::new(end[0], end[2], -end[1]);
        let off = tips
            .iter()
            .map(|t| (t - end).norm())
            .fold(f64::INFINITY, f64::min);
        // The trunk ends as an open ring of 5 cm radius, and its tip anywhere on that.
        assert!(off < 0.07, "{end}: {off}");
    }
    let breast = nodes
        .iter()
        .skip(1)
        .min_by_key(|n| ((n.position.y * metres - 1.3).abs() * 1e6) as u64);
    let radius = breast.expect("a node").radius * metres;
    assert!((radius - 0.124).abs() < 0.006, "{radius}");
    // Each limb leaves at a fork of its own.
    let forks = tree
        .skeleton
        .children()
        .iter()
        .filter(|c| c.len() == 2)
        .count();
    assert!((TUBES.len() - 1..=TUBES.len()).contains(&forks), "{forks}");
    // The same again, byte for byte; and the other method.
    let again = dir.path().join("again");
    done(&["cloud", name], &again);
    for file in ["nodes.csv", "tree.glb"] {
        assert_eq!(
            fs::read(out.join(file)).expect("file"),
            fs::read(again.join(file)).expect("file")
        );
    }
    let grown = dir.path().join("colonised");
    done(&["cloud", name, "--method", "colonisation"], &grown);
    let height = |dir: &Path| {
        let tree = Document::read(dir, 60.0).expect("a document");
        let top = tree
            .skeleton
            .nodes
            .iter()
            .map(|n| n.position.y)
            .fold(0.0, f64::max);
        top * tree.note.config.export.metres_per_px
    };
    assert!((height(&grown) - height(&out)).abs() < 0.1);
    // As the paper has it, which is honest about what it is worth.
    let bare = dir.path().join("bare");
    let said = done(&["cloud", name, "--method", "runions"], &bare);
    assert!((height(&bare) - height(&out)).abs() < 0.1);
    assert!(said.contains("strands all around thick wood"), "{said}");
    let shown = out.to_str().expect("name");
    for (arguments, file) in [
        (vec!["render", shown], "tree.png"),
        (
            vec!["animate", shown, "--wind", "4", "--seconds", "2"],
            "wind.glb",
        ),
        (vec!["export", shown, "--format", "ply"], "tree.ply"),
        (
            vec!["grow", shown, "--count", "2", "--motion", "none"],
            "grown",
        ),
    ] {
        done(&arguments, &dir.path().join(file));
    }
}

/// Rows of a table: a stem of `from` to `to` that tapers from `thick` m, in 40 pieces that are numbered from
/// `first` and grow on `parent`; behind each stands the first of `told`, behind the last the other.
fn stem_rows(
    first: usize,
    parent: usize,
    ends: [[f64; 3]; 2],
    thick: f64,
    told: [&str; 2],
) -> String {
    const PIECES: usize = 40;
    let [from, to] = ends.map(Point3::from);
    let place = |k: usize| from + (to - from) * (k as f64 / PIECES as f64);
    let mut rows = String::new();
    for k in 0..PIECES {
        let below = if k == 0 { parent } else { first + k - 1 };
        let [a, b] = [place(k), place(k + 1)];
        let radius = thick * (1.0 - 0.95 * (k as f64 + 0.5) / PIECES as f64);
        let told = told[usize::from(k + 1 == PIECES)];
        let id = first + k;
        writeln!(
            rows,
            "{id},{below},{},{},{},{},{},{},{radius},{told}",
            a.x, a.y, a.z, b.x, b.y, b.z
        )
        .expect("text");
    }
    rows
}

/// A table of another tool is a tree as it stands: its lengths, volumes and frequencies come out again.
#[test]
fn a_table_of_cylinders_is_a_tree_as_that_of_a_scan() {
    let dir = tempfile::tempdir().expect("tempdir");
    let table = dir.path().join("oak.csv");
    let mut rows =
        "ID,parentID,startX,startY,startZ,endX,endY,endZ,radius,frequency_hz,frequency_lo_hz,\
                    frequency_hi_hz,damping_ratio,damping_lo,damping_hi\n"
            .to_owned();
    let sway = "0.8,0.78,0.82,0.05,0.04,0.06";
    rows += &stem_rows(1, 0, [[7.0, 3.0, 1.0], [7.0, 3.0, 6.0]], 0.2, [",,,,,"; 2]);
    // From the end of the 20th piece, which is half way up.
    rows += &stem_rows(
        41,
        20,
        [[7.0, 3.0, 3.5], [8.5, 3.0, 5.0]],
        0.08,
        [",,,,,", sway],
    );
    fs::write(&table, &rows).expect("table");
    let [out, again] = ["oak", "again.csv"].map(|name| dir.path().join(name));
    let said = done(&["cloud", table.to_str().expect("name")], &out);
    assert!(
        said.contains("a tree of 2 branches, 5.00 m high") && said.contains("taken as metres"),
        "{said}"
    );
    let tree = Document::read(&out, 1.0).expect("document");
    let swaying = tree.sway.iter().flatten();
    let hz: Vec<f64> = swaying.map(|sway| sway.frequency_hz.value).collect();
    assert_eq!(hz, [0.8]);
    // What parts its cells, and its name, may be others.
    for (name, text) in [
        ("tabs.csv", rows.replace(',', "\t")),
        ("semicolons.txt", rows.replace(',', ";")),
        ("table.xyz", rows.clone()),
    ] {
        let [other, folder] = [name.to_owned(), format!("{name}-tree")].map(|n| dir.path().join(n));
        fs::write(&other, text).expect("table");
        let options = ["cloud", other.to_str().expect("name"), "--method", "paths"];
        let said = done(&options, &folder);
        assert!(
            said.contains("note: --method changes nothing here"),
            "{said}"
        );
        let [a, b] = [&out, &folder].map(|dir| fs::read(dir.join("nodes.csv")).expect("nodes"));
        assert!(a == b, "{name}");
    }
    let shown = out.to_str().expect("name");
    let said = done(&["export", shown, "--format", "qsm"], &again);
    for (order, [length, thick]) in [[5.0, 0.2], [2.12, 0.08]].into_iter().enumerate() {
        let begin = format!("order {order}: 1 branches, length ");
        let line = said.lines().find_map(|line| line.strip_prefix(&begin));
        let line = line.expect("an order").replace(',', "");
        let numbers: Vec<f64> = line
            .split(' ')
            .filter_map(|word| word.parse().ok())
            .collect();
        let volume = std::f64::consts::PI / 3.0 * length * thick * thick * 1.0525;
        assert!((numbers[0] / length - 1.0).abs() < 0.05, "{line}");
        assert!(
            (numbers[1] / volume - 1.0).abs() < 0.05,
            "{line} of {volume}"
        );
    }
    let bare = dir.path().join("bare.csv");
    let mut without = String::new();
    for row in rows.lines() {
        let cells: Vec<&str> = row.split(',').take(8).collect();
        writeln!(without, "{}", cells.join(",")).expect("text");
    }
    fs::write(&bare, without).expect("table");
    let refused = arborcam(
        &["cloud", bare.to_str().expect("name")],
        &dir.path().join("none"),
    );
    let said = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(FAILED), "{said}");
    assert!(said.contains("pieces of it have no radius"), "{said}");
}

/// A row gives a cylinder again that ends where it ends, also where one branch goes on in another that sways
/// otherwise.
#[test]
fn a_table_comes_back_row_by_row() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("oak.csv");
    let header = "ID,parentID,startX,startY,startZ,endX,endY,endZ,radius,made_up,frequency_hz,frequency_lo_hz,\
                  frequency_hi_hz,damping_ratio,damping_lo,damping_hi\n";
    let mut rows = header.to_owned();
    let [stem, top, side] = ["0,0.5,0.49,0.51,,,", "0,0.8,0.78,0.82,,,", "1,,,,,,"];
    rows += &stem_rows(1, 0, [[7.0, 3.0, 1.0], [7.0, 3.0, 4.0]], 0.2, [stem; 2]);
    rows += &stem_rows(41, 40, [[7.0, 3.0, 4.0], [7.2, 3.0, 5.0]], 0.012, [top; 2]);
    // From the end of the 20th piece. Its frequency has no interval.
    let last = "1,1.2,,,,,";
    rows += &stem_rows(
        81,
        20,
        [[7.0, 3.0, 2.5], [8.5, 3.0, 4.0]],
        0.08,
        [side, last],
    );
    fs::write(&path, &rows).expect("table");
    let [tree, again] = ["oak", "again.csv"].map(|name| dir.path().join(name));
    let said = done(&["cloud", path.to_str().expect("name")], &tree);
    assert!(
        said.contains("frequencies of 1 pieces are left out"),
        "{said}"
    );
    assert!(said.contains("nobody has seen 40 of 120 pieces"), "{said}");
    done(
        &["export", tree.to_str().expect("name"), "--format", "qsm"],
        &again,
    );
    let [before, after] = [&path, &again].map(|path| records(path));
    assert_eq!(before.len(), after.len());
    for (a, b) in before.iter().zip(&after) {
        for name in ["endX", "endY", "endZ"] {
            let [a, b] = [a, b].map(|row| row[name].parse::<f64>().expect("number"));
            assert!((a - b).abs() < 1e-3, "{name}: {a}, {b}");
        }
        let has_interval = !a["frequency_lo_hz"].is_empty();
        let wanted = if has_interval { &a["frequency_hz"] } else { "" };
        assert_eq!(b["frequency_hz"], wanted);
        assert_eq!(b["made_up"], "0");
        let [own, again] = [a, b].map(|row| row["radius"].parse::<f64>().expect("number"));
        // The tip is no thicker than a twig, and the first piece of a branch as its end.
        assert!((again / own - 1.0).abs() < 0.3, "{own}, {again}: {a:?}");
    }
}

/// A branch whose rows all say the same sways as one.
#[test]
fn rows_with_the_same_sway_are_one_branch() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("stem.csv");
    let header = "ID,parentID,startX,startY,startZ,endX,endY,endZ,radius,frequency_hz,frequency_lo_hz,\
                  frequency_hi_hz,damping_ratio,damping_lo,damping_hi\n";
    let sways = ["0.5,0.49,0.51,0.02,0.01,0.03", "0.8,0.78,0.82,,,"];
    let mut rows = header.to_owned();
    rows += &stem_rows(1, 0, [[0.0; 3], [0.0, 0.0, 3.0]], 0.2, [sways[0]; 2]);
    rows += &stem_rows(
        41,
        40,
        [[0.0, 0.0, 3.0], [0.0, 0.2, 5.0]],
        0.1,
        [sways[1]; 2],
    );
    fs::write(&path, &rows).expect("table");
    let tree = dir.path().join("tree");
    done(&["cloud", path.to_str().expect("name")], &tree);
    let document = Document::read(&tree, 1.0).expect("a tree");
    let hz: Vec<f64> = document
        .sway
        .iter()
        .flatten()
        .map(|sway| sway.frequency_hz.value)
        .collect();
    assert_eq!(hz, [0.5, 0.8]);
}

#[test]
fn tables_of_cylinders_stand_in_the_scan_and_are_read_again() {
    let dir = tempfile::tempdir().expect("tempdir");
    let [cloud, out] = ["tree.xyz", "tree"].map(|name| dir.path().join(name));
    tree_cloud(&cloud);
    done(&["cloud", cloud.to_str().expect("name")], &out);
    let mut trees = Vec::new();
    for (format, file) in [("qsm", "qsm.csv"), ("treefile", "tree.txt")] {
        let path = dir.path().join(file);
        let said = done(
            &["export", out.to_str().expect("name"), "--format", format],
            &path,
        );
        assert!(said.contains("order 0: 1 branches, length 5."), "{said}");
        let bytes = fs::read(&path).expect("file");
        trees.push(read_model(&bytes, &path).expect("a tree").tree);
        // By what it holds, not by its name.
        let other = path.with_extension(if format == "qsm" { "txt" } else { "csv" });
        let renamed = read_model(&bytes, &other).expect("a tree").tree;
        assert_eq!(trees.last(), Some(&renamed), "{format}");
    }
    let [table, treefile] = &trees[..] else {
        panic!("two trees");
    };
    assert_eq!(table.nodes.len(), treefile.nodes.len());
    for (a, b) in table.nodes.iter().zip(&treefile.nodes) {
        assert_eq!(a.parent, b.parent);
        assert!(
            (a.position - b.position).norm() < 1e-3,
            "{} {}",
            a.position,
            b.position
        );
    }
    let foot = treefile.nodes[0].position;
    assert!(
        (foot - Point3::new(FAR.x, FAR.z, -FAR.y)).norm() < 0.05,
        "{foot}"
    );
    // Against the tubes.
    let text = fs::read_to_string(dir.path().join("qsm.csv")).expect("table");
    let mut rows = csv::Reader::from_reader(text.as_bytes());
    let header = rows.headers().expect("header").clone();
    let column = |name: &str| header.iter().position(|h| h == name).expect("column");
    let (mut length, mut volume) = (0.0, 0.0);
    for row in rows.records() {
        let row = row.expect("row");
        length += row[column("length")].parse::<f64>().expect("number");
        volume += row[column("volume")].parse::<f64>().expect("number");
    }
    let of_tubes = TUBES.map(|(from, to, wide, thin)| {
        let length = (Point3::from(to) - Point3::from(from)).norm();
        (
            length,
            std::f64::consts::PI / 3.0 * length * (wide * wide + wide * thin + thin * thin),
        )
    });
    let sums = of_tubes
        .iter()
        .fold((0.0, 0.0), |sum, tube| (sum.0 + tube.0, sum.1 + tube.1));
    assert!(
        (length / sums.0 - 1.0).abs() < 0.03,
        "{length} m of {}",
        sums.0
    );
    assert!(
        (volume / sums.1 - 1.0).abs() < 0.10,
        "{volume} m3 of {}",
        sums.1
    );
}

/// What the cloud of `points` is said to be worth.
fn verdict(points: &[Point3<f64>]) -> String {
    let dir = tempfile::tempdir().expect("tempdir");
    let [cloud, out] = ["tree.xyz", "tree"].map(|name| dir.path().join(name));
    write_xyz(&cloud, points, 1.0);
    let said = done(&["cloud", cloud.to_str().expect("name")], &out);
    let line = said.lines().find(|l| l.starts_with("verdict: "));
    let line = line.expect("a verdict").to_owned();
    let noted = Document::read(&out, 60.0).expect("a document").note.verdict;
    assert_eq!(noted.expect("a verdict").labelled_line(), line);
    let holds_ground = !said.contains("the cloud holds no ground");
    assert_eq!(holds_ground, points.len() > 40_000, "{said}");
    line
}

#[test]
fn a_tree_on_its_head_is_no_good_tree() {
    let mut chance = Chance::new(7);
    assert_eq!(verdict(&tree_on_ground(&mut chance)), "verdict: good");
    let tree = points_on(&TUBES, 0.012, 0.003, &mut chance);
    assert_eq!(verdict(&tree), "verdict: good");
    let turned: Vec<Point3<f64>> = tree.iter().map(|p| Point3::new(p.x, -p.y, -p.z)).collect();
    let line = verdict(&turned);
    assert!(line.starts_with("verdict: poor, because: "), "{line}");
    assert!(line.contains("foot") && line.contains("z is up"), "{line}");
}

/// Its thickest wood is at the cut, as a tree's is at the foot.
#[test]
fn a_crown_without_its_trunk_is_no_good_tree() {
    let mut crown = points_on(&TUBES, 0.012, 0.003, &mut Chance::new(7));
    crown.retain(|p| p.z > 1.4);
    let line = verdict(&crown);
    assert!(line.starts_with("verdict: fair, because: "), "{line}");
    assert!(line.contains("a crown without its trunk"), "{line}");
}

/// Two boughs from a fork 1 m below the cut, each with a branch; and two trunks with the same ones.
const BOUGHS: [Tube; 4] = [
    ([0.43, 0.0, 0.0], [1.73, 0.0, 3.0], 0.09, 0.03),
    ([0.86, 0.0, 1.0], [1.0, 1.0, 2.2], 0.04, 0.015),
    ([-0.3, 0.37, 0.0], [-1.2, 1.47, 3.0], 0.08, 0.03),
    ([-0.6, 0.74, 1.0], [-1.5, 0.3, 2.2], 0.04, 0.015),
];
const TRUNKS: [Tube; 4] = [
    ([0.0, 0.0, 0.0], [0.2, 0.1, 3.0], 0.09, 0.03),
    ([0.07, 0.03, 1.0], [0.2, 1.0, 2.2], 0.04, 0.015),
    ([2.0, 0.3, 0.0], [2.1, 0.2, 3.0], 0.08, 0.03),
    ([2.03, 0.27, 1.0], [1.2, 0.0, 2.2], 0.04, 0.015),
];

#[test]
fn boughs_of_a_crown_are_no_good_trees_and_trunks_are() {
    let dir = tempfile::tempdir().expect("tempdir");
    for (name, tubes, expected) in [
        (
            "boughs",
            &BOUGHS,
            "verdict: fair, because: its trunk comes together",
        ),
        ("trunks", &TRUNKS, "verdict: good"),
    ] {
        let [cloud, out] =
            [format!("{name}.xyz"), name.to_owned()].map(|name| dir.path().join(name));
        let points = points_on(tubes, 0.01, 0.003, &mut Chance::new(7));
        write_xyz(&cloud, &points, 1.0);
        let said = done(&["cloud", cloud.to_str().expect("name")], &out);
        let verdicts: Vec<&str> = said
            .lines()
            .filter(|l| l.starts_with("verdict: "))
            .collect();
        assert_eq!(verdicts.len(), 2, "{said}");
        assert!(
            verdicts.iter().all(|line| line.starts_with(expected)),
            "{said}"
        );
    }
}

#[test]
fn units_are_taken_as_given() {
    let dir = tempfile::tempdir().expect("tempdir");
    let points = tree_on_ground(&mut Chance::new(7));
    let feet = dir.path().join("feet.txt");
    write_xyz(&feet, &points, 0.3048);
    let out = dir.path().join("tree");
    let said = done(
        &["cloud", feet.to_str().expect("name"), "--unit", "ft"],
        &out,
    );
    let at = said.find(" m high").expect("a height");
    let height: f64 = said[..at]
        .rsplit(' ')
        .next()
        .expect("a word")
        .parse()
        .expect("a number");
    assert!((4.9..5.1).contains(&height), "{said}");
    assert!(!said.contains("no unit"), "{said}");
    assert!(!said.contains("left out"), "{said}");
    // Without a word on it the feet are metres, and the note says how high the tree is then. What is no place
    // is counted.
    let mut text = fs::read_to_string(&feet).expect("cloud");
    text += "nan 1 2\n1 inf 2\n1 2 nan\n";
    fs::write(&feet, text).expect("cloud");
    let out = dir.path().join("other");
    let said = done(&["cloud", feet.to_str().expect("name")], &out);
    let note = "note: no unit in the file: taken as metres, the tree is 16.";
    assert!(said.contains(note), "{said}");
    assert!(said.contains("give --unit if that is wrong"), "{said}");
    assert!(said.contains("3 points are left out"), "{said}");
    let scan = Document::note(&out).expect("a note").scan.expect("a scan");
    assert_eq!(scan.not_finite_points, 3);
}

/// A LAS file of these points in metres, written in US survey feet, whose coordinate system has this number in
/// the EPSG register; nothing else in it says the unit.
fn write_las(path: &Path, points: &[Point3<f64>], code: u16) {
    const US_FOOT_M: f64 = 1200.0 / 3937.0;
    let mut builder = las::Builder::from((1, 2));
    let scale = las::Transform {
        scale: 0.001,
        offset: 0.0,
    };
    builder.transforms = las::Vector {
        x: scale,
        y: scale,
        z: scale,
    };
    let keys: [u16; 12] = [1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, code];
    builder.vlrs.push(las::Vlr {
        user_id: "LASF_Projection".to_owned(),
        record_id: 34735,
        description: String::new(),
        data: keys.iter().flat_map(|key| key.to_le_bytes()).collect(),
    });
    let header = builder.into_header().expect("header");
    let mut writer = las::Writer::from_path(path, header).expect("writer");
    for point in points {
        let at = point / US_FOOT_M;
        let point = las::Point {
            x: at.x,
            y: at.y,
            z: at.z,
            ..las::Point::default()
        };
        writer.write_point(point).expect("point");
    }
    writer.close().expect("written");
}

#[test]
fn the_number_of_a_coordinate_system_says_the_unit() {
    let dir = tempfile::tempdir().expect("tempdir");
    let points = points_on(&TUBES, 0.012, 0.003, &mut Chance::new(7));
    let path = |name: &str| dir.path().join(name);
    // New York Long Island.
    write_las(&path("known.las"), &points, 2263);
    let known = path("known.las");
    let said = done(&["cloud", known.to_str().expect("name")], &path("known"));
    assert!(said.contains("the file's unit is 0.3048 m"), "{said}");
    assert!(said.contains(", 5.00 m high"), "{said}");
    // One that the definitions do not have: said, and not taken for metres in silence.
    write_las(&path("unknown.las"), &points, 20050);
    let unknown = path("unknown.las");
    let name = unknown.to_str().expect("name");
    let said = done(&["cloud", name], &path("unknown"));
    let warning = "warning: the unit of the file's coordinate system, EPSG:20050, is not known: taken as metres";
    assert!(
        said.contains(warning) && said.contains("give --unit"),
        "{said}"
    );
    let said = done(&["cloud", name, "--unit", "us-ft"], &path("given"));
    assert!(
        !said.contains("EPSG") && said.contains(", 5.00 m"),
        "{said}"
    );
}

/// Trees on a slope, not far from each other, each turned and of another size.
const FEET: [[f64; 2]; 3] = [[0.0, 0.0], [2.6, 0.6], [-0.4, 2.9]];
const SIZES: [f64; 3] = [1.0, 0.85, 0.7];

/// Their points, and of each the number of its tree; 0 on the ground.
fn plot(chance: &mut Chance) -> Vec<(Point3<f64>, i32)> {
    let mut points = Vec::new();
    for (number, (foot, size)) in (1..).zip(FEET.iter().zip(SIZES)) {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 2.0 * f64::from(number));
        let shift = Vector3::new(foot[0], foot[1], 0.1 * foot[0]) + FAR;
        let own = points_on(&TUBES, 0.012, 0.003, chance);
        points.extend(own.iter().map(|p| (turn * (p * size) + shift, number)));
    }
    for _ in 0..60_000 {
        let [x, y] = [chance.between(-3.5, 5.0), chance.between(-3.5, 6.0)];
        points.push((Point3::new(x, y, 0.1 * x + 0.01 * chance.even()) + FAR, 0));
    }
    points
}

#[test]
fn each_tree_of_a_plot_becomes_a_document_at_its_place() {
    let dir = tempfile::tempdir().expect("tempdir");
    let [cloud, out, one] = ["plot.xyz", "plot", "one"].map(|name| dir.path().join(name));
    let truth = plot(&mut Chance::new(7));
    let points: Vec<Point3<f64>> = truth.iter().map(|t| t.0).collect();
    write_xyz(&cloud, &points, 1.0);
    let name = cloud.to_str().expect("name");
    let said = done(&["cloud", name, "--points"], &out);
    assert!(said.contains("3 trees;"), "{said}");
    for tree in ["tree-0001", "tree-0002", "tree-0003", "forest.glb"] {
        assert!(out.join(tree).exists(), "{tree}: {said}");
    }
    // The largest first; heights and places are those of the trees.
    let forest = ForestDocument::read(&out).expect("a forest");
    let trees = &forest.forest.trees;
    assert_eq!(trees.len(), 3);
    for k in 0..3 {
        let own = Document::read(&out.join(format!("tree-000{}", k + 1)), 60.0).expect("a tree");
        let scan = own.note.scan.expect("a scan");
        let foot = Vector3::from(scan.foot_m) - FAR;
        assert!(
            (foot.xy() - Vector2::from(FEET[k])).norm() < 0.08,
            "{k}: {foot}"
        );
        let top = own
            .skeleton
            .nodes
            .iter()
            .map(|n| n.position.y)
            .fold(0.0, f64::max);
        let height_m = top * trees[k].scale * forest.forest.metres_per_px;
        assert!((height_m - 5.0 * SIZES[k]).abs() < 0.15, "{k}: {height_m}");
        let apart = trees[k].foot - trees[0].foot;
        let [x, y] = [0, 1].map(|axis| FEET[k][axis] - FEET[0][axis]);
        assert!(
            (apart - Vector3::new(x, 0.1 * x, -y)).norm() < 0.15,
            "{k}: {apart}"
        );
        let on_ground = forest
            .forest
            .ground
            .height_m(Point2::new(trees[k].foot.x, trees[k].foot.z));
        assert!(
            (on_ground - trees[k].foot.y).abs() < 0.06,
            "{k}: {on_ground}"
        );
    }
    // Points of trees are of the right tree.
    let bytes = fs::read(out.join("points.ply")).expect("points");
    let rows = &bytes[bytes.len() - 28 * truth.len()..];
    let (mut right, mut wrong) = (0, 0);
    for (row, (_, number)) in rows.chunks_exact(28).zip(&truth) {
        let found = i32::from_le_bytes(row[24..].try_into().expect("four bytes"));
        right += i32::from(*number > 0 && found == *number);
        wrong += i32::from(*number > 0 && found != *number && found > 0);
    }
    assert!(right > 100 * wrong, "{right}, {wrong}");
    // One of them.
    done(&["cloud", name, "--tree", "2"], &one);
    for file in ["nodes.csv", "tree.glb"] {
        let [a, b] = [one.join(file), out.join("tree-0002").join(file)];
        assert_eq!(fs::read(a).expect("file"), fs::read(b).expect("file"));
    }
    let film = one.to_str().expect("name");
    for more in [["--tree", "4"], ["--film", film]] {
        let none = dir.path().join("none");
        let output = arborcam(&["cloud", name, more[0], more[1]], &none);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(BAD_USAGE), "{said}");
        assert!(
            said.contains(more[0]) && said.lines().count() == 1,
            "{said}"
        );
        assert!(!none.exists());
    }
}

/// Pairs of places of a film and the table of its tree, as rows: what is farthest to the left, to the right, and up, and
/// the foot.
fn table_pairs(film: &Path, table: &Path) -> Vec<String> {
    let number =
        |row: &BTreeMap<String, String>, key: &str| row[key].parse::<f64>().expect("a number");
    let (mut nodes, mut pieces) = (records(&film.join("nodes.csv")), records(table));
    nodes.retain(|node| ["measured", "traced", "shoot"].contains(&node["kind"].as_str()));
    pieces.retain(|piece| piece["made_up"] == "0");
    let mut rows = vec![format!("{},{},0,0,0\n", nodes[0]["u_px"], nodes[0]["v_px"])];
    for (px, m, sign) in [
        ("u_px", "endX", -1.0_f64),
        ("u_px", "endX", 1.0),
        ("v_px", "endZ", 1.0),
    ] {
        // Down in the picture is down in the scan.
        let sign_px = if px == "v_px" { -sign } else { sign };
        nodes.sort_by(|a, b| (sign_px * number(a, px)).total_cmp(&(sign_px * number(b, px))));
        pieces.sort_by(|a, b| (sign * number(a, m)).total_cmp(&(sign * number(b, m))));
        let (node, piece) = (
            nodes.last().expect("a node"),
            pieces.last().expect("a piece"),
        );
        let places = [
            &node["u_px"],
            &node["v_px"],
            &piece["endX"],
            &piece["endY"],
            &piece["endZ"],
        ];
        rows.push(format!("{}\n", places.map(String::as_str).join(",")));
    }
    rows
}

/// A film on a table of its own tree, in metres: it is found, the trunk has the film's frequency from the foot on, and so
/// nearly every piece hangs on wood with one.
#[test]
fn a_film_on_the_wood_of_its_own_tree_gives_it_its_frequencies() {
    let dir = tempfile::tempdir().expect("tempdir");
    let [table, scan, swaying, back] =
        ["tree.csv", "scan", "swaying", "back.csv"].map(|name| dir.path().join(name));
    let film = replayed().to_str().expect("name");
    let name = table.to_str().expect("name");
    done(
        &["export", film, "--format", "qsm", "--height", "4"],
        &table,
    );
    let said = done(&["cloud", name, "--film", film, "--unit", "m"], &swaying);
    assert!(said.contains("the film lies on the scan within"), "{said}");
    let note = fs::read(swaying.join("capture.json")).expect("capture.json");
    let note: serde_json::Value = serde_json::from_slice(&note).expect("JSON");
    let off = note["scan"]["film"]["off_hi"].as_f64().expect("off");
    assert!(off < 0.02, "{off}");
    let trunk = records(&Path::new(film).join("nodes.csv"))
        .into_iter()
        .find(|node| !node["frequency_hz"].is_empty())
        .expect("the trunk's frequency");
    let swaying_name = swaying.to_str().expect("name");
    done(&["export", swaying_name, "--format", "qsm"], &back);
    let pieces = records(&back);
    let on_trunk: f64 = pieces[0]["frequency_hz"].parse().expect("a number");
    let filmed: f64 = trunk["frequency_hz"].parse().expect("a number");
    assert!((on_trunk - filmed).abs() < 1e-4, "{on_trunk}, {filmed}");
    assert!(pieces.iter().all(|p| !p["nearest_frequency_hz"].is_empty()));
    // By pairs of places it lies as well. Bad pairs are refused.
    let rows = table_pairs(Path::new(film), &table);
    let path = dir.path().join("pairs.csv");
    let pairs = path.to_str().expect("name");
    let with_pairs = [
        "cloud", name, "--film", film, "--unit", "m", "--pairs", pairs,
    ];
    let write = |rows: &[String]| {
        fs::write(&path, format!("u_px,v_px,x,y,z\n{}\n", rows.concat())).expect("pairs");
    };
    write(&rows);
    let paired = dir.path().join("paired");
    let said = done(&with_pairs, &paired);
    assert!(said.contains("the film lies on the scan within"), "{said}");
    let refused = |rows: &[String], status: i32, why: &str| {
        write(rows);
        let refused = arborcam(&with_pairs, &scan);
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(status), "{said}");
        assert!(said.contains(why) && !scan.exists(), "{said}");
    };
    refused(&rows[..1], BAD_USAGE, "three are needed");
    let same = [&rows[0], &rows[0], &rows[0]].map(String::clone);
    refused(&same, FAILED, "--pairs");
    let mut exchanged = rows.clone();
    for (k, row) in exchanged.iter_mut().enumerate() {
        let [film_px, scan_m] = [&rows[k], &rows[(k + 1) % rows.len()]]
            .map(|row| row.split(',').map(str::to_owned).collect::<Vec<String>>());
        *row = [&film_px[..2], &scan_m[2..]].concat().join(",");
    }
    // Where the lines say better.
    refused(&exchanged, FAILED, "and not where --pairs has them");
    let off = [
        "9999,10,0,0,0\n".to_owned(),
        rows[0].clone(),
        rows[1].clone(),
    ];
    refused(&off, FAILED, "lies off the picture of the film");
    // A film without a scale says nothing of sizes.
    let scaled = dir.path().join("film");
    let said = done(&["cloud", name, "--film", film, "--unit", "ft"], &scaled);
    assert!(!said.contains("times as large"), "{said}");
}

/// Tables that contradict themselves, or hold what no tree has.
#[test]
fn tables_that_cannot_be_true_are_refused_or_named() {
    let dir = tempfile::tempdir().expect("tempdir");
    let head = "ID,parentID,startX,startY,startZ,endX,endY,endZ,radius,frequency_hz,frequency_lo_hz,frequency_hi_hz";
    let sound = [
        "0,-1,0,0,0,0,0,2,0.1,1,0.9,1.1",
        "1,0,0,0,2,0,0,4,0.08,,,",
        "2,1,0,0,4,1,0,5,0.05,,,",
    ];
    for (number, (from, to, succeeds, expected)) in [
        ("0,0,4,1,0,5", "0,0,4,1,0,5", true, "a tree of 1 branch"),
        (
            "0,0,4,1,0,5",
            "9,0,4,1,0,5",
            true,
            "1 of 3 pieces begin far from",
        ),
        (
            "1,0.9,1.1",
            "1e9,9e8,2e9",
            true,
            "frequencies of 1 pieces are left out",
        ),
        ("0.1,1,", "100,1,", false, "radii in the unit of the places"),
    ]
    .into_iter()
    .enumerate()
    {
        let file = dir.path().join(format!("{number}.csv"));
        let text = format!("{head}\n{}\n", sound.join("\n")).replacen(from, to, 1);
        fs::write(&file, text).expect("table");
        let name = file.to_str().expect("name");
        let output = arborcam(&["cloud", name, "--unit", "m"], &file.with_extension("out"));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.success(), succeeds, "{said}");
        assert!(said.contains(expected), "{said} lacks {expected}");
    }
}

/// Each bad cloud gets one line with what is wrong, its status, and nothing is left.
#[test]
fn bad_clouds_get_one_line_and_leave_nothing() {
    let dir = tempfile::tempdir().expect("tempdir");
    let chance = &mut Chance::new(1);
    let tree = points_on(&TUBES, 0.02, 0.003, chance);
    let mut crown: Vec<Point3<f64>> = tree.iter().copied().filter(|p| p.z > 2.8).collect();
    for _ in 0..30_000 {
        crown.push(Point3::new(
            chance.between(-2.5, 2.5),
            chance.between(-2.5, 2.5),
            0.01 * chance.even(),
        ));
    }
    let flat: Vec<Point3<f64>> = (0..5000)
        .map(|_| Point3::new(chance.even(), chance.even(), 0.0))
        .collect();
    let mut ground: Vec<Point3<f64>> = Vec::new();
    for _ in 0..20_000 {
        let [u, v] = [chance.between(-10.0, 10.0), chance.between(-10.0, 10.0)];
        ground.push(Point3::new(u, v, chance.between(-0.15, 0.15)));
    }
    let path = |name: &str| dir.path().join(name);
    write_xyz(&path("crown.xyz"), &crown, 1.0);
    write_xyz(&path("ground.xyz"), &ground, 1.0);
    write_xyz(&path("flat.xyz"), &flat, 1.0);
    write_xyz(&path("huge.xyz"), &tree, 0.001);
    write_xyz(&path("one.xyz"), &tree[..1], 1.0);
    fs::write(path("nan.xyz"), "nan nan nan\n".repeat(500)).expect("file");
    fs::write(path("comma.xyz"), "1,5;2,5;3,5\n".repeat(500)).expect("file");
    fs::write(path("words.txt"), "a tree\n".repeat(50)).expect("file");
    fs::write(path("empty.las"), "").expect("file");
    fs::write(path("words.las"), "a tree and many words ".repeat(50)).expect("file");
    // The page that holds the header has a checksum.
    let mut e57 = fs::read("fuzz/corpus/scan/stem.e57").expect("a scan");
    e57[100] ^= 1;
    fs::write(path("checksum.e57"), e57).expect("file");
    fs::create_dir(path("folder.las")).expect("folder");
    let cut = "ID,parentID,startX,startY,startZ,endX,endY,endZ,radius\n1,0,0\n";
    fs::write(path("cut.csv"), cut).expect("file");
    let orphan = "ID,startX,startY,startZ,endX,endY,endZ,radius\n1,0,0,0,0,0,5,0.1\n";
    fs::write(path("orphan.csv"), orphan).expect("file");
    let tall = "ID,parentID,startX,startY,startZ,endX,endY,endZ,radius\n1,0,0,0,0,0,0,5000,100\n";
    fs::write(path("tall.csv"), tall).expect("file");
    fs::write(path("short.las"), b"LASF and nothing more").expect("file");
    fs::write(
        path("more.ply"),
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nend_header\n0 0 0\n1 1 1\n",
    )
    .expect("file");
    fs::write(path("tree.mov"), "x").expect("file");
    for (name, status, what) in [
        ("crown.xyz", FAILED, "does not reach the ground"),
        ("flat.xyz", FAILED, "one plane"),
        ("ground.xyz", FAILED, "as ground does"),
        ("comma.xyz", FAILED, "line 1 has semicolons and commas"),
        ("huge.xyz", FAILED, "--unit"),
        ("one.xyz", FAILED, "points at least, and it holds 1;"),
        ("nan.xyz", FAILED, "no coordinate in it is a number"),
        ("words.txt", FAILED, "line 17"),
        ("empty.las", FAILED, "cut off"),
        ("short.las", FAILED, "cut off"),
        ("words.las", FAILED, "it does not begin as LAS does"),
        (
            "checksum.e57",
            FAILED,
            "a checksum in it does not fit its bytes",
        ),
        ("folder.las", NO_INPUT, "it is a folder"),
        (
            "cut.csv",
            FAILED,
            "line 2: it has 3 cells, and the first line 9",
        ),
        (
            "orphan.csv",
            FAILED,
            "it has no column parentID, and is no table of cylinders",
        ),
        (
            "tall.csv",
            FAILED,
            "would be 5000.000 m high; give the unit",
        ),
        ("more.ply", FAILED, "more than its header says"),
        ("tree.mov", BAD_USAGE, "its name does not say"),
        ("absent.ply", NO_INPUT, "cannot read"),
        ("absent.csv", NO_INPUT, "there is no such file"),
    ] {
        let out = path("out");
        let output = arborcam(&["cloud", path(name).to_str().expect("name")], &out);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(status), "{name}: {said}");
        assert!(
            said.contains(what) && said.lines().count() == 1,
            "{name}: {said}"
        );
        assert!(!out.exists(), "{name}");
    }
}

/// What the tests above read is what was written.
#[test]
fn the_readers_see_every_point() {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("tree.xyz");
    tree_cloud(&path);
    let lines = fs::read_to_string(&path).expect("file").lines().count();
    let file = BufReader::new(fs::File::open(&path).expect("file"));
    let read = read_cloud(file, CloudFormat::Text, None).expect("sound");
    assert_eq!(read.cloud.points.len(), lines);
}
