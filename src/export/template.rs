//! A user's own leaf: the meshes of a glTF file as the template that stands at every seed.

use super::template_bytes::Taken;
use crate::shape::{Template, TemplateFault, TemplateMesh};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Accessor, Gltf, Semantic};
use nalgebra::{Matrix4, Point3, Vector3};
use std::path::{Path, PathBuf};

/// Larger files are refused, and so are larger files that they refer to, bytes.
pub(super) const LARGEST: u64 = 16 << 20;
/// Vertices that are read before it is known which of them the triangles use.
const MOST_VERTICES: usize = 65_536;

/// Why a file is no leaf template; each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum TemplateError {
    #[error("cannot read leaf template {}: {source}; check the name", .path.display())]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error(
        "leaf template {} is too large: at most {LARGEST} bytes are taken of a file, and three times that in all; make its \
         texture smaller",
        .path.display()
    )]
    TooLarge { path: PathBuf },
    #[error("leaf template {} is no glTF 2.0 file that can be used: {what}; export it as GLB with its texture inside", .path.display())]
    NoGltf { path: PathBuf, what: String },
    #[error("leaf template {} has no mesh of triangles; export a leaf or a small cluster of leaves", .path.display())]
    NoMesh { path: PathBuf },
    #[error("leaf template {} cannot be used: {fault}; export a leaf or a small cluster of leaves", .path.display())]
    Unfit { path: PathBuf, fault: TemplateFault },
}

/// Reads a leaf template from a `.glb` or `.gltf`: all triangles of its scene, where they stand,
/// and the base colour texture of the first mesh that has one. Files beside it are read by plain
/// name only.
///
/// # Errors
/// What [`TemplateError`] names.
pub fn read_template(path: &Path) -> Result<Template, TemplateError> {
    let (mut taken, bytes) = Taken::file(path)?;
    let no_gltf = |what: String| TemplateError::NoGltf {
        path: path.into(),
        what: what.replace('\n', " "),
    };
    let Gltf { document, blob } = Gltf::from_slice(&bytes).map_err(|e| no_gltf(e.to_string()))?;
    // The crate takes for granted what the format says of images, and checks it nowhere.
    let sound = |image: &gltf::json::Image| match image.buffer_view {
        Some(_) => image.mime_type.is_some(),
        None => image.uri.is_some(),
    };
    if !document.as_json().images.iter().all(sound) {
        return Err(no_gltf(
            "an image in it has no data, or does not say of which kind they are".into(),
        ));
    }
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => {
                let blob = blob
                    .as_ref()
                    .ok_or_else(|| no_gltf("its binary part is missing".into()))?;
                taken.more(blob.len())?;
                blob.clone()
            }
            gltf::buffer::Source::Uri(uri) => taken.referred(uri)?,
        };
        if data.len() < buffer.length() {
            return Err(no_gltf("a buffer is shorter than it says".into()));
        }
        buffers.push(data);
    }
    let mut file = Parts {
        path,
        taken,
        buffers,
    };
    let mut mesh = TemplateMesh::default();
    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next());
    let mut visited = vec![false; document.nodes().count()];
    let mut waiting: Vec<(gltf::Node, Matrix4<f64>)> = Vec::new();
    if let Some(scene) = scene {
        waiting.extend(scene.nodes().map(|n| (n, Matrix4::identity())));
    }
    while let Some((node, above)) = waiting.pop() {
        // A file may name a node twice, or as its own ancestor.
        if std::mem::replace(&mut visited[node.index()], true) {
            continue;
        }
        let columns = node.transform().matrix().map(|c| c.map(f64::from));
        let place = above * Matrix4::from_fn(|r, c| columns[c][r]);
        for primitive in node
            .mesh()
            .iter()
            .flat_map(|m| m.primitives())
            .filter(|p| p.mode() == Mode::Triangles)
        {
            file.add(&primitive, &place, &mut mesh)?;
        }
        waiting.extend(node.children().map(|child| (child, place)));
    }
    if mesh.indices.is_empty() {
        return Err(TemplateError::NoMesh { path: path.into() });
    }
    Template::new(mesh).map_err(|fault| TemplateError::Unfit {
        path: path.into(),
        fault,
    })
}

struct Parts<'a> {
    path: &'a Path,
    taken: Taken<'a>,
    buffers: Vec<Vec<u8>>,
}

