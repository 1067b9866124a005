//! Recognizes files that are no readable calibration of a pair by how they begin, and says what to do.

/// Kinds of files by magic bytes: the offset, the bytes, and the name of the kind.
const KINDS: &[(usize, &[u8], &str)] = &[
    (0, b"\x89PNG", "a PNG image"),
    (0, b"\xff\xd8\xff", "a JPEG image"),
    (0, b"II*\0", "a TIFF image"),
    (0, b"MM\0*", "a TIFF image"),
    (0, b"II+\0", "a TIFF image"),
    (0, b"GIF8", "a GIF image"),
    (8, b"WEBP", "a WebP image"),
    (8, b"WAVE", "a sound"),
    (8, b"AVI ", "a film"),
    (4, b"ftyp", "a film or a photograph of a phone"),
    (4, b"jP  ", "a JPEG 2000 image"),
    (0, b"\x76\x2f\x31\x01", "an OpenEXR image"),
    (0, b"PF\n", "a PFM map"),
    (0, b"Pf\n", "a PFM map"),
    (0, b"P5", "a PGM image"),
    (0, b"P6", "a PPM image"),
    (0, b"PIEH", "a map or a camera of MPI Sintel"),
    (0, b"\x1aE\xdf\xa3", "a film"),
    (0, b"ply\n", "a cloud of points (PLY)"),
    (0, b"ply\r", "a cloud of points (PLY)"),
    (0, b"# .PCD", "a cloud of points (PCD)"),
    (0, b"LASF", "a cloud of points (LAS)"),
    (0, b"glTF", "a scene (glTF)"),
    (0, b"%PDF", "a PDF document"),
    (0, b"%!PS", "a PostScript document"),
    (0, b"{\\rtf", "an RTF document"),
    (0, b"\x7fELF", "a program"),
    (0, b"\xca\xfe\xba\xbe", "a program"),
    (0, b"\0asm", "a program"),
    (0, b"SQLite format 3", "a database (SQLite)"),
    (0, b"ID3", "a sound"),
    (0, b"OggS", "a sound or a film"),
    (128, b"DICM", "a DICOM image"),
];

/// [`KINDS`] with a remedy.
const KINDS_WITH_REMEDY: &[(usize, &[u8], &str)] = &[
    (0, b"\x89MCAP", "is a recording; `sequence` matches it by the calibration that is in it"),
    (0, b"#ROSBAG", "is a recording; `sequence` matches it by the calibration that is in it"),
    (257, b"ustar", "is a tar archive; unpack it and give the files of the two cameras that are in it"),
    (0, b"PK\x03\x04", "is a ZIP archive; unpack it and give the calibration that is in it"),
    (0, b"7z\xbc\xaf", "is a 7-Zip archive; unpack it and give the calibration that is in it"),
    (0, b"Rar!", "is a RAR archive; unpack it and give the calibration that is in it"),
    (0, b"BZh", "is packed by bzip2; unpack it"),
    (0, b"\xfd7zXZ", "is packed by xz; unpack it"),
    (0, b"\x28\xb5\x2f\xfd", "is packed by zstd; unpack it"),
    (
        0,
        b"\x93NUMPY",
        "is one array of numpy (.npy); save all in one file, by np.savez(\"stereo.npz\", K1=K1, D1=D1, K2=K2, D2=D2, R=R, T=T)",
    ),
    (0, b"\x80\x02", PICKLE),
    (0, b"\x80\x03", PICKLE),
    (0, b"\x80\x04", PICKLE),
    (0, b"\x80\x05", PICKLE),
    (
        0,
        b"MATLAB ",
        "is a MAT-file of MATLAB, which is not read; stereoParametersToOpenCV gives K1, D1, K2, D2, R and T, to be written as OpenCV has them",
    ),
    (0, b"\x89HDF", "is an HDF5 file, which is not read; write K1, D1, K2, D2, R and T as OpenCV has them"),
    (
        0,
        b"version https://git-lfs",
        "is a pointer of Git LFS in the place of the file; fetch it by git lfs pull",
    ),
];

