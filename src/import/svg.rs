//! A sketch in SVG. Lines, polylines and paths are strokes, each part of a path one of its own. What
//! is marked `trunk` is the trunk, what is marked `crown` the outline of the crown: by its id, a
//! class or the name of its layer in Inkscape, or by that of a group around it.

use super::error::ImportError;
use super::sketch::{MOST_POINTS, MOST_STROKES, Sketch, Stroke, refuse_more};
use super::svg_path::flattened;
use super::svg_place::{Page, length, transform_of};
use kurbo::Affine;
use nalgebra::Point2;
use roxmltree::{Document, Node, ParsingOptions};

const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";
/// Elements that are read; each may have any number of attributes.
const MOST_ELEMENTS: u32 = 200_000;
/// Elements in each other: all are looked at by one function that calls itself.
const DEEPEST: usize = 200;
/// What is only drawn where something else refers to it.
const NOT_DRAWN: [&str; 7] = [
    "defs", "symbol", "clipPath", "mask", "marker", "pattern", "metadata",
];

/// # Errors
/// It is no SVG; its size, a transform or a path cannot be read; it uses copies of its parts.
pub(super) fn parse(text: &str) -> Result<Sketch, ImportError> {
    let options = ParsingOptions {
        // Some programs still write one. The parser bounds what its entities unfold to.
        allow_dtd: true,
        nodes_limit: MOST_ELEMENTS,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options).map_err(ImportError::bad_format)?;
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        return Err(ImportError::bad_format("it is XML, but no SVG"));
    }
    let page = Page::of(root)?;
    let mut drawing = Drawing {
        strokes: Vec::new(),
        crown_px: Vec::new(),
        points: 0,
    };
    let outside = Around {
        to_page: page.from_user,
        width: width_of(root)?,
        ..Around::default()
    };
    for child in root.children() {
        drawing.add(child, &outside, 0)?;
    }
    Ok(Sketch {
        size: page.size,
        strokes: drawing.strokes,
        crown_px: drawing.crown_px,
    })
}

/// What an element has from those around it.
#[derive(Clone, Copy, Debug, Default)]
struct Around {
    to_page: Affine,
    is_trunk: bool,
    is_crown: bool,
    /// In the element's own units.
    width: Option<f64>,
}

/// What has been read.
struct Drawing {
    strokes: Vec<Stroke>,
    crown_px: Vec<Point2<f64>>,
    points: usize,
}

impl Drawing {
    fn add(&mut self, node: Node, around: &Around, depth: usize) -> Result<(), ImportError> {
        let tag = node.tag_name().name();
        if !node.is_element() || NOT_DRAWN.contains(&tag) || is_hidden(node) {
            return Ok(());
        }
        refuse_more("elements in each other", depth, DEEPEST)?;
        if property(node, "transform").is_some() && node.attribute("transform").is_none() {
            return Err(ImportError::unsupported(
                "it has a transform in a style",
                "flatten the transforms before it is saved",
            ));
        }
        let own = Around {
            to_page: around.to_page * transform_of(node)?,
            is_trunk: around.is_trunk || is_marked(node, "trunk"),
            is_crown: around.is_crown || is_marked(node, "crown"),
            width: width_of(node)?.or(around.width),
        };
        match tag {
            "g" | "a" | "switch" => {
                for child in node.children() {
                    self.add(child, &own, depth + 1)?;
                }
                Ok(())
            }
            "path" => self.add_path(node, node.attribute("d").unwrap_or_default(), &own),
            "polyline" => self.add_path(node, &points_as_path(node, false), &own),
            "polygon" => self.add_path(node, &points_as_path(node, true), &own),
            "line" => self.add_path(node, &line_as_path(node), &own),
            "use" => Err(ImportError::unsupported(
                "it uses <use>, copies of its own parts",
                "unlink the clones before it is saved",
            )),
            "svg" => Err(ImportError::unsupported(
                "it holds an SVG within the SVG",
                "take the inner one apart before it is saved",
            )),
            // Pictures, texts and closed shapes are no strokes.
            _ => Ok(()),
        }
    }

