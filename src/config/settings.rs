//! Every setting, declared once: key, type, range, default, text, and when a change of it counts
//! for a capture that is running. `config/arborcam.toml`, the tables in `docs/settings.md`, help
//! texts and the check are made from this; see `declare.rs` for the notation.
//!
//! The text is for users: what the setting is, with its unit, and when to change it. Lengths "at
//! 640 px" are for a picture 640 pixels wide and grow with the picture.

use super::declare::{choice, first, range, settings};
use super::depth_camera::DepthCamera;
use super::markers::{MarkerCorrection, MarkerWindow};
use super::setting::Effect::{self, NextStart, Now};
use super::setting::{Choice, Range, Section, Setting, SettingValue};
use serde::{Deserialize, Serialize};

const CAMERA: Effect = NextStart("the camera would have to be stopped, and frames be lost");
const OUTLINE: Effect = NextStart("the outline is looked for once, at the start");
const POINTS: Effect = NextStart("the points that are followed would have to be given up");
const TREE: Effect = NextStart("the tree would have to be built anew");
const WOOD: Effect = NextStart("the branches' thickness comes from it, and is in the tree already");
const LEAVES: Effect = NextStart("the tree would have to be dressed anew");
const POSES: Effect = NextStart("the poses before and after would not fit together");
const DYNAMICS: Effect = NextStart("one capture has one rule by which a sway counts as known");
const ANIMATION: Effect = NextStart("older poses have been discarded already");
const SCALE: Effect = NextStart("one capture has one scale");

