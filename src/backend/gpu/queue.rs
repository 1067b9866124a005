//! The queue of the device: records commands of stages, submits them, and requests results.

use super::commands::{Command, Dispatch, Groups};
use super::recording::Recording;
use super::rows::Rows;
use super::timer::{PASSES_PER_SUBMIT, Timer};
use super::{Gpu, device};
use crate::error::Result;
use std::ops::Range;

impl Gpu {
    /// The encoder, for commands that belong to no pass.
    pub(super) fn encoder(&mut self) -> Result<&mut wgpu::CommandEncoder> {
        let Recording { encoder, pass, .. } = &mut self.recording;
        *pass = None;
        if encoder.is_none() {
            let descriptor = wgpu::CommandEncoderDescriptor::default();
            *encoder = Some(self.device.inner()?.create_command_encoder(&descriptor));
        }
        Ok(encoder.as_mut().expect("just made"))
    }

    /// The open pass.
    fn pass(&mut self) -> Result<&mut wgpu::ComputePass<'static>> {
        if self.recording.pass.is_none() {
            if self.timer.is_some() && self.recording.passes >= PASSES_PER_SUBMIT {
                self.submit()?;
            }
            let mut timer = self.timer.take();
            let timestamp_writes = timer.as_mut().and_then(Timer::pass);
            let descriptor = wgpu::ComputePassDescriptor { label: None, timestamp_writes };
            let pass =
                self.encoder().map(|encoder| encoder.begin_compute_pass(&descriptor).forget_lifetime());
            self.timer = timer;
            self.recording.pass = Some(pass?);
            self.recording.passes += 1;
            self.device.traffic.passes += 1;
        }
        Ok(self.recording.pass.as_mut().expect("just begun"))
    }

    /// Records commands, and submits them when there is enough work.
    pub(super) fn record(&mut self, commands: &[Command]) -> Result<()> {
        for command in commands {
            match command {
                Command::Copy(copy) => {
                    let (from, to) = (&copy.from, &copy.to);
                    self.encoder()?.copy_buffer_to_buffer(&from.0, from.1, &to.0, to.1, copy.bytes);
                }
                Command::Dispatch(dispatch) => self.dispatch(dispatch)?,
                Command::Exchange(map) => {
                    let state = self.state.as_mut().expect("a stage has a state to run on");
                    state.buffers.exchanged.exchange(*map);
                }
            }
        }
        if self.timer.is_some() {
            // Each run has passes of its own.
            self.recording.pass = None;
        }
        Ok(())
    }

    /// Records zeros for a range of bytes.
    pub(super) fn clear(&mut self, buffer: &wgpu::Buffer, bytes: &Range<u64>) -> Result<()> {
        let size = bytes.end - bytes.start;
        self.encoder()?.clear_buffer(buffer, bytes.start, Some(size));
        self.device.traffic.bytes_cleared += size;
        Ok(())
    }

    fn dispatch(&mut self, dispatch: &Dispatch) -> Result<()> {
        let groups = self.state.as_ref().map(|state| state.buffers.groups.clone());
        let pass = self.pass()?;
        pass.set_pipeline(&dispatch.pipeline);
        pass.set_bind_group(0, &dispatch.bind_group, &[]);
        match &dispatch.groups {
            Groups::Fixed(x, y) => pass.dispatch_workgroups(*x, *y, 1),
            Groups::UntilSettled(at) => {
                let groups = groups.as_ref().expect("a stage has a state to run on");
                pass.dispatch_workgroups_indirect(groups, 12 * *at as u64);
            }
        }
        self.device.traffic.dispatches += 1;
        self.recording.work += dispatch.work;
        if self.recording.work >= self.device.pace.work() { self.submit() } else { Ok(()) }
    }

    /// Submits all recorded commands.
    pub(super) fn submit(&mut self) -> Result<()> {
        let Recording { encoder, pass, work, uploads, .. } = std::mem::take(&mut self.recording);
        drop(pass);
        if let Some(mut encoder) = encoder {
            if let Some(timer) = &mut self.timer {
                timer.submit(&mut self.device, &mut encoder)?;
            }
            match &mut self.collected {
                Some(collected) => collected.push(encoder.finish()),
                None => self.device.submit(encoder, work >= self.device.pace.work())?,
            }
        }
        self.device.keep_uploads(uploads);
        self.device.check()
    }

    /// Records an upload to all `rows` that `fill` writes to the memory of the host. Nothing is uploaded if it returns false.
    pub(super) fn upload(
        &mut self,
        rows: &Rows,
        fill: impl FnOnce(wgpu::WriteOnly<'_, [u8]>) -> bool,
    ) -> Result<bool> {
        let size = rows.row_bytes() * u64::from(rows.height());
        let buffer = self.device.upload(size)?;
        let is_filled = fill(self.device.mapped(&buffer)?.slice(..));
        buffer.unmap();
        if is_filled {
            for copy in rows.copy_from(&buffer) {
                let (from, to) = (&copy.from, &copy.to);
                self.encoder()?.copy_buffer_to_buffer(&from.0, from.1, &to.0, to.1, copy.bytes);
            }
            self.device.traffic.bytes_up += size;
        }
        self.recording.uploads.push(buffer);
        Ok(is_filled)
    }

    /// Forgets what was recorded.
    pub(super) fn discard(&mut self) {
        self.recording = Recording::default();
    }

    /// Requests ranges of bytes after all commands recorded so far.
    pub(super) fn request(&mut self, ranges: &[(wgpu::Buffer, Range<u64>)]) -> Result<device::Requested> {
        let mut staged = Vec::new();
        for (buffer, bytes) in ranges {
            let size = bytes.end - bytes.start;
            let staging = self.device.staging(size)?;
            self.encoder()?.copy_buffer_to_buffer(buffer, bytes.start, &staging, 0, size);
            staged.push(staging);
        }
        self.submit()?;
        self.device.request(staged)
    }

    /// The words of all rows.
    pub(super) async fn words(&mut self, rows: &Rows) -> Result<Vec<u32>> {
        let requested = self.request(&rows.own())?;
        Ok(self.device.collect(requested).await?.concat())
    }
}
