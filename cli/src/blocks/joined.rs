//! Joins the maps of blocks, band by band, so that the memory is that of a band.

use mrfgs::image::Rect;
use mrfgs::maps::Maps;

use crate::blocks::folder::BlockFiles;
use crate::blocks::stored::Rows;

/// Most rows of a band.
const ROWS: usize = 256;

/// The maps of a whole view as bands of rows, from the top.
pub(crate) struct Bands<'a> {
    files: &'a BlockFiles,
    /// The next block that is not open.
    next: usize,
    /// The blocks of the current row of blocks, with their columns.
    open: Vec<(Rect, Rows)>,
    /// Rows that are left of them.
    left: usize,
}

impl<'a> Bands<'a> {
    /// The bands of the joined blocks, which are all complete.
    pub(crate) fn of(files: &'a BlockFiles) -> Self {
        Self { files, next: 0, open: Vec::new(), left: 0 }
    }

    /// Opens the next row of blocks; false after the last.
    fn open(&mut self) -> mrfgs::Result<bool> {
        self.open.clear();
        let parts = self.files.parts();
        let Some(first) = parts.get(self.next) else { return Ok(false) };
        while let Some(part) = parts.get(self.next).filter(|part| part.y == first.y) {
            self.open.push((part.clone(), self.files.complete_rows(self.next)?));
            self.next += 1;
        }
        self.left = first.y.len();
        Ok(true)
    }

    fn band(&mut self) -> mrfgs::Result<Option<Maps>> {
        if self.left == 0 && !self.open()? {
            return Ok(None);
        }
        let rows = self.left.min(ROWS);
        self.left -= rows;
        let mut band: Option<Maps> = None;
        for (part, of_block) in &mut self.open {
            let maps = of_block.next(rows)?;
            let size = (self.files.size().0, rows);
            let band = band.get_or_insert_with(|| Maps::blank(size, maps.right.is_some()));
            band.paste(&maps, &Rect { x: part.x.clone(), y: 0..rows });
        }
        Ok(band)
    }
}

impl Iterator for Bands<'_> {
    type Item = mrfgs::Result<Maps>;

    fn next(&mut self) -> Option<Self::Item> {
        self.band().transpose()
    }
}
