//! Checks a device before it is used.

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

/// Checks that a device computes the same maps as the CPU path on a small pair, because drivers do not report
/// errors in arithmetic, loops or memory. `checked` is the last method that passed.
pub(super) async fn check(gpu: &mut Gpu, method: &Method, checked: &mut Option<Method>) -> Result<()> {
    if checked.as_ref() == Some(method) {
        return Ok(());
    }
    let (width, height) = (48, 20);
    let texture = |x: usize, y: usize| {
        let hash = (x as u32 * 73 + y as u32 * 179 + 1).wrapping_mul(0x9e37_79b9);
        [hash >> 24, hash >> 16 & 0xff, hash >> 8 & 0xff].map(|v| v as u8)
    };
    // Two surfaces, the nearer one below.
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
