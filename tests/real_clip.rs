//! A real tree before a real webcam, and a hand before the tree: `make test-real` fetches the clip
//! (OpenCV's tree.avi).

use nalgebra::{Point2, distance};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

const CLIP: &str = "target/real/tree.avi";
/// The crown as a person would draw it.
const CROWN: &str = "[[38,8],[130,4],[225,6],[252,60],[285,130],[312,175],[312,236],[36,236]]";
/// Where the hand is, frame by frame, px, drawn by eye.
const HAND: &[(usize, &[[i32; 2]])] = &[
    (53, &[[247, 0], [252, 10], [258, 19], [268, 12], [276, 0]]),
    (
        54,
        &[
            [230, 0],
            [213, 8],
            [213, 14],
            [228, 26],
            [238, 40],
            [236, 75],
            [240, 100],
            [247, 114],
            [257, 104],
            [264, 88],
            [279, 62],
            [300, 32],
            [319, 27],
            [319, 0],
        ],
    ),
    (
        55,
        &[
            [279, 0],
            [262, 22],
            [246, 45],
            [219, 58],
            [220, 72],
            [245, 78],
            [237, 110],
            [235, 155],
            [243, 166],
            [256, 152],
            [274, 122],
            [283, 98],
            [319, 65],
            [319, 0],
        ],
    ),
    (
        56,
        &[
            [319, 0],
            [293, 0],
            [289, 13],
            [257, 41],
            [254, 54],
            [219, 77],
            [218, 88],
            [237, 100],
            [233, 160],
            [228, 169],
            [232, 182],
            [239, 182],
            [254, 159],
            [265, 155],
            [285, 105],
            [312, 74],
            [319, 74],
        ],
    ),
    (
        57,
        &[
            [319, 0],
            [289, 0],
            [282, 19],
            [259, 40],
            [246, 80],
            [238, 85],
            [233, 96],
            [225, 97],
            [228, 136],
            [223, 144],
            [222, 173],
            [216, 177],
            [217, 186],
            [238, 182],
            [247, 157],
            [264, 145],
            [279, 103],
            [312, 66],
            [319, 66],
        ],
    ),
    (
        58,
        &[
            [319, 0],
            [293, 0],
            [293, 7],
            [267, 35],
            [250, 46],
            [244, 60],
            [238, 62],
            [237, 80],
            [222, 88],
            [210, 105],
            [212, 122],
            [207, 140],
            [187, 176],
            [190, 188],
            [207, 202],
            [228, 196],
            [242, 174],
            [252, 174],
            [268, 160],
            [270, 143],
            [286, 106],
            [311, 71],
            [319, 70],
        ],
    ),
    (
        59,
        &[
            [319, 0],
            [264, 0],
            [256, 15],
            [235, 26],
            [224, 48],
            [205, 72],
            [176, 80],
            [174, 90],
            [186, 98],
            [205, 98],
            [187, 130],
            [165, 150],
            [153, 170],
            [154, 183],
            [187, 179],
            [196, 166],
            [217, 166],
            [233, 147],
            [245, 144],
            [246, 123],
            [259, 111],
            [294, 57],
            [305, 45],
            [319, 42],
        ],
    ),
    (
        60,
        &[
            [319, 0],
            [194, 0],
            [180, 18],
            [165, 42],
            [146, 54],
            [131, 58],
            [133, 72],
            [160, 76],
            [140, 95],
            [118, 125],
            [104, 150],
            [108, 162],
            [120, 158],
            [146, 152],
            [165, 143],
            [177, 143],
            [201, 114],
            [220, 103],
            [235, 83],
            [242, 82],
            [275, 31],
            [319, 25],
        ],
    ),
    (
        61,
        &[
            [319, 0],
            [152, 0],
            [137, 17],
            [112, 24],
            [112, 34],
            [140, 46],
            [125, 62],
            [105, 90],
            [84, 112],
            [84, 126],
            [100, 128],
            [118, 112],
            [133, 108],
            [140, 122],
            [152, 122],
            [180, 90],
            [200, 70],
            [221, 65],
            [232, 57],
            [253, 41],
            [263, 18],
            [319, 15],
        ],
    ),
    (
        62,
        &[
            [247, 0],
            [92, 0],
            [93, 12],
            [112, 18],
            [128, 22],
            [104, 44],
            [80, 70],
            [62, 92],
            [62, 104],
            [80, 104],
            [100, 90],
            [118, 84],
            [118, 97],
            [130, 96],
            [160, 74],
            [185, 58],
            [202, 60],
            [215, 50],
            [226, 36],
        ],
    ),
    (
        63,
        &[
            [84, 0],
            [86, 20],
            [60, 50],
            [44, 72],
            [46, 88],
            [62, 90],
            [90, 76],
            [108, 72],
            [104, 86],
            [120, 88],
            [150, 66],
            [180, 48],
            [204, 39],
            [215, 35],
            [233, 11],
            [236, 0],
        ],
    ),
    (
        64,
        &[
            [45, 42],
            [43, 77],
            [62, 78],
            [95, 68],
            [110, 62],
            [98, 72],
            [102, 78],
            [122, 74],
            [150, 52],
            [180, 36],
            [205, 30],
            [217, 27],
            [226, 13],
            [232, 0],
            [84, 0],
            [70, 18],
        ],
    ),
    (
        65,
        &[
            [97, 0],
            [99, 8],
            [118, 22],
            [130, 28],
            [108, 60],
            [90, 80],
            [68, 112],
            [68, 122],
            [86, 132],
            [105, 134],
            [125, 118],
            [140, 110],
            [138, 124],
            [150, 128],
            [180, 96],
            [202, 68],
            [224, 56],
            [257, 8],
            [319, 6],
            [319, 0],
        ],
    ),
    (
        66,
        &[
            [187, 0],
            [160, 14],
            [137, 20],
            [137, 34],
            [168, 46],
            [150, 80],
            [126, 130],
            [124, 142],
            [140, 156],
            [165, 158],
            [175, 146],
            [190, 148],
            [204, 136],
            [225, 106],
            [239, 74],
            [251, 73],
            [283, 26],
            [319, 20],
            [319, 0],
        ],
    ),
    (
        67,
        &[
            [236, 0],
            [220, 18],
            [178, 26],
            [176, 38],
            [198, 48],
            [212, 56],
            [200, 76],
            [180, 120],
            [166, 155],
            [168, 166],
            [180, 172],
            [200, 164],
            [215, 160],
            [230, 144],
            [238, 108],
            [256, 101],
            [292, 47],
            [311, 28],
            [319, 28],
            [319, 0],
        ],
    ),
];
/// The last frame that surely has no hand.
const BEFORE: usize = 52;
/// Nearer to the hand's edge than this nothing is claimed, px.
const EDGE_PX: f64 = 4.0;

