//! The first stage: raw frames to the tracker's pictures.

use crate::config::Config;
use crate::model::{Frame, Luma, RawFrame, Rgb, Size, TimedFrame};
use crate::source::{DecodeError, Decoder};
use std::sync::Arc;
use std::time::Duration;

/// Width of the pictures for the screen, px.
const PREVIEW_WIDTH: u32 = 640;
/// Pictures of another size in a row that are taken for damage when a camera films.
const OTHER_SIZES: u32 = 5;

/// Why a frame has no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Undecoded {
    /// It is damaged and left out; the next one may be whole.
    #[error(transparent)]
    LeftOut(DecodeError),
    /// The film ends here.
    #[error(transparent)]
    EndsFilm(DecodeError),
}

/// Raw frames to pictures, all of one size.
pub struct DecodeStage {
    decoder: Decoder,
    /// A camera films; its damaged pictures may give themselves a wrong size.
    live: bool,
    /// `None` makes no pictures for a screen.
    preview_every_s: Option<f64>,
    /// Every frame gets its whole picture in colour.
    wants_colour: bool,
    /// Sensor time of the last picture for the screen, s.
    last_preview_s: Option<f64>,
    size: Option<Size>,
    /// Pictures of another size since the last one of the right size.
    other_sizes: u32,
}

impl DecodeStage {
    /// Frames come from a camera if they are `live`. Every `preview_every` of film a frame is given
    /// a picture for the screen, the first one too.
    ///
    /// # Errors
    /// There is no decoder.
    pub fn new(live: bool, preview_every: Option<Duration>) -> Result<Self, DecodeError> {
        Ok(Self {
            decoder: Decoder::new()?,
            live,
            preview_every_s: preview_every.map(|every| every.as_secs_f64()),
            wants_colour: false,
            last_preview_s: None,
            size: None,
            other_sizes: 0,
        })
    }

    /// For a film that is read, not for a live camera, and without pictures for a screen.
    ///
    /// # Errors
    /// There is no decoder.
    pub fn of_film(config: &Config) -> Result<Self, DecodeError> {
        let mut stage = Self::new(false, None)?;
        stage.set_wants_colour(config.markers.are_wanted());
        Ok(stage)
    }

    /// From the next frame on each gets its whole picture in colour, or not.
    pub fn set_wants_colour(&mut self, wants_colour: bool) {
        self.wants_colour = wants_colour;
    }

    /// Size of the pictures, once one was decoded.
    pub fn size(&self) -> Option<Size> {
        self.size
    }

    /// Decodes a frame, into `spare` if there is such a buffer.
    ///
    /// # Errors
    /// The frame is damaged or of another size: it is left out, or the film ends.
    pub fn step(&mut self, timed: &TimedFrame, spare: Option<Luma>) -> Result<Frame, Undecoded> {
        let luma = self
            .luma(&timed.raw, spare)
            .map_err(|e| self.undecoded(e))?;
        (self.size, self.other_sizes) = (Some(luma.size), 0);
        let colour = match self.wants_colour {
            true => self.colour(&timed.raw, timed.raw.size.width),
            false => None,
        };
        Ok(Frame {
            index: timed.index,
            time_s: timed.time_s,
            received: timed.received,
            luma,
            preview: self.preview(timed),
            colour,
            depth: timed.raw.depth.clone(),
            raw: Some(without_depth(&timed.raw)),
        })
    }

    /// The frame in colour, no wider than `max_width` px and else as large as is cheap; `None` if
    /// it cannot be decoded.
    pub fn colour(&mut self, raw: &RawFrame, max_width: u32) -> Option<Rgb> {
        self.decoder.preview(raw, max_width).ok()
    }

    fn luma(&mut self, raw: &RawFrame, spare: Option<Luma>) -> Result<Luma, DecodeError> {
        if let Some(expected) = self.size.filter(|size| *size != raw.size) {
            let found = raw.size;
            return Err(DecodeError::SizeChanged { expected, found });
        }
        let mut luma = spare.unwrap_or(Luma {
            size: raw.size,
            pixels: Vec::new(),
        });
        self.decoder.luma(raw, &mut luma)?;
        Ok(luma)
    }

