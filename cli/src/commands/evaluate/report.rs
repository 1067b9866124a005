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

use super::findings::{Figures, Findings, Scored};
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
    /// minus truth), the disparity before post-processing and its error, confidence and validity; for a finished map only the maps. Maps of
    /// several methods are side by side. The page needs no other files and no network. An existing folder must be empty or contain only an
    /// earlier report (its index.html names mrfgs as its generator), which is replaced.
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
struct Picture {
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

impl Picture {
    fn new(
        pair: &str,
        file: &'static str,
        title: &'static str,
        alt: &str,
        legend: String,
        picture: &Plane<[u8; 3]>,
    ) -> Result<Self> {
        let png = picture.png(Path::new(file))?;
        Ok(Self { file, title, alt: format!("{pair}: {alt}"), legend, size: picture.size(), png })
    }
}

/// The pictures of one pair.
#[derive(Default)]
pub(super) struct Pictures {
    /// The views and the ground truth: pictures that are the same for all methods.
    shared: Vec<Picture>,
    /// For each method, the pictures of its maps. All methods have the same kinds of pictures in the same order.
    own: Vec<Vec<Picture>>,
}

/// A picture on the page.
struct Shown<'a> {
    /// The method that it is of, if there are several.
    of: Option<&'a Findings>,
    /// The file name: unique, and safe in a page and on every file system.
    file: String,
    picture: &'a Picture,
}

impl Pictures {
    /// Adds the pictures of another method, and the shared ones if it is the first. `matched` is `None` for a finished map.
    pub(super) fn add(
        &mut self,
        name: &str,
        truth: &Plane<f32>,
        estimate: &Plane<f32>,
        matched: Option<(&Pair, &Maps)>,
    ) -> Result<()> {
        let scale = Scale::of(truth);
        if self.own.is_empty() {
            self.shared = shared(name, truth, scale, matched.map(|(pair, _)| pair))?;
        }
        self.own.push(own(name, truth, scale, estimate, matched.map(|(_, maps)| maps))?);
        Ok(())
    }

    /// All pictures of the pair with this number in the order of the page: the same kind of all methods, one after the other.
    fn shown<'a>(&'a self, number: usize, pair: &str, findings: &'a Findings) -> Vec<Shown<'a>> {
        let pair = format!("{}-{}", number + 1, plain(pair));
        let file = |stem: &str, picture: &Picture| format!("{stem}-{}.png", picture.file);
        let mut all: Vec<_> = self
            .shared
            .iter()
            .map(|picture| Shown { of: None, file: file(&pair, picture), picture })
            .collect();
        for kind in 0..self.own.first().map_or(0, Vec::len) {
            for (i, (own, of)) in self.own.iter().zip(findings.of_each_method()).enumerate() {
                let stem = of.name.as_ref().map(|name| format!("{pair}-{}-{}", i + 1, plain(name)));
                let (file, picture) = (file(stem.as_ref().unwrap_or(&pair), &own[kind]), &own[kind]);
                all.push(Shown { of: of.name.as_ref().map(|_| of), file, picture });
            }
        }
        all
    }
}

/// The colour scale of a pair's maps: that of its ground truth.
#[derive(Clone, Copy)]
struct Scale {
    min: f32,
    max: f32,
}

impl Scale {
    fn of(truth: &Plane<f32>) -> Self {
        let known = || truth.data().iter().copied().filter(|d| d.is_finite());
        let (min, max) = (known().fold(f32::INFINITY, f32::min), known().fold(f32::NEG_INFINITY, f32::max));
        Self { min: min.floor(), max: max.ceil().max(min.floor() + 1.0) }
    }

    fn coloured(self, map: &Plane<f32>) -> Plane<[u8; 3]> {
        colour::preview(map, self.min, self.max, ColourMap::default())
    }
}

impl std::fmt::Display for Scale {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{} to {} px, near is warm", self.min, self.max)
    }
}

