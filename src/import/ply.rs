//! The skeleton in a PLY file: its `edge` elements. z is up, as point clouds have it.

use super::error::ImportError;
use super::model_tree::{Edges, MOST_PLACES, from_z_up};
use super::ply_rows::{Body, Element, bad, read_header};
use super::sketch::refuse_more;

/// The edges of a PLY file, turned so that y is up.
///
/// # Errors
/// It is no PLY, is cut off, or its vertices have no x, y and z.
pub(super) fn edges(bytes: &[u8]) -> Result<Edges, ImportError> {
    let mut input = bytes;
    let header = read_header(&mut input)?;
    let mut body = Body {
        encoding: header.encoding,
        input,
    };
    let mut file = Edges::default();
    for element in &header.elements {
        read_element(element, &mut body, &mut file)?;
    }
    Ok(file)
}

/// Reads an element's rows; of vertices and edges they go into `file`.
fn read_element(
    element: &Element,
    body: &mut Body<&[u8]>,
    file: &mut Edges,
) -> Result<(), ImportError> {
    let names: &[&str] = match element.name.as_str() {
        "vertex" => &["x", "y", "z"],
        "edge" => &["vertex1", "vertex2"],
        _ => &[],
    };
    let mut wanted: Vec<usize> = Vec::new();
    for name in names {
        let found = element.properties.iter().position(|p| p.name == *name);
        wanted.push(found.ok_or_else(|| bad(&format!("its {} has no {name}", element.name)))?);
    }
    if !wanted.is_empty() {
        refuse_more("places or edges", element.count, MOST_PLACES)?;
    }
    let mut row = Vec::with_capacity(element.properties.len());
    for _ in 0..element.count {
        // A row without properties takes no bytes, and there may be any number of them.
        if element.properties.is_empty() {
            break;
        }
        row.clear();
        for property in &element.properties {
            let number = body.property(property);
            row.push(number.ok_or_else(|| bad("it is cut off, or holds what is no number"))?);
        }
        match wanted[..] {
            [x, y, z] => file.places.push(from_z_up([row[x], row[y], row[z]])),
            [a, b] => file.edges.push([row[a], row[b]].map(place_number)),
            _ => {}
        }
    }
    Ok(())
}

/// A place that is no whole number from 0 up is none.
fn place_number(number: f64) -> usize {
    if number >= 0.0 && number.fract() == 0.0 {
        number as usize
    } else {
        usize::MAX
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    const HEAD: &str = "element vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                        property list uchar int seen\nelement face 0\nproperty list uchar int all\n\
                        element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n";

    #[test]
    fn text_and_both_kinds_of_bytes_say_the_same() {
        let ascii = format!("ply\nformat ascii 1.0\ncomment x\n{HEAD}0 0 1 2 7 7\n3 4 5 0\n0 1\n");
        let expected = Edges {
            places: vec![Point3::new(0.0, 1.0, -0.0), Point3::new(3.0, 5.0, -4.0)],
            edges: vec![[0, 1]],
            wood: Vec::new(),
            foot: None,
        };
        assert_eq!(edges(ascii.as_bytes()), Ok(expected.clone()));
        for little in [true, false] {
            let word = if little { "little" } else { "big" };
            let mut file = format!("ply\nformat binary_{word}_endian 1.0\n{HEAD}").into_bytes();
            let float = |x: f32| {
                if little {
                    x.to_le_bytes()
                } else {
                    x.to_be_bytes()
                }
            };
            let int = |x: i32| {
                if little {
                    x.to_le_bytes()
                } else {
                    x.to_be_bytes()
                }
            };
            for (row, seen) in [([0.0, 0.0, 1.0], 2), ([3.0, 4.0, 5.0], 0)] {
                row.iter().for_each(|x| file.extend(float(*x)));
                file.push(seen);
                (0..seen).for_each(|_| file.extend(int(7)));
            }
            [0, 1].iter().for_each(|x| file.extend(int(*x)));
            assert_eq!(edges(&file), Ok(expected.clone()), "{word}");
            assert!(edges(&file[..file.len() - 1]).is_err(), "cut off");
        }
    }

    #[test]
    fn what_is_no_skeleton_is_refused() {
        for bad in [
            "",
            "ply\n",
            "ply\nformat odd 1.0\nend_header\n",
            "ply\nformat ascii 1.0\nproperty int x\nend_header\n",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
            "ply\nformat ascii 1.0\nelement edge many\nend_header\n",
        ] {
            assert!(edges(bad.as_bytes()).is_err(), "{bad}");
        }
    }
}
