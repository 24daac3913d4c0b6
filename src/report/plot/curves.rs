//! Spectra of angles (Hu et al. figures 7 and 9 to 12).

use super::axes::{Axes, range, thinned};
use super::svg::Svg;
use super::{HEIGHT, WIDTH};
use crate::dynamics::Spectrum;
use crate::model::Interval;

/// Points of a curve at most.
const MOST: usize = 700;
/// Half the height of the ends of the bar that is the width at half the power.
const END: f64 = 4.0;

/// One curve of a plot.
pub struct Curve<'a> {
    pub spectrum: &'a Spectrum,
    /// Colour and dashes.
    pub class: String,
    pub answer: Option<Answer>,
}

/// What is marked on a curve.
#[derive(Clone, Copy)]
pub struct Answer {
    pub frequency_hz: Option<Interval>,
    /// Frequency and half-power damping of the largest peak.
    pub peak: Option<(f64, f64)>,
}

/// Spectra from 0 to `highest_hz`; with one curve, its answer with the interval and the peak's
/// width at half the power.
pub fn spectra(curves: &[Curve], highest_hz: f64, label: &str) -> Option<String> {
    let points = |s: &Spectrum| -> Vec<[f64; 2]> {
        let all = s
            .amplitude
            .iter()
            .enumerate()
            .map(|(k, a)| [k as f64 * s.bin_hz, *a]);
        all.take_while(|p| p[0] <= highest_hz).collect()
    };
    let all: Vec<Vec<[f64; 2]>> = curves.iter().map(|c| points(c.spectrum)).collect();
    let [_, top] = range(all.iter().flatten().map(|p| p[1]));
    if !top.is_finite() || top <= 0.0 {
        return None;
    }
    let mut svg = Svg::new(WIDTH, HEIGHT, label);
    let axes = Axes::new([WIDTH, HEIGHT], [0.0, highest_hz], [0.0, 1.15 * top]);
    for curve in curves {
        let colour = curve.class.split(' ').next().unwrap_or_default();
        let class = if curves.len() > 1 { colour } else { "answer" };
        if let Some(f) = curve.answer.and_then(|a| a.frequency_hz) {
            // An interval may be narrower than a line.
            svg.rect(
                [axes.x(f.lo.max(0.0)), axes.top()],
                [axes.x(f.hi.min(highest_hz)), axes.bottom()],
                &format!("{class} band"),
            );
            svg.path(
                [axes.at(f.value, 0.0), axes.at(f.value, 1.15 * top)],
                &format!("{class} mark"),
            );
        }
    }
    axes.draw(&mut svg, "frequency, Hz", "degrees");
    for (curve, points) in curves.iter().zip(&all) {
        svg.path(
            thinned(points, MOST)
                .into_iter()
                .map(|[f, a]| axes.at(f, a)),
            &curve.class,
        );
        if let Some((peak_hz, damping)) = curve
            .answer
            .and_then(|a| a.peak)
            .filter(|_| curves.len() == 1)
        {
            let k = (peak_hz / curve.spectrum.bin_hz).round() as usize;
            let height = curve.spectrum.amplitude.get(k).copied().unwrap_or(f64::NAN)
                * std::f64::consts::FRAC_1_SQRT_2;
            // The width at half the power is twice the damping times the frequency (Hu et al.
            // eq. 6).
            let [left, right] = [1.0 - damping, 1.0 + damping]
                .map(|side| axes.x((side * peak_hz).clamp(0.0, highest_hz)));
            let y = axes.y(height);
            svg.line([left, y], [right, y], "width");
            // Ends, so that its shape tells it from the answer where colours do not.
            [left, right]
                .into_iter()
                .for_each(|x| svg.line([x, y - END], [x, y + END], "width"));
        }
    }
    Some(svg.finish())
}
