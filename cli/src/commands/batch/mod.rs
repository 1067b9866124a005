//! `mrfgs batch`.

mod args;
mod cameras;
mod listed;
mod request;

use std::collections::{HashSet, VecDeque};
use std::error::Error as _;
use std::fmt::Write as _;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::error::Reason;
use mrfgs::image::read::Reader;
use mrfgs::image::{Pair, write};
use mrfgs::options::Method;
use mrfgs::sigma::Sigma;
use mrfgs::{Error, Matched, Matcher};

use crate::args::Sign;
use crate::failure::{self, Failure, Result};
use crate::outputs::{Claim, Format, MatchRecord, Outcome, also, files};
use crate::progress::Counter;
use crate::text::shown;
use crate::{console, remedy, stop};

pub(crate) use args::Args;
use listed::{BatchSettings, List, Listed, LoadedPair};
use request::{Request, State};

/// How long to wait while other runs match the remaining pairs.
const PATIENCE: Duration = Duration::from_millis(100);

/// The settings of a run.
struct Batch<'a> {
    args: &'a Args,
    given: BatchSettings<'a>,
    third: Option<ThirdCamera>,
    method: Method,
    reader: Reader,
    base: PathBuf,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let execution = args.execution.execution();
    let (batch, mut pairs) = Batch::new(args)?;
    check_folder(args, &batch.base, &pairs, &batch.given)?;
    if let Some(shard) = args.shard {
        pairs.retain(|listed| shard.holds(&listed.name));
    }
    if args.status {
        return batch.print_status(&pairs);
    }
    stop::listen();
    let matcher = Matcher::builder().method(batch.method.clone()).execution(execution).build()?;
    files::create_folder(&args.folder).map_err(|e| Error::write(&args.folder, e))?;
    batch.run(&pairs, matcher)
}

/// Refuses an invalid output folder, and outputs that would overwrite an input.
fn check_folder(args: &Args, base: &Path, pairs: &[Listed], given: &BatchSettings) -> Result<()> {
    let folder = &args.folder;
    let place = files::folder_place(folder)?;
    if args.list.is_dir() {
        if args.list.canonicalize().is_ok_and(|list| place.starts_with(list)) {
            let reason =
                format!("is inside {}, the folder of the pairs; give another folder", args.list.display());
            return Err(Error::write(folder, Reason::of_request(reason)).into());
        }
        return Ok(());
    }
    // Only inputs in the output folder can be overwritten.
    let inputs = pairs.iter().flat_map(|listed| listed.inputs(base, given)).map(|path| base.join(path));
    let inputs = inputs.chain([args.list.clone()]).chain(args.method.files().map(Path::to_owned));
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
            let reason = "is an input that an output would overwrite; give another folder";
            Err(Error::write(folder.join(name), Reason::of_request(reason)).into())
        }
        None => Ok(()),
    }
}

/// The names of all files that a batch may write for a pair.
fn owned(name: &str) -> Vec<String> {
    let maps = Format::value_variants().iter().map(|format| format!("{name}.{}", format.extension()));
    let beside = maps
        .clone()
        .flat_map(|map| also::all_beside(Path::new(&map)).map(|path| shown(&path)).collect::<Vec<_>>());
    maps.chain(beside).chain([format!("{name}.json")]).collect()
}

impl<'a> Batch<'a> {
    /// The batch and its pairs.
    fn new(args: &'a Args) -> Result<(Self, Vec<Listed>)> {
        args.maps.also.check(args.rectify, false)?;
        let method = args.maps.also.made_by(args.method.method()?)?;
        let List { base, pairs } = List::read(&args.list)?;
        let given = BatchSettings {
            calib: &args.calib,
            crop: &args.crop,
            rectify: args.rectification.options_if(args.rectify)?,
            cameras: args.maps.also.take_cameras(),
            into: args.maps.also.into.as_deref(),
        };
        let third = args.maps.also.third()?;
        Ok((Self { args, given, third, method, reader: args.reading.reader(), base }, pairs))
    }

