//! Stereo disparity by a multi-resolution factor graph, with the same bits on every device.
//!
//! mrfgs takes a rectified pair to a dense, sub-pixel disparity map with a confidence and a validity reason for every pixel, by
//! belief propagation on the factor graph of Shabanian and Balasubramanian, *Multi-Resolution Factor Graph Based Stereo
//! Correspondence Algorithm* (MR-FGS): variables V, evidence E and dependency factors S at every level of a pyramid, and
//! resolution factors R between levels.
//!
//! ```
//! use mrfgs::{Matcher, Pair};
//!
//! # fn main() -> mrfgs::Result<()> {
//! # let folder = tempfile::tempdir().unwrap();
//! # let output = folder.path().join("disparity.pfm");
//! let pair = Pair::open("testdata/slanted/im0.png", "testdata/slanted/im1.png")?;
//! let found = Matcher::new()?.run(&pair, 0..=31)?; // `..` finds the range
//! found.disparity().save(output)?;
//! # assert!(found.disparity().data().iter().all(|d| (0.0..=31.0).contains(d)));
//! # Ok(())
//! # }
//! ```
//!
//! A [`Matcher`] keeps the device, its compiled shaders and its buffers from pair to pair. A job can be watched and stopped:
//!
//! ```
//! use mrfgs::{Matcher, Method, Pair};
//! use std::sync::atomic::AtomicBool;
//!
//! # fn main() -> mrfgs::Result<()> {
//! # let pair = Pair::open("testdata/slanted/im0.png", "testdata/slanted/im1.png")?;
//! let stop = AtomicBool::new(false); // set it from another thread
//! let mut matcher = Matcher::builder().method(Method::paper()).device("cpu").threads(4).build()?;
//! let found = matcher.job(&pair, 0..=31).on_progress(|p| print!("{:.0} % ", 100.0 * p.done)).cancel(&stop).run()?;
//! assert_eq!(found.disparity().size(), pair.size());
//! # Ok(())
//! # }
//! ```
//!
//! Frames that are in memory already are borrowed, and the disparities can go where you want them:
//!
//! ```
//! use mrfgs::image::raster::Raster;
//! use mrfgs::{Matcher, Pair};
//!
//! # fn main() -> mrfgs::Result<()> {
//! # let noise = |i: u32| (i.wrapping_mul(0x9e37_79b9) >> 24) as u8;
//! # let right: Vec<u8> = (0..64 * 48).map(noise).collect();
//! # let left: Vec<u8> = (0..64 * 48_u32).map(|i| noise(i.saturating_sub(5))).collect();
//! # let frames = [(&left[..], &right[..])];
//! let mut matcher = Matcher::new()?;
//! let mut disparity = vec![0.0; 64 * 48];
//! for (left, right) in frames {
//!     // 64 x 48 grey bytes, rows 64 bytes apart.
//!     let view = |bytes| Raster::borrowed(bytes, (64, 48), 1, 64);
//!     let pair = Pair::of_frames(view(left)?, view(right)?)?;
//!     matcher.job(&pair, 0..=15).run_into(&mut disparity)?;
//!     assert_eq!(disparity[20 * 64 + 40].round(), 5.0);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! A browser must not block. There, use `build_async`, `run_async` and the other async functions instead:
//!
//! ```
//! # use mrfgs::{Matcher, Method, Pair};
//! async fn disparities(pair: &Pair) -> mrfgs::Result<Vec<f32>> {
//!     let mut matcher = Matcher::builder().method(Method::fast()).build_async().await?;
//!     let found = matcher.job(pair, 0..=31).run_async().await?;
//!     Ok(found.disparity().into_data())
//! }
//! # let pair = Pair::open("testdata/slanted/im0.png", "testdata/slanted/im1.png").unwrap();
//! # assert_eq!(pollster::block_on(disparities(&pair)).unwrap().len(), pair.size().0 * pair.size().1);
//! ```
//!
//! - [`Method`] holds every option that determines the bits of the maps; [`options`] describes them all.
//! - [`Matched`] is the result of a match: maps of disparity, confidence and validity, and their origin.
//! - [`colour`] renders maps as pictures.
//! - [`check`] warns of likely faults of a pair, and finds its disparity range.
//! - [`calibration`] reads the calibrations of cameras, and [`rectification`] rectifies their images.
//! - [`drift`] finds how the cameras of a rig have turned since they were calibrated, from their frames.
//! - [`prior`] tells a match what is known of the scene: points of a lidar, a terrain model.
//! - [`region`] matches a region of the left view alone.
//! - [`steady`] smooths the maps of a video over time where the scene is static.
//! - [`depth`] turns disparities into depths and points, for calibrated cameras.
//! - [`on_device`] matches frames that are on a GPU already, and leaves the maps there.
//! - [`evaluation`] compares maps with ground truth.
//! - [`image`] reads and writes images and maps.
//! - [`threads`] has the default number of threads, and limits the threads outside matchers.
//!
//! Beliefs, messages and evidence are costs in integers, so the CPU path and every GPU give the same maps bit for bit, whatever the
//! number of threads. (`low_level`, which is not documented, has what the tests and front ends of mrfgs need of the engine, and may
//! change with every version.)
//!
//! # Features
//!
//! All but the last are on by default. Without any, the matcher takes frames in memory and gives maps, and a third fewer packages.
//!
//! - `files`: images and maps in files, and methods in TOML (`Method::load`, `Method::set`, `Method::table`).
//! - `cameras`: [`calibration`], [`rectification`], [`depth`] and [`drift`], and clouds of points. It takes `files`.
//! - `evaluation`: [`evaluation`].
//! - `paper`: the presets `paper` and `fgs`, with texture zones and the correction of the illumination, which they alone use.
//! - `las`: clouds of points as LAS and LAZ. It takes `cameras`.

#![forbid(unsafe_code)]

mod backend;
#[cfg(feature = "cameras")]
pub mod calibration;
pub mod colour;
#[cfg(feature = "cameras")]
pub mod depth;
mod engine;
pub mod error;
#[cfg(feature = "evaluation")]
pub mod evaluation;
mod front;
mod graph;
pub mod image;
#[doc(hidden)]
pub mod low_level;
pub mod maps;
mod matcher;
mod memory;
pub mod options;
#[cfg_attr(target_arch = "wasm32", path = "pause_in_browser.rs")]
mod pause;
mod plan;
pub mod prior;
mod process;
mod program;
#[cfg(feature = "cameras")]
pub mod rectification;
pub mod region;
#[cfg(feature = "cameras")]
mod registration;
#[doc(hidden)]
pub mod remedy;
mod roofline;
pub mod sigma;
mod stage;
pub mod steady;
mod text;
pub mod threads;
mod vectors;
mod watch;
mod weights;

pub use error::{Error, Result};
pub use front::check;
pub use front::conditioning::Conditioning;
#[cfg(feature = "cameras")]
pub use front::drift;
pub use image::Pair;
#[cfg(not(target_arch = "wasm32"))]
pub use matcher::SharedMatcher;
pub use matcher::on_device;
pub use matcher::{Answer, AutoRange, Builder, Frame, Job, Matched, Matcher, Search, Timing};
pub use options::Method;
pub use prior::Prior;
pub use watch::Progress;
