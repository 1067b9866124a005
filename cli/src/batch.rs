//! `mrfgs batch`.

use std::collections::{HashSet, VecDeque};
use std::fmt::Write as _;
use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use mrfgs::front::check;
use mrfgs::image::read::Reader;
use mrfgs::image::{Plane, write};
use mrfgs::maps::Maps;
use mrfgs::options::Method;
use mrfgs::{Error, Matched, Matcher, Result};

use crate::batch_list::{Input, List, Listed};
use crate::batch_record::{Request, State};
use crate::claim::Claim;
use crate::outputs;
use crate::progress::PairBar;
use crate::remedy;
use crate::sidecar::Sidecar;
use crate::sign::Sign;
use crate::stop;
use crate::{ExecutionArgs, Failure, MethodArgs, ReadArgs};

const EXAMPLES: &str = "\
Examples:
  mrfgs batch pairs.csv maps
  mrfgs batch pairs.csv maps              # again: resumes what was stopped
  mrfgs batch MiddEval3/trainingQ maps --format png --confidence --validity
  mrfgs batch pairs.csv maps --status
  mrfgs batch pairs.csv maps --shard 3/8  # the third of eight machines

A list:
  name,left,right,max_disparity
  # a comment
  street-01,left/01.png,right/01.png,127
  street-02,left/02.png,right/02.png,";

/// Match many pairs, and resume where an earlier run was stopped
///
/// LIST is a CSV file whose header names its columns: name, left, right, and where they are needed `max_disparity`,
/// `min_disparity` and mask, as the flags of `mrfgs match`. An empty field is as a flag not given: the range is then that of a
/// calib.txt beside the left image, else of sparse matches. Relative paths count from the folder of LIST; lines that begin
/// with # are comments. Or LIST is a folder, and each folder in it that is not hidden a pair in one of the layouts that `mrfgs
/// evaluate` takes; without a calib.txt the range is that of the truth.
///
/// A name is that of files: up to 200 bytes, letters of any script and spaces included, but no / \ : * ? " < > | and no control
/// characters, no . or - first, no . or space last. Names differ by more than upper and lower case.
///
/// Of each pair the map goes to OUTDIR/NAME.pfm (see --format), and last its record to OUTDIR/NAME.json: what `match --json`
/// has, `status` ("done" or "failed", with a `reason`), `warnings`, and the `request`: inputs with sizes (bytes) and times (ms
/// since 1970), range and outputs, and `bytes` of each output. A pair is complete when its record says done, its maps are there with as many
/// bytes, and it holds the same request, method and version; a further run skips it and does all others. What fails is named, and does not keep the
/// others from running.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// CSV file with a row for each pair, or folder with a folder for each
    list: PathBuf,
    /// Folder for maps and records; created where there is none
    #[arg(value_name = "OUTDIR")]
    folder: PathBuf,

    #[command(flatten)]
    maps: MapArgs,
    /// Does one of N parts of the list, the K-th from 1 on, such as 2/8
    ///
    /// The part of a pair follows from its name and N alone (64-bit FNV-1a, upper and lower half joined by exclusive or,
    /// modulo N), so it stays the same when others come or go. Runs at the same time into the same OUTDIR, of parts or of the
    /// whole, do each pair once: a run locks the pair that it is at (OUTDIR/.NAME.tmp), where the file system has locks.
    #[arg(long, value_name = "K/N", value_parser = shard)]
    shard: Option<Shard>,
    /// Prints how far each pair is (complete, failed or missing) for the same arguments, and runs nothing
    #[arg(long)]
    status: bool,
    #[command(flatten)]
    reading: ReadArgs,
    /// Prints nothing but failures
    #[arg(long, conflicts_with = "timings")]
    quiet: bool,

    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    pub(super) execution: ExecutionArgs,
}

/// The maps to write of each pair.
#[derive(clap::Args)]
struct MapArgs {
    /// How disparities are stored, as `mrfgs match` does by extension
    #[arg(long, value_enum, default_value_t, value_name = "WHICH")]
    format: Format,
    /// Writes OUTDIR/NAME-confidence.png too
    #[arg(long)]
    confidence: bool,
    /// Writes OUTDIR/NAME-validity.png too
    #[arg(long)]
    validity: bool,
}

impl MapArgs {
    /// What the disparity map of a pair is called.
    fn disparity_name(&self, name: &str) -> String {
        format!("{name}.{}", self.format.extension())
    }

