//! The tree of the coloured markers of a capture: each marker is the end of a branch that begins at its
//! parent (Hu et al. sect. 5.3).

use super::error::DocumentError;
use super::marker_depths::MarkerDepths;
use super::marker_parents::{Placed, carried};
use super::nodes::NodesRead;
use super::note::ModelNote;
use super::tracks::{PointsRead, read_points};
use super::{Document, TRACKS_FILE, outline, picture, size};
use crate::bounds::Bounds;
use crate::config::MarkerWindow;
use crate::dynamics::Film;
use crate::model::{
    Foot, JointPose, Node, NodeId, NodeKind, NodeName, Pose, Skeleton, TrackId, Unidentified,
};
use crate::signal::median;
use crate::signal::statistics::median_vector;
use nalgebra::{Point2, Point3, Quaternion, UnitQuaternion, Vector3, Vector4};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;

/// Markers as a tree, and their film.
#[derive(Clone, Debug)]
pub struct MarkedTree {
    /// The foot, then the markers, each after its parent. A node's name is the number of its marker, from
    /// 1.
    pub skeleton: Skeleton,
    /// Names of the markers, by node name.
    pub names: BTreeMap<NodeName, String>,
    /// Each marker is the one point on its node.
    pub film: Film,
    /// The names of those whose parents follow from the motion, but not for certain.
    pub unsure: Vec<String>,
    /// How far away a depth camera has seen them.
    depths: MarkerDepths,
}

/// A marker that was seen in few frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeldomSeen {
    pub name: String,
    /// In so many frames.
    pub seen: usize,
}

/// A marker that stands still while others move.
#[derive(Clone, Debug, PartialEq)]
pub struct StillMarker {
    pub name: String,
    /// Standard deviation of its place, and the median of those of all markers, px.
    pub moves_px: f64,
    pub usual_px: f64,
}

/// A marker that was seen.
struct Seen<'a> {
    /// Its place among the capture's markers.
    marker: usize,
    given: &'a MarkerWindow,
    /// The median of its places, px.
    rest_px: Point2<f64>,
}

impl Document {
    /// The document in `dir` for its markers: as [`tree`](Self::tree), but where no tree was built it is the
    /// foot alone.
    ///
    /// # Errors
    /// The folder is no document, or one of its tables is damaged.
    pub fn for_markers(dir: &Path) -> Result<Self, DocumentError> {
        match Self::tree(dir) {
            Err(DocumentError::NoTree { .. }) => Self::foot_alone(dir),
            read => read,
        }
    }

    fn foot_alone(dir: &Path) -> Result<Self, DocumentError> {
        let mut note = Self::note(dir)?;
        let size = size(&note);
        let corners_px = note.outline.as_ref().map(|noted| noted.polygon_px.clone());
        let region = corners_px.and_then(|corners| outline(note.outline.as_ref()?, &corners).ok());
        let lower_middle = Point2::new(0.5 * f64::from(size.width), f64::from(size.height));
        let foot_px = region.map_or(lower_middle, |region| Foot::of(&region, None).position_px);
        let skeleton = Skeleton {
            nodes: vec![node(NodeName(0), None, 0, Point3::origin())],
            foot_px,
            image_size: size,
        };
        note.model = Some(ModelNote::of(&skeleton, note.config.export.metres_per_px));
        let picture = note.picture.as_ref().map(|p| picture::bytes(dir, p));
        let nodes = NodesRead {
            sway: vec![Err(Unidentified::NotMeasured)],
            skeleton,
        };
        Self::of_parts(dir, note, nodes, picture)
    }

