//! A forest as GLB files: trees that share the meshes of a few templates.
//!
//! - `forest.glb` has a plain node for every tree and needs no extension; `forest_lod1.glb` and
//!   `forest_lod2.glb` are the same with coarser meshes.
//! - `forest_instanced.glb` draws the trees of a template at once (`EXT_mesh_gpu_instancing`) and
//!   holds all levels of detail (`MSFT_lod`). The first is required: a viewer that ignored it would
//!   show each template once, at the origin.
//! - `forest_moving.glb` has plain nodes again, and a motion. A skin would need joints of its own for
//!   every tree; so the motion is a sum of displacements of the shared meshes ([`MotionModes`]), of
//!   which every tree has its own weights. Instanced meshes are not displaced: three.js, for one,
//!   fails to draw those of such a file.

use super::ExportError;
use super::forest_meshes::{LEVELS, Materials, ground_mesh, template_mesh};
use super::gltf::{NamedBytes, asset, binary};
use super::gltf_buffer::{BufferBuilder, Layout, accessor, le_f32};
use super::gltf_check::check;
use super::gltf_model::{Model, raw};
use super::motion_modes::MotionModes;
use crate::geometry::Dressed;
use crate::model::{Forest, ForestTree};
use gltf_json::accessor::{Accessor, Type};
use gltf_json::animation::{Animation, Channel, Interpolation, Property, Sampler, Target};
use gltf_json::scene::UnitQuaternion;
use gltf_json::validation::Checked::Valid;
use gltf_json::{Index, Node, Root, Scene, extensions};
use serde_json::{Map, Value, json};

/// Triangles that are drawn of a moving forest, at most, unless the coarsest level has more: phones
/// draw them with all displacements, and the file stays small (10 trees in leaf in the finest level
/// take 100 MB).
const MOST_MOVING_TRIANGLES: usize = 250_000;
/// Displacements that a motion is made of, at most. Of the mean square of the motion of grown trees
/// 16 hold 0.90 to 0.97, eight 0.79 to 0.89; each takes 12 bytes a vertex.
const MODES: usize = 16;
const INSTANCING: &str = "EXT_mesh_gpu_instancing";
const LEVELS_OF_DETAIL: &str = "MSFT_lod";

/// Everything that goes into the files.
#[derive(Clone, Copy)]
pub struct ForestModel<'a> {
    pub forest: &'a Forest,
    /// By their number in the forest; at least as many as that names. Their own scale is not used.
    pub templates: &'a [ForestTemplate<'a>],
    /// The `extras` of the asset.
    pub provenance: &'a Value,
}

/// A tree that many of the forest are copies of.
#[derive(Clone, Copy)]
pub struct ForestTemplate<'a> {
    pub name: &'a str,
    pub model: Model<'a>,
}

impl ForestTemplate<'_> {
    fn is_moving(&self) -> bool {
        !self.model.poses.is_empty()
    }
}

/// All files of a forest; that in motion where a template moves.
///
/// # Errors
/// A template is none for a file (see [`glb`](super::gltf::glb)), or a tree is of none of them.
pub fn forest_files(model: &ForestModel) -> Result<Vec<NamedBytes>, ExportError> {
    let mut files = Vec::with_capacity(LEVELS.len() + 1);
    for level in 0..LEVELS.len() {
        let name = match level {
            0 => "forest.glb".to_owned(),
            _ => format!("forest_lod{level}.glb"),
        };
        files.push((name, forest_glb(model, level)?));
    }
    files.push(("forest_instanced.glb".to_owned(), instanced_glb(model)?));
    if model.templates.iter().any(ForestTemplate::is_moving) {
        files.push(("forest_moving.glb".to_owned(), moving_glb(model)?));
    }
    Ok(files)
}

/// The forest at rest with a plain node for every tree, in a level of detail, 0 the finest; beyond
/// the last one the last.
///
/// # Errors
/// As of [`forest_files`].
pub fn forest_glb(model: &ForestModel, level: usize) -> Result<Vec<u8>, ExportError> {
    let level = level.min(LEVELS.len() - 1);
    let mut file = ForestFile::begin(model)?;
    let mut meshes = Vec::with_capacity(model.templates.len());
    for template in model.templates {
        let mesh = file.template(template, level, None)?;
        meshes.push(mesh.map(|mesh| file.root.push(mesh)));
    }
    let mut nodes = vec![file.ground()?];
    for (k, tree) in model.forest.trees.iter().enumerate() {
        let template = model.templates[tree.template].name;
        nodes.push(file.tree(tree, k, template, meshes[tree.template])?);
    }
    file.finish(nodes)
}

