//! The trees of a forest in wind: each template sways by its own frequencies, all in the same gusts.

use super::super::command_error::CommandError;
use super::super::render;
use super::super::stop::Stop;
use super::options::Kind;
use super::{AnimateArgs, read_wav, simulate, to_string, warn_of_guesses, write_model};
use crate::views::{PreparedForest, Shot};
use anyhow::anyhow;
use std::path::Path;

/// Animates the forest in the folder of `args`.
pub fn run(args: &AnimateArgs, out: &Path, kind: Kind, stop: &Stop) -> Result<(), CommandError> {
    check(args, kind).map_err(|why| CommandError::BadUsage(anyhow!(why)))?;
    let mut forest = PreparedForest::read(&args.dir)?;
    if forest.is_staggered() && !args.looped {
        return Err(CommandError::BadUsage(anyhow!(
            "trees of this forest share a motion, one later than the other, which needs a loop; give \
             --loop"
        )));
    }
    let sound = args.wav.as_deref().map(read_wav).transpose()?;
    warn_of_guesses(&forest.templates);
    for template in 0..forest.templates.len() {
        let metres_per_px = forest.metres_per_px(template);
        let tree = &mut forest.templates[template];
        args.set(&mut tree.config);
        tree.config.export.metres_per_px = metres_per_px;
        let (poses, what) = simulate(args, tree, sound.clone())?;
        tree.animate(poses, args.looped, what);
    }
    let name = to_string(out.file_name());
    let bytes = match kind {
        Kind::Html => forest.page(&to_string(out.file_stem()))?,
        Kind::Video => {
            return render::draw_forest(&forest, &args.shot(), render::Kind::Video, out, stop);
        }
        Kind::Picture => {
            let shot = Shot {
                at_s: Some(args.length_s()),
                ..args.shot()
            };
            return render::draw_forest(&forest, &shot, render::Kind::Picture, out, stop);
        }
        _ => forest.moving_glb()?,
    };
    let poses = forest.templates.first().map_or(0, |tree| tree.poses.len());
    write_model(out, &[(name, bytes)], poses, stop)
}

/// # Errors
/// What a forest cannot be asked for.
fn check(args: &AnimateArgs, kind: Kind) -> Result<(), &'static str> {
    if matches!(kind, Kind::Csv | Kind::Gltf) {
        return Err(
            "of a forest .glb, .html, .mp4 or .png is made; name --out so, or animate one of its \
                    trees, which are folders of their own",
        );
    }
    if args.magnify.is_some()
        || args.pull.is_some()
        || args.tree.is_given()
        || args.height.is_given()
    {
        return Err(
            "--magnify, --pull and the options of the tree do not go with a forest; animate one \
                    of its trees, which are folders of their own",
        );
    }
    Ok(())
}
