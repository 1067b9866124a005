//! Stereo disparity by a multi-resolution factor graph, with the same bits on every device.
//!
//! From a rectified pair to a dense, sub-pixel disparity map with a confidence and a validity reason for every pixel,
//! by belief propagation on the factor graph of Shabanian and Balasubramanian, *Multi-Resolution Factor Graph Based
//! Stereo Correspondence Algorithm* (MR-FGS): variables V, evidence E and dependency factors S at every level of a
//! pyramid, resolution factors R between levels.
//!
//! ```
//! use mrfgs::image::read;
//! use mrfgs::options::{DisparityRange, Execution, Method};
//! use std::{ops::ControlFlow, path::Path};
//!
//! # fn main() -> mrfgs::Result<()> {
//! let (left, right) = ("testdata/slanted/im0.png", "testdata/slanted/im1.png");
//! let pair = read::pair(Path::new(left), Path::new(right), None)?;
//! let range = DisparityRange::new(0, 31)?;
//! let execution = Execution::default();
//! let matched =
//!     mrfgs::match_pair(&pair, range, &Method::default(), &execution, &mut |_| ControlFlow::Continue(()))?;
//! let map = matched.maps.final_map(); // pixels, +inf where there is none
//! assert_eq!(map.size(), pair.size());
//! assert!(map.data().iter().all(|d| (0.0..=31.0).contains(d)));
//! # Ok(())
//! # }
//! ```
//!
//! Frames that are in memory already are borrowed, and a [`Matcher`] keeps the device and its buffers from frame to frame:
//!
//! ```
//! use mrfgs::Matcher;
//! use mrfgs::image::raster::{self, Raster, Samples};
//! use mrfgs::options::{DisparityRange, Execution, Method};
//! use std::{borrow::Cow, ops::ControlFlow};
//!
//! # fn main() -> mrfgs::Result<()> {
//! # let noise = |i: u32| (i.wrapping_mul(0x9e37_79b9) >> 24) as u8;
//! # let right: Vec<u8> = (0..64 * 48).map(noise).collect();
//! # let left: Vec<u8> = (0..64 * 48_u32).map(|i| noise(i.saturating_sub(5))).collect();
//! # let frames = [(&left[..], &right[..])];
//! let (method, range) = (Method::default(), DisparityRange::new(0, 15)?);
//! let mut matcher = Matcher::new(&Execution::default())?;
//! for (left, right) in frames {
//!     // 64 x 48 grey bytes, row by row.
//!     let view = |bytes| Raster::new(64, 48, 1, Samples::Byte(Cow::Borrowed(bytes)));
//!     let pair = raster::pair(view(left)?, view(right)?, None)?;
//!     let matched = matcher.run(&pair, range, &method, &mut |_| ControlFlow::Continue(()))?;
//!     assert_eq!(matched.maps.final_map()[(40, 20)].round(), 5.0);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # The way through
//!
//! ```text
//! images ──> plan ──> front ──> graph ──> solver ──> maps, evaluation
//!                                            │
//!                                         backend (the one seam): cpu, gpu
//! ```
//!
//! - [`options::Method`] holds every parameter that determines the bits, [`options::Execution`] what does not.
//! - [`plan::Plan`] works out levels, integer parameters, bounds and memory, before anything runs, and [`tiles::Tiles`] how
//!   to cut what is too large.
//! - [`front`] corrects the illumination and finds texture zones, sparse matches and the labels they leave, where asked.
//! - [`graph`] picks the members of each dependency factor.
//! - [`backend::Backend`] defines the stages, exactly; [`solver`] alone knows their order.
//! - [`roofline`] counts what the messages cost at least, to hold a machine against.
//! - [`maps`] is what comes out, [`Matcher`] puts it all together for pair after pair.
//! - [`depth`] turns disparities into depths and points, where the cameras are known.
//! - [`evaluation`] compares maps with ground truth.
//!
//! Beliefs, messages and evidence are costs in integers (see [`plan`]), so the CPU path and every GPU give the same
//! maps bit for bit, whatever the number of threads.

pub mod backend;
pub mod depth;
pub mod engine;
pub mod error;
pub mod evaluation;
pub mod front;
pub mod graph;
pub mod image;
pub mod maps;
mod matcher;
mod memory;
pub mod options;
pub mod plan;
pub mod roofline;
pub mod solver;
pub mod text;
pub mod tiles;
pub mod watch;
pub mod weights;

pub use error::{Error, Result};
pub use matcher::{Matched, Matcher, Timing, match_pair};