    /// The tree of the markers in the last `window_s` seconds of what lies between two times, s. Who is
    /// whose parent follows from `parents`, which are of the same names and leave out who is not among them; without
    /// them from what the capture was given; and where that says nothing, from the motion: a marker's parent is the
    /// next one towards the foot on the branches of the tree of all points, on which it lies in the picture.
    ///
    /// # Errors
    /// The capture has no markers, or none was seen, `parents` are of others, or `tracks.csv` is missing
    /// or damaged.
    pub fn marked_tree(
        &self,
        parents: Option<&[MarkerWindow]>,
        window_s: f64,
        within_s: Bounds,
    ) -> Result<MarkedTree, DocumentError> {
        let given = &self.note.config.markers.windows;
        if !self.has_tracks() {
            return Err(self.no_film(TRACKS_FILE));
        }
        let points = read_points(&self.dir, &self.skeleton, window_s, within_s)?;
        let mut seen = Vec::with_capacity(given.len());
        for (marker, given) in given.iter().enumerate() {
            let places_px = points.places_px(TrackId::of_marker(marker));
            if !places_px.is_empty() {
                let rest_px = median_vector(places_px.iter().map(|p| p.coords)).into();
                seen.push(Seen {
                    marker,
                    given,
                    rest_px,
                });
            }
        }
        if let Some(parents) = parents {
            self.check_names(given, parents)?;
            seen.retain(|own| parents.iter().any(|named| named.name == own.given.name));
        }
        if seen.is_empty() {
            return Err(DocumentError::NoMarkers {
                dir: self.dir.clone(),
            });
        }
        let by_hand_of = match parents {
            Some(parents) => Some(by_hand(&seen, parents)),
            None if given.iter().any(|m| m.parent.is_some()) => Some(by_hand(&seen, given)),
            None => None,
        };
        if let Some(parent_of) = by_hand_of {
            return Ok(self.marked(&seen, &parent_of, &points));
        }
        let mut placed = Vec::with_capacity(seen.len());
        for own in &seen {
            placed.push(Placed {
                rest_px: own.rest_px,
                moves_with: points.node(TrackId::of_marker(own.marker)),
            });
        }
        let carried = carried(&placed, &self.skeleton);
        let parent_of: Vec<Option<usize>> = carried.iter().map(|c| c.parent).collect();
        let mut marked = self.marked(&seen, &parent_of, &points);
        let unsure = seen.iter().zip(&carried).filter(|(_, c)| !c.is_certain);
        marked.unsure = unsure.map(|(own, _)| own.given.name.clone()).collect();
        Ok(marked)
    }

    fn check_names(
        &self,
        given: &[MarkerWindow],
        parents: &[MarkerWindow],
    ) -> Result<(), DocumentError> {
        let is_known = |marker: &&MarkerWindow| given.iter().any(|g| g.name == marker.name);
        match parents.iter().find(|marker| !is_known(marker)) {
            None => Ok(()),
            Some(marker) => Err(DocumentError::UnknownMarker {
                dir: self.dir.clone(),
                name: marker.name.clone(),
            }),
        }
    }

    /// The tree of markers whose parents are known, by index into `seen`.
    fn marked(
        &self,
        seen: &[Seen],
        parent_of: &[Option<usize>],
        points: &PointsRead,
    ) -> MarkedTree {
        let foot_px = self.skeleton.foot_px;
        let size = self.skeleton.image_size;
        let mut depths = MarkerDepths::before(self.note.depth.as_ref(), points.has_depth, size);
        let mut nodes = vec![node(NodeName(0), None, 0, Point3::origin())];
        let mut node_of: BTreeMap<usize, NodeId> = BTreeMap::new();
        let mut names = BTreeMap::new();
        for k in parents_first(parent_of) {
            let parent = parent_of[k].and_then(|p| node_of.get(&p).copied());
            let parent = parent.unwrap_or_default();
            let at = seen[k].rest_px - foot_px;
            let own = NodeId(nodes.len() as u32);
            depths.add(own, points.depths(TrackId::of_marker(seen[k].marker)));
            // As deep as its parent where nobody has seen more.
            let z = depths.rest_z_px(own);
            let z = z.unwrap_or_else(|| nodes[parent.index()].position.z);
            let name = NodeName(seen[k].marker as u32 + 1);
            let level = nodes[parent.index()].level.saturating_add(1);
            node_of.insert(k, own);
            nodes.push(node(name, Some(parent), level, Point3::new(at.x, -at.y, z)));
            names.insert(name, seen[k].given.name.clone());
        }
        // Parents stand before their children.
        for i in (1..nodes.len()).rev() {
            if let Some(parent) = nodes[i].parent {
                nodes[parent.index()].n_tracks += nodes[i].n_tracks;
            }
        }
        let skeleton = Skeleton {
            nodes,
            foot_px,
            image_size: size,
        };
        let node_of_marker: BTreeMap<TrackId, NodeId> = node_of
            .iter()
            .map(|(k, node)| (TrackId::of_marker(seen[*k].marker), *node))
            .collect();
        let mut film = points.film_on(&skeleton, |id| node_of_marker.get(&id).copied());
        film.are_markers = true;
        MarkedTree {
            skeleton,
            names,
            film,
            unsure: Vec::new(),
            depths,
        }
    }
}

