//! `mrfgs sequence`: for every source of frames the maps equal those of `match`, and after an early end all finished frames are kept.

use std::io::Read;

use super::*;

const SIZE: (u32, u32) = (64, 48);
/// Scenes whose corners are the frames, in this order: the tenth comes after the second.
const SCENES: [(&str, &str); 3] = [("f1", "slanted"), ("f2", "thin"), ("f10", "repetitive")];
/// Each frame is measured, because they show different scenes.
const RANGE: &str = "--max-disparity 23 --device cpu --set measure-every=1";

fn frame(scene_name: &str, view: usize) -> image::RgbImage {
    let image = image::open(scene(scene_name).join(format!("im{view}.png"))).unwrap();
    image.crop_imm(90, 70, SIZE.0, SIZE.1).to_rgb8()
}

/// A folder with the frames of both cameras, separately and combined.
fn cameras() -> Folder {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    for camera in ["left", "right", "beside", "above"] {
        fs::create_dir(at(camera)).unwrap();
    }
    let (w, h) = SIZE;
    for (name, scene) in SCENES {
        let [left, right] = [0, 1].map(|view| frame(scene, view));
        left.save(at(&format!("left/{name}.png"))).unwrap();
        right.save(at(&format!("right/{name}.ppm"))).unwrap();
        let mut beside = image::RgbImage::new(2 * w, h);
        let mut above = image::RgbImage::new(w, 2 * h);
        image::imageops::replace(&mut beside, &left, 0, 0);
        image::imageops::replace(&mut beside, &right, w.into(), 0);
        image::imageops::replace(&mut above, &left, 0, 0);
        image::imageops::replace(&mut above, &right, 0, h.into());
        beside.save(at(&format!("beside/{name}.png"))).unwrap();
        above.save(at(&format!("above/{name}.tif"))).unwrap();
    }
    fs::write(at("left/times.txt"), "no image").unwrap();
    fs::write(at("left/.hidden.png"), "no image").unwrap();
    folder
}

/// The maps of `match` for the frames, in order.
fn wanted(folder: &Path) -> Vec<Vec<u8>> {
    let maps = SCENES.map(|(name, _)| {
        let pair = format!("left/{name}.png right/{name}.ppm");
        run(folder, &format!("match {pair} wanted.pfm --quiet {RANGE}")).succeeded();
        fs::read(folder.join("wanted.pfm")).unwrap()
    });
    fs::remove_file(folder.join("wanted.pfm")).unwrap();
    assert!(maps[0] != maps[1] && maps[1] != maps[2] && maps[0] != maps[2], "control: all frames differ");
    maps.into()
}

fn maps(folder: &Path, names: [&str; 3]) -> Vec<Vec<u8>> {
    names.map(|name| fs::read(folder.join(format!("{name}.pfm"))).unwrap()).into()
}

/// The first frame decides what is corrected in the others, unless each is measured: one of the scenes looks noisy.
#[test]
fn faults_are_measured_on_the_first_frame() {
    let folder = cameras();
    for (flags, expected) in [("", 0), ("--set measure-every=1", 1), ("--set measure-every=2", 1)] {
        let line = "sequence left right maps --max-disparity 23 --device cpu --quiet --json";
        run(&folder, &format!("{line} all.jsonl {flags}")).succeeded();
        let text = fs::read_to_string(folder.join("all.jsonl")).unwrap();
        let lines = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        let smoothed = lines.filter(|line| line["smoothed"][0].as_f64().unwrap() > 0.0).count();
        assert_eq!(smoothed, expected, "{flags}");
        fs::remove_dir_all(folder.join("maps")).unwrap();
        fs::remove_file(folder.join("all.jsonl")).unwrap();
    }
}

/// Runs the program with `bytes` on standard input.
fn fed(folder: &Path, line: &str, bytes: &[u8]) -> Output {
    let mut child = started(folder, line);
    // A program that ends early does not read them all.
    let _ = child.stdin.take().unwrap().write_all(bytes);
    child.wait_with_output().unwrap()
}

