//! A forest as files in a folder, beside the documents of its templates: `forest.json` says how it
//! was made, `forest.csv` where each tree stands, and `ground.png` holds the heights of the ground
//! where it is not level.

use super::error::DocumentError;
use super::note::Software;
use super::png;
use super::table::{TableReader, TableWriter};
use crate::files::WriteError;
use crate::model::{Forest, ForestTree, Ground, Size};
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use std::io::{ErrorKind, Read};
use std::path::{Component, Path, PathBuf};

/// Names of the files.
pub const FOREST_FILE: &str = "forest.json";
pub const FOREST_TREES_FILE: &str = "forest.csv";
pub const GROUND_FILE: &str = "ground.png";

/// Version of `forest.json`.
const SCHEMA_VERSION: u32 = 1;
/// Samples of the ground along a side, at most.
pub const MOST_GROUND_SAMPLES: u32 = 257;
/// Trees of a forest, at most.
const MOST_TREES: usize = 1_000_000;
const COLUMNS: [&str; 8] = [
    "tree", "template", "x", "y", "z", "turn_deg", "scale", "ahead",
];

/// `forest.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForestNote {
    pub schema_version: u32,
    pub software: Software,
    /// Name of what the templates were grown from.
    pub example: String,
    pub seed: u64,
    pub trees: u64,
    /// Folders of the templates, beside this file.
    pub templates: Vec<String>,
    /// Least distance between two trunks, m.
    pub spacing_m: f64,
    /// Metres in a pixel of the templates.
    pub metres_per_px: f64,
    /// Where that comes from: `measured`, or `height` where a height was given or assumed.
    pub scale: String,
    pub ground: GroundNote,
}

/// The plot. Its middle is the origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroundNote {
    /// Along x and along z, m.
    pub width_m: f64,
    pub depth_m: f64,
    /// From black to white in `heights`, m.
    pub relief_m: f64,
    /// A grey picture, its first row the farthest; none where the ground is level.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heights: Option<String>,
}

/// A forest that has been read.
#[derive(Clone, Debug, PartialEq)]
pub struct ForestDocument {
    pub dir: PathBuf,
    pub note: ForestNote,
    pub forest: Forest,
}

/// A file of a forest and its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ForestFileBytes {
    pub name: &'static str,
    pub bytes: Vec<u8>,
}

/// What is said of a forest that is to be written, apart from its trees.
#[derive(Clone, Debug)]
pub struct ForestOrigin {
    pub example: String,
    pub seed: u64,
    /// Folders of the templates.
    pub templates: Vec<String>,
    pub spacing_m: f64,
    /// `measured` or `height`.
    pub scale: &'static str,
}

impl ForestDocument {
    /// Whether the folder holds a forest.
    pub fn is_in(dir: &Path) -> bool {
        dir.join(FOREST_FILE).is_file()
    }

    /// Reads the forest in `dir`, without its templates.
    ///
    /// # Errors
    /// The folder holds none, it was written by a newer version, or a file is missing or damaged.
    pub fn read(dir: &Path) -> Result<Self, DocumentError> {
        let file = dir.join(FOREST_FILE);
        let text = std::fs::read(&file).map_err(|source| match source.kind() {
            ErrorKind::NotFound | ErrorKind::NotADirectory => {
                DocumentError::no_document(dir, FOREST_FILE)
            }
            _ => DocumentError::Unreadable {
                file: file.clone(),
                source,
            },
        })?;
        let note = parse(&file, &text)?;
        let samples = match &note.ground.heights {
            Some(_) => Some(heights(dir).map_err(|what| DocumentError::note(&file, what))?),
            None => None,
        };
        let table = TableReader::open(dir, FOREST_TREES_FILE, COLUMNS)?;
        Self::of_parts(dir, note, samples, table)
    }

