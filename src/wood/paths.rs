//! From a mask to centre lines: the farthest pixel that no branch explains yet is a tip, and its
//! cheapest way to the foot through the middle of the wood is a branch (Sato et al. 2000,
//! "TEASAR").

use super::crossings::taken_apart;
use super::mask::WoodMask;
use super::ways::{Grid, Ways};
use crate::model::{BranchGraph, WoodNode};
use crate::signal::{corners, median};
use nalgebra::{Point2, distance};

/// A branch explains the wood within so many of its radii, and so many pixels.
const EXPLAINED_RADII: f32 = 1.3;
const EXPLAINED_PX: f32 = 2.0;
/// The trunk's widest place within this share of the picture's height above the foot tells how far
/// its roots reach, in radii.
const ROOT_SHARE: f64 = 0.08;
const ROOT_RADII: f32 = 1.5;
/// A branch is longer than so many radii of what it leaves, and than so many pixels; what is
/// shorter is the rough edge of a limb.
const LEAST_RADII: f32 = 1.5;
const LEAST_PX: f32 = 8.0;
/// Least share of a branch that is on wood.
const ON_WOOD: f32 = 0.6;
/// Deviation of the evening out of centre lines, px.
const EVENED_PX: f64 = 4.0;
/// A centre line is drawn by pieces that leave it by no more than this, px.
const STRAIGHT_PX: f64 = 1.2;
/// The branches of the mask, rooted at the foot (px of the picture). Without nodes where no wood
/// can be reached from there.
///
/// # Errors
/// OpenCV fails.
pub fn branches(wood: &WoodMask, foot_px: Point2<f64>) -> opencv::Result<BranchGraph> {
    let grid = Grid::of(wood)?;
    let foot = grid.nearest(wood.to_mask(foot_px));
    let ways = Ways::from(&grid, foot);
    let tracks = taken_apart(&grid, tips_first(&grid, &ways, foot));
    Ok(graph(&grid, &tracks, foot_px))
}

/// A branch as pixels from where it leaves an earlier one to its tip; the first also belongs to
/// that.
pub(super) struct Track {
    pub pixels: Vec<usize>,
}

/// All branches, the farthest tips first. What does not reach above the foot is roots, or lies on
/// the ground.
fn tips_first(grid: &Grid, ways: &Ways, foot: usize) -> Vec<Track> {
    let above_foot = 0..foot / grid.width() * grid.width();
    let tips = above_foot.filter(|p| grid.inside[*p] > 0.0 && ways.cost[*p].is_finite());
    let mut tips: Vec<usize> = tips.collect();
    tips.sort_by(|a, b| ways.cost[*b].total_cmp(&ways.cost[*a]));
    let mut explained = vec![false; grid.inside.len()];
    let mut on_branch = vec![false; grid.inside.len()];
    let mut tracks: Vec<Track> = Vec::new();
    for tip in tips {
        if explained[tip] {
            continue;
        }
        let pixels = way_to(tip, ways, &on_branch);
        let radii = match tracks.is_empty() {
            true => radii_from_foot(grid, &pixels),
            false => radii(grid, &pixels),
        };
        explain(grid, &pixels, &radii, &mut explained);
        if is_branch(grid, &pixels) {
            pixels.iter().for_each(|&p| on_branch[p] = true);
            tracks.push(Track { pixels });
        }
    }
    tracks
}

/// The way to a tip, from the foot or from the branch that it leaves.
fn way_to(tip: usize, ways: &Ways, on_branch: &[bool]) -> Vec<usize> {
    let mut pixels = vec![tip];
    let mut at = tip;
    while !on_branch[at] && ways.from[at] != at {
        at = ways.from[at];
        pixels.push(at);
    }
    pixels.reverse();
    pixels
}

/// Half the width of the wood at every pixel of a way, px.
fn radii(grid: &Grid, pixels: &[usize]) -> Vec<f32> {
    pixels.iter().map(|&pixel| grid.inside[pixel]).collect()
}

