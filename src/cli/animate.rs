//! `arborcam animate DIR`: a capture's tree in another motion than the one that was filmed.

mod live;
mod options;

pub use options::AnimateArgs;

use super::ended::{Ended, failed};
use super::hangup::SighupAction;
use super::output::say;
use super::render::{self, unwritten};
use super::session::stop_on_signals;
use super::stop::Stop;
use super::tree::{Tail, warn};
use crate::animate::{Animator, Known, Loudness, Magnify, Wind, magnify, place_to_pull};
use crate::config::Config;
use crate::document::{DocumentError, MotionCsv};
use crate::export::gltf::{NamedBytes, glb, gltf_files};
use crate::export::{ExportError, html};
use crate::files::{refuse_taken, write_files};
use crate::model::{NodeId, Pose, Swaying};
use crate::tui;
use crate::views::{PreparedTree, Shot};
use anyhow::{Context, anyhow};
use live::{AsFilmed, InWind};
use options::Kind;
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::Ordering;

/// Wind that is not looped comes back after so much more than the animation at the least, s.
const PERIOD_S: f64 = 128.0;

pub fn run(args: &AnimateArgs) -> Result<(), Ended> {
    args.set(&mut Config::default())
        .map_err(|e| Ended::BadUsage(e.into()))?;
    let Some(out) = &args.out else {
        return live(args);
    };
    let kind = args
        .check(out)
        .map_err(|why| Ended::BadUsage(anyhow!(why)))?;
    refuse_taken(out).map_err(unwritten)?;
    if kind == Kind::Html {
        html::built_in().map_err(failed)?;
    }
    let stop = Stop::on_signals()?;
    let sound = args.wav.as_deref().map(sound).transpose()?;
    let mut tree = tree(args)?;
    let (poses, what) = match args.magnify {
        Some(by) => {
            let poses = magnify(
                &tree.skeleton,
                &tree.poses,
                &magnified(args, &tree, by),
                args.fps,
                args.count(),
            );
            (
                poses.map_err(|e| Ended::Failed(e.into()))?,
                json!({ "captured": { "times": by, "speed": args.speed } }),
            )
        }
        None => blown(args, &tree, sound)?,
    };
    tree.animate(poses, args.looped, what);
    write(args, out, kind, &tree, &stop)
}

/// On the terminal, until the user leaves.
fn live(args: &AnimateArgs) -> Result<(), Ended> {
    if !std::io::stdout().is_terminal() {
        let why = "there is no terminal to show the tree on; give --out FILE (.glb, .html, .csv, .mp4 or .png)";
        return Err(Ended::BadUsage(anyhow!(why)));
    }
    let sound = args.wav.as_deref().map(sound).transpose()?;
    let tree = tree(args)?;
    let mut moving: Box<dyn tui::Moving> = match args.magnify {
        Some(by) => {
            let wanted = magnified(args, &tree, by);
            Box::new(AsFilmed::new(&tree, wanted).map_err(|e| Ended::Failed(e.into()))?)
        }
        None => {
            let mut animator = animator(&tree, sound, PERIOD_S);
            animator.warm_up();
            Box::new(InWind::new(&tree, animator))
        }
    };
    let stop = stop_on_signals(SighupAction::ends_this_process())?;
    tui::watch(&mut *moving, tui::Options::from_env(), &stop)
        .map_err(|e| Ended::BadUsage(e.into()))?;
    if stop.load(Ordering::SeqCst) {
        Err(Ended::Stopped)
    } else {
        Ok(())
    }
}

/// The tree, with the wind that is asked for, and all of its film where that is to be changed.
fn tree(args: &AnimateArgs) -> Result<PreparedTree, Ended> {
    let tail = match args.magnify {
        Some(_) => Tail::Whole,
        None => Tail::Seconds(0.0),
    };
    let mut tree = args.tree.prepare(&args.dir, tail)?;
    if args.magnify.is_some() && !tree.document.has_motion() {
        return Err(DocumentError::NoFilm {
            dir: args.dir.clone(),
            file: "motion.csv",
        }
        .into());
    }
    args.set(&mut tree.config)
        .map_err(|e| Ended::BadUsage(e.into()))?;
    warn(&tree);
    Ok(tree)
}

/// The loudness of a WAV file.
fn sound(path: &Path) -> Result<Loudness, Ended> {
    let sound = std::fs::read(path)
        .context("cannot read it")
        .and_then(|bytes| Ok(Loudness::of_wav(&bytes)?));
    sound.map_err(|e| Ended::BadUsage(e.context(format!("--wav {}", path.display()))))
}

fn magnified(args: &AnimateArgs, tree: &PreparedTree, by: f64) -> Magnify {
    let most_rad = tree.config.wind.max_bend_deg.to_radians();
    Magnify {
        by,
        speed: args.speed,
        band_hz: args.band,
        most_rad,
        looped: args.looped,
    }
}

/// The tree at rest in its wind, which comes back after `period_s`.
fn animator(tree: &PreparedTree, sound: Option<Loudness>, period_s: f64) -> Animator {
    let settings = &tree.config.wind;
    let mut wind = Wind::new(settings, period_s, metres_per_px(tree));
    if let Some(sound) = sound {
        wind = wind.driven_by(sound);
    }
    let known: Vec<Known> = tree.sway.iter().map(known).collect();
    let animator = Animator::new(tree.skeleton.clone(), &known, settings, wind);
    if animator.tuning().all(|t| !t.measured) {
        say(&format!(
            "arborcam: warning: the capture has no frequency of any branch; they are taken from \
             thickness and length, the trunk's from wind.trunk_hz ({} Hz)",
            settings.trunk_hz
        ));
    }
    animator
}

