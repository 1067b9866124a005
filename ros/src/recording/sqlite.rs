//! Tables of SQLite, row by row, from files that need not be sound. (SQLite itself is C, which nothing else here takes a compiler for, and
//! of a bag two tables are read from their start to their end.) The format is that of <https://www.sqlite.org/fileformat2.html>.

use std::fs;
use std::io::Read;
use std::path::PathBuf;

use mrfgs::Result;
use mrfgs::error::Reason;

use super::file::{File, MAX_RECORD};
use super::place::Place;

/// How such a file begins.
pub(super) const MAGIC: &[u8] = b"SQLite format 3\0";

/// Bytes of the file before its first page begins as others do.
const HEAD: usize = 100;
/// Most pages between the root of a table and a row: more than any table of 2^31 pages has.
const DEEPEST: usize = 40;
/// Kinds of pages.
const INTERIOR: u8 = 5;
const LEAF: u8 = 13;

/// What stands beside a file that was not closed.
const UNFINISHED: [&str; 2] = ["-wal", "-journal"];

/// A file with tables.
pub(super) struct Database {
    file: File,
    page_size: usize,
    /// What is used of each page: some leave bytes at its end to others.
    usable: usize,
    pages: u64,
}

/// Where a table is, and how its columns are called.
pub(super) struct Table {
    root: u64,
    columns: Vec<String>,
}

/// The way down to the next row of a table.
pub(super) struct Rows {
    /// The page at the root, and so on down to that of the row.
    way: Vec<Page>,
    root: Option<u64>,
    /// How many pages may still come: each belongs to a table once.
    left: u64,
}

/// A page of a table, and which of its cells comes next.
struct Page {
    bytes: Vec<u8>,
    /// Where what all pages have begins: the first one has the head of the file before it.
    start: usize,
    cell: usize,
}

/// A row, of which the last part may be on other pages.
pub(super) struct Row {
    /// Its number, which is its column of the type INTEGER PRIMARY KEY.
    pub(super) id: i64,
    bytes: Vec<u8>,
    length: u64,
    /// The page with the rest; 0 where there is none.
    more: u64,
}

/// What stands in a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    /// Nothing, or a number that is no integer.
    Other,
    Integer(i64),
    /// A text, too.
    Bytes(&'a [u8]),
}

impl Database {
    pub(super) fn open(place: &Place) -> Result<Self> {
        let mut file = File::open(place)?;
        if file.left() < HEAD as u64 {
            return Err(file.error("is no database of SQLite: it is shorter than its head"));
        }
        let head = file.take(HEAD as u64)?;
        if !head.starts_with(MAGIC) {
            return Err(file.error("is no database of SQLite: it does not begin as one"));
        }
        for end in UNFINISHED {
            let beside = PathBuf::from(format!("{}{end}", place.path.display()));
            // One that was done with begins with a 0, or is empty.
            let mut first = [0];
            let is_used = fs::File::open(&beside).and_then(|mut beside| beside.read(&mut first)).is_ok();
            if is_used && first != [0] {
                return Err(file.error(format!(
                    "was not closed, and {} says what came last; `sqlite3 FILE 'PRAGMA wal_checkpoint(TRUNCATE)'` takes it in",
                    beside.display()
                )));
            }
        }
        let page_size = match number(&head[16..18]) {
            1 => 1 << 16,
            size if size.is_power_of_two() && size >= 512 => size,
            _ => return Err(file.error("is a damaged database: its pages have no size")),
        };
        let usable = page_size.saturating_sub(u64::from(head[20]));
        // 1 is UTF-8, and 0 that of a file without a table.
        if usable < 480 || number(&head[56..60]) > 1 {
            return Err(file.error("is a damaged database, or its texts are not in UTF-8"));
        }
        let pages = file.len() / page_size;
        Ok(Self { file, page_size: page_size as usize, usable: usable as usize, pages })
    }

    /// An error of the file, in words that go after its name.
    pub(super) fn error(&self, reason: impl Into<Reason>) -> mrfgs::Error {
        self.file.error(reason)
    }

