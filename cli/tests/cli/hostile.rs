//! Files that claim more than they contain, or are too large: refused by their headers, before memory is allocated.

use super::files::{Png, jpeg, tiff};
use super::*;

/// Small files that claim gigantic or impossible images, each with words of the error.
fn hostile() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    const TOO_MANY: &str = "at most 268435456 are read & raise --max-pixels & crop it";
    const DAMAGED: &str = "get the file again";
    let png =
        |size, depth, colour| Png { size, depth, colour, interlaced: false, chunks: &[], rows: &[0] }.bytes();
    let mut jpeg = jpeg(&[9, 9, 9], None, None);
    let frame = jpeg.windows(2).position(|mark| mark == [0xff, 0xc0]).unwrap();
    jpeg[frame + 5..frame + 9].copy_from_slice(&[0xff; 4]);
    let image = |width, height, more: &[(u16, u16, u32, u32)]| {
        let common =
            [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1)];
        tiff(&[&common[..], &[(277, 3, 1, 1)], more].concat(), &[0; 64])
    };
    let strips = [(273, 4, 1, 8), (278, 4, 1, u32::MAX), (279, 4, 1, u32::MAX)];
    let big_tiff = {
        let entry = |tag: u16, value: u64| {
            [&tag.to_le_bytes()[..], &[4, 0], &1_u64.to_le_bytes(), &value.to_le_bytes()].concat()
        };
        let head = [&b"II+\0\x08\0\0\0"[..], &16_u64.to_le_bytes(), &5_u64.to_le_bytes()].concat();
        let strip = [entry(273, 8), entry(279, 8)].concat();
        [head, entry(256, 4_000_000_000), entry(257, 4_000_000_000), entry(262, 1), strip, vec![0; 8]]
            .concat()
    };
    vec![
        ("grey.png", png((65_535, 65_535), 1, 0), TOO_MANY),
        ("colour.png", png((2_147_483_647, 2_147_483_647), 16, 6), TOO_MANY),
        ("row.png", png((268_435_457, 1), 1, 0), TOO_MANY),
        ("none.png", png((0, 9), 8, 0), "is 0 x 9 and holds no pixel"),
        ("within.png", png((16_384, 16_384), 1, 0), DAMAGED),
        ("huge.jpg", jpeg, TOO_MANY),
        ("huge.pgm", b"P5\n4000000000 4000000000\n255\n".to_vec(), TOO_MANY),
        ("overflow.ppm", b"P6\n4294967295 4294967295\n65535\n".to_vec(), "too large"),
        ("digits.pgm", b"P5\n99999999999 1\n255\n".to_vec(), "Overflow"),
        ("bits.pbm", b"P1\n100000 100000\n".to_vec(), TOO_MANY),
        ("none.pgm", b"P5\n0 0\n255\n".to_vec(), "no pixel"),
        ("within.pgm", b"P5\n16384 16384\n65535\n".to_vec(), DAMAGED),
        ("depth.pam", b"P7\nWIDTH 9\nHEIGHT 9\nDEPTH 4000000000\nMAXVAL 255\nENDHDR\n".to_vec(), "convert"),
        ("huge.pfm", b"PF\n4294967295 4294967295\n-1\n".to_vec(), TOO_MANY),
        ("none.pfm", b"Pf\n9 0\n-1\n".to_vec(), "no pixel"),
        ("within.pfm", b"PF\n16384 16384\n-1\n".to_vec(), DAMAGED),
        ("huge.tif", image(u32::MAX, u32::MAX, &strips), TOO_MANY),
        ("big.tif", big_tiff, TOO_MANY),
        ("none.tif", image(0, 1, &strips), "cannot read"),
        ("within.tif", image(16_384, 16_384, &strips), DAMAGED),
        ("strip.tif", image(9, 9, &strips), DAMAGED),
        // Would fit into 256 MiB if the missing data were not noticed.
        (
            "counts.tif",
            tiff(&[(256, 4, 1, 9), (257, 4, 1, 9), (258, 3, 0x0080_0000, 8), (277, 3, 1, 1)], &[]),
            "claims 8388608 values & get the file again",
        ),
        // The decoder prints its own line for such a text.
        ("text.tif", tiff(&[(256, 2, u32::MAX, 9), (257, 4, 1, 9)], &[]), "claims 4294967295 values"),
        ("strips.tif", image(9, 9, &[(273, 4, u32::MAX, 8), (278, 4, 1, 1), (279, 4, u32::MAX, 8)]), DAMAGED),
        (
            "tiles.tif",
            image(9, 9, &[(322, 4, 1, 1 << 30), (323, 4, 1, 1 << 30), (324, 4, 1, 8), (325, 4, 1, 9)]),
            "cannot read",
        ),
        (
            "samples.tif",
            tiff(&[(256, 4, 1, 9), (257, 4, 1, 9), (258, 3, 1, 64), (277, 3, 1, 65_535)], &[]),
            "cannot read",
        ),
    ]
}

