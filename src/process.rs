//! Data that belongs to one process.
//!
//! A forked child has the memory of its parent, but none of its other threads: pools have no workers, threads cannot be joined,
//! and locks that were held stay locked. So a child makes its own data of this kind, and neither uses nor drops its parent's.

use crate::error::{ExecutionError, Result};
use std::mem;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};
use std::thread;
use std::time::Duration;

/// The number of this process; 1 in a browser.
pub(crate) fn id() -> u32 {
    if cfg!(target_arch = "wasm32") { 1 } else { std::process::id() }
}

/// A value that only the process that made it uses and drops.
#[derive(Debug)]
pub struct Own<T> {
    process: u32,
    thing: Option<T>,
}

impl<T> Own<T> {
    /// A value of this process.
    pub fn new(thing: T) -> Self {
        Self { process: id(), thing: Some(thing) }
    }

    /// The value; `None` in another process.
    pub fn get(&self) -> Option<&T> {
        self.thing.as_ref().filter(|_| self.process == id())
    }

    /// The value, mutable; `None` in another process.
    pub fn get_mut(&mut self) -> Option<&mut T> {
        self.thing.as_mut().filter(|_| self.process == id())
    }
}

impl<T> Drop for Own<T> {
    fn drop(&mut self) {
        if self.process != id() {
            #[expect(clippy::mem_forget, reason = "it holds threads and locks of another process")]
            mem::forget(self.thing.take());
        }
    }
}

/// A value that each process makes for itself when it first needs it.
#[derive(Debug)]
pub(crate) struct PerProcess<T> {
    first: OnceLock<Box<Link<T>>>,
}

/// The value of one process. The next link is that of a child forked from it.
#[derive(Debug)]
struct Link<T> {
    own: Own<T>,
    next: OnceLock<Box<Self>>,
}

impl<T> PerProcess<T> {
    /// No process has a value yet.
    #[must_use]
    pub(crate) const fn new() -> Self {
        Self { first: OnceLock::new() }
    }

    /// The value of this process. `T::default` must be quick: a child that is forked during it waits forever.
    pub(crate) fn get(&self) -> &T
    where
        T: Default,
    {
        let mut place = &self.first;
        loop {
            let link =
                place.get_or_init(|| Box::new(Link { own: Own::new(T::default()), next: OnceLock::new() }));
            match link.own.get() {
                // The last link counts, because a process that has ended may have had the same number.
                Some(own) if link.next.get().is_none() => return own,
                _ => place = &link.next,
            }
        }
    }
}

impl<T> Default for PerProcess<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// A value that threads use in turns. A forked child keeps it, unless another thread was using it during the fork.
#[derive(Debug, Default)]
pub struct Turns<T> {
    /// The last process in which a turn began.
    process: AtomicU32,
    thing: Mutex<T>,
}

impl<T> Turns<T> {
    /// A value that no thread uses yet.
    pub fn new(thing: T) -> Self {
        Self { process: AtomicU32::new(0), thing: Mutex::new(thing) }
    }

    /// Waits for a turn.
    ///
    /// # Errors
    /// [`ExecutionError::Forked`] when another thread held the value during the fork, so that its turn never ends.
    pub fn turn(&self) -> Result<MutexGuard<'_, T>> {
        // Another thread of this process may hold the first turn, and be about to store the process.
        const TRIES: u32 = 100;
        for _ in 0..TRIES {
            if self.process.load(Ordering::Acquire) == id() {
                return Ok(self.thing.lock().unwrap_or_else(PoisonError::into_inner));
            }
            let turn = match self.thing.try_lock() {
                Ok(turn) => Some(turn),
                Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) => None,
            };
            if let Some(turn) = turn {
                self.process.store(id(), Ordering::Release);
                return Ok(turn);
            }
            thread::sleep(Duration::from_millis(1));
        }
        Err(ExecutionError::Forked.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use std::sync::Arc;
    use std::sync::atomic::AtomicUsize;

    /// A value as a child finds it after a fork.
    fn of_parent<T>(thing: T) -> Own<T> {
        Own { process: id() + 1, thing: Some(thing) }
    }

    impl<T> Own<T> {
        fn into_thing(mut self) -> Option<T> {
            self.thing.take()
        }
    }

    #[test]
    fn values_of_another_process_are_neither_used_nor_dropped() {
        let counted = Arc::new(());
        let mut own = Own::new(Arc::clone(&counted));
        assert!(own.get().is_some() && own.get_mut().is_some());
        drop(own);
        assert_eq!(Arc::strong_count(&counted), 1);
        let mut own = of_parent(Arc::clone(&counted));
        assert!(own.get().is_none() && own.get_mut().is_none());
        drop(own);
        assert_eq!(Arc::strong_count(&counted), 2);
        assert!(of_parent(1).into_thing().is_some());
    }

    #[test]
    fn each_process_makes_its_own() {
        let numbers = PerProcess::<AtomicUsize>::new();
        numbers.get().store(1, Ordering::Relaxed);
        assert_eq!(numbers.get().load(Ordering::Relaxed), 1);
        // A child finds its parent's value first.
        let link = Link { own: of_parent(AtomicUsize::new(7)), next: OnceLock::new() };
        let numbers = PerProcess { first: OnceLock::from(Box::new(link)) };
        assert_eq!(numbers.get().load(Ordering::Relaxed), 0);
        numbers.get().store(2, Ordering::Relaxed);
        assert_eq!(numbers.get().load(Ordering::Relaxed), 2);
    }

    #[test]
    fn a_turn_that_never_ends_is_an_error() {
        let turns = Turns::new(5);
        assert_eq!(*turns.turn().unwrap(), 5);
        assert_eq!(*turns.turn().unwrap(), 5);
        let turns = Turns::new(5);
        let _held = turns.thing.lock();
        assert!(matches!(turns.turn(), Err(Error::Execution(ExecutionError::Forked))));
    }
}
