//! Leaves that match the picture (Li et al. appendix B.1), and how they swing (B.2).
//!
//! Seeds are corners found in the picture; more are put where the picture has more leaf than has
//! been planted. Each is given to a branch, which says how deep in the tree it stands, is carried
//! back with that branch from the picture's pose to the rest, and gets a copy of the template in
//! the picture's colours.

mod beyond;
mod canvas;
mod carry;
mod cluster;
mod colours;
mod density;
mod groups;
mod hidden;
mod perch;
mod place;
mod season;
mod target;
mod template;
mod texture;
mod wood;

pub use beyond::within_leaves;
pub use season::{Season, season};
pub use template::{Template, TemplateFault, TemplateMesh};

use super::{Foliage, Limb};
use crate::config;
use crate::model::{Luma, Outline, Pose, Rgb, Skeleton};
use canvas::Grid;
use nalgebra::Point3;
use perch::Perches;
use place::Planter;
use target::Target;

/// Colour of leaves where no picture shows any (sRGB).
const PLAIN: [u8; 3] = [86, 110, 50];
/// Spread of leaves about their branch where no picture shows them, as a share of the tree's
/// height.
const SPREAD: f64 = 0.02;
/// Without a picture all clusters together have this share of the square of the tree's height
/// (silhouettes, one by one).
const AREA_SHARE: f64 = 0.8;

/// What is known of the leaves.
#[derive(Clone, Copy, Debug, Default)]
pub struct LeafView<'a> {
    pub picture: Option<&'a Rgb>,
    pub outline: Option<&'a Outline>,
    /// The tree's pose in the picture; `None`: at rest.
    pub pose: Option<&'a Pose>,
    /// A drawn density that goes before the picture's: white is covered with leaves. Of any size,
    /// for the whole picture.
    pub density: Option<&'a Luma>,
    /// Corners in the picture, px, strongest first.
    pub seeds: &'a [[f32; 2]],
}

/// How places are found for leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// Where the picture, or the drawing, has them.
    Seeds,
    /// About the branches by chance, as in the paper's fig. 5 c and d: normal, `spread` in tree
    /// heights.
    Random { spread: f64 },
}

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
    foliage_by(
        Sampling::Seeds,
        limbs,
        skeleton,
        view,
        template,
        settings,
        seed,
    )
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
    let height = height(skeleton);
    let per_cluster = template.triangles();
    if !(height > 0.0 && height.is_finite())
        || per_cluster == 0
        || skeleton.nodes.len() > usize::from(u16::MAX)
    {
        return Foliage::default();
    }
    let count = (settings.triangles as usize / per_cluster).max(1);
    let target = Target::new(skeleton, view, height);
    let grid = Grid::of(skeleton);
    let perches = Perches::new(limbs, skeleton, view.pose, &grid, height);
    let wood = wood::front(limbs, skeleton, view.pose, &grid);
    let axis = skeleton
        .nodes
        .get(1)
        .map_or(Point3::origin(), |n| n.position);
    let seeds = view
        .seeds
        .iter()
        .map(|p| grid.cell_of_pixel(p.map(f64::from)))
        .collect();
    let blank;
    let (sampling, wanted) = match &target {
        Some(target) => (sampling, target),
        None => {
            blank = Target::blank(grid);
            (Sampling::Random { spread: SPREAD }, &blank)
        }
    };
    let mut planter = Planter {
        perches,
        wood,
        target: wanted,
        template,
        seeds,
        axis,
        height,
        count,
        seed,
        sampling,
    };
    let clusters = match &target {
        Some(_) => planter.plant(),
        None => planter.plant_of_size(
            (AREA_SHARE * height * height / (count as f64 * template.mean_area())).sqrt(),
        ),
    };
    let groups = groups::groups(
        &clusters,
        &planter.perches.all,
        skeleton,
        target.as_ref(),
        template,
        height,
    );
    Foliage {
        groups,
        texture: template.texture.clone(),
        frequency_hz: settings.frequency_hz,
    }
}

/// How like the density of the leaves, seen from the front in the picture's pose, is to that of the
/// picture (or of the drawing): their correlation, -1 to 1, at a twentieth of the tree's height.
/// `None` where there is neither.
pub fn density_match(foliage: &Foliage, skeleton: &Skeleton, view: &LeafView) -> Option<f64> {
    let target = Target::new(skeleton, view, height(skeleton))?;
    let covered = front_cover(foliage, skeleton, view.pose, target.grid);
    Some(place::likeness(&target, &covered))
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
        let seen = |i: usize| {
            let riding = super::Riding {
                joints: mesh.joints[i],
                weights: mesh.weights[i],
            };
            let carried = carry::Carried::by(&riding, skeleton, pose);
            grid.cell_of(&carried.posed(&Point3::from(mesh.positions[i].map(f64::from))))
        };
        let cells: Vec<[f64; 2]> = (0..mesh.positions.len()).map(seen).collect();
        for t in mesh.indices.chunks_exact(3) {
            cover.add([t[0], t[1], t[2]].map(|i| cells[i as usize]), 0.0);
        }
    }
    cover.covered
}

/// Of the tree above its foot, px.
fn height(skeleton: &Skeleton) -> f64 {
    let ys = skeleton
        .nodes
        .iter()
        .map(|n| n.position.y)
        .filter(|y| y.is_finite());
    let (low, high) = ys.fold((f64::MAX, f64::MIN), |(low, high), y| {
        (low.min(y), high.max(y))
    });
    high - low
}
