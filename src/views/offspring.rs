//! New trees like the tree of a document, each a document of its own.

use super::{Draft, PrepareError, PreparedTree, TreeOptions, write_document};
use crate::animate::{Animator, Known, Wind, wind_scale};
use crate::config::{self, Config, EnvelopeKind, Leader, LeafShow};
use crate::document::note::{BarkNote, CaptureNote, LeavesNote, ModelNote, OutlineNote, Source};
use crate::document::{BARK_FILE, Document};
use crate::geometry::{Foliage, Template, leaf_palette};
use crate::grow::{
    ForkStatistics, GrowError, LOOP_S, MotionStatistics, Resampling, SideAngles, grow_flat,
    resample, sample_sway,
};
use crate::model::{Outline, Pose, Size, Skeleton, Swaying, Unidentified};
use crate::pipeline::{MOST_RESHAPED, grown_terms, reshape, stand_grown};
use crate::random::{Generator, generator, seed_of_part};
use crate::shape::{Terms, is_trunk};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Poses of a loop in wind, Hz.
const WIND_RATE_HZ: f64 = 30.0;
/// A trunk that reaches this share of its tree's height is its axis.
const AXIS_HEIGHT: f64 = 0.9;
/// Trees that are grown to see how the terms of their push should weigh, and their seed.
const SAMPLES: u64 = 5;
const SAMPLE_SEED: u64 = 1;

/// In what new trees are like the example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Likeness {
    /// They have forks of the same kind (Li 2011 sect. 5).
    Forks,
    /// They have the same branches at other angles (Zeng 2015 sect. 5.4.2).
    Branches(Resampling),
}

/// How new trees move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OffspringMotion {
    /// As the example did in its film.
    Example,
    /// In the wind of the settings.
    Wind,
    AtRest,
}

/// What new trees are to be like.
#[derive(Clone, Debug)]
pub struct OffspringOptions {
    pub likeness: Likeness,
    pub motion: OffspringMotion,
    /// What they are to fill, in the picture of the example; `None`: its own outline.
    pub region: Option<Outline>,
    /// The example's settings, or others.
    pub config: Config,
}

/// An example, and all that was learned of it.
pub struct Parent {
    document: Document,
    form: Form,
    motion: Motion,
    region: Outline,
    /// Colours of the example's leaves (sRGB); none where nothing shows them.
    leaf_rgb: Vec<[u8; 3]>,
    /// How much larger than the example new trees are.
    scale: f64,
    config: Config,
}

/// What was learned of its form.
enum Form {
    Forks {
        statistics: ForkStatistics,
        /// Of the push that stands trees like the example up.
        terms: Terms,
    },
    Branches {
        angles: SideAngles,
        /// Which nodes are trunk.
        trunk: Vec<bool>,
        how: Resampling,
    },
}

impl Form {
    /// Of forks, from a tree with this outline.
    fn forks(example: &Skeleton, outline: &Outline, config: &Config) -> Result<Self, GrowError> {
        let statistics = ForkStatistics::of(example)?;
        let mut samples = Vec::new();
        for k in 0..SAMPLES {
            let random = &mut generator(SAMPLE_SEED, k);
            // In a region that is asked for there may be room where the example's outline has none.
            samples.extend(grow_flat(
                &statistics,
                outline,
                example.foot_px,
                1.0,
                random,
            ));
        }
        Ok(Self::Forks {
            terms: grown_terms(example, &samples, outline, config),
            statistics,
        })
    }
}

/// What was learned of its motion.
enum Motion {
    Example(Box<MotionStatistics>),
    Wind,
    AtRest,
}

/// A new tree.
#[derive(Clone, Debug)]
pub struct Offspring {
    pub skeleton: Skeleton,
    /// A loop, the last pose the first again; none at rest.
    pub poses: Vec<Pose>,
    /// How each node sways: as a branch of the example does.
    pub sway: Vec<Swaying>,
    /// The settings that it was made with, its own seeds among them.
    pub config: Config,
}

