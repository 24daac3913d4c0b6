//! Pictures and videos of a prepared forest.

use super::studio::{PLAIN, VIDEO_S, model, nearest, png, samples, swing_at, write_video};
use super::{PrepareError, PreparedForest, Shot};
use crate::draw::{BoundingCylinder, Camera, Look, Model, Placed, Posed, Rgba, scene};
use crate::geometry::{GROUND_RGB, Mesh, ground};
use crate::model::{ForestTree, Size};
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Trees that are ahead are so by quarters of the loop.
const QUARTERS: f64 = 4.0;

/// The forest before its camera. Of a shot the view, the size, the background, whether it is bare and
/// turns, the moment, the length and the rate count.
pub struct ForestStudio<'a> {
    forest: &'a PreparedForest,
    shot: &'a Shot,
    size: Size,
    /// Of the templates.
    models: Vec<Model<'a>>,
    ground: Mesh,
    /// Holds all trees at rest in any turn.
    bounds: BoundingCylinder,
}

/// A template in a pose: its number, and that of the pose; `None` at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Standing {
    template: usize,
    pose: Option<usize>,
}

impl<'a> ForestStudio<'a> {
    /// # Errors
    /// There is nothing to be drawn of a template.
    pub fn new(forest: &'a PreparedForest, shot: &'a Shot) -> Result<Self, PrepareError> {
        let mut models = Vec::with_capacity(forest.templates.len());
        for tree in &forest.templates {
            let wood = tree.dressed.wood.first();
            let wood = wood.ok_or(PrepareError::NothingToDraw)?;
            models.push(model(tree, wood, shot.bare));
        }
        let mut studio = Self {
            forest,
            shot,
            size: shot.size.unwrap_or(PLAIN),
            models,
            ground: ground(&forest.document.forest.ground),
            bounds: BoundingCylinder {
                low: Point3::origin(),
                high: Point3::origin(),
                radius: 0.0,
            },
        };
        let posed = studio.posed(None);
        let trees = studio.placed(&posed, None)?;
        let plot = Posed::of_mesh(&studio.ground, GROUND_RGB);
        studio.bounds = bounds(&plot, &trees).ok_or(PrepareError::NothingToDraw)?;
        Ok(studio)
    }

    /// The bytes of a picture (PNG): at rest, or at the moment of the shot.
    ///
    /// # Errors
    /// There is nothing to be drawn of a template.
    pub fn picture(&self) -> Result<Vec<u8>, PrepareError> {
        Ok(png(&self.draw(self.shot.at_s, 0.0)?)?)
    }

    /// Writes a video (MP4) of the trees in motion to `out`.
    ///
    /// # Errors
    /// There is no ffmpeg; the file exists or cannot be written; or it was stopped.
    pub fn video(&self, out: &Path, stop: &AtomicBool) -> Result<(), PrepareError> {
        let length_s = self.shot.length_s.unwrap_or(VIDEO_S);
        let frames = ((length_s * self.shot.fps).round() as u64).max(1);
        write_video(out, self.shot.fps, frames, stop, |k| {
            self.draw(Some(k as f64 / self.shot.fps), k as f64 / frames as f64)
        })
    }

    /// The forest so long after its motion began, s, or at rest; `share` of a video is over.
    fn draw(&self, since_s: Option<f64>, share: f64) -> Result<Rgba, PrepareError> {
        let posed = self.posed(since_s);
        let trees = self.placed(&posed, since_s)?;
        let look = Look {
            samples: samples(self.size),
            shadow: self.shot.turntable && self.forest.document.forest.ground.is_flat(),
            ..Look::default()
        };
        let mut view = self.shot.view;
        if self.shot.turntable {
            view.turn += TAU * share;
        }
        let camera = Camera::fitting(&self.bounds, view, false, self.size);
        let plot = Posed::of_mesh(&self.ground, GROUND_RGB);
        let mut below = Rgba::of_one(self.size, self.shot.background);
        below.put(&scene(&plot, &trees, &camera, &look));
        Ok(below)
    }

    /// Every template in every pose that a tree has at a moment.
    fn posed(&self, since_s: Option<f64>) -> BTreeMap<Standing, Posed<'_>> {
        let mut posed = BTreeMap::new();
        for tree in &self.forest.document.forest.trees {
            let standing = self.standing(tree, since_s);
            let Some(template) = self.forest.templates.get(standing.template) else {
                continue;
            };
            posed.entry(standing).or_insert_with(|| {
                let model = &self.models[standing.template];
                match standing.pose {
                    Some(k) => model.posed(template.poses.get(k), &swing_at(template, k)),
                    None => model.posed(None, &[]),
                }
            });
        }
        posed
    }

    /// The pose of a tree at a moment: one that is ahead is so by its share of the loop, which begins
    /// anew at its end.
    fn standing(&self, tree: &ForestTree, since_s: Option<f64>) -> Standing {
        let poses = self.forest.templates.get(tree.template).map(|t| &t.poses);
        let pose = since_s.zip(poses).and_then(|(since_s, poses)| {
            let first_s = poses.first()?.time_s;
            let long_s = (poses.last()?.time_s - first_s).max(f64::MIN_POSITIVE);
            let ahead_s = f64::from(tree.ahead) / QUARTERS * long_s;
            let at_s = match since_s + ahead_s > long_s {
                true => (since_s + ahead_s) % long_s,
                false => since_s + ahead_s,
            };
            nearest(poses, first_s + at_s)
        });
        Standing {
            template: tree.template,
            pose,
        }
    }

    fn placed<'p>(
        &self,
        posed: &'p BTreeMap<Standing, Posed<'p>>,
        since_s: Option<f64>,
    ) -> Result<Vec<Placed<'p>>, PrepareError> {
        let forest = &self.forest.document.forest;
        let mut trees = Vec::with_capacity(forest.trees.len());
        for tree in &forest.trees {
            let posed = posed.get(&self.standing(tree, since_s));
            trees.push(Placed {
                posed: posed.ok_or(PrepareError::NothingToDraw)?,
                foot: tree.foot,
                turn_rad: tree.turn_rad,
                scale: tree.scale * forest.metres_per_px,
            });
        }
        Ok(trees)
    }
}

/// What holds the ground and all trees in any turn.
fn bounds(ground: &Posed, trees: &[Placed]) -> Option<BoundingCylinder> {
    let mut points = Vec::new();
    if let Some(plot) = ground.bounds() {
        points.extend([plot.low, plot.high]);
    }
    for tree in trees {
        let Some(own) = tree.posed.bounds() else {
            continue;
        };
        let reach = Vector3::new(own.radius, 0.0, own.radius) * tree.scale;
        let up = |y: f64| Point3::new(tree.foot.x, tree.foot.y + y * tree.scale, tree.foot.z);
        points.extend([up(own.low.y) - reach, up(own.high.y) + reach]);
    }
    BoundingCylinder::of(points)
}
