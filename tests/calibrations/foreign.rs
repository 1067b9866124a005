//! Two hundred files that are no calibration of a pair. The reader of `match` and `rectify` refuses each.

use super::forms::{
    METASHAPE, MIDDLEBURY, NAMES, driving_stereo, entry, kalibr, lens, mrcal, npz, opencv, ost, ros, zed,
};
use super::*;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

/// Name and bytes of a file, and the expected words of the error.
struct File {
    name: String,
    bytes: Vec<u8>,
    words: &'static str,
}

fn file(name: &str, bytes: impl AsRef<[u8]>, words: &'static str) -> File {
    File { name: name.into(), bytes: bytes.as_ref().to_vec(), words }
}

const NONE: &str = "is no calibration of a known form & expected the entries of OpenCV";
const BYTES: &str = "bytes that are not text";

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut writer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    writer.write_all(bytes).unwrap();
    writer.finish().unwrap()
}

fn utf16(text: &str) -> Vec<u8> {
    [0xff, 0xfe].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect()
}

fn at(offset: usize, magic: &[u8]) -> Vec<u8> {
    [&vec![b'a'; offset], magic, b"\0\x01\x02\x03 more \xff\xfe"].concat()
}

/// Binary files: the offset of the signature, the signature, and the expected words.
fn binaries() -> Vec<File> {
    let kinds: &[(&str, usize, &[u8], &str)] = &[
        ("a.png", 0, b"\x89PNG\r\n\x1a\n", "a PNG image & not a calibration"),
        ("calib.txt", 0, b"\x89PNG\r\n\x1a\nwidth=3\n", "a PNG image"),
        ("a.jpg", 0, b"\xff\xd8\xff\xe0", "a JPEG image"),
        ("pair.mpo", 0, b"\xff\xd8\xff\xe1", "a JPEG image"),
        ("a.tif", 0, b"II*\0", "a TIFF image"),
        ("b.tif", 0, b"MM\0*", "a TIFF image"),
        ("big.tif", 0, b"II+\0", "a TIFF image"),
        ("a.gif", 0, b"GIF89a", "a GIF image"),
        ("a.webp", 0, b"RIFF\x20\0\0\0WEBP", "a WebP image"),
        ("a.wav", 0, b"RIFF\x20\0\0\0WAVE", "a sound"),
        ("a.avi", 0, b"RIFF\x20\0\0\0AVI ", "a film"),
        ("a.mp4", 0, b"\0\0\0\x20ftypisom", "a film"),
        ("a.heic", 0, b"\0\0\0\x18ftypheic", "a photograph of a phone"),
        ("a.jp2", 0, b"\0\0\0\x0cjP  \r\n", "a JPEG 2000 image"),
        ("a.exr", 0, b"\x76\x2f\x31\x01", "an OpenEXR image"),
        ("d.pfm", 0, b"Pf\n4 4\n-1.0\n", "a PFM map"),
        ("colours.pfm", 0, b"PF\n4 4\n-1.0\n", "a PFM map"),
        ("a.pgm", 0, b"P5\n4 4\n255\n", "a PGM image"),
        ("a.ppm", 0, b"P6\n4 4\n255\n", "a PPM image"),
        ("a.mkv", 0, b"\x1aE\xdf\xa3", "a film"),
        ("a.ply", 0, b"ply\nformat binary_little_endian 1.0\n", "a cloud of points"),
        ("a.pcd", 0, b"# .PCD v0.7\nVERSION 0.7\n", "a cloud of points"),
        ("a.las", 0, b"LASF", "a cloud of points"),
        ("a.glb", 0, b"glTF\x02\0\0\0", "a scene"),
        ("a.pdf", 0, b"%PDF-1.7\n", "a PDF document"),
        ("a.ps", 0, b"%!PS-Adobe-3.0\n", "a PostScript document"),
        ("a.rtf", 0, b"{\\rtf1\\ansi", "an RTF document"),
        ("mrfgs", 0, b"\x7fELF\x02", "a program"),
        ("A.class", 0, b"\xca\xfe\xba\xbe", "a program"),
        ("a.wasm", 0, b"\0asm\x01", "a program"),
        ("a.db3", 0, b"SQLite format 3\0", "a database"),
        ("a.mp3", 0, b"ID3\x04", "a sound"),
        ("a.ogg", 0, b"OggS\0", "a sound or a film"),
        ("a.dcm", 128, b"DICM", "a DICOM image"),
        ("a.mcap", 0, b"\x89MCAP0\r\n", "is a recording & `sequence`"),
        ("a.bag", 0, b"#ROSBAG V2.0\n", "is a recording & `sequence`"),
        ("calibrationdata.tar", 257, b"ustar", "tar archive & unpack it & two cameras"),
        ("a.docx", 0, b"PK\x03\x04\x14\0\x06\0", "ZIP archive & unpack it"),
        ("a.7z", 0, b"7z\xbc\xaf\x27\x1c", "7-Zip archive & unpack it"),
        ("a.rar", 0, b"Rar!\x1a\x07", "RAR archive & unpack it"),
        ("a.bz2", 0, b"BZh91AY", "bzip2 & unpack it"),
        ("a.xz", 0, b"\xfd7zXZ\0", "xz & unpack it"),
        ("a.zst", 0, b"\x28\xb5\x2f\xfd", "zstd & unpack it"),
        ("K1.npy", 0, b"\x93NUMPY\x01\0", "one array of numpy & np.savez"),
        ("two.pkl", 0, b"\x80\x02}q", "pickle of Python & np.savez"),
        ("four.pkl", 0, b"\x80\x04\x95", "pickle of Python & np.savez"),
        ("a.mat", 0, b"MATLAB 5.0 MAT-file", "MAT-file of MATLAB & stereoParametersToOpenCV"),
        ("new.mat", 0, b"MATLAB 7.3 MAT-file", "MAT-file of MATLAB & stereoParametersToOpenCV"),
        ("a.h5", 0, b"\x89HDF\r\n\x1a\n", "HDF5 file & as OpenCV has them"),
        ("a.flo", 0, b"PIEH", "MPI Sintel"),
        (
            "lfs.yml",
            0,
            b"version https://git-lfs.github.com/spec/v1\noid sha256:ab\n",
            "Git LFS & git lfs pull",
        ),
        ("a.bmp", 0, b"BM\x36\0\0\0", BYTES),
        ("a.psd", 0, b"8BPS\0\x01", BYTES),
        ("a.ico", 0, b"\0\0\x01\0", BYTES),
        ("a.ttf", 0, b"\0\x01\0\0\0", BYTES),
        ("a.exe", 0, b"MZ\x90\0\x03", BYTES),
        ("a.pyc", 0, b"\xa7\r\r\n\0\0\0\0", BYTES),
        ("cameras.bin", 0, b"\x02\0\0\0\0\0\0\0\x01\0\0\0", BYTES),
        ("floats.raw", 0, b"\0\0\x80\x3f\0\0\0\x40", BYTES),
        ("zeros", 0, &[0; 64], BYTES),
        ("wide-without-mark.txt", 0, b"K\x001\0:\0 \0", BYTES),
        ("escape.yml", 0, b"%YAML:1.0\nK1: \x1b[31m5\n", BYTES),
    ];
    let mut all: Vec<File> =
        kinds.iter().map(|(name, offset, magic, words)| file(name, at(*offset, magic), words)).collect();
    let archive = npz(&[("arr_0", "(2, 2)", vec![1.0; 4])]);
    let (readme, mono) =
        (b"# A project\n\nIt does things.\n", npz(&[("camera_matrix", "(3, 3)", vec![1.0; 9])]));
    all.extend([
        file("readme.gz", gzip(readme), NONE),
        file("image.gz", gzip(&at(0, b"\x89PNG\r\n\x1a\n")), "a PNG image"),
        file(
            "cut.gz",
            &gzip(opencv(NAMES).as_bytes())[..60],
            "is damaged gzip, or a part of it is missing; copy it again",
        ),
        file("empty.gz", gzip(b""), "is empty"),
        file("calibrationdata.tar.gz", gzip(&at(257, b"ustar")), "tar archive & unpack it"),
        file("readme-of-windows.txt", utf16("A project\r\nof some kind\r\n"), NONE),
        file("nothing.txt", utf16(""), "is empty"),
        file("other.npz", &archive, NONE),
        file("cut.npz", &archive[..archive.len() - 30], "ZIP archive"),
        file(
            "maps.npz",
            npz(&[("map1", "(40, 50)", vec![1.0; 2000])]),
            "an .npz without the arrays of a calibration",
        ),
        file("mono.npz", mono, "is of one camera"),
        file("twice.npz", npz(&[("K1", "(1,)", vec![1.0]), ("K1", "(1,)", vec![2.0])]), "K1 is there twice"),
    ]);
    all
}