/// The tree in the wind, or pulled and released.
fn blown(
    args: &AnimateArgs,
    tree: &PreparedTree,
    sound: Option<Loudness>,
) -> Result<(Vec<Pose>, Value), Ended> {
    let count = args.count();
    let length_s = count as f64 / args.fps;
    let period_s = if args.looped {
        length_s
    } else {
        PERIOD_S * (length_s / PERIOD_S + 1.0).log2().ceil().exp2()
    };
    if let Some(sound) = sound.as_ref().filter(|s| s.length_s() < length_s) {
        say(&format!(
            "arborcam: warning: the sound lasts {:.1} s and is repeated",
            sound.length_s()
        ));
    }
    let sound = sound.map(|s| if args.looped { s.looped(length_s) } else { s });
    let mut animator = animator(tree, sound, period_s);
    if args.looped {
        animator.close(length_s, args.fps);
    } else if let Some(lean_deg) = args.pull {
        pull(args, tree, &mut animator, lean_deg)?;
    } else {
        animator.warm_up();
    }
    let mut poses = Vec::with_capacity(count as usize + 1);
    for k in 0..=count {
        // Not the animator's own time: a sum of steps is not quite it.
        poses.push(Pose {
            time_s: k as f64 / args.fps,
            ..animator.pose(k)
        });
        let (from_s, step_s) = (k as f64 / args.fps, 1.0 / args.fps);
        if args.pull.is_some() && (from_s..from_s + step_s).contains(&args.release) {
            animator.advance(args.release - from_s);
            animator.pull(None);
            animator.advance(from_s + step_s - args.release);
        } else {
            animator.advance(step_s);
        }
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

/// Hangs the tree in its rope.
fn pull(
    args: &AnimateArgs,
    tree: &PreparedTree,
    animator: &mut Animator,
    lean_deg: f64,
) -> Result<(), Ended> {
    let nodes = &tree.skeleton.nodes;
    let node = match args.pull_node {
        Some(name) => {
            let found = (1..nodes.len()).find(|&i| nodes[i].name.0 == name);
            found.ok_or_else(|| {
                Ended::BadUsage(anyhow!(
                    "--pull-node {name} is no node of this tree; see nodes.csv"
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
        say(&format!(
            "arborcam: warning: pulled so far it leans by {reached_deg:.1} degrees; it does not give way farther"
        ));
    }
    Ok(())
}

/// What was measured of a branch.
fn known(sway: &Swaying) -> Known {
    sway.as_ref().map_or_else(
        |_| Known::default(),
        |s| Known {
            frequency_hz: Some(s.frequency_hz.value),
            damping_ratio: s.damping_ratio.map(|d| d.value),
        },
    )
}

/// The capture's scale, or that of a tree of the height that the configuration says.
fn metres_per_px(tree: &PreparedTree) -> f64 {
    let given = tree.config.export.metres_per_px;
    let height_px = tree
        .skeleton
        .nodes
        .iter()
        .map(|n| n.position.y)
        .fold(1.0, f64::max);
    if given > 0.0 {
        given
    } else {
        tree.config.wind.tree_height_m / height_px
    }
}

fn write(
    args: &AnimateArgs,
    out: &Path,
    kind: Kind,
    tree: &PreparedTree,
    stop: &Stop,
) -> Result<(), Ended> {
    let name = text(out.file_name());
    let stem = text(out.file_stem());
    let model = tree.model();
    let files: Result<Vec<NamedBytes>, ExportError> = match kind {
        Kind::Glb => glb(&model).map(|(bytes, _)| vec![(name, bytes)]),
        Kind::Gltf => gltf_files(&model, &stem).map(|(files, _)| files),
        Kind::Html => tree.page(&model, &stem).map(|bytes| vec![(name, bytes)]),
        Kind::Csv => table(tree).map(|bytes| vec![(name, bytes)]),
        Kind::Video => return render::draw(tree, &args.shot(), render::Kind::Video, out, stop),
        Kind::Picture => {
            // Of the end.
            let shot = Shot {
                at_s: Some(args.length_s()),
                ..args.shot()
            };
            return render::draw(tree, &shot, render::Kind::Picture, out, stop);
        }
    };
    let files = files.map_err(failed)?;
    let size: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    let folder = out.parent().unwrap_or(Path::new(""));
    write_files(folder, &files, stop.while_writing()).map_err(unwritten)?;
    say(&format!(
        "{}: {} poses, {:.1} MB",
        out.display(),
        tree.poses.len(),
        size as f64 / 1e6
    ));
    Ok(())
}

fn text(part: Option<&OsStr>) -> String {
    part.unwrap_or_default().to_string_lossy().into_owned()
}

/// The motion in the form of a capture's `motion.csv`.
fn table(tree: &PreparedTree) -> Result<Vec<u8>, ExportError> {
    let metres_per_px = tree.config.export.metres_per_px;
    let mut motion = MotionCsv::new(Vec::new(), &tree.skeleton, metres_per_px)?;
    for pose in &tree.poses {
        motion.pose(pose)?;
    }
    Ok(motion.finish()?)
}
