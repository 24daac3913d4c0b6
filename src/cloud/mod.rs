//! Point clouds to trees.
//!
//! [`tree_of_cloud`] is the whole way: ground and noise off, points thinned, joined to their
//! neighbours; several trees parted from each other ([`stems`]); the foot of the trunk; middle
//! lines by the shortest ways from there ([`levels`]) or by space colonisation ([`colonise`]);
//! branches that hardly stand out pruned; radii by circles and tapers ([`radius`]). How well all that
//! agrees with the points ([`fit`]), and whether trees are boughs of one ([`boughs`]), makes the [`verdict`].

mod base;
mod boughs;
mod circle;
mod colonise;
mod error;
mod fit;
mod foot;
mod from_above;
mod graph;
mod grid;
mod ground;
mod leaves;
mod levels;
mod lines;
mod linked;
mod paths;
mod radius;
mod raw_tree;
mod refine;
mod register;
mod standing;
mod stems;
mod steps;
mod thin;
mod tree;
mod verdict;

pub use colonise::Colonisation;
pub use error::CloudError;
pub use lines::{LinePlace, Nearest, WoodPiece, places_seen, thickest};
pub use register::{PlacePair, Registration, by_lines, by_pairs, odd_pair};
pub use tree::{CloudFigures, CloudNode, CloudTree};
pub use verdict::verdict;

use crate::model::PointCloud;
use ground::Ground;
use linked::Linked;
use nalgebra::Point3;
use paths::Path;
use standing::Standing;
use std::sync::Arc;

/// Of a tree no more of the points than this share do not hang together with its foot.
const MOST_APART: f64 = 0.3;
/// Length of the stretches of the way along the wood, cells.
const STRETCH_CELLS: f32 = 3.0;
/// A twig stands out of its branch by so many cells.
const TWIG_CELLS: f64 = 3.0;
/// Forks on one way from the foot, and branches of a tree: of more only the longer ones are kept, by steps
/// of this factor.
/// Levels are counted in a byte, and a model has as many joints as two bytes count.
const MOST_FORKS: usize = 250;
const MOST_BRANCHES: usize = 4000;
const LONGER: f64 = 1.2;
/// Heights of trees, m.
const HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.05..=200.0;
/// What is lower than this share of how far it reaches to the side is ground, and no tree: crowns are twice as
/// wide as high at most.
const LEAST_HEIGHT: f64 = 0.2;

/// How the middle lines are found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum CloudMethod {
    /// Along the shortest ways from the foot.
    #[default]
    Paths,
    /// Space colonisation along the wood.
    Colonisation(Colonisation),
    /// Space colonisation of the bare points (Runions et al. 2007).
    Runions(Colonisation),
}

/// What may be chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudOptions {
    pub method: CloudMethod,
    /// Radius of the last twigs where it is known, m.
    pub twig_radius_m: Option<f64>,
    /// Whether the tree bears leaves, which are to be taken off.
    pub in_leaf: bool,
}

/// The trees in a cloud.
#[derive(Clone, Debug)]
pub struct CloudTrees {
    /// The largest first, by points of one distance; why there is none where it could not be made.
    pub trees: Vec<Result<CloudTree, CloudError>>,
    /// Of each point of the cloud its place in `trees`; `None` for ground, noise and undergrowth.
    pub tree_of_point: Vec<Option<u32>>,
    /// Points of the cloud, of ground and of noise.
    pub figures: CloudFigures,
    ground: Option<Arc<Ground>>,
}

impl CloudTrees {
    /// Height of the ground at a place against the origin of the cloud, m; `None` where no ground was
    /// scanned.
    pub fn ground_height_m(&self, x: f64, y: f64) -> Option<f64> {
        let ground = self.ground.as_ref()?;
        Some(ground.height_at(x as f32, y as f32).into())
    }
}

/// The tree in a cloud; of several the largest.
///
/// # Errors
/// There are too few points, they stand for no tree, or the trunk is missing.
pub fn tree_of_cloud(cloud: &PointCloud, options: CloudOptions) -> Result<CloudTree, CloudError> {
    let mut found = trees_of_cloud(cloud, options)?;
    found.trees.swap_remove(0)
}

/// All trees in a cloud, one at least.
///
/// # Errors
/// There are too few points, or they stand for no tree.
pub fn trees_of_cloud(cloud: &PointCloud, options: CloudOptions) -> Result<CloudTrees, CloudError> {
    let mut figures = CloudFigures {
        points: cloud.points.len(),
        step_m: steps::coarsest(&cloud.points).into(),
        ..CloudFigures::default()
    };
    let standing = Standing::of(&cloud.points, &mut figures)?;
    let ground = standing.ground.clone();
    let coarse = Linked::coarse(&standing, &mut figures)?;
    let trees = coarse.stand(&standing).trees;
    let mut found = CloudTrees {
        trees: Vec::with_capacity(trees),
        tree_of_point: vec![None; cloud.points.len()],
        figures,
        ground,
    };
    if trees < 2 {
        for (point, thinned) in standing.of_cloud.iter().zip(&coarse.thinned.of_point) {
            found.tree_of_point[*point as usize] = (*thinned != u32::MAX).then_some(0);
        }
        let linked = coarse.into_one_tree(&standing);
        found
            .trees
            .push(tree_of(&standing, linked, options, figures));
        return Ok(found);
    }
    drop(coarse);
    let fine = Linked::of_stand(&standing, trees)?;
    let stand = fine.stand(&standing);
    for (point, thinned) in standing.of_cloud.iter().zip(&fine.thinned.of_point) {
        let tree = stand.of_point.get(*thinned as usize);
        found.tree_of_point[*point as usize] = tree.copied().filter(|t| *t != stems::OF_NO_TREE);
    }
    drop(fine);
    for own in standing.split(&found.tree_of_point, stand.trees) {
        let tree = own.and_then(|own| tree_of_part(&own, figures.step_m, options));
        found.trees.push(tree);
    }
    let mut made: Vec<&mut CloudTree> = found.trees.iter_mut().flatten().collect();
    boughs::look_for_forks(&mut made);
    Ok(found)
}

