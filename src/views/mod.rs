//! What is made of a document: its tree as it is wanted, ready for files and pictures. Every
//! view of a tree, be it at the end of a film or later, is written through [`PreparedTree`]; so a
//! view says the same whenever it is made.

mod drawn;
mod error;
mod film_fit;
mod film_lines;
mod forest;
mod forest_plan;
mod forest_studio;
mod loops;
mod offspring;
#[cfg(feature = "opencv")]
mod photo;
#[cfg(feature = "opencv")]
mod photo_forest;
mod prepared;
mod scan_film;
mod scan_forest;
mod scanned;
mod studio;
mod sway_on_scan;
mod tables;
mod write;

pub use drawn::{DrawnTree, modelled_defaults};
pub use error::PrepareError;
pub use film_fit::{FilmFit, Grounds};
pub use forest::PreparedForest;
pub use forest_plan::{ForestOptions, ForestPlan, HeightMap};
pub use forest_studio::ForestStudio;
pub use offspring::{
    Likeness, Offspring, OffspringMotion, OffspringOptions, Parent, outline_of as example_outline,
};
#[cfg(feature = "opencv")]
pub use photo::{
    Attracting, PhotoDepth, PhotoExample, PhotoGrowth, PhotoParts, PhotoTree, PhotoTreeError,
    photo_defaults,
};
#[cfg(feature = "opencv")]
pub use photo_forest::{StandingPlaces, photo_forest};
pub use prepared::{PreparedTree, TreeOptions};
pub use scan_film::{odd_pair_of, register_film};
pub use scan_forest::{StandingTree, scan_forest};
pub use scanned::{FilmOnScan, scan_defaults};
pub use studio::{FilmPlace, Shot, Studio, VIDEO_S};
pub use sway_on_scan::{FilmedPoint, ScanSway, filmed_points, sway_on_scan};
pub use tables::TablesWritten;
pub use write::{
    DocumentWriter, Draft, ReadyDocument, SwayFound, put_notes, update, write_document,
};
