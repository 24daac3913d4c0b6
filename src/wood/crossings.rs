//! Limbs that cross in the picture are taken apart.
//!
//! The cheapest ways from the foot take what lies beyond a crossing for a branch of the limb that
//! reaches it first. The other limb then ends there, for no reason, or where it meets another way
//! that goes down along it from the crossing. Where a branch ends at the side of a limb, or meets
//! such a way, and one leaves that limb beside it on the other side and goes on as the first came,
//! they are one: at a crossing, direction decides.

use super::paths::Track;
use super::ways::Grid;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// Directions are those over so many radii of the limb that is crossed, and px, in the mask.
const OVER_RADII: f64 = 3.0;
const OVER_PX: f64 = 16.0;
/// A branch ends beside a limb within so many of its radii, and px, of where another leaves it.
const BESIDE_RADII: f64 = 4.0;
const BESIDE_PX: f64 = 12.0;
/// Two branches that go towards each other meet where no more than so many radii, and px, are
/// between their tips.
const MEET_RADII: f64 = 2.0;
const MEET_PX: f64 = 8.0;
/// The part of a branch within so many radii, and px, of the middle of what it leaves lies on that.
const ON_LIMB_RADII: f64 = 1.3;
const ON_LIMB_PX: f64 = 2.0;
/// So many pixels at the end of a branch show how wide it is there.
const END: usize = 16;
/// Nothing turns by more than this at a crossing: 40 degrees.
const MOST_TURN: f64 = 0.7;

/// The same branches, those that go on beyond a crossing joined with what they go on from. What
/// bears others comes before them.
pub(super) fn taken_apart(grid: &Grid, tracks: Vec<Track>) -> Vec<Track> {
    let mut tracks = tracks;
    let mut carriers = carriers(&tracks);
    for branch in 0..tracks.len() {
        let Some(leaves) = carriers[branch] else {
            continue;
        };
        if turns_less(grid, &tracks, branch, leaves) {
            change_upper_parts(&mut tracks, branch, leaves);
            carriers = self::carriers(&tracks);
        }
    }
    while let Some(crossing) = find(grid, &tracks) {
        join(&mut tracks, crossing);
    }
    carriers_first(tracks)
}

/// Whether a limb turns by more, where a branch leaves it, than from itself into the branch.
fn turns_less(grid: &Grid, tracks: &[Track], branch: usize, leaves: OnTrack) -> bool {
    let Some(fork) = Fork::of(grid, tracks, branch, leaves) else {
        return false;
    };
    let limb = &tracks[leaves.track].pixels;
    let came = way_back(grid, &limb[..=leaves.index], over(fork.radius));
    let goes = way(grid, limb[leaves.index..].iter(), over(fork.radius));
    let of_limb = came.zip(goes).map(|(came, goes)| came.angle(&goes));
    of_limb.is_some_and(|turn| turn > fork.turn)
}

/// Makes a branch the upper part of the limb that it leaves, and that the branch.
fn change_upper_parts(tracks: &mut [Track], branch: usize, leaves: OnTrack) {
    let upper = tracks[leaves.track].pixels.split_off(leaves.index);
    let other = std::mem::replace(&mut tracks[branch].pixels, upper);
    tracks[leaves.track].pixels.extend(other);
}

/// A branch that ends at a crossing, and what goes on from it.
struct Crossing {
    ends: Ending,
    goes_on: usize,
    /// The first pixel of the latter that is beyond the limb that is crossed.
    beyond: usize,
}

/// A branch that ends.
#[derive(Clone)]
struct Ending {
    track: usize,
    /// The way that comes down along it and meets it, where one does.
    met: Option<usize>,
    /// The pixels of both, up to where the latter began.
    pixels: Vec<usize>,
}