/// All frames with both views side by side, as luma only.
fn grey_stream(header: &str) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    for (_, scene) in SCENES {
        bytes.extend(b"FRAME\n");
        let [left, right] = [0, 1].map(|view| frame(scene, view));
        for y in 0..SIZE.1 {
            for view in [&left, &right] {
                bytes.extend((0..SIZE.0).map(|x| view.get_pixel(x, y)[1]));
            }
        }
    }
    bytes
}

const GREY: &str = "YUV4MPEG2 W128 H48 F30000:1001 Ip A1:1 Cmono XYSCSS=400\n";

#[test]
fn files_in_any_order_give_the_maps_of_match() {
    let folder = cameras();
    let wanted = wanted(&folder);
    let names = SCENES.map(|(name, _)| name);
    for (i, frames) in
        ["left right OUT", "left/*.png right/f*.ppm OUT", "beside OUT", "above OUT --layout top-bottom"]
            .into_iter()
            .enumerate()
    {
        let output = format!("maps{i}");
        let line = format!("sequence {} {RANGE}", frames.replace("OUT", &output));
        run(&folder, &line).succeeded().says("3 frames of 64 x 48, 24 disparities");
        assert_eq!(maps(&folder.join(&output), names), wanted, "{line}");
        assert_eq!(listing(&folder.join(&output)).len(), 3);
    }
    // Control: swapped views give other maps.
    run(&folder, &format!("sequence right left swapped --quiet {RANGE}")).succeeded();
    assert_ne!(maps(&folder.join("swapped"), names), wanted);
}

/// Patterns as in ffmpeg and OpenCV.
#[test]
fn printf_patterns_select_images() {
    let folder = cameras();
    let wanted = wanted(&folder);
    for file in ["left/f01.png", "left/f007x.png"] {
        fs::copy(folder.join("left/f1.png"), folder.join(file)).unwrap();
    }
    let line = "sequence left/f%d.png right/f%01d.ppm maps --pairing common --quiet";
    fs::remove_file(folder.join("left/f01.png")).unwrap();
    run(&folder, &format!("{line} {RANGE}")).succeeded();
    assert_eq!(maps(&folder.join("maps"), SCENES.map(|(name, _)| name)), wanted);
    assert_eq!(listing(&folder.join("maps")).len(), 3, "f007x does not match");
    // With at least two digits, one frame matches.
    run(&folder, &format!("sequence left/f%02d.png right/f%02d.ppm two --quiet {RANGE}")).succeeded();
    assert_eq!(listing(&folder.join("two")).into_keys().collect::<Vec<_>>(), [folder.join("two/f10.pfm")]);
}

