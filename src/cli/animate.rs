//! `arborcam animate DIR`: a capture's tree in another motion than the one that was filmed.

mod options;

pub use options::AnimateArgs;

use super::export::page;
use super::render::{self, RenderArgs, drawn};
use super::shaping::Made;
use super::{Ended, say};
use crate::animate::{Animator, Known, Loudness, Magnify, Wind, magnify};
use crate::export::csv::{MotionCsv, Sway};
use crate::export::gltf::{NamedBytes, glb, gltf_files};
use crate::export::{ExportError, html, refuse_taken, write_files};
use crate::model::{NodeId, Pose};
use anyhow::{Context, anyhow};
use options::Kind;
use serde_json::{Value, json};
use std::path::Path;

/// Wind that is not looped comes back after so much more than the animation at the least, s.
const PERIOD_S: f64 = 128.0;

pub fn run(args: &AnimateArgs) -> Result<(), Ended> {
    let kind = args.check().map_err(|why| Ended::BadUsage(anyhow!(why)))?;
    refuse_taken(&args.out).map_err(failed)?;
    if kind == Kind::Html {
        html::built_in().map_err(failed)?;
    }
    let sound = args.wav.as_deref().map(sound).transpose()?;
    // Wind needs none of the captured motion.
    let film_s = |film_s: f64| Some(if args.magnify.is_some() { film_s + 1.0 } else { 0.0 });
    let mut made = args.shaping.made_with(&args.dir, film_s)?;
    args.set(&mut made.config).map_err(|e| Ended::BadUsage(e.into()))?;
    for warning in &made.captured.warnings {
        say(&format!("arborcam: warning: {warning}"));
    }
    let (poses, what) = match args.magnify {
        Some(by) => (magnified(args, &made, by)?, json!({ "captured": { "times": by, "speed": args.speed } })),
        None => blown(args, &made, sound)?,
    };
    made.animate(poses, args.looped, what);
    write(args, kind, &made)
}

/// The loudness of a WAV file.
fn sound(path: &Path) -> Result<Loudness, Ended> {
    let unfit = |e: anyhow::Error| Ended::BadUsage(e.context(format!("--wav {}", path.display())));
    let bytes = std::fs::read(path).context("cannot read it").map_err(unfit)?;
    Loudness::of_wav(&bytes).map_err(|e| unfit(e.into()))
}

fn magnified(args: &AnimateArgs, made: &Made, by: f64) -> Result<Vec<Pose>, Ended> {
    let most_rad = made.config.wind.max_bend_deg.to_radians();
    let wanted = Magnify { by, speed: args.speed, band_hz: args.band, most_rad, looped: args.looped };
    magnify(&made.skeleton, &made.poses, &wanted, args.fps, args.count()).map_err(|e| Ended::Failed(e.into()))
}

/// The tree in the wind, or pulled and let go.
fn blown(args: &AnimateArgs, made: &Made, sound: Option<Loudness>) -> Result<(Vec<Pose>, Value), Ended> {
    let settings = &made.config.wind;
    let count = args.count();
    let length_s = count as f64 / args.fps;
    let period_s = if args.looped { length_s } else { PERIOD_S * (length_s / PERIOD_S + 1.0).log2().ceil().exp2() };
    let mut wind = Wind::new(settings, period_s, metres_per_px(made));
    if let Some(sound) = sound {
        if sound.length_s() < length_s {
            say(&format!("arborcam: warning: the sound lasts {:.1} s and is repeated", sound.length_s()));
        }
        wind = wind.driven_by(if args.looped { sound.looped(length_s) } else { sound });
    }
    let known: Vec<Known> = made.sway.iter().map(known).collect();
    let mut animator = Animator::new(made.skeleton.clone(), &known, settings, wind);
    let (branches, measured) = (animator.tuning().len() - 1, animator.tuning().filter(|t| t.measured).count());
    if measured == 0 {
        say(&format!(
            "arborcam: warning: the capture has no frequency of any branch; they are taken from thickness and length, the \
             trunk's from wind.trunk_hz ({} Hz)",
            settings.trunk_hz
        ));
    }
    if args.looped {
        animator.close(length_s, args.fps);
    } else if let Some(lean_deg) = args.pull {
        pull(args, made, &mut animator, lean_deg)?;
    } else {
        animator.warm_up();
    }
    let mut poses = Vec::with_capacity(count as usize + 1);
    for k in 0..=count {
        // Not the animator's own time: a sum of steps is not quite it.
        poses.push(Pose { time_s: k as f64 / args.fps, ..animator.pose(k) });
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
        "wind": settings,
        "pull_deg": args.pull,
        "loop": args.looped,
        "branches": branches,
        "branches_with_measured_frequency": measured,
    });
    Ok((poses, what))
}

