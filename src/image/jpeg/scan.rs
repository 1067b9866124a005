//! Checks that the coded data of a JPEG file has the length that its pixels need. The decoder silently fills
//! in missing data and ignores excess data. Only lengths are decoded here, not coefficients.

/// Bytes that may follow the data of a scan: some cameras add one, and their images are sound.
const SPARE: usize = 1;

/// The damage to the coded data of a file that was decoded, as the end of a sentence about that data; `None`
/// if it is sound or of an unsupported kind.
pub(super) fn damage(bytes: &[u8]) -> Option<String> {
    let mut file = File { bytes, at: 2, ..File::default() };
    loop {
        match file.segment()? {
            Segment::Scan => match file.scan() {
                Ok(()) => {}
                Err(Fault::Unknown) => return None,
                Err(Fault::Damage(reason)) => return Some(reason),
            },
            Segment::End => return None,
            Segment::Other => {}
        }
    }
}

/// The next segment of a file.
enum Segment {
    Scan,
    End,
    Other,
}

/// Why a scan could not be followed to its end.
enum Fault {
    Unknown,
    Damage(String),
}

impl Fault {
    fn damage(reason: &str) -> Self {
        Self::Damage(reason.into())
    }
}

type Result<T, E = Fault> = std::result::Result<T, E>;

#[derive(Default)]
struct File<'a> {
    bytes: &'a [u8],
    at: usize,
    progressive: bool,
    /// (width, height) of the image in units of interleaved blocks of all components.
    units: (usize, usize),
    components: Vec<Component>,
    /// The tables of first coefficients and of the others, by number.
    tables: [[Option<Table>; 4]; 2],
    /// Units between two restart markers; 0 for none.
    interval: usize,
    /// The header of the next scan.
    scan: Scan,
}

#[derive(Default)]
struct Component {
    id: u8,
    /// Blocks per unit, horizontally and vertically.
    sampling: (usize, usize),
    /// Blocks with pixels of the image, horizontally and vertically.
    blocks: (usize, usize),
    /// For each block, which coefficients are nonzero so far: later scans of a progressive file refine these.
    known: Vec<u64>,
}

#[derive(Clone, Default)]
struct Scan {
    /// Components, each with the numbers of its two tables.
    parts: Vec<(usize, [usize; 2])>,
    /// The first and the last coefficient.
    band: (usize, usize),
    /// Whether it refines known coefficients.
    refines: bool,
}

impl<'a> File<'a> {
    /// Reads the next segment, or the header of a scan; `None` at the end of the file.
    fn segment(&mut self) -> Option<Segment> {
        while *self.bytes.get(self.at)? != 0xff || matches!(self.bytes.get(self.at + 1)?, 0 | 0xff) {
            self.at += 1;
        }
        let marker = self.bytes[self.at + 1];
        self.at += 2;
        if marker == 0xd9 {
            return Some(Segment::End);
        }
        // Markers without a length.
        if matches!(marker, 0x01 | 0xd0..=0xd8) {
            return Some(Segment::Other);
        }
        let length = word(self.bytes.get(self.at..)?)?;
        let body = self.bytes.get(self.at + 2..self.at + length)?;
        self.at += length;
        match marker {
            0xc0..=0xc2 => self.frame(body, marker == 0xc2)?,
            // Arithmetic coding, and lossless files.
            0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf => return None,
            0xc4 => self.codes(body)?,
            0xdd => self.interval = word(body)?,
            0xda => {
                self.scan = self.head(body)?;
                return Some(Segment::Scan);
            }
            _ => {}
        }
        Some(Segment::Other)
    }

