//! A printed tag beside the trunk: frames to a scale.

use crate::config::{self, Config};
use crate::depth;
use crate::model::{Frame, Size, TagScale};
use crate::signal::vectors::keep_every_other;
use crate::tag::{Tag, TagCamera, TagSeen, find_tags, scale_of};

/// The scale is fixed after so many sights, in one of so many frames; from then on the tag is looked at in
/// one of more frames, which tells whether the camera moves.
const SIGHTS: usize = 10;
const EVERY: u64 = 3;
const EVERY_THEN: u64 = 30;
/// Sights that are kept: memory does not grow with the film. When there are too many, every other one goes.
const MAX_SIGHTS: usize = 1000;
/// After so many frames without a sight the user should know.
const FRAMES_WITHOUT: u64 = 90;

/// What has become of the tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TagNews {
    /// The scale is known.
    Scale(TagScale),
    /// The same with later sights, of which the scale does not take notice.
    Seen(TagScale),
    /// It was looked for later and not seen.
    Unseen(TagScale),
    /// There is none in the first frames.
    NoneSeen,
    /// What stands around the tree moves against it, by so much, px.
    Disputed(f64),
}

/// Looks for the tag, where there is one.
pub(super) struct TagStage {
    settings: config::Tag,
    /// What the film says of its colour camera, where it has depth.
    depth: config::Depth,
    /// The camera; `None` before the first frame.
    camera: Option<TagCamera>,
    sights: Vec<TagSeen>,
    /// In how many frames it was seen.
    times_seen: usize,
    frames: u64,
    scale: Option<TagScale>,
    news: Vec<TagNews>,
}

impl TagStage {
    pub fn new(config: &Config) -> Self {
        Self {
            settings: config.tag.clone(),
            depth: config.depth.clone(),
            camera: None,
            sights: Vec::new(),
            times_seen: 0,
            frames: 0,
            scale: None,
            news: Vec::new(),
        }
    }

    /// Looks for it in the next frame, if it is that one's turn; the tag if it is seen there.
    pub fn step(&mut self, frame: &Frame) -> Option<Tag> {
        let every = if self.scale.is_some() {
            EVERY_THEN
        } else {
            EVERY
        };
        let is_turn = self.frames.is_multiple_of(every);
        self.frames += 1;
        if self.settings.size_m <= 0.0 {
            return None;
        }
        if self.camera.is_none() {
            self.camera = Some(camera(&self.settings, &self.depth, frame.luma.size));
        }
        let mut in_frame = None;
        if is_turn {
            let known = self.sights.first().map(|seen| seen.tag.id);
            let tags = find_tags(&frame.luma);
            let tag = tags.iter().find(|tag| known.is_none_or(|id| id == tag.id));
            let seen = tag.and_then(TagSeen::of);
            self.keep(seen);
            in_frame = seen.map(|seen| seen.tag);
            if let Some(fixed) = self.scale {
                let known = self.with_all_sights(fixed);
                self.news.push(match seen {
                    Some(_) => TagNews::Seen(known),
                    None => TagNews::Unseen(known),
                });
            }
        }
        if self.scale.is_none() && self.sights.len() >= SIGHTS {
            self.fix();
        }
        if self.frames == FRAMES_WITHOUT && self.sights.is_empty() {
            self.say_none_seen();
        }
        in_frame
    }

    /// Says that none is seen. A film with depth does without it from then on: one capture has one scale.
    fn say_none_seen(&mut self) {
        self.news.push(TagNews::NoneSeen);
        if depth::format(&self.depth).is_some() {
            self.settings.size_m = 0.0;
        }
    }

    fn keep(&mut self, seen: Option<TagSeen>) {
        self.times_seen += usize::from(seen.is_some());
        self.sights.extend(seen);
        if self.sights.len() > MAX_SIGHTS {
            keep_every_other(&mut self.sights);
        }
    }

    /// What stands around the tree moves against the tag, by so much, px.
    pub fn dispute(&mut self, off_px: f64) {
        self.news.push(TagNews::Disputed(off_px));
    }

    /// There are no more frames.
    pub fn finish(&mut self) {
        let is_short = self.settings.size_m > 0.0 && self.frames < FRAMES_WITHOUT;
        if is_short && self.sights.is_empty() {
            self.say_none_seen();
        }
        match self.scale {
            None => self.fix(),
            Some(fixed) => {
                let known = self.with_all_sights(fixed);
                self.news.push(TagNews::Seen(known));
            }
        }
    }

    /// The scale as it was fixed, with what later sights say of how often it was seen and of the camera.
    fn with_all_sights(&self, fixed: TagScale) -> TagScale {
        match self.scale_of_sights() {
            Some(all) => TagScale {
                frames: self.times_seen,
                moves_px: all.moves_px,
                ..fixed
            },
            None => fixed,
        }
    }

    fn fix(&mut self) {
        self.scale = self.scale_of_sights();
        self.news.extend(self.scale.map(TagNews::Scale));
    }

    fn scale_of_sights(&self) -> Option<TagScale> {
        scale_of(&self.sights, self.settings.size_m, self.camera.as_ref()?)
    }

    pub fn take_news(&mut self) -> Vec<TagNews> {
        std::mem::take(&mut self.news)
    }
}

/// The camera of a film: as the user says, else as a film with depth says, else unknown.
fn camera(tag: &config::Tag, depth: &config::Depth, size: Size) -> TagCamera {
    if tag.field_of_view_deg > 0.0 {
        return TagCamera::of_view(size, tag.field_of_view_deg);
    }
    match depth::colour_camera(depth, size) {
        Some(model) => TagCamera::known(model),
        None => TagCamera::unknown(size),
    }
}
