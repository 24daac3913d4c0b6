//! The wood for the tools of quantitative structure models (QSM): a table of cylinders, and a
//! treefile.
//!
//! The table has the columns of SimpleForest (Hackenberg et al. 2015) and of aRchi, both of which
//! rTwig reads, and behind them what is known of the sway. The treefile is that of RayCloudTools
//! (Devereux et al. 2026). z is up in both.

use crate::document::{TableWriter, unit};
use crate::files::WriteError;
use crate::geometry::Cylinder;
use crate::model::{BotanicalBranches, NodeId, NodeKind, Skeleton, SwayColumns, Swaying};
use crate::shape::Limb;
use nalgebra::Point3;
use std::fmt::Write as _;
use std::io::Write;

/// The columns of SimpleForest, then those of aRchi, then the sway.
const HEADER: &str = "ID,parentID,startX,startY,startZ,endX,endY,endZ,radius,length,growthLength,averagePointDistance,\
segmentID,parentSegmentID,branchOrder,reverseBranchOrder,branchID,cyl_ID,parent_ID,extension_ID,radius_cyl,\
volume,axis_ID,\
segment_ID,node_ID,branching_order";
/// Decimals of a number in a treefile.
const DECIMALS: usize = 6;

/// A tree as cylinders.
#[derive(Clone, Debug)]
pub struct Qsm {
    pieces: Vec<Piece>,
    /// Unit of lengths, in pixels, and how many decimals more they take.
    decimals: usize,
}

/// A cylinder with what the tables say of it.
#[derive(Clone, Debug)]
struct Piece {
    parent: Option<usize>,
    /// z up.
    start: Point3<f64>,
    end: Point3<f64>,
    radius: f64,
    length: f64,
    /// Its length and that of all it carries.
    growth_length: f64,
    /// Cylinders between two forks are one segment.
    segment: usize,
    parent_segment: Option<usize>,
    branch: usize,
    order: u32,
    /// Forks to the farthest tip, and one.
    reverse_order: u32,
    /// The one in which it goes on.
    extension: Option<usize>,
    made_up: bool,
    sway: SwayColumns,
    /// The nearest cylinder at or below it that has a frequency: what that carries swings with it.
    nearest: Option<usize>,
}

/// The branches of one order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OrderSum {
    pub branches: usize,
    /// In the unit of the tables, m where the scale is known.
    pub length: f64,
    pub volume: f64,
}

impl Qsm {
    /// Of cylinders, which are pieces of `limbs` of `skeleton`; `sway` is by node index.
    /// `metres_per_px` 0 leaves pixels. `foot` is where the foot of the tree lies in the axes of
    /// the table.
    pub fn new(
        cylinders: &[Cylinder],
        limbs: &[Limb],
        skeleton: &Skeleton,
        sway: &[Swaying],
        metres_per_px: f64,
        foot: Point3<f64>,
    ) -> Self {
        let (scale, more) = unit(metres_per_px);
        let place = |at: &Point3<f64>| foot + nalgebra::Vector3::new(at.x, -at.z, at.y) * scale;
        let mut pieces: Vec<Piece> = Vec::with_capacity(cylinders.len());
        let branches = skeleton.botanical_branches();
        let mut of_twig: Vec<bool> = Vec::with_capacity(cylinders.len());
        for own in cylinders {
            let limb = &limbs[own.limb];
            // A twig hangs on the node of a branch, and is none of it unless that goes on in it.
            let goes_on = own.parent.filter(|p| cylinders[*p].branch == own.branch);
            let is_of_twig = goes_on.map_or(limb.twig && own.parent.is_some(), |p| of_twig[p]);
            of_twig.push(is_of_twig);
            let own_sway = match is_of_twig {
                true => SwayColumns::of(None),
                false => sway_of(skeleton, &branches, sway, limb.node),
            };
            pieces.push(Piece {
                parent: own.parent,
                start: place(&own.start),
                end: place(&own.end),
                radius: own.radius * scale,
                length: (own.end - own.start).norm() * scale,
                growth_length: 0.0,
                segment: 0,
                parent_segment: None,
                branch: own.branch,
                order: own.order,
                reverse_order: 1,
                extension: None,
                made_up: own.made_up,
                sway: own_sway,
                nearest: None,
            });
        }
        let mut qsm = Self {
            pieces,
            decimals: 4 + more,
        };
        qsm.complete();
        qsm
    }

