//! The page with pictures and figures that `--report` writes.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use mrfgs::colour::{self, ColourMap};
use mrfgs::evaluation::{Metrics, Report};
use mrfgs::image::picture::Picture as _;
use mrfgs::image::{Pair, Plane, write};
use mrfgs::low_level::front::zones;
use mrfgs::maps::{Maps, REASONS};

use crate::failure::Result;
use crate::outputs::{StagedFolder, files};
use crate::text::figure;

use super::findings::{Figures, Findings};
use super::metrics::COLUMNS;

/// The error in pixels at the end of the colour scale, the same for all pairs so that they can be compared.
const ERROR_LIMIT: f32 = 4.0;

/// The page's file name.
const PAGE: &str = "index.html";

/// The start of the tag that identifies a report.
const GENERATOR: &str = r#"<meta name="generator" content="mrfgs "#;

/// The attribute with the file name of a picture; the page names all files of the report.
const FILE: &str = "data-file=";

/// The flag of a report.
#[derive(clap::Args)]
pub(super) struct ReportArgs {
    /// Writes a page with all figures and pictures (index.html), and the pictures as PNG files
    ///
    /// For each pair it shows the left view, its texture zones, disparity and ground truth in the same colours, the signed error (estimate
    /// minus truth), the disparity before post-processing and its error, confidence and validity; for a finished map only the maps. The page
    /// needs no other files and no network. An existing
    /// folder must be empty or contain only an earlier report (its index.html names mrfgs as its generator), which is replaced.
    #[arg(long, value_name = "FOLDER")]
    report: Option<PathBuf>,
}

impl ReportArgs {
    /// Begins the report before any computing, in a folder that is new, empty or an earlier report. Refuses `json` inside it.
    pub(super) fn begin(&self, json: Option<&Path>) -> Result<Option<StagedFolder>> {
        let staged = self.report.as_deref().map(StagedFolder::new).transpose()?;
        if let Some(staged) = &staged {
            refuse_strangers(staged)?;
            staged.check_json("--report", json)?;
        }
        Ok(staged)
    }
}

/// Refuses a folder with other files, which would be lost.
fn refuse_strangers(staged: &StagedFolder) -> mrfgs::Result<()> {
    if !staged.place().exists() {
        return Ok(());
    }
    let page = fs::read_to_string(staged.place().join(PAGE)).unwrap_or_default();
    for entry in fs::read_dir(staged.place()).map_err(|e| staged.error(e))? {
        let name = entry.map_err(|e| staged.error(e))?.file_name();
        let name = name.to_string_lossy();
        let ours = name == PAGE || page.contains(&format!("{FILE}\"{name}\""));
        if !(page.contains(GENERATOR) && ours) {
            return Err(staged.error(format!(
                "the folder contains {name}, which is not part of an earlier report; give a new folder or empty it"
            )));
        }
    }
    Ok(())
}

/// A picture of a pair, as PNG.
pub(super) struct Picture {
    /// The end of the file name.
    file: &'static str,
    title: &'static str,
    /// The alternative text.
    alt: String,
    /// The legend, in HTML.
    legend: String,
    size: (usize, usize),
    png: Vec<u8>,
}

