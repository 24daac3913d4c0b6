//! The skeleton of a glTF model and its motion.
//!
//! Joints are places about which branches turn: a branch runs from its joint to those that hang on
//! it. One that carries none ends where the vertices of the mesh that it moves are farthest from it.
//! A file without a skin has its nodes for joints.

use super::error::ImportError;
use super::gltf_file::{GltfFile, bad};
use super::gltf_motion::{Channel, channels};
use super::model_tree::{Edges, MOST_PLACES, ModelTree};
use super::sketch::refuse_more;
use gltf::{Primitive, Semantic};
use nalgebra::{Matrix4, Point3};
use std::path::Path;

/// The longest motion that is read, s, and its rate, Hz.
const LONGEST_S: f64 = 60.0;
const RATE_HZ: f64 = 30.0;
/// Places whose motion is read: a minute of it is held in memory.
const MOST_MOVING: usize = 8192;

/// A modelled tree and its motion.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingModel {
    pub tree: ModelTree,
    /// Where the nodes of the tree are at even times, in its order; none of a model that stands
    /// still.
    pub poses: Vec<Vec<Point3<f64>>>,
    /// Between two of them, s.
    pub step_s: f64,
}

/// Reads the skeleton in the `bytes` of a glTF file that lies at `path`.
///
/// # Errors
/// It is no glTF or damaged; it holds no skeleton; its skeleton is no tree.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<MovingModel, ImportError> {
    let file = GltfFile::open(bytes, path)?;
    let rig = Rig::of(&file)?;
    let tips = rig.tips(&file)?;
    let places = rig.places(&tips, &rig.globals(&[], 0.0));
    let mut edges = rig.edges(&tips);
    edges.places = places;
    let mut tree = ModelTree::of_edges(&edges)?;
    tree.metres_per_unit = metres_per_unit(&file);
    let channels = channels(&file)?;
    let ends = channels.iter().filter_map(|c| c.times_s.last().copied());
    let length_s = ends.fold(0.0, f64::max).min(LONGEST_S);
    let steps = (length_s * RATE_HZ) as usize;
    if steps > 0 {
        refuse_more("joints that move", tree.nodes.len(), MOST_MOVING)?;
    }
    let mut poses = Vec::new();
    for step in 0..=steps {
        if steps == 0 {
            break;
        }
        let globals = rig.globals(&channels, step as f64 / RATE_HZ);
        let places = rig.places(&tips, &globals);
        poses.push(tree.nodes.iter().map(|n| places[n.place]).collect());
    }
    Ok(MovingModel {
        tree,
        poses,
        step_s: 1.0 / RATE_HZ,
    })
}

/// The format is in metres. A file of ours may be in pixels, and says so.
fn metres_per_unit(file: &GltfFile) -> f64 {
    let extras = file.document.as_json().asset.extras.as_ref();
    let extras: Option<serde_json::Value> =
        extras.and_then(|extras| serde_json::from_str(extras.get()).ok());
    match extras.as_ref().and_then(|e| e.get("unit")?.as_str()) {
        Some("px") => 0.0,
        _ => 1.0,
    }
}

/// The nodes of a file, and which of them are joints.
struct Rig {
    /// Of every node, by the order of the file.
    parents: Vec<Option<usize>>,
    /// Nodes of the file, parents before children.
    order: Vec<usize>,
    rest: Vec<gltf::scene::Transform>,
    joints: Vec<usize>,
    /// Of every node its place among the joints.
    joint_of: Vec<Option<usize>>,
    /// The skin that they are of, by its place in the file.
    skin: Option<usize>,
}

/// Where a joint that carries none ends: a vertex in the axes of the joint.
struct Tip {
    joint: usize,
    from_joint: Point3<f64>,
}

impl Rig {
    fn of(file: &GltfFile) -> Result<Self, ImportError> {
        let document = &file.document;
        let count = document.nodes().count();
        refuse_more("nodes", count, MOST_PLACES)?;
        let mut parents: Vec<Option<usize>> = vec![None; count];
        for node in document.nodes() {
            for child in node.children() {
                if parents[child.index()].replace(node.index()).is_some() {
                    return Err(ImportError::Cyclic);
                }
            }
        }
        let order = parents_first(&parents)?;
        // Of several trees the one with most joints.
        let skin = document.skins().max_by_key(|skin| skin.joints().count());
        let joints: Vec<usize> = match &skin {
            Some(skin) => skin.joints().map(|joint| joint.index()).collect(),
            None => largest_tree(&parents, &order),
        };
        let mut joint_of = vec![None; count];
        for (joint, node) in joints.iter().enumerate() {
            joint_of[*node] = Some(joint);
        }
        Ok(Self {
            joint_of,
            rest: document.nodes().map(|node| node.transform()).collect(),
            skin: skin.map(|skin| skin.index()),
            parents,
            order,
            joints,
        })
    }

