//! Reading, matching and writing at the same time.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use mrfgs::check::Warning;
use mrfgs::drift::Turn;
use mrfgs::image::Pair;
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;
use mrfgs::region::Region;
use mrfgs::{Frame, Matched, Matcher, Prior};
use mrfgs_ros::messages::Stamp;
use serde::Serialize;

use crate::args::Sign;
use crate::failure::{Failure, Result};
use crate::outputs::{Files, MatchRecord};
use crate::pairs::input;
use crate::progress::Counter;
use crate::sequences::known::{self, CloudDoubt, Follow, FramePriors};
use crate::sequences::{FramePair, Frames, Rectifier, turned};
use crate::text::plural;
use crate::{console, remedy, stop};

use super::writer::{MatchedFrame, Sink};

/// Frames queued between two steps, enough to keep both busy.
const WAITING: usize = 2;
/// Interval at which a wait for a frame checks for a stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// Matches the frames of a sequence.
pub(super) struct Pipeline {
    pub(super) matcher: Matcher,
    pub(super) range: DisparityRange,
    /// The selected region; `None` for all of the view.
    pub(super) region: Option<Region>,
    /// The input paths for the records.
    pub(super) files: Files,
    pub(super) rectified: bool,
    /// Whether frames are corrected for a right camera that has turned.
    pub(super) recalibrate: bool,
    pub(super) quiet: bool,
}

/// Data that the writer needs besides the maps.
#[derive(Clone, Copy)]
struct WriterNeeds {
    pair: bool,
    record: bool,
}

/// A rectified frame, or the error that ended the frames.
type NextFrame = Result<ReadyFrame>;

/// A rectified frame.
struct ReadyFrame {
    frame: FramePair,
    /// The turn of the right camera so far.
    turn: Option<Turn>,
    prior: Option<Arc<Prior>>,
}

impl Pipeline {
    /// Matches `first`, which is already rectified, and all `frames`, which `rectifier` rectifies, each with its prior, and writes the
    /// results.
    ///
    /// # Errors
    /// Errors of reading, matching and writing, and a stop by the user. Earlier results are written in any case.
    pub(super) fn run(
        mut self,
        first: FramePair,
        frames: Frames,
        mut rectifier: Rectifier,
        priors: FramePriors,
        sink: &mut Sink,
    ) -> Result<()> {
        let start = Instant::now();
        let region = self.region.as_ref();
        let size = region.map_or(first.pair.size(), |region| region.part().size());
        let takes = WriterNeeds { pair: sink.takes_pair(), record: sink.takes_records() };
        let mut bar = Counter::of_frames(frames.len(), self.quiet);
        let (sender, receiver) = sync_channel(WAITING);
        let turn = rectifier.followed(&first.pair)?;
        let mut clouds_told = [self.quiet; 2];
        let prior = prior_of(&priors, &first, &mut clouds_told)?;
        let follow = priors.follow();
        let told = first.pair.doubts().each_ref().map(|doubt| self.quiet || doubt.is_some());
        // Not joined, as it may wait for standard input forever.
        thread::spawn(move || read(frames, rectifier, &priors, [told, clouds_told], &sender));
        let (found, to_write) = sync_channel::<MatchedFrame>(WAITING);
        let (matched, written) = thread::scope(|scope| {
            let writing = scope.spawn(|| write(to_write, sink, &mut bar));
            let first = ReadyFrame { frame: first, turn, prior };
            let matched = self.matched(first, follow.as_ref(), &receiver, takes, start, found);
            (matched, writing.join())
        });
        drop(bar);
        let (done, written) =
            written.unwrap_or((0, Err(Failure::Failed("the writer of maps failed".into()))));
        let MatchingOutcome { on, note, turn, ended } = matched;
        // A failed writer also ends the matching, so its error is the cause.
        let ended = written.and(ended);
        if !self.quiet {
            if let Some(note) = note {
                console::say(&note);
            }
            if let Some(said) = turn.and_then(|turn| turned(&turn, self.recalibrate)) {
                console::say(&said);
            }
            let seconds = start.elapsed().as_secs_f64();
            let (width, height) = size;
            console::say(&format!(
                "{done} frame{} of {width} x {height}, {} disparities, in {seconds:.2} s: {:.1} per second{}",
                plural(done),
                self.range.labels(),
                done as f64 / seconds,
                on.map(|on| format!(" on {on}")).unwrap_or_default()
            ));
        }
        ended.map_err(|failure| match failure {
            Failure::Stopped(_) => Failure::Stopped(format!("stopped after {done} frame{}", plural(done))),
            failure => failure,
        })
    }

