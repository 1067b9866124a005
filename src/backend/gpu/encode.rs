//! Matches on the device of a caller: frames that are there already, and commands that the caller submits.

use super::device::Device;
use super::frame::{DeviceMap, Frame, OpenDevice, copy};
use super::stages::{Transfer, Unpacking};
use super::{Gpu, State, uploaded_rows, uploaded_words};
use crate::backend::Map;
use crate::error::{Error, Result};
use crate::plan::Plan;
use crate::stage::Data;

impl Gpu {
    /// Uses a device that is open already.
    pub(crate) fn of_caller(open: OpenDevice) -> Self {
        Self::on(Device::of_caller(open))
    }

    /// Loads the views of a match by `plan`, which are (width, height) pixels large. Nothing is submitted:
    /// [`Self::take_commands`] returns the commands.
    ///
    /// # Errors
    /// [`Error::Mismatch`] for frames of another size or form, and those of [`prepare`](crate::backend::Backend::prepare).
    pub(crate) fn prepare_frames(
        &mut self,
        plan: &Plan,
        frames: [&Frame; 2],
        size: (usize, usize),
    ) -> Result<()> {
        for (side, frame) in ["left", "right"].into_iter().zip(frames) {
            frame.check(size).map_err(|reason| Error::Mismatch(format!("the {side} frame is {reason}")))?;
        }
        let [left, right] = frames.map(Frame::format);
        if left != right {
            return Err(Error::Mismatch(format!(
                "one frame is {left} and the other {right}; give both in one format"
            )));
        }
        self.collected = Some(Vec::new());
        let mut state = self.ready(plan)?;
        let loaded = self.load_frames(&mut state, frames, size);
        self.state = Some(state);
        loaded
    }

    fn load_frames(&mut self, state: &mut State, frames: [&Frame; 2], size: (usize, usize)) -> Result<()> {
        self.reset(state)?;
        let State { plan, buffers, .. } = &*state;
        let (pitch, rows) = uploaded_rows(plan, buffers);
        // Pairs that are matched at half their size are extended to an even size by repeating the last row here, and the last column as the
        // words are unpacked.
        let more = rows - size.1;
        for (frame, data) in frames.into_iter().zip(uploaded_words(plan)) {
            let [(to, place)] = &buffers.rows(plan, data).own()[..] else {
                let height = size.1;
                return Err(self.device.too_large(
                    format!("{height} rows of a frame"),
                    4 * u64::from(pitch) * height as u64,
                    self.device.max_buffer,
                ));
            };
            // (rows of the frame, first row in the view)
            let again = (more > 0).then_some((size.1 - 1..size.1, size.1));
            for (part, at) in std::iter::once((0..size.1, 0)).chain(again) {
                let offset = place.start + 4 * u64::from(pitch) * at as u64;
                copy(self.encoder()?, frame, size.0, part, (to, offset), pitch);
            }
        }
        let (format, last) = (frames[0].format(), size.0 as u32 - 1);
        let unpacking = Unpacking { is_opaque: true, format, last };
        self.transfer(state, Transfer::Up(unpacking))
    }

    /// The commands that were recorded since [`Self::prepare_frames`], in order.
    pub(crate) fn take_commands(&mut self) -> Result<Vec<wgpu::CommandBuffer>> {
        self.submit()?;
        Ok(self.collected.take().unwrap_or_default())
    }

    /// The final disparities, and the validity with the confidence above it.
    pub(crate) fn final_maps(&self) -> Result<[DeviceMap; 2]> {
        let State { plan, buffers, .. } = self.state();
        let maps = if plan.full.is_some() {
            [Map::FullDisparity, Map::FullValidity]
        } else {
            [Map::Disparity, Map::Validity]
        };
        let [disparity, flags] = maps.map(|map| {
            let bytes_per_row = 4 * Data::Map(map).array(plan).words as u64;
            match &buffers.map(plan, map).own()[..] {
                [(buffer, place)] => {
                    Ok(DeviceMap { buffer: buffer.clone(), offset: place.start, bytes_per_row })
                }
                parts => {
                    let needed = bytes_per_row * parts.len() as u64;
                    Err(self.device.too_large("a map", needed, self.device.max_buffer))
                }
            }
        });
        Ok([disparity?, flags?])
    }
}
