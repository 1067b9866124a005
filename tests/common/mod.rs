//! What the test binaries share: a naive twin of every stage, the backends under test, seeded random input, and a
//! comparison that says where two volumes part.

#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]
#![allow(clippy::needless_range_loop, reason = "twins read like the formulas that they are written from")]

pub mod compare;
pub mod devices;
pub mod random;
pub mod twin;
