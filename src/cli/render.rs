//! `arborcam render DIR`: pictures and videos of a capture without a browser.

mod options;

pub use options::{Kind, RenderArgs, ViewName, background, rate, size};

use super::export;
use super::shaping::Made;
use super::stop::Stop;
use super::{Ended, say};
use crate::animate::there_and_back;
use crate::draw::{Bounds, Camera, Look, Model, Posed, Rgba, Texture};
use crate::export::{ExportError, Film, OutputFile, refuse_taken};
use crate::model::{Pose, Size};
use options::FilmPlace;
use std::sync::atomic::Ordering;

/// Length of a video if none is given, s, and of any.
const SECONDS: f64 = 10.0;
const LONGEST_S: f64 = 600.0;
/// Side of a picture where neither its size nor the film says one.
const PLAIN: Size = Size {
    width: 640,
    height: 480,
};
/// Samples in a picture, at about seven bytes each.
const MOST_SAMPLES: usize = 40_000_000;
const WHITE: [u8; 4] = [255; 4];

pub fn run(args: &RenderArgs) -> Result<(), Ended> {
    let kind = args
        .check()
        .map_err(|why| Ended::BadUsage(anyhow::anyhow!(why)))?;
    if args.seconds.is_some_and(|s| s > LONGEST_S) {
        return Err(Ended::BadUsage(anyhow::anyhow!(
            "--seconds is more than {LONGEST_S}; give less"
        )));
    }
    refuse_taken(&args.out).map_err(failed)?;
    let stop = Stop::on_signals()?;
    let made = args
        .shaping
        .made_with(&args.dir, |film_s| Some(tail_s(args, kind, film_s)))?;
    if args.film.is_some() && made.captured.picture.is_none() {
        let what = "the capture holds no frame of the film; make it anew with this version, or leave --film out";
        return Err(Ended::Failed(anyhow::anyhow!(what)));
    }
    let job = drawn(args, kind, &made, &stop);
    // Told last, so that the error, if there is one, is the only line.
    job.inspect(|()| {
        made.captured
            .warnings
            .iter()
            .for_each(|w| say(&format!("arborcam: warning: {w}")))
    })
}

/// Draws a tree that has been made, in its poses.
pub fn drawn(args: &RenderArgs, kind: Kind, made: &Made, stop: &Stop) -> Result<(), Ended> {
    let Some(wood) = made.dressed.wood.first() else {
        return Err(Ended::Failed(anyhow::anyhow!(
            "there is nothing to be drawn of this tree"
        )));
    };
    let mut model = Model::bare(&made.skeleton, wood, made.dressed.bark_rgb);
    if !args.bare {
        model.foliage = &made.dressed.foliage;
        model.leaf = model
            .foliage
            .texture
            .as_ref()
            .and_then(|(_, bytes)| Texture::read(bytes));
    }
    let studio = Studio::new(args, made, model);
    match kind {
        Kind::Picture => studio.picture(stop),
        Kind::Video => studio.video(stop),
    }
}

/// How much of the end of a film of `film_s` is to be read: hours of poses would fill the memory.
fn tail_s(args: &RenderArgs, kind: Kind, film_s: f64) -> f64 {
    match (args.at, kind) {
        // The last frame's own time is a little less than the film's.
        (Some(at_s), _) => (film_s - at_s).max(0.0) + 2.0,
        (None, Kind::Video) => args.seconds.unwrap_or(SECONDS) + 1.0,
        (None, Kind::Picture) => 0.0,
    }
}

/// The tree before its camera.
struct Studio<'a> {
    args: &'a RenderArgs,
    made: &'a Made,
    model: Model<'a>,
    size: Size,
    look: Look,
    /// Holds the tree in all its poses.
    bounds: Bounds,
}

impl<'a> Studio<'a> {
    fn new(args: &'a RenderArgs, made: &'a Made, model: Model<'a>) -> Self {
        let film = made.captured.picture.as_ref().map(|p| p.rgb.size);
        let size = args.size.unwrap_or(if args.film.is_some() {
            film.unwrap_or(PLAIN)
        } else {
            PLAIN
        });
        let samples = (1..=3)
            .rev()
            .find(|n| size.area() * n * n <= MOST_SAMPLES)
            .unwrap_or(1) as u32;
        let look = Look {
            samples,
            shadow: args.view == ViewName::Turntable,
            ..Look::default()
        };
        let empty = Bounds {
            low: nalgebra::Point3::origin(),
            high: nalgebra::Point3::origin(),
            radius: 0.0,
        };
        let rest = model.posed(None, &[]).bounds().unwrap_or(empty);
        // The wood at rest, and as far around it as its joints go.
        let joints = made
            .poses
            .iter()
            .flat_map(|p| &p.joints)
            .map(|j| j.position);
        let bounds = Bounds::of(joints).map_or(rest, |all| all.with(&rest));
        Self {
            args,
            made,
            model,
            size,
            look,
            bounds,
        }
    }

    fn picture(&self, stop: &Stop) -> Result<(), Ended> {
        let posed = match (self.args.at, self.args.pose) {
            (Some(at_s), _) => self.posed(Some(self.pose_at(at_s)?)),
            (None, None) if self.args.film.is_some() => {
                self.model.posed(self.made.pose_in_picture.as_ref(), &[])
            }
            _ => self.posed(None),
        };
        let drawn = self.draw(&posed, 0.0, self.args.background.unwrap_or(WHITE));
        let mut png = std::io::Cursor::new(Vec::new());
        let (width, height) = (drawn.size.width, drawn.size.height);
        image::write_buffer_with_format(
            &mut png,
            &drawn.pixels,
            width,
            height,
            image::ColorType::Rgba8,
            image::ImageFormat::Png,
        )
        .map_err(|e| Ended::Failed(e.into()))?;
        let stop = stop.while_writing();
        let file = OutputFile::create(&self.args.out).map_err(failed)?;
        file.write(png.get_ref(), stop).map_err(failed)?;
        file.publish().map_err(failed)
    }