    /// Where every node of the file stands at a time, s.
    fn globals(&self, channels: &[Channel], time_s: f64) -> Vec<Matrix4<f64>> {
        let mut posed = self.rest.clone();
        for channel in channels {
            channel.apply(&mut posed[channel.node], time_s);
        }
        let mut globals = vec![Matrix4::identity(); posed.len()];
        for node in &self.order {
            let columns = posed[*node].clone().matrix().map(|c| c.map(f64::from));
            let own = Matrix4::from_fn(|r, c| columns[c][r]);
            let below = self.parents[*node].map_or(Matrix4::identity(), |p| globals[p]);
            globals[*node] = below * own;
        }
        globals
    }

    /// The places of the joints, then of the tips.
    fn places(&self, tips: &[Tip], globals: &[Matrix4<f64>]) -> Vec<Point3<f64>> {
        let mut places = Vec::with_capacity(self.joints.len() + tips.len());
        for joint in &self.joints {
            places.push(globals[*joint].transform_point(&Point3::origin()));
        }
        for tip in tips {
            places.push(globals[self.joints[tip.joint]].transform_point(&tip.from_joint));
        }
        places
    }

    /// Which of the places are joined; the foot is the joint that hangs on none. Without the places.
    fn edges(&self, tips: &[Tip]) -> Edges {
        let mut edges = Edges::default();
        for (joint, node) in self.joints.iter().enumerate() {
            match self.carrier(*node) {
                Some(carrier) => edges.edges.push([carrier, joint]),
                None => edges.foot = edges.foot.or(Some(joint)),
            }
        }
        for (number, tip) in tips.iter().enumerate() {
            edges.edges.push([tip.joint, self.joints.len() + number]);
        }
        edges
    }

    /// The nearest joint below a node, by its place among the joints.
    fn carrier(&self, node: usize) -> Option<usize> {
        let mut below = self.parents[node];
        while let Some(node) = below {
            if self.joint_of[node].is_some() {
                return self.joint_of[node];
            }
            below = self.parents[node];
        }
        None
    }

    /// The ends of the joints that carry none: of the vertices that each moves most the one that is
    /// farthest from it.
    fn tips(&self, file: &GltfFile) -> Result<Vec<Tip>, ImportError> {
        let Some(skin) = self.skin.and_then(|skin| file.document.skins().nth(skin)) else {
            return Ok(Vec::new());
        };
        let to_joints = self.to_joints(file, &skin)?;
        let mut farthest: Vec<Option<Point3<f64>>> = vec![None; self.joints.len()];
        for node in file.document.nodes() {
            if node.skin().map(|s| s.index()) != self.skin {
                continue;
            }
            for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                look_at(file, &primitive, &to_joints, &mut farthest)?;
            }
        }
        let mut carries = vec![false; self.joints.len()];
        for node in &self.joints {
            if let Some(carrier) = self.carrier(*node) {
                carries[carrier] = true;
            }
        }
        let mut tips = Vec::new();
        for (joint, from_joint) in farthest.into_iter().enumerate() {
            if let Some(from_joint) = from_joint.filter(|_| !carries[joint]) {
                tips.push(Tip { joint, from_joint });
            }
        }
        Ok(tips)
    }

    /// From the mesh to the axes of each joint.
    fn to_joints(
        &self,
        file: &GltfFile,
        skin: &gltf::Skin,
    ) -> Result<Vec<Matrix4<f64>>, ImportError> {
        let Some(table) = skin.inverse_bind_matrices() else {
            return Ok(vec![Matrix4::identity(); self.joints.len()]);
        };
        let columns = file.floats::<16>(&table)?;
        if columns.len() < self.joints.len() {
            return Err(bad("its skin has fewer matrices than joints"));
        }
        let matrices = columns.iter().map(|c| Matrix4::from_column_slice(c));
        Ok(matrices.collect())
    }
}

