//! Compiles plan and tiles to the list of steps: the schedule, then the passes that change what is computed.

use super::tiles::Tiles;
use super::{Frame, Program, double_size, right_view, schedule, second_match, tiled};
use crate::error::Result;
use crate::options::LeftRightCheck;

impl Program {
    /// The match of an image cut into `tiles`, and also at twice its size if the method asks for it.
    ///
    /// # Errors
    /// [`crate::Error::Range`] and [`crate::Error::Budget`] if the match at twice the size does not fit.
    pub fn new(tiles: &Tiles) -> Result<Self> {
        let own = Self::at_one_size(tiles);
        match tiles.whole().doubled()? {
            Some(double) => Ok(double_size::follow(own, Self::at_one_size(&Tiles::new(&double)?))),
            None => Ok(own),
        }
    }

    fn at_one_size(tiles: &Tiles) -> Self {
        let whole = tiles.whole();
        let refinement = &whole.method.refinement;
        let mut program = Self { frames: vec![Frame::whole(whole)], steps: schedule::steps(whole) };
        if refinement.left_right_check == LeftRightCheck::SecondMatch {
            program = second_match::first(program);
        }
        if refinement.right_map {
            program.steps = right_view::follow(whole, program.steps);
        }
        if tiles.count() > 1 { tiled::cut(&program, tiles) } else { program }
    }
}
