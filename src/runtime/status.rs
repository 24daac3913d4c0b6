//! Gathers from the stream of poses what the screen shows.

use super::live_verdict::LiveVerdict;
use super::meter::Recent;
use super::shared::Shared;
use super::sway_watch::SwayWatch;
use crate::model::{
    BranchRow, NodeId, Observation, Phase, Rgb, Shake, Size, Skeleton, Snapshot, StillNeeded,
    SwayNow, TrackSet,
};
use crate::pipeline::{BackEnd, Moved, Targets};
use crate::signal::median;
use crate::solve::Model;
use crate::source::SourceInfo;
use nalgebra::Point2;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// The deepest level in the table of branches.
const TABLE_LEVEL: u8 = 5;
/// Time over which rates are taken, and over which the amplitude of a branch is, s.
const RATE_S: f64 = 5.0;
const BRANCH_S: f64 = 10.0;
/// Entries of the sparkline of errors, one for each quarter of a second.
const HISTORY: usize = 120;
const HISTORY_EVERY_S: f64 = 0.25;
/// The table is made anew at this interval, s.
const TABLE_EVERY_S: f64 = 1.0;

/// Running state of what is shown.
pub struct Status {
    snapshot: Snapshot,
    started: Instant,
    newest_s: Option<f64>,
    sensor: Recent,
    work: Recent,
    latency_ms: Recent,
    lost: Recent,
    fb_history: VecDeque<f64>,
    fb_noted_s: f64,
    /// Where the nodes of the table were in the last [`BRANCH_S`], by time, s.
    places_px: VecDeque<(f64, Vec<Point2<f64>>)>,
    table_nodes: Vec<usize>,
    table_rest_px: Vec<Point2<f64>>,
    table_made_s: f64,
    skeleton: Option<Arc<Skeleton>>,
}

impl Status {
    pub fn new(info: &SourceInfo) -> Self {
        Self::with(Snapshot {
            source: info.name.clone(),
            format: info.format.clone(),
            frames_total: info.frames_total,
            is_live: info.live,
            ..Snapshot::default()
        })
    }

    fn with(snapshot: Snapshot) -> Self {
        Self {
            snapshot,
            started: Instant::now(),
            newest_s: None,
            sensor: Recent::new(RATE_S),
            work: Recent::new(RATE_S),
            latency_ms: Recent::new(RATE_S),
            lost: Recent::new(RATE_S),
            fb_history: VecDeque::new(),
            fb_noted_s: f64::NEG_INFINITY,
            places_px: VecDeque::new(),
            table_nodes: Vec::new(),
            table_rest_px: Vec::new(),
            table_made_s: f64::NEG_INFINITY,
            skeleton: None,
        }
    }

    /// Forgets the tree.
    pub fn restart(&mut self) {
        let kept = std::mem::take(&mut self.snapshot);
        *self = Self {
            started: self.started,
            ..Self::with(Snapshot {
                source: kept.source,
                format: kept.format,
                frames_total: kept.frames_total,
                is_live: kept.is_live,
                ..Snapshot::default()
            })
        };
    }

    /// The outline is still looked for.
    pub fn searching(
        &mut self,
        progress: f64,
        preview: Option<Arc<Rgb>>,
        size: Size,
        (frame, time_s): (u64, f64),
    ) {
        self.arrived(time_s);
        let s = &mut self.snapshot;
        (s.phase, s.progress, s.frame, s.time_s) = (Phase::Outline, progress, frame, time_s);
        s.image_size = Some(size);
        if preview.is_some() {
            s.preview = preview;
        }
    }

    /// Counts a frame for the rates, but not again when it was held back while the outline was
    /// sought.
    fn arrived(&mut self, time_s: f64) {
        if self.newest_s.is_none_or(|newest| time_s > newest) {
            self.newest_s = Some(time_s);
            self.sensor.push(time_s, 0.0);
            self.work.push(self.started.elapsed().as_secs_f64(), 0.0);
        }
    }