settings! {
    /// What is asked of a camera. One that gives something else is refused, unless accept_format
    /// is true.
    camera: Camera, CAMERA {
        /// Pixel format. Change it only if a format must be forced.
        format: CameraFormat = CameraFormat::Auto;
        /// Width of the picture, px. More pixels show thinner twigs and cost time. Change size and
        /// rate if the camera offers others (`arborcam devices`) or USB is slow.
        width: u32 [16 to 16384] = 1280;
        /// Height of the picture, px.
        height: u32 [16 to 16384] = 720;
        /// Frames per second. A tree sways slowly: 30 is enough.
        rate_hz: u32 [1 to 1000] = 30;
        /// Take what the camera gives if it is not what was asked for.
        accept_format: bool = false;
        /// A camera that is silent for this time counts as hung, s. More for a camera that starts
        /// slowly.
        timeout_s: f64 [0.05 to 3600] = 3.0, Now;
        /// Wait for a camera that was unplugged or hung, and go on (true), or end the capture
        /// (false).
        reconnect: bool = true, Now;
        /// A lost camera that is there again but does not start is tried again after this time, s.
        retry_delay_s: f64 [0.05 to 3600] = 0.5, Now;
        /// What the camera is read through. Change it if the camera fails with v4l2; nokhwa gives
        /// neither capture times nor frame counts (see docs/camera.md).
        backend: Backend = Backend::V4l2;
    }

    /// Finding the tree by its motion, where no outline is given.
    outline: Outline, OUTLINE {
        /// Motion is gathered for this time before the region is drawn, s.
        gather_s: f64 [0.1 to 60] = 2.0;
        /// If nothing moves for this time, the whole picture is taken, s.
        give_up_s: f64 [0.1 to 3600] = 20.0;
    }

    /// Points to follow: Harris corners inside the outline (Li 2011 app. A, Zeng 2015 sect. 5.3.2).
    detect: Detect, POINTS {
        /// Number of points; the papers take 300 to 400. Twice as many are tried, and the better
        /// half is kept. Fewer if the machine is slow, more if the tree is large and rich in
        /// detail.
        points: u32 [16 to 2000] = 400;
        /// Least distance between two points, px at 640 px. More if points crowd together on the
        /// trunk.
        min_distance_px: f64 [1 to 100] = 5.0;
        /// Weakest corner response that is taken, as a share of the strongest. Lower it for flat
        /// light.
        quality: f64 [above 0, at most 1] = 0.0005;
        /// Points nearer to the border of the outline than this are not taken, px at 640 px.
        border_px: f64 [0 to 100] = 5.0;
    }

    /// Following the points from frame to frame: pyramidal Lucas-Kanade with a forward-backward
    /// check.
    track: Track, POINTS {
        /// Side of the window that is compared, px; an odd number.
        window_px: u32 [5 to 61] = 15;
        /// How often the picture is halved for large motion. Each level doubles the reach.
        levels: u32 [0 to 6] = 3;
        /// Largest distance between a point and itself tracked forward and back, px.
        fb_limit_px: f64 [above 0] = 1.0;
        /// A point is compared with the picture it was detected in once in this number of frames,
        /// which removes drift; 0 is never.
        anchor_every: u32 = 2;
        /// Least normalised cross-correlation with that picture for the point to be put back on it.
        anchor_ncc: f64 [0 to 1] = 0.6;
        /// Whether the camera's own motion, by what stands still around the outline, is taken off.
        steady: bool = true;
        /// A point that is hidden moves with its neighbours for this time before it is given up, s.
        coast_s: f64 [0 to 60] = 5.0;
    }

    /// Coloured markers on branches, followed by their hue (Hu et al. sect. 5.1). See docs/markers.md.
    markers: Markers, POINTS {
        /// Looks for the markers in the first frame: blobs of the hue hue_deg. `--markers auto` sets it.
        find: bool = false;
        /// The markers with their windows in the first frame, px; `--markers FILE` sets them.
        windows: Vec<MarkerWindow> = Vec::new();
        /// Places of markers in single frames, where they could not be followed; from the same file.
        corrections: Vec<MarkerCorrection> = Vec::new();
        /// How a window follows its marker.
        method: MarkerMethod = MarkerMethod::MeanShift;
        /// Hue of the markers that are looked for, degrees on the circle of colours: 0 is red, 120
        /// green, 240 blue.
        hue_deg: f64 [0 to 360] = 0.0;
        /// Hues that are no farther from it count as the same, degrees.
        hue_width_deg: f64 [1 to 90] = 12.0;
        /// Bins of the histogram of hues.
        hue_bins: u32 [8 to 180] = 32;
        /// Pixels with less saturation have no hue. Lower it for pale markers and dim light, raise it
        /// if the background is taken for markers.
        least_saturation: u32 [0 to 255] = 100;
        /// The same for pixels that are darker than this.
        least_value: u32 [0 to 255] = 50;
    }

    /// A printed square beside the trunk (AprilTag 36h11), which gives the scale. See docs/markers.md.
    tag: Tag, SCALE {
        /// Side of its black square, m; `--tag` sets it.
        size_m: f64 [0 ("none") to 5] = 0.0;
        /// Angle that the longer side of the picture spans, degrees. Give it if it is known, above all for a
        /// lens that zooms: a tag off the middle gives the scale more sharply then.
        field_of_view_deg: f64 [0 ("unknown") to 170] = 0.0;
    }

    /// Depth beside the colours, where the film has it. See docs/depth.md.
    depth: Depth, SCALE {
        /// Take it (true), or the colours alone (false); `--no-depth`.
        read: bool = true;
        /// Metres for each count of a depth image, e.g. 0.001; `--depth-unit` sets it. Give it where the
        /// film or the camera does not say it.
        unit_m: f64 [0 ("as the film says") to 1] = 0.0;
        /// How much later depth images are stamped than they were taken, by the clock of the pictures, s; below 0
        /// where they are stamped too early. `--depth-late` sets it.
        late_s: f64 [-0.25 to 0.25] = 0.0;
        /// Standard deviation of a depth that is the same at any distance, m. Give it for a camera that
        /// times light: 0.005 to 0.02.
        noise_m: f64 [0 to 10] = 0.0;
        /// The same at 1 m where it grows with the square of the distance, as with stripes or two
        /// cameras, m. The default was measured on a first Kinect (Khoshelham and Elberink 2012); 0 for
        /// a camera that times light, 0.002 to 0.004 for two cameras near each other.
        noise_per_m: f64 [0 to 1] = 0.001425;
        /// Focal length of the colour camera across, px; `--depth-camera` sets it and the next three.
        /// Give them where the film does not say them.
        fx_px: f64 [0 ("as the film says") or more] = 0.0;
        /// Focal length of the colour camera down, px.
        fy_px: f64 [0 ("as the film says") or more] = 0.0;
        /// Where the camera's axis meets the picture, px from the left.
        cx_px: f64 [0 or more] = 0.0;
        /// Where the camera's axis meets the picture, px from the top.
        cy_px: f64 [0 or more] = 0.0;
        /// How its lens distorts, up to eight numbers in the order of OpenCV: k1, k2, p1, p2, k3, k4, k5,
        /// k6; `--depth-camera` sets it. Empty: as the film says where it says the camera, else not at all.
        distortion: Vec<f64> = Vec::new();
        /// The depth camera, where its images are not registered with the colours, none or one:
        /// `[{width, height, fx_px, fy_px, cx_px, cy_px, rotation, translation_m}]`; `--depth-camera`
        /// sets it.
        own_camera: Vec<DepthCamera> = Vec::new();
        /// A device with depth beside the camera that films, `/dev/video2` or its permanent name;
        /// `--depth` sets it. Empty: none.
        device: String = String::new();
    }

    /// When enough motion has been seen to build the tree.
    accumulate: Accumulate, TREE {
        /// Motion older than this is forgotten, s.
        window_s: f64 [1 to 120] = 20.0;
        /// The tree is not built before this much film, s; at most nine tenths of window_s. More if
        /// the build should wait for more motion.
        min_s: f64 [0.2 to 100] = 8.0;
        /// Measure of accumulated motion from which on the tree is built. Lower builds sooner and
        /// worse. Less if the tree is never built, more if it is built too early.
        threshold: f64 [0 to 1] = 0.4;
        /// A point moves if its displacement is this many times the tracking noise.
        moving_snr: f64 [above 0] = 4.0;
        /// For this time after it was built the tree is refined as more is seen, s. 0 keeps the
        /// tree as it was built.
        refine_s: f64 [0 ("never") to 3600] = 120.0;
    }

    /// Which points move together: the tree as the motion shows it, by average linkage or recursive
    /// normalised cuts (Li 2011 app. A, Zeng 2015 sect. 5.4.1).
    hierarchy: Hierarchy, TREE {
        /// Levels of the tree, the whole tree included; the papers take 4 to 7. 5 or 6 if fewer,
        /// larger branches are wanted (see docs/sweep.md).
        levels: u32 [2 to 10] = 7;
        /// How points are grouped. For the method of the papers to the letter set zeng,
        /// max_children = 2 and min_certainty = 0.
        affinity: Affinity = Affinity::Path;
        /// path: power of the similarity of motion. Higher trusts only what moves very much alike.
        motion_power: f64 [0.1 to 32] = 4.0;
        /// path: weight of the path from the foot that two points share. Higher gives more weight
        /// to where points are.
        path_weight: f64 [0 to 100] = 4.0;
        /// zeng: reach of the distance affinity, as a share of the extent of the part that is cut.
        /// Lower makes compact branches.
        distance_scale: f64 [above 0] = 1.0;
        /// zeng: power of the velocity correlation; 1 is the paper's. Higher gives more weight to
        /// motion and less to distance.
        correlation_power: f64 [0.1 to 32] = 1.0;
        /// Branches that may leave at one place where it is not sure which leaves first; 2 is the
        /// papers'.
        max_children: u32 [2 to 64] = 4;
        /// Splits less certain than this are not made. At 0.5 chance might give the same. More if
        /// only certain forks are wanted; 0 makes every split.
        min_certainty: f64 [0 to 1] = 0.5;
        /// Points whose motion correlates less than this with that of the points around them are
        /// left out; -1 leaves none out.
        agreement: f64 [-1 to 1] = 0.7;
        /// Groups of fewer points are not cut.
        min_points: u32 [2 to 1000] = 4;
    }

    /// The skeleton in the picture (Li 2011 app. A).
    skeleton: Skeleton, TREE {
        /// A branching is drawn towards its parent by this share of the way.
        fold: f64 [0 to 0.95] = 0.4;
        /// Looks for the wood that the frames show, and lets the skeleton run along it. false for
        /// straight branches between the forks of the motion alone.
        along_wood: bool = true;
        /// How branches are traced in the wood that is seen.
        trace_by: TraceBy = TraceBy::Paths;
        /// Lines along branches that the user drew, px of the picture, each of at least two points;
        /// `--branch-stroke FILE` adds one, and so does key s.
        strokes_px: Vec<Vec<[f64; 2]>> = Vec::new();
    }

    /// The skeleton in space: what the camera does not see is estimated (Li 2011 sect. 3).
    shape: Shape, TREE {
        /// Planes about the trunk that carry branches, the filmed one included. 2 if the model is
        /// too dense; 1 leaves only the branches that were filmed, without copies.
        planes: u32 [1 to 8] = 3;
        /// Copies the branches of a tree that was filmed bare, too, though all of them are seen.
        copy_bare: bool = false;
        /// The space that branches are pushed to fill. hull if the outline was drawn much wider
        /// than the crown.
        envelope: EnvelopeKind = EnvelopeKind::Revolution;
        /// Points around the crown that pull branches out; the paper takes 200 to 300.
        attractors: u32 [8 to 5000] = 256;
        /// A branch is pushed out of its plane by at most this share of the tree's width. Less if
        /// branches stray too far from where the film shows them.
        push_range: f64 [0 to 2] = 0.2;
        /// Number of pushes that are tried for each branch. An odd number includes no push at all.
        push_options: u32 [1 to 1001] = 41;
        /// How often the tree is processed from root to tip; 1 is the paper's. More fills the
        /// space better at likelier angles.
        passes: u32 [1 to 20] = 3;
        /// Width of the distribution of branching angles, as a multiple of the paper's. Less if
        /// branches fork oddly, more if the crown has holes.
        angle_tolerance: f64 [0.01 to 100] = 1.0;
        /// What of the crown is trunk, which is neither copied nor pushed. auto for a conifer: one
        /// trunk to the tip (Li 2011 fig. 9).
        leader: Leader = Leader::None;
        /// The trunk as it was drawn, from the foot up, px of the picture; `--trunk FILE` sets it.
        leader_px: Vec<[f64; 2]> = Vec::new();
    }

    /// Space colonisation of a point cloud (`cloud --method colonisation` or `runions`). See docs/clouds.md.
    cloud: Cloud, TREE {
        /// Length of a step D, in distances of points. More for a coarser tree.
        step_cells: f64 [0.5 to 50] = 2.0;
        /// How near a node is to a point that it has reached (d_k), steps. More where strands of one branch run side
        /// by side.
        kill_steps: f64 [0 ("1, with runions 2") to 50] = 0.0;
        /// How near it is to a point that draws it (d_i), steps; more than kill_steps. More to grow over wider gaps.
        influence_steps: f64 [0 ("2, with runions 8") to 100] = 0.0;
    }

    /// The wood that is drawn: curl, twigs, thickness, mesh (Li 2011 sect. 3).
    wood: Wood, WOOD {
        /// How far branches leave the straight line between their ends, 0 is straight. Their ends
        /// stay. Less if branches are too wavy.
        curl: f64 [0 to 1] = 0.5;
        /// Twigs are added down to this length, px at 640 px. They are small copies of the tree's
        /// own branches, and stay within the outline. More if the tree is too dense.
        twig_px: f64 [0 ("no twigs") to 500] = 9.0;
        /// Number of twigs that are added at most; the longest are taken.
        max_twigs: u32 [0 to 50000] = 2000;
        /// Width of the trunk, px of the picture. As outlines are drawn wide, half of what is
        /// measured is taken. Set it if the trunk is too thick or too thin.
        trunk_width_px: f64 [0 ("measured") to 1000] = 0.0;
        /// Triangles of the wood at its finest level of detail; two more levels have a half and a
        /// quarter. 10000 to 100000 for a lighter or a finer model.
        triangles: u32 [100 to 1000000] = 30_000;
        /// Seed of the random numbers: another number gives other twigs and curls on the same
        /// branches.
        seed: u32 = 1;
    }

    /// The leaves: where the picture shows them, in its colours (Li 2011 app. B and sect. 6).
    leaves: Leaves, LEAVES {
        /// Whether the tree is drawn in leaf. off if leaves are drawn on a bare tree, on if none
        /// are drawn on a tree in leaf.
        show: LeafShow = LeafShow::Auto;
        /// Corners that are looked for in the picture, one cluster of leaves at each.
        seeds: u32 [400 to 5000] = 1500;
        /// Triangles of all leaves at most. With fewer triangles, fewer and larger leaves cover the
        /// same area. Less if the file is too large, more if the leaves are too coarse.
        triangles: u32 [1000 to 200000] = 20_000;
        /// Frequency at which leaves oscillate on their branch, Hz. Less if they tremble too fast.
        frequency_hz: f64 [0.1 to 10] = 3.0;
        /// How far leaves turn to either side at most, degrees. 0 moves them with their branch
        /// only.
        swing_deg: f64 [0 to 60] = 20.0;
        /// Speed of a branch at which its leaves turn three quarters as far as that, heights of the
        /// tree per second.
        swing_speed: f64 [0.01 to 10] = 0.3;
    }

    /// The 3D pose of every frame (Li 2011 sect. 4).
    motion: Motion, POSES {
        /// How tracks become poses.
        method: MotionMethod = MotionMethod::Probabilistic;
        /// Standard deviation of the tracked positions, px (Li 2011 eq. 8). Higher is calmer and
        /// follows less: more if tracks are noisy and branches bend oddly.
        sigma_track_px: f64 [above 0] = 1.0;
        /// Standard deviation of the branching angle at the root, degrees (Li 2011 eq. 10): how far
        /// a branch may bend out of its shape.
        sigma_shape_root_deg: f64 [above 0] = 10.0;
        /// The same at the tips, degrees.
        sigma_shape_tip_deg: f64 [above 0] = 30.0;
        /// Standard deviation of the speed at which a branch leans towards the camera or away,
        /// degrees per second. The picture hardly shows it; higher follows faster and trembles more
        /// when the tree is seen from the side.
        depth_rate_deg_s: f64 [above 0] = 60.0;
        /// Largest rotation of a branch against its parent from one frame to the next (in 1/30 s,
        /// where frames are rarer), degrees.
        max_step_deg: f64 [0.01 to 180] = 20.0;
        /// Largest rotation of a branch against its parent from its rest, degrees.
        max_total_deg: f64 [0.01 to 180] = 70.0;
    }

    /// How the branches sway: frequency and damping (Hu et al. sect. 5).
    dynamics: Dynamics, DYNAMICS {
        /// What made the tree sway. Set it if wind is taken for a release, or the other way round.
        excitation: Excited = Excited::Auto;
        /// The last seconds of a film that are analysed, s. More if the release is farther back.
        window_s: f64 [5 to 600] = 60.0;
        /// Frequencies are estimated again after this much film, s, or when it has grown by a tenth
        /// if that is later. More if the machine is slow, or if `--fast` with `--stream` takes too
        /// long.
        every_s: f64 [0 ("only at the end") to 600] = 1.0;
        /// Highest frequency that a branch may have, Hz. More if the tree is small and sways
        /// faster; less if a film of few frames per second says "above_sampling" and nothing sways
        /// so fast.
        highest_hz: f64 [0.5 to 20] = 5.0;
        /// A frequency counts as identified if half its 95 % interval is at most this share of it.
        /// More if less certain frequencies are wanted too.
        widest: f64 [0.001 to 0.5] = 0.05;
    }

    /// `arborcam animate`: the wind, and how the tree responds to it (Hu et al. sect. 6). Nothing
    /// that is captured depends on it.
    wind: Wind, Now {
        /// Strength on the Beaufort scale; 2 is a light breeze, 6 a strong one, 10 a storm.
        force: f64 [0 ("still") to 12] = 4.0;
        /// Where it blows to, degrees about the trunk; 0 is to the right of the picture, 90 away
        /// from the camera.
        direction_deg: f64 [-360 to 360] = 0.0;
        /// Standard deviation of its speed, as a share of the mean.
        gusts: f64 [0 ("steady") to 1] = 0.35;
        /// Duration of gusts, s: below one in this time the spectrum is flat.
        gust_s: f64 [0.5 to 60] = 6.0;
        /// The power of gusts falls with their frequency to the minus beta; 0 is wild, 4 is smooth,
        /// 5/3 is turbulent air.
        beta: f64 [0 to 4] = 5.0 / 3.0;
        /// Height of a tree that was captured without a scale, m: gusts take their time across it.
        tree_height_m: f64 [0.1 to 100] = 10.0;
        /// Sway frequency of the trunk where the capture has no frequency at all, Hz. More if the
        /// tree sways too slowly.
        trunk_hz: f64 [0.02 to 10] = 0.7;
        /// Damping ratio where the capture has none. More if the tree sways for too long.
        damping_ratio: f64 [0.001 to 1] = 0.06;
        /// How far a branch leans against its parent in steady wind of force 6, degrees; the
        /// median. Less if the tree bends too much in the wind, more if it bends too little.
        bend_deg: f64 [0.01 to 20] = 1.5;
        /// Largest rotation of a branch against its parent, degrees.
        max_bend_deg: f64 [1 to 80] = 40.0;
        /// Seed of the random numbers: another number gives other gusts.
        seed: u32 = 1;
    }

    /// The files that are written.
    export: Export, SCALE {
        /// Length of the animation in tree.glb at most, s. The last seconds of a longer capture are
        /// taken.
        animation_s: f64 [0.1 to 3600] = 60.0, ANIMATION;
        /// Metres in a pixel at the tree; lengths of the model are then in metres.
        metres_per_px: f64 [0 ("pixels") or more] = 0.0;
        /// Leaves swing on their own in the animation of a model's file, as morph targets of a mesh
        /// for each main branch. Otherwise they are one mesh that the branches move, which Blender
        /// reads with one action. Pictures and videos always show the swing.
        leaf_swing: bool = false;
    }
}

