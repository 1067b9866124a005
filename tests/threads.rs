//! The threads that do the work, and their number.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

use mrfgs::check;
use mrfgs::drift::Drift;
use mrfgs::image::{Pair, Plane};
use mrfgs::rectification::{Options, Rectification};
use mrfgs::{Matcher, SharedMatcher, calibration, threads};
use std::path::Path;

/// Whether rayon's global pool has been started. A forked process would wait for its threads for ever.
fn global_pool_has_begun() -> bool {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().is_err()
}

/// All parallel work runs on threads that a forked process creates anew, and `limit` applies to it.
#[test]
fn nothing_starts_the_global_pool() {
    threads::limit(2);
    let on = || threads::run(rayon::current_num_threads);
    assert_eq!((on(), threads::count()), (2, 2));
    let pair = Pair::open("testdata/raw/left.png", "testdata/raw/right.png").unwrap();
    let file = Path::new("testdata/raw/cameras.yml");
    let cameras = calibration::of_texts(&[(file, calibration::text(file).unwrap())]).unwrap();
    let mut by = Rectification::new(&cameras, pair.size(), &Options::default()).unwrap();
    let rectified = by.apply(&pair).unwrap();
    by.keep_places().unwrap();
    assert_eq!(by.apply(&pair).unwrap().left(), rectified.left());
    Rectification::of_pair(&pair, &Options::default()).unwrap();
    let range = check::range(&rectified).unwrap();
    let _ = check::warnings(&rectified, Some(range));
    Drift::of(&by).unwrap().follow(&rectified, range).unwrap();
    let _ = (rectified.halved(), rectified.left().downsampled());
    let folder = tempfile::tempdir().unwrap();
    let map = Plane::filled(300, 300, 1.0_f32);
    map.save(folder.path().join("map.tif")).unwrap();
    let mut matcher = Matcher::builder().device("cpu").threads(2).build().unwrap();
    let found = matcher.run(&rectified, ..).unwrap();
    let pairs = vec![(rectified.clone(), found.range()); 3];
    matcher.run_all(pairs, |_| std::ops::ControlFlow::Continue(())).unwrap();
    let shared = SharedMatcher::new(Matcher::builder().device("cpu").threads(1)).unwrap();
    assert_eq!(shared.share(&rectified, rayon::current_num_threads).unwrap(), 1);
    let again = shared.turn(|matcher| matcher.run(&rectified, found.range())).unwrap();
    assert_eq!((again.maps, again.ran_on), (found.maps, "the CPU path, 1 thread".into()));
    // A caller's own pool is kept.
    let own = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(own.install(on), 3);
    assert!(!global_pool_has_begun());
    // Control: a started pool is detected.
    assert!(global_pool_has_begun());
}
