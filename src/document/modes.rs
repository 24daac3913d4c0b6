//! `modes.csv`: the modes of the whole tree, written and read.

use super::error::DocumentError;
use super::number;
use super::sway;
use super::table::{TableReader, TableWriter};
use crate::files::WriteError;
use crate::model::{ModeSummary, NodeId, Skeleton, Sway, SwayColumns, TreeMode};
use std::io::{Read, Write};
use std::ops::Range;
use std::path::Path;

/// Name of the file.
pub const MODES_FILE: &str = "modes.csv";
/// The columns that are read, first [`SwayColumns::NAMES`]; `branch` and `energy` follow from them.
const COLUMNS: [&str; 11] = {
    let [f, f_lo, f_hi, d, d_lo, d_hi] = SwayColumns::NAMES;
    [
        f,
        f_lo,
        f_hi,
        d,
        d_lo,
        d_hi,
        "excitation",
        "amplitude_deg",
        "collinearity",
        "n_points",
        "node_id",
    ]
};
/// A file that was written before there was this column lacks it.
const MOTION: &str = "motion_px2";
/// A table of more modes than this is none of ours: a mode has four points or more.
const MOST_MODES: usize = 10_000;

/// Squares of motion that are written and read: no tree moves farther.
const MOTIONS_PX2: Range<f64> = 0.0..1e12;

/// The first line of `modes.csv`.
fn header() -> String {
    format!("mode,{},branch,energy,{MOTION}", COLUMNS.join(","))
}

/// Writes `modes.csv`, the slowest mode first. `energy` names trunk and limbs with their shares of
/// the mode's kinetic energy, the largest first: `limb_1 0.71; trunk 0.29`; `motion_px2` the nodes
/// by their numbers, with the squares of the swing of the points on them: `3 12.5; 7 0.41`.
///
/// # Errors
/// The file cannot be written.
pub fn modes<W: Write>(out: W, skeleton: &Skeleton, modes: &[TreeMode]) -> Result<W, WriteError> {
    let mut table = TableWriter::new(MODES_FILE, &header(), out)?;
    for (mode, summary) in modes.iter().zip(ModeSummary::all(modes, skeleton)) {
        table.count(summary.mode as u64);
        for value in SwayColumns::of(Some(&summary.sway)).values() {
            table.number(value, 5);
        }
        table.text(summary.sway.excitation.word());
        table.number(summary.sway.amplitude_deg, 4);
        table.number(summary.collinearity.unwrap_or(f64::NAN), 3);
        table.count(summary.points as u64);
        table.id(summary.node);
        table.text(summary.branch.as_deref().unwrap_or_default());
        table.text(&summary.energy_words(usize::MAX));
        table.text(&motion(mode, skeleton));
        table.end_row()?;
    }
    table.finish()
}

/// The nodes that move in a mode, with the squares of their motion.
fn motion(mode: &TreeMode, skeleton: &Skeleton) -> String {
    let mut words = Vec::new();
    let by_node = skeleton.nodes.iter().zip(&mode.motion_px2);
    for (node, px2) in by_node.filter(|(_, px2)| MOTIONS_PX2.contains(px2)) {
        let px2 = number::text(*px2, 6);
        if !px2.is_empty() && px2 != "0" {
            words.push(format!("{} {px2}", node.name.0));
        }
    }
    words.join("; ")
}

/// Reads the modes of the document in `dir`; none where it lacks the table, as one does whose tree
/// was not filmed.
///
/// # Errors
/// As of [`read_from`].
pub(super) fn read(dir: &Path, skeleton: &Skeleton) -> Result<Vec<TreeMode>, DocumentError> {
    match TableReader::open(dir, MODES_FILE, COLUMNS) {
        Ok(table) => rows(table, skeleton),
        Err(DocumentError::Missing { .. }) => Ok(Vec::new()),
        Err(e) => Err(e),
    }
}

/// The same from the bytes of a table.
///
/// # Errors
/// The table is damaged: a frequency lies outside of its interval, or a number is none.
pub(super) fn read_from(bytes: &[u8], skeleton: &Skeleton) -> Result<Vec<TreeMode>, DocumentError> {
    rows(
        TableReader::new(MODES_FILE.into(), bytes, COLUMNS)?,
        skeleton,
    )
}