const PICKLE: &str = "is a pickle of Python, which is not read because it can run programs; save it by np.savez(\"stereo.npz\", K1=K1, \
                      D1=D1, K2=K2, D2=D2, R=R, T=T)";

const COLMAP: &str =
    "export it for COLMAP, and give cameras.txt and images.txt with the two images of the pair";
const OPENCV: &str = "write K1, D1, K2, D2, R and T as OpenCV has them";
const NUMBERS: &str = "give the focal length and the baseline in its place";

/// Kinds of texts: the start, other words in the text, a description and a remedy. Forms that another program exports come first.
const TEXTS: &[(&str, &[&str], &str, &str)] = &[
    ("<<<<<<< ", &[], "has the marks of a merge in it", "resolve the merge"),
    ("<!doctype html", &[], "is a web page", "download the file itself"),
    ("<html", &[], "is a web page", "download the file itself"),
    (
        "<",
        &["<calibration>", "<projection>", "<f>"],
        "is Metashape's calibration of one lens, which does not say how two cameras stand",
        COLMAP,
    ),
    ("<", &["<document", "<chunk"], "is Metashape's of a chunk", COLMAP),
    ("<", &["<exportapero>"], "is MicMac's", OPENCV),
    ("<", &["<blocksexchange"], "is ContextCapture's", COLMAP),
    (
        "<",
        &["<robot "],
        "is a model of a robot (URDF)",
        "give the files that the calibration program has written",
    ),
    (
        "<",
        &["<sdf "],
        "is a model of a simulation (SDF)",
        "give the files that the calibration program has written",
    ),
    ("<", &["<svg"], "is a picture (SVG)", "give a calibration"),
    ("<", &["<x:xmpmeta"], "is of one photograph (XMP)", COLMAP),
    ("<", &["<kml"], "is a map (KML)", "give a calibration"),
    ("<", &["<imagelist"], "is OpenCV's list of images", "give the file that the calibration has written"),
    ("<", &["<images>"], "is OpenCV's list of images", "give the file that the calibration has written"),
    ("<", &["<cascade"], "is OpenCV's detector", "give the file that the calibration has written"),
    ("<", &["<vcgcamera"], "is MeshLab's of one camera", OPENCV),
    ("# bundle file", &[], "is Bundler's, whose lenses have no principal point", COLMAP),
    ("nvm_v3", &[], "is VisualSFM's", COLMAP),
    ("filename imagewidth imageheight", &[], "is Pix4D's of calibrated cameras", OPENCV),
    ("#focal length (mm) assuming", &[], "is Pix4D's of one camera", OPENCV),
    ("pix4d", &[], "is Pix4D's", OPENCV),
    ("frame cameraid k[0,0]", &[], "is Virtual KITTI's, without the baseline", NUMBERS),
    ("frame cameraid r1,1", &[], "is Virtual KITTI's, without the lens", NUMBERS),
    (
        "frame ",
        &["\nl ", "\nr "],
        "is Scene Flow's of the poses of its frames, without the focal length",
        NUMBERS,
    ),
    (
        "intrinsic of ",
        &[],
        "is the list of rs-enumerate-devices",
        "save the calibration table as JSON in the RealSense viewer",
    ),
    (
        "device info",
        &["intrinsic of"],
        "is the list of rs-enumerate-devices",
        "save the calibration table as JSON in the RealSense viewer",
    ),
    ("%", &["fc = [", "cc = ["], "is of the MATLAB toolbox for one camera", OPENCV),
    ("{", &["\"sfm_data_version\""], "is OpenMVG's", COLMAP),
    ("{", &["\"views\"", "\"intrinsics\"", "\"poses\"", "\"version\""], "is Meshroom's", COLMAP),
    ("{", &["\"shots\"", "\"cameras\""], "is OpenSfM's", COLMAP),
    ("[", &["\"shots\"", "\"cameras\""], "is OpenSfM's", COLMAP),
    (
        "{",
        &["\"transform_matrix\"", "\"frames\""],
        "is of the views of a radiance field (transforms.json)",
        COLMAP,
    ),
    ("{", &["\"camera_data_\""], "is Argoverse's of all its cameras", OPENCV),
    ("{", &["\"calibrationinformation\""], "is Azure Kinect's, which has no pair of cameras", OPENCV),
    (
        "{",
        &["\"cameraparameters1\""],
        "is stereoParameters of MATLAB, whose matrices are transposed",
        "convert it with stereoParametersToOpenCV, and write it in a format of OpenCV",
    ),
    ("[", &["\"sensor_token\"", "\"camera_intrinsic\""], "is nuScenes's of all its cameras", OPENCV),
    ("{", &["\"nbformat\""], "is a notebook of Jupyter", "give a calibration"),
    ("{", &["\"featurecollection\""], "is a map (GeoJSON)", "give a calibration"),
];

