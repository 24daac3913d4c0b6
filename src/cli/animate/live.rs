//! Animations on the terminal, controlled by keys.

use crate::animate::{Animator, Magnify, Pull, magnify, place_to_pull};
use crate::model::{Pose, Skeleton};
use crate::tui::{AnimationCommand, Moving};
use crate::views::PreparedTree;
use std::sync::Arc;

/// Lean of a pulled tree, degrees.
const LEAN_DEG: f64 = 12.0;
/// Every key press magnifies the motion by this factor.
const MAGNIFY_STEP: f64 = 1.25;
/// Largest number of such steps, up or down.
const MAX_STEPS: i8 = 12;
/// Poses per second of the filmed motion.
const FPS: f64 = 30.0;

/// A tree in wind that the user controls.
pub struct WindAnimation {
    skeleton: Arc<Skeleton>,
    animator: Animator,
    rope: Option<Pull>,
    force: f64,
    direction_deg: f64,
    magnify_steps: i8,
    frame: u64,
}

impl WindAnimation {
    /// `animator` simulates the wind in the configuration of `tree`.
    pub fn new(tree: &PreparedTree, animator: Animator) -> Self {
        let wind = &tree.config.wind;
        let mut still = animator.clone();
        still.pull_aside(place_to_pull(&tree.skeleton), wind.direction_deg, LEAN_DEG);
        Self {
            skeleton: tree.skeleton.clone(),
            rope: still.pulled(),
            animator,
            force: wind.force,
            direction_deg: wind.direction_deg,
            magnify_steps: 0,
            frame: 0,
        }
    }
}

impl Moving for WindAnimation {
    fn skeleton(&self) -> Arc<Skeleton> {
        self.skeleton.clone()
    }

    fn pose(&mut self, elapsed_s: f64) -> Pose {
        if elapsed_s > 0.0 {
            self.animator.advance(elapsed_s);
        }
        self.frame += 1;
        self.animator.pose(self.frame)
    }

    fn change(&mut self, command: AnimationCommand) {
        match command {
            AnimationCommand::Stronger(by) => {
                self.force = (self.force + f64::from(by)).clamp(0.0, 12.0)
            }
            AnimationCommand::Veer(by) => {
                self.direction_deg = (self.direction_deg + f64::from(by)).rem_euclid(360.0)
            }
            AnimationCommand::Larger(by) => {
                self.magnify_steps = (self.magnify_steps + by).clamp(-MAX_STEPS, MAX_STEPS);
                self.animator
                    .magnify(MAGNIFY_STEP.powi(self.magnify_steps.into()));
            }
            AnimationCommand::Pull => {
                let rope = if self.animator.pulled().is_some() {
                    None
                } else {
                    self.rope
                };
                self.animator.pull(rope);
            }
        }
        self.animator.wind().turn_to(self.force, self.direction_deg);
    }

    fn description(&self) -> String {
        let pulled = if self.animator.pulled().is_some() {
            "  pulled"
        } else {
            ""
        };
        format!(
            "wind {:.0} of 12 ({})  to {:.0}°  magnified {:.2}{pulled}",
            self.force,
            name(self.force),
            self.direction_deg,
            MAGNIFY_STEP.powi(self.magnify_steps.into())
        )
    }
}

/// Name of a force of wind on the Beaufort scale (World Meteorological Organization).
fn name(force: f64) -> &'static str {
    match force.round() as u8 {
        0 => "still",
        1 => "light air",
        2 => "light breeze",
        3 => "gentle breeze",
        4 => "moderate breeze",
        5 => "fresh breeze",
        6 => "strong breeze",
        7 => "near gale",
        8 => "gale",
        9 => "strong gale",
        10 => "storm",
        11 => "violent storm",
        _ => "hurricane",
    }
}

/// The filmed motion, forwards and backwards, magnified as the user says.
pub struct FilmAnimation {
    skeleton: Arc<Skeleton>,
    film: Vec<Pose>,
    options: Magnify,
    shown: Vec<Pose>,
    time_s: f64,
}

impl FilmAnimation {
    /// # Errors
    /// Those of [`magnify`].
    pub fn new(
        tree: &PreparedTree,
        options: Magnify,
    ) -> Result<Self, crate::animate::MagnifyError> {
        let mut new = Self {
            skeleton: tree.skeleton.clone(),
            film: tree.poses.clone(),
            options: Magnify {
                looped: false,
                ..options
            },
            shown: Vec::new(),
            time_s: 0.0,
        };
        new.shown = new.magnified()?;
        Ok(new)
    }

    /// The poses of the magnified film, forwards and backwards.
    fn magnified(&self) -> Result<Vec<Pose>, crate::animate::MagnifyError> {
        let length_s = self
            .film
            .last()
            .zip(self.film.first())
            .map_or(0.0, |(b, a)| b.time_s - a.time_s);
        let count = (2.0 * length_s * FPS / self.options.speed).clamp(1.0, 600.0 * FPS) as u64;
        magnify(&self.skeleton, &self.film, &self.options, FPS, count)
    }
}

impl Moving for FilmAnimation {
    fn skeleton(&self) -> Arc<Skeleton> {
        self.skeleton.clone()
    }

    fn pose(&mut self, elapsed_s: f64) -> Pose {
        self.time_s += elapsed_s;
        let k = (self.time_s * FPS) as usize % self.shown.len().max(1);
        self.shown.get(k).cloned().unwrap_or_else(|| Pose {
            frame: 0,
            time_s: 0.0,
            joints: Vec::new(),
        })
    }

    fn change(&mut self, command: AnimationCommand) {
        if let AnimationCommand::Larger(by) = command {
            let from = self.options.by.max(MAGNIFY_STEP.powi((-MAX_STEPS).into()));
            self.options.by = (from * MAGNIFY_STEP.powi(by.into())).min(100.0);
            // Cannot fail: it worked with another factor.
            if let Ok(shown) = self.magnified() {
                self.shown = shown;
            }
        }
    }

    fn description(&self) -> String {
        format!(
            "as filmed, magnified {:.2}, speed {:.2}",
            self.options.by, self.options.speed
        )
    }
}
