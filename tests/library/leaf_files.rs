//! A user's own leaf and a drawn density: what is taken, and what a file gets that is neither.

use arborcam::export::{TemplateError, read_template};
use arborcam::model::Size;
use arborcam::outline::{DensityError, density};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

/// A glTF of one square leaf 2 high, in the form of a GLB.
fn glb(change: impl Fn(&mut Value, &mut Vec<u8>)) -> Vec<u8> {
    let positions: [[f32; 3]; 4] = [
        [-0.5, 0.0, 0.0],
        [0.5, 0.0, 0.0],
        [0.5, 2.0, 0.0],
        [-0.5, 2.0, 0.1],
    ];
    let mut bin: Vec<u8> = positions
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    bin.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let texture = bin.len();
    let mut png = Vec::new();
    let picture = image::RgbImage::from_pixel(4, 4, image::Rgb([40, 120, 30]));
    picture
        .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
        .expect("PNG");
    bin.extend(&png);
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut gltf = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [3.0, 3.0, 3.0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"bufferView": 2, "mimeType": "image/png"}],
        "buffers": [{"byteLength": bin.len()}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12},
            {"buffer": 0, "byteOffset": texture, "byteLength": png.len()}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-0.5, 0, 0], "max": [0.5, 2, 0.1]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
    });
    change(&mut gltf, &mut bin);
    let mut text = gltf.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    out.extend(2u32.to_le_bytes());
    out.extend(((28 + text.len() + bin.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bin)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}

fn written(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).expect("file");
    path
}

#[test]
fn a_leaf_of_the_user_s_own_is_taken() {
    let folder = tempfile::tempdir().expect("folder");
    let good =
        read_template(&written(folder.path(), "leaf.glb", &glb(|_, _| {}))).expect("a template");
    assert_eq!(good.triangles(), 2);
    // The same as text with its data beside it.
    let whole = glb(|_, _| {});
    let text = u32::from_le_bytes(whole[12..16].try_into().expect("length")) as usize;
    let mut gltf: Value = serde_json::from_slice(&whole[20..20 + text]).expect("JSON");
    gltf["buffers"][0]["uri"] = "leaf.bin".into();
    written(folder.path(), "leaf.bin", &whole[28 + text..]);
    let apart = read_template(&written(
        folder.path(),
        "leaf.gltf",
        gltf.to_string().as_bytes(),
    ))
    .expect("a template");
    assert_eq!(apart, good);
}

