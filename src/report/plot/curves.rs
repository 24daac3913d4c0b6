//! Spectra of angles (Hu et al. figs. 7 and 9 to 12).

use super::axes::{Axes, range, thinned};
use super::svg::Svg;
use super::{HEIGHT, WIDTH};
use crate::bounds::Bounds;
use crate::dynamics::{HalfPower, Spectrum};
use crate::model::Interval;
use nalgebra::{Point2, Vector2};

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
    /// Of the spectrum's largest peak.
    pub peak: Option<HalfPower>,
}

/// Spectra from 0 to `highest_hz`; with one curve, its answer with the interval and the peak's
/// width at half the power.
pub fn spectra(curves: &[Curve], highest_hz: f64, label: &str) -> Option<String> {
    let all: Vec<Vec<Point2<f64>>> = curves
        .iter()
        .map(|c| points(c.spectrum, highest_hz))
        .collect();
    let top = range(all.iter().flatten().map(|p| p.y)).hi;
    if !top.is_finite() || top <= 0.0 {
        return None;
    }
    let mut svg = Svg::new(WIDTH, HEIGHT, label);
    let axes = Axes::new(
        Vector2::new(WIDTH, HEIGHT),
        Bounds::new(0.0, highest_hz),
        Bounds::new(0.0, 1.15 * top),
    );
    let alone = curves.len() == 1;
    for curve in curves {
        let colour = curve.class.split(' ').next().unwrap_or_default();
        let class = if alone { "answer" } else { colour };
        if let Some(frequency_hz) = curve.answer.and_then(|a| a.frequency_hz) {
            let top = 1.15 * top;
            mark_frequency(&mut svg, &axes, &frequency_hz, highest_hz, top, class);
        }
    }
    axes.draw(&mut svg, "frequency, Hz", "degrees");
    for (curve, points) in curves.iter().zip(&all) {
        let line = thinned(points, MOST).into_iter();
        svg.path(line.map(|p| axes.at(p)), &curve.class);
        let peak = curve.answer.and_then(|a| a.peak).filter(|_| alone);
        if let Some(peak) = peak {
            mark_peak(&mut svg, &axes, curve.spectrum, peak, highest_hz);
        }
    }
    Some(svg.finish())
}

/// Frequency and amplitude of every bin up to `highest_hz`.
fn points(spectrum: &Spectrum, highest_hz: f64) -> Vec<Point2<f64>> {
    let bins = spectrum.amplitude.iter().enumerate();
    bins.map(|(k, amplitude)| Point2::new(k as f64 * spectrum.bin_hz, *amplitude))
        .take_while(|p| p.x <= highest_hz)
        .collect()
}

/// A frequency with its interval in a plot that ends at `highest_hz` and `top`.
fn mark_frequency(
    svg: &mut Svg,
    axes: &Axes,
    frequency_hz: &Interval,
    highest_hz: f64,
    top: f64,
    class: &str,
) {
    // An interval may be narrower than a line.
    svg.rect(
        Point2::new(axes.x(frequency_hz.lo.max(0.0)), axes.top()),
        Point2::new(axes.x(frequency_hz.hi.min(highest_hz)), axes.bottom()),
        &format!("{class} band"),
    );
    svg.path(
        [0.0, top].map(|a| axes.at(Point2::new(frequency_hz.value, a))),
        &format!("{class} mark"),
    );
}

/// The width of a peak at half its power: twice the damping times the frequency (Hu et al. eq. 6).
fn mark_peak(svg: &mut Svg, axes: &Axes, spectrum: &Spectrum, peak: HalfPower, highest_hz: f64) {
    let k = (peak.peak_hz / spectrum.bin_hz).round() as usize;
    let amplitude = spectrum.amplitude.get(k).copied().unwrap_or(f64::NAN);
    let y = axes.y(amplitude * std::f64::consts::FRAC_1_SQRT_2);
    let sides = [1.0 - peak.damping_ratio, 1.0 + peak.damping_ratio]
        .map(|side| axes.x((side * peak.peak_hz).clamp(0.0, highest_hz)));
    svg.line(Point2::new(sides[0], y), Point2::new(sides[1], y), "width");
    // Ends, so that its shape tells it from the answer where colours do not.
    for x in sides {
        svg.line(Point2::new(x, y - END), Point2::new(x, y + END), "width");
    }
}