/// Masks, calibrations and records work as in `match`.
#[test]
fn masks_calibrations_and_records_are_those_of_match() {
    let folder = cameras();
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    let mut mask = image::GrayImage::new(SIZE.0, SIZE.1);
    (0..SIZE.1).for_each(|y| (0..20).for_each(|x| mask.put_pixel(x, y, image::Luma([255]))));
    mask.save(folder.join("mask.png")).unwrap();
    let calib = "cam0=[60 0 31.5; 0 60 23.5; 0 0 1]\ncam1=[60 0 31.5; 0 60 23.5; 0 0 1]\ndoffs=0\nbaseline=100\nndisp=24\n";
    fs::write(folder.join("left/calib.txt"), calib).unwrap();
    let also = "--mask mask.png --device cpu --quiet --also depth,validity";
    run(&folder, &format!("match left/f2.png right/f2.ppm one.pfm --json one.json {also}")).succeeded();
    run(&folder, &format!("sequence left right maps --json all.jsonl {also}")).succeeded();
    for end in ["pfm", "depth.pfm", "validity.png"] {
        assert!(at(&format!("one.{end}")) == at(&format!("maps/f2.{end}")), "{end}");
    }
    let text = fs::read_to_string(folder.join("all.jsonl")).unwrap();
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(
        lines.iter().map(|line| line["frame"].as_str().unwrap()).collect::<Vec<_>>(),
        ["f1", "f2", "f10"]
    );
    let one = json(folder.join("one.json"));
    for key in ["width", "range", "labels", "method", "density", "measured", "mean_confidence", "moved_up"] {
        assert!(!one[key].is_null() && lines[1][key] == one[key], "{key}");
    }
    assert_eq!(lines[1]["files"]["calibration"], "left/calib.txt");
    assert_eq!(lines[1]["files"]["mask"], "mask.png");
    // Control: another frame has other figures, and without the mask the map differs.
    assert_ne!(lines[0]["measured"], one["measured"]);
    run(&folder, "sequence left right maps --device cpu --quiet").succeeded();
    assert!(at("one.pfm") != at("maps/f2.pfm"));
    // A dry run only prints the plan.
    let before = listing(&folder);
    run(&folder, "sequence left right never --device cpu --dry-run")
        .prints("64 x 48 pixels, disparities 0 to 23");
    assert_eq!(listing(&folder), before);
    // Records of a film, on standard output.
    let told = run(&folder, &format!("sequence left right film.y4m --json - --quiet {RANGE}")).succeeded();
    assert_eq!(told.stdout.lines().count(), 3);
}

/// Regions work as in `match`, for records, depth and pictures.
#[test]
fn regions_are_those_of_match() {
    let folder = cameras();
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    let camera = "[60 0 31.5; 0 60 23.5; 0 0 1]";
    let calib = format!("cam0={camera}\ncam1={camera}\ndoffs=0\nbaseline=100\n");
    fs::write(folder.join("calib.txt"), calib).unwrap();
    let line =
        format!("{RANGE} --quiet --roi 30,8,20,24 --calib calib.txt --also depth,points,side-by-side,raw");
    run(&folder, &format!("match left/f2.png right/f2.ppm one.pfm --json one.json {line}")).succeeded();
    run(&folder, &format!("sequence left right maps --json maps.jsonl {line}")).succeeded();
    for end in ["pfm", "raw.pfm", "depth.pfm", "points.ply", "side-by-side.png"] {
        assert!(at(&format!("one.{end}")) == at(&format!("maps/f2.{end}")), "{end}");
    }
    let map = read_pfm(folder.join("one.pfm"));
    assert_eq!(map.size(), (20, 24));
    let one = json(folder.join("one.json"));
    assert_eq!((one["width"].as_u64(), one["region"].to_string()), (Some(20), "[30,8]".into()));
    assert!(fs::read_to_string(folder.join("maps.jsonl")).unwrap().contains("\"region\":[30,8]"));
    // Points keep their positions, and the picture shows the region.
    run(
        &folder,
        &format!("match left/f2.png right/f2.ppm whole.pfm {RANGE} --quiet --calib calib.txt --also points"),
    )
    .succeeded();
    let x_and_depth = |name: &str| {
        let text = String::from_utf8_lossy(&at(name)).into_owned();
        let start = text.find("end_header").unwrap() + 11;
        let bytes = at(name)[start..].to_vec();
        bytes
            .chunks_exact(19)
            .map(|p| [0, 8].map(|i| f32::from_le_bytes(p[i..i + 4].try_into().unwrap())))
            .collect::<Vec<_>>()
    };
    let columns = |points: Vec<[f32; 2]>| {
        let columns = points.into_iter().map(|[x, z]| 60.0 * x / z + 31.5);
        columns.fold([f32::MAX, f32::MIN], |[a, b], x| [a.min(x), b.max(x)])
    };
    let [first, last] = columns(x_and_depth("one.points.ply"));
    assert!((first - 30.0).abs() < 0.01 && (last - 49.0).abs() < 0.01, "{first} to {last}");
    // Control: the whole view has points outside the region.
    assert!(columns(x_and_depth("whole.points.ply"))[0] < 29.0);
    for (roi, code, words) in
        [("1,2,3", 2, "--roi & such as 200,100"), ("60,0,5,5", 2, "--roi & not inside a view of 64 x 48")]
    {
        for line in ["match left/f2.png right/f2.ppm no.pfm", "sequence left right no"] {
            run(&folder, &format!("{line} {RANGE} --quiet --roi {roi}")).failed(code, words);
            assert!(!folder.join("no").exists() && !folder.join("no.pfm").exists());
        }
    }
}