    /// Finds what follows from parents and branches.
    fn complete(&mut self) {
        let pieces = &mut self.pieces;
        let mut children = vec![0_usize; pieces.len()];
        for i in (0..pieces.len()).rev() {
            pieces[i].growth_length += pieces[i].length;
            let Some(p) = pieces[i].parent else {
                continue;
            };
            children[p] += 1;
            let (own, growth) = (pieces[i].branch, pieces[i].growth_length);
            pieces[p].growth_length += growth;
            if pieces[p].branch == own {
                pieces[p].extension = Some(i);
            }
        }
        for i in (0..pieces.len()).rev() {
            let own = pieces[i].reverse_order;
            if let Some(p) = pieces[i].parent {
                let up = own + u32::from(children[p] > 1);
                pieces[p].reverse_order = pieces[p].reverse_order.max(up);
            }
        }
        let mut segments = 0;
        for i in 0..pieces.len() {
            let parent = pieces[i].parent;
            pieces[i].nearest = match pieces[i].sway.frequency() {
                Some(_) => Some(i),
                None => parent.and_then(|p| pieces[p].nearest),
            };
            let goes_on =
                parent.filter(|p| children[*p] == 1 && pieces[*p].branch == pieces[i].branch);
            if let Some(p) = goes_on {
                (pieces[i].segment, pieces[i].parent_segment) =
                    (pieces[p].segment, pieces[p].parent_segment);
            } else {
                pieces[i].segment = segments;
                pieces[i].parent_segment = parent.map(|p| pieces[p].segment);
                segments += 1;
            }
        }
    }

    /// Number of cylinders.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Whether there is no wood.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Writes the table of cylinders. Numbers count from 0 as those of SimpleForest do, and the
    /// parent of what stands on the ground is -1; those of aRchi count from 1, and it is 0. What is
    /// not known of the sway is empty. Behind the cylinder's own sway stands that of the nearest branch
    /// that was measured, at it or towards the foot, with the number of that branch: all that a branch
    /// carries swings with it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn table<W: Write>(&self, out: W) -> Result<W, WriteError> {
        let own_names = SwayColumns::NAMES.join(",");
        let header = format!(
            "{HEADER},{own_names},nearest_branchID,{},{}",
            nearest_names(),
            NodeKind::MADE_UP_COLUMN
        );
        let mut table = TableWriter::new("qsm.csv", &header, out)?;
        let or_minus_one = |of: Option<usize>| of.map_or(-1.0, |n| n as f64);
        for (id, own) in self.pieces.iter().enumerate() {
            table.count(id as u64);
            table.number(or_minus_one(own.parent), 0);
            for x in own.start.iter().chain(own.end.iter()) {
                table.number(*x, self.decimals);
            }
            for length in [own.radius, own.length, own.growth_length] {
                table.number(length, self.decimals);
            }
            table.text("");
            table.count(own.segment as u64);
            table.number(or_minus_one(own.parent_segment), 0);
            table.count(own.order);
            table.count(own.reverse_order);
            table.count(own.branch as u64);
            table.count(id as u64 + 1);
            table.count(own.parent.map_or(0, |p| p as u64 + 1));
            table.count(own.extension.map_or(0, |e| e as u64 + 1));
            table.number(own.radius, self.decimals);
            table.number(own.volume(), 3 * self.decimals);
            for number in [own.branch, own.segment, own.segment] {
                table.count(number as u64 + 1);
            }
            table.count(own.order + 1);
            for x in own.sway.values() {
                table.number(x, 5);
            }
            let nearest = own.nearest.map(|n| &self.pieces[n]);
            table.number(or_minus_one(nearest.map(|n| n.branch)), 0);
            for x in self.nearest_sway(own).values() {
                table.number(x, 5);
            }
            table.count(u8::from(own.made_up));
            table.end_row()?;
        }
        table.finish()
    }

    /// The treefile: one line for the tree. Its first segment is the foot, each other one ends a
    /// cylinder. Frequencies and damping ratios that are not known are `nan`. Own sway and that of the
    /// nearest measured branch stand beside each other as in [`table`](Self::table).
    pub fn treefile(&self) -> String {
        let (names, nearest) = (SwayColumns::NAMES.join(","), nearest_names());
        let mut text = format!(
            "# tree file: segments end at x,y,z; parents count from 0; z is up\n\
             x,y,z,radius,parent_id,{names},{nearest},{}\n",
            NodeKind::MADE_UP_COLUMN
        );
        let Some(first) = self.pieces.first() else {
            return text;
        };
        let foot = Segment {
            end: first.start,
            radius: first.radius,
            parent: -1,
            sways: [SwayColumns::of(None); 2],
            made_up: false,
        };
        foot.push(&mut text);
        for own in &self.pieces {
            text.push_str(", ");
            let segment = Segment {
                end: own.end,
                radius: own.radius,
                parent: own.parent.map_or(0, |p| p as i64 + 1),
                sways: [own.sway, self.nearest_sway(own)],
                made_up: own.made_up,
            };
            segment.push(&mut text);
        }
        text.push('\n');
        text
    }

    fn nearest_sway(&self, own: &Piece) -> SwayColumns {
        let nearest = own.nearest.map(|n| self.pieces[n].sway);
        nearest.unwrap_or(SwayColumns::of(None))
    }

    /// Sums by order, the trunk's first.
    pub fn by_order(&self) -> Vec<OrderSum> {
        let mut sums: Vec<OrderSum> = Vec::new();
        for own in &self.pieces {
            let order = own.order as usize;
            if sums.len() <= order {
                sums.resize(order + 1, OrderSum::default());
            }
            let begins = own
                .parent
                .is_none_or(|p| self.pieces[p].branch != own.branch);
            sums[order].branches += usize::from(begins);
            sums[order].length += own.length;
            sums[order].volume += own.volume();
        }
        sums
    }
}

