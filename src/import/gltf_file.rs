//! The parts of a glTF file and its numbers. Every place in it is checked: the crate takes them for
//! granted.

use super::error::ImportError;
use crate::files::read_bounded;
use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, Document, Gltf};
use std::path::Path;

/// All that a file refers to, bytes.
const LARGEST_IN_ALL: u64 = 1_000_000_000;
const CUT_OFF: &str = "a table in it is cut off";

/// A glTF file with its buffers.
pub(super) struct GltfFile {
    pub document: Document,
    buffers: Vec<Vec<u8>>,
}

impl GltfFile {
    /// Takes apart the `bytes` of a file that lies at `path`. Files beside it are read by plain name
    /// only.
    ///
    /// # Errors
    /// It is no glTF, or what it refers to cannot be read or is too large.
    pub fn open(bytes: &[u8], path: &Path) -> Result<Self, ImportError> {
        let Gltf { document, blob } = Gltf::from_slice(bytes).map_err(ImportError::bad_format)?;
        let mut buffers = Vec::new();
        let mut in_all = 0;
        for buffer in document.buffers() {
            let data = match buffer.source() {
                gltf::buffer::Source::Bin => {
                    let blob = blob.as_deref();
                    blob.ok_or_else(|| bad("its binary part is missing"))?
                        .to_vec()
                }
                gltf::buffer::Source::Uri(uri) => referred(uri, path, LARGEST_IN_ALL - in_all)?,
            };
            in_all += data.len() as u64;
            if data.len() < buffer.length() || in_all > LARGEST_IN_ALL {
                return Err(bad("a buffer is shorter than it says, or too large"));
            }
            buffers.push(data);
        }
        Ok(Self { document, buffers })
    }

    /// Tuples of `N` floats.
    pub fn floats<const N: usize>(
        &self,
        accessor: &Accessor,
    ) -> Result<Vec<[f64; N]>, ImportError> {
        let numbers = self.numbers(accessor)?;
        if accessor.dimensions().multiplicity() != N {
            return Err(bad("a table in it is of another kind than it must be"));
        }
        let mut tuples = Vec::with_capacity(numbers.len() / N);
        for tuple in numbers.chunks_exact(N) {
            tuples.push(std::array::from_fn(|k| tuple[k]));
        }
        Ok(tuples)
    }

    /// All numbers of a table; whole ones that stand for 0 to 1, or for -1 to 1, as those.
    fn numbers(&self, accessor: &Accessor) -> Result<Vec<f64>, ImportError> {
        let view = accessor.view().filter(|_| accessor.sparse().is_none());
        let view = view.ok_or_else(|| bad("it uses sparse or empty tables"))?;
        let (scalar, parts) = (
            accessor.data_type().size(),
            accessor.dimensions().multiplicity(),
        );
        // Columns of small matrices are filled up.
        if is_small_matrix(accessor) {
            return Err(bad("a table in it is of another kind than it must be"));
        }
        let size = scalar * parts;
        let stride = view.stride().unwrap_or(size);
        let buffer = &self.buffers[view.buffer().index()];
        let end = view.offset().saturating_add(view.length());
        let bytes = buffer.get(view.offset()..end).ok_or_else(|| bad(CUT_OFF))?;
        // A small file may say that it holds any number.
        let last = accessor.count().saturating_sub(1).checked_mul(stride);
        let needed = last.and_then(|last| last.checked_add(accessor.offset())?.checked_add(size));
        if stride < size || needed.is_none_or(|needed| needed > bytes.len()) {
            return Err(bad(CUT_OFF));
        }
        let mut numbers = Vec::with_capacity(accessor.count() * parts);
        for k in 0..accessor.count() {
            let row = &bytes[accessor.offset() + k * stride..][..size];
            for own in row.chunks_exact(scalar) {
                numbers.push(number(own, accessor.data_type(), accessor.normalized()));
            }
        }
        Ok(numbers)
    }
}

pub(super) fn bad(what: &str) -> ImportError {
    ImportError::bad_format(what)
}

fn is_small_matrix(accessor: &Accessor) -> bool {
    let is_matrix = matches!(accessor.dimensions(), Dimensions::Mat2 | Dimensions::Mat3);
    is_matrix && accessor.data_type().size() < 4
}

/// A number, the lowest byte first.
fn number(bytes: &[u8], kind: DataType, normalised: bool) -> f64 {
    let mut all = [0; 4];
    all[..bytes.len().min(4)].copy_from_slice(&bytes[..bytes.len().min(4)]);
    let [a, b, ..] = all;
    let (value, most) = match kind {
        DataType::I8 => (f64::from(i8::from_le_bytes([a])), f64::from(i8::MAX)),
        DataType::U8 => (f64::from(a), f64::from(u8::MAX)),
        DataType::I16 => (f64::from(i16::from_le_bytes([a, b])), f64::from(i16::MAX)),
        DataType::U16 => (f64::from(u16::from_le_bytes([a, b])), f64::from(u16::MAX)),
        DataType::U32 => (f64::from(u32::from_le_bytes(all)), f64::from(u32::MAX)),
        DataType::F32 => return f64::from(f32::from_le_bytes(all)),
    };
    if normalised {
        (value / most).max(-1.0)
    } else {
        value
    }
}

/// What a URI refers to: data in the file, or a file beside it of at most `most` bytes.
fn referred(uri: &str, path: &Path, most: u64) -> Result<Vec<u8>, ImportError> {
    if uri.starts_with("data:") {
        let data = gltf::buffer::Data::from_source(gltf::buffer::Source::Uri(uri), None);
        return data.map(|data| data.0).map_err(ImportError::bad_format);
    }
    // Nobody's other files are read because a model from somewhere says so.
    let beside = path.with_file_name(uri);
    let is_name = !uri.contains(['/', '\\', ':', '%']) && !uri.starts_with('.');
    if !is_name || std::fs::metadata(&beside).is_ok_and(|m| !m.is_file()) {
        return Err(bad("it refers to something that is not a file beside it"));
    }
    read_bounded(&beside, most).map_err(|e| bad(&format!("{uri} beside it cannot be read ({e})")))
}
