//! A user's own leaf: the meshes of a glTF file as the template that stands at every seed.

use super::template_bytes::Taken;
use super::template_error::TemplateError;
use crate::geometry::{Template, TemplateFault, TemplateMesh};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Accessor, Gltf, Semantic};
use nalgebra::{Matrix4, Point3, Vector3};
use std::path::Path;

/// Vertices that are read before it is known which of them the triangles use.
const MOST_VERTICES: usize = 65_536;
const CUT_OFF: &str = "a mesh is cut off";

/// Reads a leaf template from a `.glb` or `.gltf`: all triangles of its scene, where they stand,
/// and the base colour texture of the first mesh that has one. Files beside it are read by plain
/// name only.
///
/// # Errors
/// What [`TemplateError`] names.
pub fn read_template(path: &Path) -> Result<Template, TemplateError> {
    let (mut taken, bytes) = Taken::file(path)?;
    let Gltf { document, blob } =
        Gltf::from_slice(&bytes).map_err(|e| no_gltf(path, &e.to_string()))?;
    // The crate takes for granted what the format says of images, and checks it nowhere.
    if !document.as_json().images.iter().all(has_data) {
        return Err(no_gltf(
            path,
            "an image in it has no data, or does not say of which kind they are",
        ));
    }
    let mut file = Parts {
        path,
        buffers: buffers(&document, blob.as_deref(), &mut taken, path)?,
        taken,
    };
    let mesh = file.triangles(&document)?;
    if mesh.indices.is_empty() {
        return Err(TemplateError::NoMesh { path: path.into() });
    }
    Template::new(mesh).map_err(|fault| TemplateError::Unfit {
        path: path.into(),
        fault,
    })
}

fn no_gltf(path: &Path, what: &str) -> TemplateError {
    TemplateError::NoGltf {
        path: path.into(),
        what: what.replace('\n', " "),
    }
}

fn has_data(image: &gltf::json::Image) -> bool {
    match image.buffer_view {
        Some(_) => image.mime_type.is_some(),
        None => image.uri.is_some(),
    }
}

/// The bytes of all buffers.
fn buffers(
    document: &gltf::Document,
    blob: Option<&[u8]>,
    taken: &mut Taken,
    path: &Path,
) -> Result<Vec<Vec<u8>>, TemplateError> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => {
                let blob = blob.ok_or_else(|| no_gltf(path, "its binary part is missing"))?;
                taken.more(blob.len())?;
                blob.to_vec()
            }
            gltf::buffer::Source::Uri(uri) => taken.referred(uri)?,
        };
        if data.len() < buffer.length() {
            return Err(no_gltf(path, "a buffer is shorter than it says"));
        }
        buffers.push(data);
    }
    Ok(buffers)
}

struct Parts<'a> {
    path: &'a Path,
    taken: Taken<'a>,
    buffers: Vec<Vec<u8>>,
}

