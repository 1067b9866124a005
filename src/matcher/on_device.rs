//! Matches frames that are on a device already, without a wait and without a copy to the host.
//!
//! [`DeviceMatcher`] records a match as commands for the caller's queue, and leaves the maps in buffers of the
//! caller's device, where shaders can read them. The version of `wgpu` is that of [`wgpu`].
//! [`Matcher::on_device`](crate::Matcher::on_device) matches images of the host on the same device.
//!
//! The frames are matched as they are: row offsets, differences of sharpness, and noise are measured on the host,
//! and so they are neither found nor corrected here. With these corrections off, the maps are those of a
//! [`Matcher`](crate::Matcher), bit for bit.
//!
//! ```no_run
//! use mrfgs::Method;
//! use mrfgs::on_device::{DeviceMatcher, Frame, OpenDevice, wgpu};
//!
//! # fn of(info: wgpu::AdapterInfo, device: wgpu::Device, queue: wgpu::Queue, frames: Vec<[wgpu::Texture; 2]>) -> mrfgs::Result<()> {
//! let open = OpenDevice { info, device, queue: queue.clone() };
//! let mut matcher = DeviceMatcher::new(open, (640, 480), 0..=63, &Method::fast())?;
//! for [left, right] in frames {
//!     let found = matcher.encode(&Frame::Texture(left), &Frame::Texture(right))?;
//!     queue.submit(found.commands);
//!     // Bind `found.disparity.buffer` in a shader: `i32` in 1/256 px, in rows of `bytes_per_row` bytes.
//! }
//! # Ok(())
//! # }
//! ```

use super::check::check;
use crate::backend::Backend;
use crate::backend::gpu::Gpu;
pub use crate::backend::gpu::{DeviceMap, Frame, OpenDevice, PixelFormat, wgpu};
use crate::error::{Error, Result};
use crate::options::Method;
use crate::plan::Plan;
use crate::program::tiles::Tiles;
use crate::program::{Program, Step};
use std::ops::RangeInclusive;

/// Matches pairs of one size over one range on a device.
pub struct DeviceMatcher {
    gpu: Gpu,
    program: Program,
    size: (usize, usize),
}

/// The commands of a match, and the maps that they write.
#[derive(Debug)]
#[must_use = "a match runs when its commands are submitted"]
pub struct DeviceMaps {
    /// To be submitted in order, once, to the queue of the device, before the commands of the next match.
    pub commands: Vec<wgpu::CommandBuffer>,
    /// Disparities in 1/256 px, as `i32`; pixels without one are [invalid](crate::maps::flag::INVALID).
    pub disparity: DeviceMap,
    /// The [validity](crate::maps::flag) in bits 0 to 7, and the confidence, 0 to 255, in bits 8 to 15.
    pub flags: DeviceMap,
    /// (width, height) in pixels.
    pub size: (usize, usize),
}

impl DeviceMatcher {
    /// A matcher of pairs of (width, height) pixels over `range` by `method`, whose corrections of a pair are turned off.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for methods that need more than one match of a pair or data of the host: tiles, twice
    /// the size, the map of the right view, texture zones and the correction of the illumination; the errors of
    /// [`Job::run`](super::Job::run) for the size and the range.
    pub fn new(
        open: OpenDevice,
        size: (usize, usize),
        range: RangeInclusive<i32>,
        method: &Method,
    ) -> Result<Self> {
        let mut method = method.clone();
        let front = &mut method.front;
        (front.level_rows, front.equal_sharpness, front.denoise) = (false, false, false);
        let plan = Plan::new(size.0, size.1, range.try_into()?, &method)?;
        let program = Program::new(&Tiles::new(&plan)?)?;
        let on_host = plan.limits_labels() || method.front.corrects_illumination();
        if on_host || program.frames.len() > 1 || !program.waits_once() || method.refinement.right_map {
            return Err(Error::Mismatch(
                "frames on a device are matched in one piece, at one size, for the left view alone, and without \
                 texture zones or a correction of the illumination; choose such a method, or give it more memory"
                    .into(),
            ));
        }
        let mut gpu = Gpu::of_caller(open);
        let program = gpu.fit(program);
        Ok(Self { gpu, program, size })
    }

    /// Compares the maps of a small pair with those of the CPU path, as [`Matcher`](crate::Matcher) does before
    /// its first match. This submits commands, and waits for them.
    ///
    /// # Errors
    /// [`DeviceError::WrongMaps`](crate::error::DeviceError::WrongMaps) if they differ, and the errors of the device.
    pub async fn self_test(&mut self) -> Result<()> {
        let method = self.program.frames[0].plan.method.clone();
        check(&mut self.gpu, &method, &mut None).await
    }

    /// Records a match of two frames. Its commands write maps that those of the next match overwrite.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for frames of another size or form, [`Error::Memory`] if the buffers do not fit.
    pub fn encode(&mut self, left: &Frame, right: &Frame) -> Result<DeviceMaps> {
        let plan = &self.program.frames[0].plan;
        self.gpu.prepare_frames(plan, [left, right], self.size)?;
        for step in &self.program.steps {
            if let Step::Run(run) = step {
                self.gpu.perform(run)?;
            }
        }
        let commands = self.gpu.take_commands()?;
        let [disparity, flags] = self.gpu.final_maps()?;
        Ok(DeviceMaps { commands, disparity, flags, size: self.size })
    }
}
