//! `mrfgs ros` with cameras simulated over the same DDS, and addresses of viewers of a sequence; `scripts/node` and `scripts/viewer` test
//! with other implementations.

use mrfgs::Matcher;
use mrfgs::depth::Rig;
use mrfgs::image::calib::{Calibration, Camera, Unit};
use mrfgs::options::Method;
use mrfgs_node::topics::{Participant, Publication, Subscriptions};
use mrfgs_ros::messages::{
    CameraInfo, CompressedImage, DisparityImage, Encode, Encoding, FLOAT32, Header, Image, PointCloud2,
    PointField, Stamp, Type,
};

use super::*;

/// A domain that other programs hardly use.
fn domain() -> u16 {
    100 + (std::process::id() % 100) as u16
}

/// A node, stopped at the end of its test.
struct Node(Child);

impl Drop for Node {
    fn drop(&mut self) {
        let _ = self.0.kill();
    }
}

impl Node {
    fn new(flags: &str) -> Self {
        let line = format!("ros --device cpu --method fast --max-disparity 47 --domain {} {flags}", domain());
        Self(started(Path::new("."), &line))
    }

    /// Stops the node and returns its messages.
    fn stop(mut self) -> String {
        send("-INT", &self.0);
        let mut said = String::new();
        std::io::Read::read_to_string(&mut self.0.stderr.take().unwrap(), &mut said).unwrap();
        assert_eq!(self.0.wait().unwrap().code(), Some(0), "{said}");
        said
    }
}

/// Two simulated cameras, and a subscriber to disparities and depths.
struct Peer {
    images: [Publication; 2],
    infos: [Publication; 2],
    lidar: Publication,
    /// What the lidar sends with every pair.
    cloud: Option<PointCloud2>,
    disparities: Subscriptions,
    /// Depths in the view of a third camera.
    depths: Subscriptions,
    sent: i64,
}

impl Peer {
    /// Cameras below `/cameras`, and a node below `/node`.
    fn new(cameras: &str, node: &str) -> Self {
        let participant = Participant::new(domain()).unwrap();
        let publish = |name: &str, kind| participant.publish(name, kind).unwrap();
        let mut disparities = Subscriptions::new().unwrap();
        disparities.add(&participant, &format!("/{node}/disparity"), DisparityImage::NAME, true).unwrap();
        let mut depths = Subscriptions::new().unwrap();
        let registered = format!("/{node}/depth_registered/image");
        depths.add(&participant, &registered, Image::NAME, true).unwrap();
        Self {
            depths,
            images: ["left", "right"]
                .map(|side| publish(&format!("/{cameras}/{side}/image_rect"), Image::NAME)),
            infos: ["left", "right"]
                .map(|side| publish(&format!("/{cameras}/{side}/camera_info"), CameraInfo::NAME)),
            lidar: publish(&format!("/{node}/lidar"), PointCloud2::NAME),
            cloud: None,
            disparities,
            sent: 0,
        }
    }

    /// Sends a pair whose rows have `step` bytes.
    fn send(&mut self, views: &[image::RgbImage; 2], step: u32) {
        self.sent += 1;
        let header = Header { stamp: Stamp(self.sent * 50_000_000), frame_id: "eye".into() };
        if let Some(cloud) = &self.cloud {
            self.lidar.send(PointCloud2 { header: header.clone(), ..cloud.clone() }.encode()).unwrap();
        }
        for (side, view) in views.iter().enumerate() {
            let (width, height) = view.dimensions();
            let mut p = [0.0; 12];
            (p[0], p[2], p[5], p[6], p[10]) = (300.0, 119.5, 300.0, 89.5, 1.0);
            p[3] = -36.0 * side as f64;
            let info = CameraInfo { header: header.clone(), width, height, p, ..CameraInfo::default() };
            self.infos[side].send(info.encode()).unwrap();
            let (encoding, data) = ("rgb8".into(), view.as_raw().as_slice().into());
            let image =
                Image { header: header.clone(), height, width, encoding, is_bigendian: false, step, data };
            self.images[side].send(image.encode()).unwrap();
        }
    }

    /// Sends pairs until a disparity image arrives.
    fn disparity(&mut self, views: &[image::RgbImage; 2]) -> Vec<u8> {
        let start = Instant::now();
        let mut found = None;
        while found.is_none() {
            assert!(start.elapsed() < Duration::from_secs(60), "no disparities came");
            self.send(views, 3 * views[0].width());
            self.disparities.wait(Duration::from_millis(100), |_, bytes| found = Some(bytes)).unwrap();
        }
        found.unwrap()
    }
}

