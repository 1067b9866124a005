//! Failures: each prints one line and leaves nothing behind.

use super::*;

/// Arguments, exit status, and words that the message must contain, joined by ` & `.
type Failure = (&'static str, i32, &'static str);

const TOO_MANY: &str = "240 x 180 & at most 43199 & raise --max-pixels";

/// `M` stands for a `match` that would succeed, up to its output; `I` for such an `inspect`; `P` for a `match` to out.pfm up to its range;
/// `R` for a `match` of raw images.
const FAILURES: &[Failure] = &[
    // The command line.
    ("", 2, "command & match, rectify, depth, view, sequence, ros, batch & --help"),
    ("frobnicate", 2, "frobnicate & --help"),
    ("match left.png", 2, "RIGHT & missing & left.png holds one view"),
    ("completions", 2, "<SHELL> & mrfgs completions --help"),
    ("completions tcsh", 2, "tcsh & bash & zsh"),
    ("man none/man1", 1, "none/man1 & parent folder does not exist & create that first"),
    ("man left.png", 1, "left.png"),
    ("M out.pfm --frobnicate", 2, "--frobnicate & --help"),
    ("M out.pfm --mask", 2, "--mask & value"),
    ("M out.pfm surplus.pfm", 2, "surplus.pfm & --help"),
    // Inputs.
    ("match none.png right.png out.pfm", 1, "none.png & no such file & check the name"),
    ("match left.png none.png out.pfm --max-disparity 9", 1, "none.png & no such file & check the name"),
    ("match folder right.png out.pfm --max-disparity 9", 1, "folder: is a folder & give the image file"),
    ("match left.png folder out.pfm --max-disparity 9", 1, "folder: is a folder & give the image file"),
    ("match left.png narrow.png out.pfm --max-disparity 9", 1, "left.png is 60 x 40 & narrow.png is 30 x 40"),
    ("match cut.png right.png out.pfm --max-disparity 9", 1, "cut.png & truncated & get the file again"),
    (
        "match flipped.png right.png out.pfm --max-disparity 9",
        1,
        "flipped.png & CRC error & while decoding IDAT chunk",
    ),
    ("M out.pfm --no-data none", 2, "--no-data & none"),
    ("match left.png empty.png out.pfm --max-disparity 9", 1, "empty.png & empty & get it again"),
    ("match text.png right.png out.pfm --max-disparity 9", 1, "text.png & not an image & give PNG"),
    (
        "match a.gif right.png out.pfm --max-disparity 9",
        1,
        "a.gif & is a GIF image, which is not supported: convert it to PNG",
    ),
    ("match left.png a.jpg out.pfm --max-disparity 9", 1, "a.jpg & ends too early & get the file again"),
    ("match left.png a.pgm out.pfm --max-disparity 9", 1, "a.pgm & truncated & get the file again"),
    ("match left.png a.pfm out.pfm --max-disparity 9", 1, "a.pfm & the scale & no number other than 0"),
    ("match left.png a.tif out.pfm --max-disparity 9", 1, "a.tif & get the file again"),
    (
        "match left.png palette.tif out.pfm --max-disparity 9",
        1,
        "palette.tif & the TIFF palette is missing & convert it to PNG",
    ),
    ("match left.png unknown.pfm out.pfm --max-disparity 9", 1, "unknown.pfm is 1 x 1 & the same size"),
    (
        "match unknown.pfm dot.png out.pfm --max-disparity 0",
        1,
        "unknown.pfm holds floats & dot.png holds whole numbers & the same format",
    ),
    ("M out.pfm --mask narrow.png", 1, "narrow.png is 30 x 40 & a mask must have the size of the left image"),
    ("M out.pfm --mask none.png", 1, "none.png & check the name"),
    ("M out.pfm --mask text.png", 1, "text.png & give PNG"),
    // Outputs.
    ("M out.jpg", 2, "out.jpg & .pfm (float), .tif (float) or .png"),
    ("M out", 2, "out: & .pfm"),
    ("M none/out.pfm", 1, "none/out.pfm & there is no folder none & create it"),
    ("M left.png/out.pfm", 1, "left.png/out.pfm & left.png is a file, not a folder & give another name"),
    ("M left.png/a/out.pfm", 1, "left.png/a/out.pfm & left.png is a file, not a folder"),
    ("I left.png/steps", 1, "left.png/steps & left.png is a file, not a folder"),
    ("M out.pfm/", 2, "out.pfm/ & names no file"),
    ("M taken.pfm", 1, "taken.pfm & is a folder & name of a file"),
    ("M taken.tif --also raw", 1, "taken.raw.tif & is a folder"),
    ("M taken.tif --also confidence,validity", 1, "taken.validity.png & is a folder"),
    ("M out.pfm --also", 2, "--also & raw, right, depth, depth-mm, depth-registered & side-by-side"),
    ("M out.pfm --also raw,row", 2, "--also & 'row' & raw, right, depth, depth-mm, depth-registered"),
    ("M none/out.pfm --also preview", 1, "none/out.pfm & create it"),
    ("M out.png --min-disparity -1", 2, "out.png & -1 to 9 & .pfm or .tif"),
    ("match left.png right.png out.png --max-disparity 256", 2, "out.png & 0 to 256 & .pfm or .tif"),
    ("M out.pfm --json out.pfm", 2, "--json & out.pfm is already OUTPUT & another name"),
    ("M out.pfm --json ./folder/../out.pfm", 2, "--json & OUTPUT & another name"),
    (
        "M out.pfm --also raw,validity --json ./out.validity.png",
        2,
        "--json & out.validity.png is already --also validity & another name",
    ),
    ("M left.png", 2, "OUTPUT & left.png is already LEFT & another name"),
    ("M folder/../right.png", 2, "OUTPUT & is already RIGHT & another name"),
    (
        "match left.png view.preview.png folder/../view.pfm --max-disparity 9 --also preview",
        2,
        "--also preview & view.preview.png is already RIGHT & another name",
    ),
    ("M narrow.png --mask left.png --json left.png", 2, "--json & LEFT & another name"),
    ("M out.pfm --json none/a.json", 1, "none/a.json & create it"),
    ("M out.pfm --json folder", 1, "folder & is a folder"),
    ("M out.pfm --json right.png", 2, "--json & right.png is already RIGHT & another name"),
    ("M - --json -", 2, "--json & - is already OUTPUT & another name"),
    ("M - --also raw", 2, "--also raw & beside OUTPUT & give a file as OUTPUT"),
    ("M out.pfm --colours grey", 2, "--colours & add --also preview"),
    ("M out.pfm --also validity --colours grey", 2, "--colours & add --also preview"),
    ("M out.pfm --also preview --colours jet", 2, "--colours & 'jet' & turbo, viridis, grey"),
    // Cameras.
    ("M out.pfm --also depth", 2, "--also depth & no calib.txt beside left.png & --calib"),
    ("M out.pfm --also points", 2, "--also points & no calib.txt beside left.png & --calib"),
    (
        "match silent/left.png right.png out.pfm --max-disparity 9 --also depth",
        1,
        "silent/calib.txt & lacks cam0 and doffs and baseline & cam0=[f 0 cx; 0 f cy; 0 0 1]",
    ),
    ("M out.pfm --calib half/calib.txt --also points", 1, "half/calib.txt & lacks doffs and baseline"),
    ("M out.pfm --calib zero/calib.txt --also depth", 1, "zero/calib.txt & baseline=0 is not above 0"),
    (
        "M out.pfm --calib larger/calib.txt --also depth",
        1,
        "larger/calib.txt is for images of 120 x 90 & left.png is 60 x 40 & --calib-crop",
    ),
    ("M out.pfm --calib none.txt", 1, "none.txt & no such file & check the name"),
    ("M out.pfm --calib damaged/calib.txt", 1, "damaged/calib.txt & line 1 & ndisp"),
    (
        "M out.pfm --calib camera/calib.txt --json camera/calib.txt",
        2,
        "--json & the calibration file & another name",
    ),
    // The range.
    ("match flat.png flat.png out.pfm", 1, "no range of disparities found & all one colour"),
    (
        "match flat.png flat.png out.pfm --max-disparity auto",
        1,
        "no range of disparities found & all one colour",
    ),
    ("M out.pfm --memory 2", 2, "--memory <SIZE> & '2' & 2GiB & --help"),
    ("M out.pfm --memory 1.5GiB", 2, "--memory <SIZE> & '1.5GiB' & whole number"),
    ("M out.pfm --memory 0MiB", 2, "--memory <SIZE> & from 1MiB to 16TiB"),
    ("M out.pfm --memory 17TiB", 2, "--memory <SIZE> & from 1MiB to 16TiB"),
    ("M out.pfm --memory 99999999999999999999TiB", 2, "--memory <SIZE> & from 1MiB to 16TiB"),
    ("M out.pfm --set memory=0", 2, "--set memory & 0 is outside 1 to 16777216"),
    ("P --max-disparity 900 --memory 1MiB", 2, "--memory & 1 MiB & 60 x 40 & at least & smaller"),
    // Inspection.
    ("inspect left.png", 2, "RIGHT & missing & left.png holds one view"),
    ("I folder/full", 1, "folder/full & not empty"),
    ("I left.png", 1, "left.png & is a file"),
    ("I none/steps", 1, "none/steps & no folder none & create it"),
    ("I steps --json steps", 2, "--json & steps is already DIR & another name"),
    ("I taken.pfm --json taken.pfm/a.json", 2, "--json & folder of DIR & another path"),
    ("I steps --json left.png", 2, "--json & left.png is already LEFT & another name"),
    ("I steps --quiet", 2, "--quiet & mrfgs inspect --help"),
    ("match damaged/left.png right.png out.pfm", 1, "calib.txt & line 1 & ndisp"),
    ("match huge/left.png right.png out.pfm", 1, "calib.txt & ndisp=100000 & at most 16384"),
    ("M out.pfm --max-disparity 9", 2, "--max-disparity & multiple times"),
    ("P --max-disparity many", 2, "many & --max-disparity & whole number"),
    ("P --max-disparity 3.5", 2, "3.5 & --max-disparity & whole number"),
    ("P --max-disparity 99999999999", 2, "--max-disparity & 1048576"),
    ("P --max-disparity 2000000", 2, "--max-disparity & 1048576 of 0"),
    ("P --max-disparity 50000", 2, "--max-disparity & narrow the range"),
    ("P --max-disparity -1", 2, "--max-disparity & -1 & --min-disparity"),
    ("M out.pfm --min-disparity 10", 2, "--max-disparity & below the minimum disparity 10 & raise it"),
    ("M out.pfm --min-disparity -2000000", 2, "--min-disparity & 1048576 of 0"),
    ("M out.pfm --min-disparity few", 2, "few & --min-disparity & whole number"),
    ("P --min-disparity 60 --max-disparity 70", 2, "--max-disparity & 60 to 70 & 60 pixels wide"),
    // The method.
    ("M out.pfm --method best", 2, "--method & `best` & default, accurate, fast & paper, fgs & TOML file"),
    ("M out.pfm --method none/best.toml", 1, "none/best.toml & no such file"),
    ("M out.pfm --method value.toml --method paper", 1, "value.toml & line 3"),
    ("M out.pfm --method default --method paper", 2, "--method & paper would override & put it first"),
    ("M out.pfm --set colour=red", 2, "--set colour & no such key & mrfgs presets"),
    ("M out.pfm --set levels", 2, "--set & levels=4"),
    ("M out.pfm --set =4", 2, "--set & levels=4"),
    ("M out.pfm --set levels=many", 2, "--set levels & 1 to 16 & \"many\""),
    ("M out.pfm --set levels=17", 2, "--set levels & 17 is outside 1 to 16"),
    ("M out.pfm --set matching=ncc", 2, "--set matching & sad & ad-census & ncc"),
    ("M out.pfm --set schedule=2", 2, "--set schedule & is a group & order, iterations"),
    ("M out.pfm --set graph.sad-window=7", 2, "--set graph.sad-window & it is `cost.sad-window`"),
    ("M out.pfm --set temperature=nan", 2, "--set temperature & outside"),
    ("M out.pfm --set sad-window=4", 2, "--set sad-window & odd & 3 or 5"),
    ("M out.pfm --method none.toml", 1, "none.toml & no such file & check the name"),
    ("M out.pfm --method folder", 1, "folder"),
    ("M out.pfm --method syntax.toml", 1, "syntax.toml & line 2"),
    ("M out.pfm --method key.toml", 1, "key.toml & line 2 & level & mrfgs presets"),
    ("M out.pfm --method value.toml", 1, "value.toml & line 3 & temperature & -1 is outside"),
    ("M out.pfm --method left.png", 1, "left.png & TOML"),
    // Raw images.
    ("R --rectify --also preview,depth", 2, "--also depth & no scale & --calib"),
    ("R --rectify --also points-original.las", 2, "--also points-original.las & no scale & --calib"),
    ("R --rectify --calib @raw/cameras.yml --orient", 2, "--orient & as stored & remove"),
    (
        "match flat.png flat.png out.pfm --rectify",
        1,
        "flat.png, flat.png & 0 of 0 matches agree & the same scene & --calib",
    ),
    ("R --calib @raw/cameras.yml --alpha 1", 2, "--alpha & --rectify"),
    ("R --rectify --calib @raw/cameras.yml --alpha 2", 2, "--alpha & from 0 to 1"),
    (
        "R --calib @raw/cameras.yml --also points-original.las",
        2,
        "--also points-original.las & add --rectify & use --also points",
    ),
    ("batch list.csv maps --also points-original", 2, "--also points-original: & use --also points"),
    ("R --calib @raw/cameras.yml --also depth", 1, "not rectified & --rectify"),
    (
        "R --rectify --calib no-unit.yml --max-disparity 40 --also depth-mm",
        2,
        "--also depth-mm & no-unit.yml & mm, cm or m",
    ),
    ("M out.pfm --also depth --focal 700", 2, "--baseline"),
    ("M out.pfm --also depth --baseline 12cm", 2, "--focal"),
    (
        "M out.pfm --also depth --focal 700 --baseline 12cm --calib c.txt",
        2,
        "--focal & cannot be used with & --calib",
    ),
    (
        "R --rectify --calib @raw/cameras.yml --focal 700 --baseline 12cm",
        2,
        "--focal & cannot be used with & --calib",
    ),
    ("R --rectify --focal 700 --baseline 12cm", 2, "--focal & no scale & --calib"),
    ("M out.pfm --focal 700 --baseline 12cm", 2, "--focal & add --also depth"),
    ("M out.pfm --also depth-mm --focal 700 --baseline 120", 2, "--also depth-mm & unit & --baseline 120mm"),
    ("M out.pfm --also depth --focal -7 --baseline 12cm", 2, "--focal & above 0"),
    ("M out.pfm --also depth --focal 700 --baseline 12in", 2, "--baseline & 12in & such as 120mm"),
    ("rectify left.png flat.png out", 1, "left.png, flat.png & agree on how the camera moved & --calib"),
    ("rectify @raw/left.png @mixed/im1.png out", 1, "240 x 180 & 320 x 240"),
    ("rectify @raw/left.png @wall/im1.png out", 1, "wall/im1.png & agree on how the camera moved & --calib"),
    ("rectify @raw/left.png @raw/left.png out", 1, "left.png & no depth & step to the side"),
    ("rectify @raw/left.png @raw/right.png out --alpha 2", 2, "--alpha & from 0 to 1"),
    ("rectify @raw/left.png @raw/right.png out --calib @raw/cameras.yml --orient", 2, "--orient & remove"),
    ("rectify @raw/left.png @raw/right.png @raw/left.png --calib @raw/cameras.yml", 1, "is a file"),
    // Clouds.
    ("M out.pfm --also points.xyz", 2, "--also & points.xyz & points"),
    ("M out.pfm --also points.ply.las", 2, "--also & points.ply.las & points"),
    ("M out.pfm --also depth.las", 2, "--also & depth.las & points"),
    ("M out.pfm --also points.", 2, "--also & points."),
    // The number of pixels.
    ("M out.pfm --max-pixels 2399", 1, "left.png & 60 x 40 & 2399"),
    ("M out.pfm --max-pixels 0", 2, "--max-pixels & 0 is not in 1.."),
    ("M out.pfm --max-pixels -1", 2, "--max-pixels & -1"),
    ("M out.pfm --max-pixels 10M", 2, "--max-pixels & 10M"),
    ("M out.pfm --max-pixels 1e6", 2, "--max-pixels & 1e6"),
    ("evaluate @slanted --max-pixels 43199", 1, TOO_MANY),
    ("evaluate map @slanted/disp0GT.pfm --truth @slanted/disp0GT.pfm --max-pixels 43199", 1, TOO_MANY),
    ("bench @slanted --repeats 1 --device cpu --max-pixels 43199", 1, TOO_MANY),
    // Where it runs.
    ("M out.pfm --threads 0", 2, "--threads & 1..=1024"),
    ("M out.pfm --threads -1", 2, "-1"),
    ("M out.pfm --threads 1000000", 2, "--threads & 1..=1024"),
    ("M out.pfm --threads two", 2, "--threads & two"),
    ("M out.pfm --device cpu --device 0", 2, "--device & multiple times"),
    ("M out.pfm --threads 2 --backend cpu", 2, "--backend & mrfgs match --help"),
    // Evaluation.
    ("evaluate", 2, "DIR & mrfgs evaluate --help"),
    ("evaluate none", 1, "none/im0.png & disp0GT.pfm, calib.txt"),
    ("evaluate left.png", 1, "left.png/im0.png & a folder to evaluate must contain"),
    ("evaluate without-im0.png", 1, "without-im0.png/im0.png & a folder to evaluate must contain"),
    ("evaluate without-im1.png", 1, "without-im1.png/im1.png & a folder to evaluate must contain"),
    (
        "evaluate without-disp0GT.pfm",
        1,
        "without-disp0GT.pfm/disp0GT.pfm & a folder to evaluate must contain",
    ),
    ("evaluate without-calib.txt", 1, "without-calib.txt/calib.txt & a folder to evaluate must contain"),
    ("evaluate misfit without-calib.txt", 1, "without-calib.txt/calib.txt"),
    ("evaluate misfit", 1, "disp0GT.pfm is 240 x 180 & im0.png is 60 x 40"),
    ("evaluate misfit --method best", 2, "--method & default, accurate, fast"),
    ("evaluate misfit --json none/a.json", 1, "none/a.json & create it"),
    ("evaluate misfit --json folder", 1, "folder & is a folder"),
    ("evaluate misfit --json misfit/calib.txt", 2, "--json & misfit/calib.txt & another name"),
    ("evaluate submission subs", 2, "<METHOD> <PAIR>... & mrfgs evaluate submission --help"),
    ("evaluate submission subs a.b misfit", 2, "METHOD & a.b & letters, digits"),
    ("evaluate submission subs X_s misfit", 2, "METHOD & X_s & sparse & another name"),
    ("evaluate submission none/subs X misfit", 1, "none/subs & create it"),
    ("evaluate submission folder/full X misfit", 1, "folder/full & not empty"),
    ("evaluate submission subs X misfit ./misfit", 2, "two pairs are called misfit & rename"),
    ("evaluate submission subs X misfit --report subs", 2, "--report & mrfgs evaluate submission --help"),
    (
        "evaluate submission taken.png X misfit --json taken.png/a.json",
        2,
        "--json & folder of DIR & another path",
    ),
    ("evaluate map unknown.pfm", 2, "--truth & mrfgs evaluate map --help"),
    ("evaluate map --truth unknown.pfm", 2, "<MAP> & mrfgs evaluate map --help"),
    ("evaluate misfit --truth unknown.pfm", 2, "--truth & mrfgs evaluate --help"),
    ("evaluate map unknown.pfm misfit --truth unknown.pfm", 2, "misfit & mrfgs evaluate map --help"),
    ("evaluate --levels 3 map unknown.pfm --truth unknown.pfm", 2, "--levels"),
    ("evaluate map unknown.pfm --truth unknown.pfm --method paper", 2, "--method & mrfgs evaluate map"),
    ("evaluate --breakdown map unknown.pfm", 2, "map & right after `evaluate` & before all flags"),
    ("evaluate map none.pfm --truth unknown.pfm", 1, "none.pfm & check the name"),
    ("evaluate map left.png --truth unknown.pfm", 1, "left.png & channel & 16-bit .png"),
    ("evaluate map unknown.pfm --truth unknown.pfm", 1, "unknown.pfm & no known disparity"),
    ("evaluate map unknown.pfm --truth misfit/disp0GT.pfm", 1, "240 x 180 & unknown.pfm is 1 x 1"),
    (
        "evaluate map misfit/disp0GT.pfm --truth misfit/disp0GT.pfm --mask left.png",
        1,
        "left.png is 60 x 40 & 240 x 180",
    ),
    (
        "evaluate map misfit/disp0GT.pfm --truth misfit/disp0GT.pfm --json misfit/disp0GT.pfm",
        2,
        "--json & misfit/disp0GT.pfm is already an input & another name",
    ),
    // Batches.
    ("batch", 2, "<LIST> <OUTDIR> & mrfgs batch --help"),
    ("batch none.csv out", 1, "none.csv & no such file & check the name"),
    ("batch left.png out", 1, "left.png & UTF-8 & CSV"),
    ("batch empty.png out", 1, "empty.png & contains no pairs & CSV"),
    ("batch folder/full out", 1, "folder/full & contains no pairs"),
    ("batch pairs.csv none/out", 1, "none/out & there is no folder none & create it"),
    ("batch pairs.csv left.png", 1, "left.png & is a file & folder"),
    ("batch pairs.csv .", 2, "./left.png & is an input & another folder"),
    ("batch . zero", 2, "zero & the folder of the pairs & give another"),
    ("batch pairs.csv out --shard 0/3", 2, "--shard & '0/3' & K/N & --help"),
    ("batch pairs.csv out --shard 4/3", 2, "--shard & K from 1 to N"),
    ("batch pairs.csv out --shard 2", 2, "--shard & 2/8"),
    ("batch pairs.csv out --format jpg", 2, "--format & pfm, tif, png"),
    ("batch pairs.csv out --method best", 2, "--method & default, accurate, fast"),
    ("batch pairs.csv out --set levels=17", 2, "--set levels & 17 is outside 1 to 16"),
    ("batch pairs.csv out --device cpu --device 0", 2, "--device & multiple times"),
    (
        "batch pairs.csv out --also raw,row",
        2,
        "--also & 'row' & raw, right, depth, depth-mm, depth-registered",
    ),
    ("batch pairs.csv out --colours grey", 2, "--colours & add --also preview"),
    // Benches.
    ("bench none", 1, "none/im0.png & a folder to match must contain im0.png, im1.png, calib.txt; or"),
    ("bench left.png", 1, "left.png/im0.png & a folder to match must contain"),
    ("bench misfit without-im1.png", 1, "without-im1.png/im1.png & a folder to match must contain im0.png"),
    ("bench misfit without-calib.txt", 1, "without-calib.txt/calib.txt & a folder to match must contain"),
    ("bench broken --device cpu", 1, "broken/im1.png & not an image & give PNG"),
    ("bench broken --device cpu --method fgs --json a.json", 1, "broken/im1.png & not an image"),
    ("bench misfit --repeats 0", 2, "--repeats & 1..=1000"),
    ("bench misfit --repeats some", 2, "--repeats & some"),
    ("bench misfit --large", 2, "--large & DIR"),
    ("bench misfit --device", 2, "--device & value"),
    ("bench misfit --device cpu --threads 0", 2, "--threads & 1..=1024"),
    ("bench misfit --method best", 2, "--method & default, accurate, fast"),
    ("bench misfit --set levels=17", 2, "--set levels & 17 is outside 1 to 16"),
    ("bench misfit --method key.toml", 1, "key.toml & line 2 & mrfgs presets"),
    ("bench misfit --json none/a.json", 1, "none/a.json & create it"),
    ("bench misfit --json folder", 1, "folder & is a folder"),
    ("bench misfit --json misfit/im1.png", 2, "--json & misfit/im1.png & another name"),
    ("presets best", 2, "`best` & default, accurate, fast"),
];