/// The same of the first way, which begins at the foot: where the trunk ends, it is no narrower
/// than above, and its roots are no branches.
fn radii_from_foot(grid: &Grid, pixels: &[usize]) -> Vec<f32> {
    let mut radii = radii(grid, pixels);
    let low = (ROOT_SHARE * grid.height() as f64) as usize;
    let widest = (0..radii.len().min(low)).max_by(|a, b| radii[*a].total_cmp(&radii[*b]));
    if let Some(widest) = widest {
        let root = ROOT_RADII * radii[widest];
        radii[..widest].fill(root);
    }
    radii
}

/// Marks the wood about a way.
fn explain(grid: &Grid, pixels: &[usize], radii: &[f32], explained: &mut [bool]) {
    for (&pixel, radius) in pixels.iter().zip(radii) {
        let radius = EXPLAINED_RADII * radius + EXPLAINED_PX;
        let (u, v) = (pixel % grid.width(), pixel / grid.width());
        let reach = radius as usize;
        for v2 in v.saturating_sub(reach)..=(v + reach).min(grid.height() - 1) {
            for u2 in u.saturating_sub(reach)..=(u + reach).min(grid.width() - 1) {
                let (du, dv) = (u2 as f32 - u as f32, v2 as f32 - v as f32);
                if du * du + dv * dv <= radius * radius {
                    explained[v2 * grid.width() + u2] = true;
                }
            }
        }
    }
}

/// Whether it is long enough, and mostly on wood. What lies before the first wood is the foot, or
/// the edge of what it leaves.
fn is_branch(grid: &Grid, pixels: &[usize]) -> bool {
    let first = pixels.iter().position(|&p| grid.inside[p] > 0.0);
    let pixels = &pixels[first.unwrap_or(0)..];
    let leaves_px = pixels.first().map_or(0.0, |&p| grid.inside[p]);
    let steps = pixels.windows(2);
    let length: f64 = steps
        .map(|s| (grid.place(s[1]) - grid.place(s[0])).norm())
        .sum();
    let on_wood = pixels.iter().filter(|&&p| grid.inside[p] > 0.0).count();
    length as f32 >= LEAST_RADII * leaves_px + LEAST_PX
        && on_wood as f32 >= ON_WOOD * pixels.len() as f32
}

/// A place of a centre line before it is drawn by few pieces, px of the picture.
#[derive(Clone, Copy, Debug)]
struct Sample {
    at_px: Point2<f64>,
    radius_px: f64,
}

/// Evens the tracks out, draws them by few pieces, and joins them.
fn graph(grid: &Grid, tracks: &[Track], foot_px: Point2<f64>) -> BranchGraph {
    let mut graph = BranchGraph::default();
    // The branch of every pixel that is on one, and its place along it.
    let mut lines: Vec<Vec<Sample>> = Vec::with_capacity(tracks.len());
    let mut branch_at = std::collections::BTreeMap::new();
    for (b, track) in tracks.iter().enumerate() {
        let mut line = evened(grid, track);
        let leaves = track.pixels.first().and_then(|p| branch_at.get(p));
        if let (Some(&Along { branch, index }), Some(first)) = (leaves, line.first_mut()) {
            let on: &Vec<Sample> = &lines[branch];
            first.at_px = on[index].at_px;
        } else if let Some(first) = line.first_mut() {
            first.at_px = foot_px;
        }
        for (index, &pixel) in track.pixels.iter().enumerate() {
            branch_at.entry(pixel).or_insert(Along { branch: b, index });
        }
        lines.push(line);
    }
    // A branch has a node wherever another leaves it.
    let mut forks: Vec<Vec<usize>> = vec![Vec::new(); tracks.len()];
    let mut leaves: Vec<Option<Along>> = Vec::with_capacity(tracks.len());
    for (b, track) in tracks.iter().enumerate() {
        let first = track.pixels.first().and_then(|p| branch_at.get(p)).copied();
        let from = first.filter(|along| along.branch != b);
        if let Some(Along { branch, index }) = from {
            forks[branch].push(index);
        }
        leaves.push(from);
    }
    let mut node_at = std::collections::BTreeMap::new();
    for (b, line) in lines.iter().enumerate() {
        let kept = kept_samples(line, &forks[b]);
        let mut parent = leaves[b].and_then(|along| node_at.get(&along).copied());
        for (n, &index) in kept.iter().enumerate() {
            if n == 0 && parent.is_some() {
                continue;
            }
            let from = match (n, leaves[b]) {
                (0, _) => 0,
                // Within what it leaves a branch has the width of that.
                (1, Some(_)) => first_beside(&line[..=index]),
                _ => kept[n - 1],
            };
            graph.nodes.push(WoodNode {
                parent,
                position_px: line[index].at_px,
                radius_px: median_radius(&line[from..=index]),
            });
            parent = Some(graph.nodes.len() - 1);
            node_at.insert(Along { branch: b, index }, graph.nodes.len() - 1);
        }
    }
    graph
}

