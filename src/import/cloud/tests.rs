use super::*;
use std::io::Cursor;

fn read_bytes(bytes: &[u8], format: CloudFormat) -> Result<PointCloud, ImportError> {
    read_cloud(Cursor::new(bytes.to_vec()), format, None).map(|read| read.cloud)
}

/// Three points, the second with a NaN.
fn expected(cloud: &PointCloud) {
    assert_eq!((cloud.points.len(), cloud.not_finite), (2, 1));
    let last = cloud.points[1].cast::<f64>() + cloud.origin;
    assert!((last - Point3::new(4.0, 5.5, 6.0)).norm() < 1e-5, "{last}");
}

fn floats(rows: &[[f32; 4]]) -> Vec<u8> {
    rows.iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect()
}

const ROWS: [[f32; 4]; 3] = [
    [1.0, 2.0, 3.0, 9.0],
    [1.0, f32::NAN, 3.0, 9.0],
    [4.0, 5.5, 6.0, 9.0],
];
const PLY: &str = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float i\n\
                   element face 0\nproperty list uchar int all\nend_header\n";
const PCD: &str = "# .PCD v.7\nVERSION .7\nFIELDS x y z i\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 3\n\
                   HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\n";
const TEXT: &str = "1 2 3 9\n1 nan 3 9\n4 5.5 6 9\n";

/// A number of each point in front was taken for x, and decimals after a comma for y.
#[test]
fn text_has_its_places_in_named_columns_and_no_decimal_commas() {
    let rows = TEXT.replace('\n', "\n7 ");
    for names in ["id x y z i", "#id, \"X\", \"Y\", \"Z\", i", "//id;x;y;z;i"] {
        let text = format!("{names}\n7 {}", rows.trim_end_matches("7 "));
        expected(&read_bytes(text.as_bytes(), CloudFormat::Text).expect(names));
    }
    expected(&read_bytes(TEXT.replace(' ', ", ").as_bytes(), CloudFormat::Text).expect("parted"));
    for (text, what) in [
        ("1,25 2,5 3,75\n", "line 1 has white space and commas"),
        ("1,2;2,5;3,7\n", "line 1 has semicolons and commas"),
        (
            "id,x,y,z\n1,2,3\n",
            "line 1 names 4 columns, and line 2 has others",
        ),
        ("1 2 3\n4 5 six\n", "line 2 has no place of a point"),
    ] {
        let refused = read_bytes(text.as_bytes(), CloudFormat::Text).expect_err(what);
        assert!(refused.to_string().contains(what), "{refused}");
    }
}

/// Cells are counted as the names are: an empty one is one, and a space within a name parts none.
#[test]
fn text_of_other_programs_is_read_as_it_is_meant() {
    for text in [
        "Point ID,X,Y,Z,Intensity\n7,1,2,3,200\n7,1,nan,3,200\n7,4,5.5,6,200\n",
        "id,name,x,y,z\n7,,1,2,3\n7,,1,nan,3\n7,,4,5.5,6\n",
        "# format: x y z intensity\n1 2 3 9\n1 nan 3 9\n4 5.5 6 9\n",
        "\u{feff}1 2 3\n1 nan 3\n4 5.5 6\n",
        "3\n1 2 3\n1 nan 3\n4 5.5 6\n",
        "y [m],x [m],z [m]\n2,1,3\nnan,1,3\n5.5,4,6\n",
        "Northing;Easting;Elevation\n2;1;3\nnan;1;3\n5.5;4;6\n",
        "\"1\",\"2\",\"3\"\n\"1\",\"nan\",\"3\"\n\"4\",\"5.5\",\"6\"\n",
        "id x y z\n3\n7 1 2 3\n7 1 nan 3\n7 4 5.5 6\n",
        "Easting,Northing,Height,Scan angle\n1,2,3,0\n1,nan,3,0\n4,5.5,6,0\n",
        "1.0,2.0,3.0,2023-01-01 12:00:00\n1,nan,3,-\n4,5.5,6,one oak\n",
        "1 2 3 bark, moss\n1 nan 3\n4 5.5 6\n",
    ] {
        let cloud = read_bytes(text.as_bytes(), CloudFormat::Text);
        expected(&cloud.unwrap_or_else(|e| panic!("{text}: {e}")));
    }
}