choice! {
    /// How a window follows its marker.
    MarkerMethod {
        /// the window keeps its size (Hu et al. sect. 5.1)
        MeanShift = "mean-shift",
        /// the window grows and shrinks with the marker (Bradski 1998)
        CamShift = "camshift",
    }
}

choice! {
    /// What a camera is read through.
    Backend {
        V4l2 = "v4l2",
        Nokhwa = "nokhwa",
    }
}

choice! {
    /// Pixel format of a camera.
    CameraFormat {
        /// the best that the camera lists at this size and rate
        Auto = "auto",
        Mjpeg = "mjpeg",
        Yuyv = "yuyv",
        Uyvy = "uyvy",
        Nv12 = "nv12",
        Grey = "grey",
        Rgb24 = "rgb24",
    }
}

choice! {
    /// How points are grouped.
    Affinity {
        /// average linkage
        Path = "path",
        /// normalised cuts on distance and velocity correlation, as in the papers
        Zeng = "zeng",
    }
}

choice! {
    /// How branches are traced.
    TraceBy {
        /// the cheapest paths through the middle of the wood, Sato et al. 2000
        Paths = "paths",
        /// a circle that is moved along the wood, Tan et al. 2008 sect. 2.2
        Circles = "circles",
    }
}

choice! {
    /// The space that branches are pushed to fill.
    EnvelopeKind {
        /// the outline turned about its axis, Li 2011 sect. 3
        Revolution = "revolution",
        /// the convex hull of the branches seen, turned about its axis, Zeng 2015 sect. 5.5
        Hull = "hull",
    }
}

choice! {
    /// The trunk beyond its top.
    Leader {
        /// no part
        None = "none",
        /// the straightest chain of branches that goes on from the trunk
        Auto = "auto",
        /// the branches along leader_px
        Drawn = "drawn",
    }
}

choice! {
    /// Whether leaves are drawn.
    LeafShow {
        /// where the picture shows a tree in leaf
        Auto = "auto",
        On = "on",
        Off = "off",
    }
}

choice! {
    /// How tracks become poses.
    MotionMethod {
        /// weighs the tracks against the tree's own shape, Li 2011 sect. 4.2
        Probabilistic = "probabilistic",
        /// follows the tracks exactly, Li 2011 sect. 4.1
        Deterministic = "deterministic",
    }
}

choice! {
    /// What made the tree sway.
    Excited {
        /// the motion shows it
        Auto = "auto",
        /// pulled and released
        Release = "release",
        Wind = "wind",
    }
}