    /// A frame is done.
    pub fn moved(&mut self, moved: &Moved, back: &BackEnd, verdict: &LiveVerdict) {
        let now_s = self.started.elapsed().as_secs_f64();
        let time_s = moved.tracks.time_s;
        self.arrived(time_s);
        self.latency_ms
            .push(now_s, moved.received.elapsed().as_secs_f64() * 1e3);
        self.lost.push(time_s, f64::from(moved.tracks.lost));
        let error_px = median_fb_error_px(&moved.tracks);
        if time_s - self.fb_noted_s >= HISTORY_EVERY_S {
            self.fb_noted_s = time_s;
            if self.fb_history.len() == HISTORY {
                self.fb_history.pop_front();
            }
            self.fb_history.push_back(error_px);
        }
        if let Some(tree) = back.model() {
            self.follow_tree(tree, moved);
        }
        let s = &mut self.snapshot;
        (s.phase, s.progress) = back.phase();
        s.still_needed = StillNeeded {
            for_sway_s: verdict.missing_s(),
            ..back.still_needed()
        };
        s.verdict = verdict.newest().cloned();
        (s.frame, s.time_s, s.fb_error_px) = (moved.tracks.frame, time_s, error_px);
        s.error_px = median_error_px(&moved.tracks);
        s.tracks_alive = moved.tracks.counted().count() as u32;
        s.background = Some(moved.tracks.camera.background);
        s.image_size = Some(moved.outline.size);
        s.pose.clone_from(&moved.pose);
        if let Some(preview) = &moved.preview {
            s.preview = Some(preview.clone());
        }
    }

    /// How the camera trembles.
    pub fn shakes(&mut self, shake: Option<Shake>) {
        self.snapshot.shake = shake;
    }

    /// An answer of the sway takes effect, if there is one.
    pub fn sways(&mut self, sway: Option<Arc<SwayNow>>) {
        self.snapshot.sway = sway.or(self.snapshot.sway.take());
    }

    /// Everything that costs more than a few additions is done here, at the screen's rate and not
    /// at the camera's.
    pub fn snapshot(
        &mut self,
        moved: Option<&Moved>,
        back: &BackEnd,
        sway: Option<&SwayWatch>,
        shared: &Shared,
    ) -> Arc<Snapshot> {
        let s = &mut self.snapshot;
        if let Some(sway) = sway {
            s.angles = sway.shown();
            (s.sway_at_end, s.sway_passed_over) = (sway.is_at_end(), sway.passed_over());
        }
        if let Some(moved) = moved {
            s.outline_px.clear();
            for corner in &moved.outline.polygon_px {
                let filmed_px = moved.tracks.camera.filmed_px(corner.cast());
                s.outline_px.push(filmed_px.map(|px| px.round() as i32));
            }
            let colour = |id| {
                back.binding()
                    .and_then(|b| b.node_of(id))
                    .and_then(|n| s.node_colour.get(n.index())?.as_ref().copied())
            };
            let (passed, on_trial): (Vec<&Observation>, Vec<&Observation>) =
                moved.tracks.observations.iter().partition(|o| o.confirmed);
            s.points = passed
                .into_iter()
                .map(|o| (moved.tracks.filmed_px(o).cast(), colour(o.id)))
                .collect();
            s.candidates_px = on_trial
                .into_iter()
                .map(|o| moved.tracks.filmed_px(o).cast())
                .collect();
        }
        if s.strokes_px != back.strokes_px() {
            s.strokes_px = back.strokes_px().to_vec();
        }
        s.wood = back.model().and_then(|model| model.wood.clone());
        s.wood_sight = back.wood_sight();
        s.sensor_rate_hz = self.sensor.rate_hz();
        s.work_rate_hz = self.work.rate_hz();
        s.latency_p50_ms = self.latency_ms.percentile(0.5);
        s.latency_p99_ms = self.latency_ms.percentile(0.99);
        s.lost_per_s = self.lost.sum_per_s();
        s.fb_history_px = self.fb_history.iter().copied().collect();
        s.lost_in_camera = shared.counts.lost_in_camera.load(Ordering::Relaxed);
        s.dropped_before_tracker = shared.counts.dropped_before_tracker.load(Ordering::Relaxed);
        s.undecodable = shared.counts.undecodable.load(Ordering::Relaxed);
        s.camera = shared.camera_state();
        s.not_shown = shared.screen.replaced();
        let (recorded, missing) = (&shared.counts.recorded, &shared.counts.not_recorded);
        let recording = shared.recording.load(Ordering::Relaxed);
        s.recorded = recording.then(|| {
            (
                recorded.load(Ordering::Relaxed),
                missing.load(Ordering::Relaxed),
            )
        });
        s.paused = shared.paused.load(Ordering::Relaxed);
        s.ended = shared.ended.load(Ordering::Relaxed);
        s.waits_for_room = shared.waits_for_room.load(Ordering::Relaxed);
        s.messages = shared.messages();
        Arc::new(s.clone())
    }

