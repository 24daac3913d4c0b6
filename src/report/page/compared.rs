//! Several captures beside each other (Hu et al. figures 9 to 12 and 15, table 1).

use super::branch::highest_hz;
use super::levels::by_level;
use super::{cells, figure, keys, stacked};
use crate::model::{Interval, Sway};
use crate::report::compare::{Change, Comparison, Row};
use crate::report::plot::{Answer, Curve, Mark, Slot, across, escaped, spectra};
use crate::report::study::{Branch, Study};
use crate::report::text::{changed, heading, interval, lost, unmatched};

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
    if comparison.same_tree == Some(true) {
        let lists: String = (1..studies.len())
            .map(|k| unmatched(studies, comparison, k - 1))
            .collect();
        let items: String = lists
            .lines()
            .map(|line| format!("<li>{}</li>", escaped(line.trim())))
            .collect();
        if !items.is_empty() {
            out += &format!("<p>Not matched:</p><ul>{items}</ul>");
        }
    }
    let rows: Vec<&Row> = comparison
        .rows
        .iter()
        .filter(|row| row.is_told(studies))
        .collect();
    let by_branch = |of: &dyn Fn(&Sway) -> Option<Interval>| -> Vec<Slot> {
        let mark = |row: &Row, kind: usize| {
            Some(Mark {
                of: of(&row.sway(studies, kind)?)?,
                kind,
            })
        };
        let marks = |row: &Row| (0..studies.len()).filter_map(|k| mark(row, k)).collect();
        rows.iter()
            .map(|row| Slot {
                name: row.name.to_string(),
                marks: marks(row),
            })
            .collect()
    };
    let all: Vec<&Study> = studies.iter().collect();
    let frequency = |s: &Sway| Some(s.frequency_hz);
    let damping = |s: &Sway| s.damping_ratio;
    let mut plots = String::new();
    if comparison.same_tree == Some(true) {
        let by = format!("branch, as numbered in {}", studies[0].name);
        plots += &figure(
            across(
                &by_branch(&frequency),
                &by,
                "frequency, Hz",
                "Frequency by branch",
            ),
            "Frequency of the same branch in every capture.",
        );
        plots += &figure(
            across(
                &by_branch(&damping),
                &by,
                "damping ratio",
                "Damping by branch",
            ),
            "Damping of the same branch in every capture.",
        );
    }
    plots += &figure(
        across(
            &by_level(&all, &frequency),
            "level",
            "frequency, Hz",
            "Frequency by level",
        ),
        "Frequency across levels.",
    );
    plots += &figure(
        across(
            &by_level(&all, &damping),
            "level",
            "damping ratio",
            "Damping by level",
        ),
        "Damping across levels.",
    );
    out += &format!("<div class=\"plots two\">{plots}</div>");
    let drawn: String = if comparison.same_tree == Some(true) {
        rows.iter()
            .map(|row| figure(overlay(studies, row), &format!("Branch {}.", row.name)))
            .collect()
    } else {
        all.iter()
            .map(|study| of_tree(study, highest_hz(&all)))
            .collect()
    };
    if !drawn.is_empty() {
        let what = if comparison.same_tree == Some(true) {
            "The same branch in every capture"
        } else {
            "Tree beside tree"
        };
        out += &format!(
            "<h3>Spectra: {}</h3><p class=\"soft\">Of the angle to the carrier, in the picture; upright lines are the \
                         frequencies that were identified.</p><div class=\"plots\">{drawn}</div>",
            what.to_lowercase()
        );
    }
    out + "</section>"
}

fn table(studies: &[Study], comparison: &Comparison) -> String {
    let first = escaped(&studies[0].name);
    let to = |what: &str| format!("{what}<br>against {first}");
    let head = [
        "branch",
        "capture",
        "called there",
        "frequency, Hz",
        "damping ratio",
    ]
    .map(String::from);
    let head = [&head[..], &[to("frequency,"), to("damping,")]].concat();
    let told = comparison.rows.iter().filter(|row| row.is_told(studies));
    let rows: String = told
        .flat_map(|row| (0..studies.len()).map(|k| table_row(studies, row, k)))
        .collect();
    let untold: Vec<String> = comparison
        .rows
        .iter()
        .filter(|row| !row.is_told(studies))
        .map(|row| row.name.to_string())
        .collect();
    let untold = if untold.is_empty() {
        String::new()
    } else {
        format!(
            "<p class=\"soft\">Without a frequency in any of them: {}.</p>",
            untold.join(", ")
        )
    };
    format!(
        "<div class=\"wide\"><table><tr>{}</tr>{rows}</table></div><p class=\"soft\">With a star: beyond what both 95 % intervals \
         allow. Of twenty branches that do not differ, chance marks one.</p>{untold}",
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
            row.name
        )
    } else {
        String::new()
    };
    let name = escaped(&studies[k].name);
    let why = |name: String, called: &str, why: &str| {
        let first = cells("td", "n", &[name]) + &cells("td", "n less", &[called.into()]);
        format!("{first}<td class=\"why\" colspan=\"4\"><span>{why}</span></td>")
    };
    let rest = match (row.branch(studies, k), row.sway(studies, k)) {
        (None, _) => why(name, "-", lost(row, k)),
        (Some(b), None) => {
            let reason = b.sway.err().map_or(String::new(), |w| format!("none: {w}"));
            why(name, &b.name.to_string(), &reason)
        }
        (Some(b), Some(sway)) => {
            let both = row
                .sway(studies, 0)
                .filter(|_| k > 0)
                .map(|first| (first, sway));
            let cell =
                |change: Option<Change>| change.map_or("-".to_owned(), |c| stacked(&changed(&c)));
            let row = [
                name,
                b.name.to_string(),
                stacked(&interval(&sway.frequency_hz, 3)),
                sway.damping_ratio
                    .map_or("unknown".into(), |d| stacked(&interval(&d, 3))),
                cell(both.and_then(|(a, b)| Change::of_frequency(&a, &b))),
                cell(both.and_then(|(a, b)| Change::of_damping(&a, &b))),
            ];
            cells("td", "n", &row[..1])
                + &cells("td", "n less", &row[1..2])
                + &cells("td", "n", &row[2..])
        }
    };
    format!("<tr>{head}{rest}</tr>")
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
fn overlay(studies: &[Study], row: &Row) -> Option<String> {
    let curves: Vec<Curve> = (0..studies.len())
        .filter_map(|k| curve(row.branch(studies, k)?, k))
        .collect();
    let all: Vec<&Study> = studies.iter().collect();
    (curves.len() > 1).then(|| {
        spectra(
            &curves,
            highest_hz(&all),
            &format!("Spectra of branch {}", row.name),
        )
    })?
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
