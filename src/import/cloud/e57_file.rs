//! E57.

use super::{Points, Units, refuse_many};
use crate::caught::caught;
use crate::import::error::ImportError;
use e57::{CartesianCoordinate, E57Reader};
use std::io::{BufRead, Read, Seek, SeekFrom};

/// Bytes of the file's header, and the largest page that is read.
const HEADER: u64 = 48;
const LARGEST_PAGE: u64 = 1 << 20;

/// Reads the points of all scans in the file's common axes. Points that a scan marks as invalid are
/// left out.
///
/// # Errors
/// It is damaged, a checksum does not fit, or it has too many points.
pub(super) fn read<R: BufRead + Seek>(
    mut input: R,
    points: &mut Points,
) -> Result<(), ImportError> {
    check_header(&mut input)?;
    let read = caught(|| read_scans(input, points));
    read.unwrap_or_else(|| Err(ImportError::bad_format("its scans are damaged")))
}

/// The reader makes room for as much as the header says.
fn check_header(input: &mut (impl Read + Seek)) -> Result<(), ImportError> {
    let unreadable = |e: std::io::Error| ImportError::unreadable(&e);
    let end = input.seek(SeekFrom::End(0)).map_err(unreadable)?;
    input.seek(SeekFrom::Start(0)).map_err(unreadable)?;
    let mut header = [0; HEADER as usize];
    input.read_exact(&mut header).map_err(unreadable)?;
    input.seek(SeekFrom::Start(0)).map_err(unreadable)?;
    let number = |at: usize| {
        header[at..at + 8]
            .iter()
            .rev()
            .fold(0, |sum, byte| (sum << 8) | u64::from(*byte))
    };
    let [xml_length, page] = [number(32), number(40)];
    if xml_length > end || !(1..=LARGEST_PAGE).contains(&page) {
        return Err(ImportError::bad_format(
            "its header says more than the file holds",
        ));
    }
    Ok(())
}

fn read_scans<R: BufRead + Seek>(input: R, points: &mut Points) -> Result<(), ImportError> {
    let mut file = E57Reader::new(input).map_err(damaged)?;
    // Its lengths are metres (ASTM E2807).
    if !points.unit_is_given {
        points.take_units(Units::METRES);
    }
    let scans = file.pointclouds();
    for scan in &scans {
        refuse_many(scan.records)?;
        let mut reader = file.pointcloud_simple(scan).map_err(damaged)?;
        reader.spherical_to_cartesian(true);
        reader.apply_pose(true);
        for point in reader {
            let point = point.map_err(damaged)?;
            if let CartesianCoordinate::Valid { x, y, z } = point.cartesian {
                points.push(x, y, z)?;
            }
        }
    }
    Ok(())
}

/// What the reader found. It names bytes and pages where a checksum does not fit, which say nothing to a user.
fn damaged(e: e57::Error) -> ImportError {
    match e.to_string().contains("checksum") {
        true => ImportError::bad_format("a checksum in it does not fit its bytes"),
        false => ImportError::bad_format(e),
    }
}
