//! CSV files row by row: one writer and one reader for all tables of a document.
//!
//! Times are seconds with up to 6 decimals, pixels up to 3, lengths in the model up to 4. Unknown
//! is an empty cell.

use super::error::DocumentError;
use super::number;
use crate::files::{TableFault, WriteError};
use crate::model::{FARTHEST_PX, NodeName};
use csv::{ErrorKind, Position, Reader, StringRecord};
use nalgebra::Point3;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Decimals of a time in seconds.
pub(super) const TIME_DECIMALS: usize = 6;

/// One CSV file while it is written: a row is put together cell by cell.
pub struct TableWriter<W: Write> {
    what: &'static str,
    out: csv::Writer<W>,
    row: csv::StringRecord,
    cell: String,
    /// Size of the file so far, for the message that the disk is full.
    bytes: u64,
}

impl<W: Write> TableWriter<W> {
    /// # Errors
    /// The header cannot be written.
    pub fn new(what: &'static str, header: &str, out: W) -> Result<Self, WriteError> {
        let out = csv::Writer::from_writer(out);
        let mut table = Self {
            what,
            out,
            row: csv::StringRecord::new(),
            cell: String::new(),
            bytes: 0,
        };
        header
            .split(',')
            .for_each(|name| table.row.push_field(name));
        table.end_row()?;
        Ok(table)
    }

    /// A number with at most so many decimals; empty for what is none.
    pub fn number(&mut self, x: f64, decimals: usize) {
        self.cell.clear();
        number::push(&mut self.cell, x, decimals);
        self.row.push_field(&self.cell);
    }

    /// A whole number.
    pub fn count(&mut self, n: impl Into<u64>) {
        use std::fmt::Write;
        self.cell.clear();
        let _ = write!(self.cell, "{}", n.into());
        self.row.push_field(&self.cell);
    }

    /// Words.
    pub fn text(&mut self, text: &str) {
        self.row.push_field(text);
    }

    /// The number of a node; empty for none.
    pub fn id(&mut self, id: Option<NodeName>) {
        match id {
            Some(id) => self.count(id.0),
            None => self.row.push_field(""),
        }
    }

    /// Ends the row.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn end_row(&mut self) -> Result<(), WriteError> {
        self.bytes += (self.row.as_slice().len() + self.row.len()) as u64;
        let written = self.out.write_record(&self.row);
        self.row.clear();
        written.map_err(|e| match e.into_kind() {
            csv::ErrorKind::Io(e) => WriteError::from_io(self.what, self.bytes, e),
            other => WriteError::Io {
                what: self.what.into(),
                source: std::io::Error::other(format!("{other:?}")),
            },
        })
    }

    /// Ends the file and gives the writer back; without this, errors of the last rows would be
    /// lost.
    ///
    /// # Errors
    /// The last rows cannot be written.
    pub fn finish(mut self) -> Result<W, WriteError> {
        let (what, bytes) = (self.what, self.bytes);
        self.out
            .flush()
            .map_err(|e| WriteError::from_io(what, bytes, e))?;
        self.out
            .into_inner()
            .map_err(|e| WriteError::from_io(what, bytes, std::io::Error::other(e.to_string())))
    }
}

/// Length of a pixel in the file's unit, and how many decimals more it takes to say as much in that
/// unit.
pub fn unit(metres_per_px: f64) -> (f64, usize) {
    if metres_per_px > 0.0 {
        (
            metres_per_px,
            (-metres_per_px.log10()).ceil().clamp(0.0, 12.0) as usize,
        )
    } else {
        (1.0, 0)
    }
}

/// Pixels in the unit of a file whose pixel is `metres_per_px` long; 1 where it is in pixels.
pub(super) fn px_in_unit(metres_per_px: f64) -> f64 {
    if metres_per_px > 0.0 {
        1.0 / metres_per_px
    } else {
        1.0
    }
}

/// One table, read row by row; its cells are found by the names of their columns, so that others
/// may be added to the file.
pub(super) struct TableReader<R: Read, const N: usize> {
    file: PathBuf,
    reader: Reader<R>,
    header: StringRecord,
    columns: [usize; N],
    row: StringRecord,
}

impl<const N: usize> TableReader<File, N> {
    /// Opens the table `name` of the document in `dir`, which must have `columns`.
    ///
    /// # Errors
    /// The file is not there, cannot be read, or lacks a column.
    pub fn open(dir: &Path, name: &'static str, columns: [&str; N]) -> Result<Self, DocumentError> {
        let file = dir.join(name);
        match File::open(&file) {
            Ok(opened) => Self::new(file, opened, columns),
            Err(source) if source.kind() == io::ErrorKind::NotFound => {
                Err(DocumentError::Missing {
                    dir: dir.to_owned(),
                    file: name,
                })
            }
            Err(source) => Err(DocumentError::Unreadable { file, source }),
        }
    }
}

