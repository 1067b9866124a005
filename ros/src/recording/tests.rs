use std::collections::BTreeMap;
use std::io::Write as _;

use ::mcap::records::MessageHeader;
use bzip2::write::BzEncoder;
use lz4_flex::frame::FrameEncoder;
use tempfile::TempDir;

use super::*;
use crate::messages::{CameraInfo, Encode, Header, Image, Stamp, definition};

fn frame(number: i64) -> Image<'static> {
    let stamp = Stamp(1_000_000_000 * number);
    let header = Header { stamp, frame_id: "left".into() };
    let data = vec![number as u8; 1000];
    Image {
        header,
        width: 1000,
        height: 1,
        step: 1000,
        encoding: "mono8".into(),
        data: data.into(),
        ..Image::default()
    }
}

/// The messages of the topic `/left/image`, and the error at the end.
fn read(path: &Path) -> (Vec<Vec<u8>>, Option<String>) {
    let recording = match Recording::open(path) {
        Ok(recording) => recording,
        Err(error) => return (Vec::new(), Some(error.to_string())),
    };
    let (mut messages, mut said) = (Vec::new(), None);
    for message in recording.messages(&["/left/image"]) {
        match message {
            Ok(message) => messages.push(message.data),
            Err(error) => said = Some(error.to_string()),
        }
    }
    (messages, said)
}

/// A file written by the crate `mcap`, in chunks of about three images.
fn foreign(path: &Path) -> Vec<Vec<u8>> {
    let file = fs::File::create(path).unwrap();
    let options = ::mcap::WriteOptions::new().profile("ros2").chunk_size(Some(3000));
    let mut writer = options.create(std::io::BufWriter::new(file)).unwrap();
    let schema = writer.add_schema(<Image as crate::messages::Type>::NAME, "ros2msg", b"").unwrap();
    let images = writer.add_channel(schema, "/left/image", "cdr", &BTreeMap::new()).unwrap();
    let others = writer.add_channel(0, "/other", "json", &BTreeMap::new()).unwrap();
    let mut all = Vec::new();
    for number in 0..10 {
        let header = MessageHeader { channel_id: others, sequence: 0, log_time: 1, publish_time: 1 };
        writer.write_to_known_channel(&header, b"{}").unwrap();
        let bytes = frame(number).encode();
        writer.write_to_known_channel(&MessageHeader { channel_id: images, ..header }, &bytes).unwrap();
        all.push(bytes);
    }
    writer.finish().unwrap();
    all
}

#[test]
fn files_of_the_mcap_crate_are_read() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let all = foreign(&path);
    assert_eq!(read(&path), (all, None));
    let recording = Recording::open(&path).unwrap();
    let topics: Vec<_> = recording.topics().iter().map(|topic| (topic.name.as_str(), topic.count)).collect();
    assert_eq!(topics, [("/left/image", Some(10)), ("/other", Some(10))]);
    assert!(Recording::is(&path) && !Recording::is(folder.path()));
}

/// With any damage, everything before it is read, and nothing panics.
#[test]
fn everything_before_damage_is_read() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let all = foreign(&path);
    let whole = fs::read(&path).unwrap();
    let mut least = usize::MAX;
    for length in (0..whole.len()).step_by(97) {
        fs::write(&path, &whole[..length]).unwrap();
        let (messages, said) = read(&path);
        assert_eq!(messages, all[..messages.len()], "{length}");
        least = least.min(messages.len());
        // Cuts after the last message lose nothing.
        assert!(said.is_some_and(|said| said.contains("a.mcap")) || messages.len() == 10, "{length}");
    }
    assert_eq!(least, 0);
    // Changes each byte in turn: messages may be lost, but none changes, as checksums cover them.
    for at in (8..whole.len()).step_by(61) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x41;
        fs::write(&path, damaged).unwrap();
        let (messages, _) = read(&path);
        assert_eq!(messages, all[..messages.len()], "{at}");
    }
    // Texts that claim 4 GiB, in a channel, its metadata, and a chunk.
    for (kind, start) in
        [(4, &[1, 0, 0, 0][..]), (4, &[&[1, 0, 0, 0][..], &[0; 8], &[4, 0, 0, 0]].concat()), (6, &[0; 28])]
    {
        let body = [start, &[0xff; 4]].concat();
        fs::write(&path, [MAGIC, &[kind], &(body.len() as u64).to_le_bytes(), &body].concat()).unwrap();
        let said = read(&path).1.unwrap();
        assert!(said.contains("a text has no end"), "{said}");
    }
    // A record of 8 EiB, and a chunk that claims 1 TiB.
    for (kind, body) in [(3, &[][..]), (6, &[&[0; 16][..], &(1_u64 << 40).to_le_bytes(), &[0; 16]].concat())]
    {
        let length = if body.is_empty() { 1 << 63 } else { body.len() as u64 };
        let bytes = [MAGIC, &[kind], &length.to_le_bytes(), body].concat();
        fs::write(&path, bytes).unwrap();
        let said = read(&path).1.unwrap();
        assert!(said.contains("cut off") || said.contains("claims 1099511627776 bytes"), "{said}");
    }
}

