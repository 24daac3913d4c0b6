//! LAS and LAZ.

use super::{Points, refuse_many};
use crate::caught::caught;
use crate::import::error::ImportError;
use las::Reader;
use std::io::{BufRead, Read, Seek, SeekFrom};

/// A byte holds no more compressed points than that: equal points take an eighth of a bit each.
const MOST_POINTS_OF_BYTE: u64 = 64;
/// Points that are read at a time.
const PIECE: u64 = 65_536;
/// Where the header of LAS 1.4 has the place of its first extended record, how long the head of such
/// a record is, and where in it its length is.
const EVLR_AT: usize = 235;
const HEADER_1_4: usize = 375;
const EVLR_HEAD: u64 = 60;
const EVLR_LENGTH_AT: u64 = 20;
/// Records on the coordinate system, and the keys and values of units in them (GeoTIFF
/// 1.0 sect. 6.3.1.3).
const GEO_KEYS: u16 = 34735;
const WKT: u16 = 2112;
const LINEAR_UNITS: u16 = 3076;
const FOOT_M: f64 = 0.3048;
const US_FOOT_M: f64 = 1200.0 / 3937.0;

/// Reads all points. What the header says of their extent is not looked at: it is often wrong.
///
/// # Errors
/// It is damaged or cut off, or has too many points.
pub(super) fn read<R>(mut input: R, points: &mut Points) -> Result<(), ImportError>
where
    R: BufRead + Seek + Send + Sync + 'static,
{
    let size = check_extended_records(&mut input).map_err(|e| ImportError::unreadable(&e))?;
    // The decompressor panics on some damaged files.
    let read = caught(move || {
        let mut own = Points {
            unit_m: points.unit_m,
            unit_is_given: points.unit_is_given,
            read: Default::default(),
        };
        let done = read_points(input, size, &mut own);
        points.read = own.read;
        done
    });
    read.unwrap_or_else(|| Err(ImportError::bad_format("its compressed points are damaged")))
}

/// An extended record is read at once, be it as long as it says. Returns the size of the file,
/// bytes.
fn check_extended_records(input: &mut (impl Read + Seek)) -> std::io::Result<u64> {
    let end = input.seek(SeekFrom::End(0))?;
    input.seek(SeekFrom::Start(0))?;
    let mut header = Vec::new();
    input.take(HEADER_1_4 as u64).read_to_end(&mut header)?;
    let is_1_4 = header.len() == HEADER_1_4 && (header[24], header[25]) >= (1, 4);
    if is_1_4 && number(&header[EVLR_AT + 8..EVLR_AT + 12]) > 0 {
        let start = number(&header[EVLR_AT..EVLR_AT + 8]);
        let mut length = [0; 8];
        let cut_off = std::io::Error::from(std::io::ErrorKind::UnexpectedEof);
        input.seek(SeekFrom::Start(
            start.min(end).saturating_add(EVLR_LENGTH_AT),
        ))?;
        input.read_exact(&mut length)?;
        if start
            .saturating_add(EVLR_HEAD)
            .saturating_add(number(&length))
            > end
        {
            return Err(cut_off);
        }
    }
    input.seek(SeekFrom::Start(0))?;
    Ok(end)
}

/// The number in bytes, the lowest first.
fn number(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .rev()
        .fold(0, |sum, byte| (sum << 8) | u64::from(*byte))
}

fn read_points<R>(input: R, size: u64, points: &mut Points) -> Result<(), ImportError>
where
    R: BufRead + Seek + Send + Sync + 'static,
{
    let mut reader = Reader::new(input).map_err(damaged)?;
    let said = reader.header().number_of_points();
    refuse_many(said)?;
    // The decompressor goes on behind the end of the file.
    if said > MOST_POINTS_OF_BYTE * size {
        return Err(ImportError::bad_format(format!(
            "its header says {said} points, and the file has {size} bytes"
        )));
    }
    let records = reader.header().all_vlrs();
    if let Some(unit_m) = records.filter_map(|r| unit_of(r.record_id, &r.data)).next() {
        points.take_unit(unit_m);
    }
    let mut read = 0;
    while read < said {
        let piece = reader
            .read_points(PIECE.min(said - read))
            .map_err(damaged)?;
        if piece.is_empty() {
            break;
        }
        for ((x, y), z) in piece.x().zip(piece.y()).zip(piece.z()) {
            points.push(x, y, z)?;
        }
        read += piece.len() as u64;
    }
    if read < said {
        return Err(ImportError::bad_format(format!(
            "its header says {said} points, and it holds {read}"
        )));
    }
    Ok(())
}

fn damaged(e: las::Error) -> ImportError {
    match &e {
        las::Error::Io(io) => ImportError::unreadable(io),
        _ => ImportError::bad_format(e),
    }
}

/// The length of the unit of horizontal coordinates that a record names, m, if it is no metre.
fn unit_of(record: u16, data: &[u8]) -> Option<f64> {
    match record {
        GEO_KEYS => {
            let numbers: Vec<u64> = data.chunks_exact(2).map(number).collect();
            let key = numbers
                .get(4..)?
                .chunks_exact(4)
                .find(|key| key[0] == u64::from(LINEAR_UNITS))?;
            match key[3] {
                9002 => Some(FOOT_M),
                9003 => Some(US_FOOT_M),
                _ => None,
            }
        }
        WKT => {
            let text = String::from_utf8_lossy(data).to_lowercase();
            let names = [
                "unit[\"us survey foot",
                "unit[\"us survey feet",
                "unit[\"foot_us",
            ];
            if names.iter().any(|name| text.contains(name)) {
                Some(US_FOOT_M)
            } else {
                text.contains("unit[\"foot").then_some(FOOT_M)
            }
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_from_keys_and_text() {
        let keys: Vec<u8> = [1, 1, 0, 1, LINEAR_UNITS, 0, 1, 9003]
            .iter()
            .flat_map(|n: &u16| n.to_le_bytes())
            .collect();
        assert_eq!(unit_of(GEO_KEYS, &keys), Some(US_FOOT_M));
        assert_eq!(
            unit_of(WKT, b"PROJCS[\"x\",UNIT[\"foot\",0.3048]]"),
            Some(FOOT_M)
        );
        assert_eq!(unit_of(WKT, b"PROJCS[\"x\",UNIT[\"metre\",1]]"), None);
        assert_eq!(unit_of(7, &keys), None);
        assert_eq!(unit_of(GEO_KEYS, &keys[..5]), None);
    }
}
