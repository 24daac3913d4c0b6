//! Leaves as meshes, ready for a file (Li 2011 app. B).

use super::mesh::Mesh;
use crate::model::NodeId;
use nalgebra::Point3;

/// The leaves that oscillate together: those of one main branch.
///
/// A cluster of leaves turns about its main axis by `A(t) sin(omega t + beta)` (app. B.2). For
/// small angles that is
/// `A(t) sin(omega t)` times one displacement of its vertices plus `A(t) cos(omega t)` times
/// another, which every vertex carries with the phase `beta` of its cluster in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FoliageGroup {
    /// The branch whose speed decides how far the leaves swing.
    pub node: NodeId,
    pub mesh: Mesh,
    /// Colour of each vertex (sRGB).
    pub colours: Vec<[u8; 3]>,
    /// Displacement of each vertex at A = 1 rad for the two parts, model axes at rest, px.
    pub sine: Vec<[f32; 3]>,
    pub cosine: Vec<[f32; 3]>,
}

/// All leaves of a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Foliage {
    pub groups: Vec<FoliageGroup>,
    /// PNG or JPEG bytes of the leaves' texture with its media type; `None` for plain colour.
    pub texture: Option<(&'static str, Vec<u8>)>,
    /// omega / 2 pi, Hz.
    pub frequency_hz: f64,
}

impl Foliage {
    /// The leaves of all groups as one that does not swing: without displacements.
    pub fn merged(&self) -> FoliageGroup {
        let mut all = FoliageGroup::default();
        for group in &self.groups {
            let first = all.mesh.positions.len() as u32;
            let (mesh, of) = (&mut all.mesh, &group.mesh);
            mesh.positions.extend(&of.positions);
            mesh.normals.extend(&of.normals);
            mesh.uvs.extend(&of.uvs);
            mesh.joints.extend(&of.joints);
            mesh.weights.extend(&of.weights);
            mesh.indices.extend(of.indices.iter().map(|i| first + i));
            all.colours.extend(&group.colours);
        }
        all
    }

    /// The same with about `share` (0 to 1) of the leaves, those that stay as much larger as makes
    /// the area up (stochastic simplification, Cook et al. 2007): from afar the crown is as dense.
    pub fn thinned(&self, share: f64) -> Self {
        Self {
            groups: self.groups.iter().map(|g| g.thinned(share)).collect(),
            ..self.clone()
        }
    }
}

impl FoliageGroup {
    /// See [`Foliage::thinned`].
    fn thinned(&self, share: f64) -> Self {
        let leaf_of = self.mesh.pieces();
        let leaves = leaf_of.iter().max().map_or(0, |last| last + 1);
        let mut middles = vec![Middle::default(); leaves];
        for (vertex, &leaf) in leaf_of.iter().enumerate() {
            middles[leaf].add(self, vertex);
        }
        // Evenly among all, which stand in the order in which they were planted; the first always.
        let mut stays = vec![true; leaves];
        for (leaf, stays) in stays.iter_mut().enumerate().skip(1) {
            *stays = (leaf as f64 * share).floor() > ((leaf - 1) as f64 * share).floor();
        }
        let larger = share.max(f64::MIN_POSITIVE).sqrt().recip() as f32;
        let mut out = Self {
            node: self.node,
            ..Self::default()
        };
        let mut moved_to: Vec<Option<u32>> = vec![None; leaf_of.len()];
        for (vertex, &leaf) in leaf_of.iter().enumerate() {
            if stays[leaf] {
                moved_to[vertex] = Some(out.mesh.positions.len() as u32);
                out.take(self, vertex, &middles[leaf], larger);
            }
        }
        for corners in self.mesh.indices.chunks_exact(3) {
            let moved = [corners[0], corners[1], corners[2]].map(|c| moved_to[c as usize]);
            if let [Some(a), Some(b), Some(c)] = moved {
                out.mesh.indices.extend([a, b, c]);
            }
        }
        out
    }

