use super::*;

/// An image of 2 x 1 pixels in ROS 2's serialization, written byte by byte; `order` serializes a number.
fn image_bytes(kind: u8, order: fn(u32) -> [u8; 4]) -> Vec<u8> {
    let mut bytes = vec![0, kind, 0, 0];
    for v in [7, 500_000_000, 5] {
        bytes.extend(order(v));
    }
    // A text with its 0, padded to a multiple of four.
    bytes.extend(b"left\0\0\0\0");
    bytes.extend([1, 2, 6].map(order).concat());
    // The terminating 0, is_bigendian, and a byte of padding.
    bytes.extend(b"mono8\0\0\0");
    bytes.extend([2, 2].map(order).concat());
    bytes.extend([11, 22]);
    bytes
}

#[test]
fn images_are_read_in_either_byte_order() {
    let image = Image {
        header: Header { stamp: Stamp(7_500_000_000), frame_id: "left".into() },
        height: 1,
        width: 2,
        encoding: "mono8".into(),
        is_bigendian: false,
        step: 2,
        data: [11, 22][..].into(),
    };
    let lowest = image_bytes(1, u32::to_le_bytes);
    assert_eq!(Image::decode(&lowest, Encoding::Cdr).unwrap(), image);
    assert_eq!(Image::decode(&image_bytes(0, u32::to_be_bytes), Encoding::Cdr).unwrap(), image);
    assert_eq!(image.encode(), lowest);
    // Control: the byte order matters.
    assert!(Image::decode(&image_bytes(0, u32::to_le_bytes), Encoding::Cdr).is_err());
    // ROS 1 has no padding, a sequence number, and no terminating 0.
    let mut old = [9_u32, 7, 500_000_000, 4].map(u32::to_le_bytes).concat();
    old.extend(b"left");
    old.extend([1_u32, 2, 5].map(u32::to_le_bytes).concat());
    old.extend(b"mono8\0");
    old.extend([2_u32, 2].map(u32::to_le_bytes).concat());
    old.extend([11, 22]);
    assert_eq!(Image::decode(&old, Encoding::Ros1).unwrap(), image);
    assert_eq!(Header::of(&old, Encoding::Ros1).unwrap(), image.header);
}

#[test]
fn truncated_messages_are_refused() {
    let whole = image_bytes(1, u32::to_le_bytes);
    for length in 0..whole.len() {
        assert!(Image::decode(&whole[..length], Encoding::Cdr).is_err(), "{length}");
    }
    // A list that claims 4 GiB allocates nothing.
    let mut huge = whole;
    let at = huge.len() - 6;
    huge[at..at + 4].copy_from_slice(&[0xff; 4]);
    let said = Image::decode(&huge, Encoding::Cdr).unwrap_err().to_string();
    assert_eq!(said, "ends early: 4294967295 bytes should follow, but only 2 do");
    let said = Image::decode(&[0, 9, 0, 0, 1], Encoding::Cdr).unwrap_err().to_string();
    assert!(said.contains("0x00 0x09"), "{said}");
}

