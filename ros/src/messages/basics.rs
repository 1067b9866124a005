//! Times, and how the bytes of messages are laid out.

use std::fmt;

use mrfgs::error::Reason;

/// Shorthand for what comes of the bytes of a message.
pub type Result<T> = std::result::Result<T, Reason>;

/// How the bytes of a message are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// That of ROS 2, in the byte order that its first bytes say.
    Cdr,
    /// That of ROS 1.
    Ros1,
}

/// A time, in nanoseconds since the epoch of its clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Stamp(pub i64);

/// Nanoseconds in a second.
pub const SECOND: i64 = 1_000_000_000;

/// In seconds, with all nine decimals.
impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (sign, all) = (if self.0 < 0 { "-" } else { "" }, self.0.unsigned_abs());
        let second = SECOND.unsigned_abs();
        write!(f, "{sign}{}.{:09}", all / second, all % second)
    }
}