/// The expected message for a map, serialized independently.
fn message(map: &Plane<f32>, header: &Header, delta_d: f32) -> Vec<u8> {
    let (width, height) = map.size();
    let (width, height) = (width as u32, height as u32);
    let data: Vec<u8> =
        map.data().iter().flat_map(|d| if d.is_finite() { *d } else { -1.0 }.to_le_bytes()).collect();
    let valid_window = mrfgs_ros::messages::RegionOfInterest { width, height, ..Default::default() };
    let image = Image {
        header: header.clone(),
        height,
        width,
        encoding: "32FC1".into(),
        is_bigendian: false,
        step: 4 * width,
        data: data.into(),
    };
    let header = header.clone();
    let (min_disparity, max_disparity) = (0.0, 47.0);
    DisparityImage { header, image, f: 300.0, t: 0.12, valid_window, min_disparity, max_disparity, delta_d }
        .encode()
}

/// The median error that is expected.
fn typical_sigma(matched: &mrfgs::Matched) -> f32 {
    let mut sigmas = matched.sigma().into_data();
    sigmas.retain(|sigma| sigma.is_finite());
    sigmas.sort_by(f32::total_cmp);
    sigmas[(sigmas.len() - 1) / 2]
}

#[test]
fn a_node_knows_points_and_its_last_map() {
    let views = [0, 1].map(|i| image::open(scene("poster").join(format!("im{i}.png"))).unwrap().to_rgb8());
    let pair = mrfgs::Pair::open(scene("poster/im0.png"), scene("poster/im1.png")).unwrap();
    let truth = read_pfm(scene("poster/disp0GT.pfm"));
    // Points of the truth in single precision, as a camera with this focal length and baseline sees them.
    let pixels = (0..180).flat_map(|y| (0..240).map(move |x| (x, y))).step_by(97);
    let points: Vec<[f32; 3]> = pixels
        .filter(|at| truth[*at].is_finite())
        .map(|(x, y)| {
            let z = 36.0 / truth[(x, y)];
            [(x as f32 - 119.5) * z / 300.0, (y as f32 - 89.5) * z / 300.0, z]
        })
        .collect();
    let fields = ["x", "y", "z"].into_iter().enumerate();
    let fields =
        fields.map(|(i, name)| PointField { name, offset: 4 * i as u32, datatype: FLOAT32 }).collect();
    let data = points.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let camera = Camera { focal_length: [300.0; 2], principal_point: [119.5, 89.5] };
    let rig = Rig::new(&Calibration::of_cameras(camera, 0.12, Unit::Metre)).unwrap();
    let prior = rig.prior((240, 180), points.iter().map(|point| point.map(f64::from)), 0.25);
    let mut matcher =
        Matcher::builder().method(Method::preset("fast").unwrap()).device("cpu").build().unwrap();
    let range = options::DisparityRange::new(0, 47).unwrap();
    let plain = matcher.run(&pair, range).unwrap();
    let known = matcher.job(&pair, range).prior(std::sync::Arc::new(prior.unwrap())).run().unwrap();
    let mut chain = Vec::new();
    let frames = std::iter::repeat_n((pair, range), 12);
    let go_on = std::sync::atomic::AtomicBool::new(false);
    matcher
        .run_following(frames, &go_on, |matched| {
            chain.push(matched);
            std::ops::ControlFlow::Continue(())
        })
        .unwrap();
    let differ = |a: &mrfgs::Matched, b: &mrfgs::Matched| a.disparity().data() != b.disparity().data();
    assert!(differ(&plain, &known) && differ(&plain, &chain[1]) && differ(&known, &chain[1]), "control");
    let is = |found: &[u8], matched: &mrfgs::Matched| {
        let header = Header::of(found, Encoding::Cdr).unwrap();
        found == message(&matched.disparity(), &header, typical_sigma(matched))
    };
    let names = "-r __ns:=/known -r left/image_raw:=left/image_rect -r right/image_raw:=right/image_rect";
    let node = Node::new(&format!("{names} --prior-topic lidar"));
    let mut peer = Peer::new("known", "known");
    // Before the node has heard of the lidar, nothing is known.
    assert!(is(&peer.disparity(&views), &plain));
    peer.cloud = Some(PointCloud2 { header: Header::default(), fields, point_step: 12, data });
    let start = Instant::now();
    loop {
        let found = peer.disparity(&views);
        if is(&found, &known) {
            break;
        }
        assert!(is(&found, &plain), "neither with the points nor without");
        assert!(start.elapsed() < Duration::from_secs(60), "the points are not known");
    }
    let said = node.stop();
    assert_eq!(
        said.matches("no cloud of /known/lidar is within 0.1 s of the left image").count(),
        1,
        "{said}"
    );
    // The maps of the frames before.
    let node = Node::new(&format!("{names} --prior last"));
    let start = Instant::now();
    loop {
        let found = peer.disparity(&views);
        if chain[1..].iter().any(|matched| differ(matched, &plain) && is(&found, matched)) {
            break;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "the last map is not known");
    }
    let said = node.stop();
    assert!(!said.contains("no cloud"), "{said}");
}

