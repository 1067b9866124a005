//! The stages on the CPU path, each in the file of its name.

use super::units::Units;
use super::volumes::Volumes;
use crate::backend::Stage;
use crate::program::Sent;
use std::ops::Range;

macro_rules! declare {
    (
        levels { $( $level:ident $level_name:ident; )* }
        level_rows { $( $level_row:ident $level_row_name:ident; )* }
        finest { $( $finest:ident $finest_name:ident; )* }
        finest_rows { $( $finest_row:ident $finest_row_name:ident; )* }
        maps { $( $map:ident $map_name:ident; )* }
    ) => {
        $( mod $level_name; )*
        $( mod $level_row_name; )*
        $( mod $finest_name; )*
        $( mod $finest_row_name; )*
        $( mod $map_name; )*

        impl<U: Units> Volumes<U> {
            /// Runs a stage on all rows.
            pub(super) fn run(&mut self, stage: Stage) {
                self.make_room(stage);
                match stage {
                    $( Stage::$level(z) => $level_name::run(self, z), )*
                    $( Stage::$finest => $finest_name::run(self), )*
                    $( Stage::$map => $map_name::run(&mut self.maps, &self.plan, &self.pair), )*
                    by_rows => {
                        let sent = self.begin(stage);
                        let height = self.plan.levels[stage.level().unwrap_or(0)].height;
                        self.run_rows(by_rows, sent, 0..height);
                    }
                }
            }

            /// Runs a band of rows of a stage.
            pub(super) fn run_rows(&mut self, stage: Stage, sent: Sent, rows: Range<usize>) {
                self.make_room(stage);
                match stage {
                    $( Stage::$level_row(z) => $level_row_name::rows(self, z, sent, rows), )*
                    $( Stage::$finest_row => $finest_row_name::rows(self, rows), )*
                    _ => unreachable!("{stage:?} does not go row by row"),
                }
            }
        }
    };
}

crate::for_every_stage!(declare);