    /// Adds the parts of a path.
    fn add_path(&mut self, node: Node, path: &str, own: &Around) -> Result<(), ImportError> {
        let name = self.name_of(node);
        let parts = flattened(path, own.to_page).map_err(|why| ImportError::BadStroke {
            what: name.clone(),
            why,
        })?;
        // Only what is an area is closed: of the crown's parts the first counts.
        if own.is_crown {
            let part = parts.into_iter().next().unwrap_or_default();
            self.points += part.len();
            self.crown_px = part;
            return refuse_more("points", self.points, MOST_POINTS);
        }
        let scale = own.to_page.determinant().abs().sqrt();
        let several = parts.len() > 1;
        for (number, points_px) in (1..).zip(parts) {
            self.points += points_px.len();
            self.strokes.push(Stroke {
                name: if several {
                    format!("{name}, part {number}")
                } else {
                    name.clone()
                },
                points_px,
                is_trunk: own.is_trunk,
                width_px: own.width.map(|w| w * scale),
            });
            refuse_more("points", self.points, MOST_POINTS)?;
            refuse_more("strokes", self.strokes.len(), MOST_STROKES)?;
        }
        Ok(())
    }

    fn name_of(&self, node: Node) -> String {
        let id = node.attribute("id").or(node.attribute((INKSCAPE, "label")));
        match id {
            Some(id) => format!("stroke {id:?}"),
            None => format!("stroke {}", self.strokes.len() + 1),
        }
    }
}

/// Whether an element is marked by this word.
fn is_marked(node: Node, word: &str) -> bool {
    let by_class = node.attribute("class").unwrap_or_default();
    let names = [node.attribute("id"), node.attribute((INKSCAPE, "label"))];
    let mut all = by_class
        .split_whitespace()
        .chain(names.into_iter().flatten());
    all.any(|name| name.eq_ignore_ascii_case(word))
}

/// A property of an element: what its `style` says over its own attribute.
fn property<'a>(node: Node<'a, 'a>, name: &str) -> Option<&'a str> {
    let style = node.attribute("style").unwrap_or_default();
    let mut entries = style.split(';').filter_map(|entry| entry.split_once(':'));
    let own = entries.find(|(key, _)| key.trim() == name);
    own.map(|(_, value)| value.trim())
        .or(node.attribute(name).map(str::trim))
}

fn is_hidden(node: Node) -> bool {
    property(node, "display") == Some("none") || property(node, "visibility") == Some("hidden")
}

/// `stroke-width`, in the element's own units.
fn width_of(node: Node) -> Result<Option<f64>, ImportError> {
    let Some(text) = property(node, "stroke-width").filter(|text| *text != "inherit") else {
        return Ok(None);
    };
    let width = length(text);
    width.map(Some).ok_or_else(|| {
        ImportError::unsupported(
            format!("a stroke-width is {text:?}"),
            "give it as a number of px",
        )
    })
}

fn points_as_path(node: Node, closed: bool) -> String {
    let points = node.attribute("points").unwrap_or_default();
    format!("M {points} {}", if closed { "Z" } else { "" })
}

