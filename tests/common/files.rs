//! Image files built byte by byte, for features that no available encoder writes: small bit depths, palettes,
//! interlacing, and wrong headers.

#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]

/// A PNG file whose header claims `size`; `rows` are its filtered rows, of all passes if it is interlaced.
pub struct Png<'a> {
    pub size: (u32, u32),
    /// Bits per sample.
    pub depth: u8,
    /// 0 grey, 2 colour, 3 palette, 4 grey and alpha, 6 colour and alpha.
    pub colour: u8,
    pub interlaced: bool,
    /// Chunks between header and pixels, each with its name.
    pub chunks: &'a [([u8; 4], &'a [u8])],
    pub rows: &'a [u8],
}

impl Png<'_> {
    pub fn bytes(&self) -> Vec<u8> {
        let (width, height) = self.size;
        let mut header = [width.to_be_bytes(), height.to_be_bytes()].concat();
        header.extend([self.depth, self.colour, 0, 0, u8::from(self.interlaced)]);
        let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
        out.extend(chunk(*b"IHDR", &header));
        for &(name, data) in self.chunks {
            out.extend(chunk(name, data));
        }
        out.extend(chunk(*b"IDAT", &stored(self.rows)));
        out.extend(chunk(*b"IEND", &[]));
        out
    }
}

fn chunk(name: [u8; 4], data: &[u8]) -> Vec<u8> {
    let named = [&name, data].concat();
    [&(data.len() as u32).to_be_bytes()[..], &named, &crc32(&named).to_be_bytes()].concat()
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 * (crc & 1)))
    })
}

/// A zlib stream that stores `data`, at most 65,535 bytes, uncompressed.
fn stored(data: &[u8]) -> Vec<u8> {
    let length = u16::try_from(data.len()).expect("one block");
    let (a, b) = data.iter().fold((1, 0), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65_521;
        (a, (b + a) % 65_521)
    });
    let lengths = [length.to_le_bytes(), (!length).to_le_bytes()].concat();
    [&[0x78, 1, 1][..], &lengths, data, &(b << 16 | a).to_be_bytes()].concat()
}

/// A little-endian TIFF file: its only directory at byte 8, then `data`. An entry is tag, type (3 for 16
/// bits, 4 for 32), count, and value or position.
pub fn tiff(entries: &[(u16, u16, u32, u32)], data: &[u8]) -> Vec<u8> {
    let mut out = b"II*\0\x08\0\0\0".to_vec();
    out.extend((entries.len() as u16).to_le_bytes());
    for &(tag, kind, count, value) in entries {
        out.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        out.extend([count.to_le_bytes(), value.to_le_bytes()].concat());
    }
    out.extend([0; 4]);
    out.extend(data);
    out
}

/// Position of the data in a [`tiff`] file with this many entries.
pub fn tiff_data(entries: usize) -> u32 {
    8 + 2 + 12 * entries as u32 + 4
}

/// The values of a tag.
#[derive(Clone, Copy)]
pub enum Values<'a> {
    Text(&'a str),
    Short(&'a [u16]),
    Long(&'a [u32]),
    Fraction(&'a [(u32, u32)]),
    Double(&'a [f64]),
}

/// A TIFF file of one image whose strips or tiles are `chunks`.
#[derive(Clone, Copy)]
pub struct Tiff<'a> {
    pub big_endian: bool,
    pub tiled: bool,
    /// All tags except the positions and sizes of `chunks`.
    pub tags: &'a [(u16, Values<'a>)],
    pub chunks: &'a [&'a [u8]],
}

