//! The time of every stage, by timestamps of the device.

use super::device::Device;
use crate::backend::Stage;
use crate::error::Result;
use std::time::Duration;
use web_time::Instant;

/// Passes recorded per submission.
pub(super) const PASSES_PER_SUBMIT: usize = 16;

/// Records the times of passes, and sums them by run of a stage.
pub(super) struct Timer {
    clock: Option<Clock>,
    /// Start of the current run, if the host measures.
    began: Option<Instant>,
    /// The runs so far, with the host's measurement if the device has no timestamps.
    runs: Vec<(Stage, Duration)>,
}

struct Clock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    /// The run that each pass of the current encoder belongs to.
    passes: Vec<usize>,
    /// For each submission, the runs of its passes and the buffer of timestamps.
    logs: Vec<(Vec<usize>, wgpu::Buffer)>,
}

const TICKS: u64 = 2 * PASSES_PER_SUBMIT as u64;

impl Clock {
    fn new(device: &Device) -> Result<Self> {
        let queries = device.inner()?.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("times"),
            ty: wgpu::QueryType::Timestamp,
            count: TICKS as u32,
        });
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let resolved = device.buffer("times", 8 * TICKS, usage)?;
        Ok(Self { queries, resolved, passes: Vec::new(), logs: Vec::new() })
    }
}

impl Timer {
    pub(super) fn new(device: &Device) -> Result<Self> {
        let clock = device.tick.map(|_| Clock::new(device)).transpose()?;
        Ok(Self { clock, began: None, runs: Vec::new() })
    }

    /// Whether the host measures a run and must wait for it.
    pub(super) fn waits(&self) -> bool {
        self.began.is_some()
    }

    /// Whether the device has timestamps; otherwise the host measures.
    pub(super) fn has_clock(&self) -> bool {
        self.clock.is_some()
    }

    /// Starts a run of `stage`. If the host still measures the last run, the new one becomes part of it.
    pub(super) fn begin(&mut self, stage: Stage) {
        if self.began.is_none() {
            self.runs.push((stage, Duration::ZERO));
            self.began = self.clock.is_none().then(Instant::now);
        }
    }

    /// Ends the run that the host measures, if any.
    pub(super) fn end(&mut self) {
        if let (Some(run), Some(began)) = (self.runs.last_mut(), self.began.take()) {
            run.1 = began.elapsed();
        }
    }

    /// Timestamp queries for the start and end of the next pass.
    pub(super) fn pass(&mut self) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let clock = self.clock.as_mut()?;
        let first = 2 * clock.passes.len() as u32;
        clock.passes.push(self.runs.len() - 1);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &clock.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Saves the timestamps of the passes in `encoder`, which is about to be submitted.
    pub(super) fn submit(&mut self, device: &mut Device, encoder: &mut wgpu::CommandEncoder) -> Result<()> {
        let Some(clock) = self.clock.as_mut().filter(|c| !c.passes.is_empty()) else { return Ok(()) };
        let passes = std::mem::take(&mut clock.passes);
        let log = device.staging(8 * TICKS)?;
        encoder.resolve_query_set(&clock.queries, 0..2 * passes.len() as u32, &clock.resolved, 0);
        encoder.copy_buffer_to_buffer(&clock.resolved, 0, &log, 0, 16 * passes.len() as u64);
        clock.logs.push((passes, log));
        Ok(())
    }

    /// All runs so far with their times. Everything must have been submitted.
    pub(super) async fn times(&mut self, device: &mut Device) -> Result<Vec<(Stage, Duration)>> {
        if let (Some(clock), Some(tick)) = (&mut self.clock, device.tick) {
            for (passes, log) in clock.logs.drain(..) {
                let requested = device.request(vec![log])?;
                let words = device.collect(requested).await?;
                let ticks: Vec<u64> =
                    words[0].chunks_exact(2).map(|w| u64::from(w[1]) << 32 | u64::from(w[0])).collect();
                for (run, ends) in passes.into_iter().zip(ticks.chunks_exact(2)) {
                    let passed = ends[1].saturating_sub(ends[0]) as f64 * tick;
                    self.runs[run].1 += Duration::from_nanos(passed as u64);
                }
            }
        }
        Ok(self.runs.clone())
    }
}
