//! Point clouds to trees.
//!
//! [`tree_of_cloud`] is the whole way: ground and noise off, points thinned, joined to their
//! neighbours; several trees parted from each other ([`stems`]); the foot of the trunk; middle
//! lines by the shortest ways from there ([`levels`]) or by space colonisation ([`colonise`]);
//! branches that hardly stand out pruned; radii by circles and tapers ([`radius`]).

mod base;
mod circle;
mod colonise;
mod error;
mod foot;
mod graph;
mod grid;
mod ground;
mod leaves;
mod levels;
mod paths;
mod radius;
mod raw_tree;
mod refine;
mod register;
mod stems;
mod thin;
mod tree;

pub use error::CloudError;
pub use register::{PlacePair, Registration, WoodPiece, by_lines, by_pairs};
pub use tree::{CloudFigures, CloudNode, CloudTree};

use crate::model::PointCloud;
use crate::signal::median;
use graph::Graph;
use ground::Ground;
use nalgebra::{Point3, Vector3};
use paths::Path;
use std::sync::Arc;
use thin::Thinned;

/// Points that a tree takes at least.
const LEAST_POINTS: usize = 100;
/// Points that lie farther off than the size of the cloud without the outermost of them, on both
/// sides of each axis, are no part of the tree.
const OUTERMOST: f64 = 0.001;
/// Cells in which points are one, in the height of the tree at first; larger by this factor until
/// there are no more points than that.
const CELLS_IN_HEIGHT: f32 = 700.0;
const LARGER: f32 = 1.2;
const MOST_THINNED: usize = 150_000;
/// To part trees from each other there are so many times as many as there are trees, up to this.
const FINEST_TREES: usize = 20;
/// Gaps that are then led over, cells: trees that stand apart are not joined, and a wider search about
/// each of their points would take long.
const GAP_OF_STAND_CELLS: f32 = 8.0;
/// Points are neighbours up to so many cells apart; gaps are led over up to this share of the
/// tree's height.
const REACH_CELLS: f32 = 1.8;
const GAP_SHARE: f32 = 0.1;
/// Of a tree no more of the points than this share do not hang together with its foot.
const MOST_APART: f64 = 0.3;
/// Length of the stretches of the way along the wood, cells.
const STRETCH_CELLS: f32 = 3.0;
/// A twig stands out of its branch by so many cells.
const TWIG_CELLS: f64 = 3.0;
/// Forks on one way from the foot, and branches of a tree: of more only the longer ones are kept.
/// Levels are counted in a byte, and a model has as many joints as two bytes count.
const MOST_FORKS: usize = 250;
const MOST_BRANCHES: usize = 4000;
/// A tree whose lowest wood is farther above the ground than this share of its height has no trunk.
const TRUNKLESS: f32 = 0.25;
/// Heights of trees, m.
const HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.05..=200.0;

/// How the middle lines are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CloudMethod {
    /// Along the shortest ways from the foot.
    #[default]
    Paths,
    /// Space colonisation (Runions et al. 2007).
    Colonisation,
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
    /// The one with most points first; why there is none where it could not be made.
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

/// The tree in a cloud; of several the one with most points.
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
        ..CloudFigures::default()
    };
    let standing = Standing::of(&cloud.points, &mut figures)?;
    let ground = standing.ground.clone();
    let (few, cell) = thinned(&standing, MOST_THINNED, &mut figures)?;
    let coarse = Linked::of(few, cell, GAP_OF_STAND_CELLS * cell);
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
        let linked = coarse.bridged(GAP_SHARE * standing.height);
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
        found
            .trees
            .push(own.and_then(|own| tree_of_part(&own, options)));
    }
    Ok(found)
}

/// The tree of the points that are of one tree.
fn tree_of_part(standing: &Standing, options: CloudOptions) -> Result<CloudTree, CloudError> {
    let mut figures = CloudFigures {
        points: standing.points.len(),
        ..CloudFigures::default()
    };
    let linked = Linked::of_tree(standing, &mut figures)?;
    tree_of(standing, linked, options, figures)
}