impl MarkedTree {
    /// The marker in which the branch ends that ends in a node.
    fn name_at(&self, node: NodeId) -> Option<&String> {
        self.names.get(&self.skeleton.nodes[node.index()].name)
    }

    /// The markers that were seen in less than this share of the frames, by name, each with how many.
    pub fn seldom_seen(&self, share: f64) -> Vec<SeldomSeen> {
        let frames = self.film.times_s.len();
        let mut seldom = Vec::new();
        for track in &self.film.tracks {
            let seen = track.at_px.iter().filter(|at| at.x.is_finite()).count();
            let name = self.name_at(track.node);
            if let Some(name) = name.filter(|_| (seen as f64) < share * frames as f64) {
                seldom.push(SeldomSeen {
                    name: name.clone(),
                    seen,
                });
            }
        }
        seldom
    }

    /// The markers that move by less than `share` of what markers usually do.
    pub fn standing(&self, share: f64) -> Vec<StillMarker> {
        let tracks = self.film.tracks.iter();
        let all_px: Vec<f64> = tracks.map(|track| track.spread_px()).collect();
        let usual_px = median(all_px.clone(), f64::total_cmp).unwrap_or(0.0);
        let mut still = Vec::new();
        for (track, moves_px) in self.film.tracks.iter().zip(all_px) {
            let name = self.name_at(track.node);
            if let Some(name) = name.filter(|_| moves_px < share * usual_px) {
                still.push(StillMarker {
                    name: name.clone(),
                    moves_px,
                    usual_px,
                });
            }
        }
        still
    }

    /// The poses of the tree in the frames of a part of its film, of which `skeleton` is where it rests: each
    /// node is where its marker is, and nowhere while that is not seen. In a film with depth it is nowhere
    /// in space (its z is no number) while its depth is not seen; without depth all is in the picture's plane.
    pub fn poses(&self, film: &Film, skeleton: &Skeleton) -> Vec<Pose> {
        let n = skeleton.nodes.len();
        let nowhere = Point3::new(f64::NAN, f64::NAN, f64::NAN);
        let mut poses = Vec::with_capacity(film.times_s.len());
        for (k, time_s) in film.times_s.iter().enumerate() {
            let mut places = vec![nowhere; n];
            places[0] = Point3::origin();
            for track in &film.tracks {
                let at_px = self
                    .depths
                    .at_rest_distance_px(track.node, *time_s, track.at_px[k]);
                let off = at_px - skeleton.foot_px;
                let z = self.depths.z_px(track.node, *time_s);
                places[track.node.index()] = Point3::new(off.x, -off.y, z);
            }
            poses.push(Pose {
                frame: k as u64,
                time_s: *time_s,
                joints: (0..n).map(|i| joint(i, &places, skeleton)).collect(),
            });
        }
        poses
    }
}

/// Where a node is, and how its branch has turned: the least rotation from where it rests. It is no
/// number where an end of the branch is nowhere in space.
fn joint(i: usize, places: &[Point3<f64>], skeleton: &Skeleton) -> JointPose {
    let nodes = &skeleton.nodes;
    let mut joint = JointPose::at_rest(places[i]);
    if let Some(parent) = nodes[i].parent.map(NodeId::index) {
        let rest = nodes[i].position - nodes[parent].position;
        let now = places[i] - places[parent];
        joint.rotation = match now.iter().all(|x| x.is_finite()) {
            true => turned(&rest, &now),
            false => nowhere_turned(),
        };
    }
    joint
}

/// The least rotation from one direction to another; in opposite directions about the line of sight.
fn turned(from: &Vector3<f64>, to: &Vector3<f64>) -> UnitQuaternion<f64> {
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI);
    UnitQuaternion::rotation_between(from, to).unwrap_or(half_turn)
}

fn nowhere_turned() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::from(Vector4::repeat(f64::NAN)))
}