/// Frames missing from one camera do not shift the others.
#[test]
fn images_find_their_partners_by_number() {
    let folder = cameras();
    let wanted = wanted(&folder);
    fs::remove_file(folder.join("right/f2.ppm")).unwrap();
    fs::remove_file(folder.join("left/f1.png")).unwrap();
    let line = format!("sequence left right maps --quiet {RANGE}");
    let said = "left/f2.png does not have a partner with its number in right (nor does one other): skip";
    run(&folder, &line).failed(1, said);
    run(&folder, &format!("{line} --pairing common")).succeeded();
    assert_eq!(listing(&folder.join("maps")).len(), 1);
    assert_eq!(fs::read(folder.join("maps/f10.pfm")).unwrap(), wanted[2]);
    // Control: in order, f2 gets another partner.
    run(&folder, &format!("{line} --pairing order")).succeeded();
    assert_ne!(fs::read(folder.join("maps/f2.pfm")).unwrap(), wanted[1]);
}

#[test]
fn streams_give_the_maps_of_their_pixels() {
    let folder = cameras();
    let numbers = ["000000", "000001", "000002"];
    // Raw pixels of the files.
    let mut raw = Vec::new();
    for (_, scene) in SCENES {
        for view in [0, 1] {
            raw.extend(frame(scene, view).into_raw());
        }
    }
    let line = "sequence - raw --raw-frames 64x96,rgb24 --layout top-bottom --quiet";
    let output = fed(&folder, &format!("{line} {RANGE}"), &raw);
    assert!(output.status.success(), "{output:?}");
    assert_eq!(maps(&folder.join("raw"), numbers), wanted(&folder));
    // Luma only, in a stream, a file, and grey images.
    let grey = grey_stream(GREY);
    fs::write(folder.join("both.y4m"), &grey).unwrap();
    let output = fed(&folder, &format!("sequence - piped {RANGE}"), &grey);
    assert!(output.status.success(), "{output:?}");
    // A pipe may deliver the header in pieces.
    let mut child = started(&folder, &format!("sequence - pieces {RANGE}"));
    let mut stdin = child.stdin.take().unwrap();
    for piece in [&grey[..5], &grey[5..30], &grey[30..]] {
        stdin.write_all(piece).unwrap();
        stdin.flush().unwrap();
        std::thread::sleep(Duration::from_millis(100));
    }
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
    run(&folder, &format!("sequence both.y4m filed --quiet {RANGE}")).succeeded();
    for (name, scene) in SCENES {
        for (view, path) in [format!("left/{name}.png"), format!("right/{name}.ppm")].iter().enumerate() {
            let green = frame(scene, view).pixels().map(|pixel| pixel[1]).collect();
            let image = image::GrayImage::from_raw(SIZE.0, SIZE.1, green).unwrap();
            image.save_with_format(folder.join(path), image::ImageFormat::Png).unwrap();
        }
    }
    let of_grey = wanted(&folder);
    for output in ["piped", "pieces", "filed"] {
        assert_eq!(maps(&folder.join(output), numbers), of_grey, "{output}");
    }
}

