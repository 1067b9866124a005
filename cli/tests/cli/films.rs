//! Films that ffmpeg decodes and encodes for `mrfgs sequence`. A script replaces ffmpeg, so the tests run everywhere: a film is YUV4MPEG2
//! after the bytes that identify its container.

use super::*;

/// Records the arguments, and copies films named `whole`; a film named `torn` fails midway.
const FFMPEG: &str = r#"#!/bin/sh
echo "$@" >> asked
for last; do :; done
case "$*" in
*-version*) ;;
*" -i - "*) cat > "${last#file:}" ;;
*hurt*) tail -c +13 hurt.mp4; echo "hurt.mp4: error while decoding MB 3 4" >&2 ;;
*torn*) head -c 9000 torn.mp4 | tail -c +13; echo "some warning" >&2; echo "torn.mp4: moov atom not found" >&2; exit 69 ;;
*) for word; do case "$word" in file:*) tail -c +13 "${word#file:}" ;; esac; done ;;
esac
"#;

const RANGE: &str = "--max-disparity 23 --device cpu";

/// A folder with two frames as YUV4MPEG2 and as a film, and the folder of a program ffmpeg.
fn films() -> Folder {
    let folder = Folder::new();
    let mut stream = b"YUV4MPEG2 W128 H48 F30:1 Ip A1:1 Cmono\n".to_vec();
    for name in ["slanted", "thin"] {
        let views =
            ["im0.png", "im1.png"].map(|file| image::open(scene(name).join(file)).unwrap().to_luma8());
        stream.extend(b"FRAME\n");
        for y in 70..118 {
            for view in &views {
                stream.extend((90..154).map(|x| view.get_pixel(x, y)[0]));
            }
        }
    }
    fs::write(folder.join("plain.y4m"), &stream).unwrap();
    for name in ["whole.mp4", "torn.mp4", "hurt.mp4"] {
        fs::write(folder.join(name), [b"\0\0\0\x20ftypisom", stream.as_slice()].concat()).unwrap();
    }
    fs::write(folder.join("whole.mkv"), [b"\x1a\x45\xdf\xa3\0\0\0\0\0\0\0\0", stream.as_slice()].concat())
        .unwrap();
    fs::create_dir(folder.join("bin")).unwrap();
    let program = folder.join("bin/ffmpeg");
    fs::write(&program, FFMPEG).unwrap();
    fs::set_permissions(&program, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    folder
}

/// The files in the folder, without the record of arguments.
fn files(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let mut files = listing(folder);
    files.remove(&folder.join("asked"));
    files
}

fn with_ffmpeg(folder: &Path, line: &str) -> Run {
    let path = format!("{}:{}", folder.join("bin").display(), std::env::var("PATH").unwrap());
    run_with(folder, line, &[("PATH", &path)])
}

#[test]
fn films_give_the_maps_of_the_plain_stream() {
    let folder = films();
    let at = |name: &str| fs::read(folder.join(name)).unwrap();
    run(&folder, &format!("sequence plain.y4m plain --quiet {RANGE}")).succeeded();
    run(&folder, &format!("sequence plain.y4m plain-film.y4m --quiet {RANGE}")).succeeded();
    for name in ["whole.mp4", "whole.mkv"] {
        let told = with_ffmpeg(&folder, &format!("sequence {name} maps {RANGE}")).succeeded();
        told.says(&format!("ffmpeg decodes {name}"));
        for frame in ["000000.pfm", "000001.pfm"] {
            assert!(at(&format!("maps/{frame}")) == at(&format!("plain/{frame}")), "{name}");
        }
        fs::remove_dir_all(folder.join("maps")).unwrap();
    }
    let before = files(&folder);
    with_ffmpeg(&folder, &format!("sequence plain.y4m film.mp4 --quiet {RANGE}")).succeeded();
    assert!(at("film.mp4") == at("plain-film.y4m"));
    fs::remove_file(folder.join("film.mp4")).unwrap();
    assert_eq!(files(&folder), before, "no other files");
    // No frame is dropped, and paths are passed safely.
    let asked = fs::read_to_string(folder.join("asked")).unwrap();
    assert!(asked.contains("-i file:whole.mp4") && asked.contains("setpts=N/FRAME_RATE/TB"), "{asked}");
    assert!(asked.contains("pad=ceil(iw/2)*2:ceil(ih/2)*2 -pix_fmt yuv420p"), "{asked}");
}

#[test]
fn failures_of_ffmpeg_are_reported() {
    let folder = films();
    // Damage that ffmpeg conceals only causes a warning.
    let words =
        "warning: hurt.mp4: some frames may be damaged; ffmpeg says: hurt.mp4: error while decoding MB 3 4";
    with_ffmpeg(&folder, &format!("sequence hurt.mp4 hurt {RANGE}")).succeeded().says(words);
    assert_eq!(listing(&folder.join("hurt")).len(), 2);
    let said = with_ffmpeg(&folder, &format!("sequence whole.mp4 sound {RANGE}")).succeeded().stderr;
    assert!(!said.contains("warning"), "{said}");
    with_ffmpeg(&folder, &format!("sequence torn.mp4 maps --quiet {RANGE}"))
        .failed(1, "torn.mp4 & ffmpeg: torn.mp4: moov atom not found");
    // The first frame was intact.
    assert_eq!(listing(&folder.join("maps")).len(), 1);
    let before = files(&folder);
    with_ffmpeg(&folder, &format!("sequence whole.mp4 whole.mp4 --quiet {RANGE}"))
        .failed(2, "OUTPUT & already");
    let empty = folder.join("empty");
    fs::create_dir(&empty).unwrap();
    for (line, instead) in
        [("whole.mp4 maps", "a folder of frames or NAME.y4m"), ("plain.y4m film.mp4", "or give NAME.y4m")]
    {
        let said = run_with(
            &folder,
            &format!("sequence {line} --quiet {RANGE}"),
            &[("PATH", empty.to_str().unwrap())],
        );
        said.failed(1, &format!("mp4 & not on the PATH & install it & {instead}"));
    }
    fs::remove_dir(&empty).unwrap();
    assert_eq!(files(&folder), before);
}