/// Takes the vertices of a primitive into account, each for the joint that moves it most.
fn look_at(
    file: &GltfFile,
    primitive: &Primitive,
    to_joints: &[Matrix4<f64>],
    farthest: &mut [Option<Point3<f64>>],
) -> Result<(), ImportError> {
    let tables = [
        Semantic::Positions,
        Semantic::Joints(0),
        Semantic::Weights(0),
    ]
    .map(|semantic| primitive.get(&semantic));
    let [Some(places), Some(joints), Some(weights)] = tables else {
        return Ok(());
    };
    refuse_more("vertices", places.count(), MOST_PLACES)?;
    let places = file.floats::<3>(&places)?;
    let (joints, weights) = (file.floats::<4>(&joints)?, file.floats::<4>(&weights)?);
    for ((place, joints), weights) in places.into_iter().zip(joints).zip(weights) {
        let most = (0..4).max_by(|a, b| weights[*a].total_cmp(&weights[*b]));
        let joint = most.map_or(0, |k| joints[k] as usize);
        let (Some(known), Some(to_joint)) = (farthest.get_mut(joint), to_joints.get(joint)) else {
            return Err(bad("a vertex is moved by a joint that is not in its skin"));
        };
        let at = to_joint.transform_point(&Point3::from(place));
        if known.is_none_or(|known| at.coords.norm() > known.coords.norm()) {
            *known = Some(at);
        }
    }
    Ok(())
}

/// All nodes, parents before children.
///
/// # Errors
/// Some carry each other.
fn parents_first(parents: &[Option<usize>]) -> Result<Vec<usize>, ImportError> {
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); parents.len()];
    let mut order: Vec<usize> = Vec::with_capacity(parents.len());
    for (node, parent) in parents.iter().enumerate() {
        match parent {
            Some(parent) => children[*parent].push(node),
            None => order.push(node),
        }
    }
    let mut next = 0;
    while let Some(node) = order.get(next).copied() {
        order.extend(&children[node]);
        next += 1;
    }
    if order.len() < parents.len() {
        return Err(ImportError::Cyclic);
    }
    Ok(order)
}

/// Of the nodes that hang on none the one that carries most, with all that it carries.
fn largest_tree(parents: &[Option<usize>], order: &[usize]) -> Vec<usize> {
    let mut roots = vec![0; parents.len()];
    let mut sizes = vec![0_usize; parents.len()];
    for node in order {
        roots[*node] = parents[*node].map_or(*node, |p| roots[p]);
        sizes[roots[*node]] += 1;
    }
    // The first of equals.
    let largest = (0..parents.len()).rev().max_by_key(|root| sizes[*root]);
    let of_largest = order.iter().copied();
    of_largest
        .filter(|node| Some(roots[*node]) == largest)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trunk of 2 that forks into a limb to either side, whose joints begin at (-1, 3) and (1, 3)
    /// and whose tips only the mesh shows: at (-2, 4, 0) and (1, 3, 2). Within 2 s the fork turns by
    /// 90 degrees, the left limb at the end all at once, and the right one goes up by 1 in a curve.
    fn fork() -> MovingModel {
        let bytes = include_bytes!("../../fuzz/corpus/model/fork.glb");
        read(bytes, Path::new("fork.glb")).expect("a model")
    }

    fn nearest(places: &[Point3<f64>], to: [f64; 3]) -> f64 {
        let off = places.iter().map(|p| (p - Point3::from(to)).norm());
        off.fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn joints_that_carry_none_end_where_their_mesh_does() {
        let model = fork();
        let places: Vec<Point3<f64>> = model.tree.nodes.iter().map(|n| n.position).collect();
        assert_eq!(places.len(), 6);
        for expected in [
            [0.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [-1.0, 3.0, 0.0],
            [1.0, 3.0, 0.0],
            [-2.0, 4.0, 0.0],
            [1.0, 3.0, 2.0],
        ] {
            assert!(
                nearest(&places, expected) < 1e-6,
                "{expected:?}: {places:?}"
            );
        }
        assert_eq!(model.tree.metres_per_unit, 1.0);
    }

    /// The three ways between keys. A turn by 45 degrees about z brings (x, y) to
    /// (x - y, x + y) / sqrt 2.
    #[test]
    fn joints_move_as_the_animation_says() {
        let model = fork();
        assert_eq!(model.poses.len(), 61);
        let (half, h) = (&model.poses[30], 0.5_f64.sqrt());
        for expected in [
            [0.0, 2.0, 0.0],
            [-2.0 * h, 2.0, 0.0],
            // Not turned on its own yet.
            [-4.0 * h, 2.0, 0.0],
            // Half-way up, as the curve is even about its middle.
            [(1.0 - 1.5) * h, 2.0 + 2.5 * h, 0.0],
        ] {
            assert!(nearest(half, expected) < 1e-6, "{expected:?}: {half:?}");
        }
        let last = &model.poses[60];
        // Both turned by 90 degrees: from (-1, 1) to (-1, -1), and on to (1, -1) from there.
        for expected in [[-1.0, 1.0, 0.0], [0.0, 0.0, 0.0], [-2.0, 3.0, 0.0]] {
            assert!(nearest(last, expected) < 1e-6, "{expected:?}: {last:?}");
        }
    }
}
