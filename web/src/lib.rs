//! mrfgs in a browser: what the page calls. Native programs use the crate `mrfgs`.

#![cfg(target_arch = "wasm32")]
#![allow(unreachable_pub, reason = "JavaScript reaches it")]

mod matched;
mod matcher;
mod object;
mod pair;
mod rectified;
mod tables;
mod words;

use wasm_bindgen::prelude::wasm_bindgen;

/// What a function throws: an error whose message is for people.
type Thrown<T> = Result<T, js_sys::Error>;

/// Shows where a panic happened, in the console.
#[wasm_bindgen(start)]
pub fn start() {
    console_error_panic_hook::set_once();
}
