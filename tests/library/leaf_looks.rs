//! How leaves look in the files that others open: which way they face, and their colour.

use crate::still::{Still, still, still_before};
use crate::synthetic;
use arborcam::config::{Config, LeafShow, Leaves};
use arborcam::export::ExportError;
use arborcam::export::gltf::{KEY_TOLERANCE_PX, Model, glb};
use arborcam::export::still::{obj_files, ply};
use arborcam::geometry::{Dressed, Foliage, LeafView, Template, TemplateMesh, foliage};
use arborcam::model::{Outline, Rgb, Skeleton};
use arborcam::pipeline::{Seen, dress};
use nalgebra::Vector3;
use serde_json::Value;

/// Triangle corners of leaves, and how many of them have a normal that points against the winding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Corners {
    all: usize,
    against: usize,
}

impl Corners {
    fn add(&mut self, positions: &[[f32; 3]], normals: &[[f32; 3]], corners: [usize; 3]) {
        let [a, b, c] = corners.map(|i| Vector3::from(positions[i].map(f64::from)));
        let face = (b - a).cross(&(c - a));
        for i in corners {
            self.all += 1;
            self.against += usize::from(face.dot(&Vector3::from(normals[i].map(f64::from))) < 0.0);
        }
    }
}

fn leafy(still: &Still) -> Dressed {
    let seen = Seen {
        picture: Some(&still.picture),
        outline: Some(&still.outline),
        ..Seen::default()
    };
    dress(&still.skeleton, seen, &Config::default())
}

fn model<'a>(skeleton: &'a Skeleton, dressed: &'a Dressed) -> Model<'a> {
    Model {
        skeleton,
        dressed,
        poses: &[],
        flutter: &[],
        level: 0,
        metres_per_px: 0.02,
        tolerance_px: KEY_TOLERANCE_PX,
        node_extras: &[],
        provenance: &Value::Null,
    }
}

fn in_glb(bytes: &[u8]) -> Corners {
    let file = gltf::Gltf::from_slice(bytes).expect("glTF");
    let bin = file.blob.clone().unwrap_or_default();
    let mut corners = Corners::default();
    for node in file.nodes() {
        let (Some(mesh), Some("leaf")) = (node.mesh(), material_of(&node)) else {
            continue;
        };
        let primitive = mesh.primitives().next().expect("a primitive");
        let reader = primitive.reader(|_| Some(&bin));
        let positions: Vec<[f32; 3]> = reader.read_positions().expect("places").collect();
        let normals: Vec<[f32; 3]> = reader.read_normals().expect("normals").collect();
        let indices = reader.read_indices().expect("indices").into_u32();
        let indices: Vec<usize> = indices.map(|i| i as usize).collect();
        for t in indices.chunks_exact(3) {
            corners.add(&positions, &normals, [t[0], t[1], t[2]]);
        }
    }
    corners
}

fn material_of<'a>(node: &gltf::Node<'a>) -> Option<&'a str> {
    node.mesh()?.primitives().next()?.material().name()
}

fn in_obj(text: &str) -> Corners {
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    let (mut corners, mut leaf) = (Corners::default(), false);
    for line in text.lines() {
        let (kind, rest) = line.split_once(' ').unwrap_or((line, ""));
        let words: Vec<&str> = rest.split(' ').collect();
        match kind {
            "v" => positions.push([0, 1, 2].map(|k| words[k].parse().expect("a number"))),
            "vn" => normals.push([0, 1, 2].map(|k| words[k].parse().expect("a number"))),
            "usemtl" => leaf = rest == "leaf",
            "f" if leaf => {
                let at = [0, 1, 2].map(|k| words[k].split('/').next().expect("an index"));
                let at = at.map(|i| i.parse::<usize>().expect("an index") - 1);
                corners.add(&positions, &normals, at);
            }
            _ => {}
        }
    }
    corners
}

