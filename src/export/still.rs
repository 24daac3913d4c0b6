//! The tree at rest for those who need no motion: OBJ and PLY.

use super::ExportError;
use super::gltf::NamedBytes;
use crate::document::push_number;
use crate::geometry::{Dressed, Mesh};

/// What the wood is called.
const WOOD: &str = "tree";

/// A mesh with its looks.
struct Part<'a> {
    name: String,
    mesh: &'a Mesh,
    /// One colour for all vertices, or one for each (sRGB).
    colours: &'a [[u8; 3]],
}

impl Part<'_> {
    fn colour(&self, vertex: usize) -> [u8; 3] {
        self.colours
            .get(vertex)
            .or(self.colours.first())
            .copied()
            .unwrap_or([128; 3])
    }
}

/// Wood and leaves.
///
/// # Errors
/// A position is no number, or there is nothing to draw.
fn parts(dressed: &Dressed) -> Result<Vec<Part<'_>>, ExportError> {
    let bark = std::slice::from_ref(&dressed.bark.rgb);
    let wood = dressed.wood.first().map(|mesh| Part {
        name: WOOD.into(),
        mesh,
        colours: bark,
    });
    let leaves = dressed.foliage.groups.iter().enumerate();
    let leaves = leaves.map(|(k, g)| Part {
        name: format!("leaves_{k}"),
        mesh: &g.mesh,
        colours: &g.colours,
    });
    let parts: Vec<Part> = wood
        .into_iter()
        .chain(leaves)
        .filter(|p| !p.mesh.indices.is_empty())
        .collect();
    if parts.is_empty() {
        return Err(ExportError::unfit(
            "no branch of it has a length; use --format csv or glb for its nodes",
        ));
    }
    for Part { mesh, .. } in &parts {
        let numbers = mesh
            .positions
            .iter()
            .chain(&mesh.normals)
            .flatten()
            .all(|x| x.is_finite());
        let n = mesh.positions.len();
        let same = mesh.normals.len() == n
            && mesh.uvs.len() == n
            && mesh.indices.iter().all(|&i| (i as usize) < n);
        if !numbers || !same {
            return Err(ExportError::unfit(
                "its mesh has positions that are no numbers or indices beyond them",
            ));
        }
    }
    Ok(parts)
}

fn scale(metres_per_px: f64) -> f64 {
    if metres_per_px > 0.0 {
        metres_per_px
    } else {
        1.0
    }
}

/// The first lines of a file as comments that begin with `mark`.
fn comments(mark: &str, about: &[String]) -> String {
    let program = concat!("arborcam ", env!("CARGO_PKG_VERSION"));
    let lines = std::iter::once(program).chain(about.iter().map(String::as_str));
    lines.map(|line| format!("{mark} {line}\n")).collect()
}

/// `STEM.mtl`, the texture of the leaves where there is one, and `STEM.obj`, in this order. `about`
/// is what is said of the tree, lines of comment.
///
/// # Errors
/// There is nothing to draw, or it is no number.
pub fn obj_files(
    dressed: &Dressed,
    stem: &str,
    metres_per_px: f64,
    about: &[String],
) -> Result<Vec<NamedBytes>, ExportError> {
    let parts = parts(dressed)?;
    let mut text = format!("{}mtllib {stem}.mtl\n", comments("#", about));
    let mut before = 1;
    for part in &parts {
        push_part(&mut text, part, metres_per_px, before);
        before += part.mesh.positions.len();
    }
    let texture = dressed.foliage.texture.as_ref().map(|(kind, bytes)| {
        let ending = if *kind == "image/png" { "png" } else { "jpg" };
        // One beside it of the same name may be a glTF's.
        (format!("{stem}_obj_leaf.{ending}"), bytes.clone())
    });
    let mut materials = String::new();
    push_material(&mut materials, "bark", dressed.bark.rgb, None);
    if parts.iter().any(|p| p.name != WOOD) {
        let file = texture.as_ref().map(|(name, _)| name.as_str());
        push_material(&mut materials, "leaf", mean_colour(dressed), file);
    }
    let mut files = vec![(format!("{stem}.mtl"), materials.into_bytes())];
    files.extend(texture);
    files.push((format!("{stem}.obj"), text.into_bytes()));
    Ok(files)
}

