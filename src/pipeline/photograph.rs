//! What one photograph shows of a tree (Tan et al. 2008 sect. 2): a pure function from the picture and
//! what is drawn on it to leaves, wood and the branches that are seen. It is called once by a command,
//! and after every stroke by a screen.

use super::certainty::Certainty;
use super::settling::{Settling, SmallLook, lies_on};
use super::unaided::{Attempt, Half, Place};
use crate::cancel::CancelToken;
use crate::config::TraceBy;
use crate::import::{FlatTree, ImportError, traced};
use crate::model::{Outline, Rgb, Size, TreeStrokes};
use crate::outline::{self, OutlineError, Reduced};
use crate::solve::assign_seen_radii;
use crate::wood::{self, LeafColour, LeafHint, LeavesSeen, NotSeen, SeenInPhotograph, Stroke};
use nalgebra::Point2;

/// Gaps between leaves up to this share of the photograph's width are closed; up to the second where one
/// piece then has nearly all.
const CLOSE_SHARE: f64 = 0.008;
const CLOSE_MOST: f64 = 0.06;
const NEARLY_ALL: f64 = 0.93;

/// A crown stroke that holds more of a photograph leaves nothing round the crown to compare it with.
const LARGEST_CROWN: f64 = 0.95;

/// How a photograph is looked at.
#[derive(Clone, Copy, Debug)]
pub struct PhotoOptions {
    /// What is known of its leaves before.
    pub leaves: LeafHint,
    pub trace_by: TraceBy,
}

/// A tree as one photograph shows it.
#[derive(Clone, Debug)]
pub struct TreeInPhoto {
    /// Within the crown stroke, or what was found.
    pub crown: Outline,
    /// The trunk's first, from its foot up.
    pub strokes: Vec<Stroke>,
    /// How sure it is that what was not drawn is found; `None` where all was drawn.
    pub found: Option<Certainty>,
    pub seen: SeenInPhotograph,
    /// Whether the photograph has colours; else leaves are not looked for.
    pub has_colour: bool,
    /// Whether the tree was said to be bare.
    pub is_said_bare: bool,
}

/// A part of what is drawn on a photograph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DrawnPart {
    Crown,
    /// A branch stroke, counted from 1.
    Branch(usize),
}

/// Why a photograph shows no tree. Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum PhotoError {
    #[error("the crown stroke: {0}; draw it in the photograph, round the crown")]
    BadCrown(OutlineError),
    #[error("the crown stroke is round all of the photograph; draw it round the crown alone")]
    AllOfPicture,
    #[error("stroke {number}: ({u:.0}, {v:.0}) lies outside the photograph; draw it on the tree")]
    OffPicture { number: usize, u: f64, v: f64 },
    #[error(
        "stroke {number} meets no wood that leads to the trunk; draw it from the branch that carries it"
    )]
    Apart { number: usize },
    #[error(
        "along the trunk's stroke there is nothing that differs from what is at both its sides; draw it \
         along its bark"
    )]
    OnNothing,
    #[error(
        "within the crown stroke are neither leaves nor branches that lead to the trunk; draw it round \
         the crown of the tree"
    )]
    EmptyCrown,
    #[error(
        "within the crown stroke the leaves have the colours of what is around it, as on a lawn; draw it \
         round the crown of the tree"
    )]
    NoCrown,
    #[error("the crown stroke and the trunk are apart; draw both on the same tree")]
    CrownApart,
    #[error("the crown has no {} leaves; name their colour, or say that it is bare", .colour.name())]
    NoLeaves { colour: LeafColour },
    #[error("no tree with a trunk is found in its middle; draw its crown and its trunk")]
    NoTree,
    #[error(
        "no trunk is found that leads to what the crown stroke is round; draw the trunk, too, or the crown anew"
    )]
    NoTrunk,
    #[error(
        "no crown is found on the stroke that is drawn; draw the crown, too, or the trunk anew"
    )]
    NoCrownOn,
    #[error("no wood is seen that leads to the foot of the trunk; draw the trunk on its bark")]
    NoWood,
    #[error(transparent)]
    NoBranches(#[from] ImportError),
    #[error("it shows no tree in one piece: {0}; draw its crown and its trunk anew")]
    NoRegion(OutlineError),
    /// The work was ended.
    #[error("it was not looked at to the end")]
    Cancelled,
    #[error("it cannot be worked on: {what}")]
    Failed { what: String },
}