#[test]
fn ply_is_read_as_text_and_as_bytes_and_to_its_end() {
    let text = format!("ply\nformat ascii 1.0\n{PLY}{TEXT}");
    expected(&read_bytes(text.as_bytes(), CloudFormat::Ply).expect("sound"));
    let mut bytes = format!("ply\nformat binary_little_endian 1.0\n{PLY}").into_bytes();
    bytes.extend(floats(&ROWS));
    expected(&read_bytes(&bytes, CloudFormat::Ply).expect("sound"));
    bytes.extend([0; 16]);
    let more = read_bytes(&bytes, CloudFormat::Ply)
        .expect_err("more rows")
        .to_string();
    assert!(more.contains("more than its header says"), "{more}");
    let cut = read_bytes(&bytes[..bytes.len() - 20], CloudFormat::Ply)
        .expect_err("cut")
        .to_string();
    assert!(cut.contains("row 3 cannot be read"), "{cut}");
    let lie = text.replace("vertex 3", "vertex 99999999999");
    assert!(matches!(
        read_bytes(lie.as_bytes(), CloudFormat::Ply),
        Err(ImportError::TooMany { .. })
    ));
}

#[test]
fn pcd_is_read_in_its_three_ways() {
    let text = format!("{PCD}DATA ascii\n{TEXT}");
    expected(&read_bytes(text.as_bytes(), CloudFormat::Pcd).expect("sound"));
    let other = text.replace("DATA ascii", "WIDTH 2\nHEIGHT 1\nDATA ascii");
    let refused = read_bytes(other.as_bytes(), CloudFormat::Pcd).expect_err("another number");
    assert!(
        refused.to_string().contains("WIDTH 2 times HEIGHT 1"),
        "{refused}"
    );
    let more = format!("{text}\n7 8 9 10\n11 12 13 14\n");
    let said = said_too_few(more.as_bytes(), CloudFormat::Pcd).1;
    assert_eq!(said, Some((3, 5)));
    let mut bytes = format!("{PCD}DATA binary\n").into_bytes();
    bytes.extend(floats(&ROWS));
    let more = [bytes.clone(), floats(&ROWS)].concat();
    assert_eq!(said_too_few(&more, CloudFormat::Pcd).1, Some((3, 6)));
    expected(&read_bytes(&bytes, CloudFormat::Pcd).expect("sound"));
    assert!(read_bytes(&bytes[..bytes.len() - 1], CloudFormat::Pcd).is_err());
    // The fields one after the other, as literal runs.
    let columns: Vec<u8> = (0..4)
        .flat_map(|c| ROWS.map(|row| row[c]))
        .flat_map(f32::to_le_bytes)
        .collect();
    let packed: Vec<u8> = columns
        .chunks(32)
        .flat_map(|run| [&[run.len() as u8 - 1], run].concat())
        .collect();
    let mut bytes = format!("{PCD}DATA binary_compressed\n").into_bytes();
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend(48_u32.to_le_bytes());
    bytes.extend(&packed);
    expected(&read_bytes(&bytes, CloudFormat::Pcd).expect("sound"));
    assert!(read_bytes(&bytes[..bytes.len() - 1], CloudFormat::Pcd).is_err());
    let lie = text.replace("SIZE 4", "SIZE 4000000000");
    assert!(read_bytes(lie.as_bytes(), CloudFormat::Pcd).is_err());
}