    /// Matches all frames, which may `follow` from each other, and passes the results on.
    fn matched(
        &mut self,
        first: ReadyFrame,
        follow: Option<&Follow>,
        frames: &Receiver<NextFrame>,
        takes: WriterNeeds,
        start: Instant,
        found: SyncSender<MatchedFrame>,
    ) -> MatchingOutcome {
        let Self { matcher, range, region, files, rectified, .. } = self;
        let region = region.as_ref();
        // Crops a pair to the region, and to the window that must be matched for it.
        let narrowed = |pair: Pair| match region {
            Some(region) => (pair.crop(region.part()), region.window_of(&pair)),
            None => (pair.clone(), pair),
        };
        let range = *range;
        // The frames being matched.
        let (started, under_way) = channel();
        let mut failure = None;
        let mut next = Some(Ok(first));
        let (mut count, quiet) = (0, self.quiet);
        let pairs = std::iter::from_fn(|| {
            let ReadyFrame { frame, turn, prior } =
                match next.take().map_or_else(|| received(frames).map(Result::flatten), Some)? {
                    Ok(frame) => frame,
                    Err(error) => {
                        failure = Some(error);
                        return None;
                    }
                };
            if let Some(doubt) = follow.and_then(|follow| follow.ended(count)).filter(|_| !quiet) {
                console::say(&format!("warning: {doubt}"));
            }
            count += 1;
            // The receiver outlives this send, so it cannot fail.
            let (part, window) = narrowed(frame.pair);
            let about = (frame.name, frame.header, turn);
            let _ = started.send((about, part.georeferences(), takes.pair.then_some(part)));
            Some(Frame::new(window, range).with_prior(prior))
        });
        let mut ran = MatchingOutcome { on: None, note: None, turn: None, ended: Ok(()) };
        let told = &mut ran;
        let mut doubted = self.quiet;
        let take = move |mut matched: Matched| {
            let Ok(((name, header, turn), georeferences, pair)) = under_way.try_recv() else {
                return ControlFlow::Break(());
            };
            let note = matched.note.as_ref().map(|note| remedy::error(note, &remedy::FLAGS));
            told.note = note.or(told.note.take());
            told.turn = turn.or(told.turn);
            // Once, as it may hold for all frames.
            if !doubted
                && follow.is_none_or(Follow::moves)
                && let Some(doubt) = known::contradicted(&matched)
            {
                doubted = true;
                console::say(&format!("warning: frame {name}: {doubt}"));
            }
            if let Some(region) = region {
                matched.maps = region.maps_of(&matched.maps);
            }
            let record = takes.record.then(|| {
                let mut record = MatchRecord::new(files, &matched, start.elapsed(), Sign::default());
                record.rectified = *rectified;
                record.region = region.map(|region| [region.part().x.start, region.part().y.start]);
                line(&name, turn.map(|turn| turn.degrees()), &record)
            });
            told.on = Some(matched.ran_on);
            match found.send(MatchedFrame { name, header, georeferences, maps: matched.maps, pair, record }) {
                Ok(()) => ControlFlow::Continue(()),
                // The writer reports the cause when it is joined.
                Err(_) => ControlFlow::Break(()),
            }
        };
        let ended = match follow {
            Some(follow) => {
                let mut done = 0;
                let known = |maps: &Maps| {
                    done += 1;
                    follow.next(done - 1, maps)
                };
                matcher.run_knowing(pairs, stop::flag(), known, take)
            }
            None => matcher.run_all_until(pairs, stop::flag(), take),
        };
        ran.ended = match (ended, failure) {
            (Err(error), _) => Err(error.into()),
            (Ok(()), Some(failure)) => Err(failure),
            (Ok(()), None) => Ok(()),
        };
        ran
    }
}

