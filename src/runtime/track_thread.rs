//! The tracker's thread: decodes frames and runs the front end. Wishes of the user pass through
//! here in their order.

use super::first_picture::FirstPicture;
use super::pulse::Worker;
use super::shared::{Failure, Shared};
use crate::config::MarkerWindow;
use crate::depth::DepthLag;
use crate::model::{
    Control, Frame, LONGEST_LAG_S, Outline, Picture, Rgb, Size, TagScale, TagState, TimedFrame,
};
use crate::outline::{self, Scribbles};
use crate::pipeline::{DecodeStage, Followed, FrontEnd, TagNews, Undecoded};
use crate::source::DecodeError;
use crossbeam_channel::{Receiver, Sender, select};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Scribbles are solved on pictures no wider than this, px: a larger one would take seconds, and
/// shows no more branches.
const MATTING_WIDTH: u32 = 960;
/// Damaged frames that are reported one by one; further ones are only counted.
const DAMAGE_REPORTED: u64 = 5;

/// The warning where no tag is seen that was said to be there; in a film with depth, and without.
const NO_TAG_BUT_DEPTH: &str =
    "no tag of the family 36h11 is seen: lengths are by the depth of the film, if that holds";
const NO_TAG: &str = "no tag of the family 36h11 is seen: lengths stay in pixels; print it larger, with its \
                      white rim, or hang it in the light (--tag)";

/// What the model thread gets.
pub enum ToModel {
    /// Of the frame that follows.
    Picture(Picture),
    Followed(Followed),
    /// What the tag beside the trunk says.
    Tag(TagScale),
    /// No tag is seen: a film with depth has the scale of that.
    NoTag,
    /// The markers as they were given, found or picked.
    Markers(Vec<MarkerWindow>),
    /// The outline is still looked for: how far, and a picture to look at.
    Searching {
        progress: f64,
        preview: Option<Arc<Rgb>>,
        size: Size,
        frame: u64,
        time_s: f64,
    },
    /// Start again.
    Restart,
    /// One more line along a branch, px.
    AddStroke(Vec<[f64; 2]>),
    TakeBackStroke,
    BuildNow,
    Export,
}

/// Runs until the queue's other end is gone.
pub struct TrackThread<'a> {
    decode: DecodeStage,
    front: FrontEnd,
    /// Waiting for the first picture.
    scribbles: Option<Scribbles>,
    to_model: Sender<ToModel>,
    shared: &'a Shared,
    last_damage: Option<DecodeError>,
    picture: FirstPicture,
    /// The user has heard that the clocks of colour and depth do not agree.
    is_lag_said: bool,
    /// The markers cannot be followed: nothing more is to be made of what was filmed.
    is_refused: bool,
}

impl<'a> TrackThread<'a> {
    pub fn new(
        decode: DecodeStage,
        front: FrontEnd,
        scribbles: Option<Scribbles>,
        to_model: Sender<ToModel>,
        shared: &'a Shared,
    ) -> Self {
        Self {
            decode,
            front,
            scribbles,
            to_model,
            shared,
            last_damage: None,
            picture: FirstPicture::default(),
            is_lag_said: false,
            is_refused: false,
        }
    }

    /// Works off frames and wishes; a wish that has arrived is honoured before the next frame.
    pub fn run(mut self, frames: &Receiver<TimedFrame>, controls: &Receiver<Control>) {
        loop {
            while let Ok(wish) = controls.try_recv() {
                self.honour(wish);
            }
            let alive = select! {
                recv(frames) -> timed => timed.is_ok_and(|timed| self.work_off(&timed)),
                recv(controls) -> wish => {
                    match wish {
                        Ok(wish) => self.honour(wish),
                        // Nobody can ask for anything any more; the frames go on.
                        Err(_) => match frames.recv() {
                            Ok(timed) => if !self.work_off(&timed) { break },
                            Err(_) => break,
                        },
                    }
                    true
                }
            };
            if !alive {
                break;
            }
        }
        if self.is_refused {
            return;
        }
        for followed in self.front.flush() {
            if !self.pass_on_followed(followed) {
                break;
            }
        }
        self.report();
        self.report_markers();
    }

    fn honour(&mut self, wish: Control) {
        match wish {
            Control::SetOutline(polygon_px) => match self
                .decode
                .size()
                .map(|size| outline::from_polygon(&polygon_px, size))
            {
                Some(Ok(outline)) => self.restart(Some(outline)),
                Some(Err(e)) => self.shared.warn(e.to_string()),
                None => self
                    .shared
                    .warn("no picture has arrived yet that an outline could be drawn on".into()),
            },
            Control::AddStroke(points_px) => {
                let stroke_px = points_px.into_iter().map(Into::into).collect();
                self.pass_on(ToModel::AddStroke(stroke_px));
            }
            Control::TakeBackStroke => drop(self.pass_on(ToModel::TakeBackStroke)),
            Control::PickMarkers(places_px) => {
                self.decode.set_wants_colour(true);
                self.front.pick_markers(places_px);
            }
            Control::HangMarkers(places_px) => self.front.hang_markers(places_px),
            Control::Restart => self.restart(None),
            Control::BuildNow => drop(self.pass_on(ToModel::BuildNow)),
            Control::Export => drop(self.pass_on(ToModel::Export)),
            Control::Pause(on) => self.shared.paused.store(on, Ordering::Relaxed),
            Control::Quit => self.shared.stop_at_once(),
        }
    }