    /// Takes over a vertex of `from`, farther from the middle of its leaf.
    fn take(&mut self, from: &Self, vertex: usize, middle: &Middle, larger: f32) {
        let mesh = &from.mesh;
        let [at, sine, cosine] = middle.means();
        let place = away(at, mesh.positions[vertex], larger);
        self.mesh.positions.push(place);
        self.mesh.normals.push(mesh.normals[vertex]);
        self.mesh.uvs.push(mesh.uvs[vertex]);
        self.mesh.joints.push(mesh.joints[vertex]);
        self.mesh.weights.push(mesh.weights[vertex]);
        self.colours.push(from.colours[vertex]);
        self.sine.push(away(sine, from.sine[vertex], larger));
        self.cosine.push(away(cosine, from.cosine[vertex], larger));
    }
}

/// The middle of a leaf, while its vertices are added: of its place and of both displacements.
#[derive(Clone, Copy, Debug, Default)]
struct Middle {
    sums: [[f64; 3]; 3],
    vertices: f64,
}

impl Middle {
    fn add(&mut self, group: &FoliageGroup, vertex: usize) {
        let rows = [&group.mesh.positions, &group.sine, &group.cosine];
        for (sum, row) in self.sums.iter_mut().zip(rows) {
            for (sum, x) in sum.iter_mut().zip(row[vertex]) {
                *sum += f64::from(x);
            }
        }
        self.vertices += 1.0;
    }

    fn means(&self) -> [[f32; 3]; 3] {
        self.sums
            .map(|sum| sum.map(|x| (x / self.vertices.max(1.0)) as f32))
    }
}

/// The place that is `larger` times as far from the middle.
fn away(middle: [f32; 3], place: [f32; 3], larger: f32) -> [f32; 3] {
    let middle = Point3::from(middle);
    (middle + (Point3::from(place) - middle) * larger).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many leaves of two triangles, 1 px to a side, one above the other.
    fn group(leaves: usize) -> FoliageGroup {
        let mut group = FoliageGroup::default();
        for k in 0..leaves {
            let first = group.mesh.positions.len() as u32;
            for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
                group.mesh.positions.push([x, y, k as f32]);
                group.mesh.normals.push([0.0, 0.0, 1.0]);
                group.mesh.uvs.push([x, y]);
                group.mesh.joints.push([0; 4]);
                group.mesh.weights.push([1.0, 0.0, 0.0, 0.0]);
                group.colours.push([k as u8, 0, 0]);
                group.sine.push([x, 0.0, 0.0]);
                group.cosine.push([0.0, y, 0.0]);
            }
            for corner in [0, 1, 2, 0, 2, 3] {
                group.mesh.indices.push(first + corner);
            }
        }
        group
    }

    fn area(mesh: &Mesh) -> f32 {
        let mut area = 0.0;
        for c in mesh.indices.chunks_exact(3) {
            let [a, b, c] = [c[0], c[1], c[2]].map(|i| Point3::from(mesh.positions[i as usize]));
            area += 0.5 * (b - a).cross(&(c - a)).norm();
        }
        area
    }

    #[test]
    fn fewer_leaves_cover_as_much() {
        let all = group(40);
        for share in [1.0, 0.5, 0.25] {
            let less = all.thinned(share);
            let leaves = (40.0 * share) as usize;
            assert_eq!(less.mesh.indices.len(), 6 * leaves);
            assert_eq!(less.mesh.positions.len(), 4 * leaves);
            assert_eq!(less.sine.len(), 4 * leaves);
            assert!((area(&less.mesh) - area(&all.mesh)).abs() < 1e-3, "{share}");
        }
        assert_eq!(all.thinned(1.0), all);
    }

    #[test]
    fn all_groups_are_one() {
        let foliage = Foliage {
            groups: vec![group(3), group(2)],
            ..Foliage::default()
        };
        let all = foliage.merged();
        assert_eq!(all.mesh.positions.len(), 20);
        assert_eq!(all.mesh.indices.len(), 30);
        assert_eq!(all.mesh.indices.last(), Some(&19));
        assert!(all.sine.is_empty());
    }
}
