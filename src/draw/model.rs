//! What is drawn: wood and leaves on a skeleton, at rest and in a pose.

use super::camera::BoundingCylinder;
use super::skin::Joints;
use super::texture::Texture;
use crate::geometry::{Foliage, Mesh};
use crate::model::{LeafSwing, Pose, Skeleton};
use nalgebra::Point3;

/// A tree to be drawn, in any pose.
#[derive(Clone, Debug)]
pub struct Model<'a> {
    pub skeleton: &'a Skeleton,
    pub wood: &'a Mesh,
    /// Colour of the wood (sRGB).
    pub bark_rgb: [u8; 3],
    /// Its bark in place of that, once round a limb and as far along it as it is round.
    pub bark: Option<Texture>,
    /// Colour of each branch instead, by node index; may be empty.
    pub branch_rgb: &'a [[u8; 3]],
    pub foliage: &'a Foliage,
    pub leaf: Option<Texture>,
}

/// Triangles in one pose.
#[derive(Clone, Debug)]
pub(super) struct Part<'a> {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub colours: Vec<[u8; 3]>,
    pub uvs: &'a [[f32; 2]],
    pub indices: &'a [u32],
    pub texture: Option<&'a Texture>,
    /// A leaf has no inside: whichever face is seen is lit.
    pub two_sided: bool,
}

/// A tree in one pose.
#[derive(Clone, Debug)]
pub struct Posed<'a> {
    pub(super) parts: Vec<Part<'a>>,
}

/// A tree in its pose where it stands in a larger scene.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    pub posed: &'a Posed<'a>,
    /// Units of the scene.
    pub foot: Point3<f64>,
    /// About its axis, counter-clockwise seen from above, rad.
    pub turn_rad: f64,
    /// Units of the scene in one of the tree.
    pub scale: f64,
}

impl<'a> Placed<'a> {
    /// As it is in its own axes.
    pub fn at_origin(posed: &'a Posed<'a>) -> Self {
        Self {
            posed,
            foot: Point3::origin(),
            turn_rad: 0.0,
            scale: 1.0,
        }
    }
}

impl<'a> Model<'a> {
    /// Wood alone.
    pub fn bare(skeleton: &'a Skeleton, wood: &'a Mesh, bark_rgb: [u8; 3]) -> Self {
        static NONE: Foliage = Foliage {
            groups: Vec::new(),
            texture: None,
            frequency_hz: 0.0,
        };
        Self {
            skeleton,
            wood,
            bark_rgb,
            bark: None,
            branch_rgb: &[],
            foliage: &NONE,
            leaf: None,
        }
    }

    /// The tree in a pose, `None` for its rest. `sway` is how far the leaves of each group swing;
    /// see [`crate::geometry::FoliageGroup`]; it may be shorter than the groups.
    pub fn posed(&self, pose: Option<&Pose>, sway: &[LeafSwing]) -> Posed<'_> {
        let joints = Joints::new(self.skeleton, pose);
        let (positions, normals) = joints.wood(self.wood);
        let bark = self.bark.as_ref();
        let bark = bark.filter(|_| self.branch_rgb.is_empty());
        let colours = match (self.branch_rgb, bark) {
            // The tile has the colour.
            ([], Some(_)) => vec![[255; 3]; positions.len()],
            ([], None) => vec![self.bark_rgb; positions.len()],
            _ => self
                .wood
                .joints
                .iter()
                .map(|j| self.wood_rgb(j[0]))
                .collect(),
        };
        let (uvs, indices) = (self.wood.uvs.as_slice(), self.wood.indices.as_slice());
        let mut parts = vec![Part {
            positions,
            normals,
            colours,
            uvs,
            indices,
            texture: bark.filter(|_| uvs.len() == self.wood.positions.len()),
            two_sided: false,
        }];
        for (i, group) in self.foliage.groups.iter().enumerate() {
            let (positions, normals) =
                joints.leaves(group, sway.get(i).copied().unwrap_or_default());
            let mut colours = group.colours.clone();
            colours.resize(positions.len(), [255; 3]);
            let (uvs, indices) = (group.mesh.uvs.as_slice(), group.mesh.indices.as_slice());
            let texture = self.leaf.as_ref().filter(|_| uvs.len() == positions.len());
            parts.push(Part {
                positions,
                normals,
                colours,
                uvs,
                indices,
                texture,
                two_sided: true,
            });
        }
        Posed { parts }
    }

    /// Colour of wood that moves with a joint.
    fn wood_rgb(&self, joint: u16) -> [u8; 3] {
        let own = self.branch_rgb.get(usize::from(joint)).copied();
        own.unwrap_or(self.bark_rgb)
    }
}

impl<'a> Posed<'a> {
    /// A mesh of one colour (sRGB) that no joints move.
    pub fn of_mesh(mesh: &'a Mesh, rgb: [u8; 3]) -> Self {
        let part = Part {
            positions: mesh.positions.clone(),
            normals: mesh.normals.clone(),
            colours: vec![rgb; mesh.positions.len()],
            uvs: &mesh.uvs,
            indices: &mesh.indices,
            texture: None,
            two_sided: false,
        };
        Self { parts: vec![part] }
    }

    /// What all of it lies in; `None` for nothing.
    pub fn bounds(&self) -> Option<BoundingCylinder> {
        let points = self.parts.iter().flat_map(|p| &p.positions);
        BoundingCylinder::of(
            points.map(|[x, y, z]| Point3::new(f64::from(*x), f64::from(*y), f64::from(*z))),
        )
    }
}
