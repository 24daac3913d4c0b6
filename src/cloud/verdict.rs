//! What the tree of a cloud is worth: good, fair or poor, why, and what to do.

use super::CloudFigures;
use crate::model::{Finding, Grade, Verdict};

/// Of bare trees 0.90 to 0.99 of the points lie on the wood (scanned from one to four sides). In leaf it is
/// 0.64 to 0.67, and the length is three times the true one; with the leaves taken off 0.87 to 0.89 (made
/// clouds 66001 to 66004; nine real trees in leaf 0.26 to 0.57, three of them with the leaves taken off 0.65 to
/// 0.79).
const FAIR_ON_WOOD: f64 = 0.9;
const POOR_ON_WOOD: f64 = 0.7;
/// Distance of points as a share of the height from which the verdict is fair and poor. Of trees of 60 branches 0.92 of
/// the branches are found with the right parent up to 0.004, 0.79 at 0.0055, and 0.57 at 0.009 (made clouds 77201 to
/// 77206 and 77421 to 77426 of 100,000 to 10,000 points).
const FAIR_SPACING: f64 = 0.005;
const POOR_SPACING: f64 = 0.01;
/// The foot of upright trees is 0.95 and more of the thickest wood; that of trees that lie or stand on
/// their heads 0.84 at most, or it has no circle.
const POOR_FOOT: f64 = 0.85;

/// Without ground a tree is taken for whole if its stem is clear for this share of its height: the trunks of
/// 40 made trees (seeds 69300 to 69339) are for 0.12 to 0.26, and a crown that was cut off its own forks at once.
const CLEAR_STEM: f64 = 0.1;

/// Trees of one cloud whose trunks come together less than this share of the height below their feet may be
/// boughs of one crown. Of the true boughs of eight made trees (seeds 69301 to 69308) that were cut at 0.3 to 0.6
/// of the height 161 of 174 do; true trunks of 20 plots of four trees 2 m apart (69311 to 69330) at 0.64 and more.
const FORK_BELOW: f64 = 0.5;

/// Judges the tree of a cloud.
pub fn verdict(figures: &CloudFigures) -> Verdict {
    let found = [
        in_steps(figures),
        foot(figures),
        cut_off(figures),
        bough(figures),
        beside_crown(figures),
        off_wood(figures),
        grown_bare(figures),
        sparse(figures),
    ];
    Verdict::of_findings(found.into_iter().flatten())
}

/// Whether its coordinates were rounded too coarsely to show its branches.
fn in_steps(figures: &CloudFigures) -> Option<Finding> {
    Some(Finding {
        grade: by_spacing(figures.step_m, figures)?,
        reason: format!(
            "its coordinates are rounded to {:.1} cm",
            100.0 * figures.step_m
        ),
        advice: "write the cloud with more decimals, or shift it near to its origin before it is written with numbers \
                 of four bytes"
            .to_owned(),
    })
}

/// The grade of a tree whose points have this distance, m.
fn by_spacing(spacing_m: f64, figures: &CloudFigures) -> Option<Grade> {
    match spacing_m / figures.height_m.max(f64::MIN_POSITIVE) {
        POOR_SPACING.. => Some(Grade::Poor),
        FAIR_SPACING.. => Some(Grade::Fair),
        _ => None,
    }
}

fn foot(figures: &CloudFigures) -> Option<Finding> {
    let reason = match figures.foot_share {
        Some(share) if share >= POOR_FOOT => return None,
        Some(share) => format!(
            "the foot is {share:.2} times as thick as the thickest wood, and trees are thickest at the foot"
        ),
        None => "no round trunk was found at the foot".to_owned(),
    };
    Some(Finding {
        grade: Grade::Poor,
        reason,
        advice: "see that z is up, and that the cloud holds the trunk".to_owned(),
    })
}

/// Whether it may be a crown that was cut off its trunk: its thickest wood is at the cut.
fn cut_off(figures: &CloudFigures) -> Option<Finding> {
    let share = figures.clear_stem.filter(|_| !figures.has_ground)?;
    (share < CLEAR_STEM).then(|| Finding {
        grade: Grade::Fair,
        reason: format!(
            "no ground was scanned and a branch leaves {:.0} % of the height above the foot: it may be a \
             crown without its trunk",
            100.0 * share
        ),
        advice: "scan the trunk down to the ground, and leave some ground in the cloud".to_owned(),
    })
}

/// Whether it may be a bough of a crown, of which others of its trees are the other boughs. Ground says nothing
/// against it: the lower side of a crown is taken for ground, too.
fn bough(figures: &CloudFigures) -> Option<Finding> {
    let below = figures.fork_below?;
    (below < FORK_BELOW).then(|| Finding {
        grade: Grade::Fair,
        reason: format!(
            "its trunk comes together with that of another tree {:.0} % of the height below their feet: they may be \
             boughs of one crown without its trunk",
            100.0 * below
        ),
        advice: "if it is one tree, scan its trunk down to the ground, and leave some ground in the cloud".to_owned(),
    })
}

