//! The front end on whole images: invariants, expected results, and small or empty images.

use std::ops::ControlFlow;
use std::path::Path;

use mrfgs::image::{Image, Pair, Plane, grey};
use mrfgs::low_level::front::illumination::homomorphic;
use mrfgs::low_level::front::zones::regions::connected;
use mrfgs::low_level::front::zones::{MASKED, Options, Zones, segment};
use mrfgs::low_level::front::{label_range, matches, prepare};
use mrfgs::low_level::plan::Plan;
use mrfgs::low_level::watch::{Followed, Watch};
use mrfgs::options::{DisparityRange, Illumination, Method, ZoneExtent};

const SCENES: [&str; 6] = ["slanted", "thin", "wall", "repetitive", "exposure", "mixed"];

/// The left view of a rendered scene.
fn scene(name: &str) -> Image {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name);
    let pair = Pair::open(folder.join("im0.png"), folder.join("im1.png"));
    pair.expect("the scenes are there").left().clone()
}

/// Every cluster is one zone, as in the paper.
fn clusters() -> Options {
    Options { extent: ZoneExtent::Cluster, ..Options::default() }
}

/// An image of `colour(x, y)`, in 1/256 of an 8-bit level, without masked pixels.
fn image(width: usize, height: usize, colour: impl Fn(usize, usize) -> [u16; 3]) -> Image {
    let pixels = Plane::from_fn(width, height, |x, y| {
        let [r, g, b] = colour(x, y);
        [r, g, b, grey(r, g, b)]
    });
    Image { pixels, masked: Plane::filled(width, height, false) }
}

