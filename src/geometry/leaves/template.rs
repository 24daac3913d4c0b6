//! The mesh that stands at every seed: a cluster of leaves, ours or the user's (Li 2011 app.
//! B.1).

use super::faces::{Sheets, area_vector};
use super::texture;
use crate::geometry::mesh::pieces;
use nalgebra::{Point3, Rotation3, Vector3};

/// A cluster of leaves of size 1: it grows from the origin along y, its leaves turn their faces to
/// z.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    pub(super) positions: Vec<Point3<f64>>,
    pub(super) normals: Vec<Vector3<f64>>,
    pub(super) uvs: Vec<[f32; 2]>,
    pub(super) indices: Vec<u32>,
    /// The leaf that each vertex belongs to: what hangs together.
    pub(super) leaf_of: Vec<u32>,
    /// Direction of each triangle by its winding, of length 1; 0 where it has none. The normals at
    /// its corners go along it.
    pub(super) faces: Vec<Vector3<f64>>,
    /// Where each leaf is held, about which it turns.
    pub(super) apices: Vec<Point3<f64>>,
    /// Middle of the whole.
    pub(super) centre: Point3<f64>,
    pub(super) texture: Option<(&'static str, Vec<u8>)>,
    /// Mean colour of the texture, 0 to 1 (sRGB); white where there is none.
    pub(super) texture_mean: [f64; 3],
}

/// A mesh as it stands in a file; y is up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TemplateMesh {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    /// Empty where the file has none.
    pub uvs: Vec<[f32; 2]>,
    pub indices: Vec<u32>,
    /// Media type and bytes of a PNG or JPEG.
    pub texture: Option<(&'static str, Vec<u8>)>,
}

/// Why a mesh is no template.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TemplateFault {
    #[error("it has no triangles")]
    Empty,
    #[error("it has {0} triangles, and at most {most} are taken", most = Template::MOST_TRIANGLES)]
    TooMany(usize),
    /// The reader of a file bounds what of it is looked at.
    #[error("it has {found} vertices, and at most {most} are looked at")]
    TooManyVertices { found: usize, most: usize },
    #[error("it has vectors of different lengths or indices beyond them")]
    Torn,
    #[error("it has positions that are no numbers")]
    NoNumbers,
    #[error("it has no size")]
    Flat,
    #[error("its texture is no PNG or JPEG, or larger than 4096 pixels")]
    BadTexture,
}

/// Texture sides above this are refused, px.
const LARGEST_TEXTURE: u32 = 4096;

impl Template {
    /// Triangles of a template at most: there are hundreds of copies of it.
    pub const MOST_TRIANGLES: usize = 5_000;

    /// Our own: five leaves of four triangles, folded along their midrib, around a twig.
    pub fn ours() -> Self {
        let mut mesh = TemplateMesh::default();
        for k in 0..5 {
            let turn = std::f64::consts::TAU * 0.382 * f64::from(k);
            // Lower leaves stand off, the last goes on along the twig.
            let (tilt, at) = (1.25 - 0.22 * f64::from(k), 0.08 * f64::from(k));
            // All faces look to z somewhat: leaves turn to the light.
            let stand = Rotation3::from_axis_angle(&Vector3::y_axis(), turn)
                * Rotation3::from_axis_angle(&Vector3::x_axis(), tilt);
            leaf(
                &mut mesh,
                Vector3::new(0.0, at, 0.0),
                &stand,
                0.72 - 0.03 * f64::from(k),
            );
        }
        mesh.texture = texture::png().map(|bytes| ("image/png", bytes));
        Self::new(mesh).unwrap_or_else(|_| Self::nothing())
    }

    fn nothing() -> Self {
        Self {
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            indices: Vec::new(),
            leaf_of: Vec::new(),
            faces: Vec::new(),
            apices: Vec::new(),
            centre: Point3::origin(),
            texture: None,
            texture_mean: [1.0; 3],
        }
    }

