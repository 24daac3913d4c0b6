//! The animation of a glTF model (glTF 2.0 app. C).

use super::error::ImportError;
use super::gltf_file::{GltfFile, bad};
use gltf::animation::{Interpolation, Property};
use gltf::scene::Transform;
use nalgebra::{Quaternion, UnitQuaternion, Vector4};

/// How one property of a node changes with time.
pub(super) struct Channel {
    pub node: usize,
    property: Property,
    interpolation: Interpolation,
    /// Growing.
    pub times_s: Vec<f64>,
    /// At each time, of a spline also its tangents before and after; unused parts are 0.
    values: Vec<Vector4<f64>>,
}

/// The channels of the first animation that move nodes.
///
/// # Errors
/// A table is missing or cut off, or its times do not grow.
pub(super) fn channels(file: &GltfFile) -> Result<Vec<Channel>, ImportError> {
    let mut channels = Vec::new();
    let first = file.document.animations().next();
    for channel in first.iter().flat_map(gltf::Animation::channels) {
        let (target, sampler) = (channel.target(), channel.sampler());
        let values = match target.property() {
            Property::Rotation => four(file.floats::<4>(&sampler.output())?),
            Property::Translation | Property::Scale => three(file.floats::<3>(&sampler.output())?),
            Property::MorphTargetWeights => continue,
        };
        let times_s: Vec<f64> = file
            .floats::<1>(&sampler.input())?
            .into_iter()
            .map(|[time_s]| time_s)
            .collect();
        let each = match sampler.interpolation() {
            Interpolation::CubicSpline => 3,
            Interpolation::Linear | Interpolation::Step => 1,
        };
        // What is no number does not grow either.
        let grows = times_s.windows(2).all(|pair| pair[0] < pair[1]);
        let is_finite = values.iter().all(|v| v.iter().all(|x| x.is_finite()));
        if !grows || !is_finite || times_s.is_empty() || values.len() != each * times_s.len() {
            return Err(bad("its animation has times or values that cannot be"));
        }
        channels.push(Channel {
            node: target.node().index(),
            property: target.property(),
            interpolation: sampler.interpolation(),
            times_s,
            values,
        });
    }
    Ok(channels)
}

fn four(values: Vec<[f64; 4]>) -> Vec<Vector4<f64>> {
    values.into_iter().map(Vector4::from).collect()
}

fn three(values: Vec<[f64; 3]>) -> Vec<Vector4<f64>> {
    let filled = values.into_iter().map(|[x, y, z]| [x, y, z, 0.0]);
    filled.map(Vector4::from).collect()
}

impl Channel {
    /// Puts the property's value at a time, s, into a node's transform.
    pub fn apply(&self, to: &mut Transform, time_s: f64) {
        let value = self.at(time_s);
        let (mut translation, mut rotation, mut scale) = to.clone().decomposed();
        let of_three = [value.x, value.y, value.z].map(|x| x as f32);
        match self.property {
            Property::Translation => translation = of_three,
            Property::Scale => scale = of_three,
            Property::Rotation => {
                let unit = UnitQuaternion::new_normalize(Quaternion::from(value));
                rotation = [unit.i, unit.j, unit.k, unit.w].map(|x| x as f32);
            }
            Property::MorphTargetWeights => {}
        }
        *to = Transform::Decomposed {
            translation,
            rotation,
            scale,
        };
    }

    fn at(&self, time_s: f64) -> Vector4<f64> {
        let after = self.times_s.partition_point(|t| *t <= time_s);
        let last = self.times_s.len() - 1;
        let before = after.saturating_sub(1);
        if after == 0 || before == last || self.interpolation == Interpolation::Step {
            return self.key(before);
        }
        let step_s = self.times_s[after] - self.times_s[before];
        let share = (time_s - self.times_s[before]) / step_s;
        match self.interpolation {
            Interpolation::CubicSpline => self.on_spline(before, share, step_s),
            _ if self.property == Property::Rotation => {
                let [from, to] = [before, after]
                    .map(|k| UnitQuaternion::new_normalize(Quaternion::from(self.key(k))));
                // Opposite turns have no way between them.
                let between = from.try_slerp(&to, share, 1e-9).unwrap_or(from);
                between.into_inner().coords
            }
            _ => self.key(before).lerp(&self.key(after), share),
        }
    }

    /// The value at a key.
    fn key(&self, k: usize) -> Vector4<f64> {
        match self.interpolation {
            Interpolation::CubicSpline => self.values[3 * k + 1],
            Interpolation::Linear | Interpolation::Step => self.values[k],
        }
    }

    /// Hermite's spline between two keys that are `step_s` apart.
    fn on_spline(&self, before: usize, t: f64, step_s: f64) -> Vector4<f64> {
        let (out, into) = (self.values[3 * before + 2], self.values[3 * before + 3]);
        let (t2, t3) = (t * t, t * t * t);
        self.key(before) * (2.0 * t3 - 3.0 * t2 + 1.0)
            + out * (step_s * (t3 - 2.0 * t2 + t))
            + self.key(before + 1) * (3.0 * t2 - 2.0 * t3)
            + into * (step_s * (t3 - t2))
    }
}
