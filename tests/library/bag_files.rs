//! Bags of ROS 1: those of a RealSense camera, whose depth is not registered with the colours, and those
//! of programs of ROS.

use crate::bag::{Bag, PACKED};
use crate::ros::Message;
use arborcam::config::{Config, DepthCamera};
use arborcam::model::{PixelFormat, RawFrame};
use arborcam::source::{self, SourceInfo};
use nalgebra::Vector2;

const COLOUR: [u32; 2] = [32, 24];
const COLOUR_FOCAL_PX: f64 = 32.0;
const DEPTH: [u32; 2] = [16, 12];
const DEPTH_FOCAL_PX: f64 = 16.0;
/// Metres for each count, as the camera says.
const UNIT_M: f32 = 0.0005;
/// The colour camera is so far to the left of the depth camera, m: a place is farther to its right.
const BESIDE_M: f64 = 0.25;
const FRAMES: u64 = 10;
const START_NS: u64 = 1_700_000_000_000_000_000;

/// What is unusual about a bag.
#[derive(Clone, Copy, Debug, Default)]
struct Faults {
    /// Nothing says where the cameras stand.
    no_transform: bool,
    /// There is a second series of pictures.
    two_series: bool,
}

/// The left half of the depth image is 4 m away, the right half 2 m.
fn depth_rows(pixel: impl Fn(bool) -> Vec<u8>) -> Vec<u8> {
    let mut data = Vec::new();
    for _ in 0..DEPTH[1] {
        for u in 0..DEPTH[0] {
            data.extend(pixel(u >= DEPTH[0] / 2));
        }
    }
    data
}

fn colours(k: u64) -> Vec<u8> {
    (0..3 * COLOUR[0] * COLOUR[1])
        .map(|i| (u64::from(i) + k) as u8)
        .collect()
}

/// A bag as the camera's own program records it.
fn realsense(packed: &'static str, faults: Faults) -> Vec<u8> {
    let mut bag = Bag::new(packed);
    let of = |stream: &str, rest: &str| format!("/device_0/{stream}/{rest}");
    let (depth, colour) = ("sensor_0/Depth_0", "sensor_1/Color_0");
    let image = "sensor_msgs/Image";
    let depths = bag.connection(&of(depth, "image/data"), image);
    let colour_images = bag.connection(&of(colour, "image/data"), image);
    let infrared = bag.connection(&of("sensor_0/Infrared_1", "image/data"), image);
    let second = if faults.two_series {
        bag.connection(&of("sensor_2/Fisheye_0", "image/data"), image)
    } else {
        infrared
    };
    let info = "sensor_msgs/CameraInfo";
    let depth_info = bag.connection(&of(depth, "info/camera_info"), info);
    let colour_info = bag.connection(&of(colour, "info/camera_info"), info);
    let transform = "geometry_msgs/Transform";
    let depth_place = bag.connection(&of(depth, "tf/0"), transform);
    let colour_place = bag.connection(&of(colour, "tf/0"), transform);
    let message = |time_ns| Message::new(false, time_ns, "1");
    bag.message(depth_info, 1, &message(0).camera_of(DEPTH, DEPTH_FOCAL_PX));
    let camera = message(0).camera_of(COLOUR, COLOUR_FOCAL_PX);
    bag.message(colour_info, 1, &camera);
    for k in 0..FRAMES {
        let time_ns = START_NS + k * 33_333_333;
        let picture = message(time_ns).image_of(COLOUR, "rgb8", 3, &colours(k));
        let picture = [picture.as_slice(), &0.0_f32.to_le_bytes()].concat();
        bag.message(colour_images, time_ns, &picture);
        let grey = message(time_ns).image_of(DEPTH, "8UC1", 1, &[9; 16 * 12]);
        bag.message(second, time_ns, &grey);
        let late_ns = time_ns + 2_000_000;
        let data = depth_rows(|near| u16::to_le_bytes(if near { 4000 } else { 8000 }).into());
        let image = message(late_ns).image_of(DEPTH, "mono16", 2, &data);
        let image = [image.as_slice(), &UNIT_M.to_le_bytes()].concat();
        bag.message(depths, late_ns, &image);
        if k == 0 && !faults.no_transform {
            let at_depth = Message::bare(false).transform([0.0; 3]);
            bag.message(depth_place, 1, &at_depth);
            let beside = Message::bare(false).transform([BESIDE_M, 0.0, 0.0]);
            bag.message(colour_place, 1, &beside);
        }
        if k % 3 == 2 {
            bag.end_chunk();
        }
    }
    bag.end_chunk();
    bag.done()
}

