//! The skeleton in a treefile of RayCloudTools (`rayextract trees`): lines of comment, a header such as
//! `height, x,y,z,radius,parent_id`, and one line for each tree with its segments one after the other. A
//! segment ends at its place, and its parent is counted from 0. z is up.

use super::error::ImportError;
use super::model_tree::{Edges, MOST_PLACES, from_z_up};
use super::sketch::refuse_more;

/// What a header says on a line: how many numbers there are of the tree and of each segment, and
/// where in a segment its place and its parent are.
struct Columns {
    of_tree: usize,
    of_segment: usize,
    place: [usize; 3],
    parent: usize,
}

/// The ways from each segment's parent to it, turned so that y is up.
///
/// # Errors
/// The header names no `x`, `y`, `z` and `parent_id`, a line cannot be read, or there are several trees.
pub(super) fn edges(text: &str) -> Result<Edges, ImportError> {
    let lines = (1..).zip(text.lines());
    let mut lines = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let header = lines.next().map_or("", |(_, line)| line);
    let columns = Columns::of(header).ok_or_else(|| {
        ImportError::bad_format("its header has no x, y, z and parent_id, and it is no treefile")
    })?;
    let (number, line) = lines.next().ok_or(ImportError::NoSkeleton)?;
    let others = lines.count();
    if others > 0 {
        let what = format!("it holds {} trees", others + 1);
        return Err(ImportError::unsupported(
            what,
            "leave the line of one in it",
        ));
    }
    refuse_more(
        "segments",
        line.matches(',').count() / columns.of_segment,
        MOST_PLACES,
    )?;
    columns.edges(line).ok_or_else(|| {
        ImportError::bad_format(format!("line {number} does not hold what its header says"))
    })
}

/// The cells of a line; one behind the last comma may be empty.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.trim().trim_end_matches(',').split(',').map(str::trim)
}

impl Columns {
    fn of(header: &str) -> Option<Self> {
        let names: Vec<&str> = cells(header).collect();
        let of_tree = names.iter().position(|name| *name == "x")?;
        let segment = &names[of_tree..];
        let column = |name: &str| segment.iter().position(|n| *n == name);
        Some(Self {
            of_tree,
            of_segment: segment.len(),
            place: [column("x")?, column("y")?, column("z")?],
            parent: column("parent_id")?,
        })
    }

    /// Of the line of one tree; `None` where it cannot be read.
    fn edges(&self, line: &str) -> Option<Edges> {
        let mut numbers: Vec<f64> = Vec::new();
        for cell in cells(line) {
            numbers.push(cell.parse().ok()?);
        }
        let segments = numbers.get(self.of_tree..)?.chunks_exact(self.of_segment);
        if segments.len() == 0 || !segments.remainder().is_empty() {
            return None;
        }
        let mut file = Edges::default();
        for segment in segments {
            let parent = segment[self.parent];
            let own = file.places.len();
            file.places
                .push(from_z_up(self.place.map(|column| segment[column])));
            if parent < 0.0 {
                file.foot = file.foot.or(Some(own));
            } else if parent.fract() == 0.0 && parent < MOST_PLACES as f64 {
                file.edges.push([parent as usize, own]);
            } else {
                return None;
            }
        }
        Some(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    const FORK: &str = "# Tree file.\nheight, x,y,z,radius,parent_id\n\
                        3, 1,2,0,0.1,-1, 1,2,1,0.1,0, 1,3,2,0.1,1, 0,2,2.5,0.1,1, \n";

    #[test]
    fn segments_end_at_their_places() {
        let file = edges(FORK).expect("sound");
        assert_eq!(file.foot, Some(0));
        assert_eq!(file.edges, [[0, 1], [1, 2], [1, 3]]);
        assert_eq!(file.places[2], Point3::new(1.0, 2.0, -3.0));
    }

    #[test]
    fn what_is_no_treefile_is_refused() {
        let tree = FORK.lines().last().expect("a line");
        for bad in [
            "",
            "# only a comment\n",
            "x,y,z,radius\n0,0,0,1\n",
            "x,y,z,parent_id\n",
            &FORK.replace("0.1,-1", "0.1,-1,4"),
            &FORK.replace("0.1,1, 0", "0.1,1.5, 0"),
            &FORK.replace("0.1,0,", "0.1,1e300,"),
            &FORK.replace("0,2,2.5", "0,up,2.5"),
            &format!("{FORK}{tree}\n"),
        ] {
            assert!(edges(bad).is_err(), "{bad}");
        }
    }
}