/// A place on a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Along {
    branch: usize,
    index: usize,
}

/// The first sample of a branch that lies beside the limb which it leaves; its last where none does.
fn first_beside(line: &[Sample]) -> usize {
    let Some(fork) = line.first() else { return 0 };
    let is_beside = |s: &Sample| distance(&s.at_px, &fork.at_px) > fork.radius_px;
    let beside = line.iter().position(is_beside);
    beside.unwrap_or(line.len() - 1)
}

fn median_radius(samples: &[Sample]) -> f64 {
    let radii = samples.iter().map(|s| s.radius_px).filter(|r| *r > 0.0);
    median(radii.collect(), f64::total_cmp).unwrap_or(0.0)
}

/// The centre line of a track, evened out along it; its ends stay.
fn evened(grid: &Grid, track: &Track) -> Vec<Sample> {
    let n = track.pixels.len();
    let reach = (3.0 * EVENED_PX) as usize;
    let mut line = Vec::with_capacity(n);
    for i in 0..n {
        // As far to either side as to the nearer end, so that the ends stay.
        let reach = reach.min(i).min(n - 1 - i);
        let (mut sum, mut weights) = (nalgebra::Vector2::zeros(), 0.0);
        for k in i - reach..=i + reach {
            let apart = k.abs_diff(i) as f64 / EVENED_PX;
            let weight = (-0.5 * apart * apart).exp();
            sum += weight * grid.place(track.pixels[k]).coords;
            weights += weight;
        }
        line.push(Sample {
            at_px: grid.wood.to_picture(Point2::from(sum / weights)),
            radius_px: grid.wood.radius_px(grid.inside[track.pixels[i]]),
        });
    }
    line
}