/// The crossing with the smallest turn.
fn find(grid: &Grid, tracks: &[Track]) -> Option<Crossing> {
    let carriers = carriers(tracks);
    let endings = endings(grid, tracks, &carriers);
    let mut best = None;
    let mut least_turn = MOST_TURN;
    for (goes_on, track) in tracks.iter().enumerate() {
        let Some(leaves) = carriers[goes_on] else {
            continue;
        };
        let Some(fork) = Fork::of(grid, tracks, goes_on, leaves) else {
            continue;
        };
        for ends in &endings {
            let is_own = is_carried(&carriers, ends.track, goes_on) || ends.met == Some(goes_on);
            if ends.track == leaves.track || is_own {
                continue;
            }
            let turn = fork.turn_from(grid, &ends.pixels);
            if let Some(turn) = turn.filter(|turn| *turn < least_turn.min(fork.turn)) {
                least_turn = turn;
                best = Some(Crossing {
                    ends: ends.clone(),
                    goes_on,
                    beyond: fork.beyond.min(first_fork(track, goes_on, &carriers)),
                });
            }
        }
    }
    best
}

/// All branches with their ends, and those that meet another with its.
fn endings(grid: &Grid, tracks: &[Track], carriers: &[Option<OnTrack>]) -> Vec<Ending> {
    let mut endings = Vec::new();
    for (track, own) in tracks.iter().enumerate() {
        let own_pixels = without_tip(grid, own, last_fork(track, carriers));
        endings.push(Ending {
            track,
            met: None,
            pixels: own_pixels.to_vec(),
        });
        for (met, other) in tracks.iter().enumerate() {
            let is_own = is_carried(carriers, track, met) || is_carried(carriers, met, track);
            if is_own || !meet(grid, own, other) {
                continue;
            }
            let other_pixels = without_tip(grid, other, last_fork(met, carriers));
            let mut pixels = own_pixels.to_vec();
            pixels.extend(other_pixels.iter().skip(1).rev());
            endings.push(Ending {
                track,
                met: Some(met),
                pixels,
            });
        }
    }
    endings
}

/// The pixels of a branch up to its tip, but not into it: the farthest pixel is in a corner. Those up
/// to `fork` stay.
fn without_tip<'a>(grid: &Grid, track: &'a Track, fork: usize) -> &'a [usize] {
    let pixels = &track.pixels;
    let last = pixels.len() - 1;
    let end = &pixels[last.saturating_sub(END)..];
    let radius = end
        .iter()
        .map(|pixel| grid.inside[*pixel])
        .fold(0.0, f32::max);
    let tip = grid.place(pixels[last]);
    let off_tip = pixels.iter().rev().map(|p| (grid.place(*p) - tip).norm());
    let in_tip = off_tip.take_while(|off| *off < f64::from(radius)).count();
    &pixels[..(last + 1 - in_tip).max(fork + 1).max(2).min(last + 1)]
}

/// Whether two branches go towards each other, and end where they meet.
fn meet(grid: &Grid, a: &Track, b: &Track) -> bool {
    let (Some(&end_a), Some(&end_b)) = (a.pixels.last(), b.pixels.last()) else {
        return false;
    };
    let radius = f64::from(grid.inside[end_a].max(grid.inside[end_b]));
    let apart = (grid.place(end_a) - grid.place(end_b)).norm();
    if apart > MEET_RADII * radius + MEET_PX {
        return false;
    }
    let [came_a, came_b] = [a, b].map(|track| way_back(grid, &track.pixels, over(radius)));
    let ways = came_a.zip(came_b);
    ways.is_some_and(|(a, b)| a.angle(&-b) < MOST_TURN)
}

/// Where a branch leaves a limb.
struct Fork<'a> {
    track: &'a Track,
    /// Half the width of the limb there, px.
    radius: f64,
    /// The first pixel of the branch that is not on the limb.
    beyond: usize,
    /// Where the branch goes from there.
    way: Vector2<f64>,
    /// By how much that turns from where the limb came, radians.
    turn: f64,
}

impl<'a> Fork<'a> {
    fn of(grid: &Grid, tracks: &'a [Track], branch: usize, leaves: OnTrack) -> Option<Self> {
        let (track, limb) = (&tracks[branch], &tracks[leaves.track]);
        let fork = grid.place(track.pixels[0]);
        let radius = f64::from(grid.inside[track.pixels[0]]);
        let on_limb = ON_LIMB_RADII * radius + ON_LIMB_PX;
        let mut off_fork = track.pixels.iter().map(|p| (grid.place(*p) - fork).norm());
        let beyond = off_fork.position(|off| off > on_limb)?;
        let way = way(grid, track.pixels[beyond..].iter(), over(radius))?;
        let came = way_back(grid, &limb.pixels[..=leaves.index], over(radius))?;
        Some(Self {
            track,
            radius,
            beyond,
            way,
            turn: came.angle(&way),
        })
    }