impl<R: Read, const N: usize> TableReader<R, N> {
    /// A table over any reader; messages call it `file`.
    ///
    /// # Errors
    /// It cannot be read, or lacks a column.
    pub fn new(file: PathBuf, from: R, columns: [&str; N]) -> Result<Self, DocumentError> {
        let mut reader = Reader::from_reader(from);
        let header = reader.headers().map_err(|e| explain(&file, e))?.clone();
        let mut places = [0; N];
        for (place, name) in places.iter_mut().zip(columns) {
            let found = header.iter().position(|column| column == name);
            *place = found.ok_or_else(|| {
                DocumentError::row(&file, 1, format!("the column {name} is missing"))
            })?;
        }
        Ok(Self {
            file,
            reader,
            header,
            columns: places,
            row: StringRecord::new(),
        })
    }

    /// Takes the next row; `false` at the end.
    ///
    /// # Errors
    /// The file cannot be read, or is no text there, or the row has not as many cells as the first line, as where the
    /// file was cut off.
    pub fn next(&mut self) -> Result<bool, DocumentError> {
        let read = self.reader.read_record(&mut self.row);
        read.map_err(|e| explain(&self.file, e))
    }

    /// The cell of the `i`-th column that was asked for.
    pub fn cell(&self, i: usize) -> &str {
        self.row.get(self.columns[i]).unwrap_or("")
    }

    /// Where the column `name` is, which a file may lack.
    pub fn optional(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|column| column == name)
    }

    /// The cell of an [`optional`](Self::optional) column; empty where the file lacks it.
    pub fn optional_cell(&self, column: Option<usize>) -> &str {
        column.and_then(|c| self.row.get(c)).unwrap_or("")
    }

    /// A whole number, in the `i`-th column that was asked for.
    ///
    /// # Errors
    /// The cell holds none.
    pub fn whole<T: std::str::FromStr>(&self, i: usize, name: &str) -> Result<T, DocumentError> {
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
    pub fn number(&self, i: usize, name: &str) -> Result<f64, DocumentError> {
        let number = self
            .cell(i)
            .parse()
            .ok()
            .filter(|x: &f64| x.is_finite() && x.abs() < 1e12);
        number.ok_or_else(|| self.bad(number::no_number(self.cell(i), name)))
    }

    /// A place in the picture along one axis, px, that may be unknown, see [`number::known`].
    ///
    /// # Errors
    /// The cell holds words, or a place that no picture has.
    pub fn known_px(&self, i: usize, name: &str) -> Result<Option<f64>, DocumentError> {
        let known = number::known(self.cell(i), name).map_err(|what| self.bad(what))?;
        match known.filter(|px| px.abs() > FARTHEST_PX) {
            Some(px) => Err(self.bad(format!("{name} is {px}; no picture is so large"))),
            None => Ok(known),
        }
    }

    /// The same of an [`optional`](Self::optional) column; unknown where the file lacks it.
    ///
    /// # Errors
    /// The cell holds words.
    pub fn known_optional(
        &self,
        column: Option<usize>,
        name: &str,
    ) -> Result<Option<f64>, DocumentError> {
        number::known(self.optional_cell(column), name).map_err(|what| self.bad(what))
    }

    /// A length of the model in pixels, `px` of them to the file's unit.
    ///
    /// # Errors
    /// The cell holds no number, or one that no tree reaches.
    pub fn length_px(&self, i: usize, name: &str, px: f64) -> Result<f64, DocumentError> {
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
    pub fn place_px(&self, [x, y, z]: [usize; 3], px: f64) -> Result<Point3<f64>, DocumentError> {
        Ok(Point3::new(
            self.length_px(x, "x", px)?,
            self.length_px(y, "y", px)?,
            self.length_px(z, "z", px)?,
        ))
    }

    /// What is wrong with the present row.
    pub fn bad(&self, what: impl Into<String>) -> DocumentError {
        self.bad_at(self.line(), what)
    }

    /// The line of the present row.
    pub fn line(&self) -> u64 {
        self.row.position().map_or(0, Position::line)
    }

    /// What is wrong with the row in a line that has been read.
    pub fn bad_at(&self, line: u64, what: impl Into<String>) -> DocumentError {
        DocumentError::row(&self.file, line, what)
    }

    /// What is wrong with the file at its end.
    pub fn bad_end(&self, what: impl Into<String>) -> DocumentError {
        DocumentError::row(&self.file, self.reader.position().line(), what)
    }
}

fn explain(file: &Path, e: csv::Error) -> DocumentError {
    let TableFault { line, what } = TableFault::from(&e);
    match e.into_kind() {
        ErrorKind::Io(source) => DocumentError::Unreadable {
            file: file.to_owned(),
            source,
        },
        _ => DocumentError::row(file, line, what),
    }
}
