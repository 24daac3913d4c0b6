//! Documents of trees in point clouds.

use super::PrepareError;
use super::drawn::{DrawnTree, note};
use super::film_fit::{FilmFit, Grounds};
use crate::cloud::{CloudTree, verdict};
use crate::config::{Config, LeafShow};
use crate::document::note::{LaidBranch, ScanFilmNote, ScanNote};
use crate::model::{Finding, Grade, Outline, PointCloud, Swaying};
use crate::pipeline::ScaledTree;
use nalgebra::Vector3;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Sizes of a tree by film and by scan differ by no more than this factor: a height that was guessed is off by some
/// percent.
const LARGEST_RATIO: f64 = 1.2;
/// Less than this is written as none, degrees.
const LEAST_LEAN_DEG: f64 = 0.05;

/// A film that was laid on a scan.
#[derive(Clone, Debug)]
pub struct FilmOnScan {
    pub fit: FilmFit,
    /// By node index of the scanned tree.
    pub sway: Vec<Swaying>,
    /// Where each filmed branch with a frequency went.
    pub laid: Vec<LaidBranch>,
    /// A tag was seen in the film.
    pub has_tag: bool,
    /// As the film knows it; 0 where it does not.
    pub film_metres_per_px: f64,
}

impl FilmOnScan {
    /// Pieces of branches that carry a filmed frequency.
    pub fn branches(&self) -> usize {
        self.sway.iter().filter(|s| s.is_ok()).count()
    }

    /// What the user should know before trusting it.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        let warnings = [
            self.size_warning(),
            self.lean_warning(),
            self.unsure_warning(),
        ];
        warnings.into_iter().flatten()
    }

    /// The warning where film and scan have the tree in two sizes.
    fn size_warning(&self) -> Option<String> {
        let times = self.fit.registration.to_picture.scaling() * self.film_metres_per_px;
        let is_other = times > 0.0 && !(1.0 / LARGEST_RATIO..=LARGEST_RATIO).contains(&times);
        is_other.then(|| {
            format!(
                "by its own scale the film has the tree {times:.2} times as large as the scan; check the unit of the \
                 scan (--unit) and the scale of the film, or it is another tree"
            )
        })
    }

    fn is_by_pairs(&self) -> bool {
        self.fit.grounds == Grounds::Pairs
    }

    /// That of a registration which lines did not make surer.
    fn unsure_warning(&self) -> Option<String> {
        let unsure = "the film lies on the scan by its pairs alone: the lines of film and scan do not confirm it; more \
                      pairs, all over the tree, make it surer";
        self.is_by_pairs().then(|| unsure.to_owned())
    }

    /// What is not as it should be of a registration that nothing but its pairs tells.
    pub fn finding(&self) -> Option<Finding> {
        self.is_by_pairs().then(|| Finding {
            grade: Grade::Fair,
            reason: "the film lies on the scan by its pairs alone".to_owned(),
            advice: "give more pairs, all over the tree".to_owned(),
        })
    }

    /// The warning where the places of the tree at rest are less sure than where it was filmed.
    fn lean_warning(&self) -> Option<String> {
        let lean = self.fit.lean.filter(|_| self.fit.is_rest_unsure())?;
        let advice = match self.has_tag {
            true => "",
            false => "; hang a tag upright beside the trunk (--tag)",
        };
        let lean_deg = lean.angle.to_degrees();
        let why = match lean_deg.abs() < LEAST_LEAN_DEG {
            true => {
                "how far the tree leans in the film, or the camera was rolled, is not known surer"
                    .to_owned()
            }
            false => format!(
                "the tree leans in the film, or the camera was rolled, by {lean_deg:.1} degrees"
            ),
        };
        let off = 100.0 * lean.rest_off_hi;
        Some(format!(
            "{why}; places at rest may be off by {off:.1} % of the height{advice}"
        ))
    }

    fn note(&self) -> ScanFilmNote {
        let registration = &self.fit.registration;
        let shift_px = registration.to_picture.isometry.translation.vector;
        ScanFilmNote {
            turn_deg: registration.turn.to_degrees(),
            roll_deg: registration
                .to_picture
                .isometry
                .rotation
                .angle()
                .to_degrees(),
            px_per_metre: registration.to_picture.scaling(),
            shift_px: shift_px.into(),
            off_hi: Some(self.fit.off_hi),
            lean_deg: self.fit.lean.map(|lean| lean.angle.to_degrees()),
            rest_off_hi: self.fit.lean.map(|lean| lean.rest_off_hi),
            miss: registration.miss,
            other_side_miss: registration.other_side_miss,
            branches: self.branches() as u64,
            laid: self.laid.clone(),
        }
    }

    /// Where each filmed branch with a frequency went, a line for those that are on the scan and one for the others.
    pub fn whereabouts(&self) -> Vec<String> {
        let (on, off): (Vec<&LaidBranch>, Vec<&LaidBranch>) =
            self.laid.iter().partition(|laid| !laid.scan.is_empty());
        let mut lines = Vec::new();
        if !on.is_empty() {
            let each = on
                .iter()
                .map(|laid| format!("{} on {}", laid.film, laid.scan.join(", ")));
            let each: Vec<String> = each.collect();
            lines.push(format!("from the film to the scan: {}", each.join("; ")));
        }
        if !off.is_empty() {
            let names: Vec<&str> = off.iter().map(|laid| laid.film.as_str()).collect();
            lines.push(format!(
                "branches of the film with a frequency that no branch of the scan was given: {}",
                names.join(", ")
            ));
        }
        lines
    }
}

