//! The queue of the device: records commands of stages, submits them, and requests results.

use super::commands::{Command, Groups};
use super::rows::Rows;
use super::timer::{PASSES_PER_SUBMIT, Timer};
use super::{Gpu, device};
use crate::error::Result;
use std::ops::Range;

impl Gpu {
    pub(super) fn encoder(&mut self) -> Result<&mut wgpu::CommandEncoder> {
        if self.encoder.is_none() {
            let descriptor = wgpu::CommandEncoderDescriptor::default();
            self.encoder = Some(self.device.inner()?.create_command_encoder(&descriptor));
        }
        Ok(self.encoder.as_mut().expect("just made"))
    }

    /// Records commands, and submits them when there is enough work.
    pub(super) fn record(&mut self, commands: &[Command]) -> Result<()> {
        let mut rest = commands;
        while let Some(first) = rest.first() {
            let mut recorded = 1;
            match first {
                Command::Copy(copy) => {
                    let (from, to) = (&copy.from, &copy.to);
                    self.encoder()?.copy_buffer_to_buffer(&from.0, from.1, &to.0, to.1, copy.bytes);
                }
                Command::Clear(buffer, bytes) => {
                    let size = bytes.end - bytes.start;
                    self.encoder()?.clear_buffer(buffer, bytes.start, Some(size));
                }
                Command::Dispatch(_) => {
                    let mut timer = self.timer.take();
                    let writes = timer.as_mut().and_then(Timer::pass);
                    let (mut work, most) = (self.work, self.device.pace.work());
                    let groups = self.state.as_ref().map(|state| state.buffers.groups.clone());
                    {
                        let mut pass = self.encoder()?.begin_compute_pass(&wgpu::ComputePassDescriptor {
                            label: None,
                            timestamp_writes: writes,
                        });
                        recorded = 0;
                        while let Some(Command::Dispatch(dispatch)) = rest.get(recorded) {
                            pass.set_pipeline(&dispatch.pipeline);
                            pass.set_bind_group(0, &dispatch.bind_group, &[]);
                            match &dispatch.groups {
                                Groups::Fixed(x, y) => pass.dispatch_workgroups(*x, *y, 1),
                                Groups::UntilSettled(at) => {
                                    let groups = groups.as_ref().expect("a stage has a state to run on");
                                    pass.dispatch_workgroups_indirect(groups, 12 * *at as u64);
                                }
                            }
                            work += dispatch.work;
                            recorded += 1;
                            if work >= most {
                                break;
                            }
                        }
                    }
                    self.timer = timer;
                    self.work = work;
                    self.passes += 1;
                    self.device.traffic.dispatches += recorded as u64;
                }
            }
            rest = &rest[recorded..];
            let timed = self.timer.is_some() && self.passes >= PASSES_PER_SUBMIT;
            if timed || self.work >= self.device.pace.work() {
                self.submit()?;
            }
        }
        Ok(())
    }

    /// Submits all recorded commands.
    pub(super) fn submit(&mut self) -> Result<()> {
        let is_full = self.work >= self.device.pace.work();
        (self.passes, self.work) = (0, 0);
        if let Some(mut encoder) = self.encoder.take() {
            if let Some(timer) = &mut self.timer {
                timer.submit(&self.device, &mut encoder)?;
            }
            self.device.submit(encoder, is_full)?;
        }
        self.device.check()
    }

    /// Requests ranges of bytes after all commands recorded so far.
    pub(super) fn request(&mut self, ranges: &[(wgpu::Buffer, Range<u64>)]) -> Result<device::Requested> {
        let mut staged = Vec::new();
        for (buffer, bytes) in ranges {
            let size = bytes.end - bytes.start;
            let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
            let staging = self.device.buffer("staging", size, usage)?;
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