fn node(name: NodeName, parent: Option<NodeId>, level: u8, position: Point3<f64>) -> Node {
    Node {
        name,
        parent,
        level,
        position,
        radius: 1.0,
        n_tracks: u32::from(parent.is_some()),
        kind: NodeKind::Measured,
        certainty: 1.0,
        copy_of: None,
        plane_angle: 0.0,
        moves_with: None,
    }
}

/// The parents that the user gives, by index into `seen`. The nearest one that was seen counts.
fn by_hand(seen: &[Seen], parents: &[MarkerWindow]) -> Vec<Option<usize>> {
    let mut parent_of = Vec::with_capacity(seen.len());
    for own in seen {
        let mut name = Some(&own.given.name);
        let mut found = None;
        for _ in 0..parents.len() {
            let entry = name.and_then(|name| parents.iter().find(|p| p.name == *name));
            name = entry.and_then(|entry| entry.parent.as_ref());
            found = name.and_then(|name| seen.iter().position(|s| s.given.name == *name));
            if found.is_some() {
                break;
            }
        }
        parent_of.push(found);
    }
    parent_of
}

/// All indices, each after its parent; of a ring, which no reader lets pass, the rest is left out.
fn parents_first(parent_of: &[Option<usize>]) -> Vec<usize> {
    let mut order: Vec<usize> = Vec::with_capacity(parent_of.len());
    for _ in 0..parent_of.len() {
        for (k, parent) in parent_of.iter().enumerate() {
            let is_next = !order.contains(&k) && parent.is_none_or(|p| order.contains(&p));
            if is_next {
                order.push(k);
            }
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::note::DepthNote;
    use crate::document::tracks::DepthAt;
    use crate::dynamics::{FilmTrack, angle_in_space_deg, angle_to_parent_deg};
    use crate::model::Size;

    /// A branch of 100 px that swings towards the camera and away is flat in the picture; depth shows
    /// by how much.
    #[test]
    fn a_marker_that_swings_in_depth_has_its_angle_in_space() {
        let image_size = Size::new(641, 481);
        let note = DepthNote {
            foot_m: 2.0,
            metres_per_px: 0.004,
            ..DepthNote::default()
        };
        // The foot is on the camera's axis, the marker 0.4 m above it.
        let foot_px = Point2::new(320.0, 240.0);
        let angles_deg = [0.0_f64, 10.0, -10.0, 6.0, -6.0];
        let (mut at_px, mut seen) = (Vec::new(), Vec::new());
        for (k, deg) in angles_deg.iter().enumerate() {
            let (sin, cos) = deg.to_radians().sin_cos();
            let depth_m = 2.0 - 0.4 * sin;
            at_px.push(Point2::new(320.0, 240.0 - 500.0 * 0.4 * cos / depth_m));
            seen.push(DepthAt {
                time_s: k as f64,
                depth_m,
            });
        }
        let mut depths = MarkerDepths::before(Some(&note), true, image_size);
        depths.add(NodeId(1), seen);
        let skeleton = Skeleton {
            nodes: vec![
                node(NodeName(0), None, 0, Point3::origin()),
                node(
                    NodeName(1),
                    Some(NodeId(0)),
                    1,
                    Point3::new(0.0, 100.0, 0.0),
                ),
            ],
            foot_px,
            image_size,
        };
        let track = FilmTrack {
            node: NodeId(1),
            at_px,
        };
        let film = Film::new(&[0.0, 1.0, 2.0, 3.0, 4.0], vec![track]);
        let marked = MarkedTree {
            skeleton: skeleton.clone(),
            names: BTreeMap::new(),
            film: film.clone(),
            unsure: Vec::new(),
            depths,
        };
        let poses = marked.poses(&film, &skeleton);
        let space = angle_in_space_deg(&skeleton, &poses, NodeId(1));
        let sign = (space[1] * angles_deg[1]).signum();
        for (found, wanted) in space.iter().zip(angles_deg) {
            assert!((found * sign - wanted).abs() < 1e-6, "{space:?}");
        }
        let plane = angle_to_parent_deg(&skeleton, &poses, NodeId(1));
        assert!(plane.iter().all(|a| a.abs() < 1e-6), "{plane:?}");
    }
}