/// The views, and the ground truth of the pair called `name`; without a `pair` the ground truth alone.
fn shared(name: &str, truth: &Plane<f32>, scale: Scale, pair: Option<&Pair>) -> Result<Vec<Picture>> {
    let mut all = Vec::new();
    if let Some(pair) = pair {
        let (alt, legend) = ("the left view", "The reference view.".into());
        all.push(Picture::new(name, "left", "Left view", alt, legend, &pair.left().to_rgb8())?);
        let zones = zones::segment(pair.left(), &zones::Options::default());
        let legend =
            format!("{} zones by Gabor filters and K-means, as the preset paper uses them.", zones.count);
        let (alt, picture) = ("texture zones of the left view", zones.map.map(|&zone| colour::zone(zone)));
        all.push(Picture::new(name, "zones", "Texture zones", alt, legend, &picture)?);
    }
    let (alt, legend) = (format!("true disparity, {scale}"), format!("{scale}; black: unknown."));
    all.push(Picture::new(name, "truth", "Ground truth", &alt, legend, &scale.coloured(truth))?);
    Ok(all)
}

/// The maps of a method for the pair called `name`; without `maps` the estimate alone.
fn own(
    name: &str,
    truth: &Plane<f32>,
    scale: Scale,
    estimate: &Plane<f32>,
    maps: Option<&Maps>,
) -> Result<Vec<Picture>> {
    let mut all = Vec::new();
    let mut add = |file, title, alt: &str, legend: String, picture: &Plane<[u8; 3]>| -> Result<()> {
        all.push(Picture::new(name, file, title, alt, legend, picture)?);
        Ok(())
    };
    let legend = format!("{scale}; black: none. The same scale as the truth.");
    let alt = format!("estimated disparity, {scale}");
    add("disparity", "Disparity", &alt, legend.clone(), &scale.coloured(estimate))?;
    let alt_of_error = "estimate minus truth, blue where too small, red where too large";
    let legend_of_error = format!(
        "Estimate minus truth, -{ERROR_LIMIT} to {ERROR_LIMIT} px and beyond. Blue: too far, red: too near, grey: \
         truth unknown, black: no estimate."
    );
    let picture = colour::error(estimate, truth, ERROR_LIMIT);
    add("error", "Signed error", alt_of_error, legend_of_error.clone(), &picture)?;
    if let Some(maps) = maps {
        let raw = maps.raw_map();
        let alt = format!("estimated disparity before post-processing, {scale}");
        add(
            "raw",
            "Raw disparity",
            &alt,
            format!("Before post-processing, {legend}"),
            &scale.coloured(&raw),
        )?;
        let alt = format!("{alt_of_error}, before post-processing");
        let picture = colour::error(&raw, truth, ERROR_LIMIT);
        add("raw-error", "Raw signed error", &alt, legend_of_error, &picture)?;
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
    pictures: &[Pictures],
) -> Result<()> {
    files::deliver(json, findings, text, |_| {
        let Some(staged) = begun else { return Ok(()) };
        let save = |name: String, bytes: &[u8]| {
            write::save(&staged.path().join(name), bytes).map_err(|e| staged.named(e))
        };
        for (i, (pair, pictures)) in findings.pairs.iter().zip(pictures).enumerate() {
            let mut shown = pictures.shown(i, &pair.name, findings).into_iter();
            shown.try_for_each(|Shown { file, picture, .. }| save(file, &picture.png))?;
        }
        save(PAGE.to_owned(), page(findings, pictures).as_bytes())?;
        refuse_strangers(&staged)?;
        Ok(staged.publish()?)
    })
}

/// A name as a part of file names.
fn plain(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    name.chars().map(plain).take(40).collect()
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
h3 { font-size: 1rem; margin: 1rem 0 .3rem; }
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
.pictures { display: grid; gap: 1.2rem; align-items: start; margin: 1.2rem 0; }
@media (min-width: 40rem) { .pictures { grid-template-columns: 1fr 1fr; } }
@media (min-width: 64rem) { .pictures { grid-template-columns: 1fr 1fr 1fr; } }
figure { margin: 0; min-width: 0; }
img { display: block; width: 100%; height: auto; image-rendering: pixelated; }
.class { display: inline-block; margin-right: .5em; }
.class i { display: inline-block; width: .8em; height: .8em; margin-right: .3em; border: 1px solid var(--soft); }
pre { columns: 24rem; font-size: .87rem; white-space: pre-wrap; }
";

/// The complete page.
fn page(findings: &Findings, pictures: &[Pictures]) -> String {
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
    for i in 0..findings.pairs.len() {
        for of in findings.of_each_method() {
            let Scored { name, figures, .. } = &of.pairs[i];
            rows.extend(
                figures.maps().map(|(map, report)| ("", name.clone(), of.qualified(map), &report.all)),
            );
        }
    }
    if findings.pairs.len() > 1 {
        for of in findings.of_each_method() {
            let maps = of.mean.maps();
            rows.extend(maps.map(|(map, report)| ("mean", "mean".into(), of.qualified(map), &report.all)));
        }
    }
    table(&mut out, ["pair", "map"], rows.into_iter());

    for (i, (pair, pictures)) in findings.pairs.iter().zip(pictures).enumerate() {
        let _ = writeln!(out, "<section>\n<h2>{}</h2>", escaped(&pair.name));
        let mut rows = Vec::new();
        for of in findings.of_each_method() {
            let Scored { figures, seconds, .. } = &of.pairs[i];
            if let Some(seconds) = seconds {
                let matched = of.qualified("Matched");
                let _ = writeln!(out, "<p>{} in {seconds:.2} s.</p>", escaped(&matched));
            }
            for (map, Report { all, nonocc }) in figures.maps() {
                rows.push(("", of.qualified(map), "all".into(), all));
                rows.extend(nonocc.as_ref().map(|m| ("", of.qualified(map), "seen in both views".into(), m)));
            }
        }
        table(&mut out, ["map", "pixels"], rows.into_iter());
        for of in findings.of_each_method() {
            if let Some(name) = &of.name {
                let _ = writeln!(out, "<h3>{}</h3>", escaped(name));
            }
            breakdown(&mut out, &of.pairs[i].figures);
        }
        gallery(&mut out, &pictures.shown(i, &pair.name, findings), 1 + findings.beside.len());
        out.push_str("</section>\n");
    }
    for of in findings.of_each_method() {
        if let Some(method) = &of.method {
            let (head, method) = (escaped(&of.qualified("Method")), escaped(&method.table().to_string()));
            let _ = writeln!(out, "<h2>{head}</h2>\n<pre>{method}</pre>");
        }
    }
    out.push_str("</body>\n</html>\n");
    out
}

/// The pictures of a pair. Those of several `methods` have a column for each.
fn gallery(out: &mut String, shown: &[Shown], methods: usize) {
    let (shared, own) = shown.split_at(shown.iter().take_while(|shown| shown.of.is_none()).count());
    let columns = format!(r#" style="grid-template-columns: repeat({methods}, 1fr)""#);
    for (pictures, style) in [(shared, ""), (own, &*columns)] {
        if pictures.is_empty() {
            continue;
        }
        let _ = writeln!(out, "<div class=\"pictures\"{style}>");
        for Shown { of, file, picture } in pictures {
            let (width, height) = picture.size;
            let called = |text: &str| escaped(&of.map_or_else(|| text.into(), |of| of.qualified(text)));
            let _ = writeln!(
                out,
                "<figure><img {FILE}\"{file}\" alt=\"{}\" width=\"{width}\" height=\"{height}\" \
                 src=\"data:image/png;base64,{}\"><figcaption><b>{}</b> {}</figcaption></figure>",
                called(&picture.alt),
                BASE64.encode(&picture.png),
                called(picture.title),
                picture.legend
            );
        }
        out.push_str("</div>\n");
    }
}

/// A table of metrics; each row has a CSS class, two names and the metrics.
fn table<'a>(
    out: &mut String,
    heads: [&str; 2],
    rows: impl Iterator<Item = (&'a str, String, String, &'a Metrics)>,
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
            "<tr class=\"{class}\"><th scope=\"row\">{}</th><td class=\"text\">{}</td>",
            escaped(&first),
            escaped(&second)
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