/// The pictures of one pair, in the order of the page; `matched` is `None` for a finished map.
pub(super) fn pictures(
    name: &str,
    truth: &Plane<f32>,
    estimate: &Plane<f32>,
    matched: Option<(&Pair, &Maps)>,
) -> Result<Vec<Picture>> {
    // Estimate and ground truth share the scale of the ground truth.
    let known = || truth.data().iter().copied().filter(|d| d.is_finite());
    let (min, max) = (known().fold(f32::INFINITY, f32::min), known().fold(f32::NEG_INFINITY, f32::max));
    let (min, max) = (min.floor(), max.ceil().max(min.floor() + 1.0));
    let scale = format!("{min} to {max} px, near is warm");

    let mut all = Vec::new();
    let mut add = |file, title, alt: &str, legend: String, picture: &Plane<[u8; 3]>| -> Result<()> {
        let (alt, size) = (format!("{name}: {alt}"), picture.size());
        all.push(Picture { file, title, alt, legend, size, png: picture.png(Path::new(file))? });
        Ok(())
    };
    if let Some((pair, _)) = matched {
        add("left", "Left view", "the left view", "The reference view.".into(), &pair.left().to_rgb8())?;
        let zones = zones::segment(pair.left(), &zones::Options::default());
        let legend =
            format!("{} zones by Gabor filters and K-means, as the preset paper uses them.", zones.count);
        let picture = zones.map.map(|&zone| colour::zone(zone));
        add("zones", "Texture zones", "texture zones of the left view", legend, &picture)?;
    }
    let legend = format!("{scale}; black: none. The same scale as the truth.");
    let picture = colour::preview(estimate, min, max, ColourMap::default());
    add("disparity", "Disparity", &format!("estimated disparity, {scale}"), legend, &picture)?;
    let picture = colour::preview(truth, min, max, ColourMap::default());
    let legend = format!("{scale}; black: unknown.");
    add("truth", "Ground truth", &format!("true disparity, {scale}"), legend, &picture)?;
    let alt = "estimate minus truth, blue where too small, red where too large";
    let legend = format!(
        "Estimate minus truth, -{ERROR_LIMIT} to {ERROR_LIMIT} px and beyond. Blue: too far, red: too near, grey: \
         truth unknown, black: no estimate."
    );
    add("error", "Signed error", alt, legend.clone(), &colour::error(estimate, truth, ERROR_LIMIT))?;
    if let Some((_, maps)) = matched {
        let raw = maps.raw_map();
        let picture = colour::preview(&raw, min, max, ColourMap::default());
        let alt_of_map = format!("estimated disparity before post-processing, {scale}");
        let scale = format!("{scale}; black: none. The same scale as the truth.");
        add("raw", "Raw disparity", &alt_of_map, format!("Before post-processing, {scale}"), &picture)?;
        let alt = format!("{alt}, before post-processing");
        add("raw-error", "Raw signed error", &alt, legend, &colour::error(&raw, truth, ERROR_LIMIT))?;
        let alt = "confidence of every pixel, bright is sure";
        let legend = "How sure each pixel is, 0 to 255; bright is sure. It is how much worse the second-best disparity fits (in 1/8 nat), averaged over neighbouring pixels.";
        add("confidence", "Confidence", alt, legend.into(), &colour::grey(&maps.confidence))?;
        let (alt, picture) = ("the status of each pixel", colour::validity(&maps.validity));
        add("validity", "Validity", alt, validity_legend(), &picture)?;
    }
    Ok(all)
}

fn validity_legend() -> String {
    let mut out = String::new();
    for (bit, [r, g, b]) in colour::VALIDITY {
        let reason = REASONS.iter().find(|reason| u32::from(reason.0) == bit);
        let (_, name, about) = reason.expect("every colour has a reason");
        let _ = write!(
            out,
            r#"<span class="class" title="{about}"><i style="background:rgb({r},{g},{b})"></i>{bit} {name}</span> "#
        );
    }
    out + "Half as bright: no disparity. Otherwise pixels of 1, 2, 4, 64 and 128 are filled (16)."
}

/// Writes the findings as JSON and prints `text`, and for a report that was `begun` writes the page with embedded pictures and the picture
/// files. An earlier report is replaced as a whole, or not at all.
pub(super) fn deliver(
    json: Option<&Path>,
    findings: &Findings,
    text: &str,
    begun: Option<StagedFolder>,
    pictures: &[Vec<Picture>],
) -> Result<()> {
    files::deliver(json, findings, text, |_| {
        let Some(staged) = begun else { return Ok(()) };
        let save = |name: String, bytes: &[u8]| {
            write::save(&staged.path().join(name), bytes).map_err(|e| staged.named(e))
        };
        for (i, (pair, pictures)) in findings.pairs.iter().zip(pictures).enumerate() {
            pictures.iter().try_for_each(|p| save(file_name(i, &pair.name, p), &p.png))?;
        }
        save(PAGE.to_owned(), page(findings, pictures).as_bytes())?;
        refuse_strangers(&staged)?;
        Ok(staged.publish()?)
    })
}

/// The file name of a picture: unique, and safe in a page and on every file system.
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

