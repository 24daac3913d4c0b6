//! The tree in space: copies on planes, pushed to fill the envelope.

use super::envelope::Envelope;
use super::planes::{copy_to_planes, model_from_image};
use super::push::{Terms, push};
use super::term_weights::tune_term_weights;
use super::trunk::trunk;
use crate::config;
use crate::model::{NodeDepth, Outline, Skeleton};
use crate::skeleton::Node2d;
use nalgebra::{Point2, Point3};

/// The 3D skeleton of `flat`, with `tracks` points on each of its nodes: copied to planes, then
/// pushed.
pub fn build(
    flat: &[Node2d],
    tracks: &[u32],
    outline: &Outline,
    settings: &config::Shape,
) -> Skeleton {
    Tuned::of(flat, tracks, outline, settings).skeleton
}

/// As [`build`], of a tree of which a depth camera has seen the nodes of `flat` at these `depths`; they
/// may be fewer than the nodes.
pub fn build_seen(
    flat: &[Node2d],
    tracks: &[u32],
    outline: &Outline,
    settings: &config::Shape,
    depths: &[Option<NodeDepth>],
) -> Skeleton {
    let mut it = Prototype::seen(flat, tracks, outline, settings, depths);
    tune_term_weights(&mut it.skeleton, &it.trunk, &it.envelope, settings);
    it.skeleton
}

/// A tree in space, and what it was pushed by.
pub struct Tuned {
    pub skeleton: Skeleton,
    /// How the two terms weigh that suit it best.
    pub terms: Terms,
    pub envelope: Envelope,
}

impl Tuned {
    /// As [`build`].
    pub fn of(
        flat: &[Node2d],
        tracks: &[u32],
        outline: &Outline,
        settings: &config::Shape,
    ) -> Self {
        let mut it = Prototype::of(flat, tracks, outline, settings);
        let terms = tune_term_weights(&mut it.skeleton, &it.trunk, &it.envelope, settings);
        Self {
            skeleton: it.skeleton,
            terms,
            envelope: it.envelope,
        }
    }
}

/// As [`build`], with weights of the two terms that are known from another tree of the same form:
/// a single push.
pub fn build_like(
    flat: &[Node2d],
    tracks: &[u32],
    outline: &Outline,
    settings: &config::Shape,
    terms: Terms,
) -> Skeleton {
    let mut it = Prototype::of(flat, tracks, outline, settings);
    push(&mut it.skeleton, &it.trunk, &it.envelope, settings, terms);
    it.skeleton
}

/// What is pushed: copies on their planes, and what bounds them.
pub struct Prototype {
    pub skeleton: Skeleton,
    pub envelope: Envelope,
    /// Which of the measured nodes are trunk.
    pub trunk: Vec<bool>,
}

impl Prototype {
    /// Copies `flat` to its planes in the envelope that the settings name.
    pub fn of(
        flat: &[Node2d],
        tracks: &[u32],
        outline: &Outline,
        settings: &config::Shape,
    ) -> Self {
        Self::seen(flat, tracks, outline, settings, &[])
    }

    /// The same of a tree of which a depth camera has seen nodes.
    pub fn seen(
        flat: &[Node2d],
        tracks: &[u32],
        outline: &Outline,
        settings: &config::Shape,
        depths: &[Option<NodeDepth>],
    ) -> Self {
        let foot_px = flat.first().map_or(Point2::origin(), |n| n.position_px);
        let places: Vec<Point3<f64>> = flat
            .iter()
            .map(|n| model_from_image(n.position_px, foot_px))
            .collect();
        let envelope = Envelope::of_filmed(settings.envelope, outline, foot_px, &places);
        let envelope = envelope.with_seen(depths);
        let leader_px: Vec<Point2<f64>> = settings
            .leader_px
            .iter()
            .map(|p| Point2::from(*p))
            .collect();
        let trunk = trunk(flat, tracks, settings.leader, &leader_px);
        let skeleton = copy_to_planes(flat, tracks, &trunk, outline, &envelope, settings.planes);
        Self {
            skeleton,
            envelope,
            trunk,
        }
    }
}
