//! The page of pictures and figures that `--report` writes.

use std::fmt::{Display, Write as _};
use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use mrfgs::Error;
use mrfgs::colour::{self, ColourMap};
use mrfgs::evaluation::{Metrics, Report};
use mrfgs::image::picture::Picture as _;
use mrfgs::image::{Pair, Plane, write};
use mrfgs::low_level::front::zones;
use mrfgs::maps::{Maps, REASONS};

use crate::failure::Result;
use crate::outputs::files;
use crate::outputs::staged::StagedFolder;
use crate::text::figure;

use super::findings::{Figures, Findings};

/// Errors beyond this, in pixels, take the last colour: one scale for all pairs, or they could not be compared.
const ERROR_LIMIT: f32 = 4.0;

/// The page's name in the folder.
const PAGE: &str = "index.html";

/// The beginning of the tag that tells a report from other pages.
const GENERATOR: &str = r#"<meta name="generator" content="mrfgs "#;

/// The attribute with the name of a picture's file: the page names all files of the report.
const FILE: &str = "data-file=";

/// Whether to write a report, and where.
#[derive(clap::Args)]
pub(super) struct ReportArgs {
    /// Writes a page with all figures and pictures, index.html, and the pictures as PNG files
    ///
    /// For each pair it shows the left view, its texture zones, disparity and truth in the same colours, the signed error
    /// (estimate minus truth), confidence and validity; for a finished map only the maps. The page needs no other file and no
    /// network. An existing folder must be empty or hold nothing but an earlier report (its index.html names mrfgs as its
    /// generator), which is replaced.
    #[arg(long, value_name = "FOLDER")]
    report: Option<PathBuf>,
}

impl ReportArgs {
    /// Finds out before any computing whether the report can be written, and refuses `json` inside its folder.
    pub(super) fn destination(&self, json: Option<&Path>) -> Result<Option<Destination<'_>>> {
        let Some(dir) = &self.report else { return Ok(None) };
        let destination = Destination::check(dir)?;
        if let Some(path) = files::json_file(json) {
            write::check_path(path)?;
            files::outside(("--report", &destination.place), ("--json", path))?;
        }
        Ok(Some(destination))
    }
}

/// A picture of a pair, as PNG.
pub(super) struct Picture {
    /// The end of its file's name.
    file: &'static str,
    title: &'static str,
    /// What it shows, for those who cannot see it.
    alt: String,
    /// Its legend, in HTML.
    legend: String,
    size: (usize, usize),
    png: Vec<u8>,
}

impl Picture {
    fn new(
        file: &'static str,
        title: &'static str,
        alt: String,
        legend: String,
        picture: &Plane<[u8; 3]>,
    ) -> Result<Self> {
        let png = picture.png(Path::new(file))?;
        Ok(Self { file, title, alt, legend, size: picture.size(), png })
    }
}

