//! Captures as one tidy table for statistics: a row for each capture and branch, a column for each
//! variable, CSV.

use super::compare::{Comparison, log_change};
use super::matching::Match;
use super::study::{Branch, Study};
use crate::document::TableWriter;
use crate::files::WriteError;
use crate::model::{Interval, Sway, SwayColumns, Unidentified};
use std::collections::{BTreeMap, BTreeSet};

/// The columns before the user's notes, and those after them, before and after frequency and
/// damping.
const BEFORE_NOTES: &str = "tree_branch,capture,captured_at";
const BEFORE_SWAY: &str = "level,order,points,matched_by,off,excitation";
const AFTER_SWAY: &str = "amplitude_deg,amplitude_px,amplitude_m,unidentified,\
                          frequency_to_first,frequency_to_first_lo,frequency_to_first_hi,\
                          damping_to_first,damping_to_first_lo,damping_to_first_hi,\
                          spectrum_peak_hz,half_power_damping";
/// The columns that say which branch a row is of.
pub(super) const BRANCH_COLUMNS: &str = "node_id,branch,parent_id";
/// What a note's column begins with, so that no note is taken for a column of ours.
const NOTE: &str = "note_";

/// The table as bytes; what is not known is an empty cell. `comparison` is `None` for one capture.
///
/// # Errors
/// Memory cannot be had.
pub fn csv(studies: &[Study], comparison: Option<&Comparison>) -> Result<Vec<u8>, WriteError> {
    let keys: BTreeSet<&str> = studies.iter().flat_map(note_keys).collect();
    let notes = keys.iter().map(|key| format!(",{NOTE}{key}"));
    let notes: String = notes.collect();
    let sway = SwayColumns::NAMES.join(",");
    let header =
        format!("{BEFORE_NOTES}{notes},{BRANCH_COLUMNS},{BEFORE_SWAY},{sway},{AFTER_SWAY}");
    let mut table = TableWriter::new("the table", &header, Vec::new())?;
    let tree = TreeBranches::of(studies, comparison);
    for (k, study) in studies.iter().enumerate() {
        for (j, branch) in study.branches.iter().enumerate() {
            let id = tree.ids[k][j];
            table.count(id);
            table.text(&study.name);
            let captured_at = study.origin.captured_at.map(|at| at.to_string());
            table.text(&captured_at.unwrap_or_default());
            for key in &keys {
                table.text(study.origin.notes.get(key).unwrap_or_default());
            }
            let first = tree.first_sway(studies, id).filter(|_| k > 0);
            push_branch(&mut table, study, branch, tree.matches[k][j]);
            push_sway(&mut table, study, branch);
            push_changes(&mut table, first, branch.known());
            let reference = branch.reference;
            table.number(reference.map_or(f64::NAN, |r| r.peak_hz), 4);
            table.number(reference.map_or(f64::NAN, |r| r.damping_ratio), 4);
            table.end_row()?;
        }
    }
    table.finish()
}

fn note_keys(study: &Study) -> impl Iterator<Item = &str> {
    study.origin.notes.iter().map(|(key, _)| key)
}

/// Which branch of the tree every branch of every capture is.
struct TreeBranches {
    /// By capture and branch: the number of the tree's branch, and by what it was known again.
    ids: Vec<Vec<u32>>,
    matches: Vec<Vec<Option<Match>>>,
}

impl TreeBranches {
    /// Numbers from 1 on, in the order of the table. A branch in no row of the comparison has a
    /// number of its own.
    fn of(studies: &[Study], comparison: Option<&Comparison>) -> Self {
        let rows = comparison.map_or(&[][..], |c| &c.rows[..]);
        let mut row_of: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for (r, row) in rows.iter().enumerate() {
            let seen = row.matches.iter().enumerate();
            row_of.extend(seen.filter_map(|(k, m)| Some(((k, m.branch()?), r))));
        }
        let mut id_of_row: BTreeMap<usize, u32> = BTreeMap::new();
        let mut last = 0;
        let (mut ids, mut matches) = (Vec::new(), Vec::new());
        for (k, study) in studies.iter().enumerate() {
            let (mut own_ids, mut own_matches) = (Vec::new(), Vec::new());
            for j in 0..study.branches.len() {
                let row = row_of.get(&(k, j)).copied();
                let known = row.and_then(|r| id_of_row.get(&r).copied());
                let id = known.unwrap_or(last + 1);
                last = last.max(id);
                if let Some(r) = row {
                    id_of_row.insert(r, id);
                }
                own_ids.push(id);
                own_matches.push(row.map(|r| rows[r].matches[k]));
            }
            ids.push(own_ids);
            matches.push(own_matches);
        }
        Self { ids, matches }
    }

    /// How a branch of the tree sways by the first capture.
    fn first_sway(&self, studies: &[Study], id: u32) -> Option<Sway> {
        let branch = self.ids.first()?.iter().position(|own| *own == id)?;
        studies.first()?.branches.get(branch)?.known()
    }
}

/// The cells of [`BRANCH_COLUMNS`].
pub(super) fn push_name(table: &mut TableWriter<Vec<u8>>, branch: &Branch) {
    table.count(branch.name);
    table.text(&branch.piece);
    match branch.parent {
        Some(parent) => table.count(parent),
        None => table.text(""),
    }
}

/// Which branch it is, and by what it was known again.
fn push_branch(
    table: &mut TableWriter<Vec<u8>>,
    study: &Study,
    branch: &Branch,
    found: Option<Match>,
) {
    push_name(table, branch);
    table.count(branch.level);
    table.count(branch.order);
    table.count(branch.points);
    let is_trunk = study.trunk().and_then(|j| study.branches.get(j));
    let is_trunk = is_trunk.is_some_and(|trunk| trunk.name == branch.name);
    let (by, off) = match found {
        Some(Match::Found { by, off, .. }) => (by.word(), off),
        _ if is_trunk => ("trunk", f64::NAN),
        _ => ("none", f64::NAN),
    };
    table.text(by);
    table.number(off, 4);
}

