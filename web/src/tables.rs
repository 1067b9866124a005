//! Tables for the page: version, presets, reasons and colours.

use crate::Thrown;
use crate::matched::colours;
use crate::object::object;
use js_sys::{Array, Uint8Array};
use mrfgs::colour::{VALIDITY, preview};
use mrfgs::image::{Plane, Rect};
use mrfgs::maps::REASONS;
use mrfgs::options::PRESETS;
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

/// The version of mrfgs.
#[wasm_bindgen]
#[must_use]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").into()
}

/// Name and description of each preset: `{ name, about }`.
#[wasm_bindgen]
#[must_use]
pub fn presets() -> Array {
    PRESETS
        .iter()
        .map(|preset| object(&[("name", preset.name.into()), ("about", preset.about.into())]))
        .collect()
}

/// The bits of the validity map: `{ bit, name, about, colour }`. If a pixel has several, the first in the order of `VALIDITY` decides its colour.
#[wasm_bindgen]
#[must_use]
pub fn reasons() -> Array {
    let reason = |&(bit, name, about): &(u8, &str, &str)| {
        let colour = VALIDITY
            .iter()
            .find(|entry| entry.0 == u32::from(bit))
            .map_or(JsValue::UNDEFINED, |entry| Uint8Array::from(&entry.1[..]).into());
        object(&[("bit", bit.into()), ("name", name.into()), ("about", about.into()), ("colour", colour)])
    };
    REASONS.iter().map(reason).collect()
}

/// The 256 RGB colours of a colour map, from the least to the largest value.
///
/// # Errors
/// If there is no such colour map.
#[wasm_bindgen]
pub fn scale(name: &str) -> Thrown<Vec<u8>> {
    let ramp = Plane::from_fn(256, 1, |x, _| x as f32);
    let picture = preview(&ramp, 0.0, 255.0, colours(name)?);
    Ok(picture.crop(&Rect::whole((256, 1))).into_data().into_flattened())
}
