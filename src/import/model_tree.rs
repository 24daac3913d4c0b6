//! A modelled tree: places in space that are joined.

use super::error::ImportError;
use super::sketch::refuse_more;
use crate::model::{Sway, Swaying, Unidentified};
use nalgebra::Point3;
use std::collections::BTreeMap;

/// Places of a model that are read.
pub(super) const MOST_PLACES: usize = 1_000_000;

/// A tree in space, y up, in the unit of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelTree {
    /// Parents before children; the first is the foot.
    pub nodes: Vec<ModelNode>,
    /// Metres in the unit of the file; 0 where it is not known.
    pub metres_per_unit: f64,
    /// Whether nothing but the height says whether it is in metres, as tables usually are.
    pub unit_is_guessed: bool,
}

/// A place of a modelled tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelNode {
    pub parent: Option<usize>,
    pub position: Point3<f64>,
    /// Its place among those of the file.
    pub place: usize,
    /// What ends here.
    pub wood: Wood,
}

/// What a file says of the wood that ends in a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wood {
    /// In the unit of the file; 0 where it is not known.
    pub radius: f64,
    pub sway: Option<Sway>,
    /// The file gives a frequency that is not above 0 and within its interval, or that no branch has; it is ignored.
    pub lacks_interval: bool,
    /// The file says that it begins elsewhere than at what it grows from.
    pub begins_apart: bool,
    /// The file says that nobody has seen it: a copy, a twig, or what a generator made up.
    pub is_made_up: bool,
}

/// What a file says: places, and which of them are joined.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Edges {
    pub places: Vec<Point3<f64>>,
    pub edges: Vec<[usize; 2]>,
    /// By place; empty where the file says nothing of the wood.
    pub wood: Vec<Wood>,
    /// The place of the foot where the file says so, else it is the lowest.
    pub foot: Option<usize>,
}

/// A place in a file whose z is up, turned so that y is.
pub(super) fn from_z_up([x, y, z]: [f64; 3]) -> Point3<f64> {
    Point3::new(x, z, -y)
}

/// Trees are seldom higher, m: the highest broad-leaved trees of Europe and North America reach about
/// that.
pub const TALL_M: f64 = 60.0;
/// Forks on one way from the foot: levels are counted in a byte.
const MOST_LEVELS: usize = 250;
/// A tree is not so many times as wide as it is high.
const WIDEST: f64 = 8.0;

impl ModelTree {
    /// From its foot up, in the unit of the file.
    ///
    /// # Errors
    /// It has none, or is far wider than high.
    pub fn height(&self) -> Result<f64, ImportError> {
        let foot = self.nodes[0].position;
        let highest = self.nodes.iter().map(|n| n.position.y - foot.y);
        let height = highest.fold(0.0, f64::max);
        let far = self.nodes.iter().map(|n| (n.position - foot).norm());
        match height > 0.0 && far.fold(0.0, f64::max) <= WIDEST * height {
            true => Ok(height),
            false => Err(ImportError::NoHeight),
        }
    }

    /// Refuses more forks on one way from the foot than levels can be counted; `joints` are nodes that count as forks,
    /// too.
    ///
    /// # Errors
    /// There are more.
    pub fn refuse_deep(&self, joints: &[bool]) -> Result<(), ImportError> {
        let children = self.children();
        let mut levels: Vec<usize> = Vec::with_capacity(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            let is_end = children[i].len() != 1 || joints.get(i) == Some(&true);
            levels.push(node.parent.map_or(0, |p| levels[p] + usize::from(is_end)));
        }
        let most = levels.into_iter().max().unwrap_or_default();
        refuse_more("forks on one way", most, MOST_LEVELS)
    }