/// The forest at rest with the trees of a template drawn at once, in all levels of detail.
///
/// # Errors
/// As of [`forest_files`].
pub fn instanced_glb(model: &ForestModel) -> Result<Vec<u8>, ExportError> {
    let mut file = ForestFile::begin(model)?;
    let mut nodes = vec![file.ground()?];
    for (number, template) in model.templates.iter().enumerate() {
        let mut meshes = Vec::with_capacity(LEVELS.len());
        for level in 0..LEVELS.len() {
            meshes.extend(file.template(template, level, None)?);
        }
        let all = model.forest.trees.iter();
        let trees: Vec<&ForestTree> = all.filter(|tree| tree.template == number).collect();
        if !trees.is_empty() {
            let levels = file.instances(template.name, &trees, meshes);
            nodes.extend(levels.first());
        }
    }
    let used = [INSTANCING, LEVELS_OF_DETAIL];
    file.root.extensions_used = used.map(str::to_owned).into();
    file.root.extensions_required = vec![INSTANCING.to_owned()];
    file.finish(nodes)
}

/// The forest in motion with a plain node for every tree, in the finest level of detail of which not
/// too much is drawn.
///
/// # Errors
/// As of [`forest_files`].
pub fn moving_glb(model: &ForestModel) -> Result<Vec<u8>, ExportError> {
    let mut file = ForestFile::begin(model)?;
    let level = moving_level(model);
    let mut moving = Vec::with_capacity(model.templates.len());
    for template in model.templates {
        let Model {
            skeleton, poses, ..
        } = template.model;
        let motion = MotionModes::of(skeleton, poses, MODES);
        moving.push(MovingTemplate {
            mesh: file.template(template, level, Some(&motion))?,
            samplers: file.samplers(&motion),
        });
    }
    let mut nodes = vec![file.ground()?];
    for (k, tree) in model.forest.trees.iter().enumerate() {
        let of = &moving[tree.template];
        // Of its own name with the same numbers: three.js finds what an animation moves by that.
        let mesh = of.mesh.clone().map(|mesh| {
            file.root.push(gltf_json::Mesh {
                name: Some(format!("{}_mesh", tree_name(k))),
                ..mesh
            })
        });
        let template = model.templates[tree.template].name;
        let node = file.tree(tree, k, template, mesh)?;
        if let (Some(_), Some(sampler)) = (mesh, of.samplers.get(usize::from(tree.ahead))) {
            file.animation
                .channels
                .push(weights_channel(*sampler, node));
        }
        nodes.push(node);
    }
    file.finish(nodes)
}

/// A template of a moving forest.
struct MovingTemplate {
    mesh: Option<gltf_json::Mesh>,
    /// The weights over time, by how far they are ahead; none where it stands still.
    samplers: Vec<Index<Sampler>>,
}

/// The finest level in which all trees together have no more than so many triangles.
fn moving_level(model: &ForestModel) -> usize {
    let of_templates: Vec<usize> = model
        .templates
        .iter()
        .map(|template| triangles(template.model.dressed))
        .collect();
    let trees = model.forest.trees.iter();
    let all: usize = trees.map(|tree| of_templates[tree.template]).sum();
    let fits = |share: &f64| all as f64 * share <= MOST_MOVING_TRIANGLES as f64;
    LEVELS.iter().position(fits).unwrap_or(LEVELS.len() - 1)
}

/// Triangles of a tree in the finest level.
fn triangles(dressed: &Dressed) -> usize {
    let wood = dressed.wood.first().into_iter();
    let leaves = dressed.foliage.groups.iter().map(|group| &group.mesh);
    wood.chain(leaves).map(|mesh| mesh.indices.len() / 3).sum()
}

/// A file while it is put together.
struct ForestFile<'a> {
    root: Root,
    buffer: BufferBuilder,
    materials: Materials,
    forest: &'a Forest,
    animation: Animation,
}

