//! Matching of sequences: an iterator of pairs in, an iterator of results out, keeping the device busy.

use std::ops::ControlFlow;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use mrfgs::image::Pair;
use mrfgs::low_level::process::Own;
use mrfgs::options::{DisparityRange, Method};
use mrfgs::{Error, Frame, Matched, SharedMatcher, check};
use pyo3::exceptions::{PyException, PyMemoryError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyIterator;

use crate::arrays::{self, Image};
use crate::exceptions::{self, exception};
use crate::matched::PyMatched;
use crate::{prior, range};

/// Interval at which a wait checks for Ctrl-C.
pub(crate) const PATIENCE: Duration = Duration::from_millis(50);

/// Pairs consumed before their results are requested: one being downloaded, one being matched, one waiting.
const AHEAD: usize = 3;

/// The matcher of iterators, and which process uses it.
#[derive(Clone)]
pub(crate) struct Shared {
    pub(crate) matcher: Arc<SharedMatcher>,
    /// The process in which an iterator uses the matcher; 0 for none.
    pub(crate) taken: Arc<AtomicU32>,
}

impl Shared {
    pub(crate) fn new(matcher: SharedMatcher) -> Self {
        Self { matcher: Arc::new(matcher), taken: Arc::new(AtomicU32::new(0)) }
    }

    /// Refuses a matcher in the middle of a sequence, which would wait for pairs forever.
    pub(crate) fn check(&self) -> PyResult<()> {
        if self.taken.load(Ordering::Acquire) == process::id() {
            let reason = "this Matcher is in the middle of match_all; finish or close that iterator, or use another Matcher";
            return Err(PyRuntimeError::new_err(reason));
        }
        Ok(())
    }
}

/// The settings of a sequence.
pub(crate) struct Settings {
    pub(crate) method: Method,
    pub(crate) range: Option<DisparityRange>,
    pub(crate) min_disparity: Option<i32>,
    pub(crate) no_data: Option<f64>,
    /// Whether the maps of each frame are known in the next.
    pub(crate) follow: bool,
    pub(crate) warn: bool,
}

/// The results of Matcher.match_all, in the order of the pairs.
#[pyclass(name = "MatchedSequence", frozen, module = "mrfgs")]
pub(crate) struct PyMatchedSequence(Mutex<State>);

struct State {
    shared: Shared,
    settings: Settings,
    /// `None` after the last pair.
    pairs: Option<Py<PyIterator>>,
    /// The exception that ended the pairs, raised after the results of earlier pairs.
    failure: Option<PyErr>,
    /// Pairs consumed, and results returned.
    counts: [usize; 2],
    /// The size of the last pair, and the range that it was searched over.
    last: Option<((usize, usize), DisparityRange)>,
    /// Exists from the first pair to the last result.
    worker: Option<Own<Worker>>,
    ended: bool,
}

impl PyMatchedSequence {
    pub(crate) fn new(shared: Shared, settings: Settings, pairs: Bound<PyIterator>) -> Self {
        let pairs = Some(pairs.unbind());
        let state = State {
            shared,
            settings,
            pairs,
            failure: None,
            counts: [0; 2],
            last: None,
            worker: None,
            ended: false,
        };
        Self(Mutex::new(state))
    }
}

#[pymethods]
impl PyMatchedSequence {
    fn __iter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __next__(&self, py: Python) -> PyResult<Option<PyMatched>> {
        // Waiting for another thread here would block it, as this one holds the interpreter.
        let mut state = self.0.try_lock().map_err(|_| in_use())?;
        let next = state.next(py);
        if !matches!(next, Ok(Some(_))) {
            state.end(py);
        }
        next
    }

    /// Ends the sequence: stops the running match, consumes no more pairs, and releases the matcher. This is automatic after the last pair,
    /// after an exception, and once nothing refers to the iterator.
    fn close(&self, py: Python) -> PyResult<()> {
        self.0.try_lock().map_err(|_| in_use())?.end(py);
        Ok(())
    }
}

fn of_parent() -> PyErr {
    PyRuntimeError::new_err(
        "this iterator belongs to the parent of this forked process; call match_all again here",
    )
}

fn in_use() -> PyErr {
    PyValueError::new_err("this iterator is already in use, by another thread or by its own pairs")
}

impl State {
    fn next(&mut self, py: Python) -> PyResult<Option<PyMatched>> {
        if self.ended {
            return Ok(None);
        }
        if self.worker.is_none() {
            self.shared.check()?;
            self.worker = Some(Own::new(Worker::new(&self.shared, &self.settings)));
        }
        self.worker()?;
        while self.pairs.is_some() && self.counts[0] - self.counts[1] < AHEAD {
            match self.take(py) {
                Ok(Some(frame)) => {
                    self.counts[0] += 1;
                    // The error of an ended worker is raised below.
                    if !self.worker()?.send(frame) {
                        self.pairs = None;
                    }
                }
                Ok(None) => self.pairs = None,
                Err(error) if error.is_instance_of::<PyException>(py) => {
                    self.failure = Some(error);
                    self.pairs = None;
                }
                // Ctrl-C and the like.
                Err(error) => return Err(error),
            }
        }
        let no_more = self.pairs.is_none();
        let worker = self.worker.as_mut().and_then(Own::get_mut).ok_or_else(of_parent)?;
        if no_more {
            worker.pairs = None;
        }
        loop {
            let results = &mut worker.results;
            match py.detach(move || results.recv_timeout(PATIENCE)) {
                Ok(matched) => {
                    self.counts[1] += 1;
                    if self.settings.warn {
                        exceptions::warn(py, matched.warnings())?;
                    }
                    return PyMatched::of(py, matched).map(Some);
                }
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        worker.result().map_err(|error| numbered(py, self.counts[1], error))?;
        self.failure.take().map_or(Ok(None), Err)
    }

    /// The worker, in the process that created it.
    fn worker(&self) -> PyResult<&Worker> {
        self.worker.as_ref().and_then(Own::get).ok_or_else(of_parent)
    }

    /// The next pair, with its range and its prior.
    fn take(&mut self, py: Python) -> PyResult<Option<Frame>> {
        let Some(item) = self.pairs.as_ref().and_then(|pairs| pairs.bind(py).clone().next()) else {
            return Ok(None);
        };
        let item = item?;
        self.frame(&item).map(Some).map_err(|error| numbered(py, self.counts[0], error))
    }

    fn frame(&mut self, item: &Bound<PyAny>) -> PyResult<Frame> {
        let count = item.len().ok().filter(|count| [2, 3].contains(count));
        let one = |i: usize| count.and_then(|_| item.get_item(i).ok());
        let Some((left, right)) = one(0).zip(one(1)) else {
            return Err(PyTypeError::new_err("give two arrays, left and right, or these and a prior"));
        };
        let [left, right] = Image::both(&left, &right)?;
        let pair = arrays::pair(&left, &right, None, self.settings.no_data)?;
        let prior = one(2).map(|given| prior::of_pair(pair.size(), &given)).transpose()?.flatten();
        let range = self.range(item.py(), &pair)?;
        Ok(Frame::new(pair, range).with_prior(prior))
    }

    /// Finds the range and checks for likely faults, unless the last pair of the same cameras has shown both.
    fn range(&mut self, py: Python, pair: &Pair) -> PyResult<DisparityRange> {
        let Settings { ref method, range: given, min_disparity, warn, .. } = self.settings;
        let matcher = &self.shared.matcher;
        let is_alike = |(size, _): &((usize, usize), DisparityRange)| *size == pair.size();
        if let Some((_, range)) = self.last.filter(is_alike).filter(|_| method.front.measure_every > 1) {
            return Ok(range);
        }
        let found = range::searched(py, matcher, pair, given, min_disparity)?;
        if warn {
            let checked = py.detach(|| matcher.share(pair, || check::warnings(pair, given)));
            exceptions::warn(py, checked.map_err(exception)?)?;
        }
        self.last = Some((pair.size(), found));
        Ok(found)
    }

    fn end(&mut self, py: Python) {
        self.ended = true;
        self.pairs = None;
        let worker = self.worker.take();
        py.detach(move || drop(worker));
    }
}

/// Adds the index of the pair to an exception.
fn numbered(py: Python, index: usize, error: PyErr) -> PyErr {
    let kind = error.get_type(py);
    let ours = [
        py.get_type::<PyValueError>(),
        py.get_type::<PyTypeError>(),
        py.get_type::<PyMemoryError>(),
        py.get_type::<PyRuntimeError>(),
    ];
    if !ours.iter().any(|ours| kind.is(ours)) {
        return error;
    }
    let numbered = PyErr::from_type(kind, format!("pair {index}: {}", error.value(py)));
    numbered.set_cause(py, error.cause(py));
    numbered
}

/// A thread that matches the pairs it receives.
struct Worker {
    pairs: Option<SyncSender<Frame>>,
    results: Receiver<Matched>,
    thread: Option<JoinHandle<mrfgs::Result<()>>>,
    stop: Arc<AtomicBool>,
    taken: Arc<AtomicU32>,
}

impl Worker {
    fn new(shared: &Shared, settings: &Settings) -> Self {
        let (pairs, asked) = mpsc::sync_channel(AHEAD);
        let (found, results) = mpsc::channel();
        let (stop, taken) = (Arc::new(AtomicBool::new(false)), Arc::clone(&shared.taken));
        taken.store(process::id(), Ordering::Release);
        let (matcher, told) = (Arc::clone(&shared.matcher), Arc::clone(&stop));
        let (method, follow) = (settings.method.clone(), settings.follow);
        let thread = thread::spawn(move || {
            matcher.turn(|matcher| {
                matcher.set_method(method);
                let take = |matched| match found.send(matched) {
                    Ok(()) => ControlFlow::Continue(()),
                    Err(_) => ControlFlow::Break(()),
                };
                if follow {
                    matcher.run_following(asked, &told, take)
                } else {
                    matcher.run_all_until(asked, &told, take)
                }
            })
        });
        Self { pairs: Some(pairs), results, thread: Some(thread), stop, taken }
    }

    /// Sends a pair, and returns whether the worker took it; there is always room, so it does unless it has ended.
    fn send(&self, frame: Frame) -> bool {
        self.pairs.as_ref().is_some_and(|pairs| pairs.send(frame).is_ok())
    }

    /// The result of the ended worker.
    fn result(&mut self) -> PyResult<()> {
        match self.thread.take().map(JoinHandle::join) {
            None | Some(Ok(Ok(()) | Err(Error::Interrupted))) => Ok(()),
            Some(Ok(Err(error))) => Err(exception(error)),
            Some(Err(_)) => Err(PyRuntimeError::new_err("the match panicked, which is a bug in mrfgs")),
        }
    }
}

impl Drop for Worker {
    /// Ends the thread, which does not need Python, and waits until the matcher is free.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.pairs = None;
        let _ = self.thread.take().map(JoinHandle::join);
        self.taken.store(0, Ordering::Release);
    }
}