impl Parent {
    /// Learns from the tree and the motion of `document`, which was read with as much of its film
    /// as is to be learned from.
    ///
    /// # Errors
    /// It has too few forks, no outline, or no motion where it is to move like it; the region is
    /// empty; the tree is too large to be given another shape.
    pub fn new(document: Document, options: OffspringOptions) -> Result<Self, PrepareError> {
        let mut config = options.config;
        config.shape.planes = config.shape.planes_of(document.note.is_of_bare());
        let nodes = document.skeleton.measured() * config.shape.planes as usize;
        if nodes > MOST_RESHAPED {
            return Err(PrepareError::TooManyNodes { nodes });
        }
        let own = outline_of(&document)?.clone();
        let region = options.region.unwrap_or_else(|| own.clone());
        for_new_trees(&mut config.shape, &options.likeness);
        let form = match options.likeness {
            Likeness::Forks => Form::forks(&document.skeleton, &own, &config)?,
            Likeness::Branches(how) => {
                let trunk = is_trunk(&document.skeleton);
                Form::Branches {
                    angles: SideAngles::of(&document.skeleton, &trunk),
                    trunk,
                    how,
                }
            }
        };
        let motion = match options.motion {
            OffspringMotion::Example => {
                let learned = MotionStatistics::of(&document.skeleton, &document.poses);
                Motion::Example(Box::new(learned.ok_or_else(|| PrepareError::NoSway {
                    dir: document.dir.clone(),
                })?))
            }
            OffspringMotion::Wind => Motion::Wind,
            OffspringMotion::AtRest => Motion::AtRest,
        };
        let scale = height_px(&region) / height_px(&own).max(1.0);
        let (document, foliage) = looked_at(document)?;
        let in_leaf = !foliage.groups.is_empty();
        if config.leaves.show == LeafShow::Auto {
            // No picture shows theirs.
            config.leaves.show = if in_leaf { LeafShow::On } else { LeafShow::Off };
        }
        let leaf_rgb = match document.picture {
            Some(_) => leaf_palette(&foliage, &Template::ours()),
            None => document.note.leaf_rgb().to_vec(),
        };
        Ok(Self {
            document,
            form,
            motion,
            region,
            leaf_rgb,
            scale,
            config,
        })
    }

    /// Metres in a pixel of new trees; 0 where that is not known.
    pub fn metres_per_px(&self) -> f64 {
        self.document.metres_per_px()
    }

    /// Width and height of the region that new trees fill, px.
    pub fn size_px(&self) -> Size {
        let bounds = self.region.bounds_px();
        bounds.map_or(Size::new(1, 1), |[left, top, right, bottom]| {
            Size::new(right - left + 1, bottom - top + 1)
        })
    }

    /// Whether new trees lack what the example is known by: one trunk up to the top, as conifers
    /// have. Forks say how branches divide, not that one of them stays the axis.
    pub fn loses_axis(&self) -> bool {
        let skeleton = &self.document.skeleton;
        let (mut trunk, mut all) = (0.0_f64, 0.0_f64);
        for (node, is_trunk) in skeleton.nodes.iter().zip(is_trunk(skeleton)) {
            let height = node.position.y;
            all = all.max(height);
            trunk = if is_trunk { trunk.max(height) } else { trunk };
        }
        matches!(self.form, Form::Forks { .. }) && trunk > AXIS_HEIGHT * all
    }

    /// Name of what was filmed, without the folders that it lay in.
    pub fn example_name(&self) -> String {
        self.document.note.source.short_name().to_owned()
    }

    /// The new tree with this number. The same seed and number give the same tree, whatever others
    /// are made.
    ///
    /// # Errors
    /// The region lies off the trunk, or no angle is dense enough.
    pub fn offspring(&self, seed: u64, number: u64) -> Result<Offspring, PrepareError> {
        let seed = seed_of_part(seed, number);
        let mut config = self.config.clone();
        config.wood.seed = seed_of_part(seed, 3) as u32;
        config.wind.seed = seed_of_part(seed, 4) as u32;
        let skeleton = self.skeleton(&config, &mut generator(seed, 0))?;
        let sway = self.sway(&skeleton, &mut generator(seed, 1));
        let poses = match &self.motion {
            Motion::AtRest => Vec::new(),
            Motion::Wind => in_wind(&skeleton, &sway, &config),
            Motion::Example(learned) => {
                let most_rad = config.wind.max_bend_deg.to_radians();
                learned.sample(&skeleton, most_rad, &mut generator(seed, 2))
            }
        };
        Ok(Offspring {
            skeleton,
            poses,
            sway,
            config,
        })
    }

    fn skeleton(&self, config: &Config, random: &mut Generator) -> Result<Skeleton, PrepareError> {
        let example = &self.document.skeleton;
        match &self.form {
            Form::Forks { statistics, terms } => {
                let foot_px = example.foot_px;
                let flat = grow_flat(statistics, &self.region, foot_px, self.scale, random)?;
                let trunk_px = example.nodes.get(1).map_or(1.0, |top| top.radius);
                let trunk_px = trunk_px * self.scale;
                Ok(stand_grown(&flat, &self.region, *terms, trunk_px, config))
            }
            Form::Branches { angles, trunk, how } => {
                let turned = resample(example, trunk, angles, how, random).map_err(|nothing| {
                    PrepareError::NotDense {
                        threshold: how.threshold,
                        highest: nothing.highest,
                    }
                })?;
                Ok(reshape(&turned, &self.region, config))
            }
        }
    }

