//! The engine of the page, for WebAssembly. Native programs use the crate `mrfgs`.

#![cfg(target_arch = "wasm32")]
#![allow(unreachable_pub, reason = "JavaScript reaches it")]

mod matched;
mod matcher;
mod object;
mod pair;
mod prior;
mod rectified;
mod tables;
mod video;
mod words;

use wasm_bindgen::prelude::wasm_bindgen;

/// Errors are thrown as JavaScript errors with a message for the user.
type Thrown<T> = Result<T, js_sys::Error>;

/// Prints panics to the console.
#[wasm_bindgen(start)]
pub fn start() {
    console_error_panic_hook::set_once();
}