/// Whether it may be of the crown that another tree of its cloud seems to be of. A crown falls into boughs and
/// branches, and not all of them show it.
fn beside_crown(figures: &CloudFigures) -> Option<Finding> {
    (figures.beside_crown && !may_be_of_crown(figures)).then(|| Finding {
        grade: Grade::Fair,
        reason: "no ground was scanned, and another tree of the cloud may be part of a crown without its \
                 trunk: it may be another part"
            .to_owned(),
        advice: "scan the trunk down to the ground, and leave some ground in the cloud".to_owned(),
    })
}

/// Whether it may be a crown without its trunk, or part of one.
pub(super) fn may_be_of_crown(figures: &CloudFigures) -> bool {
    cut_off(figures).is_some() || bough(figures).is_some()
}

fn off_wood(figures: &CloudFigures) -> Option<Finding> {
    let grade = Grade::of(figures.on_wood, FAIR_ON_WOOD, POOR_ON_WOOD)?;
    let advice = match figures.in_leaf {
        true => "scan it without leaves, or more finely",
        false => "if it is in leaf, give --in-leaf; else scan it more finely",
    };
    Some(Finding {
        grade,
        reason: format!(
            "{:.0} % of its points lie off the wood",
            100.0 * (1.0 - figures.on_wood)
        ),
        advice: advice.to_owned(),
    })
}

/// Whether its lines grew in the points of the bark. Of four made scans (77401 to 77404) the length is off by 160 %
/// with the usual lengths of the growth; with others it or the branches are.
fn grown_bare(figures: &CloudFigures) -> Option<Finding> {
    figures.is_grown_bare.then(|| Finding {
        grade: Grade::Fair,
        reason: "space colonisation of bare points grows strands all around thick wood: length, radii and volume are \
                 no measures"
            .to_owned(),
        advice: "give --method colonisation, which grows along the wood".to_owned(),
    })
}

/// Whether its points are too far from each other to show its branches.
fn sparse(figures: &CloudFigures) -> Option<Finding> {
    Some(Finding {
        grade: by_spacing(figures.cell_m, figures)?,
        reason: format!(
            "its points are {:.1} cm apart: twigs and forks are missing",
            100.0 * figures.cell_m
        ),
        advice: "scan it more finely".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(foot_share: Option<f64>, on_wood: f64) -> CloudFigures {
        CloudFigures {
            foot_share,
            on_wood,
            has_ground: true,
            cell_m: 0.01,
            height_m: 5.0,
            ..CloudFigures::default()
        }
    }

    #[test]
    fn few_points_show_no_twigs() {
        let mut few = figures(Some(1.07), 0.97);
        few.cell_m = 0.03;
        let line = verdict(&few).line();
        assert!(
            line.starts_with("fair, because: its points are 3.0 cm apart"),
            "{line}"
        );
        few.cell_m = 0.1;
        assert!(verdict(&few).line().starts_with("poor"));
    }

    #[test]
    fn trees_that_agree_with_their_points_are_good() {
        assert_eq!(verdict(&figures(Some(1.07), 0.97)), Verdict::default());
    }

    #[test]
    fn what_may_be_a_crown_without_its_trunk_is_fair() {
        let mut cut = figures(Some(1.07), 0.97);
        cut.clear_stem = Some(0.05);
        assert_eq!(verdict(&cut), Verdict::default(), "it stands on its ground");
        cut.has_ground = false;
        let line = verdict(&cut).line();
        assert!(line.starts_with("fair, because: no ground"), "{line}");
        assert!(line.contains("5 % of the height"), "{line}");
        cut.clear_stem = Some(0.2);
        assert_eq!(verdict(&cut), Verdict::default());
    }

    #[test]
    fn what_may_be_a_bough_of_a_crown_is_fair() {
        let mut one = figures(Some(1.07), 0.97);
        one.fork_below = Some(0.3);
        let line = verdict(&one).line();
        assert!(
            line.starts_with("fair, because: its trunk comes together"),
            "{line}"
        );
        assert!(line.contains("30 % of the height below"), "{line}");
        one.fork_below = Some(0.9);
        assert_eq!(verdict(&one), Verdict::default());
    }

    #[test]
    fn what_stands_beside_parts_of_a_crown_is_fair() {
        let mut one = figures(Some(1.07), 0.97);
        one.has_ground = false;
        one.beside_crown = true;
        let line = verdict(&one).line();
        assert!(
            line.starts_with("fair, because: no ground was scanned, and another"),
            "{line}"
        );
        one.clear_stem = Some(0.05);
        assert_eq!(verdict(&one).reasons.len(), 1);
    }

    #[test]
    fn what_has_no_foot_or_no_wood_is_poor() {
        let line = verdict(&figures(Some(0.65), 0.95)).line();
        assert!(
            line.starts_with("poor, because: the foot is 0.65"),
            "{line}"
        );
        let line = verdict(&figures(None, 0.8)).line();
        assert!(
            line.contains("no round trunk") && line.contains("20 %"),
            "{line}"
        );
        assert!(line.contains("--in-leaf"), "{line}");
        let mut leafless = figures(Some(1.0), 0.88);
        leafless.in_leaf = true;
        let line = verdict(&leafless).line();
        assert!(
            line.starts_with("fair") && !line.contains("--in-leaf"),
            "{line}"
        );
    }
}
