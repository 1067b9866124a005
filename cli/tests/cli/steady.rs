//! `mrfgs sequence --steady`: the maps equal those of the library's filter applied to unfiltered maps.

use mrfgs::image::{Pair, Rect};
use mrfgs::maps::Maps;
use mrfgs::steady::Steady;

use super::*;

#[test]
fn steady_maps_equal_the_librarys() {
    let folder = Folder::new();
    for (view, name) in [("left", "im0.png"), ("right", "im1.png")] {
        fs::create_dir(folder.join(view)).unwrap();
        let still = image::open(scene(&format!("slanted/{name}"))).unwrap().into_rgb8();
        for step in 0..3 {
            let mut noisy = still.clone();
            for (x, y, pixel) in noisy.enumerate_pixels_mut() {
                let noise = (x * 7 + y * 13 + step * 5) % 3;
                pixel.0 = pixel.0.map(|v| v.saturating_add(noise as u8));
            }
            noisy.save(folder.join(view).join(format!("{step}.png"))).unwrap();
        }
    }
    let line = "--max-disparity 31 --method fast --device cpu --quiet";
    run(&folder, &format!("sequence left right alone {line} --also confidence,validity")).succeeded();
    run(&folder, &format!("sequence left right steady {line} --steady --also validity,right")).succeeded();
    let part = "--roi 40,30,120,90";
    run(&folder, &format!("sequence left right part {line} --steady {part}")).succeeded();
    run(&folder, &format!("sequence left right lone {line} {part} --also confidence,validity")).succeeded();
    let grey = |path: PathBuf| {
        let map = image::open(path).unwrap().into_luma8();
        Plane::new(map.width() as usize, map.height() as usize, map.into_raw())
    };
    // The library's filter applied to the unfiltered maps.
    let expected = |alone: &str, rect: Option<Rect>| -> Vec<Plane<f32>> {
        let mut steady = Steady::new();
        let frames = (0..3).map(|step| {
            let map = |kind: &str| folder.join(format!("{alone}/{step}.{kind}"));
            let path = folder.join(format!("left/{step}.png"));
            let pair = Pair::open(&path, &path).unwrap();
            let pair = rect.as_ref().map_or(pair.clone(), |rect| pair.crop(rect));
            let [confidence, validity] =
                ["confidence", "validity"].map(|kind| grey(map(&format!("{kind}.png"))));
            let mut maps = Maps::from_pixels(&read_pfm(map("pfm")), confidence, validity);
            steady.follow(pair.left(), &mut maps);
            maps.final_map()
        });
        frames.collect()
    };
    for (alone, steady, rect) in
        [("alone", "steady", None), ("lone", "part", Some(Rect { x: 40..160, y: 30..120 }))]
    {
        for (step, expected) in expected(alone, rect).iter().enumerate() {
            let [before, now] =
                [alone, steady].map(|name| read_pfm(folder.join(format!("{name}/{step}.pfm"))));
            assert!(now == *expected, "{steady} {step}");
            // Control: only the first frame is unchanged.
            assert_eq!(now == before, step == 0, "{steady} {step}");
        }
    }
    for step in 0..3 {
        let validity = |name: &str| fs::read(folder.join(format!("{name}/{step}.validity.png"))).unwrap();
        assert!(validity("alone") == validity("steady"));
    }
}