#[test]
fn text_is_read_with_any_separator_behind_its_header() {
    let text = "3\n// made\nX;Y;Z\n1;2;3\n1,nan,3,9\n\n4\t5.5 6 9\n";
    expected(&read_bytes(text.as_bytes(), CloudFormat::Text).expect("sound"));
    let bad = read_bytes(b"1 2 3\n4 5 up\n", CloudFormat::Text)
        .expect_err("no number")
        .to_string();
    assert!(bad.contains("line 2"), "{bad}");
    assert!(read_bytes(&[b'7'; 100_000], CloudFormat::Text).is_err());
    let none = read_bytes(b"nan 1 2\n", CloudFormat::Text)
        .expect_err("no point")
        .to_string();
    assert!(none.contains("no coordinate"), "{none}");
}

/// A LAS or LAZ file of these points, its extent said to be zero.
fn las_file(points: &[[f64; 3]], compressed: bool) -> Vec<u8> {
    let mut builder = las::Builder::from((1, 4));
    builder.point_format = las::point::Format::new(6).expect("format");
    builder.point_format.is_compressed = compressed;
    let scale = las::Transform {
        scale: 0.0005,
        offset: 1000.0,
    };
    builder.transforms = las::Vector {
        x: scale,
        y: scale,
        z: scale,
    };
    let mut writer = las::Writer::new(
        Cursor::new(Vec::new()),
        builder.into_header().expect("header"),
    )
    .expect("writer");
    for [x, y, z] in points {
        writer
            .write_point(las::Point {
                x: *x,
                y: *y,
                z: *z,
                gps_time: Some(0.0),
                ..las::Point::default()
            })
            .expect("point");
    }
    let mut bytes = writer.into_inner().expect("written").into_inner();
    bytes[179..227].fill(0);
    bytes
}

/// The points that are read, and what a header says and for how many there is room, where that is more.
fn said_too_few(bytes: &[u8], format: CloudFormat) -> (usize, Option<(u64, u64)>) {
    let read = read_cloud(Cursor::new(bytes.to_vec()), format, None).expect("readable");
    let said = read.too_few_said.map(|few| (few.said, few.room));
    (read.cloud.points.len(), said)
}