/// The header of a film, and the luma of its pictures.
fn film(bytes: &[u8], (width, height): (usize, usize)) -> (String, Vec<Vec<u8>>) {
    let end = bytes.iter().position(|byte| *byte == b'\n').unwrap();
    let header = String::from_utf8(bytes[..end].into()).unwrap();
    let frames = bytes[end + 1..].chunks(6 + 3 * width * height).map(|frame| {
        assert_eq!(&frame[..6], b"FRAME\n");
        assert_eq!(frame.len(), 6 + 3 * width * height);
        frame[6..6 + width * height].to_vec()
    });
    (header, frames.collect())
}

#[test]
fn films_show_the_previews() {
    let folder = cameras();
    for output in ["film.y4m", "maps --also preview,side-by-side"] {
        run(&folder, &format!("sequence left right {output} --colours grey {RANGE}")).succeeded();
    }
    let preview = |name: &str, what: &str| {
        image::open(folder.join(format!("maps/{name}.{what}.png"))).unwrap().to_luma8()
    };
    let size = preview("f1", "preview").dimensions();
    let (header, pictures) =
        film(&fs::read(folder.join("film.y4m")).unwrap(), (size.0 as usize, size.1 as usize));
    assert_eq!(header, format!("YUV4MPEG2 W64 H{} F25:1 Ip A1:1 C444 XCOLORRANGE=LIMITED", size.1));
    let off = |picture: &[u8], name: &str| {
        let levels =
            preview(name, "preview").into_raw().into_iter().map(|v| 16.0 + f64::from(v) * 219.0 / 255.0);
        picture.iter().zip(levels).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max)
    };
    assert_eq!(pictures.len(), 3);
    for ((name, _), picture) in SCENES.iter().zip(&pictures) {
        assert!(off(picture, name) <= 1.0, "{name}");
    }
    assert!(off(&pictures[0], "f10") > 20.0, "control: another frame looks different");
    // On standard output, with the left image beside the map, at the frame rate of the input.
    let output =
        fed(&folder, &format!("sequence - - --also side-by-side --quiet {RANGE}"), &grey_stream(GREY));
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    let wide = preview("f1", "side-by-side").dimensions();
    let (header, pictures) = film(&output.stdout, (wide.0 as usize, wide.1 as usize));
    assert!(header.starts_with(&format!("YUV4MPEG2 W128 H{} F30000:1001 ", wide.1)), "{header}");
    assert_eq!(pictures.len(), 3);
}

#[test]
fn raw_frames_are_rectified_once_and_for_all() {
    let folder = Folder::new();
    for (camera, file) in [("left", "left.png"), ("right", "right.png")] {
        fs::create_dir(folder.join(camera)).unwrap();
        for name in ["a.png", "b.png"] {
            fs::copy(scene("raw").join(file), folder.join(camera).join(name)).unwrap();
        }
    }
    for frames in ["sequence left right maps", "match left/a.png right/a.png a.pfm"] {
        let options = "--rectify --calib @raw/cameras.yml --max-disparity 31 --device cpu --quiet";
        run(&folder, &format!("{frames} --also depth,points {options}")).succeeded();
    }
    let same =
        |one: &str, other: &str| fs::read(folder.join(one)).unwrap() == fs::read(folder.join(other)).unwrap();
    assert!(same("maps/a.pfm", "a.pfm"));
    for end in ["pfm", "depth.pfm", "points.ply"] {
        assert!(same(&format!("maps/b.{end}"), &format!("a.{end}")), "{end}");
    }
    // Control: unrectified views give other maps.
    run(&folder, "sequence left right others --max-disparity 31 --device cpu --quiet").succeeded();
    assert!(!same("others/a.pfm", "a.pfm"));
}