impl<'a> ForestFile<'a> {
    fn begin(model: &ForestModel<'a>) -> Result<Self, ExportError> {
        let Some(first) = model.templates.first() else {
            return Err(ExportError::unfit("a forest has at least one template"));
        };
        let mut trees = model.forest.trees.iter();
        if trees.any(|tree| tree.template >= model.templates.len()) {
            return Err(ExportError::unfit(
                "a tree is of a template that is not there",
            ));
        }
        for template in model.templates {
            check(&template.model)?;
        }
        let mut root = Root {
            asset: asset(model.provenance)?,
            ..Root::default()
        };
        let mut buffer = BufferBuilder::default();
        let mut foliage = model.templates.iter().map(|t| &t.model.dressed.foliage);
        let in_leaf = foliage.any(|f| f.groups.iter().any(|g| !g.mesh.indices.is_empty()));
        let materials = Materials::push(&mut root, &mut buffer, first.model.dressed, in_leaf)?;
        Ok(Self {
            root,
            buffer,
            materials,
            forest: model.forest,
            animation: Animation {
                extensions: None,
                extras: None,
                channels: Vec::new(),
                name: Some("sway".to_owned()),
                samplers: Vec::new(),
            },
        })
    }

    fn template(
        &mut self,
        template: &ForestTemplate,
        level: usize,
        motion: Option<&MotionModes>,
    ) -> Result<Option<gltf_json::Mesh>, ExportError> {
        let model = Model {
            metres_per_px: self.forest.metres_per_px,
            ..template.model
        };
        let (root, buffer) = (&mut self.root, &mut self.buffer);
        let (name, materials) = (template.name, &self.materials);
        template_mesh(root, buffer, &model, level, name, materials, motion)
    }

    fn ground(&mut self) -> Result<Index<Node>, ExportError> {
        let (root, buffer) = (&mut self.root, &mut self.buffer);
        let mesh = ground_mesh(root, buffer, &self.forest.ground, &self.materials)?;
        let mesh = self.root.push(mesh);
        Ok(self.root.push(Node {
            mesh: Some(mesh),
            name: Some("ground".to_owned()),
            ..Node::default()
        }))
    }

    /// Adds the node of a tree, of which `k` come before.
    fn tree(
        &mut self,
        tree: &ForestTree,
        k: usize,
        template: &str,
        mesh: Option<Index<gltf_json::Mesh>>,
    ) -> Result<Index<Node>, ExportError> {
        Ok(self.root.push(Node {
            mesh,
            name: Some(tree_name(k)),
            translation: Some(place(tree)),
            rotation: Some(UnitQuaternion(turn(tree))),
            scale: Some(size(tree)),
            extras: raw(&json!({ "template": template }))?,
            ..Node::default()
        }))
    }

    /// Adds a node for every one of `meshes`, levels of detail of one template, that shows it at
    /// the places of all `trees`. The first names the others as its coarser levels.
    fn instances(
        &mut self,
        name: &str,
        trees: &[&ForestTree],
        meshes: Vec<gltf_json::Mesh>,
    ) -> Vec<Index<Node>> {
        let places: Vec<[f32; 3]> = trees.iter().map(|tree| place(tree)).collect();
        let turns: Vec<[f32; 4]> = trees.iter().map(|tree| turn(tree)).collect();
        let sizes: Vec<[f32; 3]> = trees.iter().map(|tree| size(tree)).collect();
        let attributes = json!({ "attributes": {
            "TRANSLATION": self.rows(Type::Vec3, &places).value(),
            "ROTATION": self.rows(Type::Vec4, &turns).value(),
            "SCALE": self.rows(Type::Vec3, &sizes).value(),
        }});
        let mut levels = Vec::with_capacity(meshes.len());
        for (level, mesh) in meshes.into_iter().enumerate() {
            let mut others = Map::new();
            others.insert(INSTANCING.to_owned(), attributes.clone());
            let mesh = self.root.push(mesh);
            levels.push(self.root.push(Node {
                mesh: Some(mesh),
                name: Some(format!("{name}_lod{level}")),
                extensions: Some(extensions::scene::Node { others }),
                ..Node::default()
            }));
        }
        let coarser: Vec<usize> = levels.iter().skip(1).map(Index::value).collect();
        let finest = levels
            .first()
            .map(|node| &mut self.root.nodes[node.value()]);
        if let Some(extensions) = finest.and_then(|node| node.extensions.as_mut()) {
            let levels = json!({ "ids": coarser });
            extensions
                .others
                .insert(LEVELS_OF_DETAIL.to_owned(), levels);
        }
        levels
    }

