//! Several captures beside each other, as text.

use crate::model::Sway;
use crate::report::columns::{Table, wrapped};
use crate::report::compare::{Change, Comparison, Row};
use crate::report::matching::Match;
use crate::report::study::{Branch, Study};
use crate::report::values::{changed, interval};

/// What the captures have in common and where they differ; on a narrow terminal frequency and
/// damping under each other.
pub fn compared(studies: &[Study], comparison: &Comparison, columns: Option<usize>) -> String {
    let mut out = wrapped(&format!("{}\n", heading(studies, comparison)), columns);
    if comparison.same_tree.is_none() {
        return out;
    }
    out.push('\n');
    let (told, untold): (Vec<&Row>, Vec<&Row>) = comparison
        .rows_of_first()
        .partition(|row| row.is_told(studies));
    let mut rows = Vec::with_capacity(told.len() * studies.len());
    for row in told {
        rows.extend((0..studies.len()).map(|k| (row, k)));
    }
    let whole = whole_table(studies, &rows);
    if columns.is_none_or(|most| whole.lines().all(|line| line.chars().count() <= most)) {
        out += &whole;
    } else {
        out += &two_tables(studies, &rows, columns);
    }
    let mut notes = String::new();
    if !untold.is_empty() {
        let untold: Vec<String> = untold.iter().map(|row| row.called(studies)).collect();
        notes += &format!(
            "  without a frequency in any of them: {}\n",
            untold.join(", ")
        );
    }
    if comparison.same_tree == Some(true) {
        notes.extend((1..studies.len()).map(|k| unmatched(studies, comparison, k - 1)));
    }
    notes += "  * beyond what both 95 % intervals allow; of twenty branches that do not differ, chance marks one\n";
    out + &wrapped(&notes, columns)
}

/// Frequency and damping beside each other; `rows` are branches and numbers of captures.
fn whole_table(studies: &[Study], rows: &[(&Row, usize)]) -> String {
    let first = &studies[0].name;
    let [frequency, damping] =
        ["frequency", "damping"].map(|what| format!("{what} against {first}"));
    let mut table = Table::new(&[
        ("branch", 0),
        ("capture", 0),
        ("called", 0),
        ("frequency, Hz", 0),
        ("damping ratio", 0),
        (&frequency, 0),
        (&damping, 0),
    ]);
    for (row, k) in rows {
        table.push(across(studies, row, *k, &[frequency_of, damping_of]));
    }
    table.within(None).0
}

/// Frequency and damping under each other.
fn two_tables(studies: &[Study], rows: &[(&Row, usize)], columns: Option<usize>) -> String {
    let against = format!("against {}", studies[0].name);
    let values = [
        ("frequency, Hz", frequency_of as Value),
        ("damping ratio", damping_of),
    ];
    let mut out = String::new();
    for (head, of) in values {
        let mut table = Table::new(&[
            ("branch", 0),
            ("capture", 0),
            ("called", 1),
            (head, 0),
            (&against, 0),
        ]);
        for (row, k) in rows {
            table.push(across(studies, row, *k, &[of]));
        }
        out += &format!("{}\n", table.within(columns).0);
    }
    out
}

/// What is compared, and by which right; or why nothing is.
pub fn heading(studies: &[Study], comparison: &Comparison) -> String {
    let shares: Vec<String> = comparison
        .shares
        .iter()
        .zip(&studies[1..])
        .map(|(share, s)| format!("{:.0} % in {}", 100.0 * share, s.name))
        .collect();
    let found = format!("branches found in the same place: {}", shares.join(", "));
    let what = match comparison.same_tree {
        Some(true) => "one tree",
        Some(false) => "several trees, by their trunks",
        None => {
            return format!(
                "Not compared with {}: these may be films of one tree or of several ({found}); say \
                 which with --trees same or --trees different",
                studies[0].name
            );
        }
    };
    let by = if comparison.said {
        "as --trees says"
    } else {
        "judged by places and frequencies of their branches, which --trees overrides"
    };
    format!(
        "Compared with {} as {what} ({by}; {found})",
        studies[0].name
    )
}

/// A value as a cell, and how it differs from that of the first capture.
type Value = fn(&Sway, Option<&Sway>) -> (String, Option<Change>);

fn frequency_of(sway: &Sway, first: Option<&Sway>) -> (String, Option<Change>) {
    (
        interval(&sway.frequency_hz, 3),
        first.and_then(|first| Change::of_frequency(first, sway)),
    )
}

fn damping_of(sway: &Sway, first: Option<&Sway>) -> (String, Option<Change>) {
    let value = sway
        .damping_ratio
        .map_or("unknown".into(), |d| interval(&d, 3));
    (
        value,
        first.and_then(|first| Change::of_damping(first, sway)),
    )
}

/// A branch in capture `k`: its values, and then all their changes.
fn across(studies: &[Study], row: &Row, k: usize, values: &[Value]) -> Vec<String> {
    let mut cells = vec![
        if k == 0 {
            row.called(studies)
        } else {
            String::new()
        },
        studies[k].name.clone(),
    ];
    let Some(branch) = row.branch(studies, k) else {
        cells.extend(["-".into(), format!("  {}", lost(row, k))]);
        return cells;
    };
    cells.push(branch.called());
    let sway = match branch.sway {
        Ok(sway) => sway,
        Err(why) => {
            cells.push(format!("  none: {why}"));
            return cells;
        }
    };
    let first = row.sway(studies, 0).filter(|_| k > 0);
    let (shown, changes): (Vec<String>, Vec<Option<Change>>) =
        values.iter().map(|of| of(&sway, first.as_ref())).unzip();
    cells.extend(shown);
    cells.extend(
        changes
            .iter()
            .map(|change| change.as_ref().map_or("-".into(), changed)),
    );
    cells
}

/// Why a branch of the first capture stands for nothing in capture `k`.
pub fn lost(row: &Row, k: usize) -> &'static str {
    match row.matches.get(k) {
        Some(Match::Unclear) => "unclear which",
        _ => "not found",
    }
}

/// What branches of a capture are called, by their nodes.
fn called(study: &Study, nodes: &[u32]) -> Vec<String> {
    let branches = study.branches.iter();
    let named = branches.filter(|branch| nodes.contains(&branch.name));
    named.map(Branch::called).collect()
}

/// Branches of the first capture and of the one after `other` more that stand for nothing in each
/// other, a line a reason.
pub fn unmatched(studies: &[Study], comparison: &Comparison, other: usize) -> String {
    let Some(study) = studies.get(other + 1) else {
        return String::new();
    };
    let (mut missing, mut unclear) = (Vec::new(), Vec::new());
    for row in comparison.rows_of_first() {
        match row.matches.get(other + 1) {
            Some(Match::Missing) => missing.push(row.called(studies)),
            Some(Match::Unclear) => unclear.push(row.called(studies)),
            _ => {}
        }
    }
    let left = comparison.left_over.get(other);
    let (first, name) = (&studies[0].name, &study.name);
    let lists = [
        (
            format!("branches of {first} that {name} does not have"),
            missing,
        ),
        (
            format!("branches of {first} for which two of {name} are as near"),
            unclear,
        ),
        (
            format!("branches of {name} that {first} does not have"),
            called(study, left.map_or(&[], Vec::as_slice)),
        ),
    ];
    let mut out = String::new();
    for (what, names) in lists {
        if !names.is_empty() {
            out += &format!("  {what}: {}\n", names.join(", "));
        }
    }
    out
}