/// Hangs the tree in its rope.
fn pull(args: &AnimateArgs, made: &Made, animator: &mut Animator, lean_deg: f64) -> Result<(), Ended> {
    let nodes = &made.skeleton.nodes;
    let node = match args.pull_node {
        Some(name) => {
            let unknown = || Ended::BadUsage(anyhow!("--pull-node {name} is no node of this tree; see nodes.csv"));
            (1..nodes.len()).find(|&i| nodes[i].name.0 == name).ok_or_else(unknown)?
        }
        None => (0..nodes.len()).max_by(|&a, &b| nodes[a].position.y.total_cmp(&nodes[b].position.y)).unwrap_or(0),
    };
    let reached_deg = animator.pull_aside(NodeId(node as u32), made.config.wind.direction_deg, lean_deg);
    if reached_deg < lean_deg - 0.1 {
        say(&format!("arborcam: warning: pulled so far it leans by {reached_deg:.1} degrees; it does not give way farther"));
    }
    Ok(())
}

/// What was measured of a branch.
fn known(sway: &Option<Sway>) -> Known {
    let number = |x: f64| x.is_finite().then_some(x);
    sway.as_ref().map_or_else(Known::default, |s| Known {
        frequency_hz: number(s.frequency_hz),
        damping_ratio: number(s.damping_ratio),
    })
}

/// The capture's scale, or that of a tree of the height that the configuration says.
fn metres_per_px(made: &Made) -> f64 {
    let given = made.config.export.metres_per_px;
    let height_px = made.skeleton.nodes.iter().map(|n| n.position.y).fold(1.0, f64::max);
    if given > 0.0 { given } else { made.config.wind.tree_height_m / height_px }
}

fn write(args: &AnimateArgs, kind: Kind, made: &Made) -> Result<(), Ended> {
    let part = |of: Option<&std::ffi::OsStr>| of.unwrap_or_default().to_string_lossy().into_owned();
    let (name, stem) = (part(args.out.file_name()), part(args.out.file_stem()));
    let model = made.model();
    let files: Result<Vec<NamedBytes>, ExportError> = match kind {
        Kind::Glb => glb(&model).map(|(bytes, _)| vec![(name, bytes)]),
        Kind::Gltf => gltf_files(&model, &stem).map(|(files, _)| files),
        Kind::Html => page(made, &model, &stem).map(|bytes| vec![(name, bytes)]),
        Kind::Csv => table(made).map(|bytes| vec![(name, bytes)]),
        Kind::Video => return drawn(&picture(args), render::Kind::Video, made),
        Kind::Picture => return drawn(&picture(args), render::Kind::Picture, made),
    };
    let files = files.map_err(failed)?;
    let size: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    write_files(args.out.parent().unwrap_or(Path::new("")), &files).map_err(failed)?;
    say(&format!("{}: {} poses, {:.1} MB", args.out.display(), made.poses.len(), size as f64 / 1e6));
    Ok(())
}

/// The motion in the form of a capture's `motion.csv`.
fn table(made: &Made) -> Result<Vec<u8>, ExportError> {
    let mut motion = MotionCsv::new(Vec::new(), &made.skeleton, made.config.export.metres_per_px)?;
    made.poses.iter().try_for_each(|pose| motion.pose(pose))?;
    motion.finish()
}

/// As `render` would be asked; a picture is of the end.
fn picture(args: &AnimateArgs) -> RenderArgs {
    let length_s = args.count() as f64 / args.fps;
    let video = args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("mp4"));
    RenderArgs {
        dir: args.dir.clone(),
        view: args.view,
        turn: 0.0,
        out: args.out.clone(),
        at: (!video).then_some(length_s),
        pose: None,
        size: args.size,
        background: args.background,
        film: None,
        bare: args.bare,
        seconds: video.then_some(length_s),
        fps: args.fps,
        shaping: super::shaping::Shaping::default(),
    }
}

fn failed(e: ExportError) -> Ended {
    match e {
        ExportError::Exists { path } => {
            Ended::Failed(anyhow!("{} exists already; choose another file, or remove it first", path.display()))
        }
        e => Ended::Failed(e.into()),
    }
}