    /// What the maps beside it are called that are wanted, and which of the maps they are.
    fn more(&self, name: &str) -> impl Iterator<Item = (String, fn(&Maps) -> &Plane<u8>)> {
        let confidence: fn(&Maps) -> &Plane<u8> = |maps| &maps.confidence;
        let validity: fn(&Maps) -> &Plane<u8> = |maps| &maps.validity;
        let all = [(self.confidence, "confidence", confidence), (self.validity, "validity", validity)];
        let all = all.map(|(wanted, map, of)| wanted.then(|| (format!("{name}-{map}.png"), of)));
        all.into_iter().flatten()
    }
}

#[derive(Clone, Copy, Default, ValueEnum)]
enum Format {
    /// Float, +infinity for invalid pixels
    #[default]
    Pfm,
    /// Float, NaN for invalid pixels
    Tif,
    /// 16 bits, disparity times 256, 0 for invalid pixels
    Png,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            Self::Pfm => "pfm",
            Self::Tif => "tif",
            Self::Png => "png",
        }
    }
}

/// One of `count` parts; `index` is below it.
#[derive(Clone, Copy)]
struct Shard {
    index: u64,
    count: u64,
}

fn shard(text: &str) -> std::result::Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse::<u32>().ok()?)));
    match numbers {
        Some((k, n)) if (1..=n).contains(&k) => Ok(Shard { index: u64::from(k - 1), count: u64::from(n) }),
        _ => Err("give K/N with K from 1 to N, like 2/8".into()),
    }
}

impl Shard {
    fn holds(self, name: &str) -> bool {
        let hash = name
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
        (hash >> 32 ^ hash & 0xffff_ffff) % self.count == self.index
    }
}

/// How long to leave pairs alone that other runs are at.
const PATIENCE: Duration = Duration::from_millis(100);

/// What all pairs have in common.
struct Batch<'a> {
    args: &'a Args,
    method: Method,
    reader: Reader,
    base: PathBuf,
}

pub(super) fn run(args: &Args) -> std::result::Result<(), Failure> {
    let method = args.method.method()?;
    let execution = args.execution.execution()?;
    let List { base, mut pairs } = List::read(&args.list)?;
    check_folder(args, &base, &pairs)?;
    if let Some(shard) = args.shard {
        pairs.retain(|listed| shard.holds(&listed.name));
    }
    let batch = Batch { args, method, reader: args.reading.reader(), base };
    if args.status {
        return Ok(batch.print_status(&pairs)?);
    }
    stop::listen();
    let matcher = Matcher::new(&execution)?;
    match fs::create_dir(&args.folder) {
        Err(e) if e.kind() != ErrorKind::AlreadyExists => Err(Error::write(&args.folder, e).into()),
        _ => batch.run(&pairs, matcher),
    }
}

/// Refuses an output folder that could not be one, and outputs that would overwrite an input.
fn check_folder(args: &Args, base: &Path, pairs: &[Listed]) -> Result<()> {
    let folder = &args.folder;
    let place = outputs::folder_place(folder)?;
    if args.list.is_dir() {
        if args.list.canonicalize().is_ok_and(|list| place.starts_with(list)) {
            let reason = format!("lies in {}, the folder of the pairs; give another", args.list.display());
            return Err(Error::write(folder, reason));
        }
        return Ok(());
    }
    // What lies elsewhere cannot be overwritten.
    let inputs = pairs.iter().flat_map(|listed| listed.inputs(base)).map(|path| base.join(path));
    let inputs = inputs.chain([args.list.clone()]).chain(args.method.config.clone());
    let inside = inputs.filter_map(|path| {
        let path = path.canonicalize().ok()?;
        let name = path.file_name().filter(|_| path.parent() == Some(&place))?;
        Some(name.to_string_lossy().to_lowercase())
    });
    let inside: HashSet<_> = inside.collect();
    if inside.is_empty() {
        return Ok(());
    }
    let owned = pairs.iter().flat_map(|listed| owned(&listed.name));
    match owned.into_iter().find(|name| inside.contains(&name.to_lowercase())) {
        Some(name) => {
            let reason = "is an input, and an output would take its place; give another folder";
            Err(Error::write(folder.join(name), reason))
        }
        None => Ok(()),
    }
}

/// The names of all files that a batch may write of a pair.
fn owned(name: &str) -> [String; 6] {
    [".json", ".pfm", ".tif", ".png", "-confidence.png", "-validity.png"].map(|end| format!("{name}{end}"))
}

