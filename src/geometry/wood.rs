//! Generalised cylinders: the limbs as one skinned mesh with a given number of triangles.
//!
//! Joint `i` is the branch that ends in node `i` and turns about the parent node. A limb leaves its
//! parent with the parent's weights, so both skins meet at the pivot, which neither moves.

use super::chain::{Chain, chains};
use super::mesh::Mesh;
use super::tube;
use crate::config;
use crate::model::Skeleton;
use crate::shape::{Limb, limbs};

/// Triangles of the levels of detail against the finest, falling.
pub const LEVELS: [f64; 3] = [1.0, 0.5, 0.25];
/// Twigs shorter than this, divided by the density, are left out: at a distance at which the tree
/// may be told so roughly they are hardly seen.
const SHED_PX: f64 = 3.0;
/// Factor between two densities that a mesh is made of.
const STEP: f64 = 1.02;

/// The wood with about `triangles` triangles: one closed tube for every chain of limbs that go on
/// in one another, those that leave it starting inside. Where fewer do, thick and curved wood gets
/// more of them; where even the roughest tubes are too many, the smallest twigs are left out. No
/// wood gives an empty mesh.
pub fn wood(limbs: &[Limb], triangles: usize) -> Mesh {
    let chains = chains(limbs);
    let (mut low, mut high) = (1e-9_f64, 1e4_f64);
    while high > low * STEP {
        let middle = (low * high).sqrt();
        if triangles_of_all(&chains, middle) <= triangles {
            low = middle;
        } else {
            high = middle;
        }
    }
    // The rest goes to the first chains, which are the thickest, as long as there is any.
    let mut left = triangles.saturating_sub(triangles_of_all(&chains, low));
    let mut mesh = Mesh::default();
    for chain in &chains {
        let more = triangles_of(chain, high).saturating_sub(triangles_of(chain, low));
        let mut density = low;
        if more <= left {
            density = high;
            left -= more;
        }
        if triangles_of(chain, density) > 0 {
            tube::append(chain, density, &mut mesh);
        }
    }
    mesh
}

/// The wood in falling levels of detail, [`LEVELS`] of `triangles`, all on the same joints.
pub fn wood_levels(limbs: &[Limb], triangles: usize) -> Vec<Mesh> {
    LEVELS
        .iter()
        .map(|share| wood(limbs, (triangles as f64 * share).round() as usize))
        .collect()
}

/// The branches of the skeleton alone, without curl and twigs, with about `triangles` triangles:
/// for small pictures.
pub fn bare_wood(skeleton: &Skeleton, triangles: usize) -> Mesh {
    let plain = config::Wood {
        curl: 0.0,
        max_twigs: 0,
        ..config::Wood::default()
    };
    wood(&limbs(skeleton, &|_, _| false, &plain, 0), triangles)
}

fn triangles_of_all(chains: &[Chain], density: f64) -> usize {
    chains.iter().map(|c| triangles_of(c, density)).sum()
}

fn triangles_of(chain: &Chain, density: f64) -> usize {
    if chain.size_px * density < SHED_PX {
        0
    } else {
        tube::triangles(chain, density)
    }
}
