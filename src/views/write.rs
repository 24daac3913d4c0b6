//! A whole document with its model's file: at the end of a film, of a tree that was not filmed, and
//! of one that was analysed anew.

use super::{PrepareError, PreparedTree, TreeOptions};
use crate::document::note::{CaptureNote, json};
use crate::document::{
    BARK_FILE, Document, MODES_FILE, MOTION_FILE, MotionCsv, PICTURE_FILE, at_rest_files, jpeg, png,
};
use crate::export::gltf::{NamedBytes, glb};
use crate::files::{OutputFolder, WriteError, replace, write_files, write_folder};
use crate::model::{
    AtRest, FilmCut, Judgement, Picture, Pose, Rgb, Skeleton, Swaying, TreeMode, UserNotes,
};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Name of the model's file.
const MODEL_FILE: &str = "tree.glb";
/// Name of the note on the whole.
const NOTE_FILE: &str = "capture.json";

/// A tree that is to become a document.
#[derive(Clone, Debug)]
pub struct Draft<'a> {
    /// What goes into `capture.json`; it must have a model. `animation` is filled in when it is
    /// known.
    pub note: CaptureNote,
    pub skeleton: &'a Skeleton,
    /// What the note's picture is; the note must have one then.
    pub picture: Option<&'a Picture>,
    /// What the note's bark is; the note must have one then.
    pub bark: Option<&'a Arc<Rgb>>,
    /// What the note's masks are and lie on; the note must have them then.
    pub at_rest: Option<&'a Arc<AtRest>>,
    /// The end of the film in the order of time, `export.animation_s` and a second more; none for a
    /// tree that was not filmed.
    pub poses: Vec<Pose>,
    pub pose_in_picture: Option<&'a Pose>,
}

/// What an analysis found.
#[derive(Clone, Copy, Debug)]
pub struct SwayFound<'a> {
    /// By node index.
    pub sway: &'a [Swaying],
    /// Those of the whole tree, the slowest first.
    pub modes: &'a [TreeMode],
    /// `None` where the film is in one piece, or that is not known.
    pub cut: Option<FilmCut>,
}

impl<'a> SwayFound<'a> {
    /// Of a tree that was not filmed.
    fn at_rest(sway: &'a [Swaying]) -> Self {
        Self {
            sway,
            modes: &[],
            cut: None,
        }
    }
}

/// What takes a file of this name.
type Put<'a> = dyn FnMut(&str, Vec<u8>) -> Result<(), WriteError> + 'a;

/// A document on its way to the disk.
///
/// The views are made of what reading the files back gives, so that those made later are the same,
/// byte for byte.
pub struct DocumentWriter {
    tree: PreparedTree,
    picture_jpg: Option<Vec<u8>>,
    at_rest: Option<Arc<AtRest>>,
}

impl DocumentWriter {
    /// Prepares all that needs no sway, which is most of the work.
    ///
    /// # Errors
    /// The tree cannot be written or not be read back.
    pub fn new(draft: Draft) -> Result<Self, PrepareError> {
        let picture_jpg = draft.picture.map(|p| jpeg(&p.rgb)).transpose()?;
        let mut document =
            Document::as_read(&draft.note, draft.skeleton, &[], picture_jpg.as_deref())?;
        let config = document.note.config.clone();
        document.take_poses(
            draft.poses,
            draft.pose_in_picture,
            config.export.animation_s,
        );
        // A PNG gives back what was put in.
        document.bark = draft.bark.cloned();
        let masks = draft.at_rest.map(|at_rest| &at_rest.masks);
        document.leaf_mask = masks.map(|masks| Arc::new(masks.leaves.clone()));
        let options = TreeOptions {
            config,
            ..TreeOptions::default()
        };
        Ok(Self {
            tree: PreparedTree::new(document, options)?,
            picture_jpg,
            at_rest: draft.at_rest.cloned(),
        })
    }

    /// Writes `nodes.csv`, of a film `modes.csv`, `tree.glb`, the pictures, the bark, the masks and
    /// `capture.json` with these `warnings` and this `judgement`.
    ///
    /// # Errors
    /// A file cannot be written, or the tree is none for a model's file.
    pub fn write(
        mut self,
        folder: &OutputFolder,
        found: SwayFound,
        warnings: Vec<String>,
        judgement: Option<Judgement>,
    ) -> Result<(), PrepareError> {
        let put = &mut |name: &str, bytes: Vec<u8>| folder.write(name, &bytes);
        self.each_file(found, warnings, judgement, put)
    }

    /// Makes one file after the other, and gives each to `put`.
    fn each_file(
        &mut self,
        found: SwayFound,
        warnings: Vec<String>,
        judgement: Option<Judgement>,
        put: &mut Put,
    ) -> Result<(), PrepareError> {
        self.tree.take_sway(found)?;
        let document = &self.tree.document;
        put("nodes.csv", document.nodes_csv()?)?;
        if document.note.timing.is_of_film() {
            put(MODES_FILE, document.modes_csv()?)?;
        }
        let (model, animation) = glb(&self.tree.model())?;
        put(MODEL_FILE, model)?;
        if let Some(bytes) = self.picture_jpg.take() {
            put(PICTURE_FILE, bytes)?;
        }
        if let Some(bark) = &self.tree.document.bark {
            put(BARK_FILE, png(bark)?)?;
        }
        if let Some(at_rest) = &self.at_rest {
            for file in at_rest_files(at_rest)? {
                put(file.name, file.bytes)?;
            }
        }
        let note = &mut self.tree.document.note;
        note.animation = Some(animation);
        note.warnings = warnings;
        if let Some(judgement) = judgement {
            note.take_judgement(judgement);
        }
        put(NOTE_FILE, json(note)?)?;
        Ok(())
    }
}