    /// A template from a mesh of any size, which is scaled so that its longest side is 1 and moved
    /// so that the middle of its lowest end is the origin. Missing normals are computed; those that
    /// do not agree with the winding are made to. Vertices that no triangle uses are left out:
    /// every copy would carry them.
    ///
    /// # Errors
    /// What [`TemplateFault`] names.
    pub fn new(mut mesh: TemplateMesh) -> Result<Self, TemplateFault> {
        check_counts(&mesh)?;
        mesh.indices.truncate(mesh.indices.len() / 3 * 3);
        keep_used(&mut mesh);
        if !all_numbers(&mesh) {
            return Err(TemplateFault::NoNumbers);
        }
        let mut positions = normalised(&mesh.positions)?;
        let texture_mean = match &mesh.texture {
            Some((_, bytes)) => mean_colour(bytes).ok_or(TemplateFault::BadTexture)?,
            None => [1.0; 3],
        };
        let n = positions.len();
        let sum: Vector3<f64> = positions.iter().map(|p| p.coords).sum();
        let leaves = pieces(n, &mesh.indices).into_iter();
        let mut leaf_of: Vec<u32> = leaves.map(|leaf| leaf as u32).collect();
        if mesh.uvs.is_empty() {
            mesh.uvs = vec![[0.5; 2]; n];
        }
        let apices = apices(&positions, &leaf_of);
        let mut normals = normals(&mesh, &positions);
        let faces = Sheets {
            positions: &mut positions,
            normals: &mut normals,
            uvs: &mut mesh.uvs,
            leaf_of: &mut leaf_of,
            indices: &mut mesh.indices,
        }
        .agree();
        Ok(Self {
            normals,
            faces,
            apices,
            centre: Point3::from(sum / n as f64),
            positions,
            uvs: mesh.uvs,
            indices: mesh.indices,
            leaf_of,
            texture: mesh.texture,
            texture_mean,
        })
    }

    /// Triangles of one cluster.
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    /// Mean area of the cluster's silhouette over all directions at size 1, were no leaf before
    /// another (Cauchy): a quarter of both faces' area.
    pub(super) fn mean_area(&self) -> f64 {
        let mut area = 0.0;
        for t in self.indices.chunks_exact(3) {
            area += area_vector(&self.positions, t).norm() / 2.0;
        }
        area / 2.0
    }
}

/// Whether there are triangles, not too many, and all vectors fit each other.
fn check_counts(mesh: &TemplateMesh) -> Result<(), TemplateFault> {
    let n = mesh.positions.len();
    let triangles = mesh.indices.len() / 3;
    if triangles == 0 || n == 0 {
        return Err(TemplateFault::Empty);
    }
    if triangles > Template::MOST_TRIANGLES {
        return Err(TemplateFault::TooMany(triangles));
    }
    let torn = [mesh.normals.len(), mesh.uvs.len()]
        .into_iter()
        .any(|m| m != 0 && m != n);
    if torn || mesh.indices.iter().any(|&i| i as usize >= n) {
        return Err(TemplateFault::Torn);
    }
    Ok(())
}

fn all_numbers(mesh: &TemplateMesh) -> bool {
    let places = mesh.positions.iter().chain(&mesh.normals).flatten();
    places
        .chain(mesh.uvs.iter().flatten())
        .all(|x| x.is_finite() && x.abs() < 1e12)
}