/// The complete page.
fn page(findings: &Findings, pictures: &[Vec<Picture>]) -> String {
    let names: Vec<_> = findings.pairs.iter().map(|pair| pair.name.as_str()).collect();
    let version = env!("CARGO_PKG_VERSION");
    let mut out = String::new();
    let _ = writeln!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{GENERATOR}{version}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>Disparity of {}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<h1>Disparity against ground truth</h1>",
        escaped(&names.join(", "))
    );
    let ran_on = findings.ran_on.as_ref().map(|on| format!(" on {on}")).unwrap_or_default();
    let _ = writeln!(
        out,
        "<p>mrfgs {version}{}. Average error and RMS in pixels, PSNR against 255 in dB, the others in percent: bad \
         pixels are wrong by more than 0.5, 1, 2 or 4 px or have no disparity.</p>",
        escaped(&ran_on)
    );

    // All pairs, over all pixels.
    let mut rows = Vec::new();
    for pair in &findings.pairs {
        rows.extend(pair.figures.maps().map(|(map, report)| ("", &*pair.name, map, &report.all)));
    }
    if findings.pairs.len() > 1 {
        rows.extend(findings.mean.maps().map(|(map, report)| ("mean", "mean", map, &report.all)));
    }
    table(&mut out, ["pair", "map"], rows.into_iter());

    for (i, (pair, pictures)) in findings.pairs.iter().zip(pictures).enumerate() {
        let _ = writeln!(out, "<section>\n<h2>{}</h2>", escaped(&pair.name));
        if let Some(seconds) = pair.seconds {
            let _ = writeln!(out, "<p>Matched in {seconds:.2} s.</p>");
        }
        let mut rows = Vec::new();
        for (map, Report { all, nonocc }) in pair.figures.maps() {
            rows.push(("", map, "all", all));
            rows.extend(nonocc.as_ref().map(|m| ("", map, "seen in both views", m)));
        }
        table(&mut out, ["map", "pixels"], rows.into_iter());
        breakdown(&mut out, &pair.figures);
        out.push_str("<div class=\"pictures\">\n");
        for picture in pictures {
            let (width, height) = picture.size;
            let _ = writeln!(
                out,
                "<figure><img {FILE}\"{}\" alt=\"{}\" width=\"{width}\" height=\"{height}\" \
                 src=\"data:image/png;base64,{}\"><figcaption><b>{}</b> {}</figcaption></figure>",
                file_name(i, &pair.name, picture),
                escaped(&picture.alt),
                BASE64.encode(&picture.png),
                picture.title,
                picture.legend
            );
        }
        out.push_str("</div>\n</section>\n");
    }
    if let Some(method) = &findings.method {
        let _ = writeln!(out, "<h2>Method</h2>\n<pre>{}</pre>", escaped(&method.table().to_string()));
    }
    out.push_str("</body>\n</html>\n");
    out
}

/// A table of metrics; each row has a CSS class, two names and the metrics.
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
    for (_, head, ..) in COLUMNS {
        let _ = write!(out, "<th>{head}</th>");
    }
    out.push_str("</tr>\n");
    for (class, first, second, m) in rows {
        let _ = write!(
            out,
            "<tr class=\"{class}\"><th scope=\"row\">{}</th><td class=\"text\">{second}</td>",
            escaped(first)
        );
        for (.., decimals, value) in COLUMNS {
            let _ = write!(out, "<td>{}</td>", figure(value(m), decimals));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</table></div>\n");
}

/// The breakdown of errors of a pair's final map, and the quality of its confidence and validity; nothing for a finished map.
fn breakdown(out: &mut String, figures: &Figures) {
    if let Some(breakdown) = &figures.breakdown {
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
    if let Some(c) = &figures.confidence {
        let [auc, optimal, random] = [c.auc, c.optimal, c.random].map(|v| figure(Some(v), 2));
        let _ = write!(out, "<p>Confidence: AUC {auc} % (optimal {optimal}, random {random}).");
        if let Some(v) = &figures.validity {
            let (precision, recall) = (figure(v.precision, 2), figure(v.recall, 2));
            let _ = write!(out, " Flags of unseen pixels: precision {precision} %, recall {recall} %.");
        }
        out.push_str("</p>\n");
    }
}

/// Escapes the special characters of HTML, also for attributes.
fn escaped(text: &str) -> String {
    let escapes = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;"), ("'", "&#39;")];
    escapes.into_iter().fold(text.to_owned(), |text, (special, escape)| text.replace(special, escape))
}
