//! All branches in a table, and those without an answer with the reason.

use super::{cells, stacked};
use crate::model::Unidentified;
use crate::report::plot::escaped;
use crate::report::study::{Branch, Study};
use crate::report::values::{interval, number};
use crate::report::words;

/// Every branch in a row.
pub fn table_part(study: &Study) -> String {
    let metres = study.metres_per_px > 0.0;
    let mut head: Vec<String> = ["node", "branch", "level", "carried by", "points"]
        .map(String::from)
        .into();
    head.extend(["frequency, Hz", "damping ratio", "sway, deg", "end, px"].map(String::from));
    if metres {
        head.push("end, m".into());
    }
    head.extend(["peak, Hz", "half-power damping"].map(String::from));
    let columns = head.len();
    let rows: String = study
        .branches
        .iter()
        .map(|b| row(study, b, columns))
        .collect();
    // Narrow screens go without those that stand with each branch as well.
    let (first, less) = (
        cells("th", "n", &head[..2]),
        cells("th", "n less", &head[2..5]),
    );
    let (most, last) = (
        cells("th", "n", &head[5..columns - 2]),
        cells("th", "n less", &head[columns - 2..]),
    );
    let head = first + &less + &most + &last;
    format!("<h3>All branches</h3><div class=\"wide\"><table><tr>{head}</tr>{rows}</table></div>")
}

fn row(study: &Study, branch: &Branch, columns: usize) -> String {
    let parent = branch.parent.map_or("foot".into(), |p| p.to_string());
    let name = if branch.times_s.is_empty() {
        branch.name.to_string()
    } else {
        format!("<a href=\"#{}\">{}</a>", anchor(study, branch), branch.name)
    };
    let place = [branch.level.to_string(), parent, branch.points.to_string()];
    let first = cells("td", "n", &[name, escaped(&branch.piece)]) + &cells("td", "n less", &place);
    let reference = [
        number(branch.reference.map_or(f64::NAN, |r| r.peak_hz), 2),
        number(branch.reference.map_or(f64::NAN, |r| r.damping_ratio), 3),
    ];
    let reference = cells("td", "n less", &reference);
    let rest = match branch.sway {
        Err(_) => format!(
            "<td class=\"why\" colspan=\"{}\"><span>none: {}</span></td>",
            columns - 7,
            escaped(&branch.why().unwrap_or_default())
        ),
        Ok(sway) => {
            let mut rest = vec![
                stacked(&interval(&sway.frequency_hz, 3)),
                sway.damping_ratio
                    .map_or("unknown".into(), |d| stacked(&interval(&d, 3))),
                number(branch.amplitude_deg, 2),
                number(branch.amplitude_px(), 1),
            ];
            if study.metres_per_px > 0.0 {
                rest.push(number(branch.amplitude_px() * study.metres_per_px, 4));
            }
            cells("td", "n", &rest)
        }
    };
    format!("<tr>{first}{rest}{reference}</tr>")
}

/// The name of a branch's part within the page.
pub fn anchor(study: &Study, branch: &Branch) -> String {
    let mut anchor = String::new();
    for c in study.name.chars() {
        if c.is_ascii_alphanumeric() {
            anchor.push(c);
        } else {
            // Different names stay different.
            anchor += &format!("_{:x}", u32::from(c));
        }
    }
    format!("{anchor}-{}", branch.name)
}

/// What this does not say: branches without an answer by reason, and what no number here means.
pub fn not_said(study: &Study) -> String {
    let mut items = String::new();
    for reason in Unidentified::ALL {
        let names: Vec<String> = study
            .branches
            .iter()
            .filter(|b| b.sway == Err(reason))
            .map(|b| b.name.to_string())
            .collect();
        if !names.is_empty() {
            let what = if names.len() > 1 {
                "Branches"
            } else {
                "Branch"
            };
            items += &format!(
                "<li>{what} {} ({reason}). {}</li>",
                names.join(", "),
                words::why(reason)
            );
        }
    }
    if study
        .branches
        .iter()
        .any(|b| b.known().is_some_and(|s| s.damping_ratio.is_none()))
    {
        items += "<li>Where damping is unknown, the film shows the frequency but not how the sway dies down.</li>";
    }
    items += "<li>A frequency is that of the tree as it was on that day, with its leaves and the \
              water on them, and for sways of this size; it says nothing of a storm.</li>";
    items += "<li>A branch here is what was seen to move as one. Twigs that move with it count to \
              it, and what is hidden behind others is not in the table.</li>";
    if study.metres_per_px > 0.0 {
        items += "<li>Metres hold at the depth of the known length; what hangs nearer to the \
                  camera or farther away is as much too large or too small. Sway towards the \
                  camera is not in the amplitude.</li>";
    }
    format!("<h3>What this does not say</h3><ul>{items}</ul>")
}