/// The positions scaled so that the longest side of their box is 1, with the middle of its lowest
/// end at the origin.
fn normalised(positions: &[[f32; 3]]) -> Result<Vec<Point3<f64>>, TemplateFault> {
    let given: Vec<Point3<f64>> = positions
        .iter()
        .map(|p| Point3::from(p.map(f64::from)))
        .collect();
    let (mut low, mut high) = (given[0], given[0]);
    for p in &given {
        (low, high) = (low.inf(p), high.sup(p));
    }
    let side = (high - low).max();
    if side <= 1e-12 {
        return Err(TemplateFault::Flat);
    }
    let near_end: Vec<&Point3<f64>> = given
        .iter()
        .filter(|p| p.y <= low.y + 0.02 * side)
        .collect();
    let sum: Vector3<f64> = near_end.iter().map(|p| p.coords).sum();
    let base = Point3::from(sum / near_end.len().max(1) as f64);
    Ok(given
        .iter()
        .map(|p| Point3::from((p - base) / side))
        .collect())
}

/// Where each leaf is held: its vertex next to the origin.
fn apices(positions: &[Point3<f64>], leaf_of: &[u32]) -> Vec<Point3<f64>> {
    let leaves = leaf_of.iter().max().map_or(0, |&m| m as usize + 1);
    let mut apices = vec![Point3::new(f64::MAX, f64::MAX, f64::MAX); leaves];
    for (p, &leaf) in positions.iter().zip(leaf_of) {
        let apex = &mut apices[leaf as usize];
        if p.coords.norm_squared() < apex.coords.norm_squared() {
            *apex = *p;
        }
    }
    apices
}

/// One leaf of length `length` along `stand` times y from `from`: 6 vertices, 4 triangles.
fn leaf(mesh: &mut TemplateMesh, from: Vector3<f64>, stand: &Rotation3<f64>, length: f64) {
    // Across, along, up; the sides stand up from the midrib, and the tip hangs.
    const POINTS: [[f64; 3]; 6] = [
        [0.0, 0.0, 0.0],
        [-0.31, 0.32, 0.11],
        [0.31, 0.32, 0.11],
        [-0.24, 0.68, 0.02],
        [0.24, 0.68, 0.02],
        [0.0, 1.0, -0.12],
    ];
    const TRIANGLES: [u32; 12] = [0, 5, 1, 1, 5, 3, 0, 2, 5, 2, 4, 5];
    let first = mesh.positions.len() as u32;
    for [x, y, z] in POINTS {
        let p = from + stand * (Vector3::new(x, y, z) * length);
        mesh.positions.push([p.x as f32, p.y as f32, p.z as f32]);
        mesh.uvs.push([(0.5 + x / 0.64) as f32, (1.0 - y) as f32]);
    }
    mesh.indices.extend(TRIANGLES.map(|i| first + i));
}

/// Leaves out the vertices that no triangle uses.
fn keep_used(mesh: &mut TemplateMesh) {
    let mut used = vec![false; mesh.positions.len()];
    mesh.indices.iter().for_each(|&i| used[i as usize] = true);
    let mut new_index = vec![0; used.len()];
    for (next, (new, _)) in (0..).zip(new_index.iter_mut().zip(&used).filter(|(_, used)| **used)) {
        *new = next;
    }
    mesh.indices
        .iter_mut()
        .for_each(|i| *i = new_index[*i as usize]);
    fn only<T>(all: &mut Vec<T>, used: &[bool]) {
        let mut each = used.iter();
        all.retain(|_| each.next().is_none_or(|used| *used));
    }
    only(&mut mesh.positions, &used);
    only(&mut mesh.normals, &used);
    only(&mut mesh.uvs, &used);
}

/// Given normals made length 1, and those of the faces around where none is given or it is 0.
fn normals(mesh: &TemplateMesh, positions: &[Point3<f64>]) -> Vec<Vector3<f64>> {
    let mut around = vec![Vector3::zeros(); positions.len()];
    for t in mesh.indices.chunks_exact(3) {
        let face = area_vector(positions, t);
        t.iter().for_each(|&i| around[i as usize] += face);
    }
    let mut normals = Vec::with_capacity(positions.len());
    for (i, face) in around.into_iter().enumerate() {
        let given = mesh.normals.get(i).map(|v| Vector3::from(v.map(f64::from)));
        let normal = given.and_then(|v| v.try_normalize(1e-12));
        normals.push(
            normal
                .or(face.try_normalize(1e-12))
                .unwrap_or_else(Vector3::z),
        );
    }
    normals
}

