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
        if frames[0].is_bgra() != frames[1].is_bgra() {
            return Err(Error::Mismatch(
                "one frame is RGBA and the other BGRA; give both in one order".into(),
            ));
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
        // Pairs that are matched at half their size are extended to an even size by repeating the last column and row.
        let more = (usize::from(plan.full.is_some() && size.0 % 2 == 1), rows - size.1);
        for (frame, data) in frames.into_iter().zip(uploaded_words(plan)) {
            let [(to, place)] = &buffers.rows(plan, data).own()[..] else {
                let height = size.1;
                return Err(self.device.too_large(
                    format!("{height} rows of a frame"),
                    4 * u64::from(pitch) * height as u64,
                    self.device.max_buffer,
                ));
            };
            // (first column and row in the frame, first column and row in the view, width and height)
            let mut parts = vec![([0, 0], [0, 0], [size.0, size.1])];
            let last = [size.0 - 1, size.1 - 1];
            parts.extend((more.0 > 0).then_some(([last[0], 0], [size.0, 0], [1, size.1])));
            parts.extend((more.1 > 0).then_some(([0, last[1]], [0, size.1], [size.0, 1])));
            parts.extend((more.0 > 0 && more.1 > 0).then_some((last, [size.0, size.1], [1, 1])));
            for (from, at, part) in parts {
                let offset = place.start + 4 * (u64::from(pitch) * at[1] as u64 + at[0] as u64);
                copy(self.encoder()?, frame, (from, part), to, offset, pitch);
            }
        }
        let unpacking = Unpacking { is_opaque: true, is_bgra: frames[0].is_bgra() };
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