    /// The files of a forest, and the forest that would be read from them.
    ///
    /// # Errors
    /// It has no form in a file: it has no trees, too many, or a number is none.
    pub fn as_written(
        dir: &Path,
        forest: &Forest,
        origin: ForestOrigin,
    ) -> Result<(Self, Vec<ForestFileBytes>), DocumentError> {
        let ground = &forest.ground;
        let level = ground.is_flat();
        let note = ForestNote {
            schema_version: SCHEMA_VERSION,
            software: Software::default(),
            example: origin.example,
            seed: origin.seed,
            trees: forest.trees.len() as u64,
            templates: origin.templates,
            spacing_m: origin.spacing_m,
            metres_per_px: forest.metres_per_px,
            scale: origin.scale.to_owned(),
            ground: GroundNote {
                width_m: ground.width_m,
                depth_m: ground.depth_m,
                relief_m: ground.relief_m,
                heights: (!level).then(|| GROUND_FILE.to_owned()),
            },
        };
        let table = trees_csv(forest, &note.templates)?;
        let mut text =
            serde_json::to_vec_pretty(&note).map_err(|e| WriteError::no_form(FOREST_FILE, e))?;
        text.push(b'\n');
        let mut files = vec![
            ForestFileBytes {
                name: FOREST_TREES_FILE,
                bytes: table.clone(),
            },
            ForestFileBytes {
                name: FOREST_FILE,
                bytes: text.clone(),
            },
        ];
        let mut samples = None;
        if !level {
            files.push(ForestFileBytes {
                name: GROUND_FILE,
                bytes: png::grey16_png(ground.samples, &ground.heights)?,
            });
            samples = Some(Heights {
                samples: ground.samples,
                heights: ground.heights.clone(),
            });
        }
        let note = parse(&dir.join(FOREST_FILE), &text)?;
        let rows = TableReader::new(dir.join(FOREST_TREES_FILE), &table[..], COLUMNS)?;
        Ok((Self::of_parts(dir, note, samples, rows)?, files))
    }

    fn of_parts<R: Read>(
        dir: &Path,
        note: ForestNote,
        heights: Option<Heights>,
        mut table: TableReader<R, 8>,
    ) -> Result<Self, DocumentError> {
        let mut trees = Vec::new();
        while table.next()? {
            if trees.len() == MOST_TREES {
                return Err(table.bad(format!("there are more than {MOST_TREES} trees")));
            }
            trees.push(tree(&table, &note.templates)?);
        }
        if trees.is_empty() {
            return Err(table.bad_end("there are no trees"));
        }
        let mut ground = Ground::flat(note.ground.width_m, note.ground.depth_m);
        if let Some(heights) = heights {
            ground = Ground {
                relief_m: note.ground.relief_m,
                samples: heights.samples,
                heights: heights.heights,
                ..ground
            };
        }
        let metres_per_px = note.metres_per_px;
        Ok(Self {
            dir: dir.to_owned(),
            note,
            forest: Forest {
                trees,
                ground,
                metres_per_px,
            },
        })
    }

    /// The folders of the templates, in their order.
    pub fn template_dirs(&self) -> Vec<PathBuf> {
        let names = self.note.templates.iter();
        names.map(|name| self.dir.join(name)).collect()
    }
}

/// Samples of the ground.
struct Heights {
    samples: Size,
    heights: Vec<u16>,
}

fn heights(dir: &Path) -> Result<Heights, String> {
    let most = Size::new(MOST_GROUND_SAMPLES, MOST_GROUND_SAMPLES);
    let grey = png::read(dir, GROUND_FILE, most)?.into_luma16();
    Ok(Heights {
        samples: Size::new(grey.width(), grey.height()),
        heights: grey.into_raw(),
    })
}

fn parse(file: &Path, text: &[u8]) -> Result<ForestNote, DocumentError> {
    let note: ForestNote =
        serde_json::from_slice(text).map_err(|e| DocumentError::note(file, e.to_string()))?;
    if note.schema_version > SCHEMA_VERSION {
        return Err(DocumentError::Newer {
            file: file.to_owned(),
            what: format!("schema_version {}", note.schema_version),
        });
    }
    let ground = &note.ground;
    let lengths = [ground.width_m, ground.depth_m, note.metres_per_px];
    let sound = lengths.iter().all(|x| (1e-9..1e9).contains(x)) && ground.relief_m.is_finite();
    if !sound {
        return Err(DocumentError::note(
            file,
            "a length is no length of a forest",
        ));
    }
    if note.templates.is_empty() || !note.templates.iter().all(|name| is_plain(name)) {
        return Err(DocumentError::note(
            file,
            "the templates must be names of folders beside it",
        ));
    }
    Ok(note)
}

/// Whether a name is that of something in the same folder.
fn is_plain(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    matches!(parts.next(), Some(Component::Normal(_))) && parts.next().is_none()
}

fn tree<R: Read>(
    row: &TableReader<R, 8>,
    templates: &[String],
) -> Result<ForestTree, DocumentError> {
    let name = row.cell(1);
    let template = templates.iter().position(|t| t == name);
    let template = template.ok_or_else(|| row.bad(format!("{name:?} is none of the templates")))?;
    let scale = row.number(6, "scale")?;
    let ahead: u8 = row.whole(7, "ahead")?;
    if scale <= 0.0 || scale > 1e3 || ahead >= Forest::STEPS_AHEAD {
        return Err(row.bad("scale or ahead is out of its range"));
    }
    Ok(ForestTree {
        template,
        foot: Point3::new(
            row.number(2, "x")?,
            row.number(3, "y")?,
            row.number(4, "z")?,
        ),
        turn_rad: row.number(5, "turn_deg")?.to_radians(),
        scale,
        ahead,
    })
}

