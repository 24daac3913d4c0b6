//! `modes.csv`: the modes of the whole tree.

use super::sway::Columns;
use super::table::TableWriter;
use crate::files::WriteError;
use crate::model::{BotanicalBranches, NodeId, Skeleton, TreeMode};
use std::collections::BTreeMap;
use std::io::Write;

/// Name of the file.
pub const MODES_FILE: &str = "modes.csv";
const HEADER: &str = "mode,frequency_hz,frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,\
damping_hi,excitation,amplitude_deg,collinearity,n_points,node_id,branch,energy";
/// A limb with less of a mode's energy is not named.
const LEAST_ENERGY: f64 = 0.005;

/// Writes `modes.csv`, the slowest mode first. `energy` names trunk and limbs with their shares of
/// the mode's kinetic energy, the largest first: `limb_1 0.71; trunk 0.29`.
///
/// # Errors
/// The file cannot be written.
pub fn modes<W: Write>(out: W, skeleton: &Skeleton, modes: &[TreeMode]) -> Result<W, WriteError> {
    let mut table = TableWriter::new(MODES_FILE, HEADER, out)?;
    let branches = skeleton.botanical_branches();
    for (number, mode) in modes.iter().enumerate() {
        table.count(number as u64 + 1);
        for value in Columns::of(&Ok(mode.sway)).values() {
            table.number(value, 5);
        }
        table.text(mode.sway.excitation.word());
        table.number(mode.sway.amplitude_deg, 4);
        match mode.collinearity {
            Some(collinearity) => table.number(collinearity, 3),
            None => table.text(""),
        }
        table.count(mode.points as u64);
        table.id(mode.node.and_then(|node| skeleton.name_of(node)));
        table.text(&mode.node.map_or(String::new(), |node| branches.name(node)));
        table.text(&energy(&branches, mode));
        table.end_row()?;
    }
    table.finish()
}

/// Shares of a mode's energy by limb, with all that it carries.
fn energy(branches: &BotanicalBranches, mode: &TreeMode) -> String {
    let mut by_limb: BTreeMap<usize, f64> = BTreeMap::new();
    for node in (0..mode.motion_px2.len() as u32).map(NodeId) {
        let mut limb = branches.of(node);
        while let Some(carrier) = branches.all[limb].carrier.filter(|c| *c != 0) {
            limb = carrier;
        }
        *by_limb.entry(limb).or_default() += mode.energy(node);
    }
    let mut shares: Vec<(usize, f64)> = by_limb.into_iter().collect();
    shares.retain(|(_, share)| *share >= LEAST_ENERGY);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut words = Vec::with_capacity(shares.len());
    for (limb, share) in shares {
        let name = branches.all[limb].nodes.last().map(|n| branches.name(*n));
        words.push(format!("{} {share:.2}", name.unwrap_or_default()));
    }
    words.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Excitation, Interval, Node, Size, Sway};

    fn interval(value: f64) -> Interval {
        Interval {
            value,
            lo: 0.98 * value,
            hi: 1.02 * value,
        }
    }

    /// A trunk that forks into two limbs.
    fn forked() -> Skeleton {
        let at = [
            [0.0, 0.0, 0.0],
            [0.0, 100.0, 0.0],
            [-40.0, 160.0, 0.0],
            [5.0, 190.0, 0.0],
        ];
        let parents = [None, Some(0), Some(1), Some(1)];
        let mut nodes = Vec::new();
        for (i, (at, parent)) in at.into_iter().zip(parents).enumerate() {
            nodes.push(Node {
                level: [0, 1, 2, 2][i],
                ..Node::made_up(i as u32, parent, at)
            });
        }
        Skeleton {
            nodes,
            foot_px: [320.0, 300.0].into(),
            image_size: Size {
                width: 640,
                height: 360,
            },
        }
    }

    #[test]
    fn a_mode_is_a_row_with_the_energy_of_the_limbs() {
        let mode = TreeMode {
            sway: Sway {
                frequency_hz: interval(0.7),
                damping_ratio: Some(interval(0.04)),
                excitation: Excitation::Wind,
                amplitude_deg: 2.5,
            },
            collinearity: Some(0.97),
            node: Some(NodeId(2)),
            points: 9,
            motion_px2: vec![0.0, 25.0, 75.0, 0.0],
        };
        let lacked = TreeMode {
            collinearity: None,
            node: None,
            motion_px2: Vec::new(),
            ..mode.clone()
        };
        let text = modes(Vec::new(), &forked(), &[mode, lacked]).expect("written");
        let text = String::from_utf8(text).expect("text");
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows[0], HEADER);
        assert_eq!(
            rows[1],
            "1,0.7,0.686,0.714,0.04,0.0392,0.0408,wind,2.5,0.97,9,2,limb_1,limb_1 0.75; trunk 0.25"
        );
        assert_eq!(
            rows[2],
            "2,0.7,0.686,0.714,0.04,0.0392,0.0408,wind,2.5,,9,,,"
        );
    }
}