impl Tiff<'_> {
    pub fn bytes(&self) -> Vec<u8> {
        let short = |v: u16| if self.big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        let long = |v: u32| if self.big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        let double = |v: f64| if self.big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
        let mut out = if self.big_endian { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
        out.extend(long(0));
        // Data that entries point to comes first.
        let mut places = Vec::new();
        for chunk in self.chunks {
            places.push(out.len() as u32);
            out.extend(*chunk);
        }
        let sizes: Vec<u32> = self.chunks.iter().map(|chunk| chunk.len() as u32).collect();
        let (offsets, counts) = if self.tiled { (324, 325) } else { (273, 279) };
        let mut tags = self.tags.to_vec();
        tags.extend([(offsets, Values::Long(&places)), (counts, Values::Long(&sizes))]);
        tags.sort_by_key(|(tag, _)| *tag);
        let mut entries = Vec::new();
        for (tag, values) in tags {
            let (kind, count, values) = match values {
                Values::Text(text) => (2, text.len() + 1, [text.as_bytes(), &[0]].concat()),
                Values::Short(v) => (3, v.len(), v.iter().flat_map(|v| short(*v)).collect()),
                Values::Long(v) => (4, v.len(), v.iter().flat_map(|v| long(*v)).collect()),
                Values::Fraction(v) => (
                    5,
                    v.len(),
                    v.iter().flat_map(|(a, b)| [long(*a), long(*b)].concat()).collect::<Vec<_>>(),
                ),
                Values::Double(v) => (12, v.len(), v.iter().flat_map(|v| double(*v)).collect()),
            };
            entries.extend([&short(tag)[..], &short(kind), &long(count as u32)].concat());
            if values.len() <= 4 {
                entries.extend(&values);
                entries.resize(entries.len() + 4 - values.len(), 0);
            } else {
                entries.extend(long(out.len() as u32));
                out.extend(values);
            }
        }
        let place = long(out.len() as u32);
        out[4..8].copy_from_slice(&place);
        out.extend(short((entries.len() / 12) as u16));
        out.extend(entries);
        out.extend(long(0));
        out
    }
}

/// A baseline JPEG file of 8 x 8 pixels in which each component has a single value. `adobe` is the colour
/// transform of its Adobe marker, without which the colours of four components are undefined; `exif` is the
/// contents of its Exif marker.
pub fn jpeg(components: &[u8], adobe: Option<u8>, exif: Option<&[u8]>) -> Vec<u8> {
    let segment = |mark: u8, data: &[u8]| {
        let length = (data.len() as u16 + 2).to_be_bytes();
        [&[0xff, mark][..], &length, data].concat()
    };
    let count = components.len() as u8;
    let mut out = vec![0xff, 0xd8];
    if let Some(exif) = exif {
        out.extend(segment(0xe1, &[b"Exif\0\0", exif].concat()));
    }
    if let Some(transform) = adobe {
        out.extend(segment(0xee, &[b"Adobe\0d\0\0\0\0".as_slice(), &[transform]].concat()));
    }
    // The mean of a block counts 8 times in its first coefficient.
    out.extend(segment(0xdb, &[&[0, 8][..], &[1; 63]].concat()));
    let frame = (1..=count).flat_map(|i| [i, 0x11, 0]);
    out.extend(segment(0xc0, &[8, 0, 8, 0, 8, count].into_iter().chain(frame).collect::<Vec<_>>()));
    // The first coefficient: 8 codes of 4 bits, for numbers of 0 to 7 bits. The others: one code of 1 bit,
    // for the end of the block.
    out.extend(segment(0xc4, &[&[0, 0, 0, 0, 8][..], &[0; 12], &[0, 1, 2, 3, 4, 5, 6, 7]].concat()));
    out.extend(segment(0xc4, &[&[0x10, 1][..], &[0; 15], &[0]].concat()));
    let scan = (1..=count).flat_map(|i| [i, 0]);
    let scan: Vec<u8> = [count].into_iter().chain(scan).chain([0, 63, 0]).collect();
    out.extend(segment(0xda, &scan));
    let mut bits = Vec::new();
    let mut put = |code: i32, width: u32| bits.extend((0..width).rev().map(|i| (code >> i & 1) as u8));
    for value in components {
        let difference = i32::from(*value) - 128;
        let width = 32 - difference.unsigned_abs().leading_zeros();
        put(width as i32, 4);
        put(if difference < 0 { difference + (1 << width) - 1 } else { difference }, width);
        put(0, 1);
    }
    put(0xff, 7);
    // The rest of the last byte is filled with ones.
    for byte in bits.chunks_exact(8) {
        let byte = byte.iter().fold(0, |byte, bit| byte << 1 | bit);
        out.push(byte);
        // A zero follows a byte of ones, to tell it from a marker.
        out.extend((byte == 0xff).then_some(0));
    }
    out.extend([0xff, 0xd9]);
    out
}

/// Exif data with the orientation of the camera: 1 upright, 6 rotated by a quarter turn.
pub fn exif_orientation(value: u8) -> Vec<u8> {
    [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".as_slice(), &[value, 0, 0, 0], &[0; 4]].concat()
}