/// The pictures of one pair, in the order of the page; a finished map has nothing `matched`.
pub(super) fn pictures(
    name: &str,
    truth: &Plane<f32>,
    estimate: &Plane<f32>,
    matched: Option<(&Pair, &Maps)>,
) -> Result<Vec<Picture>> {
    // Estimate and truth share the truth's scale.
    let known = || truth.data().iter().copied().filter(|d| d.is_finite());
    let (min, max) = (known().fold(f32::INFINITY, f32::min), known().fold(f32::NEG_INFINITY, f32::max));
    let (min, max) = (min.floor(), max.ceil().max(min.floor() + 1.0));
    let scale = format!("{min} to {max} px, near is warm");

    let mut all = Vec::new();
    if let Some((pair, _)) = matched {
        let left = pair.left().to_rgb8();
        let alt = format!("{name}: the left view");
        all.push(Picture::new("left", "Left view", alt, "The reference view.".into(), &left)?);
        let zones = zones::segment(pair.left(), &zones::Options::default());
        all.push(Picture::new(
            "zones",
            "Texture zones",
            format!("{name}: texture zones of the left view"),
            format!("{} zones by Gabor filters and K-means, as the preset paper uses them.", zones.count),
            &zones.map.map(|&zone| colour::zone(zone)),
        )?);
    }
    all.push(Picture::new(
        "disparity",
        "Disparity",
        format!("{name}: estimated disparity, {scale}"),
        format!("{scale}; black: none. The same scale as the truth."),
        &colour::preview(estimate, min, max, ColourMap::default()),
    )?);
    all.push(Picture::new(
        "truth",
        "Ground truth",
        format!("{name}: true disparity, {scale}"),
        format!("{scale}; black: unknown."),
        &colour::preview(truth, min, max, ColourMap::default()),
    )?);
    all.push(Picture::new(
        "error",
        "Signed error",
        format!("{name}: estimate minus truth, blue where too small, red where too large"),
        format!(
            "Estimate minus truth, -{ERROR_LIMIT} to {ERROR_LIMIT} px and beyond. Blue: too far, red: too near; grey: \
             truth unknown, black: no estimate."
        ),
        &colour::error(estimate, truth, ERROR_LIMIT),
    )?);
    if let Some((_, maps)) = matched {
        all.push(Picture::new(
            "confidence",
            "Confidence",
            format!("{name}: confidence of every pixel, bright is sure"),
            "0 to 255, bright is sure: how far the runner-up label is behind the best one, in 1/8 nat."
                .into(),
            &colour::grey(&maps.confidence),
        )?);
        all.push(Picture::new(
            "validity",
            "Validity",
            format!("{name}: why each pixel is what it is"),
            validity_legend(),
            &colour::validity(&maps.validity),
        )?);
    }
    Ok(all)
}

fn validity_legend() -> String {
    let mut out = String::new();
    for (bit, [r, g, b]) in colour::VALIDITY {
        let reason = REASONS.iter().find(|reason| u32::from(reason.0) == bit);
        let (_, name, about) = reason.expect("each colour is that of a reason");
        let _ = write!(
            out,
            r#"<span class="class" title="{about}"><i style="background:rgb({r},{g},{b})"></i>{bit} {name}</span> "#
        );
    }
    out + "Half as bright: no disparity. Otherwise pixels of 1, 2, 4, 64 and 128 are filled (16)."
}

/// Where a report goes.
pub(super) struct Destination<'a> {
    dir: &'a Path,
    /// Its full path.
    place: PathBuf,
}

impl<'a> Destination<'a> {
    /// Finds out before any computing whether a report can be written to `dir`: a new folder, an empty one, or one that
    /// holds nothing but an earlier report.
    fn check(dir: &'a Path) -> Result<Self> {
        let place = StagedFolder::new(dir)?.place().to_owned();
        let destination = Self { dir, place };
        destination.refuse_strangers()?;
        Ok(destination)
    }

    /// Refuses a folder with files that no report has written: they would be lost.
    fn refuse_strangers(&self) -> Result<()> {
        if !self.place.exists() {
            return Ok(());
        }
        let page = fs::read_to_string(self.place.join(PAGE)).unwrap_or_default();
        let is_report = page.contains(GENERATOR);
        for entry in fs::read_dir(&self.place).map_err(|e| Error::write(self.dir, e))? {
            let name = entry.map_err(|e| Error::write(self.dir, e))?.file_name();
            let name = name.to_string_lossy();
            let ours = name == PAGE || page.contains(&format!("{FILE}\"{name}\""));
            if !(is_report && ours) {
                let reason = format!(
                    "the folder holds {name}, which is no part of an earlier report; give a new folder or empty it"
                );
                return Err(Error::write(self.dir, reason).into());
            }
        }
        Ok(())
    }

    /// Writes all files or none, in place of an earlier report.
    fn publish<'b>(&self, files: impl Iterator<Item = (String, &'b [u8])>) -> Result<()> {
        let staged = StagedFolder::new(self.dir)?;
        for (name, bytes) in files {
            write::save(&staged.path().join(name), bytes).map_err(|e| staged.named(e))?;
        }
        self.refuse_strangers()?;
        Ok(staged.publish()?)
    }
}

/// Writes the report: the page, with its pictures in it, and the pictures as files.
pub(super) fn write(to: &Destination, findings: &Findings, pictures: &[Vec<Picture>]) -> Result<()> {
    let page = page(findings, pictures);
    let files = (0..).zip(findings.pairs.iter().zip(pictures)).flat_map(|(i, (pair, pictures))| {
        pictures.iter().map(move |p| (file_name(i, &pair.name, p), p.png.as_slice()))
    });
    to.publish(files.chain([(PAGE.to_owned(), page.as_bytes())]))
}