    fn restart(&mut self, outline: Option<Outline>) {
        if outline.is_some() {
            self.scribbles = None;
        }
        self.front.restart(outline);
        self.picture = FirstPicture::default();
        self.pass_on(ToModel::Restart);
    }

    /// `false` when there is no model any more.
    fn pass_on(&self, message: ToModel) -> bool {
        self.shared.pulse.give(Worker::Model);
        self.to_model.send(message).is_ok()
    }

    /// `false` when nothing further can be done.
    fn work_off(&mut self, timed: &TimedFrame) -> bool {
        let go_on = self.follow(timed);
        self.shared.pulse.done(Worker::Track);
        go_on
    }

    fn follow(&mut self, timed: &TimedFrame) -> bool {
        let spare = self.front.spare();
        match self.decode.step(timed, spare) {
            Ok(frame) => self.follow_decoded(timed, frame),
            Err(Undecoded::LeftOut(error)) => {
                self.leave_out(timed, error);
                true
            }
            Err(Undecoded::EndsFilm(error)) => {
                let frame = timed.index;
                self.shared.abort(Failure::Frame { frame, error });
                false
            }
        }
    }

    fn follow_decoded(&mut self, timed: &TimedFrame, frame: Frame) -> bool {
        let preview = frame.preview.clone();
        self.picture
            .see(timed, self.front.oldest_held(), &mut self.decode);
        self.solve_scribbles(timed, preview.clone());
        let done = self.front.step(frame);
        self.report();
        self.report_markers();
        if let Some(e) = self.front.take_marker_error() {
            self.shared.abort(Failure::Markers(e));
            self.is_refused = true;
            return false;
        }
        if let Some(progress) = self.front.searching() {
            let (size, frame, time_s) = (timed.raw.size, timed.index, timed.time_s);
            return self.pass_on(ToModel::Searching {
                progress,
                preview,
                size,
                frame,
                time_s,
            });
        }
        done.into_iter()
            .all(|followed| self.pass_on_followed(followed))
    }

    fn pass_on_followed(&mut self, followed: Followed) -> bool {
        let picture = self.picture.of(&followed.tracks);
        picture.is_none_or(|picture| self.pass_on(ToModel::Picture(picture)))
            && self.pass_on(ToModel::Followed(followed))
    }

    /// Scribbles are drawn on the first picture, and solved as soon as it is there. That takes a
    /// second or two, in which the screen shows the picture and what is going on; frames of a live
    /// camera that find no room meanwhile are counted.
    fn solve_scribbles(&mut self, timed: &TimedFrame, preview: Option<Arc<Rgb>>) {
        if self.scribbles.is_none() {
            return;
        }
        let Some(picture) = self.decode.colour(&timed.raw, MATTING_WIDTH) else {
            return;
        };
        let Some(scribbles) = self.scribbles.take() else {
            return;
        };
        self.shared
            .tell("the tree is cut out along the scribbles".into());
        let (size, frame, time_s) = (timed.raw.size, timed.index, timed.time_s);
        self.pass_on(ToModel::Searching {
            progress: 0.0,
            preview,
            size,
            frame,
            time_s,
        });
        match outline::from_scribbles(&scribbles, &picture) {
            Ok(outline) => self.front.restart(Some(outline)),
            Err(e) => self
                .shared
                .warn(format!("{e}; the tree is looked for by its motion")),
        }
    }

    fn leave_out(&mut self, timed: &TimedFrame, e: DecodeError) {
        let n = self
            .shared
            .counts
            .undecodable
            .fetch_add(1, Ordering::Relaxed);
        if n < DAMAGE_REPORTED {
            self.shared
                .warn(format!("frame {} is left out: {e}", timed.index));
        } else if n == DAMAGE_REPORTED {
            self.shared.warn(
                "more frames cannot be decoded; capture.json counts them (frames_undecodable)"
                    .into(),
            );
        }
        self.last_damage = Some(e);
    }

