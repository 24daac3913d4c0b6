//! `arborcam animate DIR`: animates the tree of a capture, or the trees of a forest, with a motion that
//! was not filmed.

mod forest;
mod live;
mod options;

pub use options::AnimateArgs;

use super::command_error::CommandError;
use super::hangup::SighupAction;
use super::output::eprint_line;
use super::render::{self, write_error};
use super::signals::stop_on_signals;
use super::stop::Stop;
use super::tree::{Tail, print_warnings};
use crate::animate::{
    Animator, Known, Loudness, Magnify, Wind, magnify, place_to_pull, wind_scale,
};
use crate::document::{DocumentError, ForestDocument, MotionCsv};
use crate::export::gltf::{NamedBytes, glb, gltf_files};
use crate::export::{ExportError, html};
use crate::files::{check_place, write_files};
use crate::model::{NodeId, Pose};
use crate::tui;
use crate::views::{PreparedTree, Shot};
use anyhow::anyhow;
use live::{FilmAnimation, WindAnimation};
use options::Kind;
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::Ordering;

/// Wind that is not looped has a period of this length, s, doubled until it exceeds the length of
/// the animation by at least this length.
const WIND_PERIOD_S: f64 = 128.0;

pub fn run(args: &AnimateArgs) -> Result<(), CommandError> {
    let Some(out) = &args.out else {
        return show_live(args);
    };
    let kind = args
        .check(out)
        .map_err(|why| CommandError::BadUsage(anyhow!(why)))?;
    check_place(out).map_err(write_error)?;
    if kind == Kind::Html {
        html::built_in()?;
    }
    let stop = Stop::on_signals()?;
    if ForestDocument::is_in(&args.dir) {
        return forest::run(args, out, kind, &stop);
    }
    let sound = args.wav.as_deref().map(read_wav).transpose()?;
    let mut tree = prepare_tree(args)?;
    let (poses, what) = match args.magnify {
        Some(factor) => magnify_film(args, &tree, factor)?,
        None => {
            warn_of_guesses(std::slice::from_ref(&tree));
            simulate(args, &tree, sound)?
        }
    };
    tree.animate(poses, args.looped, what);
    write(args, out, kind, &tree, &stop)
}

/// Shows the tree on the terminal until the user leaves.
fn show_live(args: &AnimateArgs) -> Result<(), CommandError> {
    if !std::io::stdout().is_terminal() {
        let why = "there is no terminal to show the tree on; give --out FILE (.glb, .html, .csv, \
                   .mp4 or .png)";
        return Err(CommandError::BadUsage(anyhow!(why)));
    }
    if ForestDocument::is_in(&args.dir) {
        return Err(CommandError::BadUsage(anyhow!(
            "a forest is not shown on the terminal; give --out FILE (.glb, .html, .mp4 or .png)"
        )));
    }
    let sound = args.wav.as_deref().map(read_wav).transpose()?;
    let tree = prepare_tree(args)?;
    let mut moving: Box<dyn tui::Moving> = match args.magnify {
        Some(factor) => {
            let options = magnify_options(args, &tree, factor);
            Box::new(FilmAnimation::new(&tree, options).map_err(CommandError::failed)?)
        }
        None => {
            warn_of_guesses(std::slice::from_ref(&tree));
            let mut animator = animator(&tree, sound, WIND_PERIOD_S);
            animator.warm_up();
            Box::new(WindAnimation::new(&tree, animator))
        }
    };
    let stop = stop_on_signals(SighupAction::ends_this_process(), None)?;
    tui::watch(&mut *moving, tui::Options::from_env(), &stop).map_err(CommandError::bad_usage)?;
    if stop.load(Ordering::SeqCst) {
        Err(CommandError::Stopped)
    } else {
        Ok(())
    }
}

/// Reads and prepares the tree; with `--magnify` its whole film as well, else no poses.
fn prepare_tree(args: &AnimateArgs) -> Result<PreparedTree, CommandError> {
    let tail = match args.magnify {
        Some(_) => Tail::Whole,
        None => Tail::Seconds(0.0),
    };
    let mut tree = args
        .tree
        .prepare(&args.dir, tail, |config| args.set(config))?;
    args.height.set(&mut tree);
    if args.magnify.is_some() && !tree.document.has_motion() {
        return Err(DocumentError::NoFilm {
            dir: args.dir.clone(),
            file: "motion.csv",
        }
        .into());
    }
    print_warnings(&tree);
    Ok(tree)
}

