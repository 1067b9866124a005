//! `mrfgs match` as a stereo algorithm of the Ames Stereo Pipeline, called as its `stereo_corr` calls plug-ins.

use tiff::encoder::{TiffEncoder, colortype::Gray32Float};

use super::*;

/// Rows and columns at the borders without data.
const MARGIN: usize = 6;

/// Mimics how the pipeline parses the options after the name in `--stereo-algorithm`: tokens with `=` become environment variables, an
/// option without a value gets the value 1, and most punctuation is refused.
fn plugin_options(options: &str) -> Vec<String> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || " _+-=.".contains(c);
    assert!(options.chars().all(allowed), "{options}");
    let is_option = |token: &str| {
        let mut chars = token.chars();
        chars.next() == Some('-') && chars.next().is_some_and(|c| !c.is_ascii_digit())
    };
    let mut given: Vec<(String, Vec<String>)> = Vec::new();
    for token in options.split_whitespace().filter(|token| !token.contains('=')) {
        match given.last_mut() {
            _ if is_option(token) => given.push((token.into(), Vec::new())),
            Some((_, values)) => values.push(token.into()),
            None => panic!("{token} is not an option"),
        }
    }
    let with_values = given.into_iter().flat_map(|(option, values)| {
        let values = if values.is_empty() { vec!["1".into()] } else { values };
        std::iter::once(option).chain(values)
    });
    with_values.collect()
}

/// Writes a view as the pipeline does: float, intensities from 0 to 1, NaN without data.
fn write_view(path: &Path, view: &image::GrayImage) {
    let (width, height) = view.dimensions();
    let pixels: Vec<f32> = view
        .enumerate_pixels()
        .map(|(x, y, tone)| {
            let inside = |at: u32, size: u32| (MARGIN..size as usize - MARGIN).contains(&(at as usize));
            if inside(x, width) && inside(y, height) { f32::from(tone.0[0]) / 255.0 } else { f32::NAN }
        })
        .collect();
    let mut encoder = TiffEncoder::new_big(fs::File::create(path).unwrap()).unwrap();
    encoder.write_image::<Gray32Float>(width, height, &pixels).unwrap();
}

#[test]
fn the_plugin_takes_and_gives_what_the_pipeline_expects() {
    let folder = Folder::new();
    let views =
        ["im0.png", "im1.png"].map(|file| image::open(scene("slanted").join(file)).unwrap().to_luma8());
    for (view, name) in views.iter().zip(["left.tif", "right.tif"]) {
        write_view(&folder.join(name), view);
    }
    let plugin = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/asp-plugin");
    let call = |options: &str| {
        let output = Command::new(&plugin)
            .current_dir(&*folder)
            .env("MRFGS", env!("CARGO_BIN_EXE_mrfgs"))
            .args(plugin_options(options))
            .args(["left.tif", "right.tif", "out.tif"])
            .output()
            .unwrap();
        (output.status.success(), String::from_utf8(output.stderr).unwrap())
    };
    // The pipeline passes no range to plug-ins.
    for options in ["--device cpu", "--device cpu --threads 1 --min-disparity -31 --max-disparity 0"] {
        let (success, told) = call(options);
        assert!(success, "{told}");
        let (found, truth) = (read_tiff(folder.join("out.tif")), read_pfm(scene("slanted/disp0GT.pfm")));
        assert_eq!(found.size(), truth.size());
        let (width, height) = found.size();
        let (mut errors, mut holes) = (Vec::new(), 0);
        for y in 0..height {
            for x in 0..width {
                let d = found[(x, y)];
                assert!(d.is_nan() || (-31.0..=0.0).contains(&d), "{d} at {x}, {y}");
                let inside = (MARGIN..width - MARGIN).contains(&x) && (MARGIN..height - MARGIN).contains(&y);
                assert!(inside || d.is_nan(), "a disparity without data at {x}, {y}");
                holes += usize::from(inside && d.is_nan());
                if !d.is_nan() {
                    // Seen at x + d on the right.
                    errors.push((d + truth[(x, y)]).abs());
                }
            }
        }
        errors.sort_by(f32::total_cmp);
        assert!(errors.len() > width * height / 2 && holes > 0, "{} and {holes}", errors.len());
        assert!(errors[errors.len() / 2] < 0.25, "{}", errors[errors.len() / 2]);
    }
    // The plug-in itself keeps holes, as the pipeline refuses `=` and gives every option a value.
    let (success, told) = call("--device cpu --quiet");
    assert!(!success && told.lines().count() == 1, "{told}");
}

#[test]
fn the_sign_turns_map_and_range_around() {
    let folder = Folder::new();
    let line = "match @steep/im0.png @steep/im1.png --set fill=none --device cpu";
    let matched = |name: &str, more: &str| {
        let told = run(&folder, &format!("{line} {name} --json - {more}")).succeeded();
        (read_tiff(folder.join(name)), told.json())
    };
    let (ours, told) = matched("ours.tif", "--max-disparity 30 --min-disparity 2");
    let range = |told: &Value| ["min", "max"].map(|end| told["range"][end].as_i64().unwrap());
    assert_eq!((told["sign"].as_str(), range(&told)), (Some("left-minus-right"), [2, 30]));
    let turned = "--sign right-minus-left --min-disparity -30 --max-disparity -2";
    let (theirs, told) = matched("theirs.tif", &format!("{turned} --also raw"));
    assert_eq!((told["sign"].as_str(), range(&told)), (Some("right-minus-left"), [-30, -2]));
    let raw = read_tiff(folder.join("theirs.raw.tif"));
    let mut invalid = 0;
    for (i, (&d, &turned)) in ours.data().iter().zip(theirs.data()).enumerate() {
        invalid += usize::from(d.is_nan());
        assert!(if d.is_nan() { turned.is_nan() } else { turned.to_bits() == (-d).to_bits() }, "pixel {i}");
        assert!((-30.0..=-2.0).contains(&raw.data()[i]), "pixel {i}");
    }
    assert!((1..ours.data().len() / 2).contains(&invalid), "{invalid} of {}", ours.data().len());

    // On standard output, invalid pixels are +infinity as usual.
    let printed = program(&folder, &format!("{line} - --quiet {turned}")).output().unwrap();
    fs::write(folder.join("printed.pfm"), printed.stdout).unwrap();
    let expected = theirs.map(|&d| if d.is_nan() { f32::INFINITY } else { d });
    assert_eq!(read_pfm(folder.join("printed.pfm")), expected);

    // With one end only, infinity is at 0 for this sign, too.
    let (_, told) = matched("a.tif", "--sign right-minus-left --min-disparity -20");
    assert_eq!(range(&told), [-20, 0]);
    // The range of a calibration.
    let (_, told) = matched("b.tif", "--sign right-minus-left");
    let (_, ours) = matched("c.tif", "");
    let [min, max] = range(&ours);
    assert_eq!(range(&told), [-max, -min]);
}