    fn follow_tree(&mut self, tree: &Model, moved: &Moved) {
        if self
            .skeleton
            .as_ref()
            .is_none_or(|s| !Arc::ptr_eq(s, &tree.skeleton))
        {
            self.skeleton = Some(tree.skeleton.clone());
            let nodes = &tree.skeleton.nodes;
            let branches = tree.skeleton.measured_branches().map(NodeId::index);
            self.table_nodes = branches
                .filter(|&i| nodes[i].level <= TABLE_LEVEL)
                .collect();
            let at_rest = |&i: &usize| tree.skeleton.image_from_model(&nodes[i].position);
            self.table_rest_px = self.table_nodes.iter().map(at_rest).collect();
            self.places_px.clear();
            self.table_made_s = f64::NEG_INFINITY;
            self.snapshot.show_tree(tree.skeleton.clone());
        }
        for (pose, targets_px) in &moved.before {
            self.note_places(pose.time_s, targets_px);
        }
        let time_s = moved.tracks.time_s;
        self.note_places(time_s, &moved.targets_px);
        if time_s - self.table_made_s >= TABLE_EVERY_S {
            self.table_made_s = time_s;
            self.snapshot.branches = self.table(&tree.skeleton);
        }
    }

    /// Remembers where the nodes of the table are.
    fn note_places(&mut self, time_s: f64, targets_px: &Targets) {
        let before = self.places_px.back().map(|(_, places)| places);
        let at = |k: usize, node: usize| {
            // A node that no track saw stays where it was, and before that is at rest.
            targets_px
                .get(node)
                .copied()
                .flatten()
                .or(before.map(|places| places[k]))
                .unwrap_or(self.table_rest_px[k])
        };
        let row = self
            .table_nodes
            .iter()
            .enumerate()
            .map(|(k, &node)| at(k, node))
            .collect();
        self.places_px.push_back((time_s, row));
        while self
            .places_px
            .front()
            .is_some_and(|(t, _)| *t < time_s - BRANCH_S)
        {
            self.places_px.pop_front();
        }
    }

    fn table(&self, skeleton: &Skeleton) -> Vec<BranchRow> {
        let row = |(k, &node): (usize, &usize)| {
            let path: Vec<Point2<f64>> =
                self.places_px.iter().map(|(_, places)| places[k]).collect();
            let n = &skeleton.nodes[node];
            BranchRow {
                node: n.name,
                name: self
                    .snapshot
                    .piece_names
                    .get(node)
                    .cloned()
                    .unwrap_or_default(),
                colour: self.snapshot.node_colour.get(node).copied().flatten(),
                level: n.level,
                n_tracks: n.n_tracks,
                amplitude_px: rms_px(&path),
            }
        };
        self.table_nodes.iter().enumerate().map(row).collect()
    }
}

/// Median forward-backward error of a frame's points, px; 0 if there are none.
pub fn median_fb_error_px(tracks: &TrackSet) -> f64 {
    median(
        tracks.counted().map(|o| o.fb_error_px).collect(),
        f32::total_cmp,
    )
    .map_or(0.0, f64::from)
}

/// Median of the errors that are expected of a frame's points, px.
pub fn median_error_px(tracks: &TrackSet) -> Option<f64> {
    median(
        tracks.counted().filter_map(|o| o.error_px).collect(),
        f32::total_cmp,
    )
    .map(f64::from)
}

fn rms_px(path: &[Point2<f64>]) -> f64 {
    let n = path.len().max(1) as f64;
    let mean = path
        .iter()
        .fold(Point2::origin(), |mean, p| mean + p.coords / n);
    (path.iter().map(|p| (p - mean).norm_squared()).sum::<f64>() / n).sqrt()
}
