//! The tree at rest for those who need no motion: OBJ and PLY.

use super::gltf::NamedBytes;
use super::{ExportError, number};
use crate::shape::{Dressed, Mesh};

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
    let bark = std::slice::from_ref(&dressed.bark_rgb);
    let wood = dressed.wood.first().map(|mesh| Part {
        name: "tree".into(),
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

/// `STEM.mtl`, the texture of the leaves where there is one, and `STEM.obj`, in this order.
///
/// # Errors
/// There is nothing to draw, or it is no number.
pub fn obj_files(
    dressed: &Dressed,
    stem: &str,
    metres_per_px: f64,
) -> Result<Vec<NamedBytes>, ExportError> {
    let parts = parts(dressed)?;
    let (scale, decimals) = (
        scale(metres_per_px),
        if metres_per_px > 0.0 { 7 } else { 4 },
    );
    let mut text = format!(
        "# arborcam {}\nmtllib {stem}.mtl\n",
        env!("CARGO_PKG_VERSION")
    );
    let row = |text: &mut String, kind: &str, values: &mut dyn Iterator<Item = (f64, usize)>| {
        text.push_str(kind);
        for (x, decimals) in values {
            text.push(' ');
            number::push(text, x, decimals);
        }
        text.push('\n');
    };
    let mut before = 1;
    for part in &parts {
        let mesh = part.mesh;
        text.push_str(&format!(
            "o {}\nusemtl {}\n",
            part.name,
            if part.name == "tree" { "bark" } else { "leaf" }
        ));
        for (k, p) in mesh.positions.iter().enumerate() {
            // Colours after the place: few programs know them, and none minds.
            let colour = part.colour(k).map(|c| (f64::from(c) / 255.0, 3));
            row(
                &mut text,
                "v",
                &mut p
                    .iter()
                    .map(|&x| (f64::from(x) * scale, decimals))
                    .chain(colour),
            );
        }
        mesh.uvs.iter().for_each(|t| {
            row(
                &mut text,
                "vt",
                &mut [t[0], 1.0 - t[1]].iter().map(|&x| (f64::from(x), 5)),
            )
        });
        mesh.normals
            .iter()
            .for_each(|n| row(&mut text, "vn", &mut n.iter().map(|&x| (f64::from(x), 4))));
        for t in mesh.indices.chunks_exact(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| i as usize + before);
            text.push_str(&format!("f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}\n"));
        }
        before += mesh.positions.len();
    }
    let mut materials = String::new();
    let mut material = |name: &str, rgb: [u8; 3], map: Option<&str>| {
        materials.push_str(&format!("newmtl {name}\nKd"));
        for c in rgb {
            materials.push(' ');
            number::push(&mut materials, f64::from(c) / 255.0, 3);
        }
        materials.push_str("\nKs 0 0 0\nillum 1\n");
        map.iter()
            .for_each(|file| materials.push_str(&format!("map_Kd {file}\nmap_d {file}\n")));
    };
    material("bark", dressed.bark_rgb, None);
    let texture = dressed.foliage.texture.as_ref().map(|(kind, bytes)| {
        let ending = if *kind == "image/png" { "png" } else { "jpg" };
        (format!("{stem}_leaf.{ending}"), bytes.clone())
    });
    if parts.len() > 1 || parts.first().is_some_and(|p| p.name != "tree") {
        let leaves = dressed.foliage.groups.iter().flat_map(|g| &g.colours);
        let (mut sum, mut n) = ([0_u64; 3], 0_u64);
        for c in leaves {
            sum.iter_mut().zip(c).for_each(|(s, c)| *s += u64::from(*c));
            n += 1;
        }
        material(
            "leaf",
            sum.map(|s| (s / n.max(1)) as u8),
            texture.as_ref().map(|(name, _)| name.as_str()),
        );
    }
    let mtl = (format!("{stem}.mtl"), materials.into_bytes());
    Ok([mtl]
        .into_iter()
        .chain(texture)
        .chain([(format!("{stem}.obj"), text.into_bytes())])
        .collect())
}

/// One binary PLY with places, normals and colours.
///
/// # Errors
/// As of [`obj_files`].
pub fn ply(dressed: &Dressed, metres_per_px: f64) -> Result<Vec<u8>, ExportError> {
    let parts = parts(dressed)?;
    let scale = scale(metres_per_px);
    let count = |of: fn(&Mesh) -> usize| parts.iter().map(|p| of(p.mesh)).sum::<usize>();
    let (vertices, faces) = (count(|m| m.positions.len()), count(|m| m.indices.len() / 3));
    let floats: String = ["x", "y", "z", "nx", "ny", "nz"]
        .map(|c| format!("property float {c}\n"))
        .concat();
    let colours: String = ["red", "green", "blue"]
        .map(|c| format!("property uchar {c}\n"))
        .concat();
    let head = format!(
        "ply\nformat binary_little_endian 1.0\ncomment arborcam {}\nelement vertex {vertices}\n{floats}{colours}\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n",
        env!("CARGO_PKG_VERSION")
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
