//! What is reported of the sway while it films.

use super::{Excitation, ModeSummary, NodeName, Participation, Swaying};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Amplitude spectrum of a branch's angle, for the eye.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AngleSpectrum {
    /// Width of a bin, Hz; bin k stands for k times that.
    pub bin_hz: f64,
    /// Amplitude of the sine wave that would make such a bin, degrees.
    pub amplitude_deg: Vec<f32>,
}

/// How one branch sways, by the last seconds of film.
#[derive(Clone, Debug, PartialEq)]
pub struct BranchSway {
    pub swaying: Swaying,
    /// Where it has no frequency of its own: the modes of the tree that it moves with, the largest
    /// share first.
    pub moves_with: Vec<Participation>,
    /// `None` where its angle was not seen for long enough.
    pub spectrum: Option<AngleSpectrum>,
}

/// The sway of all measured branches, by the last seconds of film.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SwayNow {
    /// The last frame that it is from, its time, and how much film was looked at up to there, s.
    pub frame: u64,
    pub time_s: f64,
    pub span_s: f64,
    /// What made the tree sway; `None` where there is too little film to tell.
    pub excitation: Option<Excitation>,
    pub branches: BTreeMap<NodeName, BranchSway>,
    /// The modes of the whole tree, the slowest first.
    pub modes: Vec<ModeSummary>,
}

/// The angles of the branches to those that carry them, frame by frame, oldest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Angles {
    /// Which branch each column is.
    pub nodes: Arc<[NodeName]>,
    /// Time (s) and angles (degrees, signed, counterclockwise for the viewer; no number where a
    /// branch has none).
    pub rows: Vec<(f64, Arc<[f32]>)>,
}

impl Angles {
    /// Times (s) and angles (degrees) of one branch; nothing for a branch that is not there.
    pub fn of(&self, node: NodeName) -> impl Iterator<Item = (f64, f64)> {
        let column = self.nodes.iter().position(|n| *n == node);
        self.rows
            .iter()
            .filter_map(move |(t, row)| Some((*t, f64::from(*row.get(column?)?))))
    }
}