#[test]
fn a_node_matches_what_cameras_publish() {
    let folder = Folder::new();
    let third = "K: [200, 0, 60, 0, 200, 40, 0, 0, 1]\nD: [0, 0, 0, 0]\nR: [0, 0, 0]\nT: [0, 0, 0]\nsize: [120, 80]\n";
    fs::write(folder.join("eye_2.yml"), third).unwrap();
    let into = format!("--also depth-registered --into {}", folder.join("eye_2.yml").display());
    let node = Node::new(&format!(
        "{into} --remap left/image_raw:=/cam/left/image_rect -r right/image_raw:=/cam/right/image_rect --ros-args -r __ns:=/robot",
    ));
    let views =
        ["im0.png", "im1.png"].map(|name| image::open(scene("slanted").join(name)).unwrap().to_rgb8());
    let mut peer = Peer::new("cam", "robot");
    let found = peer.disparity(&views);

    let pair = mrfgs::Pair::open(scene("slanted/im0.png"), scene("slanted/im1.png")).unwrap();
    let mut matcher =
        Matcher::builder().method(Method::preset("fast").unwrap()).device("cpu").build().unwrap();
    let matched = matcher.run(&pair, 0..=47).unwrap();
    let header = Header::of(&found, Encoding::Cdr).unwrap();
    assert_eq!(header.frame_id, "eye");
    assert!(
        header.stamp.0 > 0 && header.stamp.0 <= peer.sent * 50_000_000 && header.stamp.0 % 50_000_000 == 0
    );
    let typical = typical_sigma(&matched);
    let mut map = matched.disparity();
    assert!(found == message(&map, &header, typical), "same as the library's map");
    map[(7, 7)] = f32::from_bits(map[(7, 7)].to_bits() ^ 1);
    assert!(found != message(&map, &header, typical), "control: one bit shows");

    // The depths in the third camera equal those of `match`.
    let (mut depths, start) = (None, Instant::now());
    while depths.is_none() {
        assert!(start.elapsed() < Duration::from_secs(60), "no depths came");
        peer.disparity(&views);
        peer.depths.wait(Duration::from_millis(100), |_, bytes| depths = Some(bytes)).unwrap();
    }
    let depths = depths.unwrap();
    let depths = Image::decode(&depths, Encoding::Cdr).unwrap();
    let calib = "cam0=[300 0 119.5; 0 300 89.5; 0 0 1]\ndoffs=0\nbaseline=0.12\nunit=m\n";
    fs::write(folder.join("calib.txt"), calib).unwrap();
    let line = "match @slanted/im0.png @slanted/im1.png d.pfm --device cpu --method fast --max-disparity 47 --calib calib.txt --quiet";
    run(&folder, &format!("{line} --also depth-registered --into eye_2.yml")).succeeded();
    let wanted = read_pfm(folder.join("d.depth-registered.pfm"));
    assert!(wanted.data().iter().filter(|v| v.is_finite()).count() > 2000);
    let bytes = |v: &f32| if v.is_finite() { *v } else { f32::NAN }.to_le_bytes();
    let wanted: Vec<u8> = wanted.data().iter().flat_map(bytes).collect();
    assert_eq!((depths.width, depths.height, depths.header.frame_id.as_str()), (120, 80, "eye_2"));
    assert!(depths.data[..] == wanted[..], "same as the depths of match");

    // Rows that are too short are skipped, and another image size is accepted.
    for _ in 0..3 {
        peer.send(&views, 7);
        // Otherwise the next pair may replace it.
        std::thread::sleep(Duration::from_millis(200));
    }
    let part = views.each_ref().map(|view| image::imageops::crop_imm(view, 20, 10, 160, 120).to_image());
    let start = Instant::now();
    let height = loop {
        assert!(start.elapsed() < Duration::from_secs(60), "no disparities of another size");
        let bytes = peer.disparity(&part);
        // Offset of the time after the encapsulation and the headers of message and image, then length and text of the frame name.
        let at = 4 + 2 * (8 + 4 + 4);
        let height = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        if height != 180 {
            break height;
        }
    };
    assert_eq!(height, 120);
    let said = node.stop();
    for words in
        ["publishes /robot/disparity", "cannot read /cam/left/image_rect at ", " frames in ", " failed"]
    {
        assert!(said.contains(words), "no `{words}` in {said}");
    }
}