#[test]
fn chunks_may_be_compressed() {
    let bytes = frame(3).encode();
    let mut lz4 = FrameEncoder::new(Vec::new());
    lz4.write_all(&bytes).unwrap();
    let mut bz2 = BzEncoder::new(Vec::new(), bzip2::Compression::fast());
    bz2.write_all(&bytes).unwrap();
    let zstd = ruzstd::encoding::compress_to_vec(&bytes[..], ruzstd::encoding::CompressionLevel::Fastest);
    for (packed, method) in [
        (lz4.finish().unwrap(), "lz4"),
        (bz2.finish().unwrap(), "bz2"),
        (zstd, "zstd"),
        (bytes.clone(), "none"),
    ] {
        let size = bytes.len() as u64;
        assert_eq!(chunk::unpacked(&packed, method, size).unwrap(), bytes, "{method}");
        for (size, words) in
            [(size - 1, "contains more than"), (size + 1, "claims"), (1 << 40, "at most 1073741824")]
        {
            let said = chunk::unpacked(&packed, method, size).unwrap_err().to_string();
            assert!(said.contains(words), "{method}: {said}");
        }
        let said = chunk::unpacked(&packed[..packed.len() / 2], method, size).unwrap_err().to_string();
        assert!(said.contains("is damaged"), "{method}: {said}");
    }
    assert!(chunk::unpacked(&bytes, "rar", 1).unwrap_err().to_string().contains("compressed by `rar`"));
}

#[test]
fn written_files_are_read_by_the_mcap_crate() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = Writer::new(fs::File::create(&path).unwrap()).unwrap();
    let mut all = Vec::new();
    for number in 0..10_000 {
        let frame = frame(number);
        writer.add("/left/image", frame.header.stamp, &frame).unwrap();
        all.push(frame.encode());
        if number % 1000 == 0 {
            writer.add("/left/camera_info", frame.header.stamp, &CameraInfo::default()).unwrap();
        }
    }
    writer.finish().unwrap();
    assert_eq!(read(&path), (all.clone(), None));
    // Read by the crate, with index, summary and all checksums.
    let bytes = fs::read(&path).unwrap();
    let stream = ::mcap::Summary::read(&bytes).unwrap().unwrap();
    let statistics = stream.stats.unwrap();
    assert_eq!((statistics.message_count, statistics.chunk_count), (10_010, 3));
    assert_eq!(stream.chunk_indexes.len(), 3);
    assert_eq!(statistics.message_end_time, 9_999_000_000_000);
    let schema = stream.schemas.values().find(|schema| schema.name == "sensor_msgs/msg/Image").unwrap();
    assert_eq!(&schema.data[..], definition("sensor_msgs/msg/Image").as_bytes());
    let options = ::mcap::sans_io::LinearReaderOptions::default()
        .with_emit_chunks(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = ::mcap::sans_io::LinearReader::new_with_options(options);
    let (mut rest, mut chunks, mut indexed) = (&bytes[..], 0, 0);
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            ::mcap::sans_io::LinearReadEvent::ReadRequest(need) => {
                let count = need.min(rest.len());
                reader.insert(count).copy_from_slice(&rest[..count]);
                reader.notify_read(count);
                rest = &rest[count..];
            }
            ::mcap::sans_io::LinearReadEvent::Record { data, opcode } => {
                match ::mcap::parse_record(opcode, data).unwrap() {
                    ::mcap::records::Record::Chunk { .. } => chunks += 1,
                    ::mcap::records::Record::MessageIndex(index) => indexed += index.records.len(),
                    _ => {}
                }
            }
        }
    }
    assert_eq!((chunks, indexed), (3, 10_010));
    // Control: one byte of a chunk is changed.
    let mut damaged = bytes;
    damaged[2000] ^= 1;
    fs::write(&path, damaged).unwrap();
    assert!(read(&path).1.unwrap().contains("the chunk at byte"));
}

