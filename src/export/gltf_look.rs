//! Materials of a glTF file: bark and leaf.

use super::ExportError;
use super::gltf_buffer::BufferBuilder;
use super::gltf_model::raw;
use crate::document::png;
use crate::geometry::{Bark, GROUND_RGB};
use gltf_json::image::MimeType;
use gltf_json::material::{
    AlphaCutoff, AlphaMode, Material, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor,
};
use gltf_json::texture::{Info, MagFilter, MinFilter, Sampler, Texture, WrappingMode};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Image, Index, Root};
use serde_json::json;

/// glTF colours are linear, those of a picture are not (sRGB transfer function, IEC 61966-2-1). 0
/// to 1.
pub(super) fn linear(channel: u8) -> f32 {
    let c = f32::from(channel) / 255.0;
    if c <= 0.04045 {
        c / 12.92
    } else {
        ((c + 0.055) / 1.055).powf(2.4)
    }
}

/// The material of wood that nobody has seen.
pub(super) const MADE_UP_BARK: &str = "bark_made_up";

/// One colour (sRGB), or the filmed bark, a tile that is repeated. `extras` say where it comes from.
///
/// # Errors
/// The tile is no picture.
pub(super) fn bark(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    bark: &Bark,
) -> Result<Material, ExportError> {
    let [mut r, mut g, mut b] = bark.rgb.map(linear);
    let mut texture = None;
    if let Some(tile) = &bark.tile {
        // In the buffer always: it is small.
        let view = buffer.view(root, png(tile)?.into_iter(), None);
        let source = root.push(Image {
            buffer_view: Some(view),
            mime_type: Some(MimeType("image/png".to_owned())),
            name: Some("bark".to_string()),
            uri: None,
            extensions: None,
            extras: None,
        });
        let index = push_sampled(root, source, "bark", WrappingMode::Repeat);
        // The tile has the colour.
        [r, g, b] = [1.0; 3];
        texture = Some(Info {
            index,
            tex_coord: 0,
            extensions: None,
            extras: None,
        });
    }
    Ok(Material {
        name: Some("bark".to_string()),
        extras: raw(&json!({ "colour_from": bark.source.word() }))?,
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, 1.0]),
            base_color_texture: texture,
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.9),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    })
}

/// The ground of a forest.
pub(super) fn ground() -> Material {
    let [r, g, b] = GROUND_RGB.map(linear);
    Material {
        name: Some("ground".to_string()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, 1.0]),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(1.0),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    }
}

/// How the picture of a leaf goes into the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct LeafPicture<'a> {
    /// Kind (MIME) and bytes of the file.
    pub texture: &'a (&'static str, Vec<u8>),
    /// Repeated beyond its edges.
    pub tiled: bool,
    /// In a file of its own, not in the buffer.
    pub apart: bool,
}

impl LeafPicture<'_> {
    /// The ending of its file's name.
    ///
    /// # Errors
    /// It is of a kind that the format does not know.
    pub fn ending(&self) -> Result<&'static str, ExportError> {
        match self.texture.0 {
            "image/png" => Ok("png"),
            "image/jpeg" => Ok("jpg"),
            other => Err(ExportError::unfit(format!(
                "{other} is no texture for a model, only PNG and JPEG are"
            ))),
        }
    }
}

/// Leaves take their colour from their vertices, and shape and veins from the picture, where there
/// is one: seen from both sides, cut out where it is clear.
///
/// # Errors
/// The picture is of a kind that the format does not know.
pub(super) fn leaf(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    picture: Option<LeafPicture>,
) -> Result<Index<Material>, ExportError> {
    let mut material = Material {
        name: Some("leaf".to_string()),
        double_sided: true,
        pbr_metallic_roughness: PbrMetallicRoughness {
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.8),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    };
    if let Some(picture) = picture {
        picture.ending()?;
        let info = Info {
            index: push_texture(root, buffer, &picture),
            tex_coord: 0,
            extensions: None,
            extras: None,
        };
        material.pbr_metallic_roughness.base_color_texture = Some(info);
        material.alpha_mode = Valid(AlphaMode::Mask);
        material.alpha_cutoff = Some(AlphaCutoff(0.5));
    }
    Ok(root.push(material))
}

fn push_texture(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    picture: &LeafPicture,
) -> Index<Texture> {
    let (kind, bytes) = picture.texture;
    let inside = !picture.apart;
    let buffer_view = inside.then(|| buffer.view(root, bytes.iter().copied(), None));
    let source = root.push(Image {
        buffer_view,
        mime_type: inside.then(|| MimeType((*kind).to_owned())),
        name: Some("leaf".to_string()),
        uri: None,
        extensions: None,
        extras: None,
    });
    // A picture of one leaf must not come in again at its other edge.
    let wrap = if picture.tiled {
        WrappingMode::Repeat
    } else {
        WrappingMode::ClampToEdge
    };
    push_sampled(root, source, "leaf", wrap)
}

/// A picture as a texture of that name.
fn push_sampled(
    root: &mut Root,
    source: Index<Image>,
    name: &str,
    wrap: WrappingMode,
) -> Index<Texture> {
    let sampler = root.push(Sampler {
        mag_filter: Some(Valid(MagFilter::Linear)),
        min_filter: Some(Valid(MinFilter::LinearMipmapLinear)),
        name: None,
        wrap_s: Valid(wrap),
        wrap_t: Valid(wrap),
        extensions: None,
        extras: None,
    });
    root.push(Texture {
        name: Some(name.to_owned()),
        sampler: Some(sampler),
        source,
        extensions: None,
        extras: None,
    })
}
