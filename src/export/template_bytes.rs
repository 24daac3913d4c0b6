//! The bytes of a leaf template: of its file, and of what that refers to.

use super::template_error::{LARGEST, TemplateError};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// All that a template is put together from, at most, bytes: a file may name its own data any
/// number of times.
const LARGEST_IN_ALL: u64 = 3 * LARGEST;

const NOT_BESIDE: &str = "it refers to something that is not a file beside it";

/// What has been taken for one template.
pub(super) struct Taken<'a> {
    path: &'a Path,
    bytes: u64,
}

impl<'a> Taken<'a> {
    /// The file itself, and the account of what else it takes.
    ///
    /// # Errors
    /// It cannot be read or is too large.
    pub fn file(path: &'a Path) -> Result<(Self, Vec<u8>), TemplateError> {
        let bytes = bounded(path)?;
        Ok((
            Self {
                path,
                bytes: bytes.len() as u64,
            },
            bytes,
        ))
    }

    /// Notes `bytes` more of the template's own data.
    ///
    /// # Errors
    /// They are more than a template may have.
    pub fn more(&mut self, bytes: usize) -> Result<(), TemplateError> {
        self.bytes = self.bytes.saturating_add(bytes as u64);
        if self.bytes > LARGEST_IN_ALL {
            return Err(TemplateError::TooLarge {
                path: self.path.into(),
            });
        }
        Ok(())
    }

    fn no_gltf(&self, what: impl Into<String>) -> TemplateError {
        TemplateError::NoGltf {
            path: self.path.into(),
            what: what.into(),
        }
    }

    /// What a URI in the file refers to: data in it, or a file beside it.
    ///
    /// # Errors
    /// It is neither, cannot be read, or is too large.
    pub fn referred(&mut self, uri: &str) -> Result<Vec<u8>, TemplateError> {
        let bytes = if uri.starts_with("data:") {
            let data = gltf::buffer::Data::from_source(gltf::buffer::Source::Uri(uri), None);
            data.map(|d| d.0)
                .map_err(|e| self.no_gltf(format!("data in it cannot be read ({e})")))?
        } else if uri.contains(['/', '\\', ':', '%']) || uri.starts_with('.') {
            // Nobody's other files are read because a leaf from somewhere says so.
            return Err(self.no_gltf(NOT_BESIDE));
        } else {
            let beside: PathBuf = self.path.with_file_name(uri);
            // A pipe beside it would be waited for.
            if std::fs::metadata(&beside).is_ok_and(|m| !m.is_file()) {
                return Err(self.no_gltf(NOT_BESIDE));
            }
            bounded(&beside)?
        };
        self.more(bytes.len())?;
        Ok(bytes)
    }
}

fn bounded(path: &Path) -> Result<Vec<u8>, TemplateError> {
    let mut bytes = Vec::new();
    // A device or a pipe says that it holds nothing, and never ends.
    let read = File::open(path).and_then(|f| f.take(LARGEST + 1).read_to_end(&mut bytes));
    read.map_err(|source| TemplateError::Unreadable {
        path: path.into(),
        source,
    })?;
    if bytes.len() as u64 > LARGEST {
        return Err(TemplateError::TooLarge { path: path.into() });
    }
    Ok(bytes)
}
