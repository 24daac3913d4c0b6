//! Several captures beside each other (Hu et al. figs. 9 to 12 and 15, table 1).

use super::branch::highest_hz;
use super::levels::by_level;
use super::{ValueOf, cells, damping_of, figure, frequency_of, keys, stacked};
use crate::report::compare::{Change, Comparison, Row};
use crate::report::plot::{Answer, Curve, Mark, Slot, across, escaped, spectra};
use crate::report::study::{Branch, Study};
use crate::report::text::{heading, lost, unmatched};
use crate::report::values::{changed, interval};

/// Branches of a tree whose spectra are drawn together, as in figure 10.
const TOGETHER: usize = 4;

/// What the captures have in common and where they differ.
pub fn compared_part(studies: &[Study], comparison: &Comparison) -> String {
    let mut out = format!(
        "<section id=\"compared\"><h2>Compared</h2><p>{}.</p>",
        escaped(&heading(studies, comparison))
    );
    out += &format!("<p>{}</p>", keys(studies.iter().map(|s| s.name.as_str())));
    if comparison.same_tree.is_some() {
        out += &table(studies, comparison);
    }
    let one_tree = comparison.same_tree == Some(true);
    if one_tree {
        out += &not_matched(studies, comparison);
    }
    let told = comparison
        .rows_of_first()
        .filter(|row| row.is_told(studies));
    let rows: Vec<&Row> = told.collect();
    let mut plots = String::new();
    if one_tree {
        plots += &branch_plots(studies, &rows);
    }
    let all: Vec<&Study> = studies.iter().collect();
    plots += &level_plots(&all);
    out += &format!("<div class=\"plots two\">{plots}</div>");
    let (what, drawn): (&str, String) = if one_tree {
        let overlays = rows.iter().map(|row| overlay(studies, row));
        ("the same branch in every capture", overlays.collect())
    } else {
        let highest_hz = highest_hz(&all);
        let trees = all.iter().map(|study| of_tree(study, highest_hz));
        ("tree beside tree", trees.collect())
    };
    if !drawn.is_empty() {
        out += &format!(
            "<h3>Spectra: {what}</h3><p class=\"soft\">Of the angle to the parent branch, in the \
             picture; upright lines are the frequencies that were identified.</p>\
             <div class=\"plots\">{drawn}</div>"
        );
    }
    out + "</section>"
}

/// Branches that stand for nothing in another capture; nothing if there are none.
fn not_matched(studies: &[Study], comparison: &Comparison) -> String {
    let mut items = String::new();
    for k in 1..studies.len() {
        for line in unmatched(studies, comparison, k - 1).lines() {
            items += &format!("<li>{}</li>", escaped(line.trim()));
        }
    }
    if items.is_empty() {
        return items;
    }
    format!("<p>Not matched:</p><ul>{items}</ul>")
}

/// Frequency and damping of each branch in every capture.
fn branch_plots(studies: &[Study], rows: &[&Row]) -> String {
    let by = format!("branch, as numbered in {}", studies[0].name);
    let frequencies = by_branch(studies, rows, frequency_of);
    let dampings = by_branch(studies, rows, damping_of);
    figure(
        across(&frequencies, &by, "frequency, Hz", "Frequency by branch"),
        "Frequency of the same branch in every capture.",
    ) + &figure(
        across(&dampings, &by, "damping ratio", "Damping by branch"),
        "Damping of the same branch in every capture.",
    )
}

fn by_branch(studies: &[Study], rows: &[&Row], of: ValueOf) -> Vec<Slot> {
    let mut slots = Vec::with_capacity(rows.len());
    for row in rows {
        let mut marks = Vec::new();
        for kind in 0..studies.len() {
            if let Some(of) = row.sway(studies, kind).and_then(|sway| of(&sway)) {
                marks.push(Mark { of, kind });
            }
        }
        slots.push(Slot {
            name: row.called(studies),
            marks,
        });
    }
    slots
}

/// Frequency and damping by level in every capture.
fn level_plots(studies: &[&Study]) -> String {
    let frequencies = by_level(studies, frequency_of);
    let dampings = by_level(studies, damping_of);
    figure(
        across(&frequencies, "level", "frequency, Hz", "Frequency by level"),
        "Frequency across levels.",
    ) + &figure(
        across(&dampings, "level", "damping ratio", "Damping by level"),
        "Damping across levels.",
    )
}