impl Parts<'_> {
    fn no_gltf(&self, what: &str) -> TemplateError {
        TemplateError::NoGltf {
            path: self.path.into(),
            what: what.into(),
        }
    }

    /// Adds the triangles of a primitive that stands at `place`.
    fn add(
        &mut self,
        primitive: &gltf::Primitive,
        place: &Matrix4<f64>,
        mesh: &mut TemplateMesh,
    ) -> Result<(), TemplateError> {
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            return Ok(());
        };
        let unfit = |fault| {
            Err(TemplateError::Unfit {
                path: self.path.into(),
                fault,
            })
        };
        let vertices = positions.count().saturating_add(mesh.positions.len());
        if vertices > MOST_VERTICES {
            return unfit(TemplateFault::TooManyVertices {
                found: vertices,
                most: MOST_VERTICES,
            });
        }
        // Before they are read: a small file may name the same ones any number of times.
        let corners = primitive.indices().map_or(positions.count(), |i| i.count());
        let triangles = (mesh.indices.len() / 3).saturating_add(corners / 3);
        if triangles > Template::MOST_TRIANGLES {
            return unfit(TemplateFault::TooMany(triangles));
        }
        let first = mesh.positions.len() as u32;
        let count = positions.count() as u32;
        for p in self.floats::<3>(&positions, Dimensions::Vec3)? {
            let at = place.transform_point(&Point3::from(p.map(f64::from)));
            mesh.positions.push([at.x as f32, at.y as f32, at.z as f32]);
        }
        // A mirrored or stretched normal needs the inverse transpose.
        let upright = place
            .fixed_view::<3, 3>(0, 0)
            .try_inverse()
            .map(|m| m.transpose());
        match primitive
            .get(&Semantic::Normals)
            .zip(upright)
            .filter(|(n, _)| n.count() == positions.count())
        {
            Some((normals, upright)) => {
                for n in self.floats::<3>(&normals, Dimensions::Vec3)? {
                    let n = upright * Vector3::from(n.map(f64::from));
                    let n = n.try_normalize(1e-12).unwrap_or(Vector3::zeros());
                    mesh.normals.push([n.x as f32, n.y as f32, n.z as f32]);
                }
            }
            // The template computes them.
            None => mesh.normals.extend((0..count).map(|_| [0.0; 3])),
        }
        // Coordinates as bytes are allowed, and rare; without any the texture's middle is taken.
        let uvs = primitive.get(&Semantic::TexCoords(0));
        match uvs.filter(|a| a.data_type() == DataType::F32 && a.count() == positions.count()) {
            Some(uvs) => mesh.uvs.extend(self.floats::<2>(&uvs, Dimensions::Vec2)?),
            None => mesh.uvs.extend((0..count).map(|_| [0.5; 2])),
        }
        let indices = match primitive.indices() {
            Some(indices) => self.indices(&indices)?,
            None => (0..count).collect(),
        };
        if indices.iter().any(|&i| i >= count) {
            return Err(self.no_gltf("an index points beyond its vertices"));
        }
        mesh.indices
            .extend(indices[..indices.len() / 3 * 3].iter().map(|i| first + i));
        if mesh.texture.is_none() {
            mesh.texture = self.texture(primitive)?;
        }
        Ok(())
    }

    /// The base colour texture, PNG or JPEG.
    fn texture(
        &mut self,
        primitive: &gltf::Primitive,
    ) -> Result<Option<(&'static str, Vec<u8>)>, TemplateError> {
        let look = primitive
            .material()
            .pbr_metallic_roughness()
            .base_color_texture();
        let Some(image) = look.map(|t| t.texture().source()) else {
            return Ok(None);
        };
        let bytes = match image.source() {
            gltf::image::Source::View { view, .. } => {
                let (start, end) = (view.offset(), view.offset().saturating_add(view.length()));
                let buffer = &self.buffers[view.buffer().index()];
                buffer
                    .get(start..end)
                    .ok_or_else(|| self.no_gltf("its texture is cut off"))?
                    .to_vec()
            }
            gltf::image::Source::Uri { uri, .. } => self.taken.referred(uri)?,
        };
        let kind = match bytes.as_slice() {
            [0x89, b'P', b'N', b'G', ..] => "image/png",
            [0xff, 0xd8, ..] => "image/jpeg",
            _ => {
                return Err(TemplateError::Unfit {
                    path: self.path.into(),
                    fault: TemplateFault::BadTexture,
                });
            }
        };
        Ok(Some((kind, bytes)))
    }

    /// Vectors of `N` floats.
    fn floats<const N: usize>(
        &self,
        accessor: &Accessor,
        kind: Dimensions,
    ) -> Result<Vec<[f32; N]>, TemplateError> {
        if accessor.data_type() != DataType::F32 || accessor.dimensions() != kind {
            return Err(self.no_gltf("its positions, normals or texture coordinates are no floats"));
        }
        let float = |b: &[u8]| b.try_into().map_or(f32::NAN, f32::from_le_bytes);
        let vector = |b: &[u8]| std::array::from_fn(|k| float(&b[4 * k..4 * k + 4]));
        self.elements(accessor, 4 * N, vector)
    }

    fn indices(&self, accessor: &Accessor) -> Result<Vec<u32>, TemplateError> {
        let size = match accessor.data_type() {
            DataType::U8 => 1,
            DataType::U16 => 2,
            DataType::U32 => 4,
            _ => return Err(self.no_gltf("its indices are no whole numbers")),
        };
        let number = |b: &[u8]| {
            b.iter()
                .rev()
                .fold(0u32, |n, &byte| n << 8 | u32::from(byte))
        };
        self.elements(accessor, size, number)
    }

    fn elements<T>(
        &self,
        accessor: &Accessor,
        size: usize,
        element: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, TemplateError> {
        // Sparse accessors are for animation; a leaf that has them can be exported without.
        let view = accessor.view().filter(|_| accessor.sparse().is_none());
        let view = view.ok_or_else(|| self.no_gltf("it uses sparse or empty accessors"))?;
        let stride = view.stride().unwrap_or(size).max(1);
        let buffer = &self.buffers[view.buffer().index()];
        let cut_off = || self.no_gltf("a mesh is cut off");
        let end = view.offset().saturating_add(view.length());
        let bytes = buffer.get(view.offset()..end).ok_or_else(cut_off)?;
        let at = |k: usize| {
            let start = stride.checked_mul(k)?.checked_add(accessor.offset())?;
            bytes.get(start..start.checked_add(size)?)
        };
        (0..accessor.count())
            .map(|k| at(k).map(&element).ok_or_else(cut_off))
            .collect()
    }
}
