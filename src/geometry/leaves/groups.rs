//! Clusters to meshes: one for each branch of the first fork, with the two displacements of B.2.

use super::attachment::AttachmentPoint;
use super::cluster::Cluster;
use super::faces::{area_vector, share_along};
use super::palette::any_of;
use super::target::Target;
use super::template::Template;
use super::view::PLAIN;
use crate::geometry::foliage::FoliageGroup;
use crate::model::{NodeId, Skeleton};
use nalgebra::{Point3, Vector3};
use std::f64::consts::TAU;

/// Meshes of leaves in a tree at most.
const MOST_GROUPS: usize = 12;
/// Branches with fewer of the clusters than this go with the nearest other one.
const LEAST_SHARE: f64 = 0.02;
/// Way over which the phase beta of B.2 goes round once, as a share of the tree's height.
const WAVE: f64 = 0.25;
/// A leaf turns about its stalk this many times as far as its cluster about its axis, and so much
/// later, radians.
const LEAF_SWING: f64 = 0.8;
const LEAF_LATER: f64 = 2.4;
/// Share of the outward direction in a normal: leaves are lit as a crown, not as a heap of mirrors.
const OUTWARD: f64 = 0.6;
/// The point that they point away from is below the crown's middle by this share of the tree's
/// height.
const LOW: f64 = 0.1;

/// What the areas of a closed body's faces add up to by rounding, for a template of size 1.
const CLOSED: f64 = 1e-5;

/// The meshes of all clusters.
pub(super) fn groups(
    clusters: &[Cluster],
    attachments: &[AttachmentPoint],
    skeleton: &Skeleton,
    target: Option<&Target>,
    palette: &[[u8; 3]],
    template: &Template,
    height: f64,
) -> Vec<FoliageGroup> {
    let fork_branch = fork_branches(skeleton);
    let of: Vec<usize> = clusters
        .iter()
        .map(|c| fork_branch[attachments[c.attachment].node.index()])
        .collect();
    let stands = kept(&of, skeleton);
    let mut nodes: Vec<usize> = stands.clone();
    nodes.sort_unstable();
    nodes.dedup();
    let mut out: Vec<FoliageGroup> = nodes
        .iter()
        .map(|&n| FoliageGroup {
            node: NodeId(n as u32),
            ..FoliageGroup::default()
        })
        .collect();
    let sum: Vector3<f64> = clusters.iter().map(|c| c.centre.coords).sum();
    // A little low, so that what is lit from above is the most of the crown.
    let middle = Point3::from(sum / clusters.len().max(1) as f64) - Vector3::y() * (LOW * height);
    let drawer = Drawer {
        skeleton,
        target,
        palette,
        template,
        height,
        middle,
    };
    for (cluster, stand) in clusters.iter().zip(&stands) {
        if let Ok(k) = nodes.binary_search(stand) {
            drawer.draw(cluster, &attachments[cluster.attachment], &mut out[k]);
        }
    }
    out
}

/// For every node the branch of the first fork that it is on, or its own below that. Copies fork,
/// too: their leaves are meshes of their own, other than by [`Skeleton::main_branches`].
fn fork_branches(skeleton: &Skeleton) -> Vec<usize> {
    let branches = skeleton.moving_branches();
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); skeleton.nodes.len()];
    for branch in &branches {
        children[branch.parent.index()].push(branch.node.index());
    }
    let mut top = 0;
    while let [only] = children[top][..] {
        top = only;
    }
    let mut of_node: Vec<usize> = (0..skeleton.nodes.len()).collect();
    for branch in &branches {
        let (node, parent) = (branch.node.index(), branch.parent.index());
        if of_node[parent] != parent || children[top].contains(&parent) {
            of_node[node] = of_node[parent];
        }
    }
    for i in 0..of_node.len() {
        of_node[i] = of_node[skeleton.mover(NodeId(i as u32)).index()];
    }
    of_node
}

