//! Plain JavaScript objects.

use js_sys::{Object, Reflect};
use wasm_bindgen::JsValue;

pub(crate) fn object(entries: &[(&str, JsValue)]) -> JsValue {
    let object = Object::new().into();
    for (key, value) in entries {
        set(&object, key, value.clone());
    }
    object
}

/// Sets an entry of such an object.
pub(crate) fn set(object: &JsValue, key: &str, value: JsValue) {
    // Setting a property of a plain object cannot fail.
    let _ = Reflect::set(object, &key.into(), &value);
}