/// Mean of what can be seen of a picture, 0 to 1; `None` if it cannot be read or is too large.
fn mean_colour(bytes: &[u8]) -> Option<[f64; 3]> {
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .ok()?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(LARGEST_TEXTURE);
    limits.max_image_height = Some(LARGEST_TEXTURE);
    reader.limits(limits);
    let picture = reader.decode().ok()?.into_rgba8();
    let (mut sum, mut weight) = ([0.0; 3], 0.0);
    for pixel in picture.pixels() {
        let [r, g, b, alpha] = pixel.0.map(f64::from);
        weight += alpha;
        [r, g, b]
            .iter()
            .zip(&mut sum)
            .for_each(|(c, s)| *s += alpha * c);
    }
    Some(sum.map(|s| {
        if weight > 0.0 {
            s / weight / 255.0
        } else {
            1.0
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_cluster_is_five_leaves_with_a_texture() {
        let ours = Template::ours();
        assert_eq!((ours.triangles(), ours.apices.len()), (20, 5));
        assert!(
            ours.texture.is_some() && ours.mean_area() > 0.1,
            "{}",
            ours.mean_area()
        );
        assert!(ours.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-9));
    }

    fn good() -> TemplateMesh {
        TemplateMesh {
            positions: vec![[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
            indices: vec![0, 1, 2],
            ..TemplateMesh::default()
        }
    }

    fn refused(change: fn(&mut TemplateMesh)) -> TemplateFault {
        let mut mesh = good();
        change(&mut mesh);
        Template::new(mesh).expect_err("no template")
    }

    #[test]
    fn what_is_no_template_is_refused() {
        assert!(Template::new(good()).is_ok());
        assert_eq!(refused(|m| m.indices.clear()), TemplateFault::Empty);
        assert_eq!(refused(|m| m.indices[2] = 3), TemplateFault::Torn);
        assert_eq!(refused(|m| m.uvs.push([0.0; 2])), TemplateFault::Torn);
        assert_eq!(
            refused(|m| m.positions[1][0] = f32::NAN),
            TemplateFault::NoNumbers
        );
        assert_eq!(refused(|m| m.positions.fill([1.0; 3])), TemplateFault::Flat);
        assert_eq!(
            refused(|m| m.texture = Some(("image/png", vec![1, 2, 3]))),
            TemplateFault::BadTexture
        );
        assert_eq!(
            refused(|m| m.indices = [0, 1, 2].repeat(5001)),
            TemplateFault::TooMany(5001)
        );
    }

    /// Exporters write the vertices of a whole scene beside one leaf's triangles; a thousand leaves
    /// would carry them all.
    #[test]
    fn vertices_without_a_triangle_are_left_out() {
        let mesh = TemplateMesh {
            positions: vec![
                [f32::NAN; 3],
                [0.0, 0.0, 0.0],
                [9e9; 3],
                [3.0, 0.0, 0.0],
                [0.0, 4.0, 0.0],
                [5.0; 3],
            ],
            normals: (0..6).map(|k| [0.0, 0.0, k as f32]).collect(),
            uvs: (0..6).map(|k| [k as f32, 0.0]).collect(),
            indices: vec![4, 1, 3, 5],
            texture: None,
        };
        let template = Template::new(mesh).unwrap();
        assert_eq!(
            (template.positions.len(), &template.indices[..]),
            (3, &[2, 0, 1][..])
        );
        assert_eq!(template.uvs, [[1.0, 0.0], [3.0, 0.0], [4.0, 0.0]]);
        assert_eq!((template.normals.len(), template.apices.len()), (3, 1));
        assert!((template.positions[2] - template.positions[0]).norm() > 0.9);
    }
}