/// Reads the loudness of a WAV file.
fn read_wav(path: &Path) -> Result<Loudness, CommandError> {
    let name = path.display();
    let bytes = std::fs::read(path).map_err(|e| {
        CommandError::BadUsage(anyhow!("cannot read --wav {name}: {e}; give a WAV file"))
    })?;
    Loudness::of_wav(&bytes).map_err(|e| CommandError::BadUsage(anyhow!("--wav {name}: {e}")))
}

/// Magnifies the filmed motion. Returns the poses, and a description for the file.
fn magnify_film(
    args: &AnimateArgs,
    tree: &PreparedTree,
    factor: f64,
) -> Result<(Vec<Pose>, Value), CommandError> {
    let options = magnify_options(args, tree, factor);
    let poses = magnify(
        &tree.skeleton,
        &tree.poses,
        &options,
        args.fps,
        args.count(),
    );
    let what = json!({ "captured": { "times": factor, "speed": args.speed } });
    Ok((poses.map_err(CommandError::failed)?, what))
}

fn magnify_options(args: &AnimateArgs, tree: &PreparedTree, factor: f64) -> Magnify {
    let most_rad = tree.config.wind.max_bend_deg.to_radians();
    Magnify {
        by: factor,
        speed: args.speed,
        band_hz: args.band,
        most_rad,
        looped: args.looped,
    }
}

/// A simulation of the tree at rest, in wind with the period `period_s`.
fn animator(tree: &PreparedTree, sound: Option<Loudness>, period_s: f64) -> Animator {
    let settings = &tree.config.wind;
    let given = tree.config.export.metres_per_px;
    let scale = wind_scale(&tree.skeleton, given, settings);
    let mut wind = Wind::new(settings, period_s, scale);
    if let Some(sound) = sound {
        wind = wind.driven_by(sound);
    }
    let measured: Vec<Known> = tree.sway.iter().map(Known::of).collect();
    Animator::new(tree.skeleton.clone(), &measured, settings, wind)
}

/// Warns once of all `trees` of which no frequency is known.
fn warn_of_guesses(trees: &[PreparedTree]) {
    let guessed = trees
        .iter()
        .filter(|tree| !tree.sway.iter().any(Result::is_ok));
    let guessed: Vec<&PreparedTree> = guessed.collect();
    let Some(first) = guessed.first() else {
        return;
    };
    let which = match trees.len() {
        1 => "the tree has".to_owned(),
        all => format!("{} of {all} trees have", guessed.len()),
    };
    eprint_line(&format!(
        "arborcam: warning: {which} no frequency of any branch; they are taken from thickness and length, the \
         trunk's from wind.trunk_hz ({} Hz)",
        first.config.wind.trunk_hz
    ));
}

/// Simulates the tree in the wind, or pulled and released. Returns the poses, and a description of
/// the simulation for the file.
fn simulate(
    args: &AnimateArgs,
    tree: &PreparedTree,
    sound: Option<Loudness>,
) -> Result<(Vec<Pose>, Value), CommandError> {
    let length_s = args.length_s();
    let period_s = if args.looped {
        length_s
    } else {
        WIND_PERIOD_S * (length_s / WIND_PERIOD_S + 1.0).log2().ceil().exp2()
    };
    let sound = sound.map(|sound| fit_sound(sound, args));
    let mut animator = animator(tree, sound, period_s);
    if args.looped {
        animator.close(length_s, args.fps);
    } else if let Some(lean_deg) = args.pull {
        pull_aside(args, tree, &mut animator, lean_deg)?;
    } else {
        animator.warm_up();
    }
    let mut poses = Vec::with_capacity(args.count() as usize + 1);
    for k in 0..=args.count() {
        let time_s = k as f64 / args.fps;
        // Not the animator's own time, which is a sum of steps with rounding errors.
        poses.push(Pose {
            time_s,
            ..animator.pose(k)
        });
        advance_one_pose(args, &mut animator, time_s);
    }
    let what = json!({
        "wind": tree.config.wind,
        "pull_deg": args.pull,
        "loop": args.looped,
        "branches": animator.tuning().len() - 1,
        "branches_with_measured_frequency": animator.tuning().filter(|t| t.measured).count(),
    });
    Ok((poses, what))
}