    fn video(&self, stop: &Stop) -> Result<(), Ended> {
        let poses = &self.made.poses;
        let (first_s, last_s) = (
            poses.first().map_or(0.0, |p| p.time_s),
            poses.last().map_or(0.0, |p| p.time_s),
        );
        let still = self.args.pose.is_some() || poses.len() < 2;
        let wanted_s = self.args.seconds.unwrap_or(if still {
            SECONDS
        } else {
            SECONDS.min(last_s - first_s)
        });
        let from_s = match self.args.at {
            Some(at_s) => poses[self.pose_at(at_s)?].time_s,
            None => (last_s - wanted_s).max(first_s),
        };
        let frames = ((wanted_s * self.args.fps).round() as u64).max(1);
        let stop = stop.while_writing();
        let mut film: Option<Film> = None;
        for k in 0..frames {
            if stop.load(Ordering::SeqCst) {
                return Err(Ended::Stopped);
            }
            // Where the film is over it goes back: no jump.
            let time_s = from_s + there_and_back(k as f64 / self.args.fps, last_s - from_s);
            let pose = if still { None } else { nearest(poses, time_s) };
            let drawn = self.draw(
                &self.posed(pose),
                k as f64 / frames as f64,
                self.args.background.unwrap_or(WHITE),
            );
            let rgb: Vec<u8> = drawn
                .pixels
                .chunks_exact(4)
                .flat_map(|p| [p[0], p[1], p[2]])
                .collect();
            let film = match &mut film {
                Some(film) => film,
                None => film.insert(
                    Film::begin(&self.args.out, drawn.size, self.args.fps).map_err(failed)?,
                ),
            };
            film.frame(&rgb).map_err(failed)?;
        }
        film.map_or(Ok(()), Film::finish).map_err(failed)
    }

    /// The tree before what is behind it, with the filmed frame where it was wanted.
    fn draw(&self, posed: &Posed, share: f64, background: [u8; 4]) -> Rgba {
        let view = self.args.view_at(share);
        let camera = match (self.args.film, self.args.view) {
            // Beside the film the tree has the film's size.
            (Some(_), ViewName::Front) if self.args.turn == 0.0 => {
                Camera::of_film(&self.made.skeleton, self.size)
            }
            (_, ViewName::Turntable) => Camera::fitting(&self.bounds, view, true, self.size),
            _ => Camera::fitting(&self.bounds, view, false, self.size),
        };
        let frame = self
            .made
            .captured
            .picture
            .as_ref()
            .filter(|_| self.args.film.is_some());
        let frame = frame.and_then(|p| Rgba::of_frame(&p.rgb, self.size, background));
        let mut below = Rgba::of_one(self.size, background);
        if let (Some(FilmPlace::Behind), Some(frame)) = (self.args.film, &frame) {
            below.put(frame);
        }
        below.put(&crate::draw::picture(posed, &camera, &self.look));
        match (self.args.film, &frame) {
            (Some(FilmPlace::Beside), Some(frame)) => Rgba::beside(frame, &below, background),
            _ => below,
        }
    }

    /// The tree in one of its poses, its leaves as they swing then; `None` for its rest.
    fn posed(&self, k: Option<usize>) -> Posed<'_> {
        let Some(k) = k else {
            return self.model.posed(None, &[]);
        };
        let sway: Vec<[f32; 2]> = self
            .made
            .flutter
            .iter()
            .map(|all| all.get(k).copied().unwrap_or_default())
            .collect();
        self.model.posed(self.made.poses.get(k), &sway)
    }

    /// Which pose is that of a moment of the film.
    fn pose_at(&self, at_s: f64) -> Result<usize, Ended> {
        let poses = &self.made.poses;
        let found = nearest(poses, at_s).filter(|k| (poses[*k].time_s - at_s).abs() < 1.0);
        found.ok_or_else(|| {
            let last_s = poses.last().map_or(0.0, |p| p.time_s);
            Ended::BadUsage(anyhow::anyhow!(
                "there is no pose at {at_s} s: the film is {last_s:.1} s long; give less with --at"
            ))
        })
    }
}

/// The same of one file.
pub fn failed(e: ExportError) -> Ended {
    match e {
        ExportError::Exists { path } => Ended::Failed(anyhow::anyhow!(
            "{} exists already; choose another file, or remove it first",
            path.display()
        )),
        e => export::failed(e),
    }
}

fn nearest(poses: &[Pose], time_s: f64) -> Option<usize> {
    let after = poses.partition_point(|p| p.time_s < time_s);
    let away = |k: &usize| (poses[*k].time_s - time_s).abs();
    (after.saturating_sub(1)..poses.len().min(after + 1)).min_by(|a, b| away(a).total_cmp(&away(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Status 130, by which a script tells Ctrl-C from a failure.
    #[test]
    fn who_was_stopped_has_not_failed() {
        assert!(matches!(failed(ExportError::Stopped), Ended::Stopped));
        let taken = ExportError::Exists {
            path: "a.png".into(),
        };
        assert!(
            matches!(failed(taken), Ended::Failed(e) if e.to_string().contains("another file"))
        );
    }
}
