//! Materials of a glTF file: bark and leaf.

use super::ExportError;
use super::gltf_buffer::BufferBuilder;
use gltf_json::image::MimeType;
use gltf_json::material::{
    AlphaCutoff, AlphaMode, Material, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor,
};
use gltf_json::texture::{Info, MagFilter, MinFilter, Sampler, Texture, WrappingMode};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Image, Index, Root};

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

/// One colour (sRGB).
pub(super) fn bark(rgb: [u8; 3]) -> Material {
    let [r, g, b] = rgb.map(linear);
    Material {
        name: Some("bark".to_string()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, 1.0]),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.9),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    }
}

/// Leaves take their colour from their vertices, and shape and veins from the texture, where there
/// is one: seen from both sides, cut out where it is clear, repeated where it is `tiled`. With
/// `apart` the picture is given back with its file's ending instead of being put into the buffer.
#[allow(clippy::type_complexity)]
pub(super) fn leaf(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    texture: Option<&(&'static str, Vec<u8>)>,
    tiled: bool,
    apart: bool,
) -> Result<(Index<Material>, Option<(&'static str, Vec<u8>)>), ExportError> {
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
    let mut file = None;
    if let Some((kind, bytes)) = texture {
        let ending = match *kind {
            "image/png" => "png",
            "image/jpeg" => "jpg",
            other => {
                return Err(ExportError::unfit(format!(
                    "{other} is no texture for a model, only PNG and JPEG are"
                )));
            }
        };
        let buffer_view = (!apart).then(|| buffer.view(root, bytes.iter().copied(), None));
        file = apart.then(|| (ending, bytes.clone()));
        let source = root.push(Image {
            buffer_view,
            mime_type: (!apart).then(|| MimeType((*kind).to_owned())),
            name: Some("leaf".to_string()),
            uri: None,
            extensions: None,
            extras: None,
        });
        // A picture of one leaf must not come in again at its other edge.
        let wrap = if tiled {
            WrappingMode::Repeat
        } else {
            WrappingMode::ClampToEdge
        };
        let sampler = root.push(Sampler {
            mag_filter: Some(Valid(MagFilter::Linear)),
            min_filter: Some(Valid(MinFilter::LinearMipmapLinear)),
            name: None,
            wrap_s: Valid(wrap),
            wrap_t: Valid(wrap),
            extensions: None,
            extras: None,
        });
        let name = Some("leaf".to_string());
        let texture = root.push(Texture {
            name,
            sampler: Some(sampler),
            source,
            extensions: None,
            extras: None,
        });
        let info = Info {
            index: texture,
            tex_coord: 0,
            extensions: None,
            extras: None,
        };
        material.pbr_metallic_roughness.base_color_texture = Some(info);
        material.alpha_mode = Valid(AlphaMode::Mask);
        material.alpha_cutoff = Some(AlphaCutoff(0.5));
    }
    Ok((root.push(material), file))
}