/// A sound as long as the animation if that is a loop. Warns if it must be repeated.
fn fit_sound(sound: Loudness, args: &AnimateArgs) -> Loudness {
    if sound.length_s() < args.length_s() {
        eprint_line(&format!(
            "arborcam: warning: the sound lasts {:.1} s and is repeated",
            sound.length_s()
        ));
    }
    if args.looped {
        sound.looped(args.length_s())
    } else {
        sound
    }
}

/// Advances the simulation from `from_s` to the next pose; releases a pulled tree at its time.
fn advance_one_pose(args: &AnimateArgs, animator: &mut Animator, from_s: f64) {
    let step_s = 1.0 / args.fps;
    if args.pull.is_some() && (from_s..from_s + step_s).contains(&args.release) {
        animator.advance(args.release - from_s);
        animator.pull(None);
        animator.advance(from_s + step_s - args.release);
    } else {
        animator.advance(step_s);
    }
}

/// Pulls the tree aside until it leans by `lean_deg`.
fn pull_aside(
    args: &AnimateArgs,
    tree: &PreparedTree,
    animator: &mut Animator,
    lean_deg: f64,
) -> Result<(), CommandError> {
    let nodes = &tree.skeleton.nodes;
    let node = match args.pull_node {
        Some(name) => {
            let found = (1..nodes.len()).find(|&i| nodes[i].name.0 == name);
            found.ok_or_else(|| {
                CommandError::BadUsage(anyhow!(
                    "--pull-node {name} is no node of this tree that can be pulled; see nodes.csv"
                ))
            })?
        }
        None => place_to_pull(&tree.skeleton).index(),
    };
    let reached_deg = animator.pull_aside(
        NodeId(node as u32),
        tree.config.wind.direction_deg,
        lean_deg,
    );
    if reached_deg < lean_deg - 0.1 {
        eprint_line(&format!(
            "arborcam: warning: pulled so far it leans by {reached_deg:.1} degrees; it does not \
             give way farther"
        ));
    }
    Ok(())
}

/// Writes the animation to `out`, and prints a line about it.
fn write(
    args: &AnimateArgs,
    out: &Path,
    kind: Kind,
    tree: &PreparedTree,
    stop: &Stop,
) -> Result<(), CommandError> {
    let name = to_string(out.file_name());
    let stem = to_string(out.file_stem());
    let model = tree.model();
    let files: Result<Vec<NamedBytes>, ExportError> = match kind {
        Kind::Glb => glb(&model).map(|(bytes, _)| vec![(name, bytes)]),
        Kind::Gltf => gltf_files(&model, &stem).map(|(files, _)| files),
        Kind::Html => tree.page(&model, &stem).map(|bytes| vec![(name, bytes)]),
        Kind::Csv => motion_csv(tree).map(|bytes| vec![(name, bytes)]),
        Kind::Video => return render::draw(tree, &args.shot(), render::Kind::Video, out, stop),
        Kind::Picture => {
            // The last pose.
            let shot = Shot {
                at_s: Some(args.length_s()),
                ..args.shot()
            };
            return render::draw(tree, &shot, render::Kind::Picture, out, stop);
        }
    };
    write_model(out, &files?, tree.poses.len(), stop)
}

/// Writes the files of a model or a page beside `out`, and prints a line about it.
fn write_model(
    out: &Path,
    files: &[NamedBytes],
    poses: usize,
    stop: &Stop,
) -> Result<(), CommandError> {
    let size: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    let folder = out.parent().unwrap_or(Path::new(""));
    write_files(folder, files, stop.while_writing()).map_err(write_error)?;
    eprint_line(&format!(
        "{}: {} poses, {:.1} MB",
        out.display(),
        poses,
        size as f64 / 1e6
    ));
    Ok(())
}

fn to_string(part: Option<&OsStr>) -> String {
    part.unwrap_or_default().to_string_lossy().into_owned()
}

/// The motion in the format of `motion.csv`.
fn motion_csv(tree: &PreparedTree) -> Result<Vec<u8>, ExportError> {
    let metres_per_px = tree.config.export.metres_per_px;
    let mut motion = MotionCsv::new(Vec::new(), &tree.skeleton, metres_per_px)?;
    for pose in &tree.poses {
        motion.pose(pose)?;
    }
    Ok(motion.finish()?)
}