impl PhotoError {
    /// Whether the tree was not found, or not whole: strokes help.
    pub fn is_of_picture(&self) -> bool {
        matches!(
            self,
            Self::NoTree | Self::NoTrunk | Self::NoCrownOn | Self::NoWood | Self::NoRegion(_)
        )
    }

    /// What of the drawing it is about; `None` if that is the photograph.
    pub fn at_fault(&self) -> Option<DrawnPart> {
        match self {
            Self::BadCrown(_)
            | Self::AllOfPicture
            | Self::EmptyCrown
            | Self::NoCrown
            | Self::CrownApart => Some(DrawnPart::Crown),
            Self::OffPicture { number, .. } | Self::Apart { number } => {
                Some(DrawnPart::Branch(*number))
            }
            Self::OnNothing => Some(DrawnPart::Branch(1)),
            _ => None,
        }
    }

    /// Whether what was drawn is at fault, and not the photograph.
    pub fn is_of_strokes(&self) -> bool {
        matches!(
            self,
            Self::BadCrown(_) | Self::AllOfPicture | Self::OffPicture { .. } | Self::Apart { .. }
        )
    }
}

/// How two pieces of work are done that do not wait for each other.
pub trait Both {
    /// Does them, one after the other or at the same time.
    fn both<A: Send, B>(&self, first: impl Fn() -> A + Sync, second: impl FnOnce() -> B) -> (A, B);
}

/// One after the other.
#[derive(Clone, Copy, Debug)]
pub struct InTurn;

impl Both for InTurn {
    fn both<A: Send, B>(&self, first: impl Fn() -> A + Sync, second: impl FnOnce() -> B) -> (A, B) {
        (first(), second())
    }
}

/// Finds leaves, wood and visible branches of the tree on which `drawn` lies, px of `picture`. Where
/// crown or trunk are not drawn, they are those of what stands in the middle of the picture.
///
/// # Errors
/// A stroke is off the picture or on no tree, or no tree is seen, or `cancel` ends the work.
pub fn see_tree(
    picture: &Rgb,
    drawn: &TreeStrokes,
    options: PhotoOptions,
    both: &impl Both,
    cancel: &CancelToken,
) -> Result<TreeInPhoto, PhotoError> {
    let looked = Looked {
        picture,
        has_colour: picture.has_colour(),
        drawn,
        options,
        cancel,
    };
    let mut strokes = drawn.branches_px.clone();
    refuse_off_picture(&strokes, picture.size)?;
    if let Some([first, .., last]) = strokes.first_mut().map(|s| &mut s[..])
        && first.y < last.y
    {
        strokes[0].reverse();
    }
    let crown = match drawn.crown_px.is_empty() {
        true => None,
        false => Some(crown(&drawn.crown_px, picture.size)?),
    };
    match crown {
        Some(crown) if !strokes.is_empty() => {
            looked.along_drawn(Attempt::drawn(crown, strokes), both)
        }
        crown => looked.best(&Half { crown, strokes }),
    }
}

/// A photograph that is looked at.
struct Looked<'a> {
    picture: &'a Rgb,
    has_colour: bool,
    drawn: &'a TreeStrokes,
    options: PhotoOptions,
    cancel: &'a CancelToken,
}