/// Which samples of a line are drawn: its ends, its `forks`, and as many others as it takes to
/// follow it (Douglas and Peucker 1973).
fn kept_samples(line: &[Sample], forks: &[usize]) -> Vec<usize> {
    let places: Vec<Point2<f64>> = line.iter().map(|sample| sample.at_px).collect();
    corners(&places, forks, STRAIGHT_PX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;
    use crate::signal::distance_to_segment;

    /// The first places of a branch lie in the limb that it leaves, and are as wide as that.
    #[test]
    fn a_branch_is_as_wide_as_beside_its_limb() {
        let mut line = Vec::new();
        for k in 0..12 {
            line.push(Sample {
                at_px: Point2::new(f64::from(k), 0.0),
                radius_px: if k < 7 { 6.0 } else { 2.0 },
            });
        }
        let first = first_beside(&line);
        assert_eq!((first, median_radius(&line[first..])), (7, 2.0));
        assert_eq!(first_beside(&line[..4]), 3);
    }

    const SIZE: Size = Size {
        width: 200,
        height: 240,
    };
    const FOOT: Point2<f64> = Point2::new(100.0, 230.0);

    fn mask(lines: &[[Point2<f64>; 2]], radius: f64) -> WoodMask {
        WoodMask::made_up(SIZE, lines, radius)
    }

    /// A trunk that forks into two limbs.
    fn fork() -> [[Point2<f64>; 2]; 3] {
        let (top, left, right) = (
            Point2::new(100.0, 130.0),
            Point2::new(40.0, 40.0),
            Point2::new(170.0, 60.0),
        );
        [[FOOT, top], [top, left], [top, right]]
    }

    #[test]
    fn a_fork_is_drawn_as_two_branches_that_part_there() {
        let graph = branches(&mask(&fork(), 4.0), FOOT).expect("opencv");
        let children = graph.children();
        let forks: Vec<usize> = (0..children.len())
            .filter(|&n| children[n].len() > 1)
            .collect();
        let tips: Vec<usize> = (0..children.len())
            .filter(|&n| children[n].is_empty())
            .collect();
        assert_eq!((forks.len(), tips.len()), (1, 2), "{graph:?}");
        let at = |node: usize| graph.nodes[node].position_px;
        assert!(distance(&at(forks[0]), &Point2::new(100.0, 130.0)) < 9.0);
        let ends = [Point2::new(40.0, 40.0), Point2::new(170.0, 60.0)];
        for end in ends {
            assert!(
                tips.iter().any(|tip| distance(&at(*tip), &end) < 6.0),
                "{end}"
            );
        }
        for (i, node) in graph.nodes.iter().enumerate() {
            assert!(node.parent.is_none_or(|p| p < i));
            let lines = fork();
            let off = lines
                .iter()
                .map(|[a, b]| distance_to_segment(node.position_px, *a, *b));
            // A tip reaches to the round end of its limb.
            let most = if tips.contains(&i) { 5.0 } else { 2.0 };
            assert!(off.fold(f64::INFINITY, f64::min) < most, "{node:?}");
            let is_between = i > 0 && !tips.contains(&i);
            assert!(
                !is_between || (node.radius_px - 4.0).abs() < 1.5,
                "{node:?}"
            );
        }
    }

    /// The rough edge of a thick limb is none, and what no way leads to is of another tree.
    #[test]
    fn knobs_and_far_pieces_are_no_branches() {
        let mut lines = vec![[FOOT, Point2::new(100.0, 30.0)]];
        lines.push([Point2::new(100.0, 120.0), Point2::new(112.0, 118.0)]);
        lines.push([Point2::new(180.0, 20.0), Point2::new(180.0, 120.0)]);
        let graph = branches(&mask(&lines, 8.0), FOOT).expect("opencv");
        let tips = graph.children().iter().filter(|c| c.is_empty()).count();
        assert_eq!(tips, 1, "{graph:?}");
    }

    #[test]
    fn a_wide_gap_is_bridged_only_where_what_is_in_it_moves_with_the_tree() {
        let top = Point2::new(100.0, 20.0);
        let lines = [
            [FOOT, Point2::new(100.0, 120.0)],
            [Point2::new(100.0, 80.0), top],
        ];
        let still = mask(&lines, 4.0);
        let mut moving = mask(&lines, 4.0);
        moving.moves.fill(true);
        let highest = |graph: BranchGraph| {
            let heights = graph.nodes.iter().map(|n| n.position_px.y);
            heights.fold(f64::INFINITY, f64::min)
        };
        assert!(highest(branches(&still, FOOT).expect("opencv")) > 100.0);
        assert!(highest(branches(&moving, FOOT).expect("opencv")) < 30.0);
    }

    #[test]
    fn what_lies_on_the_ground_is_no_branch() {
        let low = Point2::new(70.0, 239.0);
        let lines = [[FOOT, Point2::new(100.0, 30.0)], [FOOT, low]];
        let graph = branches(&mask(&lines, 4.0), FOOT).expect("opencv");
        let tips = graph.children().iter().filter(|c| c.is_empty()).count();
        assert_eq!(tips, 1, "{graph:?}");
    }

    #[test]
    fn without_wood_there_is_no_graph() {
        let graph = branches(&mask(&[], 4.0), FOOT).expect("opencv");
        assert_eq!(graph.nodes, []);
    }
}
