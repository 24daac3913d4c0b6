//! Where an SVG drawing stands in the picture: size of the page, view box, transforms.

use super::error::ImportError;
use super::sketch::picture_size;
use crate::model::Size;
use kurbo::{Affine, Vec2};
use roxmltree::Node;
use std::str::FromStr;
use svgtypes::{Align, AspectRatio, Length, LengthUnit, Transform, ViewBox};

/// The longer side of a page, px: drawings have no pixels of their own, and are scaled to it.
const LONGER_SIDE_PX: std::ops::RangeInclusive<f64> = 640.0..=4096.0;
/// Of an inch, by the definition of CSS.
const PX_PER_INCH: f64 = 96.0;

/// The page of a drawing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Page {
    pub size: Size,
    /// From the units of the drawing to px.
    pub from_user: Affine,
}

impl Page {
    /// That of the outermost element.
    ///
    /// # Errors
    /// It says no usable size.
    pub fn of(svg: Node) -> Result<Self, ImportError> {
        let view_box = parsed::<ViewBox>(svg, "viewBox")?;
        let by_box = view_box.map(|b| [b.w, b.h]);
        let width = side(svg, "width").or(by_box.map(|b| b[0]));
        let height = side(svg, "height").or(by_box.map(|b| b[1]));
        let (Some(width), Some(height)) = (width, height) else {
            return Err(ImportError::unsupported(
                "it says nothing of its size",
                "give the page a width and a height, or a viewBox",
            ));
        };
        if !(width > 0.0 && height > 0.0 && width.is_finite() && height.is_finite()) {
            return Err(ImportError::BadSize { width, height });
        }
        let longer = width.max(height);
        let wanted = longer.clamp(*LONGER_SIDE_PX.start(), *LONGER_SIDE_PX.end());
        let [width, height] = [width, height].map(|side| side * (wanted / longer));
        let from_user = match view_box {
            Some(view_box) => fitted(svg, view_box, width, height)?,
            None => Affine::scale(wanted / longer),
        };
        Ok(Self {
            size: picture_size(width, height)?,
            from_user,
        })
    }
}

/// The view box on a page of this size, px, as `preserveAspectRatio` says (SVG 1.1 sect. 7.8).
fn fitted(svg: Node, view_box: ViewBox, width: f64, height: f64) -> Result<Affine, ImportError> {
    let ratio = parsed::<AspectRatio>(svg, "preserveAspectRatio")?.unwrap_or(AspectRatio {
        defer: false,
        align: Align::XMidYMid,
        slice: false,
    });
    let [sx, sy] = [width / view_box.w, height / view_box.h];
    let scale = match (ratio.align, ratio.slice) {
        (Align::None, _) => Vec2::new(sx, sy),
        (_, true) => Vec2::new(sx.max(sy), sx.max(sy)),
        (_, false) => Vec2::new(sx.min(sy), sx.min(sy)),
    };
    let [x, y] = shares_before(ratio.align);
    let rest = Vec2::new(width - scale.x * view_box.w, height - scale.y * view_box.h);
    Ok(Affine::translate((x * rest.x, y * rest.y))
        * Affine::scale_non_uniform(scale.x, scale.y)
        * Affine::translate((-view_box.x, -view_box.y)))
}

/// Which shares of the room that is left lie left of and above the drawing.
fn shares_before(align: Align) -> [f64; 2] {
    match align {
        Align::None | Align::XMinYMin => [0.0, 0.0],
        Align::XMidYMin => [0.5, 0.0],
        Align::XMaxYMin => [1.0, 0.0],
        Align::XMinYMid => [0.0, 0.5],
        Align::XMidYMid => [0.5, 0.5],
        Align::XMaxYMid => [1.0, 0.5],
        Align::XMinYMax => [0.0, 1.0],
        Align::XMidYMax => [0.5, 1.0],
        Align::XMaxYMax => [1.0, 1.0],
    }
}

/// A side of the page, px; `None` where it is not given, or given against what is not known.
fn side(svg: Node, name: &str) -> Option<f64> {
    length(svg.attribute(name)?.trim())
}

/// A length, px. `None` for what is no length, or one against something else.
pub(super) fn length(text: &str) -> Option<f64> {
    let Length { number, unit } = Length::from_str(text).ok()?;
    let px = match unit {
        LengthUnit::None | LengthUnit::Px => 1.0,
        LengthUnit::In => PX_PER_INCH,
        LengthUnit::Cm => PX_PER_INCH / 2.54,
        LengthUnit::Mm => PX_PER_INCH / 25.4,
        LengthUnit::Pt => PX_PER_INCH / 72.0,
        LengthUnit::Pc => PX_PER_INCH / 6.0,
        LengthUnit::Em | LengthUnit::Ex | LengthUnit::Percent => return None,
    };
    Some(number * px)
}

/// An element's own transform.
///
/// # Errors
/// It cannot be read, or lets nothing be seen.
pub(super) fn transform_of(node: Node) -> Result<Affine, ImportError> {
    let Some(transform) = parsed::<Transform>(node, "transform")? else {
        return Ok(Affine::IDENTITY);
    };
    let Transform { a, b, c, d, e, f } = transform;
    let affine = Affine::new([a, b, c, d, e, f]);
    if affine.determinant().is_finite() && affine.determinant() != 0.0 {
        return Ok(affine);
    }
    Err(unread(
        "transform",
        node.attribute("transform").unwrap_or_default(),
    ))
}

/// What an attribute says; `None` where it is not there.
///
/// # Errors
/// It cannot be read.
fn parsed<T: FromStr>(node: Node, name: &'static str) -> Result<Option<T>, ImportError> {
    let Some(text) = node.attribute(name) else {
        return Ok(None);
    };
    text.parse().map(Some).map_err(|_| unread(name, text))
}

fn unread(name: &str, text: &str) -> ImportError {
    // A matrix may be any length.
    let shown: String = text.chars().take(60).collect();
    ImportError::unsupported(
        format!("{name}={shown:?} cannot be read"),
        "flatten the transforms before it is saved, or correct it",
    )
}