/// Distance from the edge of the hand in frame `k`, px: above 0 inside; far outside where there is
/// none.
fn inside_px(k: usize, at: Point2<f64>) -> f64 {
    let Some((_, hand)) = HAND.iter().find(|(frame, _)| *frame == k) else {
        return f64::MIN;
    };
    let (mut within, mut nearest) = (false, f64::MAX);
    for (i, a) in hand.iter().enumerate() {
        let [a, b] = [*a, hand[(i + 1) % hand.len()]].map(|p| Point2::from(p).cast::<f64>());
        if (a.y > at.y) != (b.y > at.y) && at.x < a.x + (at.y - a.y) * (b.x - a.x) / (b.y - a.y) {
            within = !within;
        }
        let along = b - a;
        let share = (at - a).dot(&along) / along.norm_squared().max(1e-9);
        nearest = nearest.min(distance(&at, &(a + share.clamp(0.0, 1.0) * along)));
    }
    if within { nearest } else { -nearest }
}

/// A track's places by frame.
type Track = BTreeMap<usize, Point2<f64>>;

/// Tracks by id, and the time of each frame, s.
fn replayed() -> (BTreeMap<u32, Track>, BTreeMap<usize, f64>) {
    assert!(
        Path::new(CLIP).exists(),
        "{CLIP} is missing: make test-real fetches it"
    );
    let dir = tempfile::tempdir().expect("folder");
    let (outline, out) = (dir.path().join("outline.json"), dir.path().join("out"));
    std::fs::write(
        &outline,
        format!(r#"{{"frame":0,"width":320,"height":240,"polygon_px":{CROWN}}}"#),
    )
    .expect("outline");
    let run = Command::new(env!("CARGO_BIN_EXE_arborcam"))
        .args(["replay", CLIP, "--fast", "--headless", "--outline"])
        .arg(&outline)
        .arg("--out")
        .arg(&out)
        .output()
        .expect("arborcam");
    let tracks = std::fs::read_to_string(out.join("tracks.csv"))
        .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&run.stderr)));
    let (mut by_id, mut times_s) = (BTreeMap::<u32, Track>::new(), BTreeMap::new());
    for row in tracks.lines().skip(1) {
        let field: Vec<&str> = row.split(',').collect();
        let frame: usize = field[1].parse().expect("frame");
        let place = Point2::from([3, 4].map(|c| field[c].parse().expect("px")));
        by_id
            .entry(field[0].parse().expect("id"))
            .or_default()
            .insert(frame, place);
        times_s.insert(frame, field[2].parse().expect("time"));
    }
    (by_id, times_s)
}

