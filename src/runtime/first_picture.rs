//! The picture that goes into the capture: the first frame that is followed, whole and in colour.

use crate::model::{Picture, TimedFrame, TrackSet};
use crate::pipeline::DecodeStage;
use std::sync::Arc;

/// Decodes one frame in colour and hands it out when that frame is followed.
///
/// Frames are held back while the outline is looked for, and only the first of them is kept in
/// colour: all would take four times the room. If it is discarded, the newest is taken in its
/// place, and the picture is then not quite the first.
#[derive(Default)]
pub struct FirstPicture {
    kept: Option<Picture>,
    handed_out: bool,
}

impl FirstPicture {
    /// Looks at a frame that is about to be followed; `oldest_held` is the oldest that still waits
    /// for that.
    pub fn see(&mut self, timed: &TimedFrame, oldest_held: Option<u64>, decode: &mut DecodeStage) {
        if self.handed_out {
            return;
        }
        let lost = self
            .kept
            .as_ref()
            .is_some_and(|p| oldest_held.is_none_or(|oldest| p.frame < oldest));
        if self.kept.is_none() || lost {
            // A frame that cannot be decoded in colour is passed over; the next may be whole.
            let rgb = decode.colour(&timed.raw, timed.raw.size.width);
            self.kept = rgb.map(|rgb| Picture {
                rgb: Arc::new(rgb),
                frame: timed.index,
                time_s: timed.time_s,
            });
        }
    }

    /// The picture, if it shows this frame.
    pub fn of(&mut self, tracks: &TrackSet) -> Option<Picture> {
        let picture = self.kept.take_if(|p| p.frame <= tracks.frame)?;
        self.handed_out = true;
        Some(picture)
    }
}