    fn frame(&mut self, body: &[u8], progressive: bool) -> Option<()> {
        let (height, width) = (word(body.get(1..)?)?, word(body.get(3..)?)?);
        let all = body.get(6..)?.chunks_exact(3);
        let sampling = |part: &[u8]| (usize::from(part[1] >> 4), usize::from(part[1] & 15));
        let (across, down) =
            all.clone().map(sampling).fold((0, 0), |most, (h, v)| (h.max(most.0), v.max(most.1)));
        if width == 0 || height == 0 || all.clone().map(sampling).any(|(h, v)| h == 0 || v == 0) {
            return None;
        }
        self.progressive = progressive;
        self.units = (width.div_ceil(8 * across), height.div_ceil(8 * down));
        let component = |part: &[u8]| {
            let (h, v) = sampling(part);
            let blocks = ((width * h).div_ceil(across).div_ceil(8), (height * v).div_ceil(down).div_ceil(8));
            let count = if progressive { self.units.0 * h * self.units.1 * v } else { 0 };
            Component { id: part[0], sampling: (h, v), blocks, known: vec![0; count] }
        };
        self.components = all.map(component).collect();
        Some(())
    }

    fn codes(&mut self, mut body: &[u8]) -> Option<()> {
        while let Some((&which, rest)) = body.split_first() {
            let (counts, rest) = rest.split_at_checked(16)?;
            let count = counts.iter().map(|count| usize::from(*count)).sum();
            let (values, rest) = rest.split_at_checked(count)?;
            let kind = self.tables.get_mut(usize::from(which >> 4))?;
            *kind.get_mut(usize::from(which & 15))? = Some(Table::new(counts, values));
            body = rest;
        }
        Some(())
    }

    fn head(&self, body: &[u8]) -> Option<Scan> {
        let (count, rest) = body.split_first()?;
        let (parts, rest) = rest.split_at_checked(2 * usize::from(*count))?;
        let part = |part: &[u8]| {
            let component = self.components.iter().position(|component| component.id == part[0])?;
            Some((component, [part[1] >> 4, part[1] & 15].map(|which| usize::from(which & 3))))
        };
        let parts = parts.chunks_exact(2).map(part).collect::<Option<Vec<_>>>()?;
        let &[first, last, bits] = rest.first_chunk()?;
        let band = if self.progressive { (first.into(), last.into()) } else { (0, 63) };
        let makes_sense = !parts.is_empty() && band.0 <= band.1 && band.1 < 64;
        makes_sense.then_some(Scan { parts, band, refines: self.progressive && bits >> 4 != 0 })
    }

    /// Follows the data of the scan up to the next marker.
    fn scan(&mut self) -> Result<()> {
        let scan = std::mem::take(&mut self.scan);
        // A scan of a single component has no blocks beyond the image.
        let alone = match scan.parts[..] {
            [(one, _)] => Some(self.components[one].blocks),
            _ => None,
        };
        let (width, height) = alone.unwrap_or(self.units);
        let interval = if self.interval == 0 { width * height } else { self.interval };
        let (mut bits, mut run, mut restarts) = (self.coded(), 0, 0);
        for unit in 0..width * height {
            if unit > 0 && unit % interval == 0 {
                bits.end()?;
                let marker = [0xff, 0xd0 + restarts % 8];
                if self.bytes.get(self.at..self.at + 2) != Some(&marker) {
                    return Err(Fault::damage("a restart marker is not where it should be"));
                }
                self.at += 2;
                (bits, run, restarts) = (self.coded(), 0, restarts + 1);
            }
            for (which, tables) in &scan.parts {
                let (h, v) = if alone.is_some() { (1, 1) } else { self.components[*which].sampling };
                let (x, y) = (unit % width * h, unit / width * v);
                for (dx, dy) in (0..v).flat_map(|dy| (0..h).map(move |dx| (dx, dy))) {
                    let tables = [0, 1].map(|kind| self.tables[kind][tables[kind]].as_ref());
                    let component = &mut self.components[*which];
                    if self.progressive {
                        let across = self.units.0 * component.sampling.0;
                        let known = &mut component.known[(y + dy) * across + x + dx];
                        bits.progressive_block(tables, &scan, known, &mut run)?;
                    } else {
                        bits.block(tables)?;
                    }
                }
            }
            if bits.ended_early() {
                return Err(Fault::damage("it ends before the pixels do"));
            }
        }
        bits.end()
    }