    /// Damage can hit the size that a picture gives itself; a camera that really changes it keeps
    /// to that.
    fn undecoded(&mut self, error: DecodeError) -> Undecoded {
        match error {
            DecodeError::SizeChanged { .. } if self.live && self.other_sizes < OTHER_SIZES => {
                self.other_sizes += 1;
                Undecoded::LeftOut(error)
            }
            DecodeError::Damaged { .. } => Undecoded::LeftOut(error),
            _ => Undecoded::EndsFilm(error),
        }
    }

    /// A picture for the screen, if one is due by the sensor's clock.
    fn preview(&mut self, timed: &TimedFrame) -> Option<Arc<Rgb>> {
        let every_s = self.preview_every_s?;
        if self
            .last_preview_s
            .is_some_and(|last_s| timed.time_s - last_s < every_s)
        {
            return None;
        }
        self.last_preview_s = Some(timed.time_s);
        self.colour(&timed.raw, PREVIEW_WIDTH).map(Arc::new)
    }
}

/// A frame that is kept for its colours alone.
fn without_depth(raw: &Arc<RawFrame>) -> Arc<RawFrame> {
    match raw.depth {
        None => raw.clone(),
        Some(_) => Arc::new(RawFrame {
            depth: None,
            bytes: raw.bytes.clone(),
            ..**raw
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::PixelFormat;
    use std::time::Instant;

    const SMALL: Size = Size {
        width: 4,
        height: 2,
    };
    const LARGE: Size = Size {
        width: 8,
        height: 4,
    };

    /// A grey frame, ten a second.
    fn grey(size: Size, index: u64) -> TimedFrame {
        let raw = RawFrame {
            sequence: Some(index),
            sensor_time_s: index as f64 / 10.0,
            size,
            format: PixelFormat::Grey,
            bytes: vec![7; size.area()],
            depth: None,
        };
        TimedFrame::new(Arc::new(raw), index, 0.0, Instant::now())
    }

    fn stage(live: bool, preview_every: Option<Duration>) -> DecodeStage {
        DecodeStage::new(live, preview_every).expect("a decoder")
    }

    /// Damage can hit the size in a picture; a camera that was set to another size keeps to it.
    #[test]
    fn a_camera_may_give_a_wrong_size_five_times_in_a_row() {
        let mut stage = stage(true, None);
        for round in 0..2 {
            let whole = stage.step(&grey(SMALL, round), None);
            assert_eq!(whole.expect("a picture").luma.pixels, [7; 8]);
            for _ in 0..OTHER_SIZES {
                let other = stage.step(&grey(LARGE, round), None);
                assert!(matches!(other, Err(Undecoded::LeftOut(_))), "{other:?}");
            }
        }
        let other = stage.step(&grey(LARGE, 2), None);
        assert!(matches!(other, Err(Undecoded::EndsFilm(_))), "{other:?}");
        assert_eq!(stage.size(), Some(SMALL));
    }

    #[test]
    fn a_film_of_two_sizes_ends_where_the_size_changes() {
        let mut stage = stage(false, None);
        stage.step(&grey(SMALL, 0), None).expect("a picture");
        let other = stage.step(&grey(LARGE, 1), None);
        assert!(matches!(other, Err(Undecoded::EndsFilm(_))), "{other:?}");
    }

    #[test]
    fn pictures_for_the_screen_fall_due_by_the_sensor() {
        let frames_with_one = |preview_every| {
            let mut stage = stage(false, preview_every);
            let mut with_one = Vec::new();
            for index in 0..10 {
                let frame = stage.step(&grey(SMALL, index), None).expect("a picture");
                with_one.extend(frame.preview.map(|_| index));
            }
            with_one
        };
        assert_eq!(frames_with_one(Some(Duration::from_millis(390))), [0, 4, 8]);
        assert_eq!(frames_with_one(None), [0; 0]);
    }
}
