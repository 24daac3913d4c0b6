//! Where clusters stand and how large they are, so that their density is that of the picture.

use super::attachment::{AttachmentPoint, AttachmentPoints, Side};
use super::cluster::{Cluster, orientation};
use super::density::{Cover, correlation, smoothed};
use super::hidden::emptiest;
use super::target::Target;
use super::template::Template;
use super::view::Sampling;
use crate::random::{Generator, generator};
use nalgebra::{Point2, Point3, Vector3};
use rand::RngExt;
use rand::seq::IndexedRandom;
use rand_distr::StandardNormal;

/// Layers of leaves one behind the other that a size is first tried with.
const LAYERS: f64 = 2.0;
/// Sizes that are tried, each from what the one before covered.
const TRIES: usize = 5;
/// Shares of the clusters: seeds at most; seeds and density together; with those that stand on
/// branches that bear few, which the picture does not show, but without them the crown would be
/// thin from the side. What is left closes gaps.
const SEEDED: f64 = 0.35;
const BY_DENSITY: f64 = 0.42;
const BEFORE_GAPS: f64 = 0.72;
/// Rounds in which gaps are looked for.
const ROUNDS: usize = 6;
/// Seeds with less leaf around them are corners of something else.
const LEAST_DENSITY: f32 = 0.15;
/// Where more leaf is wanted than this, what is behind does not count.
const HIDING: f32 = 0.4;
/// A cluster that is put on a branch stands so far beside it at most, as a share of the tree's
/// height.
const ASIDE: f64 = 0.02;
/// A leaf stands so far before or behind its branch at most, as a share of the tree's height; where
/// the crown is thin less, by its density.
const DEEPEST: f64 = 1.0 / 15.0;
/// The crown's emptiest places are looked for in cubes of so many cluster sizes.
const CUBE: f64 = 1.5;
/// Where the target is a mask of leaves, so great a share of a cluster's corners at least is seen where
/// more than so much of a cell is wanted, in one of so many turns; or it is left out.
const LEAST_WITHIN: f64 = 0.8;
const HALF_WANTED: f32 = 0.5;
const TURNS: u32 = 4;
/// Golden section: values `k * GOLDEN mod 1` fill the interval evenly for any number of them.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// All that decides where a cluster goes.
pub(super) struct LeafPlacer<'a> {
    pub attachments: AttachmentPoints,
    /// Depth of the foremost wood in every cell.
    pub wood: Vec<f32>,
    pub target: &'a Target,
    pub template: &'a Template,
    /// In cells, strongest first.
    pub seeds: Vec<Point2<f64>>,
    /// The trunk's top at rest.
    pub axis: Point3<f64>,
    pub height: f64,
    /// Clusters.
    pub count: usize,
    pub seed: u64,
    pub sampling: Sampling,
    /// The target is a mask of single leaves.
    pub is_mask: bool,
}