    /// The table called `name`; `None` where there is none.
    pub(super) fn table(&mut self, name: &str) -> Result<Option<Table>> {
        // The table of all tables: its type, name, table, root, and the words that made it.
        let mut rows = self.rows(&Table { root: 1, columns: Vec::new() });
        while let Some(row) = rows.next(self)? {
            let row = self.whole(row)?;
            let values = [0, 1, 3, 4].map(|column| row.value(column));
            if let [Value::Bytes(b"table"), Value::Bytes(own), Value::Integer(root), Value::Bytes(words)] =
                values
                && own == name.as_bytes()
            {
                let columns = columns(&String::from_utf8_lossy(words));
                return Ok(Some(Table { root: root.max(0).unsigned_abs(), columns }));
            }
        }
        Ok(None)
    }

    /// The rows of a table, by their numbers.
    pub(super) fn rows(&self, table: &Table) -> Rows {
        Rows { way: Vec::new(), root: Some(table.root), left: self.pages }
    }

    /// The row with its last part.
    pub(super) fn whole(&mut self, mut row: Row) -> Result<Row> {
        if row.length > MAX_RECORD.min(self.file.len()) {
            return Err(
                self.error(format!("is a damaged database: row {} claims {} bytes", row.id, row.length))
            );
        }
        while row.more != 0 && (row.bytes.len() as u64) < row.length {
            let page = self.page(row.more)?;
            let missing = (row.length - row.bytes.len() as u64).min(self.usable as u64 - 4) as usize;
            row.bytes.extend_from_slice(&page[4..4 + missing]);
            row.more = number(&page[..4]);
        }
        if row.bytes.len() as u64 != row.length {
            return Err(self.error(format!("is a damaged database: the end of row {} is missing", row.id)));
        }
        Ok(row)
    }

    fn page(&mut self, which: u64) -> Result<Vec<u8>> {
        if which == 0 {
            return Err(self.error("is a damaged database: a page of it is missing"));
        }
        let at = (which - 1).saturating_mul(self.page_size as u64);
        if at.saturating_add(self.page_size as u64) > self.file.len() {
            return Err(self.error(format!(
                "is cut off: page {which} is beyond its end of {} bytes; what is whole before it counts",
                self.file.len()
            )));
        }
        self.file.seek(at)?;
        self.file.take(self.page_size as u64)
    }

    /// The row in a cell of a leaf; `None` where the cell is damaged.
    fn row(&self, page: &[u8], at: usize) -> Option<Row> {
        let mut rest = page.get(at..self.usable)?;
        let length = varint(&mut rest)?;
        let id = varint(&mut rest)?.cast_signed();
        let usable = self.usable as u64;
        // As much stays on the page as leaves room for four rows, and the rest fills other pages.
        let most = usable - 35;
        let least = (usable - 12) * 32 / 255 - 23;
        let local = if length <= most {
            length
        } else {
            let even = least + (length - least) % (usable - 4);
            if even <= most { even } else { least }
        };
        let (bytes, rest) = rest.split_at_checked(local as usize)?;
        let more = if local < length { number(rest.get(..4)?) } else { 0 };
        Some(Row { id, bytes: bytes.to_vec(), length, more })
    }
}

impl Table {
    /// Which column is called `name`.
    pub(super) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.eq_ignore_ascii_case(name))
    }
}

impl Rows {
    /// The next row, as far as it is on its page.
    pub(super) fn next(&mut self, database: &mut Database) -> Result<Option<Row>> {
        if let Some(root) = self.root.take() {
            self.descend(database, root)?;
        }
        let damaged = "is a damaged database: a page of it makes no sense";
        while let Some(page) = self.way.last_mut() {
            let cell = page.cell;
            page.cell += 1;
            let count = page.count();
            match page.kind() {
                LEAF if cell < count => {
                    let row = page.place(cell).and_then(|at| database.row(&page.bytes, at));
                    return row.map(Some).ok_or_else(|| database.error(damaged));
                }
                INTERIOR if cell <= count => {
                    let child = page.child(cell).ok_or_else(|| database.error(damaged))?;
                    self.descend(database, child)?;
                }
                LEAF | INTERIOR => _ = self.way.pop(),
                _ => return Err(database.error(damaged)),
            }
        }
        Ok(None)
    }

