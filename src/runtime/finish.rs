//! temp
use super::shared::{Failure, Shared};
use crate::config::Config;
use crate::model::{Rgb, TrackSet};
use crate::pipeline::{Retrace, Tree};
use crate::recording::SpoolReader;
use crate::source::SourceInfo;
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
#[derive(Clone, Debug, Default)]
pub struct Quality {
    total: u64,
}
impl Quality {
    pub fn note(&mut self, t: &TrackSet, _e: f64) {
        self.total += u64::from(t.born);
    }
    pub fn tracks_total(&self) -> u64 {
        self.total
    }
}
#[derive(Clone, Debug)]
pub struct Written {}
pub struct CaptureJob {
    pub tree: Option<Arc<Tree>>,
    pub tracks: SpoolReader,
    pub config: Config,
    pub info: SourceInfo,
    pub quality: Quality,
    pub accumulation: f64,
    pub bark: Option<Arc<Rgb>>,
    pub shared: Arc<Shared>,
}
pub fn write(job: &CaptureJob, dir: &Path) -> Result<Written, Failure> {
    std::fs::create_dir_all(dir).unwrap();
    let mut t = std::io::BufWriter::new(std::fs::File::create(dir.join("tracks.csv")).unwrap());
    let mut m = std::io::BufWriter::new(std::fs::File::create(dir.join("motion.csv")).unwrap());
    let mut n = std::fs::File::create(dir.join("nodes.csv")).unwrap();
    writeln!(t, "track_id,frame,time_s,u_px,v_px,node_id").unwrap();
    writeln!(m, "frame,time_s,node_id,x,y,z,u_px,v_px").unwrap();
    writeln!(n, "node_id,parent_id,level,n_tracks,u_px,v_px,x,y,z,radius,frequency_hz,frequency_lo_hz,frequency_hi_hz,damping_ratio,damping_lo,damping_hi,identifiable").unwrap();
    let Some(tree) = &job.tree else { return Ok(Written {}) };
    let mut r = Retrace::new(tree, &job.config);
    for set in job.tracks.sets() {
        let p = r.step(&set.unwrap());
        for (i, j) in p.joints.iter().enumerate() {
            let [u, v] = tree.skeleton.image_from_model(&j.position);
            writeln!(
                m,
                "{},{:.6},{i},{:.5},{:.5},{:.5},{u:.3},{v:.3}",
                p.frame, p.time_s, j.position.x, j.position.y, j.position.z
            )
            .unwrap();
        }
    }
    for set in job.tracks.sets() {
        let set = set.unwrap();
        for o in &set.observations {
            let node = r.node_of(o.id).map_or(String::new(), |n| n.0.to_string());
            writeln!(t, "{},{},{:.6},{:.3},{:.3},{node}", o.id.0, set.frame, set.time_s, o.u_px, o.v_px).unwrap();
        }
    }
    for (i, k) in tree.skeleton.nodes.iter().enumerate() {
        let p = k.parent.map_or(String::new(), |n| n.0.to_string());
        let [u, v] = tree.skeleton.image_from_model(&k.position);
        writeln!(
            n,
            "{i},{p},{},{},{u},{v},{},{},{},{},,,,,,,false",
            k.level, k.n_tracks, k.position.x, k.position.y, k.position.z, k.radius
        )
        .unwrap();
    }
    Ok(Written {})
}
