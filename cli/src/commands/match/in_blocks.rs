//! A match in blocks: each goes into a file of a folder, and the outputs are joined from these in the end.

use std::collections::{BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::matrix::Matrix;
use mrfgs::check;
use mrfgs::depth::Rig;
use mrfgs::image::{Georeference, Image, Plane, Rect, write};
use mrfgs::low_level::plan::Plan;
use mrfgs::maps::Maps;
use mrfgs::options::{DisparityRange, Method};
use mrfgs::prior::PriorUse;
use mrfgs::region::{Blocks, Region};
use mrfgs::sigma::Sigma;
use mrfgs::{Conditioning, Error, Matcher, Prior};
use serde::Serialize;
use tempfile::TempDir;

use super::args::Args;
use super::outputs::{check_outputs, record_files, say_end, show, write_outputs};
use super::request::Request;
use crate::args::{CameraArgs, CropArgs, PriorArgs, PriorView, ReadingArgs, RectificationArgs, Search, Sign};
use crate::blocks::{Bands, BlockFiles, BlockFolder, BlockRecord, Fingerprint, Known};
use crate::failure::{Failure, Result};
use crate::outputs::{Also, Found, MatchRecord, Outcome, Tally, View, Written, files};
use crate::pairs::input::{self, Input};
use crate::pairs::large::LargePair;
use crate::progress::Counter;
use crate::{console, matching, remedy, stop};

/// How long to wait while other runs match the remaining blocks.
const PATIENCE: Duration = Duration::from_millis(100);
/// About the most pixels of the thinned maps, from which warnings come.
const THIN: usize = 1 << 22;

/// The images, flags and method that determine the maps of all blocks.
#[derive(Serialize)]
struct Asked<'a> {
    version: &'static str,
    images: Vec<Fingerprint>,
    /// The files of the mask, the calibration and the prior.
    others: Vec<Fingerprint>,
    disparities: &'a Search,
    sign: Sign,
    reading: &'a ReadingArgs,
    rectify: bool,
    rectification: &'a RectificationArgs,
    crop: &'a CropArgs,
    cameras: &'a CameraArgs,
    prior: &'a PriorArgs,
    method: &'a Method,
}

impl<'a> Asked<'a> {
    fn new(request: &'a Request) -> Result<Self> {
        let args = request.args;
        let prints =
            |paths: &mut dyn Iterator<Item = &'a Path>| paths.map(Fingerprint::of).collect::<Result<_>>();
        let pair = &args.pair;
        let images = std::iter::once(&*pair.left).chain(pair.right.as_deref());
        let beside = input::beside(&pair.left).unwrap_or_default();
        let calibration = if pair.calib.is_empty() { beside } else { pair.calib.clone() };
        let mut others = calibration.iter().map(|path| Fingerprint::of(path)).collect::<Result<Vec<_>>>()?;
        let more = pair.mask.as_deref().into_iter().chain(args.prior.inputs().map(|(_, path)| path));
        others.extend::<Vec<_>>(prints(&mut more.collect::<Vec<_>>().into_iter())?);
        Ok(Self {
            version: env!("CARGO_PKG_VERSION"),
            images: prints(&mut images.collect::<Vec<_>>().into_iter())?,
            others,
            disparities: &pair.search,
            sign: args.sign,
            reading: &pair.reading,
            rectify: args.rectify,
            rectification: &args.rectification,
            crop: &pair.crop,
            cameras: &args.numbers,
            prior: &args.prior,
            method: &request.method,
        })
    }
}

/// The folder of the blocks: that of `--blocks`, or one that is removed in the end.
struct Place {
    path: PathBuf,
    temporary: Option<TempDir>,
}

impl Place {
    fn new(request: &Request) -> Result<Self> {
        if let Some(path) = &request.args.blocks.blocks {
            return Ok(Self { path: path.clone(), temporary: None });
        }
        let beside = request.scratch();
        let made = tempfile::Builder::new().prefix(".mrfgs-").suffix(".blocks").tempdir_in(&beside);
        let made = made.map_err(|e| Error::write(&beside, e))?;
        Ok(Self { path: made.path().to_owned(), temporary: Some(made) })
    }
}

/// The number of complete blocks in the folder of `--blocks`, and the number of all; `None` before the first run.
pub(super) fn progress(request: &Request, blocks: &Blocks) -> Result<Option<(usize, usize)>> {
    let Some(path) = request.args.blocks.blocks.as_ref().filter(|path| path.is_dir()) else {
        return Ok(None);
    };
    let folder = BlockFolder::open(path, &Asked::new(request)?)?;
    let Some(known) = folder.known() else { return Ok(None) };
    let files = folder.begin(known, blocks)?;
    Ok(Some((files.complete()?, files.count())))
}

