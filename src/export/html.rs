//! The tree as one HTML page that needs nothing else: no network, no other file.
//!
//! The page's code lies in `src/export/viewer/` and is put into the program by `build.rs`; here the
//! tree is put into it.

pub use super::html_data::{Branch, Data, ForestFacts, Sways};

use super::ExportError;
use crate::document::jpeg;
use crate::files::WriteError;
use crate::model::{Rgb, Size};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use image::imageops::FilterType;
use std::io::Write;

/// Empty in a program that was built without npm.
const VIEWER: &str = include_str!(concat!(env!("OUT_DIR"), "/viewer.html"));

/// A picture of more bytes than this is made smaller, to this length of its longer side, px.
const PICTURE_BYTES: usize = 1_000_000;
const PICTURE_SIDE: u32 = 1600;

/// What goes into a page.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// Shown as the page's name, and that of the file that it offers for download.
    pub title: &'a str,
    /// The model, which the page gives out byte for byte as it is here.
    pub glb: &'a [u8],
    pub data: &'a Data,
    /// A frame of the film at its full size; a large one is put in smaller.
    pub picture: Option<&'a Rgb>,
}

/// Whether pages can be made at all, for those who want to know it before the work.
///
/// # Errors
/// [`ExportError::NoViewer`] if the program was built without the viewer.
pub fn built_in() -> Result<(), ExportError> {
    if VIEWER.is_empty() {
        Err(ExportError::NoViewer)
    } else {
        Ok(())
    }
}

/// The page, UTF-8.
///
/// # Errors
/// [`ExportError::NoViewer`] if the program was built without the viewer; [`ExportError::Unfit`] if
/// the picture is none.
pub fn page(page: &Page) -> Result<String, ExportError> {
    fill(VIEWER, page)
}

fn fill(viewer: &str, page: &Page) -> Result<String, ExportError> {
    if viewer.is_empty() {
        return Err(ExportError::NoViewer);
    }
    let data = serde_json::to_string(&Titled {
        title: page.title,
        data: page.data,
    });
    let data = data.map_err(|e| ExportError::unfit(e.to_string()))?;
    let parts = [
        ("@ARBORCAM_TITLE@", escaped(page.title)),
        // In JSON `<` stands only inside texts; so written, none of them can end the block that it
        // is in.
        ("@ARBORCAM_DATA@", data.replace('<', "\\u003c")),
        ("@ARBORCAM_GLB@", STANDARD.encode(gzip(page.glb)?)),
        (
            "@ARBORCAM_PICTURE@",
            page.picture
                .map(light)
                .transpose()?
                .map(|jpeg| STANDARD.encode(jpeg))
                .unwrap_or_default(),
        ),
    ];
    // From one mark to the next: what was put in is not searched for marks.
    let mut out = String::with_capacity(
        viewer.len() + parts.iter().map(|(_, text)| text.len()).sum::<usize>(),
    );
    let mut rest = viewer;
    for (mark, text) in &parts {
        let (before, after) = rest
            .split_once(mark)
            .ok_or_else(|| ExportError::unfit(format!("{mark} is not in the viewer")))?;
        out.push_str(before);
        out.push_str(text);
        rest = after;
    }
    out.push_str(rest);
    Ok(out)
}

#[derive(serde::Serialize)]
struct Titled<'a> {
    title: &'a str,
    #[serde(flatten)]
    data: &'a Data,
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// The picture as JPEG, smaller where it would be most of the page.
fn light(picture: &Rgb) -> Result<Vec<u8>, ExportError> {
    let whole = jpeg(picture)?;
    let pixels = image::RgbImage::from_raw(
        picture.size.width,
        picture.size.height,
        picture.pixels.clone(),
    );
    let Some(pixels) = pixels.filter(|_| whole.len() > PICTURE_BYTES) else {
        return Ok(whole);
    };
    let small = image::DynamicImage::from(pixels)
        .resize(PICTURE_SIDE, PICTURE_SIDE, FilterType::Triangle)
        .into_rgb8();
    Ok(jpeg(&Rgb {
        size: Size::new(small.width(), small.height()),
        pixels: small.into_raw(),
    })?)
}

