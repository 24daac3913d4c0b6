//! The skeleton in a PLY file: its `edge` elements. z is up, as point clouds have it.

use super::error::ImportError;
use super::model_tree::{Edges, MOST_PLACES, from_z_up};
use super::sketch::refuse_more;

/// How its numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A kind of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

#[derive(Clone, Debug)]
struct Property {
    name: String,
    scalar: Scalar,
    /// Of a list: how its length is written.
    count: Option<Scalar>,
}

#[derive(Clone, Debug)]
struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
}

/// The edges of a PLY file, turned so that y is up.
///
/// # Errors
/// It is no PLY, is cut off, or its vertices have no x, y and z.
pub(super) fn edges(bytes: &[u8]) -> Result<Edges, ImportError> {
    let end = end_of_header(bytes).ok_or_else(|| bad("its header has no end"))?;
    let text = std::str::from_utf8(&bytes[..end]).map_err(|_| bad("its header is no text"))?;
    let header = header(text)?;
    let mut body = Body {
        encoding: header.encoding,
        rest: &bytes[end..],
    };
    let mut file = Edges::default();
    for element in &header.elements {
        read_element(element, &mut body, &mut file)?;
    }
    Ok(file)
}

fn bad(what: &str) -> ImportError {
    ImportError::bad_format(what)
}

/// Behind the line that ends the header.
fn end_of_header(bytes: &[u8]) -> Option<usize> {
    let mark = b"end_header";
    let at = bytes.windows(mark.len()).position(|w| w == mark)?;
    let line = bytes[at..].iter().position(|b| *b == b'\n')?;
    Some(at + line + 1)
}

fn header(text: &str) -> Result<Header, ImportError> {
    let mut lines = text.lines().map(str::trim);
    if lines.next() != Some("ply") {
        return Err(bad("it is no PLY"));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for line in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["format", word, _] => encoding = encoding_of(word),
            ["element", name, count] => elements.push(Element {
                name: name.into(),
                count: count.parse().map_err(|_| bad("an element has no number"))?,
                properties: Vec::new(),
            }),
            ["property", ref own @ ..] => {
                let property = property(own).ok_or_else(|| bad("a property cannot be read"))?;
                let element = elements.last_mut();
                element
                    .ok_or_else(|| bad("a property is of no element"))?
                    .properties
                    .push(property);
            }
            _ => {}
        }
    }
    let encoding = encoding.ok_or_else(|| bad("its format is none that is known"))?;
    Ok(Header { encoding, elements })
}

fn encoding_of(word: &str) -> Option<Encoding> {
    match word {
        "ascii" => Some(Encoding::Ascii),
        "binary_little_endian" => Some(Encoding::LittleEndian),
        "binary_big_endian" => Some(Encoding::BigEndian),
        _ => None,
    }
}

fn property(words: &[&str]) -> Option<Property> {
    match words {
        ["list", count, scalar, name] => Some(Property {
            name: (*name).into(),
            scalar: scalar_of(scalar)?,
            count: Some(scalar_of(count)?),
        }),
        [scalar, name] => Some(Property {
            name: (*name).into(),
            scalar: scalar_of(scalar)?,
            count: None,
        }),
        _ => None,
    }
}

fn scalar_of(word: &str) -> Option<Scalar> {
    Some(match word {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

/// What follows the header.
struct Body<'a> {
    encoding: Encoding,
    rest: &'a [u8],
}

impl Body<'_> {
    fn number(&mut self, scalar: Scalar) -> Option<f64> {
        if self.encoding == Encoding::Ascii {
            let start = self.rest.iter().position(|b| !b.is_ascii_whitespace())?;
            let word = &self.rest[start..];
            let length = word.iter().position(u8::is_ascii_whitespace);
            let (word, rest) = word.split_at(length.unwrap_or(word.len()));
            self.rest = rest;
            return std::str::from_utf8(word).ok()?.parse().ok();
        }
        let (own, rest) = self.rest.split_at_checked(size(scalar))?;
        self.rest = rest;
        let mut bytes = [0; 8];
        bytes[..own.len()].copy_from_slice(own);
        if self.encoding == Encoding::BigEndian {
            bytes[..own.len()].reverse();
        }
        Some(value(scalar, bytes))
    }
}

/// Bytes of a number.
fn size(scalar: Scalar) -> usize {
    match scalar {
        Scalar::I8 | Scalar::U8 => 1,
        Scalar::I16 | Scalar::U16 => 2,
        Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
        Scalar::F64 => 8,
    }
}

/// The number in the first of these bytes, the lowest first.
fn value(scalar: Scalar, bytes: [u8; 8]) -> f64 {
    let [a, b, c, d, ..] = bytes;
    match scalar {
        Scalar::I8 => f64::from(i8::from_le_bytes([a])),
        Scalar::U8 => f64::from(a),
        Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
        Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
        Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
        Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
        Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
        Scalar::F64 => f64::from_le_bytes(bytes),
    }
}

/// Reads an element's rows; of vertices and edges they go into `file`.
fn read_element(element: &Element, body: &mut Body, file: &mut Edges) -> Result<(), ImportError> {
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
            let number = read_property(property, body);
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

/// The number of a property; of a list its last one.
fn read_property(property: &Property, body: &mut Body) -> Option<f64> {
    let Some(count) = property.count else {
        return body.number(property.scalar);
    };
    let mut last = 0.0;
    let mut left = body.number(count)?;
    while left >= 1.0 {
        last = body.number(property.scalar)?;
        left -= 1.0;
    }
    Some(last)
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