/// Matches the pair in blocks, and writes the outputs once all are complete.
pub(super) fn run(request: &Request) -> Result<()> {
    let Request { args, method, cameras, need, .. } = request;
    // Checks what can be checked before a folder is made.
    let asked = Asked::new(request)?;
    let place = Place::new(request)?;
    let folder = BlockFolder::open(&place.path, &asked)?;
    let mut input = stop::at_once(|| input_of(request, &folder))?;
    let range = input.range;
    let is_new = folder.known().is_none();
    if !args.quiet {
        input.say_range(args.sign, "");
    }
    let known = input.rig(need.as_ref(), &args.pair.left)?;
    let rig = known.filter(|_| cameras.is_some());
    let also = check_outputs(args, &input)?;
    let blocks = Blocks::new(input.size, range, method)?;
    let view = PriorView { size: input.size, sign: args.sign, rig: input.as_taken(known) };
    let prior = args.prior.read(view)?;
    if !args.quiet && is_new {
        stop::at_once(|| input.warn())?;
    }
    let found = match folder.known() {
        Some(known) => known,
        None => Known::new(range, stop::at_once(|| blocks.conditioning(|part| input.pair.window(part)))?),
    };
    input.pair.forget_overview();
    let corrections = found.corrections();
    let files = folder.begin(found, &blocks)?;
    let run = BlockRun { request, input: &input, files: &files, blocks: &blocks, corrections, prior };
    run.match_blocks(place.temporary.is_none())?;
    let complete = files.complete()?;
    if complete < files.count() {
        if !args.quiet {
            console::say(&format!(
                "{complete} of {} blocks are complete in {}; {} is written by the run that completes the last",
                files.count(),
                place.path.display(),
                args.output().display()
            ));
        }
        return Ok(());
    }
    let Some(_claim) = files.claim_outputs()? else {
        if !args.quiet {
            console::say(&format!("another run writes {}", args.output().display()));
        }
        return Ok(());
    };
    run.join(&also, rig)
}

/// The pair, to be read by windows unless it has to be rectified.
fn input_of(request: &Request, folder: &BlockFolder) -> Result<Input<LargePair>> {
    let method = &request.method;
    let Some(files) = request.files() else {
        return request.input()?.with_views(|pair| Ok(LargePair::of_pair(pair, method)));
    };
    let range = folder.known().map(|known| known.range()).transpose()?;
    request.input_of(LargePair::of_files(files.open(&request.scratch())?, method).with_range(range))
}

/// A run that matches some of the blocks.
struct BlockRun<'a> {
    request: &'a Request<'a>,
    input: &'a Input<LargePair>,
    files: &'a BlockFiles,
    blocks: &'a Blocks,
    corrections: Conditioning,
    prior: Option<Arc<Prior>>,
}