/// The name of a picture's file: unique, and harmless in a page and on every file system.
fn file_name(pair: usize, name: &str, picture: &Picture) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = name.chars().map(plain).take(40).collect();
    format!("{}-{name}-{}.png", pair + 1, picture.file)
}

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1c2128; --soft: #59636e; --ground: #ffffff; --line: #d1d9e0; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6edf3; --soft: #9aa5b1; --ground: #11161c; --line: #333c46; }
}
body { margin: 0 auto; max-width: 100rem; padding: 1.5rem; font: 15px/1.5 system-ui, sans-serif; color: var(--ink);
  background: var(--ground); }
h1 { font-size: 1.6rem; margin: 0; }
h2 { font-size: 1.25rem; margin: 2.5rem 0 .5rem; }
p { margin: .3rem 0; }
p, figcaption { color: var(--soft); }
figcaption { margin-top: .3rem; font-size: .87rem; }
figcaption b { color: var(--ink); }
.wide { overflow-x: auto; margin: .8rem 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .15rem .8rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { color: var(--soft); font-weight: 600; }
th[scope=row], .text { text-align: left; }
tr.mean > * { font-weight: 600; }
tr:not(.mean) + .mean > * { border-top: 2px solid var(--soft); }
.pictures { display: grid; gap: 1.2rem; align-items: start; }
@media (min-width: 40rem) { .pictures { grid-template-columns: 1fr 1fr; } }
@media (min-width: 64rem) { .pictures { grid-template-columns: 1fr 1fr 1fr; } }
figure { margin: 0; min-width: 0; }
img { display: block; width: 100%; height: auto; image-rendering: pixelated; }
.class { display: inline-block; margin-right: .5em; }
.class i { display: inline-block; width: .8em; height: .8em; margin-right: .3em; border: 1px solid var(--soft); }
pre { columns: 24rem; font-size: .87rem; white-space: pre-wrap; }
";

/// The whole page.
fn page(findings: &Findings, pictures: &[Vec<Picture>]) -> String {
    let names: Vec<_> = findings.pairs.iter().map(|pair| pair.name.as_str()).collect();
    let version = env!("CARGO_PKG_VERSION");
    let mut out = String::new();
    let _ = writeln!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{GENERATOR}{version}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>Disparity of {}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<h1>Disparity against ground truth</h1>",
        Escaped(&names.join(", "))
    );
    let ran_on = findings.ran_on.as_ref().map(|on| format!(" on {on}")).unwrap_or_default();
    let _ = writeln!(
        out,
        "<p>mrfgs {version}{}. Average error and RMS in pixels, PSNR against 255 in dB, the others in percent: bad \
         pixels are wrong by more than 0.5, 1, 2 or 4 px or have no disparity.</p>",
        Escaped(&ran_on)
    );

    // All pairs, all pixels.
    let mut rows = Vec::new();
    for pair in &findings.pairs {
        rows.extend(pair.raw.as_ref().map(|raw| ("", &*pair.name, "raw", &raw.all)));
        rows.push(("", &pair.name, "final", &pair.finished.all));
    }
    if findings.pairs.len() > 1 {
        let means = [("raw", &findings.mean.raw), ("final", &findings.mean.finished)];
        let means = means.into_iter().filter_map(|(map, report)| Some((map, report.as_ref()?)));
        rows.extend(means.map(|(map, report)| ("mean", "mean", map, &report.all)));
    }
    table(&mut out, ["pair", "map"], rows.into_iter());

    for (i, (pair, pictures)) in findings.pairs.iter().zip(pictures).enumerate() {
        let _ = writeln!(out, "<section>\n<h2>{}</h2>", Escaped(&pair.name));
        if let Some(seconds) = pair.seconds {
            let _ = writeln!(out, "<p>Matched in {seconds:.2} s.</p>");
        }
        let mut rows = Vec::new();
        for (map, report) in [("raw", pair.raw.as_ref()), ("final", Some(&pair.finished))] {
            let Some(Report { all, nonocc }) = report else { continue };
            rows.push(("", map, "all", all));
            rows.extend(nonocc.as_ref().map(|m| ("", map, "seen in both views", m)));
        }
        table(&mut out, ["map", "pixels"], rows.into_iter());
        breakdown(&mut out, pair);
        out.push_str("<div class=\"pictures\">\n");
        for picture in pictures {
            let (width, height) = picture.size;
            let _ = writeln!(
                out,
                "<figure><img {FILE}\"{}\" alt=\"{}\" width=\"{width}\" height=\"{height}\" \
                 src=\"data:image/png;base64,{}\"><figcaption><b>{}</b> {}</figcaption></figure>",
                file_name(i, &pair.name, picture),
                Escaped(&picture.alt),
                BASE64.encode(&picture.png),
                picture.title,
                picture.legend
            );
        }
        out.push_str("</div>\n</section>\n");
    }
    if let Some(method) = &findings.method {
        let _ = writeln!(out, "<h2>Method</h2>\n<pre>{}</pre>", Escaped(&method.table()));
    }
    out.push_str("</body>\n</html>\n");
    out
}