#[test]
fn false_claims_of_a_header_are_refused_everywhere() {
    let folder = workshop();
    for (name, bytes, words) in hostile() {
        assert!(bytes.len() < 1000, "{name} is small");
        fs::write(folder.join(name), &bytes).unwrap();
        let before = listing(&folder);
        for line in [
            "match NAME right.png out.pfm --max-disparity 9",
            "match left.png NAME out.pfm --max-disparity 9",
            "match left.png right.png out.pfm --max-disparity 9 --mask NAME",
            "evaluate map NAME --truth unknown.pfm",
            "evaluate map unknown.pfm --truth NAME",
            "evaluate map unknown.pfm --truth unknown.pfm --mask NAME",
        ] {
            let line = line.replace("NAME", name);
            // An empty ground truth is refused before its mask is read.
            if line.ends_with(&format!("--mask {name}")) && line.starts_with("evaluate") {
                run(&folder, &line).failed(1, "unknown.pfm & no known disparity");
            } else {
                run(&folder, &line).failed(1, &format!("{name} & {words}"));
            }
        }
        assert!(listing(&folder) == before, "{name}: the folder has changed");
        fs::remove_file(folder.join(name)).unwrap();
    }
}

/// An image of exactly the allowed number of pixels is read; `failures` has larger ones.
#[test]
fn the_limit_on_pixels_is_the_users() {
    let folder = workshop();
    run(&folder, "match left.png right.png out.pfm --max-disparity 31 --max-pixels 2400 --quiet").succeeded();
}

/// Limits the address space, so allocations fail even if they are never touched.
#[cfg(target_os = "linux")]
mod memory {
    use super::*;

    /// The program and its threads need about 100 MiB of address space.
    const KIB: u32 = 256 << 10;

    fn limited(folder: &Path, line: &str) -> Run {
        shell(folder, &format!("ulimit -v {KIB}"), line)
    }

    #[test]
    fn claims_of_a_header_take_no_memory() {
        let folder = workshop();
        for (name, bytes, _) in hostile() {
            fs::write(folder.join(name), &bytes).unwrap();
            // Files above the default limit, and files within the limit but larger than their data.
            let told = limited(&folder, &format!("match {name} {name} out.pfm --max-disparity 9"));
            told.failed(1, &format!("mrfgs: cannot read {name}: "));
        }
    }

    /// A compressed profile that is far larger than the pixels.
    #[test]
    fn profiles_of_png_files_take_no_memory() {
        use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
        let folder = workshop();
        let mut bytes = Vec::new();
        let mut encoder = PngEncoder::new(&mut bytes);
        encoder.set_icc_profile(vec![0; 400 << 20]).unwrap();
        encoder.write_image(&[7; 2400], 60, 40, ExtendedColorType::L8).unwrap();
        assert!(bytes.len() < 2 << 20, "{} bytes", bytes.len());
        fs::write(folder.join("profile.png"), bytes).unwrap();
        let line = "match profile.png left.png out.pfm --max-disparity 9 --device cpu --threads 1";
        let told = limited(&folder, line);
        // It may be refused, or read without its profile.
        assert!(matches!(told.code, Some(0 | 1)), "{told:?}");
    }

    /// Controls: true claims fit into the limit, plausible false ones do not.
    #[test]
    fn the_limit_holds() {
        let folder = workshop();
        let line = "match left.png right.png out.pfm --max-disparity 9 --device cpu --threads 1";
        limited(&folder, line).succeeded();
        // Filler between header and pixels, so that the claim of 900 million pixels is plausible.
        let filler = vec![b'x'; 100_000];
        let png = Png {
            size: (30_000, 30_000),
            depth: 8,
            colour: 0,
            interlaced: false,
            chunks: &[(*b"tEXt", &filler)],
            rows: &[0],
        };
        fs::write(folder.join("claim.png"), png.bytes()).unwrap();
        let line = "match claim.png claim.png out.pfm --max-disparity 9 --device cpu --max-pixels 900000000";
        limited(&folder, line).failed(1, "1.7 GiB of memory are needed, but the system refuses them");
    }
}