/// The leaves of a PLY come after its wood, which has `wood` triangles.
fn in_ply(bytes: &[u8], wood: usize) -> Corners {
    const END: &[u8] = b"end_header\n";
    let head = bytes.windows(END.len()).position(|w| w == END);
    let head = head.expect("a head") + END.len();
    let text = String::from_utf8_lossy(&bytes[..head]).into_owned();
    let vertices = text.lines().find_map(|l| l.strip_prefix("element vertex "));
    let vertices: usize = vertices.expect("vertices").parse().expect("a number");
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for row in bytes[head..head + 27 * vertices].chunks_exact(27) {
        let at = |k: usize| f32::from_le_bytes(row[4 * k..4 * k + 4].try_into().expect("4 bytes"));
        positions.push([at(0), at(1), at(2)]);
        normals.push([at(3), at(4), at(5)]);
    }
    let mut corners = Corners::default();
    for row in bytes[head + 27 * vertices..].chunks_exact(13).skip(wood) {
        let at = |k: usize| {
            u32::from_le_bytes(row[4 * k + 1..4 * k + 5].try_into().expect("4 bytes")) as usize
        };
        corners.add(&positions, &normals, [at(0), at(1), at(2)]);
    }
    corners
}

/// Whoever obeys the file turns the normal round where a leaf's back is seen: one against the
/// winding is lit from the wrong side.
#[test]
fn the_normals_of_leaves_agree_with_their_winding_in_every_file() {
    let still = still(true);
    let dressed = leafy(&still);
    let triangles = |mesh: &arborcam::geometry::Mesh| mesh.indices.len() / 3;
    let leaves: usize = dressed
        .foliage
        .groups
        .iter()
        .map(|g| triangles(&g.mesh))
        .sum();
    let (bytes, _) = glb(&model(&still.skeleton, &dressed)).expect("GLB");
    let objects = obj_files(&dressed, "tree", 0.0, &[]).expect("OBJ");
    let (_, obj) = objects.last().expect("files");
    let obj = String::from_utf8_lossy(obj);
    let ply = ply(&dressed, 0.02, &[]).expect("PLY");
    let found = [
        in_glb(&bytes),
        in_obj(&obj),
        in_ply(&ply, triangles(&dressed.wood[0])),
    ];
    println!("{found:?}");
    let wanted = Corners {
        all: 3 * leaves,
        against: 0,
    };
    assert!(leaves > 10_000);
    assert_eq!(found, [wanted; 3]);
}

/// The crown is still lit as one body: its normals point away from its middle.
#[test]
fn leaves_are_lit_as_a_crown() {
    let still = still(true);
    let leaves = still.leaves(&Leaves::default());
    let places = leaves.groups.iter().flat_map(|g| &g.mesh.positions);
    let places: Vec<Vector3<f32>> = places.map(|p| Vector3::from(*p)).collect();
    let middle = places.iter().sum::<Vector3<f32>>() / places.len() as f32;
    let normals = leaves.groups.iter().flat_map(|g| &g.mesh.normals);
    let mut outward = 0.0;
    for (at, normal) in places.iter().zip(normals) {
        outward += f64::from((at - middle).normalize().dot(&Vector3::from(*normal)));
    }
    let mean = outward / places.len() as f64;
    assert!(mean > 0.8, "{mean}");
}

/// A leaf of the user's own may be wound either way, be a sheet with two faces on the same corners,
/// or a body.
#[test]
fn leaves_of_any_make_face_as_they_are_wound() {
    let square = [
        [-0.5, 0.0, 0.0],
        [0.5, 0.0, 0.0],
        [0.5, 1.0, 0.0],
        [-0.5, 1.0, 0.2],
    ];
    let sheet = TemplateMesh {
        positions: square.to_vec(),
        indices: vec![0, 1, 2, 0, 2, 3],
        ..TemplateMesh::default()
    };
    let against = TemplateMesh {
        normals: vec![[0.0, 0.0, -1.0]; 4],
        ..sheet.clone()
    };
    let two_faced = TemplateMesh {
        indices: vec![0, 1, 2, 0, 2, 3, 0, 2, 1, 0, 3, 2],
        ..against.clone()
    };
    let body = TemplateMesh {
        positions: vec![
            [0.0, 0.0, 0.0],
            [0.6, 0.5, 0.0],
            [-0.3, 0.5, 0.5],
            [-0.3, 0.5, -0.5],
            [0.0, 1.0, 0.0],
        ],
        indices: vec![0, 1, 2, 0, 2, 3, 0, 3, 1, 4, 2, 1, 4, 3, 2, 4, 1, 3],
        ..TemplateMesh::default()
    };
    let still = still(true);
    for (name, mesh) in [
        ("sheet", sheet),
        ("against", against),
        ("two-faced", two_faced),
        ("body", body),
    ] {
        let faces = mesh.indices.len() / 3;
        let template = Template::new(mesh).expect(name);
        assert_eq!(template.triangles(), faces, "{name}");
        let leaves = leaves_of(&still, &template);
        let (mut found, mut counted) = (Corners::default(), 0);
        for group in &leaves.groups {
            let mesh = &group.mesh;
            counted += mesh.corners_against_winding();
            for t in mesh.indices.chunks_exact(3) {
                let t = [t[0], t[1], t[2]].map(|i| i as usize);
                found.add(&mesh.positions, &mesh.normals, t);
            }
        }
        assert!(found.all > 1000, "{name}: {found:?}");
        assert_eq!((found.against, counted), (0, 0), "{name}: {found:?}");
    }
}