/// Why a file with these first bytes is no calibration; `None` if it may be one.
pub(super) fn of_bytes(bytes: &[u8]) -> Option<String> {
    let begins = |(offset, magic, _): &&(usize, &[u8], &str)| {
        bytes.get(*offset..).is_some_and(|bytes| bytes.starts_with(magic))
    };
    if let Some((.., what)) = KINDS.iter().find(begins) {
        return Some(format!("is {what}, not a calibration"));
    }
    KINDS_WITH_REMEDY.iter().find(begins).map(|(.., what)| (*what).to_owned())
}

/// Why a text is no calibration, with the remedy; `None` if it may be one.
pub(super) fn of_text(text: &str) -> Option<String> {
    if let Some(found) = of_bytes(text.as_bytes()) {
        return Some(found);
    }
    if text
        .chars()
        .any(|c| c.is_control() && !matches!(c, '\t' | '\n' | '\r' | '\u{c}' | '\u{1a}' | '\u{85}'))
    {
        return Some("holds bytes that are not text, so it is not a calibration of a known form".into());
    }
    if let Some(name) = member_of_dso(text) {
        return Some(format!("is the camera of {name}, which is one; {OPENCV}"));
    }
    let number = |word: &str| word.parse::<f64>().is_ok();
    if text.split([' ', '\t', '\n', '\r', ',', ';']).filter(|word| !word.is_empty()).all(number) {
        return Some(format!("has numbers without names; {OPENCV}"));
    }
    let lower = text.to_lowercase();
    let found = TEXTS
        .iter()
        .find(|(start, rest, ..)| lower.starts_with(start) && rest.iter().all(|word| lower.contains(word)));
    found.map(|(.., what, remedy)| format!("{what}; {remedy}"))
}

/// The program that wrote a text of a lens model and numbers, a size and a word.
fn member_of_dso(text: &str) -> Option<&'static str> {
    let mut lines = text.lines();
    let (first, size, third) = (lines.next()?, lines.next()?, lines.next()?);
    let mut words = first.split_whitespace().peekable();
    if words
        .peek()
        .is_some_and(|word| ["Pinhole", "RadTan", "FOV", "EquiDistant", "KannalaBrandt"].contains(word))
    {
        words.next();
    }
    let numbers = |text: &str| text.split_whitespace().all(|word| word.parse::<f64>().is_ok());
    let count = words.clone().count();
    let is = count >= 5
        && words.all(|word| word.parse::<f64>().is_ok())
        && size.split_whitespace().count() == 2
        && numbers(size)
        && ["crop", "full", "none"].contains(&third.trim());
    is.then_some("DSO")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keywords_of_texts_are_in_lower_case() {
        for (start, rest, ..) in TEXTS {
            assert_eq!(*start, start.to_lowercase());
            assert!(rest.iter().all(|word| *word == word.to_lowercase()), "{rest:?}");
        }
    }
}
