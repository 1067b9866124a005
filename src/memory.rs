//! How much memory there is to ask for.

use crate::error::{Error, Result};

/// Bytes that can be had without swapping, where the system says so.
fn available() -> Option<u64> {
    let info = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = info.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}

/// Declines to take `bytes` that this machine cannot give: the system would end the process without a word.
///
/// # Errors
/// [`Error::Memory`] with both figures.
pub(crate) fn check(bytes: u64) -> Result<()> {
    match available() {
        Some(free) if bytes > free => {
            let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
            Err(Error::Memory(format!(
                "the match needs {:.1} GiB of memory and {:.1} GiB are free: let it take less (--memory), or use a smaller \
                 image, a smaller range (--min-disparity, --max-disparity) or fewer neighbours (--set percentile)",
                gib(bytes),
                gib(free)
            )))
        }
        _ => Ok(()),
    }
}
