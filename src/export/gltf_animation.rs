//! The one animation of a glTF file: turns of joints, and the swing of leaves.

use super::gltf_buffer::{BufferBuilder, Layout, accessor, le_f32};
use super::gltf_model::Model;
use super::joints::Moving;
use super::thin_keys::{share, thin};
use crate::model::LeafSwing;
use gltf_json::accessor::Type;
use gltf_json::animation::{Animation, Channel, Interpolation, Property, Sampler, Target};
use gltf_json::validation::Checked::Valid;
use gltf_json::{Index, Node, Root};
use serde_json::json;

/// Keys of one property of one node; `values` has `width` numbers a key, in rows of `N`.
struct Track<const N: usize> {
    node: Index<Node>,
    times_s: Vec<f32>,
    values: Vec<[f32; N]>,
}

/// Adds the animation, if anything moves. `leaves` are the groups that are in the file, by their
/// place among all groups.
pub(super) fn push_animation(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    model: &Model,
    moving: &Moving,
    leaves: &[(usize, Index<Node>)],
) {
    let turns: Vec<Track<4>> = moving
        .joints
        .iter()
        .map(|k| Track {
            node: Index::new(k.node as u32),
            times_s: k.times_s.clone(),
            values: k.rotations.clone(),
        })
        .collect();
    let swings: Vec<Track<2>> = leaves
        .iter()
        .filter_map(|(k, node)| swing(model, moving, *k, *node))
        .collect();
    if turns.is_empty() && swings.is_empty() {
        return;
    }
    let name = Some("sway".to_string());
    let mut animation = Animation {
        extensions: None,
        extras: None,
        channels: Vec::new(),
        name,
        samplers: Vec::new(),
    };
    push_tracks(root, buffer, &mut animation, &turns, Property::Rotation);
    push_tracks(
        root,
        buffer,
        &mut animation,
        &swings,
        Property::MorphTargetWeights,
    );
    root.push(animation);
}

/// The weights of a group's displacements, thinned so that no leaf is off by more than the
/// tolerance; `None` where it never swings.
fn swing(model: &Model, moving: &Moving, group: usize, node: Index<Node>) -> Option<Track<2>> {
    let all = model.flutter.get(group)?;
    let weights: Vec<LeafSwing> = moving
        .kept
        .iter()
        .filter_map(|&k| all.get(k))
        .copied()
        .collect();
    if weights.iter().all(|w| *w == LeafSwing::default()) {
        return None;
    }
    let group = &model.dressed.foliage.groups[group];
    let swing = Swing {
        sine_reach_px: longest(&group.sine),
        cosine_reach_px: longest(&group.cosine),
        times_s: &moving.times_s,
        tolerance_px: model.tolerance_px,
        weights,
    };
    let kept = swing.thinned();
    Some(Track {
        node,
        times_s: kept.iter().map(|&k| swing.times_s[k] as f32).collect(),
        values: kept
            .iter()
            .map(|&k| [swing.weights[k].sine, swing.weights[k].cosine])
            .collect(),
    })
}

/// How one group of leaves swings.
struct Swing<'a> {
    /// In every frame.
    weights: Vec<LeafSwing>,
    times_s: &'a [f64],
    /// The farthest that a leaf goes by each of the two displacements.
    sine_reach_px: f64,
    cosine_reach_px: f64,
    tolerance_px: f64,
}

impl Swing<'_> {
    /// The frames of the keys that are kept.
    fn thinned(&self) -> Vec<usize> {
        let n = self.weights.len();
        let still = (0..n).all(|k| self.fits(0, 0, k));
        thin(n, still, |a, b| (a + 1..b).all(|k| self.fits(a, b, k)))
    }

    /// Whether frame `k` is near enough to the line between keys of frames `a` and `b`.
    fn fits(&self, a: usize, b: usize, k: usize) -> bool {
        let share = share(self.times_s, a, b, k);
        let [a, b, k] = [a, b, k].map(|i| self.weights[i]);
        let off_px = off_line(a.sine, b.sine, k.sine, share) * self.sine_reach_px
            + off_line(a.cosine, b.cosine, k.cosine, share) * self.cosine_reach_px;
        off_px <= self.tolerance_px
    }
}

/// By how much `k` is off what lies at `share` of the way from `a` to `b`.
fn off_line(a: f32, b: f32, k: f32, share: f64) -> f64 {
    let [a, b, k] = [a, b, k].map(f64::from);
    (a + (b - a) * share - k).abs()
}

/// Length of the longest of these ways.
fn longest(ways: &[[f32; 3]]) -> f64 {
    let mut longest = 0.0_f64;
    for [x, y, z] in ways {
        longest = longest.max(f64::from((x * x + y * y + z * z).sqrt()));
    }
    longest
}

/// All times lie in one view and all values in another.
fn push_tracks<const N: usize>(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    animation: &mut Animation,
    tracks: &[Track<N>],
    property: Property,
) {
    if tracks.is_empty() {
        return;
    }
    // Weights of displacements are single numbers one after another.
    let (shape, each) = if property == Property::Rotation {
        (Type::Vec4, 1)
    } else {
        (Type::Scalar, N)
    };
    let time_bytes = tracks
        .iter()
        .flat_map(|t| t.times_s.iter().flat_map(|t| t.to_le_bytes()));
    let times = buffer.view(root, time_bytes, None);
    let values = buffer.view(root, tracks.iter().flat_map(|t| le_f32(&t.values)), None);
    let mut before = 0;
    for track in tracks {
        let count = track.times_s.len();
        let mut input = accessor(times, 4 * before, Layout::f32(Type::Scalar), count);
        input.min = track.times_s.first().map(|t| json!([t]));
        input.max = track.times_s.last().map(|t| json!([t]));
        let input = root.push(input);
        let output = root.push(accessor(
            values,
            4 * N * before,
            Layout::f32(shape),
            count * each,
        ));
        before += count;
        let interpolation = Valid(Interpolation::Linear);
        let sampler = Index::new(animation.samplers.len() as u32);
        animation.samplers.push(Sampler {
            extensions: None,
            extras: None,
            input,
            interpolation,
            output,
        });
        let target = Target {
            extensions: None,
            extras: None,
            node: track.node,
            path: Valid(property),
        };
        animation.channels.push(Channel {
            sampler,
            target,
            extensions: None,
            extras: None,
        });
    }
}