impl Batch<'_> {
    fn request(&self, listed: &Listed) -> Request {
        let (maps, name) = (&self.args.maps, &listed.name);
        let more = maps.more(name).map(|(file, _)| file);
        Request::new(listed, &self.base, std::iter::once(maps.disparity_name(name)).chain(more).collect())
    }

    fn record(&self, listed: &Listed) -> PathBuf {
        self.args.folder.join(format!("{}.json", listed.name))
    }

    fn state(&self, listed: &Listed) -> State {
        self.request(listed).state(&self.record(listed), &self.method)
    }

    /// Prints a line for each pair, and how many there are of each state.
    fn print_status(&self, pairs: &[Listed]) -> Result<()> {
        let mut text = String::new();
        let [mut complete, mut failed, mut missing] = [0; 3];
        for listed in pairs {
            let name = &listed.name;
            let _ = match self.state(listed) {
                State::Complete => {
                    complete += 1;
                    writeln!(text, "complete  {name}")
                }
                State::Failed(reason) => {
                    failed += 1;
                    writeln!(text, "failed    {name}: {reason}")
                }
                State::Missing => {
                    missing += 1;
                    writeln!(text, "missing   {name}")
                }
            };
        }
        let _ = writeln!(text, "{complete} complete, {failed} failed, {missing} missing");
        crate::print(&text)
    }

    /// Does every pair that is not complete.
    fn run(&self, pairs: &[Listed], mut matcher: Matcher) -> std::result::Result<(), Failure> {
        for listed in pairs {
            Claim::remove_remains(&self.args.folder, &listed.name)?;
        }
        let mut left: VecDeque<_> =
            pairs.iter().filter(|listed| self.state(listed) != State::Complete).collect();
        let all = pairs.len();
        let (mut done, mut skipped, mut failed) = (0, all - left.len(), Vec::new());
        let mut bar = PairBar::new(all, skipped, self.args.quiet);
        let mut told = None;
        // How many pairs in a row were with other runs.
        let mut taken = 0;
        while let Some(listed) = left.pop_front() {
            let name = listed.name.as_str();
            bar.begin(name);
            let interrupted = || {
                let finished = skipped + done + failed.len();
                Failure::Stopped(format!("stopped after {finished} of {all}; run it again to resume"))
            };
            if stop::go_on().is_break() {
                return Err(interrupted());
            }
            let Some(claim) = Claim::new(&self.args.folder, name)? else {
                left.push_back(listed);
                taken += 1;
                if taken >= left.len() {
                    std::thread::sleep(PATIENCE);
                    taken = 0;
                }
                continue;
            };
            taken = 0;
            if self.state(listed) == State::Complete {
                // By another run, since this one began.
                skipped += 1;
                bar.end();
                continue;
            }
            match self.pair(listed, &claim, &mut matcher, &bar) {
                Ok(Ok(note)) => {
                    done += 1;
                    // Why there is no device is the same for all that follow.
                    if note.is_some() && note != told && !self.args.quiet {
                        bar.past(|| note.iter().for_each(|note| crate::say(note)));
                        told = note;
                    }
                }
                Ok(Err(error)) => {
                    failed.push(name);
                    let error = remedy::error(&error, &remedy::COLUMNS);
                    bar.past(|| crate::say(&crate::single_line(&format!("{name}: {error}"))));
                }
                Err(Error::Interrupted) => return Err(interrupted()),
                Err(error) => return Err(error.into()),
            }
            bar.end();
        }
        drop(bar);
        let summary = format!("{done} done, {skipped} skipped, {} failed", failed.len());
        if !failed.is_empty() {
            let text = format!("{summary}: {}; run it again to try these once more", failed.join(", "));
            return Err(Failure::Failed(text));
        }
        if !self.args.quiet {
            crate::say(&summary);
        }
        Ok(())
    }

    /// Matches one pair and writes what comes of it, be it why it failed. Returns the note of the match.
    ///
    /// # Errors
    /// What concerns all pairs; inside, what concerns this one.
    fn pair(
        &self,
        listed: &Listed,
        claim: &Claim,
        matcher: &mut Matcher,
        bar: &PairBar,
    ) -> Result<Result<Option<String>>> {
        let (request, record) = (self.request(listed), self.record(listed));
        let (mut input, matched, time, warnings) = match self.compute(listed, matcher, claim) {
            Ok(computed) => computed,
            Err(error @ (Error::Interrupted | Error::Device(_))) => return Err(error),
            Err(error) => {
                let text = request.failed(&record, &self.method, &error)?;
                self.publish(claim, &[], &record, &text)?;
                return Ok(Err(error));
            }
        };
        if !matched.timings.is_empty() {
            let table = crate::timing_table(&matched, time);
            bar.past(|| {
                let _ = io::stderr().write_all(format!("{}\n{table}", listed.name).as_bytes());
            });
        }
        let (maps, wanted) = (&matched.maps, &self.args.maps);
        let staged = |file: &str| claim.folder().join(file);
        // The place in the making is nothing to tell.
        let named = |e| match e {
            Error::Write { path, reason } => match path.file_name() {
                Some(name) => Error::write(self.args.folder.join(name), reason),
                None => Error::write(path, reason),
            },
            other => other,
        };
        input.files.output = wanted.disparity_name(&listed.name);
        write::disparity(&staged(&input.files.output), &maps.final_map()).map_err(named)?;
        for (file, of) in wanted.more(&listed.name) {
            write::grey8(&staged(&file), of(maps)).map_err(named)?;
        }
        let sidecar = Sidecar::new(&input.files, &matched, time, Sign::default());
        let text = request.done(&record, claim.folder(), sidecar, &warnings)?;
        self.publish(claim, request.outputs(), &record, &text)?;
        Ok(Ok(matched.note))
    }

    fn compute(
        &self,
        listed: &Listed,
        matcher: &mut Matcher,
        claim: &Claim,
    ) -> Result<(Input, Matched, Duration, Vec<String>)> {
        let input = listed.read(&self.base, self.reader)?;
        let (pair, range) = (&input.pair, input.range);
        let map = self.args.maps.disparity_name(&listed.name);
        // The folder is there, so what is wrong is the range.
        write::check_disparity_path(&claim.folder().join(&map), range.min, range.max).map_err(
            |e| match e {
                Error::Write { reason, .. } => Error::write(self.args.folder.join(&map), reason),
                error => error,
            },
        )?;
        let mut warnings = check::warnings(pair, (!input.by_matches).then_some(range));
        let start = Instant::now();
        let matched = matcher.run(pair, range, &self.method, &mut |_| stop::go_on())?;
        let time = start.elapsed();
        warnings.extend(check::clipped(&matched.maps, range));
        let warnings = warnings.iter().map(|warning| remedy::warning(warning, &remedy::COLUMNS)).collect();
        Ok((input, matched, time, warnings))
    }

    /// Puts `outputs` in their place, and then the record. Until that is there the pair is not complete, so the old one goes
    /// first, and with it the maps that it names.
    fn publish(&self, claim: &Claim, outputs: &[String], record: &Path, text: &str) -> Result<()> {
        let name = record.file_name().unwrap_or(record.as_os_str());
        let staged_record = claim.folder().join(name);
        write::save(&staged_record, text.as_bytes()).map_err(|e| match e {
            Error::Write { reason, .. } => Error::write(record, reason),
            other => other,
        })?;
        let old = Request::recorded_outputs(record);
        write::remove(record)?;
        let stem = record.file_stem().unwrap_or_default().to_string_lossy();
        for map in owned(&stem).into_iter().filter(|map| old.contains(map)) {
            write::remove(&self.args.folder.join(map))?;
        }
        for map in outputs {
            write::publish(&claim.folder().join(map), &self.args.folder.join(map))?;
        }
        write::publish(&staged_record, record)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_in_one_shard_and_stays_there() {
        for count in [1, 2, 3, 8, 64] {
            let mut sizes = vec![0; count as usize];
            for pair in 0..1000 {
                let name = format!("pair-{pair:04}");
                let held: Vec<_> = (0..count).filter(|&index| Shard { index, count }.holds(&name)).collect();
                assert_eq!(held.len(), 1, "{name}");
                sizes[held[0] as usize] += 1;
            }
            let even = 1000 / count;
            assert!(sizes.iter().all(|size| (even / 3..=even * 3).contains(size)), "{sizes:?}");
        }
        // The published values of FNV-1a for "a" and "foobar", folded, so that no release moves a pair.
        for (name, hash) in [("a", 0xaf63_dc4c_8601_ec8c_u64), ("foobar", 0x8594_4171_f739_67e8)] {
            let (index, count) = ((hash >> 32 ^ hash & 0xffff_ffff) % 1009, 1009);
            assert!(Shard { index, count }.holds(name), "{name}");
        }
    }

    #[test]
    fn a_shard_is_one_of_some() {
        for text in ["0/3", "4/3", "1/0", "-1/3", "1", "1/", "/3", "a/b", "1/2/3", "1/99999999999"] {
            assert!(shard(text).is_err(), "{text}");
        }
        assert!(shard("3/3").is_ok_and(|shard| (shard.index, shard.count) == (2, 3)));
    }
}