#[test]
fn every_failure_is_one_line_and_leaves_nothing() {
    let folder = workshop();
    let before = listing(&folder);
    let mut other = Vec::new();
    for (line, code, words) in FAILURES {
        let (first, rest) = line.split_once(' ').unwrap_or((line, ""));
        let first = match first {
            "M" => "match left.png right.png --max-disparity 9",
            "I" => "inspect left.png right.png --max-disparity 9",
            "P" => "match left.png right.png out.pfm",
            "R" => "match @raw/left.png @raw/right.png out.pfm",
            first => first,
        };
        let told = run(&folder, &format!("{first} {rest}"));
        if told.code != Some(*code) {
            other.push((*line, told));
            continue;
        }
        told.failed(*code, words);
        let said = &told.stderr;
        assert!(!said.contains("{ ") && !said.contains("Some("), "Rust's debug format: {said}");
        assert!(listing(&folder) == before, "{line}: the folder has changed");
    }
    assert!(other.is_empty(), "another exit status: {other:#?}");
}

/// Invalid file names are refused before anything runs: a match would print its summary first.
#[cfg(target_os = "linux")]
#[test]
fn invalid_names_are_refused_at_once() {
    let folder = workshop();
    let before = listing(&folder);
    let (long, nearly) = ("n".repeat(252), "n".repeat(251));
    std::os::unix::fs::symlink("circle.pfm", folder.join("circle.pfm")).unwrap();
    let matched = "match left.png right.png";
    for (line, words) in [
        (format!("{matched} {long}.pfm --max-disparity 9"), "cannot write nnn & File name too long"),
        (
            format!("{matched} {nearly}.pfm --max-disparity 9 --also validity"),
            "validity.png: File name too long",
        ),
        (format!("{matched} out.pfm --max-disparity 9 --json {long}.json"), ".json: File name too long"),
        (
            format!("{matched} circle.pfm --max-disparity 9"),
            "cannot write circle.pfm: & links lead in a circle",
        ),
        (format!("inspect left.png right.png {nearly} --max-disparity 9"), "File name too long"),
        (format!("inspect left.png right.png {long}nnnn --max-disparity 9"), "File name too long"),
        (
            format!("rectify @raw/left.png @raw/right.png {long}nnnn --calib @raw/cameras.yml"),
            "File name too long",
        ),
        (format!("sequence lef*.png righ*.png {long}.mcap --max-disparity 9"), "File name too long"),
        (format!("sequence lef*.png righ*.png {long}.y4m --max-disparity 9"), "File name too long"),
        (format!("sequence lef*.png righ*.png {long}nnnn --max-disparity 9"), "File name too long"),
        (format!("batch pairs.csv {long}nnnn"), "File name too long"),
        (format!("demo {long}nnnn"), "File name too long"),
        (format!("match {long}nnnn right.png out.pfm"), "File name too long"),
        ("match left.png/a right.png out.pfm".to_owned(), "left.png/a: Not a directory"),
    ] {
        let told = run(&folder, &line);
        told.failed(1, words);
        assert!(!told.stderr.contains("os error"), "{told:?}");
        let _ = fs::remove_file(folder.join("circle.pfm"));
        assert!(listing(&folder) == before, "{line}");
        std::os::unix::fs::symlink("circle.pfm", folder.join("circle.pfm")).unwrap();
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_without_permission_is_named() {
    let folder = workshop();
    let locked = locked(&folder);
    let output = &*format!("{locked}/out.pfm");
    for [map, json] in [[output, "a.json"], ["out.pfm", output]] {
        let line = format!("match left.png right.png {map} --json {json} --max-disparity 9");
        run(&folder, &line).failed(1, &format!("{output} & no file can be created"));
        assert!(!folder.join("out.pfm").exists());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn what_was_written_before_a_failure_is_removed() {
    let folder = workshop();
    let before = listing(&folder);
    let line = "match left.png right.png out.pfm --calib camera/calib.txt --quiet --json out.json";
    let also = "--also raw,depth,points,confidence,validity,preview,side-by-side";
    for end in
        ["raw.pfm", "depth.pfm", "points.ply", "validity.png", "preview.png", "side-by-side.png", "json"]
    {
        // The device that is always full can be opened.
        let name = format!("out.{end}");
        let link = folder.join(&name);
        std::os::unix::fs::symlink("/dev/full", &link).unwrap();
        run(&folder, &format!("{line} {also}")).failed(1, &format!("{name} & No space left"));
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink(), "{end}");
        fs::remove_file(link).unwrap();
        assert!(listing(&folder) == before, "{end}");
    }
    let told = run(&folder, "inspect left.png right.png steps --max-disparity 9 --json /dev/full");
    assert_eq!(told.code, Some(1), "{told:?}");
    told.says("/dev/full: No space left");
    assert!(listing(&folder) == before, "inspect");
    assert!(Path::new("/dev/full").exists());
}

#[cfg(not(target_os = "macos"))]
#[test]
fn without_a_driver_gpu_says_what_to_do() {
    let folder = workshop();
    let before = listing(&folder);
    for line in [
        "match left.png right.png out.pfm --max-disparity 9 --device gpu",
        "match left.png right.png out.pfm --max-disparity 9 --device 0",
        "bench misfit --json a.json --device gpu",
        "bench misfit --json a.json --device cpu --device gpu",
    ] {
        run_with(&folder, line, NO_DRIVER).failed(1, "driver & install & --device cpu");
    }
    assert!(listing(&folder) == before);
}

#[test]
fn an_unknown_device_is_named() {
    let folder = workshop();
    let before = listing(&folder);
    for device in ["no-such-device", "999", "tpu"] {
        let words = format!("--device & {device} & mrfgs devices");
        if has_gpu() {
            run(&folder, &format!("bench misfit --device {device} --json a.json")).failed(2, &words);
        }
        let line = "match left.png right.png out.pfm --max-disparity 9";
        run(&folder, &format!("{line} --device {device}")).failed(2, &words);
    }
    assert!(listing(&folder) == before);
}