    /// Adds rows of numbers.
    fn rows<const N: usize>(&mut self, shape: Type, rows: &[[f32; N]]) -> Index<Accessor> {
        let layout = Layout::f32(shape);
        let (root, data) = (&mut self.root, le_f32(rows));
        self.buffer.accessor(root, layout, rows.len(), data, None)
    }

    /// Adds the weights over time for every step that a tree may be ahead; none where nothing moves.
    fn samplers(&mut self, motion: &MotionModes) -> Vec<Index<Sampler>> {
        let Some(input) = self.times(motion) else {
            return Vec::new();
        };
        let mut samplers = Vec::new();
        for ahead in 0..Forest::STEPS_AHEAD {
            let output = self.weights(motion, ahead);
            samplers.push(Index::new(self.animation.samplers.len() as u32));
            self.animation.samplers.push(Sampler {
                extensions: None,
                extras: None,
                input,
                interpolation: Valid(Interpolation::Linear),
                output,
            });
        }
        samplers
    }

    /// Adds the times of the keys; `None` where nothing moves.
    fn times(&mut self, motion: &MotionModes) -> Option<Index<Accessor>> {
        let (first, last) = (motion.times_s.first()?, motion.times_s.last()?);
        if motion.modes.is_empty() {
            return None;
        }
        let data = motion.times_s.iter().flat_map(|t| t.to_le_bytes());
        let view = self.buffer.view(&mut self.root, data, None);
        let mut times = accessor(view, 0, Layout::f32(Type::Scalar), motion.times_s.len());
        (times.min, times.max) = (Some(json!([first])), Some(json!([last])));
        Some(self.root.push(times))
    }

    /// Adds the weights of all modes, key by key, of a tree that is so many steps ahead in its loop.
    fn weights(&mut self, motion: &MotionModes, ahead: u8) -> Index<Accessor> {
        let keys = motion.times_s.len();
        // The last key is the first again.
        let lap = keys.saturating_sub(1).max(1);
        let from = lap * usize::from(ahead) / usize::from(Forest::STEPS_AHEAD);
        let mut weights = Vec::with_capacity(keys * motion.modes.len());
        for key in 0..keys {
            let shown = (key + from) % lap;
            weights.extend(motion.modes.iter().map(|mode| [mode.weights[shown]]));
        }
        self.rows(Type::Scalar, &weights)
    }

    fn finish(mut self, nodes: Vec<Index<Node>>) -> Result<Vec<u8>, ExportError> {
        self.root.push(Scene {
            extensions: None,
            extras: None,
            name: Some("forest".to_owned()),
            nodes,
        });
        self.root.scene = Some(Index::new(0));
        if !self.animation.channels.is_empty() {
            self.root.push(self.animation);
        }
        binary(self.root, self.buffer)
    }
}

/// Lets the weights of a node's mesh go by a sampler.
fn weights_channel(sampler: Index<Sampler>, node: Index<Node>) -> Channel {
    Channel {
        sampler,
        target: Target {
            extensions: None,
            extras: None,
            node,
            path: Valid(Property::MorphTargetWeights),
        },
        extensions: None,
        extras: None,
    }
}

/// The name of a tree of which `k` come before.
fn tree_name(k: usize) -> String {
    format!("tree_{:04}", k + 1)
}

fn place(tree: &ForestTree) -> [f32; 3] {
    tree.foot.coords.cast::<f32>().into()
}

/// x y z w.
fn turn(tree: &ForestTree) -> [f32; 4] {
    let (sin, cos) = (0.5 * tree.turn_rad).sin_cos();
    [0.0, sin as f32, 0.0, cos as f32]
}

fn size(tree: &ForestTree) -> [f32; 3] {
    [tree.scale as f32; 3]
}
