//! Strips and tiles that were unpacked last, since neighbouring windows share them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

/// Unpacked strips and tiles of one file, up to a number of bytes.
pub(in crate::image) struct Cache {
    most: usize,
    held: Mutex<Held>,
}

#[derive(Default)]
struct Held {
    /// The number of each, and its rows; the one used last comes last.
    chunks: VecDeque<(usize, Arc<Vec<u8>>)>,
    bytes: usize,
}

impl Cache {
    /// Holds `most` bytes.
    #[cfg(not(target_arch = "wasm32"))]
    pub(in crate::image) fn new(most: usize) -> Self {
        Self { most, held: Mutex::default() }
    }

    /// Strip or tile `i`, from the cache or else unpacked by `unpack`.
    pub(super) fn get<E>(
        &self,
        i: usize,
        unpack: impl FnOnce() -> Result<Vec<u8>, E>,
    ) -> Result<Arc<Vec<u8>>, E> {
        if let Some(rows) = self.held(i) {
            return Ok(rows);
        }
        let rows = Arc::new(unpack()?);
        self.hold(i, &rows);
        Ok(rows)
    }

    fn held(&self, i: usize) -> Option<Arc<Vec<u8>>> {
        // A lock that a fork has copied while it was held is never free again; without the cache it is only slower.
        let mut held = self.held.try_lock().ok()?;
        let at = held.chunks.iter().rposition(|(chunk, _)| *chunk == i)?;
        let chunk = held.chunks.remove(at)?;
        let rows = chunk.1.clone();
        held.chunks.push_back(chunk);
        Some(rows)
    }

    fn hold(&self, i: usize, rows: &Arc<Vec<u8>>) {
        let Ok(mut held) = self.held.try_lock() else { return };
        // Another thread may have been faster.
        if rows.len() > self.most || held.chunks.iter().any(|(chunk, _)| *chunk == i) {
            return;
        }
        while held.bytes + rows.len() > self.most {
            let Some((_, oldest)) = held.chunks.pop_front() else { break };
            held.bytes -= oldest.len();
        }
        held.bytes += rows.len();
        held.chunks.push_back((i, rows.clone()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_used_last_stays() {
        let cache = Cache::new(10);
        let unpacked = |i: usize, length: usize| {
            let mut unpacked = false;
            let rows = cache.get(i, || {
                unpacked = true;
                Ok::<_, ()>(vec![i as u8; length])
            });
            assert_eq!(*rows.unwrap(), vec![i as u8; length]);
            unpacked
        };
        assert!(unpacked(0, 4) && unpacked(1, 4));
        assert!(!unpacked(0, 4) && !unpacked(1, 4) && !unpacked(0, 4));
        // The third one takes the place of 1, which was used least.
        assert!(unpacked(2, 4) && !unpacked(0, 4) && unpacked(1, 4));
        // One that is too large is not kept, and leaves the others.
        assert!(unpacked(3, 11) && unpacked(3, 11) && !unpacked(1, 4));
        assert_eq!(cache.held.lock().unwrap().bytes, 8);
    }
}