impl Looked<'_> {
    /// The tree along these strokes.
    fn see(&self, strokes: Attempt) -> Result<TreeInPhoto, PhotoError> {
        let leaves = LeavesSeen::of(self.view(&strokes), self.cancel)
            .map_err(|e| not_seen(e, self.drawn))?;
        self.see_beside(&leaves, strokes)
    }

    fn view<'b>(&'b self, strokes: &'b Attempt) -> wood::Photograph<'b> {
        wood::Photograph {
            picture: self.picture,
            crown: &strokes.crown,
            strokes: &strokes.strokes,
            along: strokes.along,
            leaves: self.options.leaves,
            trace_by: self.options.trace_by,
        }
    }

    /// The tree along these strokes, the leaves of which were found.
    fn see_beside(&self, leaves: &LeavesSeen, strokes: Attempt) -> Result<TreeInPhoto, PhotoError> {
        let seen = wood::beside_leaves(self.view(&strokes), leaves, self.cancel)
            .map_err(|e| not_seen(e, self.drawn))?;
        let Attempt { crown, strokes, .. } = strokes;
        let branches = &seen.wood.branches;
        let size = self.picture.size;
        for (number, stroke) in (1..).zip(&strokes) {
            if !stroke
                .iter()
                .any(|at| branches.piece_at(*at, size).is_some())
            {
                return Err(PhotoError::Apart { number });
            }
        }
        Ok(TreeInPhoto {
            crown,
            strokes,
            found: None,
            seen,
            has_colour: self.has_colour,
            is_said_bare: self.options.leaves == LeafHint::Bare,
        })
    }

    /// The tree along drawn strokes. The trunk settles from its stroke, while the leaves are found in the whole
    /// picture.
    fn along_drawn(&self, drawn: Attempt, both: &impl Both) -> Result<TreeInPhoto, PhotoError> {
        let (leaves, trunk) = both.both(
            || LeavesSeen::of(self.view(&drawn), self.cancel),
            || self.trunk_along(&drawn),
        );
        let leaves = leaves.map_err(|e| not_seen(e, self.drawn))?;
        match trunk? {
            Some(trunk) => {
                let strokes = drawn.strokes.clone();
                let settled = drawn.clone().along(trunk);
                let tree = self.see_settled(&leaves, settled, drawn)?;
                Ok(TreeInPhoto { strokes, ..tree })
            }
            None => self.see_beside(&leaves, drawn),
        }
    }

    /// The line at which a drawn trunk settles; `None` where that leads away from the stroke, or nothing is seen
    /// in a smaller picture.
    fn trunk_along(&self, drawn: &Attempt) -> Result<Option<Stroke>, PhotoError> {
        let settling = Settling::of(self.picture, self.options, self.cancel).map_err(failed)?;
        let beside_px = wood::BESIDE_STROKE * f64::from(self.picture.size.width);
        let look = settling.look_at_drawn(drawn);
        match look.and_then(|look| settling.trunk(look)) {
            // No corner of the stroke is farther off than branches are looked for beside it.
            Ok(trunk) => {
                Ok(Some(trunk).filter(|trunk| lies_on(&drawn.strokes[0], trunk, beside_px)))
            }
            Err(NotSeen::Cancelled) => Err(PhotoError::Cancelled),
            Err(_) => Ok(None),
        }
    }

    /// Of all attempts to find what was not drawn the one that is most likely right.
    fn best(&self, half: &Half) -> Result<TreeInPhoto, PhotoError> {
        let reduced = Reduced::of(self.picture).map_err(failed)?;
        let settling = match half.strokes.is_empty() {
            true => Some(Settling::of(self.picture, self.options, self.cancel).map_err(failed)?),
            false => None,
        };
        let mut best: Option<(Certainty, FirstLook)> = None;
        let mut why = PhotoError::NoTree;
        for place in Place::ALL {
            if best.as_ref().is_some_and(|(found, _)| found.is_sure()) {
                break;
            }
            let Some(attempt) = half.attempt(&reduced, place, self.options.leaves)? else {
                continue;
            };
            let look = match self.first_look(settling.as_ref(), attempt) {
                Ok(look) => look,
                Err(PhotoError::Cancelled) => return Err(PhotoError::Cancelled),
                Err(e) => {
                    why = e;
                    continue;
                }
            };
            let found = Certainty::of(look.seen(), self.has_colour);
            let known = best.as_ref().map_or(0.0, |(known, _)| known.chance());
            if found.chance() > known {
                best = Some((found, look));
            }
        }
        let (found, look) = best.ok_or(match why {
            PhotoError::NoTree if half.crown.is_some() => PhotoError::NoTrunk,
            PhotoError::NoTree if !half.strokes.is_empty() => PhotoError::NoCrownOn,
            why => why,
        })?;
        let tree = match look {
            FirstLook::Whole(tree) => *tree,
            FirstLook::Small {
                settling,
                attempt,
                look,
            } => self.settled(settling, attempt, *look)?,
        };
        let found = Some(found);
        Ok(TreeInPhoto { found, ..tree })
    }

    /// The tree along the strokes of an attempt; a bare one whose trunk is to settle first, in a smaller picture.
    fn first_look<'s>(
        &self,
        settling: Option<&'s Settling<'s>>,
        attempt: Attempt,
    ) -> Result<FirstLook<'s>, PhotoError> {
        if let Some(settling) = settling {
            let look = settling.first_look(&attempt);
            if let Some(look) = look.map_err(|e| not_seen(e, self.drawn))? {
                return Ok(FirstLook::Small {
                    settling,
                    attempt,
                    look: Box::new(look),
                });
            }
        }
        Ok(FirstLook::Whole(Box::new(self.see(attempt)?)))
    }

    /// The tree along the line at which its trunk settles, or as the attempt has it if nothing is seen there.
    fn settled(
        &self,
        settling: &Settling,
        attempt: Attempt,
        first: SmallLook,
    ) -> Result<TreeInPhoto, PhotoError> {
        let trunk = settling.trunk(first).map_err(|e| not_seen(e, self.drawn))?;
        let settled = attempt.clone().along(trunk);
        let leaves = LeavesSeen::of(self.view(&settled), self.cancel)
            .map_err(|e| not_seen(e, self.drawn))?;
        self.see_settled(&leaves, settled, attempt)
    }

    /// The tree along a settled trunk, or as the attempt has it if nothing is seen there.
    fn see_settled(
        &self,
        leaves: &LeavesSeen,
        settled: Attempt,
        attempt: Attempt,
    ) -> Result<TreeInPhoto, PhotoError> {
        match self.see_beside(leaves, settled) {
            Err(PhotoError::Cancelled) => Err(PhotoError::Cancelled),
            Err(_) => self.see_beside(leaves, attempt),
            tree => tree,
        }
    }
}

