//! GeoTIFF: the georeference of an image is copied into its maps, completely or not at all.

use super::file;
use super::files::{Tiff, Values};
use Values::{Double, Long, Short, Text};
use mrfgs::image::write::Writer;
use mrfgs::image::{Georeference, Pair, Plane, Rect};
use std::io::Cursor;
use std::path::Path;
use tiff::decoder::Decoder;
use tiff::tags::Tag;

const SCALE: [f64; 3] = [0.5, 0.25, 0.0];
const TIEPOINT: [f64; 6] = [0.0, 0.0, 0.0, 399_960.125, 5_000_040.875, 0.0];
const TRANSFORMATION: [f64; 16] = [
    0.5, 0.1, 0.0, 4e5, //
    0.1, -0.5, 0.0, 5e6, //
    0.0, 0.0, 0.0, 0.0, //
    0.0, 0.0, 0.0, 1.0,
];
const KEYS: [u16; 16] = [1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 1026, 34_737, 9, 0];
const DOUBLES: [f64; 2] = [6_378_137.0, 298.257_223_563];
const NAME: &str = "WGS 84 /|";

/// Rational polynomial coefficients; the third and fourth values are the line and sample offsets.
const POLYNOMIALS: [f64; 92] = [7.25; 92];

/// All GeoTIFF tags, and the RPC tag of satellite images.
const ALL: [(u16, Values); 7] = [
    (33_550, Double(&SCALE)),
    (33_922, Double(&TIEPOINT)),
    (34_264, Double(&TRANSFORMATION)),
    (34_735, Short(&KEYS)),
    (34_736, Double(&DOUBLES)),
    (34_737, Text(NAME)),
    (50_844, Double(&POLYNOMIALS)),
];

/// A file of 2 x 1 grey pixels with these tags.
fn image(tags: &[(u16, Values)], big_endian: bool) -> Vec<u8> {
    let usual = [(256, Long(&[2])), (257, Long(&[1])), (258, Short(&[8])), (262, Short(&[1]))];
    Tiff { big_endian, tiled: false, tags: &[&usual[..], tags].concat(), chunks: &[&[3, 4]] }.bytes()
}

fn pair(left: &[u8], right: &[u8]) -> Pair {
    let ((_left, left), (_right, right)) = (file(left), file(right));
    Pair::open(left, right).unwrap()
}

fn georeference(bytes: &[u8]) -> Option<Georeference> {
    let [left, _] = pair(bytes, bytes).georeferences();
    left
}

/// A map with this georeference, opened with another decoder.
fn map(width: usize, georeference: Option<Georeference>) -> Decoder<Cursor<Vec<u8>>> {
    let map = Plane::filled(width, 1024, 1.0);
    let bytes = Writer { georeference }.encode_disparity(Path::new("a.tif"), &map).unwrap();
    Decoder::new(Cursor::new(bytes)).unwrap()
}

fn doubles(map: &mut Decoder<Cursor<Vec<u8>>>, tag: Tag) -> Vec<f64> {
    map.get_tag_f64_vec(tag).unwrap()
}

#[test]
fn all_tags_are_copied() {
    // A small plain file, and a large one in compressed tiles.
    for (big_endian, width) in [(false, 2), (true, 2), (false, 5000)] {
        let map = &mut map(width, georeference(&image(&ALL, big_endian)));
        assert_eq!(map.find_tag(Tag::TileWidth).unwrap().is_some(), width == 5000);
        assert_eq!(doubles(map, Tag::ModelPixelScaleTag), SCALE, "big endian: {big_endian}");
        assert_eq!(doubles(map, Tag::ModelTiepointTag), TIEPOINT);
        assert_eq!(doubles(map, Tag::ModelTransformationTag), TRANSFORMATION);
        assert_eq!(map.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap(), KEYS);
        assert_eq!(doubles(map, Tag::GeoDoubleParamsTag), DOUBLES);
        assert_eq!(map.get_tag_ascii_string(Tag::GeoAsciiParamsTag).unwrap(), NAME);
        assert_eq!(doubles(map, Tag::Unknown(50_844)), POLYNOMIALS);
        assert_eq!(map.get_tag_ascii_string(Tag::GdalNodata).unwrap(), "nan");
    }
    let map = &mut map(2, georeference(&image(&ALL[..2], false)));
    assert_eq!(doubles(map, Tag::ModelPixelScaleTag), SCALE);
    assert!(map.find_tag(Tag::GeoKeyDirectoryTag).unwrap().is_none(), "there was none");
}

#[test]
fn each_view_has_its_own_georeference() {
    let (bare, one, other) = (image(&[], false), image(&ALL[..2], false), image(&ALL[2..], false));
    let both = pair(&one, &other);
    assert_eq!(both.georeferences(), [georeference(&one), georeference(&other)]);
    assert_ne!(georeference(&one), georeference(&other));
    assert_eq!(pair(&bare, &one).georeferences(), [None, georeference(&one)]);
    // Mirroring drops the georeference; cropping moves its origin to the first pixel of the crop.
    assert_eq!(both.mirrored().georeferences(), [None, None]);
    let [one, other] = both.crop(&Rect { x: 1..2, y: 0..1 }).georeferences();
    let mut tiepoint = TIEPOINT;
    tiepoint[0] = -1.0;
    assert_eq!(doubles(&mut map(1, one), Tag::ModelTiepointTag), tiepoint);
    let other = &mut map(1, other);
    let mut transformation = TRANSFORMATION;
    (transformation[3], transformation[7]) = (4e5 + 0.5, 5e6 + 0.1);
    assert_eq!(doubles(other, Tag::ModelTransformationTag), transformation);
    let mut polynomials = POLYNOMIALS;
    polynomials[3] -= 1.0;
    assert_eq!(doubles(other, Tag::Unknown(50_844)), polynomials);
    assert_eq!(map(2, None).find_tag(Tag::ModelPixelScaleTag).unwrap(), None);
}

/// An incomplete georeference would place the image wrongly.
#[test]
fn a_damaged_georeference_is_dropped() {
    let with = |tag, values| {
        let mut tags = ALL.to_vec();
        tags.retain(|(other, _)| *other != tag);
        tags.push((tag, values));
        image(&tags, false)
    };
    let many = vec![0.0; 1 << 17];
    assert!(georeference(&with(33_922, Double(&many))).is_some());
    let more = vec![0.0; (1 << 17) + 1];
    for (tag, values) in [
        (33_922, Double(&more)),
        (33_550, Long(&[1, 1, 0])),
        (33_550, Text("0.5 0.5")),
        (34_264, Double(&[])),
        (34_735, Double(&[1.0, 1.0, 0.0, 0.0])),
        (34_735, Short(&[])),
        (34_737, Short(&[87, 71, 83])),
    ] {
        assert_eq!(georeference(&with(tag, values)), None, "{tag}");
    }
    // Counts that put the values past the end of the file.
    for (tag, _) in ALL {
        let mut bytes = image(&ALL, false);
        let entry = bytes.windows(2).rposition(|two| two == tag.to_le_bytes()).unwrap();
        for count in [0x1000, u32::MAX] {
            bytes[entry + 4..entry + 8].copy_from_slice(&count.to_le_bytes());
            assert_eq!(georeference(&bytes), None, "{tag}, {count}");
        }
    }
}