impl Parts<'_> {
    fn no_gltf(&self, what: &str) -> TemplateError {
        no_gltf(self.path, what)
    }

    fn unfit(&self, fault: TemplateFault) -> TemplateError {
        TemplateError::Unfit {
            path: self.path.into(),
            fault,
        }
    }

    /// All triangles of the scene, where they stand.
    fn triangles(&mut self, document: &gltf::Document) -> Result<TemplateMesh, TemplateError> {
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
            for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                if primitive.mode() == Mode::Triangles {
                    self.add(&primitive, &place, &mut mesh)?;
                }
            }
            waiting.extend(node.children().map(|child| (child, place)));
        }
        Ok(mesh)
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
        self.refuse_large(primitive, &positions, mesh)?;
        let first = mesh.positions.len() as u32;
        let count = positions.count() as u32;
        for p in self.floats::<3>(&positions, Dimensions::Vec3)? {
            let at = place.transform_point(&Point3::from(p.map(f64::from)));
            mesh.positions.push([at.x as f32, at.y as f32, at.z as f32]);
        }
        self.add_normals(primitive, place, count, mesh)?;
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
        let whole = &indices[..indices.len() / 3 * 3];
        mesh.indices.extend(whole.iter().map(|i| first + i));
        if mesh.texture.is_none() {
            mesh.texture = self.texture(primitive)?;
        }
        Ok(())
    }

    /// Refuses more vertices and triangles than a template may have, before they are read: a small
    /// file may name the same ones any number of times.
    fn refuse_large(
        &self,
        primitive: &gltf::Primitive,
        positions: &Accessor,
        mesh: &TemplateMesh,
    ) -> Result<(), TemplateError> {
        let found = positions.count().saturating_add(mesh.positions.len());
        if found > MOST_VERTICES {
            return Err(self.unfit(TemplateFault::TooManyVertices {
                found,
                most: MOST_VERTICES,
            }));
        }
        let corners = primitive.indices().map_or(positions.count(), |i| i.count());
        let triangles = (mesh.indices.len() / 3).saturating_add(corners / 3);
        if triangles > Template::MOST_TRIANGLES {
            return Err(self.unfit(TemplateFault::TooMany(triangles)));
        }
        Ok(())
    }

    /// The normals of `count` vertices that stand at `place`.
    fn add_normals(
        &self,
        primitive: &gltf::Primitive,
        place: &Matrix4<f64>,
        count: u32,
        mesh: &mut TemplateMesh,
    ) -> Result<(), TemplateError> {
        // A mirrored or stretched normal needs the inverse transpose.
        let inverse = place.fixed_view::<3, 3>(0, 0).try_inverse();
        let normals = primitive.get(&Semantic::Normals);
        let normals = normals.filter(|n| n.count() == count as usize);
        let (Some(normals), Some(inverse)) = (normals, inverse) else {
            // The template computes them.
            mesh.normals.extend((0..count).map(|_| [0.0; 3]));
            return Ok(());
        };
        let upright = inverse.transpose();
        for n in self.floats::<3>(&normals, Dimensions::Vec3)? {
            let n = upright * Vector3::from(n.map(f64::from));
            let n = n.try_normalize(1e-12).unwrap_or(Vector3::zeros());
            mesh.normals.push([n.x as f32, n.y as f32, n.z as f32]);
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
            _ => return Err(self.unfit(TemplateFault::BadTexture)),
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
        self.elements(accessor, 4 * N, le_floats::<N>)
    }

    fn indices(&self, accessor: &Accessor) -> Result<Vec<u32>, TemplateError> {
        let size = match accessor.data_type() {
            DataType::U8 => 1,
            DataType::U16 => 2,
            DataType::U32 => 4,
            _ => return Err(self.no_gltf("its indices are no whole numbers")),
        };
        self.elements(accessor, size, le_number)
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
        let end = view.offset().saturating_add(view.length());
        let bytes = buffer.get(view.offset()..end);
        let bytes = bytes.ok_or_else(|| self.no_gltf(CUT_OFF))?;
        let mut elements = Vec::new();
        for k in 0..accessor.count() {
            let start = stride
                .checked_mul(k)
                .and_then(|way| way.checked_add(accessor.offset()));
            let own = start.and_then(|start| bytes.get(start..start.checked_add(size)?));
            elements.push(element(own.ok_or_else(|| self.no_gltf(CUT_OFF))?));
        }
        Ok(elements)
    }
}

/// Floats of four bytes.
fn le_floats<const N: usize>(bytes: &[u8]) -> [f32; N] {
    let mut floats = [f32::NAN; N];
    for (float, four) in floats.iter_mut().zip(bytes.chunks_exact(4)) {
        *float = four.try_into().map_or(f32::NAN, f32::from_le_bytes);
    }
    floats
}

/// A whole number of up to four bytes.
fn le_number(bytes: &[u8]) -> u32 {
    let highest_first = bytes.iter().rev();
    highest_first.fold(0, |n, &byte| n << 8 | u32::from(byte))
}