/// An attempt that was looked at for the first time.
enum FirstLook<'s> {
    Whole(Box<TreeInPhoto>),
    /// In a smaller picture, in which its trunk is to settle.
    Small {
        settling: &'s Settling<'s>,
        attempt: Attempt,
        look: Box<SmallLook>,
    },
}

impl FirstLook<'_> {
    fn seen(&self) -> &SeenInPhotograph {
        match self {
            Self::Whole(tree) => &tree.seen,
            Self::Small { look, .. } => &look.seen,
        }
    }
}

/// Why nothing is seen, by what was drawn: what was only found is no stroke that could be at fault.
fn not_seen(e: NotSeen, drawn: &TreeStrokes) -> PhotoError {
    let (has_crown, has_trunk) = (!drawn.crown_px.is_empty(), !drawn.branches_px.is_empty());
    match e {
        NotSeen::Cancelled => PhotoError::Cancelled,
        NotSeen::Wood => PhotoError::NoWood,
        NotSeen::Trunk if has_trunk => PhotoError::OnNothing,
        NotSeen::LeavesOf(colour) => PhotoError::NoLeaves { colour },
        NotSeen::Crown if has_crown => PhotoError::EmptyCrown,
        NotSeen::Leaves if has_crown => PhotoError::NoCrown,
        NotSeen::Apart if has_crown && has_trunk => PhotoError::CrownApart,
        NotSeen::Trunk | NotSeen::Crown | NotSeen::Leaves | NotSeen::Apart => PhotoError::NoTree,
        NotSeen::Failed(e) => failed(e),
    }
}

impl TreeInPhoto {
    /// The visible branches as a flat tree, with the radii that are seen, evened out.
    ///
    /// # Errors
    /// There are none, or too many on one another.
    pub fn flat_tree(&self) -> Result<FlatTree, PhotoError> {
        let corners = self.crown.polygon_px.iter();
        let crown_px: Vec<Point2<f64>> = corners.map(|c| c.map(f64::from)).collect();
        let size = self.crown.size;
        let mut flat = traced(&self.seen.wood.branches, size, &crown_px)?;
        let nodes = &mut flat.skeleton.nodes;
        let radii = nodes.iter().map(|node| node.radius);
        let seen_px: Vec<Option<f64>> = radii.map(|r| (r > 0.0).then_some(r)).collect();
        assign_seen_radii(nodes, &seen_px, !self.seen.in_leaf);
        Ok(flat)
    }

    /// Where the tree is, in one piece: leaves and wood of one in leaf, the crown and the trunk of a
    /// bare one.
    ///
    /// # Errors
    /// There is nothing of it.
    pub fn region(&self, flat: &FlatTree) -> Result<Outline, PhotoError> {
        let size = self.crown.size;
        let region = match self.seen.in_leaf {
            true => closed(size, &self.seen.tree),
            false => outline::covered(&flat.cover_px(), size),
        };
        region.map_err(PhotoError::NoRegion)
    }
}

fn refuse_off_picture(strokes: &[Stroke], size: Size) -> Result<(), PhotoError> {
    for (number, stroke) in (1..).zip(strokes) {
        if let Some(off) = stroke.iter().find(|at| !size.contains(**at)) {
            let (u, v) = (off.x, off.y);
            return Err(PhotoError::OffPicture { number, u, v });
        }
    }
    Ok(())
}

