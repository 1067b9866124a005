//! Tables for a terminal.

use std::fmt;

/// A table whose columns fit their widest cell, in groups separated by `|`.
pub(crate) struct Table {
    /// The alignment of each column, by group: `l` or `r`.
    groups: Vec<Vec<char>>,
    lines: Vec<Line>,
}

enum Line {
    /// A cell per column; missing cells at the end are empty.
    Row(Vec<String>),
    /// A title per group, centred over its columns.
    Titles(Vec<String>),
    /// A rule across the table.
    Rule,
    /// Free text.
    Text(String),
}

impl Table {
    /// An empty table. `columns` has an `l` or `r` per column, for left or right alignment, and a `|` between groups.
    pub(crate) fn new(columns: &str) -> Self {
        let groups = columns.split('|').map(|group| group.chars().collect());
        Self { groups: groups.collect(), lines: Vec::new() }
    }

    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.lines.push(Line::Row(cells.into_iter().map(Into::into).collect()));
    }

    pub(crate) fn titles(&mut self, titles: impl IntoIterator<Item = impl Into<String>>) {
        self.lines.push(Line::Titles(titles.into_iter().map(Into::into).collect()));
    }

    pub(crate) fn rule(&mut self) {
        self.lines.push(Line::Rule);
    }

    pub(crate) fn text(&mut self, text: impl Into<String>) {
        self.lines.push(Line::Text(text.into()));
    }

    /// The width of each column, by group.
    fn widths(&self) -> Vec<Vec<usize>> {
        let mut widths: Vec<Vec<usize>> = self.groups.iter().map(|group| vec![0; group.len()]).collect();
        for line in &self.lines {
            if let Line::Row(cells) = line {
                for (width, cell) in widths.iter_mut().flatten().zip(cells) {
                    *width = (*width).max(length(cell));
                }
            }
        }
        for line in &self.lines {
            if let Line::Titles(titles) = line {
                for (group, title) in widths.iter_mut().zip(titles) {
                    let missing = length(title).saturating_sub(whole(group));
                    if let Some(first) = group.first_mut() {
                        *first += missing;
                    }
                }
            }
        }
        widths
    }
}

/// The width of a group of columns, with a space between columns.
fn whole(group: &[usize]) -> usize {
    group.iter().sum::<usize>() + group.len().saturating_sub(1)
}

fn length(text: &str) -> usize {
    text.chars().count()
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let widths = self.widths();
        for line in &self.lines {
            let text = match line {
                Line::Row(cells) => {
                    let mut cells = cells.iter().map(String::as_str).chain(std::iter::repeat(""));
                    let groups = widths.iter().zip(&self.groups).map(|(widths, aligns)| {
                        let cells = widths.iter().zip(aligns).zip(&mut cells);
                        let padded = cells.map(|((&width, align), cell)| match align {
                            'l' => format!("{cell:width$}"),
                            _ => format!("{cell:>width$}"),
                        });
                        padded.collect::<Vec<_>>().join(" ")
                    });
                    groups.collect::<Vec<_>>().join(" | ")
                }
                Line::Titles(titles) => {
                    let titles = titles.iter().map(String::as_str).chain(std::iter::repeat(""));
                    let groups =
                        widths.iter().zip(titles).map(|(group, title)| format!("{title:^0$}", whole(group)));
                    groups.collect::<Vec<_>>().join(" | ")
                }
                Line::Rule => {
                    let groups = widths.iter().map(|group| "-".repeat(whole(group)));
                    groups.collect::<Vec<_>>().join("-+-")
                }
                Line::Text(text) => text.clone(),
            };
            writeln!(f, "{}", text.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_fit_their_cells() {
        let mut table = Table::new("l|rr|l");
        table.titles(["", "title", "a longer one"]);
        table.row(["name", "a", "bcd"]);
        table.rule();
        table.row(["ä", "12", "3", "é"]);
        table.text("  text");
        let expected = "
     | title  | a longer one
name |  a bcd |
-----+--------+-------------
ä    | 12   3 | é
  text
";
        assert_eq!(table.to_string(), expected[1..]);
    }
}