/// All frames of a film, what it says of itself, and its warnings.
struct Read {
    frames: Vec<RawFrame>,
    info: SourceInfo,
    warnings: Vec<String>,
}

fn read(bytes: &[u8], config: &Config) -> Result<Read, String> {
    let dir = tempfile::tempdir().expect("tempdir");
    let path = dir.path().join("film.bag");
    std::fs::write(&path, bytes).expect("written");
    let mut source = source::open(&path, config, None).map_err(|e| e.to_string())?;
    let info = source.describe();
    let frames = std::iter::from_fn(|| source.next_frame().expect("a frame")).collect();
    Ok(Read {
        frames,
        info,
        warnings: source.warnings(),
    })
}

/// What is 4 m away is seen 1 px farther to the right, and what is 2 m away 2 px.
fn check_registered(frame: &RawFrame, near: u16, far: u16) {
    let depth = frame.depth.as_ref().expect("depth");
    let mut expected = vec![0];
    expected.extend([far; 8]);
    expected.push(0);
    expected.extend([near; 6]);
    assert_eq!(depth.counts[6 * 16..7 * 16], expected);
}

#[test]
fn a_bag_of_a_realsense_camera_is_read_and_its_depth_put_into_the_colours() {
    for packed in PACKED {
        let film = read(&realsense(packed, Faults::default()), &Config::default());
        let film = film.expect("a film");
        assert_eq!(film.frames.len() as u64, FRAMES, "{packed}");
        assert_eq!(film.info.frames_total, Some(FRAMES));
        let format = film.info.depth.expect("depth");
        assert_eq!(format.unit_m, f64::from(UNIT_M));
        let focal_px = Vector2::repeat(COLOUR_FOCAL_PX);
        assert_eq!(format.pinhole.focal_px, focal_px);
        for (k, frame) in film.frames.iter().enumerate() {
            assert_eq!(frame.format, PixelFormat::Rgb24);
            assert_eq!(frame.bytes, colours(k as u64));
            check_registered(frame, 4000, 8000);
        }
        assert_eq!(film.warnings, [""; 0]);
    }
}

