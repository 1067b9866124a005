//! `mrfgs evaluate --report`.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;

use super::evaluate::{evaluated, refused};
use super::*;

/// The values of an attribute in a page, in order.
fn attributes<'a>(page: &'a str, name: &str) -> Vec<&'a str> {
    let start = format!(" {name}=\"");
    page.split(&start).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

#[test]
fn a_report_is_complete_and_self_contained() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    copy("slanted", &at("Teddy"));
    // Characters that folder names may contain.
    let odd = if cfg!(windows) { "a & 'b'" } else { "<b>\"a\" & 'b'" };
    copy("mixed", &at(odd));
    let line = "evaluate Teddy --report out --json out.json";
    assert!(program(&folder, line).arg(odd).status().unwrap().success());

    let page = fs::read_to_string(at("out/index.html")).unwrap();
    assert!(page.starts_with("<!doctype html>\n") && page.ends_with("</html>\n"));
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("<script"));
    assert_eq!(page.matches("<section>").count(), 2);
    assert!(page.contains("<h2>Teddy</h2>") && !page.contains("<b>\"a\""));
    assert!(page.contains("&amp; &#39;b&#39;</h2>"), "{}", &page[..3000]);
    assert!(page.contains("prefers-color-scheme: dark") && page.contains("image-rendering: pixelated"));
    let figures = json(at("out.json"));
    for pair in figures["pairs"].as_array().unwrap() {
        let avg = pair["final"]["all"]["avg"].as_f64().unwrap();
        assert!(page.matches(&format!("<td>{avg:.3}</td>")).count() >= 2, "{avg}");
        let occluded = pair["breakdown"]["occluded"]["share"].as_f64().unwrap();
        let auc = pair["confidence"]["auc"].as_f64().unwrap();
        for words in [format!("occluded</th><td>{occluded:.2}</td>"), format!("AUC {auc:.2} %")] {
            assert!(page.contains(&words), "{words}");
        }
    }

    let (files, sources) = (attributes(&page, "data-file"), attributes(&page, "src"));
    assert_eq!((files.len(), sources.len()), (18, 18));
    assert!(attributes(&page, "alt").iter().all(|alt| alt.len() > 15));
    for (file, source) in files.iter().zip(sources) {
        let bytes = BASE64.decode(source.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        assert_eq!(fs::read(at("out").join(file)).unwrap(), bytes, "{file}");
        let picture = image::load_from_memory(&bytes).unwrap();
        let (w, h) = if file.starts_with("1-Teddy-") { (240, 180) } else { (320, 240) };
        // Below the map: nothing, the colour bar (16 rows), or one line of classes (9 rows).
        let legend = match file.rsplit('-').next().unwrap() {
            "left.png" | "zones.png" => 0,
            "validity.png" => 9,
            _ => 16,
        };
        assert_eq!((picture.width(), picture.height()), (w, h + legend), "{file}");
    }
    assert_eq!(fs::read_dir(at("out")).unwrap().count(), 19);
    // The raw map and its error are not those of the final one.
    for [raw, finished] in [["raw", "disparity"], ["raw-error", "error"]] {
        let [raw, finished] =
            [raw, finished].map(|name| fs::read(at(&format!("out/1-Teddy-{name}.png"))).unwrap());
        assert_ne!(raw, finished);
    }
    // The left view is unchanged.
    let left = image::open(at("out/1-Teddy-left.png")).unwrap().into_rgb8();
    assert_eq!(left, image::open(at("Teddy/im0.png")).unwrap().into_rgb8());

    // A later report replaces it; a finished map has fewer pictures.
    evaluated(&folder, "map Teddy/disp0GT.pfm --truth Teddy/disp0GT.pfm --report out");
    let mut names: Vec<_> =
        fs::read_dir(at("out")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let pictures = ["disparity", "error", "truth"].map(|name| format!("1-disp0GT-{name}.png"));
    assert_eq!(names, [&pictures[..], &["index.html".into()]].concat());
    let error = image::open(at("out/1-disp0GT-error.png")).unwrap().into_rgb8();
    assert!((0..180).all(|y| error.get_pixel(100, y).0 == [250; 3]), "zero error is white");

    // No temporary files are left.
    assert_eq!(fs::read_dir(&*folder).unwrap().count(), 4);
}

#[test]
fn a_failed_report_leaves_nothing() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    copy("slanted", &at("Teddy"));
    fs::create_dir(at("misfit")).unwrap();
    fs::create_dir(at("empty")).unwrap();
    for file in ["im0.png", "im1.png", "calib.txt"] {
        fs::copy(scene("slanted").join(file), at("misfit").join(file)).unwrap();
    }
    fs::copy(scene("mixed/disp0GT.pfm"), at("misfit/disp0GT.pfm")).unwrap();

    // Faults of the folder.
    refused(&folder, "Teddy --report Teddy", 1, "Teddy & not part of an earlier report");
    refused(&folder, "Teddy --report none/out", 1, "none/out & create it first");
    refused(&folder, "Teddy --report Teddy/im0.png", 1, "im0.png & is a file");
    refused(&folder, "Teddy --report empty --json empty/a.json", 2, "--json & empty/a.json & another path");

    // Later failures: the second pair, or the JSON.
    for out in ["out", "empty"] {
        refused(&folder, &format!("misfit --report {out}"), 1, "disp0GT.pfm is 320 x 240");
    }
    let line = "map Teddy/disp0GT.pfm --truth Teddy/disp0GT.pfm";
    if cfg!(target_os = "linux") {
        refused(&folder, &format!("{line} --report out --json /dev/full"), 1, "/dev/full");
    }

    // A report with other files in it is kept, and so is another web page.
    evaluated(&folder, &format!("{line} --report empty"));
    fs::write(at("empty/notes.txt"), "precious").unwrap();
    refused(&folder, &format!("{line} --report empty"), 1, "empty & notes.txt & new folder");
    fs::create_dir(at("site")).unwrap();
    fs::write(at("site/index.html"), "<!doctype html><title>Home</title>").unwrap();
    refused(&folder, &format!("{line} --report site"), 1, "site & index.html");
}