fn trees_csv(forest: &Forest, templates: &[String]) -> Result<Vec<u8>, WriteError> {
    let mut table = TableWriter::new(FOREST_TREES_FILE, &COLUMNS.join(","), Vec::new())?;
    for (k, tree) in forest.trees.iter().enumerate() {
        table.count(k as u64 + 1);
        table.text(templates.get(tree.template).map_or("", String::as_str));
        for x in [tree.foot.x, tree.foot.y, tree.foot.z] {
            table.number(x, 4);
        }
        table.number(tree.turn_rad.to_degrees(), 3);
        table.number(tree.scale, 5);
        table.count(tree.ahead);
        table.end_row()?;
    }
    table.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn forest() -> Forest {
        let tree = ForestTree {
            template: 1,
            foot: Point3::new(1.5, 0.25, -2.0),
            turn_rad: 1.0,
            scale: 0.9,
            ahead: 3,
        };
        Forest {
            trees: vec![
                tree,
                ForestTree {
                    template: 0,
                    ahead: 0,
                    ..tree
                },
            ],
            ground: Ground {
                width_m: 20.0,
                depth_m: 10.0,
                relief_m: 2.0,
                samples: Size::new(3, 2),
                heights: vec![0, 1, 2, 300, 40_000, u16::MAX],
            },
            metres_per_px: 0.02,
        }
    }

    fn origin() -> ForestOrigin {
        ForestOrigin {
            example: "a film".into(),
            seed: 4,
            templates: vec!["tree-0001".into(), "tree-0002".into()],
            spacing_m: 3.0,
            scale: "height",
        }
    }

    fn write(dir: &Path, forest: &Forest) -> ForestDocument {
        let (document, files) = ForestDocument::as_written(dir, forest, origin()).expect("files");
        for file in files {
            std::fs::write(dir.join(file.name), file.bytes).expect("written");
        }
        document
    }

    #[test]
    fn what_is_read_is_what_was_written() {
        let dir = tempfile::tempdir().expect("a folder");
        assert!(!ForestDocument::is_in(dir.path()));
        let hilly = write(dir.path(), &forest());
        assert!(ForestDocument::is_in(dir.path()));
        assert_eq!(ForestDocument::read(dir.path()).expect("read"), hilly);
        assert_eq!(hilly.forest.ground, forest().ground);
        for (tree, own) in hilly.forest.trees.iter().zip(forest().trees) {
            assert!((tree.foot - own.foot).norm() < 1e-4);
            assert!((tree.turn_rad - own.turn_rad).abs() < 1e-5);
            assert_eq!((tree.template, tree.ahead), (own.template, own.ahead));
        }
        let level = tempfile::tempdir().expect("a folder");
        let flat = Forest {
            ground: Ground::flat(20.0, 10.0),
            ..forest()
        };
        let level_document = write(level.path(), &flat);
        assert!(!level.path().join(GROUND_FILE).exists());
        assert_eq!(
            ForestDocument::read(level.path()).expect("read"),
            level_document
        );
    }

    #[test]
    fn damage_is_refused() {
        let cases: [(&str, &str, &str); 8] = [
            (FOREST_TREES_FILE, "tree-0002", "tree-0009"),
            (FOREST_TREES_FILE, "0.9", "-1"),
            (FOREST_TREES_FILE, "1.5", "far"),
            (FOREST_TREES_FILE, ",3\n", ",4\n"),
            (FOREST_FILE, "\"tree-0001\"", "\"../other\""),
            (FOREST_FILE, "\"width_m\": 20.0", "\"width_m\": 0.0"),
            (
                FOREST_FILE,
                "\"schema_version\": 1",
                "\"schema_version\": 2",
            ),
            (FOREST_FILE, "{", "["),
        ];
        for (file, old, new) in cases {
            let dir = tempfile::tempdir().expect("a folder");
            write(dir.path(), &forest());
            let file = dir.path().join(file);
            let text = std::fs::read_to_string(&file).expect("text");
            assert!(text.contains(old), "{old} is not in {text}");
            std::fs::write(&file, text.replacen(old, new, 1)).expect("written");
            let error = ForestDocument::read(dir.path()).expect_err(new).to_string();
            assert!(
                error.contains("forest.") && !error.contains('\n'),
                "{error}"
            );
        }
        let dir = tempfile::tempdir().expect("a folder");
        write(dir.path(), &forest());
        std::fs::write(dir.path().join(GROUND_FILE), b"no picture").expect("written");
        assert!(ForestDocument::read(dir.path()).is_err());
    }
}