#[test]
fn calibrations_round_trip_and_equal_those_of_files() {
    let info = CameraInfo {
        header: Header { stamp: Stamp(1), frame_id: "right".into() },
        height: 480,
        width: 640,
        distortion_model: "plumb_bob".into(),
        d: vec![-0.1, 1e-5, 0.0, 0.001, 0.0],
        k: [500.25, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [500.0, 0.0, 320.0, -60.0, 0.0, 500.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    };
    let bytes = info.encode();
    assert_eq!(CameraInfo::decode(&bytes, Encoding::Cdr).unwrap(), info);
    assert!(info.is_calibrated() && !CameraInfo::default().is_calibrated());
    let mut left = info.clone();
    left.p[3] = 0.0;
    let texts = [("left", left.text()), ("right", info.text())].map(|(name, text)| (name.as_ref(), text));
    let read = mrfgs::calibration::of_texts(&texts).unwrap();
    assert_eq!(read.size, Some((640, 480)));
    let views = read.views.unwrap();
    assert_eq!((views.translation, views.cameras[0].focal_length), ([-0.12, 0.0], [500.0, 500.0]));
    // A rectified view has the same projection and no distortion.
    let view = info.of_rectified();
    assert_eq!((view.k[0], &view.d[..], view.p), (500.0, &[0.0; 5][..], info.p));
}

/// As serialized by Cyclone DDS: identifiers follow texts directly, only numbers are aligned.
#[test]
fn nodes_are_announced_as_in_ros() {
    let node = NodeEntitiesInfo {
        namespace: "/".into(),
        name: "eye".into(),
        readers: vec![vec![3; 16]],
        writers: vec![vec![4; 16], vec![5; 16]],
    };
    let told = ParticipantEntitiesInfo { gid: vec![2; 16], nodes: vec![node] };
    let number = u32::to_le_bytes;
    let bytes = [
        &[0, 1, 0, 0][..],
        &[2; 16],
        &number(1),
        &number(2),
        b"/\0\0\0",
        &number(4),
        b"eye\0",
        &number(1),
        &[3; 16],
        &number(2),
        &[4; 16],
        &[5; 16],
    ];
    assert_eq!(told.encode(), bytes.concat());
}

#[test]
fn times_have_nine_decimals() {
    for (time, text) in [
        (0, "0.000000000"),
        (1_699_999_999_123_456_789, "1699999999.123456789"),
        (-1_500_000_000, "-1.500000000"),
    ] {
        assert_eq!(Stamp(time).to_string(), text);
    }
    let early =
        Image { header: Header { stamp: Stamp(-1_500_000_000), ..Header::default() }, ..Image::default() };
    assert_eq!(Image::decode(&early.encode(), Encoding::Cdr).unwrap(), early);
}

#[test]
fn every_written_type_has_a_definition() {
    for name in [Image::NAME, CameraInfo::NAME, DisparityImage::NAME, PointCloud2::NAME] {
        let text = definition(name);
        assert!(
            text.starts_with("std_msgs/Header header\n") && text.contains("MSG: std_msgs/Header\n"),
            "{name}"
        );
    }
    assert_eq!(definition("std_msgs/msg/String"), "");
}

/// A cloud of rows of points, written byte by byte: fields with their offset and type, then the layout and the data.
fn cloud_bytes(
    size: [u32; 2],
    fields: &[(&str, u32, u8)],
    highest_first: bool,
    steps: [u32; 2],
    data: &[u8],
) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    let number = |bytes: &mut Vec<u8>, v: u32| {
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes.extend(v.to_le_bytes());
    };
    for v in [7, 500_000_000, 6] {
        number(&mut bytes, v);
    }
    bytes.extend(b"lidar\0");
    for v in [size[1], size[0], fields.len() as u32] {
        number(&mut bytes, v);
    }
    for (name, offset, kind) in fields {
        number(&mut bytes, name.len() as u32 + 1);
        bytes.extend(name.as_bytes());
        bytes.push(0);
        number(&mut bytes, *offset);
        bytes.push(*kind);
        number(&mut bytes, 1);
    }
    bytes.push(highest_first.into());
    for v in [steps[0], steps[1], data.len() as u32] {
        number(&mut bytes, v);
    }
    bytes.extend(data);
    bytes.push(1);
    bytes
}

#[test]
fn points_are_read_in_any_layout() {
    let points = |bytes: &[u8]| Scan::decode(bytes, Encoding::Cdr).map(|scan| scan.points);
    let tight = [("x", 0, FLOAT32), ("y", 4, FLOAT32), ("z", 8, FLOAT32)];
    let values = [1.5_f32, -2.0, 3.25, 4.0, 5.0, -6.5];
    let two = [[1.5, -2.0, 3.25], [4.0, 5.0, -6.5]];
    let data = values.map(f32::to_le_bytes).concat();
    let whole = cloud_bytes([2, 1], &tight, false, [12, 24], &data);
    let scan = Scan::decode(&whole, Encoding::Cdr).unwrap();
    assert_eq!(scan.header, Header { stamp: Stamp(7_500_000_000), frame_id: "lidar".into() });
    assert_eq!(scan.points, two);
    // Numbers with the highest byte first, and the control that this is said by the message.
    let swapped = values.map(f32::to_be_bytes).concat();
    assert_eq!(points(&cloud_bytes([2, 1], &tight, true, [12, 24], &swapped)).unwrap(), two);
    assert_ne!(points(&cloud_bytes([2, 1], &tight, false, [12, 24], &swapped)).unwrap(), two);
    // Doubles at odd offsets, in another order, between other fields; two rows with a gap between them.
    let odd =
        [("intensity", 0, UINT8), ("z", 1, FLOAT64), ("x", 9, FLOAT32), ("ring", 13, 4), ("y", 15, FLOAT64)];
    let mut data = Vec::new();
    for [x, y, z] in two {
        data.push(77);
        data.extend(f64::to_le_bytes(z));
        data.extend((x as f32).to_le_bytes());
        data.extend([9, 9]);
        data.extend(f64::to_le_bytes(y));
        data.extend([1, 2, 3]);
    }
    assert_eq!(points(&cloud_bytes([1, 2], &odd, false, [23, 26], &data)).unwrap(), two);
    // The last row may be without its gap, but not without its point.
    assert_eq!(points(&cloud_bytes([1, 2], &odd, false, [23, 26], &data[..49])).unwrap(), two);
    assert!(points(&cloud_bytes([1, 2], &odd, false, [23, 26], &data[..48])).is_err());
    // A single row whose length is not given, points that are not finite, and no points at all.
    let holes = [f32::NAN, 0.0, 0.0, 4.0, 5.0, -6.5].map(f32::to_le_bytes).concat();
    assert_eq!(points(&cloud_bytes([2, 1], &tight, false, [12, 0], &holes)).unwrap(), two[1..]);
    assert_eq!(points(&cloud_bytes([0, 1], &tight, false, [12, 0], &[])).unwrap(), [[0.0; 3]; 0]);
    // What this crate writes.
    let fields = tight.map(|(name, offset, datatype)| PointField { name, offset, datatype }).to_vec();
    let data = values.map(f32::to_le_bytes).concat();
    let written = PointCloud2 { fields, point_step: 12, data, ..PointCloud2::default() };
    assert_eq!(points(&written.encode()).unwrap(), two);
}

#[test]
fn damaged_clouds_are_refused() {
    let refused = |bytes: &[u8]| Scan::decode(bytes, Encoding::Cdr).unwrap_err().to_string();
    let fields = [("x", 0, FLOAT32), ("y", 4, FLOAT32), ("z", 8, FLOAT32)];
    let data = [0; 24];
    let whole = cloud_bytes([2, 1], &fields, false, [12, 24], &data);
    // All but the flag at the end.
    for length in 0..whole.len() - 1 {
        assert!(Scan::decode(&whole[..length], Encoding::Cdr).is_err(), "{length}");
    }
    let of = |size, fields: &[_], steps| refused(&cloud_bytes(size, fields, false, steps, &data));
    for (said, words) in [
        (of([3, 1], &fields, [12, 36]), "24 bytes in rows of 36 for 3 x 1 points of 12 bytes"),
        (of([1, 2], &fields, [12, 8]), "rows of 8"),
        (of([u32::MAX, u32::MAX], &fields, [12, u32::MAX]), "for 4294967295 x 4294967295 points"),
        (of([2, 1], &fields, [11, 24]), "has z at byte 8 of points of 11 bytes"),
        (of([2, 1], &fields, [0, 0]), "has x at byte 0 of points of 0 bytes"),
        (of([2, 1], &fields[..2], [12, 24]), "has no field z"),
        (of([2, 1], &[("x", u32::MAX, FLOAT64), fields[1], fields[2]], [12, 24]), "has x at byte 4294967295"),
        (
            of([2, 1], &[("x", 0, 4), fields[1], fields[2]], [12, 24]),
            "has x of type 4, not float32 or float64",
        ),
    ] {
        assert!(said.contains(words), "no `{words}` in {said}");
    }
}
