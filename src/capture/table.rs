//! A CSV file row by row, its cells by the names of their columns: later versions may add columns.

use super::CaptureError;
use crate::model::FARTHEST_PX;
use csv::{ErrorKind, Position, Reader, ReaderBuilder, StringRecord};
use nalgebra::Point3;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// One table of a capture.
pub(super) struct Table<const N: usize> {
    file: PathBuf,
    reader: Reader<File>,
    columns: [usize; N],
    row: StringRecord,
}

impl<const N: usize> Table<N> {
    /// Opens the table `name` of the capture `dir`, which must have `columns`.
    ///
    /// # Errors
    /// The file is not there, cannot be read, or lacks a column.
    pub fn open(dir: &Path, name: &'static str, columns: [&str; N]) -> Result<Self, CaptureError> {
        let file = dir.join(name);
        let opened = File::open(&file).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => CaptureError::Missing {
                dir: dir.to_owned(),
                file: name,
            },
            _ => CaptureError::Unreadable {
                file: file.clone(),
                source,
            },
        })?;
        // Rows of another length are told by us, with their line.
        let mut reader = ReaderBuilder::new().flexible(true).from_reader(opened);
        let header = reader.headers().map_err(|e| explain(&file, e))?.clone();
        let mut at = [0; N];
        for (at, name) in at.iter_mut().zip(columns) {
            let found = header.iter().position(|c| c == name);
            *at = found.ok_or_else(|| {
                CaptureError::row(&file, 1, format!("the column {name} is missing"))
            })?;
        }
        Ok(Self {
            file,
            reader,
            columns: at,
            row: StringRecord::new(),
        })
    }

    /// Place of a column that need not be there.
    pub fn place(&mut self, name: &str) -> Option<usize> {
        self.reader.headers().ok()?.iter().position(|c| c == name)
    }

    /// Takes the next row; `false` at the end.
    ///
    /// # Errors
    /// The file cannot be read, or is no text there.
    pub fn next(&mut self) -> Result<bool, CaptureError> {
        self.reader
            .read_record(&mut self.row)
            .map_err(|e| explain(&self.file, e))
    }

    /// The cell of the `i`-th column that was asked for; empty where the row is too short.
    pub fn cell(&self, i: usize) -> &str {
        self.row.get(self.columns[i]).unwrap_or("")
    }

    /// The number in a cell of the present row, at its place in the file.
    pub fn at(&self, place: usize) -> &str {
        self.row.get(place).unwrap_or("")
    }

    /// A whole number, in the `i`-th column that was asked for.
    ///
    /// # Errors
    /// The cell holds none.
    pub fn whole<T: std::str::FromStr>(&self, i: usize, name: &str) -> Result<T, CaptureError> {
        self.cell(i).parse().map_err(|_| {
            self.bad(format!(
                "{name} is {:?}, and must be a whole number",
                self.cell(i)
            ))
        })
    }

    /// A number that is neither infinite nor none.
    ///
    /// # Errors
    /// The cell holds none.
    pub fn number(&self, i: usize, name: &str) -> Result<f64, CaptureError> {
        let number = self
            .cell(i)
            .parse()
            .ok()
            .filter(|x: &f64| x.is_finite() && x.abs() < 1e12);
        number.ok_or_else(|| {
            self.bad(format!(
                "{name} is {:?}, and must be a number",
                self.cell(i)
            ))
        })
    }

    /// A length of the model in pixels, `px` of them to the file's unit.
    ///
    /// # Errors
    /// The cell holds no number, or one that no tree reaches.
    pub fn length_px(&self, i: usize, name: &str, px: f64) -> Result<f64, CaptureError> {
        let length_px = self.number(i, name)? * px;
        if length_px.abs() <= FARTHEST_PX {
            return Ok(length_px);
        }
        Err(self.bad(format!(
            "{name} is {:?}, which is {length_px:.0} px; no tree is so large",
            self.cell(i)
        )))
    }

    /// A place in model axes, px, from the columns of its x, y and z.
    ///
    /// # Errors
    /// As of [`Table::length_px`].
    pub fn place_px(&self, [x, y, z]: [usize; 3], px: f64) -> Result<Point3<f64>, CaptureError> {
        Ok(Point3::new(
            self.length_px(x, "x", px)?,
            self.length_px(y, "y", px)?,
            self.length_px(z, "z", px)?,
        ))
    }

    /// What is wrong with the present row.
    pub fn bad(&self, what: impl Into<String>) -> CaptureError {
        CaptureError::row(
            &self.file,
            self.row.position().map_or(0, Position::line),
            what,
        )
    }

    /// What is wrong with the file at its end.
    pub fn bad_end(&self, what: impl Into<String>) -> CaptureError {
        CaptureError::row(&self.file, self.reader.position().line(), what)
    }
}

fn explain(file: &Path, e: csv::Error) -> CaptureError {
    let line = e.position().map_or(1, Position::line);
    match e.into_kind() {
        ErrorKind::Io(source) => CaptureError::Unreadable {
            file: file.to_owned(),
            source,
        },
        ErrorKind::Utf8 { .. } => CaptureError::row(file, line, "it is no text"),
        other => CaptureError::row(file, line, format!("{other:?}")),
    }
}