    /// How the wood that ends in each node sways, as far as the file says: as the last of the pieces of its
    /// branch of which that is known.
    pub fn sways(&self) -> Vec<Swaying> {
        let children = self.children();
        let mut known: Vec<Swaying> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let own = node.wood.sway.ok_or(Unidentified::NotMeasured);
            let below = node.parent.filter(|p| children[*p].len() == 1);
            known.push(own.or_else(|e| below.map_or(Err(e), |p| known[p])));
        }
        known
    }

    /// For every node whether the only branch that it carries has another sway, where both are known. What is not known
    /// is that of the same branch, as in [`sways`](Self::sways).
    pub fn sway_changes(&self) -> Vec<bool> {
        let known = self.sways();
        let children = self.children();
        let mut changes = vec![false; self.nodes.len()];
        for (i, above) in children.iter().enumerate().skip(1) {
            let next = match above[..] {
                [only] => self.nodes[only].wood.sway,
                _ => None,
            };
            if let (Ok(below), Some(next)) = (known[i], next) {
                changes[i] = !says_the_same(&below, &next);
            }
        }
        changes
    }

    /// Pieces of which the file says that nobody has seen them.
    pub fn made_up(&self) -> usize {
        self.pieces().filter(|wood| wood.is_made_up).count()
    }

    /// Pieces with a frequency that is ignored ([`Wood::lacks_interval`]).
    pub fn without_interval(&self) -> usize {
        let pieces = self.pieces();
        pieces.filter(|wood| wood.lacks_interval).count()
    }

    /// Refuses wood that is as thick as the tree is high: its radii are in another unit.
    ///
    /// # Errors
    /// There is some, or the tree has no height.
    pub fn refuse_thick(&self) -> Result<(), ImportError> {
        let height = self.height()?;
        let thickest = self.pieces().map(|wood| wood.radius).fold(0.0, f64::max);
        match 2.0 * thickest < height {
            true => Ok(()),
            false => Err(ImportError::TooThick { thickest, height }),
        }
    }

    /// Pieces that begin far from the end of the one that they grow from.
    pub fn begin_apart(&self) -> usize {
        self.pieces().filter(|wood| wood.begins_apart).count()
    }

    /// Pieces without a radius above 0.
    pub fn without_radius(&self) -> usize {
        let pieces = self.pieces();
        pieces.filter(|wood| wood.radius <= 0.0).count()
    }

    /// All wood; the foot ends none.
    fn pieces(&self) -> impl Iterator<Item = &Wood> {
        self.nodes.iter().skip(1).map(|node| &node.wood)
    }

    /// The tree of joined places, y up. Places that are the same are one. Places that are joined to
    /// nothing do not count.
    ///
    /// # Errors
    /// There is nothing joined, too much, or a place that is no number; the edges go round in a
    /// circle, or are in several pieces.
    pub(super) fn of_edges(file: &Edges) -> Result<Self, ImportError> {
        refuse_more("places", file.places.len(), MOST_PLACES)?;
        refuse_more("edges", file.edges.len(), MOST_PLACES)?;
        if file.places.iter().any(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(ImportError::bad_format("a place in it is no number"));
        }
        let one = same_places(&file.places);
        let mut neighbours: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for edge in &file.edges {
            if edge.iter().any(|end| *end >= file.places.len()) {
                let what = "an edge ends at a place that is not in it";
                return Err(ImportError::bad_format(what));
            }
            let [a, b] = edge.map(|end| one[end]);
            if a != b {
                neighbours.entry(a).or_default().push(b);
                neighbours.entry(b).or_default().push(a);
            }
        }
        for ends in neighbours.values_mut() {
            ends.sort_unstable();
            ends.dedup();
        }
        let lowest = neighbours.keys().copied().min_by(|a, b| {
            let [a, b] = [a, b].map(|place| file.places[*place].y);
            a.total_cmp(&b)
        });
        let foot = file.foot.map(|foot| one[foot]).or(lowest);
        let Some(foot) = foot.filter(|foot| neighbours.contains_key(foot)) else {
            return Err(ImportError::NoSkeleton);
        };
        let mut nodes = from_foot(foot, &neighbours, &file.places)?;
        let wood = file.wood_by(&one);
        for node in &mut nodes {
            node.wood = wood.get(node.place).copied().unwrap_or_default();
        }
        if nodes.len() < neighbours.len() {
            return Err(ImportError::InPieces {
                joined: nodes.len(),
                all: neighbours.len(),
            });
        }
        Ok(Self {
            nodes,
            metres_per_unit: 0.0,
            unit_is_guessed: false,
        })
    }

    /// The same in metres, unless it would be too high a tree then.
    pub(super) fn in_metres(self) -> Self {
        let is_tree = self.height().is_ok_and(|height| height <= TALL_M);
        Self {
            metres_per_unit: if is_tree { 1.0 } else { 0.0 },
            unit_is_guessed: true,
            ..self
        }
    }
}

impl ModelTree {
    /// Of every node those that hang on it.
    pub(super) fn children(&self) -> Vec<Vec<usize>> {
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            if let Some(parent) = node.parent {
                children[parent].push(i);
            }
        }
        children
    }
}

impl Edges {
    /// What is known of the wood that ends in each place, where `one` says of each the first one that
    /// is the same.
    fn wood_by(&self, one: &[usize]) -> Vec<Wood> {
        let mut wood = vec![Wood::default(); self.wood.len()];
        for (own, first) in self.wood.iter().zip(one) {
            let known = &mut wood[*first];
            if known.radius == 0.0 {
                known.radius = own.radius;
            }
            known.sway = known.sway.or(own.sway);
            known.lacks_interval |= own.lacks_interval;
            known.begins_apart |= own.begins_apart;
            known.is_made_up |= own.is_made_up;
        }
        wood
    }
}

/// Whether two have the same frequency and damping. How far a branch sways, no table says.
fn says_the_same(a: &Sway, b: &Sway) -> bool {
    a.frequency_hz == b.frequency_hz && a.damping_ratio == b.damping_ratio
}

/// For each place the first one that is the same.
fn same_places(places: &[Point3<f64>]) -> Vec<usize> {
    let mut first: BTreeMap<[u64; 3], usize> = BTreeMap::new();
    let mut same = Vec::with_capacity(places.len());
    for (place, at) in places.iter().enumerate() {
        // 0 and -0 are one place.
        let key = [at.x, at.y, at.z].map(|x| (x + 0.0).to_bits());
        same.push(*first.entry(key).or_insert(place));
    }
    same
}