/// A document all of whose files are made, before the first is written: until then a signal may end the
/// program at once.
pub struct ReadyDocument {
    pub tree: PreparedTree,
    pub files: Vec<NamedBytes>,
}

impl ReadyDocument {
    /// Makes the files of a tree that was not filmed. If it moves all the same, its poses are all of its
    /// motion.
    ///
    /// # Errors
    /// The tree is none for a model's file, or cannot be read back.
    pub fn of(draft: Draft, sway: &[Swaying]) -> Result<Self, PrepareError> {
        let warnings = draft.note.warnings.clone();
        let mut files = Vec::new();
        files.extend(motion_csv(&draft)?.map(|table| (MOTION_FILE.to_owned(), table)));
        let mut writer = DocumentWriter::new(draft)?;
        let put = &mut |name: &str, bytes: Vec<u8>| {
            files.push((name.to_owned(), bytes));
            Ok(())
        };
        writer.each_file(SwayFound::at_rest(sway), warnings, None, put)?;
        Ok(Self {
            tree: writer.tree,
            files,
        })
    }
}

/// Writes a document of a tree that was not filmed to `dir`, which appears when it is complete, or not at
/// all: also where `stop` is set meanwhile. If it moves all the same, its poses are all of its motion.
///
/// # Errors
/// `dir` is there already, a file cannot be written, it was stopped, or the tree is none for a model's
/// file.
pub fn write_document(
    dir: &Path,
    draft: Draft,
    sway: &[Swaying],
    stop: &AtomicBool,
) -> Result<(), PrepareError> {
    let ready = ReadyDocument::of(draft, sway)?;
    Ok(write_folder(dir, &ready.files, stop)?)
}

/// The table of the poses of a tree that was not filmed; `None` where it does not move.
fn motion_csv(draft: &Draft) -> Result<Option<Vec<u8>>, PrepareError> {
    if draft.poses.is_empty() {
        return Ok(None);
    }
    let skeleton = Arc::new(draft.skeleton.clone());
    let metres_per_px = draft.note.model.as_ref().map_or(0.0, |m| m.metres_per_px);
    let mut motion = MotionCsv::new(Vec::new(), &skeleton, metres_per_px)?;
    for pose in &draft.poses {
        motion.pose(pose)?;
    }
    Ok(Some(motion.finish()?))
}

/// Puts other answers on the sway into the document in `dir`: into `nodes.csv` and `modes.csv`,
/// into the model's file where there is one, and into what the capture was found to be worth where
/// it is known what that rests on.
///
/// # Errors
/// The document cannot be read; a file cannot be written, or it was stopped. A file is as it was or
/// new, never half-written.
pub fn update(dir: &Path, found: SwayFound, stop: &AtomicBool) -> Result<(), PrepareError> {
    let mut tree = as_it_is(Document::note(dir)?, dir)?;
    tree.take_sway(found)?;
    let of_modes = tree.document.modes_csv()?;
    let table = tree.document.nodes_csv()?;
    let (model, _) = glb(&tree.model())?;
    put(&dir.join("nodes.csv"), &table, stop)?;
    put(&dir.join(MODES_FILE), &of_modes, stop)?;
    if has_model(dir) {
        put(&dir.join(MODEL_FILE), &model, stop)?;
    }
    let Document { note, skeleton, .. } = &mut tree.document;
    if let Some(judgement) = note.judgement_with(skeleton, found.sway, found.modes, found.cut) {
        note.take_judgement(judgement);
        put(&dir.join(NOTE_FILE), &json(note)?, stop)?;
    }
    Ok(())
}

/// Puts other notes of the user into the document in `dir`: into `capture.json`, and into the
/// model's file where there is one.
///
/// # Errors
/// As of [`update`].
pub fn put_notes(dir: &Path, notes: &UserNotes, stop: &AtomicBool) -> Result<(), PrepareError> {
    let note = CaptureNote {
        notes: notes.clone(),
        ..Document::note(dir)?
    };
    let text = json(&note)?;
    if has_model(dir) {
        let (model, _) = glb(&as_it_is(note, dir)?.model())?;
        put(&dir.join(MODEL_FILE), &model, stop)?;
    }
    put(&dir.join(NOTE_FILE), &text, stop)?;
    Ok(())
}

/// The tree of the document in `dir` with its own settings, but for what `note` says otherwise.
fn as_it_is(note: CaptureNote, dir: &Path) -> Result<PreparedTree, PrepareError> {
    let config = note.config.clone();
    let mut document = Document::read(dir, config.export.animation_s)?;
    document.note = note;
    let options = TreeOptions {
        config,
        ..TreeOptions::default()
    };
    PreparedTree::new(document, options)
}

fn has_model(dir: &Path) -> bool {
    is_there(&dir.join(MODEL_FILE))
}

/// Whether there is a file of this name, or a link.
fn is_there(file: &Path) -> bool {
    std::fs::symlink_metadata(file).is_ok()
}

/// Replaces a file, unless it holds these bytes already; writes it where it is not there, as
/// `modes.csv` in a capture that was made before there was such a table.
fn put(file: &Path, bytes: &[u8], stop: &AtomicBool) -> Result<(), WriteError> {
    if std::fs::read(file).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    if let (false, Some(dir), Some(name)) = (is_there(file), file.parent(), file.file_name()) {
        let name = name.to_string_lossy().into_owned();
        return write_files(dir, &[(name, bytes.to_vec())], stop);
    }
    replace(file, bytes, stop)
}