/// A record of a bag.
fn bag_record(fields: &[(&str, &[u8])], body: &[u8]) -> Vec<u8> {
    let mut head = Vec::new();
    for (name, value) in fields {
        head.extend((name.len() as u32 + 1 + value.len() as u32).to_le_bytes());
        head.extend([name.as_bytes(), b"=", value].concat());
    }
    let lengths = [&head[..], body].map(|part| (part.len() as u32).to_le_bytes());
    [&lengths[0][..], &head, &lengths[1], body].concat()
}

#[test]
fn bags_are_read() {
    let connection = |id: u32, topic: &str, kind: &str| {
        let about = bag_record(&[("topic", topic.as_bytes()), ("type", kind.as_bytes())], &[]);
        // Without the lengths of head and body.
        bag_record(
            &[("op", &[7]), ("conn", &id.to_le_bytes()), ("topic", topic.as_bytes())],
            &about[4..about.len() - 4],
        )
    };
    let message = |id: u32, body: &[u8]| {
        bag_record(&[("op", &[2]), ("conn", &id.to_le_bytes()), ("time", &[0; 8])], body)
    };
    let first =
        [connection(0, "/left/image", "sensor_msgs/Image"), message(0, b"one"), connection(1, "/a", "b/C")]
            .concat();
    let second = [message(1, b"other"), message(0, b"two")].concat();
    let mut packed = FrameEncoder::new(Vec::new());
    packed.write_all(&second).unwrap();
    let chunk = |method: &str, size: usize, data: &[u8]| {
        bag_record(
            &[("op", &[5]), ("compression", method.as_bytes()), ("size", &(size as u32).to_le_bytes())],
            data,
        )
    };
    let chunks =
        [chunk("none", first.len(), &first), chunk("lz4", second.len(), &packed.finish().unwrap())].concat();
    let index = [connection(0, "/left/image", "sensor_msgs/Image"), connection(1, "/a", "b/C")].concat();
    let bag = |index_at: u64| {
        let head = bag_record(&[("op", &[3]), ("index_pos", &index_at.to_le_bytes())], &[b' '; 100]);
        [bag::MAGIC, &head[..]].concat()
    };
    let index_at = (bag(0).len() + chunks.len()) as u64;
    let whole = [bag(index_at), chunks.clone(), index].concat();
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.bag");
    fs::write(&path, &whole).unwrap();
    assert_eq!(read(&path), (vec![b"one".to_vec(), b"two".to_vec()], None));
    let topics = Recording::open(&path).unwrap().topics().to_vec();
    assert_eq!((topics.len(), topics[1].kind.as_str()), (2, "sensor_msgs/msg/Image"));
    // A bag that was not closed: all messages are read, and the end is reported as missing.
    fs::write(&path, [bag(0), chunks].concat()).unwrap();
    let (messages, said) = read(&path);
    assert_eq!(messages.len(), 2);
    assert!(said.unwrap().contains("not closed"));
    // Cut anywhere or with any byte changed, nothing panics.
    for length in 0..whole.len() {
        fs::write(&path, &whole[..length]).unwrap();
        let _ = read(&path);
        let mut damaged = whole.clone();
        damaged[length] ^= 0x81;
        fs::write(&path, damaged).unwrap();
        let _ = read(&path);
    }
}

/// A ROS 2 bag written by SQLite, with ten images among many texts.
fn of_sqlite(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus/recording").join(name)
}

#[test]
fn bags_in_sqlite_are_read() {
    let all: Vec<_> = (0..10).map(|number| frame(number).encode()).collect();
    // Pages of 4096 bytes by rosbags, and of 512 bytes with interior pages and a long topic entry.
    for (name, others) in [("rosbags.db3", 10), ("small.db3", 120)] {
        let path = of_sqlite(name);
        assert_eq!(read(&path), (all.clone(), None), "{name}");
        let recording = Recording::open(&path).unwrap();
        let topics: Vec<_> =
            recording.topics().iter().map(|topic| (topic.name.as_str(), topic.count)).collect();
        assert_eq!(topics, [("/left/image", Some(10)), ("/other", Some(others))]);
    }
}

