//! Matches the pairs of a sequence in parallel on the CPU path.
//!
//! Some steps of a match are sequential, and others are too short to parallelize if images are small. So each
//! thread takes its own pair while enough of them wait, and otherwise helps with the rows of another.

use super::corrections::Corrections;
use super::{Frame, Matched, Matcher, fits, timed};
use crate::error::{ExecutionError, Purpose, Result};
use crate::front::conditioning::Conditioning;
use crate::memory;
use crate::options::Method;
use crate::plan::Plan;
use crate::program::tiles::Tiles;
use crate::watch::{Observer, goes_on};
use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel, sync_channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;

/// Matches the pairs of `frames`, and passes the results to `take`, in order, until it breaks.
///
/// # Errors
/// The errors of a match, after the results of all pairs before have been passed on.
pub(super) fn side_by_side(
    matcher: &mut Matcher,
    frames: impl Iterator<Item = Frame>,
    mut corrections: Corrections,
    cancel: &AtomicBool,
    take: impl FnMut(Matched) -> ControlFlow<()> + Send,
) -> Result<()> {
    let Matcher { method, threads, cpus, given_up, .. } = matcher;
    let (method, given_up) = (&*method, &*given_up);
    let pool = threads.pool(usize::MAX)?;
    let room = Room::new(pool.current_num_threads(), u64::from(method.tiles.memory) << 20);
    let (cpus, stop) = (Mutex::new(cpus), AtomicBool::new(false));
    let matched = |Frame { pair, prior, .. }: &Frame,
                   tiles: &Tiles,
                   known: Option<Conditioning>,
                   bytes: u64| {
        let observer: Observer = &mut |_| goes_on([cancel, &stop]);
        let mut cpu = {
            let mut idle = locked(&cpus);
            let cpu = idle.pop().unwrap_or_default();
            // Limit the memory that idle CPU paths keep.
            idle.truncate(
                usize::try_from(room.most.1 / bytes.max(1)).unwrap_or(usize::MAX).saturating_sub(1),
            );
            cpu
        };
        let matched =
            pollster::block_on(timed(&mut cpu, false, tiles, (pair, known, prior.as_ref()), observer, None));
        locked(&cpus).push(cpu);
        Ok(Matched { note: given_up.clone(), ..matched? })
    };
    let (matched, stop) = (&matched, &stop);
    let (begun, answers) = channel();
    let ended = thread::scope(|scope| {
        let taking = thread::Builder::new().spawn_scoped(scope, move || {
            let ended = hand_out(&answers, take);
            stop.store(true, Ordering::Relaxed);
            ended
        });
        let taking = taking.map_err(|e| ExecutionError::Threads(e.to_string()))?;
        pool.in_place_scope(|scope| {
            for frame in frames {
                let planned = planned(&frame, method);
                let share = room.share(planned.as_ref().map_or(0, |(_, bytes)| *bytes));
                // Measure here: the next frames need it, and a thread of the pool that waited for it might wait for itself.
                let planned = planned.and_then(|(tiles, bytes)| {
                    let observer: Observer = &mut |_| goes_on([cancel, stop]);
                    let known = pool.install(|| corrections.of(&frame.pair, tiles.whole(), observer))?;
                    Ok((tiles, known, bytes))
                });
                let (answer, answered) = sync_channel(1);
                if begun.send(answered).is_err() {
                    // `take` has ended.
                    break;
                }
                scope.spawn(move |_| {
                    let _ = answer.send(
                        planned.and_then(|(tiles, known, bytes)| matched(&frame, &tiles, known, bytes)),
                    );
                    drop(share);
                });
            }
            drop(begun);
        });
        taking.join().unwrap_or_else(|panic| resume_unwind(panic))
    });
    // Later single pairs need only one.
    locked(&cpus).truncate(1);
    ended
}

/// The tiles of a match, and the most bytes that it needs.
fn planned(Frame { pair, range, prior }: &Frame, method: &Method) -> Result<(Tiles, u64)> {
    let (width, height) = pair.size();
    let plan = Plan::new(width, height, *range, method)?.with_prior(prior.is_some());
    if let Some(prior) = prior {
        fits(prior, pair)?;
    }
    let tiles = Tiles::new(&plan)?;
    let doubled = plan.doubled()?.map(|double| Tiles::new(&double)).transpose()?;
    let bytes = tiles.bytes().max(doubled.map_or(0, |tiles| tiles.bytes()));
    Ok((tiles, bytes))
}

/// Passes the results to `take`, in the order in which the matches were begun.
///
/// # Errors
/// The error of the first match that failed.
fn hand_out(
    answers: &Receiver<Receiver<Result<Matched>>>,
    mut take: impl FnMut(Matched) -> ControlFlow<()>,
) -> Result<()> {
    for answered in answers {
        // Without an answer, the match has panicked, and so will the thread that began it.
        let Ok(matched) = answered.recv() else { break };
        if take(matched?).is_break() {
            break;
        }
    }
    Ok(())
}

/// The capacity for running matches, and its use.
struct Room {
    /// Number of matches, and bytes.
    most: (usize, u64),
    taken: Mutex<(usize, u64)>,
    freed: Condvar,
}

impl Room {
    fn new(matches: usize, bytes: u64) -> Self {
        Self { most: (matches, bytes), taken: Mutex::new((0, 0)), freed: Condvar::new() }
    }

    /// Waits until a match that needs `bytes` may begin: always if it is the only one.
    fn share(&self, bytes: u64) -> Share<'_> {
        let waits = |&mut (matches, taken): &mut (usize, u64)| {
            let all = taken.saturating_add(bytes);
            let fits = || matches < self.most.0 && all <= self.most.1;
            matches > 0 && !(fits() && memory::check(all, Purpose::Match).is_ok())
        };
        let mut taken =
            self.freed.wait_while(locked(&self.taken), waits).unwrap_or_else(PoisonError::into_inner);
        *taken = (taken.0 + 1, taken.1.saturating_add(bytes));
        Share { room: self, bytes }
    }
}

/// The share of one match in a [`Room`].
struct Share<'a> {
    room: &'a Room,
    bytes: u64,
}

impl Drop for Share<'_> {
    fn drop(&mut self) {
        let mut taken = locked(&self.room.taken);
        *taken = (taken.0 - 1, taken.1 - self.bytes);
        self.room.freed.notify_one();
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_share_the_capacity() {
        let room = Room::new(2, 100);
        let taken = || *locked(&room.taken);
        let first = room.share(60);
        let second = room.share(40);
        assert_eq!(taken(), (2, 100));
        thread::scope(|scope| {
            // A third match is too many, whatever it needs.
            let third = scope.spawn(|| drop(room.share(0)));
            assert!(!third.is_finished());
            drop(first);
            third.join().unwrap();
        });
        drop(second);
        assert_eq!(taken(), (0, 0));
        // A match larger than the capacity runs alone.
        let large = room.share(1000);
        thread::scope(|scope| {
            let small = scope.spawn(|| drop(room.share(1)));
            assert!(!small.is_finished());
            drop(large);
            small.join().unwrap();
        });
        assert_eq!(taken(), (0, 0));
    }
}