fn crown(corners_px: &[Point2<f64>], size: Size) -> Result<Outline, PhotoError> {
    let crown = outline::from_polygon(corners_px, size).map_err(PhotoError::BadCrown)?;
    let inside = crown.mask.iter().filter(|m| **m != 0).count();
    match inside as f64 > LARGEST_CROWN * size.area() as f64 {
        true => Err(PhotoError::AllOfPicture),
        false => Ok(crown),
    }
}

pub(super) fn failed(e: impl std::fmt::Display) -> PhotoError {
    PhotoError::Failed {
        what: e.to_string(),
    }
}

/// The tree of a mask in one piece, its gaps closed as little as it takes to hold nearly all.
///
/// # Errors
/// The mask is empty.
fn closed(size: Size, tree: &[u8]) -> Result<Outline, OutlineError> {
    let all = tree.iter().filter(|m| **m != 0).count() as f64;
    let mut share = CLOSE_SHARE;
    loop {
        let close_px = share * f64::from(size.width);
        let found = outline::closed(size, tree, close_px.round() as u32)?;
        let held = tree.iter().zip(&found.mask).filter(|(m, f)| **m & **f != 0);
        if held.count() as f64 >= NEARLY_ALL * all || share >= CLOSE_MOST {
            return Ok(found);
        }
        share *= 2.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::seed_of_part;
    use crate::signal::distance_to_segment;
    use nalgebra::Vector2;

    const SIZE: Size = Size {
        width: 480,
        height: 360,
    };
    const FORK: Point2<f64> = Point2::new(240.0, 200.0);

    /// From where a limb leads, to where, and its radius, px.
    const LIMBS: [(Point2<f64>, Point2<f64>, f64); 3] = [
        (Point2::new(240.0, 330.0), FORK, 12.0),
        (FORK, Point2::new(170.0, 60.0), 8.0),
        (FORK, Point2::new(320.0, 70.0), 8.0),
    ];

    /// A bare tree lit from the right, and where its wood is.
    fn lit_from_the_right() -> (Rgb, Vec<bool>) {
        let (mut pixels, mut is_wood) = (Vec::new(), Vec::new());
        for i in 0..SIZE.area() {
            let at = Point2::new((i % 480) as f64, (i / 480) as f64);
            let limb = LIMBS
                .iter()
                .find(|(from, to, radius)| distance_to_segment(at, *from, *to) <= *radius);
            let is_lit = limb.is_some_and(|(from, to, _)| {
                let way = to - from;
                Vector2::new(-way.y, way.x).dot(&(at - from)) > 0.0
            });
            let colour: [u8; 3] = match (limb.is_some(), is_lit) {
                (true, true) => [110, 94, 79],
                (true, false) => [50, 42, 36],
                _ if at.y > 250.0 => [126, 128, 130],
                _ => [180, 178, 175],
            };
            let noise = (seed_of_part(3, i as u64) % 25) as u8;
            pixels.extend(colour.map(|c| c + noise));
            is_wood.push(limb.is_some());
        }
        (Rgb { size: SIZE, pixels }, is_wood)
    }

    #[test]
    fn a_trunk_that_is_found_has_both_sides_of_its_bark() {
        let (picture, is_wood) = lit_from_the_right();
        let corners = [
            [140.0, 30.0],
            [350.0, 30.0],
            [350.0, 160.0],
            [260.0, 215.0],
            [220.0, 215.0],
            [140.0, 160.0],
        ];
        let drawn = TreeStrokes {
            crown_px: corners.map(Point2::from).to_vec(),
            branches_px: Vec::new(),
        };
        let options = PhotoOptions {
            leaves: LeafHint::Unknown,
            trace_by: TraceBy::Paths,
        };
        let cancel = CancelToken::new();
        let found = see_tree(&picture, &drawn, options, &InTurn, &cancel).expect("a tree");
        assert!(found.found.is_some() && !found.seen.in_leaf);
        let all = is_wood.iter().filter(|is_wood| **is_wood).count();
        let both = is_wood.iter().zip(&found.seen.tree);
        let both = both.filter(|(is_wood, seen)| **is_wood && **seen != 0);
        let share = both.count() as f64 / all as f64;
        assert!(share > 0.95, "{share}");
    }
}