    /// The coded data up to the next marker, to which the file position moves.
    fn coded(&mut self) -> Bits<'a> {
        let rest = &self.bytes[self.at..];
        let is_marker = |pair: &[u8]| pair[0] == 0xff && pair[1] != 0 && pair[1] != 0xff;
        let length = rest.windows(2).position(is_marker).unwrap_or(rest.len());
        self.at += length;
        Bits { bytes: &rest[..length], at: 0, buffer: 0, count: 0, missing: 0 }
    }
}

fn word(bytes: &[u8]) -> Option<usize> {
    bytes.first_chunk().map(|two| u16::from_be_bytes(*two).into())
}

/// A Huffman table.
struct Table {
    /// By the next eight bits: the length and the value of the code; a length of 0 if the code is longer.
    short: [(u8, u8); 256],
    /// For each length: the end of its codes as 16 bits, and the index of its first value minus its first code.
    longer: [(u32, i32); 17],
    values: Vec<u8>,
}

impl Table {
    fn new(counts: &[u8], values: &[u8]) -> Self {
        let mut table = Self { short: [(0, 0); 256], longer: [(0, 0); 17], values: values.to_vec() };
        let (mut code, mut first) = (0_u32, 0);
        for (length, count) in (1_u32..).zip(counts) {
            table.longer[length as usize].1 = first - code as i32;
            for _ in 0..*count {
                if length <= 8 {
                    let start = (code << (8 - length)) as usize;
                    let value = values[first as usize];
                    let end = (start + (1 << (8 - length))).min(256);
                    if start < end {
                        table.short[start..end].fill((length as u8, value));
                    }
                }
                (code, first) = (code + 1, first + 1);
            }
            table.longer[length as usize].0 = code << (16 - length);
            code <<= 1;
        }
        table
    }
}

/// Reads coded data bit by bit.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The next bits, the first one highest, and their number.
    buffer: u64,
    count: u32,
    /// How many of these are beyond the end of the data.
    missing: u32,
}

