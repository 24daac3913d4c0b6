//! `arborcam calibrate INPUT --squares 9x6 --out PROFILE`: a lens by a chessboard.

use super::command_error::CommandError;
use super::output::eprint_line;
use super::stop::Stop;
use crate::calibrate::{Board, BoardViews, Calibration, calibrate, find_board};
use crate::config::Config;
use crate::export::lens_profile::lens_profile;
use crate::files::{OutputFile, check_place};
use crate::model::{Luma, Size};
use crate::source::{self, DecodeError, Decoder, Source};
use anyhow::{Context, anyhow};
use clap::Args;
use std::path::PathBuf;

/// Squares along each side of a board.
const SQUARES: std::ops::RangeInclusive<usize> = 3..=40;
/// The board is looked for so often in a film: it is held before the camera for seconds.
const LOOKS_PER_S: f64 = 4.0;
/// Corners of a flat board in sharp pictures are off by some tenths of a pixel.
const LARGE_RMS_PX: f64 = 1.0;

#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// A film (.mcap .mkv .avi .mp4) or a folder of pictures (.png .jpg .bmp) in which a flat chessboard
    /// is shown at many places and slants.
    input: PathBuf,
    /// Squares of the board, across and down, e.g. 10x7.
    #[arg(long, value_name = "CxR", value_parser = parse_squares)]
    squares: Board,
    /// Profile to write (.json). It must not exist.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Settings that differ from the defaults (TOML; see config/arborcam.toml).
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

/// Parses `--squares`: corners are where four squares meet.
fn parse_squares(text: &str) -> Result<Board, String> {
    let sides = text.split_once('x').and_then(|(across, down)| {
        let [across, down] = [across, down].map(|side| side.trim().parse::<usize>().ok());
        Some(Board {
            columns: across.filter(|n| SQUARES.contains(n))? - 1,
            rows: down.filter(|n| SQUARES.contains(n))? - 1,
        })
    });
    sides.ok_or_else(|| "give the squares across and down, 3 to 40, like 10x7".into())
}

pub fn run(args: &CalibrateArgs) -> Result<(), CommandError> {
    check_place(&args.out)?;
    let stop = Stop::on_signals()?;
    let config = Config::default().layered(args.config.as_deref(), |_| ())?;
    // Each picture of a folder is looked at.
    let source = source::open(&args.input, &config, Some(LOOKS_PER_S));
    let mut source = source.map_err(CommandError::no_input)?;
    let seen = see(source.as_mut(), args.squares)?;
    let calibration = calibrate(args.squares, &seen.views, seen.size)
        .with_context(|| args.input.display().to_string())
        .map_err(CommandError::Failed)?;
    let name = args.out.file_stem().unwrap_or_default().to_string_lossy();
    let file = OutputFile::create(&args.out)?;
    file.write(&lens_profile(&name, &calibration), stop.while_writing())?;
    file.publish()?;
    print_summary(args, &seen, &calibration);
    Ok(())
}

/// What an input shows of the board.
struct Seen {
    views: BoardViews,
    /// Pictures that were looked at, and their size.
    pictures: u64,
    size: Size,
}

/// Looks for the board in pictures of a source, some a second.
///
/// # Errors
/// It cannot be read to its end.
fn see(source: &mut dyn Source, board: Board) -> Result<Seen, CommandError> {
    let mut decoder = Decoder::new().map_err(CommandError::failed)?;
    let mut seen = Seen {
        views: BoardViews::default(),
        pictures: 0,
        size: Size::new(0, 0),
    };
    let mut next_s = f64::NEG_INFINITY;
    let mut luma = Luma {
        size: Size::new(0, 0),
        pixels: Vec::new(),
    };
    while let Some(raw) = source.next_frame().map_err(CommandError::no_input)? {
        // Half a millisecond for times that were rounded.
        if raw.sensor_time_s < next_s - 5e-4 {
            continue;
        }
        next_s = raw.sensor_time_s + 1.0 / LOOKS_PER_S;
        match decoder.luma(&raw, &mut luma) {
            Ok(()) => {}
            // A lens is for one size.
            Err(e @ DecodeError::SizeChanged { .. }) => {
                return Err(CommandError::NoInput(anyhow!(
                    "{}: {e}; give pictures of one size",
                    source.describe().name
                )));
            }
            // A damaged picture of a film is one of many.
            Err(_) => continue,
        }
        seen.pictures += 1;
        seen.size = luma.size;
        if let Some(view) = find_board(&luma, board) {
            seen.views.push(view, luma.size);
        }
    }
    Ok(seen)
}

fn print_summary(args: &CalibrateArgs, seen: &Seen, calibration: &Calibration) {
    let lens = &calibration.lens;
    let [fx, fy, cx, cy, ..] = calibration.deviations;
    let (focal, middle) = (lens.focal_px, lens.middle_px);
    let width_deg = 2.0
        * (0.5 * f64::from(seen.size.width) / focal.x)
            .atan()
            .to_degrees();
    eprint_line(&format!(
        "{}: {} views of {} pictures with the board, of {}; corners are off by {:.2} px",
        args.out.display(),
        calibration.views,
        seen.views.found,
        seen.pictures,
        calibration.rms_px,
    ));
    eprint_line(&format!(
        "focal length {:.1} ± {fx:.1} px across, {:.1} ± {fy:.1} px down ({width_deg:.1} degrees wide); \
         middle {:.1} ± {cx:.1}, {:.1} ± {cy:.1} px (standard deviations)",
        focal.x, focal.y, middle.x, middle.y
    ));
    if calibration.rms_px > LARGE_RMS_PX {
        eprint_line(&format!(
            "arborcam: warning: corners are off by more than {LARGE_RMS_PX} px; is the board flat, and were \
             camera and board held still?"
        ));
    }
}