/// Makes up for what base64 adds. No time of day goes into it.
fn gzip(bytes: &[u8]) -> Result<Vec<u8>, ExportError> {
    let mut packer = GzEncoder::new(Vec::with_capacity(bytes.len() / 2), Compression::default());
    packer
        .write_all(bytes)
        .and_then(|()| packer.finish())
        .map_err(|e| WriteError::from_io("the page", 0, e).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEWER: &str = "<title>@ARBORCAM_TITLE@</title><script>@ARBORCAM_DATA@</script>\
        <script>@ARBORCAM_GLB@</script><script>@ARBORCAM_PICTURE@</script><script>code</script>";

    fn data(source: &str) -> Data {
        Data {
            source: source.into(),
            software: "arborcam".into(),
            captured_at: None,
            notes: Default::default(),
            metres_per_px: 0.0,
            image: [4, 3],
            foot_px: [2.0, 2.0],
            outline_px: Vec::new(),
            picture_time_s: None,
            start_s: 0.0,
            times_s: Vec::new(),
            main_branch_rgb: crate::model::MAIN_BRANCH_RGB,
            branches: Vec::new(),
            modes: Vec::new(),
            forest: None,
        }
    }

    #[test]
    fn a_name_with_html_in_it_stays_a_name() {
        let name = "</script><script>alert(1)</script><!-- & @ARBORCAM_GLB@";
        let data = data(name);
        let made = fill(
            VIEWER,
            &Page {
                title: name,
                glb: b"glb",
                data: &data,
                picture: None,
            },
        )
        .unwrap();
        assert_eq!(made.matches("<script>").count(), 4, "{made}");
        assert_eq!(made.matches("</script>").count(), 4, "{made}");
        assert!(!made.contains("<!--"), "{made}");
        let json = made
            .split("<script>")
            .nth(1)
            .unwrap()
            .split("</script>")
            .next()
            .unwrap();
        let back: serde_json::Value = serde_json::from_str(json).unwrap();
        assert_eq!(
            (back["title"].as_str(), back["source"].as_str()),
            (Some(name), Some(name))
        );
        assert!(
            made.ends_with("<script></script><script>code</script>"),
            "{made}"
        );
    }

    #[test]
    fn a_large_picture_is_made_lighter() {
        let noise = |k: u32| (k.wrapping_mul(k).wrapping_mul(2_654_435_761) >> 24) as u8;
        let film = |size: Size| Rgb {
            size,
            pixels: (0..size.width * size.height * 3).map(noise).collect(),
        };
        let side = |jpeg: &[u8]| {
            image::load_from_memory(jpeg)
                .map(|i| (i.width(), i.height()))
                .unwrap()
        };
        assert_eq!(side(&light(&film(Size::new(64, 48))).unwrap()), (64, 48));
        assert_eq!(
            side(&light(&film(Size::new(2400, 1350))).unwrap()),
            (1600, 900)
        );
    }

    #[test]
    fn a_program_without_the_viewer_says_what_to_do() {
        let data = data("film");
        let error = fill(
            "",
            &Page {
                title: "tree",
                glb: b"glb",
                data: &data,
                picture: None,
            },
        )
        .unwrap_err()
        .to_string();
        assert!(
            error.contains("npm") && error.contains("make build") && !error.contains('\n'),
            "{error}"
        );
    }

    #[test]
    fn the_model_comes_back_byte_for_byte() {
        let picture = Rgb {
            size: Size::new(4, 3),
            pixels: vec![90; 36],
        };
        let glb: Vec<u8> = (0..10_000_u32).map(|i| ((i * i) >> 3) as u8).collect();
        let data = data("film");
        let made = fill(
            VIEWER,
            &Page {
                title: "tree",
                glb: &glb,
                data: &data,
                picture: Some(&picture),
            },
        )
        .unwrap();
        let block = |k: usize| {
            made.split("<script>")
                .nth(k)
                .unwrap()
                .split("</script>")
                .next()
                .unwrap()
        };
        let mut back = Vec::new();
        let packed = STANDARD.decode(block(2)).unwrap();
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&packed[..]), &mut back)
            .unwrap();
        assert!(back == glb);
        assert_eq!(STANDARD.decode(block(3)).unwrap(), jpeg(&picture).unwrap());
    }
}