fn line_as_path(node: Node) -> String {
    let [x1, y1, x2, y2] = ["x1", "y1", "x2", "y2"].map(|name| node.attribute(name).unwrap_or("0"));
    format!("M {x1} {y1} L {x2} {y2}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::read_sketch;

    /// What is drawn in an SVG of 640 by 480 px.
    fn drawn(inside: &str) -> Result<Sketch, ImportError> {
        let svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="640" height="480">{inside}</svg>"#
        );
        read_sketch(svg.as_bytes())
    }

    /// The points of the only stroke in the coordinates of SVG, which begin half a pixel earlier.
    fn points(inside: &str) -> Vec<[f64; 2]> {
        let sketch = drawn(inside).expect("sound");
        assert_eq!(sketch.strokes.len(), 1, "{inside}");
        let points = sketch.strokes[0].points_px.iter();
        points
            .map(|p| [p.x + 0.5, p.y + 0.5].map(|x| (1e6 * x).round() / 1e6))
            .collect()
    }

    #[test]
    fn lines_and_paths_of_all_kinds_are_strokes() {
        for inside in [
            r#"<line x1="100" y1="200" x2="110" y2="180"/>"#,
            r#"<polyline points="100,200 110 180"/>"#,
            r#"<path d="M100 200L110 180"/>"#,
            r#"<path d="m 100,200 10,-20"/>"#,
            r#"<g transform="translate(50 100) scale(10)"><g transform="matrix(1 0 0 1 5 10)">
                <path d="M0 0 l 1 -2"/></g></g>"#,
            r#"<path transform="rotate(90)" d="M200 -100 L180 -110"/>"#,
        ] {
            assert_eq!(points(inside), [[100.0, 200.0], [110.0, 180.0]], "{inside}");
        }
        let corner = points(r#"<path d="M100 200 H 150 V 100 h -20 v 5"/>"#);
        assert_eq!(
            corner,
            [
                [100.0, 200.0],
                [150.0, 200.0],
                [150.0, 100.0],
                [130.0, 100.0],
                [130.0, 105.0]
            ]
        );
        // Curves: each passes through its middle.
        for (path, middle) in [
            ("M100 200 C 100 100 200 100 200 200", [150.0, 125.0]),
            ("M100 200 Q 150 100 200 200", [150.0, 150.0]),
            ("M100 200 A 50 50 0 0 1 200 200", [150.0, 150.0]),
            ("M100 200 Q 125 150 150 150 T 200 200", [150.0, 150.0]),
            (
                "M100 200 C 100 170 120 150 150 150 S 200 170 200 200",
                [150.0, 150.0],
            ),
        ] {
            let line = points(&format!(r#"<path d="{path}"/>"#));
            assert_eq!(line[0], [100.0, 200.0]);
            assert_eq!(line[line.len() - 1], [200.0, 200.0]);
            let off = line.windows(2).map(|pair| {
                let [a, b] = [pair[0], pair[1]].map(Point2::from);
                crate::signal::distance_to_segment(middle.into(), a, b)
            });
            assert!(off.fold(f64::INFINITY, f64::min) < 0.5, "{path}: {line:?}");
        }
    }

    #[test]
    fn trunk_and_crown_are_marked_by_id_class_or_layer() {
        let path = r#"d="M100 200 L110 180""#;
        for inside in [
            format!(r#"<path id="trunk" {path}/>"#),
            format!(r#"<path class="thick Trunk" {path}/>"#),
            format!(r#"<g id="trunk"><path {path}/></g>"#),
            format!(r#"<g xmlns:inkscape="{INKSCAPE}" inkscape:label="trunk"><path {path}/></g>"#),
        ] {
            assert!(
                drawn(&inside).expect("sound").strokes[0].is_trunk,
                "{inside}"
            );
        }
        let both = format!(r#"<polygon id="crown" points="1,1 99,1 50,99"/><path {path}/>"#);
        let sketch = drawn(&both).expect("sound");
        assert_eq!((sketch.strokes.len(), sketch.crown_px.len()), (1, 4));
        assert!(!sketch.strokes[0].is_trunk);
    }

    #[test]
    fn widths_are_inherited_and_scaled_and_hidden_parts_are_left_out() {
        let inside = r#"<g stroke-width="3" transform="scale(2)"><path d="M50 100 L55 90"/></g>
            <path style="fill:none; stroke-width:1mm" d="M100 200 L110 180"/>
            <path style="display:none" d="nonsense"/><defs><path d="nonsense"/></defs>
            <rect width="9" height="9"/><text>words</text>
            <path d="M1 2 L3 4 M5 6 L7 8"/>"#;
        let sketch = drawn(inside).expect("sound");
        let widths: Vec<Option<f64>> = sketch.strokes.iter().map(|s| s.width_px).collect();
        assert_eq!(widths, [Some(6.0), Some(96.0 / 25.4), None, None]);
        assert_eq!(sketch.strokes[3].name, "stroke 3, part 2");
    }

    /// Drawings in millimetres, in a view box of their own, and small ones.
    #[test]
    fn the_page_is_scaled_to_pixels() {
        for (root, size, at) in [
            (r#"width="640" height="480""#, [640, 480], [10.0, 20.0]),
            (
                r#"width="160mm" height="80mm" viewBox="0 0 1280 640""#,
                [640, 320],
                [5.0, 10.0],
            ),
            (r#"viewBox="0 0 64 32""#, [640, 320], [100.0, 200.0]),
            (
                r#"width="640" height="640" viewBox="0 0 64 32""#,
                [640, 640],
                [100.0, 360.0],
            ),
            (
                r#"width="640" height="640" viewBox="0 0 64 32" preserveAspectRatio="xMidYMin""#,
                [640, 640],
                [100.0, 200.0],
            ),
            (
                r#"width="640" height="640" viewBox="0 0 64 32" preserveAspectRatio="none""#,
                [640, 640],
                [100.0, 400.0],
            ),
            (
                r#"width="100%" viewBox="-10 0 640 480""#,
                [640, 480],
                [20.0, 20.0],
            ),
        ] {
            let svg = format!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" {root}><path d="M10 20 L 11 21"/></svg>"#
            );
            let sketch = read_sketch(svg.as_bytes()).expect(root);
            assert_eq!([sketch.size.width, sketch.size.height], size, "{root}");
            let first = sketch.strokes[0].points_px[0];
            assert!(
                (first - Point2::new(at[0] - 0.5, at[1] - 0.5)).norm() < 1e-6,
                "{root}: {first}"
            );
        }
    }

    #[test]
    fn what_cannot_be_read_is_said_in_one_line() {
        let path = r#"<path d="M100 200 L110 180"/>"#;
        for (inside, expected) in [
            (String::new(), "no strokes"),
            ("<rect width='9' height='9'/>".into(), "no strokes"),
            (
                format!("<g transform='rotate(ninety)'>{path}</g>"),
                "transform",
            ),
            (format!("<g transform='scale(0)'>{path}</g>"), "transform"),
            (
                format!("<g style='transform:scale(2)'>{path}</g>"),
                "transform",
            ),
            ("<path d='M100 200 X'/>".into(), "cannot be read"),
            ("<path d='M100 200 L1e300 1'/>".into(), "too far"),
            ("<path d='M100 200 L900 1'/>".into(), "outside"),
            ("<polyline points='100,200 110'/>".into(), "cannot be read"),
            ("<path stroke-width='-1' d='M1 2 L3 4'/>".into(), "width"),
            (
                "<path stroke-width='wide' d='M1 2 L3 4'/>".into(),
                "stroke-width",
            ),
            (
                format!("<path id='a' class='trunk' d='M1 2 L3 4'/><g id='trunk'>{path}</g>"),
                "both marked",
            ),
            (format!("{path}<use href='#a'/>"), "unlink"),
            (format!("<svg>{path}</svg>"), "within"),
            (
                format!("{}{path}{}", "<g>".repeat(300), "</g>".repeat(300)),
                "in each other",
            ),
            (format!("{path}</g>"), "damaged"),
        ] {
            let error = drawn(&inside).expect_err(&inside).to_string();
            assert!(
                error.contains(expected) && !error.contains('\n'),
                "{inside}: {error}"
            );
        }
        for (whole, expected) in [
            ("", "empty"),
            ("words", "neither"),
            ("<html/>", "no SVG"),
            ("<svg><path d='M1 2 L3 4'/></svg>", "size"),
            (
                "<svg width='640' height='1'><path d='M1 0 L3 0'/></svg>",
                "64 to 12288",
            ),
            ("<svg width='0' height='9'/>", "64 to 12288"),
            ("<svg viewBox='0 0 nan 1'/>", "viewBox"),
        ] {
            let error = read_sketch(whole.as_bytes()).expect_err(whole).to_string();
            assert!(error.contains(expected), "{whole}: {error}");
        }
        assert!(read_sketch(&[b'<', 0xff, 0xfe]).is_err());
        // Entities that unfold to any length.
        let bomb = "<!DOCTYPE svg [<!ENTITY a 'aaaaaaaaaaaaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;&a;'>\
            <!ENTITY c '&b;&b;&b;&b;&b;&b;&b;&b;'><!ENTITY d '&c;&c;&c;&c;&c;&c;&c;&c;'>\
            <!ENTITY e '&d;&d;&d;&d;&d;&d;&d;&d;'>]><svg width='640' height='480'>&e;&e;&e;&e;</svg>";
        assert!(read_sketch(bomb.as_bytes()).is_err());
    }
}