    /// The larger of the turns from the end of another branch to this one, over the limb, and from
    /// its direction to this one's, radians; `None` where it does not end beside the fork, or there
    /// is no wood between.
    fn turn_from(&self, grid: &Grid, other: &[usize]) -> Option<f64> {
        let end = grid.place(*other.last()?);
        let beside = BESIDE_RADII * self.radius + BESIDE_PX;
        if (grid.place(self.track.pixels[0]) - end).norm() > beside {
            return None;
        }
        let came = way_back(grid, other, over(self.radius))?;
        let across = grid.place(self.track.pixels[self.beyond]) - end;
        let count = across.norm().ceil().max(1.0);
        let mut between = (0..=count as usize).map(|k| end + across * (k as f64 / count));
        let is_wood = between.all(|at| grid.inside[grid.nearest(at)] > 0.0);
        is_wood.then(|| came.angle(&self.way).max(came.angle(&across)))
    }
}

/// Over how much of a way its direction is taken, beside a limb of this radius, px.
fn over(radius: f64) -> f64 {
    OVER_RADII * radius + OVER_PX
}

/// From the first of some pixels to the last that is within `reach` of it; `None` where that is
/// less than half of it.
fn way<'a>(
    grid: &Grid,
    mut pixels: impl Iterator<Item = &'a usize>,
    reach: f64,
) -> Option<Vector2<f64>> {
    let first = grid.place(*pixels.next()?);
    let ways = pixels.map(|pixel| grid.place(*pixel) - first);
    let way = ways.take_while(|way| way.norm() <= reach).last()?;
    (way.norm() >= 0.5 * reach).then_some(way)
}

/// The way to the last of some pixels, over as much.
fn way_back(grid: &Grid, pixels: &[usize], reach: f64) -> Option<Vector2<f64>> {
    way(grid, pixels.iter().rev(), reach).map(|way| -way)
}

/// A place on a track.
#[derive(Clone, Copy, Debug)]
struct OnTrack {
    track: usize,
    index: usize,
}

/// Where each track leaves another; `None` for those that begin at the foot.
fn carriers(tracks: &[Track]) -> Vec<Option<OnTrack>> {
    let mut on: BTreeMap<usize, OnTrack> = BTreeMap::new();
    for (track, pixels) in tracks.iter().map(|t| &t.pixels).enumerate() {
        // The first is one of what is left.
        for (index, &pixel) in pixels.iter().enumerate().skip(1) {
            on.entry(pixel).or_insert(OnTrack { track, index });
        }
    }
    let first = tracks.iter().map(|t| t.pixels.first());
    first.map(|pixel| on.get(pixel?).copied()).collect()
}

/// A track, what carries it, and so on down to the foot. A ring would be a fault; it is not followed
/// round for ever.
fn down(carriers: &[Option<OnTrack>], track: usize) -> impl Iterator<Item = usize> {
    let downwards = std::iter::successors(Some(track), |t| Some(carriers[*t]?.track));
    downwards.take(carriers.len() + 1)
}

/// Whether a track is another one, or is carried by it.
fn is_carried(carriers: &[Option<OnTrack>], track: usize, by: usize) -> bool {
    down(carriers, track).any(|t| t == by)
}

/// The first pixel of a track that another leaves.
fn first_fork(track: &Track, number: usize, carriers: &[Option<OnTrack>]) -> usize {
    let forks = carriers.iter().flatten().filter(|on| on.track == number);
    let last = track.pixels.len() - 1;
    forks.map(|on| on.index).min().unwrap_or(last)
}