#[test]
fn invalid_sequences_are_reported_in_one_line() {
    let folder = cameras();
    for name in ["none", "fewer", "twice", "odd"] {
        fs::create_dir(folder.join(name)).unwrap();
    }
    fs::copy(folder.join("right/f1.ppm"), folder.join("fewer/f1.ppm")).unwrap();
    fs::copy(folder.join("left/f1.png"), folder.join("twice/f1.png")).unwrap();
    fs::copy(folder.join("right/f1.ppm"), folder.join("twice/F1.ppm")).unwrap();
    image::GrayImage::new(63, 48).save(folder.join("odd/a.png")).unwrap();
    for (name, bytes) in [
        ("text.y4m", "a picture is worth a thousand words"),
        ("empty.y4m", ""),
        ("head.y4m", GREY),
        ("huge.y4m", "YUV4MPEG2 W4294967295 H4294967295 F25:1 C420\nFRAME\n"),
        ("wide.y4m", "YUV4MPEG2 W99999999999999999999 H4 F25:1 C420\nFRAME\n"),
        ("none.y4m", "YUV4MPEG2 W0 H4 F25:1 C420\nFRAME\n"),
        ("size.y4m", "YUV4MPEG2 F25:1 C420\nFRAME\n"),
        ("kind.y4m", "YUV4MPEG2 W128 H48 F25:1 C411\nFRAME\n"),
        ("rate.y4m", "YUV4MPEG2 W128 H48 F25 Cmono\nFRAME\n"),
    ] {
        fs::write(folder.join(name), bytes).unwrap();
    }
    let before = listing(&folder);
    for (line, code, words) in [
        ("left right maps --max-disparity auto --calib nothing.yml", 1, "nothing.yml"),
        ("nowhere right maps", 1, "nowhere"),
        ("none maps", 1, "none & contains no images"),
        ("left/*.jpg right/* maps", 1, "left/*.jpg & no image"),
        ("left fewer maps", 1, "left/f2.png does not have a partner & fewer (nor does one other)"),
        ("left fewer maps --pairing order", 1, "left has 3 images & fewer has 1"),
        ("twice maps", 1, "f1.png & F1.ppm"),
        ("odd maps", 1, "frame a & 63 x 48 & odd"),
        ("left/f1.png right/f1.ppm maps", 1, "left/f1.png & neither a folder"),
        ("text.y4m maps", 1, "text.y4m & yuv4mpegpipe"),
        ("empty.y4m maps", 1, "empty.y4m & is empty"),
        ("head.y4m maps", 1, "head.y4m & no frame"),
        ("huge.y4m maps", 1, "huge.y4m & 4294967295 & limit"),
        ("wide.y4m maps", 1, "wide.y4m & size"),
        ("none.y4m maps", 1, "none.y4m & size"),
        ("size.y4m maps", 1, "size.y4m & size"),
        ("kind.y4m maps", 1, "kind.y4m & yuv444p & gray16le"),
        ("rate.y4m maps", 1, "rate.y4m & damaged"),
        ("head.y4m maps --raw-frames 8000x8000,rgb24 --max-pixels 1000", 1, "head.y4m & limit of 1000"),
        ("head.y4m maps --raw-frames 80x80,yuv420p", 2, "--raw-frames & gray16le"),
        ("- - maps", 2, "RIGHT & one stream"),
        ("left right left", 2, "left & another folder"),
        ("left right head.y4m/maps", 1, "maps"),
        ("head.y4m head.y4m", 2, "OUTPUT & already"),
        ("left right none/film.y4m --also validity", 2, "--also validity & folder"),
        ("left right nowhere/film.y4m", 1, "nowhere"),
        ("left right nowhere/maps", 1, "nowhere"),
        ("left right maps --also depth", 2, "--also depth & --calib"),
        ("left right maps --colours grey", 2, "--colours & preview"),
        ("left right maps --rectify", 2, "--calib"),
        ("left right maps --alpha 0.5", 2, "--alpha & --rectify"),
        ("left right maps --format png --min-disparity -9", 2, "png"),
        ("left", 2, "OUTPUT"),
        ("head.y4m maps --raw-frames 64x48,gray", 1, "head.y4m & YUV4MPEG2 & --raw-frames"),
        ("left/f1.png maps --raw-frames 8x8,gray", 1, "f1.png & remove --raw-frames"),
        ("left right maps --raw-frames 64x48,gray", 2, "--raw-frames & streams"),
        ("left right maps --layout top-bottom", 2, "--layout & RIGHT"),
        ("left right none/film.y4m --format png", 2, "--format & folder"),
        ("left right film.GIF", 2, "OUTPUT & NAME.y4m & ffmpeg -i - film.GIF"),
        ("left/f%02.png right maps", 1, "f%02.png & left/*.png & %04d"),
        ("left/g%d.png right maps", 1, "g%d.png & no image matches"),
        ("left right maps --mask none.png", 1, "none.png"),
        ("left right maps --mask above/f1.tif", 1, "frame f1 & the mask is 64 x 96"),
        ("left right - --json -", 2, "--json & film"),
        ("left right maps --json left/f1.png", 2, "--json & an input"),
        ("left right maps --json nowhere/file", 1, "nowhere"),
        ("beside maps --pairing common", 2, "--pairing & two cameras"),
    ] {
        let range = if line.contains("--max-disparity") { "" } else { " --max-disparity 23" };
        run(&folder, &format!("sequence {line}{range} --device cpu --quiet")).failed(code, words);
        assert_eq!(listing(&folder), before, "{line}");
    }
}