/// Texts for other purposes.
fn texts() -> Vec<File> {
    let rows: &[(&str, &str)] = &[
        ("README.md", "# Stereo\n\nNote: this is `K1=5`.\n\n* one\n* two\n"),
        ("README.rst", "Stereo\n======\n\n.. code:: sh\n\n   make\n"),
        ("README", "Stereo: a program\n- it matches: pairs\n   - and more: of them\n  * odd\n"),
        (
            "LICENSE",
            "MIT License\n\nCopyright (c) 2024 Somebody\n\nPermission is hereby granted: free of charge\n",
        ),
        ("CHANGELOG.md", "## 1.0\n- first\n## 0.9\n- none\n"),
        ("words.txt", "some words"),
        ("hello.txt", "hello world\n"),
        ("key_value.txt", "abc=1\n"),
        ("a.env", "DATABASE_URL=postgres://localhost\nPORT=5432\n"),
        ("a.properties", "user.name=somebody\nuser.home=/home\n"),
        ("letter", "K"),
        ("emoji.txt", "\u{1f600}\n"),
        ("japanese.txt", "\u{6821}\u{6b63}\u{30d5}\u{30a1}\u{30a4}\u{30eb}\n"),
        ("a.py", "import numpy as np\nwidth = 640\nbaseline = 0.12\n"),
        ("b.py", "#!/usr/bin/env python3\n\"\"\"Calibrates.\"\"\"\nK1 = np.eye(3)\n"),
        ("a.c", "#include <stdio.h>\nint main(void) { return 0; }\n"),
        ("a.h", "#pragma once\nstruct Camera { double fx, fy; };\n"),
        ("a.cpp", "// A calibration\ncv::Mat K1, D1;\n"),
        ("a.rs", "fn main() {\n    println!(\"a: {}\", 1);\n}\n"),
        ("a.js", "const k1 = [1, 2, 3];\nexport default { k1 };\n"),
        ("a.ts", "interface Camera { fx: number; fy: number }\n"),
        ("a.java", "public class A {\n  int x = 1;\n}\n"),
        ("a.go", "package main\n\nfunc main() {}\n"),
        ("a.m", "load('stereo.mat');\ndisp(stereoParams);\n"),
        ("a.sh", "#!/bin/sh\nset -e\nexport A=1\nmake\n"),
        ("a.bat", "@echo off\r\nset A=1\r\n"),
        ("Makefile", "all: a.o\n\tcc -o a a.o\n"),
        ("CMakeLists.txt", "cmake_minimum_required(VERSION 3.10)\nproject(a)\n"),
        ("Dockerfile", "FROM debian:12\nRUN apt-get update\n"),
        ("a.css", "body { color: red }\n.a:hover { color: blue }\n"),
        ("a.sql", "SELECT k1, k2 FROM cameras WHERE id = 1;\n"),
        ("a.tex", "\\documentclass{article}\n\\begin{document}\nK: 1\n\\end{document}\n"),
        ("a.bib", "@article{a, title={Stereo}, year={2024}}\n"),
        ("a.csv", "name,left,right\na,l.png,r.png\n"),
        ("points.csv", "x,y,z\n1,2,3\n4,5,6\n"),
        ("a.tsv", "id\tfx\tfy\n1\t500\t500\n"),
        ("a.srt", "1\n00:00:01,000 --> 00:00:02,000\nHello\n"),
        ("a.log", "INFO: started\nINFO: read 2 images\nERROR: none\n"),
        ("syslog", "Jan 12 10:00:00 host kernel: [1.0] usb 1-1: new device\n"),
        ("mail.eml", "From: a@b.c\nTo: d@e.f\nSubject: calibration\n\nHello\n"),
        ("a.vcf", "BEGIN:VCARD\nVERSION:4.0\nFN:Some Body\nEND:VCARD\n"),
        ("a.ics", "BEGIN:VCALENDAR\nVERSION:2.0\nEND:VCALENDAR\n"),
        ("a.diff", "--- a/K\n+++ b/K\n@@ -1 +1 @@\n-1\n+2\n"),
        (".gitignore", "target\n*.o\n!keep\n"),
        ("requirements.txt", "numpy==1.26\nopencv-python>=4\n"),
        ("hosts", "127.0.0.1 localhost\n::1 localhost\n"),
        ("fstab", "UUID=ab / ext4 defaults 0 1\n"),
        ("passwd", "root:x:0:0:root:/root:/bin/sh\n"),
        ("crontab", "0 5 * * * root backup\n"),
        ("a.pem", "-----BEGIN CERTIFICATE-----\nMIIB\n-----END CERTIFICATE-----\n"),
        ("id.pub", "ssh-ed25519 AAAAC3Nz somebody@host\n"),
        ("base64.txt", "JVlBTUw6MS4wCi0tLQpLMTogNQo=\n"),
        ("a.obj", "# OBJ\nv 1 2 3\nv 4 5 6\nf 1 2 1\n"),
        ("a.stl", "solid a\n facet normal 0 0 1\nendsolid a\n"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n"),
        ("a.gcode", "G21 ; millimetres\nG28\nG1 X10 Y10\n"),
        ("ORBvoc.txt", "10 6 0 0\n0 0 252 188 188 242 some 1\n"),
        ("view.rviz", "Panels:\n  - Class: rviz/Displays\n    Name: Displays\n"),
        ("compose.yaml", "services:\n  a:\n    image: debian\n"),
        ("ci.yml", "name: ci\non: [push]\njobs:\n  a:\n    runs-on: ubuntu\n"),
        ("environment.yml", "name: stereo\nchannels:\n  - conda-forge\n"),
        ("metadata.yaml", "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n"),
        ("params.yaml", "/stereo:\n  ros__parameters:\n    k1: 5\n    t: 0.1\n"),
        ("detector.yml", "%YAML:1.0\n---\nadaptiveThreshWinSizeMin: 3\nadaptiveThreshWinSizeMax: 23\n"),
        ("board.yml", "%YAML:1.0\n---\nboard_width: 9\nboard_height: 6\nsquare_size: 0.025\n"),
        (
            "sgbm.yml",
            "%YAML:1.0\n---\nname: StereoMatcher.SGBM\nminDisparity: 0\nP1: 200\nP2: 400\nmode: 0\n",
        ),
        ("radial.yml", "k1: -0.1\nk2: 0.01\np1: 0\np2: 0\n"),
        ("line.json", "{\"p1\": [0, 1], \"p2\": [1, 0], \"r\": 3, \"t\": 4}"),
        ("package.json", "{\"name\": \"a\", \"version\": \"1.0.0\"}"),
        ("tsconfig.json", "{\"compilerOptions\": {\"strict\": true}}"),
        ("coco.json", "{\"images\": [], \"annotations\": [], \"categories\": []}"),
        ("labelme.json", "{\"version\": \"5.0\", \"shapes\": [], \"imageHeight\": 480}"),
        ("scene.gltf", "{\"asset\": {\"version\": \"2.0\"}, \"cameras\": [{\"type\": \"perspective\"}]}"),
        ("empty.json", "{}"),
        ("array.json", "[1, \"two\", null]"),
        ("null.json", "null"),
        ("pom.xml", "<project><modelVersion>4.0.0</modelVersion></project>"),
        ("a.launch", "<launch><node name=\"a\" pkg=\"b\" type=\"c\"/></launch>"),
        ("rss.xml", "<?xml version=\"1.0\"?><rss version=\"2.0\"><channel/></rss>"),
        ("a.gpx", "<?xml version=\"1.0\"?><gpx version=\"1.1\"><trk/></gpx>"),
        ("storage.xml", "<?xml version=\"1.0\"?><opencv_storage><nothing>1</nothing></opencv_storage>"),
        ("less-than.txt", "< 5 is small\n"),
        ("braces.txt", "{{ template }}\n"),
        ("Cargo.toml", "[package]\nname = \"a\"\nversion = \"1.0.0\"\n"),
        ("a.desktop", "[Desktop Entry]\nName=A\nExec=a\n"),
        ("a.service", "[Unit]\nDescription=A\n\n[Service]\nExecStart=/bin/a\n"),
        ("gitconfig", "[user]\n\tname = Somebody\n"),
        ("stereo.ini", "[STEREO]\nmode = fast\n"),
    ];
    let mut all: Vec<File> = rows.iter().map(|(name, text)| file(name, text, NONE)).collect();
    let named: &[(&str, &str, &str)] = &[
        ("empty.txt", "", "is empty"),
        ("blank.txt", " \n\t\r\n", "is empty"),
        ("mark.txt", "\u{feff}", "is empty"),
        (
            "page.html",
            "<!DOCTYPE html>\n<html><body>K1: 1</body></html>\n",
            "a web page & download the file itself",
        ),
        ("github.yml", "\n<html lang=\"en\"><head></head></html>", "a web page & download the file itself"),
        ("merge.yml", "<<<<<<< HEAD\nK1: 1\n=======\nK1: 2\n>>>>>>> b\n", "marks of a merge & resolve"),
        ("number.txt", "64\n", "numbers without names"),
        ("dmin.txt", "30", "numbers without names"),
        ("K1.txt", "500 0 320\n0 500 240\n0 0 1\n", "numbers without names & as OpenCV has them"),
        ("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n", "numbers without names"),
        ("trajectory.txt", "1.5 0 0 0 0 0 0 1\n", "numbers without names"),
        ("cloud.xyz", "1,2,3\n4,5,6\n", "numbers without names"),
        ("a.urdf", "<robot name=\"a\"/>", "model of a robot"),
        ("a.sdf", "<?xml version=\"1.0\"?><sdf version=\"1.6\"/>", "model of a simulation"),
        ("a.svg", "<svg xmlns=\"http://www.w3.org/2000/svg\"/>", "a picture"),
        ("a.xmp", "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"/>", "one photograph"),
        ("a.kml", "<?xml version=\"1.0\"?><kml/>", "a map"),
        (
            "images.xml",
            "<?xml version=\"1.0\"?><opencv_storage><images>a.png</images></opencv_storage>",
            "OpenCV's list of images",
        ),
        (
            "face.xml",
            "<?xml version=\"1.0\"?><opencv_storage><cascade/></opencv_storage>",
            "OpenCV's detector",
        ),
        ("view.xml", "<VCGCamera FocalMm=\"5\"/>", "MeshLab's"),
        ("a.ipynb", "{\"cells\": [], \"nbformat\": 4}", "notebook of Jupyter"),
        ("a.geojson", "{\"type\": \"FeatureCollection\", \"features\": []}", "a map"),
    ];
    all.extend(named.iter().map(|(name, text, words)| file(name, text, words)));
    all
}

/// Calibrations of one camera, damaged ones, and contradictory ones.
fn damaged() -> Vec<File> {
    let (cv, chain) = (
        opencv(NAMES),
        kalibr(
            "radtan",
            ["", &entry("T_cn_cnm1", "[1, 0, 0, -1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]")],
        ),
    );
    let changed = |text: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    };
    let middlebury = |from: &str, to: &str| changed(MIDDLEBURY, from, to);
    let zed = zed("HD", "k1 = 0\n", "");
    let mut all = vec![
        file("typo-1.txt", middlebury("ndisp", "ndips"), "line 7: `ndips` & ndisp may be meant"),
        file("typo-2.txt", middlebury("baseline", "basline"), "`basline` & baseline may be meant"),
        file("typo-3.txt", middlebury("doffs", "doff"), "`doff` & doffs may be meant"),
        file("typo-4.txt", middlebury("width", "Width"), "`Width` & width may be meant"),
        file("typo-5.txt", middlebury("cam0", "cam2"), "`cam2` & cam0 may be meant"),
        file("typo-6.txt", "ndips=48\n", "line 1: `ndips` & ndisp may be meant"),
        file("foreign-key.txt", format!("{MIDDLEBURY}rms=0.5\n"), "line 8: `rms` & put # in front"),
        file("words.txt", format!("{MIDDLEBURY}of a rig\n"), "line 8: `of a rig`"),
        file("no-value.txt", middlebury("ndisp=64", "ndisp 64"), "line 7: ndisp: expected key=value"),
        file("twice-1.txt", format!("{MIDDLEBURY}ndisp=64\n"), "line 8: ndisp: is there twice"),
        file(
            "twice-2.txt",
            format!("{MIDDLEBURY}cam0=[1 0 2; 0 1 2; 0 0 1]\n"),
            "line 8: cam0: is there twice",
        ),
        file("no-number.txt", middlebury("ndisp=64", "ndisp=many"), "line 7: ndisp & `many`"),
        file("cut-1.txt", &MIDDLEBURY[..25], "line 1: cam0 & not a camera matrix"),
        file("cut-2.txt", &MIDDLEBURY[..50], "line 2: cam1 & not a camera matrix"),
        file("apart.txt", middlebury("doffs=10", "doffs=-10"), "cam1 & contradicts doffs"),
        file("mono-1.yml", lens(""), "is of one camera & the other one too"),
        file(
            "mono-2.yaml",
            ros("500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0"),
            "is of one camera & the other one too",
        ),
        file("mono-3.txt", ost("", "0.0"), "is of one camera & the other one too"),
        file(
            "mono-4.cameramodel",
            mrcal("LENSMODEL_PINHOLE", "", 0.0),
            "is of one camera & the other one too",
        ),
        file("mono-5.yaml", chain.split("cam1:\n").next().unwrap(), "cam1 is missing"),
        file("mono-6.yaml", "T_BS:\n  data: [1]\n", "is of one camera"),
        file("mono-7.xml", METASHAPE, "Metashape's"),
        file("mono-8.txt", "1 PINHOLE 640 480 500 500 320 240\n", "images.txt is missing"),
        file(
            "mono-9.yaml",
            "%YAML:1.0\n---\nmodel_type: PINHOLE\nprojection_parameters:\n   fx: 1\n",
            "is one of three files",
        ),
        file("mono-10.txt", "P2: 1 0 0 0 0 1 0 0 0 0 1 0\nP0: 1 0 0 0 0 1 0 0 0 0 1 0\n", "P3 is missing"),
        file("mono-11.conf", "[CAM_HD]\nfx=1\n[DISTO]\nk1=0\n", "no lenses of a pair"),
        file("mono-12.yaml", "cameras:\n- T_SC: [1]\n", "has one camera"),
        file("one-disto.conf", changed(&zed, "RIGHT_CAM_HD", "RIGHT_HD"), "RIGHT_CAM_HD is missing"),
        file("no-stereo.conf", changed(&zed, "Baseline = 120", "Baseline = 0"), "both cameras in one place"),
        file("twice-1.yml", format!("{cv}K1: 5\n"), "`K1` is there twice"),
        file(
            "twice-2.yml",
            format!("{cv}cameraMatrix1: [501, 0, 320, 0, 500, 240, 0, 0, 1]\n"),
            "cameraMatrix1: contradicts K1",
        ),
        file("twice-3.yml", format!("{cv}trans: [-0.13, 0, 0]\n"), "trans: contradicts T"),
        file("twice-4.yml", format!("{cv}image_size: [320, 240]\n"), "image_size: contradicts imageSize"),
        file("twice-5.yml", format!("{cv}---\nK1: 5\n"), "several documents"),
        file("twice-6.json", "{\"K1\": 1, \"K2\": 2, \"K1\": 3}", "`K1` is there twice"),
        file("twice-7.xml", "<a><K1>1</K1><K1>2</K1></a>", "`K1` is there twice"),
        file(
            "twice-8.conf",
            changed(&zed, "[LEFT_CAM_HD]\n", "[LEFT_CAM_HD]\nfx = 499\n"),
            "`fx` is there twice",
        ),
        file("twice-9.conf", format!("{zed}[STEREO]\nBaseline = 119\n"), "`STEREO` is there twice"),
        file("twice-10.yaml", format!("{chain}cam1:\n  a: 1\n"), "`cam1` is there twice"),
        file("twice-11.txt", driving_stereo() + "K_101: 1 0 0 0 1 0 0 0 1\n", "`K_101` is there twice"),
        file("twice-12.txt", ost("/left", "0.0") + "projection\n1 2 3\n", "`projection` is there twice"),
        file(
            "typo-1.yml",
            format!("{cv}fishey: 1\n"),
            "fishey: is no entry that is known; fisheye may be meant",
        ),
        file(
            "typo-2.yml",
            changed(&cv, "imageSize", "imgaeSize"),
            "imgaeSize: is no entry & imagesize may be meant",
        ),
        file("typo-3.yml", format!("{cv}uni: mm\n"), "uni: is no entry & unit may be meant"),
        file(
            "typo-4.yml",
            format!("{cv}distorsion_model: equidistant\n"),
            "distorsion_model & distortionmodel may be meant",
        ),
        file("no-rotation.yml", changed(&cv, "R: ", "X: "), "R is missing"),
        file("no-lens.yml", changed(&cv, "K2: ", "X: "), "K2 is missing"),
        file("in-place.yml", changed(&cv, "-0.12, 0, 0", "0, 0, 0"), "the two cameras apart"),
        file("nan.yml", changed(&cv, "-0.12, 0, 0", ".nan, 0, 0"), "T: expected 3 numbers"),
        file(
            "zeros.yml",
            changed(&cv, "500, 0, 320, 0, 500, 240, 0, 0, 1", "0, 0, 0, 0, 0, 0, 0, 0, 0"),
            "K1: expected a camera matrix",
        ),
        file("skewed.yml", changed(&cv, "500, 0, 320", "500, 3, 320"), "K1: expected a camera matrix"),
        file(
            "mirrored.yml",
            changed(&cv, "1, 0, 0, 0, 1, 0, 0, 0, 1", "-1, 0, 0, 0, 1, 0, 0, 0, 1"),
            "R: expected a rotation",
        ),
        file("tabs.yml", changed(&cv, "\n   rows", "\n\trows"), "is no YAML"),
        file("referring.yml", "%YAML:1.0\n---\na: &a [1]\nK1: *a\n", "found a reference"),
        file("no-end.json", "{\"K1\": [1, 0, 0", "is no JSON"),
        file("comma.json", "{\"K1\": 1,}", "is no JSON"),
        file("nan.json", "{\"K1\": NaN}", "is no JSON"),
        file("no-end.xml", "<opencv_storage><K1>1</K1>", "is no XML"),
        file("bomb.xml", "<!DOCTYPE a [<!ENTITY b \"c\">]><a>&b;</a>", "is no XML"),
        file(
            "no-section.conf",
            changed(&zed, "[LEFT_CAM_HD]", "# [LEFT_CAM_HD]"),
            "is no calibration of a known form",
        ),
    ];
    // Files that are cut off in the middle of a matrix.
    for (form, text, words) in [
        ("opencv.yml", cv.clone(), "is no YAML"),
        ("chain.yaml", chain.clone(), "is no YAML"),
        (
            "camera.json",
            "{\"extrinsic\": {\"baseline\": 0.12, \"pitch\": 0.03}, \"intrinsic\": {\"fx\": 5, \"u0\": 3}}"
                .into(),
            "is no JSON",
        ),
        (
            "rig.xml",
            "<opencv_storage><K1><rows>3</rows><data>1 0 0</data></K1></opencv_storage>".into(),
            "is no XML",
        ),
    ] {
        let brackets = text.match_indices(['[', '{', '<']).map(|(i, _)| i).collect::<Vec<_>>();
        for part in [1, 2] {
            let end = brackets[brackets.len() * part / 3] + 2;
            all.push(file(&format!("cut-{part}-{form}"), &text[..end], words));
        }
    }
    all
}

/// A format that the error mentions although neither name nor start of the file suggests it.
fn speaks_of_another(file: &File, told: &str) -> Option<&'static str> {
    let text = String::from_utf8_lossy(&file.bytes);
    let start = text.trim_start_matches('\u{feff}').trim_start();
    let extension = Path::new(&file.name).extension().and_then(|end| end.to_str()).unwrap_or_default();
    let yaml = start.starts_with("%YAML") || start.starts_with("---") || ["yml", "yaml"].contains(&extension);
    let formats = [
        (" YAML", yaml),
        (" JSON", start.starts_with('{')),
        (" XML", start.starts_with('<')),
        ("calib.txt", extension == "txt" && text.contains('=')),
    ];
    let said = told.replace(&file.name, "");
    formats.into_iter().find(|(word, may)| said.contains(word) && !may).map(|(word, _)| word)
}

