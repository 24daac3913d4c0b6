//! The front end: frame to tracks.

use super::back::Followed;
use crate::config::Config;
use crate::model::{Frame, Luma, Outline};
use crate::outline::{AutoOutline, Found};
use crate::track::{Tracker, WholeView};
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
    held: VecDeque<Frame>,
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
        self.held.push_back(frame);
        if self.found.is_none() {
            while self.held.iter().map(bytes_of).sum::<usize>() > HELD_BYTES {
                self.held.pop_front();
                self.let_go += 1;
            }
            if let Some(first) = self.held.front() {
                self.search.begin_at(first.time_s);
            }
            return Vec::new();
        }
        let n = self.held.len().min(FRAMES_PER_STEP);
        (0..n).filter_map(|_| self.follow_next()).collect()
    }

    /// Works off all held frames; an outline that was still looked for is what the frames so far
    /// show.
    pub fn flush(&mut self) -> Vec<Followed> {
        if self.found.is_none()
            && let Some(size) = self.held.back().map(|f| f.luma.size)
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
        (self.progress, self.no_motion) = (0.0, false);
    }

    /// How far the search for the outline is, 0 to 1; `None` when it is over.
    pub fn searching(&self) -> Option<f64> {
        self.found.is_none().then_some(self.progress)
    }

    /// The oldest of the frames that are held back.
    pub fn oldest_held(&self) -> Option<u64> {
        self.held.front().map(|f| f.index)
    }

    /// A picture buffer that is no longer needed, to decode the next frame into.
    pub fn spare(&mut self) -> Option<Luma> {
        self.spare.take()
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
        let frame = self.held.pop_front()?;
        let tracks = tracker.step(&frame);
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

/// Memory that a frame takes, bytes.
fn bytes_of(frame: &Frame) -> usize {
    let preview = frame.preview.as_ref().map_or(0, |p| p.pixels.len());
    let raw = frame.raw.as_ref().map_or(0, |raw| raw.bytes.len());
    frame.luma.pixels.len() + preview + raw
}
