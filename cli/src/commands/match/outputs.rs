//! The outputs of `mrfgs match`: checked before any computing, and written all or none.

use std::path::{Path, PathBuf};

use mrfgs::image::{pfm, write};
use mrfgs::options::DisparityRange;

use super::args::Args;
use crate::console;
use crate::failure::{Failure, Result};
use crate::outputs::{
    Also, Files, InFront, MatchRecord, Outcome, View, Written, also, files, other_sign, page,
};
use crate::pairs::input::Input;

/// The paths of the match, for a record.
pub(super) fn record_files<V>(args: &Args, input: &Input<V>) -> Files {
    let prior = args.prior.file().map(|path| path.display().to_string());
    Files { prior, ..args.pair.files(input, Some(args.output())) }
}

/// Prints remarks about the outputs: why they are empty, or what was `said` of each, with the unit of depths.
pub(super) fn say_end(args: &Args, outcome: &Outcome, is_found: bool, unit: Option<&str>, said: &[String]) {
    if args.quiet {
        return;
    }
    if let Some(why) = empty(args, outcome, is_found) {
        console::say(&format!("warning: {why}"));
    }
    if let Some(unit) = unit.filter(|_| !said.is_empty()) {
        console::say(&format!("{}; unit: {unit}", said.join("; ")));
    }
}

/// Why depths and points come out empty, or nearly so, and what helps. The range may be one that `is_found` by matches.
fn empty(args: &Args, outcome: &Outcome, is_found: bool) -> Option<String> {
    let rig = outcome.rig.as_ref()?;
    let in_front = InFront::of(&outcome.maps.final_map(), rig);
    if in_front.all == 0 {
        let why = "no pixel has a disparity, so there is no depth: check that both images show the same scene, and check the range";
        return Some(why.into());
    }
    let turned = if is_found {
        "the views may be swapped: swap the two images".into()
    } else {
        format!("{}, or swap the two images", other_sign(args.sign))
    };
    let check = "check that the calibration (doffs, baseline) belongs to this pair, and that the range covers what is in front of the cameras";
    in_front.doubt(&turned, check).or_else(|| args.also.left_out(outcome))
}

/// Checks before any computing that all outputs can be written. Returns the files of `--also`.
pub(super) fn check_outputs<V>(args: &Args, input: &Input<V>) -> Result<Vec<(&'static Also, PathBuf)>> {
    let output = args.output();
    if files::is_printed(output) {
        if let Some(word) = args.also.wanted().next() {
            let reason = "is written beside OUTPUT, but `-` is not a file; give a file as OUTPUT";
            return Err(Failure::usage(word.flag(), reason));
        }
        console::check_takes_data()?;
    }
    check_range(args, input.range)?;
    let also: Vec<_> = args.also.wanted().map(|word| (word, word.beside(output))).collect();
    files::check_json_path(args.json.as_deref())?;
    let mut inputs = args.pair.inputs(input);
    inputs.extend(args.prior.inputs());
    inputs.extend(args.method.files().map(|path| ("the file of --method", path)));
    inputs.extend(args.also.into.as_deref().map(|path| ("the file of --into", path)));
    let flags: Vec<_> = also.iter().map(|(word, path)| (word.flag(), path.as_path())).collect();
    let outputs = std::iter::once(("OUTPUT", output))
        .chain(flags.iter().map(|(flag, path)| (flag.as_str(), *path)))
        .chain(args.json.as_deref().map(|path| ("--json", path)));
    files::distinct(&inputs, &outputs.collect::<Vec<_>>())?;
    Ok(also)
}

/// Checks that the outputs can store disparities of `range`.
pub(super) fn check_range(args: &Args, range: DisparityRange) -> Result<()> {
    let (output, range) = (args.output(), args.sign.range(range));
    if !files::is_printed(output) {
        write::check_disparity_path(output, range.min, range.max)?;
    }
    Ok(args.also.wanted().try_for_each(|word| word.check(&word.beside(output), range))?)
}

/// Shows the page in the browser if --show asks for it. The outputs are there already, so a failure is only said.
pub(super) fn show(args: &Args, also: &[(&Also, PathBuf)], outcome: &Outcome) {
    if !args.show {
        return;
    }
    let output = args.output();
    let name = if files::is_printed(output) { "map".into() } else { page::name(output) };
    let page = match also.iter().find(|(word, _)| word.is_view()) {
        Some((_, path)) => Ok(path.clone()),
        None => page::aside(&name, |path| args.also.write(also::view(), path, outcome).map(|_| ())),
    };
    match page {
        Ok(path) => page::show(&path, args.quiet),
        Err(failure) => console::say(&format!("--show: {failure}")),
    }
}

/// Writes all outputs, or none. Returns remarks about depths and points.
pub(super) fn write_outputs(
    args: &Args,
    also: &[(&Also, PathBuf)],
    outcome: &Outcome,
    record: &MatchRecord,
) -> Result<Vec<String>> {
    let output = args.output();
    let map = || outcome.sign.map(outcome.final_map(args.also.limits));
    let mut written = Written::default();
    let mut said = Vec::new();
    if !files::is_printed(output) {
        written.note(output, outcome.writer(View::Left).disparity(output, &map()))?;
    }
    for (word, path) in also {
        said.extend(written.note(path, args.also.write(word, path, outcome))?);
    }
    // Report each remark once, even if the points are written in several formats.
    said.dedup();
    let json =
        args.json.as_deref().map(|path: &Path| Ok::<_, Failure>((path, files::json_text(path, record)?)));
    let json = json.transpose()?;
    if let Some((path, text)) = json.as_ref().filter(|(path, _)| !files::is_printed(path)) {
        written.note(path, write::save(path, text.as_bytes()))?;
    }
    // Printing cannot be undone, so it comes last.
    if files::is_printed(output) {
        console::print_data(&pfm::encode(&map()), "map")?;
    }
    written.keep();
    if let Some((_, text)) = json.filter(|(path, _)| files::is_printed(path)) {
        console::print(&text)?;
    }
    Ok(said)
}
