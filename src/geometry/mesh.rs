//! Triangles that move with a skeleton.

use nalgebra::Vector3;

/// A triangle whose height over its longest side is less than this, as a share of the mesh's
/// farthest coordinate, has no direction that single precision could tell.
const THINNEST: f64 = 32.0 * f32::EPSILON as f64;

/// Triangles with skinning weights; all vectors but `indices` and `made_up` have one entry a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Model axes at rest, px.
    pub positions: Vec<[f32; 3]>,
    /// Outward, of length 1.
    pub normals: Vec<[f32; 3]>,
    /// u runs once around the branch, v along it in units of its circumference.
    pub uvs: Vec<[f32; 2]>,
    /// Node indices of the branches that move the vertex; unused entries are 0.
    pub joints: Vec<[u16; 4]>,
    /// Their shares, which add up to 1; unused entries are 0.
    pub weights: Vec<[f32; 4]>,
    /// Three a triangle, counter-clockwise seen from outside.
    pub indices: Vec<u32>,
    /// Which triangles are of wood that nobody has seen; empty where that is not known.
    pub made_up: Vec<bool>,
}

impl Mesh {
    /// The triangles since those that are marked are all [made up](Self::made_up), or none.
    pub(super) fn mark_new(&mut self, made_up: bool) {
        self.made_up.resize(self.indices.len() / 3, made_up);
    }

    /// Whether some triangles are made up, and others are not.
    pub fn is_made_up_in_part(&self) -> bool {
        let all = self.made_up.iter().all(|made_up| *made_up);
        !all && self.made_up.contains(&true)
    }

    /// The triangles that are made up, or the others, with their vertices alone.
    pub fn part(&self, made_up: bool) -> Self {
        let mut part = Self::default();
        let mut place_of: Vec<Option<u32>> = vec![None; self.positions.len()];
        for (k, corners) in self.indices.chunks_exact(3).enumerate() {
            if self.made_up.get(k).copied().unwrap_or(false) != made_up {
                continue;
            }
            for &corner in corners {
                let place = *place_of[corner as usize]
                    .get_or_insert_with(|| part.push_vertex(self, corner as usize));
                part.indices.push(place);
            }
            part.made_up.push(made_up);
        }
        part
    }

    /// Adds a vertex of another mesh, and returns its place.
    fn push_vertex(&mut self, other: &Self, vertex: usize) -> u32 {
        let place = self.positions.len() as u32;
        self.positions.push(other.positions[vertex]);
        self.normals.extend(other.normals.get(vertex));
        self.uvs.extend(other.uvs.get(vertex));
        self.joints.extend(other.joints.get(vertex));
        self.weights.extend(other.weights.get(vertex));
        place
    }

    /// How many corners of triangles have a normal that points against the winding of the triangle:
    /// whoever sees the triangle from its front is shown a lit back. Triangles too thin to have a
    /// direction and corners that are not there do not count.
    pub fn corners_against_winding(&self) -> usize {
        let farthest = self.positions.iter().flatten();
        let farthest = farthest.fold(0.0, |most: f64, x| most.max(f64::from(x.abs())));
        let mut against = 0;
        for corners in self.indices.chunks_exact(3) {
            let Some(face) = self.face(corners, THINNEST * farthest) else {
                continue;
            };
            for &corner in corners {
                let normal = self.normals.get(corner as usize).copied();
                let along = normal.map(|n| Vector3::from(n).map(f64::from).dot(&face));
                against += usize::from(along.is_some_and(|along| along < 0.0));
            }
        }
        against
    }

    /// The connected piece that every vertex belongs to, by vertex, counted from 0 in the order of
    /// their first vertices. Corners that are not there connect nothing.
    pub fn pieces(&self) -> Vec<usize> {
        pieces(self.positions.len(), &self.indices)
    }

    /// The direction that a triangle faces by its winding, of length 1; `None` where it is no
    /// higher than `least_px` over its longest side.
    fn face(&self, corners: &[u32], least_px: f64) -> Option<Vector3<f64>> {
        let mut at = [Vector3::zeros(); 3];
        for (at, corner) in at.iter_mut().zip(corners) {
            *at = Vector3::from(*self.positions.get(*corner as usize)?).map(f64::from);
        }
        let [a, b, c] = at;
        let across = (b - a).cross(&(c - a));
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        across.try_normalize(longest * least_px)
    }
}

/// As [`Mesh::pieces`], of `n` vertices and the triangles `indices`.
pub(super) fn pieces(n: usize, indices: &[u32]) -> Vec<usize> {
    let mut joined: Vec<usize> = (0..n).collect();
    for corners in indices.chunks_exact(3) {
        for pair in corners.windows(2) {
            let [a, b] = [pair[0] as usize, pair[1] as usize];
            if a < n && b < n {
                let [a, b] = [first_of(&mut joined, a), first_of(&mut joined, b)];
                joined[a.max(b)] = a.min(b);
            }
        }
    }
    let mut number: Vec<usize> = Vec::with_capacity(n);
    let mut pieces = 0;
    for vertex in 0..n {
        let first = first_of(&mut joined, vertex);
        if first == vertex {
            number.push(pieces);
            pieces += 1;
        } else {
            number.push(number[first]);
        }
    }
    number
}

/// The first vertex of the piece of a vertex; shortens the way there.
fn first_of(joined: &mut [usize], vertex: usize) -> usize {
    let mut at = vertex;
    while joined[at] != at {
        joined[at] = joined[joined[at]];
        at = joined[at];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_of_one_piece_are_those_that_triangles_connect() {
        let mesh = Mesh {
            positions: vec![[0.0; 3]; 8],
            indices: vec![5, 6, 7, 0, 1, 3, 3, 4, 1, 9, 2, 2],
            ..Mesh::default()
        };
        assert_eq!(mesh.pieces(), [0, 0, 1, 0, 0, 2, 2, 2]);
    }

    #[test]
    fn a_part_has_its_triangles_and_no_other_vertices() {
        let mesh = Mesh {
            positions: (0..5).map(|i| [i as f32, 0.0, 0.0]).collect(),
            uvs: (0..5).map(|i| [0.0, i as f32]).collect(),
            indices: vec![0, 1, 2, 2, 1, 4],
            made_up: vec![false, true],
            ..Mesh::default()
        };
        let (seen, made_up) = (mesh.part(false), mesh.part(true));
        assert_eq!(
            (&seen.indices[..], seen.positions.len()),
            (&[0, 1, 2][..], 3)
        );
        assert_eq!(made_up.indices, [0, 1, 2]);
        assert_eq!(made_up.uvs, [[0.0, 2.0], [0.0, 1.0], [0.0, 4.0]]);
        let unknown = Mesh {
            made_up: Vec::new(),
            ..mesh
        };
        assert!(unknown.part(true).indices.is_empty());
    }

    #[test]
    fn corners_are_counted_against_the_winding() {
        let mut mesh = Mesh {
            positions: vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [4.0, 0.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0], [0.8, 0.0, 0.6], [0.0, 0.8, -0.6], [0.0; 3]],
            indices: vec![0, 1, 2, 0, 3, 1],
            ..Mesh::default()
        };
        assert_eq!(
            mesh.corners_against_winding(),
            1,
            "the flat one has no direction"
        );
        mesh.indices = vec![0, 2, 1, 7, 1, 2];
        assert_eq!(mesh.corners_against_winding(), 2, "one triangle is torn");
    }
}
