//! How much memory there is to ask for, and memory that can be refused.

use crate::error::{Error, Result};

/// Bytes that can be had without swapping, where the system says so.
fn available() -> Option<u64> {
    let info = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = info.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}

/// Declines to take `bytes` that this machine cannot give, or does not let this process have: the system would end it without a
/// word.
///
/// # Errors
/// [`Error::Memory`] with both figures, where both are known.
pub(crate) fn check(bytes: u64) -> Result<()> {
    match available() {
        Some(free) if bytes > free => {
            return Err(Error::Memory(format!(
                "{} are needed and {} are free{REMEDY}",
                size(bytes),
                size(free)
            )));
        }
        _ => {}
    }
    // Limits of the process (`ulimit -v`) and of a system that does not overcommit: what is never touched costs nothing.
    reserved::<u8>(usize::try_from(bytes).unwrap_or(usize::MAX)).map(drop).map_err(|_| lacking(bytes))
}

const REMEDY: &str = ": let it take less (--memory), or use a smaller image, a smaller range (--min-disparity, --max-disparity) \
                      or fewer neighbours (--set percentile)";

/// What to say where `bytes` cannot be had.
pub(crate) fn lacking(bytes: u64) -> Error {
    Error::Memory(format!("{} of memory are needed and cannot be had{REMEDY}", size(bytes)))
}

/// A size for people.
fn size(bytes: u64) -> String {
    let mib = bytes as f64 / f64::from(1 << 20);
    if mib < 1024.0 { format!("{:.0} MiB", mib.ceil()) } else { format!("{:.1} GiB", mib / 1024.0) }
}

/// An empty vector with room for `count` values.
///
/// # Errors
/// [`Error::Memory`] when the system has not as much.
pub(crate) fn reserved<T>(count: usize) -> Result<Vec<T>> {
    let mut out = Vec::new();
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    out.try_reserve_exact(count).map_err(|_| lacking(bytes))?;
    Ok(out)
}

/// A vector of `count` times `value`.
///
/// # Errors
/// [`Error::Memory`] when the system has not as much.
pub(crate) fn filled<T: Clone>(count: usize, value: T) -> Result<Vec<T>> {
    let mut out = reserved(count)?;
    out.resize(count, value);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_declined() {
        for bytes in [1 << 55, u64::MAX] {
            let said = check(bytes).unwrap_err().to_string();
            assert!(said.contains("GiB") && said.contains("smaller image") && !said.contains('\n'), "{said}");
        }
        assert!(filled(usize::MAX / 8, 0_u64).is_err());
        assert_eq!(filled(3, 7).unwrap(), [7; 3]);
        check(1 << 20).unwrap();
    }
}