impl BlockRun<'_> {
    fn args(&self) -> &Args {
        self.request.args
    }

    /// Matches every missing block of this run, unless another run does. If they are `kept`, the next run goes on after a stop.
    fn match_blocks(&self, kept: bool) -> Result<()> {
        let (args, count) = (self.args(), self.files.count());
        let mut left = VecDeque::new();
        for block in 0..count {
            let is_ours = args.blocks.shard.is_none_or(|shard| shard.holds_block(block));
            if is_ours && !self.files.is_complete(block)? {
                left.push_back(block);
            }
        }
        if left.is_empty() {
            return Ok(());
        }
        let execution = self.request.execution.clone();
        let mut matcher =
            Matcher::builder().method(self.request.method.clone()).execution(execution).build()?;
        let mut bar = Counter::of_blocks(count, count - left.len(), args.quiet);
        let mut told = None;
        // Number of consecutive blocks claimed by other runs.
        let mut taken = 0;
        while let Some(block) = left.pop_front() {
            let part = self.blocks.list()[block].part();
            bar.begin(&format!(
                "columns {} to {}, rows {} to {}",
                part.x.start, part.x.end, part.y.start, part.y.end
            ));
            let Some(_claim) = self.files.claim(block)? else {
                left.push_back(block);
                taken += 1;
                if taken >= left.len() {
                    std::thread::sleep(PATIENCE);
                    taken = 0;
                }
                if stop::go_on().is_break() {
                    return Err(self.stopped(kept)?);
                }
                continue;
            };
            taken = 0;
            if !self.files.is_complete(block)? {
                let note = match self.match_block(block, &mut matcher) {
                    Err(Failure::Stopped(_)) => return Err(self.stopped(kept)?),
                    note => note?,
                };
                // The reason for the device is the same for every block.
                if note.is_some() && note != told && !args.quiet {
                    bar.past(|| note.iter().for_each(|note| console::say(note)));
                    told = note;
                }
            }
            bar.end();
        }
        Ok(())
    }

    /// The failure after a stop.
    fn stopped(&self, kept: bool) -> Result<Failure> {
        if !kept {
            return Ok(Error::Interrupted.into());
        }
        let (complete, count) = (self.files.complete()?, self.files.count());
        Ok(Failure::Stopped(format!("stopped after {complete} of {count} blocks; run it again to resume")))
    }

    /// Matches a block, and stores it. Returns the note about the device.
    fn match_block(&self, index: usize, matcher: &mut Matcher) -> Result<Option<String>> {
        let block: &Region = &self.blocks.list()[index];
        let window = self.input.pair.window(block.window())?;
        let start = Instant::now();
        let job = matcher.job(&window, self.input.range).conditioning(self.corrections);
        let job = match &self.prior {
            Some(prior) => job.prior(prior.crop(block.window())),
            None => job,
        };
        let matched = job.on_progress(|_| stop::go_on()).run()?;
        let (maps, seconds) = (block.maps_of(&matched.maps), start.elapsed().as_secs_f64());
        let note = matched.note.as_ref().map(|note| remedy::error(note, &remedy::FLAGS));
        self.files.store(index, &maps, &matched, note.clone(), seconds)?;
        Ok(note)
    }

    /// Joins the blocks to the outputs.
    fn join(&self, also: &[(&'static Also, PathBuf)], rig: Option<Rig>) -> Result<()> {
        let (args, input, files) = (self.args(), self.input, self.files);
        let (tally, thin) = self.tally()?;
        let summary = Summary::of(self)?;
        if !args.quiet {
            let found = summary.found(self);
            matching::say_summary("", files.size(), &found, Duration::from_secs_f64(summary.seconds));
            self.warn(&thin, summary.prior);
        }
        let template = Template {
            range: input.range,
            sign: args.sign,
            rig,
            rectifying: input.rectifying(),
            third: self.request.third,
            sigma: Sigma::for_method(&self.request.method),
            georeferences: input.pair.georeferences(),
        };
        let paths = record_files(args, input);
        let mut record = MatchRecord::of(
            &paths,
            summary.found(self),
            files.size(),
            tally,
            Duration::from_secs_f64(summary.seconds),
            args.sign,
        );
        record.rectified = args.rectify;
        record.trust = input.rectification.as_ref().and_then(|by| by.trust().copied());
        let by_bands = !files::is_printed(args.output())
            && !args.show
            && also.iter().all(|(word, _)| word.comes_by_bands());
        let said = if by_bands {
            self.write_by_bands(also, &template, &record)?
        } else {
            let maps = self.whole()?;
            let pair = args.show_left().then(|| input.pair.window(&Rect::whole(files.size()))).transpose()?;
            let outcome = template.outcome(&maps, pair.as_ref().map(mrfgs::Pair::left));
            let said = write_outputs(args, also, &outcome, &record)?;
            show(args, also, &outcome);
            said
        };
        say_end(
            args,
            &template.outcome(&thin, None),
            input.has_found_range(),
            input.unit().as_deref(),
            &said,
        );
        Ok(())
    }

    /// Counts the pixels of all blocks, and thins their maps to every so many rows and columns.
    fn tally(&self) -> Result<(Tally, Maps)> {
        let (width, height) = self.files.size();
        let step = ((width * height).div_ceil(THIN) as f64).sqrt().ceil() as usize;
        let mut tally = Tally::default();
        let mut thin = Maps::blank((width.div_ceil(step), height.div_ceil(step)), false);
        let (mut top, mut y) = (0, 0);
        for band in Bands::of(self.files) {
            let band = band?;
            tally.add(&band);
            let rows = band.disparity.height();
            while y * step < top + rows {
                let row = y * step - top;
                take(&band.disparity, &mut thin.disparity, row, y, step);
                take(&band.raw, &mut thin.raw, row, y, step);
                take(&band.confidence, &mut thin.confidence, row, y, step);
                take(&band.validity, &mut thin.validity, row, y, step);
                y += 1;
            }
            top += rows;
        }
        Ok((tally, thin))
    }

    /// The whole maps.
    fn whole(&self) -> Result<Maps> {
        let mut whole: Option<Maps> = None;
        let mut top = 0;
        for band in Bands::of(self.files) {
            let band = band?;
            let (width, rows) = band.disparity.size();
            let whole = whole.get_or_insert_with(|| Maps::blank(self.files.size(), band.right.is_some()));
            whole.paste(&band, &Rect { x: 0..width, y: top..top + rows });
            top += rows;
        }
        Ok(whole.expect("a pair has a block"))
    }

    /// Writes all outputs by bands of rows, or none. Returns remarks about depths.
    fn write_by_bands(
        &self,
        also: &[(&'static Also, PathBuf)],
        template: &Template,
        record: &MatchRecord,
    ) -> Result<Vec<String>> {
        let (args, files) = (self.args(), self.files);
        let mut written = Written::default();
        let mut said = Vec::new();
        let map = |maps: mrfgs::Result<Maps>| {
            maps.map(|maps| template.sign.map(template.outcome(&maps, None).final_map(args.also.limits)))
        };
        let writer = template.outcome(&Maps::blank((1, 1), false), None).writer(View::Left);
        let output = args.output();
        written
            .note(output, writer.disparity_in_bands(output, files.size(), &mut Bands::of(files).map(map)))?;
        for (word, path) in also {
            let (size, bands) = (files.size(), Bands::of(files));
            let made =
                args.also.write_in_bands(word, path, size, bands, &|maps| template.outcome(maps, None));
            said.extend(written.note(path, made)?);
        }
        if let Some(path) = args.json.as_deref() {
            let text = files::json_text(path, record)?;
            if files::is_printed(path) {
                written.keep();
                console::print(&text)?;
                return Ok(said);
            }
            written.note(path, write::save(path, text.as_bytes()))?;
        }
        written.keep();
        Ok(said)
    }

    /// Prints the warnings that maps give.
    fn warn(&self, thin: &Maps, prior: Option<PriorUse>) {
        let (width, height) = self.blocks.list()[0].window().size();
        let looks =
            Plan::new(width, height, self.input.range, &self.request.method).map_or(1, |plan| plan.looks());
        let found = self.input.has_found_range();
        let warnings = check::warnings_of_match(thin, self.input.range, looks, found, prior.as_ref());
        input::warn(warnings.into_iter().map(|warning| self.args().sign.warning(warning)));
    }
}

/// Copies every `step`th value of row `from` to row `to` of the thinned map.
fn take<T: Copy>(band: &Plane<T>, thin: &mut Plane<T>, from: usize, to: usize, step: usize) {
    let values = band.row(from).iter().step_by(step);
    thin.row_mut(to).iter_mut().zip(values).for_each(|(thin, value)| *thin = *value);
}

/// What all blocks have in common, or add up to.
struct Summary {
    ran_on: String,
    driver: Option<String>,
    note: Option<String>,
    tiles: usize,
    iterations: u32,
    seconds: f64,
    prior: Option<PriorUse>,
}

impl Summary {
    fn of(run: &BlockRun) -> Result<Self> {
        let records = (0..run.files.count()).map(|block| run.files.record(block));
        let records = records.collect::<mrfgs::Result<Vec<BlockRecord>>>()?;
        let words = |of: fn(&BlockRecord) -> Option<&String>| {
            let all: BTreeSet<&String> = records.iter().filter_map(of).collect();
            (!all.is_empty()).then(|| all.into_iter().map(String::as_str).collect::<Vec<_>>().join(", "))
        };
        Ok(Self {
            ran_on: words(|record| Some(&record.ran_on)).unwrap_or_default(),
            driver: words(|record| record.driver.as_ref()),
            note: words(|record| record.note.as_ref()),
            tiles: records.iter().map(|record| record.tiles).max().unwrap_or(1),
            iterations: records.iter().map(|record| record.iterations).max().unwrap_or(0),
            seconds: records.iter().map(|record| record.seconds).sum(),
            prior: records.iter().fold(None, |sum, record| PriorUse::sum(sum, record.prior)),
        })
    }

    fn found<'a>(&'a self, run: &'a BlockRun) -> Found<'a> {
        Found {
            method: &run.request.method,
            range: run.input.range,
            ran_on: &self.ran_on,
            driver: self.driver.as_deref(),
            note: self.note.clone(),
            tiles: self.tiles,
            blocks: run.files.count(),
            conditioning: run.corrections,
            prior: self.prior,
            iterations: self.iterations,
            timings: &[],
        }
    }
}

/// The outcome of a match without its maps.
struct Template {
    range: DisparityRange,
    sign: Sign,
    rig: Option<Rig>,
    rectifying: Option<Matrix>,
    third: Option<ThirdCamera>,
    sigma: Sigma,
    georeferences: [Option<Georeference>; 2],
}

impl Template {
    fn outcome<'a>(&self, maps: &'a Maps, left: Option<&'a Image>) -> Outcome<'a> {
        Outcome {
            maps,
            range: self.range,
            sign: self.sign,
            left,
            rig: self.rig,
            rectifying: self.rectifying,
            third: self.third,
            sigma: Some(self.sigma),
            georeferences: self.georeferences.clone(),
        }
    }
}