/// For every cluster the branch whose group it is in: its own, or the nearest that is kept.
fn kept(of: &[usize], skeleton: &Skeleton) -> Vec<usize> {
    let mut counts: Vec<(usize, usize)> = Vec::new();
    for &node in of {
        match counts.iter_mut().find(|(_, n)| *n == node) {
            Some((count, _)) => *count += 1,
            None => counts.push((1, node)),
        }
    }
    counts.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    let least = (LEAST_SHARE * of.len() as f64) as usize;
    let large: Vec<usize> = counts
        .iter()
        .enumerate()
        .filter(|(k, c)| *k == 0 || *k < MOST_GROUPS && c.0 > least)
        .map(|(_, c)| c.1)
        .collect();
    of.iter()
        .map(|&node| {
            if large.contains(&node) {
                node
            } else {
                nearest(&large, node, skeleton).unwrap_or(node)
            }
        })
        .collect()
}

/// Of the nodes `among` the one nearest to `node`.
fn nearest(among: &[usize], node: usize, skeleton: &Skeleton) -> Option<usize> {
    let at = skeleton.nodes[node].position;
    among
        .iter()
        .map(|&n| ((skeleton.nodes[n].position - at).norm(), n))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, n)| n)
}

struct Drawer<'a> {
    skeleton: &'a Skeleton,
    target: Option<&'a Target>,
    palette: &'a [[u8; 3]],
    template: &'a Template,
    height: f64,
    /// Of the crown.
    middle: Point3<f64>,
}

impl Drawer<'_> {
    /// Colour of a leaf that is seen at `posed` in a cluster of `size` px (sRGB).
    fn colour(&self, posed: &Point3<f64>, size: f64) -> [u8; 3] {
        let of_palette = any_of(self.palette, posed);
        let film = match self.target {
            Some(target) if target.has_colours() || of_palette.is_none() => {
                let radius = (0.15 * target.grid.length(size)).max(1.0);
                target.soft_colour(target.grid.cell_of(posed), radius)
            }
            _ => of_palette.unwrap_or(PLAIN).map(f64::from),
        };
        // Colour times texture is to be what the film shows.
        let texture = self.template.texture_mean;
        [0, 1, 2].map(|k| (film[k] / texture[k].max(0.05)).round().clamp(0.0, 255.0) as u8)
    }

    fn draw(&self, cluster: &Cluster, attachment: &AttachmentPoint, group: &mut FoliageGroup) {
        let template = self.template;
        let first = group.mesh.positions.len() as u32;
        let node = self.skeleton.nodes[attachment.node.index()].position;
        // beta of B.2: later the farther from the branch's node.
        let way = (cluster.centre - node).norm();
        let beta = if way.is_finite() {
            TAU * way / (WAVE * self.height)
        } else {
            0.0
        };
        let axis = cluster.turn * Vector3::y();
        let leaves = Leaves::of(self, cluster, attachment);
        let normals = self.normals(cluster, &leaves);
        for (i, p) in template.positions.iter().enumerate() {
            let leaf = template.leaf_of[i] as usize;
            let at = cluster.at(template, p);
            let turned = axis.cross(&(at - cluster.centre));
            let fluttered = leaves.stalks[leaf].cross(&(at - leaves.apices[leaf])) * LEAF_SWING;
            let later = beta + LEAF_LATER * (leaf as f64 + 1.0);
            let sine = turned * beta.cos() + fluttered * later.cos();
            let cosine = turned * beta.sin() + fluttered * later.sin();
            group
                .mesh
                .positions
                .push(at.coords.map(|x| x as f32).into());
            group.mesh.normals.push(normals[i].map(|x| x as f32).into());
            group.mesh.uvs.push(template.uvs[i]);
            group.mesh.joints.push(attachment.skin.joints);
            group.mesh.weights.push(attachment.skin.weights);
            group.colours.push(leaves.colours[leaf]);
            group.sine.push(sine.map(|x| x as f32).into());
            group.cosine.push(cosine.map(|x| x as f32).into());
        }
        for corners in template.indices.chunks_exact(3) {
            let [a, b, c] = [corners[0], corners[1], corners[2]].map(|i| first + i);
            let wound = if leaves.turned[template.leaf_of[corners[0] as usize] as usize] {
                [a, c, b]
            } else {
                [a, b, c]
            };
            group.mesh.indices.extend(wound);
        }
    }

    /// Away from the crown's middle, of length 1.
    fn outward(&self, at: &Point3<f64>) -> Vector3<f64> {
        (at - self.middle)
            .try_normalize(1e-9)
            .unwrap_or(Vector3::y())
    }

    /// The normal of each vertex: outward as far as that goes along the faces around it, as they
    /// are wound.
    fn normals(&self, cluster: &Cluster, leaves: &Leaves) -> Vec<Vector3<f64>> {
        let template = self.template;
        let n = template.positions.len();
        let (mut owns, mut outwards) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for (i, p) in template.positions.iter().enumerate() {
            let own = cluster.turn * template.normals[i];
            let turned = leaves.turned[template.leaf_of[i] as usize];
            owns.push(if turned { -own } else { own });
            outwards.push(self.outward(&cluster.at(template, p)));
        }
        let mut shares = vec![OUTWARD; n];
        for (corners, face) in template.indices.chunks_exact(3).zip(&template.faces) {
            let face = cluster.turn * face;
            let turned = leaves.turned[template.leaf_of[corners[0] as usize] as usize];
            let face = if turned { -face } else { face };
            for &i in corners {
                let i = i as usize;
                shares[i] = share_along(&owns[i], &outwards[i], &face, shares[i]);
            }
        }
        let mut normals = Vec::with_capacity(n);
        for ((own, outward), share) in owns.iter().zip(&outwards).zip(shares) {
            let normal = own * (1.0 - share) + outward * share;
            normals.push(normal.try_normalize(1e-6).unwrap_or(*own));
        }
        normals
    }
}

