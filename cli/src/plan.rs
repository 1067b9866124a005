//! The plan of a match, as `--dry-run` prints it.

use std::fmt::Write;

use mrfgs::low_level::plan::{FullSize, Plan};
use mrfgs::low_level::program::tiles::Tiles;
use mrfgs::options::{DisparityRange, Method, Order};
use mrfgs::region::Blocks;

use crate::failure::Result;
use crate::table::Table;
use crate::text::{bytes, plural};

/// Describes the plan, followed by that of the second pass at twice the size, if there is one.
pub(crate) fn describe(plan: &Plan) -> Result<String> {
    let own = at_one_size(&Tiles::new(plan)?);
    let Some(double) = plan.doubled()? else { return Ok(own) };
    Ok(format!("{own}\nThen at twice the size:\n\n{}", at_one_size(&Tiles::new(&double)?)))
}

/// Describes the blocks of a pair, and the plan of the largest one.
pub(crate) fn describe_blocks(blocks: &Blocks, range: DisparityRange, method: &Method) -> Result<String> {
    let (width, height) = blocks.size();
    let windows = blocks.list().iter().map(|block| block.window().size());
    let (w, h) = windows.max_by_key(|(width, height)| width * height).unwrap_or((width, height));
    let count = blocks.list().len();
    let plan = Plan::new(w, h, range, method)?;
    Ok(format!(
        "{width} x {height} pixels in {count} block{}, the largest of which:\n{}",
        plural(count),
        describe(&plan)?
    ))
}

fn at_one_size(tiles: &Tiles) -> String {
    let mut out = String::new();
    let plan = &tiles.largest();
    let FullSize { size: (width, height), range } = tiles.whole().of_pair();
    let labels = range.labels();
    let _ = writeln!(
        out,
        "{width} x {height} pixels, disparities {} to {} ({labels} label{})",
        range.min,
        range.max,
        plural(labels)
    );
    if plan.full.is_some() {
        let (width, height) = tiles.whole().size();
        let _ = writeln!(out, "matched at half that size, {width} x {height} pixels");
    }
    if tiles.count() > 1 {
        let (width, height) = plan.size();
        let _ =
            writeln!(out, "in {} tiles of up to {width} x {height} pixels, one after another", tiles.count());
    }
    let _ = write!(out, "\n{}\n{}", memory(tiles, plan), schedule(plan));
    out
}

/// The levels and their memory.
fn memory(tiles: &Tiles, plan: &Plan) -> Table {
    let mut table = Table::new("l|r|l|r");
    table.row(["level", "width x height", "labels", "memory"]);
    table.rule();
    for (z, level) in plan.levels.iter().enumerate() {
        let size = format!("{} x {}", level.width, level.height);
        let labels = format!("{} to {} ({})", level.min, level.max(), level.labels);
        table.row([z.to_string(), size, labels, bytes(plan.level_bytes(z))]);
    }
    table.row(["maps", "", "", &bytes(plan.map_bytes())]);
    if tiles.count() > 1 {
        table.row(["whole image", "", "", &bytes(tiles.bytes() - plan.bytes())]);
    }
    table.row(["all", "", "", &bytes(tiles.bytes())]);
    if tiles.bytes_on_device() > tiles.bytes() {
        table.row(["on a device", "", "", &format!("{} at most", bytes(tiles.bytes_on_device()))]);
    }
    table
}

/// The messages and their schedule.
fn schedule(plan: &Plan) -> Table {
    let mut table = Table::new("l|l");
    let width = 8 * plan.volume_width.bytes();
    table.row(["messages", &format!("{width} bits, factors of {} pixels and their centre", plan.neighbours)]);
    let last = plan.levels.len() - 1;
    for (i, phase) in plan.phases.iter().enumerate() {
        let levels = match phase.finest {
            z if z == last => format!("level {last}"),
            0 if plan.method.schedule.order == Order::CoarseFirst && phase.iterations > 1 => {
                "level 0, the others in between".into()
            }
            0 if plan.method.schedule.order == Order::CoarseFirst => "level 0".into(),
            z => format!("levels {z} to {last}"),
        };
        let (n, head) = (phase.iterations, if i == 0 { "schedule" } else { "" });
        table.row([head, &format!("{n} iteration{} of {levels}", plural(n as usize))]);
    }
    match plan.looks() {
        1 => {}
        2 => table.row(["", "a second look, with 1 iteration each"]),
        looks => table.row(["", &format!("{} more looks, with 1 iteration each", looks - 1)]),
    }
    if plan.method.schedule.tolerance > 0.0 {
        let sooner = match plan.method.schedule.order {
            Order::Together => "or fewer",
            Order::CoarseFirst => "or fewer of the last",
        };
        let tolerance = plan.method.schedule.tolerance;
        table.row(["", &format!("{sooner}, once the map changes by at most {tolerance} px (RMS)")]);
    }
    table
}