/// With any damage nothing panics or loops forever, and everything before a cut is unchanged.
#[test]
fn damaged_databases_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.db3");
    let whole = fs::read(of_sqlite("small.db3")).unwrap();
    let all: Vec<_> = (0..10).map(|number| frame(number).encode()).collect();
    for length in (0..whole.len()).step_by(97) {
        fs::write(&path, &whole[..length]).unwrap();
        let (messages, said) = read(&path);
        assert_eq!(messages, all[..messages.len()], "{length}");
        assert!(said.is_some_and(|said| said.contains("a.db3")), "{length}");
    }
    let mut refused = 0;
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x81;
        fs::write(&path, damaged).unwrap();
        refused += usize::from(read(&path).1.is_some());
    }
    // Changes in messages or unused bytes are not noticed, as SQLite has no checksums.
    assert!((200..whole.len() / 2).contains(&refused), "{refused}");
    // Files with the last changes beside it.
    fs::write(&path, &whole).unwrap();
    fs::write(folder.path().join("a.db3-journal"), [0; 512]).unwrap();
    assert_eq!(read(&path).1, None, "a finished journal");
    fs::write(folder.path().join("a.db3-wal"), "x").unwrap();
    let said = read(&path).1.unwrap();
    assert!(said.contains("was not closed") && said.contains("a.db3-wal"), "{said}");
}

#[test]
fn messages_may_be_compressed_individually() {
    let bytes = frame(3).encode();
    let zstd = ruzstd::encoding::compress_to_vec(&bytes[..], ruzstd::encoding::CompressionLevel::Fastest);
    assert_eq!(chunk::unpacked_alone(&zstd).unwrap(), bytes);
    for broken in [&zstd[..zstd.len() / 2], b"\x28\xb5\x2f\xfd"] {
        let said = chunk::unpacked_alone(broken).unwrap_err().to_string();
        assert!(said.contains("is damaged") || said.contains("is not zstd"), "{said}");
    }
}

#[test]
fn folders_have_their_files_in_order() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("metadata.yaml"), "").unwrap();
    assert!(!Recording::is(folder.path()), "it may contain images");
    let said = |words: &str| {
        let said = Recording::open(folder.path()).unwrap_err().to_string();
        assert!(said.contains(words), "{said}");
    };
    said("no MCAP or .db3 file");
    for number in [0_i64, 9, 10] {
        let mut writer = Writer::new(fs::File::create(at(&format!("drive_{number}.mcap"))).unwrap()).unwrap();
        writer.add("/left/image", Stamp(number), &frame(number)).unwrap();
        writer.finish().unwrap();
    }
    assert!(Recording::is(folder.path()));
    assert_eq!(read(folder.path()), ([0, 9, 10].map(|number| frame(number).encode()).to_vec(), None));
    assert_eq!(Recording::open(folder.path()).unwrap().topics()[0].count, Some(3));
    fs::write(at("drive_11.db3"), "").unwrap();
    said("drive_11.db3: is empty");
    fs::copy(of_sqlite("small.db3"), at("drive_11.db3")).unwrap();
    assert_eq!(Recording::open(folder.path()).unwrap().topics()[0].count, Some(13));
    fs::write(at("drive_12.mcap.zstd"), "").unwrap();
    said("drive_12.mcap.zstd: is empty");
}