/// The record of a frame as a line of JSON.
fn line(frame: &str, turned: Option<[f64; 3]>, record: &MatchRecord) -> String {
    #[derive(Serialize)]
    struct Line<'a> {
        frame: &'a str,
        #[serde(skip_serializing_if = "Option::is_none")]
        turned: Option<[f64; 3]>,
        #[serde(flatten)]
        record: &'a MatchRecord<'a>,
    }
    // Cannot fail: all fields are numbers, texts and maps with text keys.
    serde_json::to_string(&Line { frame, turned, record }).unwrap_or_default() + "\n"
}

/// The outcome of the matching.
struct MatchingOutcome {
    /// The device.
    on: Option<String>,
    /// Why it did not run on the preferred device.
    note: Option<String>,
    /// The turn of the right camera at the last frame.
    turn: Option<Turn>,
    ended: Result<()>,
}

/// Runs `work`, which may wait for standard input forever.
///
/// # Errors
/// If the user stops it.
pub(super) fn patiently<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T> {
    let (sender, receiver) = sync_channel(1);
    thread::spawn(move || sender.send(work()));
    match received(&receiver) {
        Some(done) => done.map_err(|_| Failure::Stopped("stopped before the first frame".into())),
        None => Err(Failure::Failed("the reader of frames failed".into())),
    }
}

/// The next item; `None` after the last one.
///
/// # Errors
/// If the user stops it.
fn received<T>(from: &Receiver<T>) -> Option<Result<T>> {
    loop {
        if stop::go_on().is_break() {
            return Some(Err(Failure::Stopped(String::new())));
        }
        match from.recv_timeout(PATIENCE) {
            Ok(next) => return Some(Ok(next)),
            Err(RecvTimeoutError::Disconnected) => return None,
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Reads and rectifies frames until one fails or the receiver is gone. Warns of the first damaged image of each camera, unless it has been
/// `told`.
fn read(
    frames: Frames,
    mut rectifier: Rectifier,
    priors: &FramePriors,
    [mut told, mut clouds_told]: [[bool; 2]; 2],
    to: &SyncSender<NextFrame>,
) {
    for frame in frames {
        let doubts = frame.iter().flat_map(|frame| frame.pair.doubts().iter().enumerate());
        for (side, doubt) in doubts {
            if let Some(doubt) = doubt.as_ref().filter(|_| !std::mem::replace(&mut told[side], true)) {
                input::warn([Warning::Damaged { doubt: doubt.clone() }]);
            }
        }
        let rectified = |frame: FramePair| {
            let prior = prior_of(priors, &frame, &mut clouds_told)?;
            let (pair, turn) = rectifier.rectified(frame.pair)?;
            Ok(ReadyFrame { frame: FramePair { pair, ..frame }, turn, prior })
        };
        let frame = frame.map_err(Failure::from).and_then(rectified);
        let failed = frame.is_err();
        if to.send(frame).is_err() || failed {
            return;
        }
    }
}

/// The prior of a frame, from the cloud at its time or by its name. Warns of the first frame without a cloud and of the first cloud that
/// cannot be used; `told` keeps which of the two has been said.
fn prior_of(priors: &FramePriors, frame: &FramePair, told: &mut [bool; 2]) -> Result<Option<Arc<Prior>>> {
    let cloud = frame.cloud.as_ref().map(|cloud| (cloud.data.as_slice(), cloud.encoding));
    let stamp = frame.header.as_ref().map_or_else(Stamp::default, |header| header.stamp);
    match priors.of_cloud(cloud, stamp) {
        Ok(Some(prior)) => return Ok(Some(prior)),
        Ok(None) => {}
        Err(doubt) => {
            let (kind, doubt) = match doubt {
                CloudDoubt::Missing(doubt) => (0, doubt),
                CloudDoubt::Unusable(doubt) => (1, doubt),
            };
            if !std::mem::replace(&mut told[kind], true) {
                console::say(&format!("warning: {doubt}"));
            }
        }
    }
    priors.of(&frame.name)
}

/// Writes the frames that arrive. Returns how many were written.
fn write(found: Receiver<MatchedFrame>, sink: &mut Sink, bar: &mut Counter) -> (usize, Result<()>) {
    let mut done = 0;
    let mut ended = Ok(());
    for found in found {
        ended = sink.add(found);
        if ended.is_err() {
            break;
        }
        done += 1;
        bar.end_frame();
    }
    (done, sink.finish().and(ended))
}