#[test]
fn files_that_are_no_calibrations_are_refused() {
    let all = [binaries(), texts(), damaged()].into_iter().flatten().collect::<Vec<_>>();
    let different: BTreeSet<&[u8]> = all.iter().map(|file| file.bytes.as_slice()).collect();
    assert!(different.len() >= 200, "{} files", different.len());
    let mut wrong = Vec::new();
    for one in &all {
        match read(&[(&one.name, &one.bytes)]) {
            Ok(found) => wrong.push(format!("{} is read as {found:?}", one.name)),
            Err(told) if !says(&told, &one.name, one.words) => {
                wrong.push(format!("{}: {told}: without {}", one.name, one.words));
            }
            Err(told) => wrong
                .extend(speaks_of_another(one, &told).map(|word| format!("{}: {told}: of{word}", one.name))),
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), all.len(), wrong.join("\n"));
}

/// Control: the intact originals of the damaged files are read, and so are odd but valid ones.
#[test]
fn intact_and_odd_calibrations_are_read() {
    let cv = opencv(NAMES);
    let chain = kalibr(
        "radtan",
        ["", &entry("T_cn_cnm1", "[1, 0, 0, -1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]")],
    );
    for (name, bytes) in [
        ("calib.txt", MIDDLEBURY.into()),
        ("comments.txt", format!("# of a rig\n\n  # ndisp=5\n{MIDDLEBURY}").into_bytes()),
        ("sizes-alone.txt", b"width=640\nheight=480\nndisp=64\n".to_vec()),
        ("satellite.txt", b"width=640\nheight=480\ndmin=-21\ndmax=54\n".to_vec()),
        ("opencv.yml", cv.clone().into_bytes()),
        ("no-extension", cv.clone().into_bytes()),
        ("other-entries.yml", format!("{cv}rms: 0.3\nflags: 0\nnote: \"words: more\"\n").into_bytes()),
        (
            "near-names.yml",
            format!("{cv}image_size_l: [1, 1]\nfisheye_flags: 3\ncamera_name: a\nimage_mean: 3\n")
                .into_bytes(),
        ),
        ("same-twice.yml", format!("{cv}cameraMatrix1: [500, 0, 320, 0, 500, 240, 0, 0, 1]\n").into_bytes()),
        ("end-of-document.yml", format!("{cv}...\n").into_bytes()),
        ("size-of-images.xml", b"<opencv_storage><imageSize>640 480</imageSize><P1>500 0 320 0 0 500 240 0 0 0 1 0</P1><P2>500 0 320 -60 0 500 240 0 0 0 1 0</P2></opencv_storage>".to_vec()),
        ("opencv.gz", gzip(cv.as_bytes())),
        ("of-windows.yml", utf16(&cv)),
        ("latin.yml", [cv.as_bytes(), b"# caf\xe9\n"].concat()),
        ("zed.conf", zed("HD", "k1 = 0\n", "").into_bytes()),
        ("driving-stereo.txt", driving_stereo().into_bytes()),
        ("chain.yaml", chain.into_bytes()),
    ] {
        if let Err(told) = read(&[(name, bytes)]) {
            panic!("{told}");
        }
    }
}