/// The claims of `rosbag2` about its files are checked.
#[test]
fn metadata_is_checked() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    for number in [0_i64, 1] {
        let mut writer = Writer::new(fs::File::create(at(&format!("a_{number}.mcap"))).unwrap()).unwrap();
        writer.add("/left/image", Stamp(number), &frame(number)).unwrap();
        writer.finish().unwrap();
    }
    let metadata = |files: &str, count: u64, codec: &str| {
        let text = format!(
            "rosbag2_bagfile_information:\n  message_count: {count}\n  compression_format: {codec}\n  relative_file_paths:\n{files}"
        );
        fs::write(at("metadata.yaml"), text).unwrap();
    };
    let both = "  - a_0.mcap\n  - a_1.mcap\n";
    metadata(both, 2, "''");
    assert_eq!(read(folder.path()).0.len(), 2);
    assert_eq!(Recording::open(folder.path()).unwrap().missing(), None);
    metadata(both, 5, "''");
    assert_eq!(Recording::open(folder.path()).unwrap().missing(), Some((5, 2)));
    metadata(&format!("{both}  - a_2.mcap\n"), 3, "''");
    let said = read(folder.path()).1.unwrap();
    assert!(said.contains("a_2.mcap: there is no such file, but metadata.yaml lists it"), "{said}");
    metadata(both, 2, "fake_comp");
    assert!(read(folder.path()).1.unwrap().contains("compressed by `fake_comp`"));
    // A file that was compressed since, and one beside its decompressed copy.
    metadata(both, 2, "zstd");
    let packed = zstd(&fs::read(at("a_1.mcap")).unwrap());
    fs::write(at("a_1.mcap.zstd"), &packed).unwrap();
    assert_eq!(read(folder.path()).0.len(), 2);
    fs::remove_file(at("a_1.mcap")).unwrap();
    assert_eq!(read(folder.path()), ([0, 1].map(|number| frame(number).encode()).to_vec(), None));
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
}

#[test]
fn files_may_be_compressed_as_a_whole() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.db3.zstd");
    let whole = fs::read(of_sqlite("small.db3")).unwrap();
    let all: Vec<_> = (0..10).map(|number| frame(number).encode()).collect();
    // As one frame, or as two frames.
    let halves = [zstd(&whole[..1000]), zstd(&whole[1000..])].concat();
    for packed in [zstd(&whole), halves] {
        fs::write(&path, &packed).unwrap();
        assert!(Recording::is(&path));
        assert_eq!(read(&path), (all.clone(), None));
        fs::write(&path, &packed[..packed.len() / 2]).unwrap();
        let said = read(&path).1.unwrap();
        assert!(said.contains("a.db3.zstd: is damaged or cut off"), "{said}");
    }
    fs::write(&path, zstd(b"a text")).unwrap();
    let said = read(&path).1.unwrap();
    assert!(said.contains("a.db3.zstd: is not a ROS 2 bag"), "{said}");
    // The decompressed copy is removed with the recording.
    fs::write(&path, zstd(&whole)).unwrap();
    let recording = Recording::open(&path).unwrap();
    let copy = recording.files[0].0.file().to_owned();
    let messages = recording.messages(&["/left/image"]);
    drop(recording);
    assert!(copy.is_file() && copy != path);
    assert_eq!(messages.count(), 10);
    assert!(!copy.exists());
}

/// A message of an MCAP file that is individually compressed, as by `rosbag2`.
#[test]
fn messages_of_mcap_files_may_be_compressed_individually() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.mcap");
    let file = std::io::BufWriter::new(fs::File::create(&path).unwrap());
    let mut writer = ::mcap::WriteOptions::new().compression(None).create(file).unwrap();
    let schema = writer.add_schema(<Image as crate::messages::Type>::NAME, "ros2msg", b"").unwrap();
    let images = writer.add_channel(schema, "/left/image", "cdr", &BTreeMap::new()).unwrap();
    let header = MessageHeader { channel_id: images, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, &zstd(&frame(3).encode())).unwrap();
    writer.finish().unwrap();
    assert_eq!(read(&path), (vec![frame(3).encode()], None));
}

#[test]
fn files_that_are_not_recordings_are_refused() {
    let folder = TempDir::new().unwrap();
    for (name, content, words) in [
        ("a.mcap", &b""[..], "a.mcap: is empty"),
        ("a.mcap", b"a text", "is not an MCAP file"),
        ("a.bag", b"a text", "is not a ROS 1 bag"),
        ("a.bag", b"#ROSBAG V1.2\n", "is not a ROS 1 bag"),
        ("a.db3", b"a text", "is not a ROS 2 bag"),
        ("a.db3", b"SQLite format 3\0", "is not an SQLite database: it is shorter"),
        ("a.bag", b"#ROSBAG V2.0\n\xff\xff\xff\xff", "is cut off"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let said = Recording::open(&path).unwrap_err().to_string();
        assert!(said.contains(words), "{said}");
    }
    assert!(
        Recording::open(&folder.path().join("none.mcap")).unwrap_err().to_string().contains("no such file")
    );
}
