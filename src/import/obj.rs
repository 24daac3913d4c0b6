//! The skeleton in an OBJ file: its lines (`l`), y up.

use super::error::ImportError;
use super::model_tree::{Edges, MOST_PLACES};
use super::sketch::refuse_more;
use nalgebra::Point3;

/// The lines of an OBJ file. Faces do not count.
///
/// # Errors
/// A place or a line cannot be read.
pub(super) fn edges(text: &str) -> Result<Edges, ImportError> {
    let mut file = Edges::default();
    for (number, line) in (1..).zip(text.lines()) {
        let mut words = line.split_whitespace();
        let read = match words.next() {
            Some("v") => place(words).map(|at| file.places.push(at)),
            Some("l") => ends(words, file.places.len()).map(|ends| {
                file.edges
                    .extend(ends.windows(2).map(|pair| [pair[0], pair[1]]));
            }),
            _ => Some(()),
        };
        if read.is_none() {
            let what = format!("line {number} cannot be read");
            return Err(ImportError::bad_format(what));
        }
        refuse_more("places", file.places.len(), MOST_PLACES)?;
        refuse_more("edges", file.edges.len(), MOST_PLACES)?;
    }
    Ok(file)
}

/// Three numbers; what follows them does not count.
pub(super) fn place<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Point3<f64>> {
    let mut at = Point3::origin();
    for x in at.iter_mut() {
        *x = words.next()?.parse().ok()?;
    }
    Some(at)
}

/// The places of a line, from 0. The format counts from 1, and with a sign from the last one back.
fn ends<'a>(words: impl Iterator<Item = &'a str>, places: usize) -> Option<Vec<usize>> {
    let mut ends = Vec::new();
    for word in words {
        // What follows a slash is a place in a texture.
        let number: i64 = word.split('/').next()?.parse().ok()?;
        let end = match number {
            1.. => usize::try_from(number - 1).ok()?,
            0 => return None,
            _ => places.checked_sub(usize::try_from(number.unsigned_abs()).ok()?)?,
        };
        ends.push(end);
    }
    Some(ends)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_and_faces_are_not() {
        let text = "# a fork\nv 0 0 0 1\nv 0 1 0\nl 1/1 -1\nv 1 2 0\nl 2 3\nf 1 2 3\n";
        let file = edges(text).expect("sound");
        assert_eq!(file.edges, [[0, 1], [1, 2]]);
        assert_eq!(file.places[2], Point3::new(1.0, 2.0, 0.0));
        for bad in ["v 1 2", "v a b c", "v 0 0 0\nl 0 1", "l -1", "l 1 x"] {
            assert!(edges(bad).is_err(), "{bad}");
        }
    }
}
