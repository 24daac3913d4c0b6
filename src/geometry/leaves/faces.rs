//! Normals of leaves that agree with the winding of their triangles.
//!
//! A leaf has no inside: a renderer that is told so takes the normal as it stands where it sees a
//! triangle counter-clockwise, and turns it round where it sees its back. With a normal that points
//! against the winding it lights either side with the light of the other.

use nalgebra::{Point3, Vector3};

/// How far a normal of length 1 goes along the direction of each face around it: 6 degrees off the
/// face's plane, more than the rounding of a file turns a triangle by.
const LEAST_ALONG: f64 = 0.1;

/// Direction of a triangle by its winding, as long as twice its area.
pub(super) fn area_vector(positions: &[Point3<f64>], corners: &[u32]) -> Vector3<f64> {
    let [a, b, c] = [0, 1, 2].map(|k| positions[corners[k] as usize]);
    (b - a).cross(&(c - a))
}

/// The vertices of leaves with their triangles.
pub(super) struct Sheets<'a> {
    pub positions: &'a mut Vec<Point3<f64>>,
    pub normals: &'a mut Vec<Vector3<f64>>,
    pub uvs: &'a mut Vec<[f32; 2]>,
    /// The leaf of each vertex.
    pub leaf_of: &'a mut Vec<u32>,
    pub indices: &'a mut Vec<u32>,
}

impl Sheets<'_> {
    /// Makes normals and winding agree. A leaf whose normals mostly point against its winding is
    /// wound the other way; a vertex whose normal still does not suit a face is parted from it, and
    /// the face gets one with its own. Returns the direction of each triangle, of length 1 or 0.
    pub fn agree(mut self) -> Vec<Vector3<f64>> {
        self.wind_by_normals();
        let mut faces = Vec::with_capacity(self.indices.len() / 3);
        for corners in self.indices.chunks_exact(3) {
            let face = area_vector(self.positions, corners).try_normalize(1e-12);
            faces.push(face.unwrap_or_else(Vector3::zeros));
        }
        self.turn_lost_normals(&faces);
        self.part(&faces);
        faces
    }

    fn wind_by_normals(&mut self) {
        let leaves = self.leaf_of.iter().max().map_or(0, |&m| m as usize + 1);
        let mut along = vec![0.0; leaves];
        for corners in self.indices.chunks_exact(3) {
            let area = area_vector(self.positions, corners);
            for &i in corners {
                along[self.leaf_of[i as usize] as usize] += area.dot(&self.normals[i as usize]);
            }
        }
        for corners in self.indices.chunks_exact_mut(3) {
            if along[self.leaf_of[corners[0] as usize] as usize] < 0.0 {
                corners.swap(1, 2);
            }
        }
    }

    /// A normal that suits no face around it becomes that of one of them.
    fn turn_lost_normals(&mut self, faces: &[Vector3<f64>]) {
        let mut suits = vec![false; self.normals.len()];
        for (corners, face) in self.indices.chunks_exact(3).zip(faces) {
            for &i in corners {
                suits[i as usize] |= is_along(&self.normals[i as usize], face);
            }
        }
        for (corners, face) in self.indices.chunks_exact(3).zip(faces) {
            for &i in corners {
                if !suits[i as usize] {
                    self.normals[i as usize] = *face;
                    suits[i as usize] = true;
                }
            }
        }
    }

    /// Gives each corner whose normal does not suit its face a vertex of its own.
    fn part(&mut self, faces: &[Vector3<f64>]) {
        for (corners, face) in self.indices.chunks_exact_mut(3).zip(faces) {
            for corner in corners {
                let i = *corner as usize;
                if is_along(&self.normals[i], face) {
                    continue;
                }
                *corner = self.positions.len() as u32;
                self.positions.push(self.positions[i]);
                self.normals.push(*face);
                self.uvs.push(self.uvs[i]);
                self.leaf_of.push(self.leaf_of[i]);
            }
        }
    }
}

/// Whether a normal suits a face. Any suits one without a direction.
fn is_along(normal: &Vector3<f64>, face: &Vector3<f64>) -> bool {
    *face == Vector3::zeros() || normal.dot(face) >= LEAST_ALONG
}

/// How much of `towards` may be mixed into `own` at most, up to `most`, so that the mixture still
/// goes along `face`. All are of length 1; `own` goes along it.
pub(super) fn share_along(
    own: &Vector3<f64>,
    towards: &Vector3<f64>,
    face: &Vector3<f64>,
    most: f64,
) -> f64 {
    let (own, towards) = (own.dot(face), towards.dot(face));
    // (1 - share) own + share towards = LEAST_ALONG; the mixture is no longer than 1.
    if towards < own && *face != Vector3::zeros() {
        most.min((own - LEAST_ALONG) / (own - towards)).max(0.0)
    } else {
        most
    }
}