    fn descend(&mut self, database: &mut Database, page: u64) -> Result<()> {
        if self.way.len() == DEEPEST || self.left == 0 {
            return Err(database.error("is a damaged database: its pages go round in a circle"));
        }
        self.left -= 1;
        let start = if page == 1 { HEAD } else { 0 };
        self.way.push(Page { bytes: database.page(page)?, start, cell: 0 });
        Ok(())
    }
}

impl Page {
    fn kind(&self) -> u8 {
        self.bytes[self.start]
    }

    /// How many cells it has.
    fn count(&self) -> usize {
        number(&self.bytes[self.start + 3..self.start + 5]) as usize
    }

    /// Where a cell begins.
    fn place(&self, cell: usize) -> Option<usize> {
        let first = self.start + if self.kind() == INTERIOR { 12 } else { 8 };
        let at = self.bytes.get(first + 2 * cell..first + 2 * cell + 2)?;
        Some(number(at) as usize)
    }

    /// The page below a cell of an interior page; that of the last one stands in its head.
    fn child(&self, cell: usize) -> Option<u64> {
        let at = if cell == self.count() { self.start + 8 } else { self.place(cell)? };
        self.bytes.get(at..at + 4).map(number)
    }
}

impl Row {
    /// What stands in a column, as far as the row is there.
    pub(super) fn value(&self, column: usize) -> Value<'_> {
        self.found(column).unwrap_or(Value::Other)
    }

    fn found(&self, column: usize) -> Option<Value<'_>> {
        let mut types = &self.bytes[..];
        let size = varint(&mut types)? as usize;
        let read = self.bytes.len() - types.len();
        let (mut types, mut values) = (types.get(..size.checked_sub(read)?)?, self.bytes.get(size..)?);
        for _ in 0..column {
            let length = length(varint(&mut types)?);
            values = values.get(usize::try_from(length).ok()?..)?;
        }
        let kind = varint(&mut types)?;
        let value = values.get(..usize::try_from(length(kind)).ok()?)?;
        Some(match kind {
            1..=6 => {
                // Of fewer than eight bytes the sign is in the first one.
                let sign = if value[0] & 0x80 == 0 { 0 } else { -1_i64 };
                Value::Integer(value.iter().fold(sign, |all, byte| all << 8 | i64::from(*byte)))
            }
            8 => Value::Integer(0),
            9 => Value::Integer(1),
            12.. => Value::Bytes(value),
            _ => Value::Other,
        })
    }
}

/// The bytes of a value of this type.
fn length(kind: u64) -> u64 {
    match kind {
        1..=4 => kind,
        5 => 6,
        6 | 7 => 8,
        12.. => (kind - 12) / 2,
        _ => 0,
    }
}

/// The number of up to nine bytes at the beginning of `bytes`, which is taken off: seven bits in each, highest first, and eight in the
/// ninth.
fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut all = 0;
    for n in 0..9 {
        let (byte, rest) = bytes.split_first()?;
        *bytes = rest;
        if n == 8 {
            return Some(all << 8 | u64::from(*byte));
        }
        all = all << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some(all);
        }
    }
    None
}

/// A number whose highest byte comes first.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0, |all, byte| all << 8 | u64::from(*byte))
}

/// The names of the columns in the words that make a table.
fn columns(words: &str) -> Vec<String> {
    let list = words.split_once('(').map_or("", |(_, list)| list);
    let name = |column: &str| column.split_whitespace().next().unwrap_or_default().to_owned();
    list.split(',').map(|column| name(column).trim_matches(['"', '`', '[', ']', ')']).to_owned()).collect()
}