/// After a failure in the middle of a sequence, the maps of all earlier frames are complete.
#[test]
fn finished_frames_survive_a_failure() {
    let folder = cameras();
    let wanted = wanted(&folder);
    let whole = grey_stream(GREY);
    let second = GREY.len() + 6 + 128 * 48;
    for (name, bytes) in [
        ("cut.y4m", &whole[..whole.len() - 1]),
        ("short.y4m", &whole[..GREY.len() + 2 * (6 + 128 * 48)]),
        ("torn.y4m", &[&whole[..second], b"FRAMING\n", &whole[second + 6..]].concat()),
        ("whole.y4m", &whole),
        ("cut.raw", &whole[GREY.len()..][..5 * 64 * 48 + 7]),
    ] {
        fs::write(folder.join(name), bytes).unwrap();
    }
    for other in ["bad", "larger"].map(|name| folder.join(name)) {
        fs::create_dir(&other).unwrap();
        for file in SCENES.map(|(name, _)| format!("{name}.ppm")) {
            fs::copy(folder.join("right").join(&file), other.join(file)).unwrap();
        }
    }
    fs::write(folder.join("bad/f10.ppm"), "P6 64 48 255\nshort").unwrap();
    let larger = image::imageops::resize(&frame("thin", 1), 80, 48, image::imageops::FilterType::Nearest);
    larger.save(folder.join("larger/f2.ppm")).unwrap();
    for (i, (line, done, words)) in [
        ("cut.y4m OUT", 2, "cut.y4m & frame 000002 is cut off"),
        ("torn.y4m OUT", 1, "torn.y4m & frame 000001 is damaged"),
        ("whole.y4m short.y4m OUT", 2, "short.y4m ends here & whole.y4m goes on"),
        ("short.y4m whole.y4m OUT", 2, "short.y4m ends here & whole.y4m goes on"),
        ("cut.raw OUT --raw-frames 128x48,gray", 2, "cut.raw & frame 000002 is cut off"),
        ("left bad OUT", 2, "f10.ppm & truncated"),
        ("left larger OUT", 1, "frame f2 & 80 x 48"),
    ]
    .into_iter()
    .enumerate()
    {
        let (output, film) = (format!("maps{i}"), format!("film{i}.y4m"));
        for output in [&output, &film] {
            let line = line.replace("OUT", output);
            run(&folder, &format!("sequence {line} {RANGE} --quiet")).failed(1, words);
        }
        assert_eq!(listing(&folder.join(&output)).len(), done, "{line}");
        if line.starts_with("left") {
            assert_eq!(fs::read(folder.join(&output).join("f1.pfm")).unwrap(), wanted[0], "{line}");
        }
        let film = fs::read(folder.join(film)).unwrap();
        let frames = film.windows(6).filter(|bytes| bytes == b"FRAME\n").count();
        assert_eq!(frames, done, "{line}");
    }
}