/// Thinned points without noise, joined to their neighbours.
struct Linked {
    thinned: Thinned,
    cell: f32,
    graph: Graph,
}

impl Linked {
    /// The standing points as those of one tree.
    fn of_tree(standing: &Standing, figures: &mut CloudFigures) -> Result<Self, CloudError> {
        let (thinned, cell) = thinned(standing, MOST_THINNED, figures)?;
        Ok(Self::of(thinned, cell, GAP_SHARE * standing.height))
    }

    /// The standing points as those of so many trees.
    fn of_stand(standing: &Standing, trees: usize) -> Result<Self, CloudError> {
        let most = MOST_THINNED * trees.min(FINEST_TREES);
        let (thinned, cell) = thinned(standing, most, &mut CloudFigures::default())?;
        Ok(Self::of(thinned, cell, GAP_OF_STAND_CELLS * cell))
    }

    /// Gaps are led over up to `widest`.
    fn of(thinned: Thinned, cell: f32, widest: f32) -> Self {
        let graph = Graph::new(&thinned.points, REACH_CELLS * cell);
        Self {
            thinned,
            cell,
            graph,
        }
        .bridged(widest)
    }

    /// The same with wider gaps led over.
    fn bridged(self, widest: f32) -> Self {
        let reach = REACH_CELLS * self.cell;
        Self {
            graph: self.graph.bridged(&self.thinned.points, reach, widest),
            ..self
        }
    }

    fn stand(&self, standing: &Standing) -> stems::Stand {
        let above = standing.above_ground(&self.thinned.points);
        stems::find(&above, &self.graph, standing.height, self.cell)
    }

    /// The same without the points that are no wood.
    fn without_leaves(
        mut self,
        standing: &Standing,
        figures: &mut CloudFigures,
    ) -> Result<Self, CloudError> {
        take_leaves_off(&mut self, standing, figures)?;
        let widest = GAP_SHARE * standing.height;
        Ok(Self::of(self.thinned, self.cell, widest))
    }
}

/// The tree that these points stand for.
fn tree_of(
    standing: &Standing,
    mut linked: Linked,
    options: CloudOptions,
    mut figures: CloudFigures,
) -> Result<CloudTree, CloudError> {
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
        CloudMethod::Colonisation => colonise::colonise(&by_levels, points, base, cell),
    };
    let mut paths = raw.paths();
    let detail = radius::Detail::new(&standing.points, &thinned.of_point, points.len());
    radius::measure(&mut paths, &detail);
    let mut least = TWIG_CELLS * f64::from(cell);
    paths::prune(&mut paths, least);
    while paths::forks_on_one_way(&paths) > MOST_FORKS || paths.len() > MOST_BRANCHES {
        least *= f64::from(LARGER);
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
    base::stand(&mut paths, base, |at| standing.ground_at(at));
    figures.noise_m = noise;
    figures.twig_radius_m = radius::twig_radius(&paths, noise, options.twig_radius_m);
    radius::assign(&mut paths, figures.twig_radius_m);
    let nodes = tree::assemble(&paths, f64::from(cell));
    let Some(first) = nodes.first() else {
        return Err(CloudError::NoTree);
    };
    let highest = nodes
        .iter()
        .map(|n| n.position.z)
        .fold(f64::NEG_INFINITY, f64::max);
    figures.height_m = highest - first.position.z;
    if !HEIGHTS_M.contains(&figures.height_m) {
        return Err(CloudError::OddSize {
            height_m: figures.height_m,
        });
    }
    Ok(CloudTree { nodes, figures })
}

/// The points that stand on the ground.
struct Standing {
    points: Vec<Point3<f32>>,
    /// Of each the place in the cloud.
    of_cloud: Vec<u32>,
    ground: Option<Arc<Ground>>,
    height: f32,
}