/// The text of one object; its vertices are numbered from `first` on.
fn push_part(text: &mut String, part: &Part, metres_per_px: f64, first: usize) {
    let mesh = part.mesh;
    let scale = scale(metres_per_px);
    let decimals = if metres_per_px > 0.0 { 7 } else { 4 };
    let material = if part.name == WOOD { "bark" } else { "leaf" };
    text.push_str(&format!("o {}\nusemtl {material}\n", part.name));
    for (k, p) in mesh.positions.iter().enumerate() {
        text.push('v');
        push_row(text, p.map(|x| f64::from(x) * scale), decimals);
        // Colours after the place: few programs know them, and none minds.
        push_row(text, part.colour(k).map(|c| f64::from(c) / 255.0), 3);
        text.push('\n');
    }
    for [u, v] in &mesh.uvs {
        text.push_str("vt");
        push_row(text, [f64::from(*u), f64::from(1.0 - *v)], 5);
        text.push('\n');
    }
    for normal in &mesh.normals {
        text.push_str("vn");
        push_row(text, normal.map(f64::from), 4);
        text.push('\n');
    }
    for t in mesh.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| i as usize + first);
        text.push_str(&format!("f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}\n"));
    }
}

/// Each with a blank before it.
fn push_row<const N: usize>(text: &mut String, values: [f64; N], decimals: usize) {
    for x in values {
        text.push(' ');
        push_number(text, x, decimals);
    }
}

fn push_material(text: &mut String, name: &str, rgb: [u8; 3], map: Option<&str>) {
    text.push_str(&format!("newmtl {name}\nKd"));
    push_row(text, rgb.map(|c| f64::from(c) / 255.0), 3);
    text.push_str("\nKs 0 0 0\nillum 1\n");
    if let Some(file) = map {
        text.push_str(&format!("map_Kd {file}\nmap_d {file}\n"));
    }
}

/// Of all leaves, sRGB.
fn mean_colour(dressed: &Dressed) -> [u8; 3] {
    let (mut sum, mut n) = ([0_u64; 3], 0_u64);
    for colour in dressed.foliage.groups.iter().flat_map(|g| &g.colours) {
        for (sum, channel) in sum.iter_mut().zip(colour) {
            *sum += u64::from(*channel);
        }
        n += 1;
    }
    sum.map(|s| (s / n.max(1)) as u8)
}

/// One binary PLY with places, normals and colours, and what is said of the tree as comments.
///
/// # Errors
/// As of [`obj_files`].
pub fn ply(
    dressed: &Dressed,
    metres_per_px: f64,
    about: &[String],
) -> Result<Vec<u8>, ExportError> {
    let parts = parts(dressed)?;
    let scale = scale(metres_per_px);
    let vertices: usize = parts.iter().map(|p| p.mesh.positions.len()).sum();
    let faces: usize = parts.iter().map(|p| p.mesh.indices.len() / 3).sum();
    let floats: String = ["x", "y", "z", "nx", "ny", "nz"]
        .map(|c| format!("property float {c}\n"))
        .concat();
    let colours: String = ["red", "green", "blue"]
        .map(|c| format!("property uchar {c}\n"))
        .concat();
    let head = format!(
        "ply\nformat binary_little_endian 1.0\n{}element vertex {vertices}\n{floats}{colours}\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n",
        comments("comment", about)
    );
    let mut bytes = head.into_bytes();
    bytes.reserve(27 * vertices + 13 * faces);
    for part in &parts {
        for (k, (p, n)) in part
            .mesh
            .positions
            .iter()
            .zip(&part.mesh.normals)
            .enumerate()
        {
            p.iter()
                .for_each(|&x| bytes.extend(((f64::from(x) * scale) as f32).to_le_bytes()));
            n.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.extend(part.colour(k));
        }
    }
    let mut before = 0;
    for part in &parts {
        for t in part.mesh.indices.chunks_exact(3) {
            bytes.push(3);
            t.iter()
                .for_each(|i| bytes.extend((i + before).to_le_bytes()));
        }
        before += part.mesh.positions.len() as u32;
    }
    Ok(bytes)
}
