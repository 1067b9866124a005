//! Options of the message schedule.

use super::row::{one_of, options, real, whole, words};

words! {
    /// The order in which levels exchange messages.
    Order {
        /// All levels in every iteration.
        Together = "together",
        /// The coarsest level starts, and the finer ones join one after the other. Once all have joined, level 0 and the
        /// coarser levels take turns, as long as that changes the result.
        CoarseFirst = "coarse-first",
    }
}

words! {
    /// The size at which a pair is matched.
    MatchSize {
        /// Half its size. At full size, costs of a few labels then place the disparities, and colours their edges. Options
        /// that count pixels count those of half the size. A match takes a quarter of the time.
        Half = "half",
        /// Its own size.
        Full = "full",
        /// Its own size and twice that. Where both maps agree within a pixel, their mean is taken. Where only the larger pair
        /// measures a pixel, its disparity is taken. A match takes 7 times as long.
        Double = "double",
    }
}

options! {
    /// The size of the match, and the order and number of iterations.
    "schedule" ScheduleOptions {
        /// The size at which the pair is matched.
        match_size: MatchSize = MatchSize::Full, takes one_of(MatchSize::WORDS), source "not in the paper";
        /// The order in which levels exchange messages.
        order: Order = Order::CoarseFirst, takes one_of(Order::WORDS), source "algorithm 1: together", for reproduction;
        /// Iterations of all levels together; with coarse-first, iterations after each level but the finest
        /// has joined.
        iterations: u32 = 3, takes whole(1..=1000), unit "iterations", source "section 3: 20 to 30";
        /// Iterations after the finest level joins: every second one with the messages between levels, the others with
        /// those of the coarser levels. Only coarse-first uses it.
        final_iterations: u32 = 1, takes whole(0..=1000), unit "iterations", source "not in the paper";
        /// Number of looks at the pair. Each look after the first takes what the one before has filled in as a weak prior, with one
        /// iteration after each level has joined.
        looks: u32 = 2, takes whole(1..=8), unit "looks", source "not in the paper";
        /// Stop when the RMS change of the finest map from one iteration to the next is at most this; 0 runs all iterations.
        tolerance: f64 = 0.0, takes real(0.0..=1e6), unit "pixels", source "algorithm 1", for reproduction;
    }
}
