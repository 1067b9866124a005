//! Sets the soname of the shared library. Until 1.0 each minor version may be incompatible.

fn main() {
    let part = |name: &str| std::env::var(format!("CARGO_PKG_VERSION_{name}")).unwrap_or_default();
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libmrfgs.so.{}.{}", part("MAJOR"), part("MINOR"));
    }
    println!("cargo::rerun-if-changed=build.rs");
}
