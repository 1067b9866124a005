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