/// Names and texts of files, the file that the error names, and its words.
type TooMany<'a> = (&'a [(&'a str, &'a str)], &'a str, &'a str);

#[test]
fn superfluous_files_are_named() {
    let (cv, other) = (opencv(NAMES), opencv(["cameraMatrix1", "D1", "K2", "D2", "R", "T"]));
    let pose = cv.split("R: ").nth(1).map(|rest| format!("R: {rest}")).unwrap();
    let lenses = cv.split("R: ").next().unwrap().to_owned();
    let left = lens("");
    let words = "hello world\n".to_owned();
    let rows: &[TooMany] = &[
        (
            &[("ok.yml", &cv), ("words.txt", &words)],
            "words.txt",
            "is not needed & ok.yml is a whole calibration",
        ),
        (
            &[("words.txt", &words), ("ok.yml", &cv)],
            "words.txt",
            "is not needed & ok.yml is a whole calibration",
        ),
        (
            &[("ok.yml", &cv), ("again.yml", &cv)],
            "again.yml",
            "is not needed & ok.yml is a whole calibration",
        ),
        (
            &[("ok.yml", &cv), ("other.yml", &other)],
            "other.yml",
            "is not needed & ok.yml is a whole calibration",
        ),
        (
            &[("ok.yml", &cv), ("calib.txt", MIDDLEBURY)],
            "ok.yml",
            "is not needed & calib.txt is a whole calibration & Middlebury's",
        ),
        (
            &[("lenses.yml", &lenses), ("pose.yml", &pose), ("words.txt", &words)],
            "words.txt",
            "does not belong to the other files",
        ),
        (
            &[("left.yml", &left), ("right.yml", &left), ("words.txt", &words)],
            "words.txt",
            "does not belong to the other files & neither a lens nor R and T",
        ),
        (&[("left.yml", &left), ("right.yml", &left), ("third.yml", &left)], "third.yml", "is a third lens"),
        (&[("left.yml", &left), ("right.yml", &left)], "right.yml", "no file says how the cameras stand"),
        (
            &[("lenses.yml", &lenses), ("pose.yml", &pose), ("more.yml", &pose)],
            "more.yml",
            "does not belong to the other files",
        ),
        (
            &[("lenses.yml", &lenses), ("pose.yml", &(pose.clone() + "K1: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"))],
            "pose.yml",
            "K1: contradicts K1 in & lenses.yml",
        ),
    ];
    for (files, name, words) in rows {
        let told = read(files).unwrap_err();
        assert!(says(&told, name, words), "{name}: {told}");
    }
    // Control: files that belong together.
    assert!(read(&[("lenses.yml", &lenses), ("pose.yml", &pose)]).is_ok());
    let (paths, folder) = (vec![std::env::temp_dir()], "is a folder; give the calibration that is in it");
    let told = calibration::read(&paths).unwrap_err().to_string();
    assert!(told.lines().count() == 1 && told.contains(folder), "{told}");
}