    fn request(&self, listed: &Listed) -> Request<'_> {
        let (maps, name) = (&self.args.maps, &listed.name);
        let outputs = std::iter::once(maps.map(name)).chain(maps.also(name).map(|(_, file)| file));
        Request::new(self.args, listed, &self.base, &self.given, outputs.collect())
    }

    fn record(&self, listed: &Listed) -> PathBuf {
        self.args.folder.join(format!("{}.json", listed.name))
    }

    fn state(&self, listed: &Listed) -> State {
        self.request(listed).state(&self.record(listed), &self.method)
    }

    /// Prints a line for each pair, and the number of pairs in each state.
    fn print_status(&self, pairs: &[Listed]) -> Result<()> {
        let mut text = String::new();
        let [mut complete, mut failed, mut missing] = [0; 3];
        for listed in pairs {
            let (count, state, reason) = match self.state(listed) {
                State::Complete => (&mut complete, "complete", String::new()),
                State::Failed(reason) => (&mut failed, "failed", format!(": {reason}")),
                State::Missing => (&mut missing, "missing", String::new()),
            };
            *count += 1;
            let _ = writeln!(text, "{state:<9} {}{reason}", listed.name);
        }
        let _ = writeln!(text, "{complete} complete, {failed} failed, {missing} missing");
        console::print(&text)?;
        match failed {
            0 => Ok(()),
            _ => Err(Failure::Failed(format!(
                "{failed} of {} failed; run without --status to retry",
                pairs.len()
            ))),
        }
    }

    /// Matches every incomplete pair.
    fn run(&self, pairs: &[Listed], mut matcher: Matcher) -> Result<()> {
        for listed in pairs {
            // If this fails, claiming the pair fails too and reports it.
            let _ = Claim::remove_remains(&self.args.folder, &listed.name);
        }
        let mut left: VecDeque<_> =
            pairs.iter().filter(|listed| self.state(listed) != State::Complete).collect();
        let all = pairs.len();
        let (mut done, mut skipped, mut failed) = (0, all - left.len(), Vec::new());
        let mut bar = Counter::of_pairs(all, skipped, self.args.quiet);
        let (mut told, mut doubtful) = (None, 0);
        // Number of consecutive pairs claimed by other runs.
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
            let made = match Claim::new(&self.args.folder, name) {
                Ok(None) => {
                    left.push_back(listed);
                    taken += 1;
                    if taken >= left.len() {
                        std::thread::sleep(PATIENCE);
                        taken = 0;
                    }
                    continue;
                }
                Ok(Some(_)) if self.state(listed) == State::Complete => {
                    // Another run has matched it in the meantime.
                    skipped += 1;
                    bar.end();
                    continue;
                }
                Ok(Some(claim)) => self.pair(listed, &claim, &mut matcher),
                Err(error) => Err(error.into()),
            };
            taken = 0;
            match made {
                Ok((note, warnings)) => {
                    done += 1;
                    doubtful += usize::from(!warnings.is_empty());
                    if !self.args.quiet {
                        let say = |warning| console::say(&format!("{name}: warning: {warning}"));
                        bar.past(|| warnings.iter().for_each(say));
                    }
                    // The reason for the device is the same for every pair, so print it once.
                    if note.is_some() && note != told && !self.args.quiet {
                        bar.past(|| note.iter().for_each(|note| console::say(note)));
                        told = note;
                    }
                }
                Err(Failure::Stopped(_)) => return Err(interrupted()),
                Err(failure) if self.concerns_all(&failure) => return Err(failure),
                Err(failure) => {
                    failed.push(name);
                    bar.past(|| console::say(&format!("{name}: {}", failure.message(&remedy::COLUMNS))));
                }
            }
            bar.end();
        }
        drop(bar);
        let summary = format!("{done} done, {skipped} skipped, {} failed", failed.len());
        if !failed.is_empty() {
            let text = format!("{summary}: {}; run it again to retry these", failed.join(", "));
            return Err(Failure::Failed(text));
        }
        if !self.args.quiet {
            let doubtful = if doubtful == 0 { String::new() } else { format!(", {doubtful} with warnings") };
            console::say(&format!("{summary}{doubtful}"));
        }
        Ok(())
    }

    /// Whether all later pairs would fail for the same reason.
    fn concerns_all(&self, failure: &Failure) -> bool {
        use ErrorKind::{FileTooLarge, QuotaExceeded, ReadOnlyFilesystem, StorageFull};
        match failure {
            Failure::Stopped(_) | Failure::Error(Error::Device(_)) => true,
            Failure::Error(Error::Write { path, reason }) => {
                let of_system = reason.source().and_then(|cause| cause.downcast_ref::<io::Error>());
                let is_of_disk =
                    |kind| matches!(kind, FileTooLarge | QuotaExceeded | ReadOnlyFilesystem | StorageFull);
                *path == self.args.folder || of_system.is_some_and(|error| is_of_disk(error.kind()))
            }
            _ => false,
        }
    }

    /// Matches one pair and writes its outputs, or a record of the failure. Returns the note about the device and the warnings.
    fn pair(
        &self,
        listed: &Listed,
        claim: &Claim,
        matcher: &mut Matcher,
    ) -> Result<(Option<String>, Vec<String>)> {
        let made = self.made(listed, claim, matcher);
        if let Err(failure) = &made
            && !self.concerns_all(failure)
        {
            let (request, record) = (self.request(listed), self.record(listed));
            let text = request.failed(&record, &self.method, failure);
            match text.and_then(|text| self.publish(claim, &[], &record, &text)) {
                Err(failure) if self.concerns_all(&failure) => return Err(failure),
                // The pair has failed already, and that failure is reported.
                _ => {}
            }
        }
        made
    }

    fn made(
        &self,
        listed: &Listed,
        claim: &Claim,
        matcher: &mut Matcher,
    ) -> Result<(Option<String>, Vec<String>)> {
        let (request, record) = (self.request(listed), self.record(listed));
        write::check_path(&record)?;
        let (read, matched, time, warnings) = self.compute(listed, matcher)?;
        let LoadedPair { input, rig, mut files, .. } = read;
        let (range, rectifying) = (matched.range(), input.rectifying());
        let trust = input.rectification.as_ref().and_then(|by| by.trust().copied());
        let pair = input.pair;
        let wanted = &self.args.maps;
        let georeferences = pair.georeferences();
        let pair = Some(pair).filter(|_| wanted.also.show_left());
        let (maps, sign, left) = (&matched.maps, Sign::default(), pair.as_ref().map(Pair::left));
        let (sigma, third) = (Some(Sigma::for_method(&self.method)), self.third);
        let outcome = Outcome { maps, range, sign, left, rig, rectifying, third, sigma, georeferences };
        self.named(claim, wanted.write(claim.folder(), &listed.name, &outcome))?;
        files.output = Some(wanted.map(&listed.name));
        let mut found = MatchRecord::new(&files, &matched, time, sign);
        (found.rectified, found.trust) = (self.args.rectify, trust);
        let text = request.done(&record, claim.folder(), found, &warnings)?;
        self.publish(claim, request.outputs(), &record, &text)?;
        Ok((matched.note.as_ref().map(|note| remedy::error(note, &remedy::FLAGS)), warnings))
    }

    fn compute(
        &self,
        listed: &Listed,
        matcher: &mut Matcher,
    ) -> Result<(LoadedPair, Matched, Duration, Vec<String>)> {
        let (wanted, folder) = (&self.args.maps, &self.args.folder);
        let read = listed.read(&self.base, self.reader, &self.given)?;
        let (input, pair) = (&read.input, &read.input.pair);
        wanted.check(folder, &listed.name, input.range)?;
        let mut warnings = input.warnings(&remedy::COLUMNS);
        let searched = input.searched(|wider| wanted.check(folder, &listed.name, wider).is_ok());
        let start = Instant::now();
        let matched = searched
            .with_prior(read.prior.as_ref())
            .job(matcher, pair)
            .on_progress(|_| stop::go_on())
            .run()?;
        let time = start.elapsed();
        let found = matched.warnings();
        warnings.extend(found.iter().map(|warning| remedy::warning(warning, &remedy::COLUMNS)));
        Ok((read, matched, time, warnings))
    }

    /// Makes errors name the final path instead of the temporary one.
    fn named<E: Into<Failure>>(&self, claim: &Claim, result: Result<(), E>) -> Result<()> {
        result.map_err(|e| match e.into() {
            Failure::Error(Error::Write { path, reason }) => {
                let file = path.strip_prefix(claim.folder()).map(|file| self.args.folder.join(file));
                Error::write(file.unwrap_or(path), reason).into()
            }
            failure => failure,
        })
    }

    /// Moves `outputs` and then the record to their places. Until then the pair must not count as complete, so the old record and its
    /// outputs are removed first.
    fn publish(&self, claim: &Claim, outputs: &[String], record: &Path, text: &str) -> Result<()> {
        let name = record.file_name().unwrap_or(record.as_os_str());
        let staged_record = claim.folder().join(name);
        write::save(&staged_record, text.as_bytes()).map_err(|e| failure::at(e, record))?;
        let old = Request::recorded_outputs(record);
        write::remove(record)?;
        let stem = record.file_stem().unwrap_or_default().to_string_lossy();
        for map in owned(&stem).into_iter().filter(|map| old.contains(map)) {
            write::remove(&self.args.folder.join(map))?;
        }
        for map in outputs {
            write::publish(&claim.folder().join(map), &self.args.folder.join(map))?;
        }
        Ok(write::publish(&staged_record, record)?)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::{CommandFactory, Parser};
    use serde_json::{Value, json};

    use super::*;
    use crate::pairs::list;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        args: Args,
    }

    /// For every flag: arguments without and with it (or with another value), and whether that changes an output.
    const FLAGS: [(&str, &str, &str, bool); 21] = [
        ("calib", "--calib one.yml --also depth", "--calib two.yml --also depth", true),
        ("calib-crop", "--calib one.yml", "--calib one.yml --calib-crop 0,0,320,200", true),
        ("rectify", "--calib one.yml", "--calib one.yml --rectify", true),
        ("alpha", "--calib one.yml --rectify", "--calib one.yml --rectify --alpha 0.5", true),
        ("format", "", "--format tif", true),
        ("also", "--also raw", "--also raw,validity", true),
        ("colours", "--also preview", "--also preview --colours grey", true),
        ("into", "--also depth-registered --into one.yml", "--also depth-registered --into two.yml", true),
        ("min-confidence", "", "--min-confidence 48", true),
        ("clip-depth", "--also depth", "--also depth --clip-depth 3.5", true),
        ("no-data", "--no-data 0", "--no-data inf", true),
        ("orient", "", "--orient", true),
        ("method", "", "--method fast", true),
        ("set", "", "--set temperature=0.3", true),
        ("memory", "", "--memory 1GiB", true),
        ("shard", "", "--shard 1/1", false),
        ("status", "", "--status", false),
        ("max-pixels", "", "--max-pixels 1000000", false),
        ("quiet", "", "--quiet", false),
        ("device", "", "--device cpu", false),
        ("threads", "", "--threads 1", false),
    ];

    /// A folder with a pair and calibration files.
    fn workshop() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["left.png", "right.png", "mask.png", "other.png"] {
            fs::write(at(name), "an image").unwrap();
        }
        let camera = concat!(env!("CARGO_MANIFEST_DIR"), "/../testdata/raw/third.yml");
        for name in ["one.yml", "two.yml", "calib.txt"] {
            fs::copy(camera, at(name)).unwrap();
        }
        fs::write(at("list.csv"), "name,left,right\na,left.png,right.png\n").unwrap();
        folder
    }

    /// The request for the first pair in `list`; file names in `flags` are relative to `folder`.
    fn asked(folder: &Path, list: &str, flags: &str) -> Value {
        let words = ["batch", list, "out"].into_iter().chain(flags.split_whitespace());
        let words = words.map(|word| {
            let is_file = [".csv", ".yml"].iter().any(|ending| word.ends_with(ending));
            if is_file { folder.join(word).into_os_string() } else { word.into() }
        });
        let args = Program::try_parse_from(words).map_err(|e| panic!("{flags}: {e}")).unwrap().args;
        let (batch, pairs) = Batch::new(&args).map_err(|e| panic!("{flags}: {e}")).unwrap();
        json!({"request": batch.request(&pairs[0]), "method": batch.method})
    }

    #[test]
    fn every_flag_that_changes_an_output_is_in_the_request() {
        let folder = workshop();
        let program = Program::command();
        let known: Vec<_> = program.get_arguments().filter_map(clap::Arg::get_long).collect();
        assert_eq!(known.len(), FLAGS.len(), "every flag must be in the table: {known:?}");
        for name in known {
            let row = FLAGS
                .iter()
                .find(|row| row.0 == name)
                .unwrap_or_else(|| panic!("{name} is not in the table"));
            let (_, before, after, changes) = row;
            assert!(after.contains(&format!("--{name}")), "{name}");
            let [before, after] = [before, after].map(|flags| asked(folder.path(), "list.csv", flags));
            assert_eq!(before != after, *changes, "{name}: {before}");
        }
    }

    #[test]
    fn every_column_of_a_list_is_in_the_request() {
        let folder = workshop();
        let row = |column: &str| match column {
            "name" => "b",
            "left" | "right" => "other.png",
            "mask" | "prior" => "mask.png",
            "calibration" => "one.yml",
            "max_disparity" => "40",
            "min_disparity" => "-3",
            "prior_sigma" => "2",
            "prior_kind" => "surface",
            "prior_unit" => "cm",
            "prior_pose" => "two.yml",
            other => panic!("{other} is not in the table"),
        };
        let of = |changed: &str| {
            let values = list::COLUMNS.map(|column| match column {
                _ if column == changed => row(column),
                "name" => "a",
                "left" => "left.png",
                "right" => "right.png",
                // The columns after it belong to a prior.
                "prior" => "other.png",
                _ => "",
            });
            let text = format!("{}\n{}\n", list::COLUMNS.join(","), values.join(","));
            fs::write(folder.path().join("list.csv"), text).unwrap();
            asked(folder.path(), "list.csv", "")
        };
        let plain = of("");
        assert_eq!(plain, of(""), "control");
        for column in list::COLUMNS {
            assert_ne!(plain, of(column), "{column}");
        }
    }

    #[test]
    fn what_changes_in_a_file_changes_the_request() {
        let folder = workshop();
        let header = "name,left,right,mask,calibration\n";
        fs::write(folder.path().join("list.csv"), format!("{header}a,left.png,right.png,mask.png,\n"))
            .unwrap();
        let ask =
            || asked(folder.path(), "list.csv", "--calib one.yml --also depth-registered --into two.yml");
        for name in ["left.png", "right.png", "mask.png", "one.yml", "two.yml"] {
            let (before, path) = (ask(), folder.path().join(name));
            let mut bytes = fs::read(&path).unwrap();
            bytes.push(b'\n');
            fs::write(&path, bytes).unwrap();
            assert_ne!(before, ask(), "{name}");
        }
        // A calib.txt beside the left image counts too.
        let ask = || asked(folder.path(), "list.csv", "--also depth");
        let before = ask();
        fs::remove_file(folder.path().join("calib.txt")).unwrap();
        assert_ne!(before, ask());
    }
}
