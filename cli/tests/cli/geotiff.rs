//! GeoTIFF: every TIFF map has the georeference of its view.

use std::io::Cursor;

use tiff::decoder::Decoder;
use tiff::tags::Tag;

use super::files::{Tiff, Values};
use Values::{Double, Long, Short};

use super::*;

const KEYS: [u16; 8] = [1, 1, 0, 1, 3072, 0, 1, 32_631];

/// Writes a view of a scene as GeoTIFF; `east` is the coordinate of its first pixel.
fn write_view(path: &Path, from: &str, east: f64) {
    let grey = image::open(scene("slanted").join(from)).unwrap().to_luma8();
    let tags = [
        (256, Long(&[grey.width()])),
        (257, Long(&[grey.height()])),
        (258, Short(&[8])),
        (262, Short(&[1])),
        (33_550, Double(&[0.5, 0.5, 0.0])),
        (33_922, Double(&[0.0, 0.0, 0.0, east, 5e6, 0.0])),
        (34_735, Short(&KEYS)),
        (50_844, Double(&polynomials(east))),
    ];
    fs::write(path, Tiff { big_endian: true, tiled: false, tags: &tags, chunks: &[grey.as_raw()] }.bytes())
        .unwrap();
}

/// The rational polynomials of a satellite: 92 numbers, of which the third and fourth are line and sample offsets.
fn polynomials(first: f64) -> [f64; 92] {
    std::array::from_fn(|i| first + i as f64)
}

/// The easting of a map, after checking that all tags are present.
fn east(path: &Path) -> f64 {
    let mut map = Decoder::new(Cursor::new(fs::read(path).unwrap())).unwrap();
    assert_eq!(map.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap(), [0.5, 0.5, 0.0]);
    assert_eq!(map.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap(), KEYS);
    assert_eq!(map.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "nan");
    let east = map.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap()[3];
    assert_eq!(map.get_tag_f64_vec(Tag::Unknown(50_844)).unwrap(), polynomials(east));
    east
}

#[test]
fn maps_have_the_georeference_of_their_views() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    write_view(&at("left.tif"), "im0.png", 4e5);
    write_view(&at("right.tif"), "im1.png", 7e5);
    fs::copy(scene("slanted/calib.txt"), at("calib.txt")).unwrap();
    fs::write(at("list.csv"), "left,right,name\nleft.tif,right.tif,d\n").unwrap();
    let more = "--device cpu --quiet --method fast --also raw,right,depth";
    run(&folder, &format!("match left.tif right.tif d.tif {more}")).succeeded();
    run(&folder, &format!("batch list.csv maps --format tif {more}")).succeeded();
    for (name, expected) in [("d.tif", 4e5), ("d.raw.tif", 4e5), ("d.right.tif", 7e5), ("d.depth.tif", 4e5)] {
        for path in [at(name), at("maps").join(name)] {
            assert!((east(&path) - expected).abs() < 1e-9, "{}", path.display());
        }
    }
    // As a frame of a sequence.
    run(&folder, &format!("sequence lef*.tif righ*.tif frames --format tif --calib calib.txt {more}"))
        .succeeded();
    for name in ["tif", "raw.tif", "right.tif", "depth.tif"] {
        let [frame, map] = [at(&format!("frames/left.{name}")), at(&format!("d.{name}"))];
        assert!(fs::read(&frame).unwrap() == fs::read(map).unwrap(), "{}", frame.display());
    }
    // The same in tiles.
    let tiled =
        "match left.tif right.tif tiled.tif --device cpu --method fast --set match-size=full --memory 12MiB";
    run(&folder, tiled).succeeded().says(" tiles, ");
    assert!((east(&at("tiled.tif")) - 4e5).abs() < 1e-9);
}

/// A cropped map keeps its georeference.
#[test]
fn regions_keep_their_georeference() {
    let folder = Folder::new();
    write_view(&folder.join("left.tif"), "im0.png", 4e5);
    write_view(&folder.join("right.tif"), "im1.png", 7e5);
    let line = "match left.tif right.tif d.tif --roi 40,30,100,50 --max-disparity 31 --device cpu --quiet --also right";
    run(&folder, line).succeeded();
    for (name, east) in [("d.tif", 4e5), ("d.right.tif", 7e5)] {
        let mut map = Decoder::new(Cursor::new(fs::read(folder.join(name)).unwrap())).unwrap();
        assert_eq!(map.dimensions().unwrap(), (100, 50));
        // Pixel (0, 0) of the whole is (-40, -30) of the crop.
        assert_eq!(map.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap(), [-40.0, -30.0, 0.0, east, 5e6, 0.0]);
        let mut expected = polynomials(east);
        expected[2] -= 30.0;
        expected[3] -= 40.0;
        assert_eq!(map.get_tag_f64_vec(Tag::Unknown(50_844)).unwrap(), expected);
    }
}