/// The tree hardly moves in this clip: a track belongs where it was before the hand came.
fn rest(track: &Track) -> Point2<f64> {
    Point2::from([0, 1].map(|c| {
        let mut places: Vec<f64> = track.range(..=BEFORE).map(|(_, p)| p[c]).collect();
        places.sort_by(f64::total_cmp);
        places[places.len() / 2]
    }))
}

#[test]
#[ignore = "make test-real fetches the clip"]
fn a_hand_before_a_real_tree_takes_no_track_along() {
    let (tracks, times_s) = replayed();
    // The webcam took its pictures when it could.
    assert_eq!((times_s.len(), times_s.keys().max()), (68, Some(&67)));
    for (frame, time_s) in [
        (0, 0.0),
        (1, 0.733337),
        (2, 1.133339),
        (3, 1.600008),
        (31, 13.266733),
        (67, 29.533481),
    ] {
        assert!(
            (times_s[&frame] - time_s).abs() < 1e-3,
            "frame {frame} is at {} s, not {time_s} s",
            times_s[&frame]
        );
    }

    let tracks: Vec<(Track, Point2<f64>)> = tracks
        .into_values()
        .filter(|t| t.contains_key(&BEFORE))
        .map(|t| (rest(&t), t))
        .map(|(r, t)| (t, r))
        .collect();
    assert!(tracks.len() >= 200, "{} tracks", tracks.len());
    let (mut behind, mut reported, mut riding, mut free, mut seen, mut off) = (0, 0, 0, 0, 0, 0);
    for k in BEFORE + 1..68 {
        for (track, rest) in &tracks {
            let now = track.get(&k);
            let hidden_px = inside_px(k, *rest);
            if hidden_px > EDGE_PX {
                behind += 1;
                reported += usize::from(now.is_some());
            } else if hidden_px < -2.0 * EDGE_PX {
                free += 1;
                seen += usize::from(now.is_some());
                off += usize::from(now.is_some_and(|at| distance(at, rest) > 6.0));
            }
            // On the hand in two frames, in each elsewhere, and where it does not belong.
            let rides = |at: &Point2<f64>| {
                let before = k
                    .checked_sub(1)
                    .and_then(|k| track.get(&k).filter(|at| inside_px(k, **at) > 0.0));
                inside_px(k, *at) > EDGE_PX
                    && before.is_some_and(|b| distance(at, b) > EDGE_PX)
                    && distance(at, rest) > EDGE_PX
            };
            riding += usize::from(now.is_some_and(rides));
        }
    }
    let hidden_then = |(_, rest): &&(Track, Point2<f64>)| {
        (60..66).any(|k| inside_px(k, *rest) > EDGE_PX) && inside_px(67, *rest) < -2.0 * EDGE_PX
    };
    let were: Vec<_> = tracks.iter().filter(hidden_then).collect();
    let back = were
        .iter()
        .filter(|(t, rest)| t.get(&67).is_some_and(|at| distance(at, rest) < 4.0))
        .count();
    println!(
        "{} tracks; behind the hand {behind}, {reported} of them reported, {riding} riding; free {free}, seen {seen}, \
         off {off}; {back} of {} back",
        tracks.len(),
        were.len()
    );
    assert!(behind >= 400, "{behind}");
    assert_eq!(riding, 0, "tracks ride on the hand");
    assert!(
        reported * 20 <= behind,
        "{reported} of {behind} are reported behind the hand"
    );
    assert!(
        seen * 100 >= free * 75,
        "{seen} of {free} elsewhere are seen"
    );
    assert!(
        off * 100 <= seen * 4,
        "{off} of {seen} elsewhere are off their places"
    );
    assert!(back * 2 >= were.len(), "{back} of {} are back", were.len());
}