fn rows<R: Read>(
    mut table: TableReader<R, { COLUMNS.len() }>,
    skeleton: &Skeleton,
) -> Result<Vec<TreeMode>, DocumentError> {
    let motion = table.optional(MOTION);
    let mut modes = Vec::new();
    while table.next()? {
        if modes.len() >= MOST_MODES {
            return Err(table.bad(format!("there are more than {MOST_MODES} modes")));
        }
        let read = ModeCells {
            sway: std::array::from_fn(|i| table.cell(i)),
            collinearity: table.cell(8),
            node: table.cell(10),
            motion: table.optional_cell(motion),
        };
        let points = table.whole(9, "n_points")?;
        modes.push(
            read.mode(points, skeleton)
                .map_err(|what| table.bad(what))?,
        );
    }
    Ok(modes)
}

/// The cells of a row.
struct ModeCells<'a> {
    /// Those from `frequency_hz` to `amplitude_deg`.
    sway: [&'a str; 8],
    collinearity: &'a str,
    node: &'a str,
    motion: &'a str,
}

impl ModeCells<'_> {
    fn mode(&self, points: usize, skeleton: &Skeleton) -> Result<TreeMode, String> {
        let node = match self.node {
            "" => None,
            name => measured(name, skeleton)?,
        };
        Ok(TreeMode {
            sway: self.sway()?,
            collinearity: self.collinearity()?,
            node,
            is_trunks: false,
            points,
            motion_px2: self.motion_px2(skeleton)?,
        })
    }

    fn sway(&self) -> Result<Sway, String> {
        let [f, f_lo, f_hi, d, d_lo, d_hi, excitation, amplitude] = self.sway;
        let cells = [f, f_lo, f_hi, d, d_lo, d_hi, "", excitation, amplitude, ""];
        sway::read(cells)?.map_err(|_| {
            format!("frequency_hz is {f:?} ({f_lo:?} to {f_hi:?}), and must be a value above 0 in its interval")
        })
    }

    fn collinearity(&self) -> Result<Option<f64>, String> {
        if self.collinearity.is_empty() {
            return Ok(None);
        }
        let share = self.collinearity.parse().ok();
        match share.filter(|x: &f64| (0.0..=1.0).contains(x)) {
            Some(share) => Ok(Some(share)),
            None => Err(format!(
                "collinearity is {:?}, and must be 0 to 1",
                self.collinearity
            )),
        }
    }

    /// By measured node; nothing for no node.
    fn motion_px2(&self, skeleton: &Skeleton) -> Result<Vec<f64>, String> {
        let mut all = Vec::new();
        for pair in self.motion.split("; ").filter(|pair| !pair.is_empty()) {
            let (name, px2) = pair.split_once(' ').unwrap_or((pair, ""));
            let node = measured(name, skeleton)?;
            let px2 = px2.parse().ok();
            let px2 = px2.filter(|x| MOTIONS_PX2.contains(x));
            let px2 = px2.ok_or_else(|| {
                format!("{MOTION} has {pair:?}, and must have a node and a square of px")
            })?;
            if let Some(node) = node {
                all.resize(skeleton.measured(), 0.0);
                all[node.index()] = px2;
            }
        }
        Ok(all)
    }
}