/// The tree of the points that are of one tree, of a cloud whose coordinates have steps of `step_m`.
fn tree_of_part(
    standing: &Standing,
    step_m: f64,
    options: CloudOptions,
) -> Result<CloudTree, CloudError> {
    let mut figures = CloudFigures {
        points: standing.points.len(),
        step_m,
        ..CloudFigures::default()
    };
    let linked = Linked::of_tree(standing, &mut figures)?;
    tree_of(standing, linked, options, figures)
}

/// The tree that these points stand for.
fn tree_of(
    standing: &Standing,
    mut linked: Linked,
    options: CloudOptions,
    mut figures: CloudFigures,
) -> Result<CloudTree, CloudError> {
    figures.in_leaf = options.in_leaf;
    figures.is_grown_bare = matches!(options.method, CloudMethod::Runions(_));
    figures.has_ground = standing.ground.is_some();
    if options.in_leaf {
        linked = linked.without_leaves(standing, &mut figures)?;
    }
    let Linked {
        thinned,
        cell,
        graph,
    } = linked;
    let points = &thinned.points;
    let foot = foot::find(
        &standing.above_ground(points),
        &graph,
        standing.height,
        cell,
    )?;
    let ways = graph.shortest_ways(&foot);
    figures.apart = ways.length.iter().filter(|way| way.is_infinite()).count();
    if figures.apart as f64 > MOST_APART * points.len() as f64 {
        let share_percent = 100.0 * figures.apart as f64 / points.len() as f64;
        return Err(CloudError::Apart { share_percent });
    }
    let base = standing.foot_below(points, &foot);
    let by_levels = levels::level_tree(points, &graph, &ways, STRETCH_CELLS * cell);
    let raw = match options.method {
        CloudMethod::Paths => by_levels,
        CloudMethod::Colonisation(lengths) => {
            colonise::colonise(&by_levels, points, base, cell, &lengths)
        }
        CloudMethod::Runions(lengths) => colonise::colonise_bare(points, base, cell, &lengths),
    };
    let mut paths = raw.paths();
    let detail = radius::Detail::new(&standing.points, &thinned.of_point, points.len());
    radius::measure(&mut paths, &detail);
    let mut least = TWIG_CELLS * f64::from(cell);
    paths::prune(&mut paths, least);
    while paths::forks_on_one_way(&paths) > MOST_FORKS || paths.len() > MOST_BRANCHES {
        least *= LONGER;
        paths::prune(&mut paths, least);
    }
    reach_tips(&mut paths, points);
    radius::measure(&mut paths, &detail);
    paths::smooth(&mut paths);
    let stretch = f64::from(STRETCH_CELLS * cell);
    let twig = radius::twig_radius(&paths, radius::noise(&paths), options.twig_radius_m);
    refine::refine(&mut paths, points, &detail, f64::from(cell), stretch, twig);
    paths::prune(&mut paths, least);
    let noise = radius::noise(&paths);
    // The trunk forgets the circles at its foot when it is led down to the ground.
    figures.foot_share = fit::foot_share(&paths);
    figures.clear_stem = fit::clear_stem(&paths);
    base::stand(&mut paths, base, |at| standing.ground_at(at));
    figures.noise_m = noise;
    figures.twig_radius_m = radius::twig_radius(&paths, noise, options.twig_radius_m);
    radius::assign(&mut paths, figures.twig_radius_m);
    let hanging = points.len() - figures.apart;
    figures.on_wood = fit::on_wood(&paths, points, f64::from(cell), hanging);
    let nodes = tree::assemble(&paths, f64::from(cell));
    let Some(first) = nodes.first() else {
        return Err(CloudError::NoTree);
    };
    let highest = nodes
        .iter()
        .map(|n| n.position.z)
        .fold(f64::NEG_INFINITY, f64::max);
    figures.height_m = highest - first.position.z;
    let from_foot = |n: &CloudNode| (n.position - first.position).xy().norm();
    let width_m = nodes.iter().map(from_foot).fold(0.0, f64::max);
    if figures.height_m < LEAST_HEIGHT * width_m {
        return Err(CloudError::Low {
            height_m: figures.height_m,
            width_m,
        });
    }
    check_height(figures.height_m)?;
    Ok(CloudTree { nodes, figures })
}

/// Refuses a height, m, that no tree has.
///
/// # Errors
/// It is not from 0.05 to 200 m: the unit is another one.
pub fn check_height(height_m: f64) -> Result<(), CloudError> {
    if HEIGHTS_M.contains(&height_m) {
        return Ok(());
    }
    Err(CloudError::OddSize { height_m })
}

/// Lets every path end where its last points do.
fn reach_tips(paths: &mut [Path], points: &[Point3<f32>]) {
    for path in paths {
        let last = path.places.len() - 1;
        if last == 0 {
            continue;
        }
        let along = path.direction(last);
        let tip = &mut path.places[last];
        let ahead = tip
            .points
            .iter()
            .map(|p| (points[*p as usize].cast::<f64>() - tip.at).dot(&along));
        tip.at += along * ahead.fold(0.0, f64::max);
    }
}
