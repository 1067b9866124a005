//! Times and serializations of messages.

use std::fmt;

use mrfgs::error::Reason;

/// The result of decoding a message.
pub type Result<T> = std::result::Result<T, Reason>;

/// The serialization of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// CDR of ROS 2, in the byte order given by its first bytes.
    Cdr,
    /// The serialization of ROS 1.
    Ros1,
}

/// A time, in nanoseconds since the epoch of its clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Stamp(pub i64);

/// Nanoseconds per second.
pub const SECOND: i64 = 1_000_000_000;

/// In seconds, with nine decimals.
impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (sign, all) = (if self.0 < 0 { "-" } else { "" }, self.0.unsigned_abs());
        let second = SECOND.unsigned_abs();
        write!(f, "{sign}{}.{:09}", all / second, all % second)
    }
}