    /// Says what became of markers and the tag, and hands on which there are.
    fn report_markers(&mut self) {
        for event in self.front.take_marker_events() {
            match event.is_warning() {
                true => self.shared.warn(event.to_string()),
                false => self.shared.tell(event.to_string()),
            }
        }
        for news in self.front.take_tag_news() {
            match news {
                TagNews::Scale(scale) => {
                    self.shared.tell(tag_line(&scale));
                    self.show_tag(scale, true);
                    self.pass_on(ToModel::Tag(scale));
                }
                TagNews::Seen(scale) => {
                    self.show_tag(scale, true);
                    self.pass_on(ToModel::Tag(scale));
                }
                TagNews::Unseen(scale) => self.show_tag(scale, false),
                TagNews::NoneSeen if self.front.has_depth() => {
                    self.shared.warn(NO_TAG_BUT_DEPTH.into());
                    self.pass_on(ToModel::NoTag);
                }
                TagNews::NoneSeen => self.shared.warn(NO_TAG.into()),
                TagNews::Disputed(off_px) => self.shared.warn(dispute_line(off_px)),
            }
        }
        if let Some(markers) = self.front.take_new_markers() {
            self.pass_on(ToModel::Markers(markers));
        }
    }

    /// Says once that depth images are of another moment than their pictures.
    fn report_depth_lag(&mut self) {
        if self.is_lag_said {
            return;
        }
        if let Some(line) = self.front.depth_lag().as_ref().and_then(lag_line) {
            self.is_lag_said = true;
            self.shared.warn(line);
        }
    }

    fn show_tag(&self, scale: TagScale, is_seen: bool) {
        self.shared
            .camera(|camera| camera.tag = Some(TagState { scale, is_seen }));
    }

    fn report(&mut self) {
        self.report_depth_lag();
        self.shared
            .counts
            .before_outline
            .store(self.front.let_go, Ordering::Relaxed);
        if std::mem::take(&mut self.front.no_motion) {
            self.shared.warn(
                "nothing moved enough to find the tree by; the whole picture is taken: wait for wind, come nearer, \
                 keep the camera still, or give an outline (--outline FILE, or key o)"
                    .into(),
            );
        }
        let decoded = self.decode.size().is_some();
        if let (false, Some(e)) = (decoded, &self.last_damage)
            && self.shared.counts.undecodable.load(Ordering::Relaxed) > 0
        {
            self.shared.fail(Failure::NothingDecoded(e.clone()));
        }
    }
}

/// The warning where the surroundings move against the tag.
fn dispute_line(off_px: f64) -> String {
    format!(
        "what stands around the tree moves against the tag, by {off_px:.1} px so far: the camera's \
         motion is that of the tag alone from here on; the tag must hang still"
    )
}

/// The warning where the clocks of colour and depth do not agree, by the tree's motion in both.
fn lag_line(lag: &DepthLag) -> Option<String> {
    if lag.drifts() {
        let way = match lag.drift > 0.0 {
            true => "falls behind",
            false => "runs ahead",
        };
        return Some(format!(
            "the clocks of colour and depth do not run alike: by the tree's motion in both, depth {way} by {:.1} ms \
             each second, and depths of what moves are of another moment: set the times right, or give --no-depth",
            1000.0 * lag.drift.abs()
        ));
    }
    let way = match lag.late_s > 0.0 {
        true => "later",
        false => "earlier",
    };
    let late_s = lag.given_s + lag.late_s;
    let advice = match late_s.abs() <= LONGEST_LAG_S {
        true => format!("give --depth-late {late_s:.3}"),
        false => "set the times right, or give --no-depth".to_owned(),
    };
    lag.is_late().then(|| {
        format!(
            "by the tree's motion in both, depth images are stamped {:.3} s {way} than they were taken (±{:.3} s): \
             {advice}",
            lag.late_s.abs(),
            2.0 * lag.late_sd_s
        )
    })
}

/// What the user hears of a tag.
fn tag_line(scale: &TagScale) -> String {
    format!(
        "tag {}: a pixel is {:.5} m at the tree, within {:.1} %; it leans by {:.1} degrees",
        scale.id,
        scale.metres_per_px,
        100.0 * scale.relative_error(),
        scale.roll_deg
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(late_s: f64, drift: f64, given_s: f64) -> String {
        let lag = DepthLag {
            given_s,
            late_s,
            late_sd_s: 0.001,
            drift,
            drift_sd: 0.0001,
            span_s: 20.0,
        };
        lag_line(&lag).unwrap_or_default()
    }

    #[test]
    fn clocks_that_do_not_agree_are_named_with_what_to_do() {
        assert_eq!(said(0.015, 0.0005, 0.0), "");
        assert!(
            said(0.05, 0.0, 0.02)
                .contains("0.050 s later than they were taken (±0.002 s): give --depth-late 0.070")
        );
        assert!(
            said(-0.05, 0.0, 0.0).contains("0.050 s earlier")
                && said(-0.05, 0.0, 0.0).contains("--depth-late -0.050")
        );
        assert!(said(0.1, 0.0, 0.2).ends_with("set the times right, or give --no-depth"));
        assert!(said(0.1, -0.02, 0.0).contains("runs ahead by 20.0 ms each second"));
        assert!(said(0.1, 0.02, 0.0).contains("falls behind by 20.0 ms"));
    }
}