#[test]
fn topics_of_another_type_are_named() {
    let node = Node::new(
        "--remap left/image_raw:=/strange/left/image_rect -r right/image_raw:=/strange/right/image_rect",
    );
    let participant = Participant::new(domain()).unwrap();
    let publish = |name: &str, kind| participant.publish(&format!("/strange/{name}"), kind).unwrap();
    let mut strangers = [
        publish("left/image_rect", CompressedImage::NAME),
        publish("right/camera_info", "std_msgs/msg/String"),
        // Control: this one is as it should be.
        publish("right/image_rect", Image::NAME),
    ];
    let start = Instant::now();
    while !strangers.iter_mut().all(Publication::has_listeners) {
        assert!(start.elapsed() < Duration::from_secs(60), "the node was not found");
        std::thread::sleep(Duration::from_millis(50));
    }
    for stranger in &strangers[..2] {
        stranger.send(vec![0, 1, 0, 0, 9, 0, 0, 0, 7, 7, 7, 7]).unwrap();
    }
    std::thread::sleep(Duration::from_secs(2));
    let said = node.stop();
    for words in [
        "/strange/left/image_rect is published with sensor_msgs/msg/CompressedImage, and sensor_msgs/msg/Image is expected: remap to a topic \
         of that type, or one whose name ends with /compressed",
        "/strange/right/camera_info is published with std_msgs/msg/String, and sensor_msgs/msg/CameraInfo is expected: remap to a topic of \
         that type",
    ] {
        assert_eq!(said.lines().filter(|line| line.contains(words)).count(), 1, "{words}: {said}");
    }
    // What came is not called damaged, and the topic of the right type not strange.
    assert!(!said.contains("a message of") && !said.contains("make no sense"), "{said}");
    assert_eq!(said.matches("is published with").count(), 2, "{said}");
}

#[test]
fn invalid_flags_of_a_node_are_refused() {
    let folder = Folder::new();
    for (line, words) in [
        ("--remap left/image_raw", "--remap & FROM:=TO"),
        ("--remap left/image_raw:=/a//b", "--remap & /a//b & not a valid ROS name"),
        ("--remap left/image_raw:=right/image_raw", "--remap & /right/image_raw & its own topic"),
        ("--remap __node:=1", "--remap & not a valid node name"),
        ("--domain 233", "--domain & 233"),
        ("--tolerance -1", "--tolerance & from 0 to 3600"),
        ("--prior .", "--prior & is a folder & --prior-topic"),
        ("--prior last --prior-topic /lidar", "--prior & --prior-topic"),
        ("--prior-topic /a//b", "--prior-topic & /a//b & not a valid ROS name"),
        ("--also preview", "--also preview & cannot be sent as a ROS message"),
        ("--also depth-registered", "--also depth-registered & --into"),
        ("--also points.pcd", "--also points.pcd & cannot be sent as a ROS message"),
        (
            "--alpha 0.5 -r left/image_raw:=left/image_rect -r right/image_raw:=right/image_rect",
            "--alpha & rectification",
        ),
        ("--method nothing", "nothing"),
        ("--clip-depth 5", "--clip-depth & depths"),
        ("left right", "left"),
    ] {
        run(&folder, &format!("ros --device cpu {line}")).failed(2, words);
    }
    for domain in ["x", "233", "-1"] {
        let run = run_with(&folder, "ros --device cpu", &[("ROS_DOMAIN_ID", domain)]);
        run.failed(2, "ROS_DOMAIN_ID & give a number from 0 to 232");
    }
}

#[test]
fn a_sequence_can_be_viewed_live() {
    let folder = Folder::new();
    for (view, name) in [("left", "im0.png"), ("right", "im1.png")] {
        fs::create_dir(folder.join(view)).unwrap();
        fs::copy(scene("slanted").join(name), folder.join(view).join("0.png")).unwrap();
    }
    let flags = "--max-disparity 47 --method fast --device cpu";
    let line = format!("sequence left right ws://127.0.0.1:0 --also confidence {flags}");
    let shown = run(&folder, &line).succeeded();
    shown.says("open ws://127.0.0.1: & in Foxglove");
    shown.says("1 frame of 240 x 180");
    for (rest, code, words) in [
        ("ws://127.0.0.1:0 --format tif", 2, "--format & OUTPUT is a viewer"),
        ("ws://127.0.0.1:0 --also preview", 2, "--also preview & cannot be sent as a ROS message"),
        ("ws://127.0.0.1:0 --also depth", 2, "--also depth & calib"),
        ("ws://", 1, "cannot write ws://"),
        ("ws://127.0.0.1", 1, "cannot write ws://127.0.0.1"),
        ("ws://127.0.0.1:99999", 1, "cannot write ws://127.0.0.1:99999"),
    ] {
        run(&folder, &format!("sequence left right {rest} --quiet {flags}")).failed(code, words);
    }
}