fn table(studies: &[Study], comparison: &Comparison) -> String {
    let first = escaped(&studies[0].name);
    let head = [
        "branch",
        "capture",
        "called there",
        "frequency, Hz",
        "damping ratio",
    ]
    .map(String::from);
    let against = ["frequency", "damping"].map(|what| format!("{what},<br>against {first}"));
    let head = [&head[..], &against].concat();
    let (mut rows, mut untold) = (String::new(), Vec::new());
    for row in comparison.rows_of_first() {
        if row.is_told(studies) {
            rows.extend((0..studies.len()).map(|k| table_row(studies, row, k)));
        } else {
            untold.push(escaped(&row.called(studies)));
        }
    }
    let untold = if untold.is_empty() {
        String::new()
    } else {
        format!(
            "<p class=\"soft\">Without a frequency in any of them: {}.</p>",
            untold.join(", ")
        )
    };
    format!(
        "<div class=\"wide\"><table><tr>{}</tr>{rows}</table></div>\
         <p class=\"soft\">With a star: beyond what both 95 % intervals allow. Of twenty branches \
         that do not differ, chance marks one.</p>{untold}",
        cells("th", "n", &head[..2])
            + &cells("th", "n less", &head[2..3])
            + &cells("th", "n", &head[3..])
    )
}

fn table_row(studies: &[Study], row: &Row, k: usize) -> String {
    let head = if k == 0 {
        format!(
            "<td class=\"n\" rowspan=\"{}\">{}</td>",
            studies.len(),
            escaped(&row.called(studies))
        )
    } else {
        String::new()
    };
    let name = escaped(&studies[k].name);
    let rest = match (row.branch(studies, k), row.sway(studies, k)) {
        (None, _) => without_values(name, "-", lost(row, k)),
        (Some(b), None) => {
            let reason = b.sway.err().map_or(String::new(), |w| format!("none: {w}"));
            without_values(name, &escaped(&b.called()), &reason)
        }
        (Some(b), Some(sway)) => {
            let first = row.sway(studies, 0).filter(|_| k > 0);
            let [frequency, damping] = [Change::of_frequency, Change::of_damping].map(|between| {
                let change = first.and_then(|first| between(&first, &sway));
                change.map_or("-".to_owned(), |c| stacked(&changed(&c)))
            });
            let row = [
                name,
                escaped(&b.called()),
                stacked(&interval(&sway.frequency_hz, 3)),
                sway.damping_ratio
                    .map_or("unknown".into(), |d| stacked(&interval(&d, 3))),
                frequency,
                damping,
            ];
            cells("td", "n", &row[..1])
                + &cells("td", "n less", &row[1..2])
                + &cells("td", "n", &row[2..])
        }
    };
    format!("<tr>{head}{rest}</tr>")
}

/// The cells of a branch of capture `name` that has no values there, and why.
fn without_values(name: String, called: &str, why: &str) -> String {
    let first = cells("td", "n", &[name]) + &cells("td", "n less", &[called.into()]);
    format!("{first}<td class=\"why\" colspan=\"4\"><span>{why}</span></td>")
}

fn curve(branch: &Branch, kind: usize) -> Option<Curve<'_>> {
    let answer = Answer {
        frequency_hz: branch.known().map(|s| s.frequency_hz),
        peak: None,
    };
    Some(Curve {
        spectrum: branch.spectrum.as_ref()?,
        class: format!("c{} curve", kind % 6),
        answer: Some(answer),
    })
}

/// The spectra of one branch in all captures: a stronger pull makes a higher peak, the frequency
/// stays (figure 11).
fn overlay(studies: &[Study], row: &Row) -> String {
    let curves: Vec<Curve> = (0..studies.len())
        .filter_map(|k| curve(row.branch(studies, k)?, k))
        .collect();
    let all: Vec<&Study> = studies.iter().collect();
    if curves.len() < 2 {
        return String::new();
    }
    let called = row.called(studies);
    let title = format!("Spectra of branch {called}");
    figure(
        spectra(&curves, highest_hz(&all), &title),
        &format!("Branch {}.", escaped(&called)),
    )
}

/// The branches of a tree that sway most and have an answer, in one plot (figure 10).
fn of_tree(study: &Study, highest_hz: f64) -> String {
    let mut known: Vec<(&Branch, f64)> = study
        .branches
        .iter()
        .filter_map(|b| Some((b, b.known().map(|_| b.amplitude_deg.max(0.0))?)))
        .collect();
    // The trunk, and the others by how far they sway.
    known.sort_by(|a, b| {
        a.0.parent
            .is_some()
            .cmp(&b.0.parent.is_some())
            .then(b.1.total_cmp(&a.1))
    });
    known.truncate(TOGETHER);
    let curves: Vec<Curve> = known
        .iter()
        .enumerate()
        .filter_map(|(k, (b, _))| curve(b, k))
        .collect();
    let names: Vec<String> = known
        .iter()
        .map(|(b, _)| format!("branch {}", b.name))
        .collect();
    let caption = format!(
        "{}: {}",
        escaped(&study.name),
        keys(names.iter().map(String::as_str))
    );
    figure(
        spectra(&curves, highest_hz, &format!("Spectra of {}", study.name)),
        &caption,
    )
}
