//! The last stage: how the branches sway, from the points of the last seconds.

use super::angles::AngleWindow;
use super::back::{BackEnd, Moved};
use crate::cancel::CancelToken;
use crate::config::Dynamics;
use crate::dynamics::{Depth, Film, Take, analyse, spectrum};
use crate::model::{
    AngleSpectrum, Angles, BranchSway, ModeSummary, NodeId, NodeName, Skeleton, SwayNow, TrackId,
    TrackLog, moves_with,
};
use crate::solve::Model;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Follows the angles of the branches, and puts together what an analysis needs.
pub struct SwayStage {
    settings: Dynamics,
    angles: AngleWindow,
    skeleton: Option<Arc<Skeleton>>,
}

impl SwayStage {
    /// Remembers the last `dynamics.window_s` of the angles.
    pub fn new(settings: &Dynamics) -> Self {
        Self {
            settings: settings.clone(),
            angles: AngleWindow::new(settings.window_s),
            skeleton: None,
        }
    }

    /// The settings of the analysis.
    pub fn settings(&self) -> &Dynamics {
        &self.settings
    }

    /// Takes the frame that `back` has just posed.
    pub fn step(&mut self, moved: &Moved, back: &BackEnd) {
        let Some(model) = back.model() else {
            return;
        };
        if !self.follows(model) {
            self.angles.begin(&model.skeleton);
            self.skeleton = Some(model.skeleton.clone());
        }
        for (pose, _) in &moved.before {
            self.angles.push(pose);
        }
        if let Some(pose) = &moved.pose {
            self.angles.push(pose);
        }
    }

    /// All that an analysis needs, up to the frame of `moved`, the last that was taken. `None`
    /// while there is no tree, and where `back` has another one since.
    pub fn job(&self, moved: &Moved, back: &BackEnd) -> Option<SwayJob> {
        let model = back.model().filter(|model| self.follows(model))?;
        let nodes = match back.binding() {
            Some(binding) => binding.bound().map(|(id, node, _)| (id, node)).collect(),
            None => BTreeMap::new(),
        };
        Some(SwayJob {
            frame: moved.tracks.frame,
            time_s: moved.tracks.time_s,
            skeleton: model.skeleton.clone(),
            log: back.log().clone(),
            nodes,
            angles: self.angles.last(f64::INFINITY),
            settings: self.settings.clone(),
        })
    }

    fn follows(&self, model: &Model) -> bool {
        let followed = self.skeleton.as_ref();
        followed.is_some_and(|skeleton| Arc::ptr_eq(skeleton, &model.skeleton))
    }

    /// Forgets the tree.
    pub fn restart(&mut self) {
        *self = Self::new(&self.settings);
    }

    /// The angles of the last `span_s` seconds.
    pub fn angles(&self, span_s: f64) -> Angles {
        self.angles.last(span_s)
    }
}

/// All that an analysis needs, apart from everything that goes on meanwhile: it can be done on any
/// thread.
pub struct SwayJob {
    /// The newest frame and its time, s.
    pub(crate) frame: u64,
    pub(crate) time_s: f64,
    pub(crate) skeleton: Arc<Skeleton>,
    pub(crate) log: TrackLog,
    /// The deepest node of every point that counts.
    pub(crate) nodes: BTreeMap<TrackId, NodeId>,
    /// Of the skeleton's measured branches, in its order.
    pub(crate) angles: Angles,
    pub(crate) settings: Dynamics,
}

impl SwayJob {
    /// Length of the film that is analysed, s.
    pub fn span_s(&self) -> f64 {
        self.log.last(self.settings.window_s).span_s()
    }

    /// The sway of every branch, and the spectra of the angles. Branches that were not looked at
    /// when `cancel` ended the work are
    /// [`NotInTime`](Unidentified::NotInTime).
    pub fn run(&self, cancel: &CancelToken) -> SwayNow {
        let window = self.log.last(self.settings.window_s);
        let film = Film::from_log(window, &self.skeleton, |id| self.nodes.get(&id).copied());
        let film = Take::of(film).film;
        let analysis = analyse(&self.skeleton, &film, &self.settings, Depth::Quick, cancel);
        let mut branches = BTreeMap::new();
        let botanical = self.skeleton.botanical_branches();
        let nodes = (0..).map(NodeId).zip(&self.skeleton.nodes);
        for ((id, node), swaying) in nodes.zip(&analysis.sway) {
            // The foot is no branch, and what moves with another node is none of its own.
            if self.angles.nodes.contains(&node.name) {
                let sway = BranchSway {
                    swaying: *swaying,
                    moves_with: moves_with(swaying, &analysis.modes, &botanical, id),
                    spectrum: self.spectrum_of(node.name),
                };
                branches.insert(node.name, sway);
            }
        }
        SwayNow {
            frame: self.frame,
            time_s: self.time_s,
            span_s: film.span_s(),
            excitation: analysis.onset.map(|o| o.excitation),
            branches,
            modes: ModeSummary::all(&analysis.modes, &self.skeleton),
        }
    }

    /// Up to the highest frequency that is looked for.
    fn spectrum_of(&self, node: NodeName) -> Option<AngleSpectrum> {
        let (times, values): (Vec<f64>, Vec<f64>) = self.angles.of(node).unzip();
        let whole = spectrum(&times, &values)?;
        let bins = (self.settings.highest_hz / whole.bin_hz).ceil() as usize + 1;
        let amplitude_deg = whole
            .amplitude
            .into_iter()
            .take(bins)
            .map(|a| a as f32)
            .collect();
        Some(AngleSpectrum {
            bin_hz: whole.bin_hz,
            amplitude_deg,
        })
    }
}