/// The last pixel of a track that another leaves; 0 where none does.
fn last_fork(number: usize, carriers: &[Option<OnTrack>]) -> usize {
    let forks = carriers.iter().flatten().filter(|on| on.track == number);
    forks.map(|on| on.index).max().unwrap_or(0)
}

/// Makes the branches of a crossing one.
fn join(tracks: &mut Vec<Track>, crossing: Crossing) {
    let Crossing {
        ends,
        goes_on,
        beyond,
    } = crossing;
    let mut pixels = ends.pixels;
    pixels.extend(&tracks[goes_on].pixels[beyond..]);
    tracks[ends.track].pixels = pixels;
    let mut gone = vec![goes_on];
    gone.extend(ends.met);
    gone.sort_unstable();
    for track in gone.into_iter().rev() {
        tracks.remove(track);
    }
}

/// The same tracks in such an order that each comes after what it leaves.
fn carriers_first(tracks: Vec<Track>) -> Vec<Track> {
    let carriers = carriers(&tracks);
    let mut ordered: Vec<(usize, Track)> = Vec::with_capacity(tracks.len());
    for (number, track) in tracks.into_iter().enumerate() {
        ordered.push((down(&carriers, number).count(), track));
    }
    ordered.sort_by_key(|(depth, _)| *depth);
    ordered.into_iter().map(|(_, track)| track).collect()
}

#[cfg(test)]
mod tests {
    use super::super::mask::WoodMask;
    use super::super::paths::branches;
    use crate::model::{BranchGraph, Size};
    use nalgebra::{Point2, distance};

    const FOOT: Point2<f64> = Point2::new(100.0, 230.0);

    fn traced(lines: &[[Point2<f64>; 2]]) -> BranchGraph {
        let mask = WoodMask::made_up(Size::new(200, 240), lines, 3.0);
        branches(&mask, FOOT).expect("opencv")
    }

    /// How near the way from the foot to the tip that is nearest to `tip` comes to a place, px.
    fn passes(graph: &BranchGraph, tip: Point2<f64>, place: Point2<f64>) -> f64 {
        let to = |node: &usize, at| distance(&graph.nodes[*node].position_px, &at);
        let nodes = 0..graph.nodes.len();
        let tip = nodes.min_by(|a, b| to(a, tip).total_cmp(&to(b, tip)));
        let way = std::iter::successors(tip, |node| graph.nodes[*node].parent);
        way.map(|node| to(&node, place))
            .fold(f64::INFINITY, f64::min)
    }

    /// The right limb is bent, and its way to the crossing longer.
    #[test]
    fn limbs_that_cross_go_on_as_they_came() {
        let fork = Point2::new(100.0, 205.0);
        let (left, right) = (Point2::new(60.0, 150.0), Point2::new(160.0, 150.0));
        let (left_tip, right_tip) = (Point2::new(36.0, 40.0), Point2::new(150.0, 32.0));
        let lines = [
            [FOOT, fork],
            [fork, left],
            [fork, right],
            [left, right_tip],
            [right, left_tip],
        ];
        let graph = traced(&lines);
        let tips = graph.children().iter().filter(|c| c.is_empty()).count();
        assert_eq!(tips, 2, "{graph:?}");
        assert!(passes(&graph, right_tip, left) < 8.0, "{graph:?}");
        assert!(passes(&graph, left_tip, right) < 8.0, "{graph:?}");
        for (i, node) in graph.nodes.iter().enumerate() {
            assert!(node.parent.is_none_or(|parent| parent < i));
        }
    }

    /// Twigs to both sides of a limb that none ends beside stay its own.
    #[test]
    fn a_limb_with_twigs_to_both_sides_is_no_crossing() {
        let at = Point2::new(100.0, 120.0);
        let (left, right) = (Point2::new(50.0, 90.0), Point2::new(150.0, 90.0));
        let lines = [[FOOT, Point2::new(100.0, 30.0)], [at, left], [at, right]];
        let graph = traced(&lines);
        let tips = graph.children().iter().filter(|c| c.is_empty()).count();
        assert_eq!(tips, 3, "{graph:?}");
        assert!(passes(&graph, left, FOOT) < 1.0 && passes(&graph, right, at) < 12.0);
    }
}