/// The settings that trees of point clouds have if no others are given: nothing is added to what
/// was scanned.
pub fn scan_defaults() -> Config {
    let mut config = Config::default();
    config.shape.planes = 1;
    config.wood.curl = 0.0;
    config.wood.max_twigs = 0;
    config.leaves.show = LeafShow::Off;
    config
}

impl DrawnTree {
    /// The tree of a cloud, which is `scaled` in space, within `region` in its picture. `name` says
    /// where the cloud is from.
    pub fn scanned(
        name: String,
        cloud: &PointCloud,
        tree: &CloudTree,
        scaled: ScaledTree,
        region: &Outline,
        mut config: Config,
    ) -> Self {
        config.export.metres_per_px = scaled.metres_per_px;
        let mut note = note(name, &scaled.skeleton, region, config);
        note.scan = Some(scan_note(cloud, tree));
        note.verdict = Some(verdict(&tree.figures));
        Self {
            note,
            skeleton: scaled.skeleton,
        }
    }
}

impl DrawnTree {
    /// The same as [`write`](Self::write), with the sway of a film on it.
    ///
    /// # Errors
    /// As there.
    pub fn write_with_film(
        mut self,
        dir: &Path,
        film: &FilmOnScan,
        stop: &AtomicBool,
    ) -> Result<(), PrepareError> {
        if let Some(scan) = &mut self.note.scan {
            scan.film = Some(film.note());
        }
        self.write_swaying(dir, &film.sway, stop)
    }
}

fn scan_note(cloud: &PointCloud, tree: &CloudTree) -> ScanNote {
    let figures = tree.figures;
    let foot = tree
        .nodes
        .first()
        .map_or(Vector3::zeros(), |n| n.position.coords);
    ScanNote {
        foot_m: (foot + cloud.origin).into(),
        points: figures.points as u64,
        ground_points: figures.ground as u64,
        noise_points: figures.noise as u64,
        leaf_points: figures.leaves as u64,
        apart_points: figures.apart as u64,
        not_finite_points: cloud.not_finite as u64,
        cell_m: figures.cell_m,
        noise_m: figures.noise_m,
        twig_radius_m: figures.twig_radius_m,
        // A table of cylinders has no points.
        on_wood: (figures.points > 0).then_some(figures.on_wood),
        foot_share: figures.foot_share,
        clear_stem: figures.clear_stem,
        fork_below: figures.fork_below,
        film: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Registration;
    use nalgebra::{Similarity2, Vector2};

    #[test]
    fn a_film_of_another_size_than_its_scan_is_named() {
        let film_of = |film_metres_per_px| FilmOnScan {
            fit: FilmFit {
                registration: Registration {
                    turn: 0.0,
                    to_picture: Similarity2::new(Vector2::zeros(), 0.0, 50.0),
                    miss: 0.005,
                    other_side_miss: Some(0.02),
                },
                off_hi: 0.01,
                grounds: Grounds::Lines,
                lean: None,
            },
            sway: Vec::new(),
            laid: Vec::new(),
            has_tag: false,
            film_metres_per_px,
        };
        for same in [0.0, 0.018, 0.022] {
            assert_eq!(film_of(same).warnings().count(), 0, "{same}");
        }
        let said: Vec<String> = film_of(0.0656).warnings().collect();
        assert!(said[0].contains("3.28 times as large"), "{said:?}");
    }
}