impl LeafPlacer<'_> {
    /// Of the sizes tried, the clusters whose density is most like the target's.
    pub fn plant(&mut self) -> Vec<Cluster> {
        let wanted: f64 = self.target.wanted.iter().map(|&w| f64::from(w)).sum();
        let cells = self.target.grid.length(1.0).max(1e-9).powi(2);
        if self.attachments.all.is_empty() || self.count == 0 || wanted < 1.0 {
            return Vec::new();
        }
        let one = self.template.mean_area().max(1e-9);
        let mut size = self.bounded((LAYERS * wanted / cells / (self.count as f64 * one)).sqrt());
        let mut best: Option<(f64, Vec<Cluster>)> = None;
        for _ in 0..TRIES {
            let (clusters, covered) = self.attempt(size);
            let width = self.target.grid.size.width as usize;
            let density = smoothed(&covered, width, self.target.sigma);
            let pairs = density.iter().zip(&self.target.density);
            let off: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
            if best.as_ref().is_none_or(|(before, _)| off < *before) {
                best = Some((off, clusters));
            }
            let covered: f64 = covered.iter().map(|&c| f64::from(c)).sum();
            let next = self.bounded(size * (wanted / covered.max(1.0)).powf(0.8).clamp(0.6, 1.7));
            if (next / size - 1.0).abs() < 0.01 {
                break;
            }
            size = next;
        }
        best.map(|(_, clusters)| clusters).unwrap_or_default()
    }

    /// Clusters of one size, whatever they cover.
    pub fn plant_of_size(&mut self, size: f64) -> Vec<Cluster> {
        if self.attachments.all.is_empty() {
            Vec::new()
        } else {
            self.attempt(self.bounded(size)).0
        }
    }

    /// A cluster is seen as one, and is smaller than the crown.
    fn bounded(&self, size: f64) -> f64 {
        size.clamp(0.004 * self.height, 0.25 * self.height)
    }

    /// The clusters, and which cells are covered by leaves that no wood hides.
    fn attempt(&mut self, size: f64) -> (Vec<Cluster>, Vec<f32>) {
        self.attachments.clear();
        let wood = std::mem::take(&mut self.wood);
        let found = self.attempt_before(&wood, size);
        self.wood = wood;
        found
    }

    fn attempt_before(&mut self, wood: &[f32], size: f64) -> (Vec<Cluster>, Vec<f32>) {
        let mut work = Work {
            random: generator(self.seed, 0),
            clusters: Vec::with_capacity(self.count),
            cover: Cover::new(self.target.grid, wood),
        };
        if let Sampling::Random { spread } = self.sampling {
            self.at_random(spread, size, &mut work);
            return (work.clusters, work.cover.covered);
        }
        let most = ((SEEDED * self.count as f64).ceil() as usize).min(self.count);
        let seeds: Vec<Point2<f64>> = self
            .seeds
            .iter()
            .copied()
            .filter(|cell| self.density_at(*cell).is_some_and(|d| d > LEAST_DENSITY))
            .collect();
        // Every n-th: the strongest corners all lie on the border, before the sky.
        let used = seeds.len().min(most);
        for k in 0..used {
            let cell = seeds[k * seeds.len() / used];
            self.add(cell, self.half(cell), size, &mut work);
        }
        self.spread(BY_DENSITY, Missing::Density, size, &mut work);
        self.fill(BEFORE_GAPS, size, &mut work);
        for round in 1..=ROUNDS {
            let share = BEFORE_GAPS + (1.0 - BEFORE_GAPS) * round as f64 / ROUNDS as f64;
            self.spread(share, Missing::Gaps, size, &mut work);
        }
        (work.clusters, work.cover.covered)
    }

    /// The density wanted at a cell of the picture.
    fn density_at(&self, cell: Point2<f64>) -> Option<f32> {
        let i = self.target.grid.index(cell)?;
        Some(self.target.density[i])
    }

    /// How many clusters are missing until there are `share` of all.
    fn missing(&self, share: f64, work: &Work) -> usize {
        ((share * self.count as f64).round() as usize).saturating_sub(work.clusters.len())
    }

    /// Bright leaves are in front (Li 2011 app. B.1).
    fn half(&self, cell: Point2<f64>) -> Side {
        if self.target.is_bright(cell) {
            Side::Front
        } else {
            Side::Back
        }
    }

    /// Before the wood that is seen at a cell, or in the half that its colour says where there is
    /// none.
    fn before_wood(&self, cell: Point2<f64>, wood: &[f32]) -> Side {
        let depth = self
            .target
            .grid
            .index(cell)
            .and_then(|i| wood.get(i))
            .copied()
            .unwrap_or(f32::NEG_INFINITY);
        if depth.is_finite() {
            Side::Before(f64::from(depth) - 0.5 * DEEPEST * self.height)
        } else {
            self.half(cell)
        }
    }

    /// Clusters where something is `missing`, until there are `share` of all.
    fn spread(&mut self, share: f64, missing: Missing, size: f64, work: &mut Work<'_>) {
        let count = self.missing(share, work);
        // By squares of about a cluster's size: a gap that large counts, specks between leaves do
        // not.
        let grid = self.target.grid;
        let side = (0.5 * grid.length(size)).round().max(1.0) as usize;
        let across = (grid.size.width as usize).div_ceil(side);
        let squares = cumulative(&self.missing_by_square(missing, side, work));
        let Some(&sum) = squares.last().filter(|sum| **sum > 0.0) else {
            return;
        };
        let first = work.random.random::<f64>();
        for k in 0..count {
            let at = sum * (first + k as f64 * GOLDEN).fract();
            let square = squares.partition_point(|&s| s <= at).min(squares.len() - 1);
            let corner = Point2::new(square % across * side, square / across * side);
            let cell = corner.map(|c| c as f64 - 0.5 + side as f64 * work.random.random::<f64>());
            if grid.index(cell).is_some() {
                let half = match missing {
                    Missing::Density => self.half(cell),
                    Missing::Gaps => self.before_wood(cell, work.cover.before),
                };
                self.add(cell, half, size, work);
            }
        }
    }

    /// How much is missing in each square of `side` cells, row by row.
    fn missing_by_square(&self, missing: Missing, side: usize, work: &Work) -> Vec<f64> {
        let grid = self.target.grid;
        let width = grid.size.width as usize;
        let across = width.div_ceil(side);
        let mut squares = vec![0.0; across * (grid.size.height as usize).div_ceil(side)];
        let cells = self.target.wanted.iter().zip(&work.cover.covered);
        for (i, (wanted, covered)) in cells.enumerate() {
            let amount = match missing {
                Missing::Density => *wanted,
                Missing::Gaps => wanted * (1.0 - covered),
            };
            squares[i / width / side * across + i % width / side] += f64::from(amount);
        }
        squares
    }

    /// Clusters on branches where the crown is emptiest and the picture's leaves hide them, until
    /// there are `share` of all.
    fn fill(&mut self, share: f64, size: f64, work: &mut Work<'_>) {
        let grid = self.target.grid;
        let left = self.missing(share, work);
        let leaves: Vec<Point3<f64>> = work.clusters.iter().map(|c| c.centre).collect();
        let all = &self.attachments.all;
        for i in emptiest(all, |p| self.is_hidden(p), &leaves, CUBE * size, left) {
            let attachment = &self.attachments.all[i];
            let aside = grid.length(ASIDE * self.height);
            let side = if work.random.random::<f64>() < 0.5 {
                Side::Front
            } else {
                Side::Back
            };
            let cell = attachment
                .cell
                .map(|c| c + aside * work.random.random_range(-1.0..1.0));
            let sight = Sight {
                cell,
                distance: aside,
                side,
            };
            self.place(i, &sight, size, work);
        }
    }

    /// Whether a thin branch is behind leaves that the picture shows.
    fn is_hidden(&self, attachment: &AttachmentPoint) -> bool {
        let density = self.density_at(attachment.cell);
        !attachment.thick && density.is_some_and(|d| d > HIDING)
    }

    /// A cluster that is seen at `cell`, on a branch of that side of the tree.
    fn add(&mut self, cell: Point2<f64>, side: Side, size: f64, work: &mut Work<'_>) {
        if let Some((i, distance)) = self.attachments.seat(cell, side) {
            let sight = Sight {
                cell,
                distance,
                side,
            };
            self.place(i, &sight, size, work);
        }
    }

    /// A cluster on branch place `i`.
    fn place(&self, i: usize, sight: &Sight, size: f64, work: &mut Work<'_>) {
        let &Sight {
            cell,
            distance,
            side,
        } = sight;
        let attachment = &self.attachments.all[i];
        let grid = &self.target.grid;
        // A crown is as thin from front to back where it is thin or ends in the picture: leaves that
        // stood far before it there would hang beside the tree, seen from the side.
        let share = self.density_at(cell).map_or(0.0, f64::from).clamp(0.0, 1.0);
        let deepest = share * DEEPEST * self.height;
        let far = (distance / grid.length(1.0).max(1e-9)).min(deepest);
        // Off the bark at least, on the side that it is lit from or not.
        let off = far * work.random.random::<f64>() + attachment.radius + 0.2 * size;
        let depth = match side {
            Side::Front => attachment.depth + off,
            Side::Back => attachment.depth - off,
            Side::Before(wood) => {
                let clear = wood + 0.5 * deepest + 0.5 * size;
                let nearest = attachment.depth + off;
                let farthest = nearest.max(attachment.depth + deepest + size);
                clear.clamp(nearest, farthest)
            }
        };
        let posed = grid.model_at(cell, depth);
        // At the crown's border a whole cluster would stand out of it.
        let varied = 1.0 + 0.15 * work.random.random_range(-1.0..1.0);
        let size = size * (0.5 + 0.6 * share).clamp(0.5, 1.1) * varied;
        let centre = attachment.carried.to_rest(&posed);
        self.put(Cluster::upright(i, centre, size), work);
    }

    /// As leaves are sampled without a picture: about the branches, with a deviation of `spread`
    /// tree heights.
    fn at_random(&mut self, spread: f64, size: f64, work: &mut Work<'_>) {
        let bearing: Vec<usize> = (0..self.attachments.all.len())
            .filter(|&i| !self.attachments.all[i].thick)
            .collect();
        for _ in 0..self.count {
            let Some(&i) = bearing.choose(&mut work.random) else {
                return;
            };
            let off = normal_vector(&mut work.random);
            let centre = self.attachments.all[i].at + off * (spread * self.height);
            let size = size * (1.0 + 0.15 * work.random.random_range(-1.0..1.0));
            self.put(Cluster::upright(i, centre, size), work);
        }
    }

    /// Whether most of a cluster is seen where leaves are wanted.
    fn is_within(&self, corners: impl Iterator<Item = Point2<f64>>) -> bool {
        let (mut within, mut all) = (0_usize, 0_usize);
        for cell in corners {
            let place = self.target.grid.index(cell);
            let is_wanted = place.is_some_and(|i| self.target.wanted[i] > HALF_WANTED);
            within += usize::from(is_wanted);
            all += 1;
        }
        within as f64 >= LEAST_WITHIN * all as f64
    }

    /// Orients a cluster and notes what it covers.
    fn put(&self, mut cluster: Cluster, work: &mut Work<'_>) {
        let attachment = &self.attachments.all[cluster.attachment];
        if !cluster.centre.coords.iter().all(|x| x.is_finite()) {
            return;
        }
        let mut seen: Vec<(Point2<f64>, f64)> = Vec::with_capacity(self.template.positions.len());
        for turn in 1..=TURNS {
            let off = normal_vector(&mut work.random);
            cluster.turn = orientation(attachment, &cluster.centre, &self.axis, off);
            seen.clear();
            for p in &self.template.positions {
                let posed = attachment.carried.posed(&cluster.at(self.template, p));
                seen.push((self.target.grid.cell_of(&posed), posed.z));
            }
            if !self.is_mask || self.is_within(seen.iter().map(|(cell, _)| *cell)) {
                break;
            }
            if turn == TURNS {
                return;
            }
        }
        for t in self.template.indices.chunks_exact(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| seen[i as usize]);
            work.cover.add([a.0, b.0, c.0], (a.1 + b.1 + c.1) / 3.0);
        }
        work.clusters.push(cluster);
    }
}

