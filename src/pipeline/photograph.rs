//! What one photograph shows of a tree (Tan et al. 2008 sect. 2): a pure function from the picture and
//! what is drawn on it to leaves, wood and the branches that are seen. It is called once by a command,
//! and after every stroke by a screen.

use crate::cancel::CancelToken;
use crate::config::TraceBy;
use crate::import::{FlatTree, ImportError, traced};
use crate::model::{Foot, FootBasis, Outline, Rgb, Size, TreeStrokes};
use crate::outline::{self, OutlineError};
use crate::wood::{self, LeafColour, NotSeen, SeenInPhotograph, Stroke};
use nalgebra::Point2;

/// Gaps between leaves up to this share of the photograph's width are closed; up to the second where one
/// piece then has nearly all.
const CLOSE_SHARE: f64 = 0.008;
const CLOSE_MOST: f64 = 0.06;
const NEARLY_ALL: f64 = 0.93;
/// Without a stroke the trunk is looked for up to this share of the tree's height, and has so many
/// rows at least.
const TRUNK_SHARE: f64 = 0.3;
const LEAST_TRUNK_ROWS: usize = 12;
/// The foot may be hidden: it is looked for in so many steps of this share of the tree's height higher up.
const MOST_HIDDEN_STEPS: u32 = 5;
const HIDDEN_STEP: f64 = 0.05;

/// Channels of a pixel that differ by more than this make a colour, levels: what a JPEG of a grey
/// picture may be off. A picture has colours if this share of it has one.
const GREY_LEVELS: u8 = 4;
const COLOUR_SHARE: f64 = 0.001;

/// How a photograph is looked at.
#[derive(Clone, Copy, Debug)]
pub struct PhotoOptions {
    /// The colour of the leaves where it is known: then there must be some. Else green leaves are looked
    /// for, and a tree without them is bare.
    pub leaf_colour: Option<LeafColour>,
    pub trace_by: TraceBy,
}

/// A tree as one photograph shows it.
#[derive(Clone, Debug)]
pub struct TreeInPhoto {
    /// Within the crown stroke, or what was found.
    pub crown: Outline,
    /// The trunk's first, from its foot up.
    pub strokes: Vec<Stroke>,
    /// How far two attempts to find the tree without strokes agree, 0 to 1; `None` where all was drawn.
    pub agreement: Option<f64>,
    pub seen: SeenInPhotograph,
    /// Whether the photograph has colours; else leaves are not looked for.
    pub has_colour: bool,
}

