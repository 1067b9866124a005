//! The maps of a running match.

use super::double_size;
use super::mosaic::Mosaic;
use crate::backend::cpu::Cpu;
use crate::backend::{Backend, Map, Stage, Ticket};
use crate::error::Result;
use crate::image::{Pair, Plane};
use crate::maps::{Maps, RightMap, flag};
use crate::plan::Plan;
use crate::program::{Frame, View};
use crate::watch::Watch;
use std::time::Duration;
use web_time::Instant;

/// The maps that were asked for, placed or found.
#[derive(Default)]
pub(super) struct Gathering {
    /// The frame of the whole image.
    pub(super) whole: usize,
    /// The maps of the tiles so far.
    pub(super) mosaic: Option<Mosaic>,
    /// After all tiles: the CPU path for the stages on whole maps, and the disparities of the right view.
    gathered: Option<(Cpu, Plane<i32>)>,
    /// The maps that were asked for, the left view's first.
    tickets: Vec<Ticket>,
    pub(super) maps: Option<Maps>,
    /// The maps at the pair's own size, while it is matched at twice its size.
    own: Option<Maps>,
    /// The time of every stage that ran on the merged maps of all tiles.
    pub(super) times: Vec<(Stage, Duration)>,
}

impl Gathering {
    /// The backend that runs the next stages.
    pub(super) fn target<'a>(&'a mut self, backend: &'a mut dyn Backend) -> &'a mut dyn Backend {
        match &mut self.gathered {
            Some((cpu, _)) => cpu,
            None => backend,
        }
    }

    /// Copies the maps of `view` from `backend`, which matched `part`, into those of the whole image.
    pub(super) async fn place(
        &mut self,
        frame: &Frame,
        view: View,
        part: &Pair,
        backend: &mut dyn Backend,
    ) -> Result<()> {
        self.mosaic.as_mut().expect("maps to place them in").place(frame, view, part, backend).await
    }

    /// Ends the tiles.
    pub(super) fn gather(&mut self) -> Result<()> {
        let (mut cpu, right) = self.mosaic.take().expect("maps to gather").gathered();
        cpu.keep_time(true)?;
        self.gathered = Some((cpu, right));
        Ok(())
    }

    /// Starts another look by `plan`, in the same maps. Returns the disparities and the validity of the last one.
    pub(super) async fn look_again(&mut self, plan: &Plan) -> Result<(Plane<i32>, Plane<u8>)> {
        let (mut cpu, right) = self.gathered.take().expect("maps of all tiles");
        self.times.extend(cpu.times().await?);
        let (pair, maps) = cpu.into_maps();
        let guess = (maps.disparity.clone(), maps.validity.clone());
        self.mosaic = Some(Mosaic::again(plan, pair, maps, right));
        Ok(guess)
    }

    /// Replaces the disparities of the left view by those of the right view.
    pub(super) fn place_right(&mut self) -> Result<()> {
        let (cpu, right) = self.gathered.as_mut().expect("maps of all tiles");
        let raw = std::mem::replace(right, Plane::filled(0, 0, 0)).mirrored();
        [Map::Raw, Map::Disparity].into_iter().try_for_each(|map| cpu.probe().write_map(map, &raw))
    }

    /// Asks for the maps of a view.
    pub(super) fn ask(&mut self, view: View, backend: &mut dyn Backend) -> Result<()> {
        debug_assert_eq!(view == View::Left, self.tickets.is_empty(), "the left view comes first");
        let ticket = self.target(backend).request_maps()?;
        self.tickets.push(ticket);
        Ok(())
    }

    /// Waits for the maps that were asked for, of an image of this size. Returns the number of idle iterations, unless tiles had their own.
    pub(super) async fn collect(
        &mut self,
        size: (usize, usize),
        backend: &mut dyn Backend,
        watch: &mut Watch<'_>,
    ) -> Result<Option<u32>> {
        let tickets = std::mem::take(&mut self.tickets);
        let found = watch.host_async("download", collected(self.target(backend), tickets)).await?;
        let (maps, idle) = found;
        self.maps = Some(maps.cut_to(size));
        let Some((mut cpu, _)) = self.gathered.take() else { return Ok(Some(idle)) };
        self.times.extend(cpu.times().await?);
        Ok(None)
    }

    /// Keeps the maps at the pair's own size for [`Self::join`].
    pub(super) fn put_aside(&mut self) {
        self.own = self.maps.take();
    }

    /// Merges the maps of both sizes.
    pub(super) fn join(&mut self, watch: &mut Watch<'_>) {
        let clock = Instant::now();
        let double = self.maps.take().expect("the maps at twice the size");
        let mut own = self.own.take().expect("the maps at the pair's own size");
        double_size::take_in(&mut own, &double);
        self.maps = Some(own);
        watch.followed.times.push(("double_size", clock.elapsed()));
    }
}

/// The maps of all views, and the number of idle iterations of the left one.
async fn collected(backend: &mut dyn Backend, tickets: Vec<Ticket>) -> Result<(Maps, u32)> {
    let mut tickets = tickets.into_iter();
    let (mut maps, idle) = backend.maps(tickets.next().expect("the left view was asked for")).await?;
    for ticket in tickets {
        maps.right = Some(right_map(backend.maps(ticket).await?.0));
    }
    Ok((maps, idle))
}

/// The map of the right view, from the maps of the mirrored pair.
fn right_map(maps: Maps) -> RightMap {
    RightMap {
        disparity: maps.disparity.mirrored(),
        // The runner-up of a right pixel is unknown.
        validity: maps.validity.mirrored().map(|validity| validity & !flag::LOW_CONFIDENCE),
    }
}
