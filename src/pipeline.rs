//! What runs, on one screen: one synchronous step per frame, from the picture to the pose.
//!
//! The front end finds the outline and follows points; the back end logs them, has [`solve`] make
//! the model of the tree, and from then on poses it and now and then solves anew. `runtime` runs
//! the same two halves on threads of their own.
//!
//! [`solve`]: crate::solve::solve

mod back;
mod bark;
mod dress;
#[cfg(feature = "opencv")]
mod front;
mod leaves;
mod pose_tracker;
mod refiner;
mod reshape;
#[cfg(feature = "opencv")]
mod seeds;
mod seen;

pub use back::{BackEnd, Followed, Moved};
pub use dress::{dress, flutter};
#[cfg(feature = "opencv")]
pub use front::FrontEnd;
pub use pose_tracker::{PoseReplay, PoseTracker, Targets};
pub use refiner::SolveJob;
pub use reshape::{MOST_RESHAPED, cut_to, reshape};
#[cfg(feature = "opencv")]
pub use seeds::seeds as leaf_seeds;
pub use seen::Seen;

#[cfg(feature = "opencv")]
use crate::{
    cancel::CancelToken,
    config::Config,
    model::{Frame, Outline},
};

/// Both halves in one thread.
#[cfg(feature = "opencv")]
pub struct Pipeline {
    pub front: FrontEnd,
    pub back: BackEnd,
}

#[cfg(feature = "opencv")]
impl Pipeline {
    pub fn new(config: &Config, outline: Option<Outline>) -> Self {
        Self {
            front: FrontEnd::new(config, outline),
            back: BackEnd::new(config),
        }
    }

    /// One frame in; what became of it and of frames held back before, in order.
    pub fn step(&mut self, frame: Frame) -> Vec<Moved> {
        let followed = self.front.step(frame);
        followed.into_iter().map(|f| self.back.step(f)).collect()
    }

    /// No more frames: works off what is held and builds from what there is.
    pub fn finish(&mut self) -> Vec<Moved> {
        let followed = self.front.flush();
        let moved = followed.into_iter().map(|f| self.back.step(f)).collect();
        self.back.finish(&CancelToken::new());
        moved
    }
}