/// Why a photograph shows no tree. Each message is one line that says what to do.
#[derive(Debug, thiserror::Error)]
pub enum PhotoError {
    #[error("the crown stroke: {0}; draw a closed line round the crown")]
    BadCrown(OutlineError),
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
    #[error("the crown has no {} leaves; name their colour, or none", .colour.name())]
    NoLeaves { colour: LeafColour },
    #[error("no tree with a trunk is found in its middle; draw its crown and its trunk")]
    NoTree,
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
        matches!(self, Self::NoTree | Self::NoWood | Self::NoRegion(_))
    }

    /// Whether what was drawn is at fault, and not the photograph.
    pub fn is_of_strokes(&self) -> bool {
        matches!(
            self,
            Self::BadCrown(_) | Self::OffPicture { .. } | Self::Apart { .. }
        )
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
    cancel: &CancelToken,
) -> Result<TreeInPhoto, PhotoError> {
    let Drawn {
        crown,
        strokes,
        agreement,
    } = Drawn::of(picture, drawn)?;
    let has_colour = has_colour(picture);
    let view = wood::Photograph {
        picture,
        crown: &crown,
        strokes: &strokes,
        leaf_colour: options.leaf_colour,
        trace_by: options.trace_by,
    };
    let seen = wood::in_photograph(view, cancel).map_err(|e| not_seen(e, drawn))?;
    let branches = &seen.wood.branches;
    let is_met = |at: &Point2<f64>| branches.piece_at(*at, picture.size).is_some();
    if let Some(apart) = strokes.iter().position(|s| !s.iter().any(is_met)) {
        return Err(PhotoError::Apart { number: apart + 1 });
    }
    Ok(TreeInPhoto {
        crown,
        strokes,
        agreement,
        seen,
        has_colour,
    })
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

/// Whether a picture is more than grey.
fn has_colour(picture: &Rgb) -> bool {
    let is_coloured = |pixel: &&[u8; 3]| {
        let [red, green, blue] = **pixel;
        red.max(green).max(blue) - red.min(green).min(blue) > GREY_LEVELS
    };
    let (pixels, _) = picture.pixels.as_chunks::<3>();
    let coloured = pixels.iter().filter(is_coloured).count();
    coloured as f64 > COLOUR_SHARE * pixels.len() as f64
}

impl TreeInPhoto {
    /// The visible branches as a flat tree, with the radii that are seen.
    ///
    /// # Errors
    /// There are none, or too many on one another.
    pub fn flat_tree(&self) -> Result<FlatTree, PhotoError> {
        let corners = self.crown.polygon_px.iter();
        let crown_px: Vec<Point2<f64>> = corners.map(|c| c.map(f64::from)).collect();
        let size = self.crown.size;
        Ok(traced(&self.seen.wood.branches, size, &crown_px)?)
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

/// Crown and strokes, drawn or found.
struct Drawn {
    crown: Outline,
    strokes: Vec<Stroke>,
    agreement: Option<f64>,
}

impl Drawn {
    fn of(picture: &Rgb, drawn: &TreeStrokes) -> Result<Self, PhotoError> {
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
        if let (Some(crown), false) = (&crown, strokes.is_empty()) {
            return Ok(Self {
                crown: crown.clone(),
                strokes,
                agreement: None,
            });
        }
        let middle = outline::in_middle(picture).map_err(failed)?;
        let middle = middle.ok_or(PhotoError::NoTree)?;
        let mut outlines = middle.outlines.into_iter();
        let with_trunk = outlines.find_map(|outline| Some((trunk_of(&outline)?, outline)));
        let (trunk, outline) = with_trunk.ok_or(PhotoError::NoTree)?;
        if strokes.is_empty() {
            strokes.push(trunk);
        }
        Ok(Self {
            crown: crown.unwrap_or(outline),
            strokes,
            agreement: Some(middle.agreement),
        })
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
    outline::from_polygon(corners_px, size).map_err(PhotoError::BadCrown)
}

fn failed(e: impl std::fmt::Display) -> PhotoError {
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

/// A line along the trunk of the tree in an outline, from its foot up; `None` where it has none. A bush
/// or a shadow may hide the foot: then the trunk begins where it comes out of that.
fn trunk_of(outline: &Outline) -> Option<Stroke> {
    let [_, top, _, bottom] = outline.bounds_px()?;
    let height = f64::from(bottom - top + 1);
    (0..=MOST_HIDDEN_STEPS).find_map(|step| {
        let hidden = (HIDDEN_STEP * f64::from(step) * height) as u32;
        trunk_in(&above(outline, bottom.saturating_sub(hidden)))
    })
}

/// What of an outline is not below a row.
fn above(outline: &Outline, lowest: u32) -> Outline {
    let mut above = outline.clone();
    let first_below = (lowest as usize + 1) * outline.size.width as usize;
    for pixel in above.mask.iter_mut().skip(first_below) {
        *pixel = 0;
    }
    above
}

fn trunk_in(outline: &Outline) -> Option<Stroke> {
    let foot = Foot::of(outline, None);
    let rows = foot.trunk_rows(outline, TRUNK_SHARE);
    let places = rows.iter().map(|row| {
        let middle = 0.5 * f64::from(row.first + row.last);
        Point2::new(middle, f64::from(row.v))
    });
    let line: Stroke = places.collect();
    let is_seen = foot.basis != FootBasis::Guessed && line.len() >= LEAST_TRUNK_ROWS;
    is_seen.then_some(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 200,
        height: 200,
    };

    /// A crown on a trunk, maybe with a bush before its foot.
    fn tree(has_bush: bool) -> Outline {
        let mut mask = Vec::with_capacity(SIZE.area());
        for i in 0..SIZE.area() {
            let [u, v] = [(i % 200) as f64, (i / 200) as f64];
            let is_crown = (u - 100.0).hypot(v - 60.0) < 50.0;
            let is_trunk = (u - 100.0).abs() < 4.0 && (60.0..190.0).contains(&v);
            let is_bush = has_bush && (u - 110.0).hypot(v - 185.0) < 25.0;
            mask.push(if is_crown || is_trunk || is_bush {
                255
            } else {
                0
            });
        }
        Outline {
            size: SIZE,
            mask,
            polygon_px: Vec::new(),
            matte: None,
        }
    }

    #[test]
    fn a_trunk_is_found_above_a_bush_at_its_foot() {
        for (has_bush, lowest) in [(false, 180.0..190.0), (true, 140.0..165.0)] {
            let line = trunk_of(&tree(has_bush)).expect("a trunk");
            assert!(lowest.contains(&line[0].y), "{has_bush}: {}", line[0]);
            assert!(line.iter().all(|at| (at.x - 100.0).abs() < 8.0), "{line:?}");
            assert!(line[line.len() - 1].y < line[0].y - 15.0, "{line:?}");
        }
    }

    #[test]
    fn what_has_no_trunk_has_none_higher_up_either() {
        let mut crown = tree(false);
        for pixel in crown.mask.iter_mut().skip(105 * 200) {
            *pixel = 0;
        }
        assert_eq!(trunk_of(&crown), None);
    }
}
