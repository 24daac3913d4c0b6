//! Leaves that match the picture (Li 2011 app. B.1), and how they swing (app. B.2).
//!
//! Seeds are corners found in the picture; more are put where the picture has more leaf than has
//! been planted. Each is given to a branch, which says how deep in the tree it stands, is carried
//! back with that branch from the picture's pose to the rest, and gets a copy of the template in
//! the picture's colours.

mod attachment;
mod beyond;
mod canvas;
mod carry;
mod cluster;
mod colours;
mod density;
mod faces;
mod groups;
mod hidden;
mod mixture;
mod palette;
mod place;
mod season;
mod target;
mod template;
mod texture;
mod view;
mod wood;

pub use beyond::within_leaves;
pub use palette::leaf_palette;
pub use season::{Season, season};
pub use template::{Template, TemplateFault, TemplateMesh};
pub use view::{LeafColours, LeafView, Sampling};

use super::foliage::Foliage;
use crate::config;
use crate::model::{Pose, Skeleton};
use crate::shape::{Limb, SkinWeights};
use attachment::AttachmentPoints;
use canvas::Grid;
use carry::Carried;
use cluster::Cluster;
use groups::groups;
use nalgebra::{Point2, Point3};
use place::LeafPlacer;
use target::Target;
use view::tree_height;

/// Spread of leaves about their branch where no picture shows them, as a share of the tree's
/// height.
const SPREAD: f64 = 0.02;
/// Without a picture all clusters together have this share of the square of the tree's height
/// (silhouettes, one by one).
const AREA_SHARE: f64 = 0.8;

/// Leaves for a tree of `limbs`. Without picture and drawing they are sampled about the branches by
/// chance. A tree without branches has none.
pub fn foliage(
    limbs: &[Limb],
    skeleton: &Skeleton,
    view: &LeafView,
    template: &Template,
    settings: &config::Leaves,
    seed: u64,
) -> Foliage {
    let sampling = Sampling::Seeds;
    foliage_by(sampling, limbs, skeleton, view, template, settings, seed)
}

/// The same by another sampling, to compare them.
pub fn foliage_by(
    sampling: Sampling,
    limbs: &[Limb],
    skeleton: &Skeleton,
    view: &LeafView,
    template: &Template,
    settings: &config::Leaves,
    seed: u64,
) -> Foliage {
    let height = tree_height(skeleton);
    let per_cluster = template.triangles();
    if !(height > 0.0 && height.is_finite())
        || per_cluster == 0
        || skeleton.nodes.len() > usize::from(u16::MAX)
    {
        return Foliage::default();
    }
    let target = Target::new(skeleton, view, height);
    let planting = Planting {
        limbs,
        skeleton,
        view,
        template,
        height,
        count: (settings.triangles as usize / per_cluster).max(1),
        seed,
    };
    let (clusters, attachments) = match &target {
        Some(target) => planting.by_target(target, sampling),
        None => planting.without_target(),
    };
    Foliage {
        groups: groups(
            &clusters,
            &attachments.all,
            skeleton,
            target.as_ref(),
            view.palette,
            template,
            height,
        ),
        texture: template.texture.clone(),
        frequency_hz: settings.frequency_hz,
    }
}

/// What is planted, and on what.
struct Planting<'a> {
    limbs: &'a [Limb],
    skeleton: &'a Skeleton,
    view: &'a LeafView<'a>,
    template: &'a Template,
    /// Of the tree, px.
    height: f64,
    /// Clusters at most.
    count: usize,
    seed: u64,
}

impl Planting<'_> {
    /// Clusters with the density of `target`, and the places on which they sit.
    fn by_target(&self, target: &Target, sampling: Sampling) -> (Vec<Cluster>, AttachmentPoints) {
        let mut placer = self.placer(target, sampling);
        let clusters = placer.plant();
        (clusters, placer.attachments)
    }

    /// Clusters about the branches, where nothing says where leaves are to be.
    fn without_target(&self) -> (Vec<Cluster>, AttachmentPoints) {
        let blank = Target::blank(Grid::of(self.skeleton));
        let area = self.count as f64 * self.template.mean_area();
        let size = (AREA_SHARE * self.height * self.height / area).sqrt();
        let mut placer = self.placer(&blank, Sampling::Random { spread: SPREAD });
        let clusters = placer.plant_of_size(size);
        (clusters, placer.attachments)
    }

    fn placer<'t>(&'t self, target: &'t Target, sampling: Sampling) -> LeafPlacer<'t> {
        let (limbs, skeleton, pose) = (self.limbs, self.skeleton, self.view.pose);
        let grid = Grid::of(skeleton);
        let axis = skeleton.nodes.get(1);
        let seeds = self.view.seeds.iter();
        LeafPlacer {
            attachments: AttachmentPoints::new(limbs, skeleton, pose, &grid, self.height),
            wood: wood::front(limbs, skeleton, pose, &grid),
            target,
            template: self.template,
            seeds: seeds
                .map(|p| grid.cell_of_pixel(p.map(f64::from)))
                .collect(),
            axis: axis.map_or(Point3::origin(), |n| n.position),
            height: self.height,
            count: self.count,
            seed: self.seed,
            sampling,
            is_mask: self.view.is_mask,
        }
    }
}

/// How like the density of the leaves, seen from the front in the picture's pose, is to that of the
/// picture (or of the drawing): their correlation, -1 to 1, at a twentieth of the tree's height.
/// `None` where there is neither.
pub fn density_match(foliage: &Foliage, skeleton: &Skeleton, view: &LeafView) -> Option<f64> {
    let target = Target::new(skeleton, view, tree_height(skeleton))?;
    let covered = front_cover(foliage, skeleton, view.pose, target.grid);
    Some(place::similarity(&target, &covered))
}

/// Which pixels of the front view are covered by leaves: row by row at the source image's size (or
/// a whole part of it where that is large), 0 or 1, and the width of a row.
pub fn leaf_cover(
    foliage: &Foliage,
    skeleton: &Skeleton,
    pose: Option<&Pose>,
) -> (Vec<f32>, usize) {
    let grid = Grid::of(skeleton);
    (
        front_cover(foliage, skeleton, pose, grid),
        grid.size.width as usize,
    )
}

fn front_cover(
    foliage: &Foliage,
    skeleton: &Skeleton,
    pose: Option<&Pose>,
    grid: Grid,
) -> Vec<f32> {
    let mut cover = density::Cover::new(grid, &[]);
    for group in &foliage.groups {
        let mesh = &group.mesh;
        let mut cells: Vec<Point2<f64>> = Vec::with_capacity(mesh.positions.len());
        for (i, position) in mesh.positions.iter().enumerate() {
            let skin = SkinWeights {
                joints: mesh.joints[i],
                weights: mesh.weights[i],
            };
            let carried = Carried::by(&skin, skeleton, pose);
            cells.push(grid.cell_of(&carried.posed(&Point3::from(position.map(f64::from)))));
        }
        for t in mesh.indices.chunks_exact(3) {
            cover.add([t[0], t[1], t[2]].map(|i| cells[i as usize]), 0.0);
        }
    }
    cover.covered
}
