//! Reads SQLite tables row by row, from possibly damaged files. (SQLite itself would need a C compiler, and only two tables of a bag are
//! read, from start to end.) The format: <https://www.sqlite.org/fileformat2.html>.

use std::fs;
use std::io::Read;
use std::path::PathBuf;

use mrfgs::Result;
use mrfgs::error::Reason;

use super::file::{File, MAX_RECORD};
use super::place::Place;

/// The first bytes of a database.
pub(super) const MAGIC: &[u8] = b"SQLite format 3\0";

/// Length of the database header at the start of the first page.
const HEAD: usize = 100;
/// Maximum depth of a table's tree, more than 2^31 pages can have.
const DEEPEST: usize = 40;
/// Kinds of pages.
const INTERIOR: u8 = 5;
const LEAF: u8 = 13;

/// Endings of files beside a database that was not closed.
const UNFINISHED: [&str; 2] = ["-wal", "-journal"];

/// A database.
pub(super) struct Database {
    file: File,
    page_size: usize,
    /// Usable bytes of a page, without reserved bytes at its end.
    usable: usize,
    pages: u64,
}

/// The root page of a table, and its column names.
pub(super) struct Table {
    root: u64,
    columns: Vec<String>,
}

/// The position in a table.
pub(super) struct Rows {
    /// The pages from the root down to the current row.
    way: Vec<Page>,
    root: Option<u64>,
    /// The number of pages that may still be visited, as each belongs to a table once.
    left: u64,
}

/// A page of a table, with the index of its next cell.
struct Page {
    bytes: Vec<u8>,
    /// The offset of the page header; on the first page it follows the database header.
    start: usize,
    cell: usize,
}

/// A row, whose last part may be on overflow pages.
pub(super) struct Row {
    /// The row id, which is its column of type INTEGER PRIMARY KEY.
    pub(super) id: i64,
    bytes: Vec<u8>,
    length: u64,
    /// The first overflow page; 0 for none.
    more: u64,
}

/// The value of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    /// NULL or a float.
    Other,
    Integer(i64),
    /// A blob or a text.
    Bytes(&'a [u8]),
}

impl Database {
    pub(super) fn open(place: &Place) -> Result<Self> {
        let mut file = File::open(place)?;
        if file.left() < HEAD as u64 {
            return Err(file.error("is not an SQLite database: it is shorter than its header"));
        }
        let head = file.take(HEAD as u64)?;
        if !head.starts_with(MAGIC) {
            return Err(file.error("is not an SQLite database: it does not start like one"));
        }
        for end in UNFINISHED {
            let beside = PathBuf::from(format!("{}{end}", place.path.display()));
            // SQLite zeroes or truncates the header of a journal it no longer needs.
            let mut first = [0];
            let is_used = fs::File::open(&beside).and_then(|mut beside| beside.read(&mut first)).is_ok();
            if is_used && first != [0] {
                return Err(file.error(format!(
                    "was not closed, and {} contains its last changes; merge them with `sqlite3 FILE 'PRAGMA wal_checkpoint(TRUNCATE)'`",
                    beside.display()
                )));
            }
        }
        let page_size = match number(&head[16..18]) {
            1 => 1 << 16,
            size if size.is_power_of_two() && size >= 512 => size,
            _ => return Err(file.error("is a damaged database: its page size is invalid")),
        };
        let usable = page_size.saturating_sub(u64::from(head[20]));
        // 1 is UTF-8, 0 a database without tables.
        if usable < 480 || number(&head[56..60]) > 1 {
            return Err(file.error("is a damaged database, or its texts are not UTF-8"));
        }
        let pages = file.len() / page_size;
        Ok(Self { file, page_size: page_size as usize, usable: usable as usize, pages })
    }

    /// An error of the file, with a reason worded to follow its name.
    pub(super) fn error(&self, reason: impl Into<Reason>) -> mrfgs::Error {
        self.file.error(reason)
    }

    /// The table called `name`; `None` if there is none.
    pub(super) fn table(&mut self, name: &str) -> Result<Option<Table>> {
        // The schema table: type, name, table name, root page and SQL of each table.
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

    /// The rows of a table, ordered by row id.
    pub(super) fn rows(&self, table: &Table) -> Rows {
        Rows { way: Vec::new(), root: Some(table.root), left: self.pages }
    }

    /// Completes a row from its overflow pages.
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
            return Err(self.error("is a damaged database: a page is missing"));
        }
        let at = (which - 1).saturating_mul(self.page_size as u64);
        if at.saturating_add(self.page_size as u64) > self.file.len() {
            return Err(self.error(format!(
                "is cut off: page {which} is beyond its end of {} bytes; complete messages are used",
                self.file.len()
            )));
        }
        self.file.seek(at)?;
        self.file.take(self.page_size as u64)
    }

    /// The row in a cell of a leaf page; `None` if the cell is damaged.
    fn row(&self, page: &[u8], at: usize) -> Option<Row> {
        let mut rest = page.get(at..self.usable)?;
        let length = varint(&mut rest)?;
        let id = varint(&mut rest)?.cast_signed();
        let usable = self.usable as u64;
        // SQLite keeps enough of a row on its page that four rows fit, and stores the rest on overflow pages.
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
    /// The position of the column called `name`.
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
        let damaged = "is a damaged database: a page is invalid";
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
            return Err(database.error("is a damaged database: its pages form a cycle"));
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

    /// The number of cells.
    fn count(&self) -> usize {
        number(&self.bytes[self.start + 3..self.start + 5]) as usize
    }

    /// The offset of a cell.
    fn place(&self, cell: usize) -> Option<usize> {
        let first = self.start + if self.kind() == INTERIOR { 12 } else { 8 };
        let at = self.bytes.get(first + 2 * cell..first + 2 * cell + 2)?;
        Some(number(at) as usize)
    }

    /// The child page of a cell of an interior page; the last one is in the page header.
    fn child(&self, cell: usize) -> Option<u64> {
        let at = if cell == self.count() { self.start + 8 } else { self.place(cell)? };
        self.bytes.get(at..at + 4).map(number)
    }
}

impl Row {
    /// The value of a column, as far as the row is loaded.
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
                // The sign is in the first byte.
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

/// The size in bytes of a value of this type.
fn length(kind: u64) -> u64 {
    match kind {
        1..=4 => kind,
        5 => 6,
        6 | 7 => 8,
        12.. => (kind - 12) / 2,
        _ => 0,
    }
}

/// Takes a varint of up to nine bytes off `bytes`: seven bits each, most significant first, and eight bits in the ninth.
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

/// A big-endian number.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0, |all, byte| all << 8 | u64::from(*byte))
}

/// The column names in a CREATE TABLE statement.
fn columns(words: &str) -> Vec<String> {
    let list = words.split_once('(').map_or("", |(_, list)| list);
    let name = |column: &str| column.split_whitespace().next().unwrap_or_default().to_owned();
    list.split(',').map(|column| name(column).trim_matches(['"', '`', '[', ']', ')']).to_owned()).collect()
}
