//! What the camera says of itself: a UVC 1.1 device with one format of one size and rate, MJPEG or
//! depth, over a bulk endpoint.

use super::{Encoding, Mode, PAYLOAD};

const DEVICE: u8 = 1;
const CONFIGURATION: u8 = 2;
const STRING: u8 = 3;
/// Class-specific interface descriptor.
const CLASS: u8 = 0x24;
/// For testing: no real product has these.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0xa4b0;
/// By which `uvcvideo` knows depth of 16 bits, as RealSense cameras send it.
const DEPTH_GUID: [u8; 16] = *b"Z16 \x00\x00\x10\x00\x80\x00\x00\xaa\x00\x38\x9b\x71";

/// The descriptor of this kind and number, if there is one.
pub fn descriptor(mode: &Mode, kind: u8, index: u8) -> Option<Vec<u8>> {
    match (kind, index) {
        (DEVICE, 0) => Some(device()),
        (CONFIGURATION, 0) => Some(configuration(mode)),
        // The language of the strings: English.
        (STRING, 0) => Some(vec![4, STRING, 0x09, 0x04]),
        (STRING, 1) => Some(string("arborcam")),
        (STRING, 2) => Some(string("Test Camera")),
        (STRING, 3) => Some(string(&mode.serial)),
        _ => None,
    }
}

/// The answer to every question of UVC's negotiation (26 bytes in UVC 1.0).
pub fn probe(mode: &Mode) -> [u8; 26] {
    let mut probe = [0; 26];
    // Format 1, frame 1.
    probe[2] = 1;
    probe[3] = 1;
    probe[4..8].copy_from_slice(&mode.interval().to_le_bytes());
    probe[18..22].copy_from_slice(&mode.picture_bytes().to_le_bytes());
    probe[22..26].copy_from_slice(&(PAYLOAD as u32).to_le_bytes());
    probe
}

fn device() -> Vec<u8> {
    let [v0, v1] = VENDOR.to_le_bytes();
    let [p0, p1] = PRODUCT.to_le_bytes();
    // USB 2.0, interfaces in associations, packets of 64 bytes; maker, product and serial are
    // strings 1 to 3.
    vec![
        18, DEVICE, 0x00, 0x02, 0xef, 2, 1, 64, v0, v1, p0, p1, 0x00, 0x01, 1, 2, 3, 1,
    ]
}

fn string(text: &str) -> Vec<u8> {
    let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    [&[utf16.len() as u8 + 2, STRING], &utf16[..]].concat()
}

fn configuration(mode: &Mode) -> Vec<u8> {
    // Interfaces 0 and 1 are one video function.
    let association = [8, 11, 0, 2, 0x0e, 3, 0, 2];
    let control_interface = [9, 4, 0, 0, 0, 0x0e, 1, 0, 2];
    // Terminals: a camera (1), and what goes over USB (2), fed by it.
    let input = [17, CLASS, 2, 1, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0];
    let output = [9, CLASS, 3, 2, 0x01, 0x01, 0, 1, 0];
    let control_length = (13 + input.len() + output.len()) as u16;
    let [c0, c1] = control_length.to_le_bytes();
    // UVC 1.0, a clock of 6 MHz, one streaming interface, number 1.
    let control = [13, CLASS, 1, 0x00, 0x01, c0, c1, 0x80, 0x8d, 0x5b, 0, 1, 1];

    let streaming_interface = [9, 4, 1, 0, 1, 0x0e, 2, 0, 0];
    let format = format(mode);
    let frame = frame(mode);
    let streaming_length = (14 + format.len() + frame.len()) as u16;
    let [s0, s1] = streaming_length.to_le_bytes();
    // One format, over endpoint 0x81, linked to terminal 2.
    let streaming = [14, CLASS, 1, 1, s0, s1, 0x81, 0, 2, 0, 0, 0, 1, 0];
    let endpoint = [7, 5, 0x81, 2, 0x00, 0x02, 0];

    let parts: [&[u8]; 10] = [
        &association,
        &control_interface,
        &control,
        &input,
        &output,
        &streaming_interface,
        &streaming,
        &format,
        &frame,
        &endpoint,
    ];
    let body = parts.concat();
    let [l0, l1] = (body.len() as u16 + 9).to_le_bytes();
    // Two interfaces, fed from the bus, 500 mA.
    [&[9, CONFIGURATION, l0, l1, 2, 1, 0, 0x80, 250][..], &body].concat()
}

/// Format 1, with one size of picture.
fn format(mode: &Mode) -> Vec<u8> {
    match mode.encoding {
        Encoding::Jpeg => vec![11, CLASS, 6, 1, 1, 1, 1, 0, 0, 0, 0],
        Encoding::Depth => [&[27, CLASS, 4, 1, 1][..], &DEPTH_GUID, &[16, 1, 0, 0, 0, 0]].concat(),
    }
}

fn frame(mode: &Mode) -> Vec<u8> {
    let bits_per_s = mode.picture_bytes() * 8 * mode.fps;
    let kind = match mode.encoding {
        Encoding::Jpeg => 7,
        Encoding::Depth => 5,
    };
    let mut frame = vec![30, CLASS, kind, 1, 0];
    frame.extend(mode.width.to_le_bytes());
    frame.extend(mode.height.to_le_bytes());
    frame.extend(bits_per_s.to_le_bytes());
    frame.extend(bits_per_s.to_le_bytes());
    frame.extend(mode.picture_bytes().to_le_bytes());
    frame.extend(mode.interval().to_le_bytes());
    // One rate.
    frame.push(1);
    frame.extend(mode.interval().to_le_bytes());
    frame
}