#[test]
fn a_bag_of_ros_has_its_transforms_and_depth_in_metres() {
    let mut bag = Bag::new("none");
    let image = "sensor_msgs/Image";
    let depths = bag.connection("/camera/depth/image_rect_raw", image);
    let pictures = bag.connection("/camera/color/image_raw", image);
    let info = "sensor_msgs/CameraInfo";
    let depth_info = bag.connection("/camera/depth/camera_info", info);
    let colour_info = bag.connection("/camera/color/camera_info", info);
    let places = bag.connection("/tf_static", "tf2_msgs/TFMessage");
    let stand = |child: &str, x_m| {
        Message::bare(false).frame_transform("camera_link", child, [x_m, 0.0, 0.0])
    };
    bag.message(places, START_NS, &stand("camera_color_frame", -BESIDE_M));
    bag.message(places, START_NS, &stand("/camera_depth_frame", 0.0));
    for k in 0..FRAMES {
        let time_ns = START_NS + k * 33_333_333;
        let of = |frame: &str| Message::new(false, time_ns, frame);
        let (colour, depth) = ("camera_color_frame", "camera_depth_frame");
        bag.message(
            colour_info,
            time_ns,
            &of(colour).camera_of(COLOUR, COLOUR_FOCAL_PX),
        );
        bag.message(
            depth_info,
            time_ns,
            &of(depth).camera_of(DEPTH, DEPTH_FOCAL_PX),
        );
        let blue = of(colour).image_of(COLOUR, "bgr8", 3, &colours(k));
        bag.message(pictures, time_ns, &blue);
        let data = depth_rows(|near| f32::to_le_bytes(if near { 2.0 } else { 4.0 }).into());
        bag.message(
            depths,
            time_ns,
            &of(depth).image_of(DEPTH, "32FC1", 4, &data),
        );
        bag.end_chunk();
    }
    let bytes = bag.done();
    // The unit is that of metres, whatever the user says.
    let mut config = Config::default();
    config.depth.unit_m = 0.01;
    let film = read(&bytes, &config).expect("a film");
    assert_eq!(film.info.depth.expect("depth").unit_m, 0.001);
    assert_eq!(film.frames.len() as u64, FRAMES);
    for frame in &film.frames {
        check_registered(frame, 2000, 4000);
    }
}

#[test]
fn depth_that_nobody_can_place_is_refused_and_the_user_may_place_it() {
    let faults = Faults {
        no_transform: true,
        ..Faults::default()
    };
    let bytes = realsense("none", faults);
    let said = read(&bytes, &Config::default()).err().expect("refused");
    assert!(said.contains("nothing says where its camera is"), "{said}");
    assert!(!said.contains('\n'), "{said}");
    let mut config = Config::default();
    config.depth.read = false;
    let colours = read(&bytes, &config).expect("a film");
    assert_eq!(colours.frames.len() as u64, FRAMES);
    let mut config = Config::default();
    (config.depth.fx_px, config.depth.fy_px) = (COLOUR_FOCAL_PX, COLOUR_FOCAL_PX);
    (config.depth.cx_px, config.depth.cy_px) = (15.5, 11.5);
    config.depth.own_camera.push(DepthCamera {
        width: DEPTH[0],
        height: DEPTH[1],
        fx_px: DEPTH_FOCAL_PX,
        fy_px: DEPTH_FOCAL_PX,
        cx_px: 7.5,
        cy_px: 5.5,
        distortion: Vec::new(),
        rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        translation_m: [BESIDE_M, 0.0, 0.0],
    });
    let placed = read(&bytes, &config).expect("a film");
    check_registered(&placed.frames[3], 4000, 8000);
}

#[test]
fn bags_that_are_cut_or_lie_are_said_in_one_line_or_used_as_far_as_they_go() {
    let two = Faults {
        two_series: true,
        ..Faults::default()
    };
    let said = read(&realsense("none", two), &Config::default()).err();
    assert!(
        said.expect("refused")
            .contains("several series of pictures")
    );
    let old = read(b"#ROSBAG V1.2\n0123456789", &Config::default()).err();
    assert!(old.expect("refused").contains("rosbag migrate"));
    for packed in PACKED {
        let whole = realsense(packed, Faults::default());
        let mut most = 0;
        for cut in (0..whole.len()).step_by(211) {
            match read(&whole[..cut], &Config::default()) {
                Ok(film) => most = most.max(film.frames.len()),
                Err(said) => assert!(!said.contains('\n'), "{said}"),
            }
        }
        assert!(most >= 9, "{packed}: {most}");
        // A seeded walk over all bytes, changed one at a time.
        let mut state = 12345_u32;
        for _ in 0..300 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let mut changed = whole.clone();
            let at = state as usize % changed.len();
            changed[at] = (state >> 24) as u8;
            if let Err(said) = read(&changed, &Config::default()) {
                assert!(!said.contains('\n'), "{said}");
            }
        }
    }
}
