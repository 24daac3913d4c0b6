//! The page: one HTML file that needs no network, no script and no other file.

use super::compare::Comparison;
use super::page::{
    branch_part, compared_part, levels_part, modes_part, not_said, pattern_part, table_part,
};
use super::plot::{Map, escaped, map};
use super::study::Study;
use super::words;

const STYLE: &str = include_str!("report.css");

/// The page on one or several captures, and what compares them.
pub fn page(studies: &[Study], comparison: Option<&Comparison>) -> String {
    let names: Vec<&str> = studies.iter().map(|s| s.name.as_str()).collect();
    let title = escaped(&format!("Sway of {}", names.join(", ")));
    let mut body = format!("<h1>{title}</h1><p>{}</p>", summary(studies));
    if studies.len() > 1 {
        let links = studies
            .iter()
            .enumerate()
            .map(|(k, s)| format!("<a href=\"#s{k}\">{}</a>", escaped(&s.name)));
        body += &format!(
            "<nav><a href=\"#compared\">Compared</a>{}</nav>",
            links.collect::<String>()
        );
    }
    body += &comparison.map_or(String::new(), |c| compared_part(studies, c));
    for (k, study) in studies.iter().enumerate() {
        body += &one(k, study, studies.len() > 1);
    }
    body += HOW_TO_READ;
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta name=\"generator\" content=\"arborcam {}\"><title>{title}</title><style>{STYLE}</style></head>\
         <body><main>{body}</main></body></html>\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// What there is to say in a sentence.
fn summary(studies: &[Study]) -> String {
    let (answers, all) = studies
        .iter()
        .fold((0, 0), |n, s| (n.0 + s.answers(), n.1 + s.branches.len()));
    let films = if studies.len() > 1 {
        format!(" in {} captures", studies.len())
    } else {
        String::new()
    };
    let of = words::number_of(all, "branch");
    format!(
        "{answers} of {of}{films} have a frequency of their own that the film shows. Intervals are 95 %."
    )
}

fn one(k: usize, study: &Study, several: bool) -> String {
    let mut out = String::new();
    let name = if several {
        escaped(&study.name)
    } else {
        "What was filmed".into()
    };
    out += &format!("<section id=\"s{k}\"><h2>{name}</h2>{}", facts(study));
    let Map { svg, unnamed } = map(study);
    let unnamed = match unnamed.as_slice() {
        [] => String::new(),
        some => {
            let names: Vec<String> = some.iter().map(u32::to_string).collect();
            format!(
                " <span>There is no room for the numbers of {}.</span>",
                names.join(", ")
            )
        }
    };
    out += &format!(
        "<figure class=\"map\">{svg}<figcaption>Branches as they were measured, at rest: \
         <span class=\"key\"><i class=\"k kp\"></i>with a frequency</span> \
         <span class=\"key\"><i class=\"k ks\"></i>without</span> \
         <span>The dashed line is the region that was tracked.</span>{unnamed}</figcaption></figure>"
    );
    out += &table_part(study);
    out += &modes_part(study);
    out += &levels_part(study);
    out += &pattern_part(study);
    out += &not_said(study);
    if study.answers() > 0 {
        out += "<h3>Branch by branch</h3>";
    }
    for branch in study.branches.iter().filter(|b| b.sway.is_ok()) {
        out += &branch_part(study, branch);
    }
    let without: Vec<_> = study
        .branches
        .iter()
        .filter(|b| b.sway.is_err() && !b.times_s.is_empty())
        .collect();
    if !without.is_empty() {
        out +=
            "<h3>How the others moved</h3><p class=\"soft\">Without a frequency; for the eye.</p>";
        out += &without
            .into_iter()
            .map(|b| branch_part(study, b))
            .collect::<String>();
    }
    out + "</section>"
}

/// What was filmed, how long, how fast, what is missing, what made it sway.
fn facts(study: &Study) -> String {
    let mut rows = vec![
        (
            "Film",
            format!("{}, {} x {} px", study.source, study.size[0], study.size[1]),
        ),
        ("Analysed", words::frames(study)),
        ("Gaps", words::gaps(study)),
        ("Excitation", words::excitation(study)),
    ];
    let scale = study.metres_per_px;
    rows.push((
        "Scale",
        if scale > 0.0 {
            format!("{} m in a pixel", significant(scale))
        } else {
            "none given".into()
        },
    ));
    if let Some(verdict) = &study.verdict {
        rows.push(("Verdict", verdict.line()));
    }
    if let Some(at) = study.origin.captured_at {
        rows.push(("Filmed at", at.to_string()));
    }
    let own = study.origin.notes.iter();
    rows.extend(own.map(|(key, value)| (key, value.to_owned())));
    rows.extend(study.notes.iter().map(|note| ("Note", note.clone())));
    let mut list = String::new();
    for (name, text) in &rows {
        list += &format!("<dt>{name}</dt><dd>{}</dd>", escaped(text));
    }
    format!("<dl>{list}</dl>")
}

/// A length with three digits that say something.
fn significant(x: f64) -> String {
    let decimals = (2.0 - x.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{x:.decimals$}");
    if decimals > 0 {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

const HOW_TO_READ: &str = "<section><h2>How to read this</h2>\
<p><b>Frequency</b> is the undamped natural frequency of a branch against the one that carries it, \
<b>damping ratio</b> its share of critical damping. Both are fitted to all points on the branch in all \
frames at their real times. The <b>interval</b> in brackets is meant to hold the true value in 95 of 100 \
cases.</p>\
<p><b>Sway</b> is the amplitude of the branch's own oscillation in its angle to the parent branch. After a \
release it is that of the dashed curve at the moment of release. The points on the branch are a second \
witness: how far they turn about the place where it begins. On short branches of few points that is mostly \
the move of that place. Where the two are more than 1.5 times apart, the film does not show how far the \
branch sways, and there is a dash. In wind, and without poses, it comes from the points alone: in wind the \
square root of 2 times the root mean square. <b>End</b> is what it makes at the branch's end, in the \
picture.</p>\
<p>A <b>mode</b> is one frequency at which points of the whole tree swing together; where they are those of \
one branch, it is that branch's own. Its energy is shared out to trunk and limbs by how far their points swing \
in it, all points of like mass. A branch without a frequency of its own moves with the modes of others: behind \
each stands its share of the squares of that motion.</p>\
<p><b>Peak</b> and <b>half-power damping</b> (Hu et al., equation 6) are what the largest peak of the \
angle's spectrum says. They are for reference. A short film's peak is as wide as one over its length, so \
that this damping is too high, and the largest peak may be that of a parent branch or of the whole tree. Of \
a long film in wind, the spectrum is a mean over pieces of 20 s.</p>\
<p>The <b>dominant peaks</b> of a level are those of the spectrum of the angle to the parent branch that at \
least half of its branches have beyond a smooth background (Hu et al., section 5.4). The level counts forks \
from the foot, the trunk's is 1; the order is the botanical one, the \
trunk's is 0.</p>\
<p>In the plots of the angle the mean is taken off; the grey part before a release is not used. The dashed \
curve is the part of the angle that has the branch's own frequency and damping; what is beyond it is the \
sway of others and noise. The angle in space rests on an estimated depth.</p></section>";