/// A pseudo-random number below `n` for each pixel.
fn noise(x: usize, y: usize, n: u64) -> u16 {
    let mut h =
        (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    h = (h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((h >> 32) % n) as u16
}

/// 60 to 200 levels of noise in three colours, in multiples of 4 units.
fn speckle(x: usize, y: usize) -> [u16; 3] {
    [0, 1000, 2000].map(|shift| 4 * (60 * 64 + noise(x + shift, y, 140 * 64)))
}

/// The 64-bit FNV-1a hash.
fn fnv(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

/// The largest difference between two images in any channel, in 1/256 of a level.
fn largest_difference(a: &Image, b: &Image) -> u16 {
    let values = |image: &Image| image.pixels.data().as_flattened().to_vec();
    values(a).iter().zip(values(b)).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0)
}

fn with_threads<T: Send>(threads: usize, f: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(f)
}

/// Checks that all zones are used and numbered in the order of their first pixels, and that exactly the
/// masked pixels of the image have none.
fn assert_well_formed(zones: &Zones, image: &Image) {
    assert_eq!(zones.map.size(), image.pixels.size());
    let mut seen = 0;
    for (zone, masked) in zones.map.data().iter().zip(image.masked.data()) {
        assert_eq!(*zone == MASKED, *masked);
        if !masked {
            assert!(*zone as usize <= seen, "zone {zone} before zone {seen}");
            seen = seen.max(*zone as usize + 1);
        }
    }
    assert_eq!(seen, zones.count);
}

#[test]
fn a_gain_cancels_and_an_offset_does_not() {
    let original = image(80, 60, speckle);
    let corrected = homomorphic(&original);
    for quarters in [1, 2, 3, 5] {
        let brighter = image(80, 60, |x, y| speckle(x, y).map(|v| v / 4 * quarters));
        assert!(largest_difference(&original, &brighter) > 1000);
        let difference = largest_difference(&corrected, &homomorphic(&brighter));
        assert!(difference <= 1, "gain {quarters}/4: {difference} units apart");
    }
    let offset = image(80, 60, |x, y| speckle(x, y).map(|v| v + 5120));
    assert!(largest_difference(&corrected, &homomorphic(&offset)) > 1000);
}

#[test]
fn uneven_light_is_evened_out() {
    let lit = |x: usize, y: usize| speckle(x, y).map(|v| (u32::from(v) * (200 - x as u32) / 200) as u16);
    let apart = |a: &Image, b: &Image| {
        let (a, b) = (a.pixels.data().as_flattened(), b.pixels.data().as_flattened());
        a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>() / a.len() as u64
    };
    let (even, uneven) = (image(120, 60, speckle), image(120, 60, lit));
    let (before, after) = (apart(&even, &uneven), apart(&homomorphic(&even), &homomorphic(&uneven)));
    assert!(20 * after < before, "{before} units apart before and {after} after");
}

#[test]
fn uniform_images_become_mid_grey_and_colours_keep_their_ratios() {
    let corrected = homomorphic(&image(30, 20, |_, _| [5000, 5000, 5000]));
    let first = corrected.pixels.data()[0];
    assert!(corrected.pixels.data().iter().flatten().all(|v| v.abs_diff(first[0]) <= 1));
    let red = homomorphic(&image(30, 20, |_, _| [9000, 3000, 6000])).pixels[(7, 7)];
    assert!(red[3].abs_diff(first[3]) <= 2, "{red:?}: not as bright as {first:?}");
    assert!(red[0].abs_diff(3 * red[1]) <= 2 && red[2].abs_diff(2 * red[1]) <= 2, "{red:?}: not 3 : 1 : 2");
}

#[test]
fn masked_pixels_keep_their_values_and_have_no_influence() {
    let masked = Plane::from_fn(90, 70, |x, y| x.abs_diff(30) < 9 && y.abs_diff(20) < 9 || x == 89);
    let with = |hidden: u16, masked: &Plane<bool>| {
        let colour = |x: usize, y: usize| if masked[(x, y)] { [hidden; 3] } else { speckle(x, y) };
        Image { masked: masked.clone(), ..image(90, 70, colour) }
    };
    let [dark, bright] = [0, 65535].map(|hidden| with(hidden, &masked));
    let [from_dark, from_bright] = [&dark, &bright].map(homomorphic);
    assert_eq!(from_dark.masked, masked);
    let mut seen = 0;
    for i in 0..masked.data().len() {
        let (d, b) = (from_dark.pixels.data()[i], from_bright.pixels.data()[i]);
        if masked.data()[i] {
            assert_eq!([d, b], [[0; 4], [65535; 4]]);
        } else {
            assert_eq!(d, b);
            seen += 1;
        }
    }
    assert!(seen > 5000);
    let zones = segment(&dark, &Options::default());
    assert_well_formed(&zones, &dark);
    assert_eq!(zones, segment(&bright, &Options::default()));

    // Control: without the mask, the same values change the results.
    let open = Plane::filled(90, 70, false);
    let [dark, bright] = [dark, bright].map(|image| Image { masked: open.clone(), ..image });
    assert_ne!(homomorphic(&dark).pixels[(30, 30)], homomorphic(&bright).pixels[(30, 30)]);
    assert_ne!(segment(&dark, &Options::default()), segment(&bright, &Options::default()));
}

/// Whether the zones are 0 to the left of `border` and 1 to the right, ignoring 12 pixels on each side of
/// it.
fn parts_at(zones: &Zones, border: usize) -> bool {
    let (width, height) = zones.map.size();
    let right = |x: usize, y: usize| x.abs_diff(border) <= 12 || zones.map[(x, y)] == u32::from(x > border);
    zones.count == 2 && (0..height).all(|y| (0..width).all(|x| right(x, y)))
}

#[test]
fn two_textures_are_two_zones() {
    let options = Options { clusters: 2, ..clusters() };
    let stripe = |number: usize| if number.is_multiple_of(2) { [40000; 3] } else { [20000; 3] };
    // Same mean and contrast; only the direction, or only the wavelength, differs.
    let upright = |x: usize, _: usize| stripe(x / 3);
    let lying = |_: usize, y: usize| stripe(y / 3);
    let coarse = |x: usize, _: usize| stripe(x / 8);
    for border in [50, 78] {
        let direction = image(128, 96, |x, y| if x < border { upright(x, y) } else { lying(x, y) });
        let wavelength = image(128, 96, |x, y| if x < border { upright(x, y) } else { coarse(x, y) });
        for (name, image) in [("direction", direction), ("wavelength", wavelength)] {
            let zones = segment(&image, &options);
            assert_well_formed(&zones, &image);
            assert!(parts_at(&zones, border), "{name}: not parted at {border}");
            assert!(!parts_at(&zones, 128 - border), "{name}: the test takes any border");
        }
    }
}

#[test]
fn every_run_and_every_number_of_threads_agree() {
    let image = scene("mixed");
    let run = || (homomorphic(&image), segment(&image, &Options::default()));
    let once = with_threads(1, run);
    assert_eq!(once, with_threads(1, run), "a second run");
    assert_eq!(once, with_threads(2, run), "two threads");
    assert_eq!(once, with_threads(7, run), "seven threads");
    let reseeded = segment(&image, &Options { seed: 1, ..Options::default() });
    assert_ne!(once.1, reseeded, "the comparison sees no difference");
}

#[test]
fn there_are_as_many_clusters_as_asked_for() {
    let image = scene("slanted");
    for clusters in [1, 2, 5, 15] {
        let found = segment(&image, &Options { clusters, ..self::clusters() });
        assert_well_formed(&found, &image);
        assert_eq!(found.count, clusters);
    }
}

#[test]
fn the_scenes_keep_their_checksums() {
    let expected = [
        (0x1a2d_cdeb_898c_2ae4, 0x0f75_be88_d5b6_554b),
        (0x6387_4d16_1a68_5b84, 0xa6f2_56ea_062b_e511),
        (0xa8f6_f7b3_1cb5_8372, 0x4af3_cf55_0d51_bcbe),
        (0xa3e1_e563_94fc_b792, 0x7650_c484_71b5_d3b2),
        (0x6ddb_958f_6826_4c2f, 0x8f85_dce5_18b6_7b95),
        (0x9594_edbc_48fd_c64c, 0xb521_5e92_38b0_c991),
    ];
    let actual = SCENES.map(|name| {
        let image = scene(name);
        let zones = segment(&image, &clusters());
        assert_well_formed(&zones, &image);
        let even = homomorphic(&image);
        let values = even.pixels.data().as_flattened().iter().flat_map(|v| v.to_le_bytes());
        (fnv(zones.map.data().iter().map(|zone| *zone as u8)), fnv(values))
    });
    assert!(actual == expected, "(zones, evened out) of {SCENES:?}:\n{actual:#018x?}");
}

#[test]
fn small_images_have_few_clusters() {
    for (width, height) in
        (1..40).flat_map(|n| [(1, n), (n, 1), (n, n)]).chain([(1, 3000), (3000, 1), (700, 2)])
    {
        let image = image(width, height, speckle);
        let zones = segment(&image, &clusters());
        assert_well_formed(&zones, &image);
        let pixels = width * height;
        assert!(
            (1..=(pixels / 16).clamp(1, 15)).contains(&zones.count),
            "{width} x {height}: {}",
            zones.count
        );
        assert!(pixels < 1000 || zones.count == 15, "{width} x {height}: {} clusters", zones.count);
        assert_eq!(homomorphic(&image).pixels.size(), (width, height));
    }
}

#[test]
fn images_without_texture_are_split_by_position() {
    for level in [0, 1, 30000, 65535] {
        let image = image(64, 48, |_, _| [level; 3]);
        let zones = segment(&image, &clusters());
        assert_well_formed(&zones, &image);
        assert_eq!(zones.count, 15);
        assert_eq!(zones, segment(&self::image(64, 48, |_, _| [7; 3]), &clusters()));
    }
    // Where there is texture, position alone does not decide.
    let plain = image(64, 48, |_, _| [7; 3]);
    let textured = image(64, 48, speckle);
    assert_ne!(segment(&textured, &Options::default()), segment(&plain, &Options::default()));
}

#[test]
fn black_and_empty_images_are_returned_unchanged() {
    let hidden = Image { masked: Plane::filled(40, 30, true), ..image(40, 30, speckle) };
    let zones = segment(&hidden, &Options::default());
    assert_well_formed(&zones, &hidden);
    assert_eq!(zones.count, 0);
    assert_eq!(homomorphic(&hidden), hidden);

    let black = image(40, 30, |_, _| [0; 3]);
    assert_eq!(homomorphic(&black), black);
    let empty = image(0, 0, speckle);
    assert_eq!(homomorphic(&empty), empty);
    assert_eq!(segment(&empty, &Options::default()).count, 0);

    // A single unmasked pixel, off every coarse grid.
    let mut almost = Image { masked: Plane::filled(300, 200, true), ..image(300, 200, speckle) };
    almost.masked[(299, 1)] = false;
    let zones = segment(&almost, &Options::default());
    assert_well_formed(&zones, &almost);
    assert_eq!((zones.count, zones.map[(299, 1)]), (1, 0));
}

/// Connected regions by definition: regions of a cluster that touch are merged until none do. They are
/// numbered in the order of their first pixels.
fn regions(clusters: &Plane<u32>, steps: &[(i32, i32)]) -> Zones {
    let (width, height) = clusters.size();
    let inside = |(x, y): (i32, i32)| x >= 0 && y >= 0 && x < width as i32 && y < height as i32;
    // The index of the first pixel of each region.
    let mut first = Plane::from_fn(width, height, |x, y| y * width + x);
    loop {
        let before = first.data().to_vec();
        for y in 0..height {
            for x in 0..width {
                let around =
                    steps.iter().map(|(dx, dy)| (x as i32 + dx, y as i32 + dy)).filter(|at| inside(*at));
                for (u, v) in around.map(|(u, v)| (u as usize, v as usize)) {
                    if clusters[(u, v)] == clusters[(x, y)] {
                        first[(x, y)] = first[(x, y)].min(first[(u, v)]);
                    }
                }
            }
        }
        if before == first.data() {
            break;
        }
    }
    let is_first = |i: usize| first.data()[i] == i && clusters.data()[i] != MASKED;
    let firsts: Vec<usize> = (0..width * height).filter(|&i| is_first(i)).collect();
    let map = Plane::from_fn(width, height, |x, y| {
        firsts.binary_search(&first[(x, y)]).map_or(MASKED, |zone| zone as u32)
    });
    Zones { map, count: firsts.len() }
}

#[test]
fn regions_are_connected_parts_of_clusters() {
    let beside = [(-1, 0), (1, 0), (0, -1), (0, 1)];
    let diagonal = [(-1, -1), (1, -1), (-1, 1), (1, 1)];
    let corners_too = [beside, diagonal].concat();
    let mut told_apart = 0;
    for (width, height) in [(1, 1), (1, 9), (9, 1), (2, 2), (7, 5), (40, 33)] {
        for kinds in [1, 2, 3, 6] {
            let cluster = |x: usize, y: usize| match u32::from(noise(x + 100 * kinds as usize, y, kinds)) {
                5 => MASKED,
                cluster => cluster,
            };
            let clusters = Plane::from_fn(width, height, cluster);
            let found = connected(&clusters);
            assert_eq!(found, regions(&clusters, &beside), "{width} x {height}, {kinds} kinds");
            // Control: counting diagonal neighbours as connected gives other regions.
            told_apart += u32::from(found != regions(&clusters, &corners_too));
        }
    }
    assert!(told_apart > 5, "{told_apart}");

    // A spiral is one region, and the area that it encloses is another.
    let wall = ["#######", "......#", "#####.#", "#...#.#", "#.###.#", "#.....#", "#######"];
    let spiral = Plane::from_fn(7, 7, |x, y| u32::from(wall[y].as_bytes()[x] == b'#'));
    assert_eq!(connected(&spiral).count, 2);
    assert_eq!(connected(&Plane::filled(0, 0, 0)).count, 0);
}

#[test]
fn zones_are_regions_of_clusters() {
    let mut split = 0;
    for name in SCENES {
        let image = scene(name);
        let (zones, clusters) = (segment(&image, &Options::default()), segment(&image, &clusters()));
        assert_well_formed(&zones, &image);
        assert_eq!(zones, connected(&clusters.map));
        split += usize::from(zones.count > clusters.count);
    }
    assert!(split >= 3, "{split} scenes have clusters of several regions");
}

#[test]
fn the_method_sets_the_correction_and_the_extent_of_zones() {
    let folder = Path::new("testdata/exposure");
    let pair = Pair::open(folder.join("im0.png"), folder.join("im1.png")).unwrap();
    let range = DisparityRange::new(0, 31).unwrap();
    let corrected = Pair::new(homomorphic(pair.left()), homomorphic(pair.right())).unwrap();
    let mut seen = Vec::new();
    for illumination in [Illumination::None, Illumination::Homomorphic, Illumination::HomomorphicFirst] {
        for extent in [ZoneExtent::Region, ZoneExtent::Cluster] {
            let mut method = Method::paper();
            (method.front.illumination, method.front.zone_extent) = (illumination, extent);
            let plan = Plan::new(pair.size().0, pair.size().1, range, &method).unwrap();
            let mut go_on = |_| ControlFlow::Continue(());
            let found =
                prepare(pair.clone(), &plan, &mut Watch::new(&mut go_on, Followed::new(1.0))).unwrap();
            let matched = if illumination == Illumination::None { &pair } else { &corrected };
            assert!(found.pair.left() == matched.left() && found.pair.right() == matched.right());
            let source = if illumination == Illumination::HomomorphicFirst { &corrected } else { &pair };
            let (zones, matches) = found.zones.unwrap();
            assert_eq!(zones, segment(source.left(), &Options { extent, ..Default::default() }));
            let split = Some((&zones.map, zones.count));
            assert_eq!(matches, matches::find(source, split, Some(range)));
            let ranges = label_range::zonal(range, (&zones.map, zones.count), &matches, 1.0);
            let index = |label: i32| (label - range.min) as u16;
            assert!(found.label_ranges[0] == ranges.map(|ends| ends.map(index)));
            seen.push(found.label_ranges);
        }
    }
    // Control: sources and extents change the ranges; `None` and `Homomorphic` have the same source.
    assert!(seen[0] == seen[2] && seen[1] == seen[3]);
    assert!(seen[2] != seen[3] && seen[2] != seen[4] && seen[3] != seen[5] && seen[4] != seen[5]);
}