impl Bits<'_> {
    fn fill(&mut self) {
        while self.count <= 56 {
            let byte = if let Some(byte) = self.bytes.get(self.at) {
                // A stuffed 0 follows a byte 0xff that is not a marker.
                self.at += if *byte == 0xff { 2 } else { 1 };
                *byte
            } else {
                self.missing += 8;
                0
            };
            self.buffer |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    fn take(&mut self, count: u8) -> u32 {
        if count == 0 {
            return 0;
        }
        if self.count < 32 {
            self.fill();
        }
        let taken = (self.buffer >> (64 - count)) as u32;
        self.buffer <<= count;
        self.count -= u32::from(count);
        taken
    }

    fn code(&mut self, table: &Table) -> Result<u8> {
        if self.count < 32 {
            self.fill();
        }
        let (length, value) = table.short[(self.buffer >> 56) as usize];
        if length > 0 {
            self.take(length);
            return Ok(value);
        }
        let next = (self.buffer >> 48) as u32;
        let length = (9..17).find(|length| next < table.longer[*length].0);
        let Some(length) = length else { return Err(self.fault("it has a code without a meaning")) };
        let code = self.take(length as u8) as i32;
        let value = usize::try_from(code + table.longer[length].1).ok().and_then(|at| table.values.get(at));
        value.copied().ok_or_else(|| self.fault("it has a code without a meaning"))
    }

    /// A fault of the data; after its end, the fault is that it ended early.
    fn fault(&self, reason: &str) -> Fault {
        Fault::damage(if self.ended_early() { "it ends before the pixels do" } else { reason })
    }

    /// Whether bits beyond the end of the data were read.
    fn ended_early(&self) -> bool {
        self.missing > self.count
    }

    /// Follows a block of a baseline file.
    fn block(&mut self, [first, others]: [Option<&Table>; 2]) -> Result<()> {
        let (Some(first), Some(others)) = (first, others) else { return Err(Fault::Unknown) };
        let bits = self.code(first)?;
        self.bits_of_first(bits)?;
        let mut at = 1;
        while at < 64 {
            let code = self.code(others)?;
            let (zeros, bits) = (usize::from(code >> 4), code & 15);
            if bits > 0 {
                at += zeros;
                self.take(bits);
            } else if zeros == 15 {
                at += zeros;
            } else {
                break;
            }
            at += 1;
            if at > 64 {
                return Err(self.fault("a block of it has more than 64 coefficients"));
            }
        }
        Ok(())
    }

    /// Follows a block in a scan of a progressive file. The coefficients in `known` are nonzero; `run` is the
    /// number of blocks still to come without new ones.
    fn progressive_block(
        &mut self,
        [first, others]: [Option<&Table>; 2],
        scan: &Scan,
        known: &mut u64,
        run: &mut u32,
    ) -> Result<()> {
        let (start, end) = scan.band;
        if start == 0 {
            let bits = if scan.refines { 1 } else { self.code(first.ok_or(Fault::Unknown)?)? };
            return self.bits_of_first(bits);
        }
        let others = others.ok_or(Fault::Unknown)?;
        let mut at = start;
        while *run == 0 && at <= end {
            let code = self.code(others)?;
            let (mut zeros, bits) = (u32::from(code >> 4), code & 15);
            if bits == 0 && zeros < 15 {
                *run = (1 << zeros) + self.take(zeros as u8);
                break;
            }
            self.take(bits);
            // Known coefficients do not count as zeros, and have a correction bit each.
            while at <= end {
                if scan.refines && *known & 1 << at != 0 {
                    self.take(1);
                } else if zeros == 0 {
                    break;
                } else {
                    zeros -= 1;
                }
                at += 1;
            }
            if bits > 0 {
                if at > end || scan.refines && bits > 1 {
                    return Err(self.fault("a block of it has a coefficient that cannot be"));
                }
                *known |= 1 << at;
            }
            at += 1;
        }
        if *run > 0 {
            (at..=end).filter(|at| scan.refines && *known & 1 << at != 0).for_each(|_| _ = self.take(1));
            *run -= 1;
        }
        Ok(())
    }

    /// Skips the bits of a first coefficient.
    fn bits_of_first(&mut self, bits: u8) -> Result<()> {
        if bits > 11 {
            return Err(self.fault("a block of it has a coefficient that cannot be"));
        }
        self.take(bits);
        Ok(())
    }

    /// Fails if data is left before the marker.
    fn end(&self) -> Result<()> {
        if self.ended_early() {
            return Err(Fault::damage("it ends before the pixels do"));
        }
        let here = self.count.saturating_sub(self.missing) as usize / 8;
        let left = here + self.bytes.len().saturating_sub(self.at);
        if left > SPARE {
            return Err(Fault::Damage(format!("{left} bytes of it belong to no pixel")));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of one grey component in blocks of 8 x 8. The code 0 is a first coefficient without change; of
    /// the others, 0 ends a block, and 10 is a coefficient of one bit.
    fn file(frame: u8, width: u8, interval: u8, scans: &[([u8; 3], &[u8])]) -> Vec<u8> {
        let mut bytes = vec![0xff, 0xd8];
        let mut segment = |marker: u8, body: &[u8], data: &[u8]| {
            bytes.extend([&[0xff, marker, 0, body.len() as u8 + 2], body, data].concat());
        };
        segment(0xdb, &[&[0][..], &[1; 64]].concat(), &[]);
        segment(frame, &[8, 0, 8, 0, width, 1, 1, 0x11, 0], &[]);
        let counts = |first, second| [&[first, second][..], &[0; 14]].concat();
        segment(0xc4, &[&[0x00][..], &counts(1, 0), &[0]].concat(), &[]);
        segment(0xc4, &[&[0x10][..], &counts(1, 1), &[0x00, 0x01]].concat(), &[]);
        segment(0xdd, &[0, interval], &[]);
        for (band, data) in scans {
            segment(0xda, &[&[1, 1, 0][..], band].concat(), data);
        }
        bytes.extend([0xff, 0xd9]);
        bytes
    }

    fn whole(width: u8, interval: u8, data: &[u8]) -> Vec<u8> {
        file(0xc0, width, interval, &[([0, 63, 0], data)])
    }

    fn is_damaged(bytes: &[u8], words: &str) {
        let said = damage(bytes);
        assert!(said.as_ref().is_some_and(|said| said.contains(words)), "{said:?} for {words}");
    }

    #[test]
    fn sound_data_has_the_length_of_its_pixels() {
        let restarts = [0x3f, 0xff, 0xd0, 0x3f];
        for sound in [whole(16, 0, &[0x0f]), whole(16, 0, &[0x0f, 7]), whole(16, 1, &restarts)] {
            assert!(super::super::decode(&sound, 1 << 20).is_ok());
            assert_eq!(damage(&sound), None);
        }
        is_damaged(&whole(16, 0, &[]), "ends before the pixels do");
        is_damaged(&whole(40, 0, &[0]), "ends before the pixels do");
        is_damaged(&whole(16, 0, &[0x0f, 7, 7]), "2 bytes of it belong to no pixel");
        is_damaged(&whole(16, 0, &[0xff, 0]), "a code without a meaning");
        is_damaged(&whole(16, 1, &[0x0f]), "a restart marker is not where it should be");
        is_damaged(&whole(16, 1, &[0x3f, 0xff, 0xd1, 0x3f]), "a restart marker");
        // A block of 63 more coefficients, 101 each, is full; one with more is invalid.
        let coefficients = |count: usize| {
            let bits = std::iter::once(0).chain([1, 0, 1].into_iter().cycle().take(3 * count)).chain([1; 7]);
            let bits: Vec<u8> = bits.collect();
            bits.chunks_exact(8)
                .map(|eight| eight.iter().fold(0, |all, bit| all << 1 | bit))
                .collect::<Vec<u8>>()
        };
        assert_eq!(damage(&whole(8, 0, &coefficients(63))), None);
        is_damaged(&whole(8, 0, &coefficients(80)), "bytes of it belong to no pixel");
    }

    /// A refining scan has a correction bit for each known coefficient.
    #[test]
    fn refining_scans_know_earlier_coefficients() {
        let progressive = |last: &[u8]| {
            let scans = [([0, 0, 0], &[0; 3][..]), ([1, 63, 0x01], &[0xaa; 12]), ([1, 63, 0x10], last)];
            file(0xc2, 192, 0, &scans)
        };
        let sound = progressive(&[0x55; 6]);
        assert!(super::super::decode(&sound, 1 << 20).is_ok());
        assert_eq!(damage(&sound), None);
        is_damaged(&progressive(&[0x55; 3]), "ends before the pixels do");
        is_damaged(&progressive(&[0x55; 8]), "2 bytes of it");
    }

    /// No bytes cause a panic.
    #[test]
    fn damaged_headers_do_no_harm() {
        let files = [whole(16, 1, &[0x3f, 0xff, 0xd0, 0x3f]), file(0xc2, 16, 0, &[([0, 0, 0], &[0x3f])])];
        for sound in files {
            for at in 0..sound.len() {
                let _ = damage(&sound[..at]);
                for byte in [0, 1, 0x0f, 0x7f, 0xc4, 0xff] {
                    let mut damaged = sound.clone();
                    damaged[at] = byte;
                    let _ = damage(&damaged);
                }
            }
        }
    }
}
