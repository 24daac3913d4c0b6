//! Where wood may grow that the film does not show.

use super::Envelope;
use crate::config::EnvelopeKind;
use crate::model::{Outline, Skeleton};
use nalgebra::{Point2, Point3};

/// What an outline says about the space that the tree stands in.
#[derive(Clone, Copy, Debug)]
pub enum Silhouette {
    /// It is a drawn shape that the tree was cut to.
    Drawn,
    Filmed(EnvelopeKind),
}

/// Where twigs may grow (from and to, model axes, px): within the envelope that the branches were
/// pushed to fill or were cut to, and not out of the outline itself as seen from the front;
/// everywhere where there is no outline.
pub fn room<'a>(
    skeleton: &Skeleton,
    outline: Option<&'a Outline>,
    silhouette: Silhouette,
) -> impl Fn(&Point3<f64>, &Point3<f64>) -> bool + use<'a> {
    let foot_px = skeleton.foot_px;
    let envelope = outline.map(|outline| match silhouette {
        Silhouette::Drawn => Envelope::of_drawn(outline, foot_px),
        Silhouette::Filmed(kind) => Envelope::of_filmed(kind, outline, foot_px, &places(skeleton)),
    });
    move |from: &Point3<f64>, to: &Point3<f64>| match (&envelope, outline) {
        (Some(envelope), Some(outline)) => {
            let middle = nalgebra::center(from, to);
            let from_is_seen = appears_within(outline, foot_px, from);
            // A branch that is outside itself, as a copy may be, is no barer for it.
            envelope.contains(to)
                && envelope.contains(&middle)
                && (!from_is_seen
                    || (appears_within(outline, foot_px, to)
                        && appears_within(outline, foot_px, &middle)))
        }
        _ => true,
    }
}

/// Whether a point (model axes, px) is within the outline as seen from the front.
fn appears_within(outline: &Outline, foot_px: Point2<f64>, p: &Point3<f64>) -> bool {
    outline.contains(foot_px.x + p.x, foot_px.y - p.y)
}

/// Where the measured nodes are, model axes, px.
fn places(skeleton: &Skeleton) -> Vec<Point3<f64>> {
    skeleton.nodes[..skeleton.measured()]
        .iter()
        .map(|n| n.position)
        .collect()
}