/// Frequency, damping and amplitude, or why there are none.
fn push_sway(table: &mut TableWriter<Vec<u8>>, study: &Study, branch: &Branch) {
    let sway = branch.known();
    let excitation = study.onset.map(|onset| onset.excitation.word());
    table.text(excitation.unwrap_or_default());
    push_interval(table, sway.map(|s| s.frequency_hz));
    push_interval(table, sway.and_then(|s| s.damping_ratio));
    table.number(branch.amplitude_deg, 3);
    table.number(branch.amplitude_px(), 3);
    if study.metres_per_px > 0.0 {
        table.number(branch.amplitude_px() * study.metres_per_px, 5);
    } else {
        table.text("");
    }
    table.text(branch.sway.err().map_or("", Unidentified::word));
}

/// Frequency and damping over those of the first capture.
fn push_changes(table: &mut TableWriter<Vec<u8>>, first: Option<Sway>, here: Option<Sway>) {
    let both = first.zip(here);
    push_interval(
        table,
        both.and_then(|(a, b)| ratio(&a.frequency_hz, &b.frequency_hz)),
    );
    let dampings = both.and_then(|(a, b)| a.damping_ratio.zip(b.damping_ratio));
    push_interval(table, dampings.and_then(|(a, b)| ratio(&a, &b)));
}

/// The second value over the first, with its 95 % interval.
fn ratio(a: &Interval, b: &Interval) -> Option<Interval> {
    let (log, half) = log_change(a, b)?;
    let [value, lo, hi] = [log, log - half, log + half].map(f64::exp);
    Some(Interval { value, lo, hi })
}

fn push_interval(table: &mut TableWriter<Vec<u8>>, of: Option<Interval>) {
    let of = of.map_or([f64::NAN; 3], |i| [i.value, i.lo, i.hi]);
    for x in of {
        table.number(x, 6);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::compare::compare;
    use crate::report::tests::{TREE, set_frequency, study};

    /// The rows of the table, each by the names of its columns.
    fn rows(studies: &[Study], same_tree: Option<bool>) -> Vec<BTreeMap<String, String>> {
        let bytes = csv(studies, compare(studies, same_tree).as_ref()).unwrap();
        let mut reader = csv::Reader::from_reader(&bytes[..]);
        reader.deserialize().map(Result::unwrap).collect()
    }

    fn column(rows: &[BTreeMap<String, String>], name: &str) -> Vec<String> {
        rows.iter().map(|row| row[name].clone()).collect()
    }

    /// Two captures of one tree, the second with a branch more and one without an answer.
    fn studies() -> [Study; 2] {
        let [mut first, mut second] = [study(&TREE[..5]), study(&TREE)];
        first.name = "calm, \"2 Bft\"".into();
        second.name = "storm".into();
        second
            .origin
            .notes
            .put("wind=7, gusts".parse().unwrap())
            .unwrap();
        set_frequency(&mut first, 0, 0.5);
        set_frequency(&mut second, 0, 0.6);
        set_frequency(&mut second, 5, 2.0);
        [first, second]
    }

    #[test]
    fn a_row_for_each_capture_and_branch_and_the_same_number_for_the_same_branch() {
        let rows = rows(&studies(), Some(true));
        let expected = ["1", "2", "3", "4", "5", "1", "2", "3", "4", "5", "6"];
        assert_eq!(column(&rows, "tree_branch"), expected);
        assert_eq!(
            column(&rows, "matched_by")[4..],
            ["none", "trunk", "place", "place", "place", "place", "none"]
        );
        assert_eq!(rows[0]["capture"], "calm, \"2 Bft\"");
        assert_eq!(
            [&rows[0], &rows[5]].map(|r| &*r["note_wind"]),
            ["", "7, gusts"]
        );
    }

    #[test]
    fn frequencies_stand_beside_those_of_the_first_capture() {
        let rows = rows(&studies(), Some(true));
        let ratio =
            ["", "_lo", "_hi"].map(|end| rows[5][&format!("frequency_to_first{end}")].clone());
        // Two intervals of 1 % either way.
        let half = 0.01 * 2.0_f64.sqrt();
        let expected = [0.0, -half, half].map(|x| format!("{:.6}", 1.2 * x.exp()));
        assert_eq!(
            ratio,
            [&"1.2".to_owned(), &expected[1], &expected[2]].map(String::clone)
        );
        // There is nothing to compare a first capture, a new branch or one without answer with.
        for row in [0, 6, 10] {
            assert_eq!(rows[row]["frequency_to_first"], "");
        }
        assert_eq!(
            (&*rows[10]["frequency_hz"], &*rows[10]["unidentified"]),
            ("2", "")
        );
        assert_eq!(
            (&*rows[6]["frequency_hz"], &*rows[6]["unidentified"]),
            ("", "too_short")
        );
    }

    #[test]
    fn one_capture_and_captures_of_different_trees_have_their_own_branches() {
        let one = rows(&studies()[..1], None);
        assert_eq!(column(&one, "tree_branch"), ["1", "2", "3", "4", "5"]);
        assert_eq!(column(&one, "matched_by")[..2], ["trunk", "none"]);
        let two = rows(&studies(), Some(false));
        assert_eq!(
            column(&two, "tree_branch")[5..],
            ["1", "6", "7", "8", "9", "10"]
        );
    }
}