    fn sway(&self, new: &Skeleton, random: &mut Generator) -> Vec<Swaying> {
        let (example, known) = (&self.document.skeleton, &self.document.sway);
        match &self.form {
            Form::Forks { .. } => sample_sway(example, known, new, random),
            Form::Branches { .. } => {
                // The same branches, and copies that nothing was measured on.
                let mut sway = known.clone();
                sway.truncate(example.measured());
                sway.resize(new.nodes.len(), Err(Unidentified::NotMeasured));
                sway
            }
        }
    }

    /// Writes a new tree as a document to `dir`, which appears when it is complete, or not at all: also
    /// where `stop` is set meanwhile.
    ///
    /// # Errors
    /// `dir` is there already, a file cannot be written, or it was stopped.
    pub fn write(
        &self,
        dir: &Path,
        tree: Offspring,
        stop: &AtomicBool,
    ) -> Result<(), PrepareError> {
        let bark = self.document.bark.as_ref();
        let draft = Draft {
            note: self.note(&tree),
            skeleton: &tree.skeleton,
            picture: None,
            bark,
            at_rest: None,
            poses: tree.poses,
            pose_in_picture: None,
        };
        write_document(dir, draft, &tree.sway, stop)
    }

    fn note(&self, tree: &Offspring) -> CaptureNote {
        let own = &self.document.note;
        let source = Source {
            name: format!("grown from {}", own.source.name),
            format_asked: String::new(),
            format_given: String::new(),
            ..own.source
        };
        let has_outline = !self.region.polygon_px.is_empty();
        let outline = has_outline.then(|| OutlineNote::of(0, &self.region, Some(&self.region)));
        let model = ModelNote::of(&tree.skeleton, self.document.metres_per_px());
        let bark = self.document.bark.as_ref().map(|_| BarkNote {
            file: BARK_FILE.into(),
        });
        CaptureNote {
            schema_version: own.schema_version,
            software: own.software.clone(),
            notes: own.notes.clone(),
            bark,
            leaves: (!self.leaf_rgb.is_empty()).then(|| LeavesNote {
                rgb: self.leaf_rgb.clone(),
            }),
            ..CaptureNote::not_filmed(source, outline, model, tree.config.clone())
        }
    }
}

/// The settings of the shape for new trees.
fn for_new_trees(shape: &mut config::Shape, likeness: &Likeness) {
    match likeness {
        // A line along the example's trunk is none along theirs.
        Likeness::Forks if shape.leader == Leader::Drawn => shape.leader = Leader::Auto,
        Likeness::Forks => {}
        // Branches that were turned out of the outline keep their length.
        Likeness::Branches(_) => shape.envelope = EnvelopeKind::Hull,
    }
}

/// The document, and the leaves that its tree bears.
fn looked_at(mut document: Document) -> Result<(Document, Foliage), PrepareError> {
    let poses = std::mem::take(&mut document.poses);
    let config = document.note.config.clone();
    let options = TreeOptions {
        config,
        ..TreeOptions::default()
    };
    let tree = PreparedTree::new(document, options)?;
    let document = Document {
        poses,
        ..tree.document
    };
    Ok((document, tree.dressed.foliage))
}

/// A loop of the tree in the wind of the settings.
fn in_wind(skeleton: &Skeleton, sway: &[Swaying], config: &Config) -> Vec<Pose> {
    let scale = wind_scale(skeleton, config.export.metres_per_px, &config.wind);
    let wind = Wind::new(&config.wind, LOOP_S, scale);
    let known: Vec<Known> = sway.iter().map(Known::of).collect();
    let mut animator = Animator::new(Arc::new(skeleton.clone()), &known, &config.wind, wind);
    animator.close(LOOP_S, WIND_RATE_HZ);
    let steps = (LOOP_S * WIND_RATE_HZ) as u64;
    let mut poses = Vec::with_capacity(steps as usize + 1);
    for k in 0..=steps {
        poses.push(Pose {
            time_s: k as f64 / WIND_RATE_HZ,
            ..animator.pose(k)
        });
        animator.advance(1.0 / WIND_RATE_HZ);
    }
    poses
}

/// The outline of a document's tree, where it rests if that is known.
///
/// # Errors
/// The document holds none.
pub fn outline_of(document: &Document) -> Result<&Outline, PrepareError> {
    let at_rest = document.outline_at_rest.as_ref();
    at_rest
        .or(document.outline.as_ref())
        .ok_or_else(|| PrepareError::NoOutline {
            dir: document.dir.clone(),
        })
}

/// From the highest row of a region to its lowest, px.
fn height_px(region: &Outline) -> f64 {
    region
        .bounds_px()
        .map_or(0.0, |[_, top, _, bottom]| f64::from(bottom - top + 1))
}