impl Standing {
    fn of(all: &[Point3<f32>], figures: &mut CloudFigures) -> Result<Self, CloudError> {
        if all.len() < LEAST_POINTS {
            return Err(CloudError::TooFew {
                points: all.len(),
                least: LEAST_POINTS,
            });
        }
        let bounds = Bounds::of(all);
        let [wide, deep, height] = bounds.sizes();
        if height <= 0.0 || wide.max(deep) <= 0.0 {
            return Err(CloudError::Flat);
        }
        let mut points: Vec<Point3<f32>> = all.iter().copied().filter(|p| bounds.hold(p)).collect();
        figures.noise = all.len() - points.len();
        let ground = Ground::of(&points, height).map(Arc::new);
        let of_all = (0..).zip(all).filter(|(_, at)| bounds.hold(at));
        let mut of_cloud: Vec<u32> = of_all.map(|(place, _)| place).collect();
        if let Some(ground) = &ground {
            let before = points.len();
            let stands: Vec<bool> = points.iter().map(|p| !ground.holds(p)).collect();
            retain_flagged(&mut points, &stands);
            retain_flagged(&mut of_cloud, &stands);
            figures.ground = before - points.len();
        }
        Self {
            points,
            of_cloud,
            ground,
            height: 0.0,
        }
        .measured()
    }

    /// The same with its height.
    fn measured(mut self) -> Result<Self, CloudError> {
        if self.points.len() < LEAST_POINTS {
            return Err(CloudError::NoTree);
        }
        self.height = Extent::of(&self.points, 2).size;
        if self.height <= 0.0 {
            return Err(CloudError::Flat);
        }
        Ok(self)
    }

    /// The points of each of so many trees; `tree_of_point` goes by the points of the cloud.
    fn split(self, tree_of_point: &[Option<u32>], trees: usize) -> Vec<Result<Self, CloudError>> {
        let mut all: Vec<Self> = Vec::with_capacity(trees);
        for _ in 0..trees {
            all.push(Self {
                points: Vec::new(),
                of_cloud: Vec::new(),
                ground: self.ground.clone(),
                height: 0.0,
            });
        }
        for (at, place) in self.points.iter().zip(&self.of_cloud) {
            if let Some(tree) = tree_of_point[*place as usize] {
                all[tree as usize].points.push(*at);
                all[tree as usize].of_cloud.push(*place);
            }
        }
        all.into_iter().map(Self::measured).collect()
    }

    /// The points as high as they are above the ground.
    fn above_ground(&self, points: &[Point3<f32>]) -> Vec<Point3<f32>> {
        let mut above = points.to_vec();
        if let Some(ground) = &self.ground {
            above
                .iter_mut()
                .for_each(|p| p.z -= ground.height_at(p.x, p.y));
        }
        above
    }

    /// How high the ground is at a place, where any was scanned.
    fn ground_at(&self, at: &Point3<f64>) -> Option<f64> {
        let ground = self.ground.as_ref()?;
        Some(ground.height_at(at.x as f32, at.y as f32).into())
    }

    /// The foot below the lowest points of the trunk: in their middle, on the ground.
    fn foot_below(&self, points: &[Point3<f32>], lowest: &[u32]) -> Point3<f64> {
        let mut sum = Vector3::zeros();
        lowest
            .iter()
            .for_each(|p| sum += points[*p as usize].coords.cast::<f64>());
        let mut foot = Point3::from(sum / lowest.len().max(1) as f64);
        foot.z = lowest
            .iter()
            .map(|p| f64::from(points[*p as usize].z))
            .fold(foot.z, f64::min);
        foot.z = self.ground_at(&foot).map_or(foot.z, |z| foot.z.min(z));
        foot
    }
}

/// Keeps what is flagged.
fn retain_flagged<T>(all: &mut Vec<T>, flags: &[bool]) {
    let mut flags = flags.iter();
    all.retain(|_| flags.next() == Some(&true));
}

/// Where most points lie along an axis.
#[derive(Clone, Copy, Debug)]
struct Extent {
    low: f32,
    size: f32,
}

