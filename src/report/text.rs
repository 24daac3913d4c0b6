//! The table that is printed.

use super::compare::{Change, Comparison, Row};
use super::levels::{Growth, Level, Spread, growth, levels};
use super::matching::Match;
use super::study::{Branch, Study};
use super::words;
use crate::model::Interval;

/// Everything as text, a table a capture, and what compares them.
pub fn text(studies: &[Study], comparison: Option<&Comparison>) -> String {
    let mut out: Vec<String> = studies.iter().map(one).collect();
    out.extend(comparison.map(|c| compared(studies, c)));
    out.join("\n")
}

/// Columns that are as wide as what stands in them: numbers to the right, the last one as it comes.
fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| {
        // What stands last in its row may be as long as it likes.
        let cells = rows.iter().filter(|r| r.len() == columns).filter_map(|r| r.get(c));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cell = |(c, cell): (usize, &String)| {
            let last = c + 1 == row.len() && row.len() < columns;
            let gap = widths[c].saturating_sub(cell.chars().count());
            if last { cell.clone() } else { format!("{}{cell}", " ".repeat(gap)) }
        };
        let cells: Vec<String> = row.iter().enumerate().map(cell).collect();
        format!("  {}\n", cells.join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

fn one(study: &Study) -> String {
    let Study { name, source, branches, .. } = study;
    let mut out = format!("{name}: {source}, {}, {}\n", words::frames(study), words::gaps(study));
    out += &format!("{}\n", words::excitation(study));
    let (answers, all) = (study.answers(), words::number_of(branches.len(), "branch"));
    out += &format!("{answers} of {all} have a frequency that this film shows; intervals are 95 %\n\n");
    let mut head: Vec<String> =
        ["branch", "level", "on", "points", "frequency, Hz", "damping ratio", "sway, deg", "end, px"]
            .map(String::from)
            .into();
    if study.metres_per_px > 0.0 {
        head.push("end, m".into());
    }
    head.extend(["peak, Hz".into(), "eq. 6".into()]);
    let mut rows = vec![head];
    rows.extend(branches.iter().map(|b| row(study, b)));
    out += &table(&rows);
    out += "\n  peak and eq. 6: the largest peak of the angle's spectrum and its half-power damping, for reference\n";
    if branches.iter().any(|b| b.sway.is_ok() && !b.amplitude_deg.is_finite()) {
        out += "  sway -: a branch's points and its angle do not agree on how far it sways\n";
    }
    out += "\n";
    let by_level = levels(study);
    if by_level.iter().any(|l| l.answers > 0) {
        out += &level_table(&by_level);
        out += &trends(study);
    }
    out
}

fn row(study: &Study, branch: &Branch) -> Vec<String> {
    let carrier = branch.parent.map_or("foot".into(), |p| p.to_string());
    let mut row = vec![branch.name.to_string(), branch.level.to_string(), carrier, branch.points.to_string()];
    match branch.sway {
        Err(why) => row.push(format!("  none: {why}")),
        Ok(sway) => {
            row.push(interval(&sway.frequency_hz, 3));
            row.push(sway.damping_ratio.map_or("unknown".into(), |d| interval(&d, 3)));
            row.push(number(branch.amplitude_deg, 2));
            row.push(number(branch.amplitude_px, 1));
            if study.metres_per_px > 0.0 {
                row.push(number(branch.amplitude_px * study.metres_per_px, 4));
            }
            row.push(number(branch.reference.map_or(f64::NAN, |r| r.peak_hz), 2));
            row.push(number(branch.reference.map_or(f64::NAN, |r| r.damping_ratio), 3));
        }
    }
    row
}

fn level_table(levels: &[Level]) -> String {
    let head = ["level", "branches", "answers", "frequency, Hz", "damping ratio"].map(String::from);
    let spread = |s: &Option<Spread>| s.as_ref().map_or("-".into(), |s| spread(s, 3));
    let row = |l: &Level| {
        let counts = [u64::from(l.level), l.branches as u64, l.answers as u64].map(|n| n.to_string());
        counts.into_iter().chain([spread(&l.frequency_hz), spread(&l.damping_ratio)]).collect::<Vec<String>>()
    };
    let mut rows = vec![head.to_vec()];
    rows.extend(levels.iter().map(row));
    format!("{}  (median, least to largest)\n", table(&rows))
}

/// How frequency and damping grow with the level, in words.
pub fn trends(study: &Study) -> String {
    let of = |what: &str, g: Option<Growth>| g.map_or(String::new(), |g| format!("  {}\n", trend(what, &g)));
    let frequency = of("frequency", growth(study, |s| Some(s.frequency_hz.value)));
    frequency + &of("damping", growth(study, |s| s.damping_ratio.map(|d| d.value)))
}

/// `frequency by level: +12 % a level (+5 to +20 %, of 9 branches)`, and whether that is more than chance.
pub fn trend(what: &str, growth: &Growth) -> String {
    let chance = if growth.percent.holds(0.0) { "; no trend beyond chance" } else { "" };
    format!("{what} by level: {} a level, of {} branches{chance}", percent(&growth.percent), growth.branches)
}

fn compared(studies: &[Study], comparison: &Comparison) -> String {
    let mut out = format!("{}\n\n", heading(studies, comparison));
    let first = &studies[0].name;
    let mut rows = vec![["branch", "capture", "called", "frequency, Hz", "damping ratio"].map(String::from).to_vec()];
    rows[0].extend([format!("frequency against {first}"), format!("damping against {first}")]);
    for row in comparison.rows.iter().filter(|row| row.is_told(studies)) {
        rows.extend((0..studies.len()).map(|k| across(studies, row, k)));
    }
    out += &table(&rows);
    let untold: Vec<String> =
        comparison.rows.iter().filter(|row| !row.is_told(studies)).map(|row| row.name.to_string()).collect();
    if !untold.is_empty() {
        out += &format!("  without a frequency in any of them: {}\n", untold.join(", "));
    }
    if comparison.same_tree {
        out.extend((1..studies.len()).map(|k| unmatched(studies, comparison, k - 1)));
    }
    out += "  * beyond what both 95 % intervals allow; of twenty branches that do not differ, chance marks one\n";
    out
}

/// What is compared, and by which right.
pub fn heading(studies: &[Study], comparison: &Comparison) -> String {
    let shares: Vec<String> = comparison
        .shares
        .iter()
        .zip(&studies[1..])
        .map(|(share, s)| format!("{:.0} % in {}", 100.0 * share, s.name))
        .collect();
    let what = if comparison.same_tree { "one tree" } else { "several trees, by their trunks" };
    let by = if comparison.said { "as --trees says" } else { "a guess, which --trees overrules" };
    let beside = format!("{by}; branches found in the same place: {}", shares.join(", "));
    format!("Compared with {} as {what} ({beside})", studies[0].name)
}

fn across(studies: &[Study], row: &Row, k: usize) -> Vec<String> {
    let mut cells = vec![if k == 0 { row.name.to_string() } else { String::new() }, studies[k].name.clone()];
    let Some(branch) = row.branch(studies, k) else {
        cells.extend(["-".into(), format!("  {}", lost(row, k))]);
        return cells;
    };
    cells.push(branch.name.to_string());
    let sway = match branch.sway {
        Ok(sway) => sway,
        Err(why) => {
            cells.push(format!("  none: {why}"));
            return cells;
        }
    };
    cells.push(interval(&sway.frequency_hz, 3));
    cells.push(sway.damping_ratio.map_or("unknown".into(), |d| interval(&d, 3)));
    let both = row.sway(studies, 0).filter(|_| k > 0).map(|first| (first, sway));
    let cell = |change: Option<Change>| change.map_or("-".into(), |c| changed(&c));
    cells.push(cell(both.and_then(|(a, b)| Change::of_frequency(&a, &b))));
    cells.push(cell(both.and_then(|(a, b)| Change::of_damping(&a, &b))));
    cells
}

/// Why a branch of the first capture stands for nothing in capture `k`.
pub fn lost(row: &Row, k: usize) -> &'static str {
    match k.checked_sub(1).and_then(|k| row.others.get(k)) {
        Some(Match::Unclear) => "unclear which",
        _ => "not found",
    }
}

/// Branches of the first capture and of the one after `other` more that stand for nothing in each other, a line a reason.
pub fn unmatched(studies: &[Study], comparison: &Comparison, other: usize) -> String {
    let Some(study) = studies.get(other + 1) else { return String::new() };
    let names = |of: &dyn Fn(&Match) -> bool| -> Vec<u32> {
        comparison.rows.iter().filter(|r| r.others.get(other).is_some_and(of)).map(|r| r.name).collect()
    };
    let first = &studies[0].name;
    let list = |what: String, names: &[u32]| {
        let names: Vec<String> = names.iter().map(u32::to_string).collect();
        if names.is_empty() { String::new() } else { format!("  {what}: {}\n", names.join(", ")) }
    };
    let missing = names(&|m| matches!(m, Match::Missing));
    let unclear = names(&|m| matches!(m, Match::Unclear));
    let left = comparison.left_over.get(other).map_or(&[][..], Vec::as_slice);
    list(format!("branches of {first} that {} does not have", study.name), &missing)
        + &list(format!("branches of {first} for which two of {} are as near", study.name), &unclear)
        + &list(format!("branches of {} that {first} does not have", study.name), left)
}

/// `+1.2 % (0.4 to 2.0 %)`, with a star where it counts.
pub fn changed(change: &Change) -> String {
    format!("{}{}", percent(&change.percent), if change.beyond { " *" } else { "" })
}

/// `+1.2 % (+0.4 to +2.0 %)`.
pub fn percent(of: &Interval) -> String {
    let decimals = if (of.hi - of.lo).abs() < 10.0 { 1 } else { 0 };
    let signed = |x: f64| {
        let text = format!("{x:+.decimals$}");
        if text.trim_start_matches(['+', '-']).chars().all(|c| c == '0' || c == '.') { text[1..].into() } else { text }
    };
    format!("{} % ({} to {} %)", signed(of.value), signed(of.lo), signed(of.hi))
}

/// `0.700 (0.699 to 0.702)`: digits enough to tell the ends apart.
pub fn interval(of: &Interval, decimals: usize) -> String {
    let decimals = if (of.hi - of.lo) < 4.0 * 10.0_f64.powi(-(decimals as i32)) { decimals + 1 } else { decimals };
    format!("{:.decimals$} ({:.decimals$} to {:.decimals$})", of.value, of.lo, of.hi)
}

/// `1.23 (0.70 to 2.10)`; the value alone where there is just one.
pub fn spread(of: &Spread, decimals: usize) -> String {
    let Spread { n, median, least, largest } = of;
    if *n < 2 {
        return format!("{median:.decimals$}");
    }
    format!("{median:.decimals$} ({least:.decimals$} to {largest:.decimals$})")
}

/// A number for people; `-` for none.
pub fn number(x: f64, decimals: usize) -> String {
    if x.is_finite() { format!("{x:.decimals$}") } else { "-".into() }
}