fn leaves_of(still: &Still, template: &Template) -> Foliage {
    let seeds = still.seeds(&Leaves::default());
    let view: LeafView = still.view(&seeds);
    let limbs = synthetic::limbs_of(&still.skeleton, &synthetic::bare());
    foliage(
        &limbs,
        &still.skeleton,
        &view,
        template,
        &Leaves::default(),
        0,
    )
}

/// A model whose leaves would be lit from the wrong side is not written.
#[test]
fn leaves_that_face_the_wrong_way_are_refused() {
    let still = still(true);
    let mut dressed = leafy(&still);
    dressed.foliage.groups[1].mesh.indices.swap(1, 2);
    let refused = glb(&model(&still.skeleton, &dressed)).expect_err("no file");
    assert!(matches!(refused, ExportError::Unfit { .. }));
    let line = refused.to_string();
    assert!(
        line.contains("3 corners in group 1 of its leaves"),
        "{line}"
    );
}

/// A picture as a camera sends it: every pixel has some of those around it, and four by four have
/// one hue (twice what 4:2:0 does, to tell more).
fn filmed(picture: &mut Rgb) {
    let (width, height) = (picture.size.width as usize, picture.size.height as usize);
    let sharp = picture.pixels.clone();
    let at = |u: usize, v: usize, k: usize| f64::from(sharp[3 * (v * width + u) + k]);
    let light = |u: usize, v: usize| (0..3).map(|k| at(u, v, k)).sum::<f64>() / 3.0;
    for v in 0..height {
        for u in 0..width {
            let (mut around, mut n) = (0.0, 0.0);
            for y in v.saturating_sub(1)..(v + 2).min(height) {
                for x in u.saturating_sub(1)..(u + 2).min(width) {
                    around += light(x, y);
                    n += 1.0;
                }
            }
            for k in 0..3 {
                let mut hue = 0.0;
                for place in 0..16 {
                    let (x, y) = (u / 4 * 4 + place % 4, v / 4 * 4 + place / 4);
                    hue += (at(x, y, k) - light(x, y)) / 16.0;
                }
                let value = (around / n + hue).round().clamp(0.0, 255.0);
                picture.pixels[3 * (v * width + u) + k] = value as u8;
            }
        }
    }
}

/// What is behind the leaves, at a pixel (sRGB).
type Backdrop = fn(usize, usize) -> [i32; 3];

fn sky(_: usize, _: usize) -> [i32; 3] {
    [90, 140, 220]
}

fn dusk(_: usize, _: usize) -> [i32; 3] {
    [14, 22, 52]
}

fn slate(_: usize, _: usize) -> [i32; 3] {
    [44, 54, 62]
}

/// Behind the crown alone, found nowhere beside it.
fn blue_wall(u: usize, v: usize) -> [i32; 3] {
    if (230..410).contains(&u) && v < 330 {
        [18, 30, 70]
    } else {
        [190, 205, 226]
    }
}