#[test]
fn methods_are_compared_side_by_side() {
    let folder = Folder::new();
    let at = |name: &str| folder.join(name);
    copy("slanted", &at("Teddy"));
    fs::write(at("mine.toml"), "levels = 2\n").unwrap();
    let methods = "--method paper --method fgs --method mine.toml";
    let told = evaluated(&folder, &format!("Teddy {methods} --report out --json out.json"));
    let heads: Vec<_> = told.stdout.lines().filter(|line| line.starts_with("method ")).collect();
    assert_eq!(heads, ["method paper", "method fgs + mine.toml"]);

    // Figures and methods are those of single evaluations.
    let both = json(at("out.json"));
    assert_eq!(both["beside"].as_array().unwrap().len(), 1);
    let alone = ["paper", "fgs --method mine.toml"].map(|method| {
        evaluated(&folder, &format!("Teddy --method {method} --json - --report single")).json()
    });
    for (found, alone) in [&both, &both["beside"][0]].into_iter().zip(&alone) {
        assert_eq!(found["method"], alone["method"]);
        assert_eq!(found["mean"], alone["mean"]);
        assert!(alone["name"].is_null() && alone["beside"].is_null());
    }
    assert_eq!((&both["name"], &both["beside"][0]["name"]), (&"paper".into(), &"fgs + mine.toml".into()));
    // Control: the methods differ.
    assert_ne!(alone[0]["mean"], alone[1]["mean"]);

    // The page shows pictures that all methods share once. Then each kind of map follows, first by `paper`, then by `fgs`.
    let page = fs::read_to_string(at("out/index.html")).unwrap();
    let mut expected: Vec<_> =
        ["left", "zones", "truth"].iter().map(|kind| format!("1-Teddy-{kind}.png")).collect();
    for kind in ["disparity", "error", "raw", "raw-error", "confidence", "validity"] {
        expected.extend(["1-paper", "2-fgs___mine_toml"].map(|by| format!("1-Teddy-{by}-{kind}.png")));
    }
    assert_eq!(attributes(&page, "data-file"), expected);
    assert!(page.contains("<b>Raw signed error by fgs + mine.toml</b>"));
    assert!(page.contains("grid-template-columns: repeat(2, 1fr)"));
    for (of, name) in [(&both, "paper"), (&both["beside"][0], "fgs + mine.toml")] {
        let avg = of["mean"]["final"]["all"]["avg"].as_f64().unwrap();
        let row = format!("<td class=\"text\">final by {name}</td><td>{avg:.3}</td>");
        assert!(page.contains(&row), "{row}");
        assert!(page.contains(&format!("<h2>Method by {name}</h2>")));
    }
    // The second method's pictures are those of its own report.
    for kind in ["disparity", "raw-error"] {
        let [beside, alone] =
            [format!("out/1-Teddy-2-fgs___mine_toml-{kind}.png"), format!("single/1-Teddy-{kind}.png")]
                .map(|file| fs::read(at(&file)).unwrap());
        assert!(beside == alone, "{kind}");
    }

    // Only evaluations of pairs compare methods.
    refused(&folder, &format!("submission up MINE Teddy {methods}"), 2, "--method & fgs & put it first");
}