/// Every file that is no leaf gets one line that names it and says what to do.
#[test]
fn what_is_no_leaf_is_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("folder");
    let many = |gltf: &mut Value, bin: &mut Vec<u8>| {
        let start = bin.len();
        bin.extend([0u8, 1, 2].repeat(6000));
        gltf["buffers"][0]["byteLength"] = bin.len().into();
        let view = json!({"buffer": 0, "byteOffset": start, "byteLength": 18_000});
        gltf["bufferViews"]
            .as_array_mut()
            .expect("views")
            .push(view);
        gltf["accessors"][1] =
            json!({"bufferView": 3, "componentType": 5121, "count": 18_000, "type": "SCALAR"});
    };
    // Small files that ask for much: the same data or the same mesh again and again.
    let again = |gltf: &mut Value, _: &mut Vec<u8>| {
        gltf["buffers"] = vec![gltf["buffers"][0].clone(); 400_000].into()
    };
    let doubled = |gltf: &mut Value, _: &mut Vec<u8>| {
        let primitive = gltf["meshes"][0]["primitives"][0].clone();
        gltf["meshes"][0]["primitives"] = vec![primitive; 30_000].into();
    };
    let unused = |gltf: &mut Value, bin: &mut Vec<u8>| {
        let start = bin.len();
        bin.resize(start + 12 * 70_000, 0);
        gltf["buffers"][0]["byteLength"] = bin.len().into();
        gltf["bufferViews"][0] =
            json!({"buffer": 0, "byteOffset": start, "byteLength": 12 * 70_000});
        gltf["accessors"][0]["count"] = 70_000.into();
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        (
            "bare_image.glb",
            glb(|g, _| g["images"] = json!([{"bufferView": 2}])),
            "an image in it has no data",
        ),
        (
            "no_image.glb",
            glb(|g, _| g["images"] = json!([{}])),
            "an image in it has no data",
        ),
        ("again.glb", glb(again), "three times that in all"),
        ("doubled.glb", glb(doubled), "triangles, and at most 5000"),
        (
            "unused.glb",
            glb(unused),
            "70000 vertices, and at most 65536",
        ),
        (
            "pipe.glb",
            glb(|g, _| g["buffers"][0]["uri"] = "fifo".into()),
            "not a file beside it",
        ),
        ("text.glb", b"this is no model".to_vec(), "no glTF"),
        ("empty.glb", Vec::new(), "no glTF"),
        ("cut.glb", glb(|_, _| {})[..200].to_vec(), "no glTF"),
        (
            "huge.glb",
            vec![0; 17 << 20],
            "at most 16777216 bytes are taken",
        ),
        ("many.glb", glb(many), "6000 triangles"),
        ("bare.glb", glb(|g, _| g["nodes"][0] = json!({})), "no mesh"),
        (
            "lines.glb",
            glb(|g, _| g["meshes"][0]["primitives"][0]["mode"] = 1.into()),
            "no mesh",
        ),
        (
            "nan.glb",
            glb(|_, bin| bin[0..4].copy_from_slice(&f32::NAN.to_le_bytes())),
            "no numbers",
        ),
        ("flat.glb", glb(|_, bin| bin[..48].fill(0)), "no size"),
        (
            "beyond.glb",
            glb(|_, bin| bin[48] = 200),
            "beyond its vertices",
        ),
        (
            "short.glb",
            glb(|g, _| g["bufferViews"][0]["byteLength"] = 20.into()),
            "cut off",
        ),
        (
            "long.glb",
            glb(|g, _| g["buffers"][0]["byteLength"] = 100_000.into()),
            "shorter than it says",
        ),
        ("texture.glb", glb(|_, bin| bin[64..68].fill(0)), "texture"),
        (
            "outside.glb",
            glb(|g, _| g["buffers"][0]["uri"] = "../secret".into()),
            "not a file beside it",
        ),
        (
            "away.glb",
            glb(|g, _| g["buffers"][0]["uri"] = "http://a.b/c".into()),
            "not a file beside it",
        ),
        (
            "sparse.glb",
            glb(|g, _| g["accessors"][0]["bufferView"] = Value::Null),
            "",
        ),
    ];
    let fifo = folder.path().join("fifo");
    assert!(
        std::process::Command::new("mkfifo")
            .arg(&fifo)
            .status()
            .expect("mkfifo")
            .success()
    );
    for (name, bytes, says) in cases {
        let message = read_template(&written(folder.path(), name, &bytes))
            .expect_err(name)
            .to_string();
        assert!(
            message.contains(name) && message.contains(says),
            "{name}: {message}"
        );
        assert!(
            !message.contains('\n') && message.contains("; "),
            "{name}: {message}"
        );
    }
    let absent = read_template(&folder.path().join("none.glb"));
    assert!(matches!(absent, Err(TemplateError::Unreadable { .. })));
    // A device has no length, and no end.
    assert!(matches!(
        read_template(Path::new("/dev/zero")),
        Err(TemplateError::TooLarge { .. })
    ));
}

/// Nodes that are their own ancestors must not be followed for ever: each is taken once.
#[test]
fn nodes_in_a_ring_end() {
    let folder = tempfile::tempdir().expect("folder");
    let ring = glb(|g, _| {
        g["nodes"] = json!([{"mesh": 0, "children": [1]}, {"children": [0]}]);
    });
    let template = read_template(&written(folder.path(), "ring.glb", &ring)).expect("a template");
    assert_eq!(template.triangles(), 2);
}

#[test]
fn a_drawn_density_is_read_or_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let size = Size::new(40, 30);
    let drawn = |name: &str, width: u32, shade: u8| {
        let path = folder.path().join(name);
        image::GrayImage::from_pixel(width, 30, image::Luma([shade]))
            .save(&path)
            .expect("PNG");
        path
    };
    let good = density(&drawn("good.png", 40, 130), size).expect("a density");
    assert_eq!((good.size, good.pixels[0]), (size, 130));
    assert!(matches!(
        density(&drawn("wide.png", 41, 130), size),
        Err(DensityError::WrongSize { .. })
    ));
    assert!(matches!(
        density(&drawn("black.png", 40, 0), size),
        Err(DensityError::Empty { .. })
    ));
    let text = written(folder.path(), "text.png", b"no picture");
    assert!(matches!(
        density(&text, size),
        Err(DensityError::Unreadable { .. })
    ));
    assert!(matches!(
        density(&folder.path().join("none.png"), size),
        Err(DensityError::Unreadable { .. })
    ));
}
