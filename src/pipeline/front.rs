//! The front end: frame to tracks.

use super::back::Followed;
use super::marked::{MarkerDepths, MarkerStage};
use super::tagged::{TagNews, TagStage};
use crate::config::{Config, MarkerWindow};
use crate::depth::{DepthGate, DepthLag, DepthReader, LagMeter};
use crate::markers::{MarkerError, MarkerEvent, MarkerPlace};
use crate::model::{DepthImage, Frame, Luma, Outline, Size, TrackSet};
use crate::outline::{AutoOutline, Found};
use crate::tag::Tag;
use crate::track::{Tracker, WholeView};
use nalgebra::Point2;
use std::collections::VecDeque;
use std::sync::Arc;

/// Frames kept while the outline is not known yet take at most so many bytes; beyond that the
/// oldest is discarded.
const HELD_BYTES: usize = 80 << 20;
/// Frames worked off in one step while held ones remain: catches up without a long pause.
const FRAMES_PER_STEP: usize = 3;

/// Frame to tracks: outline, detection, tracking.
pub struct FrontEnd {
    config: Config,
    /// What the user gave; `None` finds it by motion.
    given: Option<Arc<Outline>>,
    search: AutoOutline,
    /// The camera's motion while the outline is looked for.
    view: WholeView,
    found: Option<(Arc<Outline>, Tracker)>,
    held: VecDeque<Held>,
    markers: MarkerStage,
    tag: TagStage,
    depth: Option<DepthReader>,
    depth_gate: DepthGate,
    depth_lag: Option<LagMeter>,
    next_id: u32,
    spare: Option<Luma>,
    progress: f64,
    /// Frames that went by before there was an outline.
    pub let_go: u64,
    pub no_motion: bool,
}

impl FrontEnd {
    pub fn new(config: &Config, outline: Option<Outline>) -> Self {
        Self {
            config: config.clone(),
            given: outline.map(Arc::new),
            search: AutoOutline::new(&config.outline),
            view: WholeView::new(&config.track),
            found: None,
            held: VecDeque::new(),
            markers: MarkerStage::new(&config.markers),
            tag: TagStage::new(config),
            depth: DepthReader::new(&config.depth),
            depth_lag: LagMeter::new(&config.depth),
            depth_gate: DepthGate::default(),
            next_id: 0,
            spare: None,
            progress: 0.0,
            let_go: 0,
            no_motion: false,
        }
    }

    /// Takes a frame; gives back up to three that are done, none while the outline is being looked
    /// for.
    pub fn step(&mut self, mut frame: Frame) -> Vec<Followed> {
        if !self.config.skeleton.along_wood {
            frame.raw = None;
        }
        if self.found.is_none() {
            match &self.given {
                Some(outline) => self.settle(outline.clone()),
                None => self.search_in(&frame),
            }
        }
        let tag = self.tag.step(&frame);
        let depth = frame.depth.clone();
        let depths = MarkerDepths {
            gate: &self.depth_gate,
            reader: self.depth.as_ref(),
            image: depth.as_deref(),
            picture: frame.luma.size,
        };
        let region = self.given.as_deref();
        let markers = self.markers.step(&mut frame, region, &depths);
        self.held.push_back(Held {
            frame,
            markers,
            tag,
        });
        if self.found.is_none() {
            while self.held.iter().map(Held::bytes).sum::<usize>() > HELD_BYTES {
                self.held.pop_front();
                self.let_go += 1;
            }
            if let Some(first) = self.held.front() {
                self.search.begin_at(first.frame.time_s);
            }
            return Vec::new();
        }
        let n = self.held.len().min(FRAMES_PER_STEP);
        (0..n).filter_map(|_| self.follow_next()).collect()
    }

    /// Works off all held frames; an outline that was still looked for is what the frames so far
    /// show.
    pub fn flush(&mut self) -> Vec<Followed> {
        self.markers.finish();
        self.tag.finish();
        if self.found.is_none()
            && let Some(size) = self.held.back().map(|held| held.frame.luma.size)
        {
            let outline = self.search.conclude(size);
            self.no_motion = outline.is_none();
            self.settle(Arc::new(
                outline.unwrap_or_else(|| crate::outline::whole(size)),
            ));
        }
        std::iter::from_fn(|| self.follow_next()).collect()
    }

    /// Starts again, with a new outline if one is given. Track ids go on.
    pub fn restart(&mut self, outline: Option<Outline>) {
        if let Some((_, tracker)) = self.found.take() {
            self.next_id = tracker.next_id();
        }
        self.given = outline.map(Arc::new).or(self.given.take());
        self.search = AutoOutline::new(&self.config.outline);
        self.view = WholeView::new(&self.config.track);
        self.held.clear();
        self.markers.restart();
        (self.progress, self.no_motion) = (0.0, false);
    }