/// A table of metrics: the class, the two names and the metrics of each row.
fn table<'a>(
    out: &mut String,
    heads: [&str; 2],
    rows: impl Iterator<Item = (&'a str, &'a str, &'a str, &'a Metrics)>,
) {
    let [first, second] = heads;
    let _ = write!(
        out,
        "<div class=\"wide\"><table>\n<tr><th class=\"text\">{first}</th><th class=\"text\">{second}</th>"
    );
    for head in ["avg. error", "PSNR", "bad 0.5", "bad 1", "bad 2", "bad 4", "RMS", "density"] {
        let _ = write!(out, "<th>{head}</th>");
    }
    out.push_str("</tr>\n");
    for (class, first, second, m) in rows {
        let _ = write!(
            out,
            "<tr class=\"{class}\"><th scope=\"row\">{}</th><td class=\"text\">{second}</td>",
            Escaped(&first)
        );
        let [b0, b1, b2, b4] = m.bad.map(Some);
        for (value, decimals) in
            [(m.avg, 3), (m.psnr, 2), (b0, 2), (b1, 2), (b2, 2), (b4, 2), (m.rms, 2), (Some(m.density), 2)]
        {
            let _ = write!(out, "<td>{}</td>", figure(value, decimals));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</table></div>\n");
}

/// Where the errors of a pair's final map are, and how good its confidence and validity are; nothing for a finished map.
fn breakdown(out: &mut String, pair: &Figures) {
    if let Some(breakdown) = &pair.breakdown {
        out.push_str(
            "<div class=\"wide\"><table>\n<tr><th class=\"text\">class</th><th>share</th><th>bad 2</th>\
             <th>avg. error</th><th>bad 2 of all</th><th>of bad 2</th><th>of squares</th></tr>\n",
        );
        for (class, p) in breakdown.iter() {
            let _ = write!(out, "<tr><th scope=\"row\">{}</th>", class.name());
            for value in [Some(p.share), p.bad, p.avg, Some(p.points), p.of_bad, p.of_squares] {
                let _ = write!(out, "<td>{}</td>", figure(value, 2));
            }
            out.push_str("</tr>\n");
        }
        out.push_str("</table></div>\n");
    }
    if let Some(c) = &pair.confidence {
        let [auc, optimal, random] = [c.auc, c.optimal, c.random].map(|v| figure(Some(v), 2));
        let _ = write!(out, "<p>Confidence: AUC {auc} % (optimal {optimal}, random {random}).");
        if let Some(v) = &pair.validity {
            let (precision, recall) = (figure(v.precision, 2), figure(v.recall, 2));
            let _ = write!(out, " Flags of unseen pixels: precision {precision} %, recall {recall} %.");
        }
        out.push_str("</p>\n");
    }
}

/// A text with the special characters of HTML escaped, for attributes too.
struct Escaped<'a, T: Display>(&'a T);

impl<T: Display> Display for Escaped<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        for c in self.0.to_string().chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\'' => f.write_str("&#39;")?,
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}