/// Leaves that stand before something blue are green, in a sharp picture and in a film's.
#[test]
fn before_blue_leaves_are_green() {
    let backdrops: [(&str, Backdrop); 4] = [
        ("sky", sky),
        ("dusk", dusk),
        ("slate", slate),
        ("blue wall", blue_wall),
    ];
    for (name, backdrop) in backdrops {
        for is_film in [false, true] {
            let mut still = still_before(true, backdrop);
            if is_film {
                filmed(&mut still.picture);
            }
            let leaves = still.leaves(&Leaves::default());
            let colours = leaves.groups.iter().flat_map(|g| g.colours.clone());
            let colours: Vec<[u8; 3]> = colours.collect();
            let (mut blue, mut mixed) = (0, 0);
            for [_, g, b] in &colours {
                blue += usize::from(b >= g);
                // In the picture leaves have 0.36 times as much blue as green.
                mixed += usize::from(f64::from(*b) > 0.7 * f64::from(*g));
            }
            let share = mixed as f64 / colours.len() as f64;
            println!("{name}, film {is_film}: {blue} blue, {share:.4} mixed");
            assert!(!colours.is_empty() && blue == 0, "{name}: {blue} are blue");
            assert!(share < 0.01, "{name}: {share}");
        }
    }
}

/// How bright some colours are.
#[derive(Debug, Default)]
struct Brightness {
    levels: Vec<f64>,
}

impl Brightness {
    fn mean(&self) -> f64 {
        self.levels.iter().sum::<f64>() / self.levels.len() as f64
    }

    fn deviation(&self) -> f64 {
        let squares = self.levels.iter().map(|l| (l - self.mean()).powi(2));
        (squares.sum::<f64>() / self.levels.len() as f64).sqrt()
    }
}

/// Where a tree that is cut to a shape goes beyond the filmed crown its leaves are as bright and as
/// various as within, and the crown's dark side is not seen in it.
#[test]
fn a_tree_that_is_cut_has_the_same_light_all_over() {
    let mut still = still(true);
    let size = still.picture.size;
    let (width, middle) = (size.width as usize, size.height as usize / 2);
    for row in still.picture.pixels[3 * width * middle..].chunks_exact_mut(3) {
        let [r, g, b] = [row[0], row[1], row[2]];
        if g > r && g > b {
            row.iter_mut().for_each(|c| *c /= 2);
        }
    }
    let all = Outline {
        mask: vec![255; size.area()],
        ..still.outline.clone()
    };
    let seen = Seen {
        picture: Some(&still.picture),
        outline: Some(&still.outline),
        cut_to: Some(&all),
        ..Seen::default()
    };
    let dressed = dress(&still.skeleton, seen, &Config::default());
    let [mut within, mut beyond, mut below] = [(); 3].map(|()| Brightness::default());
    for group in &dressed.foliage.groups {
        for (place, colour) in group.mesh.positions.iter().zip(&group.colours) {
            let place = nalgebra::Point3::from(place.map(f64::from));
            let at = still.skeleton.image_from_model(&place);
            let level = colour.map(f64::from).iter().sum::<f64>() / 3.0;
            let of = match still.outline.contains(at.x, at.y) {
                false => &mut beyond,
                true if at.y > middle as f64 => &mut below,
                true => &mut within,
            };
            of.levels.push(level);
        }
    }
    for other in [&beyond, &below] {
        let off = (other.mean() - within.mean()).abs();
        assert!(other.levels.len() > 1000 && within.levels.len() > 1000);
        assert!(off < 4.0, "{} and {}", other.mean(), within.mean());
        let share = other.deviation() / within.deviation();
        assert!((0.8..1.25).contains(&share), "{share}");
    }
}

/// A film of a bare tree shows no colours of leaves: those on request are green before any sky.
#[test]
fn leaves_of_a_tree_that_was_filmed_bare_have_no_colour_of_the_sky() {
    let still = still(false);
    let mut config = Config::default();
    config.leaves.show = LeafShow::On;
    let seen = Seen {
        picture: Some(&still.picture),
        outline: Some(&still.outline),
        ..Seen::default()
    };
    let leaves = dress(&still.skeleton, seen, &config).foliage;
    let colours = leaves.groups.iter().flat_map(|g| g.colours.clone());
    let colours: Vec<[u8; 3]> = colours.collect();
    assert!(!colours.is_empty());
    assert!(colours.iter().all(|[r, g, b]| g > r && r > b));
}