/// All that is joined to the foot, in the order of the places as far as parents come first.
fn from_foot(
    foot: usize,
    neighbours: &BTreeMap<usize, Vec<usize>>,
    places: &[Point3<f64>],
) -> Result<Vec<ModelNode>, ImportError> {
    let mut nodes: Vec<ModelNode> = Vec::new();
    // The places that hang on the nodes so far, each with the node.
    let mut waiting: BTreeMap<usize, Option<usize>> = BTreeMap::from([(foot, None)]);
    let mut is_known = vec![false; places.len()];
    is_known[foot] = true;
    while let Some((place, parent)) = waiting.pop_first() {
        let below = parent.map(|p| nodes[p].place);
        for end in neighbours.get(&place).into_iter().flatten().copied() {
            if Some(end) == below {
                continue;
            }
            if std::mem::replace(&mut is_known[end], true) {
                return Err(ImportError::Cyclic);
            }
            waiting.insert(end, Some(nodes.len()));
        }
        nodes.push(ModelNode {
            parent,
            position: places[place],
            place,
            wood: Wood::default(),
        });
    }
    Ok(nodes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Excitation, SwayColumns};

    fn of(places: &[[f64; 3]], edges: &[[usize; 2]]) -> Result<ModelTree, ImportError> {
        ModelTree::of_edges(&Edges {
            places: places.iter().copied().map(Point3::from).collect(),
            edges: edges.to_vec(),
            ..Edges::default()
        })
    }

    const FORK: [[f64; 3]; 5] = [
        [1.0, 3.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [-1.0, 3.0, 0.0],
        [0.0, 1.0, -0.0],
    ];

    /// The fork is named twice, as files do that have each line for itself.
    #[test]
    fn a_tree_stands_on_its_lowest_place_and_what_is_the_same_is_one() {
        let tree = of(&FORK, &[[2, 1], [4, 0], [1, 3], [3, 1]]).expect("a tree");
        let parents: Vec<Option<usize>> = tree.nodes.iter().map(|n| n.parent).collect();
        assert_eq!(parents, [None, Some(0), Some(1), Some(1)]);
        assert_eq!(tree.nodes[0].place, 2);
    }

    /// A stem of pieces one above the other, each with this frequency; 0: none.
    fn stem(frequencies_hz: &[f64]) -> ModelTree {
        let places: Vec<Point3<f64>> = (0..=frequencies_hz.len())
            .map(|k| Point3::new(0.0, k as f64, 0.0))
            .collect();
        let mut wood = vec![Wood::default()];
        for hz in frequencies_hz {
            let columns =
                SwayColumns::of_values([*hz, 0.9 * hz, 1.1 * hz, f64::NAN, f64::NAN, f64::NAN]);
            wood.push(Wood {
                sway: columns.sway(Excitation::Wind, f64::NAN),
                ..Wood::default()
            });
        }
        ModelTree::of_edges(&Edges {
            edges: (0..frequencies_hz.len()).map(|k| [k, k + 1]).collect(),
            places,
            wood,
            foot: Some(0),
        })
        .expect("a stem")
    }

    /// Amplitudes are not known, and no number is no other one.
    #[test]
    fn a_sway_changes_where_another_one_is_known() {
        let changes = |hz: &[f64]| stem(hz).sway_changes();
        assert_eq!(changes(&[0.5, 0.5, 0.5]), [false; 4]);
        assert_eq!(changes(&[0.5, 0.5, 0.8]), [false, false, true, false]);
        assert_eq!(changes(&[0.0, 0.0, 0.8]), [false; 4]);
        assert_eq!(changes(&[0.8, 0.0, 0.0]), [false; 4]);
        assert_eq!(changes(&[0.8, 0.0, 0.5]), [false, false, true, false]);
    }

    #[test]
    fn changes_of_sway_count_as_forks_on_one_way() {
        let alternating: Vec<f64> = (0..300).map(|k| 0.5 + f64::from(k % 2)).collect();
        let tree = stem(&alternating);
        assert!(tree.refuse_deep(&[]).is_ok());
        let refused = tree.refuse_deep(&tree.sway_changes());
        assert!(
            matches!(refused, Err(ImportError::TooMany { .. })),
            "{refused:?}"
        );
    }

    #[test]
    fn what_is_no_tree_is_refused() {
        let circle = of(&FORK, &[[2, 1], [1, 0], [0, 3], [3, 1]]);
        assert_eq!(circle, Err(ImportError::Cyclic));
        let pieces = of(&FORK, &[[2, 1], [0, 3]]);
        assert_eq!(pieces, Err(ImportError::InPieces { joined: 2, all: 4 }));
        assert_eq!(of(&FORK, &[]), Err(ImportError::NoSkeleton));
        assert_eq!(of(&FORK, &[[1, 4]]), Err(ImportError::NoSkeleton));
        assert!(of(&FORK, &[[1, 77]]).is_err());
        assert!(of(&[[0.0; 3], [f64::NAN, 1.0, 0.0]], &[[0, 1]]).is_err());
    }
}
