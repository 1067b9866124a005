//! `mrfgs bench`.

use super::*;

#[test]
fn a_bench_reports_all_figures_of_both_backends() {
    let folder = workshop();
    let backends = if has_gpu() { &["cpu", "gpu"][..] } else { &["cpu"] };
    let line = "bench misfit without-disp0GT.pfm --repeats 2 --json out.json --threads 2 --set levels=1";
    let which = backends.join(" --device ");
    let told = run(&folder, &format!("{line} --set percentile=92 --device {which}")).succeeded();
    let json = json(folder.join("out.json"));
    assert_eq!(json["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!((&json["threads"], &json["repeats"]), (&2.into(), &2.into()));

    let pairs = json["pairs"].as_array().unwrap();
    let expected = [("misfit", 60, 40), ("without-disp0GT.pfm", 240, 180)];
    let expected = expected.iter().flat_map(|pair| ["default", "paper"].map(|preset| (pair, preset)));
    assert_eq!(pairs.len(), 4);
    for (pair, (&(name, width, height), preset)) in pairs.iter().zip(expected) {
        let what = format!("{name}, method {preset}");
        assert_eq!((&pair["name"], &pair["method"]), (&name.into(), &preset.into()));
        assert_eq!((&pair["width"], &pair["height"]), (&width.into(), &height.into()), "{what}");
        assert_eq!(pair["labels"], 32, "{what}");
        told.prints(&format!("{what}: {width} x {height} pixels, 32 labels"));
        let method = &json["methods"][preset];
        assert_eq!(method["graph"]["levels"], 1, "--set applies to every preset");
        assert_eq!(pair["devices"].as_object().unwrap().len(), backends.len());

        for &backend in backends {
            let found = &pair["devices"][backend];
            let value = |key: &str| {
                let value = found[key].as_f64().unwrap_or_else(|| panic!("{what}, {backend}: no {key}"));
                assert!(value > 0.0 && value.is_finite(), "{what}, {backend}: {key} is {value}");
                value
            };
            told.says(&format!("{what}, {backend}: "));
            assert_eq!(found["ran_on"].as_str().unwrap().starts_with("the CPU path"), backend == "cpu");
            let runs: Vec<f64> =
                found["runs_ms"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
            assert_eq!(runs.len(), 2);
            assert!(runs.contains(&value("min_ms")) && runs.contains(&value("max_ms")));
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
            assert!(close(value("median_ms"), f64::midpoint(runs[0], runs[1])));

            // One level, 5 members, and messages and beliefs of 1 or 2 bytes.
            let (iterations, cells) = (value("iterations"), f64::from(width * height * 32));
            let wide = if preset == "paper" { 2.0 } else { 1.0 };
            assert!(close(value("label_updates"), iterations * 5.0 * cells), "{what}, {backend}");
            let kept = found["labels_kept"][0].as_f64().unwrap() / 100.0;
            assert!(kept > 0.0 && (kept <= 1.0 && preset == "paper" || close(kept, 1.0)), "{what}: {kept}");
            let message_values = value("message_bytes") / (iterations * cells * kept);
            // If a sweep computes messages and beliefs together, the five messages are not read again.
            let swept = if backend == "cpu" { 5.0 } else { 0.0 };
            assert!(close(message_values, (17.0 - swept) * wide + 1.0), "{message_values}");
            for (key, count, time) in [
                ("message_gupdates_per_s", "label_updates", "message_ms"),
                ("match_gupdates_per_s", "label_updates", "median_ms"),
                ("message_gb_per_s", "message_bytes", "message_ms"),
            ] {
                assert!(close(value(key), value(count) / value(time) / 1e6), "{what}, {backend}: {key}");
            }
            assert!(close(value("copy_share"), 100.0 * value("message_gb_per_s") / value("copy_gb_per_s")));

            let stages = found["stages"].as_object().unwrap();
            assert!(stages.values().all(|ms| ms.as_f64().is_some_and(|ms| ms >= 0.0)), "{stages:?}");
            let messages = if backend == "cpu" { "flood, level 0" } else { "dependency, level 0" };
            let last = if preset == "paper" { "median" } else { "plane" };
            for stage in ["graph, level 0", "cost", messages, last] {
                assert!(stages.contains_key(stage), "no {stage} in {stages:?}");
            }
            assert_eq!(stages.contains_key("zones"), preset == "paper");
            for key in ["device_bytes", "dispatches", "submissions", "bytes_up", "bytes_down"] {
                assert_eq!(found[key].is_null(), backend == "cpu", "{key}");
            }
            if backend == "gpu" {
                assert!(value("device_bytes") >= value("plan_bytes") / 2.0, "{what}");
            }
            if cfg!(target_os = "linux") {
                assert!(value("processor_ms") > 0.0);
                assert!(value("peak_bytes") > cells, "{what}, {backend}");
            }
        }
        // Equal results need equal work.
        for key in ["iterations", "label_updates", "plan_bytes"] {
            let of = |backend: &&str| &pair["devices"][*backend][key];
            assert!(backends.iter().all(|backend| of(backend) == of(&"cpu")), "{what}: {key}");
        }
    }

    // A single case, printed.
    let line = "bench misfit --method fgs --device cpu --repeats 1 --json -";
    let pairs = &run(&folder, line).succeeded().json()["pairs"];
    assert_eq!((pairs.as_array().unwrap().len(), &pairs[0]["method"]), (1, &"fgs".into()));
    assert_eq!(pairs[0]["devices"]["gpu"], Value::Null);
}

#[test]
fn a_bench_without_folders_generates_its_pair() {
    let folder = Folder::new();
    let told = run(&folder, "bench --method default --device cpu --repeats 1 --set levels=1").succeeded();
    told.prints("small, method default: 450 x 375 pixels, 60 labels");
    assert!(listing(&folder).is_empty());
}

#[cfg(target_os = "linux")]
#[test]
fn a_bench_that_cannot_be_written_fails() {
    let folder = workshop();
    let before = listing(&folder);
    let told = run(&folder, "bench misfit --method default --device cpu --repeats 1 --json /dev/full");
    assert_eq!((told.code, told.stdout.as_str()), (Some(1), ""), "{told:?}");
    assert!(told.stderr.lines().last().unwrap().contains("/dev/full"), "{told:?}");
    assert!(listing(&folder) == before);
}