/// Where more clusters are put.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Missing {
    /// By the density that is wanted, whatever is covered already.
    Density,
    /// Where what is wanted is not covered yet; the wood that is seen there is hidden.
    Gaps,
}

/// How a cluster is seen: at which cell, how far from its branch (cells), on which side.
struct Sight {
    cell: Point2<f64>,
    distance: f64,
    side: Side,
}

/// What has been planted so far.
struct Work<'a> {
    random: Generator,
    clusters: Vec<Cluster>,
    cover: Cover<'a>,
}

/// The sums of all values up to each.
fn cumulative(values: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut sums = Vec::with_capacity(values.len());
    for value in values {
        sum += value;
        sums.push(sum);
    }
    sums
}

fn normal_vector(random: &mut Generator) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.sample(StandardNormal))
}

/// How like the densities of what is covered and of what is wanted are: their correlation over the
/// target's bounding box.
pub(super) fn similarity(target: &Target, covered: &[f32]) -> f64 {
    let width = target.grid.size.width as usize;
    let density = smoothed(covered, width, target.sigma);
    let (mut left, mut right, mut top, mut bottom) = (usize::MAX, 0, usize::MAX, 0);
    for (i, (wanted, covered)) in target.wanted.iter().zip(covered).enumerate() {
        if *wanted > 0.5 || *covered > 0.5 {
            let (u, v) = (i % width, i / width);
            (left, right) = (left.min(u), right.max(u));
            (top, bottom) = (top.min(v), bottom.max(v));
        }
    }
    correlation(&density, &target.density, |i| {
        (left..=right).contains(&(i % width)) && (top..=bottom).contains(&(i / width))
    })
}
