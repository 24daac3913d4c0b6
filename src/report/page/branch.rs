//! One branch: its angle over time, its spectrum, its way.

use super::figure;
use super::table::anchor;
use crate::report::plot::{Answer, Curve, angle, escaped, spectra, way};
use crate::report::study::{Branch, Study};
use crate::report::values::{interval, number};

/// Frequencies are drawn up to so many times the highest that was found, and at least to this, Hz.
const BEYOND: f64 = 1.6;
const LEAST_HZ: f64 = 2.0;

/// A section with all plots of a branch; folded for one without an answer.
pub fn branch_part(study: &Study, branch: &Branch) -> String {
    let of = branch
        .parent
        .map_or("on the foot".into(), |p| format!("carried by {p}"));
    let id = escaped(&anchor(study, branch));
    let head = format!("Branch {}, {}, {of}", branch.name, escaped(&branch.piece));
    match branch.sway {
        Ok(sway) => {
            let damping = sway
                .damping_ratio
                .map_or("unknown".into(), |d| interval(&d, 3));
            let said = format!(
                "{} Hz, damping ratio {damping}, {}{}",
                interval(&sway.frequency_hz, 3),
                how_far(branch),
                at_its_end(study, branch)
            );
            format!(
                "<section class=\"branch\" id=\"{id}\"><h3>{head}</h3><p>{said}</p>{}</section>",
                plots(study, branch)
            )
        }
        Err(_) => {
            format!(
                "<details id=\"{id}\"><summary>{head}: {}</summary>{}</details>",
                escaped(&branch.why().unwrap_or_default()),
                plots(study, branch)
            )
        }
    }
}

/// How far it sways, or why that is not said.
fn how_far(branch: &Branch) -> String {
    let [points, angle] = [branch.by_points_deg, branch.in_angle_deg].map(|deg| number(deg, 2));
    match (
        branch.amplitude_deg.is_finite(),
        branch.in_angle_deg.is_finite(),
    ) {
        (true, _) => format!("sway {}°", number(branch.amplitude_deg, 2)),
        (false, true) => format!("sway unknown (by its points {points}°, by the angle {angle}°)"),
        (false, false) => "sway unknown".into(),
    }
}

fn at_its_end(study: &Study, branch: &Branch) -> String {
    let px = branch.amplitude_px();
    if study.metres_per_px > 0.0 && px.is_finite() {
        format!(", {} m at its end", number(px * study.metres_per_px, 4))
    } else {
        String::new()
    }
}

fn plots(study: &Study, branch: &Branch) -> String {
    let in_time = "Angle to its parent branch: <span class=\"key\"><i class=\"k kp\"></i>in the picture</span> \
                   <span class=\"key\"><i class=\"k ks\"></i>in space</span>";
    let fitted = branch.fitted_deg.as_ref().map_or("", |_| {
        " <span class=\"key\"><i class=\"k kf\"></i>the part of the first that has its own \
         frequency and damping</span>"
    });
    let drawn = spectrum(study, branch);
    let answer = branch.known().map_or("", |_| {
        " <span class=\"key\"><i class=\"k kb\"></i>the branch's frequency (line) with its \
         interval (shaded)</span>"
    });
    let peak = branch.reference.map_or(String::new(), |r| {
        format!(
            " <span class=\"key\"><i class=\"k kw\"></i>for reference: width at half the power of \
             the largest peak, at {:.2} Hz; damping by it {:.3} (eq. 6)</span>",
            r.peak_hz, r.damping_ratio
        )
    });
    format!(
        "<div class=\"plots\">{}{}{}</div>",
        figure(angle(study, branch), &format!("{in_time}{fitted}")),
        figure(
            drawn,
            &format!("Spectrum of the angle in the picture.{answer}{peak}")
        ),
        figure(
            way(study, branch),
            "Way of its end in the picture, from its place at rest: \
             <span class=\"key\"><i class=\"k kp\"></i>the first 80 frames</span> \
             <span class=\"key\"><i class=\"k ks\"></i>all</span>"
        ),
    )
}

fn spectrum(study: &Study, branch: &Branch) -> Option<String> {
    let answer = Answer {
        frequency_hz: branch.known().map(|s| s.frequency_hz),
        peak: branch.reference,
    };
    let curve = Curve {
        spectrum: branch.spectrum.as_ref()?,
        class: "plane".into(),
        answer: Some(answer),
    };
    spectra(
        &[curve],
        highest_hz(&[study]),
        &format!("Spectrum of the angle of branch {}", branch.name),
    )
}

/// To which frequency spectra are drawn, Hz: the same for all branches, so that they can be
/// compared.
pub fn highest_hz(studies: &[&Study]) -> f64 {
    let found = studies.iter().flat_map(|s| {
        s.branches
            .iter()
            .filter_map(|b| Some(b.known()?.frequency_hz.value))
    });
    let asked = studies.iter().map(|s| s.highest_hz).fold(0.0, f64::max);
    (BEYOND * found.fold(0.0, f64::max))
        .max(LEAST_HZ)
        .min(asked)
}
