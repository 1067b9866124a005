//! A device is seen to be right before it is trusted.

use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::Gpu;
use crate::engine;
use crate::error::{DeviceError, Result};
use crate::image::{Image, Pair, Plane};
use crate::options::{DisparityRange, Method};
use crate::plan::Plan;
use crate::program::Program;
use crate::program::tiles::Tiles;
use std::ops::ControlFlow;

/// Sees that a device computes a small pair by `method` as the CPU path does, before it matches a large one: a driver that gets
/// arithmetic, loops or memory wrong says nothing. `checked` is the last method that passed.
pub(super) async fn check(gpu: &mut Gpu, method: &Method, checked: &mut Option<Method>) -> Result<()> {
    if checked.as_ref() == Some(method) {
        return Ok(());
    }
    let (width, height) = (48, 20);
    let texture = |x: usize, y: usize| {
        let hash = (x as u32 * 73 + y as u32 * 179 + 1).wrapping_mul(0x9e37_79b9);
        [hash >> 24, hash >> 16 & 0xff, hash >> 8 & 0xff].map(|v| v as u8)
    };
    // Two surfaces, the nearer below.
    let step = |y: usize| if y < height / 2 { 3 } else { 8 };
    let left = Image::from_rgb8(&Plane::from_fn(width, height, texture));
    let right = Image::from_rgb8(&Plane::from_fn(width, height, |x, y| texture(x + step(y), y)));
    let pair = Pair::new(left, right)?;
    let plan = Plan::new(width, height, DisparityRange::new(-1, 16)?, method)?;
    let quiet = &mut |_| ControlFlow::Continue(());
    let program = Program::new(&Tiles::in_one_piece(&plan))?;
    let expected = engine::solve(&mut Cpu::default(), &program, &pair, quiet, None).await?;
    let found = engine::solve(gpu, &program, &pair, quiet, None).await?;
    if found.maps != expected.maps {
        return Err(DeviceError::WrongMaps { name: gpu.describe() }.into());
    }
    *checked = Some(method.clone());
    Ok(())
}
