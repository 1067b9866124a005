//! The library for C and C++. `include/mrfgs.h` is generated from this crate.

// Only this crate dereferences pointers of C.
#![allow(unsafe_code, reason = "every pointer comes from C")]
#![deny(clippy::undocumented_unsafe_blocks, clippy::multiple_unsafe_ops_per_block)]
#![allow(unreachable_pub, reason = "what is in the header is pub")]
#![allow(clippy::doc_markdown, reason = "the header is no Markdown")]

mod argument;
mod calibration;
mod drift;
mod frame;
mod maps;
mod matcher;
mod options;
mod prior;
mod range;
mod rectification;
mod rig;
mod status;
mod steady;
mod text;
mod third;
mod warnings;
mod words;

use std::ffi::c_char;

/// The version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn mrfgs_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
