//! The table of metrics.

use mrfgs::evaluation::Metrics;

use crate::table::Table;

use super::findings::Findings;

/// Maximum characters of a pair's name; longer names are cut.
const NAME: usize = 12;

/// A column: heading, heading in a report, maximum width, decimals, and value.
type Column = (&'static str, &'static str, usize, usize, fn(&Metrics) -> Option<f64>);

pub(super) const COLUMNS: [Column; 8] = [
    ("avg", "avg. error", 6, 3, |m| m.avg),
    ("PSNR", "PSNR", 5, 2, |m| m.psnr),
    ("b0.5%", "bad 0.5", 5, 2, |m| Some(m.bad[0])),
    ("b1%", "bad 1", 5, 2, |m| Some(m.bad[1])),
    ("b2%", "bad 2", 5, 2, |m| Some(m.bad[2])),
    ("b4%", "bad 4", 5, 2, |m| Some(m.bad[3])),
    ("RMS", "RMS", 5, 2, |m| m.rms),
    ("dens%", "density", 5, 2, |m| Some(m.density)),
];

/// A table with a line per map for all pairs and, for two or more pairs, their mean, at most 120 characters wide.
///
/// `avg` and `RMS` are in pixels, `PSNR` in dB; `bN%` is the share of pixels wrong by more than N pixels or invalid, `dens%` the share of
/// valid pixels, both in percent. A dash marks a missing figure; a mean is only shown over all pairs.
pub(super) fn text(findings: &Findings) -> String {
    let columns = "r".repeat(COLUMNS.len());
    let mut table = Table::new(&format!("ll|{columns}|{columns}"));
    table.titles(["", "all", "nonocc"]);
    let heads = COLUMNS.iter().chain(&COLUMNS).map(|column| column.0);
    table.row(["pair", "map"].into_iter().chain(heads));
    findings.add_rows(&mut table, |table, name, figures| {
        for (i, (map, report)) in figures.maps().enumerate() {
            let name = if i == 0 { cut(name) } else { String::new() };
            let cells = cells(Some(&report.all)).chain(cells(report.nonocc.as_ref()));
            table.row([name, map.to_owned()].into_iter().chain(cells));
        }
    });
    table.to_string()
}

/// `name` in at most [`NAME`] characters, with a ~ if it was cut.
pub(super) fn cut(name: &str) -> String {
    if name.chars().count() <= NAME {
        return name.into();
    }
    name.chars().take(NAME - 1).chain(['~']).collect()
}

fn cells(metrics: Option<&Metrics>) -> impl Iterator<Item = String> {
    COLUMNS.iter().map(move |&(_, _, width, decimals, value)| {
        metrics.and_then(value).map_or_else(|| "-".into(), |v| number(v, width, decimals))
    })
}