impl Extent {
    fn of(points: &[Point3<f32>], axis: usize) -> Self {
        let mut all: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        let off = (OUTERMOST * all.len() as f64) as usize;
        let last = all.len() - 1 - off;
        let low = *all.select_nth_unstable_by(off, f32::total_cmp).1;
        let high = *all.select_nth_unstable_by(last, f32::total_cmp).1;
        Self {
            low,
            size: high - low,
        }
    }

    fn holds(&self, x: f32) -> bool {
        (self.low - self.size..=self.low + 2.0 * self.size).contains(&x)
    }
}

/// Where most points lie along each axis.
#[derive(Clone, Copy, Debug)]
struct Bounds([Extent; 3]);

impl Bounds {
    fn of(points: &[Point3<f32>]) -> Self {
        Self([0, 1, 2].map(|axis| Extent::of(points, axis)))
    }

    fn sizes(&self) -> [f32; 3] {
        self.0.map(|extent| extent.size)
    }

    fn hold(&self, point: &Point3<f32>) -> bool {
        let mut along = self.0.iter().zip(point.iter());
        along.all(|(extent, x)| extent.holds(*x))
    }
}

/// The standing points thinned and without noise, and the side of their cells.
fn thinned(
    standing: &Standing,
    most: usize,
    figures: &mut CloudFigures,
) -> Result<(Thinned, f32), CloudError> {
    let mut cell = standing.height / CELLS_IN_HEIGHT;
    let mut thinned = Thinned::of(&standing.points, cell);
    while thinned.points.len() > most {
        cell *= LARGER;
        thinned = Thinned::of(&standing.points, cell);
    }
    let cell = cell.max(spacing(&thinned.points, cell));
    let kept = thin::is_no_outlier(&thinned.points, cell);
    thinned.without(&kept);
    figures.noise += thinned.of_point.len() - thinned.kept_points();
    figures.cell_m = f64::from(cell);
    let lowest = thinned
        .points
        .iter()
        .min_by(|a, b| a.z.total_cmp(&b.z))
        .ok_or(CloudError::NoTree)?;
    if let Some(ground) = &standing.ground {
        let gap = lowest.z - ground.height_at(lowest.x, lowest.y);
        if gap > TRUNKLESS * standing.height {
            return Err(CloudError::NoTrunk {
                gap_m: f64::from(gap),
            });
        }
    }
    Ok((thinned, cell))
}

/// Takes off the points that are no wood.
fn take_leaves_off(
    linked: &mut Linked,
    standing: &Standing,
    figures: &mut CloudFigures,
) -> Result<(), CloudError> {
    let (points, cell) = (&linked.thinned.points, linked.cell);
    let foot = foot::find(
        &standing.above_ground(points),
        &linked.graph,
        standing.height,
        cell,
    )?;
    let ways = linked.graph.shortest_ways(&foot);
    let is_wood = leaves::is_wood(points, &linked.graph, &ways, cell);
    let before = linked.thinned.kept_points();
    linked.thinned.without(&is_wood);
    figures.leaves = before - linked.thinned.kept_points();
    Ok(())
}

/// The median distance of points to the third of their neighbours: of a sparse cloud it is more
/// than the side of the cells.
fn spacing(points: &[Point3<f32>], cell: f32) -> f32 {
    let grid = grid::Grid::new(points, 4.0 * cell);
    let step = (points.len() / 1000).max(1);
    let mut thirds: Vec<f64> = Vec::new();
    for at in points.iter().step_by(step) {
        let mut near: Vec<f32> = Vec::new();
        let mut reach = 4.0 * cell;
        while near.len() < 4 && reach < 1000.0 * cell {
            near.clear();
            grid.within(at, reach, |_, square| near.push(square));
            reach *= 2.0;
        }
        near.sort_unstable_by(f32::total_cmp);
        thirds.extend(near.get(3).map(|square| f64::from(square.sqrt())));
    }
    median(thirds, f64::total_cmp).map_or(cell, |third| third as f32)
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