    /// How far the search for the outline is, 0 to 1; `None` when it is over.
    pub fn searching(&self) -> Option<f64> {
        self.found.is_none().then_some(self.progress)
    }

    /// The oldest of the frames that are held back.
    pub fn oldest_held(&self) -> Option<u64> {
        self.held.front().map(|held| held.frame.index)
    }

    /// A picture buffer that is no longer needed, to decode the next frame into.
    pub fn spare(&mut self) -> Option<Luma> {
        self.spare.take()
    }

    /// What has become of the tag since the last call.
    pub fn take_tag_news(&mut self) -> Vec<TagNews> {
        self.tag.take_news()
    }

    /// What has become of markers since the last call.
    pub fn take_marker_events(&mut self) -> Vec<MarkerEvent> {
        self.markers.take_events()
    }

    /// Why markers could not be followed from the first frame on; once.
    pub fn take_marker_error(&mut self) -> Option<MarkerError> {
        self.markers.take_error()
    }

    /// The markers as they were given, found or picked, where that has changed since the last call.
    pub fn take_new_markers(&mut self) -> Option<Vec<MarkerWindow>> {
        self.markers.take_new()
    }

    /// Follows more markers, that are picked at these places, px, of the next frame.
    pub fn pick_markers(&mut self, places_px: Vec<Point2<f64>>) {
        self.markers.pick(places_px);
    }

    /// Hangs the markers nearest to these places, px, on each other, the first nearest to the foot, in the next frame.
    pub fn hang_markers(&mut self, places_px: Vec<Point2<f64>>) {
        self.markers.hang(places_px);
    }

    /// Whether the film has depth.
    pub fn has_depth(&self) -> bool {
        self.depth.is_some()
    }

    /// How late the film's depth images are, where they show that.
    pub fn depth_lag(&self) -> Option<DepthLag> {
        self.depth_lag.as_ref()?.lag()
    }

    /// Looks for the outline in one more frame.
    fn search_in(&mut self, frame: &Frame) {
        let camera = self.view.step(frame);
        match self.search.step(&frame.luma, frame.time_s, &camera) {
            Found::NotYet(progress) => self.progress = progress,
            Found::Tree(outline) => self.settle(Arc::new(outline)),
            Found::NoMotion(outline) => {
                self.no_motion = true;
                self.settle(Arc::new(outline));
            }
        }
    }

    fn settle(&mut self, outline: Arc<Outline>) {
        let tracker = Tracker::new(
            &self.config.detect,
            &self.config.track,
            &outline,
            self.next_id,
        );
        self.found = Some((outline, tracker));
    }

    fn follow_next(&mut self) -> Option<Followed> {
        let (outline, tracker) = self.found.as_mut()?;
        let Held {
            frame,
            markers,
            tag,
        } = self.held.pop_front()?;
        if let Some(tag) = tag.filter(|tag| hangs_beside(tag, outline)) {
            tracker.see_tag(tag.corners_px);
        }
        let mut tracks = tracker.step(&frame);
        if let Some(off_px) = tracker.take_tag_dispute() {
            self.tag.dispute(off_px);
        }
        self.markers.join(&markers, &mut tracks);
        if let (Some(reader), Some(image)) = (&self.depth, &frame.depth) {
            look_up_depths(reader, image, frame.luma.size, &mut tracks);
            self.depth_gate.step(&mut tracks.observations);
        }
        if let Some(meter) = &mut self.depth_lag {
            meter.step(&tracks, frame.luma.size, frame.depth.as_ref());
        }
        self.spare = Some(frame.luma);
        Some(Followed {
            tracks,
            outline: outline.clone(),
            preview: frame.preview,
            raw: frame.raw,
            received: frame.received,
        })
    }
}

/// Whether a tag is beside the tree: one that hangs on it sways with it.
fn hangs_beside(tag: &Tag, tree: &Outline) -> bool {
    !tag.corners_px.iter().any(|at| tree.contains(at.x, at.y))
}

/// Gives the points of a frame their depth.
fn look_up_depths(reader: &DepthReader, image: &DepthImage, picture: Size, tracks: &mut TrackSet) {
    let camera = tracks.camera;
    for o in &mut tracks.observations {
        o.depth = reader.at(image, picture, camera.filmed_px(o.at_px()));
    }
}

/// A frame that waits to be worked off, and the markers and the tag in it.
struct Held {
    frame: Frame,
    markers: Vec<MarkerPlace>,
    tag: Option<Tag>,
}

impl Held {
    /// Memory that it takes, bytes.
    fn bytes(&self) -> usize {
        let preview = self.frame.preview.as_ref().map_or(0, |p| p.pixels.len());
        let raw = self.frame.raw.as_ref().map_or(0, |raw| raw.bytes.len());
        let depth = self.frame.depth.as_ref().map_or(0, |depth| depth.bytes());
        self.frame.luma.pixels.len() + preview + raw + depth
    }
}