/// `value` with up to `decimals` decimals as `width` allows; a lower bound such as >1e5 if not even the integer fits.
fn number(value: f64, width: usize, decimals: usize) -> String {
    (0..=decimals)
        .rev()
        .map(|decimals| format!("{value:.decimals$}"))
        .find(|text| text.len() <= width)
        .unwrap_or_else(|| format!(">1e{}", (value.log10().floor() as i32).min(99)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::evaluate::findings::{Figures, Scored};
    use mrfgs::evaluation::{GroundTruth, Report};
    use mrfgs::image::Plane;

    fn report(offset: f32, masked: bool) -> Report {
        let truth = Plane::filled(4, 2, 8.0);
        let estimate = Plane::from_fn(4, 2, |x, y| if x + y == 0 { f32::INFINITY } else { 8.0 + offset });
        let mask = Plane::from_fn(4, 2, |x, _| if x == 0 { 128 } else { 255 });
        GroundTruth::new(truth, masked.then_some(mask)).unwrap().evaluate(&estimate).unwrap()
    }

    fn row(pair: &str, offset: f32, masked: bool) -> Scored {
        let (raw, finished) = (Some(report(2.0 * offset, masked)), Some(report(offset, masked)));
        Scored { name: pair.into(), figures: Figures { raw, finished, ..Figures::default() }, seconds: None }
    }

    fn table<const N: usize>(pairs: [Scored; N]) -> String {
        text(&Findings::new(None, None, pairs.into()))
    }

    #[test]
    fn two_pairs_and_their_mean() {
        let expected = "
                   |                      all                       |                     nonocc
pair         map   |   avg  PSNR b0.5%   b1%   b2%   b4%  RMS dens% |   avg  PSNR b0.5%   b1%   b2%   b4%  RMS dens%
-------------------+------------------------------------------------+-----------------------------------------------
Teddy        raw   | 2.000 42.11 100.0 100.0 12.50 12.50 2.00 87.50 | 2.000 42.11 100.0 100.0  0.00  0.00 2.00 100.0
             final | 1.000 48.13 100.0 12.50 12.50 12.50 1.00 87.50 | 1.000 48.13 100.0  0.00  0.00  0.00 1.00 100.0
Motorcycle-~ raw   | 6.000 32.57 100.0 100.0 100.0 100.0 6.00 87.50 | 6.000 32.57 100.0 100.0 100.0 100.0 6.00 100.0
             final | 3.000 38.59 100.0 100.0 100.0 12.50 3.00 87.50 | 3.000 38.59 100.0 100.0 100.0  0.00 3.00 100.0
-------------------+------------------------------------------------+-----------------------------------------------
mean         raw   | 4.000 37.34 100.0 100.0 56.25 56.25 4.00 87.50 | 4.000 37.34 100.0 100.0 50.00 50.00 4.00 100.0
             final | 2.000 43.36 100.0 56.25 56.25 12.50 2.00 87.50 | 2.000 43.36 100.0 50.00 50.00  0.00 2.00 100.0
";
        let text = table([row("Teddy", 1.0, true), row("Motorcycle-in-the-dark", 3.0, true)]);
        assert_eq!(text, expected[1..]);
    }

    #[test]
    fn what_is_not_there_is_a_dash_or_no_line() {
        let mut first = row("first", 0.0, false);
        first.figures.raw = None;
        let text = table([first, row("second", 1.0, true)]);
        let lines: Vec<&str> = text.lines().skip(3).collect();
        assert_eq!(lines.len(), 5, "{text}");
        // Valid pixels are perfect, so there is no PSNR; without a mask there is no nonocc.
        let start = "first  final | 0.000     - 12.50 12.50 12.50 12.50 0.00 87.50 |     -     -     -";
        assert!(lines[0].starts_with(start), "{text}");
        assert!(lines[1].starts_with("second raw   |"), "{text}");
        // Only one row has a raw map.
        assert!(lines[4].starts_with("mean   final | 0.500     - "), "{text}");
    }

    #[test]
    fn one_row_has_no_mean() {
        let text = table([row("only", 1.0, true)]);
        assert_eq!((text.lines().count(), text.contains("mean")), (5, false), "{text}");
    }

    #[test]
    fn it_stays_within_its_width() {
        let text = table([row("wide", 1e9, true), row("a", 1.0, false), row("äöü", 123.456, true)]);
        for line in text.lines() {
            assert!(line.chars().count() <= 120, "{line}");
            let bars: Vec<usize> =
                (0..).zip(line.chars()).filter(|c| "|+".contains(c.1)).map(|c| c.0).collect();
            assert_eq!(bars, [11, 62], "{text}");
        }
    }

    #[test]
    fn numbers_fit_their_columns() {
        let cases =
            [(0.0, "0.00"), (12.344, "12.34"), (99.996, "100.0"), (-12.34, "-12.3"), (12_345.6, "12346")];
        for (value, expected) in cases {
            assert_eq!(number(value, 5, 2), expected);
        }
        assert_eq!(number(123_456.0, 5, 2), ">1e5");
        assert_eq!(number(3e38, 6, 3), ">1e38");
    }
}
