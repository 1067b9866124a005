//! `mrfgs evaluate`.

use std::collections::BTreeMap;
use std::fs;

use mrfgs::options::Method;
use serde_json::Value;

use super::{run, scene, scene_file};

/// Every number of a report, by its place in the JSON.
fn figures(value: &Value, place: &str, all: &mut BTreeMap<String, f64>) {
    match value {
        Value::Object(entries) => {
            for (key, value) in entries {
                figures(value, &format!("{place}/{key}"), all);
            }
        }
        Value::Number(n) => {
            all.insert(place.into(), n.as_f64().unwrap());
        }
        other => panic!("{place} is {other}"),
    }
}

#[test]
fn evaluate_gives_figures_and_the_same_for_a_written_map() {
    let folder = tempfile::tempdir().unwrap();
    let dirs = ["slanted", "exposure"].map(|name| scene(name).to_str().unwrap().to_owned());
    let told = run(folder.path(), &["evaluate", &dirs[0], &dirs[1], "--json", "out.json"]).succeeded();
    let lines: Vec<&str> = told.stdout.lines().collect();
    assert_eq!(lines.len(), 3 + 4 + 3, "{}", told.stdout);
    for (line, start) in
        [(3, "slanted      raw   |"), (5, "exposure     raw   |"), (8, "mean         raw   |")]
    {
        assert!(lines[line].starts_with(start), "{}", told.stdout);
        assert!(lines[line + 1].starts_with("             final |"), "{}", told.stdout);
    }

    let json: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("out.json")).unwrap()).unwrap();
    assert_eq!(json["method"], serde_json::to_value(Method::default()).unwrap());
    assert!(json["ran_on"].is_string());
    assert_eq!(json["pairs"].as_array().unwrap().len(), 2);
    assert_eq!(json["pairs"][1]["name"], "exposure");
    assert!(json["pairs"][0]["seconds"].as_f64().unwrap() > 0.0);
    let mut all = BTreeMap::new();
    for map in ["raw", "final"] {
        figures(&json["pairs"][0][map], map, &mut all);
        figures(&json["mean"][map], "mean", &mut all);
    }
    assert!(all.values().all(|v| v.is_finite() && *v >= 0.0), "{all:?}");
    assert!(all["final/all/avg"] < 1.0 && all["final/all/bad2.0"] < 10.0, "{all:?}");
    assert_eq!((all["final/all/pixels"], all["final/all/density"]), (240.0 * 180.0, 100.0));

    let at = |file: &str| scene_file("slanted", file);
    let (left, right, truth, mask) = (at("im0.png"), at("im1.png"), at("disp0GT.pfm"), at("mask0nocc.png"));
    run(folder.path(), &["match", &left, &right, "map.pfm", "--raw", "raw.pfm", "--quiet"]).succeeded();
    for (map, file) in [("final", "map.pfm"), ("raw", "raw.pfm")] {
        let args = ["evaluate", "--disparity", file, "--truth", &truth, "--mask", &mask, "--json", "-"];
        let told = run(folder.path(), &args).succeeded();
        assert_eq!(told.stderr, "");
        let json = told.json();
        assert!(json["method"].is_null() && json["pairs"][0]["raw"].is_null());
        let mut same = BTreeMap::new();
        figures(&json["pairs"][0]["final"], map, &mut same);
        for (place, value) in same {
            let expected = all[&place];
            assert!((value - expected).abs() <= 1e-6 * expected.abs(), "{place}: {value} and {expected}");
        }
    }
    // Without the mask there is a table all the same.
    let args = ["evaluate", "--disparity", "map.pfm", "--truth", &truth];
    let told = run(folder.path(), &args).succeeded();
    assert!(told.stdout.contains("map          final |"), "{}", told.stdout);
}
