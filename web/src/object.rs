//! Plain objects of JavaScript.

use js_sys::{Object, Reflect};
use wasm_bindgen::JsValue;

/// An object with these entries.
pub(crate) fn object(entries: &[(&str, JsValue)]) -> JsValue {
    let object = Object::new().into();
    for (key, value) in entries {
        set(&object, key, value.clone());
    }
    object
}

/// Sets an entry of such an object.
pub(crate) fn set(object: &JsValue, key: &str, value: JsValue) {
    // A plain object takes every key.
    let _ = Reflect::set(object, &key.into(), &value);
}