impl Piece {
    fn volume(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius * self.length
    }
}

/// The sway of the branch that a node is a part of; none of one that is a rigid part of what carries it.
fn sway_of(
    skeleton: &Skeleton,
    branches: &BotanicalBranches,
    sway: &[Swaying],
    node: NodeId,
) -> SwayColumns {
    let mover = skeleton.mover(node);
    if branches.of(mover) != branches.of(node) {
        return SwayColumns::of(None);
    }
    SwayColumns::of(sway.get(mover.index()).and_then(|s| s.as_ref().ok()))
}

/// The columns of the sway of the nearest measured branch.
fn nearest_names() -> String {
    SwayColumns::NAMES
        .map(|name| format!("nearest_{name}"))
        .join(",")
}

/// A segment of a treefile.
struct Segment {
    end: Point3<f64>,
    radius: f64,
    parent: i64,
    /// Its own, and that of the nearest measured branch.
    sways: [SwayColumns; 2],
    made_up: bool,
}

impl Segment {
    fn push(&self, text: &mut String) {
        let (at, radius, parent) = (&self.end, self.radius, self.parent);
        // Writing to a string does not fail.
        let _ = write!(
            text,
            "{:.DECIMALS$},{:.DECIMALS$},{:.DECIMALS$},{radius:.DECIMALS$},{parent}",
            at.x, at.y, at.z
        );
        for x in self.sways.iter().flat_map(|sway| sway.values()) {
            let _ = match x.is_finite() {
                true => write!(text, ",{x:.5}"),
                false => write!(text, ",nan"),
            };
        }
        let _ = write!(text, ",{}", u8::from(self.made_up));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cylinders_by_branch;
    use crate::model::{Excitation, Interval, Sway, Unidentified};

    /// The forked skeleton, drawn without curls and twigs; its left limb sways.
    fn qsm() -> Qsm {
        swaying(&[(2, 2.0)])
    }

    /// The same with these frequencies of nodes, Hz.
    fn swaying(measured: &[(usize, f64)]) -> Qsm {
        of_tree(Skeleton::forked(), measured)
    }

    fn of_tree(skeleton: Skeleton, measured: &[(usize, f64)]) -> Qsm {
        let plain = crate::config::Wood {
            curl: 0.0,
            max_twigs: 0,
            ..Default::default()
        };
        let limbs = crate::shape::limbs(&skeleton, &|_, _| false, &plain, 0);
        let rows = cylinders_by_branch(&limbs, &skeleton);
        let mut sway = vec![Err(Unidentified::NotMeasured); 4];
        for (node, hz) in measured {
            let frequency_hz = Interval {
                value: *hz,
                lo: 0.95 * hz,
                hi: 1.05 * hz,
            };
            sway[*node] = Ok(Sway {
                frequency_hz,
                damping_ratio: None,
                excitation: Excitation::Release,
                amplitude_deg: 3.0,
            });
        }
        Qsm::new(
            &rows,
            &limbs,
            &skeleton,
            &sway,
            0.01,
            Point3::new(5.0, 6.0, 7.0),
        )
    }

    /// A stem beside the trunk was of order 0 in this table and of 1 in nodes.csv.
    #[test]
    fn orders_are_those_of_the_nodes_also_at_the_foot() {
        let mut skeleton = Skeleton::forked();
        skeleton.nodes[3].parent = Some(NodeId(0));
        let branches = skeleton.botanical_branches();
        let of_nodes = [1, 2, 3].map(|n| branches.order(NodeId(n)));
        assert_eq!(of_nodes, [1, 1, 0]);
        let qsm = of_tree(skeleton, &[]);
        let mut orders: Vec<u32> = qsm.pieces.iter().map(|p| p.order).collect();
        orders.sort_unstable();
        orders.dedup();
        assert_eq!(orders, [0, 1]);
    }

    #[test]
    fn the_table_has_what_both_tools_ask_for() {
        let text = String::from_utf8(qsm().table(Vec::new()).expect("written")).expect("text");
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let header = reader.headers().expect("header").clone();
        let column = |name: &str| {
            header
                .iter()
                .position(|h| h == name)
                .unwrap_or_else(|| panic!("{name}"))
        };
        let rows: Vec<csv::StringRecord> = reader.records().map(|r| r.expect("row")).collect();
        let cell = |row: usize, name: &str| rows[row][column(name)].to_owned();
        assert_eq!(
            [cell(0, "parentID"), cell(0, "parent_ID"), cell(0, "cyl_ID")],
            ["-1", "0", "1"]
        );
        assert_eq!(
            [cell(0, "startX"), cell(0, "startY"), cell(0, "startZ")],
            ["5", "6", "7"]
        );
        assert_eq!(cell(0, "segmentID"), "0");
        assert_eq!(cell(0, "reverseBranchOrder"), "2");
        let swaying = rows
            .iter()
            .filter(|row| row[column("frequency_hz")] == *"2")
            .count();
        assert!(swaying > 0 && swaying < rows.len() / 2, "{swaying}");
        let growth: f64 = cell(0, "growthLength").parse().expect("number");
        let lengths = rows
            .iter()
            .map(|row| row[column("length")].parse::<f64>().expect("number"));
        assert!((growth - lengths.sum::<f64>()).abs() < 0.01);
    }

    /// A branch tapers, and is thinned only where it lies within what carries it.
    #[test]
    fn a_branch_is_as_thick_as_it_is_drawn() {
        let qsm = qsm();
        let (limbs, pieces) = (qsm.pieces.iter().filter(|p| p.branch == 1), &qsm.pieces);
        let radii: Vec<f64> = limbs.map(|p| p.radius).collect();
        assert!(
            radii.len() > 3 && radii[0] > 1.2 * radii[radii.len() - 1],
            "{radii:?}"
        );
        assert!(radii.windows(2).all(|r| r[0] >= r[1]), "{radii:?}");
        assert!(pieces[0].radius >= radii[0]);
    }

    /// The left limb is a rigid part of the trunk: it has no sway of its own, and swings with that.
    #[test]
    fn what_rides_on_a_measured_branch_was_not_measured() {
        let mut skeleton = Skeleton::forked();
        skeleton.nodes[2].moves_with = Some(NodeId(1));
        let rides_on = skeleton.botanical_branches();
        let is_apart = rides_on.of(NodeId(2)) != rides_on.of(NodeId(1));
        let rider = if is_apart { 2 } else { 3 };
        skeleton.nodes[2].moves_with = None;
        skeleton.nodes[rider].moves_with = Some(NodeId(1));
        let qsm = of_tree(skeleton, &[(1, 0.5)]);
        let side = qsm.pieces.iter().filter(|p| p.branch == 1);
        for own in side {
            assert!(own.sway.frequency().is_none());
            let nearest = own.nearest.map(|n| &qsm.pieces[n]).expect("the trunk");
            assert_eq!((nearest.branch, nearest.sway.frequency_hz), (0, 0.5));
        }
        assert!(qsm.pieces.iter().any(|p| p.branch == 1));
    }

    #[test]
    fn all_that_a_measured_branch_carries_has_its_frequency() {
        for (measured, trunk_hz) in [(vec![(2, 2.0)], ""), (vec![(1, 0.5), (2, 2.0)], "0.5")] {
            let qsm = swaying(&measured);
            let text = String::from_utf8(qsm.table(Vec::new()).expect("written")).expect("text");
            let mut reader = csv::Reader::from_reader(text.as_bytes());
            let header = reader.headers().expect("header").clone();
            let at = |name: &str| header.iter().position(|h| h == name).expect("column");
            let [own, nearest, branch, of] = [
                at("frequency_hz"),
                at("nearest_frequency_hz"),
                at("branchID"),
                at("nearest_branchID"),
            ];
            for row in reader.records().map(|r| r.expect("row")) {
                let wanted = if row[own].is_empty() {
                    trunk_hz
                } else {
                    &row[own]
                };
                assert_eq!(&row[nearest], wanted, "{row:?}");
                match (&row[own], trunk_hz) {
                    ("", "") => assert_eq!(&row[of], "-1"),
                    ("", _) => assert_eq!(&row[of], "0"),
                    _ => assert_eq!(&row[of], &row[branch]),
                }
            }
        }
    }

    #[test]
    fn the_treefile_and_the_table_are_read_as_the_same_tree() {
        let qsm = qsm();
        let treefile = qsm.treefile();
        assert!(
            treefile.contains(",2.00000,1.90000,2.10000,nan"),
            "{treefile}"
        );
        let sums = qsm.by_order();
        assert_eq!(sums.iter().map(|s| s.branches).collect::<Vec<_>>(), [1, 1]);
        assert!(
            sums[0].volume > sums[1].volume && sums[0].length > 1.8,
            "{sums:?}"
        );
    }
}
