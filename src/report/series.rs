//! Angles over time and their spectra as tidy tables (CSV), after Hu et al. (figs. 6 and 7): a row for each branch
//! and moment, or frequency.

use super::study::Study;
use super::tidy::{BRANCH_COLUMNS, push_name};
use crate::document::TableWriter;
use crate::files::WriteError;

/// The angle of every branch to the one that carries it in every frame, less its mean: `angle_deg` in the picture's
/// plane, `angle_in_space_deg` by eq. 1 of Hu et al.; and how far its end is from its place at rest, px of the picture
/// to the right and up. What is not known is an empty cell; a capture without poses has no rows.
///
/// # Errors
/// Memory cannot be had.
pub fn angles_csv(studies: &[Study]) -> Result<Vec<u8>, WriteError> {
    let header =
        format!("capture,{BRANCH_COLUMNS},time_s,angle_deg,angle_in_space_deg,right_px,up_px");
    let mut table = TableWriter::new("the table of angles", &header, Vec::new())?;
    for study in studies {
        for branch in &study.branches {
            for (k, time_s) in branch.times_s.iter().enumerate() {
                table.text(&study.name);
                push_name(&mut table, branch);
                table.number(*time_s, 6);
                for series in [&branch.plane_deg, &branch.space_deg] {
                    table.number(series.get(k).copied().unwrap_or(f64::NAN), 5);
                }
                let way_px = branch.way_px.get(k);
                for axis in 0..2 {
                    table.number(way_px.map_or(f64::NAN, |way| way[axis]), 4);
                }
                table.end_row()?;
            }
        }
    }
    table.finish()
}

/// The amplitude spectrum of the angle in the picture's plane of every branch, of the part of the film that its answer
/// is of. Branches without a spectrum have no rows.
///
/// # Errors
/// Memory cannot be had.
pub fn spectra_csv(studies: &[Study]) -> Result<Vec<u8>, WriteError> {
    let header = format!("capture,{BRANCH_COLUMNS},frequency_hz,amplitude_deg");
    let mut table = TableWriter::new("the table of spectra", &header, Vec::new())?;
    for study in studies {
        for branch in &study.branches {
            let Some(spectrum) = &branch.spectrum else {
                continue;
            };
            for (k, amplitude_deg) in spectrum.amplitude.iter().enumerate() {
                table.text(&study.name);
                push_name(&mut table, branch);
                table.number(k as f64 * spectrum.bin_hz, 5);
                table.number(*amplitude_deg, 6);
                table.end_row()?;
            }
        }
    }
    table.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::Spectrum;
    use crate::report::tests::{TREE, study};
    use nalgebra::Vector2;

    /// Of two branches the second has two angles, one of them not seen, and a spectrum of two bins.
    fn swaying() -> Study {
        let mut study = study(&TREE[..2]);
        study.name = "oak".to_owned();
        let branch = &mut study.branches[1];
        branch.piece = "limb_1".to_owned();
        branch.times_s = vec![0.0, 0.1];
        branch.plane_deg = vec![1.5, f64::NAN];
        branch.space_deg = vec![-2.5, f64::NAN];
        branch.way_px = vec![Vector2::new(3.0, -4.0), Vector2::new(f64::NAN, f64::NAN)];
        branch.spectrum = Some(Spectrum {
            bin_hz: 0.25,
            amplitude: vec![0.0, 0.75],
        });
        study
    }

    fn text(bytes: Result<Vec<u8>, WriteError>) -> String {
        String::from_utf8(bytes.expect("a table")).expect("text")
    }

    #[test]
    fn every_angle_is_a_row_and_what_was_not_seen_is_empty() {
        let table = text(angles_csv(&[swaying()]));
        let rows: Vec<&str> = table.lines().skip(1).collect();
        assert_eq!(
            rows,
            ["oak,2,limb_1,1,0,1.5,-2.5,3,-4", "oak,2,limb_1,1,0.1,,,,"]
        );
    }

    #[test]
    fn every_bin_is_a_row() {
        let table = text(spectra_csv(&[swaying()]));
        let rows: Vec<&str> = table.lines().skip(1).collect();
        assert_eq!(rows, ["oak,2,limb_1,1,0,0", "oak,2,limb_1,1,0.25,0.75"]);
    }
}
