//! `mrfgs match`.

mod args;
mod in_blocks;
mod outputs;
mod request;

use std::fmt::Write as _;
use std::sync::Arc;

use mrfgs::image::{Pair, Rect};
use mrfgs::low_level::plan::Plan;
use mrfgs::options::DisparityRange;
use mrfgs::region::{Blocks, Region};
use mrfgs::sigma::Sigma;
use mrfgs::{Matcher, check};

use crate::args::PriorView;
use crate::failure::{Failure, Result};
use crate::outputs::{MatchRecord, Outcome};
use crate::pairs::input::{self, Input};
use crate::pairs::large::{LargePair, PairFiles, UnreadPair};
use crate::{console, matching, plan, stop};

pub(crate) use args::Args;
use outputs::{check_outputs, check_range, record_files, say_end, show, write_outputs};
use request::Request;

pub(crate) fn run(mut args: Args) -> Result<()> {
    args.pair.leave(&mut args.output)?;
    if args.output.is_none() {
        // The only name after that of one view is that of the map.
        if args.pair.right.as_ref().is_some_and(|right| !right.exists()) {
            return Err(input::without_right(&args.pair.left));
        }
        return Err(Failure::usage("OUTPUT", "missing; give a file for the map, such as disparity.pfm"));
    }
    stop::listen();
    let request = Request::new(&args)?;
    if args.dry_run
        && let Some(files) = request.files()
    {
        return dry_run(&request, files);
    }
    if !args.dry_run && request.goes_by_blocks()? {
        return in_blocks::run(&request);
    }
    if let (Some(part), Some(files)) = (&args.region.roi, request.files()) {
        let (input, read) = stop::at_once(|| window_of(&request, files, part))?;
        return run_on(&request, input, read);
    }
    let input = stop::at_once(|| request.input())?;
    let whole = Rect::whole(input.size);
    run_on(&request, input, whole)
}

/// The window of the pair that a match of the region `part` reads, and where it is.
fn window_of(request: &Request, files: PairFiles, part: &Rect) -> Result<(Input, Rect)> {
    let large = LargePair::of_files(files.open(&request.scratch())?, &request.method);
    let input = request.input_of(large)?;
    // A second match may search a wider range.
    let widest = check::beyond(input.range).filter(|_| input.has_found_range()).unwrap_or(input.range);
    input.region(part)?;
    let window = Region::new(part.clone(), input.size, widest)?.window().clone();
    Ok((input.with_views(|large| Ok(large.window(&window)?))?, window))
}

/// Prints the plan of a match, from the headers of the files alone where the range is given.
fn dry_run(request: &Request, files: PairFiles) -> Result<()> {
    let args = request.args;
    let views = UnreadPair::new(files, &request.method, request.scratch())?;
    let input = stop::at_once(|| request.input_of(views))?;
    if !args.quiet {
        input.say_range(args.sign, "");
    }
    let known = input.rig(request.need.as_ref(), &args.pair.left)?;
    let region = args.region.roi.as_ref().map(|part| input.region(part)).transpose()?;
    check_outputs(args, &input)?;
    let view = PriorView { size: input.size, sign: args.sign, rig: input.as_taken(known) };
    let prior = args.prior.read(view)?;
    let window = region.as_ref().map(|region| region.window().size());
    print_plan(request, input.size, window, input.range, prior.is_some())
}

/// Prints the plan of a match of the `window` of a pair of this `size`, or of all of it.
fn print_plan(
    request: &Request,
    size: (usize, usize),
    window: Option<(usize, usize)>,
    range: DisparityRange,
    prior: bool,
) -> Result<()> {
    let method = &request.method;
    let by_blocks = request.args.blocks.blocks.is_some() || Blocks::pay(size, range, method)?;
    if window.is_some() || !by_blocks {
        let (width, height) = window.unwrap_or(size);
        let plan = Plan::new(width, height, range, method)?.with_prior(prior);
        return Ok(console::print(&plan::describe(&plan)?)?);
    }
    let blocks = Blocks::new(size, range, method)?;
    let mut text = plan::describe_blocks(&blocks, range, method)?;
    if let Some((complete, all)) = in_blocks::progress(request, &blocks)? {
        let _ = writeln!(text, "\n{complete} of {all} blocks are complete");
    }
    Ok(console::print(&text)?)
}

/// Matches a pair, or a region of it; `read` is the part of the views that was read.
fn run_on(request: &Request, input: Input, read: Rect) -> Result<()> {
    let Request { args, execution, method, cameras, need, third, .. } = request;
    let range = input.range;
    if !args.quiet {
        input.say_range(args.sign, "");
    }
    let known = input.rig(need.as_ref(), &args.pair.left)?;
    let mut rig = known.filter(|_| cameras.is_some());
    let part = args.region.roi.as_ref();
    part.map(|part| input.region(part)).transpose()?;
    // The region in the pixels that were read.
    let inner = part.map(|part| part.within(&read));
    let region = inner.clone().map(|inner| Region::new(inner, input.pair.size(), range)).transpose()?;
    let also = check_outputs(args, &input)?;
    if !args.quiet {
        input.warn(region.as_ref());
    }
    let view = PriorView { size: input.size, sign: args.sign, rig: input.as_taken(known) };
    let prior = args.prior.read(view)?;
    let prior =
        prior.map(|prior| if read == Rect::whole(input.size) { prior } else { Arc::new(prior.crop(&read)) });
    if args.dry_run {
        let window = region.as_ref().map(|region| region.window().size());
        return print_plan(request, input.size, window, range, prior.is_some());
    }
    let mut matcher = Matcher::builder().execution(execution.clone()).build()?;
    let searched = input.searched(|wider| check_range(args, wider).is_ok());
    let searched = searched.in_region(inner.as_ref()).with_prior(prior.as_ref());
    let (matched, time) = matching::run(&mut matcher, &input.pair, searched, method, None, args.quiet, None)?;
    let range = matched.range();
    let mut pair = input.pair.clone();
    if let Some((part, inner)) = part.zip(inner) {
        pair = pair.crop(&inner);
        rig = rig.map(|rig| rig.of_part(part.x.start, part.y.start));
    }
    if !args.quiet {
        input.say_wider(&matched, args.sign, "");
        input::warn(matched.warnings().into_iter().map(|warning| args.sign.warning(warning)));
    }
    // Free its memory for the outputs.
    drop(matcher);
    let files = record_files(args, &input);
    let unit = input.unit();
    let georeferences = pair.georeferences();
    let is_found = input.has_found_range();
    let rectifying = input.rectifying();
    let trust = input.rectification.as_ref().and_then(|by| by.trust().copied());
    drop(input);
    let pair = Some(pair).filter(|_| args.show_left());
    let left = pair.as_ref().map(Pair::left);
    let (maps, sign, sigma) = (&matched.maps, args.sign, Some(Sigma::for_method(method)));
    let outcome = Outcome { maps, range, sign, left, rig, rectifying, third: *third, sigma, georeferences };
    let mut record = MatchRecord::new(&files, &matched, time, args.sign);
    record.rectified = args.rectify;
    record.region = args.region.roi.as_ref().map(|part| [part.x.start, part.y.start]);
    record.trust = trust;
    let said = write_outputs(args, &also, &outcome, &record)?;
    say_end(args, &outcome, is_found, unit.as_deref(), &said);
    show(args, &also, &outcome);
    Ok(())
}
