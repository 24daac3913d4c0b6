//! Several trees of one cloud: a folder for each, and their scene.

use super::{CloudArgs, Scan, print_summary};
use crate::cli::command_error::CommandError;
use crate::cli::forest::write_forest;
use crate::cli::grow::tree_name;
use crate::cli::output::eprint_line;
use crate::cloud::{CloudTrees, verdict};
use crate::files::write_files;
use crate::views::{StandingTree, scan_forest};
use anyhow::anyhow;
use std::sync::atomic::AtomicBool;

/// Points that are of no tree and no ground are undergrowth and noise; of more than this share of them there is a
/// warning, percent.
const MOST_LEFT_OUT_PERCENT: f64 = 5.0;
/// Where `--points` goes.
const POINTS_FILE: &str = "points.ply";

/// Writes all trees that could be made, and a warning for each that could not.
///
/// # Errors
/// There is none, or a file cannot be written.
pub(super) fn write(
    args: &CloudArgs,
    scan: &Scan,
    found: CloudTrees,
    is_stopped: &AtomicBool,
) -> Result<(), CommandError> {
    print_found(scan, &found);
    let trees = found.trees.iter().flatten();
    let highest = trees.max_by(|a, b| a.figures.height_m.total_cmp(&b.figures.height_m));
    if let Some(highest) = highest {
        scan.say_unit("the highest tree", highest.figures.height_m);
    }
    let mut standing = Vec::with_capacity(found.trees.len());
    for (number, tree) in (1..).zip(&found.trees) {
        let name = tree_name(number);
        let tree = match tree {
            Ok(tree) => tree,
            Err(e) => {
                eprint_line(&format!("arborcam: warning: {name} is left out: {e}"));
                continue;
            }
        };
        let drawn = scan.drawn(tree).map_err(CommandError::Failed)?;
        let branches = drawn.skeleton.botanical_branches().all.len();
        standing.push(StandingTree::of(name.clone(), tree, &drawn));
        let dir = args.out.join(name);
        drawn.write(&dir, is_stopped)?;
        print_summary(&dir, tree, branches, &verdict(&tree.figures));
    }
    let Some(forest) = scan_forest(&scan.name, &standing, &found, scan.config.wood.seed.into())
    else {
        return Err(CommandError::Failed(anyhow!(
            "{}: none of its trees could be made; scan them more finely",
            args.file.display()
        )));
    };
    if args.points {
        let files = [(POINTS_FILE.to_owned(), points_ply(scan, &found))];
        write_files(&args.out, &files, is_stopped)?;
    }
    write_forest(forest, &args.out, is_stopped)
}

fn print_found(scan: &Scan, found: &CloudTrees) {
    let figures = found.figures;
    let of_trees = found.tree_of_point.iter().flatten().count();
    eprint_line(&format!(
        "{}: {} trees; of {} points {:.0} % are of trees and {:.0} % are ground",
        scan.name,
        found.trees.len(),
        figures.points,
        figures.percent(of_trees),
        figures.percent(figures.ground),
    ));
    let left_out = figures.percent(figures.points - of_trees - figures.ground);
    if left_out > MOST_LEFT_OUT_PERCENT {
        eprint_line(&format!(
            "arborcam: warning: {left_out:.0} % of the points are of no tree that was found and not of the ground; \
             where that is not undergrowth, cut the missing trees out of the scan"
        ));
    }
}

/// The points in the axes of the file, m, with the numbers of their trees from 1 on; 0 for none.
fn points_ply(scan: &Scan, found: &CloudTrees) -> Vec<u8> {
    let points = &scan.cloud.points;
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\n\
         property double y\nproperty double z\nproperty int tree\nend_header\n",
        points.len()
    )
    .into_bytes();
    for (at, tree) in points.iter().zip(&found.tree_of_point) {
        for x in (at.cast::<f64>() + scan.cloud.origin).iter() {
            bytes.extend(x.to_le_bytes());
        }
        bytes.extend(tree.map_or(0, |t| t + 1).to_le_bytes());
    }
    bytes
}