#[cfg(unix)]
#[test]
fn finished_frames_survive_a_signal() {
    let folder = Folder::new();
    // Two frames, and a third that never ends.
    let stream = grey_stream(GREY);
    let stopped = |output: &str, signal: &str, ready: &dyn Fn() -> bool| {
        let mut child = started(&folder, &format!("sequence - {output} {RANGE}"));
        let mut stdin = child.stdin.take().unwrap();
        stdin.write_all(&stream[..stream.len() - 100]).unwrap();
        stdin.flush().unwrap();
        wait_until("ready", ready);
        send(signal, &child);
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        (child.wait().unwrap().code(), said)
    };
    // A producer that has sent nothing, or half a header or frame.
    for (signal, said) in [("-TERM", &b""[..]), ("-INT", b"YUV4"), ("-INT", &stream[..2000])] {
        let mut child = started(&folder, &format!("sequence - never {RANGE}"));
        child.stdin.as_mut().unwrap().write_all(said).unwrap();
        std::thread::sleep(Duration::from_secs(1));
        send(signal, &child);
        let mut words = String::new();
        child.stderr.take().unwrap().read_to_string(&mut words).unwrap();
        assert_eq!(words, "mrfgs: stopped before the first frame\n");
        assert_eq!(child.wait().unwrap().code(), Some(130));
        assert!(!folder.join("never").exists());
    }
    let end = "mrfgs: stopped after 2 frames\n";
    let signals: &[&str] = if cfg!(target_os = "linux") {
        &["-INT", "-HUP", "-QUIT", "-XCPU", "-ALRM", "-VTALRM", "-PROF", "-USR1", "-USR2"]
    } else {
        &["-INT"]
    };
    for signal in signals {
        let output = format!("maps{signal}");
        let (code, said) = stopped(&output, signal, &|| folder.join(&output).join("000001.pfm").exists());
        assert!(code == Some(130) && said.ends_with(end), "{signal}: {code:?}: {said}");
        assert_eq!(listing(&folder.join(output)).len(), 2, "{signal}");
    }
    // A film has no name until it ends, so its progress is invisible.
    let hang_up = if cfg!(target_os = "linux") { "-HUP" } else { "-TERM" };
    for (output, signal) in [("film.y4m", "-TERM"), ("found.mcap", hang_up)] {
        let done = [1, 4, 16].into_iter().any(|seconds| {
            let start = Instant::now();
            let patience = Duration::from_secs(seconds);
            let (code, said) = stopped(output, signal, &|| start.elapsed() > patience);
            code == Some(130) && said.ends_with(end)
        });
        assert!(done, "no {output} of two frames");
    }
    assert_eq!(recordings::messages(&folder.join("found.mcap"), "/disparity").len(), 2);
    let film = fs::read(folder.join("film.y4m")).unwrap();
    assert_eq!(film.windows(6).filter(|bytes| bytes == b"FRAME\n").count(), 2);
}

/// A player that closes the pipe ends the sequence with one line.
#[cfg(unix)]
#[test]
fn a_closed_player_ends_the_sequence() {
    let folder = cameras();
    let line = format!("sequence left right - --quiet {RANGE}");
    let mut child = started(&folder, &line);
    drop(child.stdout.take());
    Run::of(&line, child.wait_with_output().unwrap()).failed(1, "the reader closed it");
}

/// Frames overlap on a GPU; the maps are the same.
#[test]
fn a_device_gives_the_same_maps() {
    if !has_gpu() {
        return;
    }
    let folder = cameras();
    run(&folder, "sequence left right maps --max-disparity 23 --device gpu --quiet --set measure-every=1")
        .succeeded();
    assert_eq!(maps(&folder.join("maps"), SCENES.map(|(name, _)| name)), wanted(&folder));
}
