//! What runs, on one screen: one synchronous step per frame, from the camera's bytes to the pose.
//!
//! Four stages. `DecodeStage` makes a picture of the bytes. The front end finds the outline and
//! follows points. The back end logs them, has [`solve`] make the model of the tree, and from then
//! on poses it and now and then solves anew. [`SwayStage`] analyses how the branches of the model
//! sway. `runtime` runs the same stages on threads of their own.
//!
//! [`solve`]: crate::solve::solve

mod angles;
mod back;
mod bark;
#[cfg(feature = "opencv")]
mod certainty;
#[cfg(feature = "camera")]
mod decode;
mod drawn;
mod dress;
mod film_log;
#[cfg(feature = "opencv")]
mod front;
mod grown;
mod leaves;
#[cfg(feature = "opencv")]
mod marked;
#[cfg(feature = "opencv")]
mod photograph;
mod pose_tracker;
mod refiner;
mod reshape;
mod scanned;
#[cfg(feature = "opencv")]
mod seeds;
mod seen;
#[cfg(feature = "opencv")]
mod settling;
mod sway;
#[cfg(feature = "opencv")]
mod tagged;
#[cfg(feature = "opencv")]
mod unaided;
#[cfg(all(feature = "camera", feature = "opencv"))]
mod wood;

pub use back::{BackEnd, Followed, Moved};
#[cfg(feature = "opencv")]
pub use certainty::Certainty;
#[cfg(feature = "camera")]
pub use decode::{DecodeStage, Undecoded};
pub use drawn::{stand_drawn, thickened};
pub use dress::{dress, flutter};
pub use film_log::{FilmLog, KeptFrame};
#[cfg(feature = "opencv")]
pub use front::FrontEnd;
pub use grown::stand_grown;
#[cfg(feature = "opencv")]
pub use photograph::{Both, DrawnPart, InTurn, PhotoError, PhotoOptions, TreeInPhoto, see_tree};
pub use pose_tracker::{PoseReplay, PoseTracker, Targets};
pub use refiner::SolveJob;
pub use reshape::{MOST_RESHAPED, cut_to, grown_terms, reshape};
pub use scanned::{ScaledTree, as_scanned, stand_scanned};
#[cfg(feature = "opencv")]
pub use seeds::seeds as leaf_seeds;
pub use seen::Seen;
pub use sway::{SwayJob, SwayStage};
#[cfg(feature = "opencv")]
pub use tagged::TagNews;
#[cfg(all(feature = "camera", feature = "opencv"))]
pub use wood::find_wood;

#[cfg(all(feature = "camera", feature = "opencv"))]
use crate::{
    cancel::CancelToken,
    config::Config,
    model::{Outline, SwayNow, TimedFrame},
    source::DecodeError,
};

/// All stages in one thread.
#[cfg(all(feature = "camera", feature = "opencv"))]
pub struct Pipeline {
    pub decode: DecodeStage,
    pub front: FrontEnd,
    pub back: BackEnd,
    pub sway: SwayStage,
}

#[cfg(all(feature = "camera", feature = "opencv"))]
impl Pipeline {
    /// For a film that is read, not for a live camera, and without pictures for a screen.
    ///
    /// # Errors
    /// There is no decoder.
    pub fn new(config: &Config, outline: Option<Outline>) -> Result<Self, DecodeError> {
        Ok(Self {
            decode: DecodeStage::of_film(config)?,
            front: FrontEnd::new(config, outline),
            back: BackEnd::new(config),
            sway: SwayStage::new(&config.dynamics),
        })
    }

    /// One frame in; what became of it and of frames held back before, in order.
    ///
    /// # Errors
    /// The frame is damaged, or of another size than those before it. After one that is left out
    /// the next can be given.
    pub fn step(&mut self, timed: &TimedFrame) -> Result<Vec<Moved>, Undecoded> {
        let spare = self.front.spare();
        let frame = self.decode.step(timed, spare)?;
        let followed = self.front.step(frame);
        Ok(self.pose(followed))
    }

    /// No more frames: works off what is held and builds from what there is.
    pub fn finish(&mut self) -> Vec<Moved> {
        let followed = self.front.flush();
        let moved = self.pose(followed);
        self.back.finish(&CancelToken::new());
        moved
    }

    /// How the branches sway up to the frame of `moved`, the last that [`step`](Self::step) gave;
    /// `None` while there is no tree.
    pub fn sway(&self, moved: &Moved, cancel: &CancelToken) -> Option<SwayNow> {
        let job = self.sway.job(moved, &self.back)?;
        Some(job.run(cancel))
    }

    fn pose(&mut self, followed: Vec<Followed>) -> Vec<Moved> {
        let mut all = Vec::with_capacity(followed.len());
        for followed in followed {
            let moved = self.back.step(followed);
            self.sway.step(&moved, &self.back);
            all.push(moved);
        }
        all
    }
}