#[test]
fn las_and_laz_are_read_whatever_extent_they_claim() {
    let points = [[1001.0, 1002.0, 1003.0], [1004.0, 1005.5, 1006.0]];
    for compressed in [false, true] {
        let bytes = las_file(&points, compressed);
        let cloud = read_bytes(&bytes, CloudFormat::Las).expect("sound");
        assert_eq!(cloud.points.len(), 2, "{compressed}");
        let last = cloud.points[1].cast::<f64>() + cloud.origin;
        assert!((last - Point3::from(points[1])).norm() < 1e-5, "{last}");
        let feet = read_cloud(Cursor::new(bytes.clone()), CloudFormat::Las, Some(0.3048))
            .expect("sound")
            .cloud;
        assert!((feet.points[1].y - 3.5 * 0.3048).abs() < 1e-5);
        assert!(
            read_bytes(&bytes[..bytes.len() - 25], CloudFormat::Las).is_err(),
            "cut off"
        );
        let mut lie = bytes.clone();
        lie[107..111].copy_from_slice(&7_000_000_u32.to_le_bytes());
        assert!(
            read_bytes(&lie, CloudFormat::Las).is_err(),
            "more points than there are"
        );
        lie[107..111].fill(0);
        lie[247..255].copy_from_slice(&(1_u64 << 40).to_le_bytes());
        assert!(matches!(
            read_bytes(&lie, CloudFormat::Las),
            Err(ImportError::TooMany { .. })
        ));
    }
    // Fewer points than there are: the first are read, and that is noted.
    let mut lie = las_file(&points, false);
    lie[107..111].copy_from_slice(&1_u32.to_le_bytes());
    lie[247..255].copy_from_slice(&1_u64.to_le_bytes());
    assert_eq!(said_too_few(&lie, CloudFormat::Las), (1, Some((1, 2))));
    let many: Vec<[f64; 3]> = (0..50_001)
        .map(|k| [1000.0 + f64::from(k), 1000.0, 1000.0])
        .collect();
    let mut lie = las_file(&many, true);
    assert_eq!(said_too_few(&lie, CloudFormat::Las), (50_001, None));
    lie[107..111].copy_from_slice(&7_u32.to_le_bytes());
    lie[247..255].copy_from_slice(&7_u64.to_le_bytes());
    assert_eq!(said_too_few(&lie, CloudFormat::Las), (7, Some((7, 50_001))));
    // A layer of 4 GB in a file of some hundred bytes: its size stands behind the first point of 30 bytes and
    // the number of points, and the chunks behind the place of their table.
    let lie = las_file(&points, true);
    let first = u32::from_le_bytes(lie[96..100].try_into().expect("four")) as usize + 8;
    for layer in 0..9 {
        let mut lie = lie.clone();
        let size = first + 34 + 4 * layer;
        lie[size..size + 4].fill(0xff);
        assert!(read_bytes(&lie, CloudFormat::Las).is_err(), "layer {layer}");
    }
    // Points of 65,535 bytes each, of which a piece at once would be 1.3 GB.
    let mut lie = las_file(&points, false);
    lie[105..107].fill(0xff);
    lie[107..111].fill(0);
    lie[247..255].copy_from_slice(&20_000_u64.to_le_bytes());
    assert!(read_bytes(&lie, CloudFormat::Las).is_err());
    // A place that no file has is damage, not a file that cannot be read.
    let nowhere = std::io::Error::from(std::io::ErrorKind::InvalidInput);
    assert!(matches!(
        ImportError::unreadable(&nowhere),
        ImportError::BadFormat { .. }
    ));
    // An extended record that says to be of any length.
    let mut lie = las_file(&points, false);
    let end = lie.len() as u64;
    lie[235..243].copy_from_slice(&end.to_le_bytes());
    lie[243..247].copy_from_slice(&1_u32.to_le_bytes());
    lie.extend([0xff; 60]);
    assert!(read_bytes(&lie, CloudFormat::Las).is_err());
    assert!(read_bytes(b"LASF", CloudFormat::Las).is_err());
}

/// An E57 file of one scan.
fn e57_file(points: &[[f64; 3]]) -> Vec<u8> {
    use e57::{E57Writer, Record, RecordValue};
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").expect("writer");
    let prototype = vec![
        Record::CARTESIAN_X_F64,
        Record::CARTESIAN_Y_F64,
        Record::CARTESIAN_Z_F64,
    ];
    let mut scan = writer.add_pointcloud("scan", prototype).expect("scan");
    for point in points {
        scan.add_point(point.map(RecordValue::Double).to_vec())
            .expect("point");
    }
    scan.finalize().expect("scan");
    writer.finalize().expect("file");
    drop(writer);
    bytes.into_inner()
}

#[test]
fn e57_is_read_and_its_checksums_are_held() {
    let bytes = e57_file(&[[1.0, 2.0, 3.0], [1.0, f64::NAN, 3.0], [4.0, 5.5, 6.0]]);
    expected(&read_bytes(&bytes, CloudFormat::E57).expect("sound"));
    let mut damaged = bytes.clone();
    damaged[100] ^= 1;
    assert!(
        read_bytes(&damaged, CloudFormat::E57).is_err(),
        "a checksum that does not fit"
    );
    let mut lie = bytes.clone();
    lie[32..40].fill(0xff);
    assert!(read_bytes(&lie, CloudFormat::E57).is_err());
    assert!(read_bytes(&bytes[..bytes.len() / 2], CloudFormat::E57).is_err());
}

#[test]
fn names_say_the_format() {
    assert_eq!(
        CloudFormat::of_name(Path::new("a/Tree.LAZ")),
        Ok(CloudFormat::Las)
    );
    assert_eq!(
        CloudFormat::of_name(Path::new("tree.asc")),
        Ok(CloudFormat::Text)
    );
    assert!(CloudFormat::of_name(Path::new("tree.glb")).is_err());
}
