//! `mrfgs sequence` with recordings: the maps equal those of `match`, and written recordings contain them. Messages are serialized and
//! parsed independently here.

use std::io::Read;

use mcap::records::MessageHeader;
use mrfgs::image::read::Reader;

use super::*;

const SIZE: (u32, u32) = (64, 48);
const SCENES: [&str; 3] = ["slanted", "thin", "repetitive"];
/// Each frame is measured, because they show different scenes.
const RANGE: &str = "--max-disparity 23 --device cpu --set measure-every=1";
const START: u64 = 1_700_000_000_000_000_000;
const SECOND: u64 = 1_000_000_000;
/// Nanoseconds between two frames.
const STEP: u64 = 50_000_000;

fn frame(scene_name: &str, view: usize) -> image::RgbImage {
    let image = image::open(scene(scene_name).join(format!("im{view}.png"))).unwrap();
    image.crop_imm(90, 70, SIZE.0, SIZE.1).to_rgb8()
}

/// A message in ROS 2's serialization; each number is aligned to its size.
struct Bytes(Vec<u8>);

impl Bytes {
    fn with_header(stamp: u64, frame_id: &str) -> Self {
        Self(vec![0, 1, 0, 0]).header(stamp, frame_id)
    }

    /// A nested message has its own header.
    fn with_header_again(self, stamp: u64) -> Self {
        self.header(stamp, "camera")
    }

    fn header(self, stamp: u64, frame_id: &str) -> Self {
        self.u32((stamp / 1_000_000_000) as u32).u32((stamp % 1_000_000_000) as u32).text(frame_id)
    }

    fn filled(mut self, to: usize) -> Self {
        while !(self.0.len() - 4).is_multiple_of(to) {
            self.0.push(0);
        }
        self
    }

    fn u32(self, v: u32) -> Self {
        let mut filled = self.filled(4);
        filled.0.extend(v.to_le_bytes());
        filled
    }

    fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    fn text(self, text: &str) -> Self {
        self.u32(text.len() as u32 + 1).bytes(text.as_bytes()).bytes(&[0])
    }

    fn doubles(self, values: &[f64]) -> Self {
        let filled = self.filled(8);
        values.iter().fold(filled, |all, v| all.bytes(&v.to_le_bytes()))
    }
}

fn image_message(stamp: u64, image: &image::RgbImage) -> Vec<u8> {
    let (width, height) = image.dimensions();
    let message = Bytes::with_header(stamp, "camera").u32(height).u32(width).text("rgb8").bytes(&[0]);
    message.u32(3 * width).u32(image.as_raw().len() as u32).bytes(image.as_raw()).0
}

/// Two equal cameras, 0.2 m apart, with lens, rotation and projection as in `camera_file`.
fn camera_info(view: usize, (width, height): (u32, u32)) -> Vec<u8> {
    let (k, d, r, p) = camera(view, (width, height));
    let message = Bytes::with_header(0, "camera").u32(height).u32(width).text("plumb_bob").u32(5);
    let message = message.doubles(&d).doubles(&k).doubles(&r).doubles(&p);
    message.u32(0).u32(0).u32(0).u32(0).u32(0).u32(0).bytes(&[0]).0
}

type Camera = ([f64; 9], [f64; 5], [f64; 9], [f64; 12]);