/// The single leaves of a cluster.
struct Leaves {
    /// Where each is held, model axes at rest.
    apices: Vec<Point3<f64>>,
    /// From there to its middle, of length 1: what it turns about.
    stalks: Vec<Vector3<f64>>,
    colours: Vec<[u8; 3]>,
    /// Wound the other way than in the template: a leaf has two faces, and the outer one is the
    /// front.
    turned: Vec<bool>,
}

impl Leaves {
    fn of(drawer: &Drawer, cluster: &Cluster, attachment: &AttachmentPoint) -> Self {
        let template = drawer.template;
        let count = template.apices.len();
        let (mut sums, mut sizes) = (vec![Vector3::zeros(); count], vec![0.0; count]);
        for (p, &leaf) in template.positions.iter().zip(&template.leaf_of) {
            sums[leaf as usize] += p.coords;
            sizes[leaf as usize] += 1.0;
        }
        let middles: Vec<_> = sums
            .iter()
            .zip(&sizes)
            .map(|(s, n)| cluster.at(template, &Point3::from(s / f64::max(*n, 1.0))))
            .collect();
        let apices: Vec<_> = template
            .apices
            .iter()
            .map(|a| cluster.at(template, a))
            .collect();
        let mut areas = vec![Vector3::zeros(); count];
        for corners in template.indices.chunks_exact(3) {
            let leaf = template.leaf_of[corners[0] as usize];
            areas[leaf as usize] += area_vector(&template.positions, corners);
        }
        let mut turned = Vec::with_capacity(count);
        for (area, middle) in areas.iter().zip(&middles) {
            // A closed body adds up to nothing, and stays as it is.
            turned.push((cluster.turn * area).dot(&drawer.outward(middle)) < -CLOSED);
        }
        let (mut stalks, mut colours) = (Vec::new(), Vec::new());
        for (middle, apex) in middles.iter().zip(&apices) {
            let stalk = (middle - apex).try_normalize(1e-9);
            stalks.push(stalk.unwrap_or_else(Vector3::zeros));
            colours.push(drawer.colour(&attachment.carried.posed(middle), cluster.size));
        }
        Self {
            apices,
            stalks,
            colours,
            turned,
        }
    }
}