/// The measured node that a table calls `name`; `None` for one that the tree lacks, as one has that
/// was cut out of `nodes.csv`.
fn measured(name: &str, skeleton: &Skeleton) -> Result<Option<NodeId>, String> {
    let number: u32 = name
        .parse()
        .map_err(|_| format!("a node is {name:?}, and must be a number of nodes.csv"))?;
    let mut nodes = skeleton.nodes[..skeleton.measured()].iter();
    let place = nodes.position(|node| node.name.0 == number);
    Ok(place.map(|place| NodeId(place as u32)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Excitation, Interval, Sway};

    fn interval(value: f64) -> Interval {
        Interval {
            value,
            lo: (0.98e5 * value).round() / 1e5,
            hi: (1.02e5 * value).round() / 1e5,
        }
    }

    /// One of a limb, and one of a branch that the tree lacks.
    fn two_modes() -> [TreeMode; 2] {
        let mode = TreeMode {
            sway: Sway {
                frequency_hz: interval(0.7),
                damping_ratio: Some(interval(0.04)),
                excitation: Excitation::Wind,
                amplitude_deg: 2.5,
            },
            collinearity: Some(0.97),
            node: Some(NodeId(2)),
            is_trunks: false,
            points: 9,
            motion_px2: vec![0.0, 25.0, 75.0, 0.0],
        };
        let lacked = TreeMode {
            collinearity: None,
            node: None,
            motion_px2: Vec::new(),
            ..mode.clone()
        };
        [mode, lacked]
    }

    #[test]
    fn a_mode_is_a_row_with_the_energy_of_the_limbs() {
        let text = modes(Vec::new(), &Skeleton::forked(), &two_modes()).expect("written");
        let text = String::from_utf8(text).expect("text");
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(
            rows[0],
            "mode,frequency_hz,frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,damping_hi,\
             excitation,amplitude_deg,collinearity,n_points,node_id,branch,energy,motion_px2"
        );
        assert_eq!(
            rows[1],
            "1,0.7,0.686,0.714,0.04,0.0392,0.0408,wind,2.5,0.97,9,12,limb_1,limb_1 0.75; trunk 0.25,11 25; 12 75"
        );
        assert_eq!(
            rows[2],
            "2,0.7,0.686,0.714,0.04,0.0392,0.0408,wind,2.5,,9,,,,"
        );
    }

    /// Twice: what is written is what was read.
    #[test]
    fn a_table_is_read_back_as_it_was_written() {
        let skeleton = Skeleton::forked();
        let text = modes(Vec::new(), &skeleton, &two_modes()).expect("written");
        let back = read_from(&text, &skeleton).expect("read");
        assert_eq!(back, two_modes());
        assert_eq!(modes(Vec::new(), &skeleton, &back).expect("written"), text);
    }

    #[test]
    fn a_table_without_the_motion_of_its_nodes_is_read_too() {
        let old = "frequency_hz,frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,damping_hi,\
                   excitation,amplitude_deg,collinearity,n_points,node_id\n\
                   0.7,0.69,0.71,,,,release,,,5,\n";
        let back = read_from(old.as_bytes(), &Skeleton::forked()).expect("read");
        assert_eq!(back.len(), 1);
        assert_eq!((back[0].points, back[0].node), (5, None));
        assert!(back[0].sway.damping_ratio.is_none() && back[0].motion_px2.is_empty());
    }

    #[test]
    fn the_branch_of_a_node_that_was_cut_out_is_lacked() {
        let text = modes(Vec::new(), &Skeleton::forked(), &two_modes()).expect("written");
        let mut cut = Skeleton::forked();
        cut.nodes.truncate(2);
        let back = read_from(&text, &cut).expect("read");
        assert_eq!(back[0].node, None);
        assert_eq!(back[0].motion_px2, [0.0, 25.0]);
    }

    #[test]
    fn a_damaged_table_is_refused_with_its_line() {
        let good =
            "1,0.7,0.6,0.8,0.04,0.03,0.05,wind,2.5,0.97,9,12,limb_1,limb_1 1.00,11 25; 12 75";
        let cases = [
            ("0.7,0.6", "0.7,0.75", "frequency_hz is \"0.7\""),
            ("0.7,0.6", ",0.6", "frequency_hz is \"\""),
            ("wind", "storm", "excitation is \"storm\""),
            ("0.97", "1.97", "collinearity is \"1.97\""),
            (",9,", ",-9,", "n_points is \"-9\""),
            ("9,12,", "9,two,", "a node is \"two\""),
            ("11 25", "-1 25", "a node is \"-1\""),
            ("11 25", "11", "motion_px2 has \"11\""),
            ("11 25", "11 -25", "motion_px2 has \"11 -25\""),
            ("11 25", "11 inf", "motion_px2 has \"11 inf\""),
        ];
        let table = |row: &str| {
            read_from(
                format!("{}\n{row}\n", header()).as_bytes(),
                &Skeleton::forked(),
            )
        };
        assert!(table(good).is_ok());
        for (from, to, what) in cases {
            let error = table(&good.replacen(from, to, 1)).expect_err(what);
            let error = error.to_string();
            assert!(error.contains(what), "{error}");
            assert!(error.contains("modes.csv, line 2"), "{error}");
        }
    }
}