fn camera(view: usize, (width, height): (u32, u32)) -> Camera {
    let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    let k = [60.0, 0.0, cx, 0.0, 60.0, cy, 0.0, 0.0, 1.0];
    let p = [60.0, 0.0, cx, [0.0, -12.0][view], 0.0, 60.0, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    (k, [-0.1, 0.02, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], p)
}

/// As saved by `camera_calibration`.
fn camera_file(view: usize) -> String {
    let (k, d, r, p) = camera(view, SIZE);
    let matrix = |name: &str, (rows, cols): (usize, usize), data: &[f64]| {
        format!("{name}:\n  rows: {rows}\n  cols: {cols}\n  data: {data:?}\n")
    };
    let matrices = [
        matrix("camera_matrix", (3, 3), &k),
        matrix("distortion_coefficients", (1, 5), &d),
        matrix("rectification_matrix", (3, 3), &r),
        matrix("projection_matrix", (3, 4), &p),
    ];
    format!("image_width: 64\nimage_height: 48\ndistortion_model: plumb_bob\n{}", matrices.concat())
}

/// A message: topic, type and bytes.
type Message = (String, &'static str, Vec<u8>);

const IMAGE: &str = "sensor_msgs/msg/Image";
const CAMERA: &str = "sensor_msgs/msg/CameraInfo";

/// Images of all scenes on `/left/TOPIC` and `/right/TOPIC`, the right ones `apart` nanoseconds later.
fn images(topic: &str, apart: u64) -> Vec<Message> {
    let mut messages = Vec::new();
    for (n, scene) in SCENES.iter().enumerate() {
        for (view, side) in ["left", "right"].into_iter().enumerate() {
            let stamp = START + STEP * n as u64 + apart * view as u64;
            messages.push((format!("/{side}/{topic}"), IMAGE, image_message(stamp, &frame(scene, view))));
        }
    }
    messages
}

fn cameras(size: (u32, u32)) -> Vec<Message> {
    let info = |(view, side)| (format!("/{side}/camera_info"), CAMERA, camera_info(view, size));
    ["left", "right"].into_iter().enumerate().map(info).collect()
}

/// Writes the messages with the mcap crate, in chunks of one or two images.
fn record(path: &Path, messages: &[Message]) {
    let options = mcap::WriteOptions::new().profile("ros2").chunk_size(Some(12_000)).compression(None);
    let mut writer = options.create(std::io::BufWriter::new(fs::File::create(path).unwrap())).unwrap();
    for (time, (topic, kind, bytes)) in messages.iter().enumerate() {
        let schema = writer.add_schema(kind, "ros2msg", b"").unwrap();
        let channel_id = writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap();
        let time = START + time as u64;
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, bytes).unwrap();
    }
    writer.finish().unwrap();
}

/// Writes a recording of three rectified frames of 320 x 240.
pub(super) fn record_drive(path: &Path) {
    let mut messages = cameras((320, 240));
    for n in 0..3 {
        for (view, side) in ["left", "right"].into_iter().enumerate() {
            let image = image::open(scene("mixed").join(format!("im{view}.png"))).unwrap().to_rgb8();
            let stamp = START + 123_456_789 + STEP * n;
            messages.push((format!("/{side}/image_rect_color"), IMAGE, image_message(stamp, &image)));
        }
    }
    record(path, &messages);
}

const NAMES: [&str; 3] = ["1700000000.000000000", "1700000000.050000000", "1700000000.100000000"];

/// The files that `match` writes for each scene, selected by their endings.
fn wanted(folder: &Path, ends: &[&str], flags: &str) -> Vec<Vec<Vec<u8>>> {
    let outside = Folder::new();
    for view in [0, 1] {
        fs::write(outside.join(format!("{view}.yaml")), camera_file(view)).unwrap();
    }
    let maps: Vec<Vec<Vec<u8>>> = SCENES
        .iter()
        .map(|scene| {
            for view in [0, 1] {
                frame(scene, view).save(outside.join(format!("{view}.png"))).unwrap();
            }
            run(&outside, &format!("match 0.png 1.png w.pfm --quiet {RANGE} {flags}")).succeeded();
            ends.iter().map(|end| fs::read(outside.join(format!("w.{end}"))).unwrap()).collect()
        })
        .collect();
    assert!(maps[0] != maps[1] && maps[1] != maps[2], "control: all frames differ");
    assert!(!folder.join("w.pfm").exists());
    maps
}

fn found(folder: &Path, ends: &[&str]) -> Vec<Vec<Vec<u8>>> {
    let file = |name: &str, end: &str| fs::read(folder.join(format!("{name}.{end}"))).unwrap();
    NAMES.iter().map(|name| ends.iter().map(|end| file(name, end)).collect()).collect()
}

#[test]
fn recordings_give_the_maps_of_match() {
    let folder = Folder::new();
    let wanted = wanted(&folder, &["pfm"], "");
    let path = folder.join("drive.mcap");
    let run_it =
        |flags: &str, output: &str| run(&folder, &format!("sequence drive.mcap {output} {RANGE} {flags}"));
    record(&path, &images("image_rect", 0));
    run_it("", "maps").succeeded().says("3 frames of 64 x 48, 24 disparities");
    assert_eq!(found(&folder.join("maps"), &["pfm"]), wanted);
    assert_eq!(listing(&folder.join("maps")).len(), 3);
    // In any order, with other names, and not triggered simultaneously.
    let mut messages = images("image_rect", 0);
    messages.sort_by_key(|(topic, ..)| std::cmp::Reverse(topic.clone()));
    messages.rotate_left(1);
    record(&path, &messages);
    run_it("--quiet", "sorted").succeeded();
    assert_eq!(found(&folder.join("sorted"), &["pfm"]), wanted);
    record(&path, &images("image_rect", 2_000_000));
    run_it("--quiet", "never").failed(1, "no image of /left/image_rect & --tolerance");
    run_it("--quiet --tolerance 0.0019", "never").failed(1, "--tolerance");
    run_it("--quiet --tolerance 0.002", "near").succeeded();
    assert_eq!(found(&folder.join("near"), &["pfm"]), wanted);
    // Control: swapped topics give other maps.
    run_it("--quiet --tolerance 0.002 --topics right/image_rect,left/image_rect", "swapped").succeeded();
    let swapped = fs::read_dir(folder.join("swapped")).unwrap().next().unwrap().unwrap().path();
    assert!(wanted.iter().flatten().all(|map| *map != fs::read(&swapped).unwrap()));
    // Images without a partner are skipped and counted.
    let mut messages = images("image_rect", 0);
    messages.remove(3);
    messages.push(messages[0].clone());
    record(&path, &messages);
    run_it("", "gaps")
        .succeeded()
        .says("1 left and 0 right images had no partner, 1 image had the same time as another one");
    assert_eq!(listing(&folder.join("gaps")).len(), 2);
    // The folder of a recording in two files.
    fs::create_dir(folder.join("bag")).unwrap();
    fs::write(folder.join("bag/metadata.yaml"), "rosbag2_bagfile_information:\n").unwrap();
    let messages = images("image_rect", 0);
    for (file, part) in [("bag_9.mcap", &messages[..3]), ("bag_10.mcap", &messages[3..])] {
        record(&folder.join("bag").join(file), part);
    }
    run(&folder, &format!("sequence bag of-bag {RANGE} --quiet")).succeeded();
    assert_eq!(found(&folder.join("of-bag"), &["pfm"]), wanted);
}

/// A message has no entry for the unit, so the remedy is another calibration.
#[test]
fn a_doubtful_unit_in_a_recording_is_reported() {
    let folder = Folder::new();
    let mut messages = [cameras(SIZE), images("image_rect", 0)].concat();
    let right = &mut messages[1].2;
    let offset = right.windows(8).position(|bytes| bytes == (-12.0_f64).to_le_bytes()).unwrap();
    right[offset..offset + 8].copy_from_slice(&(-0.012_f64).to_le_bytes());
    record(&folder.join("drive.mcap"), &messages);
    run(&folder, &format!("sequence drive.mcap maps {RANGE} --also depth")).succeeded().says(
        "drive.mcap:/left/camera_info: & 0.0002 m apart & the unit may be wrong: give another calibration with --calib",
    );
}

/// The calibration in a recording is equivalent to ROS's own files.
#[test]
fn calibrations_in_recordings_are_those_of_files() {
    let folder = Folder::new();
    let path = folder.join("drive.mcap");
    let ends = ["pfm", "depth.pfm", "points.ply"];
    let of_files = wanted(&folder, &ends, "--rectify --calib 0.yaml --calib 1.yaml --also depth,points");
    // They come after the first images.
    record(&path, &[images("image_raw", 0), cameras(SIZE)].concat());
    run(&folder, &format!("sequence drive.mcap maps {RANGE} --quiet --also depth,points --json maps.jsonl"))
        .succeeded();
    assert_eq!(found(&folder.join("maps"), &ends), of_files);
    let text = fs::read_to_string(folder.join("maps.jsonl")).unwrap();
    assert!(
        text.contains("\"calibration\":\"drive.mcap:/left/camera_info, drive.mcap:/right/camera_info\""),
        "{text}"
    );
    assert!(
        text.contains("\"rectified\":true") && text.contains("\"frame\":\"1700000000.050000000\""),
        "{text}"
    );
    // Rectified images use the cameras without being rectified again.
    record(&path, &[cameras(SIZE), images("image_rect", 0)].concat());
    run(&folder, &format!("sequence drive.mcap rect {RANGE} --quiet --also depth")).succeeded();
    let of_rect = wanted(&folder, &["pfm", "depth.pfm"], "--calib 0.yaml --calib 1.yaml --also depth");
    assert_eq!(found(&folder.join("rect"), &["pfm", "depth.pfm"]), of_rect);
    assert_ne!(of_rect[0][0], of_files[0][0], "control: unrectified images are another pair");
    // The user's own calibration takes precedence.
    let calib = "cam0=[60 0 32; 0 60 24; 0 0 1]\ndoffs=0\nbaseline=400\nunit=mm\n";
    fs::write(folder.join("calib.txt"), calib).unwrap();
    let line = format!("sequence drive.mcap own {RANGE} --quiet --also depth --calib calib.txt");
    run(&folder, &line).succeeded();
    let depth = |folder_name: &str| {
        read_pfm(folder.join(folder_name).join(format!("{}.depth.pfm", NAMES[0]))).data().to_vec()
    };
    for (ours, theirs) in depth("own").iter().zip(depth("rect")) {
        assert!(theirs.is_infinite() && ours.is_infinite() || (ours / theirs / 2000.0 - 1.0).abs() < 1e-6);
    }
}

/// The messages of a topic: times and bytes.
pub(super) fn messages(path: &Path, topic: &str) -> Vec<(u64, Vec<u8>)> {
    let bytes = fs::read(path).unwrap();
    // Chunks are compressed by LZ4, for which the mcap crate would need a C library.
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let channel = summary.channels.values().find(|channel| channel.topic == topic).unwrap();
    let mut found = Vec::new();
    for record in mcap::read::LinearReader::new(&bytes).unwrap() {
        let mcap::records::Record::Chunk { header, data } = record.unwrap() else { continue };
        let mut records = Vec::new();
        lz4_flex::frame::FrameDecoder::new(&data[..]).read_to_end(&mut records).unwrap();
        assert_eq!(records.len() as u64, header.uncompressed_size);
        for record in mcap::read::LinearReader::sans_magic(&records) {
            if let mcap::records::Record::Message { header, data } = record.unwrap()
                && header.channel_id == channel.id
            {
                found.push((header.log_time, data.into_owned()));
            }
        }
    }
    found
}

#[test]
fn recordings_contain_the_results_of_match() {
    let folder = Folder::new();
    record(&folder.join("drive.mcap"), &[cameras(SIZE), images("image_rect", 0)].concat());
    let also = "--also depth,depth-mm,confidence,sigma";
    run(&folder, &format!("sequence drive.mcap found.mcap {RANGE} --quiet {also}")).succeeded();
    let ends = ["pfm", "depth.pfm", "depth-mm.png", "confidence.png", "sigma.pfm"];
    let wanted = wanted(&folder, &ends, &format!("--calib 0.yaml --calib 1.yaml {also}"));
    let header = |stamp: u64| Bytes::with_header(stamp, "camera");
    let image = |start: Bytes, encoding: &str, bytes: usize, data: &[u8]| {
        let start = start.u32(SIZE.1).u32(SIZE.0).text(encoding).bytes(&[0]);
        start.u32(SIZE.0 * bytes as u32).u32(data.len() as u32).bytes(data)
    };
    let all = |topic: &str| messages(&folder.join("found.mcap"), topic);
    let floats = |bytes: &[u8], none: f32| -> Vec<u8> {
        fs::write(folder.join("map.pfm"), bytes).unwrap();
        let map = read_pfm(folder.join("map.pfm"));
        map.data().iter().flat_map(|v| if v.is_finite() { *v } else { none }.to_le_bytes()).collect()
    };
    for (n, files) in wanted.iter().enumerate() {
        let stamp = START + STEP * n as u64;
        let disparity = image(header(stamp).with_header_again(stamp), "32FC1", 4, &floats(&files[0], -1.0));
        let end = [60.0_f32, 0.2].into_iter().fold(disparity.filled(4), |all, v| all.bytes(&v.to_le_bytes()));
        let end = end.u32(0).u32(0).u32(SIZE.1).u32(SIZE.0).bytes(&[0]).filled(4);
        fs::write(folder.join("sigma.pfm"), &files[4]).unwrap();
        let mut sigmas = read_pfm(folder.join("sigma.pfm")).into_data();
        sigmas.retain(|sigma| sigma.is_finite());
        sigmas.sort_by(f32::total_cmp);
        let end = [0.0_f32, 23.0, sigmas[(sigmas.len() - 1) / 2]]
            .into_iter()
            .fold(end, |all, v| all.bytes(&v.to_le_bytes()));
        assert!(all("/disparity")[n] == (stamp, end.0), "frame {n}");
        let sigma = image(header(stamp), "32FC1", 4, &floats(&files[4], f32::NAN));
        assert!(all("/sigma")[n] == (stamp, sigma.0), "frame {n}");
        let depth = image(header(stamp), "32FC1", 4, &floats(&files[1], f32::NAN));
        assert!(all("/depth/image_rect")[n] == (stamp, depth.0), "frame {n}");
        let png = |bytes: &[u8]| image::load_from_memory(bytes).unwrap();
        let words: Vec<u8> = png(&files[2]).to_luma16().iter().flat_map(|v| v.to_le_bytes()).collect();
        assert!(
            all("/depth/image_rect_raw")[n] == (stamp, image(header(stamp), "16UC1", 2, &words).0),
            "frame {n}"
        );
        let bytes = png(&files[3]).to_luma8().into_raw();
        assert!(all("/confidence")[n] == (stamp, image(header(stamp), "mono8", 1, &bytes).0), "frame {n}");
    }
    let disparity = all("/disparity");
    assert!(disparity.len() == 3 && disparity[0].1[4..] != disparity[1].1[4..], "control: all frames differ");
    // For a folder of images whose names are times.
    for (view, side) in ["left", "right"].into_iter().enumerate() {
        fs::create_dir(folder.join(side)).unwrap();
        for (scene, name) in SCENES.iter().zip(NAMES) {
            frame(scene, view).save(folder.join(side).join(format!("{name}.png"))).unwrap();
        }
    }
    run(&folder, &format!("sequence left right of-files.mcap {RANGE} --quiet")).succeeded();
    let times: Vec<_> =
        messages(&folder.join("of-files.mcap"), "/disparity").into_iter().map(|(time, _)| time).collect();
    assert_eq!(times, [START, START + STEP, START + 2 * STEP]);
}

/// Depths in the view of a third camera have its frame and come with its lens.
#[test]
fn depths_of_a_third_camera_are_written() {
    let folder = Folder::new();
    record(&folder.join("drive.mcap"), &[cameras(SIZE), images("image_raw", 0)].concat());
    let third = "K: [50, 0, 24, 0, 51, 20, 0, 0, 1]\nD: [-0.1, 0.01, 0, 0.001, 0]\nR: [0, 0.02, 0.01]\nT: [0.05, 0, 0]\n\
                 size: [50, 40]\nunit: m\n";
    let file = folder.join("colour.yml");
    fs::write(&file, third).unwrap();
    let also = format!("--also depth-registered,depth-registered-mm --into {}", file.display());
    run(&folder, &format!("sequence drive.mcap found.mcap {RANGE} --quiet {also}")).succeeded();
    let rectify = "--rectify --calib 0.yaml --calib 1.yaml";
    let ends = ["depth-registered.pfm", "depth-registered-mm.png"];
    let wanted = wanted(&folder, &ends, &format!("{rectify} {also}"));
    let all = |topic: &str| messages(&folder.join("found.mcap"), &format!("/depth_registered/{topic}"));
    for (n, files) in wanted.iter().enumerate() {
        let stamp = START + STEP * n as u64;
        let header = || Bytes::with_header(stamp, "colour").u32(40).u32(50);
        let image = |encoding: &str, bytes: u32, data: &[u8]| {
            header().text(encoding).bytes(&[0]).u32(50 * bytes).u32(data.len() as u32).bytes(data).0
        };
        fs::write(folder.join("map.pfm"), &files[0]).unwrap();
        let map = read_pfm(folder.join("map.pfm"));
        assert!(map.data().iter().filter(|v| v.is_finite()).count() > 500);
        let floats = map.data().iter().flat_map(|v| if v.is_finite() { *v } else { f32::NAN }.to_le_bytes());
        assert!(all("image")[n] == (stamp, image("32FC1", 4, &floats.collect::<Vec<_>>())), "frame {n}");
        let words = image::load_from_memory(&files[1]).unwrap().to_luma16();
        let words: Vec<u8> = words.iter().flat_map(|v| v.to_le_bytes()).collect();
        assert!(all("image_raw")[n] == (stamp, image("16UC1", 2, &words)), "frame {n}");
        let lens = header().text("plumb_bob").u32(5).doubles(&[-0.1, 0.01, 0.0, 0.001, 0.0]);
        let lens = lens.doubles(&[50.0, 0.0, 24.0, 0.0, 51.0, 20.0, 0.0, 0.0, 1.0]);
        let lens = lens.doubles(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let lens = lens.doubles(&[50.0, 0.0, 24.0, 0.0, 0.0, 51.0, 20.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let info = (0..6).fold(lens, |all, _| all.u32(0)).bytes(&[0]).0;
        assert!(all("camera_info")[n] == (stamp, info), "frame {n}");
    }
    // Control: another position of the camera gives other depths.
    fs::write(&file, third.replace("0.05", "0.06")).unwrap();
    run(&folder, &format!("sequence drive.mcap moved.mcap {RANGE} --quiet {also}")).succeeded();
    assert_ne!(messages(&folder.join("moved.mcap"), "/depth_registered/image"), all("image"));
}

/// The first calibration is used, and a later change is reported.
#[test]
fn a_changing_calibration_is_reported() {
    let folder = Folder::new();
    let path = folder.join("drive.mcap");
    let line = format!("sequence drive.mcap maps {RANGE} --also depth");
    record(&path, &[cameras(SIZE), images("image_raw", 0), cameras(SIZE)].concat());
    let unchanged = run(&folder, &line).succeeded();
    assert!(!unchanged.stderr.contains("changes"), "control: {unchanged:?}");
    let mut messages = [cameras(SIZE), images("image_raw", 0)].concat();
    let mut later = camera_info(0, SIZE);
    let at = later.windows(8).position(|bytes| bytes == 60.0_f64.to_le_bytes()).unwrap();
    later[at..at + 8].copy_from_slice(&61.0_f64.to_le_bytes());
    messages.push(("/left/camera_info".into(), CAMERA, later));
    record(&path, &messages);
    run(&folder, &line)
        .succeeded()
        .says("the calibration on /left/camera_info changes at 0.000000000 & with the first one");
}

/// Faulty recordings give one line, and complete frames are kept.
#[test]
fn faulty_recordings_are_reported_in_one_line() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    let good = images("image_rect", 0);
    record(&at("good.mcap"), &good);
    let whole = fs::read(at("good.mcap")).unwrap();
    let with_last = |bytes: Vec<u8>| {
        let mut messages = good.clone();
        messages[4].2 = bytes;
        messages
    };
    let last = &good[4].2;
    let changed = |at: usize, to: &[u8]| {
        let mut bytes = last.clone();
        bytes[at..at + to.len()].copy_from_slice(to);
        with_last(bytes)
    };
    record(
        &at("encoding.mcap"),
        &changed(last.windows(4).position(|word| word == b"rgb8").unwrap(), b"abc9"),
    );
    // Height and width follow the frame name of the camera.
    record(&at("huge.mcap"), &changed(24, &[0xff; 8]));
    record(&at("short.mcap"), &changed(24, &100_u32.to_le_bytes()));
    record(&at("cut-message.mcap"), &with_last(last[..100].to_vec()));
    record(
        &at("half.mcap"),
        &good.iter().filter(|one| one.0.starts_with("/left")).cloned().collect::<Vec<_>>(),
    );
    record(&at("raw.mcap"), &images("image_raw", 0));
    record(&at("size.mcap"), &[cameras((128, 100)), images("image_raw", 0)].concat());
    record(&at("both.mcap"), &[images("image_raw", 0), images("image_rect", 0)].concat());
    record(&at("text.mcap"), &[("/left".into(), "std_msgs/msg/String", vec![0, 1, 0, 0])]);
    for (name, bytes) in [
        ("empty.mcap", &b""[..]),
        ("words.mcap", b"a picture is worth a thousand words"),
        ("words.bag", b"a picture is worth a thousand words"),
        ("a.db3", b"SQLite format 3\0"),
        ("cut.mcap", &whole[..whole.len() / 2]),
    ] {
        fs::write(at(name), bytes).unwrap();
    }
    let mut flipped = whole.clone();
    let pixel = whole.windows(4).rposition(|word| word == b"rgb8").unwrap() + 500;
    flipped[pixel] ^= 1;
    fs::write(at("flipped.mcap"), flipped).unwrap();
    let before = listing(&folder);
    for (line, code, done, words) in [
        ("none.mcap OUT", 1, 0, "none.mcap & no such file"),
        ("empty.mcap OUT", 1, 0, "empty.mcap: is empty"),
        ("words.mcap OUT", 1, 0, "words.mcap: is not an MCAP file"),
        ("words.bag OUT", 1, 0, "words.bag: is not a ROS 1 bag"),
        ("a.db3 OUT", 1, 0, "a.db3 & not an SQLite database"),
        ("cut.mcap OUT", 1, 1, "cut.mcap: is cut off"),
        ("flipped.mcap OUT", 1, 2, "flipped.mcap: the chunk at byte & checksum"),
        ("encoding.mcap OUT", 1, 2, "encoding.mcap:/left/image_rect at 1700000000.100000000 & `abc9`"),
        ("huge.mcap OUT", 1, 2, "4294967295 x 4294967295 pixels"),
        ("short.mcap OUT", 1, 2, "100 rows of 192 bytes"),
        ("cut-message.mcap OUT", 1, 2, "/left/image_rect & ends early"),
        ("half.mcap OUT", 1, 0, "/left/image_rect only"),
        ("raw.mcap OUT", 1, 0, "/left/image_raw is not rectified & /left/camera_info & --rectify"),
        ("size.mcap OUT", 1, 0, "size.mcap:/left/camera_info & 128 x 100 & 64 x 48"),
        ("both.mcap OUT", 1, 0, "several pairs & --topics & /left/image_raw,/right/image_raw"),
        ("text.mcap OUT", 1, 0, "no images & /left (std_msgs/msg/String)"),
        ("good.mcap OUT --topics /a,/b", 1, 0, "has no topic /a & /left/image_rect, /right/image_rect"),
        ("good.mcap OUT --topics /a", 2, 0, "--topics & left"),
        ("good.mcap OUT --tolerance -1", 2, 0, "--tolerance & from 0"),
        ("good.mcap OUT --max-pixels 100", 1, 0, "64 x 48 pixels, but at most 100"),
        ("good.mcap good.mcap OUT", 2, 0, "RIGHT & contains both views"),
        ("good.mcap OUT --pairing order", 2, 0, "--pairing & both views"),
        ("good.mcap OUT --also depth", 2, 0, "--also depth & /left/camera_info"),
        ("good.mcap found.mcap --also preview", 2, 0, "--also preview & ROS message"),
        ("good.mcap found.mcap --format tif", 2, 0, "--format & recording"),
        ("good.mcap good.mcap", 2, 0, "OUTPUT & already"),
    ] {
        for output in ["maps", "new.mcap"] {
            run(&folder, &format!("sequence {} {RANGE} --quiet", line.replace("OUT", output)))
                .failed(code, words);
            if output == "maps" && done > 0 {
                assert_eq!(listing(&at("maps")).len(), done, "{line}");
                fs::remove_dir_all(at("maps")).unwrap();
            } else if done > 0 {
                assert_eq!(messages(&at(output), "/disparity").len(), done, "{line}");
                fs::remove_file(at(output)).unwrap();
            }
            assert_eq!(listing(&folder), before, "{line}");
        }
    }
    fs::create_dir(at("left")).unwrap();
    frame("thin", 0).save(at("left/1.png")).unwrap();
    run(&folder, "sequence left left maps --tolerance 1").failed(2, "--tolerance & LEFT is not one");
}

/// Recordings without times in the headers are refused, of any length; one that starts at time 0 is accepted.
#[test]
fn images_without_times_are_refused() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    // Seconds and nanoseconds follow the first four bytes.
    let at_zero = |message: &Message| {
        let mut message = message.clone();
        message.2[4..12].fill(0);
        message
    };
    let good = images("image_rect", 0);
    for count in [2, 4, 6] {
        let untimed: Vec<_> = good[..count].iter().map(at_zero).collect();
        record(&at("untimed.mcap"), &untimed);
        run(&folder, &format!("sequence untimed.mcap maps {RANGE}")).failed(
            1,
            "untimed.mcap: images are paired by the time in their headers, but on /left/image_rect that is 0 & record again",
        );
        assert!(!at("maps").exists(), "{count}");
    }
    let simulated: Vec<_> = good[..2].iter().map(at_zero).chain(good[2..].iter().cloned()).collect();
    record(&at("simulated.mcap"), &simulated);
    run(&folder, &format!("sequence simulated.mcap maps --quiet {RANGE}")).succeeded();
    assert_eq!(listing(&at("maps")).len(), 3);
}

/// Missing files and messages that the metadata lists are reported.
#[test]
fn missing_parts_of_a_bag_are_reported() {
    let folder = Folder::new();
    let bag = folder.join("bag");
    fs::create_dir(&bag).unwrap();
    let good = images("image_rect", 0);
    let metadata = |parts: &[&str], count: usize| {
        let files = parts.iter().map(|part| format!("  - {part}\n")).collect::<Vec<_>>().concat();
        let text = format!(
            "rosbag2_bagfile_information:\n  message_count: {count}\n  relative_file_paths:\n{files}"
        );
        fs::write(bag.join("metadata.yaml"), text).unwrap();
    };
    record(&bag.join("bag_0.mcap"), &good[..2]);
    metadata(&["bag_0.mcap", "bag_1.mcap"], 4);
    run(&folder, &format!("sequence bag maps {RANGE}"))
        .failed(1, "bag_1.mcap: there is no such file, but metadata.yaml lists it & remove its line");
    assert!(!folder.join("maps").exists());
    metadata(&["bag_0.mcap"], 4);
    let told = run(&folder, &format!("sequence bag maps {RANGE}")).succeeded();
    told.says("the recording contains 2 messages, but its metadata.yaml says 4");
    // Control: the complete bag.
    record(&bag.join("bag_1.mcap"), &good[2..4]);
    metadata(&["bag_0.mcap", "bag_1.mcap"], 4);
    let said = run(&folder, &format!("sequence bag whole {RANGE}")).succeeded().stderr;
    assert!(!said.contains("metadata"), "{said}");
    assert_eq!(listing(&folder.join("whole")).len(), 2);
}

/// Only the first damaged image of each camera is reported, and its frame is still matched.
#[test]
fn damaged_images_in_recordings_are_reported_once() {
    let folder = Folder::new();
    let compressed = |stamp: u64, image: &image::RgbImage, damaged: bool| {
        let mut file = std::io::Cursor::new(Vec::new());
        image.write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
        let whole = file.into_inner();
        let length = whole.len();
        // Removing bytes drops some pixels. Which bytes the decoder can do without depends on the image.
        let without = |end: usize| [&whole[..end], &whole[end + 60..]].concat();
        let is_read = |file: &Vec<u8>| Reader::default().raster_in_memory("a.jpg".as_ref(), file).is_ok();
        let file =
            if damaged { (length / 2..length - 100).map(without).find(is_read).unwrap() } else { whole };
        let message = Bytes::with_header(stamp, "camera").text("jpeg");
        message.u32(file.len() as u32).bytes(&file).0
    };
    let mut messages = Vec::new();
    for (n, scene) in SCENES.iter().enumerate() {
        for (view, side) in ["left", "right"].into_iter().enumerate() {
            let image = compressed(START + STEP * n as u64, &frame(scene, view), view == 1 && n > 0);
            messages.push((
                format!("/{side}/image_rect/compressed"),
                "sensor_msgs/msg/CompressedImage",
                image,
            ));
        }
    }
    record(&folder.join("jpeg.mcap"), &messages);
    let said = run(&folder, &format!("sequence jpeg.mcap maps {RANGE}")).succeeded().stderr;
    let warnings: Vec<_> = said.lines().filter(|line| line.contains("is damaged")).collect();
    let words =
        "warning: jpeg.mcap:/right/image_rect/compressed at 1700000000.050000000: the JPEG data is damaged";
    assert!(warnings.len() == 1 && warnings[0].contains(words), "{said}");
    assert_eq!(listing(&folder.join("maps")).len(), 3);
    let said = run(&folder, &format!("sequence jpeg.mcap quiet --quiet {RANGE}")).succeeded().stderr;
    assert_eq!(said, "");
}

/// Luma and chroma, as robot cameras send them, give the map of the equivalent colours.
#[test]
fn images_in_luma_and_chroma_are_matched() {
    let folder = Folder::new();
    let all = images("image_rect", 0);
    let pixels = 3 * (SIZE.0 * SIZE.1) as usize;
    // Luma of 16 to 235 is grey; chroma of 128 is neutral.
    let luma = |message: &Message| -> Vec<u8> {
        let rgb = &message.2[message.2.len() - pixels..];
        rgb.chunks_exact(3).map(|p| 16 + (u32::from(p[1]) * 219 / 255) as u8).collect()
    };
    let message = |stamp: u64, encoding: &str, step: u32, data: &[u8]| {
        let message = Bytes::with_header(stamp, "camera").u32(SIZE.1).u32(SIZE.0).text(encoding).bytes(&[0]);
        message.u32(step).u32(data.len() as u32).bytes(data).0
    };
    let record_as = |name: &str, encoding: &str, step: u32, data: &dyn Fn(&[u8]) -> Vec<u8>| {
        let made = all.iter().enumerate().map(|(n, one)| {
            let stamp = START + STEP * (n / 2) as u64;
            (one.0.clone(), IMAGE, message(stamp, encoding, step, &data(&luma(one))))
        });
        record(&folder.join(name), &made.collect::<Vec<_>>());
        run(&folder, &format!("sequence {name} {encoding} --quiet {RANGE}")).succeeded();
        listing(&folder.join(encoding)).into_values().collect::<Vec<_>>()
    };
    let wanted = record_as("grey.mcap", "mono8", SIZE.0, &|luma| {
        luma.iter().map(|y| (((u32::from(*y) - 16) * 1_220_542 + (1 << 19)) >> 20).min(255) as u8).collect()
    });
    for (encoding, first) in [("uyvy", 1), ("yuv422_yuy2", 0)] {
        let packed = record_as("packed.mcap", encoding, 2 * SIZE.0, &|luma| {
            luma.iter().flat_map(|y| if first == 0 { [*y, 128] } else { [128, *y] }).collect()
        });
        assert!(packed == wanted, "{encoding}");
    }
    let planes = record_as("planes.mcap", "nv12", SIZE.0, &|luma| {
        luma.iter().copied().chain(vec![128; luma.len() / 2]).collect()
    });
    assert!(planes == wanted);
}

/// A cloud of points in double precision, each after four bytes of something else.
fn cloud_message(stamp: u64, points: &[[f64; 3]]) -> Vec<u8> {
    let (count, step) = (points.len() as u32, 28);
    let message = Bytes::with_header(stamp, "lidar").u32(1).u32(count).u32(4);
    let fields = [("intensity", 0, 7), ("x", 4, 8), ("y", 12, 8), ("z", 20, 8)];
    let message = fields
        .into_iter()
        .fold(message, |all, (name, offset, kind)| all.text(name).u32(offset).bytes(&[kind]).u32(1));
    let message = message.bytes(&[0]).u32(step).u32(step * count).u32(step * count);
    let point = |all: Bytes, point: &[f64; 3]| {
        point.iter().fold(all.bytes(&[7; 4]), |all, v| all.bytes(&v.to_le_bytes()))
    };
    points.iter().fold(message, point).bytes(&[1]).0
}

#[test]
fn the_points_of_a_lidar_are_known() {
    let folder = priors::poster();
    let views = [0, 1].map(|view| {
        let path = folder.join(format!("im{view}.png"));
        let image = image::open(&path).unwrap().to_rgb8();
        image.save(&path).unwrap();
        image
    });
    let points = priors::points(&folder);
    // A lidar looks along x, with y to the left and z up, from 0.3 m above and 1 m behind.
    let scan: Vec<_> = points.iter().map(|[x, y, z]| [z + 1.0, -x, -y - 0.3]).collect();
    fs::write(folder.join("scan.xyz"), priors::lines(&scan)).unwrap();
    fs::write(folder.join("lidar.txt"), "0 -1 0 0\n0 0 -1 -0.3\n1 0 0 -1\n").unwrap();
    let flags = "--max-disparity 31 --device cpu";
    let alone = |more: &str| {
        run(&folder, &format!("match im0.png im1.png map.pfm {flags} --quiet {more}")).succeeded();
        fs::read(folder.join("map.pfm")).unwrap()
    };
    let (plain, with) = (alone(""), alone("--prior scan.xyz --prior-pose lidar.txt"));
    assert!(plain != with, "control: the points matter");
    // Three frames with a second between them. The nearest cloud counts, and the third frame has none.
    let mut messages = Vec::new();
    for n in 0..3 {
        for (view, side) in ["left", "right"].into_iter().enumerate() {
            let image = image_message(START + SECOND * n, &views[view]);
            messages.push((format!("/{side}/image_rect"), IMAGE, image));
        }
    }
    let cloud = |ms: u64, points: &[[f64; 3]]| {
        let stamp = START + ms * SECOND / 1000;
        ("/lidar/points".to_owned(), "sensor_msgs/msg/PointCloud2", cloud_message(stamp, points))
    };
    messages.extend([cloud(60, &scan), cloud(1050, &scan[..9]), cloud(980, &scan), cloud(2101, &scan)]);
    record(&folder.join("drive.mcap"), &messages);
    let maps = |more: &str| {
        let line = format!("sequence drive.mcap maps {flags} --calib calib.txt {more}");
        let said = run(&folder, &line).succeeded().stderr;
        let names = ["1700000000", "1700000001", "1700000002"];
        let maps = names.map(|name| fs::read(folder.join(format!("maps/{name}.000000000.pfm"))).unwrap());
        fs::remove_dir_all(folder.join("maps")).unwrap();
        (maps, said)
    };
    let lidar = "--prior-topic lidar/points --prior-pose lidar.txt";
    let (found, said) = maps(lidar);
    assert!(found == [&with, &with, &plain].map(Clone::clone));
    let missing = "no cloud of lidar/points is within 0.1 s of the left image at 1700000002.000000000";
    assert_eq!(said.matches(missing).count(), 1, "{said}");
    assert!(!said.contains("contradict"), "{said}");
    assert!(maps("").0 == [&plain, &plain, &plain].map(Clone::clone), "control");
    // Control: without the pose, the points are elsewhere.
    assert!(maps("--prior-topic lidar/points").0[0] != with);
    // Clouds that are damaged are not used, nor are those behind the camera.
    let behind: Vec<_> = points.iter().map(|[x, y, z]| [x - z, *y, *z]).collect();
    messages.truncate(6);
    messages.extend([cloud(0, &scan), cloud(1000, &scan), cloud(2000, &behind)]);
    messages[6].2.truncate(900);
    record(&folder.join("drive.mcap"), &messages);
    let (found, said) = maps(lidar);
    assert!(found == [&plain, &with, &plain].map(Clone::clone));
    assert!(said.contains("a cloud of lidar/points is not used: it ends early"), "{said}");
    for (left, flags, code, words) in [
        (
            "drive.mcap",
            "--prior-topic /nothing",
            1,
            "drive.mcap & no sensor_msgs/msg/PointCloud2 on /nothing & /lidar/points",
        ),
        ("drive.mcap", "--prior-topic /lidar/points --prior last", 2, "--prior & --prior-topic"),
        ("drive.mcap", "--prior-pose lidar.txt", 2, "--prior-topic"),
        ("drive.mcap", "--prior-topic /lidar/points --prior-sigma 0", 2, "--prior-sigma & not above 0"),
        ("im0.png im1.png", "--prior-topic /lidar/points", 2, "--prior-topic & only applies to a recording"),
    ] {
        run(&folder, &format!("sequence {left} maps --calib calib.txt {flags} --max-disparity 31"))
            .failed(code, words);
    }
    run(
        &folder,
        "sequence drive.mcap maps --focal 180 --baseline 3 --prior-topic /lidar/points --max-disparity 31",
    )
    .failed(2, "--prior-topic & unit of the baseline");
}
